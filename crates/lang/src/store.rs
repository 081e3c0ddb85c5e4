//! The values of all variables at one moment of a run.

use crate::ir::{Slot, Switch};
use crate::reason::Reason;
use crate::value::{Content, Value};

/// Where the arm is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Stands {
    /// Where it was when the program began.
    #[default]
    Start,
    /// At the end of the motion of this site (a statement in a chain of calls).
    At(u32),
    /// Known only at run time.
    Unknown,
}

/// The values of all variables, as far as they are known.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Store {
    pub(crate) globals: Vec<Value>,
    pub(crate) locals: Vec<Value>,
    pub(crate) stands: Stands,
    /// The value that the routine returns.
    pub(crate) result: Option<Value>,
}

impl Store {
    /// A store in which all variables are unset and the switches are as the controller has them.
    pub(crate) fn new(globals: usize) -> Self {
        let mut store = Self { globals: vec![Value::unknown(Reason::Unset); globals], ..Self::default() };
        for switch in Switch::ALL {
            store.set(switch, Content::Nothing.into());
        }
        store
    }

    /// The value of a variable.
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

    /// Makes the position of the arm unknown.
    pub fn lose_place(&mut self) {
        self.stands = Stands::Unknown;
    }

    /// Makes a variable unknown. The tokens on which it depends are kept.
    pub(crate) fn lose(&mut self, slot: Slot, reason: Reason) {
        let value = self.get_mut(slot);
        *value = Value { content: Content::Unknown(reason), reads: value.all_reads() };
    }

    /// Joins the values with those of another path.
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
