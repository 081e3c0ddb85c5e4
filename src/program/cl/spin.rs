//! The rotation about the tool axis, which CL data leave free.

use super::vector::{add, cross, dot, norm, scale, sub, unit};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion};

/// The direction of the TCP's x axis, projected perpendicular to the tool axis, and then turned by `deg` about the tool axis (right-hand
/// rule about tip to spindle).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SpinRule {
    /// Along the work object's x axis.
    Fixed {
        /// Turn, degrees.
        deg: f64,
    },
    /// Along the feed.
    Feed {
        /// Turn, degrees.
        deg: f64,
    },
    /// Towards a point of the work object.
    Towards {
        /// The point, mm.
        point_mm: [f64; 3],
        /// Turn, degrees.
        deg: f64,
    },
}

/// A reference closer to the tool axis than this (sine of the angle, 0.006°) gives no direction perpendicular to it.
const PARALLEL: f64 = 1e-4;

/// Orientation of the TCP frame in the work object, scalar first: z against the tool axis (which runs
/// from tip to spindle), x by the rule.
///
/// `None` if the rule's direction is parallel to the axis, or has no length: the caller then keeps the last direction.
#[must_use]
pub fn spin(axis: [f64; 3], feed: Option<[f64; 3]>, position_mm: [f64; 3], rule: &SpinRule) -> Option<[f64; 4]> {
    let axis = unit(axis)?;
    let (reference, deg) = match *rule {
        SpinRule::Fixed { deg } => ([1.0, 0.0, 0.0], deg),
        SpinRule::Feed { deg } => (feed?, deg),
        SpinRule::Towards { point_mm, deg } => (sub(point_mm, position_mm), deg),
    };
    let reference = unit(reference)?;
    let square = sub(reference, scale(axis, dot(reference, axis)));
    if norm(square) < PARALLEL {
        return None;
    }
    let square = unit(square)?;
    let (sin, cos) = deg.to_radians().sin_cos();
    let x = add(scale(square, cos), scale(cross(axis, square), sin));
    let z = scale(axis, -1.0);
    let y = cross(z, x);
    let matrix = Matrix3::from_columns(&[x.into(), y.into(), z.into()]);
    let q = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(matrix));
    Some([q.w, q.i, q.j, q.k])
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Quaternion, Vector3};

    fn axes(q: [f64; 4]) -> [Vector3<f64>; 3] {
        let q = UnitQuaternion::from_quaternion(Quaternion::new(q[0], q[1], q[2], q[3]));
        [Vector3::x(), Vector3::y(), Vector3::z()].map(|v| q * v)
    }

    #[test]
    fn spindle_up_with_x_along_the_object_is_half_a_turn_about_x() {
        let q = spin([0.0, 0.0, 1.0], None, [0.0; 3], &SpinRule::Fixed { deg: 0.0 }).unwrap();
        assert!((q[1].abs() - 1.0).abs() < 1e-12, "{q:?}");
    }

    #[test]
    fn turns_about_the_axis_from_tip_to_spindle() {
        let [x, _, z] = axes(spin([0.0, 0.0, 1.0], None, [0.0; 3], &SpinRule::Fixed { deg: 90.0 }).unwrap());
        assert!((x - Vector3::y()).norm() < 1e-12);
        assert!((z + Vector3::z()).norm() < 1e-12);
    }

    #[test]
    fn x_points_along_the_feed_or_towards_the_point_square_to_the_axis() {
        let tilted = [0.6, 0.0, 0.8];
        let [x, ..] = axes(spin(tilted, Some([0.0, 3.0, 0.0]), [0.0; 3], &SpinRule::Feed { deg: 0.0 }).unwrap());
        assert!((x - Vector3::y()).norm() < 1e-12);
        let rule = SpinRule::Towards { point_mm: [10.0, 0.0, 0.0], deg: 0.0 };
        let [x, _, z] = axes(spin(tilted, None, [0.0; 3], &rule).unwrap());
        assert!((x - Vector3::new(0.8, 0.0, -0.6)).norm() < 1e-12);
        assert!((z + Vector3::from(tilted)).norm() < 1e-12);
    }

    #[test]
    fn a_reference_along_the_axis_gives_nothing() {
        assert!(spin([1.0, 0.0, 0.0], None, [0.0; 3], &SpinRule::Fixed { deg: 10.0 }).is_none());
        assert!(spin([0.0, 0.0, 1.0], None, [0.0; 3], &SpinRule::Feed { deg: 0.0 }).is_none());
        assert!(spin([0.0, 0.0, 1.0], Some([0.0; 3]), [0.0; 3], &SpinRule::Feed { deg: 0.0 }).is_none());
    }
}
