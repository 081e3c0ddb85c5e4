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

/// Targets after which it is looked whether all ways that are left begin alike.
const SETTLE: usize = 256;

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
    /// Steps of the targets behind those that are settled.
    back: Vec<Vec<Step>>,
    /// States of the first targets, by their index: those of every way that is left.
    settled: Vec<u32>,
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
        if self.back.len().is_multiple_of(SETTLE) {
            self.settle();
        }
        !self.reached.is_empty()
    }

    /// Takes the beginning that all ways have in common out of what is kept for the way back: so memory does not grow with the path.
    fn settle(&mut self) {
        let mut live: Vec<u32> = (0..self.reached.len()).map(narrow).collect();
        for at in (1..self.back.len()).rev() {
            let steps = &self.back[at];
            live = live.iter().map(|index| steps[*index as usize].before).collect();
            live.sort_unstable();
            live.dedup();
            if let [only] = live[..] {
                let states = way_back(&self.back[..at], only as usize);
                self.settled.extend(states);
                self.back.drain(..at);
                return;
            }
        }
    }

    /// Index of the best way's state among those of each target.
    pub(super) fn best(self) -> Vec<usize> {
        let least = self.reached.iter().enumerate().min_by(|a, b| a.1.1.total_cmp(&b.1.1));
        let Some((at, _)) = least else { return Vec::new() };
        let mut chosen = self.settled;
        chosen.extend(way_back(&self.back, at));
        chosen.into_iter().map(|state| state as usize).collect()
    }
}

/// The states of the way that ends with a step, by its index.
fn way_back(back: &[Vec<Step>], mut at: usize) -> Vec<u32> {
    let step = |steps: &Vec<Step>| {
        let step = steps[at];
        at = step.before as usize;
        step.state
    };
    let mut states: Vec<u32> = back.iter().rev().map(step).collect();
    states.reverse();
    states
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Of three turns one is cheap for a while, then another: as the whole table of all ways has it, with and without settling.
    #[test]
    fn a_long_path_is_settled_and_ends_as_the_whole_table_has_it() {
        const LENGTH: usize = 3 * SETTLE + 17;
        let state = |index: usize| State { turn: index as f64 * STEP, branch: 0, motor: Joints::zeros() };
        let cost = |at: usize, index: usize| ((at * (index + 2) * 7919) % 101) as f64;
        let way = Move { length: 1e-3, time: None, free: false, fixed: false };
        let mut search = Search::default();
        let mut table = vec![[0.0_f64; 3]];
        for at in 0..LENGTH {
            let states: Vec<(State, f64)> = (0..3).map(|index| (state(index), cost(at, index))).collect();
            assert!(search.advance(&way, None, &states));
            let before = table[at];
            // A cell of the grid a millimetre.
            let from = |index: usize| (0..3).filter(move |k: &usize| k.abs_diff(index) <= 1 || at == 0);
            let least = |index: usize| from(index).map(|k| before[k]).fold(f64::INFINITY, f64::min);
            table.push(std::array::from_fn(|index| least(index) + cost(at, index)));
        }
        assert!(search.back.len() < 2 * SETTLE && search.settled.len() + search.back.len() == LENGTH);
        let chosen = search.best();
        let total: f64 = chosen.iter().enumerate().map(|(at, index)| cost(at, *index)).sum();
        assert!(chosen.windows(2).all(|pair| pair[0].abs_diff(pair[1]) <= 1));
        let least = table[LENGTH].iter().copied().fold(f64::INFINITY, f64::min);
        assert!((total - least).abs() < 1e-6, "{total} {least}");
    }
}
