use super::block::{Setting, Site};
use super::model::Model;
use super::predict::{Load, PredictedPose, WarmStart, Workspace};
use super::{Arm, EquilibriumError};
use crate::effects::Situation;
use crate::lanes::Frame;
use crate::robot::kinematics::one;
use crate::robot::{Joints, Pose};

/// The command that ends up where it should.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Command {
    /// Actual motor angles at the wanted pose, rad.
    pub motor: Joints,
    /// Commanded motor angles but for lost motion, rad.
    pub free: Joints,
    /// Lost motion to add in the direction of travel, rad, not negative.
    pub lost: Joints,
    /// What the arm carries at the wanted pose.
    pub load: Load,
}

/// As much of a [`Command`] as a path needs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct InverseSolution {
    /// Actual motor angles at the wanted pose, rad.
    pub(crate) motor: Joints,
    /// Commanded motor angles but for lost motion, rad.
    pub(crate) free: Joints,
    /// Lost motion to add in the direction of travel, rad, not negative.
    pub(crate) lost: Joints,
    /// How its equilibria and those close by feed back.
    pub(crate) feedback: Feedback,
}

/// How the depth of cut feeds back: a lift of the tip changes the force, to which the joints yield, which lifts the tip.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Feedback {
    /// By how much the joints yield at the wanted pose, rad.
    pub(crate) under: Joints,
    /// What the joints yield by to a lift of the tip along the surface normal, rad/m.
    pub(crate) yielding: Joints,
    /// See [`PredictedPose`].
    pub(crate) mixing: f64,
    /// Of the tip from the wanted pose at the equilibrium of the nominal arm's motor angles there, about, m.
    pub(crate) lift: f64,
}

impl InverseSolution {
    /// Where to begin with the equilibrium of the nominal arm's motor angles.
    pub(crate) fn uncorrected(&self) -> WarmStart {
        self.warm_start(self.feedback.lift, 1.0)
    }

    /// Where to begin with the equilibrium of a command that puts the nominal tip `lift` (m) over where the aim's puts it: what
    /// feeds back is much the same as `uncorrected`.
    pub(crate) fn corrected(&self, lift: f64, uncorrected: &PredictedPose) -> WarmStart {
        let near = self.warm_start(lift * (1.0 - self.feedback.mixing), uncorrected.gain);
        WarmStart { mixing: uncorrected.mixing, ..near }
    }

    /// Where to begin with the equilibria of commands close by: the joints yield by much the same.
    pub(crate) fn nearby(&self) -> WarmStart {
        WarmStart { under: self.feedback.under, ..WarmStart::default() }
    }

    fn warm_start(&self, lift: f64, gain: f64) -> WarmStart {
        let Feedback { under, yielding, mixing, .. } = self.feedback;
        WarmStart { under: under + yielding * lift, mixing, left: under.norm_squared(), gain }
    }

    /// Commanded motor angles for a direction of travel (−1, 0, 1 a joint), rad.
    pub(crate) fn commanded(&self, travel: &Joints) -> Joints {
        self.free + travel.component_mul(&self.lost)
    }
}

/// Where the search for a command begins.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Start<'a> {
    /// Motor angles that choose the branch, rad.
    Near(&'a Joints),
    /// Motor angles of the nominal arm at the wanted pose itself, rad.
    At(&'a Joints),
}

impl Command {
    /// A command that nothing corrects.
    #[must_use]
    pub fn held(motor: &Joints) -> Self {
        Self { motor: *motor, free: *motor, lost: Joints::zeros(), load: Load::default() }
    }

    /// Actual minus commanded motor angles, but for lost motion, rad.
    #[must_use]
    pub fn deflection(&self) -> Joints {
        self.motor - self.free
    }

    /// Commanded motor angles for a direction of travel (−1, 0, 1 a joint), rad.
    #[must_use]
    pub fn commanded(&self, travel: &Joints) -> Joints {
        self.aim().commanded(travel)
    }

    /// What a path needs of it; nothing is known of how it feeds back.
    pub(crate) fn aim(&self) -> InverseSolution {
        let feedback = Feedback { under: self.deflection(), ..Feedback::default() };
        InverseSolution { motor: self.motor, free: self.free, lost: self.lost, feedback }
    }
}

/// Rounds for effects that move the geometry or depend on the command; each gains three digits or more.
const MOST_CORRECTIONS: usize = 50;

impl Arm {
    /// Inverse equilibrium: the command that puts the loaded TCP on `wobj_from_tcp`.
    ///
    /// Not an iteration where only joints yield: at equilibrium the **actual** joints carry the load, so with
    /// q_a = IK(wanted) the torque is known and q_c = q_a − K⁻¹ τ(q_a), exact for finite deflections and for any joint
    /// curve. Effects that move the geometry or depend on the command take a few rounds from there. `near` chooses the
    /// branch, rad. Limits are the caller's to check, on the command.
    ///
    /// # Errors
    /// The pose is not reached, or no command settles.
    pub fn command(
        &self,
        situation: &Situation,
        wobj_from_tcp: &Pose,
        near: &Joints,
        travel: &Joints,
    ) -> Result<Command, EquilibriumError> {
        self.command_from(situation, wobj_from_tcp, Start::Near(near), travel)
    }

    /// The same from where the nominal arm is known.
    pub(crate) fn command_from(
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
        inverse.run(&model, &mut block, &mut at, (true, MOST_CORRECTIONS), |asked, near| {
            invert(&asked.lane(0), &one(near, 0)).map(|motor| (motor.into(), true))
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

    /// Inverse equilibrium of the TCP alone: `programmed` keeps its orientation as commanded, and the command's
    /// position is found that lands the loaded TCP on the situation's wanted point.
    ///
    /// An iteration, since the command's orientation is held instead of the actual one; a round gains the ratio of
    /// deflection to arm, three digits.
    ///
    /// # Errors
    /// The pose is not reached, or no command settles.
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
