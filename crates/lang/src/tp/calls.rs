//! What programs that are called may do.

use super::code::Code;
use super::expression;
use super::lines::{sections, statements};
use super::lower::counts_from_its_start;
use super::statement::{self, Frame, StatementKind};
use crate::reason::Reason;
use std::collections::{BTreeMap, BTreeSet};

/// Something that a program may do, in whatever order its statements run. Numbers are `None` where only a run knows them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Effect {
    /// Gives a register a value.
    Register(Option<u32>),
    /// Selects a user frame or a tool.
    Select(Frame),
    /// Sets the values of a user frame or a tool.
    Redefine(Frame, Option<u32>),
    /// Moves paths at run time from here on.
    Displace(Reason),
    /// Runs something in parallel from here on.
    Concurrent,
    /// Moves the arm.
    Moves,
    /// Counts from where the arm stands when it begins.
    Counts,
}

type Effects = BTreeSet<Effect>;

/// Those of a program that is not given. The values of frames and tools are those of the cell all the same: that is what the cell says
/// of the controller (`docs/soundness.md`).
const NOT_GIVEN: [Effect; 4] =
    [Effect::Register(None), Effect::Select(Frame::User), Effect::Select(Frame::Tool), Effect::Moves];

/// The programs that are given, by name.
#[derive(Clone, Debug, Default)]
pub struct Calls {
    given: BTreeMap<String, Effects>,
}

impl Calls {
    /// Looks through the texts of programs.
    #[must_use]
    pub fn new<'a>(sources: impl IntoIterator<Item = &'a [u8]>) -> Self {
        let own: BTreeMap<String, Own> = sources.into_iter().filter_map(one).collect();
        Self { given: own.keys().map(|name| (name.clone(), closure(name, &own))).collect() }
    }

    /// Whether a program is given.
    #[must_use]
    pub fn knows(&self, name: &[u8]) -> bool {
        self.given.contains_key(&upper(name))
    }

    /// Whether any of them counts from where the arm stands when it begins.
    pub(super) fn may_count(&self) -> bool {
        self.given.values().any(|effects| effects.contains(&Effect::Counts))
    }

    /// What a call of a program may do; of any where it has no name.
    pub(super) fn of(&self, name: &[u8]) -> Effects {
        match self.given.get(&upper(name)) {
            Some(effects) => effects.clone(),
            None if name.is_empty() => self.given.values().flatten().copied().chain(NOT_GIVEN).collect(),
            None => NOT_GIVEN.into(),
        }
    }

    /// What a statement may do, with the programs that it runs.
    pub(super) fn of_statement(&self, kind: &StatementKind<'_>) -> Effects {
        let called = statement::runs(kind).into_iter().flat_map(|name| self.of(name));
        effects(kind).into_iter().chain(called).collect()
    }
}

/// What a program does itself, and the programs that it calls.
#[derive(Default)]
struct Own {
    effects: Effects,
    calls: BTreeSet<String>,
}

fn upper(name: &[u8]) -> String {
    String::from_utf8_lossy(name).to_ascii_uppercase()
}

/// With all that it calls, and that these call.
fn closure(name: &str, own: &BTreeMap<String, Own>) -> Effects {
    let (mut all, mut seen, mut open) = (Effects::new(), BTreeSet::new(), vec![name]);
    while let Some(name) = open.pop() {
        match own.get(name) {
            Some(program) if seen.insert(name) => {
                all.extend(&program.effects);
                open.extend(program.calls.iter().map(String::as_str));
            }
            Some(_) => {}
            None => {
                all.extend(NOT_GIVEN);
                if name.is_empty() && seen.insert(name) {
                    open.extend(own.keys().map(String::as_str));
                }
            }
        }
    }
    all
}

/// What the statements of a program do.
fn one(bytes: &[u8]) -> Option<(String, Own)> {
    let sections = sections(bytes);
    let name = upper(&bytes[sections.name?.range()]);
    let lines = statements(bytes, sections.statements?);
    let kinds: Vec<StatementKind<'_>> = lines.iter().map(statement::kind).collect();
    let mut own = Own::default();
    for kind in &kinds {
        own.effects.extend(effects(kind));
        own.calls.extend(statement::runs(kind).into_iter().map(upper));
    }
    let counts = |kind: &StatementKind<'_>| matches!(kind, StatementKind::Motion(motion) if motion.counts_on());
    if kinds.iter().any(counts) && counts_from_its_start(&Code::new(&lines)) {
        own.effects.insert(Effect::Counts);
    }
    Some((name, own))
}

/// What a statement does itself.
fn effects(kind: &StatementKind<'_>) -> Vec<Effect> {
    match kind {
        StatementKind::Register(register, _) | StatementKind::For(register, ..) => {
            vec![Effect::Register(expression::count(register))]
        }
        StatementKind::Select(frame, _) => vec![Effect::Select(*frame)],
        StatementKind::Redefine(frame, index) => vec![Effect::Redefine(*frame, expression::count(index))],
        StatementKind::RedefineAny => {
            let of = |frame| [Effect::Select(frame), Effect::Redefine(frame, None)];
            [Frame::User, Frame::Tool].into_iter().flat_map(of).collect()
        }
        StatementKind::Macro | StatementKind::Unknown => NOT_GIVEN.into(),
        StatementKind::Concurrent(_) => vec![Effect::Concurrent],
        StatementKind::Motion(motion) => {
            let concurrent = motion.runs_others.then_some(Effect::Concurrent);
            concurrent.into_iter().chain([Effect::Moves]).collect()
        }
        StatementKind::Displace(why) => vec![Effect::Displace(*why)],
        _ => statement::guarded_by(kind).map_or_else(Vec::new, |guarded| effects(&guarded)),
    }
}
