//! The loop: linearise, weigh, choose, refit, and again about the fit.

use super::candidates::{self, Candidate, FREE_FRAME, Home, Pattern, with};
use super::data::{Observation, Problem};
use super::gear::{self, Comb, Term};
use super::noise::{self, Moments};
use super::outcome::{
    Added, Correlate, Coverage, Errors, FittedParameter, Identification, Ranked, ResidualRow, Unexplained,
};
use super::score::posterior;
use super::search::Search;
use crate::cell::{Cell, NewEffect};
use crate::effects::Effect;
use crate::equilibrium::Arm;
use crate::measured::Table;
use crate::program::Program;
use crate::text::Diagnostic;
use nalgebra::{DMatrix, DVector, Vector3};
use rayon::prelude::*;

/// What is identified from.
#[derive(Debug)]
pub struct Input<'a> {
    /// The declared cell.
    pub cell: &'a Cell,
    /// Programs with what was measured on them.
    pub runs: &'a [(Program, Table)],
    /// Measured rows with their own motor angles.
    pub poses: &'a [Table],
    /// The tool of `poses`, where the cell has several.
    pub tool: Option<&'a str>,
    /// Goes into the provenance of what is added: tells which data it came from.
    pub data_hash: &'a str,
}

/// Fewer rows than this cannot be split into fitted and held-out blocks.
const LEAST_ROWS: usize = 16;
/// Rounds of linearising, choosing and refitting.
const ROUNDS: usize = 6;
/// Whitened residuals beyond this are outliers, standard deviations: one in 1.7 million by chance.
const OUTLIER: f64 = 5.0;
/// A name needs this posterior; below it, the set that cannot be told apart.
const NAMED: f64 = 0.9;
/// Rivals below this share of the posterior are not mentioned.
const MENTIONED: f64 = 0.03;
/// Steps of a refit at most, and how often one is halved.
const REFITS: usize = 8;
const HALVINGS: usize = 5;
/// Changes below this share of the typical sizes are no longer followed.
const SETTLED: f64 = 1e-4;
/// Leaps to lookalikes in a refit at most, and what one must gain, twice nats.
const LEAPS: usize = 5;
const LEAP: f64 = 1.0;
/// Rounds of seeking gear harmonics before anything flexible is let in.
const GEAR_ROUNDS: usize = 4;

struct Engine {
    declared: Arm,
    problem: Problem,
    candidates: Vec<Candidate>,
    chosen: Vec<usize>,
    sigma: f64,
    shape: noise::Shape,
    /// Posterior covariance of the chosen columns, in typical sizes, in the order of `chosen`.
    covariance: DMatrix<f64>,
}

/// Finds the effects that a cell lacks.
///
/// # Errors
/// Tables that do not belong to their programs, too few rows, targets that the cell does not solve.
pub fn identify(input: &Input) -> Result<Identification, Vec<Diagnostic>> {
    let problem = if input.poses.is_empty() {
        Problem::of_runs(input.cell, input.runs)?
    } else {
        Problem::of_poses(input.cell, input.poses, input.tool)?
    };
    let held_out = problem.rows.iter().filter(|row| row.held_out).count();
    if problem.rows.len() < LEAST_ROWS || held_out == 0 || held_out == problem.rows.len() {
        let message =
            format!("{} measured rows, {held_out} of them held out: too few to fit and to judge", problem.rows.len());
        return Err(vec![
            Diagnostic::error("identify.rows", "", message)
                .help(format!("at least {LEAST_ROWS} rows are needed, some held out and some not")),
        ]);
    }
    let declared = with(&input.cell.arm, &[]);
    let before = problem.residual(&declared);
    if before.iter().any(|v| !v.is_finite()) {
        let message = "the declared cell has no equilibrium at some measured targets";
        return Err(vec![
            Diagnostic::error("identify.unsolved", "", message).help("run `deflex predict` on the program first"),
        ]);
    }
    let candidates = candidates::all(&declared, &problem);
    let shape = noise::Shape { wander: 0.0, correlation: 0.0, field: None };
    let covariance = DMatrix::zeros(0, 0);
    let mut engine = Engine { declared, problem, candidates, chosen: Vec::new(), sigma: 1.0, shape, covariance };
    Ok(engine.run(&before, input))
}

/// A chosen candidate, its posterior, and the kinds that could stand in its place with theirs.
type Posterior = (usize, (f64, Vec<(String, f64)>));

/// Moments, search and columns of one linearisation.
struct Linearised {
    moments: Vec<Moments>,
    always: Vec<usize>,
    design: DMatrix<f64>,
    /// Pseudo-data: what the residual would be with every number at neutral.
    data: DVector<f64>,
}

impl Engine {
    fn arm(&self) -> Arm {
        let changes: Vec<(&Home, &[f64])> =
            self.chosen.iter().map(|&c| (&self.candidates[c].home, &self.candidates[c].values[..])).collect();
        with(&self.declared, &changes)
    }

    fn residual(&self) -> DVector<f64> {
        self.problem.residual(&self.arm())
    }

    fn linearise(&mut self, wanted: &[usize], shapes: &[noise::Shape]) -> Linearised {
        let base = self.residual();
        let (design, always) =
            candidates::design(&self.declared, &self.problem, &mut self.candidates, &self.chosen, wanted, &base);
        let mut data = base;
        for &c in self.chosen.iter().filter(|c| wanted.contains(c)) {
            let candidate = &self.candidates[c];
            if candidate.is_pattern() {
                continue;
            }
            for (k, column) in candidate.columns().enumerate() {
                let off = (candidate.values[k] - candidate.start[k]) / candidate.typical[k];
                data.axpy(off, &design.column(column), 1.0);
            }
        }
        let mut stacked = design.clone().insert_column(design.ncols(), 0.0);
        stacked.set_column(design.ncols(), &data);
        let series = self.problem.series(|row| !row.held_out);
        let moments = shapes.par_iter().map(|&shape| Moments::of(&stacked, &series, shape)).collect();
        Linearised { moments, always, design, data }
    }

    /// Fits the chosen numbers: down the nearest slope, then from any lookalike that is better.
    fn refit(&mut self) {
        for _ in 0..LEAPS {
            self.descend();
            if self.problem.free_device || !self.leap() {
                break;
            }
        }
    }

    /// Takes the best lookalike of a chosen effect, if it is better than what is there.
    fn leap(&mut self) -> bool {
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

    fn patterns(&self) -> Vec<usize> {
        self.chosen.iter().copied().filter(|&c| self.candidates[c].is_pattern()).collect()
    }

    /// Gauss-Newton on the chosen numbers with their priors, noise as last chosen; steps are halved until they gain.
    fn descend(&mut self) {
        for _ in 0..REFITS {
            let chosen = self.chosen.clone();
            let linear = self.linearise(&chosen, &[self.shape]);
            let moments = &linear.moments[0];
            let columns = Search::new(&self.candidates, &linear.moments, &linear.always).columns(&chosen);
            let Some((mean, covariance)) = posterior(moments, &columns, self.sigma) else { return };
            let frames = linear.always.len();
            for run in 0..frames / 6 {
                let part = |k: usize| mean[6 * run + k] * FREE_FRAME[k];
                let (shift, turn) = (Vector3::new(part(0), part(1), part(2)), Vector3::new(part(3), part(4), part(5)));
                self.problem.move_device(run, &shift, &turn);
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
            // A device's frame has moved already, and its problem is as good as linear.
            let halvings = if self.problem.free_device { 0 } else { HALVINGS };
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
    fn misfit(&self, linear: &Linearised) -> f64 {
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

    fn run(&mut self, before: &DVector<f64>, input: &Input) -> Identification {
        let shapes = noise::shapes();
        let mut linear = None;
        let mut posteriors = Vec::new();
        let mut ranking = Vec::new();
        // Gear harmonics are sought before smooth curves may imitate them: with nothing chosen, then beside the rest.
        for _ in 0..if self.problem.free_device { 0 } else { GEAR_ROUNDS } {
            let wanted: Vec<usize> = (0..self.candidates.len()).filter(|&c| stiff(&self.candidates[c])).collect();
            let now = self.linearise(&wanted, &shapes);
            let search = Search::new(&self.candidates, &now.moments, &now.always);
            let set = search.best(&self.chosen, &stiff);
            let score = search.full(&set);
            (self.sigma, self.shape) = (score.sigma, shapes[score.shape]);
            let first = self.chosen.is_empty() && self.add_gear(&now);
            self.choose(set);
            if !self.add_gear(&now) && !first {
                break;
            }
        }
        for round in 0..ROUNDS {
            let shapes = match self.shape {
                noise::Shape { field: Some(_), .. } => vec![self.shape],
                noise::Shape { wander, .. } if wander > 0.0 => noise::near(self.shape),
                _ => noise::few(),
            };
            let wanted: Vec<usize> = (0..self.candidates.len()).collect();
            let now = self.linearise(&wanted, &shapes);
            let search = Search::new(&self.candidates, &now.moments, &now.always);
            let everything = |_: &Candidate| true;
            let whole = self.problem.free_device;
            let set = if whole { search.staged() } else { search.best(&self.chosen, &everything) };
            let score = search.full(&set);
            posteriors = set
                .iter()
                .filter(|&&c| !self.candidates[c].is_pattern())
                .map(|&c| match whole {
                    true => (c, (1.0, Vec::new())),
                    false => (c, search.rivals(&set, c, &|other: &Candidate| !other.is_pattern())),
                })
                .collect();
            if round == 0 {
                ranking = self.ranking(&search, &now);
            }
            (self.sigma, self.shape) = (score.sigma, shapes[score.shape]);
            let same = {
                let (mut a, mut b) = (set.clone(), self.chosen.clone());
                a.sort_unstable();
                b.sort_unstable();
                a == b
            };
            let gate = same && !whole && self.shape.field.is_none();
            let field = if gate { self.field(&search, &now, &set) } else { None };
            self.choose(set.clone());
            let outliers = self.mark_outliers();
            let gear = !whole && round + 1 < ROUNDS && self.add_gear(&now);
            let settled = same && !outliers && !gear && (whole || !self.prune());
            linear = Some(now);
            if settled && field.is_none() {
                break;
            }
            self.shape = field.filter(|_| settled).unwrap_or(self.shape);
        }
        if let Some(linear) = linear.as_ref().filter(|_| self.is_unexplained()) {
            self.withdraw(linear, &mut posteriors);
        }
        let after = self.residual();
        self.outcome(before, &after, &posteriors, ranking, linear.as_ref(), input)
    }

    /// The goodness-of-fit gate: noise with a field over the place that explains more than the chosen set without it.
    fn field(&self, search: &Search, linear: &Linearised, set: &[usize]) -> Option<noise::Shape> {
        let (value, set_price) = (search.objective(set), search.prices(set));
        let fields = noise::fields(self.problem.extent_mm());
        let price = super::search::FIELD + (fields.len() as f64).ln();
        let series = self.problem.series(|row| !row.held_out);
        let columns = search.columns(set);
        let mut stacked = linear.design.select_columns(columns.iter().map(|column| &column.0));
        let renumbered: Vec<_> = columns.iter().enumerate().map(|(i, column)| (i, column.1)).collect();
        stacked = stacked.insert_column(columns.len(), 0.0);
        stacked.set_column(columns.len(), &linear.data);
        let shapes: Vec<noise::Shape> = fields
            .iter()
            .flat_map(|&field| noise::few().into_iter().map(move |shape| noise::Shape { field: Some(field), ..shape }))
            .collect();
        let gains: Vec<f64> = shapes
            .par_iter()
            .map(|&shape| {
                let moments = [Moments::of(&stacked, &series, shape)];
                let alone = super::score::score(&moments, &[]).evidence;
                let beside = super::score::score(&moments, &renumbered).evidence - set_price;
                alone.max(beside) - price - value
            })
            .collect();
        let best = (0..shapes.len()).max_by(|&a, &b| gains[a].total_cmp(&gains[b]))?;
        (gains[best] > 0.0).then_some(shapes[best])
    }

    /// Drops members that the others, fitted anew without them, make up for: evidence about the fit of the whole set
    /// does not see how far curved effects can follow.
    fn prune(&mut self) -> bool {
        let mut any = false;
        loop {
            let named: Vec<usize> = self.chosen.iter().copied().filter(|&c| !self.candidates[c].is_pattern()).collect();
            if named.len() < 2 {
                return any;
            }
            let mut best = (self.objective_here(), None);
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

    /// Evidence of the chosen set less its price, about its own fit.
    fn objective_here(&mut self) -> f64 {
        let chosen = self.chosen.clone();
        let linear = self.linearise(&chosen, &[self.shape]);
        Search::new(&self.candidates, &linear.moments, &linear.always).objective(&chosen)
    }

    /// Whether something is left that no effect explains.
    fn is_unexplained(&self) -> bool {
        self.shape.field.is_some()
            || self.shape.wander > noise::MOST_WANDER
            || self.chosen.iter().any(|&c| self.candidates[c].is_pattern())
    }

    /// Beside something unexplained, withdraws effects that do not hold on blocks that their fit has not seen.
    ///
    /// Patterns take part in the fits and not in the predictions: they are not in the cell. An effect stays if it lowers
    /// the error of the blocks by more than one standard error. What is periodic or bent by a joint's angle passes for
    /// anything, and is withdrawn in any case.
    fn withdraw(&mut self, linear: &Linearised, posteriors: &mut Vec<Posterior>) {
        let search = Search::new(&self.candidates, &linear.moments, &linear.always);
        let named = |&c: &usize| !self.candidates[c].is_pattern();
        let bent = |&c: &usize| ["gear_harmonic", "joint_error_curve"].contains(&self.candidates[c].kind.as_str());
        let mut set: Vec<usize> = self.chosen.iter().copied().filter(|c| !(named(c) && bent(c))).collect();
        loop {
            let with = self.block_errors(linear, &search.columns(&set));
            let worst = set
                .iter()
                .copied()
                .filter(named)
                .map(|c| {
                    let less: Vec<usize> = set.iter().copied().filter(|&o| o != c).collect();
                    let without = self.block_errors(linear, &search.columns(&less));
                    let gains: Vec<f64> = without.iter().zip(&with).map(|(without, with)| without - with).collect();
                    (c, in_standard_errors(&gains))
                })
                .min_by(|a, b| a.1.total_cmp(&b.1));
            match worst {
                Some((c, gain)) if gain < 1.0 => set.retain(|&o| o != c),
                _ => break,
            }
        }
        posteriors.retain(|(c, _)| set.contains(c));
        self.choose(set);
    }

    /// Sums of squares of each fitted block, predicted by columns that were fitted to the others.
    fn block_errors(&self, linear: &Linearised, columns: &[(usize, f64)]) -> Vec<f64> {
        let mut blocks: Vec<(usize, usize)> =
            self.problem.rows.iter().filter(|row| !row.held_out).map(|row| (row.run, row.block)).collect();
        blocks.dedup();
        let mut stacked = linear.design.select_columns(columns.iter().map(|column| &column.0));
        stacked = stacked.insert_column(columns.len(), 0.0);
        stacked.set_column(columns.len(), &linear.data);
        let local: Vec<_> = columns.iter().enumerate().map(|(i, column)| (i, column.1)).collect();
        let in_cell: Vec<bool> = columns
            .iter()
            .map(|&(column, _)| {
                !self
                    .chosen
                    .iter()
                    .any(|&c| self.candidates[c].is_pattern() && self.candidates[c].columns().contains(&column))
            })
            .collect();
        let of_block = |&block: &(usize, usize)| {
            let series = self.problem.series(|row| !row.held_out && (row.run, row.block) != block);
            let moments = Moments::of(&stacked, &series, self.shape);
            let mut left = linear.data.clone();
            if let Some((mean, _)) = posterior(&moments, &local, self.sigma) {
                for (k, &(column, scale)) in columns.iter().enumerate().filter(|(k, _)| in_cell[*k]) {
                    left.axpy(-mean[k] * scale, &linear.design.column(column), 1.0);
                }
            }
            let rows = self.problem.rows.iter().filter(|row| !row.outlier && (row.run, row.block) == block);
            rows.map(|row| left.rows(row.offset, row.seen.len()).norm_squared()).sum()
        };
        blocks.par_iter().map(of_block).collect()
    }

    /// Takes a set: what is no longer in it starts afresh, the rest is refitted together.
    fn choose(&mut self, set: Vec<usize>) {
        for &c in self.chosen.iter().filter(|c| !set.contains(c)) {
            let candidate = &mut self.candidates[c];
            candidate.values.clone_from(&candidate.start);
        }
        self.chosen = set;
        self.refit();
    }

    /// Every kind alone, best variant first.
    fn ranking(&self, search: &Search, linear: &Linearised) -> Vec<Ranked> {
        let none = search.objective(&[]);
        let mut best: Vec<(String, f64, usize)> = Vec::new();
        for (c, candidate) in self.candidates.iter().enumerate().filter(|(_, c)| !c.is_pattern()) {
            let gain = search.objective(&[c]) - none;
            match best.iter_mut().find(|(kind, ..)| *kind == candidate.kind) {
                Some(known) if known.1 < gain => (known.1, known.2) = (gain, c),
                Some(_) => {}
                None => best.push((candidate.kind.clone(), gain, c)),
            }
        }
        best.sort_by(|a, b| b.1.total_cmp(&a.1));
        best.into_iter()
            .map(|(kind, gain, c)| {
                let score = search.full(&[c]);
                let columns = search.columns(&[c]);
                let mut left = linear.data.clone();
                if let Some((mean, _)) = posterior(&linear.moments[score.shape], &columns, score.sigma) {
                    for (column, value) in columns.iter().zip(mean.iter()) {
                        left.axpy(-value * column.1, &linear.design.column(column.0), 1.0);
                    }
                }
                Ranked { kind, held_out_rms_mm: self.errors(&left, |row| row.held_out).rms_mm, delta_bic: -2.0 * gain }
            })
            .collect()
    }

    /// Marks rows whose whitened residual no noise makes; says whether any is new.
    fn mark_outliers(&mut self) -> bool {
        let whitened = self.whitened(&self.residual());
        let limit = OUTLIER * self.sigma;
        let far: Vec<usize> = (0..self.problem.rows.len())
            .filter(|&i| {
                let row = &self.problem.rows[i];
                !row.outlier && (0..row.seen.len()).any(|k| whitened[row.offset + k].abs() > limit)
            })
            .collect();
        // A tenth of the rows are not outliers but an effect.
        if far.is_empty() || far.len() * 20 > self.problem.rows.len() {
            return false;
        }
        for &i in &far {
            self.problem.rows[i].outlier = true;
        }
        true
    }

    fn whitened(&self, residual: &DVector<f64>) -> DVector<f64> {
        let series = self.problem.series(|_| true);
        let stacked = DMatrix::from_columns(std::slice::from_ref(residual));
        noise::whiten(&stacked, &series, self.shape).columns.column(0).into_owned()
    }

    /// Seeks gear harmonics in what other effects leave; whether they are a new candidate.
    fn add_gear(&mut self, linear: &Linearised) -> bool {
        let left = self.pseudo_left();
        let Some(zero) = self.candidates.iter().find(|c| c.kind == "zero_offset") else { return false };
        let comb = Comb::new(&self.problem, &linear.design, zero, self.shape, self.sigma);
        let (terms, looked_at) = comb.terms(&left);
        let known = |terms: &[Term]| {
            let same = |c: &Candidate| c.kind == "gear_harmonic" && gear::terms_of(c) == terms;
            self.candidates.iter().any(same)
        };
        let new: Vec<Candidate> = (1..=terms.len())
            .map(|n| &terms[..n])
            .filter(|terms| !known(terms))
            .map(|terms| gear::candidate(terms, looked_at))
            .collect();
        let any = !new.is_empty();
        self.candidates.extend(new);
        any
    }

    /// What is left by the chosen effects but gear harmonics, patterns of the chosen set taken off too.
    fn pseudo_left(&mut self) -> DVector<f64> {
        let gear = |c: &usize| self.candidates[*c].kind == "gear_harmonic";
        let others: Vec<(&Home, &[f64])> = self
            .chosen
            .iter()
            .filter(|c| !gear(c))
            .map(|&c| (&self.candidates[c].home, &self.candidates[c].values[..]))
            .collect();
        let mut left = self.problem.residual(&with(&self.declared, &others));
        let patterns = self.patterns();
        if !patterns.is_empty() {
            let (design, _) =
                candidates::design(&self.declared, &self.problem, &mut self.candidates, &[], &patterns, &left.clone());
            for &c in &patterns {
                let candidate = &self.candidates[c];
                for (k, column) in candidate.columns().enumerate() {
                    left.axpy(-candidate.values[k] / candidate.typical[k], &design.column(column), 1.0);
                }
            }
        }
        left
    }

    fn errors(&self, residual: &DVector<f64>, keep: impl Fn(&Observation) -> bool) -> Errors {
        let norms: Vec<f64> = self
            .problem
            .rows
            .iter()
            .filter(|row| !row.outlier && keep(row))
            .map(|row| residual.rows(row.offset, row.seen.len()).norm())
            .collect();
        errors_of(&norms)
    }

    fn outcome(
        &mut self,
        before: &DVector<f64>,
        after: &DVector<f64>,
        posteriors: &[Posterior],
        ranking: Vec<Ranked>,
        linear: Option<&Linearised>,
        input: &Input,
    ) -> Identification {
        let held_out = |row: &Observation| row.held_out;
        let (errors_before, errors_after) = (self.errors(before, held_out), self.errors(after, held_out));
        let mut added = Vec::new();
        let mut extended = Vec::new();
        let mut at = 0;
        for &c in &self.chosen {
            let candidate = &self.candidates[c];
            let size = candidate.values.len();
            let block = self.covariance.view((at, at), (size, size)).into_owned();
            at += size;
            let Some((_, (posterior, rivals))) = posteriors.iter().find(|(p, _)| *p == c) else { continue };
            let effect = fitted(&self.declared, candidate);
            let Some(effect) = effect else { continue };
            let without: Vec<(&Home, &[f64])> = self
                .chosen
                .iter()
                .filter(|&&o| o != c)
                .map(|&o| (&self.candidates[o].home, &self.candidates[o].values[..]))
                .collect();
            let without = self.problem.residual(&with(&self.declared, &without));
            let parameters = effect
                .parameters()
                .into_iter()
                .enumerate()
                .map(|(k, p)| {
                    let half = 1.96 * candidate.typical[k] * block[(k, k)].max(0.0).sqrt();
                    let ci95 = [(p.value - half).max(p.bounds.0), (p.value + half).min(p.bounds.1)];
                    FittedParameter { name: p.name, value: p.value, unit: p.unit, ci95 }
                })
                .collect();
            let told = *posterior >= NAMED;
            let not_told_apart_from =
                rivals.iter().filter(|(_, share)| !told && *share >= MENTIONED).map(|(kind, _)| kind.clone()).collect();
            added.push(Added {
                kind: candidate.kind.clone(),
                posterior: *posterior,
                held_out_rms_before_mm: self.errors(&without, held_out).rms_mm,
                held_out_rms_after_mm: errors_after.rms_mm,
                parameters,
                not_told_apart_from,
            });
            let covariance = (0..size)
                .map(|i| (0..size).map(|j| block[(i, j)] * candidate.typical[i] * candidate.typical[j]).collect())
                .collect();
            let mut provenance = toml::Table::new();
            provenance.insert("by".into(), concat!("deflex ", env!("CARGO_PKG_VERSION"), " identify").into());
            provenance.insert("data".into(), input.data_hash.into());
            provenance.insert("rows".into(), i64::try_from(self.problem.rows.len()).unwrap_or(i64::MAX).into());
            provenance.insert("held_out_rms_before_mm".into(), errors_before.rms_mm.into());
            provenance.insert("held_out_rms_after_mm".into(), errors_after.rms_mm.into());
            extended.push(NewEffect { table: effect.to_table(), covariance: Some(covariance), provenance });
        }
        merge_curves(&mut added, &mut extended);
        tie_angle_errors(&mut added);
        let axes = self.problem.rows.iter().map(|row| row.seen.len()).max().unwrap_or(3) as f64;
        let wander_mm = self.sigma * self.shape.wander.sqrt();
        let unexplained = self.unexplained(linear);
        let advice = advice(&added, &unexplained, &self.problem);
        Identification {
            rows: self.problem.rows.len(),
            held_out_rows: self.problem.rows.iter().filter(|row| row.held_out).count(),
            noise_mm: self.sigma,
            wander_mm,
            noise_floor_rms_mm: (axes * (self.sigma * self.sigma + wander_mm * wander_mm)).sqrt(),
            before: errors_before,
            after: errors_after,
            after_rms_ci95_mm: self.bootstrap(after),
            added,
            ranking,
            coverage: self.coverage(),
            unexplained,
            advice,
            outliers: self.problem.rows.iter().filter(|row| row.outlier).map(|row| row.line).collect(),
            extended,
            residuals: self.residual_rows(before, after),
        }
    }

    /// Patterns that stayed in the set: more than noise, and in nobody's list.
    fn unexplained(&self, linear: Option<&Linearised>) -> Unexplained {
        let mut correlates = Vec::new();
        for &c in &self.chosen {
            let Home::Pattern(pattern) = self.candidates[c].home else { continue };
            let candidate = &self.candidates[c];
            let share = linear.map_or(0.0, |linear| {
                let mut part = DVector::zeros(self.problem.scalars);
                for (k, column) in candidate.columns().enumerate() {
                    part.axpy(candidate.values[k] / candidate.typical[k], &linear.design.column(column), 1.0);
                }
                let left = self.residual();
                (part.dot(&left) / (part.norm() * left.norm()).max(1e-12)).clamp(-1.0, 1.0)
            });
            let with = match pattern {
                Pattern::Joint(joint) => format!("sin(k·q{0}), cos(k·q{0})", joint + 1),
                Pattern::Time => "time".to_owned(),
                Pattern::Force => "cutting force".to_owned(),
                Pattern::Jump(at) => format!("a jump at {at}/16 of the run"),
            };
            correlates.push(Correlate { with, r: share });
        }
        if let Some(field) = self.shape.field {
            let residual = self.residual();
            let series = self.problem.series(|row| !row.held_out);
            let part = noise::field_of(&residual, &series, self.shape, field);
            let fitted = DVector::from_iterator(
                part.len(),
                part.iter().zip(residual.iter()).map(|(p, r)| if *p == 0.0 { 0.0 } else { *r }),
            );
            let r = part.dot(&fitted) / (part.norm() * fitted.norm()).max(1e-12);
            correlates.push(Correlate { with: "place in the work object".to_owned(), r });
        }
        if self.shape.wander > noise::MOST_WANDER {
            correlates.push(Correlate { with: "time, slowly: far beyond an arm's wander".to_owned(), r: 1.0 });
        }
        correlates.sort_by(|a, b| b.r.abs().total_cmp(&a.r.abs()));
        Unexplained { significant: !correlates.is_empty(), correlates }
    }

    /// Held-out rows outside the joint ranges that a fitted curve has seen.
    fn coverage(&self) -> Coverage {
        let mut coverage = Coverage::default();
        if !self.chosen.iter().any(|&c| self.candidates[c].kind == "joint_error_curve") {
            return coverage;
        }
        let seen = |joint: usize| {
            let fitted = self.problem.rows.iter().filter(|row| !row.held_out).map(move |row| row.motor[joint]);
            fitted.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)))
        };
        let ranges: Vec<(f64, f64)> = (0..6).map(seen).collect();
        for row in self.problem.rows.iter().filter(|row| row.held_out) {
            let outside: Vec<usize> =
                (0..6).filter(|&j| row.motor[j] < ranges[j].0 || row.motor[j] > ranges[j].1).collect();
            coverage.rows_outside += usize::from(!outside.is_empty());
            coverage.joints_outside.extend(outside.iter().map(|j| j + 1));
        }
        coverage.joints_outside.sort_unstable();
        coverage.joints_outside.dedup();
        coverage
    }

    /// 95 % interval of the held-out rms: blocks drawn again and again.
    fn bootstrap(&self, after: &DVector<f64>) -> [f64; 2] {
        const DRAWS: usize = 400;
        let mut blocks: std::collections::BTreeMap<(usize, usize), Vec<f64>> = std::collections::BTreeMap::new();
        for row in self.problem.rows.iter().filter(|row| row.held_out && !row.outlier) {
            let size = after.rows(row.offset, row.seen.len()).norm_squared();
            blocks.entry((row.run, row.block)).or_default().push(size);
        }
        let blocks: Vec<Vec<f64>> = blocks.into_values().collect();
        // A fixed linear congruential sequence (Knuth's MMIX): the same data give the same interval.
        let mut state = 0x9E37_79B9_7F4A_7C15_u64;
        let mut draw = |n: usize| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            #[allow(clippy::cast_possible_truncation)]
            let index = ((state >> 33) as usize) % n.max(1);
            index
        };
        if blocks.is_empty() {
            return [0.0; 2];
        }
        let mut all: Vec<f64> = (0..DRAWS)
            .map(|_| {
                let (sum, count) = (0..blocks.len()).fold((0.0, 0usize), |(sum, count), _| {
                    let block = &blocks[draw(blocks.len())];
                    (sum + block.iter().sum::<f64>(), count + block.len())
                });
                (sum / count.max(1) as f64).sqrt()
            })
            .collect();
        all.sort_by(f64::total_cmp);
        [all[DRAWS / 40], all[DRAWS - 1 - DRAWS / 40]]
    }

    fn residual_rows(&self, before: &DVector<f64>, after: &DVector<f64>) -> Vec<ResidualRow> {
        let whitened = self.whitened(after);
        let three = |v: &DVector<f64>, row: &Observation, scale: f64| {
            std::array::from_fn(|k| if k < row.seen.len() { v[row.offset + k] * scale } else { 0.0 })
        };
        self.problem
            .rows
            .iter()
            .map(|row| ResidualRow {
                run: row.run + 1,
                line: row.line,
                block: row.block,
                held_out: row.held_out,
                outlier: row.outlier,
                prefit_mm: three(before, row, 1.0),
                postfit_mm: three(after, row, 1.0),
                whitened: three(&whitened, row, 1.0 / self.sigma),
            })
            .collect()
    }
}

/// Physical effects that cannot bend to anything: neither patterns nor smooth curves.
fn stiff(candidate: &Candidate) -> bool {
    !candidate.is_pattern() && candidate.kind != "joint_error_curve"
}

/// Curves of single joints become one effect with several curves, as the cell file has them.
fn merge_curves(added: &mut Vec<Added>, extended: &mut Vec<NewEffect>) {
    let of_curves: Vec<usize> = (0..added.len()).filter(|&i| added[i].kind == "joint_error_curve").collect();
    let Some((&first, rest)) = of_curves.split_first() else { return };
    for (n, &i) in rest.iter().enumerate() {
        let (other, table) = (added[i].clone(), extended[i].clone());
        let renamed = other
            .parameters
            .into_iter()
            .map(|p| FittedParameter { name: p.name.replacen("curves[0]", &format!("curves[{}]", n + 1), 1), ..p });
        added[first].parameters.extend(renamed);
        added[first].posterior = added[first].posterior.min(other.posterior);
        added[first].held_out_rms_before_mm = added[first].held_out_rms_before_mm.max(other.held_out_rms_before_mm);
        if let (Some(toml::Value::Array(into)), Some(toml::Value::Array(from))) =
            (extended[first].table.get_mut("curves"), table.table.get("curves"))
        {
            into.extend(from.iter().cloned());
        }
        if let (Some(into), Some(from)) = (&mut extended[first].covariance, table.covariance) {
            let (a, b) = (into.len(), from.len());
            into.iter_mut().for_each(|row| row.extend(std::iter::repeat_n(0.0, b)));
            into.extend(from.into_iter().map(|row| std::iter::repeat_n(0.0, a).chain(row).collect()));
        }
    }
    for &i in rest.iter().rev() {
        added.remove(i);
        extended.remove(i);
    }
}

/// Mean of some gains over its standard error.
fn in_standard_errors(gains: &[f64]) -> f64 {
    let n = gains.len() as f64;
    let mean = gains.iter().sum::<f64>() / n;
    let variance = gains.iter().map(|gain| (gain - mean).powi(2)).sum::<f64>() / (n * (n - 1.0)).max(1.0);
    mean / variance.sqrt().max(f64::MIN_POSITIVE)
}

/// Harmonics and curves beside each other are one thing to these data: an error of the joint angle by the angle.
fn tie_angle_errors(added: &mut [Added]) {
    const KINDS: [&str; 2] = ["gear_harmonic", "joint_error_curve"];
    if !KINDS.iter().all(|kind| added.iter().any(|effect| effect.kind == *kind)) {
        return;
    }
    for effect in added {
        if let Some(own) = KINDS.iter().position(|kind| effect.kind == *kind) {
            effect.posterior = effect.posterior.min(0.5);
            effect.not_told_apart_from.push(KINDS[1 - own].to_owned());
        }
    }
}

fn errors_of(norms: &[f64]) -> Errors {
    let n = norms.len().max(1) as f64;
    Errors {
        rms_mm: (norms.iter().map(|v| v * v).sum::<f64>() / n).sqrt(),
        mean_mm: norms.iter().sum::<f64>() / n,
        max_mm: norms.iter().copied().fold(0.0, f64::max),
    }
}

/// The effect with its fitted numbers.
fn fitted(declared: &Arm, candidate: &Candidate) -> Option<Box<dyn Effect>> {
    match &candidate.home {
        Home::Declared(slot) => Some(declared.effects[*slot].with_values(&candidate.values)),
        Home::New(shape) => Some(shape.0.with_values(&candidate.values)),
        Home::Pattern(_) => None,
    }
}

/// What to measure next.
fn advice(added: &[Added], unexplained: &Unexplained, problem: &Problem) -> Vec<String> {
    let mut all = Vec::new();
    for effect in added.iter().filter(|effect| !effect.not_told_apart_from.is_empty()) {
        all.push(format!(
            "`{}` cannot be told apart from {}: measure in further postures (another area, the wrist flipped, the tool turned \
             about its axis) and at load levels that reverse; more points of the same do not help",
            effect.kind,
            effect.not_told_apart_from.iter().map(|kind| format!("`{kind}`")).collect::<Vec<_>>().join(", "),
        ));
    }
    if unexplained.significant {
        let follows = unexplained.correlates.first().map_or(String::new(), |c| format!(" (it follows {})", c.with));
        all.push(format!("something that no listed effect explains is left{follows}: repeat the run at another time and place to see what it is tied to"));
    }
    if problem.rows.iter().all(|row| !problem.runs[row.run].points[row.point].cuts()) && !problem.free_device {
        all.push("no row carries a cutting force: compliance, curve and force effects cannot be seen; measure loaded rows too".to_owned());
    }
    all
}
