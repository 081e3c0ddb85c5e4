use super::{Arm, EquilibriumError};
use crate::effects::{Distortion, Load, Situation};
use crate::robot::{Joints, Pose, rotation_angle};

/// Where a command ends up.
#[derive(Clone, Debug)]
pub struct Equilibrium {
    /// Actual motor angles, rad.
    pub motor: Joints,
    /// Actual TCP in the actual work object, m.
    pub wobj_from_tcp: Pose,
    /// What the arm carries there.
    pub load: Load,
    /// By how much the arm differs from the nominal one there.
    pub distortion: Distortion,
}

/// Steps below this end the iteration: m of the TCP, rad of its orientation. Six digits below a printed one.
const STEP: f64 = 1e-12;

/// Rounds of one attempt. Real arms gain twenty-fold a round (loop gain below 0.05), soft ones less.
const ROUNDS: usize = 200;

/// Relaxation of the attempts: a smaller share tames strong negative feedback, which is stable at the machine
/// but overshoots as a plain iteration.
const SHARES: [f64; 4] = [1.0, 0.5, 0.2, 0.05];

impl Arm {
    /// Forward equilibrium: the actual pose at commanded motor angles (rad).
    ///
    /// `travel` is the direction of the commanded motion into the target, −1, 0 or 1 a joint. The force depends on
    /// where the cutter really is (Tang et al., Eqs 5, 9–11), for finite deflections: each round puts the arm where
    /// the last round's loads would bend it.
    ///
    /// # Errors
    /// There is no equilibrium, or it is not finite.
    pub fn predict(
        &self,
        situation: &Situation,
        motor_commanded: &Joints,
        travel: &Joints,
    ) -> Result<Equilibrium, EquilibriumError> {
        let mut failure = EquilibriumError::NotFinite;
        for share in SHARES {
            match self.settle(situation, motor_commanded, travel, share) {
                Err(error @ EquilibriumError::NoEquilibrium { .. }) => failure = error,
                done => return done,
            }
        }
        Err(failure)
    }

    /// Where the TCP goes from an equilibrium of an arm that differs from this one by little, in the actual work object.
    ///
    /// Some rounds from there instead of all from nothing: for differences, of which they leave a thousandth.
    pub(crate) fn nudged(
        &self,
        situation: &Situation,
        motor_commanded: &Joints,
        travel: &Joints,
        from: &Equilibrium,
    ) -> Pose {
        const ROUNDS: usize = 2;
        let (mut motor, mut distortion) = (from.motor, from.distortion.clone());
        for _ in 0..ROUNDS {
            distortion = self.look(situation, motor_commanded, &motor, &distortion).distortion;
            motor = motor_commanded + distortion.joints - travel.component_mul(&distortion.lost);
        }
        self.look(situation, motor_commanded, &motor, &distortion).seen
    }

    fn settle(
        &self,
        situation: &Situation,
        motor_commanded: &Joints,
        travel: &Joints,
        share: f64,
    ) -> Result<Equilibrium, EquilibriumError> {
        let mut distortion = Distortion::default();
        let mut motor = *motor_commanded;
        let mut last: Option<Pose> = None;
        let mut first_step = f64::INFINITY;
        let mut step = f64::INFINITY;
        let mut axis = 0;
        for round in 0..ROUNDS {
            let look = self.look(situation, motor_commanded, &motor, &distortion);
            if let Some(last) = last {
                step = (look.seen.translation.vector - last.translation.vector)
                    .norm()
                    .max(rotation_angle(&(look.seen.rotation * last.rotation.inverse())));
                // `max` passes over what is not a number, so the pose itself is looked at.
                if !look.seen.translation.vector.iter().all(|v| v.is_finite()) {
                    return Err(EquilibriumError::NotFinite);
                }
                if step < STEP * share {
                    return Ok(Equilibrium { motor, wobj_from_tcp: look.seen, load: look.load, distortion });
                }
                if round == 1 {
                    first_step = step;
                }
                // A hundred times the first step and growing: it runs away.
                if step > 100.0 * first_step {
                    break;
                }
            }
            last = Some(look.seen);
            distortion = if share < 1.0 { distortion.towards(&look.distortion, share) } else { look.distortion };
            let next = motor_commanded + distortion.joints - travel.component_mul(&distortion.lost);
            axis = (next - motor).iamax() + 1;
            motor = next;
        }
        Err(EquilibriumError::NoEquilibrium { rounds: ROUNDS, step_mm: 1e3 * step, axis })
    }
}
