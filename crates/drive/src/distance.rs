//! How far a driven path is from the programmed one.

use super::{Lead, Track, Waypoint};
use deflex_robot::Robot;
use nalgebra::Vector3;
use smallvec::SmallVec;

/// Length of programmed path on which the point nearest to a driven one is searched for, m: more than any controller cuts from a
/// corner at milling speeds.
const REACH: f64 = 0.03;

/// Number of consecutive segments that are skipped at once if none of them is near.
const TOGETHER: usize = 8;

/// The programmed lines and arcs, from the first one that is not forgotten.
#[derive(Clone, Debug, Default)]
#[doc(hidden)]
pub struct ProgrammedPath {
    /// Waypoint of the first track: a multiple of [`TOGETHER`].
    first: usize,
    /// The last waypoint.
    last: Option<Waypoint>,
    /// The segment to each waypoint; `None` for joint motions, which have no programmed path, and for the first waypoint.
    tracks: Vec<Option<Track>>,
    /// Length of the path up to the end of each segment, m; a segment without a track counts as longer than [`REACH`].
    along: Vec<f64>,
    /// One around each [`TOGETHER`] segments.
    balls: Vec<Ball>,
}

/// A ball around a part of a path.
#[derive(Clone, Copy, Debug)]
struct Ball {
    centre: Vector3<f64>,
    radius: f64,
}

impl Ball {
    /// No point of a curve is farther from its middle than half its length.
    fn around(track: &Track) -> Self {
        Self { centre: track.place(0.5), radius: 0.5 * track.length() }
    }

    /// The ball around several; `None` for none.
    fn around_all(balls: &[Self]) -> Option<Self> {
        let centre = balls.iter().map(|ball| ball.centre).sum::<Vector3<f64>>() / balls.len() as f64;
        let radius = balls.iter().map(|ball| (ball.centre - centre).norm() + ball.radius).reduce(f64::max)?;
        Some(Self { centre, radius })
    }

    fn is_within(&self, distance: f64, place: &Vector3<f64>) -> bool {
        (place - self.centre).norm_squared() < (self.radius + distance).powi(2)
    }
}

/// The offset of a point from the programmed path.
#[derive(Clone, Copy, Debug)]
#[doc(hidden)]
pub struct Offset {
    /// Vector from the nearest point of the programmed path, m.
    pub vector: Vector3<f64>,
    /// Unit vector along the path there; `None` at an end of a segment, where the path may turn.
    pub(crate) tangent: Option<Vector3<f64>>,
}

impl ProgrammedPath {
    pub(crate) fn new(robot: &Robot, waypoints: &[Waypoint]) -> Self {
        let mut path = Self::default();
        waypoints.iter().for_each(|waypoint| path.add(robot, waypoint));
        path
    }

    /// Adds the next waypoint.
    pub fn add(&mut self, robot: &Robot, to: &Waypoint) {
        let start = self.last.as_ref().map(|from| from.start_of(robot, to));
        let track = start.and_then(|start| match &to.lead {
            Lead::Line => Some(Track::line(&start, &to.base_from_tcp)),
            Lead::Arc { via, turn } => Some(Track::arc(&start, via, &to.base_from_tcp, *turn)),
            Lead::Joints => None,
        });
        let length = track.as_ref().map_or(2.0 * REACH, Track::length);
        self.last = Some(*to);
        self.along.push(self.along.last().unwrap_or(&0.0) + length);
        self.tracks.push(track);
        if self.tracks.len().is_multiple_of(TOGETHER) {
            let tracks = &self.tracks[self.tracks.len() - TOGETHER..];
            let balls: SmallVec<[Ball; TOGETHER]> = tracks.iter().flatten().map(Ball::around).collect();
            let none = Ball { centre: Vector3::zeros(), radius: f64::INFINITY };
            self.balls.push(Ball::around_all(&balls).unwrap_or(none));
        }
    }

    /// The line or arc that leads to a waypoint.
    pub fn track(&self, waypoint: usize) -> Option<&Track> {
        self.tracks.get(waypoint.checked_sub(self.first)?)?.as_ref()
    }

    /// Whether the path is known as far as a driven point on the segment to a waypoint may be near it.
    pub fn reaches(&self, waypoint: usize) -> bool {
        let ends = self.along.get(waypoint - self.first);
        self.along.last().zip(ends).is_some_and(|(last, ends)| last - ends >= REACH)
    }

    /// Forgets what is not near the segment to a waypoint or to one after it.
    pub fn forget(&mut self, waypoint: usize) {
        let needed = self.near(waypoint) / TOGETHER;
        self.tracks.drain(..needed * TOGETHER);
        self.along.drain(..needed * TOGETHER);
        self.balls.drain(..needed);
        self.first += needed * TOGETHER;
    }

    /// Index of the first track within reach along the path before the segment to a waypoint.
    fn near(&self, waypoint: usize) -> usize {
        let own = waypoint - self.first;
        let Some(begins) = self.along.get(own.saturating_sub(1)) else { return 0 };
        self.along[..own].partition_point(|along| begins - along >= REACH)
    }

    /// The offset of a point (base frame, m) of the driven path on the segment to a waypoint; `None` if no line or arc is near it along
    /// the path.
    pub fn offset(&self, place: &Vector3<f64>, waypoint: usize) -> Option<Offset> {
        let mut best: Option<(f64, Offset)> = None;
        let look = |track: &Track, best: &mut Option<(f64, Offset)>| {
            let share = track.nearest(place);
            let vector = place - track.place(share);
            let distance = vector.norm_squared();
            if best.as_ref().is_none_or(|(least, _)| distance < *least) {
                let tangent = if share > 0.0 && share < 1.0 { track.tangent(share) } else { None };
                *best = Some((distance, Offset { vector, tangent }));
            }
        };
        self.track(waypoint).into_iter().for_each(|track| look(track, &mut best));
        // The segments that begin or end within reach along the path.
        let own = waypoint - self.first;
        let ends = *self.along.get(own)?;
        let mut way = self.near(waypoint);
        while way < self.along.len() && (way <= own || self.along[way - 1] - ends < REACH) {
            let least = best.as_ref().map_or(f64::INFINITY, |(least, _)| least.sqrt());
            let ball = if way.is_multiple_of(TOGETHER) { self.balls.get(way / TOGETHER) } else { None };
            if ball.is_some_and(|ball| !ball.is_within(least, place)) {
                way += TOGETHER;
                continue;
            }
            if let Some(track) = self.tracks[way].as_ref().filter(|_| way != own) {
                look(track, &mut best);
            }
            way += 1;
        }
        best.map(|(_, offset)| offset)
    }
}

/// The vector from a point to a polyline, and the index of the polyline's point that is nearest.
#[doc(hidden)]
pub fn nearest_between(place: &Vector3<f64>, path: &[Vector3<f64>]) -> Option<(Vector3<f64>, usize)> {
    let mut best: Option<(f64, Vector3<f64>, usize)> = None;
    for k in 1..path.len() {
        let (a, b) = (path[k - 1], path[k]);
        let way = b - a;
        let square = way.norm_squared();
        let share = if square > 0.0 { ((place - a).dot(&way) / square).clamp(0.0, 1.0) } else { 0.0 };
        let vector = a + way * share - place;
        if best.as_ref().is_none_or(|(least, ..)| vector.norm_squared() < *least) {
            best = Some((vector.norm_squared(), vector, if share < 0.5 { k - 1 } else { k }));
        }
    }
    best.map(|(_, vector, nearest)| (vector, nearest))
}
