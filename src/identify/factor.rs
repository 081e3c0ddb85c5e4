//! Cholesky factors of normal matrices, kept for the columns that many sets begin with and extended by those of each.
//!
//! What a further column is in terms of the kept ones does not depend on its prior: it is solved once, for all candidates that
//! have it and for all whose priors differ only.

use super::columns::Columns;
use super::moments::Moments;
use crate::lanes::widest;
use nalgebra::DMatrix;
use statrs::function::erf::erfc;
use std::cell::{OnceCell, RefCell};
use std::collections::BTreeMap;
use std::f64::consts::{FRAC_1_SQRT_2, TAU};
use std::rc::Rc;

/// Columns with all that their rows of a normal matrix are made of, after the rows of others.
pub(super) struct Part<'a> {
    moments: &'a Moments,
    pub(super) before: &'a Columns,
    columns: &'a Columns,
    /// Row by row up to the diagonal: products with one another.
    products: Vec<f64>,
    prior: DMatrix<f64>,
    /// What the prior pulls to.
    pull: Vec<f64>,
}

impl<'a> Part<'a> {
    pub(super) fn new(moments: &'a Moments, before: &'a Columns, columns: &'a Columns) -> Self {
        let list = &columns.list;
        let mut products = Vec::with_capacity(list.len() * (list.len() + 1) / 2);
        for (i, &(a, s)) in list.iter().enumerate() {
            let gram = moments.gram.column(a);
            products.extend(list[..=i].iter().map(|&(b, t)| gram[b] * s * t));
        }
        let prior = columns.precision();
        let mut pull = vec![0.0; list.len()];
        columns.means.iter().for_each(|&(i, mean)| pull[i] += mean);
        Self { moments, before, columns, products, prior, pull }
    }
}

/// Rows of the Cholesky factor L of a normal matrix, after those of another factor or from the first on.
#[derive(Default)]
pub(super) struct Factor {
    /// Of each row what stands before its own part, but for the factor that it follows.
    behind: Vec<(Rc<Solved>, f64)>,
    /// One after another, their own parts up to the diagonal.
    rows: Vec<f64>,
    /// L⁻¹ of the right side.
    white: Vec<f64>,
    pub(super) half_log_det: f64,
    /// L⁻¹ of the unit vectors of bounded numbers.
    units: OnceCell<Vec<Vec<f64>>>,
    /// By column.
    solved: RefCell<BTreeMap<usize, Rc<Solved>>>,
}

/// A column over its share of the typical size, after a factor.
#[derive(Default)]
struct Solved {
    /// L⁻¹ of its products with the factor's columns.
    row: Vec<f64>,
    /// Its products with the factor's units.
    on_units: OnceCell<Vec<f64>>,
}

impl Factor {
    /// Further rows after these; `None` where the matrix is not positive definite.
    pub(super) fn extended(&self, part: &Part, precision: f64) -> Option<Self> {
        let Part { moments, columns, products, prior, pull, .. } = part;
        let behind: Vec<(Rc<Solved>, f64)> =
            columns.list.iter().map(|&(column, share)| (self.solved(part, precision, column), share)).collect();
        let mut next = Self { behind, rows: Vec::with_capacity(products.len()), ..Self::default() };
        let (mut rest, mut complete) = (&products[..], true);
        for (i, &(column, share)) in columns.list.iter().enumerate() {
            let (row, others) = rest.split_at(i + 1);
            rest = others;
            let right = moments.cross[column] * share * precision + pull[i];
            widest!(<'a> (
                factor: &'a mut Factor = &mut next,
                white: &'a [f64] = &self.white,
                complete: &'a mut bool = &mut complete,
                row: &'a [f64] = row,
                prior: &'a DMatrix<f64> = prior,
                precision: f64 = precision,
                right: f64 = right,
            ) {
                *complete = factor.append(white, row, prior, precision, right);
            });
            if !complete {
                return None;
            }
        }
        Some(next)
    }

    /// Adds a row, by its products with the factor's own columns up to itself.
    #[inline(always)]
    fn append(&mut self, white: &[f64], row: &[f64], prior: &DMatrix<f64>, precision: f64, right: f64) -> bool {
        let (i, from) = (row.len() - 1, self.rows.len());
        let (before, share) = &self.behind[i];
        for j in 0..=i {
            let (other, of_other) = &self.behind[j];
            let known = share * of_other * dot(&before.row, &other.row);
            self.rows.push(row[j] * precision + prior[(i, j)] - known);
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
        self.white.push((right - share * dot(&before.row, white) - dot(&own[..i], &self.white)) / own[i]);
        true
    }

    /// A column after this factor, which is of the columns before the part.
    fn solved(&self, part: &Part, precision: f64, column: usize) -> Rc<Solved> {
        let solve = || {
            let gram = part.moments.gram.column(column);
            let mut row: Vec<f64> = part.before.list.iter().map(|&(b, t)| gram[b] * t * precision).collect();
            widest!(<'a> (row: &'a mut [f64] = &mut row, rows: &'a [f64] = &self.rows) {
                let mut at = 0;
                for j in 0..row.len() {
                    row[j] = (row[j] - dot(&row[..j], &rows[at..at + j])) / rows[at + j];
                    at += j + 1;
                }
            });
            Rc::new(Solved { row, on_units: OnceCell::new() })
        };
        Rc::clone(self.solved.borrow_mut().entry(column).or_insert_with(solve))
    }

    /// Square of its part of L⁻¹ of the right side.
    pub(super) fn square(&self) -> f64 {
        dot(&self.white, &self.white)
    }

    /// Its part of L⁻¹ of a vector, by what the rows before have in each row: of one at one of its own, or none.
    fn solve(&self, before: impl Fn(usize) -> f64, unit: Option<usize>) -> Vec<f64> {
        let mut solved: Vec<f64> = Vec::with_capacity(self.white.len());
        for (j, row) in triangle(&self.rows).enumerate() {
            let right = if unit == Some(j) { 1.0 } else { 0.0 };
            solved.push((right - before(j) - dot(&row[..j], &solved)) / row[j]);
        }
        solved
    }

    /// L⁻¹ of the unit vectors of the columns' bounded numbers.
    fn units(&self, columns: &Columns) -> &[Vec<f64>] {
        self.units.get_or_init(|| columns.limits.iter().map(|&(i, ..)| self.solve(|_| 0.0, Some(i))).collect())
    }
}

/// Rows of a triangle, each up to the diagonal.
fn triangle(rows: &[f64]) -> impl Iterator<Item = &[f64]> {
    let mut rest = rows;
    (1..).map_while(move |length| {
        let (row, others) = rest.split_at_checked(length)?;
        rest = others;
        Some(row)
    })
}

/// What it says for the bounded numbers that they lie where they may, nats: the share of the posterior there over that of the
/// prior, number by number. A compliance that the data want below nothing is no compliance, however well it fits.
pub(super) fn within_limits(factor: &Factor, columns: &Columns, further: &Factor, more: &Columns) -> f64 {
    let share = |&(_, low, high): &(usize, f64, f64), unit: [&[f64]; 2]| {
        let over = |of: [&[f64]; 2]| dot(unit[0], of[0]) + dot(unit[1], of[1]);
        let spread = over(unit).max(f64::MIN_POSITIVE).sqrt();
        let at = over([if unit[0].is_empty() { &[] } else { &factor.white }, &further.white]);
        log_normal_between((low - at) / spread, (high - at) / spread) - log_normal_between(low, high)
    };
    let units = factor.units(columns);
    let own = columns.limits.iter().zip(units).enumerate().map(|(n, (limit, unit))| {
        let before = |j: usize| {
            let (solved, share) = &further.behind[j];
            share * solved.on_units.get_or_init(|| units.iter().map(|unit| dot(&solved.row, unit)).collect())[n]
        };
        share(limit, [unit, &further.solve(before, None)])
    });
    let new = more.limits.iter().map(|limit| share(limit, [&[], &further.solve(|_| 0.0, Some(limit.0))]));
    own.chain(new).sum()
}

/// Log of the share of a standard normal distribution between two ends.
pub(super) fn log_normal_between(low: f64, high: f64) -> f64 {
    /// Beyond this the tail is that of its asymptote to a part in a thousand.
    const FAR: f64 = 20.0;
    /// Between ends as far as this is all but what rounding takes.
    const ALL: f64 = 9.0;
    if low < -ALL && high > ALL {
        return 0.0;
    }
    // Towards the tail, where differences of what is nearly one lose everything.
    let (low, high) = if high < 0.0 { (-high, -low) } else { (low, high) };
    if low > FAR {
        return -0.5 * low * low - (low * TAU.sqrt()).ln();
    }
    let beyond = |at: f64| 0.5 * erfc(at * FRAC_1_SQRT_2);
    (beyond(low) - beyond(high)).max(f64::MIN_POSITIVE).ln()
}

/// Sum of products, some at a time: in the same order on every processor. Indices, for in the widest lanes iterators are calls.
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

    /// What bounds gain at σ = 0.5.
    fn bounded(moments: &Moments, columns: &Columns) -> f64 {
        let none = Factor::default();
        let factor = none.extended(&Part::new(moments, &Columns::default(), columns), 4.0).unwrap();
        within_limits(&none, &Columns::default(), &factor, columns)
    }

    #[test]
    fn a_number_that_may_not_be_negative_gains_where_it_is_positive_and_loses_where_it_is_not() {
        // ±1.4 on the column 1 with a prior of 0.5, σ = 0.5: mean ±1.4 and variance ½ in prior sizes. Of the prior half is above
        // nothing, of the posterior Φ(±1.98) = 0.97614 or 0.02386.
        let series = [Series { samples: vec![(0, 0, 1.0)], places: [[Vector3::zeros(); 3]].into() }];
        let shape = Shape { drift: 0.0, correlation: 0.0, field: None };
        let columns = Columns { limits: vec![(0, 0.0, f64::INFINITY)], ..Columns::independent(vec![(0, 0.5)]) };
        let gain = |seen: f64| {
            let moments = Moments::of(&DMatrix::from_row_slice(1, 2, &[1.0, seen]), &series, shape);
            bounded(&moments, &columns)
        };
        assert!((gain(1.4) - 0.6690).abs() < 1e-3 && (gain(-1.4) + 3.0425).abs() < 1e-3);
        // Far out in the tail the share is no number any more, and its logarithm still is: −z²/2 − ln(z √2π) + ln 2, z = 141.42.
        assert!((gain(-100.0) + 10_005.178).abs() < 0.01);
    }
}
