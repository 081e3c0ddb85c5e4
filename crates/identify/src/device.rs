//! The unknown part of a measuring instrument: the frame of a tracker, the fixed point of a draw-wire sensor, or
//! nothing.

use nalgebra::{Matrix3, Matrix4, UnitQuaternion, Vector3, Vector4};

/// The unknown part of a run's instrument.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Device {
    /// It measures in the work object, and nothing is unknown.
    Known,
    /// It measures in a frame of its own. The pose of that frame and the orientation of the probe are fitted.
    Frame {
        /// Orientation of the probe on the tool, which matters if orientations are measured.
        tcp_from_probe: UnitQuaternion<f64>,
    },
    /// It measures lengths from this point, which is fitted; work object axes, mm.
    Point(Vector3<f64>),
}

/// The fixed point d from which the lengths to some places p were measured, mm; `None` if there are too few pairs of
/// place and length.
///
/// The squared length |p − d|² is linear in d and |d|², so that linear least squares give a start. If the places lie in
/// a plane, d can be on either side of it: the side that fits better is taken, and the upper one if both fit alike.
pub(super) fn fixed_point(pairs: &[(Vector3<f64>, f64)]) -> Option<Vector3<f64>> {
    const FEWEST_ROWS: usize = 4;
    if pairs.len() < FEWEST_ROWS {
        return None;
    }
    let n = pairs.len() as f64;
    let centre = pairs.iter().map(|pair| pair.0).sum::<Vector3<f64>>() / n;
    let scatter: Matrix3<f64> =
        pairs.iter().map(|(p, _)| (p - centre) * (p - centre).transpose()).sum::<Matrix3<f64>>() / n;
    let axes = scatter.symmetric_eigen();
    let flat = axes.eigenvalues.imin();
    let mut normal: Vector3<f64> = axes.eigenvectors.column(flat).into();
    if normal.z < 0.0 {
        normal = -normal;
    }
    // The ridge, mm², keeps d at the centre in a direction in which the places do not spread; from there both sides are
    // tried.
    const RIDGE: f64 = 1.0;
    let (mut matrix, mut right) = (Matrix4::identity() * RIDGE, Vector4::zeros());
    matrix[(3, 3)] = 0.0;
    for (p, length) in pairs {
        let q = p - centre;
        let row = Vector4::new(-2.0 * q.x, -2.0 * q.y, -2.0 * q.z, 1.0);
        matrix += row * row.transpose();
        right += row * (length * length - q.norm_squared());
    }
    let solved = matrix.lu().solve(&right)?;
    let near = Vector3::new(solved.x, solved.y, solved.z);
    let above = (solved.w - near.norm_squared()).max(0.0).sqrt();
    let misfit =
        |d: &Vector3<f64>| pairs.iter().map(|(p, length)| (length - (p - centre - d).norm()).powi(2)).sum::<f64>();
    let starts = [near + above * normal, near, near - above * normal];
    let settled = starts.map(|start| descend(pairs, centre, start));
    settled.into_iter().min_by(|a, b| misfit(a).total_cmp(&misfit(b))).map(|d| centre + d)
}

/// The local minimum of the squared errors of the lengths near `at`, by the Gauss-Newton method. Both points are
/// relative to the centre of the places.
fn descend(pairs: &[(Vector3<f64>, f64)], centre: Vector3<f64>, mut at: Vector3<f64>) -> Vector3<f64> {
    const STEPS: usize = 50;
    /// Damping, in rows. Lengths to places in a plane do not determine a small height above the plane.
    const DAMPING: f64 = 1e-6;
    for _ in 0..STEPS {
        let (mut matrix, mut right) = (Matrix3::identity() * DAMPING, Vector3::zeros());
        for (p, length) in pairs {
            let from = at - (p - centre);
            let unit = from.normalize();
            matrix += unit * unit.transpose();
            right += unit * (length - from.norm());
        }
        let Some(step) = matrix.cholesky().map(|factor| factor.solve(&right)) else { return at };
        at += step;
        if step.norm() < 1e-9 {
            break;
        }
    }
    at
}
