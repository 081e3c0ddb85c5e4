//! Calls of procedures: the meaning of parameters while a routine runs, and the state after it, at its end or after an error.

use super::eval::Scope;
use super::expression::{Arguments, Call, Expression, ExpressionKind};
use super::known::RoutineId;
use super::lasting::LastingStates;
use super::parameters::Bound;
use super::runner::{Frame, Mode, Runner};
use super::state::{Stands, State};
use super::symbols::Upper;
use super::tree::{Param, Statement, statements};
use super::value::Value;
use crate::Reason;
use deflex_lang::ir::SourceSpan;
use deflex_lang::walk::Stop;
use deflex_text::{Diagnostic, Severity, Span};
use std::collections::HashSet;
use std::sync::LazyLock;

/// Deepest calls that are followed: a procedure that calls itself has no end for the reader.
const MAX_CALLS: usize = 48;

/// `CallByVar` gives the procedure nothing.
static NONE: LazyLock<Arguments> = LazyLock::new(Arguments::default);

/// A call that was run.
struct Called<'c> {
    id: RoutineId,
    bound: &'c [(usize, Bound)],
    /// Variables from this number on do not outlive it.
    first: usize,
    /// The state before it, if the calling routine has an error handler.
    entered: Option<State>,
    /// Whether an argument may have failed, after which TRYNEXT continues without the call.
    is_skipped: bool,
}

/// The states in which a call may end.
struct Ended {
    normal: Option<State>,
    /// After an error that the routine does not handle.
    raised: Option<State>,
}

impl<'a> Runner<'a> {
    /// Routines that a block calls by name.
    pub(super) fn calls(&self, id: RoutineId, block: &'a [Statement]) -> impl Iterator<Item = RoutineId> {
        let (bytes, module) = (self.bytes(id.file), self.symbols.module_of(id));
        statements(block).into_iter().filter_map(Statement::call).flat_map(move |call| {
            let named = match &call.late {
                Some(name) => name.text_literal(bytes).and_then(|text| self.symbols.find_routine_in_text(module, text)),
                None => self.symbols.find_routine(module, &bytes[call.name.range()]),
            };
            named.map_or_else(|| self.symbols.chosen_by(module, call, bytes), |named| vec![named])
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
    pub(super) fn enter(&mut self, scope: Scope, id: RoutineId, given: &'a Arguments, span: Span) -> Result<(), Stop> {
        self.counters.events += 1;
        // Under an unknown condition, a procedure that calls itself has no end; nor does one that was found to have none.
        let may_be_endless = !self.is_recording || self.reached.endless.contains(&id);
        let is_ring = may_be_endless && self.frames.iter().any(|frame| frame.routine == id);
        if self.frames.len() >= MAX_CALLS || is_ring {
            let reason = if is_ring { Reason::RoutineCallsItself } else { Reason::CallsTooDeep };
            self.keep_here(span, reason);
            self.reached.endless.insert(id);
            self.not_followed(scope, id, given, Reason::ByRecursiveRoutine);
            return Ok(());
        }
        let before = self.symbols.variables.len();
        let failures = self.errors.failures;
        let bound = self.arguments(scope, id, given);
        let is_skipped = self.skipped_since(failures);
        let place = SourceSpan { source: scope.source, span };
        let (next, around) = (self.chains.len() as u32 + 1, self.calls);
        self.calls = *self.chains.entry((around, place)).or_insert(next);
        let entered = self.handler().map(|_| self.state.clone());
        let ended = self.call(id, &bound, before);
        let called = Called { id, bound: &bound, first: before, entered, is_skipped };
        let goes_on = ended.and_then(|ended| self.after_call(called, ended));
        self.calls = around;
        self.symbols.variables.truncate(before);
        self.state.forget_from(before);
        self.touch();
        goes_on
    }

    /// Continues after a call.
    fn after_call(&mut self, call: Called<'_>, ended: Ended) -> Result<(), Stop> {
        let Called { id, bound, first, entered, is_skipped } = call;
        let Ended { normal: mut joined, raised } = ended;
        let handler = self.handler().filter(|handler| handler.goes_on || handler.again);
        let is_handled = raised.is_some() && handler.is_some();
        if let (Some(raised), Some(entered)) = (&raised, entered.as_ref().filter(|_| handler.is_some_and(|h| h.again)))
        {
            let mut again = raised.clone();
            again.modal = again.modal.join(entered.modal);
            for at in raised.values.apart(&entered.values) {
                let value = raised.values.get(at);
                if value.is_some_and(|value| !value.is(&self.value_in(entered, at))) {
                    again.values.insert(at, Value::Unknown(Reason::ByRetriedProcedure));
                }
            }
            self.state = again;
            self.touch();
            self.run_handler();
            if let Some(normal) = self.record_uses_alone(|this| this.call(id, bound, first))?.normal {
                self.add_state(&mut joined, normal);
            }
        }
        if let Some(raised) = raised {
            self.state = raised;
            if self.raise() {
                let left = std::mem::take(&mut self.state);
                self.add_state(&mut joined, left);
            }
        }
        if let Some(entered) = entered.filter(|_| is_skipped) {
            self.add_state(&mut joined, entered);
        }
        self.state = joined.ok_or(Stop::Ends)?;
        if is_handled || is_skipped {
            self.state.lose_place();
        }
        Ok(())
    }

    /// A call of a procedure by a computed name.
    pub(super) fn enter_late(
        &mut self,
        scope: Scope,
        name: &'a Expression,
        call: &'a Call,
        span: Span,
    ) -> Result<(), Stop> {
        let Value::Text(name) = self.evaluate(scope, name) else {
            return self.enter_chosen(scope, call, span, b"");
        };
        match self.symbols.find_routine_in_text(scope.module, &name) {
            Some(id) => self.enter(scope, id, &call.arguments, span),
            None => {
                self.keep_here(span, Reason::ProcedureMissing);
                self.unknown_procedure(scope, call, span);
                Ok(())
            }
        }
    }

    /// `CallByVar Name, Number`: a call of the procedure whose name is the text followed by the number.
    pub(super) fn enter_by_variable(&mut self, scope: Scope, call: &'a Call, span: Span) -> Result<(), Stop> {
        let known: Vec<Value> =
            call.arguments.positional.iter().map(|argument| self.evaluate(scope, argument)).collect();
        let (name, number) = match &known[..] {
            [Value::Text(name), Value::Num(number, _)] => (name, number),
            [Value::Text(name), ..] => return self.enter_chosen(scope, call, span, name),
            _ => return self.enter_chosen(scope, call, span, b""),
        };
        let name = [&name[..], number.to_string().as_bytes()].concat();
        match self.symbols.find_routine(scope.module, &name) {
            Some(id) => self.enter(scope, id, &NONE, span),
            None => {
                self.unknown_procedure(scope, call, span);
                Ok(())
            }
        }
    }

    /// A call of a procedure that is chosen at run time. If the text has a part of its name that procedures in the files have, it is one of
    /// these (`docs/soundness.md`): each of them runs from the present state.
    fn enter_chosen(&mut self, scope: Scope, call: &'a Call, span: Span, begins: &[u8]) -> Result<(), Stop> {
        let chosen = self.symbols.chosen_by(scope.module, call, self.bytes(usize::from(scope.source)));
        if chosen.is_empty() {
            return self.enter_any(scope, call, span, begins);
        }
        let names: Vec<_> = chosen.iter().map(|id| String::from_utf8_lossy(self.routine_name(*id))).collect();
        let message = format!(
            "which procedure is called here is known only at run time: deflex assumes that it is one of these: {}",
            names.join(", ")
        );
        self.report(span, "rapid.late-binding", &message, Severity::Warning);
        let failures = self.errors.failures;
        self.expression_may_fail();
        let is_skipped = self.skipped_since(failures);
        let given = if call.late.is_some() { &call.arguments } else { &*NONE };
        let before = self.state.clone();
        let mut joined = is_skipped.then(|| before.clone());
        for id in chosen {
            self.state = before.clone();
            self.touch();
            match self.enter(scope, id, given, span) {
                Ok(()) => {
                    let left = std::mem::take(&mut self.state);
                    self.add_state(&mut joined, left);
                }
                Err(Stop::Ends) => {}
                Err(stop) => return Err(stop),
            }
        }
        self.state = joined.ok_or(Stop::Ends)?;
        self.touch();
        Ok(())
    }

    /// A call of a procedure that is chosen at run time: any one whose name has this beginning, in the files or not.
    fn enter_any(&mut self, scope: Scope, call: &'a Call, span: Span, begins: &[u8]) -> Result<(), Stop> {
        self.keep_here(span, Reason::ProcedureChosen);
        self.reached.called_late.push(begins.to_ascii_uppercase().into());
        self.unknown_call(scope, &call.arguments);
        self.report(
            span,
            "rapid.late-binding",
            "which procedure is called here is known only at run time: what it could change is not known after it",
            Severity::Warning,
        );
        Ok(())
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
            if self.is_real() {
                self.counters.motions += 1;
            }
            self.keep_motion(span, Reason::GivenAway);
        }
        self.unknown_call(scope, &call.arguments);
        self.report_undeclared(scope, &bytes[call.name.range()], span);
    }

    /// A function that is neither predefined nor in the files.
    pub(super) fn unknown_function(&mut self, scope: Scope, call: &'a Call) {
        self.unknown_call(scope, &call.arguments);
        let bytes = self.bytes(scope.source as usize);
        self.report_undeclared(scope, &bytes[call.name.range()], call.name);
    }

    fn report_undeclared(&mut self, scope: Scope, name: &[u8], span: Span) {
        let name = String::from_utf8_lossy(name).into_owned();
        let message = format!(
            "`{name}` is not in the files: what it could change (frames, tools, displacement, its arguments) is not known \
             after it"
        );
        let place = (usize::from(scope.source), span, "rapid.undeclared");
        let by = self.frames.first().map(|frame| frame.routine);
        let by = by.filter(|_| self.is_recording && self.reached.runs_uncalled);
        if !(self.is_real() || by.is_some()) || !self.messages.reported.insert(place) {
            return;
        }
        let help = "give the module that declares it with --context, or as an input; or, where it changes neither frames nor positions, name it in `[controller] harmless` of the cell";
        let warning = Diagnostic::error("rapid.undeclared", "", message).at(&self.symbols.sources[place.0], span);
        let warning = warning.severity(Severity::Warning).help(help);
        match by {
            Some(by) => self.messages.undeclared_in_uncalled.push((by, warning)),
            None => self.messages.report_once(warning),
        }
    }

    /// Makes everything unknown that an unknown routine could change.
    pub(super) fn unknown_call(&mut self, scope: Scope, given: &'a Arguments) {
        self.counters.events += 1;
        self.state.lose_place();
        let everything = self.symbols.everything();
        for &at in everything.iter() {
            self.forget_data(at, Reason::Foreign);
        }
        for argument in given.given() {
            let value = self.evaluate(scope, argument);
            self.numbers.pin_value(&value);
            self.forget_argument(scope, argument, Reason::Foreign);
        }
        self.state.modal.lose(LastingStates::FOREIGN);
    }

    /// Makes everything unknown that a routine changes which is not followed; the reason names the kind of routine.
    pub(super) fn not_followed(&mut self, scope: Scope, id: RoutineId, given: &'a Arguments, reason: Reason) {
        self.counters.events += 1;
        let changes = self.symbols.changed_by(id).clone();
        let own = changes.own.clone();
        let here = super::known::Changes { own: Default::default(), ..changes };
        self.forget(&here, reason);
        self.state.modal.lose(here.states);
        if here.end_cycle {
            self.ends_cycle();
        }
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

    /// Runs a routine that nothing in the files calls. If it does not end, the state stays as it was.
    pub(super) fn start(&mut self, id: RoutineId) {
        self.state.stands = Stands::Start;
        self.state.position = None;
        let before = self.state.clone();
        let ended = self.call(id, &[], self.symbols.variables.len());
        self.state = ended.ok().and_then(|ended| ended.normal).unwrap_or(before);
    }

    /// Runs a routine from the present state. Variables from the number `first` on do not outlive the call.
    fn call(&mut self, id: RoutineId, arguments: &[(usize, Bound)], first: usize) -> Result<Ended, Stop> {
        if self.is_recording {
            let entered = match self.mode {
                Mode::Real => &mut self.reached.entered,
                Mode::UsesAlone => &mut self.reached.entered_for_uses,
            };
            entered.insert(id);
        }
        let before = self.symbols.variables.len();
        let names = self.own_names(id, arguments);
        let (module, guards) = (self.symbols.module_of(id), usize::from(self.symbols.routine(id).error.is_some()));
        self.frames.push(Frame { routine: id, module, names, ..Frame::default() });
        self.state.version = self.next_version();
        self.errors.guards += guards;
        let state = std::mem::take(&mut self.state);
        let end = self.walk(id, state);
        self.errors.guards -= guards;
        let (returned, raised) = self.frames.pop().map_or((None, None), |frame| (frame.returned, frame.raised));
        let mut normal = match end {
            Ok(state) => Some(state),
            Err(Stop::Ends) => None,
            Err(Stop::TooLong) => return Err(Stop::TooLong),
        };
        let version = self.next_version();
        let without_own = |mut state: State| {
            state.forget_from(first);
            State { version, ..state }
        };
        normal = normal.map(without_own);
        if let Some(returned) = returned.map(without_own) {
            self.add_state(&mut normal, returned);
        }
        self.symbols.variables.truncate(before);
        Ok(Ended { normal, raised: raised.map(without_own) })
    }

    /// Adds a state in which the running routine ends: `kind` is that of returns or that of errors.
    pub(super) fn note_end(&mut self, kind: fn(&mut Frame) -> &mut Option<State>, left: State) {
        let Some(mut known) = self.frames.last_mut().map(|frame| kind(frame).take()) else { return };
        self.add_state(&mut known, left);
        self.frames.last_mut().into_iter().for_each(|frame| *kind(frame) = known.take());
    }
}

impl Expression {
    /// The text of a literal: `"name"` or `"module:name"` where it names a routine.
    pub(super) fn text_literal<'b>(&self, bytes: &'b [u8]) -> Option<&'b [u8]> {
        let text = bytes[self.span.range()].strip_prefix(b"\"")?.strip_suffix(b"\"")?;
        matches!(self.kind, ExpressionKind::Text).then_some(text)
    }
}
