//! A grid of cells, and the share of each that is material.

use crate::element::Rule;
use rayon::prelude::*;

/// Number of points along each axis at which a cell that the surface may cut is sampled.
const SAMPLES: usize = 4;
/// A point nearer to the surface than this share of a cell counts as on it, so that rounding changes no cell.
const ON_SURFACE: f64 = 1e-3;
/// Cells with less than this share of material are left out. A wall of two cells is then thinner by a two-thousandth.
const LEAST: f64 = 1e-3;

/// A regular grid over a box. Lengths are in mm.
///
/// # Examples
/// ```
/// use deflex_elastic::Grid;
///
/// let grid = Grid::over([0.0; 3], [40.0, 4.0, 4.0], 1.0);
/// assert_eq!((grid.cells, grid.len(), grid.is_empty()), ([40, 4, 4], 640, false));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// The lower corner.
    pub low: [f64; 3],
    /// Size of a cell.
    pub size: [f64; 3],
    /// Cells along each axis.
    pub cells: [usize; 3],
}

impl Grid {
    /// The grid over a box whose cells are nearly cubes of the size `spacing`: the box has a whole number of cells along each
    /// axis.
    #[must_use]
    pub fn over(low: [f64; 3], high: [f64; 3], spacing: f64) -> Self {
        let cells: [usize; 3] = std::array::from_fn(|k| (((high[k] - low[k]) / spacing - 1e-9).ceil() as usize).max(1));
        Self { low, size: std::array::from_fn(|k| (high[k] - low[k]) / cells[k] as f64), cells }
    }

    /// Number of cells.
    #[must_use]
    pub fn len(&self) -> usize {
        self.cells.iter().product()
    }

    /// Whether it has no cells.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Indices of a cell from its number, x running fastest.
    pub(crate) fn cell(&self, number: usize) -> [usize; 3] {
        unravel(self.cells, number)
    }

    /// Nodes along each axis.
    pub(crate) fn nodes(&self) -> [usize; 3] {
        self.cells.map(|cells| cells + 1)
    }

    /// The position of a node, mm.
    pub(crate) fn place(&self, node: [usize; 3]) -> [f64; 3] {
        std::array::from_fn(|k| self.low[k] + self.size[k] * node[k] as f64)
    }
}

/// Indices from a number, x running fastest.
pub(crate) fn unravel(counts: [usize; 3], number: usize) -> [usize; 3] {
    [number % counts[0], number / counts[0] % counts[1], number / (counts[0] * counts[1])]
}

/// The number of indices, x running fastest.
pub(crate) fn ravel(counts: [usize; 3], at: [usize; 3]) -> usize {
    (at[2] * counts[1] + at[1]) * counts[0] + at[0]
}

/// The material in a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Filling {
    Empty,
    Full,
    /// Index of a rule.
    Cut(u32),
}

/// The part of a grid that is material.
///
/// # Examples
/// ```
/// use deflex_elastic::{Grid, Solid};
///
/// // A plate with a thickness of 2.5 mm in cells of 1 mm.
/// let plate = Solid::of(Grid::over([0.0; 3], [10.0, 10.0, 4.0], 1.0), |[_, _, z]| 2.5 - z);
/// assert!((plate.volume() - 250.0).abs() < 1.0); // mm³
/// assert!((plate.in_whole_cells().volume() - 250.0).abs() > 40.0);
/// assert_eq!((plate.grid().len(), plate.thinner_than(1.0)), (400, 0.0));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Solid {
    pub(crate) grid: Grid,
    pub(crate) cells: Vec<Filling>,
    pub(crate) rules: Vec<Rule>,
}

impl Solid {
    /// The cells that a body fills, wholly or in part. `depth` gives the depth of a point in the body, mm: near the surface its
    /// distance from the surface, and below zero outside.
    ///
    /// A cell whose corners and middle are all inside counts as full, so that a slot narrower than a cell may be missed. A wall
    /// thinner than a quarter of a cell may be missed as well ([`Solid::thinner_than`]).
    #[must_use]
    pub fn of(grid: Grid, depth: impl Fn([f64; 3]) -> f64 + Sync) -> Self {
        let nodes = grid.nodes();
        let near = ON_SURFACE * grid.size.iter().fold(f64::INFINITY, |least, size| least.min(*size));
        let corners: Vec<f64> = (0..nodes.iter().product::<usize>())
            .into_par_iter()
            .map(|number| depth(grid.place(unravel(nodes, number))))
            .collect();
        let look = |number: usize| -> Option<Rule> {
            let cell = grid.cell(number);
            let low = grid.place(cell);
            let at = |share: [f64; 3]| std::array::from_fn(|k| low[k] + share[k] * grid.size[k]);
            let corner = |a: usize| corners[ravel(nodes, std::array::from_fn(|k| cell[k] + (a >> k & 1)))];
            let middle = depth(at([0.5; 3]));
            if middle > -near && (0..8).all(|a| corner(a) > -near) {
                return Some(Rule::full());
            }
            // These points miss no wall that is thicker than a quarter of a cell along an axis.
            let quarter = |a: usize| depth(at(std::array::from_fn(|k| if a >> k & 1 == 1 { 0.75 } else { 0.25 })));
            if middle < near && (0..8).all(|a| corner(a) < near) && (0..8).all(|a| quarter(a) < near) {
                return None;
            }
            let mut rule = Rule::NONE;
            let step = 1.0 / SAMPLES as f64;
            for n in 0..SAMPLES.pow(3) {
                let sample = unravel([SAMPLES; 3], n);
                let low: [f64; 3] = std::array::from_fn(|k| sample[k] as f64 * step);
                let inside = depth(at(low.map(|t| t + 0.5 * step)));
                // The share of the sample's box on the inner side of a plane surface.
                let size = step * grid.size.iter().sum::<f64>() / 3.0;
                let share = (0.5 + inside / size).clamp(0.0, 1.0);
                if share > 0.0 {
                    rule.add(low, low.map(|t| t + step), share);
                }
            }
            (rule.share() > LEAST).then_some(rule)
        };
        let found: Vec<Option<Rule>> = (0..grid.len()).into_par_iter().map(look).collect();
        let mut rules = Vec::new();
        let full = Rule::full();
        let filling = |rule: Option<Rule>| match rule {
            None => Filling::Empty,
            Some(rule) if rule.share() > 1.0 - LEAST || rule == full => Filling::Full,
            Some(rule) => {
                rules.push(rule);
                Filling::Cut(rules.len() as u32 - 1)
            }
        };
        let cells = found.into_iter().map(filling).collect();
        Self { grid, cells, rules }
    }

    /// The same with whole cells only: those with at least half material. It shows what is gained by cutting the cells.
    #[must_use]
    pub fn in_whole_cells(&self) -> Self {
        let whole = |filling: &Filling| match filling {
            Filling::Cut(rule) if self.rules[*rule as usize].share() < 0.5 => Filling::Empty,
            Filling::Cut(_) => Filling::Full,
            filling => *filling,
        };
        Self { grid: self.grid, cells: self.cells.iter().map(whole).collect(), rules: Vec::new() }
    }

    /// The grid.
    #[must_use]
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Share of the cells with material that are in walls thinner than a number of cells along an axis of the grid. A wall of one
    /// cell bends correctly. The samples in its cells may not determine the thickness of a thinner one.
    #[must_use]
    pub fn thinner_than(&self, cells: f64) -> f64 {
        let counts = self.grid.cells;
        let mut thin = vec![false; self.cells.len()];
        for axis in 0..3 {
            let (next, last) = ((axis + 1) % 3, (axis + 2) % 3);
            for line in 0..counts[next] * counts[last] {
                let mut run: Vec<usize> = Vec::new();
                let mut thickness = 0.0;
                for along in 0..=counts[axis] {
                    let mut at = [0; 3];
                    (at[axis], at[next], at[last]) = (along, line % counts[next], line / counts[next]);
                    let number = if along < counts[axis] { ravel(counts, at) } else { usize::MAX };
                    if along < counts[axis] && self.cells[number] != Filling::Empty {
                        thickness += self.share(self.cells[number]);
                        run.push(number);
                        continue;
                    }
                    if thickness < cells {
                        run.iter().for_each(|cell| thin[*cell] = true);
                    }
                    run.clear();
                    thickness = 0.0;
                }
            }
        }
        thin.iter().filter(|thin| **thin).count() as f64 / self.elements().max(1) as f64
    }

    /// Number of cells with material.
    #[must_use]
    pub(crate) fn elements(&self) -> usize {
        self.cells.iter().filter(|filling| **filling != Filling::Empty).count()
    }

    /// Volume of the material, mm³.
    #[must_use]
    pub fn volume(&self) -> f64 {
        let sum: f64 = self.cells.iter().map(|filling| self.share(*filling)).sum();
        sum * self.grid.size.iter().product::<f64>()
    }

    pub(crate) fn share(&self, filling: Filling) -> f64 {
        match filling {
            Filling::Empty => 0.0,
            Filling::Full => 1.0,
            Filling::Cut(rule) => self.rules[rule as usize].share(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cut_box_has_its_volume() {
        let grid = Grid::over([0.0; 3], [4.0, 3.0, 2.0], 0.5);
        assert_eq!(grid.cells, [8, 6, 4]);
        let depth = |p: [f64; 3]| (1.3 - p[2]).min(p[0] - 0.2);
        let solid = Solid::of(grid, depth);
        assert!((solid.volume() - 3.8 * 3.0 * 1.3).abs() < 2e-2, "{}", solid.volume());
        assert_eq!(Solid::of(grid, |p| 1.0 - p[2]).elements(), 8 * 6 * 2);
    }

    #[test]
    fn a_wall_between_the_nodes_is_seen_and_called_thin() {
        // 0.3 mm thick in cells of 1 mm: it contains neither nodes nor middles of cells.
        let grid = Grid::over([0.0; 3], [4.0; 3], 1.0);
        let solid = Solid::of(grid, |p| 0.15 - (p[0] - 2.25).abs());
        assert_eq!(solid.elements(), 16);
        assert!((solid.thinner_than(1.0) - 1.0).abs() < 1e-12);
        assert!(Solid::of(grid, |_| 1.0).thinner_than(1.0) < 1e-12);
    }
}
