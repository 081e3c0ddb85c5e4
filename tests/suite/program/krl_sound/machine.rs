//! A controller that runs KRL on concrete inputs, and notes where it goes.

use super::syntax::{File, Kind, Routine, Stmt, Tok, Toks};
use super::value::{POSE, Step, Val};
use std::collections::{BTreeMap, BTreeSet, HashMap};

/// What the controller has before the program sets anything: distinct, so that none is taken for another.
pub(super) const TABLE: [[f64; 6]; 5] = [
    [0.0; 6],
    [100.0, 20.0, -30.0, 10.0, 0.0, 0.0],
    [-250.0, 40.0, 60.0, 0.0, 25.0, 0.0],
    [33.0, -470.0, 80.0, 0.0, 0.0, -40.0],
    [900.0, 901.0, 902.0, 15.0, 5.0, 0.0],
];
pub(super) const FIRST_BASE: [f64; 6] = [711.0, 7.0, 77.0, 7.0, 0.0, 0.0];
pub(super) const FIRST_TOOL: [f64; 6] = [0.0, 5.0, 311.0, 0.0, 90.0, 0.0];

#[derive(Clone, Debug, PartialEq)]
pub(super) enum Goal {
    Pose {
        via: Option<[f64; 3]>,
        end: [f64; 6],
        /// Components that the position itself has.
        own: [bool; 6],
        /// Others count from where the robot stood for another reason than the motion before.
        loose: bool,
    },
    /// Axes, increments, circles with an angle: what the text says.
    Plain(Vec<f64>),
}

#[derive(Clone, Debug)]
pub(super) struct Motion {
    pub(super) file: usize,
    pub(super) line: u32,
    pub(super) kind: String,
    pub(super) base: [f64; 6],
    pub(super) tool: [f64; 6],
    pub(super) holds_part: bool,
    pub(super) e1: f64,
    pub(super) goal: Goal,
}

#[derive(Clone, Debug)]
pub(super) struct Place {
    pub(super) cell: usize,
    pub(super) path: Vec<Step>,
}

struct Frame {
    file: usize,
    names: HashMap<String, Place>,
}

#[derive(Debug)]
enum Flow {
    Next,
    Exit,
    Return(Option<Val>),
    Goto(String),
    /// Back to the routine at this depth.
    Resume(usize),
}

struct Interrupt {
    number: i64,
    does: Toks,
    depth: usize,
    file: usize,
}

pub(super) struct Machine<'a> {
    files: &'a [File],
    pub(super) heap: Vec<(Val, String)>,
    globals: HashMap<String, usize>,
    modules: [HashMap<String, usize>; 2],
    stack: Vec<Frame>,
    random: u64,
    pub(super) motions: Vec<Motion>,
    position: Option<([f64; 6], bool)>,
    pub(super) e1: f64,
    pending: Vec<Toks>,
    interrupts: Vec<Interrupt>,
    on: BTreeSet<i64>,
    handling: bool,
    steps: usize,
    pub(super) at: usize,
}

type Done<T> = Result<T, String>;

impl<'a> Machine<'a> {
    /// Files in pairs: `.src`, `.dat`.
    pub(super) fn new(files: &'a [File], seed: u64) -> Done<Self> {
        let mut machine = Self {
            files,
            heap: Vec::new(),
            globals: HashMap::new(),
            modules: Default::default(),
            stack: Vec::new(),
            random: seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ 0xD1B5_4A32_D192_ED03,
            motions: Vec::new(),
            position: None,
            e1: 0.0,
            pending: Vec::new(),
            interrupts: Vec::new(),
            on: BTreeSet::new(),
            handling: false,
            steps: 0,
            at: 0,
        };
        machine.e1 = 100.0 * machine.below(3) as f64;
        let system = [("$BASE", FIRST_BASE), ("$TOOL", FIRST_TOOL), ("$NULLFRAME", [0.0; 6])];
        for (name, value) in system {
            machine.global(name, Val::of_six(value), "FRAME");
        }
        machine.global("$IPO_MODE", Val::Word("BASE".into()), "ENUM");
        machine.global("$VEL", Val::Undef, "CP");
        machine.global("FDAT_ACT", Val::Undef, "FDAT");
        for name in ["BASE_DATA", "TOOL_DATA"] {
            let items = TABLE.iter().enumerate().map(|(i, frame)| (i as i64, Val::of_six(*frame)));
            machine.global(name, Val::Arr(items.collect()), "FRAME");
        }
        for (i, file) in files.iter().enumerate() {
            machine.stack.push(Frame { file: i, names: HashMap::new() });
            for data in &file.data {
                machine.heap.push((Val::Undef, data.ty.clone()));
                let cell = machine.heap.len() - 1;
                if data.is_global {
                    machine.globals.insert(data.name.clone(), cell);
                }
                machine.modules[i / 2].insert(data.name.clone(), cell);
                if !data.value.is_empty() {
                    machine.at = 0;
                    let value = machine.expression(&data.value)?;
                    machine.heap[cell].0 = value;
                }
            }
            for values in &file.values {
                machine.at = 0;
                let place = machine.place(values)?;
                machine.at += 1;
                let value = machine.expression(values)?;
                *machine.heap[place.cell].0.place(&place.path) = value;
            }
            machine.stack.pop();
        }
        Ok(machine)
    }

    /// Numbers and switches of data lists that are assigned may hold anything from the run before.
    pub(super) fn leave_over(&mut self, assigned: impl Fn(&str) -> bool) {
        let all: BTreeMap<String, usize> = self.modules.iter().flatten().map(|(n, c)| (n.clone(), *c)).collect();
        for (_, cell) in all.into_iter().filter(|(name, _)| assigned(name)) {
            let changed = self.below(2) == 0;
            let number = self.below(4) as f64;
            match &mut self.heap[cell].0 {
                Val::Num(v) if changed => *v = number,
                Val::Bool(v) if changed => *v = !*v,
                _ => {}
            }
        }
    }

    fn global(&mut self, name: &str, value: Val, ty: &str) {
        self.heap.push((value, ty.into()));
        self.globals.insert(name.into(), self.heap.len() - 1);
    }

    pub(super) fn below(&mut self, n: u64) -> u64 {
        // SplitMix64 (Steele, Lea, Flood 2014).
        self.random = self.random.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.random ^ (self.random >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        (z ^ (z >> 31)) % n
    }

    /// Runs a routine; why it stopped before its end.
    pub(super) fn run(&mut self, name: &str) -> Option<String> {
        self.call(name, &[]).err()
    }

    pub(super) fn find(&self, name: &str) -> Done<Place> {
        if let Some(place) = self.stack.last().and_then(|frame| frame.names.get(name)) {
            return Ok(place.clone());
        }
        let own = self.stack.last().and_then(|frame| self.modules[frame.file / 2].get(name));
        let cell = own.or_else(|| self.globals.get(name)).ok_or(format!("no {name}"))?;
        Ok(Place { cell: *cell, path: Vec::new() })
    }

    pub(super) fn value(&self, place: &Place) -> Val {
        self.heap[place.cell].0.get(&place.path)
    }

    pub(super) fn named(&self, name: &str) -> Val {
        self.heap[self.globals[name]].0.clone()
    }

    pub(super) fn assign(&mut self, place: &Place, value: Val) {
        let ty = self.heap[place.cell].1.clone();
        let whole = place.path.iter().all(|step| matches!(step, Step::Item(_)));
        let fields: &[&str] = match &*ty {
            "FRAME" => &POSE,
            "POS" => &["X", "Y", "Z", "A", "B", "C", "S", "T"],
            _ => &[],
        };
        let value = match value {
            Val::Num(v) if ty == "INT" => Val::Num(v.round()),
            Val::Rec(mut parts) => {
                parts.retain(|name, _| !whole || fields.is_empty() || fields.contains(&&**name));
                // What becomes of components that an aggregate leaves out: as they were, or nothing.
                if let (Val::Rec(old), true) = (self.value(place), self.below(2) == 0) {
                    for (name, value) in old {
                        parts.entry(name).or_insert(value);
                    }
                }
                Val::Rec(parts)
            }
            other => other,
        };
        *self.heap[place.cell].0.place(&place.path) = value;
        if ["$BASE", "$TOOL"].iter().any(|name| self.globals[*name] == place.cell)
            && let Some((_, loose)) = &mut self.position
        {
            *loose = true;
        }
    }

    fn set(&mut self, name: &str, value: Val) {
        let place = Place { cell: self.globals[name], path: Vec::new() };
        self.assign(&place, value);
    }

    fn routine(&self, name: &str) -> Option<&'a Routine> {
        let files: &'a [File] = self.files;
        let here = self.stack.last().map_or(0, |frame| frame.file);
        let own = files[here].routines.iter().find(|r| r.name == name);
        let seen = |file: &'a File| {
            file.routines.iter().enumerate().find(|(i, r)| (*i == 0 || r.is_global) && r.name == name).map(|(_, r)| r)
        };
        own.or_else(|| files.iter().find_map(seen))
    }

    fn call(&mut self, name: &str, arguments: &[(Val, Option<Place>)]) -> Done<Flow> {
        let Some(routine) = self.routine(name) else {
            self.another();
            return Ok(Flow::Next);
        };
        if self.stack.len() > 12 {
            return Err("too many calls".into());
        }
        let mut names = HashMap::new();
        for (i, (param, is_out)) in routine.params.iter().enumerate() {
            let (value, place) = arguments.get(i).cloned().unwrap_or((Val::Undef, None));
            let ty = routine.data.iter().find(|(_, n)| n == param).map_or("", |(ty, _)| ty);
            let place = match place.filter(|_| *is_out) {
                Some(place) => place,
                None => {
                    self.heap.push((Val::Undef, ty.into()));
                    let place = Place { cell: self.heap.len() - 1, path: Vec::new() };
                    self.assign(&place, value);
                    place
                }
            };
            names.insert(param.clone(), place);
        }
        for (ty, name) in &routine.data {
            if !names.contains_key(name) {
                self.heap.push((Val::Undef, ty.clone()));
                names.insert(name.clone(), Place { cell: self.heap.len() - 1, path: Vec::new() });
            }
        }
        self.stack.push(Frame { file: routine.file, names });
        let flow = self.body(&routine.body);
        let depth = self.stack.len();
        self.stack.pop();
        // An interrupt is known in the routine that declares it, and below.
        self.interrupts.retain(|interrupt| interrupt.depth < depth);
        Ok(match flow? {
            Flow::Resume(depth) if depth != self.stack.len() => Flow::Resume(depth),
            Flow::Return(value) => Flow::Return(value),
            _ => Flow::Next,
        })
    }

    /// The statements of a routine: labels stand on its first level.
    fn body(&mut self, body: &'a [Stmt]) -> Done<Flow> {
        let mut from = 0;
        loop {
            match self.block(&body[from..])? {
                Flow::Goto(label) => {
                    let is = |stmt: &Stmt| matches!(&stmt.kind, Kind::Label(name) if *name == label);
                    from = body.iter().position(is).ok_or("no label")?;
                }
                flow => return Ok(flow),
            }
        }
    }

    fn block(&mut self, block: &'a [Stmt]) -> Done<Flow> {
        for stmt in block {
            self.steps += 1;
            if self.steps > 600 {
                return Err("runs on".into());
            }
            let flow = match self.interrupted()? {
                Flow::Next => self.statement(stmt)?,
                flow => flow,
            };
            if !matches!(flow, Flow::Next) {
                return Ok(flow);
            }
        }
        Ok(Flow::Next)
    }

    /// What TRIGGER and INTERRUPT start, now or later.
    fn interrupted(&mut self) -> Done<Flow> {
        if self.handling {
            return Ok(Flow::Next);
        }
        if !self.pending.is_empty() && self.below(3) == 0 {
            let does = self.pending.remove(0);
            self.handling = true;
            let flow = self.plain(&does, 0);
            self.handling = false;
            flow?;
        }
        let ready = |i: &&Interrupt| self.on.contains(&i.number);
        let first = self.interrupts.iter().find(ready).map(|i| (i.does.clone(), i.depth, i.file));
        if let Some((does, depth, file)) = first
            && self.below(5) == 0
        {
            self.handling = true;
            let (stood, before, motions) = (self.stack.len(), self.position, self.motions.len());
            // It is not known where on its path the robot is.
            self.position = before.map(|(at, _)| (at, true));
            self.stack.push(Frame { file, names: HashMap::new() });
            let flow = self.plain(&does, 0);
            self.stack.pop();
            self.handling = false;
            if self.motions.len() == motions {
                self.position = before;
            }
            if let Flow::Resume(_) = flow? {
                // The robot stands somewhere on its way.
                self.position = None;
                if depth < stood {
                    return Ok(Flow::Resume(depth));
                }
                return Err("RESUME where nothing is left".into());
            }
        }
        Ok(Flow::Next)
    }

    fn ask(&mut self, toks: &[Tok]) -> Done<Val> {
        self.at = 0;
        self.expression(toks)
    }

    fn count(&mut self, toks: &[Tok]) -> Done<i64> {
        Ok(self.ask(toks)?.num()?.round() as i64)
    }

    fn statement(&mut self, stmt: &'a Stmt) -> Done<Flow> {
        match &stmt.kind {
            Kind::Plain(toks) => return self.plain(toks, stmt.line),
            Kind::Label(_) => {}
            Kind::If(condition, then, otherwise) => {
                let holds = self.ask(condition)?.bool()?;
                return self.block(if holds { then } else { otherwise });
            }
            Kind::For(name, from, to, step, body) => {
                let (from, to) = (self.count(from)?, self.count(to)?);
                let step = step.as_ref().map_or(Ok(1), |step| self.count(step))?;
                let place = self.find(name)?;
                self.assign(&place, Val::Num(from as f64));
                loop {
                    let at = self.value(&place).num()?.round() as i64;
                    if step > 0 && at > to || step < 0 && at < to {
                        break;
                    }
                    match self.block(body)? {
                        Flow::Next => {}
                        Flow::Exit => return Ok(Flow::Next),
                        flow => return Ok(flow),
                    }
                    let at = self.value(&place).num()?;
                    self.assign(&place, Val::Num(at + step as f64));
                }
                // The manuals do not say which value the counter has after its loop.
                if self.below(2) == 0 {
                    self.assign(&place, Val::Num(to as f64));
                }
            }
            Kind::While(..) | Kind::Repeat(..) | Kind::Loop(_) => loop {
                let (body, condition_after) = match &stmt.kind {
                    Kind::While(condition, body) => {
                        if !self.ask(condition)?.bool()? {
                            break;
                        }
                        (body, None)
                    }
                    Kind::Repeat(body, until) => (body, Some(until)),
                    Kind::Loop(body) => (body, None),
                    _ => unreachable!(),
                };
                self.steps += 1;
                match self.block(body)? {
                    Flow::Next => {}
                    Flow::Exit => break,
                    flow => return Ok(flow),
                }
                if let Some(until) = condition_after
                    && self.ask(until)?.bool()?
                {
                    break;
                }
                if self.steps > 600 {
                    return Err("runs on".into());
                }
            },
            Kind::Switch(subject, cases, otherwise) => {
                let subject = self.ask(subject)?;
                for (values, body) in cases {
                    for value in values.split(|t| *t == Tok::Mark(",".into())) {
                        if self.ask(value)? == subject {
                            return self.block(body);
                        }
                    }
                }
                return self.block(otherwise);
            }
            Kind::Spline(with, body) => {
                let before = self.with(with)?;
                let flow = self.block(body);
                self.restore(before);
                return flow;
            }
        }
        Ok(Flow::Next)
    }

    /// What holds for one motion; what held before.
    fn with(&mut self, toks: &[Tok]) -> Done<[Val; 2]> {
        let before = ["$BASE", "$TOOL"].map(|name| self.named(name));
        let mut at = 0;
        while at < toks.len() {
            self.at = at;
            let place = self.place(toks)?;
            self.at += 1;
            let value = self.expression(toks)?;
            self.assign(&place, value);
            at = self.at + 1;
        }
        Ok(before)
    }

    fn restore(&mut self, before: [Val; 2]) {
        for (name, value) in ["$BASE", "$TOOL"].into_iter().zip(before) {
            if self.named(name) != value {
                self.set(name, value);
            }
        }
    }

    /// A routine that no given file contains.
    fn another(&mut self) {
        let names: BTreeSet<String> = self.globals.keys().cloned().collect();
        for name in names.into_iter().filter(|n| !n.ends_with("_DATA") && n != "$NULLFRAME" && n != "$VEL") {
            if self.below(2) == 0 {
                continue;
            }
            let (number, of) = (self.below(3) as f64, self.below(4) as usize);
            let value = match &self.named(&name) {
                Val::Num(_) => Val::Num(number),
                Val::Bool(v) => Val::Bool(!v),
                Val::Rec(parts) if parts.contains_key("A") => Val::of_six(TABLE[1 + of]),
                _ => continue,
            };
            self.set(&name, value);
        }
    }

    fn bas(&mut self, arguments: &[(Val, Option<Place>)]) -> Done<()> {
        let Val::Word(command) = &arguments[0].0 else { return Err("BAS".into()) };
        let number = arguments.get(1).map_or(Ok(0), |(v, _)| v.num().map(|v| v as i64));
        match &**command {
            "BASE" => self.select("$BASE", "BASE_DATA", number?)?,
            "TOOL" => self.select("$TOOL", "TOOL_DATA", number?)?,
            "CP_PARAMS" | "PTP_PARAMS" | "FRAMES" => {
                let act = self.named("FDAT_ACT");
                let part = |name: &str| act.get(&[Step::Part(name.into())]);
                let (tool, base, mode) = (part("TOOL_NO").num()?, part("BASE_NO").num()?, part("IPO_FRAME"));
                self.select("$TOOL", "TOOL_DATA", tool as i64)?;
                self.select("$BASE", "BASE_DATA", base as i64)?;
                if let Val::Word(_) = mode {
                    self.set("$IPO_MODE", mode);
                }
            }
            "INITMOV" if self.below(2) == 0 => {
                // What holds at the start of a program is what this sets.
                self.set("$BASE", Val::of_six(FIRST_BASE));
                self.set("$TOOL", Val::of_six(FIRST_TOOL));
            }
            _ => {}
        }
        Ok(())
    }

    fn select(&mut self, name: &str, table: &str, number: i64) -> Done<()> {
        let value = if number == 0 { self.named("$NULLFRAME") } else { self.named(table).get(&[Step::Item(number)]) };
        value.rec()?;
        self.set(name, value);
        Ok(())
    }

    fn plain(&mut self, toks: &[Tok], line: u32) -> Done<Flow> {
        let Some(Tok::Word(first)) = toks.first() else { return Err(format!("{toks:?}")) };
        self.at = 1;
        match &**first {
            "LIN" | "PTP" | "SLIN" | "SPTP" | "SPL" | "CIRC" | "SCIRC" | "LIN_REL" | "PTP_REL" => {
                self.go(first.clone(), toks, line)?;
            }
            "EXIT" => return Ok(Flow::Exit),
            "RETURN" => {
                let value = if toks.len() > 1 { Some(self.expression(toks)?) } else { None };
                return Ok(Flow::Return(value));
            }
            "GOTO" => {
                let Some(Tok::Word(label)) = toks.get(1) else { return Err("GOTO".into()) };
                return Ok(Flow::Goto(label.clone()));
            }
            "RESUME" => return if self.handling { Ok(Flow::Resume(0)) } else { Err("RESUME".into()) },
            "BRAKE" | "WAIT" => {}
            "INTERRUPT" => match toks.get(1) {
                Some(Tok::Word(word)) if word == "DECL" => {
                    let start = toks.iter().position(|t| *t == Tok::Word("DO".into())).ok_or("no DO")?;
                    self.at = 2;
                    let number = self.expression(toks)?.num()? as i64;
                    let frame = self.stack.last().ok_or("nowhere")?;
                    let (file, depth) = (frame.file, self.stack.len());
                    self.interrupts.retain(|i| i.number != number);
                    self.interrupts.push(Interrupt { number, does: toks[start + 1..].to_vec(), depth, file });
                }
                Some(Tok::Word(word)) => {
                    let on = word == "ON";
                    self.at = 2;
                    let number = self.expression(toks)?.num()? as i64;
                    if on {
                        self.on.insert(number)
                    } else {
                        self.on.remove(&number)
                    };
                }
                _ => return Err("INTERRUPT".into()),
            },
            "TRIGGER" => {
                let from = toks.iter().position(|t| *t == Tok::Word("DO".into())).ok_or("no DO")?;
                let to = toks.iter().position(|t| *t == Tok::Word("PRIO".into())).unwrap_or(toks.len());
                self.pending.push(toks[from + 1..to].to_vec());
            }
            // A statement of another option package.
            "FOOBAR" => self.another(),
            _ if toks.get(1) == Some(&Tok::Mark("(".into())) => {
                let arguments = self.arguments(toks)?;
                if first == "BAS" {
                    self.bas(&arguments)?;
                } else if let flow @ Flow::Resume(_) = self.call(first, &arguments)? {
                    return Ok(flow);
                }
            }
            _ => {
                self.at = 0;
                let place = self.place(toks)?;
                self.at += 1;
                let value = self.expression(toks)?;
                if value == Val::Undef {
                    return Err("nothing to assign".into());
                }
                self.assign(&place, value);
            }
        }
        Ok(Flow::Next)
    }

    /// A function's value.
    pub(super) fn function(&mut self, name: &str, toks: &[Tok]) -> Done<Val> {
        let arguments = self.arguments(toks)?;
        let at = self.at;
        let value = match name {
            "SBASE" => {
                let number = arguments[0].0.num()? as i64;
                self.named("BASE_DATA").get(&[Step::Item(number)])
            }
            "STOOL2" => {
                let number = arguments[0].0.rec()?.get("TOOL_NO").ok_or("no tool")?.num()? as i64;
                self.named("TOOL_DATA").get(&[Step::Item(number)])
            }
            "ABS" => Val::Num(arguments[0].0.num()?.abs()),
            _ => match self.call(name, &arguments)? {
                Flow::Return(Some(value)) => value,
                _ => return Err(format!("{name} has no value")),
            },
        };
        self.at = at;
        Ok(value)
    }

    fn arguments(&mut self, toks: &[Tok]) -> Done<Vec<(Val, Option<Place>)>> {
        self.at += usize::from(toks[self.at] == Tok::Mark("(".into()));
        let mut out = Vec::new();
        while toks.get(self.at).is_some_and(|t| *t != Tok::Mark(")".into())) {
            let from = self.at;
            let place = if let Tok::Word(_) = toks[from] { self.place(toks).ok() } else { None };
            let ends = matches!(toks.get(self.at), Some(Tok::Mark(m)) if m == "," || m == ")");
            let place = place.filter(|_| ends);
            self.at = from;
            out.push((self.expression(toks)?, place));
            self.at += usize::from(toks.get(self.at) == Some(&Tok::Mark(",".into())));
        }
        self.at += 1;
        Ok(out)
    }

    fn go(&mut self, kind: String, toks: &[Tok], line: u32) -> Done<()> {
        let with = toks.iter().position(|t| *t == Tok::Word("WITH".into()));
        let first = self.expression(&toks[..with.unwrap_or(toks.len())])?;
        let mut points = vec![first];
        let mut angle = false;
        while toks.get(self.at) == Some(&Tok::Mark(",".into())) {
            self.at += 1;
            if toks[self.at] == Tok::Word("CA".into()) {
                angle = true;
                break;
            }
            points.push(self.expression(toks)?);
        }
        let before = with.map(|at| self.with(&toks[at + 1..])).transpose()?;
        let end = points.pop().ok_or("no point")?;
        let parts = end.rec()?.clone();
        let numbers = |names: &[&str]| -> Vec<f64> {
            names.iter().filter_map(|name| parts.get(*name)).filter_map(|v| v.num().ok()).collect()
        };
        if let Some(Val::Num(v)) = parts.get("E1") {
            self.e1 = *v;
        }
        let goal = if kind.ends_with("_REL") || parts.contains_key("A1") {
            let goal = Goal::Plain(numbers(&["X", "Y", "Z", "A", "B", "C", "A1", "A2", "A3", "A4", "A5", "A6"]));
            // Where that is, only the controller knows.
            self.position = self.position.map(|(at, _)| (at, true));
            if parts.contains_key("A1") {
                self.position = None;
            }
            goal
        } else {
            let (mut at, mut loose) = match self.position {
                Some(position) => position,
                None => (std::array::from_fn(|i| 7.0 * i as f64 + self.below(40) as f64), true),
            };
            let mut own = [false; 6];
            for (i, name) in POSE.iter().enumerate() {
                match parts.get(*name) {
                    Some(Val::Num(v)) => (at[i], own[i]) = (*v, true),
                    Some(Val::Undef) | None => {}
                    Some(other) => return Err(format!("{name} is {other:?}")),
                }
            }
            loose &= own != [true; 6];
            let via = points.first().map(|via| -> Done<[f64; 3]> {
                let via = via.rec()?;
                let part = |name: &str| via.get(name).ok_or("via".to_owned()).and_then(Val::num);
                Ok([part("X")?, part("Y")?, part("Z")?])
            });
            let via = via.transpose()?;
            self.position = Some((at, loose));
            if angle {
                self.position = None;
                Goal::Plain(at.into_iter().chain(via.into_iter().flatten()).collect())
            } else {
                Goal::Pose { via, end: at, own, loose }
            }
        };
        let frame = |name: &str| self.named(name).six();
        let (base, tool) = (frame("$BASE")?, frame("$TOOL")?);
        let file = self.stack.last().map_or(0, |frame| frame.file);
        let holds_part = self.named("$IPO_MODE") == Val::Word("TCP".into());
        self.motions.push(Motion { file, line, kind, base, tool, holds_part, e1: self.e1, goal });
        if let Some(before) = before {
            self.restore(before);
        }
        Ok(())
    }
}
