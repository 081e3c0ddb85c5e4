//! Universal Robots' URScript (`.script`).
//!
//! Lengths are metres, angles radians, orientations rotation vectors. Names belong to a routine unless the program declares them `global`
//! or assigns them outside of all routines. A name that a routine and an enclosing routine both use without a declaration is not followed.

mod builtins;
mod lex;
mod parse;

use crate::dialect::{Arguments, Dialect};
use crate::ir::{Slot, Switch};
use crate::reason::Reason;
use crate::store::Store;
use crate::value::{Affine, AxesOf, Content, Number, Pose, Value};
use builtins::Builtin;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use std::f64::consts::PI;
use std::sync::Arc;

pub use parse::read;

/// The semantics of URScript.
///
/// # Examples
/// ```
/// let text = b"def part():\n  movel(p[0.5, 0.1, 0.2, 0, 3.14, 0], v=0.025)\nend\n";
/// let program = deflex_lang::urscript::read(&[text], 1).unwrap();
/// let outcome = deflex_lang::run::run(&program, &deflex_lang::urscript::UrScript).unwrap();
/// assert_eq!(outcome.motions[0].speed, Some(0.025)); // m/s
/// ```
#[derive(Clone, Copy, Debug)]
pub struct UrScript;

impl Dialect for UrScript {
    fn pose(&self, numbers: &[f64]) -> Option<Isometry3<f64>> {
        let [x, y, z, rx, ry, rz] = *numbers else { return None };
        Some(Isometry3::new(Vector3::new(x, y, z), Vector3::new(rx, ry, rz)))
    }

    fn numbers(&self, pose: &Isometry3<f64>, near: &[f64]) -> Vec<f64> {
        let mut turn = pose.rotation.scaled_axis();
        // The same orientation is a turn by a whole one more or less, about the same axis.
        if let [_, _, _, rx, ry, rz] = *near {
            let near = Vector3::new(rx, ry, rz);
            let axis = turn.try_normalize(1e-9).or_else(|| near.try_normalize(1e-9)).unwrap_or_else(Vector3::x);
            let rounds = ((near - turn).dot(&axis) / (2.0 * PI)).round();
            turn += axis * (2.0 * PI * rounds);
        }
        pose.translation.vector.iter().chain(turn.iter()).copied().collect()
    }

    fn uses_numbers(&self, builtin: u16) -> bool {
        !matches!(builtins::of(builtin), Builtin::Length)
    }

    fn call(&self, builtin: u16, arguments: &Arguments<'_>, store: &mut Store) -> Value {
        let unknown = |reason| Value::unknown(reason).reading(arguments.values());
        let given = |name: &str, at: usize| arguments.get(name, at);
        match builtins::of(builtin) {
            Builtin::Quiet => Content::Nothing.into(),
            Builtin::Reads => unknown(Reason::Input),
            Builtin::Computes => unknown(Reason::Computed),
            Builtin::PoseTrans => match (given("p_from", 0), given("p_from_to", 1)) {
                (Some(from), Some(to)) => trans(from, to),
                _ => unknown(Reason::Computed),
            },
            Builtin::PoseAdd => match (given("p_1", 0), given("p_2", 1)) {
                (Some(one), Some(two)) => add(one, two),
                _ => unknown(Reason::Computed),
            },
            Builtin::PoseInv => match given("p_from", 0).and_then(Value::pose) {
                Some(pose) => constant(pose.pose().inverse()).reading(arguments.values()),
                None => unknown(reason(arguments.values())),
            },
            Builtin::InverseKin => match given("x", 0) {
                Some(Value { content: Content::Pose(pose), reads }) => {
                    let near = given("qnear", 1);
                    let angles = near.and_then(Value::numbers);
                    if near.is_some() != angles.is_some() {
                        return unknown(reason(near));
                    }
                    let pose_of = |tool: &Value| tool.pose().map(Pose::pose);
                    let tool = pose_of(given("tcp", 4).unwrap_or(store.get(Switch::Tool.slot())));
                    if given("tcp", 4).is_some() && tool.is_none() {
                        return unknown(Reason::Tool);
                    }
                    let axes = AxesOf { pose: Arc::clone(pose), near: angles.map(Into::into), tool };
                    let content = Content::AxesOf(Arc::new(axes));
                    Value { content, reads: reads.clone() }.reading(near)
                }
                other => unknown(reason(other)),
            },
            Builtin::Degrees => scaled(given("r", 0), 180.0 / PI),
            Builtin::Radians => scaled(given("d", 0), PI / 180.0),
            Builtin::Length => match arguments.0.first().map(|(_, value)| &value.content) {
                Some(Content::List(items)) => Value::from(Content::Number(Number::constant(items.len() as f64))),
                _ => unknown(Reason::Computed),
            },
            Builtin::Rpy => match arguments.0.first().and_then(|(_, value)| value.numbers()).as_deref() {
                Some(&[roll, pitch, yaw]) => {
                    let turn = UnitQuaternion::from_euler_angles(roll, pitch, yaw).scaled_axis();
                    let items: Vec<Value> = turn.iter().map(|value| computed(*value)).collect();
                    Value::from(Content::List(items.into())).reading(arguments.values())
                }
                _ => unknown(reason(arguments.values())),
            },
            Builtin::Number(of) => match arguments.0.first().and_then(|(_, value)| value.number()) {
                Some(value) if of(value).is_finite() => computed(of(value)).reading(arguments.values()),
                _ => unknown(reason(arguments.values())),
            },
            Builtin::SetTcp => {
                let tool = given("pose", 0).cloned().filter(|tool| tool.pose().is_some() || tool.reason().is_some());
                store.set(Switch::Tool, tool.unwrap_or_else(|| unknown(Reason::Computed)));
                Content::Nothing.into()
            }
            Builtin::SetPayload => {
                // A mass or a centre of gravity that is not given stays what it was. Further arguments are the inertia and a time.
                let before = match &store.get(Switch::Load.slot()).content {
                    Content::List(both) => both.to_vec(),
                    _ => Vec::new(),
                };
                let given: Vec<&Value> = arguments.values().take(2).collect();
                let is_known = given.iter().all(|value| value.number().is_some() || value.numbers().is_some());
                let all = || given.iter().copied().chain(&before);
                let mass = all().find(|value| value.number().is_some());
                let cog = all().find(|value| value.numbers().is_some());
                let both = mass.zip(cog).filter(|_| is_known);
                let load =
                    both.map_or(Content::Nothing, |(mass, cog)| Content::List([mass, cog].map(Clone::clone).into()));
                store.set(Switch::Load, load.into());
                Content::Nothing.into()
            }
            Builtin::Shifts => {
                store.set(Switch::Shift, Value::unknown(Reason::Follows));
                store.lose_place();
                Content::Nothing.into()
            }
            Builtin::Unshifts => {
                store.set(Switch::Shift, Content::Nothing.into());
                store.lose_place();
                Content::Nothing.into()
            }
            Builtin::Stops => {
                store.lose_place();
                Content::Nothing.into()
            }
        }
    }

    fn left_by_foreign(&self) -> &[Switch] {
        &[Switch::Load, Switch::Shift]
    }

    fn writes(&self, builtin: u16) -> &[Slot] {
        const TOOL: [Slot; 1] = [Switch::Tool.slot()];
        const LOAD: [Slot; 1] = [Switch::Load.slot()];
        const SHIFT: [Slot; 1] = [Switch::Shift.slot()];
        match builtins::of(builtin) {
            Builtin::SetTcp => &TOOL,
            Builtin::SetPayload => &LOAD,
            Builtin::Shifts | Builtin::Unshifts => &SHIFT,
            _ => &[],
        }
    }
}

/// Why one of these values is unknown; `Computed` if all are known.
fn reason<'a>(values: impl IntoIterator<Item = &'a Value>) -> Reason {
    values.into_iter().find_map(Value::reason).unwrap_or(Reason::Computed)
}

fn computed(value: f64) -> Value {
    Content::Number(Number { value, exact: false, affine: None }).into()
}

fn constant(pose: Isometry3<f64>) -> Value {
    Content::Pose(Arc::new(Pose::constant(pose))).into()
}

fn scaled(value: Option<&Value>, factor: f64) -> Value {
    let Some(Value { content: Content::Number(number), reads }) = value else {
        return Value::unknown(reason(value)).reading(value);
    };
    let affine = number.affine.map(|of| Affine { scale: of.scale * factor, offset: of.offset * factor, ..of });
    let content = Content::Number(Number { value: number.value * factor, exact: false, affine });
    Value { content, reads: reads.clone() }
}

/// `pose_trans`: the product of two poses. The result keeps the numbers of the inner pose, or those of the outer one if the inner has none.
fn trans(from: &Value, to: &Value) -> Value {
    let (Content::Pose(outer), Content::Pose(inner)) = (&from.content, &to.content) else {
        return Value::unknown(reason([from, to])).reading([from, to]);
    };
    let (pose, reads) = if inner.affine_numbers() > 0 || outer.affine_numbers() == 0 {
        (Pose { left: outer.pose() * inner.left, ..(**inner).clone() }, to.reads.with(&from.all_reads()))
    } else {
        (Pose { right: outer.right * inner.pose(), ..(**outer).clone() }, from.reads.with(&to.all_reads()))
    };
    Value { content: Content::Pose(Arc::new(pose)), reads }
}

/// `pose_add`: the sum of the positions, the product of the turns.
fn add(one: &Value, two: &Value) -> Value {
    let (Content::Pose(first), Content::Pose(second)) = (&one.content, &two.content) else {
        return Value::unknown(reason([one, two])).reading([one, two]);
    };
    let added = second.pose();
    let shift = Isometry3::from_parts(added.translation, UnitQuaternion::identity());
    let turn = Isometry3::from_parts(Translation3::identity(), added.rotation);
    let pose = Pose { left: shift * first.left, right: first.right * turn, ..(**first).clone() };
    Value { content: Content::Pose(Arc::new(pose)), reads: one.reads.with(&two.all_reads()) }
}
