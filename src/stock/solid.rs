//! The body of a cutter: a bull-nose of revolution about its axis, going on upwards without end.

use crate::cutting::Cutter;

/// A cutter as a solid: a cylinder whose lower edge is rounded. Flat (corner 0) and ball (corner = radius) included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solid {
    /// Radius, m.
    pub radius: f64,
    /// Radius of the rounded corner, m.
    pub corner: f64,
}

impl Solid {
    /// The envelope of a cutter.
    #[must_use]
    pub fn of(cutter: &Cutter) -> Self {
        Self { radius: cutter.radius(), corner: cutter.corner_radius }
    }

    /// Radius of the flat bottom, m.
    #[must_use]
    pub fn flat(&self) -> f64 {
        self.radius - self.corner
    }

    /// Signed distance (m) of a point at `across` the axis and `up` along it from the tip: below zero inside. Convex, and no
    /// steeper than one.
    #[inline]
    #[must_use]
    pub fn distance(&self, across: f64, up: f64) -> f64 {
        let (out, below) = (across - self.flat(), self.corner - up);
        let edge = if out > 0.0 && below > 0.0 { out.hypot_fast(below) } else { out.max(below) };
        edge - self.corner
    }

    /// Height of the lower surface over the tip at a distance from the axis of at most the radius, m.
    #[inline]
    #[must_use]
    pub fn height(&self, across: f64) -> f64 {
        let out = (across - self.flat()).max(0.0);
        self.corner - (self.corner * self.corner - out * out).max(0.0).sqrt()
    }
}

/// `hypot` without its care for overflow, which lengths of machines do not need.
pub(super) trait HypotFast {
    fn hypot_fast(self, other: f64) -> f64;
}

impl HypotFast for f64 {
    #[inline(always)]
    fn hypot_fast(self, other: f64) -> f64 {
        (self * self + other * other).sqrt()
    }
}
