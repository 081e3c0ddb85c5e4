//! Checks whether the arm returns to places in a run. If it never does, an error that follows time also follows place.

use super::data::Problem;
use super::decisions::NEVER_RETURNS;
use nalgebra::{Matrix3, Vector3};

/// Whether time is almost a linear function of place in every run.
pub(super) fn never_returns(problem: &Problem) -> bool {
    (0..problem.runs.len()).all(|run| explained(problem, run) > NEVER_RETURNS)
}

/// Share of the variance of the times of a run that a linear function of the place explains.
fn explained(problem: &Problem, run: usize) -> f64 {
    /// Share of the variance of the places that is added to the diagonal, because the rows of a run in a plane have no
    /// variance across it.
    const RIDGE: f64 = 1e-9;
    let rows = || problem.rows.iter().filter(|row| row.run == run);
    let of = |row| (problem.place_mm(row), problem.time_s(row));
    let count = rows().count().max(1) as f64;
    let (places, times) = rows().map(of).fold((Vector3::zeros(), 0.0), |(p, t), (place, time)| (p + place, t + time));
    let (mean_mm, mean_s) = (places / count, times / count);
    let (mut square, mut cross, mut scatter) = (Matrix3::zeros(), Vector3::zeros(), 0.0);
    for (place, time) in rows().map(of) {
        let (place, time) = (place - mean_mm, time - mean_s);
        square += place * place.transpose();
        cross += place * time;
        scatter += time * time;
    }
    square += Matrix3::identity() * (RIDGE * square.trace());
    let slope = square.cholesky().map_or_else(Vector3::zeros, |factor| factor.solve(&cross));
    if scatter > 0.0 { slope.dot(&cross) / scatter } else { 0.0 }
}
