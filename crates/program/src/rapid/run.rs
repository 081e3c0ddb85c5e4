//! Runs the program: follows calls, loops and branches as far as they are known when reading.

use super::changes::is_synchronised;
use super::eval::Scope;
use super::expression::{Call, ExpressionKind, Part, PartStep};
use super::gathering::Gathering;
use super::known::RoutineId;
use super::lex::{Cursor, LexemeKind};
use super::motion;
use super::predefined;
use super::runner::{Mode, Runner};
use super::tree::{Assignment, RoutineKind, Statement, StatementKind};
use crate::{Program, Reason};
use deflex_lang::walk::Stop;
use deflex_text::limits::RUN_MOTIONS;
use deflex_text::{Diagnostic, Severity, Span};
use std::collections::BTreeSet;

/// Each further so many bytes of a statement count as one more step, because long statements take longer.
const BYTES_PER_STEP: usize = 256;
/// Most motions in all, if equal motions are stored once.
#[allow(clippy::cast_possible_truncation)] // some million
pub(super) const MOTIONS: u32 = RUN_MOTIONS.most as u32;
impl<'a> Runner<'a> {
    /// Runs `main`; if there is none, or it moves nothing, runs every procedure that no other calls.
    pub(super) fn run(self) -> Program {
        self.run_gathering().0
    }

    /// [`Runner::run`], with the gathered targets.
    pub(super) fn run_gathering(mut self) -> (Program, Gathering) {
        let procs = self.follow();
        self.run_uncalled(&procs);
        let gathering = std::mem::replace(&mut self.gathering, Gathering::All);
        (self.finish(), gathering)
    }

    /// The run of [`Runner::run`]; returns the procedures of the program.
    pub(super) fn follow(&mut self) -> Vec<RoutineId> {
        self.errors.stops_are_handled = self.handles_stops();
        let procs = self.procedures();
        let main = procs.iter().copied().find(|id| self.routine_name(*id).eq_ignore_ascii_case(b"main"));
        self.begin_cycle();
        if let Some(main) = main {
            self.start(main);
            self.report_next_cycle(main);
        }
        if self.counters.motions == 0 {
            let others: Vec<RoutineId> = self.uncalled(&procs).into_iter().filter(|id| Some(*id) != main).collect();
            // Each entry point starts with the data of the text, not with those that another one left.
            for (before, &id) in others.iter().enumerate() {
                // Nothing has run before the first one: a chunk begins with its given state.
                if before > 0 {
                    self.begin();
                }
                // `main` may have called it at any moment.
                if self.may_be_called_late(id) {
                    self.forget_what_routines_change();
                }
                let motions = self.counters.motions;
                self.start(id);
                if self.counters.motions > motions {
                    self.report_other_entries(id, &others);
                }
                if self.budget.is_spent() {
                    break;
                }
            }
        }
        self.miss_unread_motions();
        procs
    }

    /// Procedures of the program itself, and those of the context that call them, in the order of the text.
    fn procedures(&self) -> Vec<RoutineId> {
        let procs = || self.symbols.all().filter(|id| self.symbols.routine(*id).kind == RoutineKind::Proc);
        let mut found: BTreeSet<RoutineId> = procs().filter(|id| id.file < self.written).collect();
        loop {
            let calls = |id: &RoutineId| self.calls(*id, &self.symbols.routine(*id).body).any(|of| found.contains(&of));
            let callers: Vec<RoutineId> = procs().filter(|id| !found.contains(id) && calls(id)).collect();
            if callers.is_empty() {
                return found.into_iter().collect();
            }
            found.extend(callers);
        }
    }

    pub(super) fn routine_name(&self, id: RoutineId) -> &'a [u8] {
        &self.bytes(id.file)[self.symbols.routine(id).name.range()]
    }

    pub(super) fn scope(&self) -> Scope {
        match self.frames.last() {
            #[allow(clippy::cast_possible_truncation)]
            Some(frame) => {
                Scope { source: frame.routine.file as u16, module: frame.module, local: true, running: true }
            }
            None => Scope { source: 0, module: 0, local: false, running: true },
        }
    }

    pub(super) fn bytes(&self, source: usize) -> &'a [u8] {
        let sources = self.symbols.sources;
        &sources[source].bytes
    }

    /// Runs something only for the state after it and for the data that it uses.
    pub(super) fn record_uses_alone<T>(&mut self, run: impl FnOnce(&mut Self) -> T) -> T {
        let before = std::mem::replace(&mut self.mode, Mode::UsesAlone);
        let done = run(self);
        self.mode = before;
        done
    }

    /// Counts a step at a place of the running routine.
    pub(super) fn count(&mut self, at: Span) -> Result<(), Stop> {
        self.budget.spend(1);
        let is_too_long = self.budget.is_spent()
            || self.found.targets.len() > self.budget.most_targets
            || self.counters.motions > MOTIONS;
        if is_too_long { Err(self.give_up(at)) } else { Ok(()) }
    }

    /// Runs a statement that does not decide which one runs next.
    pub(super) fn statement(&mut self, statement: &'a Statement) -> Result<(), Stop> {
        let at = statement.at;
        self.count(at)?;
        self.may_be_interrupted();
        match &statement.kind {
            StatementKind::Exit => self.ends_cycle(),
            StatementKind::Assign(assignment) => {
                self.begin_statement(at);
                self.assignment(assignment);
            }
            StatementKind::Call(call) => {
                self.begin_statement(at);
                return self.procedure(call, at);
            }
            StatementKind::Mark(mark) => (self.state.modal.mark, self.state.modal.mark_unknown) = (Some(*mark), false),
            StatementKind::Return(Some(value)) => {
                let value = self.evaluate(self.scope(), value);
                self.numbers.pin_value(&value);
            }
            StatementKind::Connect(_) => self.counters.events += 1,
            _ => {}
        }
        Ok(())
    }

    /// Ends the run at a statement of the running routine.
    pub(super) fn give_up(&mut self, at: Span) -> Stop {
        // Reported once: everything still running ends at its next step.
        let has_ended = self.budget.has_ended();
        self.budget.end();
        if !has_ended && !self.reached.runs_uncalled {
            let (targets, steps) = (self.budget.most_targets, self.budget.most_steps);
            let message = match self.gathering {
                Gathering::All => format!("the program runs through more than {targets} targets or {steps} statements"),
                _ => format!(
                    "the program runs through more than {MOTIONS} motions, {targets} different ones, or {steps} statements \
                     between them"
                ),
            };
            let error = Diagnostic::error("rapid.endless", "", message)
                .at(&self.symbols.sources[self.scope().source as usize], at);
            self.messages.diagnostics.push(error.help(RUN_MOTIONS.help));
        }
        Stop::TooLong
    }

    /// Refuses the program because no controller would run it.
    pub(super) fn refuse(&mut self, source: u16, span: Span, code: &'static str, message: &str, help: &str) {
        if self.is_real() && self.messages.reported.insert((usize::from(source), span, code)) {
            let error = Diagnostic::error(code, "", message).at(&self.symbols.sources[usize::from(source)], span);
            self.messages.diagnostics.push(error.help(help));
        }
    }

    pub(super) fn note(&mut self, span: Span, code: &'static str, message: &str) {
        self.report(span, code, message, Severity::Note);
    }

    pub(super) fn report(&mut self, span: Span, code: &'static str, message: &str, severity: Severity) {
        let source = self.scope().source as usize;
        if self.is_real() && self.messages.reported.insert((source, span, code)) {
            let diagnostic = Diagnostic::error(code, "", message).at(&self.symbols.sources[source], span);
            self.messages.diagnostics.push(diagnostic.severity(severity));
        }
    }

    /// Counts the motions whose statements are not understood, so that a program is not judged without them.
    fn miss_unread_motions(&mut self) {
        for (source, file) in (0..).zip(self.symbols.files).take(self.written) {
            for &(span, reason) in &file.odd {
                let bytes = self.bytes(usize::from(source));
                let word = Cursor::new(bytes, span).accept(LexemeKind::Word);
                if word.is_some_and(|word| motion::shape(&bytes[word.span().range()]).is_some()) {
                    self.counters.motions += 1;
                    let motion = self.messages.kept.unknown_motion(self.counters.motions, source, span, reason);
                    self.miss(motion);
                }
            }
        }
    }

    /// Counts and keeps a motion whose arguments are incomplete.
    pub(super) fn unread_motion(&mut self, span: Span, reason: Reason) {
        if self.is_real() {
            self.counters.motions += 1;
        }
        self.keep_motion(span, reason);
    }

    /// Keeps a motion whose target is unknown.
    pub(super) fn keep_motion(&mut self, span: Span, reason: Reason) {
        self.state.lose_place();
        self.state.modal.axes.lose_positions();
        if !self.is_real() {
            return;
        }
        // No controller loads this.
        let is_fault = matches!(reason, Reason::NotANumber | Reason::Aggregate | Reason::NotUnit);
        let (source, kept) = (self.scope().source, &mut self.messages.kept);
        match is_fault {
            true => kept.refuse(source.into(), span, reason),
            false => kept.keep(source.into(), span, reason),
        }
        let motion = kept.unknown_motion(self.counters.motions, source, span, reason);
        self.miss(motion);
    }

    /// Keeps a statement of the running routine.
    pub(super) fn keep_here(&mut self, span: Span, reason: Reason) {
        if self.is_real() {
            self.messages.kept.keep(self.scope().source.into(), span, reason);
        }
    }

    /// Counts an assignment or a call, and records that it is run.
    fn begin_statement(&mut self, at: Span) {
        self.budget.spend(at.len() / BYTES_PER_STEP);
        if self.is_real() {
            self.reached.ran.add(self.scope().source, at.start);
        }
    }

    fn assignment(&mut self, assignment: &'a Assignment) {
        let (scope, failures) = (self.scope(), self.errors.failures);
        let Assignment { to, value } = assignment;
        let has_index = |part: &Part| part.steps.iter().any(|step| matches!(step, PartStep::Index(_)));
        if self.errors.guards > 0 && matches!(&to.kind, ExpressionKind::Part(part) if has_index(part)) {
            // Evaluated for its indices.
            self.evaluate(scope, to);
        }
        self.assign(scope, to, value);
        // The handler may change the data that would have been assigned.
        if self.errors.failures > failures {
            self.may_be_handled(true);
        }
    }

    /// A statement that calls a procedure or an instruction.
    fn procedure(&mut self, call: &'a Call, at: Span) -> Result<(), Stop> {
        let scope = self.scope();
        let (bytes, arguments) = (self.bytes(scope.source as usize), &call.arguments);
        if arguments.is_cut {
            self.keep_here(at, Reason::NotUnderstood);
            self.unknown_call(scope, arguments);
            return Ok(());
        }
        if let Some(name) = &call.late {
            return self.enter_late(scope, name, call, at);
        }
        let name = &bytes[call.name.range()];
        if let Some(id) = self.symbols.find_routine(scope.module, name) {
            return self.enter(scope, id, arguments, at);
        }
        if name.eq_ignore_ascii_case(b"CallByVar") {
            return self.enter_by_variable(scope, call, at);
        }
        let shape = motion::shape(name);
        // A stopped motion stops the program, unless a handler expects that.
        let plain = shape.is_some_and(|shape| shape.plain) && !self.errors.stops_are_handled;
        let known = if shape.is_none() { predefined::instruction(name) } else { None };
        let fails = match known {
            _ if plain => arguments.has(bytes, b"Conc"),
            Some(known) => known.may_fail(),
            None => true,
        };
        let (fails, failures) = (self.errors.guards > 0 && fails, self.errors.failures);
        if fails {
            self.may_fail();
            self.may_be_handled(false);
        }
        match (shape, known) {
            (Some(shape), _) => {
                self.motion(scope, call, shape, at);
                // The procedure of a `MoveLSync` may have moved the arm from there.
                if self.skipped_since(failures) || is_synchronised(name) {
                    self.state.lose_place();
                }
            }
            (None, Some(instruction)) => self.instruction(scope, call, instruction, at)?,
            (None, None) => self.unknown_procedure(scope, call, at),
        }
        if fails {
            self.may_be_handled(true);
        }
        Ok(())
    }
}
