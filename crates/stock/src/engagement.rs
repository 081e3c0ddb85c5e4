//! The part of a cutter's front that is in material, and the mean force on it.

use super::dexel::Stock;
use super::front::{Front, Ring};
use super::history::Moment;
use super::refine::{self, Sum};
use super::sweep::ToolPose;
use super::view::View;
use deflex_cutting::ForceParts;
use nalgebra::Vector3;
use std::f64::consts::TAU;

/// Sine of a ramp from which the flat bottom counts as cutting: half a degree.
const PLUNGE_OF_BOTTOM: f64 = 0.01;

/// The engaged part of a cutter.
///
/// # Examples
/// ```
/// use deflex_stock::Engaged;
///
/// // A cutter in the air.
/// assert_eq!((Engaged::default().depth, Engaged::default().section), (0.0, 0.0)); // m, m²
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Engaged {
    /// Mean force on the tool, linear in the feed per tooth, stock's axes.
    pub force: ForceParts,
    /// Bounds of the error of the force because of the rim of the engagement, for the same parts: N, N/m.
    pub bound: [f64; 2],
    /// Extent of the engaged part along the tool axis, m.
    pub depth: f64,
    /// Angle about the axis that is engaged at half that depth, rad.
    pub arc: f64,
    /// A point in the middle of the engaged part: at half that depth, in the middle of that angle, m, stock's axes.
    pub place: Vector3<f64>,
    /// Volume cut on each metre of feed, m².
    pub section: f64,
    /// Whether the flat bottom is pressed into material, for which the model has no force.
    pub bottom: bool,
}

impl Front {
    /// The engaged part of a cutter at a pose. `displacement` (m) is that of the motion to the pose; its direction is the feed.
    ///
    /// Call this before that motion is removed: on a straight motion no point of the front has been at the pose before.
    #[must_use]
    pub fn engaged(&self, stock: &Stock, pose: &ToolPose, displacement: &Vector3<f64>) -> Engaged {
        self.engaged_at(stock, &stock.now(), pose, displacement)
    }

    /// The same for the stock as it was at a moment since its history [is kept](Stock::keep_history).
    #[must_use]
    pub fn engaged_at(&self, stock: &Stock, moment: &Moment, pose: &ToolPose, displacement: &Vector3<f64>) -> Engaged {
        let size = displacement.norm();
        if size == 0.0 {
            return Engaged::default();
        }
        let view = View::new(self, (stock, moment), pose, displacement, size);
        let [low, high] = stock.blank().bounds();
        let reach = |k: usize| {
            let axis = pose.axis[k];
            axis * if axis > 0.0 { high[k] - pose.tip[k] } else { low[k] - pose.tip[k] }
        };
        // Highest point of the blank along the axis, seen from the tip; no farther than where a whole ring is above it.
        let axis = pose.axis;
        let over_top = high.z - pose.tip.z + self.solid.radius * axis.x.hypot(axis.y);
        let rings = if axis.z > 0.0 { over_top / axis.z } else { f64::INFINITY };
        let highest = (reach(0) + reach(1) + reach(2)).min(rings);
        if highest <= 0.0 {
            return Engaged::default();
        }
        let sum = refine::sum(&view, self.rows_below(highest));
        view.finish(sum)
    }
}

impl View<'_> {
    fn finish(&self, sum: Sum) -> Engaged {
        let world = |v: Vector3<f64>| self.x * v.x + self.y * v.y + self.pose.axis.into_inner() * v.z;
        let force = ForceParts { edge: world(sum.edge), cutting: world(sum.cutting) };
        let (mut depth, mut arc, mut place) = (0.0, 0.0, self.pose.tip);
        if let Some([low, high]) = sum.rows {
            let [low, high] = [low, high].map(|row| self.front.ring(row).up);
            depth = high - low;
            (arc, place) = self.arc(0.5 * (low + high));
        }
        Engaged { force, bound: sum.bound, depth, arc, place, section: sum.section, bottom: self.bottom() }
    }

    /// Engaged angle at a height, rad, and the point in its middle, m.
    fn arc(&self, up: f64) -> (f64, Vector3<f64>) {
        let solid = self.front.solid;
        let ring = if up < solid.corner {
            let cos = 1.0 - up / solid.corner;
            let sin = (1.0 - cos * cos).sqrt();
            Ring { sin, cos, across: solid.flat() + solid.corner * sin, up }
        } else {
            Ring { sin: 1.0, cos: 0.0, across: solid.radius, up }
        };
        let step = TAU / self.front.around as f64;
        let level = |angle: &(f64, f64)| match self.chip(&ring, *angle) {
            chip if chip <= 0.0 => chip,
            chip => self.level(chip, self.depth(&self.point(ring.across, ring.up, *angle)).0),
        };
        let depths: Vec<f64> = self.front.edges[..self.front.around].iter().map(level).collect();
        let share = |a: f64, b: f64| match (a > 0.0, b > 0.0) {
            (true, true) => 1.0,
            (false, false) => 0.0,
            (true, false) => a / (a - b),
            (false, true) => b / (b - a),
        };
        let arc = (0..depths.len()).map(|i| share(depths[i], depths[(i + 1) % depths.len()])).sum::<f64>() * step;
        let engaged = self.front.edges.iter().zip(&depths).filter(|(_, depth)| **depth > 0.0);
        let (cos, sin) = engaged.fold((0.0, 0.0), |sum, (edge, _)| (sum.0 + edge.0, sum.1 + edge.1));
        let size = f64::hypot(cos, sin).max(f64::MIN_POSITIVE);
        (arc, self.point(ring.across, up, (cos / size, sin / size)))
    }

    /// Whether the flat bottom goes down into material.
    fn bottom(&self) -> bool {
        let flat = self.front.solid.flat();
        if flat <= 0.0 || self.feed[1] > -PLUNGE_OF_BOTTOM {
            return false;
        }
        let inside = |across: f64, angle| self.stock.depth_at(self.moment, &self.point(across, 0.0, angle), 0).0 > 0.0;
        [0.3, 0.6, 0.95]
            .iter()
            .any(|share| (0..8).any(|k| inside(share * flat, self.angle(k as f64 * self.front.around as f64 / 8.0))))
    }
}
