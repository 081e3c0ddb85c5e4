//! Finds the effects of the programs that are given.

use super::code::Code;
use super::effects::{Calls, Effect, Effects, NOT_GIVEN, effects, upper};
use super::lines::{sections, statements};
use super::lower::counts_from_its_start;
use super::statement::{self, StatementKind};
use std::collections::{BTreeMap, BTreeSet};

impl Calls {
    /// Reads the texts of programs.
    #[must_use]
    pub fn new<'a>(sources: impl IntoIterator<Item = &'a [u8]>) -> Self {
        let own: BTreeMap<String, Own> = sources.into_iter().filter_map(one).collect();
        Self { given: own.keys().map(|name| (name.clone(), closure(name, &own))).collect() }
    }
}

/// The effects of a program itself, and the programs that it calls.
#[derive(Default)]
struct Own {
    effects: Effects,
    calls: BTreeSet<String>,
}

/// The effects of a program with all programs that it calls, directly or not.
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

/// The effects of the statements of a program.
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
