//! A closed triangle mesh as a solid: lines through it, and distances from it.

use nalgebra::Vector3;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::RangeInclusive;

/// Bound of a depth, m: farther from the surface, a depth has this size. Depths serve cells of cutters, which are smaller.
const FAR: f64 = 1e-3;

/// Replaces a side of zero.
const TINY: f64 = 1e-200;

/// Most bins along the longer side.
const MOST_BINS: f64 = 512.0;

/// Most bins of a triangle, on average; a mesh of few triangles may have the second number of copies in addition.
const MOST_COPIES: usize = 16;
const FEW_COPIES: usize = 1 << 20;

/// A mesh whose triangles close it, counterclockwise seen from outside, m.
///
/// # Examples
/// ```
/// use nalgebra::Vector3;
/// use deflex_stock::ClosedMesh;
///
/// let [o, x, y, z] = [Vector3::zeros(), Vector3::x(), Vector3::y(), Vector3::z()];
/// let mesh = ClosedMesh::new(&[[o, y, x], [o, x, z], [o, z, y], [x, y, z]]).expect("a tetrahedron");
/// assert!((mesh.volume() - 1.0 / 6.0).abs() < 1e-12); // m³
/// assert_eq!((mesh.bounds(), mesh.sharp_edges(0.35).len()), ([o, Vector3::repeat(1.0)], 6));
/// assert!(mesh.depth(&Vector3::repeat(0.1)) > 0.0 && mesh.depth(&Vector3::repeat(1.0)) < 0.0);
/// ```
#[derive(Clone, Debug)]
pub struct ClosedMesh {
    points: Vec<Vector3<f64>>,
    triangles: Vec<[u32; 3]>,
    low: Vector3<f64>,
    high: Vector3<f64>,
    /// Triangles over each square of the xy plane.
    bins: Vec<Vec<u32>>,
    size: f64,
    count: [usize; 2],
    boxes: Vec<BoxNode>,
}

/// The bounding box of some triangles, m. The first of the two boxes within a box is the next one in the list.
#[derive(Clone, Copy, Debug)]
struct BoxNode {
    low: Vector3<f64>,
    high: Vector3<f64>,
    holds: Holds,
}

#[derive(Clone, Copy, Debug)]
enum Holds {
    Triangle(u32),
    /// Two boxes: the index of the second.
    Boxes(u32),
}

impl BoxNode {
    /// Square of the distance of a point from the box, m².
    fn distance_squared(&self, point: &Vector3<f64>) -> f64 {
        (self.low - point).sup(&(point - self.high)).sup(&Vector3::zeros()).norm_squared()
    }
}

/// Why triangles do not form a solid.
///
/// # Examples
/// ```
/// use nalgebra::Vector3;
/// use deflex_stock::{ClosedMesh, OpenMesh};
///
/// let one = [[Vector3::zeros(), Vector3::x(), Vector3::y()]];
/// assert!(matches!(ClosedMesh::new(&one), Err(OpenMesh::Edges { edges: 3, .. })));
/// assert!(matches!(ClosedMesh::new(&[]), Err(OpenMesh::Empty)));
/// ```
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum OpenMesh {
    /// There are no triangles.
    #[error("there is no triangle in it")]
    Empty,
    /// Edges that not exactly two triangles share, each in its own direction.
    #[error(
        "it is not closed: {edges} edges have no triangle on their other side, the first at x {:.4}, y {:.4}, z {:.4}",
        at_mm[0], at_mm[1], at_mm[2]
    )]
    Edges {
        /// Number of such edges.
        edges: usize,
        /// Where the first begins, mm.
        at_mm: [f64; 3],
    },
    /// A corner that is no number.
    #[error("a corner is not finite")]
    NotFinite,
}

impl ClosedMesh {
    /// A mesh of triangles, m. Equal corners are merged; a mesh that is inside out is inverted.
    ///
    /// # Errors
    /// The triangles do not form a closed surface.
    pub fn new(triangles: &[[Vector3<f64>; 3]]) -> Result<Self, OpenMesh> {
        if triangles.iter().flatten().any(|corner| !corner.iter().all(|v| v.is_finite())) {
            return Err(OpenMesh::NotFinite);
        }
        let mut mesh = Self {
            points: Vec::new(),
            triangles: Vec::new(),
            low: Vector3::repeat(f64::INFINITY),
            high: Vector3::repeat(f64::NEG_INFINITY),
            bins: Vec::new(),
            size: 0.0,
            count: [1, 1],
            boxes: Vec::new(),
        };
        let mut known: BTreeMap<[u64; 3], u32> = BTreeMap::new();
        for triangle in triangles {
            let corners = triangle.map(|corner| {
                // Zero may have either sign.
                let key = [0, 1, 2].map(|k| (corner[k] + 0.0).to_bits());
                *known.entry(key).or_insert_with(|| {
                    mesh.points.push(corner);
                    (mesh.low, mesh.high) = (mesh.low.inf(&corner), mesh.high.sup(&corner));
                    u32::try_from(mesh.points.len() - 1).unwrap_or(u32::MAX)
                })
            });
            let [a, b, c] = corners;
            // Without an area it closes nothing.
            if a != b && b != c && c != a {
                mesh.triangles.push(corners);
            }
        }
        mesh.check()?;
        if mesh.volume() < 0.0 {
            mesh.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        }
        mesh.sort_into_bins();
        mesh.sort_into_boxes();
        Ok(mesh)
    }

    /// Sorts the triangles into nested boxes, each halved across its longer side. The number of steps to the triangles near a point then
    /// grows with the logarithm of their number.
    fn sort_into_boxes(&mut self) {
        let mut all: Vec<BoxNode> = Vec::with_capacity(self.triangles.len());
        for number in 0..u32::try_from(self.triangles.len()).unwrap_or(u32::MAX) {
            let [a, b, c] = self.corners(number);
            all.push(BoxNode { low: a.inf(&b).inf(&c), high: a.sup(&b).sup(&c), holds: Holds::Triangle(number) });
        }
        let mut boxes = Vec::with_capacity(2 * all.len());
        // Parts that are not yet sorted, each with the box of which it is the second half.
        let mut open = vec![(0..all.len(), None::<usize>)];
        while let Some((part, second_of)) = open.pop() {
            let here = boxes.len();
            if let Some(above) = second_of {
                let above: &mut BoxNode = &mut boxes[above];
                above.holds = Holds::Boxes(u32::try_from(here).unwrap_or(u32::MAX));
            }
            let own = &mut all[part.clone()];
            if let [one] = own {
                boxes.push(*one);
                continue;
            }
            let (low, high) =
                own.iter().fold((own[0].low, own[0].high), |(low, high), b| (low.inf(&b.low), high.sup(&b.high)));
            let middle = part.start + part.len() / 2;
            let axis = (high - low).imax();
            own.select_nth_unstable_by(part.len() / 2, |a, b| {
                (a.low[axis] + a.high[axis]).total_cmp(&(b.low[axis] + b.high[axis]))
            });
            boxes.push(BoxNode { low, high, holds: Holds::Boxes(0) });
            open.push((middle..part.end, Some(here)));
            open.push((part.start..middle, None));
        }
        self.boxes = boxes;
    }

    /// Square of the distance from the surface, m²; at most `bound`.
    fn nearest_squared(&self, point: &Vector3<f64>, bound: f64) -> f64 {
        let mut nearest = bound;
        let mut open: smallvec::SmallVec<[u32; 64]> = smallvec::smallvec![0];
        while let Some(at) = open.pop() {
            let here = &self.boxes[at as usize];
            if here.distance_squared(point) >= nearest {
                continue;
            }
            match here.holds {
                Holds::Triangle(triangle) => nearest = nearest.min(self.distance_squared(triangle, point, nearest)),
                Holds::Boxes(second) => {
                    let halves = [at + 1, second];
                    let away = halves.map(|half| self.boxes[half as usize].distance_squared(point));
                    // The nearer one first: after it, the other one is often too far.
                    let [near, far] = if away[0] <= away[1] { halves } else { [second, at + 1] };
                    open.extend([far, near]);
                }
            }
        }
        nearest
    }

    fn check(&self) -> Result<(), OpenMesh> {
        if self.triangles.is_empty() {
            return Err(OpenMesh::Empty);
        }
        // Edges that have not met the same edge in the opposite direction.
        let mut open: BTreeSet<(u32, u32, usize)> = BTreeSet::new();
        for [a, b, c] in &self.triangles {
            for (from, to) in [(*a, *b), (*b, *c), (*c, *a)] {
                let other = open.range((to, from, 0)..=(to, from, usize::MAX)).next().copied();
                match other {
                    Some(other) => open.remove(&other),
                    None => open.insert((from, to, open.len())),
                };
            }
        }
        match open.first() {
            None => Ok(()),
            Some((from, ..)) => {
                let at_mm = (self.points[*from as usize] * 1e3).into();
                Err(OpenMesh::Edges { edges: open.len(), at_mm })
            }
        }
    }

    fn corners(&self, triangle: u32) -> [Vector3<f64>; 3] {
        self.triangles[triangle as usize].map(|corner| self.points[corner as usize])
    }

    /// Volume inside, m³ (divergence theorem).
    #[must_use]
    pub fn volume(&self) -> f64 {
        let corner = |i: u32| self.points[i as usize] - self.low;
        self.triangles.iter().map(|[a, b, c]| corner(*a).dot(&corner(*b).cross(&corner(*c)))).sum::<f64>() / 6.0
    }

    /// Edges at which its surface turns by more than `angle` (rad), the sharpest first, each as its two ends, m.
    #[must_use]
    pub fn sharp_edges(&self, angle: f64) -> Vec<[Vector3<f64>; 2]> {
        let mut sides: BTreeMap<(u32, u32), Vec<Vector3<f64>>> = BTreeMap::new();
        for (triangle, [a, b, c]) in self.triangles.iter().enumerate() {
            let [p, q, r] = self.corners(u32::try_from(triangle).unwrap_or(u32::MAX));
            // A triangle without area has no normal.
            let Some(normal) = (q - p).cross(&(r - p)).try_normalize(0.0) else { continue };
            for (from, to) in [(*a, *b), (*b, *c), (*c, *a)] {
                sides.entry((from.min(to), from.max(to))).or_default().push(normal);
            }
        }
        let turned = |(ends, normals): ((u32, u32), Vec<Vector3<f64>>)| match normals[..] {
            [one, other] => Some((one.dot(&other), ends)),
            _ => None,
        };
        let mut sharp: Vec<(f64, (u32, u32))> =
            sides.into_iter().filter_map(turned).filter(|(cosine, _)| *cosine < angle.cos()).collect();
        sharp.sort_by(|a, b| a.0.total_cmp(&b.0));
        sharp.into_iter().map(|(_, (a, b))| [a, b].map(|corner| self.points[corner as usize])).collect()
    }

    /// Lower and upper corner of a box about it, m.
    #[must_use]
    pub fn bounds(&self) -> [Vector3<f64>; 2] {
        [self.low, self.high]
    }

    fn sort_into_bins(&mut self) {
        let size = self.high - self.low;
        let mut wanted = (self.triangles.len() as f64).sqrt().clamp(1.0, MOST_BINS);
        loop {
            self.size = size.x.max(size.y) / wanted;
            self.count = [0, 1].map(|k| (size[k] / self.size).floor() as usize + 1);
            let places =
                |triangle: &[u32; 3]| self.bins_of(triangle).map(|range| range.count()).iter().product::<usize>();
            // A sliver from one side to the other lies in a whole row of bins, or in all of them: larger bins need fewer copies.
            let copies: usize = self.triangles.iter().map(places).sum();
            if wanted <= 1.0 || copies <= MOST_COPIES * self.triangles.len() + FEW_COPIES {
                break;
            }
            wanted = (0.5 * wanted).max(1.0);
        }
        self.bins = vec![Vec::new(); self.count[0] * self.count[1]];
        for number in 0..self.triangles.len() {
            let [columns, rows] = self.bins_of(&self.triangles[number]);
            let number = u32::try_from(number).unwrap_or(u32::MAX);
            for j in rows {
                for i in columns.clone() {
                    self.bins[j * self.count[0] + i].push(number);
                }
            }
        }
    }

    /// Columns and rows of the bins over which a triangle lies.
    fn bins_of(&self, triangle: &[u32; 3]) -> [RangeInclusive<usize>; 2] {
        let corners = triangle.map(|corner| self.points[corner as usize]);
        [0, 1].map(|k| {
            let at = corners.map(|corner| corner[k]);
            let least = at.iter().fold(f64::INFINITY, |a, b| a.min(*b));
            let most = at.iter().fold(f64::NEG_INFINITY, |a, b| a.max(*b));
            self.bin(least, k)..=self.bin(most, k)
        })
    }

    fn bin(&self, at: f64, k: usize) -> usize {
        (((at - self.low[k]) / self.size).max(0.0) as usize).min(self.count[k] - 1)
    }

    /// Heights at which the line along z through a point enters and leaves the solid, in order.
    pub(super) fn spans(&self, x: f64, y: f64, mut each: impl FnMut(f64, f64)) {
        if x < self.low.x || x > self.high.x || y < self.low.y || y > self.high.y {
            return;
        }
        let mut heights: smallvec::SmallVec<[f64; 8]> = self.bins[self.bin(y, 1) * self.count[0] + self.bin(x, 0)]
            .iter()
            .filter_map(|triangle| self.height(*triangle, x, y))
            .collect();
        heights.sort_unstable_by(f64::total_cmp);
        for pair in heights.chunks_exact(2) {
            each(pair[0], pair[1]);
        }
    }

    /// Height of a triangle over a point; `None` if it is not over it. Of two triangles that share an edge over the point, one is over it.
    fn height(&self, triangle: u32, x: f64, y: f64) -> Option<f64> {
        let corners = self.triangles[triangle as usize];
        let side = |k: usize| {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            // Both triangles of an edge compute it from the same end: their results are opposite to the last bit.
            let (from, to, sign) = if a < b { (a, b, 1.0) } else { (b, a, -1.0) };
            let (from, to) = (self.points[from as usize], self.points[to as usize]);
            let side = (to.x - from.x) * (y - from.y) - (to.y - from.y) * (x - from.x);
            // On the edge: as if the point were a little farther in x, and far less in y.
            let nudged = [side, from.y - to.y, to.x - from.x];
            sign * nudged
                .into_iter()
                .find(|side| *side != 0.0)
                .map_or(0.0, |first| if side == 0.0 { first * TINY } else { first })
        };
        let sides = [side(0), side(1), side(2)];
        if !(sides.iter().all(|side| *side > 0.0) || sides.iter().all(|side| *side < 0.0)) {
            return None;
        }
        let [a, b, c] = self.corners(triangle);
        let whole: f64 = sides.iter().sum();
        Some((sides[1] * a.z + sides[2] * b.z + sides[0] * c.z) / whole)
    }

    /// Signed depth of a point, m: positive inside. Its size is the distance from the surface, up to a bound.
    #[must_use]
    pub fn depth(&self, point: &Vector3<f64>) -> f64 {
        let mut inside = false;
        self.spans(point.x, point.y, |low, high| inside |= (low..=high).contains(&point.z));
        let nearest = self.nearest_squared(point, FAR * FAR);
        if inside { nearest.sqrt() } else { -nearest.sqrt() }
    }

    /// Square of a point's distance from a triangle, m²; not computed exactly if it is above `most`.
    fn distance_squared(&self, triangle: u32, point: &Vector3<f64>, most: f64) -> f64 {
        let [a, b, c] = self.corners(triangle);
        let normal = (b - a).cross(&(c - a));
        let size = normal.norm_squared();
        let over = (point - a).dot(&normal);
        let square = if size > 0.0 { over * over / size } else { 0.0 };
        if square >= most {
            return f64::INFINITY;
        }
        let edge = |from: &Vector3<f64>, to: &Vector3<f64>| {
            let (along, at) = (to - from, point - from);
            let away = at - along * (at.dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
            (along.cross(&normal).dot(&at), away)
        };
        let edges = [edge(&a, &b), edge(&b, &c), edge(&c, &a)];
        // `along × normal` points out of the triangle.
        if size > 0.0 && edges.iter().all(|(outside, _)| *outside <= 0.0) {
            return square;
        }
        edges.iter().map(|(_, away)| away.norm_squared()).fold(f64::INFINITY, f64::min)
    }
}
