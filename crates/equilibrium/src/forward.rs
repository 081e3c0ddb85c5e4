use super::Number;
use super::block::Block;
use super::evaluation::{Evaluation, STABLE};
use super::model::Model;
use deflex_effects::{Deflection, Parts};
use deflex_lanes::{Mask, SinCos, Vector, six, widest};
use deflex_robot::NUDGE;
use deflex_robot::kinematics::Six;

/// The smallest ratio of successive residuals that is used to predict the next one. A secant step can reduce the
/// residual by three digits, but parts of it that the secant does not reduce remain.
const TRUSTED: f64 = 0.03;

/// The iteration of forward equilibria. Each step puts the arms where the loads of the last two steps would bend them, on the secant
/// through both (Anderson 1965, with a memory of one step). Nearly all feedback is that of the depth of cut, so this is nearly Newton's
/// method.
///
/// The force depends on the actual position of the cutter (Tang et al., Eqs 5, 9–11), for finite deflections. A lane that has converged
/// does not change any more, so its result does not depend on how long other lanes take.
#[derive(Default)]
pub(super) struct Forward<R: Number> {
    /// Actual motor angles without any deflection, rad.
    rigid: Six<R>,
    /// Direction of travel of each joint, −1 to 1.
    pub(super) travel: Six<R>,
    /// The deflection that the iteration has reached.
    pub(super) under: Deflection<R>,
    /// Mixing coefficient of the secant; 0 if none was found.
    pub(super) mixing: R,
    /// Squared residual of the evaluation from which the starting value comes, and the ratio of successive squared residuals there.
    pub(super) left: R,
    pub(super) gain: R,
    /// Cutting force, base axes, N.
    pub(super) cut: Vector<R>,
    /// Lanes that have converged.
    pub(super) done: R::Mask,
    /// Lanes so near to `start` that sines and cosines may be found from those at `start` by a series.
    pub(super) close: R::Mask,
    /// The largest ratio of successive squared residuals; 0 before the second step.
    pub(super) most: R,
    /// `mixing` before the first step.
    first_mixing: R,
    /// Motor angles at which the iteration starts, rad, and the sines and cosines of the joints there.
    start: Six<R>,
    start_joints: [SinCos<R>; 6],
    residual: Deflection<R>,
    before: Round<R>,
}

/// The result of one step.
#[derive(Default)]
struct Round<R> {
    give: Deflection<R>,
    residual: Deflection<R>,
    /// Square of `residual`.
    size: R,
    /// Ratio of `size` to that of the step before.
    gain: R,
}

/// When the iteration ends, and how it steps.
#[derive(Clone, Copy)]
pub(super) struct Rules {
    /// Size of the residual at which a lane has converged, rad and m.
    pub(super) tolerance: f64,
    /// Whether a lane has also converged when the last two residuals predict that the next one is below the tolerance.
    pub(super) skip_last_evaluation: bool,
    /// Share of each step that is taken. Below 1 the secant is not used.
    pub(super) relaxation: f64,
    /// Whether arms may move far from the start of the iteration.
    pub(super) far: bool,
}

impl<R: Number> Forward<R> {
    /// Starts the iteration at the commands of the block, whose offsets `at` has, and at the deflection `under`.
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

    /// Puts the arms into the pose of the deflection `under`.
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
            // A lane that is close gets the same numbers whether or not other lanes are.
            for (joint, near) in at.joints.iter_mut().zip(&near) {
                joint.sin = close.select(near.sin, joint.sin);
                joint.cos = close.select(near.cos, joint.cos);
            }
        }
    }

    /// One evaluation and one step; `number` counts from 0.
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
        // The step goes to the deflection under the loads of this step, and from there a share back to that of the step before.
        let (onwards, back, gain, gain_before);
        if number == 0 || rules.relaxation < 1.0 {
            // The first step uses the mixing coefficient of the starting value, as if there had been a step before it.
            let share = if rules.relaxation < 1.0 { R::of(rules.relaxation) } else { one - self.first_mixing };
            (onwards, back, gain, gain_before) = (share, R::ZERO, size / self.left, self.gain);
        } else {
            let both = self.residual.dot(&before.residual, parts);
            let apart = size - both * 2.0 + before.size;
            let mixing = (size - both) / apart;
            // If the residuals do not shrink, the secant is not used: a divergence has to show.
            let stable = R::ZERO.lt(apart) & mixing.ge(STABLE.start) & mixing.lt(STABLE.end);
            (onwards, back, gain, gain_before) = (one, stable.select(mixing, R::ZERO), size / before.size, before.gain);
            if number == 1 {
                let none = self.first_mixing.abs().lt(f64::MIN_POSITIVE);
                self.mixing = (going & none).select(back, self.mixing);
            }
            let more = self.most.lt(gain) & going;
            self.most = more.select(gain, self.most);
        }
        // The next residual is estimated with the slower convergence of the last two steps.
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

    /// Steps until all of the wanted lanes have converged, `most` at most.
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

    /// Of a lane, the squared residual of the last step, rad², and the motor (0 to 5) with the largest residual.
    pub(super) fn last_step(&self, lane: usize) -> (f64, usize) {
        let steps = six!(i => self.before.residual.joints[i].lane(lane).abs());
        let most = (0..6).fold(0, |most, i| if steps[i] > steps[most] { i } else { most });
        (self.before.size.lane(lane), most)
    }
}
