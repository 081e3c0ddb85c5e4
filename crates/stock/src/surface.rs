//! The surface of the remaining material, as a mesh.

use super::dexel::Stock;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// A closed mesh, stock's frame, m.
///
/// # Examples
/// ```
/// use nalgebra::Vector3;
/// use deflex_stock::{Blank, Stock};
///
/// let block = Stock::new(Blank::Box([Vector3::zeros(), Vector3::new(0.1, 0.1, 0.05)]), 1e-3);
/// let mesh = block.surface(2e-3); // corners about 2 mm apart
/// assert_eq!(mesh.points.len(), mesh.normals.len());
/// assert!((mesh.volume() - 5e-4).abs() < 1e-5); // m³
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Corners.
    pub points: Vec<Vector3<f64>>,
    /// Normals out of the material, one for each corner.
    pub normals: Vec<Vector3<f64>>,
    /// Corners of each triangle, counterclockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

/// A corner: the number of its cell, its position and its normal.
type Corner = (usize, Vector3<f64>, Vector3<f64>);

/// Steps that bring a corner onto the surface.
const STEPS: usize = 4;
/// Half the step of a difference, m: above the rounding of a distance, below any feature.
const NUDGE: f64 = 1e-6;

impl Mesh {
    /// Volume inside, m³ (divergence theorem).
    #[must_use]
    pub fn volume(&self) -> f64 {
        let corner = |i: u32| self.points[i as usize];
        self.triangles.iter().map(|[a, b, c]| corner(*a).dot(&corner(*b).cross(&corner(*c)))).sum::<f64>() / 6.0
    }
}

impl Stock {
    /// The surface of the remaining material, with corners on it that are about `cell` (m) apart. It is made by naive surface nets on the
    /// sign of [`Stock::depth`]; each corner is then moved onto the surface along the gradient of the depth, within its cell.
    #[must_use]
    pub fn surface(&self, cell: f64) -> Mesh {
        let [low, high] = self.blank().bounds();
        let origin = low - Vector3::repeat(0.5 * cell);
        let count = (high - origin).map(|length| (length / cell).ceil() as usize + 2);
        let [nx, ny, nz] = [count.x, count.y, count.z];
        let at = |i: usize, j: usize, k: usize| origin + Vector3::new(i as f64, j as f64, k as f64) * cell;
        let layer = |k: usize| -> Vec<f64> { (0..nx * ny).map(|n| self.depth(&at(n % nx, n / nx, k))).collect() };
        let layers: Vec<Vec<f64>> = (0..nz).into_par_iter().map(layer).collect();
        let depth = |i: usize, j: usize, k: usize| layers[k][j * nx + i];
        let corners: Vec<Vec<Corner>> = (0..nz - 1)
            .into_par_iter()
            .map(|k| {
                let mut found = Vec::new();
                for j in 0..ny - 1 {
                    for i in 0..nx - 1 {
                        if let Some(start) = crossing(&|a, b, c| depth(i + a, j + b, k + c)) {
                            let start = at(i, j, k) + start * cell;
                            let (point, normal) = self.on_surface(&start, cell);
                            found.push(((k * ny + j) * nx + i, point, normal));
                        }
                    }
                }
                found
            })
            .collect();
        let mut mesh = Mesh::default();
        let mut number = BTreeMap::new();
        for (place, point, normal) in corners.into_iter().flatten() {
            number.insert(place, u32::try_from(mesh.points.len()).unwrap_or(u32::MAX));
            mesh.points.push(point);
            mesh.normals.push(normal);
        }
        let strides = [1, nx, nx * ny];
        for &place in number.keys() {
            let (i, j, k) = (place % nx, place / nx % ny, place / (nx * ny));
            let here = depth(i, j, k) > 0.0;
            for axis in 0..3 {
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                let index = [i, j, k];
                if index[u] == 0 || index[v] == 0 {
                    continue;
                }
                let next = [0, 1, 2].map(|a| index[a] + usize::from(a == axis));
                if next[0] >= nx || next[1] >= ny || next[2] >= nz || here == (depth(next[0], next[1], next[2]) > 0.0) {
                    continue;
                }
                let quad = [place, place - strides[u], place - strides[u] - strides[v], place - strides[v]];
                let [Some(&a), Some(&b), Some(&c), Some(&d)] = quad.map(|place| number.get(&place)) else { continue };
                let faces = if here { [[a, b, c], [a, c, d]] } else { [[a, c, b], [a, d, c]] };
                mesh.triangles.extend(faces);
            }
        }
        mesh
    }

    /// The direction in which the depth grows fastest.
    pub(super) fn inwards(&self, at: &Vector3<f64>) -> Vector3<f64> {
        let along = |k: usize| {
            let mut nudge = Vector3::zeros();
            nudge[k] = NUDGE;
            self.depth(&(at + nudge)) - self.depth(&(at - nudge))
        };
        Vector3::new(along(0), along(1), along(2)).try_normalize(1e-12).unwrap_or_else(|| -Vector3::z())
    }

    /// Approximately the nearest point of the surface within a cell, and the normal there.
    pub(super) fn on_surface(&self, start: &Vector3<f64>, cell: f64) -> (Vector3<f64>, Vector3<f64>) {
        let mut at = *start;
        let mut inwards = self.inwards(&at);
        for _ in 0..STEPS {
            let depth = self.depth(&at);
            if depth.abs() < NUDGE {
                break;
            }
            let next = at - inwards * depth;
            if (next - start).amax() > cell {
                break;
            }
            at = next;
            inwards = self.inwards(&at);
        }
        (at, -inwards)
    }
}

/// The mean of the points where the edges of a unit cell cross the surface.
fn crossing(depth: &dyn Fn(usize, usize, usize) -> f64) -> Option<Vector3<f64>> {
    let corners: [f64; 8] = std::array::from_fn(|n| depth(n & 1, n >> 1 & 1, n >> 2));
    let inside = corners.iter().filter(|depth| **depth > 0.0).count();
    if inside == 0 || inside == 8 {
        return None;
    }
    let place = |n: usize| Vector3::new((n & 1) as f64, (n >> 1 & 1) as f64, (n >> 2) as f64);
    let (mut sum, mut count) = (Vector3::zeros(), 0.0);
    for a in 0..8 {
        for b in [a | 1, a | 2, a | 4].into_iter().filter(|b| *b != a) {
            if (corners[a] > 0.0) != (corners[b] > 0.0) {
                sum += place(a).lerp(&place(b), corners[a] / (corners[a] - corners[b]));
                count += 1.0;
            }
        }
    }
    Some(sum / count)
}
