//! A force table for one feed per tooth, evaluated at one place or at eight places at once.

use super::table::{FADE, ForceTable, Grid, SMOOTH, TERMS, TablePoint, Values, kinks, parts};
use deflex_lanes::{LaneMask, Lanes, Mask, Real, Vector, WIDTH, widest};
use nalgebra::{Unit, Vector3};
use std::sync::Arc;

/// A [`ForceTable`] for one feed per tooth. Edge and cutting force are added beforehand, which halves the work.
#[derive(Clone, Debug)]
#[doc(hidden)]
pub struct FeedTable {
    table: Arc<ForceTable>,
    feed_per_tooth: f64,
    /// Whether the table is valid at that feed.
    holds: bool,
    cells: Vec<Cell>,
}

/// For x, y and z: the coefficients of each term at the four nodes around a cell, N.
type Cell = [[[f64; 4]; TERMS]; 3];

/// Eight places in the table.
#[derive(Default)]
struct Places {
    turn: [Lanes; 2],
    lead: Lanes,
    /// The places along the depth in units of cells, and the cell of each.
    at: Lanes,
    cell: Lanes,
    /// Lanes in which the table is valid and not blended.
    inside: LaneMask,
    kinks: [Lanes; 2],
    /// Lanes whose force is still to be computed.
    left: LaneMask,
}

impl ForceTable {
    /// The table for one feed per tooth (m).
    #[doc(hidden)]
    pub fn at_feed(self: &Arc<Self>, feed_per_tooth: f64) -> FeedTable {
        FeedTable::new(self, feed_per_tooth)
    }
}

impl FeedTable {
    fn new(table: &Arc<ForceTable>, feed_per_tooth: f64) -> Self {
        let force = |v: &Values| -> [f64; 3] { parts(v).at(feed_per_tooth).into() };
        let nodes: Vec<[[f64; 3]; TERMS]> = table.nodes().iter().map(|node| node.each_ref().map(force)).collect();
        let cell = |nodes: &[[[f64; 3]; TERMS]]| {
            std::array::from_fn(|axis| std::array::from_fn(|m| std::array::from_fn(|k| nodes[k][m][axis])))
        };
        let holds = table.grid_at(feed_per_tooth).is_some();
        Self { table: Arc::clone(table), feed_per_tooth, holds, cells: nodes.windows(4).map(cell).collect() }
    }

    /// The table for another feed per tooth (m).
    pub fn at_feed(&self, feed_per_tooth: f64) -> Self {
        Self::new(&self.table, feed_per_tooth)
    }

    /// Feed per tooth, m.
    pub fn feed_per_tooth(&self) -> f64 {
        self.feed_per_tooth
    }

    /// [`ForceTable::mean_force`].
    #[inline]
    pub fn mean_force(&self, shift: &Vector3<f64>, axis: &Unit<Vector3<f64>>) -> Vector3<f64> {
        let integral = || self.table.milling().force_parts(shift, axis).at(self.feed_per_tooth);
        match self.table.find(shift, axis, self.feed_per_tooth) {
            Some((grid, place)) => self.table.faded(self.between(grid, &place), &place, integral),
            None => integral(),
        }
    }

    /// [`Grid::between`], with the four nodes of a cell next to each other.
    fn between(&self, grid: &Grid, place: &TablePoint) -> Vector3<f64> {
        let (cell, weights) = grid.cell(place);
        let terms = grid.terms(place);
        Vector3::from(self.cells[cell].each_ref().map(|axis| {
            let mut sums = [0.0; 4];
            for (term, nodes) in terms.iter().zip(axis) {
                for (sum, node) in sums.iter_mut().zip(nodes) {
                    *sum += term * node;
                }
            }
            weights.iter().zip(sums).fold(0.0, |force, (weight, sum)| force + weight * sum)
        }))
    }

    /// The mean forces, N, at those of eight places that are wanted, for shifts of the tip (m) and unit vectors of the
    /// axis, feed frame.
    pub fn mean_forces(&self, wanted: LaneMask, shift: &Vector, axis: &Vector, force: &mut Vector) {
        let mut inside = LaneMask::default();
        if let Some(grid) = self.table.grid().filter(|_| self.holds) {
            let mut places = Places::default();
            widest!(<'a> (
                grid: &'a Grid = grid,
                shift: &'a Vector = shift,
                axis: &'a Vector = axis,
                places: &'a mut Places = &mut places,
            ) {
                places.take(grid, shift, axis);
            });
            if grid.level {
                for lane in 0..WIDTH {
                    let [kink, log] = kinks(places.lead.lane(lane));
                    places.kinks[0].set(lane, kink);
                    places.kinks[1].set(lane, log);
                }
            }
            inside = wanted & places.inside;
            places.left = inside;
            while let Some(lane) = places.left.next() {
                // The places of neighbouring targets are nearly always in the same cell.
                let number = places.cell.lane(lane);
                widest!(<'a> (
                    cell: (f64, &'a Cell) = (number, &self.cells[number as usize]),
                    grid: &'a Grid = grid,
                    places: &'a mut Places = &mut places,
                    force: &'a mut Vector = force,
                ) {
                    places.between(cell, grid, force);
                });
            }
        }
        let others = wanted & inside.not();
        for lane in (0..WIDTH).filter(|lane| others.lane(*lane)) {
            force.set(lane, &self.mean_force(&shift.lane(lane), &Unit::new_unchecked(axis.lane(lane))));
        }
    }
}

impl Places {
    /// [`Grid::place`].
    #[inline(always)]
    fn take(&mut self, grid: &Grid, shift: &Vector, axis: &Vector) {
        let depth = (shift.z - grid.depth_middle) / grid.depth_range;
        // `map` of an array would be compiled as a call outside of the widest lanes.
        let turned = |across: &Vector3<f64>| Vector::of(across).dot(*axis) / grid.turn_range;
        let (u, v) = (turned(&grid.across[0]), turned(&grid.across[1]));
        let within = |x: Lanes| Lanes::of(FADE).ge(x.abs());
        self.inside = within(depth) & within(u) & within(v);
        (self.turn, self.lead) = ([u, v], axis.x / grid.turn_range);
        self.at = (depth + 1.0) * 0.5 * grid.cells as f64;
        self.cell = self.at.floor();
    }

    /// [`FeedTable::between`] for all places that are in one cell.
    #[inline(always)]
    fn between(&mut self, (number, cell): (f64, &Cell), grid: &Grid, force: &mut Vector) {
        let here = self.left & self.cell.eq(number);
        self.left = self.left & here.not();
        let [u, v] = self.turn;
        let terms: [Lanes; SMOOTH] =
            [Lanes::of(1.0), u, v, u * u, u * v, v * v, u * u * u, u * u * v, u * v * v, v * v * v];
        let t = self.at - number;
        let (less, more, far) = (t - 1.0, t + 1.0, t - 2.0);
        let weights = [-t * less * far / 6.0, more * less * far / 2.0, -more * t * far / 2.0, more * t * less / 6.0];
        for (axis, force) in cell.iter().zip([&mut force.x, &mut force.y, &mut force.z]) {
            let mut sums = [Lanes::ZERO; 4];
            for (term, nodes) in terms.iter().zip(axis) {
                for k in 0..4 {
                    sums[k] = sums[k] + *term * nodes[k];
                }
            }
            if grid.level {
                for (term, nodes) in self.kinks.iter().zip(&axis[SMOOTH..]) {
                    for k in 0..4 {
                        sums[k] = sums[k] + *term * nodes[k];
                    }
                }
            }
            let [a, b, c, d] = weights;
            let all = a * sums[0] + b * sums[1] + c * sums[2] + d * sums[3];
            *force = here.select(all, *force);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Coefficients, Cutter, Engagement, Milling, Mode};
    use proptest::prelude::*;
    use std::sync::LazyLock;

    /// Rounding: both compute the same sums in the same order.
    const SAME: f64 = 1e-12;

    const LEADS: [f64; 3] = [0.0, 0.002, 0.09];

    /// One table for each mode and lead.
    static TABLES: LazyLock<Vec<Arc<ForceTable>>> = LazyLock::new(|| {
        let table = |mode: Mode, lead: f64| {
            let cutter = Cutter { diameter: 0.02, corner_radius: 0.002, teeth: 4, helix: 0.5 };
            let width = if mode == Mode::Slot { 0.02 } else { 0.008 };
            let engagement = Engagement { mode, depth: 2e-3, width, feed_per_tooth: 1e-4, lead, tilt: 0.0 };
            let coefficients = Coefficients { ktc: 800e6, krc: 300e6, kac: 150e6, kte: 10e3, kre: 10e3, kae: 2e3 };
            Arc::new(ForceTable::new(Milling::new(cutter, engagement, coefficients).unwrap()))
        };
        [Mode::Slot, Mode::Down, Mode::Up].into_iter().flat_map(|mode| LEADS.map(|lead| table(mode, lead))).collect()
    });

    proptest! {
        #[test]
        fn eight_forces_are_each_by_itself(
            table in 0..3 * LEADS.len(),
            share in prop::sample::select(vec![0.3, 1.0, 9.0]),
            shifts in prop::array::uniform8(prop::array::uniform3(-1.3_f64..1.3)),
            turns in prop::array::uniform8(prop::array::uniform2(-1.3_f64..1.3)),
            same: bool,
            wanted: u8,
        ) {
            let axis = TABLES[table].milling().axis_in_feed();
            let table = TABLES[table].at_feed(share * 1e-4);
            let (mut shift, mut axes) = (Vector::default(), Vector::default());
            for lane in 0..WIDTH {
                // Either all in one cell, or anywhere, including the ends of the table and places beyond.
                let size = if same { 1e-5 } else { 2.5e-3 };
                shift.set(lane, &(Vector3::from(shifts[lane]) * size));
                let turned = axis.into_inner() + Vector3::new(turns[lane][0], turns[lane][1], 0.0) * (2.0 * size);
                axes.set(lane, &turned.normalize());
            }
            let wanted = LaneMask::of(|lane| wanted >> lane & 1 == 1);
            let untouched = Vector3::new(1.0, 2.0, 3.0);
            let mut forces = Vector::of(&untouched);
            table.mean_forces(wanted, &shift, &axes, &mut forces);
            for lane in 0..WIDTH {
                let plain = table.mean_force(&shift.lane(lane), &Unit::new_unchecked(axes.lane(lane)));
                let plain = if wanted.lane(lane) { plain } else { untouched };
                prop_assert!((forces.lane(lane) - plain).norm() <= SAME * plain.norm(), "{} {plain}", forces.lane(lane));
            }
        }
    }
}
