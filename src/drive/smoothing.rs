//! Two moving averages over time, and the lag of each axis.

use super::route::Route;
use super::{DrivenSample, PathLaw, SAMPLE_S};
use crate::robot::Joints;
use nalgebra::SVector;

/// Step of the averages, s: half a sample.
const STEP_S: f64 = 0.5 * SAMPLE_S;

/// Motor angles and, last, the progress along the route: what is averaged.
type State = SVector<f64, 7>;

/// The route as it is driven, one sample every [`SAMPLE_S`] from the start of the first motion until the axes are at rest.
pub(super) fn smoothed(law: &PathLaw, route: &Route, times: &[f64]) -> Vec<DrivenSample> {
    let Some(first) = route.knots.first() else { return Vec::new() };
    let from = state(&first.motor, first.progress);
    let end = times.last().copied().unwrap_or(0.0) + law.settling();
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let cells = (end / STEP_S).ceil() as usize + 2;
    let mut means = cell_means(route, times, law.settling(), cells);
    let factors = state(&law.axis_smoothing, 1.0);
    for width in law.smoothing {
        // A controller knows what it is sent to before the axes go there: the longest average looks back, the others lie in its middle.
        let delay = width * law.axis_smoothing.max().max(1.0);
        means = moving_average(&means, width, delay, &factors, &from);
    }
    let samples = cells / 2;
    (0..samples)
        .map(|k| {
            let (at, before) = (means[2 * k], if k > 0 { means[2 * k - 1] } else { from });
            let rate = (at - before) / STEP_S;
            let trailing = Joints::from_fn(|joint, _| at[joint] - law.lag[joint] * rate[joint]);
            let (waypoint, share) = place(at[6]);
            #[allow(clippy::cast_precision_loss)]
            let time = (2 * k) as f64 * STEP_S;
            DrivenSample { time, motor: trailing, waypoint, share }
        })
        .collect()
}

fn state(motor: &Joints, progress: f64) -> State {
    State::from_fn(|i, _| if i < 6 { motor[i] } else { progress })
}

/// Waypoint and share from the progress along the route.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
fn place(progress: f64) -> (usize, f64) {
    let before = (progress - 1e-9).max(0.0).floor();
    (before as usize + 1, (progress - before).clamp(0.0, 1.0))
}

/// The mean of the route over each step of time; between knots everything changes evenly, at a stop it stands for `rest` s.
fn cell_means(route: &Route, times: &[f64], rest: f64, cells: usize) -> Vec<State> {
    let knots = &route.knots;
    let at = |i: usize| state(&knots[i].motor, knots[i].progress);
    let mut means = vec![State::zeros(); cells];
    // A stretch of time over which the state changes evenly is spread over the cells that it touches.
    let mut spread = |[begins, ends]: [f64; 2], from: State, to: State| {
        if ends <= begins {
            return;
        }
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let (first, last) = ((begins / STEP_S).floor() as usize, (ends / STEP_S).ceil() as usize);
        for cell in first..last.min(cells) {
            #[allow(clippy::cast_precision_loss)]
            let (left, right) = ((cell as f64 * STEP_S).max(begins), ((cell + 1) as f64 * STEP_S).min(ends));
            if right > left {
                let middle = (0.5 * (left + right) - begins) / (ends - begins);
                means[cell] += (from + (to - from) * middle) * ((right - left) / STEP_S);
            }
        }
    };
    for i in 1..knots.len() {
        let mut begins = times[i - 1];
        if knots[i - 1].stops && i > 1 {
            spread([begins, begins + rest], at(i - 1), at(i - 1));
            begins += rest;
        }
        spread([begins, times[i]], at(i - 1), at(i));
    }
    if let (Some(end), Some(time)) = (knots.len().checked_sub(1), times.last()) {
        #[allow(clippy::cast_precision_loss)]
        spread([*time, cells as f64 * STEP_S], at(end), at(end));
    }
    means
}

/// The mean over a window of `width` s times the factor of each number, about the middle of each step less half of `delay`;
/// before the first step stands the given state, after the last one the last.
fn moving_average(means: &[State], width: f64, delay: f64, factors: &State, before: &State) -> Vec<State> {
    if width <= 0.0 {
        return means.to_vec();
    }
    // Sums of differences from the start, which stay small.
    let mut sums = Vec::with_capacity(means.len() + 1);
    let mut sum = State::zeros();
    sums.push(sum);
    for mean in means {
        sum += mean - before;
        sums.push(sum);
    }
    let last = means.last().map_or_else(State::zeros, |last| last - before);
    #[allow(clippy::cast_precision_loss)]
    let end = means.len() as f64;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let up_to = |at: f64, i: usize| {
        if at >= end {
            return sums[means.len()][i] + (at - end) * last[i];
        }
        let cell = at.max(0.0).floor();
        let low = cell as usize;
        sums[low][i] + (sums[low + 1][i] - sums[low][i]) * (at.max(0.0) - cell)
    };
    (0..means.len())
        .map(|cell| {
            #[allow(clippy::cast_precision_loss)]
            let middle = cell as f64 + 0.5 - 0.5 * delay / STEP_S;
            State::from_fn(|i, _| {
                let half = 0.5 * width * factors[i] / STEP_S;
                before[i] + (up_to(middle + half, i) - up_to(middle - half, i)) / (2.0 * half)
            })
        })
        .collect()
}
