//! Finds the data that statements could change, without running the statements.

use super::expression::{Call, Expression, ExpressionPart, Path, PathStep, Setting};
use super::names;
use super::run::Runner;
use super::state::Changes;
use super::symbols::{
    APPROXIMATION, BASE, BASE_NAME, CIRCLE_TYPE, Id, LOAD, MARK, MODE, ORIENTATION, OVERRIDE, POSITION, RoutineId,
    SPEED, STANDS, TOOL, TOOL_NAME, TURNED,
};
use super::system::{System, system};
use super::tree::{File, Statement, StatementKind, walk};
use super::value::{Name, POSE, Value, upper};
use crate::Reason;
use deflex_text::{Diagnostic, Severity, Span, decode};
use std::collections::{BTreeSet, HashMap, HashSet};
use std::rc::Rc;

/// The scope in which the names of statements are resolved.
struct Scope<'n> {
    file: usize,
    own: Option<&'n HashMap<Name, Id>>,
    /// Names of a routine that is not followed. Its own data do not outlive it, so their changes do not matter.
    hidden: HashSet<&'n Name>,
    /// Whether an interrupt starts the statement.
    is_handler: bool,
}

/// The data that change with base and tool: the position before, which is in their frame, too.
const BASE_CHANGES: &[Id] = &[BASE, BASE_NAME, POSITION];
const TOOL_CHANGES: &[Id] = &[TOOL, TOOL_NAME, POSITION];
const FRAMES_CHANGE: &[Id] = &[BASE, BASE_NAME, TOOL, TOOL_NAME, POSITION];

/// Number of statements that are scanned in about the time in which one is run.
const STATEMENTS_PER_STEP: usize = 8;

impl<'a> Runner<'a> {
    /// The data that a block of the running routine could change.
    pub(super) fn changes_in(&mut self, block: &'a [Statement]) -> Changes {
        let mut changes = Changes::default();
        let own = self.frames.last().map(|frame| frame.names.clone());
        let scope = Scope { file: self.here(), own: own.as_ref(), hidden: HashSet::new(), is_handler: false };
        self.collect(block, &scope, &mut changes);
        changes
    }

    /// Adds the data that a routine could change.
    pub(super) fn changes_of(&mut self, id: RoutineId, changes: &mut Changes) {
        if !changes.through.insert(id) {
            return;
        }
        let routine = self.symbols.routine(id);
        let hidden = routine.own_names().collect();
        self.collect(&routine.body, &Scope { file: id.file, own: None, hidden, is_handler: false }, changes);
    }

    /// The data that a routine could change; computed once for each routine.
    pub(super) fn known_changes(&mut self, id: RoutineId) -> Rc<Changes> {
        if let Some(known) = self.changes.get(&id) {
            return known.clone();
        }
        let mut changes = Changes::default();
        self.changes_of(id, &mut changes);
        self.changes.entry(id).or_insert(Rc::new(changes)).clone()
    }

    fn collect(&mut self, block: &'a [Statement], scope: &Scope<'_>, changes: &mut Changes) {
        let mut count = 0;
        walk(block, &mut |statement| {
            count += 1;
            self.collect_statement(statement, scope, changes);
        });
        // A loop is scanned each time it begins.
        self.steps += count / STATEMENTS_PER_STEP;
    }

    fn changed(&mut self, name: &Name, scope: &Scope<'_>, changes: &mut Changes) {
        changes.ids.extend(self.found(name, scope));
        Self::frames_follow(name, changes);
    }

    /// The variable of a name; `None` for data of a routine that is not followed.
    fn found(&mut self, name: &Name, scope: &Scope<'_>) -> Option<Id> {
        let own = scope.own.and_then(|own| own.get(name)).copied();
        own.or_else(|| (!scope.hidden.contains(name)).then(|| self.symbols.find(scope.file, name)))
    }

    /// Adds base and tool if they depend on the variable of this name.
    fn frames_follow(name: &Name, changes: &mut Changes) {
        // Base and tool also change when the frame changes from which they are counted.
        changes.ids.extend(match &name[..] {
            b"$BASE" | b"$ROBROOT" | b"$ERSYSROOT" => BASE_CHANGES,
            b"$TOOL" => TOOL_CHANGES,
            b"$NULLFRAME" | b"$WORLD" => FRAMES_CHANGE,
            _ => &[],
        });
    }

    /// Adds the data that a routine may change of which no file has the text. `starts` is true if its first argument is 1, or if an
    /// interrupt starts it. Returns whether it may also change the variables in its arguments.
    pub(super) fn add_system(&mut self, name: &[u8], starts: bool, changes: &mut Changes) -> bool {
        match system(name) {
            _ if names::is_frame_function(name) => {}
            Some(System::Data(data)) => {
                let here = self.here();
                changes.ids.extend(data.iter().map(|name| self.symbols.find(here, &upper(name.as_bytes()))));
            }
            Some(System::TouchSense) | None => changes.anything |= gives_away(name, starts),
            Some(System::Nothing | System::Arguments) => {}
        }
        gives_away(name, starts)
    }

    fn collect_statement(&mut self, statement: &'a Statement, scope: &Scope<'_>, changes: &mut Changes) {
        if statement.is_motion() {
            changes.ids.extend([POSITION, TURNED, STANDS]);
        }
        match &statement.kind {
            StatementKind::Trigger(started) => {
                let run = started.run.iter();
                return run.for_each(|run| self.collect_statement(run, scope, changes));
            }
            StatementKind::Interrupt(_) => return,
            StatementKind::WaitFor(_) => {
                let names = statement.names().into_iter().filter(|name| name.first() != Some(&b'$'));
                names.for_each(|name| self.changed(name, scope, changes));
            }
            StatementKind::Mark(_) => drop(changes.ids.insert(MARK)),
            StatementKind::TimeBlock(_) => drop(changes.ids.insert(SPEED)),
            StatementKind::NotUnderstood(_) => {
                changes.anything = true;
                statement.names().into_iter().for_each(|name| self.changed(name, scope, changes));
            }
            _ => {}
        }
        let is_assignment = matches!(statement.kind, StatementKind::Assign(_));
        for Setting { to, .. } in statement.settings() {
            // Settings of the controller in WITH are restored after the statement.
            if !is_assignment && to.name.first() == Some(&b'$') {
                continue;
            }
            let component = to.steps.iter().find_map(|step| match step {
                PathStep::Component(name, _) => Some(name),
                PathStep::Index(_) => None,
            });
            match component {
                Some(component) => {
                    let part = self.found(&to.name, scope).map(|id| (id, component.clone()));
                    changes.components.extend(part);
                    Self::frames_follow(&to.name, changes);
                }
                None => self.changed(&to.name, scope, changes),
            }
        }
        for call in statement.calls() {
            self.collect_call(call, scope, changes);
        }
    }

    fn collect_call(&mut self, call: &'a Call, scope: &Scope<'_>, changes: &mut Changes) {
        let first = call.arguments.first().and_then(Option::as_ref);
        if &call.name[..] == b"BAS" {
            let command: &[u8] = match first {
                Some(Expression::Known(Value::Constant(command))) => command,
                _ => b"",
            };
            if !names::KEEPS_APPROXIMATION.contains(&command) {
                changes.ids.insert(APPROXIMATION);
            }
            if command == b"VEL_CP" {
                changes.ids.insert(SPEED);
            } else if command == b"OV_PRO" {
                changes.ids.insert(OVERRIDE);
            } else if command == b"CP_DAT" {
                changes.ids.extend([SPEED, ORIENTATION, CIRCLE_TYPE]);
            } else if !names::HARMLESS_COMMANDS.contains(&command) {
                changes.ids.extend(match command {
                    b"BASE" => BASE_CHANGES,
                    b"TOOL" => TOOL_CHANGES,
                    _ => FRAMES_CHANGE,
                });
                changes.ids.extend([LOAD, SPEED, MODE, ORIENTATION, CIRCLE_TYPE]);
                if command == b"INITMOV" {
                    names::CORRECTIONS.iter().flatten().for_each(|name| self.changed(&upper(name), scope, changes));
                }
            }
            return;
        }
        let lent: Vec<&Name> = match self.symbols.find_routine(scope.file, &call.name) {
            Some(id) => {
                self.changes_of(id, changes);
                let assigned = call.variables().filter(|(at, _)| self.assigns_parameter(id, *at, &mut HashSet::new()));
                assigned.map(|(_, name)| name).collect()
            }
            None => {
                let starts = matches!(first, Some(Expression::Known(value)) if value.index() == Some(1));
                let is_given_away = self.add_system(&call.name, starts || scope.is_handler, changes);
                call.variables().filter(|_| is_given_away).map(|(_, name)| name).collect()
            }
        };
        lent.into_iter().for_each(|name| self.changed(name, scope, changes));
    }

    /// Whether a routine may assign the variable that is passed for a parameter. A copy is all that a parameter with `:IN` gets. `seen` has the
    /// parameters that were looked at before.
    pub(super) fn assigns_parameter(&self, id: RoutineId, at: usize, seen: &mut HashSet<(RoutineId, usize)>) -> bool {
        let routine = self.symbols.routine(id);
        let Some(parameter) = routine.params.get(at) else { return true };
        if !parameter.is_out || !seen.insert((id, at)) {
            return false;
        }
        let name = &parameter.name;
        let mut all = routine.statements().into_iter().flat_map(Statement::with_started);
        all.any(|statement| self.assigns(id, statement, name, seen))
    }

    /// Whether a statement of a routine may assign the variable of a parameter with this name.
    fn assigns(
        &self,
        id: RoutineId,
        statement: &Statement,
        name: &Name,
        seen: &mut HashSet<(RoutineId, usize)>,
    ) -> bool {
        let is_elsewhere = matches!(statement.kind, StatementKind::NotUnderstood(_) | StatementKind::WaitFor(_));
        is_elsewhere && statement.names().contains(&name)
            || statement.settings().iter().any(|setting| setting.to.name == *name)
            || statement.calls().into_iter().any(|call| {
                let called = self.symbols.find_routine(id.file, &call.name);
                call.variables().filter(|(_, given)| *given == name).any(|(at, _)| match called {
                    Some(called) => self.assigns_parameter(called, at, seen),
                    None => call.name[..] != *b"BAS" && gives_away(&call.name, false),
                })
            })
    }

    /// The program waits until a condition holds: if it does not hold yet, something else changes the data that it names.
    pub(super) fn wait_for(&mut self, condition: &Expression) {
        let mut names = Vec::new();
        condition.each(&mut |part| {
            names.extend(if let ExpressionPart::Path(path) = part { Some(&path.name) } else { None });
        });
        let own = names.into_iter().filter(|name| name.first() != Some(&b'$'));
        let changes = Changes { ids: own.map(|name| self.resolve(name)).collect(), ..Changes::default() };
        self.forget(&changes, Reason::WaitedFor);
    }

    /// Makes all data unknown that may have changed.
    pub(super) fn forget(&mut self, changes: &Changes, why: Reason) {
        for id in self.changed_ids(changes) {
            if self.symbols.is_table(id) {
                let mut value = self.value(id);
                value.forget_all(why);
                self.state.values.insert(id, value);
            } else {
                self.lose(id, why);
            }
        }
    }

    /// The variables that may have changed.
    pub(super) fn changed_ids(&self, changes: &Changes) -> BTreeSet<Id> {
        let all = if changes.anything { self.symbols.visible() } else { Vec::new() };
        changes.all_ids().chain(all).collect()
    }

    /// Whether the value of an expression may depend on the changes.
    pub(super) fn depends(&mut self, on: &Expression, changes: &Changes) -> bool {
        let (mut found, changed) = (false, self.changed_ids(changes));
        on.each(&mut |part| {
            found |= match part {
                ExpressionPart::Path(path) => {
                    path.name.first() == Some(&b'$') || changed.contains(&self.resolve(&path.name))
                }
                ExpressionPart::Call(_) => true,
                ExpressionPart::Other(_) => false,
            }
        });
        found
    }

    /// Scans the routines that interrupts start. They may run at any moment, so the data that they change are never known.
    pub(super) fn expect_interrupts(&mut self) {
        // What a file imports may change under another name.
        let files: &'a [File] = self.symbols.files;
        let imports = files.iter().flat_map(|file| &file.imports);
        let imported: Vec<Id> = imports.filter_map(|(module, name)| self.symbols.imported(module, name)).collect();
        self.volatile.extend(imported);
        for id in self.symbols.all() {
            for statement in self.symbols.routine(id).statements() {
                let StatementKind::Interrupt(started) = &statement.kind else { continue };
                let Some(run) = &started.run else { continue };
                let mut changes = Changes::default();
                let scope = Scope { file: id.file, own: None, hidden: HashSet::new(), is_handler: true };
                self.collect_statement(run, &scope, &mut changes);
                let is_here = |call: &Call| self.symbols.find_routine(id.file, &call.name).is_some();
                let is_followed = matches!(&run.kind, StatementKind::Call(call) if is_here(call));
                if changes.anything && !is_followed {
                    self.frames.push(super::run::Frame::of_file(id.file));
                    self.report_started(run);
                    self.frames.pop();
                }
                self.volatile.extend(self.changed_ids(&changes));
            }
        }
    }

    /// Finds handlers, functions (which are not followed) and routines that call themselves, with everything that they call. The data that
    /// they name must not be edited.
    pub(super) fn find_what_runs_at_any_moment(&mut self) {
        let mut handlers = Vec::new();
        for id in self.symbols.all() {
            if self.symbols.routine(id).is_function {
                self.at_any_moment.insert(id);
            }
            for statement in self.symbols.routine(id).statements() {
                self.resumes |= matches!(statement.kind, StatementKind::Resume);
                for call in statement.calls() {
                    let Some(called) = self.symbols.find_routine(id.file, &call.name) else { continue };
                    match statement.kind {
                        StatementKind::Interrupt(_) => {
                            self.at_any_moment.insert(called);
                            handlers.push((called, id.file, call.at()));
                        }
                        StatementKind::Trigger(_) => drop(self.at_any_moment.insert(called)),
                        _ => drop(self.calls.entry(id).or_default().insert(called)),
                    }
                }
            }
        }
        // Other programs may call a GLOBAL routine that nothing in the files calls.
        let called: BTreeSet<RoutineId> = self.calls.values().flatten().copied().collect();
        let is_for_others = |id: &RoutineId| self.symbols.routine(*id).is_global && id.at > 0 && !called.contains(id);
        let reached: Vec<RoutineId> =
            self.symbols.all().filter(is_for_others).flat_map(|id| self.called_from(id)).collect();
        self.at_any_moment.extend(reached);
        for (handler, file, span) in handlers {
            let moves = |id: RoutineId| self.symbols.routine(id).statements().into_iter().any(Statement::is_motion);
            if self.called_from(handler).into_iter().chain([handler]).any(moves) {
                self.report_interrupt_that_moves(handler, file, span);
            }
        }
        for id in self.symbols.all() {
            let called = self.called_from(id);
            if called.contains(&id) {
                self.at_any_moment.insert(id);
            }
            if self.at_any_moment.contains(&id) {
                self.at_any_moment.extend(called);
            }
        }
        for id in self.at_any_moment.iter().copied().collect::<Vec<_>>() {
            let named = self.pin_names(id);
            self.read_at_any_moment.extend(named);
        }
    }

    /// The routines that a routine calls, directly or through others.
    fn called_from(&self, from: RoutineId) -> BTreeSet<RoutineId> {
        let (mut found, mut open) = (BTreeSet::new(), vec![from]);
        while let Some(id) = open.pop() {
            open.extend(self.calls.get(&id).into_iter().flatten().filter(|called| found.insert(**called)));
        }
        found
    }

    /// Files and starts of the statements in routines that also run at a moment, or from a caller, that the run of the program does not
    /// follow: handlers, functions, and those that other programs or an operator may start, with all that they call.
    pub(super) fn statements_that_run_elsewhere(&self) -> HashSet<(u16, u32)> {
        let is_elsewhere = |id: &RoutineId| self.at_any_moment.contains(id) || !self.entered.contains(id);
        let from = self.symbols.all().filter(is_elsewhere);
        let all: BTreeSet<RoutineId> = from.flat_map(|id| self.called_from(id).into_iter().chain([id])).collect();
        #[allow(clippy::cast_possible_truncation)] // as a target has it
        let starts = |id: RoutineId| {
            let statements = self.symbols.routine(id).statements().into_iter();
            statements.map(move |statement| (id.file as u16, statement.at.start))
        };
        all.into_iter().flat_map(starts).collect()
    }

    /// Whether the program assigns positions without some components. A motion to such a position takes these components from the motion
    /// before.
    pub(super) fn finds_incomplete_positions(&mut self) -> bool {
        let files: &'a [File] = self.symbols.files;
        let in_lists = files.iter().enumerate().any(|(at, file)| {
            let set = file.values.iter().map(|(setting, _)| &setting.value);
            let mut all = file.data.iter().filter_map(|data| data.value.as_ref()).chain(set);
            let mut parts = file.values.iter().map(|(setting, _)| &setting.to);
            all.any(Expression::leaves_components_out) || parts.any(|to| self.sets_a_component(at, to, &HashSet::new()))
        });
        in_lists || self.symbols.all().any(|id| self.leaves_components_out_in(id))
    }

    /// Whether a component is assigned to a position that may lack other components.
    fn sets_a_component(&mut self, file: usize, to: &Path, own: &HashSet<&Name>) -> bool {
        let is_part = to.component().is_some_and(|part| POSE.contains(&&part[..]));
        let at = self.symbols.find(file, &to.name);
        is_part && to.name.first() != Some(&b'$') && (own.contains(&to.name) || !is_complete(&self.symbols.start[at]))
    }

    fn leaves_components_out_in(&mut self, id: RoutineId) -> bool {
        let own: HashSet<&Name> = self.symbols.routine(id).own_names().collect();
        self.symbols.routine(id).statements().into_iter().any(|statement| {
            let statement = match &statement.kind {
                StatementKind::Trigger(started) | StatementKind::Interrupt(started) => started.run.as_ref(),
                _ => Some(statement),
            };
            let Some(statement) = statement else { return false };
            let is = if statement.is_motion() {
                Expression::gives_components_out
            } else {
                Expression::leaves_components_out
            };
            let leaves_out = statement.expressions().into_iter().any(is);
            let StatementKind::Assign(setting) = &statement.kind else { return leaves_out };
            leaves_out || self.sets_a_component(id.file, &setting.to, &own)
        })
    }

    /// Notes that the motion after an interrupt begins where the interrupt's routine leaves the robot.
    fn report_interrupt_that_moves(&mut self, handler: RoutineId, file: usize, span: Span) {
        let name = &self.symbols.routine(handler).name;
        let message = format!(
            "`{}` moves the robot: after an interrupt, the next motion may begin at another place than the correction assumes",
            decode(name)
        );
        let source = &self.symbols.sources[file];
        let note = Diagnostic::error("krl.interrupt-moves", &source.name, message).severity(Severity::Note);
        let help = "let it move back to $POS_INT before the program continues";
        self.report(note.help(help), file, Some(span));
    }

    /// Marks the start values of all data that a routine names as not editable. Returns these data.
    pub(super) fn pin_names(&mut self, id: RoutineId) -> HashSet<Id> {
        let mut named = HashSet::new();
        let routine = self.symbols.routine(id);
        let mut done: HashSet<&Name> = routine.data.iter().map(|data| &data.name).collect();
        for name in routine.statements().into_iter().flat_map(Statement::names).filter(|name| done.insert(name)) {
            let at = self.symbols.find(id.file, name);
            let value = self.symbols.start.get(at).cloned().unwrap_or(Value::Bool(false));
            self.pin(&value);
            self.read_later.insert(at);
            named.insert(at);
        }
        named
    }
}

/// Whether data hold only positions, each with all components.
fn is_complete(value: &Value) -> bool {
    match value {
        Value::Array(items) => !items.is_empty() && items.values().all(is_complete),
        value => POSE.iter().all(|name| value.component(name).is_some()),
    }
}

/// Whether a routine of which no file has the text may change the variables in its arguments. `starts` as in [`Runner::add_system`].
fn gives_away(name: &[u8], starts: bool) -> bool {
    match system(name) {
        _ if names::is_frame_function(name) => false,
        Some(System::Nothing | System::Data(_)) => false,
        Some(System::TouchSense) => !starts,
        Some(System::Arguments) | None => true,
    }
}
