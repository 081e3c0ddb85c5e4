//! Long programs in constant memory: chunks pass all [stages](Stages), and their texts are written. The bytes are those of
//! [`compensate`](super::compensate) on the whole program.

use super::carried::Carried;
use super::context::Context;
use super::flow::{Sinks, Source, StreamError, Streamed, run};
use super::line::Stages;
use super::messages::Messages;
use super::ordered::{Ordered, Stopped, Turn};
use super::{Corrected, Options, Outline, Poster};
use deflex_cell::Cell;
use deflex_program::post::{Text, WriterPosition};
use deflex_program::{ChunkReader, RewriteOptions, StreamableChunk, rapid};
use deflex_text::{Edit, Patch, apply_within};
use std::collections::HashMap;
use std::io::{self, Read, Seek, Write};
use std::sync::Mutex;

/// Corrects a program whose chunks can be written one after the other, on `threads` threads. The bytes are those of
/// [`compensate`](super::compensate) and a rewrite; the memory does not grow with the program.
///
/// # Errors
/// See [`StreamError`]; what was written until then must not be used.
///
/// # Examples
/// ```
/// # use deflex_cell::Cell;
/// # use deflex_text::Source;
/// # let cell = Cell::read(&Source::new("cell.toml", std::fs::read("../../samples/slot/cell.toml")?))?;
/// use deflex_correct::{Options, Sinks, compensate_chunks, compensate};
/// use deflex_program::rapid;
///
/// let text = std::fs::File::open("../../samples/slot/slot.mod")?;
/// if let Some(chunks) = rapid::Chunks::new("slot.mod", text, &[])? {
///     let (mut corrected, mut report) = (Vec::new(), Vec::new());
///     let mut sinks = Sinks { report: &mut report, rows: &|_| Vec::new(), each: &mut |_| (), progress: &|_, _| () };
///     let done = compensate_chunks(chunks, &cell, &Options::default(), 2, &mut corrected, &mut sinks);
///     assert!(done.is_ok_and(|done| done.failures.is_empty()) && corrected.starts_with(b"%%%"));
/// }
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
pub fn compensate_chunks<C: ChunkReader + Send>(
    chunks: C,
    cell: &Cell,
    options: &Options,
    threads: usize,
    program: &mut (dyn Write + Send),
    sinks: &mut Sinks<'_>,
) -> Result<Streamed, StreamError> {
    if !chunks.is_in_place() || super::is_held_whole(cell, options) {
        return Err(StreamError::NotStreamable);
    }
    let mut write = |bytes: Vec<u8>| program.write_all(&bytes);
    let streamed =
        walked(chunks, (cell, options, threads), &|_, chunk, done| Ok(written(chunk, done)), &mut write, sinks)?;
    program.flush().map_err(StreamError::Write)?;
    Ok(streamed)
}

/// Corrects a RAPID program whose targets are declared far from their use, or that runs from routine to routine. An index of these is in
/// memory. The changes are collected in `patch`, which is applied to the program at the end.
///
/// # Errors
/// See [`StreamError`].
///
/// # Examples
/// ```
/// # use deflex_cell::Cell;
/// # use deflex_correct::{Options, Sinks, StreamError, Streamed};
/// use deflex_correct::compensate_declared;
/// use deflex_program::rapid;
/// use deflex_text::Patch;
/// use std::fs::File;
///
/// /// Corrects a file into a patch of it.
/// fn correct(
///     chunks: rapid::Declared<File>,
///     cell: &Cell,
///     patch: &mut Patch<File>,
///     sinks: &mut Sinks<'_>,
/// ) -> Result<Streamed, StreamError> {
///     compensate_declared(chunks, cell, &Options::default(), 4, patch, sinks)
/// }
/// ```
pub fn compensate_declared<R: Read + Seek + Send, S: Read + Write + Seek + Send>(
    chunks: rapid::Declared<R>,
    cell: &Cell,
    options: &Options,
    threads: usize,
    patch: &mut Patch<S>,
    sinks: &mut Sinks<'_>,
) -> Result<Streamed, StreamError> {
    // The name of a clone would have to be new in the whole program.
    if (options.allow_clones && chunks.shares()) || super::is_held_whole(cell, options) || is_driven(cell) {
        return Err(StreamError::NotStreamable);
    }
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
    let done = walked(chunks, (cell, options, threads), &|_, chunk, done| Ok(changed(chunk, done)), &mut write, sinks);
    // If motions disagree, the code that sees the whole program decides.
    if disputed { Err(StreamError::NotStreamable) } else { done }
}

/// Corrects a RAPID program that runs through more motions than memory can hold. The program runs once to compute the corrections, and once
/// more to predict the corrected motions. Returns the edits of each source too.
///
/// # Errors
/// See [`StreamError`].
///
/// # Examples
/// ```
/// # use deflex_cell::Cell;
/// # use deflex_correct::{Options, Sinks, StreamError, Streamed};
/// use deflex_correct::compensate_executed;
/// use deflex_program::rapid::Executed;
///
/// /// The number of edits of a program's files.
/// fn edits(program: &Executed, cell: &Cell, sinks: &mut Sinks<'_>) -> Result<usize, StreamError> {
///     let (_, edits) = compensate_executed(program, cell, &Options::default(), 4, sinks)?;
///     Ok(edits.iter().map(Vec::len).sum())
/// }
/// ```
pub fn compensate_executed(
    program: &rapid::Executed,
    cell: &Cell,
    options: &Options,
    threads: usize,
    sinks: &mut Sinks<'_>,
) -> Result<(Streamed, Vec<Vec<Edit>>), StreamError> {
    // Motions would have to agree on clones and inserted targets too.
    if options.allow_clones || options.subdivide.is_some() || super::is_held_whole(cell, options) || is_driven(cell) {
        return Err(StreamError::NotStreamable);
    }
    let pass = |chunks: rapid::ExecutedChunks, sinks: &mut Sinks<'_>| {
        walked(chunks, (cell, options, threads), &|_, _, _| Ok(()), &mut |()| Ok(()), sinks)
    };
    let (chunks, asking) = program.chunks_of_two_runs();
    let mut nowhere =
        Sinks { report: &mut io::sink(), rows: &|_| Vec::new(), each: &mut |_| (), progress: sinks.progress };
    pass(chunks, &mut nowhere)?;
    let (chunks, answer) = asking.answered(&RewriteOptions::default()).map_err(StreamError::Read)?;
    let streamed = pass(chunks, sinks)?;
    match answer.edits() {
        Some(edits) => Ok((streamed, edits.to_vec())),
        None => Err(StreamError::NotStreamable),
    }
}

/// Corrects a CL program and posts it, chunk by chunk. The bytes are those of [`compensate`](super::compensate) and [`post`](super::post).
/// `open` gives the destination of a module's file by its name.
///
/// # Errors
/// See [`StreamError`]; what was written until then must not be used.
///
/// # Examples
/// ```
/// # use deflex_cell::Cell;
/// # use deflex_correct::{Options, Sinks, StreamError, Streamed};
/// use deflex_correct::{Poster, post_chunks};
/// use deflex_program::cl;
/// use std::fs::File;
///
/// /// Posts CL data into the files that the poster names.
/// fn post(chunks: cl::Chunks<File>, cell: &Cell, poster: &Poster, sinks: &mut Sinks<'_>) -> Result<Streamed, StreamError> {
///     post_chunks(chunks, cell, &Options::default(), 4, poster, |name| File::create(name), sinks)
/// }
/// ```
pub fn post_chunks<C: ChunkReader + Send, W: Write + Send>(
    chunks: C,
    cell: &Cell,
    options: &Options,
    threads: usize,
    poster: &Poster,
    mut open: impl FnMut(&str) -> io::Result<W> + Send,
    sinks: &mut Sinks<'_>,
) -> Result<Streamed, StreamError> {
    if super::is_held_whole(cell, options) {
        return Err(StreamError::NotStreamable);
    }
    // The position up to which the program is posted.
    let posted = Ordered::new(WriterPosition::default());
    let made = |turn: &Turn<'_>, chunk: &StreamableChunk, corrected: &Corrected| {
        let points = poster.points(&chunk.program, corrected);
        let from = turn.take(&posted, |place| std::mem::replace(place, place.after(&points)))?;
        let end = chunk.last.then(|| poster.end(&chunk.program));
        Ok(poster.post.chunk(&from, &points, end.as_deref()))
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
    let mut streamed = walked(chunks, (cell, options, threads), &made, &mut |text| write(&text), sinks)?;
    file.map_or(Ok(()), |mut file| file.flush()).map_err(StreamError::Write)?;
    streamed.notes = [&poster.warnings[..], &streamed.notes, &poster.notes].concat();
    Ok(streamed)
}

/// Counts the points that [`post_chunks`] will write, including inserted ones, so that its parts can be laid out. This takes as long as
/// posting.
///
/// # Errors
/// See [`StreamError`].
pub(crate) fn count_chunks<C: ChunkReader + Send>(
    chunks: C,
    cell: &Cell,
    options: &Options,
    threads: usize,
    outline: &mut Outline,
    progress: &(dyn Fn(usize, u64) + Sync),
) -> Result<(), StreamError> {
    if super::is_held_whole(cell, options) {
        return Err(StreamError::NotStreamable);
    }
    let mut points = 0;
    let mut count = |posted| {
        points += posted;
        Ok(())
    };
    let mut sinks = Sinks { report: &mut io::sink(), rows: &|_| Vec::new(), each: &mut |_| (), progress };
    let posted = |_: &Turn<'_>, _: &StreamableChunk, corrected: &Corrected| Ok(corrected.posted.len());
    walked(chunks, (cell, options, threads), &posted, &mut count, &mut sinks)?;
    outline.points = points;
    Ok(())
}

/// Whether the deviation is that of the path that the controller drives. The chunks of a text that is not read in its order do not show where
/// the controller waits between two motions.
fn is_driven(cell: &Cell) -> bool {
    cell.controller.path.is_some()
}

/// Passes the chunks of a source through the pipeline; `made` makes the text of one.
fn walked<C: ChunkReader + Send, T: Send>(
    chunks: C,
    (cell, options, threads): (&Cell, &Options, usize),
    made: &(dyn Fn(&Turn<'_>, &StreamableChunk, &Corrected) -> Result<T, Stopped> + Sync),
    write: &mut (dyn FnMut(T) -> io::Result<()> + Send),
    sinks: &mut Sinks<'_>,
) -> Result<Streamed, StreamError> {
    let stages = Stages::new(cell, Carried::with_turns(cell, options.turns.as_ref()));
    let source = Source {
        chunks: Mutex::new((0, chunks)),
        solve: &|turn, chunk| {
            let context = Context::chunk(chunk, cell, options);
            let is_edited = chunk.program.language.is_edited();
            let corrected = stages.correct(if is_edited { context.driven() } else { context }, turn)?;
            Ok((made(turn, chunk, &corrected)?, corrected))
        },
        refusals: Messages::default(),
    };
    run(&source, threads, write, sinks)?.answered()
}

/// The chunk's own bytes with its edits.
fn written(chunk: &StreamableChunk, corrected: &Corrected) -> Vec<u8> {
    let edits = corrected.rewritten.as_ref().and_then(|r| r.edits.first()).map_or(&[][..], Vec::as_slice);
    let mut bytes = Vec::with_capacity(chunk.own.len() + chunk.own.len() / 4);
    // Writing to a Vec cannot fail.
    let _ = apply_within(&chunk.program.sources[0].bytes, chunk.own.clone(), edits, &mut bytes);
    bytes
}

/// A new text for a stretch of the file.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Changed {
    start: u64,
    /// Number of replaced bytes; 0 for an insertion.
    old: u32,
    text: Vec<u8>,
    /// Offset of the declaration of a target that other motions use too: they have to agree.
    shared: Option<u64>,
}

/// The edits of the chunk's stretch and of its declarations, wherever they are; `None` if motions do not agree on a target.
fn changed(chunk: &StreamableChunk, corrected: &Corrected) -> Option<Vec<Changed>> {
    let rewritten = corrected.rewritten.as_ref().filter(|r| r.kept.is_empty() && r.not_inserted.is_empty())?;
    let bytes = &chunk.program.sources[0].bytes;
    let mut edits = rewritten.edits.first().map_or(&[][..], Vec::as_slice);
    let declared = chunk.elsewhere.iter().map(|target| (&target.own, target.at, target.shared.then_some(target.at)));
    let mut out = Vec::new();
    for (own, at, shared) in declared.chain([(&chunk.own, chunk.at, None)]) {
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
        out.push(Changed { start: at + (from - own.start) as u64, old: (to - from) as u32, text, shared });
    }
    Some(out)
}
