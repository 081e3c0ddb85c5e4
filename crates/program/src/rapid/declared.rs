//! A long program whose targets are declared far from their use, or that runs from routine to routine, in chunks that fit in
//! memory.
//!
//! An index of the declarations and of the routines is in memory. A chunk is a stretch of the text in running order, as in `chunks`, with
//! the declarations of its targets; both may be anywhere in the file.

use super::chunk::Chunk;
use super::chunks::Chunks;
use super::index::{Index, lines_of};
use super::lines::CHUNK;
use super::routines::{Parts, Running, running};
use crate::{Next, Program};
use deflex_text::Source;
use std::collections::BTreeSet;
use std::io::{self, BufReader, Read, Seek};
use std::sync::Arc;

/// Line number at which chunks begin, larger than the number of lines of any: their parts have the line numbers of the file.
const LINES: usize = 1 << 20;

/// Divides a program into chunks.
#[derive(Debug)]
#[doc(hidden)]
pub struct Declared<R> {
    index: Arc<Index>,
    /// The text in running order.
    chunks: Chunks<Running<R>>,
    parts: Parts,
    /// The same file, from which declarations are read.
    file: R,
    /// Offset in the head at which a chunk's declarations are inserted.
    data: usize,
}

impl<R: Read + Seek> Declared<R> {
    /// Reads the program for its index; `None` if it is not of this kind. `body` and `file` are the same file, each with a position of its
    /// own.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn new(name: &str, body: R, file: R, context: &[Source]) -> io::Result<Option<Self>> {
        Self::sized(name, body, file, context, CHUNK)
    }

    /// The same, with chunks of about `chunk` bytes.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn sized(name: &str, body: R, mut file: R, context: &[Source], chunk: usize) -> io::Result<Option<Self>> {
        let mut all = BufReader::with_capacity(CHUNK, &mut file);
        let Some((index, head, routines)) = Index::read(&mut all)? else { return Ok(None) };
        // `Chunks` alone can read it, or nothing moves.
        if index.is_empty() && routines.len() == 1 || !routines.iter().any(|routine| routine.moves) {
            return Ok(None);
        }
        let Some(stretches) = running(&routines) else { return Ok(None) };
        let stretches: Arc<[_]> = stretches.into();
        let running = Running::new(body, Arc::clone(&stretches));
        let chunks = Chunks::after_head(name, running, context, head.text, LINES, chunk)?;
        let new = |chunks| Self { index: Arc::new(index), chunks, parts: Parts::new(stretches), file, data: head.data };
        Ok(chunks.map(new))
    }

    /// The next chunk.
    ///
    /// # Errors
    /// The file cannot be read.
    pub(crate) fn take(&mut self) -> io::Result<Next<Chunk>> {
        let mut chunk = match self.chunks.take()? {
            Next::Chunk(chunk) => chunk,
            other => return Ok(other),
        };
        let entries = self.index.of(chunk.body());
        let text = lines_of(&entries, &mut self.file)?;
        chunk.declare(self.data, &text, &entries);
        let mut parts = self.parts.next(chunk.body().len());
        parts.iter_mut().for_each(|part| part.running_line += LINES);
        chunk.place(&parts);
        Ok(Next::Chunk(chunk))
    }

    /// Whether several motions share a target.
    #[must_use]
    #[doc(hidden)]
    pub fn shares(&self) -> bool {
        self.index.shares()
    }

    /// Names of the targets of its motions.
    #[must_use]
    pub fn names(&self) -> Names {
        Names(Known::Indexed(Arc::clone(&self.index)))
    }
}

/// Names of a program's declared targets.
#[derive(Clone, Debug)]
#[doc(hidden)]
pub struct Names(Known);

/// How the names are stored.
#[derive(Clone, Debug)]
enum Known {
    Indexed(Arc<Index>),
    /// A set of names in upper case.
    Held(Arc<BTreeSet<String>>),
}

impl Names {
    /// Names of the targets of a program that is held.
    #[must_use]
    pub fn of(program: &Program) -> Self {
        let names = program.targets.iter().filter_map(|target| target.name.as_deref());
        Self(Known::Held(Arc::new(names.map(str::to_ascii_uppercase).collect())))
    }

    /// Whether the program moves to a target of this name.
    #[must_use]
    #[doc(hidden)]
    pub fn uses(&self, name: &str) -> bool {
        match &self.0 {
            Known::Indexed(index) => index.uses(name.as_bytes()),
            Known::Held(names) => names.contains(&name.to_ascii_uppercase()),
        }
    }
}
