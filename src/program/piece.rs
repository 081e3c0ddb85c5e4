//! Long programs, a stretch at a time.

use super::{Goal, Program, Target};
use std::ops::Range;

/// What taking the next piece of a program came to.
#[derive(Debug)]
pub enum Next<P> {
    /// Another piece.
    Piece(P),
    /// There are no more.
    End,
    /// Here stands something that only the whole program tells the meaning of.
    NotStraight,
}

/// A piece as read.
#[derive(Debug)]
pub struct StraightPiece {
    /// The piece as a program; ordinals and lines are those of the whole.
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

/// A declaration that stands elsewhere in the file than its use.
#[derive(Clone, Debug)]
pub struct Elsewhere {
    /// Its bytes in the piece's source.
    pub own: Range<usize>,
    /// Their offset in the file.
    pub at: u64,
    /// Several motions go to it, maybe of several pieces.
    pub shared: bool,
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
