//! A table of the mean force around the programmed pose. An equilibrium evaluates the force many times, and the
//! integral would be too slow.
//!
//! Along the depth, the table has nodes that are joined by cubics through four of them. For the two small turns of the
//! axis, each node has one polynomial, fitted on Chebyshev points. The result is continuous, also where it changes over
//! to the integral, so that iterations on it converge.

use super::{ForceParts, Milling};
use nalgebra::{DMatrix, Unit, Vector3};
use rayon::prelude::*;
use std::f64::consts::PI;

/// Guaranteed error of a look-up over the force.
pub const TABLE_BOUND: f64 = 1e-3;

/// Error that the construction aims for at its check points: a tenth of the bound, because it may be larger between them.
const WANTED: f64 = 0.1 * TABLE_BOUND;
/// Error that is accepted in a cut whose force has kinks: half of the bound.
const ALLOWED: f64 = 0.5 * TABLE_BOUND;

/// Range towards smaller depths, as a share of the programmed depth. It ends before zero depth, where the force is zero and its relative
/// error is not defined.
const LESS: f64 = 0.5;

/// Ranges towards larger depths, in the order in which they are tried. Its own weight bends a large arm by some
/// millimetres.
fn ranges_towards_more(depth: f64) -> [f64; 3] {
    const SAG: f64 = 2.5e-3;
    [SAG.max(1.5 * depth), 1.5 * depth, LESS * depth]
}

/// The first range of turns of the axis that is tried, rad; it is halved until the table is accurate enough. Joints yield by some 1e-4 rad.
const TURN: f64 = 5e-3;
const HALVINGS: usize = 5;

/// Numbers of depth cells that are tried, the smallest first.
const CELLS: [usize; 3] = [16, 48, 96];

/// Feeds per tooth over the programmed one for which the bound is checked.
const FEEDS: [f64; 5] = [0.25, 0.5, 1.0, 2.0, 4.0];

/// Share of a range at which the table begins to be blended into the integral.
pub(super) const FADE: f64 = 0.9;

/// Number of smooth terms, and of all terms with the two that are needed near a lead of zero.
pub(super) const SMOOTH: usize = 10;
pub(super) const TERMS: usize = SMOOTH + 2;

/// Edge force (x, y, z), and cutting force over feed per tooth (x, y, z).
pub(super) type Values = [f64; 6];

/// The mean force by table look-up. Outside of the table's range it is the integral.
///
/// # Examples
/// ```
/// use deflex_cutting::{Cutter, Engagement, ForceTable, Milling, Mode, TABLE_BOUND, materials};
///
/// let cutter = Cutter { diameter: 0.025, corner_radius: 5e-3, teeth: 3, helix: 0.5 };
/// let slot = Engagement { mode: Mode::Slot, depth: 1e-3, width: 0.025, feed_per_tooth: 7e-5, lead: 0.1, tilt: 0.0 };
/// let material = materials::find("ni-al-bronze").expect("a material");
/// let table = ForceTable::new(Milling::new(cutter, slot, material.coefficients).expect("a possible cut"));
/// assert!(table.measured_error().is_none_or(|error| error < TABLE_BOUND));
/// if let Some([shift, tilt]) = table.ranges() {
///     println!("the table holds for {:.2} mm and {:.1}°", 1e3 * shift, tilt.to_degrees());
/// }
/// let (axis, nowhere) = (table.milling().axis_in_feed(), nalgebra::Vector3::zeros());
/// let exact = table.milling().mean_force(&nowhere, &axis);
/// assert!((table.mean_force(&nowhere, &axis, 7e-5) - exact).norm() < 0.01 * exact.norm());
/// ```
#[derive(Clone, Debug)]
pub struct ForceTable {
    milling: Milling,
    grid: Option<Grid>,
}

/// The table and its coordinates.
#[derive(Clone, Debug)]
pub(super) struct Grid {
    /// Two directions perpendicular to the programmed axis, feed frame.
    pub(super) across: [Vector3<f64>; 2],
    /// Shift at the middle of the depth range, and half its width, m.
    pub(super) depth_middle: f64,
    pub(super) depth_range: f64,
    pub(super) turn_range: f64,
    /// Whether the lead passes through zero within the range.
    pub(super) level: bool,
    pub(super) cells: usize,
    /// Polynomials at the depths −1, 0 … cells, cells + 1 in units of a cell.
    pub(super) nodes: Vec<[Values; TERMS]>,
    error: f64,
}

/// A place in the table: depth and turns in [−1, 1].
#[derive(Clone, Copy, Debug)]
pub(super) struct TablePoint {
    pub(super) depth: f64,
    pub(super) turn: [f64; 2],
    /// Sine of the lead there, in units of the turn range.
    pub(super) lead: f64,
}

impl ForceTable {
    /// Builds the table, compares it with the integral between its nodes, and narrows its range until the error is far
    /// below [`TABLE_BOUND`]. If no range is accurate enough, every call computes the integral.
    pub fn new(milling: Milling) -> Self {
        let tries = |share: f64| {
            let more = ranges_towards_more(milling.engagement().depth);
            more.into_iter().flat_map(move |more| CELLS.map(|cells| (share, more, cells)))
        };
        for allowed in [WANTED, ALLOWED] {
            for halvings in 0..HALVINGS {
                let share = 0.5_f64.powi(i32::try_from(halvings).unwrap_or(0));
                for (share, more, cells) in tries(share) {
                    let mut grid = Grid::new(&milling, share, more, cells);
                    if grid.error_along_depth(&milling, allowed) > allowed {
                        continue;
                    }
                    // More cells along the depth do not reduce the error of the turns.
                    if grid.error_across_depth(&milling, allowed) > allowed {
                        break;
                    }
                    grid.fill(&milling);
                    grid.error = grid.measured_error(&milling, allowed);
                    if grid.error <= allowed {
                        return ForceTable { milling, grid: Some(grid) };
                    }
                }
            }
        }
        ForceTable { milling, grid: None }
    }

    /// Polynomials at the depths; empty if there is no table.
    pub(super) fn nodes(&self) -> &[[Values; TERMS]] {
        self.grid.as_ref().map_or(&[], |grid| &grid.nodes)
    }

    /// The cut to which the table belongs.
    pub fn milling(&self) -> &Milling {
        &self.milling
    }

    /// Largest relative error of the force that was found during construction; `None` if there is no table.
    pub fn measured_error(&self) -> Option<f64> {
        self.grid.as_ref().map(|grid| grid.error)
    }

    /// Ranges around the programmed pose in both directions: depth (m; towards larger depths it may be wider) and turn
    /// of the axis (rad).
    pub fn ranges(&self) -> Option<[f64; 2]> {
        let of = |g: &Grid| [g.depth_range + g.depth_middle, g.turn_range];
        self.grid.as_ref().map(of)
    }

    /// [`Milling::mean_force`] at a feed per tooth (m), within [`TABLE_BOUND`] of it.
    #[inline]
    pub fn mean_force(&self, shift: &Vector3<f64>, axis: &Unit<Vector3<f64>>, feed_per_tooth: f64) -> Vector3<f64> {
        let integral = || self.milling.force_parts(shift, axis).at(feed_per_tooth);
        match self.find(shift, axis, feed_per_tooth) {
            Some((grid, place)) => self.faded(parts(&grid.values(&place)).at(feed_per_tooth), &place, integral),
            None => integral(),
        }
    }

    /// The grid, if the table has one.
    pub(super) fn grid(&self) -> Option<&Grid> {
        self.grid.as_ref()
    }

    /// The grid, if it is valid at a feed per tooth (m).
    #[inline(always)]
    pub(super) fn grid_at(&self, feed_per_tooth: f64) -> Option<&Grid> {
        let feed = feed_per_tooth / self.milling.engagement().feed_per_tooth;
        self.grid.as_ref().filter(|_| (FEEDS[0]..=FEEDS[4]).contains(&feed))
    }

    /// The grid and the place in it, if the table is valid there.
    #[inline(always)]
    pub(super) fn find(
        &self,
        shift: &Vector3<f64>,
        axis: &Unit<Vector3<f64>>,
        feed_per_tooth: f64,
    ) -> Option<(&Grid, TablePoint)> {
        let grid = self.grid_at(feed_per_tooth)?;
        let place = grid.place(shift, axis);
        // False for NaN, so that NaN is passed to the integral too.
        (place.reach() < 1.0).then_some((grid, place))
    }

    /// Blends the table's value into that of the integral towards the end of the range.
    #[inline(always)]
    pub(super) fn faded(
        &self,
        force: Vector3<f64>,
        place: &TablePoint,
        integral: impl FnOnce() -> Vector3<f64>,
    ) -> Vector3<f64> {
        let reach = place.reach();
        if reach <= FADE {
            return force;
        }
        let t = (reach - FADE) / (1.0 - FADE);
        force.lerp(&integral(), t * t * (3.0 - 2.0 * t))
    }
}

impl TablePoint {
    #[inline(always)]
    pub(super) fn reach(&self) -> f64 {
        let [u, v] = self.turn;
        [self.depth, u, v].iter().fold(0.0, |reach, x| if x.abs() <= reach { reach } else { x.abs() })
    }
}

impl Grid {
    fn new(milling: &Milling, share: f64, more: f64, cells: usize) -> Self {
        let engagement = milling.engagement();
        let axis = milling.axis_in_feed();
        let y = axis.cross(&Vector3::x()).normalize();
        Grid {
            across: [y.cross(&axis), y],
            // A higher tip cuts less deep.
            depth_middle: 0.5 * (LESS * engagement.depth - more),
            depth_range: 0.5 * (LESS * engagement.depth + more),
            turn_range: TURN * share,
            level: axis.x.abs() < 1.5 * TURN * share,
            cells,
            nodes: Vec::with_capacity(cells + 3),
            error: f64::INFINITY,
        }
    }

    /// Depth of a node, in [−1, 1] except for the outer nodes.
    fn depth_of(&self, node: usize) -> f64 {
        2.0 * (node as f64 - 1.0) / self.cells as f64 - 1.0
    }

    fn fill(&mut self, milling: &Milling) {
        let places = self.fit_places(milling);
        let fit = self.least_squares(&places);
        let node = |k: usize| self.polynomials(milling, self.depth_of(k), (&places, &fit));
        self.nodes = (0..self.cells + 3).into_par_iter().map(node).collect();
    }

    /// The polynomials at a depth, from values at the places of a fit.
    fn polynomials(
        &self,
        milling: &Milling,
        depth: f64,
        (places, fit): (&[TablePoint], &DMatrix<f64>),
    ) -> [Values; TERMS] {
        let rows: Vec<Values> = places.iter().map(|p| self.integral(milling, &TablePoint { depth, ..*p })).collect();
        let coefficient = |m: usize, k: usize| {
            if m < fit.nrows() { (0..rows.len()).map(|i| fit[(m, i)] * rows[i][k]).sum() } else { 0.0 }
        };
        std::array::from_fn(|m| std::array::from_fn(|k| coefficient(m, k)))
    }

    /// Error of the cubics along the depth without a turn, found with a grid that has only this column.
    fn error_along_depth(&self, milling: &Milling, enough: f64) -> f64 {
        let constant = |value: Values| std::array::from_fn(|m| if m == 0 { value } else { [0.0; 6] });
        let untilted = |depth: f64| self.integral(milling, &self.at(milling, depth, [0.0; 2]));
        let nodes = (0..self.cells + 3).map(|k| constant(untilted(self.depth_of(k)))).collect();
        let column = Grid { nodes, ..self.clone() };
        let mut worst: f64 = 0.0;
        for cell in 0..self.cells {
            let place = column.at(milling, column.between_nodes(cell), [0.0; 2]);
            let values = column.between(&TablePoint { turn: [0.0; 2], lead: 0.0, ..place });
            worst = worst.max(error(milling, &self.integral(milling, &place), &values));
            if worst > enough {
                break;
            }
        }
        worst
    }

    /// Error of the polynomials in the turns, at some depths.
    fn error_across_depth(&self, milling: &Milling, enough: f64) -> f64 {
        const DEPTHS: [f64; 4] = [-0.9, -0.2, 0.4, 1.0];
        let places = self.fit_places(milling);
        let fit = self.least_squares(&places);
        let mut worst: f64 = 0.0;
        for depth in DEPTHS {
            let polynomials = self.polynomials(milling, depth, (&places, &fit));
            for turn in CHECKED_TURNS {
                let place = self.at(milling, depth, turn);
                let terms = self.terms(&place);
                let values = std::array::from_fn(|k| terms.iter().zip(&polynomials).map(|(term, p)| term * p[k]).sum());
                worst = worst.max(error(milling, &self.integral(milling, &place), &values));
                if worst > enough {
                    return worst;
                }
            }
        }
        worst
    }

    /// A depth within a cell. It is at different distances from the middle of successive cells, so that no symmetry
    /// hides an error.
    fn between_nodes(&self, cell: usize) -> f64 {
        (2.0 * cell as f64 + [0.5, 1.0, 1.4][cell % 3]) / self.cells as f64 - 1.0
    }

    /// Chebyshev points of the coordinates other than depth.
    fn fit_places(&self, milling: &Milling) -> Vec<TablePoint> {
        // One point more than the degree, and enough for the additional terms where they are used.
        let turns = if self.level { 6 } else { 4 };
        let chebyshev = |i: usize, n: usize| (PI * (i as f64 + 0.5) / n as f64).cos();
        let mut places = Vec::new();
        for i in 0..turns {
            for j in 0..turns {
                places.push(self.at(milling, 0.0, [chebyshev(i, turns), chebyshev(j, turns)]));
            }
        }
        places
    }

    fn at(&self, milling: &Milling, depth: f64, turn: [f64; 2]) -> TablePoint {
        TablePoint { depth, turn, lead: self.axis(milling, turn).x / self.turn_range }
    }

    fn axis(&self, milling: &Milling, turn: [f64; 2]) -> Unit<Vector3<f64>> {
        let [u, v] = turn.map(|turn| turn * self.turn_range);
        let along = milling.axis_in_feed().into_inner() * (1.0 - u * u - v * v).sqrt();
        Unit::new_normalize(along + self.across[0] * u + self.across[1] * v)
    }

    #[inline(always)]
    pub(super) fn place(&self, shift: &Vector3<f64>, axis: &Unit<Vector3<f64>>) -> TablePoint {
        TablePoint {
            depth: (shift.z - self.depth_middle) / self.depth_range,
            turn: self.across.map(|across| across.dot(axis) / self.turn_range),
            lead: axis.x / self.turn_range,
        }
    }

    /// The integral at a place.
    fn integral(&self, milling: &Milling, place: &TablePoint) -> Values {
        let shift = Vector3::new(0.0, 0.0, self.depth_middle + place.depth * self.depth_range);
        let ForceParts { edge: e, cutting: c } = milling.force_parts(&shift, &self.axis(milling, place.turn));
        [e.x, e.y, e.z, c.x, c.y, c.z]
    }

    #[inline]
    fn values(&self, place: &TablePoint) -> Values {
        self.between(place)
    }

    /// The cell of a place, and the weights of the nodes at its −1, 0, 1, 2: a cubic through them.
    #[inline(always)]
    pub(super) fn cell(&self, place: &TablePoint) -> (usize, [f64; 4]) {
        let at = (0.5 * (place.depth + 1.0) * self.cells as f64).clamp(0.0, self.cells as f64);
        let cell = self.cell_at(at);
        let t = at - cell as f64;
        let weights = [
            -t * (t - 1.0) * (t - 2.0) / 6.0,
            (t + 1.0) * (t - 1.0) * (t - 2.0) / 2.0,
            -(t + 1.0) * t * (t - 2.0) / 2.0,
            (t + 1.0) * t * (t - 1.0) / 6.0,
        ];
        (cell, weights)
    }

    /// The cell of a place along the depth, in units of cells.
    pub(super) fn cell_at(&self, at: f64) -> usize {
        (at as usize).min(self.cells - 1)
    }

    /// The value between the nodes, from the values of the polynomials at the nodes.
    fn between(&self, place: &TablePoint) -> Values {
        let (cell, weights) = self.cell(place);
        let terms = self.terms(place);
        let mut values = [0.0; 6];
        for (weight, node) in weights.iter().zip(&self.nodes[cell..cell + 4]) {
            for (term, at) in terms.iter().zip(node) {
                for (value, at) in values.iter_mut().zip(at) {
                    *value += weight * term * at;
                }
            }
        }
        values
    }

    /// The terms, up to third degree in the turns.
    ///
    /// Where the lead l passes through zero, the ring where the corner meets the flat begins or ceases to face the
    /// feed. Its arc integrals behave like |l| and l·ln|l|, which no polynomial approximates.
    #[inline(always)]
    pub(super) fn terms(&self, place: &TablePoint) -> [f64; TERMS] {
        let ([u, v], l) = (place.turn, place.lead);
        let [kink, log] = if self.level { kinks(l) } else { [0.0; 2] };
        [1.0, u, v, u * u, u * v, v * v, u * u * u, u * u * v, u * v * v, v * v * v, kink, log]
    }

    /// Matrix that turns values at the places into coefficients of the terms.
    fn least_squares(&self, places: &[TablePoint]) -> DMatrix<f64> {
        let terms = if self.level { TERMS } else { SMOOTH };
        let design = DMatrix::from_fn(places.len(), terms, |i, m| self.terms(&places[i])[m]);
        // There are more points than terms, and they distinguish the terms: the matrix is positive definite.
        match design.tr_mul(&design).cholesky() {
            Some(cholesky) => cholesky.solve(&design.transpose()),
            None => DMatrix::zeros(terms, places.len()),
        }
    }

    /// Largest relative error of the force at points between the nodes and up to the corners of the range. The search
    /// ends as soon as an error exceeds `enough`, and returns that error.
    fn measured_error(&self, milling: &Milling, enough: f64) -> f64 {
        let mut worst: f64 = 0.0;
        for cell in 0..self.cells {
            for turn in CHECKED_TURNS {
                let place = self.at(milling, self.between_nodes(cell), turn);
                worst = worst.max(error(milling, &self.integral(milling, &place), &self.values(&place)));
            }
            if worst > enough {
                break;
            }
        }
        worst
    }
}

/// Turns at which the error is computed, in units of the range.
const CHECKED_TURNS: [[f64; 2]; 9] =
    [[0.0, 0.0], [1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0], [0.6, 0.0], [-0.5, 0.1], [0.1, 0.5], [-0.1, -0.7]];

/// Relative error of the force, the largest one for several feeds per tooth.
fn error(milling: &Milling, want: &Values, got: &Values) -> f64 {
    let (want, got) = (parts(want), parts(got));
    let edge = (want.edge - got.edge).norm();
    let cutting = (want.cutting - got.cutting).norm();
    let feeds = FEEDS.map(|share| share * milling.engagement().feed_per_tooth);
    // A force of zero without an error gives NaN, which `max` ignores.
    feeds.into_iter().map(|feed| (edge + feed * cutting) / want.at(feed).norm()).fold(0.0, f64::max)
}

/// The two additional terms near a lead of zero.
#[inline(always)]
pub(super) fn kinks(lead: f64) -> [f64; 2] {
    if lead != 0.0 { [lead.abs(), lead * lead.abs().ln()] } else { [0.0; 2] }
}

pub(super) fn parts(v: &Values) -> ForceParts {
    ForceParts { edge: Vector3::new(v[0], v[1], v[2]), cutting: Vector3::new(v[3], v[4], v[5]) }
}
