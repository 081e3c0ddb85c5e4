//! The loads of a program whose points were moved on purpose: those of its original.
//!
//! The controller drives a program with moved corners along the path of the original, and there the cutter feeds. The lines between the
//! moved points have other directions, and inserted targets shift the ordinals by which a table gives forces, times and temperatures.

use super::Prepared;
use super::segment::{Kind, waypoint_targets};
use deflex_program::Program;
use std::sync::Arc;

/// The original of a program with moved points.
#[derive(Clone, Copy)]
pub(super) struct OriginalLoads<'a> {
    pub(super) prepared: &'a Prepared,
    /// The target of the original for each target of the moved program: that at the end of the segment on which it is.
    pub(super) targets: &'a [usize],
}

impl OriginalLoads<'_> {
    /// The target of the original for each target of a moved program. `waypoint_of` gives the waypoint of the original for a waypoint of the
    /// moved program.
    pub(super) fn targets(original: &Program, moved: &Program, waypoint_of: &dyn Fn(usize) -> usize) -> Vec<usize> {
        let (originals, waypoints) = (waypoint_targets(original), waypoint_targets(moved));
        let target = |i: usize| {
            let waypoint = waypoint_of(waypoints.partition_point(|waypoint| *waypoint < i));
            let end = originals[waypoint.min(originals.len() - 1)];
            // The circle point of an arc.
            let via = end.checked_sub(1).filter(|via| Kind::of(original, *via) == Kind::Point);
            via.filter(|_| Kind::of(moved, i) == Kind::Point).unwrap_or(end)
        };
        (0..moved.targets.len()).map(target).collect()
    }

    /// Replaces the loads of the moved program's points.
    pub(super) fn apply(self, moved: &mut Prepared) {
        Arc::make_mut(&mut moved.shared).laws.clone_from(&self.prepared.shared.laws);
        for (point, &i) in moved.points.iter_mut().zip(self.targets) {
            let original = &self.prepared.points[i];
            (point.load, point.plunges, point.normal) = (original.load, original.plunges, original.normal);
            (point.payload, point.temperature) = (original.payload, original.temperature);
            (point.time, point.cut_length) = (original.time, original.cut_length);
        }
    }
}
