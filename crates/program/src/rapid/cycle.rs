//! The next cycle: after its end, `main` begins again with the data and the displacement that it left.

use super::known::RoutineId;
use super::runner::Runner;
use super::state::{Begun, OnOff};
use super::symbols::Content;
use super::tree::Storage;
use super::value::{Value, unit};
use crate::{ToolData, WobjData};
use deflex_text::{Diagnostic, Severity, Span};

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

    /// Records that a variable will be assigned.
    pub(super) fn assigns(&mut self, at: usize) {
        // After a branch it may be as it was.
        let in_every_run = self.layers.len() == self.frames.len();
        if in_every_run && let Some(began) = self.begun.declared.remove(&at) {
            self.begun.used.extend(self.moved_in(at, &began).then_some((at, began)));
        }
    }

    /// Records that program displacement will be switched.
    pub(super) fn displaces(&mut self) {
        self.begun.moved_before_displacement.get_or_insert(self.counters.motions > 0);
    }

    /// Whether a motion has used a tool or work object of this name and value.
    fn moved_in(&self, at: usize, value: &Value) -> bool {
        let name = &self.symbols.variables[at].name;
        let (tool, wobj) = (tool_of(value), wobj_of(value));
        let alike = |used: &str| used.eq_ignore_ascii_case(name);
        tool.is_some() && self.used.tools.iter().any(|used| alike(&used.name) && used.data == tool)
            || wobj.is_some() && self.used.wobjs.iter().any(|used| alike(&used.name) && used.data == wobj)
    }

    /// Warns of tools, work objects and displacement that a motion uses as declared, and that differ in the next cycle.
    pub(super) fn tell_next_cycle(&mut self, main: RoutineId) {
        let Begun { declared, mut used, moved_before_displacement } = std::mem::take(&mut self.begun);
        used.extend(declared.into_iter().filter(|(at, began)| self.moved_in(*at, began)));
        for (at, began) in used {
            let ends = self.content(at);
            let data = &self.symbols.variables[at];
            if let Some(declared) = data.declared
                && (tool_of(&began), wobj_of(&began)) != (tool_of(&ends), wobj_of(&ends))
            {
                let message = format!(
                    "at the end of `main`, `{}` differs from the value that its first motions expect",
                    data.name
                );
                self.tell_cycle(usize::from(data.source), declared.statement, &message);
            }
        }
        if self.state.displacement != OnOff::Off && moved_before_displacement == Some(true) {
            let message =
                "at the end of `main`, program displacement may be on, and its first motions expect it to be off";
            self.tell_cycle(main.file, self.symbols.routine(main).name, message);
        }
    }

    /// Warns of tools, work objects and displacement that the motions of a routine without a caller use as declared, and that another
    /// such routine changes.
    pub(super) fn tell_other_entries(&mut self, id: RoutineId, entries: &[RoutineId]) {
        let Begun { declared, used, moved_before_displacement } = std::mem::take(&mut self.begun);
        let name = |id: RoutineId| String::from_utf8_lossy(self.routine_name(id)).into_owned();
        let others = || entries.iter().copied().filter(|other| *other != id);
        let mut changed = Vec::new();
        for (at, _) in used.into_iter().chain(declared).filter(|(at, began)| self.moved_in(*at, began)) {
            if let Some(other) = others().find(|other| self.symbols.changed_by(*other).data.contains(&at)) {
                changed.push((format!("the value of `{}` in the text", self.symbols.variables[at].name), other));
            }
        }
        if moved_before_displacement != Some(false)
            && let Some(other) = others().find(|other| self.symbols.changed_by(*other).switches.displacement)
        {
            changed.push(("program displacement switched off".to_owned(), other));
        }
        let messages: Vec<String> = changed
            .into_iter()
            .map(|(what, other)| format!("`{}` is corrected for {what}, and `{}` changes it", name(id), name(other)))
            .collect();
        let (bytes, at) = (&self.symbols.sources[id.file], self.symbols.routine(id).name);
        for message in messages {
            let warning = Diagnostic::error("rapid.no-caller", "", message).at(bytes, at).severity(Severity::Warning);
            self.messages.diagnostics.push(
                warning.help("give the module that calls these routines as an input, or with --context: the order of the calls decides"),
            );
        }
    }

    fn tell_cycle(&mut self, source: usize, span: Span, message: &str) {
        let note = Diagnostic::error("rapid.next-cycle", "", message).at(&self.symbols.sources[source], span);
        let help = "set it before the first motion: otherwise the next cycle drives these motions to other places than the correction assumes";
        self.messages.diagnostics.push(note.severity(Severity::Note).help(help));
    }
}

/// The tooldata of a value.
fn tool_of(value: &Value) -> Option<ToolData> {
    value.tool().map(|data| ToolData { tcp_quat: unit(data.tcp_quat), ..data })
}

fn wobj_of(value: &Value) -> Option<WobjData> {
    value.wobj().map(|data| WobjData {
        uframe_quat: unit(data.uframe_quat),
        oframe_quat: unit(data.oframe_quat),
        ..data
    })
}
