//! What a language means where languages differ.

use crate::ir::{Given, Slot, Switch};
use crate::reason::Reason;
use crate::store::Store;
use crate::value::{Content, Pose, Value};
use nalgebra::Isometry3;
use std::sync::Arc;

/// The semantics of a language.
pub trait Dialect {
    /// The pose that these numbers are, lengths in the language's unit; `None` where they are no pose.
    fn pose(&self, numbers: &[f64]) -> Option<Isometry3<f64>>;

    /// The value of the pose that these numbers are, as far as they are known. `given` is what the position names besides them.
    fn pose_value(&self, numbers: Vec<Value>, given: Option<Arc<Given>>) -> Value {
        let mut known = Vec::with_capacity(numbers.len());
        for value in &numbers {
            match &value.content {
                Content::Number(number) => known.push(number.value),
                Content::Unknown(reason) => return Value::unknown(*reason).reading(&numbers),
                _ => return Value::unknown(Reason::Computed).reading(&numbers),
            }
        }
        let Some(own) = self.pose(&known) else { return Value::unknown(Reason::Computed).reading(&numbers) };
        let identity = Isometry3::identity();
        Content::Pose(Arc::new(Pose { left: identity, numbers: numbers.into(), own, right: identity, given })).into()
    }

    /// The numbers of a pose, those of the ways to write it that are nearest to others.
    fn numbers(&self, pose: &Isometry3<f64>, near: &[f64]) -> Vec<f64>;

    /// The value of a call of the language's own routine, which may set switches.
    ///
    /// Tokens that the arguments depend on and the value does not count as used for something else.
    fn call(&self, builtin: u16, arguments: &Arguments<'_>, store: &mut Store) -> Value;

    /// What a routine that is not given is taken to leave as it is (`docs/soundness.md`).
    fn left_by_foreign(&self) -> &[Switch];

    /// A position that a motion goes to, as what is in force at [`Switch::Shift`] moves it aside.
    fn shifted(&self, position: Value, shift: &Value) -> Value {
        let _ = shift;
        position
    }

    /// The variables that a call of the language's own routine may change.
    fn writes(&self, builtin: u16) -> &[Slot];
}

/// Arguments of a call.
#[derive(Clone, Copy, Debug)]
pub struct Arguments<'a>(pub &'a [(Option<Arc<str>>, Value)]);

impl<'a> Arguments<'a> {
    /// The argument with this name, else the one at this place among those without a name.
    #[must_use]
    pub fn get(self, name: &str, at: usize) -> Option<&'a Value> {
        let named = self.0.iter().find(|(given, _)| given.as_deref() == Some(name));
        named.or_else(|| self.0.iter().filter(|(given, _)| given.is_none()).nth(at)).map(|(_, value)| value)
    }

    /// All values.
    pub fn values(self) -> impl Iterator<Item = &'a Value> {
        self.0.iter().map(|(_, value)| value)
    }
}
