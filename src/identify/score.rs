//! Evidence of a set of effects, from moments alone.
//!
//! With θ ~ N(0, τ²) about neutral and Gaussian noise, the marginal likelihood of the data is
//! `−n ln σ − ½ yᵀy/σ² + ½ (b/σ²)ᵀ(I + G/σ²)⁻¹(b/σ²) − ½ ln det(I + G/σ²)`, G and b over the prior sizes. It punishes
//! parameters that the data do not need by itself; σ is profiled, the noise's shape chosen with it.

use super::noise::Moments;
use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// A scored set of columns.
#[derive(Clone, Debug)]
pub(super) struct Score {
    /// Log evidence, nats, the noise at its best.
    pub(super) evidence: f64,
    /// White noise, per axis, mm.
    pub(super) sigma: f64,
    /// Index of the noise's shape.
    pub(super) shape: usize,
}

/// Noise below this is not believed, mm: no instrument measures a robot to a tenth of a micrometre.
const LEAST_SIGMA: f64 = 1e-4;

/// Best evidence of the columns over all noise shapes.
pub(super) fn score(moments: &[Moments], columns: &[usize]) -> Score {
    let mut best = Score { evidence: f64::NEG_INFINITY, sigma: LEAST_SIGMA, shape: 0 };
    for (shape, moments) in moments.iter().enumerate() {
        let (evidence, sigma) = profiled(moments, columns);
        if evidence > best.evidence {
            best = Score { evidence, sigma, shape };
        }
    }
    best
}

/// Evidence for one shape with σ at its best.
pub(super) fn profiled(moments: &Moments, columns: &[usize]) -> (f64, f64) {
    let gram = moments.gram.select_rows(columns).select_columns(columns);
    let cross = moments.cross.select_rows(columns);
    // An empty matrix has no decomposition.
    let (values, along) = if columns.is_empty() {
        (DVector::zeros(0), DVector::zeros(0))
    } else {
        let eigen = SymmetricEigen::new(gram);
        (eigen.eigenvalues, eigen.eigenvectors.tr_mul(&cross))
    };
    let n = moments.count as f64;
    let evidence = |log_sigma: f64| {
        let precision = (-2.0 * log_sigma).exp();
        let mut sum = -n * log_sigma - 0.5 * moments.square * precision - moments.log_scale;
        for (value, b) in values.iter().zip(along.iter()) {
            let spread = 1.0 + value.max(0.0) * precision;
            sum += 0.5 * (b * precision).powi(2) / spread - 0.5 * spread.ln();
        }
        sum + moments.shape.log_prior()
    };
    // Golden section over six decades around the plain rms.
    let middle = 0.5 * (moments.square / n.max(1.0)).max(LEAST_SIGMA * LEAST_SIGMA).ln();
    let (mut low, mut high) = ((middle - 9.0).max(LEAST_SIGMA.ln()), middle + 2.0);
    let ratio = 0.5 * (5f64.sqrt() - 1.0);
    let (mut a, mut b) = (high - ratio * (high - low), low + ratio * (high - low));
    let (mut at_a, mut at_b) = (evidence(a), evidence(b));
    while high - low > 1e-4 {
        if at_a > at_b {
            (high, b, at_b) = (b, a, at_a);
            a = high - ratio * (high - low);
            at_a = evidence(a);
        } else {
            (low, a, at_a) = (a, b, at_b);
            b = low + ratio * (high - low);
            at_b = evidence(b);
        }
    }
    let best = 0.5 * (low + high);
    (evidence(best), best.exp())
}

/// Posterior mean and covariance of the columns' parameters in units of their prior sizes.
pub(super) fn posterior(moments: &Moments, columns: &[usize], sigma: f64) -> Option<(DVector<f64>, DMatrix<f64>)> {
    let precision = sigma.powi(-2);
    let gram = moments.gram.select_rows(columns).select_columns(columns);
    let matrix = DMatrix::identity(columns.len(), columns.len()) + gram * precision;
    let inverse = matrix.cholesky()?.inverse();
    let mean = &inverse * moments.cross.select_rows(columns) * precision;
    Some((mean, inverse))
}
