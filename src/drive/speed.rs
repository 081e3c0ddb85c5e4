//! The time at each knot of the route.

use super::route::Route;
use super::{DriveError, LONGEST_S, PathLaw};

/// The time (s) at each knot of a route; at a stop the route rests until the axes have come to rest.
///
/// # Errors
/// It takes longer than [`LONGEST_S`].
pub(super) fn times(law: &PathLaw, route: &Route) -> Result<Vec<f64>, DriveError> {
    let knots = &route.knots;
    let gains = |i: usize| 2.0 * law.acceleration * knots[i].length;
    // Squares of the largest speeds, m²/s²: first the limits on both sides of a knot, then what braking and accelerating allow.
    let mut squares: Vec<f64> = (0..knots.len())
        .map(|i| {
            let after = knots.get(i + 1).map_or(f64::INFINITY, |next| next.speed);
            if knots[i].stops || i + 1 == knots.len() { 0.0 } else { knots[i].speed.min(after).powi(2) }
        })
        .collect();
    for i in 1..knots.len() {
        squares[i] = squares[i].min(squares[i - 1] + gains(i));
    }
    for i in (1..knots.len()).rev() {
        squares[i - 1] = squares[i - 1].min(squares[i] + gains(i));
    }
    let mut time = 0.0;
    let mut times = Vec::with_capacity(knots.len());
    for i in 0..knots.len() {
        if i > 0 {
            let (from, to) = (squares[i - 1].sqrt(), squares[i].sqrt());
            // With an infinite acceleration, the arm has the speed limit of a stretch from its start to its end.
            let mean = if law.acceleration.is_infinite() { knots[i].speed } else { 0.5 * (from + to) };
            time += knots[i].length / mean;
            if knots[i - 1].stops && i > 1 {
                time += law.settling();
            }
        }
        times.push(time);
    }
    if time > LONGEST_S { Err(DriveError::TooLong) } else { Ok(times) }
}
