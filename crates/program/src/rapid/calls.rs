//! Calls of procedures: the meaning of parameters while a routine runs, and the state after it, at its end or after an error.

use super::eval::Scope;
use super::expression::{Arguments, Call, Expression, ExpressionKind};
use super::known::RoutineId;
use super::layers::EndState;
use super::memory::note;
use super::parameters::Bound;
use super::runner::{Continuation, Frame, Mode, Runner};
use super::state::{OnOff, Switches};
use super::symbols::{Content, Upper};
use super::tree::{Param, Statement, statements};
use super::value::Value;
use crate::Reason;
use deflex_text::{Diagnostic, Severity, Span};
use std::collections::HashSet;
use std::sync::LazyLock;

/// Deepest calls that are followed: a procedure that calls itself has no end for the reader.
const MAX_CALLS: usize = 48;
/// The known values before a routine with labels was entered.
struct Loosened {
    /// Data, each with the reason why it was unknown.
    data: Vec<(usize, Option<Reason>)>,
    jumping: Switches,
}

impl<'a> Runner<'a> {
    /// Routines that a block calls by name.
    pub(super) fn calls(&self, id: RoutineId, block: &'a [Statement]) -> impl Iterator<Item = RoutineId> {
        let (bytes, module) = (self.bytes(id.file), self.symbols.module_of(id));
        statements(block).into_iter().filter_map(Statement::call).filter_map(move |call| {
            let name = match &call.late {
                Some(name) => name.routine_named(bytes)?,
                None => &bytes[call.name.range()],
            };
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
        // If they call one another in a ring: the first.
        if entries.is_empty() { procs.iter().copied().take(1).collect() } else { entries }
    }

    /// A call of a procedure that is in the files.
    pub(super) fn enter(&mut self, scope: Scope, id: RoutineId, given: &'a Arguments, span: Span) -> Continuation {
        self.counters.events += 1;
        // Under an unknown condition, a procedure that calls itself has no end; nor does one that was found to have none.
        let may_end = self.layers.len() <= self.frames.len() && !self.reached.endless.contains(&id);
        let ring = !may_end && self.frames.iter().any(|f| f.routine == id);
        if self.frames.len() >= MAX_CALLS || ring {
            let reason = if ring { Reason::RoutineCallsItself } else { Reason::CallsTooDeep };
            self.keep_here(span, reason);
            self.reached.endless.insert(id);
            self.not_followed(scope, id, given, Reason::ByRecursiveRoutine);
            return Continuation::Next;
        }
        let before = self.symbols.variables.len();
        let failures = self.errors.failures;
        let bound = self.arguments(scope, id, given);
        // After an argument that fails, TRYNEXT continues without the call.
        let skipped = self.skipped_since(failures).then(|| {
            self.open();
            self.take()
        });
        let flow = match self.call(id, &bound) {
            None => Continuation::Next,
            Some((normal, raised)) => {
                let is_skipped = skipped.is_some();
                let normal = match (normal, skipped) {
                    (Some(normal), Some(skipped)) => Some(self.join(normal, skipped)),
                    (normal, skipped) => normal.or(skipped),
                };
                if is_skipped
                    || raised.is_some() && self.handler().is_some_and(|handler| handler.goes_on || handler.again)
                {
                    self.position.stands = None;
                }
                self.after_call(id, &bound, normal, raised)
            }
        };
        self.symbols.variables.truncate(before);
        self.counters.epoch += 1;
        flow
    }

    /// Continues after a call that may have ended normally or with an error.
    fn after_call(
        &mut self,
        id: RoutineId,
        bound: &[(usize, Bound)],
        normal: Option<EndState>,
        raised: Option<EndState>,
    ) -> Continuation {
        let mut joined = normal;
        if let Some(raised) = raised {
            if self.handler().is_some_and(|handler| handler.again) {
                self.open();
                let mut again = raised.clone();
                again.state = again.state.join(self.state);
                again.changed.values_mut().for_each(|value| *value = Value::Unknown(Reason::ByRetriedProcedure));
                self.apply(again);
                self.run_handler();
                if let Some((Some(normal), _)) = self.quietly(Mode::Aside, |this| this.call(id, bound)) {
                    self.apply(normal);
                }
                let left = self.take();
                joined = joined.map(|joined| self.join(joined, left));
            }
            self.open();
            self.apply(raised);
            let flow = self.raise();
            let left = self.take();
            if flow == Continuation::Next {
                joined = Some(match joined {
                    Some(joined) => self.join(joined, left),
                    None => left,
                });
            }
        }
        match joined {
            Some(left) => {
                self.apply(left);
                Continuation::Next
            }
            None => Continuation::Elsewhere,
        }
    }

    /// A call of a procedure by a computed name.
    pub(super) fn enter_late(
        &mut self,
        scope: Scope,
        name: &'a Expression,
        call: &'a Call,
        span: Span,
    ) -> Continuation {
        let Value::Text(name) = self.evaluate(scope, name) else {
            return self.enter_any(scope, call, span, b"");
        };
        match self.symbols.find_routine(scope.module, without_module(&name)) {
            Some(id) => self.enter(scope, id, &call.arguments, span),
            None => {
                self.keep_here(span, Reason::ProcedureMissing);
                self.unknown_procedure(scope, call, span);
                Continuation::Next
            }
        }
    }

    /// `CallByVar Name, Number`: a call of the procedure whose name is the text followed by the number.
    pub(super) fn enter_by_variable(&mut self, scope: Scope, call: &'a Call, span: Span) -> Continuation {
        static NONE: LazyLock<Arguments> = LazyLock::new(Arguments::default);
        let known: Vec<Value> =
            call.arguments.positional.iter().map(|argument| self.evaluate(scope, argument)).collect();
        let (name, number) = match &known[..] {
            [Value::Text(name), Value::Num(number, _)] => (name, number),
            [Value::Text(name), ..] => return self.enter_any(scope, call, span, name),
            _ => return self.enter_any(scope, call, span, b""),
        };
        let name = [&name[..], number.to_string().as_bytes()].concat();
        match self.symbols.find_routine(scope.module, &name) {
            Some(id) => self.enter(scope, id, &NONE, span),
            None => {
                self.unknown_procedure(scope, call, span);
                Continuation::Next
            }
        }
    }

    /// A call of a procedure that is chosen at run time: any one whose name has this beginning, in the files or not.
    fn enter_any(&mut self, scope: Scope, call: &'a Call, span: Span, begins: &[u8]) -> Continuation {
        self.keep_here(span, Reason::ProcedureChosen);
        self.reached.called_late.push(begins.to_ascii_uppercase().into());
        self.unknown_call(scope, &call.arguments);
        self.tell(
            span,
            "rapid.late-binding",
            "which procedure is called here is known only at run time: what it could change is not known after it",
            Severity::Warning,
        );
        Continuation::Next
    }

    /// Whether a call that chooses its procedure at run time may choose this one.
    pub(super) fn may_be_called_late(&self, id: RoutineId) -> bool {
        let name = self.routine_name(id).to_ascii_uppercase();
        let is_chosen = |begins: &[u8]| {
            let number = name.strip_prefix(begins);
            begins.is_empty() || number.is_some_and(|n| !n.is_empty() && n.iter().all(u8::is_ascii_digit))
        };
        self.reached.called_late.iter().any(|begins| is_chosen(begins))
    }

    /// A call of a procedure or instruction that is not known.
    pub(super) fn unknown_procedure(&mut self, scope: Scope, call: &'a Call, span: Span) {
        let bytes = self.bytes(scope.source as usize);
        let mut targets = false;
        for argument in &call.arguments.positional {
            let value = self.evaluate(scope, argument);
            let variable = argument.variable().map(|name| Upper::new(&bytes[name.range()]));
            let declared = variable.and_then(|name| Some(&self.symbols.variables[self.find(scope, &name)?].kind));
            targets |= declared.is_some_and(|kind| **kind == *b"ROBTARGET") || self.as_target(&value).is_some();
            self.numbers.pin_value(&value);
        }
        if targets {
            if self.mode == Mode::Real {
                self.counters.motions += 1;
            }
            self.keep_motion(span, Reason::GivenAway);
        }
        self.unknown_call(scope, &call.arguments);
        self.tell_undeclared(scope, &bytes[call.name.range()], span);
    }

    /// A function that is neither predefined nor in the files.
    pub(super) fn unknown_function(&mut self, scope: Scope, call: &'a Call) {
        self.unknown_call(scope, &call.arguments);
        let bytes = self.bytes(scope.source as usize);
        self.tell_undeclared(scope, &bytes[call.name.range()], call.name);
    }

    fn tell_undeclared(&mut self, scope: Scope, name: &[u8], span: Span) {
        let name = String::from_utf8_lossy(name).into_owned();
        let message = format!(
            "`{name}` is not in the files: what it could change (frames, tools, displacement, its arguments) is not known \
             after it"
        );
        let source = scope.source;
        if self.mode == Mode::Real && self.messages.reported.insert((usize::from(source), span, "rapid.undeclared")) {
            let named = |d: &Diagnostic| d.code == "rapid.undeclared" && d.message == message;
            if !self.messages.diagnostics.iter().any(named) {
                let told = Diagnostic::error("rapid.undeclared", "", message)
                    .at(&self.symbols.sources[usize::from(source)], span);
                self.messages.diagnostics.push(
                    told.severity(Severity::Warning)
                        .help("give the module that declares it with --context, or as an input; or, where it changes neither frames nor positions, name it in `[controller] harmless` of the cell"),
                );
            }
        }
    }

    /// Makes everything unknown that an unknown routine could change.
    pub(super) fn unknown_call(&mut self, scope: Scope, given: &'a Arguments) {
        self.counters.events += 1;
        self.position.stands = None;
        let everything = self.symbols.everything();
        for &at in everything.iter() {
            self.forget_data(at, Reason::Foreign);
        }
        for argument in given.given() {
            let value = self.evaluate(scope, argument);
            self.numbers.pin_value(&value);
            self.forget_argument(scope, argument, Reason::Foreign);
        }
        self.state.lose(Switches::FOREIGN);
    }

    /// Makes everything unknown that a routine changes which is not followed; the reason names the kind of routine.
    pub(super) fn not_followed(&mut self, scope: Scope, id: RoutineId, given: &'a Arguments, reason: Reason) {
        self.counters.events += 1;
        let changes = self.symbols.changed_by(id).clone();
        let own = changes.own.clone();
        let here = super::known::Changes { own: Default::default(), ..changes };
        self.forget(&here, reason);
        self.state.lose(here.switches);
        self.may_have_moved(id, &self.symbols.routine(id).body);
        let (bytes, theirs) = (self.bytes(scope.source as usize), self.bytes(id.file));
        let routine = self.symbols.routine(id);
        for argument in given.given() {
            let value = self.evaluate(scope, argument);
            self.numbers.pin_value(&value);
        }
        let changed = |param: &Param| param.by_reference && own.contains(&*Upper::new(&theirs[param.name.range()]));
        let given = given.given_to(routine, bytes, theirs);
        let to_changed = given.to_parameters.iter().filter(|given| changed(&routine.params[given.parameter]));
        for argument in to_changed.filter_map(|given| given.value).chain(given.others) {
            self.forget_argument(scope, argument, Reason::Computed);
        }
    }

    /// Makes an argument by reference unknown.
    pub(super) fn forget_argument(&mut self, scope: Scope, argument: &'a Expression, why: Reason) {
        if let Some(part) = self.place(scope, argument) {
            self.store(&part, &Value::Unknown(why));
        }
    }

    /// Runs a routine that nothing in the files calls.
    pub(super) fn start(&mut self, id: RoutineId) -> Continuation {
        self.position.stands = Some(0);
        match self.call(id, &[]) {
            None => Continuation::Next,
            Some((Some(left), _)) => {
                self.apply(left);
                Continuation::Next
            }
            Some((None, _)) => Continuation::Elsewhere,
        }
    }

    /// Runs a routine. Returns the states at its end and after an error; `None` if it can only end normally.
    fn call(&mut self, id: RoutineId, arguments: &[(usize, Bound)]) -> Option<(Option<EndState>, Option<EndState>)> {
        match self.mode {
            Mode::Real => drop(self.reached.entered.insert(id)),
            Mode::Aside => drop(self.reached.entered_aside.insert(id)),
            Mode::Dry => {}
        }
        let kept = self.symbols.variables.len();
        let layer = self.layers.len();
        self.open();
        let names = self.own_names(id, arguments);
        let routine = self.symbols.routine(id);
        let jumps = Self::jumps(&routine.body);
        let (module, noted) = (self.symbols.module_of(id), None);
        let (returns, raises) = (Vec::new(), Vec::new());
        if jumps || self.frames.last().is_some_and(|caller| caller.jumps) {
            self.position.stands = None;
        }
        let returns_from = None;
        self.frames.push(Frame { routine: id, module, names, layer, returns, raises, jumps, noted, returns_from });
        self.counters.epoch += 1;
        self.errors.guards += usize::from(routine.error.is_some());
        let loosened = jumps.then(|| self.loosen(id));
        let flow = self.block(&routine.body);
        loosened.into_iter().for_each(|loosened| self.tighten(loosened));
        self.errors.guards -= usize::from(routine.error.is_some());
        let frame = self.frames.pop();
        if let Some(returned) = frame.as_ref().and_then(|frame| frame.returns_from)
            && (flow != Continuation::Next || returned != self.position.stands)
        {
            self.position.stands = if flow == Continuation::Next { None } else { returned };
        }
        if jumps {
            self.position.stands = None;
        }
        self.counters.epoch += 1;
        let (returns, raises) = frame.map_or((Vec::new(), Vec::new()), |frame| (frame.returns, frame.raises));
        if flow == Continuation::Next && returns.is_empty() && raises.is_empty() {
            self.symbols.variables.truncate(kept);
            self.commit();
            return None;
        }
        self.symbols.variables.truncate(kept);
        let end = self.take();
        let ends = returns.into_iter().chain((flow == Continuation::Next).then_some(end));
        let normal = ends.reduce(|a, b| self.join(a, b));
        let raised = raises.into_iter().reduce(|a, b| self.join(a, b));
        Some((normal, raised))
    }

    /// Prepares a routine with labels, which may run any statement after any other: everything that it changes is unknown in all of it.
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
            self.forget_data(at, Reason::Jumps);
            before.push((at, self.symbols.variables[at].volatile));
            self.symbols.variables[at].volatile.get_or_insert(Reason::Jumps);
        }
        let loosened = Loosened { data: before, jumping: self.jumping };
        // A switch that is on may stay on: the jump may skip the statement that switches it off.
        let off = changes.switches_off;
        let mut switches = changes.switches;
        switches |= Switches {
            displacement: off.displacement && self.state.displacement != OnOff::Off,
            soft: off.soft && self.state.soft != OnOff::Off,
            axes: off.axes,
            ..Switches::NONE
        };
        self.jumping |= switches;
        self.state.lose(switches);
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

    /// Records that the running routine may return here with this state.
    pub(super) fn note_return(&mut self, left: EndState) {
        let stands = self.position.stands;
        if let Some(frame) = self.frames.last_mut() {
            note(&mut frame.returns, left);
            frame.returns_from = Some(frame.returns_from.map_or(stands, |known| known.filter(|_| known == stands)));
        }
    }
}

impl Expression {
    /// The routine that it names as a text literal: `"name"` or `"module:name"`.
    pub(super) fn routine_named<'b>(&self, bytes: &'b [u8]) -> Option<&'b [u8]> {
        let text = bytes[self.span.range()].strip_prefix(b"\"")?.strip_suffix(b"\"")?;
        matches!(self.kind, ExpressionKind::Text).then(|| without_module(text))
    }
}

/// The name of a routine in a text `name` or `module:name`.
pub(super) fn without_module(text: &[u8]) -> &[u8] {
    text.rsplit(|b| *b == b':').next().unwrap_or_default()
}
