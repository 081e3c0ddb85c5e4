//! Long programs, a chunk at a time.

use super::{Goal, Program, Target};
use crate::text::Diagnostic;
use std::io;
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

impl<P> Next<P> {
    pub(super) fn map<Q>(self, other: impl FnOnce(P) -> Q) -> Next<Q> {
        match self {
            Self::Chunk(chunk) => Next::Chunk(other(chunk)),
            Self::End => Next::End,
            Self::NotStreamable => Next::NotStreamable,
        }
    }
}

/// Whether these targets decide the direction out of the first one: what follows is not looked at.
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
