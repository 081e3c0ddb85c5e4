//! Robust and elementary statistics of residuals.

/// Standard deviation of normal numbers relative to the median of their absolute values.
pub(super) const TO_SIGMA: f64 = 1.4826;

/// The upper median; zero if there are no values.
pub(super) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// The mean of some gains, in standard errors of that mean.
pub(super) fn in_standard_errors(gains: &[f64]) -> f64 {
    let n = gains.len() as f64;
    let mean = gains.iter().sum::<f64>() / n;
    let variance = gains.iter().map(|gain| (gain - mean).powi(2)).sum::<f64>() / (n * (n - 1.0)).max(1.0);
    mean / variance.sqrt().max(f64::MIN_POSITIVE)
}
