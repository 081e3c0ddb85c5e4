//! Two moving averages over time, and the lag of each axis.

use super::route::{Knot, Route};
use super::{DrivenSample, PathLaw, SAMPLE_S};
use crate::robot::Joints;
use nalgebra::SVector;
use rayon::prelude::*;

/// Step of the averages, s: half a sample.
const STEP_S: f64 = 0.5 * SAMPLE_S;

/// Motor angles and, last, the length of route that has been covered, m: what is averaged. Of the progress, waypoints that lie close
/// together would weigh more than others.
type State = SVector<f64, 7>;

/// The route as it is driven, one sample every [`SAMPLE_S`] from the start of the first motion until the axes are at rest.
pub(super) fn smoothed(law: &PathLaw, route: &Route, times: &[f64]) -> Vec<DrivenSample> {
    let Some(first) = route.knots.first() else { return Vec::new() };
    let along = lengths(route);
    let from = state(&first.motor, 0.0);
    let end = times.last().copied().unwrap_or(0.0) + law.settling();
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let cells = (end / STEP_S).ceil() as usize + 2;
    let mut means = cell_means(route, &along, times, law.settling(), cells);
    for width in law.smoothing {
        means = moving_average(&means, width, &from);
    }
    let samples = cells / 2;
    (0..samples)
        .map(|k| {
            let (at, before) = (means[2 * k], if k > 0 { means[2 * k - 1] } else { from });
            let rate = (at - before) / STEP_S;
            let acceleration = (means[2 * k + 1] - 2.0 * at + before) / STEP_S.powi(2);
            let motor = |joint| at[joint] - law.lag[joint] * rate[joint] + law.axis_lead[joint] * acceleration[joint];
            let (waypoint, share) = place(progress_at(route, &along, at[6]));
            #[allow(clippy::cast_precision_loss)]
            let time = (2 * k) as f64 * STEP_S;
            DrivenSample { time, motor: Joints::from_fn(|joint, _| motor(joint)), waypoint, share }
        })
        .collect()
}

fn state(motor: &Joints, along: f64) -> State {
    State::from_fn(|i, _| if i < 6 { motor[i] } else { along })
}

/// Length of the route up to each knot, m.
fn lengths(route: &Route) -> Vec<f64> {
    let mut along = 0.0;
    let up_to = |knot: &Knot| {
        along += knot.length;
        along
    };
    route.knots.iter().map(up_to).collect()
}

/// The progress at a length of the route.
fn progress_at(route: &Route, along: &[f64], length: f64) -> f64 {
    let after = along.partition_point(|along| *along < length).clamp(1, along.len().max(2) - 1);
    let Some((from, to)) = route.knots.get(after - 1).zip(route.knots.get(after)) else { return 0.0 };
    let span = along[after] - along[after - 1];
    let share = if span > 0.0 { ((length - along[after - 1]) / span).clamp(0.0, 1.0) } else { 1.0 };
    from.progress + (to.progress - from.progress) * share
}

/// Waypoint and share from the progress along the route.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
fn place(progress: f64) -> (usize, f64) {
    let before = (progress - 1e-9).max(0.0).floor();
    (before as usize + 1, (progress - before).clamp(0.0, 1.0))
}

/// The mean of the route over each step of time; between knots everything changes evenly, at a stop it stands for `rest` s.
fn cell_means(route: &Route, along: &[f64], times: &[f64], rest: f64, cells: usize) -> Vec<State> {
    let knots = &route.knots;
    let at = |i: usize| state(&knots[i].motor, along[i]);
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

/// The mean over the `width` s before the middle of each step; before the first step stands the given state, after the last one the
/// last.
fn moving_average(means: &[State], width: f64, before: &State) -> Vec<State> {
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
    let up_to = |at: f64| {
        if at >= end {
            return sums[means.len()] + (at - end) * last;
        }
        let cell = at.max(0.0).floor();
        let low = cell as usize;
        sums[low] + (sums[low + 1] - sums[low]) * (at.max(0.0) - cell)
    };
    let window = width / STEP_S;
    (0..means.len())
        .map(|cell| {
            #[allow(clippy::cast_precision_loss)]
            let middle = cell as f64 + 0.5;
            before + (up_to(middle) - up_to(middle - window)) / window
        })
        .collect()
}

/// How the driven path follows something that happens along the route: values of consecutive samples, zero elsewhere.
#[derive(Clone, Debug)]
pub(super) struct Response {
    /// The first sample.
    pub(super) first: usize,
    values: Vec<f64>,
}

impl Response {
    /// The first sample after it.
    pub(super) fn end(&self) -> usize {
        self.first + self.values.len()
    }

    pub(super) fn at(&self, sample: usize) -> f64 {
        sample.checked_sub(self.first).and_then(|k| self.values.get(k)).copied().unwrap_or(0.0)
    }
}

/// Responses to hats over the progress along the route: one at the second of three places and zero at the first and the last.
/// They are smoothed as an axis is that the law says nothing special about, and delayed by the mean lag.
pub(super) fn responses(law: &PathLaw, route: &Route, times: &[f64], hats: &[[f64; 3]]) -> Vec<Response> {
    let end = times.last().copied().unwrap_or(0.0) + law.settling();
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let cells = (end / STEP_S).ceil() as usize + 2;
    let progress = progress_in_cells(route, times, law.settling(), cells);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let margin = (law.settling() / STEP_S).ceil() as usize + 2;
    hats.par_iter()
        .map(|[from, at, to]| {
            let hat = |p: f64| {
                let share = if p <= *at { (p - from) / (at - from) } else { (to - p) / (to - at) };
                share.clamp(0.0, 1.0)
            };
            let first = progress.partition_point(|p| p <= from).saturating_sub(margin);
            let last = (progress.partition_point(|p| p < to) + margin).min(cells);
            let mut values: Vec<f64> = progress[first..last].iter().map(|p| hat(*p)).collect();
            for width in law.smoothing {
                values = scalar_average(&values, width, 0.5 * width + 0.5 * law.lag.mean());
            }
            let sample = first.div_ceil(2);
            let values = values.iter().skip(2 * sample - first).step_by(2).copied().collect();
            Response { first: sample, values }
        })
        .collect()
}

/// The progress along the route in the middle of each step of time.
fn progress_in_cells(route: &Route, times: &[f64], rest: f64, cells: usize) -> Vec<f64> {
    let knots = &route.knots;
    let mut progress = Vec::with_capacity(cells);
    let mut i = 1;
    for cell in 0..cells {
        #[allow(clippy::cast_precision_loss)]
        let time = (cell as f64 + 0.5) * STEP_S;
        while i + 1 < knots.len() && times[i] < time {
            i += 1;
        }
        let Some((before, knot)) = knots.get(i - 1).zip(knots.get(i)) else {
            progress.push(knots.last().map_or(0.0, |knot| knot.progress));
            continue;
        };
        let begins = times[i - 1] + if before.stops && i > 1 { rest } else { 0.0 };
        let share = if times[i] > begins { ((time - begins) / (times[i] - begins)).clamp(0.0, 1.0) } else { 1.0 };
        progress.push(before.progress + (knot.progress - before.progress) * share);
    }
    progress
}

/// The mean over a window of `width` s about the middle of each step less `delay` s; zero outside.
fn scalar_average(values: &[f64], width: f64, delay: f64) -> Vec<f64> {
    if width <= 0.0 {
        return values.to_vec();
    }
    let mut sums = Vec::with_capacity(values.len() + 1);
    let mut sum = 0.0;
    sums.push(sum);
    for value in values {
        sum += value;
        sums.push(sum);
    }
    #[allow(clippy::cast_precision_loss, clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let up_to = |at: f64| {
        let at = at.clamp(0.0, values.len() as f64);
        let low = (at.floor() as usize).min(values.len().saturating_sub(1));
        sums[low] + (sums.get(low + 1).unwrap_or(&sum) - sums[low]) * (at - low as f64)
    };
    let half = 0.5 * width / STEP_S;
    #[allow(clippy::cast_precision_loss)]
    (0..values.len())
        .map(|cell| {
            let middle = cell as f64 + 0.5 - delay / STEP_S;
            (up_to(middle + half) - up_to(middle - half)) / (2.0 * half)
        })
        .collect()
}
