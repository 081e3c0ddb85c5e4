//! A pedestal or foundation that yields under all loads on the arm.

use super::{Deflection, Effect, Kind, Load, NOT_NEGATIVE, Number, Parts, Physics, State, checked, per_direction};
use deflex_lanes::Real;
use serde::{Deserialize, Serialize};

pub(super) const KIND: Kind = Kind {
    name: "base_compliance",
    summary: "the pedestal or foundation yields",
    forms: &["mm_per_n = [1e-5, 0, 0]"],
    bends_under_load: true,
    parts: Parts::BASE,
    read: |table| checked(table.try_into::<BaseCompliance>()?),
    candidates: |survey| if survey.is_loaded() { vec![Box::new(BaseCompliance::default())] } else { vec![] },
    ..Kind::PLAIN
};

/// Motion of the base along and about its axes, at its origin.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct BaseCompliance {
    mm_per_n: [f64; 3],
    rad_per_nm: [f64; 3],
}

impl Physics for BaseCompliance {
    #[inline(always)]
    fn deflect<R: Real>(&self, state: &State<'_, R>, load: &Load<R>, out: &mut Deflection<R>) {
        let all = load.all(state.base_from_tcp.origin);
        out.base.shift = out.base.shift + all.force.scaled(self.mm_per_n.map(|compliance| 1e-3 * compliance));
        out.base.turn = out.base.turn + all.moment.scaled(self.rad_per_nm);
    }
}

impl Effect for BaseCompliance {
    fn numbers(&mut self) -> Vec<Number<'_>> {
        // Foundations measure 1e6 to 5e7 N·m/rad; a pedestal on a plate is softer than a cast floor.
        let mut all = per_direction("mm_per_n", &mut self.mm_per_n, "mm/N", 4e-5, 0.0, NOT_NEGATIVE);
        all.extend(per_direction("rad_per_nm", &mut self.rad_per_nm, "rad/(N·m)", 1e-6, 0.0, NOT_NEGATIVE));
        all
    }
}

#[cfg(test)]
mod tests {
    use crate::bench::Bench;
    use approx::assert_abs_diff_eq;
    use nalgebra::Vector3;

    #[test]
    fn it_sinks_and_nods_under_a_push_down() {
        // 100 N down, 1.593 m in front: it sinks by 100 · 2e-5 mm and nods forward by 159.3 · 1e-6 rad.
        let (_, out) = Bench::pushed(0.0, 0.0, -100.0)
            .run("base_compliance", "mm_per_n = [0, 0, 2e-5]\nrad_per_nm = [0, 1e-6, 0]");
        assert_abs_diff_eq!(out.base.shift, Vector3::new(0.0, 0.0, -2e-6), epsilon = 1e-18);
        assert_abs_diff_eq!(out.base.turn, Vector3::new(0.0, 1.593e-4, 0.0), epsilon = 1e-16);
    }
}
