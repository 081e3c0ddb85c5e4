//! Branches and loops.

use super::run::{Flow, Runner, VALUES_PER_STEP};
use super::state::{Id, ModalState};
use super::tree::{For, Loop, Statement, Switch};
use super::value::Value;
use crate::program::Reason;
use crate::text::Span;

/// A WHILE that goes round more often is taken for one whose end is known only at run time.
pub(super) const MAX_ROUNDS: usize = 100_000;

impl<'a> Runner<'a> {
    /// What holds where any of these may.
    pub(super) fn joined(&mut self, states: Vec<ModalState>) -> Option<ModalState> {
        let mut states = states.into_iter();
        let first = states.next()?;
        let (start, position, pinned) = (&self.symbols.start, self.symbols.position, &mut self.pinned);
        Some(states.fold(first, |all, state| {
            all.join(&state, start, position, &mut |place| {
                pinned.insert(place);
            })
        }))
    }

    /// Every branch from what holds before all of them, since any may be the one that runs.
    pub(super) fn branches(&mut self, branches: &[&'a [Statement]]) -> Flow {
        let before = std::mem::take(&mut self.state);
        self.steps += before.values.len() / VALUES_PER_STEP;
        let mut left = Vec::new();
        for branch in branches {
            self.state = before.clone();
            if self.block(branch) == Flow::Next {
                left.push(std::mem::take(&mut self.state));
            }
        }
        self.go_on(left)
    }

    /// Goes on with what holds where any of these may.
    pub(super) fn go_on(&mut self, left: Vec<ModalState>) -> Flow {
        match self.joined(left) {
            Some(state) => {
                self.state = state;
                Flow::Next
            }
            None => Flow::Gone,
        }
    }

    pub(super) fn choice(&mut self, Switch { subject, cases, otherwise }: &'a Switch) -> Flow {
        let subject = self.evaluate(subject);
        for (i, (values, body)) in cases.iter().enumerate() {
            match self.is_among(&subject, values) {
                Some(true) => return self.block(body),
                Some(false) => {}
                None => {
                    let rest: Vec<&'a [Statement]> =
                        cases[i..].iter().map(|(_, b)| &b[..]).chain([&otherwise[..]]).collect();
                    return self.branches(&rest);
                }
            }
        }
        self.block(otherwise)
    }

    pub(super) fn counted(&mut self, For { variable, from, to, step, body }: &'a For, place: Span) -> Flow {
        let [from, to] = [from, to].map(|bound| self.evaluate(bound).index());
        let step = step.as_ref().map_or(Some(1), |step| self.evaluate(step).index()).filter(|step| *step != 0);
        let counter = self.resolve(&variable.name);
        let (Some(from), Some(to), Some(step)) = (from, to, step) else {
            return self.rounds(body, Some(counter));
        };
        let most = i64::try_from(self.most_steps).unwrap_or(i64::MAX);
        if (to - from) / step > most || self.volatile.contains(&counter) {
            return self.rounds(body, Some(counter));
        }
        self.loops.push(Vec::new());
        let mut at = from;
        let mut flow = Flow::Next;
        while flow == Flow::Next && if step > 0 { at <= to } else { at >= to } {
            #[allow(clippy::cast_precision_loss)]
            self.state.values.insert(counter, Value::Number(at as f64, None));
            self.steps += 1;
            flow = self.block(body);
            // The body may set its own counter.
            let counted = self.value(counter).index();
            match counted {
                Some(counted) => at = counted + step,
                None if flow == Flow::Next => {
                    flow = self.rounds(body, Some(counter));
                    break;
                }
                None => {}
            }
            if self.steps > self.most_steps {
                flow = self.give_up(place);
            }
        }
        let mut left = self.loops.pop().unwrap_or_default();
        if flow == Flow::Next {
            self.state.values.insert(counter, Value::unknown(Reason::CounterAfterLoop));
            left.push(std::mem::take(&mut self.state));
        }
        self.go_on(left)
    }

    pub(super) fn repeat(&mut self, Loop { condition, is_behind, body }: &'a Loop) -> Flow {
        let Some(condition) = condition else { return self.rounds(body, None) };
        let changes = self.changes_in(body);
        // A condition that nothing in the loop changes never ends it.
        let steady = !self.depends(condition, &changes);
        let (before, targets) = (self.state.clone(), self.marker());
        self.loops.push(Vec::new());
        let mut rounds = 0;
        let flow = loop {
            let looked = if *is_behind && rounds == 0 {
                Some(true)
            } else {
                let holds = self.evaluate(condition).bool();
                if *is_behind { holds.map(|end| !end) } else { holds }
            };
            match looked {
                Some(false) => break Some(Flow::Next),
                Some(true) if rounds < MAX_ROUNDS && !(steady && rounds > 0) => {}
                _ => break None,
            }
            rounds += 1;
            if self.block(body) == Flow::Gone {
                break Some(Flow::Gone);
            }
        };
        let mut left = self.loops.pop().unwrap_or_default();
        match flow {
            Some(flow) => {
                if flow == Flow::Next {
                    left.push(std::mem::take(&mut self.state));
                }
                self.go_on(left)
            }
            None => {
                // Known for some rounds, and then no more: taken as one whose rounds are not known at all.
                self.state = before;
                self.back_to(targets);
                self.rounds(body, None)
            }
        }
    }

    /// Rounds of a number that is not known: one, from what holds whenever one begins.
    pub(super) fn rounds(&mut self, body: &'a [Statement], counter: Option<Id>) -> Flow {
        let mut changes = self.changes_in(body);
        changes.ids.extend(counter);
        self.forget(&changes, Reason::Loop);
        loop {
            let (before, targets, volatile) = (self.state.clone(), self.marker(), self.volatile.len());
            let partials = self.open_partials;
            self.loops.push(Vec::new());
            let flow = self.block(body);
            let mut left = self.loops.pop().unwrap_or_default();
            if flow == Flow::Next {
                if self.open_partials > partials {
                    // The motion before may be the last one of a round.
                    let last = self.value(self.symbols.position);
                    self.pin(&last);
                }
                let holds = before.covers(&self.state, &self.symbols.start) && volatile == self.volatile.len();
                self.steps += 1 + before.values.len() / VALUES_PER_STEP;
                if !holds && self.steps > self.most_steps {
                    return self.give_up(body.first().map(|first| first.at).unwrap_or_default());
                }
                if !holds {
                    // What a round leaves is what another begins with: once more, with what holds in both.
                    let behind = std::mem::take(&mut self.state);
                    self.state = self.joined(vec![before, behind]).unwrap_or_default();
                    self.back_to(targets);
                    continue;
                }
                left.push(std::mem::take(&mut self.state));
            }
            left.push(before);
            let flow = self.go_on(left);
            self.forget(&changes, Reason::Loop);
            return flow;
        }
    }

    /// How much was found so far.
    pub(super) fn marker(&self) -> (usize, u32, usize, usize) {
        (self.targets.len(), self.motions, self.arcs, self.unknown.len())
    }

    pub(super) fn back_to(&mut self, (targets, motions, arcs, unknown): (usize, u32, usize, usize)) {
        self.targets.truncate(targets);
        self.sites.truncate(targets);
        self.external.truncate(targets);
        self.unknown.truncate(unknown);
        (self.motions, self.arcs) = (motions, arcs);
    }
}
