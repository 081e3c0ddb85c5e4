//! From the states of the knots to the choice at every target: smoothing, and interpolation between knots.

use super::axes::Move;
use super::axes::{Grid, Position, alone};
use super::path::Path;
use super::search::RATE;
use super::states::{self, PostureChoice, STEP, singular};
use crate::carried::Chosen;
use crate::travel::CHORD;
use deflex_cell::MOST_FREE;
use deflex_robot::wrap;
use std::sync::Arc;

/// Rounds of smoothing.
const SMOOTHING: usize = 30;

/// Rounding of turns that are interpolated, in cells of the grid.
const ROUNDING: f64 = 1e-6;

/// A position this close to the written one counts as the written one, mm or degrees: half a step of chosen positions.
const AS_WRITTEN: f64 = 5e-4;

/// Smooths the steps of the grid in the values at the knots. Each value moves towards the line between its neighbours, by at most half a
/// cell, so that its cost hardly changes. If values keep the largest rate, so do their averages.
fn smoothed(
    found: &[f64],
    motions: &[Move],
    (half, apart): (f64, fn(f64) -> f64),
    is_held: impl Fn(usize) -> bool,
    is_too_quick: impl Fn(usize, f64) -> bool,
) -> Vec<f64> {
    let mut values = found.to_vec();
    for _ in 0..SMOOTHING {
        let before = values.clone();
        for at in
            (1..found.len().saturating_sub(1)).filter(|&at| !is_held(at) && !motions[at].free && !motions[at + 1].free)
        {
            let (into, out) = (motions[at].length, motions[at + 1].length);
            if into + out <= CHORD {
                continue;
            }
            let (left, right) = (apart(before[at - 1] - before[at]), apart(before[at + 1] - before[at]));
            let line = (left * out + right * into) / (into + out);
            let from_grid = apart(before[at] + 0.5 * line - found[at]);
            values[at] = found[at] + from_grid.clamp(-half, half);
        }
        // The values on both sides of a step may have moved apart.
        for at in 1..values.len() {
            let step = apart(values[at] - values[at - 1]).abs();
            if !motions[at].free && !motions[at].fixed && is_too_quick(at, step) {
                (values[at - 1], values[at]) = (before[at - 1], before[at]);
            }
        }
    }
    values
}

impl Path<'_> {
    /// Turns (rad) and positions of the free axes at the knots, smoothed.
    pub(super) fn smoothed(&self, knots: &[usize], found: &[PostureChoice], grid: &Grid) -> (Vec<f64>, Vec<Position>) {
        let motions = self.motions(knots);
        let turns: Vec<f64> = found.iter().map(|state| state.turn).collect();
        let turns = smoothed(
            &turns,
            &motions,
            (0.5 * STEP, wrap),
            |at| !self.has_free_turn(knots[at]),
            |at, turn| turn > motions[at].length * RATE,
        );
        let mut positions: Vec<Position> = found.iter().map(|state| state.position).collect();
        for k in 0..self.axes.len() {
            let axis: Vec<f64> = positions.iter().map(|position| position[k]).collect();
            let is_held = |at: usize| !self.has_free_axes(knots[at]);
            let smooth = smoothed(&axis, &motions, (0.5 * grid.cell[k], |step| step), is_held, |at, run| {
                run > motions[at].room[k]
            });
            positions.iter_mut().zip(smooth).for_each(|(position, smooth)| position[k] = smooth);
        }
        (turns, positions)
    }

    /// Positions of the free axes at every target, interpolated between knots by the motion that they are allowed.
    pub(super) fn positions(&self, knots: &[usize], at_knots: &[Position]) -> Vec<Position> {
        let mut out: Vec<Position> = Vec::with_capacity(self.base.len());
        for (at, &knot) in knots.iter().enumerate().filter(|_| !self.axes.is_empty()) {
            let Some(before) = at.checked_sub(1) else {
                out.extend((0..=knot).map(|_| at_knots[0]));
                continue;
            };
            let between = &self.moves[knots[before] + 1..=knot];
            let whole: Position = std::array::from_fn(|k| between.iter().map(|motion| motion.room[k]).sum());
            let mut run = [0.0; MOST_FREE];
            for (n, motion) in between.iter().enumerate() {
                out.push(std::array::from_fn(|k| {
                    run[k] += motion.room[k];
                    let (from, to) = (at_knots[before][k], at_knots[at][k]);
                    if n + 1 == between.len() {
                        to
                    } else {
                        from + (to - from) * run[k] / whole[k].max(f64::MIN_POSITIVE)
                    }
                }));
            }
        }
        out
    }

    /// The choice at every target, with the turn (rad) linear in the length between the knots, and with the motor angles. `Err` has the first
    /// target to which the arm cannot follow.
    pub(super) fn follow(
        &self,
        knots: &[usize],
        found: &[PostureChoice],
        (turns, positions): (&[f64], &[Position]),
    ) -> Result<Vec<Chosen>, usize> {
        let robot = self.robot();
        let positions = self.positions(knots, positions);
        let mut chosen: Vec<Chosen> = Vec::with_capacity(self.moves.len());
        for (at, &knot) in knots.iter().enumerate() {
            let first = at.checked_sub(1).map_or(0, |before| knots[before] + 1);
            let motion = self.motion(knots, at);
            let from = at.checked_sub(1).map_or(turns[at], |before| turns[before]);
            let (whole, mut done) = (wrap(turns[at] - from), 0.0);
            for i in first..=knot {
                done += self.moves[i].length;
                let target = self.target(i);
                if let Some((_, motor)) = target.fixed {
                    chosen.push(Chosen { turn: None, near: motor, external: None });
                    continue;
                }
                let share = if i == knot || motion.length <= CHORD { 1.0 } else { done / motion.length };
                let turn = if i == knot { turns[at] } else { from + share * whole };
                let near = match chosen.last() {
                    Some(before) if i != knot => before.near,
                    _ => found[at].motor,
                };
                let position = self.has_free_axes(i).then(|| self.rounded(i, &positions[i]));
                let moved = self.moved(i, &position.unwrap_or_default());
                let base_from_flange = target.base_from_flange(self.setting(i, &moved), turn);
                let motor = robot.inverse_near(&base_from_flange, &near).map_err(|_| i)?;
                let rate = chosen.last().and_then(|before| before.turn).map(|before| wrap(turn - before).abs());
                let quick = rate.is_some_and(|turned| turned > self.moves[i].length * RATE + STEP * ROUNDING);
                let other = states::branch_of(robot, &motor) != found[at].branch;
                if other || singular(robot, &motor, self.margin) || (quick && !self.moves[i].free) {
                    return Err(i);
                }
                let external = position.map(|position| Arc::new(alone(&self.axes, &position)));
                chosen.push(Chosen { turn: Some(wrap(turn)), near: motor, external });
            }
        }
        Ok(chosen)
    }

    /// Positions as they can be written; exactly the written ones where they are kept.
    fn rounded(&self, i: usize, position: &Position) -> Position {
        let mut rounded = [0.0; MOST_FREE];
        for (k, axis) in self.axes.iter().enumerate() {
            let written = self.sites[i].moved.as_ref().map_or(f64::NAN, |moved| moved.external[axis.axis]);
            let is_kept = (position[k] - written).abs() <= AS_WRITTEN;
            rounded[k] = if is_kept { written } else { axis.rounded(position[k]) };
        }
        rounded
    }
}
