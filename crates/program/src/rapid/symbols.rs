//! Names: data and routines of all modules, and those that RAPID predefines.

use super::expression::{Call, Expression};
use super::known::{Known, RoutineId};
use super::tree::{Data, File, Routine, RoutineKind, Storage};
use super::value::Value;
use crate::Reason;
use deflex_text::{Source, Span, decode};
use std::collections::{BTreeSet, HashMap, HashSet};
use std::rc::Rc;
use std::sync::Arc;

/// Longest name that is looked up; RAPID allows 32 characters.
const MAX_NAME: usize = 64;

/// A name in upper case, without allocation.
#[derive(Clone, Copy)]
pub(super) struct Upper {
    bytes: [u8; MAX_NAME],
    len: usize,
}

impl Upper {
    /// The name in upper case; names that are too long become empty, which matches nothing.
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

/// The content of a variable.
#[derive(Clone, Debug)]
pub(super) enum Content<'a> {
    /// The initial value, which is not yet evaluated.
    Declared(&'a Expression),
    /// An initial value that is being evaluated; found again, it depends on itself.
    Busy,
    /// A part of another variable: a parameter by reference for a component or an element.
    Part(Rc<VariablePart>),
    Is(Value),
}

/// A part of a variable.
#[derive(Clone, Debug)]
pub(super) struct VariablePart {
    pub(super) of: usize,
    /// The known components and elements, counted from 0.
    pub(super) path: Vec<usize>,
    /// Whether the whole path is known.
    pub(super) known: bool,
}

#[derive(Clone, Debug)]
pub(super) struct Variable<'a> {
    /// As the author spelled it.
    pub(super) name: Arc<str>,
    /// Type in upper case.
    pub(super) kind: Arc<[u8]>,
    pub(super) storage: Storage,
    pub(super) source: u16,
    pub(super) module: usize,
    pub(super) content: Content<'a>,
    /// The program assigns it somewhere.
    pub(super) assigned: bool,
    /// Why it may change at any moment (traps, error handlers).
    pub(super) volatile: Option<Reason>,
    /// The files do not declare this name.
    pub(super) foreign: bool,
    /// Its declaration; `None` for parameters and loop variables.
    pub(super) declared: Option<&'a Data>,
}

/// Everything declared outside routines.
#[derive(Default)]
pub(super) struct Symbols<'a> {
    pub(super) sources: &'a [Source],
    pub(super) files: &'a [File],
    pub(super) global: Names,
    /// LOCAL data of each module, over all files, and its data that another module declared before.
    pub(super) local: Vec<Names>,
    pub(super) routines: HashMap<Box<[u8]>, RoutineId>,
    /// LOCAL routines of each module, and its routines that another module declared before.
    pub(super) local_routines: Vec<HashMap<Box<[u8]>, RoutineId>>,
    /// Modules by their name in upper case.
    modules: HashMap<Box<[u8]>, usize>,
    /// For each file, the number of modules in the files before.
    pub(super) first_module: Vec<usize>,
    pub(super) variables: Vec<Variable<'a>>,
    /// Data that several modules declare: of each, the first one and another one.
    again: Vec<[usize; 2]>,
    /// Data that other modules declare otherwise, with an unknown value for modules that declare neither.
    otherwise: HashMap<usize, usize>,
    /// Routines that other modules declare otherwise.
    routines_otherwise: HashSet<RoutineId>,
    /// How many of them are data of modules; parameters and data of routines follow.
    pub(super) data: usize,
    /// Components of the program's own record types, by type: name and type of each.
    pub(super) records: HashMap<Box<[u8]>, Vec<Field>>,
    pub(super) known: Known,
    /// Names that the program assigns without a declaration, in upper case.
    pub(super) foreign_assigned: BTreeSet<Box<[u8]>>,
    /// Data of routines that their handlers assign.
    pub(super) volatile_own: HashMap<RoutineId, Vec<Box<[u8]>>>,
}

/// Name and type of a component, in upper case.
pub(super) type Field = (Upper, Arc<[u8]>);

impl<'a> Symbols<'a> {
    pub(super) fn new(sources: &'a [Source], files: &'a [File]) -> Self {
        let mut symbols = Self { sources, files, ..Self::default() };
        for (f, file) in files.iter().enumerate() {
            let bytes = &sources[f].bytes;
            symbols.first_module.push(symbols.local.len());
            for (m, module) in file.modules.iter().enumerate() {
                let id = symbols.local.len();
                symbols.modules.entry(Box::from(&*Upper::new(&bytes[module.name.range()]))).or_insert(id);
                symbols.local.push(Names::new());
                symbols.local_routines.push(HashMap::new());
                for data in &module.data {
                    let at = symbols.variables.len();
                    let variable = declared(bytes, f, id, data);
                    symbols.variables.push(variable);
                    let key = Box::from(&*Upper::new(&bytes[data.name.range()]));
                    symbols.add_data(key, at, id, data.local);
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
                    symbols.add_routine(key, place, id, routine);
                }
            }
        }
        symbols.add_unknown();
        symbols.data = symbols.variables.len();
        symbols.find_changes();
        symbols.find_shared();
        symbols
    }

    /// Adds data of a module. Programs of their own, which may declare the same names, may be given together: each module means its own.
    fn add_data(&mut self, key: Box<[u8]>, at: usize, module: usize, is_local: bool) {
        let first = self.global.get(&key).copied().filter(|first| self.variables[*first].module != module);
        if is_local || first.is_some() {
            self.local[module].entry(key).or_insert(at);
        } else {
            self.global.entry(key).or_insert(at);
        }
        self.again.extend(first.filter(|_| !is_local).map(|first| [first, at]));
    }

    fn add_routine(&mut self, key: Box<[u8]>, id: RoutineId, module: usize, routine: &Routine) {
        let first = self.routines.get(&key).copied().filter(|first| self.module_of(*first) != module);
        if routine.local || first.is_some() {
            self.local_routines[module].entry(key).or_insert(id);
        } else {
            self.routines.entry(key).or_insert(id);
        }
        let text = |id: RoutineId| plain(&self.sources[id.file].bytes[self.routine(id).text.range()]);
        let differs = |first: &RoutineId| !self.is_version(self.module_of(*first), module) && text(*first) != text(id);
        if let Some(first) = first.filter(|first| !routine.local && differs(first)) {
            self.routines_otherwise.insert(first);
        }
    }

    /// Adds the values of data that modules declare differently, for modules that declare neither.
    fn add_unknown(&mut self) {
        let text = |at: usize| {
            let variable: &Variable<'_> = &self.variables[at];
            let span = variable.declared.map(|data| Span { start: data.kind.start, ..data.statement });
            span.map(|span| plain(&self.sources[usize::from(variable.source)].bytes[span.range()]))
        };
        let differs = |[first, other]: &&[usize; 2]| {
            let [a, b] = [first, other].map(|at| self.variables[*at].module);
            !self.is_version(a, b) && text(*first) != text(*other)
        };
        let differing: BTreeSet<usize> = self.again.iter().filter(differs).map(|[first, _]| *first).collect();
        for first in differing {
            let content = Content::Is(Value::Unknown(Reason::DeclaredOtherwise));
            let unknown = Variable { content, declared: None, ..self.variables[first].clone() };
            self.otherwise.insert(first, self.variables.len());
            self.variables.push(unknown);
        }
    }

    /// Whether two modules have the same name: one is another version of the other.
    fn is_version(&self, a: usize, b: usize) -> bool {
        let name = |module: usize| {
            let file = self.first_module.partition_point(|first| *first <= module) - 1;
            let name = self.files[file].modules[module - self.first_module[file]].name;
            Upper::new(&self.sources[file].bytes[name.range()])
        };
        *name(a) == *name(b)
    }

    /// Makes `PERS` unknown that several modules declare and another module assigns: tasks share them. If the tasks wait for each other, the
    /// data may change at any moment. Otherwise they may also be programs of their own, of which each assigns its data before it uses them.
    fn find_shared(&mut self) {
        let have_tasks = self.variables.iter().any(|variable| *variable.kind == *b"TASKS");
        for [first, other] in self.again.clone() {
            for [changed, shared] in [[first, other], [other, first]] {
                let is_shared = |at: usize| {
                    let is_own = |data: &Data| self.is_of_one_task(usize::from(self.variables[at].source), data);
                    self.variables[at].storage == Storage::Pers && !self.variables[at].declared.is_some_and(is_own)
                };
                if self.variables[changed].assigned && is_shared(changed) && is_shared(shared) {
                    let variable = &mut self.variables[shared];
                    variable.content = Content::Is(Value::Unknown(Reason::AnyMoment));
                    variable.volatile = variable.volatile.or(have_tasks.then_some(Reason::AnyMoment));
                }
            }
        }
    }

    /// Whether data are declared with `TASK`.
    fn is_of_one_task(&self, source: usize, data: &Data) -> bool {
        let text = &self.sources[source].bytes[data.statement.range()];
        text.get(..4).is_some_and(|word| word.eq_ignore_ascii_case(b"TASK"))
    }

    pub(super) fn routine(&self, id: RoutineId) -> &'a Routine {
        &self.files[id.file].modules[id.module].routines[id.routine]
    }

    pub(super) fn module_of(&self, id: RoutineId) -> usize {
        self.first_module[id.file] + id.module
    }

    /// The routine that a name means in `module`.
    pub(super) fn find_routine(&self, module: usize, name: &[u8]) -> Option<RoutineId> {
        let key = Upper::new(name);
        let local = self.local_routines.get(module).filter(|l| !l.is_empty()).and_then(|l| l.get(&*key));
        let is_one = |id: &&RoutineId| !self.routines_otherwise.contains(*id) || self.module_of(**id) == module;
        local.or_else(|| self.routines.get(&*key).filter(is_one)).copied()
    }

    /// The routine that a text `name` or `module:name` means in `module`.
    pub(super) fn find_routine_in_text(&self, module: usize, text: &[u8]) -> Option<RoutineId> {
        let Some(colon) = text.iter().rposition(|byte| *byte == b':') else { return self.find_routine(module, text) };
        let named = *self.modules.get(&*Upper::new(&text[..colon]))?;
        self.find_routine(named, &text[colon + 1..]).filter(|id| self.module_of(*id) == named)
    }

    /// The procedures that a call may choose at run time: those whose names have the beginning and the end that are in the text. Empty if the
    /// text has no beginning, or if the name may be that of a module with one of its procedures.
    pub(super) fn chosen_by(&self, module: usize, call: &Call, bytes: &[u8]) -> Vec<RoutineId> {
        let is_own = call.late.is_none() && self.find_routine(module, &bytes[call.name.range()]).is_some();
        let Some([begin, end]) = call.known_ends(bytes).filter(|_| !is_own) else { return Vec::new() };
        let (begin, end) = (begin.to_ascii_uppercase(), end.to_ascii_uppercase());
        if self.modules.keys().any(|name| name.starts_with(&begin)) {
            return Vec::new();
        }
        let fits = |id: &RoutineId| {
            let routine = self.routine(*id);
            let name = Upper::new(&self.sources[id.file].bytes[routine.name.range()]);
            let middle = name.strip_prefix(&begin[..]).and_then(|rest| rest.strip_suffix(&end[..]));
            let is_chosen = middle.is_some_and(|middle| call.late.is_some() || middle.iter().all(u8::is_ascii_digit));
            is_chosen && routine.kind == RoutineKind::Proc && self.find_routine(module, &name) == Some(*id)
        };
        self.all().filter(fits).collect()
    }

    /// The data that a name means in `module`.
    pub(super) fn find_data(&self, module: usize, key: &[u8]) -> Option<usize> {
        if let Some(at) = self.local.get(module).and_then(|l| l.get(key)) {
            return Some(*at);
        }
        let at = *self.global.get(key)?;
        let is_own = self.variables[at].module == module;
        Some(self.otherwise.get(&at).copied().filter(|_| !is_own).unwrap_or(at))
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

    /// Data that are not LOCAL.
    pub(super) fn global_data(&self) -> impl Iterator<Item = usize> {
        let again = self.again.iter().map(|[_, other]| *other);
        let mut data: Vec<usize> = self.global.values().copied().chain(again).collect();
        data.sort_unstable();
        data.into_iter()
    }

    /// Data with this name in any module; without a name, all data.
    pub(super) fn all_named(&self, name: Option<&[u8]>) -> Vec<usize> {
        let named =
            |variable: &Variable<'_>| name.is_none_or(|name| variable.name.as_bytes().eq_ignore_ascii_case(name));
        (0..self.data).filter(|at| named(&self.variables[*at])).collect()
    }

    /// The same without constants.
    pub(super) fn data_named(&self, name: Option<&[u8]>) -> Vec<usize> {
        let open = |at: &usize| self.variables[*at].storage != Storage::Const;
        self.all_named(name).into_iter().filter(open).collect()
    }
}

/// A text without blanks, in upper case.
fn plain(text: &[u8]) -> Vec<u8> {
    text.iter().filter(|byte| !byte.is_ascii_whitespace()).map(u8::to_ascii_uppercase).collect()
}

pub(super) fn declared<'a>(bytes: &[u8], file: usize, module: usize, data: &'a Data) -> Variable<'a> {
    let kind = Upper::new(&bytes[data.kind.range()]);
    let unset = || match &*kind {
        // Another task may declare its value.
        _ if data.storage == Storage::Pers => Value::Unknown(Reason::Unset),
        b"NUM" | b"DNUM" if !data.is_array => Value::Num(0.0, None),
        b"BOOL" if !data.is_array => Value::Bool(false),
        b"STRING" if !data.is_array => Value::Text(Rc::from(&b""[..])),
        _ => Value::Unknown(Reason::Unset),
    };
    Variable {
        name: decode(&bytes[data.name.range()]).as_ref().into(),
        kind: Arc::from(&*kind),
        storage: data.storage,
        #[allow(clippy::cast_possible_truncation)]
        source: file as u16,
        module,
        content: data.value.as_ref().map_or_else(|| Content::Is(unset()), Content::Declared),
        assigned: false,
        volatile: None,
        foreign: false,
        declared: Some(data),
    }
}
