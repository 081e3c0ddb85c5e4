//! Directions of motion: of the joints from one commanded position to the next, and the least way that has one.

use crate::robot::Joints;

/// Directions of commanded motion smaller than this are stops, rad (`docs/effects.md`).
pub(super) const TRAVEL_THRESHOLD: f64 = 1e-7;

/// Direction of travel from one commanded position to the next, held through stops.
pub(super) fn travel(previous: &Joints, now: &Joints, held: &Joints) -> Joints {
    Joints::from_fn(|i, _| {
        let step = now[i] - previous[i];
        if step.abs() > TRAVEL_THRESHOLD { step.signum() } else { held[i] }
    })
}

/// Chords shorter than this give no direction, m: printed digits.
pub(super) const CHORD: f64 = 1e-6;
