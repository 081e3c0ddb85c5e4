//! What is known at a statement, on all ways to it.

use super::calls::Called;
use super::expression::{self, Registers};
use super::statement::Frame;
use crate::program::{Mark, Reason};
use std::collections::BTreeSet;

/// What is known before a statement.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct ModalState {
    /// Selected user frame and tool, where known.
    pub(super) selected: [Option<u32>; 2],
    /// Registers whose value is known.
    pub(super) registers: Registers,
    /// The mark in force; `None` where it depends on the run.
    pub(super) mark: Marked,
    /// Frames whose values a program has set.
    pub(super) redefined: BTreeSet<(Frame, u32)>,
    /// The same of any frame, for want of a number that is known.
    pub(super) all_redefined: BTreeSet<Frame>,
    /// Why paths are moved at run time, where they are.
    pub(super) displaced: Option<Reason>,
    /// Something runs in parallel: nothing that it could change stays known.
    pub(super) concurrent: bool,
    /// Motions that the robot may stand at the end of.
    pub(super) standing: BTreeSet<usize>,
    /// Another program may have moved the robot since.
    pub(super) elsewhere: bool,
}

/// The mark in force.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Marked {
    /// This one, or none.
    Known(Option<Mark>),
    /// It depends on the run.
    Unknown,
}

impl Default for Marked {
    fn default() -> Self {
        Self::Known(None)
    }
}

impl ModalState {
    /// Takes in what is known on another way to the same statement; whether less is known than before.
    pub(super) fn join(&mut self, other: &Self) -> bool {
        let before = self.clone();
        for (own, others) in self.selected.iter_mut().zip(other.selected) {
            *own = own.filter(|own| Some(*own) == others);
        }
        self.registers.retain(|register, value| other.registers.get(register) == Some(value));
        if self.mark != other.mark {
            self.mark = Marked::Unknown;
        }
        self.redefined.extend(&other.redefined);
        self.all_redefined.extend(&other.all_redefined);
        self.displaced = self.displaced.or(other.displaced);
        self.concurrent |= other.concurrent;
        self.standing.extend(&other.standing);
        self.elsewhere |= other.elsewhere;
        *self != before
    }

    /// Which frame is selected, while nothing runs in parallel.
    pub(super) fn select(&mut self, frame: Frame, number: Option<u32>) {
        self.selected[frame as usize] = number.filter(|_| !self.concurrent);
    }

    pub(super) fn set(&mut self, register: &[u8], value: &[u8]) {
        let value = expression::value(value, &self.registers);
        match expression::count(register, &self.registers) {
            Some(register) => self.put(register, value),
            None => self.registers.clear(),
        }
    }

    pub(super) fn put(&mut self, register: u32, value: Option<f64>) {
        match value.filter(|_| !self.concurrent) {
            Some(value) => self.registers.insert(register, value),
            None => self.registers.remove(&register),
        };
    }

    /// Nothing is known any more of what any program can change.
    pub(super) fn forget(&mut self) {
        self.selected = [None; 2];
        self.registers.clear();
    }

    /// The same, and it stays so.
    pub(super) fn runs_beside(&mut self) {
        self.forget();
        self.concurrent = true;
    }

    /// What a program that is called may change.
    pub(super) fn call(&mut self, called: &Called) {
        if called.all_registers {
            self.registers.clear();
        }
        for register in &called.registers {
            self.registers.remove(register);
        }
        for (own, selects) in self.selected.iter_mut().zip(called.selects) {
            *own = own.filter(|_| !selects);
        }
        self.redefined.extend(&called.redefined);
        self.all_redefined.extend(&called.all_redefined);
        self.displaced = self.displaced.or(called.displaces);
        self.elsewhere |= called.moves;
        if called.concurrent {
            self.runs_beside();
        }
    }
}
