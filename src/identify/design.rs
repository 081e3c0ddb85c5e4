//! The change that each number of the candidates makes to every row: a column a number, mm per typical size.
//!
//! A curve has a column a knot, over the whole robot hundreds in all. Each is what the whole curve does, raised alike,
//! times what its knot counts for at the row's angle: only the former is kept, and the columns are made of it some rows at
//! a time.

use super::data::Problem;
use super::noise::Sample;
use crate::effects::JointCurve;
use nalgebra::{DMatrix, DVector};
use std::ops::Range;
use std::sync::Arc;

/// Columns over the stacked scalars of all rows: those that are kept, then those of curves.
pub(super) struct Design {
    pub(super) kept: DMatrix<f64>,
    pub(super) curves: Vec<Along>,
}

/// The columns of a curve.
pub(super) struct Along {
    columns: Range<usize>,
    of: Arc<JointCurve>,
    /// What the whole curve does to each scalar, raised alike.
    raised: DVector<f64>,
    /// The joint's angle in each scalar's row.
    angle_deg: Vec<f64>,
}

impl Design {
    /// Number of columns.
    pub(super) fn width(&self) -> usize {
        self.kept.ncols() + self.curves.iter().map(|along| along.columns.len()).sum::<usize>()
    }

    /// Columns that are no curve's.
    pub(super) fn kept(&self) -> &DMatrix<f64> {
        &self.kept
    }

    /// Adds columns, each times a number.
    pub(super) fn add(&self, numbers: impl IntoIterator<Item = (usize, f64)>, into: &mut DVector<f64>) {
        let mut of_curves = vec![0.0; self.width() - self.kept.ncols()];
        for (column, number) in numbers {
            match column.checked_sub(self.kept.ncols()) {
                Some(at) => of_curves[at] += number,
                None => into.axpy(number, &self.kept.column(column), 1.0),
            }
        }
        for along in &self.curves {
            let from = along.columns.start - self.kept.ncols();
            let values = &of_curves[from..from + along.columns.len()];
            if values.iter().any(|value| value.abs() > 0.0) {
                along.add(values, into);
            }
        }
    }

    /// Writes the columns at some samples, each sample's together.
    pub(super) fn fill(&self, samples: &[Sample], rows: usize, block: &mut [f64]) {
        gather(&self.kept, samples, rows, block);
        if self.curves.is_empty() {
            return;
        }
        for (&(scalar, ..), block) in samples.iter().zip(block.chunks_exact_mut(rows)) {
            for along in &self.curves {
                let weights = &mut block[along.columns.clone()];
                along.of.weights(along.angle_deg[scalar], weights);
                weights.iter_mut().for_each(|weight| *weight *= along.raised[scalar]);
            }
        }
    }
}

impl Along {
    pub(super) fn new(problem: &Problem, columns: Range<usize>, of: Arc<JointCurve>, raised: DVector<f64>) -> Self {
        let mut angle_deg = vec![0.0; problem.scalars];
        for row in &problem.rows {
            angle_deg[row.scalars()].fill(row.motor[of.joint].to_degrees());
        }
        Self { columns, of, raised, angle_deg }
    }

    /// Writes the columns themselves.
    pub(super) fn write(&self, into: &mut DMatrix<f64>) {
        let mut weights = vec![0.0; self.columns.len()];
        for (scalar, (angle_deg, raised)) in self.angle_deg.iter().zip(&self.raised).enumerate() {
            self.of.weights(*angle_deg, &mut weights);
            self.columns.clone().zip(&weights).for_each(|(column, weight)| into[(scalar, column)] = raised * weight);
        }
    }

    /// Adds the curve with these values at its knots.
    fn add(&self, values: &[f64], into: &mut DVector<f64>) {
        let mut weights = vec![0.0; values.len()];
        for (scalar, into) in into.iter_mut().enumerate() {
            self.of.weights(self.angle_deg[scalar], &mut weights);
            *into +=
                self.raised[scalar] * weights.iter().zip(values).map(|(weight, value)| weight * value).sum::<f64>();
        }
    }
}

/// Writes a matrix's first columns at some samples, each sample's together, into rows of so many values.
pub(super) fn gather(from: &DMatrix<f64>, samples: &[Sample], rows: usize, block: &mut [f64]) {
    /// Samples of which a column's numbers are near one another.
    const NEAR: usize = 32;
    for (samples, block) in samples.chunks(NEAR).zip(block.chunks_mut(NEAR * rows)) {
        for (k, column) in from.as_slice().chunks_exact(from.nrows().max(1)).enumerate() {
            for (n, sample) in samples.iter().enumerate() {
                block[n * rows + k] = column[sample.0];
            }
        }
    }
}
