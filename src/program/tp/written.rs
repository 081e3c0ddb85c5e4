//! How a pose becomes the numbers of a position, of one that is edited and of a new one.

/// Least decimals of X … R: as many as every controller prints, and reads (`docs/formats.md`).
pub(super) const DECIMALS: usize = 3;

/// Of the angles of one orientation, those next to others: half a turn of the first and the last goes with the second counted
/// from the other side.
pub(super) fn nearest(wpr: [f64; 3], before: [f64; 3]) -> [f64; 3] {
    let within = |angle: f64| angle - 360.0 * (angle / 360.0).round();
    let [w, p, r] = wpr;
    let other = [within(w + 180.0), within(180.0 - p), within(r + 180.0)];
    let off = |angles: &[f64; 3]| (0..3).map(|i| within(angles[i] - before[i]).powi(2)).sum::<f64>();
    if off(&other) < off(&wpr) { other } else { wpr }
}

/// The controller's reals are IEEE singles.
#[allow(clippy::cast_possible_truncation)]
pub(super) fn single(value: f64) -> f64 {
    f64::from(value as f32)
}
