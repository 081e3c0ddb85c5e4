//! Literals of the text: their numbers, and which of them must not be edited.

use super::TargetInText;
use super::expression::{Expression, ExpressionKind};
use super::literal::Literal;
use super::runner::{Found, Numbers};
use super::tree::File;
use super::value::{HeldNumber, Number, Pose, Value};
use deflex_lang::ir::SourceSpan;
use std::collections::HashSet;

impl Numbers {
    pub(super) fn of(files: &[File]) -> Self {
        let mut numbers = Self::default();
        for file in files {
            numbers.first_literal.push(numbers.literals.len());
            numbers.literals.extend_from_slice(&file.literals);
        }
        numbers
    }

    /// The number of a complete robtarget, given its index in its file.
    pub(super) fn literal_id(&self, source: usize, index: u32) -> Option<u32> {
        u32::try_from(self.first_literal[source]).ok()?.checked_add(index)
    }

    /// The robtarget that an expression is: a complete one, or one that is assembled from parts.
    pub(super) fn literal_of(&self, source: u16, of: &Expression) -> Option<u32> {
        match of.kind {
            ExpressionKind::Literal(index) => self.literal_id(usize::from(source), index),
            ExpressionKind::Aggregate(_) => self.own.get(&SourceSpan { source, span: of.span }).copied(),
            _ => None,
        }
    }

    /// Forbids edits of an expression if it is a robtarget or a number.
    pub(super) fn pin_part(&mut self, source: u16, part: &Expression) {
        self.pin(self.literal_of(source, part));
        let is_number = matches!(part.kind, ExpressionKind::Number(_));
        self.held.extend(is_number.then_some(Number::Offset(SourceSpan { source, span: part.span })));
    }

    /// Forbids edits of all robtargets and numbers in an expression.
    pub(super) fn pin_text(&mut self, source: u16, of: &Expression) {
        of.each(&mut |part| self.pin_part(source, part));
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
        self.held.extend(root.map(Number::Literal));
    }

    /// The same for a pose, with the offsets that make it.
    pub(super) fn pin_pose(&mut self, pose: &Pose) {
        self.held.extend(pose.numbers());
    }

    /// Records that a variable holds a robtarget. Only [`Self::reads`] forbids edits of it: where the
    /// value is known, the run follows it.
    pub(super) fn holds(&mut self, variable: usize, pose: &Pose) {
        match self.read.contains(&variable) {
            true => self.pin_pose(pose),
            false => self.origins.entry(variable).or_default().extend(pose.numbers()),
        }
    }

    /// Forbids edits of all robtargets that a variable ever holds, because it is read where its value is unknown: on another path, in the
    /// next cycle, or by a routine that is not followed.
    pub(super) fn reads(&mut self, variable: usize) {
        if self.read.insert(variable)
            && let Some(origins) = self.origins.remove(&variable)
        {
            self.held.extend(origins);
        }
    }

    /// Begins a variable, whose number another one may have had.
    pub(super) fn begins(&mut self, variable: usize) {
        self.read.remove(&variable);
        self.origins.remove(&variable);
    }

    /// Takes out the numbers that must not be edited, so that those are seen that the next steps add.
    pub(super) fn held(&mut self) -> HashSet<Number> {
        std::mem::take(&mut self.held)
    }

    /// Puts them back. Returns those that were added.
    pub(super) fn held_again(&mut self, before: HashSet<Number>) -> Vec<HeldNumber> {
        let added = std::mem::replace(&mut self.held, before);
        added.into_iter().map(|number| HeldNumber { number, is_new: self.held.insert(number) }).collect()
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
}

impl Found {
    /// The literal from which a target is made.
    pub(super) fn root(&self, site: &TargetInText) -> Option<u32> {
        site.root(&self.offsets)
    }

    /// The offset by which a target is edited, by its first number.
    pub(super) fn offset(&self, site: &TargetInText) -> Option<SourceSpan> {
        let TargetInText::Offset(at) = *site else { return None };
        self.offsets[at as usize].steps.last()?.place()
    }
}
