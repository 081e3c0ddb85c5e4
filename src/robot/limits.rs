use super::{Joints, Robot};

/// Axis limits as the controller counts, rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Least axis angles.
    pub min: Joints,
    /// Largest axis angles.
    pub max: Joints,
    /// Parallelogram: least and largest motor 3 − motor 2.
    pub elbow: Option<(f64, f64)>,
}

/// An axis beyond its limit.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{name} at {value_deg:.3}°, {by_deg:.3}° beyond its limit of {limit_deg:.3}°", name = self.name())]
pub struct LimitViolation {
    /// Axis 0 to 5; 6 is the parallelogram's own motor 3 − motor 2.
    pub axis: usize,
    /// Where it would be, degrees.
    pub value_deg: f64,
    /// The limit that it passes, degrees.
    pub limit_deg: f64,
    /// By how much, degrees, positive.
    pub by_deg: f64,
}

impl LimitViolation {
    fn name(&self) -> String {
        if self.axis < 6 { format!("axis {}", self.axis + 1) } else { "elbow (axis 3 − axis 2)".to_owned() }
    }
}

/// Angles this far beyond a limit are still taken as at it: printed programs are rounded.
const LIMIT_SLACK: f64 = 1e-9;

impl Robot {
    /// How far motor angles (rad) are from the nearest limit, rad; negative beyond it.
    #[must_use]
    pub fn limit_margin(&self, motor: &Joints) -> f64 {
        let (limits, counted) = (&self.limits, self.axes_from_motor(motor));
        let elbow = limits.elbow.filter(|_| self.axes.parallelogram);
        let axes = (0..6).map(|i| (counted[i], limits.min[i], limits.max[i]));
        let margins = axes.chain(elbow.map(|(min, max)| (motor[2] - motor[1], min, max)));
        margins.map(|(value, min, max)| (value - min).min(max - value)).fold(f64::INFINITY, f64::min)
    }

    /// The worst limit violation at motor angles (rad), if any.
    #[must_use]
    pub fn limit_violation(&self, motor: &Joints) -> Option<LimitViolation> {
        let limits = &self.limits;
        let inside = |value: f64, min: f64, max: f64| (value >= min) & (value <= max);
        let elbow = limits.elbow.filter(|_| self.axes.parallelogram);
        let counted = self.axes_from_motor(motor);
        if (0..6).fold(true, |all, i| all & inside(counted[i], limits.min[i], limits.max[i]))
            && elbow.is_none_or(|(min, max)| inside(motor[2] - motor[1], min, max))
        {
            return None;
        }
        let axes = (0..6).map(|i| (i, counted[i], limits.min[i], limits.max[i]));
        axes.chain(elbow.map(|(min, max)| (6, motor[2] - motor[1], min, max)))
            .filter_map(|(axis, value, min, max)| {
                let (limit, by) = if value < min { (min, min - value) } else { (max, value - max) };
                (by > LIMIT_SLACK).then(|| LimitViolation {
                    axis,
                    value_deg: value.to_degrees(),
                    limit_deg: limit.to_degrees(),
                    by_deg: by.to_degrees(),
                })
            })
            .max_by(|a, b| a.by_deg.total_cmp(&b.by_deg))
    }

    /// Moves revolute axes by whole turns to come nearest to `near`, inside the limits where possible.
    #[must_use]
    pub fn nearest_turns(&self, motor: &Joints, near: &Joints) -> Joints {
        use std::f64::consts::TAU;
        let mut out = *motor;
        for i in [0, 1, 2, 3, 4, 5] {
            // Axis 2 is settled before axis 3.
            let counted = if i == 2 { self.axes.counted_23() * out[1] } else { 0.0 };
            let (min, max) = (self.limits.min[i] - LIMIT_SLACK, self.limits.max[i] + LIMIT_SLACK);
            let inside = |v: f64| v + counted >= min && v + counted <= max;
            // On a path: less than half a turn away.
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
