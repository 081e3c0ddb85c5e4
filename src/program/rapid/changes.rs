//! Finds what statements could change, from their text alone. This is used if it is unknown whether, or how often, they run.

use super::known::{Changes, Known, RoutineId};
use super::lex::{Cursor, LexemeKind};
use super::motion::{self, Call, Simple};
use super::parameters::undeclared;
use super::predefined::{self, Function, Instruction};
use super::state::Switches;
use super::symbols::{Symbols, Upper, first_word};
use super::tree::{Param, RoutineKind, Statement, Storage};
use crate::program::Reason;
use crate::text::Span;
use std::cell::RefCell;
use std::collections::{BTreeSet, HashMap, HashSet};
use std::rc::Rc;

/// A name in upper case.
type Name = Box<[u8]>;

/// The meaning of a name.
#[derive(Clone, Debug)]
enum NameMeaning {
    Data(usize),
    Own(Name),
    Foreign(Name),
}

/// A call of a routine in the files, with its arguments by reference.
#[derive(Clone, Debug)]
struct Handed {
    callee: RoutineId,
    /// Numbers of parameters, with their arguments.
    given: Vec<(usize, NameMeaning)>,
}

/// The changes of a block itself, and its calls.
#[derive(Clone, Debug, Default)]
struct Direct {
    changes: Changes,
    calls: Vec<Handed>,
    /// Routines that run at some later moment because of it, while the program goes on.
    later: Vec<RoutineId>,
    /// Whether an unknown routine may run at some later moment.
    anything_later: bool,
}

impl Changes {
    const NOTHING: Self = Self {
        data: BTreeSet::new(),
        own: BTreeSet::new(),
        foreign: BTreeSet::new(),
        anything: false,
        switches: Switches::NONE,
        switches_off: Switches::NONE,
    };

    /// The possible changes of an unknown routine.
    pub(super) fn anything() -> Self {
        Self { anything: true, switches: Switches::FOREIGN, ..Self::NOTHING }
    }

    fn add(&mut self, found: &NameMeaning) {
        match found {
            NameMeaning::Data(at) => drop(self.data.insert(*at)),
            NameMeaning::Own(name) => drop(self.own.insert(name.clone())),
            NameMeaning::Foreign(name) => drop(self.foreign.insert(name.clone())),
        }
    }

    /// Adds the changes of a called routine. Returns whether any is new.
    fn call(&mut self, callee: &Self) -> bool {
        let before = (self.data.len(), self.own.len(), self.foreign.len(), self.flags());
        self.data.extend(&callee.data);
        self.foreign.extend(callee.foreign.iter().cloned());
        self.anything |= callee.anything;
        self.switches |= callee.switches;
        self.switches_off |= callee.switches_off;
        before != (self.data.len(), self.own.len(), self.foreign.len(), self.flags())
    }

    fn flags(&self) -> (bool, Switches, Switches) {
        (self.anything, self.switches, self.switches_off)
    }
}

impl<'a> Symbols<'a> {
    /// Computes the changes of each routine, and marks the data that the program assigns and those that may change at any moment.
    pub(super) fn find_changes(&mut self) {
        let ids: Vec<RoutineId> = self.all().collect();
        let mut direct = HashMap::new();
        let (mut aside, mut later) = (Vec::new(), Direct::default());
        for &id in &ids {
            let routine = self.routine(id);
            let mut whole = self.direct(id, &routine.body);
            let on_error = self.direct(id, routine.on_error());
            let mut handlers = Direct::default();
            for part in routine.other_handlers() {
                let part = self.direct(id, part);
                handlers.changes.call(&part.changes);
                handlers.changes.own.extend(part.changes.own);
                handlers.calls.extend(part.calls);
                handlers.later.extend(part.later);
            }
            match routine.kind {
                RoutineKind::Trap => {
                    later.calls.push(Handed { callee: id, given: Vec::new() });
                    aside.push(id);
                }
                RoutineKind::Func => aside.push(id),
                RoutineKind::Proc => {}
            }
            for found in [&whole, &handlers, &on_error] {
                aside.extend(&found.later);
                later.changes.anything |= found.anything_later;
            }
            aside.extend(handlers.calls.iter().chain(&on_error.calls).map(|call| call.callee));
            later.changes.call(&handlers.changes);
            let own: Vec<Name> = handlers.changes.own.iter().cloned().collect();
            if !own.is_empty() {
                self.volatile_own.insert(id, own);
            }
            later.calls.extend(handlers.calls.iter().cloned());
            for part in [handlers, on_error] {
                whole.changes.call(&part.changes);
                whole.changes.own.extend(part.changes.own);
                whole.calls.extend(part.calls);
            }
            direct.insert(id, whole);
        }
        let mut routines: HashMap<RoutineId, Changes> =
            ids.iter().map(|id| (*id, direct[id].changes.clone())).collect();
        let mut callers: HashMap<RoutineId, Vec<RoutineId>> = HashMap::new();
        for &id in &ids {
            let callees: BTreeSet<RoutineId> = direct[&id].calls.iter().map(|call| call.callee).collect();
            callees.into_iter().for_each(|callee| callers.entry(callee).or_default().push(id));
        }
        let mut waiting: BTreeSet<RoutineId> = ids.iter().copied().collect();
        while let Some(callee) = waiting.pop_last() {
            let changes = routines[&callee].clone();
            for caller in callers.get(&callee).into_iter().flatten() {
                let Some(known) = routines.get_mut(caller) else { continue };
                let mut more = known.call(&changes);
                for call in direct[caller].calls.iter().filter(|call| call.callee == callee) {
                    more |= self.hand_back(known, &changes, call);
                }
                if more {
                    waiting.insert(*caller);
                }
            }
        }
        // The code that runs at any moment, with its calls.
        let mut at_any_moment = later.changes;
        for call in &later.calls {
            at_any_moment.call(&routines[&call.callee]);
            self.hand_back(&mut at_any_moment, &routines[&call.callee], call);
        }
        let mut reached: BTreeSet<RoutineId> = aside.iter().copied().collect();
        while let Some(id) = aside.pop() {
            aside.extend(direct[&id].calls.iter().map(|call| call.callee).filter(|callee| reached.insert(*callee)));
        }
        let open = |at: &usize| self.variables[*at].storage != Storage::Const;
        let mut everything: BTreeSet<usize> = self.global_data().filter(open).collect();
        let mut assigned = BTreeSet::new();
        for id in &ids {
            assigned.extend(&routines[id].data);
        }
        everything.extend(&assigned);
        if at_any_moment.anything {
            at_any_moment.data.extend(&everything);
            at_any_moment.switches |= Switches::FOREIGN;
        }
        for id in &ids {
            self.foreign_assigned.extend(routines[id].foreign.iter().cloned());
        }
        for at in assigned {
            self.variables[at].assigned = true;
        }
        for &at in &at_any_moment.data {
            self.variables[at].assigned = true;
            self.variables[at].volatile = Some(Reason::Trap);
        }
        self.known = Known {
            routines,
            at_any_moment,
            aside: reached,
            everything: Rc::new(everything),
            blocks: RefCell::default(),
        };
    }

    /// Adds changes through parameters. Returns whether any is new.
    fn hand_back(&self, to: &mut Changes, callee: &Changes, call: &Handed) -> bool {
        let before = (to.data.len(), to.own.len(), to.foreign.len());
        for (param, found) in &call.given {
            if let Some(param) = self.routine(call.callee).params.get(*param)
                && callee.own.contains(&param_key(self, call.callee, param))
            {
                to.add(found);
            }
        }
        before != (to.data.len(), to.own.len(), to.foreign.len())
    }

    /// The changes of a routine, in its body or its handlers, with its calls.
    pub(super) fn changed_by(&self, id: RoutineId) -> &Changes {
        static NONE: Changes = Changes::NOTHING;
        self.known.routines.get(&id).unwrap_or(&NONE)
    }

    /// The changes of a block of a routine, with its calls.
    pub(super) fn changed_in(&self, id: RoutineId, block: &[Statement]) -> Rc<Changes> {
        let key = block.as_ptr() as usize;
        if let Some(found) = self.known.blocks.borrow().get(&key) {
            return Rc::clone(found);
        }
        let changes = Rc::new(self.close(self.direct(id, block)));
        self.known.blocks.borrow_mut().insert(key, Rc::clone(&changes));
        changes
    }

    fn close(&self, direct: Direct) -> Changes {
        let mut changes = direct.changes;
        for call in &direct.calls {
            let callee = self.changed_by(call.callee);
            changes.call(callee);
            self.hand_back(&mut changes, callee, call);
        }
        changes
    }

    /// Data that a routine that is not in the files could change.
    pub(super) fn everything(&self) -> Rc<BTreeSet<usize>> {
        Rc::clone(&self.known.everything)
    }

    fn direct(&self, id: RoutineId, block: &[Statement]) -> Direct {
        if block.is_empty() {
            return Direct::default();
        }
        let mut scan = Scan::new(self, id);
        scan.block(block);
        scan.out
    }
}

/// A walk over statements.
struct Scan<'s, 'a> {
    symbols: &'s Symbols<'a>,
    id: RoutineId,
    bytes: &'a [u8],
    /// The routine's own names, once they were needed.
    own: Option<HashSet<Name>>,
    out: Direct,
}

impl<'s, 'a> Scan<'s, 'a> {
    fn new(symbols: &'s Symbols<'a>, id: RoutineId) -> Self {
        let sources = symbols.sources;
        Self { symbols, id, bytes: &sources[id.file].bytes, own: None, out: Direct::default() }
    }

    fn block(&mut self, block: &[Statement]) {
        for statement in block {
            match statement {
                Statement::Simple(span) => self.simple(*span),
                Statement::If { arms, otherwise, .. } => {
                    for (condition, block) in arms {
                        self.expression(*condition);
                        self.block(block);
                    }
                    self.block(otherwise);
                }
                Statement::For { from, to, step, body, .. } => {
                    [Some(*from), Some(*to), *step].into_iter().flatten().for_each(|span| self.expression(span));
                    self.block(body);
                }
                Statement::While { condition, body, .. } => {
                    self.expression(*condition);
                    self.block(body);
                }
                Statement::Test { subject, cases, otherwise, .. } => {
                    self.expression(*subject);
                    for (values, block) in cases {
                        self.expression(*values);
                        self.block(block);
                    }
                    self.block(otherwise);
                }
                Statement::Return(value) => self.expression(*value),
                Statement::Connect(span) => self.connect(*span),
                Statement::Mark(_) => self.out.changes.switches.marks = true,
                Statement::Exit | Statement::Raise | Statement::Retry | Statement::TryNext | Statement::Goto(_) => {}
            }
        }
    }

    /// Where a name leads from here.
    fn find(&mut self, name: &[u8]) -> NameMeaning {
        let (symbols, id, bytes) = (self.symbols, self.id, self.bytes);
        let own = self.own.get_or_insert_with(|| {
            let routine = symbols.routine(id);
            let spans = routine.data.iter().map(|d| d.name).chain(routine.params.iter().map(|p| p.name));
            spans.map(|span| Box::from(&*Upper::new(&bytes[span.range()]))).collect()
        });
        let key = Upper::new(name);
        if own.contains(&*key) {
            return NameMeaning::Own(Box::from(&*key));
        }
        match symbols.find_data(symbols.module_of(id), &key) {
            Some(at) => NameMeaning::Data(at),
            None => NameMeaning::Foreign(Box::from(&*key)),
        }
    }

    /// Marks an argument as changed.
    fn change(&mut self, argument: Span) {
        let name = first_word(self.bytes, argument);
        if !name.is_empty() && whole_variable(self.bytes, argument) {
            let found = self.find(&self.bytes[name.range()]);
            self.out.changes.add(&found);
        }
    }

    fn connect(&mut self, span: Span) {
        let mut cursor = Cursor::new(self.bytes, span);
        cursor.next();
        let interrupt = cursor.peek();
        let mut last = interrupt;
        while cursor.peek().kind == LexemeKind::Word || cursor.peek().kind != LexemeKind::End {
            let lexeme = cursor.next();
            if lexeme.kind == LexemeKind::Word {
                last = lexeme;
            }
        }
        self.change(interrupt.span());
        if self.symbols.find_routine(self.symbols.module_of(self.id), &self.bytes[last.span().range()]).is_none() {
            self.out.anything_later = true;
        }
    }

    fn simple(&mut self, span: Span) {
        let word = first_word(self.bytes, span);
        let name = &self.bytes[word.range()];
        let routine = self.symbols.find_routine(self.symbols.module_of(self.id), name);
        let shape = if routine.is_none() { motion::shape(name) } else { None };
        if memchr::memchr(b'(', &self.bytes[span.range()]).is_some() {
            self.expression(span);
        }
        // A plain motion changes nothing.
        if shape.is_some_and(|s| s.zone != motion::Zone::Absent) && !is_synchronised(name) {
            return;
        }
        #[allow(clippy::cast_possible_truncation)]
        let Some(simple) = motion::split(self.bytes, self.id.file as u16, span) else { return };
        let call = match simple {
            Simple::Assignment { target, .. } => return self.change(Span { end: target.end, ..target }),
            Simple::Call(call) => call,
        };
        if let Some(shape) = shape {
            if is_synchronised(name) {
                // ToPoint, Speed, Zone, Tool, procedure.
                let procedure = call.positional().get(shape.to + 4).and_then(|text| self.routine_named(*text));
                match procedure {
                    Some(callee) => {
                        self.out.later.push(callee);
                        self.out.calls.push(Handed { callee, given: Vec::new() });
                    }
                    None => self.unknown(&Call::empty(word)),
                }
            } else if let Some(point) = call.positional().get(shape.via.unwrap_or(shape.to).wrapping_sub(1)) {
                // SearchPoint comes before the targets.
                self.change(*point);
            }
            return;
        }
        if call.late_bound {
            match self.routine_named(call.name) {
                Some(id) => self.call(id, &call),
                None => self.unknown(&call),
            }
        } else if let Some(id) = routine {
            self.call(id, &call);
        } else {
            self.instruction(name, &call);
        }
    }

    /// The routine that a text literal names.
    fn routine_named(&self, text: Span) -> Option<RoutineId> {
        let inner = self.bytes[text.range()].trim_ascii().strip_prefix(b"\"")?.strip_suffix(b"\"")?;
        let name = inner.rsplit(|b| *b == b':').next()?;
        self.symbols.find_routine(self.symbols.module_of(self.id), name)
    }

    fn unknown(&mut self, call: &Call) {
        self.out.changes.anything = true;
        self.out.changes.switches |= Switches::FOREIGN;
        call.given().for_each(|argument| self.change(argument));
    }

    fn instruction(&mut self, name: &[u8], call: &Call) {
        match predefined::instruction(name) {
            None => self.unknown(call),
            Some(Instruction::Arguments | Instruction::Steps) => {
                call.given().for_each(|argument| self.change(argument));
            }
            Some(Instruction::Options) => call.optional().iter().for_each(|(_, argument)| self.change(*argument)),
            Some(Instruction::DisplacementOn) => self.out.changes.switches.displacement = true,
            Some(Instruction::SoftOn) => self.out.changes.switches.soft = true,
            Some(Instruction::Load) => self.out.changes.switches.load = true,
            Some(Instruction::Velocity) => self.out.changes.switches.velocity = true,
            Some(Instruction::ArcMode) => self.out.changes.switches.arcs = true,
            Some(
                Instruction::AxisOffsetSet
                | Instruction::AxisOffsetOn
                | Instruction::UnitOn
                | Instruction::UnitOff
                | Instruction::MovesAxes,
            ) => self.out.changes.switches.axes = true,
            Some(Instruction::DataByName) => {
                let text = call.positional().first().map(|text| &self.bytes[text.range()]);
                let literal = text.and_then(|text| text.strip_prefix(b"\"")?.strip_suffix(b"\""));
                let literal = literal.filter(|_| name.eq_ignore_ascii_case(b"SetDataVal"));
                self.out.changes.data.extend(self.symbols.data_named(literal));
            }
            Some(Instruction::DisplacementOff) => self.out.changes.switches_off.displacement = true,
            Some(Instruction::SoftOff) => self.out.changes.switches_off.soft = true,
            Some(Instruction::AxisOffsetOff) => self.out.changes.switches_off.axes = true,
            Some(Instruction::Nothing | Instruction::Moves | Instruction::Ends | Instruction::Raises) => {}
        }
    }

    /// Adds a call of a routine in the files.
    fn call(&mut self, callee: RoutineId, call: &Call) {
        let params = &self.symbols.routine(callee).params;
        let theirs = &self.symbols.sources[callee.file].bytes;
        let mut given = Vec::new();
        let mut hand = |this: &mut Self, at: usize, argument: Span| {
            let name = first_word(this.bytes, argument);
            if params[at].by_reference && !name.is_empty() && whole_variable(this.bytes, argument) {
                given.push((at, this.find(&this.bytes[name.range()])));
            }
        };
        let required = (0..params.len()).filter(|at| !params[*at].optional);
        for (at, argument) in required.zip(call.positional()) {
            hand(self, at, *argument);
        }
        for (name, value) in call.optional() {
            let name = &self.bytes[name.range()];
            if let Some(at) = params.iter().position(|p| theirs[p.name.range()].eq_ignore_ascii_case(name)) {
                hand(self, at, *value);
            }
        }
        let undeclared = undeclared(self.symbols.routine(callee), theirs, self.bytes, call);
        undeclared.into_iter().for_each(|argument| self.change(argument));
        self.out.calls.push(Handed { callee, given });
    }

    /// Adds the functions that an expression calls.
    fn expression(&mut self, expression: Span) {
        if memchr::memchr(b'(', &self.bytes[expression.range()]).is_none() {
            return;
        }
        let mut cursor = Cursor::new(self.bytes, expression);
        loop {
            let name = cursor.next();
            if name.kind == LexemeKind::End {
                return;
            }
            if name.kind != LexemeKind::Word || cursor.peek().kind != LexemeKind::Mark(b'(') {
                continue;
            }
            let text = cursor.text(name);
            let routine = self.symbols.find_routine(self.symbols.module_of(self.id), text);
            let known = predefined::function(text);
            if routine.is_none() && (known == Some(Function::Nothing) || is_word_of_operator(text)) {
                continue;
            }
            let mut behind = cursor;
            behind.next();
            let mut call = Call::empty(name.span());
            #[allow(clippy::cast_possible_truncation)]
            let split = motion::arguments(&mut behind, self.id.file as u16, &mut call).is_some();
            match (routine, known) {
                (Some(id), _) if split => self.call(id, &call),
                (None, Some(_)) if split => call.given().for_each(|argument| self.change(argument)),
                _ => self.unknown(&call),
            }
        }
    }
}

/// `NOT (…)`, `AND (…)`: a word before a bracket that calls nothing.
pub(super) fn is_word_of_operator(word: &[u8]) -> bool {
    [&b"NOT"[..], b"AND", b"OR", b"XOR", b"DIV", b"MOD", b"IF", b"ELSEIF", b"WHILE", b"TEST", b"CASE", b"RETURN"]
        .iter()
        .any(|operator| operator.eq_ignore_ascii_case(word))
}

/// `MoveLSync` and similar instructions: a procedure runs during the motion.
pub(super) fn is_synchronised(name: &[u8]) -> bool {
    name.len() > 4 && name[name.len() - 4..].eq_ignore_ascii_case(b"SYNC")
}

fn param_key(symbols: &Symbols<'_>, id: RoutineId, param: &Param) -> Name {
    Box::from(&*Upper::new(&symbols.sources[id.file].bytes[param.name.range()]))
}

/// Whether a span is only a name with components or indices, which a called routine can change.
pub(super) fn whole_variable(bytes: &[u8], span: Span) -> bool {
    let mut cursor = Cursor::new(bytes, span);
    let mut depth = 0_usize;
    loop {
        let lexeme = cursor.next();
        match lexeme.kind {
            LexemeKind::End => return true,
            LexemeKind::Mark(b'{') => depth += 1,
            LexemeKind::Mark(b'}') => depth = depth.saturating_sub(1),
            LexemeKind::Word | LexemeKind::Mark(b'.') => {}
            _ if depth > 0 => {}
            _ => return false,
        }
    }
}
