//! Lines, and the lexemes of an instruction. Every line can be split: a byte that belongs to no lexeme is one by itself.

use crate::Span;
use crate::lexeme::{self, Found, Lexeme, LexemeKind, text_or_other};
use nom::branch::alt;
use nom::bytes::complete::{tag, take_while, take_while1};
use nom::character::complete::{digit0, digit1, one_of};
use nom::combinator::{opt, recognize, rest};
use nom::sequence::preceded;
use nom::{IResult, Parser};

/// The lines of a text without blanks at their ends, each with its offset. Some files have CR alone at their ends.
pub(super) fn lines(bytes: &[u8]) -> impl Iterator<Item = (usize, &[u8])> {
    let mut at = 0;
    bytes.split(|b| matches!(b, b'\n' | b'\r')).map(move |line| {
        let start = at + (line.len() - line.trim_ascii_start().len());
        at += line.len() + 1;
        (start, line.trim_ascii())
    })
}

/// A line that is not empty.
pub(super) enum Line<'a> {
    Code(Vec<Lexeme<'a>>),
    /// The text of a comment after `deflex`, and the place of the comment.
    Mark(&'a [u8], Span),
}

impl<'a> Line<'a> {
    /// The line at an offset; `None` if it is empty.
    pub(super) fn read(bytes: &'a [u8], start: usize) -> Option<Self> {
        if let Some(comment) = bytes.strip_prefix(b"'") {
            let said = lexeme::mark(comment).filter(|said| !said.is_empty())?;
            return Some(Self::Mark(said, Span::new(start, start + bytes.len())));
        }
        let code = lexeme::lexemes(bytes, start, one);
        (!code.is_empty()).then_some(Self::Code(code))
    }

    /// Its lexemes; a mark has none.
    pub(super) fn code(&self) -> &[Lexeme<'a>] {
        if let Self::Code(code) = self { code } else { &[] }
    }
}

/// One lexeme; `None` of blanks and comments.
fn one(left: &[u8]) -> IResult<&[u8], Found<'_>> {
    let blank = take_while1(|b: u8| b.is_ascii_whitespace() || b == 0).map(|text| (None, text));
    let comment = recognize(preceded(alt((tag(&b"'"[..]), tag(&b"//"[..]))), rest)).map(|text| (None, text));
    let begins = |b: u8| b.is_ascii_alphabetic() || matches!(b, b'_' | b'$');
    let word = recognize((take_while1(begins), take_while(|b: u8| begins(b) || b.is_ascii_digit())));
    let whole = recognize((digit1, opt((tag(&b"."[..]), digit0))));
    let number = alt((whole, recognize((tag(&b"."[..]), digit1))));
    let sign = alt((
        alt((tag(&b"<>"[..]), tag(&b"<="[..]), tag(&b">="[..]), tag(&b"=="[..]))),
        recognize(one_of(&b"+-*/=<>()[],:#;"[..])),
    ));
    alt((
        blank,
        comment,
        word.map(|text| (Some(LexemeKind::Name), text)),
        number.map(|text| (Some(LexemeKind::Number), text)),
        sign.map(|text| (Some(LexemeKind::Sign), text)),
        text_or_other,
    ))
    .parse(left)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_comment_ends_an_instruction() {
        let text = b"NOP\r\n  MOVL P[I000] V=-1.5 //IN#(1)<>ON\r\n";
        let all: Vec<_> = lines(text).filter_map(|(start, line)| Line::read(line, start)).collect();
        let words: Vec<_> = all[1].code().iter().map(|lexeme| String::from_utf8_lossy(lexeme.text)).collect();
        assert_eq!(words.join(" "), "MOVL P [ I000 ] V = - 1.5");
        assert!(all.iter().flat_map(Line::code).all(|lexeme| &text[lexeme.span.range()] == lexeme.text));
        assert_eq!(all.len(), 2);
    }
}
