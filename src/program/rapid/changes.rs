//! Which names a program's statements change, as far as their text tells.

use super::lex::{Cursor, Kind};
use super::motion::{self, Call, Simple};
use super::symbols::{RoutineId, Symbols, Upper, first_word, harmless};
use super::tree::{Param, RoutineKind, Statement, simple_statements};
use crate::text::Span;
use std::cell::RefCell;
use std::collections::HashMap;
use std::rc::Rc;

/// Names in upper case.
type NameList = Rc<[Box<[u8]>]>;

/// Names that each routine changes, once it was asked for.
#[derive(Default)]
pub(super) struct Changes {
    /// In its body or its handlers, calls included.
    all: RefCell<HashMap<RoutineId, NameList>>,
    /// By its own assignments only: what can come back through a parameter.
    handed_back: RefCell<HashMap<RoutineId, NameList>>,
}

/// Predefined functions that hand back more than their value, through an argument.
const WRITING_FUNCTIONS: [&str; 4] = ["StrToVal", "TestAndSet", "GetNextSym", "GetNextMechUnit"];

impl<'a> Symbols<'a> {
    /// Marks the data that the program assigns, wherever that is.
    pub(super) fn find_assignments(&mut self) {
        for id in self.all().collect::<Vec<_>>() {
            let routine = self.routine(id);
            let trap = routine.kind == RoutineKind::Trap;
            for (block, volatile) in [(&routine.body, trap), (&routine.handlers, true)] {
                let mut assigned = Vec::new();
                self.assigned_names(id, block, &mut assigned);
                for name in assigned {
                    if let Some(at) = self.find_data(self.module_of(id), &name).filter(|_| !shadowed(self, id, &name)) {
                        self.variables[at].assigned = true;
                        self.variables[at].volatile |= volatile;
                    }
                }
            }
        }
    }

    /// Names that a routine changes, in its body or its handlers.
    pub(super) fn changed_by(&self, id: RoutineId) -> NameList {
        if let Some(found) = self.changes.all.borrow().get(&id) {
            return Rc::clone(found);
        }
        let routine = self.routine(id);
        let mut names = Vec::new();
        self.assigned_names(id, &routine.body, &mut names);
        self.assigned_names(id, &routine.handlers, &mut names);
        let names = list(names);
        self.changes.all.borrow_mut().insert(id, Rc::clone(&names));
        names
    }

    /// Names (upper case) whose data a block's statements change, as far as text can tell.
    pub(super) fn assigned_names(&self, id: RoutineId, block: &[Statement], out: &mut Vec<Box<[u8]>>) {
        for statement in block {
            match statement {
                Statement::Simple(span) => self.assigned_by(id, *span, out),
                Statement::If { arms, otherwise, .. } => {
                    for (condition, block) in arms {
                        self.changed_in(id, *condition, out);
                        self.assigned_names(id, block, out);
                    }
                    self.assigned_names(id, otherwise, out);
                }
                Statement::For { body, .. } => self.assigned_names(id, body, out),
                Statement::While { condition, body, .. } => {
                    self.changed_in(id, *condition, out);
                    self.assigned_names(id, body, out);
                }
                Statement::Test { subject, cases, otherwise, .. } => {
                    self.changed_in(id, *subject, out);
                    cases.iter().for_each(|(_, b)| self.assigned_names(id, b, out));
                    self.assigned_names(id, otherwise, out);
                }
                Statement::Return | Statement::Exit | Statement::Goto(_) | Statement::Mark(_) => {}
            }
        }
    }

    fn assigned_by(&self, id: RoutineId, span: Span, out: &mut Vec<Box<[u8]>>) {
        let bytes = &self.sources[id.file].bytes;
        let word = first_word(bytes, span);
        let shape = motion::shape(&bytes[word.range()]);
        // A plain motion changes nothing; a search writes what it found.
        if shape.is_some_and(|s| s.zone != motion::Zone::Absent) {
            return;
        }
        #[allow(clippy::cast_possible_truncation)]
        let Some(simple) = motion::split(bytes, id.file as u16, span) else { return };
        let mut add = |argument: Span| {
            let name = first_word(bytes, argument);
            if !name.is_empty() && whole_variable(bytes, argument) {
                out.push(Box::from(&*Upper::new(&bytes[name.range()])));
            }
        };
        match simple {
            Simple::Assignment { target, value } => {
                add(target);
                self.changed_in(id, value, out);
            }
            Simple::Call(call) => {
                let name = &bytes[call.name.range()];
                if let Some(shape) = shape {
                    // SearchPoint stands before the targets.
                    if let Some(point) = call.positional().get(shape.via.unwrap_or(shape.to).wrapping_sub(1)) {
                        add(*point);
                    }
                } else if call.late_bound {
                } else if let Some(callee) = self.find_routine(self.module_of(id), name) {
                    let routine = self.routine(callee);
                    let changed = self.changed_params(callee);
                    let required = routine.params.iter().filter(|p| !p.optional);
                    for (param, argument) in required.zip(call.positional()) {
                        if param.by_reference && changed.contains(&param_key(self, callee, param)) {
                            add(*argument);
                        }
                    }
                } else if name.eq_ignore_ascii_case(b"SetDataVal") {
                    if let Some(text) = call.positional().first()
                        && let [b'"', inner @ .., b'"'] = &bytes[text.range()]
                    {
                        out.push(Box::from(&*Upper::new(inner)));
                    }
                } else if !harmless(name) {
                    call.given().for_each(add);
                }
            }
        }
    }

    /// Data that the functions called in an expression change through their arguments.
    fn changed_in(&self, id: RoutineId, expression: Span, out: &mut Vec<Box<[u8]>>) {
        let bytes = &self.sources[id.file].bytes;
        let mut cursor = Cursor::new(bytes, expression);
        loop {
            let name = cursor.next();
            if name.kind == Kind::End {
                return;
            }
            if name.kind != Kind::Word || cursor.peek().kind != Kind::Mark(b'(') {
                continue;
            }
            let mut behind = cursor;
            behind.next();
            let mut call = Call::empty(name.span());
            #[allow(clippy::cast_possible_truncation)]
            if motion::arguments(&mut behind, id.file as u16, &mut call).is_some() {
                let changed = self.changed_arguments(self.module_of(id), bytes, &call);
                out.extend(changed.map(|word| Box::from(&*Upper::new(&bytes[word.range()]))));
            }
        }
    }

    /// Names of the arguments that a function changes.
    pub(super) fn changed_arguments<'b>(
        &self,
        module: usize,
        bytes: &'b [u8],
        call: &'b Call,
    ) -> impl Iterator<Item = Span> + use<'a, 'b> {
        let name = &bytes[call.name.range()];
        let changes: Vec<bool> = match self.find_routine(module, name) {
            Some(callee) => {
                let changed = self.changed_params(callee);
                let required = self.routine(callee).params.iter().filter(|p| !p.optional);
                required.map(|p| p.by_reference && changed.contains(&param_key(self, callee, p))).collect()
            }
            None => vec![WRITING_FUNCTIONS.iter().any(|f| f.as_bytes().eq_ignore_ascii_case(name)); call.count],
        };
        let changed = changes.into_iter().zip(call.positional()).filter(|(changes, _)| *changes);
        changed
            .filter(|(_, a)| whole_variable(bytes, **a))
            .map(|(_, a)| first_word(bytes, *a))
            .filter(|w| !w.is_empty())
    }

    /// Names of a routine's parameters that it assigns itself.
    fn changed_params(&self, id: RoutineId) -> NameList {
        if let Some(found) = self.changes.handed_back.borrow().get(&id) {
            return Rc::clone(found);
        }
        let bytes = &self.sources[id.file].bytes;
        let routine = self.routine(id);
        let mut names = Vec::new();
        let mut add = |argument: Span| names.push(Box::from(&*Upper::new(&bytes[first_word(bytes, argument).range()])));
        for span in [&routine.body, &routine.handlers].into_iter().flat_map(|block| simple_statements(block)) {
            #[allow(clippy::cast_possible_truncation)]
            match motion::split(bytes, id.file as u16, span) {
                Some(Simple::Assignment { target, .. }) => add(target),
                // Handed on: taken as changed unless to a motion or a harmless instruction.
                Some(Simple::Call(call)) => {
                    let name = &bytes[call.name.range()];
                    let known = motion::shape(name).is_some()
                        || harmless(name)
                        || self.find_routine(self.module_of(id), name).is_some();
                    if !known {
                        call.given().for_each(&mut add);
                    }
                }
                None => {}
            }
        }
        let names = list(names);
        self.changes.handed_back.borrow_mut().insert(id, Rc::clone(&names));
        names
    }
}

fn list(mut names: Vec<Box<[u8]>>) -> NameList {
    names.sort_unstable();
    names.dedup();
    names.into()
}

fn param_key(symbols: &Symbols<'_>, id: RoutineId, param: &Param) -> Box<[u8]> {
    Box::from(&*Upper::new(&symbols.sources[id.file].bytes[param.name.range()]))
}

/// Whether a routine has data or a parameter of this name, which hides the module's.
fn shadowed(symbols: &Symbols<'_>, id: RoutineId, name: &[u8]) -> bool {
    let bytes = &symbols.sources[id.file].bytes;
    let routine = symbols.routine(id);
    let is = |span: Span| *Upper::new(&bytes[span.range()]) == *name;
    routine.data.iter().any(|d| is(d.name)) || routine.params.iter().any(|p| is(p.name))
}

/// A name with components or indices and nothing else: what can be changed by whom it is given to.
fn whole_variable(bytes: &[u8], span: Span) -> bool {
    let mut cursor = Cursor::new(bytes, span);
    let mut depth = 0_usize;
    loop {
        let lexeme = cursor.next();
        match lexeme.kind {
            Kind::End => return true,
            Kind::Mark(b'{') => depth += 1,
            Kind::Mark(b'}') => depth = depth.saturating_sub(1),
            Kind::Word | Kind::Mark(b'.') => {}
            _ if depth > 0 => {}
            _ => return false,
        }
    }
}
