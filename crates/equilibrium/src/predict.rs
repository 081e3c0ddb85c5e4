use super::block::{Block, Setting, Site};
use super::evaluation::Evaluation;
use super::forward::{Forward, Rules};
use super::inverse::Inverse;
use super::model::Model;
use super::{Arm, EquilibriumError, Number};
use deflex_effects::{Deflection, Parts, Situation};
use deflex_robot::kinematics::{one, set};
use deflex_robot::{Joints, Pose, turn_between};
use nalgebra::Vector3;
use std::f64::consts::FRAC_1_SQRT_2;

/// The equilibrium of the loaded arm at a command.
///
/// # Examples
/// ```
/// # let (arm, situation, motor) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/arm.rs"));
/// use deflex_robot::Joints;
///
/// let loaded = arm.predict(&situation, &motor, &Joints::zeros()).expect("an equilibrium");
/// let off = loaded.wobj_from_tcp.translation.vector - situation.wobj_from_tcp.translation.vector;
/// assert!(off.norm() > 1e-5); // m: the arm yields
/// ```
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Equilibrium {
    /// Actual motor angles, rad.
    pub motor: Joints,
    /// Actual TCP in the actual work object, m.
    pub wobj_from_tcp: Pose,
    /// The loads there.
    pub load: Load,
    /// Lost motion there, rad, not negative.
    pub(super) lost: Joints,
    pub(super) under: Deflection<f64>,
}

/// The loads on an arm.
///
/// # Examples
/// ```
/// # let (arm, situation, motor) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/arm.rs"));
/// use deflex_robot::Joints;
///
/// let load = arm.predict(&situation, &motor, &Joints::zeros()).expect("an equilibrium").load;
/// println!("{:.0} N, {:.0} N·m at motor 2", load.cut.norm(), load.torque[1]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Load {
    /// Cutting force on the tool at the TCP, base axes, N.
    pub cut: Vector3<f64>,
    /// Torques of the cutting force and the weights at the motors, N·m, in motor coordinates (τ = Jᵀ F).
    pub torque: Joints,
}

impl Default for Load {
    fn default() -> Self {
        Self { cut: Vector3::zeros(), torque: Joints::zeros() }
    }
}

impl Load {
    pub(super) fn of(at: &Evaluation<f64>) -> Self {
        Self { cut: at.load.cut.lane(0), torque: at.load.torque.into() }
    }
}

/// For results that are differentiated: 1e-9 mm at 3 m, confirmed by an evaluation.
pub(super) const EXACT: Rules = Rules { tolerance: 3e-13, skip_last_evaluation: false, relaxation: 1.0, far: true };

/// For reports: 6e-9 mm at 3 m, less than a hundredth of the last printed digit.
pub(super) const PRINTED: Rules = Rules { tolerance: 2e-12, skip_last_evaluation: true, relaxation: 1.0, far: false };

/// Most iterations of one attempt. Real arms take six with the secant, and twenty without it.
const MOST_EVALUATIONS: usize = 200;

/// An iteration that ends with steps of the TCP below this, m or rad, counts as converged: a hundredth of a micrometre. The tables of the
/// force have steps of a millionth at their ends, and the iteration can alternate between the two sides of such a step.
const LIMIT_CYCLE_TOLERANCE: f64 = 1e-8;

/// Relaxation of the successive attempts. Strong negative feedback is stable on the machine, but a plain iteration overshoots; a smaller
/// relaxation damps it.
const RELAXATIONS: [f64; 4] = [1.0, 0.5, 0.2, 0.05];

/// The memory of the solvers, some kilobytes for each lane.
#[derive(Default)]
pub(super) struct Workspace<'a, R: Number> {
    pub(super) block: Block<'a, R>,
    pub(super) at: Evaluation<R>,
    pub(super) forward: Forward<R>,
    pub(super) inverse: Inverse<R>,
}

impl<'a> Workspace<'a, f64> {
    pub(super) fn at(site: &Site<'a>) -> Self {
        let mut workspace = Self::default();
        workspace.block.set(0, site);
        workspace.block.first(1);
        workspace
    }

    /// Sets the command, motor angles in rad, and the direction of travel of each joint.
    fn command(&mut self, model: &Model<'_>, (motor, travel): (&Joints, &Joints)) {
        set(&mut self.block.site.commanded, 0, motor);
        set(&mut self.forward.travel, 0, travel);
        self.at.set_offsets(model, &self.block);
    }

    /// Iterates from a starting value, with smaller and smaller relaxation until an attempt converges.
    fn settle(&mut self, model: &Model<'_>, near: &WarmStart, rules: Rules) -> Result<(), EquilibriumError> {
        let mut failure = EquilibriumError::NotFinite;
        for relaxation in RELAXATIONS {
            match self.attempt(model, near, Rules { relaxation, far: true, ..rules }) {
                Err(error @ EquilibriumError::NoEquilibrium { .. }) => failure = error,
                done => return done,
            }
        }
        Err(failure)
    }

    fn attempt(&mut self, model: &Model<'_>, near: &WarmStart, rules: Rules) -> Result<(), EquilibriumError> {
        let Self { block, at, forward, .. } = self;
        forward.under.clear(model.parts);
        forward.under.joints = near.under.into();
        (forward.mixing, forward.left, forward.gain) = (near.mixing, near.left, near.gain);
        (forward.done, forward.close) = (false, true);
        forward.begin(model, block, at);
        let (mut first_step, mut step) = (f64::INFINITY, f64::INFINITY);
        let mut before = at.wobj_from_tcp();
        for round in 0..MOST_EVALUATIONS {
            forward.round(round, model, block, at, rules);
            let seen = at.wobj_from_tcp();
            if forward.done {
                if rules.skip_last_evaluation {
                    forward.place(model, block, at, rules);
                }
                return Ok(());
            }
            // Every comparison with NaN is false, so the pose has to be checked itself.
            if !seen.origin.lane(0).iter().all(|v| v.is_finite()) {
                return Err(EquilibriumError::NotFinite);
            }
            if round > 0 {
                // For small turns the chord equals the angle.
                let (now, last) = (seen.lane(0), before.lane(0));
                let turn = FRAC_1_SQRT_2 * (now.rotation.matrix() - last.rotation.matrix()).norm();
                step = (now.translation.vector - last.translation.vector).norm().max(turn);
                if round == 1 {
                    first_step = step;
                }
                // A step a hundred times as large as the first one: the iteration diverges.
                if step > 100.0 * first_step {
                    break;
                }
            }
            before = seen;
        }
        if rules.relaxation >= 1.0 && step < LIMIT_CYCLE_TOLERANCE {
            return Ok(());
        }
        Err(EquilibriumError::NoEquilibrium {
            rounds: MOST_EVALUATIONS,
            step_mm: 1e3 * step,
            axis: forward.last_step(0).1 + 1,
        })
    }
}

impl Arm {
    /// Forward equilibrium: the actual pose at commanded motor angles (rad).
    ///
    /// `travel` is the direction of travel of each joint into the target, −1 to 1. The force depends on the actual position of the cutter
    /// (Tang et al., Eqs 5, 9–11), for finite deflections: each iteration puts the arm where the loads of the previous one bend it.
    ///
    /// # Errors
    /// There is no equilibrium, or it is not finite.
    pub fn predict(
        &self,
        situation: &Situation,
        motor_commanded: &Joints,
        travel: &Joints,
    ) -> Result<Equilibrium, EquilibriumError> {
        let (model, setting) = (Model::new(self), Setting::of(situation));
        let mut workspace = Workspace::at(&Site::of(situation, &setting));
        workspace.command(&model, (motor_commanded, travel));
        workspace.settle(&model, &WarmStart::default(), EXACT)?;
        let Workspace { at, forward, .. } = workspace;
        Ok(Equilibrium {
            motor: one(&forward.motor(&model), 0),
            wobj_from_tcp: at.wobj_from_tcp().lane(0),
            load: Load::of(&at),
            lost: Joints::from(at.offset.lost) + Joints::from(forward.under.lost),
            under: forward.under,
        })
    }

    /// [`Arm::predict`] with the accuracy of a report, from a starting value; `command` is the motor angles, rad, and the direction of travel.
    #[doc(hidden)]
    pub fn land(
        &self,
        situation: &Situation,
        command: (&Joints, &Joints),
        near: &WarmStart,
    ) -> Result<PredictedPose, EquilibriumError> {
        let (model, setting) = (Model::new(self), Setting::of(situation));
        let mut workspace = Workspace::at(&Site::of(situation, &setting));
        workspace.command(&model, command);
        workspace.settle(&model, near, PRINTED)?;
        let Workspace { at, forward, .. } = &workspace;
        let (wanted, seen) = (&situation.wobj_from_tcp, at.wobj_from_tcp().lane(0));
        Ok(PredictedPose {
            shift: seen.translation.vector - wanted.translation.vector,
            turn: turn_between(&wanted.rotation, &seen.rotation),
            axis: -seen.rotation.matrix().column(2),
            cut: situation.base_from_wobj.rotation.inverse_transform_vector(&at.load.cut.lane(0)),
            part: model.parts.has(Parts::PART).then(|| forward.under.part.lane(0).norm()),
            mixing: forward.mixing,
            gain: 1.0,
        })
    }
}

/// The part of an [`Equilibrium`] that reports use, in the axes of the actual work object.
#[derive(Clone, Copy, Debug)]
#[doc(hidden)]
pub struct PredictedPose {
    /// Actual minus wanted TCP, m.
    pub shift: Vector3<f64>,
    /// Rotation vector from the wanted orientation to the actual one, rad.
    pub turn: Vector3<f64>,
    /// Actual tool axis, tip to spindle.
    pub axis: Vector3<f64>,
    /// Cutting force on the tool, N.
    pub cut: Vector3<f64>,
    /// By how much the part yields, m; `None` if no effect describes it.
    pub part: Option<f64>,
    /// Mixing coefficient of the secant, as a start for targets nearby; 0 if none was found.
    pub mixing: f64,
    /// The slowest convergence of an iteration: ratio of successive squared residuals; 1 if it is not known.
    pub gain: f64,
}

/// Starting values of a forward equilibrium. They save iterations and change no result.
#[derive(Clone, Copy, Debug)]
#[doc(hidden)]
pub struct WarmStart {
    /// Estimated deflection of the joints, rad.
    pub(crate) under: Joints,
    /// See [`PredictedPose`].
    pub(crate) mixing: f64,
    /// Squared residual of the evaluation from which this comes, rad²; 0 if there was none.
    pub(crate) left: f64,
    /// See [`PredictedPose`].
    pub(crate) gain: f64,
}

impl Default for WarmStart {
    fn default() -> Self {
        Self { under: Joints::zeros(), mixing: 0.0, left: 0.0, gain: 1.0 }
    }
}
