//! Error curves along a joint's angle, and the choice of their smoothness.
//!
//! A curve has a knot every few degrees, more than the rows determine one by one. The prior of the knots is a Gaussian
//! process along the angle, so that neighbouring knots are alike. Its covariance is Matérn with ν = 3/2 (Rasmussen and
//! Williams 2006, equation 4.17), whose paths have one derivative: the errors of gears are a sum of long and short
//! waves, and smoother processes fit them badly. Size and length scale are those of most evidence on the fitted rows;
//! held-out rows have no part in it.

use super::columns::{Columns, Smoothness};
use super::moments::Moments;
use deflex_effects::JointCurve;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use std::sync::Arc;

/// Length scales that are tried, degrees: the shortest follows the waves of single teeth, the longest waves of a third
/// of a turn.
const REACHES_DEG: [f64; 9] = [1.6, 2.5, 4.0, 6.0, 9.0, 13.0, 20.0, 30.0, 45.0];
/// Standard deviations that are tried, as shares of the typical size.
const SIZES: [f64; 5] = [0.3, 0.6, 1.2, 2.5, 5.0];
/// Length scale and standard deviation of a new curve until its smoothness is chosen: indices into the two lists.
const INITIAL: (usize, usize) = (3, 2);

/// A candidate that is a smooth curve of one joint.
#[derive(Clone, Debug)]
pub(super) struct Curve {
    /// The curve of the joint, with its knots.
    pub(super) joint_curve: Arc<JointCurve>,
    /// The prior of the knots that was chosen last.
    pub(super) smoothness: Arc<Smoothness>,
    /// All priors that are tried: for each length scale all standard deviations.
    grid: Vec<Arc<Smoothness>>,
}

impl Curve {
    /// A curve with the initial smoothness; `None` if a covariance of its knots is not positive definite.
    pub(super) fn new(joint_curve: JointCurve) -> Option<Self> {
        let each = |&reach: &f64| SIZES.map(|size| Smoothness::new(joint_curve.knots_deg(), reach, size).map(Arc::new));
        let grid: Vec<_> = REACHES_DEG.iter().flat_map(each).collect::<Option<_>>()?;
        let smoothness = Arc::clone(&grid[INITIAL.0 * SIZES.len() + INITIAL.1]);
        Some(Self { joint_curve: Arc::new(joint_curve), smoothness, grid })
    }

    /// Indices of four priors that differ clearly: two length scales with two standard deviations each.
    pub(super) fn representative() -> impl Iterator<Item = usize> {
        [3, 5].into_iter().flat_map(|reach| [2, 3].map(|size| reach * SIZES.len() + size))
    }

    /// Sets the smoothness to the prior with this index.
    pub(super) fn set_smoothness(&mut self, index: usize) {
        self.smoothness = Arc::clone(&self.grid[index]);
    }

    /// Number of priors that are tried.
    pub(super) fn variants() -> f64 {
        (REACHES_DEG.len() * SIZES.len()) as f64
    }

    /// The evidence that the curve adds to a set with the best smoothness, nats, and this smoothness. `columns` are
    /// those of the knots.
    pub(super) fn best_smoothness(&self, evidence: &ConditionalEvidence, columns: &Columns) -> (f64, Arc<Smoothness>) {
        let (information, cross) = evidence.conditional(columns);
        let gain = |smooth: &Arc<Smoothness>| {
            let prior = Columns { curves: vec![(0, Arc::clone(smooth))], ..Columns::independent(columns.list.clone()) };
            (added_evidence(information.clone(), &cross, &prior), Arc::clone(smooth))
        };
        let best = self.grid.iter().map(gain).max_by(|a, b| a.0.total_cmp(&b.0));
        best.unwrap_or_else(|| (f64::NEG_INFINITY, Arc::clone(&self.smoothness)))
    }
}

/// The evidence that further columns add to a set of columns at one σ. The set is factored once, so that each addition
/// costs only a problem of its own size.
pub(super) struct ConditionalEvidence<'a> {
    moments: &'a Moments,
    set: Columns,
    /// Cholesky factor L of the set's posterior precision.
    factor: Cholesky<f64, Dyn>,
    /// 1/σ², mm⁻².
    precision: f64,
    /// L⁻¹ Xᵀy/σ² of the set.
    whitened: DVector<f64>,
}

impl<'a> ConditionalEvidence<'a> {
    /// Factors a set at σ, mm; `None` if its posterior precision is not positive definite.
    pub(super) fn new(moments: &'a Moments, set: Columns, sigma: f64) -> Option<Self> {
        let precision = sigma.powi(-2);
        let mut matrix = set.gram(moments) * precision;
        set.add_precision(&mut matrix);
        let factor = matrix.cholesky()?;
        let mut whitened = set.cross(moments) * precision;
        factor.l_dirty().solve_lower_triangular_mut(&mut whitened);
        Some(Self { moments, set, factor, precision, whitened })
    }

    /// XᵀX/σ² and Xᵀy/σ² of further columns, conditional on the set: the Schur complement of the set in the joint
    /// normal equations.
    fn conditional(&self, further: &Columns) -> (DMatrix<f64>, DVector<f64>) {
        let (own, set) = (&further.list, &self.set.list);
        let mut shared = DMatrix::from_fn(set.len(), own.len(), |i, j| {
            let ((a, s), (b, t)) = (set[i], own[j]);
            self.moments.gram[(a, b)] * s * t * self.precision
        });
        self.factor.l_dirty().solve_lower_triangular_mut(&mut shared);
        let information = further.gram(self.moments) * self.precision - shared.tr_mul(&shared);
        let cross = further.cross(self.moments) * self.precision - shared.tr_mul(&self.whitened);
        (information, cross)
    }

    /// Log evidence that further columns add to the set, nats.
    pub(super) fn gain(&self, further: &Columns) -> f64 {
        let (information, cross) = self.conditional(further);
        added_evidence(information, &cross, further)
    }
}

/// Log evidence that columns with a prior add, nats, from their conditional XᵀX/σ² and Xᵀy/σ².
fn added_evidence(mut information: DMatrix<f64>, cross: &DVector<f64>, prior: &Columns) -> f64 {
    prior.add_precision(&mut information);
    let Some(factor) = information.cholesky() else { return f64::NEG_INFINITY };
    let mut white = cross.clone();
    factor.l_dirty().solve_lower_triangular_mut(&mut white);
    let half_log_det: f64 = factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum();
    0.5 * white.norm_squared() - half_log_det + prior.half_log_det()
}

#[cfg(test)]
mod tests {
    use super::super::noise::{Series, Shape};
    use super::super::profile::profiled;
    use super::*;
    use deflex_effects::joint_error_curve;
    use nalgebra::Vector3;

    fn moments(stacked: &DMatrix<f64>) -> Moments {
        let rows = stacked.nrows();
        let samples = (0..rows).map(|t| (t, t, 1.0)).collect();
        let series = [Series { samples, places: vec![[Vector3::zeros(); 3]; rows].into() }];
        Moments::of(stacked, &series, Shape { drift: 0.0, correlation: 0.0, field: None })
    }

    /// Deterministic numbers that replace noise, with a standard deviation of about one.
    fn rough(i: usize) -> f64 {
        let x = (i as f64 * 12.9898).sin() * 43_758.545;
        3.4 * (x - x.floor() - 0.5)
    }

    #[test]
    fn the_gain_of_a_column_is_the_difference_of_two_evidences() {
        let stacked = DMatrix::from_fn(60, 4, |i, j| (0.1 * (i * (j + 1)) as f64).sin() + 0.2 * rough(i + 97 * j));
        let moments = moments(&stacked);
        let list = |columns: &[usize]| Columns::independent(columns.iter().map(|&c| (c, 1.5)).collect());
        let (with, sigma) = profiled(&moments, &list(&[0, 1, 2]), None);
        let conditional = ConditionalEvidence::new(&moments, list(&[0, 1]), sigma).unwrap();
        // The evidence of the smaller set at the same σ, directly from the equation in `profile`.
        let alone = {
            let set = list(&[0, 1]);
            let p = sigma.powi(-2);
            let matrix = DMatrix::identity(2, 2) + set.gram(&moments) * p;
            let b = set.cross(&moments) * p;
            -60.0 * sigma.ln() - 0.5 * moments.square * p + 0.5 * b.dot(&(matrix.clone().try_inverse().unwrap() * &b))
                - 0.5 * matrix.determinant().ln()
        };
        assert!((alone + conditional.gain(&list(&[2])) - with).abs() < 1e-8);
    }

    #[test]
    fn a_long_wave_gets_a_longer_length_scale_than_a_short_one() {
        let curve = Curve::new(joint_error_curve(1, 0.0, 120.0, 2.5).joint_curve().unwrap()).unwrap();
        let knots = curve.joint_curve.knots_deg().len();
        let reach_deg = |period_deg: f64| {
            let rows = 400;
            let stacked = DMatrix::from_fn(rows, knots + 1, |i, j| {
                let angle = 120.0 * i as f64 / (rows - 1) as f64;
                let mut weights = vec![0.0; knots];
                curve.joint_curve.weights(angle, &mut weights);
                if j < knots { weights[j] } else { (std::f64::consts::TAU * angle / period_deg).sin() + 0.2 * rough(i) }
            });
            let moments = moments(&stacked);
            let columns = Columns::independent((0..knots).map(|k| (k, 1.0)).collect());
            let evidence = ConditionalEvidence::new(&moments, Columns::default(), 0.2).unwrap();
            let (gain, smooth) = curve.best_smoothness(&evidence, &columns);
            assert!(gain > 100.0);
            REACHES_DEG[curve.grid.iter().position(|s| Arc::ptr_eq(s, &smooth)).unwrap() / SIZES.len()]
        };
        assert!(reach_deg(90.0) > reach_deg(15.0), "{} {}", reach_deg(90.0), reach_deg(15.0));
    }
}
