//! Long programs, a chunk at a time.

use super::cl::{self, ClOptions};
use super::krl;
use super::rapid::{self, Names};
use super::{Goal, Program, Target};
use crate::text::{Diagnostic, Source};
use std::io::{self, Read, Seek};
use std::ops::Range;

/// What taking the next chunk of a program came to.
#[derive(Debug)]
pub enum Next<P> {
    /// Another chunk.
    Chunk(P),
    /// There are no more.
    End,
    /// Here stands something that only the whole program tells the meaning of.
    NotStreamable,
}

/// Cuts a long program into chunks.
pub trait ChunkReader {
    /// A chunk, not yet read.
    type Chunk;

    /// Whether every edit of a chunk lies in its own bytes, and these one after another are the program.
    const IN_PLACE: bool = false;

    /// The next chunk.
    ///
    /// # Errors
    /// What the input reports.
    fn take(&mut self) -> io::Result<Next<Self::Chunk>>;

    /// Reads a chunk; `None` where it is not as it seemed.
    fn read(chunk: Self::Chunk) -> Option<StreamableChunk>;

    /// Whether no other motion, of whatever chunk, goes to the numbers of a target.
    fn has_own_numbers(&self) -> bool {
        Self::IN_PLACE
    }

    /// What was noticed in the text so far.
    fn warnings(&self) -> Vec<Diagnostic> {
        Vec::new()
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

/// A chunk as read.
#[derive(Debug)]
pub struct StreamableChunk {
    /// The chunk as a program; ordinals and lines are those of the whole.
    pub program: Program,
    /// Which bytes of its source stand in the file; edits lie within.
    pub own: Range<usize>,
    /// What else of its source stands in the file, and where: edits lie within these too.
    pub elsewhere: Vec<Elsewhere>,
    /// Offset of `own` in the file, where there is anything elsewhere.
    pub at: u64,
    /// Whether it ends the program.
    pub last: bool,
}

/// Declarations that stand elsewhere in the file than their use, or lines that run before.
#[derive(Clone, Debug)]
pub struct Elsewhere {
    /// Its bytes in the chunk's source.
    pub own: Range<usize>,
    /// Their offset in the file.
    pub at: u64,
    /// One declaration, which several motions go to, maybe of several chunks.
    pub shared: bool,
}

/// The chunks of a long program of whatever kind.
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
    /// RAPID that is run again, whatever it consists of.
    Executed(rapid::ExecutedChunks),
}

/// A chunk, not yet read.
#[derive(Debug)]
pub enum AnyChunk {
    /// RAPID.
    Rapid(Box<rapid::Chunk>),
    /// Of a kind that is read as it is cut.
    Read(Box<StreamableChunk>),
    /// KRL.
    Krl(Box<krl::Chunk>),
}

impl<R: Read + Seek> AnyChunks<R> {
    /// RAPID with inline targets in one procedure; `None` where `input` does not begin like that.
    ///
    /// # Errors
    /// What it reports.
    pub fn inline(name: &str, input: R, context: &[Source]) -> io::Result<Option<Self>> {
        Ok(rapid::Chunks::of_file(name, input, context)?.map(|chunks| Self::Inline(Box::new(chunks))))
    }

    /// RAPID of which an index is held; see [`rapid::Declared::new`].
    ///
    /// # Errors
    /// What the inputs report.
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

    /// CL; `None` where only the whole can be read.
    ///
    /// # Errors
    /// What `input` reports.
    pub fn cl(name: &str, input: R, options: &ClOptions) -> io::Result<Option<Self>> {
        Ok(cl::Chunks::new(name, input, options)?.map(|chunks| Self::Cl(Box::new(chunks))))
    }

    /// KRL; `None` where only the whole can be read.
    ///
    /// # Errors
    /// What `input` reports.
    pub fn krl(name: &str, input: R, context: &[Source]) -> io::Result<Option<Self>> {
        Ok(krl::Chunks::of_file(name, input, context, krl::CHUNK)?.map(|chunks| Self::Krl(Box::new(chunks))))
    }

    /// Executed motions whose target is known only at run time, counted by reason.
    #[must_use]
    pub fn unknown_targets(&self) -> Vec<(&'static str, usize)> {
        match self {
            Self::Executed(chunks) => chunks.program().distinct().unknown_targets().to_vec(),
            Self::Inline(_) | Self::Indexed(_) | Self::Cl(_) | Self::Krl(_) => Vec::new(),
        }
    }

    /// Names of the targets that it moves to, where they have any.
    #[must_use]
    pub fn names(&self) -> Option<Names> {
        match self {
            Self::Executed(chunks) => Some(Names::of(chunks.program().distinct())),
            Self::Indexed(chunks) => Some(chunks.names()),
            Self::Inline(_) | Self::Cl(_) | Self::Krl(_) => None,
        }
    }
}

impl<P> Next<P> {
    fn map<Q>(self, other: impl FnOnce(P) -> Q) -> Next<Q> {
        match self {
            Self::Chunk(chunk) => Next::Chunk(other(chunk)),
            Self::End => Next::End,
            Self::NotStreamable => Next::NotStreamable,
        }
    }
}

/// Whether the direction out of the first target is told by these: what follows is not looked at.
pub(crate) fn leaves_its_start(targets: &[Target]) -> bool {
    /// Further than what gives no direction, mm.
    const APART: f64 = 0.01;
    let Some(first) = targets.first() else { return false };
    let Some(from) = position(first) else { return true };
    let away = |to: [f64; 3]| (0..3).map(|i| (to[i] - from[i]).powi(2)).sum::<f64>().sqrt() > APART;
    targets[1..].iter().any(|target| target.wobj != first.wobj || position(target).is_some_and(away))
}

fn position(target: &Target) -> Option<[f64; 3]> {
    match target.goal {
        Goal::Pose { position_mm, .. } | Goal::Axis { position_mm, .. } => Some(position_mm),
        Goal::Joints { .. } => None,
    }
}
