//! The travel of the joints along a motion: the direction in which each joint was last moved, and how far its friction has built up since it
//! reversed.
//!
//! With a presliding angle, friction follows the joint itself, which turns with its motor and with the twist of its gear under the cutting
//! force: a force that comes or goes turns friction too. Without one, travel is the direction of the commanded motion.

use super::arm::Arm;
use deflex_effects::{ParameterOwner, Presliding};
use deflex_robot::Joints;

/// Commanded motions smaller than this count as a stop, rad (`docs/effects.md`).
#[doc(hidden)]
pub const TRAVEL_THRESHOLD: f64 = 1e-7;

impl Arm {
    /// Travel of each joint after a motion to commanded motor angles and twists of the gears, rad, −1 to 1: the share of the lost motion that
    /// acts, with the sign of the direction.
    ///
    /// Without a presliding angle the travel is the sign of the motion, and stays the same at stops. With a presliding angle w, friction
    /// builds up as the joint turns: dz/dq = (1 − z·sgn q̇) / w (Dahl 1968). The solution over one motion is exact for any length, so that
    /// a motion in several steps ends with the same travel as in one.
    #[doc(hidden)]
    pub fn travel(&self, from: &Dragged, motor: &Joints, twist: &Joints) -> Joints {
        from.travel_to(motor, twist, &self.presliding())
    }

    /// The state after a motion from `last` to commanded motor angles and twists, rad; without travel for the first motion. `last` becomes the
    /// new state.
    #[doc(hidden)]
    pub fn go_on(&self, motor: Joints, twist: Joints, last: &mut Option<Dragged>) -> Dragged {
        let travel = last.as_ref().map_or_else(Joints::zeros, |last| self.travel(last, &motor, &twist));
        let there = Dragged { motor, twist, travel };
        *last = Some(there);
        there
    }

    /// Travel after a corrected motion. It depends on the command, and the command on it: `free + travel · lost`, rad. `programmed` is the
    /// travel of the motion as programmed, and `twist` the twist of the gears there, rad.
    ///
    /// Without a presliding angle, a direction is consistent if the command computed with it moves the joint in that direction. If both are
    /// consistent, the joint keeps its direction. With a presliding angle the command is a continuous function of the travel; the joint
    /// moves in the direction in which it would have to move with its previous travel.
    #[doc(hidden)]
    pub fn settled_travel(&self, from: &Dragged, to: Settling<'_>) -> Joints {
        let widths = self.presliding();
        let is_sharp = widths.is_sharp();
        Joints::from_fn(|i, _| {
            let joint = Joint {
                held: from.travel[i],
                programmed: to.programmed[i],
                free: to.free[i] - from.motor[i] + if is_sharp { 0.0 } else { to.twist[i] - from.twist[i] },
                lost: to.lost[i],
            };
            if is_sharp { joint.direction() } else { joint.built_up(widths.of(i)) }
        })
    }

    /// What is still unknown of each joint's travel after a motion by `step`, rad: 2 if it may have any sign, and 0 if it is known.
    /// `unknown` is that before the motion. Joints without friction count as known.
    #[doc(hidden)]
    pub fn unknown_travel(&self, unknown: &Joints, step: &Joints) -> Joints {
        let (widths, mut after) = (self.presliding(), Joints::zeros());
        for effect in self.effects.iter().filter(|effect| effect.presliding().is_some()) {
            for parameter in effect.parameters().iter().filter(|parameter| parameter.value != 0.0) {
                if let ParameterOwner::Axis(axis) = parameter.owner {
                    // The difference between the largest and the smallest travel that are possible.
                    let i = axis - 1;
                    after[i] = driven(unknown[i], step[i], widths.of(i)) - driven(0.0, step[i], widths.of(i));
                }
            }
        }
        after
    }

    /// Angles over which friction builds up after each joint has reversed, the same for all effects of the arm.
    #[doc(hidden)]
    pub fn presliding(&self) -> Presliding {
        self.effects.iter().find_map(|effect| effect.presliding()).unwrap_or_default()
    }
}

/// The joints after a motion.
#[derive(Clone, Copy, Debug)]
#[doc(hidden)]
pub struct Dragged {
    /// Commanded motor angles, rad.
    pub motor: Joints,
    /// Twists of the gears under the cutting force, rad, by their declared stiffness.
    pub twist: Joints,
    /// Travel, −1 to 1.
    pub travel: Joints,
}

/// The end of a motion to a corrected command: see [`Arm::settled_travel`].
#[derive(Clone, Copy)]
#[doc(hidden)]
pub struct Settling<'a> {
    pub free: &'a Joints,
    pub lost: &'a Joints,
    pub twist: &'a Joints,
    pub programmed: &'a Joints,
}

impl Dragged {
    /// Travel after a motion to commanded motor angles and twists of the gears, rad, with presliding angles.
    pub fn travel_to(&self, motor: &Joints, twist: &Joints, presliding: &Presliding) -> Joints {
        let is_sharp = presliding.is_sharp();
        let step = |i: usize| motor[i] - self.motor[i] + if is_sharp { 0.0 } else { twist[i] - self.twist[i] };
        Joints::from_fn(|i, _| driven(self.travel[i], step(i), presliding.of(i)))
    }
}

/// Travel of sharp friction after a motion from one set of motor angles to another, rad: the sign of the motion, or the travel `held` before it
/// where a joint does not move.
#[doc(hidden)]
pub fn direction(from: &Joints, to: &Joints, held: &Joints) -> Joints {
    Joints::from_fn(|i, _| driven(held[i], to[i] - from[i], 0.0))
}

/// Travel after a step, rad, from the travel `held` before it; `width` is the presliding angle, rad.
fn driven(held: f64, step: f64, width: f64) -> f64 {
    // NaN, which means that the previous position is not known, counts as a stop.
    let moves = step.abs() > if width > 0.0 { 0.0 } else { TRAVEL_THRESHOLD };
    match step.signum() {
        _ if !moves => held,
        limit if width > 0.0 => limit + (held - limit) * (-step.abs() / width).exp(),
        sign => sign,
    }
}

/// One joint in a motion to a corrected command.
struct Joint {
    held: f64,
    programmed: f64,
    /// Command without lost motion, relative to the previous command, rad.
    free: f64,
    lost: f64,
}

impl Joint {
    fn direction(&self) -> f64 {
        let Self { held, programmed, free, lost } = *self;
        let step = |travel: f64| free + travel * lost;
        let holds = |travel: f64| travel * step(travel) > TRAVEL_THRESHOLD;
        // The usual case: the joint keeps its direction, or stops.
        if holds(held) || step(held).abs() <= TRAVEL_THRESHOLD {
            return held;
        }
        // A joint that has not moved before, and that the program does not move, may be moved by the correction alone.
        let first = [-held, programmed, free.signum()].into_iter().find(|sign| *sign != 0.0).unwrap_or_default();
        [first, -first].into_iter().find(|&sign| sign != 0.0 && holds(sign)).unwrap_or(programmed)
    }

    /// The travel z(x) that builds up over the step x of its own command: x = free + z(x) · lost.
    fn built_up(&self, width: f64) -> f64 {
        /// Bisections after which a step of a radian is known to 1e-16 rad.
        const HALVINGS: usize = 54;
        let away = self.free + self.held * self.lost;
        let sign = away.signum();
        let short = |step: f64| sign * (self.free + driven(self.held, sign * step, width) * self.lost) > step;
        let (mut low, mut high) = (0.0, away.abs() + 2.0 * self.lost);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            if short(middle) { low = middle } else { high = middle }
        }
        driven(self.held, sign * high, width)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    #[test]
    fn friction_builds_up_over_the_presliding_angle() {
        // A long way in one direction, then one width back: 1 − 2 (1 − 1/e).
        let forward = driven(0.0, 1.0, 1e-3);
        assert_abs_diff_eq!(forward, 1.0, epsilon = 1e-12);
        assert_abs_diff_eq!(driven(forward, -1e-3, 1e-3), 2.0 / std::f64::consts::E - 1.0, epsilon = 1e-12);
    }

    /// A motor that stands still, and a cutting force that comes: 1 mrad of twist over a presliding angle of 1 mrad turns friction by 1 − 1/e.
    #[test]
    fn a_force_turns_friction_with_a_presliding_angle_alone() {
        let rest = Dragged { motor: Joints::zeros(), twist: Joints::zeros(), travel: Joints::zeros() };
        let twisted = |angle: f64| rest.travel_to(&rest.motor, &Joints::repeat(1e-3), &Presliding::alike(angle));
        assert_abs_diff_eq!(twisted(1e-3)[2], 1.0 - 1.0 / std::f64::consts::E, epsilon = 1e-12);
        assert_abs_diff_eq!(twisted(0.0)[2], 0.0);
    }

    #[test]
    fn a_motion_in_steps_ends_as_in_one() {
        let steps = [2e-4, 5e-4, 1e-4].into_iter().fold(-1.0, |held, step| driven(held, step, 1e-3));
        assert_abs_diff_eq!(steps, driven(-1.0, 8e-4, 1e-3), epsilon = 1e-15);
    }

    #[test]
    fn sharp_friction_is_the_sign_and_is_kept_through_stops() {
        assert_abs_diff_eq!(driven(0.0, -1e-3, 0.0), -1.0);
        assert_abs_diff_eq!(driven(-1.0, 1e-8, 0.0), -1.0);
    }

    /// A joint that has never moved, in a program that does not move it: the correction of 1e-4 rad moves it, and takes up the gap.
    #[test]
    fn a_joint_that_only_the_correction_moves_takes_up_its_gap() {
        let of = |free: f64| Joint { held: 0.0, programmed: 0.0, free, lost: 2e-4 }.direction();
        assert_abs_diff_eq!([of(1e-4), of(-1e-4), of(1e-8)][..], [1.0, -1.0, 0.0][..]);
    }

    #[test]
    fn a_command_moves_the_joint_by_what_builds_up_its_travel() {
        for (held, free) in [(1.0, -3e-4), (-1.0, 2e-4), (0.3, 1e-5), (-0.5, -1e-6), (1.0, 0.02)] {
            let (width, lost) = (3e-4, 2e-4);
            let travel = Joint { held, programmed: 1.0, free, lost }.built_up(width);
            assert_abs_diff_eq!(driven(held, free + travel * lost, width), travel, epsilon = 1e-9);
        }
    }
}
