//! The next cycle: after its end, `main` begins again with the data and the displacement that it left.

use super::expression::Expression;
use super::known::RoutineId;
use super::predefined::Lasting;
use super::runner::Runner;
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
            declared && data.assigned && data.volatile.is_none() && matches!(&*data.kind, b"TOOLDATA" | b"WOBJDATA")
        };
        let frames: Vec<usize> = (0..self.symbols.data).filter(frame).collect();
        self.begun.declared = frames.into_iter().map(|at| (at, self.content(at))).collect();
    }

    /// Records that a motion or a parameter takes its tool or work object from a variable.
    pub(super) fn uses_frame(&mut self, at: usize) {
        if self.is_real() && self.begun.declared.contains_key(&at) && !self.state.values.contains_key(&at) {
            self.begun.used.insert(at);
        }
    }

    /// Records that an instruction sets a state that lasts.
    pub(super) fn sets(&mut self, state: Lasting) {
        if self.is_real() {
            self.begun.moved_before.entry(state).or_insert(self.counters.motions > 0);
        }
    }

    /// Warns of tools, work objects and lasting states that a motion uses as declared or as they are at the start, and that differ in the
    /// next cycle.
    pub(super) fn tell_next_cycle(&mut self, main: RoutineId) {
        let Begun { declared, used, moved_before } = std::mem::take(&mut self.begun);
        let frames = |value: &Value| (value.tool().map(ToolData::normalised), value.wobj().map(WobjData::normalised));
        for (at, began) in declared.into_iter().filter(|(at, _)| used.contains(at)) {
            let ends = self.content(at);
            let data = &self.symbols.variables[at];
            if let Some(declared) = data.declared
                && frames(&began) != frames(&ends)
            {
                let message = format!(
                    "at the end of `main`, `{}` differs from the value that its first motions expect",
                    data.name
                );
                self.tell_cycle(usize::from(data.source), declared.statement, &message);
            }
        }
        let (start, end) = (ModalState::default(), &self.state.modal);
        let lasting = [
            (Lasting::Displacement, end.displacement != start.displacement, "program displacement"),
            (Lasting::AxisOffset, end.axes.offset != start.axes.offset, "the offset of external axes"),
            (Lasting::Units, end.axes.inactive != start.axes.inactive, "the set of active mechanical units"),
            (Lasting::Softness, end.soft != start.soft, "soft servo"),
            (Lasting::Speed, end.velocity != start.velocity, "`VelSet`"),
            (Lasting::Arcs, end.arcs != start.arcs, "`CirPathMode`"),
            (Lasting::Configuration, end.nearest != start.nearest, "`ConfJ`"),
        ];
        for (state, differs, what) in lasting {
            if differs && moved_before.get(&state) == Some(&true) {
                let message = format!("at the end of `main`, {what} may not be as its first motions expect");
                self.tell_cycle(main.file, self.symbols.routine(main).name, &message);
            }
        }
    }

    /// Warns of data that a routine without a caller uses, and of a displacement, where another such routine changes them: the calls of
    /// both are not in the files, and their order decides.
    pub(super) fn tell_other_entries(&mut self, id: RoutineId, entries: &[RoutineId]) {
        let own = self.symbols.changed_by(id);
        let mut changed: Vec<(String, RoutineId)> = Vec::new();
        for other in entries.iter().copied().filter(|other| *other != id) {
            let changes = self.symbols.changed_by(other);
            let used = self.data_named_in(id).into_iter().filter(|at| changes.data.contains(at));
            changed.extend(
                used.map(|at| (format!("the value of `{}` in the text", self.symbols.variables[at].name), other)),
            );
            if changes.switches.displacement && !own.switches.displacement {
                changed.push(("program displacement switched off".to_owned(), other));
            }
        }
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
        let (mut data, mut routines) = (BTreeSet::new(), vec![id]);
        let mut at = 0;
        while let Some(&id) = routines.get(at) {
            at += 1;
            let (bytes, module) = (self.bytes(id.file), self.symbols.module_of(id));
            let body = &self.symbols.routine(id).body;
            for statement in statements(body) {
                statement.each(&mut |part: &Expression| {
                    if part.is_name() {
                        data.extend(self.symbols.find_data(module, &Upper::new(&bytes[part.span.range()])));
                    }
                });
            }
            for callee in self.calls(id, body) {
                if !routines.contains(&callee) {
                    routines.push(callee);
                }
            }
        }
        data
    }

    fn tell_cycle(&mut self, source: usize, span: Span, message: &str) {
        let note = Diagnostic::error("rapid.next-cycle", "", message).at(&self.symbols.sources[source], span);
        let help = "set it before the first motion: otherwise the next cycle drives these motions to other places than the correction assumes";
        self.messages.diagnostics.push(note.severity(Severity::Note).help(help));
    }
}
