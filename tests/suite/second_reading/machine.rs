//! Runs RAPID on concrete inputs and notes every motion: the second reading of what a program means.
//!
//! Written from the manuals' words (RAPID overview, instructions and functions), with none of the project's code.

mod control;
mod data;

use super::oracle::Oracle;
use super::tree::{Arg, Block, Expr, Mode, Module, Routine, Storage};
use super::value::{Frame, IDENTITY, Val};
use std::rc::Rc;

/// An executed motion.
#[derive(Clone, Debug)]
pub struct Motion {
    pub module: usize,
    pub line: u32,
    /// Name of the routine it stands in.
    pub routine: String,
    /// The instruction's name.
    pub kind: String,
    /// The mark in force.
    pub mark: Option<Mark>,
    /// Whether its target is worked out (`Offs`, `RelTool`): only where it is may be corrected.
    pub shifted: bool,
    pub goal: Goal,
    /// Speed of the TCP, mm/s, where it is a predefined one or a record.
    pub speed: Option<f64>,
    pub tool: Val,
    pub wobj: Val,
    pub displacement: Frame,
    pub offsets: Vec<f64>,
}

/// What a comment says of the motions after it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mark {
    Air,
    Cut,
}

#[derive(Clone, Debug)]
pub enum Goal {
    /// Poses in the displacement frame, the circle point of an arc first; confdata and external axes of the last.
    Poses(Vec<Frame>, Val, Val),
    Joints(Val),
}

impl Motion {
    /// Whether it cuts: a joint motion does not, unless a mark says so.
    pub fn mark(&self) -> Mark {
        let unmarked = if self.kind.contains('J') { Mark::Air } else { Mark::Cut };
        self.mark.unwrap_or(unmarked)
    }

    /// Displacement frame in the world.
    pub fn base(&self) -> Result<Frame, String> {
        let (user, object) = (Frame::of(self.wobj.at(3)?)?, Frame::of(self.wobj.at(4)?)?);
        Ok(user.then(&object).then(&self.displacement))
    }
}

/// Why execution leaves a statement.
#[derive(Debug)]
pub enum Stop {
    /// An error that this routine's handler has not seen yet.
    Raise(i32),
    /// One that leaves the routine.
    Up(i32),
    /// The program ends.
    End,
    /// Not RAPID, or not understood here.
    Broken(String),
}

impl From<String> for Stop {
    fn from(why: String) -> Self {
        Self::Broken(why)
    }
}

pub type Ran<T> = Result<T, Stop>;

/// Where execution goes from a statement.
#[derive(Debug)]
pub enum Flow {
    Next,
    Return(Option<Val>),
    Goto(String),
    Retry,
    TryNext,
}

/// Data as declared.
pub struct Cell {
    pub name: String,
    pub ty: String,
    pub dims: usize,
    pub storage: Storage,
    pub local: bool,
    pub module: usize,
    pub value: Option<Val>,
    init: Option<Rc<(Vec<Expr>, Option<Expr>)>>,
}

/// Data, an element or a component: what a reference parameter holds.
#[derive(Clone, Debug)]
pub struct Place {
    pub cell: usize,
    pub path: Vec<usize>,
    pub ty: String,
    pub dims: usize,
}

#[derive(Clone)]
enum Binding {
    Data(Place),
    /// Optional, not given.
    Absent,
    Given,
}

struct Frames {
    module: usize,
    routine: String,
    names: Vec<(String, Binding)>,
    handler: Option<(Vec<Expr>, Block)>,
    error: Option<i32>,
}

pub struct Interrupt {
    pub number: f64,
    pub trap: String,
    pub ordered: bool,
}

pub struct Machine<'a> {
    pub modules: &'a [Module],
    pub cells: Vec<Cell>,
    routines: Vec<(usize, Rc<Routine>)>,
    calls: Vec<Frames>,
    pub oracle: Oracle,
    pub motions: Vec<Motion>,
    pub displacement: Frame,
    pub offsets: Vec<f64>,
    pub mark: Option<Mark>,
    /// Robtargets that `Offs` and `RelTool` have made, to tell them where they come back as parameters.
    pub computed: Vec<Val>,
    pub interrupts: Vec<Interrupt>,
    in_trap: bool,
    /// What a cell file declares: name, type, value.
    pub cell_file: &'a [(String, String, Val)],
    steps: usize,
    /// Work done in a run: programs that loop for longer are no test.
    limit: usize,
}

/// ERRNO of a name: any injective map will do.
pub fn error_number(name: &str) -> Option<i32> {
    const NAMES: [&str; 8] = [
        "ERR_DIVZERO", "ERR_WHLSEARCH", "ERR_WAIT_MAXTIME", "ERR_OUTOFBND", "ERR_REFUNKPRC", "ERR_SIGSUPSEARCH",
        "ERR_TP_MAXTIME", "ERR_PATH_STOP",
    ];
    NAMES.iter().position(|known| *known == name).map(|i| 1000 + i as i32)
}

impl<'a> Machine<'a> {
    pub fn new(modules: &'a [Module], cell_file: &'a [(String, String, Val)], oracle: Oracle) -> Self {
        let mut machine = Self {
            modules,
            cells: Vec::new(),
            routines: Vec::new(),
            calls: Vec::new(),
            oracle,
            motions: Vec::new(),
            displacement: IDENTITY,
            offsets: vec![0.0; 6],
            mark: None,
            computed: Vec::new(),
            interrupts: Vec::new(),
            in_trap: false,
            cell_file,
            steps: 0,
            limit: 4000,
        };
        for (m, module) in modules.iter().enumerate() {
            for declaration in &module.data {
                machine.declare(m, declaration);
            }
            machine.routines.extend(module.routines.iter().map(|routine| (m, routine.clone())));
        }
        machine
    }

    /// Runs `main`; what ended it early, if anything.
    pub fn run(&mut self) -> Option<String> {
        let result = match self.routine(0, "MAIN") {
            Some((module, routine)) => self.call(module, &routine, &[]).map(|_| ()),
            None => Err(Stop::Broken("no main".into())),
        };
        match result {
            Ok(()) | Err(Stop::End) => None,
            Err(Stop::Raise(n) | Stop::Up(n)) => Some(format!("error {n}")),
            Err(Stop::Broken(why)) => Some(why),
        }
    }

    fn module(&self) -> usize {
        self.calls.last().map_or(0, |call| call.module)
    }

    /// The routine that a name means: of the module, else a global one.
    pub fn routine(&self, from: usize, name: &str) -> Option<(usize, Rc<Routine>)> {
        let (wanted, name) = match name.split_once(':') {
            Some((module, routine)) => (self.modules.iter().position(|m| m.name == module), routine),
            None => (None, name),
        };
        let all = || self.routines.iter().filter(|(m, r)| r.name == name && wanted.is_none_or(|w| w == *m));
        all()
            .find(|(m, _)| *m == from)
            .or_else(|| all().find(|(_, r)| !r.local || wanted.is_some()))
            .map(|(m, r)| (*m, r.clone()))
    }

    pub fn here(&self, name: &str) -> Option<(usize, Rc<Routine>)> {
        self.routine(self.module(), name)
    }

    /// Calls a routine of the program.
    pub fn call(&mut self, module: usize, routine: &Rc<Routine>, args: &[Arg]) -> Ran<Option<Val>> {
        if self.calls.len() > 12 {
            // As a controller that is out of stack: the program ends here.
            return Err(Stop::End);
        }
        let mut names = Vec::new();
        let mut required = args.iter().filter(|arg| arg.option.is_none());
        for parameter in &routine.parameters {
            let arg = if parameter.optional {
                args.iter().find(|arg| arg.option.as_ref() == Some(&parameter.name))
            } else {
                Some(required.next().ok_or_else(|| format!("{}: too few arguments", routine.name))?)
            };
            let binding = match (arg, parameter.mode) {
                (None, _) => Binding::Absent,
                (Some(Arg { value: Some(value), .. }), _) if self.absent(value) => Binding::Absent,
                (Some(_), Mode::Switch) => Binding::Given,
                (Some(arg), mode) => {
                    let value = arg.value.as_ref().ok_or_else(|| "an argument without a value".to_owned())?;
                    self.bind(&parameter.name, &parameter.ty, mode, value)?
                }
            };
            names.push((parameter.name.clone(), binding));
        }
        let handler = routine.handler.clone();
        self.calls.push(Frames { module, routine: routine.name.clone(), names, handler, error: None });
        let result = self.inside(module, routine);
        self.calls.pop();
        match result {
            Ok(Flow::Return(value)) => Ok(value),
            Ok(Flow::Goto(label)) => Err(Stop::Broken(format!("no label {label}"))),
            Ok(_) => Ok(None),
            Err(Stop::Up(n)) => Err(Stop::Raise(n)),
            Err(other) => Err(other),
        }
    }

    fn inside(&mut self, module: usize, routine: &Rc<Routine>) -> Ran<Flow> {
        for d in &routine.data {
            let cell = self.declare(module, d);
            // In force only once its value is there; the name outside is then hidden.
            let value = match &d.value {
                Some(expr) => self.eval(expr, &d.ty)?,
                None => {
                    let mut value = self.blank(&d.ty);
                    for dim in d.dims.iter().rev() {
                        let n = self.eval(dim, "NUM")?.num()? as usize;
                        value = Val::List(vec![value; n]);
                    }
                    value
                }
            };
            self.cells[cell].init = None;
            self.cells[cell].module = usize::MAX;
            self.cells[cell].value = Some(value);
            let place = self.whole(cell);
            self.name(&d.name, Binding::Data(place));
        }
        self.block(&routine.body)
    }

    fn name(&mut self, name: &str, binding: Binding) {
        if let Some(call) = self.calls.last_mut() {
            call.names.push((name.to_owned(), binding));
        }
    }
}
