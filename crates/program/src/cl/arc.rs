//! Arcs and helices as chords.

use super::vector::{add, cross, dot, norm, scale, sub, unit};
use crate::Reason;
use std::f64::consts::TAU;

/// An arc from a start to an end, counter-clockwise about its axis (right-hand rule).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Arc {
    /// Centre of the circle through the start; the position of the text's centre along the axis does not matter.
    centre: [f64; 3],
    /// Unit vectors: towards the start, a quarter turn further, and the axis.
    frame: [[f64; 3]; 3],
    /// Distance from the axis at the start and at the end.
    radius: [f64; 2],
    /// Height of the end over the start, along the axis.
    height: f64,
    /// Angle travelled, radians.
    pub(super) sweep: f64,
}

/// The data of an arc in the text, other than its ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Circle {
    pub(super) centre: [f64; 3],
    /// Axis of any length; the travel is counter-clockwise about it.
    pub(super) axis: [f64; 3],
    /// Radius, if the text gives one.
    pub(super) radius: Option<f64>,
    /// Turns of a helix; 1 for an arc.
    pub(super) turns: f64,
}

/// The direction of travel of an arc, from the points on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sense {
    /// They follow one another in the direction of the axis.
    AsSaid,
    /// They follow one another in the opposite direction.
    Reversed,
    /// They follow neither direction.
    Neither,
    /// They do not lie on the circle, or do not decide.
    Unknown,
}

impl Circle {
    /// The same circle in the opposite direction.
    pub(super) fn reversed(&self) -> Self {
        Self { axis: scale(self.axis, -1.0), ..*self }
    }

    /// Whether a point lies on the circle's cylinder, within printed digits.
    pub(super) fn holds(&self, start: [f64; 3], point: [f64; 3]) -> bool {
        Arc::new(self, start, point).is_ok()
    }

    /// Whether points follow one another in steps of at most a quarter turn, as those of a linearised arc do.
    pub(super) fn steps(&self, start: [f64; 3], points: &[[f64; 3]]) -> bool {
        let mut from = start;
        points.iter().all(|&point| {
            let arc = Arc::new(self, std::mem::replace(&mut from, point), point);
            arc.is_ok_and(|arc| arc.sweep <= TAU / 4.0)
        })
    }

    /// The direction in which `points`, in the order of travel, lie on the arc from `start`: within one turn.
    pub(super) fn sense(&self, start: [f64; 3], points: &[[f64; 3]]) -> Sense {
        /// Printed digits of the points, radians.
        const PRINTED: f64 = 1e-3;
        let total = |circle: &Self| -> Option<f64> {
            let (mut from, mut total) = (start, 0.0);
            for &point in points {
                let arc = Arc::new(circle, from, point).ok()?;
                // A repeated point is no full turn, unless it is the only point.
                total += if arc.sweep > TAU - SAME_POINT && points.len() > 1 { 0.0 } else { arc.sweep };
                from = point;
            }
            Some(total)
        };
        // Points out of the plane of the start are those of a helix, or of something else.
        let (Some(own), Some(other)) = (total(self), total(&self.reversed())) else { return Sense::Unknown };
        let one_turn = TAU + PRINTED;
        match (own <= one_turn, other <= one_turn) {
            (true, _) => Sense::AsSaid,
            (false, true) => Sense::Reversed,
            (false, false) => Sense::Neither,
        }
    }
}

/// Points that are nearer to one another than this are equal, radians.
const SAME_POINT: f64 = 1e-6;

/// Most chords of an arc; more come from a wrong number. A full circle of 34 m radius to 0.01 mm has 4,096.
const MAX_CHORDS: f64 = 16_384.0;

/// Largest distance of the ends from the circle, as a share of its radius; printed digits and CAM tolerances of real files are a
/// hundred times smaller.
const OFF_CIRCLE: f64 = 0.02;

/// A radius below this share of the distance from the centre, which may lie anywhere along the axis, is rounding.
const LOST: f64 = 1e-9;

/// Largest radius, in units of the file: beyond it, the digits of a centre do not resolve micrometres of its arc.
const LARGEST_RADIUS: f64 = 1e6;

/// An end nearer to the start than this, in units of the file, is the start itself: a full turn. A start this near to the axis is on it.
/// The last two of four decimals are rounding.
const SAME_PLACE: f64 = 2.5e-4;

impl Arc {
    /// The arc, or why it is none; all lengths in the same unit.
    pub(super) fn new(circle: &Circle, start: [f64; 3], end: [f64; 3]) -> Result<Self, Reason> {
        let n = unit(circle.axis).ok_or(Reason::ArcWithoutAxis)?;
        let (a, b) = (sub(start, circle.centre), sub(end, circle.centre));
        let flat = |v: [f64; 3]| sub(v, scale(n, dot(v, n)));
        let (flat_a, flat_b) = (flat(a), flat(b));
        let (radius_a, radius_b) = (norm(flat_a), norm(flat_b));
        let x = unit(flat_a).filter(|_| radius_a > SAME_PLACE.max(LOST * norm(a))).ok_or(Reason::ArcNoRadius)?;
        if radius_a > LARGEST_RADIUS {
            return Err(Reason::ArcRadiusHuge);
        }
        let y = cross(n, x);
        let radius = circle.radius.map_or(radius_a, f64::abs);
        let off = (radius_a - radius).abs().max((radius_b - radius).abs());
        if off.is_nan() || off > OFF_CIRCLE * radius {
            return Err(Reason::ArcEndsOffCircle);
        }
        let closed = norm(sub(flat_b, flat_a)) < SAME_PLACE;
        let mut sweep = if closed { TAU } else { dot(flat_b, y).atan2(dot(flat_b, x)).rem_euclid(TAU) };
        sweep += TAU * (circle.turns.max(1.0) - 1.0);
        Ok(Self {
            centre: sub(start, flat_a),
            frame: [x, y, n],
            radius: [radius_a, radius_b],
            height: dot(sub(end, start), n),
            sweep,
        })
    }

    /// Whether it is the longer arc and reverses the direction of the tool, while the shorter arc would continue smoothly. (Tools do reverse
    /// into short arcs, to clear corners.)
    pub(super) fn turns_back(&self, incoming: [f64; 3]) -> bool {
        /// Cosine of 10°: CAM systems leave lines tangentially to printed digits, and corners are much sharper.
        const SMOOTH: f64 = 0.985;
        self.sweep > TAU / 2.0 && unit(incoming).is_some_and(|incoming| dot(incoming, self.frame[1]) < -SMOOTH)
    }

    /// Number of equal chords that stay within `tolerance` of the arc.
    pub(super) fn chords(&self, tolerance: f64) -> Result<usize, Reason> {
        let radius = self.radius[0].max(self.radius[1]);
        // The sagitta of a chord over the angle a is r·(1 − cos(a/2)).
        let angle = 2.0 * (1.0 - tolerance / radius).max(0.0).acos();
        let chords = (self.sweep / angle).ceil();
        if chords.is_nan() || chords > MAX_CHORDS {
            return Err(Reason::ArcTooLong);
        }
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        Ok(chords.max(1.0) as usize)
    }

    /// The point at the share `t` of the arc; radius and height change evenly (helix, spiral).
    pub(super) fn point(&self, t: f64) -> [f64; 3] {
        let (sin, cos) = (self.sweep * t).sin_cos();
        let [a, b] = self.radius;
        let r = a + (b - a) * t;
        let [x, y, n] = self.frame;
        add(add(self.centre, scale(n, self.height * t)), add(scale(x, r * cos), scale(y, r * sin)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const QUARTER: Circle = Circle { centre: [0.0; 3], axis: [0.0, 0.0, 2.0], radius: Some(10.0), turns: 1.0 };

    #[test]
    fn quarter_turns_left_about_its_axis_and_three_quarters_the_other_way() {
        let (start, end) = ([10.0, 0.0, 0.0], [0.0, 10.0, 0.0]);
        let left = Arc::new(&QUARTER, start, end).unwrap();
        assert!((left.sweep - TAU / 4.0).abs() < 1e-12);
        let right = Arc::new(&Circle { axis: [0.0, 0.0, -1.0], ..QUARTER }, start, end).unwrap();
        assert!((right.sweep - 3.0 * TAU / 4.0).abs() < 1e-12);
    }

    #[test]
    fn chords_stay_within_the_tolerance_and_end_on_the_end() {
        let arc = Arc::new(&QUARTER, [10.0, 0.0, 0.0], [10.0, 0.0, 5.0]).unwrap();
        assert!((arc.sweep - TAU).abs() < 1e-12, "the start again is a full turn");
        let n = arc.chords(0.01).unwrap();
        let mid = |i: usize| {
            let [a, b] = [i, i + 1].map(|k| arc.point(k as f64 / n as f64));
            norm([(a[0] + b[0]) / 2.0, (a[1] + b[1]) / 2.0, 0.0])
        };
        assert!((0..n).all(|i| 10.0 - mid(i) <= 0.01 + 1e-12));
        assert!(10.0 - mid(0) > 0.008, "not more chords than needed");
        assert!(norm(sub(arc.point(1.0), [10.0, 0.0, 5.0])) < 1e-12);
    }

    #[test]
    fn what_is_no_arc_is_said() {
        assert!(Arc::new(&QUARTER, [10.0, 0.0, 0.0], [0.0, 12.0, 0.0]).is_err());
        assert!(Arc::new(&Circle { axis: [0.0; 3], ..QUARTER }, [10.0, 0.0, 0.0], [0.0, 10.0, 0.0]).is_err());
        let large = Circle { radius: Some(1e6), ..QUARTER };
        assert!(Arc::new(&large, [1e6, 0.0, 0.0], [-1e6, 0.0, 0.0]).unwrap().chords(0.001).is_err());
        let huge = Circle { radius: Some(1e7), ..QUARTER };
        assert!(Arc::new(&huge, [1e7, 0.0, 0.0], [-1e7, 0.0, 0.0]).is_err());
    }
}
