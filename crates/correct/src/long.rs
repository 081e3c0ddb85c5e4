//! Long programs from text to text, for every way of reading them in chunks.

use super::flow::{Sinks, StreamError, Streamed};
use super::judge::{Judge, predict_chunks};
use super::stream::{compensate_chunks, compensate_declared, compensate_executed, count_chunks, post_chunks};
use super::{Options, Outline, PostOptions, Poster, choose_turns, has_free_turns};
use deflex_cell::Cell;
use deflex_program::{AnyChunks, InChunks, LongProgram, LongText};
use deflex_text::{Diagnostic, Patch, apply};
use std::borrow::Cow;
use std::io::{self, Read, Seek, Write};

/// Corrects a long program that is edited (RAPID, KRL), and writes the corrected program to `text`. If only changes are collected, they
/// wait in the file of `scratch`. The bytes are those of [`compensate`](super::compensate) and a rewrite.
///
/// # Errors
/// See [`StreamError`]; what was written until then must not be used.
#[doc(hidden)]
pub fn compensate_long<T: LongText, S: Read + Write + Seek + Send>(
    program: &InChunks<'_, T>,
    scratch: impl FnOnce() -> io::Result<S>,
    (cell, options, threads): (&Cell, &Options, usize),
    mut text: &mut (dyn Write + Send),
    sinks: &mut Sinks<'_>,
) -> Result<Streamed, StreamError> {
    let options = &*with_turns(program, cell, options)?;
    let chunks = opened(program.chunks())?;
    let names = chunks.names();
    let done = match chunks {
        AnyChunks::Inline(chunks) => compensate_chunks(*chunks, cell, options, threads, text, sinks)?,
        AnyChunks::Krl(chunks) => compensate_chunks(*chunks, cell, options, threads, text, sinks)?,
        AnyChunks::Cl(_) => return Err(StreamError::NotStreamable),
        AnyChunks::Indexed(chunks) => {
            let mut patch = Patch::new(scratch().map_err(StreamError::Write)?);
            let done = compensate_declared(*chunks, cell, options, threads, &mut patch, sinks)?;
            if done.failures.is_empty() {
                let original = program.text().open().map_err(StreamError::Refused)?;
                patch.apply(original, &mut text).map_err(StreamError::Write)?;
            }
            done
        }
        AnyChunks::Executed(chunks) => {
            let program = chunks.program();
            let (done, edits) = compensate_executed(program, cell, options, threads, sinks)?;
            if done.failures.is_empty() {
                apply(&program.distinct().sources[0].bytes, &edits[0], &mut text).map_err(StreamError::Write)?;
                text.flush().map_err(StreamError::Write)?;
            }
            done
        }
    };
    Ok(Streamed { names: names.into_iter().collect(), ..done })
}

/// The layout of the posted program for long CL data.
#[doc(hidden)]
pub struct LaidOut<'a> {
    poster: Poster,
    options: Cow<'a, Options>,
}

impl<'a> LaidOut<'a> {
    /// Reads the program for everything on which the posted program depends. `progress` receives the targets and the bytes of input done so
    /// far.
    ///
    /// # Errors
    /// See [`StreamError`]; [`StreamError::Refused`] as [`Poster::new`].
    pub fn new<T: LongText>(
        program: &InChunks<'_, T>,
        (cell, options, threads): (&Cell, &'a Options, usize),
        post: &PostOptions,
        progress: &(dyn Fn(usize, u64) + Sync),
    ) -> Result<Self, StreamError> {
        let options = with_turns(program, cell, options)?;
        let mut outline = Outline::of_chunks(opened(program.chunks())?, progress)?;
        if options.subdivide.is_some() && post.max_targets.is_some() {
            // The number of parts depends on the inserted targets.
            count_chunks(opened(program.chunks())?, cell, &options, threads, &mut outline, progress)?;
        }
        let poster = Poster::new(outline, cell, post).map_err(StreamError::Refused)?;
        Ok(Self { poster, options })
    }

    /// The file that is started.
    #[must_use]
    pub fn main_file(&self) -> &str {
        self.poster.main_file()
    }

    /// Number of files.
    #[must_use]
    pub fn files(&self) -> usize {
        self.poster.files()
    }
}

/// Corrects a long CL program and posts it with its layout. `open` gives the destination of a module's file by its name. The bytes are those
/// of [`compensate`](super::compensate) and [`post`](super::post).
///
/// # Errors
/// See [`StreamError`]; what was written until then must not be used.
#[doc(hidden)]
pub fn post_long<T: LongText, W: Write + Send>(
    program: &InChunks<'_, T>,
    laid_out: &LaidOut<'_>,
    (cell, threads): (&Cell, usize),
    open: impl FnMut(&str) -> io::Result<W> + Send,
    sinks: &mut Sinks<'_>,
) -> Result<Streamed, StreamError> {
    let LaidOut { poster, options } = laid_out;
    post_chunks(opened(program.chunks())?, cell, options, threads, poster, open, sinks)
}

/// Predicts where the cell would cut with a long program, with errors counted from `original`. The rows are those of
/// [`predict`](super::predict). With a judge, targets without a solution are its findings and no failures, and [`Streamed::refused`] is not
/// an error.
///
/// # Errors
/// See [`StreamError`].
#[doc(hidden)]
pub fn predict_long<T: LongText>(
    program: &InChunks<'_, T>,
    original: Option<&LongProgram<'_, T>>,
    (cell, options, threads): (&Cell, &Options, usize),
    judge: Option<Judge<'_>>,
    sinks: &mut Sinks<'_>,
) -> Result<Streamed, StreamError> {
    let options = &*with_turns(program, cell, options)?;
    let chunks = opened(program.chunks())?;
    let original = original.map(|original| opened(program.chunks_of(original))).transpose()?;
    let names = chunks.names().into_iter().chain(original.as_ref().and_then(AnyChunks::names)).collect();
    let done = predict_chunks(chunks, original, cell, options, threads, judge, sinks)?;
    Ok(Streamed { names, ..done })
}

/// The options, with the turns that are chosen along the program if they are free.
fn with_turns<'a, T: LongText>(
    program: &InChunks<'_, T>,
    cell: &Cell,
    options: &'a Options,
) -> Result<Cow<'a, Options>, StreamError> {
    if !has_free_turns(program.language(), cell, options) {
        return Ok(Cow::Borrowed(options));
    }
    let turns = choose_turns(opened(program.chunks())?, cell, options)?;
    Ok(Cow::Owned(Options { turns, ..options.clone() }))
}

fn opened<C>(chunks: Result<Option<C>, Vec<Diagnostic>>) -> Result<C, StreamError> {
    chunks.map_err(StreamError::Refused)?.ok_or(StreamError::NotStreamable)
}
