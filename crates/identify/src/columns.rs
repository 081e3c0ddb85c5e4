//! The columns of a set of effects, with the prior of their numbers.

use super::moments::Moments;
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// Variance that is added to each number independently, so that the covariance is invertible: relative to the variance
/// of the curve, or to the square of the typical size.
const NUGGET: f64 = 1e-6;

/// A prior under which the numbers of one effect depend on one another, such as the knots of a smooth curve.
#[derive(Debug)]
pub(super) struct Smoothness {
    /// Inverse covariance, in typical sizes.
    pub(super) precision: DMatrix<f64>,
    /// Half the log determinant of the precision.
    pub(super) half_log_det: f64,
}

impl Smoothness {
    /// The prior that an earlier identification leaves, from the covariance of its numbers in their own units; `None`
    /// if the covariance is not positive definite.
    pub(super) fn of_covariance(covariance: &DMatrix<f64>, typical: &[f64]) -> Option<Self> {
        /// Factor of the variances: temperature, mounting and all that the model leaves out change between two
        /// measurements.
        const CAUTION: f64 = 4.0;
        let n = typical.len();
        let scaled = DMatrix::from_fn(n, n, |i, j| {
            CAUTION * covariance[(i, j)] / (typical[i] * typical[j]) + if i == j { NUGGET } else { 0.0 }
        });
        let factor = scaled.cholesky()?;
        let half_log_det = -factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>();
        Some(Self { precision: factor.inverse(), half_log_det })
    }

    /// The Matérn prior with ν = 3/2 of knots at these angles, degrees, with a length scale, degrees, and a standard
    /// deviation, as a share of the typical size; `None` if the covariance is not positive definite.
    pub(super) fn new(knots_deg: &[f64], reach_deg: f64, size: f64) -> Option<Self> {
        let n = knots_deg.len();
        let covariance = DMatrix::from_fn(n, n, |i, j| {
            let apart = 3f64.sqrt() * (knots_deg[i] - knots_deg[j]).abs() / reach_deg;
            (1.0 + apart) * (-apart).exp() + if i == j { NUGGET } else { 0.0 }
        });
        let factor = (covariance * (size * size)).cholesky()?;
        let half_log_det = -factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>();
        Some(Self { precision: factor.inverse(), half_log_det })
    }
}

/// Index of a column of the design, and its prior size as a share of the typical size.
pub(super) type Column = (usize, f64);

/// Columns of a set with the prior of their numbers. The numbers are independent except within each entry of `curves`.
#[derive(Clone, Debug, Default)]
pub(super) struct Columns {
    pub(super) list: Vec<Column>,
    /// Priors under which numbers depend on one another, each with the position of its first number in the list.
    pub(super) curves: Vec<(usize, Arc<Smoothness>)>,
    /// Prior means other than zero: the position in the list, and the mean in prior sizes.
    pub(super) means: Vec<(usize, f64)>,
    /// Bounds: the position in the list, and the lowest and highest value in prior sizes.
    pub(super) limits: Vec<(usize, f64, f64)>,
}

impl Columns {
    /// Columns with independent priors about zero and without bounds.
    pub(super) fn independent(list: Vec<Column>) -> Self {
        Self { list, ..Self::default() }
    }

    /// The same columns, numbered from 0 as in a design that has only them.
    pub(super) fn numbered(&self) -> Self {
        let list = self.list.iter().enumerate().map(|(i, column)| (i, column.1)).collect();
        Self { list, curves: self.curves.clone(), means: self.means.clone(), limits: self.limits.clone() }
    }

    /// The same columns with the typical sizes as prior sizes, prior means of zero and no bounds.
    pub(super) fn full_size(&self) -> Self {
        let list = self.list.iter().map(|&(column, _)| (column, 1.0)).collect();
        Self { curves: self.curves.clone(), ..Self::independent(list) }
    }

    /// Prior precision, in prior sizes.
    pub(super) fn precision(&self) -> DMatrix<f64> {
        let mut matrix = DMatrix::zeros(self.list.len(), self.list.len());
        self.add_precision(&mut matrix);
        matrix
    }

    /// Adds prior precision times prior mean to a right-hand side, in prior sizes. Numbers with a mean are independent,
    /// so that their precision is one.
    pub(super) fn add_means(&self, right: &mut DVector<f64>) {
        self.means.iter().for_each(|&(i, mean)| right[i] += mean);
    }

    /// Adds the prior precision to a matrix, in prior sizes.
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

    /// XᵀX of the columns, scaled by the prior sizes.
    pub(super) fn gram(&self, moments: &Moments) -> DMatrix<f64> {
        let list = &self.list;
        DMatrix::from_fn(list.len(), list.len(), |i, j| {
            let ((a, s), (b, t)) = (list[i], list[j]);
            moments.gram[(a, b)] * s * t
        })
    }

    /// Xᵀy of the columns, scaled by the prior sizes.
    pub(super) fn cross(&self, moments: &Moments) -> DVector<f64> {
        DVector::from_iterator(self.list.len(), self.list.iter().map(|&(a, s)| moments.cross[a] * s))
    }
}
