use super::Number;
use super::block::Block;
use super::evaluation::{Evaluation, STABLE};
use super::model::Model;
use crate::effects::{Deflection, Parts};
use crate::lanes::{Mask, SinCos, Vector, six, widest};
use crate::robot::NUDGE;
use crate::robot::kinematics::Six;

/// What a round is trusted to leave of what it finds, at least: a secant gains three digits, until what it did not see is all
/// that is left.
const TRUSTED: f64 = 0.03;

/// The rounds of forward equilibria: each puts the arms where the last round's loads would bend them, by a step along the
/// secant through the last two (Anderson 1965, with one round of memory): the depth of cut is nearly all that feeds back, so
/// that this is nearly Newton's step.
///
/// The force depends on where the cutter really is (Tang et al., Eqs 5, 9–11), for finite deflections. A lane that is done
/// stands still: what it comes to does not depend on how long others take.
#[derive(Default)]
pub(super) struct Forward<R: Number> {
    /// Actual motor angles without any deflection, rad.
    rigid: Six<R>,
    /// Direction of travel, −1, 0 or 1 a joint.
    pub(super) travel: Six<R>,
    /// By how much the arms yield.
    pub(super) under: Deflection<R>,
    /// The secant's mixing coefficient, zero where none was found.
    pub(super) mixing: R,
    /// Square of what was left by the evaluation that `under` comes from, and what rounds left of it.
    pub(super) left: R,
    pub(super) gain: R,
    /// Cutting force, base axes, N.
    pub(super) cut: Vector<R>,
    /// Where `under` is found.
    pub(super) done: R::Mask,
    /// Where the arm is near enough to `start` for sums of angles.
    pub(super) close: R::Mask,
    /// The most that a round has left of what it found, squared; 0 where none was seen yet.
    pub(super) most: R,
    /// `mixing` before the first round.
    first_mixing: R,
    /// Motor angles that the rounds begin at, rad, and the joints' sines and cosines there.
    start: Six<R>,
    start_joints: [SinCos<R>; 6],
    residual: Deflection<R>,
    before: Round<R>,
}

/// What a round found.
#[derive(Default)]
struct Round<R> {
    give: Deflection<R>,
    residual: Deflection<R>,
    /// Square of `residual`.
    size: R,
    /// What of the size of the round before it is.
    gain: R,
}

/// When rounds end and how they step.
#[derive(Clone, Copy)]
pub(super) struct Rules {
    /// What a round may add to the deflection, rad and m.
    pub(super) tolerance: f64,
    /// Whether the last step is taken without an evaluation where the two rounds before show what it would leave.
    pub(super) skip_last_evaluation: bool,
    /// Share of each step; below 1 without the secant.
    pub(super) relaxation: f64,
    /// Whether arms may go far from where the rounds began.
    pub(super) far: bool,
}

impl<R: Number> Forward<R> {
    /// Begins close to motor angles (rad), of commands whose offsets `at` has.
    pub(super) fn begin(&mut self, model: &Model<'_>, block: &Block<'_, R>, at: &mut Evaluation<R>) {
        widest!(<R: Number; 'a, 'b, 's> (
            forward: &'a mut Forward<R> = self,
            model: &'a Model<'b> = model,
            block: &'a Block<'s, R> = block,
            at: &'a mut Evaluation<R> = at,
        ) {
            forward.begin_here(model, block, at);
        });
    }

    #[inline(always)]
    fn begin_here(&mut self, model: &Model<'_>, block: &Block<'_, R>, at: &mut Evaluation<R>) {
        let offset = &at.offset;
        self.rigid = six!(i => block.site.commanded[i] + offset.joints[i] - self.travel[i] * offset.lost[i]);
        self.start = self.motor(model);
        at.turn_to(model, &self.start);
        self.start_joints = at.joints;
        (self.first_mixing, self.most) = (self.mixing, R::ZERO);
    }

    /// Actual motor angles, rad.
    #[inline(always)]
    pub(super) fn motor(&self, model: &Model<'_>) -> Six<R> {
        let Self { rigid, travel, under, .. } = self;
        if model.parts.has(Parts::LOST) {
            six!(i => rigid[i] + (under.joints[i] - travel[i] * under.lost[i]))
        } else {
            six!(i => rigid[i] + under.joints[i])
        }
    }

    /// Puts the arms where they would be bent, or where the rounds ended.
    pub(super) fn place(&mut self, model: &Model<'_>, block: &Block<'_, R>, at: &mut Evaluation<R>, rules: Rules) {
        widest!(<R: Number; 'a, 'b> (
            forward: &'a mut Forward<R> = self,
            model: &'a Model<'b> = model,
            at: &'a mut Evaluation<R> = at,
            rules: Rules = rules,
        ) {
            forward.turn_joints(model, at, rules);
        });
        at.place(model, block, &self.under);
    }

    #[inline(always)]
    fn turn_joints(&mut self, model: &Model<'_>, at: &mut Evaluation<R>, rules: Rules) {
        let motor = self.motor(model);
        let steps = model.robot.serial(&six!(i => motor[i] - self.start[i]));
        let mut close = self.close;
        for i in 0..6 {
            close = close & steps[i].abs().lt(NUDGE);
            at.joints[i] = self.start_joints[i].turned_by(steps[i]);
        }
        if !rules.far {
            self.close = close;
        } else if close.not().any() {
            let near = at.joints;
            at.turn_to(model, &motor);
            // A lane that is close comes to the same whatever the others do.
            for (joint, near) in at.joints.iter_mut().zip(&near) {
                joint.sin = close.select(near.sin, joint.sin);
                joint.cos = close.select(near.cos, joint.cos);
            }
        }
    }

    /// One evaluation and one step.
    pub(super) fn round(
        &mut self,
        number: usize,
        model: &Model<'_>,
        block: &Block<'_, R>,
        at: &mut Evaluation<R>,
        rules: Rules,
    ) {
        self.place(model, block, at, rules);
        at.cut(block);
        at.bear(model, block);
        widest!(<R: Number; 'a, 'b> (
            forward: &'a mut Forward<R> = self,
            model: &'a Model<'b> = model,
            at: &'a Evaluation<R> = at,
            rules: Rules = rules,
            number: usize = number,
        ) {
            forward.step(number, model, at, rules);
        });
    }

    #[inline(always)]
    fn step(&mut self, number: usize, model: &Model<'_>, at: &Evaluation<R>, rules: Rules) {
        let (parts, give, one) = (model.parts, &at.give, R::of(1.0));
        self.residual.mix(give, &self.under, parts, |_, give, under| give - under);
        let size = self.residual.dot(&self.residual, parts);
        let going = self.done.not();
        let before = &self.before;
        // Towards this round's answer, and from there a share of the way back to that of the round before.
        let (onwards, back, gain, gain_before);
        if number == 0 || rules.relaxation < 1.0 {
            // As if a round before had come here.
            let share = if rules.relaxation < 1.0 { R::of(rules.relaxation) } else { one - self.first_mixing };
            (onwards, back, gain, gain_before) = (share, R::ZERO, size / self.left, self.gain);
        } else {
            let both = self.residual.dot(&before.residual, parts);
            let apart = size - both * 2.0 + before.size;
            let mixing = (size - both) / apart;
            // Where rounds do not shrink by themselves the secant is not used: what runs away shall do so.
            let stable = R::ZERO.lt(apart) & mixing.ge(STABLE.start) & mixing.lt(STABLE.end);
            (onwards, back, gain, gain_before) = (one, stable.select(mixing, R::ZERO), size / before.size, before.gain);
            if number == 1 {
                let none = self.first_mixing.abs().lt(f64::MIN_POSITIVE);
                self.mixing = (going & none).select(back, self.mixing);
            }
            let more = self.most.lt(gain) & going;
            self.most = more.select(gain, self.most);
        }
        // The next round would leave too little to be evaluated, if it gains as much as the worse of the last two.
        let worse = gain.lt(gain_before).select(gain_before, gain);
        let worse = worse.lt(TRUSTED * TRUSTED).select(R::of(TRUSTED * TRUSTED), worse);
        let tolerance = rules.tolerance * rules.tolerance;
        let cut = &at.load.cut;
        self.cut = Vector::new(
            going.select(cut.x, self.cut.x),
            going.select(cut.y, self.cut.y),
            going.select(cut.z, self.cut.z),
        );
        let settled = self.done.or(size.lt(tolerance));
        let still = |now: R, next: R| settled.select(now, next);
        if number == 0 || rules.relaxation < 1.0 {
            self.under.mix(give, give, parts, |now, give, _| still(now, now + (give - now) * onwards));
        } else {
            self.under.mix(give, &before.give, parts, |now, give, before| still(now, give + back * (before - give)));
        }
        self.done = settled;
        if rules.skip_last_evaluation {
            self.done = settled.or((size * worse).lt(tolerance));
        }
        let before = &mut self.before;
        before.give.mix(give, give, parts, |_, give, _| give);
        before.residual.mix(&self.residual, give, parts, |_, residual, _| residual);
        (before.size, before.gain) = (size, gain);
    }

    /// Rounds until all of the wanted lanes are done, or `most` of them.
    pub(super) fn run(
        &mut self,
        model: &Model<'_>,
        block: &Block<'_, R>,
        at: &mut Evaluation<R>,
        (wanted, most, rules): (R::Mask, usize, Rules),
    ) {
        (self.done, self.close) = (wanted.not(), wanted);
        for number in 0..most {
            self.round(number, model, block, at, rules);
            if !self.done.not().any() {
                break;
            }
        }
    }

    /// Square of what the last round left, and how far its answer is from the one put in, rad, of a motor (0 to 5) of a lane.
    pub(super) fn last_step(&self, lane: usize) -> (f64, usize) {
        let steps = six!(i => self.before.residual.joints[i].lane(lane).abs());
        let most = (0..6).fold(0, |most, i| if steps[i] > steps[most] { i } else { most });
        (self.before.size.lane(lane), most)
    }
}
