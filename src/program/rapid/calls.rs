//! Calls of procedures: who calls whom, and what parameters stand for while a routine runs.

use super::eval::Scope;
use super::motion::Call;
use super::run::{Flow, Frame, Runner};
use super::symbols::{Names, RoutineId, Upper, declared, first_word};
use super::tree::{Param, Statement, simple_statements};
use super::value::Value;
use crate::text::Span;
use std::collections::HashSet;

/// Calls deeper than this are not followed: a procedure that calls itself has no end when reading.
const MAX_CALLS: usize = 48;
/// What an optional parameter holds that the call does not give.
pub(super) const ABSENT: &str = "optional argument that is not given";
/// What a parameter holds of a procedure that nothing in the files calls.
pub(super) const NOT_KNOWN: &str = "argument is not known";

/// What a parameter stands for.
#[derive(Clone, Debug)]
enum Bound {
    Variable(usize),
    Value(Value),
}

impl<'a> Runner<'a> {
    /// Routines that a block calls by name.
    fn calls(&self, id: RoutineId, block: &[Statement]) -> impl Iterator<Item = RoutineId> {
        let (bytes, module) = (self.bytes(id.file), self.symbols.module_of(id));
        simple_statements(block).into_iter().filter_map(move |span| {
            let word = first_word(bytes, span);
            let name = if word.is_empty() { late_name(&bytes[span.range()])? } else { &bytes[word.range()] };
            self.symbols.find_routine(module, name)
        })
    }

    /// Routines that a block calls, directly or through others.
    pub(super) fn reached(&self, id: RoutineId, block: &[Statement]) -> Vec<RoutineId> {
        let mut seen = HashSet::new();
        let mut reached: Vec<RoutineId> = self.calls(id, block).filter(|callee| seen.insert(*callee)).collect();
        let mut at = 0;
        while let Some(&callee) = reached.get(at) {
            let calls = self.calls(callee, &self.symbols.routine(callee).body);
            reached.extend(calls.filter(|callee| seen.insert(*callee)));
            at += 1;
        }
        reached
    }

    /// Those of `procs` that no other calls.
    pub(super) fn uncalled(&self, procs: &[RoutineId]) -> Vec<RoutineId> {
        let calls = |id: &RoutineId| {
            let caller = *id;
            self.calls(caller, &self.symbols.routine(caller).body).filter(move |callee| *callee != caller)
        };
        let called: HashSet<RoutineId> = procs.iter().flat_map(calls).collect();
        let entries: Vec<RoutineId> = procs.iter().filter(|id| !called.contains(*id)).copied().collect();
        // Where each calls another in a ring: the first.
        if entries.is_empty() { procs.iter().copied().take(1).collect() } else { entries }
    }

    /// A call of a procedure that is in the files.
    pub(super) fn enter(&mut self, scope: Scope, id: RoutineId, call: &Call, span: Span) -> Flow {
        if self.frames.len() >= MAX_CALLS {
            self.keep_here(span, "calls are nested too deeply");
            return Flow::Next;
        }
        // Under a condition that is not known, a procedure that calls itself has no end.
        if self.unsure > 0 && self.frames.iter().any(|f| f.routine == id) {
            self.keep_here(span, "procedure that calls itself");
            return Flow::Next;
        }
        let routine = self.symbols.routine(id);
        let callee = self.bytes(id.file);
        let mut bound = Vec::new();
        let before = self.symbols.variables.len();
        let required = routine.params.iter().enumerate().filter(|(_, p)| !p.optional);
        for ((at, _), argument) in required.zip(call.positional()) {
            bound.push((at, self.bind(scope, *argument)));
        }
        for (name, value) in call.optional() {
            let name = &self.bytes(scope.source as usize)[name.range()];
            let is = |p: &Param| callee[p.name.range()].eq_ignore_ascii_case(name);
            if let Some(at) = routine.params.iter().position(is) {
                let value = if value.is_empty() { Bound::Value(Value::Bool(true)) } else { self.bind(scope, *value) };
                bound.push((at, value));
            }
        }
        let flow = self.call(id, &bound);
        self.symbols.variables.truncate(before);
        flow
    }

    /// A call of a procedure by a name that is worked out.
    pub(super) fn enter_late(&mut self, scope: Scope, call: &Call, span: Span) -> Flow {
        let Value::Text(name) = self.evaluate(scope, call.name) else {
            self.keep_here(span, "procedure chosen at run time");
            return Flow::Next;
        };
        let name = name.rsplit(|b| *b == b':').next().unwrap_or_default();
        match self.symbols.find_routine(scope.module, name) {
            Some(id) => self.enter(scope, id, call, span),
            None => {
                self.keep_here(span, "procedure is not in the files given");
                Flow::Next
            }
        }
    }

    /// A routine that nothing in the files calls.
    pub(super) fn start(&mut self, id: RoutineId) -> Flow {
        self.call(id, &[])
    }

    fn call(&mut self, id: RoutineId, arguments: &[(usize, Bound)]) -> Flow {
        self.entered.insert(id);
        let names = self.own_names(id, arguments);
        let kept = self.symbols.variables.len();
        self.frames.push(Frame { routine: id, module: self.symbols.module_of(id), names });
        self.epoch += 1;
        let flow = self.block(&self.symbols.routine(id).body);
        self.frames.pop();
        self.epoch += 1;
        // Variables of routines called from here are gone; those bound above stay until the caller ends.
        self.symbols.variables.truncate(kept);
        if flow == Flow::Stop { Flow::Stop } else { Flow::Next }
    }

    /// A routine's parameters, with what they stand for, and its own data.
    fn own_names(&mut self, id: RoutineId, arguments: &[(usize, Bound)]) -> Names {
        let routine = self.symbols.routine(id);
        let bytes = self.bytes(id.file);
        let module = self.symbols.module_of(id);
        let mut names = Names::new();
        for (p, param) in routine.params.iter().enumerate() {
            let bound = arguments.iter().find(|(at, _)| *at == p).map(|(_, b)| b.clone());
            let at = match bound {
                Some(Bound::Variable(at)) if param.by_reference || !self.assigned_in(id, param.name) => at,
                bound => {
                    let value = match bound {
                        Some(Bound::Value(value)) => value,
                        Some(Bound::Variable(at)) => self.content(at),
                        None if param.optional && !self.frames.is_empty() => Value::Unknown(ABSENT),
                        None => Value::Unknown(NOT_KNOWN),
                    };
                    self.new_variable(bytes, id.file, module, param.kind, param.name, value)
                }
            };
            names.insert(Box::from(&*Upper::new(&bytes[param.name.range()])), at);
        }
        let assigned = self.symbols.changed_by(id);
        for data in &routine.data {
            let mut variable = declared(bytes, id.file, module, data);
            let key = Upper::new(&bytes[data.name.range()]);
            variable.assigned = assigned.iter().any(|n| **n == *key);
            names.insert(Box::from(&*key), self.symbols.variables.len());
            self.symbols.variables.push(variable);
        }
        names
    }

    fn bind(&mut self, scope: Scope, argument: Span) -> Bound {
        let bytes = self.bytes(scope.source as usize);
        let word = first_word(bytes, argument);
        if word == argument
            && let Some(at) = self.find(scope, &Upper::new(&bytes[word.range()]))
        {
            return Bound::Variable(at);
        }
        let value = match self.evaluate(scope, argument) {
            Value::Num(v, _) => Value::Num(v, None),
            other => other,
        };
        if word == argument {
            // A name that the files do not declare, or a predefined one: it goes along with its value.
            let none = Span { start: word.start, end: word.start };
            return Bound::Variable(self.new_variable(bytes, scope.source as usize, scope.module, none, word, value));
        }
        Bound::Value(value)
    }

    fn assigned_in(&self, id: RoutineId, name: Span) -> bool {
        let key = Upper::new(&self.bytes(id.file)[name.range()]);
        self.symbols.changed_by(id).iter().any(|n| **n == *key)
    }
}

/// The name in `%"name"%` or `%"module:name"%`.
fn late_name(statement: &[u8]) -> Option<&[u8]> {
    let inner = statement.strip_prefix(b"%")?;
    let from = inner.iter().position(|b| *b == b'"')? + 1;
    let to = from + inner[from..].iter().position(|b| *b == b'"')?;
    inner[from..to].rsplit(|b| *b == b':').next()
}
