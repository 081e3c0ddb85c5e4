//! The neighbouring pass: the same cutter has passed a stepover away, at the same depth, and has removed the material there.
//!
//! Seen along the feed, a cutter is a convex figure, its silhouette: the rim of the flat (an ellipse) grown by the corner radius, and
//! extended upwards along the axis. A point on the front of the cutter is in material if the silhouette a stepover away does not contain
//! it. On the front, this boundary is a curve over the angle of the silhouette: each point of the silhouette, moved by the stepover, is
//! followed along the feed to the front. The curve begins at the cusp between the passes.
//!
//! Both passes have the same deflection, so the curve stays at the same place on the cutter as in the programmed pose. It is computed
//! once, and interpolated by cubics between its nodes.

use super::Cutter;
use super::ring::{Arc, End, HalfSpace, Ring};
use super::root::increasing_root;
use nalgebra::Vector3;
use smallvec::SmallVec;
use std::f64::consts::FRAC_PI_2;

/// Number of intervals of the boundary.
const NODES: usize = 160;

/// How far above the programmed top of the stock the boundary is followed, in diameters: farther than any deflection.
const ABOVE: f64 = 1.0;

/// Accuracy of a position on the boundary, in intervals.
const CLOSE: f64 = 1e-9;

/// The boundary of the neighbouring pass on the cutter, in the cutter frame at the programmed pose.
#[derive(Clone, Debug)]
pub(super) struct AdjacentPass {
    flat: f64,
    corner: f64,
    /// The feed direction in the cutter frame is (across, 0, along).
    feed_across: f64,
    feed_along: f64,
    /// Vector to the cutter in the neighbouring pass, seen along the feed, m.
    stepover: [f64; 2],
    /// Side on which the neighbouring pass is: 1 or −1.
    side: f64,
    /// The boundary from the cusp on: length along the profile, m, and angle about the axis, rad.
    nodes: Vec<[f64; 2]>,
    /// Parts of the boundary along which the profile only rises or only falls.
    stretches: SmallVec<[Stretch; 4]>,
}

/// A part of the boundary. At each end: the position on the boundary, counted in intervals, and the length along the
/// profile, m.
#[derive(Clone, Copy, Debug)]
struct Stretch {
    from: (f64, f64),
    to: (f64, f64),
}

impl AdjacentPass {
    /// The pass a stepover `width` (m) away in the direction `to_pass`, a unit vector across the feed; `top` is the top of the stock. All
    /// vectors are in the cutter frame. `None` if that pass has removed nothing of what this one cuts.
    pub(super) fn new(
        cutter: &Cutter,
        (feed_across, feed_along): (f64, f64),
        top: &HalfSpace,
        (to_pass, width): (&Vector3<f64>, f64),
    ) -> Option<Self> {
        let mut pass = Self {
            flat: cutter.radius() - cutter.corner_radius,
            corner: cutter.corner_radius,
            feed_across,
            feed_along,
            stepover: [0.0; 2],
            side: 1.0,
            nodes: Vec::new(),
            stretches: SmallVec::new(),
        };
        let [x, y] = pass.seen(to_pass);
        pass.stepover = [x * width, y * width];
        pass.side = x.signum();
        let [up_x, up_y] = pass.seen(&top.direction);
        // The normal of the silhouette at its lowest point is vertical.
        let lowest = (pass.side * up_x).clamp(-1.0, 1.0).asin();
        let [x, y] = pass.near_silhouette(FRAC_PI_2);
        let above = top.offset + up_x * x + up_y * y - ABOVE * cutter.diameter;
        // On the shaft the height grows in proportion to the angle.
        let highest = FRAC_PI_2 + (-above / (up_y * cutter.radius())).max(0.0);
        if pass.held_by(highest) <= 0.0 {
            return None;
        }
        let cusp = increasing_root(lowest, highest, |angle| pass.held_by(angle)).unwrap_or(lowest);
        // The nodes are denser near the cusp, where profile and angle behave like square roots.
        let place = |k: usize| {
            let share = k as f64 / NODES as f64;
            cusp + (highest - cusp) * share * share
        };
        pass.nodes = (0..=NODES).map(|k| pass.node(place(k))).collect();
        pass.stretches = pass.stretches();
        Some(pass)
    }

    fn radius(&self) -> f64 {
        self.flat + self.corner
    }

    /// A point or direction of the cutter frame as seen along the feed.
    fn seen(&self, v: &Vector3<f64>) -> [f64; 2] {
        [v.y, self.feed_across * v.z - self.feed_along * v.x]
    }

    /// Width and height of the silhouette at the point whose normal has this angle to the downward axis, given by its
    /// sine and cosine. The height is counted from the tip.
    fn silhouette(&self, (sin, cos): (f64, f64)) -> [f64; 2] {
        let oblique = self.feed_along * self.feed_along;
        let rim = (sin * sin + oblique * cos * cos).sqrt();
        let over_rim = if rim > 0.0 { self.flat / rim } else { 0.0 };
        [sin * (self.corner + over_rim), self.corner * self.feed_across - cos * (self.corner + over_rim * oblique)]
    }

    /// A point on the side of this cutter's silhouette that faces away from the neighbouring pass. Below 90°, `angle`
    /// is that of the normal; above 90°, it is the height on the shaft in radii.
    fn near_silhouette(&self, angle: f64) -> [f64; 2] {
        let [x, y] = self.silhouette(angle.min(FRAC_PI_2).sin_cos());
        [-self.side * x, y + (angle - FRAC_PI_2).max(0.0) * self.radius()]
    }

    /// How far a point across the feed is above the silhouette's lower side, m; below zero outside of it.
    fn depth_in_silhouette(&self, [x, y]: [f64; 2]) -> f64 {
        const NEWTON_STEPS: usize = 40;
        let x = x.abs();
        if x >= self.radius() {
            return -x;
        }
        // The width as a function of the sine of the normal is concave: Newton's method from below approaches the root and never passes it.
        let oblique = self.feed_along * self.feed_along;
        let steepest = self.corner + if oblique > 0.0 { self.flat / oblique.sqrt() } else { f64::INFINITY };
        let mut sin = x / steepest;
        if self.corner > 0.0 {
            sin = sin.max((x - self.flat) / self.corner);
        }
        if self.flat > 0.0 {
            for _ in 0..NEWTON_STEPS {
                let square = sin * sin * (1.0 - oblique) + oblique;
                let rim = square.sqrt();
                if rim <= 0.0 {
                    break;
                }
                let missing = x - sin * (self.corner + self.flat / rim);
                let step = missing / (self.corner + self.flat * oblique / (square * rim));
                sin = (sin + step).min(1.0);
                if step <= 1e-13 {
                    break;
                }
            }
        }
        let [_, low] = self.silhouette((sin, (1.0 - sin * sin).max(0.0).sqrt()));
        y - low
    }

    /// A point of the boundary as seen along the feed.
    fn boundary(&self, angle: f64) -> [f64; 2] {
        let [x, y] = self.near_silhouette(angle);
        [x + self.stepover[0], y + self.stepover[1]]
    }

    /// Positive if the boundary is on this cutter.
    fn held_by(&self, angle: f64) -> f64 {
        self.depth_in_silhouette(self.boundary(angle))
    }

    /// Whether the cutter in the neighbouring pass has removed a point, given in the cutter frame.
    fn takes(&self, point: &Vector3<f64>) -> bool {
        let [x, y] = self.seen(point);
        self.depth_in_silhouette([x - self.stepover[0], y - self.stepover[1]]) > 0.0
    }

    /// The foremost point of this cutter on the line along the feed through a point of the boundary.
    fn front(&self, angle: f64) -> Vector3<f64> {
        let [x, y] = self.boundary(angle);
        let origin = Vector3::new(-self.feed_along * y, x, self.feed_across * y);
        self.foremost(&origin)
    }

    /// The foremost point of the cutter on the line along the feed through a point.
    ///
    /// The corner is the surface at a distance of its radius from a disk. Distance is convex along a line, so Newton's method from ahead
    /// approaches the foremost point and never passes it.
    fn foremost(&self, origin: &Vector3<f64>) -> Vector3<f64> {
        /// Accuracy of a point, as a share of the radius.
        const THERE: f64 = 1e-12;
        let (radius, corner) = (self.radius(), self.corner);
        let at = |x: f64| Vector3::new(origin.x + x * self.feed_across, origin.y, origin.z + x * self.feed_along);
        // On the shaft, the distance from the axis is the radius.
        let mut x = ((radius * radius - origin.y * origin.y).max(0.0).sqrt() - origin.x) / self.feed_across;
        if at(x).z >= corner {
            return at(x);
        }
        for _ in 0..64 {
            let p = at(x);
            let (across, below) = (p.x.hypot(p.y), corner - p.z);
            let out = (across - self.flat).max(0.0);
            let distance = out.hypot(below);
            let slope = (out * p.x * self.feed_across / across - below * self.feed_along) / distance;
            let step = (distance - corner) / slope;
            // On the silhouette the line only touches the cutter.
            if slope.is_nan() || slope <= 0.0 || step.abs() <= THERE * radius {
                break;
            }
            x -= step;
        }
        at(x)
    }

    /// Length along the profile to the boundary, m, and its angle about the axis, rad.
    fn node(&self, angle: f64) -> [f64; 2] {
        let point = self.front(angle);
        let across = point.x.hypot(point.y);
        let along = if point.z >= self.corner {
            FRAC_PI_2 * self.corner + point.z - self.corner
        } else {
            self.corner * (across - self.flat).max(0.0).atan2(self.corner - point.z)
        };
        [along, point.y.atan2(point.x)]
    }

    /// Profile and angle between the nodes, by the cubic through four of them.
    #[inline]
    fn at(&self, place: f64) -> [f64; 2] {
        let first = ((place - 1.0).max(0.0) as usize).min(NODES - 3);
        let t = place - first as f64;
        let [a, b, c, d] = [t, t - 1.0, t - 2.0, t - 3.0];
        let weights = [-b * c * d / 6.0, a * c * d / 2.0, -a * b * d / 2.0, a * b * c / 6.0];
        let of = |k: usize| weights.iter().zip(&self.nodes[first..]).map(|(weight, node)| weight * node[k]).sum();
        [of(0), of(1)]
    }

    fn stretches(&self) -> SmallVec<[Stretch; 4]> {
        let along = |k: usize| self.nodes[k][0];
        let (mut out, mut from) = (SmallVec::new(), (0.0, along(0)));
        for k in 1..NODES {
            let (before, after) = (along(k) - along(k - 1), along(k + 1) - along(k));
            if before * after < 0.0 {
                // The extremum of the parabola through three nodes.
                let place = k as f64 + 0.5 * (before + after) / (before - after);
                let turn = (place, self.at(place)[0]);
                out.push(Stretch { from, to: turn });
                from = turn;
            }
        }
        out.push(Stretch { from, to: (NODES as f64, along(NODES)) });
        out
    }

    /// Positions along the profile, m, at which the boundary begins, turns, or leaves the stock.
    pub(super) fn breaks(&self, top: &HalfSpace, ring: impl Fn(f64) -> Ring) -> impl Iterator<Item = f64> {
        let ends = self.stretches.iter().flat_map(|stretch| [stretch.from.1, stretch.to.1]);
        let over = |place: f64| {
            let [along, angle] = self.at(place);
            let (sin, cos) = angle.sin_cos();
            top.value(&ring(along).point((cos, sin)))
        };
        let out = self.root((0.0, over(0.0)), (NODES as f64, over(NODES as f64)), over);
        ends.chain(out.map(|place| self.at(place)[0]))
    }

    /// The position between two others at which a function changes its sign: by false position, with bisection where
    /// that is slow.
    #[inline]
    fn root(&self, mut low: (f64, f64), mut high: (f64, f64), f: impl Fn(f64) -> f64) -> Option<f64> {
        if low.1 * high.1 >= 0.0 {
            return None;
        }
        const BRACKETINGS: usize = 60;
        for round in 0..BRACKETINGS {
            let share = if round % 3 == 2 { 0.5 } else { low.1 / (low.1 - high.1) };
            let middle = low.0 + (high.0 - low.0) * share;
            let at = f(middle);
            let near = if at.signum() == low.1.signum() { &mut low } else { &mut high };
            let step = (near.0 - middle).abs();
            *near = (middle, at);
            if step < CLOSE || at == 0.0 {
                return Some(middle);
            }
        }
        Some(0.5 * (low.0 + high.0))
    }

    /// Calls `each` with the parts of a ring's arc whose material the neighbouring pass has left.
    #[inline]
    pub(super) fn left(&self, ring: &Ring, (from, to): Arc, mut each: impl FnMut(Arc)) {
        let mut ends: SmallVec<[End; 6]> = SmallVec::new();
        ends.push(from);
        let inside = |angle: &f64| *angle > from.angle && *angle < to.angle;
        for angle in self.stretches.iter().filter_map(|stretch| self.crossing(ring, stretch)).filter(inside) {
            let (sin, cos) = angle.sin_cos();
            ends.push(End { angle, cos, sin });
        }
        ends[1..].sort_unstable_by(|a, b| a.angle.total_cmp(&b.angle));
        ends.push(to);
        for pair in ends.windows(2) {
            let (sin, cos) = (0.5 * (pair[0].angle + pair[1].angle)).sin_cos();
            if !self.takes(&ring.point((cos, sin))) {
                each((pair[0], pair[1]));
            }
        }
    }

    /// Angle at which a stretch of the boundary crosses a ring, rad.
    fn crossing(&self, ring: &Ring, stretch: &Stretch) -> Option<f64> {
        let over = |along: f64| along - ring.along;
        let [low, high] = [stretch.from, stretch.to].map(|(place, along)| (place, over(along)));
        if low.1 * high.1 >= 0.0 {
            return None;
        }
        // Finds the interval by bisection: the profile is monotonic along a stretch.
        let (mut first, mut last) = (low.0.ceil() as usize, high.0.floor() as usize);
        let rising = high.1 > 0.0;
        let (begin, end) = (first, last);
        while first < last {
            let middle = (first + last) / 2;
            if (over(self.nodes[middle][0]) > 0.0) == rising { last = middle } else { first = middle + 1 }
        }
        let node = |k: usize| (k as f64, over(self.nodes[k][0]));
        let low = if first > begin { node(first - 1) } else { low };
        let high = if first <= end && (over(self.nodes[first][0]) > 0.0) == rising { node(first) } else { high };
        let place = self.root(low, high, |place| over(self.at(place)[0]))?;
        Some(self.at(place)[1])
    }
}
