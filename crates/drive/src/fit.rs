//! Fits the law of a controller to logs of its axes.
//!
//! The fit compares path and time. A log is cut into places at even distances along it. Each place has its distance from the computed
//! path, and the difference between the time at which it was passed and the computed time.

use super::log::{Log, LogSample, tcp};
use super::route::Route;
use super::{ArcTurn, DriveError, DrivenSample, Lead, PathLaw, Track, Waypoint, drive};
use deflex_robot::{Joints, Robot, turn_between};
use nalgebra::{DMatrix, DVector, Vector3};
use rayon::prelude::*;
use serde::{Serialize, Serializer};
use std::ops::Range;

/// Largest number of places of each log: half of them spread evenly along it, the others near the waypoints between its
/// ends.
const PLACES: usize = 400;
/// Time before and after a waypoint, beyond its zone, within which a controller leaves the path, s.
const BEND_S: f64 = 0.1;
/// Largest acceleration across the path that a log may show, m/s²: twice that of gravity, which no milling arm reaches.
const MOST_ACROSS: f64 = 20.0;
/// Longest rest of a controller at a stop, s; the program waits where it is longer.
const LONGEST_REST: f64 = 1.0;
/// Share by which a rest of its own must lower the sum of squares: a controller whose axes alone decide how long it rests needs one number
/// less, and predicts other speeds better (docs/driven-path.md).
const REST_GAIN: f64 = 0.1;
/// Difference of a rest from the median of all, in [`TIME_SIGMA`], from which on the program waits there.
const WAITS: f64 = 5.0;
/// Resolution of a log, m.
const RESOLVED: f64 = 5e-5;
/// Standard deviation of a place of a log from the path of the law, m: the expected error of a law of a few numbers.
const PATH_SIGMA: f64 = 5e-5;
/// The same of the time at a place, s: two to three samples of a controller's log.
const TIME_SIGMA: f64 = 0.01;
/// Standard deviation of the rate of a log's clock, and of the speed that a controller keeps over the programmed one: logs of an IRB 6640 show
/// 0.8 % more (docs/driven-path.md).
const CLOCK_SIGMA: f64 = 0.01;
/// Prior standard deviation of the logarithm of each number of the law about [`PathLaw::TYPICAL`]: a factor of e.
const LAW_SIGMA: f64 = 1.0;
/// The same of the logarithm of the ratio of both accelerations along the path. Logs at one speed hardly distinguish a short slow corner from a
/// long one that is less slow. An IRB 6640 has 1.3 to 2, and a controller that accelerates evenly has 1: two sigma below the typical 2.
const PASSING_SIGMA: f64 = 0.35;
/// The meaning of the numbers of the axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum OfAxes {
    /// The lead of each axis for a unit of acceleration.
    Lead,
    /// The lag of each axis.
    Lag,
}

/// What decides how long a controller rests at a stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum RestsUntil {
    /// The axes have come to rest.
    Settled,
    /// Something else, so that the rest says nothing about the axes.
    Released,
}

/// Leads (s²) and lags (s) below this are rounding errors: an axis that did not move.
const NEGLIGIBLE: f64 = 1e-9;
/// Prior standard deviation of an axis's lag, s: the axes of a robot are tuned to trail their commands by nearly the
/// same time.
const LAG_SIGMA: f64 = 0.005;
/// Length of the computed path on which the point nearest to a place of the log is searched for, m.
const REACH: f64 = 0.03;
/// Distance within which the log has to pass the first and the last point of the program, m: more than any zone.
const NEAR: f64 = 0.05;
/// Largest distance of a driven path from an arc that it follows, m: twice that of the fastest logs of an IRB 6640 (docs/driven-path.md).
const ON_ARC: f64 = 2e-3;
/// Difference of the rms distances of two ways of turning from the logs by which they are distinguished, rad: twice the 0.013° to which an
/// IRB 6640 keeps its own way (docs/driven-path.md).
const TURNS_APART: f64 = 4.5e-4;
/// Rounds of the fit; each computes one path for each log and number of the law.
const ROUNDS: usize = 24;
/// A round that gains less than this share of the sum of squares is the last one.
const ENOUGH: f64 = 1e-3;
/// Step of the differences, in the logarithm of a number, or as a share of [`LAG_SIGMA`] or [`LEAD_SIGMA`].
const DIFFERENCE: f64 = 0.02;
/// Numbers of a law: those that all axes share, and one of each axis.
const SHARED: usize = 6;
/// Places among them of the acceleration across corners, and of the ratio of both accelerations along the path.
const CORNERS: usize = 4;
const PASSING: usize = 5;
const NUMBERS: usize = SHARED + 6;
/// Prior standard deviation of the lead of an axis, s²: 1/ω² of an arm whose lowest natural frequency is 8 Hz.
const LEAD_SIGMA: f64 = 4e-4;
/// Number of places of a log that count as independent: the error of the law at one place is that at its neighbours too.
const INDEPENDENT: f64 = 20.0;
/// Directions across the path in which a place can be off.
const ACROSS: f64 = 2.0;
/// Standard deviations beyond which chance no longer explains that a law predicts better: one case in forty remains.
const SIGMAS: f64 = 2.0;

/// Distance of logs from a path, mm.
///
/// # Examples
/// ```
/// use deflex_drive::PathError;
///
/// let close = PathError { rms_mm: 0.02, max_mm: 0.06 };
/// assert!(close.rms_mm < close.max_mm);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct PathError {
    /// Root mean square over all places.
    pub rms_mm: f64,
    /// Largest.
    pub max_mm: f64,
}

/// Measured and predicted duration of the logs, s.
///
/// # Examples
/// ```
/// use deflex_drive::RunTime;
///
/// /// The relative error of a predicted duration.
/// fn error(time: RunTime) -> f64 {
///     time.predicted / time.measured - 1.0
/// }
/// assert_eq!(error(RunTime { measured: 10.0, predicted: 10.0 }), 0.0);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct RunTime {
    /// Duration by the clock of the logs.
    pub measured: f64,
    /// Duration that the law predicts.
    pub predicted: f64,
}

/// A law, and how well it predicts logs that the fit has not seen.
///
/// # Examples
/// ```
/// use deflex_drive::FittedLaw;
///
/// /// Whether the law predicts paths better than corners as written do.
/// fn helps(fitted: &FittedLaw) -> bool {
///     fitted.after.rms_mm < fitted.before.rms_mm
/// }
/// ```
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct FittedLaw {
    /// The law.
    #[serde(skip)]
    pub law: PathLaw,
    /// How the controller turns the tool on arcs, if the logs decide it.
    #[serde(serialize_with = "arc_turn_word")]
    pub arc_turn: Option<ArcTurn>,
    /// Radius with which zones were counted for which neither the program nor the cell states one, m. The law rounds its share of this.
    #[serde(skip)]
    pub assumed_zone: Option<f64>,
    /// Logs that were fitted.
    pub fitted_logs: usize,
    /// Logs that were only predicted.
    pub held_out_logs: usize,
    /// Distance of the held-out logs from the programmed path, with corners as written.
    pub before: PathError,
    /// Distance of the held-out logs from the path that the law computes.
    pub after: PathError,
    /// Durations of all held-out logs together.
    pub run_time_s: RunTime,
}

impl FittedLaw {
    /// Share of the distance between driven and programmed path that the law does not explain in the held-out logs, 0 to 1; `None` if
    /// chance may have made the law predict these logs better than the programmed path does: it is not for use.
    #[must_use]
    #[doc(hidden)]
    pub fn error_share(&self) -> Option<f64> {
        #[allow(clippy::cast_precision_loss)]
        let numbers = ACROSS * INDEPENDENT * self.held_out_logs as f64;
        // The relative standard deviation of an rms of n independent numbers is 1/√(2n).
        let chance = SIGMAS / (2.0 * numbers).sqrt();
        let share = self.after.rms_mm / self.before.rms_mm;
        (share < 1.0 - chance).then_some(share)
    }
}

fn arc_turn_word<S: Serializer>(turn: &Option<ArcTurn>, to: S) -> Result<S::Ok, S::Error> {
    turn.map(ArcTurn::word).serialize(to)
}

/// Why no law was found.
#[derive(Clone, Debug, PartialEq)]
#[doc(hidden)]
pub enum LogError {
    /// There is only one log: none can be held out.
    OneLog,
    /// The log with this index does not run from the program's first point to its last.
    OtherProgram(usize),
    /// The program of the log with this index cannot be followed.
    Path(usize, DriveError),
    /// The robot was slower than the program says: its speed was overridden.
    Slow {
        /// The index of the log.
        log: usize,
        /// Its speed over the programmed one.
        share: f64,
    },
}

/// Share of the programmed speed that a run at 100 % keeps at least somewhere: controllers keep it within some per cent.
const KEPT_SPEED: f64 = 0.95;
/// Acceleration along the path and across it below those of all controllers, m/s²: a sixteenth of that of an IRB 6640.
const SLOW: f64 = 0.5;

/// A run of a program, cut into places.
struct Run<'a> {
    waypoints: &'a [Waypoint],
    places: Vec<LoggedPoint>,
    /// The places of each section between two stops: how long the arm rests at a stop has no influence on the way between.
    sections: Vec<Range<usize>>,
    seconds: f64,
}

/// A place of a log: the position of the TCP (base frame, m), and the time (s from the first place).
#[derive(Clone, Copy)]
struct LoggedPoint {
    at: Vector3<f64>,
    time: f64,
}

/// Fits a law to logs of programs, each with its waypoints, for axes with known limits (rad/s²). About every fourth log is held out as a
/// whole, at least one.
///
/// # Errors
/// Fewer than two logs; a log of another program; a program that cannot be followed.
#[doc(hidden)]
pub fn fit_law(robot: &Robot, logs: &[(&[Waypoint], &Log)], axis_acceleration: &Joints) -> Result<FittedLaw, LogError> {
    if logs.len() < 2 {
        return Err(LogError::OneLog);
    }
    let mut runs = Vec::with_capacity(logs.len());
    for (i, (waypoints, log)) in logs.iter().enumerate() {
        let samples = log.of_program(robot, waypoints, NEAR).ok_or(LogError::OtherProgram(i))?;
        runs.push((i, Run::new(robot, waypoints, samples).ok_or(LogError::OtherProgram(i))?));
    }
    for (log, run) in &runs {
        if let Some(share) = run.override_share(robot).map_err(|error| LogError::Path(*log, error))? {
            return Err(LogError::Slow { log: *log, share });
        }
    }
    let count = runs.len();
    let (held, fitted): (Vec<_>, Vec<_>) = runs.into_iter().partition(|(i, _)| is_held_out(*i, count));
    let law = fit(robot, &fitted, axis_acceleration)?;
    let compared = |law: Option<&PathLaw>| -> Result<Vec<Compared>, LogError> {
        held.par_iter().map(|(i, run)| run.compare(robot, law).map_err(|error| LogError::Path(*i, error))).collect()
    };
    let (before, after) = (compared(None)?, compared(Some(&law))?);
    Ok(FittedLaw {
        law,
        arc_turn: None,
        assumed_zone: None,
        fitted_logs: fitted.len(),
        held_out_logs: held.len(),
        before: PathError::of(&before),
        after: PathError::of(&after),
        run_time_s: RunTime {
            measured: held.iter().map(|(_, run)| run.seconds).sum(),
            predicted: after.iter().map(|compared| compared.seconds).sum(),
        },
    })
}

/// A way in which the controller may turn the tool on arcs.
#[doc(hidden)]
pub struct WayOfTurning<'a> {
    pub turn: ArcTurn,
    /// The waypoints of each program for a tool that turns in this way, with its log.
    pub logs: Vec<(&'a [Waypoint], &'a Log)>,
}

/// How the controller turns the tool on arcs, by the orientations of the tool in the logs. `None` if they do not show it: without arcs,
/// or if the tool turns so little on them that all ways are alike.
///
/// # Errors
/// As [`fit_law`].
#[doc(hidden)]
pub fn arc_turn(robot: &Robot, ways: &[WayOfTurning<'_>]) -> Result<Option<ArcTurn>, LogError> {
    let mut off = Vec::with_capacity(ways.len());
    for way in ways {
        let mut squares = Vec::new();
        for (i, (waypoints, log)) in way.logs.iter().enumerate() {
            let samples = log.of_program(robot, waypoints, NEAR).ok_or(LogError::OtherProgram(i))?;
            for (from, to) in waypoints.iter().zip(&waypoints[1..]) {
                let Lead::Arc { via, turn } = &to.lead else { continue };
                let arc = Track::arc(&from.start_of(robot, to), via, &to.base_from_tcp, *turn);
                squares.extend(samples.iter().filter_map(|sample| turned_off(robot, to, &arc, sample)));
            }
        }
        #[allow(clippy::cast_precision_loss)]
        let count = squares.len().max(1) as f64;
        off.push((way.turn, (squares.into_iter().sum::<f64>() / count).sqrt()));
    }
    off.sort_by(|a, b| a.1.total_cmp(&b.1));
    Ok(match off[..] {
        [(best, least), (_, next), ..] if next - least > TURNS_APART => Some(best),
        _ => None,
    })
}

/// Square of the angle between the orientation at a sample and that of an arc where the sample is nearest to it, rad²; `None` for a sample
/// that is not on the arc.
fn turned_off(robot: &Robot, to: &Waypoint, arc: &Track, sample: &LogSample) -> Option<f64> {
    let base_from_tcp = robot.forward(&sample.motor) * to.flange_from_tcp;
    let there = arc.pose(arc.nearest(&base_from_tcp.translation.vector));
    let is_on = (there.translation.vector - base_from_tcp.translation.vector).norm() <= ON_ARC;
    is_on.then(|| turn_between(&there.rotation, &base_from_tcp.rotation).norm_squared())
}

/// Whether a log is held out. A quarter of the logs are, spread by multiples of the golden ratio: logs often are in the order of speeds
/// and zones, with which every fourth log would be in step.
fn is_held_out(i: usize, count: usize) -> bool {
    #[allow(clippy::cast_precision_loss)]
    let spread = |i: usize| ((i as f64 + 0.5) * 0.618_033_988_749_895).fract();
    let least = (0..count).map(spread).fold(f64::INFINITY, f64::min);
    spread(i) < 0.25 || spread(i) <= least
}

impl PathError {
    fn of(compared: &[Compared]) -> Self {
        let squares = || compared.iter().flat_map(|compared| &compared.off).map(Vector3::norm_squared);
        #[allow(clippy::cast_precision_loss)]
        let count = squares().count().max(1) as f64;
        Self {
            rms_mm: 1e3 * (squares().sum::<f64>() / count).sqrt(),
            max_mm: 1e3 * squares().fold(0.0, f64::max).sqrt(),
        }
    }
}

/// Comparison of a run with a computed path.
struct Compared {
    /// Vector from the nearest point of the path to each place of the log, base frame, m.
    off: Vec<Vector3<f64>>,
    /// Delay of the log at each place, s, less the mean delay of its section and what the rate of the clock explains.
    late: Vec<f64>,
    /// Delay from each section to the next one, s: by how much the log rests longer at the stop between them.
    rests: Vec<f64>,
    /// By how much the clock runs faster, as a share.
    clock: f64,
    /// How long the computed run takes, s.
    seconds: f64,
}

impl<'a> Run<'a> {
    fn new(robot: &Robot, waypoints: &'a [Waypoint], samples: &[LogSample]) -> Option<Self> {
        let tool = &waypoints.last()?.flange_from_tcp;
        let (first, last) = (samples.first()?, samples.last()?);
        let place =
            |sample: &LogSample| LoggedPoint { at: tcp(robot, &sample.motor, tool), time: sample.time - first.time };
        let path = Line::new(in_step(samples.iter().map(place).collect()));
        let length = path.length();
        if length <= 0.0 {
            return None;
        }
        let mut lengths: Vec<f64> = even([0.0, length], PLACES / 2).collect();
        let inner = &waypoints[1..waypoints.len() - 1];
        let (mut passed, mut stops) = (0.0, Vec::new());
        for waypoint in inner {
            let along = path.nearest(&waypoint.base_from_tcp.translation.vector, [passed, length]).along;
            let near = waypoint.zone.unwrap_or(0.0) + waypoint.feed * BEND_S;
            let ends = [(along - near).max(0.0), (along + near).min(length)];
            lengths.extend(even(ends, PLACES / 2 / inner.len()));
            passed = along;
            if waypoint.zone.is_none() {
                stops.push(along);
            }
        }
        lengths.sort_by(f64::total_cmp);
        let ends = stops.iter().map(|stop| lengths.partition_point(|length| length < stop)).chain([lengths.len()]);
        let mut sections: Vec<Range<usize>> = Vec::new();
        for end in ends {
            let start = sections.last().map_or(0, |section| section.end);
            sections.extend(Some(start..end).filter(|section| !section.is_empty()));
        }
        let places = lengths.into_iter().map(|length| path.at(length)).collect();
        Some(Self { waypoints, places, sections, seconds: last.time - first.time })
    }

    /// Duration of a driven path, from the first to the last point as [`Log::of_program`] finds them in a log, s.
    fn seconds_of(&self, robot: &Robot, driven: &[DrivenSample]) -> f64 {
        let samples = driven.iter().map(|sample| LogSample { time: sample.time, motor: sample.motor }).collect();
        let log = Log { file: String::new(), samples };
        let run = log.of_program(robot, self.waypoints, NEAR).unwrap_or(&log.samples);
        run.first().zip(run.last()).map_or(0.0, |(first, last)| last.time - first.time)
    }

    /// Largest share of the programmed speed that the run keeps, if it keeps none, and takes longer than with the smallest accelerations of a
    /// controller: the speed of the robot was overridden.
    fn override_share(&self, robot: &Robot) -> Result<Option<f64>, DriveError> {
        let feed = self.waypoints.iter().skip(1).map(|waypoint| waypoint.feed).fold(0.0, f64::max);
        let mut speeds: Vec<f64> = self
            .places
            .windows(2)
            .filter(|places| places[1].time > places[0].time)
            .map(|places| (places[1].at - places[0].at).norm() / (places[1].time - places[0].time))
            .collect();
        speeds.sort_by(f64::total_cmp);
        let share = speeds.get(speeds.len() * 9 / 10).map_or(1.0, |speed| speed / feed);
        if share > KEPT_SPEED {
            return Ok(None);
        }
        let slow =
            PathLaw { acceleration: SLOW, passing_acceleration: SLOW, corner_acceleration: SLOW, ..PathLaw::TYPICAL };
        let possible = self.seconds_of(robot, &drive(robot, &slow, self.waypoints)?);
        Ok((self.seconds * KEPT_SPEED > possible).then_some(share))
    }

    /// Compares the run with the path of a law, or with the programmed one.
    fn compare(&self, robot: &Robot, law: Option<&PathLaw>) -> Result<Compared, DriveError> {
        let tool = self.waypoints.last().map_or_else(deflex_robot::Pose::identity, |last| last.flange_from_tcp);
        let (path, seconds) = match law {
            Some(law) => {
                let driven = drive(robot, law, self.waypoints)?;
                let seconds = self.seconds_of(robot, &driven);
                let of =
                    |sample: &DrivenSample| LoggedPoint { at: tcp(robot, &sample.motor, &tool), time: sample.time };
                (Line::new(driven.iter().map(of)), seconds)
            }
            None => {
                let route = Route::as_programmed(robot, self.waypoints)?;
                let of = |motor: &Joints| LoggedPoint { at: tcp(robot, motor, &tool), time: 0.0 };
                (Line::new(route.knots.iter().map(|knot| of(&knot.motor))), 0.0)
            }
        };
        let mut off = Vec::with_capacity(self.places.len());
        let mut late = Vec::with_capacity(self.places.len());
        let (mut along, mut before) = (0.0, self.places[0].at);
        for place in &self.places {
            let gone = (place.at - before).norm();
            let nearest = path.nearest(&place.at, [along - REACH, along + gone + REACH]);
            (along, before) = (nearest.along, place.at);
            off.push(place.at - nearest.place.at);
            late.push(place.time - nearest.place.time);
        }
        #[allow(clippy::cast_precision_loss)]
        let mean = |times: &mut dyn ExactSizeIterator<Item = f64>| {
            let count = times.len() as f64;
            times.sum::<f64>() / count
        };
        let of_section = |section: &Range<usize>| {
            let own = section.clone();
            (mean(&mut late[own.clone()].iter().copied()), mean(&mut self.places[own].iter().map(|place| place.time)))
        };
        let means: Vec<(f64, f64)> = self.sections.iter().map(of_section).collect();
        let each =
            || self.sections.iter().zip(&means).flat_map(|(section, means)| section.clone().map(move |i| (i, means)));
        let since: Vec<f64> = each().map(|(i, (_, mean_time))| self.places[i].time - mean_time).collect();
        for (i, (mean_late, _)) in each() {
            late[i] -= mean_late;
        }
        let sum = |of: &dyn Fn(usize) -> f64| (0..since.len()).map(of).sum::<f64>();
        // The rate with the least sum of squares, its prior included.
        let clock =
            sum(&|i| since[i] * late[i]) / (sum(&|i| since[i].powi(2)) + (TIME_SIGMA / CLOCK_SIGMA / weight()).powi(2));
        late.iter_mut().zip(&since).for_each(|(late, since)| *late -= clock * since);
        let rest = |two: &[(f64, f64)]| two[1].0 - two[0].0 - clock * (two[1].1 - two[0].1);
        Ok(Compared { off, late, rests: means.windows(2).map(rest).collect(), clock, seconds })
    }
}

/// Weight of each place of a log.
#[allow(clippy::cast_precision_loss)]
fn weight() -> f64 {
    (INDEPENDENT / PLACES as f64).sqrt()
}

/// Numbers spread evenly between two, which are the first and the last.
fn even([from, to]: [f64; 2], count: usize) -> impl Iterator<Item = f64> {
    #[allow(clippy::cast_precision_loss)]
    (0..count).map(move |k| from + (to - from) * k as f64 / (count - 1).max(1) as f64)
}

/// The places without those that are farther from the line between their neighbours than an arm can accelerate. The logger read the axes
/// of such a sample at different times.
fn in_step(places: Vec<LoggedPoint>) -> Vec<LoggedPoint> {
    let aside = |around: &[LoggedPoint]| {
        let [before, here, after] = around else { return false };
        let way = after.at - before.at;
        let off = here.at - before.at;
        let along = if way.norm_squared() > 0.0 { off.dot(&way) / way.norm_squared() } else { 0.0 };
        let possible = 0.5 * MOST_ACROSS * (here.time - before.time) * (after.time - here.time);
        (off - way * along).norm() > possible + RESOLVED
    };
    let keeps: Vec<bool> = places.windows(3).map(|around| !aside(around)).collect();
    let inner = |i: usize| i.checked_sub(1).and_then(|i| keeps.get(i)).copied().unwrap_or(true);
    places.iter().enumerate().filter(|(i, _)| inner(*i)).map(|(_, place)| *place).collect()
}

/// A path through places, by its length.
struct Line {
    places: Vec<LoggedPoint>,
    /// Length up to each place, m.
    lengths: Vec<f64>,
}

/// A place on a line and the length up to it, m.
struct OnLine {
    place: LoggedPoint,
    along: f64,
}

impl Line {
    fn new(places: impl IntoIterator<Item = LoggedPoint>) -> Self {
        let mut line = Self { places: Vec::new(), lengths: Vec::new() };
        for LoggedPoint { at, time } in places {
            let length = line.places.last().map_or(0.0, |last| (at - last.at).norm());
            let before = line.lengths.last().copied().unwrap_or(0.0);
            // At rest only the time changes: the path keeps the moment at which the arm moves on.
            if length == 0.0 && line.places.len() > 1 {
                if let Some(last) = line.places.last_mut() {
                    last.time = time;
                }
                continue;
            }
            line.places.push(LoggedPoint { at, time });
            line.lengths.push(before + length);
        }
        line
    }

    fn length(&self) -> f64 {
        self.lengths.last().copied().unwrap_or(0.0)
    }

    /// The place at a length along the line.
    fn at(&self, along: f64) -> LoggedPoint {
        let after = self.lengths.partition_point(|length| *length < along).clamp(1, self.places.len() - 1);
        let (from, to) = (self.lengths[after - 1], self.lengths[after]);
        self.between(after, if to > from { ((along - from) / (to - from)).clamp(0.0, 1.0) } else { 1.0 })
    }

    fn between(&self, after: usize, share: f64) -> LoggedPoint {
        let (from, to) = (&self.places[after - 1], &self.places[after]);
        LoggedPoint { at: from.at.lerp(&to.at, share), time: from.time + (to.time - from.time) * share }
    }

    /// The place nearest to a point between two lengths.
    fn nearest(&self, point: &Vector3<f64>, [from, to]: [f64; 2]) -> OnLine {
        let first = self.lengths.partition_point(|length| *length < from).clamp(1, self.places.len() - 1);
        let mut best = (f64::INFINITY, first, 0.0);
        for after in first..self.places.len() {
            if self.lengths[after - 1] > to {
                break;
            }
            let (a, b) = (self.places[after - 1].at, self.places[after].at);
            let way = b - a;
            let square = way.norm_squared();
            let share = if square > 0.0 { ((point - a).dot(&way) / square).clamp(0.0, 1.0) } else { 0.0 };
            let distance = (point - a.lerp(&b, share)).norm_squared();
            if distance < best.0 {
                best = (distance, after, share);
            }
        }
        let (_, after, share) = best;
        let along = self.lengths[after - 1] + (self.lengths[after] - self.lengths[after - 1]) * share;
        OnLine { place: self.between(after, share), along }
    }
}

/// Most standard deviations of a number from its prior mean: a factor of 150 on [`PathLaw::TYPICAL`], beyond all controllers.
const MOST_SIGMAS: f64 = 5.0;

/// The law as numbers about zero, each over its prior's standard deviation: logarithms of factors on [`PathLaw::TYPICAL`], then
/// the numbers of the axes.
fn law_of(numbers: &DVector<f64>, of_axes: OfAxes) -> PathLaw {
    let typical = PathLaw::TYPICAL;
    let within = |i: usize, sigma: f64| (sigma * numbers[i].clamp(-MOST_SIGMAS, MOST_SIGMAS)).exp();
    let factor = |i: usize| within(i, LAW_SIGMA);
    let acceleration = typical.acceleration * factor(3);
    let passing = typical.passing_acceleration / typical.acceleration * within(PASSING, PASSING_SIGMA);
    PathLaw {
        zone_share: typical.zone_share * factor(0),
        smoothing: [typical.smoothing[0] * factor(1), typical.smoothing[1] * factor(2)],
        acceleration,
        passing_acceleration: acceleration * passing,
        corner_acceleration: typical.corner_acceleration * factor(CORNERS),
        axis_acceleration: typical.axis_acceleration,
        axis_lead: match of_axes {
            OfAxes::Lead => Joints::from_fn(|axis, _| LEAD_SIGMA * numbers[SHARED + axis]),
            OfAxes::Lag => typical.axis_lead,
        },
        lag: match of_axes {
            OfAxes::Lead => typical.lag,
            OfAxes::Lag => Joints::from_fn(|axis, _| LAG_SIGMA * numbers[SHARED + axis]),
        },
        stop: typical.stop,
    }
}

/// The law that fits better: with a lead of each axis, or with a lag. Both have the same number of parameters.
fn fit(robot: &Robot, runs: &[(usize, Run<'_>)], axis_acceleration: &Joints) -> Result<PathLaw, LogError> {
    let of = |axes: OfAxes, rests: RestsUntil| {
        let law = |numbers: &DVector<f64>| PathLaw { axis_acceleration: *axis_acceleration, ..law_of(numbers, axes) };
        fit_with(robot, runs, rests, &law)
    };
    let better = |a: (PathLaw, f64), b: (PathLaw, f64)| if b.1 < a.1 { b } else { a };
    let settled = better(of(OfAxes::Lead, RestsUntil::Settled)?, of(OfAxes::Lag, RestsUntil::Settled)?);
    let mut law = settled.0;
    if runs.iter().any(|(_, run)| run.sections.len() > 1) {
        let released = better(of(OfAxes::Lead, RestsUntil::Released)?, of(OfAxes::Lag, RestsUntil::Released)?);
        if released.1 < (1.0 - REST_GAIN) * settled.1 {
            law = PathLaw { stop: rest_at_stops(robot, runs, &released.0)?, ..released.0 };
        }
    }
    for number in law.axis_lead.iter_mut().chain(&mut law.lag).filter(|number| number.abs() < NEGLIGIBLE) {
        *number = 0.0;
    }
    Ok(law)
}

/// How much longer than its axes need the controller rests at a stop, s: the median, because a program may also wait at some stops.
fn rest_at_stops(robot: &Robot, runs: &[(usize, Run<'_>)], law: &PathLaw) -> Result<f64, LogError> {
    let compared = runs.par_iter().map(|(i, run)| {
        run.compare(robot, Some(law)).map(|compared| compared.rests).map_err(|error| LogError::Path(*i, error))
    });
    let mut rests = compared.collect::<Result<Vec<_>, _>>()?.concat();
    rests.retain(|rest| *rest < LONGEST_REST);
    rests.sort_by(f64::total_cmp);
    Ok(rests.get(rests.len() / 2).map_or(0.0, |median| median.max(0.0)))
}

/// Least squares by the method of Levenberg and Marquardt, with the prior as further rows: the law and its sum of squares.
fn fit_with(
    robot: &Robot,
    runs: &[(usize, Run<'_>)],
    rests_until: RestsUntil,
    law_of: &(impl Fn(&DVector<f64>) -> PathLaw + Sync),
) -> Result<(PathLaw, f64), LogError> {
    let residuals = |numbers: &DVector<f64>| -> Result<DVector<f64>, LogError> {
        let law = law_of(numbers);
        let all: Result<Vec<Compared>, LogError> = runs
            .par_iter()
            .map(|(i, run)| run.compare(robot, Some(&law)).map_err(|error| LogError::Path(*i, error)))
            .collect();
        let (weight, all) = (weight(), all?);
        let mut rests: Vec<f64> = all.iter().flat_map(|compared| compared.rests.iter().copied()).collect();
        rests.sort_by(f64::total_cmp);
        let usual = rests.get(rests.len() / 2).copied().unwrap_or(0.0);
        let rows = all.into_iter().flat_map(|compared| {
            let is_usual = |rest: &f64| rests_until == RestsUntil::Settled && (rest - usual).abs() < WAITS * TIME_SIGMA;
            let rests = compared.rests.iter().map(|rest| if is_usual(rest) { rest / TIME_SIGMA } else { 0.0 });
            let off =
                compared.off.into_iter().flat_map(|off| [off.x, off.y, off.z].map(|off| weight * off / PATH_SIGMA));
            // Without the rests, few places show how long the motion takes to start and to end; it is known as well as the time at any other place.
            let ends = [compared.late.first(), compared.late.last()].map(|late| match rests_until {
                RestsUntil::Settled => 0.0,
                RestsUntil::Released => late.map_or(0.0, |late| late / TIME_SIGMA),
            });
            let late = compared.late.into_iter().map(|late| weight * late / TIME_SIGMA).chain(ends);
            off.chain(late).chain(rests).chain([compared.clock / CLOCK_SIGMA]).collect::<Vec<_>>()
        });
        Ok(DVector::from_vec(rows.chain(numbers.iter().copied()).collect()))
    };
    /// Dampings that are tried, each eight times the one before. The last one shortens the first step to less than a ten-thousandth.
    const DAMPINGS: usize = 10;
    // Both averages begin with a width of their own: with equal widths, the two could not be distinguished.
    let mut numbers = DVector::zeros(NUMBERS);
    (numbers[1], numbers[2]) = (0.1, -0.1);
    // Corners begin with a limit that acts in most logs: one that does not act has no derivative.
    numbers[CORNERS] = -1.0;
    let mut here = residuals(&numbers)?;
    let mut damping = 1e-3;
    for _ in 0..ROUNDS {
        let columns: Result<Vec<DVector<f64>>, LogError> = (0..NUMBERS)
            .map(|i| {
                let mut moved = numbers.clone();
                moved[i] += DIFFERENCE;
                Ok((residuals(&moved)? - &here) / DIFFERENCE)
            })
            .collect();
        let jacobian = DMatrix::from_columns(&columns?);
        let (normal, gradient) = (jacobian.tr_mul(&jacobian), jacobian.tr_mul(&here));
        let mut gained = 0.0;
        for _ in 0..DAMPINGS {
            let mut damped = normal.clone();
            for i in 0..NUMBERS {
                damped[(i, i)] *= 1.0 + damping;
            }
            let Some(step) = damped.cholesky().map(|factor| factor.solve(&gradient)) else { break };
            let next = &numbers - step;
            let there = residuals(&next)?;
            if there.norm_squared() < here.norm_squared() {
                gained = 1.0 - there.norm_squared() / here.norm_squared();
                (numbers, here) = (next, there);
                damping = f64::max(0.2 * damping, 1e-9);
                break;
            }
            damping *= 8.0;
        }
        if gained < ENOUGH {
            break;
        }
    }
    Ok((law_of(&numbers), here.norm_squared()))
}

#[cfg(test)]
mod tests {
    use super::{FittedLaw, LoggedPoint, PathError, PathLaw, RunTime, Vector3, in_step};

    #[test]
    fn a_law_that_chance_explains_is_not_for_use() {
        let error_share = |held_out_logs: usize, share: f64| {
            let [before, after] = [0.3, 0.3 * share].map(|rms_mm| PathError { rms_mm, max_mm: 1.0 });
            let (law, run_time_s) = (PathLaw::TYPICAL, RunTime::default());
            FittedLaw {
                law,
                arc_turn: None,
                assumed_zone: None,
                fitted_logs: 3,
                held_out_logs,
                before,
                after,
                run_time_s,
            }
            .error_share()
        };
        // 40 numbers of a log: the rms is uncertain by 1/√80 of itself, 11 %.
        assert_eq!(error_share(1, 0.79), None);
        assert!(error_share(1, 0.76).is_some_and(|share| (share - 0.76).abs() < 1e-9));
        assert_eq!(error_share(10, 0.95), None);
        assert!(error_share(10, 0.9).is_some());
    }

    /// At 300 mm/s a place every 8 ms; the arm bends its path by 0.64 mm there at most.
    #[test]
    fn a_sample_of_axes_that_were_read_at_different_times_is_left_out() {
        let along = |y: f64| {
            let at = |k: u32| Vector3::new(2.4e-3 * f64::from(k), if k == 2 { y } else { 0.0 }, 0.0);
            (0..5).map(|k| LoggedPoint { at: at(k), time: 8e-3 * f64::from(k) }).collect::<Vec<_>>()
        };
        let times = |places: Vec<LoggedPoint>| in_step(places).iter().map(|place| place.time).collect::<Vec<_>>();
        assert_eq!(times(along(6e-4)).len(), 5);
        assert_eq!(times(along(1e-3)), [0.0, 8e-3, 24e-3, 32e-3]);
    }
}
