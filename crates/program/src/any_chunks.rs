//! The chunks of a long program in any language, for every way of reading them.

use super::chunk::{Next, StreamableChunk};
use super::cl;
use super::krl;
use super::rapid::{self, Names};
use deflex_text::Diagnostic;
use std::io::{self, Read, Seek};

/// A chunk that was taken. Any thread may read it.
pub struct UnreadChunk(Box<dyn FnOnce() -> Option<StreamableChunk> + Send>);

impl UnreadChunk {
    /// Reads it; `None` if it turns out that only the whole program can be read.
    #[must_use]
    pub fn read(self) -> Option<StreamableChunk> {
        (self.0)()
    }
}

/// A chunk of these, once it was taken.
fn unread<C: Send + 'static>(chunk: C, read: fn(C) -> Option<StreamableChunk>) -> UnreadChunk {
    UnreadChunk(Box::new(move || read(chunk)))
}

/// Divides a long program into chunks.
pub trait ChunkReader {
    /// Whether every edit of a chunk is in its own bytes, and these bytes in their order are the program.
    fn is_in_place(&self) -> bool {
        false
    }

    /// The next chunk.
    ///
    /// # Errors
    /// The input cannot be read.
    fn take(&mut self) -> io::Result<Next<UnreadChunk>>;

    /// Whether the numbers of a target belong to one motion only, over all chunks.
    fn has_own_numbers(&self) -> bool {
        self.is_in_place()
    }

    /// Warnings about the text so far.
    fn warnings(&self) -> Vec<Diagnostic> {
        Vec::new()
    }
}

/// The chunks of a long program.
#[derive(Debug)]
pub enum AnyChunks<R> {
    /// RAPID with inline targets in one procedure.
    Inline(Box<rapid::Chunks<R>>),
    /// RAPID with an index.
    Indexed(Box<rapid::Declared<R>>),
    /// CL.
    Cl(Box<cl::Chunks<R>>),
    /// KRL with inline positions in one routine.
    Krl(Box<krl::Chunks<R>>),
    /// RAPID of any kind that is run again.
    Executed(rapid::ExecutedChunks),
}

impl<R: Read + Seek> AnyChunks<R> {
    /// Names of the targets of its motions, if they have any.
    #[must_use]
    pub fn names(&self) -> Option<Names> {
        match self {
            Self::Executed(chunks) => Some(Names::of(chunks.program().distinct())),
            Self::Indexed(chunks) => Some(chunks.names()),
            Self::Inline(_) | Self::Cl(_) | Self::Krl(_) => None,
        }
    }

    fn reader(&self) -> &dyn ChunkReader {
        match self {
            Self::Inline(chunks) => &**chunks,
            Self::Indexed(chunks) => &**chunks,
            Self::Cl(chunks) => &**chunks,
            Self::Krl(chunks) => &**chunks,
            Self::Executed(chunks) => chunks,
        }
    }

    fn reader_mut(&mut self) -> &mut dyn ChunkReader {
        match self {
            Self::Inline(chunks) => &mut **chunks,
            Self::Indexed(chunks) => &mut **chunks,
            Self::Cl(chunks) => &mut **chunks,
            Self::Krl(chunks) => &mut **chunks,
            Self::Executed(chunks) => chunks,
        }
    }
}

impl<R: Read> ChunkReader for rapid::Chunks<R> {
    fn is_in_place(&self) -> bool {
        true
    }

    fn take(&mut self) -> io::Result<Next<UnreadChunk>> {
        Ok(Self::take(self)?.map(|chunk| unread(chunk, rapid::Chunk::read)))
    }
}

impl<R: Read + Seek> ChunkReader for rapid::Declared<R> {
    fn take(&mut self) -> io::Result<Next<UnreadChunk>> {
        Ok(Self::take(self)?.map(|chunk| unread(chunk, rapid::Chunk::read)))
    }
}

impl ChunkReader for rapid::ExecutedChunks {
    fn take(&mut self) -> io::Result<Next<UnreadChunk>> {
        Ok(Self::take(self)?.map(|chunk| unread(chunk, Some)))
    }
}

impl<R: Read> ChunkReader for cl::Chunks<R> {
    fn has_own_numbers(&self) -> bool {
        true
    }

    fn take(&mut self) -> io::Result<Next<UnreadChunk>> {
        Ok(Self::take(self)?.map(|chunk| unread(chunk, Some)))
    }

    fn warnings(&self) -> Vec<Diagnostic> {
        Self::warnings(self)
    }
}

impl<R: Read> ChunkReader for krl::Chunks<R> {
    fn is_in_place(&self) -> bool {
        true
    }

    fn take(&mut self) -> io::Result<Next<UnreadChunk>> {
        Ok(Self::take(self)?.map(|chunk| unread(chunk, krl::Chunk::read)))
    }
}

impl<R: Read + Seek> ChunkReader for AnyChunks<R> {
    fn is_in_place(&self) -> bool {
        self.reader().is_in_place()
    }

    fn has_own_numbers(&self) -> bool {
        self.reader().has_own_numbers()
    }

    fn take(&mut self) -> io::Result<Next<UnreadChunk>> {
        self.reader_mut().take()
    }

    fn warnings(&self) -> Vec<Diagnostic> {
        self.reader().warnings()
    }
}
