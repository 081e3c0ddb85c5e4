//! The effect of each step of a routine, and the state where paths meet.

use super::run::Runner;
use super::state::ModalState;
use super::steps::{Row, Test};
use super::symbols::{RoutineId, STANDS};
use super::tree::Loop;
use super::value::Value;
use crate::Reason;
use deflex_lang::walk::{Machine, Meeting, Stop, VALUES_PER_STEP};

/// Sizes of the results so far.
#[derive(Clone, Copy, Debug)]
pub(super) struct ResultSizes {
    targets: usize,
    motions: u32,
    arcs: usize,
    unknown: usize,
    last: Option<f64>,
    steps: usize,
}

impl<'a> Machine for Runner<'a> {
    type Step = Row<'a>;
    type Test = Test<'a>;
    type State = ModalState;
    type Mark = ResultSizes;

    fn step(&mut self, _: usize, row: Row<'a>, state: &mut ModalState) -> Result<(), Stop> {
        self.state = std::mem::take(state);
        let done = row.iter().try_for_each(|statement| self.count(statement.at).and_then(|()| self.simple(statement)));
        *state = std::mem::take(&mut self.state);
        done
    }

    fn holds(&mut self, _: usize, test: Test<'a>, state: &mut ModalState) -> Result<Option<bool>, Stop> {
        self.state = std::mem::take(state);
        let holds = self.decide(test);
        *state = std::mem::take(&mut self.state);
        holds
    }

    fn join(&mut self, known: &mut ModalState, other: &ModalState, meeting: Meeting) -> bool {
        self.steps += (known.values.len() + other.values.len()) / VALUES_PER_STEP;
        let why = match meeting {
            Meeting::Branches => Reason::Branches,
            Meeting::Rounds => Reason::Loop,
        };
        known.join(other, &self.symbols.start, why, &mut self.pinned)
    }

    fn lose_place(&self, state: &mut ModalState) {
        state.values.insert(STANDS, Value::unknown(Reason::MotionBefore));
    }

    fn forget_last(&mut self) {
        self.last = None;
    }

    fn is_same(&self, a: &ModalState, b: &ModalState) -> bool {
        a == b
    }

    fn is_recording(&mut self) -> &mut bool {
        &mut self.is_recording
    }

    fn mark(&mut self) -> ResultSizes {
        let (targets, motions, arcs, unknown) = (self.targets.len(), self.motions, self.arcs, self.unknown.len());
        ResultSizes { targets, motions, arcs, unknown, last: self.last, steps: self.steps }
    }

    fn back_to(&mut self, found: ResultSizes) {
        self.targets.truncate(found.targets);
        self.sites.truncate(found.targets);
        self.external.truncate(found.targets);
        self.unknown.truncate(found.unknown);
        (self.motions, self.arcs, self.last) = (found.motions, found.arcs, found.last);
    }

    fn is_too_much(&self, since: ResultSizes) -> bool {
        let (steps, targets) = (self.steps - since.steps, self.targets.len() - since.targets);
        steps > self.most_steps / 4 || targets > self.most_targets / 2
    }
}

impl<'a> Runner<'a> {
    /// Runs the steps of a routine from the present state; the state at its end becomes the present one.
    pub(super) fn walk(&mut self, id: RoutineId) -> Result<(), Stop> {
        let (routines, state) = (self.routines.clone(), std::mem::take(&mut self.state));
        let before: usize = self.symbols.files[..id.file].iter().map(|file| file.routines.len()).sum();
        self.state = deflex_lang::walk::walk(self, &routines, before + id.at, state)?;
        Ok(())
    }

    fn decide(&mut self, test: Test<'a>) -> Result<Option<bool>, Stop> {
        Ok(match test {
            Test::If(condition) => self.evaluate(condition).bool(),
            Test::Round(of) => {
                self.steps += 1;
                let holds = self.evaluate(&of.condition).bool().map(|holds| holds != of.is_until);
                // A condition that nothing in the loop changes never ends it.
                let is_steady = holds == Some(true) && self.is_steady(of);
                if is_steady {
                    self.wait_for(&of.condition);
                }
                holds.filter(|_| !is_steady)
            }
        })
    }

    fn is_steady(&mut self, of: &'a Loop) -> bool {
        let at: *const Loop = of;
        if let Some(known) = self.steady.get(&at) {
            return *known;
        }
        let changes = self.changes_in(&of.body);
        let is_steady = !self.depends(&of.condition, &changes);
        self.steady.insert(at, is_steady);
        is_steady
    }
}
