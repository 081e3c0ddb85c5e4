//! A controller's own log of the axes, and the samples at which a program begins and ends.

use super::Waypoint;
use deflex_robot::{Joints, Pose, Robot};
use nalgebra::Vector3;

/// A log is at a waypoint as long as its distance from it exceeds the least one by no more than this, m. The noise of the resolvers and
/// the settling of the brakes move an arm at rest by less.
const AT_WAYPOINT: f64 = 5e-4;

/// The axes at one moment of a log.
#[derive(Clone, Copy, Debug, PartialEq)]
#[doc(hidden)]
pub struct LogSample {
    /// Time by the log's clock, s.
    pub time: f64,
    /// Motor angles, rad.
    pub motor: Joints,
}

/// The axes over a run of a program.
#[derive(Clone, Debug, PartialEq)]
#[doc(hidden)]
pub struct Log {
    /// File name, for messages.
    pub file: String,
    /// Samples in the order of time.
    pub samples: Vec<LogSample>,
}

impl Log {
    /// The samples from the moment at which the arm leaves the program's first waypoint to that at which it reaches the
    /// last one; `None` if the log does not come within `near` (m) of both in this order.
    pub(super) fn of_program(&self, robot: &Robot, waypoints: &[Waypoint], near: f64) -> Option<&[LogSample]> {
        let (first, last) = (waypoints.first()?, waypoints.last()?);
        let distances = |to: &Waypoint| -> Vec<f64> {
            let tcp = |motor: &Joints| tcp(robot, motor, &to.flange_from_tcp);
            let place = tcp(&to.motor);
            self.samples.iter().map(|sample| (tcp(&sample.motor) - place).norm()).collect()
        };
        let (from_first, from_last) = (distances(first), distances(last));
        // The first stretch at the first waypoint, and the last stretch at the last one: a path may pass either again.
        let least = |distances: &[f64]| distances.iter().copied().fold(f64::INFINITY, f64::min);
        let [begins, ends] = [least(&from_first), least(&from_last)];
        if begins > near || ends > near {
            return None;
        }
        let arrived = from_first.iter().position(|distance| *distance <= begins + AT_WAYPOINT)?;
        let stays = from_first[arrived..].iter().take_while(|distance| **distance <= begins + AT_WAYPOINT).count();
        let start = arrived + stays - 1;
        let left = from_last.iter().rposition(|distance| *distance <= ends + AT_WAYPOINT)?;
        let stayed = from_last[..=left].iter().rev().take_while(|distance| **distance <= ends + AT_WAYPOINT).count();
        let end = left + 1 - stayed;
        (start < end).then(|| &self.samples[start..=end])
    }
}

/// The tool centre point at motor angles, base frame, m.
pub(super) fn tcp(robot: &Robot, motor: &Joints, flange_from_tcp: &Pose) -> Vector3<f64> {
    (robot.forward(motor) * flange_from_tcp).translation.vector
}
