//! Compares the path that the loaded arm takes with the programmed one, as both become known.

use super::course::{Course, LoadedSample};
use super::parallelism::Parallelism;
use super::{DrivenFigures, PathDeviation, Prepared};
use deflex_drive::{Offset, ProgrammedPath, nearest_between};
use deflex_robot::Robot;
use nalgebra::{Rotation3, Vector3};
use std::collections::{BTreeMap, VecDeque};

/// Result for the segment to a waypoint of the programmed path.
#[derive(Clone, Copy, Debug)]
pub(super) struct ComparedSegment {
    /// The deviation on it; `None` if no path is programmed.
    pub(super) path: Option<PathDeviation>,
    /// Vector from the waypoint to the nearest point of the driven path, work object axes, m; `None` if no path is programmed.
    pub(super) missed: Option<Vector3<f64>>,
}

/// A programmed segment that is being compared.
#[derive(Clone, Debug)]
struct OpenSegment {
    path: Option<PathDeviation>,
    /// Length of the driven path on it so far, m.
    driven: f64,
    /// Its end, base frame, m.
    corner: Vector3<f64>,
    wobj_from_base: Rotation3<f64>,
    /// Programmed speed, m/s.
    feed: f64,
}

/// The comparison of a driven path with a programmed one. It keeps what the segments that are still open need.
#[derive(Clone, Debug)]
pub(super) struct Comparison<'r> {
    robot: &'r Robot,
    programmed: ProgrammedPath,
    open: VecDeque<OpenSegment>,
    /// Waypoint of the first open segment.
    first: usize,
    /// Positions of the driven path (base frame, m) from where it comes near the first open segment, and for each of them the waypoint of the
    /// programmed path at the end of its segment.
    places: Vec<Vector3<f64>>,
    about: Vec<usize>,
    /// The part of it on the first open segment and the next one.
    from: usize,
    to: usize,
    /// Distance at which the corner before was missed, mm.
    missed_before: f64,
    /// For each programmed speed (its bits), the largest distance, mm.
    largest: BTreeMap<u64, f64>,
    /// Speed of the fastest cut, m/s.
    fastest_cut: Option<f64>,
    run_time_s: f64,
}

impl<'r> Comparison<'r> {
    pub(super) fn new(robot: &'r Robot) -> Self {
        Self {
            robot,
            programmed: ProgrammedPath::default(),
            open: VecDeque::new(),
            first: 0,
            places: Vec::new(),
            about: Vec::new(),
            from: 0,
            to: 0,
            missed_before: 0.0,
            largest: BTreeMap::new(),
            fastest_cut: None,
            run_time_s: 0.0,
        }
    }

    /// Adds the next waypoints of the programmed path.
    pub(super) fn extend(&mut self, prepared: &Prepared, course: &Course) {
        for (waypoint, &target) in course.waypoints.iter().zip(&course.targets) {
            self.programmed.add(self.robot, waypoint);
            let length = self.programmed.track(self.first + self.open.len()).map(|track| 1e3 * track.length());
            self.open.push_back(OpenSegment {
                path: length.map(|length_mm| PathDeviation { length_mm, ..PathDeviation::default() }),
                driven: 0.0,
                corner: waypoint.base_from_tcp.translation.vector,
                wobj_from_base: prepared.base_from_wobj(target).rotation.inverse(),
                feed: waypoint.feed,
            });
            let cut = prepared.points[target].cuts().then_some(waypoint.feed);
            self.fastest_cut = self.fastest_cut.into_iter().chain(cut).max_by(f64::total_cmp);
        }
    }

    /// Whether the programmed path is known as far as a sample on the segment to a waypoint may be near it.
    pub(super) fn reaches(&self, waypoint: usize) -> bool {
        self.programmed.reaches(waypoint)
    }

    /// Adds samples of the driven path. `waypoint_of` gives the waypoint of the programmed path for one of the driven path. Returns for each
    /// sample the vector from the programmed path to it, work object axes, m.
    pub(super) fn drive(
        &mut self,
        samples: &[LoadedSample],
        waypoint_of: &(dyn Fn(usize) -> usize + Sync),
        parallelism: Parallelism,
    ) -> Vec<Option<Vector3<f64>>> {
        let offset = |k: usize| {
            let sample = &samples[k];
            self.programmed.offset(&sample.base_from_tcp, waypoint_of(sample.waypoint))
        };
        let offsets: Vec<Option<Offset>> = parallelism.map(samples.len(), offset);
        let mut vectors = Vec::with_capacity(samples.len());
        for (sample, offset) in samples.iter().zip(offsets) {
            let (about, at) = (waypoint_of(sample.waypoint), sample.base_from_tcp);
            let length = self.places.last().map_or(0.0, |before| (at - before).norm());
            self.places.push(at);
            self.about.push(about);
            self.run_time_s = sample.time;
            let segment = &mut self.open[about - self.first];
            vectors.push(offset.map(|offset| segment.wobj_from_base * offset.vector));
            let Some((path, offset)) = segment.path.as_mut().zip(offset) else { continue };
            let distance = 1e3 * offset.vector.norm();
            path.max_mm = path.max_mm.max(distance);
            path.mean_square_mm2 += length * distance * distance;
            segment.driven += length;
        }
        vectors
    }

    /// Takes the next segment, if the driven path has passed it and the one after it.
    pub(super) fn next(&mut self) -> Option<ComparedSegment> {
        let passed = self.about.last().is_some_and(|about| *about > self.first + 1);
        if passed { self.close() } else { None }
    }

    /// Takes the next segment after the driven path has ended.
    pub(super) fn close(&mut self) -> Option<ComparedSegment> {
        let OpenSegment { path, driven, corner, wobj_from_base, feed } = self.open.pop_front()?;
        let i = self.first;
        self.first += 1;
        let begin = std::mem::take(&mut self.missed_before);
        let Some(mut path) = path else { return Some(ComparedSegment { path: None, missed: None }) };
        // The distance from a corner counts, however near the path is to both segments.
        let is_about = |place: usize, most: usize| self.about.get(place).is_some_and(|about| *about <= most);
        while i > 0 && is_about(self.from, i - 1) {
            self.from += 1;
        }
        while is_about(self.to, i + 1) {
            self.to += 1;
        }
        // From the last sample before both segments to the first one after them.
        let near = &self.places[self.from.saturating_sub(1)..(self.to + 1).min(self.places.len())];
        let missed = nearest_between(&corner, near).map(|(vector, _)| wobj_from_base * vector);
        let end = missed.map_or(0.0, |missed| 1e3 * missed.norm());
        if driven > 0.0 {
            path.mean_square_mm2 /= driven;
        } else {
            // The segment has no sample: the deviation changes evenly from corner to corner.
            path.max_mm = begin;
            path.mean_square_mm2 = (begin * begin + begin * end + end * end) / 3.0;
        }
        path.max_mm = path.max_mm.max(end);
        path.way_mm = path.max_mm;
        self.missed_before = end;
        let largest = self.largest.entry(feed.to_bits()).or_default();
        *largest = largest.max(path.max_mm);
        Some(ComparedSegment { path: Some(path), missed })
    }

    /// Forgets what only the segments so far needed.
    pub(super) fn forget(&mut self) {
        self.programmed.forget(self.about.last().copied().unwrap_or_default());
        let passed = self.from.saturating_sub(1);
        self.places.drain(..passed);
        self.about.drain(..passed);
        self.from -= passed;
        self.to -= passed;
    }

    /// The figures so far. If targets cut, the distance counts on the motions that are not faster than the fastest cut.
    pub(super) fn figures(&self) -> DrivenFigures {
        let counts = |feed: f64| self.fastest_cut.is_none_or(|fastest| feed <= fastest);
        let counted = self.largest.iter().filter(|(feed, _)| counts(f64::from_bits(**feed)));
        DrivenFigures { max_mm: counted.map(|(_, largest)| *largest).fold(0.0, f64::max), run_time_s: self.run_time_s }
    }
}
