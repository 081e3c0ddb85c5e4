//! The path that the controller drives and the loaded arm takes, sampled over time.

use super::compared::Comparison;
use super::context::Context;
use super::deviation::Commanded;
use super::laws::Law;
use super::load::PointLoad;
use super::original_loads::OriginalLoads;
use super::parallelism::Parallelism;
use super::point::Point;
use super::segment::{Kind, Segment, waypoint_targets};
use super::solve::{Solver, controller_motor};
use super::{
    Corrected, DrivenFigures, DrivenSummary, KeptReason, Options, PathDeviation, Prepared, RAPID_MM_S, Shared, frames,
};
use crate::cell::Cell;
use crate::drive::{DriveError, DrivenSample, Driver, Lead, PathLaw, SAMPLE_S, Waypoint, drive};
use crate::equilibrium::{Arm, EquilibriumError, Setting, WarmStart};
use crate::program::{Passing, Program, Target};
use crate::robot::{Joints, Pose, Robot};
use crate::text::{Diagnostic, Severity};
use nalgebra::{Rotation3, Translation3, Vector3};
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

/// Number of samples of which the first and the last are solved, so that those between them need no others.
const TOGETHER: usize = 256;
/// Number of samples that a program which is held as a whole solves at once: some ten megabytes.
const BATCH: usize = 64 * TOGETHER;
/// Largest distance along a driven path between two solved equilibria, m: over it, a deflection of 1 mm of an arm of 1 m bends by
/// 0.01 µm.
const SOLVED_EVERY: f64 = 1e-2;
/// Most samples between two solved equilibria: a quarter of a second.
const MOST_BETWEEN: usize = 64;
/// Number of feeds of a cutter, up to its largest one, for which the force is computed. Half a step is 3 % of the chip load, which is below
/// the accuracy of the coefficients of a material.
const FEED_STEPS: usize = 16;

/// The moments at which a driven path is sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sampling {
    /// Every [`SAMPLE_S`].
    All,
    /// Only as many that the path between two of them is known.
    Sparse,
}

/// A program as waypoints of its controller.
#[derive(Clone, Debug, Default)]
pub struct Course {
    /// Ends of its motions.
    pub waypoints: Vec<Waypoint>,
    /// Index of the target of each waypoint: it is the target, or a point on the segment to it.
    pub(super) targets: Vec<usize>,
    /// Share of the segment to that target; 1 at the target.
    shares: Vec<f64>,
    /// Number of waypoints before these, which are no longer needed.
    first: usize,
    /// Speed of the last motion that has one, m/s.
    feed: Option<f64>,
    /// Number of waypoints that the robot passes in a zone of unknown size: they count as stops.
    unstated: usize,
    /// Lines and arcs of unknown speed: they get the speed of the motion before, or of the first one after them.
    without_speed: usize,
    /// Waypoints with a zone at which the controller stops, because the program waits; the word of the statement after the first one.
    waits: Found<&'static str>,
    /// Waypoints whose zone is larger than half the distance to a neighbouring one.
    overlaps: Found<()>,
    /// Waypoints that are passed after less time than the controller needs to plan a motion; the shortest time, s.
    short: Found<f64>,
    /// Where the last waypoint is in the program, if its neighbours are not all known yet.
    last: Option<Diagnostic>,
}

/// Waypoints about which a note says something.
#[derive(Clone, Debug, Default)]
struct Found<T> {
    count: usize,
    /// The one that the note names: its place in the program, and what is said about it.
    named: Option<(Diagnostic, T)>,
}

impl<T> Found<T> {
    /// Adds a waypoint; the note names it instead of the one so far if that is not `better`.
    fn add(&mut self, found: T, place: &dyn Fn() -> Diagnostic, better: impl Fn(&T, &T) -> bool) {
        self.count += 1;
        if self.named.as_ref().is_none_or(|(_, named)| better(&found, named)) {
            self.named = Some((place(), found));
        }
    }
}

/// One moment of the driven and loaded path, in the target's work object.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct LoadedSample {
    /// Time since the start, s.
    pub time: f64,
    /// Ordinal of the target at the end of the motion.
    pub target: u32,
    /// Actual TCP, m.
    pub wobj_from_tcp: Pose,
    /// Actual speed of the TCP, m/s.
    pub feed: f64,
    /// Force on the tool, N.
    pub force: Vector3<f64>,
    /// Index of the waypoint at the end of the segment.
    pub(super) waypoint: usize,
    /// Actual TCP in the robot's base, m.
    pub(super) base_from_tcp: Vector3<f64>,
}

/// The driven and loaded path of a program.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct LoadedPath {
    /// The samples in running order, every [`SAMPLE_S`](crate::drive::SAMPLE_S).
    pub samples: Vec<LoadedSample>,
    /// Notes about assumptions.
    pub notes: Vec<Diagnostic>,
}

impl LoadedSample {
    /// Position of the TCP, mm, and its orientation, scalar first.
    #[must_use]
    pub fn position_and_quat(&self) -> ([f64; 3], [f64; 4]) {
        frames::millimetres(&self.wobj_from_tcp)
    }
}

impl Course {
    /// For each waypoint, whether the distance of the driven path from the segment to it counts. If targets cut, these are the motions that
    /// are not faster than the fastest cut. The cutter may be in the material in them, although [cut] does not describe their force, as in
    /// a plunge.
    pub(super) fn counting(&self, prepared: &Prepared) -> Vec<bool> {
        let cuts = |(at, i): (usize, &usize)| prepared.points[*i].cuts().then(|| self.waypoints[at].feed);
        let fastest = self.targets.iter().enumerate().filter_map(cuts).max_by(f64::total_cmp);
        self.waypoints.iter().map(|waypoint| fastest.is_none_or(|fastest| waypoint.feed <= fastest)).collect()
    }

    /// The ends of a program's motions; zones in SI.
    ///
    /// # Errors
    /// A target whose pose is unknown, external axes that move the base or the part, a motion without a speed.
    pub fn new(program: &Program, cell: &Cell, prepared: &Prepared) -> Result<Self, Vec<Diagnostic>> {
        let mut course = Self::default();
        course.extend(program, cell, prepared, 0)?;
        course.end(program, cell);
        Ok(course)
    }

    /// Adds the ends of the motions of a program, or of its next chunk, whose own text begins at `from`. A zone at the last one may still
    /// turn out to be a stop.
    pub(super) fn extend(
        &mut self,
        program: &Program,
        cell: &Cell,
        prepared: &Prepared,
        from: usize,
    ) -> Result<(), Vec<Diagnostic>> {
        let unstated_zone = cell.controller.path.and_then(|path| path.zone);
        let mut before = None;
        let mut passing = Passing::Stop;
        for i in waypoint_targets(program) {
            let (target, point) = (&program.targets[i], &prepared.points[i]);
            let refuse = |message: &str, help: &str| vec![program.error_at(target, "path.target", message).help(help)];
            if let Some(why) = point.unsolved.filter(|why| *why != KeptReason::PredecessorUnknown) {
                let message = format!("the path cannot be followed beyond this target: {why}");
                return Err(refuse(&message, "the path that a controller drives needs every target of the program"));
            }
            if prepared.mount(i).setting.held || point.moved.is_some() {
                let message =
                    "the path that a controller drives is not computed for external axes and stationary tools";
                return Err(refuse(message, "leave out --path, --log and --max-path-error for this program"));
            }
            // Joint motions at a share of the axis speeds have no speed of the TCP: they take that of the path motion before, or of the
            // first one that follows. They do not cut.
            let programmed = |target: &Target| target.feed_mm_s.map(|mm_s| 1e-3 * mm_s).filter(|feed| *feed > 0.0);
            let is_joint = Kind::of(program, i) == Kind::Joint;
            let is_first = self.waypoints.is_empty();
            self.without_speed += usize::from(!is_joint && !target.rapid && !is_first && programmed(target).is_none());
            let rapid = target.rapid.then_some(1e-3 * RAPID_MM_S);
            let feed = programmed(target).or(rapid).or(self.feed);
            self.feed = feed.or_else(|| program.targets[i..].iter().find_map(programmed));
            let Some(feed) = self.feed else {
                return Err(refuse("no motion of the program has a speed", "the path over time needs a speed"));
            };
            if before.is_none_or(|before| !program.is_worded_like(before, i)) {
                passing = program.passing(i);
            }
            let zone = match passing {
                Passing::Stop => None,
                Passing::Zone(mm) => Some(1e-3 * mm),
                Passing::Unstated => {
                    self.unstated += usize::from(unstated_zone.is_none());
                    unstated_zone
                }
            };
            let setting = prepared.setting(i);
            let in_base = |pose: &Pose| setting.base_from_wobj * pose;
            let lead = match Kind::of(program, i) {
                Kind::Line => Lead::Line,
                Kind::Arc => Lead::Arc(in_base(&prepared.points[i - 1].wobj_from_tcp)),
                Kind::Joint | Kind::Point => Lead::Joints,
            };
            let waypoint = Waypoint {
                lead,
                base_from_tcp: in_base(&point.wobj_from_tcp),
                flange_from_tcp: setting.tool.flange_from_tcp,
                motor: point.motor,
                feed,
                zone,
            };
            let waits = match before {
                Some(before) => program.waits_between(before, i),
                None if is_first => None,
                None => program.waits_before(i, from),
            };
            self.push(waypoint, i, 1.0);
            self.look(program, cell, waits);
            before = Some(i);
        }
        self.last = self.targets.last().map(|last| program.error_at(&program.targets[*last], "", ""));
        Ok(())
    }

    /// Looks at the waypoint before the last one, whose neighbours are known now. `waits` is the word of a statement between both at which
    /// the controller waits.
    fn look(&mut self, program: &Program, cell: &Cell, waits: Option<&'static str>) {
        let Some(at) = self.waypoints.len().checked_sub(2) else { return };
        let (known, target) = (self.last.take(), self.targets[at]);
        let place = || known.clone().unwrap_or_else(|| program.error_at(&program.targets[target], "", ""));
        // The controller does not round a corner if it does not know the next motion in time.
        if let Some(word) = waits.filter(|_| self.waypoints[at].zone.is_some()) {
            self.waits.add(word, &place, |_, _| false);
            self.waypoints[at].zone = None;
        }
        if at == 0 {
            return;
        }
        let room = 0.5 * self.distance(at).min(self.distance(at + 1));
        if self.waypoints[at].zone.is_some_and(|zone| room > 0.0 && zone > room) {
            self.overlaps.add((), &place, |(), ()| false);
        }
        self.time(cell, at, &place);
    }

    /// Looks at the last waypoint, which no further one follows.
    pub(super) fn end(&mut self, program: &Program, cell: &Cell) {
        if let Some((at, target)) =
            self.waypoints.len().checked_sub(1).zip(self.targets.last().copied()).filter(|(at, _)| *at > 0)
        {
            self.time(cell, at, &|| program.error_at(&program.targets[target], "", ""));
        }
    }

    /// Looks at the time of the motion to a waypoint.
    fn time(&mut self, cell: &Cell, at: usize, place: &dyn Fn() -> Diagnostic) {
        let waypoint = &self.waypoints[at];
        let Some(planning) = cell.controller.path.and_then(|path| path.planning) else { return };
        let seconds = self.distance(at) / waypoint.feed;
        if waypoint.zone.is_some() && matches!(waypoint.lead, Lead::Line) && seconds < planning {
            self.short.add(seconds, place, |seconds, shortest| seconds < shortest);
        }
    }

    fn push(&mut self, waypoint: Waypoint, target: usize, share: f64) {
        self.waypoints.push(waypoint);
        self.targets.push(target);
        self.shares.push(share);
    }

    /// Adds these waypoints to the course of the corrected program, with its commands and the inserted targets.
    pub(super) fn correct(
        &self,
        Context { program, cell, .. }: Context<'_>,
        prepared: &Prepared,
        commanded: &Commanded,
        course: &mut Self,
    ) {
        let robot = &cell.arm.robot;
        let unstated_zone = cell.controller.path.and_then(|path| path.zone);
        for (waypoint, &i) in self.waypoints.iter().zip(&self.targets) {
            let base_from_wobj = prepared.base_from_wobj(i);
            let first = commanded.nodes.partition_point(|node| node.before < i);
            for node in commanded.nodes[first..].iter().take_while(|node| node.before == i) {
                let near = course.waypoints.last().map_or(waypoint.motor, |last: &Waypoint| last.motor);
                let motor = controller_motor(robot, prepared.setting(i), &node.commanded, &near).unwrap_or(near);
                let zone = match program.inserted_passing(i) {
                    Passing::Stop => None,
                    Passing::Zone(mm) => Some(1e-3 * mm),
                    Passing::Unstated => unstated_zone,
                };
                let lead = node.via.map_or(Lead::Line, |via| Lead::Arc(base_from_wobj * via));
                let base_from_tcp = base_from_wobj * node.commanded;
                course.push(Waypoint { lead, base_from_tcp, motor, zone, ..*waypoint }, i, node.share);
            }
            let lead = match waypoint.lead {
                Lead::Arc(_) => Lead::Arc(base_from_wobj * commanded.poses[i - 1]),
                lead => lead,
            };
            let base_from_tcp = base_from_wobj * commanded.poses[i];
            course.push(Waypoint { lead, base_from_tcp, motor: commanded.steps[i].motor, ..*waypoint }, i, 1.0);
        }
    }

    /// Adds the waypoints of another course.
    pub(super) fn append(&mut self, other: &Self) {
        self.waypoints.extend_from_slice(&other.waypoints);
        self.targets.extend_from_slice(&other.targets);
        self.shares.extend_from_slice(&other.shares);
    }

    /// The waypoints after the first ones.
    pub(super) fn behind(&self, count: usize) -> Self {
        let (waypoints, targets) = (self.waypoints[count..].to_vec(), self.targets[count..].to_vec());
        Self { waypoints, targets, shares: self.shares[count..].to_vec(), first: self.first + count, ..Self::default() }
    }

    /// The number of a waypoint in the whole program.
    pub(super) fn ordinal(&self, waypoint: usize) -> usize {
        self.first + waypoint
    }

    /// The target at which the segment to a waypoint begins, and the share of the segment to the waypoint's target at that start.
    fn begins(&self, waypoint: usize) -> (usize, f64) {
        let (before, target) = (waypoint - 1, self.targets[waypoint]);
        if self.targets[before] != target {
            return (self.targets[before], 0.0);
        }
        (self.targets[self.ends_before(waypoint)], self.shares[before])
    }

    /// The waypoint at the target before that of another waypoint.
    fn ends_before(&self, waypoint: usize) -> usize {
        self.targets[..waypoint].partition_point(|other| *other < self.targets[waypoint]).saturating_sub(1)
    }

    /// Forgets the first waypoints.
    pub(super) fn forget(&mut self, count: usize) {
        self.waypoints.drain(..count);
        self.targets.drain(..count);
        self.shares.drain(..count);
        self.first += count;
    }

    /// Whether the segment to a waypoint continues the one before: with its tool, work object and speed, and a continuous load. The load of a
    /// cut from stock changes along a segment.
    fn goes_on(&self, prepared: &Prepared, waypoint: usize) -> bool {
        let [before, here] = [waypoint - 1, waypoint].map(|at| &prepared.points[self.targets[at]]);
        before.setting == here.setting
            && self.waypoints[waypoint - 1].feed.total_cmp(&self.waypoints[waypoint].feed).is_eq()
            && before.milled.is_none()
            && here.milled.is_none()
            && before.part.is_none()
            && here.part.is_none()
            && before.load.is_near(&here.load)
    }

    /// Notes about the course, each once.
    pub(super) fn notes(&self, program: &Program, cell: &Cell) -> Vec<Diagnostic> {
        let name = program.sources.first().map_or("", |source| &source.name);
        let note = |message: String, help: &str| {
            Diagnostic::error("path.assumed", name, message).severity(Severity::Note).help(help)
        };
        let mut notes = Vec::new();
        if cell.controller.path.is_none() {
            let hidden = 1e3 * self.widest_corner_cut();
            let message = format!(
                "the cell has no [controller.path]: corners are taken as written, though the zones of this program may round them by up to {hidden:.2} mm"
            );
            notes.push(note(message, "record the axes while the program runs: deflex identify --log PROGRAM LOG.csv"));
        }
        if self.unstated > 0 {
            let (points, are) = if self.unstated == 1 { ("point", "is") } else { ("points", "are") };
            let message = format!(
                "{} {points} of the path {are} passed, and the program does not say how near: {are} taken as stops",
                self.unstated
            );
            notes.push(note(message, "give the radius in the cell: [controller.path] zone_mm"));
        }
        if self.without_speed > 0 {
            let motions = if self.without_speed == 1 { "motion" } else { "motions" };
            let message = format!(
                "the speed of {} {motions} is known only at run time: deflex uses that of the motion before",
                self.without_speed
            );
            notes.push(note(message, "write the speed into the program where the path and the run time matter"));
        }
        if let Some(missing) =
            cell.controller.path.map(|path| undeclared(&path.law)).filter(|missing| !missing.is_empty())
        {
            let message = format!(
                "[controller.path] does not state {}: deflex computes without it, and a real controller cuts corners by more",
                missing.join(", ")
            );
            notes.push(note(message, "find the law of your controller: deflex identify --log PROGRAM LOG.csv"));
        }
        if let Some(path) = cell.controller.path {
            notes.extend(path.axis_acceleration.and_then(|limits| self.fast_axes(program, cell, &limits)));
            notes.extend(path.planning.and_then(|planning| self.short_motions(planning)));
            notes.extend(self.cut_zones());
            notes.extend(self.corner_failures());
        }
        notes
    }

    /// Straight distance of the motion to a waypoint, m.
    fn distance(&self, waypoint: usize) -> f64 {
        let place = |i: usize| self.waypoints[i].base_from_tcp.translation.vector;
        (place(waypoint) - place(waypoint - 1)).norm()
    }

    /// Warns of motions that end before the controller has planned the next one (s): it slows down or stops there.
    fn short_motions(&self, planning: f64) -> Option<Diagnostic> {
        let Found { count, named } = &self.short;
        let (place, seconds) = named.as_ref()?;
        let (what, take) = if *count == 1 { ("motion", "takes") } else { ("motions", "take") };
        let message = format!(
            "{count} {what} {take} less than the {planning} s that the controller needs to plan one: the arm will stutter; the shortest takes \
             {seconds:.4} s"
        );
        let warning = Diagnostic { code: "path.stutter", message, severity: Severity::Warning, ..place.clone() };
        Some(warning.help("put the points further apart, or lower the feed"))
    }

    /// Warns of corners that the controller cannot round, because the program waits before the next motion is known.
    fn corner_failures(&self) -> Option<Diagnostic> {
        let (place, word) = self.waits.named.as_ref()?;
        let more = match self.waits.count - 1 {
            0 => String::new(),
            more => format!(", and at {more} more"),
        };
        let message = format!(
            "the program waits after this motion ({word}) before the next one is known: the controller comes to rest here in place of \
             rounding the corner (corner path failure){more}"
        );
        let warning = Diagnostic { code: "path.corner-failure", message, severity: Severity::Warning, ..place.clone() };
        Some(warning.help("write a stop where the arm is to wait, or move the statement"))
    }

    /// Warns of segments on which an axis would have to accelerate by more than its limit (°/s²). Lead and lag of the motors are not part
    /// of the motion that the controller plans.
    fn fast_axes(&self, program: &Program, cell: &Cell, limits: &Joints) -> Option<Diagnostic> {
        let law = PathLaw { axis_lead: Joints::zeros(), lag: Joints::zeros(), ..cell.controller.path?.law };
        let samples = drive(&cell.arm.robot, &law, &self.waypoints).ok()?;
        let axes: Vec<[f64; 6]> =
            samples.iter().map(|sample| cell.arm.robot.axes_deg_from_motor(&sample.motor)).collect();
        // For each segment the largest share of a limit, with its axis and acceleration.
        let mut worst: BTreeMap<usize, (f64, usize, f64)> = BTreeMap::new();
        for k in 1..axes.len().saturating_sub(1) {
            for axis in 0..6 {
                let bend = axes[k + 1][axis] - 2.0 * axes[k][axis] + axes[k - 1][axis];
                let acceleration = (bend / SAMPLE_S.powi(2)).abs();
                let share = acceleration / limits[axis];
                let known = worst.entry(samples[k].waypoint).or_default();
                if share > known.0 {
                    *known = (share, axis, acceleration);
                }
            }
        }
        worst.retain(|_, (share, ..)| *share > 1.0);
        let (&waypoint, &(_, axis, acceleration)) = worst.iter().max_by(|a, b| a.1.0.total_cmp(&b.1.0))?;
        let message = format!(
            "axis {} would have to accelerate by {acceleration:.0} °/s² on the path to this target, and its limit is {:.0} °/s²; this \
             is so on {} of {} paths",
            axis + 1,
            limits[axis],
            worst.len(),
            self.waypoints.len().saturating_sub(1)
        );
        let warning = self.at(program, waypoint, "path.axis-acceleration", message).severity(Severity::Warning);
        Some(warning.help("lower the feed there, make the zone larger, or lead the tool past a singular posture"))
    }

    /// Notes how many zones are larger than half the distance to a neighbouring point. Controllers limit them to that: "Interpolation with
    /// overlapping position zones", RAPID Reference Manual, Motion and I/O Principles.
    fn cut_zones(&self) -> Option<Diagnostic> {
        let Found { count, named } = &self.overlaps;
        let (place, ()) = named.as_ref()?;
        let (zones, are, them) = if *count == 1 { ("zone", "is", "it") } else { ("zones", "are", "them") };
        let message = format!(
            "{count} {zones} {are} larger than half the distance to a neighbouring point: the controller cuts {them} to that"
        );
        let note = Diagnostic { code: "path.zones-overlap", message, severity: Severity::Note, ..place.clone() };
        Some(note.help("the driven path counts the zones as the controller cuts them"))
    }

    /// Why a path along it cannot be computed.
    pub(super) fn refused(&self, program: &Program, error: DriveError) -> Vec<Diagnostic> {
        match error {
            DriveError::Unreachable { waypoint } => {
                let message = "the arm does not reach every position on the path to this target".to_owned();
                self.refused_at(program, waypoint, message, "move the target or the part")
            }
            DriveError::TooLong => {
                self.refused_at(program, 0, "the program runs for more than a day".to_owned(), "split the program")
            }
        }
    }

    fn refused_at(&self, program: &Program, waypoint: usize, message: String, help: &str) -> Vec<Diagnostic> {
        vec![self.at(program, waypoint, "path.target", message).help(help)]
    }

    /// A diagnostic about a waypoint.
    fn at(&self, program: &Program, waypoint: usize, code: &'static str, message: String) -> Diagnostic {
        program.error_at(&program.targets[self.targets[waypoint]], code, message)
    }

    /// Largest distance from a corner because of zones alone, m: with a parabola over the whole zone.
    fn widest_corner_cut(&self) -> f64 {
        let direction = |from: &Waypoint, to: &Waypoint| {
            let displacement = to.base_from_tcp.translation.vector - from.base_from_tcp.translation.vector;
            displacement.try_normalize(1e-9).map(|direction| (direction, displacement.norm()))
        };
        let corners = self.waypoints.windows(3).filter_map(|three| {
            let (before, after) = (direction(&three[0], &three[1])?, direction(&three[1], &three[2])?);
            let radius = three[1].zone?.min(0.5 * before.1.min(after.1));
            Some(0.25 * radius * (after.0 - before.0).norm())
        });
        corners.fold(0.0, f64::max)
    }
}

/// The keys of a law that are not declared.
fn undeclared(law: &PathLaw) -> Vec<&'static str> {
    let keys = [
        ("smoothing_s", law.smoothing.iter().all(|width| *width <= 0.0)),
        ("acceleration_mm_s2", law.acceleration.is_infinite()),
        ("corner_acceleration_mm_s2", law.corner_acceleration.is_infinite()),
    ];
    keys.into_iter().filter_map(|(key, is_missing)| is_missing.then_some(key)).collect()
}

/// The waypoint of the original for each waypoint of another program: that in the list, or the one with the same number beyond its end.
pub(super) fn original_waypoint(origins: &[usize]) -> impl Fn(usize) -> usize + Sync + '_ {
    |waypoint| origins.get(waypoint).copied().unwrap_or(waypoint)
}

/// The original of a corrected program, by whose path it is judged.
pub(super) struct Original<'a> {
    pub(super) program: &'a Program,
    /// For each waypoint of the corrected program, the waypoint of the original on whose segment it is; `None` if both have the same
    /// waypoints.
    pub(super) waypoints: Option<Vec<usize>>,
}

/// Replaces the path as written by the path that the controller drives, if the cell has the law of its controller: the rows'
/// [`path`](super::Row::path), and the run time.
///
/// # Errors
/// A note with the reason why that path cannot be computed. Targets without a solution have their own messages.
pub(super) fn follow_law(
    corrected: &mut Corrected,
    prepared: &mut Prepared,
    context: Context<'_>,
    original: Option<Original<'_>>,
) -> Result<(), Vec<Diagnostic>> {
    let Context { program, cell, options, .. } = context;
    if !corrected.failures.is_empty() {
        return Err(Vec::new());
    }
    let known = original.as_ref().and_then(|original| original.waypoints.as_deref());
    let waypoint_of = original_waypoint(known.unwrap_or_default());
    let mut judged = || -> Result<(DrivenSegments, Vec<Diagnostic>), Vec<Diagnostic>> {
        let (path, segments);
        match &original {
            Some(original) => {
                let prepared = Prepared::new(original.program, cell, options)?;
                let course = Course::new(original.program, cell, &prepared)?;
                let targets = OriginalLoads::targets(original.program, program, &waypoint_of);
                let loads = Some(OriginalLoads { prepared: &prepared, targets: &targets });
                let mut own = Prepared::of(Context { loads, ..context })?;
                let driven = Course::new(program, cell, &own)?;
                path = loaded_along(&mut own, driven, context, Sampling::Sparse)?;
                segments = driven_segments(&prepared, &course, &cell.arm.robot, &path, &waypoint_of);
            }
            None => {
                let course = Course::new(program, cell, prepared)?;
                path = loaded_along(prepared, course, context, Sampling::Sparse)?;
                segments = driven_segments(prepared, &path.course, &cell.arm.robot, &path, &waypoint_of);
            }
        }
        Ok((segments, path.course.notes(program, cell)))
    };
    let (driven, notes) = judged().map_err(|errors| errors.into_iter().take(1).map(as_written).collect::<Vec<_>>())?;
    let targets = waypoint_targets(program);
    // The deviation on a segment is reported once, at its end.
    let is_last = |waypoint: usize| waypoint + 1 >= targets.len() || waypoint_of(waypoint + 1) != waypoint_of(waypoint);
    let deviation = |waypoint: usize| match driven.segments[waypoint_of(waypoint)] {
        // For the segment to an inserted target, too.
        Some(_) if original.is_some() && !is_last(waypoint) => Some(PathDeviation::default()),
        deviation => deviation.filter(|_| is_last(waypoint)),
    };
    let mut first = 0;
    for (waypoint, target) in targets.iter().map(|&i| &program.targets[i]).enumerate() {
        if !target.is_end() {
            continue;
        }
        // The chords of an arc belong to the row of its end.
        let own = std::mem::replace(&mut first, waypoint + 1)..=waypoint;
        let at = corrected.rows.binary_search_by_key(&target.ordinal, |row| row.target);
        let Some(row) = at.ok().map(|at| &mut corrected.rows[at]).filter(|row| row.is_solved()) else { continue };
        if let Some(segments) = own.map(deviation).collect::<Option<Vec<PathDeviation>>>() {
            row.path = segments.into_iter().reduce(PathDeviation::and);
        }
        // The points of a corrected program are moved on purpose. The error is the distance at which the path passes the point of the
        // original, and the distance from the original's path at an inserted point.
        let passes = match is_last(waypoint) {
            true => driven.missed[waypoint_of(waypoint)],
            false => driven.passed.get(waypoint).copied().flatten(),
        };
        if let Some(off) = passes.filter(|_| original.is_some()) {
            row.error_mm = (1e3 * off).into();
        }
    }
    corrected.driven = Some(DrivenSummary { programmed: driven.figures, corrected: None, tolerance_mm: None });
    corrected.notes.extend(notes);
    Ok(())
}

/// The driven path of a corrected program, compared with the programmed one.
pub(super) struct Judged {
    after: DrivenSegments,
    /// Index of the target at the end of each segment.
    targets: Vec<usize>,
    pub(super) summary: DrivenSummary,
    pub(super) notes: Vec<Diagnostic>,
}

impl Judged {
    /// Puts the deviations of the driven segments into a column with one value for each target.
    pub(super) fn fill(&self, paths: &mut [Option<PathDeviation>]) {
        for (segment, &target) in self.after.segments.iter().zip(&self.targets) {
            paths[target] = segment.or(paths[target]);
        }
    }
}

/// Drives a program along its own targets and along its corrected ones.
///
/// # Errors
/// A note with the reason why that path cannot be computed.
pub(super) fn judge_corrected(
    context: Context<'_>,
    prepared: &mut Prepared,
    commanded: &Commanded,
) -> Result<Judged, Vec<Diagnostic>> {
    let Context { program, cell, .. } = context;
    let mut judged = || -> Result<Judged, Vec<Diagnostic>> {
        let robot = &cell.arm.robot;
        let course = Course::new(program, cell, prepared)?;
        let path = loaded_along(prepared, course, context, Sampling::Sparse)?;
        let before = driven_segments(prepared, &path.course, robot, &path, &|waypoint| waypoint);
        let course = path.course;
        let mut sent = Course::default();
        course.correct(context, prepared, commanded, &mut sent);
        let corrected = loaded_along(prepared, sent, context, Sampling::Sparse)?;
        let mut waypoint = 0;
        let origin = |target: &usize| {
            while course.targets[waypoint] < *target {
                waypoint += 1;
            }
            waypoint
        };
        let origins: Vec<usize> = corrected.course.targets.iter().map(origin).collect();
        let after = driven_segments(prepared, &course, robot, &corrected, &original_waypoint(&origins));
        let summary = DrivenSummary { programmed: before.figures, corrected: Some(after.figures), tolerance_mm: None };
        let notes = course.notes(program, cell);
        Ok(Judged { after, targets: course.targets, summary, notes })
    };
    judged().map_err(|errors| errors.into_iter().take(1).map(as_written).collect())
}

/// A note why corners are taken as written although the cell has the law of its controller.
pub(super) fn as_written(error: Diagnostic) -> Diagnostic {
    let message = format!("corners are taken as written: {}", error.message);
    Diagnostic { code: "path.as-written", message, severity: Severity::Note, ..error }
}

/// The path that the cell's controller drives along a program, with the arm under the forces that act there.
///
/// # Errors
/// As [`Prepared::new`] and [`Course::new`]; a point of the path is out of reach or has no equilibrium.
///
/// # Examples
/// ```no_run
/// use deflex::correct::{Options, loaded_path};
/// use deflex::{cell::Cell, program::rapid, text::Source};
///
/// let cell = Cell::read(&Source::new("cell.toml", std::fs::read("samples/slot/cell.toml")?))?;
/// let program = rapid::read(vec![Source::new("slot.mod", std::fs::read("samples/slot/slot.mod")?)], vec![])?;
/// let path = loaded_path(&program, &cell, &Options::default())?;
/// println!("{:.1} s", path.samples.last().map_or(0.0, |sample| sample.time));
/// # Ok::<(), deflex::text::Diagnostics>(())
/// ```
pub fn loaded_path(program: &Program, cell: &Cell, options: &Options) -> Result<LoadedPath, Vec<Diagnostic>> {
    let mut prepared = Prepared::new(program, cell, options)?;
    let course = Course::new(program, cell, &prepared)?;
    let path = loaded_along(&mut prepared, course, Context::whole(program, cell, options), Sampling::All)?;
    Ok(LoadedPath { samples: path.samples, notes: path.course.notes(program, cell) })
}

/// The driven path of the loaded arm along a course.
pub(super) struct LoadedCourse {
    pub(super) course: Course,
    pub(super) samples: Vec<LoadedSample>,
}

/// The same along a course of a prepared program.
pub(super) fn loaded_along(
    prepared: &mut Prepared,
    course: Course,
    context: Context<'_>,
    sampling: Sampling,
) -> Result<LoadedCourse, Vec<Diagnostic>> {
    let program = context.program;
    let mut motion = DrivenMotion::along(course, context, prepared, sampling)?;
    let count = motion.samples.len();
    let mut samples: Vec<LoadedSample> = Vec::with_capacity(count);
    for from in (0..count).step_by(BATCH) {
        let batch = motion.load(prepared, from..count.min(from + BATCH), Parallelism::Threads);
        samples.extend(batch.map_err(|NoEquilibrium { waypoint, error }| {
            let message = format!("the loaded arm has no equilibrium on the path to this target: {error}");
            motion.course.refused_at(program, waypoint, message, "check the forces and the stiffness of the cell")
        })?);
    }
    let targets: Vec<u32> = (0..count).map(|i| program.targets[motion.target(i)].ordinal).collect();
    for (sample, target) in samples.iter_mut().zip(targets) {
        sample.target = target;
    }
    // The mean speed over the step before and the step after; a change of work object is no motion.
    let speed = |from: &LoadedSample, to: &LoadedSample| {
        let displacement = to.wobj_from_tcp.translation.vector - from.wobj_from_tcp.translation.vector;
        (to.time > from.time).then(|| displacement.norm() / (to.time - from.time))
    };
    let wobj = |i: usize| prepared.points[motion.target(i)].setting;
    for i in 0..samples.len() {
        let neighbour = |j: Option<usize>| j.filter(|j| *j < samples.len() && wobj(*j) == wobj(i));
        let before = neighbour(i.checked_sub(1)).unwrap_or(i);
        let after = neighbour(Some(i + 1)).unwrap_or(i);
        samples[i].feed = speed(&samples[before], &samples[after]).unwrap_or(0.0);
    }
    Ok(LoadedCourse { course: motion.course, samples })
}

/// The deflection of a driven pose under its load.
#[derive(Clone, Copy)]
struct Bend {
    /// Vector from the driven position to the actual one, m, work object axes.
    shift: Vector3<f64>,
    /// Rotation vector from the driven orientation to the actual one, rad.
    turn: Vector3<f64>,
    /// Force on the tool, N, work object axes.
    force: Vector3<f64>,
}

impl Bend {
    fn between(&self, to: &Self, share: f64) -> Self {
        Self {
            shift: self.shift.lerp(&to.shift, share),
            turn: self.turn.lerp(&to.turn, share),
            force: self.force.lerp(&to.force, share),
        }
    }
}

/// Indices of the samples whose equilibria are solved, including the first and the last. Between two of them the tool moves by no more than
/// [`SOLVED_EVERY`], and load and travel change so little that the deflection can be interpolated.
fn solved_among(points: &[Point]) -> Vec<usize> {
    let alike = |from: usize, to: usize| {
        let (a, b) = (&points[from], &points[to]);
        let displacement = a.wobj_from_tcp.translation.vector - b.wobj_from_tcp.translation.vector;
        to - from <= MOST_BETWEEN
            && displacement.norm_squared() <= SOLVED_EVERY.powi(2)
            && a.setting == b.setting
            && a.travel == b.travel
            && a.part.is_some() == b.part.is_some()
            && a.load.is_near(&b.load)
    };
    let mut solved: Vec<usize> = Vec::new();
    for k in 0..points.len() {
        let is_between = |from: usize| k + 1 < points.len() && alike(from, k) && alike(from, k + 1);
        if !solved.last().is_some_and(|from| is_between(*from)) {
            solved.push(k);
        }
    }
    solved
}

/// A driven path compared with the programmed one.
#[derive(Clone, Debug)]
pub(super) struct DrivenSegments {
    /// The deviation on the segment to each waypoint; `None` if no path is programmed.
    pub(super) segments: Vec<Option<PathDeviation>>,
    /// Vector from each waypoint to the nearest point of the driven path, work object axes, m; `None` if no path is programmed.
    missed: Vec<Option<Vector3<f64>>>,
    /// Vector from the programmed path to the driven one at the end of each motion of the driven program, work object axes, m; `None` if no
    /// path is programmed.
    passed: Vec<Option<Vector3<f64>>>,
    /// [`Course::counting`].
    pub(super) counts: Vec<bool>,
    pub(super) figures: DrivenFigures,
}

/// Compares a driven path with the programmed one of a course, which may be that of another program; `waypoint_of` gives the waypoint
/// of the course for one of the driven program.
pub(super) fn driven_segments(
    prepared: &Prepared,
    course: &Course,
    robot: &Robot,
    path: &LoadedCourse,
    waypoint_of: &(dyn Fn(usize) -> usize + Sync),
) -> DrivenSegments {
    let mut comparison = Comparison::new(robot);
    comparison.extend(prepared, course);
    let offsets = comparison.drive(&path.samples, waypoint_of, Parallelism::Threads);
    let mut passed = Vec::new();
    for (sample, offset) in path.samples.iter().zip(offsets) {
        // A motion that ends between two samples has the value of the next one.
        passed.resize(sample.waypoint + 1, offset);
        passed[sample.waypoint] = offset;
    }
    let compared = std::iter::from_fn(|| comparison.close());
    let (segments, missed) = compared.map(|compared| (compared.path, compared.missed)).unzip();
    DrivenSegments { segments, missed, passed, counts: course.counting(prepared), figures: comparison.figures() }
}

/// The force laws of a program at the driven feeds. A cutter has a law for each of [`FEED_STEPS`] feeds up to its largest one, however many
/// feeds the program states.
struct DrivenFeeds {
    /// For each law of the program, the law of the same cutter at its largest feed.
    fastest: Vec<usize>,
    /// Laws computed so far, by the fastest one and the step: their numbers after those of the program.
    known: BTreeMap<(usize, usize), usize>,
}

impl DrivenFeeds {
    fn new(laws: &[Law]) -> Self {
        let mut cutters: Vec<usize> = Vec::new();
        for (i, law) in laws.iter().enumerate() {
            match cutters.iter_mut().find(|other| laws[**other].cuts_like(law)) {
                Some(fastest) if law.feed_per_tooth() > laws[*fastest].feed_per_tooth() => *fastest = i,
                Some(_) => {}
                None => cutters.push(i),
            }
        }
        let of =
            |(i, law): (usize, &Law)| cutters.iter().copied().find(|other| laws[*other].cuts_like(law)).unwrap_or(i);
        Self { fastest: laws.iter().enumerate().map(of).collect(), known: BTreeMap::new() }
    }

    /// Takes over what a further chunk of the program added to the tools, work objects and laws of `known`, before the laws at driven feeds.
    ///
    /// # Errors
    /// A cutter has a larger feed than in the chunks before.
    fn extend(&mut self, known: &mut Prepared, chunk: &Prepared) -> Result<(), FasterCut> {
        let (count, laws) = (self.fastest.len(), &chunk.shared.laws);
        if count == laws.len() && known.shared.settings.len() == chunk.shared.settings.len() {
            return Ok(());
        }
        let Self { fastest, .. } = Self::new(laws);
        if fastest[..count] != self.fastest {
            return Err(FasterCut);
        }
        self.fastest = fastest;
        let slowed = known.shared.laws[count.min(known.shared.laws.len())..].iter().cloned();
        let laws = laws.iter().cloned().chain(slowed).collect();
        known.shared = Arc::new(Shared { laws, ..Shared::clone(&chunk.shared) });
        Ok(())
    }

    /// Gives points the force law at their share of the programmed speed.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_precision_loss)]
    fn slow_down(&mut self, prepared: &mut Prepared, points: &mut [DrivenPoint]) {
        let steps = FEED_STEPS as f64;
        let count = self.fastest.len();
        for DrivenPoint { point, speed, .. } in points {
            let PointLoad::Law { law, .. } = &mut point.load else { continue };
            // At the programmed feed the law of the program stays.
            if (1.0 - *speed) * steps < 0.5 {
                continue;
            }
            let laws = &prepared.shared.laws;
            let fastest = self.fastest[*law];
            let largest = laws[fastest].feed_per_tooth();
            let step = (*speed * laws[*law].feed_per_tooth() / largest * steps).round() as usize;
            let shared = &mut prepared.shared;
            *law = count
                + *self.known.entry((fastest, step)).or_insert_with(|| {
                    let laws = &mut Arc::make_mut(shared).laws;
                    laws.push(laws[fastest].at_feed(largest * step as f64 / steps));
                    laws.len() - 1 - count
                });
        }
    }
}

/// A chunk has a larger feed of a cutter than those before, from which the feeds were counted.
pub(super) struct FasterCut;

/// The loaded arm has no equilibrium on the segment to a waypoint.
#[derive(Debug)]
pub(super) struct NoEquilibrium {
    waypoint: usize,
    error: EquilibriumError,
}

/// The motion that the controller drives along a program, sample by sample, of the unloaded arm.
pub(super) struct DrivenMotion<'a> {
    arm: &'a Arm,
    course: Course,
    samples: Vec<DrivenSample>,
    /// The flange at each sample, base frame, m.
    flanges: Vec<Pose>,
    /// Speed of the TCP at each sample over the programmed one, 0 to 1.
    speeds: Vec<f64>,
    feeds: DrivenFeeds,
    /// The axes at the last sample that was used, and their direction of travel.
    last: Option<(Joints, Joints)>,
}

/// One sample of a [`DrivenMotion`] as a point.
pub(super) struct DrivenPoint {
    /// Its reference is the programmed pose on the segment; its axes are the driven ones.
    pub(super) point: Point,
    /// Speed of the TCP over the programmed one, 0 to 1.
    pub(super) speed: f64,
    /// Distance of the driven TCP from the programmed segment, m.
    pub(super) aside: f64,
}

impl<'a> DrivenMotion<'a> {
    /// The motion along a course, by the law of the cell's controller; without a law corners are driven as written.
    ///
    /// # Errors
    /// A point of the path is out of reach; the motion takes too long.
    pub(super) fn along(
        course: Course,
        Context { program, cell, .. }: Context<'a>,
        prepared: &Prepared,
        sampling: Sampling,
    ) -> Result<Self, Vec<Diagnostic>> {
        let mut follower = Follower::new(cell, course, &prepared.shared.laws);
        match follower.drive(prepared, (Extent::Whole, sampling), Parallelism::Threads) {
            Ok(()) => Ok(follower.motion),
            Err(error) => Err(follower.motion.course.refused(program, error)),
        }
    }

    /// Adds samples. The speed at the last one is known if they are all.
    fn extend(&mut self, samples: Vec<DrivenSample>, extent: Extent, parallelism: Parallelism) {
        let robot = &self.arm.robot;
        self.flanges.extend(parallelism.map(samples.len(), |i| robot.forward(&samples[i].motor)));
        self.samples.extend(samples);
        let (from, to) = (self.speeds.len(), extent.of(self.samples.len()));
        let speeds = parallelism.map(to.saturating_sub(from), |k| self.speed_at(from + k));
        self.speeds.extend(speeds);
    }

    /// Speed of the TCP at a sample over the programmed one, 0 to 1, from the samples before and after it.
    fn speed_at(&self, i: usize) -> f64 {
        let waypoint = &self.course.waypoints[self.samples[i].waypoint - self.course.first];
        let [before, after] = [i.saturating_sub(1), (i + 1).min(self.samples.len() - 1)];
        let [from, to] = [before, after].map(|at| (self.flanges[at] * waypoint.flange_from_tcp).translation.vector);
        let time = self.samples[after].time - self.samples[before].time;
        let speed = if time > 0.0 { (to - from).norm() / time } else { 0.0 };
        (speed / waypoint.feed).min(1.0)
    }

    pub(super) fn course(&self) -> &Course {
        &self.course
    }

    /// Index of the target at the end of a sample's segment.
    fn target(&self, sample: usize) -> usize {
        self.course.targets[self.samples[sample].waypoint - self.course.first]
    }

    /// The samples on the segment to a target; empty if the segment takes less than the time between two samples; `None` for the first
    /// target of the program.
    pub(super) fn range_before(&self, target: usize) -> Option<Range<usize>> {
        let waypoint = self.course.targets.binary_search(&target).ok().filter(|waypoint| *waypoint > 0)?;
        let first = self.samples.partition_point(|sample| sample.waypoint < waypoint);
        Some(first..self.samples.partition_point(|sample| sample.waypoint <= waypoint))
    }

    /// The driven pose of the tool of a setting at a sample, in its work object.
    pub(super) fn pose(&self, setting: &Setting, sample: usize) -> Pose {
        setting.wobj_from_tcp(&self.flanges[sample])
    }

    /// Speed of the TCP at a sample over the programmed one, 0 to 1.
    pub(super) fn speed(&self, sample: usize) -> f64 {
        self.speeds[sample]
    }

    /// Share of the segment to its target at a sample.
    pub(super) fn share(&self, sample: usize) -> f64 {
        self.samples[sample].share
    }

    /// The actual poses at consecutive samples. Of each [`TOGETHER`] of them, the first and the last are solved. The ordinals of the targets
    /// and the speeds stay open.
    fn load(
        &mut self,
        prepared: &mut Prepared,
        range: Range<usize>,
        parallelism: Parallelism,
    ) -> Result<Vec<LoadedSample>, NoEquilibrium> {
        let from = range.start;
        let batch: Vec<usize> = range.collect();
        let points: Vec<Point> = self.points(prepared, &batch).into_iter().map(|driven| driven.point).collect();
        let parts = points.chunks(TOGETHER).enumerate();
        let solved: Vec<usize> =
            parts.flat_map(|(n, part)| solved_among(part).into_iter().map(move |k| n * TOGETHER + k)).collect();
        let solved_points = prepared.with_points(solved.iter().map(|k| points[*k].clone()).collect());
        let solver = Solver::new(self.arm, &solved_points, parallelism);
        let landed = solver.forward(|i| solved_points.points[i].as_programmed(), |_| WarmStart::default());
        let mut bends: Vec<Bend> = Vec::with_capacity(solved.len());
        for ((k, point), landed) in solved.iter().zip(&solved_points.points).zip(landed) {
            let landed = landed.map_err(|error| NoEquilibrium { waypoint: self.samples[from + *k].waypoint, error })?;
            let rotation = Rotation3::from_scaled_axis(landed.turn) * point.reference.rotation;
            bends.push(Bend {
                shift: point.reference.translation.vector + landed.shift - point.wobj_from_tcp.translation.vector,
                turn: (rotation * point.wobj_from_tcp.rotation.inverse()).scaled_axis(),
                force: landed.cut,
            });
        }
        let mut after = 0;
        let mut samples = Vec::with_capacity(points.len());
        for (k, point) in points.iter().enumerate() {
            let sample = &self.samples[from + k];
            while solved[after] < k {
                after += 1;
            }
            let bend = if solved[after] == k {
                bends[after]
            } else {
                let time = |at: usize| self.samples[from + solved[at]].time;
                bends[after - 1]
                    .between(&bends[after], (sample.time - time(after - 1)) / (time(after) - time(after - 1)))
            };
            let position = point.wobj_from_tcp.translation.vector + bend.shift;
            let rotation = Rotation3::from_scaled_axis(bend.turn) * point.wobj_from_tcp.rotation;
            let wobj_from_tcp = Pose::from_parts(Translation3::from(position), rotation);
            samples.push(LoadedSample {
                time: sample.time,
                target: 0,
                wobj_from_tcp,
                feed: 0.0,
                force: bend.force,
                waypoint: sample.waypoint,
                base_from_tcp: (prepared.base_from_wobj(self.target(from + k)) * wobj_from_tcp).translation.vector,
            });
        }
        Ok(samples)
    }

    /// The points of samples, which must be in running order, each once.
    pub(super) fn points(&mut self, prepared: &mut Prepared, samples: &[usize]) -> Vec<DrivenPoint> {
        let (mut points, mut last) = (Vec::with_capacity(samples.len()), self.last);
        for segment in samples.chunk_by(|a, b| self.samples[*a].waypoint == self.samples[*b].waypoint) {
            self.points_into(prepared, segment, &mut last, &mut points);
        }
        self.last = last;
        self.feeds.slow_down(prepared, &mut points);
        points
    }

    /// The points of samples on the segment to one target.
    fn points_into(
        &self,
        prepared: &Prepared,
        samples: &[usize],
        last: &mut Option<(Joints, Joints)>,
        points: &mut Vec<DrivenPoint>,
    ) {
        let Some(waypoint) = samples.first().map(|i| self.samples[*i].waypoint - self.course.first) else { return };
        let kind = match self.course.waypoints[waypoint].lead {
            Lead::Line => Kind::Line,
            Lead::Arc(_) => Kind::Arc,
            Lead::Joints => Kind::Joint,
        };
        let end = self.course.targets[waypoint];
        let (begin, gone) = self.course.begins(waypoint);
        let share = |own: f64| gone + (self.course.shares[waypoint] - gone) * own;
        let segment = Segment::between(kind, prepared, begin, end);
        for i in samples {
            let (sample, speed) = (&self.samples[*i], self.speeds[*i]);
            let driven = self.pose(prepared.setting(end), *i);
            let mut point = match &segment {
                Some(segment) => segment.at_speed(share(sample.share), speed),
                // Joint motions do not cut and have no programmed path: the reference is the driven pose.
                None => Point { reference: driven, ..prepared.points[end].clone() },
            };
            let shift = driven.translation.vector - point.reference.translation.vector;
            let aside =
                segment.as_ref().map_or(0.0, |segment| segment.track.across(share(sample.share), &shift).norm());
            let held =
                last.map_or_else(|| point.travel, |(before, held)| self.arm.travel(&before, &sample.motor, &held));
            *last = Some((sample.motor, held));
            (point.wobj_from_tcp, point.motor, point.travel, point.time) = (driven, sample.motor, held, sample.time);
            point.unsolved = None;
            points.push(DrivenPoint { point, speed, aside });
        }
    }
}

/// How much of a program is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Extent {
    /// Its first part: what the last element depends on is still unknown.
    SoFar,
    Whole,
}

impl Extent {
    /// The number of elements that are final.
    fn of(self, count: usize) -> usize {
        match self {
            Self::SoFar => count.saturating_sub(1),
            Self::Whole => count,
        }
    }
}

/// Drives along a course that grows.
pub(super) struct Follower<'a> {
    driver: Driver<'a>,
    pub(super) motion: DrivenMotion<'a>,
    /// For each waypoint the number of its stretch: consecutive segments of which each [goes on](Course::goes_on) from the one before.
    stretches: Vec<usize>,
    /// Number of waypoints of the course that the driver has received.
    given: usize,
    /// Number of samples of the motion that are loaded.
    loaded: usize,
}

impl<'a> Follower<'a> {
    /// Begins a course that has a first part already, of a program with these force laws.
    pub(super) fn new(cell: &'a Cell, course: Course, laws: &[Law]) -> Self {
        let law = cell.controller.path.map_or(PathLaw::AS_WRITTEN, |path| path.law);
        let (arm, feeds) = (&cell.arm, DrivenFeeds::new(laws));
        let (samples, flanges, speeds) = (Vec::new(), Vec::new(), Vec::new());
        let motion = DrivenMotion { arm, course, samples, flanges, speeds, feeds, last: None };
        Self { driver: Driver::new(&arm.robot, &law), motion, stretches: Vec::new(), given: 0, loaded: 0 }
    }

    /// Adds the points of the next chunk to the known ones, and its waypoints to the course. Says how the last waypoint before them is passed
    /// (`settled`). Returns the targets of the new waypoints in the chunk.
    pub(super) fn extend(
        &mut self,
        known: &mut Prepared,
        chunk: &Prepared,
        settled: Option<Option<f64>>,
        add: impl FnOnce(&mut Course),
    ) -> Result<impl Iterator<Item = usize>, FasterCut> {
        let DrivenMotion { course, feeds, .. } = &mut self.motion;
        feeds.extend(known, chunk)?;
        if let Some((last, zone)) = course.waypoints.last_mut().zip(settled) {
            last.zone = zone;
        }
        let (waypoints, points) = (course.waypoints.len(), known.points.len());
        add(course);
        let targets = course.targets[waypoints..].to_vec();
        course.targets[waypoints..].iter_mut().for_each(|target| *target += points);
        known.points.extend_from_slice(&chunk.points);
        Ok(targets.into_iter())
    }

    /// Number of waypoints that are forgotten.
    pub(super) fn first(&self) -> usize {
        self.motion.course.first
    }

    /// Drives as far as the course is known.
    pub(super) fn drive(
        &mut self,
        prepared: &Prepared,
        (extent, sampling): (Extent, Sampling),
        parallelism: Parallelism,
    ) -> Result<(), DriveError> {
        let Self { driver, motion, stretches, given, .. } = self;
        let course = &motion.course;
        // The zone of the last waypoint depends on the statements after it.
        let to = extent.of(course.waypoints.len());
        course.waypoints[*given..to].iter().try_for_each(|waypoint| driver.add(waypoint))?;
        *given = to;
        for waypoint in stretches.len()..course.waypoints.len() {
            let before = stretches.last().copied();
            let number = |last: usize| last + usize::from(!course.goes_on(prepared, waypoint));
            stretches.push(before.map_or(0, number));
        }
        if extent == Extent::Whole {
            driver.end()?;
        }
        let samples = match sampling {
            Sampling::All => driver.samples(),
            Sampling::Sparse => {
                // Within a stretch, the spacing of the equilibria decides.
                let longest = |from: usize, to: usize| {
                    let [begin, end] = [from, to].map(|at| at - course.first);
                    match stretches.get(begin) == stretches.get(end) {
                        true => SOLVED_EVERY / course.waypoints[begin.min(course.waypoints.len() - 1)].feed,
                        false => 0.0,
                    }
                };
                let chosen = driver.choose(&longest)?;
                parallelism.map_each(&chosen, |periods| driver.samples_at(periods)).concat()
            }
        };
        driver.forget();
        motion.extend(samples, extent, parallelism);
        Ok(())
    }

    /// Loads the samples that are known, as many at a time as are [solved together](TOGETHER).
    pub(super) fn load(
        &mut self,
        prepared: &mut Prepared,
        extent: Extent,
        parallelism: Parallelism,
    ) -> Result<Vec<LoadedSample>, NoEquilibrium> {
        let known = self.motion.speeds.len();
        let to = match extent {
            Extent::SoFar => self.loaded + (known - self.loaded) / TOGETHER * TOGETHER,
            Extent::Whole => known,
        };
        let samples = self.motion.load(prepared, self.loaded..to, parallelism)?;
        // The speed at the next sample depends on the last one.
        let passed = to.saturating_sub(1);
        self.motion.samples.drain(..passed);
        self.motion.flanges.drain(..passed);
        self.motion.speeds.drain(..passed);
        self.loaded = to - passed;
        Ok(samples)
    }

    /// The first waypoint that further samples need: its segment, or the one before it.
    fn needed(&self) -> usize {
        let unloaded = self.motion.samples.get(self.loaded).map(|sample| sample.waypoint);
        unloaded.into_iter().chain([self.driver.waypoint()]).min().unwrap_or_default()
    }

    /// Forgets waypoints before this one that no further sample needs, if they are at least half of all. Returns their number.
    pub(super) fn forget(&mut self, prepared: &mut Prepared, waypoint: usize) -> usize {
        let needed = waypoint.min(self.needed());
        let course = &mut self.motion.course;
        let needed = needed - course.first;
        // The segment to it begins at the target before.
        let passed = if needed > 0 { course.ends_before(needed) } else { 0 };
        if 2 * passed < course.waypoints.len() {
            return 0;
        }
        let points = course.targets[passed];
        prepared.points.drain(..points);
        course.forget(passed);
        course.targets.iter_mut().for_each(|target| *target -= points);
        self.stretches.drain(..passed);
        self.given -= passed;
        passed
    }
}
