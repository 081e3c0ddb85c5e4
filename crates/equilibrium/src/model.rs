use super::Arm;
use deflex_effects::{Law, Parts};
use deflex_robot::{BatchArm, Joints, Robot};
use smallvec::SmallVec;

/// An arm with its effects, prepared for evaluations.
#[derive(Debug)]
pub(crate) struct Model<'a> {
    pub(super) robot: &'a Robot,
    /// The inverse kinematics for several targets at once; `None` if the arm has no explicit inverse.
    pub(super) inverse: Option<BatchArm<'a>>,
    /// Declared joint stiffness at the motors, N·m/rad.
    pub(super) stiffness: Option<&'a Joints>,
    pub(super) laws: SmallVec<[Law<'a>; 4]>,
    /// The fields that any of the effects changes.
    pub(super) parts: Parts,
    pub(super) follows_command: bool,
    /// Estimated compliance of the joints at the motors, rad/(N·m).
    pub(super) compliance: [f64; 6],
}

impl<'a> Model<'a> {
    pub(crate) fn new(arm: &'a Arm) -> Self {
        let laws: SmallVec<[Law<'a>; 4]> = arm.effects.iter().map(|effect| effect.law()).collect();
        let stiffness = arm.stiffness.as_ref();
        let mut compliance = [0.0; 6];
        for law in &laws {
            compliance.iter_mut().zip(law.compliance(stiffness)).for_each(|(sum, own)| *sum += own);
        }
        Self {
            robot: &arm.robot,
            inverse: BatchArm::of(&arm.robot),
            stiffness,
            parts: laws.iter().fold(Parts::NONE, |parts, law| parts.and(law.parts())),
            laws,
            follows_command: arm.follows_command(),
            compliance,
        }
    }

    /// Whether a command needs no iteration: all effects change joint angles only, and none depends on the command.
    pub(super) fn is_explicit(&self) -> bool {
        !self.parts.moves_geometry() && !self.follows_command
    }
}
