//! The path that the controller drives.
//!
//! A controller does not move the TCP exactly along the programmed path. It rounds each corner within the zone, slows down where
//! the direction changes faster than the axes can follow, and smooths the axis commands over time. The faster it moves, the more
//! it cuts a bend. [`drive`] computes that path from the programmed one in four steps:
//!
//! 1. *Route*: the programmed lines and arcs, with a parabola over each corner that is passed in a zone ([`PathLaw::zone_share`]).
//! 2. *Speed*: the largest speed along the route that keeps the programmed feed, the acceleration along the path, the
//!    acceleration across corners and bends, and the acceleration of each axis.
//! 3. *Smoothing*: two moving averages of the motor angles over time ([`PathLaw::smoothing`]).
//! 4. *Axes*: each motor leads its axis by a share of the acceleration ([`PathLaw::axis_lead`]), and trails its command by a time
//!    of its own ([`PathLaw::lag`]).
//!
//! The path does not include the deflection of the arm: it consists of the motor angles that the controller's own signals show.
//!
//! The law describes the joint logs of an IRB 6640 and of its virtual controller (`hehonglu123/ABB_Primitive_Study`); docs/driven-path.md
//! says how well.

mod distance;
mod envelope;
mod fit;
mod log;
mod route;
mod shape;
mod smoothing;
mod speed;
mod track;

#[cfg(test)]
mod tests;

pub use deflex_program::ArcTurn;
pub use distance::{Offset, ProgrammedPath, nearest_between};
pub use fit::{FittedLaw, LogError, PathError, RunTime, WayOfTurning, arc_turn, fit_law};
pub use log::{Log, LogSample};
pub use shape::{CommandedMotion, Freedom, ShapedCommand, Wanted, shape};
pub use track::Track;

use deflex_robot::{Joints, Pose, Robot};
use route::Router;
use smoothing::Timeline;
use speed::Clock;

/// Time between two samples of a driven path, s: the interpolation period of an ABB controller.
pub const SAMPLE_S: f64 = 0.004;

/// Largest rate of a reorientation, rad/s: `v_ori` of every predefined speed of RAPID (500 °/s).
const REORIENTATION_RAD_S: f64 = 500.0 * std::f64::consts::PI / 180.0;

/// How a controller leads the axes along a programmed path: `[controller.path]` of the cell.
///
/// # Examples
/// ```
/// use deflex_drive::PathLaw;
///
/// let slow = PathLaw { acceleration: 1.0, ..PathLaw::TYPICAL }; // m/s²
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathLaw {
    /// Share of the programmed zone's radius within which a corner is rounded.
    pub zone_share: f64,
    /// Widths of the two moving averages over time, s.
    pub smoothing: [f64; 2],
    /// Angle by which each motor leads its axis for each unit of the axis's acceleration, s²: inertia over stiffness. Controllers twist
    /// the gears ahead of the torque that accelerates the arm. The motors therefore leave the path where the motion speeds up or slows
    /// down.
    pub axis_lead: Joints,
    /// Largest acceleration along the path from and to a stop, m/s².
    pub acceleration: f64,
    /// Largest acceleration along the path before and after a corner that is passed, m/s². An IRB 6640 slows down for a corner about twice as
    /// fast as for a stop (docs/driven-path.md).
    pub passing_acceleration: f64,
    /// Largest acceleration across the path, in corners and bends, m/s².
    pub corner_acceleration: f64,
    /// Largest acceleration of each motor angle, rad/s².
    pub axis_acceleration: Joints,
    /// Time by which each axis trails its command, s. The part that all axes have in common delays the motion without
    /// changing its path.
    pub lag: Joints,
    /// Time for which the controller rests at a stop after the axes have come to rest, s.
    pub stop: f64,
}

impl PathLaw {
    /// Start of a search for the law of a controller: roughly the law of an IRB 6640 (IRC5).
    pub const TYPICAL: Self = Self {
        zone_share: 0.87,
        smoothing: [0.058, 0.058],
        axis_lead: Joints::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        acceleration: 8.0,
        passing_acceleration: 16.0,
        corner_acceleration: 7.0,
        axis_acceleration: UNLIMITED,
        lag: Joints::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        stop: 0.0,
    };

    /// A controller without inertia, which drives corners as they are written.
    #[doc(hidden)]
    pub const AS_WRITTEN: Self = Self {
        zone_share: 0.0,
        smoothing: [0.0; 2],
        axis_lead: Joints::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        acceleration: f64::INFINITY,
        passing_acceleration: f64::INFINITY,
        corner_acceleration: f64::INFINITY,
        axis_acceleration: UNLIMITED,
        lag: Joints::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        stop: 0.0,
    };

    /// Time for which the controller still moves the axes after its path has ended, s.
    #[must_use]
    pub(crate) fn settling(&self) -> f64 {
        self.smoothing[0] + self.smoothing[1]
    }

    /// Time for which the route rests at a knot where it stops, s.
    fn rest_at(&self, knot: &route::Knot) -> Option<f64> {
        knot.stop.map(|wait| self.settling() + self.stop + wait)
    }

    /// Standard deviation in time over which the two moving averages spread a command, s.
    fn spread(&self) -> f64 {
        // The variance of a uniform distribution of width w is w²/12.
        ((self.smoothing[0].powi(2) + self.smoothing[1].powi(2)) / 12.0).sqrt()
    }

    /// Largest speed (m/s) at which the route may pass a corner with a rounding of a radius (m).
    fn corner_speed(&self, corner: &Turn, radius: f64) -> f64 {
        // At an even speed, a parabola bends most in its middle: with a turn of 2 sin h it does so there by 1/cos² h more than if the
        // direction changed evenly over time.
        let radius = radius * (1.0 - 0.25 * corner.tcp * corner.tcp).max(0.0);
        let axes = corner.axes.iter().zip(&self.axis_acceleration);
        let limits = axes.map(|(turn, most)| turning_speed(turn.abs(), *most, radius));
        limits.fold(turning_speed(corner.tcp, self.corner_acceleration, radius), f64::min)
    }

    /// Whether the acceleration of any axis has a limit.
    #[must_use]
    #[doc(hidden)]
    pub fn limits_axes(&self) -> bool {
        self.axis_acceleration.iter().any(|limit| limit.is_finite())
    }
}

/// Largest speed (m/s) at which a quantity keeps its largest acceleration in a corner with a rounding of a radius (m), for the change there of
/// its derivative by the length of the route. The change of its rate, `turn · v`, takes the time of the rounding, `2 r / v`.
fn turning_speed(turn: f64, acceleration: f64, radius: f64) -> f64 {
    if turn <= 0.0 || acceleration.is_infinite() {
        return f64::INFINITY;
    }
    (2.0 * acceleration * radius / turn).sqrt()
}

/// No limit of any axis.
const UNLIMITED: Joints =
    Joints::new(f64::INFINITY, f64::INFINITY, f64::INFINITY, f64::INFINITY, f64::INFINITY, f64::INFINITY);

/// How a route turns at a corner.
#[derive(Clone, Copy, Debug, Default)]
struct Turn {
    /// Length of the change of the TCP's unit direction.
    tcp: f64,
    /// Change of each motor angle's derivative by the length of the route, rad/m.
    axes: Joints,
}

/// The kind of a motion.
///
/// # Examples
/// ```
/// use deflex_drive::Lead;
/// use deflex_program::ArcTurn;
/// use deflex_robot::Pose;
///
/// let arc = Lead::Arc { via: Pose::identity(), turn: ArcTurn::WithPath };
/// ```
#[derive(Clone, Copy, Debug)]
pub enum Lead {
    /// On a straight line.
    Line,
    /// On an arc.
    Arc {
        /// The circle point: a pose of the TCP, base frame, m.
        via: Pose,
        /// How the tool turns on the way.
        turn: ArcTurn,
    },
    /// All axes change evenly.
    Joints,
}

/// The end of one programmed motion.
///
/// # Examples
/// ```
/// # let robot = deflex_robot::Builtin::named("irb6660-205-1.9").expect("a built-in robot").robot();
/// use deflex_drive::{Lead, Waypoint};
/// use deflex_robot::Pose;
///
/// let motor = robot.motor_from_axes_deg(&[0.0, 0.0, 0.0, 0.0, 30.0, 0.0]);
/// let (base_from_tcp, flange_from_tcp) = (robot.forward(&motor), Pose::identity());
/// // The end of a line that is driven with 0.1 m/s, at which the arm comes to rest.
/// let end = Waypoint { lead: Lead::Line, base_from_tcp, flange_from_tcp, motor, feed: 0.1, zone: None, wait: 0.0 };
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Waypoint {
    /// The kind of the motion to it.
    pub lead: Lead,
    /// Pose of the TCP in the robot's base, m.
    pub base_from_tcp: Pose,
    /// The TCP in the flange, m.
    pub flange_from_tcp: Pose,
    /// Motor angles there, rad.
    pub motor: Joints,
    /// Programmed speed of the TCP on the segment to it, m/s.
    pub feed: f64,
    /// Radius of the zone in which the controller passes the point, m; `None` if the arm comes to rest there.
    pub zone: Option<f64>,
    /// Time for which the program waits where the arm comes to rest, s; without effect in a zone.
    pub wait: f64,
}

impl Waypoint {
    /// The TCP of the next motion where the arm stands here, base frame, m.
    fn start_of(&self, robot: &Robot, next: &Self) -> Pose {
        if self.flange_from_tcp == next.flange_from_tcp {
            return self.base_from_tcp;
        }
        robot.forward(&self.motor) * next.flange_from_tcp
    }
}

/// One moment of a driven path.
///
/// # Examples
/// ```
/// use deflex_drive::DrivenSample;
///
/// /// The duration of a path, s.
/// fn duration(samples: &[DrivenSample]) -> f64 {
///     samples.last().map_or(0.0, |sample| sample.time)
/// }
/// assert_eq!(duration(&[]), 0.0);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct DrivenSample {
    /// Time since the start of the first motion, s.
    pub time: f64,
    /// Motor angles, rad.
    pub motor: Joints,
    /// Index of the waypoint at the end of the segment.
    pub waypoint: usize,
    /// Share of the segment that is covered.
    pub share: f64,
}

/// Why a path cannot be computed.
///
/// # Examples
/// ```
/// use deflex_drive::DriveError;
///
/// /// The sentence for a path that cannot be computed.
/// fn sentence(error: DriveError) -> String {
///     match error {
///         DriveError::Unreachable { waypoint } => format!("the arm does not reach the segment to waypoint {waypoint}"),
///         DriveError::TooLong => "the motions take more than a day".to_owned(),
///     }
/// }
/// assert!(sentence(DriveError::Unreachable { waypoint: 3 }).ends_with("waypoint 3"));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveError {
    /// The arm does not reach a point of the segment to this waypoint.
    Unreachable {
        /// Its index.
        waypoint: usize,
    },
    /// The motions take longer than [`LONGEST_S`].
    TooLong,
}

/// Longest motion that is sampled, s: a day, 21.6 million samples.
pub const LONGEST_S: f64 = 86_400.0;

/// The path that a controller drives along waypoints, sampled every [`SAMPLE_S`]; it starts and ends at rest.
///
/// # Errors
/// A point of the path is out of reach, or the path is too long to be sampled.
///
/// # Examples
/// ```
/// # use deflex_drive::{Lead, PathLaw, Waypoint, drive};
/// # use deflex_robot::{Builtin, Pose};
/// let robot = Builtin::named("irb6660-205-1.9").expect("a built-in robot").robot();
/// let waypoint = |axis_1: f64| {
///     let motor = robot.motor_from_axes_deg(&[axis_1, 0.0, 0.0, 0.0, 30.0, 0.0]);
///     let (base_from_tcp, flange_from_tcp) = (robot.forward(&motor), Pose::identity());
///     Waypoint { lead: Lead::Line, base_from_tcp, flange_from_tcp, motor, feed: 0.1, zone: None, wait: 0.0 }
/// };
/// let samples = drive(&robot, &PathLaw::TYPICAL, &[waypoint(0.0), waypoint(2.0)]).expect("within reach");
/// println!("{:.2} s", samples.last().map_or(0.0, |sample| sample.time));
/// ```
pub fn drive(robot: &Robot, law: &PathLaw, waypoints: &[Waypoint]) -> Result<Vec<DrivenSample>, DriveError> {
    let mut driver = Driver::new(robot, law);
    waypoints.iter().try_for_each(|waypoint| driver.add(waypoint))?;
    driver.end()?;
    Ok(driver.samples())
}

/// Drives along waypoints that come one after the other. It keeps only what further samples need: the route of the time over which the law
/// smooths, and up to where the motion could brake to rest.
#[derive(Clone, Debug)]
#[doc(hidden)]
pub struct Driver<'r> {
    router: Router<'r>,
    clock: Clock,
    timeline: Timeline,
}

impl<'r> Driver<'r> {
    pub fn new(robot: &'r Robot, law: &PathLaw) -> Self {
        Self { router: Router::new(robot, law), clock: Clock::new(law), timeline: Timeline::new(law) }
    }

    /// Adds the next waypoint.
    ///
    /// # Errors
    /// As [`drive`].
    pub fn add(&mut self, waypoint: &Waypoint) -> Result<(), DriveError> {
        self.router.add(waypoint)
    }

    /// Computes the times of the route, as far as they are known.
    fn time(&mut self) -> Result<(), DriveError> {
        let Self { router, clock, timeline } = self;
        clock.add(router.known(), &mut |knot, time| timeline.add(knot, time))
    }

    /// Ends at the last waypoint.
    ///
    /// # Errors
    /// As [`drive`].
    pub fn end(&mut self) -> Result<(), DriveError> {
        let Self { router, clock, timeline } = self;
        router.end()?;
        clock.end(router.knots.drain(..), &mut |knot, time| timeline.add(knot, time))?;
        timeline.end();
        Ok(())
    }

    /// All samples, after the end.
    pub fn samples(&self) -> Vec<DrivenSample> {
        self.timeline.samples()
    }

    /// Chooses further samples: see [`Timeline::choose`].
    pub fn choose(&mut self, longest: &dyn Fn(usize, usize) -> f64) -> Result<Vec<Vec<usize>>, DriveError> {
        self.time()?;
        Ok(self.timeline.choose(longest))
    }

    /// The samples at periods that were chosen together.
    pub fn samples_at(&self, periods: &[usize]) -> Vec<DrivenSample> {
        self.timeline.samples_at(periods)
    }

    /// The waypoint at the end of the first segment that further samples need.
    pub fn waypoint(&self) -> usize {
        self.timeline.waypoint()
    }

    /// Forgets what only the samples so far needed.
    pub fn forget(&mut self) {
        self.timeline.forget();
    }
}
