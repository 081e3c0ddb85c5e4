//! A word of a text with its place: what the lexers of all languages make.

use crate::Span;

/// What a lexeme is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// A name or a word of the language.
    Name,
    Number,
    Text,
    /// An operator or a bracket; two characters where the language has one of two.
    Sign,
    /// The end of a statement, outside brackets.
    Line,
    /// A comment `# deflex …`.
    Mark,
    /// Nothing that the language has.
    Other,
}

/// A lexeme with its place.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lexeme<'a> {
    pub(crate) kind: Kind,
    pub(crate) text: &'a [u8],
    pub(crate) span: Span,
}

impl Lexeme<'_> {
    /// Whether it is this name or sign.
    pub(crate) fn is(&self, text: &str) -> bool {
        matches!(self.kind, Kind::Name | Kind::Sign) && self.text == text.as_bytes()
    }
}
