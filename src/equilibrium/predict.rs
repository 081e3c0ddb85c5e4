use super::arm::{Look, Near};
use super::{Arm, EquilibriumError};
use crate::effects::{Distortion, Load, Parts, Situation};
use crate::robot::{Joints, Pose, turn_between};
use nalgebra::Vector3;
use std::f64::consts::FRAC_1_SQRT_2;

/// Where a command ends up.
#[derive(Clone, Debug)]
#[non_exhaustive]
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

/// When the iteration ends.
#[derive(Clone, Copy)]
struct Enough {
    /// What a round adds to the deflection then, rad and m.
    left: f64,
    /// Whether the last step is taken without a look where the two rounds before show what it would leave.
    foreseen: bool,
}

/// 1e-9 mm at 3 m, seen by a look.
const EXACT: Enough = Enough { left: 3e-13, foreseen: false };

/// 6e-9 mm at 3 m, less than a hundredth of the last printed digit.
const PRINTED: Enough = Enough { left: PRINTED_LEFT, foreseen: true };
pub(in crate::equilibrium) const PRINTED_LEFT: f64 = 2e-12;

/// What a round is trusted to leave of what it finds, at least: a secant gains three digits, until what it did not see is all that
/// is left.
pub(in crate::equilibrium) const TRUSTED: f64 = 0.03;

/// Rounds of one attempt. With the secant real arms take six; where it is not used, twenty.
const ROUNDS: usize = 200;

/// Steps of the TCP that go on and on and are this small, m or rad, are no running away: the force itself has steps of a
/// millionth where its table ends, and the tool goes to and fro over one. A hundredth of a micrometre.
const RESTLESS: f64 = 1e-8;

/// Secants that are used: loop gains of ±0.9.
pub(in crate::equilibrium) const TAME: std::ops::Range<f64> = -9.0..0.475;

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
        let near = self.near(motor_commanded, Joints::zeros());
        let mut rounds = Rounds::default();
        let there = self.settle(situation, (motor_commanded, travel), &near, EXACT, &mut rounds)?;
        let Rounds { mut rounds, distortion } = rounds;
        let load = std::mem::take(&mut rounds[there.last].look.load);
        Ok(Equilibrium { motor: there.motor, wobj_from_tcp: there.seen, load, distortion })
    }

    /// As much of it as a report asks, to its printed digits, from what is known close by. `rounds` is room to work in,
    /// which is used again.
    pub(crate) fn land(
        &self,
        situation: &Situation,
        command: (&Joints, &Joints),
        near: &Near,
        rounds: &mut Rounds,
    ) -> Result<Landing, EquilibriumError> {
        let there = self.settle(situation, command, near, PRINTED, rounds)?;
        let (wanted, seen) = (&situation.wobj_from_tcp, &there.seen);
        let cut = rounds.rounds[there.last].look.load.cut;
        Ok(Landing {
            shift: seen.translation.vector - wanted.translation.vector,
            turn: turn_between(&wanted.rotation, &seen.rotation),
            axis: -seen.rotation.matrix().column(2),
            cut: situation.base_from_wobj.rotation.inverse_transform_vector(&cut),
            share: there.known.share,
            gain: 1.0,
        })
    }

    /// Attempts with a smaller and smaller share, until one settles.
    fn settle(
        &self,
        situation: &Situation,
        command: (&Joints, &Joints),
        near: &Near,
        enough: Enough,
        rounds: &mut Rounds,
    ) -> Result<Settled, EquilibriumError> {
        let mut failure = EquilibriumError::NotFinite;
        for share in SHARES {
            match self.attempt(situation, command, near, share, enough, rounds) {
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
        let near = self.turns(&motor);
        let mut look = Look::default();
        for _ in 0..ROUNDS {
            self.look(situation, motor_commanded, &near, &motor, &distortion, distortion.parts(), &mut look);
            std::mem::swap(&mut distortion, &mut look.distortion);
            motor = motor_commanded + distortion.joints - travel.component_mul(&distortion.lost);
        }
        self.look(situation, motor_commanded, &near, &motor, &distortion, distortion.parts(), &mut look);
        look.seen
    }

    fn attempt(
        &self,
        situation: &Situation,
        (motor_commanded, travel): (&Joints, &Joints),
        near: &Near,
        share: f64,
        enough: Enough,
        rounds: &mut Rounds,
    ) -> Result<Settled, EquilibriumError> {
        rounds.begin(&near.deflection);
        let Rounds { rounds: [first, second], distortion } = rounds;
        let (mut now, mut before) = (first, second);
        let mut motor = motor_commanded + near.deflection;
        let mut known = *near;
        let mut first_step = f64::INFINITY;
        let mut step = f64::INFINITY;
        let mut axis = 0;
        for round in 0..ROUNDS {
            self.look(situation, motor_commanded, &near.turns, &motor, distortion, before.parts, &mut now.look);
            let Round { look, left, size, gain, parts } = &mut *now;
            // Once in there, always in there: a part that was looked at may go back to zero.
            *parts = look.distortion.parts().or(before.parts);
            left.set_difference(&look.distortion, distortion, *parts);
            *size = left.dot(left, *parts).sqrt();
            let same_lost = look.distortion.lost == distortion.lost;
            // Zero before the first look, which is no lost motion's fault.
            if *size < enough.left && (round > 0 || same_lost) {
                known.deflection = distortion.joints;
                return Ok(Settled { motor, seen: look.seen, last: round % 2, known });
            }
            // `max` and comparisons pass over what is not a number, so the pose itself is looked at.
            if !look.seen.translation.vector.iter().all(|v| v.is_finite()) {
                return Err(EquilibriumError::NotFinite);
            }
            if round > 0 {
                step = before.step(&look.seen);
                if round == 1 {
                    first_step = step;
                }
                // A hundred times the first step and growing: it runs away.
                if step > 100.0 * first_step {
                    break;
                }
            }
            let mut sure = false;
            *gain = 1.0;
            if share < 1.0 {
                distortion.go_towards(&look.distortion, share, *parts);
            } else if round == 0 {
                // As if a round before had come here.
                distortion.go_towards(&look.distortion, 1.0 - near.share, *parts);
            } else {
                let back = before.secant(left, *parts);
                if round == 1 && near.share == 0.0 {
                    known.share = back;
                }
                distortion.set(&look.distortion, *parts);
                distortion.go_towards(&before.look.distortion, back, *parts);
                // The next round would leave too little to be looked at, if it gains as much as the worse of the last two.
                *gain = *size / before.size;
                let foreseen = *size * gain.max(before.gain).max(TRUSTED);
                sure = enough.foreseen && foreseen < enough.left && same_lost && *parts == Parts::Joints;
            }
            let moved = motor_commanded + distortion.joints - travel.component_mul(&distortion.lost);
            if sure {
                known.deflection = distortion.joints;
                let seen = self.seen_near(situation, &near.turns, &moved, &mut look.frames);
                return Ok(Settled { motor: moved, seen, last: round % 2, known });
            }
            axis = (moved - motor).iamax() + 1;
            motor = moved;
            std::mem::swap(&mut now, &mut before);
        }
        if share >= 1.0 && step < RESTLESS {
            known.deflection = distortion.joints;
            return Ok(Settled { motor, seen: before.look.seen, last: (ROUNDS - 1) % 2, known });
        }
        Err(EquilibriumError::NoEquilibrium { rounds: ROUNDS, step_mm: 1e3 * step, axis })
    }
}

/// Where a command ends up, as far as a report asks, in the axes of the actual work object.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Landing {
    /// Actual minus wanted TCP, m.
    pub(crate) shift: Vector3<f64>,
    /// Rotation vector from the wanted orientation to the actual one, rad.
    pub(crate) turn: Vector3<f64>,
    /// Actual tool axis, tip to spindle.
    pub(crate) axis: Vector3<f64>,
    /// Cutting force on the tool, N.
    pub(crate) cut: Vector3<f64>,
    /// For starts close by, see [`Near`].
    pub(crate) share: f64,
    /// The most that a round left of what it found, squared; 1 where that is not known.
    pub(crate) gain: f64,
}

/// What is known of an equilibrium beforehand.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Foreseen {
    /// Actual minus commanded motor angles but for lost motion, about, rad.
    pub(crate) deflection: Joints,
    /// See [`Near`].
    pub(crate) share: f64,
    /// What the look that this comes from had left, rad², or 0.
    pub(crate) left: f64,
    /// See [`Landing`].
    pub(crate) gain: f64,
}

impl Default for Foreseen {
    fn default() -> Self {
        Self { deflection: Joints::zeros(), share: 0.0, left: 0.0, gain: 1.0 }
    }
}

/// Where an attempt came to.
struct Settled {
    motor: Joints,
    seen: Pose,
    /// Which of the two rounds was the last.
    last: usize,
    known: Near,
}

/// Room for the rounds of an iteration, some kilobytes.
#[derive(Default)]
pub(crate) struct Rounds {
    /// In turn this one and the one before.
    rounds: [Round; 2],
    distortion: Distortion,
}

impl Rounds {
    /// As if nothing had been here.
    fn begin(&mut self, deflection: &Joints) {
        // What was never looked at is still zero.
        if self.rounds.iter().any(|round| round.parts == Parts::All) {
            *self = Self::default();
        }
        self.distortion = Distortion { joints: *deflection, ..Distortion::default() };
    }
}

/// A round of the iteration.
#[derive(Default)]
struct Round {
    look: Look,
    /// By how much the distortion that the loads there make differs from the one that they were taken at.
    left: Distortion,
    /// Its size, rad and m alike.
    size: f64,
    /// What of the size of the round before it is.
    gain: f64,
    /// What of both is not zero.
    parts: Parts,
}

impl Round {
    /// How far the TCP has moved since, m or rad.
    fn step(&self, seen: &Pose) -> f64 {
        let last = &self.look.seen;
        // The chord of a small turn is its angle.
        let turn = FRAC_1_SQRT_2 * (seen.rotation.matrix() - last.rotation.matrix()).norm();
        (seen.translation.vector - last.translation.vector).norm().max(turn)
    }

    /// The share of the way back to this round's answer that leaves least of `left`, what the round behind it has left
    /// (Anderson 1965, with one round of memory): the depth of cut is nearly all that feeds back, so that a secant along it
    /// is nearly Newton's step. Zero where the rounds do not shrink by themselves: what runs away shall do so.
    fn secant(&self, left: &Distortion, parts: Parts) -> f64 {
        // |left − before|² and left · (left − before).
        let product = |a: &Distortion, b: &Distortion| a.dot(b, parts);
        let (now, both, before) = (product(left, left), product(left, &self.left), product(&self.left, &self.left));
        let size = now - 2.0 * both + before;
        let share = (now - both) / size;
        if size > 0.0 && TAME.contains(&share) { share } else { 0.0 }
    }
}
