//! The state of an identification: the rows, the candidates with their present numbers, the chosen set and the noise.

use super::candidate::{Candidate, Home, fitted, twins, with};
use super::candidates;
use super::columns::Columns;
use super::data::{Observation, Problem};
use super::design::Design;
use super::device::Device;
use super::differences::Reuse;
use super::found::{Linearised, Map};
use super::gear::{self, Comb, Grid, Term};
use super::moments::Moments;
use super::noise;
use super::outcome::SetShare;
use super::score::{Score, posterior, score};
use super::search::Search;
use super::statistics::median;
use deflex_effects::Shape;
use deflex_equilibrium::Arm;
use nalgebra::{DMatrix, DVector, Vector3};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};

/// The state of an identification.
pub(super) struct Engine {
    /// The arm of the declared cell.
    pub(super) declared: Arm,
    pub(super) problem: Problem,
    pub(super) candidates: Vec<Candidate>,
    /// The chosen set: indices of candidates.
    pub(super) chosen: Vec<usize>,
    /// Standard deviation of the white noise for each axis, mm.
    pub(super) sigma: f64,
    /// The shape of the noise.
    pub(super) shape: noise::Shape,
    /// Posterior covariance of the chosen columns, in typical sizes, in the order of `chosen`.
    pub(super) covariance: DMatrix<f64>,
    /// The map of the error that no effect explains, if there is one.
    pub(super) map: Option<Map>,
    /// Columns of earlier linearisations that can be used again.
    pub(super) reuse: Reuse,
    /// Columns of the last search for gear harmonics.
    pub(super) comb: Option<Grid>,
    /// Rows that are judged but not used in the search: in a dense table neighbouring rows contain nearly the same
    /// information.
    pub(super) aside: Vec<Observation>,
    /// Posterior over sets of effects and faults, most likely first.
    pub(super) sets: Vec<SetShare>,
    /// Variance of the predictions over all sets, relative to the variance within the chosen one.
    pub(super) spread: f64,
    /// The last residual with all that it depends on, because many steps need the same one.
    last: Mutex<Option<(Settled, DVector<f64>)>>,
}

/// All that a residual depends on: the number of scalars, the instruments, and the effects.
type Settled = (usize, Vec<Device>, Vec<toml::Table>);

impl Engine {
    /// An identification of a problem before its first step. `covariances` has those of the declared effects.
    pub(super) fn new(declared: Arm, mut problem: Problem, covariances: &[Option<DMatrix<f64>>]) -> Self {
        let aside = problem.set_aside();
        let candidates = candidates::all(&declared, &problem, covariances);
        let reuse = Reuse::of(if problem.is_of_robot() { 0 } else { candidates.len() });
        let presliding = declared.presliding();
        let shape = noise::Shape { drift: 0.0, correlation: 0.0, field: None };
        let covariance = DMatrix::zeros(0, 0);
        let mut engine = Self {
            declared,
            problem,
            candidates,
            chosen: Vec::new(),
            sigma: 1.0,
            shape,
            covariance,
            map: None,
            reuse,
            comb: None,
            aside,
            sets: Vec::new(),
            spread: 1.0,
            last: Mutex::new(None),
        };
        engine.set_presliding(presliding);
        engine
    }

    /// Makes the prior size of the work object's frame large enough for the constant part of the residual of the
    /// declared cell (mm): a frame can be taught anywhere, and no other effect moves all rows alike.
    pub(super) fn widen_frame(&mut self, before: &DVector<f64>) {
        /// Largest constant part, in prior sizes: beyond three, other effects would be more probable than the frame.
        const MOST_SIZES: f64 = 3.0;
        let measured = |axis: usize| {
            let rows = self.problem.rows.iter().filter(move |row| row.reading.len() == 3 && row.reading.has(axis));
            rows.map(move |row| before[row.offset + axis]).collect()
        };
        let least = Vector3::from_fn(|axis, _| median(measured(axis))).norm() / MOST_SIZES;
        for candidate in &mut self.candidates {
            if !candidate.law().is_some_and(|law| law.like_device_frame) {
                continue;
            }
            let Some(effect) = fitted(&self.declared, candidate) else { continue };
            for (typical, parameter) in candidate.typical.iter_mut().zip(effect.parameters()) {
                if parameter.unit == "mm" {
                    *typical = typical.max(least);
                }
            }
        }
    }

    /// The arm with the chosen effects and the map.
    pub(super) fn arm(&self) -> Arm {
        let changes: Vec<(&Home, &[f64])> =
            self.chosen.iter().map(|&c| (&self.candidates[c].home, &self.candidates[c].values[..])).collect();
        self.arm_of(&changes)
    }

    /// The arm with these numbers of effects, and the map.
    pub(super) fn arm_of(&self, changes: &[(&Home, &[f64])]) -> Arm {
        let mut arm = with(&self.declared, changes);
        arm.effects.extend(self.map.iter().map(|map| map.effect.clone_box()));
        arm
    }

    /// Measured minus predicted by the arm with the chosen effects, mm.
    pub(super) fn residual(&self) -> DVector<f64> {
        let arm = self.arm();
        if self.problem.is_of_robot() {
            return self.problem.residual(&arm);
        }
        let effects = arm.effects.iter().map(|effect| effect.to_table()).collect();
        let key = (self.problem.scalars, self.problem.devices.clone(), effects);
        // The lock is not held while rows are solved, because the threads that solve them may need it.
        let last = || self.last.lock().unwrap_or_else(PoisonError::into_inner);
        let known = last().as_ref().filter(|(known, _)| *known == key).map(|(_, residual)| residual.clone());
        known.unwrap_or_else(|| {
            let residual = self.problem.residual(&arm);
            *last() = Some((key, residual.clone()));
            residual
        })
    }

    /// The columns of the wanted candidates about the present fit, with their moments under each shape of the noise.
    pub(super) fn linearise(&mut self, wanted: &[usize], shapes: &[noise::Shape]) -> Linearised {
        let base = self.residual();
        let (design, always) = Design::new(
            &self.declared, &self.problem, &mut self.candidates, &self.chosen, wanted, &base, &mut self.reuse,
        );
        let data = self.pseudo(&design, base, wanted);
        let moments = self.moments(&design, &data, shapes, None);
        Linearised { moments, always, design, data }
    }

    /// Moments of the fitted rows under each shape of the noise: see [`Moments::on`].
    fn moments(
        &self,
        design: &Design,
        data: &DVector<f64>,
        shapes: &[noise::Shape],
        own: Option<&[Range<usize>]>,
    ) -> Vec<Moments> {
        let series = self.problem.series(|row| !row.held_out);
        let declared = self.problem.declared_sigma_mm;
        let moments = if shapes.iter().any(|shape| shape.field.is_some()) {
            // Only the rows of a part have a field, and there the design has no curves whose columns are not kept.
            let stacked = stacked(design.kept(), data);
            shapes.iter().map(|&shape| Moments::of(&stacked, &series, shape)).collect()
        } else {
            Moments::on(design, data, &series, shapes, own)
        };
        moments.into_iter().map(|moments| Moments { declared, ..moments }).collect()
    }

    /// Forgets what was computed with forces that no longer act.
    pub(super) fn forget_solutions(&mut self) {
        self.last = Mutex::new(None);
        self.reuse.forget_all();
    }

    /// As [`Engine::linearise`], under those of many shapes of the noise that are best for a candidate alone. To find
    /// these shapes only the products of the columns of each candidate are needed.
    pub(super) fn linearise_narrowed(&mut self, wanted: &[usize], shapes: &[noise::Shape]) -> Linearised {
        let linear = self.linearise(wanted, &[]);
        let mut own: Vec<Range<usize>> = wanted.iter().map(|&c| self.candidates[c].columns()).collect();
        own.sort_by_key(|columns| columns.start);
        own.dedup();
        let alone = self.moments(&linear.design, &linear.data, shapes, Some(&own));
        let search = Search::new(&self.candidates, &alone, &linear.always);
        search.narrow(wanted);
        let worth_trying: Vec<noise::Shape> = search.active().into_iter().map(|s| shapes[s]).collect();
        let moments = self.moments(&linear.design, &linear.data, &worth_trying, None);
        Linearised { moments, ..linear }
    }

    /// Evidence of columns under the best of several shapes of the noise.
    pub(super) fn score_of(&self, linear: &Linearised, columns: &Columns, shapes: &[noise::Shape]) -> Score {
        let kept = linear.design.kept().select_columns(columns.list.iter().map(|column| &column.0));
        let stacked = stacked(&kept, &linear.data);
        let series = self.problem.series(|row| !row.held_out);
        let declared = self.problem.declared_sigma_mm;
        let of = |&shape: &noise::Shape| Moments { declared, ..Moments::of(&stacked, &series, shape) };
        let moments: Vec<Moments> = shapes.par_iter().map(of).collect();
        score(&moments, &columns.numbered(), None)
    }

    /// The same columns with the data of the present numbers.
    pub(super) fn renewed(&self, linear: Linearised, wanted: &[usize]) -> Linearised {
        let data = self.pseudo(&linear.design, self.residual(), wanted);
        if linear.moments.iter().any(|moments| moments.shape.field.is_some()) {
            let shapes: Vec<noise::Shape> = linear.moments.iter().map(|moments| moments.shape).collect();
            let moments = self.moments(&linear.design, &data, &shapes, None);
            return Linearised { moments, data, ..linear };
        }
        let series = self.problem.series(|row| !row.held_out);
        let moments = linear.moments.into_iter().map(|m| m.with_data(&linear.design, &data, &series)).collect();
        Linearised { moments, data, ..linear }
    }

    /// Pseudo-data: a residual plus the linear contribution of the chosen numbers, as if each had its start value.
    /// Patterns are not in the residual.
    fn pseudo(&self, design: &Design, residual: DVector<f64>, wanted: &[usize]) -> DVector<f64> {
        let mut data = residual;
        for &c in self.chosen.iter().filter(|c| wanted.contains(c)) {
            let candidate = &self.candidates[c];
            if candidate.is_pattern() {
                continue;
            }
            let off = |k: usize| (candidate.values[k] - candidate.start[k]) / candidate.typical[k];
            design.add(candidate.columns().enumerate().map(|(k, column)| (column, off(k))), &mut data);
        }
        data
    }

    /// The shapes of the noise that are tried near the present one.
    pub(super) fn shapes_about(&self) -> Vec<noise::Shape> {
        match self.shape {
            noise::Shape { field: Some(_), .. } => vec![self.shape],
            _ if self.problem.is_of_robot() => noise::coarse(),
            noise::Shape { drift, .. } if drift > 0.0 => noise::near(self.shape),
            _ => noise::few(),
        }
    }

    /// The posterior over sets, and the variance of the predictions over all of them, relative to the variance within
    /// the chosen set.
    pub(super) fn posterior_over_sets(
        &self,
        search: &Search,
        linear: &Linearised,
        set: &[usize],
        (sigma, shape): (f64, usize),
    ) -> (Vec<SetShare>, f64) {
        /// Largest relative variance: with a larger one the sets disagree by more than the uncertainty of numbers.
        const WIDEST_SPREAD: f64 = 25.0;
        let moments = &linear.moments[shape];
        let frames = linear.always.len();
        let in_cell = |column: usize| {
            let of = |c: &Candidate| c.is_pattern() && c.columns().contains(&column);
            !self.candidates.iter().any(of)
        };
        let predicted = |set: &[usize]| {
            let columns = search.columns(set);
            let mut sum = DVector::zeros(linear.data.len());
            let (mean, covariance) = posterior(moments, &columns, sigma)?;
            let numbers = columns.list.iter().enumerate().skip(frames).filter(|(_, (column, _))| in_cell(*column));
            let numbers: Vec<(usize, usize, f64)> = numbers.map(|(k, &(column, size))| (k, column, size)).collect();
            linear.design.add(numbers.iter().map(|&(k, column, size)| (column, mean[k] * size)), &mut sum);
            Some((sum, numbers, covariance))
        };
        let sets = search.sets(set);
        let reported = sets.iter().map(|(probability, set)| SetShare {
            kinds: search.names(set).into_iter().map(str::to_owned).collect(),
            probability: *probability,
        });
        let reported: Vec<SetShare> = reported.collect();
        let Some((own, numbers, covariance)) = predicted(set) else { return (reported, 1.0) };
        let kept = linear.design.kept();
        let gram = DMatrix::from_fn(numbers.len(), numbers.len(), |i, j| {
            let ((a, left, s), (b, right, t)) = (numbers[i], numbers[j]);
            if left.max(right) >= kept.ncols() {
                return 0.0;
            }
            kept.column(left).dot(&kept.column(right)) * s * t * covariance[(a, b)]
        });
        let within = gram.sum();
        let between: f64 = sets
            .iter()
            .filter_map(|(share, other)| predicted(other).map(|(there, ..)| share * (there - &own).norm_squared()))
            .sum();
        let spread = if within > 0.0 { (1.0 + between / within).min(WIDEST_SPREAD) } else { 1.0 };
        (reported, spread)
    }

    /// The families of the members of a set, sorted; twins with other prior sizes are one family.
    pub(super) fn families(&self, set: &[usize]) -> Vec<&str> {
        let mut all: Vec<&str> = set.iter().map(|&c| &self.candidates[c].family[..]).collect();
        all.sort_unstable();
        all
    }

    /// Chooses a set and fits it. Candidates that leave the set get their start values.
    pub(super) fn choose(&mut self, set: Vec<usize>) {
        // Over the whole robot a twin continues with the numbers of the member that it replaces.
        for &c in set.iter().filter(|c| !self.chosen.contains(c)) {
            let known = self.chosen.iter().find(|&&o| twins(&self.candidates[o], &self.candidates[c]));
            if let Some(&known) = known.filter(|_| self.problem.is_of_robot()) {
                self.candidates[c].values = self.candidates[known].values.clone();
            }
        }
        for &c in self.chosen.iter().filter(|c| !set.contains(c)) {
            let candidate = &mut self.candidates[c];
            candidate.values.clone_from(&candidate.start);
        }
        self.chosen = set;
        self.refit();
    }

    /// Searches for gear harmonics in the residual of the other effects, and adds them as candidates. Returns whether
    /// there is a new one.
    pub(super) fn add_gear(&mut self, linear: &Linearised) -> bool {
        let left = self.pseudo_left();
        let known = self.comb.take();
        // The fits since the linearisation have numbered the columns of the chosen candidates again, so that a
        // candidate is needed that is not chosen.
        let constant =
            |c: &usize| !self.chosen.contains(c) && self.candidates[*c].law().is_some_and(|law| law.is_joint_constant);
        let Some(zero) = (0..self.candidates.len()).find(constant).map(|c| &self.candidates[c]) else { return false };
        let comb = Comb::new(&self.problem, linear.design.kept(), zero, (self.shape, self.sigma), known);
        let (terms, looked_at) = comb.terms(&left);
        let grid = comb.into_grid();
        let known = |terms: &[Term]| {
            let same = |c: &Candidate| is_periodic(c) && gear::terms_of(c) == terms;
            self.candidates.iter().any(same)
        };
        let new: Vec<Candidate> = (1..=terms.len())
            .map(|n| &terms[..n])
            .filter(|terms| !known(terms))
            .map(|terms| gear::candidate(terms, looked_at))
            .collect();
        let any = !new.is_empty();
        self.candidates.extend(new);
        self.comb = grid;
        any
    }

    /// The residual of the chosen effects without gear harmonics, less the chosen patterns, mm.
    pub(super) fn pseudo_left(&mut self) -> DVector<f64> {
        let gear = |c: &usize| is_periodic(&self.candidates[*c]);
        let others: Vec<(&Home, &[f64])> = self
            .chosen
            .iter()
            .filter(|c| !gear(c))
            .map(|&c| (&self.candidates[c].home, &self.candidates[c].values[..]))
            .collect();
        let mut left = self.problem.residual(&with(&self.declared, &others));
        let patterns = self.patterns();
        if !patterns.is_empty() {
            let (design, _) = Design::new(
                &self.declared,
                &self.problem,
                &mut self.candidates,
                &[],
                &patterns,
                &left.clone(),
                &mut Reuse::of(0),
            );
            for &c in &patterns {
                design.add(self.candidates[c].pattern_numbers().map(|(column, number)| (column, -number)), &mut left);
            }
        }
        left
    }

    /// The chosen candidates that are patterns.
    pub(super) fn patterns(&self) -> Vec<usize> {
        self.chosen.iter().copied().filter(|&c| self.candidates[c].is_pattern()).collect()
    }
}

/// A matrix of columns with the data as the last column.
pub(super) fn stacked(columns: &DMatrix<f64>, data: &DVector<f64>) -> DMatrix<f64> {
    let mut stacked = columns.clone().insert_column(columns.ncols(), 0.0);
    stacked.set_column(columns.ncols(), data);
    stacked
}

/// Whether a candidate cannot imitate many others: it is neither an unlisted pattern nor a curve.
pub(super) fn is_inflexible(candidate: &Candidate) -> bool {
    !candidate.is_flexible()
}

/// Whether a candidate is a gear harmonic.
fn is_periodic(candidate: &Candidate) -> bool {
    candidate.law().is_some_and(|law| law.shape == Shape::Periodic)
}
