//! What statements and positions have in common: blanks, words, numbers, brackets.

use nom::branch::alt;
use nom::bytes::complete::{tag, tag_no_case, take_while, take_while1};
use nom::character::complete::{char, digit0, digit1, one_of};
use nom::combinator::{opt, recognize, verify};
use nom::sequence::{pair, preceded, terminated};
use nom::{IResult, Parser};

/// The result of a parser of a part of a TP text.
pub type Parsed<'a, T> = IResult<&'a [u8], T>;

/// Blanks, and line ends within a position.
pub fn blanks(input: &[u8]) -> Parsed<'_, &[u8]> {
    take_while(|b: u8| b.is_ascii_whitespace()).parse(input)
}

/// `parser` with blanks before and after it.
pub fn spaced<'a, T>(
    parser: impl Parser<&'a [u8], Output = T, Error = nom::error::Error<&'a [u8]>>,
) -> impl Parser<&'a [u8], Output = T, Error = nom::error::Error<&'a [u8]>> {
    terminated(preceded(blanks, parser), blanks)
}

/// Letters of a word: those of exports in other languages than English are not ASCII.
pub(super) fn is_letter(b: u8) -> bool {
    b.is_ascii_alphanumeric() || b == b'_' || !b.is_ascii()
}

/// A word: a letter, then letters, digits and underscores.
pub fn word(input: &[u8]) -> Parsed<'_, &[u8]> {
    verify(take_while1(is_letter), |word: &[u8]| !word[0].is_ascii_digit()).parse(input)
}

/// A word as a whole, whatever its case.
pub(super) fn keyword<'a>(
    wanted: &'static str,
) -> impl Parser<&'a [u8], Output = &'a [u8], Error = nom::error::Error<&'a [u8]>> {
    verify(word, move |word: &[u8]| word.eq_ignore_ascii_case(wanted.as_bytes()))
}

/// A number token with its sign: `-12.5`, `.000`, `100.`, `4.29497e+09`.
pub fn number_token(input: &[u8]) -> Parsed<'_, &[u8]> {
    let digits = alt((recognize((digit1, opt(pair(char('.'), digit0)))), recognize(pair(char('.'), digit1))));
    let exponent = (tag_no_case("e"), opt(one_of("+-")), digit1);
    recognize((opt(one_of("+-")), digits, opt(exponent))).parse(input)
}

/// The value of a number token; `None` beyond the numbers of this machine.
pub fn value_of(token: &[u8]) -> Option<f64> {
    std::str::from_utf8(token).ok()?.parse().ok().filter(|value: &f64| value.is_finite())
}

/// `[…]`: the text inside, with balanced brackets. The second byte of a Japanese character (Shift-JIS) in a comment may look like a bracket; it
/// counts as text.
pub fn brackets(input: &[u8]) -> Parsed<'_, &[u8]> {
    let (rest, _) = tag("[").parse(input)?;
    let (mut depth, mut is_second) = (1_usize, false);
    for (at, byte) in rest.iter().enumerate() {
        // No Latin letter has the code of a first byte.
        is_second = !is_second && matches!(at.checked_sub(1).map(|before| rest[before]), Some(0x81..=0x9F));
        match byte {
            _ if is_second => {}
            b'[' => depth += 1,
            b']' => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return Ok((&rest[at + 1..], &rest[..at]));
        }
    }
    Err(nom::Err::Error(nom::error::Error::new(input, nom::error::ErrorKind::Char)))
}

/// An index in brackets without the comment that follows its colon: `3:pick up` is 3, `R[1:row]` is itself.
pub(super) fn index(within: &[u8]) -> &[u8] {
    let mut depth = 0_usize;
    for (at, byte) in within.iter().enumerate() {
        match byte {
            b'[' => depth += 1,
            b']' => depth = depth.saturating_sub(1),
            b':' if depth == 0 => return within[..at].trim_ascii(),
            _ => {}
        }
    }
    within.trim_ascii()
}

/// `GP1:3`, `3`: the text after the motion group; `None` for another group.
pub(super) fn of_first_group(within: &[u8]) -> Option<&[u8]> {
    let grouped = within.len() > 2 && within[..2].eq_ignore_ascii_case(b"GP");
    match within.iter().position(|b| *b == b':').filter(|_| grouped) {
        Some(at) => within[..at].trim_ascii().eq_ignore_ascii_case(b"GP1").then(|| &within[at + 1..]),
        None => Some(within),
    }
}

/// `9,1:x`, `9:home`: the index of a position register, and that of an element.
pub(super) fn register_and_element(within: &[u8]) -> (&[u8], Option<&[u8]>) {
    // A comment ends the indices, and may have commas.
    let indices = index(within);
    let mut depth = 0_i32;
    let comma = indices.iter().position(|b| {
        depth += i32::from(*b == b'[') - i32::from(*b == b']');
        depth == 0 && *b == b','
    });
    comma.map_or((indices, None), |at| (&indices[..at], Some(&indices[at + 1..])))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_every_look_are_tokens() {
        for text in ["-12.5", ".000", "-.500", "100.", "4.29497e+09", "+1"] {
            assert_eq!(number_token(text.as_bytes()).unwrap().0, b"", "{text}");
            assert!(value_of(text.as_bytes()).is_some(), "{text}");
        }
        for text in ["********", "-", ".", "mm"] {
            assert!(number_token(text.as_bytes()).is_err(), "{text}");
        }
    }

    #[test]
    fn an_index_loses_its_comment_alone() {
        let (rest, within) = brackets(b"[R[1:row]:x] 5").unwrap();
        assert_eq!((index(within), rest), (&b"R[1:row]"[..], &b" 5"[..]));
        assert!(brackets(b"[1").is_err());
    }
}
