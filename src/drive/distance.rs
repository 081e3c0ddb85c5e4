//! How far a driven path is from the programmed one.

use super::{Lead, Track, Waypoint};
use crate::robot::Robot;
use nalgebra::Vector3;

/// Length of programmed path on which the point nearest to a driven one is searched for, m: more than any controller cuts from a
/// corner at milling speeds.
const REACH: f64 = 0.03;

/// Number of consecutive segments that are skipped at once if none of them is near.
const TOGETHER: usize = 8;

/// The programmed lines and arcs.
pub(crate) struct ProgrammedPath {
    /// The segment to each waypoint; `None` for joint motions, which have no programmed path, and for the first waypoint.
    tracks: Vec<Option<Track>>,
    /// Length of the path up to the end of each segment, m; a segment without a track counts as longer than [`REACH`].
    along: Vec<f64>,
    /// One around each [`TOGETHER`] segments.
    balls: Vec<Ball>,
}

/// A ball around a part of a path.
#[derive(Clone, Copy)]
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
pub(crate) struct Offset {
    /// Vector from the nearest point of the programmed path, m.
    pub(crate) vector: Vector3<f64>,
    /// Unit vector along the path there; `None` at an end of a segment, where the path may turn.
    pub(crate) tangent: Option<Vector3<f64>>,
}

impl ProgrammedPath {
    pub(crate) fn new(robot: &Robot, waypoints: &[Waypoint]) -> Self {
        let track = |i: usize| {
            let (from, to) = (&waypoints[i.checked_sub(1)?], &waypoints[i]);
            let start = from.start_of(robot, to);
            match &to.lead {
                Lead::Line => Some(Track::line(&start, &to.base_from_tcp)),
                Lead::Arc(via) => Some(Track::arc(&start, via, &to.base_from_tcp)),
                Lead::Joints => None,
            }
        };
        let tracks: Vec<Option<Track>> = (0..waypoints.len()).map(track).collect();
        let mut end = 0.0;
        let lengths = tracks.iter().map(|track| track.as_ref().map_or(2.0 * REACH, Track::length));
        let along = lengths.map(|length| {
            end += length;
            end
        });
        let along = along.collect();
        let ball = |tracks: &[Option<Track>]| {
            let balls: Vec<Ball> = tracks.iter().flatten().map(Ball::around).collect();
            Ball::around_all(&balls).unwrap_or(Ball { centre: Vector3::zeros(), radius: f64::INFINITY })
        };
        let balls = tracks.chunks(TOGETHER).map(ball).collect();
        Self { tracks, along, balls }
    }

    /// The line or arc that leads to a waypoint.
    pub(crate) fn track(&self, waypoint: usize) -> Option<&Track> {
        self.tracks.get(waypoint)?.as_ref()
    }

    /// The offset of a point (base frame, m) of the driven path on the segment to a waypoint; `None` if no line or arc is near it along
    /// the path.
    pub(crate) fn offset(&self, place: &Vector3<f64>, waypoint: usize) -> Option<Offset> {
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
        let own = waypoint.min(self.along.len().saturating_sub(1));
        let (begins, ends) = (self.along[own.saturating_sub(1)], self.along[own]);
        let first = self.along[..own].partition_point(|along| begins - along >= REACH);
        let mut way = first;
        while way < self.along.len() && (way <= own || self.along[way - 1] - ends < REACH) {
            let least = best.as_ref().map_or(f64::INFINITY, |(least, _)| least.sqrt());
            if way % TOGETHER == 0 && !self.balls[way / TOGETHER].is_within(least, place) {
                way += TOGETHER;
                continue;
            }
            if let Some(track) = self.track(way).filter(|_| way != own) {
                look(track, &mut best);
            }
            way += 1;
        }
        best.map(|(_, offset)| offset)
    }
}

/// The vector from a point to a polyline, and the index of the polyline's point that is nearest.
pub(crate) fn nearest_between(place: &Vector3<f64>, path: &[Vector3<f64>]) -> Option<(Vector3<f64>, usize)> {
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
