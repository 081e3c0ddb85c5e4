//! The time at each knot of the route.

use super::route::{Knot, Route};
use super::{DriveError, LONGEST_S, PathLaw};
use smallvec::{SmallVec, smallvec};

/// Least length of a part of the way between two knots, as a share of it.
const NO_PART: f64 = 1e-9;
/// Largest error along the path of a place between two knots while the motion accelerates, m: less than half of what the logs of
/// controllers resolve.
const RAMP: f64 = 2e-5;

/// A route with further knots where the motion begins or ends to accelerate between two knots, and the time (s) at each knot. At a stop the
/// route rests until the axes have come to rest.
///
/// # Errors
/// It takes longer than [`LONGEST_S`].
pub(super) fn timed(law: &PathLaw, route: &Route) -> Result<(Route, Vec<f64>), DriveError> {
    let (mut clock, mut knots, mut times) = (Clock::new(law), Vec::new(), Vec::new());
    clock.end(route.knots.iter().copied(), &mut |knot, time| {
        knots.push(knot);
        times.push(time);
    })?;
    Ok((Route { knots }, times))
}

/// Finds the times of knots that come one after the other. How fast the route passes a knot depends on the speed limits after it, up to
/// where the motion could brake to rest.
#[derive(Clone, Debug)]
pub(super) struct Clock {
    law: PathLaw,
    /// Knots without a time.
    open: Vec<Knot>,
    /// Squares of the largest speeds that the limits at each of them and accelerating up to it allow, m²/s²; none for a last knot whose limit
    /// depends on the next one.
    squares: Vec<f64>,
    /// The last knot with a time.
    before: Option<Timed>,
}

/// A knot with its time.
#[derive(Clone, Copy, Debug)]
struct Timed {
    knot: Knot,
    /// Time, s.
    time: f64,
    /// Square of the speed, m²/s², and what the limits up to it alone allow.
    square: f64,
    reached: f64,
    /// Time for which the motion rests here before it goes on, s, if it does.
    rest: Option<f64>,
}

impl Clock {
    pub(super) fn new(law: &PathLaw) -> Self {
        Self { law: *law, open: Vec::new(), squares: Vec::new(), before: None }
    }

    /// Adds knots; `known` receives the knots whose times are now known, and these times, s.
    ///
    /// # Errors
    /// The route takes longer than [`LONGEST_S`].
    pub(super) fn add(
        &mut self,
        knots: impl Iterator<Item = Knot>,
        known: &mut impl FnMut(Knot, f64),
    ) -> Result<(), DriveError> {
        self.open.extend(knots);
        self.accelerate();
        // From a knot that the motion passes equally fast, whether it comes to rest at the last one or goes on.
        let Some(last) = self.squares.len().checked_sub(1) else { return Ok(()) };
        let (mut resting, mut going) = (0.0, self.squares[last]);
        let decided = (1..=last).rev().find(|i| {
            (resting, going) = (self.brake(*i, resting), self.brake(*i, going));
            resting.total_cmp(&going).is_eq()
        });
        match decided {
            Some(count) => self.pass(count, going, known),
            None => Ok(()),
        }
    }

    /// Adds the last knots, at which the motion comes to rest.
    ///
    /// # Errors
    /// As [`Clock::add`].
    pub(super) fn end(
        &mut self,
        knots: impl Iterator<Item = Knot>,
        known: &mut impl FnMut(Knot, f64),
    ) -> Result<(), DriveError> {
        self.open.extend(knots);
        if let Some(last) = self.open.last_mut() {
            last.stop.get_or_insert(0.0);
        }
        self.accelerate();
        self.pass(self.open.len(), 0.0, known)
    }

    /// Largest growth of the square of the speed on the way to a knot, m²/s².
    fn gains(&self, i: usize) -> f64 {
        2.0 * self.open[i].acceleration * self.open[i].length
    }

    /// The speeds that the limits at each knot and accelerating up to it allow.
    fn accelerate(&mut self) {
        for i in self.squares.len()..self.open.len() {
            let knot = &self.open[i];
            let square = match self.open.get(i + 1) {
                _ if knot.stop.is_some() => 0.0,
                Some(next) => knot.speed.min(next.speed).powi(2),
                None => return,
            };
            let before = i.checked_sub(1).map(|i| self.squares[i]).or(self.before.map(|before| before.reached));
            self.squares.push(before.map_or(square, |before| square.min(before + self.gains(i))));
        }
    }

    /// The square of the speed at the knot before another, which is passed at this square.
    fn brake(&self, i: usize, square: f64) -> f64 {
        self.squares[i - 1].min(square + self.gains(i))
    }

    /// Gives the first `count` knots their times; the last of them is passed at this square of the speed.
    fn pass(&mut self, count: usize, last: f64, known: &mut impl FnMut(Knot, f64)) -> Result<(), DriveError> {
        let mut square = last;
        // The speed that the limits of these knots alone allow.
        let mut reached = last;
        for i in (0..count).rev() {
            let allowed = std::mem::replace(&mut self.squares[i], square);
            if i + 1 == count {
                reached = allowed;
            }
            square = if i > 0 { self.brake(i, square) } else { square };
        }
        for (knot, square) in self.open.drain(..count).zip(self.squares.drain(..count)) {
            let mut time = 0.0;
            if let Some(before) = self.before {
                time = before.time + before.rest.unwrap_or(0.0);
                let parts = parts([before.square, square], &knot);
                let mut gone = 0.0;
                for (n, (length, lasts)) in parts.iter().enumerate() {
                    time += lasts;
                    gone += length;
                    if n + 1 < parts.len() {
                        known(between(&before.knot, &knot, gone / knot.length, *length), time);
                    }
                }
                // The parts before the knot have knots of their own.
                let own = parts.last().map_or(knot.length, |(length, _)| *length);
                known(Knot { length: own, ..knot }, time);
            } else {
                known(knot, time);
            }
            if time > LONGEST_S {
                return Err(DriveError::TooLong);
            }
            let rest = self.before.and_then(|_| self.law.rest_at(&knot));
            self.before = Some(Timed { knot, time, square, reached, rest });
        }
        Ok(())
    }
}

/// Lengths (m) and durations (s) of the parts of the way to a knot, along each of which the speed is nearly the same: the motion accelerates
/// up to the speed limit, keeps it, and brakes to the speed at the knot. `squares` are those of the speed at the start and at the end, m²/s².
fn parts(squares: [f64; 2], knot: &Knot) -> SmallVec<[(f64, f64); 8]> {
    let acceleration = knot.acceleration;
    // With an infinite acceleration, the arm has the speed limit of a stretch from its start to its end.
    if acceleration.is_infinite() {
        return smallvec![(knot.length, knot.length / knot.speed)];
    }
    let [from, to] = squares.map(f64::sqrt);
    let peak = (knot.speed * knot.speed).min(0.5 * (squares[0] + squares[1]) + acceleration * knot.length).sqrt();
    let ways = squares.map(|square| 0.5 * (peak * peak - square) / acceleration);
    let even = knot.length - ways[0] - ways[1];
    // Rounding alone makes no part.
    let least = NO_PART * knot.length;
    if ways.iter().chain([&even]).filter(|way| **way > least).count() < 2 {
        return ramp([from, to], 2.0 * knot.length / (from + to)).collect();
    }
    let mut all = SmallVec::new();
    if ways[0] > least {
        all.extend(ramp([from, peak], (peak - from) / acceleration));
    }
    if even > least {
        all.push((even, even / peak));
    }
    if ways[1] > least {
        all.extend(ramp([peak, to], (peak - to) / acceleration));
    }
    all
}

/// Lengths (m) and durations (s) of parts of a motion whose speed (m/s) changes evenly over a time (s). A place between the ends of a part is
/// off by [`RAMP`] at most if the speed is taken as the same along the part.
fn ramp([from, to]: [f64; 2], lasts: f64) -> impl Iterator<Item = (f64, f64)> {
    // In the middle of a time t with an acceleration a, the place differs from that at an even speed by a t²/8.
    let off = (to - from).abs() * lasts / 8.0;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let count = (off / RAMP).sqrt().ceil().max(1.0) as usize;
    #[allow(clippy::cast_precision_loss)]
    (0..count).map(move |k| {
        let mean = from + (to - from) * (k as f64 + 0.5) / count as f64;
        (mean * lasts / count as f64, lasts / count as f64)
    })
}

/// A knot at a share of the way from one knot to another, at the end of a part of a length (m).
fn between(from: &Knot, to: &Knot, share: f64, length: f64) -> Knot {
    Knot {
        motor: from.motor.lerp(&to.motor, share),
        place: from.place.lerp(&to.place, share),
        progress: from.progress + share * (to.progress - from.progress),
        length,
        stop: None,
        ..*to
    }
}
