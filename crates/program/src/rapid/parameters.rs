//! The parameters of a routine: copies of values, and references to the caller's data.

use super::eval::Scope;
use super::expression::{Arguments, Expression, ExpressionKind};
use super::known::RoutineId;
use super::runner::Runner;
use super::symbols::{Content, Names, Upper, VariablePart, declared};
use super::tree::{Param, Routine};
use super::value::Value;
use crate::Reason;
use deflex_text::Span;
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

/// The arguments of a call, sorted by what they are given to.
pub(super) struct GivenArguments<'e> {
    /// Those of required parameters first, then those of optional ones in the order of the call.
    pub(super) to_parameters: Vec<ParameterArgument<'e>>,
    /// Arguments that the routine has no parameter for: those of one that is declared by its name alone (`[controller] harmless`), which may
    /// read and change them.
    pub(super) others: Vec<&'e Expression>,
}

/// The argument of a parameter.
pub(super) struct ParameterArgument<'e> {
    /// The index of the parameter.
    pub(super) parameter: usize,
    /// `None` for an optional argument without a value.
    pub(super) value: Option<&'e Expression>,
}

impl Arguments {
    /// Pairs the arguments of a call with the parameters of a routine; `bytes` is the text around the call, and `theirs` that around the
    /// routine.
    pub(super) fn given_to<'e>(&'e self, routine: &Routine, bytes: &[u8], theirs: &[u8]) -> GivenArguments<'e> {
        let mut required = routine.params.iter().enumerate().filter(|(_, param)| !param.optional);
        let (mut to_parameters, mut others) = (Vec::new(), Vec::new());
        for argument in &self.positional {
            match required.next() {
                Some((parameter, _)) => to_parameters.push(ParameterArgument { parameter, value: Some(argument) }),
                None => others.push(argument),
            }
        }
        for argument in &self.optional {
            let name = &bytes[argument.name.range()];
            let value = argument.value.as_ref();
            match routine.params.iter().position(|param| theirs[param.name.range()].eq_ignore_ascii_case(name)) {
                Some(parameter) => to_parameters.push(ParameterArgument { parameter, value }),
                None => others.extend(value),
            }
        }
        GivenArguments { to_parameters, others }
    }
}

impl<'a> Runner<'a> {
    /// The bindings that a call gives to the parameters of a routine, by their number.
    pub(super) fn arguments(&mut self, scope: Scope, id: RoutineId, given: &'a Arguments) -> Vec<(usize, Bound)> {
        let routine = self.symbols.routine(id);
        let given = given.given_to(routine, self.bytes(scope.source as usize), self.bytes(id.file));
        let mut bound = Vec::new();
        for ParameterArgument { parameter, value } in given.to_parameters {
            let binding = match value {
                Some(value) => self.bind(scope, &routine.params[parameter], value),
                None => Bound::Value(Value::Bool(true), Span::default(), true),
            };
            bound.push((parameter, binding));
        }
        for argument in given.others {
            let value = self.evaluate(scope, argument);
            self.numbers.pin_value(&value);
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
                        self.symbols.variables[at].name = deflex_text::decode(text).as_ref().into();
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
            // The handlers may use it too.
            if !routine.handlers.is_empty()
                && let Value::Target(pose) = self.content(at)
            {
                self.numbers.given.entry((id, Box::from(&*key))).or_default().extend(pose.numbers());
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
            self.numbers.begins(self.symbols.variables.len());
            self.symbols.variables.push(variable);
        }
        names
    }

    fn bind(&mut self, scope: Scope, param: &Param, argument: &'a Expression) -> Bound {
        let key = Upper::new(&self.bytes(scope.source as usize)[argument.span.range()]);
        let named = argument.is_name().then(|| self.find(scope, &key));
        if param.by_reference {
            if let Some(Some(at)) = named {
                return Bound::Variable(at);
            }
            if matches!(argument.kind, ExpressionKind::Part(_))
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
                self.uses_frame(at);
                // A value passed through several routines keeps the name of its declaration.
                Bound::Variable(self.copied(value, at, scope, argument.span))
            }
            Some(None) => {
                // An undeclared or predefined name is passed along with its value.
                let declared = super::value::predefined(&key).is_some();
                Bound::Value(value, argument.span, declared)
            }
            None => Bound::Value(value, argument.span, true),
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
