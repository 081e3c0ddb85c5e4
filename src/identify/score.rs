//! Evidence of a set of effects, from moments alone.
//!
//! It punishes parameters that the data do not need by itself; σ is profiled, the noise's shape chosen with it (see
//! [`profiled`]). A prior about μ, in the same sizes, makes `b/σ² + μ` of `b/σ²` and takes off `½ μᵀμ`. Numbers that are bounded
//! add the log of the share of their posterior within the bounds, less that of their prior.

use super::columns::Columns;
use super::moments::Moments;
use super::profile::{LEAST_SIGMA, profiled};
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

/// Best evidence of the columns over all noise shapes, σ searched from a guess where there is one.
pub(super) fn score(moments: &[Moments], columns: &Columns, guess: Option<f64>) -> Score {
    let mut best = Score { evidence: f64::NEG_INFINITY, sigma: LEAST_SIGMA, shape: 0 };
    for (shape, moments) in moments.iter().enumerate() {
        let (evidence, sigma) = profiled(moments, columns, guess);
        if evidence > best.evidence {
            best = Score { evidence, sigma, shape };
        }
    }
    best
}

/// Posterior mean and covariance of the columns' parameters in units of their prior sizes.
pub(super) fn posterior(moments: &Moments, columns: &Columns, sigma: f64) -> Option<(DVector<f64>, DMatrix<f64>)> {
    let Normal { matrix, right } = Normal::of(moments, columns, sigma);
    let inverse = matrix.cholesky()?.inverse();
    Some((&inverse * right, inverse))
}

/// The normal equations of some columns' parameters in units of their prior sizes.
pub(super) struct Normal {
    matrix: DMatrix<f64>,
    right: DVector<f64>,
}

impl Normal {
    /// Those whose answer is a given one, whatever damps them.
    #[cfg(test)]
    pub(super) fn drawn_to(answer: Vec<f64>) -> Self {
        // So firm that no damping that is tried holds it back.
        const FIRM: f64 = 1e12;
        let right = DVector::from_vec(answer) * FIRM;
        Self { matrix: DMatrix::identity(right.len(), right.len()) * FIRM, right }
    }

    pub(super) fn of(moments: &Moments, columns: &Columns, sigma: f64) -> Self {
        let precision = sigma.powi(-2);
        let mut matrix = columns.gram(moments) * precision;
        columns.add_precision(&mut matrix);
        let mut right = columns.cross(moments) * precision;
        columns.add_means(&mut right);
        Self { matrix, right }
    }

    /// The most likely parameters within bounds, drawn towards `here` as by so many priors (Levenberg 1944): directions
    /// that the data hardly hold then stay, where a shorter step would keep all others back too.
    ///
    /// What would leave its bounds is held there and the rest solved anew, and let go again where the rest would rather
    /// have it back: clamping alone would leave the others where they belong beside a number that may not be.
    pub(super) fn likeliest(&self, bounds: &[(f64, f64)], here: &DVector<f64>, damping: f64) -> Option<DVector<f64>> {
        let mut matrix = self.matrix.clone();
        (0..matrix.nrows()).for_each(|i| matrix[(i, i)] += damping);
        let right = &self.right + here * damping;
        let mut held: Vec<Option<f64>> = vec![None; bounds.len()];
        let mut best = None;
        // Letting go and holding could go round in a circle where two are as good.
        for _ in 0..2 * bounds.len() {
            let free: Vec<usize> = (0..held.len()).filter(|&i| held[i].is_none()).collect();
            let mut left = right.clone();
            for (i, value) in held.iter().enumerate().filter_map(|(i, value)| Some((i, (*value)?))) {
                left.axpy(-value, &matrix.column(i), 1.0);
            }
            let inner = matrix.select_columns(&free).select_rows(&free);
            let solved = inner.cholesky()?.solve(&left.select_rows(&free));
            let mut all = DVector::from_iterator(held.len(), held.iter().map(|value| value.unwrap_or_default()));
            free.iter().zip(solved.iter()).for_each(|(&i, &value)| all[i] = value);
            let outside: Vec<usize> =
                free.into_iter().filter(|&i| all[i] < bounds[i].0 || all[i] > bounds[i].1).collect();
            if outside.is_empty() {
                // How much a held number pulls back from its bound.
                let pull = |i: usize| {
                    let slope = right[i] - matrix.column(i).dot(&all);
                    if all[i] <= bounds[i].0 { slope } else { -slope }
                };
                let wanted = (0..held.len()).filter(|&i| held[i].is_some()).map(|i| (pull(i), i));
                let wanted = wanted.max_by(|a, b| a.0.total_cmp(&b.0)).filter(|(pull, _)| *pull > 0.0);
                best = Some(all);
                match wanted {
                    Some((_, i)) => held[i] = None,
                    None => break,
                }
            } else {
                outside.iter().for_each(|&i| held[i] = Some(all[i].clamp(bounds[i].0, bounds[i].1)));
            }
        }
        best
    }
}

/// Mean of some gains over its standard error.
pub(super) fn in_standard_errors(gains: &[f64]) -> f64 {
    let n = gains.len() as f64;
    let mean = gains.iter().sum::<f64>() / n;
    let variance = gains.iter().map(|gain| (gain - mean).powi(2)).sum::<f64>() / (n * (n - 1.0)).max(1.0);
    mean / variance.sqrt().max(f64::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::super::noise::{Series, Shape};
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn beside_a_number_at_its_bound_the_others_are_solved_anew() {
        // y = (1, 3) on columns (1, 1) and (0, 1): without bounds (1, 2); with the second not above 0, the mean 2 of the first.
        let stacked = DMatrix::from_row_slice(2, 3, &[1.0, 0.0, 1.0, 1.0, 1.0, 3.0]);
        let series = [Series { samples: vec![(0, 0, 1.0), (1, 1, 1.0)], places: [[Vector3::zeros(); 3]; 2].into() }];
        let moments = Moments::of(&stacked, &series, Shape { drift: 0.0, correlation: 0.0, field: None });
        let columns = Columns::independent(vec![(0, 1.0), (1, 1.0)]);
        let any = (f64::NEG_INFINITY, f64::INFINITY);
        let solve = |bounds: &[(f64, f64)]| {
            Normal::of(&moments, &columns, 1e-4).likeliest(bounds, &DVector::zeros(2), 0.0).unwrap()
        };
        assert!((solve(&[any, any]) - DVector::from_vec(vec![1.0, 2.0])).norm() < 1e-6);
        assert!((solve(&[any, (f64::NEG_INFINITY, 0.0)]) - DVector::from_vec(vec![2.0, 0.0])).norm() < 1e-6);
    }
}
