use super::EightArm;
use super::block::Block;
use super::look::Look;
#[cfg(doc)]
use crate::equilibrium::Foreseen;
use crate::equilibrium::Landing;
use crate::equilibrium::predict::{PRINTED_LEFT, TAME, TRUSTED};
use crate::lanes::{Frame, Lanes, Mask, Vector, six, widest};
use crate::robot::eight::turn_of;
use crate::robot::{EightJoints, EightTurns, NUDGE, turns_between};

/// Rounds before the plain way is asked: with the secant real arms take four.
const ROUNDS: usize = 8;

/// The rounds of eight forward equilibria: those of [`predict`](crate::equilibrium::predict), in lanes.
#[derive(Default)]
pub(super) struct Rounds {
    /// Commanded motor angles less what is lost, rad.
    pub(super) motor: EightJoints,
    /// Actual minus commanded motor angles but for lost motion, rad.
    pub(super) bend: EightJoints,
    /// The secant's way back, zero where none was found.
    pub(super) share: Lanes,
    /// What was left by the look that `bend` comes from, and what rounds left of it; see [`Foreseen`].
    pub(super) left: Lanes,
    pub(super) gain: Lanes,
    /// Cutting force, base axes, N.
    pub(super) cut: Vector,
    /// Where `bend` is found.
    pub(super) done: Mask,
    /// Where the arm is near enough to `start` for sums of angles.
    pub(super) close: Mask,
    /// `share` before the first round.
    first_share: Lanes,
    /// The most that a round has left of what it found, squared; 0 where none was seen yet.
    pub(super) most: Lanes,
    /// Motor angles that the rounds begin at, rad.
    start: EightJoints,
    start_turns: EightTurns,
    before: Round,
}

/// What a round found.
#[derive(Clone, Copy, Default)]
struct Round {
    give: EightJoints,
    left: EightJoints,
    /// Square of `left`.
    size: Lanes,
    /// What of the size of the round before it is.
    gain: Lanes,
}

/// Eight of [`Landing`], but for what rounds know.
#[derive(Default)]
pub(super) struct EightLanding {
    /// Wanted orientation.
    pub(super) wanted: Frame,
    /// Actual TCP in the work object.
    pub(super) seen: Frame,
    pub(super) shift: Vector,
    pub(super) turn: Vector,
    /// Where `turn` is right.
    pub(super) small: Mask,
    pub(super) cut: Vector,
}

impl Rounds {
    /// Begins where `motor` and `bend` are.
    pub(super) fn begin(&mut self, arm: &EightArm<'_>) {
        widest!(<'a, 'b> (arm: &'a EightArm<'b> = arm, rounds: &'a mut Rounds = self) {
            let start = six!(i => rounds.motor[i] + rounds.bend[i]);
            rounds.begin_at(&start, &arm.robot.turns(&start));
        });
    }

    /// Begins close to motor angles (rad) whose turns are known.
    #[inline(always)]
    pub(super) fn begin_at(&mut self, start: &EightJoints, turns: &EightTurns) {
        (self.start, self.start_turns) = (*start, *turns);
    }

    /// Rounds until all of the wanted lanes are done.
    pub(super) fn run(&mut self, arm: &EightArm<'_>, block: &Block<'_>, look: &mut Look, wanted: Mask) {
        (self.done, self.close, self.first_share, self.most) = (wanted.not(), wanted, self.share, Lanes::ZERO);
        for number in 0..ROUNDS {
            self.round(number, arm, block, look);
            if !self.done.not().any() {
                break;
            }
        }
    }

    fn round(&mut self, number: usize, arm: &EightArm<'_>, block: &Block<'_>, look: &mut Look) {
        widest!(<'a, 'b> (
            rounds: &'a mut Rounds = self,
            arm: &'a EightArm<'b> = arm,
            block: &'a Block<'b> = block,
            look: &'a mut Look = look,
        ) {
            rounds.nudge(arm, look);
            look.place(arm, block);
        });
        look.cut(block);
        widest!(<'a, 'b> (
            rounds: &'a mut Rounds = self,
            arm: &'a EightArm<'b> = arm,
            block: &'a Block<'b> = block,
            look: &'a mut Look = look,
            first: bool = number == 0,
            second: bool = number == 1,
        ) {
            look.bear(arm, block);
            if first {
                rounds.step_by_share(look);
            } else {
                rounds.step_by_secant(look, second);
            }
        });
    }

    /// Where the TCP is seen in the end.
    pub(super) fn land(&mut self, arm: &EightArm<'_>, block: &Block<'_>, look: &mut Look, landings: &mut EightLanding) {
        widest!(<'a, 'b> (
            rounds: &'a mut Rounds = self,
            arm: &'a EightArm<'b> = arm,
            block: &'a Block<'b> = block,
            look: &'a mut Look = look,
            landings: &'a mut EightLanding = landings,
        ) {
            rounds.nudge(arm, look);
            landings.seen = look.seen(arm, &block.actual);
            landings.shift = landings.seen.origin - block.wanted;
            (landings.turn, landings.small) = turns_between(&landings.wanted, &landings.seen);
            landings.cut = block.declared.base_from_wobj.turn_back(rounds.cut);
        });
    }

    /// Where a lane has come to, if it has.
    #[inline(always)]
    pub(super) fn landing(&self, landings: &EightLanding, lane: usize) -> Option<Landing> {
        (self.done.lane(lane) && self.close.lane(lane)).then(|| {
            let most = self.most.lane(lane);
            Landing {
                shift: landings.shift.lane(lane),
                turn: turn_of(lane, (&landings.turn, landings.small), &landings.wanted, &landings.seen),
                axis: -landings.seen.z.lane(lane),
                cut: landings.cut.lane(lane),
                share: self.share.lane(lane),
                gain: if most > 0.0 { most } else { 1.0 },
            }
        })
    }

    #[inline(always)]
    fn nudge(&mut self, arm: &EightArm<'_>, look: &mut Look) {
        let moved = six!(i => self.motor[i] + self.bend[i] - self.start[i]);
        let steps = arm.robot.serial_from_motor(&moved);
        for i in 0..6 {
            self.close = self.close & steps[i].abs().lt(NUDGE);
            look.turns[i] = self.start_turns[i].nudged(steps[i]);
        }
    }

    /// As if a round before had come here.
    #[inline(always)]
    fn step_by_share(&mut self, look: &Look) {
        let left = six!(i => look.give[i] - self.bend[i]);
        let onwards = Lanes::of(1.0) - self.first_share;
        let next = six!(i => self.bend[i] + left[i] * onwards);
        let size = dot(&left, &left);
        let gain = size / self.left;
        self.go(look, left, size, next, gain, self.gain);
    }

    /// Along the secant through this round and the one before, see [`TAME`].
    #[inline(always)]
    fn step_by_secant(&mut self, look: &Look, second: bool) {
        let left = six!(i => look.give[i] - self.bend[i]);
        let before = &self.before;
        let (now, both) = (dot(&left, &left), dot(&left, &before.left));
        let size = now - both * 2.0 + before.size;
        let share = (now - both) / size;
        let tame = Lanes::ZERO.lt(size) & share.ge(TAME.start) & share.lt(TAME.end);
        let back = tame.select(share, Lanes::ZERO);
        if second {
            self.share = self.first_share.abs().lt(f64::MIN_POSITIVE).select(back, self.first_share);
        }
        let next = six!(i => look.give[i] + back * (before.give[i] - look.give[i]));
        let gain = now / before.size;
        let more = self.most.lt(gain) & self.done.not();
        self.most = more.select(gain, self.most);
        self.go(look, left, now, next, gain, before.gain);
    }

    #[inline(always)]
    fn go(&mut self, look: &Look, left: EightJoints, size: Lanes, next: EightJoints, gain: Lanes, before: Lanes) {
        // The next round would leave too little to be looked at, if it gains as much as the worse of the last two.
        let worse = gain.lt(before).select(before, gain);
        let worse = worse.lt(TRUSTED * TRUSTED).select(Lanes::of(TRUSTED * TRUSTED), worse);
        let sure = (size * worse).lt(PRINTED_LEFT * PRINTED_LEFT);
        self.cut = Vector::new(
            self.done.select(self.cut.x, look.cut.x),
            self.done.select(self.cut.y, look.cut.y),
            self.done.select(self.cut.z, look.cut.z),
        );
        let settled = self.done.or(size.lt(PRINTED_LEFT * PRINTED_LEFT));
        self.bend = six!(i => settled.select(self.bend[i], next[i]));
        self.done = settled.or(sure);
        self.before = Round { give: look.give, left, size, gain };
    }
}

#[inline(always)]
pub(super) fn dot(a: &EightJoints, b: &EightJoints) -> Lanes {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4] + a[5] * b[5]
}
