//! What programs that are called may change.

use super::expression::{self, Registers};
use super::flow::Flow;
use super::lines::{Line, sections, statements};
use super::run;
use super::statement::{self, Frame, StatementKind};
use crate::program::Reason;
use crate::text::Source;
use std::collections::{BTreeMap, BTreeSet};

/// What a call may change.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Called {
    /// Registers.
    pub(super) registers: BTreeSet<u32>,
    /// Any register.
    pub(super) all_registers: bool,
    /// Which user frame, which tool is selected.
    pub(super) selects: [bool; 2],
    /// Values of frames.
    pub(super) redefined: BTreeSet<(Frame, u32)>,
    /// Values of any frame.
    pub(super) all_redefined: BTreeSet<Frame>,
    /// Why paths are moved at run time after it, where they are.
    pub(super) displaces: Option<Reason>,
    /// Whether something runs in parallel after it.
    pub(super) concurrent: bool,
    /// Whether it may move the robot.
    pub(super) moves: bool,
    /// Whether a motion of it may count from where the robot stands when it is called.
    pub(super) increments: bool,
    /// Programs that it calls.
    calls: BTreeSet<String>,
}

impl Called {
    /// A program that is not given: registers and selections may be others after it. The values of frames and tools are those
    /// of the cell all the same: that is what the cell says of the controller (`docs/soundness.md`).
    pub(super) fn unknown() -> Self {
        Self { all_registers: true, selects: [true; 2], moves: true, ..Self::default() }
    }

    fn add(&mut self, other: &Self) {
        self.registers.extend(&other.registers);
        self.all_registers |= other.all_registers;
        (0..2).for_each(|i| self.selects[i] |= other.selects[i]);
        self.redefined.extend(&other.redefined);
        self.all_redefined.extend(&other.all_redefined);
        self.displaces = self.displaces.or(other.displaces);
        self.concurrent |= other.concurrent;
        self.moves |= other.moves;
        self.increments |= other.increments;
    }
}

/// The programs that are given, by name.
#[derive(Debug, Default)]
pub(super) struct Calls {
    known: BTreeMap<String, Called>,
    /// Any of them, or another.
    any: Called,
    unknown: Called,
}

impl Calls {
    /// Looks through programs.
    pub(super) fn new<'a>(sources: impl Iterator<Item = &'a Source>) -> Self {
        let own: BTreeMap<String, Called> = sources.filter_map(one).collect();
        let known: BTreeMap<String, Called> = own.keys().map(|name| (name.clone(), closure(name, &own))).collect();
        let mut any = Called::unknown();
        known.values().for_each(|called| any.add(called));
        Self { known, any, unknown: Called::unknown() }
    }

    /// Whether a program is given.
    pub(super) fn knows(&self, name: &[u8]) -> bool {
        self.known.contains_key(&upper(name))
    }

    /// What a call of a program may change; of any where it has no name.
    pub(super) fn of(&self, name: &[u8]) -> &Called {
        let other = if name.is_empty() { &self.any } else { &self.unknown };
        self.known.get(&upper(name)).unwrap_or(other)
    }

    /// Adds what a statement may change, and what the programs may that it runs.
    pub(super) fn take(&self, kind: &StatementKind<'_>, called: &mut Called) {
        take(kind, called);
        statement::runs(kind).into_iter().for_each(|name| called.add(self.of(name)));
    }
}

fn upper(name: &[u8]) -> String {
    String::from_utf8_lossy(name).to_ascii_uppercase()
}

/// With all that it calls, and that these call.
fn closure(name: &str, own: &BTreeMap<String, Called>) -> Called {
    let (mut all, mut seen, mut open) = (Called::default(), BTreeSet::new(), vec![name.to_owned()]);
    while let Some(name) = open.pop() {
        match own.get(&name) {
            Some(called) if seen.insert(name.clone()) => {
                all.add(called);
                open.extend(called.calls.iter().cloned());
            }
            Some(_) => {}
            None => {
                all.add(&Called::unknown());
                if name.is_empty() && seen.insert(name) {
                    open.extend(own.keys().cloned());
                }
            }
        }
    }
    all
}

/// What the statements of a program change, in whatever order they run.
fn one(source: &Source) -> Option<(String, Called)> {
    let sections = sections(&source.bytes);
    let name = upper(source.slice(sections.name?));
    let lines = statements(&source.bytes, sections.statements?);
    let mut called = Called::default();
    for line in &lines {
        take(&statement::kind(line), &mut called);
    }
    called.increments = increments(&lines);
    Some((name, called))
}

/// Whether a program counts from where the robot stands when it begins: no other motion comes before on some way.
fn increments(lines: &[Line<'_>]) -> bool {
    // Those that it calls are looked at apart; whether they move the robot makes no difference to those that do not.
    let (none, at_start) = (Calls::default(), usize::MAX);
    let mut flow = Flow::new(lines, &none, None);
    flow.start.standing.insert(at_start);
    let counts =
        |at: usize| matches!(&flow.kinds[at], StatementKind::Motion(motion) if motion.moved == Some(Reason::Increment));
    run::run(&flow).iter().any(|(at, state)| counts(*at) && state.standing.contains(&at_start))
}

fn take(kind: &StatementKind<'_>, called: &mut Called) {
    let none = Registers::new();
    for name in statement::runs(kind) {
        called.calls.insert(upper(name));
    }
    match kind {
        StatementKind::Register(register, _) | StatementKind::For(register, ..) => {
            match expression::count(register, &none) {
                Some(register) => drop(called.registers.insert(register)),
                None => called.all_registers = true,
            }
        }
        StatementKind::Select(frame, _) => called.selects[*frame as usize] = true,
        StatementKind::Redefine(frame, index) => match expression::count(index, &none) {
            Some(number) => drop(called.redefined.insert((*frame, number))),
            None => drop(called.all_redefined.insert(*frame)),
        },
        StatementKind::Macro | StatementKind::Unknown => called.add(&Called::unknown()),
        StatementKind::Concurrent(_) => called.concurrent = true,
        StatementKind::Motion(motion) => {
            called.concurrent |= motion.runs_others;
            called.moves = true;
        }
        StatementKind::Displace(why) => called.displaces = Some(*why),
        StatementKind::RedefineAny => {
            called.selects = [true; 2];
            called.all_redefined.extend([Frame::User, Frame::Tool]);
        }
        _ => {
            if let Some(guarded) = statement::guarded_by(kind) {
                take(&guarded, called);
            }
        }
    }
}
