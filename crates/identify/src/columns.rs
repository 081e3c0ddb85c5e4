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
    covariance: DMatrix<f64>,
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
        Self::from_covariance(DMatrix::from_fn(n, n, |i, j| {
            CAUTION * covariance[(i, j)] / (typical[i] * typical[j]) + if i == j { NUGGET } else { 0.0 }
        }))
    }

    /// The Matérn prior with ν = 3/2 of knots at these angles, degrees, with a length scale, degrees, and a standard
    /// deviation, as a share of the typical size; `None` if the covariance is not positive definite.
    pub(super) fn new(knots_deg: &[f64], reach_deg: f64, size: f64) -> Option<Self> {
        let n = knots_deg.len();
        let covariance = DMatrix::from_fn(n, n, |i, j| {
            let apart = 3f64.sqrt() * (knots_deg[i] - knots_deg[j]).abs() / reach_deg;
            (1.0 + apart) * (-apart).exp() + if i == j { NUGGET } else { 0.0 }
        });
        Self::from_covariance(covariance * (size * size))
    }

    /// The prior of combinations of the numbers. Each column of `combinations` has the factors of one.
    fn of_combinations(&self, combinations: &DMatrix<f64>) -> Option<Self> {
        Self::from_covariance(combinations.tr_mul(&(&self.covariance * combinations)))
    }

    /// `None` if the covariance, in typical sizes, is not positive definite.
    fn from_covariance(covariance: DMatrix<f64>) -> Option<Self> {
        let factor = covariance.clone().cholesky()?;
        let half_log_det = -factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>();
        Some(Self { precision: factor.inverse(), covariance, half_log_det })
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

    /// The same columns with prior sizes of at least the typical sizes, prior means of zero and no bounds.
    pub(super) fn full_size(&self) -> Self {
        let list = self.list.iter().map(|&(column, size)| (column, size.max(1.0))).collect();
        Self { curves: self.curves.clone(), ..Self::independent(list) }
    }

    /// The same set with each curve replaced by the combinations of its knots that the rows of `moments` depend on, as
    /// many as there are angles in few rows. Evidence and σ stay the same, because the data say nothing of the others.
    /// `None` if no curve has fewer combinations than knots.
    pub(super) fn seen(&self, moments: &Moments) -> Option<Seen> {
        /// Least eigenvalue of a combination that counts, as a share of the largest: the rows then depend on what is
        /// left out a millionth as much.
        const LEAST: f64 = 1e-12;
        if self.curves.is_empty() {
            return None;
        }
        let gram = self.gram(moments);
        let mut basis = DMatrix::identity(self.list.len(), self.list.len());
        let mut columns = Self { list: Vec::new(), curves: Vec::new(), ..self.clone() };
        let mut kept = vec![true; self.list.len()];
        let mut positions = Vec::new();
        for (at, smooth) in &self.curves {
            let knots = smooth.covariance.nrows();
            let eigen = gram.view((*at, *at), (knots, knots)).into_owned().symmetric_eigen();
            let least = LEAST * eigen.eigenvalues.max();
            let seen: Vec<usize> = (0..knots).filter(|&i| eigen.eigenvalues[i] > least).collect();
            let combinations = eigen.eigenvectors.select_columns(&seen);
            basis.view_mut((*at, *at), combinations.shape()).copy_from(&combinations);
            kept[at + seen.len()..at + knots].fill(false);
            positions.push((*at, Arc::new(smooth.of_combinations(&combinations)?)));
        }
        let position = |i: usize| kept[..i].iter().filter(|kept| **kept).count();
        let used: Vec<usize> = (0..kept.len()).filter(|&i| kept[i]).collect();
        if used.len() == kept.len() {
            return None;
        }
        columns.list = (0..used.len()).map(|i| (i, 1.0)).collect();
        columns.curves = positions.into_iter().map(|(at, smooth)| (position(at), smooth)).collect();
        columns.means.iter_mut().for_each(|mean| mean.0 = position(mean.0));
        columns.limits.iter_mut().for_each(|limit| limit.0 = position(limit.0));
        Some(Seen { columns, basis: basis.select_columns(&used) })
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

/// A set whose curves have only the combinations of knots that the rows depend on.
pub(super) struct Seen {
    pub(super) columns: Columns,
    /// The numbers of the set, in prior sizes, for each number of `columns`.
    basis: DMatrix<f64>,
}

impl Seen {
    /// The moments of `columns`, from those of the set that they replace.
    pub(super) fn moments(&self, moments: &Moments, set: &Columns) -> Moments {
        let Moments { square, count, log_scale, shape, declared, .. } = *moments;
        let gram = self.basis.tr_mul(&(set.gram(moments) * &self.basis));
        let cross = self.basis.tr_mul(&set.cross(moments));
        Moments { gram, cross, square, count, log_scale, shape, declared }
    }
}
