use super::arm::Look;
use super::predict::{Foreseen, Landing};
use super::{Arm, EquilibriumError};
use crate::effects::{Distortion, Load, Parts, Situation};
use crate::robot::{Joints, Pose, polish};

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
pub(crate) struct Aim {
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
    /// What the joints yield by to a lift of the tip along the surface normal, rad/m.
    pub(crate) yielding: Joints,
    /// See [`Near`](super::Near).
    pub(crate) share: f64,
    /// Of the tip from the wanted pose at the equilibrium of the nominal arm's motor angles there, about, m.
    pub(crate) lift: f64,
}

impl Aim {
    /// Where to begin with the equilibrium of the nominal arm's motor angles.
    pub(crate) fn uncorrected(&self) -> Foreseen {
        self.foreseen(self.feedback.lift, 1.0)
    }

    /// Where to begin with the equilibrium of a command that puts the nominal tip `lift` (m) over where the aim's puts it: what
    /// feeds back is much the same as `uncorrected`.
    pub(crate) fn corrected(&self, lift: f64, uncorrected: &Landing) -> Foreseen {
        let near = self.foreseen(lift * (1.0 - self.feedback.share), uncorrected.gain);
        Foreseen { share: uncorrected.share, ..near }
    }

    fn foreseen(&self, lift: f64, gain: f64) -> Foreseen {
        let deflection = self.deflection();
        let Feedback { yielding, share, .. } = self.feedback;
        Foreseen { deflection: deflection + yielding * lift, share, left: deflection.norm_squared(), gain }
    }

    /// Actual minus commanded motor angles, but for lost motion, rad.
    pub(crate) fn deflection(&self) -> Joints {
        self.motor - self.free
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
        self.aim().deflection()
    }

    /// Commanded motor angles for a direction of travel (−1, 0, 1 a joint), rad.
    #[must_use]
    pub fn commanded(&self, travel: &Joints) -> Joints {
        self.aim().commanded(travel)
    }

    /// What a path needs of it; nothing is known of how it feeds back.
    pub(crate) fn aim(&self) -> Aim {
        Aim { motor: self.motor, free: self.free, lost: self.lost, feedback: Feedback::default() }
    }
}

/// Commands that change less than this a round are found, rad: 1e-9 mm at 3 m.
const FOUND: f64 = 3e-13;

/// Rounds for effects that depend on the command or bend the links; each gains three digits or more.
const ROUNDS: usize = 50;

impl Arm {
    /// Inverse equilibrium: the command that puts the loaded TCP on `wobj_from_tcp`.
    ///
    /// Not an iteration where only joints yield: at equilibrium the **actual** joints carry the load, so with
    /// q_a = IK(wanted) the torque is known and q_c = q_a − K⁻¹ τ(q_a), exact for finite deflections and for any joint
    /// curve. Effects that bend links or depend on the command take a few rounds from there. `near` chooses the
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
        let mut distortion = Distortion::default();
        let mut parts = distortion.parts();
        let (mut motor, known) = match start {
            Start::Near(motor) => (*motor, false),
            Start::At(motor) => (*motor, true),
        };
        let mut commanded: Option<Joints> = None;
        let mut change = f64::INFINITY;
        let mut settled = 0;
        let mut axis = 0;
        let mut look = Look::default();
        for round in 0..ROUNDS {
            if round == 0 && !known || parts == Parts::All {
                let wanted = self.chain_pose(situation, wobj_from_tcp, &distortion);
                if !wanted.translation.vector.iter().all(|v| v.is_finite()) {
                    return Err(EquilibriumError::NotFinite);
                }
                motor = if distortion.bends_links() {
                    let links = self.bent_links(&distortion);
                    let at = |serial: &Joints| links.chain(serial, Some(&distortion.tilt));
                    self.robot.motor_from_serial(&polish(&at, &wanted, &self.robot.serial_from_motor(&motor))?)
                } else {
                    self.robot.inverse_near_unlimited(&wanted, &motor)?
                };
            }
            let guess = commanded.unwrap_or(motor);
            let turns = self.turns(&motor);
            self.look(situation, &guess, &turns, &motor, &distortion, parts, &mut look);
            let free = motor - look.distortion.joints;
            let next = free + travel.component_mul(&look.distortion.lost);
            let gap = next - guess;
            (change, axis) = (gap.amax(), gap.iamax() + 1);
            if !gap.iter().all(|v| v.is_finite()) {
                return Err(EquilibriumError::NotFinite);
            }
            let found = look.distortion.parts();
            let explicit = found == Parts::Joints && !self.follows_command();
            settled = if commanded.is_some() && change < FOUND { settled + 1 } else { 0 };
            // Twice: the pose solved for follows the command one round late.
            if explicit || settled == 2 {
                return Ok(Command { motor, free, lost: look.distortion.lost, load: look.load });
            }
            commanded = Some(next);
            // Once in there, always in there: the pose is solved for again where a part went back to zero.
            parts = parts.or(found);
            std::mem::swap(&mut distortion, &mut look.distortion);
        }
        Err(EquilibriumError::NoEquilibrium { rounds: ROUNDS, step_mm: 1e3 * change, axis })
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
        for _ in 0..ROUNDS {
            motor = self.robot.inverse_near_unlimited(&(situation.base_from_wobj * aim * tcp_from_flange), &motor)?;
            let there = self.predict(situation, &motor, travel)?;
            let miss = there.wobj_from_tcp.translation.vector - wanted;
            gap = miss.norm();
            if gap < LANDED {
                let lost = there.distortion.lost;
                return Ok(Command {
                    motor: there.motor,
                    free: motor - travel.component_mul(&lost),
                    lost,
                    load: there.load,
                });
            }
            aim.translation.vector -= miss;
        }
        Err(EquilibriumError::NoEquilibrium { rounds: ROUNDS, step_mm: 1e3 * gap, axis: 0 })
    }
}
