//! Columns of a set with the prior of their numbers.

use super::moments::Moments;
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// Variance of a knot that owes nothing to its neighbours, over that of the curve: it keeps the inverse sound.
const NUGGET: f64 = 1e-6;

/// Prior of a curve's knots: their inverse covariance.
#[derive(Debug)]
pub(super) struct Smoothness {
    /// In units of the typical size.
    pub(super) precision: DMatrix<f64>,
    pub(super) half_log_det: f64,
}

impl Smoothness {
    /// Of an effect's numbers as an identification before has left them, by their covariance.
    pub(super) fn of_covariance(covariance: &DMatrix<f64>, typical: &[f64]) -> Option<Self> {
        /// Variances that stand for one: days, mountings and what the model leaves out differ between two measurements.
        const CAUTION: f64 = 4.0;
        let n = typical.len();
        let scaled = DMatrix::from_fn(n, n, |i, j| {
            CAUTION * covariance[(i, j)] / (typical[i] * typical[j]) + if i == j { NUGGET } else { 0.0 }
        });
        let factor = scaled.cholesky()?;
        let half_log_det = -factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>();
        Some(Self { precision: factor.inverse(), half_log_det })
    }

    /// Of knots (degrees) whose curve has a size (share of the typical one) and a reach (degrees).
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

    /// The same with priors of the typical sizes about zero.
    pub(super) fn full_size(&self) -> Self {
        let list = self.list.iter().map(|&(column, _)| (column, 1.0)).collect();
        Self { curves: self.curves.clone(), ..Self::independent(list) }
    }

    /// Prior precision, in units of the list's sizes.
    pub(super) fn precision(&self) -> DMatrix<f64> {
        let mut matrix = DMatrix::zeros(self.list.len(), self.list.len());
        self.add_precision(&mut matrix);
        matrix
    }

    /// Adds what the prior's means pull to, in units of the list's sizes: such numbers are independent of others.
    pub(super) fn add_means(&self, right: &mut DVector<f64>) {
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
