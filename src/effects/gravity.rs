//! Weight of links, tool and payload.

use super::{Covered, Distortion, Effect, Kind, Load, Parameter, State, per_joint, table_of};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

pub(super) const KIND: Kind = Kind {
    name: "gravity",
    summary: "weight of links, tool and payload bends the arm",
    read: |table| Ok(Box::new(table.try_into::<Gravity>()?)),
};

/// Weights as base parameters: mass and first moment of each link in its modified-DH frame.
///
/// Many sets give the same joint torques: an identified set is one of them.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Gravity {
    /// Mass of each link, kg.
    mass_kg: [f64; 6],
    /// Mass times centre of gravity of each link, in the link's frame, kg·m.
    first_moment_kg_m: [[f64; 3]; 6],
    /// Adds the mass that tooldata declares.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    tool: bool,
    /// Joint compliance times weight where no stiffness is declared, rad/(N·m).
    #[serde(skip_serializing_if = "Option::is_none")]
    compliance_rad_per_nm: Option<[f64; 6]>,
}

impl Effect for Gravity {
    fn kind(&self) -> &'static str {
        KIND.name
    }

    fn load(&self, state: &State, load: &mut Load) {
        let g = state.gravity;
        for i in 0..6 {
            let link = &state.frames.base_from_link[i];
            // m·(o + R c) × g = (m o + R (m c)) × g: only the first moment is needed.
            let moment = link.rotation * Vector3::from(self.first_moment_kg_m[i]);
            let lever = self.mass_kg[i] * link.translation.vector + moment;
            load.links[i].force += self.mass_kg[i] * g;
            load.links[i].moment += lever.cross(&g);
        }
        let mut held = state.situation.payload;
        let tool = &state.situation.tool;
        if self.tool {
            held += tool.mass;
        }
        if held > 0.0 {
            let point = state.frames.base_from_flange() * nalgebra::Point3::from(tool.cog);
            load.links[5].add_force(&(held * g), &point.coords);
        }
    }

    fn distort(&self, state: &State, load: &Load, out: &mut Distortion) {
        if let (None, Some(compliance)) = (state.stiffness, self.compliance_rad_per_nm) {
            for i in 0..6 {
                out.joints[i] += compliance[i] * load.torque[i];
            }
        }
    }

    fn covered_by(&self) -> Option<Covered> {
        Some(Covered::Gravity)
    }

    fn parameters(&self) -> Vec<Parameter> {
        const ANY: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);
        let mut all = per_joint("mass_kg", &self.mass_kg, "kg", 100.0, 0.0, ANY);
        for (i, moment) in self.first_moment_kg_m.iter().enumerate() {
            for (axis, &value) in moment.iter().enumerate() {
                let name = format!("first_moment_kg_m[{i}][{axis}]");
                all.push(Parameter { name, value, unit: "kg·m", typical: 30.0, neutral: 0.0, bounds: ANY });
            }
        }
        if let Some(compliance) = &self.compliance_rad_per_nm {
            all.extend(per_joint("compliance_rad_per_nm", compliance, "rad/(N·m)", 3e-6, 0.0, (0.0, f64::INFINITY)));
        }
        all
    }

    fn with_values(&self, values: &[f64]) -> Box<dyn Effect> {
        Box::new(Self {
            mass_kg: std::array::from_fn(|i| values[i]),
            first_moment_kg_m: std::array::from_fn(|i| std::array::from_fn(|k| values[6 + 3 * i + k])),
            tool: self.tool,
            compliance_rad_per_nm: self.compliance_rad_per_nm.map(|_| std::array::from_fn(|i| values[24 + i])),
        })
    }

    fn to_table(&self) -> toml::Table {
        table_of(KIND.name, self)
    }
}
