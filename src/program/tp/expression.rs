//! Values of registers and conditions, as far as they are known.
//!
//! A value is known only where it is a whole number: the controller holds reals in single precision, and whether two of
//! those compare equal is not for a reader to say.

use super::lex::{Parsed, blanks, brackets, index, keyword, number_token, spaced, value_of, word};
use nom::Parser;
use nom::branch::alt;
use nom::bytes::complete::{tag, take_until};
use nom::character::complete::char;
use nom::combinator::{map, recognize};
use nom::multi::many0_count;
use std::collections::BTreeMap;

/// Registers whose value is known.
pub(super) type Registers = BTreeMap<u32, f64>;

/// A value, or `None` where it is known only at run time.
type Known = Option<f64>;

/// Single precision does not distinguish whole numbers from here on.
const EXACT: f64 = 16_777_216.0;

/// Parentheses deeper than this are no program's.
const DEPTH: usize = 32;

/// The value of an expression, or `None` where it is unknown or no expression.
pub(super) fn value(text: &[u8], registers: &Registers) -> Known {
    let (rest, value) = any_of(text.trim_ascii(), registers, DEPTH).ok()?;
    if rest.is_empty() { value } else { None }
}

/// A condition up to a comma, `THEN` or its end: what follows, and whether it holds.
pub(super) fn condition<'a>(text: &'a [u8], registers: &Registers) -> (&'a [u8], Option<bool>) {
    match any_of(text, registers, DEPTH) {
        Ok((rest, value)) => (rest, value.map(|value| value != 0.0)),
        Err(_) => (text, None),
    }
}

/// A number from 0 on that counts registers, labels, frames or positions.
pub(super) fn count(text: &[u8], registers: &Registers) -> Option<u32> {
    let value = value(text, registers)?;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    (0.0..EXACT).contains(&value).then_some(value as u32)
}

fn whole(value: f64) -> Known {
    (value.fract() == 0.0 && value.abs() < EXACT).then_some(value)
}

/// `… OR …`
fn any_of<'a>(input: &'a [u8], registers: &Registers, depth: usize) -> Parsed<'a, Known> {
    let or = |a: Known, b: Known| match (a, b) {
        (Some(a), _) if a != 0.0 => Some(1.0),
        (_, Some(b)) if b != 0.0 => Some(1.0),
        (Some(_), Some(_)) => Some(0.0),
        _ => None,
    };
    let (mut rest, mut held) = all_of(input, registers, depth)?;
    while let Ok((behind, _)) = spaced(alt((keyword("OR"), tag("[+]")))).parse(rest) as Parsed<'_, _> {
        let (behind, more) = all_of(behind, registers, depth)?;
        (rest, held) = (behind, or(held, more));
    }
    Ok((rest, held))
}

/// `… AND …`
fn all_of<'a>(input: &'a [u8], registers: &Registers, depth: usize) -> Parsed<'a, Known> {
    let and = |a: Known, b: Known| match (a, b) {
        (Some(0.0), _) | (_, Some(0.0)) => Some(0.0),
        (Some(_), Some(_)) => Some(1.0),
        _ => None,
    };
    let (mut rest, mut held) = comparison(input, registers, depth)?;
    while let Ok((behind, _)) = spaced(alt((keyword("AND"), tag("[&]")))).parse(rest) as Parsed<'_, _> {
        let (behind, more) = comparison(behind, registers, depth)?;
        (rest, held) = (behind, and(held, more));
    }
    Ok((rest, held))
}

fn comparison<'a>(input: &'a [u8], registers: &Registers, depth: usize) -> Parsed<'a, Known> {
    let (rest, left) = sum(input, registers, depth)?;
    let signs = (tag("<>"), tag("<="), tag(">="), tag("="), tag("<"), tag(">"));
    let Ok((rest, sign)) = spaced(alt(signs)).parse(rest) as Parsed<'_, &[u8]> else { return Ok((rest, left)) };
    let (rest, right) = sum(rest, registers, depth)?;
    #[allow(clippy::float_cmp)] // whole numbers
    let holds = left.zip(right).map(|(a, b)| match sign {
        b"<>" => a != b,
        b"<=" => a <= b,
        b">=" => a >= b,
        b"<" => a < b,
        b">" => a > b,
        _ => a == b,
    });
    Ok((rest, holds.map(|holds| f64::from(u8::from(holds)))))
}

fn sum<'a>(input: &'a [u8], registers: &Registers, depth: usize) -> Parsed<'a, Known> {
    let (mut rest, mut total) = product(input, registers, depth)?;
    while let Ok((behind, sign)) = spaced(alt((char('+'), char('-')))).parse(rest) as Parsed<'_, char> {
        let (behind, more) = product(behind, registers, depth)?;
        let both = total.zip(more);
        total = both.and_then(|(a, b)| whole(if sign == '+' { a + b } else { a - b }));
        rest = behind;
    }
    Ok((rest, total))
}

fn product<'a>(input: &'a [u8], registers: &Registers, depth: usize) -> Parsed<'a, Known> {
    let (mut rest, mut total) = operand(input, registers, depth)?;
    let operators = |input| {
        spaced(alt((tag("*"), tag("/"), map(keyword("DIV"), |_| &b"DIV"[..]), map(keyword("MOD"), |_| &b"MOD"[..]))))
            .parse(input) as Parsed<'_, &[u8]>
    };
    while let Ok((behind, operator)) = operators(rest) {
        let (behind, more) = operand(behind, registers, depth)?;
        let both = total.zip(more).filter(|(_, b)| *b != 0.0 || operator == b"*");
        total = both.and_then(|(a, b)| {
            whole(match operator {
                b"*" => a * b,
                b"/" => a / b,
                b"DIV" => (a / b).trunc(),
                _ => a % b,
            })
        });
        rest = behind;
    }
    Ok((rest, total))
}

/// A number, a register, something else in brackets, a word, or an expression in parentheses.
fn operand<'a>(input: &'a [u8], registers: &Registers, depth: usize) -> Parsed<'a, Known> {
    let (input, _) = blanks(input)?;
    let too_deep = || nom::Err::Failure(nom::error::Error::new(input, nom::error::ErrorKind::TooLarge));
    let inner = depth.checked_sub(1).ok_or_else(too_deep)?;
    if let Ok((rest, _)) = char('(').parse(input) as Parsed<'_, _> {
        let (rest, value) = any_of(rest, registers, inner)?;
        return map(spaced(char(')')), |_| value).parse(rest);
    }
    if let Ok((rest, _)) = char('!').parse(input) as Parsed<'_, _> {
        let (rest, value) = operand(rest, registers, inner)?;
        return Ok((rest, value.map(|value| f64::from(u8::from(value == 0.0)))));
    }
    if let Ok((rest, token)) = number_token(input) {
        return Ok((rest, value_of(token).and_then(whole)));
    }
    if let Ok((rest, _)) = char('-').parse(input) as Parsed<'_, _> {
        let (rest, value) = operand(rest, registers, inner)?;
        return Ok((rest, value.map(|value| -value)));
    }
    if let Ok((rest, _)) = other(input) {
        return Ok((rest, None));
    }
    let (rest, name) = word(input)?;
    let Ok((rest, within)) = brackets(rest) else { return Ok((rest, None)) };
    if !name.eq_ignore_ascii_case(b"R") {
        return Ok((rest, None));
    }
    let (behind, number) = any_of(index(within), registers, inner)?;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let number = number.filter(|number| behind.is_empty() && (0.0..EXACT).contains(number)).map(|number| number as u32);
    Ok((rest, number.and_then(|number| registers.get(&number).copied())))
}

/// A text, or a system variable with its fields and indices.
fn other(input: &[u8]) -> Parsed<'_, &[u8]> {
    let text = recognize((char('\''), take_until("'"), char('\'')));
    let field = alt((tag("."), tag("$"), word, brackets));
    alt((text, recognize((tag("$"), many0_count(field))))).parse(input)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_numbers_are_known_and_nothing_else() {
        let registers = Registers::from([(1, 3.0), (2, 10.0)]);
        let known = |text: &str| value(text.as_bytes(), &registers);
        assert_eq!(known("R[1:row]*4+R[2]-(-1)"), Some(23.0));
        assert_eq!(known("R[R[1]-2]"), Some(3.0));
        assert_eq!(known("(R[2] DIV 4)*(R[2] MOD 4)"), Some(4.0));
        for unknown in ["R[2]/4", "R[3]", "2.5", "R[1]/0", "R[1]+DI[1]", "AR[1]", "R[1] R[2]", "", "((("] {
            assert_eq!(known(unknown), None, "{unknown}");
        }
        let holds = |text: &str| condition(text.as_bytes(), &registers).1;
        assert_eq!(holds("R[1]=3 AND R[2]>9,JMP LBL[1]"), Some(true));
        assert_eq!(holds("(R[1]<>3 OR !(R[2]<=10))"), Some(false));
        assert_eq!(holds("R[1]=4 AND DI[1]=ON"), Some(false));
        assert_eq!(holds("R[1]=3 AND DI[1]=ON"), None);
        assert_eq!(condition(b"$DCSS[1].$STOP<>1 OR SR[1]='A,b',JMP", &registers), (&b",JMP"[..], None));
        let deep = format!("{}1{}", "(".repeat(500), ")".repeat(500));
        assert_eq!(known(&deep), None);
    }
}
