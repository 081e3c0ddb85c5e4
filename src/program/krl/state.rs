//! What may hold at a place of the program: values of data by number, those that differ from what the text says.

use super::symbols::{Id, RoutineId};
use super::value::Value;
use crate::program::Reason;
use deflex_lang::ir::SourceSpan;
use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::rc::Rc;

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
#[derive(Clone, Debug, Default, PartialEq, Eq)]
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

    /// Reduces it to what holds where either may; tokens of what differs go to `lost`, but those of the position of this number, of which
    /// only a motion that leaves components out has any use. Whether anything is less known than before.
    pub(super) fn join(
        &mut self,
        other: &Self,
        start: &[Value],
        position: Id,
        why: Reason,
        lost: &mut HashSet<SourceSpan>,
    ) -> bool {
        let mut is_less = other.proceeds && !self.proceeds || !self.loose.is_superset(&other.loose);
        let ids: Vec<Id> = self.values.keys().chain(other.values.keys()).copied().collect();
        for id in ids {
            let (own, others) = (self.at(id, start), other.at(id, start));
            if own != others {
                let joined = if id == position { own.either(others, why, lost) } else { own.join(others, why, lost) };
                is_less |= *own != joined;
                self.values.insert(id, joined);
            }
        }
        self.proceeds |= other.proceeds;
        self.loosen(other.loose.iter().copied());
        is_less
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
