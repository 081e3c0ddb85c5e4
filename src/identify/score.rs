//! Evidence of a set of effects, from moments alone.
//!
//! With θ ~ N(0, τ²) about neutral and Gaussian noise, the marginal likelihood of the data is
//! `−n ln σ − ½ yᵀy/σ² + ½ (b/σ²)ᵀ(I + G/σ²)⁻¹(b/σ²) − ½ ln det(I + G/σ²)`, G and b over the prior sizes. It punishes
//! parameters that the data do not need by itself; σ is profiled, the noise's shape chosen with it.

use super::noise::Moments;
use nalgebra::{DMatrix, DVector};

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

/// A column of the design and the share of its typical size that the prior has.
pub(super) type Column = (usize, f64);

fn chosen(moments: &Moments, columns: &[Column]) -> (DMatrix<f64>, DVector<f64>) {
    let size = columns.len();
    let gram = DMatrix::from_fn(size, size, |i, j| {
        let ((a, s), (b, t)) = (columns[i], columns[j]);
        moments.gram[(a, b)] * s * t
    });
    let cross = DVector::from_fn(size, |i, _| moments.cross[columns[i].0] * columns[i].1);
    (gram, cross)
}

/// Best evidence of the columns over all noise shapes.
pub(super) fn score(moments: &[Moments], columns: &[Column]) -> Score {
    let mut best = Score { evidence: f64::NEG_INFINITY, sigma: LEAST_SIGMA, shape: 0 };
    for (shape, moments) in moments.iter().enumerate() {
        let (evidence, sigma) = profiled(moments, columns, None);
        if evidence > best.evidence {
            best = Score { evidence, sigma, shape };
        }
    }
    best
}

/// Evidence for one shape with σ at its best, searched from `guess`.
pub(super) fn profiled(moments: &Moments, columns: &[Column], guess: Option<f64>) -> (f64, f64) {
    let (gram, cross) = chosen(moments, columns);
    let n = moments.count as f64;
    let size = columns.len();
    let at = |log_sigma: f64| {
        let precision = (-2.0 * log_sigma).exp();
        let base = -n * log_sigma - 0.5 * moments.square * precision - moments.log_scale + moments.shape.log_prior();
        if size == 0 {
            return base;
        }
        let mut matrix = &gram * precision;
        (0..size).for_each(|i| matrix[(i, i)] += 1.0);
        let Some(factor) = matrix.cholesky() else { return f64::NEG_INFINITY };
        let mut white = cross.clone();
        let half_log_det: f64 = factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum();
        factor.l_dirty().solve_lower_triangular_mut(&mut white);
        base + 0.5 * white.norm_squared() * precision * precision - half_log_det
    };
    let rms = 0.5 * (moments.square / n.max(1.0)).max(LEAST_SIGMA * LEAST_SIGMA).ln();
    let mut middle = guess.map_or(rms, f64::ln);
    let mut width = if guess.is_some() { 0.05 } else { 0.4 };
    let mut best = (at(middle), middle);
    // Parabola through three points.
    for _ in 0..20 {
        let (left, right) = (at(middle - width), at(middle + width));
        let centre = best.0;
        let curve = left - 2.0 * centre + right;
        let step = if curve < 0.0 { 0.5 * width * (left - right) / curve } else { width.copysign(right - left) };
        let step = step.clamp(-2.0 * width, 2.0 * width);
        let next = (middle + step).max(LEAST_SIGMA.ln());
        let value = at(next);
        for (evidence, place) in [(left, middle - width), (right, middle + width), (value, next)] {
            if evidence > best.0 {
                best = (evidence, place);
            }
        }
        // The evidence falls by n·δ²: a hundredth of a nat is enough.
        if n * step * step < 0.01 {
            break;
        }
        // Far from the top the steps grow, near it they shrink.
        width = if step.abs() < width { (0.3 * width).max(0.01) } else { (2.0 * width).min(0.8) };
        middle = best.1;
    }
    (best.0, best.1.exp())
}

/// Posterior mean and covariance of the columns' parameters in units of their prior sizes.
pub(super) fn posterior(moments: &Moments, columns: &[Column], sigma: f64) -> Option<(DVector<f64>, DMatrix<f64>)> {
    let precision = sigma.powi(-2);
    let (gram, cross) = chosen(moments, columns);
    let matrix = DMatrix::identity(columns.len(), columns.len()) + gram * precision;
    let inverse = matrix.cholesky()?.inverse();
    let mean = &inverse * cross * precision;
    Some((mean, inverse))
}
