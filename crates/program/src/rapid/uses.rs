//! Other uses of a target's numbers: in routines that nothing runs, traps, handlers and functions. A number is edited only if all
//! its uses are known and ask for the same value.

use super::expression::Expression;
use super::known::RoutineId;
use super::motion;
use super::ran::Use;
use super::runner::{Mode, Runner};
use super::state::{ModalState, Switches};
use super::symbols::Upper;
use super::tree::{Data, Routine, RoutineKind, Statement, Storage, statements};
use super::value::{Pose, axes_in_use};
use crate::{Editable, Motion, Reason, Target};
use deflex_text::{Diagnostic, Severity, Span};
use std::collections::{BTreeSet, HashSet};

/// Whether a kind of motion may cut.
fn may_cut(motion: Motion) -> bool {
    matches!(motion, Motion::Linear | Motion::Circular)
}

impl<'a> Runner<'a> {
    /// Notes the numbers that a motion without a target in the result uses.
    pub(super) fn use_aside(&mut self, target: &Target, pose: &Pose) {
        let Some(root) = pose.root.filter(|_| self.mode == Mode::Aside) else { return };
        let offset = pose.steps.last().and_then(|step| step.tokens).map(|tokens| tokens[0]);
        // When this motion runs, other units or axis offsets may be active.
        let on_axes = axes_in_use(&pose.written.external);
        // A target made from a base would move with it, although it stays.
        let moves_along =
            !pose.steps.is_empty() && !self.reached.ran.has(usize::from(target.source), target.span.start);
        if on_axes || moves_along || matches!(self.editable(target, pose), Editable::No(_)) {
            self.numbers.pinned.insert(root);
            self.numbers.held.extend(offset);
            return;
        }
        let cuts = may_cut(target.motion);
        self.reached.aside.push(Use { root, offset, tool: target.tool, wobj: target.wobj, cuts });
    }

    /// Runs the routines that nothing in the files calls, because an operator may run them by hand, and notes the data that they use.
    pub(super) fn look_aside(&mut self, procs: &[RoutineId]) {
        let waits = |id: &&RoutineId| !self.reached.entered.contains(*id) || self.may_be_called_late(**id);
        let waiting: Vec<RoutineId> = procs.iter().filter(waits).copied().collect();
        if waiting.is_empty() || self.budget.is_spent() {
            return;
        }
        self.reached.looking_aside = true;
        self.budget.steps = 0;
        let roots: HashSet<RoutineId> = self.uncalled(&waiting).into_iter().collect();
        let first = waiting.iter().filter(|id| roots.contains(*id));
        let rest = waiting.iter().filter(|id| !roots.contains(*id));
        let order: Vec<RoutineId> = first.chain(rest).copied().collect();
        for id in order {
            if !self.may_be_called_late(id) && self.reached.entered_aside.contains(&id) {
                continue;
            }
            self.forget_what_routines_change();
            self.aside(|this| this.start(id));
        }
        if self.budget.is_spent() {
            // The run was not completed: nothing that it may use is edited.
            let all = u32::try_from(self.numbers.literals.len()).unwrap_or(u32::MAX);
            self.numbers.pinned.extend(0..all);
        }
        self.reached.looking_aside = false;
    }

    /// Sets the state for a routine called at an unknown moment: everything that some routine changes is unknown.
    pub(super) fn forget_what_routines_change(&mut self) {
        let open = |at: &usize| {
            let variable = &self.symbols.variables[*at];
            variable.assigned && variable.storage != Storage::Const
        };
        let changing: Vec<usize> = (0..self.symbols.data).filter(open).collect();
        for at in changing {
            self.forget_data(at, Reason::ByHand);
        }
        let mut anywhere = Switches::NONE;
        self.symbols.all().for_each(|id| anywhere |= self.symbols.changed_by(id).switches);
        self.state.modal = ModalState { mark: self.state.modal.mark, ..ModalState::default() };
        self.state.modal.axes.lose_positions();
        self.state.modal.lose(anywhere);
    }

    /// Forbids edits of numbers used by traps, handlers and functions: they may run at any moment, or their motions are not
    /// followed. The same applies to recursive procedures, whose runs are not all followed.
    pub(super) fn hold_what_runs_aside(&mut self) {
        let followed: HashSet<RoutineId> =
            self.reached.entered.iter().chain(&self.reached.entered_aside).copied().collect();
        let endless = self.reached_without_end();
        let mut done = BTreeSet::new();
        for id in self.symbols.all().collect::<Vec<_>>() {
            let (bytes, routine, module) = (self.bytes(id.file), self.symbols.routine(id), self.symbols.module_of(id));
            // What a context file has, and does not belong to the program, is not followed.
            let is_other = id.file >= self.written && !followed.contains(&id);
            let is_aside = is_other || self.symbols.known.aside.contains(&id) || endless.contains(&id);
            let body = if is_aside { &routine.body[..] } else { &[] };
            let mut parts: Vec<&Expression> = Vec::new();
            for statement in statements(body).into_iter().chain(statements(&routine.handlers)) {
                statement.each(&mut |part| parts.push(part));
            }
            for part in parts {
                #[allow(clippy::cast_possible_truncation)] // as many files as a target's source can number
                let source = id.file as u16;
                self.numbers.pinned.extend(self.numbers.literal_of(source, part));
                if !part.is_name() {
                    continue;
                }
                let key = Upper::new(&bytes[part.span.range()]);
                if !done.insert((id, Box::<[u8]>::from(&*key))) {
                    continue;
                }
                match own_data(routine, bytes, &key) {
                    Some(Some(data)) => {
                        let inside = data.value.iter().flat_map(|value| self.numbers.literals_in(source, value));
                        self.numbers.pinned.extend(inside.collect::<Vec<_>>());
                    }
                    Some(None) => {
                        let given = self.numbers.given.get(&(id, Box::<[u8]>::from(&*key)));
                        self.numbers.pinned.extend(given.into_iter().flatten());
                    }
                    None => {
                        if let Some(at) = self.symbols.find_data(module, &key) {
                            self.pin_read(at);
                        }
                    }
                }
            }
        }
    }

    /// Procedures with endless recursion, and the procedures that they call.
    fn reached_without_end(&self) -> BTreeSet<RoutineId> {
        let mut reached = self.reached.endless.clone();
        let mut waiting: Vec<RoutineId> = reached.iter().copied().collect();
        while let Some(id) = waiting.pop() {
            let calls = self.calls(id, &self.symbols.routine(id).body);
            waiting.extend(calls.filter(|callee| reached.insert(*callee)));
        }
        reached
    }

    /// Refuses the targets of routines with endless recursion.
    pub(super) fn refuse_what_calls_itself(&mut self) {
        let mut places = HashSet::new();
        for id in self.reached_without_end() {
            let body = &self.symbols.routine(id).body;
            places.extend(statements(body).into_iter().map(|statement| (id.file, statement.at.start)));
        }
        for target in &mut self.found.targets {
            let inside = places.contains(&(usize::from(target.source), target.span.start));
            if inside && !matches!(target.editable, Editable::No(_)) {
                target.editable = Editable::No(Reason::RoutineCallsItself);
            }
        }
    }

    /// Forbids edits of numbers that a routine that nothing runs uses in other frames than the program.
    pub(super) fn hold_what_is_used_otherwise(&mut self) {
        if self.reached.aside.is_empty() {
            return;
        }
        let mut uses: std::collections::HashMap<u32, Vec<(u16, u16, bool)>> = std::collections::HashMap::new();
        for (target, site) in self.found.targets.iter().zip(&self.found.sites) {
            if let Some(root) = self.found.root(site) {
                let one = (target.tool, target.wobj, may_cut(target.motion));
                let known = uses.entry(root).or_default();
                if known.last() != Some(&one) && !known.contains(&one) {
                    known.push(one);
                }
            }
        }
        for other in std::mem::take(&mut self.reached.aside) {
            let same = |used: &(u16, u16, bool)| *used == (other.tool, other.wobj, other.cuts);
            if uses.get(&other.root).is_some_and(|used| !used.iter().all(same)) {
                self.numbers.pinned.insert(other.root);
                self.numbers.held.extend(other.offset);
            }
        }
    }

    /// Reports traps that move the robot: after such a trap, the next motion begins where the trap ends.
    pub(super) fn tell_traps_that_move(&mut self) {
        let is_trap = |id: &RoutineId| self.symbols.routine(*id).kind == RoutineKind::Trap;
        for id in self.symbols.all().filter(is_trap).collect::<Vec<_>>() {
            let (mut reached, mut waiting) = (BTreeSet::from([id]), vec![id]);
            while let Some(caller) = waiting.pop() {
                let called = self.calls(caller, &self.symbols.routine(caller).body);
                waiting.extend(called.filter(|callee| reached.insert(*callee)));
            }
            let moves = |id: RoutineId| {
                statements(&self.symbols.routine(id).body).into_iter().any(|statement| self.is_motion(id, statement))
            };
            if !reached.into_iter().any(moves) {
                continue;
            }
            let name = String::from_utf8_lossy(self.routine_name(id)).into_owned();
            let message = format!(
                "trap `{name}` moves the robot: after an interrupt, the next motion may begin at another place than the correction assumes"
            );
            let source = &self.symbols.sources[id.file];
            let note = Diagnostic::error("rapid.trap-moves", "", message).at(source, self.symbols.routine(id).name);
            let help = "let it move back to the interrupted position (StorePath, CRobT, RestoPath) before the program continues";
            self.messages.diagnostics.push(note.severity(Severity::Note).help(help));
        }
    }

    /// Whether a statement is a motion instruction, not a call of a routine with that name.
    fn is_motion(&self, id: RoutineId, statement: &Statement) -> bool {
        statement.call().is_some_and(|call| {
            let name = &self.bytes(id.file)[call.name.range()];
            motion::shape(name).is_some() && self.symbols.find_routine(self.symbols.module_of(id), name).is_none()
        })
    }

    /// Forbids edits of robtargets assembled from parts, unless every run knows the parts and can edit them.
    pub(super) fn hold_what_is_not_always_assembled(&mut self) {
        let held =
            self.numbers.own.iter().filter(|(place, _)| self.numbers.unassembled.contains(place)).map(|(_, id)| *id);
        self.numbers.pinned.extend(held);
    }

    /// Keeps the targets of motions that were not run.
    pub(super) fn keep_what_is_not_run(&mut self) {
        for id in self.symbols.all().filter(|id| id.file < self.written).collect::<Vec<_>>() {
            let routine = self.symbols.routine(id);
            let entered = self.reached.entered.contains(&id);
            let body = match routine.kind {
                RoutineKind::Trap => Reason::InTrap,
                RoutineKind::Func => Reason::InFunction,
                RoutineKind::Proc if !entered => Reason::NotRun,
                RoutineKind::Proc => Reason::NotReached,
            };
            for (block, reason) in [(&routine.body, body), (&routine.handlers, Reason::InErrorHandler)] {
                let idle: Vec<Span> = statements(block)
                    .into_iter()
                    .filter(|statement| {
                        !self.reached.ran.has(id.file, statement.at.start) && self.is_motion(id, statement)
                    })
                    .map(|statement| statement.at)
                    .collect();
                let Some(first) = idle.first() else { continue };
                let name = String::from_utf8_lossy(self.routine_name(id)).into_owned();
                let message = format!("{} of `{name}` left as they are: {reason}", motions(idle.len()));
                let note = Diagnostic::error("rapid.not-run", "", message).at(&self.symbols.sources[id.file], *first);
                self.messages.diagnostics.push(note.severity(Severity::Note));
                idle.iter().for_each(|span| self.messages.kept.keep(id.file, *span, reason));
            }
        }
    }
}

fn motions(count: usize) -> String {
    if count == 1 { "1 motion".to_owned() } else { format!("{count} motions") }
}

/// The declaration of a name of a routine; inner `None` for a parameter, outer `None` for other names.
fn own_data<'r>(routine: &'r Routine, bytes: &[u8], key: &[u8]) -> Option<Option<&'r Data>> {
    let is = |span: Span| *Upper::new(&bytes[span.range()]) == *key;
    let data = routine.data.iter().find(|data| is(data.name)).map(Some);
    data.or_else(|| routine.params.iter().any(|param| is(param.name)).then_some(None))
}
