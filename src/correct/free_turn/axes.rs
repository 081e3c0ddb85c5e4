//! External axes that are free: cells of a grid of their positions about a way along the path, and lanes between the cells.
//!
//! An axis needs a stretch of the path to get from one cell to the next. Over a stretch, a lane runs evenly from a cell to the same
//! one or to a neighbour, so that a coarse grid can be followed at any speed. The grid is laid about the way that the program
//! has written, then ever finer about the best one found.

use crate::cell::{Cell, MOST_FREE};
use crate::robot::{EXTERNAL_AXES, External, UnitKind};
use smallvec::SmallVec;

/// Positions of the free axes, mm or degrees; zero where there are fewer.
pub(super) type Position = [f64; MOST_FREE];

/// The move into a target.
#[derive(Clone, Copy, Debug)]
pub(super) struct Move {
    /// Length of the path, m.
    pub(super) length: f64,
    /// Duration, s, where the feed is known.
    pub(super) time: Option<f64>,
    /// Joint-interpolated, or not cutting in CL data: the arm may turn and change its branch.
    pub(super) free: bool,
    /// Either end has a turn of its own.
    pub(super) fixed: bool,
    /// How far each free axis may run on it, mm or degrees.
    pub(super) room: Position,
}

/// A cell of the first grid: mm of linear units, of which an arm's stiffness changes little over less, degrees of rotary ones.
const COARSE: [f64; 2] = [250.0, 30.0];

/// A cell of the last grid at most, mm or degrees: smoothing goes on from there.
const FINE: [f64; 2] = [10.0, 2.0];

/// Cells of the first grid along an axis at most, where one is free, and where two are.
const MOST_CELLS: [f64; MOST_FREE] = [17.0, 5.0];

/// How fast an axis may run along the path, mm or degrees a metre: a track no faster than the tool, a table as the turn about
/// the tool axis.
const RATE: [f64; 2] = [1e3, 5e3];

/// Positions are chosen in steps of this, mm or degrees: what is written is then what was solved.
const WRITTEN: f64 = 1e-3;

/// Rounding of positions, mm or degrees.
const SLACK: f64 = 1e-6;

/// An external axis that is free.
#[derive(Clone, Debug)]
pub(super) struct FreeAxis {
    pub(super) name: String,
    /// Index of the external axis.
    pub(super) axis: usize,
    min: f64,
    max: f64,
    max_speed: Option<f64>,
    rotary: bool,
}

impl FreeAxis {
    /// Those of a cell.
    pub(super) fn of(cell: &Cell) -> SmallVec<[Self; MOST_FREE]> {
        let free = cell.units.all().iter().filter(|unit| unit.free);
        let axis = |unit: &crate::robot::Unit| Self {
            name: unit.name.clone(),
            axis: unit.axis,
            min: unit.min,
            max: unit.max,
            max_speed: unit.max_speed,
            rotary: unit.kind == UnitKind::Rotary,
        };
        free.map(axis).collect()
    }

    fn kind(&self) -> usize {
        usize::from(self.rotary)
    }

    /// How far it may run on a way of a length (m) and a duration (s), mm or degrees.
    pub(super) fn room(&self, length: f64, time: Option<f64>) -> f64 {
        let along = RATE[self.kind()] * length;
        self.max_speed.zip(time).map_or(along, |(speed, time)| along.min(speed * time))
    }

    /// As it can be written.
    pub(super) fn rounded(&self, position: f64) -> f64 {
        ((position / WRITTEN).round() * WRITTEN).clamp(self.min, self.max)
    }

    /// mm or degrees as m or rad.
    pub(super) fn si(&self, position: f64) -> f64 {
        if self.rotary { position.to_radians() } else { 1e-3 * position }
    }
}

/// A way over a stretch of the path, from one cell of the grid to another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Lane {
    pub(super) from: u16,
    pub(super) to: u16,
}

/// Where a knot stands in its stretch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stage {
    /// The stretch begins with the way into this knot.
    pub(super) begins: bool,
    /// Share of the stretch up to it.
    share: f64,
    /// The stretch is long enough for a neighbouring cell.
    is_whole: bool,
}

/// The grid.
#[derive(Clone, Debug)]
pub(super) struct Grid {
    /// Size of a cell, mm or degrees.
    pub(super) cell: Position,
    /// Cells, in cells from the base.
    cells: Vec<[i16; MOST_FREE]>,
    pub(super) lanes: Vec<Lane>,
    /// The lane along the base.
    pub(super) still: u16,
}

impl Grid {
    /// The first one.
    pub(super) fn coarse(axes: &[FreeAxis]) -> Self {
        let most = MOST_CELLS[axes.len().saturating_sub(1)] - 1.0;
        let mut cell = [0.0; MOST_FREE];
        let mut reach = [0; MOST_FREE];
        for (k, axis) in axes.iter().enumerate() {
            let range = axis.max - axis.min;
            cell[k] = COARSE[axis.kind()].max(range / most).min(range);
            #[allow(clippy::cast_possible_truncation)] // at most as many as `MOST_CELLS`
            let cells = (range / cell[k] + SLACK).floor() as i16;
            reach[k] = cells;
        }
        Self::new(cell, reach)
    }

    /// One of half the size, about a way that was found.
    pub(super) fn finer(&self, axes: &[FreeAxis]) -> Self {
        Self::new(self.cell.map(|cell| 0.5 * cell), std::array::from_fn(|k| i16::from(k < axes.len())))
    }

    /// Whether smoothing does the rest.
    pub(super) fn is_fine(&self, axes: &[FreeAxis]) -> bool {
        axes.iter().zip(self.cell).all(|(axis, cell)| cell <= FINE[axis.kind()])
    }

    fn new(cell: Position, [first, second]: [i16; MOST_FREE]) -> Self {
        let cells: Vec<[i16; MOST_FREE]> =
            (-first..=first).flat_map(|a| (-second..=second).map(move |b| [a, b])).collect();
        let apart = |a: &[i16; MOST_FREE], b: &[i16; MOST_FREE]| a[0].abs_diff(b[0]) + a[1].abs_diff(b[1]);
        let mut lanes = Vec::new();
        for (from, a) in (0_u16..).zip(&cells) {
            lanes.extend((0_u16..).zip(&cells).filter(|(_, b)| apart(a, b) <= 1).map(|(to, _)| Lane { from, to }));
        }
        let base = cells.iter().position(|cell| *cell == [0; MOST_FREE]).unwrap_or(0);
        let is_still = |lane: &Lane| usize::from(lane.from) == base && lane.from == lane.to;
        // Lanes are some hundred.
        let still = lanes.iter().position(is_still).unwrap_or(0) as u16;
        Self { cell, cells, lanes, still }
    }

    /// How many cells there are.
    pub(super) fn size(&self) -> usize {
        self.cells.len()
    }

    /// Stretches of the path, of the ways into its knots and of the knots that only the base leads to.
    pub(super) fn stages(&self, axes: &[FreeAxis], ways: &[Move], pinned: &[bool]) -> Vec<Stage> {
        let mut stages: Vec<Stage> = Vec::with_capacity(ways.len());
        // Knots of the stretch, by the cells that the axes can have passed.
        let mut open: Vec<f64> = Vec::new();
        let mut close = |open: &mut Vec<f64>| {
            let whole = open.last().copied().unwrap_or(0.0);
            let share = |passed: f64| if whole > 0.0 { passed / whole } else { 0.0 };
            let stage = |(k, passed): (usize, f64)| Stage {
                begins: k == 0,
                share: share(passed),
                is_whole: whole >= 1.0 - SLACK,
            };
            stages.extend(open.drain(..).enumerate().map(stage));
        };
        for (at, way) in ways.iter().enumerate() {
            if at == 0 || way.free {
                close(&mut open);
                open.push(0.0);
                continue;
            }
            let passed = axes.iter().enumerate().map(|(k, _)| way.room[k] / self.cell[k]).fold(f64::INFINITY, f64::min);
            let passed = if passed.is_finite() { passed } else { 0.0 };
            if pinned[at - 1] || open.last().is_none_or(|last| *last >= 1.0 - SLACK) {
                close(&mut open);
            }
            let before = open.last().copied().unwrap_or(0.0);
            open.push(before + passed);
        }
        close(&mut open);
        stages
    }

    /// Where a lane stands at a knot whose base is known; `None` beyond the limits, or where it cannot be.
    pub(super) fn position(&self, axes: &[FreeAxis], lane: u16, base: &Position, stage: &Stage) -> Option<Position> {
        let Lane { from, to } = self.lanes[usize::from(lane)];
        if from != to && !stage.is_whole {
            return None;
        }
        let (from, to) = (self.cells[usize::from(from)], self.cells[usize::from(to)]);
        let mut position = *base;
        for (k, axis) in axes.iter().enumerate() {
            let (from, to) = (f64::from(from[k]), f64::from(to[k]));
            position[k] += self.cell[k] * (from + stage.share * (to - from));
            if !(axis.min - SLACK..=axis.max + SLACK).contains(&position[k]) {
                return None;
            }
        }
        Some(position)
    }
}

/// Positions of the external axes with those of the free ones.
pub(super) fn with(external: &External, axes: &[FreeAxis], position: &Position) -> External {
    let mut external = *external;
    for (axis, position) in axes.iter().zip(position) {
        external[axis.axis] = *position;
    }
    external
}

/// Positions of the free axes alone; NaN of others.
pub(super) fn alone(axes: &[FreeAxis], position: &Position) -> External {
    with(&[f64::NAN; EXTERNAL_AXES], axes, position)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis(min: f64, max: f64) -> FreeAxis {
        FreeAxis { name: "T".into(), axis: 0, min, max, max_speed: Some(100.0), rotary: false }
    }

    fn way(room: f64, free: bool) -> Move {
        Move { length: 1e-3, time: None, free, fixed: false, room: [room, 0.0] }
    }

    #[test]
    fn an_axis_runs_no_faster_than_the_tool_and_its_drive() {
        assert!((axis(0.0, 1.0).room(0.01, None) - 10.0).abs() < 1e-12);
        assert!((axis(0.0, 1.0).room(0.01, Some(0.05)) - 5.0).abs() < 1e-12);
    }

    #[test]
    fn a_lane_takes_a_stretch_to_the_next_cell() {
        let axes = [axis(-1000.0, 1000.0)];
        let grid = Grid::coarse(&axes);
        assert_eq!(grid.size(), 17);
        assert_eq!(grid.lanes.len(), 17 + 2 * 16);
        let ways: Vec<Move> = (0..7).map(|k| way(125.0, k == 0)).collect();
        let stages = grid.stages(&axes, &ways, &[false; 7]);
        // The first knot stands before the first stretch; the last stretch is whole too.
        let halves = |stage: &Stage| (stage.begins, (2.0 * stage.share).round() as u8);
        let seen: Vec<(bool, u8)> = stages.iter().map(halves).collect();
        assert_eq!(seen, [(true, 0), (false, 1), (false, 2), (true, 1), (false, 2), (true, 1), (false, 2)]);
        let up = grid.lanes.iter().position(|lane| lane.from == 8 && lane.to == 9).unwrap() as u16;
        let at = |k: usize| grid.position(&axes, up, &[0.0; MOST_FREE], &stages[k]).unwrap()[0];
        assert!((at(0).abs() + (at(1) - 125.0).abs() + (at(2) - 250.0).abs()) < 1e-9);
        assert_eq!(grid.position(&axes, up, &[900.0, 0.0], &stages[2]), None);
    }

    #[test]
    fn nothing_is_free_without_an_axis() {
        let grid = Grid::coarse(&[]);
        assert_eq!((grid.size(), grid.lanes.len(), grid.is_fine(&[])), (1, 1, true));
        let stages = grid.stages(&[], &[way(0.0, true), way(0.0, false)], &[false; 2]);
        assert_eq!(grid.position(&[], 0, &[0.0; MOST_FREE], &stages[1]), Some([0.0; MOST_FREE]));
    }
}
