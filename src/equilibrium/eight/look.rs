use super::EightArm;
use super::block::{Block, Frames};
use super::rounds::dot;
use crate::equilibrium::predict::TAME;
use crate::lanes::{Frame, Lanes, Mask, Vector, six, widest};
use crate::robot::{EightJoints, EightTurns, NUDGE};

/// Eight of [`Feedback`](crate::equilibrium::Feedback).
#[derive(Default)]
pub(super) struct EightFeedback {
    pub(super) yielding: EightJoints,
    pub(super) share: Lanes,
    pub(super) lift: Lanes,
}

/// Eight arms looked at: where they are, what acts on them, by how much their joints yield to it.
#[derive(Default)]
pub(super) struct Look {
    pub(super) turns: EightTurns,
    frames: [Frame; 6],
    /// Base frame, m.
    tip: Vector,
    /// From where it should be, feed frame, m.
    shift: Vector,
    /// Tip to spindle, feed frame.
    axis: Vector,
    /// Feed frame, N.
    force: Vector,
    /// Base axes, N.
    pub(super) cut: Vector,
    /// rad
    pub(super) give: EightJoints,
}

impl Look {
    /// Frames of the links and the place of the cutter, at `turns`.
    #[inline(always)]
    pub(super) fn place(&mut self, arm: &EightArm<'_>, block: &Block<'_>) {
        let frames = arm.robot.chain(&self.turns);
        let flange = &frames[5];
        let Frames { base_from_wobj, flange_from_tcp } = &block.actual;
        self.tip = flange.point(flange_from_tcp.origin);
        let seen = base_from_wobj.turn_back(self.tip - base_from_wobj.origin);
        self.shift = block.wobj_from_feed.turn_back(seen - block.wanted);
        // The tool axis, tip to spindle, is −z of the TCP frame.
        let axis = base_from_wobj.turn_back(flange.turn(flange_from_tcp.z));
        self.axis = block.wobj_from_feed.turn_back(axis) * -1.0;
        self.frames = frames;
    }

    /// The cutting force there.
    pub(super) fn cut(&mut self, block: &Block<'_>) {
        block.forces(&self.shift, &self.axis, &mut self.force);
    }

    /// By how much the joints yield to it and to the weights.
    #[inline(always)]
    pub(super) fn bear(&mut self, arm: &EightArm<'_>, block: &Block<'_>) {
        let frames = &self.frames;
        let cut = block.declared.base_from_wobj.turn(block.wobj_from_feed.turn(self.force)) * block.factor;
        // Moments are about the centre of the wrist, where the last three axes meet, then about each joint.
        let mut about = frames[4].origin;
        let (mut force, mut moment) = (cut, (self.tip - about).cross(cut));
        let gravity = Vector::of(&arm.gravity);
        let mut torque = [Lanes::ZERO; 6];
        for i in (0..6).rev() {
            let frame = &frames[i];
            if i < 3 {
                moment = moment + (about - frame.origin).cross(force);
                about = frame.origin;
            }
            for weights in &arm.weights {
                let lever = (frame.origin - about) * weights.mass[i] + frame.turn(Vector::of(&weights.first_moment[i]));
                force = force + gravity * weights.mass[i];
                moment = moment + lever.cross(gravity);
                if i == 5 {
                    let held = if weights.tool { block.payload + block.tool_mass } else { block.payload };
                    let weight = gravity * held;
                    force = force + weight;
                    moment = moment + (frame.point(block.tool_cog) - about).cross(weight);
                }
            }
            torque[i] = frame.z.dot(moment);
        }
        let torque = arm.robot.motor_torque_from_serial(&torque);
        for i in 0..6 {
            self.give[i] = torque[i] * arm.compliance[i] + arm.offset[i];
        }
        self.cut = cut;
    }

    /// How the depth of cut feeds back here, where the tip should be, to which the nominal arm comes `aside` of these motor
    /// angles, rad.
    #[inline(always)]
    pub(super) fn feedback(&self, arm: &EightArm<'_>, block: &Block<'_>, aside: &EightJoints) -> EightFeedback {
        let in_base = |v: Vector| block.declared.base_from_wobj.turn(v);
        let slope = in_base(block.wobj_from_feed.turn(block.slope)) * block.factor;
        let normal = in_base(block.wobj_from_feed.z);
        // What the tip does as a joint turns, along the normal, and its torque as the tip is lifted.
        let levers = six!(i => self.frames[i].z.cross(self.tip - self.frames[i].origin));
        let lifts = arm.robot.motor_torque_from_serial(&six!(i => levers[i].dot(normal)));
        let torques = arm.robot.motor_torque_from_serial(&six!(i => levers[i].dot(slope)));
        let yielding = six!(i => torques[i] * arm.compliance[i]);
        let around = dot(&lifts, &yielding);
        let share = around / (around - 1.0);
        let tame = share.ge(TAME.start) & share.lt(TAME.end);
        let share = tame.select(share, Lanes::ZERO);
        let lift = dot(&lifts, &six!(i => self.give[i] + aside[i])) * (Lanes::of(1.0) - share);
        EightFeedback { yielding: six!(i => tame.select(yielding[i], Lanes::ZERO)), share, lift }
    }

    /// All of it at motor angles (rad), those of the wanted poses.
    pub(super) fn at(&mut self, arm: &EightArm<'_>, block: &Block<'_>, motor: &EightJoints) {
        widest!(<'a, 'b> (
            arm: &'a EightArm<'b> = arm,
            block: &'a Block<'b> = block,
            motor: &'a EightJoints = motor,
            look: &'a mut Look = self,
        ) {
            look.turns = arm.robot.turns(motor);
            look.place(arm, block);
        });
        match block.resting() {
            Some(force) => self.force = *force,
            None => self.cut(block),
        }
        widest!(<'a, 'b> (
            arm: &'a EightArm<'b> = arm,
            block: &'a Block<'b> = block,
            look: &'a mut Look = self,
        ) {
            look.bear(arm, block);
        });
    }

    /// The TCP in the work object at `turns`, of these frames.
    #[inline(always)]
    pub(super) fn seen(&self, arm: &EightArm<'_>, frames: &Frames) -> Frame {
        seen(arm, frames, &self.turns)
    }

    /// As the controller believes, where the joints are back by as much as they yield, and whether that is surely so.
    #[inline(always)]
    pub(super) fn relieved(&self, arm: &EightArm<'_>, block: &Block<'_>) -> (Frame, Mask) {
        let steps = arm.robot.serial_from_motor(&six!(i => -self.give[i]));
        let mut close = steps[0].abs().lt(NUDGE);
        for step in &steps[1..] {
            close = close & step.abs().lt(NUDGE);
        }
        (seen(arm, &block.declared, &six!(i => self.turns[i].nudged(steps[i]))), close)
    }
}

/// The TCP in the work object.
#[inline(always)]
fn seen(arm: &EightArm<'_>, frames: &Frames, turns: &EightTurns) -> Frame {
    frames.base_from_wobj.back_to(&arm.robot.chain(turns)[5].then(&frames.flange_from_tcp))
}
