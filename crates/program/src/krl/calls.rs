//! Assignments, calls, and the start values of data lists.

use super::eval::VariablePath;
use super::expression::{Call, Expression, PathStep, Setting};
use super::names;
use super::run::{MAX_CALLS, Runner};
use super::state::Changes;
use super::symbols::{
    APPROXIMATION, BASE, BASE_NAME, Id, OVERRIDE, POSITION, RoutineId, STANDS, Symbols, TOOL, TOOL_NAME,
};
use super::tree::{Param, Started, Statement, StatementKind};
use super::value::{Name, Value};
use crate::Reason;
use deflex_lang::walk::Stop;
use std::collections::{BTreeSet, HashMap, HashSet};

/// An argument of a call: its value, and the variable that has it.
pub(super) struct Argument<'e> {
    pub(super) value: Value,
    pub(super) path: Option<VariablePath<'e>>,
}

impl<'a> Runner<'a> {
    /// Declares the data of all files, with their start values from the text.
    pub(super) fn declare(&mut self) {
        for file in 0..self.symbols.files.len() {
            self.symbols.declare(file);
        }
        for file in 0..self.symbols.files.len() {
            let found = &self.symbols.files[file];
            // Names are resolved as in a routine of the file.
            self.frames.push(super::run::Frame::of_file(file));
            for data in &found.data {
                let Some(value) = &data.value else { continue };
                let id = self.symbols.find(file, &data.name);
                let value = self.expression(value);
                self.symbols.start[id] = value;
            }
            for (Setting { to, value }, span) in &found.values {
                let path = self.place(to);
                if path.known {
                    let value = self.expression(value);
                    let mut whole = std::mem::replace(&mut self.symbols.start[path.id], Value::Bool(false));
                    self.put(&mut whole, &path.steps, value);
                    self.symbols.start[path.id] = whole;
                } else {
                    self.keep(file, *span, Reason::NotUnderstood);
                }
            }
            self.frames.pop();
        }
        self.forget_what_lasts();
    }

    /// Data of data lists that the program assigns are unknown at the start, because they keep their values from the last run. So do the
    /// elements of the controller's tables of frames that it assigns.
    fn forget_what_lasts(&mut self) {
        let mut changes = Changes::default();
        // The effects of the routines in BAS.SRC are known.
        for id in self.symbols.all().filter(|id| !self.symbols.is_bas(id.file)).collect::<Vec<_>>() {
            self.changes_of(id, &mut changes);
        }
        if changes.ids.contains(&OVERRIDE) && self.sets_another_override() {
            self.symbols.start[OVERRIDE] = Value::unknown(Reason::LastRun);
        }
        let lasts = |id: &Id| !Symbols::is_own_state(*id);
        let changed: Vec<Id> = changes.all_ids().filter(lasts).collect();
        let (tables, wholes): (Vec<Id>, Vec<Id>) = changed.into_iter().partition(|id| self.symbols.is_table(*id));
        let wholes = wholes.into_iter().filter(|id| changes.ids.contains(id));
        let parts: Vec<_> =
            changes.components.into_iter().filter(|(id, _)| lasts(id) && !tables.contains(id)).collect();
        let elements = self.assigned_elements();
        for id in tables {
            match elements.get(&id) {
                Some(Some(own)) => {
                    own.iter().for_each(|at| self.symbols.start[id].forget_element(*at, Reason::LastRun))
                }
                _ => self.symbols.start[id].forget_all(Reason::LastRun),
            }
        }
        for id in wholes {
            self.symbols.start[id].forget_parts(Reason::LastRun);
        }
        for (id, component) in parts {
            self.symbols.start[id].forget_component(&component, Reason::LastRun);
        }
    }

    /// Whether the program sets `$OV_PRO` to anything other than 100 %, with which the first cycle begins.
    fn sets_another_override(&self) -> bool {
        let is_full = |value: &Expression| matches!(value, Expression::Known(value) if value.number() == Some(100.0));
        self.symbols.all().filter(|id| !self.symbols.is_bas(id.file)).any(|id| {
            let mut all = self.symbols.routine(id).statements().into_iter().flat_map(Statement::with_started);
            all.any(|statement| {
                let assigned = match &statement.kind {
                    StatementKind::Assign(setting) => {
                        Some(setting).filter(|setting| setting.to.name[..] == *b"$OV_PRO")
                    }
                    _ => None,
                };
                let called = statement.calls().into_iter().filter(|call| call.name[..] == *b"BAS");
                let mut called = called.filter_map(|call| match &call.arguments[..] {
                    [Some(Expression::Known(Value::Constant(command))), rest @ ..] if **command == *b"OV_PRO" => {
                        Some(matches!(rest, [Some(percent)] if is_full(percent)))
                    }
                    _ => None,
                });
                assigned.is_some_and(|setting| !is_full(&setting.value)) || called.any(|is_full| !is_full)
            })
        })
    }

    /// The elements of each of the controller's tables that the program assigns; `None` if it may assign any.
    fn assigned_elements(&mut self) -> HashMap<Id, Option<BTreeSet<i64>>> {
        let mut found: HashMap<Id, Option<BTreeSet<i64>>> = HashMap::new();
        let routines: Vec<RoutineId> = self.symbols.all().collect();
        let of =
            |id: RoutineId| self.symbols.routine(id).statements().into_iter().map(move |statement| (id, statement));
        for (id, statement) in routines.into_iter().flat_map(of).collect::<Vec<_>>() {
            for statement in statement.with_started() {
                // A routine may assign what it is lent.
                for call in statement.calls() {
                    let called = self.symbols.find_routine(id.file, &call.name);
                    let is_assigned =
                        |at| called.is_none_or(|called| self.assigns_parameter(called, at, &mut HashSet::new()));
                    let lent: Vec<&Name> =
                        call.variables().filter(|(at, _)| is_assigned(*at)).map(|(_, name)| name).collect();
                    lent.into_iter().for_each(|name| drop(found.insert(self.symbols.find(id.file, name), None)));
                }
                let StatementKind::Assign(setting) = &statement.kind else { continue };
                let element = match setting.to.steps.first() {
                    Some(PathStep::Index(at)) => match &at[..] {
                        [Expression::Known(at)] => at.index(),
                        _ => None,
                    },
                    _ => None,
                };
                let own = found.entry(self.symbols.find(id.file, &setting.to.name)).or_insert(Some(BTreeSet::new()));
                *own = own.take().zip(element).map(|(mut own, at)| {
                    own.insert(at);
                    own
                });
            }
        }
        found
    }

    /// `name … = expression`
    pub(super) fn assignment(&mut self, Setting { to, value }: &Setting) {
        let place = self.place(to);
        let is_frame = place.id == BASE || place.id == TOOL;
        let source = if is_frame { self.label(value) } else { None };
        let value = self.expression(value);
        self.assign(&place, value, source);
    }

    /// Assigns a value. Base and tool also get the name of the frame that is assigned.
    pub(super) fn assign(&mut self, path: &VariablePath<'_>, value: Value, source: Option<String>) {
        let is_followed =
            names::SETTLED.contains(&&path.name[..]) || names::MODELLED_SYSTEM_VARIABLES.contains(&&path.name[..]);
        if path.name.first() == Some(&b'$') && !is_followed {
            self.pin(&value);
            if matches!(&path.name[..], b"$ROBROOT" | b"$ERSYSROOT") {
                self.state.loosen([BASE]);
            }
            return;
        }
        if matches!(&path.name[..], b"$NULLFRAME" | b"$WORLD") {
            self.state.loosen([BASE, TOOL]);
        }
        let is_frame = path.id == BASE || path.id == TOOL;
        // The numbers of a frame or a zone must not be edited. Neither must numbers in data that handlers read, or that may change at any
        // moment, because deflex does not follow all uses of such data.
        let is_read = is_frame || path.id == APPROXIMATION;
        if is_read || self.is_volatile(path.id) || self.read_at_any_moment.contains(&path.id) {
            self.pin(&value);
        }
        let tokens = value.tokens();
        if !tokens.is_empty() {
            self.given.entry(path.id).or_default().extend(tokens);
        }
        let value = self.symbols.converted(path.id, &path.steps, value);
        // The value is taken out of the map, so that an element can be set without a copy.
        let mut whole = self.state.values.remove(&path.id).unwrap_or_else(|| self.symbols.start[path.id].clone());
        if path.known {
            let fits = !self.symbols.is_whole(path.id) || value.number().is_none_or(|v| v.fract() == 0.0);
            let value = if fits { value } else { value.forgotten(Reason::Computed) };
            self.put(&mut whole, &path.steps, value);
        } else {
            self.pin(&value);
            whole = whole.forgotten(Reason::ElementUnknown);
        }
        self.state.values.insert(path.id, whole);
        if is_frame {
            self.name_frame(path.id, source.filter(|_| path.steps.is_empty()));
        }
    }

    /// Records that another base or tool is in force, and its name.
    pub(super) fn name_frame(&mut self, id: Id, name: Option<String>) {
        let (names, own) = if id == BASE { (BASE_NAME, "$BASE") } else { (TOOL_NAME, "$TOOL") };
        let name = Value::Own(name.as_deref().unwrap_or(own).into());
        self.state.values.insert(names, name);
        self.leave_frame();
    }

    /// Makes the last position unknown, because its numbers are different in another frame. They still depend on those of the motion
    /// before.
    pub(super) fn leave_frame(&mut self) {
        self.lose(POSITION, Reason::BeforeInOtherFrame);
    }

    pub(super) fn arguments<'e>(&mut self, call: &'e Call) -> Vec<Argument<'e>> {
        let mut out = Vec::new();
        for given in &call.arguments {
            let path = if let Some(Expression::Path(path)) = given { Some(self.place(path)) } else { None };
            let value = match (given, &path) {
                (_, Some(path)) => self.read(path),
                (Some(given), None) => self.expression(given),
                (None, None) => Value::unknown(Reason::ArgumentMissing),
            };
            out.push(Argument { value, path });
        }
        out
    }

    /// The value of a function. Data that the function could change are unknown after it.
    pub(super) fn function(&mut self, call: &Call) -> Value {
        let (name, arguments) = (&call.name, self.arguments(call));
        if let Some(id) = self.symbols.find_routine(self.here(), name) {
            let changes = self.known_changes(id);
            self.run_unfollowed(&changes, Reason::ByFunction);
            self.give_away(&arguments, true);
            return Value::unknown(Reason::FunctionValue);
        }
        let first = arguments.first().map(|argument| argument.value.clone());
        if names::is_frame_function(name) {
            return self.frame_function(name, first);
        }
        let starts = first.as_ref().and_then(Value::index) == Some(1);
        let mut changes = Changes::default();
        let changed = self.add_system(name, starts, &mut changes);
        self.give_away(&arguments, changed);
        if changes.anything {
            self.report_unknown(name, call.rest);
        }
        self.forget(&changes, Reason::Foreign);
        let number = first.and_then(|value| value.number());
        let computed = match (&name[..], number) {
            (b"ABS", Some(v)) => v.abs(),
            (b"SIN", Some(v)) => v.to_radians().sin(),
            (b"COS", Some(v)) => v.to_radians().cos(),
            (b"TAN", Some(v)) => v.to_radians().tan(),
            (b"SQRT", Some(v)) if v >= 0.0 => v.sqrt(),
            _ => f64::NAN,
        };
        if computed.is_finite() { Value::Number(computed, None) } else { Value::unknown(Reason::Computed) }
    }

    /// Applies the changes of a routine that is not followed. Its first motion may take components from the motion before.
    fn run_unfollowed(&mut self, changes: &Changes, why: Reason) {
        if changes.ids.contains(&STANDS) {
            self.hold_position_before();
        }
        self.forget(changes, why);
    }

    /// Handles the arguments of a routine that is not followed: it may read them, and change those that are variables.
    fn give_away(&mut self, arguments: &[Argument<'_>], changed: bool) {
        for argument in arguments {
            self.pin(&argument.value);
            if let (Some(path), true) = (&argument.path, changed) {
                self.lose(path.id, Reason::ByReceiver);
            }
        }
    }

    pub(super) fn call(&mut self, call: &Call, statement: &Statement) -> Result<(), Stop> {
        if &call.name[..] == b"BAS" {
            let arguments = self.arguments(call);
            self.bas(&arguments);
            return Ok(());
        }
        let Some(id) = self.symbols.find_routine(self.here(), &call.name) else {
            drop(self.function(call));
            return Ok(());
        };
        let arguments = self.arguments(call);
        let around = self.frames.iter().filter(|frame| frame.routine == id).count();
        if around > 0 || self.symbols.routine(id).is_function {
            // It is not followed, so its targets are kept.
            self.keep(self.here(), statement.at, Reason::RoutineCallsItself);
            let changes = self.known_changes(id);
            self.run_unfollowed(&changes, Reason::ByRecursiveRoutine);
            self.give_away(&arguments, true);
            return Ok(());
        }
        if self.frames.len() >= MAX_CALLS {
            return self.give_up(statement.at);
        }
        self.within(std::ptr::from_ref(statement).addr(), |runner| runner.follow(id, &arguments))
    }

    /// Runs a routine with copies of its arguments, and copies the parameters that are `:OUT` back.
    fn follow(&mut self, id: RoutineId, arguments: &[Argument<'_>]) -> Result<(), Stop> {
        let params: &'a [Param] = &self.symbols.routine(id).params;
        // A routine of `[controller] harmless` is declared without parameters, but may get arguments.
        self.give_away(arguments.get(params.len()..).unwrap_or_default(), true);
        let values: Vec<Value> = arguments.iter().map(|argument| argument.value.clone()).collect();
        let lent = |i: usize| arguments.get(i).and_then(|a| a.path.as_ref()).filter(|_| params[i].is_out);
        let changes = self.known_changes(id);
        let aliased: Vec<bool> = (0..params.len()).map(|i| self.is_aliased(i, params.len(), &changes, &lent)).collect();
        let volatile = self.volatile.clone();
        self.volatile.extend((0..params.len()).filter(|i| aliased[*i]).filter_map(lent).map(|path| path.id));
        // During the call, the value of a variable given to `:OUT` is that of the parameter.
        let mut held = Vec::new();
        for path in (0..params.len()).filter_map(lent) {
            held.push((path.id, self.value(path.id)));
            self.lose(path.id, Reason::LentToParameter);
        }
        // If an interrupt may end it half-way, the statements after the call run even if the routine itself has no end.
        let before = self.resumes.then(|| self.state.clone());
        let ended = self.enter(id, &values, &aliased);
        if let (Err(Stop::Ends), Some(before)) = (&ended, before) {
            self.state = before;
            self.state.loosen(changes.all_ids());
        }
        let left = match ended {
            Err(Stop::Ends) if self.resumes => Vec::new(),
            ended => ended.inspect_err(|_| self.volatile.clone_from(&volatile))?,
        };
        // A TRIGGER may still change the parameter, which is the caller's variable.
        let late = (0..params.len()).filter(|i| left.get(*i).is_some_and(|left| left.is_triggered)).filter_map(lent);
        self.state.loosen(late.map(|path| path.id));
        self.volatile = volatile;
        for (id, value) in held {
            self.state.values.insert(id, value);
        }
        for i in 0..params.len() {
            let Some(path) = lent(i).cloned() else { continue };
            if aliased[i] || self.resumes {
                self.lose(path.id, Reason::UnderTwoNames);
            } else if let Some(left) = left.get(i) {
                self.assign(&path, left.value.clone(), None);
            }
        }
        if self.resumes {
            self.forget(&changes, Reason::Resume);
        }
        Ok(())
    }

    /// Whether the routine can reach the variable of a parameter under another name: as a global variable, or as another parameter.
    fn is_aliased<'p>(
        &self,
        param: usize,
        params: usize,
        changes: &Changes,
        lent: &impl Fn(usize) -> Option<&'p VariablePath<'p>>,
    ) -> bool {
        let Some(path) = lent(param) else { return false };
        let twice = (0..params).any(|other| other != param && lent(other).is_some_and(|other| other.id == path.id));
        twice || self.changed_ids(changes).contains(&path.id)
    }

    /// Handles a TRIGGER, which starts something at an unknown moment. The data that it changes are unknown from here on.
    pub(super) fn trigger(&mut self, started: &'a Started) {
        let Some(run) = &started.run else { return };
        match &run.kind {
            StatementKind::Call(call) => {
                let arguments = self.arguments(call);
                self.give_away(&arguments, true);
            }
            StatementKind::Assign(setting) => {
                drop(self.place(&setting.to));
                drop(self.evaluate(&setting.value));
            }
            _ => run.expressions().into_iter().for_each(|part| drop(self.evaluate(part))),
        }
        let changes = self.changes_in(std::slice::from_ref(run));
        if changes.anything {
            self.report_started(run);
        }
        self.state.loosen(self.changed_ids(&changes));
    }
}
