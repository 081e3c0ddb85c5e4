//! Bounds on the motion of each axis while the flange moves by at most a given length and turn. They hold everywhere on a piece of path
//! between two places.

use super::closed_form::ClosedForm;
use super::{Joints, Robot};
use std::f64::consts::{FRAC_PI_2, PI, SQRT_2};

/// Bounds over a piece of path that begins at known motor angles.
#[derive(Clone, Copy, Debug)]
#[doc(hidden)]
pub struct Excursion {
    /// The largest change of each motor angle from the start of the piece, rad.
    pub axes: [f64; 6],
    /// [`Robot::clearance`] at the start of the piece; infinite for arms without an explicit inverse.
    pub clearance: [f64; 3],
    /// The smallest clearance that is possible on the piece.
    pub left: [f64; 3],
    /// The largest difference of the speed of an axis from its mean over the piece, as a share of the bound of the axis.
    pub bend: f64,
}

/// Safety factor for the share by which speeds can differ: it is computed from sums of the bounds, without their products.
const SAFE: f64 = 2.0;

/// The largest second derivative of the flange position with respect to two joints, divided by the reach of the arm.
const CURVED: f64 = 6.0;

impl Robot {
    /// Distance from the singular postures: of axis 5 from where axes 4 and 6 line up (rad), of the elbow from stretched or folded (rad),
    /// and of the wrist centre from axis 1 (m). `None` for arms without an explicit inverse.
    #[doc(hidden)]
    pub fn clearance(&self, motor: &Joints) -> Option<[f64; 3]> {
        self.closed_form().map(|form| form.clearance(&self.serial_from_motor(motor)))
    }

    /// Distance from the wrist centre to the flange, m; 0 for arms without an explicit inverse, whose path is bounded at the flange.
    #[doc(hidden)]
    pub fn wrist_lever(&self) -> f64 {
        self.closed_form().map_or(0.0, |form| form.d6.abs())
    }

    /// Bounds on a piece of path on which the wrist centre (without an explicit inverse: the flange) moves by at most `length` (m) and the
    /// flange turns by at most `turn` (rad). `None` if the piece may contain a singular posture.
    #[doc(hidden)]
    pub fn excursion(&self, from: &Joints, length: f64, turn: f64) -> Option<Excursion> {
        let Some(form) = self.closed_form() else { return self.excursion_by_jacobian(from, length, turn) };
        let clearance = form.clearance(&self.serial_from_motor(from));
        let Bounds { q1, q2, q23, omega, bend } = form.bounds(clearance, length, turn)?;
        let [wrist, elbow, shoulder] = clearance;
        let left = [wrist - omega, elbow - (q2 + q23), shoulder - form.across() * length];
        let sine = left[0].clamp(0.0, FRAC_PI_2).sin();
        if sine <= 0.0 {
            return None;
        }
        let (q3, turned) = (if self.axes.parallelogram { q23 } else { q2 + q23 }, omega / sine);
        let bend = SAFE * (bend + turned);
        Some(Excursion { axes: [q1, q2, q3, turned, omega, turned], clearance, left, bend })
    }

    /// [`Robot::excursion`] for arms without an explicit inverse, from the smallest singular value of the Jacobian.
    fn excursion_by_jacobian(&self, from: &Joints, length: f64, turn: f64) -> Option<Excursion> {
        let frames = self.frames(from);
        let reach: f64 = self.links.rows().iter().map(|row| row.a.abs() + row.d.abs()).sum();
        let mut jacobian = self.jacobian(&frames, &frames.base_from_flange().translation.vector);
        jacobian.rows_mut(0, 3).unscale_mut(reach.max(f64::MIN_POSITIVE));
        let least = jacobian.svd(false, false).singular_values.min();
        // On the piece it stays at least half as large.
        let step = 2.0 * (length / reach).hypot(turn) / least;
        let bend = 2.0 * CURVED * step / least;
        let free = [f64::INFINITY; 3];
        (bend <= 1.0).then_some(Excursion { axes: [step; 6], clearance: free, left: free, bend })
    }

    /// By how much an axis can pass its limit at most, rad, if no axis moves farther from motor angles (rad) than these bounds (rad). Negative
    /// if none can pass it.
    #[doc(hidden)]
    pub fn limit_excess(&self, motor: &Joints, excursion: &[f64; 6]) -> f64 {
        let (limits, counted) = (&self.limits, self.axes_from_motor(motor));
        let with_second = self.axes.counted_23().abs() * excursion[1];
        let mut most = f64::NEG_INFINITY;
        for (i, value) in counted.iter().enumerate() {
            let reached = excursion[i] + if i == 2 { with_second } else { 0.0 };
            most = most.max((limits.min[i] - value).max(value - limits.max[i]) + reached);
        }
        if let Some((min, max)) = limits.elbow {
            let (value, of_second) = (self.elbow(motor), self.axes.elbow_of_second().abs());
            most = most.max((min - value).max(value - max) + of_second * excursion[1] + excursion[2]);
        }
        most
    }
}

/// Changes of the arm's angles over a piece of path, rad: of axis 1, the upper arm, the forearm, and the flange
/// relative to the forearm; and the share by which the rates of the first three can differ.
struct Bounds {
    q1: f64,
    q2: f64,
    q23: f64,
    omega: f64,
    bend: f64,
}

impl ClosedForm {
    fn clearance(&self, serial: &Joints) -> [f64; 3] {
        let (upper, elbow) = (serial[1] + self.theta[1], serial[2] + self.theta[2] + self.gamma);
        let ahead = self.a1 + self.a2 * upper.cos() + self.l3 * (upper + elbow).cos();
        [from_straight(serial[4] + self.theta[4]), from_straight(elbow), ahead.abs()]
    }

    /// Factor by which the wrist centre can move farther in the plane of the arm than in space: an offset from that
    /// plane is a lever.
    fn across(&self) -> f64 {
        if self.b == 0.0 { 1.0 } else { SQRT_2 }
    }

    fn bounds(&self, [_, elbow, shoulder]: [f64; 3], length: f64, turn: f64) -> Option<Bounds> {
        let length = self.across() * length;
        let ahead = shoulder - length;
        // Within the offset, axis 1 turns faster than the distance in the plane implies.
        if ahead <= self.b.abs() {
            return None;
        }
        let q1 = length / ahead;
        // The elbow keeps at least half of its angle.
        let sine = (0.5 * elbow).sin();
        let (q2, q23) = (length / (self.a2 * sine), length / (self.l3 * sine));
        if q2 + q23 > 0.5 * elbow || sine <= 0.0 {
            return None;
        }
        Some(Bounds { q1, q2, q23, omega: turn + q1 + q23, bend: q1 + (q2 + q23) / sine })
    }
}

/// Distance of an angle from the nearest multiple of half a turn, rad.
fn from_straight(angle: f64) -> f64 {
    (angle - (angle / PI).round() * PI).abs()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BUILTIN, Pose, pose_gap};
    use nalgebra::{Rotation3, Vector3};
    use proptest::prelude::*;

    proptest! {
        /// Along random short pieces no axis gets farther than its bound, nor nearer to a singular posture.
        #[test]
        fn no_axis_gets_farther_than_its_bound(
            robot in 0..BUILTIN.len(),
            shares in prop::array::uniform6(0.1_f64..0.9),
            way in prop::array::uniform3(-1.0_f64..1.0),
            turn in prop::array::uniform3(-1.0_f64..1.0),
            size in 1e-3_f64..0.2,
        ) {
            let robot = BUILTIN[robot].robot();
            prop_assume!(robot.has_closed_form());
            let limits = &robot.limits;
            let from = Joints::from_fn(|i, _| limits.min[i] + shares[i] * (limits.max[i] - limits.min[i]));
            let from = robot.motor_from_axes_deg(&<[f64; 6]>::from(from.map(f64::to_degrees)));
            // If the elbow passes its limits, the arm is brought back by a whole turn.
            prop_assume!(robot.limit_violation(&from).is_none());
            let start = robot.forward(&from);
            let lever = robot.wrist_lever();
            // Rotates about the wrist centre, which moves on a straight line.
            let (way, turn) = (Vector3::from(way) * size, Vector3::from(turn) * size);
            let Some(bounds) = robot.excursion(&from, way.norm(), turn.norm()) else { return Ok(()) };
            let wrist = start * nalgebra::Point3::new(0.0, 0.0, -lever);
            let (mut near, mut last, steps) = (from, from, 50);
            for step in 1..=steps {
                let share = f64::from(step) / f64::from(steps);
                let rotation = Rotation3::from_scaled_axis(turn * share) * start.rotation;
                let centre = wrist.coords + way * share;
                let pose = Pose::from_parts((centre + rotation * Vector3::new(0.0, 0.0, lever)).into(), rotation);
                let Ok(motor) = robot.inverse_near_unlimited(&pose, &near) else {
                    return Err(TestCaseError::fail("out of reach within a bound"));
                };
                prop_assert!(pose_gap(&robot.forward(&motor), &pose).norm() < 1e-9);
                for i in 0..6 {
                    let (off, most) = ((motor[i] - from[i]).abs(), bounds.axes[i]);
                    prop_assert!(off <= most + 1e-9, "axis {}: {off} beyond {most}", i + 1);
                    // Each part of the piece changes an axis by at most the same part of the bound.
                    let (step, most) = ((motor[i] - near[i]).abs(), most / f64::from(steps));
                    prop_assert!(step <= most + 1e-9, "axis {}: {step} beyond {most} in a step", i + 1);
                }
                let clearance = robot.clearance(&motor).unwrap();
                for k in 0..3 {
                    prop_assert!(clearance[k] >= bounds.left[k] - 1e-9, "{k}: {clearance:?} {:?}", bounds.left);
                }
                (last, near) = (near, motor);
            }
            // The last of fifty steps has nearly the speed of the end.
            for i in 0..6 {
                let (mean, end) = (near[i] - from[i], f64::from(steps) * (near[i] - last[i]));
                let most = mean.abs() + bounds.bend * bounds.axes[i];
                prop_assert!(end.abs() <= most + 1e-9, "axis {}: {end} beyond {most}", i + 1);
            }
        }
    }
}
