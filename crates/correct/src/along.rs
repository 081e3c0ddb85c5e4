//! Checks the arm between targets: axis limits, reach, singular postures and axis speeds anywhere on a linear or circular segment, not
//! only at its end.
//!
//! This is branch and bound over the share of the segment. The length and the turn of a piece, and the distance of the arm from its
//! singular postures, bound the motion of each axis on the piece ([`Robot::excursion`]). A piece whose ends keep their limits by more
//! than that is settled; any other is halved. Anything unseen is below [`UNSEEN`], for any length of the segment. Most segments of a
//! dense program are settled by the angles at their ends.

use super::deviation::WalkedPath;
use super::mount::is_entered_elsewhere;
use super::segment::{Kind, Segment};
use super::travel::moved;
use deflex_drive::Track;
use deflex_equilibrium::{Dragged, Setting};
use deflex_program::Program;
use deflex_robot::{Excursion, Joints, LimitedAngle, Pose, Robot, Unreachable, turn_between};
use deflex_text::{Diagnostic, Severity};
use std::f64::consts::PI;

/// An axis limit that is exceeded by less than this between two computed points is not seen, rad: a hundredth of a degree, less than arms
/// repeat.
const UNSEEN: f64 = 0.01 * PI / 180.0;

/// An axis speed above its limit by less than this share is not seen: makers round theirs to 1 %.
const UNSEEN_SPEED: f64 = 0.01;

/// Closer to a singular posture than this, rad, controllers stop or slow down: KUKA within 0.018°, ABB within some tenths of a
/// degree, FANUC within about one.
const SINGULAR: f64 = PI / 180.0;

/// With the wrist centre closer than this to axis 1, m, the arm is in a singular posture. It is the arc of one degree at a radius of half a
/// metre.
const SINGULAR_SHOULDER: f64 = 0.01;

/// Largest speed of the orientation, rad/s: that of ABB's predefined speeddata (500°/s); other makers have smaller ones.
const ORIENTATION_SPEED: f64 = 500.0 * PI / 180.0;

/// Pieces of a segment that turn by more than this, or move a unit by more (rad, m), are halved before they are bounded.
const STRAIGHT: f64 = 0.1;

/// A piece is not halved below this share of its segment: a flip of the wrist within it has no meaningful speed.
const SHORTEST: f64 = 1e-6;

/// A posture within this share of the sufficient distance from a singular one counts as singular itself.
const IN_IT: f64 = 0.02;

/// Number of parts in which a long segment is followed from its start.
const PARTS: u16 = 32;

/// Most pieces of one segment: many more than any regular segment needs.
const MOST_PIECES: usize = 20_000;

/// Speeds this many times their limit are not examined more closely.
const FAR_TOO_FAST: f64 = 10.0;

/// A kind of fault on the segment to a target.
///
/// # Examples
/// ```
/// use deflex_correct::WayFault;
///
/// assert_eq!(WayFault::AxisLimit.code(), "axis-limit");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum WayFault {
    /// An axis is beyond its limit, degrees.
    AxisLimit,
    /// An axis would have to turn faster than it can, degrees a second.
    AxisSpeed,
    /// Two axes line up, or the arm is stretched: degrees from that posture; the wrist centre is over axis 1: mm from there.
    Singular,
    /// The arm does not reach the path: mm that are missing.
    Unreachable,
}

impl WayFault {
    const ALL: [Self; 4] = [Self::AxisLimit, Self::AxisSpeed, Self::Singular, Self::Unreachable];

    /// Whether a message has the code of one of these.
    #[must_use]
    #[doc(hidden)]
    pub fn is_code(code: &str) -> bool {
        Self::ALL.iter().any(|fault| fault.code() == code)
    }

    /// Its name in findings.
    #[must_use]
    pub fn code(self) -> &'static str {
        match self {
            Self::AxisLimit => "axis-limit",
            Self::AxisSpeed => "axis-speed",
            Self::Singular => "singular",
            Self::Unreachable => "unreachable",
        }
    }
}

/// The worst fault of a kind on the segment to a target.
///
/// # Examples
/// ```
/// # let (program, cell) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/slot.rs"));
/// # let corrected = deflex_correct::compensate(&program, &cell, &Default::default())?;
/// for finding in &corrected.on_the_way {
///     println!("{} at target {}", finding.fault.code(), finding.index);
/// }
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct WayFinding {
    /// What is wrong.
    pub fault: WayFault,
    /// Index of the target in the program.
    pub index: usize,
    /// Share of the segment to it.
    pub share: f64,
    /// The angle that is at fault; `None` if the path is out of reach.
    pub angle: Option<LimitedAngle>,
    /// In the unit of the fault.
    pub value: f64,
    /// The limit that it exceeds.
    pub limit: f64,
}

impl WayFinding {
    /// The finding as a message at its line.
    #[must_use]
    #[doc(hidden)]
    pub fn diagnostic(&self, program: &Program) -> Diagnostic {
        let target = &program.targets[self.index];
        let message = format!("target {}: {}", target.ordinal, self.text());
        let help = match self.fault {
            WayFault::AxisLimit => {
                "turn the tool about its axis, move the part, or add targets that lead the arm round"
            }
            WayFault::AxisSpeed => "lower the feed here, or lead the tool past the singular posture",
            WayFault::Singular => "lead the tool past it: turn or lean it, or move the part",
            WayFault::Unreachable => "move the part, or shorten the path",
        };
        // As docs/reference.md numbers the angles for scripts.
        let axis = match self.angle {
            None => 0.0,
            Some(LimitedAngle::Axis(axis)) => axis as f64,
            Some(LimitedAngle::ElbowDifference) => 7.0,
            Some(LimitedAngle::ElbowSum) => 8.0,
        };
        let figures = vec![
            ("target", f64::from(target.ordinal)),
            ("share", self.share),
            ("axis", axis),
            ("value", self.value),
            ("limit", self.limit),
        ];
        Diagnostic { figures, ..program.error_at(target, self.fault.code(), message).help(help) }
    }

    /// The same as a warning; the first one stands for all.
    pub(super) fn warning(&self, program: &Program) -> Diagnostic {
        let target = &program.targets[self.index];
        let message = match self.fault {
            WayFault::AxisLimit => "an axis passes its limit on the path to a target",
            WayFault::AxisSpeed => "an axis would have to turn faster than it can on the path to a target",
            WayFault::Singular => "the arm comes to a singular posture on the path to a target",
            WayFault::Unreachable => "the path between two targets is out of the arm's reach",
        };
        let help = format!("target {}: {}; `deflex check` lists all of them", target.ordinal, self.text());
        program.error_at(target, self.fault.code(), message).help(help).severity(Severity::Warning)
    }

    pub(super) fn text(&self) -> String {
        let Self { fault, share, angle, value, limit, .. } = self;
        let place = match share {
            share if *share >= 1.0 => "at the target".to_owned(),
            share => format!("after {:.1} % of the path to it", 100.0 * share),
        };
        let axis = angle.map_or_else(String::new, |angle| angle.to_string());
        match fault {
            WayFault::AxisLimit => format!("{place} {axis} is at {value:.2}°, and its limit is {limit:.2}°"),
            WayFault::AxisSpeed => {
                format!(
                    "{place} {axis} would turn at {value:.0}°/s at the programmed feed, and its limit is {limit:.0}°/s"
                )
            }
            WayFault::Singular if *angle == Some(LimitedAngle::Axis(1)) => {
                format!(
                    "{place} the wrist centre is {value:.1} mm from axis 1, where the angle of axis 1 is not defined"
                )
            }
            WayFault::Singular => format!("{place} {axis} is {value:.2}° from a singular posture"),
            WayFault::Unreachable => format!("{place} the path is {value:.2} mm out of reach"),
        }
    }
}

/// A segment that the arm follows.
pub(super) struct FollowedSegment<'a> {
    /// Index of the target that it ends at.
    pub(super) index: usize,
    pub(super) robot: &'a Robot,
    /// The commanded curve, in the work object.
    pub(super) track: Track,
    /// The setting at a share of the segment.
    pub(super) setting: &'a dyn Fn(f64) -> Setting,
    /// Motor angles at its ends, rad.
    pub(super) motors: [Joints; 2],
    /// Programmed speed of the TCP, mm/s.
    pub(super) feed_mm_s: Option<f64>,
}

/// The worst fault of each kind.
#[derive(Clone, Copy, Debug, Default)]
struct Worst {
    /// Largest excess over an axis limit, rad, and the finding.
    limit: Option<(f64, WayFinding)>,
    /// Speed over its limit.
    speed: Option<(f64, WayFinding)>,
    /// Distance from a singular posture over the sufficient distance.
    singular: Option<(f64, WayFinding)>,
    unreachable: Option<WayFinding>,
}

impl Worst {
    /// Adds a point that is out of reach.
    fn miss(&mut self, index: usize, share: f64, unreachable: Unreachable) {
        let value = match unreachable {
            Unreachable::OutOfReach { by_mm } => by_mm,
            Unreachable::NotConverged { left_mm } => left_mm,
            Unreachable::Limit(_) => 0.0,
        };
        if self.unreachable.is_none_or(|known| value > known.value) {
            let fault = WayFault::Unreachable;
            self.unreachable = Some(WayFinding { fault, index, share, angle: None, value, limit: 0.0 });
        }
    }
}

/// A piece of a segment: upper bounds of its length (m) and turn (rad) in the base, its duration (s), the distance of the TCP from the
/// wrist centre (m), and the motor angles at its ends, rad.
struct Piece<'m> {
    length: f64,
    turn: f64,
    time: Option<f64>,
    lever: f64,
    motors: [&'m Joints; 2],
}

impl Piece<'_> {
    /// Whether nothing worse than the known faults can be on it.
    fn is_settled(&self, robot: &Robot, worst: &Worst) -> bool {
        let [from, to] = self.motors;
        let Some(Excursion { axes, clearance, left, bend }) =
            robot.excursion(from, self.length + self.lever * self.turn, self.turn)
        else {
            return false;
        };
        let known = worst.limit.map_or(0.0, |(by, _)| by);
        let over = robot.limit_excess(from, &axes);
        if over > known + UNSEEN {
            return false;
        }
        let known = worst.singular.map_or(1.0, |(share, _)| share);
        let least = (left[0] / SINGULAR).min(left[1] / SINGULAR).min(left[2] / SINGULAR_SHOULDER);
        let here = (clearance[0] / SINGULAR).min(clearance[1] / SINGULAR).min(clearance[2] / SINGULAR_SHOULDER);
        if least < known && here - least > UNSEEN / SINGULAR {
            return false;
        }
        let (Some(speed), Some(time)) = (&robot.axis_speed, self.time) else { return true };
        let known = worst.speed.map_or(1.0, |(ratio, _)| ratio);
        known >= FAR_TOO_FAST
            || (0..6).all(|i| {
                let most = (to[i] - from[i]).abs() + bend * axes[i];
                // Both bounds are valid.
                most.min(axes[i]) <= speed[i] * time * known * (1.0 + UNSEEN_SPEED)
            })
    }
}

/// A stretch of path, many pieces long, that is far from axis limits and singular postures: only the speed of an axis can be wrong on it.
/// Finding the stretch takes sines and cosines; the pieces on it take none.
#[derive(Default)]
struct Calm {
    /// Length (m) and turn (rad) of the stretch.
    size: [f64; 2],
    /// See [`Excursion`], from the start of the stretch.
    axes: [f64; 6],
    bend: f64,
    /// Remaining share of it.
    left: f64,
}

impl Calm {
    /// Length of a stretch over that of its first piece: for longer ones the bounds would be loose.
    const PIECES: f64 = 32.0;

    /// Whether nothing can be wrong on the next piece; false if that needs a closer look.
    fn covers(&mut self, piece: &Piece<'_>, robot: &Robot) -> bool {
        let size = [piece.length + piece.lever * piece.turn, piece.turn];
        let share = |calm: &Self| (size[0] / calm.size[0]).max(size[1] / calm.size[1]);
        // False if neither has a size.
        let fits = |calm: &Self| share(calm) <= calm.left;
        if !fits(self) {
            *self = Self::from(piece.motors[0], size.map(|size| Self::PIECES * size), robot).unwrap_or_default();
        }
        if !fits(self) {
            return false;
        }
        let share = share(self);
        self.left -= share;
        let (Some(speed), Some(time)) = (&robot.axis_speed, piece.time) else { return true };
        let [from, to] = piece.motors;
        (0..6).all(|i| {
            // Bounds decrease with the share, and so do differences of speed.
            let most = share * self.axes[i];
            (to[i] - from[i]).abs() + share * self.bend * most <= speed[i] * time
        })
    }

    /// A stretch of a length (m) and a turn (rad) from motor angles (rad); `None` if it is not calm.
    fn from(motor: &Joints, size: [f64; 2], robot: &Robot) -> Option<Self> {
        let Excursion { axes, left, bend, .. } = robot.excursion(motor, size[0], size[1])?;
        let is_calm = robot.limit_excess(motor, &axes) <= 0.0
            && left[0] >= SINGULAR
            && left[1] >= SINGULAR
            && left[2] >= SINGULAR_SHOULDER;
        is_calm.then_some(Self { size, axes, bend, left: 1.0 })
    }
}

impl FollowedSegment<'_> {
    /// The worst fault of each kind on the segment.
    pub(super) fn faults(&self) -> Vec<WayFinding> {
        let index = self.index;
        let mut worst = Worst::default();
        let ends = [0.0, 1.0].map(|share| self.base_from_tcp(share));
        let (bend, branch) = (self.bend(), self.robot.branch(&self.motors[0]));
        let there = |share: f64, near: &Joints| {
            self.robot.inverse_in(branch, &(self.setting)(share).base_from_flange(&self.track.pose(share)), near)
        };
        // On a segment the arm keeps its branch, even beyond limits.
        let mut open = Vec::new();
        let whole = self.piece((1.0, bend), &self.motors, &ends);
        let [from, to] = &self.motors;
        let is_short = whole.turn < STRAIGHT && bend < STRAIGHT && (to - from).amax() < 1.0;
        if is_short && self.robot.branch(to) == branch {
            self.look(&mut worst, 1.0, to);
            open.push(([0.0, 1.0], self.motors, ends));
        } else {
            // Follows the segment from its start: axes may turn by more than half a turn.
            let mut last = Some((0.0, self.motors[0], ends[0]));
            let mut near = self.motors[0];
            for part in 1..=PARTS {
                let share = f64::from(part) / f64::from(PARTS);
                match there(share, &near) {
                    Ok(motor) => {
                        self.look(&mut worst, share, &motor);
                        let here = (share, motor, self.base_from_tcp(share));
                        if let Some((from, before, start)) = last {
                            open.push(([from, share], [before, motor], [start, here.2]));
                        }
                        (last, near) = (Some(here), motor);
                    }
                    Err(unreachable) => {
                        worst.miss(index, share, unreachable);
                        last = None;
                    }
                }
            }
            open.reverse();
        }
        for _ in 0..MOST_PIECES {
            let Some((shares, motors, ends)) = open.pop() else { break };
            let span = shares[1] - shares[0];
            let piece = self.piece((span, bend), &motors, &ends);
            if let (Some(speeds), Some(time)) = (&self.robot.axis_speed, piece.time) {
                for i in 0..6 {
                    let speed = (motors[1][i] - motors[0][i]).abs() / time;
                    let ratio = speed / speeds[i];
                    if ratio > 1.0 + 1e-9 && worst.speed.is_none_or(|(known, _)| ratio > known) {
                        let (value, limit) = (speed.to_degrees(), speeds[i].to_degrees());
                        let share = 0.5 * (shares[0] + shares[1]);
                        let (fault, angle) = (WayFault::AxisSpeed, Some(LimitedAngle::Axis(i + 1)));
                        worst.speed = Some((ratio, WayFinding { fault, index, share, angle, value, limit }));
                    }
                }
            }
            let is_straight = piece.turn < STRAIGHT && span * bend < STRAIGHT;
            if span < SHORTEST
                || (is_straight && piece.is_settled(self.robot, &worst))
                || self.is_all_singular(&motors, &worst)
            {
                continue;
            }
            let middle = 0.5 * (shares[0] + shares[1]);
            match there(middle, &(0.5 * (motors[0] + motors[1]))) {
                Ok(motor) => {
                    self.look(&mut worst, middle, &motor);
                    let there = self.base_from_tcp(middle);
                    open.push(([middle, shares[1]], [motor, motors[1]], [there, ends[1]]));
                    open.push(([shares[0], middle], [motors[0], motor], [ends[0], there]));
                }
                Err(unreachable) => worst.miss(index, middle, unreachable),
            }
        }
        let Worst { limit, speed, singular, unreachable } = worst;
        let all = [limit.map(|(_, fault)| fault), speed.map(|(_, fault)| fault), singular.map(|(_, fault)| fault)];
        all.into_iter().chain([unreachable]).flatten().collect()
    }

    /// The TCP in the base.
    fn base_from_tcp(&self, share: f64) -> Pose {
        let setting = (self.setting)(share);
        let flange = setting.base_from_flange(&self.track.pose(share));
        if setting.held { flange } else { flange * setting.tool.flange_from_tcp }
    }

    /// A measure of how much the whole segment differs from a straight line in the base: the angle of an arc, and the motion of its work
    /// object (rad, m).
    fn bend(&self) -> f64 {
        let [from, to] = [0.0, 1.0].map(|share| (self.setting)(share));
        let (a, b) = (&from.base_from_wobj, &to.base_from_wobj);
        let moved = if a == b {
            0.0
        } else {
            (a.translation.vector - b.translation.vector).norm() + turn_between(&a.rotation, &b.rotation).norm()
        };
        self.track.angle() + moved + if from.held { self.track.turn() } else { 0.0 }
    }

    /// Whether the arm stays in a singular posture that is known: no bound is valid there, and no fault is added.
    fn is_all_singular(&self, motors: &[Joints; 2], worst: &Worst) -> bool {
        let in_it = |motor: &Joints| {
            let [wrist, elbow, shoulder] = self.robot.clearance(motor).unwrap_or([f64::INFINITY; 3]);
            wrist < IN_IT * SINGULAR || elbow < IN_IT * SINGULAR || shoulder < IN_IT * SINGULAR_SHOULDER
        };
        worst.singular.is_some_and(|(share, _)| share < IN_IT) && motors.iter().all(in_it)
    }

    fn piece<'m>(&self, (span, bend): (f64, f64), motors: &'m [Joints; 2], ends: &[Pose; 2]) -> Piece<'m> {
        /// Upper bound of the length over the chord for a piece that bends by [`STRAIGHT`].
        const LONGER: f64 = 1.05;
        let setting = (self.setting)(1.0);
        let longer = if bend > 0.0 { LONGER } else { 1.0 };
        let length = longer * (ends[1].translation.vector - ends[0].translation.vector).norm();
        // On an arc the orientation may turn the longer way.
        let turn = (longer * turn_between(&ends[0].rotation, &ends[1].rotation).norm()).max(span * self.track.turn());
        let lever = if setting.held { 0.0 } else { setting.tool.flange_from_tcp.translation.vector.norm() };
        let time = time(span * self.track.length(), span * self.track.turn(), self.feed_mm_s);
        Piece { length, turn, time, lever: lever + self.robot.wrist_lever(), motors: [&motors[0], &motors[1]] }
    }

    /// Examines one point.
    fn look(&self, worst: &mut Worst, share: f64, motor: &Joints) {
        if let Some(violation) = self.robot.limit_violation(motor) {
            let by = violation.by_deg.to_radians();
            if worst.limit.is_none_or(|(known, _)| by > known) {
                let (angle, value, limit) = (Some(violation.angle), violation.value_deg, violation.limit_deg);
                let fault = WayFault::AxisLimit;
                worst.limit = Some((by, WayFinding { fault, index: self.index, share, angle, value, limit }));
            }
        }
        let Some([wrist, elbow, shoulder]) = self.robot.clearance(motor) else { return };
        let kinds = [
            (5, wrist / SINGULAR, wrist.to_degrees(), SINGULAR.to_degrees()),
            (3, elbow / SINGULAR, elbow.to_degrees(), SINGULAR.to_degrees()),
            (1, shoulder / SINGULAR_SHOULDER, 1e3 * shoulder, 1e3 * SINGULAR_SHOULDER),
        ];
        for (axis, part, value, limit) in kinds {
            if part < 1.0 && worst.singular.is_none_or(|(known, _)| part < known) {
                let (fault, angle) = (WayFault::Singular, Some(LimitedAngle::Axis(axis)));
                worst.singular = Some((part, WayFinding { fault, index: self.index, share, angle, value, limit }));
            }
        }
    }
}

/// Duration of a piece with a length (m) and a turn (rad), s; `None` if its feed is unknown, or it has neither.
fn time(length: f64, turn: f64, feed_mm_s: Option<f64>) -> Option<f64> {
    let feed = 1e-3 * feed_mm_s.filter(|feed| *feed > 0.0)?;
    let time = (length / feed).max(turn / ORIENTATION_SPEED);
    (time > 0.0).then_some(time)
}

/// The faults on the segments to a program's targets, as commanded.
pub(super) fn look(walked: &WalkedPath<'_>, robot: &Robot) -> Vec<WayFinding> {
    let (mut out, mut from, mut calm) = (Vec::new(), None, Calm::default());
    for (i, target) in walked.program.targets.iter().enumerate() {
        let kind = Kind::of(walked.program, i);
        if kind == Kind::Point {
            continue;
        }
        let before = from.replace(i);
        let step = walked.commanded.step(i).filter(|_| kind != Kind::Joint && !is_entered_elsewhere(target));
        let Some(Dragged { motor, .. }) = step else {
            calm = Calm::default();
            continue;
        };
        if !is_clear(walked, i, (before, motor), robot, &mut calm) {
            calm = Calm::default();
            out.extend(faults(walked, i, before, motor, robot).unwrap_or_default());
        }
    }
    out
}

/// Whether the angles at both ends of a line show that nothing can be wrong on it.
fn is_clear(
    walked: &WalkedPath<'_>,
    i: usize,
    (before, motor): (Option<usize>, &Joints),
    robot: &Robot,
    calm: &mut Calm,
) -> bool {
    let setting = walked.prepared.setting(i);
    let Some((_, sent, at)) = walked.line_from(i, before).filter(|_| !setting.held) else { return false };
    let length = (walked.commanded.poses[i].translation.vector - sent.translation.vector).norm();
    // No more than all joints together.
    let turn = moved(at, motor);
    let lever = setting.tool.flange_from_tcp.translation.vector.norm() + robot.wrist_lever();
    let time = time(length, 0.0, walked.program.targets[i].feed_mm_s);
    let piece = Piece { length, turn, time, lever, motors: [at, motor] };
    turn < STRAIGHT
        && (time.is_some() || robot.axis_speed.is_none() || walked.program.targets[i].feed_mm_s.is_none())
        && (calm.covers(&piece, robot) || piece.is_settled(robot, &Worst::default()))
}

/// The faults on the segment to one target.
fn faults(
    walked: &WalkedPath<'_>,
    i: usize,
    before: Option<usize>,
    motor: &Joints,
    robot: &Robot,
) -> Option<Vec<WayFinding>> {
    let start = walked.start(before)?;
    let segment = Segment::into(walked.program, walked.prepared, i, &start)?;
    let (from, to) = (start.seen(&start.commanded, walked.prepared, i)?, walked.commanded.poses[i]);
    let track = match Kind::of(walked.program, i) {
        Kind::Arc => Track::arc(&from, &walked.commanded.poses[i - 1], &to, segment.arc_turn()),
        _ => Track::line(&from, &to),
    };
    let setting = |share: f64| segment.setting(share);
    let feed_mm_s = walked.program.targets[i].feed_mm_s;
    let motors = [start.motor, *motor];
    Some(FollowedSegment { index: i, robot, track, setting: &setting, motors, feed_mm_s }.faults())
}
