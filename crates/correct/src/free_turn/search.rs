//! Dynamic programming over the states of the knots (Bellman): finds the trajectory with the least sum of squared predicted errors that
//! the arm can follow.

use super::axes::{Lane, Move, Position};
use super::states::{PostureChoice, STEP, TURNS};
use deflex_robot::{Joints, wrap};
use std::f64::consts::{PI, TAU};

/// Largest rate of the turn along the path, rad for each metre: 5° for each millimetre (`docs/reference.md`).
pub(super) const RATE: f64 = 5e3 * PI / 180.0;

/// Rounding of a rate, rad.
const SLACK: f64 = 1e-9;

/// Rounding of the motion of a free axis, mm or degrees, and its share.
const RUN_SLACK: f64 = 1e-6;

/// Largest motion of an axis within one linear motion, rad: more would be the other direction of rotation.
const FLIP: f64 = PI;

/// Cost of a turn, m²/rad²: that of a micrometre for a right angle decides only between trajectories that are equally good. A metre of a
/// free axis counts as a radian.
const TURNING: f64 = 1e-12;

/// Most states at which a joint motion may begin: the cheapest ones, because all are allowed.
const CHEAPEST: usize = 2048;

/// Number of knots after which abandoned trajectories are forgotten.
const SETTLE: usize = 256;

/// The step of a trajectory that is kept to trace it back.
#[derive(Clone, Copy, Debug)]
struct TraceStep {
    /// Index of the step of the knot before.
    before: u32,
    /// Index of its [`PostureChoice`].
    state: u32,
}

/// The ordered search: states with their costs so far, and the steps to trace each back.
#[derive(Debug)]
pub(super) struct Search<'a> {
    lanes: &'a [Lane],
    /// Size of a millimetre or a degree of each free axis, m or rad.
    scales: Position,
    reached: Vec<(PostureChoice, f64)>,
    /// Steps of the knots after the settled ones.
    back: Vec<Box<[TraceStep]>>,
    /// Number of these knots that keep only steps of trajectories that are still open.
    pruned: usize,
    /// Indices of the states of the first knots, which all open trajectories share.
    settled: Vec<u32>,
}

impl<'a> Search<'a> {
    /// The search before the first knot.
    pub(super) fn new(lanes: &'a [Lane], scales: Position) -> Self {
        Self { lanes, scales, reached: Vec::new(), back: Vec::new(), pruned: 0, settled: Vec::new() }
    }

    /// Advances to the states of a knot, with the cost of each and with whether a stretch of the free axes begins with the motion. Returns
    /// `false` if no state can be reached.
    pub(super) fn advance(
        &mut self,
        (motion, begins): (&Move, bool),
        axis_speed: Option<&Joints>,
        states: &[(PostureChoice, f64)],
    ) -> bool {
        let mut reached = Vec::with_capacity(states.len());
        let mut steps = Vec::with_capacity(states.len());
        if self.back.is_empty() {
            for (index, &(state, cost)) in states.iter().enumerate() {
                reached.push((state, cost));
                steps.push(TraceStep { before: 0, state: narrow(index) });
            }
        } else {
            let lane = |state: &PostureChoice| self.lanes[usize::from(state.lane)];
            // A stretch begins with the cell with which the one before ended.
            let (count, lead): (usize, &dyn Fn(&PostureChoice) -> usize) = if begins {
                (1 + self.lanes.iter().map(|lane| usize::from(lane.to)).max().unwrap_or(0), &|state| {
                    usize::from(lane(state).to)
                })
            } else {
                (self.lanes.len(), &|state| usize::from(state.lane))
            };
            let cells = Cells::of(&self.reached, (count, lead));
            let cheapest = if motion.free { self.cheapest() } else { Vec::new() };
            for (index, (state, cost)) in states.iter().enumerate() {
                let mut best: Option<(f64, usize)> = None;
                let mut consider = |before: usize| {
                    let (from, so_far) = &self.reached[before];
                    if !motion.allows(from, state, axis_speed) {
                        return;
                    }
                    let total = so_far + cost + TURNING * motion.effort(from, state, &self.scales);
                    if best.is_none_or(|(least, _)| total < least) {
                        best = Some((total, before));
                    }
                };
                let group = if begins { usize::from(lane(state).from) } else { usize::from(state.lane) };
                if motion.free {
                    cheapest.iter().copied().for_each(&mut consider);
                } else if motion.fixed {
                    cells.all(group, &mut consider);
                } else {
                    cells.within(group, state.turn, motion.length * RATE + SLACK, &mut consider);
                }
                if let Some((total, before)) = best {
                    reached.push((*state, total));
                    steps.push(TraceStep { before: narrow(before), state: narrow(index) });
                }
            }
        }
        self.reached = reached;
        self.back.push(steps.into());
        if self.back.len() - self.pruned >= SETTLE {
            self.settle();
        }
        !self.reached.is_empty()
    }

    /// The states at which a joint motion may begin, in rising order; all states if they are few.
    fn cheapest(&self) -> Vec<usize> {
        let mut all: Vec<usize> = (0..self.reached.len()).collect();
        if all.len() > CHEAPEST {
            all.sort_by(|a, b| self.reached[*a].1.total_cmp(&self.reached[*b].1));
            all.truncate(CHEAPEST);
            all.sort_unstable();
        }
        all
    }

    /// Forgets trajectories that lead to none of the present states. Memory then grows only with the trajectories that stay open for long (one
    /// for each branch that cannot be left), and with one index for each knot where they are all equal.
    fn settle(&mut self) {
        let mut live: Vec<u32> = (0..self.reached.len()).map(narrow).collect();
        for at in (0..self.back.len()).rev() {
            let steps = &mut self.back[at];
            if at < self.pruned && live.len() == steps.len() {
                // All steps before are those of open trajectories.
                break;
            }
            let mut kept: Box<[TraceStep]> = live.iter().map(|index| steps[*index as usize]).collect();
            live = kept.iter().map(|step| step.before).collect();
            live.sort_unstable();
            live.dedup();
            for step in &mut kept {
                step.before = narrow(live.partition_point(|before| *before < step.before));
            }
            *steps = kept;
        }
        let common = self.back.partition_point(|steps| steps.len() == 1).min(self.back.len() - 1);
        self.settled.extend(self.back.drain(..common).map(|steps| steps[0].state));
        self.pruned = self.back.len();
    }

    /// Index of the best trajectory's state among those of each target.
    pub(super) fn best(self) -> Vec<usize> {
        let least = self.reached.iter().enumerate().min_by(|a, b| a.1.1.total_cmp(&b.1.1));
        let Some((at, _)) = least else { return Vec::new() };
        let mut chosen = self.settled;
        chosen.extend(way_back(&self.back, at));
        chosen.into_iter().map(|state| state as usize).collect()
    }
}

/// Indices of the states of the trajectory that ends with a step.
fn way_back(back: &[Box<[TraceStep]>], mut at: usize) -> Vec<u32> {
    let mut step = |steps: &[TraceStep]| {
        let step = steps[at];
        at = step.before as usize;
        step.state
    };
    let mut states: Vec<u32> = back.iter().rev().map(|steps| step(steps)).collect();
    states.reverse();
    states
}

fn narrow(index: usize) -> u32 {
    index as u32 // a target has some thousand states
}

impl Move {
    fn allows(&self, from: &PostureChoice, to: &PostureChoice, axis_speed: Option<&Joints>) -> bool {
        if self.free {
            return true;
        }
        let turn = wrap(to.turn - from.turn).abs();
        let moved = (to.motor - from.motor).abs();
        let quick = |speed: &Joints| self.time.is_some_and(|time| (0..6).any(|i| moved[i] > speed[i] * time + SLACK));
        let run = from.position.iter().zip(&to.position).zip(&self.room);
        (self.fixed || turn <= self.length * RATE + SLACK)
            && run.into_iter().all(|((from, to), room)| (to - from).abs() <= room * (1.0 + RUN_SLACK) + RUN_SLACK)
            && from.branch == to.branch
            && moved.max() < FLIP
            && !axis_speed.is_some_and(quick)
    }

    /// Squared turn, or squared motion of the joints if the motion is free, rad².
    fn effort(&self, from: &PostureChoice, to: &PostureChoice, scales: &Position) -> f64 {
        let arm = if self.free { (to.motor - from.motor).norm_squared() } else { wrap(to.turn - from.turn).powi(2) };
        let run = |k: usize| scales[k] * (to.position[k] - from.position[k]);
        arm + (0..scales.len()).map(|k| run(k).powi(2)).sum::<f64>()
    }
}

/// States sorted by their group and by the cell of the grid of their turn.
struct Cells {
    /// Index at which the cells of each group begin.
    starts: Vec<usize>,
    sorted: Vec<usize>,
}

impl Cells {
    fn of(reached: &[(PostureChoice, f64)], (groups, group): (usize, &dyn Fn(&PostureChoice) -> usize)) -> Self {
        let keys: Vec<usize> = reached.iter().map(|(state, _)| group(state) * TURNS + cell(state.turn)).collect();
        let mut sorted: Vec<usize> = (0..reached.len()).collect();
        sorted.sort_by_key(|index| keys[*index]);
        let mut starts = vec![0; groups * TURNS + 1];
        for key in keys {
            starts[key + 1] += 1;
        }
        for at in 1..starts.len() {
            starts[at] += starts[at - 1];
        }
        Self { starts, sorted }
    }

    /// Every state of a group.
    fn all(&self, group: usize, consider: &mut impl FnMut(usize)) {
        self.sorted[self.starts[group * TURNS]..self.starts[(group + 1) * TURNS]].iter().copied().for_each(consider);
    }

    /// Every state of a group whose cell is at most `turn` (rad) away, plus one cell on each side.
    fn within(&self, group: usize, middle: f64, turn: f64, consider: &mut impl FnMut(usize)) {
        let cells = (turn / STEP).ceil().min(TURNS as f64) as usize + 1;
        let first = cell(middle) + TURNS - cells.min(TURNS / 2);
        for offset in 0..(2 * cells + 1).min(TURNS) {
            let at = group * TURNS + (first + offset) % TURNS;
            self.sorted[self.starts[at]..self.starts[at + 1]].iter().copied().for_each(&mut *consider);
        }
    }
}

fn cell(turn: f64) -> usize {
    (turn.rem_euclid(TAU) / STEP).round() as usize % TURNS
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of three turns one is cheap for a while, then another. The result is that of the whole table of all trajectories, with and without
    /// settling.
    #[test]
    fn a_long_path_is_settled_and_ends_as_the_whole_table_has_it() {
        const LENGTH: usize = 3 * SETTLE + 17;
        let state = |index: usize| PostureChoice {
            turn: index as f64 * STEP,
            branch: 0,
            motor: Joints::zeros(),
            lane: 0,
            position: [0.0; 2],
        };
        let cost = |at: usize, index: usize| ((at * (index + 2) * 7919) % 101) as f64;
        let motion = Move { length: 1e-3, time: None, free: false, fixed: false, room: [0.0; 2] };
        let lanes = [Lane { from: 0, to: 0 }];
        let mut search = Search::new(&lanes, [0.0; 2]);
        let mut table = vec![[0.0_f64; 3]];
        for at in 0..LENGTH {
            let states: Vec<(PostureChoice, f64)> = (0..3).map(|index| (state(index), cost(at, index))).collect();
            assert!(search.advance((&motion, at == 0), None, &states));
            let before = table[at];
            // One cell of the grid for each millimetre.
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

    /// Of two branches that cannot be left, one is cheap at first, then the other: which is best is known at the end.
    #[test]
    fn branches_that_are_never_left_are_kept_apart() {
        const LENGTH: usize = 9 * SETTLE;
        let state = |index: usize| PostureChoice {
            turn: (index % 3) as f64 * STEP,
            branch: index / 3,
            motor: Joints::zeros(),
            lane: 0,
            position: [0.0; 2],
        };
        let motion = Move { length: 1e-3, time: None, free: false, fixed: false, room: [0.0; 2] };
        let lanes = [Lane { from: 0, to: 0 }];
        let mut search = Search::new(&lanes, [0.0; 2]);
        for at in 0..LENGTH {
            let dear = if at < LENGTH / 2 - 3 { 1 } else { 0 };
            let cost = |index: usize| f64::from(u8::from(index / 3 == dear)) + 0.1 * (index % 3).abs_diff(1) as f64;
            let states: Vec<(PostureChoice, f64)> = (0..6).map(|index| (state(index), cost(index))).collect();
            assert!(search.advance((&motion, at == 0), None, &states));
        }
        let kept: usize = search.back.iter().map(|steps| steps.len()).sum();
        assert!(kept < 2 * LENGTH + 6 * SETTLE, "{kept}");
        assert_eq!(search.best(), vec![4; LENGTH]);
    }
}
