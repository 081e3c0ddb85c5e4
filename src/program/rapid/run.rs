//! Runs the program: follows calls, loops and branches as far as they are known when reading.

use super::eval::Scope;
use super::gathering::Gathering;
use super::known::RoutineId;
use super::motion::{self, Simple};
use super::outcome::Outcome;
use super::predefined;
use super::runner::{Flow, Mode, Runner};
use super::tree::{File, RoutineKind, Statement};
use crate::limits::RUN_MOTIONS;
use crate::program::{Kept, Reason, UnknownMotion};
use crate::text::{Diagnostic, Severity, Span};

/// Each further so many bytes of a statement count as one more step, because long statements take longer.
const BYTES_PER_STEP: usize = 256;
/// Most motions in all, if equal motions are stored once.
#[allow(clippy::cast_possible_truncation)] // some million
pub(super) const MOTIONS: u32 = RUN_MOTIONS.most as u32;
impl<'a> Runner<'a> {
    /// Runs `main`; if there is none, or it moves nothing, runs every procedure that no other calls.
    pub(super) fn run(self, files: &[File]) -> Outcome {
        self.run_gathering(files).0
    }

    /// [`Runner::run`], with the gathered targets and the number of executed motions.
    pub(super) fn run_gathering(mut self, files: &[File]) -> (Outcome, Gathering, u32) {
        let procs = self.follow();
        self.look_aside(&procs);
        self.keep_what_is_not_run();
        self.tell_traps_that_move();
        let gathering = std::mem::replace(&mut self.gathering, Gathering::All);
        let motions = self.motions;
        (self.finish(files), gathering, motions)
    }

    /// The run of [`Runner::run`]; returns the procedures of the program.
    pub(super) fn follow(&mut self) -> Vec<RoutineId> {
        self.stops_are_handled = self.handles_stops();
        let procs = self.procedures();
        let main = procs.iter().copied().find(|id| self.routine_name(*id).eq_ignore_ascii_case(b"main"));
        self.begin_cycle();
        if let Some(main) = main {
            self.start(main);
            self.tell_next_cycle(main);
        }
        if self.motions == 0 {
            let others: Vec<RoutineId> = self.uncalled(&procs).into_iter().filter(|id| Some(*id) != main).collect();
            // Each entry point starts with the data of the text, not with those that another one left.
            for (before, id) in others.into_iter().enumerate() {
                // Nothing has run before the first one: a chunk begins with its given state.
                if before > 0 {
                    self.begin_again();
                }
                // `main` may have called it at any moment.
                if self.may_be_called_late(id) {
                    self.forget_what_routines_change();
                }
                self.start(id);
                if self.steps >= self.most_steps {
                    break;
                }
            }
        }
        procs
    }

    /// Procedures of the program itself, in the order of the text.
    fn procedures(&self) -> Vec<RoutineId> {
        let own = |id: &RoutineId| id.file < self.written && self.symbols.routine(*id).kind == RoutineKind::Proc;
        self.symbols.all().filter(own).collect()
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

    /// Runs something only for the state after it, or for the data that it uses.
    pub(super) fn quietly<T>(&mut self, mode: Mode, run: impl FnOnce(&mut Self) -> T) -> T {
        let before = self.mode;
        self.mode = before.max(mode);
        let done = run(self);
        self.mode = before;
        done
    }

    pub(super) fn block(&mut self, block: &'a [Statement]) -> Flow {
        for statement in block {
            self.steps = self.steps.saturating_add(1);
            if self.steps > self.most_steps || self.targets.len() > self.most_targets || self.motions > MOTIONS {
                return self.give_up(statement.place());
            }
            let flow = match statement {
                Statement::Simple(span) => {
                    self.steps = self.steps.saturating_add(span.len() / BYTES_PER_STEP);
                    if self.mode == Mode::Real {
                        self.ran.add(self.scope().source, span.start);
                    }
                    self.simple(*span)
                }
                Statement::Mark(mark) => {
                    self.state.mark = Some(*mark);
                    self.state.mark_unknown = self.jumping.marks;
                    Flow::Next
                }
                Statement::If { arms, otherwise, at } => self.condition(arms, otherwise, *at),
                Statement::For { variable, from, to, step, body, at } => {
                    self.counted([*from, *to], *step, *variable, body, *at)
                }
                Statement::While { condition, body, at } => self.repeat(*condition, body, *at),
                Statement::Test { subject, cases, otherwise, at } => self.choice(*subject, cases, otherwise, *at),
                Statement::Return(value) => {
                    if !value.is_empty() {
                        let value = self.evaluate(self.scope(), *value);
                        self.pin_value(&value);
                    }
                    self.leave();
                    Flow::Gone
                }
                Statement::Raise => self.raise(),
                // These belong to handlers, which are not run; elsewhere they are errors.
                Statement::Exit | Statement::Retry | Statement::TryNext => Flow::Gone,
                Statement::Connect(_) => {
                    self.events += 1;
                    Flow::Next
                }
                Statement::Goto(label) => {
                    self.note(
                        *label,
                        "rapid.goto",
                        "GOTO is not followed: statements are taken in the order of the text, and what the routine \
                         changes is not known in it",
                    );
                    Flow::Next
                }
            };
            // In a routine with labels, a jump may reach the next statement.
            if flow == Flow::Gone && !self.frames.last().is_some_and(|frame| frame.jumps) {
                return flow;
            }
        }
        Flow::Next
    }

    /// Ends the run at a statement of the running routine, or else at the routine's name.
    pub(super) fn give_up(&mut self, at: Option<Span>) -> Flow {
        if self.steps < usize::MAX {
            // Reported once: everything still running ends at its next step.
            self.steps = usize::MAX;
            if self.looking_aside {
                return Flow::Gone;
            }
            let place = self.frames.last().map_or((0, Span::default()), |frame| {
                (frame.routine.file, at.unwrap_or_else(|| self.symbols.routine(frame.routine).name))
            });
            let (targets, steps) = (self.most_targets, self.most_steps);
            let message = match self.gathering {
                Gathering::All => format!("the program runs through more than {targets} targets or {steps} statements"),
                _ => format!(
                    "the program runs through more than {MOTIONS} motions, {targets} different ones, or {steps} statements \
                     between them"
                ),
            };
            let error = Diagnostic::error("rapid.endless", "", message).at(&self.symbols.sources[place.0], place.1);
            self.diagnostics.push(error.help(RUN_MOTIONS.help));
        }
        Flow::Gone
    }

    /// Refuses the program because no controller would run it.
    pub(super) fn refuse(&mut self, source: u16, span: Span, code: &'static str, message: &str, help: &str) {
        if self.mode == Mode::Real && self.reported.insert((usize::from(source), span, code)) {
            let error = Diagnostic::error(code, "", message).at(&self.symbols.sources[usize::from(source)], span);
            self.diagnostics.push(error.help(help));
        }
    }

    pub(super) fn note(&mut self, span: Span, code: &'static str, message: &str) {
        self.tell(span, code, message, Severity::Note);
    }

    pub(super) fn tell(&mut self, span: Span, code: &'static str, message: &str, severity: Severity) {
        let source = self.scope().source as usize;
        if self.mode == Mode::Real && self.reported.insert((source, span, code)) {
            let told = Diagnostic::error(code, "", message).at(&self.symbols.sources[source], span);
            self.diagnostics.push(told.severity(severity));
        }
    }

    /// Keeps a motion whose target is unknown.
    pub(super) fn keep_motion(&mut self, span: Span, reason: Reason) {
        self.stands = None;
        if self.mode != Mode::Real {
            return;
        }
        // No controller loads this.
        let fault = matches!(reason, Reason::NotANumber | Reason::Aggregate | Reason::NotUnit);
        let source = self.scope().source;
        self.keep_as(source as usize, span, reason, fault);
        let line = self.lines[source as usize].line(span.start);
        self.miss(UnknownMotion { ordinal: self.motions, reason, source, span, line });
    }

    /// Keeps a statement of the running routine.
    pub(super) fn keep_here(&mut self, span: Span, reason: Reason) {
        if self.mode == Mode::Real {
            self.keep(self.scope().source as usize, span, reason);
        }
    }

    pub(super) fn keep(&mut self, source: usize, span: Span, reason: Reason) {
        self.keep_as(source, span, reason, false);
    }

    fn keep_as(&mut self, source: usize, span: Span, reason: Reason, fault: bool) {
        if source < self.written && self.seen.insert((source, span, reason)) {
            let line = self.lines[source].line(span.start);
            let help = "";
            self.kept.push(Kept { source, span, line: line as usize, reason, fault, help });
        }
    }

    fn simple(&mut self, span: Span) -> Flow {
        let scope = self.scope();
        let bytes = self.bytes(scope.source as usize);
        let Some(simple) = motion::split(bytes, scope.source, span) else {
            self.keep_here(span, Reason::NotUnderstood);
            self.events += 1;
            return Flow::Next;
        };
        let call = match simple {
            Simple::Assignment { target, value } => {
                let failures = self.failures;
                if self.guards > 0 && bytes[target.range()].contains(&b'{') {
                    // Evaluated for its index.
                    self.evaluate(scope, target);
                }
                self.assign(scope, target, value);
                // The handler may change the data that would have been assigned.
                if self.failures > failures {
                    self.may_be_handled(true);
                }
                return Flow::Next;
            }
            Simple::Call(call) => call,
        };
        if call.late_bound {
            return self.enter_late(scope, &call, span);
        }
        let name = &bytes[call.name.range()];
        if let Some(id) = self.symbols.find_routine(scope.module, name) {
            return self.enter(scope, id, &call, span);
        }
        if name.eq_ignore_ascii_case(b"CallByVar") {
            return self.enter_by_variable(scope, &call, span);
        }
        let shape = motion::shape(name);
        // A stopped motion stops the program, unless a handler expects that.
        let plain = shape.is_some_and(|shape| shape.plain) && !self.stops_are_handled;
        let known = if shape.is_none() { predefined::instruction(name) } else { None };
        let fails = match known {
            _ if plain => call.option(bytes, b"Conc").is_some(),
            Some(known) => known.may_fail(),
            None => true,
        };
        let (fails, failures) = (self.guards > 0 && fails, self.failures);
        if fails {
            self.may_fail();
            self.may_be_handled(false);
        }
        let flow = match (shape, known) {
            (Some(shape), _) => {
                self.motion(scope, &call, shape, span);
                if self.skipped_since(failures) {
                    self.stands = None;
                }
                Flow::Next
            }
            (None, Some(instruction)) => self.instruction(scope, &call, instruction, span),
            (None, None) => {
                self.unknown_procedure(scope, &call, span);
                Flow::Next
            }
        };
        if fails && flow == Flow::Next {
            self.may_be_handled(true);
        }
        flow
    }
}
