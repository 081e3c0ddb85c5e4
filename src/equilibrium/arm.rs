use crate::effects::Effect;
use crate::robot::{Joints, Robot};

/// The arm of a cell: the controller's model of it, and the effects that make the real arm differ from that model.
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
    pub fn follows_command(&self) -> bool {
        self.effects.iter().any(|effect| effect.follows_command())
    }

    /// Whether any effect depends on the direction of travel of the joints.
    #[must_use]
    pub fn follows_travel(&self) -> bool {
        self.effects.iter().any(|effect| effect.presliding().is_some())
    }

    /// Whether the weight of the tool or the payload acts on the arm.
    #[must_use]
    pub fn weighs_payload(&self) -> bool {
        self.effects.iter().any(|effect| effect.weighs_payload())
    }
}
