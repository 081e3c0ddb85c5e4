//! Errors: what handlers get, and what holds after them.

use super::known::RoutineId;
use super::memory::note;
use super::motion;
use super::runner::{Flow, Runner};
use super::symbols::first_word;
use super::tree::{Statement, any, simple_statements};
use super::uses::texts;
use crate::program::Reason;
use crate::text::Span;

/// What an ERROR handler may do with an error.
#[derive(Clone, Copy)]
pub(super) struct Handler {
    /// TRYNEXT: goes on after what failed.
    pub(super) goes_on: bool,
    /// RETRY: runs again what failed.
    pub(super) again: bool,
    /// RAISE: hands it on to the caller.
    pub(super) hands_on: bool,
}

impl<'a> Runner<'a> {
    /// What the ERROR handler of the running routine may do.
    pub(super) fn handler(&self) -> Option<Handler> {
        let routine = self.symbols.routine(self.frames.last()?.routine);
        routine.error.is_some().then(|| Handler {
            goes_on: any(routine.on_error(), &|s| matches!(s, Statement::TryNext)),
            again: any(routine.on_error(), &|s| matches!(s, Statement::Retry)),
            hands_on: any(routine.on_error(), &|s| matches!(s, Statement::Raise)),
        })
    }

    /// An error, here: to the routine's own handler, or to its caller.
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

    /// What the ERROR handler of the running routine may change is not known after it.
    pub(super) fn run_handler(&mut self) {
        let Some(id) = self.frames.last().map(|frame| frame.routine) else { return };
        let routine = self.symbols.routine(id);
        if routine.on_error().is_empty() {
            return;
        }
        let changes = self.symbols.changed_in(id, routine.on_error());
        self.forget(&changes, Reason::ByErrorHandler);
        self.state.lose(changes.switches);
        self.may_have_moved(id, routine.on_error());
    }

    /// Before and after a statement that may fail: what the handler changes that runs it again, or goes on after it.
    pub(super) fn may_be_handled(&mut self, behind: bool) {
        if self.handler().is_some_and(|handler| handler.again || behind && handler.goes_on) {
            self.run_handler();
        }
    }

    /// An expression may fail, whatever the statement that it stands in: by an index outside of its array (`ERR_OUTOFBND`), a division
    /// (`ERR_DIVZERO`) or a function.
    pub(super) fn expression_may_fail(&mut self) {
        if self.guards > 0 {
            self.failures += 1;
            self.may_fail();
            self.may_be_handled(true);
        }
    }

    /// Whether an expression may have failed since there were so many failures, and the handler goes on after its statement.
    pub(super) fn skipped_since(&self, failures: usize) -> bool {
        self.failures > failures && self.handler().is_some_and(|handler| handler.goes_on)
    }

    /// Statements of a routine may have run: where they move the robot, or call a routine that may, it stands elsewhere.
    pub(super) fn may_have_moved(&mut self, id: RoutineId, block: &[Statement]) {
        let (bytes, module) = (self.bytes(id.file), self.symbols.module_of(id));
        let moves = |span: Span| {
            let name = &bytes[first_word(bytes, span).range()];
            motion::shape(name).is_some() || self.symbols.find_routine(module, name).is_some()
        };
        if self.stands.is_some() && simple_statements(block).into_iter().any(moves) {
            self.stands = None;
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
            let names = |span: &Span| {
                let text = bytes[span.range()].to_ascii_uppercase();
                [&b"ERR_COLL_STOP"[..], b"ERR_PATH_STOP"].iter().any(|name| memchr::memmem::find(&text, name).is_some())
            };
            let raises = |span: Span| bytes[first_word(bytes, span).range()].eq_ignore_ascii_case(b"ProcerrRecovery");
            let mut handled = Vec::new();
            texts(&routine.handlers, &mut handled);
            handled.iter().any(names) || simple_statements(&routine.body).into_iter().any(raises)
        })
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
}
