//! Gears whose torque-deflection curve is not a straight line: soft while the teeth take up load, or hardening.
//!
//! The two flanks of a gear's teeth are not equally stiff: the joint then yields more under a torque of one sign than under the other.
//!
//! The declared spring stays in the cell; this effect adds the difference between the curve and that straight line.

use super::{
    Deflection, Effect, FACTOR, Kind, Load, NOT_NEGATIVE, Need, Number, Physics, State, Survey, checked, per_axis,
};
use deflex_lanes::{Mask, Real};
use serde::{Deserialize, Serialize};

pub(super) const KIND: Kind = Kind {
    name: "stiffness_curve",
    summary: "the joints' torque-deflection curve is not a straight line",
    forms: &[
        "form = 'two_slope'\nwidth_rad = [0, 1e-4, 1e-4, 0, 0, 0]\nratio = [1, 1, 1, 1, 1, 1]\nasymmetry = [0, 0.1, 0, 0, 0, 0]",
        "form = 'cubic'\nc_per_rad2 = [0, 0, 0, 0, 0, 0]",
    ],
    part: super::Part::JointSpring,
    bends_under_load: true,
    multiplies: true,
    needs: &[Need::Stiffness],
    read: |table| checked(table.try_into::<StiffnessCurve>()?),
    candidates,
    ..Kind::PLAIN
};

/// Typical deflection within which a gear is soft, rad; the prior mean.
const TYPICAL_WIDTH: f64 = 2e-4;

/// Widths from which a fit starts, rad. It needs several, because small steps do not find where the two slopes meet.
const STARTS: [f64; 3] = [0.5 * TYPICAL_WIDTH, TYPICAL_WIDTH, 2.0 * TYPICAL_WIDTH];

/// Steps of Newton's method. It converges monotonically, and quadratically near the root; a spring that hardens 1e6 times takes 40.
const STEPS: usize = 60;

/// Curve of every joint.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(tag = "form", rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum StiffnessCurve {
    /// `ratio` times the declared slope up to a deflection of `width_rad` on either side, the declared slope beyond. `asymmetry` is the share of
    /// the declared compliance by which the joint yields more under a positive torque, and less under a negative one.
    TwoSlope {
        width_rad: [f64; 6],
        ratio: [f64; 6],
        #[serde(default)]
        asymmetry: [f64; 6],
    },
    /// τ = k (δ + c δ³): hardening.
    Cubic { c_per_rad2: [f64; 6] },
}

use StiffnessCurve::{Cubic, TwoSlope};

fn candidates(survey: &Survey) -> Vec<Box<dyn Effect>> {
    if !survey.stiffness_declared {
        return vec![];
    }
    let two_slope = |width: f64| -> Box<dyn Effect> {
        Box::new(TwoSlope { width_rad: [width; 6], ratio: [1.0; 6], asymmetry: [0.0; 6] })
    };
    let mut all: Vec<Box<dyn Effect>> = STARTS.map(two_slope).into();
    all.push(Box::new(Cubic { c_per_rad2: [0.0; 6] }));
    all
}

/// Additional deflection of a two-slope spring compared with a straight one, rad. `straight` is torque / declared stiffness.
#[inline(always)]
fn two_slope_excess<R: Real>(straight: R, width: f64, ratio: f64) -> R {
    let (size, soft) = (straight.abs(), R::of(ratio * width));
    let inside = soft.lt(size).select(soft, size);
    straight.lt(0.0).negate(inside * (1.0 / ratio) - inside)
}

/// Additional deflection δ − `straight` of a cubic spring, rad, with δ + c δ³ = `straight`. NaN where a softening spring (c < 0) cannot carry
/// the torque.
#[inline(always)]
fn cubic_excess<R: Real>(straight: R, c: f64) -> R {
    let mut excess = R::ZERO;
    if c == 0.0 {
        return excess;
    }
    // Started at `straight`, Newton's method approaches the root from one side only, for either sign of c.
    let mut done = R::Mask::default();
    for _ in 0..STEPS {
        let delta = straight + excess;
        let slope = delta * delta * (3.0 * c) + 1.0;
        let step = (excess + delta * delta * delta * c) / slope;
        let next = R::ZERO.lt(slope).select(excess - step, R::of(f64::NAN));
        excess = done.select(excess, next);
        // A lane with NaN has finished too.
        done = done.or((straight.abs() * 1e-15).lt(step.abs()).not()).or(R::ZERO.lt(slope).not());
        if !done.not().any() {
            break;
        }
    }
    excess
}

impl Physics for StiffnessCurve {
    #[inline(always)]
    fn deflect<R: Real>(&self, state: &State<'_, R>, load: &Load<R>, out: &mut Deflection<R>) {
        let Some(stiffness) = state.stiffness else { return };
        for i in 0..6 {
            let straight = load.torque[i] * (1.0 / stiffness[i]);
            let excess = match self {
                TwoSlope { width_rad, ratio, asymmetry } => {
                    two_slope_excess(straight, width_rad[i], ratio[i]) + straight.abs() * asymmetry[i]
                }
                Cubic { c_per_rad2 } => cubic_excess(straight, c_per_rad2[i]),
            };
            out.joints[i] = out.joints[i] + excess;
        }
    }
}

impl Effect for StiffnessCurve {
    fn numbers(&mut self) -> Vec<Number<'_>> {
        match self {
            // Gears are about twice as soft below some 3 % of their rated torque. That the flanks of their teeth differ by a tenth is an
            // assumption, for which we have no source.
            TwoSlope { width_rad, ratio, asymmetry } => {
                let mut all = per_axis("width_rad", width_rad, "rad", 1e-4, TYPICAL_WIDTH, NOT_NEGATIVE);
                all.extend(per_axis("ratio", ratio, "1", 0.4, 1.0, FACTOR));
                all.extend(per_axis("asymmetry", asymmetry, "1", 0.1, 0.0, (-0.9, 0.9)));
                all
            }
            // A quarter stiffer at a deflection of 4e-4 rad. Negative values are excluded: a softening cubic has a largest torque.
            Cubic { c_per_rad2 } => per_axis("c_per_rad2", c_per_rad2, "1/rad²", 1.5e6, 0.0, NOT_NEGATIVE),
        }
    }

    /// Beyond the kink only `width · (1 − ratio)` has an effect: the same spring with other widths and this product, joint by joint.
    fn lookalikes(&self) -> Vec<Box<dyn Effect>> {
        const FACTORS: [f64; 6] = [0.4, 0.6, 0.8, 1.25, 1.7, 2.5];
        let TwoSlope { width_rad, ratio, asymmetry } = self else { return Vec::new() };
        let other = |(i, factor): (usize, f64)| -> Option<Box<dyn Effect>> {
            let (mut width_rad, mut ratio) = (*width_rad, *ratio);
            width_rad[i] *= factor;
            ratio[i] = 1.0 - (1.0 - ratio[i]) / factor;
            let possible = width_rad[i] > 0.0 && ratio[i] >= FACTOR.0;
            possible.then(|| -> Box<dyn Effect> { Box::new(TwoSlope { width_rad, ratio, asymmetry: *asymmetry }) })
        };
        (0..6).flat_map(|i| FACTORS.map(|factor| (i, factor))).filter_map(other).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::Bench;
    use approx::{assert_abs_diff_eq, assert_relative_eq};

    #[test]
    fn two_slopes_meet_at_the_width() {
        // Half as stiff up to 1e-4 rad: 0.4e-4 gives 0.8e-4; 2e-4 gives 1e-4 + (2e-4 − 0.5e-4).
        assert_relative_eq!(two_slope_excess(0.4e-4_f64, 1e-4, 0.5), 0.4e-4, max_relative = 1e-14);
        assert_relative_eq!(two_slope_excess(2e-4, 1e-4, 0.5), 0.5e-4, max_relative = 1e-14);
        assert_relative_eq!(two_slope_excess(-2e-4, 1e-4, 0.5), -0.5e-4, max_relative = 1e-14);
    }

    #[test]
    fn a_spring_can_be_softer_one_way() {
        // 100 N sideways at 1.593 m on 1e6 N·m/rad: 1.593e-4 rad, of which a tenth is added one way and taken off the other way.
        let softer = "form = 'two_slope'\nwidth_rad = [0, 0, 0, 0, 0, 0]\nratio = [1, 1, 1, 1, 1, 1]\n\
                      asymmetry = [0.1, 0, 0, 0, 0, 0]";
        for force in [100.0, -100.0] {
            let (_, out) = Bench::pushed(0.0, force, 0.0).run("stiffness_curve", softer);
            assert_abs_diff_eq!(out.joints[0], 0.1 * 1.593e-4, epsilon = 1e-15);
        }
    }

    #[test]
    fn the_cubic_is_solved_exactly() {
        // δ = 1e-3, c = 1e6: straight = 1e-3 + 1e-3.
        assert_relative_eq!(cubic_excess(2e-3_f64, 1e6), -1e-3, max_relative = 1e-14);
        assert_relative_eq!(cubic_excess(-2e-3, 1e6), 1e-3, max_relative = 1e-14);
        // Softening: δ = 5e-4, c = −1e6: straight = 5e-4 − 1.25e-4; beyond 2/3 of 1/√3 it gives way.
        assert_relative_eq!(cubic_excess(3.75e-4, -1e6), 1.25e-4, max_relative = 1e-13);
        assert!(cubic_excess(4e-4, -1e6).is_nan());
    }
}
