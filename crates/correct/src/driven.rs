//! The path that the controller drives and the loaded arm takes, sampled over time.

use super::compared::Comparison;
use super::context::{Context, Extent};
use super::course::{Course, LoadedPath, LoadedSample};
use super::deviation::Commanded;
use super::laws::Law;
use super::load::PointLoad;
use super::original_loads::OriginalLoads;
use super::parallelism::Parallelism;
use super::point::Point;
use super::segment::{Kind, Segment, waypoint_targets};
use super::solve::Solver;
use super::{Corrected, DrivenFigures, DrivenSummary, Options, PathDeviation, Prepared, Shared};
use deflex_cell::Cell;
use deflex_drive::{DriveError, DrivenSample, Driver, Lead, PathLaw, Waypoint};
use deflex_equilibrium::{Arm, Dragged, EquilibriumError, Setting, WarmStart};
use deflex_program::Program;
use deflex_robot::{Pose, Robot};
use deflex_text::{Diagnostic, Severity};
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
/// use deflex_correct::{Options, loaded_path};
/// use deflex_cell::Cell;
/// use deflex_program::rapid;
/// use deflex_text::Source;
///
/// let cell = Cell::read(&Source::new("cell.toml", std::fs::read("../../samples/slot/cell.toml")?))?;
/// let program = rapid::read(vec![Source::new("slot.mod", std::fs::read("../../samples/slot/slot.mod")?)], vec![])?;
/// let path = loaded_path(&program, &cell, &Options::default())?;
/// println!("{:.1} s", path.samples.last().map_or(0.0, |sample| sample.time));
/// # Ok::<(), deflex_text::Diagnostics>(())
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
    /// The joints at the last sample that was used.
    last: Option<Dragged>,
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
        last: &mut Option<Dragged>,
        points: &mut Vec<DrivenPoint>,
    ) {
        let Some(waypoint) = samples.first().map(|i| self.samples[*i].waypoint - self.course.first) else { return };
        let kind = match self.course.waypoints[waypoint].lead {
            Lead::Line => Kind::Line,
            Lead::Arc { .. } => Kind::Arc,
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
            let (motor, twist) = (sample.motor, point.twist());
            let travel = last.as_ref().map_or(point.travel, |last| self.arm.travel(last, &motor, &twist));
            *last = Some(Dragged { motor, twist, travel });
            (point.wobj_from_tcp, point.motor, point.travel, point.time) = (driven, motor, travel, sample.time);
            point.unsolved = None;
            points.push(DrivenPoint { point, speed, aside });
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
        settled: Option<Waypoint>,
        add: impl FnOnce(&mut Course),
    ) -> Result<impl Iterator<Item = usize>, FasterCut> {
        let DrivenMotion { course, feeds, .. } = &mut self.motion;
        feeds.extend(known, chunk)?;
        if let Some((last, settled)) = course.waypoints.last_mut().zip(settled) {
            (last.zone, last.wait) = (settled.zone, settled.wait);
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
