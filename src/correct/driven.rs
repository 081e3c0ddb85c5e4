//! The path that the controller drives and the loaded arm takes, sampled over time.

use super::context::Context;
use super::deviation::Commanded;
use super::laws::Law;
use super::load::PointLoad;
use super::original_loads::OriginalLoads;
use super::parallelism::Parallelism;
use super::point::Point;
use super::segment::{Kind, Segment, Start, waypoint_targets};
use super::solve::{Solver, controller_motor};
use super::{
    Corrected, DrivenFigures, DrivenSummary, KeptReason, Options, PathDeviation, Prepared, RAPID_MM_S, frames,
};
use crate::cell::Cell;
use crate::drive::{
    DriveError, DrivenSample, Lead, Offset, PathLaw, ProgrammedPath, SAMPLE_S, Waypoint, drive, nearest_between,
    timeline,
};
use crate::equilibrium::{Arm, Setting, WarmStart};
use crate::program::{Passing, Program, Target};
use crate::robot::{Joints, Pose, Robot};
use crate::text::{Diagnostic, Severity};
use nalgebra::{Rotation3, Translation3, Vector3};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

/// Number of samples that are solved at once: some ten megabytes.
const BATCH: usize = 16_384;
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
    /// Number of waypoints that the robot passes in a zone of unknown size: they count as stops.
    unstated: usize,
    /// Lines and arcs of unknown speed: they get the speed of the motion before, or of the first one after them.
    without_speed: usize,
    /// Waypoints with a zone at which the controller stops, because the program waits, with the statement.
    waits: Vec<(usize, &'static str)>,
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
    waypoint: usize,
    /// Actual TCP in the robot's base, m.
    base_from_tcp: Vector3<f64>,
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
        let unstated_zone = cell.controller.path.and_then(|path| path.zone);
        let mut course = Self::default();
        let mut feed = None;
        let ends = waypoint_targets(program);
        for (at, i) in ends.iter().copied().enumerate() {
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
            course.without_speed += usize::from(!is_joint && !target.rapid && at > 0 && programmed(target).is_none());
            let rapid = target.rapid.then_some(1e-3 * RAPID_MM_S);
            feed = programmed(target).or(rapid).or(feed).or_else(|| program.targets[i..].iter().find_map(programmed));
            let Some(feed) = feed else {
                return Err(refuse("no motion of the program has a speed", "the path over time needs a speed"));
            };
            let zone = match program.passing(i) {
                Passing::Stop => None,
                Passing::Zone(mm) => Some(1e-3 * mm),
                Passing::Unstated => {
                    course.unstated += usize::from(unstated_zone.is_none());
                    unstated_zone
                }
            };
            // The controller does not round a corner if it does not know the next motion in time.
            let waits = zone.and_then(|_| program.waits_between(i, *ends.get(at + 1)?));
            course.waits.extend(waits.map(|word| (at, word)));
            let zone = zone.filter(|_| waits.is_none());
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
            course.push(waypoint, i, 1.0);
        }
        Ok(course)
    }

    fn push(&mut self, waypoint: Waypoint, target: usize, share: f64) {
        self.waypoints.push(waypoint);
        self.targets.push(target);
        self.shares.push(share);
    }

    /// The course of the corrected program: its commands and the inserted targets.
    fn corrected(&self, program: &Program, cell: &Cell, prepared: &Prepared, commanded: &Commanded) -> Self {
        let robot = &cell.arm.robot;
        let unstated_zone = cell.controller.path.and_then(|path| path.zone);
        let mut course = Self::default();
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
        course
    }

    /// The target at which the segment to a waypoint begins, and the share of the segment to the waypoint's target at that start.
    fn begins(&self, waypoint: usize) -> (usize, f64) {
        let (before, target) = (waypoint - 1, self.targets[waypoint]);
        if self.targets[before] != target {
            return (self.targets[before], 0.0);
        }
        let from = self.targets[..before].partition_point(|other| *other < target);
        (self.targets[from.saturating_sub(1)], self.shares[before])
    }

    /// For each waypoint the number of its stretch: consecutive segments with one tool, work object and speed, and a continuous load. The
    /// load of a cut from stock changes along a segment.
    fn stretches(&self, prepared: &Prepared) -> Vec<usize> {
        let goes_on = |waypoint: usize| {
            let [before, here] = [waypoint - 1, waypoint].map(|at| &prepared.points[self.targets[at]]);
            before.setting == here.setting
                && self.waypoints[waypoint - 1].feed.total_cmp(&self.waypoints[waypoint].feed).is_eq()
                && before.milled.is_none()
                && here.milled.is_none()
                && before.part.is_none()
                && here.part.is_none()
                && before.load.is_near(&here.load)
        };
        let mut stretch = 0;
        let number = |waypoint: usize| {
            stretch += usize::from(waypoint > 0 && !goes_on(waypoint));
            stretch
        };
        (0..self.waypoints.len()).map(number).collect()
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
            notes.extend(path.planning.and_then(|planning| self.short_motions(program, planning)));
            notes.extend(self.cut_zones(program));
            notes.extend(self.corner_failures(program));
        }
        notes
    }

    /// Straight distance of the motion to a waypoint, m.
    fn distance(&self, waypoint: usize) -> f64 {
        let place = |i: usize| self.waypoints[i].base_from_tcp.translation.vector;
        (place(waypoint) - place(waypoint - 1)).norm()
    }

    /// Warns of motions that end before the controller has planned the next one (s): it slows down or stops there.
    fn short_motions(&self, program: &Program, planning: f64) -> Option<Diagnostic> {
        let seconds = |i: usize| self.distance(i) / self.waypoints[i].feed;
        let short = (1..self.waypoints.len()).filter(|i| {
            let passed = self.waypoints[*i].zone.is_some() && matches!(self.waypoints[*i].lead, Lead::Line);
            passed && seconds(*i) < planning
        });
        let all: Vec<usize> = short.collect();
        let shortest = all.iter().copied().min_by(|a, b| seconds(*a).total_cmp(&seconds(*b)))?;
        let (what, take) = if all.len() == 1 { ("motion", "takes") } else { ("motions", "take") };
        let message = format!(
            "{} {what} {take} less than the {planning} s that the controller needs to plan one: the arm will stutter; the shortest takes \
             {:.4} s",
            all.len(),
            seconds(shortest)
        );
        let warning = self.at(program, shortest, "path.stutter", message).severity(Severity::Warning);
        Some(warning.help("put the points further apart, or lower the feed"))
    }

    /// Warns of corners that the controller cannot round, because the program waits before the next motion is known.
    fn corner_failures(&self, program: &Program) -> Option<Diagnostic> {
        let &(first, word) = self.waits.first()?;
        let more = match self.waits.len() - 1 {
            0 => String::new(),
            more => format!(", and at {more} more"),
        };
        let message = format!(
            "the program waits after this motion ({word}) before the next one is known: the controller comes to rest here in place of \
             rounding the corner (corner path failure){more}"
        );
        let warning = self.at(program, first, "path.corner-failure", message).severity(Severity::Warning);
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
    fn cut_zones(&self, program: &Program) -> Option<Diagnostic> {
        let is_cut = |i: &usize| {
            let room = 0.5 * self.distance(*i).min(self.distance(*i + 1));
            self.waypoints[*i].zone.is_some_and(|zone| room > 0.0 && zone > room)
        };
        let all: Vec<usize> = (1..self.waypoints.len().saturating_sub(1)).filter(is_cut).collect();
        let first = *all.first()?;
        let (zones, are) = if all.len() == 1 { ("zone", "is") } else { ("zones", "are") };
        let message = format!(
            "{} {zones} {are} larger than half the distance to a neighbouring point: the controller cuts {} to that",
            all.len(),
            if all.len() == 1 { "it" } else { "them" }
        );
        let note = self.at(program, first, "path.zones-overlap", message).severity(Severity::Note);
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
        let sent = course.corrected(program, cell, prepared, commanded);
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
    samples: Vec<LoadedSample>,
}

/// The same along a course of a prepared program.
pub(super) fn loaded_along(
    prepared: &mut Prepared,
    course: Course,
    context: Context<'_>,
    sampling: Sampling,
) -> Result<LoadedCourse, Vec<Diagnostic>> {
    let Context { program, cell, .. } = context;
    let mut motion = DrivenMotion::along(course, context, prepared, sampling)?;
    let mut samples: Vec<LoadedSample> = Vec::with_capacity(motion.samples.len());
    for from in (0..motion.samples.len()).step_by(BATCH) {
        let batch: Vec<usize> = (from..motion.samples.len().min(from + BATCH)).collect();
        let points: Vec<Point> = motion.points(prepared, &batch).into_iter().map(|driven| driven.point).collect();
        let solved = solved_among(&points);
        let solved_points = prepared.with_points(solved.iter().map(|k| points[*k].clone()).collect());
        let solver = Solver::new(&cell.arm, &solved_points, Parallelism::Threads);
        let landed = solver.forward(|i| solved_points.points[i].as_programmed(), |_| WarmStart::default());
        let mut bends: Vec<Bend> = Vec::with_capacity(solved.len());
        for ((k, point), landed) in solved.iter().zip(&solved_points.points).zip(landed) {
            let landed = landed.map_err(|error| {
                let message = format!("the loaded arm has no equilibrium on the path to this target: {error}");
                let help = "check the forces and the stiffness of the cell";
                motion.course.refused_at(program, motion.samples[batch[*k]].waypoint, message, help)
            })?;
            let rotation = Rotation3::from_scaled_axis(landed.turn) * point.reference.rotation;
            bends.push(Bend {
                shift: point.reference.translation.vector + landed.shift - point.wobj_from_tcp.translation.vector,
                turn: (rotation * point.wobj_from_tcp.rotation.inverse()).scaled_axis(),
                force: landed.cut,
            });
        }
        let mut after = 0;
        for (k, (i, point)) in batch.iter().zip(&points).enumerate() {
            let sample = &motion.samples[*i];
            while solved[after] < k {
                after += 1;
            }
            let bend = if solved[after] == k {
                bends[after]
            } else {
                let time = |at: usize| motion.samples[batch[solved[at]]].time;
                bends[after - 1]
                    .between(&bends[after], (sample.time - time(after - 1)) / (time(after) - time(after - 1)))
            };
            let position = point.wobj_from_tcp.translation.vector + bend.shift;
            let rotation = Rotation3::from_scaled_axis(bend.turn) * point.wobj_from_tcp.rotation;
            let wobj_from_tcp = Pose::from_parts(Translation3::from(position), rotation);
            let target = motion.target(*i);
            samples.push(LoadedSample {
                time: sample.time,
                target: program.targets[target].ordinal,
                wobj_from_tcp,
                feed: 0.0,
                force: bend.force,
                waypoint: sample.waypoint,
                base_from_tcp: (prepared.base_from_wobj(target) * wobj_from_tcp).translation.vector,
            });
        }
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
    let programmed = ProgrammedPath::new(robot, &course.waypoints);
    let counts = course.counting(prepared);
    let mut segments: Vec<Option<PathDeviation>> = (0..course.waypoints.len())
        .map(|i| {
            programmed
                .track(i)
                .map(|track| PathDeviation { length_mm: 1e3 * track.length(), ..PathDeviation::default() })
        })
        .collect();
    let places: Vec<Vector3<f64>> = path.samples.iter().map(|sample| sample.base_from_tcp).collect();
    let mut driven_length = vec![0.0; segments.len()];
    let mut passed = Vec::new();
    let offset = |sample: &LoadedSample| programmed.offset(&sample.base_from_tcp, waypoint_of(sample.waypoint));
    let offsets: Vec<Option<Offset>> = path.samples.par_iter().map(offset).collect();
    for (k, (sample, offset)) in path.samples.iter().zip(offsets).enumerate() {
        let waypoint = waypoint_of(sample.waypoint);
        let back = || prepared.base_from_wobj(course.targets[waypoint]).rotation.inverse();
        let off = offset.map(|offset| back() * offset.vector);
        // A motion that ends between two samples has the value of the next one.
        passed.resize(sample.waypoint + 1, off);
        passed[sample.waypoint] = off;
        let Some((segment, offset)) = segments[waypoint].as_mut().zip(offset) else { continue };
        let distance = 1e3 * offset.vector.norm();
        let length = k.checked_sub(1).map_or(0.0, |before| (places[k] - places[before]).norm());
        segment.max_mm = segment.max_mm.max(distance);
        segment.mean_square_mm2 += length * distance * distance;
        driven_length[waypoint] += length;
    }
    let about = |sample: &LoadedSample| waypoint_of(sample.waypoint);
    let mut missed = vec![None; segments.len()];
    let (mut from, mut to) = (0, 0);
    for (i, segment) in segments.iter_mut().enumerate() {
        let Some(segment) = segment else { continue };
        // The distance from a corner counts, however near the path is to both segments.
        let is_about =
            |sample: usize, most: usize| path.samples.get(sample).is_some_and(|sample| about(sample) <= most);
        while i > 0 && is_about(from, i - 1) {
            from += 1;
        }
        while is_about(to, i + 1) {
            to += 1;
        }
        let corner = &course.waypoints[i].base_from_tcp.translation.vector;
        let back = prepared.base_from_wobj(course.targets[i]).rotation.inverse();
        // From the last sample before both segments to the first one after them.
        let places = &places[from.saturating_sub(1)..(to + 1).min(places.len())];
        missed[i] = nearest_between(corner, places).map(|(vector, _)| back * vector);
        let off = |corner: Option<usize>| corner.and_then(|i| missed[i]).map_or(0.0, |missed| 1e3 * missed.norm());
        let [begin, end] = [off(i.checked_sub(1)), off(Some(i))];
        if driven_length[i] > 0.0 {
            segment.mean_square_mm2 /= driven_length[i];
        } else {
            // The segment has no sample: the deviation changes evenly from corner to corner.
            segment.max_mm = begin;
            segment.mean_square_mm2 = (begin * begin + begin * end + end * end) / 3.0;
        }
        segment.max_mm = segment.max_mm.max(end);
        segment.way_mm = segment.max_mm;
    }
    let counted =
        segments.iter().zip(&counts).filter(|(_, counts)| **counts).filter_map(|(segment, _)| segment.as_ref());
    let figures = DrivenFigures {
        max_mm: counted.map(|segment| segment.max_mm).fold(0.0, f64::max),
        run_time_s: path.samples.last().map_or(0.0, |sample| sample.time),
    };
    DrivenSegments { segments, missed, passed, counts, figures }
}

/// The force laws of a program at the driven feeds. A cutter has a law for each of [`FEED_STEPS`] feeds up to its largest one, however many
/// feeds the program states.
struct DrivenFeeds {
    /// For each law of the program, the law of the same cutter at its largest feed.
    fastest: Vec<usize>,
    /// Laws computed so far, by the fastest one and the step.
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

    /// Gives points the force law at their share of the programmed speed.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_precision_loss)]
    fn slow_down(&mut self, prepared: &mut Prepared, points: &mut [DrivenPoint]) {
        let steps = FEED_STEPS as f64;
        for DrivenPoint { point, speed, .. } in points {
            let PointLoad::Law { law, .. } = &mut point.load else { continue };
            let laws = &prepared.shared.laws;
            let fastest = self.fastest[*law];
            let largest = laws[fastest].feed_per_tooth();
            let step = (*speed * laws[*law].feed_per_tooth() / largest * steps).round() as usize;
            // At the programmed feed the law of the program stays.
            if (1.0 - *speed) * steps < 0.5 {
                continue;
            }
            let shared = &mut prepared.shared;
            *law = *self.known.entry((fastest, step)).or_insert_with(|| {
                let laws = &mut Arc::make_mut(shared).laws;
                laws.push(laws[fastest].at_feed(largest * step as f64 / steps));
                laws.len() - 1
            });
        }
    }
}

/// The motion that the controller drives along a program, sample by sample, of the unloaded arm.
pub(super) struct DrivenMotion<'a> {
    program: &'a Program,
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
        let law = cell.controller.path.map_or(PathLaw::AS_WRITTEN, |path| path.law);
        let arm = &cell.arm;
        let route = timeline(&arm.robot, &law, &course.waypoints).map_err(|error| course.refused(program, error))?;
        let samples = match sampling {
            Sampling::All => route.samples(),
            Sampling::Sparse => {
                let stretches = course.stretches(prepared);
                // Within a stretch, the spacing of the equilibria decides.
                let longest = |from: usize, to: usize| match stretches.get(from) == stretches.get(to) {
                    true => SOLVED_EVERY / course.waypoints[from.min(course.waypoints.len() - 1)].feed,
                    false => 0.0,
                };
                route.sparse_samples(&longest)
            }
        };
        let flanges: Vec<Pose> = samples.par_iter().map(|sample| arm.robot.forward(&sample.motor)).collect();
        let speeds = speeds(&course, &samples, &flanges);
        let feeds = DrivenFeeds::new(&prepared.shared.laws);
        Ok(Self { program, arm, course, samples, flanges, speeds, feeds, last: None })
    }

    pub(super) fn course(&self) -> &Course {
        &self.course
    }

    /// Index of the target at the end of a sample's segment.
    fn target(&self, sample: usize) -> usize {
        self.course.targets[self.samples[sample].waypoint]
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
        let Some(waypoint) = samples.first().map(|i| self.samples[*i].waypoint) else { return };
        let end = self.course.targets[waypoint];
        let (begin, gone) = self.course.begins(waypoint);
        let share = |own: f64| gone + (self.course.shares[waypoint] - gone) * own;
        let from = &prepared.points[begin];
        let start = Start {
            point: from.clone(),
            setting: *prepared.setting(begin),
            commanded: from.wobj_from_tcp,
            motor: from.motor,
            travel: from.travel,
            tangent: None,
            left: 0.0,
        };
        let segment = Segment::into(self.program, prepared, end, &start);
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

/// The speed of the TCP at each sample over the programmed one, 0 to 1.
fn speeds(course: &Course, driven: &[DrivenSample], flanges: &[Pose]) -> Vec<f64> {
    let share = |i: usize| {
        let tool = &course.waypoints[driven[i].waypoint].flange_from_tcp;
        let [before, after] = [i.saturating_sub(1), (i + 1).min(driven.len() - 1)];
        let [from, to] = [before, after].map(|at| (flanges[at] * tool).translation.vector);
        let time = driven[after].time - driven[before].time;
        let speed = if time > 0.0 { (to - from).norm() / time } else { 0.0 };
        (speed / course.waypoints[driven[i].waypoint].feed).min(1.0)
    };
    (0..driven.len()).into_par_iter().map(share).collect()
}
