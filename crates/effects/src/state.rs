use deflex_lanes::{LaneMask, Mask, Vector, WIDTH};
use deflex_robot::{Joints, Pose, gravity_at};
use nalgebra::{DMatrix, Matrix3, Rotation3, Vector3};
use std::fmt;

/// The geometry and mass of a tool.
///
/// # Examples
/// ```
/// use deflex_effects::ToolFrame;
/// use nalgebra::Vector3;
/// use deflex_robot::Pose;
///
/// // A tool of 18 kg whose TCP is in the flange.
/// let tool = ToolFrame { flange_from_tcp: Pose::identity(), mass: 18.0, cog: Vector3::new(0.0, 0.0, 0.1) };
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToolFrame {
    /// TCP in the flange frame, m.
    pub flange_from_tcp: Pose,
    /// Mass, kg. It has no weight unless the cell has a `gravity` effect.
    pub mass: f64,
    /// Centre of gravity in the flange frame, m.
    pub cog: Vector3<f64>,
}

/// A law of the mean cutting force, which depends on the actual pose of the cutter.
///
/// # Examples
/// ```
/// use deflex_effects::ForceLaw;
/// use nalgebra::Vector3;
///
/// /// A spring between the tool and the surface, N/m.
/// struct Spring(f64);
/// impl ForceLaw for Spring {
///     fn force(&self, shift: &Vector3<f64>, _: &Vector3<f64>) -> Vector3<f64> {
///         Vector3::z() * (-self.0 * shift.z)
///     }
/// }
/// assert_eq!(Spring(1e5).force(&Vector3::new(0.0, 0.0, -1e-3), &Vector3::z()).z, 100.0); // N
/// ```
pub trait ForceLaw: Sync {
    /// The force on the tool, N, feed frame. `shift` is the actual minus the wanted position of the tip, m, feed frame; `axis` is the
    /// actual direction of the tool axis from tip to spindle, a unit vector in the feed frame.
    fn force(&self, shift: &Vector3<f64>, axis: &Vector3<f64>) -> Vector3<f64>;

    /// [`ForceLaw::force`] for those of eight poses whose lane is set in `wanted`.
    #[doc(hidden)]
    fn forces(&self, wanted: LaneMask, shift: &Vector, axis: &Vector, force: &mut Vector) {
        for lane in (0..WIDTH).filter(|lane| wanted.lane(*lane)) {
            force.set(lane, &self.force(&shift.lane(lane), &axis.lane(lane)));
        }
    }

    /// An estimate of the derivative of the force with respect to a lift of the tip along the surface normal, N/m, feed frame, at the
    /// wanted pose. The solver starts from it; zero if no estimate is known.
    fn slope(&self) -> Vector3<f64> {
        Vector3::zeros()
    }

    /// The force at the wanted pose if the tool leans by the angles of the law itself, N, feed frame; `None` if the law has no such
    /// angles.
    fn rest(&self) -> Option<Vector3<f64>> {
        None
    }
}

/// The cut at one target.
///
/// # Examples
/// ```
/// use deflex_effects::Cutting;
///
/// fn words(cutting: &Cutting<'_>) -> String {
///     match cutting {
///         Cutting::Air => "no force".to_owned(),
///         Cutting::Constant(force) => format!("{:.0} N", force.norm()),
///         Cutting::Law { .. } => "a force that depends on the pose of the cutter".to_owned(),
///     }
/// }
/// assert_eq!(words(&Cutting::Constant([0.0, 30.0, 40.0].into())), "50 N");
/// ```
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

/// The inputs of the equilibrium at one target.
///
/// # Examples
/// ```
/// use deflex_effects::{Cutting, Situation, ToolFrame};
/// use deflex_robot::{gravity_at, Builtin, Pose};
///
/// let robot = Builtin::named("irb6660-205-1.9").expect("a built-in robot").robot();
/// let tool = ToolFrame { flange_from_tcp: Pose::translation(0.0, 0.0, 0.3), mass: 18.0, cog: [0.0, 0.0, 0.1].into() };
/// // 300 N across the spindle, in the home posture; the work object is the base frame.
/// let motor = robot.motor_from_axes_deg(&robot.home_deg());
/// let situation = Situation {
///     cutting: Cutting::Constant([0.0, 300.0, 0.0].into()),
///     ..Situation::in_air(tool, robot.forward(&motor) * tool.flange_from_tcp)
/// };
/// assert_eq!(situation.payload, 0.0);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Situation<'a> {
    /// Declared work object, m.
    pub base_from_wobj: Pose,
    /// Gravity where the base stands, base axes, m/s²: see [`Robot::gravity`](deflex_robot::Robot::gravity).
    pub gravity: Vector3<f64>,
    /// The wanted pose of the TCP, m. Depth and force are defined at it, and errors are counted from it.
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
    /// Temperature, °C; `None` if it was not measured.
    pub temperature: Option<f64>,
    /// Payload in addition to the tool, kg.
    pub payload: f64,
    /// The mechanical units of the cell; empty if it has none.
    pub units: &'a [UnitAt],
    /// The compliance of the clamped part where it is cut; `None` without `[part.material]`.
    pub part: Option<PartAt<'a>>,
    /// Torques of this and earlier cutting forces, for effects that follow the forces along a program; `None` where there were none.
    pub torque: Option<&'a CuttingTorque>,
}

impl Situation<'static> {
    /// A tool in the air, at rest and before anything was cut: the robot stands on the floor, and the work object is its base frame.
    #[must_use]
    pub fn in_air(tool: ToolFrame, base_from_tcp: Pose) -> Self {
        Self {
            base_from_wobj: Pose::identity(),
            gravity: gravity_at(&Pose::identity()),
            wobj_from_tcp: base_from_tcp,
            tool,
            cutting: Cutting::Air,
            normal: Vector3::z(),
            velocity: Vector3::zeros(),
            cut_length: 0.0,
            time: 0.0,
            temperature: None,
            payload: 0.0,
            units: &[],
            part: None,
            torque: None,
        }
    }
}

impl Situation<'_> {
    /// The cutting force on the tool in the wanted pose, N, work object axes.
    #[doc(hidden)]
    pub fn cutting_force(&self) -> Vector3<f64> {
        match self.cutting {
            Cutting::Air => Vector3::zeros(),
            Cutting::Constant(force) => force,
            Cutting::Law { law, wobj_from_feed } => {
                let axis = wobj_from_feed.inverse() * (self.wobj_from_tcp.rotation * -Vector3::z());
                wobj_from_feed * law.force(&Vector3::zeros(), &axis)
            }
        }
    }
}

/// Times after which gears that creep follow a torque, s: one to a factor of three, from the time of a motion to that of a program.
pub(crate) const CREEP_TIMES_S: [f64; 4] = [5.0, 15.0, 45.0, 135.0];

/// What the cutting force at a target, and the forces before it, do to the gears.
///
/// # Examples
/// ```
/// use deflex_effects::CuttingTorque;
/// use deflex_robot::Joints;
///
/// // After a long time, the gears have followed the torque.
/// let torque = CuttingTorque::default().after(&Joints::repeat(100.0), Joints::zeros(), 1e6);
/// assert!((torque.delayed_nm[2][0] - 100.0).abs() < 1e-9); // N·m
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CuttingTorque {
    /// Twist of the gears under the force at the target, by their declared stiffness, rad.
    pub twist_rad: Joints,
    /// Torques of the forces at the motors, each delayed by a lag of the first order, N·m: with a lag of 5 s, of 15 s, of 45 s and of 135 s.
    pub delayed_nm: [Joints; CREEP_TIMES_S.len()],
}

impl CuttingTorque {
    /// The same after a torque (N·m) has acted for some seconds and has twisted the gears by an angle, rad.
    #[must_use]
    pub fn after(&self, torque_nm: &Joints, twist_rad: Joints, seconds: f64) -> Self {
        let one = |n: usize| torque_nm + (self.delayed_nm[n] - torque_nm) * (-seconds / CREEP_TIMES_S[n]).exp();
        Self { twist_rad, delayed_nm: std::array::from_fn(one) }
    }

    /// The same at a share of the way from one target to the next.
    #[doc(hidden)]
    pub fn lerp(&self, to: &Self, share: f64) -> Self {
        Self {
            twist_rad: self.twist_rad.lerp(&to.twist_rad, share),
            delayed_nm: std::array::from_fn(|n| self.delayed_nm[n].lerp(&to.delayed_nm[n], share)),
        }
    }
}

/// The compliance of a clamped part at the place where it is cut.
///
/// # Examples
/// ```
/// use deflex_effects::PartYield;
/// use nalgebra::{DMatrix, Matrix3};
///
/// // A wall that yields by 1 µm/N along y, with rigid clamps.
/// let wall = PartYield {
///     compliance: Matrix3::from_diagonal(&[0.0, 1e-6, 0.0].into()),
///     motions: vec![],
///     stiffness: DMatrix::zeros(0, 0),
/// };
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct PartYield {
    /// Compliance with the clamps as declared, m/N: shift of the place along each axis (rows) under a unit force along each (columns).
    pub compliance: Matrix3<f64>,
    /// Shift of the place, m, when a clamp moves by 1 m along an axis of the stock; the index is 3·clamp + axis. Empty if the part has
    /// more than [`MOST_CLAMPS`] clamps.
    pub motions: Vec<Vector3<f64>>,
    /// Stiffness against these motions: force along each of them (rows) per metre of each of them (columns), N/m.
    pub stiffness: DMatrix<f64>,
}

/// The largest number of clamps for which the effect `clamp_compliance` is computed.
pub const MOST_CLAMPS: usize = 4;

impl PartYield {
    /// A part whose clamps have their declared stiffness and cannot give way further.
    #[must_use]
    pub(crate) fn held_as_declared(compliance: Matrix3<f64>) -> Self {
        Self { compliance, motions: Vec::new(), stiffness: DMatrix::zeros(0, 0) }
    }

    /// The number of clamps whose motions are known; 0 for [`PartYield::held_as_declared`].
    #[doc(hidden)]
    pub fn clamps(&self) -> usize {
        self.motions.len() / 3
    }

    /// The mean of several compliances, weighted by shares. All of them must have the same clamps.
    #[doc(hidden)]
    pub fn mixed<'a>(parts: impl IntoIterator<Item = (&'a Self, f64)>) -> Self {
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

    /// The same compliance in turned axes.
    #[doc(hidden)]
    pub fn turned(self, rotation: &Rotation3<f64>) -> Self {
        Self {
            compliance: rotation.matrix() * self.compliance * rotation.matrix().transpose(),
            motions: self.motions.iter().map(|motion| rotation * motion).collect(),
            stiffness: self.stiffness,
        }
    }
}

/// A [`PartYield`] and the orientation of its axes in the work object.
///
/// # Examples
/// ```
/// use deflex_effects::{PartAt, PartYield};
/// use nalgebra::{DMatrix, Matrix3, Rotation3};
///
/// let wall = PartYield { compliance: Matrix3::identity() * 1e-6, motions: vec![], stiffness: DMatrix::zeros(0, 0) };
/// let at = PartAt { yields: &wall, wobj_from_part: Rotation3::identity() };
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PartAt<'a> {
    /// The compliance, in the axes of the part.
    pub yields: &'a PartYield,
    /// Rotation from the axes of the part to those of the work object.
    pub wobj_from_part: Rotation3<f64>,
}

impl<'a> PartAt<'a> {
    /// A compliance that is already given in work object axes.
    #[must_use]
    #[doc(hidden)]
    pub fn in_wobj(yields: &'a PartYield) -> Self {
        Self { yields, wobj_from_part: Rotation3::identity() }
    }
}

/// What stands on a mechanical unit, directly or on another unit.
///
/// # Examples
/// ```
/// use deflex_effects::{Carries, UnitAt};
/// use deflex_robot::Pose;
///
/// let track = UnitAt::new("TRACK1", Pose::identity(), Carries::Robot);
/// assert_eq!(track.carries, Carries::Robot); // an error of its frame moves the robot against the part
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Carries {
    /// The work object, and not the robot.
    Part,
    /// The robot, and not the work object.
    Robot,
    /// Both or none of them, so that an error of its frame does not move one against the other, or unknown.
    BothOrNone,
}

/// The place of a mechanical unit at a target, for errors of its frame.
///
/// # Examples
/// ```
/// use deflex_effects::{Carries, UnitAt};
/// use deflex_robot::Pose;
///
/// let table = UnitAt::new("STN1", Pose::identity(), Carries::Part);
/// assert_eq!(table.carries, Carries::Part);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnitAt {
    pub(crate) key: u64,
    /// Frame of the unit at position zero, on whatever it stands on at this target, in the declared work object, m.
    pub wobj_from_unit: Pose,
    /// What stands on it.
    pub carries: Carries,
}

impl UnitAt {
    /// A unit by its name; upper and lower case are the same.
    #[must_use]
    pub fn new(name: &str, wobj_from_unit: Pose, carries: Carries) -> Self {
        Self { key: unit_key(name), wobj_from_unit, carries }
    }
}

/// A hash (FNV-1a) of the name of a unit, the same for upper and lower case.
pub(crate) fn unit_key(name: &str) -> u64 {
    let byte = |key: u64, byte: u8| (key ^ u64::from(byte.to_ascii_uppercase())).wrapping_mul(0x0100_0000_01b3);
    name.bytes().fold(0xcbf2_9ce4_8422_2325, byte)
}
