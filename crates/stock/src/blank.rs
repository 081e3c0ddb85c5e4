//! The blank: the stock before the first cut.

use super::closed::ClosedMesh;
use nalgebra::Vector3;
use std::sync::Arc;

/// A blank in the stock's frame, m.
///
/// # Examples
/// ```
/// use nalgebra::Vector3;
/// use deflex_stock::Blank;
///
/// let blank = Blank::Box([Vector3::zeros(), Vector3::new(0.1, 0.1, 0.05)]);
/// assert_eq!(blank.bounds()[1].z, 0.05); // m
/// assert!((blank.depth(&Vector3::new(0.05, 0.05, 0.04)) - 0.01).abs() < 1e-12); // m below the top
/// ```
#[derive(Clone, Debug)]
pub enum Blank {
    /// A box with its lower and upper corner.
    Box([Vector3<f64>; 2]),
    /// The inside of a mesh.
    Mesh(Arc<ClosedMesh>),
}

impl Blank {
    /// Lower and upper corner of its bounding box, m.
    #[must_use]
    pub fn bounds(&self) -> [Vector3<f64>; 2] {
        match self {
            Self::Box(corners) => *corners,
            Self::Mesh(mesh) => mesh.bounds(),
        }
    }

    /// Signed depth of a point in the blank, m: positive inside. For a mesh its size is known up to a bound of one millimetre.
    #[inline]
    #[must_use]
    pub fn depth(&self, point: &Vector3<f64>) -> f64 {
        match self {
            Self::Box([low, high]) => {
                let inside = |k: usize| (point[k] - low[k]).min(high[k] - point[k]);
                inside(0).min(inside(1)).min(inside(2))
            }
            Self::Mesh(mesh) => mesh.depth(point),
        }
    }

    /// Intervals of the blank on the line along z through a point.
    pub(super) fn spans(&self, x: f64, y: f64, mut each: impl FnMut(f64, f64)) {
        match self {
            Self::Box([low, high]) => {
                if x >= low.x && x < high.x && y >= low.y && y < high.y {
                    each(low.z, high.z);
                }
            }
            Self::Mesh(mesh) => mesh.spans(x, y, each),
        }
    }
}
