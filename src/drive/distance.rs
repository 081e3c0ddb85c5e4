//! How far a driven path is from the programmed one.

use super::{Lead, Track, Waypoint};
use crate::robot::Robot;
use nalgebra::Vector3;

/// How far along the programmed path the place nearest to a driven one is looked for, m: farther than any controller cuts a
/// corner at milling speeds.
const REACH: f64 = 0.03;

/// The programmed lines and arcs.
pub(crate) struct ProgrammedPath {
    /// The way to each waypoint; `None` of joint motions, which have no programmed path, and of the first waypoint.
    tracks: Vec<Option<Track>>,
}

/// Where a place lies off the programmed path.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Offset {
    /// From the nearest place of the programmed path, m.
    pub(crate) vector: Vector3<f64>,
    /// Unit vector along the path there; `None` at an end of a way, where the path may turn.
    pub(crate) tangent: Option<Vector3<f64>>,
}

impl ProgrammedPath {
    pub(crate) fn new(robot: &Robot, waypoints: &[Waypoint]) -> Self {
        let track = |i: usize| {
            let (from, to) = (&waypoints[i.checked_sub(1)?], &waypoints[i]);
            let start = robot.forward(&from.motor) * to.flange_from_tcp;
            match &to.lead {
                Lead::Line => Some(Track::line(&start, &to.base_from_tcp)),
                Lead::Arc(via) => Some(Track::arc(&start, via, &to.base_from_tcp)),
                Lead::Joints => None,
            }
        };
        Self { tracks: (0..waypoints.len()).map(track).collect() }
    }

    /// The line or arc that leads to a waypoint.
    pub(crate) fn track(&self, waypoint: usize) -> Option<&Track> {
        self.tracks.get(waypoint)?.as_ref()
    }

    /// The offset of a place (base frame, m) that is passed on the way to a waypoint; `None` where no line or arc is near it along
    /// the path.
    pub(crate) fn offset(&self, place: &Vector3<f64>, waypoint: usize) -> Option<Offset> {
        let mut best: Option<(f64, Offset)> = None;
        let mut look = |track: &Track| {
            let share = track.nearest(place);
            let vector = place - track.place(share);
            let distance = vector.norm_squared();
            if best.as_ref().is_none_or(|(least, _)| distance < *least) {
                let tangent = if share > 0.0 && share < 1.0 { track.tangent(share) } else { None };
                best = Some((distance, Offset { vector, tangent }));
            }
        };
        self.track(waypoint).into_iter().for_each(&mut look);
        let mut within = |track: &Option<Track>, left: &mut f64| {
            let Some(track) = track.as_ref().filter(|_| *left > 0.0) else { return false };
            look(track);
            *left -= track.length();
            true
        };
        let (before, after) = self.tracks.split_at(waypoint.min(self.tracks.len()));
        let mut left = REACH;
        let _ = before.iter().rev().take_while(|track| within(track, &mut left)).count();
        left = REACH;
        let _ = after.iter().skip(1).take_while(|track| within(track, &mut left)).count();
        best.map(|(_, offset)| offset)
    }
}

/// From a place to the nearest one of a path through places, and the place of the path that it is nearest to.
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
