//! Assignments, calls, and the start values of data lists.

use super::eval::Path;
use super::lex::{Cursor, LexemeKind};
use super::names;
use super::run::{MAX_CALLS, Runner};
use super::state::{Changes, Id};
use super::symbols::RoutineId;
use super::tree::Param;
use super::value::{Name, Value, upper};
use crate::program::Reason;
use crate::text::Span;
use std::collections::HashSet;

/// What a call is given: a value, and the variable that it stands in.
pub(super) struct Argument {
    pub(super) value: Value,
    pub(super) path: Option<Path>,
}

impl<'a> Runner<'a> {
    /// Declares the data of all files, and gives them what the text says.
    pub(super) fn declare(&mut self) {
        for file in 0..self.symbols.files.len() {
            self.symbols.declare(file);
        }
        for file in 0..self.symbols.files.len() {
            let found = &self.symbols.files[file];
            let bytes = self.bytes(file);
            // Names are those of the file, as if one of its routines ran.
            self.frames.push(super::run::Frame::of_file(file));
            for data in &found.data {
                let Some(value) = data.value else { continue };
                let name = upper(&bytes[data.name.range()]);
                let id = self.symbols.find(file, &name);
                let value = self.expression(&mut self.cursor(value));
                self.symbols.start[id] = value;
            }
            for &span in &found.values {
                let mut cursor = self.cursor(span);
                let path = self.path(&mut cursor, 0).filter(|_| cursor.accept_mark(b'='));
                match path {
                    Some(path) if path.known => {
                        let value = self.expression(&mut cursor);
                        let mut whole = std::mem::replace(&mut self.symbols.start[path.id], Value::Bool(false));
                        self.put(&mut whole, &path.steps, value);
                        self.symbols.start[path.id] = whole;
                    }
                    _ => self.keep(file, span, Reason::NotUnderstood),
                }
            }
            self.frames.pop();
        }
        self.forget_what_lasts();
    }

    /// Numbers and switches of data lists that a program assigns keep what its last run left.
    fn forget_what_lasts(&mut self) {
        let mut changes = Changes::default();
        let mut seen = HashSet::new();
        // What those of BAS.SRC do is known.
        for id in self.symbols.all().filter(|id| !self.symbols.is_bas(id.file)).collect::<Vec<_>>() {
            self.changes_of(id, &mut seen, &mut changes);
        }
        let fixed = self.symbols.own_state();
        for id in changes.ids.into_iter().filter(|id| !fixed.contains(id)) {
            let value = &self.symbols.start[id];
            if matches!(value, Value::Number(..) | Value::Bool(_) | Value::Constant(_) | Value::Text(_)) {
                let value = value.clone().forgotten(Reason::LastRun);
                self.symbols.start[id] = value;
            }
        }
    }

    /// `name … = expression` or `name(arguments)`; whether it is one of these.
    pub(super) fn assignment_or_call(&mut self, mut cursor: Cursor<'a>, span: Span) -> bool {
        let mut behind = cursor;
        let first = behind.next();
        if first.kind != LexemeKind::Word {
            return false;
        }
        if behind.peek().kind == LexemeKind::Mark(b'(') {
            let name = upper(cursor.text(first));
            self.call(&name, &mut behind, span);
            return behind.is_done();
        }
        let Some(path) = self.path(&mut cursor, 0) else { return false };
        if !cursor.accept_mark(b'=') {
            return false;
        }
        let source = self.name_of(cursor);
        let value = self.expression(&mut cursor);
        self.assign(&path, value, source);
        cursor.is_done()
    }

    /// The name of what is assigned, where that is a variable as a whole.
    fn name_of(&mut self, mut cursor: Cursor<'a>) -> Option<String> {
        let mut behind = cursor;
        if behind.accept(LexemeKind::Word).is_none() || behind.peek().kind == LexemeKind::Mark(b'(') {
            return None;
        }
        let path = self.path(&mut cursor, 0)?;
        cursor.is_done().then_some(path.label)
    }

    /// Assigns; base and tool take the name of what they are made of.
    pub(super) fn assign(&mut self, path: &Path, value: Value, source: Option<String>) {
        let is_followed =
            names::SETTLED.contains(&&path.name[..]) || names::MODELLED_SYSTEM_VARIABLES.contains(&&path.name[..]);
        if path.name.first() == Some(&b'$') && !is_followed {
            self.pin(&value);
            if matches!(&path.name[..], b"$ROBROOT" | b"$ERSYSROOT") {
                self.volatile.insert(self.symbols.base);
            }
            return;
        }
        if matches!(&path.name[..], b"$NULLFRAME" | b"$WORLD") {
            self.volatile.extend([self.symbols.base, self.symbols.tool]);
        }
        let is_frame = path.id == self.symbols.base || path.id == self.symbols.tool;
        // What a base and a zone are made of is read where the robot goes, and not moved with it; who reads data that may change at any
        // moment is not followed, nor are handlers.
        let is_read = is_frame || path.id == self.symbols.approximation;
        if is_read || self.volatile.contains(&path.id) || self.read_beside.contains(&path.id) {
            self.pin(&value);
        }
        let value = self.symbols.converted(path.id, &path.steps, value);
        // Taken out, so that an element is set in place.
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

    /// Another base or tool is in force, under this name.
    pub(super) fn name_frame(&mut self, id: Id, name: Option<String>) {
        let (names, own) =
            if id == self.symbols.base { (self.symbols.base_name, "$BASE") } else { (self.symbols.tool_name, "$TOOL") };
        let name = Value::Own(name.as_deref().unwrap_or(own).into());
        self.state.values.insert(names, name);
        self.leave_frame();
    }

    /// Another frame may be in force: where the robot stands has other numbers in it. They still follow those of the motion before.
    pub(super) fn leave_frame(&mut self) {
        let position = self.value(self.symbols.position).forgotten(Reason::BeforeInOtherFrame);
        self.state.values.insert(self.symbols.position, position);
    }

    pub(super) fn arguments(&mut self, cursor: &mut Cursor<'a>, depth: usize) -> Vec<Argument> {
        let mut out = Vec::new();
        cursor.accept_mark(b'(');
        while !cursor.is_done() && !cursor.accept_mark(b')') {
            if cursor.accept_mark(b',') {
                // One that is left out.
                out.push(Argument { value: Value::unknown(Reason::ArgumentMissing), path: None });
                continue;
            }
            let mut behind = *cursor;
            let path = match behind.peek().kind {
                LexemeKind::Word => self
                    .path(&mut behind, depth + 1)
                    .filter(|_| matches!(behind.peek().kind, LexemeKind::Mark(b',' | b')'))),
                _ => None,
            };
            let value = self.expression_at(cursor, depth + 1);
            out.push(Argument { value, path });
            if !cursor.accept_mark(b',') && cursor.peek().kind != LexemeKind::Mark(b')') {
                cursor.next();
            }
        }
        out
    }

    /// A function's value; what it could change is unknown after it.
    pub(super) fn function(&mut self, name: &Name, cursor: &mut Cursor<'a>, depth: usize) -> Value {
        let at = cursor.rest();
        let arguments = self.arguments(cursor, depth);
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
        let effect = self.effect(name, starts);
        self.give_away(&arguments, effect.arguments);
        if effect.changes.anything {
            self.tell_unknown(name, at);
        }
        self.forget(&effect.changes, Reason::Foreign);
        let number = first.and_then(|value| value.number());
        let computed = match (&name[..], number) {
            (b"ABS", Some(v)) => v.abs(),
            (b"SIN", Some(v)) => v.to_radians().sin(),
            (b"COS", Some(v)) => v.to_radians().cos(),
            (b"TAN", Some(v)) => v.to_radians().tan(),
            (b"SQRT", Some(v)) if v >= 0.0 => v.sqrt(),
            _ => return Value::unknown(Reason::Computed),
        };
        Value::Number(computed, None)
    }

    /// What a routine that is not followed changes; its first motion may leave components to the motion before.
    fn run_unfollowed(&mut self, changes: &Changes, why: Reason) {
        if changes.ids.contains(&self.symbols.stands) {
            self.hold_position_before();
        }
        self.forget(changes, why);
    }

    /// What was handed to a routine that is not followed: it may be read, and changed where it is a variable.
    fn give_away(&mut self, arguments: &[Argument], changed: bool) {
        for argument in arguments {
            self.pin(&argument.value);
            if let (Some(path), true) = (&argument.path, changed) {
                let value = self.value(path.id).forgotten(Reason::ByReceiver);
                self.state.values.insert(path.id, value);
            }
        }
    }

    fn call(&mut self, name: &Name, cursor: &mut Cursor<'a>, span: Span) {
        if &name[..] == b"BAS" {
            let arguments = self.arguments(cursor, 0);
            return self.bas(&arguments);
        }
        let Some(id) = self.symbols.find_routine(self.here(), name) else {
            drop(self.function(name, cursor, 0));
            return;
        };
        let arguments = self.arguments(cursor, 0);
        let around = self.frames.iter().filter(|frame| frame.routine == id).count();
        if around > 0 || self.symbols.routine(id).is_function {
            // Not followed: its own targets stay.
            self.keep(self.here(), span, Reason::RoutineCallsItself);
            let changes = self.known_changes(id);
            self.run_unfollowed(&changes, Reason::ByRecursiveRoutine);
            return self.give_away(&arguments, true);
        }
        if self.frames.len() >= MAX_CALLS {
            self.give_up(span);
            return;
        }
        self.follow(id, &arguments);
    }

    /// Runs a routine with copies of what it is given, and gives back what is its caller's own.
    fn follow(&mut self, id: RoutineId, arguments: &[Argument]) {
        let params: &'a [Param] = &self.symbols.routine(id).params;
        // What a routine that is declared without parameters takes all the same (one of `[controller] harmless`).
        self.give_away(arguments.get(params.len()..).unwrap_or_default(), true);
        let values: Vec<Value> = arguments.iter().map(|argument| argument.value.clone()).collect();
        let lent = |i: usize| arguments.get(i).and_then(|a| a.path.as_ref()).filter(|_| params[i].is_out);
        let changes = self.known_changes(id);
        let aliased: Vec<bool> = (0..params.len()).map(|i| self.is_aliased(i, params.len(), &changes, &lent)).collect();
        let volatile = self.volatile.clone();
        self.volatile.extend((0..params.len()).filter(|i| aliased[*i]).filter_map(lent).map(|path| path.id));
        // A variable that is lent is the parameter's meanwhile.
        let mut held = Vec::new();
        for path in (0..params.len()).filter_map(lent) {
            held.push((path.id, self.value(path.id)));
            let value = self.value(path.id).forgotten(Reason::LentToParameter);
            self.state.values.insert(path.id, value);
        }
        let left = self.enter(id, &values, &aliased);
        // What a TRIGGER may still change under a parameter's name is the caller's.
        let late = (0..params.len()).filter(|i| left.get(*i).is_some_and(|left| left.is_triggered)).filter_map(lent);
        self.triggered.extend(late.map(|path| path.id));
        self.volatile = volatile;
        self.volatile.extend(&self.triggered);
        for (id, value) in held {
            self.state.values.insert(id, value);
        }
        for i in 0..params.len() {
            let Some(path) = lent(i).cloned() else { continue };
            if aliased[i] || self.resumes {
                let value = self.value(path.id).forgotten(Reason::UnderTwoNames);
                self.state.values.insert(path.id, value);
            } else if let Some(left) = left.get(i) {
                self.assign(&path, left.value.clone(), None);
            }
        }
        if self.resumes {
            self.forget(&changes, Reason::Resume);
        }
    }

    /// Whether what a parameter is lent has another name in the routine: a global one, or another parameter's.
    fn is_aliased<'p>(
        &self,
        param: usize,
        params: usize,
        changes: &Changes,
        lent: &impl Fn(usize) -> Option<&'p Path>,
    ) -> bool {
        let Some(path) = lent(param) else { return false };
        let twice = (0..params).any(|other| other != param && lent(other).is_some_and(|other| other.id == path.id));
        twice || changes.ids.contains(&path.id) || changes.anything && self.symbols.visible().contains(&path.id)
    }

    /// What a TRIGGER starts runs some time while the program goes on: what it changes is not known from here.
    pub(super) fn trigger(&mut self, mut cursor: Cursor<'a>) {
        let whole = cursor.rest();
        cursor.until(&[b"DO"]);
        let mut behind = cursor;
        let first = behind.next();
        if behind.peek().kind == LexemeKind::Mark(b'(') {
            let arguments = self.arguments(&mut behind, 0);
            self.give_away(&arguments, true);
        } else if self.path(&mut cursor, 0).is_some() && cursor.accept_mark(b'=') {
            let value = self.expression(&mut cursor);
            self.pin(&value);
        }
        let changes = self.changes_by(whole);
        if changes.anything {
            let name = upper(cursor.text(first));
            self.tell_unknown(&name, first.span());
        }
        self.triggered.extend(changes.ids.iter().copied());
        if changes.anything {
            self.triggered.extend(self.symbols.visible());
        }
        self.volatile.extend(&self.triggered);
    }

    /// A statement that changes nothing: what its functions do, and what it reads.
    pub(super) fn look_through(&mut self, mut cursor: Cursor<'a>) {
        if cursor.is_at(b"INTERRUPT") || cursor.is_at(b"GLOBAL") {
            return;
        }
        while !cursor.is_done() {
            let lexeme = cursor.peek();
            if lexeme.kind == LexemeKind::Word {
                let name = upper(cursor.text(lexeme));
                let mut behind = cursor;
                behind.next();
                let is_call = behind.peek().kind == LexemeKind::Mark(b'(');
                let is_statement =
                    names::HARMLESS_STATEMENTS.contains(&&name[..]) || matches!(&name[..], b"FOR" | b"SEC");
                if is_statement || is_call && names::NO_CALLS.contains(&&name[..]) {
                    cursor.next();
                    continue;
                }
                let value = self.expression(&mut cursor);
                self.pin(&value);
            } else {
                cursor.next();
            }
        }
    }
}
