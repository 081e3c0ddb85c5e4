//! Backlash, or lost motion: after a reversal, the joint stays where it is until the motor has crossed the gap of the gear.

use super::{Effect, Kind, NOT_NEGATIVE, Number, Offset, Physics, Presliding, Site, checked, per_axis};
use deflex_lanes::Real;
use serde::{Deserialize, Serialize};

pub(super) const KIND: Kind = Kind {
    name: "backlash",
    summary: "lost motion turns with the direction of travel",
    forms: &[
        "half_gap_rad = [6e-5, 0, 0, 1.2e-4, 0, 0]",
        "half_gap_rad = [0, 6e-5, 0, 0, 0, 0]\npresliding_rad = 1e-3",
    ],
    read: |table| checked(table.try_into::<Backlash>()?),
    candidates: |_| vec![Box::new(Backlash { half_gap_rad: [0.0; 6], presliding_rad: Presliding::default() })],
    ..Kind::PLAIN
};

/// Actual = commanded − travel · half gap.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Backlash {
    /// Half of the angle that the joint loses when its motor reverses, rad, for each joint.
    half_gap_rad: [f64; 6],
    /// Angles over which the lost motion builds up after a reversal, rad; the same in all effects of an arm.
    #[serde(default, skip_serializing_if = "Presliding::is_sharp")]
    presliding_rad: Presliding,
}

impl Physics for Backlash {
    #[inline(always)]
    fn offset<R: Real>(&self, _: &Site<R>, out: &mut Offset<R>) {
        for i in 0..6 {
            out.lost[i] = out.lost[i] + self.half_gap_rad[i];
        }
    }
}

impl Effect for Backlash {
    fn presliding(&self) -> Option<Presliding> {
        Some(self.presliding_rad)
    }

    fn with_presliding(&self, presliding_rad: Presliding) -> Box<dyn Effect> {
        Box::new(Self { presliding_rad, ..*self })
    }

    fn numbers(&mut self) -> Vec<Number<'_>> {
        // Makers quote up to an arc minute; 10 to 20 arc seconds are usual.
        per_axis("half_gap_rad", &mut self.half_gap_rad, "rad", 1e-4, 0.0, NOT_NEGATIVE)
    }
}

#[cfg(test)]
mod tests {
    use crate::bench::Bench;
    use approx::assert_abs_diff_eq;

    #[test]
    fn the_gap_is_lost() {
        let (_, out) = Bench::default().run("backlash", "half_gap_rad = [0, 7e-5, 0, 0, 2e-4, 0]");
        assert_abs_diff_eq!(out.lost[1], 7e-5);
        assert_abs_diff_eq!(out.lost[4], 2e-4);
    }
}
