//! Dynamic programming over the states of the targets (Bellman): the least sum of squared predicted errors of all ways that an
//! arm can follow.

use super::states::{STEP, State, TURNS};
use crate::robot::{Joints, wrap};
use std::f64::consts::{PI, TAU};

/// How fast the turn may change along the path, rad a metre: 5° a millimetre (`docs/reference.md`).
pub(super) const RATE: f64 = 5e3 * PI / 180.0;

/// Rounding of a rate, rad.
const SLACK: f64 = 1e-9;

/// Largest move of an axis within one linear move, rad: more is another way round.
const FLIP: f64 = PI;

/// Cost of a turn, m² a rad²: a micrometre's for a right angle decides only between ways that are as good.
const TURNING: f64 = 1e-12;

/// What of one way is kept for the way back.
#[derive(Clone, Copy, Debug)]
struct Step {
    /// State before, by its index.
    before: u32,
    state: u32,
}

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
}

/// The ordered search: states with their costs so far, and the way back from each.
#[derive(Debug, Default)]
pub(super) struct Search {
    reached: Vec<(State, f64)>,
    back: Vec<Vec<Step>>,
}

impl Search {
    /// Goes on to a target's states, with the cost of each; `false` where none can be reached.
    pub(super) fn advance(&mut self, way: &Move, axis_speed: Option<&Joints>, states: &[(State, f64)]) -> bool {
        let mut reached = Vec::with_capacity(states.len());
        let mut steps = Vec::with_capacity(states.len());
        if self.back.is_empty() {
            for (index, &(state, cost)) in states.iter().enumerate() {
                reached.push((state, cost));
                steps.push(Step { before: 0, state: narrow(index) });
            }
        } else {
            let cells = Cells::of(&self.reached);
            for (index, (state, cost)) in states.iter().enumerate() {
                let mut best: Option<(f64, usize)> = None;
                let mut consider = |before: usize| {
                    let (from, so_far) = &self.reached[before];
                    if !way.allows(from, state, axis_speed) {
                        return;
                    }
                    let total = so_far + cost + TURNING * way.effort(from, state);
                    if best.is_none_or(|(least, _)| total < least) {
                        best = Some((total, before));
                    }
                };
                if way.free || way.fixed {
                    (0..self.reached.len()).for_each(&mut consider);
                } else {
                    cells.within(state.turn, way.length * RATE + SLACK, &mut consider);
                }
                if let Some((total, before)) = best {
                    reached.push((*state, total));
                    steps.push(Step { before: narrow(before), state: narrow(index) });
                }
            }
        }
        self.reached = reached;
        self.back.push(steps);
        !self.reached.is_empty()
    }

    /// Index of the best way's state among those of each target.
    pub(super) fn best(self) -> Vec<usize> {
        let least = self.reached.iter().enumerate().min_by(|a, b| a.1.1.total_cmp(&b.1.1));
        let Some((mut at, _)) = least else { return Vec::new() };
        let mut chosen: Vec<usize> = self
            .back
            .iter()
            .rev()
            .map(|steps| {
                let step = steps[at];
                at = step.before as usize;
                step.state as usize
            })
            .collect();
        chosen.reverse();
        chosen
    }
}

#[allow(clippy::cast_possible_truncation)] // states of a target are some thousand
fn narrow(index: usize) -> u32 {
    index as u32
}

impl Move {
    fn allows(&self, from: &State, to: &State, axis_speed: Option<&Joints>) -> bool {
        if self.free {
            return true;
        }
        let turn = wrap(to.turn - from.turn).abs();
        let moved = (to.motor - from.motor).abs();
        let quick = |speed: &Joints| self.time.is_some_and(|time| (0..6).any(|i| moved[i] > speed[i] * time + SLACK));
        (self.fixed || turn <= self.length * RATE + SLACK)
            && from.branch == to.branch
            && moved.max() < FLIP
            && !axis_speed.is_some_and(quick)
    }

    /// Squared turn, or way of the joints where that is free, rad².
    fn effort(&self, from: &State, to: &State) -> f64 {
        if self.free { (to.motor - from.motor).norm_squared() } else { wrap(to.turn - from.turn).powi(2) }
    }
}

/// States by the cell of the grid that their turn lies in.
struct Cells {
    /// Where each cell begins.
    starts: [usize; TURNS + 1],
    sorted: Vec<usize>,
}

impl Cells {
    fn of(reached: &[(State, f64)]) -> Self {
        let cell = |index: &usize| cell(reached[*index].0.turn);
        let mut sorted: Vec<usize> = (0..reached.len()).collect();
        sorted.sort_by_key(cell);
        let starts = std::array::from_fn(|first| sorted.partition_point(|index| cell(index) < first));
        Self { starts, sorted }
    }

    /// Every state whose cell is at most `turn` (rad) away, a cell to each side included.
    fn within(&self, middle: f64, turn: f64, consider: &mut impl FnMut(usize)) {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let cells = (turn / STEP).ceil().min(TURNS as f64) as usize + 1;
        let first = cell(middle) + TURNS - cells.min(TURNS / 2);
        for offset in 0..(2 * cells + 1).min(TURNS) {
            let at = (first + offset) % TURNS;
            self.sorted[self.starts[at]..self.starts[at + 1]].iter().copied().for_each(&mut *consider);
        }
    }
}

fn cell(turn: f64) -> usize {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let cell = (turn.rem_euclid(TAU) / STEP).round() as usize;
    cell % TURNS
}
