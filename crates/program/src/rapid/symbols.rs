//! Names: data and routines of all modules, and those that RAPID predefines.

use super::expression::{Call, Expression};
use super::known::{Known, RoutineId};
use super::tree::{Data, File, Routine, RoutineKind, Storage};
use super::value::Value;
use crate::Reason;
use deflex_text::{Source, decode};
use std::collections::{BTreeSet, HashMap};
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
    /// LOCAL data of each module, over all files.
    pub(super) local: Vec<Names>,
    pub(super) routines: HashMap<Box<[u8]>, RoutineId>,
    /// LOCAL routines of each module.
    pub(super) local_routines: Vec<HashMap<Box<[u8]>, RoutineId>>,
    /// Modules by their name in upper case.
    modules: HashMap<Box<[u8]>, usize>,
    /// For each file, the number of modules in the files before.
    pub(super) first_module: Vec<usize>,
    pub(super) variables: Vec<Variable<'a>>,
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
                    let names = if data.local { &mut symbols.local[id] } else { &mut symbols.global };
                    // Of two equal names the first counts; the controller would refuse the second.
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
        symbols.data = symbols.variables.len();
        symbols.find_changes();
        symbols
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
        local.or_else(|| self.routines.get(&*key)).copied()
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

    /// Data that are not LOCAL.
    pub(super) fn global_data(&self) -> impl Iterator<Item = usize> {
        let mut data: Vec<usize> = self.global.values().copied().collect();
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
