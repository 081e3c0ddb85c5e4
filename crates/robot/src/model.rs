use super::closed_form::ClosedForm;
use super::links::{DhRow, Links};
use super::{Joints, Pose};
use nalgebra::Vector3;

/// Standard gravity, m/s².
const GRAVITY: f64 = 9.806_65;

/// Gravity in the frame of a base, m/s², for a pose of the base in the world. Gravity acts along world −z.
#[doc(hidden)]
pub fn gravity_at(world_from_base: &Pose) -> Vector3<f64> {
    world_from_base.rotation.inverse_transform_vector(&Vector3::new(0.0, 0.0, -GRAVITY))
}

/// The controller's model of the arm.
///
/// # Examples
/// ```
/// use deflex_robot::{Builtin, Pose, Robot};
///
/// let robot = Builtin::named("irb6660-205-1.9").expect("a built-in robot").robot();
/// let motor = robot.motor_from_axes_deg(&[0.0; 6]);
/// assert!((robot.forward(&motor).translation.x - 1.393).abs() < 1e-9); // m
/// let frames = robot.frames(&motor);
/// println!("the wrist centre is {:.0} mm above the base", 1e3 * frames.origin(4).z);
/// let jacobian = robot.jacobian(&frames, &frames.base_from_flange().translation.vector);
/// assert!((jacobian[(1, 0)] - 1.393).abs() < 1e-9); // axis 1 moves it along y with its distance from the axis, m/rad
///
/// let deg = [10.0, 20.0, 15.0, 30.0, 40.0, -60.0];
/// let motor = robot.motor_from_axes_deg(&deg);
/// assert!(robot.axes_deg_from_motor(&motor).iter().zip(deg).all(|(a, b)| (a - b).abs() < 1e-9));
/// let serial = robot.serial_from_motor(&motor);
/// assert!((robot.motor_from_serial(&serial) - motor).amax() < 1e-12);
/// assert!(robot.has_closed_form()); // its wrist is spherical
/// assert!(robot.limit_violation(&motor).is_none());
/// let pose = robot.forward(&motor);
/// let branches = robot.inverse(&pose, &motor).expect("within reach");
/// assert!(branches.iter().flatten().any(|found| (found - motor).amax() < 1e-9));
/// let near = motor.add_scalar(0.01);
/// let found = [
///     robot.inverse_near(&pose, &near),
///     robot.inverse_near_unlimited(&pose, &near),
///     robot.inverse_along(&Pose::identity(), &pose, &near),
///     robot.start(&pose, None, Some(&near)).map(|start| start.motor),
/// ];
/// assert!(found.iter().all(|found| found.is_ok_and(|found| (found - motor).amax() < 1e-9)));
///
/// let copy = Robot::new("copy", *robot.links.rows(), robot.axes.clone(), robot.limits.clone());
/// assert_eq!((copy.forward(&motor), copy.home_deg()), (pose, [0.0; 6]));
/// let on_pedestal = copy.standing_at(Pose::translation(0.0, 0.0, 0.5));
/// assert_eq!(on_pedestal.world_from_base.translation.z, 0.5); // m
/// assert!((on_pedestal.gravity().z + 9.81).abs() < 0.01); // m/s², in the base of an arm that stands upright
/// ```
#[derive(Clone, Debug)]
pub struct Robot {
    /// Name for messages.
    pub model: String,
    /// The links from base to flange.
    pub links: Links,
    /// How the axes that the controller counts turn the joints of `links`.
    pub axes: Axes,
    /// Axis limits as the controller counts them.
    pub limits: Limits,
    /// Largest axis speeds, rad/s, if they are known.
    pub axis_speed: Option<Joints>,
    /// Pose of the base in the world, m; gravity acts along world −z.
    pub world_from_base: Pose,
    /// The explicit inverse; `None` if the geometry has none.
    closed_form: Option<ClosedForm>,
}

/// Axis limits as the controller counts them, rad.
///
/// # Examples
/// ```
/// use deflex_robot::{Joints, Limits};
///
/// let turn = Joints::repeat(std::f64::consts::PI);
/// let limits = Limits { min: -turn, max: turn, elbow: None };
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Smallest axis angles.
    pub min: Joints,
    /// Largest axis angles.
    pub max: Joints,
    /// Smallest and largest angle between forearm and upper arm, if this is not the angle of an axis: motor 3 − motor 2
    /// of a parallelogram, axis 2 + axis 3 if axis 3 is counted against the ground.
    pub elbow: Option<(f64, f64)>,
}

/// How the controller's axes move the joints of the Denavit-Hartenberg rows. Differences between the two zero positions
/// are part of `theta` in the rows.
///
/// # Examples
/// ```
/// use deflex_robot::Axes;
///
/// // An arm with a parallelogram, all of whose axes turn as the rows say.
/// let axes = Axes { sign: [1.0; 6], parallelogram: true, coupled_23: false };
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axes {
    /// +1, or −1 for an axis whose positive direction is the joint's negative one: joint = sign · motor.
    pub sign: [f64; 6],
    /// Motor 3 sets the angle of the forearm to link 1 instead of to link 2, through a parallelogram, and carries the torque between them.
    pub parallelogram: bool,
    /// The controller counts axis 3 against the ground, although its motor is on link 2 (FANUC): the angle of axis 3
    /// stays the same while axis 2 moves and the forearm keeps its direction.
    pub coupled_23: bool,
}

impl Axes {
    /// Each axis turns its own joint.
    pub const SERIAL: Self = Self { sign: [1.0; 6], parallelogram: false, coupled_23: false };
    /// Motor 3 drives a parallelogram.
    pub const PARALLELOGRAM: Self = Self { parallelogram: true, ..Self::SERIAL };

    /// Share of motor 2 that is counted in axis 3.
    pub(super) fn counted_23(&self) -> f64 {
        if self.coupled_23 { self.sign[1] * self.sign[2] } else { 0.0 }
    }

    /// Share of motor 2 that is counted in the angle between forearm and upper arm. Motor 3 of a parallelogram turns
    /// the forearm relative to the ground.
    pub(super) fn elbow_of_second(&self) -> f64 {
        if self.parallelogram { -1.0 } else { 0.0 }
    }
}

impl Robot {
    /// A robot. Determines whether its geometry has an explicit inverse.
    #[must_use]
    pub fn new(model: impl Into<String>, rows: [DhRow; 6], axes: Axes, limits: Limits) -> Self {
        let closed_form = ClosedForm::of(&rows);
        Self {
            model: model.into(),
            links: Links::new(rows),
            axes,
            limits,
            axis_speed: None,
            world_from_base: Pose::identity(),
            closed_form,
        }
    }

    /// Gravity in the frame of the robot's base, m/s².
    #[must_use]
    pub fn gravity(&self) -> Vector3<f64> {
        gravity_at(&self.world_from_base)
    }

    /// The same robot with its base at another pose in the world.
    #[must_use]
    pub fn standing_at(mut self, world_from_base: Pose) -> Self {
        self.world_from_base = world_from_base;
        self
    }

    /// The same robot with these largest axis speeds, rad/s.
    #[must_use]
    #[doc(hidden)]
    pub fn with_axis_speed(mut self, axis_speed: Option<Joints>) -> Self {
        self.axis_speed = axis_speed;
        self
    }

    /// The explicit inverse, if the geometry has one (spherical wrist, parallel axes 2 and 3).
    pub(super) fn closed_form(&self) -> Option<&ClosedForm> {
        self.closed_form.as_ref()
    }

    /// Whether the inverse is explicit. Otherwise Newton's method computes it from a start.
    #[must_use]
    pub fn has_closed_form(&self) -> bool {
        self.closed_form.is_some()
    }

    /// Serial joint angles from motor angles, rad.
    #[must_use]
    pub fn serial_from_motor(&self, motor: &Joints) -> Joints {
        self.serial(&(*motor).into()).into()
    }

    /// Motor angles from serial joint angles, rad.
    #[must_use]
    pub fn motor_from_serial(&self, serial: &Joints) -> Joints {
        self.motor(&(*serial).into()).into()
    }

    /// Angles as the controller counts them, from motor angles, rad. They differ only if axis 3 is counted against the
    /// ground.
    #[must_use]
    pub(crate) fn axes_from_motor(&self, motor: &Joints) -> Joints {
        let mut axes = *motor;
        axes[2] += self.axes.counted_23() * motor[1];
        axes
    }

    /// The same angles in degrees, as in programs and files.
    #[must_use]
    pub fn axes_deg_from_motor(&self, motor: &Joints) -> [f64; 6] {
        self.axes_from_motor(motor).map(f64::to_degrees).into()
    }

    /// Motor angles (rad) from angles as the controller counts them, degrees.
    #[must_use]
    pub fn motor_from_axes_deg(&self, axes_deg: &[f64; 6]) -> Joints {
        let mut motor = Joints::from(axes_deg.map(f64::to_radians));
        motor[2] -= self.axes.counted_23() * motor[1];
        motor
    }
}
