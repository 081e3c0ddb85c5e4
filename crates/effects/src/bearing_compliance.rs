//! Links and bearings that yield about axes perpendicular to the joint axis, in addition to the springs of the gears.

use super::{Deflection, Effect, Kind, Load, NOT_NEGATIVE, Number, Parts, Physics, State, checked, indexed};
use deflex_lanes::Real;
use serde::{Deserialize, Serialize};

pub(super) const KIND: Kind = Kind {
    name: "bearing_compliance",
    summary: "links and bearings yield across the joint axes",
    forms: &["rad_per_nm = [[0, 0], [0, 0], [0, 0], [0, 0], [0, 0], [0, 0]]"],
    bends_under_load: true,
    parts: Parts::TILT,
    read: |table| checked(table.try_into::<BearingCompliance>()?),
    candidates: |survey| {
        if survey.is_loaded() { vec![Box::new(BearingCompliance { rad_per_nm: [[0.0; 2]; 6] })] } else { vec![] }
    },
    ..Kind::PLAIN
};

/// Each link turns about x and y of its own frame under the moment of all loads that act on it and on the links after it.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct BearingCompliance {
    rad_per_nm: [[f64; 2]; 6],
}

impl Physics for BearingCompliance {
    #[inline(always)]
    fn deflect<R: Real>(&self, state: &State<'_, R>, load: &Load<R>, out: &mut Deflection<R>) {
        for i in 0..6 {
            let link = &state.chain.links[i];
            let moment = load.moment_about(i, state.chain, state.base_from_tcp.origin);
            let [about_x, about_y] = self.rad_per_nm[i];
            out.tilt[i][0] = out.tilt[i][0] + link.x.dot(moment) * about_x;
            out.tilt[i][1] = out.tilt[i][1] + link.y.dot(moment) * about_y;
        }
    }
}

impl Effect for BearingCompliance {
    fn numbers(&mut self) -> Vec<Number<'_>> {
        // Typical bearings have 1e6 to 5e7 N·m/rad, about five times the stiffness of the gears.
        let pairs = self.rad_per_nm.iter_mut().enumerate();
        pairs
            .flat_map(|(i, pair)| indexed(&format!("rad_per_nm[{i}]"), pair, "rad/(N·m)", 6e-7, 0.0, NOT_NEGATIVE))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use crate::bench::Bench;
    use approx::assert_abs_diff_eq;

    #[test]
    fn each_link_feels_its_own_lever() {
        // 100 N down: 159.3 N·m about y of link 1, 20 N·m about y of link 6 (0.2 m of tool).
        let (_, out) = Bench::pushed(0.0, 0.0, -100.0)
            .run("bearing_compliance", "rad_per_nm = [[1e-6, 1e-6], [0, 0], [0, 0], [0, 0], [0, 0], [1e-6, 1e-6]]");
        assert_abs_diff_eq!(out.tilt[0][1], 1.593e-4, epsilon = 1e-16);
        assert_abs_diff_eq!(out.tilt[5][1], 2e-5, epsilon = 1e-16);
        assert_abs_diff_eq!(out.tilt[5][0], 0.0, epsilon = 1e-16);
    }
}
