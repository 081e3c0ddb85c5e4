//! Names of data and routines, and the start values of data.

use super::names;
use super::tree::{File, Routine, Statement, Type};
use super::value::{AXES, EXTERNAL, Name, POSE, Selector, Value, pose_record, upper};
use crate::Reason;
use deflex_text::Source;
use std::collections::{BTreeSet, HashMap, HashSet};
use std::rc::Rc;

/// Number of a variable.
pub(super) type Id = usize;

/// The settings of motions, which `WITH` can set for a single one, have the first numbers.
pub(super) const MODAL: usize = 13;
pub(super) const BASE: Id = 0;
pub(super) const TOOL: Id = 1;
/// Names of base and tool, as they were assigned.
pub(super) const BASE_NAME: Id = 2;
pub(super) const TOOL_NAME: Id = 3;
pub(super) const LOAD: Id = 4;
pub(super) const SPEED: Id = 5;
/// `$APO`: how far from its end a motion is left.
pub(super) const APPROXIMATION: Id = 6;
pub(super) const MODE: Id = 7;
/// `$ORI_TYPE`.
pub(super) const ORIENTATION: Id = 8;
/// `$EX_AX_IGNORE`, `$ASYNC_AXIS`: external axes, one bit each, that do not go to the programmed positions.
pub(super) const IGNORED_AXES: Id = 9;
pub(super) const ASYNCHRONOUS_AXES: Id = 10;
/// `$CIRC_TYPE`, `$CIRC_MODE`: how the orientation turns on an arc.
pub(super) const CIRCLE_TYPE: Id = 11;
pub(super) const CIRCLE_MODE: Id = 12;
/// `$OV_PRO`, by which the controller multiplies every speed, per cent.
pub(super) const OVERRIDE: Id = 13;
/// The last position commanded.
pub(super) const POSITION: Id = 14;
/// Its orientation, with the base and the tool in which it is counted.
pub(super) const TURNED: Id = 15;
/// Place of the motion at whose end the robot stands.
pub(super) const STANDS: Id = 16;
/// The mark in force: nothing, 0 for air, 1 for cut.
pub(super) const MARK: Id = 17;
/// The settings before a spline.
pub(super) const SPLINE: Id = 18;

/// The place of the robot before the first motion, among the places of statements, which are not negative.
pub(super) const AT_START: f64 = -1.0;

/// A routine by its file and its place there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(super) struct RoutineId {
    pub(super) file: usize,
    pub(super) at: usize,
}

#[derive(Default)]
pub(super) struct Symbols<'a> {
    pub(super) sources: &'a [Source],
    pub(super) files: &'a [File],
    /// Start value of each variable.
    pub(super) start: Vec<Value>,
    /// Types of the variables that declare one.
    types: HashMap<Id, Type>,
    constant: HashSet<Id>,
    /// Names that all files see.
    globals: HashMap<Name, Id>,
    /// Names of a `.src` and its `.dat`, by the module's name.
    modules: HashMap<Name, HashMap<Name, Id>>,
    routines: HashMap<Name, RoutineId>,
    /// `BASE_DATA`, `TOOL_DATA`, `LOAD_DATA`.
    tables: HashSet<Id>,
}

/// Names of the controller's tables of frames and loads.
const TABLES: [&[u8]; 3] = [b"BASE_DATA", b"TOOL_DATA", b"LOAD_DATA"];

impl<'a> Symbols<'a> {
    pub(super) fn new(sources: &'a [Source], files: &'a [File]) -> Self {
        let mut symbols = Self { sources, files, ..Self::default() };
        for (at, file) in files.iter().enumerate() {
            for (routine, found) in file.routines.iter().enumerate() {
                let id = RoutineId { file: at, at: routine };
                if routine == 0 || found.is_global {
                    symbols.routines.entry(found.name.clone()).or_insert(id);
                }
            }
        }
        let own = |name: &str| Value::Own(name.into());
        let unset = || Value::unknown(Reason::Unset);
        // In the order of their numbers; no program can have the names with a blank.
        let state = [
            (&b"$BASE"[..], own("$BASE")),
            (b"$TOOL", own("$TOOL")),
            (b" BASE", own("$BASE")),
            (b" TOOL", own("$TOOL")),
            (b"$LOAD", unset()),
            (b"$VEL", unset()),
            (b"$APO", unset()),
            (b"$IPO_MODE", Value::constant(b"BASE")),
            (b"$ORI_TYPE", Value::constant(b"VAR")),
            (b"$EX_AX_IGNORE", Value::Number(0.0, None)),
            (b"$ASYNC_AXIS", Value::Number(0.0, None)),
            (b"$CIRC_TYPE", Value::constant(b"BASE")),
            (b"$CIRC_MODE", Value::Record(Rc::default())),
            (b"$OV_PRO", Value::Number(100.0, None)),
            (b" POSITION", Value::unknown(Reason::PositionBefore)),
            (b" TURNED", Value::unknown(Reason::OrientationBefore)),
            (b" STANDS", Value::Number(AT_START, None)),
            (b" MARK", Value::Bool(false)),
            (b" SPLINE", unset()),
        ];
        for (name, value) in state {
            symbols.global(name, value);
        }
        // A routine that is not in the files may change the tables before the program names one of their elements.
        for table in TABLES {
            let id = symbols.global(table, Value::Array(Rc::default()));
            symbols.tables.insert(id);
        }
        for switch in names::CORRECTIONS.into_iter().flatten() {
            symbols.global(switch, Value::Bool(false));
        }
        for world in [&b"$NULLFRAME"[..], b"$WORLD"] {
            symbols.global(world, pose_record([0.0; 6]));
        }
        symbols
    }

    fn global(&mut self, name: &[u8], value: Value) -> Id {
        let id = self.local(value);
        self.globals.insert(upper(name), id);
        id
    }

    /// Adds a variable without a name.
    pub(super) fn local(&mut self, value: Value) -> Id {
        self.start.push(value);
        self.start.len() - 1
    }

    /// Declares the data of a file; their start values are set later.
    pub(super) fn declare(&mut self, file: usize) {
        let found: &'a File = &self.files[file];
        // All files see KUKA's own data lists ($CONFIG, $MACHINE).
        let all = found.module.first() == Some(&b'$');
        for data in &found.data {
            let name = &data.name;
            let value = if data.is_array { Value::Array(Rc::default()) } else { Value::unknown(Reason::Unset) };
            let id = self.local(value);
            self.declare_type(id, data.kind);
            if data.is_constant {
                self.constant.insert(id);
            }
            if all || data.is_global {
                self.globals.insert(name.clone(), id);
                if TABLES.contains(&&name[..]) {
                    self.tables.insert(id);
                }
            }
            self.modules.entry(found.module.clone()).or_default().insert(name.clone(), id);
        }
    }

    /// Records the type of a variable.
    pub(super) fn declare_type(&mut self, id: Id, kind: Option<Type>) {
        self.types.extend(kind.map(|kind| (id, kind)));
    }

    /// Whether a variable holds only whole numbers.
    pub(super) fn is_whole(&self, id: Id) -> bool {
        self.types.get(&id) == Some(&Type::Whole)
    }

    /// Whether it is an input or an output of the controller (SIGNAL): `$OUT[…]=` and the periphery change it too.
    pub(super) fn is_signal(&self, id: Id) -> bool {
        self.types.get(&id) == Some(&Type::Signal)
    }

    /// The variable that another file imports under a name of its own.
    pub(super) fn imported(&self, module: &Name, name: &Name) -> Option<Id> {
        self.modules.get(module)?.get(name).copied()
    }

    /// Whether its number may be written with decimals: it is a REAL, or a component of a position. In data of a STRUC, a component is
    /// whole if any STRUC declares an INT of its name.
    pub(super) fn is_real(&self, id: Id, steps: &[Selector]) -> bool {
        let is_structure = self.types.get(&id) == Some(&Type::Structure);
        match steps.last() {
            Some(Selector::Component(name)) if is_structure && self.files.iter().any(|f| f.whole.contains(name)) => {
                false
            }
            Some(Selector::Component(name)) => {
                POSE.iter().chain(&AXES).chain(&EXTERNAL).any(|known| name[..] == **known)
            }
            _ => self.types.get(&id) == Some(&Type::Real),
        }
    }

    /// The value as a variable of this type stores it: a FRAME has no axes and no status.
    pub(super) fn converted(&self, id: Id, steps: &[Selector], value: Value) -> Value {
        let status: &[&[u8]] = match self.types.get(&id) {
            Some(Type::Frame) => &[],
            Some(Type::Pos) => &[b"S", b"T"],
            _ => return value,
        };
        let Value::Record(mut fields) = value else { return value };
        if steps.iter().all(|step| matches!(step, Selector::Element(_))) {
            let has = |name: &Name| POSE.iter().chain(status).any(|known| name[..] == **known);
            if !fields.iter().all(|(name, _)| has(name)) {
                Rc::make_mut(&mut fields).retain(|(name, _)| has(name));
            }
        }
        Value::Record(fields)
    }

    /// The variable of this name. If no file declares it, it belongs to the controller.
    pub(super) fn find(&mut self, file: usize, name: &Name) -> Id {
        let module = self.modules.get(&self.files[file].module).and_then(|names| names.get(name));
        if let Some(id) = module.or_else(|| self.globals.get(name)) {
            return *id;
        }
        self.global(name, Value::unknown(Reason::NameUndeclared))
    }

    /// Whether a variable describes the state of the run, and is not data of the program.
    pub(super) fn is_own_state(id: Id) -> bool {
        id <= SPLINE
    }

    /// Whether it is a table, of which the controller has the elements that no statement sets.
    pub(super) fn is_table(&self, id: Id) -> bool {
        self.tables.contains(&id)
    }

    /// The variables that a routine of another file could change.
    pub(super) fn visible(&self) -> Vec<Id> {
        let kept = |name: &Name| {
            matches!(&name[..], b"$NULLFRAME" | b"$WORLD") || names::MODELLED_SYSTEM_VARIABLES.contains(&&name[..])
        };
        let open = self.globals.iter().filter(|(name, id)| !kept(name) && !self.constant.contains(id));
        open.map(|(_, id)| *id).filter(|id| ![MARK, SPLINE].contains(id)).collect()
    }

    pub(super) fn routine(&self, id: RoutineId) -> &'a Routine {
        &self.files[id.file].routines[id.at]
    }

    /// The routine that a name means in a file.
    pub(super) fn find_routine(&self, file: usize, name: &Name) -> Option<RoutineId> {
        let own = self.files[file].routines.iter().position(|routine| routine.name == *name);
        let found = own.map(|at| RoutineId { file, at }).or_else(|| self.routines.get(name).copied());
        // The functions in the controller's BAS.SRC are known.
        found.filter(|id| !self.is_bas(id.file) || !names::is_frame_function(name))
    }

    /// Whether a file is the controller's own BAS.SRC.
    pub(super) fn is_bas(&self, file: usize) -> bool {
        &self.files[file].module[..] == b"BAS"
    }

    pub(super) fn all(&self) -> impl Iterator<Item = RoutineId> + use<'a> {
        let files: &'a [File] = self.files;
        files.iter().enumerate().flat_map(|(file, f)| (0..f.routines.len()).map(move |at| RoutineId { file, at }))
    }

    /// The first routines that no other routine calls: those of the written files, and those of context files that call a routine of a
    /// written file, directly or through others. If each is called, all first routines of the written files.
    pub(super) fn roots(&self, written: usize) -> Vec<RoutineId> {
        let mut calls: HashMap<RoutineId, BTreeSet<RoutineId>> = HashMap::new();
        for id in self.all() {
            let of = self.routine(id).statements().into_iter().flat_map(Statement::calls);
            let of = of.filter_map(|call| self.find_routine(id.file, &call.name)).filter(|other| *other != id);
            calls.insert(id, of.collect());
        }
        let called: BTreeSet<RoutineId> = calls.values().flatten().copied().collect();
        let reaches_written = |from: RoutineId| {
            let (mut found, mut open) = (BTreeSet::new(), vec![from]);
            while let Some(id) = open.pop() {
                open.extend(calls.get(&id).into_iter().flatten().filter(|called| found.insert(**called)));
            }
            found.into_iter().any(|id| id.file < written)
        };
        let firsts = |until: usize| {
            (0..until).filter(|f| !self.files[*f].routines.is_empty()).map(|file| RoutineId { file, at: 0 })
        };
        let is_root = |id: &RoutineId| !called.contains(id) && (id.file < written || reaches_written(*id));
        let free: Vec<RoutineId> = firsts(self.files.len()).filter(is_root).collect();
        if free.is_empty() { firsts(written).collect() } else { free }
    }
}
