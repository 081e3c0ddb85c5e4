//! What is known at one moment of a run.

use crate::ir::{Slot, Switch};
use crate::reason::Reason;
use crate::value::{Content, Value};

/// Where the arm is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Stands {
    /// Where the program found it.
    #[default]
    Start,
    /// At the end of the motion with this site, a statement in a chain of calls.
    At(u32),
    /// It is known only at run time.
    Unknown,
}

/// What every variable holds, as far as it is known.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Store {
    pub(crate) globals: Vec<Value>,
    pub(crate) locals: Vec<Value>,
    pub(crate) stands: Stands,
    /// What the routine returns.
    pub(crate) result: Option<Value>,
}

impl Store {
    /// Nothing but switches as the controller has them.
    pub(crate) fn new(globals: usize) -> Self {
        let mut store = Self { globals: vec![Value::unknown(Reason::Unset); globals], ..Self::default() };
        for switch in Switch::ALL {
            store.set(switch, Content::Nothing.into());
        }
        store
    }

    /// What a variable holds.
    #[must_use]
    pub fn get(&self, slot: Slot) -> &Value {
        match slot {
            Slot::Global(at) => &self.globals[at as usize],
            Slot::Local(at) => &self.locals[at as usize],
        }
    }

    pub(crate) fn get_mut(&mut self, slot: Slot) -> &mut Value {
        match slot {
            Slot::Global(at) => &mut self.globals[at as usize],
            Slot::Local(at) => &mut self.locals[at as usize],
        }
    }

    /// Sets a switch.
    pub fn set(&mut self, switch: Switch, value: Value) {
        *self.get_mut(switch.slot()) = value;
    }

    /// The arm may stand anywhere.
    pub fn lose_place(&mut self) {
        self.stands = Stands::Unknown;
    }

    /// What of a variable is known is lost; what it depends on is not.
    pub(crate) fn lose(&mut self, slot: Slot, reason: Reason) {
        let value = self.get_mut(slot);
        *value = Value { content: Content::Unknown(reason), reads: value.all_reads() };
    }

    /// What holds where either of two stores may.
    pub(crate) fn join(&mut self, other: &Self) {
        let both = |own: &mut Vec<Value>, others: &[Value]| {
            for (own, other) in own.iter_mut().zip(others) {
                if own != other {
                    *own = own.join(other);
                }
            }
        };
        both(&mut self.globals, &other.globals);
        both(&mut self.locals, &other.locals);
        if self.stands != other.stands {
            self.stands = Stands::Unknown;
        }
        if self.result != other.result {
            let nothing = || Value::from(Content::Nothing);
            let (own, other) = (self.result.clone().unwrap_or_else(nothing), other.result.clone());
            self.result = Some(own.join(&other.unwrap_or_else(nothing)));
        }
    }
}
