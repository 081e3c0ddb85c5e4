//! The set of effects for data over the whole robot: hundreds of columns, too many for swaps and pairs.
//!
//! Physical effects come first, one by one. Then the joints' curves, each with the smoothness of most evidence together with the
//! others: curves hide one another and whatever is smaller, so that both are tried again until nothing gains. A member
//! must explain a share of what is left, not only be significant: with thousands of rows any wrong detail of the model is.

use super::columns::Columns;
use super::decisions::{FLEXIBLE, GAIN_A_ROW, PRICE};
use super::device_pose;
use super::engine::Engine;
use super::found::{Choice, Linearised};
use super::search::{MOST_MEMBERS, Search};
use super::smooth::{Beside, Curve};
use crate::effects::Stage;
use nalgebra::DVector;

/// Times that curves and effects are tried in turns.
const SWEEPS: usize = 8;

impl Engine {
    /// The set, and the smoothness of every curve in it.
    pub(super) fn staged(&mut self, linear: &Linearised) -> Choice {
        let count = linear.moments.first().map_or(0, |moments| moments.count);
        let least = GAIN_A_ROW * count as f64;
        let mut choice = self.stiff(linear, least);
        let curves: Vec<usize> = (0..self.candidates.len()).filter(|&c| self.candidates[c].curve.is_some()).collect();
        for sweep in 0..SWEEPS {
            let before = choice.set.clone();
            for &c in &curves {
                let mut others = choice.set.clone();
                others.retain(|&o| o != c);
                let Some(beside) = self.beside(linear, &others, &choice) else { continue };
                let Some(curve) = &self.candidates[c].curve else { continue };
                let own = Columns::independent(self.candidates[c].columns().map(|column| (column, 1.0)).collect());
                let (gain, smoothness) = curve.smoothest(&beside, &own);
                // That there are curves at all is paid for once.
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
                self.all_curves(linear, &curves, &mut choice, least);
            }
            let search = Search::new(&self.candidates, &linear.moments, &linear.always);
            let score = search.near(&choice.set, Some(choice.sigma));
            (choice.sigma, choice.shape) = (score.sigma, score.shape);
            if let Some(beside) = self.beside(linear, &choice.set, &choice) {
                let without = Search::new(&self.candidates, &linear.moments, &[]);
                let gain = |c: usize| (beside.gain(&without.columns(&[c])) - search.price(c), c);
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

    /// Takes all curves at once, if they gain together: where rows are few, none stands out of what the others leave.
    fn all_curves(&mut self, linear: &Linearised, curves: &[usize], choice: &mut Choice, least: f64) {
        let alone = Search::new(&self.candidates, &linear.moments, &linear.always)
            .near(&choice.set, Some(choice.sigma))
            .evidence;
        let set = [&choice.set[..], curves].concat();
        let mut best = (alone + PRICE + FLEXIBLE + Curve::variants().ln() + least, None);
        let take = |engine: &mut Self, number: usize| {
            for &c in curves {
                if let Some(curve) = &mut engine.candidates[c].curve {
                    curve.take(number);
                }
            }
        };
        for number in Curve::common() {
            take(self, number);
            let score =
                Search::new(&self.candidates, &linear.moments, &linear.always).near(&set, Some(0.5 * choice.sigma));
            if score.evidence > best.0 {
                best = (score.evidence, Some((number, score)));
            }
        }
        if let Some((number, score)) = best.1 {
            take(self, number);
            *choice = Choice { set, sigma: score.sigma, shape: score.shape };
        }
    }

    /// Held-out error before and after each chosen effect, mm rms, as if the effects were found one after another: every
    /// stage is fitted afresh with those before it. The joints' curves are one stage.
    pub(super) fn stages(&mut self) -> Vec<(f64, f64)> {
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

    /// Held-out error with the run's drift taken off, mm rms.
    fn held_out_rms_mm(&self, run_drift: &DVector<f64>) -> f64 {
        self.errors(&(self.residual() - run_drift), |row| row.held_out).rms_mm
    }

    /// Drops members whose fitted numbers leave the rows as they are without them: within bounds they do nothing, though
    /// beyond would help (a gap that is not negative), or what one stage gave them a later one took.
    pub(super) fn drop_idle(&mut self) {
        loop {
            let linear = self.linearise(&[], &[self.shape]);
            let here = self.misfit(&linear);
            let set = self.chosen.clone();
            let gain = |c: usize| {
                self.chosen = set.iter().copied().filter(|&o| o != c).collect();
                // Twice nats.
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

    fn beside<'a>(&self, linear: &'a Linearised, set: &[usize], choice: &Choice) -> Option<Beside<'a>> {
        let search = Search::new(&self.candidates, &linear.moments, &linear.always);
        Beside::new(&linear.moments[choice.shape], search.columns(set), choice.sigma)
    }

    /// Physical effects that gain, one by one.
    fn stiff(&self, linear: &Linearised, least: f64) -> Choice {
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
