//! The parameters of a routine: copies of values, and references to the caller's data.

use super::eval::Scope;
use super::known::RoutineId;
use super::motion::Call;
use super::runner::Runner;
use super::symbols::{Content, Names, Upper, VariablePart, declared, first_word};
use super::tree::{Param, Routine};
use super::value::Value;
use crate::program::Reason;
use crate::text::Span;
use std::collections::HashSet;
use std::rc::Rc;
use std::sync::Arc;

/// What a parameter stands for.
#[derive(Clone, Debug)]
pub(super) enum Bound {
    /// The caller's variable, by reference.
    Variable(usize),
    /// A part of the caller's variable, by reference.
    Part(Rc<VariablePart>),
    /// A copy, with the name under which it was declared, and whether the files declare that name.
    Value(Value, Span, bool),
}

/// Arguments that a routine has no parameter for: those of one that is declared by its name alone (`[controller] harmless`), which may
/// read and change them.
pub(super) fn undeclared(routine: &Routine, theirs: &[u8], bytes: &[u8], call: &Call) -> Vec<Span> {
    let required = routine.params.iter().filter(|param| !param.optional).count();
    let is_known =
        |name: &[u8]| routine.params.iter().any(|param| theirs[param.name.range()].eq_ignore_ascii_case(name));
    let named = call.optional().iter().filter(|(name, value)| !value.is_empty() && !is_known(&bytes[name.range()]));
    call.positional().iter().skip(required).chain(named.map(|(_, value)| value)).copied().collect()
}

impl<'a> Runner<'a> {
    /// The bindings that a call gives to the parameters of a routine, by their number.
    pub(super) fn arguments(&mut self, scope: Scope, id: RoutineId, call: &Call) -> Vec<(usize, Bound)> {
        let routine = self.symbols.routine(id);
        let callee = self.bytes(id.file);
        let mut bound = Vec::new();
        let required = routine.params.iter().enumerate().filter(|(_, p)| !p.optional);
        for ((at, param), argument) in required.zip(call.positional()) {
            bound.push((at, self.bind(scope, param, *argument)));
        }
        for (name, value) in call.optional() {
            let name = &self.bytes(scope.source as usize)[name.range()];
            let is = |p: &Param| callee[p.name.range()].eq_ignore_ascii_case(name);
            if let Some(at) = routine.params.iter().position(is) {
                let given = if value.is_empty() {
                    Bound::Value(Value::Bool(true), *value, true)
                } else {
                    self.bind(scope, &routine.params[at], *value)
                };
                bound.push((at, given));
            }
        }
        for argument in undeclared(routine, callee, self.bytes(scope.source as usize), call) {
            let value = self.evaluate(scope, argument);
            self.pin_value(&value);
            self.forget_argument(scope, argument, Reason::Computed);
        }
        bound
    }

    /// The names of a routine: its parameters with their bindings, and its own data.
    pub(super) fn own_names(&mut self, id: RoutineId, arguments: &[(usize, Bound)]) -> Names {
        let routine = self.symbols.routine(id);
        let bytes = self.bytes(id.file);
        let module = self.symbols.module_of(id);
        let mut names = Names::new();
        let volatile = self.symbols.volatile_own.get(&id).cloned().unwrap_or_default();
        for (p, param) in routine.params.iter().enumerate() {
            let bound = arguments.iter().find(|(at, _)| *at == p).map(|(_, b)| b.clone());
            let key = Upper::new(&bytes[param.name.range()]);
            let new = |this: &mut Self, value: Value| {
                this.new_variable(bytes, id.file, module, param.kind, param.name, value)
            };
            let at = match bound {
                Some(Bound::Variable(at)) => at,
                Some(Bound::Part(part)) => {
                    let at = new(self, Value::Unknown(Reason::Computed));
                    self.symbols.variables[at].content = Content::Part(part);
                    at
                }
                Some(Bound::Value(value, name, declared)) => {
                    let at = new(self, value);
                    let caller = self.scope().source;
                    if !name.is_empty() {
                        let text = &self.bytes(caller as usize)[name.range()];
                        self.symbols.variables[at].name = crate::text::decode(text).as_ref().into();
                    }
                    self.symbols.variables[at].foreign = !declared;
                    at
                }
                None if param.optional && !self.frames.is_empty() => {
                    new(self, Value::Unknown(Reason::OptionalArgumentMissing))
                }
                None => new(self, Value::Unknown(Reason::ArgumentUnknown)),
            };
            if volatile.contains(&Box::from(&*key)) {
                let of = match &self.symbols.variables[at].content {
                    Content::Part(part) => part.of,
                    _ => at,
                };
                self.forget_data(of, Reason::Trap);
                self.symbols.variables[of].volatile = Some(Reason::Trap);
            }
            if routine.error.is_some()
                && let Value::Target(pose) = self.content(at)
                && let Some(root) = pose.root
            {
                let given = self.given.entry((id, Box::from(&*key))).or_default();
                if given.last() != Some(&root) && !given.contains(&root) {
                    given.push(root);
                }
            }
            names.insert(Box::from(&*key), at);
        }
        if routine.data.is_empty() {
            return names;
        }
        let assigned = &self.symbols.changed_by(id).own;
        let assigned: HashSet<Box<[u8]>> = assigned.iter().cloned().collect();
        for data in &routine.data {
            let mut variable = declared(bytes, id.file, module, data);
            let key = Upper::new(&bytes[data.name.range()]);
            variable.assigned = assigned.contains(&*key);
            if volatile.contains(&Box::from(&*key)) {
                variable.volatile = Some(Reason::Trap);
            }
            names.insert(Box::from(&*key), self.symbols.variables.len());
            self.symbols.variables.push(variable);
        }
        names
    }

    pub(super) fn bind(&mut self, scope: Scope, param: &Param, argument: Span) -> Bound {
        let bytes = self.bytes(scope.source as usize);
        let word = first_word(bytes, argument);
        let named = (word == argument).then(|| self.find(scope, &Upper::new(&bytes[word.range()])));
        if param.by_reference {
            if let Some(Some(at)) = named {
                return Bound::Variable(at);
            }
            if word != argument
                && !word.is_empty()
                && let Some(part) = self.place(scope, argument)
            {
                return Bound::Part(Rc::new(part));
            }
        }
        let value = match self.evaluate(scope, argument) {
            Value::Num(v, _) => Value::Num(v, None),
            other => other,
        };
        match named {
            Some(Some(at)) => {
                // A value passed through several routines keeps the name of its declaration.
                Bound::Variable(self.copied(value, at, scope, argument))
            }
            Some(None) => {
                // An undeclared or predefined name is passed along with its value.
                let declared = super::value::predefined(&Upper::new(&bytes[word.range()])).is_some();
                Bound::Value(value, word, declared)
            }
            None => Bound::Value(value, argument, true),
        }
    }

    /// A new variable with the value of another.
    pub(super) fn copied(&mut self, value: Value, of: usize, scope: Scope, at: Span) -> usize {
        let variable = &self.symbols.variables[of];
        let (name, kind, foreign) = (Arc::clone(&variable.name), Arc::clone(&variable.kind), variable.foreign);
        let bytes = self.bytes(scope.source as usize);
        let none = Span { start: at.start, end: at.start };
        let copy = self.new_variable(bytes, scope.source as usize, scope.module, none, none, value);
        self.symbols.variables[copy].name = name;
        self.symbols.variables[copy].kind = kind;
        self.symbols.variables[copy].foreign = foreign;
        copy
    }
}
