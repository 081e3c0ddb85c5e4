//! Distances that joints and the tool move.

use deflex_robot::Joints;

/// Sum of the motions of all joints between two postures, rad.
pub(super) fn moved(from: &Joints, to: &Joints) -> f64 {
    // As a slice: the iterator of the matrix would compute strides.
    (to - from).as_slice().iter().map(|step| step.abs()).sum()
}

/// Chords shorter than this have no direction, m: they are within the printed digits.
pub(super) const CHORD: f64 = 1e-6;
