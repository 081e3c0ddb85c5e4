//! The time at each knot of the route.

use super::route::{Knot, Route};
use super::{DriveError, LONGEST_S, PathLaw};

/// The time (s) at each knot of a route; at a stop the route rests until the axes have come to rest.
///
/// # Errors
/// It takes longer than [`LONGEST_S`].
pub(super) fn times(law: &PathLaw, route: &Route) -> Result<Vec<f64>, DriveError> {
    let (mut clock, mut times) = (Clock::new(law), Vec::with_capacity(route.knots.len()));
    clock.end(route.knots.iter().copied(), &mut |_, time| times.push(time))?;
    Ok(times)
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
    /// Time, s.
    time: f64,
    /// Square of the speed, m²/s², and what the limits up to it alone allow.
    square: f64,
    reached: f64,
    /// Whether the motion rests here before it goes on.
    rests: bool,
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
            last.stops = true;
        }
        self.accelerate();
        self.pass(self.open.len(), 0.0, known)
    }

    /// Largest growth of the square of the speed on the way to a knot, m²/s².
    fn gains(&self, i: usize) -> f64 {
        2.0 * self.law.acceleration * self.open[i].length
    }

    /// The speeds that the limits at each knot and accelerating up to it allow.
    fn accelerate(&mut self) {
        for i in self.squares.len()..self.open.len() {
            let knot = &self.open[i];
            let square = match self.open.get(i + 1) {
                _ if knot.stops => 0.0,
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
            let time = self.before.map_or(0.0, |before| {
                let (from, to) = (before.square.sqrt(), square.sqrt());
                // With an infinite acceleration, the arm has the speed limit of a stretch from its start to its end.
                let mean = if self.law.acceleration.is_infinite() { knot.speed } else { 0.5 * (from + to) };
                let time = before.time + knot.length / mean;
                if before.rests { time + self.law.settling() } else { time }
            });
            if time > LONGEST_S {
                return Err(DriveError::TooLong);
            }
            let rests = knot.stops && self.before.is_some();
            self.before = Some(Timed { time, square, reached, rests });
            known(knot, time);
        }
        Ok(())
    }
}
