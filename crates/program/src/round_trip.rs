//! Checks that a program survives a write: without changes the bytes stay, and a shift of all targets is read back.

use super::shared::follows;
use super::{Change, Editable, Goal, Program, Reason, RewriteOptions, Role, Target};
use deflex_text::{Diagnostic, Source};
use std::collections::BTreeSet;

/// The result of a write in memory.
///
/// # Examples
/// ```
/// # let program = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/program.rs"));
/// let result = deflex_program::round_trip(&program, deflex_program::rapid::read);
/// assert!(result.identical && result.shifted_ok && result.holds(), "{:?}", result.why);
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct RoundTrip {
    /// Writing without a change gives the same bytes.
    pub identical: bool,
    /// Writing every target shifted and reading it back gives the shifted targets and no other change.
    pub shifted_ok: bool,
    /// The first difference, for people.
    pub why: Option<String>,
}

impl RoundTrip {
    /// Whether both writes are right.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.identical && self.shifted_ok
    }
}

/// The constant shift, mm: exact in four decimals and different along each axis.
const SHIFT_MM: [f64; 3] = [0.25, -0.5, 0.125];

/// Half of the last digit printed (four decimals), along each of three rotated axes, and as much
/// again for what was read.
const TOLERANCE_MM: f64 = 2e-4;

/// Rounding of a position to single precision, as a share of it.
const SINGLE: f64 = 0.5 * f32::EPSILON as f64;

/// Writes `program` unchanged and with every target shifted, reads the second back with `reread`
/// (which gets the written sources, then the context sources), and compares.
///
/// # Examples
/// ```
/// # let program = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/program.rs"));
/// assert!(deflex_program::round_trip(&program, deflex_program::rapid::read).holds());
/// ```
pub fn round_trip(
    program: &Program,
    reread: impl FnOnce(Vec<Source>, Vec<Source>) -> Result<Program, Vec<Diagnostic>>,
) -> RoundTrip {
    // Nothing is cut here: a target without numbers of its own goes along with those of others.
    let air: Vec<bool> = program.targets.iter().map(|target| follows(target.editable)).collect();
    let options = RewriteOptions { air: &air, ..RewriteOptions::default() };
    let unchanged = program.rewrite(&vec![None; program.targets.len()], &[], &options);
    let identical = program.edited(&unchanged.edits).iter().zip(&*program.sources).all(|(a, b)| a.bytes == b.bytes);

    let mut changes: Vec<Option<Change>> = program.targets.iter().map(|t| shifted(&t.goal)).collect();
    let rewritten = program.rewrite(&changes, &[], &options);
    for (i, change) in changes.iter_mut().enumerate() {
        if rewritten.along.binary_search(&i).is_ok() {
            *change = Some(Change { position_mm: rewritten.written[i].0, quat: None, conf: None, external: None });
        } else if matches!(program.targets[i].editable, Editable::No(_)) {
            *change = None;
        }
    }
    let mut sources = program.edited(&rewritten.edits);
    let context = sources.split_off(program.written.min(sources.len()));
    let why = match reread(sources, context) {
        Err(errors) => Some(errors.first().map_or_else(|| "not read back".to_owned(), ToString::to_string)),
        Ok(again) => difference(program, &again, &changes, &rewritten.kept),
    };
    let why = why.or_else(|| (!identical).then(|| "bytes differ without a change".to_owned()));
    RoundTrip { identical, shifted_ok: identical && why.is_none(), why }
}

fn shifted(goal: &Goal) -> Option<Change> {
    let (Goal::Pose { position_mm, .. } | Goal::Axis { position_mm, .. }) = goal else { return None };
    let position_mm = std::array::from_fn(|i| position_mm[i] + SHIFT_MM[i]);
    Some(Change { position_mm, quat: None, conf: None, external: None })
}

/// The first difference between what was wanted and what was read back.
fn difference(
    program: &Program,
    again: &Program,
    changes: &[Option<Change>],
    kept: &[(usize, Reason)],
) -> Option<String> {
    let ambiguous = first_ambiguous(program, again);
    let (targets, targets_again) = match ambiguous {
        Some(line) => (before(program, line), before(again, line)),
        None => (&program.targets[..], &again.targets[..]),
    };
    if targets_again.len() != targets.len() {
        return Some(format!("{} targets became {}", targets.len(), targets_again.len()));
    }
    if ambiguous.is_none() {
        if again.literal_targets != program.literal_targets || again.arcs != program.arcs {
            return Some("the number of literal targets or arcs is different".to_owned());
        }
        if again.kept.len() != program.kept.len() || again.tools != program.tools || again.wobjs != program.wobjs {
            return Some("text that was not edited is read differently".to_owned());
        }
    }
    let mut unwritten = vec![None; program.targets.len()];
    for &(at, reason) in kept {
        unwritten[at] = Some(reason);
    }
    for (at, (was, is)) in targets.iter().zip(targets_again).enumerate() {
        let fault = |what: &str| Some(format!("line {}: {what}", was.line));
        if let (Some(reason), false) = (unwritten[at], matches!(was.editable, Editable::No(_))) {
            return fault(&format!("the target can be edited, but was not written: {reason}"));
        }
        let change = changes[at].as_ref().filter(|_| unwritten[at].is_none());
        // An offset counts from its base in the controller's precision.
        let single = if was.editable == Editable::Pose { 0.0 } else { SINGLE };
        if !same(&was.goal, &is.goal, change, single) {
            let wanted = change.map_or_else(|| place(&was.goal), |change| numbers(&change.position_mm));
            return fault(&format!("wanted at {wanted}, read back at {}, perhaps turned", place(&is.goal)));
        }
        if (was.role, was.ordinal, was.motion, was.rapid) != (is.role, is.ordinal, is.motion, is.rapid) {
            return fault("another motion");
        }
    }
    None
}

/// Where a goal is, for people.
fn place(goal: &Goal) -> String {
    match goal {
        Goal::Pose { position_mm, .. } | Goal::Axis { position_mm, .. } => numbers(position_mm),
        Goal::Joints { .. } => "axis angles".to_owned(),
    }
}

fn numbers(position_mm: &[f64; 3]) -> String {
    let [x, y, z] = position_mm;
    format!("x {x:.4}, y {y:.4}, z {z:.4} mm")
}

/// Targets of whole motions that end before a line, without the chords of an arc that ends after it.
fn before(program: &Program, line: usize) -> &[Target] {
    let targets = &program.targets[..program.targets.partition_point(|target| (target.line as usize) < line)];
    let whole = targets.iter().rposition(|target| target.role != Role::Interpolated).map_or(0, |last| last + 1);
    &targets[..whole]
}

/// The line of the first statement of CL data that only one of two readings refuses because of its numbers. A program with such a statement is
/// not written, and the path after it differs.
fn first_ambiguous(program: &Program, again: &Program) -> Option<usize> {
    let lines = |program: &Program| -> BTreeSet<usize> {
        let refused = program.kept.iter().filter(|kept| kept.reason == Reason::AmbiguousList);
        refused.map(|kept| kept.line).collect()
    };
    lines(program).symmetric_difference(&lines(again)).next().copied()
}

/// Whether `is` equals `was` after `change`, within the share `single` of large numbers.
fn same(was: &Goal, is: &Goal, change: Option<&Change>, single: f64) -> bool {
    let near = |a: &[f64], b: &[f64], tolerance: f64| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= tolerance);
    match (was, is) {
        (
            Goal::Pose { position_mm: p, quat: q, conf: c },
            Goal::Pose { position_mm: again, quat: q_again, conf: c_again },
        ) => {
            let wanted = change.map_or(p, |c| &c.position_mm);
            let tolerance = TOLERANCE_MM + single * wanted.iter().fold(0.0, |most, v| v.abs().max(most));
            near(wanted, again, tolerance) && near(q, q_again, 0.0) && c == c_again
        }
        (Goal::Axis { position_mm: p, axis, .. }, Goal::Axis { position_mm: again, axis: axis_again, .. }) => {
            let wanted = change.map_or(p, |c| &c.position_mm);
            near(wanted, again, TOLERANCE_MM) && near(axis, axis_again, 0.0)
        }
        _ => was == is,
    }
}
