//! A map of errors that no physical effect explains: the mean of a Gaussian process over place, posture and cutting force.
//!
//! This is the third form of the effect `empirical`: a sum of Gaussian bells about measured rows. Distances are measured in units of the
//! spread of place, wrist angles and force over the rows of the fit. The correction therefore fades to zero when the tool is elsewhere,
//! the wrist has other angles, or the cutting force is another.

use super::empirical_field::NOTHING;
use super::{Deflection, Effect, Load, Number, Parts, Physics, Situation, State};
use deflex_lanes::{Mask, Real, Vector};
use deflex_robot::Joints;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Vector3};
use serde::{Deserialize, Serialize};
use std::sync::{Arc, OnceLock};

/// A shift of the TCP in base axes: a sum of bells about places, postures and forces.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Discrepancy {
    /// Length scale of a bell exp(−½ d²/reach²), in spreads.
    reach: f64,
    /// Standard deviation over the rows of place (mm), wrist angles (degrees) and force (N). A coordinate with spread 0 is ignored.
    spread: [f64; 3],
    /// Places of the centres in the base frame, mm.
    at_mm: Vec<[f64; 3]>,
    /// Commanded motor angles of axes 4 to 6 at the centres, degrees.
    wrist_deg: Vec<[f64; 3]>,
    /// Cutting force on the tool at the centres, N, work object axes.
    force_n: Vec<[f64; 3]>,
    /// Shift of the TCP by the bell of each centre, mm, base axes.
    shift_mm: Vec<[f64; 3]>,
    /// Standard deviation of the process for each axis, mm; 0 if unknown.
    #[serde(default)]
    sigma_mm: f64,
    /// Standard deviation of what was measured of the process at each centre, for each axis, mm.
    #[serde(default)]
    noise_mm: f64,
    /// See [`Discrepancy::measured_correlations`]; computed at its first use.
    #[serde(skip)]
    factor: Arc<OnceLock<Option<Cholesky<f64, Dyn>>>>,
}

/// A measured row as the centre of a bell: place, wrist angles and force, and the shift of the TCP there.
#[derive(Clone, Copy, Debug)]
#[doc(hidden)]
pub struct Bell {
    /// Place in the base, mm.
    pub at: Vector3<f64>,
    /// Commanded motor angles of axes 4 to 6, rad.
    pub wrist: Vector3<f64>,
    /// Cutting force on the tool, work object axes, N.
    pub force: Vector3<f64>,
    /// Height of the bell, base axes, mm.
    pub shift: Vector3<f64>,
}

/// Sizes of the process whose mean is a sum of bells.
#[derive(Clone, Copy, Debug)]
#[doc(hidden)]
pub struct BellSizes {
    /// Length scale of a bell in units of the spreads.
    pub reach: f64,
    /// Spreads of place (mm), wrist angles (rad) and force (N) over the measured rows.
    pub spreads: [f64; 3],
    /// Standard deviation of the process for each axis, mm.
    pub sigma_mm: f64,
    /// Standard deviation of what the rows say about the process at each centre, for each axis, mm.
    pub noise_mm: f64,
}

/// The effect `empirical` as a sum of bells.
#[must_use]
#[doc(hidden)]
pub fn discrepancy(sizes: BellSizes, bells: &[Bell]) -> Box<dyn Effect> {
    let BellSizes { reach, spreads: [place, wrist, force], sigma_mm, noise_mm } = sizes;
    let all = |of: &dyn Fn(&Bell) -> Vector3<f64>| bells.iter().map(|bell| of(bell).into()).collect();
    Box::new(Discrepancy {
        reach,
        spread: [place, wrist.to_degrees(), force],
        at_mm: all(&|bell| bell.at),
        wrist_deg: all(&|bell| bell.wrist.map(f64::to_degrees)),
        force_n: all(&|bell| bell.force),
        shift_mm: all(&|bell| bell.shift),
        sigma_mm,
        noise_mm,
        factor: Arc::default(),
    })
}

impl Discrepancy {
    pub(super) fn check(self) -> Result<Self, String> {
        if !(self.reach.is_finite() && self.reach > 0.0) {
            return Err(format!("`reach` is {}, expected more than 0", self.reach));
        }
        for (key, value) in [("sigma_mm", self.sigma_mm), ("noise_mm", self.noise_mm)] {
            if !(value.is_finite() && value >= 0.0) {
                return Err(format!("`{key}` is {value}, expected 0 or more"));
            }
        }
        if !self.spread.iter().all(|spread| spread.is_finite() && *spread >= 0.0) {
            return Err(format!("`spread` is {:?}, expected three numbers not below 0", self.spread));
        }
        let centres = self.shift_mm.len();
        for (key, list) in [
            ("at_mm", &self.at_mm),
            ("wrist_deg", &self.wrist_deg),
            ("force_n", &self.force_n),
            ("shift_mm", &self.shift_mm),
        ] {
            if list.len() != centres || !list.iter().flatten().all(|value| value.is_finite()) {
                let message =
                    format!("`{key}` has {}, expected as many as `shift_mm` ({centres}), all finite", list.len());
                return Err(message);
            }
        }
        Ok(self)
    }

    /// Factors from a difference in each coordinate to units of the reach; 0 for a coordinate that is ignored.
    fn scales(&self) -> [f64; 3] {
        self.spread.map(|spread| if spread > 0.0 { 1.0 / (spread * self.reach) } else { 0.0 })
    }

    /// Cholesky factor of the covariance of the measurements at the centres, relative to the variance of the process.
    fn measured_correlations(&self) -> Option<&Cholesky<f64, Dyn>> {
        /// Least share of the diagonal, so that centres near one another leave the matrix positive definite.
        const NUGGET: f64 = 1e-9;
        let factored = || {
            let scales = self.scales();
            let noise = (self.noise_mm / self.sigma_mm).powi(2).max(NUGGET);
            let count = self.shift_mm.len();
            let of =
                |i: usize| [self.at_mm[i], self.wrist_deg[i], self.force_n[i]].map(|part| Vector::of(&part.into()));
            let covariance = |i, j| self.alike(i, scales, of(j)) + if i == j { noise } else { 0.0 };
            DMatrix::from_fn(count, count, covariance).cholesky()
        };
        self.factor.get_or_init(factored).as_ref()
    }

    /// Correlation of the process at a centre with that at a place.
    fn alike(&self, centre: usize, scales: [f64; 3], here: [Vector<f64>; 3]) -> f64 {
        (-0.5 * self.apart(centre, scales, here)).exp()
    }

    /// Squared distance from each centre, in units of the reach.
    #[inline(always)]
    fn apart<R: Real>(&self, i: usize, scales: [f64; 3], here: [Vector<R>; 3]) -> R {
        let centre = [self.at_mm[i], self.wrist_deg[i], self.force_n[i]];
        let of = |k: usize| {
            let off = (here[k] - Vector::of(&centre[k].into())) * R::of(scales[k]);
            off.dot(off)
        };
        of(0) + of(1) + of(2)
    }
}

impl Physics for Discrepancy {
    fn parts(&self) -> Parts {
        Parts::BASE
    }

    #[inline(always)]
    fn deflect<R: Real>(&self, state: &State<'_, R>, load: &Load<R>, out: &mut Deflection<R>) {
        let site = state.site;
        let degrees = |i: usize| site.commanded[i] * R::of(1.0f64.to_degrees());
        let here = [
            site.base_from_wobj.point(site.wanted) * R::of(1e3),
            Vector::new(degrees(3), degrees(4), degrees(5)),
            site.base_from_wobj.turn_back(load.cut),
        ];
        let (scales, mut shift) = (self.scales(), Vector::ZERO);
        for (i, bell) in self.shift_mm.iter().enumerate() {
            let exponent = self.apart(i, scales, here) * -0.5;
            let felt = R::of(NOTHING).lt(exponent);
            if felt.any() {
                let size = felt.select(exponent.each(f64::exp), R::ZERO);
                shift = shift + Vector::of(&(*bell).into()) * size;
            }
        }
        out.base.shift = out.base.shift + shift * R::of(1e-3);
    }
}

impl Effect for Discrepancy {
    /// None to fit: neighbouring bells overlap, so that single heights mean nothing.
    fn numbers(&mut self) -> Vec<Number<'_>> {
        Vec::new()
    }

    /// The heights of the bells, mm: the three axes of the first bell, then those of the next.
    fn uncertain(&self) -> usize {
        3 * self.shift_mm.len()
    }

    fn moved(&self, changes: &[f64]) -> Box<dyn Effect> {
        let mut moved = self.clone();
        moved.shift_mm.as_flattened_mut().iter_mut().zip(changes).for_each(|(height, change)| *height += change);
        Box::new(moved)
    }

    /// The variance of the process, given a measurement at each centre (Rasmussen and Williams 2006, equation 2.26).
    fn unseen_shift(&self, situation: &Situation<'_>, motor_commanded: &Joints) -> f64 {
        if self.sigma_mm <= 0.0 {
            return 0.0;
        }
        let degrees = |i: usize| motor_commanded[i].to_degrees();
        let at = situation.base_from_wobj * situation.wobj_from_tcp;
        let here =
            [at.translation.vector * 1e3, Vector3::new(degrees(3), degrees(4), degrees(5)), situation.cutting_force()];
        let (here, scales) = (here.map(|part| Vector::of(&part)), self.scales());
        let alike = DVector::from_fn(self.shift_mm.len(), |i, _| self.alike(i, scales, here));
        let known: f64 = self.measured_correlations().map_or(0.0, |factor| alike.dot(&factor.solve(&alike)));
        3e-6 * self.sigma_mm.powi(2) * (1.0 - known).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use crate::bench::Bench;
    use crate::kind;
    use approx::assert_abs_diff_eq;
    use nalgebra::Vector3;

    /// Two bells at one place, for a cut along x and for none.
    const BELLS: &str = r#"reach = 2
        spread = [50, 0, 100]
        at_mm = [[100, 0, 0], [100, 0, 0]]
        wrist_deg = [[0, 0, 0], [0, 0, 0]]
        force_n = [[400, 0, 0], [0, 0, 0]]
        shift_mm = [[0.1, 0, 0], [0, -0.04, 0]]"#;

    fn at(x: f64, force: f64) -> Vector3<f64> {
        let mut bench = Bench::pushed(force, 0.0, 0.0);
        bench.situation.base_from_wobj.translation.vector = Vector3::zeros();
        bench.situation.wobj_from_tcp.translation.vector = Vector3::new(x, 0.0, 0.0);
        bench.run("empirical", BELLS).1.base.shift
    }

    #[test]
    fn a_bell_is_felt_where_place_and_force_are_its_own() {
        // One reach (100 mm) away in place; the other bell is two reaches (400 N) away in force.
        let near = (-0.5f64).exp();
        assert_abs_diff_eq!(at(0.2, 400.0).x, 1e-4 * near, epsilon = 1e-12);
        assert_abs_diff_eq!(at(0.2, 400.0).y, -4e-5 * near * (-2.0f64).exp(), epsilon = 1e-12);
    }

    /// One measurement with a third of the standard deviation of the process leaves 1 − 1/(1 + 1/9) of its variance at
    /// the centre, and nearly all of it two reaches away.
    #[test]
    fn the_variance_grows_from_the_centre_outwards() {
        let one = r#"reach = 1
            spread = [50, 0, 0]
            at_mm = [[100, 0, 0]]
            wrist_deg = [[0, 0, 0]]
            force_n = [[0, 0, 0]]
            shift_mm = [[0.1, 0, 0]]
            sigma_mm = 0.03
            noise_mm = 0.01"#;
        let effect = (kind("empirical").unwrap().read)(one.parse().unwrap()).unwrap();
        let variance = |x: f64| {
            let mut bench = Bench::default();
            bench.situation.base_from_wobj.translation.vector = Vector3::zeros();
            bench.situation.wobj_from_tcp.translation.vector = Vector3::new(x, 0.0, 0.0);
            effect.unseen_shift(&bench.situation, &bench.motor)
        };
        let process = 3.0 * 0.03e-3f64.powi(2);
        assert_abs_diff_eq!(variance(0.1), process * 0.1, epsilon = 1e-18);
        assert_abs_diff_eq!(variance(0.2), process * (1.0 - 0.9 * (-4.0f64).exp()), epsilon = 1e-18);
        assert_abs_diff_eq!(variance(1.3), process, epsilon = 1e-18);
    }

    #[test]
    fn nothing_is_left_of_it_far_away() {
        assert_abs_diff_eq!(at(1.3, 0.0), Vector3::zeros());
    }
}
