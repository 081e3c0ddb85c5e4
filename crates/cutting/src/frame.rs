//! The feed frame, computed from tool axis, feed direction, lead and tilt.

use deflex_lanes::{Frame, Mask, Real, Vector};
use nalgebra::{Matrix3, Rotation3, Unit, Vector3};

/// Below this sine between chord and tool axis the move is a plunge and has no feed direction on
/// the surface: half a degree, above the noise of printed coordinates over a short chord.
const PLUNGE_SINE: f64 = 0.01;

/// The tool axis, tip to spindle, in the feed frame: third column of `Rx(tilt) · Ry(lead)`.
pub(super) fn axis(lead: f64, tilt: f64) -> Unit<Vector3<f64>> {
    let ((sl, cl), (st, ct)) = (lead.sin_cos(), tilt.sin_cos());
    Unit::new_normalize(Vector3::new(sl, -st * cl, ct * cl))
}

/// The cutter frame of a tool axis; its columns are in the feed frame. y is perpendicular to axis and feed. `across` is
/// the length of the feed's component across the axis.
pub(super) fn cutter(axis: &Unit<Vector3<f64>>, across: f64) -> Matrix3<f64> {
    let y = Vector3::new(0.0, axis.z, -axis.y) / across;
    Matrix3::from_columns(&[y.cross(axis), y, axis.into_inner()])
}

/// Rotation whose columns are feed, cross-feed and surface normal, in the frame of the arguments.
///
/// The normal is the one against which `tool_axis` (tip to spindle) has this `lead` and `tilt`
/// while `feed` (any length) projects onto the surface along +x: a chord that climbs or dives
/// against the surface is projected. `None` for a plunge along the tool axis and where no surface
/// fits.
///
/// # Examples
/// ```
/// use deflex_cutting::feed_frame;
/// use nalgebra::Vector3;
///
/// let frame = feed_frame(&Vector3::z_axis(), &Vector3::new(0.0, 2.0, 0.0), 0.0, 0.0).expect("no plunge");
/// assert!((frame * Vector3::x() - Vector3::y()).norm() < 1e-12); // x of the frame is the feed
/// assert!(feed_frame(&Vector3::z_axis(), &-Vector3::z(), 0.0, 0.0).is_none());
/// ```
pub fn feed_frame(tool_axis: &Unit<Vector3<f64>>, feed: &Vector3<f64>, lead: f64, tilt: f64) -> Option<Rotation3<f64>> {
    Lean::new(lead, tilt).feed_frame(tool_axis, feed)
}

/// Lead and tilt of the tool relative to the surface that it cuts, and values derived from them that are the same for
/// every feed.
#[derive(Clone, Copy, Debug)]
#[doc(hidden)]
pub struct Lean {
    sin_lead: f64,
    cos_lead: f64,
    /// See [`Lean::feed_frame`].
    sin_m: f64,
    cos_m: f64,
    slant: f64,
    cutter_from_feed: Matrix3<f64>,
}

impl Lean {
    /// From angles in rad.
    pub fn new(lead: f64, tilt: f64) -> Self {
        let ((sl, cl), (st, ct)) = (lead.sin_cos(), tilt.sin_cos());
        let reach = (st * sl).hypot(ct);
        Self {
            sin_lead: sl,
            cos_lead: cl,
            sin_m: ct / reach,
            cos_m: st * sl / reach,
            slant: st * cl / reach,
            // Columns are the rows of Rx(tilt)·Ry(lead): the feed frame's axes in the cutter frame.
            cutter_from_feed: Matrix3::new(cl, st * sl, -ct * sl, 0.0, ct, st, sl, -st * cl, ct * cl),
        }
    }

    /// See [`feed_frame`].
    pub fn feed_frame(&self, tool_axis: &Unit<Vector3<f64>>, feed: &Vector3<f64>) -> Option<Rotation3<f64>> {
        let (frame, found) = self.feed_frames::<f64>(Vector::of(tool_axis), Vector::of(feed));
        found.then(|| frame.rotation(0))
    }

    /// Axes of feed frames, and the lanes in which a feed frame exists.
    #[inline(always)]
    pub fn feed_frames<R: Real>(&self, tool_axis: Vector<R>, feed: Vector<R>) -> (Frame<R>, R::Mask) {
        let one = R::of(1.0);
        let along = feed.dot(tool_axis);
        let across_vector = feed - tool_axis * along;
        let square = across_vector.dot(across_vector);
        let leaves = (feed.dot(feed) * (PLUNGE_SINE * PLUNGE_SINE)).lt(square);
        // Cutter frame at spin 0: x is the chord seen along the axis.
        let across = square.sqrt();
        let x = across_vector * (one / across);
        let y = tool_axis.cross(x);

        // Find the spin s of the cutter frame about the tool axis for which the chord has no cross-feed part:
        // a·cos s − b·sin s = c with a = sin tilt · sin lead · across, b = cos tilt · across,
        // c = sin tilt · cos lead · along. With cos m = a/√(a²+b²) and cos h = c/√(a²+b²) that is s = ±h − m.
        let cos_h = along / across * self.slant;
        let leans = one.ge(cos_h.abs());
        let sin_h = ((one - cos_h) * (one + cos_h)).sqrt();
        let forward = |cos: R| across * self.cos_lead * cos + along * self.sin_lead;
        let (sine, cosine) = (cos_h * self.sin_m, cos_h * self.cos_m);
        let (one_cos, other_cos) = (cosine + sin_h * self.sin_m, cosine - sin_h * self.sin_m);
        let first = forward(one_cos).ge(forward(other_cos));
        let cos = first.select(one_cos, other_cos);
        let sin = first.select(sin_h * self.cos_m - sine, -(sin_h * self.cos_m) - sine);
        let (cutter_x, cutter_y) = (x * cos + y * sin, y * cos - x * sin);
        let m = &self.cutter_from_feed;
        let axis = |k: usize| cutter_x * R::of(m[(0, k)]) + cutter_y * R::of(m[(1, k)]) + tool_axis * R::of(m[(2, k)]);
        let frame = Frame { x: axis(0), y: axis(1), z: axis(2), origin: Vector::ZERO };
        (frame, leaves & leans & R::ZERO.lt(forward(cos)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Rounding of unit vectors, where chord and axis are half a degree apart at least.
    const SAME: f64 = 1e-11;

    proptest! {
        /// The defining properties: the axis leans as declared, the chord has no cross-feed component, and it points
        /// ahead.
        #[test]
        fn the_axis_leans_as_declared_and_the_chord_points_ahead(
            lead in prop_oneof![Just(0.0), -0.3_f64..0.3],
            tilt in prop_oneof![Just(0.0), -0.3_f64..0.3],
            tool_axis in prop::array::uniform3(-1.0_f64..1.0),
            feed in prop::array::uniform3(-1.0_f64..1.0),
        ) {
            let tool_axis = Unit::new_normalize(Vector3::from(tool_axis) + Vector3::z() * 0.01);
            let feed = Vector3::from(feed).normalize();
            let Some(frame) = Lean::new(lead, tilt).feed_frame(&tool_axis, &feed) else {
                // A plunge, or a climb steeper than the lean allows.
                let along = feed.dot(&tool_axis).abs();
                prop_assert!(along > 0.5, "{along}");
                return Ok(());
            };
            let matrix = frame.matrix();
            prop_assert!((matrix.transpose() * matrix - Matrix3::identity()).norm() < SAME);
            let (seen_axis, seen_feed) = (frame.inverse() * tool_axis.into_inner(), frame.inverse() * feed);
            prop_assert!((seen_axis - axis(lead, tilt).into_inner()).norm() < SAME, "{seen_axis}");
            prop_assert!(seen_feed.y.abs() < SAME && seen_feed.x > 0.0, "{seen_feed}");
        }
    }
}
