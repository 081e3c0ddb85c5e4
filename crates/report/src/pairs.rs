//! Matches the targets of two programs of which the second has inserted targets.

use deflex_drive::Track;
use deflex_program::alignment::{Fit, align};
use deflex_program::{ArcTurn, Conf, Goal, Program, Role, Target};
use deflex_robot::Pose;
use deflex_text::{Edit, Span};
use nalgebra::{Quaternion, Rotation3, Translation3, UnitQuaternion, Vector3};
use serde::Serialize;

/// How far from the path of the first program an inserted target may be, mm: the largest correction of a cell without `[limits]`.
const NEAR: f64 = 5.5;

/// A target that only the second program has.
///
/// # Examples
/// ```
/// # let (program, _) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/slot.rs"));
/// for inserted in deflex_report::difference(&program, &program).inserted {
///     println!("target {} before target {} of the first program", inserted.target, inserted.before);
/// }
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct InsertedTarget {
    /// Ordinal in the second program.
    pub target: u32,
    /// Line there.
    pub line: u32,
    /// Ordinal of the target of the first program before which it was inserted.
    pub before: u32,
}

/// The targets of two programs that belong together.
pub(super) struct Pairs {
    /// Indices into both, and whether both are the same place. The circle point of an arc that was split is another place.
    pub(super) same: Vec<(usize, usize, bool)>,
    /// The inserted targets of the second program, with the span of their instruction: source, start and end.
    pub(super) inserted: Vec<(InsertedTarget, (usize, Span))>,
}

impl Pairs {
    pub(super) fn in_order(first: &Program, second: &Program) -> Self {
        let same = (0..first.targets.len().min(second.targets.len())).map(|i| (i, i, true)).collect();
        Self { same, inserted: Vec::new() }
    }

    /// `None` if the second program is not the first one with inserted targets.
    pub(super) fn subdivided(first: &Program, second: &Program) -> Option<Self> {
        let matched = align(first, second, &Near { first, second }).ok()?;
        let mut pairs = Self { same: Vec::with_capacity(first.targets.len()), inserted: Vec::new() };
        let mut at = 0;
        for (i, k) in matched {
            let is_via = |k: usize| second.targets[k].role == Role::Via;
            let via = k.checked_sub(1).filter(|via| *via >= at && is_via(*via));
            if let Some(via) = via {
                pairs.same.push((i - 1, via, via == at));
            }
            for inserted in (at..via.unwrap_or(k)).filter(|k| !is_via(*k)) {
                let Target { ordinal: target, line, source, span, .. } = second.targets[inserted];
                let inserted = InsertedTarget { target, line, before: first.targets[i].ordinal };
                pairs.inserted.push((inserted, (usize::from(source), span)));
            }
            pairs.same.push((i, k, true));
            at = k + 1;
        }
        Some(pairs)
    }

    /// Edits that take the inserted instructions out of a source of the second program.
    pub(super) fn insertions(&self, second: &Program, source: usize) -> Vec<Edit> {
        let here = self.inserted.iter().filter(|(_, (other, _))| *other == source);
        second.removal(source, &here.map(|(_, (_, span))| *span).collect::<Vec<_>>())
    }
}

/// The path of the first program by the numbers in its text, without a cell.
struct Near<'a> {
    first: &'a Program,
    second: &'a Program,
}

impl Near<'_> {
    /// The path to a target of the first program, mm; `None` if it begins in the axes of another work object.
    fn way(&self, i: usize) -> Option<Track> {
        let targets = &self.first.targets;
        let pose = |target: &Target| {
            let at = position(&target.goal)?;
            Some(Pose::from_parts(Translation3::from(at), Rotation3::identity()))
        };
        let own = |k: usize| Some(&targets[k]).filter(|target| target.wobj == targets[i].wobj);
        let before = i.checked_sub(1)?;
        let to = pose(&targets[i])?;
        if targets[before].role == Role::Via {
            let [start, via] = [before.checked_sub(1)?, before].map(|k| own(k).and_then(pose));
            return Some(Track::arc(&start?, &via?, &to, ArcTurn::Even));
        }
        Some(Track::line(&pose(own(before)?)?, &to))
    }
}

impl Fit for Near<'_> {
    fn is_same(&self, second: usize, first: usize) -> bool {
        let (a, b) = (&self.first.targets[first].goal, &self.second.targets[second].goal);
        a == b || position(a).zip(position(b)).is_some_and(|(a, b)| (a - b).norm() <= NEAR)
    }

    fn is_on_way(&self, second: usize, first: usize) -> bool {
        let Some((way, at)) = self.way(first).zip(position(&self.second.targets[second].goal)) else { return false };
        (way.pose(way.nearest(&at)).translation.vector - at).norm() <= NEAR
    }

    fn costs(&self, pairs: &[(usize, usize)]) -> Vec<f64> {
        let apart = |&(second, first): &(usize, usize)| {
            let (a, b) = (&self.first.targets[first], &self.second.targets[second]);
            let shift = compare(&a.goal, &b.goal).0.norm_squared();
            // An inserted target has the settings of the motion into which it was inserted. Without this cost, a target
            // with another speed after the last cut could be taken for the corrected end of the cut, because it may lie
            // nearer to it.
            let is_set_otherwise = !settings(self.first, a, self.second, b).is_empty();
            if is_set_otherwise { shift + NEAR * NEAR } else { shift }
        };
        pairs.iter().map(apart).collect()
    }
}

/// From one goal to another: the shift, mm, the turn, degrees, and configurations that differ.
pub(super) fn compare(a: &Goal, b: &Goal) -> (Vector3<f64>, f64, Option<(Conf, Conf)>) {
    let turn = |q: &[f64; 4]| UnitQuaternion::new_normalize(Quaternion::new(q[0], q[1], q[2], q[3]));
    match (a, b) {
        (Goal::Pose { position_mm: p, quat: q, conf: c }, Goal::Pose { position_mm: p2, quat: q2, conf: c2 }) => {
            let deg = turn(q).angle_to(&turn(q2)).to_degrees();
            let conf = c.zip(*c2).filter(|(c, c2)| c != c2);
            (Vector3::from(*p2) - Vector3::from(*p), deg, conf)
        }
        (Goal::Axis { position_mm: p, axis, .. }, Goal::Axis { position_mm: p2, axis: axis2, .. }) => {
            let deg = Vector3::from(*axis).angle(&Vector3::from(*axis2)).to_degrees();
            (Vector3::from(*p2) - Vector3::from(*p), deg, None)
        }
        // CL, and the RAPID posted from it: the turn about the tool axis (tip to spindle, −z) is free.
        (Goal::Axis { position_mm: p, axis, .. }, Goal::Pose { position_mm: p2, quat, .. })
        | (Goal::Pose { position_mm: p, quat, .. }, Goal::Axis { position_mm: p2, axis, .. }) => {
            let deg = Vector3::from(*axis).angle(&-(turn(quat) * Vector3::z())).to_degrees();
            (Vector3::from(*p2) - Vector3::from(*p), deg, None)
        }
        (Goal::Joints { deg: a }, Goal::Joints { deg: b }) => {
            let worst = a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            (Vector3::zeros(), worst, None)
        }
        _ => (Vector3::zeros(), 180.0, None),
    }
}

/// mm
fn position(goal: &Goal) -> Option<Vector3<f64>> {
    match goal {
        Goal::Pose { position_mm, .. } | Goal::Axis { position_mm, .. } => Some(Vector3::from(*position_mm)),
        Goal::Joints { .. } => None,
    }
}

/// The settings in which two targets differ.
pub(super) fn settings(first: &Program, a: &Target, second: &Program, b: &Target) -> Vec<&'static str> {
    [
        (a.feed_mm_s != b.feed_mm_s, "the speed"),
        (first.tools[usize::from(a.tool)] != second.tools[usize::from(b.tool)], "the tool"),
        (first.wobjs[usize::from(a.wobj)] != second.wobjs[usize::from(b.wobj)], "the work object"),
        ((a.motion, a.role) != (b.motion, b.role), "the kind of motion"),
        (a.mark != b.mark, "the air or cut mark"),
        (a.external != b.external, "the position of the external axes"),
    ]
    .into_iter()
    .filter_map(|(differs, what)| differs.then_some(what))
    .collect()
}
