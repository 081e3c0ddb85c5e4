//! Gears that creep: under a lasting load a joint keeps yielding for seconds and minutes, and comes back as slowly.
//!
//! Each joint is a chain of Kelvin elements in series with its spring: θ̇ₙ Tₙ = sₙ τ / k − θₙ, with fixed times Tₙ ([`CREEP_TIMES_S`]) and shares sₙ of
//! the declared compliance. Such a series (a Prony series: Ferry, Viscoelastic Properties of Polymers, chapter 4) is linear in the shares. With
//! one time to a factor of three it follows a gear with a single time between two of them to 4 % of its creep under a lasting torque.

use super::{
    CREEP_TIMES_S, Deflection, Effect, Kind, Load, NOT_NEGATIVE, Need, Number, Physics, State, checked, per_axis,
};
use deflex_lanes::Real;
use serde::{Deserialize, Serialize};

pub(super) const KIND: Kind = Kind {
    name: "creep",
    summary: "joints keep yielding for seconds and minutes under a lasting cutting force",
    forms: &[
        "share_5_s = [0, 0, 0, 0, 0, 0]\nshare_15_s = [0, 0.05, 0.05, 0, 0, 0]\nshare_45_s = [0, 0, 0, 0, 0, 0]\nshare_135_s = [0, 0, 0, 0, 0, 0]",
    ],
    bends_under_load: true,
    needs: &[Need::Stiffness, Need::Force, Need::Time],
    follows_load: true,
    read: |table| checked(table.try_into::<Creep>()?),
    candidates: |survey| match survey.stiffness_declared && survey.has_force && survey.time.is_some() {
        true => vec![Box::new(Creep::default())],
        false => vec![],
    },
    ..Kind::PLAIN
};

/// Shares of each joint's declared compliance by which it yields more once it has rested under a torque.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Creep {
    share_5_s: [f64; 6],
    share_15_s: [f64; 6],
    share_45_s: [f64; 6],
    share_135_s: [f64; 6],
}

impl Creep {
    /// The shares in the order of [`CREEP_TIMES_S`].
    fn shares(&self) -> [&[f64; 6]; CREEP_TIMES_S.len()] {
        [&self.share_5_s, &self.share_15_s, &self.share_45_s, &self.share_135_s]
    }
}

impl Physics for Creep {
    #[inline(always)]
    fn deflect<R: Real>(&self, state: &State<'_, R>, _: &Load<R>, out: &mut Deflection<R>) {
        let Some(stiffness) = state.stiffness else { return };
        for (shares, torque) in self.shares().into_iter().zip(&state.site.delayed) {
            for i in 0..6 {
                out.joints[i] = out.joints[i] + torque[i] * (shares[i] / stiffness[i]);
            }
        }
    }
}

impl Effect for Creep {
    fn numbers(&mut self) -> Vec<Number<'_>> {
        // That gears creep by a tenth of their deflection is an assumption, for which we have no source.
        let shares = [&mut self.share_5_s, &mut self.share_15_s, &mut self.share_45_s, &mut self.share_135_s];
        let named = ["share_5_s", "share_15_s", "share_45_s", "share_135_s"].into_iter().zip(shares);
        named.flat_map(|(name, shares)| per_axis(name, shares, "1", 0.1, 0.0, NOT_NEGATIVE)).collect()
    }
}

#[cfg(test)]
mod tests {
    use crate::bench::Bench;
    use crate::{CREEP_TIMES_S, CuttingTorque};
    use approx::assert_abs_diff_eq;
    use deflex_robot::Joints;

    #[test]
    fn two_neighbouring_times_follow_each_time_between_them_to_four_percent() {
        let crept = |time: f64, at: f64| 1.0 - (-at / time).exp();
        for pair in CREEP_TIMES_S.windows(2) {
            // The time in the middle of the two, in their ratio, is farthest from both.
            let time = (pair[0] * pair[1]).sqrt();
            let off =
                |share: f64, at: f64| share * crept(pair[0], at) + (1.0 - share) * crept(pair[1], at) - crept(time, at);
            let worst =
                |share: f64| (1..1_000).map(|k| off(share, 0.01 * f64::from(k) * time).abs()).fold(0.0, f64::max);
            let best = (0..=100).map(|percent| worst(0.01 * f64::from(percent))).fold(1.0, f64::min);
            assert!(best < 0.04, "{time} s: {best}");
        }
    }

    #[test]
    fn a_joint_yields_more_by_its_share_of_the_delayed_torque() {
        // 1000 N·m on axis 2 after 15 s, on 1e6 N·m/rad: 5 % of 1e-3 rad. The other times have no torque.
        let mut torque = CuttingTorque::default();
        torque.delayed_nm[1] = Joints::new(0.0, 1000.0, 0.0, 0.0, 0.0, 0.0);
        let mut bench = Bench::default();
        bench.situation.torque = Some(Box::leak(Box::new(torque)));
        let (_, out) = bench.run(
            "creep",
            "share_5_s = [0, 0.1, 0, 0, 0, 0]\nshare_15_s = [0, 0.05, 0, 0, 0, 0]\nshare_45_s = [0, 0.1, 0, 0, 0, 0]\n\
             share_135_s = [0, 0.1, 0, 0, 0, 0]",
        );
        assert_abs_diff_eq!(out.joints[1], 5e-5, epsilon = 1e-16);
        assert_abs_diff_eq!(out.joints[0], 0.0);
    }
}
