//! Evaluates expressions, as far as their values are known.

mod functions;
mod operators;

use super::expression::{Expression, ExpressionKind, Operation, Part, PartStep};
use super::literal::Literal;
use super::runner::Runner;
use super::symbols::Upper;
use super::value::{self, Pose, Value};
use crate::Reason;
use deflex_lang::ir::{Binary, SourceSpan};
use deflex_text::Span;
use operators::apply;
pub(super) use operators::equal;
use std::rc::Rc;
use std::sync::Arc;

/// The place of an expression, which decides the meaning of its names.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scope {
    pub(super) source: u16,
    pub(super) module: usize,
    /// Whether names of the running routine are visible; not in an initial value of a module's data.
    pub(super) local: bool,
    /// Whether it is not an initial value.
    pub(super) running: bool,
}

/// The meaning of a name: its value, and the type of the variable that it is, in upper case.
struct NamedValue {
    value: Value,
    kind: Option<Arc<[u8]>>,
}

impl<'a> Runner<'a> {
    /// The value of an expression.
    pub(super) fn evaluate(&mut self, scope: Scope, of: &'a Expression) -> Value {
        let value = self.value(scope, of);
        if matches!(value, Value::Unknown(Reason::TextTooLong)) {
            let help = "a controller stops here: RAPID texts have at most 80 characters";
            self.refuse(scope.source, of.span, "rapid.text-length", Reason::TextTooLong.text(), help);
        }
        value
    }

    /// The value of an expression or of a part of one.
    fn value(&mut self, scope: Scope, of: &'a Expression) -> Value {
        let place = SourceSpan { source: scope.source, span: of.span };
        match &of.kind {
            ExpressionKind::Number(value) => {
                value.map_or(Value::Unknown(Reason::NotANumber), |value| Value::Num(value, Some(place)))
            }
            ExpressionKind::Text => {
                let text = &self.bytes(scope.source as usize)[of.span.range()];
                Value::Text(Rc::from(text.get(1..text.len() - 1).unwrap_or_default()))
            }
            ExpressionKind::Literal(index) => {
                let pose = self.literal_pose(scope.source, *index);
                pose.map_or(Value::Unknown(Reason::NotANumber), |pose| Value::Target(Rc::new(pose)))
            }
            ExpressionKind::Name => self.name(scope, of.span).value,
            ExpressionKind::Aggregate(items) => {
                Value::List(items.iter().map(|item| self.value(scope, item)).collect(), Some(place))
            }
            ExpressionKind::Part(part) => self.part_of(scope, part),
            ExpressionKind::Call(call) => self.function(scope, call),
            // In brackets it is an expression: not a token to replace.
            ExpressionKind::Bracketed(inner) => match self.value(scope, inner) {
                Value::Num(value, _) => Value::Num(value, None),
                other => other,
            },
            ExpressionKind::Negated(inner) => match self.value(scope, inner) {
                Value::Num(value, _) => Value::Num(-value, None),
                Value::List(items, _) => match items.iter().map(Value::num).collect::<Option<Vec<_>>>() {
                    Some(nums) => Value::List(nums.into_iter().map(|v| Value::Num(-v, None)).collect(), None),
                    None => Value::Unknown(Reason::Computed),
                },
                other => other,
            },
            ExpressionKind::Not(inner) => match self.value(scope, inner) {
                Value::Bool(holds) => Value::Bool(!holds),
                _ => Value::Unknown(Reason::Computed),
            },
            ExpressionKind::Chain(chain) => {
                let mut left = self.value(scope, &chain.first);
                for Operation { operator, right } in &chain.operations {
                    let right = self.value(scope, right);
                    // A value computed from a robtarget would move with it.
                    for side in [&left, &right] {
                        if matches!(side, Value::Target(_) | Value::List(..)) {
                            self.numbers.pin_value(side);
                        }
                    }
                    let divides = matches!(operator, Binary::Divide | Binary::Quotient | Binary::Remainder);
                    if divides && right.num().is_none_or(|by| by == 0.0) {
                        self.expression_may_fail();
                    }
                    left = apply(*operator, &left, &right);
                }
                left
            }
            ExpressionKind::Unknown(reason, parts) => {
                for part in parts {
                    let value = self.value(scope, part);
                    self.numbers.pin_value(&value);
                }
                Value::Unknown(*reason)
            }
        }
    }

    /// A complete robtarget of a file as a value with its place.
    pub(super) fn literal_pose(&self, source: u16, index: u32) -> Option<Pose> {
        let root = self.numbers.literal_id(usize::from(source), index)?;
        let start = self.numbers.literals[root as usize].span().start as usize;
        let (_, written) = Literal::read(self.bytes(usize::from(source)), source, start)?;
        Some(Pose { written, root: Some(root), steps: Vec::new(), fixed: None })
    }

    /// A value as a robtarget, if it is one.
    pub(super) fn as_target(&mut self, value: &Value) -> Option<Rc<Pose>> {
        match value {
            Value::Target(pose) => Some(Rc::clone(pose)),
            Value::List(_, place) => {
                let (written, literal) = value.assemble()?;
                let root = literal.and_then(|l| self.numbers.own_literal(l));
                self.numbers.unassembled.extend(place.filter(|_| root.is_none()));
                let text = matches!(value, Value::List(_, Some(_)));
                let why = if text { Reason::TargetWithExpression } else { Reason::Computed };
                let fixed = root.is_none().then_some(why);
                Some(Rc::new(Pose { written, root, steps: Vec::new(), fixed }))
            }
            _ => None,
        }
    }

    /// The meaning of a name.
    fn name(&mut self, scope: Scope, name: Span) -> NamedValue {
        let name = &self.bytes(scope.source as usize)[name.range()];
        let key = Upper::new(name);
        let Some(at) = self.find(scope, &key) else {
            let value = value::predefined(&key).unwrap_or(Value::Unknown(undeclared(name)));
            return NamedValue { value, kind: None };
        };
        let variable = &self.symbols.variables[at];
        // An initial value consists of constants; a variable would have its value of another moment.
        let changes = !scope.running && variable.assigned;
        let kind = Some(Arc::clone(&variable.kind));
        self.uses_frame(at);
        let value = self.content(at);
        NamedValue { value: if changes { Value::Unknown(Reason::InitialValueChanges) } else { value }, kind }
    }

    /// A part of a variable, or of the result of a function.
    fn part_of(&mut self, scope: Scope, part: &'a Part) -> Value {
        let NamedValue { mut value, kind } = match part.of.kind {
            ExpressionKind::Name => self.name(scope, part.of.span),
            _ => NamedValue { value: self.value(scope, &part.of), kind: None },
        };
        let is_variable = kind.is_some();
        let mut kind = kind.unwrap_or_default();
        for step in &part.steps {
            match step {
                PartStep::Index(indices) => {
                    for index in indices {
                        let index = self.value(scope, index);
                        if index.num().is_none() {
                            self.numbers.pin_value(&value);
                        }
                        if !is_within(&value, &index) {
                            self.expression_may_fail();
                        }
                        value = element(&value, &index);
                    }
                }
                PartStep::Component(name) => {
                    if let Value::Target(pose) = &value {
                        match self.is_shown {
                            true => self.found.bound_to_point.extend(pose.root),
                            false => self.numbers.pin_pose(pose),
                        }
                        value = value::parts(pose);
                        kind = Arc::from(&b"ROBTARGET"[..]);
                    }
                    let name = Upper::new(&self.bytes(scope.source as usize)[name.range()]);
                    let Some((at, next)) = self.field(&kind, &name) else {
                        value = Value::Unknown(Reason::ComponentUnknown);
                        kind = Arc::default();
                        continue;
                    };
                    let item = value.list().and_then(|items| items.get(at)).map(Value::without_tokens);
                    value = item.unwrap_or(Value::Unknown(Reason::Computed));
                    kind = next;
                }
            }
        }
        // An element of an array of robtargets may be assembled from parts.
        if is_variable
            && *kind == *b"ROBTARGET"
            && let Some(pose) = self.as_target(&value)
        {
            return Value::Target(pose);
        }
        value
    }

    pub(super) fn field(&self, kind: &[u8], name: &[u8]) -> Option<(usize, Arc<[u8]>)> {
        if let Some(fields) = self.symbols.records.get(kind) {
            let at = fields.iter().position(|(f, _)| **f == *name)?;
            return Some((at, Arc::clone(&fields[at].1)));
        }
        value::component(kind, name).map(|(at, kind)| (at, Arc::from(kind)))
    }
}

/// An element by an index counted from 1.
fn element(value: &Value, index: &Value) -> Value {
    let (Some(items), Some(index)) = (value.list(), index.num()) else {
        return Value::Unknown(value.unknown().or(index.unknown()).unwrap_or(Reason::Computed));
    };
    at(index).and_then(|at| items.get(at)).cloned().unwrap_or(Value::Unknown(Reason::IndexOutside))
}

/// Whether an array is known to have an element of this index.
fn is_within(value: &Value, index: &Value) -> bool {
    value.list().zip(index.num().and_then(at)).is_some_and(|(items, at)| at < items.len())
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
fn at(index: f64) -> Option<usize> {
    (index >= 1.0).then(|| index.round() as usize - 1)
}

/// Why a name that nothing declares has no value.
fn undeclared(name: &[u8]) -> Reason {
    if deflex_text::number::is_none(name) { Reason::NotANumber } else { Reason::NameUndeclared }
}
