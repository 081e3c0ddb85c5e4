use crate::effects::{Cutting, Effect, Load, Parts, Situation};
use crate::lanes::Vector;
use crate::robot::kinematics::Chain;
use crate::robot::{Joints, Robot};

/// The arm of a cell: the controller's model of it, and the effects that make the real arm differ from that model.
///
/// # Examples
/// ```
/// # use deflex::{cell::Cell, text::Source};
/// # let cell = Cell::read(&Source::new("cell.toml", std::fs::read("samples/slot/cell.toml")?))?;
/// assert!(cell.arm.stiffness.is_some());
/// for effect in &cell.arm.effects {
///     println!("{}", effect.kind());
/// }
/// # Ok::<(), deflex::text::Diagnostics>(())
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
    pub(crate) fn follows_command(&self) -> bool {
        self.effects.iter().any(|effect| effect.follows_command())
    }

    /// Whether any effect depends on the direction of travel of the joints.
    #[must_use]
    pub(crate) fn follows_travel(&self) -> bool {
        self.effects.iter().any(|effect| effect.presliding().is_some())
    }

    /// Whether any effect depends on the cutting forces at the targets before: gears that creep, and friction with a presliding angle.
    #[must_use]
    pub(crate) fn follows_load(&self) -> bool {
        self.effects.iter().any(|effect| effect.follows_load()) || !self.presliding().is_sharp()
    }

    /// Torques of the cutting force at the motors, N·m, while the arm is in its nominal pose.
    pub(crate) fn cutting_torque(&self, situation: &Situation<'_>, motor: &Joints) -> Joints {
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
    pub(crate) fn weighs_payload(&self) -> bool {
        self.effects.iter().any(|effect| effect.weighs_payload())
    }
}
