//! The programmed lines and arcs with their corners rounded, as motor angles at close places.

use super::{DriveError, Lead, PathLaw, REORIENTATION_RAD_S, Track, Waypoint};
use crate::robot::{Joints, Pose, Robot, turn_between};
use nalgebra::{Translation3, Vector3};

/// Distance between two places of a route, m: motor angles run straight between them. On an arm of 1 m, which bends a straight
/// path by 1/m at most away from its singularities, this leaves 0.5 µm.
const STEP: f64 = 2e-3;
/// So many intervals of a corner or of a motion are enough where it bends or where its speed changes; a parabola of n chords is off by
/// 1/(2 n²) of its height.
const ENOUGH: usize = 16;
/// Height of a parabola that one chord describes to 0.5 µm, m.
const FLAT: f64 = 1e-6;
/// The tool turns by so much between two places, rad, unless that takes more than [`ENOUGH`] of them: with a lever of half a metre motor
/// angles that run straight leave 0.5 µm.
const TURN: f64 = 2.8e-3;
/// Motor angles along a way of this length (m) and turn of the tool (rad) follow the parabola through its ends and its middle. On an arm of
/// 1 m, and with a lever of half a metre, what is of third order leaves 0.3 µm.
const PARABOLA: f64 = 1e-2;
const PARABOLA_TURN: f64 = 0.04;
/// Least length of a rounding over that of the ways that it rounds: the middle of a turn back has no length, and still takes time.
const LEAST_SHARE: f64 = 0.05;
/// A way shorter than this is none, m: below what any controller resolves.
const NO_WAY: f64 = 1e-9;

/// One place of a route.
#[derive(Clone, Copy, Debug)]
pub(super) struct Knot {
    /// Motor angles, rad.
    pub(super) motor: Joints,
    /// Of the TCP, base frame, m.
    pub(super) place: Vector3<f64>,
    /// Length of the route from the place before, m; a reorientation counts as the length that takes as long at the feed.
    pub(super) length: f64,
    /// Largest speed from the place before to this one, m/s.
    pub(super) speed: f64,
    /// Whether the motion comes to rest here.
    pub(super) stops: bool,
    /// Index of the waypoint that the motion leads to, and the share of the way to it that has been covered.
    pub(super) progress: f64,
}

/// A route, from the first waypoint to the last.
#[derive(Clone, Debug)]
pub(super) struct Route {
    pub(super) knots: Vec<Knot>,
}

/// The way from one waypoint to the next.
struct Way<'w> {
    from: &'w Waypoint,
    to: &'w Waypoint,
    /// Index of `to`.
    index: usize,
    /// Of a line or an arc.
    track: Option<Track>,
    /// Counted as [`Knot::length`].
    length: f64,
    /// By how much the tool turns, rad.
    turn: f64,
    /// Radius of the rounding at its end, m.
    radius: f64,
    /// Whether the speed changes at its start, and at its end.
    changes: [bool; 2],
    /// By what the motor angles in its middle differ from the mean of those at its ends, rad, where it is so short that they follow a
    /// parabola.
    bow: Option<Joints>,
}

impl<'w> Way<'w> {
    fn new(robot: &Robot, from: &'w Waypoint, to: &'w Waypoint, index: usize) -> Self {
        // The tool of the motion is that of its end.
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
        let mut way = Self { from, to, index, track, length, turn, radius: 0.0, changes: [true; 2], bow: None };
        if length <= PARABOLA && turn <= PARABOLA_TURN {
            let mean = (from.motor + to.motor) / 2.0;
            let is_straight = way.track.is_none() || length <= STEP && turn <= TURN;
            way.bow = if is_straight {
                Some(Joints::zeros())
            } else {
                way.motor(robot, 0.5, &mean).ok().map(|motor| motor - mean)
            };
        }
        way
    }

    /// Motor angles at a share of the way, near known ones.
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

    /// Unit direction of the TCP at the start or the end, base frame; zero where it does not move.
    fn direction(&self, share: f64) -> Vector3<f64> {
        self.track.as_ref().and_then(|track| track.tangent(share)).unwrap_or_else(Vector3::zeros)
    }

    /// Largest speed on the way, m/s: the feed, and what the acceleration across an arc allows.
    fn speed(&self, law: &PathLaw) -> f64 {
        let arc = self.track.as_ref().filter(|track| track.is_arc());
        let bend = arc.map_or(f64::INFINITY, |arc| (law.corner_acceleration * arc.length() / arc.angle()).sqrt());
        self.to.feed.min(bend)
    }
}

impl Route {
    pub(super) fn new(robot: &Robot, law: &PathLaw, waypoints: &[Waypoint]) -> Result<Self, DriveError> {
        let Some(first) = waypoints.first() else { return Ok(Self { knots: Vec::new() }) };
        let mut ways: Vec<Way<'_>> = Vec::new();
        let mut last = first;
        for (index, to) in waypoints.iter().enumerate().skip(1) {
            let way = Way::new(robot, last, to, index);
            if way.length > NO_WAY {
                ways.push(way);
                last = to;
            }
        }
        for i in 1..ways.len() {
            let room = 0.5 * ways[i - 1].length.min(ways[i].length);
            let Some(radius) = ways[i - 1].to.zone else { continue };
            // A controller cuts a zone to half of the shorter way, and rounds a share of what is left.
            ways[i - 1].radius = law.zone_share * radius.min(room);
            let (way, next) = (&ways[i - 1], &ways[i]);
            let speeds = [way.speed(law), next.speed(law)];
            let turn = (next.direction(0.0) - way.direction(1.0)).norm();
            let keeps = speeds[0].total_cmp(&speeds[1]).is_eq() && law.corner_speed(turn, way.radius) >= speeds[0];
            (ways[i - 1].changes[1], ways[i].changes[0]) = (!keeps, !keeps);
        }
        #[allow(clippy::cast_precision_loss)]
        let place = first.base_from_tcp.translation.vector;
        let start = Knot { motor: first.motor, place, length: 0.0, speed: first.feed, stops: true, progress: 0.0 };
        let mut route = Self { knots: vec![start] };
        let mut begins = 0.0;
        for (i, way) in ways.iter().enumerate() {
            let ends = 1.0 - way.radius / way.length;
            route.straight(robot, law, way, [begins, ends])?;
            match ways.get(i + 1) {
                Some(next) if way.radius > 0.0 => {
                    route.corner(robot, law, way, next)?;
                    begins = way.radius / next.length;
                }
                Some(next) if way.to.zone.is_some() => {
                    // Without any rounding, the speed of the corner holds at its place.
                    let turn = (next.direction(0.0) - way.direction(1.0)).norm();
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

    /// A way between two of its shares.
    fn straight(
        &mut self,
        robot: &Robot,
        law: &PathLaw,
        way: &Way<'_>,
        [from, to]: [f64; 2],
    ) -> Result<(), DriveError> {
        let length = way.length * (to - from);
        if length <= NO_WAY {
            return Ok(());
        }
        let is_even = way.track.is_some() && way.changes == [false; 2];
        let count = intervals(length, if is_even { way.turn * (to - from) / TURN } else { f64::INFINITY });
        for k in 1..=count {
            let share = from + (to - from) * part(k, count);
            let motor = way.motor(robot, share, &self.near())?;
            let place = match &way.track {
                Some(track) => track.place(share),
                None => (robot.forward(&motor) * way.to.flange_from_tcp).translation.vector,
            };
            let speed = way.speed(law);
            let progress = progress(way.index, share);
            self.knots.push(Knot { motor, place, length: length * part(1, count), speed, stops: false, progress });
        }
        Ok(())
    }

    /// The rounding between two ways: at each moment the first has a share of its last stretch after it and the second has
    /// begun, so that their sum is a parabola where both are straight.
    fn corner(&mut self, robot: &Robot, law: &PathLaw, way: &Way<'_>, next: &Way<'_>) -> Result<(), DriveError> {
        let radius = way.radius;
        let directions = [way.direction(1.0), next.direction(0.0)];
        let turn = (directions[1] - directions[0]).norm();
        let speed = way.speed(law).min(next.speed(law)).min(law.corner_speed(turn, radius));
        let turned = (way.turn / way.length + next.turn / next.length) * radius;
        let bends = (0.25 * radius * turn / FLAT).sqrt().max(turned / TURN);
        let is_path = way.track.is_some() && next.track.is_some();
        // Sums of motor angles and of poses differ by the product of what both ways have of it in the middle, on an arm of 1 m with a lever
        // of half a metre.
        let differs = (0.25 * radius).powi(2) + 0.5 * (turned / 8.0).powi(2);
        let is_sum = way.bow.is_some() && next.bow.is_some() && differs <= FLAT;
        let count = intervals(2.0 * radius, if is_path { bends } else { f64::INFINITY });
        // A parabola is shorter than the two ways that it rounds; a reorientation is as long as it was counted.
        let shorter = |passed: f64| match &directions {
            [first, second] if *first != Vector3::zeros() && *second != Vector3::zeros() => {
                first.lerp(second, passed).norm().max(LEAST_SHARE)
            }
            _ => 1.0,
        };
        for k in 1..=count {
            let passed = part(k, count);
            let (left, gone) = (radius * (1.0 - passed).powi(2), radius * passed.powi(2));
            let shares = [1.0 - left / way.length, gone / next.length];
            let (motor, place) = match (&way.track, &next.track) {
                (Some(first), Some(second)) if !is_sum => {
                    let corner = first.pose(1.0);
                    // The next way may have another tool: both are led by the tool of the one that ends here.
                    let other = next.to.flange_from_tcp.inverse() * way.to.flange_from_tcp;
                    let pose = sum(&first.pose(shares[0]), &(second.pose(shares[1]) * other), &corner);
                    (way.inverse(robot, &pose, &self.near())?, pose.translation.vector)
                }
                (first, second) => {
                    let ways =
                        [way.motor(robot, shares[0], &way.to.motor)?, next.motor(robot, shares[1], &way.to.motor)?];
                    let motor = ways[0] + ways[1] - way.to.motor;
                    let place = match (first, second) {
                        (Some(first), Some(second)) => {
                            first.place(shares[0]) + second.place(shares[1]) - second.place(0.0)
                        }
                        _ => (robot.forward(&motor) * way.to.flange_from_tcp).translation.vector,
                    };
                    (motor, place)
                }
            };
            let progress = if passed < 0.5 {
                progress(way.index, 1.0 - radius * (1.0 - 2.0 * passed) / way.length)
            } else {
                progress(next.index, radius * (2.0 * passed - 1.0) / next.length)
            };
            let length = 2.0 * radius * part(1, count) * shorter(passed - 0.5 * part(1, count));
            self.knots.push(Knot { motor, place, length, speed, stops: false, progress });
        }
        Ok(())
    }
}

/// A pose that is as far from the corner as two others together.
fn sum(first: &Pose, second: &Pose, corner: &Pose) -> Pose {
    let position = first.translation.vector + second.translation.vector - corner.translation.vector;
    let rotation = second.rotation * corner.rotation.inverse() * first.rotation;
    Pose::from_parts(Translation3::from(position), rotation)
}

/// Intervals of a length (m) that is to have so many at least, up to [`ENOUGH`].
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_precision_loss)]
fn intervals(length: f64, wanted: f64) -> usize {
    (length / STEP).max(wanted.min(ENOUGH as f64)).max(1.0).ceil() as usize
}

#[allow(clippy::cast_precision_loss)]
fn part(k: usize, count: usize) -> f64 {
    k as f64 / count as f64
}

/// Waypoint and share as one number that grows along the route.
#[allow(clippy::cast_precision_loss)]
fn progress(waypoint: usize, share: f64) -> f64 {
    (waypoint - 1) as f64 + share
}
