//! Chooses the set of effects for poses over the whole robot (`--poses`), whose hundreds of columns are too many for
//! swaps and pairs.
//!
//! Effects that are no curves are added first, one by one. Then every joint's curve is tried with the smoothness of
//! most evidence given the other members. A curve can hide other curves and smaller effects, so that curves and effects
//! are tried in turns until the set no longer changes. A significant gain is not enough for a member, because with
//! thousands of rows every wrong detail of the model is significant: its gain must exceed [`GAIN_A_SCALAR`] for each
//! scalar.

use super::columns::Columns;
use super::decisions::{FLEXIBLE, GAIN_A_SCALAR, PRICE};
use super::device_pose;
use super::engine::Engine;
use super::found::{Choice, Linearised, Model, Ranking};
use super::input::Progress;
use super::part::CHOOSING_ROUNDS;
use super::progress::{CHOSEN, SOUGHT, reached, within};
use super::search::{MOST_MEMBERS, Search};
use super::smooth::{ConditionalEvidence, Curve};
use deflex_effects::Stage;
use deflex_text::Diagnostic;
use nalgebra::DVector;

/// Largest number of turns of curves and effects.
const SWEEPS: usize = 8;
/// New outliers are few if they are at most one row in this many: of ten thousand rows a few are outliers in every
/// round.
const FEW: usize = 500;

impl Engine {
    /// Searches the effects that poses over the whole robot show, and fits them.
    pub(super) fn model_of_robot(&mut self, progress: &Progress<'_>) -> Result<Model, Vec<Diagnostic>> {
        let wanted: Vec<usize> = (0..self.candidates.len()).collect();
        let mut ranking = Ranking::default();
        for round in 0..CHOOSING_ROUNDS {
            let shapes = self.shapes_about();
            reached(progress, within(SOUGHT, CHOSEN, round, CHOOSING_ROUNDS))?;
            let now = self.linearise(&wanted, &shapes);
            reached(progress, within(SOUGHT, CHOSEN, 2 * round + 1, 2 * CHOOSING_ROUNDS))?;
            let Choice { set, sigma, shape } = self.choose_in_stages(&now);
            if round == 0 {
                let search = Search::new(&self.candidates, &now.moments, &now.always);
                ranking = self.ranking(&search, &now);
            }
            (self.sigma, self.shape) = (sigma, shapes[shape]);
            let same = self.families(&set) == self.families(&self.chosen);
            self.choose(set);
            let outliers = self.mark_outliers() > self.problem.rows.len() / FEW;
            if !self.weigh_turns() && !outliers && same {
                break;
            }
        }
        reached(progress, CHOSEN)?;
        self.drop_without_gain();
        // Every member has gained far more than its price.
        let effects = self.chosen.iter().filter(|&&c| !self.candidates[c].is_pattern());
        let posteriors = effects.map(|&c| (c, (1.0, Vec::new()))).collect();
        Ok(Model { posteriors, ranking })
    }

    /// Chooses the set, and sets the smoothness of every curve in it. Its members are in the order of their stages.
    fn choose_in_stages(&mut self, linear: &Linearised) -> Choice {
        let count = linear.moments.first().map_or(0, |moments| moments.count);
        let least = GAIN_A_SCALAR * count as f64;
        let mut choice = self.choose_without_curves(linear, least);
        let curves: Vec<usize> = (0..self.candidates.len()).filter(|&c| self.candidates[c].curve.is_some()).collect();
        for sweep in 0..SWEEPS {
            let before = choice.set.clone();
            for &c in &curves {
                let mut others = choice.set.clone();
                others.retain(|&o| o != c);
                let Some(evidence) = self.conditional_evidence(linear, &others, &choice) else { continue };
                let Some(curve) = &self.candidates[c].curve else { continue };
                let own = Columns::independent(self.candidates[c].columns().map(|column| (column, 1.0)).collect());
                let (gain, smoothness) = curve.best_smoothness(&evidence, &own);
                // Only the first curve pays the price of flexibility: that there are curves at all is one decision.
                let first = !others.iter().any(|o| curves.contains(o));
                let search = Search::new(&self.candidates, &linear.moments, &linear.always);
                let price = search.price(c) - if first { 0.0 } else { FLEXIBLE };
                choice.set = others;
                if gain - price > least {
                    choice.set.push(c);
                    if let Some(curve) = &mut self.candidates[c].curve {
                        curve.smoothness = smoothness;
                    }
                }
            }
            if sweep == 0 && !choice.set.iter().any(|c| curves.contains(c)) {
                self.add_all_curves(linear, &curves, &mut choice, least);
            }
            let search = Search::new(&self.candidates, &linear.moments, &linear.always);
            let score = search.near(&choice.set, Some(choice.sigma));
            (choice.sigma, choice.shape) = (score.sigma, score.shape);
            if let Some(evidence) = self.conditional_evidence(linear, &choice.set, &choice) {
                let without = Search::new(&self.candidates, &linear.moments, &[]);
                let gain = |c: usize| (evidence.gain(&without.columns(&[c])) - search.price(c), c);
                let joins = |c: &usize| self.candidates[*c].curve.is_none() && search.joins(&choice.set, *c);
                let best = (0..self.candidates.len()).filter(joins).map(gain).max_by(|a, b| a.0.total_cmp(&b.0));
                if let Some((_, c)) = best.filter(|(gain, _)| *gain > least) {
                    choice.set.push(c);
                }
            }
            let same = before.len() == choice.set.len() && before.iter().all(|c| choice.set.contains(c));
            if same {
                break;
            }
        }
        let stage = |c: &usize| match &self.candidates[*c] {
            candidate if candidate.curve.is_some() => Stage::Curves,
            candidate => candidate.law().map_or(Stage::Remainder, |kind| kind.stage),
        };
        choice.set.sort_by_key(stage);
        choice
    }

    /// Adds all curves at once, with one smoothness, if together they gain enough. With few rows no single curve does,
    /// because the errors of the others count as noise.
    fn add_all_curves(&mut self, linear: &Linearised, curves: &[usize], choice: &mut Choice, least: f64) {
        let alone = Search::new(&self.candidates, &linear.moments, &linear.always)
            .near(&choice.set, Some(choice.sigma))
            .evidence;
        let set = [&choice.set[..], curves].concat();
        let mut best = (alone + PRICE + FLEXIBLE + Curve::variants().ln() + least, None);
        let set_smoothness = |engine: &mut Self, index: usize| {
            for &c in curves {
                if let Some(curve) = &mut engine.candidates[c].curve {
                    curve.set_smoothness(index);
                }
            }
        };
        for index in Curve::representative() {
            set_smoothness(self, index);
            let score =
                Search::new(&self.candidates, &linear.moments, &linear.always).near(&set, Some(0.5 * choice.sigma));
            if score.evidence > best.0 {
                best = (score.evidence, Some((index, score)));
            }
        }
        if let Some((index, score)) = best.1 {
            set_smoothness(self, index);
            *choice = Choice { set, sigma: score.sigma, shape: score.shape };
        }
    }

    /// Error of the held-out rows before and after each chosen effect, mm rms, as if the effects were found one after
    /// another: each stage is fitted afresh together with the stages before it. All curves of the joints are one stage.
    pub(super) fn stage_errors(&mut self) -> Vec<(f64, f64)> {
        let state = (self.candidates.clone(), self.chosen.clone(), self.covariance.clone());
        let places = device_pose::places(&self.problem);
        let run_drift = self.run_drift(&self.residual());
        let last = self.held_out_rms_mm(&run_drift);
        let curved = |engine: &Self, c: &usize| engine.candidates[*c].curve.is_some();
        let ends: Vec<usize> = (1..=state.1.len())
            .filter(|&n| n == state.1.len() || !(curved(self, &state.1[n - 1]) && curved(self, &state.1[n])))
            .collect();
        self.choose(Vec::new());
        let mut reached = self.held_out_rms_mm(&run_drift);
        let mut all = Vec::new();
        for end in ends {
            let before = reached;
            reached = if end == state.1.len() {
                last
            } else {
                self.choose(state.1[..end].to_vec());
                self.held_out_rms_mm(&run_drift)
            };
            all.resize(end, (before, reached));
        }
        (self.candidates, self.chosen, self.covariance) = state;
        device_pose::restore(&mut self.problem, &places);
        all
    }

    /// Error of the held-out rows without the run's drift, mm rms.
    fn held_out_rms_mm(&self, run_drift: &DVector<f64>) -> f64 {
        self.errors(&(self.residual() - run_drift), |row| row.held_out).rms_mm
    }

    /// Drops, one by one, the members without which the log posterior falls by less than [`PRICE`] nats, while the
    /// numbers of the others are kept: the bounds of their numbers exclude those that would help (a gap is not
    /// negative), or a later stage explains the same.
    fn drop_without_gain(&mut self) {
        loop {
            let linear = self.linearise(&[], &[self.shape]);
            let here = self.misfit(&linear);
            let set = self.chosen.clone();
            let gain = |c: usize| {
                self.chosen = set.iter().copied().filter(|&o| o != c).collect();
                // The misfit is minus twice the log posterior.
                (0.5 * (self.misfit(&linear) - here), c)
            };
            let worst = set.iter().copied().map(gain).min_by(|a, b| a.0.total_cmp(&b.0));
            self.chosen = set;
            match worst.filter(|(gain, _)| *gain < PRICE) {
                Some((_, c)) => self.choose(self.chosen.iter().copied().filter(|&o| o != c).collect()),
                None => return,
            }
        }
    }

    /// The evidence that further columns add to a set, under the noise of a choice.
    fn conditional_evidence<'a>(
        &self,
        linear: &'a Linearised,
        set: &[usize],
        choice: &Choice,
    ) -> Option<ConditionalEvidence<'a>> {
        let search = Search::new(&self.candidates, &linear.moments, &linear.always);
        ConditionalEvidence::new(&linear.moments[choice.shape], search.columns(set), choice.sigma)
    }

    /// The set that results if, of the effects that are no curves, the one that gains most is added until none gains
    /// `least`, nats.
    fn choose_without_curves(&self, linear: &Linearised, least: f64) -> Choice {
        let search = Search::new(&self.candidates, &linear.moments, &linear.always);
        let pool: Vec<usize> = (0..self.candidates.len()).filter(|&c| self.candidates[c].curve.is_none()).collect();
        search.narrow(&pool);
        let mut set: Vec<usize> = Vec::new();
        for _ in 0..MOST_MEMBERS {
            let value = search.objective(&set);
            let gain = |&c: &usize| (search.objective(&[&set[..], &[c]].concat()) - value, c);
            let best = pool.iter().filter(|&&c| search.joins(&set, c)).map(gain).max_by(|a, b| a.0.total_cmp(&b.0));
            match best.filter(|(gain, _)| *gain > least) {
                Some((_, c)) => set.push(c),
                None => break,
            }
        }
        let score = search.full(&set);
        Choice { set, sigma: score.sigma, shape: score.shape }
    }
}
