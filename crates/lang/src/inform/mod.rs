//! Yaskawa's INFORM, as controllers write their jobs (`.JBI`).
//!
//! Lengths are millimetres and angles degrees, about the fixed axes x, y, z in this order: `R = Rz·Ry·Rx` (Roboception, *rc_visard* manual,
//! *Yaskawa Pose Format*). A position names its tool and its frame. Positions in motor pulses are not read: how many pulses a degree has is
//! a parameter of the controller. Position variables (`P012`) keep their values from run to run, so that one is known if no given job
//! writes it, or after a job has written it in the same run.
//!
//! A circle is three consecutive `MOVC`: the path to the first point is a line. Sources: Yaskawa, *NX100 / DX100 Data Transmission
//! Function* (job data format); *YRC1000 Options, Instructions: INFORM Language*.

mod assign;
mod expression;
mod flow;
mod header;
mod lex;
mod motion;
mod parse;
mod parser;
mod words;

use crate::dialect::{Arguments, Dialect};
use crate::ir::{Given, Slot, Switch};
use crate::reason::Reason;
use crate::store::Store;
use crate::value::{Content, Number, Pose, Value, is_whole};
use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use std::sync::Arc;

pub use header::ROBOT;
pub use parse::read;

/// The semantics of INFORM.
///
/// # Examples
/// ```
/// use deflex_lang::{dialect::Dialect, inform::Inform};
///
/// // Position in millimetres, and angles about x, y and z in degrees.
/// let pose = Inform.pose(&[500.0, 0.0, 200.0, 180.0, 0.0, 0.0]).unwrap();
/// assert_eq!(pose.translation.z, 200.0);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Inform;

/// Numbers of the routines to which jobs are lowered.
mod builtin {
    use crate::ir::{Expression, SourceSpan};
    use crate::reason::Reason;

    /// The value of an integer variable: unknown if it is not whole.
    pub(super) const WHOLE: u16 = 0;
    /// `SFTON`, with the position and the name of the frame.
    pub(super) const SHIFT: u16 = 1;
    /// `SFTOF`
    pub(super) const UNSHIFT: u16 = 2;
    /// `WVON`
    pub(super) const WEAVE: u16 = 3;
    /// `WVOF`
    pub(super) const UNWEAVE: u16 = 4;
    /// An unknown value from an earlier run that depends on the arguments, for each of these reasons.
    const LEFT: u16 = 5;
    const REASONS: [Reason; 3] = [Reason::Variable, Reason::Foreign, Reason::NotUnderstood];

    pub(super) fn left(reason: Reason, of: Vec<Expression>) -> Expression {
        let at = REASONS.iter().position(|known| *known == reason).unwrap_or(0);
        let place = of.first().map_or(SourceSpan::default(), |value| value.place);
        Expression::builtin(LEFT + at as u16, of, place)
    }

    pub(super) fn reason(number: u16) -> Option<Reason> {
        REASONS.get(usize::from(number.checked_sub(LEFT)?)).copied()
    }
}

impl Dialect for Inform {
    fn pose(&self, numbers: &[f64]) -> Option<Isometry3<f64>> {
        let [x, y, z, rx, ry, rz] = *numbers else { return None };
        let [rx, ry, rz] = [rx, ry, rz].map(f64::to_radians);
        let turn = UnitQuaternion::from_euler_angles(rx, ry, rz);
        Some(Isometry3::from_parts(Translation3::new(x, y, z), turn))
    }

    fn numbers(&self, pose: &Isometry3<f64>, near: &[f64]) -> Vec<f64> {
        let (rx, ry, rz) = pose.rotation.euler_angles();
        let [rx, ry, rz] = [rx, ry, rz].map(f64::to_degrees);
        // The same orientation is reached with the other two half a turn on, and Ry from the other side.
        let ways = [[rx, ry, rz], [rx + 180.0, 180.0 - ry, rz + 180.0]].map(|way| way.map(wrapped));
        let far = |way: &[f64; 3]| -> f64 {
            way.iter().zip(near.get(3..).unwrap_or_default()).map(|(way, near)| wrapped(way - near).abs()).sum()
        };
        let way = if near.len() == 6 && far(&ways[1]) < far(&ways[0]) { ways[1] } else { ways[0] };
        pose.translation.vector.iter().copied().chain(way).collect()
    }

    fn call(&self, builtin: u16, arguments: &Arguments<'_>, store: &mut Store) -> Value {
        let shift = store.get(Switch::Shift.slot()).clone();
        let weaves = matches!(shift.content, Content::List(_));
        let set = |store: &mut Store, value: Value| {
            let value = if weaves { Content::List([value].into()).into() } else { value };
            store.set(Switch::Shift, value);
            Content::Nothing.into()
        };
        match builtin {
            builtin::WHOLE => {
                let value = arguments.0.first().map(|(_, value)| value.clone());
                let value = value.unwrap_or_else(|| Value::unknown(Reason::Computed));
                match value.content {
                    Content::Number(number) if !is_whole(number.value) => {
                        Value::unknown(Reason::Rounding).reading([&value])
                    }
                    // With other literals the result may not be a whole number, so these literals are not edited.
                    Content::Number(number) => {
                        let content = Content::Number(Number { affine: None, ..number });
                        Value { content, ..value }
                    }
                    _ => value,
                }
            }
            builtin::SHIFT => {
                let by = shift_of(arguments, &shift).unwrap_or_else(|| Value::unknown(Reason::Shift));
                set(store, by.reading(arguments.values()))
            }
            builtin::UNSHIFT => set(store, Content::Nothing.into()),
            builtin::WEAVE if !weaves => {
                store.set(Switch::Shift, Content::List([shift].into()).into());
                Content::Nothing.into()
            }
            builtin::UNWEAVE => {
                if let Content::List(before) = &shift.content {
                    store.set(Switch::Shift, before[0].clone());
                }
                Content::Nothing.into()
            }
            _ => match builtin::reason(builtin) {
                Some(reason) => Value::unknown(reason).reading(arguments.values()),
                None => Content::Nothing.into(),
            },
        }
    }

    fn writes(&self, builtin: u16) -> &[Slot] {
        const SHIFT: [Slot; 1] = [Switch::Shift.slot()];
        if matches!(builtin, builtin::SHIFT..=builtin::UNWEAVE) { &SHIFT } else { &[] }
    }

    /// A position names its tool; a job may leave a shift in force.
    fn left_by_foreign(&self) -> &[Switch] {
        &[Switch::Load, Switch::Tool]
    }

    fn shifted(&self, position: Value, shift: &Value) -> Value {
        let (pose, by) = match (&position.content, &shift.content) {
            (_, Content::Nothing) => return position,
            (Content::Pose(pose), Content::Pose(by)) => (pose, by),
            (_, Content::List(_)) => return Value::unknown(Reason::Weaves).reading([&position]),
            _ => return Value::unknown(shift.reason().unwrap_or(Reason::Shift)).reading([&position]),
        };
        if pose.given.as_ref().map(|given| &given.frame) != by.given.as_ref().map(|given| &given.frame) {
            return Value::unknown(Reason::Shift).reading([&position]);
        }
        let moved = Pose { left: by.pose() * pose.left, ..(**pose).clone() };
        Value { content: Content::Pose(Arc::new(moved)), reads: position.reads }
    }
}

/// The shift of `SFTON`, if it is known: only one shift at a time, along the axes of the frame of the positions.
fn shift_of(arguments: &Arguments<'_>, before: &Value) -> Option<Value> {
    let (by, frame) = (arguments.get("", 0)?, arguments.get("", 1)?);
    let (Content::Pose(pose), Content::Text(frame), Content::Nothing) = (&by.content, &frame.content, &before.content)
    else {
        return None;
    };
    let given = pose.given.as_ref().filter(|_| pose.own.rotation.angle() == 0.0)?;
    let given = Given { frame: String::from_utf8_lossy(frame).into(), ..(**given).clone() };
    let by = Pose { given: Some(Arc::new(given)), ..Pose::constant(pose.pose()) };
    Some(Content::Pose(Arc::new(by)).into())
}

/// An angle in degrees as a controller writes it: above −180 and up to 180.
fn wrapped(deg: f64) -> f64 {
    let rest = deg.rem_euclid(360.0);
    if rest > 180.0 { rest - 360.0 } else { rest }
}
