use super::Number;
use super::block::Block;
use super::evaluation::Evaluation;
use super::model::Model;
use crate::effects::{Deflection, Parts};
use crate::lanes::{Frame, Mask, six, widest};
use crate::robot::kinematics::{Six, dot};

/// The rounds of inverse equilibria: which commands put the loaded TCPs on wanted poses.
///
/// Not an iteration where only joints yield: at equilibrium the **actual** joints carry the load, so with q_a = IK(wanted)
/// the torque is known and q_c = q_a − K⁻¹ τ(q_a), exact for finite deflections and for any joint curve. Effects that move the
/// geometry or follow the command take a few rounds from there: the pose that the nominal inverse solves is moved by
/// what the real arm missed. The force is that at the wanted pose, whatever the round.
#[derive(Default)]
pub(super) struct Inverse<R: Number> {
    /// Wanted TCPs in the work object.
    pub(super) wanted: Frame<R>,
    /// Whether those are the poses that the force laws take as theirs.
    pub(super) at_reference: bool,
    /// Direction of travel, −1, 0 or 1 a joint.
    pub(super) travel: Six<R>,
    /// Actual motor angles, rad.
    pub(super) motor: Six<R>,
    /// Commanded motor angles but for lost motion, rad.
    pub(super) free: Six<R>,
    /// Lost motion to add in the direction of travel, rad.
    pub(super) lost: Six<R>,
    /// By how much the arms yield there.
    pub(super) under: Deflection<R>,
    /// Where the command is found, and where it may be yet.
    pub(super) done: R::Mask,
    pub(super) open: R::Mask,
    /// Flange poses that the nominal inverse has solved.
    asked: Frame<R>,
    /// Square of the last change of the commands, rad².
    pub(super) change: R,
}

/// Rounds that a batch takes; the scalar solver takes more.
pub(super) const BATCH_ROUNDS: usize = 8;

/// Commands that would change by less than this in another round are found, rad: 1e-9 mm at 3 m.
pub(super) const FOUND: f64 = 3e-13;

/// Most that a round is trusted to gain: rounding hides more.
const TRUSTED: f64 = 1e-4;

impl<R: Number> Inverse<R> {
    /// From actual motor angles in `motor`, at which the nominal arm has its TCP at the wanted pose.
    ///
    /// `invert` gives motor angles, rad, of flange poses near others, where it can.
    pub(super) fn run<E>(
        &mut self,
        model: &Model<'_>,
        block: &mut Block<'_, R>,
        at: &mut Evaluation<R>,
        (open, most): (R::Mask, usize),
        mut invert: impl FnMut(&Frame<R>, &Six<R>) -> Result<(Six<R>, R::Mask), E>,
    ) -> Result<(), E> {
        (self.open, self.done, self.change) = (open, R::Mask::default(), R::of(f64::INFINITY));
        block.site.commanded = self.motor;
        self.under.clear(model.parts);
        let moves = model.parts.moves_geometry();
        let wanted = self.wanted;
        match block.resting().filter(|_| self.at_reference) {
            Some(force) => at.force = *force,
            None => at.cut_at(block, &wanted),
        }
        for number in 0..most {
            if number == 0 || moves {
                self.evaluate(number == 0, model, block, at);
            } else {
                at.set_offsets(model, block);
            }
            if moves {
                let (motor, found) = invert(&self.asked, &self.motor)?;
                let still = self.done;
                self.motor = six!(i => still.select(self.motor[i], motor[i]));
                self.open = self.open & found.or(still);
            }
            self.step(number, model, block, at);
            if model.is_explicit() || !(self.open & self.done.not()).any() {
                break;
            }
        }
        Ok(())
    }

    /// Evaluates the arms at their motor angles, and moves the poses to be solved by what was missed.
    fn evaluate(&mut self, first: bool, model: &Model<'_>, block: &Block<'_, R>, at: &mut Evaluation<R>) {
        at.set_offsets(model, block);
        widest!(<R: Number; 'a, 'b> (
            inverse: &'a Inverse<R> = self,
            model: &'a Model<'b> = model,
            at: &'a mut Evaluation<R> = at,
        ) {
            at.turn_to(model, &inverse.motor);
        });
        at.place(model, block, &self.under);
        at.bear(model, block);
        let (still, parts) = (self.done, model.parts);
        self.under.mix(&at.give, &at.give, parts, |now, give, _| still.select(now, give));
        if !parts.moves_geometry() {
            return;
        }
        at.place(model, block, &self.under);
        widest!(<R: Number; 'a, 's> (
            inverse: &'a mut Inverse<R> = self,
            block: &'a Block<'s, R> = block,
            at: &'a mut Evaluation<R> = at,
            parts: Parts = parts,
            first: bool = first,
        ) {
            if first {
                let declared = block.site.base_from_wobj.then(&inverse.wanted);
                inverse.asked = declared.without(&block.flange_from_tcp);
            }
            let part = parts.has(Parts::PART).then_some(inverse.under.part);
            inverse.asked = at.motion_to(&inverse.wanted, part).then(&inverse.asked);
        });
    }

    fn step(&mut self, number: usize, model: &Model<'_>, block: &mut Block<'_, R>, at: &mut Evaluation<R>) {
        widest!(<R: Number; 'a, 'b, 's> (
            inverse: &'a mut Inverse<R> = self,
            model: &'a Model<'b> = model,
            block: &'a mut Block<'s, R> = block,
            at: &'a mut Evaluation<R> = at,
            number: usize = number,
        ) {
            let Inverse { motor, free, lost, under, travel, done, change, .. } = inverse;
            let offset = &at.offset;
            let still = *done;
            let next = six!(i => motor[i] - (offset.joints[i] + under.joints[i]));
            *free = six!(i => still.select(free[i], next[i]));
            *lost = six!(i => still.select(lost[i], offset.lost[i] + under.lost[i]));
            let command = six!(i => free[i] + travel[i] * lost[i]);
            let commanded = &mut block.site.commanded;
            let steps = six!(i => command[i] - commanded[i]);
            *commanded = command;
            let now = dot(&steps, &steps);
            // A round gains what the last one did, or what rounding lets be seen; the first has none before it. Without a
            // quotient: a command that needs no correction at all changes by nothing in either round.
            let small = (FOUND / TRUSTED) * (FOUND / TRUSTED);
            let found = if number == 0 {
                R::Mask::default()
            } else {
                now.lt(small) & (*change * (FOUND * FOUND)).ge(now * now)
            };
            *change = still.select(*change, now);
            *done = if model.is_explicit() { inverse.open } else { done.or(found & inverse.open) };
        });
    }
}
