//! The error of the tip on the programmed path between targets, by the forward model.
//!
//! At the start of a segment the force of the segment acts, while the command is still that of the target before. In between, the
//! command follows a line or an arc, and the deflection does not. Both errors are solved unless they are surely small: on a segment so
//! short that the joints hardly move, they follow from its ends.

use super::Prepared;
use super::context::JudgedPath;
use super::halved::{Halved, Interval, Tick};
use super::mount::Moved;
use super::point::Point;
use super::segment::{Kind, SMOOTH, Segment, Start};
use super::solve::{Solved, Solver, controller_motor};
use super::travel;
use deflex_drive::Track;
use deflex_equilibrium::{Dragged, EquilibriumError, PredictedPose, WarmStart, direction};
use deflex_program::Program;
use deflex_robot::{Joints, Pose};
use nalgebra::Vector3;
use std::sync::Arc;

/// A jump is over within this length of path, m; shorter segments have none inserted for it.
pub(super) const JUMP_WITHIN: f64 = 0.5e-3;

/// The remaining error on the segment to a target.
///
/// # Examples
/// ```
/// # let (program, cell) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/slot.rs"));
/// # let corrected = deflex_correct::compensate(&program, &cell, &Default::default())?;
/// let longest = corrected.rows.iter().filter_map(|row| row.path).map(|path| path.length_mm).fold(0.0, f64::max);
/// assert!(longest > 0.0); // mm
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PathDeviation {
    /// Largest distance of the tip from the programmed path, mm.
    pub max_mm: f64,
    /// The same without the effect of a jump of the force within half a millimetre of path after it, mm.
    pub way_mm: f64,
    /// Largest distance because of such a jump, where the force sets in, ends or turns at once, mm; 0 without one. No inserted target
    /// can be near enough to correct it.
    pub jump_mm: f64,
    /// Mean of the squared distance over the length, mm².
    pub mean_square_mm2: f64,
    /// Length of the segment, mm; 0 if no path is programmed and only the end is judged.
    pub length_mm: f64,
}

impl PathDeviation {
    /// The deviation of a segment of which only the end is judged: a joint motion, or the one to the first target.
    fn at_end(shift: &Vector3<f64>) -> Self {
        let max_mm = 1e3 * shift.norm();
        Self { max_mm, way_mm: max_mm, jump_mm: 0.0, mean_square_mm2: max_mm * max_mm, length_mm: 0.0 }
    }

    /// This deviation, which changes evenly from `from` to `to` (m), with its jump. `before` is the distance before it, m.
    #[inline]
    fn with_jump(self, before: f64, from: &Vector3<f64>, to: &Vector3<f64>) -> Self {
        let (a, b) = (from.norm_squared(), to.norm_squared());
        if a <= b || a <= before * before {
            return self;
        }
        let over = (1e3 * JUMP_WITHIN / self.length_mm).min(1.0);
        self.judged(before, a.sqrt(), from.lerp(to, over).norm().max(b.sqrt()))
    }

    /// This deviation with the jump separated. The distances, m: before the jump, at most within its length, and at
    /// most after it.
    fn judged(self, before: f64, within: f64, after: f64) -> Self {
        let explained = before.max(after);
        if within <= explained + KNOWN {
            return self;
        }
        Self { way_mm: 1e3 * explained, jump_mm: 1e3 * within, ..self }
    }

    /// The deviation of two consecutive segments.
    pub(super) fn and(self, other: Self) -> Self {
        let length_mm = self.length_mm + other.length_mm;
        let sum = self.mean_square_mm2 * self.length_mm + other.mean_square_mm2 * other.length_mm;
        Self {
            max_mm: self.max_mm.max(other.max_mm),
            way_mm: self.way_mm.max(other.way_mm),
            jump_mm: self.jump_mm.max(other.jump_mm),
            mean_square_mm2: if length_mm > 0.0 {
                sum / length_mm
            } else {
                self.mean_square_mm2.max(other.mean_square_mm2)
            },
            length_mm,
        }
    }
}

/// An intermediate point that is inserted on the segment to a target.
#[derive(Clone, Debug)]
pub(super) struct Node {
    /// Index of the target.
    pub(super) before: usize,
    /// Share of the segment, and the length of the whole segment, m.
    pub(super) share: f64,
    pub(super) length: f64,
    /// The command in the controller's precision.
    pub(super) commanded: Pose,
    /// The circle point of the arc that ends here; `None` for a line.
    pub(super) via: Option<Pose>,
    /// Positions of the units there.
    pub(super) moved: Option<Arc<Moved>>,
}

/// The commands of a program, in columns with one value for each target.
pub(super) struct Commanded {
    /// Commanded poses, work object axes.
    pub(super) poses: Vec<Pose>,
    pub(super) steps: Vec<Dragged>,
    /// Whether the target has a solution.
    pub(super) is_known: Vec<bool>,
    /// Poses where the loaded arm ends up; empty before they are computed.
    pub(super) landed: Vec<Result<PredictedPose, EquilibriumError>>,
    /// Inserted points, in order.
    pub(super) nodes: Vec<Node>,
}

impl Commanded {
    /// The commands of a program as it is.
    pub(super) fn as_programmed(prepared: &Prepared, landed: Vec<Result<PredictedPose, EquilibriumError>>) -> Self {
        let points = &prepared.points;
        Self {
            poses: points.iter().map(|point| point.wobj_from_tcp).collect(),
            steps: points.iter().map(Point::step).collect(),
            is_known: points.iter().map(|point| point.unsolved.is_none()).collect(),
            landed,
            nodes: Vec::new(),
        }
    }

    /// The solved commands before they are written, with their directions of travel.
    pub(super) fn as_solved(
        prepared: &Prepared,
        solved: &[Result<Solved, EquilibriumError>],
        travels: &[Joints],
    ) -> Self {
        let mut commanded = Self::as_programmed(prepared, Vec::new());
        for (i, solved) in solved.iter().enumerate() {
            commanded.is_known[i] = solved.is_ok();
            if let Ok(solved) = solved {
                commanded.poses[i] = solved.wobj_from_tcp;
                commanded.steps[i].motor = solved.motor;
                commanded.steps[i].travel = travels[i];
            }
        }
        commanded
    }

    /// The step to target `i`; `None` if it has no solution.
    pub(super) fn step(&self, i: usize) -> Option<&Dragged> {
        self.is_known[i].then(|| &self.steps[i])
    }
}

/// If the sum of the joint motions between two targets is below this (rad), compliance and posture change by no more than that share, and
/// the errors between follow from both ends.
const SHORT: f64 = 0.01;

/// Largest error of a segment whose deviation is taken from its ends, m.
const KNOWN: f64 = 2e-6;

/// An interval is resolved if the curve through its ends and middle meets its quarters to this, m, or to this share.
const RESOLVED: f64 = 0.5e-6;
const RESOLVED_SHARE: f64 = 0.02;

/// Number of ticks by which positions on a part are counted. An interval that is not resolved is halved down to four ticks, so that jumps
/// inside (a joint that turns back) are found to that accuracy.
const TICKS: Tick = 256;

/// A part of a segment between two commanded points.
struct SegmentPart {
    /// Index into the segments.
    segment: usize,
    /// Index of the node that it ends at; `None` at the target.
    node: Option<usize>,
    /// Shares of the segment at its start and end.
    from: f64,
    to: f64,
    commanded: Track,
    /// The arm at its start.
    start: Dragged,
    /// Motor angles at its end, rad.
    end: Joints,
    /// Travel into the target.
    travel: Joints,
    short: bool,
}

/// Replaces `last`, the end of the targets before, by the end of these targets, where the segment to the next one begins. Returns the
/// former `last`.
pub(super) fn pass_end(
    program: &Program,
    prepared: &Prepared,
    commanded: &Commanded,
    last: &mut Option<Start>,
) -> Option<Start> {
    let walked = WalkedPath { program, prepared, commanded, last: last.as_ref() };
    match (0..prepared.points.len()).rev().find(|i| Kind::of(program, *i) != Kind::Point) {
        Some(end) => {
            let end = walked.start(Some(end));
            std::mem::replace(last, end)
        }
        None => last.clone(),
    }
}

/// The deviations of a program.
pub(super) struct Deviations {
    /// On the segment to every target, from the last node before it if there is one.
    pub(super) targets: Vec<Option<PathDeviation>>,
    /// On the segment to every node.
    pub(super) nodes: Vec<Option<PathDeviation>>,
}

impl Deviations {
    /// The deviation on the whole segment to every target.
    pub(super) fn whole(mut self, nodes: &[Node]) -> Vec<Option<PathDeviation>> {
        for (node, own) in nodes.iter().zip(self.nodes).rev() {
            let behind = &mut self.targets[node.before];
            *behind = match (own, behind.take()) {
                (Some(own), Some(behind)) => Some(own.and(behind)),
                (own, behind) => own.or(behind),
            };
        }
        self.targets
    }
}

/// Computes the deviation on the segment to every target and node, in their order. `near` gives the approximate deflection of the joints
/// at each target, from which the iterations start. Lines and arcs are left open if the driven path is judged.
pub(super) fn measure(
    walked: &WalkedPath<'_>,
    solver: &Solver<'_>,
    near: &Near<'_>,
    judged_path: JudgedPath,
) -> Deviations {
    let WalkedPath { program, commanded, .. } = *walked;
    let count = solver.prepared.points.len();
    let mut out = Deviations { targets: vec![None; count], nodes: vec![None; commanded.nodes.len()] };
    let mut wanted = Vec::new();
    let (mut from, mut before) = (None, walked.last.and_then(|last| last.tangent));
    for i in 0..count {
        let kind = Kind::of(program, i);
        if kind == Kind::Point {
            continue;
        }
        let start = from.replace(i);
        let (Ok(landed), Some(Dragged { motor, .. })) = (&commanded.landed[i], commanded.step(i)) else {
            before = None;
            continue;
        };
        // After a point that is not solved, also in the chunk before, the segment is unknown.
        let is_first = start.is_none() && walked.last.is_none() && solver.prepared.before.is_none();
        if kind == Kind::Joint || is_first {
            out.targets[i] = Some(PathDeviation::at_end(&landed.shift));
            before = None;
            continue;
        }
        if judged_path == JudgedPath::Driven {
            continue;
        }
        match walked.known_from_ends(i, start, motor, &mut before) {
            Some(known) => out.targets[i] = Some(known),
            None => wanted.push((i, start)),
        }
    }
    if !wanted.is_empty() {
        let starts: Vec<(usize, Start)> =
            wanted.iter().filter_map(|(i, from)| Some((*i, walked.start(*from)?))).collect();
        let segments: Vec<(Segment<'_>, &Start)> = starts
            .iter()
            .filter_map(|(i, start)| Some((Segment::into(program, solver.prepared, *i, start)?, start)))
            .collect();
        walked.solve((solver, near), &segments, &mut out);
    }
    out
}

/// The start of the iteration for the equilibrium at a target.
pub(super) type Near<'a> = dyn Fn(usize) -> WarmStart + Sync + 'a;

/// The commanded path of a program.
pub(super) struct WalkedPath<'a> {
    pub(super) program: &'a Program,
    pub(super) prepared: &'a Prepared,
    pub(super) commanded: &'a Commanded,
    /// End of the targets before.
    pub(super) last: Option<&'a Start>,
}

impl WalkedPath<'_> {
    /// The target at which the segment to target `i` begins: one of these, or (`Some(None)`) the end of those before.
    pub(super) fn before(&self, i: usize) -> Option<Option<usize>> {
        let own = (0..i).rev().find(|before| Kind::of(self.program, *before) != Kind::Point);
        own.map(Some).or_else(|| self.last.map(|_| None))
    }

    /// Target `from` as the start of the segment after it; with `None`, the end of the targets before.
    pub(super) fn start(&self, from: Option<usize>) -> Option<Start> {
        let Some(i) = from else { return self.last.cloned() };
        let Dragged { motor, travel, .. } = *self.commanded.step(i)?;
        let setting = *self.prepared.setting(i);
        // The segment that ends at this target: the next one may begin at an angle to its tangent.
        let own = (0..i).rev().find(|before| Kind::of(self.program, *before) != Kind::Point);
        let before = own.map(|own| &self.prepared.points[own]).or(self.last.map(|last| &last.point));
        let before = before.filter(|before| before.setting == self.prepared.points[i].setting);
        let track = before.and_then(|before| Segment::track(self.program, self.prepared, i, &before.reference));
        let tangent = track.and_then(|track| track.tangent(1.0)).map(|along| setting.base_from_wobj.rotation * along);
        let commanded = self.commanded.poses[i];
        let left = self.left_at(i);
        Some(Start { left, point: self.prepared.points[i].clone(), setting, commanded, motor, travel, tangent })
    }

    /// Error of the tip at target `i`, m; 0 if it is unknown.
    fn left_at(&self, i: usize) -> f64 {
        let landed = self.commanded.landed.get(i).and_then(|landed| landed.as_ref().ok());
        landed.map_or(0.0, |landed| landed.shift.norm())
    }

    /// The start of the segment to target `i`, as prepared and as commanded: target `from`, or the end of the targets before. `None` if it is
    /// unknown, or if the segment is not a line in one work object that stands still.
    pub(super) fn line_from(&self, i: usize, from: Option<usize>) -> Option<(&Point, &Pose, &Joints)> {
        let (commanded, point) = (self.commanded, &self.prepared.points[i]);
        let (start, sent, at) = match from {
            Some(from) => (&self.prepared.points[from], &commanded.poses[from], &commanded.step(from)?.motor),
            None => self.last.map(|last| (&last.point, &last.commanded, &last.motor))?,
        };
        let stands = match (&start.moved, &point.moved) {
            (None, None) => true,
            (Some(from), Some(to)) => from.setting == to.setting,
            _ => false,
        };
        let is_line = Kind::of(self.program, i) == Kind::Line && start.setting == point.setting && stands;
        is_line.then_some((start, sent, at))
    }

    /// The deviation on a line so short that compliance and force hardly change along it. At its start the deviation is that at the end plus
    /// the difference of the two commands. `direction` is that of the path before, base axes, and becomes that of this line.
    fn known_from_ends(
        &self,
        i: usize,
        from: Option<usize>,
        motor: &Joints,
        direction: &mut Option<Vector3<f64>>,
    ) -> Option<PathDeviation> {
        let (commanded, point) = (self.commanded, &self.prepared.points[i]);
        let turned = direction.take();
        let (start, sent, at) = self.line_from(i, from)?;
        let chord = point.reference.translation.vector - start.reference.translation.vector;
        let along = chord.try_normalize(travel::CHORD);
        let rotation = &self.prepared.setting(i).base_from_wobj.rotation;
        *direction = along.map(|along| rotation * along).or(turned);
        let moved = travel::moved(at, motor);
        let left = commanded.landed[i].as_ref().ok()?.shift;
        let correction = |sent: &Pose, wanted: &Pose| sent.translation.vector - wanted.translation.vector;
        let (first, here) = (correction(sent, &start.reference), correction(&commanded.poses[i], &point.reference));
        let yields = here.norm() + left.norm();
        let node = commanded.nodes.partition_point(|node| node.before < i);
        let split = commanded.nodes.get(node).is_some_and(|node| node.before == i);
        if moved > SHORT || moved * yields > KNOWN || split {
            return None;
        }
        let Some(along) = along else { return Some(PathDeviation::at_end(&left)) };
        let before = match from {
            Some(from) => self.left_at(from),
            None => self.last.map_or(0.0, |last| last.left),
        };
        let smooth = turned.zip(*direction).is_some_and(|(turned, now)| turned.dot(&now) > SMOOTH);
        let across = |shift: Vector3<f64>, behind: f64| shift - along * along.dot(&shift).max(behind);
        let behind = if smooth { f64::NEG_INFINITY } else { 0.0 };
        let [from, to] = [across(left + first - here, behind), across(left, f64::NEG_INFINITY)];
        Some(linear(&from, &to, chord.norm()).with_jump(before, &from, &to))
    }

    /// Divides segments into parts at their nodes, and computes the deviation on each part.
    fn solve(
        &self,
        (solver, near): (&Solver<'_>, &Near<'_>),
        segments: &[(Segment<'_>, &Start)],
        out: &mut Deviations,
    ) {
        let mut parts = Vec::new();
        for (at, (segment, start)) in segments.iter().enumerate() {
            self.parts(solver, (at, segment), start, &mut parts);
        }
        let measured = Measure { walked: self, solver, near, segments, parts: &parts }.all();
        for (part, measured) in parts.iter().zip(measured) {
            match part.node {
                Some(node) => out.nodes[node] = measured,
                None => out.targets[segments[part.segment].0.end] = measured,
            }
        }
    }

    fn parts(
        &self,
        solver: &Solver<'_>,
        (at, segment): (usize, &Segment<'_>),
        start: &Start,
        parts: &mut Vec<SegmentPart>,
    ) {
        let (i, commanded) = (segment.end, self.commanded);
        let arc_turn = self.prepared.points[i].arc_turn;
        let Some(begins) = start.seen(&start.commanded, self.prepared, i) else { return };
        let Some(&Dragged { motor, travel, twist }) = commanded.step(i) else { return };
        let first = commanded.nodes.partition_point(|node| node.before < i);
        let nodes = commanded.nodes[first..].iter().take_while(|node| node.before == i);
        let (mut share, mut pose) = (0.0, begins);
        let mut from = start.dragged();
        for (k, node) in nodes.enumerate() {
            let track = match &node.via {
                Some(via) => Track::arc(&pose, via, &node.commanded, arc_turn),
                None => Track::line(&pose, &node.commanded),
            };
            let setting = segment.setting(node.share);
            let to = controller_motor(&solver.arm.robot, &setting, &node.commanded, &from.motor).unwrap_or(from.motor);
            let node_at = Some(first + k);
            parts.push(SegmentPart {
                node: node_at,
                ..SegmentPart::new(at, (share, node.share), track, (from, to), travel)
            });
            from = Dragged { motor: to, twist, travel: solver.arm.travel(&from, &to, &twist) };
            (share, pose) = (node.share, node.commanded);
        }
        let to = commanded.poses[i];
        let track = match Kind::of(self.program, i) {
            Kind::Arc => Track::arc(&pose, &commanded.poses[i - 1], &to, arc_turn),
            _ => Track::line(&pose, &to),
        };
        parts.push(SegmentPart::new(at, (share, 1.0), track, (from, motor), travel));
    }
}

impl SegmentPart {
    fn new(
        segment: usize,
        (from, to): (f64, f64),
        commanded: Track,
        (start, end): (Dragged, Joints),
        travel: Joints,
    ) -> Self {
        let short = travel::moved(&start.motor, &end) < SHORT && !commanded.is_arc();
        Self { segment, node: None, from, to, commanded, start, end, travel, short }
    }

    /// Share of the segment at a tick.
    fn share(&self, tick: Tick) -> f64 {
        self.from + f64::from(tick) / f64::from(TICKS) * (self.to - self.from)
    }
}

/// Deviations on parts, computed in rounds: everything that a round needs is solved at once.
struct Measure<'a, 's, 'p> {
    walked: &'a WalkedPath<'a>,
    solver: &'a Solver<'s>,
    near: &'a Near<'a>,
    segments: &'a [(Segment<'p>, &'p Start)],
    parts: &'a [SegmentPart],
}

/// The results for a part: deviations across the programmed path by ticks, m; `None` where there is no equilibrium.
type Known = Halved<Vector3<f64>>;

impl<'p> Measure<'_, '_, 'p> {
    /// The segment of a part.
    fn segment(&self, part: &SegmentPart) -> &Segment<'p> {
        &self.segments[part.segment].0
    }

    /// The deviation of each part.
    fn all(&self) -> Vec<Option<PathDeviation>> {
        let mut known: Vec<Known> = self.parts.iter().map(|part| self.begin(part)).collect();
        loop {
            let wanted: Vec<(usize, Tick)> = known
                .iter()
                .enumerate()
                .flat_map(|(at, known)| known.wanted().into_iter().map(move |tick| (at, tick)))
                .collect();
            if wanted.is_empty() {
                break;
            }
            for ((at, tick), off) in wanted.iter().zip(self.deviations(&wanted)) {
                known[*at].values.insert(*tick, off);
            }
            known.iter_mut().for_each(|known| known.judge(is_resolved));
        }
        self.parts.iter().zip(&known).map(|(part, known)| self.result(part, known)).collect()
    }

    fn begin(&self, part: &SegmentPart) -> Known {
        let mut known = Known::new(TICKS);
        let segment = self.segment(part);
        let landed = self.walked.commanded.landed[segment.end].as_ref().ok();
        // At the end of a line the force is that at the target itself.
        if let Some(landed) = landed.filter(|_| part.to >= 1.0 && !segment.track.is_arc()) {
            known.values.insert(TICKS, Some(segment.track.across(1.0, &landed.shift)));
        }
        if part.short {
            known.done.append(&mut known.open);
        }
        known
    }

    /// Errors of the tip at ticks of parts, m.
    fn deviations(&self, wanted: &[(usize, Tick)]) -> Vec<Option<Vector3<f64>>> {
        let prepared = self.solver.prepared;
        let points = self.solver.parallelism.map(wanted.len(), |k| {
            let (part, tick) = (&self.parts[wanted[k].0], wanted[k].1);
            self.point(part, tick)
        });
        let reached: Vec<bool> = points.iter().map(Option::is_some).collect();
        // A point out of reach is replaced by another, whose result is not used.
        let points = points.into_iter().zip(wanted).map(|(point, (part, _))| {
            point.unwrap_or_else(|| prepared.points[self.segment(&self.parts[*part]).end].clone())
        });
        let batch = prepared.with_points(points.collect());
        let solver = Solver::new(self.solver.arm, &batch, self.solver.parallelism);
        let near = |k: usize| (self.near)(self.segment(&self.parts[wanted[k].0]).end);
        let landed = solver.forward(|k| batch.points[k].as_programmed(), near);
        let off = |k: usize| {
            let (part, tick) = (&self.parts[wanted[k].0], wanted[k].1);
            let (segment, share) = (self.segment(part), part.share(tick));
            let shift = landed[k].as_ref().ok().filter(|_| reached[k])?.shift;
            let begins = segment.corner && tick == 0 && part.from <= 0.0;
            Some(if begins { segment.track.across_start(&shift) } else { segment.track.across(share, &shift) })
        };
        (0..wanted.len()).map(off).collect()
    }

    /// The point at a tick of a part.
    fn point(&self, part: &SegmentPart, tick: Tick) -> Option<Point> {
        let segment = self.segment(part);
        let arm = self.solver.arm;
        let at = |tick: f64| {
            let share = tick / f64::from(TICKS);
            let near = part.start.motor + (part.end - part.start.motor) * share;
            let pose = part.commanded.pose(share);
            let setting = segment.setting(part.from + share * (part.to - part.from));
            Some((pose, controller_motor(&arm.robot, &setting, &pose, &near)?))
        };
        let (commanded, motor) = match tick {
            0 => (part.commanded.pose(0.0), part.start.motor),
            TICKS => (part.commanded.pose(1.0), part.end),
            _ => at(f64::from(tick))?,
        };
        let mut point = segment.at(part.share(tick));
        (point.wobj_from_tcp, point.motor) = (commanded, motor);
        point.travel = if !arm.presliding().is_sharp() {
            arm.travel(&part.start, &motor, &point.twist())
        } else if part.short {
            part.travel
        } else if tick == 0 {
            direction(&motor, &at(1.0)?.1, &part.travel)
        } else {
            direction(&at(f64::from(tick) - 1.0)?.1, &motor, &part.travel)
        };
        Some(point)
    }

    fn result(&self, part: &SegmentPart, known: &Known) -> Option<PathDeviation> {
        let length = (part.to - part.from) * self.segment(part).track.length();
        // The error before the part: a jump is what comes in addition.
        let before = match part.from <= 0.0 {
            true => self.segments[part.segment].1.left,
            false => known.at(0).map_or(0.0, |off| off.norm()),
        };
        if part.short {
            let [from, to] = [known.at(0)?, known.at(TICKS)?];
            return Some(linear(&from, &to, length).with_jump(before, &from, &to));
        }
        let mut all: Option<PathDeviation> = None;
        for &interval in &known.done {
            let share = f64::from(interval.to - interval.from) / f64::from(TICKS);
            let here = resolved(known.five(interval)?, length * share);
            all = Some(all.map_or(here, |all| all.and(here)));
        }
        let all = all?;
        Some(if part.from <= 0.0 || length <= JUMP_WITHIN { with_jump(known, all, before, length) } else { all })
    }
}

/// The deviation on the part, with the jump in the first [`JUMP_WITHIN`] of its length (m) separated from the rest. `before` is the error
/// before the part, m.
fn with_jump(known: &Known, all: PathDeviation, before: f64, length: f64) -> PathDeviation {
    let over = (JUMP_WITHIN / length).min(1.0) * f64::from(TICKS);
    let known = known.values.iter().filter_map(|(tick, off)| Some((f64::from(*tick), (*off)?)));
    let (within, after): (Vec<_>, Vec<_>) = known.partition(|(tick, _)| *tick < over);
    let (Some((from, first)), Some((to, second))) = (within.last(), after.first()) else { return all };
    let at_end = first.lerp(second, (over - from) / (to - from)).norm();
    let most = |off: &[(f64, Vector3<f64>)]| off.iter().map(|(_, off)| off.norm()).fold(0.0, f64::max);
    all.judged(before, most(&within), at_end.max(most(&after)))
}

/// Whether the quarters of an interval are on the curve through its ends and its middle, or it is too short to be halved.
fn is_resolved(interval: Interval, [a, b, c, d, e]: [Vector3<f64>; 5]) -> bool {
    let misses = [b - (a * 3.0 + c * 6.0 - e) / 8.0, d - (e * 3.0 + c * 6.0 - a) / 8.0];
    let most = [a, b, c, d, e].iter().map(Vector3::norm).fold(0.0, f64::max);
    interval.quarter() <= 1 || misses.iter().all(|miss| miss.norm() <= RESOLVED.max(RESOLVED_SHARE * most))
}

/// The deviation from five errors (m) at even distances along a length (m).
fn resolved(off: [Vector3<f64>; 5], length: f64) -> PathDeviation {
    let squares = off.map(|off| off.norm_squared());
    // A parabola through three of them: its values halfway.
    let [a, b, c, d, e] = off;
    let between = [
        (a * 3.0 + b * 6.0 - c) / 8.0,
        (c * 3.0 + b * 6.0 - a) / 8.0,
        (c * 3.0 + d * 6.0 - e) / 8.0,
        (e * 3.0 + d * 6.0 - c) / 8.0,
    ];
    let most = squares.into_iter().chain(between.map(|off| off.norm_squared())).fold(0.0, f64::max);
    // Boole's rule.
    let mean =
        [7.0, 32.0, 12.0, 32.0, 7.0].iter().zip(squares).map(|(weight, square)| weight * square).sum::<f64>() / 90.0;
    let max_mm = 1e3 * most.sqrt();
    PathDeviation { max_mm, way_mm: max_mm, jump_mm: 0.0, mean_square_mm2: 1e6 * mean, length_mm: 1e3 * length }
}

/// The deviation of an error that changes evenly from one end to the other (m), along a length (m).
fn linear(from: &Vector3<f64>, to: &Vector3<f64>, length: f64) -> PathDeviation {
    let (a, b) = (from.norm_squared(), to.norm_squared());
    let max_mm = 1e3 * a.max(b).sqrt();
    PathDeviation {
        max_mm,
        way_mm: max_mm,
        jump_mm: 0.0,
        mean_square_mm2: 1e6 * (a + from.dot(to) + b) / 3.0,
        length_mm: 1e3 * length,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// The deviation of an error from `from` to `to` along a length (m), with the error `before` before it.
    fn judged(before: f64, from: f64, to: f64, length: f64) -> [f64; 3] {
        let [from, to] = [from, to].map(|off| Vector3::new(0.0, off, 0.0));
        let judged = linear(&from, &to, length).with_jump(before, &from, &to);
        [judged.max_mm, judged.way_mm, judged.jump_mm]
    }

    #[test]
    #[allow(clippy::float_cmp)] // numbers that are printed or given, to the bit
    fn a_jump_is_the_error_beyond_that_before_and_after_it() {
        // The force goes on: nothing jumps, however short the segment.
        assert_eq!(judged(3e-4, 3e-4, 2e-4, 2e-4), [0.3, 0.3, 0.0]);
        assert_eq!(judged(0.0, 1e-4, 2e-4, 2e-4), [0.2, 0.2, 0.0]);
        // It sets in: within half a millimetre that is a jump, farther on it is part of the segment.
        assert_eq!(judged(0.0, 3e-4, 1e-5, 2e-4), [0.3, 0.01, 0.3]);
        let [most, left, jump] = judged(0.0, 3e-4, 0.0, 1e-2);
        assert_eq!((most, jump), (0.3, 0.3));
        assert_relative_eq!(left, 0.3 * 0.95, max_relative = 1e-12);
        // The error before the jump is not part of it.
        assert_eq!(judged(2e-4, 3e-4, 0.0, 2e-4), [0.3, 0.2, 0.3]);
    }
}
