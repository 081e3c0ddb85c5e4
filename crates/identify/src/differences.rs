//! Computes the columns of candidates about an arm by differences: the change of the residual with each of their
//! numbers.

use super::candidate::{Candidate, Home, same_numbers, twins, with};
use super::data::Problem;
use super::design::{CurveColumns, Design};
use super::device_pose;
use super::pattern;
use deflex_effects::JointCurve;
use deflex_equilibrium::Arm;
use nalgebra::{DMatrix, DVector};
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

/// Kept columns of candidates that are not chosen. They hardly change while the arm has effects of the same kinds,
/// whose numbers are only fitted again.
pub(super) struct Reuse {
    /// Only the columns of candidates below this index are kept, because later candidates are added and removed.
    below: usize,
    /// Kinds of the effects of the arm for which the columns hold, sorted.
    about: Vec<String>,
    /// The columns of each candidate.
    columns: BTreeMap<usize, Vec<DVector<f64>>>,
}

impl Reuse {
    /// Keeps columns of the candidates below this index.
    pub(super) fn of(below: usize) -> Self {
        Self { below, about: Vec::new(), columns: BTreeMap::new() }
    }

    /// Removes all columns, which is needed when the forces of the rows have changed.
    pub(super) fn forget_all(&mut self) {
        self.columns.clear();
    }

    /// Removes the columns of a candidate that has changed.
    pub(super) fn forget(&mut self, candidate: usize) {
        self.columns.remove(&candidate);
    }
}

impl Design {
    /// The columns of the `wanted` candidates about the arm with the `chosen` ones, whose residual is `base`, then
    /// those of the unknown numbers of the instruments. The indices of the latter are returned too. Sets the first
    /// column of each wanted candidate.
    pub(super) fn new(
        declared: &Arm,
        problem: &Problem,
        candidates: &mut [Candidate],
        chosen: &[usize],
        wanted: &[usize],
        base: &DVector<f64>,
        reuse: &mut Reuse,
    ) -> (Self, Vec<usize>) {
        // No columns of chosen candidates are kept. A linearisation of chosen candidates alone therefore leaves the
        // kept columns valid for the set that they were computed for.
        let others = wanted.iter().any(|c| !chosen.contains(c));
        let renumbered = reuse.columns.values().flatten().any(|column| column.len() != problem.scalars);
        let in_arm = chosen.iter().map(|&c| &candidates[c]).filter(|candidate| !candidate.is_pattern());
        let mut about: Vec<String> = in_arm.map(|candidate| candidate.kind.clone()).collect();
        about.sort_unstable();
        if others && reuse.about != about || renumbered {
            reuse.about.clone_from(&about);
            // The columns of patterns that shift the rows do not depend on the arm.
            reuse.columns.retain(|c, _| !renumbered && candidates[*c].is_shift());
        }
        // Candidates that differ only in their prior share the numbers of an effect that the cell declares. Their
        // differences begin at the numbers of the chosen one.
        let of_set = |c: usize| chosen.iter().copied().find(|&o| same_numbers(&candidates[o], &candidates[c]));
        let at: Vec<usize> = (0..candidates.len()).map(|c| of_set(c).unwrap_or(c)).collect();
        let serves = |reuse: &Reuse, c: usize| reuse.about == about && c < reuse.below && !chosen.contains(&at[c]);
        let firsts = firsts(candidates, chosen, wanted);
        let unknowns = (0..problem.devices.len()).map(|run| device_pose::unknowns(problem, run));
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
                    let columns = pattern::columns(&pattern::Context { problem, arm: &whole, base }, *pattern);
                    candidate.columns().zip(columns).for_each(|(at, column)| design.kept.set_column(at, &column));
                }
                // One difference is enough for a curve, because the weights of its knots are known. Rows that the robot
                // itself probed depend on two angles of the joint, so that each knot needs a difference of its own.
                (None, _) => match curve_of(candidate).filter(|_| !problem.is_probed()) {
                    Some(curve) => differences.push((c, 0..candidate.values.len(), Some(curve))),
                    None => differences.extend((0..candidate.values.len()).map(|k| (c, k..k + 1, None))),
                },
            }
        }
        for some in differences.chunks(TOGETHER) {
            let moved = some.iter().map(|(c, numbers, _)| {
                let own = chosen.contains(c).then(|| now(Some(*c)));
                moved(own.as_ref().unwrap_or(&whole), &candidates[at[*c]], numbers.clone())
            });
            let (arms, scales): (Vec<Arm>, Vec<f64>) = moved.unzip();
            let residuals = problem.residuals_near(&arms, &settled);
            for (((c, numbers, curve), scale), residual) in some.iter().zip(scales).zip(residuals) {
                // The residual decreases by the increase of the prediction.
                let mut column = (base - residual) * scale;
                column.iter_mut().for_each(|v| *v = if v.is_finite() { *v } else { 0.0 });
                let columns = candidates[*c].columns();
                match curve {
                    None => design.kept.set_column(columns.start + numbers.start, &column),
                    Some(curve) => {
                        let curve = CurveColumns::new(problem, columns, Arc::clone(curve), column);
                        match candidates[*c].curve {
                            Some(_) => design.curves.push(curve),
                            None => curve.write(&mut design.kept),
                        }
                    }
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
            design.kept.set_column(at, &device_pose::column(problem, &settled, run, axis));
        }
        (design, own.collect())
    }
}

/// The curve of a joint's angle that a candidate is; `None` if it is no such curve.
fn curve_of(candidate: &Candidate) -> Option<Arc<JointCurve>> {
    let of_shape = |home: &Home| match home {
        Home::New(shape) => shape.0.joint_curve().map(Arc::new),
        Home::Declared(_) | Home::Pattern(_) => None,
    };
    candidate.curve.as_ref().map(|curve| Arc::clone(&curve.joint_curve)).or_else(|| of_shape(&candidate.home))
}

/// The first column of each wanted candidate.
struct Firsts {
    of: Vec<First>,
    /// Number of columns that are kept as a matrix.
    kept: usize,
}

/// The first column of a candidate.
struct First {
    /// Its index, among the kept columns or among those of curves.
    at: usize,
    /// Whether the columns are not those of a twin that comes before it.
    new: bool,
}

/// Numbers the columns of the wanted candidates.
fn firsts(candidates: &[Candidate], chosen: &[usize], wanted: &[usize]) -> Firsts {
    let mut of: Vec<First> = Vec::with_capacity(wanted.len());
    let (mut kept, mut of_curves) = (0, 0);
    for (i, &c) in wanted.iter().enumerate() {
        // Twins share their columns unless one of them is chosen, because its columns are about its own numbers.
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

/// Step of a difference as a share of the typical size: small compared with the curvature of the effects, large
/// compared with rounding.
const STEP: f64 = 0.05;

/// Number of arms whose residuals are computed together.
const TOGETHER: usize = 64;

/// The arm with some numbers of a candidate changed by the same step, and the factor by which a difference must be
/// multiplied to be the change for one typical size.
pub(super) fn moved(arm: &Arm, candidate: &Candidate, numbers: Range<usize>) -> (Arm, f64) {
    let mut values = candidate.values.clone();
    let k = numbers.start;
    let (low, high) = candidate.bounds[k];
    let step = STEP * candidate.typical[k];
    let step = if values[k] + step <= high || values[k] - step < low { step } else { -step };
    values[numbers].iter_mut().for_each(|value| *value += step);
    (with(arm, &[(&candidate.home, &values)]), candidate.typical[k] / step)
}
