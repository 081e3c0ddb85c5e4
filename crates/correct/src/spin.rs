//! The turn about the tool axis, which CL data leave open: the cell's `spin` rule.

use super::travel::CHORD;
use deflex_cell::{Spin, SpinRule};
use deflex_robot::Pose;
use nalgebra::{Matrix3, Rotation3, Unit, Vector3};

/// The rule of a cell that states none.
pub(super) const NONE: Spin = Spin { rule: SpinRule::Fixed, turn: 0.0 };

/// Sine below which a direction is parallel to the tool axis.
const PARALLEL: f64 = 1e-4;

/// Pose of a CL target, whose tool axis is a unit vector, at the end of a chord (m). `held` is the last direction that the rule gave x, which
/// is kept where the rule gives none; `None` if there was none yet.
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
        // Stiffest: before the turn is chosen.
        SpinRule::Fixed | SpinRule::Stiffest => Vector3::x(),
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

/// The direction from which turns count, perpendicular to a tool axis: the work object's x axis seen along the tool, or its y axis if the
/// tool is parallel to x.
fn reference(axis: &Vector3<f64>) -> Vector3<f64> {
    let across = |v: Vector3<f64>| (v - axis * v.dot(axis)).try_normalize(PARALLEL);
    across(Vector3::x()).or_else(|| across(Vector3::y())).unwrap_or_else(Vector3::x)
}

/// Pose at a position (m, work object axes) with a tool axis (tip to spindle) and a turn (rad) about it from [`reference`]: as with
/// `spin = "fixed"` and that `spin_deg`.
pub(super) fn turned(position: Vector3<f64>, axis: &Vector3<f64>, turn: f64) -> Pose {
    let x = Rotation3::from_axis_angle(&Unit::new_normalize(*axis), turn) * reference(axis);
    let z = -axis;
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, z.cross(&x), z]));
    Pose::from_parts(position.into(), rotation)
}

/// The turn of a pose, rad; see [`turned`].
pub(super) fn turn_of(pose: &Pose) -> f64 {
    let x: Vector3<f64> = pose.rotation.matrix().column(0).into();
    let axis: Vector3<f64> = -Vector3::from(pose.rotation.matrix().column(2));
    let from = reference(&axis);
    axis.dot(&from.cross(&x)).atan2(from.dot(&x))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_is_read_back() {
        for (axis, turn) in [([0.0, 0.0, 1.0], 0.3), ([0.3, -0.2, 0.9], -2.9), ([1.0, 0.0, 0.0], 1.2)] {
            let pose = turned(Vector3::new(0.1, 0.2, 0.3), &Vector3::from(axis).normalize(), turn);
            assert!((turn_of(&pose) - turn).abs() < 1e-12);
        }
    }

    #[test]
    fn a_turn_is_that_of_the_fixed_rule() {
        let axis = Vector3::new(0.3, -0.2, 0.9).normalize();
        let spin = Spin { rule: SpinRule::Fixed, turn: 0.7 };
        let fixed = pose(&spin, [1.0, 2.0, 3.0], axis.into(), Vector3::zeros(), &mut None).unwrap();
        assert!((turned(fixed.translation.vector, &axis, 0.7).to_matrix() - fixed.to_matrix()).amax() < 1e-12);
    }
}
