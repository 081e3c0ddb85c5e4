//! Cholesky factors L of posterior precisions `P + G/σ²`, where P is the prior precision and G = XᵀX, both scaled by
//! the prior sizes.
//!
//! Sets of columns that begin alike share the factor of their first columns; each set appends the rows of its further
//! columns. The entries of an appended row in the shared columns are proportional to its prior size, so that a column
//! is solved once for all candidates that have it, also for those that differ only in their prior.

use super::columns::Columns;
use super::moments::Moments;
use deflex_lanes::widest;
use nalgebra::DMatrix;
use statrs::function::erf::erfc;
use std::cell::{OnceCell, RefCell};
use std::collections::BTreeMap;
use std::f64::consts::{FRAC_1_SQRT_2, TAU};
use std::rc::Rc;

/// Columns whose rows are appended to the factor of the columns that precede them.
pub(super) struct ColumnBlock<'a> {
    moments: &'a Moments,
    pub(super) preceding: &'a Columns,
    columns: &'a Columns,
    /// Products of these columns with one another, scaled by the prior sizes: the lower triangle, row by row.
    products: Vec<f64>,
    /// Prior precision of these columns, in prior sizes.
    prior: DMatrix<f64>,
    /// Prior means, in prior sizes.
    prior_means: Vec<f64>,
}

impl<'a> ColumnBlock<'a> {
    pub(super) fn new(moments: &'a Moments, preceding: &'a Columns, columns: &'a Columns) -> Self {
        let list = &columns.list;
        let mut products = Vec::with_capacity(list.len() * (list.len() + 1) / 2);
        for (i, &(a, s)) in list.iter().enumerate() {
            let gram = moments.gram.column(a);
            products.extend(list[..=i].iter().map(|&(b, t)| gram[b] * s * t));
        }
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
    /// The diagonal block: the lower triangle, row by row.
    rows: Vec<f64>,
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
        let mut next = Self { off_diagonal, rows: Vec::with_capacity(products.len()), ..Self::default() };
        let (mut rest, mut complete) = (&products[..], true);
        for (i, &(column, size)) in columns.list.iter().enumerate() {
            let (row, others) = rest.split_at(i + 1);
            rest = others;
            let right = moments.cross[column] * size * precision + prior_means[i];
            widest!(<'a> (
                factor: &'a mut Factor = &mut next,
                whitened: &'a [f64] = &self.whitened,
                complete: &'a mut bool = &mut complete,
                row: &'a [f64] = row,
                prior: &'a DMatrix<f64> = prior,
                precision: f64 = precision,
                right: f64 = right,
            ) {
                *complete = factor.append(whitened, row, prior, precision, right);
            });
            if !complete {
                return None;
            }
        }
        Some(next)
    }

    /// Appends a row to the factor and to the whitened right-hand side. `row` has the products of its column with the
    /// columns of this factor up to itself, `whitened` is that of the preceding factor. Returns whether the matrix is
    /// still positive definite.
    #[inline(always)]
    fn append(&mut self, whitened: &[f64], row: &[f64], prior: &DMatrix<f64>, precision: f64, right: f64) -> bool {
        let (i, from) = (row.len() - 1, self.rows.len());
        let (left, size) = &self.off_diagonal[i];
        for j in 0..=i {
            let (other, other_size) = &self.off_diagonal[j];
            let preceding = size * other_size * dot(&left.row, &other.row);
            self.rows.push(row[j] * precision + prior[(i, j)] - preceding);
        }
        let (above, own) = self.rows.split_at_mut(from);
        let mut at = 0;
        for j in 0..i {
            own[j] = (own[j] - dot(&own[..j], &above[at..at + j])) / above[at + j];
            at += j + 1;
        }
        let square = own[i] - dot(&own[..i], &own[..i]);
        if square.is_nan() || square <= 0.0 {
            return false;
        }
        own[i] = square.sqrt();
        self.half_log_det += 0.5 * square.ln();
        self.whitened.push((right - size * dot(&left.row, whitened) - dot(&own[..i], &self.whitened)) / own[i]);
        true
    }

    /// A column solved against this factor, which must be that of the columns that precede the block.
    fn solved(&self, block: &ColumnBlock, precision: f64, column: usize) -> Rc<SolvedColumn> {
        let solve = || {
            let gram = block.moments.gram.column(column);
            let mut row: Vec<f64> = block.preceding.list.iter().map(|&(b, t)| gram[b] * t * precision).collect();
            widest!(<'a> (row: &'a mut [f64] = &mut row, rows: &'a [f64] = &self.rows) {
                let mut at = 0;
                for j in 0..row.len() {
                    row[j] = (row[j] - dot(&row[..j], &rows[at..at + j])) / rows[at + j];
                    at += j + 1;
                }
            });
            Rc::new(SolvedColumn { row, on_units: OnceCell::new() })
        };
        Rc::clone(self.solved.borrow_mut().entry(column).or_insert_with(solve))
    }

    /// Squared norm of these rows of L⁻¹ times the right-hand side.
    pub(super) fn square(&self) -> f64 {
        dot(&self.whitened, &self.whitened)
    }

    /// These rows of L⁻¹ times a unit vector. `unit` is the row of the one, or `None` if it is in the preceding
    /// columns. `preceding` gives, for each row, the product of its entries in the preceding columns with what is
    /// already solved there.
    fn solve(&self, preceding: impl Fn(usize) -> f64, unit: Option<usize>) -> Vec<f64> {
        let mut solved: Vec<f64> = Vec::with_capacity(self.whitened.len());
        for (j, row) in triangle(&self.rows).enumerate() {
            let right = if unit == Some(j) { 1.0 } else { 0.0 };
            solved.push((right - preceding(j) - dot(&row[..j], &solved)) / row[j]);
        }
        solved
    }

    /// L⁻¹ times the unit vector of each bounded number of the columns.
    fn units(&self, columns: &Columns) -> &[Vec<f64>] {
        self.units.get_or_init(|| columns.limits.iter().map(|&(i, ..)| self.solve(|_| 0.0, Some(i))).collect())
    }
}

/// The rows of a packed lower triangle, each up to the diagonal.
fn triangle(rows: &[f64]) -> impl Iterator<Item = &[f64]> {
    let mut rest = rows;
    (1..).map_while(move |length| {
        let (row, others) = rest.split_at_checked(length)?;
        rest = others;
        Some(row)
    })
}

/// What the bounds of the numbers add to the log evidence, nats: for each bounded number the log probability of its
/// bounds under its posterior less that under its prior. It makes a compliance unlikely that fits well but would have
/// to be negative. `factor` is that of `columns`, and `further` has the rows of `more`.
pub(super) fn evidence_of_bounds(factor: &Factor, columns: &Columns, further: &Factor, more: &Columns) -> f64 {
    let gain = |&(_, low, high): &(usize, f64, f64), unit: [&[f64]; 2]| {
        let product = |of: [&[f64]; 2]| dot(unit[0], of[0]) + dot(unit[1], of[1]);
        let spread = product(unit).max(f64::MIN_POSITIVE).sqrt();
        let mean = product([if unit[0].is_empty() { &[] } else { &factor.whitened }, &further.whitened]);
        log_normal_between((low - mean) / spread, (high - mean) / spread) - log_normal_between(low, high)
    };
    let units = factor.units(columns);
    let own = columns.limits.iter().zip(units).enumerate().map(|(n, (limit, unit))| {
        let preceding = |j: usize| {
            let (solved, size) = &further.off_diagonal[j];
            size * solved.on_units.get_or_init(|| units.iter().map(|unit| dot(&solved.row, unit)).collect())[n]
        };
        gain(limit, [unit, &further.solve(preceding, None)])
    });
    let new = more.limits.iter().map(|limit| gain(limit, [&[], &further.solve(|_| 0.0, Some(limit.0))]));
    own.chain(new).sum()
}

/// Logarithm of the probability of an interval under the standard normal distribution.
pub(super) fn log_normal_between(low: f64, high: f64) -> f64 {
    /// Beyond this many standard deviations the tail differs from its asymptote exp(−z²/2) / (z √2π) by less than 0.3
    /// %.
    const FAR: f64 = 20.0;
    /// Beyond this many standard deviations on both sides the probability of what is outside is below the rounding
    /// error.
    const ALL: f64 = 9.0;
    if low < -ALL && high > ALL {
        return 0.0;
    }
    // An interval in the lower tail is mirrored: the difference of two probabilities near one would lose all digits.
    let (low, high) = if high < 0.0 { (-high, -low) } else { (low, high) };
    if low > FAR {
        return -0.5 * low * low - (low * TAU.sqrt()).ln();
    }
    let beyond = |at: f64| 0.5 * erfc(at * FRAC_1_SQRT_2);
    (beyond(low) - beyond(high)).max(f64::MIN_POSITIVE).ln()
}

/// Scalar product of two vectors. It adds in the same order on every processor. Its loops use indices, because
/// iterators are not inlined in functions that are compiled for wider vector registers.
#[inline(always)]
fn dot(a: &[f64], b: &[f64]) -> f64 {
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
