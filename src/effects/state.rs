use crate::lanes::{LaneMask, Mask, Vector, WIDTH};
use crate::robot::Pose;
use nalgebra::{DMatrix, Matrix3, Rotation3, Vector3};
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
    fn forces(&self, wanted: LaneMask, shift: &Vector, axis: &Vector, force: &mut Vector) {
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
    /// Gravity where the base stands, base axes, m/s²: see [`Robot::gravity`](crate::robot::Robot::gravity).
    pub gravity: Vector3<f64>,
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
    /// The cell's mechanical units, where there are any.
    pub units: &'a [UnitAt],
    /// How the clamped part yields where it is cut; where `[part.material]` makes it known.
    pub part: Option<PartAt<'a>>,
}

/// How a clamped part yields at a place where it is cut.
#[derive(Clone, Debug, PartialEq)]
pub struct PartYield {
    /// Compliance with the clamps as declared, m/N: the place's shift by axis (rows) under a force by axis (columns).
    pub compliance: Matrix3<f64>,
    /// The place's shift, m, under a motion of 1 m of a clamp along an axis of the stock: number 3·clamp + axis. Empty where the
    /// part has more than [`MOST_CLAMPS`].
    pub motions: Vec<Vector3<f64>>,
    /// Forces that such motions take at the clamps, N/m, rows and columns by motion.
    pub stiffness: DMatrix<f64>,
}

/// The effect of clamps that give way is for parts with no more clamps than this.
pub const MOST_CLAMPS: usize = 4;

impl PartYield {
    /// A part whose clamps hold as declared.
    #[must_use]
    pub fn held_as_declared(compliance: Matrix3<f64>) -> Self {
        Self { compliance, motions: Vec::new(), stiffness: DMatrix::zeros(0, 0) }
    }

    /// How many clamps it has, where it is known how it yields with them.
    pub(crate) fn clamps(&self) -> usize {
        self.motions.len() / 3
    }

    /// A mixture by shares. All have the same clamps.
    pub(crate) fn mixed<'a>(parts: impl IntoIterator<Item = (&'a Self, f64)>) -> Self {
        let mut sum = Self::held_as_declared(Matrix3::zeros());
        for (part, share) in parts {
            sum.compliance += part.compliance * share;
            sum.motions.resize(part.motions.len(), Vector3::zeros());
            sum.motions.iter_mut().zip(&part.motions).for_each(|(sum, motion)| *sum += motion * share);
            sum.stiffness.resize_mut(part.stiffness.nrows(), part.stiffness.ncols(), 0.0);
            sum.stiffness += &part.stiffness * share;
        }
        sum
    }

    /// The same in other axes.
    pub(crate) fn turned(self, rotation: &Rotation3<f64>) -> Self {
        Self {
            compliance: rotation.matrix() * self.compliance * rotation.matrix().transpose(),
            motions: self.motions.iter().map(|motion| rotation * motion).collect(),
            stiffness: self.stiffness,
        }
    }
}

/// A [`PartYield`], and its axes in the work object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PartAt<'a> {
    /// How it yields.
    pub yields: &'a PartYield,
    /// Work object axes from its axes.
    pub wobj_from_part: Rotation3<f64>,
}

impl<'a> PartAt<'a> {
    /// Of what is in work object axes already.
    #[must_use]
    pub fn in_wobj(yields: &'a PartYield) -> Self {
        Self { yields, wobj_from_part: Rotation3::identity() }
    }
}

/// A mechanical unit at a target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnitAt {
    pub(crate) key: u64,
    /// Its frame at zero, in what it stands on there, in the declared work object, m.
    pub wobj_from_unit: Pose,
    /// Whether the work object is on it, and the robot is not.
    pub part: bool,
    /// Whether the robot is on it, and the work object is not.
    pub robot: bool,
}

impl UnitAt {
    /// A unit by its name, whatever the case.
    #[must_use]
    pub fn new(name: &str, wobj_from_unit: Pose, part: bool, robot: bool) -> Self {
        Self { key: unit_key(name), wobj_from_unit, part, robot }
    }
}

/// A unit's name as a number, whatever the case (FNV-1a).
pub(crate) fn unit_key(name: &str) -> u64 {
    let byte = |key: u64, byte: u8| (key ^ u64::from(byte.to_ascii_uppercase())).wrapping_mul(0x0100_0000_01b3);
    name.bytes().fold(0xcbf2_9ce4_8422_2325, byte)
}
