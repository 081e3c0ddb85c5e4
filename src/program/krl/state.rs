//! What may hold at a place of the program: values of data by number, those that differ from what the text says.

use super::symbols::RoutineId;
use super::value::{NumberToken, Value};
use crate::program::Reason;
use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::rc::Rc;

/// Number of a variable.
pub(super) type Id = usize;

/// Variables that may be changed.
#[derive(Clone, Debug, Default)]
pub(super) struct Changes {
    pub(super) ids: BTreeSet<Id>,
    /// All that other files see, base and tool among it.
    pub(super) anything: bool,
    /// Routines that were looked through.
    pub(super) through: BTreeSet<RoutineId>,
}

/// What holds; data that are not in it hold what they hold at the start.
#[derive(Clone, Debug, Default)]
pub(super) struct ModalState {
    pub(super) values: BTreeMap<Id, Value>,
    /// Data that may change at any moment from here on: what a TRIGGER may, and what is counted from where the robot stands.
    pub(super) loose: Rc<BTreeSet<Id>>,
    /// The next statement may fail, and the program goes on after it.
    pub(super) proceeds: bool,
}

impl ModalState {
    /// What a variable holds.
    pub(super) fn at<'s>(&'s self, id: Id, start: &'s [Value]) -> &'s Value {
        self.values.get(&id).or_else(|| start.get(id)).unwrap_or(&Value::Unknown(Reason::Unset, None))
    }

    /// The same values from the same tokens.
    pub(super) fn is(&self, other: &Self) -> bool {
        let (own, others) = (self.values.iter().rev(), other.values.iter().rev());
        // From the last, since data of routines, and counters among them, change more often than those of files.
        (self.proceeds, &self.loose) == (other.proceeds, &other.loose)
            && self.values.len() == other.values.len()
            && own.zip(others).all(|(own, other)| own.0 == other.0 && own.1.is(other.1))
    }

    /// Whether all that is known here holds there as well.
    pub(super) fn covers(&self, other: &Self, start: &[Value]) -> bool {
        let ids = self.values.keys().chain(other.values.keys().filter(|id| !self.values.contains_key(id)));
        (self.proceeds || !other.proceeds)
            && (Rc::ptr_eq(&self.loose, &other.loose) || self.loose.is_superset(&other.loose))
            && ids.into_iter().all(|id| self.at(*id, start).covers(other.at(*id, start)))
    }

    /// Reduces it to what holds where either may; tokens of what differs go to `lost`, but those of the position of this number, of which
    /// only a motion that leaves components out has any use.
    pub(super) fn join(
        &mut self,
        other: &Self,
        start: &[Value],
        position: Id,
        why: Reason,
        lost: &mut HashSet<NumberToken>,
    ) {
        let mut join =
            |id: Id, a: &Value, b: &Value| if id == position { a.either(b, why, lost) } else { a.join(b, why, lost) };
        for (id, value) in &other.values {
            let joined = join(*id, self.at(*id, start), value);
            self.values.insert(*id, joined);
        }
        for (id, value) in &mut self.values {
            if !other.values.contains_key(id) {
                *value = join(*id, value, other.at(*id, start));
            }
        }
        self.proceeds |= other.proceeds;
        if !Rc::ptr_eq(&self.loose, &other.loose) {
            self.loosen(other.loose.iter().copied());
        }
    }

    /// Data may change at any moment from here on.
    pub(super) fn loosen(&mut self, ids: impl IntoIterator<Item = Id>) {
        for id in ids {
            if !self.loose.contains(&id) {
                Rc::make_mut(&mut self.loose).insert(id);
            }
        }
    }

    /// Data end, and with them what is said of them.
    pub(super) fn tighten(&mut self, ended: &HashSet<Id>) {
        if self.loose.iter().any(|id| ended.contains(id)) {
            Rc::make_mut(&mut self.loose).retain(|id| !ended.contains(id));
        }
    }
}
