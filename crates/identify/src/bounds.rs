//! The probability that normally distributed numbers are within their bounds, by the Laplace approximation at the mode
//! within the bounds.
//!
//! A product of the marginal probabilities fails if numbers depend on one another: a number that is at its bound moves
//! the others, which then may have to be at their bounds too. At the mode within the bounds some numbers A are held at a
//! bound b, and the others F are free. With the mean μ and the covariance S, and with Q = S_AA⁻¹, the logarithm of the
//! density of A at the bounds is exact, and its fall from there into the range is that of single numbers:
//!
//! `−½ rᵀQr + ½ ln det Q + Σ_A (½ z² + ln Φ[z, z + w] − ½ ln Q_ii) + Σ_F ln Φ[(low − m)/s, (high − m)/s]`
//!
//! Here r = b − μ_A, Φ[a, b] is the standard normal probability of an interval, z is the slope at the bound and w the
//! distance of the two bounds, both in units of 1/√Q_ii, and m and s² are mean and variance of a free number given
//! those that are held. One number is exact.

use super::triangle::substitute;
use deflex_lanes::widest;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use statrs::function::erf::erfc;
use std::f64::consts::{FRAC_1_SQRT_2, TAU};

/// Smallest and largest value of a number.
#[derive(Clone, Copy, Debug)]
pub(super) struct Range {
    pub(super) low: f64,
    pub(super) high: f64,
}

impl Range {
    /// The range in standard deviations from a mean.
    fn about(self, mean: f64, spread: f64) -> Self {
        Self { low: (self.low - mean) / spread, high: (self.high - mean) / spread }
    }

    /// Logarithm of its probability under the standard normal distribution.
    pub(super) fn log_probability(self) -> f64 {
        /// Beyond this many standard deviations the tail differs from its asymptote exp(−z²/2) / (z √2π) by less than
        /// 0.3 %.
        const FAR: f64 = 20.0;
        /// Beyond this many standard deviations on both sides the probability of what is outside is below the rounding
        /// error.
        const ALL: f64 = 9.0;
        let Self { low, high } = self;
        if low < -ALL && high > ALL {
            return 0.0;
        }
        // An interval in the lower tail is mirrored: the difference of two probabilities near one would lose all
        // digits.
        let (low, high) = if high < 0.0 { (-high, -low) } else { (low, high) };
        if low > FAR {
            let beyond = (-0.5 * (high - low) * (high + low)).exp();
            return -0.5 * low * low - (low * TAU.sqrt()).ln() + (-beyond).ln_1p();
        }
        let beyond = |at: f64| 0.5 * erfc(at * FRAC_1_SQRT_2);
        (beyond(low) - beyond(high)).max(f64::MIN_POSITIVE).ln()
    }
}

/// A number that is held at a bound.
struct Held {
    number: usize,
    bound: f64,
    /// 1 at the lower bound and −1 at the upper one.
    side: f64,
    /// How strongly the bound pushes the number into its range; not negative.
    push: f64,
    /// Covariances of the number with all numbers.
    covariances: Vec<f64>,
}

/// Normally distributed numbers with their ranges.
pub(super) struct Normals<'a> {
    pub(super) ranges: Vec<Range>,
    pub(super) means: Vec<f64>,
    /// The covariance of two numbers.
    pub(super) covariance: &'a dyn Fn(usize, usize) -> f64,
}

impl Normals<'_> {
    /// Logarithm of the probability that all numbers are within their ranges.
    pub(super) fn log_probability(&self) -> f64 {
        let variances: Vec<f64> =
            (0..self.means.len()).map(|i| (self.covariance)(i, i).max(f64::MIN_POSITIVE)).collect();
        let held = self.held(&variances);
        let Some(factor) = factor(&held) else { return f64::NEG_INFINITY };
        let precision = factor.inverse();
        let mut sum = -factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>();
        for (k, Held { number, bound, side, push, .. }) in held.iter().enumerate() {
            let Range { low, high } = self.ranges[*number];
            let root = precision[(k, k)].sqrt();
            let slope = push / root;
            let fall = Range { low: slope, high: slope + (high - low) * root }.log_probability();
            sum += 0.5 * slope * slope + fall - root.ln() - 0.5 * (bound - self.means[*number]) * side * push;
        }
        let mode = self.mode(&held);
        let free: Vec<usize> = (0..mode.len()).filter(|i| held.iter().all(|held| held.number != *i)).collect();
        let mut known: Vec<f64> = free.iter().flat_map(|&i| held.iter().map(move |held| held.covariances[i])).collect();
        let triangle = factor.l_dirty().as_slice();
        widest!(<'a> (size: usize = held.len(), triangle: &'a [f64] = triangle, known: &'a mut [f64] = &mut known) {
            for n in 0..known.len() / size.max(1) {
                substitute(triangle, &mut known[n * size..(n + 1) * size]);
            }
        });
        let given = |(n, &i): (usize, &usize)| {
            let known = &known[n * held.len()..(n + 1) * held.len()];
            let variance = (variances[i] - known.iter().map(|k| k * k).sum::<f64>()).max(f64::MIN_POSITIVE);
            self.ranges[i].about(mode[i], variance.sqrt()).log_probability()
        };
        sum + free.iter().enumerate().map(given).sum::<f64>()
    }

    /// The most probable numbers if these are held.
    fn mode(&self, held: &[Held]) -> Vec<f64> {
        let mut mode = self.means.clone();
        for held in held {
            mode.iter_mut().zip(&held.covariances).for_each(|(mode, c)| *mode += held.side * held.push * c);
        }
        mode
    }

    /// The numbers that are at a bound at the most probable numbers within all ranges. The pushes of the bounds solve
    /// non-negative least squares (Lawson and Hanson 1974, chapter 23).
    fn held(&self, variances: &[f64]) -> Vec<Held> {
        /// Distance from its range, in standard deviations, up to which a number is at the bound except for rounding.
        const ROUNDING: f64 = 1e-9;
        let mut held: Vec<Held> = Vec::new();
        // Every round adds a number, and few numbers are released again.
        for _ in 0..3 * self.means.len() {
            let mode = self.mode(&held);
            let outside = |i: usize| {
                let Range { low, high } = self.ranges[i].about(mode[i], variances[i].sqrt());
                if low > -high { (low, i, 1.0) } else { (-high, i, -1.0) }
            };
            let open = (0..mode.len()).filter(|i| held.iter().all(|held| held.number != *i));
            let worst = open.map(outside).max_by(|a, b| a.0.total_cmp(&b.0)).filter(|worst| worst.0 > ROUNDING);
            let Some((_, number, side)) = worst else { break };
            let Range { low, high } = self.ranges[number];
            let covariances = (0..mode.len()).map(|i| (self.covariance)(number, i)).collect();
            held.push(Held { number, bound: if side > 0.0 { low } else { high }, side, push: 0.0, covariances });
            self.push(&mut held);
        }
        held
    }

    /// Computes the pushes of the bounds, and releases the numbers that a bound would have to pull.
    fn push(&self, held: &mut Vec<Held>) {
        while let Some(factor) = factor(held) {
            let off = DVector::from_iterator(held.len(), held.iter().map(|h| h.bound - self.means[h.number]));
            let wanted = factor.solve(&off);
            let wanted: Vec<f64> = held.iter().zip(wanted.iter()).map(|(held, wanted)| held.side * wanted).collect();
            let share =
                |(held, wanted): (&Held, &f64)| if *wanted < 0.0 { held.push / (held.push - wanted) } else { 1.0 };
            let share = held.iter().zip(&wanted).map(share).fold(1.0, f64::min);
            let pulls: Vec<bool> = wanted.iter().map(|wanted| *wanted < 0.0).collect();
            held.iter_mut().zip(&wanted).for_each(|(held, wanted)| held.push += share * (wanted - held.push));
            if share >= 1.0 {
                return;
            }
            let least = held.iter().zip(&pulls).filter(|(_, pulls)| **pulls).map(|(held, _)| held.push);
            let least = least.fold(f64::INFINITY, f64::min);
            let mut pulls = pulls.into_iter();
            held.retain(|held| !(pulls.next() == Some(true) && held.push <= least));
        }
    }
}

/// Cholesky factor of the covariance of the numbers that are held; `None` if it is not positive definite.
fn factor(held: &[Held]) -> Option<Cholesky<f64, Dyn>> {
    DMatrix::from_fn(held.len(), held.len(), |i, j| held[i].covariances[held[j].number]).cholesky()
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOT_NEGATIVE: Range = Range { low: 0.0, high: f64::INFINITY };

    /// The logarithm for numbers with these means, the variances 1 and ¼, and a correlation.
    fn of_two(ranges: [Range; 2], means: [f64; 2], correlation: f64) -> f64 {
        let covariance = |i: usize, j: usize| [[1.0, 0.5 * correlation], [0.5 * correlation, 0.25]][i][j];
        Normals { ranges: ranges.into(), means: means.into(), covariance: &covariance }.log_probability()
    }

    /// The same by the trapezoidal rule over the first number, and exactly over the second.
    fn by_quadrature([first, second]: [Range; 2], means: [f64; 2], correlation: f64) -> f64 {
        const STEPS: usize = 40_000;
        let end = first.high.min(means[0].max(0.0) + 60.0);
        let step = (end - first.low) / STEPS as f64;
        let log_density = |k: usize| {
            let x = first.low + k as f64 * step;
            let spread = 0.5 * (1.0 - correlation * correlation).sqrt();
            let given = second.about(means[1] + 0.5 * correlation * (x - means[0]), spread);
            -0.5 * (x - means[0]).powi(2) - 0.5 * TAU.ln() + given.log_probability()
        };
        let logs: Vec<f64> = (0..=STEPS).map(log_density).collect();
        let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let ends = 0.5 * ((logs[0] - most).exp() + (logs[STEPS] - most).exp());
        most + (step * (logs.iter().map(|log| (log - most).exp()).sum::<f64>() - ends)).ln()
    }

    #[test]
    fn one_number_has_the_probability_of_the_truncated_normal_distribution() {
        // Φ(2) = 0.977250, Φ(−2) = 0.022750, Φ(1) − Φ(−1) = 0.682689, and Φ(3) − Φ(2) = 0.021400.
        let of = |range, mean: f64| {
            Normals { ranges: vec![range], means: vec![mean], covariance: &|_, _| 4.0 }.log_probability()
        };
        let both = Range { low: -2.0, high: 2.0 };
        for (range, mean, probability) in
            [(NOT_NEGATIVE, 4.0, 0.977_250), (NOT_NEGATIVE, -4.0, 0.022_750), (both, 0.0, 0.682_689)]
        {
            assert!((of(range, mean) - f64::ln(probability)).abs() < 3e-5, "{mean}");
        }
        assert!((of(Range { low: 0.0, high: 2.0 }, -4.0) - 0.021_400f64.ln()).abs() < 3e-5);
        assert!((of(Range { low: -2.0, high: 0.0 }, 4.0) - 0.021_400f64.ln()).abs() < 3e-5);
        // Far in the tail the probability underflows, but its logarithm does not: −z²/2 − ln(z √2π).
        assert!((of(NOT_NEGATIVE, -400.0) + 20_006.217_3).abs() < 1e-3);
    }

    #[test]
    fn two_numbers_have_the_probability_of_the_integral() {
        let bounded = Range { low: 0.0, high: 1.5 };
        let mut off: Vec<f64> = Vec::new();
        for correlation in [-0.9, -0.5, 0.0, 0.5, 0.9] {
            for first in [-9.0, -3.0, -1.0, 0.0, 1.0, 3.0] {
                for second in [-4.0, -1.5, -0.5, 0.0, 0.5, 1.5] {
                    for ranges in [[NOT_NEGATIVE; 2], [bounded, NOT_NEGATIVE]] {
                        let exact = by_quadrature(ranges, [first, second], correlation);
                        let error = of_two(ranges, [first, second], correlation) - exact;
                        // A product of the marginal probabilities is off by up to 300 nats here. The largest error is that of
                        // two free numbers with their means at the bounds: ln ¼ in place of the exact −2.63 at −0.9.
                        assert!(error.abs() < 1.25, "{correlation} {first} {second}: {error} of {exact}");
                        off.push(error.abs());
                    }
                }
            }
        }
        off.sort_by(f64::total_cmp);
        assert!(off[off.len() * 9 / 10] < 0.3, "{off:?}");
    }

    #[test]
    fn the_order_of_the_numbers_does_not_matter() {
        let (means, spread) = ([-3.0, 2.0, -1.0, 0.5], [1.0, 0.5, 2.0, 1.0]);
        let covariance =
            |i: usize, j: usize| spread[i] * spread[j] * if i == j { 1.0 } else { 0.7 - 0.5 * ((i + j) % 3) as f64 };
        let of = |order: [usize; 4]| {
            let covariance = |i: usize, j: usize| covariance(order[i], order[j]);
            let means = order.map(|i| means[i]).into();
            Normals { ranges: vec![NOT_NEGATIVE; 4], means, covariance: &covariance }.log_probability()
        };
        assert!((of([0, 1, 2, 3]) - of([3, 1, 0, 2])).abs() < 1e-9);
        assert!((of([0, 1, 2, 3]) - of([2, 3, 1, 0])).abs() < 1e-9);
    }
}
