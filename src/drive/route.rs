//! The programmed lines and arcs with their corners rounded, as motor angles at closely spaced points.

use super::{DriveError, Lead, PathLaw, REORIENTATION_RAD_S, Track, Waypoint};
use crate::robot::{Joints, Pose, Robot, turn_between};
use nalgebra::{Translation3, Vector3};

/// Distance between two points of a route, m; between them the motor angles change evenly. On an arm of 1 m, which bends a straight
/// path by 1/m at most away from its singularities, the error is 0.5 µm.
const STEP: f64 = 2e-3;
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

/// One point of a route.
#[derive(Clone, Copy, Debug)]
pub(super) struct Knot {
    /// Motor angles, rad.
    pub(super) motor: Joints,
    /// Position of the TCP, base frame, m.
    pub(super) place: Vector3<f64>,
    /// Length of the route from the point before, m; a reorientation counts as the length that takes as long at the feed.
    pub(super) length: f64,
    /// Largest speed from the point before to this one, m/s.
    pub(super) speed: f64,
    /// Whether the motion comes to rest here.
    pub(super) stops: bool,
    /// Index of the waypoint at the end of the segment, plus the covered share of the segment, less 1.
    pub(super) progress: f64,
}

/// A route, from the first waypoint to the last.
#[derive(Clone, Debug)]
pub(super) struct Route {
    pub(super) knots: Vec<Knot>,
}

/// A segment: the programmed motion from one waypoint to the next.
struct Segment<'w> {
    from: &'w Waypoint,
    to: &'w Waypoint,
    /// Index of `to`.
    index: usize,
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
    /// Difference of the motor angles in its middle from the mean of those at its ends, rad; `Some` if the segment is so short that the
    /// angles follow a parabola.
    bow: Option<Joints>,
}

impl<'w> Segment<'w> {
    fn new(robot: &Robot, from: &'w Waypoint, to: &'w Waypoint, index: usize) -> Self {
        // A motion has the tool of its end.
        let start = from.start_of(robot, to);
        let track = match &to.lead {
            Lead::Line => Some(Track::line(&start, &to.base_from_tcp)),
            Lead::Arc(via) => Some(Track::arc(&start, via, &to.base_from_tcp)),
            Lead::Joints => None,
        };
        let chord = (to.base_from_tcp.translation.vector - start.translation.vector).norm();
        let straight = track.as_ref().map_or(chord, Track::length);
        let turn = match track.as_ref().filter(|track| !track.is_arc()) {
            Some(line) => line.turn(),
            None => turn_between(&start.rotation, &to.base_from_tcp.rotation).norm(),
        };
        let length = straight.max(turn * to.feed / REORIENTATION_RAD_S);
        let mut segment = Self { from, to, index, track, length, turn, radius: 0.0, changes: [true; 2], bow: None };
        if length <= PARABOLA && turn <= PARABOLA_TURN {
            let mean = (from.motor + to.motor) / 2.0;
            let is_straight = segment.track.is_none() || length <= STEP && turn <= TURN;
            segment.bow = if is_straight {
                Some(Joints::zeros())
            } else {
                segment.motor(robot, 0.5, &mean).ok().map(|motor| motor - mean)
            };
        }
        segment
    }

    /// Motor angles at a share of the segment, near known ones.
    fn motor(&self, robot: &Robot, share: f64, near: &Joints) -> Result<Joints, DriveError> {
        let even = || self.from.motor.lerp(&self.to.motor, share);
        match (&self.track, &self.bow) {
            (None, _) => Ok(even()),
            (_, Some(bow)) => Ok(even() + bow * (4.0 * share * (1.0 - share))),
            _ if share <= 0.0 => Ok(self.from.motor),
            _ if share >= 1.0 => Ok(self.to.motor),
            (Some(track), None) => self.inverse(robot, &track.pose(share), near),
        }
    }

    fn inverse(&self, robot: &Robot, base_from_tcp: &Pose, near: &Joints) -> Result<Joints, DriveError> {
        let base_from_flange = base_from_tcp * self.to.flange_from_tcp.inverse();
        let reached = robot.inverse_near_unlimited(&base_from_flange, near);
        reached.map_err(|_| DriveError::Unreachable { waypoint: self.index })
    }

    /// Unit direction of the TCP at the start or the end, base frame; zero if it does not move.
    fn direction(&self, share: f64) -> Vector3<f64> {
        self.track.as_ref().and_then(|track| track.tangent(share)).unwrap_or_else(Vector3::zeros)
    }

    /// Largest speed on the segment, m/s: the feed, and what the acceleration across an arc allows.
    fn speed(&self, law: &PathLaw) -> f64 {
        let arc = self.track.as_ref().filter(|track| track.is_arc());
        let bend = arc.map_or(f64::INFINITY, |arc| (law.corner_acceleration * arc.length() / arc.angle()).sqrt());
        self.to.feed.min(bend)
    }
}

impl Route {
    pub(super) fn new(robot: &Robot, law: &PathLaw, waypoints: &[Waypoint]) -> Result<Self, DriveError> {
        let Some(first) = waypoints.first() else { return Ok(Self { knots: Vec::new() }) };
        let mut segments: Vec<Segment<'_>> = Vec::new();
        let mut last = first;
        for (index, to) in waypoints.iter().enumerate().skip(1) {
            let segment = Segment::new(robot, last, to, index);
            if segment.length > NO_LENGTH {
                segments.push(segment);
                last = to;
            }
        }
        for i in 1..segments.len() {
            let room = 0.5 * segments[i - 1].length.min(segments[i].length);
            let Some(radius) = segments[i - 1].to.zone else { continue };
            // A controller limits a zone to half of the shorter segment, and rounds within a share of that.
            segments[i - 1].radius = law.zone_share * radius.min(room);
            let (segment, next) = (&segments[i - 1], &segments[i]);
            let speeds = [segment.speed(law), next.speed(law)];
            let turn = (next.direction(0.0) - segment.direction(1.0)).norm();
            let keeps = speeds[0].total_cmp(&speeds[1]).is_eq() && law.corner_speed(turn, segment.radius) >= speeds[0];
            (segments[i - 1].changes[1], segments[i].changes[0]) = (!keeps, !keeps);
        }
        #[allow(clippy::cast_precision_loss)]
        let place = first.base_from_tcp.translation.vector;
        let start = Knot { motor: first.motor, place, length: 0.0, speed: first.feed, stops: true, progress: 0.0 };
        let mut route = Self { knots: vec![start] };
        let mut begins = 0.0;
        for (i, segment) in segments.iter().enumerate() {
            let ends = 1.0 - segment.radius / segment.length;
            route.straight(robot, law, segment, [begins, ends])?;
            match segments.get(i + 1) {
                Some(next) if segment.radius > 0.0 => {
                    route.corner(robot, law, segment, next)?;
                    begins = segment.radius / next.length;
                }
                Some(next) if segment.to.zone.is_some() => {
                    // Without a rounding, the speed limit of the corner applies at its point.
                    let turn = (next.direction(0.0) - segment.direction(1.0)).norm();
                    route.limit_last(law.corner_speed(turn, 0.0));
                    begins = 0.0;
                }
                _ => {
                    route.stop_last();
                    begins = 0.0;
                }
            }
        }
        Ok(route)
    }

    /// The programmed path: no corner is rounded.
    pub(super) fn as_programmed(robot: &Robot, waypoints: &[Waypoint]) -> Result<Self, DriveError> {
        Self::new(robot, &PathLaw::AS_WRITTEN, waypoints)
    }

    fn near(&self) -> Joints {
        self.knots.last().map_or_else(Joints::zeros, |knot| knot.motor)
    }

    fn stop_last(&mut self) {
        if let Some(knot) = self.knots.last_mut() {
            knot.stops = true;
        }
    }

    fn limit_last(&mut self, speed: f64) {
        if let Some(knot) = self.knots.last_mut() {
            knot.speed = knot.speed.min(speed);
        }
    }

    /// Adds a segment between two of its shares.
    fn straight(
        &mut self,
        robot: &Robot,
        law: &PathLaw,
        segment: &Segment<'_>,
        [from, to]: [f64; 2],
    ) -> Result<(), DriveError> {
        let length = segment.length * (to - from);
        if length <= NO_LENGTH {
            return Ok(());
        }
        let is_even = segment.track.is_some() && segment.changes == [false; 2];
        let count = intervals(length, if is_even { segment.turn * (to - from) / TURN } else { f64::INFINITY });
        for k in 1..=count {
            let share = from + (to - from) * part(k, count);
            let motor = segment.motor(robot, share, &self.near())?;
            let place = match &segment.track {
                Some(track) => track.place(share),
                None => (robot.forward(&motor) * segment.to.flange_from_tcp).translation.vector,
            };
            let speed = segment.speed(law);
            let progress = progress(segment.index, share);
            self.knots.push(Knot { motor, place, length: length * part(1, count), speed, stops: false, progress });
        }
        Ok(())
    }

    /// Adds the rounding between two segments: while the first one comes to its end, the second one begins. If both are straight, the sum
    /// of the two motions is a parabola.
    fn corner(
        &mut self,
        robot: &Robot,
        law: &PathLaw,
        segment: &Segment<'_>,
        next: &Segment<'_>,
    ) -> Result<(), DriveError> {
        let radius = segment.radius;
        let directions = [segment.direction(1.0), next.direction(0.0)];
        let turn = (directions[1] - directions[0]).norm();
        let speed = segment.speed(law).min(next.speed(law)).min(law.corner_speed(turn, radius));
        let turned = (segment.turn / segment.length + next.turn / next.length) * radius;
        let bends = (0.25 * radius * turn / FLAT).sqrt().max(turned / TURN);
        let is_path = segment.track.is_some() && next.track.is_some();
        // A sum of motor angles and a sum of poses differ by the product of the two segments' shares in the middle, on an arm of 1 m with a
        // lever of half a metre.
        let differs = (0.25 * radius).powi(2) + 0.5 * (turned / 8.0).powi(2);
        let is_sum = segment.bow.is_some() && next.bow.is_some() && differs <= FLAT;
        let count = intervals(2.0 * radius, if is_path { bends } else { f64::INFINITY });
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
                    let other = next.to.flange_from_tcp.inverse() * segment.to.flange_from_tcp;
                    let pose = sum(&first.pose(shares[0]), &(second.pose(shares[1]) * other), &corner);
                    (segment.inverse(robot, &pose, &self.near())?, pose.translation.vector)
                }
                (first, second) => {
                    let segments = [
                        segment.motor(robot, shares[0], &segment.to.motor)?,
                        next.motor(robot, shares[1], &segment.to.motor)?,
                    ];
                    let motor = segments[0] + segments[1] - segment.to.motor;
                    let place = match (first, second) {
                        (Some(first), Some(second)) => {
                            first.place(shares[0]) + second.place(shares[1]) - second.place(0.0)
                        }
                        _ => (robot.forward(&motor) * segment.to.flange_from_tcp).translation.vector,
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
            self.knots.push(Knot { motor, place, length, speed, stops: false, progress });
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

/// Number of intervals of a length (m): at least `wanted`, at most [`ENOUGH`].
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_precision_loss)]
fn intervals(length: f64, wanted: f64) -> usize {
    (length / STEP).max(wanted.min(ENOUGH as f64)).max(1.0).ceil() as usize
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
