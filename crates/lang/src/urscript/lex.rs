//! Bytes to lexemes. Every text has lexemes; what belongs to none is one by itself.

use crate::Span;
use crate::lexeme::{Kind, Lexeme};
use nom::branch::alt;
use nom::bytes::complete::{tag, take, take_till, take_while, take_while1};
use nom::character::complete::{digit0, digit1, one_of};
use nom::combinator::{opt, recognize};
use nom::sequence::preceded;
use nom::{IResult, Parser};

/// All lexemes of a text, its blanks and comments left out.
pub(super) fn lexemes(bytes: &[u8]) -> Vec<Lexeme<'_>> {
    let (mut all, mut rest, mut depth) = (Vec::new(), bytes, 0_usize);
    let mut begins = true;
    while !rest.is_empty() {
        let Ok((after, (kind, text))) = one(rest, begins) else { break };
        let start = bytes.len() - rest.len();
        rest = after;
        match (kind, text) {
            (Some(Kind::Sign), b"(" | b"[") => depth += 1,
            (Some(Kind::Sign), b")" | b"]") => depth = depth.saturating_sub(1),
            // Within brackets a statement goes on.
            (Some(Kind::Line), _) if depth > 0 => continue,
            _ => {}
        }
        begins = kind == Some(Kind::Line) || kind.is_none() && begins;
        if let Some(kind) = kind {
            all.push(Lexeme { kind, text, span: Span::new(start, start + text.len()) });
        }
    }
    all
}

type Found<'a> = (Option<Kind>, &'a [u8]);

/// One lexeme; `None` of blanks and comments.
fn one(rest: &[u8], begins: bool) -> IResult<&[u8], Found<'_>> {
    // A label for the display, as PolyScope writes it: `$ 2 "MoveL"`.
    if begins && rest[0] == b'$' {
        return take_till(|b| b == b'\n').map(|text| (None, text)).parse(rest);
    }
    let blank = take_while1(|b: u8| matches!(b, b' ' | b'\t' | b'\r' | 0x0B | 0x0C | 0xA0)).map(|text| (None, text));
    let mark = tag(&b"\xEF\xBB\xBF"[..]).map(|text| (None, text));
    let comment = recognize(preceded(tag(&b"#"[..]), take_till(|b| b == b'\n'))).map(comment);
    let line = alt((tag(&b"\n"[..]), tag(&b";"[..]))).map(|text| (Some(Kind::Line), text));
    let name = recognize((take_while1(|b: u8| b.is_ascii_alphabetic() || b == b'_'), take_while(is_word)));
    let text = recognize((tag(&b"\""[..]), take_till(|b| b == b'"' || b == b'\n'), opt(tag(&b"\""[..]))));
    let sign = alt((
        alt((tag(&b"=="[..]), tag(&b"!="[..]), tag(&b"<="[..]), tag(&b">="[..]))),
        recognize(one_of(&b"+-*/%=<>()[],.:{}"[..])),
    ));
    alt((
        blank,
        mark,
        comment,
        line,
        name.map(|text| (Some(Kind::Name), text)),
        number.map(|text| (Some(Kind::Number), text)),
        text.map(|text| (Some(Kind::Text), text)),
        sign.map(|text| (Some(Kind::Sign), text)),
        take(1_usize).map(|text| (Some(Kind::Other), text)),
    ))
    .parse(rest)
}

fn is_word(b: u8) -> bool {
    b.is_ascii_alphanumeric() || b == b'_'
}

/// `1`, `1.5`, `.5`, `1.`, `1e-3`
fn number(rest: &[u8]) -> IResult<&[u8], &[u8]> {
    let exponent = || opt((one_of(&b"eE"[..]), opt(one_of(&b"+-"[..])), digit1));
    let whole = recognize((digit1, opt((tag(&b"."[..]), digit0)), exponent()));
    let part = recognize((tag(&b"."[..]), digit1, exponent()));
    alt((whole, part)).parse(rest)
}

/// A comment, which may be a mark.
fn comment(text: &[u8]) -> Found<'_> {
    let mut words = text[1..].split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
    let is_mark = words.next().is_some_and(|word| word.eq_ignore_ascii_case(b"deflex"));
    (is_mark.then_some(Kind::Mark), text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_statement_goes_on_within_brackets() {
        let all = lexemes(b"movel(p[-.5,\n 1.e-3], r=0) # end\n$ 2 \"MoveL\"\n# Deflex air\n");
        let texts: Vec<_> = all.iter().map(|lexeme| String::from_utf8_lossy(lexeme.text)).collect();
        let expected = "movel ( p [ - .5 , 1.e-3 ] , r = 0 ) \n \n";
        assert_eq!(texts[..texts.len() - 2].join(" "), expected);
        assert_eq!(all[all.len() - 2].kind, Kind::Mark);
    }
}
