//! Numbers of CL data, including those of FORTRAN.

use deflex_text::number::read;
use nom::{
    IResult, Parser,
    branch::alt,
    character::complete::{char, digit0, digit1, one_of},
    combinator::{all_consuming, opt, recognize},
    sequence::preceded,
};

/// Longest number token, with both halves of one on two lines; longer ones are words.
pub(super) const MAX_NUMBER: usize = 64;

/// Reads a CL number: `5`, `5.`, `.5`, `1.E-3`, FORTRAN `1.D+03`; never infinite.
pub(super) fn number(text: &[u8]) -> Option<f64> {
    // Most chunks are words: look before parsing.
    if !matches!(text.first(), Some(b'0'..=b'9' | b'.' | b'+' | b'-')) || text.len() > MAX_NUMBER {
        return None;
    }
    plain_number(text).or_else(|| any_number(text))
}

/// A number without an exponent whose digits a double represents exactly. The quotient of two exact numbers is the nearest double, as from
/// [`any_number`].
fn plain_number(text: &[u8]) -> Option<f64> {
    /// Fifteen digits are below 2^53; ten to their count is exact as well.
    const DIGITS: usize = 15;
    const POWERS: [f64; DIGITS + 1] =
        [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15];
    let (negative, digits) = match text {
        [b'-', rest @ ..] => (true, rest),
        [b'+', rest @ ..] => (false, rest),
        _ => (false, text),
    };
    let mut mantissa = 0u64;
    let mut point = None;
    for (at, &byte) in digits.iter().enumerate() {
        match byte {
            b'0'..=b'9' => mantissa = mantissa.wrapping_mul(10).wrapping_add(u64::from(byte - b'0')),
            b'.' if point.is_none() => point = Some(at),
            _ => return None,
        }
    }
    let count = digits.len() - usize::from(point.is_some());
    if count == 0 || count > DIGITS {
        return None;
    }
    let after = point.map_or(0, |p| digits.len() - p - 1);
    #[allow(clippy::cast_precision_loss)] // exact: fifteen digits
    let value = mantissa as f64 / POWERS[after];
    Some(if negative { -value } else { value })
}

/// The reference: every form, exactly rounded.
fn any_number(text: &[u8]) -> Option<f64> {
    let (_, text) = all_consuming(recognize(decimal)).parse(text).ok()?;
    if let Some(d) = text.iter().position(|b| matches!(b, b'd' | b'D')) {
        let mut plain = [0; MAX_NUMBER];
        plain[..text.len()].copy_from_slice(text);
        plain[d] = b'E';
        return read(&plain[..text.len()]);
    }
    read(text)
}

fn decimal(input: &[u8]) -> IResult<&[u8], ()> {
    let mantissa = alt((recognize((digit1, opt(preceded(char('.'), digit0)))), recognize(preceded(char('.'), digit1))));
    let exponent = (one_of("eEdD"), opt(one_of("+-")), digit1);
    (opt(one_of("+-")), mantissa, opt(exponent)).map(|_| ()).parse(input)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_fast_reading_of_numbers_is_the_reference(text in "[-+]?[0-9]{0,9}\\.?[0-9]{0,12}") {
            let reference = any_number(text.as_bytes());
            prop_assert_eq!(number(text.as_bytes()).map(f64::to_bits), reference.map(f64::to_bits));
        }
    }
}
