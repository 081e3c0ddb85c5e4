//! A long program whose targets are declared far from their use, in pieces that fit in memory.
//!
//! What is held is an index of the declarations. A piece is a stretch of the body, as in `pieces`, with the declarations of
//! the targets that it moves to, which stand elsewhere in the file.

use super::index::{Head, Index, lines_of};
use super::pieces::{Piece, Pieces};
use crate::program::Next;
use crate::text::Source;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::sync::Arc;

/// Cuts a program into pieces.
#[derive(Debug)]
pub struct Declared<R> {
    index: Arc<Index>,
    /// The body.
    pieces: Pieces<R>,
    /// The same file, where declarations are read from.
    file: R,
    /// Where a piece's declarations belong in its head.
    data: usize,
    /// Offset in the file of the next piece.
    at: u64,
}

impl<R: Read + Seek> Declared<R> {
    /// Looks through the program; `None` where it is not of this kind. `body` and `file` are the same file, each with a
    /// place of its own.
    ///
    /// # Errors
    /// What they report.
    pub fn new(name: &str, mut body: R, mut file: R, context: &[Source]) -> io::Result<Option<Self>> {
        let Some((index, head)) = Index::read(&mut BufReader::new(&mut file))? else { return Ok(None) };
        let Head { text, data, bytes: at, lines } = head;
        body.seek(SeekFrom::Start(at))?;
        let pieces = Pieces::behind(name, body, context, text, lines)?;
        Ok(pieces.map(|pieces| Self { index: Arc::new(index), pieces, file, data, at }))
    }

    /// The next piece.
    ///
    /// # Errors
    /// What the input reports.
    pub fn take(&mut self) -> io::Result<Next<Piece>> {
        let mut piece = match self.pieces.take()? {
            Next::Piece(piece) => piece,
            other => return Ok(other),
        };
        let entries = self.index.of(piece.body());
        let text = lines_of(&entries, &mut self.file)?;
        let len = piece.len() as u64;
        let lines = piece.declare(self.data, &text, &entries, self.at);
        self.at += len;
        // Fewer lines in the file than in the piece: a short program.
        Ok(if lines { Next::Piece(piece) } else { Next::NotStraight })
    }

    /// Whether several motions go to one target.
    #[must_use]
    pub fn shares(&self) -> bool {
        self.index.shares()
    }

    /// Names of the targets that it moves to.
    #[must_use]
    pub fn names(&self) -> Names {
        Names(Arc::clone(&self.index))
    }
}

/// Names of a program's declared targets.
#[derive(Clone, Debug)]
pub struct Names(Arc<Index>);

impl Names {
    /// Whether the program moves to a target of this name.
    #[must_use]
    pub fn uses(&self, name: &str) -> bool {
        self.0.uses(name.as_bytes())
    }
}
