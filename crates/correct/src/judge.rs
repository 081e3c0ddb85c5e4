//! Judges long programs a chunk at a time, with the results of [`predict`](super::predict) for the whole program.

use super::against::{Original, other_count};
use super::along::WayFinding;
use super::carried::Carried;
use super::context::Context;
use super::flow::Unsolved;
use super::flow::{self, Sinks, Source, StreamError, Streamed};
use super::line::Stages;
use super::messages::Messages;
use super::ordered::{Ordered, Turn};
use super::path;
use super::point::Point;
use super::{Corrected, Options, Prepared, Row};
use deflex_cell::Cell;
use deflex_program::chunk::leaves_its_start;
use deflex_program::{AnyChunks, ChunkReader, Next, Program, StreamableChunk};
use deflex_text::Diagnostic;
use std::collections::VecDeque;
use std::io::{Read, Seek};
use std::sync::Mutex;

/// The judge of the results of each chunk.
///
/// # Examples
/// ```
/// use deflex_correct::Judge;
///
/// /// How many findings a run has kept at most.
/// fn most(judge: &Judge<'_>) -> usize {
///     judge.refusals
/// }
/// ```
pub struct Judge<'a> {
    /// Whether the program is corrected too, for the limits that a correction would exceed.
    pub corrects: bool,
    /// Most refusals that are kept.
    pub refusals: usize,
    /// Computes the findings of a chunk.
    #[doc(hidden)]
    pub findings: &'a (dyn Fn(Judged<'_>) -> Vec<Diagnostic> + Sync),
    /// Receives the findings, in running order.
    pub found: &'a mut (dyn FnMut(Vec<Diagnostic>) + Send),
}

/// A chunk of a program, or all of it, with the prediction for the cell.
#[doc(hidden)]
pub struct Judged<'a> {
    /// The program.
    pub program: &'a Program,
    /// One row for each executed motion, in running order; targets that failed have none.
    pub rows: &'a [Row],
    /// Targets that have no solution, corrected or as they are.
    pub failures: Vec<Diagnostic>,
    /// Distance of each target of the program from that of the original, mm; empty without an original.
    pub moved_mm: &'a [f64],
    /// Findings on the segments to targets.
    pub on_the_way: &'a [WayFinding],
}

/// Predicts where the cell would cut with a long program, with errors counted from `original`. The rows are those of
/// [`predict`](super::predict); the memory does not grow with the program. With a judge, targets without a solution are its findings and
/// no failures, and [`Streamed::refused`] is not an error.
///
/// # Errors
/// See [`StreamError`].
///
/// # Examples
/// ```
/// # use deflex_cell::Cell;
/// # use deflex_correct::{Options, Sinks, StreamError, Streamed};
/// use deflex_correct::predict_chunks;
/// use deflex_program::AnyChunks;
/// use std::fs::File;
///
/// /// Predicts the errors of a program as it is.
/// fn predict(chunks: AnyChunks<File>, cell: &Cell, sinks: &mut Sinks<'_>) -> Result<Streamed, StreamError> {
///     predict_chunks(chunks, None, cell, &Options::default(), 4, None, sinks)
/// }
/// ```
pub fn predict_chunks<R: Read + Seek + Send>(
    chunks: AnyChunks<R>,
    original: Option<AnyChunks<R>>,
    cell: &Cell,
    options: &Options,
    threads: usize,
    judge: Option<Judge<'_>>,
    sinks: &mut Sinks<'_>,
) -> Result<Streamed, StreamError> {
    // An original has its own turns.
    if super::is_held_whole(cell, options) || (original.is_some() && options.turns.is_some()) {
        return Err(StreamError::NotStreamable);
    }
    // Findings need the rows of their own chunk, and the text between two motions shows where the controller waits.
    let is_followed = original.is_none() && judge.is_none() && chunks.is_in_place();
    if cell.controller.path.is_some() && !is_followed {
        return Err(StreamError::NotStreamable);
    }
    let stages = || Stages::new(cell, Carried::with_turns(cell, options.turns.as_ref()));
    let prediction = stages();
    let correction = judge.as_ref().filter(|judge| judge.corrects).map(|_| stages());
    let original = original.map(|chunks| Ordered::new(OriginalChunks::new(chunks, Carried::new(cell))));
    let (refusals, findings, found) = match judge {
        Some(judge) => (Messages::with_room(judge.refusals), Some(judge.findings), Some(judge.found)),
        None => (Messages::default(), None, None),
    };
    let solve = |turn: &Turn<'_>, chunk: &StreamableChunk| -> Result<(Vec<Diagnostic>, Corrected), Unsolved> {
        let (program, context) = (&chunk.program, Context::chunk(chunk, cell, options).driven());
        let prepared = prediction.prepare(context, turn);
        let corrected = correction.as_ref().map(|stages| stages.correct(context, turn));
        let counted_from = match &original {
            Some(chunks) => {
                let original = turn.take(chunks, |chunks| chunks.next(context))?;
                // The reasons of the refusal are reported at the end.
                Some(original.map_err(Unsolved::Failed).and_then(|original| original.ok_or(Vec::new().into())))
            }
            None => None,
        };
        let mut prepared = prepared?;
        let counted_from = match counted_from {
            Some(original) => {
                prepared.judge_against(&original?, (program, cell))?;
                Original::Alike
            }
            None => Original::Itself,
        };
        let mut predicted = prediction.predict(context, turn, &prepared, &counted_from)?;
        let Some(findings) = findings else { return Ok((Vec::new(), predicted)) };
        let mut failures = std::mem::take(&mut predicted.failures);
        if let Some(corrected) = corrected {
            failures.extend(corrected?.failures);
        }
        let Corrected { rows, moved_mm, on_the_way, .. } = &predicted;
        Ok((findings(Judged { program, rows, failures, moved_mm, on_the_way }), predicted))
    };
    let source = Source { chunks: Mutex::new((0, chunks)), solve: &solve, refusals };
    let mut found = found;
    let mut pass_on = |findings: Vec<Diagnostic>| {
        if let Some(found) = &mut found {
            found(findings);
        }
        Ok(())
    };
    let mut streamed = flow::run(&source, threads, &mut pass_on, sinks)?;
    let warnings = source.chunks.into_inner().map(|(_, chunks)| chunks.warnings()).unwrap_or_default();
    streamed.notes.splice(0..0, warnings);
    if streamed.refused.is_empty()
        && let Some(original) = original
    {
        original.into_inner().done(cell, options)?;
    }
    if findings.is_some() { Ok(streamed) } else { streamed.answered() }
}

/// The original of a corrected program, read along with it.
struct OriginalChunks<'a, R> {
    chunks: AnyChunks<R>,
    path: Carried<'a>,
    /// Points that are read and not yet used.
    points: VecDeque<Point>,
    /// The laws and settings of the points.
    prepared: Option<Prepared>,
    /// Name of the first source of the corrected program.
    name: String,
    /// Numbers of targets of the corrected program and of the original so far.
    targets: usize,
    original_targets: usize,
    begun: bool,
    ended: bool,
    refused: Messages,
}

impl<'a, R: Read + Seek> OriginalChunks<'a, R> {
    fn new(chunks: AnyChunks<R>, path: Carried<'a>) -> Self {
        Self {
            chunks,
            path,
            points: VecDeque::new(),
            prepared: None,
            name: String::new(),
            targets: 0,
            original_targets: 0,
            begun: false,
            ended: false,
            refused: Messages::default(),
        }
    }

    /// As many targets as the next chunk of the program has; `None` if one is refused. If the program has more targets than the original,
    /// some were inserted, and only the whole program shows which.
    fn next(&mut self, context: Context<'_>) -> Result<Option<Prepared>, StreamError> {
        let Context { program, cell, options, .. } = context;
        let count = program.targets.len();
        self.targets += count;
        if self.name.is_empty() {
            self.name = program.sources.first().map_or_else(String::new, |source| source.name.clone());
        }
        while self.original_targets < self.targets && !self.ended {
            self.read(cell, options)?;
        }
        if self.original_targets < self.targets {
            return Err(StreamError::NotStreamable);
        }
        let Some(prepared) = self.prepared.as_ref().filter(|_| self.refused.is_empty()) else { return Ok(None) };
        Ok(Some(prepared.with_points(self.points.drain(..count).collect())))
    }

    /// Reads its next chunk.
    fn read(&mut self, cell: &Cell, options: &Options) -> Result<(), StreamError> {
        let chunk = match self.chunks.take().map_err(StreamError::Read)? {
            Next::Chunk(chunk) => chunk.read().ok_or(StreamError::NotStreamable)?,
            Next::End => {
                self.ended = true;
                return Ok(());
            }
            Next::NotStreamable => return Err(StreamError::NotStreamable),
        };
        // As for the program itself: the first chunk decides the direction out of the first target.
        if !(std::mem::replace(&mut self.begun, true) || chunk.last || leaves_its_start(&chunk.program.targets)) {
            return Err(StreamError::NotStreamable);
        }
        self.original_targets += chunk.program.targets.len();
        match path::prepare(Context::chunk(&chunk, cell, options), &mut self.path) {
            Ok(mut prepared) => {
                self.points.extend(prepared.points.drain(..));
                self.prepared = Some(prepared);
            }
            Err(refused) => self.refused.add_once(refused),
        }
        Ok(())
    }

    /// Checks that the original has no more targets than the program.
    fn done(mut self, cell: &Cell, options: &Options) -> Result<(), StreamError> {
        while !self.ended {
            self.read(cell, options)?;
            self.points.clear();
        }
        let refused = if self.refused.is_empty() && self.targets != self.original_targets {
            vec![other_count(&self.name, self.targets, self.original_targets)]
        } else {
            self.refused.all()
        };
        if refused.is_empty() { Ok(()) } else { Err(StreamError::Refused(refused)) }
    }
}
