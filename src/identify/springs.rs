//! The laws of the joints' springs against one another, alone and two at once, and against all else that could stand there.
//!
//! Where a bent spring's slopes meet cannot be seen from a straight one, so that searches about the fit pass it over; nor do its
//! slopes where they meet tell what the rows would be without it. So each is fitted in full.

use super::candidate::{Candidate, SPRING};
use super::decisions::{MATERIAL, caution};
use super::engine::Engine;
use super::found::Posterior;
use super::search::Search;
use std::collections::BTreeMap;

/// Evidence of what could stand in the springs' place, each about its own fit, nats, by the kinds that it names.
type Odds = BTreeMap<Vec<String>, f64>;

/// Evidence of a set about its own fit, nats, with all numbers, and the set.
type Best = (f64, Vec<Candidate>, Vec<usize>);

/// What could stand in the springs' place, weighed.
struct Springs {
    /// The chosen laws.
    own: Vec<usize>,
    odds: Odds,
    /// The best with its numbers, and its set.
    candidates: Vec<Candidate>,
    chosen: Vec<usize>,
}

impl Engine {
    /// Lets the other laws of the joints' springs, each fitted in full, and all else stand against the chosen ones.
    pub(super) fn contest(&mut self, posteriors: &mut Vec<Posterior>) {
        let mut odds = Odds::new();
        // Two that give way to one leave that to be weighed against the rest.
        loop {
            let before = self.chosen.clone();
            let Some(springs) = self.spring_laws(std::mem::take(&mut odds)) else { return };
            (self.candidates, self.chosen) = (springs.candidates.clone(), springs.chosen.clone());
            self.refit();
            if springs.own.iter().all(|own| self.chosen.contains(own)) {
                self.share_among_springs(posteriors, &springs);
                return;
            }
            let stays = |c: &usize| springs.own.contains(c) || !before.contains(c) && !self.candidates[*c].is_pattern();
            let now = self.chosen.iter().copied().find(stays);
            let is_own = |(c, _): &Posterior| springs.own.contains(c);
            let place = posteriors.iter().position(is_own);
            let known = place.map(|place| posteriors[place].1.clone());
            posteriors.retain(|posterior| !is_own(posterior));
            let (Some(now), Some(place), Some(known)) = (now, place, known) else { return };
            posteriors.insert(place, (now, known));
            if springs.own.len() == 1 {
                let springs = Springs { own: vec![now], ..springs };
                self.share_among_springs(posteriors, &springs);
                return;
            }
            odds = springs.odds;
        }
    }

    /// The posteriors of the chosen laws of the joints' springs against the others, each fitted in full.
    pub(super) fn weigh_springs(&mut self, posteriors: &mut [Posterior]) {
        let Some(springs) = self.spring_laws(Odds::new()) else { return };
        self.refit();
        self.share_among_springs(posteriors, &springs);
    }

    /// Each law fitted in full in the chosen ones' place, and all else weighed about the fit without it where there is one;
    /// `None` where none is chosen.
    fn spring_laws(&mut self, mut odds: Odds) -> Option<Springs> {
        let spring = |c: &usize| self.candidates[*c].family == SPRING;
        let own: Vec<usize> = self.chosen.iter().copied().filter(spring).collect();
        if own.is_empty() {
            return None;
        }
        let is_other = |c: &usize| self.candidates[*c].is_full_size() && (own.len() > 1 || !own.contains(c));
        let others: Vec<usize> = (0..self.candidates.len()).filter(|c| spring(c) && is_other(c)).collect();
        let mut best: Best = (self.objective_here(), self.candidates.clone(), self.chosen.clone());
        let mut kinds: Vec<String> = own.iter().map(|&c| self.candidates[c].kind.clone()).collect();
        kinds.sort_unstable();
        odds.insert(kinds, best.0);
        let state = (self.candidates.clone(), self.chosen.clone());
        for other in others {
            // Together with another law its numbers are not what they would be alone.
            let candidate = &mut self.candidates[other];
            candidate.values.clone_from(&candidate.start);
            let first = |c: usize| if c == own[0] { other } else { c };
            self.choose(state.1.iter().filter(|c| !own[1..].contains(c)).map(|&c| first(c)).collect());
            let value = self.objective_here();
            let known = odds.entry(vec![self.candidates[other].kind.clone()]).or_insert(value);
            *known = known.max(value);
            if value > best.0 {
                best = (value, self.candidates.clone(), self.chosen.clone());
            }
            (self.candidates, self.chosen) = state.clone();
        }
        match own[..] {
            [own] if self.candidates[own].law().is_some_and(|law| law.multiplies) => {
                self.weigh_elsewhere(own, &mut odds, &mut best);
            }
            [_] => {}
            _ => self.weigh_down(&own, &mut odds),
        }
        (self.candidates, self.chosen) = state;
        Some(Springs { own, odds, candidates: best.1, chosen: best.2 })
    }

    /// Takes from two laws at once what one gains that is not quite the spring's own.
    fn weigh_down(&mut self, own: &[usize], odds: &mut Odds) {
        self.choose(self.chosen.iter().copied().filter(|c| !own.contains(c)).collect());
        let nothing = self.objective_here();
        let alone = odds.iter().filter(|(kinds, _)| kinds.len() == 1).map(|(_, value)| *value);
        let gain = (alone.fold(nothing, f64::max) - nothing).max(0.0);
        odds.iter_mut().filter(|(kinds, _)| kinds.len() > 1).for_each(|(_, value)| *value -= MATERIAL * gain);
    }

    /// Weighs nothing, and all that is no law of the springs, in the place of one, about the fit without it.
    fn weigh_elsewhere(&mut self, own: usize, odds: &mut Odds, best: &mut Best) {
        let without: Vec<usize> = self.chosen.iter().copied().filter(|c| *c != own).collect();
        self.choose(without.clone());
        let all: Vec<usize> = (0..self.candidates.len()).collect();
        let linear = self.linearise(&all, &[self.shape]);
        let search = Search::new(&self.candidates, &linear.moments, &linear.always);
        odds.insert(Vec::new(), search.objective(&without));
        let mut likeliest: Option<(f64, Vec<usize>)> = None;
        for (kind, (value, set)) in search.in_place_of(own, &without, &|candidate| candidate.family != SPRING) {
            odds.insert(vec![kind.to_owned()], value);
            if value > likeliest.as_ref().map_or(best.0, |(most, _)| *most) {
                likeliest = Some((value, set));
            }
        }
        if let Some((_, set)) = likeliest {
            self.choose(set);
            let value = self.objective_here();
            if value > best.0 {
                *best = (value, self.candidates.clone(), self.chosen.clone());
            }
        }
    }

    /// The posteriors of what stands in the springs' place, from the odds of all that could; where others were not weighed about a
    /// fit of their own they keep theirs.
    fn share_among_springs(&self, posteriors: &mut [Posterior], springs: &Springs) {
        let fitted = self.problem.rows.iter().filter(|row| !row.held_out && !row.outlier);
        let caution = caution(fitted.map(|row| row.seen.count()).sum());
        let most = springs.odds.values().copied().fold(f64::NEG_INFINITY, f64::max);
        let weights: Vec<(&Vec<String>, f64)> =
            springs.odds.iter().map(|(kinds, odds)| (kinds, ((odds - most) / caution).exp())).collect();
        let total: f64 = weights.iter().map(|(_, weight)| weight).sum();
        let all_weighed = springs.odds.contains_key(&Vec::new());
        for (member, (share, rivals)) in posteriors.iter_mut().filter(|(c, _)| springs.own.contains(c)) {
            let kind = &self.candidates[*member].kind;
            rivals.retain(|(rival, _)| !all_weighed && !springs.odds.keys().any(|kinds| kinds.contains(rival)));
            let elsewhere: f64 = rivals.iter().map(|(_, share)| share).sum::<f64>().min(1.0 - f64::EPSILON);
            let scale = (1.0 - elsewhere) / total;
            *share = weights.iter().filter(|(kinds, _)| kinds.contains(kind)).map(|(_, weight)| scale * weight).sum();
            let mut others: BTreeMap<&String, f64> = BTreeMap::new();
            for (kinds, weight) in weights.iter().filter(|(kinds, _)| !kinds.contains(kind)) {
                kinds.iter().for_each(|other| *others.entry(other).or_default() += scale * weight);
            }
            rivals.extend(others.into_iter().map(|(other, share)| (other.clone(), share)));
            rivals.sort_by(|a, b| b.1.total_cmp(&a.1));
        }
    }
}
