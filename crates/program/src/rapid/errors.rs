//! Errors: the states that handlers get, and the states after them.

use super::expression::Expression;
use super::known::RoutineId;
use super::motion;
use super::runner::Runner;
use super::tree::{Routine, Statement, StatementKind, any, statements};
use crate::Reason;

/// What an ERROR handler may do with an error.
#[derive(Clone, Copy)]
pub(super) struct Handler {
    /// TRYNEXT: continues after the failed statement.
    pub(super) goes_on: bool,
    /// RETRY: runs the failed statement again.
    pub(super) again: bool,
    /// RAISE: hands the error to the caller.
    pub(super) hands_on: bool,
}

impl<'a> Runner<'a> {
    /// What the ERROR handler of the running routine may do.
    pub(super) fn handler(&self) -> Option<Handler> {
        let routine = self.symbols.routine(self.frames.last()?.routine);
        routine.error.is_some().then(|| Handler {
            goes_on: any(routine.on_error(), &|s| matches!(s, StatementKind::TryNext)),
            again: any(routine.on_error(), &|s| matches!(s, StatementKind::Retry)),
            hands_on: any(routine.on_error(), &|s| matches!(s, StatementKind::Raise)),
        })
    }

    /// An error at this statement: goes to the routine's own handler, or to its caller. Returns whether the handler continues after it.
    pub(super) fn raise(&mut self) -> bool {
        self.counters.events += 1;
        let handler = self.handler();
        let before = self.state.clone();
        self.run_handler();
        let left = std::mem::replace(&mut self.state, before);
        if handler.is_none_or(|handler| handler.hands_on) {
            self.note_end(|frame| &mut frame.raised, left.clone());
        }
        // A handler that comes to its end returns; one that ends with TRYNEXT, RETRY or RAISE does not come to it.
        let routine = self.frames.last().map(|frame| self.symbols.routine(frame.routine));
        let ends =
            |s: &Statement| matches!(s.kind, StatementKind::TryNext | StatementKind::Retry | StatementKind::Raise);
        let returns = |routine: &Routine| {
            !routine.on_error().last().is_some_and(ends)
                || any(routine.on_error(), &|s| matches!(s, StatementKind::Return(_)))
        };
        if handler.is_some() && routine.is_some_and(returns) {
            self.note_end(|frame| &mut frame.returned, left);
        }
        let goes_on = handler.is_some_and(|handler| handler.goes_on);
        if goes_on {
            self.run_handler();
        }
        goes_on
    }

    /// Makes everything unknown that the ERROR handler of the running routine may change.
    pub(super) fn run_handler(&mut self) {
        let Some(id) = self.frames.last().map(|frame| frame.routine) else { return };
        let routine = self.symbols.routine(id);
        if routine.on_error().is_empty() {
            return;
        }
        let changes = self.symbols.changed_in(id, routine.on_error());
        self.forget(&changes, Reason::ByErrorHandler);
        self.state.modal.lose(changes.states);
        if changes.end_cycle {
            self.ends_cycle();
        }
        self.may_have_moved(id, routine.on_error());
    }

    /// Applies, before and after a statement that may fail, the changes of a handler that runs it again or continues after it.
    pub(super) fn may_be_handled(&mut self, has_run: bool) {
        if self.handler().is_some_and(|handler| handler.again || has_run && handler.goes_on) {
            self.run_handler();
        }
    }

    /// Records that an expression may fail, in any statement: by an index outside of its array (`ERR_OUTOFBND`), a division
    /// (`ERR_DIVZERO`) or a function.
    pub(super) fn expression_may_fail(&mut self) {
        if self.errors.guards > 0 {
            self.errors.failures += 1;
            self.may_fail();
            self.may_be_handled(true);
        }
    }

    /// Whether an expression may have failed since the count was `failures`, and the handler continues after its statement.
    pub(super) fn skipped_since(&self, failures: usize) -> bool {
        self.errors.failures > failures && self.handler().is_some_and(|handler| handler.goes_on)
    }

    /// Applies that statements of a routine may have run: if they may move the robot, its position is unknown.
    pub(super) fn may_have_moved(&mut self, id: RoutineId, block: &[Statement]) {
        let (bytes, module) = (self.bytes(id.file), self.symbols.module_of(id));
        let moves = |statement: &Statement| {
            statement.call().is_some_and(|call| {
                let name = &bytes[call.name.range()];
                call.late.is_some()
                    || motion::shape(name).is_some()
                    || self.symbols.find_routine(module, name).is_some()
            })
        };
        if statements(block).into_iter().any(moves) {
            self.state.lose_place();
        }
    }

    /// Whether the program waits for motions to be stopped: a handler names the error of a collision or of a process, or a trap
    /// raises the latter. Source: ABB, *RAPID Instructions, Functions and Data types*, `ProcerrRecovery`; the option *Collision
    /// Detection* raises `ERR_COLL_STOP` where its error handling is installed, of which a program that does not name it says
    /// nothing (`docs/soundness.md`).
    pub(super) fn handles_stops(&self) -> bool {
        let mut routines = self.symbols.all().map(|id| (id, self.symbols.routine(id)));
        if routines.all(|(_, routine)| routine.handlers.is_empty()) {
            return false;
        }
        self.symbols.all().any(|id| {
            let (bytes, routine) = (self.bytes(id.file), self.symbols.routine(id));
            let is_error = |part: &Expression| {
                let name = &bytes[part.span.range()];
                part.is_name() && [&b"ERR_COLL_STOP"[..], b"ERR_PATH_STOP"].iter().any(|e| e.eq_ignore_ascii_case(name))
            };
            let mut names_error = false;
            for statement in statements(&routine.handlers) {
                statement.each(&mut |part: &Expression| names_error |= is_error(part));
            }
            let raises = |statement: &Statement| {
                statement.call().is_some_and(|call| bytes[call.name.range()].eq_ignore_ascii_case(b"ProcerrRecovery"))
            };
            names_error || statements(&routine.body).into_iter().any(raises)
        })
    }

    /// Records that the next statement may fail and go to a handler; not twice in the same state.
    pub(super) fn may_fail(&mut self) {
        let Some(frame) = self.frames.last() else { return };
        let now = Some((self.state.version, self.state.modal));
        if frame.noted == now {
            return;
        }
        let before = self.state.clone();
        self.raise();
        self.state = before;
        if let Some(frame) = self.frames.last_mut() {
            frame.noted = now;
        }
    }
}
