//! Long programs in constant memory: pieces through the line on several threads, written in order.
//!
//! A thread takes a piece from its reading to its writing; what depends on the pieces before stands in the line's ordered
//! passes (see [`Turns`]). So any number of threads gives the same bytes, and those of [`compensate`](super::compensate).

use super::line::{self, Carried};
use super::messages::Messages;
use super::row::Tally;
use super::spread::Spread;
use super::turns::Turns;
use super::{Corrected, Options, Outline, Poster, Row, Summary};
use crate::cell::Cell;
use crate::program::piece::leaves_its_start;
use crate::program::post::Text;
use crate::program::{Next, StraightPiece, cl, rapid};
use crate::text::{Diagnostic, Patch, apply_within};
use std::collections::HashMap;
use std::io::{self, Read, Seek, Write};
use std::sync::{Mutex, PoisonError};

/// Where goes what a streamed program comes to.
pub struct Sinks<'a> {
    /// Report rows, as a format of [`report`](crate::report) writes them; flushed behind the last.
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
    /// Ordinal of the last target.
    pub last: u32,
    /// Why there is no answer for the program as a whole, as from [`Prepared::new`](super::Prepared::new): none but where it
    /// is only judged.
    pub refused: Messages,
    /// Targets that have no answer or pass a limit: what was written is then no program to use.
    pub failures: Vec<Diagnostic>,
    /// Notes and warnings.
    pub notes: Vec<Diagnostic>,
}

impl Streamed {
    pub(super) fn answered(self) -> Result<Self, StreamError> {
        if self.refused.is_empty() { Ok(self) } else { Err(StreamError::Refused(self.refused.all())) }
    }
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

/// Corrects a RAPID program piece by piece on `threads` threads: the same bytes as [`compensate`](super::compensate) and a
/// rewrite, in memory that does not grow with the program.
///
/// # Errors
/// See [`StreamError`]; what was written until then is of no use.
pub fn compensate_pieces<R: Read + Send>(
    pieces: rapid::Pieces<R>,
    cell: &Cell,
    options: &Options,
    threads: usize,
    program: &mut (dyn Write + Send),
    sinks: &mut Sinks<'_>,
) -> Result<Streamed, StreamError> {
    let carried = Carried::new(cell).map_err(StreamError::Refused)?;
    let way = Way {
        pieces: Mutex::new((0, pieces)),
        take: rapid::Pieces::take,
        read: rapid::Piece::read,
        solve: &|n, piece| {
            let corrected = line::piece(&piece.program, cell, options, &carried, n, Spread::Here)?;
            Some(corrected.map(|corrected| (written(piece, &corrected), corrected)).map_err(Unsolved::from))
        },
        break_off: &|| carried.break_off(),
        refusals: Messages::default(),
    };
    let streamed = run(&way, threads, &mut |bytes: Vec<u8>| program.write_all(&bytes), sinks)?.answered()?;
    program.flush().map_err(StreamError::Write)?;
    Ok(streamed)
}

/// Corrects a RAPID program whose targets are declared far from their use, or that runs from routine to routine: in memory is
/// an index of these. What changes is collected in `patch`, to be applied to the program when all went well.
///
/// # Errors
/// See [`StreamError`].
pub fn compensate_declared<R: Read + Seek + Send, S: Read + Write + Seek + Send>(
    pieces: rapid::Declared<R>,
    cell: &Cell,
    options: &Options,
    threads: usize,
    patch: &mut Patch<S>,
    sinks: &mut Sinks<'_>,
) -> Result<Streamed, StreamError> {
    // A clone's name would have to be new to the whole program.
    if options.allow_clones && pieces.shares() {
        return Err(StreamError::NotStraight);
    }
    let carried = Carried::new(cell).map_err(StreamError::Refused)?;
    let way = Way {
        pieces: Mutex::new((0, pieces)),
        take: rapid::Declared::take,
        read: rapid::Piece::read,
        solve: &|n, piece| {
            let corrected = line::piece(&piece.program, cell, options, &carried, n, Spread::Here)?;
            Some(corrected.map(|corrected| (changed(piece, &corrected), corrected)).map_err(Unsolved::from))
        },
        break_off: &|| carried.break_off(),
        refusals: Messages::default(),
    };
    let (mut shared, mut disputed) = (HashMap::new(), false);
    let mut write = |changes: Option<Vec<Changed>>| {
        disputed |= changes.is_none();
        for change in changes.into_iter().flatten() {
            let before = change.shared.and_then(|target| shared.insert(target, change.clone()));
            disputed |= before.as_ref().is_some_and(|before| *before != change);
            if before.is_none() && (change.old > 0 || !change.text.is_empty()) {
                patch.replace(change.start, change.old, &change.text)?;
            }
        }
        if disputed { Err(io::ErrorKind::Other.into()) } else { Ok(()) }
    };
    let done = run(&way, threads, &mut write, sinks);
    // Whoever sees all uses of a target decides.
    if disputed { Err(StreamError::NotStraight) } else { done?.answered() }
}

/// Corrects a CL program and posts it, piece by piece: the same bytes as [`compensate`](super::compensate) and
/// [`post`](super::post). `open` gives the destination of a module's file by its name.
///
/// # Errors
/// See [`StreamError`]; what was written until then is of no use.
pub fn post_pieces<R: Read + Send, W: Write + Send>(
    pieces: cl::Pieces<R>,
    cell: &Cell,
    options: &Options,
    threads: usize,
    poster: &Poster,
    mut open: impl FnMut(&str) -> io::Result<W> + Send,
    sinks: &mut Sinks<'_>,
) -> Result<Streamed, StreamError> {
    let carried = Carried::new(cell).map_err(StreamError::Refused)?;
    let way = Way {
        pieces: Mutex::new((0, pieces)),
        take: cl::Pieces::take,
        read: Some,
        solve: &|n, piece| {
            let corrected = match line::piece(&piece.program, cell, options, &carried, n, Spread::Here)? {
                Ok(corrected) => corrected,
                Err(refused) => {
                    carried.posted.take(n, |_| ())?;
                    return Some(Err(refused.into()));
                }
            };
            let points = poster.points(&piece.program, &corrected);
            let from = carried.posted.take(n, |place| std::mem::replace(place, place.behind(&points)))?;
            Some(Ok((poster.post.stretch(&from, &points, piece.last), corrected)))
        },
        break_off: &|| carried.break_off(),
        refusals: Messages::default(),
    };
    let mut file: Option<W> = None;
    let mut write = |text: &Text| {
        let mut from = 0;
        for (start, name) in &text.files {
            if let Some(mut done) = file.take() {
                done.write_all(&text.bytes[from..*start])?;
                done.flush()?;
            }
            file = Some(open(name)?);
            from = *start;
        }
        file.as_mut().map_or(Ok(()), |file| file.write_all(&text.bytes[from..]))
    };
    write(poster.post.head()).map_err(StreamError::Write)?;
    let mut streamed = run(&way, threads, &mut |text| write(&text), sinks)?.answered()?;
    file.map_or(Ok(()), |mut file| file.flush()).map_err(StreamError::Write)?;
    streamed.notes = [&poster.warnings[..], &streamed.notes, &poster.notes].concat();
    Ok(streamed)
}

/// Counts the points that [`post_pieces`] will write with what is inserted, so that its parts can be laid out: takes as long
/// as that.
///
/// # Errors
/// See [`StreamError`].
pub fn count_pieces<R: Read + Send>(
    pieces: cl::Pieces<R>,
    cell: &Cell,
    options: &Options,
    threads: usize,
    outline: &mut Outline,
    progress: &(dyn Fn(usize, u64) + Sync),
) -> Result<(), StreamError> {
    let carried = Carried::new(cell).map_err(StreamError::Refused)?;
    let way = Way {
        pieces: Mutex::new((0, pieces)),
        take: cl::Pieces::take,
        read: Some,
        solve: &|n, piece| {
            let corrected = line::piece(&piece.program, cell, options, &carried, n, Spread::Here)?;
            Some(corrected.map(|corrected| (corrected.posted.len(), corrected)).map_err(Unsolved::from))
        },
        break_off: &|| carried.break_off(),
        refusals: Messages::default(),
    };
    let mut points = 0;
    let mut count = |posted| {
        points += posted;
        Ok(())
    };
    let mut sinks = Sinks { report: &mut io::sink(), rows: &|_| Vec::new(), each: &mut |_| (), progress };
    run(&way, threads, &mut count, &mut sinks)?.answered()?;
    outline.points = points;
    Ok(())
}

/// How a language comes in, and what is made of it.
pub(super) struct Way<'a, S, P, T> {
    /// The next piece's number, and where it comes from.
    pub(super) pieces: Mutex<(usize, S)>,
    pub(super) take: fn(&mut S) -> io::Result<Next<P>>,
    pub(super) read: fn(P) -> Option<StraightPiece>,
    /// What a piece, of this number, comes to, and what is written of it; `None` where one before it died.
    pub(super) solve: &'a Solve<'a, T>,
    /// Lets no piece wait for one that died.
    pub(super) break_off: &'a (dyn Fn() + Sync),
    /// Where refusals go: none yet.
    pub(super) refusals: Messages,
}

type Solve<'a, T> = dyn Fn(usize, &StraightPiece) -> Option<Result<(T, Corrected), Unsolved>> + Sync + 'a;

/// Why a piece comes to nothing.
pub(super) enum Unsolved {
    /// The program has no answer; the others are looked at all the same.
    Refused(Vec<Diagnostic>),
    /// All stop.
    Stop(StreamError),
}

impl From<Vec<Diagnostic>> for Unsolved {
    fn from(refused: Vec<Diagnostic>) -> Self {
        Self::Refused(refused)
    }
}

/// Takes all pieces through; what they come to is written in order.
pub(super) fn run<'a, S: Send, P, T: Send>(
    way: &'a Way<'a, S, P, T>,
    threads: usize,
    program: &'a mut (dyn FnMut(T) -> io::Result<()> + Send),
    sinks: &'a mut Sinks<'_>,
) -> Result<Streamed, StreamError> {
    let (rows, progress) = (sinks.rows, sinks.progress);
    let writer = Writer { refused: way.refusals.clone(), ..Writer::new(program, sinks) };
    let run = Run { way, writer: Turns::new(writer), stop: Mutex::new(None) };
    std::thread::scope(|scope| {
        for _ in 0..threads.max(1) {
            scope.spawn(|| run.work(rows, progress));
        }
    });
    if let Some(why) = run.stop.into_inner().unwrap_or_else(PoisonError::into_inner) {
        return Err(why);
    }
    run.writer.into_inner().done().map_err(StreamError::Write)
}

struct Run<'a, S, P, T> {
    way: &'a Way<'a, S, P, T>,
    writer: Turns<Writer<'a, T>>,
    /// Why all stop.
    stop: Mutex<Option<StreamError>>,
}

/// A piece, ready to be written.
struct Done<T> {
    /// The program's text, the report's and what both are made from; or why there is none.
    outcome: Result<(T, Vec<u8>, Corrected), Vec<Diagnostic>>,
    /// Ordinal of its last target, where it has any.
    last: Option<u32>,
    bytes: u64,
}

impl<S, P, T> Run<'_, S, P, T> {
    fn work(&self, rows: &(dyn Fn(&[Row]) -> Vec<u8> + Sync), progress: &(dyn Fn(usize, u64) + Sync)) {
        // Also where this thread dies: nobody is left waiting.
        let _others = BreakOff(self);
        while let Some((n, piece)) = self.next() {
            // The feed out of the first target lies in the first piece, or else what follows would have to be looked at.
            let own_start = |piece: &StraightPiece| n > 0 || piece.last || leaves_its_start(&piece.program.targets);
            let Some(piece) = (self.way.read)(piece).filter(own_start) else {
                return self.stop(StreamError::NotStraight);
            };
            let Some(solved) = (self.way.solve)(n, &piece) else { return };
            let outcome = match solved {
                Ok((program, corrected)) => Ok((program, rows(&corrected.rows), corrected)),
                Err(Unsolved::Refused(refused)) => Err(refused),
                Err(Unsolved::Stop(why)) => return self.stop(why),
            };
            let last = piece.program.targets.last().map(|t| t.ordinal);
            let bytes = (piece.own.len() + piece.elsewhere.iter().map(|e| e.own.len()).sum::<usize>()) as u64;
            let done = Done { outcome, last, bytes };
            match self.writer.take(n, |writer| writer.write(done, progress)) {
                Some(Ok(())) => {}
                Some(Err(error)) => return self.stop(StreamError::Write(error)),
                None => return,
            }
        }
    }

    fn next(&self) -> Option<(usize, P)> {
        let mut pieces = self.way.pieces.lock().unwrap_or_else(PoisonError::into_inner);
        let (n, pieces) = &mut *pieces;
        match (self.way.take)(pieces) {
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
        (self.way.break_off)();
        self.writer.break_off();
    }
}

/// Frees the other threads when one dies.
struct BreakOff<'a, 'r, S, P, T>(&'a Run<'r, S, P, T>);

impl<S, P, T> Drop for BreakOff<'_, '_, S, P, T> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.0.break_off();
        }
    }
}

/// The piece's own bytes with its edits.
fn written(piece: &StraightPiece, corrected: &Corrected) -> Vec<u8> {
    let edits = corrected.rewritten.as_ref().and_then(|r| r.edits.first()).map_or(&[][..], Vec::as_slice);
    let mut bytes = Vec::with_capacity(piece.own.len() + piece.own.len() / 4);
    // Writing to a Vec cannot fail.
    let _ = apply_within(&piece.program.sources[0].bytes, piece.own.clone(), edits, &mut bytes);
    bytes
}

/// New text for a stretch of the file.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Changed {
    start: u64,
    /// Bytes; none where there is only more text.
    old: u32,
    text: Vec<u8>,
    /// The declaration of a target that other motions go to as well, by its offset: they have to agree.
    shared: Option<u64>,
}

/// What of the piece's stretch and of its declarations, wherever they stand, has edits; `None` where motions do not agree on
/// a target.
fn changed(piece: &StraightPiece, corrected: &Corrected) -> Option<Vec<Changed>> {
    let rewritten = corrected.rewritten.as_ref().filter(|rewritten| rewritten.kept.is_empty())?;
    let bytes = &piece.program.sources[0].bytes;
    let mut edits = rewritten.edits.first().map_or(&[][..], Vec::as_slice);
    let declared = piece.elsewhere.iter().map(|target| (&target.own, target.at, target.shared.then_some(target.at)));
    let mut out = Vec::new();
    for (own, at, shared) in declared.chain([(&piece.own, piece.at, None)]) {
        let (here, further) = edits.split_at(edits.partition_point(|edit| edit.span.range().start < own.end));
        edits = further;
        if here.is_empty() && shared.is_none() {
            continue;
        }
        let from = here.first().map_or(own.start, |edit| edit.span.range().start);
        let to = here.last().map_or(from, |edit| edit.span.range().end);
        let mut text = Vec::new();
        // Writing to a Vec cannot fail.
        let _ = apply_within(bytes, from..to, here, &mut text);
        #[allow(clippy::cast_possible_truncation)] // within a piece
        out.push(Changed { start: at + (from - own.start) as u64, old: (to - from) as u32, text, shared });
    }
    Some(out)
}

/// What comes out, in order.
struct Writer<'a, T> {
    program: &'a mut (dyn FnMut(T) -> io::Result<()> + Send),
    report: &'a mut (dyn Write + Send),
    each: &'a mut (dyn FnMut(&[Row]) + Send),
    tally: Tally,
    /// Ordinal of the last target.
    last: u32,
    targets: usize,
    bytes: u64,
    refused: Messages,
    failures: Messages,
    notes: Vec<Diagnostic>,
}

impl<'a, T> Writer<'a, T> {
    fn new(program: &'a mut (dyn FnMut(T) -> io::Result<()> + Send), sinks: &'a mut Sinks<'_>) -> Self {
        Self {
            program,
            report: &mut *sinks.report,
            each: &mut *sinks.each,
            tally: Tally::default(),
            last: 0,
            targets: 0,
            bytes: 0,
            refused: Messages::default(),
            failures: Messages::default(),
            notes: Vec::new(),
        }
    }

    fn write(&mut self, done: Done<T>, progress: &(dyn Fn(usize, u64) + Sync)) -> io::Result<()> {
        self.last = done.last.unwrap_or(self.last);
        self.bytes += done.bytes;
        let (program, report, corrected) = match done.outcome {
            Ok(outcome) => outcome,
            Err(refused) => {
                self.refused.add_once(refused);
                return Ok(());
            }
        };
        self.failures.add(corrected.failures);
        self.notes.extend(corrected.notes);
        self.tally.add(&corrected.rows);
        (self.each)(&corrected.rows);
        self.targets += corrected.rows.len();
        progress(self.targets, self.bytes);
        if self.refused.is_empty() && self.failures.is_empty() {
            (self.program)(program)?;
            self.report.write_all(&report)?;
        }
        Ok(())
    }

    fn done(self) -> io::Result<Streamed> {
        self.report.flush()?;
        Ok(Streamed {
            summary: self.tally.summary(),
            last: self.last,
            refused: self.refused,
            failures: self.failures.all(),
            notes: self.notes,
        })
    }
}
