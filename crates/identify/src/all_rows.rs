//! Computes the final numbers and probabilities from all rows: when the held-out rows have judged the answer, they are
//! evidence like the others.

use super::candidate::Candidate;
use super::decisions::LIKELIER;
use super::engine::Engine;
use super::found::Posterior;
use super::search::Search;
use deflex_effects::{Shape, kind};

impl Engine {
    /// Fits the chosen numbers to all rows, for the cell that is written, and computes the probabilities of the members
    /// and of their rivals from all rows. The reported errors remain those of the fit without the held-out rows.
    pub(super) fn take_all_rows(&mut self, posteriors: &mut [Posterior]) {
        let marks: Vec<(bool, bool)> = self.problem.rows.iter().map(|row| (row.held_out, row.outlier)).collect();
        let state = (self.candidates.clone(), self.covariance.clone());
        self.problem.rows.iter_mut().for_each(|row| row.held_out = false);
        let map = self.map.take();
        self.refit();
        // Of the held-out rows only blunders were marked; now that they are fitted, the limit of the fitted rows holds
        // for them.
        if self.mark_outliers() > 0 {
            self.refit();
        }
        if self.residual().iter().any(|v| !v.is_finite()) {
            (self.candidates, self.covariance) = state;
        } else if !self.is_whole_arm() {
            self.recompute_posteriors(posteriors);
            self.take_likelier(posteriors);
        }
        self.map = map.and_then(|map| self.renewed_map(map));
        for (row, (held_out, outlier)) in self.problem.rows.iter_mut().zip(marks) {
            (row.held_out, row.outlier) = (held_out, outlier);
        }
    }

    /// Replaces a chosen effect by its most probable rival if the rival is clearly more probable on all rows: the
    /// written effect is that of all rows, although the reported error is that of the effect which was found without
    /// the held-out rows.
    fn take_likelier(&mut self, posteriors: &mut [Posterior]) {
        for place in 0..posteriors.len() {
            let (member, (share, rivals)) = &posteriors[place];
            let (member, share) = (*member, *share);
            let likelier = rivals.iter().find(|(rival, _)| kind(rival).is_some());
            let Some((rival, more)) = likelier.filter(|(_, other)| *other > LIKELIER * share).cloned() else {
                continue;
            };
            let without: Vec<usize> = self.chosen.iter().copied().filter(|&c| c != member).collect();
            let all: Vec<usize> = (0..self.candidates.len()).collect();
            let linear = self.linearise(&all, &[self.shape]);
            let search = Search::new(&self.candidates, &linear.moments, &linear.always);
            let in_place = search.in_place_of(member, &without, &|candidate| candidate.kind == rival);
            let Some((_, set)) = in_place.into_values().next() else { continue };
            let (others, faults): (Vec<usize>, Vec<usize>) =
                set.into_iter().filter(|c| !without.contains(c)).partition(|&c| self.candidates[c].kind == rival);
            let Some(&other) = others.first() else { continue };
            let state = (self.candidates.clone(), self.chosen.clone(), self.covariance.clone());
            let own = self.candidates[member].kind.clone();
            let swapped = |&c: &usize| if c == member { other } else { c };
            self.choose(state.1.iter().map(swapped).chain(faults).collect());
            if self.residual().iter().any(|v| !v.is_finite()) {
                (self.candidates, self.chosen, self.covariance) = state;
                continue;
            }
            let (c, (now, rivals)) = &mut posteriors[place];
            (*c, *now) = (other, more);
            let known = rivals.iter_mut().find(|(kind, _)| *kind == self.candidates[other].kind);
            if let Some(known) = known {
                *known = (own, share);
            }
            rivals.sort_by(|a, b| b.1.total_cmp(&a.1));
        }
    }

    /// Computes the posteriors of the chosen members, and over sets, about the present fit.
    pub(super) fn recompute_posteriors(&mut self, posteriors: &mut [Posterior]) {
        let shapes = self.shapes_about();
        let (all, set): (Vec<usize>, _) = ((0..self.candidates.len()).collect(), self.chosen.clone());
        let linear = self.linearise(&all, &shapes);
        let search = Search::new(&self.candidates, &linear.moments, &linear.always);
        search.narrow(&all);
        // A map names nothing and has no rivals.
        let named = |c: usize| self.candidates[c].law().is_none_or(|law| law.shape != Shape::Map);
        for (c, posterior) in posteriors.iter_mut().filter(|(c, _)| named(*c)) {
            *posterior = search.rivals(&set, *c, &Candidate::is_named);
        }
        let score = search.full(&set);
        (self.sets, self.spread) = self.posterior_over_sets(&search, &linear, &set, (score.sigma, score.shape));
        drop(linear);
        self.weigh_springs(posteriors);
    }
}
