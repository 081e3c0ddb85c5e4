//! What is left of earlier cutting forces in gears that creep.

use super::{Point, Prepared};
use crate::effects::DelayedTorque;
use crate::equilibrium::Arm;
use crate::robot::Joints;
use std::sync::Arc;

impl Prepared {
    /// Computes the delayed torques of the cutting forces at all targets, in running order. The force at a target acts on the whole segment to
    /// it. Before the program, the arm has rested without a load.
    pub(crate) fn follow_loads(&mut self, arm: &Arm) {
        let before = self.before.as_ref();
        let mut time = before.map_or(0.0, |before| before.time);
        let mut delayed = before.and_then(|before| before.delayed.clone());
        // Positions that were added between targets come after them, and take their torques from those of the targets.
        for i in 0..self.points.len() - self.between.len() {
            let point = &self.points[i];
            let seconds = (point.time - time).max(0.0);
            let torque = match point.unsolved {
                None => arm.cutting_torque(&self.situation(i), &point.motor),
                Some(_) => Joints::zeros(),
            };
            time = point.time;
            if delayed.is_some() || torque != Joints::zeros() {
                delayed = Some(Arc::new(delayed.as_deref().copied().unwrap_or_default().after(&torque, seconds)));
            }
            self.points[i].delayed.clone_from(&delayed);
        }
    }
}

/// The delayed torques at a share of the segment between two targets.
pub(super) fn delayed_between(from: &Point, to: &Point, share: f64) -> Option<Arc<DelayedTorque>> {
    let after = to.delayed.as_deref()?;
    Some(Arc::new(from.delayed.as_deref().copied().unwrap_or_default().lerp(after, share)))
}

#[cfg(test)]
mod tests {
    use crate::effects::DelayedTorque;
    use crate::robot::Joints;
    use approx::assert_abs_diff_eq;

    #[test]
    fn torques_follow_by_lags_of_the_first_order() {
        // 100 N·m for 25 s, then none for 25 s: 1 − 1/e of it after 25 s, and (1 − 1/e)/e after 50 s.
        let (torque, e) = (Joints::repeat(100.0), std::f64::consts::E);
        let loaded = DelayedTorque::default().after(&torque, 10.0).after(&torque, 15.0);
        assert_abs_diff_eq!(loaded.torques_nm[1][3], 100.0 * (1.0 - 1.0 / e), epsilon = 1e-12);
        let rested = loaded.after(&Joints::zeros(), 25.0);
        assert_abs_diff_eq!(rested.torques_nm[1][3], 100.0 * (1.0 - 1.0 / e) / e, epsilon = 1e-12);
        assert_abs_diff_eq!(loaded.torques_nm[0][3], 100.0 * (1.0 - (-5.0_f64).exp()), epsilon = 1e-12);
    }
}
