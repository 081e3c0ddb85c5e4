//! The values of variables during the run.

use super::eval::Scope;
use super::expression::{Arguments, Expression, ExpressionKind, PartStep};
use super::runner::Runner;
use super::symbols::{Content, Upper, Variable, VariablePart};
use super::tree::Storage;
use super::value::{Value, parts};
use crate::Reason;
use deflex_text::{Span, decode};
use std::sync::Arc;

/// Number of parts of a copied value that count as one more statement.
const PARTS_PER_STEP: usize = 16;

impl<'a> Runner<'a> {
    /// The variable of a name.
    pub(super) fn find(&self, scope: Scope, key: &[u8]) -> Option<usize> {
        let frame = self.frames.last().filter(|_| scope.local);
        let local = frame.and_then(|frame| self.loop_variable(key).or_else(|| frame.names.get(key).copied()));
        local.or_else(|| self.symbols.find_data(scope.module, key))
    }

    /// The present value of a variable.
    pub(super) fn content(&mut self, at: usize) -> Value {
        if let Some(value) = self.state.values.get(&at) {
            return value.clone();
        }
        self.initial(at)
    }

    /// The value of a variable before anything changes it.
    pub(super) fn initial(&mut self, at: usize) -> Value {
        let variable = &self.symbols.variables[at];
        let initial = match &variable.content {
            Content::Is(value) => return value.clone(),
            Content::Busy => return Value::Unknown(Reason::InitialValueNeedsItself),
            Content::Part(part) => {
                let part = std::rc::Rc::clone(part);
                return self.part(&part);
            }
            Content::Declared(initial) => *initial,
        };
        let (source, module, kind) = (variable.source, variable.module, Arc::clone(&variable.kind));
        let (assigned, volatile) = (variable.assigned, variable.volatile);
        let local = at >= self.symbols.data;
        self.symbols.variables[at].content = Content::Busy;
        let mut value = self.evaluate(Scope { source, module, local, running: false }, initial);
        if *kind == *b"ROBTARGET"
            && let Value::List(..) = value
            && let Some(pose) = self.as_target(&value)
        {
            value = Value::Target(pose);
        } else if *kind != *b"ROBTARGET" {
            value = value.without_tokens();
        }
        if let Some(why) = volatile {
            value = Value::Unknown(why);
        } else if assigned {
            // Data of modules keep their values from one cycle to the next, those of routines begin anew in every call.
            value = if local { value.detached(Reason::TargetChanged) } else { value.left(Reason::TargetChanged) };
        }
        self.symbols.variables[at].content = Content::Is(value.clone());
        value
    }

    /// The value of a part of a variable.
    fn part(&mut self, part: &VariablePart) -> Value {
        let mut value = self.content(part.of);
        if !part.known {
            self.numbers.pin_value(&value);
            return Value::Unknown(Reason::Computed);
        }
        for at in &part.path {
            if let Value::Target(pose) = &value {
                self.numbers.pin(pose.root);
                value = parts(pose);
            }
            value = match value.list().and_then(|items| items.get(*at)) {
                Some(item) => item.clone(),
                None => return Value::Unknown(value.unknown().unwrap_or(Reason::Computed)),
            };
        }
        value
    }

    pub(super) fn new_variable(
        &mut self,
        bytes: &[u8],
        file: usize,
        module: usize,
        kind: Span,
        name: Span,
        value: Value,
    ) -> usize {
        self.symbols.variables.push(Variable {
            name: decode(&bytes[name.range()]).as_ref().into(),
            kind: Arc::from(&*Upper::new(&bytes[kind.range()])),
            storage: Storage::Var,
            #[allow(clippy::cast_possible_truncation)]
            source: file as u16,
            module,
            content: Content::Is(value),
            assigned: false,
            volatile: None,
            foreign: false,
            declared: None,
        });
        self.symbols.variables.len() - 1
    }

    pub(super) fn assign(&mut self, scope: Scope, to: &'a Expression, expression: &'a Expression) {
        let value = self.evaluate(scope, expression);
        self.numbers.pin_value(&value);
        self.touch();
        let Some(parts) = value.parts() else {
            self.refuse(
                scope.source,
                expression.span,
                "rapid.size",
                "an aggregate of more parts, or more within one another, than RAPID data have",
                "a controller does not load this: declare the array with its size",
            );
            return;
        };
        self.budget.spend(parts / PARTS_PER_STEP);
        if let Some(place) = self.place(scope, to) {
            self.store(&place, &value);
        }
    }

    /// The variable, or part of one, that an expression names; `None` for other expressions, and if the files do not declare it.
    pub(super) fn place(&mut self, scope: Scope, of: &'a Expression) -> Option<VariablePart> {
        let bytes = self.bytes(scope.source as usize);
        let at = self.find(scope, &Upper::new(&bytes[of.variable()?.range()]))?;
        let mut kind = Arc::clone(&self.symbols.variables[at].kind);
        let mut place = match &self.symbols.variables[at].content {
            Content::Part(part) => (**part).clone(),
            _ => VariablePart { of: at, path: Vec::new(), known: true },
        };
        let ExpressionKind::Part(part) = &of.kind else { return Some(place) };
        for step in &part.steps {
            match step {
                PartStep::Component(name) => {
                    let found = self.field(&kind, &Upper::new(&bytes[name.range()]));
                    match found.filter(|_| place.known) {
                        Some((index, next)) => {
                            place.path.push(index);
                            kind = next;
                        }
                        None => place.known = false,
                    }
                }
                PartStep::Index(indices) => {
                    for index in indices {
                        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
                        match self.evaluate(scope, index).num() {
                            Some(i) if i >= 1.0 && place.known => place.path.push(i.round() as usize - 1),
                            _ => place.known = false,
                        }
                    }
                }
            }
        }
        Some(place)
    }

    /// Stores a value. If it is unknown which part is assigned, every part that it may be becomes unknown.
    pub(super) fn store(&mut self, place: &VariablePart, value: &Value) {
        let value = if place.known { value.detached(Reason::Computed) } else { Value::Unknown(Reason::Computed) };
        if place.path.is_empty() {
            return self.set(place.of, value);
        }
        let old = self.content(place.of);
        self.budget.spend(old.parts().unwrap_or(0) / PARTS_PER_STEP);
        self.numbers.pin_value(&old);
        let new = replaced(&old.detached(Reason::Computed), &place.path, &value);
        self.set(place.of, new.unwrap_or(Value::Unknown(Reason::Computed)));
    }

    /// `Incr`, `Decr`, `Add`, `Clear`.
    pub(super) fn step_variable(&mut self, scope: Scope, arguments: &'a Arguments, name: &[u8]) {
        let Some(first) = arguments.positional.first() else { return };
        let by = match name {
            b"INCR" => Some(1.0),
            b"DECR" => Some(-1.0),
            b"ADD" => arguments.positional.get(1).and_then(|by| self.evaluate(scope, by).num()),
            _ => None,
        };
        let Some(place) = self.place(scope, first) else { return };
        let old = self.part(&place).num();
        let new = match (old, by) {
            _ if name == b"CLEAR" => Some(0.0),
            (Some(old), Some(by)) => Some(old + by),
            _ => None,
        };
        let value = new.map_or(Value::Unknown(Reason::Computed), |v| Value::Num(v, None));
        self.store(&place, &value);
    }
}

/// `value` with the item at `path` replaced.
fn replaced(value: &Value, path: &[usize], new: &Value) -> Option<Value> {
    let Some((first, rest)) = path.split_first() else { return Some(new.clone()) };
    let list = match value {
        Value::Target(pose) => parts(pose),
        other => other.clone(),
    };
    let mut items = list.list()?.to_vec();
    let item = items.get_mut(*first)?;
    *item = replaced(item, rest, new)?;
    Some(Value::List(items.into(), None))
}
