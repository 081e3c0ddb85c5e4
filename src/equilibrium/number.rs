use crate::effects::ForceLaw;
use crate::lanes::{LaneMask, Lanes, Real, Vector};

/// A number that equilibria are solved over: one that a force law answers for.
pub(crate) trait Number: Real {
    /// Forces, N, feed frame, of those targets that are wanted: for shifts of the tip, m, and tool axes there.
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
