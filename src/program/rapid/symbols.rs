//! Names: data and routines of all modules, and which data the program itself changes.

use super::lex::{Cursor, Kind};
use super::motion::{self, Call, Simple};
use super::tree::{Data, File, Param, Routine, RoutineKind, Statement, Storage};
use super::value::Value;
use crate::text::{Source, Span, decode};
use std::cell::RefCell;
use std::collections::HashMap;
use std::rc::Rc;
use std::sync::Arc;

/// Longest name that is looked up; RAPID itself stops at 32.
const MAX_NAME: usize = 64;

/// A name in upper case, without allocation.
#[derive(Clone, Copy)]
pub(super) struct Upper {
    bytes: [u8; MAX_NAME],
    len: usize,
}

impl Upper {
    /// An empty name, which nothing has, for names that are too long.
    pub(super) fn new(name: &[u8]) -> Self {
        let mut bytes = [0; MAX_NAME];
        let len = if name.len() <= MAX_NAME { name.len() } else { 0 };
        bytes[..len].copy_from_slice(&name[..len]);
        bytes[..len].make_ascii_uppercase();
        Self { bytes, len }
    }
}

impl std::ops::Deref for Upper {
    type Target = [u8];
    fn deref(&self) -> &[u8] {
        &self.bytes[..self.len]
    }
}

pub(super) type Names = HashMap<Box<[u8]>, usize>;

/// What a variable holds.
#[derive(Clone, Debug)]
pub(super) enum Content {
    /// Its declaration, not read yet.
    Declared(Span),
    /// Being read: an initial value that needs itself.
    Busy,
    Is(Value),
}

#[derive(Clone, Debug)]
pub(super) struct Variable {
    /// As the author spelled it.
    pub(super) name: Arc<str>,
    /// Type in upper case.
    pub(super) kind: Arc<[u8]>,
    pub(super) storage: Storage,
    pub(super) source: u16,
    pub(super) module: usize,
    pub(super) content: Content,
    /// The program assigns it somewhere.
    pub(super) assigned: bool,
    /// It is assigned where the run as read does not pass (traps, error handlers).
    pub(super) volatile: bool,
    /// Declared data (not a parameter or a loop's variable): its statement.
    pub(super) declared: Option<Span>,
}

/// A routine by file, module and place in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(super) struct RoutineId {
    pub(super) file: usize,
    pub(super) module: usize,
    pub(super) routine: usize,
}

/// Everything declared outside routines.
pub(super) struct Symbols<'a> {
    pub(super) sources: &'a [Source],
    pub(super) files: &'a [File],
    pub(super) global: Names,
    /// LOCAL data of each module, over all files.
    pub(super) local: Vec<Names>,
    pub(super) routines: HashMap<Box<[u8]>, RoutineId>,
    /// LOCAL routines of each module.
    pub(super) local_routines: Vec<HashMap<Box<[u8]>, RoutineId>>,
    /// Number of modules in the files before each.
    pub(super) first_module: Vec<usize>,
    pub(super) variables: Vec<Variable>,
    /// Components of the program's own record types: type → name → place and type.
    pub(super) records: HashMap<Box<[u8]>, Vec<Field>>,
    /// Names that each routine changes, once it was asked for.
    changed: RefCell<HashMap<RoutineId, NameList>>,
    /// The same, by its own assignments only: what can come back through a parameter.
    handed_back: RefCell<HashMap<RoutineId, NameList>>,
}

/// Name and type of a component, in upper case.
pub(super) type Field = (Upper, Arc<[u8]>);
/// Names in upper case.
type NameList = Rc<[Box<[u8]>]>;

impl<'a> Symbols<'a> {
    pub(super) fn new(sources: &'a [Source], files: &'a [File]) -> Self {
        let mut symbols = Self {
            sources,
            files,
            global: Names::new(),
            local: Vec::new(),
            routines: HashMap::new(),
            local_routines: Vec::new(),
            changed: RefCell::default(),
            handed_back: RefCell::default(),
            first_module: Vec::new(),
            variables: Vec::new(),
            records: HashMap::new(),
        };
        for (f, file) in files.iter().enumerate() {
            let bytes = &sources[f].bytes;
            symbols.first_module.push(symbols.local.len());
            for (m, module) in file.modules.iter().enumerate() {
                let id = symbols.local.len();
                symbols.local.push(Names::new());
                symbols.local_routines.push(HashMap::new());
                for data in &module.data {
                    let at = symbols.variables.len();
                    let variable = declared(bytes, f, id, data);
                    symbols.variables.push(variable);
                    let key = Box::from(&*Upper::new(&bytes[data.name.range()]));
                    let names = if data.local { &mut symbols.local[id] } else { &mut symbols.global };
                    // The first of two equal names: the controller would refuse the second.
                    names.entry(key).or_insert(at);
                }
                for record in &module.records {
                    let fields = record.fields.iter().map(|(kind, name)| {
                        let kind = Upper::new(&bytes[kind.range()]);
                        (Upper::new(&bytes[name.range()]), Arc::from(&*kind))
                    });
                    let fields = fields.collect();
                    symbols.records.insert(Box::from(&*Upper::new(&bytes[record.name.range()])), fields);
                }
                for (r, routine) in module.routines.iter().enumerate() {
                    let key: Box<[u8]> = Box::from(&*Upper::new(&bytes[routine.name.range()]));
                    let place = RoutineId { file: f, module: m, routine: r };
                    if routine.local {
                        symbols.local_routines[id].entry(key).or_insert(place);
                    } else {
                        symbols.routines.entry(key).or_insert(place);
                    }
                }
            }
        }
        symbols.find_assignments();
        symbols
    }

    pub(super) fn routine(&self, id: RoutineId) -> &'a Routine {
        &self.files[id.file].modules[id.module].routines[id.routine]
    }

    pub(super) fn module_of(&self, id: RoutineId) -> usize {
        self.first_module[id.file] + id.module
    }

    /// A routine by the name that `module` knows it by.
    pub(super) fn find_routine(&self, module: usize, name: &[u8]) -> Option<RoutineId> {
        let key = Upper::new(name);
        let local = self.local_routines.get(module).filter(|l| !l.is_empty()).and_then(|l| l.get(&*key));
        local.or_else(|| self.routines.get(&*key)).copied()
    }

    /// Data by the name that `module` knows it by.
    pub(super) fn find_data(&self, module: usize, key: &[u8]) -> Option<usize> {
        self.local.get(module).and_then(|l| l.get(key)).or_else(|| self.global.get(key)).copied()
    }

    /// All routines, in file order.
    pub(super) fn all(&self) -> impl Iterator<Item = RoutineId> + use<'a> {
        let files = self.files;
        files.iter().enumerate().flat_map(|(file, f)| {
            f.modules.iter().enumerate().flat_map(move |(module, m)| {
                (0..m.routines.len()).map(move |routine| RoutineId { file, module, routine })
            })
        })
    }

    /// Marks the data that the program assigns, wherever that is.
    fn find_assignments(&mut self) {
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
        if let Some(found) = self.changed.borrow().get(&id) {
            return Rc::clone(found);
        }
        let routine = self.routine(id);
        let mut names = Vec::new();
        self.assigned_names(id, &routine.body, &mut names);
        self.assigned_names(id, &routine.handlers, &mut names);
        let names = list(names);
        self.changed.borrow_mut().insert(id, Rc::clone(&names));
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

    /// Whether a known motion instruction stands in a block.
    pub(super) fn moves(&self, id: RoutineId, block: &[Statement]) -> bool {
        block.iter().any(|statement| match statement {
            Statement::Simple(span) => {
                let bytes = &self.sources[id.file].bytes;
                motion::shape(&bytes[first_word(bytes, *span).range()]).is_some()
            }
            Statement::If { arms, otherwise, .. } => {
                arms.iter().any(|(_, b)| self.moves(id, b)) || self.moves(id, otherwise)
            }
            Statement::For { body, .. } | Statement::While { body, .. } => self.moves(id, body),
            Statement::Test { cases, otherwise, .. } => {
                cases.iter().any(|(_, b)| self.moves(id, b)) || self.moves(id, otherwise)
            }
            Statement::Return | Statement::Exit | Statement::Goto(_) | Statement::Mark(_) => false,
        })
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
        if let Some(found) = self.handed_back.borrow().get(&id) {
            return Rc::clone(found);
        }
        let bytes = &self.sources[id.file].bytes;
        let routine = self.routine(id);
        let mut names = Vec::new();
        let mut walk = vec![&routine.body[..], &routine.handlers[..]];
        while let Some(block) = walk.pop() {
            for statement in block {
                match statement {
                    Statement::Simple(span) => {
                        #[allow(clippy::cast_possible_truncation)]
                        match motion::split(bytes, id.file as u16, *span) {
                            Some(Simple::Assignment { target, .. }) => {
                                names.push(Box::from(&*Upper::new(&bytes[first_word(bytes, target).range()])));
                            }
                            // Handed on: taken as changed unless to a motion or a harmless instruction.
                            Some(Simple::Call(call)) => {
                                let name = &bytes[call.name.range()];
                                let known = motion::shape(name).is_some()
                                    || harmless(name)
                                    || self.find_routine(self.module_of(id), name).is_some();
                                if !known {
                                    names.extend(
                                        call.given()
                                            .map(|a| Box::from(&*Upper::new(&bytes[first_word(bytes, a).range()]))),
                                    );
                                }
                            }
                            None => {}
                        }
                    }
                    Statement::If { arms, otherwise, .. } => {
                        walk.extend(arms.iter().map(|(_, b)| &b[..]));
                        walk.push(otherwise);
                    }
                    Statement::For { body, .. } | Statement::While { body, .. } => walk.push(body),
                    Statement::Test { cases, otherwise, .. } => {
                        walk.extend(cases.iter().map(|(_, b)| &b[..]));
                        walk.push(otherwise);
                    }
                    Statement::Return | Statement::Exit | Statement::Goto(_) | Statement::Mark(_) => {}
                }
            }
        }
        let names = list(names);
        self.handed_back.borrow_mut().insert(id, Rc::clone(&names));
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

pub(super) fn declared(bytes: &[u8], file: usize, module: usize, data: &Data) -> Variable {
    let kind = Upper::new(&bytes[data.kind.range()]);
    let unset = || match &*kind {
        b"NUM" | b"DNUM" if data.dims.is_none() => Value::Num(0.0, None),
        b"BOOL" if data.dims.is_none() => Value::Bool(false),
        b"STRING" if data.dims.is_none() => Value::Text(std::rc::Rc::from(&b""[..])),
        _ => Value::Unknown("data without an initial value"),
    };
    Variable {
        name: decode(&bytes[data.name.range()]).as_ref().into(),
        kind: Arc::from(&*kind),
        storage: data.storage,
        #[allow(clippy::cast_possible_truncation)]
        source: file as u16,
        module,
        content: data.value.map_or_else(|| Content::Is(unset()), Content::Declared),
        assigned: false,
        volatile: false,
        declared: Some(data.statement),
    }
}

/// The first word of a span; empty where it begins with something else.
pub(super) fn first_word(bytes: &[u8], span: Span) -> Span {
    let lexeme = Cursor::new(bytes, span).peek();
    if lexeme.kind == Kind::Word { lexeme.span() } else { Span { start: span.start, end: span.start } }
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

/// Predefined functions that hand back more than their value, through an argument.
const WRITING_FUNCTIONS: [&str; 4] = ["StrToVal", "TestAndSet", "GetNextSym", "GetNextMechUnit"];

/// Predefined instructions that change none of their arguments, and are met often.
pub(super) fn harmless(name: &[u8]) -> bool {
    const NAMES: [&str; 62] = [
        "TPWrite",
        "TPErase",
        "TPShow",
        "WaitTime",
        "WaitDI",
        "WaitDO",
        "WaitAI",
        "WaitAO",
        "WaitGI",
        "WaitGO",
        "WaitUntil",
        "WaitRob",
        "Set",
        "Reset",
        "SetDO",
        "SetAO",
        "SetGO",
        "PulseDO",
        "InvertDO",
        "ConfL",
        "ConfJ",
        "SingArea",
        "AccSet",
        "VelSet",
        "WorldAccLim",
        "PathAccLim",
        "PathResol",
        "GripLoad",
        "ActUnit",
        "DeactUnit",
        "PDispSet",
        "PDispOff",
        "PDispOn",
        "EOffsSet",
        "EOffsOn",
        "EOffsOff",
        "SoftAct",
        "SoftDeact",
        "Stop",
        "Break",
        "StopMove",
        "StartMove",
        "ClkStart",
        "ClkStop",
        "ClkReset",
        "Write",
        "WriteBin",
        "Close",
        "SocketSend",
        "SocketClose",
        "Load",
        "UnLoad",
        "ErrWrite",
        "IDelete",
        "IEnable",
        "IDisable",
        "TriggIO",
        "TriggEquip",
        "CornerPathWarning",
        "WZDisable",
        "MotionSup",
        "CirPathMode",
    ];
    NAMES.iter().any(|n| n.as_bytes().eq_ignore_ascii_case(name))
}
