//! Chunks of a program from their reading to their writing, on several threads.
//!
//! A thread takes a chunk through all stages. Everything that depends on the chunks before goes through [`Ordered`] stages, of which the
//! last is the writing. Any number of threads therefore gives the same bytes.

use super::messages::{Messages, Repeated};
use super::ordered::{Order, Ordered, Stopped, Turn};
use super::row::Tally;
use super::{Corrected, DrivenSummary, Row, Summary};
use deflex_program::chunk::leaves_its_start;
use deflex_program::rapid::Names;
use deflex_program::{ChunkReader, Next, StreamableChunk, UnreadChunk};
use deflex_text::Diagnostic;
use std::io::{self, Write};
use std::sync::{Mutex, PoisonError};

/// The receivers of the results of a streamed program.
///
/// # Examples
/// ```
/// use deflex_correct::Sinks;
///
/// // Discards the report and the progress of a long program.
/// let sinks = Sinks { report: &mut std::io::sink(), rows: &|_| vec![], each: &mut |_| (), progress: &|_, _| () };
/// ```
pub struct Sinks<'a> {
    /// Report rows, as a format of the report writes them; flushed after the last.
    pub report: &'a mut (dyn Write + Send),
    /// Makes text of report rows.
    pub rows: &'a (dyn Fn(&[Row]) -> Vec<u8> + Sync),
    /// Receives the report rows in running order, a chunk at a time.
    pub each: &'a mut (dyn FnMut(&[Row]) + Send),
    /// Receives the targets and the bytes of input done so far.
    pub progress: &'a (dyn Fn(usize, u64) + Sync),
}

/// The results of a program that was streamed to its end.
///
/// # Examples
/// ```
/// use deflex_correct::Streamed;
///
/// /// Whether the output of a long program may be used.
/// fn is_good(streamed: &Streamed) -> bool {
///     streamed.failures.is_empty()
/// }
/// ```
#[derive(Debug)]
pub struct Streamed {
    /// Counts and sizes.
    pub summary: Summary,
    /// Ordinal of the last target.
    pub last: u32,
    /// Why the program as a whole has no result, as from [`Prepared::new`](super::Prepared::new). Empty, unless the program is only
    /// judged.
    pub refused: Messages,
    /// Targets that have no solution or exceed a limit: what was written must then not be used.
    pub failures: Vec<Diagnostic>,
    /// Notes and warnings.
    pub notes: Vec<Diagnostic>,
    /// Figures of the driven path, if it was computed.
    pub driven: Option<DrivenSummary>,
    /// Names of its targets and of those of its original, if they have any and the way of reading keeps them.
    pub(super) names: Vec<Names>,
}

impl Streamed {
    /// Whether a target has this name.
    #[must_use]
    #[doc(hidden)]
    pub fn has_target(&self, name: &str) -> bool {
        self.names.iter().any(|names| names.uses(name))
    }

    pub(super) fn answered(self) -> Result<Self, StreamError> {
        if self.refused.is_empty() { Ok(self) } else { Err(StreamError::Refused(self.refused.all())) }
    }
}

/// Why a program was not streamed to its end.
///
/// # Examples
/// ```
/// use deflex_correct::StreamError;
///
/// /// Whether the program has to be read as a whole.
/// fn needs_memory(error: &StreamError) -> bool {
///     matches!(error, StreamError::NotStreamable)
/// }
/// assert!(needs_memory(&StreamError::NotStreamable));
/// ```
#[derive(Debug)]
pub enum StreamError {
    /// Its meaning is known only to [`compensate`](super::compensate), which reads the whole program.
    NotStreamable,
    /// The program is refused, as by [`compensate`](super::compensate).
    Refused(Vec<Diagnostic>),
    /// The input cannot be read.
    Read(io::Error),
    /// An output cannot be written.
    Write(io::Error),
}

/// The chunks of a program, and their processing.
pub(super) struct Source<'a, C, T> {
    /// The number of the next chunk, and its reader.
    pub(super) chunks: Mutex<(usize, C)>,
    /// Computes the results of a chunk, and its text.
    pub(super) solve: &'a Solve<'a, T>,
    /// Receives refusals; empty at the start.
    pub(super) refusals: Messages,
}

/// Why a chunk of a program has no result.
pub(super) enum Unsolved {
    /// The program is refused; its other chunks are still processed, so that all reasons are reported.
    Refused(Vec<Diagnostic>),
    /// The run has to stop.
    Failed(StreamError),
    /// The run is stopping already.
    Stopped,
}

impl Unsolved {
    /// The reasons why a program that is held as a whole is refused: no other chunk can stop its run.
    pub(super) fn refused(self) -> Vec<Diagnostic> {
        match self {
            Self::Refused(why) => why,
            Self::Failed(_) | Self::Stopped => Vec::new(),
        }
    }
}

impl From<Vec<Diagnostic>> for Unsolved {
    fn from(refused: Vec<Diagnostic>) -> Self {
        Self::Refused(refused)
    }
}

impl From<Stopped> for Unsolved {
    fn from(_: Stopped) -> Self {
        Self::Stopped
    }
}

type Solve<'a, T> = dyn Fn(&Turn<'_>, &StreamableChunk) -> Result<(T, Corrected), Unsolved> + Sync + 'a;

/// Processes all chunks; their results are written in order.
pub(super) fn run<'a, C: ChunkReader + Send, T: Send>(
    source: &'a Source<'a, C, T>,
    threads: usize,
    program: &'a mut (dyn FnMut(T) -> io::Result<()> + Send),
    sinks: &'a mut Sinks<'_>,
) -> Result<Streamed, StreamError> {
    let rows = sinks.rows;
    let so_far = SoFar { refused: source.refusals.clone(), ..SoFar::default() };
    let writer = Writer { program, sinks, so_far };
    let run = Run { source, order: Order::default(), writer: Ordered::new(writer), stop: Mutex::new(None) };
    std::thread::scope(|scope| {
        for _ in 0..threads.max(1) {
            scope.spawn(|| run.work(rows));
        }
    });
    if let Some(why) = run.stop.into_inner().unwrap_or_else(PoisonError::into_inner) {
        return Err(why);
    }
    run.writer.into_inner().done().map_err(StreamError::Write)
}

struct Run<'a, 's, C, T> {
    source: &'a Source<'a, C, T>,
    order: Order,
    writer: Ordered<Writer<'a, 's, T>>,
    /// Why the run stops.
    stop: Mutex<Option<StreamError>>,
}

/// A chunk, ready to be written.
struct Done<T> {
    /// The text of the program, the text of the report, and the results that both are made from; or why there are none.
    outcome: Result<(T, Vec<u8>, Corrected), Vec<Diagnostic>>,
    /// Ordinal of its last target; `None` if it has no target.
    last: Option<u32>,
    bytes: u64,
}

impl<C: ChunkReader, T> Run<'_, '_, C, T> {
    fn work(&self, rows: &(dyn Fn(&[Row]) -> Vec<u8> + Sync)) {
        while let Some((turn, chunk)) = self.next() {
            // The direction out of the first target has to be in the first chunk: the chunk after it is not available here.
            let own_start =
                |chunk: &StreamableChunk| turn.number > 0 || chunk.last || leaves_its_start(&chunk.program.targets);
            let Some(chunk) = chunk.read().filter(own_start) else {
                return self.stop(StreamError::NotStreamable);
            };
            let outcome = match (self.source.solve)(&turn, &chunk) {
                Ok((program, corrected)) => Ok((program, rows(&corrected.rows), corrected)),
                Err(Unsolved::Refused(refused)) => Err(refused),
                Err(Unsolved::Failed(why)) => return self.stop(why),
                Err(Unsolved::Stopped) => return,
            };
            let last = chunk.program.targets.last().map(|t| t.ordinal);
            let bytes = (chunk.own.len() + chunk.elsewhere.iter().map(|e| e.own.len()).sum::<usize>()) as u64;
            let done = Done { outcome, last, bytes };
            match turn.take(&self.writer, |writer| writer.write(done)) {
                Ok(Ok(())) => {}
                Ok(Err(error)) => return self.stop(StreamError::Write(error)),
                Err(Stopped) => return,
            }
        }
    }

    fn next(&self) -> Option<(Turn<'_>, UnreadChunk)> {
        let mut chunks = self.source.chunks.lock().unwrap_or_else(PoisonError::into_inner);
        let (n, chunks) = &mut *chunks;
        match chunks.take() {
            Ok(Next::Chunk(chunk)) => {
                *n += 1;
                return Some((self.order.turn(*n - 1), chunk));
            }
            Ok(Next::End) => {}
            Ok(Next::NotStreamable) => self.stop(StreamError::NotStreamable),
            Err(error) => self.stop(StreamError::Read(error)),
        }
        None
    }

    fn stop(&self, why: StreamError) {
        self.stop.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(why);
        self.order.stop();
    }
}

/// Writes results in order.
struct Writer<'a, 's, T> {
    program: &'a mut (dyn FnMut(T) -> io::Result<()> + Send),
    sinks: &'a mut Sinks<'s>,
    so_far: SoFar,
}

/// The results that were written.
#[derive(Default)]
struct SoFar {
    tally: Tally,
    /// Ordinal of the last target.
    last: u32,
    targets: usize,
    bytes: u64,
    refused: Messages,
    failures: Messages,
    notes: Vec<Diagnostic>,
    driven: Option<DrivenSummary>,
    repeated: Repeated,
}

impl<T> Writer<'_, '_, T> {
    fn write(&mut self, done: Done<T>) -> io::Result<()> {
        let Self { program, sinks, so_far } = self;
        so_far.last = done.last.unwrap_or(so_far.last);
        so_far.bytes += done.bytes;
        let (text, report, corrected) = match done.outcome {
            Ok(outcome) => outcome,
            Err(refused) => {
                so_far.refused.add_once(refused);
                return Ok(());
            }
        };
        so_far.failures.add(corrected.failures);
        for note in corrected.notes {
            if !so_far.notes.contains(&note) {
                so_far.notes.push(note);
            }
        }
        so_far.driven = corrected.driven.or(so_far.driven);
        so_far.repeated.append(corrected.repeated);
        so_far.tally.add(&corrected.rows);
        so_far.tally.insert(corrected.inserted);
        (sinks.each)(&corrected.rows);
        so_far.targets += corrected.rows.len();
        (sinks.progress)(so_far.targets, so_far.bytes);
        if so_far.refused.is_empty() && so_far.failures.is_empty() {
            program(text)?;
            sinks.report.write_all(&report)?;
        }
        Ok(())
    }

    fn done(self) -> io::Result<Streamed> {
        self.sinks.report.flush()?;
        let SoFar { tally, last, refused, failures, notes, driven, repeated, .. } = self.so_far;
        Ok(Streamed {
            summary: tally.summary(),
            last,
            refused,
            failures: failures.all(),
            notes: notes.into_iter().chain(repeated.once()).collect(),
            driven,
            names: Vec::new(),
        })
    }
}
