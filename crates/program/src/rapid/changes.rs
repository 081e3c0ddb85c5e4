//! Finds what statements could change, without running them. This is used if it is unknown whether, or how often, they run.

use super::expression::{Arguments, Call, Expression, ExpressionKind};
use super::known::{Changes, Known, RoutineId};
use super::lasting::{Lasting, LastingStates};
use super::motion::{self, Shape};
use super::predefined::{self, Function, Instruction};
use super::symbols::{Content, Symbols, Upper};
use super::tree::{Param, RoutineKind, Statement, StatementKind, Storage, statements};
use crate::Reason;
use std::cell::RefCell;
use std::collections::{BTreeSet, HashMap, HashSet};
use std::rc::Rc;
use std::sync::LazyLock;

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
    /// The possible changes of an unknown routine.
    pub(super) fn anything() -> Self {
        Self { anything: true, states: LastingStates::FOREIGN, ..Self::default() }
    }

    fn add(&mut self, found: &NameMeaning) {
        match found {
            NameMeaning::Data(at) => drop(self.data.insert(*at)),
            NameMeaning::Own(name) => drop(self.own.insert(name.clone())),
            NameMeaning::Foreign(name) => drop(self.foreign.insert(name.clone())),
        }
    }

    /// Adds the changes of a called routine. Returns whether any is new.
    pub(super) fn call(&mut self, callee: &Self) -> bool {
        let before = (self.data.len(), self.own.len(), self.foreign.len(), self.flags());
        self.data.extend(&callee.data);
        self.foreign.extend(callee.foreign.iter().cloned());
        self.anything |= callee.anything;
        self.states = self.states.union(callee.states);
        self.sets = self.sets.union(callee.sets);
        self.end_cycle |= callee.end_cycle;
        before != (self.data.len(), self.own.len(), self.foreign.len(), self.flags())
    }

    fn flags(&self) -> (bool, [LastingStates; 2], bool) {
        (self.anything, [self.states, self.sets], self.end_cycle)
    }
}

impl<'a> Symbols<'a> {
    /// Computes the changes of each routine, and marks the data that the program assigns and those that may change at any moment.
    pub(super) fn find_changes(&mut self) {
        let ids: Vec<RoutineId> = self.all().collect();
        let mut direct = HashMap::new();
        let (mut unfollowed, mut later) = (Vec::new(), Direct::default());
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
                    unfollowed.push(id);
                }
                RoutineKind::Func => unfollowed.push(id),
                RoutineKind::Proc => {}
            }
            for found in [&whole, &handlers, &on_error] {
                unfollowed.extend(&found.later);
                later.changes.anything |= found.anything_later;
            }
            unfollowed.extend(handlers.calls.iter().chain(&on_error.calls).map(|call| call.callee));
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
        let mut reached: BTreeSet<RoutineId> = unfollowed.iter().copied().collect();
        while let Some(id) = unfollowed.pop() {
            unfollowed
                .extend(direct[&id].calls.iter().map(|call| call.callee).filter(|callee| reached.insert(*callee)));
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
            at_any_moment.states = at_any_moment.states.union(LastingStates::FOREIGN);
        }
        for id in &ids {
            self.foreign_assigned.extend(routines[id].foreign.iter().cloned());
        }
        assigned.extend(&at_any_moment.data);
        for at in assigned {
            let variable = &mut self.variables[at];
            variable.assigned = true;
            if let Content::Is(unset) = &mut variable.content {
                *unset = unset.left(Reason::TargetChanged);
            }
        }
        for &at in &at_any_moment.data {
            self.variables[at].volatile = Some(Reason::Trap);
        }
        self.known = Known {
            routines,
            at_any_moment,
            unfollowed: reached,
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
        static NONE: LazyLock<Changes> = LazyLock::new(Changes::default);
        self.known.routines.get(&id).unwrap_or_else(|| &NONE)
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
        for statement in statements(block) {
            statement.each(&mut |part: &Expression| {
                if let ExpressionKind::Call(call) = &part.kind {
                    self.function(call);
                }
            });
            match &statement.kind {
                StatementKind::Assign(assignment) => self.change(&assignment.to),
                StatementKind::Call(call) => self.procedure(call),
                StatementKind::Connect(connect) => {
                    self.change(&connect.interrupt);
                    let trap = &self.bytes[connect.trap.range()];
                    self.out.anything_later |=
                        self.symbols.find_routine(self.symbols.module_of(self.id), trap).is_none();
                }
                StatementKind::Mark(_) => self.out.changes.states.insert(Lasting::Mark),
                StatementKind::Exit => self.out.changes.end_cycle = true,
                _ => {}
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
    fn change(&mut self, argument: &Expression) {
        match (&argument.kind, argument.variable()) {
            (_, Some(name)) => {
                let found = self.find(&self.bytes[name.range()]);
                self.out.changes.add(&found);
            }
            // Text that is not understood may have anything in it.
            (ExpressionKind::Unknown(_, parts), None) => parts.iter().for_each(|part| self.change(part)),
            _ => {}
        }
    }

    /// A statement that calls a procedure or an instruction.
    fn procedure(&mut self, call: &Call) {
        let (name, arguments) = (&self.bytes[call.name.range()], &call.arguments);
        if arguments.is_cut {
            return self.unknown(arguments);
        }
        let chosen = self.symbols.chosen_by(self.symbols.module_of(self.id), call, self.bytes);
        if !chosen.is_empty() {
            let none = Arguments::default();
            let given = if call.late.is_some() { arguments } else { &none };
            return chosen.into_iter().for_each(|id| self.call(id, given));
        }
        if let Some(name) = &call.late {
            return match self.routine_named(name) {
                Some(id) => self.call(id, arguments),
                None => self.unknown(arguments),
            };
        }
        match (self.symbols.find_routine(self.symbols.module_of(self.id), name), motion::shape(name)) {
            (Some(id), _) => self.call(id, arguments),
            (None, Some(shape)) => self.motion(name, arguments, shape),
            (None, None) => self.instruction(name, arguments),
        }
    }

    fn motion(&mut self, name: &[u8], arguments: &Arguments, shape: Shape) {
        if is_synchronised(name) {
            // ToPoint, Speed, Zone, Tool, procedure.
            match arguments.positional.get(shape.to + 4).and_then(|name| self.routine_named(name)) {
                Some(callee) => {
                    self.out.later.push(callee);
                    self.out.calls.push(Handed { callee, given: Vec::new() });
                }
                None => self.unknown(&Arguments::default()),
            }
        } else if shape.zone == motion::Zone::Absent
            && let Some(point) = arguments.positional.get(shape.via.unwrap_or(shape.to).wrapping_sub(1))
        {
            // SearchPoint comes before the targets. All other motions change nothing.
            self.change(point);
        }
    }

    /// The routine that a text literal names.
    fn routine_named(&self, name: &Expression) -> Option<RoutineId> {
        self.symbols.find_routine_in_text(self.symbols.module_of(self.id), name.text_literal(self.bytes)?)
    }

    fn unknown(&mut self, arguments: &Arguments) {
        self.out.changes.anything = true;
        self.may_set(LastingStates::FOREIGN);
        arguments.given().for_each(|argument| self.change(argument));
    }

    fn may_set(&mut self, states: LastingStates) {
        self.out.changes.states = self.out.changes.states.union(states);
    }

    fn instruction(&mut self, name: &[u8], arguments: &Arguments) {
        let known = predefined::instruction(name);
        known.and_then(Instruction::lasting).into_iter().for_each(|state| self.out.changes.sets.insert(state));
        if known == Some(Instruction::Waits) {
            for name in arguments.positional.first().map_or_else(Vec::new, Expression::names) {
                let found = self.find(&self.bytes[name.range()]);
                self.out.changes.add(&found);
            }
        }
        match known {
            None => self.unknown(arguments),
            Some(Instruction::Arguments | Instruction::Steps) => {
                arguments.given().for_each(|argument| self.change(argument));
            }
            Some(Instruction::Options | Instruction::Waits) => {
                arguments.optional_values().for_each(|argument| self.change(argument))
            }
            Some(Instruction::Load) => self.out.changes.states.insert(Lasting::Load),
            Some(
                set @ (Instruction::DisplacementOn
                | Instruction::SoftOn
                | Instruction::Velocity
                | Instruction::ArcMode
                | Instruction::Configuration),
            ) => set.lasting().into_iter().for_each(|state| self.out.changes.states.insert(state)),
            Some(Instruction::Ends) => self.out.changes.end_cycle = true,
            Some(
                Instruction::AxisOffsetSet
                | Instruction::AxisOffsetOn
                | Instruction::UnitOn
                | Instruction::UnitOff
                | Instruction::MovesAxes,
            ) => self.may_set(LastingStates::AXES),
            Some(Instruction::DataByName) => {
                let text = arguments.positional.first().map(|text| &self.bytes[text.span.range()]);
                let literal = text.and_then(|text| text.strip_prefix(b"\"")?.strip_suffix(b"\""));
                let literal = literal.filter(|_| name.eq_ignore_ascii_case(b"SetDataVal"));
                self.out.changes.data.extend(self.symbols.data_named(literal));
            }
            Some(
                Instruction::Nothing
                | Instruction::Moves
                | Instruction::ClearsPath
                | Instruction::Raises
                | Instruction::DisplacementOff
                | Instruction::SoftOff
                | Instruction::AxisOffsetOff,
            ) => {}
        }
    }

    /// Adds a call of a routine in the files.
    fn call(&mut self, callee: RoutineId, arguments: &Arguments) {
        let routine = self.symbols.routine(callee);
        let arguments = arguments.given_to(routine, self.bytes, &self.symbols.sources[callee.file].bytes);
        let mut given = Vec::new();
        for argument in
            arguments.to_parameters.iter().filter(|argument| routine.params[argument.parameter].by_reference)
        {
            if let Some(name) = argument.value.and_then(Expression::variable) {
                given.push((argument.parameter, self.find(&self.bytes[name.range()])));
            }
        }
        arguments.others.into_iter().for_each(|argument| self.change(argument));
        self.out.calls.push(Handed { callee, given });
    }

    /// Adds a call of a function.
    fn function(&mut self, call: &Call) {
        let (name, arguments) = (&self.bytes[call.name.range()], &call.arguments);
        match (self.symbols.find_routine(self.symbols.module_of(self.id), name), predefined::function(name)) {
            _ if arguments.is_cut => self.unknown(arguments),
            (Some(id), _) => self.call(id, arguments),
            (None, Some(Function::Nothing)) => {}
            (None, Some(Function::Arguments)) => arguments.given().for_each(|argument| self.change(argument)),
            (None, None) => self.unknown(arguments),
        }
    }
}

/// Whether the arguments of a predefined instruction or function, or what follows a word of the language, keep their values.
pub(crate) fn changes_nothing(name: &[u8]) -> bool {
    const WORDS: [&[u8]; 17] = [
        b"IF", b"ELSEIF", b"WHILE", b"FOR", b"FROM", b"TO", b"STEP", b"TEST", b"AND", b"OR", b"XOR", b"NOT", b"DIV",
        b"MOD", b"RETURN", b"RAISE", b"ERROR",
    ];
    let moves = motion::shape(name).is_some_and(|shape| shape.zone != motion::Zone::Absent);
    let keeps = |instruction| {
        use Instruction::{Arguments, DataByName, Options, Steps, Waits};
        !matches!(instruction, Arguments | DataByName | Options | Steps | Waits)
    };
    moves
        || WORDS.contains(&name)
        || predefined::instruction(name).is_some_and(keeps)
        || predefined::function(name) == Some(Function::Nothing)
}

/// `MoveLSync` and similar instructions: a procedure runs during the motion.
pub(super) fn is_synchronised(name: &[u8]) -> bool {
    name.len() > 4 && name[name.len() - 4..].eq_ignore_ascii_case(b"SYNC")
}

fn param_key(symbols: &Symbols<'_>, id: RoutineId, param: &Param) -> Name {
    Box::from(&*Upper::new(&symbols.sources[id.file].bytes[param.name.range()]))
}
