//! The interface to the semantics in which languages differ.

use crate::ir::{Given, Slot, Switch};
use crate::reason::Reason;
use crate::store::Store;
use crate::value::{Content, Pose, Value};
use nalgebra::Isometry3;
use std::sync::Arc;

/// The semantics of a language.
///
/// # Examples
/// ```
/// use deflex_lang::{dialect::Dialect, urscript::UrScript};
///
/// // Position in metres, and a rotation vector in radians.
/// let pose = UrScript.pose(&[0.5, 0.1, 0.2, 0.0, 3.14, 0.0]).unwrap();
/// assert_eq!(pose.translation.x, 0.5);
/// assert!(UrScript.pose(&[0.5]).is_none());
/// ```
pub trait Dialect {
    /// The pose with these numbers, lengths in the language's unit; `None` if they are not a pose.
    fn pose(&self, numbers: &[f64]) -> Option<Isometry3<f64>>;

    /// The value of the pose that these numbers are, as far as they are known. `given` has the other parts of the position.
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

    /// The numbers of a pose. If several triples of numbers are the same orientation, those nearest to `near` are returned.
    fn numbers(&self, pose: &Isometry3<f64>, near: &[f64]) -> Vec<f64>;

    /// The value of a call of a routine of the language itself, which may set switches.
    ///
    /// Tokens on which the arguments depend, but not the value, count as used for another purpose.
    fn call(&self, builtin: u16, arguments: &Arguments<'_>, store: &mut Store) -> Value;

    /// Whether a routine of the language itself depends on the numbers in its arguments. The length of a list does not.
    fn uses_numbers(&self, builtin: u16) -> bool {
        let _ = builtin;
        true
    }

    /// The switches that a routine that is not given is assumed not to change (`docs/soundness.md`).
    fn left_by_foreign(&self) -> &[Switch];

    /// The target of a motion after the shift that is in force at [`Switch::Shift`].
    fn shifted(&self, position: Value, shift: &Value) -> Value {
        let _ = shift;
        position
    }

    /// The variables that a call of a routine of the language itself may change.
    fn writes(&self, builtin: u16) -> &[Slot];
}

/// Arguments of a call.
///
/// # Examples
/// ```
/// use deflex_lang::{dialect::Arguments, value::{Content, Value}};
///
/// let values = [(None, Value::from(Content::Truth(true)))];
/// assert_eq!(Arguments(&values).0.len(), 1);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Arguments<'a>(pub &'a [(Option<Arc<str>>, Value)]);

impl<'a> Arguments<'a> {
    /// The argument with this name, or else the one at this index among those without a name.
    #[must_use]
    pub(crate) fn get(self, name: &str, at: usize) -> Option<&'a Value> {
        let named = self.0.iter().find(|(given, _)| given.as_deref() == Some(name));
        named.or_else(|| self.0.iter().filter(|(given, _)| given.is_none()).nth(at)).map(|(_, value)| value)
    }

    /// All values.
    pub(crate) fn values(self) -> impl Iterator<Item = &'a Value> {
        self.0.iter().map(|(_, value)| value)
    }
}
