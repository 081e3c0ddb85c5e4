//! The distance of a point from the surface of the remaining material, in any direction.

use super::dexel::Stock;
use super::lattice::turned;
use super::line::{BLANK, Line};
use nalgebra::Vector3;
use std::collections::HashSet;

/// Up to this share of the spacing, the sweeps near a point in the material give its depth, because they own the lines there.
const NEAR: f64 = 0.5;

/// A search ends at the surface within this, m.
const MET: f64 = 2e-6;

/// Number of halvings from a line to the surface: below a micrometre from 100 mm.
const HALVINGS: usize = 20;

/// Number of rounds along a surface to its nearest point; a plane takes one.
const PROJECTIONS: usize = 6;

/// A point has to be nearer than the one before by this, m.
const NEARER: f64 = 1e-8;

/// Number of directions in which the nearest material is searched for: of two faces that meet, the nearer one may lie between lines.
const DIRECTIONS: usize = 6;

impl Stock {
    /// Signed distance (m) of a point from the nearest point of the surface: positive in the material.
    ///
    /// [`Stock::depth`] equals it close to a surface. It uses only the sweeps near the point: deep in the material another one may be
    /// nearer, and where sweeps overlap the material is farther away than the ends of each.
    #[must_use]
    #[doc(hidden)]
    pub fn distance(&self, point: &Vector3<f64>) -> f64 {
        let depth = self.depth(point);
        if depth >= 0.0 {
            return if depth <= NEAR * self.spacing() { depth } else { self.to_void(point, depth) };
        }
        let ahead = point + self.inwards(point) * (MET - depth);
        if self.depth(&ahead) > -MET { depth } else { -self.to_material(point).unwrap_or(-depth) }
    }

    /// Distance of a point in the material from everything that has been swept, and from the surface of the blank; at most `most`, m.
    fn to_void(&self, point: &Vector3<f64>, most: f64) -> f64 {
        let (mut least, mut measured, now) = (most, HashSet::from([BLANK]), self.now());
        self.about_by_shells(point, |reach, lines| {
            if reach > least {
                return false;
            }
            for line in lines.iter().filter_map(|[i, j]| self.line(*i, *j)) {
                let ends = line.spans.iter().flat_map(|span| [span.high_by, span.low_by]);
                for by in ends.chain([line.near_by]).filter(|by| measured.insert(*by)) {
                    least = least.min(self.depth_of(&now, by, point));
                }
            }
            true
        });
        least.max(0.0)
    }

    /// Distance of a point from the nearest material, m; `None` if none is left.
    fn to_material(&self, point: &Vector3<f64>) -> Option<f64> {
        let mut found: [Option<(f64, Vector3<f64>)>; DIRECTIONS] = [None; DIRECTIONS];
        let (mut least, spacing) = (f64::INFINITY, self.spacing());
        self.about_by_shells(point, |reach, lines| {
            // Faces next to the nearest one are examined as far as the spacing of the lines can shift them.
            if reach > least + 2.0 * spacing {
                return false;
            }
            for [i, j] in lines {
                let uncut;
                let line = match self.line(*i, *j) {
                    Some(line) => line,
                    None => {
                        uncut = self.lattice().uncut(*i, *j);
                        &uncut
                    }
                };
                let Some(place) = self.nearest_on(line, [*i, *j], point) else { continue };
                let displacement = place - point;
                let size = displacement.norm();
                least = least.min(size);
                let axis = displacement.iamax();
                let own = &mut found[2 * axis + usize::from(displacement[axis] < 0.0)];
                if own.is_none_or(|(known, _)| size < known) {
                    *own = Some((size, place));
                }
            }
            true
        });
        let near = found.into_iter().flatten().filter(|(size, _)| *size <= least + 2.0 * spacing);
        near.map(|(_, place)| self.to_surface(point, &place)).reduce(f64::min)
    }

    /// Distance of a point outside the material from the surface between it and a point in the material, m.
    fn to_surface(&self, point: &Vector3<f64>, place: &Vector3<f64>) -> f64 {
        let (mut out, mut inside) = (0.0, 1.0);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (out + inside);
            *(if self.depth(&point.lerp(place, middle)) < 0.0 { &mut out } else { &mut inside }) = middle;
        }
        let mut at = point.lerp(place, inside);
        for _ in 0..PROJECTIONS {
            let inwards = self.inwards(&at);
            let foot = point + inwards * inwards.dot(&(at - point));
            let (next, _) = self.on_surface(&foot, self.spacing());
            if self.depth(&next).abs() > MET || (next - point).norm() > (at - point).norm() - NEARER {
                break;
            }
            at = next;
        }
        (at - point).norm()
    }

    /// The material of a line that is nearest to a point.
    fn nearest_on(&self, line: &Line, [i, j]: [usize; 2], point: &Vector3<f64>) -> Option<Vector3<f64>> {
        let bottom = self.lattice().origin[2];
        let [x, y] = self.lattice().place(i, j);
        let spans = line.spans.iter().map(|span| (f64::from(span.low), f64::from(span.high)));
        let heights = spans.filter(|(low, high)| high > low).map(|(low, high)| (point.z - bottom).clamp(low, high));
        let nearest = heights.min_by(|a, b| (a + bottom - point.z).abs().total_cmp(&(b + bottom - point.z).abs()));
        nearest.map(|height| Vector3::new(x, y, height + bottom))
    }

    /// Calls `each` with the lines around a point, square by square outwards, and with a lower bound of their distance, m. Ends when
    /// `each` returns false or no lines are left.
    fn about_by_shells(&self, point: &Vector3<f64>, mut each: impl FnMut(f64, &[[usize; 2]]) -> bool) {
        let lattice = self.lattice();
        let at = turned(point.x, point.y);
        #[allow(clippy::cast_possible_truncation)] // as many as there are lines
        let middle = [0, 1].map(|k| ((at[k] - lattice.origin[k]) / lattice.spacing - 0.5).round() as i64);
        let count = lattice.lines.map(|lines| lines as i64);
        let last = (0..2).map(|k| middle[k].max(count[k] - 1 - middle[k])).max().unwrap_or(0);
        let mut lines = Vec::new();
        for shell in 0..=last {
            lines.clear();
            let mut add = |u: i64, v: i64| {
                if let ([Ok(i), Ok(j)], true) = ([usize::try_from(u), usize::try_from(v)], u < count[0] && v < count[1])
                {
                    lines.push([i, j]);
                }
            };
            for along in -shell..=shell {
                add(middle[0] + along, middle[1] - shell);
                if shell > 0 {
                    add(middle[0] + along, middle[1] + shell);
                }
            }
            for across in 1 - shell..shell {
                add(middle[0] - shell, middle[1] + across);
                add(middle[0] + shell, middle[1] + across);
            }
            // The point is at most half a line from the middle.
            if !each((shell as f64 - 0.5) * lattice.spacing, &lines) {
                return;
            }
        }
    }
}
