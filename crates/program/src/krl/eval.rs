//! Evaluates expressions.

use super::expression::{Expression, Operator, Path, PathStep};
use super::names;
use super::run::Runner;
use super::symbols::Id;
use super::value::{Literal, Name, POSE, REST, Selector, Value, chained, flat};
use crate::Reason;
use deflex_lang::ir::Binary;
use deflex_lang::run::binary;
use deflex_lang::value::{Content, Number};
use deflex_text::decode;
use std::rc::Rc;

/// A variable, or a part of it.
#[derive(Clone, Debug)]
pub(super) struct VariablePath<'e> {
    pub(super) id: Id,
    pub(super) name: &'e Name,
    pub(super) steps: Vec<Selector>,
    /// Whether all indices are known.
    pub(super) known: bool,
}

impl<'a> Runner<'a> {
    /// The variable of a name in the running routine.
    pub(super) fn resolve(&mut self, name: &Name) -> Id {
        if let Some(id) = self.frames.last().and_then(|frame| frame.names.get(name)) {
            return *id;
        }
        self.symbols.find(self.here(), name)
    }

    /// The present value of a variable.
    pub(super) fn value(&self, id: Id) -> Value {
        self.state.at(id, &self.symbols.start).clone()
    }

    /// Makes a variable unknown that may have changed.
    pub(super) fn lose(&mut self, id: Id, why: Reason) {
        let value = self.value(id).forgotten(why);
        self.state.values.insert(id, value);
    }

    /// The present value of a variable; unknown if it may change at any moment.
    pub(super) fn settled(&self, id: Id) -> Value {
        if self.is_volatile(id) { Value::unknown(Reason::AnyMoment) } else { self.value(id) }
    }

    pub(super) fn pin(&mut self, value: &Value) {
        self.pinned.extend(value.tokens());
    }

    /// Pins all numbers of a position other than X, Y and Z.
    fn pin_angles(&mut self, position: &Value) {
        let Value::Record(fields) = position else { return };
        fields.iter().filter(|(name, _)| !POSE[..3].contains(&&name[..])).for_each(|(_, part)| self.pin(part));
    }

    /// Sets the value at a path. If the path is not known, its numbers must not be edited.
    pub(super) fn put(&mut self, whole: &mut Value, path: &[Selector], value: Value) {
        whole.set(path, value, &mut self.pinned);
    }

    /// The value of an expression whose numbers must not be edited: a condition, a bound, a returned value.
    pub(super) fn evaluate(&mut self, of: &Expression) -> Value {
        let value = self.expression(of);
        self.pin(&value);
        value
    }

    pub(super) fn expression(&mut self, of: &Expression) -> Value {
        match of {
            Expression::Known(value) => value.clone(),
            Expression::Path(path) => {
                let place = self.place(path);
                self.read(&place)
            }
            Expression::Call(call) => self.function(call),
            Expression::Aggregate(fields) => {
                let fields = fields.iter().map(|(name, value)| (name.clone(), self.expression(value)));
                Value::Record(Rc::new(fields.collect()))
            }
            Expression::Chain(first, rest) => {
                let mut is_real = self.is_real(first);
                rest.iter().fold(self.expression(first), |value, (operator, other)| {
                    is_real |= self.is_real(other);
                    let other = self.expression(other);
                    if let Some(sum) = sum(*operator, &value, &other) {
                        self.pin(&other);
                        return sum;
                    }
                    self.pin(&other);
                    if let Some(pose) = chained(&value, &other).filter(|_| matches!(operator, Operator::Frame)) {
                        self.pin_angles(&value);
                        return pose;
                    }
                    self.pin(&value);
                    match operator {
                        Operator::Frame => Value::unknown(Reason::ChainOfUnknown),
                        Operator::Other(Binary::Divide) if is_real => quotient(&value, &other),
                        Operator::Other(operator) => operate(*operator, &value, &other),
                    }
                })
            }
            Expression::Unknown(why, parts) | Expression::Refused(why, _, parts) => {
                parts.iter().for_each(|part| drop(self.evaluate(part)));
                if let Expression::Refused(_, at, _) = of {
                    self.refuse(*at, *why);
                }
                Value::unknown(*why)
            }
        }
    }

    /// Whether a number is surely a REAL and not an INT, by its text or its declaration.
    fn is_real(&mut self, of: &Expression) -> bool {
        match of {
            Expression::Known(Value::Number(_, Some(Literal { place, .. }))) => {
                let text = &self.bytes(usize::from(place.source))[place.span.range()];
                text.iter().any(|byte| matches!(byte, b'.' | b'E' | b'e'))
            }
            Expression::Path(path) => {
                let place = self.place(path);
                self.symbols.is_real(place.id, &place.steps)
            }
            Expression::Chain(first, rest) => self.is_real(first) || rest.iter().any(|(_, other)| self.is_real(other)),
            _ => false,
        }
    }

    /// The variable, or part of one, that a path names.
    pub(super) fn place<'e>(&mut self, path: &'e Path) -> VariablePath<'e> {
        let mut place = VariablePath { id: self.resolve(&path.name), name: &path.name, steps: Vec::new(), known: true };
        for step in &path.steps {
            match step {
                PathStep::Component(name, _) => place.steps.push(Selector::Component(name.clone())),
                PathStep::Index(indices) => {
                    let at = self.indices(indices).and_then(|all| flat(&all));
                    place.known &= at.is_some() || indices.is_empty();
                    place.steps.extend(at.map(Selector::Element));
                }
            }
        }
        place
    }

    fn indices(&mut self, indices: &[Expression]) -> Option<Vec<i64>> {
        let all: Vec<Option<i64>> = indices.iter().map(|index| self.evaluate(index).index()).collect();
        all.into_iter().collect()
    }

    /// The name of a variable, or of a part of it, as it is written, with the values of its indices: `Points[3]`. `None` for other
    /// expressions.
    pub(super) fn label(&mut self, of: &Expression) -> Option<String> {
        let Expression::Path(path) = of else { return None };
        let bytes = self.bytes(self.here());
        let mut label = decode(&bytes[path.at.range()]).into_owned();
        for step in &path.steps {
            match step {
                PathStep::Component(_, at) => label += &format!(".{}", decode(&bytes[at.range()])),
                PathStep::Index(indices) => {
                    if let Some(all) = self.indices(indices).filter(|all| flat(all).is_some()) {
                        let shown: Vec<String> = all.iter().map(ToString::to_string).collect();
                        label += &format!("[{}]", shown.join(","));
                    }
                }
            }
        }
        Some(label)
    }

    /// The value at a path. If it is unknown, the numbers that it may have must not be edited.
    pub(super) fn read(&mut self, path: &VariablePath<'_>) -> Value {
        if path.name.first() == Some(&b'$') && !names::SETTLED.contains(&&path.name[..]) {
            return Value::unknown(Reason::SystemValue);
        }
        if self.symbols.is_signal(path.id) {
            return Value::unknown(Reason::SystemValue);
        }
        let whole = self.value(path.id);
        if self.is_volatile(path.id) {
            self.pin(&whole);
            return whole.get(&path.steps).forgotten(Reason::AnyMoment);
        }
        if !path.known {
            self.pin(&whole);
            return Value::unknown(Reason::IndexUnknown);
        }
        if self.symbols.is_table(path.id)
            && let (Value::Array(items), Some(Selector::Element(at))) = (&whole, path.steps.first())
            && !items.contains_key(at)
            && !items.contains_key(&REST)
        {
            let own = Value::Own(format!("{}[{at}]", decode(path.name)).into());
            return own.get(&path.steps[1..]);
        }
        let value = whole.get(&path.steps);
        if value.has_part_of_last_run() {
            self.read_later.insert(path.id);
        }
        match value {
            Value::Unknown(_, Some(_)) => self.pin(&value),
            // An INT cannot have decimals, so its number must not be edited.
            Value::Number(number, Some(_)) if !self.symbols.is_real(path.id, &path.steps) => {
                self.pin(&value);
                return Value::Number(number, None);
            }
            _ => {}
        }
        value
    }
}

/// The sum or difference of a number that depends on a literal, and another number; `None` for anything else.
fn sum(operator: Operator, number: &Value, other: &Value) -> Option<Value> {
    let by = match operator {
        Operator::Other(Binary::Add) => other.number()?,
        Operator::Other(Binary::Subtract) => -other.number()?,
        _ => return None,
    };
    number.moved(number.number()? + by)
}

/// The quotient of two numbers of which one is a REAL. That of two INT is [`operate`]d, because it has no decimals.
fn quotient(a: &Value, b: &Value) -> Value {
    let quotient = a.number().zip(b.number()).map(|(a, b)| a / b).filter(|quotient| quotient.is_finite());
    quotient.map_or(Value::unknown(Reason::Computed), |quotient| Value::Number(quotient, None))
}

/// Arithmetic, comparisons and logic of known values.
fn operate(operator: Binary, a: &Value, b: &Value) -> Value {
    /// Computed numbers closer than this count as equal: controllers count in single precision.
    const SAME: f64 = 1e-4;
    let is_apart = || a.number().zip(b.number()).is_some_and(|(a, b)| (a - b).abs() > SAME * (1.0 + a.abs()));
    let known = |value: &Value| match value {
        Value::Number(value, _) => {
            Content::Number(Number { value: *value, exact: value.fract() == 0.0 || is_apart(), affine: None })
        }
        Value::Bool(truth) => Content::Truth(*truth),
        Value::Constant(name) => Content::Text(name.clone()),
        _ => Content::Unknown(Reason::Computed),
    };
    match binary(operator, &known(a).into(), &known(b).into()).content {
        Content::Number(number) => Value::Number(number.value, None),
        Content::Truth(truth) => Value::Bool(truth),
        _ => Value::unknown(Reason::Computed),
    }
}
