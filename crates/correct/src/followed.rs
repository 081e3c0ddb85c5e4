//! The driven path of a program that comes in chunks.
//!
//! The driven path at a target depends on the targets after it: over the time of the smoothing, over the way in which the motion could brake,
//! and over the length on which the programmed path may be near. The rows of a chunk therefore wait until the path has passed their last target.

use super::collected::{RowSegment, fill_paths};
use super::compared::{ComparedSegment, Comparison};
use super::context::Context;
use super::context::Extent;
use super::course::{Course, LoadedSample};
use super::deviation::{Commanded, WalkedPath};
use super::driven::{Follower, Sampling};
use super::flow::{StreamError, Unsolved};
use super::ordered::{Ordered, Turn};
use super::parallelism::Parallelism;
use super::{Corrected, DrivenFigures, DrivenSummary, PathDeviation, Prepared, Row};
use deflex_cell::Cell;
use deflex_drive::Waypoint;
use deflex_program::Role;
use deflex_text::Diagnostic;
use std::collections::VecDeque;

/// The driven path of a program so far, in stages: each has what one chunk leaves to the next.
pub(super) struct Followed<'a> {
    cell: &'a Cell,
    course: Ordered<CourseSoFar>,
    programmed: Ordered<Option<Pursuit<'a>>>,
    /// The same of the corrected program.
    corrected: Ordered<Option<Pursuit<'a>>>,
    waiting: Ordered<VecDeque<WaitingRows>>,
}

/// The last waypoints of a program.
#[derive(Default)]
struct CourseSoFar {
    course: Course,
    /// Whether a target has no solution, so that the rows are not used.
    has_failed: bool,
}

/// The next waypoints of a program.
struct NextWaypoints<'c> {
    course: Course,
    /// How the waypoint before them is passed, if there is one.
    settled: Option<Waypoint>,
    prepared: &'c Prepared,
    extent: Extent,
    notes: Vec<Diagnostic>,
}

/// Rows of a chunk that wait for the driven path.
struct WaitingRows {
    rows: Vec<Row>,
    segments: Vec<RowSegment>,
    /// Number of segments whose deviation is known.
    known: usize,
}

impl<'a> Followed<'a> {
    pub(super) fn new(cell: &'a Cell) -> Self {
        Self {
            cell,
            course: Ordered::new(CourseSoFar::default()),
            programmed: Ordered::new(None),
            corrected: Ordered::new(None),
            waiting: Ordered::new(VecDeque::new()),
        }
    }

    /// Follows the next chunk, and replaces its rows by those whose path is known now. `paths` has the deviations of joint motions. With
    /// `commanded`, the program is corrected.
    pub(super) fn follow(
        &self,
        (context, turn): (Context<'_>, &Turn<'_>),
        walked: &WalkedPath<'_>,
        commanded: Option<&Commanded>,
        paths: &[Option<PathDeviation>],
        corrected: &mut Corrected,
    ) -> Result<(), Unsolved> {
        let (cell, prepared) = (self.cell, walked.prepared);
        let has_failed = !corrected.failures.is_empty();
        let next = turn.take(&self.course, |so_far| so_far.next((context, has_failed), prepared))?;
        let Some(next) = next.map_err(|_| not_streamable())? else { return Ok(()) };
        let (mut compared, programmed) = turn.take(&self.programmed, |pursuit| {
            let pursuit = pursuit.get_or_insert_with(|| Pursuit::new(cell, prepared));
            pursuit.go_on(context.parallelism, &next, |driven| driven.append(&next.course))
        })??;
        let mut figures = None;
        if let Some(commanded) = commanded {
            let driven = turn.take(&self.corrected, |pursuit| {
                let pursuit = pursuit.get_or_insert_with(|| Pursuit::new(cell, prepared));
                let correct = |driven: &mut Course| next.course.correct(context, prepared, commanded, driven);
                pursuit.go_on(context.parallelism, &next, correct)
            })??;
            (compared, figures) = (driven.0, Some(driven.1));
        }
        let ends = context.program.targets.iter().zip(paths).filter(|(target, _)| target.role != Role::Via);
        let segments = ends.map(|(target, path)| RowSegment::new(target, *path)).collect();
        let rows = WaitingRows { rows: std::mem::take(&mut corrected.rows), segments, known: 0 };
        turn.take(&self.waiting, |waiting| {
            waiting.push_back(rows);
            release(waiting, compared, &mut corrected.rows);
        })?;
        if next.extent == Extent::Whole {
            corrected.driven = Some(DrivenSummary { programmed, corrected: figures, tolerance_mm: None });
            corrected.notes.extend(next.notes);
        }
        Ok(())
    }
}

/// The driven path cannot be followed chunk by chunk: only the whole program shows why, or how.
fn not_streamable() -> Unsolved {
    Unsolved::Failed(StreamError::NotStreamable)
}

impl CourseSoFar {
    /// The waypoints of the next chunk; `None` if a target has no solution.
    fn next<'c>(
        &mut self,
        (context, has_failed): (Context<'_>, bool),
        prepared: &'c Prepared,
    ) -> Result<Option<NextWaypoints<'c>>, Vec<Diagnostic>> {
        self.has_failed |= has_failed;
        if self.has_failed {
            return Ok(None);
        }
        let (Context { program, cell, .. }, extent) = (context, context.extent());
        let course = &mut self.course;
        let known = course.waypoints.len();
        course.extend(program, cell, prepared, context.own_from())?;
        let mut notes = Vec::new();
        if extent == Extent::Whole {
            course.end(program, cell);
            notes = course.notes(program, cell);
        }
        let settled = known.checked_sub(1).map(|last| course.waypoints[last]);
        let next = NextWaypoints { course: course.without_first(known), settled, prepared, extent, notes };
        // The next chunk looks at the last waypoint again, whose segment begins at the one before.
        course.forget(course.waypoints.len().saturating_sub(2));
        Ok(Some(next))
    }
}

/// Adds the deviations on further segments, and moves the rows that are complete to `rows`.
fn release(waiting: &mut VecDeque<WaitingRows>, compared: Vec<ComparedSegment>, rows: &mut Vec<Row>) {
    let mut compared = compared.into_iter();
    for WaitingRows { segments, known, .. } in waiting.iter_mut() {
        for (segment, compared) in segments[*known..].iter_mut().zip(&mut compared) {
            segment.path = compared.path.or(segment.path);
            *known += 1;
        }
    }
    while waiting.front().is_some_and(|front| front.known == front.segments.len()) {
        let Some(mut done) = waiting.pop_front() else { return };
        fill_paths(&mut done.rows, done.segments.into_iter());
        rows.append(&mut done.rows);
    }
}

/// A motion along the waypoints of a program, of which some are not known yet, and its comparison with the programmed path.
struct Pursuit<'a> {
    follower: Follower<'a>,
    comparison: Comparison<'a>,
    /// The points of the waypoints that the follower still needs.
    prepared: Prepared,
    /// For each of these waypoints, the waypoint of the programmed path to whose segment it belongs.
    origins: Vec<usize>,
    /// Samples near which the programmed path is not known yet.
    loaded: Vec<LoadedSample>,
}

impl<'a> Pursuit<'a> {
    /// The start, with the tools, work objects and laws of the first chunk.
    fn new(cell: &'a Cell, first: &Prepared) -> Self {
        let prepared = first.with_points(Vec::new());
        let follower = Follower::new(cell, Course::default(), first.laws());
        let comparison = Comparison::new(&cell.arm.robot);
        Self { follower, comparison, prepared, origins: Vec::new(), loaded: Vec::new() }
    }

    /// Follows the next waypoints; `add` adds them to the driven course. Returns the segments that are compared now, and the figures so far.
    fn go_on(
        &mut self,
        parallelism: Parallelism,
        next: &NextWaypoints<'_>,
        add: impl FnOnce(&mut Course),
    ) -> Result<(Vec<ComparedSegment>, DrivenFigures), Unsolved> {
        let Self { follower, comparison, prepared, origins, loaded } = self;
        let (course, extent) = (&next.course, next.extent);
        comparison.extend(next.prepared, course);
        let targets = follower.extend(prepared, next.prepared, next.settled, add).map_err(|_| not_streamable())?;
        let mut at = 0;
        origins.extend(targets.map(|target| {
            while course.targets[at] < target {
                at += 1;
            }
            course.ordinal(at)
        }));
        follower.drive(prepared, (extent, Sampling::Sparse), parallelism).map_err(|_| not_streamable())?;
        loaded.extend(follower.load(prepared, extent, parallelism).map_err(|_| not_streamable())?);
        let first = follower.first();
        let origin = |waypoint: usize| origins[waypoint - first];
        let ready = match extent {
            Extent::SoFar => loaded.partition_point(|sample| comparison.reaches(origin(sample.waypoint))),
            Extent::Whole => loaded.len(),
        };
        comparison.drive(&loaded[..ready], &origin, parallelism);
        loaded.drain(..ready);
        let compared = std::iter::from_fn(|| match extent {
            Extent::SoFar => comparison.next(),
            Extent::Whole => comparison.close(),
        });
        let compared = compared.collect();
        comparison.forget();
        let needed = loaded.first().map_or(usize::MAX, |sample| sample.waypoint);
        origins.drain(..follower.forget(prepared, needed));
        Ok((compared, comparison.figures()))
    }
}
