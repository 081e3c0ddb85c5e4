use super::block::{Setting, Site};
use super::model::Model;
use super::predict::{Load, PredictedPose, WarmStart, Workspace};
use super::{Arm, EquilibriumError};
use deflex_effects::Situation;
use deflex_lanes::Frame;
use deflex_robot::kinematics::one;
use deflex_robot::{Joints, Pose};

/// The command with which the loaded arm reaches a wanted pose.
///
/// # Examples
/// ```
/// use deflex_equilibrium::Command;
/// use deflex_robot::Joints;
///
/// let motor = Joints::repeat(0.1); // rad
/// let command = Command::held(&motor); // without a correction
/// assert_eq!((command.deflection(), command.commanded(&Joints::zeros())), (Joints::zeros(), motor));
/// ```
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Command {
    /// Actual motor angles at the wanted pose, rad.
    pub motor: Joints,
    /// Commanded motor angles without the compensation of lost motion, rad.
    pub free: Joints,
    /// Lost motion to add in the direction of travel, rad, not negative.
    pub lost: Joints,
    /// The loads at the wanted pose.
    pub load: Load,
}

/// The part of a [`Command`] that the correction of a path uses.
#[derive(Clone, Copy, Debug)]
#[doc(hidden)]
pub struct InverseSolution {
    /// Actual motor angles at the wanted pose, rad.
    pub motor: Joints,
    /// Commanded motor angles without the compensation of lost motion, rad.
    pub free: Joints,
    /// Lost motion to add in the direction of travel, rad, not negative.
    pub lost: Joints,
    /// Starting values for forward equilibria at this command and at commands nearby.
    pub(crate) feedback: Feedback,
}

/// The feedback of the depth of cut at a target: a lift of the tip changes the force, the joints yield to that change, and this lifts the
/// tip again. Forward equilibria start from it; it changes no result.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Feedback {
    /// Deflection of the joints at the wanted pose, rad.
    pub(crate) under: Joints,
    /// Change of the joints' deflection for a lift of the tip along the surface normal, rad/m.
    pub(crate) yielding: Joints,
    /// See [`PredictedPose`].
    pub(crate) mixing: f64,
    /// Estimated lift of the tip above the wanted pose if the motors stand at the angles of the nominal arm there (no correction), m.
    pub(crate) lift: f64,
}

impl InverseSolution {
    /// Start for the equilibrium of the uncorrected command: the motor angles of the nominal arm at the wanted pose.
    pub fn uncorrected(&self) -> WarmStart {
        self.warm_start(self.feedback.lift, 1.0)
    }

    /// Start for the equilibrium of a command that puts the nominal tip `lift` (m) above the tip of this command. The feedback is nearly
    /// that of the equilibrium `uncorrected`.
    pub fn corrected(&self, lift: f64, uncorrected: &PredictedPose) -> WarmStart {
        let near = self.warm_start(lift * (1.0 - self.feedback.mixing), uncorrected.gain);
        WarmStart { mixing: uncorrected.mixing, ..near }
    }

    /// Start for the equilibria of commands nearby, where the joints have nearly the same deflection.
    pub fn nearby(&self) -> WarmStart {
        WarmStart { under: self.feedback.under, ..WarmStart::default() }
    }

    fn warm_start(&self, lift: f64, gain: f64) -> WarmStart {
        let Feedback { under, yielding, mixing, .. } = self.feedback;
        WarmStart { under: under + yielding * lift, mixing, left: under.norm_squared(), gain }
    }

    /// Commanded motor angles for a direction of travel (−1 to 1 for each joint), rad.
    pub fn commanded(&self, travel: &Joints) -> Joints {
        self.free + travel.component_mul(&self.lost)
    }
}

/// Where the search for a command starts.
#[derive(Clone, Copy, Debug)]
#[doc(hidden)]
pub enum Start<'a> {
    /// Motor angles that choose the branch of the nominal inverse, rad.
    Near(&'a Joints),
    /// Motor angles of the nominal arm at the wanted pose itself, rad.
    At(&'a Joints),
}

impl Command {
    /// A command without a correction: the motors are commanded to `motor`, rad.
    #[must_use]
    pub fn held(motor: &Joints) -> Self {
        Self { motor: *motor, free: *motor, lost: Joints::zeros(), load: Load::default() }
    }

    /// Actual minus commanded motor angles, without lost motion, rad.
    #[must_use]
    pub fn deflection(&self) -> Joints {
        self.motor - self.free
    }

    /// Commanded motor angles for a direction of travel (−1 to 1 for each joint), rad.
    #[must_use]
    pub fn commanded(&self, travel: &Joints) -> Joints {
        self.aim().commanded(travel)
    }

    /// The part that the correction of a path uses, without knowledge of the feedback of the cut.
    #[doc(hidden)]
    pub fn aim(&self) -> InverseSolution {
        let feedback = Feedback { under: self.deflection(), ..Feedback::default() };
        InverseSolution { motor: self.motor, free: self.free, lost: self.lost, feedback }
    }
}

/// Most iterations for effects that move the geometry or depend on the command. Each of them gains three digits or more.
const MOST_CORRECTIONS: usize = 50;

impl Arm {
    /// Inverse equilibrium: the command that puts the loaded TCP on `wobj_from_tcp`.
    ///
    /// If only joints yield, no iteration is needed. At equilibrium the **actual** joints carry the load: q_a = IK(wanted) gives the torque,
    /// and q_c = q_a − K⁻¹ τ(q_a) is exact for finite deflections and for any spring curve. Effects that move the geometry or depend on
    /// the command take a few iterations from there. `near` (motor angles, rad) chooses the branch, `travel` is the direction of travel
    /// of each joint, −1 to 1. The caller has to check axis limits, on the command.
    ///
    /// # Errors
    /// The arm does not reach the pose, or the iteration does not converge.
    pub fn command(
        &self,
        situation: &Situation,
        wobj_from_tcp: &Pose,
        near: &Joints,
        travel: &Joints,
    ) -> Result<Command, EquilibriumError> {
        self.command_from(situation, wobj_from_tcp, Start::Near(near), travel)
    }

    /// [`Arm::command`] from a start at which the motor angles of the nominal arm may be known already.
    #[doc(hidden)]
    pub fn command_from(
        &self,
        situation: &Situation,
        wobj_from_tcp: &Pose,
        start: Start<'_>,
        travel: &Joints,
    ) -> Result<Command, EquilibriumError> {
        let invert = |base_from_flange: &Pose, near: &Joints| {
            if !base_from_flange.translation.vector.iter().all(|v| v.is_finite()) {
                return Err(EquilibriumError::NotFinite);
            }
            Ok(self.robot.inverse_near_unlimited(base_from_flange, near)?)
        };
        let motor = match start {
            Start::At(motor) => *motor,
            Start::Near(motor) => {
                let tcp_from_flange = situation.tool.flange_from_tcp.inverse();
                invert(&(situation.base_from_wobj * wobj_from_tcp * tcp_from_flange), motor)?
            }
        };
        let (model, setting) = (Model::new(self), Setting::of(situation));
        let Workspace { mut block, mut at, mut inverse, .. } = Workspace::at(&Site::of(situation, &setting));
        inverse.wanted = Frame::of(wobj_from_tcp);
        (inverse.motor, inverse.travel) = (motor.into(), (*travel).into());
        inverse.run(&model, &mut block, &mut at, (true, MOST_CORRECTIONS), |base_from_flange, near| {
            invert(&base_from_flange.lane(0), &one(near, 0)).map(|motor| (motor.into(), true))
        })?;
        let (motor, free, lost) = (one(&inverse.motor, 0), one(&inverse.free, 0), one(&inverse.lost, 0));
        if !free.iter().chain(&lost).all(|v| v.is_finite()) {
            return Err(EquilibriumError::NotFinite);
        }
        if !inverse.done {
            let change = motor - (free + travel.component_mul(&lost));
            let axis = change.iamax() + 1;
            return Err(EquilibriumError::NoEquilibrium {
                rounds: MOST_CORRECTIONS,
                step_mm: 1e3 * inverse.change.sqrt(),
                axis,
            });
        }
        Ok(Command { motor, free, lost, load: Load::of(&at) })
    }

    /// Inverse equilibrium of the position alone: the command has the orientation of `programmed`, and the position with which the loaded
    /// TCP comes to the wanted point of the situation.
    ///
    /// This takes an iteration, because the commanded orientation is given and not the actual one. Each step gains the ratio of the
    /// arm's size to its deflection, about three digits.
    ///
    /// # Errors
    /// The arm does not reach the pose, or the iteration does not converge.
    #[doc(hidden)]
    pub fn command_position(
        &self,
        situation: &Situation,
        programmed: &Pose,
        near: &Joints,
        travel: &Joints,
    ) -> Result<Command, EquilibriumError> {
        // 1e-9 mm, like the explicit inverse.
        const LANDED: f64 = 1e-12;
        let wanted = situation.wobj_from_tcp.translation.vector;
        let tcp_from_flange = situation.tool.flange_from_tcp.inverse();
        let mut aim = *programmed;
        let mut motor = *near;
        let mut gap = f64::INFINITY;
        for _ in 0..MOST_CORRECTIONS {
            motor = self.robot.inverse_near_unlimited(&(situation.base_from_wobj * aim * tcp_from_flange), &motor)?;
            let there = self.predict(situation, &motor, travel)?;
            let miss = there.wobj_from_tcp.translation.vector - wanted;
            gap = miss.norm();
            if gap < LANDED {
                let lost = there.lost;
                return Ok(Command {
                    motor: there.motor,
                    free: motor - travel.component_mul(&lost),
                    lost,
                    load: there.load,
                });
            }
            aim.translation.vector -= miss;
        }
        Err(EquilibriumError::NoEquilibrium { rounds: MOST_CORRECTIONS, step_mm: 1e3 * gap, axis: 0 })
    }
}
