//! The loads of a program whose points were moved on purpose: those of its original.
//!
//! The controller drives a program with moved corners along the path of the original, and there the cutter feeds. The lines between the
//! moved points have other directions, and pass through other material. Inserted targets shift the ordinals by which a table gives forces,
//! times and temperatures.

use super::Prepared;
use super::load::PointLoad;
use super::segment::{Kind, waypoint_targets};
use deflex_program::Program;
use std::sync::Arc;

/// The original of a program with moved points.
#[derive(Clone, Copy)]
pub(super) struct OriginalLoads<'a> {
    pub(super) prepared: &'a Prepared,
    /// The target of the original for each target of the moved program.
    pub(super) targets: &'a [OriginalTarget],
}

/// The target of the original whose loads a target of the moved program has.
#[derive(Clone, Copy)]
pub(super) struct OriginalTarget {
    /// Its index.
    target: usize,
    /// Indices of the waypoints of the original between which the target of the moved program is; the first waypoint begins at itself.
    segment: (usize, usize),
}

impl OriginalLoads<'_> {
    /// The target of the original for each target of a moved program. `waypoint_of` gives the waypoint of the original for a waypoint of the
    /// moved program.
    pub(super) fn targets(
        original: &Program,
        moved: &Program,
        waypoint_of: &dyn Fn(usize) -> usize,
    ) -> Vec<OriginalTarget> {
        let (originals, waypoints) = (waypoint_targets(original), waypoint_targets(moved));
        let target = |i: usize| {
            let waypoint = waypoint_of(waypoints.partition_point(|waypoint| *waypoint < i)).min(originals.len() - 1);
            let end = originals[waypoint];
            // The circle point of an arc.
            let via = end.checked_sub(1).filter(|via| Kind::of(original, *via) == Kind::Point);
            let target = via.filter(|_| Kind::of(moved, i) == Kind::Point).unwrap_or(end);
            OriginalTarget { target, segment: (originals[waypoint.saturating_sub(1)], end) }
        };
        (0..moved.targets.len()).map(target).collect()
    }

    /// Replaces the loads of the moved program's points, and the notes about them.
    pub(super) fn apply(self, moved: &mut Prepared) {
        Arc::make_mut(&mut moved.shared).laws.clone_from(&self.prepared.shared.laws);
        moved.notes.clone_from(&self.prepared.notes);
        let mut from = 0.0;
        let shares = self.shares(moved);
        for ((point, at), share) in moved.points.iter_mut().zip(self.targets).zip(shares) {
            let original = &self.prepared.points[at.target];
            (point.load, point.plunges, point.normal) = (original.load, original.plunges, original.normal);
            (point.payload, point.temperature) = (original.payload, original.temperature);
            (point.time, point.cut_length) = (original.time, original.cut_length);
            let [before, end] = [at.segment.0, at.segment.1].map(|waypoint| &self.prepared.points[waypoint]);
            let is_inside = share < 1.0;
            point.part = if is_inside { before.part_between(end, share) } else { end.part.clone() };
            if let Some(force) = end.milled.as_ref().filter(|_| is_inside).and_then(|milled| milled.at(share)) {
                point.load = PointLoad::of_stock(force.programmed);
            }
            // A circle point is within the segment to the end of its arc, which has the cut of both.
            let is_circle_point = at.target != at.segment.1;
            let milled = end.milled.as_ref().filter(|_| !is_circle_point);
            point.milled = milled.map(|milled| Box::new(milled.between(from, share)));
            if !is_circle_point {
                from = if is_inside { share } else { 0.0 };
            }
        }
    }

    /// The share of its segment of the original at which each target of the moved program is: by the lengths of the chords between the
    /// targets on the segment.
    fn shares(&self, moved: &Prepared) -> Vec<f64> {
        let mut lengths = vec![0.0; self.targets.len()];
        let mut totals = vec![0.0; self.prepared.points.len()];
        for i in 1..self.targets.len() {
            let [begin, end] = [i - 1, i].map(|i| moved.points[i].wobj_from_tcp.translation.vector);
            let segment = self.targets[i].segment;
            let so_far = if self.targets[i - 1].segment == segment { lengths[i - 1] } else { 0.0 };
            lengths[i] = so_far + (end - begin).norm();
            totals[segment.1] = lengths[i];
        }
        let share = |(length, at): (f64, &OriginalTarget)| {
            let total: f64 = totals[at.segment.1];
            if total > 0.0 { length / total } else { 1.0 }
        };
        lengths.into_iter().zip(self.targets).map(share).collect()
    }
}
