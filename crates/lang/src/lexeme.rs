//! Lexemes with their places, and the parts that the lexers of all languages share.

use crate::Span;
use nom::branch::alt;
use nom::bytes::complete::{tag, take, take_till};
use nom::combinator::{opt, recognize};
use nom::{IResult, Parser};

/// The kind of a lexeme.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum LexemeKind {
    /// A name or a word of the language.
    Name,
    Number,
    Text,
    /// An operator or a bracket, of one or two characters.
    Sign,
    /// The end of a statement, outside of brackets.
    Line,
    /// A comment `# deflex …`.
    Mark,
    /// A text that the language does not have.
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

/// The result of a lexer: a lexeme, or `None` for blanks and comments, and the number of bytes.
pub(crate) type Found<'a> = (Option<LexemeKind>, &'a [u8]);

/// All lexemes of a text whose first byte is at `start`, without blanks and comments; `one` finds each.
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

/// The text after `deflex` in a comment that begins with this word; it may be empty.
pub(crate) fn mark(comment: &[u8]) -> Option<&[u8]> {
    let mut words = comment.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
    words.next().filter(|word| word.eq_ignore_ascii_case(b"deflex")).map(|_| words.next().unwrap_or_default())
}
