//! The design matrix of a linearisation: a column for each number of the candidates, with the change of every scalar,
//! mm for each typical size.
//!
//! A curve has a column for each knot; over the whole robot there are hundreds. Such a column is the change by a curve
//! that is raised by the same amount everywhere, times the weight of the knot at the angle of the row. Only the first
//! factor is kept, and the columns are computed for a few rows at a time.

use super::data::Problem;
use super::noise::Sample;
use deflex_effects::JointCurve;
use nalgebra::{DMatrix, DVector};
use std::ops::Range;
use std::sync::Arc;

/// Columns over the scalars of all rows: those that are kept as a matrix, then those of curves.
pub(super) struct Design {
    pub(super) kept: DMatrix<f64>,
    pub(super) curves: Vec<CurveColumns>,
}

/// The columns of the knots of a curve.
pub(super) struct CurveColumns {
    columns: Range<usize>,
    joint_curve: Arc<JointCurve>,
    /// The change of each scalar if all knots are raised by one typical size, mm.
    raised: DVector<f64>,
    /// The angle of the joint in the row of each scalar, degrees.
    angle_deg: Vec<f64>,
}

impl Design {
    /// Number of columns.
    pub(super) fn width(&self) -> usize {
        self.kept.ncols() + self.curves.iter().map(|curve| curve.columns.len()).sum::<usize>()
    }

    /// The columns that are kept as a matrix.
    pub(super) fn kept(&self) -> &DMatrix<f64> {
        &self.kept
    }

    /// Adds a sum of columns, each times a number in typical sizes, to a stacked vector.
    pub(super) fn add(&self, numbers: impl IntoIterator<Item = (usize, f64)>, into: &mut DVector<f64>) {
        let mut of_curves = vec![0.0; self.width() - self.kept.ncols()];
        for (column, number) in numbers {
            match column.checked_sub(self.kept.ncols()) {
                Some(at) => of_curves[at] += number,
                None => into.axpy(number, &self.kept.column(column), 1.0),
            }
        }
        for curve in &self.curves {
            let from = curve.columns.start - self.kept.ncols();
            let values = &of_curves[from..from + curve.columns.len()];
            if values.iter().any(|value| value.abs() > 0.0) {
                curve.add(values, into);
            }
        }
    }

    /// Writes the values of all columns at some samples. The values of a sample are successive, at the start of its
    /// `rows` values in `block`.
    pub(super) fn fill(&self, samples: &[Sample], rows: usize, block: &mut [f64]) {
        gather(&self.kept, samples, rows, block);
        if self.curves.is_empty() {
            return;
        }
        for (&(scalar, ..), block) in samples.iter().zip(block.chunks_exact_mut(rows)) {
            for curve in &self.curves {
                let weights = &mut block[curve.columns.clone()];
                curve.joint_curve.weights(curve.angle_deg[scalar], weights);
                weights.iter_mut().for_each(|weight| *weight *= curve.raised[scalar]);
            }
        }
    }
}

impl CurveColumns {
    /// The columns `columns` of a curve. `raised` is the change of each scalar if all knots are raised by one typical
    /// size, mm.
    pub(super) fn new(
        problem: &Problem,
        columns: Range<usize>,
        joint_curve: Arc<JointCurve>,
        raised: DVector<f64>,
    ) -> Self {
        let mut angle_deg = vec![0.0; problem.scalars];
        for row in &problem.rows {
            angle_deg[row.scalars()].fill(row.motor[joint_curve.joint].to_degrees());
        }
        Self { columns, joint_curve, raised, angle_deg }
    }

    /// Writes the columns into a matrix.
    pub(super) fn write(&self, into: &mut DMatrix<f64>) {
        let mut weights = vec![0.0; self.columns.len()];
        for (scalar, (angle_deg, raised)) in self.angle_deg.iter().zip(&self.raised).enumerate() {
            self.joint_curve.weights(*angle_deg, &mut weights);
            self.columns.clone().zip(&weights).for_each(|(column, weight)| into[(scalar, column)] = raised * weight);
        }
    }

    /// Adds to a stacked vector the change by the curve with these values at its knots, in typical sizes.
    fn add(&self, values: &[f64], into: &mut DVector<f64>) {
        let mut weights = vec![0.0; values.len()];
        for (scalar, into) in into.iter_mut().enumerate() {
            self.joint_curve.weights(self.angle_deg[scalar], &mut weights);
            *into +=
                self.raised[scalar] * weights.iter().zip(values).map(|(weight, value)| weight * value).sum::<f64>();
        }
    }
}

/// Writes the columns of a matrix at some samples, as the first of the `rows` values that `block` has for each sample.
pub(super) fn gather(from: &DMatrix<f64>, samples: &[Sample], rows: usize, block: &mut [f64]) {
    /// Number of samples that are gathered together, so that the values of a column are near one another in memory.
    const NEAR: usize = 32;
    for (samples, block) in samples.chunks(NEAR).zip(block.chunks_mut(NEAR * rows)) {
        for (k, column) in from.as_slice().chunks_exact(from.nrows().max(1)).enumerate() {
            for (n, sample) in samples.iter().enumerate() {
                block[n * rows + k] = column[sample.0];
            }
        }
    }
}
