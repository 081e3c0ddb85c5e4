//! Computes rotation vectors from one orientation to another, for one pair or for eight.

use deflex_lanes::{Frame, Real, Vector};
use nalgebra::{Rotation3, Vector3};

/// Up to this sine the series of the arc sine is exact to rounding.
const SMALL: f64 = 0.01;

/// Coefficients of the series of arcsin(x)/x in powers of x², after the first.
const ARC_SINE: [f64; 3] = [1.0 / 6.0, 3.0 / 40.0, 15.0 / 336.0];

/// Rotation vector that turns one orientation into another, in the frame in which both are given, rad. It is exact for
/// small angles too.
#[must_use]
#[doc(hidden)]
pub fn turn_between(from: &Rotation3<f64>, to: &Rotation3<f64>) -> Vector3<f64> {
    let axes = |rotation: &Rotation3<f64>| {
        let mut frame = Frame::<f64>::identity();
        frame.set_axes(0, rotation);
        frame
    };
    let (turn, small) = turns_between(&axes(from), &axes(to));
    if small {
        return turn.lane(0);
    }
    // Through the quaternion: `acos` of the matrix gives NaN or loses half of the digits near the identity.
    nalgebra::UnitQuaternion::from_rotation_matrix(&(to * from.inverse())).scaled_axis()
}

/// [`turn_between`] for small turns, and the lanes in which they are small.
#[inline(always)]
#[doc(hidden)]
pub fn turns_between<R: Real>(from: &Frame<R>, to: &Frame<R>) -> (Vector<R>, R::Mask) {
    // The axis times the sine of the angle. Most rotations are the deflection of an arm, about 1e-4 rad.
    let turn = (from.x.cross(to.x) + from.y.cross(to.y) + from.z.cross(to.z)) * R::of(0.5);
    let square = turn.dot(turn);
    // The angle is less than a right angle if the trace of the rotation is positive.
    let trace = from.x.dot(to.x) + from.y.dot(to.y) + from.z.dot(to.z);
    let small = square.lt(SMALL * SMALL) & R::ZERO.lt(trace);
    let [one, two, three] = ARC_SINE;
    let by = square * (square * (square * three + two) + one) + 1.0;
    (turn * by, small)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Pose;
    use deflex_lanes::{Lanes, Mask, WIDTH};
    use nalgebra::Translation3;

    /// Rounding of unit vectors.
    const SAME: f64 = 1e-15;

    proptest::proptest! {
        #[test]
        fn a_turn_between_is_the_one_turned_by(
            from in proptest::array::uniform3(-3.0_f64..3.0),
            axis in proptest::array::uniform3(-1.0_f64..1.0),
            sizes in proptest::array::uniform8(proptest::sample::select(vec![1e-9, 1e-6, 1e-4, 5e-3, 9.9e-3, 1.01e-2, 0.5, 3.0])),
        ) {
            let axis = Vector3::from(axis);
            proptest::prop_assume!(axis.norm() > 1e-3);
            let from = Rotation3::from_scaled_axis(from.into());
            let (mut eight, mut turned) = (Frame::<Lanes>::default(), Frame::<Lanes>::default());
            for (lane, size) in sizes.into_iter().enumerate() {
                let turn = axis.normalize() * size;
                let to = Rotation3::from_scaled_axis(turn) * from;
                let found = turn_between(&from, &to);
                proptest::prop_assert!((found - turn).norm() < SAME + 1e-14 * size, "{found} {turn}");
                eight.set(lane, &Pose::from_parts(Translation3::identity(), from));
                turned.set(lane, &Pose::from_parts(Translation3::identity(), to));
            }
            let (turns, small) = turns_between(&eight, &turned);
            for lane in 0..WIDTH {
                let plain = turn_between(&from, &turned.lane(lane).rotation);
                proptest::prop_assert!(!small.lane(lane) || (turns.lane(lane) - plain).norm() < SAME);
                proptest::prop_assert_eq!(small.lane(lane), sizes[lane] < SMALL);
            }
        }
    }
}
