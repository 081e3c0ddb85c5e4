//! Cholesky factors L of posterior precisions `P + G/σ²`, where P is the prior precision and G = XᵀX, both scaled by
//! the prior sizes.
//!
//! Sets of columns that begin alike share the factor of their first columns; each set appends the rows of its further
//! columns. The entries of an appended row in the shared columns are proportional to its prior size, so that a column
//! is solved once for all candidates that have it, also for those that differ only in their prior.

use super::bounds::{Normals, Range};
use super::columns::Columns;
use super::moments::Moments;
use super::triangle::{dot, factorize, substitute};
use deflex_lanes::widest;
use nalgebra::DMatrix;
use std::cell::{OnceCell, RefCell};
use std::collections::BTreeMap;
use std::rc::Rc;

/// Columns whose rows are appended to the factor of the columns that precede them.
pub(super) struct ColumnBlock<'a> {
    moments: &'a Moments,
    pub(super) preceding: &'a Columns,
    columns: &'a Columns,
    /// Products of these columns with one another, scaled by the prior sizes. The upper triangle is zero.
    products: DMatrix<f64>,
    /// Prior precision of these columns, in prior sizes.
    prior: DMatrix<f64>,
    /// Prior means, in prior sizes.
    prior_means: Vec<f64>,
}

impl<'a> ColumnBlock<'a> {
    pub(super) fn new(moments: &'a Moments, preceding: &'a Columns, columns: &'a Columns) -> Self {
        let list = &columns.list;
        let products = DMatrix::from_fn(list.len(), list.len(), |i, j| {
            let ((a, s), (b, t)) = (list[i], list[j]);
            if i < j { 0.0 } else { moments.gram[(a, b)] * s * t }
        });
        let prior = columns.precision();
        let mut prior_means = vec![0.0; list.len()];
        columns.means.iter().for_each(|&(i, mean)| prior_means[i] += mean);
        Self { moments, preceding, columns, products, prior, prior_means }
    }
}

/// Rows of a Cholesky factor L: its first rows, or those that follow the rows of another `Factor`.
#[derive(Default)]
pub(super) struct Factor {
    /// For each row its entries in the preceding columns: a solved column and the prior size that scales it.
    off_diagonal: Vec<(Rc<SolvedColumn>, f64)>,
    /// The diagonal block, column by column. Its upper triangle is not used.
    diagonal: Vec<f64>,
    /// These rows of L⁻¹ times the right-hand side.
    whitened: Vec<f64>,
    /// Half of the contribution of these rows to the log determinant of the matrix.
    pub(super) half_log_det: f64,
    /// L⁻¹ times the unit vector of each bounded number of these columns.
    units: OnceCell<Vec<Vec<f64>>>,
    /// Columns that were solved against these rows, by their index in the design.
    solved: RefCell<BTreeMap<usize, Rc<SolvedColumn>>>,
}

/// A column of the design as a row of a larger factor: its entries in the columns of `Factor`, for a prior size of one.
#[derive(Default)]
struct SolvedColumn {
    /// L⁻¹ times its products with the columns of the factor, over σ².
    row: Vec<f64>,
    /// Scalar products of `row` with the `units` of the factor.
    on_units: OnceCell<Vec<f64>>,
}

impl Factor {
    /// The rows of a block that follow these rows, at the precision 1/σ², mm⁻²; `None` if the matrix is not positive
    /// definite.
    pub(super) fn extended(&self, block: &ColumnBlock, precision: f64) -> Option<Self> {
        let ColumnBlock { moments, columns, products, prior, prior_means, .. } = block;
        let off_diagonal: Vec<(Rc<SolvedColumn>, f64)> =
            columns.list.iter().map(|&(column, size)| (self.solved(block, precision, column), size)).collect();
        let right = |(&(column, size), mean): (&(usize, f64), &f64)| moments.cross[column] * size * precision + mean;
        let mut whitened: Vec<f64> = columns.list.iter().zip(prior_means).map(right).collect();
        let mut diagonal: Vec<f64> = (products * precision + prior).data.into();
        let mut complete = true;
        widest!(<'a> (
            off_diagonal: &'a [(Rc<SolvedColumn>, f64)] = &off_diagonal,
            preceding: &'a [f64] = &self.whitened,
            diagonal: &'a mut [f64] = &mut diagonal,
            whitened: &'a mut [f64] = &mut whitened,
            complete: &'a mut bool = &mut complete,
        ) {
            let size = whitened.len();
            for j in 0..size {
                let (left, scale) = &off_diagonal[j];
                whitened[j] -= scale * dot(&left.row, preceding);
                for i in j..size {
                    let (other, other_scale) = &off_diagonal[i];
                    diagonal[j * size + i] -= scale * other_scale * dot(&left.row, &other.row);
                }
            }
            *complete = factorize(diagonal, size);
            substitute(diagonal, whitened);
        });
        let size = whitened.len();
        let half_log_det = (0..size).map(|i| diagonal[i * size + i].ln()).sum();
        complete.then(|| Self { off_diagonal, diagonal, whitened, half_log_det, ..Self::default() })
    }

    /// A column solved against this factor, which must be that of the columns that precede the block.
    fn solved(&self, block: &ColumnBlock, precision: f64, column: usize) -> Rc<SolvedColumn> {
        let solve = || {
            let gram = block.moments.gram.column(column);
            let row = block.preceding.list.iter().map(|&(b, t)| gram[b] * t * precision).collect();
            Rc::new(SolvedColumn { row: self.substituted(row), on_units: OnceCell::new() })
        };
        Rc::clone(self.solved.borrow_mut().entry(column).or_insert_with(solve))
    }

    /// The inverse of the diagonal block times a vector.
    fn substituted(&self, mut right: Vec<f64>) -> Vec<f64> {
        widest!(<'a> (diagonal: &'a [f64] = &self.diagonal, right: &'a mut [f64] = &mut right) {
            substitute(diagonal, right);
        });
        right
    }

    /// Squared norm of these rows of L⁻¹ times the right-hand side.
    pub(super) fn square(&self) -> f64 {
        dot(&self.whitened, &self.whitened)
    }

    /// These rows of L⁻¹ times a unit vector. `unit` is the row of the one, or `None` if it is in the preceding
    /// columns. `preceding` gives, for each row, the product of its entries in the preceding columns with what is
    /// already solved there.
    fn solve(&self, preceding: impl Fn(usize) -> f64, unit: Option<usize>) -> Vec<f64> {
        let right = |j| if unit == Some(j) { 1.0 - preceding(j) } else { -preceding(j) };
        self.substituted((0..self.whitened.len()).map(right).collect())
    }

    /// L⁻¹ times the unit vector of each bounded number of the columns.
    fn units(&self, columns: &Columns) -> &[Vec<f64>] {
        self.units.get_or_init(|| columns.limits.iter().map(|&(i, ..)| self.solve(|_| 0.0, Some(i))).collect())
    }
}

/// L⁻¹ times the unit vector of a bounded number, in the rows of the shared columns and in those of the further ones.
/// The products of these vectors are the covariances of the numbers.
struct Unit<'a> {
    shared: &'a [f64],
    own: Vec<f64>,
}

/// What the bounds of the numbers add to the log evidence, nats: the log probability of the bounds under the posterior
/// less that under the prior. It makes a compliance unlikely that fits well but would have to be negative. `factor` is
/// that of `columns`, and `further` has the rows of `more`.
pub(super) fn evidence_of_bounds(factor: &Factor, columns: &Columns, further: &Factor, more: &Columns) -> f64 {
    let units = factor.units(columns);
    let continued = (0..units.len()).map(|n| {
        let preceding = |j: usize| {
            let (solved, size) = &further.off_diagonal[j];
            size * solved.on_units.get_or_init(|| units.iter().map(|unit| dot(&solved.row, unit)).collect())[n]
        };
        Unit { shared: &units[n], own: further.solve(preceding, None) }
    });
    let new = more.limits.iter().map(|limit| Unit { shared: &[], own: further.solve(|_| 0.0, Some(limit.0)) });
    let units: Vec<Unit> = continued.chain(new).collect();
    let product = |unit: &Unit, shared: &[f64], own: &[f64]| dot(unit.shared, shared) + dot(&unit.own, own);
    let covariance = |i: usize, j: usize| product(&units[i], units[j].shared, &units[j].own);
    let means = units.iter().map(|unit| product(unit, &factor.whitened, &further.whitened)).collect();
    let within = Normals { ranges: ranges(columns, more).collect(), means, covariance: &covariance };
    within.log_probability() + most_of_bounds(columns, more)
}

/// The most that the bounds of the numbers can add to the log evidence, nats: their log probability under the prior, with
/// the other sign.
pub(super) fn most_of_bounds(columns: &Columns, more: &Columns) -> f64 {
    -ranges(columns, more).map(Range::log_probability).sum::<f64>()
}

/// The ranges of the bounded numbers of some columns and of further ones, in prior sizes.
fn ranges<'a>(columns: &'a Columns, more: &'a Columns) -> impl Iterator<Item = Range> + 'a {
    columns.limits.iter().chain(&more.limits).map(|&(_, low, high)| Range { low, high })
}

#[cfg(test)]
mod tests {
    use super::super::noise::{Series, Shape};
    use super::*;
    use nalgebra::Vector3;

    /// What the bounds add to the evidence at σ = 0.5.
    fn bounded(moments: &Moments, columns: &Columns) -> f64 {
        let none = Factor::default();
        let factor = none.extended(&ColumnBlock::new(moments, &Columns::default(), columns), 4.0).unwrap();
        evidence_of_bounds(&none, &Columns::default(), &factor, columns)
    }

    #[test]
    fn a_number_that_may_not_be_negative_gains_where_it_is_positive_and_loses_where_it_is_not() {
        // Data of ±1.4 on the column 1, a prior size of 0.5 and σ = 0.5: the posterior mean is ±1.4 and its variance ½,
        // in prior sizes. Above zero are one half of the prior, and Φ(±1.98) = 0.97614 or 0.02386 of the posterior.
        let series = [Series { samples: vec![(0, 0, 1.0)], places: [[Vector3::zeros(); 3]].into() }];
        let shape = Shape { drift: 0.0, correlation: 0.0, field: None };
        let columns = Columns { limits: vec![(0, 0.0, f64::INFINITY)], ..Columns::independent(vec![(0, 0.5)]) };
        let gain = |seen: f64| {
            let moments = Moments::of(&DMatrix::from_row_slice(1, 2, &[1.0, seen]), &series, shape);
            bounded(&moments, &columns)
        };
        assert!((gain(1.4) - 0.6690).abs() < 1e-3 && (gain(-1.4) + 3.0425).abs() < 1e-3);
        // Far out in the tail the probability underflows, but its logarithm does not: −z²/2 − ln(z √2π) + ln 2, z =
        // 141.42.
        assert!((gain(-100.0) + 10_005.178).abs() < 0.01);
    }
}
