//! The numbers of a pose, for a position that is edited and for a new one.

/// Least decimals of X … R: as many as every controller prints and reads (`docs/formats.md`).
pub(super) const DECIMALS: usize = 3;

/// Of the two triples of angles for one orientation, the one that is nearer to another triple. In the second triple the first and the last
/// angle differ by half a turn, and the second one is counted from the other side.
pub(super) fn nearest(wpr: [f64; 3], before: [f64; 3]) -> [f64; 3] {
    let within = |angle: f64| angle - 360.0 * (angle / 360.0).round();
    let [w, p, r] = wpr;
    let other = [within(w + 180.0), within(180.0 - p), within(r + 180.0)];
    let off = |angles: &[f64; 3]| (0..3).map(|i| within(angles[i] - before[i]).powi(2)).sum::<f64>();
    if off(&other) < off(&wpr) { other } else { wpr }
}
