//! How far joints and the tool move.

use crate::robot::Joints;

/// How far the joints move from one position to another, all together, rad.
pub(super) fn moved(from: &Joints, to: &Joints) -> f64 {
    // A slice: the matrix's own iterator counts strides.
    (to - from).as_slice().iter().map(|step| step.abs()).sum()
}

/// Chords shorter than this give no direction, m: printed digits.
pub(super) const CHORD: f64 = 1e-6;
