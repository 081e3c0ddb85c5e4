//! Free external axes: cells of a grid of their positions around a trajectory along the path, and lanes between the cells.
//!
//! An axis needs a stretch of the path to move from one cell to the next. Over a stretch, a lane leads evenly from a cell to the same
//! cell or to a neighbour, so that a coarse grid can be followed at any speed. The first grid is around the positions in the program; each
//! following grid is finer, around the best trajectory that was found.

use deflex_cell::{Cell, MOST_FREE};
use deflex_robot::{EXTERNAL_AXES, External, UnitKind};
use smallvec::SmallVec;

/// Positions of the free axes, mm or degrees; zero where there are fewer.
pub(super) type Position = [f64; MOST_FREE];

/// The motion to a target.
#[derive(Clone, Copy, Debug)]
pub(super) struct Move {
    /// Length of the path, m.
    pub(super) length: f64,
    /// Duration, s; `None` if the feed is unknown.
    pub(super) time: Option<f64>,
    /// Whether the arm may turn and change its branch: on joint motions, and on motions of CL data that do not cut.
    pub(super) free: bool,
    /// Whether either end has a fixed turn.
    pub(super) fixed: bool,
    /// Largest motion of each free axis on it, mm or degrees.
    pub(super) room: Position,
}

/// Size of a cell of the first grid: mm for linear units, over which the stiffness of an arm changes little, and degrees for rotary ones.
const COARSE: [f64; 2] = [250.0, 30.0];

/// Largest cell of the last grid, mm or degrees: smoothing continues from there.
const FINE: [f64; 2] = [10.0, 2.0];

/// Most cells of the first grid along an axis, if one axis is free, and if two are.
const MOST_CELLS: [f64; MOST_FREE] = [17.0, 5.0];

/// Largest rate of an axis along the path, mm or degrees for each metre: a track is no faster than the tool, a table has the rate of the
/// turn about the tool axis.
const RATE: [f64; 2] = [1e3, 5e3];

/// Positions are chosen in steps of this, mm or degrees, so that the written positions are the solved ones.
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
    /// The free axes of a cell.
    pub(super) fn of(cell: &Cell) -> SmallVec<[Self; MOST_FREE]> {
        let free = cell.units.all().iter().filter(|unit| unit.free);
        let axis = |unit: &deflex_robot::Unit| Self {
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

    /// Its largest motion on a piece of path with a length (m) and a duration (s), mm or degrees.
    pub(super) fn room(&self, length: f64, time: Option<f64>) -> f64 {
        let along = RATE[self.kind()] * length;
        self.max_speed.zip(time).map_or(along, |(speed, time)| along.min(speed * time))
    }

    /// The position as it can be written.
    pub(super) fn rounded(&self, position: f64) -> f64 {
        ((position / WRITTEN).round() * WRITTEN).clamp(self.min, self.max)
    }

    /// A position (mm or degrees) in m or rad.
    pub(super) fn si(&self, position: f64) -> f64 {
        if self.rotary { position.to_radians() } else { 1e-3 * position }
    }
}

/// A motion over a stretch of the path, from one cell of the grid to another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Lane {
    pub(super) from: u16,
    pub(super) to: u16,
}

/// The place of a knot in its stretch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stage {
    /// Whether the stretch begins with the motion to this knot.
    pub(super) begins: bool,
    /// Share of the stretch up to the knot.
    share: f64,
    /// Whether the stretch is long enough to reach a neighbouring cell.
    is_whole: bool,
}

/// The grid.
#[derive(Clone, Debug)]
pub(super) struct Grid {
    /// Size of a cell, mm or degrees.
    pub(super) cell: Position,
    /// Offsets of the cells from the base, in cells.
    cells: Vec<[i16; MOST_FREE]>,
    pub(super) lanes: Vec<Lane>,
    /// Index of the lane along the base.
    pub(super) still: u16,
}

impl Grid {
    /// The first grid.
    pub(super) fn coarse(axes: &[FreeAxis]) -> Self {
        let most = MOST_CELLS[axes.len().saturating_sub(1)] - 1.0;
        let mut cell = [0.0; MOST_FREE];
        let mut reach = [0; MOST_FREE];
        for (k, axis) in axes.iter().enumerate() {
            let range = axis.max - axis.min;
            cell[k] = COARSE[axis.kind()].max(range / most).min(range);
            reach[k] = (range / cell[k] + SLACK).floor() as i16; // at most as many as `MOST_CELLS`
        }
        Self::new(cell, reach)
    }

    /// A grid with cells of half the size, around a trajectory that was found.
    pub(super) fn finer(&self, axes: &[FreeAxis]) -> Self {
        Self::new(self.cell.map(|cell| 0.5 * cell), std::array::from_fn(|k| i16::from(k < axes.len())))
    }

    /// Whether it is fine enough for smoothing.
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
        // There are some hundred lanes.
        let still = lanes.iter().position(is_still).unwrap_or(0) as u16;
        Self { cell, cells, lanes, still }
    }

    /// Number of cells.
    pub(super) fn size(&self) -> usize {
        self.cells.len()
    }

    /// Divides the path into stretches, from the motions to its knots and from the knots that only the base can reach.
    pub(super) fn stages(&self, axes: &[FreeAxis], motions: &[Move], pinned: &[bool]) -> Vec<Stage> {
        let mut stages: Vec<Stage> = Vec::with_capacity(motions.len());
        // Knots of the stretch, each as the number of cells that the axes can have passed.
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
        for (at, motion) in motions.iter().enumerate() {
            if at == 0 || motion.free {
                close(&mut open);
                open.push(0.0);
                continue;
            }
            let passed =
                axes.iter().enumerate().map(|(k, _)| motion.room[k] / self.cell[k]).fold(f64::INFINITY, f64::min);
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

    /// Position of a lane at a knot with a base; `None` if it is beyond the limits or cannot be reached.
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

/// Positions of the external axes, with the free ones replaced.
pub(super) fn with(external: &External, axes: &[FreeAxis], position: &Position) -> External {
    let mut external = *external;
    for (axis, position) in axes.iter().zip(position) {
        external[axis.axis] = *position;
    }
    external
}

/// Positions of the free axes alone; NaN for the others.
pub(super) fn alone(axes: &[FreeAxis], position: &Position) -> External {
    with(&[f64::NAN; EXTERNAL_AXES], axes, position)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis(min: f64, max: f64) -> FreeAxis {
        FreeAxis { name: "T".into(), axis: 0, min, max, max_speed: Some(100.0), rotary: false }
    }

    fn motion(room: f64, free: bool) -> Move {
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
        let motions: Vec<Move> = (0..7).map(|k| motion(125.0, k == 0)).collect();
        let stages = grid.stages(&axes, &motions, &[false; 7]);
        // The first knot is before the first stretch; the last stretch is whole too.
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
        let stages = grid.stages(&[], &[motion(0.0, true), motion(0.0, false)], &[false; 2]);
        assert_eq!(grid.position(&[], 0, &[0.0; MOST_FREE], &stages[1]), Some([0.0; MOST_FREE]));
    }
}
