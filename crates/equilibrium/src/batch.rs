//! Forward and inverse equilibria of as many targets at once as there are lanes. Targets that do not converge here go to the scalar
//! solver. The forward equilibrium starts from the [`Feedback`] of the evaluation at the wanted pose, which saves iterations and changes no
//! result.

use super::Arm;
use super::block::{Setting, Site};
use super::command::{Feedback, InverseSolution};
use super::evaluation::{self, Evaluation};
use super::forward::{Forward, Rules};
use super::inverse::{self, Inverse};
use super::model::Model;
use super::predict::{EXACT, Equilibrium, PRINTED, PredictedPose, WarmStart, Workspace};
use deflex_effects::{Deflection, Parts};
use deflex_lanes::{Frame, LaneMask, Lanes, Mask, Real, Vector, WIDTH, six, widest};
use deflex_robot::batch::turn_of;
use deflex_robot::kinematics::{Six, dot, one, set};
use deflex_robot::{BatchSolutions, Joints, Pose, turns_between};

/// Iterations before the scalar solver takes over. Real arms take four with the secant.
const BATCH_ROUNDS: usize = 8;

/// An arm for which many targets are solved at once.
#[derive(Debug)]
#[doc(hidden)]
pub struct Batch<'a> {
    model: Model<'a>,
}

/// A command whose actual pose is to be computed.
#[doc(hidden)]
pub struct Given<'a, 'b> {
    pub site: Site<'a>,
    /// Commanded motor angles, rad.
    pub motor: &'b Joints,
    /// Direction of travel of each joint, −1 to 1.
    pub travel: &'b Joints,
    pub near: WarmStart,
}

/// The results of [`Batch::aim`] for a target.
#[doc(hidden)]
pub struct Aimed {
    /// The command ([`Arm::command_from`]).
    pub aim: InverseSolution,
    /// The TCP of the nominal arm in the work object at the command; `None` if the command depends on the travel.
    pub nominal: Option<Pose>,
    /// The pose of the loaded arm without a correction ([`Arm::land`]).
    pub uncorrected: PredictedPose,
}

/// A command and an equilibrium of a slightly different arm there, from which the solution starts.
#[derive(Clone, Copy)]
#[doc(hidden)]
pub struct Nearby<'a, 'b> {
    pub site: Site<'a>,
    /// Commanded motor angles, rad.
    pub motor: &'b Joints,
    /// Direction of travel of each joint, −1 to 1.
    pub travel: &'b Joints,
    pub from: &'b Settled,
}

/// The part of an equilibrium from which slightly different arms start.
#[derive(Clone, Copy, Debug)]
#[doc(hidden)]
pub struct Settled {
    /// Actual TCP in the actual work object, m.
    pub wobj_from_tcp: Pose,
    under: Deflection<f64>,
    /// See [`PredictedPose`].
    mixing: f64,
}

impl From<Equilibrium> for Settled {
    fn from(there: Equilibrium) -> Self {
        Self { wobj_from_tcp: there.wobj_from_tcp, under: there.under, mixing: 0.0 }
    }
}

/// The memory in which batches are solved, some kilobytes that are reused.
#[derive(Default)]
#[doc(hidden)]
pub struct Room<'a> {
    workspace: Workspace<'a, Lanes>,
    /// Motor angles of the nominal arm at the wanted poses, rad.
    at: Six<Lanes>,
    feedback: evaluation::Feedback<Lanes>,
    nominal: Frame,
    predicted_poses: PredictedPoses,
    pub found: BatchSolutions,
    /// Starting values of `count` lanes, see [`Room::near`].
    from: Deflection<Lanes>,
    mixing: Lanes,
    count: usize,
}

/// The poses of [`PredictedPose`], lane by lane.
#[derive(Default)]
struct PredictedPoses {
    /// Actual TCP in the work object.
    seen: Frame,
    shift: Vector,
    turn: Vector,
    /// Lanes in which `turn` is small enough to be valid.
    small: LaneMask,
    cut: Vector,
    /// Whether an effect describes how the part yields.
    has_part: bool,
}

impl PredictedPoses {
    /// Reads the poses that the iteration has reached.
    fn take(&mut self, model: &Model<'_>, workspace: &mut Workspace<'_, Lanes>) {
        let Workspace { block, at, forward, .. } = workspace;
        forward.place(model, block, at, PRINTED);
        self.has_part = model.parts.has(Parts::PART);
        widest!(<'a> (
            forward: &'a Forward<Lanes> = forward,
            at: &'a Evaluation<Lanes> = at,
            wanted: &'a Frame = &block.wanted,
            base_from_wobj: &'a Frame = &block.site.base_from_wobj,
            predicted_poses: &'a mut PredictedPoses = self,
        ) {
            predicted_poses.seen = at.wobj_from_tcp();
            predicted_poses.shift = predicted_poses.seen.origin - wanted.origin;
            (predicted_poses.turn, predicted_poses.small) = turns_between(wanted, &predicted_poses.seen);
            predicted_poses.cut = base_from_wobj.turn_back(forward.cut);
        });
    }

    /// The pose of a lane; `None` if the lane did not converge.
    #[inline(always)]
    fn predicted(&self, workspace: &Workspace<'_, Lanes>, lane: usize) -> Option<PredictedPose> {
        let forward = &workspace.forward;
        let finite = (self.shift.x.lane(lane) + self.shift.y.lane(lane) + self.shift.z.lane(lane)).is_finite();
        if !(forward.done.lane(lane) && forward.close.lane(lane) && finite) {
            return None;
        }
        let most = forward.most.lane(lane);
        Some(PredictedPose {
            shift: self.shift.lane(lane),
            turn: turn_of(lane, (&self.turn, self.small), &workspace.block.wanted, &self.seen),
            axis: -self.seen.z.lane(lane),
            cut: self.cut.lane(lane),
            part: self.has_part.then(|| forward.under.part.lane(lane).norm()),
            mixing: forward.mixing.lane(lane),
            gain: if most > 0.0 { most } else { 1.0 },
        })
    }
}

impl<'a> Batch<'a> {
    pub fn new(arm: &'a Arm) -> Self {
        Self { model: Model::new(arm) }
    }

    /// Solves up to eight targets. `wanted` gives the site of a lane, the motor angles (rad) of the nominal arm there, and the direction of
    /// travel. [`Room::aimed`] has the results.
    pub fn aim<'s, 'm>(
        &self,
        room: &mut Room<'s>,
        count: usize,
        wanted: impl Fn(usize) -> (Site<'s>, &'m Joints, &'m Joints),
    ) {
        for lane in 0..count {
            let (site, at, travel) = wanted(lane);
            room.workspace.block.set(lane, &site);
            set(&mut room.at, lane, at);
            set(&mut room.workspace.inverse.travel, lane, travel);
        }
        self.solve_commands(room, count);
    }

    /// The computation of [`Batch::aim`]. Like those of the other public functions, it has no type parameters: it is compiled here alone,
    /// and not again in each crate that gives closures.
    fn solve_commands(&self, room: &mut Room<'_>, count: usize) {
        let model = &self.model;
        let Room { workspace, at: nominal_motor, feedback, nominal, predicted_poses, .. } = room;
        let Workspace { block, at, forward, inverse } = workspace;
        block.first(count);
        (inverse.motor, inverse.wanted, inverse.at_reference) = (*nominal_motor, block.wanted, true);
        let valid = LaneMask::first(count);
        let invert = |base_from_flange: &Frame, near: &Six<Lanes>| -> Result<_, std::convert::Infallible> {
            let Some(robot) = &model.inverse else { return Ok((*near, LaneMask::default())) };
            let mut found = (*near, LaneMask::default());
            widest!(<'a, 'b> (
                robot: &'a deflex_robot::BatchArm<'b> = robot,
                base_from_flange: &'a Frame = base_from_flange,
                near: &'a Six<Lanes> = near,
                found: &'a mut (Six<Lanes>, LaneMask) = &mut found,
            ) {
                *found = robot.nearest(base_from_flange, near);
            });
            Ok(found)
        };
        // The inverse returns no error: lanes without a solution stay open.
        let _ = inverse.run(model, block, at, (valid, inverse::BATCH_ROUNDS), invert);
        let valid = inverse.done;
        block.site.commanded = *nominal_motor;
        forward.travel = inverse.travel;
        widest!(<'a, 'b, 's> (
            model: &'a Model<'b> = model,
            block: &'a super::block::Block<'s, Lanes> = block,
            at: &'a mut Evaluation<Lanes> = at,
            inverse: &'a Inverse<Lanes> = inverse,
            forward: &'a mut Forward<Lanes> = forward,
            feedback: &'a mut evaluation::Feedback<Lanes> = feedback,
            nominal: &'a mut Frame = nominal,
        ) {
            let Inverse { motor, free, lost, under, travel, .. } = inverse;
            let commanded = &block.site.commanded;
            let rest = six!(i => motor[i] - free[i] - travel[i] * lost[i]);
            *feedback = at.feedback(model, block, &six!(i => commanded[i] + rest[i] - motor[i]));
            *nominal = evaluation::nominal(model, block, free);
            forward.under = *under;
            for i in 0..6 {
                forward.under.joints[i] = under.joints[i] + feedback.yielding[i] * feedback.lift;
            }
            (forward.mixing, forward.left, forward.gain) =
                (feedback.mixing, dot(&under.joints, &under.joints), Lanes::from(1.0));
        });
        if model.follows_command {
            at.set_offsets(model, block);
        }
        forward.begin(model, block, at);
        forward.run(model, block, at, (valid, BATCH_ROUNDS, PRINTED));
        predicted_poses.take(model, workspace);
    }

    /// Computes the TCP of the nominal arm in the work object, for up to eight motor angles (rad). [`Room::nominal`] has the results.
    pub fn nominal<'s>(&self, room: &mut Room<'s>, count: usize, given: impl Fn(usize) -> (&'s Setting, Joints)) {
        for lane in 0..count {
            let (setting, motor) = given(lane);
            room.workspace.block.set_setting(lane, setting);
            set(&mut room.at, lane, &motor);
        }
        self.place_nominal(room);
    }

    /// The computation of [`Batch::nominal`].
    fn place_nominal(&self, room: &mut Room<'_>) {
        let Room { workspace: Workspace { block, .. }, nominal, at, .. } = room;
        widest!(<'a, 'b, 's> (
            model: &'a Model<'b> = &self.model,
            block: &'a super::block::Block<'s, Lanes> = block,
            motor: &'a Six<Lanes> = at,
            nominal: &'a mut Frame = nominal,
        ) {
            *nominal = evaluation::nominal(model, block, motor);
        });
    }

    /// [`Arm::land`] for up to eight commands. [`Room::landed`] has the results.
    pub fn land<'s, 'm>(&self, room: &mut Room<'s>, count: usize, given: impl Fn(usize) -> Given<'s, 'm>) {
        let Workspace { block, forward, .. } = &mut room.workspace;
        forward.under.clear(self.model.parts);
        for lane in 0..count {
            let Given { site, motor, travel, near } = given(lane);
            block.set(lane, &site);
            set(&mut block.site.commanded, lane, motor);
            set(&mut forward.travel, lane, travel);
            set(&mut forward.under.joints, lane, &near.under);
            forward.mixing.set(lane, near.mixing);
            forward.left.set(lane, near.left);
            forward.gain.set(lane, near.gain);
        }
        self.settle_from(room, count, BATCH_ROUNDS, PRINTED);
        room.predicted_poses.take(&self.model, &mut room.workspace);
    }

    /// Solves the commands of the first `count` lanes from the deflections that the room has, in at most `most` iterations.
    fn settle_from(&self, room: &mut Room<'_>, count: usize, most: usize, rules: Rules) {
        let model = &self.model;
        let Workspace { block, at, forward, .. } = &mut room.workspace;
        block.first(count);
        at.set_offsets(model, block);
        forward.begin(model, block, at);
        forward.run(model, block, at, (LaneMask::first(count), most, rules));
    }

    /// [`Arm::predict`] for up to eight commands (motor angles, rad, and directions of travel), with the same bits. `put` receives those that
    /// converge.
    pub fn settle<'s, 'm>(
        &self,
        room: &mut Room<'s>,
        count: usize,
        given: impl Fn(usize) -> (Site<'s>, &'m Joints, &'m Joints),
        mut put: impl FnMut(usize, Settled),
    ) {
        /// Twice as many iterations as arms take that converge.
        const SETTLING_ROUNDS: usize = 20;
        let Workspace { block, forward, .. } = &mut room.workspace;
        for lane in 0..count {
            let (site, motor, travel) = given(lane);
            block.set(lane, &site);
            set(&mut block.site.commanded, lane, motor);
            set(&mut forward.travel, lane, travel);
        }
        forward.under.clear(self.model.parts);
        forward.mixing = Lanes::default();
        self.settle_from(room, count, SETTLING_ROUNDS, EXACT);
        let Workspace { at, forward, .. } = &room.workspace;
        let seen = at.wobj_from_tcp();
        for lane in (0..count).filter(|&lane| forward.done.lane(lane)) {
            let (under, mixing) = (forward.under.lane(lane), forward.mixing.lane(lane));
            put(lane, Settled { wobj_from_tcp: seen.lane(lane), under, mixing });
        }
    }

    /// The TCP in the actual work object at the commands that [`Room::near`] has set.
    ///
    /// A fixed number of iterations from the known equilibrium of another arm. They leave a thousandth of the difference of the two arms,
    /// which is enough for derivatives.
    pub fn resolve_from_nearby(&self, room: &mut Room<'_>, mut put: impl FnMut(usize, Pose)) {
        self.iterate_from_nearby(room);
        let seen = room.workspace.at.wobj_from_tcp();
        (0..room.count).for_each(|lane| put(lane, seen.lane(lane)));
    }

    /// The computation of [`Batch::resolve_from_nearby`].
    fn iterate_from_nearby(&self, room: &mut Room<'_>) {
        const DIFFERENCE_ROUNDS: usize = 2;
        let model = &self.model;
        let Workspace { block, at, forward, .. } = &mut room.workspace;
        (forward.under, forward.mixing) = (room.from, room.mixing);
        at.set_offsets(model, block);
        forward.begin(model, block, at);
        forward.close = LaneMask::first(WIDTH);
        for _ in 0..DIFFERENCE_ROUNDS {
            forward.done = LaneMask::default();
            forward.round(0, model, block, at, EXACT);
        }
        forward.place(model, block, at, EXACT);
    }
}

impl<'a> Room<'a> {
    /// The results of [`Batch::aim`] for a lane; `None` if it did not converge.
    #[inline(always)]
    pub fn aimed(&self, lane: usize) -> Option<Aimed> {
        let Self { workspace, feedback, nominal, .. } = self;
        let inverse = &workspace.inverse;
        let uncorrected = self.landed(lane).filter(|_| inverse.done.lane(lane))?;
        let lost = one(&inverse.lost, lane);
        let feedback = Feedback {
            under: one(&inverse.under.joints, lane),
            yielding: one(&feedback.yielding, lane),
            mixing: feedback.mixing.lane(lane),
            lift: feedback.lift.lane(lane),
        };
        let (motor, free) = (one(&inverse.motor, lane), one(&inverse.free, lane));
        Some(Aimed {
            aim: InverseSolution { motor, free, lost, feedback },
            nominal: (lost == Joints::zeros()).then(|| nominal.lane(lane)),
            uncorrected,
        })
    }

    /// Motor angles (rad) and TCP of [`Batch::nominal`] for a lane.
    #[inline(always)]
    pub fn nominal(&self, lane: usize) -> (Joints, Pose) {
        (one(&self.at, lane), self.nominal.lane(lane))
    }

    /// The pose of [`Batch::land`] for a lane; `None` if it did not converge.
    #[inline(always)]
    pub fn landed(&self, lane: usize) -> Option<PredictedPose> {
        self.predicted_poses.predicted(&self.workspace, lane)
    }

    /// Sets up to eight commands with known equilibria of another arm. Any number of arms can then be solved with
    /// [`Batch::resolve_from_nearby`].
    pub fn near(&mut self, near: &[Nearby<'a, '_>]) {
        let Workspace { block, forward, .. } = &mut self.workspace;
        for (lane, Nearby { site, motor, travel, from }) in near.iter().enumerate() {
            block.set(lane, site);
            set(&mut block.site.commanded, lane, motor);
            set(&mut forward.travel, lane, travel);
            self.from.set(lane, &from.under);
            self.mixing.set(lane, from.mixing);
        }
        block.first(near.len());
        self.count = near.len();
    }
}
