use super::Number;
use super::block::Block;
use super::evaluation::Evaluation;
use super::model::Model;
use deflex_effects::{Deflection, Parts};
use deflex_lanes::{Frame, Mask, six, widest};
use deflex_robot::kinematics::{Six, dot};

/// The iteration of inverse equilibria: the commands that put the loaded TCPs on wanted poses.
///
/// If only joints yield, one evaluation is enough: at equilibrium the **actual** joints carry the load, so q_a = IK(wanted) gives the
/// torque, and q_c = q_a − K⁻¹ τ(q_a) is exact for finite deflections and for any spring curve. Effects that move the geometry or depend
/// on the command take a few iterations from there: each moves the pose that the nominal inverse solves by the remaining error of the
/// real arm. The force is that at the wanted pose in all of them.
#[derive(Default)]
pub(super) struct Inverse<R: Number> {
    /// Wanted TCPs in the work object.
    pub(super) wanted: Frame<R>,
    /// Whether `wanted` are the wanted poses of the block, at which the force laws are defined.
    pub(super) at_reference: bool,
    /// Direction of travel of each joint, −1 to 1.
    pub(super) travel: Six<R>,
    /// Actual motor angles, rad.
    pub(super) motor: Six<R>,
    /// Commanded motor angles without the compensation of lost motion, rad.
    pub(super) free: Six<R>,
    /// Lost motion to add in the direction of travel, rad.
    pub(super) lost: Six<R>,
    /// Deflection of the arms at the wanted poses.
    pub(super) under: Deflection<R>,
    /// The lanes whose command is found, and those whose command can still be found.
    pub(super) done: R::Mask,
    pub(super) open: R::Mask,
    /// Flange poses that the nominal inverse has to solve, base frame.
    to_solve: Frame<R>,
    /// Square of the last change of the commands, rad².
    pub(super) change: R,
}

/// Most iterations of a batch; the scalar solver takes over the targets that need more.
pub(super) const BATCH_ROUNDS: usize = 8;

/// A command is found when another iteration would change it by less than this, rad: 1e-9 mm at 3 m.
pub(super) const FOUND: f64 = 3e-13;

/// The smallest ratio of successive changes that is used for a prediction: rounding hides a faster convergence.
const TRUSTED: f64 = 1e-4;

impl<R: Number> Inverse<R> {
    /// Iterates from `motor`, the actual motor angles at which the nominal arm has its TCP at the wanted pose. `open` are the lanes to solve,
    /// `most` is the largest number of iterations. `invert` returns the motor angles, rad, of flange poses, near given ones, and the lanes
    /// in which it found them.
    ///
    /// # Errors
    /// Those of `invert`.
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
                let (motor, found) = invert(&self.to_solve, &self.motor)?;
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

    /// Evaluates the arms at their motor angles, and moves the poses to solve by the remaining error.
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
                inverse.to_solve = declared.without(&block.flange_from_tcp);
            }
            let part = parts.has(Parts::PART).then_some(inverse.under.part);
            inverse.to_solve = at.motion_to(&inverse.wanted, part).then(&inverse.to_solve);
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
            // The next change is estimated from the last two, with a ratio that rounding allows to be seen. The first iteration has none
            // before it. The comparison has no quotient, because a command that needs no correction changes by 0 each time.
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
