//! The programmed lines and arcs with their corners rounded, as motor angles at closely spaced points.

use super::{DriveError, Lead, PathLaw, REORIENTATION_RAD_S, Track, Turn, Waypoint};
use deflex_robot::{Joints, Pose, Robot, turn_between};
use nalgebra::{Translation3, Vector3};

/// Distance between two points of a route, m; between them the motor angles change evenly. On an arm of 1 m, which bends a straight
/// path by 1/m at most away from its singularities, the error is 0.5 µm.
const STEP: f64 = 2e-3;
/// Distance of a chord from the arc that it replaces, m.
const SAGITTA: f64 = 5e-7;
/// Largest number of intervals of a corner or of a motion that bends or changes its speed; n chords miss a parabola by 1/(2 n²) of its
/// height.
const ENOUGH: usize = 16;
/// Height of a parabola that one chord describes to 0.5 µm, m.
const FLAT: f64 = 1e-6;
/// Largest turn of the tool between two points, rad, unless that takes more than [`ENOUGH`] of them. With a lever of half a metre, motor
/// angles that change evenly have an error of 0.5 µm.
const TURN: f64 = 2.8e-3;
/// Motor angles along a segment of this length (m) and turn of the tool (rad) follow the parabola through its ends and its middle. On an arm of
/// 1 m, and with a lever of half a metre, the terms of third order are 0.3 µm.
const PARABOLA: f64 = 1e-2;
const PARABOLA_TURN: f64 = 0.04;
/// Least length of a rounding, as a share of the segments that it rounds: in the middle of a reversal it has no length, and still takes time.
const LEAST_SHARE: f64 = 0.05;
/// A segment shorter than this has no length, m: no controller resolves it.
const NO_LENGTH: f64 = 1e-9;
/// Share of a segment over which its derivatives at an end are taken: its bend over a thousandth changes them by as little.
const AT_END: f64 = 1e-3;

/// One point of a route.
#[derive(Clone, Copy, Debug)]
pub(super) struct Knot {
    /// Motor angles, rad.
    pub(super) motor: Joints,
    /// Position of the TCP, base frame, m.
    pub(super) place: Vector3<f64>,
    /// Length of the route from the point before, m; a reorientation counts as the length that takes as long at the feed.
    pub(super) length: f64,
    /// Largest speed from the point before to this one, m/s, and acceleration along the route, m/s².
    pub(super) speed: f64,
    pub(super) acceleration: f64,
    /// Time for which the program waits here, s, if the motion comes to rest here.
    pub(super) stop: Option<f64>,
    /// Index of the waypoint at the end of the segment, plus the covered share of the segment, less 1.
    pub(super) progress: f64,
}

/// A route, from the first waypoint to the last.
#[derive(Clone, Debug)]
pub(super) struct Route {
    pub(super) knots: Vec<Knot>,
}

/// A segment: the programmed motion from one waypoint to the next.
#[derive(Clone, Debug)]
struct Segment {
    /// Motor angles at its start and at its end, rad.
    from: Joints,
    to: Joints,
    /// The TCP in the flange, m.
    flange_from_tcp: Pose,
    /// Radius of the zone at its end, m; see [`Waypoint::zone`].
    zone: Option<f64>,
    /// Time for which the program waits at its end if the arm comes to rest there, s.
    wait: f64,
    /// Index of the waypoint at its end.
    index: usize,
    /// Largest speed on it, m/s: the feed, and what the acceleration across an arc allows.
    speed: f64,
    /// Unit directions of the TCP at its start and at its end, base frame; zero if it does not move.
    directions: [Vector3<f64>; 2],
    /// Derivatives there of the motor angles by the length, rad/m; zero if the law does not limit the axes.
    rates: [Joints; 2],
    /// The curve of a line or an arc; `None` for a joint motion.
    track: Option<Track>,
    /// Length, counted as [`Knot::length`], m.
    length: f64,
    /// Angle by which the tool turns, rad.
    turn: f64,
    /// Radius of the rounding at its end, m.
    radius: f64,
    /// Whether the speed changes at its start, and at its end.
    changes: [bool; 2],
    /// Largest acceleration along it in its first and in its second half, m/s²: each half leads from or to a stop, or a corner that is passed.
    accelerations: [f64; 2],
    /// Difference of the motor angles in its middle from the mean of those at its ends, rad; `Some` if the segment is so short that the
    /// angles follow a parabola.
    bow: Option<Joints>,
}

impl Segment {
    fn new(robot: &Robot, law: &PathLaw, from: &Waypoint, to: &Waypoint, index: usize) -> Self {
        // A motion has the tool of its end.
        let start = from.start_of(robot, to);
        let track = match &to.lead {
            Lead::Line => Some(Track::line(&start, &to.base_from_tcp)),
            Lead::Arc { via, turn } => Some(Track::arc(&start, via, &to.base_from_tcp, *turn)),
            Lead::Joints => None,
        };
        let chord = (to.base_from_tcp.translation.vector - start.translation.vector).norm();
        let straight = track.as_ref().map_or(chord, Track::length);
        let joint_turn = || turn_between(&start.rotation, &to.base_from_tcp.rotation).norm();
        let turn = track.as_ref().map_or_else(joint_turn, Track::turn);
        let length = straight.max(turn * to.feed / REORIENTATION_RAD_S);
        let direction = |share: f64| track.as_ref().and_then(|track| track.tangent(share));
        let arc = track.as_ref().filter(|track| track.is_arc());
        let bend = arc.map_or(f64::INFINITY, |arc| (law.corner_acceleration * arc.length() / arc.angle()).sqrt());
        let mut segment = Self {
            from: from.motor,
            to: to.motor,
            flange_from_tcp: to.flange_from_tcp,
            zone: to.zone,
            wait: to.wait,
            index,
            speed: to.feed.min(bend),
            directions: [0.0, 1.0].map(|share| direction(share).unwrap_or_else(Vector3::zeros)),
            rates: [Joints::zeros(); 2],
            track,
            length,
            turn,
            radius: 0.0,
            changes: [true; 2],
            accelerations: [law.acceleration; 2],
            bow: None,
        };
        if length <= PARABOLA && turn <= PARABOLA_TURN && segment.is_parabola() {
            let mean = (from.motor + to.motor) / 2.0;
            let is_straight = segment.track.is_none() || length <= segment.step() && turn <= TURN;
            segment.bow = if is_straight {
                Some(Joints::zeros())
            } else {
                segment.motor(robot, 0.5, &mean).ok().map(|motor| motor - mean)
            };
        }
        if law.limits_axes() && length > NO_LENGTH {
            let rate = |[from, to]: [f64; 2], near: &Joints| {
                let [from, to] = [from, to].map(|share| segment.motor(robot, share, near).unwrap_or(*near));
                (to - from) / (AT_END * length)
            };
            segment.rates = [rate([0.0, AT_END], &segment.from), rate([1.0 - AT_END, 1.0], &segment.to)];
        }
        segment
    }

    /// Radius of its arc, m; infinite for other segments.
    fn arc_radius(&self) -> f64 {
        let arc = self.track.as_ref().filter(|track| track.is_arc());
        arc.map_or(f64::INFINITY, |arc| arc.length() / arc.angle())
    }

    /// Distance between two points, m: see [`STEP`] and [`SAGITTA`].
    fn step(&self) -> f64 {
        STEP.min((8.0 * self.arc_radius() * SAGITTA).sqrt())
    }

    /// Whether it is a parabola to [`SAGITTA`]. The parabola through the ends and the middle of an arc differs from the arc by its term of
    /// third order, which is at most l³/(72 √3 r²).
    fn is_parabola(&self) -> bool {
        self.length.powi(3) <= 72.0 * 3f64.sqrt() * SAGITTA * self.arc_radius().powi(2)
    }

    /// Motor angles at a share of the segment, near known ones.
    fn motor(&self, robot: &Robot, share: f64, near: &Joints) -> Result<Joints, DriveError> {
        let even = || self.from.lerp(&self.to, share);
        match (&self.track, &self.bow) {
            (None, _) => Ok(even()),
            (_, Some(bow)) => Ok(even() + bow * (4.0 * share * (1.0 - share))),
            _ if share <= 0.0 => Ok(self.from),
            _ if share >= 1.0 => Ok(self.to),
            (Some(track), None) => self.inverse(robot, &track.pose(share), near),
        }
    }

    fn inverse(&self, robot: &Robot, base_from_tcp: &Pose, near: &Joints) -> Result<Joints, DriveError> {
        let base_from_flange = base_from_tcp * self.flange_from_tcp.inverse();
        let reached = robot.inverse_near_unlimited(&base_from_flange, near);
        reached.map_err(|_| DriveError::Unreachable { waypoint: self.index })
    }

    /// The corner to the next segment.
    fn turns_to(&self, next: &Self) -> Turn {
        Turn { tcp: (next.directions[0] - self.directions[1]).norm(), axes: next.rates[0] - self.rates[1] }
    }
}

/// Makes a route of waypoints that come one after the other.
#[derive(Clone, Debug)]
pub(super) struct Router<'r> {
    robot: &'r Robot,
    law: PathLaw,
    /// Number of waypoints so far.
    count: usize,
    /// The last waypoint at which the TCP has moved.
    last: Option<Waypoint>,
    /// The segment to it, and the share of the segment up to which the route has knots.
    open: Option<(Segment, f64)>,
    /// Motor angles at the last knot, rad.
    near: Joints,
    /// The knots that are known and not yet taken.
    pub(super) knots: Vec<Knot>,
}

impl Route {
    pub(super) fn new(robot: &Robot, law: &PathLaw, waypoints: &[Waypoint]) -> Result<Self, DriveError> {
        let mut router = Router::new(robot, law);
        waypoints.iter().try_for_each(|waypoint| router.add(waypoint))?;
        router.end()?;
        Ok(Self { knots: router.knots })
    }

    /// The programmed path: no corner is rounded.
    pub(super) fn as_programmed(robot: &Robot, waypoints: &[Waypoint]) -> Result<Self, DriveError> {
        Self::new(robot, &PathLaw::AS_WRITTEN, waypoints)
    }
}

impl<'r> Router<'r> {
    pub(super) fn new(robot: &'r Robot, law: &PathLaw) -> Self {
        let near = Joints::zeros();
        Self { robot, law: *law, count: 0, last: None, open: None, near, knots: Vec::new() }
    }

    /// Adds a waypoint: the route up to the corner before it becomes known.
    pub(super) fn add(&mut self, to: &Waypoint) -> Result<(), DriveError> {
        let index = self.count;
        self.count += 1;
        let Some(last) = &self.last else {
            let place = to.base_from_tcp.translation.vector;
            self.last = Some(*to);
            let (motor, speed, acceleration) = (to.motor, to.feed, self.law.acceleration);
            self.push(Knot { motor, place, length: 0.0, speed, acceleration, stop: Some(0.0), progress: 0.0 });
            return Ok(());
        };
        let mut next = Segment::new(self.robot, &self.law, last, to, index);
        if next.length <= NO_LENGTH {
            // Where the arm is already, it only rests.
            if let Some((segment, _)) = self.open.as_mut().filter(|_| to.zone.is_none()) {
                segment.wait = if segment.zone.is_none() { segment.wait + to.wait } else { to.wait };
                segment.zone = None;
            }
            return Ok(());
        }
        self.last = Some(*to);
        let mut begins = 0.0;
        if let Some((mut segment, begun)) = self.open.take() {
            self.round(&mut segment, &mut next);
            self.straight(&segment, [begun, 1.0 - segment.radius / segment.length])?;
            if segment.radius > 0.0 {
                self.corner(&segment, &next)?;
                begins = segment.radius / next.length;
            } else if segment.zone.is_some() {
                // Without a rounding, the speed limit of the corner applies at its point.
                self.limit_last(self.law.corner_speed(&segment.turns_to(&next), 0.0));
            } else {
                self.stop_last(segment.wait);
            }
        }
        self.open = Some((next, begins));
        Ok(())
    }

    /// Ends the route at the last waypoint.
    pub(super) fn end(&mut self) -> Result<(), DriveError> {
        if let Some((segment, begun)) = self.open.take() {
            self.straight(&segment, [begun, 1.0])?;
            self.stop_last(segment.wait);
        }
        Ok(())
    }

    /// Decides how the corner between two segments is passed.
    fn round(&self, segment: &mut Segment, next: &mut Segment) {
        let law = &self.law;
        let room = 0.5 * segment.length.min(next.length);
        let Some(radius) = segment.zone else { return };
        (segment.accelerations[1], next.accelerations[0]) = (law.passing_acceleration, law.passing_acceleration);
        // A controller limits a zone to half of the shorter segment, and rounds within a share of that. Two roundings never overlap.
        segment.radius = (law.zone_share * radius.min(room)).min(room);
        let is_even = segment.speed.total_cmp(&next.speed).is_eq();
        let keeps = is_even && law.corner_speed(&segment.turns_to(next), segment.radius) >= segment.speed;
        (segment.changes[1], next.changes[0]) = (!keeps, !keeps);
    }

    /// Takes the knots that are known. The last one may still become a stop.
    pub(super) fn known(&mut self) -> impl Iterator<Item = Knot> + '_ {
        let known = self.knots.len().saturating_sub(1);
        self.knots.drain(..known)
    }

    fn push(&mut self, mut knot: Knot) {
        let moved = (knot.motor - self.near).abs();
        let limits = self.law.axis_acceleration.iter().zip(&moved).map(|(limit, moved)| limit * knot.length / moved);
        knot.acceleration = limits.fold(knot.acceleration, f64::min);
        self.near = knot.motor;
        self.knots.push(knot);
    }

    /// Limits the speed along the last knots, which are at even lengths, so that no axis accelerates too much because the motor angles bend.
    fn limit_bends(&mut self, count: usize) {
        if !self.law.limits_axes() {
            return;
        }
        let first = self.knots.len().saturating_sub(count + 1);
        for i in first + 1..self.knots.len().saturating_sub(1) {
            let [before, here, after] = [i - 1, i, i + 1].map(|i| self.knots[i].motor);
            let bend = (after - here * 2.0 + before) / self.knots[i].length.powi(2);
            let limits = self.law.axis_acceleration.iter().zip(&bend).map(|(limit, bend)| (limit / bend.abs()).sqrt());
            let speed = limits.fold(f64::INFINITY, f64::min);
            for knot in &mut self.knots[i..=i + 1] {
                knot.speed = knot.speed.min(speed);
            }
        }
    }

    fn stop_last(&mut self, wait: f64) {
        if let Some(knot) = self.knots.last_mut() {
            knot.stop = Some(wait);
        }
    }

    fn limit_last(&mut self, speed: f64) {
        if let Some(knot) = self.knots.last_mut() {
            knot.speed = knot.speed.min(speed);
        }
    }

    /// Adds a segment between two of its shares.
    fn straight(&mut self, segment: &Segment, [from, to]: [f64; 2]) -> Result<(), DriveError> {
        let robot = self.robot;
        let length = segment.length * (to - from);
        if length <= NO_LENGTH {
            return Ok(());
        }
        let is_even = segment.track.is_some() && segment.changes == [false; 2];
        let speed = segment.speed;
        let wanted = if is_even { segment.turn * (to - from) / TURN } else { f64::INFINITY };
        let count = intervals(length, segment.step(), wanted);
        for k in 1..=count {
            let share = from + (to - from) * part(k, count);
            let motor = segment.motor(robot, share, &self.near)?;
            let place = match &segment.track {
                Some(track) => track.place(share),
                None => (robot.forward(&motor) * segment.flange_from_tcp).translation.vector,
            };
            let acceleration = segment.accelerations[usize::from(share > 0.5)];
            let progress = progress(segment.index, share);
            self.push(Knot {
                motor,
                place,
                length: length * part(1, count),
                speed,
                acceleration,
                stop: None,
                progress,
            });
        }
        self.limit_bends(count);
        Ok(())
    }

    /// Adds the rounding between two segments: while the first one comes to its end, the second one begins. If both are straight, the sum
    /// of the two motions is a parabola.
    fn corner(&mut self, segment: &Segment, next: &Segment) -> Result<(), DriveError> {
        let (robot, law) = (self.robot, self.law);
        let radius = segment.radius;
        let directions = [segment.directions[1], next.directions[0]];
        let corner = segment.turns_to(next);
        let (turn, speed) = (corner.tcp, segment.speed.min(next.speed).min(law.corner_speed(&corner, radius)));
        let turned = (segment.turn / segment.length + next.turn / next.length) * radius;
        let bends = (0.25 * radius * turn / FLAT).sqrt().max(turned / TURN);
        let is_path = segment.track.is_some() && next.track.is_some();
        // A sum of motor angles and a sum of poses differ by the product of the two segments' shares in the middle, on an arm of 1 m with a
        // lever of half a metre.
        let differs = (0.25 * radius).powi(2) + 0.5 * (turned / 8.0).powi(2);
        let is_sum = segment.bow.is_some() && next.bow.is_some() && differs <= FLAT;
        let step = segment.step().min(next.step());
        let count = intervals(2.0 * radius, step, if is_path { bends } else { f64::INFINITY });
        // A parabola is shorter than the two segments that it rounds; a reorientation keeps its length.
        let shorter = |passed: f64| match &directions {
            [first, second] if *first != Vector3::zeros() && *second != Vector3::zeros() => {
                first.lerp(second, passed).norm().max(LEAST_SHARE)
            }
            _ => 1.0,
        };
        for k in 1..=count {
            let passed = part(k, count);
            let (left, gone) = (radius * (1.0 - passed).powi(2), radius * passed.powi(2));
            let shares = [1.0 - left / segment.length, gone / next.length];
            let (motor, place) = match (&segment.track, &next.track) {
                (Some(first), Some(second)) if !is_sum => {
                    let corner = first.pose(1.0);
                    // The next segment may have another tool: both use the tool of the segment that ends here.
                    let other = next.flange_from_tcp.inverse() * segment.flange_from_tcp;
                    let pose = sum(&first.pose(shares[0]), &(second.pose(shares[1]) * other), &corner);
                    (segment.inverse(robot, &pose, &self.near)?, pose.translation.vector)
                }
                (first, second) => {
                    let segments =
                        [segment.motor(robot, shares[0], &segment.to)?, next.motor(robot, shares[1], &segment.to)?];
                    let motor = segments[0] + segments[1] - segment.to;
                    let place = match (first, second) {
                        (Some(first), Some(second)) => {
                            first.place(shares[0]) + second.place(shares[1]) - second.place(0.0)
                        }
                        _ => (robot.forward(&motor) * segment.flange_from_tcp).translation.vector,
                    };
                    (motor, place)
                }
            };
            let progress = if passed < 0.5 {
                progress(segment.index, 1.0 - radius * (1.0 - 2.0 * passed) / segment.length)
            } else {
                progress(next.index, radius * (2.0 * passed - 1.0) / next.length)
            };
            let length = 2.0 * radius * part(1, count) * shorter(passed - 0.5 * part(1, count));
            let acceleration = law.passing_acceleration;
            self.push(Knot { motor, place, length, speed, acceleration, stop: None, progress });
        }
        Ok(())
    }
}

/// The pose whose displacement from the corner is the sum of those of two others.
fn sum(first: &Pose, second: &Pose, corner: &Pose) -> Pose {
    let position = first.translation.vector + second.translation.vector - corner.translation.vector;
    let rotation = second.rotation * corner.rotation.inverse() * first.rotation;
    Pose::from_parts(Translation3::from(position), rotation)
}

/// Number of intervals of a length (m) that are at most `step` long (m): at least `wanted`, of which [`ENOUGH`] are enough.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_precision_loss)]
fn intervals(length: f64, step: f64, wanted: f64) -> usize {
    (length / step).max(wanted.min(ENOUGH as f64)).max(1.0).ceil() as usize
}

#[allow(clippy::cast_precision_loss)]
fn part(k: usize, count: usize) -> f64 {
    k as f64 / count as f64
}

/// A waypoint and the share of the segment to it, as one number that grows along the route.
#[allow(clippy::cast_precision_loss)]
fn progress(waypoint: usize, share: f64) -> f64 {
    (waypoint - 1) as f64 + share
}
