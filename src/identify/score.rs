//! Evidence of a set of effects, from moments alone.
//!
//! It punishes parameters that the data do not need by itself; σ is profiled, the noise's shape chosen with it (see
//! [`profiled`]). A prior about μ, in the same sizes, makes `b/σ² + μ` of `b/σ²` and takes off `½ μᵀμ`. Numbers that are bounded
//! add the log of the share of their posterior within the bounds, less that of their prior.

use super::moments::Moments;
use super::profile::{LEAST_SIGMA, profiled};
use super::smooth::Smoothness;
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

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

/// A column of the design and the share of its typical size that the prior has.
pub(super) type Column = (usize, f64);

/// Columns of a set with the prior of their numbers: independent, but for the knots of smooth curves.
#[derive(Clone, Debug, Default)]
pub(super) struct Columns {
    pub(super) list: Vec<Column>,
    /// Position of the first knot of each curve in the list, and what keeps it smooth.
    pub(super) curves: Vec<(usize, Arc<Smoothness>)>,
    /// Positions in the list of numbers whose prior is not about zero, and about what, in the list's sizes.
    pub(super) means: Vec<(usize, f64)>,
    /// Positions in the list of numbers that are bounded, and between what, in the list's sizes.
    pub(super) limits: Vec<(usize, f64, f64)>,
}

impl Columns {
    /// Independent columns.
    pub(super) fn independent(list: Vec<Column>) -> Self {
        Self { list, ..Self::default() }
    }

    /// The same columns as the first ones of a design of their own.
    pub(super) fn numbered(&self) -> Self {
        let list = self.list.iter().enumerate().map(|(i, column)| (i, column.1)).collect();
        Self { list, curves: self.curves.clone(), means: self.means.clone(), limits: self.limits.clone() }
    }

    /// Adds what the prior's means pull to, in units of the list's sizes: such numbers are independent of others.
    fn add_means(&self, right: &mut DVector<f64>) {
        self.means.iter().for_each(|&(i, mean)| right[i] += mean);
    }

    /// Adds a number's prior precision, in units of the list's sizes.
    pub(super) fn add_precision(&self, matrix: &mut DMatrix<f64>) {
        let of_curve = |i: usize| self.curves.iter().any(|(at, s)| (*at..at + s.precision.nrows()).contains(&i));
        for i in (0..self.list.len()).filter(|&i| !of_curve(i)) {
            matrix[(i, i)] += 1.0;
        }
        for (at, smooth) in &self.curves {
            let size = smooth.precision.shape();
            let mut block = matrix.view_mut((*at, *at), size);
            block += &smooth.precision;
        }
    }

    /// Half the log determinant of the prior precision.
    pub(super) fn half_log_det(&self) -> f64 {
        self.curves.iter().map(|(_, smooth)| smooth.half_log_det).sum()
    }

    pub(super) fn gram(&self, moments: &Moments) -> DMatrix<f64> {
        let list = &self.list;
        DMatrix::from_fn(list.len(), list.len(), |i, j| {
            let ((a, s), (b, t)) = (list[i], list[j]);
            moments.gram[(a, b)] * s * t
        })
    }

    pub(super) fn cross(&self, moments: &Moments) -> DVector<f64> {
        DVector::from_iterator(self.list.len(), self.list.iter().map(|&(a, s)| moments.cross[a] * s))
    }
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

/// Sum of products, some at a time: in the same order on every processor. Indices, for in the widest lanes iterators are calls.
#[inline(always)]
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    const TOGETHER: usize = 8;
    let ((left, a), (right, b)) = (a.as_chunks::<TOGETHER>(), b.as_chunks::<TOGETHER>());
    let (mut sums, mut sum, mut rest) = ([0.0; TOGETHER], 0.0, 0.0);
    for n in 0..left.len().min(right.len()) {
        for k in 0..TOGETHER {
            sums[k] += left[n][k] * right[n][k];
        }
    }
    for k in 0..a.len().min(b.len()) {
        rest += a[k] * b[k];
    }
    for k in 0..TOGETHER {
        sum += sums[k];
    }
    rest + sum
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
