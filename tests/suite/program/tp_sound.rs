//! Soundness of TP: what may be edited is right in every run.
//!
//! Random programs are run by an interpreter of their own, which knows nothing of how deflex reads: what deflex cannot know
//! (inputs, registers of others, programs that are called) falls as a generator of random numbers says. Whatever run it is,
//! a position that deflex would edit must be gone to as deflex says, and by nothing else.

use deflex::program::{Editable, Goal, Program, Target, Wobj, tp};
use deflex::text::Source;
use proptest::prelude::*;
use proptest::test_runner::{RngAlgorithm, TestRng, TestRunner};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

#[derive(Clone, Debug)]
enum Op {
    Frame(u32),
    Tool(u32),
    FrameOf(u32),
    Set(u32, i32),
    /// Of the register whose number a register holds.
    SetOf(u32, i32),
    Add(u32, i32),
    Take(u32),
    Move(u32),
    Arc(u32),
    MoveTo(u32),
    Offset(u32),
    Increment(u32),
    Read(u32),
    /// Sets a user frame to a position register.
    Redefine(u32, u32),
    /// Sets all elements of a position register: this X, and W = 90 or 0.
    Fill(u32, i32, bool),
    /// Sets one element of a position register.
    Element(u32, u32, i32),
    Call,
    /// Runs a program in parallel to this one.
    Start,
    Label(u32),
    Jump(u32),
    /// To the label whose number a register holds.
    JumpTo(u32),
    JumpIf(u32, i32, u32),
    MayJump(u32),
    If(u32, i32, Vec<Op>, Vec<Op>),
    MayIf(Vec<Op>, Vec<Op>),
    For(u32, i32, i32, bool, Vec<Op>),
    MayFor(u32, Vec<Op>),
    Select(u32, u32, u32),
}

/// A line as the interpreter runs it: its text, and what it does.
#[derive(Clone, Debug)]
enum Does {
    Op(Op),
    /// Goes on at the second where the condition does not hold.
    Branch(Option<(u32, i32)>, usize),
    Goto(usize),
    Enter {
        register: u32,
        from: i32,
        to: Option<i32>,
        down: bool,
        end: usize,
    },
    Again {
        start: usize,
    },
    Case {
        register: u32,
        value: i32,
        to: u32,
    },
}

const FRAMES: u32 = 2;

/// What is recorded in position `p`: user frame 1, 2, the selected one.
fn recorded(p: u32) -> Option<u32> {
    [Some(1), Some(1), Some(2), None][(p as usize - 1) % 4]
}

const POSITIONS: u32 = 4;

fn flatten(ops: &[Op], lines: &mut Vec<(String, Does)>) {
    for op in ops {
        let plain = |text: String| (text, Does::Op(op.clone()));
        let line = match op {
            Op::Frame(n) => plain(format!("UFRAME_NUM={n}")),
            Op::Tool(n) => plain(format!("UTOOL_NUM={n}")),
            Op::FrameOf(r) => plain(format!("UFRAME_NUM=R[{r}:f]")),
            Op::Set(r, v) => plain(format!("R[{r}]={v}")),
            Op::SetOf(r, v) => plain(format!("R[R[{r}]]={v}")),
            Op::Add(r, v) => plain(format!("R[{r}:x]=R[{r}:x]+({v})")),
            Op::Take(r) => plain(format!("R[{r}]=GI[1]")),
            Op::Move(p) => plain(format!("L P[{p}] 10mm/sec FINE")),
            Op::Arc(p) => plain(format!("A P[{p}] 10mm/sec FINE")),
            Op::MoveTo(r) => plain(format!("L P[R[{r}]] 10mm/sec CNT50")),
            Op::Offset(p) => plain(format!("L P[{p}] 10mm/sec FINE Offset,PR[9]")),
            Op::Increment(p) => plain(format!("L P[{p}] 10mm/sec FINE INC")),
            Op::Read(p) => plain(format!("PR[9,1]=P[{p},1]")),
            Op::Redefine(n, pr) => plain(format!("UFRAME[{n}]=PR[{pr}]")),
            Op::Fill(pr, x, turned) => {
                for (element, value) in (1..).zip([*x, 2, 3, 90 * i32::from(*turned), 0, 0]) {
                    let text = format!("PR[{pr},{element}]={value}");
                    lines.push((text, Does::Op(Op::Element(*pr, element, value))));
                }
                continue;
            }
            Op::Element(pr, element, value) => plain(format!("PR[{pr},{element}:e]=({value})")),
            Op::Call => plain("CALL OTHER(1,2)".into()),
            Op::Start => plain("RUN WATCH".into()),
            Op::Label(l) => plain(format!("LBL[{l}:here]")),
            Op::Jump(l) => plain(format!("JMP LBL[{l}]")),
            Op::JumpTo(r) => plain(format!("JMP LBL[R[{r}:l]]")),
            Op::JumpIf(r, v, l) => plain(format!("IF R[{r}]={v},JMP LBL[{l}]")),
            Op::MayJump(l) => plain(format!("IF DI[1]=ON,JMP LBL[{l}]")),
            Op::If(..) | Op::MayIf(..) => {
                let (known, yes, no) = match op {
                    Op::If(r, v, yes, no) => (Some((*r, *v)), yes, no),
                    Op::MayIf(yes, no) => (None, yes, no),
                    _ => unreachable!(),
                };
                let condition = known.map_or("DI[2]=ON".into(), |(r, v)| format!("R[{r}]={v}"));
                let start = lines.len();
                lines.push((format!("IF ({condition}) THEN"), Does::Branch(known, 0)));
                flatten(yes, lines);
                let middle = lines.len();
                lines.push(("ELSE".into(), Does::Goto(0)));
                flatten(no, lines);
                let end = lines.len();
                lines.push(("ENDIF".into(), Does::Goto(end + 1)));
                lines[start].1 = Does::Branch(known, middle + 1);
                lines[middle].1 = Does::Goto(end);
                continue;
            }
            Op::For(..) | Op::MayFor(..) => {
                let (register, from, to, down, body) = match op {
                    Op::For(r, from, to, down, body) => (*r, *from, Some(*to), *down, body),
                    Op::MayFor(r, body) => (*r, 1, None, false, body),
                    _ => unreachable!(),
                };
                let start = lines.len();
                let word = if down { "DOWNTO" } else { "TO" };
                let last = to.map_or("R[9]".into(), |to| format!("({to})"));
                lines.push((format!("FOR R[{register}:i]=({from}) {word} {last}"), Does::Goto(0)));
                flatten(body, lines);
                let end = lines.len();
                lines.push(("ENDFOR".into(), Does::Again { start }));
                lines[start].1 = Does::Enter { register, from, to, down, end };
                continue;
            }
            Op::Select(r, one, other) => {
                lines
                    .push((format!("SELECT R[{r}]=1,JMP LBL[{one}]"), Does::Case { register: *r, value: 1, to: *one }));
                (format!("       =2,JMP LBL[{other}]"), Does::Case { register: *r, value: 2, to: *other })
            }
        };
        lines.push(line);
    }
}

fn text(lines: &[(String, Does)]) -> String {
    let mut out = "/PROG  M\n/ATTR\n/MN\n".to_owned();
    for (i, (line, _)) in lines.iter().enumerate() {
        let _ = writeln!(out, "{:4}:{line} ;", i + 1);
    }
    out += "/POS\n";
    for p in 1..=POSITIONS {
        let uf = recorded(p).map_or("F".into(), |uf| uf.to_string());
        let _ = writeln!(
            out,
            "P[{p}]{{ GP1: UF : {uf}, UT : 1, CONFIG : 'N U T, 0, 0, 0', X = {p}.000 mm, Y = 0.000 mm, Z = 0.000 mm, W = 0.000 deg, P = 0.000 deg, R = 0.000 deg }};"
        );
    }
    out + "/END\n"
}

/// What the interpreter saw: the line, the position, the user frame in force, and what the robot stood at before.
#[derive(Debug)]
struct Seen {
    line: usize,
    position: u32,
    frame: u32,
    plain: bool,
    /// The values of the user frame, if the program has set it.
    redefined: Option<[i32; 6]>,
    before: Option<(usize, u32)>,
    increment: bool,
}

struct Machine<'a> {
    lines: &'a [(String, Does)],
    random: u64,
    registers: [i32; 10],
    frame: u32,
    tool: u32,
    redefined: BTreeMap<u32, [i32; 6]>,
    position_registers: [[i32; 6]; 3],
    concurrent: bool,
    last: [Option<i32>; 64],
    seen: Vec<Seen>,
}

impl Machine<'_> {
    fn random(&mut self, below: u64) -> u64 {
        // Xorshift (Marsaglia 2003).
        self.random ^= self.random << 13;
        self.random ^= self.random >> 7;
        self.random ^= self.random << 17;
        self.random % below
    }

    fn label(&self, wanted: u32) -> Option<usize> {
        self.lines.iter().position(|(_, does)| matches!(does, Does::Op(Op::Label(l)) if *l == wanted))
    }

    /// What another program may do at any moment.
    fn others(&mut self) {
        for r in 1..5 {
            self.registers[r] = self.random(5) as i32;
        }
        for at in 0..18 {
            self.position_registers[at / 6][at % 6] = self.random(5) as i32;
        }
        self.frame = 1 + self.random(u64::from(FRAMES)) as u32;
    }

    fn run(&mut self) {
        let (mut at, mut steps, mut before) = (0, 0, None);
        while at < self.lines.len() && steps < 400 {
            steps += 1;
            if self.concurrent && self.random(3) == 0 {
                self.others();
            }
            let mut next = Some(at + 1);
            match self.lines[at].1.clone() {
                Does::Op(op) => match op {
                    Op::Frame(n) => self.frame = n,
                    Op::Tool(n) => self.tool = n,
                    Op::FrameOf(r) => match u32::try_from(self.registers[r as usize]) {
                        Ok(n) => self.frame = n,
                        Err(_) => return,
                    },
                    Op::Set(r, v) => self.registers[r as usize] = v,
                    Op::SetOf(r, v) => match usize::try_from(self.registers[r as usize]) {
                        Ok(r) if r < self.registers.len() => self.registers[r] = v,
                        _ => return,
                    },
                    Op::Add(r, v) => self.registers[r as usize] += v,
                    Op::Take(r) => self.registers[r as usize] = self.random(5) as i32,
                    Op::Move(p) | Op::Arc(p) | Op::Offset(p) | Op::Increment(p) => {
                        let moved = self.moves(at, p, &op, &mut before);
                        if !moved {
                            return;
                        }
                    }
                    Op::MoveTo(r) => {
                        let p = u32::try_from(self.registers[r as usize]).unwrap_or(0);
                        let there = (1..=POSITIONS).contains(&p);
                        if !there || !self.moves(at, p, &Op::Move(p), &mut before) {
                            return;
                        }
                    }
                    Op::Redefine(n, pr) => drop(self.redefined.insert(n, self.position_registers[pr as usize])),
                    Op::Element(pr, element, value) => {
                        self.position_registers[pr as usize][element as usize - 1] = value;
                    }
                    Op::Call => self.others(),
                    Op::Start => self.concurrent = true,
                    Op::Jump(l) => next = self.label(l),
                    Op::JumpTo(r) => {
                        let number = u32::try_from(self.registers[r as usize]);
                        next = number.ok().and_then(|number| self.label(number));
                    }
                    Op::JumpIf(r, v, l) if self.registers[r as usize] == v => next = self.label(l),
                    Op::MayJump(l) if self.random(2) == 0 => next = self.label(l),
                    _ => {}
                },
                Does::Branch(known, no) => {
                    let holds = match known {
                        Some((r, v)) => self.registers[r as usize] == v,
                        None => self.random(2) == 0,
                    };
                    next = Some(if holds { at + 1 } else { no });
                }
                Does::Goto(to) => next = Some(to),
                Does::Enter { register, from, to, down, end } => {
                    let to = to.unwrap_or_else(|| self.random(4) as i32);
                    self.registers[register as usize] = from;
                    self.last[at] = Some(to);
                    let enters = if down { from >= to } else { from <= to };
                    next = Some(if enters { at + 1 } else { end + 1 });
                }
                Does::Again { start } => {
                    let Does::Enter { register, to, down, .. } = self.lines[start].1.clone() else { unreachable!() };
                    // Jumped into: the bound is what stands there.
                    let Some(to) = self.last[start].or(to) else { return };
                    let counter = self.registers[register as usize] + if down { -1 } else { 1 };
                    let enters = if down { counter >= to } else { counter <= to };
                    // The manuals do not say which value the counter has after the loop.
                    self.registers[register as usize] = if enters { counter } else { self.random(5) as i32 };
                    next = Some(if enters { start + 1 } else { at + 1 });
                }
                Does::Case { register, value, to } => {
                    if self.registers[register as usize] == value {
                        next = self.label(to);
                    }
                }
            }
            let Some(next) = next else { return };
            at = next;
        }
    }

    /// A motion; false where the controller refuses it.
    fn moves(&mut self, at: usize, position: u32, op: &Op, before: &mut Option<(usize, u32)>) -> bool {
        if self.tool != 1 || recorded(position).is_some_and(|own| own != self.frame) {
            return false;
        }
        self.seen.push(Seen {
            line: at,
            position,
            frame: self.frame,
            plain: matches!(op, Op::Move(_) | Op::Arc(_)),
            redefined: self.redefined.get(&self.frame).copied(),
            before: *before,
            increment: matches!(op, Op::Increment(_)),
        });
        *before = Some((at, position));
        true
    }
}

/// Positions that would be edited, by number, if every motion cuts: one that is moved at run time then holds its position.
fn edited(program: &Program) -> BTreeSet<u32> {
    let number = |x: f64| x as u32;
    let of = |goal: &Goal| match goal {
        Goal::Pose { position_mm, .. } => number(position_mm[0]),
        _ => 0,
    };
    let held: BTreeSet<u32> = program.targets.iter().filter(|t| !t.located).map(|t| of(&t.goal)).collect();
    let is_edited = |t: &&Target| t.is_end() && t.editable == Editable::Pose && !held.contains(&of(&t.goal));
    program.targets.iter().filter(is_edited).map(|t| of(&t.goal)).collect()
}

fn judge(lines: &[(String, Does)], seed: u64) -> Result<usize, TestCaseError> {
    let text = text(lines);
    let program = tp::read(vec![Source::new("m.ls", text.as_bytes())], Vec::new()).unwrap();
    let edited = edited(&program);
    for (_, does) in lines {
        if let Does::Op(Op::Read(p)) = does {
            prop_assert!(!edited.contains(p), "P[{p}] is read elsewhere\n{text}");
        }
    }
    // Arcs that run: three `A` or more, edited all together or not at all.
    let arc = |at: &usize| if let Does::Op(Op::Arc(p)) = &lines[*at].1 { Some(*p) } else { None };
    let all: Vec<usize> = (0..lines.len()).collect();
    for row in all.chunk_by(|a, b| arc(a).is_some() && arc(b).is_some()) {
        let runs = program.targets.iter().any(|target| row.iter().any(|at| target.line as usize == at + 4));
        let points: Vec<u32> = row.iter().filter_map(arc).collect();
        let held = points.iter().filter(|p| edited.contains(p)).count();
        prop_assert!(!runs || held == 0 || held == points.len() && held >= 3, "{points:?} {edited:?}\n{text}");
    }
    for run in 0..20 {
        let random = (seed ^ (run + 1_u64).wrapping_mul(0x9E37_79B9_7F4A_7C15)) | 1;
        let mut machine = Machine {
            lines,
            random,
            registers: [0; 10],
            frame: 1,
            tool: 1,
            redefined: BTreeMap::new(),
            position_registers: [[0; 6]; 3],
            concurrent: false,
            last: [None; 64],
            seen: Vec::new(),
        };
        for r in 0..10 {
            machine.registers[r] = machine.random(5) as i32;
        }
        machine.frame = 1 + machine.random(u64::from(FRAMES)) as u32;
        for at in 0..18 {
            machine.position_registers[at / 6][at % 6] = machine.random(5) as i32;
        }
        machine.run();
        // The next cycle begins with the frames that this one leaves.
        machine.concurrent = false;
        machine.run();
        for seen in &machine.seen {
            if edited.contains(&seen.position) {
                prop_assert!(seen.plain, "{seen:?}\n{text}");
                let said = program.targets.iter().filter(|target| {
                    target.line as usize == seen.line + 4
                        && target.name.as_deref() == Some(&format!("P[{}]", seen.position))
                });
                let wobjs: Vec<&Wobj> = said.map(|target| &program.wobjs[target.wobj as usize]).collect();
                prop_assert!(!wobjs.is_empty(), "no target for {seen:?}\n{text}");
                let wanted = format!("UF {}", seen.frame);
                let is_so = |wobj: &Wobj| match (seen.redefined, &wobj.data) {
                    (None, None) => true,
                    (Some([x, y, z, w, 0, 0]), Some(data)) => {
                        let half = f64::from(w).to_radians() / 2.0;
                        let turn = [half.cos(), half.sin(), 0.0, 0.0];
                        let numbers = data.uframe_mm.iter().chain(&data.uframe_quat);
                        let wanted = [x, y, z].map(f64::from).into_iter().chain(turn);
                        numbers.zip(wanted).all(|(number, wanted)| (number - wanted).abs() < 1e-9)
                    }
                    _ => false,
                };
                prop_assert!(
                    wobjs.iter().any(|wobj| *wobj.name == *wanted && is_so(wobj)),
                    "{seen:?} {wobjs:?}\n{text}"
                );
            }
            if let (true, Some((_, position))) = (seen.increment, seen.before) {
                prop_assert!(!edited.contains(&position), "counted on from P[{position}]\n{text}");
            }
        }
    }
    Ok(edited.len())
}

fn op() -> impl Strategy<Value = Op> {
    let (p, r, l, f) = (1..=POSITIONS, 1..4_u32, 1..4_u32, 1..=FRAMES);
    let leaf = prop_oneof![
        6 => p.clone().prop_map(Op::Move),
        4 => p.clone().prop_map(Op::Arc),
        2 => f.clone().prop_map(Op::Frame),
        1 => (1..3_u32).prop_map(Op::Tool),
        1 => r.clone().prop_map(Op::FrameOf),
        2 => (r.clone(), 0..4).prop_map(|(r, v)| Op::Set(r, v)),
        1 => (r.clone(), 0..4).prop_map(|(r, v)| Op::SetOf(r, v)),
        2 => (r.clone(), -1..2).prop_map(|(r, v)| Op::Add(r, v)),
        1 => r.clone().prop_map(Op::Take),
        1 => r.clone().prop_map(Op::MoveTo),
        1 => p.clone().prop_map(Op::Offset),
        1 => p.clone().prop_map(Op::Increment),
        1 => p.prop_map(Op::Read),
        1 => (f, 1..3_u32).prop_map(|(n, pr)| Op::Redefine(n, pr)),
        2 => (1..3_u32, 1..3, any::<bool>()).prop_map(|(pr, x, turned)| Op::Fill(pr, x, turned)),
        1 => (1..3_u32, 1..4_u32, 0..4).prop_map(|(pr, element, value)| Op::Element(pr, element, value)),
        1 => Just(Op::Call),
        1 => Just(Op::Start),
        2 => l.clone().prop_map(Op::Label),
        1 => l.clone().prop_map(Op::Jump),
        1 => r.clone().prop_map(Op::JumpTo),
        1 => (r.clone(), 0..4, l.clone()).prop_map(|(r, v, l)| Op::JumpIf(r, v, l)),
        1 => l.clone().prop_map(Op::MayJump),
        1 => (r, l.clone(), l).prop_map(|(r, a, b)| Op::Select(r, a, b)),
    ];
    leaf.prop_recursive(2, 12, 4, |inner| {
        let some = || prop::collection::vec(inner.clone(), 0..4);
        prop_oneof![
            (1..4_u32, 0..4, some(), some()).prop_map(|(r, v, a, b)| Op::If(r, v, a, b)),
            (some(), some()).prop_map(|(a, b)| Op::MayIf(a, b)),
            (1..4_u32, 0..4, 0..4, any::<bool>(), some())
                .prop_map(|(r, a, b, down, body)| Op::For(r, a, b, down, body)),
            (1..4_u32, some()).prop_map(|(r, body)| Op::MayFor(r, body)),
        ]
    })
}

/// More of them with `DEFLEX_TP_PROGRAMS`; `DEFLEX_TP_FIRST` is the first seed.
#[test]
fn what_is_edited_is_right_in_every_run() {
    let number = |name: &str, default: u64| {
        std::env::var(name).map_or(default, |text| text.parse().unwrap_or_else(|_| panic!("{name} is no number")))
    };
    let (count, first) = (number("DEFLEX_TP_PROGRAMS", 600), number("DEFLEX_TP_FIRST", 0));
    let programs = prop::collection::vec(op(), 1..9);
    let edited = std::cell::Cell::new(0);
    for seed in first..first + count {
        let mut bytes = [0; 32];
        bytes[..8].copy_from_slice(&seed.to_le_bytes());
        let config = ProptestConfig { failure_persistence: None, ..ProptestConfig::default() };
        let mut runner = TestRunner::new_with_rng(config, TestRng::from_seed(RngAlgorithm::ChaCha, &bytes));
        let tree = programs.new_tree(&mut runner).unwrap();
        let judged = runner.run_one(tree, |ops| {
            let mut lines = Vec::new();
            flatten(&ops, &mut lines);
            prop_assume!(lines.len() < 64);
            edited.set(edited.get() + usize::from(judge(&lines, seed)? > 0));
            Ok(())
        });
        judged.unwrap_or_else(|why| panic!("{seed}: {why}"));
    }
    // Leaving everything alone is no answer. Where a program begins with an increment, its last position is kept too.
    assert!(edited.get() as u64 * 5 > count, "only {} of {count} have a position that may be edited", edited.get());
}

fn reads(statements: &str) -> Program {
    let numbered: String = statements.lines().enumerate().map(|(i, line)| format!("{:4}:{line} ;\n", i + 1)).collect();
    let positions = text(&[]);
    let positions = positions.split("/MN\n").nth(1).unwrap();
    let text = format!("/PROG  M\n/ATTR\n/MN\n{numbered}{positions}");
    tp::read(vec![Source::new("m.ls", text.as_bytes())], Vec::new()).unwrap()
}

/// What is edited (+), what is not and why; then motions without a target.
fn said(statements: &str) -> String {
    let program = reads(statements);
    let mut out: Vec<String> = program
        .targets
        .iter()
        .map(|target| match target.editable {
            Editable::Pose => "+".to_owned(),
            Editable::No(why) => why.to_string(),
            Editable::Position => unreachable!(),
        })
        .collect();
    out.extend(
        program
            .kept
            .iter()
            .filter(|kept| program.targets.iter().all(|t| t.span != kept.span))
            .map(|kept| kept.reason.to_string()),
    );
    out.join("; ")
}

#[test]
fn hand_made_cases() {
    const FINE: &str = "mm/sec FINE";
    for (statements, expected) in [
        // The number recorded in the position is the frame: a program that is called may have selected it or not.
        (format!("CALL X\nL P[1] 5{FINE}"), "+"),
        (format!("UFRAME_NUM=2\nL P[1] 5{FINE}"), "recorded in another user frame than is selected"),
        (format!("L P[4] 5{FINE}"), "user frame selected at run time"),
        (format!("UFRAME_NUM=1\nL P[4] 5{FINE}"), "+"),
        (format!("UFRAME_NUM=1\nCALL X\nL P[4] 5{FINE}"), "user frame selected at run time"),
        (format!("UFRAME_NUM=1\nIF DI[1]=ON,CALL X\nL P[4] 5{FINE}"), "user frame selected at run time"),
        (format!("UFRAME[1]=PR[3]\nL P[1] 5{FINE}"), "user frame whose values a program sets"),
        (format!("L P[1] 5{FINE}\nL P[1] 5{FINE} Offset,PR[1]"), "+; moved by a position register (Offset)"),
        (
            format!("L P[1] 5{FINE}\nL P[2] 5{FINE} INC"),
            "an incremental motion is counted from it; incremental motion (INC)",
        ),
        (
            format!("L P[1] 5{FINE}\nL P[R[1]] 5{FINE}"),
            "a motion whose target is known only at run time may go there; position known only at run time",
        ),
        (format!("FOR R[1]=1 TO 2\nL P[R[1]] 5{FINE}\nENDFOR"), "+; +"),
        (format!("R[1]=1\nLBL[1]\nL P[R[1]] 5{FINE}\nR[1]=R[1]+1\nIF R[1]<3,JMP LBL[1]"), "+; +"),
        (
            format!("! deflex air\nIF DI[1]=ON,JMP LBL[1]\n! deflex cut\nLBL[1]\nL P[1] 5{FINE}"),
            "whether this motion cuts is known only at run time",
        ),
        (format!("PR[1]=P[1]\nR[1]=PR[1,1]\nL P[1] 5{FINE}"), "position that another instruction reads or changes"),
        (format!("JMP LBL[1]\nL P[1] 5{FINE}\nLBL[1]\nL P[2] 5{FINE}"), "+; motion that nothing reaches"),
        (format!("L P[7] 5{FINE}"), "position that is not in /POS"),
        (format!("TRACK TAST[1]\nL P[1] 5{FINE}"), "path is moved at run time (tracking)"),
        (format!("UFRAME_NUM=1\nMONITOR W\nUFRAME_NUM=1\nL P[4] 5{FINE}"), "user frame selected at run time"),
        (format!("A P[1] 5{FINE}"), "fewer than three circle arc motions (A) in a row"),
    ] {
        assert_eq!(said(&statements), expected, "{statements}");
    }
}

#[test]
fn programs_that_are_given_change_what_they_change() {
    let main = "/PROG MAIN\n/MN\n1:UFRAME_NUM=1 ;\n2:CALL SUB ;\n3:L P[1] 5mm/sec FINE ;\n/POS\nP[1]{ GP1: UF : F, UT : 1, X = 1 mm, Y = 0 mm, Z = 0 mm, W = 0 deg, P = 0 deg, R = 0 deg };\n/END\n";
    let with = |statement: &str| {
        let sub = format!("/PROG SUB\n/MN\n1:{statement} ;\n/POS\n/END\n");
        let context = vec![Source::new("sub.ls", sub.as_bytes())];
        tp::read(vec![Source::new("main.ls", main.as_bytes())], context).unwrap()
    };
    let harmless = with("DO[1]=ON");
    assert_eq!((harmless.targets[0].editable, harmless.diagnostics.len()), (Editable::Pose, 0));
    let selected = with("UFRAME_NUM=2");
    assert_eq!(&*selected.wobjs[usize::from(selected.targets[0].wobj)].name, "UF 2");
    assert!(with("UFRAME_NUM=R[1]").targets.is_empty());
    assert!(with("UFRAME[1]=PR[1]").targets.is_empty());
    assert!(with("CALL OTHER").targets.is_empty());
    let alone = tp::read(vec![Source::new("main.ls", main.as_bytes())], Vec::new()).unwrap();
    assert!(alone.targets.is_empty() && alone.diagnostics[0].message.contains("SUB"), "{:?}", alone.diagnostics);
}
