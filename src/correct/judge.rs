//! Long programs judged as they are, a chunk at a time: what [`predict`](super::predict) says of the whole.

use super::against::other_count;
use super::along::WayFinding;
use super::carried;
use super::flow::{self, Sinks, StreamError, Streamed, Unsolved, WalkedPath};
use super::line::{self, Carried, WithOriginal};
use super::messages::Messages;
use super::ordered::OrderedStage;
use super::parallelism::Parallelism;
use super::path;
use super::point::Point;
use super::{Corrected, Options, Prepared, Row};
use crate::cell::Cell;
use crate::program::chunk::leaves_its_start;
use crate::program::{AnyChunks, ChunkReader, Next, Program};
use crate::text::Diagnostic;
use std::collections::VecDeque;
use std::io::{Read, Seek};
use std::sync::Mutex;

/// Who looks at what each chunk came to.
pub struct Judge<'a> {
    /// Whether the program is corrected too, for the limits that this would pass.
    pub corrects: bool,
    /// Most refusals that are held.
    pub refusals: usize,
    /// What is wrong with a chunk.
    pub findings: &'a (dyn Fn(Judged<'_>) -> Vec<Diagnostic> + Sync),
    /// Told of it, in running order.
    pub found: &'a mut (dyn FnMut(Vec<Diagnostic>) + Send),
}

/// A chunk of a program, or all of it, as the cell would cut it.
pub struct Judged<'a> {
    /// The program.
    pub program: &'a Program,
    /// One row an executed motion, in running order; targets that failed have none.
    pub rows: &'a [Row],
    /// Targets that have no answer, corrected or as they are.
    pub failures: Vec<Diagnostic>,
    /// How far each target of the program is from its place in the original, mm, as far as there is one.
    pub moved_mm: &'a [f64],
    /// What is wrong on the ways into targets.
    pub on_the_way: &'a [WayFinding],
}

/// Predicts what the cell would make of a long program, `original` being what errors are counted from: the same rows as
/// [`predict`](super::predict), in memory that does not grow with the program. With a judge, targets without an answer are
/// for it to say and no failures, and [`Streamed::refused`] is not an error.
///
/// # Errors
/// See [`StreamError`].
pub fn predict_chunks<R: Read + Seek + Send>(
    chunks: AnyChunks<R>,
    original: Option<AnyChunks<R>>,
    cell: &Cell,
    options: &Options,
    threads: usize,
    judge: Option<Judge<'_>>,
    sinks: &mut Sinks<'_>,
) -> Result<Streamed, StreamError> {
    // The turns of an original are its own.
    if super::is_held_whole(cell, options) || (original.is_some() && options.turns.is_some()) {
        return Err(StreamError::NotStreamable);
    }
    let path = OrderedStage::new(carried::Carried::with_turns(cell, options.turns.as_ref()));
    let ends = OrderedStage::new(None);
    let original = original.map(|chunks| OrderedStage::new(Original::new(chunks, carried::Carried::new(cell))));
    let corrects = judge.as_ref().is_some_and(|judge| judge.corrects);
    let carried = corrects.then(|| Carried::new(cell, options.turns.as_ref()));
    let (refusals, findings, found) = match judge {
        Some(judge) => (Messages::with_room(judge.refusals), Some(judge.findings), Some(judge.found)),
        None => (Messages::default(), None, None),
    };
    let solve = |n: usize, program: &Program| -> Option<Result<(Vec<Diagnostic>, Corrected), Unsolved>> {
        let prepared = path.take(n, |path| path::prepare(program, cell, options, path))?;
        let correction = carried.as_ref().map(|c| line::chunk(program, cell, options, c, n, Parallelism::Here));
        let before = match &original {
            Some(original) => Some(original.take(n, |o| o.next(program, cell, options))?),
            None => None,
        };
        let judged = prepared.map_err(Unsolved::from).and_then(|mut prepared| match before {
            None => Ok(prepared),
            Some(Ok(Some(original))) => {
                prepared.judge_against(&original, (program, cell))?;
                Ok(prepared)
            }
            // Why is said when all has been looked at.
            Some(Ok(None)) => Err(Vec::new().into()),
            Some(Err(why)) => Err(Unsolved::Stop(why)),
        });
        let prepared = match judged {
            Ok(prepared) => prepared,
            Err(why) => {
                ends.take(n, |_| ())?;
                return Some(Err(why));
            }
        };
        let prepared = WithOriginal { prepared: &prepared, subdivided: None, is_judged: original.is_some() };
        let mut predicted = line::warm_start(program, cell, options, (prepared, &ends), n, Parallelism::Here)?;
        let Some(findings) = findings else { return Some(Ok((Vec::new(), predicted))) };
        let mut failures = std::mem::take(&mut predicted.failures);
        if let Some(correction) = correction {
            match correction? {
                Ok(corrected) => failures.extend(corrected.failures),
                Err(refused) => return Some(Err(refused.into())),
            }
        }
        let Corrected { rows, moved_mm, on_the_way, .. } = &predicted;
        Some(Ok((findings(Judged { program, rows, failures, moved_mm, on_the_way }), predicted)))
    };
    let way = WalkedPath {
        chunks: Mutex::new((0, chunks)),
        solve: &|n, chunk| solve(n, &chunk.program),
        break_off: &|| {
            path.break_off();
            ends.break_off();
            carried.iter().for_each(Carried::break_off);
            original.iter().for_each(OrderedStage::break_off);
        },
        refusals,
    };
    let mut found = found;
    let mut told = |findings: Vec<Diagnostic>| {
        if let Some(found) = &mut found {
            found(findings);
        }
        Ok(())
    };
    let mut streamed = flow::run(&way, threads, &mut told, sinks)?;
    let warnings = way.chunks.into_inner().map(|(_, chunks)| chunks.warnings()).unwrap_or_default();
    streamed.notes.splice(0..0, warnings);
    if streamed.refused.is_empty()
        && let Some(original) = original
    {
        original.into_inner().done(cell, options)?;
    }
    if findings.is_some() { Ok(streamed) } else { streamed.answered() }
}

/// The original of a corrected program, read along with it.
struct Original<'a, R> {
    chunks: AnyChunks<R>,
    path: carried::Carried<'a>,
    /// Read, and not yet asked for.
    points: VecDeque<Point>,
    /// The points' laws and the like.
    prepared: Option<Prepared>,
    /// The corrected program's first source.
    name: String,
    /// Targets of either program so far.
    asked: usize,
    came: usize,
    begun: bool,
    ended: bool,
    refused: Messages,
}

impl<'a, R: Read + Seek> Original<'a, R> {
    fn new(chunks: AnyChunks<R>, path: carried::Carried<'a>) -> Self {
        Self {
            chunks,
            path,
            points: VecDeque::new(),
            prepared: None,
            name: String::new(),
            asked: 0,
            came: 0,
            begun: false,
            ended: false,
            refused: Messages::default(),
        }
    }

    /// As many targets as the next chunk of the program has; `None` where one is refused. A program with more targets has some
    /// inserted: which, is told by the whole of it.
    fn next(&mut self, program: &Program, cell: &Cell, options: &Options) -> Result<Option<Prepared>, StreamError> {
        let count = program.targets.len();
        self.asked += count;
        if self.name.is_empty() {
            self.name = program.sources.first().map_or_else(String::new, |source| source.name.clone());
        }
        while self.came < self.asked && !self.ended {
            self.read(cell, options)?;
        }
        if self.came < self.asked {
            return Err(StreamError::NotStreamable);
        }
        let Some(prepared) = self.prepared.as_ref().filter(|_| self.refused.is_empty()) else { return Ok(None) };
        let prepared = Prepared {
            points: self.points.drain(..count).collect(),
            before: None,
            started: prepared.started,
            settings: prepared.settings.clone(),
            laws: prepared.laws.clone(),
            fronts: prepared.fronts.clone(),
            turns_are_chosen: false,
            notes: Vec::new(),
        };
        Ok(Some(prepared))
    }

    /// Reads its next chunk.
    fn read(&mut self, cell: &Cell, options: &Options) -> Result<(), StreamError> {
        let chunk = match self.chunks.take().map_err(StreamError::Read)? {
            Next::Chunk(chunk) => AnyChunks::<R>::read(chunk).ok_or(StreamError::NotStreamable)?,
            Next::End => {
                self.ended = true;
                return Ok(());
            }
            Next::NotStreamable => return Err(StreamError::NotStreamable),
        };
        // As of the program itself: the feed out of the first target is told by the first chunk.
        if !(std::mem::replace(&mut self.begun, true) || chunk.last || leaves_its_start(&chunk.program.targets)) {
            return Err(StreamError::NotStreamable);
        }
        self.came += chunk.program.targets.len();
        match path::prepare(&chunk.program, cell, options, &mut self.path) {
            Ok(mut prepared) => {
                self.points.extend(prepared.points.drain(..));
                self.prepared = Some(prepared);
            }
            Err(refused) => self.refused.add_once(refused),
        }
        Ok(())
    }

    /// Whether it has no more targets than the program.
    fn done(mut self, cell: &Cell, options: &Options) -> Result<(), StreamError> {
        while !self.ended {
            self.read(cell, options)?;
            self.points.clear();
        }
        let refused = if self.refused.is_empty() && self.asked != self.came {
            vec![other_count(&self.name, self.asked, self.came)]
        } else {
            self.refused.all()
        };
        if refused.is_empty() { Ok(()) } else { Err(StreamError::Refused(refused)) }
    }
}
