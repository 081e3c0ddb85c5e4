use crate::lanes::{Mask, Vector, WIDTH};
use crate::robot::{Frames, Joints, Pose, Robot};
use nalgebra::{Rotation3, Vector3};
use std::fmt;

/// A tool as the equilibrium sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToolFrame {
    /// TCP in the flange frame, m.
    pub flange_from_tcp: Pose,
    /// Mass, kg; acts through a `gravity` effect only.
    pub mass: f64,
    /// Centre of gravity in the flange frame, m.
    pub cog: Vector3<f64>,
}

/// A law that gives the mean cutting force from where the cutter really is.
pub trait ForceLaw: Sync {
    /// Force on the tool, N, feed frame. `shift` is the tip's, m, feed frame, actual minus wanted; `axis` the
    /// actual tool axis (tip to spindle), unit, feed frame.
    fn force(&self, shift: &Vector3<f64>, axis: &Vector3<f64>) -> Vector3<f64>;

    /// The same at those of eight places that are wanted.
    #[doc(hidden)]
    fn forces(&self, wanted: Mask, shift: &Vector, axis: &Vector, force: &mut Vector) {
        for lane in (0..WIDTH).filter(|lane| wanted.lane(*lane)) {
            force.set(lane, &self.force(&shift.lane(lane), &axis.lane(lane)));
        }
    }

    /// What a lift of the tip along the surface normal adds to the force at the wanted pose, N/m, feed frame, about: a guess
    /// at how the force feeds back. Zero where nothing is known.
    fn slope(&self) -> Vector3<f64> {
        Vector3::zeros()
    }

    /// Force at the wanted pose of a tool that leans against the surface as the law has it, N, feed frame; `None` where it
    /// has no lean of its own.
    fn rest(&self) -> Option<Vector3<f64>> {
        None
    }
}

/// The cut at one target.
#[derive(Clone, Copy)]
pub enum Cutting<'a> {
    /// No cutting force.
    Air,
    /// A given force on the tool, N, work object axes.
    Constant(Vector3<f64>),
    /// A force that depends on the deflected pose.
    Law {
        /// The law.
        law: &'a dyn ForceLaw,
        /// Feed frame (x feed, z surface normal) in the work object.
        wobj_from_feed: Rotation3<f64>,
    },
}

impl fmt::Debug for Cutting<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Air => f.write_str("Air"),
            Self::Constant(force) => write!(f, "Constant({force:?})"),
            Self::Law { .. } => f.write_str("Law"),
        }
    }
}

/// What is known of one target before its equilibrium is solved.
#[derive(Clone, Copy, Debug)]
pub struct Situation<'a> {
    /// Declared work object, m.
    pub base_from_wobj: Pose,
    /// Where the TCP should be: defines depth and force, and errors are counted from it, m.
    pub wobj_from_tcp: Pose,
    /// Declared tool.
    pub tool: ToolFrame,
    /// The cut.
    pub cutting: Cutting<'a>,
    /// Surface normal, out of the material, unit, work object axes.
    pub normal: Vector3<f64>,
    /// Programmed velocity of the TCP, m/s, work object axes; zero where unknown.
    pub velocity: Vector3<f64>,
    /// Length cut so far, m.
    pub cut_length: f64,
    /// Time since the start from cold, s.
    pub time: f64,
    /// Temperature, °C, where measured.
    pub temperature: Option<f64>,
    /// Payload besides the tool, kg.
    pub payload: f64,
}

/// A force and a moment about the base origin, base axes, N and N·m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wrench {
    /// Force, N.
    pub force: Vector3<f64>,
    /// Moment about the base origin, N·m.
    pub moment: Vector3<f64>,
}

impl Default for Wrench {
    fn default() -> Self {
        Self { force: Vector3::zeros(), moment: Vector3::zeros() }
    }
}

impl Wrench {
    /// Adds a force (N) acting at a point (m), both in the base frame.
    pub fn add_force(&mut self, force: &Vector3<f64>, point: &Vector3<f64>) {
        self.force += force;
        self.moment += point.cross(force);
    }
}

/// All loads on the arm at one target.
#[derive(Clone, Debug, Default)]
pub struct Load {
    /// Cutting force on the tool at the TCP, base axes, N.
    pub cut: Vector3<f64>,
    /// Weights on links 1 to 6 (tool and payload on link 6).
    pub links: [Wrench; 6],
    /// Torques that cut and weights put on the motors, N·m, in motor coordinates (τ = Jᵀ F). Filled in after
    /// every effect's [`load`](super::Effect::load).
    pub torque: Joints,
}

impl Load {
    /// Everything that acts on link `first` (0 to 5) and beyond, about the base origin.
    #[must_use]
    pub fn beyond(&self, first: usize, tcp: &Vector3<f64>) -> Wrench {
        let mut sum = Wrench::default();
        sum.add_force(&self.cut, tcp);
        for link in &self.links[first..] {
            sum.force += link.force;
            sum.moment += link.moment;
        }
        sum
    }

    /// Fills in the motor torques: each joint carries what acts beyond it, about its own axis.
    pub(crate) fn fill_torque(&mut self, robot: &Robot, frames: &Frames, tcp: &Vector3<f64>) {
        let mut serial = Joints::zeros();
        let mut sum = Wrench::default();
        sum.add_force(&self.cut, tcp);
        for i in (0..6).rev() {
            sum.force += self.links[i].force;
            sum.moment += self.links[i].moment;
            serial[i] = frames.axis(i).dot(&(sum.moment - frames.origin(i).cross(&sum.force)));
        }
        self.torque = robot.motor_torque_from_serial(&serial);
    }
}

/// The arm's state at one target: what an effect may depend on.
#[derive(Clone, Copy, Debug)]
pub struct State<'a> {
    /// The nominal robot.
    pub robot: &'a Robot,
    /// Declared joint stiffness, N·m/rad at the motors, where the cell has one.
    pub stiffness: Option<&'a Joints>,
    /// Commanded motor angles, rad.
    pub motor_commanded: &'a Joints,
    /// Actual motor angles, rad.
    pub motor: &'a Joints,
    /// Actual frames of the links in the base.
    pub frames: &'a Frames,
    /// Actual TCP in the base, m.
    pub base_from_tcp: &'a Pose,
    /// Gravity, base axes, m/s².
    pub gravity: Vector3<f64>,
    /// The target's circumstances.
    pub situation: &'a Situation<'a>,
}
