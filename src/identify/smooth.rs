//! Curves of a joint's angle: how smooth they are, chosen by the data.
//!
//! A curve has a knot every few degrees, more than the data hold one by one. What makes it a curve is its prior: a
//! Gaussian process along the angle (Matérn, ν = 3/2: the sum of long waves and short ones that gears show is rough
//! twice over), whose size and reach are those of most evidence. No row that is held out takes part.

use super::columns::{Columns, Smoothness};
use super::moments::Moments;
use crate::effects::JointCurve;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use std::sync::Arc;

/// Angles over which a curve stays alike, degrees: of one tooth, and of a third of a turn.
const REACHES_DEG: [f64; 9] = [1.6, 2.5, 4.0, 6.0, 9.0, 13.0, 20.0, 30.0, 45.0];
/// Sizes of curves, as shares of the typical one.
const SIZES: [f64; 5] = [0.3, 0.6, 1.2, 2.5, 5.0];
/// What a new curve has until the data have spoken: places in the two lists.
const USUAL: (usize, usize) = (3, 2);

/// A candidate that is a smooth curve of one joint.
#[derive(Clone, Debug)]
pub(super) struct Curve {
    pub(super) of: Arc<JointCurve>,
    /// As last chosen.
    pub(super) smoothness: Arc<Smoothness>,
    /// All that are tried.
    grid: Vec<Arc<Smoothness>>,
}

impl Curve {
    pub(super) fn new(of: JointCurve) -> Option<Self> {
        let each = |&reach: &f64| SIZES.map(|size| Smoothness::new(of.knots_deg(), reach, size).map(Arc::new));
        let grid: Vec<_> = REACHES_DEG.iter().flat_map(each).collect::<Option<_>>()?;
        let smoothness = Arc::clone(&grid[USUAL.0 * SIZES.len() + USUAL.1]);
        Some(Self { of: Arc::new(of), smoothness, grid })
    }

    /// Some that differ enough, for all curves alike.
    pub(super) fn common() -> impl Iterator<Item = usize> {
        [3, 5].into_iter().flat_map(|reach| [2, 3].map(|size| reach * SIZES.len() + size))
    }

    /// Takes the smoothness of that number.
    pub(super) fn take(&mut self, number: usize) {
        self.smoothness = Arc::clone(&self.grid[number]);
    }

    /// How many are tried.
    pub(super) fn variants() -> f64 {
        (REACHES_DEG.len() * SIZES.len()) as f64
    }

    /// The smoothness of most evidence together with a set, and what the curve then gains, nats.
    pub(super) fn smoothest(&self, beside: &Beside, columns: &Columns) -> (f64, Arc<Smoothness>) {
        let (information, cross) = beside.left_of(columns);
        let gain = |smooth: &Arc<Smoothness>| {
            let prior = Columns { curves: vec![(0, Arc::clone(smooth))], ..Columns::independent(columns.list.clone()) };
            (gain(information.clone(), &cross, &prior), Arc::clone(smooth))
        };
        let best = self.grid.iter().map(gain).max_by(|a, b| a.0.total_cmp(&b.0));
        best.unwrap_or_else(|| (f64::NEG_INFINITY, Arc::clone(&self.smoothness)))
    }
}

/// What further columns gain in addition to a set, at one noise: a small problem each, however large the set.
pub(super) struct Beside<'a> {
    moments: &'a Moments,
    set: Columns,
    factor: Cholesky<f64, Dyn>,
    /// 1/σ².
    precision: f64,
    /// L⁻¹ Xᵀy/σ².
    cross: DVector<f64>,
}

impl<'a> Beside<'a> {
    pub(super) fn new(moments: &'a Moments, set: Columns, sigma: f64) -> Option<Self> {
        let precision = sigma.powi(-2);
        let mut matrix = set.gram(moments) * precision;
        set.add_precision(&mut matrix);
        let factor = matrix.cholesky()?;
        let mut cross = set.cross(moments) * precision;
        factor.l_dirty().solve_lower_triangular_mut(&mut cross);
        Some(Self { moments, set, factor, precision, cross })
    }

    /// Information and Xᵀy/σ² of further columns that the set does not have already.
    fn left_of(&self, further: &Columns) -> (DMatrix<f64>, DVector<f64>) {
        let (own, set) = (&further.list, &self.set.list);
        let mut shared = DMatrix::from_fn(set.len(), own.len(), |i, j| {
            let ((a, s), (b, t)) = (set[i], own[j]);
            self.moments.gram[(a, b)] * s * t * self.precision
        });
        self.factor.l_dirty().solve_lower_triangular_mut(&mut shared);
        let information = further.gram(self.moments) * self.precision - shared.tr_mul(&shared);
        let cross = further.cross(self.moments) * self.precision - shared.tr_mul(&self.cross);
        (information, cross)
    }

    /// Evidence that the columns add, nats.
    pub(super) fn gain(&self, further: &Columns) -> f64 {
        let (information, cross) = self.left_of(further);
        gain(information, &cross, further)
    }
}

fn gain(mut information: DMatrix<f64>, cross: &DVector<f64>, prior: &Columns) -> f64 {
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
    use crate::effects::joint_error_curve;
    use nalgebra::Vector3;

    fn moments(stacked: &DMatrix<f64>) -> Moments {
        let rows = stacked.nrows();
        let samples = (0..rows).map(|t| (t, t, 1.0)).collect();
        let series = [Series { samples, places: vec![[Vector3::zeros(); 3]; rows].into() }];
        Moments::of(stacked, &series, Shape { drift: 0.0, correlation: 0.0, field: None })
    }

    /// A deterministic stand-in for noise, of about unit size.
    fn rough(i: usize) -> f64 {
        let x = (i as f64 * 12.9898).sin() * 43_758.545;
        3.4 * (x - x.floor() - 0.5)
    }

    #[test]
    fn what_is_gained_beside_a_set_is_what_evidence_says() {
        let stacked = DMatrix::from_fn(60, 4, |i, j| (0.1 * (i * (j + 1)) as f64).sin() + 0.2 * rough(i + 97 * j));
        let moments = moments(&stacked);
        let list = |columns: &[usize]| Columns::independent(columns.iter().map(|&c| (c, 1.5)).collect());
        let (with, sigma) = profiled(&moments, &list(&[0, 1, 2]), None);
        let beside = Beside::new(&moments, list(&[0, 1]), sigma).unwrap();
        // The evidence of the smaller set at the same σ, from the formula itself.
        let alone = {
            let set = list(&[0, 1]);
            let p = sigma.powi(-2);
            let matrix = DMatrix::identity(2, 2) + set.gram(&moments) * p;
            let b = set.cross(&moments) * p;
            -60.0 * sigma.ln() - 0.5 * moments.square * p + 0.5 * b.dot(&(matrix.clone().try_inverse().unwrap() * &b))
                - 0.5 * matrix.determinant().ln()
        };
        assert!((alone + beside.gain(&list(&[2])) - with).abs() < 1e-8);
    }

    #[test]
    fn a_long_wave_is_taken_for_smoother_than_a_short_one() {
        let curve = Curve::new(joint_error_curve(1, 0.0, 120.0, 2.5).joint_curve().unwrap()).unwrap();
        let knots = curve.of.knots_deg().len();
        let smoothest = |period_deg: f64| {
            let rows = 400;
            let stacked = DMatrix::from_fn(rows, knots + 1, |i, j| {
                let angle = 120.0 * i as f64 / (rows - 1) as f64;
                let mut weights = vec![0.0; knots];
                curve.of.weights(angle, &mut weights);
                if j < knots { weights[j] } else { (std::f64::consts::TAU * angle / period_deg).sin() + 0.2 * rough(i) }
            });
            let moments = moments(&stacked);
            let columns = Columns::independent((0..knots).map(|k| (k, 1.0)).collect());
            let beside = Beside::new(&moments, Columns::default(), 0.2).unwrap();
            let (gain, smooth) = curve.smoothest(&beside, &columns);
            assert!(gain > 100.0);
            REACHES_DEG[curve.grid.iter().position(|s| Arc::ptr_eq(s, &smooth)).unwrap() / SIZES.len()]
        };
        assert!(smoothest(90.0) > smoothest(15.0), "{} {}", smoothest(90.0), smoothest(15.0));
    }
}
