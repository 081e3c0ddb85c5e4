//! The state at a place of the program: the values of data that differ from their start values, by number.

use super::symbols::{Id, POSITION, RoutineId};
use super::value::{Name, Value};
use crate::Reason;
use deflex_lang::ir::SourceSpan;
use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::rc::Rc;

/// The changes that some statements could make.
#[derive(Clone, Debug, Default)]
pub(super) struct Changes {
    /// Data that may change as a whole.
    pub(super) ids: BTreeSet<Id>,
    /// Components that may change of records, or of the records in arrays.
    pub(super) components: BTreeSet<(Id, Name)>,
    /// Whether everything may change that other files see, including base and tool.
    pub(super) anything: bool,
    /// Routines that were scanned.
    pub(super) through: BTreeSet<RoutineId>,
}

impl Changes {
    /// The data that may change, as a whole or in part.
    pub(super) fn all_ids(&self) -> impl Iterator<Item = Id> {
        self.ids.iter().copied().chain(self.components.iter().map(|(id, _)| *id))
    }
}

/// The state of the run. Data without a value here have their start values.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct ModalState {
    pub(super) values: BTreeMap<Id, Value>,
    /// Data that may change at any moment from here on: those that a TRIGGER changes, and those that depend on where the robot stands.
    pub(super) loose: Rc<BTreeSet<Id>>,
    /// Whether the program continues if the next statement fails.
    pub(super) proceeds: bool,
}

impl ModalState {
    /// The value of a variable.
    pub(super) fn at<'s>(&'s self, id: Id, start: &'s [Value]) -> &'s Value {
        self.values.get(&id).or_else(|| start.get(id)).unwrap_or(&Value::Unknown(Reason::Unset, None))
    }

    /// Joins it with the state on another path. Tokens of values that differ go to `lost`, except for those of the last position, which
    /// only a motion without some components uses. Returns whether anything is less known than before.
    pub(super) fn join(&mut self, other: &Self, start: &[Value], why: Reason, lost: &mut HashSet<SourceSpan>) -> bool {
        let mut is_less = other.proceeds && !self.proceeds || !self.loose.is_superset(&other.loose);
        let ids: Vec<Id> = self.values.keys().chain(other.values.keys()).copied().collect();
        for id in ids {
            let (own, others) = (self.at(id, start), other.at(id, start));
            if own != others {
                let joined = if id == POSITION { own.either(others, why, lost) } else { own.join(others, why, lost) };
                is_less |= *own != joined;
                self.values.insert(id, joined);
            }
        }
        self.proceeds |= other.proceeds;
        self.loosen(other.loose.iter().copied());
        is_less
    }

    /// Records that data may change at any moment from here on.
    pub(super) fn loosen(&mut self, ids: impl IntoIterator<Item = Id>) {
        for id in ids {
            if !self.loose.contains(&id) {
                Rc::make_mut(&mut self.loose).insert(id);
            }
        }
    }

    /// Forgets data that no longer exist.
    pub(super) fn tighten(&mut self, ended: &HashSet<Id>) {
        if self.loose.iter().any(|id| ended.contains(id)) {
            Rc::make_mut(&mut self.loose).retain(|id| !ended.contains(id));
        }
    }
}
