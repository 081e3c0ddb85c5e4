//! Actions of the machine in CL data other than motion, and those for which a posted program has no line.

use deflex_program::post::Templates;
use deflex_program::{Action, ActionKind, Program};
use deflex_text::{Diagnostic, Severity};

/// The actions of one kind in a program.
#[derive(Clone, Debug)]
struct ActionGroup {
    /// The first of them.
    kind: ActionKind,
    first: Diagnostic,
    count: usize,
    /// The first one on which the cut depends.
    needed: Option<Diagnostic>,
    /// The first one with an unknown spindle speed.
    without_speed: Option<Diagnostic>,
}

/// All actions of a program, by kind.
#[derive(Clone, Debug, Default)]
pub(super) struct MachineActions(Vec<ActionGroup>);

impl MachineActions {
    /// Adds a program, or its next chunk, before which there are `points_before` points.
    pub(super) fn add(&mut self, program: &Program, points_before: usize) {
        let Some(source) = program.sources.first() else { return };
        for Action { before, kind, span, line } in &program.actions {
            let line = u32::try_from(*line).unwrap_or(u32::MAX);
            let at =
                |message: &str| Diagnostic::error("post.template", &source.name, message).on_line(source, *span, line);
            let next = program.targets.get(*before);
            let needed = match kind {
                // The first tool is mounted when the program starts.
                ActionKind::ToolChange { .. } => points_before + before > 0 && next.is_some(),
                // Without it the motion after it, rapid travel too, would begin where the cut ended.
                ActionKind::Home => next.is_some(),
                _ => false,
            };
            let without_speed = matches!(kind, ActionKind::SpindleOn { rpm: None, .. });
            let known = self.0.iter_mut().find(|known| known.kind.template() == kind.template());
            let known = match known {
                Some(known) => known,
                None => {
                    let first = at(kind.what());
                    self.0.push(ActionGroup { kind: kind.clone(), first, count: 0, needed: None, without_speed: None });
                    let last = self.0.len() - 1;
                    &mut self.0[last]
                }
            };
            known.count += 1;
            if needed && known.needed.is_none() {
                known.needed = Some(at(kind.what()));
            }
            if without_speed && known.without_speed.is_none() {
                known.without_speed =
                    Some(at("the spindle speed is a surface speed, and no CUTTER states the diameter of the cutter"));
            }
        }
    }

    /// Warnings for actions that are not written because they have no template.
    ///
    /// # Errors
    /// The cut depends on such an action.
    pub(super) fn unwritten(&self, templates: &Templates) -> Result<Vec<Diagnostic>, Vec<Diagnostic>> {
        let (mut notes, mut errors) = (Vec::new(), Vec::new());
        for ActionGroup { kind, first, count, needed, without_speed } in &self.0 {
            let times = if *count > 1 { format!(" ({count} times)") } else { String::new() };
            let Some(key) = kind.template() else {
                let message = format!("{} is written as a wait{times}", first.message);
                notes.push(Diagnostic { message, ..first.clone() }.severity(Severity::Note));
                continue;
            };
            if templates.has(kind) {
                if let Some(unknown) = without_speed.as_ref().filter(|_| templates.fills(key, "rpm")) {
                    errors.push(unknown.clone().help("write the spindle speed in RPM, or CUTTER before it"));
                }
                continue;
            }
            let help = format!("give `[cl.post] {key} = \"…\"` in the cell: a line of the posted program");
            if let Some(needed) = needed {
                let message = format!("{}, and the cell has no `[cl.post] {key}`", needed.message);
                errors.push(Diagnostic { message, ..needed.clone() }.help(help));
                continue;
            }
            let message = format!("{} is not written{times}: the cell has no `[cl.post] {key}`", first.message);
            notes.push(Diagnostic { message, ..first.clone() }.severity(Severity::Note).help(help));
        }
        if errors.is_empty() { Ok(notes) } else { Err(errors) }
    }
}
