//! Weight of links, tool and payload.

use super::{
    ANY, Covered, Deflection, Effect, Kind, Load, NOT_NEGATIVE, Number, Parts, Physics, State, Survey, checked,
    indexed, per_axis,
};
use deflex_lanes::{Real, Vector};
use deflex_robot::Joints;
use serde::{Deserialize, Serialize};

pub(super) const KIND: Kind = Kind {
    name: "gravity",
    summary: "weight of links, tool and payload bends the arm",
    forms: &["tool = true", "compliance_rad_per_nm = [0, 0, 0, 0, 0, 0]"],
    parts: Parts::WEIGHTS,
    covered_by: Some(Covered::Gravity),
    weighs_payload: true,
    read: |table| checked(table.try_into::<Gravity>()?),
    candidates,
    ..Kind::PLAIN
};

/// Typical masses of the links of an arm with a payload of about 100 kg, kg, and their first moments, kg·m. Link 6 is an undeclared load
/// on the flange of a few kilograms.
const TYPICAL_MASS: [f64; 6] = [100.0, 100.0, 60.0, 20.0, 10.0, 10.0];
const TYPICAL_MOMENT: [f64; 6] = [30.0, 30.0, 20.0, 5.0, 2.0, 2.0];

/// Typical compliance of a joint of such an arm, rad/(N·m), from which a fit without a declared stiffness starts.
const TYPICAL_COMPLIANCE: f64 = 3e-6;

fn candidates(survey: &Survey) -> Vec<Box<dyn Effect>> {
    let compliance_rad_per_nm = (!survey.stiffness_declared).then_some([TYPICAL_COMPLIANCE; 6]);
    vec![Box::new(Gravity { compliance_rad_per_nm, ..Gravity::default() })]
}

/// Weights as base parameters: mass and first moment of each link in its modified-DH frame.
///
/// Many sets of these numbers give the same joint torques; an identified set is one of them.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Gravity {
    /// Mass of each link, kg.
    mass_kg: [f64; 6],
    /// Mass times centre of gravity of each link, in the link's frame, kg·m.
    first_moment_kg_m: [[f64; 3]; 6],
    /// Whether the declared mass of the tool acts too.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    tool: bool,
    /// Compliance of each joint under weights, rad/(N·m), for cells without a declared stiffness.
    #[serde(skip_serializing_if = "Option::is_none")]
    compliance_rad_per_nm: Option<[f64; 6]>,
}

impl Physics for Gravity {
    #[inline(always)]
    fn load<R: Real>(&self, state: &State<'_, R>, load: &mut Load<R>) {
        let g = state.site.gravity;
        for i in 0..6 {
            let link = &state.chain.links[i];
            let mass = R::of(self.mass_kg[i]);
            // m·(o + R c) × g = (m o + R (m c)) × g: only the first moment is needed.
            let lever = link.origin * mass + link.turn(Vector::of(&self.first_moment_kg_m[i].into()));
            load.links[i].force = load.links[i].force + g * mass;
            load.links[i].moment = load.links[i].moment + lever.cross(g);
        }
        let site = state.site;
        let held = if self.tool { site.payload + site.tool_mass } else { site.payload };
        load.links[5].add_force(g * held, state.chain.links[5].point(site.tool_cog));
    }

    #[inline(always)]
    fn deflect<R: Real>(&self, state: &State<'_, R>, load: &Load<R>, out: &mut Deflection<R>) {
        if let (None, Some(compliance)) = (state.stiffness, self.compliance_rad_per_nm) {
            for i in 0..6 {
                out.joints[i] = out.joints[i] + load.torque[i] * compliance[i];
            }
        }
    }

    fn compliance(&self, stiffness: Option<&Joints>) -> [f64; 6] {
        self.compliance_rad_per_nm.filter(|_| stiffness.is_none()).unwrap_or_default()
    }
}

impl Effect for Gravity {
    fn numbers(&mut self) -> Vec<Number<'_>> {
        let mut all = per_axis("mass_kg", &mut self.mass_kg, "kg", 1.0, 0.0, ANY);
        all.iter_mut().zip(TYPICAL_MASS).for_each(|(mass, typical)| mass.parameter.typical = typical);
        for (i, (moment, typical)) in self.first_moment_kg_m.iter_mut().zip(TYPICAL_MOMENT).enumerate() {
            all.extend(indexed(&format!("first_moment_kg_m[{i}]"), moment, "kg·m", typical, 0.0, ANY));
        }
        if let Some(compliance) = &mut self.compliance_rad_per_nm {
            let key = "compliance_rad_per_nm";
            all.extend(per_axis(key, compliance, "rad/(N·m)", TYPICAL_COMPLIANCE, 0.0, NOT_NEGATIVE));
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use crate::bench::Bench;
    use approx::assert_abs_diff_eq;
    use nalgebra::Vector3;

    #[test]
    fn a_flange_weight_lowers_the_forearm() {
        // 10 kg at 10 m/s² on the flange, 1.093 m in front of axis 3, on 1e6 N·m/rad; the upper arm stands upright.
        let (load, out) = Bench::default().run("gravity", "mass_kg = [0, 0, 0, 0, 0, 10]");
        assert_abs_diff_eq!(load.torque[2], 109.3, epsilon = 1e-12);
        assert_abs_diff_eq!(load.torque[1], 0.0, epsilon = 1e-12);
        // The declared springs turn it into motion, not the weight itself.
        assert_abs_diff_eq!(out.joints[2], 0.0);
    }

    #[test]
    fn tool_and_payload_hang_on_the_tool() {
        let mut bench = Bench::default();
        bench.situation.tool.mass = 7.0;
        bench.situation.payload = 3.0;
        bench.situation.tool.cog = Vector3::new(0.0, 0.0, 0.1);
        let (load, _) = bench.run("gravity", "tool = true");
        assert_abs_diff_eq!(load.torque[2], 100.0 * 1.193, epsilon = 1e-12);
    }
}
