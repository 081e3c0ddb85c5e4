//! Friction in the gears: lost motion that is proportional to the torque of the joint.

use super::{Deflection, Effect, Kind, Load, Need, Number, Parts, Physics, Presliding, State, checked, per_axis};
use deflex_lanes::Real;
use serde::{Deserialize, Serialize};

pub(super) const KIND: Kind = Kind {
    name: "hysteresis",
    summary: "gear friction: lost motion grows with torque",
    forms: &["fraction = [0, 0.1, 0, 0, 0, 0]", "fraction = [0, 0.1, 0, 0, 0, 0]\npresliding_rad = 1e-3"],
    bends_under_load: true,
    parts: Parts::LOST,
    needs: &[Need::Stiffness],
    read: |table| checked(table.try_into::<Hysteresis>()?),
    candidates: |survey| {
        if survey.stiffness_declared {
            vec![Box::new(Hysteresis { fraction: [0.0; 6], presliding_rad: Presliding::default() })]
        } else {
            vec![]
        }
    },
    ..Kind::PLAIN
};

/// Actual = commanded + spring − travel · fraction · |τ| / k, with the declared stiffness k.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Hysteresis {
    /// Share of the torque that friction carries, 0 to 1, for each joint.
    fraction: [f64; 6],
    /// Angles over which the friction builds up after a reversal, rad; the same in all effects of an arm.
    #[serde(default, skip_serializing_if = "Presliding::is_sharp")]
    presliding_rad: Presliding,
}

impl Physics for Hysteresis {
    #[inline(always)]
    fn deflect<R: Real>(&self, state: &State<'_, R>, load: &Load<R>, out: &mut Deflection<R>) {
        if let Some(stiffness) = state.stiffness {
            for i in 0..6 {
                out.lost[i] = out.lost[i] + load.torque[i].abs() * (self.fraction[i] / stiffness[i]);
            }
        }
    }
}

impl Effect for Hysteresis {
    fn presliding(&self) -> Option<Presliding> {
        Some(self.presliding_rad)
    }

    fn with_presliding(&self, presliding_rad: Presliding) -> Box<dyn Effect> {
        Box::new(Self { presliding_rad, ..*self })
    }

    fn numbers(&mut self) -> Vec<Number<'_>> {
        // 5 to 20 % of the drives' deflection; friction that holds all of it would not move.
        per_axis("fraction", &mut self.fraction, "1", 0.12, 0.0, (0.0, 1.0))
    }
}

#[cfg(test)]
mod tests {
    use crate::bench::Bench;
    use approx::assert_abs_diff_eq;

    #[test]
    fn a_tenth_of_the_twist_is_lost_whichever_way_it_is_loaded() {
        // 100 N at 1.293 m in front of axis 3, on 1e6 N·m/rad.
        for force in [100.0, -100.0] {
            let (_, out) = Bench::pushed(0.0, 0.0, force).run("hysteresis", "fraction = [0, 0, 0.1, 0, 0, 0]");
            assert_abs_diff_eq!(out.lost[2], 1.293e-5, epsilon = 1e-16);
        }
    }
}
