//! Tool, holder and spindle that yield under the cutting force.
//!
//! Only the cutting force bends them here. Their own weight bends them equally in every cut of a posture, and is contained in a TCP that
//! was measured with the tool mounted.

use super::{
    Deflection, Effect, Kind, Load, NOT_NEGATIVE, Need, Number, Parts, Physics, State, checked, indexed, scalar,
};
use deflex_lanes::Real;
use serde::{Deserialize, Serialize};

pub(super) const KIND: Kind = Kind {
    name: "tool_compliance",
    summary: "tool, holder and spindle yield",
    forms: &["radial_mm_per_n = 1e-4"],
    bends_under_load: true,
    parts: Parts::FLANGE.and(Parts::TIP),
    needs: &[Need::Force],
    read: |table| checked(table.try_into::<ToolCompliance>()?),
    candidates: |survey| if survey.has_force { vec![Box::new(ToolCompliance::default())] } else { vec![] },
    ..Kind::PLAIN
};

/// The flange turns under the moment of the cutting force, and the tip shifts along and across the tool axis.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct ToolCompliance {
    /// Turn about x and y of the flange for each N·m, rad.
    rad_per_nm: [f64; 2],
    /// Shift along the tool axis (−z of the TCP frame) for each newton, mm.
    axial_mm_per_n: f64,
    /// Shift across the tool axis for each newton, mm.
    radial_mm_per_n: f64,
}

impl Physics for ToolCompliance {
    #[inline(always)]
    fn deflect<R: Real>(&self, state: &State<'_, R>, load: &Load<R>, out: &mut Deflection<R>) {
        let flange = &state.chain.links[5];
        let moment = (state.base_from_tcp.origin - flange.origin).cross(load.cut);
        out.flange.x = out.flange.x + flange.x.dot(moment) * self.rad_per_nm[0];
        out.flange.y = out.flange.y + flange.y.dot(moment) * self.rad_per_nm[1];
        let (axial, radial) = (1e-3 * self.axial_mm_per_n, 1e-3 * self.radial_mm_per_n);
        out.tip = out.tip + state.base_from_tcp.turn_back(load.cut).scaled([radial, radial, axial]);
    }
}

impl Effect for ToolCompliance {
    fn numbers(&mut self) -> Vec<Number<'_>> {
        // A 25 mm steel bar 100 mm long in a spindle: 5 to 40 µm under some 200 N.
        let mut all = indexed("rad_per_nm", &mut self.rad_per_nm, "rad/(N·m)", 1e-6, 0.0, NOT_NEGATIVE);
        all.push(scalar("axial_mm_per_n", &mut self.axial_mm_per_n, "mm/N", 5e-5, 0.0, NOT_NEGATIVE));
        all.push(scalar("radial_mm_per_n", &mut self.radial_mm_per_n, "mm/N", 2e-4, 0.0, NOT_NEGATIVE));
        all
    }
}

#[cfg(test)]
mod tests {
    use crate::bench::Bench;
    use approx::assert_abs_diff_eq;
    use nalgebra::Vector3;

    #[test]
    fn along_and_across_the_tool() {
        // The tool points along base x: 50 N push it in, 30 N sideways bend it, and turn the flange by 6 N·m about its
        // −x (which points up).
        let (_, out) = Bench::pushed(50.0, 30.0, 0.0)
            .run("tool_compliance", "rad_per_nm = [1e-6, 1e-6]\naxial_mm_per_n = 1e-4\nradial_mm_per_n = 3e-4");
        assert_abs_diff_eq!(out.tcp.shift, Vector3::new(0.0, 9e-6, 5e-6), epsilon = 1e-18);
        assert_abs_diff_eq!(out.flange.turn, Vector3::new(-6e-6, 0.0, 0.0), epsilon = 1e-18);
    }
}
