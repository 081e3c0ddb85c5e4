//! Long programs in constant memory: pieces through the line on several threads, written in order.
//!
//! A thread takes a piece from its reading to its writing; what depends on the pieces before stands in the line's ordered
//! passes (see [`Turns`]). So any number of threads gives the same bytes, and those of [`compensate`](super::compensate).

use super::line::{self, Carried};
use super::row::Tally;
use super::solve::Spread;
use super::turns::Turns;
use super::{Corrected, Options, Row, Summary};
use crate::cell::Cell;
use crate::program::rapid::{Next, Pieces, StraightPiece};
use crate::program::{Goal, Program};
use crate::text::{Diagnostic, apply};
use nalgebra::Vector3;
use std::io::{self, Read, Write};
use std::sync::{Mutex, PoisonError};

/// Where a streamed program goes.
pub struct Sinks<'a> {
    /// The corrected program.
    pub program: &'a mut (dyn Write + Send),
    /// Report rows, as a format of [`report`](crate::report) writes them.
    pub report: &'a mut (dyn Write + Send),
    /// Report rows to text.
    pub rows: &'a (dyn Fn(&[Row]) -> Vec<u8> + Sync),
    /// Given the report rows in running order, a piece at a time.
    pub each: &'a mut (dyn FnMut(&[Row]) + Send),
    /// Told the targets and the bytes of input done so far.
    pub progress: &'a (dyn Fn(usize, u64) + Sync),
}

/// A program that went through.
#[derive(Debug)]
pub struct Streamed {
    /// Counts and sizes.
    pub summary: Summary,
    /// Targets that have no answer or pass a limit: what was written is then no program to use.
    pub failures: Vec<Diagnostic>,
    /// Notes and warnings.
    pub notes: Vec<Diagnostic>,
}

/// Why a program did not go through.
#[derive(Debug)]
pub enum StreamError {
    /// Something in it only [`compensate`](super::compensate) on the whole can tell the meaning of.
    NotStraight,
    /// What [`compensate`](super::compensate) refuses.
    Refused(Vec<Diagnostic>),
    /// The input cannot be read.
    Read(io::Error),
    /// An output cannot be written.
    Write(io::Error),
}

/// More messages than this are only counted: a wrong cell fails at every target.
const MOST_MESSAGES: usize = 1000;

/// Corrects a program piece by piece on `threads` threads: the same bytes as [`compensate`](super::compensate) and a
/// rewrite, in memory that does not grow with the program.
///
/// # Errors
/// See [`StreamError`]; what was written until then is of no use.
pub fn compensate_pieces<R: Read + Send>(
    pieces: Pieces<R>,
    cell: &Cell,
    options: &Options,
    threads: usize,
    sinks: &mut Sinks<'_>,
) -> Result<Streamed, StreamError> {
    let carried = Carried::new(cell).map_err(StreamError::Refused)?;
    let (rows, progress) = (sinks.rows, sinks.progress);
    let run = Run {
        cell,
        options,
        carried: &carried,
        reader: Mutex::new((0, pieces)),
        writer: Turns::new(Writer::new(sinks)),
        stop: Mutex::new(None),
    };
    std::thread::scope(|scope| {
        for _ in 0..threads.max(1) {
            scope.spawn(|| run.work(rows, progress));
        }
    });
    if let Some(why) = run.stop.into_inner().unwrap_or_else(PoisonError::into_inner) {
        return Err(why);
    }
    run.writer.into_inner().done()
}

struct Run<'a, R> {
    cell: &'a Cell,
    options: &'a Options,
    carried: &'a Carried<'a>,
    /// The next piece's number, and where it comes from.
    reader: Mutex<(usize, Pieces<R>)>,
    writer: Turns<Writer<'a>>,
    /// Why all stop.
    stop: Mutex<Option<StreamError>>,
}

/// A piece, ready to be written.
struct Done {
    program: Vec<u8>,
    report: Vec<u8>,
    corrected: Corrected,
    bytes: u64,
}

impl<R: Read> Run<'_, R> {
    fn work(&self, rows: &(dyn Fn(&[Row]) -> Vec<u8> + Sync), progress: &(dyn Fn(usize, u64) + Sync)) {
        // Also where this thread dies: nobody is left waiting.
        let _others = BreakOff(self);
        while let Some((n, piece)) = self.next() {
            let bytes = piece.len() as u64;
            let Some(piece) = piece.read().filter(|piece| n > 0 || starts_in_itself(piece)) else {
                return self.stop(StreamError::NotStraight);
            };
            let corrected = line::piece(&piece.program, self.cell, self.options, self.carried, n, Spread::Here);
            let Some(corrected) = corrected else { return };
            let done = corrected.map(|corrected| Done {
                program: written(&piece, &corrected),
                report: rows(&corrected.rows),
                corrected,
                bytes,
            });
            match self.writer.take(n, |writer| writer.write(done, progress)) {
                Some(Ok(())) => {}
                Some(Err(error)) => return self.stop(StreamError::Write(error)),
                None => return,
            }
        }
    }

    fn next(&self) -> Option<(usize, crate::program::rapid::Piece)> {
        let mut reader = self.reader.lock().unwrap_or_else(PoisonError::into_inner);
        let (n, pieces) = &mut *reader;
        match pieces.take() {
            Ok(Next::Piece(piece)) => {
                *n += 1;
                return Some((*n - 1, piece));
            }
            Ok(Next::End) => {}
            Ok(Next::NotStraight) => self.stop(StreamError::NotStraight),
            Err(error) => self.stop(StreamError::Read(error)),
        }
        None
    }

    fn stop(&self, why: StreamError) {
        self.stop.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(why);
        self.break_off();
    }

    fn break_off(&self) {
        self.carried.break_off();
        self.writer.break_off();
    }
}

/// Frees the other threads when one dies.
struct BreakOff<'a, 'r, R: Read>(&'a Run<'r, R>);

impl<R: Read> Drop for BreakOff<'_, '_, R> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.0.break_off();
        }
    }
}

/// Whether the feed out of the first target lies in the first piece: what follows is not looked at.
fn starts_in_itself(piece: &StraightPiece) -> bool {
    let position = |program: &Program, i: usize| match program.targets[i].goal {
        Goal::Pose { position_mm, .. } | Goal::Axis { position_mm, .. } => Some(Vector3::from(position_mm)),
        Goal::Joints { .. } => None,
    };
    let program = &piece.program;
    let Some(first) = program.targets.first() else { return piece.last };
    let Some(from) = position(program, 0) else { return true };
    /// Further than what gives no direction, mm.
    const APART: f64 = 0.01;
    let decided = |i: usize| {
        program.targets[i].wobj != first.wobj || position(program, i).is_some_and(|to| (to - from).norm() > APART)
    };
    piece.last || (1..program.targets.len()).any(decided)
}

/// The piece's own bytes with its edits.
fn written(piece: &StraightPiece, corrected: &Corrected) -> Vec<u8> {
    let source = &piece.program.sources[0].bytes;
    let edits = corrected.rewritten.as_ref().and_then(|r| r.edits.first()).map_or(&[][..], Vec::as_slice);
    let mut bytes = Vec::with_capacity(source.len() + source.len() / 4);
    // Writing to a Vec cannot fail.
    let _ = apply(source, edits, &mut bytes);
    bytes.truncate(bytes.len() - (source.len() - piece.own.end));
    bytes.drain(..piece.own.start);
    bytes
}

/// What comes out, in order.
struct Writer<'a> {
    program: &'a mut (dyn Write + Send),
    report: &'a mut (dyn Write + Send),
    each: &'a mut (dyn FnMut(&[Row]) + Send),
    tally: Tally,
    targets: usize,
    bytes: u64,
    refused: Messages,
    failures: Messages,
    notes: Vec<Diagnostic>,
}

impl<'a> Writer<'a> {
    fn new(sinks: &'a mut Sinks<'_>) -> Self {
        Self {
            program: &mut *sinks.program,
            report: &mut *sinks.report,
            each: &mut *sinks.each,
            tally: Tally::default(),
            targets: 0,
            bytes: 0,
            refused: Messages::default(),
            failures: Messages::default(),
            notes: Vec::new(),
        }
    }

    fn write(&mut self, done: Result<Done, Vec<Diagnostic>>, progress: &(dyn Fn(usize, u64) + Sync)) -> io::Result<()> {
        let done = match done {
            Ok(done) => done,
            Err(refused) => {
                self.refused.add(refused);
                return Ok(());
            }
        };
        self.failures.add(done.corrected.failures);
        self.notes.extend(done.corrected.notes);
        self.tally.add(&done.corrected.rows);
        (self.each)(&done.corrected.rows);
        self.targets += done.corrected.rows.len();
        self.bytes += done.bytes;
        progress(self.targets, self.bytes);
        if self.refused.count + self.failures.count == 0 {
            self.program.write_all(&done.program)?;
            self.report.write_all(&done.report)?;
        }
        Ok(())
    }

    fn done(self) -> Result<Streamed, StreamError> {
        if self.refused.count > 0 {
            return Err(StreamError::Refused(self.refused.all()));
        }
        Ok(Streamed { summary: self.tally.summary(), failures: self.failures.all(), notes: self.notes })
    }
}

/// The first messages, and how many there were.
#[derive(Default)]
struct Messages {
    first: Vec<Diagnostic>,
    count: usize,
}

impl Messages {
    fn add(&mut self, messages: Vec<Diagnostic>) {
        self.count += messages.len();
        let room = MOST_MESSAGES - self.first.len();
        self.first.extend(messages.into_iter().take(room));
    }

    fn all(mut self) -> Vec<Diagnostic> {
        if self.count > self.first.len() {
            let more = format!("{} more targets have messages like these", self.count - self.first.len());
            self.first.push(Diagnostic::error("target.more", "", more));
        }
        self.first
    }
}
