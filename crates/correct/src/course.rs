//! A program as the waypoints of its controller, and the samples of the path along them.

use super::context::Context;
use super::deviation::Commanded;
use super::segment::{Kind, waypoint_targets};
use super::solve::controller_motor;
use super::{Prepared, RAPID_MM_S, frames};
use deflex_cell::Cell;
use deflex_drive::{DriveError, Lead, PathLaw, SAMPLE_S, Waypoint, drive};
use deflex_program::{Passing, Program, Target, Wait};
use deflex_robot::Pose;
use deflex_text::{Diagnostic, Severity};
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// A program as waypoints of its controller.
///
/// # Examples
/// ```
/// # let (program, cell) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/slot.rs"));
/// # let prepared = deflex_correct::Prepared::new(&program, &cell, &Default::default())?;
/// use deflex_correct::Course;
///
/// let course = Course::new(&program, &cell, &prepared)?;
/// assert!(course.waypoints.len() >= program.targets.len());
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct Course {
    /// Ends of its motions.
    pub waypoints: Vec<Waypoint>,
    /// Index of the target of each waypoint: it is the target, or a point on the segment to it.
    pub(super) targets: Vec<usize>,
    /// Share of the segment to that target; 1 at the target.
    pub(super) shares: Vec<f64>,
    /// Number of waypoints before these, which are no longer needed.
    pub(super) first: usize,
    /// Speed of the last motion that has one, m/s.
    feed: Option<f64>,
    /// Number of waypoints that the robot passes in a zone of unknown size: they count as stops, unless a size is assumed.
    pub unstated: usize,
    /// Radius that zones without one in the program count with where the cell states none, m.
    assumed_zone: Option<f64>,
    /// Lines and arcs of unknown speed: they get the speed of the motion before, or of the first one after them.
    without_speed: usize,
    /// Waypoints with a zone at which the controller stops, because the program waits; the word of the statement after the first one.
    waits: NotedWaypoints<&'static str>,
    /// Waypoints whose zone is larger than half the distance to a neighbouring one.
    overlaps: NotedWaypoints<()>,
    /// Waypoints that are passed after less time than the controller needs to plan a motion; the shortest time, s.
    short: NotedWaypoints<f64>,
    /// Where the last waypoint is in the program, if its neighbours are not all known yet.
    last: Option<Diagnostic>,
}

/// Waypoints about which a note says something.
#[derive(Clone, Debug, Default)]
struct NotedWaypoints<T> {
    count: usize,
    /// The one that the note names: its place in the program, and what is said about it.
    named: Option<(Diagnostic, T)>,
}

impl<T> NotedWaypoints<T> {
    /// Adds a waypoint; the note names it instead of the one so far if that is not `better`.
    fn add(&mut self, found: T, place: &dyn Fn() -> Diagnostic, better: impl Fn(&T, &T) -> bool) {
        self.count += 1;
        if self.named.as_ref().is_none_or(|(_, named)| better(&found, named)) {
            self.named = Some((place(), found));
        }
    }
}

/// One moment of the driven and loaded path, in the target's work object.
///
/// # Examples
/// ```
/// # let (program, cell) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/slot.rs"));
/// let path = deflex_correct::loaded_path(&program, &cell, &Default::default())?;
/// let sample = &path.samples[path.samples.len() / 2];
/// println!("{:.1} s: {:.3} m/s, {:.0} N", sample.time, sample.feed, sample.force.norm());
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
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
///
/// # Examples
/// ```
/// # let (program, cell) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/slot.rs"));
/// let path = deflex_correct::loaded_path(&program, &cell, &Default::default())?;
/// assert!(!path.samples.is_empty());
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct LoadedPath {
    /// The samples in running order, every [`SAMPLE_S`](deflex_drive::SAMPLE_S).
    pub samples: Vec<LoadedSample>,
    /// Notes about assumptions.
    pub notes: Vec<Diagnostic>,
}

impl LoadedSample {
    /// Position of the TCP, mm, and its orientation, scalar first.
    #[must_use]
    #[doc(hidden)]
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

    /// The same, where zones count with this radius (m) if neither the program nor the cell states one.
    ///
    /// # Errors
    /// As [`Course::new`].
    #[doc(hidden)]
    pub fn with_assumed_zone(
        program: &Program,
        cell: &Cell,
        prepared: &Prepared,
        radius: f64,
    ) -> Result<Self, Vec<Diagnostic>> {
        let mut course = Self { assumed_zone: Some(radius), ..Self::default() };
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
        let declared_zone = cell.controller.path.and_then(|path| path.zone);
        let mut before = None;
        let mut passing = Passing::Stop;
        for i in waypoint_targets(program) {
            let (target, point) = (&program.targets[i], &prepared.points[i]);
            let refuse = |message: &str, help: &str| vec![program.error_at(target, "path.target", message).help(help)];
            if let Some(why) = point.unsolved.filter(|_| !point.is_located()) {
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
            let zone = zone_of(passing, declared_zone.or(self.assumed_zone));
            self.unstated += usize::from(passing == Passing::Unstated && declared_zone.is_none());
            let setting = prepared.setting(i);
            let in_base = |pose: &Pose| setting.base_from_wobj * pose;
            let lead = match Kind::of(program, i) {
                Kind::Line => Lead::Line,
                Kind::Arc => Lead::Arc { via: in_base(&prepared.points[i - 1].wobj_from_tcp), turn: point.arc_turn },
                Kind::Joint | Kind::Point => Lead::Joints,
            };
            let waypoint = Waypoint {
                lead,
                base_from_tcp: in_base(&point.wobj_from_tcp),
                flange_from_tcp: setting.tool.flange_from_tcp,
                motor: point.motor,
                feed,
                zone,
                wait: 0.0,
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

    /// Looks at the waypoint before the last one, whose neighbours are known now. Between both, the program may wait.
    fn look(&mut self, program: &Program, cell: &Cell, waits: Option<Wait>) {
        let Some(at) = self.waypoints.len().checked_sub(2) else { return };
        let (known, target) = (self.last.take(), self.targets[at]);
        let place = || known.clone().unwrap_or_else(|| program.error_at(&program.targets[target], "", ""));
        // The controller does not round a corner if it does not know the next motion in time.
        if let Some(wait) = waits {
            if self.waypoints[at].zone.take().is_some() {
                self.waits.add(wait.word, &place, |_, _| false);
            }
            self.waypoints[at].wait = wait.seconds;
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
                let zone = zone_of(program.inserted_passing(i), unstated_zone);
                let turn = prepared.points[i].arc_turn;
                let lead = node.via.map_or(Lead::Line, |via| Lead::Arc { via: base_from_wobj * via, turn });
                let base_from_tcp = base_from_wobj * node.commanded;
                course.push(Waypoint { lead, base_from_tcp, motor, zone, wait: 0.0, ..*waypoint }, i, node.share);
            }
            let lead = match waypoint.lead {
                Lead::Arc { turn, .. } => Lead::Arc { via: base_from_wobj * commanded.poses[i - 1], turn },
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
    pub(super) fn without_first(&self, count: usize) -> Self {
        let (waypoints, targets) = (self.waypoints[count..].to_vec(), self.targets[count..].to_vec());
        Self { waypoints, targets, shares: self.shares[count..].to_vec(), first: self.first + count, ..Self::default() }
    }

    /// The number of a waypoint in the whole program.
    pub(super) fn ordinal(&self, waypoint: usize) -> usize {
        self.first + waypoint
    }

    /// The target at which the segment to a waypoint begins, and the share of the segment to the waypoint's target at that start.
    pub(super) fn begins(&self, waypoint: usize) -> (usize, f64) {
        let (before, target) = (waypoint - 1, self.targets[waypoint]);
        if self.targets[before] != target {
            return (self.targets[before], 0.0);
        }
        (self.targets[self.ends_before(waypoint)], self.shares[before])
    }

    /// The waypoint at the target before that of another waypoint.
    pub(super) fn ends_before(&self, waypoint: usize) -> usize {
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
    pub(super) fn goes_on(&self, prepared: &Prepared, waypoint: usize) -> bool {
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
            let hidden = match 1e3 * self.widest_corner_cut() {
                mm if mm < 0.005 => "less than 0.01 mm".to_owned(),
                mm => format!("up to {mm:.2} mm"),
            };
            let message = format!(
                "the cell has no [controller.path]: corners are taken as written, though the zones of this program may round them by {hidden}"
            );
            notes.push(note(message, "record the axes while the program runs: deflex identify --log PROGRAM LOG.csv"));
        }
        if self.unstated > 0 {
            let (points, are, they_are) =
                if self.unstated == 1 { ("point", "is", "it is") } else { ("points", "are", "they are") };
            let message = format!(
                "{} {points} of the path {are} passed, and the program does not say how near: {they_are} taken as stops",
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
            notes.extend(self.fast_axes(program, cell, &path.law));
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
        let NotedWaypoints { count, named } = &self.short;
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

    /// Warns of segments on which an axis would have to accelerate by more than its limit, so that the controller drives them more slowly.
    /// Lead and lag of the motors are not part of the motion that the controller plans.
    fn fast_axes(&self, program: &Program, cell: &Cell, law: &PathLaw) -> Option<Diagnostic> {
        if !law.limits_axes() {
            return None;
        }
        let PathLaw { smoothing, zone_share, acceleration, passing_acceleration, corner_acceleration, .. } = *law;
        let unlimited = PathLaw {
            smoothing,
            zone_share,
            acceleration,
            passing_acceleration,
            corner_acceleration,
            ..PathLaw::AS_WRITTEN
        };
        let samples = drive(&cell.arm.robot, &unlimited, &self.waypoints).ok()?;
        // For each segment the largest share of a limit, with its axis and acceleration.
        let mut worst: BTreeMap<usize, (f64, usize, f64)> = BTreeMap::new();
        for three in samples.windows(3) {
            let bend = three[2].motor - three[1].motor * 2.0 + three[0].motor;
            for axis in 0..6 {
                let acceleration = (bend[axis] / SAMPLE_S.powi(2)).abs();
                let share = acceleration / law.axis_acceleration[axis];
                let known = worst.entry(three[1].waypoint).or_default();
                if share > known.0 {
                    *known = (share, axis, acceleration);
                }
            }
        }
        worst.retain(|_, (share, ..)| *share > 1.0);
        let (&waypoint, &(_, axis, acceleration)) = worst.iter().max_by(|a, b| a.1.0.total_cmp(&b.1.0))?;
        let message = format!(
            "axis {} would have to accelerate by {:.0} °/s² on the path to this target, and its limit is {:.0} °/s²: the arm will be \
             slower there than the program says; this is so on {} of {} paths",
            axis + 1,
            acceleration.to_degrees(),
            law.axis_acceleration[axis].to_degrees(),
            worst.len(),
            self.waypoints.len().saturating_sub(1)
        );
        let warning = self.at(program, waypoint, "path.axis-acceleration", message).severity(Severity::Warning);
        Some(warning.help("lower the feed there, make the zone larger, or lead the tool past a singular posture"))
    }

    /// Notes how many zones are larger than half the distance to a neighbouring point. Controllers limit them to that: "Interpolation with
    /// overlapping position zones", RAPID Reference Manual, Motion and I/O Principles.
    fn cut_zones(&self) -> Option<Diagnostic> {
        let NotedWaypoints { count, named } = &self.overlaps;
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

    pub(super) fn refused_at(
        &self,
        program: &Program,
        waypoint: usize,
        message: String,
        help: &str,
    ) -> Vec<Diagnostic> {
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

/// The zone (m) in which the robot passes a point; `None` where it comes to rest, or if neither the text nor the cell, in `unstated`, gives one.
pub(super) fn zone_of(passing: Passing, unstated: Option<f64>) -> Option<f64> {
    match passing {
        Passing::Stop => None,
        Passing::Zone(mm) => Some(1e-3 * mm),
        Passing::Unstated => unstated,
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
