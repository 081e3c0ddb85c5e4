//! Chooses the effects that measured parts show.
//!
//! Gear harmonics are searched first, because curves could imitate them. Then the rows are linearised about the present
//! fit, sets of effects are compared by their evidence, and the best set is fitted, until the set no longer changes. The
//! model of the whole arm replaces the set if its evidence is larger.

use super::candidate::Candidate;
use super::engine::{Engine, is_inflexible};
use super::found::{Model, Posterior, Ranking};
use super::input::Progress;
use super::noise;
use super::progress::{CHOSEN, SOLVED, SOUGHT, reached, within};
use super::search::{Search, sorted};
use deflex_cell::Cell;
use deflex_text::Diagnostic;

/// Largest number of rounds of linearising, choosing and fitting.
pub(super) const CHOOSING_ROUNDS: usize = 6;
/// Largest number of rounds of the search for gear harmonics, before flexible candidates are allowed.
const GEAR_ROUNDS: usize = 4;

/// The result of the search of sets; the set itself is the chosen one.
#[derive(Default)]
struct BestSet {
    posteriors: Vec<Posterior>,
    ranking: Ranking,
    /// The members of the model of the whole arm, if its evidence is larger than that of the set.
    whole_arm: Option<Vec<usize>>,
}

impl Engine {
    /// Searches the effects that the rows of measured parts show, and fits them.
    pub(super) fn model_of_part(&mut self, cell: &Cell, progress: &Progress<'_>) -> Result<Model, Vec<Diagnostic>> {
        self.find_gear_harmonics(cell, progress)?;
        self.choose_presliding();
        let BestSet { mut posteriors, ranking, whole_arm } = self.best_set(cell, progress)?;
        reached(progress, CHOSEN)?;
        if let Some(members) = whole_arm.or_else(|| self.whole_arm_for_unlisted()) {
            posteriors = self.take_whole_arm(members);
        } else {
            self.prune();
            posteriors.retain(|(c, _)| self.chosen.contains(c));
            self.contest(&mut posteriors);
            self.add_fault();
        }
        // Under forces that did not act no effect can be trusted.
        if self.forces_are_wrong() {
            posteriors.clear();
            self.remove_all_effects();
        }
        Ok(Model { posteriors, ranking })
    }

    /// Searches gear harmonics without flexible candidates: first with an empty set, then together with other effects.
    fn find_gear_harmonics(&mut self, cell: &Cell, progress: &Progress<'_>) -> Result<(), Vec<Diagnostic>> {
        let shapes = noise::shapes();
        for round in 0..GEAR_ROUNDS {
            reached(progress, within(SOLVED, SOUGHT, round, GEAR_ROUNDS))?;
            let wanted: Vec<usize> =
                (0..self.candidates.len()).filter(|&c| is_inflexible(&self.candidates[c])).collect();
            let tried = if round == 0 { shapes.clone() } else { self.shapes_about() };
            let now = self.linearise_narrowed(&wanted, &tried);
            let search = Search::new(&self.candidates, &now.moments, &now.always);
            let set = search.best_of(&self.chosen, &wanted);
            let score = self.score_of(&now, &search.columns(&set), &shapes);
            (self.sigma, self.shape) = (score.sigma, shapes[score.shape]);
            reached(progress, within(SOLVED, SOUGHT, 2 * round + 1, 2 * GEAR_ROUNDS))?;
            // Effects that were found without gear harmonics may only imitate them.
            if round == 0 && self.add_gear(&now) {
                continue;
            }
            self.choose(set);
            self.settle_cuts(cell)?;
            let tails = self.widen_tails();
            let jump = self.add_jumps();
            if !self.add_gear(&now) && !jump && !tails {
                break;
            }
        }
        Ok(())
    }

    /// Searches the set with the largest objective, and fits it, in rounds.
    fn best_set(&mut self, cell: &Cell, progress: &Progress<'_>) -> Result<BestSet, Vec<Diagnostic>> {
        let mut best = BestSet::default();
        let mut visited: Vec<Vec<usize>> = Vec::new();
        for round in 0..CHOOSING_ROUNDS {
            let shapes = self.shapes_about();
            let wanted: Vec<usize> = (0..self.candidates.len()).collect();
            reached(progress, within(SOUGHT, CHOSEN, round, CHOOSING_ROUNDS))?;
            let now = self.linearise(&wanted, &shapes);
            reached(progress, within(SOUGHT, CHOSEN, 2 * round + 1, 2 * CHOOSING_ROUNDS))?;
            let search = Search::new(&self.candidates, &now.moments, &now.always);
            let set = search.best(&self.chosen, &|_: &Candidate| true);
            let score = search.full(&set);
            let effects = set.iter().filter(|&&c| !self.candidates[c].is_pattern());
            best.posteriors = effects.map(|&c| (c, search.rivals(&set, c))).collect();
            if round == 0 {
                best.ranking = self.ranking(&search, &now);
            }
            (self.sigma, self.shape) = (score.sigma, shapes[score.shape]);
            // Two sets that are equally good can lead to one another.
            let same = sorted(&set) == sorted(&self.chosen) || visited.contains(&sorted(&set));
            visited.push(sorted(&self.chosen));
            if same {
                (self.sets, self.spread) = self.posterior_over_sets(&search, &now, &set, (score.sigma, score.shape));
            }
            let gate = same && self.shape.field.is_none();
            let field = if gate { self.field(&search, &now, &set) } else { None };
            let members = self.members_of_whole_arm(&search, &set);
            if self.gains_on(&search, &set, &members) {
                best.whole_arm = Some(members);
                break;
            }
            self.choose(set);
            self.settle_cuts(cell)?;
            let is_last = round + 1 == CHOOSING_ROUNDS;
            let unlisted = gate && !is_last && self.add_unlisted();
            let field = field.filter(|_| !unlisted);
            let outliers = self.mark_outliers() > 0;
            // Together with a field a harmonic can imitate any error, and it would be withdrawn.
            let seek = !is_last && self.shape.field.is_none();
            let gear = seek && self.add_gear(&now);
            let jump = seek && self.add_jumps();
            let tails = !is_last && self.widen_tails();
            let weighed = self.weigh_turns();
            let new = outliers || gear || jump || tails || unlisted || weighed;
            if new {
                visited.clear();
            }
            let settled = same && !new && !self.prune();
            if settled && field.is_none() {
                break;
            }
            self.shape = field.filter(|_| settled).unwrap_or(self.shape);
        }
        Ok(best)
    }

    /// The members of the model of the whole arm, if the set leaves an error that no effect explains.
    fn whole_arm_for_unlisted(&mut self) -> Option<Vec<usize>> {
        if !self.is_unlisted() {
            return None;
        }
        let all: Vec<usize> = (0..self.candidates.len()).collect();
        let now = self.linearise(&all, &[noise::Shape { field: None, ..self.shape }]);
        let search = Search::new(&self.candidates, &now.moments, &now.always);
        Some(self.members_of_whole_arm(&search, &self.chosen))
    }
}
