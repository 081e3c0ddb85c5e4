//! The change that each number of the candidates makes to every row: a column a number, mm per typical size.
//!
//! A curve has a column a knot, over the whole robot hundreds in all. Each is what the whole curve does, raised alike,
//! times what its knot counts for at the row's angle: only the former is kept, and the columns are made of it some rows at
//! a time.

use super::candidates::{Candidate, Home, twins, with};
use super::data::Problem;
use super::device;
use super::moments::gather;
use super::noise::Sample;
use super::pattern;
use crate::effects::JointCurve;
use crate::equilibrium::Arm;
use nalgebra::{DMatrix, DVector};
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

/// Columns over the stacked scalars of all rows: those that are kept, then those of curves.
pub(super) struct Design {
    kept: DMatrix<f64>,
    curves: Vec<Along>,
}

/// Columns of candidates that are not chosen, about the arm with one set of others in it: they hardly change while that set
/// is only fitted anew.
pub(super) struct Reuse {
    /// Candidates from this one on come and go.
    below: usize,
    /// The set.
    about: Vec<usize>,
    columns: BTreeMap<usize, Vec<DVector<f64>>>,
}

impl Reuse {
    /// Of candidates below this number.
    pub(super) fn of(below: usize) -> Self {
        Self { below, about: Vec::new(), columns: BTreeMap::new() }
    }
}

/// The columns of a curve.
struct Along {
    columns: Range<usize>,
    of: Arc<JointCurve>,
    /// What the whole curve does to each scalar, raised alike.
    raised: DVector<f64>,
    /// The joint's angle in each scalar's row.
    angle_deg: Vec<f64>,
}

impl Design {
    /// Columns of the `wanted` candidates about the arm with the `chosen` ones in it (whose residual is `base`); then, for
    /// unknown instruments, theirs, whose places are returned too.
    pub(super) fn new(
        declared: &Arm,
        problem: &Problem,
        candidates: &mut [Candidate],
        chosen: &[usize],
        wanted: &[usize],
        base: &DVector<f64>,
        reuse: &mut Reuse,
    ) -> (Self, Vec<usize>) {
        // Of members of the set itself no columns are kept: others' serve on when these alone are asked about another set.
        let others = wanted.iter().any(|c| !chosen.contains(c));
        let renumbered = reuse.columns.values().flatten().any(|column| column.len() != problem.scalars);
        if others && reuse.about != chosen || renumbered {
            reuse.about = chosen.to_vec();
            // What shifts the rows does so whatever the arm is.
            reuse.columns.retain(|c, _| !renumbered && candidates[*c].is_shift());
        }
        let serves = |reuse: &Reuse, c: usize| reuse.about == chosen && c < reuse.below && !chosen.contains(&c);
        let firsts = firsts(candidates, chosen, wanted);
        let unknowns = (0..problem.devices.len()).map(|run| device::unknowns(problem, run));
        let instruments: Vec<(usize, usize)> =
            unknowns.enumerate().flat_map(|(run, unknowns)| (0..unknowns).map(move |axis| (run, axis))).collect();
        let own = firsts.kept..firsts.kept + instruments.len();
        for (&c, first) in wanted.iter().zip(&firsts.of) {
            candidates[c].first = match candidates[c].curve {
                Some(_) => own.end + first.at,
                None => first.at,
            };
        }
        let now = |but: Option<usize>| {
            let changes: Vec<(&Home, &[f64])> = chosen
                .iter()
                .filter(|&&c| Some(c) != but)
                .map(|&c| (&candidates[c].home, &candidates[c].values[..]))
                .collect();
            with(declared, &changes)
        };
        let whole = now(None);
        let settled = problem.equilibria(&whole);
        let mut design = Self { kept: DMatrix::zeros(problem.scalars, own.end), curves: Vec::new() };
        let mut differences = Vec::new();
        for (&c, _) in wanted.iter().zip(&firsts.of).filter(|(_, first)| first.new) {
            let candidate = &candidates[c];
            let known = reuse.columns.get(&c).filter(|_| serves(reuse, c));
            match (known, &candidate.home) {
                (Some(known), _) => {
                    candidate.columns().zip(known).for_each(|(at, column)| design.kept.set_column(at, column));
                }
                (None, Home::Pattern(pattern)) => {
                    let columns = pattern::columns(&pattern::About { problem, arm: &whole, base }, *pattern);
                    candidate.columns().zip(columns).for_each(|(at, column)| design.kept.set_column(at, &column));
                }
                // A curve is moved as a whole.
                (None, _) if candidate.curve.is_some() => differences.push((c, 0..candidate.values.len())),
                (None, _) => differences.extend((0..candidate.values.len()).map(|k| (c, k..k + 1))),
            }
        }
        for some in differences.chunks(TOGETHER) {
            let moved = some.iter().map(|(c, numbers)| {
                let own = chosen.contains(c).then(|| now(Some(*c)));
                moved(own.as_ref().unwrap_or(&whole), &candidates[*c], numbers.clone())
            });
            let (arms, scales): (Vec<Arm>, Vec<f64>) = moved.unzip();
            let residuals = problem.residuals_near(&arms, &settled);
            for (((c, numbers), scale), residual) in some.iter().zip(scales).zip(residuals) {
                // The residual falls by what the prediction grows.
                let mut column = (base - residual) * scale;
                column.iter_mut().for_each(|v| *v = if v.is_finite() { *v } else { 0.0 });
                let columns = candidates[*c].columns();
                match &candidates[*c].curve {
                    Some(curve) => design.curves.push(Along::new(problem, columns, Arc::clone(&curve.of), column)),
                    None => design.kept.set_column(columns.start + numbers.start, &column),
                }
            }
        }
        for (&c, first) in wanted.iter().zip(&firsts.of) {
            let kept = first.new && candidates[c].curve.is_none();
            if kept && serves(reuse, c) && !reuse.columns.contains_key(&c) {
                let columns = candidates[c].columns().map(|at| design.kept.column(at).into_owned()).collect();
                reuse.columns.insert(c, columns);
            }
        }
        for (at, (run, axis)) in own.clone().zip(instruments) {
            design.kept.set_column(at, &device::column(problem, &settled, run, axis));
        }
        (design, own.collect())
    }

    /// Number of columns.
    pub(super) fn width(&self) -> usize {
        self.kept.ncols() + self.curves.iter().map(|along| along.columns.len()).sum::<usize>()
    }

    /// Columns that are no curve's.
    pub(super) fn kept(&self) -> &DMatrix<f64> {
        &self.kept
    }

    /// Adds columns, each times a number.
    pub(super) fn add(&self, numbers: impl IntoIterator<Item = (usize, f64)>, into: &mut DVector<f64>) {
        let mut of_curves = vec![0.0; self.width() - self.kept.ncols()];
        for (column, number) in numbers {
            match column.checked_sub(self.kept.ncols()) {
                Some(at) => of_curves[at] += number,
                None => into.axpy(number, &self.kept.column(column), 1.0),
            }
        }
        for along in &self.curves {
            let from = along.columns.start - self.kept.ncols();
            let values = &of_curves[from..from + along.columns.len()];
            if values.iter().any(|value| value.abs() > 0.0) {
                along.add(values, into);
            }
        }
    }

    /// Writes the columns at some samples, each sample's together.
    pub(super) fn fill(&self, samples: &[Sample], rows: usize, block: &mut [f64]) {
        gather(&self.kept, samples, rows, block);
        if self.curves.is_empty() {
            return;
        }
        for (&(scalar, ..), block) in samples.iter().zip(block.chunks_exact_mut(rows)) {
            for along in &self.curves {
                let weights = &mut block[along.columns.clone()];
                along.of.weights(along.angle_deg[scalar], weights);
                weights.iter_mut().for_each(|weight| *weight *= along.raised[scalar]);
            }
        }
    }
}

impl Along {
    fn new(problem: &Problem, columns: Range<usize>, of: Arc<JointCurve>, raised: DVector<f64>) -> Self {
        let mut angle_deg = vec![0.0; problem.scalars];
        for row in &problem.rows {
            angle_deg[row.scalars()].fill(row.motor[of.joint].to_degrees());
        }
        Self { columns, of, raised, angle_deg }
    }

    /// Adds the curve with these values at its knots.
    fn add(&self, values: &[f64], into: &mut DVector<f64>) {
        let mut weights = vec![0.0; values.len()];
        for (scalar, into) in into.iter_mut().enumerate() {
            self.of.weights(self.angle_deg[scalar], &mut weights);
            *into +=
                self.raised[scalar] * weights.iter().zip(values).map(|(weight, value)| weight * value).sum::<f64>();
        }
    }
}

/// Where candidates' columns begin: those of curves are counted by themselves.
struct Firsts {
    of: Vec<First>,
    /// Columns that are kept.
    kept: usize,
}

struct First {
    at: usize,
    /// Whether no twin has made the columns already.
    new: bool,
}

fn firsts(candidates: &[Candidate], chosen: &[usize], wanted: &[usize]) -> Firsts {
    let mut of: Vec<First> = Vec::with_capacity(wanted.len());
    let (mut kept, mut of_curves) = (0, 0);
    for (i, &c) in wanted.iter().enumerate() {
        // Twins share their columns, while neither is about its own numbers.
        let twin = wanted[..i].iter().position(|&o| twins(&candidates[o], &candidates[c]));
        if let Some(twin) = twin.filter(|&twin| !chosen.contains(&c) && !chosen.contains(&wanted[twin])) {
            of.push(First { at: of[twin].at, new: false });
            continue;
        }
        let next = if candidates[c].curve.is_some() { &mut of_curves } else { &mut kept };
        of.push(First { at: *next, new: true });
        *next += candidates[c].values.len();
    }
    Firsts { of, kept }
}

/// Step of a difference, as a share of the typical size: small against curvature, large against rounding.
const STEP: f64 = 0.05;

/// Arms that are asked for all rows together.
const TOGETHER: usize = 64;

/// An arm with some numbers of a candidate moved alike, by one step, and what makes a difference one per typical size.
fn moved(arm: &Arm, candidate: &Candidate, numbers: Range<usize>) -> (Arm, f64) {
    let mut values = candidate.values.clone();
    let k = numbers.start;
    let (low, high) = candidate.bounds[k];
    let step = STEP * candidate.typical[k];
    let step = if values[k] + step <= high || values[k] - step < low { step } else { -step };
    values[numbers].iter_mut().for_each(|value| *value += step);
    (with(arm, &[(&candidate.home, &values)]), candidate.typical[k] / step)
}
