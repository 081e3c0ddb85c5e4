//! The parser's state: where it reads, and the file so far.

use super::lex::{Cursor, Key, Lexeme, LexemeKind, key};
use super::tree::File;
use crate::Reason;
use deflex_text::Span;

/// How a simple statement's scan ended.
pub(super) enum Scan {
    Done,
    Broken(Reason),
}

pub(super) struct Parser<'a> {
    pub(super) cursor: Cursor<'a>,
    pub(super) index: u16,
    pub(super) file: File,
    /// The module read last had its ENDMODULE.
    pub(super) ended: bool,
}

impl<'a> Parser<'a> {
    pub(super) fn key_of(&self, lexeme: Lexeme) -> Option<Key> {
        if lexeme.kind == LexemeKind::Word { key(self.cursor.text(lexeme)) } else { None }
    }

    pub(super) fn peek_key(&mut self) -> Option<Key> {
        let lexeme = self.cursor.peek();
        self.key_of(lexeme)
    }

    pub(super) fn odd(&mut self, from: usize, reason: Reason) {
        let end = self.cursor.passed.max(from);
        self.file.odd.push((Span::new(from, end), reason));
    }
}
