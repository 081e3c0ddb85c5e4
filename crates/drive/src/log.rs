//! A controller's own log of the axes, and the samples at which a program begins and ends.

use super::{Lead, Track, Waypoint};
use deflex_robot::{Joints, Pose, Robot};
use nalgebra::Vector3;
use std::ops::Range;

/// A log is at a waypoint as long as its distance from it exceeds the least one by no more than this, m. The noise of the resolvers and
/// the settling of the brakes move an arm at rest by less.
const AT_WAYPOINT: f64 = 5e-4;
/// Steps in which the length of a logged path is counted, m: below them, noise makes length.
const TRAVEL: f64 = 1e-3;
/// Share of the programmed length by which two runs of one program may differ in length.
const SAME_LENGTH: f64 = 0.02;

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
    /// The samples from the moment at which the arm leaves the program's first waypoint to that at which it reaches the last one. A path may
    /// pass either of them again, and a log may have several runs: of all such stretches, the first one that is as long as the program.
    /// `None` if the log does not come within `near` (m) of both in this order.
    pub(super) fn of_program(&self, robot: &Robot, waypoints: &[Waypoint], near: f64) -> Option<&[LogSample]> {
        let (first, last) = (waypoints.first()?, waypoints.last()?);
        let (starts, ends) = (self.stays(robot, first, near), self.stays(robot, last, near));
        let leaves = starts.iter().map(|stay| stay.end - 1);
        let runs = leaves.flat_map(|left| ends.iter().map(move |stay| left..stay.start));
        let runs: Vec<Range<usize>> = runs.filter(|run| run.start < run.end).collect();
        let run = match &runs[..] {
            [only] => only,
            _ => {
                let (travelled, programmed) = (self.travelled(robot, last), programmed_length(robot, waypoints));
                let off = |run: &Range<usize>| (travelled[run.end] - travelled[run.start] - programmed).abs();
                let least = runs.iter().map(off).fold(f64::INFINITY, f64::min);
                runs.iter().find(|run| off(run) <= least + SAME_LENGTH * programmed)?
            }
        };
        Some(&self.samples[run.start..=run.end])
    }

    /// The stretches of samples that are at a waypoint; none if no sample comes within `near` (m) of it.
    fn stays(&self, robot: &Robot, waypoint: &Waypoint, near: f64) -> Vec<Range<usize>> {
        let place = tcp(robot, &waypoint.motor, &waypoint.flange_from_tcp);
        let distance = |sample: &LogSample| (tcp(robot, &sample.motor, &waypoint.flange_from_tcp) - place).norm();
        let distances: Vec<f64> = self.samples.iter().map(distance).collect();
        let least = distances.iter().copied().fold(f64::INFINITY, f64::min);
        if least > near {
            return Vec::new();
        }
        let mut stays: Vec<Range<usize>> = Vec::new();
        for i in (0..distances.len()).filter(|i| distances[*i] <= least + AT_WAYPOINT) {
            match stays.last_mut() {
                Some(stay) if stay.end == i => stay.end += 1,
                _ => stays.push(i..i + 1),
            }
        }
        stays
    }

    /// Length of the path of the TCP up to each sample, m, in steps of [`TRAVEL`].
    fn travelled(&self, robot: &Robot, waypoint: &Waypoint) -> Vec<f64> {
        let (mut length, mut counted) = (0.0, None);
        let travelled = self.samples.iter().map(|sample| {
            let place = tcp(robot, &sample.motor, &waypoint.flange_from_tcp);
            let gone = (place - *counted.get_or_insert(place)).norm();
            if gone >= TRAVEL {
                length += gone;
                counted = Some(place);
            }
            length
        });
        travelled.collect()
    }
}

/// Length of the programmed path, m; a joint motion counts as a straight one.
fn programmed_length(robot: &Robot, waypoints: &[Waypoint]) -> f64 {
    let length = |two: &[Waypoint]| {
        let (start, to) = (two[0].start_of(robot, &two[1]), &two[1]);
        match &to.lead {
            Lead::Arc { via, turn } => Track::arc(&start, via, &to.base_from_tcp, *turn).length(),
            Lead::Line | Lead::Joints => (to.base_from_tcp.translation.vector - start.translation.vector).norm(),
        }
    };
    waypoints.windows(2).map(length).sum()
}

/// The tool centre point at motor angles, base frame, m.
pub(super) fn tcp(robot: &Robot, motor: &Joints, flange_from_tcp: &Pose) -> Vector3<f64> {
    (robot.forward(motor) * flange_from_tcp).translation.vector
}
