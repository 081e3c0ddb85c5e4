//! Literals of the text: their numbers, and which of them must not be edited.

use super::TargetInText;
use super::literal::Literal;
use super::runner::Runner;
use super::value::{Pose, SourceSpan, Value};

impl<'a> Runner<'a> {
    /// The index of this literal, almost always the next one.
    pub(super) fn literal_id(&mut self, literal: &Literal) -> Option<u32> {
        let source = literal.source as usize;
        let at = if self.literals.get(self.next_literal) == Some(literal) {
            self.next_literal
        } else {
            let first = self.first_literal[source];
            let of_source = &self.literals[first..self.first_literal[source + 1]];
            first + of_source.binary_search_by_key(&literal.span().start, |l| l.span().start).ok()?
        };
        self.next_literal = at + 1;
        u32::try_from(at).ok()
    }

    /// Adds a robtarget assembled from parts as a literal of its own.
    pub(super) fn own_literal(&mut self, literal: Literal) -> Option<u32> {
        let place = SourceSpan { source: literal.source, span: literal.span() };
        if let Some(id) = self.own.get(&place) {
            return Some(*id);
        }
        let id = u32::try_from(self.literals.len()).ok()?;
        self.literals.push(literal);
        self.own.insert(place, id);
        Some(id)
    }

    /// Forbids edits of a literal from which other values are made: they would move with it.
    pub(super) fn pin(&mut self, root: Option<u32>) {
        self.pinned.extend(root);
    }

    /// The same for a pose, with the offsets that make it.
    pub(super) fn pin_pose(&mut self, pose: &Pose) {
        self.pin(pose.root);
        self.held.extend(pose.steps.iter().filter_map(|step| step.tokens).map(|tokens| tokens[0]));
    }

    pub(super) fn pin_value(&mut self, value: &Value) {
        match value {
            Value::Target(pose) => self.pin_pose(pose),
            Value::List(items, place) => {
                self.unassembled.extend(*place);
                items.iter().for_each(|v| self.pin_value(v));
            }
            _ => {}
        }
    }

    pub(super) fn root(&self, site: &TargetInText) -> Option<u32> {
        match site {
            TargetInText::None => None,
            TargetInText::Literal { literal, .. } => Some(*literal),
            TargetInText::Offset(at) => Some(self.offsets[*at as usize].root),
        }
    }
}
