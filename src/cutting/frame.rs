//! The feed frame from what a program gives: tool axis, feed chord, lead and tilt.

use nalgebra::{Matrix3, Rotation3, Unit, Vector3};

/// Below this sine between chord and tool axis the move is a plunge and has no feed direction on
/// the surface: half a degree, above the noise of printed coordinates over a short chord.
const PLUNGE_SINE: f64 = 0.01;

/// The tool axis, tip to spindle, in the feed frame: third column of `Rx(tilt) · Ry(lead)`.
pub(super) fn axis(lead: f64, tilt: f64) -> Unit<Vector3<f64>> {
    let ((sl, cl), (st, ct)) = (lead.sin_cos(), tilt.sin_cos());
    Unit::new_normalize(Vector3::new(sl, -st * cl, ct * cl))
}

/// Rotation whose columns are feed, cross-feed and surface normal, in the frame of the arguments.
///
/// The normal is the one against which `tool_axis` (tip to spindle) has this `lead` and `tilt`
/// while `feed` (any length) projects onto the surface along +x: a chord that climbs or dives
/// against the surface is projected. `None` for a plunge along the tool axis and where no surface
/// fits.
pub fn feed_frame(tool_axis: &Unit<Vector3<f64>>, feed: &Vector3<f64>, lead: f64, tilt: f64) -> Option<Rotation3<f64>> {
    let chord = feed.try_normalize(0.0)?;
    let along = chord.dot(tool_axis);
    let across_vector = chord - tool_axis.into_inner() * along;
    let across = across_vector.norm();
    if across.is_nan() || across <= PLUNGE_SINE {
        return None;
    }
    // Cutter frame at spin 0: x is the chord seen along the axis.
    let x = across_vector / across;
    let cutter = Matrix3::from_columns(&[x, tool_axis.cross(&x), tool_axis.into_inner()]);

    // Rows of Rx(tilt)·Ry(lead) are the feed frame's axes in the cutter frame. Find the spin s of
    // the cutter frame about the tool axis for which the chord has no cross-feed part:
    // a·cos s − b·sin s = c.
    let ((sl, cl), (st, ct)) = (lead.sin_cos(), tilt.sin_cos());
    let (a, b, c) = (st * sl * across, ct * across, st * cl * along);
    let reach = a.hypot(b);
    if c.abs() > reach {
        return None;
    }
    let (middle, half) = (b.atan2(a), (c / reach).acos());
    let forward = |s: f64| cl * across * s.cos() + sl * along;
    let (s1, s2) = (half - middle, -half - middle);
    let spin = if forward(s1) >= forward(s2) { s1 } else { s2 };
    if forward(spin) <= 0.0 {
        return None;
    }
    let (sin, cos) = spin.sin_cos();
    let spun = cutter * Matrix3::new(cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0);
    let feed_from_cutter = Matrix3::new(cl, 0.0, sl, st * sl, ct, -st * cl, -ct * sl, st, ct * cl);
    Some(Rotation3::from_matrix_unchecked(spun * feed_from_cutter.transpose()))
}
