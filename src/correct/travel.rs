//! The shortest way that has a direction.

/// Chords shorter than this give no direction, m: printed digits.
pub(super) const CHORD: f64 = 1e-6;
