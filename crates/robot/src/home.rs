//! The home posture of an arm, from which the branch of the first target is chosen unless the program or the cell names another.

use super::{Joints, Robot};
use nalgebra::Vector3;

/// Home angles are multiples of this, degrees; smaller differences are rounding.
const STEP_DEG: f64 = 1e-6;
/// Two axes are parallel where the sine between them is below this.
const PARALLEL: f64 = 1e-6;

impl Robot {
    /// Axis angles in the home position as the controller counts them, degrees. The upper arm is vertical, the forearm
    /// horizontal and points forward, and all other axes are at zero. The angles follow from the geometry, and differ
    /// between makers: they are all zero for ABB, FANUC and Yaskawa arms, and 0, −90, 90, 0, 0, 0 for KUKA arms.
    #[must_use]
    pub fn home_deg(&self) -> [f64; 6] {
        let mut serial = Joints::zeros();
        let frames = self.links.chain(&serial);
        let upper_arm = frames.origin(2) - frames.origin(1);
        serial[1] = turn_to(&upper_arm, &frames.axis(0), &frames.axis(1));
        let frames = self.links.chain(&serial);
        let (elbow, roll) = (frames.axis(2), frames.axis(3));
        let to_wrist = frames.origin(3) - frames.origin(2);
        // The forearm points along the axis about which it turns, because the wrist centre may be off that axis.
        let forearm = if elbow.cross(&roll).norm() > PARALLEL { roll * roll.dot(&to_wrist).signum() } else { to_wrist };
        serial[2] = turn_to(&forearm, &elbow.cross(&frames.axis(0)), &elbow);
        let frames = self.links.chain(&serial);
        if frames.origin(3).x < frames.origin(2).x {
            serial[2] += std::f64::consts::PI;
        }
        let round = |deg: f64| (wrapped(deg) / STEP_DEG).round() * STEP_DEG + 0.0;
        self.axes_deg_from_motor(&self.motor_from_serial(&serial)).map(round)
    }

    /// The motor angles of [`Robot::home_deg`], rad.
    #[must_use]
    #[doc(hidden)]
    pub fn home(&self) -> Joints {
        self.motor_from_axes_deg(&self.home_deg())
    }
}

/// The angle about `axis` that turns one direction into another, both projected along the axis, rad; 0 if one of them is parallel to it.
fn turn_to(from: &Vector3<f64>, to: &Vector3<f64>, axis: &Vector3<f64>) -> f64 {
    axis.dot(&from.cross(to)).atan2(from.dot(to) - axis.dot(from) * axis.dot(to))
}

/// The same direction as an angle between −180° and 180°.
fn wrapped(deg: f64) -> f64 {
    deg - 360.0 * (deg / 360.0).round()
}

#[cfg(test)]
mod tests {
    use crate::BUILTIN;

    #[test]
    #[allow(clippy::float_cmp)] // angles of one list
    fn home_is_each_makers_own_and_within_the_limits() {
        for builtin in BUILTIN.iter() {
            let robot = builtin.robot();
            let home = robot.home_deg();
            let own = match &builtin.maker[..] {
                // At the zero position of a shelf-mounted arm, the upper arm is horizontal.
                "FANUC" if builtin.rows[1][3] == 0.0 => [0.0, -90.0, 90.0, 0.0, 0.0, 0.0],
                // At the zero position, the forearm hangs down.
                "Yaskawa" if builtin.rows[2][3] == 90.0 => [0.0, 0.0, 90.0, 0.0, 0.0, 0.0],
                "ABB" | "FANUC" | "Yaskawa" => [0.0; 6],
                "KUKA" => [0.0, -90.0, 90.0, 0.0, 0.0, 0.0],
                "Stäubli" => [0.0, 0.0, 90.0, 0.0, 0.0, 0.0],
                _ => [0.0, -90.0, home[2], 0.0, 0.0, 0.0],
            };
            assert_eq!(home, own, "{}", builtin.model);
            assert_eq!(robot.limit_violation(&robot.home()), None, "{}", builtin.model);
        }
    }
}
