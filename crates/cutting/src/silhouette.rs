//! The places along the profile at which the set of cutting arcs changes.
//!
//! Between these breaks the arc integrals are smooth in κ (or in height), apart from square roots at the breaks, for
//! which the quadrature is made. An arc appears, vanishes or closes where a ring touches the boundary of a condition.
//! Another condition becomes the limiting one where two boundaries cross on the envelope. A break counts only if its
//! point is on the cutting patch.

use super::patch::Patch;
use super::quadrature::Interval;
use super::ring::{HalfSpace, Ring};
use super::root::increasing_root;
use nalgebra::Vector3;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// The largest number of breaks of a profile: its two ends, 4 from the top of the stock, 2 from the facing condition, 2
/// from both, and the ends and a few turning points of the neighbouring pass's boundary.
const MOST_BREAKS: usize = 20;

/// A point farther outside than this (m, and as a cosine) is not on the patch; less may be rounding.
const OFF_PATCH: f64 = 1e-9;

/// Intervals shorter than this (rad, or share of the cylinder's height) have a negligible force.
const NO_CHUNK: f64 = 1e-12;

/// A facing arc that opens at less than this κ (rad) needs a second interval to unfold.
const SMALL: f64 = 0.05;

/// An interval shorter than this share of the longest gets the short rule.
const SHORT: f64 = 0.1;

/// Sorted break positions.
pub(super) struct Breaks {
    at: [f64; MOST_BREAKS],
    len: usize,
    range: (f64, f64),
}

impl Breaks {
    fn new(lo: f64, hi: f64) -> Self {
        let mut breaks = Breaks { at: [0.0; MOST_BREAKS], len: 0, range: (lo, hi) };
        breaks.push(lo);
        breaks.push(hi);
        breaks
    }

    fn holds(&self, at: f64) -> bool {
        at > self.range.0 && at < self.range.1
    }

    fn push(&mut self, at: f64) {
        if self.len < MOST_BREAKS {
            self.at[self.len] = at;
            self.len += 1;
        }
    }

    /// The intervals between breaks whose middle cuts; then the whole interval cuts.
    pub(super) fn intervals_where(mut self, cuts: impl Fn(f64) -> bool) -> impl Iterator<Item = Interval> {
        self.at[..self.len].sort_unstable_by(f64::total_cmp);
        let (mut intervals, mut len, mut longest) = ([(0.0, 0.0); MOST_BREAKS], 0, 0.0f64);
        for pair in self.at[..self.len].windows(2) {
            let (lo, hi) = (pair[0], pair[1]);
            if hi - lo > NO_CHUNK * self.range.1 && cuts(0.5 * (lo + hi)) {
                intervals[len] = (lo, hi);
                len += 1;
                longest = longest.max(hi - lo);
            }
        }
        intervals.into_iter().take(len).map(move |(lo, hi)| Interval { lo, hi, short: hi - lo < SHORT * longest })
    }
}

impl Patch<'_> {
    /// Breaks in κ along the corner.
    pub(super) fn corner_breaks(&self) -> Breaks {
        let mut breaks = Breaks::new(0.0, FRAC_PI_2);
        let flat = self.radius - self.corner;
        let space = &self.top;
        for (sign, angle) in [(1.0, opposite(space.inward)), (-1.0, space.inward)] {
            // offset + g·r(1 − cos κ) ± slope·(flat + r sin κ) = 0.
            let (c, s) = (-space.direction.z * self.corner, sign * space.slope * self.corner);
            let rest = space.offset + space.direction.z * self.corner + sign * space.slope * flat;
            let cosine = -rest / c.hypot(s);
            if cosine.abs() > 1.0 {
                continue;
            }
            let (mid, half) = (s.atan2(c), cosine.acos());
            for kappa in [mid - half, mid + half].map(|a| a.rem_euclid(TAU)) {
                if breaks.holds(kappa) && self.cuts(&self.corner_ring(kappa), angle) {
                    breaks.push(kappa);
                }
            }
        }
        // The foremost (or rearmost) point of the ring starts (or stops) to face the feed.
        let kappa = (self.feed_along.abs() / self.feed_across).atan();
        let angle = (self.feed_along.signum(), 0.0);
        if breaks.holds(kappa) && self.cuts(&self.corner_ring(kappa), angle) {
            breaks.push(kappa);
            if kappa < SMALL {
                // The arc still changes on the scale of this κ, so a break in between is added.
                breaks.push((kappa * FRAC_PI_2).sqrt());
            }
        }
        for side in [1.0, -1.0] {
            if let Some((kappa, point)) = self.silhouette_crossing(space, side)
                && breaks.holds(kappa)
                && self.in_stock(&point)
            {
                breaks.push(kappa);
            }
        }
        for along in self.neighbouring_pass.iter().flat_map(|pass| pass.breaks(&self.top, |along| self.ring(along))) {
            let kappa = along / self.corner;
            if breaks.holds(kappa) {
                breaks.push(kappa);
            }
        }
        breaks
    }

    /// Breaks in height along the cylinder above the corner; `None` if the cylinder is outside of the stock.
    pub(super) fn cylinder_breaks(&self) -> Option<Breaks> {
        let highest = (self.top.slope * self.radius - self.top.offset) / self.top.direction.z;
        if highest <= self.corner {
            return None;
        }
        let mut breaks = Breaks::new(self.corner, highest);
        let space = &self.top;
        // The rings that touch the boundary, then the points of the boundary on the silhouette (±90° from the feed).
        let extremes = [(opposite(space.inward), space.slope), (space.inward, -space.slope)];
        let silhouette = [((0.0, 1.0), space.direction.y), ((0.0, -1.0), -space.direction.y)];
        for (angle, reach) in extremes.into_iter().chain(silhouette) {
            let height = -(space.offset + reach * self.radius) / space.direction.z;
            if breaks.holds(height) && self.cuts(&self.cylinder_ring(height), angle) {
                breaks.push(height);
            }
        }
        for along in self.neighbouring_pass.iter().flat_map(|pass| pass.breaks(&self.top, |along| self.ring(along))) {
            let height = along + self.corner * (1.0 - FRAC_PI_2);
            if breaks.holds(height) {
                breaks.push(height);
            }
        }
        Some(breaks)
    }

    /// Whether a point of a ring lies on the cutting patch or its rim.
    fn cuts(&self, ring: &Ring, angle: (f64, f64)) -> bool {
        self.facing(ring, angle.0) > -OFF_PATCH && self.in_stock(&ring.point(angle))
    }

    fn in_stock(&self, point: &Vector3<f64>) -> bool {
        self.top.value(point) < OFF_PATCH
    }

    /// Crossing of the silhouette seen along the feed (h = 0) with a stock boundary, on one side.
    ///
    /// The silhouette of a convex body is a convex curve. Its distance from the boundary therefore only grows with the
    /// angle between its normal and the direction into the material.
    fn silhouette_crossing(&self, space: &HalfSpace, side: f64) -> Option<(f64, Vector3<f64>)> {
        let feed = Vector3::new(self.feed_across, 0.0, self.feed_along);
        let across = feed.cross(&space.direction) * side;
        let normal = |theta: f64| across * theta.sin() - space.direction * theta.cos();
        let point = |n: &Vector3<f64>| {
            let flat = self.radius - self.corner;
            // A ball has no flat, so the direction of its normal has no effect.
            let over_flat = if flat > 0.0 { flat / (n.x * n.x + n.y * n.y).sqrt() } else { 0.0 };
            let reach = over_flat + self.corner;
            Vector3::new(reach * n.x, reach * n.y, self.corner * (1.0 + n.z))
        };
        let theta = increasing_root(0.0, PI, |theta| space.value(&point(&normal(theta))))?;
        let n = normal(theta);
        (n.z < 0.0).then(|| ((-n.z).min(1.0).acos(), point(&n)))
    }
}

fn opposite((cos, sin): (f64, f64)) -> (f64, f64) {
    (-cos, -sin)
}
