//! Tool, spindle, coolant, stops: actions of the machine between positions.

use super::lex::Record;
use super::refusal::Outcome;
use super::statement::Statement;
use crate::{Action, ActionKind, CutterInfo, Reason};
use std::sync::Arc;

/// The mounted tool, and the actions before the next position.
#[derive(Debug, Default)]
pub(super) struct Machine {
    /// Names of the cell's tools in the order of their first use; targets have indices into them.
    pub(super) tools: Vec<String>,
    /// Index of the mounted tool, after a position needed it.
    pub(super) index: Option<u16>,
    /// Its last printed number or name.
    pub(super) number: Option<Arc<str>>,
    /// The name that an operation gives its tool (`TOOL PATH/op,TOOL,name`), until a number follows.
    pub(super) name: Option<Arc<str>>,
    /// Number or name at the last position.
    pub(super) used: Option<Option<Arc<str>>>,
    /// The cutter at the last position.
    pub(super) used_cutter: Option<CutterInfo>,
    /// The statement that named a tool or a cutter since then.
    pub(super) named: Option<Record>,
    pub(super) cutter_named: Option<Record>,
    /// Actions before the next position.
    pub(super) waiting: Vec<(ActionKind, Record)>,
    /// The selected work offset, if there is one.
    pub(super) offset: Option<f64>,
}

impl Machine {
    /// Index of the mounted tool.
    pub(super) fn tool(&self) -> u16 {
        self.index.unwrap_or(0)
    }

    /// Whether anything has to be applied before the next position.
    pub(super) fn is_waiting(&self) -> bool {
        self.index.is_none() || self.holds_records()
    }

    /// Whether statements that were read belong to the next position.
    pub(super) fn holds_records(&self) -> bool {
        self.named.is_some() || self.cutter_named.is_some() || !self.waiting.is_empty()
    }

    pub(super) fn wait(&mut self, kind: ActionKind, record: Record) {
        self.waiting.push((kind, record));
    }

    /// Whether the machine leaves the path before the next position, for its home position or another tool.
    pub(super) fn leaves_path(&self) -> bool {
        self.waiting.iter().any(|(kind, _)| kind.leaves_path())
    }

    pub(super) fn stop(&mut self, record: Record) {
        self.wait(ActionKind::Stop, record);
    }

    pub(super) fn optional_stop(&mut self, record: Record) {
        self.wait(ActionKind::OptionalStop, record);
    }

    pub(super) fn dwell(&mut self, seconds: f64, record: Record) {
        self.wait(ActionKind::Dwell { seconds }, record);
    }

    /// Adds the waiting actions before the target with this index.
    pub(super) fn end(&mut self, before: usize, actions: &mut Vec<Action>) {
        let action =
            |(kind, record): (ActionKind, Record)| Action { before, kind, span: record.span, line: record.line };
        actions.extend(self.waiting.drain(..).map(action));
    }

    /// `SELECT/OFSETL,n`, `SET/OFSETL,n`: a work offset other than the first is another frame. `SELECT/TOOL` only prepares the tool magazine.
    pub(super) fn select(&mut self, s: &Statement) -> Outcome {
        let offset = s.has(b"OFSETL") || s.has(b"OFFSET") || s.has(b"FIXTUR") || s.has(b"OFSTNO");
        let number = s.number_items().iter().next().map(|t| t.value).filter(|_| offset);
        let before = self.offset.filter(|_| self.used.is_some());
        if before.zip(number).is_some_and(|(before, number)| (before - number).abs() > 0.5) {
            return Err(Reason::MachineOffset);
        }
        self.offset = number.or(self.offset);
        Ok(())
    }
}
