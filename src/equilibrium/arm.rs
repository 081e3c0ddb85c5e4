use crate::effects::Effect;
use crate::robot::{Joints, Robot};

/// The arm of a cell: what the controller believes in, and the effects that make it differ.
#[derive(Debug)]
pub struct Arm {
    /// Nominal geometry: what the controller computes with.
    pub robot: Robot,
    /// Declared joint stiffness at the motors, N·m/rad.
    pub stiffness: Option<Joints>,
    /// In the order of the cell file.
    pub effects: Vec<Box<dyn Effect>>,
}

impl Arm {
    /// Whether any effect depends on the commanded angles themselves.
    #[must_use]
    pub fn follows_command(&self) -> bool {
        self.effects.iter().any(|effect| effect.follows_command())
    }

    /// Whether any effect depends on the direction in which the joints came.
    #[must_use]
    pub fn follows_travel(&self) -> bool {
        self.effects.iter().any(|effect| effect.presliding_rad().is_some())
    }

    /// Whether what the arm carries weighs.
    #[must_use]
    pub fn weighs_payload(&self) -> bool {
        self.effects.iter().any(|effect| effect.weighs_payload())
    }
}
