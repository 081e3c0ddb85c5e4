use deflex_effects::{Cutting, Effect, Load, Need, Parts, Situation};
use deflex_lanes::Vector;
use deflex_robot::kinematics::Chain;
use deflex_robot::{Joints, Robot};

/// The arm of a cell: the controller's model of it, and the effects that make the real arm differ from that model.
///
/// # Examples
/// ```
/// use deflex_effects::{Cutting, Situation, ToolFrame, declared_springs};
/// use deflex_equilibrium::Arm;
/// use deflex_robot::{Builtin, Joints, Pose};
///
/// let robot = Builtin::named("irb6660-205-1.9").expect("a built-in robot").robot();
/// let motor = robot.motor_from_axes_deg(&robot.home_deg());
/// let tool = ToolFrame { flange_from_tcp: Pose::translation(0.0, 0.0, 0.3), mass: 18.0, cog: [0.0, 0.0, 0.1].into() };
/// let wanted = robot.forward(&motor) * tool.flange_from_tcp;
/// let stiffness = [8.86e5, 5.5e5, 1.85e6, 3.3e5, 2.1e5, 8.81e4]; // N·m/rad, at the motors
/// let arm = Arm { stiffness: Some(stiffness.into()), effects: vec![declared_springs(&robot.axes)], robot };
///
/// let situation = Situation { cutting: Cutting::Constant([0.0, 300.0, 0.0].into()), ..Situation::in_air(tool, wanted) };
/// let found = arm.predict(&situation, &motor, &Joints::zeros()).expect("an equilibrium");
/// assert!((found.wobj_from_tcp.translation.vector - wanted.translation.vector).y > 1e-4); // m: the arm yields to the force
/// let command = arm.command(&situation, &wanted, &motor, &Joints::zeros()).expect("within reach");
/// assert!(command.deflection().amax() > 1e-5); // rad
/// ```
#[derive(Debug)]
pub struct Arm {
    /// Nominal geometry, with which the controller computes.
    pub robot: Robot,
    /// Declared joint stiffness at the motors, N·m/rad; `None` if the cell declares none.
    pub stiffness: Option<Joints>,
    /// The effects, in the order of the cell file.
    pub effects: Vec<Box<dyn Effect>>,
}

impl Arm {
    /// Whether any effect depends on the commanded motor angles.
    #[must_use]
    #[doc(hidden)]
    pub fn follows_command(&self) -> bool {
        self.effects.iter().any(|effect| effect.follows_command())
    }

    /// Whether any effect depends on the direction of travel of the joints.
    #[must_use]
    #[doc(hidden)]
    pub fn follows_travel(&self) -> bool {
        self.effects.iter().any(|effect| effect.presliding().is_some())
    }

    /// Whether any effect needs this.
    #[must_use]
    #[doc(hidden)]
    pub fn needs(&self, need: Need) -> bool {
        self.effects.iter().any(|effect| effect.needs().contains(&need))
    }

    /// Whether any effect depends on the cutting forces at the targets before: gears that creep, and friction with a presliding angle.
    #[must_use]
    #[doc(hidden)]
    pub fn follows_load(&self) -> bool {
        self.effects.iter().any(|effect| effect.follows_load()) || !self.presliding().is_sharp()
    }

    /// Torques of the cutting force at the motors, N·m, while the arm is in its nominal pose.
    #[doc(hidden)]
    pub fn cutting_torque(&self, situation: &Situation<'_>, motor: &Joints) -> Joints {
        if matches!(situation.cutting, Cutting::Air) {
            return Joints::zeros();
        }
        let (rows, mut chain, mut load) = (self.robot.rows::<f64>(), Chain::default(), Load::default());
        rows.chain(&self.robot.joints(&rows.theta, &(*motor).into()), None, &mut chain);
        load.start(Vector::of(&(situation.base_from_wobj.rotation * situation.cutting_force())), Parts::NONE);
        let base_from_tcp = situation.base_from_wobj * situation.wobj_from_tcp;
        load.fill_torque(&self.robot, &chain, Vector::of(&base_from_tcp.translation.vector));
        load.torque.into()
    }

    /// Whether the weight of the tool or the payload acts on the arm.
    #[must_use]
    #[doc(hidden)]
    pub fn weighs_payload(&self) -> bool {
        self.effects.iter().any(|effect| effect.weighs_payload())
    }
}
