//! The values of data, branch by branch. Before the next branch runs, the changes of the last are undone; at the end, the states
//! that the branches leave are joined.

use super::expression::Expression;
use super::known::Changes;
use super::layers::{EndState, Layer};
use super::runner::Runner;
use super::state::ModalState;
use super::symbols::{Content, Upper};
use super::value::Value;
use crate::Reason;
use std::collections::{BTreeMap, BTreeSet};

/// Most returns of one routine that are kept apart; further ones are joined.
const MOST_RETURNS: usize = 8;

impl Runner<'_> {
    /// Changes a variable.
    pub(super) fn set(&mut self, at: usize, value: Value) {
        self.assigns(at);
        (self.counters.epoch, self.counters.events) = (self.counters.epoch + 1, self.counters.events + 1);
        let variable = &mut self.symbols.variables[at];
        variable.foreign = false;
        let value = variable.volatile.map_or(value, Value::Unknown);
        let same = matches!(&variable.content, Content::Is(old) if old.is(&value));
        self.counters.changes += u64::from(!same);
        let old = std::mem::replace(&mut variable.content, Content::Is(value));
        match self.layers.last_mut() {
            Some(layer) if at < layer.variables => drop(layer.old.entry(at).or_insert(old)),
            None if at < self.symbols.data => drop(self.before_all.entry(at).or_insert(old)),
            _ => {}
        }
    }

    /// Undoes all changes so far: data have the values of the text.
    pub(super) fn begin_again(&mut self) {
        for (at, old) in std::mem::take(&mut self.before_all) {
            self.symbols.variables[at].content = old;
        }
        self.state = ModalState::default();
        (self.counters.epoch, self.counters.events) = (self.counters.epoch + 1, self.counters.events + 1);
    }

    /// Begins a branch.
    pub(super) fn open(&mut self) {
        let (old, variables) = (BTreeMap::new(), self.symbols.variables.len());
        self.layers.push(Layer { old, state: self.state, variables });
    }

    /// Ends a branch and undoes its changes.
    pub(super) fn take(&mut self) -> EndState {
        let mut left = EndState { changed: BTreeMap::new(), state: self.state };
        let Some(layer) = self.layers.pop() else { return left };
        for (at, old) in layer.old {
            if let Some(variable) = self.symbols.variables.get_mut(at)
                && let Content::Is(value) = std::mem::replace(&mut variable.content, old)
            {
                left.changed.insert(at, value);
            }
        }
        self.state = layer.state;
        self.counters.epoch += 1;
        left
    }

    /// Ends a branch without alternative and keeps its changes.
    pub(super) fn commit(&mut self) {
        let Some(layer) = self.layers.pop() else { return };
        let (below, most) = match self.layers.last_mut() {
            Some(below) => (&mut below.old, below.variables),
            None => (&mut self.before_all, self.symbols.data),
        };
        for (at, old) in layer.old {
            if at < most {
                below.entry(at).or_insert(old);
            }
        }
    }

    /// The changes since a layer began; the layer stays open.
    pub(super) fn since(&self, layer: usize) -> EndState {
        let layers = self.layers.get(layer..).unwrap_or_default();
        let most = layers.first().map_or(0, |layer| layer.variables);
        let keys: BTreeSet<usize> =
            layers.iter().flat_map(|layer| layer.old.keys().copied()).filter(|at| *at < most).collect();
        let value = |at: usize| match &self.symbols.variables[at].content {
            Content::Is(value) => Some((at, value.clone())),
            _ => None,
        };
        EndState { changed: keys.into_iter().filter_map(value).collect(), state: self.state }
    }

    /// Continues from the state that a branch left.
    pub(super) fn apply(&mut self, left: EndState) {
        for (at, value) in left.changed {
            self.set(at, value);
        }
        self.state = left.state;
    }

    /// Joins the states that two branches leave; the state before them is in force.
    pub(super) fn join(&mut self, a: EndState, b: EndState) -> EndState {
        let keys: BTreeSet<usize> = a.changed.keys().chain(b.changed.keys()).copied().collect();
        let state = a.state.join(b.state);
        let mut changed = BTreeMap::new();
        for at in keys {
            let [a, b] = [&a, &b].map(|left| match left.changed.get(&at) {
                Some(value) => value.clone(),
                None => self.content(at),
            });
            let value = self.joined(&a, &b);
            changed.insert(at, value);
        }
        EndState { changed, state }
    }

    /// The value of data that hold one value or the other.
    fn joined(&mut self, a: &Value, b: &Value) -> Value {
        match (a, b) {
            (Value::Unknown(why), _) | (_, Value::Unknown(why)) => {
                self.numbers.pin_value(a);
                self.numbers.pin_value(b);
                Value::Unknown(*why)
            }
            #[allow(clippy::float_cmp)] // the very number
            (Value::Num(a, _), Value::Num(b, _)) if a == b => Value::Num(*a, None),
            (Value::Bool(a), Value::Bool(b)) if a == b => Value::Bool(*a),
            (Value::Text(a), Value::Text(b)) if a == b => Value::Text(std::rc::Rc::clone(a)),
            (Value::List(a, _), Value::List(b, _)) if a.len() == b.len() => {
                let items: Vec<Value> = a.iter().zip(b.iter()).map(|(a, b)| self.joined(a, b)).collect();
                Value::List(items.into(), None)
            }
            (Value::Target(a), Value::Target(b))
                if a.root == b.root && a.written == b.written && a.steps == b.steps =>
            {
                Value::Target(std::rc::Rc::clone(a))
            }
            _ => {
                self.numbers.pin_value(a);
                self.numbers.pin_value(b);
                Value::Unknown(Reason::Branches)
            }
        }
    }

    /// Makes unknown everything that may have changed.
    pub(super) fn forget(&mut self, changes: &Changes, why: Reason) {
        for &at in &changes.data {
            self.forget_data(at, why);
        }
        if changes.anything {
            let everything = self.symbols.everything();
            for &at in everything.iter() {
                self.forget_data(at, why);
            }
        }
        for name in &changes.own {
            if let Some(at) = self.frames.last().and_then(|frame| frame.names.get(name)).copied() {
                self.forget_data(at, why);
            }
        }
    }

    /// Makes a variable unknown, or the variable of which it is a part.
    pub(super) fn forget_data(&mut self, at: usize, why: Reason) {
        let at = match &self.symbols.variables[at].content {
            Content::Part(part) => part.of,
            Content::Is(Value::Unknown(_)) => {
                // The value already is unknown, yet this counts as a change.
                (self.counters.epoch, self.counters.events) = (self.counters.epoch + 1, self.counters.events + 1);
                return;
            }
            _ => at,
        };
        self.pin_declared(at);
        let old = match &self.symbols.variables[at].content {
            Content::Is(value) => value.clone(),
            _ => Value::Unknown(why),
        };
        self.numbers.pin_value(&old);
        self.set(at, Value::Unknown(why));
    }

    /// Forbids edits of data whose value their declaration states: a routine that changes them at run time uses them too.
    pub(super) fn pin_declared(&mut self, at: usize) {
        let variable = &self.symbols.variables[at];
        if let Some(value) = variable.declared.and_then(|data| data.value.as_ref()) {
            let inside = self.numbers.literals_in(variable.source, value);
            self.numbers.pinned.extend(inside);
        }
    }

    /// The same for a read at an unknown moment: the data from which it takes its value must not be edited either.
    pub(super) fn pin_read(&mut self, at: usize) {
        let mut waiting = vec![at];
        while let Some(at) = waiting.pop() {
            if !self.numbers.pinned_data.insert(at) {
                continue;
            }
            self.pin_declared(at);
            let variable = &self.symbols.variables[at];
            let Some(value) = variable.declared.and_then(|data| data.value.as_ref()) else { continue };
            let bytes = self.bytes(usize::from(variable.source));
            value.each(&mut |part: &Expression| {
                if part.is_name() {
                    let name = Upper::new(&bytes[part.span.range()]);
                    waiting.extend(self.symbols.find_data(variable.module, &name));
                }
            });
        }
    }
}

/// Notes a further state; too many are joined into one, in which differing values are unknown.
pub(super) fn note(states: &mut Vec<EndState>, left: EndState) {
    states.push(left);
    if states.len() > MOST_RETURNS {
        let mut all = states.drain(..);
        let Some(first) = all.next() else { return };
        let mut changed: BTreeMap<usize, Value> = first.changed;
        let mut state = first.state;
        for other in all.by_ref() {
            state = state.join(other.state);
            for at in other.changed.keys() {
                changed.insert(*at, Value::Unknown(Reason::Computed));
            }
            changed.values_mut().for_each(|value| *value = Value::Unknown(Reason::Computed));
        }
        drop(all);
        states.push(EndState { changed, state });
    }
}
