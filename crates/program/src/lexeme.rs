//! Lexemes with their places, and the parts that the lexers of RAPID and KRL share.

use deflex_text::Span;
use nom::branch::alt;
use nom::bytes::complete::take_while_m_n;
use nom::character::complete::{char, one_of};
use nom::combinator::{opt, recognize};
use nom::{IResult, Parser};

/// A lexeme with its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Lexeme<K> {
    pub(crate) kind: K,
    pub(crate) start: usize,
    pub(crate) end: usize,
}

impl<K> Lexeme<K> {
    pub(crate) fn span(&self) -> Span {
        Span::new(self.start, self.end)
    }
}

pub(crate) type Bytes<'a> = &'a [u8];
pub(crate) type Found<'a> = IResult<Bytes<'a>, Bytes<'a>, ()>;

fn digits(input: Bytes<'_>) -> Found<'_> {
    take_while_m_n(1, usize::MAX, |b: u8| b.is_ascii_digit()).parse(input)
}

/// `12`, `1.5`, `5.`, `.5`, `9E+09`: without a sign.
pub(crate) fn decimal(input: Bytes<'_>) -> Found<'_> {
    let exponent = recognize((one_of("eE"), opt(one_of("+-")), digits));
    let whole = recognize((digits, opt((char('.'), opt(digits)))));
    recognize((alt((whole, recognize((char('.'), digits)))), opt(exponent))).parse(input)
}
