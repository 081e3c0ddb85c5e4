//! The chunks of a long program in any language, for every way of reading them.

use super::chunk::{ChunkReader, Next, StreamableChunk};
use super::cl::{self, ClOptions};
use super::krl;
use super::rapid::{self, Names};
use crate::text::{Diagnostic, Source};
use std::io::{self, Read, Seek};

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

/// A chunk, not yet read.
#[derive(Debug)]
pub enum AnyChunk {
    /// RAPID.
    Rapid(Box<rapid::Chunk>),
    /// A chunk that is read when it is taken.
    Read(Box<StreamableChunk>),
    /// KRL.
    Krl(Box<krl::Chunk>),
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

impl<R: Read> ChunkReader for rapid::Chunks<R> {
    type Chunk = rapid::Chunk;

    const IN_PLACE: bool = true;

    fn take(&mut self) -> io::Result<Next<rapid::Chunk>> {
        Self::take(self)
    }

    fn read(chunk: rapid::Chunk) -> Option<StreamableChunk> {
        chunk.read()
    }
}

impl<R: Read + Seek> ChunkReader for rapid::Declared<R> {
    type Chunk = rapid::Chunk;

    fn take(&mut self) -> io::Result<Next<rapid::Chunk>> {
        Self::take(self)
    }

    fn read(chunk: rapid::Chunk) -> Option<StreamableChunk> {
        chunk.read()
    }
}

impl ChunkReader for rapid::ExecutedChunks {
    type Chunk = StreamableChunk;

    fn take(&mut self) -> io::Result<Next<StreamableChunk>> {
        Self::take(self)
    }

    fn read(chunk: StreamableChunk) -> Option<StreamableChunk> {
        Some(chunk)
    }
}

impl<R: Read> ChunkReader for cl::Chunks<R> {
    type Chunk = StreamableChunk;

    fn has_own_numbers(&self) -> bool {
        true
    }

    fn take(&mut self) -> io::Result<Next<StreamableChunk>> {
        Self::take(self)
    }

    fn read(chunk: StreamableChunk) -> Option<StreamableChunk> {
        Some(chunk)
    }

    fn warnings(&self) -> Vec<Diagnostic> {
        Self::warnings(self)
    }
}

impl<R: Read> ChunkReader for krl::Chunks<R> {
    type Chunk = krl::Chunk;

    const IN_PLACE: bool = true;

    fn take(&mut self) -> io::Result<Next<krl::Chunk>> {
        Self::take(self)
    }

    fn read(chunk: krl::Chunk) -> Option<StreamableChunk> {
        chunk.read()
    }
}

impl<R: Read + Seek> ChunkReader for AnyChunks<R> {
    type Chunk = AnyChunk;

    fn has_own_numbers(&self) -> bool {
        matches!(self, Self::Inline(_) | Self::Cl(_) | Self::Krl(_))
    }

    fn take(&mut self) -> io::Result<Next<AnyChunk>> {
        let rapid = match self {
            Self::Inline(chunks) => chunks.take()?,
            Self::Indexed(chunks) => chunks.take()?,
            Self::Cl(chunks) => return Ok(chunks.take()?.map(|chunk| AnyChunk::Read(Box::new(chunk)))),
            Self::Executed(chunks) => return Ok(chunks.take()?.map(|chunk| AnyChunk::Read(Box::new(chunk)))),
            Self::Krl(chunks) => return Ok(chunks.take()?.map(|chunk| AnyChunk::Krl(Box::new(chunk)))),
        };
        Ok(rapid.map(|chunk| AnyChunk::Rapid(Box::new(chunk))))
    }

    fn read(chunk: AnyChunk) -> Option<StreamableChunk> {
        match chunk {
            AnyChunk::Rapid(chunk) => chunk.read(),
            AnyChunk::Read(chunk) => Some(*chunk),
            AnyChunk::Krl(chunk) => chunk.read(),
        }
    }

    fn warnings(&self) -> Vec<Diagnostic> {
        match self {
            Self::Cl(chunks) => chunks.warnings(),
            Self::Inline(_) | Self::Indexed(_) | Self::Krl(_) | Self::Executed(_) => Vec::new(),
        }
    }
}
