//! Operators: how tight they bind, and what they make of two values.

use super::super::lex::{Cursor, Kind, Lexeme};
use super::super::symbols::Upper;
use super::super::value::Value;
use super::RUN_TIME;

/// Level and sign of the operator that a lexeme is.
#[inline]
pub(super) fn operator(cursor: &Cursor<'_>, lexeme: Lexeme) -> Option<(u8, &'static str)> {
    Some(match lexeme.kind {
        Kind::Mark(b'=') => (3, "="),
        Kind::Mark(b'<') => (3, "<"),
        Kind::Mark(b'>') => (3, ">"),
        Kind::Unequal => (3, "<>"),
        Kind::AtMost => (3, "<="),
        Kind::AtLeast => (3, ">="),
        Kind::Mark(b'+') => (4, "+"),
        Kind::Mark(b'-') => (4, "-"),
        Kind::Mark(b'*') => (5, "*"),
        Kind::Mark(b'/') => (5, "/"),
        Kind::Word => match &*Upper::new(cursor.text(lexeme)) {
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
    let unknown = || Value::Unknown(left.unknown().or(right.unknown()).unwrap_or(RUN_TIME));
    // One side can be enough.
    match (operator, left.bool(), right.bool()) {
        ("OR", Some(true), _) | ("OR", _, Some(true)) => return Value::Bool(true),
        ("AND", Some(false), _) | ("AND", _, Some(false)) => return Value::Bool(false),
        _ => {}
    }
    match (left, right) {
        (Value::Num(a, _), Value::Num(b, _)) => number_operation(operator, *a, *b).unwrap_or_else(unknown),
        (Value::Bool(a), Value::Bool(b)) => match operator {
            "OR" => Value::Bool(a | b),
            "AND" => Value::Bool(a & b),
            "XOR" | "<>" => Value::Bool(a != b),
            "=" => Value::Bool(a == b),
            _ => unknown(),
        },
        (Value::Text(a), Value::Text(b)) => match operator {
            "+" => Value::Text([&**a, &**b].concat().into()),
            "=" => Value::Bool(a == b),
            "<>" => Value::Bool(a != b),
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
