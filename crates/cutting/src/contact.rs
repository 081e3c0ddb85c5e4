//! The point at which the cutter touches the finished surface.

use super::Cutter;
use nalgebra::{Unit, Vector3};

/// The axis is perpendicular to the surface if this sine is not exceeded: the lean is then due to the rounding of a
/// unit vector.
const SQUARE_SINE: f64 = 1e-9;

/// The lowest point of the cutter's envelope relative to the tip, feed frame, m.
///
/// # Examples
/// ```
/// use deflex_cutting::ContactPoint;
/// use nalgebra::Vector3;
///
/// /// The height of the contact point over the tip, m.
/// fn height(contact: &ContactPoint) -> f64 {
///     match contact {
///         ContactPoint::Point(point) | ContactPoint::Heel(point) => point.z,
///         ContactPoint::FlatDisk => 0.0,
///     }
/// }
/// assert_eq!(height(&ContactPoint::Point(Vector3::new(0.0, 0.0, 1e-3))), 1e-3);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ContactPoint {
    /// One point.
    Point(Vector3<f64>),
    /// The axis is along the normal and the cutter has a flat: the whole disk touches the surface.
    FlatDisk,
    /// The tool leans back, so that the rear of its flat cuts the surface (heel cutting), or it lies down entirely. The force model does not
    /// cover this.
    Heel(Vector3<f64>),
}

impl ContactPoint {
    /// The support point of the envelope in the direction of the surface normal. It equals Tang et al. Eqs. 12 and 13
    /// for a positive lead, and is also right for zero and negative leads, for which those equations fail.
    pub(super) fn of(cutter: &Cutter, axis: &Unit<Vector3<f64>>) -> Self {
        let flat = cutter.radius() - cutter.corner_radius;
        let Some(point) = support(cutter, axis) else {
            return ContactPoint::FlatDisk;
        };
        if is_heel(flat, axis) { ContactPoint::Heel(point) } else { ContactPoint::Point(point) }
    }
}

/// Whether the cutter touches with its heel, given the radius of its flat.
fn is_heel(flat: f64, axis: &Unit<Vector3<f64>>) -> bool {
    axis.z <= 0.0 || (axis.x < 0.0 && flat > 0.0)
}

/// Sine of the angle between axis and normal.
fn sine(axis: &Unit<Vector3<f64>>) -> f64 {
    (axis.x * axis.x + axis.y * axis.y).sqrt()
}

/// Height of the contact point above the tip, m (not positive); `None` if the contact is not a single point.
pub(super) fn height(cutter: &Cutter, axis: &Unit<Vector3<f64>>) -> Option<f64> {
    let flat = cutter.radius() - cutter.corner_radius;
    let disk = flat > 0.0 && sine(axis) <= SQUARE_SINE;
    (!disk && !is_heel(flat, axis)).then(|| -tip_height(cutter, axis))
}

fn support(cutter: &Cutter, axis: &Unit<Vector3<f64>>) -> Option<Vector3<f64>> {
    let (r, flat) = (cutter.corner_radius, cutter.radius() - cutter.corner_radius);
    let corner = (axis.into_inner() - Vector3::z()) * r;
    if flat <= 0.0 {
        return Some(corner);
    }
    let sine = sine(axis);
    let up_the_disk = (Vector3::z() - axis.into_inner() * axis.z) / sine;
    (sine > SQUARE_SINE).then(|| corner - up_the_disk * flat)
}

/// Height of the tip above the cutter's lowest point, m (Tang et al. Eq. 12 with
/// LEAD the angle between axis and normal).
pub(super) fn tip_height(cutter: &Cutter, axis: &Unit<Vector3<f64>>) -> f64 {
    let (r, flat) = (cutter.corner_radius, cutter.radius() - cutter.corner_radius);
    flat * sine(axis) + r * (1.0 - axis.z)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_height_is_that_of_the_point() {
        for corner_radius in [0.0, 0.002, 0.01] {
            let cutter = Cutter { diameter: 0.02, corner_radius, teeth: 4, helix: 0.5 };
            for axis in [[0.1, 0.2, 0.9], [-0.1, 0.2, 0.9], [0.0, 0.0, 1.0], [0.0, -0.3, 1.0], [0.5, 0.0, -0.1]] {
                let axis = Unit::new_normalize(Vector3::from(axis));
                let point = match ContactPoint::of(&cutter, &axis) {
                    ContactPoint::Point(point) => Some(point.z),
                    ContactPoint::FlatDisk | ContactPoint::Heel(_) => None,
                };
                let height = height(&cutter, &axis);
                assert_eq!(height.is_some(), point.is_some(), "{corner_radius} {axis:?}");
                assert!((height.unwrap_or(0.0) - point.unwrap_or(0.0)).abs() < 1e-15, "{corner_radius} {axis:?}");
            }
        }
    }
}
