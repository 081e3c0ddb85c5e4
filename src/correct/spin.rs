//! The turn about the tool axis, which CL data leave open: the cell's `spin` rule.

use super::path::CHORD;
use crate::cell::{Spin, SpinRule};
use crate::robot::Pose;
use nalgebra::{Matrix3, Rotation3, Unit, Vector3};

/// Of a cell that says nothing.
pub(super) const NONE: Spin = Spin { rule: SpinRule::Fixed, turn: 0.0 };

/// Sine below which a direction is parallel to the tool axis.
const PARALLEL: f64 = 1e-4;

/// Pose of a CL target, whose tool axis is a unit vector, at the end of a chord (m). `held` is the last direction that a rule gave
/// x, which is held where it gives none; `None` where there was none yet.
pub(super) fn pose(
    spin: &Spin,
    position_mm: [f64; 3],
    axis: [f64; 3],
    chord: Vector3<f64>,
    held: &mut Option<Vector3<f64>>,
) -> Option<Pose> {
    let axis = Vector3::from(axis);
    let position = Vector3::from(position_mm) * 1e-3;
    let reference = match spin.rule {
        SpinRule::Fixed => Vector3::x(),
        SpinRule::Feed => chord,
        SpinRule::Towards(point) => point - position,
    };
    let across = |v: Vector3<f64>| v - axis * v.dot(&axis);
    let x = reference.try_normalize(CHORD).and_then(|r| across(r).try_normalize(PARALLEL));
    let x = x.or_else(|| held.and_then(|held| across(held).try_normalize(PARALLEL)))?;
    *held = Some(x);
    let turned = || Rotation3::from_axis_angle(&Unit::new_normalize(axis), spin.turn) * x;
    let x = if spin.turn.abs() > 0.0 { turned() } else { x };
    let z = -axis;
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, z.cross(&x), z]));
    Some(Pose::from_parts(position.into(), rotation))
}
