//! Fitting the chosen effects together: down the slope, over to lookalikes, and without what is not needed.

use super::candidates::{SPRING, fitted};
use super::device;
use super::engine::{Engine, Linearised, Posterior};
use super::noise;
use super::score::posterior;
use super::search::{CAUTION, Search};
use nalgebra::DMatrix;
use std::collections::BTreeMap;

/// Steps of a refit at most, and how often one is halved.
const REFITS: usize = 8;
const HALVINGS: usize = 5;
/// Changes below this share of the typical sizes are no longer followed.
const SETTLED: f64 = 1e-4;
/// What a member must gain beyond its price when the others are fitted anew without it, nats.
const CLEARLY: f64 = 5.0;
/// Leaps to lookalikes in a refit at most, and what one must gain, twice nats.
const LEAPS: usize = 5;
const LEAP: f64 = 1.0;

impl Engine {
    /// Fits the chosen numbers: down the nearest slope, then from any lookalike that is better.
    pub(super) fn refit(&mut self) {
        for _ in 0..LEAPS {
            self.descend();
            if self.problem.free_device || !self.leap() {
                break;
            }
        }
    }

    /// Takes the best lookalike of a chosen effect, if it is better than what is there.
    pub(super) fn leap(&mut self) -> bool {
        let linear = self.linearise(&self.patterns(), &[]);
        let here = self.misfit(&linear);
        let mut best = (here - LEAP, None);
        for c in self.chosen.clone() {
            let Some(effect) = fitted(&self.declared, &self.candidates[c]) else { continue };
            let now = self.candidates[c].values.clone();
            for other in effect.lookalikes() {
                self.candidates[c].values = other.parameters().iter().map(|p| p.value).collect();
                let there = self.misfit(&linear);
                if there < best.0 {
                    best = (there, Some((c, self.candidates[c].values.clone())));
                }
            }
            self.candidates[c].values = now;
        }
        let Some((c, values)) = best.1 else { return false };
        self.candidates[c].values = values;
        true
    }

    /// Gauss-Newton on the chosen numbers with their priors, noise as last chosen; steps are halved until they gain.
    pub(super) fn descend(&mut self) {
        for _ in 0..REFITS {
            let chosen = self.chosen.clone();
            let linear = self.linearise(&chosen, &[self.shape]);
            let moments = &linear.moments[0];
            let columns = Search::new(&self.candidates, &linear.moments, &linear.always).columns(&chosen);
            let Some((mean, covariance)) = posterior(moments, &columns, self.sigma) else { return };
            let frames = linear.always.len();
            let mut unknown = 0;
            for run in 0..self.problem.devices.len() {
                let unknowns = self.problem.devices[run].unknowns();
                device::shift(&mut self.problem, run, &mean.as_slice()[unknown..unknown + unknowns]);
                unknown += unknowns;
            }
            // Intervals are those of the full prior: directions that the data do not hold are as wide as it is.
            let wide: Vec<_> = columns.iter().map(|&(column, _)| (column, 1.0)).collect();
            let covariance = posterior(moments, &wide, self.sigma).map_or(covariance, |(_, wide)| wide);
            let size = covariance.nrows() - frames;
            self.covariance = covariance.view((frames, frames), (size, size)).into_owned();
            let now: Vec<Vec<f64>> = chosen.iter().map(|&c| self.candidates[c].values.clone()).collect();
            let mut at = frames;
            let aim: Vec<Vec<f64>> = chosen
                .iter()
                .map(|&c| {
                    let candidate = &self.candidates[c];
                    let number = |k: usize| {
                        let (low, high) = candidate.bounds[k];
                        (candidate.start[k] + candidate.size(k) * mean[at + k]).clamp(low, high)
                    };
                    let values = (0..candidate.values.len()).map(number).collect();
                    at += candidate.values.len();
                    values
                })
                .collect();
            // An instrument that was moved has moved already, and its problem is as good as linear.
            let halvings = if frames > 0 { 0 } else { HALVINGS };
            let before = self.misfit(&linear);
            let mut step = 1.0;
            for left in (0..=halvings).rev() {
                for ((&c, now), aim) in chosen.iter().zip(&now).zip(&aim) {
                    let candidate = &mut self.candidates[c];
                    for (k, value) in candidate.values.iter_mut().enumerate() {
                        *value = now[k] + step * (aim[k] - now[k]);
                    }
                }
                if left == 0 || self.misfit(&linear) <= before {
                    break;
                }
                step *= 0.5;
            }
            let change = |(c, (now, aim)): (&usize, (&Vec<f64>, &Vec<f64>))| {
                let candidate = &self.candidates[*c];
                let each = |k: usize| step * (aim[k] - now[k]).abs() / candidate.typical[k];
                if candidate.is_pattern() { 0.0 } else { (0..now.len()).map(each).fold(0.0, f64::max) }
            };
            let largest = chosen.iter().zip(now.iter().zip(&aim)).map(change).fold(0.0, f64::max);
            if largest < SETTLED {
                break;
            }
        }
    }

    /// Minus twice the log posterior of the chosen numbers, but for a constant.
    pub(super) fn misfit(&self, linear: &Linearised) -> f64 {
        let mut left = self.residual();
        let mut prior = 0.0;
        for &c in &self.chosen {
            let candidate = &self.candidates[c];
            for (k, column) in candidate.columns().enumerate() {
                prior += ((candidate.values[k] - candidate.start[k]) / candidate.size(k)).powi(2);
                if candidate.is_pattern() {
                    left.axpy(-candidate.values[k] / candidate.typical[k], &linear.design.column(column), 1.0);
                }
            }
        }
        let series = self.problem.series(|row| !row.held_out);
        let white = noise::whiten(&DMatrix::from_columns(&[left]), &series, self.shape).columns;
        let used = series.iter().flat_map(|s| s.samples.iter().map(|&(row, ..)| white[(row, 0)].powi(2)));
        used.sum::<f64>() / (self.sigma * self.sigma) + prior
    }

    /// Drops members that the others, fitted anew without them, make up for: evidence about the fit of the whole set
    /// does not see how far curved effects can follow.
    pub(super) fn prune(&mut self) -> bool {
        let mut any = false;
        loop {
            let named: Vec<usize> = self.chosen.iter().copied().filter(|&c| !self.candidates[c].is_pattern()).collect();
            if named.len() < 2 {
                return any;
            }
            let mut best = (self.objective_here() - CLEARLY, None);
            for c in named {
                let state = (self.candidates.clone(), self.chosen.clone());
                self.choose(state.1.iter().copied().filter(|&o| o != c).collect());
                let without = self.objective_here();
                if without > best.0 {
                    best = (without, Some(c));
                }
                (self.candidates, self.chosen) = state;
            }
            let Some(c) = best.1 else {
                self.refit();
                return any;
            };
            self.choose(self.chosen.iter().copied().filter(|&o| o != c).collect());
            any = true;
        }
    }

    /// Lets the other laws of the joints' springs, each fitted in full, stand against the chosen one.
    ///
    /// Where a bent spring's slopes meet cannot be seen from a straight one, so that searches about the fit pass it over.
    pub(super) fn contest(&mut self, posteriors: &mut [Posterior]) {
        let spring = |c: &usize| self.candidates[*c].family == SPRING;
        let Some(own) = self.chosen.iter().copied().find(spring) else { return };
        let others: Vec<usize> = (0..self.candidates.len())
            .filter(|c| *c != own && spring(c) && self.candidates[*c].is_full_size())
            .collect();
        let mut odds: BTreeMap<String, f64> = BTreeMap::new();
        let mut best = (self.objective_here(), self.candidates.clone(), self.chosen.clone());
        odds.insert(self.candidates[own].kind.clone(), best.0);
        let state = (self.candidates.clone(), self.chosen.clone());
        for other in others {
            self.choose(state.1.iter().map(|&c| if c == own { other } else { c }).collect());
            let value = self.objective_here();
            let known = odds.entry(self.candidates[other].kind.clone()).or_insert(value);
            *known = known.max(value);
            if value > best.0 {
                best = (value, self.candidates.clone(), self.chosen.clone());
            }
            (self.candidates, self.chosen) = state.clone();
        }
        let value;
        (value, self.candidates, self.chosen) = best;
        self.refit();
        let Some(now) = self.chosen.iter().copied().find(|&c| self.candidates[c].family == SPRING) else { return };
        let Some((member, (share, rivals))) = posteriors.iter_mut().find(|(c, _)| *c == own) else { return };
        *member = now;
        // The other spring laws take their odds from their own fits; rivals of other families keep theirs.
        let kind = &self.candidates[now].kind;
        rivals.retain(|(rival, _)| !odds.contains_key(rival));
        let elsewhere: f64 = rivals.iter().map(|(_, share)| share).sum::<f64>().min(1.0 - f64::EPSILON);
        let weights: BTreeMap<String, f64> =
            odds.into_iter().map(|(kind, odds)| (kind, ((odds - value) / CAUTION).exp())).collect();
        let total: f64 = weights.values().sum();
        *share = (1.0 - elsewhere) * weights.get(kind).copied().unwrap_or(1.0) / total;
        let others = weights.into_iter().filter(|(other, _)| other != kind);
        rivals.extend(others.map(|(other, weight)| (other, (1.0 - elsewhere) * weight / total)));
        rivals.sort_by(|a, b| b.1.total_cmp(&a.1));
    }

    /// Evidence of the chosen set less its price, about its own fit.
    pub(super) fn objective_here(&mut self) -> f64 {
        let chosen = self.chosen.clone();
        let linear = self.linearise(&chosen, &[self.shape]);
        Search::new(&self.candidates, &linear.moments, &linear.always).objective(&chosen)
    }
}
