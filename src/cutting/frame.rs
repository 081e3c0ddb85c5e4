//! The feed frame from what a program gives: tool axis, feed chord, lead and tilt.

use crate::lanes::{Frame, Lanes, Mask, Vector};
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

/// Lead and tilt of the tool against the surface that it cuts, and what follows from them for every feed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lean {
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
    pub(crate) fn new(lead: f64, tilt: f64) -> Self {
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
    pub(crate) fn feed_frame(&self, tool_axis: &Unit<Vector3<f64>>, feed: &Vector3<f64>) -> Option<Rotation3<f64>> {
        let along = feed.dot(tool_axis);
        let across_vector = feed - tool_axis.into_inner() * along;
        let square = across_vector.norm_squared();
        if square.is_nan() || square <= PLUNGE_SINE * PLUNGE_SINE * feed.norm_squared() {
            return None;
        }
        // Cutter frame at spin 0: x is the chord seen along the axis.
        let across = square.sqrt();
        let x = across_vector * (1.0 / across);
        let y = tool_axis.cross(&x);

        // Find the spin s of the cutter frame about the tool axis for which the chord has no cross-feed part:
        // a·cos s − b·sin s = c with a = sin tilt · sin lead · across, b = cos tilt · across,
        // c = sin tilt · cos lead · along. With cos m = a/√(a²+b²) and cos h = c/√(a²+b²) that is s = ±h − m.
        let cos_h = self.slant * (along / across);
        if cos_h.is_nan() || cos_h.abs() > 1.0 {
            return None;
        }
        let sin_h = ((1.0 - cos_h) * (1.0 + cos_h)).sqrt();
        let spin = |sin_h: f64| (sin_h * self.cos_m - cos_h * self.sin_m, cos_h * self.cos_m + sin_h * self.sin_m);
        let forward = |cos: f64| self.cos_lead * across * cos + self.sin_lead * along;
        let (one, other) = (spin(sin_h), spin(-sin_h));
        let (sin, cos) = if forward(one.1) >= forward(other.1) { one } else { other };
        if forward(cos) <= 0.0 {
            return None;
        }
        let spun = Matrix3::from_columns(&[x * cos + y * sin, y * cos - x * sin, tool_axis.into_inner()]);
        Some(Rotation3::from_matrix_unchecked(spun * self.cutter_from_feed))
    }

    /// Axes of eight [`Lean::feed_frame`]s, and which of them there are.
    #[inline(always)]
    pub(crate) fn feed_frames(&self, tool_axis: Vector, feed: Vector) -> (Frame, Mask) {
        let one = Lanes::of(1.0);
        let along = feed.dot(tool_axis);
        let across_vector = feed - tool_axis * along;
        let square = across_vector.dot(across_vector);
        let leaves = (feed.dot(feed) * (PLUNGE_SINE * PLUNGE_SINE)).lt(square);
        let across = square.sqrt();
        let x = across_vector * (one / across);
        let y = tool_axis.cross(x);

        let cos_h = along / across * self.slant;
        let leans = one.ge(cos_h.abs());
        let sin_h = ((one - cos_h) * (one + cos_h)).sqrt();
        let forward = |cos: Lanes| across * self.cos_lead * cos + along * self.sin_lead;
        let (sine, cosine) = (cos_h * self.sin_m, cos_h * self.cos_m);
        let (one_cos, other_cos) = (cosine + sin_h * self.sin_m, cosine - sin_h * self.sin_m);
        let first = forward(one_cos).ge(forward(other_cos));
        let cos = first.select(one_cos, other_cos);
        let sin = first.select(sin_h * self.cos_m - sine, -(sin_h * self.cos_m) - sine);
        let cutter = Frame { x: x * cos + y * sin, y: y * cos - x * sin, z: tool_axis, origin: Vector::default() };
        let m = &self.cutter_from_feed;
        let frame = Frame {
            x: cutter.x * m.m11 + cutter.y * m.m21 + cutter.z * m.m31,
            y: cutter.x * m.m12 + cutter.y * m.m22 + cutter.z * m.m32,
            z: cutter.x * m.m13 + cutter.y * m.m23 + cutter.z * m.m33,
            origin: Vector::default(),
        };
        (frame, leaves & leans & Lanes::ZERO.lt(forward(cos)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::WIDTH;
    use proptest::prelude::*;

    proptest! {
        /// To the bit: which of the two a target goes through depends on the targets beside it.
        #[test]
        fn eight_feed_frames_are_those_of_one(
            lead in prop_oneof![Just(0.0), -0.3_f64..0.3],
            tilt in prop_oneof![Just(0.0), -0.3_f64..0.3],
            axes in prop::array::uniform8(prop::array::uniform3(-1.0_f64..1.0)),
            feeds in prop::array::uniform8(prop::array::uniform3(-1.0_f64..1.0)),
            along in prop::sample::select(vec![0.0, 0.0, 1.0, -1.0, 30.0]),
        ) {
            let axes = axes.map(|axis| Unit::new_normalize(Vector3::from(axis) + Vector3::z() * 0.01));
            let (mut eight_axes, mut eight_feeds) = (Vector::default(), Vector::default());
            let feeds: [Vector3<f64>; WIDTH] =
                std::array::from_fn(|i| (Vector3::from(feeds[i]) + axes[i].into_inner() * along).normalize());
            for lane in 0..WIDTH {
                eight_axes.set(lane, &axes[lane]);
                eight_feeds.set(lane, &feeds[lane]);
            }
            let lean = Lean::new(lead, tilt);
            let (frames, found) = lean.feed_frames(eight_axes, eight_feeds);
            for lane in 0..WIDTH {
                let plain = lean.feed_frame(&axes[lane], &feeds[lane]);
                prop_assert_eq!(found.lane(lane).then(|| frames.rotation(lane)), plain);
            }
        }
    }
}
