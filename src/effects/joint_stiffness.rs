//! Elastic joints: gearboxes twist under the torque that they carry (Tang et al., Eq. 3).

use super::{Distortion, Effect, FACTOR, Kind, Load, Need, Parameter, Simple, State, checked, indexed, table_of, take};
use crate::robot::Joints;
use serde::{Deserialize, Serialize};

pub(super) const KIND: Kind = Kind {
    name: "joint_stiffness",
    summary: "declared joint stiffness is off by a factor",
    read: |table| checked(table.try_into::<JointStiffness>()?),
    candidates: |survey| if survey.stiffness_declared { vec![super::declared_springs()] } else { vec![] },
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

impl Effect for JointStiffness {
    fn kind(&self) -> &'static str {
        KIND.name
    }

    fn distort(&self, state: &State, load: &Load, out: &mut Distortion) {
        if let Some(stiffness) = state.stiffness {
            for i in 0..6 {
                out.joints[i] += load.torque[i] / (stiffness[i] * self.scale[i]);
            }
        }
    }

    fn simple(&self, stiffness: Option<&Joints>) -> Option<Simple> {
        let compliance = |k: &Joints| Joints::from_fn(|i, _| 1.0 / (k[i] * self.scale[i]));
        Some(Simple::Springs { compliance: stiffness.map_or_else(Joints::zeros, compliance) })
    }

    fn needs(&self) -> &'static [Need] {
        &[Need::Stiffness]
    }

    fn parameters(&self) -> Vec<Parameter> {
        // Declared values are off by 20 to 50 % on real robots; a spring that gives nothing back is none.
        indexed("scale", &self.scale, "1", 0.3, 1.0, FACTOR)
    }

    fn with_values(&self, mut values: &[f64]) -> Box<dyn Effect> {
        Box::new(Self { scale: take(&mut values) })
    }

    fn to_table(&self) -> toml::Table {
        table_of(KIND.name, self)
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
