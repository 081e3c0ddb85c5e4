//! What statements could change, found without running them.

use super::lex::{Cursor, LexemeKind};
use super::names;
use super::run::Runner;
use super::state::{Changes, Id};
use super::symbols::{RoutineId, spans};
use super::system::{System, system};
use super::tree::{Statement, walk};
use super::value::{INERTIA, Name, POSE, Value, upper};
use crate::program::Reason;
use crate::text::{Diagnostic, Severity, Span, decode};
use std::collections::{BTreeSet, HashMap, HashSet};
use std::rc::Rc;

/// Whose names statements use.
struct Scope<'n> {
    file: usize,
    own: Option<&'n HashMap<Name, Id>>,
    /// Names of a routine that is not run: its own data end with it.
    hidden: HashSet<Name>,
    /// The statement is what an interrupt starts.
    is_handler: bool,
}

/// Statements that are looked through in about the time that one takes to run.
const STATEMENTS_PER_STEP: usize = 8;

/// What a routine that no file has may change.
pub(super) struct Effect {
    pub(super) changes: Changes,
    /// The variables that it is given as well.
    pub(super) arguments: bool,
}

impl<'a> Runner<'a> {
    /// What a block of the routine that is being run could change.
    pub(super) fn changes_in(&mut self, block: &'a [Statement]) -> Changes {
        let mut changes = Changes::default();
        let own = self.frames.last().map(|frame| frame.names.clone());
        let scope = Scope { file: self.here(), own: own.as_ref(), hidden: HashSet::new(), is_handler: false };
        self.collect(block, &scope, &mut HashSet::new(), &mut changes);
        changes
    }

    /// What a statement of the routine that is being run could change.
    pub(super) fn changes_by(&mut self, statement: Span) -> Changes {
        let mut changes = Changes::default();
        let own = self.frames.last().map(|frame| frame.names.clone());
        let scope = Scope { file: self.here(), own: own.as_ref(), hidden: HashSet::new(), is_handler: false };
        self.collect_statement(statement, &scope, &mut HashSet::new(), &mut changes);
        changes
    }

    /// What a routine could change.
    pub(super) fn changes_of(&mut self, id: RoutineId, seen: &mut HashSet<RoutineId>, changes: &mut Changes) {
        if !seen.insert(id) {
            return;
        }
        let routine = self.symbols.routine(id);
        let bytes = self.bytes(id.file);
        let params = routine.params.iter().map(|param| param.name);
        let hidden = routine.data.iter().map(|data| data.name).chain(params);
        let hidden = hidden.map(|name| upper(&bytes[name.range()])).collect();
        self.collect(&routine.body, &Scope { file: id.file, own: None, hidden, is_handler: false }, seen, changes);
    }

    /// The same, found once.
    pub(super) fn known_changes(&mut self, id: RoutineId) -> Rc<Changes> {
        if let Some(known) = self.changes.get(&id) {
            return known.clone();
        }
        let mut changes = Changes::default();
        self.changes_of(id, &mut HashSet::new(), &mut changes);
        self.changes.entry(id).or_insert(Rc::new(changes)).clone()
    }

    fn collect(
        &mut self,
        block: &'a [Statement],
        scope: &Scope<'_>,
        seen: &mut HashSet<RoutineId>,
        changes: &mut Changes,
    ) {
        let mut marks = false;
        let (mut counters, mut simple) = (Vec::new(), Vec::new());
        walk(block, &mut |statement| match statement {
            Statement::Mark(_) => marks = true,
            Statement::For { variable, .. } => counters.push(*variable),
            Statement::Simple(span) => simple.push(*span),
            _ => {}
        });
        if marks {
            changes.ids.insert(self.symbols.mark);
        }
        let bytes = self.bytes(scope.file);
        changes.anything |= simple.into_iter().any(|span| !is_understood(Cursor::new(bytes, 0, span)));
        for counter in counters {
            self.changed(&upper(&bytes[counter.range()]), scope, changes);
        }
        let spans = spans(block);
        // A loop is looked through each time that it begins.
        self.steps += spans.len() / STATEMENTS_PER_STEP;
        for span in spans {
            self.collect_statement(span, scope, seen, changes);
        }
    }

    fn changed(&mut self, name: &Name, scope: &Scope<'_>, changes: &mut Changes) {
        if let Some(id) = scope.own.and_then(|own| own.get(name)) {
            changes.ids.insert(*id);
        } else if !scope.hidden.contains(name) {
            changes.ids.insert(self.symbols.find(scope.file, name));
        }
        // What base and tool are counted from changes them too.
        let (base, tool) = match &name[..] {
            b"$BASE" | b"$ROBROOT" | b"$ERSYSROOT" => (true, false),
            b"$TOOL" => (false, true),
            b"$NULLFRAME" | b"$WORLD" => (true, true),
            _ => return,
        };
        self.frames_change(changes, base, tool);
    }

    /// What a routine that no file has may change; `starts` where its first argument is 1, or an interrupt starts it.
    pub(super) fn effect(&mut self, name: &[u8], starts: bool) -> Effect {
        let mut effect = Effect { changes: Changes::default(), arguments: false };
        match system(name) {
            _ if names::is_frame_function(name) => {}
            Some(System::Nothing) => {}
            Some(System::TouchSense) if starts => {}
            Some(System::Arguments) => effect.arguments = true,
            Some(System::Data(data)) => {
                let here = self.here();
                effect.changes.ids.extend(data.iter().map(|name| self.symbols.find(here, &upper(name.as_bytes()))));
            }
            Some(System::TouchSense) | None => {
                effect.changes.anything = true;
                effect.arguments = true;
            }
        }
        effect
    }

    fn collect_statement(
        &mut self,
        span: Span,
        scope: &Scope<'_>,
        seen: &mut HashSet<RoutineId>,
        changes: &mut Changes,
    ) {
        #[allow(clippy::cast_possible_truncation)]
        let mut cursor = Cursor::new(self.bytes(scope.file), scope.file as u16, span);
        let first = upper(cursor.text(cursor.peek()));
        let moves = names::motion(&first).is_some() || names::relative(&first).is_some();
        if moves {
            changes.ids.extend([self.symbols.position, self.symbols.turned, self.symbols.stands]);
        } else if &first[..] == b"TRIGGER" {
            cursor.until(&[b"DO"]);
            changes.anything |= !is_understood(cursor);
            return self.collect_statement(cursor.rest(), scope, seen, changes);
        } else if &first[..] == b"INTERRUPT" || &first[..] == b"GLOBAL" {
            return;
        }
        // `name … =` at the beginning of a statement.
        if let Some(assigned) = assigned(cursor).filter(|_| !moves) {
            self.changed(&assigned.variable, scope, changes);
        }
        while !cursor.is_done() {
            let lexeme = cursor.next();
            if lexeme.kind != LexemeKind::Word || cursor.peek().kind != LexemeKind::Mark(b'(') {
                continue;
            }
            let name = upper(cursor.text(lexeme));
            if names::NO_CALLS.contains(&&name[..]) {
                continue;
            }
            if &name[..] == b"BAS" {
                let mut behind = cursor;
                let constant = behind.accept_mark(b'(') && behind.accept_mark(b'#');
                let command = if constant { upper(behind.text(behind.peek())) } else { Name::new() };
                let (base, tool) = (&command[..] != b"TOOL", &command[..] != b"BASE");
                if !names::KEEPS_APPROXIMATION.contains(&&command[..]) {
                    changes.ids.insert(self.symbols.approximation);
                }
                if &command[..] == b"VEL_CP" {
                    changes.ids.insert(self.symbols.speed);
                } else if &command[..] == b"CP_DAT" {
                    changes.ids.extend([self.symbols.speed, self.symbols.orientation, self.symbols.circle_type]);
                } else if !names::HARMLESS_COMMANDS.contains(&&command[..]) {
                    self.frames_change(changes, base, tool);
                    let [load, speed] = [self.symbols.load, self.symbols.speed];
                    changes.ids.extend([load, speed, self.symbols.mode]);
                    changes.ids.extend([self.symbols.orientation, self.symbols.circle_type]);
                    if &command[..] == b"INITMOV" {
                        names::CORRECTIONS.iter().flatten().for_each(|name| self.changed(&upper(name), scope, changes));
                    }
                }
                continue;
            }
            let arguments = arguments(cursor);
            match self.symbols.find_routine(scope.file, &name) {
                Some(id) => {
                    self.changes_of(id, seen, changes);
                    arguments.iter().for_each(|name| self.changed(name, scope, changes));
                }
                None if names::HARMLESS_STATEMENTS.contains(&&first[..]) && !moves && first[..] == name[..] => {}
                None => {
                    let mut behind = cursor;
                    let starts = behind.accept_mark(b'(') && behind.text(behind.peek()) == b"1";
                    let effect = self.effect(&name, starts || scope.is_handler);
                    changes.ids.extend(effect.changes.ids);
                    changes.anything |= effect.changes.anything;
                    if effect.arguments {
                        arguments.iter().for_each(|name| self.changed(name, scope, changes));
                    }
                }
            }
        }
    }

    /// Base or tool change, and with them what the position before is counted in.
    fn frames_change(&self, changes: &mut Changes, base: bool, tool: bool) {
        let symbols = &self.symbols;
        changes.ids.insert(symbols.position);
        if base {
            changes.ids.extend([symbols.base, symbols.base_name]);
        }
        if tool {
            changes.ids.extend([symbols.tool, symbols.tool_name]);
        }
    }

    /// Makes unknown what may have changed.
    pub(super) fn forget(&mut self, changes: &Changes, why: Reason) {
        let mut ids: BTreeSet<Id> = changes.ids.clone();
        if changes.anything {
            ids.extend(self.symbols.visible());
        }
        for id in ids {
            let value = if self.symbols.is_table(id) {
                self.value(id).all_forgotten(why)
            } else {
                self.value(id).forgotten(why)
            };
            self.state.values.insert(id, value);
        }
    }

    /// Whether what may be changed has a say in an expression.
    pub(super) fn depends(&mut self, span: Span, changes: &Changes) -> bool {
        let mut cursor = self.cursor(span);
        while !cursor.is_done() {
            let lexeme = cursor.next();
            if lexeme.kind != LexemeKind::Word {
                continue;
            }
            let name = upper(cursor.text(lexeme));
            if cursor.peek().kind == LexemeKind::Mark(b'(') || name.first() == Some(&b'$') {
                return true;
            }
            let id = self.resolve(&name);
            if changes.ids.contains(&id) || changes.anything && self.symbols.visible().contains(&id) {
                return true;
            }
        }
        false
    }

    /// Routines that interrupts start may run at any moment: what they change is never known, what they name stays.
    pub(super) fn expect_interrupts(&mut self) {
        for id in self.symbols.all().collect::<Vec<_>>() {
            let bytes = self.bytes(id.file);
            for span in spans(&self.symbols.routine(id).body) {
                #[allow(clippy::cast_possible_truncation)]
                let mut cursor = Cursor::new(bytes, id.file as u16, span);
                cursor.accept_word(b"GLOBAL");
                if !cursor.accept_word(b"INTERRUPT") || !cursor.accept_word(b"DECL") {
                    continue;
                }
                cursor.until(&[b"DO"]);
                let mut changes = Changes::default();
                let scope = Scope { file: id.file, own: None, hidden: HashSet::new(), is_handler: true };
                self.collect_statement(cursor.rest(), &scope, &mut HashSet::new(), &mut changes);
                let handler = cursor.peek();
                let name = upper(cursor.text(handler));
                if changes.anything && self.symbols.find_routine(id.file, &name).is_none() {
                    self.frames.push(super::run::Frame::of_file(id.file));
                    self.tell_unknown(&name, handler.span());
                    self.frames.pop();
                }
                self.volatile.extend(changes.ids);
                if changes.anything {
                    self.volatile.extend(self.symbols.visible());
                }
            }
        }
    }

    /// Handlers, functions (which are not followed) and routines that call themselves, with all that they call: what they
    /// name stays.
    pub(super) fn find_beside(&mut self) {
        let all: Vec<RoutineId> = self.symbols.all().collect();
        let mut calls: HashMap<RoutineId, BTreeSet<RoutineId>> = HashMap::new();
        let mut handlers = Vec::new();
        for &id in &all {
            let bytes = self.bytes(id.file);
            if self.symbols.routine(id).is_function {
                self.beside.insert(id);
            }
            for span in spans(&self.symbols.routine(id).body) {
                let mut cursor = Cursor::new(bytes, 0, span);
                let interrupts = cursor.is_at(b"INTERRUPT") || cursor.is_at(b"GLOBAL");
                let starts = interrupts || cursor.is_at(b"TRIGGER");
                self.resumes |= cursor.is_at(b"RESUME");
                while !cursor.is_done() {
                    let lexeme = cursor.next();
                    if lexeme.kind != LexemeKind::Word || cursor.peek().kind != LexemeKind::Mark(b'(') {
                        continue;
                    }
                    let Some(called) = self.symbols.find_routine(id.file, cursor.text(lexeme)) else { continue };
                    if starts {
                        self.beside.insert(called);
                        handlers.extend(interrupts.then_some((called, id.file, lexeme.span())));
                    } else {
                        calls.entry(id).or_default().insert(called);
                    }
                }
            }
        }
        let within = |from: RoutineId| {
            let (mut found, mut open) = (BTreeSet::new(), vec![from]);
            while let Some(id) = open.pop() {
                open.extend(calls.get(&id).into_iter().flatten().filter(|called| found.insert(**called)));
            }
            found
        };
        for (handler, file, span) in handlers {
            let moves = |id: RoutineId| {
                spans(&self.symbols.routine(id).body).into_iter().any(|span| self.is_motion(id.file, span))
            };
            if within(handler).into_iter().chain([handler]).any(moves) {
                self.tell_interrupt_that_moves(handler, file, span);
            }
        }
        for id in all {
            let called = within(id);
            if called.contains(&id) {
                self.beside.insert(id);
            }
            if self.beside.contains(&id) {
                self.beside.extend(called);
            }
        }
        for id in self.beside.iter().copied().collect::<Vec<_>>() {
            let named = self.pin_names(id);
            self.read_beside.extend(named);
        }
    }

    /// Whether the program puts positions into data that leave components out: such data take these from the motion before.
    pub(super) fn finds_incomplete_positions(&mut self) -> bool {
        let in_lists = self.symbols.start.iter().any(Value::leaves_components_out);
        in_lists || self.symbols.all().collect::<Vec<_>>().into_iter().any(|id| self.leaves_components_out_in(id))
    }

    fn leaves_components_out_in(&mut self, id: RoutineId) -> bool {
        let routine = self.symbols.routine(id);
        let bytes = self.bytes(id.file);
        let own = routine.data.iter().map(|data| data.name).chain(routine.params.iter().map(|param| param.name));
        let own: HashSet<Name> = own.map(|name| upper(&bytes[name.range()])).collect();
        spans(&routine.body).into_iter().any(|span| {
            let mut cursor = Cursor::new(bytes, 0, span);
            if [&b"TRIGGER"[..], b"INTERRUPT", b"GLOBAL"].iter().any(|word| cursor.is_at(word)) {
                cursor.until(&[b"DO"]);
            }
            // An aggregate that a motion goes to is put into no data, but one that it gives a function is.
            if has_incomplete_position(cursor, self.is_motion(id.file, span)) {
                return true;
            }
            let Some(Assigned { variable, component: Some(component) }) = assigned(cursor) else { return false };
            if !POSE.contains(&&component[..]) || variable.first() == Some(&b'$') {
                return false;
            }
            let at = self.symbols.find(id.file, &variable);
            own.contains(&variable) || !is_complete(&self.symbols.start[at])
        })
    }

    /// Whether a statement moves the robot.
    pub(super) fn is_motion(&self, file: usize, span: Span) -> bool {
        let cursor = Cursor::new(self.bytes(file), 0, span);
        let word = upper(cursor.text(cursor.peek()));
        names::motion(&word).is_some() || names::relative(&word).is_some()
    }

    /// The motion after an interrupt begins where its routine leaves the robot.
    fn tell_interrupt_that_moves(&mut self, handler: RoutineId, file: usize, span: Span) {
        let name = upper(&self.bytes(handler.file)[self.symbols.routine(handler).name.range()]);
        // No name of a program has a blank.
        if !self.told.insert([b" INTERRUPT ", &*name].concat().into()) {
            return;
        }
        let message = format!(
            "`{}` moves the robot: where it interrupts, the motion that follows may begin elsewhere than is corrected for",
            decode(&name)
        );
        let source = &self.symbols.sources[file];
        let note = Diagnostic::error("krl.interrupt-moves", &source.name, message).at(source, span);
        let help = "let it go back to $POS_INT before the program goes on";
        self.diagnostics.push(note.severity(Severity::Note).help(help));
    }

    /// Pins the data that a routine names, as they are at the start; which these are.
    pub(super) fn pin_names(&mut self, id: RoutineId) -> HashSet<Id> {
        let mut named = HashSet::new();
        let routine = self.symbols.routine(id);
        let bytes = self.bytes(id.file);
        let mut done: HashSet<Name> = routine.data.iter().map(|data| upper(&bytes[data.name.range()])).collect();
        for span in spans(&routine.body) {
            let mut cursor = Cursor::new(bytes, 0, span);
            while !cursor.is_done() {
                let lexeme = cursor.next();
                if lexeme.kind == LexemeKind::Word && done.insert(upper(cursor.text(lexeme))) {
                    let at = self.symbols.find(id.file, &upper(cursor.text(lexeme)));
                    let value = self.symbols.start.get(at).cloned().unwrap_or(Value::Bool(false));
                    self.pin(&value);
                    named.insert(at);
                }
            }
        }
        named
    }
}

/// Whether a statement is one of those that are known, by how it begins.
fn is_understood(mut cursor: Cursor<'_>) -> bool {
    let first = upper(cursor.text(cursor.peek()));
    let known = names::motion(&first).is_some() || names::relative(&first).is_some() || &first[..] == b"TRIGGER";
    if known || names::HARMLESS_STATEMENTS.contains(&&first[..]) || assigned(cursor).is_some() {
        return true;
    }
    cursor.next();
    cursor.peek().kind == LexemeKind::Mark(b'(')
}

/// What a statement assigns to.
struct Assigned {
    variable: Name,
    /// The last component of the path.
    component: Option<Name>,
}

/// What a statement assigns to, where it is an assignment.
fn assigned(mut cursor: Cursor<'_>) -> Option<Assigned> {
    let first = cursor.accept(LexemeKind::Word)?;
    let mut assigned = Assigned { variable: upper(cursor.text(first)), component: None };
    let mut depth = 0_usize;
    loop {
        let lexeme = cursor.next();
        match lexeme.kind {
            LexemeKind::Mark(b'[') => depth += 1,
            LexemeKind::Mark(b']') => depth = depth.saturating_sub(1),
            LexemeKind::Mark(b'=') if depth == 0 => return Some(assigned),
            LexemeKind::Mark(b'.') => {}
            LexemeKind::End => return None,
            LexemeKind::Word if depth == 0 => assigned.component = Some(upper(cursor.text(lexeme))),
            _ if depth == 0 => return None,
            _ => {}
        }
    }
}

/// Whether data hold positions alone, each with all components.
fn is_complete(value: &Value) -> bool {
    match value {
        Value::Array(items) => !items.is_empty() && items.values().all(is_complete),
        value => POSE.iter().all(|name| value.component(name).is_some()),
    }
}

/// Whether a statement has an aggregate with some components of a position but not all; of those of a motion, within round
/// brackets.
fn has_incomplete_position(mut cursor: Cursor<'_>, is_motion: bool) -> bool {
    // Components that each open aggregate names, and how many round brackets are open where it begins.
    let mut open: Vec<(u8, usize)> = Vec::new();
    let (mut depth, mut begins, mut is_inertia) = (0_usize, false, false);
    while !cursor.is_done() {
        let lexeme = cursor.next();
        let of = std::mem::replace(&mut begins, matches!(lexeme.kind, LexemeKind::Mark(b'{' | b',' | b':')));
        let inertia = std::mem::replace(&mut is_inertia, cursor.text(lexeme).eq_ignore_ascii_case(INERTIA));
        match lexeme.kind {
            LexemeKind::Mark(b'(') => depth += 1,
            LexemeKind::Mark(b')') => depth = depth.saturating_sub(1),
            LexemeKind::Mark(b'{') if inertia => open.push((0, usize::MAX)),
            LexemeKind::Mark(b'{') => open.push((0, depth)),
            LexemeKind::Mark(b'}') => {
                let Some((named, at)) = open.pop() else { continue };
                if named != 0 && named != 0b11_1111 && (!is_motion || at > 0) {
                    return true;
                }
            }
            LexemeKind::Word if of => {
                let name = upper(cursor.text(lexeme));
                let component = POSE.iter().position(|known| name[..] == **known);
                if let (Some(component), Some((named, at))) = (component, open.last_mut())
                    && *at == depth
                {
                    *named |= 1 << component;
                }
            }
            _ => {}
        }
    }
    false
}

/// Names within the brackets that follow.
pub(super) fn arguments(mut cursor: Cursor<'_>) -> Vec<Name> {
    let (mut depth, mut found) = (0_usize, Vec::new());
    loop {
        let lexeme = cursor.next();
        match lexeme.kind {
            LexemeKind::End => return found,
            LexemeKind::Mark(b'(') => depth += 1,
            LexemeKind::Mark(b')') if depth <= 1 => return found,
            LexemeKind::Mark(b')') => depth -= 1,
            LexemeKind::Word => found.push(upper(cursor.text(lexeme))),
            _ => {}
        }
    }
}
