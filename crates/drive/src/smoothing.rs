//! Two moving averages over time, and the lag of each axis.

use super::route::{Knot, Route};
use super::{DrivenSample, PathLaw, SAMPLE_S};
use deflex_robot::Joints;
use nalgebra::{SVector, Vector3};
use rayon::prelude::*;

/// Step of the averages of [`responses`], s: half a sample.
const STEP_S: f64 = 0.5 * SAMPLE_S;
/// Number of samples whose integrals begin at one moment: over some seconds, sums of angles keep their digits.
const TOGETHER: usize = 256;
/// A path that is sampled sparsely is straight to this between two samples, m: a fiftieth of what the best law that was fitted to a real
/// controller leaves unexplained (docs/driven-path.md).
const STRAIGHT: f64 = 1e-6;
/// Most periods of [`SAMPLE_S`] between two such samples: a quarter of a second, in which nothing in the cell changes much.
const MOST_PERIODS: usize = 64;

/// The quantities that are averaged: motor angles, rad, and last the covered length of the route, m. In an average of the progress,
/// waypoints that are close together would have more weight than others.
type Averaged = SVector<f64, 7>;

/// A route over time, from which samples are taken as soon as they are known. Everything changes evenly between two of its moments.
#[derive(Clone, Debug)]
pub(super) struct Timeline {
    law: PathLaw,
    /// The moments that samples still need.
    moments: Vec<Moment>,
    /// Whether the last moment is the end of the route.
    is_ended: bool,
    last: Option<LastKnot>,
    /// The next period to be sampled.
    period: usize,
    /// Chosen periods whose samples are not taken.
    chosen: Vec<usize>,
    /// The last moments whose changes no longer act at that period, and before it.
    left: usize,
    reached: usize,
}

/// The last knot of a route that goes on.
#[derive(Clone, Debug)]
struct LastKnot {
    place: Vector3<f64>,
    /// Time for which the motion rests here before it goes on, s, if it does.
    rest: Option<f64>,
    /// Velocity of the TCP up to it, m/s.
    velocity: Vector3<f64>,
}

/// A moment at which the route turns, or changes its speed.
#[derive(Clone, Debug, Default)]
struct Moment {
    /// Time since the start of the first motion, s.
    time: f64,
    state: Averaged,
    /// See [`Knot::progress`](super::route::Knot::progress).
    progress: f64,
    /// Sum of all changes of the velocity of the TCP up to here, m/s.
    turned: f64,
}

/// From a moment on: the rate of the state, and the first and second integral over time of the change of the state since the start of a
/// stretch.
#[derive(Clone, Copy)]
struct Integrals {
    rate: Averaged,
    once: Averaged,
    twice: Averaged,
}

impl Timeline {
    pub(super) fn new(law: &PathLaw) -> Self {
        Self {
            law: *law,
            moments: Vec::new(),
            is_ended: false,
            last: None,
            period: 0,
            chosen: Vec::new(),
            left: 0,
            reached: 0,
        }
    }

    /// The timeline of a route that is at its knots at `times`, s.
    pub(super) fn of(law: &PathLaw, route: &Route, times: &[f64]) -> Self {
        let mut timeline = Self::new(law);
        route.knots.iter().zip(times).for_each(|(knot, time)| timeline.add(*knot, *time));
        timeline.end();
        timeline
    }

    /// Adds the next knot of a route, with its time, s. At a stop the route rests until the axes have come to rest.
    pub(super) fn add(&mut self, knot: Knot, time: f64) {
        let mut state = Averaged::from_fn(|i, _| if i < 6 { knot.motor[i] } else { knot.length });
        let (mut turned, mut velocity, is_first) = (0.0, Vector3::zeros(), self.last.is_none());
        if let Some(last) = self.last.take() {
            velocity = last.velocity;
            if let Some(rest) = last.rest {
                let stopped = self.turn_last(velocity.norm());
                velocity = Vector3::zeros();
                self.moments.push(Moment { time: stopped.time + rest, ..stopped });
            }
            let lasts = time - self.moments.last().map_or(0.0, |left| left.time);
            let next = if lasts > 0.0 { (knot.place - last.place) / lasts } else { velocity };
            let left = self.turn_last((next - velocity).norm());
            (turned, velocity) = (left.turned, next);
            state[6] += left.state[6];
        }
        self.moments.push(Moment { time, state, progress: knot.progress, turned });
        let rest = self.law.rest_at(&knot).filter(|_| !is_first);
        self.last = Some(LastKnot { place: knot.place, rest, velocity });
    }

    /// Ends the route at the last knot.
    pub(super) fn end(&mut self) {
        let speed = self.last.as_ref().map_or(0.0, |last| last.velocity.norm());
        self.turn_last(speed);
        self.is_ended = true;
    }

    /// Adds a change of the velocity of the TCP (m/s) at the last moment, and returns that moment.
    fn turn_last(&mut self, change: f64) -> Moment {
        let Some(last) = self.moments.last_mut() else { return Moment::default() };
        last.turned += change;
        last.clone()
    }

    /// Number of samples of the path, every [`SAMPLE_S`], until the axes are at rest; more than any path has, as long as the end is unknown.
    fn count(&self) -> usize {
        if !self.is_ended {
            return usize::MAX;
        }
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        self.moments.last().map_or(0, |last| ((last.time + self.law.settling()) / SAMPLE_S).ceil() as usize + 1)
    }

    /// The path, sampled every [`SAMPLE_S`].
    pub(super) fn samples(&self) -> Vec<DrivenSample> {
        let periods: Vec<usize> = (0..self.count()).collect();
        periods.par_chunks(TOGETHER).map(|periods| self.samples_at(periods)).flatten_iter().collect()
    }

    /// Chooses further samples, as far as the route is known, so that the path between two of them is straight to [`STRAIGHT`]. `longest`
    /// gives the longest time (s) between two samples of which the first is on the segment to one waypoint and the second on the segment to
    /// another. Returns the periods of [`SAMPLE_S`] of those that are computed together.
    pub(super) fn choose(&mut self, longest: &dyn Fn(usize, usize) -> f64) -> Vec<Vec<usize>> {
        let count = self.count();
        let settling = self.law.settling();
        let known = match self.moments.len().checked_sub(2) {
            _ if self.is_ended => f64::INFINITY,
            // The direction after the last moment is still unknown.
            Some(last) => self.moments[last].time,
            None => return Vec::new(),
        };
        while self.period < count {
            let period = self.period;
            #[allow(clippy::cast_precision_loss)]
            let [time, latest] = [period, period + MOST_PERIODS + 1].map(|period| period as f64 * SAMPLE_S);
            if latest >= known {
                break;
            }
            self.chosen.push(period);
            let moments = &self.moments;
            let advance = |from: &mut usize, until: f64| {
                while moments.get(*from + 1).is_some_and(|next| next.time <= until) {
                    *from += 1;
                }
            };
            advance(&mut self.left, time - settling);
            advance(&mut self.reached, time);
            let (mut periods, mut ahead) = (1, self.reached);
            while 2 * periods <= MOST_PERIODS && period + 2 * periods < count {
                #[allow(clippy::cast_precision_loss)]
                let step = (2 * periods) as f64 * SAMPLE_S;
                advance(&mut ahead, time + step);
                let (from, to) = (&moments[self.left], &moments[ahead]);
                let next = moments.get(ahead + 1).unwrap_or(to);
                let before = if from.time <= time - settling { from.turned } else { 0.0 };
                if self.law.bend(to.turned - before, step) > STRAIGHT
                    || longest(place(from.progress).0, place(next.progress).0) < step
                {
                    break;
                }
                periods *= 2;
            }
            self.period += periods;
            // The path ends with a sample.
            if self.period >= count && period + 1 < count {
                self.period = count - 1;
            }
        }
        let ready = if self.is_ended { self.chosen.len() } else { self.chosen.len() / TOGETHER * TOGETHER };
        self.chosen.drain(..ready).collect::<Vec<_>>().chunks(TOGETHER).map(<[usize]>::to_vec).collect()
    }

    /// The waypoint at the end of the segment of the first moment.
    pub(super) fn waypoint(&self) -> usize {
        self.moments.first().map_or(0, |first| place(first.progress).0)
    }

    /// Forgets the moments that no further sample needs.
    pub(super) fn forget(&mut self) {
        #[allow(clippy::cast_precision_loss)]
        let time = *self.chosen.first().unwrap_or(&self.period) as f64 * SAMPLE_S;
        let needed = self.moments.partition_point(|moment| moment.time <= time - self.law.settling()).saturating_sub(1);
        self.moments.drain(..needed);
        self.left = self.left.saturating_sub(needed);
        self.reached = self.reached.saturating_sub(needed);
    }

    /// The path at some consecutive ones of the chosen periods.
    pub(super) fn samples_at(&self, periods: &[usize]) -> Vec<DrivenSample> {
        #[allow(clippy::cast_precision_loss)]
        let time_of = |period: &usize| *period as f64 * SAMPLE_S;
        let Some((begins, ends)) = periods.first().map(time_of).zip(periods.last().map(time_of)) else {
            return Vec::new();
        };
        let first =
            self.moments.partition_point(|moment| moment.time <= begins - self.law.settling()).saturating_sub(1);
        let last = self.moments.partition_point(|moment| moment.time < ends).max(first);
        let moments = &self.moments[first..(last + 1).min(self.moments.len())];
        let from = moments[0].state;
        let (mut once, mut twice) = (Averaged::zeros(), Averaged::zeros());
        let integrals: Vec<Integrals> = (0..moments.len())
            .map(|i| {
                let (here, next) = (&moments[i], moments.get(i + 1).unwrap_or(&moments[i]));
                let lasts = next.time - here.time;
                let rate = if lasts > 0.0 { (next.state - here.state) / lasts } else { Averaged::zeros() };
                let integrals = Integrals { rate, once, twice };
                let changed = here.state - from;
                twice += (once + (changed / 2.0 + rate * (lasts / 6.0)) * lasts) * lasts;
                once += (changed + rate * (lasts / 2.0)) * lasts;
                integrals
            })
            .collect();
        // A mean over a width is a difference of the integral; a mean of a mean is a difference of differences of the second one.
        let widths: Vec<f64> = self.law.smoothing.into_iter().filter(|width| *width > 0.0).collect();
        let mut terms = vec![(0.0, 1.0)];
        for width in &widths {
            let later: Vec<_> = terms.iter().map(|(delay, weight)| (delay + width, -weight / width)).collect();
            terms.iter_mut().for_each(|(_, weight)| *weight /= width);
            terms.extend(later);
        }
        let mut at = vec![0; terms.len()];
        let sample = |period: &usize| {
            let time = time_of(period);
            let mut means = [Averaged::zeros(); 3];
            for ((delay, weight), at) in terms.iter().zip(&mut at) {
                let then = time - delay;
                while moments.get(*at + 1).is_some_and(|next| next.time <= then) {
                    *at += 1;
                }
                let (here, Integrals { rate, once, twice }) = (&moments[*at], &integrals[*at]);
                let since = then - here.time;
                if since < 0.0 {
                    // Before the first moment, nothing has changed.
                    continue;
                }
                let changed = here.state - from;
                let integrals = [
                    twice + (once + (changed / 2.0 + rate * (since / 6.0)) * since) * since,
                    once + (changed + rate * (since / 2.0)) * since,
                    changed + rate * since,
                    *rate,
                    Averaged::zeros(),
                ];
                for (mean, integral) in means.iter_mut().zip(&integrals[2 - widths.len()..]) {
                    *mean += integral * *weight;
                }
            }
            let [changed, rate, acceleration] = means;
            let state = from + changed;
            let law = &self.law;
            let motor = |i: usize| state[i] - law.lag[i] * rate[i] + law.axis_lead[i] * acceleration[i];
            let (waypoint, share) = place(progress_at(moments, state[6]));
            DrivenSample { time, motor: Joints::from_fn(|i, _| motor(i)), waypoint, share }
        };
        periods.iter().map(sample).collect()
    }
}

impl PathLaw {
    /// Upper bound of the distance of the driven path from the straight line between two samples, m. The samples are a `step` (s) apart, and
    /// the velocity of the route changes by `change` (m/s) in the time that acts on them.
    ///
    /// After the wider average, the acceleration is at most `change` over its width, and it changes over the narrower one.
    fn bend(&self, change: f64, step: f64) -> f64 {
        let [narrow, wide] = [f64::min, f64::max].map(|of| of(self.smoothing[0], self.smoothing[1]).max(SAMPLE_S));
        // One axis may lead or trail while another one turns the other way.
        let (lead, lag) = (2.0 * self.axis_lead.amax(), 2.0 * self.lag.amax());
        let acceleration = change / wide;
        acceleration * step * step / 8.0 + acceleration * (lead + lag * step / 4.0) * (step / narrow).min(1.0)
    }
}

/// The progress at a length of the route.
fn progress_at(moments: &[Moment], length: f64) -> f64 {
    let after = moments.partition_point(|moment| moment.state[6] < length).clamp(1, moments.len().max(2) - 1);
    let Some((from, to)) = moments.get(after - 1).zip(moments.get(after)) else {
        return moments.last().map_or(0.0, |last| last.progress);
    };
    let span = to.state[6] - from.state[6];
    let share = if span > 0.0 { ((length - from.state[6]) / span).clamp(0.0, 1.0) } else { 1.0 };
    from.progress + (to.progress - from.progress) * share
}

/// Waypoint and share from the progress along the route.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
fn place(progress: f64) -> (usize, f64) {
    let before = (progress - 1e-9).max(0.0).floor();
    (before as usize + 1, (progress - before).clamp(0.0, 1.0))
}

/// How the driven path follows a change along the route: values of consecutive samples, zero elsewhere.
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

/// Responses to hats over the progress along the route: one at the second of three points, and zero at the first and the last.
/// They are smoothed like an axis without a lead, and delayed by the mean lag.
pub(super) fn responses(law: &PathLaw, route: &Route, times: &[f64], hats: &[[f64; 3]]) -> Vec<Response> {
    let end = times.last().copied().unwrap_or(0.0) + law.settling();
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let cells = (end / STEP_S).ceil() as usize + 2;
    let progress = progress_in_cells(law, route, times, cells);
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
fn progress_in_cells(law: &PathLaw, route: &Route, times: &[f64], cells: usize) -> Vec<f64> {
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
        let begins = times[i - 1] + law.rest_at(before).filter(|_| i > 1).unwrap_or(0.0);
        let share = if times[i] > begins { ((time - begins) / (times[i] - begins)).clamp(0.0, 1.0) } else { 1.0 };
        progress.push(before.progress + (knot.progress - before.progress) * share);
    }
    progress
}

/// Moving average over a window of `width` s about the middle of each step less `delay` s; zero outside.
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
