//! Evidence of a set of effects, from moments alone.
//!
//! With θ ~ N(0, τ²) about neutral and Gaussian noise, the marginal likelihood of the data is
//! `−n ln σ − ½ yᵀy/σ² + ½ (b/σ²)ᵀ(I + G/σ²)⁻¹(b/σ²) − ½ ln det(I + G/σ²)`, G and b over the prior sizes. It punishes
//! parameters that the data do not need by itself; σ is profiled, the noise's shape chosen with it. A prior about μ, in the
//! same sizes, makes `b/σ² + μ` of `b/σ²` and takes off `½ μᵀμ`. Numbers that are bounded add the log of the share of their
//! posterior within the bounds, less that of their prior.

use super::moments::Moments;
use super::smooth::Smoothness;
use nalgebra::{DMatrix, DVector};
use statrs::function::erf::erfc;
use std::f64::consts::{FRAC_1_SQRT_2, TAU};
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

/// Noise below this is not believed, mm: no instrument measures a robot to a tenth of a micrometre.
const LEAST_SIGMA: f64 = 1e-4;

/// How well an instrument's declared standard deviation is known, as a share of it.
const DECLARED: f64 = 0.15;

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

/// Evidence for one shape with σ at its best, searched from `guess`.
pub(super) fn profiled(moments: &Moments, columns: &Columns, guess: Option<f64>) -> (f64, f64) {
    let (gram, cross) = (columns.gram(moments), columns.cross(moments));
    let n = moments.count as f64;
    let size = columns.list.len();
    let expected: f64 = columns.means.iter().map(|(_, mean)| mean * mean).sum();
    let prior = {
        let mut prior = DMatrix::zeros(size, size);
        columns.add_precision(&mut prior);
        prior
    };
    let mut rows = vec![0.0; size * size];
    let mut white = vec![0.0; size];
    let mut at = |log_sigma: f64| {
        let precision = (-2.0 * log_sigma).exp();
        let declared = moments.declared.map_or(0.0, |declared| -0.5 * ((log_sigma - declared.ln()) / DECLARED).powi(2));
        let base = -n * log_sigma - 0.5 * moments.square * precision - moments.log_scale
            + moments.shape.log_prior()
            + declared;
        if size == 0 {
            return base;
        }
        for ((value, gram), prior) in rows.iter_mut().zip(gram.iter()).zip(prior.iter()) {
            *value = gram * precision + prior;
        }
        white.iter_mut().zip(cross.iter()).for_each(|(white, cross)| *white = cross * precision);
        columns.means.iter().for_each(|&(i, mean)| white[i] += mean);
        let Some((half_log_det, square)) = whiten_right(&mut rows, &mut white) else { return f64::NEG_INFINITY };
        base + 0.5 * (square - expected) - half_log_det + columns.half_log_det()
    };
    let rms = 0.5 * (moments.square / n.max(1.0)).max(LEAST_SIGMA * LEAST_SIGMA).ln();
    let mut middle = guess.map_or(rms, f64::ln);
    let mut width = if guess.is_some() { 0.05 } else { 0.4 };
    let mut best = (at(middle), middle);
    // Parabola through three points.
    for _ in 0..20 {
        let (left, right) = (at(middle - width), at(middle + width));
        let centre = best.0;
        let curve = left - 2.0 * centre + right;
        let step = if curve < 0.0 { 0.5 * width * (left - right) / curve } else { width.copysign(right - left) };
        let step = step.clamp(-2.0 * width, 2.0 * width);
        let next = (middle + step).max(LEAST_SIGMA.ln());
        let value = at(next);
        for (evidence, place) in [(left, middle - width), (right, middle + width), (value, next)] {
            if evidence > best.0 {
                best = (evidence, place);
            }
        }
        // The evidence falls by n·δ²: a hundredth of a nat is enough.
        if n * step * step < 0.01 {
            break;
        }
        // Far from the top the steps grow, near it they shrink.
        width = if step.abs() < width { (0.3 * width).max(0.01) } else { (2.0 * width).min(0.8) };
        middle = best.1;
    }
    let sigma = best.1.exp();
    (best.0 + within_limits(moments, columns, sigma), sigma)
}

/// What it says for the bounded numbers that they lie where they may, nats: the share of the posterior there over that of the
/// prior, number by number. A compliance that the data want below nothing is no compliance, however well it fits.
fn within_limits(moments: &Moments, columns: &Columns, sigma: f64) -> f64 {
    if columns.limits.is_empty() {
        return 0.0;
    }
    let Some((mean, covariance)) = posterior(moments, columns, sigma) else { return 0.0 };
    let of = |&(i, low, high): &(usize, f64, f64)| {
        let (at, spread) = (mean[i], covariance[(i, i)].max(f64::MIN_POSITIVE).sqrt());
        log_normal_between((low - at) / spread, (high - at) / spread) - log_normal_between(low, high)
    };
    columns.limits.iter().map(of).sum()
}

/// Log of the share of a standard normal distribution between two ends.
fn log_normal_between(low: f64, high: f64) -> f64 {
    /// Beyond this the tail is that of its asymptote to a part in a thousand.
    const FAR: f64 = 20.0;
    // Towards the tail, where differences of what is nearly one lose everything.
    let (low, high) = if high < 0.0 { (-high, -low) } else { (low, high) };
    if low > FAR {
        return -0.5 * low * low - (low * TAU.sqrt()).ln();
    }
    let beyond = |at: f64| 0.5 * erfc(at * FRAC_1_SQRT_2);
    (beyond(low) - beyond(high)).max(f64::MIN_POSITIVE).ln()
}

/// Half the log determinant of a symmetric matrix, row by row, and the square of L⁻¹ of a right side, L its Cholesky factor,
/// which takes the matrix's place; `None` where it is not positive definite.
fn whiten_right(matrix: &mut [f64], right: &mut [f64]) -> Option<(f64, f64)> {
    let size = right.len();
    let mut half_log_det = 0.0;
    for i in 0..size {
        let (above, below) = matrix.split_at_mut(i * size);
        let own = &mut below[..=i];
        for (j, row) in above.chunks_exact(size).enumerate() {
            own[j] = (own[j] - dot(&own[..j], &row[..j])) / row[j];
        }
        let square = own[i] - dot(&own[..i], &own[..i]);
        if square.is_nan() || square <= 0.0 {
            return None;
        }
        own[i] = square.sqrt();
        half_log_det += 0.5 * square.ln();
        right[i] = (right[i] - dot(&own[..i], &right[..i])) / own[i];
    }
    Some((half_log_det, dot(right, right)))
}

/// Sum of products, some at a time: in the same order on every processor.
pub(super) fn dot<A: Copy + Into<f64>>(a: &[A], b: &[f64]) -> f64 {
    const TOGETHER: usize = 8;
    let mut sums = [0.0; TOGETHER];
    let (left, right) = (a.chunks_exact(TOGETHER), b.chunks_exact(TOGETHER));
    let rest: f64 = left.remainder().iter().zip(right.remainder()).map(|(a, b)| (*a).into() * b).sum();
    for (a, b) in left.zip(right) {
        for k in 0..TOGETHER {
            sums[k] += a[k].into() * b[k];
        }
    }
    rest + sums.iter().sum::<f64>()
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
    fn a_right_side_is_whitened_by_the_cholesky_factor() {
        let matrix = DMatrix::from_fn(21, 21, |i, j| {
            let near = (-0.1 * i.abs_diff(j) as f64).exp();
            if i == j { 2.0 + 0.01 * i as f64 } else { near }
        });
        let right = DVector::from_fn(21, |i, _| (i as f64 * 0.7).sin());
        let mut factor = matrix.as_slice().to_vec();
        let (half_log_det, square) = whiten_right(&mut factor, &mut right.as_slice().to_vec()).unwrap();
        assert!((half_log_det - 0.5 * matrix.determinant().ln()).abs() < 1e-12);
        assert!((square - right.dot(&(matrix.clone().try_inverse().unwrap() * &right))).abs() < 1e-12);
        assert!(whiten_right(&mut (-matrix).as_slice().to_vec(), &mut right.as_slice().to_vec()).is_none());
    }

    #[test]
    fn a_prior_about_one_draws_there_and_its_evidence_is_that_of_the_data_about_it() {
        // Two scalars of 1.4 and 0.3 on the column (1, 0): about 1 with a spread of 0.5, σ = 0.5, the mean is halfway, 1.2.
        let stacked = DMatrix::from_row_slice(2, 2, &[1.0, 1.4, 0.0, 0.3]);
        let series = [Series { samples: vec![(0, 0, 1.0), (1, 1, 1.0)], places: [[Vector3::zeros(); 3]; 2].into() }];
        let shape = Shape { drift: 0.0, correlation: 0.0, field: None };
        let moments = Moments::of(&stacked, &series, shape);
        let about_one = Columns { means: vec![(0, 2.0)], ..Columns::independent(vec![(0, 0.5)]) };
        let (mean, _) = posterior(&moments, &about_one, 0.5).unwrap();
        assert!((0.5 * mean[0] - 1.2).abs() < 1e-12);
        // The same as data of 0.4 with a prior about zero.
        let shifted = Moments::of(&DMatrix::from_row_slice(2, 2, &[1.0, 0.4, 0.0, 0.3]), &series, shape);
        let about_zero = Columns::independent(vec![(0, 0.5)]);
        let evidence = |moments: &Moments, columns: &Columns| profiled(moments, columns, Some(0.3)).0;
        assert!((evidence(&moments, &about_one) - evidence(&shifted, &about_zero)).abs() < 1e-6);
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
            within_limits(&moments, &columns, 0.5)
        };
        assert!((gain(1.4) - 0.6690).abs() < 1e-3 && (gain(-1.4) + 3.0425).abs() < 1e-3);
        // Far out in the tail the share is no number any more, and its logarithm still is: −z²/2 − ln(z √2π) + ln 2, z = 141.42.
        assert!((gain(-100.0) + 10_005.178).abs() < 0.01);
        assert!(
            within_limits(
                &Moments::of(&DMatrix::from_row_slice(1, 2, &[1.0, 1.0]), &series, shape),
                &Columns::default(),
                0.5
            )
            .abs()
                < 1e-12
        );
    }

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
