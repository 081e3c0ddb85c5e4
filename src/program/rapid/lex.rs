//! Bytes to tokens. Total: every byte is in a token or is blank, whatever the file holds.

use crate::text::Span;
use nom::branch::alt;
use nom::bytes::complete::{take_while, take_while1};
use nom::character::complete::{digit0, digit1, one_of};
use nom::combinator::{opt, recognize};
use nom::{IResult, Parser};

/// Kind of a token.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Identifier or reserved word.
    Word,
    /// Unsigned number; a sign is a token of its own.
    Number,
    /// String with its quotes.
    Text,
    /// `!` to the end of the line.
    Comment,
    /// `:=`, `<>`, `<=`, `>=` or one byte.
    Mark(u8),
}

/// A token.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Token {
    pub(super) kind: Kind,
    pub(super) span: Span,
}

/// `:=` as a mark.
pub(super) const ASSIGN: u8 = 1;

fn is_word(b: u8) -> bool {
    b.is_ascii_alphanumeric() || b == b'_' || b >= 0xC0
}

fn number(input: &[u8]) -> IResult<&[u8], &[u8]> {
    let exponent = (one_of("eE"), opt(one_of("+-")), digit1);
    let mantissa = alt((recognize((digit1, opt((one_of("."), digit0)))), recognize((one_of("."), digit1))));
    recognize((mantissa, opt(exponent))).parse(input)
}

fn word(input: &[u8]) -> IResult<&[u8], &[u8]> {
    take_while1(is_word)(input)
}

fn comment(input: &[u8]) -> IResult<&[u8], &[u8]> {
    take_while(|b| !matches!(b, b'\n' | b'\r'))(input)
}

/// Length of a string token: to the closing quote (`""` is a quote inside), or to the end of the line.
fn text_len(input: &[u8]) -> usize {
    let mut at = 1;
    while at < input.len() {
        match input[at] {
            b'"' if input.get(at + 1) == Some(&b'"') => at += 2,
            b'"' => return at + 1,
            b'\n' | b'\r' => return at,
            _ => at += 1,
        }
    }
    at
}

/// All tokens of a file.
pub(super) fn lex(bytes: &[u8]) -> Vec<Token> {
    let mut tokens = Vec::with_capacity(bytes.len() / 4);
    let mut at = if bytes.starts_with(b"\xEF\xBB\xBF") { 3 } else { 0 };
    while at < bytes.len() {
        let rest = &bytes[at..];
        let taken = |result: IResult<&[u8], &[u8]>| result.map_or(1, |(_, taken)| taken.len().max(1));
        let (kind, len) = match rest[0] {
            b if b.is_ascii_whitespace() || matches!(b, 0 | 0x0B | 0xA0) => {
                at += 1;
                continue;
            }
            b'!' => (Kind::Comment, taken(comment(rest))),
            b'"' => (Kind::Text, text_len(rest)),
            b'0'..=b'9' => (Kind::Number, taken(number(rest))),
            b'.' if rest.get(1).is_some_and(u8::is_ascii_digit) && !after_operand(&tokens, at) => {
                (Kind::Number, taken(number(rest)))
            }
            b':' if rest.get(1) == Some(&b'=') => (Kind::Mark(ASSIGN), 2),
            b if is_word(b) => (Kind::Word, taken(word(rest))),
            b => (Kind::Mark(b), 1),
        };
        tokens.push(Token { kind, span: Span::new(at, at + len) });
        at += len;
    }
    tokens
}

/// Whether a point at `at` selects a component (`p.trans`) instead of starting a number.
fn after_operand(tokens: &[Token], at: usize) -> bool {
    tokens.last().is_some_and(|t| t.span.end as usize == at && matches!(t.kind, Kind::Word | Kind::Mark(b'}')))
}
