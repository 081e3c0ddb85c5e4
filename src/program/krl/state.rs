//! What may hold at a place of the program: values of data by number, those that differ from what the text says.

use super::symbols::RoutineId;
use super::value::{NumberToken, Value};
use crate::program::Reason;
use std::collections::{BTreeMap, BTreeSet};

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
}

impl ModalState {
    /// Whether all that is known here holds there as well.
    pub(super) fn covers(&self, other: &Self, start: &[Value]) -> bool {
        let missing = Value::unknown(Reason::Unset);
        let at = |state: &'_ Self, id: Id| state.values.get(&id).or_else(|| start.get(id)).unwrap_or(&missing).clone();
        let ids = self.values.keys().chain(other.values.keys().filter(|id| !self.values.contains_key(id)));
        ids.into_iter().all(|id| at(self, *id).covers(&at(other, *id)))
    }

    /// What holds where either may; tokens of what differs go to `lost`, but those of the position of this number, of which
    /// only a motion that leaves components out has any use.
    pub(super) fn join(
        mut self,
        other: &Self,
        start: &[Value],
        position: Id,
        lost: &mut impl FnMut(NumberToken),
    ) -> Self {
        let missing = Value::unknown(Reason::Unset);
        let at_start = |id: Id| start.get(id).unwrap_or(&missing);
        let mut join = |id: Id, a: &Value, b: &Value| if id == position { a.either(b, lost) } else { a.join(b, lost) };
        for (id, value) in &other.values {
            let own = self.values.get(id).unwrap_or_else(|| at_start(*id));
            let joined = join(*id, own, value);
            self.values.insert(*id, joined);
        }
        for (id, value) in &mut self.values {
            if !other.values.contains_key(id) {
                *value = join(*id, value, at_start(*id));
            }
        }
        self
    }
}
