//! The columns of candidates about an arm: what each of their numbers changes, by differences.

use super::candidate::{Candidate, Home, same_numbers, twins, with};
use super::data::Problem;
use super::design::{Along, Design};
use super::device_pose;
use super::pattern;
use crate::effects::JointCurve;
use crate::equilibrium::Arm;
use nalgebra::{DMatrix, DVector};
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

/// Columns of candidates that are not chosen, about the arm with effects of some kinds in it: they hardly change while
/// these are only fitted anew.
pub(super) struct Reuse {
    /// Candidates from this one on come and go.
    below: usize,
    /// The kinds, in order.
    about: Vec<String>,
    columns: BTreeMap<usize, Vec<DVector<f64>>>,
}

impl Reuse {
    /// Of candidates below this number.
    pub(super) fn of(below: usize) -> Self {
        Self { below, about: Vec::new(), columns: BTreeMap::new() }
    }

    /// Forgets all columns: the rows have changed.
    pub(super) fn forget_all(&mut self) {
        self.columns.clear();
    }

    /// Forgets the columns of a candidate that has changed.
    pub(super) fn forget(&mut self, candidate: usize) {
        self.columns.remove(&candidate);
    }
}

impl Design {
    /// Columns of the `wanted` candidates about the arm with the `chosen` ones in it (whose residual is `base`); then,
    /// for unknown instruments, theirs, whose places are returned too.
    pub(super) fn new(
        declared: &Arm,
        problem: &Problem,
        candidates: &mut [Candidate],
        chosen: &[usize],
        wanted: &[usize],
        base: &DVector<f64>,
        reuse: &mut Reuse,
    ) -> (Self, Vec<usize>) {
        // Of members of the set itself no columns are kept: columns of others stay valid when only these are linearised
        // for another set.
        let others = wanted.iter().any(|c| !chosen.contains(c));
        let renumbered = reuse.columns.values().flatten().any(|column| column.len() != problem.scalars);
        let in_arm = chosen.iter().map(|&c| &candidates[c]).filter(|candidate| !candidate.is_pattern());
        let mut about: Vec<String> = in_arm.map(|candidate| candidate.kind.clone()).collect();
        about.sort_unstable();
        if others && reuse.about != about || renumbered {
            reuse.about.clone_from(&about);
            // What shifts the rows does so whatever the arm is.
            reuse.columns.retain(|c, _| !renumbered && candidates[*c].is_shift());
        }
        // Numbers of an effect that the cell declares are moved from where they are, also for a prior of another size.
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
                // A curve is moved as a whole: what each knot counts for is known.
                // Where the robot itself probed a row, the joint had two angles.
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
                // The residual falls by what the prediction grows.
                let mut column = (base - residual) * scale;
                column.iter_mut().for_each(|v| *v = if v.is_finite() { *v } else { 0.0 });
                let columns = candidates[*c].columns();
                match curve {
                    None => design.kept.set_column(columns.start + numbers.start, &column),
                    Some(curve) => {
                        let along = Along::new(problem, columns, Arc::clone(curve), column);
                        match candidates[*c].curve {
                            Some(_) => design.curves.push(along),
                            None => along.write(&mut design.kept),
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

/// The curve of a joint's angle that a candidate is, where it is one.
fn curve_of(candidate: &Candidate) -> Option<Arc<JointCurve>> {
    let of_shape = |home: &Home| match home {
        Home::New(shape) => shape.0.joint_curve().map(Arc::new),
        Home::Declared(_) | Home::Pattern(_) => None,
    };
    candidate.curve.as_ref().map(|curve| Arc::clone(&curve.joint_curve)).or_else(|| of_shape(&candidate.home))
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

/// Arms that are evaluated for all rows together.
const TOGETHER: usize = 64;

/// An arm with some numbers of a candidate moved alike, by one step, and what makes a difference one per typical size.
pub(super) fn moved(arm: &Arm, candidate: &Candidate, numbers: Range<usize>) -> (Arm, f64) {
    let mut values = candidate.values.clone();
    let k = numbers.start;
    let (low, high) = candidate.bounds[k];
    let step = STEP * candidate.typical[k];
    let step = if values[k] + step <= high || values[k] - step < low { step } else { -step };
    values[numbers].iter_mut().for_each(|value| *value += step);
    (with(arm, &[(&candidate.home, &values)]), candidate.typical[k] / step)
}
