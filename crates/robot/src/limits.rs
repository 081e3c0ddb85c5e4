use super::{Joints, Robot};
use std::fmt::{self, Display, Formatter};

/// An angle of the arm that has limits.
///
/// # Examples
/// ```
/// use deflex_robot::LimitedAngle;
///
/// assert_eq!(LimitedAngle::Axis(5).to_string(), "axis 5");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LimitedAngle {
    /// The angle of an axis, from 1 to 6.
    Axis(usize),
    /// The angle between forearm and upper arm of a parallelogram: motor 3 − motor 2.
    ElbowDifference,
    /// The angle between forearm and upper arm where axis 3 is counted against the ground: axis 3 + axis 2.
    ElbowSum,
}

impl Display for LimitedAngle {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Axis(axis) => write!(f, "axis {axis}"),
            Self::ElbowDifference => f.write_str("elbow (axis 3 − axis 2)"),
            Self::ElbowSum => f.write_str("elbow (axis 3 + axis 2)"),
        }
    }
}

/// An angle beyond its limit.
///
/// # Examples
/// ```
/// # let robot = deflex_robot::Builtin::named("irb6660-205-1.9").expect("a built-in robot").robot();
/// use deflex_robot::LimitedAngle;
///
/// let violation = robot.limit_violation(&robot.motor_from_axes_deg(&[200.0, 0.0, 0.0, 0.0, 0.0, 0.0])).expect("beyond");
/// assert_eq!((violation.angle, violation.limit_deg), (LimitedAngle::Axis(1), 180.0));
/// println!("{} is {} degrees beyond its limit", violation.value_deg, violation.by_deg);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{angle} at {value_deg:.3}°, {by_deg:.3}° beyond its limit of {limit_deg:.3}°")]
pub struct LimitViolation {
    /// Which angle it is.
    pub angle: LimitedAngle,
    /// The size of the angle, degrees.
    pub value_deg: f64,
    /// The limit that it passes, degrees.
    pub limit_deg: f64,
    /// By how much it passes the limit, degrees, positive.
    pub by_deg: f64,
}

/// Angles that exceed a limit by less than this, rad, count as being at the limit, because printed programs are
/// rounded.
const LIMIT_SLACK: f64 = 1e-9;

impl Robot {
    /// The angle that [`Limits::elbow`](super::Limits::elbow) bounds, rad.
    pub(super) fn elbow(&self, motor: &Joints) -> f64 {
        motor[2] + self.axes.elbow_of_second() * motor[1]
    }

    /// How far motor angles (rad) are from the nearest limit, rad; negative beyond it.
    #[must_use]
    #[doc(hidden)]
    pub fn limit_margin(&self, motor: &Joints) -> f64 {
        let (limits, counted) = (&self.limits, self.axes_from_motor(motor));
        let axes = (0..6).map(|i| (counted[i], limits.min[i], limits.max[i]));
        let margins = axes.chain(limits.elbow.map(|(min, max)| (self.elbow(motor), min, max)));
        margins.map(|(value, min, max)| (value - min).min(max - value)).fold(f64::INFINITY, f64::min)
    }

    /// The worst limit violation at motor angles (rad), if any.
    #[must_use]
    pub fn limit_violation(&self, motor: &Joints) -> Option<LimitViolation> {
        let limits = &self.limits;
        let inside = |value: f64, min: f64, max: f64| (value >= min) & (value <= max);
        let (counted, elbow) = (self.axes_from_motor(motor), self.elbow(motor));
        if (0..6).fold(true, |all, i| all & inside(counted[i], limits.min[i], limits.max[i]))
            && limits.elbow.is_none_or(|(min, max)| inside(elbow, min, max))
        {
            return None;
        }
        let axes = (0..6).map(|i| (LimitedAngle::Axis(i + 1), counted[i], limits.min[i], limits.max[i]));
        let which = if self.axes.parallelogram { LimitedAngle::ElbowDifference } else { LimitedAngle::ElbowSum };
        axes.chain(limits.elbow.map(|(min, max)| (which, elbow, min, max)))
            .filter_map(|(angle, value, min, max)| {
                let (limit, by) = if value < min { (min, min - value) } else { (max, value - max) };
                (by > LIMIT_SLACK).then(|| LimitViolation {
                    angle,
                    value_deg: value.to_degrees(),
                    limit_deg: limit.to_degrees(),
                    by_deg: by.to_degrees(),
                })
            })
            .max_by(|a, b| a.by_deg.total_cmp(&b.by_deg))
    }

    /// Moves axes by whole turns so that they come nearest to `near`, within the limits if possible.
    #[must_use]
    pub(crate) fn nearest_turns(&self, motor: &Joints, near: &Joints) -> Joints {
        use std::f64::consts::TAU;
        let mut out = *motor;
        for i in [0, 1, 2, 3, 4, 5] {
            // Axis 2 has its final value before axis 3 is chosen.
            let counted = if i == 2 { self.axes.counted_23() * out[1] } else { 0.0 };
            let (min, max) = (self.limits.min[i] - LIMIT_SLACK, self.limits.max[i] + LIMIT_SLACK);
            let elbow = self.limits.elbow.filter(|_| i == 2);
            let folded = self.axes.elbow_of_second() * out[1];
            let bends = |v: f64| {
                elbow.is_none_or(|(min, max)| v + folded >= min - LIMIT_SLACK && v + folded <= max + LIMIT_SLACK)
            };
            let inside = |v: f64| v + counted >= min && v + counted <= max && bends(v);
            // The usual case on a path: less than half a turn away.
            if (near[i] - motor[i]).abs() < 3.0 && inside(motor[i]) {
                continue;
            }
            let nearest = motor[i] + ((near[i] - motor[i]) / TAU).round() * TAU;
            out[i] = [nearest, nearest - TAU, nearest + TAU]
                .into_iter()
                .filter(|&v| inside(v))
                .min_by(|a, b| (a - near[i]).abs().total_cmp(&(b - near[i]).abs()))
                .unwrap_or(nearest);
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use crate::BUILTIN;

    fn beyond(model: &str, axes_deg: [f64; 6]) -> String {
        let robot = BUILTIN.iter().find(|robot| robot.model == model).unwrap().robot();
        let motor = robot.motor_from_axes_deg(&axes_deg);
        let violation = robot.limit_violation(&motor);
        // The margin must be that of the same limit.
        let by_deg = violation.map_or(0.0, |violation| violation.by_deg);
        assert!((robot.limit_margin(&motor).min(0.0).to_degrees() + by_deg).abs() < 1e-9, "{violation:?}");
        violation.map_or_else(String::new, |violation| violation.to_string())
    }

    /// The M-710iC/50 folds its forearm to 80.5° below the square with its upper arm and to 205° above it, wherever axis 2 stands:
    /// each axis alone is within its own limits in all these postures.
    #[test]
    fn the_elbow_of_an_arm_that_counts_axis_3_against_the_ground_has_limits() {
        assert_eq!(beyond("m-710ic-50", [0.0, -80.0, 0.0, 0.0, 30.0, 0.0]), "");
        assert_eq!(
            beyond("m-710ic-50", [0.0, -80.0, -10.0, 0.0, 30.0, 0.0]),
            "elbow (axis 3 + axis 2) at -90.000°, 9.500° beyond its limit of -80.500°"
        );
        assert_eq!(
            beyond("m-710ic-50", [0.0, 130.0, 80.0, 0.0, 30.0, 0.0]),
            "elbow (axis 3 + axis 2) at 210.000°, 5.000° beyond its limit of 205.000°"
        );
        assert_eq!(beyond("m-710ic-50", [0.0, 130.0, -160.0, 0.0, 30.0, 0.0]), "");
    }

    /// A small arm's forearm points 80° down, which its upper arm allows when it leans forward.
    #[test]
    fn a_forearm_may_point_down_where_the_upper_arm_leans_forward() {
        assert_eq!(beyond("lr-mate-200id", [0.0, 60.0, -80.0, 0.0, 30.0, 0.0]), "");
    }

    #[test]
    fn a_parallelogram_has_the_limits_of_motor_3_against_motor_2() {
        assert_eq!(
            beyond("irb6660-205-1.9", [0.0, -40.0, 40.0, 0.0, 30.0, 0.0]),
            "elbow (axis 3 − axis 2) at 80.000°, 10.000° beyond its limit of 70.000°"
        );
    }
}
