//! The answer from every row: once held-out rows have judged it, they are evidence like any others.

use super::candidate::Candidate;
use super::decisions::LIKELIER;
use super::engine::Engine;
use super::found::Posterior;
use super::search::Search;
use crate::effects::{Shape, kind};

impl Engine {
    /// Fits the chosen numbers to every row, for the cell that is written, and weighs on all of them what could stand in
    /// each member's place. Errors stay those of what was chosen without the held-out rows.
    pub(super) fn take_all_rows(&mut self, posteriors: &mut [Posterior]) {
        let marks: Vec<(bool, bool)> = self.problem.rows.iter().map(|row| (row.held_out, row.outlier)).collect();
        let state = (self.candidates.clone(), self.covariance.clone());
        self.problem.rows.iter_mut().for_each(|row| row.held_out = false);
        let map = self.map.take();
        self.refit();
        // Held-out rows were let off with all but blunders; here they would pull.
        if self.mark_outliers() > 0 {
            self.refit();
        }
        if self.residual().iter().any(|v| !v.is_finite()) {
            (self.candidates, self.covariance) = state;
        } else if !self.is_whole_arm() {
            self.weigh_anew(posteriors);
            self.take_likelier(posteriors);
        }
        self.map = map.and_then(|map| self.renewed_map(map));
        for (row, (held_out, outlier)) in self.problem.rows.iter_mut().zip(marks) {
            (row.held_out, row.outlier) = (held_out, outlier);
        }
    }

    /// Takes an effect that is likelier than the chosen one on all rows in its place: what is written is to be what most rows speak
    /// for, though the reported error is that of the effect found without the held-out rows.
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

    /// Posteriors of the chosen members, and over sets, about the fit as it is.
    pub(super) fn weigh_anew(&mut self, posteriors: &mut [Posterior]) {
        let shapes = self.shapes_about();
        let (all, set): (Vec<usize>, _) = ((0..self.candidates.len()).collect(), self.chosen.clone());
        let linear = self.linearise(&all, &shapes);
        let search = Search::new(&self.candidates, &linear.moments, &linear.always);
        search.narrow(&all);
        // A map names nothing and has no rivals.
        let named = |c: usize| self.candidates[c].law().is_none_or(|law| law.shape != Shape::Map);
        for (c, told) in posteriors.iter_mut().filter(|(c, _)| named(*c)) {
            *told = search.rivals(&set, *c, &Candidate::is_named);
        }
        let score = search.full(&set);
        (self.sets, self.spread) = self.posterior_over_sets(&search, &linear, &set, (score.sigma, score.shape));
        drop(linear);
        self.weigh_springs(posteriors);
    }
}
