//! The chunks of a long program in any language, for every way of reading them.

use super::chunk::{Next, StreamableChunk};
use super::cl::{self, ClOptions};
use super::krl;
use super::rapid::{self, Names};
use deflex_text::{Diagnostic, Source};
use std::io::{self, Read, Seek};

/// A chunk that was taken. Any thread may read it.
#[derive(Debug)]
pub enum UnreadChunk {
    /// RAPID.
    Rapid(Box<rapid::Chunk>),
    /// KRL.
    Krl(Box<krl::Chunk>),
    /// A chunk that is read when it is taken.
    Read(Box<StreamableChunk>),
}

impl UnreadChunk {
    /// Reads it; `None` if it turns out that only the whole program can be read.
    #[must_use]
    pub fn read(self) -> Option<StreamableChunk> {
        match self {
            Self::Rapid(chunk) => chunk.read(),
            Self::Krl(chunk) => chunk.read(),
            Self::Read(chunk) => Some(*chunk),
        }
    }
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
    /// RAPID with inline targets in one procedure; `None` if `input` begins in another way.
    ///
    /// # Errors
    /// `input` cannot be read.
    pub fn inline(name: &str, input: R, context: &[Source]) -> io::Result<Option<Self>> {
        Ok(rapid::Chunks::of_file(name, input, context)?.map(|chunks| Self::Inline(Box::new(chunks))))
    }

    /// RAPID of which an index is held; see [`rapid::Declared::new`].
    ///
    /// # Errors
    /// An input cannot be read.
    pub fn indexed(name: &str, body: R, file: R, context: &[Source]) -> io::Result<Option<Self>> {
        Ok(rapid::Declared::new(name, body, file, context)?.map(|chunks| Self::Indexed(Box::new(chunks))))
    }

    /// RAPID that runs through more motions than can be held; see [`rapid::Executed::read`].
    ///
    /// # Errors
    /// As [`rapid::read`].
    pub fn executed(source: Source, context: &[Source]) -> Result<Option<Self>, Vec<Diagnostic>> {
        let program = rapid::Executed::read(vec![source], context.to_vec())?;
        Ok(program.map(|program| Self::Executed(program.chunks())))
    }

    /// CL; `None` if only the whole can be read.
    ///
    /// # Errors
    /// `input` cannot be read.
    pub fn cl(name: &str, input: R, options: &ClOptions) -> io::Result<Option<Self>> {
        Ok(cl::Chunks::new(name, input, options)?.map(|chunks| Self::Cl(Box::new(chunks))))
    }

    /// KRL; `None` if only the whole can be read.
    ///
    /// # Errors
    /// `input` cannot be read.
    pub fn krl(name: &str, input: R, context: &[Source]) -> io::Result<Option<Self>> {
        Ok(krl::Chunks::of_file(name, input, context, krl::CHUNK)?.map(|chunks| Self::Krl(Box::new(chunks))))
    }

    /// Names of the targets of its motions, if they have any.
    #[must_use]
    pub fn names(&self) -> Option<Names> {
        match self {
            Self::Executed(chunks) => Some(Names::of(chunks.program().distinct())),
            Self::Indexed(chunks) => Some(chunks.names()),
            Self::Inline(_) | Self::Cl(_) | Self::Krl(_) => None,
        }
    }
}

impl<R: Read + Seek> AnyChunks<R> {
    fn reader(&self) -> &dyn ChunkReader {
        match self {
            Self::Inline(chunks) => &**chunks,
            Self::Indexed(chunks) => &**chunks,
            Self::Cl(chunks) => &**chunks,
            Self::Krl(chunks) => &**chunks,
            Self::Executed(chunks) => chunks,
        }
    }
}

impl<R: Read> ChunkReader for rapid::Chunks<R> {
    fn is_in_place(&self) -> bool {
        true
    }

    fn take(&mut self) -> io::Result<Next<UnreadChunk>> {
        Ok(Self::take(self)?.map(|chunk| UnreadChunk::Rapid(Box::new(chunk))))
    }
}

impl<R: Read + Seek> ChunkReader for rapid::Declared<R> {
    fn take(&mut self) -> io::Result<Next<UnreadChunk>> {
        Ok(Self::take(self)?.map(|chunk| UnreadChunk::Rapid(Box::new(chunk))))
    }
}

impl ChunkReader for rapid::ExecutedChunks {
    fn take(&mut self) -> io::Result<Next<UnreadChunk>> {
        Ok(Self::take(self)?.map(|chunk| UnreadChunk::Read(Box::new(chunk))))
    }
}

impl<R: Read> ChunkReader for cl::Chunks<R> {
    fn has_own_numbers(&self) -> bool {
        true
    }

    fn take(&mut self) -> io::Result<Next<UnreadChunk>> {
        Ok(Self::take(self)?.map(|chunk| UnreadChunk::Read(Box::new(chunk))))
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
        Ok(Self::take(self)?.map(|chunk| UnreadChunk::Krl(Box::new(chunk))))
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
        match self {
            Self::Inline(chunks) => ChunkReader::take(&mut **chunks),
            Self::Indexed(chunks) => ChunkReader::take(&mut **chunks),
            Self::Cl(chunks) => ChunkReader::take(&mut **chunks),
            Self::Krl(chunks) => ChunkReader::take(&mut **chunks),
            Self::Executed(chunks) => ChunkReader::take(chunks),
        }
    }

    fn warnings(&self) -> Vec<Diagnostic> {
        self.reader().warnings()
    }
}
