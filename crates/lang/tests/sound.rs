//! Soundness: what the analysis would edit is right in every run.
//!
//! Random URScript programs are run by an interpreter that shares no code with the analysis: it walks the tree that they were
//! printed from, turns about z alone, and lets inputs, threads and routines that are not given fall as random numbers say. Each
//! program is run before and after its correction with the same inputs: every motion has to go where the correction wants it, in
//! the same order, and all else to where it went. `DEFLEX_LANG_PROGRAMS` sets the number of programs.

mod random;

use deflex_lang::ir::{Switch, TokenId};
use deflex_lang::run::run;
use deflex_lang::shared::{Editable, agree, editable};
use deflex_lang::urscript::{UrScript, read};
use nalgebra::{Isometry3, Point3, Vector3};
use random::Random;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::ops::Add;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Var {
    Global(usize),
    Local(usize),
}

#[derive(Clone, Debug)]
enum Num {
    Literal(usize),
    Var(Var),
    Add(Box<Num>, Box<Num>),
    Times(Box<Num>, usize),
    Minus(Box<Num>),
    Item(Var, usize),
}

#[derive(Clone, Debug)]
enum Pose {
    Of(Vec<Num>),
    Var(Var),
    Parameter,
    Trans(Box<Pose>, Box<Pose>),
    Add(Box<Pose>, Box<Pose>),
    Inverse(Box<Pose>),
    /// One of two, by a number.
    Listed(Box<[Pose; 2]>, Num),
}

#[derive(Clone, Debug)]
enum Condition {
    Input,
    Less(Num, Num),
    Both(Box<[Condition; 2]>),
}

#[derive(Clone, Debug)]
enum Does {
    Number(Var, Num),
    Pose(Var, Pose),
    Item(Var, usize, Num),
    Move(&'static str, Pose),
    Tool(Pose),
    Sleep(Num),
    Foreign,
    Call(usize, Pose),
    If(Condition, Vec<Line>, Vec<Line>),
    /// A local counter from 0 up to so many rounds.
    Count(usize, usize, Vec<Line>),
    While(Condition, Vec<Line>),
    Break,
    Return,
}

/// A statement with its number, by which a motion is known.
#[derive(Clone, Debug)]
struct Line(usize, Does);

const GLOBALS: usize = 3;
const LOCALS: usize = 3;
/// Counters of loops are locals after the others.
const COUNTERS: usize = 4;

struct Program {
    literals: Vec<f64>,
    globals: Vec<(Num, Pose)>,
    /// What a thread may assign at any moment.
    thread: Vec<(usize, Num)>,
    routines: Vec<Vec<Line>>,
    /// What the first routine gets.
    start: Vec<Num>,
}

struct Generator {
    random: Random,
    literals: Vec<f64>,
    lines: usize,
    loops: usize,
}

impl Generator {
    fn literal(&mut self, whole: bool) -> usize {
        let value = self.random.below(7) as f64 - 2.0;
        self.literals.push(if whole { value } else { (value * 100.0 + self.random.below(100) as f64) / 1e3 });
        self.literals.len() - 1
    }

    fn var(&mut self) -> Var {
        if self.random.one_in(2) {
            Var::Global(self.random.below(GLOBALS))
        } else {
            Var::Local(self.random.below(LOCALS))
        }
    }

    fn number(&mut self, depth: usize) -> Num {
        match self.random.below(if depth == 0 { 5 } else { 10 }) {
            0..=3 => Num::Literal(self.literal(false)),
            4 => Num::Var(self.var()),
            5 => Num::Add(Box::new(self.number(depth - 1)), Box::new(self.number(depth - 1))),
            6 => {
                let factor = self.literal(true);
                Num::Times(Box::new(self.number(depth - 1)), factor)
            }
            7 => Num::Minus(Box::new(self.number(depth - 1))),
            8 if self.loops > 0 => Num::Var(Var::Local(LOCALS + self.random.below(self.loops))),
            _ => Num::Item(self.var(), self.random.below(3)),
        }
    }

    fn pose(&mut self, depth: usize) -> Pose {
        match self.random.below(if depth == 0 { 7 } else { 12 }) {
            0..=2 => Pose::Of((0..6).map(|_| Num::Literal(self.literal(false))).collect()),
            3 => Pose::Of((0..6).map(|_| self.number(1)).collect()),
            4 | 5 => Pose::Var(self.var()),
            6 => Pose::Parameter,
            7 | 8 => Pose::Trans(Box::new(self.pose(depth - 1)), Box::new(self.pose(depth - 1))),
            9 => Pose::Add(Box::new(self.pose(depth - 1)), Box::new(self.pose(depth - 1))),
            10 => Pose::Inverse(Box::new(self.pose(depth - 1))),
            _ => {
                let two = Box::new([self.pose(depth - 1), self.pose(depth - 1)]);
                let index = if self.random.one_in(2) { Num::Var(self.var()) } else { Num::Literal(self.literal(true)) };
                Pose::Listed(two, index)
            }
        }
    }

    fn condition(&mut self, depth: usize) -> Condition {
        match self.random.below(4) {
            0 | 1 => Condition::Input,
            2 if depth > 0 => Condition::Both(Box::new([self.condition(depth - 1), self.condition(depth - 1)])),
            _ => {
                let other = Num::Literal(self.literal(true));
                Condition::Less(if self.loops > 0 { Num::Var(Var::Local(LOCALS)) } else { self.number(1) }, other)
            }
        }
    }

    fn block(&mut self, depth: usize, routine: usize, in_loop: bool) -> Vec<Line> {
        let count = 1 + self.random.below(5);
        (0..count).map(|_| self.line(depth, routine, in_loop)).collect()
    }

    fn line(&mut self, depth: usize, routine: usize, in_loop: bool) -> Line {
        self.lines += 1;
        let number = self.lines;
        let does = match self.random.below(if depth == 0 { 14 } else { 20 }) {
            0..=4 => Does::Move(["movel", "movej", "movej_inverse"][self.random.below(3)], self.pose(2)),
            5 => Does::Number(self.var(), self.number(2)),
            6 | 7 => Does::Pose(self.var(), self.pose(2)),
            8 => Does::Item(self.var(), self.random.below(3), self.number(1)),
            9 if self.random.one_in(2) => Does::Tool(self.pose(1)),
            10 if self.random.one_in(3) => Does::Sleep(self.number(1)),
            11 if self.random.one_in(4) => Does::Foreign,
            12 if in_loop && self.random.one_in(2) => Does::Break,
            13 if self.random.one_in(5) => Does::Return,
            14 | 15 if routine > 0 => Does::Call(self.random.below(routine), self.pose(1)),
            16 | 17 => {
                let condition = self.condition(1);
                Does::If(condition, self.block(depth - 1, routine, in_loop), self.block(depth - 1, routine, in_loop))
            }
            18 if self.loops < COUNTERS => {
                let (counter, rounds) = (self.loops, 1 + self.random.below(3));
                self.loops += 1;
                let body = self.block(depth - 1, routine, true);
                self.loops -= 1;
                Does::Count(counter, rounds, body)
            }
            19 => Does::While(self.condition(0), self.block(depth - 1, routine, true)),
            _ => Does::Move("movel", self.pose(1)),
        };
        Line(number, does)
    }

    fn program(mut self) -> Program {
        let globals = (0..GLOBALS)
            .map(|_| {
                let pose = Pose::Of((0..6).map(|_| Num::Literal(self.literal(false))).collect());
                (Num::Literal(self.literal(true)), pose)
            })
            .collect();
        let thread = if self.random.one_in(3) {
            (0..1 + self.random.below(2)).map(|_| (self.random.below(GLOBALS), self.number(1))).collect()
        } else {
            Vec::new()
        };
        let routines = (0..3).map(|routine| self.block(3, routine, false)).collect();
        let start = (0..6).map(|_| Num::Literal(self.literal(false))).collect();
        Program { literals: self.literals, globals, thread, routines, start }
    }
}

/// The text of a program, and where its literals and motions stand.
#[derive(Default)]
struct Text {
    text: String,
    /// Start of each literal.
    literals: BTreeMap<usize, usize>,
    /// Number of the statement on each line.
    lines: Vec<usize>,
}

impl Text {
    fn of(program: &Program) -> Self {
        let mut text = Self::default();
        for (i, (number, pose)) in program.globals.iter().enumerate() {
            text.put("global n");
            let _ = write!(text.text, "{i} = ");
            text.number(program, number);
            text.end(0);
            let _ = write!(text.text, "global p_{i} = ");
            text.pose(program, pose);
            text.end(0);
        }
        if !program.thread.is_empty() {
            text.put("thread t():\n while True:\n");
            text.lines.extend([0, 0]);
            for (global, value) in &program.thread {
                let _ = write!(text.text, "  n{global} = ");
                text.number(program, value);
                text.end(0);
            }
            text.put("  sync()\n end\nend\nh = run t()\n");
            text.lines.extend([0; 4]);
        }
        for (i, routine) in program.routines.iter().enumerate() {
            let _ = write!(text.text, "def routine_{i}(q):");
            text.end(0);
            text.block(program, routine);
            text.put("end");
            text.end(0);
        }
        text.put("routine_2(");
        text.pose(program, &Pose::Of(program.start.clone()));
        text.put(")");
        text.end(0);
        text
    }

    fn put(&mut self, text: &str) {
        self.text.push_str(text);
    }

    fn end(&mut self, line: usize) {
        self.text.push('\n');
        self.lines.push(line);
    }

    fn literal(&mut self, program: &Program, literal: usize) {
        self.literals.insert(self.text.len(), literal);
        let _ = write!(self.text, "{}", program.literals[literal]);
    }

    fn var(&mut self, var: Var, pose: bool) {
        let _ = match (var, pose) {
            (Var::Global(i), false) => write!(self.text, "n{i}"),
            (Var::Global(i), true) => write!(self.text, "p_{i}"),
            (Var::Local(i), false) => write!(self.text, "m{i}"),
            (Var::Local(i), true) => write!(self.text, "q_{i}"),
        };
    }

    fn number(&mut self, program: &Program, number: &Num) {
        match number {
            Num::Literal(literal) => self.literal(program, *literal),
            Num::Var(var) => self.var(*var, false),
            Num::Add(a, b) => {
                self.put("(");
                self.number(program, a);
                self.put(" + ");
                self.number(program, b);
                self.put(")");
            }
            Num::Times(a, factor) => {
                self.number(program, a);
                self.put(" * ");
                self.literal(program, *factor);
            }
            Num::Minus(a) => {
                self.put("-(");
                self.number(program, a);
                self.put(")");
            }
            Num::Item(var, at) => {
                self.var(*var, true);
                let _ = write!(self.text, "[{at}]");
            }
        }
    }

    fn pose(&mut self, program: &Program, pose: &Pose) {
        let mut two = |name: &str, a: &Pose, b: &Pose| {
            self.put(name);
            self.pose(program, a);
            self.put(", ");
            self.pose(program, b);
            self.put(")");
        };
        match pose {
            Pose::Of(numbers) => {
                self.put("p[");
                for (i, number) in numbers.iter().enumerate() {
                    if i > 0 {
                        self.put(", ");
                    }
                    // Turns are about z alone.
                    if i == 3 || i == 4 { self.put("0") } else { self.number(program, number) }
                }
                self.put("]");
            }
            Pose::Var(var) => self.var(*var, true),
            Pose::Parameter => self.put("q"),
            Pose::Trans(a, b) => two("pose_trans(", a, b),
            Pose::Add(a, b) => two("pose_add(", a, b),
            Pose::Inverse(a) => {
                self.put("pose_inv(");
                self.pose(program, a);
                self.put(")");
            }
            Pose::Listed(both, index) => {
                self.put("[");
                self.pose(program, &both[0]);
                self.put(", ");
                self.pose(program, &both[1]);
                self.put("][");
                self.number(program, index);
                self.put("]");
            }
        }
    }

    fn condition(&mut self, program: &Program, condition: &Condition) {
        match condition {
            Condition::Input => self.put("get_digital_in(1)"),
            Condition::Less(a, b) => {
                self.number(program, a);
                self.put(" < ");
                self.number(program, b);
            }
            Condition::Both(two) => {
                self.put("(");
                self.condition(program, &two[0]);
                self.put(") and (");
                self.condition(program, &two[1]);
                self.put(")");
            }
        }
    }

    fn block(&mut self, program: &Program, lines: &[Line]) {
        for Line(number, does) in lines {
            let line = *number;
            match does {
                Does::Number(var, value) => {
                    self.var(*var, false);
                    self.put(" = ");
                    self.number(program, value);
                }
                Does::Pose(var, value) => {
                    self.var(*var, true);
                    self.put(" = ");
                    self.pose(program, value);
                }
                Does::Item(var, at, value) => {
                    self.var(*var, true);
                    let _ = write!(self.text, "[{at}] = ");
                    self.number(program, value);
                }
                Does::Move(word, pose) if *word == "movej_inverse" => {
                    self.put("movej(get_inverse_kin(");
                    self.pose(program, pose);
                    self.put("), a=1.4)");
                }
                Does::Move(word, pose) => {
                    self.put(word);
                    self.put("(");
                    self.pose(program, pose);
                    self.put(", v=0.1)");
                }
                Does::Tool(pose) => {
                    self.put("set_tcp(");
                    self.pose(program, pose);
                    self.put(")");
                }
                Does::Sleep(number) => {
                    self.put("sleep(");
                    self.number(program, number);
                    self.put(")");
                }
                Does::Foreign => self.put("not_given()"),
                Does::Call(routine, pose) => {
                    let _ = write!(self.text, "routine_{routine}(");
                    self.pose(program, pose);
                    self.put(")");
                }
                Does::If(condition, yes, no) => {
                    self.put("if ");
                    self.condition(program, condition);
                    self.put(":");
                    self.end(line);
                    self.block(program, yes);
                    self.put("else:");
                    self.end(0);
                    self.block(program, no);
                    self.put("end");
                }
                Does::Count(counter, rounds, body) => {
                    let name = LOCALS + counter;
                    let _ = write!(self.text, "m{name} = 0\nwhile m{name} < {rounds}:");
                    self.lines.push(0);
                    self.end(line);
                    let _ = write!(self.text, "m{name} = m{name} + 1");
                    self.end(0);
                    self.block(program, body);
                    self.put("end");
                }
                Does::While(condition, body) => {
                    self.put("while ");
                    self.condition(program, condition);
                    self.put(":");
                    self.end(line);
                    self.block(program, body);
                    self.put("end");
                }
                Does::Break => self.put("break"),
                Does::Return => self.put("return"),
            }
            self.end(line);
        }
    }
}

/// Position and turn about z.
type PlanarPose = [f64; 4];

/// A motion that was run: its statement, where to, with which tool.
#[derive(Clone, Debug, PartialEq)]
struct ExecutedMotion {
    line: usize,
    to: PlanarPose,
    tool: PlanarPose,
}

struct Machine<'a> {
    program: &'a Program,
    literals: &'a [f64],
    random: Random,
    numbers: [f64; GLOBALS],
    poses: [PlanarPose; GLOBALS],
    tool: PlanarPose,
    steps: Vec<ExecutedMotion>,
    /// Statements that may still be run.
    left: usize,
}

struct Frame {
    numbers: [f64; LOCALS + COUNTERS],
    poses: [PlanarPose; LOCALS],
    given: PlanarPose,
}

#[derive(PartialEq)]
enum End {
    On,
    Break,
    Return,
    Out,
}

impl<'a> Machine<'a> {
    fn run(program: &'a Program, literals: &'a [f64], random: Random) -> Vec<ExecutedMotion> {
        let mut machine = Self {
            program,
            literals,
            random,
            numbers: [0.0; GLOBALS],
            poses: [[0.0; 4]; GLOBALS],
            tool: [0.0; 4],
            steps: Vec::new(),
            left: 400,
        };
        let mut frame = machine.frame([0.0; 4]);
        for (i, (number, pose)) in program.globals.iter().enumerate() {
            machine.numbers[i] = machine.number(&frame, number);
            machine.poses[i] = machine.pose(&frame, pose);
        }
        let given = machine.pose(&frame, &Pose::Of(program.start.clone()));
        frame = machine.frame(given);
        machine.block(&program.routines[2], &mut frame);
        machine.steps
    }

    fn any(&mut self) -> f64 {
        self.random.below(1000) as f64 / 100.0 + 11.0
    }

    /// Variables that nothing has set have some value.
    fn frame(&mut self, given: PlanarPose) -> Frame {
        let value = 50.0 + self.random.below(100) as f64;
        Frame { numbers: [value; LOCALS + COUNTERS], poses: [[value; 4]; LOCALS], given }
    }

    fn number(&self, frame: &Frame, number: &Num) -> f64 {
        match number {
            Num::Literal(literal) => self.literals[*literal],
            Num::Var(Var::Global(i)) => self.numbers[*i],
            Num::Var(Var::Local(i)) => frame.numbers[*i],
            Num::Add(a, b) => self.number(frame, a) + self.number(frame, b),
            Num::Times(a, factor) => self.number(frame, a) * self.literals[*factor],
            Num::Minus(a) => -self.number(frame, a),
            Num::Item(Var::Global(i), at) => self.poses[*i][*at],
            Num::Item(Var::Local(i), at) => frame.poses[*i][*at],
        }
    }

    fn pose(&self, frame: &Frame, pose: &Pose) -> PlanarPose {
        match pose {
            Pose::Of(numbers) => [0, 1, 2, 5].map(|i| self.number(frame, &numbers[i])),
            Pose::Var(Var::Global(i)) => self.poses[*i],
            Pose::Var(Var::Local(i)) => frame.poses[*i],
            Pose::Parameter => frame.given,
            Pose::Trans(a, b) => {
                let ([x, y, z, turn], [dx, dy, dz, more]) = (self.pose(frame, a), self.pose(frame, b));
                let (sin, cos) = turn.sin_cos();
                [x + cos * dx - sin * dy, y + sin * dx + cos * dy, z + dz, turn + more]
            }
            Pose::Add(a, b) => {
                let (a, b) = (self.pose(frame, a), self.pose(frame, b));
                [0, 1, 2, 3].map(|i| a[i] + b[i])
            }
            Pose::Inverse(a) => {
                let [x, y, z, turn] = self.pose(frame, a);
                let (sin, cos) = (-turn).sin_cos();
                [-(cos * x - sin * y), -(sin * x + cos * y), -z, -turn]
            }
            Pose::Listed(two, index) => {
                let at = self.number(frame, index);
                // An index that is out of range stops the program; then it does not matter where to.
                self.pose(frame, &two[usize::from(at >= 1.0)])
            }
        }
    }

    fn condition(&mut self, frame: &Frame, condition: &Condition) -> bool {
        match condition {
            Condition::Input => self.random.one_in(2),
            Condition::Less(a, b) => self.number(frame, a) < self.number(frame, b),
            Condition::Both(two) => {
                let (a, b) = (self.condition(frame, &two[0]), self.condition(frame, &two[1]));
                a && b
            }
        }
    }

    fn block(&mut self, lines: &[Line], frame: &mut Frame) -> End {
        for line in lines {
            let end = self.line(line, frame);
            if end != End::On {
                return end;
            }
        }
        End::On
    }

    fn line(&mut self, Line(number, does): &Line, frame: &mut Frame) -> End {
        if self.left == 0 {
            return End::Out;
        }
        self.left -= 1;
        if !self.program.thread.is_empty() && self.random.one_in(3) {
            let (global, value) = &self.program.thread[self.random.below(self.program.thread.len())];
            let own = self.frame([0.0; 4]);
            self.numbers[*global] = self.number(&own, value);
        }
        match does {
            Does::Number(var, value) => {
                let value = self.number(frame, value);
                match var {
                    Var::Global(i) => self.numbers[*i] = value,
                    Var::Local(i) => frame.numbers[*i] = value,
                }
            }
            Does::Pose(var, value) => {
                let value = self.pose(frame, value);
                match var {
                    Var::Global(i) => self.poses[*i] = value,
                    Var::Local(i) => frame.poses[*i] = value,
                }
            }
            Does::Item(var, at, value) => {
                let value = self.number(frame, value);
                match var {
                    Var::Global(i) => self.poses[*i][*at] = value,
                    Var::Local(i) => frame.poses[*i][*at] = value,
                }
            }
            Does::Move(_, pose) => {
                let to = self.pose(frame, pose);
                self.steps.push(ExecutedMotion { line: *number, to, tool: self.tool });
            }
            Does::Tool(pose) => self.tool = self.pose(frame, pose),
            Does::Sleep(_) | Does::Break | Does::Return => {}
            Does::Foreign => {
                for i in 0..GLOBALS {
                    if self.random.one_in(2) {
                        self.numbers[i] = self.any();
                        self.poses[i] = [self.any(), self.any(), self.any(), 0.5];
                    }
                }
                if self.random.one_in(2) {
                    self.tool = [self.any(), 0.0, 0.0, 0.0];
                }
            }
            Does::Call(routine, pose) => {
                let given = self.pose(frame, pose);
                let mut inner = self.frame(given);
                let program = self.program;
                if self.block(&program.routines[*routine], &mut inner) == End::Out {
                    return End::Out;
                }
            }
            Does::If(condition, yes, no) => {
                let block = if self.condition(frame, condition) { yes } else { no };
                return self.block(block, frame);
            }
            Does::Count(counter, rounds, body) => {
                frame.numbers[LOCALS + counter] = 0.0;
                while frame.numbers[LOCALS + counter] < *rounds as f64 {
                    frame.numbers[LOCALS + counter] += 1.0;
                    match self.block(body, frame) {
                        End::On => {}
                        End::Break => break,
                        end => return end,
                    }
                }
            }
            Does::While(condition, body) => {
                while self.condition(frame, condition) {
                    match self.block(body, frame) {
                        End::On => {}
                        End::Break => break,
                        end => return end,
                    }
                    if self.left == 0 {
                        return End::Out;
                    }
                }
            }
        }
        match does {
            Does::Break => End::Break,
            Does::Return => End::Return,
            _ => End::On,
        }
    }
}

/// What a motion that was analysed is to become.
struct Wish {
    line: usize,
    was: PlanarPose,
    wanted: PlanarPose,
    tool: Option<PlanarPose>,
    edited: bool,
}

fn place(pose: &Isometry3<f64>) -> PlanarPose {
    let [x, y, z] = pose.translation.vector.into();
    [x, y, z, pose.rotation.scaled_axis().z]
}

/// Same position, and the same turn but for whole ones.
fn is_near(a: &PlanarPose, b: &PlanarPose) -> bool {
    let turn = (a[3] - b[3]).rem_euclid(std::f64::consts::TAU);
    (0..3).all(|i| (a[i] - b[i]).abs() < 1e-7) && turn.min(std::f64::consts::TAU - turn) < 1e-7
}

/// What a program contributes to the count of what the test has looked at.
#[derive(Default)]
struct Seen {
    edited: usize,
    kept: usize,
    moved: usize,
}

impl Add for Seen {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { edited: self.edited + other.edited, kept: self.kept + other.kept, moved: self.moved + other.moved }
    }
}

fn hold(seed: u64, seen: &mut Seen) {
    let random = Random(seed);
    let generator = Generator { random, literals: Vec::new(), lines: 0, loops: 0 };
    let program = generator.program();
    let text = Text::of(&program);
    let shown = &text.text;
    let lowered = read(&[shown.as_bytes()], 1).unwrap_or_else(|fault| panic!("{seed}: {fault:?}\n{shown}"));
    let outcome = run(&lowered, &UrScript).unwrap_or_else(|_| panic!("{seed}: too long\n{shown}"));
    let edits = editable(&outcome);
    let literal_of: BTreeMap<TokenId, usize> = lowered
        .tokens
        .iter()
        .enumerate()
        .filter_map(|(i, token)| Some((TokenId(i as u32), *text.literals.get(&(token.span.start as usize))?)))
        .collect();
    let line_of = |start: u32| text.lines[shown[..start as usize].matches('\n').count()];
    let (mut wishes, mut wanted) = (Vec::new(), Vec::new());
    for (motion, edit) in outcome.motions.iter().zip(&edits) {
        let line = line_of(motion.place.span.start);
        let Some(pose) = motion.to.pose() else { continue };
        let was = place(&pose.pose());
        let tool = motion.switches[Switch::Tool as usize].pose().map(|tool| place(&tool.pose()));
        let mut new = was;
        let mut texts: Vec<(TokenId, Option<i64>)> = Vec::new();
        if !matches!(edit, Editable::No(_)) {
            // What is wanted depends on the first token, or on the statement: users of a number agree, or do not.
            let key = if seed.is_multiple_of(4) { line as u32 } else { pose.affine(0).map_or(0, |a| a.token.0) };
            let shift = Vector3::new(0.01 + f64::from(key % 7) * 1e-3, -0.02, 0.005);
            let moved = pose.pose().translation.vector + shift;
            let inner = pose.left.inverse() * Point3::from(moved) - pose.own.rotation * pose.right.translation.vector;
            for at in 0..3 {
                let affine = pose.affine(at).expect("an editable number");
                let value = (inner.coords[at] - affine.offset) / affine.scale;
                texts.push((affine.token, Some((value * 1e9).round() as i64)));
            }
            texts.extend((3..6).filter_map(|at| Some((pose.affine(at)?.token, None))));
            new[..3].copy_from_slice(moved.as_slice());
        }
        wishes.push(texts);
        wanted.push(Wish { line, was, wanted: new, tool, edited: !matches!(edit, Editable::No(_)) });
    }
    let mut literals = program.literals.clone();
    for ((wish, texts), agreed) in wanted.iter_mut().zip(&wishes).zip(agree(&wishes)) {
        wish.edited &= agreed;
        for (token, text) in texts.iter().filter(|_| wish.edited) {
            if let Some(text) = text {
                literals[literal_of[token]] = *text as f64 * 1e-9;
            }
        }
        if !wish.edited {
            wish.wanted = wish.was;
        }
        *(if wish.edited { &mut seen.edited } else { &mut seen.kept }) += 1;
    }
    let by_line: BTreeSet<usize> = outcome.motions.iter().map(|motion| line_of(motion.place.span.start)).collect();
    for input in 0..8 {
        let random = Random(seed ^ (input << 40) ^ 0x5EED);
        let before = Machine::run(&program, &program.literals, random.clone());
        let after = Machine::run(&program, &literals, random);
        assert_eq!(before.len(), after.len(), "{seed}/{input}: another path through\n{shown}");
        for (a, b) in before.iter().zip(&after) {
            assert_eq!(a.line, b.line, "{seed}/{input}: another path through\n{shown}");
            assert!(by_line.contains(&a.line), "{seed}/{input}: statement {} runs unseen\n{shown}", a.line);
            assert!(is_near(&a.tool, &b.tool), "{seed}/{input}: tool at {}\n{shown}", a.line);
            // Of the motions that this may be, one has to be what happened.
            let of_line = || wanted.iter().filter(|wish| wish.line == a.line);
            let right = |wish: &Wish| is_near(&wish.was, &a.to) && is_near(&wish.wanted, &b.to);
            let tool = |wish: &Wish| !wish.edited || wish.tool.is_none_or(|tool| is_near(&tool, &a.tool));
            let same = is_near(&a.to, &b.to);
            let moved = of_line().any(|wish| right(wish) && tool(wish));
            assert!(
                same && !of_line().any(|wish| wish.edited && is_near(&wish.was, &a.to)) || moved,
                "{seed}/{input}: statement {} goes from {:?} to {:?}\n{shown}",
                a.line,
                a.to,
                b.to
            );
            seen.moved += usize::from(!same);
        }
    }
}

#[test]
fn what_is_edited_is_right_in_every_run() {
    let count = std::env::var("DEFLEX_LANG_PROGRAMS").ok().and_then(|count| count.parse().ok()).unwrap_or(3000);
    let one = |seed| {
        let mut seen = Seen::default();
        hold(seed, &mut seen);
        seen
    };
    let seen = (0..count).into_par_iter().map(one).reduce(Seen::default, Seen::add);
    // The test looks at what it is there for.
    assert!(seen.edited * 10 > seen.kept, "{} edited, {} kept", seen.edited, seen.kept);
}
