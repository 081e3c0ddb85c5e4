//! Splits a text into lexemes. Every text can be split: a byte that belongs to no lexeme is one by itself.

use crate::lexeme::{self, Found, Lexeme, LexemeKind, text_or_other};
use nom::branch::alt;
use nom::bytes::complete::{tag, take_till, take_while, take_while1};
use nom::character::complete::{digit0, digit1, one_of};
use nom::combinator::{opt, recognize};
use nom::sequence::preceded;
use nom::{IResult, Parser};

/// All lexemes of a text, without blanks and comments.
pub(super) fn lexemes(bytes: &[u8]) -> Vec<Lexeme<'_>> {
    let (mut depth, mut begins) = (0_usize, true);
    lexeme::lexemes(bytes, 0, |rest| {
        let (after, (kind, text)) = one(rest, begins)?;
        match (kind, text) {
            (Some(LexemeKind::Sign), b"(" | b"[") => depth += 1,
            (Some(LexemeKind::Sign), b")" | b"]") => depth = depth.saturating_sub(1),
            // Within brackets a statement goes on.
            (Some(LexemeKind::Line), _) if depth > 0 => return Ok((after, (None, text))),
            _ => {}
        }
        begins = kind == Some(LexemeKind::Line) || kind.is_none() && begins;
        Ok((after, (kind, text)))
    })
}

/// One lexeme; `None` of blanks and comments.
fn one(rest: &[u8], begins: bool) -> IResult<&[u8], Found<'_>> {
    // A label for the display, as PolyScope writes it: `$ 2 "MoveL"`.
    if begins && rest[0] == b'$' {
        return take_till(|b| b == b'\n').map(|text| (None, text)).parse(rest);
    }
    let blank = take_while1(|b: u8| matches!(b, b' ' | b'\t' | b'\r' | 0x0B | 0x0C | 0xA0)).map(|text| (None, text));
    let mark = tag(&b"\xEF\xBB\xBF"[..]).map(|text| (None, text));
    let comment = recognize(preceded(tag(&b"#"[..]), take_till(|b| b == b'\n')))
        .map(|text: &[u8]| (lexeme::mark(&text[1..]).map(|_| LexemeKind::Mark), text));
    let line = alt((tag(&b"\n"[..]), tag(&b";"[..]))).map(|text| (Some(LexemeKind::Line), text));
    let name = recognize((take_while1(|b: u8| b.is_ascii_alphabetic() || b == b'_'), take_while(is_word)));
    let sign = alt((
        alt((tag(&b"=="[..]), tag(&b"!="[..]), tag(&b"<="[..]), tag(&b">="[..]))),
        recognize(one_of(&b"+-*/%=<>()[],.:{}"[..])),
    ));
    alt((
        blank,
        mark,
        comment,
        line,
        name.map(|text| (Some(LexemeKind::Name), text)),
        number.map(|text| (Some(LexemeKind::Number), text)),
        sign.map(|text| (Some(LexemeKind::Sign), text)),
        text_or_other,
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_statement_goes_on_within_brackets() {
        let all = lexemes(b"movel(p[-.5,\n 1.e-3], r=0) # end\n$ 2 \"MoveL\"\n# Deflex air\n");
        let texts: Vec<_> = all.iter().map(|lexeme| String::from_utf8_lossy(lexeme.text)).collect();
        let expected = "movel ( p [ - .5 , 1.e-3 ] , r = 0 ) \n \n";
        assert_eq!(texts[..texts.len() - 2].join(" "), expected);
        assert_eq!(all[all.len() - 2].kind, LexemeKind::Mark);
    }
}
