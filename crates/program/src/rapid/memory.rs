//! The values of data: their changes, and the state where two paths meet.

use super::expression::Expression;
use super::known::Changes;
use super::literal::Written;
use super::runner::Runner;
use super::state::{ModalState, Stands, State};
use super::symbols::{Content, Upper};
use super::value::{Pose, Value};
use crate::Reason;
use std::rc::Rc;

impl Runner<'_> {
    /// Changes a variable.
    pub(super) fn set(&mut self, at: usize, value: Value) {
        let variable = &mut self.symbols.variables[at];
        variable.foreign = false;
        let value = match (variable.volatile, value) {
            (Some(why), value) => {
                self.numbers.pin_value(&value);
                Value::Unknown(why)
            }
            (None, Value::Target(pose)) => {
                self.hand_to_handlers(at, &pose);
                Value::Target(pose)
            }
            (None, value) => value,
        };
        self.state.values.insert(at, value);
        self.touch();
    }

    /// Records that a variable holds a robtarget, which the handlers of running routines may read.
    fn hand_to_handlers(&mut self, at: usize, pose: &Pose) {
        self.numbers.holds(at, pose);
        for frame in &self.frames {
            if self.symbols.routine(frame.routine).handlers.is_empty() {
                continue;
            }
            let is_part =
                |own: usize| matches!(&self.symbols.variables[own].content, Content::Part(part) if part.of == at);
            let holds = frame.names.iter().filter(|(_, own)| **own == at || is_part(**own));
            let given = &mut self.numbers.given;
            holds.for_each(|(name, _)| given.entry((frame.routine, name.clone())).or_default().extend(pose.numbers()));
        }
    }

    /// Records that names may have other meanings from here on.
    pub(super) fn touch(&mut self) {
        self.counters.events += 1;
        self.state.version = self.next_version();
    }

    pub(super) fn next_version(&mut self) -> u64 {
        self.counters.versions += 1;
        self.counters.versions
    }

    /// The state in which an operator may start the program: data have the values of the text.
    pub(super) fn begin(&mut self) {
        let mut modal = ModalState { mark: self.mark_at_start, ..ModalState::default() };
        modal.lose(self.others_set());
        self.state = State { modal, version: self.next_version(), ..State::default() };
    }

    /// Joins a state with that of another path. Returns whether anything is less known than before.
    pub(super) fn join_states(&mut self, known: &mut State, other: &State, why: Reason) -> bool {
        let mut is_less = false;
        for at in known.values.apart(&other.values) {
            let (own, others) = (self.value_in(known, at), self.value_in(other, at));
            if own.is(&others) {
                continue;
            }
            let joined = match (&own, &others) {
                (Value::Target(a), Value::Target(b)) if a.is_at(b) => self.joined(&own, &others, why),
                // A later motion may get either value.
                (Value::Target(_), _) | (_, Value::Target(_)) => {
                    for value in [&own, &others] {
                        match value {
                            Value::Target(pose) => self.numbers.holds(at, pose),
                            other => self.numbers.pin_value(other),
                        }
                    }
                    Value::Unknown(own.unknown().or(others.unknown()).unwrap_or(why))
                }
                _ => self.joined(&own, &others, why),
            };
            is_less |= !own.is(&joined);
            known.values.insert(at, joined);
        }
        let modal = known.modal.join(other.modal);
        is_less |= modal != known.modal;
        known.modal = modal;
        if known.stands != other.stands {
            is_less |= known.stands != Stands::Unknown;
            known.stands = Stands::Unknown;
        }
        if known.position != other.position {
            is_less |= known.position.is_some();
            known.position = None;
        }
        let before = known.standing.len();
        known.standing.extend(&other.standing);
        known.version = self.next_version();
        is_less || known.standing.len() > before
    }

    /// Adds the state of another path to those so far.
    pub(super) fn add_state(&mut self, known: &mut Option<State>, other: State) {
        match known {
            Some(known) => drop(self.join_states(known, &other, Reason::Branches)),
            None => *known = Some(other),
        }
    }

    /// The value of a variable in a state.
    pub(super) fn value_in(&mut self, state: &State, at: usize) -> Value {
        state.values.get(at).cloned().unwrap_or_else(|| self.initial(at))
    }

    /// The value of data that hold one value or the other.
    fn joined(&mut self, a: &Value, b: &Value, why: Reason) -> Value {
        match (a, b) {
            (Value::Unknown(why), _) | (_, Value::Unknown(why)) => {
                self.numbers.pin_value(a);
                self.numbers.pin_value(b);
                Value::Unknown(*why)
            }
            #[allow(clippy::float_cmp)] // the very number
            (Value::Num(a, _), Value::Num(b, _)) if a == b => Value::Num(*a, None),
            (Value::List(a, _), Value::List(b, _)) if a.len() == b.len() => {
                let items: Vec<Value> = a.iter().zip(b.iter()).map(|(a, b)| self.joined(a, b, why)).collect();
                Value::List(items.into(), None)
            }
            (Value::Target(a), Value::Target(b)) if a.is_at(b) => {
                Value::Target(Rc::clone(if a.fixed.is_some() { a } else { b }))
            }
            _ if a.is(b) => a.clone(),
            _ => {
                self.numbers.pin_value(a);
                self.numbers.pin_value(b);
                Value::Unknown(why)
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

    /// Makes a variable unknown, or the variable of which it is a part, because something may change it that may also read it.
    pub(super) fn forget_data(&mut self, at: usize, why: Reason) {
        let at = match &self.symbols.variables[at].content {
            Content::Part(part) => part.of,
            _ => at,
        };
        self.numbers.reads(at);
        if let Some(old) = self.lose_data(at, why) {
            self.numbers.pin_value(&old);
        }
    }

    /// Makes a variable unknown, and returns its value if that was known.
    pub(super) fn lose_data(&mut self, at: usize, why: Reason) -> Option<Value> {
        let old = match (self.state.values.get(at), &self.symbols.variables[at].content) {
            // The value already is unknown, yet this counts as a change.
            (Some(Value::Unknown(_)), _) | (None, Content::Is(Value::Unknown(_))) => {
                self.touch();
                return None;
            }
            (Some(value), _) | (None, Content::Is(value)) => value.clone(),
            _ => Value::Unknown(why),
        };
        self.pin_declared(at);
        self.set(at, Value::Unknown(why));
        Some(old)
    }

    /// Forbids edits of data whose value their declaration states: a routine that changes them at run time uses them too.
    pub(super) fn pin_declared(&mut self, at: usize) {
        let variable = &self.symbols.variables[at];
        if let Some(value) = variable.declared.and_then(|data| data.value.as_ref()) {
            self.numbers.pin_text(variable.source, value);
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
            self.numbers.reads(at);
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

impl Value {
    /// Whether two values are identical, with their origin in the text. Numbers are compared bit by bit, because NaN does not equal itself and
    /// a loop would never be found to repeat.
    pub(super) fn is(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Unknown(a), Self::Unknown(b)) => a == b,
            (Self::Num(a, from), Self::Num(b, other)) => a.to_bits() == b.to_bits() && from == other,
            (Self::Bool(a), Self::Bool(b)) => a == b,
            (Self::Text(a), Self::Text(b)) => a == b,
            (Self::List(a, from), Self::List(b, other)) => {
                Rc::ptr_eq(a, b) || from == other && a.len() == b.len() && a.iter().zip(b.iter()).all(|(a, b)| a.is(b))
            }
            (Self::Target(a), Self::Target(b)) => Rc::ptr_eq(a, b) || a.is_at(b) && a.fixed == b.fixed,
            _ => false,
        }
    }
}

impl Pose {
    /// Whether two poses have the same numbers, from the same origin.
    pub(super) fn is_at(&self, other: &Self) -> bool {
        let bits = |pose: &Self| {
            let Written { position_mm: [x, y, z], quat: [q1, q2, q3, q4], external: [a, b, c, d, e, f], .. } =
                pose.written;
            [x, y, z, q1, q2, q3, q4, a, b, c, d, e, f].map(f64::to_bits)
        };
        self.root == other.root
            && self.steps == other.steps
            && self.written.conf == other.written.conf
            && bits(self) == bits(other)
    }
}

impl State {
    /// Forgets the values of variables from this number on, which no longer exist.
    pub(super) fn forget_from(&mut self, first: usize) {
        self.values.truncate(first);
    }

    /// Whether two states are identical, so that everything after them is.
    pub(super) fn is(&self, other: &Self) -> bool {
        self.modal == other.modal
            && self.stands == other.stands
            && self.position == other.position
            && self.standing == other.standing
            && self.values.apart(&other.values).into_iter().all(|at| {
                let both = self.values.get(at).zip(other.values.get(at));
                both.is_some_and(|(a, b)| a.is(b))
            })
    }
}
