//! The possible effects of statements, and of the programs that they call, in any order.

use super::expression;
use super::lines::Line;
use super::statement::{self, Frame, StatementKind, Whole};
use crate::reason::Reason;
use std::collections::{BTreeMap, BTreeSet};

/// A possible effect of a program. Numbers are `None` if they are known only at run time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Effect {
    /// Gives a register a value.
    Register(Option<u32>),
    /// Selects a user frame or a tool.
    Select(Frame),
    /// Sets the values of a user frame or a tool.
    Redefine(Frame, Option<u32>),
    /// Sets elements of a position register.
    Elements(Option<u32>),
    /// Does something that depends on a position register.
    Uses(Option<u32>),
    /// Gives a position register axis angles, perhaps.
    Axes(Option<u32>),
    /// Sets the speed override.
    Override,
    /// Shifts paths at run time from here on.
    Displace(Reason),
    /// Runs something in parallel from here on.
    Concurrent,
    /// Moves the arm.
    Moves,
    /// Moves relative to where the arm stands when it begins.
    Counts,
}

pub(super) type Effects = BTreeSet<Effect>;

/// The effects of a program that is not given. It changes neither the speed override nor the values of frames and tools, because those of the
/// cell are what the controller has (`docs/soundness.md`).
pub(super) const NOT_GIVEN: [Effect; 6] = [
    Effect::Register(None),
    Effect::Elements(None),
    Effect::Uses(None),
    Effect::Select(Frame::User),
    Effect::Select(Frame::Tool),
    Effect::Moves,
];

/// The programs that are given, by name.
///
/// # Examples
/// ```
/// use deflex_lang::tp::Calls;
///
/// let calls = Calls::new([&b"/PROG OPEN\n/MN\n   1:DO[1]=ON ;\n/POS\n/END\n"[..]]);
/// assert!(calls.knows(b"OPEN") && !calls.knows(b"CLOSE"));
/// ```
#[derive(Clone, Debug, Default)]
pub struct Calls {
    pub(super) given: BTreeMap<String, Effects>,
    /// The statements of programs that only set registers, frames and tools, one after the other.
    pub(super) straight: BTreeMap<String, Vec<Line<'static>>>,
    /// Position registers on which other programs depend that are given.
    pub(super) used_elsewhere: BTreeSet<Option<u32>>,
    /// What programs that have no calls in common with the first one leave to it: frames, tools, and a speed override other than 100 %.
    pub(super) left_elsewhere: Effects,
    /// Whether another program may call the first one.
    pub(super) is_called: bool,
    /// Whether something may, after the first one has ended, move relative to where the arm stands: another program, or its next cycle.
    pub(super) is_counted_from: bool,
}

impl Calls {
    /// Whether a program is given.
    #[must_use]
    pub fn knows(&self, name: &[u8]) -> bool {
        self.given.contains_key(&upper(name))
    }

    /// Whether any program moves relative to where the arm stands when it begins.
    pub(super) fn may_count(&self) -> bool {
        self.given.values().any(|effects| effects.contains(&Effect::Counts))
    }

    /// The statements of a program that only sets registers, frames and tools, one after the other; `None` for other programs.
    pub(super) fn straight(&self, name: &[u8]) -> Option<&[Line<'static>]> {
        self.straight.get(&upper(name)).map(Vec::as_slice)
    }

    /// The effects of a call of a program; with an empty name, those of any program.
    pub(super) fn of(&self, name: &[u8]) -> Effects {
        match self.given.get(&upper(name)) {
            Some(effects) => effects.clone(),
            None if name.is_empty() => self.given.values().flatten().copied().chain(NOT_GIVEN).collect(),
            None => NOT_GIVEN.into(),
        }
    }

    /// The effects of a statement and of the programs that it runs.
    pub(super) fn of_statement(&self, kind: &StatementKind<'_>) -> Effects {
        let called = statement::runs(kind).into_iter().flat_map(|name| self.of(name));
        effects(kind).into_iter().chain(called).collect()
    }
}

pub(super) fn upper(name: &[u8]) -> String {
    String::from_utf8_lossy(name).to_ascii_uppercase()
}

/// The effects of a statement itself.
pub(super) fn effects(kind: &StatementKind<'_>) -> Vec<Effect> {
    match kind {
        StatementKind::Register(register, _) | StatementKind::For(register, ..) => {
            vec![Effect::Register(expression::count(register))]
        }
        StatementKind::Select(frame, _) => vec![Effect::Select(*frame)],
        StatementKind::Override(_) => vec![Effect::Override],
        StatementKind::Redefine(frame, index, _) => vec![Effect::Redefine(*frame, expression::count(index))],
        StatementKind::Element(register, ..) => vec![Effect::Elements(expression::count(register))],
        StatementKind::PositionRegister(register, from) => {
            let register = expression::count(register);
            let axes = matches!(from, Whole::Unknown | Whole::Taught(_)).then_some(Effect::Axes(register));
            axes.into_iter().chain([Effect::Elements(register)]).collect()
        }
        StatementKind::RedefineAny => {
            let of = |frame| [Effect::Select(frame), Effect::Redefine(frame, None)];
            [Frame::User, Frame::Tool].into_iter().flat_map(of).collect()
        }
        StatementKind::Macro | StatementKind::Unknown => NOT_GIVEN.into(),
        StatementKind::Concurrent(_) => vec![Effect::Concurrent],
        StatementKind::Motion(motion) => {
            let concurrent = motion.runs_others.then_some(Effect::Concurrent);
            // `Skip,LBL[1],PR[5]=JPOS`
            let stored = motion.skip.map(|_| [Effect::Elements(None), Effect::Axes(None)]);
            concurrent.into_iter().chain(stored.into_iter().flatten()).chain([Effect::Moves]).collect()
        }
        StatementKind::Displace(why) => vec![Effect::Displace(*why)],
        // If the condition does not hold yet, something else changes the registers that it names.
        StatementKind::Wait(condition, _) => {
            let [registers, position_registers] = statement::registers_in(condition);
            let registers = registers.into_iter().map(|register| Effect::Register(expression::count(register)));
            let of_positions =
                position_registers.into_iter().map(|register| Effect::Elements(expression::count(register)));
            registers.chain(of_positions).collect()
        }
        _ => statement::guarded_by(kind).map_or_else(Vec::new, |guarded| effects(&guarded)),
    }
}
