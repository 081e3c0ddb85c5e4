//! A long program whose targets are declared far from their use, or that runs from routine to routine, in chunks that fit in
//! memory.
//!
//! What is held is an index of the declarations and of the routines. A chunk is a stretch of the text in the order in which it
//! runs, as in `chunks`, with the declarations of the targets that it moves to; both stand somewhere else in the file.

use super::chunk::Chunk;
use super::chunks::Chunks;
use super::index::{Index, lines_of};
use super::lines::CHUNK;
use super::routines::{Parts, Running, running};
use crate::program::{Next, Program};
use crate::text::Source;
use std::collections::BTreeSet;
use std::io::{self, BufReader, Read, Seek};
use std::sync::Arc;

/// Lines that chunks are counted from, more than any has: which line of the file each is stands in its parts.
const LINES: usize = 1 << 20;

/// Cuts a program into chunks.
#[derive(Debug)]
pub struct Declared<R> {
    index: Arc<Index>,
    /// The text as it runs.
    chunks: Chunks<Running<R>>,
    parts: Parts,
    /// The same file, where declarations are read from.
    file: R,
    /// Where a chunk's declarations belong in its head.
    data: usize,
}

impl<R: Read + Seek> Declared<R> {
    /// Looks through the program; `None` where it is not of this kind. `body` and `file` are the same file, each with a
    /// place of its own.
    ///
    /// # Errors
    /// What they report.
    pub fn new(name: &str, body: R, file: R, context: &[Source]) -> io::Result<Option<Self>> {
        Self::sized(name, body, file, context, CHUNK)
    }

    /// The same, with chunks of about so many bytes.
    ///
    /// # Errors
    /// What `body` and `file` report.
    pub fn sized(name: &str, body: R, mut file: R, context: &[Source], chunk: usize) -> io::Result<Option<Self>> {
        let mut all = BufReader::with_capacity(CHUNK, &mut file);
        let Some((index, head, routines)) = Index::read(&mut all)? else { return Ok(None) };
        // Nothing that `Chunks` alone would not do.
        if index.is_empty() && routines.len() == 1 || !routines.iter().any(|routine| routine.moves) {
            return Ok(None);
        }
        let Some(stretches) = running(&routines) else { return Ok(None) };
        let stretches: Arc<[_]> = stretches.into();
        let running = Running::new(body, Arc::clone(&stretches));
        let chunks = Chunks::behind(name, running, context, head.text, LINES, chunk)?;
        let new = |chunks| Self { index: Arc::new(index), chunks, parts: Parts::new(stretches), file, data: head.data };
        Ok(chunks.map(new))
    }

    /// The next chunk.
    ///
    /// # Errors
    /// What the input reports.
    pub fn take(&mut self) -> io::Result<Next<Chunk>> {
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

    /// Whether several motions go to one target.
    #[must_use]
    pub fn shares(&self) -> bool {
        self.index.shares()
    }

    /// Names of the targets that it moves to.
    #[must_use]
    pub fn names(&self) -> Names {
        Names(Known::Indexed(Arc::clone(&self.index)))
    }
}

/// Names of a program's declared targets.
#[derive(Clone, Debug)]
pub struct Names(Known);

/// How they are held.
#[derive(Clone, Debug)]
enum Known {
    Indexed(Arc<Index>),
    /// In upper case.
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
    pub fn uses(&self, name: &str) -> bool {
        match &self.0 {
            Known::Indexed(index) => index.uses(name.as_bytes()),
            Known::Held(names) => names.contains(&name.to_ascii_uppercase()),
        }
    }
}
