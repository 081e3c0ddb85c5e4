use deflex_effects::ForceLaw;
use deflex_lanes::{LaneMask, Lanes, Real, Vector};

/// A number type over which equilibria are solved: a single number, or several lanes.
pub(crate) trait Number: Real {
    /// Writes the forces of a law into `out`, N, feed frame, for those targets whose lane is set in `wanted`. `shift` is the shift of the
    /// tip, m, and `axis` the direction of the tool axis, both in the feed frame.
    fn force(law: &dyn ForceLaw, wanted: Self::Mask, shift: &Vector<Self>, axis: &Vector<Self>, out: &mut Vector<Self>);
}

impl Number for f64 {
    fn force(law: &dyn ForceLaw, wanted: bool, shift: &Vector<f64>, axis: &Vector<f64>, out: &mut Vector<f64>) {
        if wanted {
            out.set(0, &law.force(&shift.lane(0), &axis.lane(0)));
        }
    }
}

impl Number for Lanes {
    fn force(law: &dyn ForceLaw, wanted: LaneMask, shift: &Vector, axis: &Vector, out: &mut Vector) {
        law.forces(wanted, shift, axis, out);
    }
}
