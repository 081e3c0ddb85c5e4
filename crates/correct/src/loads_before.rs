//! What this and earlier cutting forces do to the gears along a program: the torques under which they twist and creep, and the travel of
//! their friction.

use super::{Point, Prepared};
use deflex_effects::CuttingTorque;
use deflex_equilibrium::Arm;
use deflex_robot::Joints;
use std::sync::Arc;

impl Prepared {
    /// Computes the torques of the cutting forces at all targets, in running order, and the travel of friction with a presliding angle. The
    /// force at a target acts on the whole segment to it. Before the program, the arm has rested without a load.
    #[doc(hidden)]
    pub fn follow_loads(&mut self, arm: &Arm) {
        let before = self.before.as_ref();
        let mut time = before.map_or(0.0, |before| before.time);
        let mut torques = before.and_then(|before| before.torque.clone());
        let mut last = before.map(Point::step);
        let is_sharp = arm.presliding().is_sharp();
        // Positions that were added between targets come after them, and take their torques from those of the targets.
        for i in 0..self.points.len() - self.between.len() {
            let point = &self.points[i];
            let seconds = (point.time - time).max(0.0);
            let torque = match point.unsolved {
                None => arm.cutting_torque(&self.situation(i), &point.motor),
                Some(_) => Joints::zeros(),
            };
            time = point.time;
            if torques.is_some() || torque != Joints::zeros() {
                let twist = arm.stiffness.map_or_else(Joints::zeros, |stiffness| torque.component_div(&stiffness));
                torques =
                    Some(Arc::new(torques.as_deref().copied().unwrap_or_default().after(&torque, twist, seconds)));
            }
            self.points[i].torque.clone_from(&torques);
            if !is_sharp {
                let point = &mut self.points[i];
                point.travel = arm.go_on(point.motor, point.twist(), &mut last).travel;
            }
        }
    }
}

/// The torques at a share of the segment between two targets.
pub(super) fn torque_between(from: &Point, to: &Point, share: f64) -> Option<Arc<CuttingTorque>> {
    let after = to.torque.as_deref()?;
    Some(Arc::new(from.torque.as_deref().copied().unwrap_or_default().lerp(after, share)))
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use deflex_effects::CuttingTorque;
    use deflex_robot::Joints;

    #[test]
    fn torques_follow_by_lags_of_the_first_order() {
        // 100 N·m for 15 s, then none for 15 s: 1 − 1/e of it after 15 s, and (1 − 1/e)/e after 30 s.
        let (torque, e) = (Joints::repeat(100.0), std::f64::consts::E);
        let twist = Joints::zeros();
        let loaded = CuttingTorque::default().after(&torque, twist, 10.0).after(&torque, twist, 5.0);
        assert_abs_diff_eq!(loaded.delayed_nm[1][3], 100.0 * (1.0 - 1.0 / e), epsilon = 1e-12);
        let rested = loaded.after(&Joints::zeros(), twist, 15.0);
        assert_abs_diff_eq!(rested.delayed_nm[1][3], 100.0 * (1.0 - 1.0 / e) / e, epsilon = 1e-12);
        assert_abs_diff_eq!(loaded.delayed_nm[0][3], 100.0 * (1.0 - (-3.0_f64).exp()), epsilon = 1e-12);
    }
}
