//! Operators: their precedence and their results.

use super::super::lex::{Cursor, Lexeme, LexemeKind};
use super::super::symbols::Upper;
use super::super::value::Value;
use crate::program::Reason;

/// ABB, *RAPID overview*: a string has at most 80 characters.
const MOST_TEXT: usize = 80;

/// Whether two numbers compare in the controller's single precision as they do here: they are identical, or clearly apart.
#[allow(clippy::float_cmp)] // the very number
fn can_be_told_apart(a: f64, b: f64) -> bool {
    /// A few roundings of single precision.
    const NEAR: f64 = 16.0 * f32::EPSILON as f64;
    a == b || (a - b).abs() > NEAR * a.abs().max(b.abs())
}

/// Whether two values are the same, as RAPID compares them.
#[allow(clippy::float_cmp)] // RAPID's own comparison
pub(in super::super) fn equal(left: &Value, right: &Value) -> Option<bool> {
    match (left, right) {
        (Value::Num(a, _), Value::Num(b, _)) => can_be_told_apart(*a, *b).then_some(*a == *b),
        (Value::Bool(a), Value::Bool(b)) => Some(a == b),
        (Value::Text(a), Value::Text(b)) => Some(a == b),
        _ => None,
    }
}

/// Precedence and sign of the operator, if the lexeme is one.
#[inline]
pub(super) fn operator(cursor: &Cursor<'_>, lexeme: Lexeme) -> Option<(u8, &'static str)> {
    Some(match lexeme.kind {
        LexemeKind::Mark(b'=') => (3, "="),
        LexemeKind::Mark(b'<') => (3, "<"),
        LexemeKind::Mark(b'>') => (3, ">"),
        LexemeKind::Unequal => (3, "<>"),
        LexemeKind::AtMost => (3, "<="),
        LexemeKind::AtLeast => (3, ">="),
        LexemeKind::Mark(b'+') => (4, "+"),
        LexemeKind::Mark(b'-') => (4, "-"),
        LexemeKind::Mark(b'*') => (5, "*"),
        LexemeKind::Mark(b'/') => (5, "/"),
        LexemeKind::Word => match &*Upper::new(cursor.text(lexeme)) {
            b"OR" => (0, "OR"),
            b"XOR" => (0, "XOR"),
            b"AND" => (1, "AND"),
            b"DIV" => (5, "DIV"),
            b"MOD" => (5, "MOD"),
            _ => return None,
        },
        _ => return None,
    })
}

pub(super) fn apply(operator: &str, left: &Value, right: &Value) -> Value {
    let unknown = || Value::Unknown(left.unknown().or(right.unknown()).unwrap_or(Reason::Computed));
    // One operand can decide.
    match (operator, left.bool(), right.bool()) {
        ("OR", Some(true), _) | ("OR", _, Some(true)) => return Value::Bool(true),
        ("AND", Some(false), _) | ("AND", _, Some(false)) => return Value::Bool(false),
        _ => {}
    }
    match (left, right) {
        (Value::Num(a, _), Value::Num(b, _)) => number_operation(operator, *a, *b).unwrap_or_else(unknown),
        (_, _)
            if matches!(operator, "=" | "<>")
                && !matches!((left, right), (Value::List(..), _) | (_, Value::List(..))) =>
        {
            equal(left, right).map_or_else(unknown, |same| Value::Bool(same == (operator == "=")))
        }
        (Value::Bool(a), Value::Bool(b)) => match operator {
            "OR" => Value::Bool(a | b),
            "AND" => Value::Bool(a & b),
            "XOR" => Value::Bool(a != b),
            _ => unknown(),
        },
        (Value::Text(a), Value::Text(b)) => match operator {
            "+" if a.len() + b.len() > MOST_TEXT => Value::Unknown(Reason::TextTooLong),
            "+" => Value::Text([&**a, &**b].concat().into()),
            _ => unknown(),
        },
        // pos + pos, pos * num
        (Value::List(a, _), Value::List(b, _)) if matches!(operator, "+" | "-") && a.len() == b.len() => {
            Value::List(a.iter().zip(b.iter()).map(|(a, b)| apply(operator, a, b)).collect(), None)
        }
        (Value::List(a, _), Value::Num(..)) if matches!(operator, "*" | "/") => {
            Value::List(a.iter().map(|a| apply(operator, a, right)).collect(), None)
        }
        (Value::Num(..), Value::List(b, _)) if operator == "*" => {
            Value::List(b.iter().map(|b| apply(operator, left, b)).collect(), None)
        }
        _ => unknown(),
    }
}

#[allow(clippy::float_cmp)] // RAPID's own comparison
fn number_operation(operator: &str, a: f64, b: f64) -> Option<Value> {
    let number = |v: f64| v.is_finite().then_some(Value::Num(v, None));
    if matches!(operator, "=" | "<>" | "<" | ">" | "<=" | ">=") && !can_be_told_apart(a, b) {
        return None;
    }
    match operator {
        "+" => number(a + b),
        "-" => number(a - b),
        "*" => number(a * b),
        "/" => number(a / b),
        "DIV" => number((a / b).trunc()),
        "MOD" => number(a % b),
        "=" => Some(Value::Bool(a == b)),
        "<>" => Some(Value::Bool(a != b)),
        "<" => Some(Value::Bool(a < b)),
        ">" => Some(Value::Bool(a > b)),
        "<=" => Some(Value::Bool(a <= b)),
        ">=" => Some(Value::Bool(a >= b)),
        _ => None,
    }
}
