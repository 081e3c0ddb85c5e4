//! Patterns that stand for what nobody lists: smooth in a joint's angle, time or force, or a jump.

use super::candidates::Candidate;
use super::data::{Observation, Problem};
use crate::effects::Survey;
use nalgebra::DVector;
use rayon::prelude::*;

/// What an unexplained remainder may follow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Pattern {
    /// One joint's angle.
    Joint(usize),
    /// Time.
    Time,
    /// The force.
    Force,
    /// A jump from one sixteenth of the run on.
    Jump(usize),
}

const ORDERS: [f64; 5] = [1.0, 2.0, 3.0, 5.0, 8.0];
const WAVES: usize = 14;
const JUMPS: usize = 16;

/// Every pattern that the data can show.
pub(super) fn all(survey: &Survey, problem: &Problem) -> Vec<Candidate> {
    if problem.free_device {
        return Vec::new();
    }
    let mut all: Vec<Candidate> =
        (0..6).map(|joint| Candidate::pattern(Pattern::Joint(joint), 3 * 2 * ORDERS.len())).collect();
    if survey.time.is_some_and(|(from, to)| to > from) {
        all.push(Candidate::pattern(Pattern::Time, 3 * WAVES));
    }
    if survey.has_force {
        all.push(Candidate::pattern(Pattern::Force, 3 * 9));
    }
    all.extend((1..JUMPS).map(|at| Candidate { variants: JUMPS as f64, ..Candidate::pattern(Pattern::Jump(at), 3) }));
    all
}

/// The columns of a pattern of `size` numbers.
pub(super) fn columns(problem: &Problem, pattern: Pattern, size: usize) -> Vec<DVector<f64>> {
    /// In mm, as the prior of [`Candidate::pattern`].
    const TYPICAL_MM: f64 = 0.05;
    let count = problem.rows.len().max(2);
    let time = problem.rows.iter().map(|row| problem.runs[row.run].points[row.point].time);
    let (from, to) = time.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), t| (a.min(t), b.max(t)));
    let force_size = problem
        .rows
        .iter()
        .map(|row| match problem.runs[row.run].situation(row.point).cutting {
            crate::effects::Cutting::Constant(force) => force.norm(),
            _ => 0.0,
        })
        .fold(1.0, f64::max);
    let value = |row: &Observation, index: usize, which: usize| {
        use std::f64::consts::PI;
        let point = &problem.runs[row.run].points[row.point];
        match pattern {
            Pattern::Joint(joint) => {
                let angle = ORDERS[which / 2] * row.motor[joint];
                if which.is_multiple_of(2) { angle.cos() } else { angle.sin() }
            }
            Pattern::Time => (PI * (which + 1) as f64 * (point.time - from) / (to - from).max(1e-9)).cos(),
            Pattern::Force => match problem.runs[row.run].situation(row.point).cutting {
                crate::effects::Cutting::Constant(force) => {
                    let f = force / force_size;
                    [f.x, f.y, f.z, f.x * f.x, f.y * f.y, f.z * f.z, f.x * f.y, f.y * f.z, f.x * f.z][which]
                }
                _ => 0.0,
            },
            Pattern::Jump(at) => f64::from(u8::from(index * JUMPS >= at * count)),
        }
    };
    let functions = size / 3;
    let mut columns = Vec::with_capacity(size);
    for which in 0..functions {
        for axis in 0..3 {
            let parts: Vec<(usize, usize, f64)> = problem
                .rows
                .par_iter()
                .enumerate()
                .map(|(index, row)| (row.offset, row.seen.len(), value(row, index, which)))
                .collect();
            let mut column = DVector::zeros(problem.scalars);
            for (offset, len, value) in parts {
                if axis < len {
                    column[offset + axis] = TYPICAL_MM * value;
                }
            }
            columns.push(column);
        }
    }
    columns
}
