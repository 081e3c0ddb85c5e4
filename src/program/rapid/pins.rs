//! Numbers of the text: whose they are, and which may not be edited.

use super::Site;
use super::literal::Literal;
use super::runner::Runner;
use super::value::{Pose, SourceSpan, Value};

impl<'a> Runner<'a> {
    /// Which literal of the text this is; the next one almost always.
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

    /// A robtarget put together from parts, as a literal of its own.
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

    /// A literal that other values are made of: moving it would move them too.
    pub(super) fn pin(&mut self, root: Option<u32>) {
        self.pinned.extend(root);
    }

    /// The same with the offsets that it was made by.
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

    pub(super) fn root(&self, site: &Site) -> Option<u32> {
        match site {
            Site::None => None,
            Site::Literal { literal, .. } => Some(*literal),
            Site::Offset(at) => Some(self.offsets[*at as usize].root),
        }
    }
}
