//! A cutting force that is wrong by a factor: another alloy, a dynamometer out of calibration.

use super::{Effect, FACTOR, Kind, Load, Need, Number, Parts, Physics, State, checked, scalar};
use deflex_lanes::Real;
use serde::{Deserialize, Serialize};

pub(super) const KIND: Kind = Kind {
    name: "force_scale",
    summary: "the cutting force is off by a factor",
    forms: &["factor = 1.2"],
    // If only the springs of the joints yield, a factor on the force and a factor on all stiffnesses are the same.
    nested_in: &[super::joint_stiffness::KIND.name],
    parts: Parts::CUT,
    needs: &[Need::Force],
    read: |table| checked(table.try_into::<ForceScale>()?),
    candidates: |survey| if survey.has_force { vec![Box::new(ForceScale { factor: 1.0 })] } else { vec![] },
    ..Kind::PLAIN
};

/// Force = factor · given force.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ForceScale {
    factor: f64,
}

impl Physics for ForceScale {
    #[inline(always)]
    fn load<R: Real>(&self, _: &State<'_, R>, load: &mut Load<R>) {
        load.cut = load.cut * R::of(self.factor);
    }
}

impl Effect for ForceScale {
    fn numbers(&mut self) -> Vec<Number<'_>> {
        // Published coefficients are wrong by 10 to 30 % for another batch of material.
        vec![scalar("factor", &mut self.factor, "1", 0.2, 1.0, FACTOR)]
    }
}

#[cfg(test)]
mod tests {
    use crate::bench::Bench;
    use approx::assert_abs_diff_eq;

    #[test]
    fn force_and_torque_grow_alike() {
        let (load, _) = Bench::pushed(0.0, 100.0, 0.0).run("force_scale", "factor = 1.2");
        assert_abs_diff_eq!(load.cut.y, 120.0, epsilon = 1e-12);
        assert_abs_diff_eq!(load.torque[0], 191.16, epsilon = 1e-12);
    }
}
