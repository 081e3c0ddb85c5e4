//! Fits the chosen effects together, tries the lookalikes of their numbers, and removes members that are not needed.

use super::candidate::fitted;
use super::device_pose;
use super::engine::Engine;
use super::found::Linearised;
use super::noise;
use super::score::{Normal, posterior};
use super::search::Search;
use deflex_cell::Cell;
use deflex_text::Diagnostic;
use nalgebra::{DMatrix, DVector};

/// Largest number of steps of a fit.
const REFITS: usize = 8;
/// Dampings that are tried until a step gains, in units of the prior precision. The precision of well determined
/// directions is in the millions.
const DAMPINGS: [f64; 5] = [0.0, 1.0, 30.0, 1e3, 1e5];
/// Largest change, in typical sizes, of a step after which the fit ends.
const SETTLED: f64 = 1e-4;
/// Largest change, in typical sizes, of a step after which the columns are used again. The error of the columns is then
/// smaller than the numbers that are fitted.
const NEARBY: f64 = 0.1;
/// Smallest reduction of the misfit by a step, for each scalar. Numbers that compensate one another drift along a
/// valley of the misfit, with smaller gains.
const LEAST_GAIN: f64 = 1e-6;
/// Gain beyond its price, nats, that a member must have when the others are fitted again without it.
const CLEARLY: f64 = 5.0;
/// Largest number of changes to lookalikes in a fit.
const MOST_LOOKALIKES: usize = 5;
/// Smallest reduction of the misfit by a change to a lookalike.
const LOOKALIKE_GAIN: f64 = 1.0;

impl Engine {
    /// Fits the chosen numbers: to the nearest minimum of the misfit, and then again from every lookalike with a
    /// smaller misfit.
    pub(super) fn refit(&mut self) {
        for _ in 0..MOST_LOOKALIKES {
            self.descend();
            if self.problem.is_of_robot() || self.is_whole_arm() || !self.try_lookalikes() {
                break;
            }
        }
    }

    /// Cuts the stocks with the fitted arm and fits the chosen numbers again, in turns, until the forces are those that
    /// act on the fitted arm.
    pub(super) fn settle_cuts(&mut self, cell: &Cell) -> Result<(), Vec<Diagnostic>> {
        /// Largest number of cuts.
        const CUTS: usize = 8;
        /// Rms change of the rows by the forces, as a share of the noise, at which the cuts end. Only as many rows as
        /// the inverse square of this share could show a smaller change.
        const SETTLED: f64 = 0.02;
        if self.problem.stocks.is_empty() {
            return Ok(());
        }
        for _ in 0..CUTS {
            let before = self.residual();
            self.problem.cut_stocks(&self.arm(), cell)?;
            self.forget_solutions();
            let moved = (self.residual() - before).norm() / (self.problem.scalars as f64).sqrt();
            if moved < SETTLED * self.sigma {
                break;
            }
            self.refit();
        }
        Ok(())
    }

    /// Replaces the numbers of one chosen effect by those of its lookalike with the smallest misfit. Returns whether a
    /// lookalike is better.
    pub(super) fn try_lookalikes(&mut self) -> bool {
        let linear = self.linearise(&self.patterns(), &[]);
        let here = self.misfit(&linear);
        let mut best = (here - LOOKALIKE_GAIN, None);
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

    /// Minimises the misfit of the chosen numbers, with their priors and the present noise (Levenberg 1944, Marquardt
    /// 1963). Sets the posterior covariance too.
    pub(super) fn descend(&mut self) {
        let (chosen, sigma) = (self.chosen.clone(), self.sigma_of_fit());
        let (mut last, mut largest) = (None, f64::INFINITY);
        for _ in 0..REFITS {
            let linear = match last.take() {
                // Over the whole robot there are many columns, which hardly change: the first ones are used to the end.
                Some(linear) if self.problem.is_of_robot() || largest < NEARBY => self.renewed(linear, &chosen),
                _ => self.linearise(&chosen, &[self.shape]),
            };
            let moments = &linear.moments[0];
            let columns = Search::new(&self.candidates, &linear.moments, &linear.always).columns(&chosen);
            // For a set of few effects the prior sizes of the covariance are at least the typical sizes, so that
            // directions that the rows do not determine are not too certain. In the model of the whole arm the prior
            // sizes were estimated.
            let wide = if self.is_whole_arm() { columns.clone() } else { columns.full_size() };
            let Some((_, covariance)) = posterior(moments, &wide, sigma) else { return };
            let (frames, size) = (linear.always.len(), covariance.nrows() - linear.always.len());
            let typical = |i: usize, j: usize| covariance[(i, j)] * wide.list[i].1 * wide.list[j].1;
            self.covariance = DMatrix::from_fn(size, size, |i, j| typical(frames + i, frames + j));
            let normal = Normal::of(moments, &columns, sigma);
            largest = self.step(&linear, &normal);
            if largest < SETTLED {
                break;
            }
            last = Some(linear);
        }
    }

    /// Makes one step to the solution of the linear problem, with the smallest damping that reduces the misfit. Returns
    /// the largest change of a number, in typical sizes; zero if no damping reduces the misfit.
    fn step(&mut self, linear: &Linearised, normal: &Normal) -> f64 {
        let chosen = self.chosen.clone();
        let frames = linear.always.len();
        let now: Vec<Vec<f64>> = chosen.iter().map(|&c| self.candidates[c].values.clone()).collect();
        let places = device_pose::places(&self.problem);
        let of = |c: usize, value: f64, k: usize| (value - self.candidates[c].start[k]) / self.candidates[c].size(k);
        let numbers = || chosen.iter().flat_map(|&c| (0..self.candidates[c].values.len()).map(move |k| (c, k)));
        let (mut here, mut bounds) = (vec![0.0; frames], vec![(f64::NEG_INFINITY, f64::INFINITY); frames]);
        here.extend(numbers().map(|(c, k)| of(c, self.candidates[c].values[k], k)));
        bounds.extend(numbers().map(|(c, k)| {
            let (low, high) = self.candidates[c].bounds[k];
            (of(c, low, k), of(c, high, k))
        }));
        let here = DVector::from_vec(here);
        let before = self.misfit(linear);
        let least_gain = LEAST_GAIN * linear.moments[0].count as f64;
        for damping in DAMPINGS {
            let Some(aim) = normal.likeliest(&bounds, &here, damping) else { break };
            let largest = self.set_numbers(aim.as_slice());
            let gain = before - self.misfit(linear);
            // If a row has no equilibrium after the step, the misfit is infinite and the step is refused.
            if gain > least_gain {
                return largest;
            }
            device_pose::restore(&mut self.problem, &places);
            for (&c, now) in chosen.iter().zip(&now) {
                self.candidates[c].values.clone_from(now);
            }
        }
        0.0
    }

    /// Sets the numbers of the instruments and of the chosen candidates, in prior sizes. Returns the largest change of
    /// a number of an effect, in typical sizes.
    fn set_numbers(&mut self, aim: &[f64]) -> f64 {
        let mut at = 0;
        for run in 0..self.problem.devices.len() {
            let unknowns = device_pose::unknowns(&self.problem, run);
            device_pose::shift(&mut self.problem, run, &aim[at..at + unknowns]);
            at += unknowns;
        }
        let mut largest: f64 = 0.0;
        for &c in &self.chosen {
            let candidate = &mut self.candidates[c];
            for k in 0..candidate.values.len() {
                let (low, high) = candidate.bounds[k];
                // The solution is within the bounds except for rounding.
                let value = (candidate.start[k] + candidate.size(k) * aim[at + k]).clamp(low, high);
                if !candidate.is_pattern() {
                    largest = largest.max((value - candidate.values[k]).abs() / candidate.typical[k]);
                }
                candidate.values[k] = value;
            }
            at += candidate.values.len();
        }
        largest
    }

    /// Minus twice the log posterior density of the chosen numbers except for a constant; infinite if any row, held out
    /// or not, has no equilibrium.
    pub(super) fn misfit(&self, linear: &Linearised) -> f64 {
        let mut left = self.residual();
        if left.iter().any(|v| !v.is_finite()) {
            return f64::INFINITY;
        }
        let mut prior = 0.0;
        for &c in &self.chosen {
            let candidate = &self.candidates[c];
            prior += candidate.prior_misfit();
            if candidate.is_pattern() {
                linear.design.add(candidate.pattern_numbers().map(|(column, number)| (column, -number)), &mut left);
            }
        }
        let series = self.problem.series(|row| !row.held_out);
        let white = noise::whiten(&DMatrix::from_columns(&[left]), &series, self.shape).columns;
        let used = series.iter().flat_map(|s| s.samples.iter().map(|&(row, ..)| white[(row, 0)].powi(2)));
        used.sum::<f64>() / self.sigma_of_fit().powi(2) + prior
    }

    /// Removes the members without which the others, fitted again, have a larger objective or almost the same. The
    /// search cannot find them: its evidence is linearised about the fit of the whole set, and nonlinear effects can
    /// follow further. Returns whether it removes any.
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

    /// The objective of the chosen set, linearised about its own fit, nats.
    pub(super) fn objective_here(&mut self) -> f64 {
        let chosen = self.chosen.clone();
        let linear = self.linearise(&chosen, &[self.shape]);
        Search::new(&self.candidates, &linear.moments, &linear.always).objective(&chosen)
    }
}

#[cfg(test)]
mod tests {
    use super::super::data::Problem;
    use super::*;
    use deflex_cell::Cell;
    use deflex_measured::Table;
    use deflex_text::Source;

    /// An engine with poses of a small arm that are measured without error.
    fn engine() -> Engine {
        let text = "[robot]\nmodel = \"irb120-3-0.58\"\n[tools.t]\ntcp_mm = [0, 0, 100]\ntcp_quat = [1, 0, 0, 0]\n[cut]\nforce = \"none\"\n";
        let cell = Cell::read(&Source::new("cell.toml", text.as_bytes().to_vec())).unwrap();
        let mut csv = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm\n".to_owned();
        for i in 0..40 {
            let deg: [f64; 6] = std::array::from_fn(|j| 40.0 * ((i * (2 * j + 3)) as f64 * 0.7).sin());
            let motor = deflex_robot::Joints::from(deg.map(f64::to_radians));
            let there = cell.arm.robot.forward(&motor) * cell.tools["T"].flange_from_tcp;
            let numbers =
                deg.iter().copied().chain((there.translation.vector * 1e3).iter().copied().collect::<Vec<_>>());
            csv += &numbers.map(|v| v.to_string()).collect::<Vec<_>>().join(",");
            csv.push('\n');
        }
        let table = Table::read(&Source::new("poses.csv", csv.into_bytes())).unwrap();
        let problem = Problem::of_poses(&cell, vec![table], None).unwrap();
        Engine::new(cell.arm, problem, &[])
    }

    #[test]
    fn a_step_after_which_rows_have_no_equilibrium_is_refused() {
        let mut engine = engine();
        let gravity = engine.candidates.iter().position(|c| c.kind == "gravity").unwrap();
        engine.chosen = vec![gravity];
        let (chosen, shape) = (engine.chosen.clone(), engine.shape);
        let linear = engine.linearise(&chosen, &[shape]);
        let start = engine.candidates[gravity].values.clone();
        // The arm is so heavy and so soft that no row has an equilibrium.
        let mut heavy = vec![0.0; linear.always.len()];
        heavy.extend(engine.candidates[gravity].typical.iter().map(|_| 1e6));
        engine.set_numbers(&heavy);
        assert!(engine.misfit(&linear).is_infinite());
        engine.candidates[gravity].values.clone_from(&start);
        let places = device_pose::places(&engine.problem);
        let normal = Normal::drawn_to(heavy);
        assert!(engine.step(&linear, &normal) <= 0.0);
        assert_eq!(engine.candidates[gravity].values, start);
        assert_eq!(device_pose::places(&engine.problem), places);
    }
}
