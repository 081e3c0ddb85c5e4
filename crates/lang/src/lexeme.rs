//! A word of a text with its place: what the lexers of all languages make, and how they make it.

use crate::Span;
use nom::branch::alt;
use nom::bytes::complete::{tag, take, take_till};
use nom::combinator::{opt, recognize};
use nom::{IResult, Parser};

/// What a lexeme is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum LexemeKind {
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
    pub(crate) kind: LexemeKind,
    pub(crate) text: &'a [u8],
    pub(crate) span: Span,
}

impl Lexeme<'_> {
    /// Whether it is this name or sign.
    pub(crate) fn is(&self, text: &str) -> bool {
        matches!(self.kind, LexemeKind::Name | LexemeKind::Sign) && self.text == text.as_bytes()
    }
}

/// What a lexer finds: `None` of blanks and comments, and the bytes.
pub(crate) type Found<'a> = (Option<LexemeKind>, &'a [u8]);

/// All lexemes of a text whose first byte is at `start`, as `one` finds them, its blanks and comments left out.
pub(crate) fn lexemes<'a>(
    text: &'a [u8],
    start: usize,
    mut one: impl FnMut(&'a [u8]) -> IResult<&'a [u8], Found<'a>>,
) -> Vec<Lexeme<'a>> {
    let (mut all, mut left) = (Vec::new(), text);
    while !left.is_empty() {
        let Ok((after, (kind, found))) = one(left) else { break };
        let at = start + text.len() - left.len();
        left = after;
        if let Some(kind) = kind {
            all.push(Lexeme { kind, text: found, span: Span::new(at, at + found.len()) });
        }
    }
    all
}

/// A text in quotation marks, which may lack its end, or else any byte by itself.
pub(crate) fn text_or_other(left: &[u8]) -> IResult<&[u8], Found<'_>> {
    let text = recognize((tag(&b"\""[..]), take_till(|b| b == b'"' || b == b'\n'), opt(tag(&b"\""[..]))));
    alt((text.map(|text| (Some(LexemeKind::Text), text)), take(1_usize).map(|text| (Some(LexemeKind::Other), text))))
        .parse(left)
}

/// What a comment says after `deflex`, where that is its first word; it may say nothing.
pub(crate) fn mark(comment: &[u8]) -> Option<&[u8]> {
    let mut words = comment.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
    words.next().filter(|word| word.eq_ignore_ascii_case(b"deflex")).map(|_| words.next().unwrap_or_default())
}
