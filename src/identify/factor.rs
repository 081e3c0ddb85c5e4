//! Cholesky factors of normal matrices, kept for the columns that many sets begin with and extended by those of each.

use super::moments::Moments;
use super::score::{Columns, dot};
use nalgebra::DMatrix;
use statrs::function::erf::erfc;
use std::cell::OnceCell;
use std::f64::consts::{FRAC_1_SQRT_2, TAU};

/// Columns with all that their rows of a normal matrix are made of, behind the rows of others.
pub(super) struct Part {
    /// Row by row: products with the columns before, and with its own up to the diagonal.
    products: Vec<f64>,
    prior: DMatrix<f64>,
    cross: Vec<f64>,
    /// What the prior pulls to.
    pull: Vec<f64>,
}

impl Part {
    pub(super) fn new(moments: &Moments, before: &Columns, columns: &Columns) -> Self {
        let list = &columns.list;
        let mut products = Vec::with_capacity(list.len() * (before.list.len() + list.len()));
        for (i, &(a, s)) in list.iter().enumerate() {
            let gram = moments.gram.column(a);
            products.extend(before.list.iter().chain(&list[..=i]).map(|&(b, t)| gram[b] * s * t));
        }
        let mut prior = DMatrix::zeros(list.len(), list.len());
        columns.add_precision(&mut prior);
        let mut pull = vec![0.0; list.len()];
        columns.means.iter().for_each(|&(i, mean)| pull[i] += mean);
        Self { products, prior, cross: list.iter().map(|&(a, s)| moments.cross[a] * s).collect(), pull }
    }
}

/// Rows of the Cholesky factor L of a normal matrix, behind those of another factor or from the first on.
#[derive(Default)]
pub(super) struct Factor {
    /// Rows of the other factor.
    behind: usize,
    /// One after another, up to the diagonal.
    rows: Vec<f64>,
    /// L⁻¹ of the right side.
    white: Vec<f64>,
    pub(super) half_log_det: f64,
    /// L⁻¹ of the unit vectors of bounded numbers.
    units: OnceCell<Vec<Vec<f64>>>,
}

impl Factor {
    /// Further rows behind these; `None` where the matrix is not positive definite.
    pub(super) fn extended(&self, part: &Part, precision: f64) -> Option<Self> {
        let before = self.white.len();
        let mut rows: Vec<f64> = part.products.iter().map(|product| product * precision).collect();
        let mut white: Vec<f64> = Vec::with_capacity(part.cross.len());
        let (mut from, mut half_log_det) = (0, 0.0);
        for i in 0..part.cross.len() {
            let (above, below) = rows.split_at_mut(from);
            let (own, last) = below[..=before + i].split_at_mut(before + i);
            own[before..].iter_mut().zip(part.prior.row(i).iter()).for_each(|(value, prior)| *value += prior);
            for (j, row) in triangle(&self.rows, 0).chain(triangle(above, before)).enumerate() {
                own[j] = (own[j] - dot(&own[..j], &row[..j])) / row[j];
            }
            let square = last[0] + part.prior[(i, i)] - dot(own, own);
            if square.is_nan() || square <= 0.0 {
                return None;
            }
            last[0] = square.sqrt();
            half_log_det += 0.5 * square.ln();
            let right = part.cross[i] * precision + part.pull[i];
            white.push((right - dot(&own[..before], &self.white) - dot(&own[before..], &white)) / last[0]);
            from += before + i + 1;
        }
        Some(Self { behind: before, rows, white, half_log_det, units: OnceCell::new() })
    }

    /// Square of its part of L⁻¹ of the right side.
    pub(super) fn square(&self) -> f64 {
        dot(&self.white, &self.white)
    }

    /// Its part of L⁻¹ of a vector: of what is solved in the rows before, and one at one of its own.
    fn solved(&self, before: &[f64], unit: Option<usize>) -> Vec<f64> {
        let mut solved: Vec<f64> = Vec::with_capacity(self.white.len());
        for (j, row) in triangle(&self.rows, self.behind).enumerate() {
            let right = if unit == Some(j) { 1.0 } else { 0.0 };
            let of_before = if before.is_empty() { 0.0 } else { dot(&row[..before.len()], before) };
            let own = &row[row.len() - 1 - j..];
            solved.push((right - of_before - dot(&own[..j], &solved)) / own[j]);
        }
        solved
    }
}

/// Rows of a triangle of which the first has so many values before its diagonal.
fn triangle(rows: &[f64], before: usize) -> impl Iterator<Item = &[f64]> {
    let mut rest = rows;
    (before + 1..).map_while(move |length| {
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
    let units =
        factor.units.get_or_init(|| columns.limits.iter().map(|&(i, ..)| factor.solved(&[], Some(i))).collect());
    let own = columns.limits.iter().zip(units).map(|(limit, unit)| share(limit, [unit, &further.solved(unit, None)]));
    let new = more.limits.iter().map(|limit| share(limit, [&[], &further.solved(&[], Some(limit.0))]));
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
