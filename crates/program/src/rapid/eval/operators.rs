//! The results of operators.

use super::super::value::Value;
use crate::Reason;
use deflex_lang::ir::Binary;

/// ABB, *RAPID overview*: a string has at most 80 characters.
const MOST_TEXT: usize = 80;

/// Whether two numbers compare in the controller's single precision as they do here: they are identical, or clearly apart.
#[allow(clippy::float_cmp)] // the very number
fn can_be_distinguished(a: f64, b: f64) -> bool {
    /// A few roundings of single precision.
    const NEAR: f64 = 16.0 * f32::EPSILON as f64;
    a == b || (a - b).abs() > NEAR * a.abs().max(b.abs())
}

/// Whether two values are the same, as RAPID compares them.
#[allow(clippy::float_cmp)] // RAPID's own comparison
pub(in super::super) fn equal(left: &Value, right: &Value) -> Option<bool> {
    match (left, right) {
        (Value::Num(a, _), Value::Num(b, _)) => can_be_distinguished(*a, *b).then_some(*a == *b),
        (Value::Bool(a), Value::Bool(b)) => Some(a == b),
        (Value::Text(a), Value::Text(b)) => Some(a == b),
        _ => None,
    }
}

pub(super) fn apply(operator: Binary, left: &Value, right: &Value) -> Value {
    let unknown = || Value::Unknown(left.unknown().or(right.unknown()).unwrap_or(Reason::Computed));
    // One operand can decide.
    match (operator, left.bool(), right.bool()) {
        (Binary::Or, Some(true), _) | (Binary::Or, _, Some(true)) => return Value::Bool(true),
        (Binary::And, Some(false), _) | (Binary::And, _, Some(false)) => return Value::Bool(false),
        _ => {}
    }
    match (left, right) {
        (Value::Num(a, _), Value::Num(b, _)) => number_operation(operator, *a, *b).unwrap_or_else(unknown),
        (_, _)
            if matches!(operator, Binary::Equal | Binary::NotEqual)
                && !matches!((left, right), (Value::List(..), _) | (_, Value::List(..))) =>
        {
            equal(left, right).map_or_else(unknown, |same| Value::Bool(same == (operator == Binary::Equal)))
        }
        (Value::Bool(a), Value::Bool(b)) => match operator {
            Binary::Or => Value::Bool(a | b),
            Binary::And => Value::Bool(a & b),
            Binary::Xor => Value::Bool(a != b),
            _ => unknown(),
        },
        (Value::Text(a), Value::Text(b)) => match operator {
            Binary::Add if a.len() + b.len() > MOST_TEXT => Value::Unknown(Reason::TextTooLong),
            Binary::Add => Value::Text([&**a, &**b].concat().into()),
            _ => unknown(),
        },
        // pos + pos, pos * num
        (Value::List(a, _), Value::List(b, _))
            if matches!(operator, Binary::Add | Binary::Subtract) && a.len() == b.len() =>
        {
            Value::List(a.iter().zip(b.iter()).map(|(a, b)| apply(operator, a, b)).collect(), None)
        }
        (Value::List(a, _), Value::Num(..)) if matches!(operator, Binary::Multiply | Binary::Divide) => {
            Value::List(a.iter().map(|a| apply(operator, a, right)).collect(), None)
        }
        (Value::Num(..), Value::List(b, _)) if operator == Binary::Multiply => {
            Value::List(b.iter().map(|b| apply(operator, left, b)).collect(), None)
        }
        _ => unknown(),
    }
}

#[allow(clippy::float_cmp)] // RAPID's own comparison
fn number_operation(operator: Binary, a: f64, b: f64) -> Option<Value> {
    let number = |v: f64| v.is_finite().then_some(Value::Num(v, None));
    let truth = |holds: bool| can_be_distinguished(a, b).then_some(Value::Bool(holds));
    match operator {
        Binary::Add => number(a + b),
        Binary::Subtract => number(a - b),
        Binary::Multiply => number(a * b),
        Binary::Divide => number(a / b),
        Binary::Quotient => number((a / b).trunc()),
        Binary::Remainder => number(a % b),
        Binary::Equal => truth(a == b),
        Binary::NotEqual => truth(a != b),
        Binary::Less => truth(a < b),
        Binary::Greater => truth(a > b),
        Binary::AtMost => truth(a <= b),
        Binary::AtLeast => truth(a >= b),
        Binary::Or | Binary::Xor | Binary::And => None,
    }
}
