//! Soundness of INFORM: what the analysis would edit is right in every run.
//!
//! Random jobs are run by an interpreter of their text that shares no code with the reader: it splits lines at blanks, holds
//! positions as six numbers, and lets signals, jobs that are not given and weaving fall as random numbers say. Each job is run
//! twice, one time after the other as a controller in continuous operation does, before and after its correction with the same
//! inputs. `DEFLEX_LANG_PROGRAMS` sets the number of jobs.

#![allow(clippy::unwrap_used)] // the interpreter reads what the generator has written

mod random;

use deflex_lang::inform::{Inform, read};
use deflex_lang::ir::{Path, TokenId};
use deflex_lang::run::run;
use deflex_lang::shared::{Editable, agree, editable};
use random::Random;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::ops::Add;

/// Teaching positions of each job, and position variables that come with the first.
const TAUGHT: usize = 16;
const LOADED: std::ops::Range<usize> = 100..105;

struct Generator {
    random: Random,
    text: String,
    labels: usize,
    loops: usize,
    /// Whether circles may be anything but three points after a line.
    has_odd_circles: bool,
}

impl Generator {
    fn put(&mut self, line: &str) {
        self.text.push_str(line);
        self.text.push_str(if self.text.len().is_multiple_of(5) { "\r\n" } else { "\n" });
    }

    fn numbers(&mut self, turned: bool) -> String {
        let mut number = |places: usize| {
            let value = self.random.below(200_000) as i64 - 100_000;
            let size = if places == 3 { 1e3 } else { 1e4 };
            format!("{:.places$}", value as f64 / size)
        };
        let [x, y, z] = [number(3), number(3), number(3)];
        let turn = if turned { [number(4), number(4), number(4)] } else { ["0", "0.0000", "0"].map(str::to_owned) };
        format!("{x},{y},{z},{}", turn.join(","))
    }

    fn head(&mut self, name: &str, variables: bool) {
        self.put("/JOB");
        self.put(&format!("//NAME {name}"));
        self.put("//POS");
        self.put("///TOOL 1");
        self.put("///USER 1");
        self.put("///POSTYPE USER");
        for i in 0..TAUGHT {
            if i == 5 {
                self.put("///POSTYPE ROBOT");
            }
            let numbers = self.numbers(true);
            self.put(&format!("C{i:05}={numbers}"));
        }
        for i in LOADED.filter(|_| variables) {
            if i == 103 {
                self.put("///TOOL 2");
            }
            // Shifts have no turn.
            let turned = self.random.one_in(2);
            let numbers = self.numbers(turned);
            self.put(&format!("P{i:05}={numbers}"));
        }
        self.put("//INST");
        self.put("///GROUP1 RB1");
        self.put("NOP");
    }

    fn variable(&mut self) -> String {
        let kind = ["I", "I", "D", "LD"][self.random.below(4)];
        format!("{kind}{:03}", self.random.below(3))
    }

    fn position_variable(&mut self) -> String {
        match self.random.below(40) {
            0 => ["P[I000]", "LP[I000]"][self.random.below(2)].to_owned(),
            1..=4 => format!("LP{:03}", self.random.below(2)),
            5 | 6 => format!("P{:03}", self.random.below(3)),
            _ => format!("P{:03}", LOADED.start + self.random.below(LOADED.len())),
        }
    }

    fn position(&mut self) -> String {
        if self.random.one_in(3) { self.position_variable() } else { format!("C{:05}", self.random.below(TAUGHT)) }
    }

    fn value(&mut self) -> String {
        if self.random.one_in(2) { self.variable() } else { format!("{}", self.random.below(9) as i64 - 3) }
    }

    fn condition(&mut self) -> String {
        if self.random.one_in(2) {
            return "IN#(3)=ON".to_owned();
        }
        let (left, right) = (self.variable(), self.value());
        let sign = ["=", "<>", "<", ">="][self.random.below(4)];
        format!("{left}{sign}{right}")
    }

    fn block(&mut self, depth: usize, job: usize) {
        for _ in 0..1 + self.random.below(6) {
            self.statement(depth, job);
        }
    }

    fn statement(&mut self, depth: usize, job: usize) {
        match self.random.below(if depth == 0 { 20 } else { 28 }) {
            0..=7 => {
                let (word, position) = (["MOVL", "MOVL", "MOVJ"][self.random.below(3)], self.position());
                let speed = if word == "MOVJ" { "VJ=25.00" } else { "V=100.0" };
                let until = if self.random.one_in(60) { " UNTIL IN#(2)=ON" } else { "" };
                self.put(&format!("{word} {position} {speed}{until}"));
            }
            8 => {
                let is_odd = self.has_odd_circles && self.random.one_in(2);
                if !is_odd {
                    self.put("MOVL C00001 V=50.0");
                }
                for _ in 0..if is_odd { 2 + self.random.below(3) } else { 3 } {
                    let position = format!("C{:05}", self.random.below(TAUGHT));
                    self.put(&format!("MOVC {position} V=50.0"));
                }
                if !is_odd || self.random.one_in(2) {
                    self.put("MOVL C00000 V=50.0");
                }
            }
            9 => {
                let (to, from) = (self.position_variable(), self.position_variable());
                self.put(&format!("SET {to} {from}"));
            }
            10 => {
                let (to, element) = (self.position_variable(), 1 + self.random.below(4));
                let value =
                    if self.random.one_in(3) { self.variable() } else { format!("{}", self.random.below(90_000)) };
                self.put(&format!("SETE {to} ({element}) {value}"));
            }
            11 => {
                let (to, from) = (self.variable(), self.position_variable());
                let element = 1 + self.random.below(3);
                self.put(&format!("GETE {to} {from} ({element})"));
            }
            12 | 13 => {
                let (word, to) = (["SET", "ADD", "SUB", "MUL"][self.random.below(4)], self.variable());
                let value = self.value();
                self.put(&format!("{word} {to} {value}"));
            }
            14 => {
                let to = self.variable();
                let word = ["INC", "DEC"][self.random.below(2)];
                self.put(&format!("{word} {to}"));
            }
            15 if self.random.one_in(3) => {
                let to = self.position_variable();
                self.put(&format!("GETS {to} $PX001"));
            }
            16 if self.random.one_in(20) => self.put("CALL JOB:NOTGIVEN ARGF\"1\""),
            17 if self.random.one_in(3) => {
                let frame = ["RF", "UF#(1)", "BF"][self.random.below(3)];
                let by = self.position_variable();
                self.put(&format!("SFTON {by} {frame}"));
                for _ in 0..self.random.below(3) {
                    self.statement(0, job);
                }
                if !self.random.one_in(4) {
                    self.put("SFTOF");
                }
            }
            18 if self.random.one_in(6) => {
                self.put("WVON WEV#(1)");
                self.statement(0, job);
                self.put("WVOF");
            }
            19 if self.random.one_in(3) => {
                let condition = self.condition();
                self.put(&format!("RET IF {condition}"));
            }
            20 | 21 => {
                let condition = self.condition();
                self.put(&format!("IFTHENEXP {condition}"));
                self.block(depth - 1, job);
                if self.random.one_in(2) {
                    self.put("ELSE");
                    self.block(depth - 1, job);
                }
                self.put("ENDIF");
            }
            22 if self.loops < 2 => {
                let counter = 8 + self.loops;
                self.loops += 1;
                let rounds = 1 + self.random.below(3);
                self.put(&format!("FOR I{counter:03}=1 TO {rounds}"));
                self.block(depth - 1, job);
                self.put(&format!("NEXT I{counter:03}"));
                self.loops -= 1;
            }
            23 => {
                let condition = self.condition();
                self.put(&format!("WHILE {condition}"));
                self.block(depth - 1, job);
                self.put("ENDWHILE");
            }
            24 if job > 0 => {
                let called = self.random.below(job);
                let condition = if self.random.one_in(2) { format!(" IF {}", self.condition()) } else { String::new() };
                self.put(&format!("CALL JOB:SUB-{called}{condition}"));
            }
            25 => {
                // Around again while a condition holds.
                let label = self.labels;
                self.labels += 1;
                self.put(&format!("*L{label}"));
                self.block(depth - 1, job);
                let condition = self.condition();
                self.put(&format!("JUMP *L{label} IF {condition}"));
            }
            26 => {
                let label = self.labels;
                self.labels += 1;
                let condition = self.condition();
                self.put(&format!("JUMP *L{label} IF {condition}"));
                self.block(depth - 1, job);
                self.put(&format!("*L{label}"));
            }
            _ => self.put("DOUT OT#(1) ON"),
        }
    }

    /// The job that is started, and those that it calls in files of their own.
    fn jobs(mut self) -> Vec<String> {
        let mut all = Vec::new();
        for job in 0..3 {
            let name = if job == 2 { "MAIN".to_owned() } else { format!("SUB-{job}") };
            self.head(&name, job == 2);
            self.block(3, job);
            self.put("END");
            all.push(std::mem::take(&mut self.text));
        }
        all.reverse();
        all
    }
}

type Numbers = [f64; 6];

/// A motion that was run: the file and line of its statement, where to and in which frame, and, of a point of a circle, its place among those in a row.
#[derive(Clone, Debug, PartialEq)]
struct ExecutedMotion {
    line: (usize, usize),
    frame: String,
    to: Numbers,
    point: usize,
    /// How many there are in a row.
    points: Option<usize>,
}

struct Job {
    file: usize,
    name: String,
    lines: Vec<(usize, String)>,
    taught: BTreeMap<usize, (String, Numbers)>,
}

struct Machine<'a> {
    jobs: &'a [Job],
    random: Random,
    numbers: BTreeMap<String, i64>,
    positions: BTreeMap<String, (String, Numbers)>,
    shifts: Vec<(String, [f64; 3])>,
    weaves: bool,
    steps: Vec<ExecutedMotion>,
    left: usize,
}

/// What a file says before its instructions.
fn load(file: usize, text: &str, positions: &mut BTreeMap<String, (String, Numbers)>) -> Job {
    let mut job = Job { file, name: String::new(), lines: Vec::new(), taught: BTreeMap::new() };
    let (mut frame, mut instructions) = (String::new(), false);
    for (at, line) in text.lines().enumerate() {
        if instructions {
            job.lines.push((at, line.trim().to_owned()));
        } else if let Some(name) = line.strip_prefix("//NAME ") {
            job.name = name.trim().to_owned();
        } else if let Some(kind) = line.strip_prefix("///POSTYPE ") {
            frame = kind.trim().to_owned();
        } else if let Some((name, numbers)) = line.split_once('=') {
            let numbers: Vec<f64> = numbers.split(',').map(|number| number.trim().parse().unwrap()).collect();
            let value = (frame.clone(), Numbers::try_from(numbers).unwrap());
            match name.strip_prefix('C') {
                Some(number) => drop(job.taught.insert(number.parse().unwrap(), value)),
                None => drop(positions.insert(format!("P{:03}", name[1..].parse::<usize>().unwrap()), value)),
            }
        }
        instructions |= line.trim() == "//INST";
    }
    job
}

/// Local variables of a job that runs.
#[derive(Default)]
struct Locals {
    numbers: BTreeMap<String, i64>,
    positions: BTreeMap<String, (String, Numbers)>,
}

impl<'a> Machine<'a> {
    /// Two runs, one after the other.
    fn run(jobs: &'a [Job], loaded: &BTreeMap<String, (String, Numbers)>, random: Random) -> Vec<ExecutedMotion> {
        let (numbers, positions) = (BTreeMap::new(), loaded.clone());
        let steps = Vec::new();
        let mut machine =
            Self { jobs, random, numbers, positions, shifts: Vec::new(), weaves: false, steps, left: 400 };
        for _ in 0..2 {
            machine.shifts.clear();
            machine.weaves = false;
            machine.left = 400;
            let begin = machine.steps.len();
            machine.job(&jobs[0]);
            // Points of circles in a row.
            let mut at = begin;
            while at < machine.steps.len() {
                let mut end = at;
                while end < machine.steps.len() && machine.steps[end].point > 0 {
                    end += 1;
                }
                // What the end of the run cuts off is not known.
                let points = if machine.left == 0 && end == machine.steps.len() { None } else { Some(end - at) };
                for (place, step) in machine.steps[at..end].iter_mut().enumerate() {
                    (step.point, step.points) = (place + 1, points);
                }
                at = end.max(at) + 1;
            }
        }
        machine.steps
    }

    /// What nothing has set holds something.
    fn any(&mut self) -> i64 {
        self.random.below(40_000) as i64 + 200_000
    }

    fn number(&mut self, locals: &mut Locals, word: &str) -> i64 {
        if let Ok(value) = word.parse() {
            return value;
        }
        let any = self.any();
        let all = if word.starts_with('L') { &mut locals.numbers } else { &mut self.numbers };
        *all.entry(word.to_owned()).or_insert(any)
    }

    fn name(&mut self, locals: &mut Locals, word: &str) -> String {
        let (list, first, count) = if word.starts_with('L') { ("LP", 0, 2) } else { ("P", 100, 5) };
        let index = word.strip_prefix(list).and_then(|rest| rest.strip_prefix('[')?.strip_suffix(']'));
        let Some(index) = index else { return word.to_owned() };
        let index = self.number(locals, index);
        // An index that is out of range stops a controller: any variable does.
        format!("{list}{:03}", first + index.rem_euclid(count))
    }

    fn position(&mut self, locals: &mut Locals, job: &Job, word: &str) -> (String, Numbers) {
        if let Some(number) = word.strip_prefix('C') {
            return job.taught[&number.parse().unwrap()].clone();
        }
        let name = self.name(locals, word);
        let any = (String::from("ROBOT"), [0; 6].map(|_: i32| self.any() as f64 / 1e3));
        let all = if name.starts_with('L') { &mut locals.positions } else { &mut self.positions };
        all.entry(name).or_insert(any).clone()
    }

    fn set_position(&mut self, locals: &mut Locals, word: &str, value: (String, Numbers)) {
        let name = self.name(locals, word);
        let all = if name.starts_with('L') { &mut locals.positions } else { &mut self.positions };
        all.insert(name, value);
    }

    fn set_number(&mut self, locals: &mut Locals, word: &str, value: i64) {
        let all = if word.starts_with('L') { &mut locals.numbers } else { &mut self.numbers };
        all.insert(word.to_owned(), value.clamp(-2_000_000_000, 2_000_000_000));
    }

    fn holds(&mut self, locals: &mut Locals, condition: &str) -> bool {
        if condition.starts_with("IN#") {
            return self.random.one_in(2);
        }
        let sign = ["<>", ">=", "=", "<"].into_iter().find(|sign| condition.contains(sign)).unwrap();
        let (left, right) = condition.split_once(sign).unwrap();
        let (left, right) = (self.number(locals, left), self.number(locals, right));
        match sign {
            "<>" => left != right,
            ">=" => left >= right,
            "=" => left == right,
            _ => left < right,
        }
    }

    /// Whether the program goes on.
    fn job(&mut self, job: &Job) -> bool {
        let mut locals = Locals::default();
        let mut at = 0;
        // The line that closes, or divides, the block that begins or divides at a line.
        let partner = |from: usize, divides: bool| {
            let mut depth = 0;
            (from + 1..job.lines.len())
                .find(|line| {
                    let word = job.lines[*line].1.split_whitespace().next().unwrap_or_default();
                    match word {
                        "IFTHENEXP" | "FOR" | "WHILE" => depth += 1,
                        "ELSE" => return depth == 0 && divides,
                        "ENDIF" | "NEXT" | "ENDWHILE" if depth == 0 => return true,
                        "ENDIF" | "NEXT" | "ENDWHILE" => depth -= 1,
                        _ => {}
                    }
                    false
                })
                .unwrap()
        };
        let opening = |from: usize| {
            (0..from)
                .rev()
                .find(|line| {
                    partner(*line, false) == from && {
                        let word = job.lines[*line].1.split_whitespace().next().unwrap_or_default();
                        matches!(word, "FOR" | "WHILE")
                    }
                })
                .unwrap()
        };
        while at < job.lines.len() {
            if self.left == 0 {
                return false;
            }
            self.left -= 1;
            let (number, line) = &job.lines[at];
            let (line, condition) = match line.split_once(" IF ") {
                Some((line, condition)) => (line, Some(condition)),
                None => (line.as_str(), None),
            };
            at += 1;
            if let Some(condition) = condition
                && !self.holds(&mut locals, condition)
            {
                continue;
            }
            let words: Vec<&str> = line.split_whitespace().collect();
            match words[0] {
                "MOVL" | "MOVJ" | "MOVC" => {
                    let (frame, mut to) = self.position(&mut locals, job, words[1]);
                    for (of, by) in &self.shifts {
                        for i in 0..3 {
                            // Between frames it is some other way.
                            to[i] += if *of == frame { by[i] } else { 1.37 * by[2 - i] + 0.5 };
                        }
                    }
                    if self.weaves || line.contains("UNTIL") {
                        to[0] += self.any() as f64;
                    }
                    let line = (job.file, *number);
                    self.steps.push(ExecutedMotion {
                        line,
                        frame,
                        to,
                        point: usize::from(words[0] == "MOVC"),
                        points: None,
                    });
                }
                "SET" if words[1].contains('P') => {
                    let value = self.position(&mut locals, job, words[2]);
                    self.set_position(&mut locals, words[1], value);
                }
                "SETE" => {
                    let (frame, mut to) = self.position(&mut locals, job, words[1]);
                    let element = words[2][1..2].parse::<usize>().unwrap() - 1;
                    to[element] = self.number(&mut locals, words[3]) as f64 / if element < 3 { 1e3 } else { 1e4 };
                    self.set_position(&mut locals, words[1], (frame, to));
                }
                "GETE" => {
                    let (_, from) = self.position(&mut locals, job, words[2]);
                    let element = words[3][1..2].parse::<usize>().unwrap() - 1;
                    self.set_number(&mut locals, words[1], (from[element] * 1e3).round() as i64);
                }
                "SET" | "ADD" | "SUB" | "MUL" | "INC" | "DEC" => {
                    let old = self.number(&mut locals, words[1]);
                    let by = words.get(2).map_or(1, |word| self.number(&mut locals, word));
                    let value = match words[0] {
                        "SET" => by,
                        "ADD" | "INC" => old + by,
                        "SUB" | "DEC" => old - by,
                        _ => old * by,
                    };
                    self.set_number(&mut locals, words[1], value);
                }
                "GETS" => {
                    let value = (String::from("ROBOT"), [0; 6].map(|_: i32| self.any() as f64 / 1e3));
                    self.set_position(&mut locals, words[1], value);
                }
                "CALL" if words[1] == "JOB:NOTGIVEN" => {
                    if self.random.one_in(2) {
                        let by = self.any() as f64;
                        self.shifts.push(("ROBOT".to_owned(), [by, 0.0, 0.0]));
                    }
                    for variable in LOADED.chain(0..3) {
                        if self.random.one_in(2) {
                            let value = (String::from("ROBOT"), [0; 6].map(|_: i32| self.any() as f64 / 1e3));
                            self.positions.insert(format!("P{variable:03}"), value);
                        }
                        if self.random.one_in(2) {
                            let value = self.any();
                            self.numbers.insert(format!("I{:03}", variable % 3), value);
                        }
                    }
                }
                "CALL" => {
                    let called = self.jobs.iter().find(|other| words[1] == format!("JOB:{}", other.name)).unwrap();
                    if !self.job(called) {
                        return false;
                    }
                }
                "JUMP" => at = job.lines.iter().position(|(_, line)| line == words[1]).unwrap(),
                "RET" | "END" => return true,
                "SFTON" => {
                    let (_, by) = self.position(&mut locals, job, words[1]);
                    let frame = if words[2].starts_with("UF") { "USER" } else { "ROBOT" };
                    // How two shifts add, and what a turn does, is some other way.
                    let turn = if by[3..] == [0.0; 3] { 0.0 } else { 7.7 };
                    let more = 0.25 * self.shifts.len() as f64;
                    self.shifts.push((frame.to_owned(), [by[0] + turn + more, by[1], by[2]]));
                }
                "SFTOF" => self.shifts.clear(),
                "WVON" => self.weaves = true,
                "WVOF" => self.weaves = false,
                "IFTHENEXP" if !self.holds(&mut locals, words[1]) => at = partner(at - 1, true) + 1,
                "ELSE" => at = partner(at - 1, false) + 1,
                "WHILE" if !self.holds(&mut locals, words[1]) => at = partner(at - 1, false) + 1,
                "ENDWHILE" => at = opening(at - 1),
                "FOR" => {
                    self.set_number(&mut locals, words[1].strip_suffix("=1").unwrap(), 1);
                    if words[3] < "1" {
                        at = partner(at - 1, false) + 1;
                    }
                }
                "NEXT" => {
                    let begin = opening(at - 1);
                    let next = self.number(&mut locals, words[1]) + 1;
                    self.set_number(&mut locals, words[1], next);
                    let last = job.lines[begin].1.split_whitespace().nth(3).unwrap().parse::<i64>().unwrap();
                    if next <= last {
                        at = begin + 1;
                    }
                }
                _ => {}
            }
        }
        true
    }
}

/// What a motion that was analysed is to become.
struct Wish {
    line: (usize, usize),
    frame: String,
    was: [f64; 3],
    wanted: [f64; 3],
    edited: bool,
    is_circle: bool,
}

fn is_near(a: &[f64; 3], b: &Numbers) -> bool {
    (0..3).all(|i| (a[i] - b[i]).abs() < 1e-6)
}

#[derive(Default)]
struct Seen {
    edited: usize,
    kept: usize,
    moved: usize,
    circles: usize,
}

impl Add for Seen {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            edited: self.edited + other.edited,
            kept: self.kept + other.kept,
            moved: self.moved + other.moved,
            circles: self.circles + other.circles,
        }
    }
}

fn load_all(texts: &[String]) -> (Vec<Job>, BTreeMap<String, (String, Numbers)>) {
    let mut positions = BTreeMap::new();
    let jobs = texts.iter().enumerate().map(|(file, text)| load(file, text, &mut positions)).collect();
    (jobs, positions)
}

fn hold(seed: u64, seen: &mut Seen) {
    let has_odd_circles = seed.is_multiple_of(5);
    let texts = Generator { random: Random(seed), text: String::new(), labels: 0, loops: 0, has_odd_circles }.jobs();
    let mut shown = String::new();
    texts.iter().for_each(|text| writeln!(shown, "{text}").unwrap());
    let sources: Vec<&[u8]> = texts.iter().map(|text| text.as_bytes()).collect();
    let lowered = read(&sources, 3).unwrap_or_else(|fault| panic!("{seed}: {fault:?}\n{shown}"));
    assert_eq!(lowered.not_understood, [], "{seed}\n{shown}");
    let outcome = run(&lowered, &Inform).unwrap_or_else(|_| panic!("{seed}: too long\n{shown}"));
    let edits = editable(&outcome);
    let line_of = |source: u16, at: u32| {
        let file = usize::from(source);
        (file, texts[file][..at as usize].matches('\n').count())
    };
    let (mut wishes, mut wanted, mut by_line) = (Vec::new(), Vec::new(), BTreeSet::new());
    for (motion, edit) in outcome.motions.iter().zip(&edits) {
        let line = line_of(motion.place.source, motion.place.span.start);
        let edited = !matches!(edit, Editable::No(_));
        let is_circle = motion.path == Path::Circular;
        // The point on the way stands in the line before.
        let via = motion.via.iter().map(|via| (via, (line.0, line.1 - 1)));
        let mut texts: Vec<(TokenId, Option<String>)> = Vec::new();
        for (value, line) in via.chain([(&motion.to, line)]) {
            by_line.insert(line);
            let Some(pose) = value.pose() else { continue };
            let was: [f64; 3] = pose.pose().translation.vector.into();
            let frame =
                pose.given.as_ref().expect("a position names its frame").frame.split(' ').next().unwrap().to_owned();
            let mut new = was;
            if edited {
                let key = if seed.is_multiple_of(4) { line.1 as u32 } else { pose.affine(0).map_or(0, |a| a.token.0) };
                let shift = [0.011 + f64::from(key % 7) * 1e-3, -0.02, 0.005];
                for at in 0..3 {
                    new[at] = was[at] + shift[at];
                    let affine = pose.affine(at).expect("an editable number");
                    let own = new[at] - pose.left.translation.vector[at];
                    let value = (own - affine.offset) / affine.scale;
                    let places = if affine.scale > 0.5 { 3 } else { 0 };
                    assert!((affine.scale - 1.0).abs() < 1e-12 || (affine.scale - 1e-3).abs() < 1e-12, "{seed}");
                    texts.push((affine.token, Some(format!("{value:.places$}"))));
                }
                texts.extend((3..6).filter_map(|at| Some((pose.affine(at)?.token, None))));
            }
            wanted.push((wishes.len(), Wish { line, frame, was, wanted: new, edited, is_circle }));
        }
        wishes.push(texts);
    }
    let agreed = agree(&wishes);
    let mut changes: BTreeMap<(u16, u32), (u32, String)> = BTreeMap::new();
    for (at, wish) in &mut wanted {
        wish.edited &= agreed[*at];
        for (token, text) in wishes[*at].iter().filter(|_| wish.edited) {
            let place = lowered.tokens[token.0 as usize];
            if let Some(text) = text {
                changes.insert((place.source, place.span.start), (place.span.end, text.clone()));
            }
        }
        if !wish.edited {
            wish.wanted = wish.was;
        }
        *(if wish.edited { &mut seen.edited } else { &mut seen.kept }) += 1;
        seen.circles += usize::from(wish.edited && wish.is_circle);
    }
    let mut corrected = texts.clone();
    for ((source, start), (end, text)) in changes.iter().rev() {
        corrected[usize::from(*source)].replace_range(*start as usize..*end as usize, text);
    }
    let ((jobs, loaded), (jobs_after, loaded_after)) = (load_all(&texts), load_all(&corrected));
    for input in 0..6 {
        let random = Random(seed ^ (input << 40) ^ 0x5EED);
        let before = Machine::run(&jobs, &loaded, random.clone());
        let after = Machine::run(&jobs_after, &loaded_after, random);
        assert_eq!(before.len(), after.len(), "{seed}/{input}: another path through\n{shown}");
        for (a, b) in before.iter().zip(&after) {
            assert_eq!(a.line, b.line, "{seed}/{input}: another path through\n{shown}");
            assert!(by_line.contains(&a.line), "{seed}/{input}: {:?} runs unseen\n{shown}", a.line);
            let of_line = || wanted.iter().map(|(_, wish)| wish).filter(|wish| wish.line == a.line);
            let is = |wish: &Wish| is_near(&wish.was, &a.to) && wish.frame == a.frame;
            let same = (0..6).all(|i| (a.to[i] - b.to[i]).abs() < 1e-6);
            let moved = of_line().any(|wish| is(wish) && is_near(&wish.wanted, &b.to));
            assert!(
                same && !of_line().any(|wish| wish.edited && is(wish)) || moved,
                "{seed}/{input}: {:?} goes from {:?} to {:?}\n{shown}",
                a.line,
                a.to,
                b.to
            );
            if of_line().any(|wish| wish.edited && wish.is_circle && is(wish)) {
                assert!(
                    a.points.is_none_or(|points| points == 3),
                    "{seed}/{input}: {:?} is no circle of three\n{shown}",
                    a.line
                );
            }
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
    let Seen { edited, kept, moved, circles } = seen;
    assert!(
        edited * 10 > kept && moved > 0 && circles > 0,
        "{edited} edited, {kept} kept, {moved} moved, {circles} on circles"
    );
}
