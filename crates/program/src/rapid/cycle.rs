//! The next cycle: after its end, `main` begins again with the data and the displacement that it left.

use super::expression::Expression;
use super::known::RoutineId;
use super::lasting::{Lasting, LastingStates};
use super::runner::{Mode, Runner};
use super::state::{Begun, ModalState};
use super::symbols::{Content, Upper};
use super::tree::{Storage, statements};
use super::value::Value;
use crate::{ToolData, WobjData};
use deflex_text::{Diagnostic, Severity, Span};
use std::collections::BTreeSet;

impl Runner<'_> {
    /// Records the state before `main` runs.
    pub(super) fn begin_cycle(&mut self) {
        let frame = |at: &usize| {
            let data = &self.symbols.variables[*at];
            let declared = matches!(data.content, Content::Declared(_)) && data.storage != Storage::Const;
            let has_frames =
                matches!(&*data.kind, b"TOOLDATA" | b"WOBJDATA") || self.symbols.records.contains_key(&*data.kind);
            declared && data.assigned && data.volatile.is_none() && has_frames
        };
        let frames: Vec<usize> = (0..self.symbols.data).filter(frame).collect();
        self.begun.declared = frames.into_iter().map(|at| (at, self.content(at))).collect();
    }

    /// Records that a motion, a parameter or an expression takes a tool or work object from a variable.
    pub(super) fn uses_frame(&mut self, at: usize) {
        if self.is_real() && self.begun.declared.contains_key(&at) && self.state.values.get(at).is_none() {
            self.begun.used.insert(at);
        }
    }

    /// Records that a motion uses the states in force.
    pub(super) fn uses_states(&mut self) {
        self.begun.expected = self.begun.expected.union(self.state.modal.as_begun);
    }

    /// Records that the cycle may end here.
    pub(super) fn ends_cycle(&mut self) {
        if self.mode == Mode::UsesAlone {
            return;
        }
        self.begun.left = self.begun.left.union(self.state.modal.differing(&ModalState::default()));
        let is_left = |at: &usize| {
            let ends = self.state.values.get(*at);
            ends.is_some_and(|ends| have_other_frames(&self.begun.declared[at], ends))
        };
        let left: Vec<usize> = self.begun.declared.keys().copied().filter(is_left).collect();
        self.begun.left_data.extend(left);
    }

    /// Records the same where a trap, which runs at any moment, may end the cycle.
    pub(super) fn may_be_interrupted(&mut self) {
        if self.symbols.known.at_any_moment.end_cycle {
            self.ends_cycle();
        }
    }

    /// Warns of tools, work objects and lasting states that a motion uses as declared or as they are at the start, and that differ in the
    /// next cycle.
    pub(super) fn report_next_cycle(&mut self, main: RoutineId) {
        self.ends_cycle();
        let Begun { used, expected, left, left_data, .. } = std::mem::take(&mut self.begun);
        // Other messages report routines outside the files, which may set states too.
        let sets = |set: LastingStates, id: &RoutineId| set.union(self.symbols.changed_by(*id).sets);
        let set = self.reached.entered.iter().fold(LastingStates::default(), sets);
        for at in used.intersection(&left_data).copied() {
            let data = &self.symbols.variables[at];
            if let Some(declared) = data.declared {
                let message = format!(
                    "at the end of `main`, `{}` differs from the value that its first motions expect",
                    data.name
                );
                self.report_cycle(usize::from(data.source), declared.statement, &message);
            }
        }
        for name in set.common(expected).common(left).iter().filter_map(Lasting::what) {
            let message = format!("at the end of `main`, {name} may not be as its first motions expect");
            self.report_cycle(main.file, self.symbols.routine(main).name, &message);
        }
    }

    /// Warns of data that a routine without a caller uses, and of lasting states, where another such routine changes them: the calls of
    /// both are not in the files, and their order decides.
    pub(super) fn report_other_entries(&mut self, id: RoutineId, entries: &[RoutineId]) {
        let own = self.symbols.changed_by(id);
        let named = self.data_named_in(id);
        let mut changed: Vec<(String, RoutineId)> = Vec::new();
        let mut used: Vec<(usize, RoutineId)> = Vec::new();
        for other in entries.iter().copied().filter(|other| *other != id) {
            let changes = self.symbols.changed_by(other);
            used.extend(named.intersection(&changes.data).map(|at| (*at, other)));
            let states = changes.states.without(own.states);
            let names = states.iter().filter_map(Lasting::what);
            changed.extend(names.map(|name| (format!("{name} as at the start"), other)));
        }
        // All other data that the program assigns are unknown where a routine begins.
        used.retain(|(at, _)| has_frames(&self.initial(*at)));
        let value = |at: usize| format!("the value of `{}` in the text", self.symbols.variables[at].name);
        changed.extend(used.into_iter().map(|(at, other)| (value(at), other)));
        changed.sort();
        changed.dedup_by(|a, b| a.0 == b.0);
        let name = |id: RoutineId| String::from_utf8_lossy(self.routine_name(id)).into_owned();
        let (source, at) = (&self.symbols.sources[id.file], self.symbols.routine(id).name);
        let warning = |(what, other): (String, RoutineId)| {
            let message = format!("`{}` is corrected for {what}, and `{}` changes it", name(id), name(other));
            let help = "give the module that calls these routines as an input, or with --context: the order of the calls decides";
            Diagnostic::error("rapid.no-caller", "", message).at(source, at).severity(Severity::Warning).help(help)
        };
        let warnings: Vec<Diagnostic> = changed.into_iter().map(warning).collect();
        self.messages.diagnostics.extend(warnings);
    }

    /// Data that the statements of a routine, and of those that it calls, name.
    fn data_named_in(&self, id: RoutineId) -> BTreeSet<usize> {
        let mut data = BTreeSet::new();
        for id in self.reached_from([id].into()) {
            let (bytes, module) = (self.bytes(id.file), self.symbols.module_of(id));
            for statement in statements(&self.symbols.routine(id).body) {
                statement.each(&mut |part: &Expression| {
                    if part.is_name() {
                        data.extend(self.symbols.find_data(module, &Upper::new(&bytes[part.span.range()])));
                    }
                });
            }
        }
        data
    }

    fn report_cycle(&mut self, source: usize, span: Span, message: &str) {
        let note = Diagnostic::error("rapid.next-cycle", "", message).at(&self.symbols.sources[source], span);
        let help = "set it before the first motion: otherwise the next cycle drives these motions to other places than the correction assumes";
        self.messages.diagnostics.push(note.severity(Severity::Note).help(help));
    }
}

/// Whether there is a tool or work object in a value. Arrays and records may hold several.
fn has_frames(value: &Value) -> bool {
    value.is_frame() || value.list().is_some_and(|items| items.iter().any(has_frames))
}

/// Whether a tool or work object in a value differs from that in another value.
fn have_other_frames(a: &Value, b: &Value) -> bool {
    let frames = |value: &Value| (value.tool().map(ToolData::normalised), value.wobj().map(WobjData::normalised));
    let pair = (frames(a), frames(b));
    match (a.list(), b.list()) {
        _ if pair.0 != (None, None) || pair.1 != (None, None) => pair.0 != pair.1,
        (Some(a), Some(b)) => a.len() != b.len() || a.iter().zip(b).any(|(a, b)| have_other_frames(a, b)),
        (Some(_), None) | (None, Some(_)) => true,
        (None, None) => false,
    }
}
