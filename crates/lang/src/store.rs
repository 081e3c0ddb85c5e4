//! The values of all variables at one moment of a run.

use crate::ir::{Slot, SourceSpan, Switch};
use crate::reason::Reason;
use crate::value::{Content, Value};
use std::sync::Arc;

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

/// The end of a motion, with the values that hold there.
///
/// # Examples
/// ```
/// # let (text, program, outcome) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/urscript.rs"));
/// // No path of this program begins anywhere but at the start of the program or at the end of the motion before it.
/// assert!(outcome.motions.iter().all(|moved| moved.begins.is_none()));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct MotionEnd {
    /// The statement of the motion.
    pub place: SourceSpan,
    /// The target.
    pub to: Value,
    /// The value of each [`Switch`].
    pub switches: Arc<[Value; Switch::ALL.len()]>,
}

/// Values of variables. Stores of different paths share them, a few at a time, until one of the stores changes them: a run copies and
/// compares its store at each branch whose condition is unknown, and few variables differ there.
#[derive(Clone, Debug, Default)]
pub(crate) struct Values(Vec<Arc<[Value]>>);

impl Values {
    /// Number of values that are shared together.
    const TOGETHER: usize = 16;

    /// Variables that are unset.
    pub(crate) fn unset(count: usize) -> Self {
        let values = vec![Value::unknown(Reason::Unset); count];
        Self(values.chunks(Self::TOGETHER).map(Arc::from).collect())
    }

    pub(crate) fn len(&self) -> usize {
        self.0.iter().map(|values| values.len()).sum()
    }

    fn get(&self, at: u32) -> &Value {
        let at = at as usize;
        &self.0[at / Self::TOGETHER][at % Self::TOGETHER]
    }

    fn get_mut(&mut self, at: u32) -> &mut Value {
        let at = at as usize;
        &mut Arc::make_mut(&mut self.0[at / Self::TOGETHER])[at % Self::TOGETHER]
    }

    fn join(&mut self, others: &Self) {
        for (own, others) in self.0.iter_mut().zip(&others.0).filter(|(own, others)| !Arc::ptr_eq(own, others)) {
            for (at, other) in others.iter().enumerate() {
                if own[at] != *other {
                    let joined = own[at].join(other);
                    Arc::make_mut(own)[at] = joined;
                }
            }
        }
    }
}

impl PartialEq for Values {
    fn eq(&self, others: &Self) -> bool {
        let is_same = |(own, others): (&Arc<[Value]>, &Arc<[Value]>)| Arc::ptr_eq(own, others) || own == others;
        self.0.len() == others.0.len() && self.0.iter().zip(&others.0).all(is_same)
    }
}

/// The values of all variables, as far as they are known.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Store {
    pub(crate) globals: Values,
    pub(crate) locals: Values,
    pub(crate) stands: Stands,
    /// The end of a motion at which the arm is, as far as all paths agree on it.
    pub(crate) end: Option<Arc<MotionEnd>>,
    /// The value that the routine returns.
    pub(crate) result: Option<Value>,
}

impl Store {
    /// A store in which all variables are unset and the switches are as the controller has them.
    pub(crate) fn new(globals: usize) -> Self {
        let mut store = Self { globals: Values::unset(globals), ..Self::default() };
        for switch in Switch::ALL {
            store.set(switch, Content::Nothing.into());
        }
        store
    }

    /// The value of a variable.
    #[must_use]
    pub fn get(&self, slot: Slot) -> &Value {
        match slot {
            Slot::Global(at) => self.globals.get(at),
            Slot::Local(at) => self.locals.get(at),
        }
    }

    pub(crate) fn get_mut(&mut self, slot: Slot) -> &mut Value {
        match slot {
            Slot::Global(at) => self.globals.get_mut(at),
            Slot::Local(at) => self.locals.get_mut(at),
        }
    }

    /// Sets a switch.
    pub fn set(&mut self, switch: Switch, value: Value) {
        *self.get_mut(switch.slot()) = value;
    }

    /// Makes the position of the arm unknown.
    pub fn lose_place(&mut self) {
        self.stands = Stands::Unknown;
        self.end = None;
    }

    /// Makes a variable unknown. The tokens on which it depends are kept.
    pub(crate) fn lose(&mut self, slot: Slot, reason: Reason) {
        let value = self.get_mut(slot);
        *value = Value { content: Content::Unknown(reason), reads: value.all_reads() };
    }

    /// Joins the values with those of another path.
    pub(crate) fn join(&mut self, other: &Self) {
        self.globals.join(&other.globals);
        self.locals.join(&other.locals);
        if self.stands != other.stands {
            self.stands = Stands::Unknown;
        }
        self.end = self.end.take().filter(|end| other.end.as_ref() == Some(end));
        if self.result != other.result {
            let nothing = || Value::from(Content::Nothing);
            let (own, other) = (self.result.clone().unwrap_or_else(nothing), other.result.clone());
            self.result = Some(own.join(&other.unwrap_or_else(nothing)));
        }
    }
}
