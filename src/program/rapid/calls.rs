//! Calls of procedures: what parameters stand for while a routine runs, and what it leaves, at its end or by an error.

use super::eval::{RUN_TIME, Scope};
use super::memory::Left;
use super::motion::{self, Call};
use super::run::{Flow, Frame, Mode, Runner};
use super::state::Switches;
use super::symbols::{Content, Names, Part, RoutineId, Upper, declared, first_word};
use super::tree::{Param, Statement, any, simple_statements};
use super::value::Value;
use crate::text::{Diagnostic, Severity, Span};
use std::collections::{BTreeMap, HashSet};
use std::rc::Rc;
use std::sync::Arc;

/// Calls deeper than this are not followed: a procedure that calls itself has no end when reading.
const MAX_CALLS: usize = 48;
/// What an optional parameter holds that the call does not give.
pub(super) const ABSENT: &str = "optional argument that is not given";
/// What a parameter holds of a procedure that nothing in the files calls.
pub(super) const NOT_KNOWN: &str = "argument is not known";
/// Why data are not known behind a procedure that is not in the files.
const UNDECLARED: &str = "may be changed by a procedure that is not in the files";
const CALLS_ITSELF: &str = "may be changed by a procedure that calls itself";
const JUMPS: &str = "changed in a routine with GOTO";
const HANDLED: &str = "may be changed by an error handler";
const FAILED: &str = "may be changed by a procedure that is run again after an error";
/// More returns of one routine are taken together.
const MOST_RETURNS: usize = 8;

/// What a parameter stands for.
#[derive(Clone, Debug)]
enum Bound {
    /// The caller's own, by reference.
    Variable(usize),
    /// A part of the caller's, by reference.
    Part(Rc<Part>),
    /// A copy, under the name that it was declared with, and whether the files declare that.
    Value(Value, Span, bool),
}

/// What an ERROR handler may do with an error.
#[derive(Clone, Copy)]
struct Handler {
    /// TRYNEXT: goes on behind what failed.
    goes_on: bool,
    /// RETRY: runs again what failed.
    again: bool,
    /// RAISE: hands it on to the caller.
    hands_on: bool,
}

/// What was known before a routine with labels was entered.
struct Loosened {
    /// Data and why each was not known.
    data: Vec<(usize, Option<&'static str>)>,
    jumping: Switches,
}

impl<'a> Runner<'a> {
    /// Routines that a block calls by name.
    pub(super) fn calls(&self, id: RoutineId, block: &[Statement]) -> impl Iterator<Item = RoutineId> {
        let (bytes, module) = (self.bytes(id.file), self.symbols.module_of(id));
        simple_statements(block).into_iter().filter_map(move |span| {
            let word = first_word(bytes, span);
            let name = if word.is_empty() { late_name(&bytes[span.range()])? } else { &bytes[word.range()] };
            self.symbols.find_routine(module, name)
        })
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
        self.events += 1;
        // Under a condition that is not known, a procedure that calls itself has no end.
        let ring = self.layers.len() > self.frames.len() && self.frames.iter().any(|f| f.routine == id);
        if self.frames.len() >= MAX_CALLS || ring {
            let reason = if ring { "procedure that calls itself" } else { "calls are nested too deeply" };
            self.keep_here(span, reason);
            self.endless.insert(id);
            self.not_followed(scope, id, call);
            return Flow::Next;
        }
        let before = self.symbols.variables.len();
        let bound = self.arguments(scope, id, call);
        let flow = match self.call(id, &bound) {
            None => Flow::Next,
            Some((normal, raised)) => {
                if raised.is_some() && self.handler().is_some_and(|handler| handler.goes_on || handler.again) {
                    self.stands = None;
                }
                self.behind(id, &bound, normal, raised)
            }
        };
        self.symbols.variables.truncate(before);
        self.epoch += 1;
        flow
    }

    /// What a call hands to the parameters of a routine, by their number.
    fn arguments(&mut self, scope: Scope, id: RoutineId, call: &Call) -> Vec<(usize, Bound)> {
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
        bound
    }

    /// Goes on behind a call that may have ended in several ways.
    fn behind(&mut self, id: RoutineId, bound: &[(usize, Bound)], normal: Option<Left>, raised: Option<Left>) -> Flow {
        let mut ways = normal;
        if let Some(raised) = raised {
            if self.handler().is_some_and(|handler| handler.again) {
                self.open();
                let mut again = raised.clone();
                again.state = again.state.join(self.state);
                again.changed.values_mut().for_each(|value| *value = Value::Unknown(FAILED));
                self.apply(again);
                self.run_handler();
                if let Some((Some(normal), _)) = self.quietly(Mode::Aside, |this| this.call(id, bound)) {
                    self.apply(normal);
                }
                let left = self.take();
                ways = ways.map(|ways| self.join(ways, left));
            }
            self.open();
            self.apply(raised);
            let flow = self.raise();
            let left = self.take();
            if flow == Flow::Next {
                ways = Some(match ways {
                    Some(ways) => self.join(ways, left),
                    None => left,
                });
            }
        }
        match ways {
            Some(left) => {
                self.apply(left);
                Flow::Next
            }
            None => Flow::Gone,
        }
    }

    /// A call of a procedure by a name that is worked out.
    pub(super) fn enter_late(&mut self, scope: Scope, call: &Call, span: Span) -> Flow {
        let Value::Text(name) = self.evaluate(scope, call.name) else {
            self.keep_here(span, "procedure chosen at run time");
            self.any_called = true;
            self.unknown_call(scope, call);
            self.tell(
                span,
                "rapid.late-binding",
                "which procedure is called here is known only at run time: what it could change is not known behind it",
                Severity::Warning,
            );
            return Flow::Next;
        };
        let name = name.rsplit(|b| *b == b':').next().unwrap_or_default();
        match self.symbols.find_routine(scope.module, name) {
            Some(id) => self.enter(scope, id, call, span),
            None => {
                self.keep_here(span, "procedure is not in the files given");
                self.unknown_procedure(scope, call, span);
                Flow::Next
            }
        }
    }

    /// A procedure, or a predefined instruction, of which nothing is known.
    pub(super) fn unknown_procedure(&mut self, scope: Scope, call: &Call, span: Span) {
        let bytes = self.bytes(scope.source as usize);
        let mut targets = false;
        for argument in call.positional() {
            let value = self.evaluate(scope, *argument);
            let name = Upper::new(&bytes[first_word(bytes, *argument).range()]);
            let declared = self.find(scope, &name).map(|at| &self.symbols.variables[at].kind);
            targets |= declared.is_some_and(|kind| **kind == *b"ROBTARGET") || self.as_target(&value).is_some();
            self.pin_value(&value);
        }
        if targets {
            if self.mode == Mode::Real {
                self.motions += 1;
            }
            self.keep_motion(span, "robtarget given to a procedure that is not known");
        }
        self.unknown_call(scope, call);
        self.tell_undeclared(scope, &bytes[call.name.range()], span);
    }

    /// A function that is neither predefined nor in the files.
    pub(super) fn unknown_function(&mut self, scope: Scope, call: &Call) {
        self.unknown_call(scope, call);
        let bytes = self.bytes(scope.source as usize);
        self.tell_undeclared(scope, &bytes[call.name.range()], call.name);
    }

    fn tell_undeclared(&mut self, scope: Scope, name: &[u8], span: Span) {
        let name = String::from_utf8_lossy(name).into_owned();
        let message = format!(
            "`{name}` is not in the files given: what it could change (frames, tools, displacement, what it is handed) is \
             not known behind it"
        );
        let source = scope.source;
        if self.mode == Mode::Real && self.seen.insert((usize::from(source), span, "rapid.undeclared")) {
            let named = |d: &Diagnostic| d.code == "rapid.undeclared" && d.message == message;
            if !self.diagnostics.iter().any(named) {
                let told = Diagnostic::error("rapid.undeclared", "", message)
                    .at(&self.symbols.sources[usize::from(source)], span);
                self.diagnostics.push(
                    told.severity(Severity::Warning)
                        .help("give the module that declares it with --context, or as an input"),
                );
            }
        }
    }

    /// Takes whatever an unknown routine could change for unknown.
    pub(super) fn unknown_call(&mut self, scope: Scope, call: &Call) {
        self.events += 1;
        self.stands = None;
        let everything = self.symbols.everything();
        for &at in everything.iter() {
            self.forget_data(at, UNDECLARED);
        }
        let given: Vec<Span> = call.given().collect();
        for argument in given {
            let value = self.evaluate(scope, argument);
            self.pin_value(&value);
            self.forget_argument(scope, argument, UNDECLARED);
        }
        self.state.lose(Switches::FOREIGN);
    }

    /// What a routine changes that is not followed.
    pub(super) fn not_followed(&mut self, scope: Scope, id: RoutineId, call: &Call) {
        self.events += 1;
        let changes = self.symbols.changed_by(id).clone();
        let own = changes.own.clone();
        let here = super::changes::Changes { own: Default::default(), ..changes };
        self.forget(&here, CALLS_ITSELF);
        self.state.lose(here.switches);
        self.may_have_moved(id, &self.symbols.routine(id).body);
        let routine = self.symbols.routine(id);
        let (bytes, theirs) = (self.bytes(scope.source as usize), self.bytes(id.file));
        let changed = |param: &Param| param.by_reference && own.contains(&*Upper::new(&theirs[param.name.range()]));
        let required = routine.params.iter().filter(|p| !p.optional).zip(call.positional());
        let named = call.optional().iter().filter_map(|(name, value)| {
            let name = &bytes[name.range()];
            Some((routine.params.iter().find(|p| theirs[p.name.range()].eq_ignore_ascii_case(name))?, value))
        });
        let given: Vec<Span> = required.chain(named).filter(|(p, _)| changed(p)).map(|(_, a)| *a).collect();
        for argument in call.given().collect::<Vec<_>>() {
            let value = self.evaluate(scope, argument);
            self.pin_value(&value);
        }
        for argument in given {
            self.forget_argument(scope, argument, RUN_TIME);
        }
    }

    /// Takes an argument by reference for unknown.
    pub(super) fn forget_argument(&mut self, scope: Scope, argument: Span, why: &'static str) {
        if let Some(part) = self.place(scope, argument) {
            self.store(&part, &Value::Unknown(why));
        }
    }

    /// A routine that nothing in the files calls.
    pub(super) fn start(&mut self, id: RoutineId) -> Flow {
        self.stands = Some(0);
        match self.call(id, &[]) {
            None => Flow::Next,
            Some((Some(left), _)) => {
                self.apply(left);
                Flow::Next
            }
            Some((None, _)) => Flow::Gone,
        }
    }

    /// Runs a routine; what it leaves at its end and by an error, or nothing where it left it at its end alone.
    fn call(&mut self, id: RoutineId, arguments: &[(usize, Bound)]) -> Option<(Option<Left>, Option<Left>)> {
        match self.mode {
            Mode::Real => drop(self.entered.insert(id)),
            Mode::Aside => drop(self.entered_aside.insert(id)),
            Mode::Dry => {}
        }
        let kept = self.symbols.variables.len();
        let layer = self.layers.len();
        self.open();
        let names = self.own_names(id, arguments);
        let routine = self.symbols.routine(id);
        let jumps = any(&routine.body, &|statement| matches!(statement, Statement::Goto(_)));
        let (module, noted) = (self.symbols.module_of(id), None);
        let (returns, raises) = (Vec::new(), Vec::new());
        if jumps || self.frames.last().is_some_and(|caller| caller.jumps) {
            self.stands = None;
        }
        let returns_from = None;
        self.frames.push(Frame { routine: id, module, names, layer, returns, raises, jumps, noted, returns_from });
        self.epoch += 1;
        self.guards += usize::from(routine.error.is_some());
        let loosened = jumps.then(|| self.loosen(id));
        let flow = self.block(&routine.body);
        loosened.into_iter().for_each(|loosened| self.tighten(loosened));
        self.guards -= usize::from(routine.error.is_some());
        let frame = self.frames.pop();
        if let Some(returned) = frame.as_ref().and_then(|frame| frame.returns_from)
            && (flow != Flow::Next || returned != self.stands)
        {
            self.stands = if flow == Flow::Next { None } else { returned };
        }
        if jumps {
            self.stands = None;
        }
        self.epoch += 1;
        let (returns, raises) = frame.map_or((Vec::new(), Vec::new()), |frame| (frame.returns, frame.raises));
        if flow == Flow::Next && returns.is_empty() && raises.is_empty() {
            self.symbols.variables.truncate(kept);
            self.commit();
            return None;
        }
        self.symbols.variables.truncate(kept);
        let end = self.take();
        let ends = returns.into_iter().chain((flow == Flow::Next).then_some(end));
        let normal = ends.reduce(|a, b| self.join(a, b));
        let raised = raises.into_iter().reduce(|a, b| self.join(a, b));
        Some((normal, raised))
    }

    /// A routine with labels may run any of its statements after any other: what it changes is not known in all of it.
    fn loosen(&mut self, id: RoutineId) -> Loosened {
        let changes = self.symbols.changed_by(id).clone();
        let mut all: Vec<usize> = changes.data.iter().copied().collect();
        if changes.anything {
            all.extend(self.symbols.everything().iter());
        }
        let own = changes.own.iter().filter_map(|name| self.frames.last()?.names.get(name).copied());
        all.extend(own.map(|at| match &self.symbols.variables[at].content {
            Content::Part(part) => part.of,
            _ => at,
        }));
        let mut before = Vec::new();
        for at in all {
            self.forget_data(at, JUMPS);
            before.push((at, self.symbols.variables[at].volatile));
            self.symbols.variables[at].volatile.get_or_insert(JUMPS);
        }
        let loosened = Loosened { data: before, jumping: self.jumping };
        self.jumping |= changes.switches;
        self.state.lose(changes.switches);
        loosened
    }

    fn tighten(&mut self, loosened: Loosened) {
        self.jumping = loosened.jumping;
        for (at, why) in loosened.data {
            self.symbols.variables[at].volatile = why;
        }
    }

    /// The routine returns here.
    pub(super) fn leave(&mut self) {
        let Some(layer) = self.frames.last().map(|frame| frame.layer) else { return };
        let left = self.since(layer);
        self.note_return(left);
    }

    /// The running routine may return here, leaving this.
    fn note_return(&mut self, left: Left) {
        let stands = self.stands;
        if let Some(frame) = self.frames.last_mut() {
            note(&mut frame.returns, left);
            frame.returns_from = Some(frame.returns_from.map_or(stands, |known| known.filter(|_| known == stands)));
        }
    }

    /// What the ERROR handler of the running routine may do.
    fn handler(&self) -> Option<Handler> {
        let routine = self.symbols.routine(self.frames.last()?.routine);
        routine.error.is_some().then(|| Handler {
            goes_on: any(routine.on_error(), &|s| matches!(s, Statement::TryNext)),
            again: any(routine.on_error(), &|s| matches!(s, Statement::Retry)),
            hands_on: any(routine.on_error(), &|s| matches!(s, Statement::Raise)),
        })
    }

    /// An error, here: to the routine's own handler, or to whoever called it.
    pub(super) fn raise(&mut self) -> Flow {
        self.events += 1;
        let Some(layer) = self.frames.last().map(|frame| frame.layer) else { return Flow::Gone };
        let handler = self.handler();
        self.open();
        self.run_handler();
        let left = self.since(layer);
        self.take();
        if let Some(frame) = self.frames.last_mut()
            && handler.is_none_or(|handler| handler.hands_on)
        {
            note(&mut frame.raises, left.clone());
        }
        // A handler that comes to its end returns.
        if handler.is_some() {
            self.note_return(left);
        }
        if handler.is_some_and(|handler| handler.goes_on) {
            self.run_handler();
            return Flow::Next;
        }
        Flow::Gone
    }

    /// What the ERROR handler of the running routine may change is not known behind it.
    pub(super) fn run_handler(&mut self) {
        let Some(id) = self.frames.last().map(|frame| frame.routine) else { return };
        let routine = self.symbols.routine(id);
        if routine.on_error().is_empty() {
            return;
        }
        let changes = self.symbols.changed_in(id, routine.on_error());
        self.forget(&changes, HANDLED);
        self.state.lose(changes.switches);
        self.may_have_moved(id, routine.on_error());
    }

    /// Before and behind a statement that may fail: what the handler changes that runs it again, or goes on behind it.
    pub(super) fn may_be_handled(&mut self, behind: bool) {
        if self.handler().is_some_and(|handler| handler.again || behind && handler.goes_on) {
            self.run_handler();
        }
    }

    /// Statements of a routine may have run: where they move the robot, or call a routine that may, it stands elsewhere.
    fn may_have_moved(&mut self, id: RoutineId, block: &[Statement]) {
        let (bytes, module) = (self.bytes(id.file), self.symbols.module_of(id));
        let moves = |span: Span| {
            let name = &bytes[first_word(bytes, span).range()];
            motion::shape(name).is_some() || self.symbols.find_routine(module, name).is_some()
        };
        if self.stands.is_some() && simple_statements(block).into_iter().any(moves) {
            self.stands = None;
        }
    }

    /// The statement that comes may fail, and a handler takes it from there: not noted twice where nothing changed.
    pub(super) fn may_fail(&mut self) {
        let Some(frame) = self.frames.last() else { return };
        let now = Some((self.epoch, self.state));
        if frame.noted == now {
            return;
        }
        self.open();
        let _ = self.raise();
        self.take();
        if let Some(frame) = self.frames.last_mut() {
            frame.noted = now;
        }
    }

    /// A routine's parameters, with what they stand for, and its own data.
    fn own_names(&mut self, id: RoutineId, arguments: &[(usize, Bound)]) -> Names {
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
                    let at = new(self, Value::Unknown(RUN_TIME));
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
                None if param.optional && !self.frames.is_empty() => new(self, Value::Unknown(ABSENT)),
                None => new(self, Value::Unknown(NOT_KNOWN)),
            };
            if volatile.contains(&Box::from(&*key)) {
                let of = match &self.symbols.variables[at].content {
                    Content::Part(part) => part.of,
                    _ => at,
                };
                self.forget_data(of, super::changes::CHANGED_AT_ANY_MOMENT);
                self.symbols.variables[of].volatile = Some(super::changes::CHANGED_AT_ANY_MOMENT);
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
                variable.volatile = Some(super::changes::CHANGED_AT_ANY_MOMENT);
            }
            names.insert(Box::from(&*key), self.symbols.variables.len());
            self.symbols.variables.push(variable);
        }
        names
    }

    fn bind(&mut self, scope: Scope, param: &Param, argument: Span) -> Bound {
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
                // Through several routines it keeps the name that it was declared with.
                Bound::Variable(self.copied(value, at, scope, argument))
            }
            Some(None) => {
                // A name that the files do not declare, or a predefined one: it goes along with its value.
                let declared = super::value::predefined(&Upper::new(&bytes[word.range()])).is_some();
                Bound::Value(value, word, declared)
            }
            None => Bound::Value(value, argument, true),
        }
    }

    /// A variable of its own with the value of another.
    fn copied(&mut self, value: Value, of: usize, scope: Scope, at: Span) -> usize {
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

/// Notes one more state; many become one, in which what they do not all have is unknown.
fn note(states: &mut Vec<Left>, left: Left) {
    states.push(left);
    if states.len() > MOST_RETURNS {
        let mut all = states.drain(..);
        let Some(first) = all.next() else { return };
        let mut changed: BTreeMap<usize, Value> = first.changed;
        let mut state = first.state;
        for other in all.by_ref() {
            state = state.join(other.state);
            for at in other.changed.keys() {
                changed.insert(*at, Value::Unknown(RUN_TIME));
            }
            changed.values_mut().for_each(|value| *value = Value::Unknown(RUN_TIME));
        }
        drop(all);
        states.push(Left { changed, state });
    }
}

/// The name in `%"name"%` or `%"module:name"%`.
fn late_name(statement: &[u8]) -> Option<&[u8]> {
    let inner = statement.strip_prefix(b"%")?;
    let from = inner.iter().position(|b| *b == b'"')? + 1;
    let to = from + inner[from..].iter().position(|b| *b == b'"')?;
    inner[from..to].rsplit(|b| *b == b':').next()
}
