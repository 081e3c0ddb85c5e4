//! Expressions and conditions as trees.

use super::builtin;
use super::lex::{
    Parsed, blanks, brackets, index, is_letter, number_token, of_first_group, register_and_element, spaced, value_of,
    word,
};
use crate::ir::{Binary, Expression, ExpressionKind as Is, SourceSpan, Unary};
use crate::reason::Reason;
use nom::Parser;
use nom::branch::alt;
use nom::bytes::complete::{tag, take_until};
use nom::character::complete::char;
use nom::combinator::{map, recognize};
use nom::multi::many0_count;

/// Largest nesting of parentheses: more than programs have.
const DEEPEST: usize = 32;

/// Longest text of an expression: more than a line of a program has. It bounds the depth of a sum of many terms.
const LONGEST: usize = 1000;

/// An expression; an unknown one if the text is not an expression.
pub(super) fn expression(text: &[u8], place: SourceSpan) -> Expression {
    match condition(text, place) {
        (rest, whole) if rest.trim_ascii().is_empty() => whole,
        _ => unknown(place),
    }
}

/// A condition up to a comma, `THEN` or its end, and the text after it.
pub(super) fn condition(text: &[u8], place: SourceSpan) -> (&[u8], Expression) {
    let tree = if text.len() > LONGEST { None } else { Terms { place }.joined(text, &LEVELS, DEEPEST).ok() };
    tree.unwrap_or_else(|| (text, unknown(place)))
}

/// The number in a text, as the number of a register, label, frame or position; `None` if it is computed.
///
/// # Examples
/// ```
/// use deflex_lang::tp::count;
///
/// assert_eq!((count(b"3"), count(b"R[1]")), (Some(3), None));
/// ```
#[must_use]
pub fn count(text: &[u8]) -> Option<u32> {
    constant(&expression(text, SourceSpan::default()))
}

/// The same for an expression.
pub(super) fn constant(expression: &Expression) -> Option<u32> {
    match expression.kind {
        Is::Constant(number) => counted(number),
        _ => None,
    }
}

/// The value as a whole number from 0 on, if single precision represents it.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
pub(super) fn counted(number: f64) -> Option<u32> {
    (number >= 0.0 && crate::value::is_whole(number)).then_some(number as u32)
}

fn unknown(place: SourceSpan) -> Expression {
    Expression::unknown(Reason::Input, Vec::new(), place)
}

/// The meaning of an operator.
#[derive(Clone, Copy)]
enum Joins {
    By(Binary),
    /// The whole part of a quotient.
    Quotient,
}

/// Operators of one level of precedence.
type Level = &'static [(&'static str, Joins)];

/// `… OR …`
const ANY_OF: Level = &[("OR", Joins::By(Binary::Or)), ("[+]", Joins::By(Binary::Or))];

/// `… AND …`
const ALL_OF: Level = &[("AND", Joins::By(Binary::And)), ("[&]", Joins::By(Binary::And))];

const COMPARISON: Level = &[
    ("<>", Joins::By(Binary::NotEqual)),
    ("<=", Joins::By(Binary::AtMost)),
    (">=", Joins::By(Binary::AtLeast)),
    ("=", Joins::By(Binary::Equal)),
    ("<", Joins::By(Binary::Less)),
    (">", Joins::By(Binary::Greater)),
];

const SUM: Level = &[("+", Joins::By(Binary::Add)), ("-", Joins::By(Binary::Subtract))];

const PRODUCT: Level = &[
    ("*", Joins::By(Binary::Multiply)),
    ("/", Joins::By(Binary::Divide)),
    ("DIV", Joins::Quotient),
    ("MOD", Joins::By(Binary::Remainder)),
];

/// All levels, loosest first; operators of one level are read from left to right.
const LEVELS: [Level; 5] = [ANY_OF, ALL_OF, COMPARISON, SUM, PRODUCT];

/// The next operator, as a whole word, and the text after it.
fn operator(input: &[u8], level: Level) -> Option<(&[u8], Joins)> {
    let input = input.trim_ascii_start();
    level.iter().find_map(|(sign, joins)| {
        let (head, rest) = input.split_at_checked(sign.len())?;
        let goes_on = is_letter(head[0]) && rest.first().is_some_and(|b| is_letter(*b));
        (head.eq_ignore_ascii_case(sign.as_bytes()) && !goes_on).then_some((rest, *joins))
    })
}

/// Reads the expressions of a statement at this place.
struct Terms {
    place: SourceSpan,
}

impl Terms {
    fn of(&self, kind: Is) -> Expression {
        Expression { kind, place: self.place }
    }

    /// Operands with operators of these levels.
    fn joined<'a>(&self, input: &'a [u8], levels: &[Level], depth: usize) -> Parsed<'a, Expression> {
        let Some((level, tighter)) = levels.split_first() else { return self.operand(input, depth) };
        let (mut rest, mut left) = self.joined(input, tighter, depth)?;
        while let Some((operand, joins)) = operator(rest, level) {
            let (after, right) = self.joined(operand, tighter, depth)?;
            rest = after;
            left = match joins {
                Joins::By(operator) => self.of(Is::Binary(operator, Box::new([left, right]))),
                Joins::Quotient => Expression::builtin(builtin::QUOTIENT, vec![left, right], self.place),
            };
        }
        Ok((rest, left))
    }

    /// A number, a register, something else in brackets, a word, or an expression in parentheses.
    fn operand<'a>(&self, input: &'a [u8], depth: usize) -> Parsed<'a, Expression> {
        let (input, _) = blanks(input)?;
        let too_deep = || nom::Err::Failure(nom::error::Error::new(input, nom::error::ErrorKind::TooLarge));
        let inner = depth.checked_sub(1).ok_or_else(too_deep)?;
        if let Ok((rest, _)) = char('(').parse(input) as Parsed<'_, _> {
            let (rest, within) = self.joined(rest, &LEVELS, inner)?;
            return map(spaced(char(')')), |_| within.clone()).parse(rest);
        }
        if let Ok((rest, _)) = char('!').parse(input) as Parsed<'_, _> {
            let (rest, operand) = self.operand(rest, inner)?;
            return Ok((rest, self.of(Is::Unary(Unary::Not, Box::new(operand)))));
        }
        if let Ok((rest, token)) = number_token(input) {
            return Ok((rest, value_of(token).map_or_else(|| unknown(self.place), Expression::constant)));
        }
        if let Ok((rest, _)) = char('-').parse(input) as Parsed<'_, _> {
            let (rest, operand) = self.operand(rest, inner)?;
            return Ok((rest, self.of(Is::Unary(Unary::Negate, Box::new(operand)))));
        }
        if let Ok((rest, _)) = other(input) {
            return Ok((rest, unknown(self.place)));
        }
        let (rest, name) = word(input)?;
        let Ok((rest, within)) = brackets(rest) else { return Ok((rest, unknown(self.place))) };
        if name.eq_ignore_ascii_case(b"R") {
            let number = self.number(index(within), inner)?;
            return Ok((rest, Expression::builtin(builtin::REGISTER, vec![number], self.place)));
        }
        let register = of_first_group(within).filter(|_| name.eq_ignore_ascii_case(b"PR")).map(register_and_element);
        let Some((register, Some(element))) = register else { return Ok((rest, unknown(self.place))) };
        let both = vec![self.number(register, inner)?, self.number(element, inner)?];
        Ok((rest, Expression::builtin(builtin::VALUE, both, self.place)))
    }

    /// The expression in an index.
    fn number<'a>(&self, index: &'a [u8], depth: usize) -> Result<Expression, nom::Err<nom::error::Error<&'a [u8]>>> {
        let (left_over, number) = self.joined(index, &LEVELS, depth)?;
        Ok(if left_over.is_empty() { number } else { unknown(self.place) })
    }
}

/// A text, or a system variable with its fields and indices.
fn other(input: &[u8]) -> Parsed<'_, &[u8]> {
    let text = recognize((char('\''), take_until("'"), char('\'')));
    let field = alt((tag("."), tag("$"), word, brackets));
    alt((text, recognize((tag("$"), many0_count(field))))).parse(input)
}
