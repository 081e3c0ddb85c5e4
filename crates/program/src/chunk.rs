//! Long programs, a chunk at a time.

use super::{Goal, Program, Target};
use std::ops::Range;

/// The result of taking the next chunk of a program.
#[derive(Debug)]
pub enum Next<P> {
    /// Another chunk.
    Chunk(P),
    /// There are no more.
    End,
    /// The text has something whose meaning depends on the whole program.
    NotStreamable,
}

/// A chunk that was read.
#[derive(Debug)]
pub struct StreamableChunk {
    /// The chunk as a program; ordinals and lines are those of the whole.
    pub program: Program,
    /// The bytes of its source that are in the file; edits are within them.
    pub own: Range<usize>,
    /// Other parts of its source that are in the file: edits may be within these too.
    pub elsewhere: Vec<Elsewhere>,
    /// Offset of `own` in the file; used if `elsewhere` is not empty.
    pub at: u64,
    /// Whether it ends the program.
    pub last: bool,
}

/// Declarations that are far from their use in the file, or lines that run before.
#[derive(Clone, Debug)]
pub struct Elsewhere {
    /// Its bytes in the chunk's source.
    pub own: Range<usize>,
    /// Their offset in the file.
    pub at: u64,
    /// Whether it is a declaration that several motions use, possibly of several chunks.
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

/// Whether these targets decide the direction out of the first one, without the targets after them.
#[doc(hidden)]
pub fn leaves_its_start(targets: &[Target]) -> bool {
    /// Distance beyond which two targets have a direction between them, mm.
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
