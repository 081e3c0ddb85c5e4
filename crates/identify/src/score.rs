//! Evidence and posterior of a set of effects, computed from moments.
//!
//! The evidence decreases with every number that the rows do not need, without a further penalty. It is maximised over
//! σ and over the shape of the noise (see [`profiled`]). A prior mean μ, in prior sizes, replaces `b/σ²` by `b/σ² + μ`
//! and subtracts `½ μᵀμ`. Each bounded number adds the log probability of its bounds under its posterior, and subtracts
//! that under its prior.

use super::columns::Columns;
use super::moments::Moments;
use super::profile::{LEAST_SIGMA, profiled};
use nalgebra::{DMatrix, DVector};

/// The evidence of a set of columns with the noise that maximises it.
#[derive(Clone, Debug)]
pub(super) struct Score {
    /// Log evidence, nats.
    pub(super) evidence: f64,
    /// Standard deviation of the white noise for each axis, mm.
    pub(super) sigma: f64,
    /// Index of the shape of the noise.
    pub(super) shape: usize,
}

/// Evidence of the columns under the best of several shapes of the noise, whose moments are given. The search for σ
/// begins at `guess`, mm, if there is one.
pub(super) fn score(moments: &[Moments], columns: &Columns, guess: Option<f64>) -> Score {
    let mut best = Score { evidence: f64::NEG_INFINITY, sigma: LEAST_SIGMA, shape: 0 };
    // The rows depend on the same combinations of knots under every shape of the noise.
    let seen = moments.first().and_then(|moments| columns.seen(moments));
    for (shape, moments) in moments.iter().enumerate() {
        let (evidence, sigma) = match &seen {
            Some(seen) => profiled(&seen.moments(moments, columns), &seen.columns, guess),
            None => profiled(moments, columns, guess),
        };
        if evidence > best.evidence {
            best = Score { evidence, sigma, shape };
        }
    }
    best
}

/// Posterior mean and covariance of the numbers of the columns, in prior sizes, without their bounds; `None` if the
/// posterior precision is not positive definite.
pub(super) fn posterior(moments: &Moments, columns: &Columns, sigma: f64) -> Option<(DVector<f64>, DMatrix<f64>)> {
    let Normal { matrix, right } = Normal::of(moments, columns, sigma);
    let inverse = matrix.cholesky()?.inverse();
    Some((&inverse * right, inverse))
}

/// The normal equations of the numbers of some columns, in prior sizes.
pub(super) struct Normal {
    matrix: DMatrix<f64>,
    right: DVector<f64>,
}

impl Normal {
    /// Normal equations with a given solution, under any damping.
    #[cfg(test)]
    pub(super) fn drawn_to(answer: Vec<f64>) -> Self {
        // This precision is far above all dampings.
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

    /// The numbers of largest posterior density within bounds, with `damping` added to the diagonal about `here`
    /// (Levenberg 1944). The damping keeps the directions that the rows hardly determine near `here`. A shorter step
    /// would hold back all directions.
    ///
    /// A number that would leave its bounds is held at the bound while the others are solved again, and is released if
    /// the gradient there points into its range (an active-set method). Clamping alone would leave the other numbers at
    /// values that are best only for a number outside its bounds.
    pub(super) fn likeliest(&self, bounds: &[(f64, f64)], here: &DVector<f64>, damping: f64) -> Option<DVector<f64>> {
        let mut matrix = self.matrix.clone();
        (0..matrix.nrows()).for_each(|i| matrix[(i, i)] += damping);
        let right = &self.right + here * damping;
        let mut held: Vec<Option<f64>> = vec![None; bounds.len()];
        let mut best = None;
        // The number of rounds is limited, because two equally good sets of held numbers could alternate.
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
                // The slope of the log posterior from the bound of a held number into its range.
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

#[cfg(test)]
mod tests {
    use super::super::columns::Smoothness;
    use super::super::noise::{Series, Shape};
    use super::*;
    use nalgebra::Vector3;
    use std::sync::Arc;

    #[test]
    fn the_other_numbers_are_solved_again_when_one_is_at_its_bound() {
        // y = (1, 3) on the columns (1, 1) and (0, 1) is solved by (1, 2). If the second number may not exceed 0, the
        // first is the mean, 2.
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

    #[test]
    fn a_curve_with_more_knots_than_rows_has_the_evidence_of_all_its_knots() {
        // Four rows see nine knots of a curve, and a column with bounds; the last column is what was measured.
        let entry =
            |row: usize, column: usize| f64::from((7 * row as u32 + 5 * column as u32 * column as u32) % 11) - 5.0;
        let stacked = DMatrix::from_fn(4, 11, entry);
        let samples = (0..4).map(|row| (row, row, 1.0)).collect();
        let series = [Series { samples, places: vec![[Vector3::zeros(); 3]; 4].into() }];
        let moments = Moments::of(&stacked, &series, Shape { drift: 0.0, correlation: 0.0, field: None });
        let knots: Vec<f64> = (0..9).map(|knot| 10.0 * f64::from(knot)).collect();
        let smooth = Smoothness::new(&knots, 30.0, 0.5).unwrap();
        let columns = Columns {
            curves: vec![(1, Arc::new(smooth))],
            limits: vec![(0, 0.0, f64::INFINITY)],
            ..Columns::independent((0..10).map(|column| ((column + 9) % 10, 0.7)).collect())
        };
        assert_eq!(columns.seen(&moments).map(|seen| seen.columns.list.len()), Some(5));
        let (evidence, sigma) = profiled(&moments, &columns, None);
        let score = score(&[moments], &columns, None);
        assert!((score.evidence - evidence).abs() < 1e-6, "{score:?}, {evidence}");
        assert!((score.sigma / sigma - 1.0).abs() < 1e-6, "{score:?}, {sigma}");
    }
}
