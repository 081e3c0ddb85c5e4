//! A cutter's front at a pose in the stock.

use super::dexel::Stock;
use super::front::{Front, Ring};
use super::history::Moment;
use super::sweep::ToolPose;
use nalgebra::Vector3;

/// Below this sine of its angle to the feed the tool plunges: φ then has no natural zero.
const PLUNGE: f64 = 1e-6;

/// Sines of the feed's angle to the axis between which the edge force along the cylinder sets in. Below them, a chip is thinner than the
/// radius of the edges (a twentieth of a usual feed per tooth is 3 µm, the radius 5 to 15 µm); above them it is as thick.
const PRESSES: [f64; 2] = [0.05, 0.2];

/// A cutter in the stock.
pub(super) struct View<'a> {
    pub(super) front: &'a Front,
    pub(super) stock: &'a Stock,
    pub(super) moment: &'a Moment,
    pub(super) pose: &'a ToolPose,
    pub(super) x: Vector3<f64>,
    pub(super) y: Vector3<f64>,
    /// The feed across the axis, and along it.
    pub(super) feed: [f64; 2],
    /// Share of the edge force along the cylinder.
    pub(super) side: f64,
    /// Length by which a share of the feed is compared with a depth, m.
    pub(super) scale: f64,
    /// Number of the sweep that ends here, if the motion continues straight on from it.
    pub(super) before: u32,
}

impl<'a> View<'a> {
    pub(super) fn new(
        front: &'a Front,
        (stock, moment): (&'a Stock, &'a Moment),
        pose: &'a ToolPose,
        displacement: &Vector3<f64>,
        size: f64,
    ) -> Self {
        let feed = displacement / size;
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
        let side = ((sine - PRESSES[0]) / (PRESSES[1] - PRESSES[0])).clamp(0.0, 1.0);
        let before = moment.before(&pose.tip, displacement);
        // About the distance of a point from the silhouette. Where the path bends, the depth over what the motion before has left
        // grows as chip times displacement.
        let scale = if before > 0 { front.solid.radius } else { size.min(front.solid.radius) };
        Self { front, stock, moment, pose, x, y: pose.axis.cross(&x), feed, side, scale, before }
    }

    pub(super) fn point(&self, across: f64, up: f64, (cos, sin): (f64, f64)) -> Vector3<f64> {
        self.pose.tip + (self.x * cos + self.y * sin) * across + self.pose.axis.into_inner() * up
    }

    /// Share of the feed that goes into the surface.
    pub(super) fn chip(&self, ring: &Ring, angle: (f64, f64)) -> f64 {
        let chip = self.feed[0] * ring.sin * angle.0 - self.feed[1] * ring.cos;
        // Where a grid line is the silhouette, rounding must not decide.
        if chip.abs() < 1e-12 { 0.0 } else { chip }
    }

    /// Depth of a point in material, m, and the owner of the surface from which it counts.
    pub(super) fn depth(&self, point: &Vector3<f64>) -> (f64, u32) {
        self.stock.depth_at(self.moment, point, self.before)
    }

    /// Depth of a point in the material that one sweep, or the blank, leaves, m.
    pub(super) fn depth_of(&self, whose: u32, point: &Vector3<f64>) -> f64 {
        self.stock.depth_of(self.moment, whose, point)
    }

    /// Positive where there is material and a chip is cut from it.
    pub(super) fn level(&self, chip: f64, depth: f64) -> f64 {
        depth.min(chip * self.scale)
    }

    pub(super) fn angle(&self, column: f64) -> (f64, f64) {
        self.front.angle(column)
    }
}
