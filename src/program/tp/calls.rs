//! What programs that are called may change.

use super::expression::{self, Registers};
use super::lines::{sections, statements};
use super::statement::{self, Frame, Kind};
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
    /// Why paths are moved at run time behind it, where they are.
    pub(super) displaces: Option<&'static str>,
    /// Whether something runs beside behind it.
    pub(super) concurrent: bool,
    /// Programs that it calls.
    calls: BTreeSet<String>,
}

impl Called {
    /// A program that is not given: registers and selections may be others behind it. The values of frames and tools are those
    /// of the cell all the same: that is what the cell says of the controller (`docs/soundness.md`).
    pub(super) fn unknown() -> Self {
        Self { all_registers: true, selects: [true; 2], ..Self::default() }
    }

    fn add(&mut self, other: &Self) {
        self.registers.extend(&other.registers);
        self.all_registers |= other.all_registers;
        (0..2).for_each(|i| self.selects[i] |= other.selects[i]);
        self.redefined.extend(&other.redefined);
        self.all_redefined.extend(&other.all_redefined);
        self.displaces = self.displaces.or(other.displaces);
        self.concurrent |= other.concurrent;
    }
}

/// The programs that are given, by name.
#[derive(Debug)]
pub(super) struct Calls {
    known: BTreeMap<String, Called>,
    unknown: Called,
}

impl Calls {
    /// Looks through programs.
    pub(super) fn new<'a>(sources: impl Iterator<Item = &'a Source>) -> Self {
        let own: BTreeMap<String, Called> = sources.filter_map(one).collect();
        let known = own.keys().map(|name| (name.clone(), closure(name, &own))).collect();
        Self { known, unknown: Called::unknown() }
    }

    /// Whether a program is given.
    pub(super) fn knows(&self, name: &[u8]) -> bool {
        self.known.contains_key(&upper(name))
    }

    /// What a call of a program may change.
    pub(super) fn of(&self, name: &[u8]) -> &Called {
        self.known.get(&upper(name)).unwrap_or(&self.unknown)
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
            Some(called) if seen.insert(name) => {
                all.add(called);
                open.extend(called.calls.iter().cloned());
            }
            Some(_) => {}
            None => all.add(&Called::unknown()),
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
    Some((name, called))
}

fn take(kind: &Kind<'_>, called: &mut Called) {
    let none = Registers::new();
    match kind {
        Kind::Register(register, _) | Kind::For(register, ..) => match expression::count(register, &none) {
            Some(register) => drop(called.registers.insert(register)),
            None => called.all_registers = true,
        },
        Kind::Select(frame, _) => called.selects[*frame as usize] = true,
        Kind::Redefine(frame, index) => match expression::count(index, &none) {
            Some(number) => drop(called.redefined.insert((*frame, number))),
            None => drop(called.all_redefined.insert(*frame)),
        },
        Kind::Call(name) => drop(called.calls.insert(upper(name))),
        Kind::Macro | Kind::Unknown => called.add(&Called::unknown()),
        Kind::Concurrent => called.concurrent = true,
        Kind::Motion(motion) => called.concurrent |= motion.runs_others,
        Kind::Displace(why) => called.displaces = Some(why),
        Kind::RedefineAny => {
            called.selects = [true; 2];
            called.all_redefined.extend([Frame::User, Frame::Tool]);
        }
        // What a condition guards is not looked at closer.
        Kind::When(text) | Kind::Case(text) | Kind::ElseCase(text) | Kind::SelectCase(_, text) => {
            let comma = text.iter().rposition(|b| *b == b',').unwrap_or(0);
            match statement::guarded(&text[comma..]) {
                Kind::Plain | Kind::Jump(_) | Kind::End => {}
                Kind::Call(name) if !name.is_empty() => drop(called.calls.insert(upper(name))),
                _ => called.add(&Called::unknown()),
            }
        }
        _ => {}
    }
}
