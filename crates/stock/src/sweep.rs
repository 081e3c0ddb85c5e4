//! The body that a cutter sweeps on a motion.

use super::solid::{HypotFast, Solid};
use nalgebra::{Rotation3, Unit, Vector3};
use std::ops::Range;

/// The pose of a tool in the stock's frame.
///
/// # Examples
/// ```
/// use nalgebra::Vector3;
/// use deflex_stock::ToolPose;
///
/// let at = |x: f64| ToolPose { tip: Vector3::new(x, 0.0, -2e-3), axis: Vector3::z_axis() };
/// assert_eq!(at(0.0).between(&at(1.0), 0.25).tip.x, 0.25); // m
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToolPose {
    /// The tip, m.
    pub tip: Vector3<f64>,
    /// Unit vector from the tip to the spindle.
    pub axis: Unit<Vector3<f64>>,
}

impl ToolPose {
    /// The pose at a share between this one and another, by the shortest turn of the axis.
    #[must_use]
    pub fn between(&self, other: &Self, share: f64) -> Self {
        let axis = match Rotation3::scaled_rotation_between(&self.axis, &other.axis, share) {
            Some(turn) => turn * self.axis,
            None => self.axis,
        };
        Self { tip: self.tip.lerp(&other.tip, share), axis }
    }
}

/// Bound of the turn of a sweep: points stay within this of a straight line in the tool's frame, m.
const CHORD_ERROR: f64 = 2e-6;

/// Below this turn the axis counts as still, rad: a nanometre at a metre.
const STILL: f64 = 1e-9;

/// A motion continues another one straight on if all of it stays this near to the line, m.
const STRAIGHT: f64 = 1e-8;

/// Sine of the angle to the dexels below which the axis is parallel to them.
const UPRIGHT: f64 = 1e-9;

/// A cutter on a straight motion between two poses with a small turn.
///
/// In the tool's own frame, a point of the stock moves from its position at the start to that at the end. This path is straight for a
/// motion without a turn, and nearly straight with a small one (see [`CHORD_ERROR`]). The distance to the cutter is convex along it, so
/// that its minimum is always found.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sweep {
    pub(super) solid: Solid,
    pub(super) start: ToolPose,
    pub(super) end: ToolPose,
    /// Two directions perpendicular to the axis, at the start and at the end, without a turn about it.
    across: [[Vector3<f64>; 2]; 2],
    /// Displacement of every point in the tool's frame, if the axis is still.
    displacement: Option<Vector3<f64>>,
    pub(super) upright: bool,
}

/// Distance of a point from the sweep, and its slope along a direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Distance {
    pub(super) value: f64,
    pub(super) slope: f64,
}

/// A sweep that will be removed from the lines.
#[derive(Clone, Debug)]
pub(super) struct Cut {
    pub(super) sweep: Sweep,
    /// Index of the deferred motion that it belongs to.
    pub(super) of: usize,
    /// Number of the cut, from 1, and of its sweep, which the cut may have extended.
    pub(super) number: u32,
    pub(super) by: u32,
    /// The lines that it may touch.
    pub(super) columns: Range<usize>,
    pub(super) rows: Range<usize>,
    /// Whether the same cutter continues from the end of the cut before.
    pub(super) continues: bool,
}

impl Sweep {
    /// Number of sweeps that a motion consists of, for the turn of its axis (rad) at points up to `reach` (m) from the tip.
    pub(super) fn count(start: &ToolPose, end: &ToolPose, reach: f64) -> usize {
        let turn = start.axis.angle(&end.axis);
        if turn < STILL {
            return 1;
        }
        let most = (8.0 * CHORD_ERROR / reach.max(CHORD_ERROR)).sqrt();
        (turn / most).ceil().max(1.0) as usize
    }

    pub(super) fn new(solid: Solid, start: ToolPose, end: ToolPose) -> Self {
        let helper = if start.axis.x.abs() < 0.7 { Vector3::x() } else { Vector3::y() };
        let x = start.axis.cross(&helper).normalize();
        let first = [x, start.axis.cross(&x)];
        let turn = Rotation3::rotation_between(&start.axis, &end.axis);
        let still = start.axis.angle(&end.axis) < STILL;
        let turn = turn.filter(|_| !still).unwrap_or_else(Rotation3::identity);
        let across = [first, first.map(|v| turn * v)];
        let displacement = still.then(|| {
            let back = start.tip - end.tip;
            Vector3::new(first[0].dot(&back), first[1].dot(&back), start.axis.dot(&back))
        });
        let upright = still && start.axis.x.hypot(start.axis.y) < UPRIGHT && start.axis.z > 0.0;
        Self { solid, start, end, across, displacement, upright }
    }

    #[inline]
    fn local(pose: &ToolPose, across: &[Vector3<f64>; 2], point: &Vector3<f64>) -> Vector3<f64> {
        let from_tip = point - pose.tip;
        Vector3::new(across[0].dot(&from_tip), across[1].dot(&from_tip), pose.axis.dot(&from_tip))
    }

    /// A point in the tool's frame at the start, and its displacement to the end.
    #[inline]
    fn course(&self, point: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
        let from = Self::local(&self.start, &self.across[0], point);
        let displacement = self.displacement.unwrap_or_else(|| Self::local(&self.end, &self.across[1], point) - from);
        (from, displacement)
    }

    /// Signed distance of a point, m: a point with a negative distance is cut.
    #[inline]
    pub(super) fn distance(&self, point: &Vector3<f64>) -> f64 {
        let (from, displacement) = self.course(point);
        let at = from + displacement * nearest(&self.solid, &from, &displacement);
        self.solid.distance(at.x.hypot_fast(at.y), at.z)
    }

    /// The same, with its slope along z.
    pub(super) fn distance_along_z(&self, point: &Vector3<f64>) -> Distance {
        let (from, displacement) = self.course(point);
        let share = nearest(&self.solid, &from, &displacement);
        let at = from + displacement * share;
        let z = |pose: &ToolPose, across: &[Vector3<f64>; 2]| Vector3::new(across[0].z, across[1].z, pose.axis.z);
        let up = z(&self.start, &self.across[0]).lerp(&z(&self.end, &self.across[1]), share);
        let rho = at.x.hypot_fast(at.y);
        let (out, below) = (rho - self.solid.flat(), self.solid.corner - at.z);
        let outwards = if rho > 0.0 { (at.x * up.x + at.y * up.y) / rho } else { up.x.hypot(up.y) };
        let (edge, slope) = if out > 0.0 && below > 0.0 {
            let edge = out.hypot_fast(below);
            (edge, (out * outwards - below * up.z) / edge)
        } else if out > below {
            (out, outwards)
        } else {
            (below, -up.z)
        };
        Distance { value: edge - self.solid.corner, slope }
    }

    /// Extends the sweep to another pose if the motion continues straight on: the body is that of both motions. Returns whether it does.
    pub(super) fn extend(&mut self, solid: Solid, start: &ToolPose, end: &ToolPose) -> bool {
        let (before, now) = (self.end.tip - self.start.tip, end.tip - start.tip);
        let goes_on = self.displacement.is_some()
            && self.solid == solid
            && self.end == *start
            && start.axis.angle(&end.axis) < STILL
            && before.dot(&now) > 0.0
            && before.cross(&now).norm_squared() <= STRAIGHT * STRAIGHT * now.norm_squared();
        if goes_on {
            *self = Self::new(solid, self.start, ToolPose { tip: end.tip, axis: self.start.axis });
        }
        goes_on
    }

    /// Whether a displacement (m) to a tip leads straight on from the end of this motion.
    pub(super) fn leads_to(&self, tip: &Vector3<f64>, displacement: &Vector3<f64>) -> bool {
        let own = self.end.tip - self.start.tip;
        self.displacement.is_some()
            && (self.end.tip + displacement - tip).norm_squared() <= STRAIGHT * STRAIGHT
            && own.dot(displacement) > 0.0
            && own.cross(displacement).norm_squared() <= 1e-6 * own.norm_squared() * displacement.norm_squared() * 1e-6
    }

    /// The normal of a plane through the tip at the start: the displacement across the axis. Apart from what the cutter at the start has
    /// removed, only points on its positive side can be cut. `None` if the cutter descends along its axis.
    pub(super) fn ahead(&self) -> Option<Vector3<f64>> {
        let displacement = self.end.tip - self.start.tip;
        let along = displacement.dot(&self.start.axis);
        let across = displacement - self.start.axis.into_inner() * along;
        (self.displacement.is_some() && along >= -1e-9 * across.norm()).then_some(across)
    }

    /// Points such that everything that it cuts below a height (m) is within a radius of them.
    pub(super) fn spine(&self, top: f64) -> [Vector3<f64>; 4] {
        let [low, high] = [&self.start, &self.end].map(|pose| {
            // A horizontal tool reaches through any stock.
            let length = ((top - pose.tip.z + self.solid.radius) / pose.axis.z.max(1e-2)).clamp(0.0, LONGEST);
            [pose.tip, pose.tip + pose.axis.into_inner() * length]
        });
        [low[0], low[1], high[0], high[1]]
    }
}

/// Longest tool, m.
const LONGEST: f64 = 10.0;

/// Share of a displacement at which a point is nearest to the cutter: the distance is convex along it.
#[inline]
fn nearest(solid: &Solid, from: &Vector3<f64>, displacement: &Vector3<f64>) -> f64 {
    let square = displacement.x * displacement.x + displacement.y * displacement.y;
    if displacement.z * displacement.z <= 1e-18 * square {
        // The point nearest to the axis is nearest to the cutter.
        return if square > 0.0 {
            (-(from.x * displacement.x + from.y * displacement.y) / square).clamp(0.0, 1.0)
        } else {
            0.0
        };
    }
    if square <= 1e-18 * displacement.z * displacement.z {
        return if displacement.z > 0.0 { 1.0 } else { 0.0 };
    }
    nearest_by_newton(solid, from, displacement, square)
        .unwrap_or_else(|| nearest_of_ramp(solid, from, displacement, square))
}

/// Accuracy of the position, m: the distance has an error of its square over twice a radius.
const CLOSE: f64 = 1e-5;

/// The same by Newton's method on the derivative, within a bracket, from where the point is nearest to the axis; `None` deep in the
/// cutter, where the derivative of the distance jumps.
#[inline]
fn nearest_by_newton(solid: &Solid, from: &Vector3<f64>, displacement: &Vector3<f64>, square: f64) -> Option<f64> {
    const NEWTON_STEPS: usize = 10;
    let flat = solid.flat();
    let close = CLOSE / (square + displacement.z * displacement.z).sqrt();
    let axis = -(from.x * displacement.x + from.y * displacement.y) / square;
    let mut share = axis.clamp(0.0, 1.0);
    let (mut low, mut high) = (0.0, 1.0);
    let mut over_rim = false;
    for _ in 0..NEWTON_STEPS {
        let at = from + displacement * share;
        let rho = at.x.hypot_fast(at.y);
        let (out, below) = (rho - flat, solid.corner - at.z);
        let outwards = if rho > 0.0 { (at.x * displacement.x + at.y * displacement.y) / rho } else { square.sqrt() };
        let bend = if rho > 0.0 { (square - outwards * outwards) / rho } else { 0.0 };
        let (slope, bend) = if below > 0.0 && (out > 0.0 || over_rim) {
            let out = out.max(0.0);
            let edge = out.hypot_fast(below);
            let slope = (out * outwards - below * displacement.z) / edge;
            (slope, (outwards * outwards + out * bend + displacement.z * displacement.z - slope * slope) / edge)
        } else if below > 0.0 {
            // Below the flat the distance decreases evenly up to its rim.
            over_rim = true;
            (-displacement.z, 0.0)
        } else if out > 0.0 {
            (outwards, bend)
        } else {
            return None;
        };
        if (slope >= 0.0 && share <= 0.0) || (slope <= 0.0 && share >= 1.0) {
            return Some(share);
        }
        *(if slope < 0.0 { &mut low } else { &mut high }) = share;
        let next = if bend > 0.0 {
            share - slope / bend
        } else {
            let least = (from.x + displacement.x * axis).powi(2) + (from.y + displacement.y * axis).powi(2);
            axis - slope.signum() * ((flat * flat - least).max(0.0) / square).sqrt()
        };
        // An end that was evaluated before is not used at once.
        let next = match next {
            next if next <= low && low > 0.0 || next >= high && high < 1.0 => 0.5 * (low + high),
            next => next.clamp(0.0, 1.0),
        };
        if (next - share).abs() < close {
            return Some(next);
        }
        share = next;
    }
    None
}

/// Where the derivative of a convex distance changes sign: by false position, with halving where that is slow.
fn nearest_of_ramp(solid: &Solid, from: &Vector3<f64>, displacement: &Vector3<f64>, square: f64) -> f64 {
    let flat = solid.flat();
    let derivative = |share: f64| {
        let at = from + displacement * share;
        let rho = at.x.hypot_fast(at.y);
        let outwards = if rho > 0.0 { (at.x * displacement.x + at.y * displacement.y) / rho } else { square.sqrt() };
        let (out, below) = (rho - flat, solid.corner - at.z);
        if out > 0.0 && below > 0.0 {
            (out * outwards - below * displacement.z) / out.hypot_fast(below)
        } else if out > below {
            outwards
        } else {
            -displacement.z
        }
    };
    let (mut low, mut high) = (0.0, 1.0);
    let (mut at_low, mut at_high) = (derivative(low), derivative(high));
    if at_low >= 0.0 {
        return low;
    }
    if at_high <= 0.0 {
        return high;
    }
    const BRACKETINGS: usize = 24;
    let close = CLOSE / (square + displacement.z * displacement.z).sqrt();
    for round in 0..BRACKETINGS {
        let middle = if round % 3 == 2 { 0.5 * (low + high) } else { low + (high - low) * at_low / (at_low - at_high) };
        let at = derivative(middle);
        if at.abs() < 1e-3 * close {
            return middle;
        }
        if at < 0.0 {
            (low, at_low) = (middle, at);
        } else {
            (high, at_high) = (middle, at);
        }
        if high - low < close {
            break;
        }
    }
    low + (high - low) * at_low / (at_low - at_high)
}
