//! Elastic joints: gearboxes twist under the torque that they carry (Tang et al., Eq. 3).

use super::{Deflection, Effect, FACTOR, Kind, Load, Need, Parameter, Physics, State, checked, per_axis, take};
use crate::lanes::Real;
use crate::robot::Joints;
use serde::{Deserialize, Serialize};

pub(super) const KIND: Kind = Kind {
    name: "joint_stiffness",
    summary: "declared joint stiffness is off by a factor",
    forms: &["scale = [1, 1, 1, 1, 1, 1]"],
    part: super::Part::JointSpring,
    bends_under_load: true,
    implied_by_stiffness: true,
    read: |table| checked(table.try_into::<JointStiffness>()?),
    candidates: |survey| if survey.stiffness_declared { vec![super::declared_springs()] } else { vec![] },
    ..Kind::PLAIN
};

/// Joint springs of `scale` times the declared stiffness, in motor coordinates.
///
/// A cell with `[robot.stiffness]` and no such effect has one with all factors 1.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct JointStiffness {
    scale: [f64; 6],
}

impl JointStiffness {
    /// Springs as declared.
    #[must_use]
    pub(super) fn declared() -> Self {
        Self { scale: [1.0; 6] }
    }
}

impl Physics for JointStiffness {
    #[inline(always)]
    fn deflect<R: Real>(&self, state: &State<'_, R>, load: &Load<R>, out: &mut Deflection<R>) {
        if let Some(stiffness) = state.stiffness {
            for i in 0..6 {
                out.joints[i] = out.joints[i] + load.torque[i] * (1.0 / (stiffness[i] * self.scale[i]));
            }
        }
    }

    fn compliance(&self, stiffness: Option<&Joints>) -> [f64; 6] {
        stiffness.map_or([0.0; 6], |k| std::array::from_fn(|i| 1.0 / (k[i] * self.scale[i])))
    }
}

impl Effect for JointStiffness {
    fn needs(&self) -> &'static [Need] {
        &[Need::Stiffness]
    }

    fn parameters(&self) -> Vec<Parameter> {
        // Declared values of real robots are wrong by 20 to 50 %. A factor of 0 would be no spring.
        per_axis("scale", &self.scale, "1", 0.3, 1.0, FACTOR)
    }

    fn with_values(&self, mut values: &[f64]) -> Box<dyn Effect> {
        Box::new(Self { scale: take(&mut values) })
    }
}

#[cfg(test)]
mod tests {
    use crate::effects::bench::Bench;
    use approx::assert_abs_diff_eq;

    #[test]
    fn a_lever_of_the_reach_twists_the_first_axis() {
        // 100 N sideways at 1.593 m: 159.3 N·m, on a spring of half of 1e6 N·m/rad.
        let scale = r#"kind = "joint_stiffness"
            scale = [0.5, 1, 1, 1, 1, 1]"#;
        let (_, out) = Bench::pushed(0.0, 100.0, 0.0).run(scale);
        assert_abs_diff_eq!(out.joints[0], 3.186e-4, epsilon = 1e-15);
    }
}
