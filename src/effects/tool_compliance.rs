//! Tool, holder and spindle that yield under the cutting force.
//!
//! Only the cutting force bends them here: their own weight is the same in every cut of a posture, and is part of a TCP
//! that was measured with the tool on.

use super::{
    Distortion, Effect, Kind, Load, NOT_NEGATIVE, Need, Parameter, State, Twist, checked, indexed, scalar, table_of,
    take,
};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

pub(super) const KIND: Kind = Kind {
    name: "tool_compliance",
    summary: "tool, holder and spindle yield",
    read: |table| checked(table.try_into::<ToolCompliance>()?),
    candidates: |survey| if survey.has_force { vec![Box::new(ToolCompliance::default())] } else { vec![] },
};

/// Turn at the flange under the cut's moment there, and shift of the tip along and across the tool axis.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct ToolCompliance {
    /// About x and y of the flange.
    rad_per_nm: [f64; 2],
    /// Along the tool axis (−z of the TCP frame).
    axial_mm_per_n: f64,
    /// Across the tool axis.
    radial_mm_per_n: f64,
}

impl Effect for ToolCompliance {
    fn kind(&self) -> &'static str {
        KIND.name
    }

    fn distort(&self, state: &State, load: &Load, out: &mut Distortion) {
        let flange = state.frames.base_from_flange();
        let arm = state.base_from_tcp.translation.vector - flange.translation.vector;
        let moment = flange.rotation.inverse() * arm.cross(&load.cut);
        out.flange += Twist {
            shift: Vector3::zeros(),
            turn: Vector3::new(self.rad_per_nm[0] * moment.x, self.rad_per_nm[1] * moment.y, 0.0),
        };
        let force = state.base_from_tcp.rotation.inverse() * load.cut;
        let yields = 1e-3 * Vector3::new(self.radial_mm_per_n, self.radial_mm_per_n, self.axial_mm_per_n);
        out.tcp += Twist { shift: yields.component_mul(&force), turn: Vector3::zeros() };
    }

    fn needs(&self) -> &'static [Need] {
        &[Need::Force]
    }

    fn parameters(&self) -> Vec<Parameter> {
        // A 25 mm steel bar 100 mm long in a spindle: 5 to 40 µm under some 200 N.
        let mut all = indexed("rad_per_nm", &self.rad_per_nm, "rad/(N·m)", 1e-6, 0.0, NOT_NEGATIVE);
        all.push(scalar("axial_mm_per_n", self.axial_mm_per_n, "mm/N", 5e-5, 0.0, NOT_NEGATIVE));
        all.push(scalar("radial_mm_per_n", self.radial_mm_per_n, "mm/N", 2e-4, 0.0, NOT_NEGATIVE));
        all
    }

    fn with_values(&self, mut values: &[f64]) -> Box<dyn Effect> {
        let rad_per_nm = take(&mut values);
        let [axial_mm_per_n, radial_mm_per_n] = take(&mut values);
        Box::new(Self { rad_per_nm, axial_mm_per_n, radial_mm_per_n })
    }

    fn to_table(&self) -> toml::Table {
        table_of(KIND.name, self)
    }
}

#[cfg(test)]
mod tests {
    use crate::effects::bench::Bench;
    use approx::assert_abs_diff_eq;
    use nalgebra::Vector3;

    #[test]
    fn along_and_across_the_tool() {
        // The tool points along base x: 50 N push it in, 30 N sideways bend it, and turn the flange by 6 N·m about its
        // −x (which points up).
        let (_, out) = Bench::pushed(50.0, 30.0, 0.0).run(
            r#"kind = "tool_compliance"
            rad_per_nm = [1e-6, 1e-6]
            axial_mm_per_n = 1e-4
            radial_mm_per_n = 3e-4"#,
        );
        assert_abs_diff_eq!(out.tcp.shift, Vector3::new(0.0, 9e-6, 5e-6), epsilon = 1e-18);
        assert_abs_diff_eq!(out.flange.turn, Vector3::new(-6e-6, 0.0, 0.0), epsilon = 1e-18);
    }
}
