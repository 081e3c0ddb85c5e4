//! Improves a plan by exchanging its rows and its loads.
//!
//! The method is coordinate exchange (Meyer and Nachtsheim 1995). One row at a time is replaced by the best of several
//! spots, and the columns of this row and of the next one, whose direction of travel changes, are computed again. After
//! all rows the loads are exchanged.

use super::criterion::Criterion;
use super::draws::Draws;
use super::sheet::{Bench, Row, Sheet};
use crate::candidate::Candidate;
use crate::data::Blocks;
use nalgebra::DMatrix;
use rayon::prelude::*;

/// Rounds over all rows.
const SWEEPS: usize = 6;
/// Number of spots that are tried for a row: from the pool, and from the other rows of the plan. The same place under
/// another load, or approached from another side, can distinguish more than a new place.
const TRIED: (usize, usize) = (20, 6);
/// Largest number of changes of the loads in a round.
const LOADS: usize = 4;
/// Cost of one radian of travel of the axis that turns most, in units of the criterion.
const TRAVEL: f64 = 2e-4;
/// Smallest reduction of the cost that counts as a gain.
const GAIN: f64 = 1e-9;

/// The exchange, with all that it needs to compute the cost of a plan.
pub(super) struct Exchange<'a> {
    pub(super) bench: &'a Bench<'a>,
    pub(super) criterion: &'a Criterion,
    pub(super) candidates: &'a [Candidate],
    /// Speeds with which a row can be approached, m/s.
    pub(super) speeds: Vec<f64>,
}

/// A sheet with the columns of its rows and its cost.
#[derive(Clone)]
struct CostedSheet {
    sheet: Sheet,
    columns: DMatrix<f64>,
    cost: f64,
}

impl Exchange<'_> {
    /// Improves a sheet until no exchange gains, in at most [`SWEEPS`] rounds.
    pub(super) fn run(&self, sheet: Sheet, progress: &(dyn Fn(f64) + Sync)) -> Sheet {
        let mut draws = Draws::of(7);
        let mut state = self.state(sheet);
        let count = state.sheet.rows.len();
        for sweep in 0..SWEEPS {
            let before = state.cost;
            for row in 0..count {
                let tried = self.alternatives(&state.sheet, row, &mut draws);
                let better = tried.into_par_iter().filter_map(|new| self.with_row(&state, row, new));
                let best = better.collect::<Vec<_>>().into_iter().min_by(|a, b| a.cost.total_cmp(&b.cost));
                if let Some(best) = best.filter(|best| best.cost < state.cost - GAIN) {
                    state = best;
                }
                progress((sweep as f64 + (row + 1) as f64 / count as f64) / SWEEPS as f64);
            }
            for _ in 0..LOADS {
                let loads = self.other_loads(&state.sheet).into_par_iter();
                let better = loads.map(|loads| self.state(Sheet { rows: state.sheet.rows.clone(), loads }));
                let best = better.collect::<Vec<_>>().into_iter().min_by(|a, b| a.cost.total_cmp(&b.cost));
                match best.filter(|best| best.cost < state.cost - GAIN) {
                    Some(best) => state = best,
                    None => break,
                }
            }
            if state.cost > before - GAIN {
                break;
            }
        }
        state.sheet
    }

    /// A sheet with all its columns computed.
    fn state(&self, sheet: Sheet) -> CostedSheet {
        let all: Vec<usize> = (0..sheet.rows.len()).collect();
        let columns = self.bench.columns(&mut self.candidates.to_vec(), &sheet, &all);
        let cost = self.cost(&sheet, &columns);
        CostedSheet { sheet, columns, cost }
    }

    /// The criterion of the rows plus the cost of the travel between them.
    fn cost(&self, sheet: &Sheet, columns: &DMatrix<f64>) -> f64 {
        let blocks = Blocks::of(&vec![None; sheet.rows.len()]);
        let weights = Criterion::row_weights((0..sheet.rows.len()).map(|row| blocks.held_out(row)));
        let all = joined(columns, &self.bench.drifts(sheet));
        let motor = |row: &Row| self.bench.spots[row.spot].motor;
        let travel: f64 = sheet.rows.windows(2).map(|pair| (motor(&pair[1]) - motor(&pair[0])).amax()).sum();
        self.criterion.confusion(&self.criterion.discrimination(&all, &weights)) + TRAVEL * travel
    }

    /// Rows that are tried in place of a row: other spots, and the same spot with other speeds.
    fn alternatives(&self, sheet: &Sheet, row: usize, draws: &mut Draws) -> Vec<Row> {
        let speed = |draws: &mut Draws| self.speeds[draws.index(self.speeds.len())];
        let mut all = Vec::new();
        for _ in 0..TRIED.0 {
            all.push(Row { spot: draws.index(self.bench.spots.len()), speed: speed(draws) });
        }
        for _ in 0..TRIED.1 {
            all.push(Row { spot: sheet.rows[draws.index(sheet.rows.len())].spot, speed: speed(draws) });
        }
        all.extend(self.speeds.iter().map(|&speed| Row { spot: sheet.rows[row].spot, speed }));
        all.retain(|new| *new != sheet.rows[row]);
        all
    }

    /// The state with another row; `None` if the arm cannot move to it or from it as commanded.
    fn with_row(&self, state: &CostedSheet, row: usize, new: Row) -> Option<CostedSheet> {
        let mut sheet = state.sheet.clone();
        sheet.rows[row] = new;
        let next = (row + 1 < sheet.rows.len()).then_some(row + 1);
        if !self.follows(&sheet, row) || next.is_some_and(|next| !self.follows(&sheet, next)) {
            return None;
        }
        let which: Vec<usize> = std::iter::once(row).chain(next).collect();
        let fresh = self.bench.columns(&mut self.candidates.to_vec(), &sheet, &which);
        let axes = self.bench.axes();
        let mut columns = state.columns.clone();
        for (i, &row) in which.iter().enumerate() {
            columns.rows_mut(row * axes, axes).copy_from(&fresh.rows(i * axes, axes));
        }
        let cost = self.cost(&sheet, &columns);
        Some(CostedSheet { sheet, columns, cost })
    }

    /// Whether the arm moves to a row from the one before as commanded.
    pub(super) fn follows(&self, sheet: &Sheet, row: usize) -> bool {
        let spot = |row: usize| &self.bench.spots[sheet.rows[row].spot];
        self.bench.follows(row.checked_sub(1).map(spot), spot(row))
    }

    /// The loads with one stretch under another load, or with one change of the load earlier or later, if they have no
    /// more changes than `[plan]` allows.
    fn other_loads(&self, sheet: &Sheet) -> Vec<Vec<usize>> {
        let loads = &sheet.loads;
        let starts: Vec<usize> = (0..loads.len()).filter(|&i| i == 0 || loads[i] != loads[i - 1]).collect();
        let end = |at: usize| starts.get(at + 1).copied().unwrap_or(loads.len());
        let mut all = Vec::new();
        for (at, &start) in starts.iter().enumerate() {
            for load in (0..self.bench.section.loads.len()).filter(|load| *load != loads[start]) {
                let mut other = loads.clone();
                other[start..end(at)].fill(load);
                all.push(other);
            }
            for shift in [1_usize, 2] {
                let mut earlier = loads.clone();
                if start >= shift && at > 0 {
                    earlier[start - shift..start].fill(loads[start]);
                    all.push(earlier);
                }
                let mut later = loads.clone();
                if at > 0 && start + shift <= loads.len() {
                    later[start..start + shift].fill(loads[start - 1]);
                    all.push(later);
                }
            }
        }
        let few = |loads: &Vec<usize>| {
            loads.windows(2).filter(|pair| pair[0] != pair[1]).count() <= self.bench.section.load_changes
        };
        all.retain(few);
        all
    }
}

/// A matrix of the columns of `left`, then those of `right`.
fn joined(left: &DMatrix<f64>, right: &DMatrix<f64>) -> DMatrix<f64> {
    let mut both = DMatrix::zeros(left.nrows(), left.ncols() + right.ncols());
    both.columns_mut(0, left.ncols()).copy_from(left);
    both.columns_mut(left.ncols(), right.ncols()).copy_from(right);
    both
}
