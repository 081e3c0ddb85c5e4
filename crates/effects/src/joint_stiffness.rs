//! Elastic joints: gearboxes twist under the torque that they carry (Tang et al., Eq. 3).
//!
//! On an arm with a parallelogram, motor 3 moves the forearm through a crank and a rod, which stretches too. The lever of the rod about the
//! crank's axis shrinks with the cosine of the angle q3 − q2 of the motors, and is longest where they are equal. The same torque then stretches the
//! rod by 1/cos, and this turns the crank by another 1/cos.

use super::{
    Deflection, Effect, FACTOR, Kind, Load, NOT_NEGATIVE, Need, Number, Physics, State, checked, per_axis, scalar,
};
use deflex_lanes::Real;
use deflex_robot::{Axes, Joints};
use serde::{Deserialize, Serialize};

pub(super) const KIND: Kind = Kind {
    name: "joint_stiffness",
    summary: "declared joint stiffness is off by a factor",
    forms: &["scale = [1, 1, 1, 1, 1, 1]", "scale = [1, 1, 1, 1, 1, 1]\nrod_share = 0.2"],
    part: super::Part::JointSpring,
    bends_under_load: true,
    implied_by_stiffness: true,
    read: |table| checked(table.try_into::<JointStiffness>()?),
    candidates: |survey| if survey.stiffness_declared { vec![super::declared_springs(&survey.axes)] } else { vec![] },
    ..Kind::PLAIN
};

/// Joint springs of `scale` times the declared stiffness, in motor coordinates.
///
/// A cell with `[robot.stiffness]` and no such effect has one with all factors 1.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct JointStiffness {
    scale: [f64; 6],
    /// The rod's share of the declared compliance of joint 3 where q3 = q2; `None` without a parallelogram.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    rod_share: Option<f64>,
}

impl JointStiffness {
    /// Springs as declared.
    #[must_use]
    pub(super) fn declared(axes: &Axes) -> Self {
        Self { scale: [1.0; 6], rod_share: axes.parallelogram.then_some(0.0) }
    }
}

impl Physics for JointStiffness {
    #[inline(always)]
    fn deflect<R: Real>(&self, state: &State<'_, R>, load: &Load<R>, out: &mut Deflection<R>) {
        if let Some(stiffness) = state.stiffness {
            for i in 0..6 {
                out.joints[i] = out.joints[i] + load.torque[i] * (1.0 / (stiffness[i] * self.scale[i]));
            }
            if let Some(share) = self.rod_share.filter(|share| *share > 0.0) {
                let skew = state.site.commanded[2] - state.site.commanded[1];
                // 1/cos² − 1 = tan²; what the rod yields where q3 = q2 is part of the declared spring.
                let softer = skew.each(|skew| skew.tan().powi(2));
                out.joints[2] = out.joints[2] + load.torque[2] * softer * (share / stiffness[2]);
            }
        }
    }

    fn compliance(&self, stiffness: Option<&Joints>) -> [f64; 6] {
        stiffness.map_or([0.0; 6], |k| std::array::from_fn(|i| 1.0 / (k[i] * self.scale[i])))
    }
}

impl Effect for JointStiffness {
    fn needs(&self) -> &'static [Need] {
        match self.rod_share {
            Some(_) => &[Need::Stiffness, Need::Parallelogram("rod_share")],
            None => &[Need::Stiffness],
        }
    }

    fn numbers(&mut self) -> Vec<Number<'_>> {
        // Declared values of real robots are wrong by 20 to 50 %. A factor of 0 would be no spring.
        let mut all = per_axis("scale", &mut self.scale, "1", 0.3, 1.0, FACTOR);
        // A rod is stiffer than a gear: it has a quarter of the compliance, more or less.
        all.extend(self.rod_share.as_mut().map(|share| scalar("rod_share", share, "1", 0.25, 0.0, NOT_NEGATIVE)));
        all
    }
}

#[cfg(test)]
mod tests {
    use crate::bench::Bench;
    use approx::assert_abs_diff_eq;

    #[test]
    fn a_lever_of_the_reach_twists_the_first_axis() {
        // 100 N sideways at 1.593 m: 159.3 N·m, on a spring of half of 1e6 N·m/rad.
        let (_, out) = Bench::pushed(0.0, 100.0, 0.0).run("joint_stiffness", "scale = [0.5, 1, 1, 1, 1, 1]");
        assert_abs_diff_eq!(out.joints[0], 3.186e-4, epsilon = 1e-15);
    }

    #[test]
    fn a_skew_rod_yields_more() {
        // 100 N upwards act 1.293 m in front of axis 3: −129.3 N·m on 1e6 N·m/rad. At a skew of 45°, 1/cos² is 2.
        let mut bench = Bench::pushed(0.0, 0.0, 100.0);
        bench.motor[2] = std::f64::consts::FRAC_PI_4;
        let stiff = |share: f64| format!("scale = [1, 1, 1, 1, 1, 1]\nrod_share = {share}");
        let (_, without) = bench.run("joint_stiffness", &stiff(0.0));
        let (_, with) = bench.run("joint_stiffness", &stiff(0.2));
        assert_abs_diff_eq!(with.joints[2], 1.2 * without.joints[2], epsilon = 1e-15);
        assert!(without.joints[2].abs() > 1e-5);
    }
}
