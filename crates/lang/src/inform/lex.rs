//! Lines, and the lexemes of an instruction. Every line has lexemes; what belongs to none is one by itself.

use crate::Span;
use crate::lexeme::{Kind, Lexeme};
use nom::branch::alt;
use nom::bytes::complete::{tag, take, take_till, take_while, take_while1};
use nom::character::complete::{digit0, digit1, one_of};
use nom::combinator::{opt, recognize, rest};
use nom::sequence::preceded;
use nom::{IResult, Parser};

/// The lines of a text without the blanks around them, each with where it begins. Some files have CR alone at their ends.
pub(super) fn lines(bytes: &[u8]) -> impl Iterator<Item = (usize, &[u8])> {
    let mut at = 0;
    bytes.split(|b| matches!(b, b'\n' | b'\r')).map(move |line| {
        let start = at + (line.len() - line.trim_ascii_start().len());
        at += line.len() + 1;
        (start, line.trim_ascii())
    })
}

/// All lexemes of a line that begins there, its blanks and comments left out.
pub(super) fn lexemes(line: &[u8], start: usize) -> Vec<Lexeme<'_>> {
    let (mut all, mut left) = (Vec::new(), line);
    while !left.is_empty() {
        let Ok((after, (kind, text))) = one(left) else { break };
        let at = start + line.len() - left.len();
        left = after;
        if let Some(kind) = kind {
            all.push(Lexeme { kind, text, span: Span::new(at, at + text.len()) });
        }
    }
    all
}

type Found<'a> = (Option<Kind>, &'a [u8]);

/// One lexeme; `None` of blanks and comments.
fn one(left: &[u8]) -> IResult<&[u8], Found<'_>> {
    let blank = take_while1(|b: u8| b.is_ascii_whitespace() || b == 0).map(|text| (None, text));
    let comment = recognize(preceded(alt((tag(&b"'"[..]), tag(&b"//"[..]))), rest)).map(|text| (None, text));
    let begins = |b: u8| b.is_ascii_alphabetic() || matches!(b, b'_' | b'$');
    let word = recognize((take_while1(begins), take_while(|b: u8| begins(b) || b.is_ascii_digit())));
    let whole = recognize((digit1, opt((tag(&b"."[..]), digit0))));
    let number = alt((whole, recognize((tag(&b"."[..]), digit1))));
    let text = recognize((tag(&b"\""[..]), take_till(|b| b == b'"'), opt(tag(&b"\""[..]))));
    let sign = alt((
        alt((tag(&b"<>"[..]), tag(&b"<="[..]), tag(&b">="[..]), tag(&b"=="[..]))),
        recognize(one_of(&b"+-*/=<>()[],:#;"[..])),
    ));
    alt((
        blank,
        comment,
        word.map(|text| (Some(Kind::Name), text)),
        number.map(|text| (Some(Kind::Number), text)),
        text.map(|text| (Some(Kind::Text), text)),
        sign.map(|text| (Some(Kind::Sign), text)),
        take(1_usize).map(|text| (Some(Kind::Other), text)),
    ))
    .parse(left)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_comment_ends_an_instruction() {
        let text = b"NOP\r\n  MOVL P[I000] V=-1.5 //IN#(1)<>ON\r\n";
        let all: Vec<_> = lines(text).map(|(start, line)| lexemes(line, start)).filter(|all| !all.is_empty()).collect();
        let words: Vec<_> = all[1].iter().map(|lexeme| String::from_utf8_lossy(lexeme.text)).collect();
        assert_eq!(words.join(" "), "MOVL P [ I000 ] V = - 1.5");
        assert!(all.iter().flatten().all(|lexeme| &text[lexeme.span.range()] == lexeme.text));
        assert_eq!(all.len(), 2);
    }
}
