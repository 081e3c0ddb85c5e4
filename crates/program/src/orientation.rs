//! Converts between quaternions (scalar first) and the orientations of makers: three angles in degrees.

use nalgebra::{Quaternion, Rotation3, UnitQuaternion, Vector3};

/// Below this cosine of the middle angle, the outer two turn about one axis, and the last one is set to zero: their difference is within
/// printed digits.
const GIMBAL: f64 = 1e-9;

/// The rotation of a quaternion, scalar first, of any length except zero.
///
/// # Examples
/// ```
/// use nalgebra::Vector3;
/// use deflex_program::orientation::rotation;
///
/// // Half a turn about x: the tool points down.
/// assert!((rotation([0.0, 1.0, 0.0, 0.0]) * Vector3::z() + Vector3::z()).norm() < 1e-12);
/// ```
#[must_use]
pub fn rotation(quat: [f64; 4]) -> Rotation3<f64> {
    let [w, x, y, z] = quat;
    UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)).to_rotation_matrix()
}

/// The quaternion of a rotation, scalar first, unit norm, scalar not negative.
///
/// # Examples
/// ```
/// use deflex_program::orientation::{quaternion, rotation};
///
/// let [w, x, y, z] = quaternion(&rotation([0.0, 2.0, 0.0, 0.0])); // half a turn about x
/// assert_eq!((w, x, y, z), (0.0, 1.0, 0.0, 0.0));
/// ```
#[must_use]
pub fn quaternion(rotation: &Rotation3<f64>) -> [f64; 4] {
    let q = UnitQuaternion::from_rotation_matrix(rotation);
    let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
    [sign * q.w, sign * q.i, sign * q.j, sign * q.k]
}

/// The rotation vector of a rotation, rad. It is computed from the quaternion, because [`Rotation3::scaled_axis`] does not find the axis of
/// half a turn.
#[must_use]
#[doc(hidden)]
pub fn rotation_vector(rotation: &Rotation3<f64>) -> Vector3<f64> {
    UnitQuaternion::from_rotation_matrix(rotation).scaled_axis()
}

/// The orientation halfway between two others, unit quaternions, scalar first.
pub(crate) fn halfway(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
    let dot: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
    let sum: [f64; 4] = std::array::from_fn(|i| a[i] + if dot < 0.0 { -b[i] } else { b[i] });
    let norm = sum.iter().map(|c| c * c).sum::<f64>().sqrt();
    // Opposite orientations have no middle.
    if norm < 1e-6 { b } else { sum.map(|c| c / norm) }
}

/// Angles [A, B, C] about z, the turned y, the turned x: `Rz(A) Ry(B) Rx(C)`, degrees. KUKA's A, B, C; ABB's EulerZYX; read
/// backwards, [C, B, A], they are FANUC's W, P, R and Yaskawa's Rx, Ry, Rz about fixed x, y, z.
///
/// # Examples
/// ```
/// use deflex_program::orientation::{from_zyx_deg, zyx_deg};
///
/// let [a, b, c] = zyx_deg(&from_zyx_deg([30.0, -20.0, 10.0]));
/// assert!((a - 30.0).abs() < 1e-9 && (b + 20.0).abs() < 1e-9 && (c - 10.0).abs() < 1e-9);
/// ```
#[must_use]
pub fn zyx_deg(rotation: &Rotation3<f64>) -> [f64; 3] {
    let r = rotation.matrix();
    let cosine = r[(0, 0)].hypot(r[(1, 0)]);
    let b = (-r[(2, 0)]).atan2(cosine);
    let (a, c) = if cosine < GIMBAL {
        ((-r[(0, 1)]).atan2(r[(1, 1)]), 0.0)
    } else {
        (r[(1, 0)].atan2(r[(0, 0)]), r[(2, 1)].atan2(r[(2, 2)]))
    };
    [a, b, c].map(f64::to_degrees)
}

/// The rotation of [`zyx_deg`].
///
/// # Examples
/// ```
/// use deflex_program::orientation::{from_zyx_deg, rotation};
///
/// // KUKA A: 90° about z.
/// let turned = from_zyx_deg([90.0, 0.0, 0.0]);
/// assert!((turned.matrix()[(1, 0)] - 1.0).abs() < 1e-12);
/// ```
#[must_use]
pub fn from_zyx_deg([a, b, c]: [f64; 3]) -> Rotation3<f64> {
    let about = |axis: Vector3<f64>, deg: f64| Rotation3::new(axis * deg.to_radians());
    about(Vector3::z(), a) * about(Vector3::y(), b) * about(Vector3::x(), c)
}

/// The quaternion of [`from_zyx_deg`], scalar first, scalar not negative, by its half angles (Diebel 2006, *Representing
/// Attitude*, equation 297).
#[must_use]
#[doc(hidden)]
pub fn quaternion_of_zyx_deg(angles: [f64; 3]) -> [f64; 4] {
    let [(sa, ca), (sb, cb), (sc, cc)] = angles.map(|deg| (0.5 * deg).to_radians().sin_cos());
    let quat = [
        ca * cb * cc + sa * sb * sc,
        ca * cb * sc - sa * sb * cc,
        ca * sb * cc + sa * cb * sc,
        sa * cb * cc - ca * sb * sc,
    ];
    if quat[0] < 0.0 { quat.map(|component| -component) } else { quat }
}

/// Angles [Rx, Ry, Rz] about x, the turned y, the turned z: `Rx Ry Rz`, degrees: Stäubli's.
#[must_use]
#[doc(hidden)]
pub fn xyz_deg(rotation: &Rotation3<f64>) -> [f64; 3] {
    // The inverse turns about z, y, x by the negative angles.
    let [z, y, x] = zyx_deg(&rotation.inverse());
    [-x, -y, -z]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn half_angles_give_the_same_quaternion(angles in prop::array::uniform3(-360.0..360.0_f64)) {
            let (a, b) = (quaternion_of_zyx_deg(angles), quaternion(&from_zyx_deg(angles)));
            // A half turn has two signs.
            let same = |sign: f64| a.iter().zip(b).all(|(a, b)| (a - sign * b).abs() < 1e-14);
            prop_assert!(same(1.0) || a[0] < 1e-12 && same(-1.0), "{a:?} {b:?}");
        }
    }

    #[test]
    fn half_a_turn_has_its_axis() {
        let down = rotation_vector(&rotation([0.0, 1.0, 0.0, 0.0]));
        assert!((down.norm() - std::f64::consts::PI).abs() < 1e-12 && down.x.abs() > 3.0, "{down:?}");
    }

    #[test]
    fn a_quarter_turn_about_each_axis_is_its_angle() {
        let about = |axis: Vector3<f64>| Rotation3::new(axis * std::f64::consts::FRAC_PI_2);
        assert!((Vector3::from(zyx_deg(&about(Vector3::z()))) - Vector3::new(90.0, 0.0, 0.0)).amax() < 1e-12);
        assert!((Vector3::from(zyx_deg(&about(Vector3::y()))) - Vector3::new(0.0, 90.0, 0.0)).amax() < 1e-6);
        assert!((Vector3::from(zyx_deg(&about(Vector3::x()))) - Vector3::new(0.0, 0.0, 90.0)).amax() < 1e-12);
        assert!((Vector3::from(xyz_deg(&about(Vector3::z()))) - Vector3::new(0.0, 0.0, 90.0)).amax() < 1e-12);
    }

    #[test]
    fn a_hand_solved_pair_turns_in_order() {
        // A = 90°, C = 90°: z first, then the turned x (world y): x goes to y, y to z, z to x.
        let r = from_zyx_deg([90.0, 0.0, 90.0]);
        assert!((r * Vector3::x() - Vector3::y()).amax() < 1e-15);
        assert!((r * Vector3::y() - Vector3::z()).amax() < 1e-15);
        assert!((r * Vector3::z() - Vector3::x()).amax() < 1e-15);
    }

    proptest! {
        #[test]
        fn angles_give_their_rotation_back(a in -180.0..180.0, b in -90.0..90.0, c in -180.0..180.0) {
            let r = from_zyx_deg([a, b, c]);
            prop_assert!((from_zyx_deg(zyx_deg(&r)).matrix() - r.matrix()).amax() < 1e-12);
            prop_assert!((rotation(quaternion(&r)).matrix() - r.matrix()).amax() < 1e-12);
            let [x, y, z] = xyz_deg(&r).map(f64::to_radians);
            let turned = Rotation3::new(Vector3::x() * x) * Rotation3::new(Vector3::y() * y) * Rotation3::new(Vector3::z() * z);
            prop_assert!((turned.matrix() - r.matrix()).amax() < 1e-12);
        }
    }
}
