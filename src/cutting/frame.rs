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
    Lean::new(lead, tilt).feed_frame(tool_axis, feed)
}

/// Lead and tilt of the tool against the surface that it cuts.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lean {
    sin_lead: f64,
    cos_lead: f64,
    sin_tilt: f64,
    cos_tilt: f64,
}

impl Lean {
    /// From angles in rad.
    pub(crate) fn new(lead: f64, tilt: f64) -> Self {
        let ((sin_lead, cos_lead), (sin_tilt, cos_tilt)) = (lead.sin_cos(), tilt.sin_cos());
        Self { sin_lead, cos_lead, sin_tilt, cos_tilt }
    }

    /// See [`feed_frame`].
    pub(crate) fn feed_frame(&self, tool_axis: &Unit<Vector3<f64>>, feed: &Vector3<f64>) -> Option<Rotation3<f64>> {
        let Self { sin_lead: sl, cos_lead: cl, sin_tilt: st, cos_tilt: ct } = *self;
        let chord = feed.try_normalize(0.0)?;
        let along = chord.dot(tool_axis);
        let across_vector = chord - tool_axis.into_inner() * along;
        let across = across_vector.norm();
        if across.is_nan() || across <= PLUNGE_SINE {
            return None;
        }
        // Cutter frame at spin 0: x is the chord seen along the axis.
        let x = across_vector / across;
        let y = tool_axis.cross(&x);

        // Rows of Rx(tilt)·Ry(lead) are the feed frame's axes in the cutter frame. Find the spin s of
        // the cutter frame about the tool axis for which the chord has no cross-feed part:
        // a·cos s − b·sin s = c. With cos m = a/√(a²+b²) and cos h = c/√(a²+b²) that is s = ±h − m.
        let (a, b, c) = (st * sl * across, ct * across, st * cl * along);
        let reach = (a * a + b * b).sqrt();
        if c.abs() > reach {
            return None;
        }
        let (cos_m, sin_m, cos_h) = (a / reach, b / reach, c / reach);
        let sin_h = ((1.0 - cos_h) * (1.0 + cos_h)).sqrt();
        let spin = |sin_h: f64| (sin_h * cos_m - cos_h * sin_m, cos_h * cos_m + sin_h * sin_m);
        let forward = |cos: f64| cl * across * cos + sl * along;
        let (one, other) = (spin(sin_h), spin(-sin_h));
        let (sin, cos) = if forward(one.1) >= forward(other.1) { one } else { other };
        if forward(cos) <= 0.0 {
            return None;
        }
        let spun = Matrix3::from_columns(&[x * cos + y * sin, y * cos - x * sin, tool_axis.into_inner()]);
        let feed_from_cutter = Matrix3::new(cl, 0.0, sl, st * sl, ct, -st * cl, -ct * sl, st, ct * cl);
        Some(Rotation3::from_matrix_unchecked(spun * feed_from_cutter.transpose()))
    }
}
