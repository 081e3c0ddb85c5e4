//! The body of a cutter: a bull-nose of revolution about its axis, without an upper end.

use deflex_cutting::Cutter;

/// A cutter as a solid: a cylinder whose lower edge is rounded. Flat (corner 0) and ball (corner = radius) included.
///
/// # Examples
/// ```
/// use deflex_cutting::Cutter;
/// use deflex_stock::Solid;
///
/// let ball = Solid::of(&Cutter { diameter: 0.01, corner_radius: 5e-3, teeth: 2, helix: 0.5 });
/// assert_eq!((ball, ball.flat()), (Solid { radius: 5e-3, corner: 5e-3 }, 0.0)); // m
/// assert!(ball.height(0.0).abs() < 1e-12 && (ball.height(5e-3) - 5e-3).abs() < 1e-12); // m above the tip
/// ```
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

    /// Signed distance (m) of a point that is `across` (m) from the axis and `up` (m) above the tip: negative inside. It is convex, and its
    /// slope is at most one.
    #[inline]
    #[must_use]
    pub(crate) fn distance(&self, across: f64, up: f64) -> f64 {
        let (out, below) = (across - self.flat(), self.corner - up);
        let edge = if out > 0.0 && below > 0.0 { out.hypot_fast(below) } else { out.max(below) };
        edge - self.corner
    }

    /// Height (m) of the lower surface above the tip, at a distance (m) from the axis that is at most the radius.
    #[inline]
    #[must_use]
    pub fn height(&self, across: f64) -> f64 {
        let out = (across - self.flat()).max(0.0);
        self.corner - (self.corner * self.corner - out * out).max(0.0).sqrt()
    }
}

/// `hypot` without a guard against overflow, which the lengths in a machine cannot cause.
pub(super) trait HypotFast {
    fn hypot_fast(self, other: f64) -> f64;
}

impl HypotFast for f64 {
    #[inline(always)]
    fn hypot_fast(self, other: f64) -> f64 {
        (self * self + other * other).sqrt()
    }
}
