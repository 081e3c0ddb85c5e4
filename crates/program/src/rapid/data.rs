//! The values of variables during the run.

use super::eval::Scope;
use super::expression::{Arguments, Expression, ExpressionKind, Operation, Part, PartStep};
use super::runner::Runner;
use super::symbols::{Content, Upper, Variable, VariablePart};
use super::tree::Storage;
use super::value::{Pose, Value, parts};
use crate::Reason;
use deflex_lang::ir::Binary;
use deflex_text::{Span, decode};
use std::rc::Rc;
use std::sync::Arc;

/// Coordinates of a position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Coordinates {
    All,
    One(usize),
}

impl Coordinates {
    fn zero(self) -> [Option<f64>; 3] {
        std::array::from_fn(|axis| (self == Self::All || self == Self::One(axis)).then_some(0.0))
    }

    /// Their numbers in the value of an expression; `None` if the value is unknown.
    fn numbers(self, value: &Value) -> Option<[Option<f64>; 3]> {
        match self {
            Self::All => value.nums().map(|all: [f64; 3]| all.map(Some)),
            Self::One(axis) => {
                let mut numbers = [None; 3];
                numbers[axis] = Some(value.num()?);
                Some(numbers)
            }
        }
    }
}

/// Coordinates of a robtarget with known numbers added; `None` for the other coordinates.
struct Moved {
    from: Rc<Pose>,
    by_mm: [Option<f64>; 3],
}

/// Number of parts of a copied value that count as one more statement.
const PARTS_PER_STEP: usize = 16;

impl<'a> Runner<'a> {
    /// The variable of a name.
    pub(super) fn find(&self, scope: Scope, key: &[u8]) -> Option<usize> {
        let frame = self.frames.last().filter(|_| scope.local);
        let local = frame.and_then(|frame| self.loop_variable(key).or_else(|| frame.names.get(key).copied()));
        local.or_else(|| self.symbols.find_data(scope.module, key))
    }

    /// The present value of a variable, for a use of it.
    pub(super) fn content(&mut self, at: usize) -> Value {
        let value = self.held(at);
        let is_unknown = match &value {
            Value::Unknown(_) => true,
            // A robtarget has four parts.
            Value::List(parts, _) => parts.len() == 4 && value.unknown().is_some(),
            _ => false,
        };
        if is_unknown {
            self.numbers.reads(at);
        }
        value
    }

    /// The present value of a variable.
    fn held(&mut self, at: usize) -> Value {
        if let Some(value) = self.state.values.get(at) {
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
                let part = Rc::clone(part);
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
        match &value {
            Value::Target(pose) => self.numbers.holds(at, pose),
            // The elements of an array are not followed.
            other if volatile.is_some() || assigned && !local => self.numbers.pin_value(other),
            _ => {}
        }
        if let Some(why) = volatile {
            value = Value::Unknown(why);
        } else if assigned && !local {
            // Data of modules keep their values from one cycle to the next, those of routines begin anew in every call.
            value = value.left(Reason::TargetChanged);
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
                self.numbers.pin_pose(pose);
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
        self.numbers.begins(self.symbols.variables.len());
        if let Value::Target(pose) = &value {
            self.numbers.holds(self.symbols.variables.len(), pose);
        }
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
        if let Some((at, moved)) = self.moved(scope, to, expression) {
            return self.set(at, Value::Target(Rc::new(moved)));
        }
        let value = self.evaluate(scope, expression);
        if let Some(at) = self.holder(scope, to)
            && let Some(pose) = self.as_target(&value).filter(|pose| pose.root.is_some())
        {
            return self.set(at, Value::Target(pose));
        }
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

    /// The variable that an expression names, if the robtargets that it holds are followed to their numbers in the text. Another task may read
    /// a `PERS`.
    fn holder(&self, scope: Scope, of: &Expression) -> Option<usize> {
        let bytes = self.bytes(scope.source as usize);
        let at = self.find(scope, &Upper::new(&bytes[of.span.range()])).filter(|_| of.is_name())?;
        let Variable { kind, storage, content, .. } = &self.symbols.variables[at];
        let is_whole = !matches!(content, Content::Part(_));
        (is_whole && **kind == *b"ROBTARGET" && *storage == Storage::Var).then_some(at)
    }

    /// The variable and the robtarget that it holds after an assignment to its position: one that is moved by known numbers
    /// (`p.trans.z:=p.trans.z+50`), or at a known coordinate (`p.trans.z:=200`).
    fn moved(&mut self, scope: Scope, to: &'a Expression, expression: &'a Expression) -> Option<(usize, Pose)> {
        let ExpressionKind::Part(part) = &to.kind else { return None };
        let (at, coordinates) = (self.holder(scope, &part.of)?, self.coordinates(scope, part)?);
        let known = |this: &mut Self| match this.held(at) {
            Value::Target(pose) if pose.root.is_some() => Some(pose),
            _ => None,
        };
        known(self)?;
        let moved = self.sum(scope, expression, coordinates);
        let value = if moved.is_none() { Some(self.evaluate(scope, expression)) } else { None };
        // A function in the expression may have changed the variable.
        let held = known(self)?;
        let pose = match (moved, value) {
            (Some(Moved { from, by_mm }), _) => held.with(&from, by_mm)?,
            (None, Some(value)) => {
                self.numbers.pin_value(&value);
                held.stated(coordinates.numbers(&value)?)
            }
            (None, None) => return None,
        };
        Some((at, pose))
    }

    /// The coordinates of a position that a part of a robtarget is.
    fn coordinates(&self, scope: Scope, part: &Part) -> Option<Coordinates> {
        let bytes = self.bytes(scope.source as usize);
        let is = |name: &Span, other: &[u8]| bytes[name.range()].eq_ignore_ascii_case(other);
        match &part.steps[..] {
            [PartStep::Component(trans)] if is(trans, b"trans") => Some(Coordinates::All),
            [PartStep::Component(trans), PartStep::Component(axis)] if is(trans, b"trans") => {
                [&b"x"[..], b"y", b"z"].iter().position(|name| is(axis, name)).map(Coordinates::One)
            }
            _ => None,
        }
    }

    /// An expression that is the sum of these coordinates of a robtarget, whose name comes first, and of known numbers.
    fn sum(&mut self, scope: Scope, of: &'a Expression, coordinates: Coordinates) -> Option<Moved> {
        match &of.kind {
            ExpressionKind::Bracketed(inner) => self.sum(scope, inner, coordinates),
            ExpressionKind::Part(part) if self.coordinates(scope, part) == Some(coordinates) => {
                let name = part.of.span.range();
                let at = self.find(scope, &Upper::new(&self.bytes(scope.source as usize)[name]))?;
                match self.content(at) {
                    Value::Target(from) if part.of.is_name() => Some(Moved { from, by_mm: coordinates.zero() }),
                    _ => None,
                }
            }
            ExpressionKind::Chain(chain) => {
                let mut moved = self.sum(scope, &chain.first, coordinates)?;
                for Operation { operator, right } in &chain.operations {
                    let sign = match operator {
                        Binary::Add => 1.0,
                        Binary::Subtract => -1.0,
                        _ => return None,
                    };
                    let value = self.evaluate(scope, right);
                    self.numbers.pin_value(&value);
                    for (sum, by) in moved.by_mm.iter_mut().zip(coordinates.numbers(&value)?) {
                        *sum = sum.zip(by).map(|(sum, by)| sum + sign * by);
                    }
                }
                Some(moved)
            }
            _ => None,
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
        let value =
            if place.known { value.detached(Reason::NumbersOfProgram) } else { Value::Unknown(Reason::Computed) };
        if place.path.is_empty() {
            return self.set(place.of, value);
        }
        let old = self.held(place.of);
        self.budget.spend(old.parts().unwrap_or(0) / PARTS_PER_STEP);
        self.numbers.pin_value(&old);
        let new = replaced(&old.detached(Reason::NumbersOfProgram), &place.path, &value);
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
