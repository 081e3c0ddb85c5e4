//! The command that makes a controller drive the programmed path.
//!
//! A controller that smooths its commands cuts every bend. The command is therefore another path, which the controller cuts to
//! the programmed one: the commanded points are moved. If that is not enough, zones become smaller, points are added, and in the
//! end the motion comes to rest at the corner. Each step costs more time than the one before. A corner therefore gets the first
//! one that keeps the tolerance ([`Effort`]).
//!
//! The displacements of the points are found by the method of Gauss and Newton. A displacement of a point moves the command on both
//! segments at the point, by a share that falls evenly to zero at the points before and after it (a *hat*). The driven path moves
//! by that hat as the controller smooths it. The weighted sum of squares of the distances from the programmed path is minimised.
//! Large distances have more weight than small ones, so that the largest becomes small.

use super::distance::{Offset, ProgrammedPath, nearest_between};
use super::envelope::Envelope;
use super::route::Route;
use super::smoothing;
use super::smoothing::{Response, Timeline};
use super::{DriveError, DrivenSample, Lead, PathLaw, SAMPLE_S, Turn, Waypoint, log, speed};
use deflex_robot::{Pose, Robot};
use nalgebra::{Matrix3, Translation3, Vector3};
use rayon::prelude::*;

/// Share of the tolerance that the search aims at: the rest is for the digits of the program and the errors of the law.
const AIM: f64 = 0.8;
/// Largest share of the tolerance that may be reserved for errors of the law: with more, too little is left for the search.
const MOST_UNSURE: f64 = 0.5;
/// How much larger the error of the law may be at points that are added some tenths of a millimetre apart than at the corners of its logs. A simulated
/// controller that does not follow the law (samples/plant/controller.py) left 0.30 mm with such points where its law predicted 0.07 mm: 7.4 times the
/// error at single corners.
const ADDED_UNSURE: f64 = 8.0;
/// Rounds of the search for each effort; each drives the path once.
const ROUNDS: usize = 40;
/// Share of a step that is taken: the driven path does not follow exactly as the hats predict.
const STEP: f64 = 0.7;
/// Weight of the displacements' own size, as a share of a point's weight in the normal equations. Smaller values let points
/// move farther for little gain, which costs time.
const DAMPING: f64 = 0.02;
/// Weights are this power of the distance over the tolerance, within these bounds of that share.
const POWER: i32 = 4;
const WEIGHED: [f64; 2] = [0.1, 4.0];
/// Distances of added points from their corner, in standard deviations of the smoothing at the speed in the corner: one point on
/// each side, or three.
const ADDED_AT: [&[f64]; 2] = [&[0.9], &[0.5, 1.2, 2.2]];
/// Least distance of an added point from its corner, m: twice the zone `z0`.
const ADDED_LEAST: f64 = 6e-4;
/// Distance between points over the sum of their zones. The room in excess is for the points' own displacements, and for rounding.
const ROOM: f64 = 1.05;

/// The changes that are allowed to the motion to a waypoint.
#[derive(Clone, Debug, Default)]
#[doc(hidden)]
pub struct Freedom {
    /// Whether its end may be moved.
    pub end: bool,
    /// Whether the circle point of its arc may be moved.
    pub via: bool,
    /// The smallest zone that its end may get instead of the programmed one, m.
    pub smaller_zone: Option<f64>,
    /// Whether the motion may come to rest at its end.
    pub stop: bool,
    /// Zone (m) of points that may be added on its segment; `None` if none may be added.
    pub added_zone: Option<f64>,
    /// Whether the distance of the driven path from this segment counts.
    pub counts: bool,
}

/// The tolerance of a driven path.
#[derive(Clone, Copy, Debug)]
#[doc(hidden)]
pub struct Wanted {
    /// Largest distance from the programmed path, m.
    pub tolerance: f64,
    /// Share of the distance of the driven path from the programmed one that the law does not explain; 0 for an exact law.
    pub error_share: f64,
}

/// The measures at a corner, in the order of their cost in time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
enum Effort {
    /// Points are moved.
    #[default]
    Moved,
    /// The zone is the smallest one.
    SmallZone,
    /// A point is added before and after it.
    Added,
    /// More points are added before and after it.
    AddedMore,
    /// The motion comes to rest.
    Stop,
}

impl Effort {
    const ALL: [Self; 5] = [Self::Moved, Self::SmallZone, Self::Added, Self::AddedMore, Self::Stop];
}

/// A motion as it is to be commanded.
#[derive(Clone, Debug, PartialEq)]
#[doc(hidden)]
pub struct CommandedMotion {
    /// Displacement of its end, base frame, m.
    pub end: Vector3<f64>,
    /// Displacement of the circle point, base frame, m.
    pub via: Vector3<f64>,
    /// Zone in which its end is passed, m; `None` if the motion comes to rest there.
    pub zone: Option<f64>,
    /// Points that are added on its segment, in their order.
    pub added: Vec<AddedPoint>,
}

/// A point that is added on the segment to a waypoint.
#[derive(Clone, Copy, Debug, PartialEq)]
#[doc(hidden)]
pub struct AddedPoint {
    /// Share of the segment.
    pub share: f64,
    /// Its pose, base frame, m.
    pub base_from_tcp: Pose,
}

/// The path that a controller drives for a command, compared with the programmed path.
#[derive(Clone, Debug, Default, PartialEq)]
#[doc(hidden)]
pub struct DrivenResult {
    /// Largest distance between the driven path and the programmed one, m.
    pub largest: f64,
    /// Duration of the run, s.
    pub seconds: f64,
    /// Largest distance near each waypoint, m: up to halfway to the waypoints before and after it.
    pub at_waypoints: Vec<f64>,
    /// Time for which the arm is in each of these stretches, s.
    pub seconds_at: Vec<f64>,
}

/// A command and its result.
#[derive(Clone, Debug)]
#[doc(hidden)]
pub struct ShapedCommand {
    /// The commanded motions, one for each waypoint.
    pub motions: Vec<CommandedMotion>,
    /// Result of the program as it is, which the tests compare with the result of the command.
    #[cfg(test)]
    pub before: DrivenResult,
    /// Result of the command.
    pub after: DrivenResult,
}

/// Finds the command for programmed waypoints that keeps the driven path within a tolerance (m) of the programmed one. Where the
/// tolerance cannot be kept, the command is the best one that was found.
///
/// A corner that the controller cuts by much needs a part of the tolerance for the error of the law. If too little is left, the motion
/// comes to rest, because the law predicts a stop better than a corner.
///
/// # Errors
/// A point is out of reach.
#[doc(hidden)]
pub fn shape(
    robot: &Robot,
    law: &PathLaw,
    waypoints: &[Waypoint],
    freedom: &[Freedom],
    Wanted { tolerance, error_share }: Wanted,
) -> Result<ShapedCommand, DriveError> {
    let path = ProgrammedPath::new(robot, waypoints);
    let (allowed, adds) = (vec![tolerance; waypoints.len()], vec![true; waypoints.len()]);
    let mut shaper = Shaper { robot, law, waypoints, freedom, path, allowed, adds };
    let mut effort = vec![Effort::Moved; waypoints.len()];
    let unmoved = Layout::new(&shaper, &effort);
    let before = shaper.result(&shaper.drive(&unmoved, &[])?);
    for i in 0..waypoints.len() {
        let unsure = error_share * before.at_waypoints[i];
        let is_too_unsure = unsure > MOST_UNSURE * tolerance && before.at_waypoints[i] > tolerance;
        if is_too_unsure && shaper.may(Effort::Stop, i) {
            effort[i] = Effort::Stop;
        }
        shaper.adds[i] = ADDED_UNSURE * unsure <= MOST_UNSURE * tolerance;
        shaper.allowed[i] = f64::max(tolerance - unsure, (1.0 - MOST_UNSURE) * tolerance);
    }
    let mut found = shaper.search(&Layout::new(&shaper, &effort))?;
    loop {
        let mut has_changed = false;
        for i in 1..waypoints.len() {
            let fails = effort[i] != Effort::Stop && found.result.at_waypoints[i] > shaper.allowed[i];
            // A stop stays as it is: an error near it comes from a corner that is moved.
            if !fails || waypoints[i].zone.is_none() {
                continue;
            }
            if let Some(next) = Effort::ALL.into_iter().find(|next| *next > effort[i] && shaper.may(*next, i)) {
                effort[i] = next;
                has_changed = true;
            }
        }
        if !has_changed {
            found = shaper.with_quicker_stops(found, &mut effort)?;
            return Ok(ShapedCommand {
                motions: found.motions(&shaper),
                #[cfg(test)]
                before,
                after: found.result,
            });
        }
        found = shaper.search(&Layout::new(&shaper, &effort))?;
    }
}

struct Shaper<'a> {
    robot: &'a Robot,
    law: &'a PathLaw,
    waypoints: &'a [Waypoint],
    freedom: &'a [Freedom],
    path: ProgrammedPath,
    /// Allowed distance near each waypoint, m: the tolerance less the error of the law.
    allowed: Vec<f64>,
    /// Whether the law is known well enough for points that are added near each waypoint.
    adds: Vec<bool>,
}

/// The points of a command before any of them is moved.
struct Layout {
    /// Ends of its motions.
    ends: Vec<End>,
    /// Points that can be moved, in running order.
    nodes: Vec<Node>,
}

/// The end of a commanded motion.
struct End {
    /// Index of the programmed waypoint at the end of the segment, and share of that segment.
    waypoint: usize,
    share: f64,
    zone: Option<f64>,
    base_from_tcp: Pose,
}

/// A point that can be moved.
#[derive(Clone, Copy)]
struct Node {
    /// Index of its end.
    end: usize,
    is_via: bool,
    /// The progress along the command at which its hat is zero, one, and zero again: [`progress`](super::route) of the
    /// neighbour before it, of the point itself, and of the neighbour after it.
    hat: [f64; 3],
}

/// A command, and the path that the controller drives for it.
struct Driven {
    /// Offset of each sample from the programmed path; `None` where it does not count.
    off: Vec<Option<Offset>>,
    /// The programmed waypoint that is nearest to each sample along the path.
    about: Vec<usize>,
    /// From each programmed waypoint to the driven path, m, and the nearest sample; `None` where the distance does not count.
    corners: Vec<Option<(Vector3<f64>, usize)>>,
    /// For each node, the share of its displacement by which each sample moves.
    responses: Vec<Response>,
    seconds: f64,
}

/// Result of a search.
struct SearchResult {
    ends: Vec<EndFound>,
    result: DrivenResult,
}

/// Nodes that the controller smooths together.
struct Group {
    nodes: std::ops::Range<usize>,
    /// Largest distance over the allowed one, in the best round: rounds do not always improve it.
    least: f64,
    /// Positions of the nodes in that round.
    places: Vec<Vector3<f64>>,
}

impl Group {
    fn new(nodes: std::ops::Range<usize>) -> Self {
        Self { places: vec![Vector3::zeros(); nodes.len()], least: f64::INFINITY, nodes }
    }
}

/// A commanded end with its displacements.
struct EndFound {
    share: f64,
    zone: Option<f64>,
    programmed: Pose,
    end: Vector3<f64>,
    via: Vector3<f64>,
}

impl Layout {
    fn new(shaper: &Shaper<'_>, effort: &[Effort]) -> Self {
        let Shaper { waypoints, freedom, path, .. } = shaper;
        let mut ends: Vec<End> = Vec::with_capacity(waypoints.len());
        for (i, waypoint) in waypoints.iter().enumerate() {
            let added = freedom[i].added_zone.zip(path.track(i)).filter(|(_, track)| !track.is_arc());
            if let Some((zone, track)) = added.filter(|_| i > 0) {
                let share = |distance: f64| distance / track.length();
                let after = shaper.added(effort[i - 1], i - 1, zone).into_iter().map(share);
                let before = shaper.added(effort[i], i, zone).into_iter().rev().map(|distance| 1.0 - share(distance));
                let shares: Vec<f64> = after.chain(before).collect();
                // Points near both ends, or near one, need room for their zones.
                let begins = [0.0].iter().chain(&shares);
                let has_room =
                    begins.zip(shares.iter().chain(&[1.0])).all(|(a, b)| (b - a) * track.length() >= 2.0 * zone);
                for share in shares.into_iter().filter(|_| has_room) {
                    ends.push(End { waypoint: i, share, zone: Some(zone), base_from_tcp: track.pose(share) });
                }
            }
            let zone = match effort[i] {
                Effort::Moved => waypoint.zone,
                Effort::SmallZone | Effort::Added | Effort::AddedMore => {
                    match (waypoint.zone, freedom[i].smaller_zone) {
                        (Some(programmed), Some(smaller)) => Some(programmed.min(smaller)),
                        (zone, _) => zone,
                    }
                }
                Effort::Stop => waypoint.zone.filter(|_| !freedom[i].stop),
            };
            ends.push(End { waypoint: i, share: 1.0, zone, base_from_tcp: waypoint.base_from_tcp });
        }
        let mut layout = Self { ends, nodes: Vec::new() };
        layout.find_nodes(shaper);
        layout
    }

    fn find_nodes(&mut self, shaper: &Shaper<'_>) {
        // The progress along the command of all its points, in running order, moved or not.
        #[allow(clippy::cast_precision_loss)]
        let progress = |end: usize, share: f64| end as f64 - 1.0 + share;
        let mut points: Vec<(f64, Option<(usize, bool)>)> = Vec::new();
        for (k, end) in self.ends.iter().enumerate() {
            let freedom = &shaper.freedom[end.waypoint];
            let arc = shaper.path.track(end.waypoint).and_then(super::Track::via);
            if let Some(via) = arc {
                points.push((progress(k, via), freedom.via.then_some((k, true))));
            }
            // A stop stays as it is; an added point is free.
            let moves = if end.share < 1.0 { true } else { freedom.end && end.zone.is_some() };
            points.push((progress(k, 1.0), moves.then_some((k, false))));
        }
        for three in points.windows(3) {
            if let (at, Some((end, is_via))) = three[1] {
                self.nodes.push(Node { end, is_via, hat: [three[0].0, at, three[2].0] });
            }
        }
    }

    /// The waypoints that are commanded, with the nodes moved.
    fn command(&self, shaper: &Shaper<'_>, moved: &[Vector3<f64>]) -> Result<Vec<Waypoint>, DriveError> {
        let mut command: Vec<Waypoint> = Vec::with_capacity(self.ends.len());
        let shifts = self.shifts(moved);
        for (end, [shift, via_shift]) in self.ends.iter().zip(&shifts) {
            let programmed = &shaper.waypoints[end.waypoint];
            // The program waits at the programmed end, and not at points that are added before it.
            let wait = if end.share < 1.0 { 0.0 } else { programmed.wait };
            let mut waypoint = Waypoint { zone: end.zone, wait, ..*programmed };
            if let Lead::Arc { via, .. } = &mut waypoint.lead {
                via.translation.vector += via_shift;
            }
            if end.share < 1.0 || *shift != Vector3::zeros() {
                waypoint.base_from_tcp = shifted(&end.base_from_tcp, shift);
                let flange = waypoint.base_from_tcp * programmed.flange_from_tcp.inverse();
                let near = if end.share < 1.0 {
                    command.last().map_or(programmed.motor, |last| last.motor)
                } else {
                    programmed.motor
                };
                let reached = shaper.robot.inverse_near_unlimited(&flange, &near);
                waypoint.motor = reached.map_err(|_| DriveError::Unreachable { waypoint: end.waypoint })?;
            }
            command.push(waypoint);
        }
        Ok(command)
    }

    /// Displacement of each end and of its circle point, m.
    fn shifts(&self, moved: &[Vector3<f64>]) -> Vec<[Vector3<f64>; 2]> {
        let mut shifts = vec![[Vector3::zeros(); 2]; self.ends.len()];
        for (node, moved) in self.nodes.iter().zip(moved) {
            shifts[node.end][usize::from(node.is_via)] = *moved;
        }
        shifts
    }
}

impl SearchResult {
    fn motions(&self, shaper: &Shaper<'_>) -> Vec<CommandedMotion> {
        let mut motions: Vec<CommandedMotion> = Vec::with_capacity(shaper.waypoints.len());
        let mut added = Vec::new();
        for end in &self.ends {
            if end.share < 1.0 {
                added.push(AddedPoint { share: end.share, base_from_tcp: shifted(&end.programmed, &end.end) });
            } else {
                motions.push(CommandedMotion {
                    end: end.end,
                    via: end.via,
                    zone: end.zone,
                    added: std::mem::take(&mut added),
                });
            }
        }
        motions
    }
}

impl Shaper<'_> {
    /// Drives the command of a layout with its nodes moved.
    fn drive(&self, layout: &Layout, moved: &[Vector3<f64>]) -> Result<Driven, DriveError> {
        let command = layout.command(self, moved)?;
        let of_programmed = |error| match error {
            DriveError::Unreachable { waypoint } => {
                DriveError::Unreachable { waypoint: layout.ends.get(waypoint).map_or(0, |end| end.waypoint) }
            }
            DriveError::TooLong => DriveError::TooLong,
        };
        let route = Route::new(self.robot, self.law, &command).map_err(of_programmed)?;
        let (route, times) = speed::timed(self.law, &route)?;
        let samples = Timeline::of(self.law, &route, &times).samples();
        let hats: Vec<[f64; 3]> = layout.nodes.iter().map(|node| node.hat).collect();
        let responses = smoothing::responses(self.law, &route, &times, &hats);
        let places: Vec<Vector3<f64>> = samples
            .par_iter()
            .map(|sample| {
                let tool = &command[sample.waypoint.min(command.len() - 1)].flange_from_tcp;
                log::tcp(self.robot, &sample.motor, tool)
            })
            .collect();
        let programmed = |sample: &DrivenSample| {
            let end = &layout.ends[sample.waypoint.min(layout.ends.len() - 1)];
            let before = sample.waypoint.checked_sub(1).and_then(|before| layout.ends.get(before));
            let begins = before.filter(|before| before.waypoint == end.waypoint).map_or(0.0, |before| before.share);
            (end.waypoint, begins + (end.share - begins) * sample.share)
        };
        let about =
            samples.iter().map(programmed).map(|(waypoint, share)| waypoint - usize::from(share < 0.5 && waypoint > 0));
        let about: Vec<usize> = about.collect();
        let off = samples
            .par_iter()
            .zip(&places)
            .map(|(sample, place)| {
                let (waypoint, _) = programmed(sample);
                self.counts(waypoint).then(|| self.path.offset(place, waypoint)).flatten()
            })
            .collect();
        let corners = (0..self.waypoints.len())
            .into_par_iter()
            .map(|i| {
                let near = self.counts(i) || self.counts(i + 1);
                near.then(|| nearest(&self.waypoints[i].base_from_tcp.translation.vector, &places, &about, i)).flatten()
            })
            .collect();
        let seconds = samples.last().map_or(0.0, |last| last.time);
        Ok(Driven { off, about, corners, responses, seconds })
    }

    /// The command that stops at the corners where this takes less time than the points that were added, and is as near to the path.
    fn with_quicker_stops(&self, found: SearchResult, effort: &mut [Effort]) -> Result<SearchResult, DriveError> {
        let is_added =
            |i: &usize| matches!(effort[*i], Effort::Added | Effort::AddedMore) && self.may(Effort::Stop, *i);
        let added: Vec<usize> = (0..effort.len()).filter(is_added).collect();
        if added.is_empty() {
            return Ok(found);
        }
        let mut stops = effort.to_vec();
        added.iter().for_each(|i| stops[*i] = Effort::Stop);
        let stopped = self.search(&Layout::new(self, &stops))?;
        let (with, without) = (&found.result, &stopped.result);
        let is_better = |i: &&usize| {
            without.at_waypoints[**i] <= with.at_waypoints[**i].max(self.allowed[**i])
                && without.seconds_at[**i] < with.seconds_at[**i]
        };
        let better: Vec<usize> = added.iter().filter(is_better).copied().collect();
        better.iter().for_each(|i| effort[*i] = Effort::Stop);
        match better.len() {
            0 => Ok(found),
            all if all == added.len() => Ok(stopped),
            _ => self.search(&Layout::new(self, effort)),
        }
    }

    /// Whether a measure can change anything at a waypoint that is passed.
    fn may(&self, effort: Effort, i: usize) -> bool {
        let freedom = &self.freedom[i];
        match effort {
            Effort::Moved => true,
            Effort::SmallZone => freedom.smaller_zone.is_some_and(|smaller| self.waypoints[i].zone > Some(smaller)),
            Effort::Added | Effort::AddedMore => {
                self.adds[i]
                    && freedom.added_zone.or(self.freedom.get(i + 1).and_then(|next| next.added_zone)).is_some()
            }
            Effort::Stop => freedom.stop && self.waypoints[i].zone.is_some(),
        }
    }

    /// Distances from a waypoint of the points that an effort adds on each side of it, m. Their zones, of this radius (m), do not overlap
    /// those of their neighbours.
    fn added(&self, effort: Effort, waypoint: usize, zone: f64) -> Vec<f64> {
        let distances = match effort {
            Effort::Added => ADDED_AT[0],
            Effort::AddedMore => ADDED_AT[1],
            Effort::Moved | Effort::SmallZone | Effort::Stop => &[],
        };
        let direction = |waypoint, share| self.path.track(waypoint).and_then(|track| track.tangent(share));
        let turn =
            direction(waypoint, 1.0).zip(direction(waypoint + 1, 0.0)).map_or(0.0, |(into, out)| (out - into).norm());
        let speed =
            self.waypoints[waypoint].feed.min(self.law.corner_speed(&Turn { tcp: turn, ..Turn::default() }, zone));
        let mut before = 0.0;
        let at = |distance: &f64| {
            let least = ADDED_LEAST * distance / distances[0];
            before = (distance * self.law.spread() * speed).max(least).max(before + 2.0 * zone * ROOM);
            before
        };
        distances.iter().map(at).collect()
    }

    /// Whether the distance from the segment to a waypoint counts.
    fn counts(&self, waypoint: usize) -> bool {
        self.path.track(waypoint).is_some() && self.freedom[waypoint].counts
    }

    fn result(&self, driven: &Driven) -> DrivenResult {
        let [mut at_waypoints, mut seconds_at] = [(); 2].map(|()| vec![0.0; self.waypoints.len()]);
        for (off, about) in driven.off.iter().zip(&driven.about) {
            let distance = off.map_or(0.0, |off| off.vector.norm());
            at_waypoints[*about] = f64::max(at_waypoints[*about], distance);
            seconds_at[*about] += SAMPLE_S;
        }
        for (at, corner) in at_waypoints.iter_mut().zip(&driven.corners) {
            *at = f64::max(*at, corner.map_or(0.0, |(vector, _)| vector.norm()));
        }
        let largest = at_waypoints.iter().copied().fold(0.0, f64::max);
        DrivenResult { largest, seconds: driven.seconds, at_waypoints, seconds_at }
    }

    /// Moves the nodes of a layout until the driven path keeps the tolerance, or the rounds are over.
    fn search(&self, layout: &Layout) -> Result<SearchResult, DriveError> {
        let mut moved = vec![Vector3::zeros(); layout.nodes.len()];
        let mut groups: Vec<Group> = self.groups(layout).into_iter().map(Group::new).collect();
        for _ in 0..ROUNDS {
            let driven = self.drive(layout, &moved)?;
            let result = self.result(&driven);
            let mut is_free = vec![false; layout.nodes.len()];
            for group in &mut groups {
                let over = |node: &Node| {
                    let about = layout.about(node);
                    result.at_waypoints[about] / self.allowed[about]
                };
                let worst = layout.nodes[group.nodes.clone()].iter().map(over).fold(0.0, f64::max);
                if worst < group.least {
                    (group.least, group.places) = (worst, moved[group.nodes.clone()].to_vec());
                }
                is_free[group.nodes.clone()].fill(worst > AIM);
            }
            if !is_free.contains(&true) {
                break;
            }
            let steps = self.step(&driven, &is_free);
            for ((node, moved), step) in layout.nodes.iter().zip(&mut moved).zip(steps) {
                let end = &layout.ends[node.end];
                let waypoint = &self.waypoints[end.waypoint];
                let most = 2.5 * self.law.spread() * waypoint.feed + waypoint.zone.unwrap_or(0.0);
                *moved = (*moved + STEP * step).cap_magnitude(most);
            }
        }
        for group in groups {
            moved[group.nodes].copy_from_slice(&group.places);
        }
        let result = self.result(&self.drive(layout, &moved)?);
        let shifts = layout.shifts(&moved);
        let ends = layout.ends.iter().zip(shifts).map(|(end, [shift, via])| EndFound {
            share: end.share,
            zone: end.zone,
            programmed: end.base_from_tcp,
            end: shift,
            via,
        });
        Ok(SearchResult { ends: ends.collect(), result })
    }

    /// Groups of nodes that are so near one another that the controller smooths them together.
    fn groups(&self, layout: &Layout) -> Vec<std::ops::Range<usize>> {
        let time = |i: usize| {
            let (before, node) = (&layout.nodes[i - 1], &layout.nodes[i]);
            let places = [before, node].map(|node| layout.ends[node.end].base_from_tcp.translation.vector);
            (places[1] - places[0]).norm() / self.waypoints[layout.ends[node.end].waypoint].feed
        };
        let mut groups: Vec<std::ops::Range<usize>> = Vec::new();
        for i in 0..layout.nodes.len() {
            match groups.last_mut() {
                Some(group) if time(i) <= self.law.settling() => group.end = i + 1,
                _ => groups.push(i..i + 1),
            }
        }
        groups
    }

    /// The next step of the free nodes, m.
    fn step(&self, driven: &Driven, is_free: &[bool]) -> Vec<Vector3<f64>> {
        let unknowns: Vec<usize> = (0..is_free.len()).filter(|i| is_free[*i]).collect();
        let reach = |i: usize| &driven.responses[unknowns[i]];
        // The first node with which each node shares a sample: the envelope of the normal equations.
        let mut first = 0;
        let starts: Vec<usize> = (0..unknowns.len())
            .map(|i| {
                while reach(first).end() <= reach(i).first && first < i {
                    first += 1;
                }
                first
            })
            .collect();
        let mut normal = Envelope::new(&starts);
        let mut wanted = vec![Vector3::zeros(); unknowns.len()];
        let mut add = |sample: usize, vector: &Vector3<f64>, across: &Matrix3<f64>, lowest: usize| {
            let aim = AIM * self.allowed[driven.about[sample]];
            let weight = (vector.norm() / aim).clamp(WEIGHED[0], WEIGHED[1]).powi(POWER);
            let active = (lowest..unknowns.len()).take_while(|i| reach(*i).first <= sample);
            let active: Vec<(usize, f64)> =
                active.map(|i| (i, reach(i).at(sample))).filter(|(_, h)| *h > 0.0).collect();
            for (k, (i, h)) in active.iter().enumerate() {
                wanted[*i] -= weight * *h * (across * vector);
                for (j, g) in &active[..=k] {
                    normal.add(*i, *j, &(across * (weight * h * g)));
                }
            }
        };
        let mut lowest = 0;
        for (sample, off) in driven.off.iter().enumerate() {
            while lowest < unknowns.len() && reach(lowest).end() <= sample {
                lowest += 1;
            }
            let Some(off) = off else { continue };
            let across = match (off.tangent, off.vector.try_normalize(1e-12)) {
                (Some(tangent), _) => Matrix3::identity() - tangent * tangent.transpose(),
                (None, Some(out)) => out * out.transpose(),
                (None, None) => continue,
            };
            add(sample, &off.vector, &across, lowest);
        }
        let mut lowest = 0;
        for (vector, sample) in driven.corners.iter().flatten() {
            while lowest < unknowns.len() && reach(lowest).end() <= *sample {
                lowest += 1;
            }
            if let Some(out) = vector.try_normalize(1e-12) {
                add(*sample, vector, &(out * out.transpose()), lowest);
            }
        }
        normal.damp(DAMPING);
        let solved = normal.solve(wanted);
        let mut steps = vec![Vector3::zeros(); is_free.len()];
        for (i, step) in unknowns.into_iter().zip(solved) {
            steps[i] = step;
        }
        steps
    }
}

impl Layout {
    /// The programmed waypoint that is nearest to a node along the path.
    fn about(&self, node: &Node) -> usize {
        let end = &self.ends[node.end];
        end.waypoint - usize::from(end.share < 0.5 && end.waypoint > 0)
    }
}

/// The vector from a point to the driven path between the samples near a waypoint, and the sample there.
fn nearest(
    place: &Vector3<f64>,
    places: &[Vector3<f64>],
    about: &[usize],
    waypoint: usize,
) -> Option<(Vector3<f64>, usize)> {
    let from = about.partition_point(|about| *about < waypoint).saturating_sub(1);
    let to = (about.partition_point(|about| *about <= waypoint) + 1).min(places.len());
    nearest_between(place, &places[from..to.max(from)]).map(|(vector, sample)| (vector, from + sample))
}

fn shifted(pose: &Pose, shift: &Vector3<f64>) -> Pose {
    Pose::from_parts(Translation3::from(pose.translation.vector + shift), pose.rotation)
}
