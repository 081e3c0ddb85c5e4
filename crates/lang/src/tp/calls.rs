//! Finds the effects of the programs that are given.

use super::code::Code;
use super::effects::{Calls, Effect, Effects, NOT_GIVEN, effects, upper};
use super::expression;
use super::lines::{Line, sections, statements};
use super::lower::{counts_from_its_start, leaves_override};
use super::statement::{self, StatementKind, Whole};
use std::collections::{BTreeMap, BTreeSet};

impl Calls {
    /// Reads the texts of programs, of which the first is the one that will be lowered.
    #[must_use]
    pub fn new<'a>(sources: impl IntoIterator<Item = &'a [u8]>) -> Self {
        let mut sources = sources.into_iter().peekable();
        let first = sources.peek().and_then(|bytes| name_of(bytes));
        let all: Vec<&[u8]> = sources.collect();
        let mut own: BTreeMap<String, Own> = all.iter().copied().filter_map(one).collect();
        let given = own.keys().map(|name| (name.clone(), closure(name, &own))).collect();
        let straight = own.iter_mut().filter_map(|(name, own)| Some((name.clone(), own.straight.take()?))).collect();
        let mut calls = Self { given, straight, ..Self::default() };
        if let Some(first) = first {
            calls.find_callers(&all, &own, &first);
            let family = family(&first, &own);
            let strangers = own.iter().filter(|(name, _)| !family.contains(name.as_str()));
            calls.left_elsewhere = strangers.flat_map(|(_, own)| &own.left).copied().collect();
            let others = own.iter().filter(|(name, _)| **name != first).flat_map(|(_, own)| &own.effects);
            calls.used_elsewhere = others
                .filter_map(|effect| if let Effect::Uses(register) = effect { Some(*register) } else { None })
                .collect();
            // The next cycle may begin where this one ends.
            calls.is_counted_from |= own.get(&first).is_some_and(|own| own.effects.contains(&Effect::Counts));
        }
        calls
    }

    /// Finds how the other programs use the first one.
    fn find_callers(&mut self, all: &[&[u8]], own: &BTreeMap<String, Own>, first: &str) {
        let begins = |name: &[u8]| name.is_empty() || reached(&upper(name), own).contains(first);
        for bytes in all.iter().filter(|bytes| name_of(bytes).is_some_and(|name| name != first)) {
            let Some(lines) = sections(bytes).statements.map(|at| statements(bytes, at)) else { continue };
            let kinds: Vec<StatementKind<'_>> = lines.iter().map(statement::kind).collect();
            for (at, kind) in kinds.iter().enumerate() {
                if statement::runs(kind).into_iter().any(begins) {
                    self.is_called = true;
                    self.is_counted_from |= self.may_count_after(&kinds, at);
                }
            }
        }
    }

    /// Whether the next motion after a statement may be one that moves relative to where the arm stands.
    fn may_count_after(&self, kinds: &[StatementKind<'_>], at: usize) -> bool {
        let counts = |kind: &StatementKind<'_>| match kind {
            StatementKind::Motion(motion) => motion.counts_on(),
            kind => self.of_statement(kind).contains(&Effect::Counts),
        };
        for kind in &kinds[at + 1..] {
            match kind {
                kind if counts(kind) => return true,
                StatementKind::Motion(_) | StatementKind::End => return false,
                // After these, the next statement is not always the one that follows in the text.
                StatementKind::Jump(_)
                | StatementKind::If(_)
                | StatementKind::Else
                | StatementKind::EndFor
                | StatementKind::When(_)
                | StatementKind::SelectCase(..)
                | StatementKind::For(..)
                | StatementKind::Wait(_, Some(_))
                | StatementKind::Macro
                | StatementKind::Unknown => return kinds.iter().any(counts),
                _ => {}
            }
        }
        false
    }
}

/// What programs that do not call each other have in common: position registers, frames, tools, and the speed override.
///
/// # Examples
/// ```
/// use deflex_lang::tp::Shared;
///
/// let [one, other] = [&b"/PROG A\n/MN\n1:PR[1]=P[2] ;\n/END\n"[..], b"/PROG B\n/MN\n1:R[1]=PR[1,3] ;\n/END\n"].map(Shared::of);
/// let mut known = Shared::default();
/// assert!(one.learn(&other, &mut known) && !one.learn(&other, &mut known));
/// assert!(!other.learn(&one, &mut known));
/// ```
#[derive(Clone, Debug, Default)]
pub struct Shared(Effects);

impl Shared {
    /// That of the program in a text.
    #[must_use]
    pub fn of(bytes: &[u8]) -> Self {
        let own = one(bytes).map(|(_, own)| own).unwrap_or_default();
        let is_shared = |effect: &Effect| matches!(effect, Effect::Elements(_) | Effect::Uses(_) | Effect::Axes(_));
        Self(own.effects.into_iter().filter(is_shared).chain(own.left).collect())
    }

    /// Adds that of a program that this one calls.
    ///
    /// # Examples
    /// ```
    /// use deflex_lang::tp::Shared;
    ///
    /// let [mut own, called] =
    ///     [&b"/PROG A\n/MN\n1:CALL B ;\n/END\n"[..], b"/PROG B\n/MN\n1:PR[1]=P[2] ;\n/END\n"].map(Shared::of);
    /// let other = Shared::of(b"/PROG C\n/MN\n1:R[1]=PR[1,3] ;\n/END\n");
    /// assert!(!own.learn(&other, &mut Shared::default()));
    /// own.extend(&called);
    /// assert!(own.learn(&other, &mut Shared::default()));
    /// ```
    pub fn extend(&mut self, other: &Self) {
        self.0.extend(&other.0);
    }

    /// Adds what matters to this program in another one to what is known of others, and returns whether any of it is new.
    pub fn learn(&self, other: &Self, known: &mut Self) -> bool {
        let sets = |register: Option<u32>| {
            let is_same = |set: Option<u32>| register.is_none() || set.is_none() || set == register;
            self.0.iter().any(|own| matches!(own, Effect::Elements(set) if is_same(*set)))
        };
        let before = known.0.len();
        known.0.extend(other.0.iter().filter(|effect| match effect {
            Effect::Uses(register) | Effect::Axes(register) => sets(*register),
            effect => matches!(effect, Effect::Redefine(..) | Effect::Override),
        }));
        known.0.len() > before
    }
}

/// A program, those that it calls, those that call it, and what these call, directly or not. A program that may call any is not one of them.
fn family<'a>(name: &'a str, own: &'a BTreeMap<String, Own>) -> BTreeSet<&'a str> {
    let calls = own.keys().map(|caller| reached(caller, own));
    let callers = calls.filter(|reached| reached.contains(name) && !reached.contains(""));
    callers.flatten().chain(reached(name, own)).collect()
}

/// The name of a program, in upper case.
fn name_of(bytes: &[u8]) -> Option<String> {
    sections(bytes).name.map(|name| upper(&bytes[name.range()]))
}

/// The effects of a program itself, and the programs that it calls.
#[derive(Default)]
struct Own {
    effects: Effects,
    /// What it leaves to programs that an operator starts after it: frames, tools, and a speed override other than 100 %.
    left: Effects,
    calls: BTreeSet<String>,
    /// Its statements, if a call can be replaced by them.
    straight: Option<Vec<Line<'static>>>,
}

/// The statements of a program by which a call of it can be replaced: they run one after the other, move nothing, call nothing, and mean the same
/// in the program that calls.
fn straight(lines: &[Line<'_>], kinds: &[StatementKind<'_>]) -> Option<Vec<Line<'static>>> {
    /// More statements than programs have that set frames.
    const MOST: usize = 200;
    let kinds = if let Some((StatementKind::End, before)) = kinds.split_last() { before } else { kinds };
    let is_set = |kind: &StatementKind<'_>| match kind {
        // The positions of a program are its own.
        StatementKind::PositionRegister(_, whole) => !matches!(whole, Whole::Taught(_)),
        StatementKind::Select(..)
        | StatementKind::Redefine(..)
        | StatementKind::Element(..)
        | StatementKind::Override(_)
        | StatementKind::Register(..) => true,
        _ => false,
    };
    // A mark is a remark here.
    let is_remark = |kind: &StatementKind<'_>| matches!(kind, StatementKind::Plain | StatementKind::Mark(_));
    let owned = |line: &Line<'_>| Line { text: line.text.to_vec().into(), span: line.span, line: line.line };
    let sets = lines.iter().zip(kinds).filter(|(_, kind)| is_set(kind));
    (kinds.len() <= MOST && kinds.iter().all(|kind| is_set(kind) || is_remark(kind)))
        .then(|| sets.map(|(line, _)| owned(line)).collect())
}

/// A program and all programs that it calls, directly or not, also those that are not given. A call with a name that is known only at run
/// time, which is the empty one, may be of any program.
fn reached<'a>(name: &'a str, own: &'a BTreeMap<String, Own>) -> BTreeSet<&'a str> {
    let (mut seen, mut open) = (BTreeSet::new(), vec![name]);
    while let Some(name) = open.pop() {
        if !seen.insert(name) {
            continue;
        }
        match own.get(name) {
            Some(program) => open.extend(program.calls.iter().map(String::as_str)),
            None if name.is_empty() => open.extend(own.keys().map(String::as_str)),
            None => {}
        }
    }
    seen
}

/// The effects of a program with all programs that it calls, directly or not.
fn closure(name: &str, own: &BTreeMap<String, Own>) -> Effects {
    let of = |name| own.get(name).map_or_else(|| NOT_GIVEN.into(), |program| program.effects.clone());
    reached(name, own).into_iter().flat_map(of).collect()
}

/// The effects of the statements of a program.
fn one(bytes: &[u8]) -> Option<(String, Own)> {
    let sections = sections(bytes);
    let name = upper(&bytes[sections.name?.range()]);
    let lines = statements(bytes, sections.statements?);
    let kinds: Vec<StatementKind<'_>> = lines.iter().map(statement::kind).collect();
    let mut own = Own { straight: straight(&lines, &kinds), ..Own::default() };
    for (line, kind) in lines.iter().zip(&kinds) {
        own.effects.extend(effects(kind));
        let end = if let StatementKind::Motion(motion) = kind { motion.moves_to_register() } else { None };
        let used = statement::registers_used(line, kind).into_iter().chain(end);
        own.effects.extend(used.map(|register| Effect::Uses(expression::count(register))));
        own.calls.extend(statement::runs(kind).into_iter().map(upper));
    }
    let counts = |kind: &StatementKind<'_>| matches!(kind, StatementKind::Motion(motion) if motion.counts_on());
    if kinds.iter().any(counts) && counts_from_its_start(&Code::new(&lines)) {
        own.effects.insert(Effect::Counts);
    }
    own.left = own.effects.iter().filter(|effect| matches!(effect, Effect::Redefine(..))).copied().collect();
    if own.effects.contains(&Effect::Override) && leaves_override(&Code::new(&lines)) {
        own.left.insert(Effect::Override);
    }
    Some((name, own))
}
