//! A cutter's front as it stands in the stock.

use super::dexel::Stock;
use super::front::{Engaged, Front, Ring};
use super::history::Moment;
use super::refine::Sum;
use super::sweep::ToolPose;
use crate::cutting::ForceParts;
use nalgebra::Vector3;
use std::f64::consts::TAU;

/// Below this sine of its angle to the feed the tool plunges: φ is counted from anywhere.
const PLUNGE: f64 = 1e-6;

/// Sine of a ramp from which the flat bottom counts as cutting: half a degree.
const PLUNGE_OF_BOTTOM: f64 = 0.01;

/// A cutter in the stock.
pub(super) struct View<'a> {
    pub(super) front: &'a Front,
    stock: &'a Stock,
    moment: &'a Moment,
    pose: &'a ToolPose,
    x: Vector3<f64>,
    y: Vector3<f64>,
    /// The feed across the axis, and along it.
    pub(super) feed: [f64; 2],
    /// What a chip counts beside a depth, m.
    scale: f64,
    /// The sweep that leads here.
    before: u32,
}

impl<'a> View<'a> {
    pub(super) fn new(
        front: &'a Front,
        (stock, moment): (&'a Stock, &'a Moment),
        pose: &'a ToolPose,
        way: &Vector3<f64>,
        size: f64,
    ) -> Self {
        let feed = way / size;
        let along = feed.dot(&pose.axis);
        let across = feed - pose.axis.into_inner() * along;
        let sine = across.norm();
        let x = if sine > PLUNGE {
            across / sine
        } else {
            let helper = if pose.axis.x.abs() < 0.7 { Vector3::x() } else { Vector3::y() };
            pose.axis.cross(&helper).normalize()
        };
        let feed = [if sine > PLUNGE { sine } else { 0.0 }, along];
        let before = moment.before(&pose.tip, way);
        // About as far as a point is from the silhouette; where the way bends, the depth over what the move before has left
        // goes as chip times way.
        let scale = if before > 0 { front.solid.radius } else { size.min(front.solid.radius) };
        Self { front, stock, moment, pose, x, y: pose.axis.cross(&x), feed, scale, before }
    }

    pub(super) fn point(&self, across: f64, up: f64, (cos, sin): (f64, f64)) -> Vector3<f64> {
        self.pose.tip + (self.x * cos + self.y * sin) * across + self.pose.axis.into_inner() * up
    }

    /// Share of the feed that goes into the surface.
    pub(super) fn chip(&self, ring: &Ring, angle: (f64, f64)) -> f64 {
        let chip = self.feed[0] * ring.sin * angle.0 - self.feed[1] * ring.cos;
        // On grid lines that are the silhouette rounding is not to decide.
        if chip.abs() < 1e-12 { 0.0 } else { chip }
    }

    /// How deep a point is in material, m, and whose surface that is from.
    pub(super) fn depth(&self, point: &Vector3<f64>) -> (f64, u32) {
        self.stock.depth_at(self.moment, point, self.before)
    }

    /// How deep a point is in what one sweep, or the blank, leaves.
    pub(super) fn depth_of(&self, whose: u32, point: &Vector3<f64>) -> f64 {
        self.stock.depth_of(self.moment, whose, point)
    }

    /// Above zero where there is material and a chip of it.
    pub(super) fn level(&self, chip: f64, depth: f64) -> f64 {
        depth.min(chip * self.scale)
    }

    pub(super) fn angle(&self, column: f64) -> (f64, f64) {
        self.front.angle(column)
    }

    pub(super) fn finish(&self, sum: Sum) -> Engaged {
        let world = |v: Vector3<f64>| self.x * v.x + self.y * v.y + self.pose.axis.into_inner() * v.z;
        let force = ForceParts { edge: world(sum.edge), cutting: world(sum.cutting) };
        let (mut depth, mut arc) = (0.0, 0.0);
        if let Some([low, high]) = sum.rows {
            let [low, high] = [low, high].map(|row| self.front.ring(row).up);
            depth = high - low;
            arc = self.arc(0.5 * (low + high));
        }
        Engaged { force, bound: sum.bound, depth, arc, section: sum.section, bottom: self.bottom() }
    }

    /// Angle that is engaged at a height, rad.
    fn arc(&self, up: f64) -> f64 {
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
        (0..depths.len()).map(|i| share(depths[i], depths[(i + 1) % depths.len()])).sum::<f64>() * step
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
