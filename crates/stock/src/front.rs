//! A cutter's front, with the force integrals over the cells of its mask.

use super::solid::Solid;
use deflex_cutting::{Coefficients, Cutter};
use nalgebra::Vector3;
use std::f64::consts::{FRAC_PI_2, TAU};

/// Most and fewest cells of the mask around the axis and along the profile of the corner, and their wanted size as a share of the
/// diameter.
const AROUND: (usize, usize) = (64, 48);
const ALONG: (usize, usize) = (16, 5);
const CELL: f64 = 0.05;

/// A cutter with its coefficients, and the force integrals over the cells of its mask.
///
/// # Examples
/// ```
/// use deflex_cutting::{Cutter, materials};
/// use deflex_stock::{Blank, Front, Stock, ToolPose};
/// use nalgebra::Vector3;
///
/// let cutter = Cutter { diameter: 0.01, corner_radius: 1e-3, teeth: 2, helix: 0.0 };
/// let front = Front::new(&cutter, &materials::find("al7075").expect("a material").coefficients);
/// let mut block = Stock::new(Blank::Box([Vector3::zeros(), Vector3::new(0.1, 0.1, 0.05)]), 1e-3);
/// block.keep_history();
/// let pose = ToolPose { tip: Vector3::new(0.05, 0.05, 0.048), axis: Vector3::z_axis() };
/// let feed = Vector3::new(1e-3, 0.0, 0.0); // along x
/// let engaged = front.engaged(&block, &pose, &feed);
/// assert!((engaged.depth - 0.002).abs() < 1e-4, "{:?}", front.solid()); // m
/// assert_eq!(front.engaged_at(&block, &block.now(), &pose, &feed).depth, engaged.depth);
/// ```
#[derive(Clone, Debug)]
pub struct Front {
    pub(super) solid: Solid,
    coefficients: Coefficients,
    teeth_per_angle: f64,
    pub(super) around: usize,
    pub(super) along: usize,
    /// Height of a cell of the cylinder, m.
    rise: f64,
    /// Cosine and sine of φ at the columns' edges.
    pub(super) edges: Vec<(f64, f64)>,
    /// Cosine and sine of κ at the rows' edges, along the corner.
    rows: Vec<(f64, f64)>,
    /// The cells, by row and column: the rows of the corner, and one row of the cylinder.
    pub(super) cells: Vec<Vec<Cell>>,
    /// Edge force (N) and cutting force over feed per tooth (N/m), summed as sizes over the leading half of all these rows.
    pub(super) leading: [f64; 2],
}

/// Mean force on the tool of a cell that is wholly engaged, cutter frame: edge force (N) and cutting force over feed per
/// tooth (N/m), the latter by the feed's components along x and z of the cutter frame.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Cell {
    pub(super) edge: Vector3<f64>,
    pub(super) across: Vector3<f64>,
    pub(super) along: Vector3<f64>,
    /// Volume that it clears on each metre of feed, m², by the same components.
    pub(super) clears: [f64; 2],
}

/// A point of the cutter's profile: sine and cosine of κ, distance from the axis, height, m.
#[derive(Clone, Copy)]
pub(super) struct Ring {
    pub(super) sin: f64,
    pub(super) cos: f64,
    pub(super) across: f64,
    pub(super) up: f64,
}

impl Front {
    /// Tables for a cutter and its coefficients.
    #[must_use]
    pub fn new(cutter: &Cutter, coefficients: &Coefficients) -> Self {
        let solid = Solid::of(cutter);
        let size = CELL * cutter.diameter;
        let cells = |length: f64, (most, least): (usize, usize)| ((length / size).ceil() as usize).clamp(least, most);
        let around = cells(TAU * solid.radius, AROUND).next_multiple_of(4);
        let along = if solid.corner > 0.0 { cells(FRAC_PI_2 * solid.corner, ALONG) } else { 0 };
        let mut front = Self {
            solid,
            coefficients: *coefficients,
            teeth_per_angle: f64::from(cutter.teeth) / TAU,
            around,
            along,
            rise: size,
            edges: (0..=around).map(|i| cos_sin(TAU * i as f64 / around as f64)).collect(),
            rows: (0..=along).map(|i| cos_sin(FRAC_PI_2 * i as f64 / along.max(1) as f64)).collect(),
            cells: Vec::new(),
            leading: [0.0; 2],
        };
        front.cells = (0..=along).map(|row| (0..around).map(|i| front.whole(row, i)).collect()).collect();
        let leads = |column: &usize| front.edges[*column].0 + front.edges[*column + 1].0 > 0.0;
        for row in &front.cells {
            for cell in (0..around).filter(leads).map(|column| &row[column]) {
                front.leading[0] += cell.edge.norm();
                front.leading[1] += cell.across.norm();
            }
        }
        front
    }

    /// The cutter's body.
    #[must_use]
    pub fn solid(&self) -> Solid {
        self.solid
    }

    /// Profile at a position counted in rows from the tip.
    #[inline]
    pub(super) fn ring(&self, row: f64) -> Ring {
        let along = self.along as f64;
        if row >= along {
            let up = self.solid.corner + (row - along) * self.rise;
            return Ring { sin: 1.0, cos: 0.0, across: self.solid.radius, up };
        }
        let (cos, sin) = between(&self.rows, row, FRAC_PI_2 / along);
        Ring { sin, cos, across: self.solid.flat() + self.solid.corner * sin, up: self.solid.corner * (1.0 - cos) }
    }

    /// Number of rows up to a height (m).
    pub(super) fn rows_below(&self, up: f64) -> usize {
        let over = up - self.solid.corner;
        if over >= 0.0 {
            return self.along + (over / self.rise).ceil() as usize;
        }
        (0..self.along).find(|row| self.ring(*row as f64).up >= up).unwrap_or(self.along)
    }

    /// Cosine and sine of φ at a position counted in columns.
    #[inline]
    pub(super) fn angle(&self, column: f64) -> (f64, f64) {
        between(&self.edges, column, TAU / self.around as f64)
    }

    /// Length of a row along the profile, m.
    pub(super) fn length(&self, row: f64) -> f64 {
        if row < self.along as f64 { FRAC_PI_2 * self.solid.corner / self.along as f64 } else { self.rise }
    }

    /// Integrals over a whole cell by Gauss's rule: the integrand is a polynomial of third degree in sines and cosines of small angles.
    fn whole(&self, row: usize, column: usize) -> Cell {
        const GAUSS: [(f64, f64); 3] =
            [(0.112_701_665_379_258_3, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.887_298_334_620_741_7, 5.0 / 18.0)];
        let mut sum = Cell::default();
        for (along, weight) in GAUSS {
            for (about, other) in GAUSS {
                let ring = self.ring(row as f64 + along);
                let (sin, cos) = (TAU * (column as f64 + about) / self.around as f64).sin_cos();
                let part = self.density(&ring, (cos, sin));
                let share = weight * other * self.length(row as f64) * TAU / self.around as f64;
                sum.edge += part.edge * share;
                sum.across += part.across * share;
                sum.along += part.along * share;
                sum.clears = [0, 1].map(|k| sum.clears[k] + part.clears[k] * share);
            }
        }
        sum
    }

    /// Integrands for each unit of profile and angle (Tang et al. Eq. 6, mean over a revolution).
    #[inline]
    pub(super) fn density(&self, ring: &Ring, (cos, sin): (f64, f64)) -> Cell {
        let k = &self.coefficients;
        let force = |kt: f64, kr: f64, ka: f64| {
            let inward = kr * ring.sin + ka * ring.cos;
            Vector3::new(-kt * sin - inward * cos, kt * cos - inward * sin, kr * ring.cos - ka * ring.sin)
                * self.teeth_per_angle
        };
        let cutting = force(k.ktc, k.krc, k.kac);
        Cell {
            edge: force(k.kte, k.kre, k.kae),
            across: cutting * (ring.sin * cos),
            along: cutting * -ring.cos,
            clears: [ring.across * ring.sin * cos, -ring.across * ring.cos],
        }
    }
}

fn cos_sin(angle: f64) -> (f64, f64) {
    let (sin, cos) = angle.sin_cos();
    (cos, sin)
}

/// Cosine and sine at a position counted in steps (at most 1/3 rad) of a table of them: the nearest entry, turned by the series of a
/// small angle, whose error is below rounding.
#[inline]
fn between(table: &[(f64, f64)], at: f64, step: f64) -> (f64, f64) {
    let nearest = (at + 0.5) as usize;
    let (cos, sin) = table[nearest];
    let by = (at - nearest as f64) * step;
    let square = by * by;
    // Factors of each term of the sine and the cosine over the term before.
    const S: [f64; 4] = [1.0 / 6.0, 1.0 / 20.0, 1.0 / 42.0, 1.0 / 72.0];
    const C: [f64; 5] = [1.0 / 2.0, 1.0 / 12.0, 1.0 / 30.0, 1.0 / 56.0, 1.0 / 90.0];
    let s = by * (1.0 - square * S[0] * (1.0 - square * S[1] * (1.0 - square * S[2] * (1.0 - square * S[3]))));
    let c = 1.0
        - square * C[0] * (1.0 - square * C[1] * (1.0 - square * C[2] * (1.0 - square * C[3] * (1.0 - square * C[4]))));
    (cos * c - sin * s, sin * c + cos * s)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_between_the_columns_are_those_of_sine_and_cosine() {
        for parts in [16, 48, 64] {
            let step = TAU / parts as f64;
            let table: Vec<_> = (0..=parts).map(|i| cos_sin(i as f64 * step)).collect();
            for k in 0..=100 * parts {
                let at = k as f64 / 100.0;
                let ((cos, sin), (true_cos, true_sin)) = (between(&table, at, step), cos_sin(at * step));
                assert!((cos - true_cos).abs() < 1e-15 && (sin - true_sin).abs() < 1e-15, "{at} of {parts}");
            }
        }
    }
}
