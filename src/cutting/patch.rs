//! The part of the cutter's envelope that cuts, ring by ring, in the cutter frame.
//!
//! A ring is the circle at one profile angle κ (on the corner) or one height (on the cylinder
//! above it). A point of it cuts where it lies inside the stock (below its top, and beside its
//! edge in up and down milling) and where it faces the feed (chip thickness h > 0). Each condition
//! keeps one arc of the ring; what cuts is their intersection.

use nalgebra::Vector3;
use std::f64::consts::{PI, TAU};

/// A circle of the envelope about the tool axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ring {
    /// Sine and cosine of the profile angle κ: the outward normal's part across the axis, and
    /// minus its part along it.
    pub(super) sin: f64,
    pub(super) cos: f64,
    /// Radius and height above the tip, m.
    pub(super) radius: f64,
    pub(super) height: f64,
}

impl Ring {
    pub(super) fn point(&self, (cos, sin): (f64, f64)) -> Vector3<f64> {
        Vector3::new(self.radius * cos, self.radius * sin, self.height)
    }
}

/// Points p (from the tip) with `offset + direction·p < 0`.
#[derive(Clone, Copy, Debug)]
pub(super) struct HalfSpace {
    /// Unit vector out of the material, square to the feed.
    pub(super) direction: Vector3<f64>,
    pub(super) offset: f64,
    /// Length of `direction` across the tool axis, and the way into the material there.
    pub(super) slope: f64,
    pub(super) inward: (f64, f64),
    angle: f64,
}

impl HalfSpace {
    pub(super) fn new(direction: Vector3<f64>, offset: f64) -> Self {
        let slope = direction.x.hypot(direction.y);
        let inward = if slope > 0.0 { (-direction.x / slope, -direction.y / slope) } else { (1.0, 0.0) };
        let angle = inward.1.atan2(inward.0);
        HalfSpace { direction, offset, slope, inward, angle }
    }

    pub(super) fn value(&self, point: &Vector3<f64>) -> f64 {
        self.offset + self.direction.dot(point)
    }
}

/// The cutter's envelope against the stock.
#[derive(Clone, Copy, Debug)]
pub(super) struct Patch {
    /// Radius of the cylinder and of the corner, m.
    pub(super) radius: f64,
    pub(super) corner: f64,
    /// The feed direction in the cutter frame is (across, 0, along).
    pub(super) feed_across: f64,
    pub(super) feed_along: f64,
    pub(super) top: HalfSpace,
    pub(super) side: Option<HalfSpace>,
}

/// End of an arc: its angle from the feed towards +y, with cosine and sine.
#[derive(Clone, Copy, Debug)]
struct End {
    angle: f64,
    cos: f64,
    sin: f64,
}

/// Integrals over the cutting arcs of a ring: 1, cos, sin, cos², sin·cos.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Moments {
    pub(super) one: f64,
    pub(super) cos: f64,
    pub(super) sin: f64,
    pub(super) cos_cos: f64,
    pub(super) sin_cos: f64,
}

/// Three conditions leave at most three separate arcs of a circle, cut once more at ±π.
const MOST_ARCS: usize = 4;

/// Disjoint arcs within [−π, π].
struct Arcs {
    ends: [(End, End); MOST_ARCS],
    len: usize,
}

impl Patch {
    pub(super) fn corner_ring(&self, kappa: f64) -> Ring {
        let (sin, cos) = kappa.sin_cos();
        Ring { sin, cos, radius: self.radius - self.corner + self.corner * sin, height: self.corner * (1.0 - cos) }
    }

    pub(super) fn cylinder_ring(&self, height: f64) -> Ring {
        Ring { sin: 1.0, cos: 0.0, radius: self.radius, height }
    }

    /// Component of the outward normal along the feed: chip thickness over feed per tooth.
    pub(super) fn facing(&self, ring: &Ring, cos: f64) -> f64 {
        self.feed_across * ring.sin * cos - self.feed_along * ring.cos
    }

    /// The conditions of the stock.
    pub(super) fn stock(&self) -> impl Iterator<Item = &HalfSpace> {
        std::iter::once(&self.top).chain(&self.side)
    }

    /// Moments over the cutting arcs; `None` where the ring does not cut.
    #[inline]
    pub(super) fn moments(&self, ring: &Ring) -> Option<Moments> {
        let mut arcs = self.facing_arc(ring)?;
        for space in self.stock() {
            arcs.keep_inside(space, ring);
        }
        (arcs.len > 0).then(|| arcs.moments())
    }

    fn facing_arc(&self, ring: &Ring) -> Option<Arcs> {
        let (level, amplitude) = (self.feed_along * ring.cos, self.feed_across * ring.sin);
        if level >= amplitude {
            return None;
        }
        let (angle, cos) = if level <= -amplitude {
            (PI, -1.0)
        } else {
            let cos = level / amplitude;
            (cos.acos(), cos)
        };
        let sin = sine(cos);
        let arc = (End { angle: -angle, cos, sin: -sin }, End { angle, cos, sin });
        Some(Arcs { ends: [arc; MOST_ARCS], len: 1 })
    }
}

impl Arcs {
    /// Intersects with the arc of the ring inside a half-space.
    #[inline]
    fn keep_inside(&mut self, space: &HalfSpace, ring: &Ring) {
        let level = space.offset + space.direction.z * ring.height;
        let amplitude = space.slope * ring.radius;
        if level >= amplitude {
            self.len = 0;
            return;
        }
        if level <= -amplitude {
            return;
        }
        let cos = level / amplitude;
        let (half, sin) = (cos.acos(), sine(cos));
        let (mid_cos, mid_sin) = space.inward;
        let lo =
            End { angle: space.angle - half, cos: mid_cos * cos + mid_sin * sin, sin: mid_sin * cos - mid_cos * sin };
        let hi =
            End { angle: space.angle + half, cos: mid_cos * cos - mid_sin * sin, sin: mid_sin * cos + mid_cos * sin };
        let mut kept = Arcs { ends: self.ends, len: 0 };
        for &(from, to) in &self.ends[..self.len] {
            for turn in [-TAU, 0.0, TAU] {
                let (lo, hi) = (lo.turned(turn), hi.turned(turn));
                let from = if lo.angle > from.angle { lo } else { from };
                let to = if hi.angle < to.angle { hi } else { to };
                if to.angle > from.angle && kept.len < MOST_ARCS {
                    kept.ends[kept.len] = (from, to);
                    kept.len += 1;
                }
            }
        }
        *self = kept;
    }

    fn moments(&self) -> Moments {
        let mut sum = Moments::default();
        for (from, to) in &self.ends[..self.len] {
            let span = to.angle - from.angle;
            sum.one += span;
            sum.cos += to.sin - from.sin;
            sum.sin += from.cos - to.cos;
            sum.cos_cos += 0.5 * (span + to.sin * to.cos - from.sin * from.cos);
            sum.sin_cos += 0.5 * (to.sin * to.sin - from.sin * from.sin);
        }
        sum
    }
}

impl End {
    fn turned(self, by: f64) -> End {
        End { angle: self.angle + by, ..self }
    }
}

fn sine(cos: f64) -> f64 {
    ((1.0 - cos) * (1.0 + cos)).max(0.0).sqrt()
}
