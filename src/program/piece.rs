//! Long programs, a stretch at a time.

use super::cl::{self, ClOptions};
use super::rapid::{self, Names};
use super::{Goal, Program, Target};
use crate::text::{Diagnostic, Source};
use std::io::{self, Read, Seek};
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

/// Declarations that stand elsewhere in the file than their use, or lines that run before.
#[derive(Clone, Debug)]
pub struct Elsewhere {
    /// Its bytes in the piece's source.
    pub own: Range<usize>,
    /// Their offset in the file.
    pub at: u64,
    /// One declaration, which several motions go to, maybe of several pieces.
    pub shared: bool,
}

/// The pieces of a long program of whatever kind.
#[derive(Debug)]
pub enum AnyPieces<R> {
    /// RAPID with inline targets in one procedure.
    Inline(Box<rapid::Pieces<R>>),
    /// RAPID with an index.
    Indexed(Box<rapid::Declared<R>>),
    /// CL.
    Cl(Box<cl::Pieces<R>>),
}

/// A piece, not yet read.
#[derive(Debug)]
pub enum AnyPiece {
    /// RAPID.
    Rapid(Box<rapid::Piece>),
    /// CL, which is read as it is cut.
    Cl(Box<StraightPiece>),
}

impl<R: Read + Seek> AnyPieces<R> {
    /// RAPID with inline targets in one procedure; `None` where `input` does not begin like that.
    ///
    /// # Errors
    /// What it reports.
    pub fn inline(name: &str, input: R, context: &[Source]) -> io::Result<Option<Self>> {
        Ok(rapid::Pieces::of_file(name, input, context)?.map(|pieces| Self::Inline(Box::new(pieces))))
    }

    /// RAPID of which an index is held; see [`rapid::Declared::new`].
    ///
    /// # Errors
    /// What the inputs report.
    pub fn indexed(name: &str, body: R, file: R, context: &[Source]) -> io::Result<Option<Self>> {
        Ok(rapid::Declared::new(name, body, file, context)?.map(|pieces| Self::Indexed(Box::new(pieces))))
    }

    /// CL; `None` where only the whole can be read.
    ///
    /// # Errors
    /// What `input` reports.
    pub fn cl(name: &str, input: R, options: &ClOptions) -> io::Result<Option<Self>> {
        Ok(cl::Pieces::new(name, input, options)?.map(|pieces| Self::Cl(Box::new(pieces))))
    }

    /// The next piece.
    ///
    /// # Errors
    /// What the input reports.
    pub fn take(&mut self) -> io::Result<Next<AnyPiece>> {
        let rapid = match self {
            Self::Inline(pieces) => pieces.take()?,
            Self::Indexed(pieces) => pieces.take()?,
            Self::Cl(pieces) => return Ok(pieces.take()?.map(|piece| AnyPiece::Cl(Box::new(piece)))),
        };
        Ok(rapid.map(|piece| AnyPiece::Rapid(Box::new(piece))))
    }

    /// Reads a piece; `None` where it is not straight after all.
    #[must_use]
    pub fn read(piece: AnyPiece) -> Option<StraightPiece> {
        match piece {
            AnyPiece::Rapid(piece) => piece.read(),
            AnyPiece::Cl(piece) => Some(*piece),
        }
    }

    /// What was noticed in the text so far.
    #[must_use]
    pub fn warnings(&self) -> Vec<Diagnostic> {
        match self {
            Self::Cl(pieces) => pieces.warnings(),
            Self::Inline(_) | Self::Indexed(_) => Vec::new(),
        }
    }

    /// Names of the targets that it moves to, where they have any.
    #[must_use]
    pub fn names(&self) -> Option<Names> {
        match self {
            Self::Indexed(pieces) => Some(pieces.names()),
            Self::Inline(_) | Self::Cl(_) => None,
        }
    }
}

impl<P> Next<P> {
    fn map<Q>(self, other: impl FnOnce(P) -> Q) -> Next<Q> {
        match self {
            Self::Piece(piece) => Next::Piece(other(piece)),
            Self::End => Next::End,
            Self::NotStraight => Next::NotStraight,
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
