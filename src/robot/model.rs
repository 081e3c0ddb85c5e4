use super::inverse::ClosedForm;
use super::{Joints, Limits, Links, Pose};

/// One modified Denavit-Hartenberg row (Craig): `Rx(alpha) Tx(a) Rz(theta + joint) Tz(d)`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DhRow {
    /// Twist about the previous x axis, rad.
    pub alpha: f64,
    /// Length along the previous x axis, m.
    pub a: f64,
    /// Length along the joint axis, m.
    pub d: f64,
    /// Angle added to the joint, rad.
    pub theta: f64,
}

/// The arm that the controller believes in.
#[derive(Clone, Debug)]
pub struct Robot {
    /// Name for messages.
    pub model: String,
    /// Geometry, base to flange.
    pub links: Links,
    /// Whether motor 3 sets the forearm's angle to link 1 instead of to link 2.
    pub parallelogram: bool,
    /// Axis limits at the motors.
    pub limits: Limits,
    /// Where the base stands; gravity is along world −z.
    pub world_from_base: Pose,
    /// Explicit inverse, where the geometry has one.
    closed_form: Option<ClosedForm>,
}

impl Robot {
    /// A robot; finds out whether its geometry has an explicit inverse.
    #[must_use]
    pub fn new(model: impl Into<String>, rows: [DhRow; 6], parallelogram: bool, limits: Limits) -> Self {
        let closed_form = ClosedForm::of(&rows);
        Self {
            model: model.into(),
            links: Links::new(rows),
            parallelogram,
            limits,
            world_from_base: Pose::identity(),
            closed_form,
        }
    }

    /// The same robot standing elsewhere.
    #[must_use]
    pub fn standing_at(mut self, world_from_base: Pose) -> Self {
        self.world_from_base = world_from_base;
        self
    }

    /// Explicit inverse, where the geometry has one (spherical wrist, parallel axes 2 and 3).
    pub(super) fn closed_form(&self) -> Option<&ClosedForm> {
        self.closed_form.as_ref()
    }

    /// Whether the inverse is explicit; else it is a polish from a seed.
    #[must_use]
    pub fn has_closed_form(&self) -> bool {
        self.closed_form.is_some()
    }

    /// Serial joint angles from motor angles, rad.
    #[must_use]
    pub fn serial_from_motor(&self, motor: &Joints) -> Joints {
        let mut serial = *motor;
        if self.parallelogram {
            serial[2] -= motor[1];
        }
        serial
    }

    /// Motor angles from serial joint angles, rad.
    #[must_use]
    pub fn motor_from_serial(&self, serial: &Joints) -> Joints {
        let mut motor = *serial;
        if self.parallelogram {
            motor[2] += serial[1];
        }
        motor
    }

    /// Motor torques from serial joint torques (power is the same in both coordinates), N·m.
    #[must_use]
    pub fn motor_torque_from_serial(&self, serial: &Joints) -> Joints {
        let mut motor = *serial;
        if self.parallelogram {
            motor[1] -= serial[2];
        }
        motor
    }
}
