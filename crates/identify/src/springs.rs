//! Compares the laws of the joints' springs with one another, alone and two at a time, and with all other kinds that
//! could replace them.
//!
//! The search linearises about the present fit. The torque at which the slope of a piecewise linear spring changes has
//! no influence on the rows while both slopes are equal, so that a linearisation about a linear spring misses such a
//! law. A linearisation about the fitted law does not predict the rows without it. Therefore each law is fitted in
//! full.

use super::candidate::{Candidate, SPRING};
use super::decisions::{MATERIAL, caution};
use super::engine::Engine;
use super::found::Posterior;
use super::search::Search;
use std::collections::BTreeMap;

/// Objective of each alternative to the chosen laws about its own fit, nats, by the kinds that it names.
type Objectives = BTreeMap<Vec<String>, f64>;

/// Objective of a set about its own fit, nats, the candidates with their fitted numbers, and the set.
type Best = (f64, Vec<Candidate>, Vec<usize>);

/// The alternatives to the chosen laws of the springs.
struct Springs {
    /// Indices of the chosen laws.
    own: Vec<usize>,
    objectives: Objectives,
    /// The candidates with the fitted numbers of the best alternative, and its set.
    candidates: Vec<Candidate>,
    chosen: Vec<usize>,
}

impl Engine {
    /// Replaces the chosen laws of the joints' springs if an alternative has a larger objective, and computes their
    /// posteriors.
    pub(super) fn contest(&mut self, posteriors: &mut Vec<Posterior>) {
        let mut objectives = Objectives::new();
        // If one law replaces two, it is compared with the other alternatives in a second round.
        loop {
            let before = self.chosen.clone();
            let Some(springs) = self.spring_laws(std::mem::take(&mut objectives)) else { return };
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
            objectives = springs.objectives;
        }
    }

    /// Computes the posteriors of the chosen laws of the joints' springs against the alternatives, and does not replace
    /// a law.
    pub(super) fn weigh_springs(&mut self, posteriors: &mut [Posterior]) {
        let Some(springs) = self.spring_laws(Objectives::new()) else { return };
        self.refit();
        self.share_among_springs(posteriors, &springs);
    }

    /// The objectives of the alternatives to the chosen laws of the springs, added to those that are known. Each other
    /// law is fitted in full in the place of the chosen ones. If one law is chosen, and its numbers multiply one
    /// another, all other kinds are compared about the fit without it. `None` if no law is chosen.
    fn spring_laws(&mut self, mut objectives: Objectives) -> Option<Springs> {
        let spring = |c: &usize| self.candidates[*c].family == SPRING;
        let own: Vec<usize> = self.chosen.iter().copied().filter(spring).collect();
        if own.is_empty() {
            return None;
        }
        let is_other = |c: &usize| self.candidates[*c].is_typical_size() && (own.len() > 1 || !own.contains(c));
        let others: Vec<usize> = (0..self.candidates.len()).filter(|c| spring(c) && is_other(c)).collect();
        let mut best: Best = (self.objective_here(), self.candidates.clone(), self.chosen.clone());
        let mut kinds: Vec<String> = own.iter().map(|&c| self.candidates[c].kind.clone()).collect();
        kinds.sort_unstable();
        objectives.insert(kinds, best.0);
        let state = (self.candidates.clone(), self.chosen.clone());
        for other in others {
            // The fit begins at the start values, because numbers that were fitted together with another law are no
            // good start.
            let candidate = &mut self.candidates[other];
            candidate.values.clone_from(&candidate.start);
            let first = |c: usize| if c == own[0] { other } else { c };
            self.choose(state.1.iter().filter(|c| !own[1..].contains(c)).map(|&c| first(c)).collect());
            let value = self.objective_here();
            let known = objectives.entry(vec![self.candidates[other].kind.clone()]).or_insert(value);
            *known = known.max(value);
            if value > best.0 {
                best = (value, self.candidates.clone(), self.chosen.clone());
            }
            (self.candidates, self.chosen) = state.clone();
        }
        match own[..] {
            [own] if self.candidates[own].law().is_some_and(|law| law.multiplies) => {
                self.compare_other_kinds(own, &mut objectives, &mut best);
            }
            [_] => {}
            _ => self.charge_second_law(&own, &mut objectives),
        }
        (self.candidates, self.chosen) = state;
        Some(Springs { own, objectives, candidates: best.1, chosen: best.2 })
    }

    /// Subtracts from the objective of two laws a share [`MATERIAL`] of the gain of the best single law: a
    /// second law must explain more than an imperfection of the first.
    fn charge_second_law(&mut self, own: &[usize], objectives: &mut Objectives) {
        self.choose(self.chosen.iter().copied().filter(|c| !own.contains(c)).collect());
        let nothing = self.objective_here();
        let alone = objectives.iter().filter(|(kinds, _)| kinds.len() == 1).map(|(_, value)| *value);
        let gain = (alone.fold(nothing, f64::max) - nothing).max(0.0);
        objectives.iter_mut().filter(|(kinds, _)| kinds.len() > 1).for_each(|(_, value)| *value -= MATERIAL * gain);
    }

    /// Adds the objectives of no effect, and of all kinds that are no law of the springs, in the place of
    /// the chosen law. They are computed about the fit without this law.
    fn compare_other_kinds(&mut self, own: usize, objectives: &mut Objectives, best: &mut Best) {
        let without: Vec<usize> = self.chosen.iter().copied().filter(|c| *c != own).collect();
        self.choose(without.clone());
        let all: Vec<usize> = (0..self.candidates.len()).collect();
        let linear = self.linearise(&all, &[self.shape]);
        let search = Search::new(&self.candidates, &linear.moments, &linear.always);
        objectives.insert(Vec::new(), search.objective(&without));
        let mut likeliest: Option<(f64, Vec<usize>)> = None;
        for (kind, (value, set)) in search.in_place_of(&without, &|candidate| candidate.family != SPRING) {
            objectives.insert(vec![kind.to_owned()], value);
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

    /// Sets the posteriors of the laws from the objectives of all alternatives. If the kinds that are no law of the
    /// springs were not compared, they keep their probabilities.
    fn share_among_springs(&self, posteriors: &mut [Posterior], springs: &Springs) {
        let fitted = self.problem.rows.iter().filter(|row| !row.held_out && !row.outlier);
        let caution = caution(fitted.map(|row| row.reading.count()).sum());
        let most = springs.objectives.values().copied().fold(f64::NEG_INFINITY, f64::max);
        let weights: Vec<(&Vec<String>, f64)> =
            springs.objectives.iter().map(|(kinds, value)| (kinds, ((value - most) / caution).exp())).collect();
        let total: f64 = weights.iter().map(|(_, weight)| weight).sum();
        let all_compared = springs.objectives.contains_key(&Vec::new());
        for (member, (share, rivals)) in posteriors.iter_mut().filter(|(c, _)| springs.own.contains(c)) {
            let kind = &self.candidates[*member].kind;
            rivals.retain(|(rival, _)| !all_compared && !springs.objectives.keys().any(|kinds| kinds.contains(rival)));
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
