//! The loop: linearise, weigh, choose, refit, and again about the fit.

use super::candidates::{self, Candidate, FREE_FRAME, Home, Pattern, Shape, with};
use super::data::{Observation, Problem};
use super::noise::{self, Moments};
use super::outcome::{
    Added, Correlate, Coverage, Errors, FittedParameter, Identification, Ranked, ResidualRow, Unexplained,
};
use super::score::posterior;
use super::search::Search;
use crate::cell::{Cell, NewEffect};
use crate::effects::{Effect, gear_harmonic};
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
const ROUNDS: usize = 4;
/// Whitened residuals beyond this are outliers, standard deviations: one in 1.7 million by chance.
const OUTLIER: f64 = 5.0;
/// A name needs this posterior; below it, the set that cannot be told apart.
const NAMED: f64 = 0.9;
/// Rivals below this share of the posterior are not mentioned.
const MENTIONED: f64 = 0.03;
/// Orders that are searched for gear harmonics, in steps of a quarter: finer than a turn of one radian resolves.
const ORDERS: usize = 640;
const ORDER_STEP: f64 = 0.25;
/// Harmonics of gears at most.
const HARMONICS: usize = 4;

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
    let shape = noise::Shape { wander: 0.0, correlation: 0.0 };
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

    /// Gauss-Newton on the chosen numbers with their priors, noise as last chosen.
    fn refit(&mut self) {
        for _ in 0..6 {
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
            let mut at = frames;
            let mut change: f64 = 0.0;
            for &c in &chosen {
                let candidate = &mut self.candidates[c];
                for k in 0..candidate.values.len() {
                    let (low, high) = candidate.bounds[k];
                    let value = (candidate.start[k] + candidate.size(k) * mean[at]).clamp(low, high);
                    if !candidate.is_pattern() {
                        change = change.max((value - candidate.values[k]).abs() / candidate.typical[k]);
                    }
                    candidate.values[k] = value;
                    at += 1;
                }
            }
            // Intervals are those of the full prior: directions that the data do not hold are as wide as it is.
            let wide: Vec<_> = columns.iter().map(|&(column, _)| (column, 1.0)).collect();
            let covariance = posterior(moments, &wide, self.sigma).map_or(covariance, |(_, wide)| wide);
            let size = covariance.nrows() - frames;
            self.covariance = covariance.view((frames, frames), (size, size)).into_owned();
            if change < 1e-4 {
                break;
            }
        }
    }

    fn run(&mut self, before: &DVector<f64>, input: &Input) -> Identification {
        let shapes = noise::shapes();
        let mut last = Vec::new();
        let mut linear = None;
        let mut posteriors = Vec::new();
        let mut ranking = Vec::new();
        // Gear harmonics are searched before smooth curves may imitate them.
        let rounds = if self.problem.free_device { 0 } else { HARMONICS };
        for _ in 0..rounds {
            let wanted: Vec<usize> = (0..self.candidates.len()).filter(|&c| stiff(&self.candidates[c])).collect();
            let now = self.linearise(&wanted, &shapes);
            let search = Search::new(&self.candidates, &now.moments, &now.always);
            let set = search.best(&self.chosen, &stiff);
            let score = search.full(&set);
            (self.sigma, self.shape) = (score.sigma, shapes[score.shape]);
            self.choose(set);
            if !self.add_gear(&now) {
                break;
            }
        }
        for round in 0..ROUNDS {
            let shapes = if self.shape.wander > 0.0 { noise::near(self.shape) } else { noise::few() };
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
            self.choose(set.clone());
            let outliers = self.mark_outliers();
            let gear = !whole && round + 1 < ROUNDS && self.add_gear(&now);
            last.clone_from(&set);
            linear = Some(now);
            if same && !outliers && !gear {
                break;
            }
        }
        let after = self.residual();
        self.outcome(before, &after, &posteriors, ranking, linear.as_ref(), input)
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

    /// Searches joints and orders for a gear harmonic in what is left; adds it as a candidate if it pays.
    fn add_gear(&mut self, linear: &Linearised) -> bool {
        let Some(zero) = self.candidates.iter().find(|c| c.kind == "zero_offset") else { return false };
        let known: Vec<(usize, usize)> = gear_terms(&self.candidates, &self.chosen);
        if known.len() >= HARMONICS {
            return false;
        }
        const TYPICAL_RAD: f64 = 5e-5;
        let series = self.problem.series(|row| !row.held_out);
        let used: Vec<usize> = series.iter().flat_map(|s| s.samples.iter().map(|&(row, ..)| row)).collect();
        let (typical, first) = (zero.typical.clone(), zero.first);
        let left = self.pseudo_left();
        let left = noise::whiten(&DMatrix::from_columns(&[left]), &series, self.shape).columns.select_rows(&used);
        let problem = &self.problem;
        let precision = self.sigma.powi(-2);
        let shape = self.shape;
        let pairs: Vec<(usize, usize)> = (0..6).flat_map(|j| (4..=ORDERS).map(move |n| (j, n))).collect();
        let gains: Vec<f64> = pairs
            .par_iter()
            .map(|&(joint, order)| {
                let along = linear.design.column(first + joint) * (TYPICAL_RAD / typical[joint]);
                let mut columns = DMatrix::zeros(problem.scalars, 2);
                for row in &problem.rows {
                    let (sin, cos) = (order as f64 * ORDER_STEP * row.motor[joint]).sin_cos();
                    for k in row.offset..row.offset + row.seen.len() {
                        (columns[(k, 0)], columns[(k, 1)]) = (along[k] * cos, along[k] * sin);
                    }
                }
                let white = noise::whiten(&columns, &series, shape).columns.select_rows(&used);
                let gram = DMatrix::identity(2, 2) + white.tr_mul(&white) * precision;
                let cross = white.tr_mul(&left) * precision;
                gram.cholesky().map_or(0.0, |c| 0.5 * cross.dot(&c.solve(&cross)) - 0.5 * c.determinant().ln())
            })
            .collect();
        let Some(best) = (0..pairs.len()).max_by(|&a, &b| gains[a].total_cmp(&gains[b])) else { return false };
        let price = super::search::PRICE + (pairs.len() as f64).ln();
        if gains[best] < price || known.contains(&pairs[best]) {
            return false;
        }
        let terms: Vec<(usize, usize)> = known.iter().copied().chain([pairs[best]]).collect();
        let variants = (pairs.len() as f64).powi(i32::try_from(terms.len()).unwrap_or(1));
        let named: Vec<(usize, f64)> =
            terms.iter().map(|&(joint, order)| (joint + 1, order as f64 * ORDER_STEP)).collect();
        let effect = gear_harmonic(&named);
        let home = Home::New(Shape(effect.clone_box()));
        // One harmonic effect holds all terms: the shorter one gives way.
        self.candidates.push(Candidate::new(effect.as_ref(), home, variants));
        true
    }

    /// What is left with the patterns of the chosen set taken off too.
    fn pseudo_left(&mut self) -> DVector<f64> {
        let patterns: Vec<usize> = self.chosen.iter().copied().filter(|&c| self.candidates[c].is_pattern()).collect();
        let mut left = self.residual();
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
                Pattern::Place => "place in the work object".to_owned(),
                Pattern::Joint(joint) => format!("sin(k·q{0}), cos(k·q{0})", joint + 1),
                Pattern::Time => "time".to_owned(),
                Pattern::Force => "cutting force".to_owned(),
                Pattern::Jump(at) => format!("a jump at {at}/16 of the run"),
            };
            correlates.push(Correlate { with, r: share });
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

/// The terms of the chosen gear harmonic, as (joint from 0, order in quarters).
fn gear_terms(candidates: &[Candidate], chosen: &[usize]) -> Vec<(usize, usize)> {
    let mut found = Vec::new();
    for &c in chosen.iter().filter(|&&c| candidates[c].kind == "gear_harmonic") {
        let Home::New(shape) = &candidates[c].home else { continue };
        let table = shape.0.to_table();
        for term in table.get("terms").and_then(toml::Value::as_array).into_iter().flatten() {
            let number = |key: &str| term.get(key).and_then(|v| v.as_float().or(v.as_integer().map(|i| i as f64)));
            if let (Some(joint), Some(order)) = (number("joint"), number("order")) {
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
                found.push((joint as usize - 1, (order / ORDER_STEP).round() as usize));
            }
        }
    }
    found
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
