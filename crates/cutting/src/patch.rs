//! The part of the cutter's envelope that cuts, ring by ring, in the cutter frame.
//!
//! A ring is the circle at one profile angle κ (on the corner) or at one height (on the cylinder above it). A point of
//! a ring cuts if it is inside the stock (below its top and, in up and down milling, outside of the material that the
//! neighbouring pass has removed), and if it faces the feed (chip thickness h > 0). Each condition allows an arc of the
//! ring; the cutting part is the intersection of the arcs.

use super::adjacent::AdjacentPass;
use super::ring::{Arc, End, HalfSpace, Ring};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// The cutter's envelope and the conditions under which its points cut.
#[derive(Clone, Copy, Debug)]
pub(super) struct Patch<'a> {
    /// Radius of the cylinder and of the corner, m.
    pub(super) radius: f64,
    pub(super) corner: f64,
    /// The feed direction in the cutter frame is (across, 0, along).
    pub(super) feed_across: f64,
    pub(super) feed_along: f64,
    pub(super) top: HalfSpace,
    /// The neighbouring pass in up and down milling.
    pub(super) neighbouring_pass: Option<&'a AdjacentPass>,
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

/// The part of a ring that a condition allows.
enum Kept {
    Nothing,
    Arc(Arc),
    All,
}

impl Patch<'_> {
    pub(super) fn corner_ring(&self, kappa: f64) -> Ring {
        let (sin, cos) = kappa.sin_cos();
        let (r, flat) = (self.corner, self.radius - self.corner);
        Ring { sin, cos, radius: flat + r * sin, height: r * (1.0 - cos), along: r * kappa }
    }

    pub(super) fn cylinder_ring(&self, height: f64) -> Ring {
        Ring { sin: 1.0, cos: 0.0, radius: self.radius, height, along: self.along_shaft(height) }
    }

    /// The ring at a length of the profile, m.
    pub(super) fn ring(&self, along: f64) -> Ring {
        let corner = FRAC_PI_2 * self.corner;
        if along < corner {
            self.corner_ring(along / self.corner)
        } else {
            self.cylinder_ring(self.corner + along - corner)
        }
    }

    /// Length of the profile up to a height on the shaft, m.
    fn along_shaft(&self, height: f64) -> f64 {
        FRAC_PI_2 * self.corner + height - self.corner
    }

    /// Component of the outward normal along the feed: chip thickness over feed per tooth.
    pub(super) fn facing(&self, ring: &Ring, cos: f64) -> f64 {
        self.feed_across * ring.sin * cos - self.feed_along * ring.cos
    }

    /// Moments over the cutting arcs; `None` if the ring does not cut.
    #[inline]
    pub(super) fn moments(&self, ring: &Ring) -> Option<Moments> {
        let facing = self.facing_arc(ring)?;
        let top = self.top.arc(ring);
        let (mut sum, mut any) = (Moments::default(), false);
        let mut add = |arc: Arc| {
            any = true;
            sum.add(&arc);
        };
        overlaps(facing, &top, |arc| match self.neighbouring_pass {
            None => add(arc),
            Some(pass) => pass.left(ring, arc, &mut add),
        });
        any.then_some(sum)
    }

    /// The arc with a positive chip thickness, within [−π, π].
    fn facing_arc(&self, ring: &Ring) -> Option<Arc> {
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
        Some((End { angle: -angle, cos, sin: -sin }, End { angle, cos, sin }))
    }
}

impl HalfSpace {
    /// The arc of the ring that is inside the half-space.
    #[inline]
    fn arc(&self, ring: &Ring) -> Kept {
        let level = self.offset + self.direction.z * ring.height;
        let amplitude = self.slope * ring.radius;
        if level >= amplitude {
            return Kept::Nothing;
        }
        if level <= -amplitude {
            return Kept::All;
        }
        let cos = level / amplitude;
        let (half, sin) = (cos.acos(), sine(cos));
        let (mid_cos, mid_sin) = self.inward;
        let from =
            End { angle: self.angle - half, cos: mid_cos * cos + mid_sin * sin, sin: mid_sin * cos - mid_cos * sin };
        let to =
            End { angle: self.angle + half, cos: mid_cos * cos - mid_sin * sin, sin: mid_sin * cos + mid_cos * sin };
        Kept::Arc((from, to))
    }
}

/// Calls `f` with each part of an arc within [−π, π] that the condition allows.
#[inline]
fn overlaps(arc: Arc, kept: &Kept, mut f: impl FnMut(Arc)) {
    match kept {
        Kept::Nothing => {}
        Kept::All => f(arc),
        Kept::Arc((lo, hi)) => {
            for turn in [-TAU, 0.0, TAU] {
                let (start, stop) = (lo.angle + turn, hi.angle + turn);
                if start >= arc.1.angle || stop <= arc.0.angle {
                    continue;
                }
                let from = if start > arc.0.angle { End { angle: start, ..*lo } } else { arc.0 };
                let to = if stop < arc.1.angle { End { angle: stop, ..*hi } } else { arc.1 };
                f((from, to));
            }
        }
    }
}

impl Moments {
    fn add(&mut self, (from, to): &Arc) {
        let span = to.angle - from.angle;
        self.one += span;
        self.cos += to.sin - from.sin;
        self.sin += from.cos - to.cos;
        self.cos_cos += 0.5 * (span + to.sin * to.cos - from.sin * from.cos);
        self.sin_cos += 0.5 * (to.sin * to.sin - from.sin * from.sin);
    }
}

fn sine(cos: f64) -> f64 {
    ((1.0 - cos) * (1.0 + cos)).max(0.0).sqrt()
}
