//! Friction in the joints along the commanded motion: on which side of its gap each joint is dragged, and how far it has built up.

use super::arm::Arm;
use crate::robot::Joints;

/// Commanded motions smaller than this are stops, rad (`docs/effects.md`).
pub(crate) const TRAVEL_THRESHOLD: f64 = 1e-7;

impl Arm {
    /// Travel of each joint after a commanded motion, in −1 … 1: by how much lost motion pulls it against its direction.
    ///
    /// `held` is the travel before. Sharp friction takes the sign of the motion, and keeps it through stops. With a presliding
    /// angle w, friction builds up as the joint turns: dz/dq = (1 − z·sgn q̇) / w (Dahl 1968), whose solution over one motion is
    /// exact for any length of it, so that a motion in several steps ends as it does in one.
    pub(crate) fn travel(&self, previous: &Joints, now: &Joints, held: &Joints) -> Joints {
        Dragged { motor: *previous, travel: *held }.travel_to(now, self.presliding_rad())
    }

    /// Goes on to commanded motor angles, rad; the first have no travel.
    pub(crate) fn go_on(&self, motor: Joints, last: &mut Option<Dragged>) -> Dragged {
        let travel = last.map_or_else(Joints::zeros, |last| self.travel(&last.motor, &motor, &last.travel));
        let there = Dragged { motor, travel };
        *last = Some(there);
        there
    }

    /// Travel after a corrected motion, whose command depends on it: the command is `free + travel · lost`, rad, and `programmed` the
    /// travel of the motion as programmed.
    ///
    /// Of sharp friction a direction holds if the command made with it moves that way; of two that hold, the joint keeps the one that
    /// it has. With a presliding angle the command is a continuous function of the travel, and the direction is that in which a joint
    /// with the travel before would have to move.
    pub(crate) fn settled_travel(&self, from: &Dragged, free: &Joints, lost: &Joints, programmed: &Joints) -> Joints {
        let width = self.presliding_rad();
        Joints::from_fn(|i, _| {
            let joint =
                Joint { held: from.travel[i], programmed: programmed[i], free: free[i] - from.motor[i], lost: lost[i] };
            if width > 0.0 { joint.built_up(width) } else { joint.direction() }
        })
    }

    /// Angle over which friction builds up after a joint turns back, rad: one for the arm; 0 where it is sharp.
    pub(crate) fn presliding_rad(&self) -> f64 {
        self.effects.iter().filter_map(|effect| effect.presliding_rad()).fold(0.0, f64::max)
    }
}

/// Where the joints were commanded to, rad, and their travel there.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Dragged {
    pub(crate) motor: Joints,
    pub(crate) travel: Joints,
}

impl Dragged {
    /// Travel after a motion to commanded motor angles, with friction that builds up over an angle (rad).
    pub(crate) fn travel_to(&self, motor: &Joints, presliding_rad: f64) -> Joints {
        Joints::from_fn(|i, _| driven(self.travel[i], motor[i] - self.motor[i], presliding_rad))
    }
}

/// Travel after a step, rad, from the travel before.
fn driven(held: f64, step: f64, width: f64) -> f64 {
    // Also where it is not known from where the joint comes: NaN is a stop.
    let moves = step.abs() > if width > 0.0 { 0.0 } else { TRAVEL_THRESHOLD };
    match step.signum() {
        _ if !moves => held,
        limit if width > 0.0 => limit + (held - limit) * (-step.abs() / width).exp(),
        sign => sign,
    }
}

/// One joint on its way to a corrected command.
struct Joint {
    held: f64,
    programmed: f64,
    /// Command without lost motion, from the command before, rad.
    free: f64,
    lost: f64,
}

impl Joint {
    fn direction(&self) -> f64 {
        let Self { held, programmed, free, lost } = *self;
        let step = |travel: f64| free + travel * lost;
        let holds = |travel: f64| travel * step(travel) > TRAVEL_THRESHOLD;
        // Most often it goes on.
        if holds(held) || step(held).abs() <= TRAVEL_THRESHOLD {
            return held;
        }
        let other = if held == 0.0 { programmed } else { -held };
        [other, -other].into_iter().find(|&sign| sign != 0.0 && holds(sign)).unwrap_or(programmed)
    }

    /// The travel z whose command moves the joint by the step x that builds up z: x = free + z(x) · lost.
    fn built_up(&self, width: f64) -> f64 {
        /// Halvings after which a step of a radian is known to 1e-16 rad.
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

    #[test]
    fn a_command_moves_the_joint_by_what_builds_up_its_travel() {
        for (held, free) in [(1.0, -3e-4), (-1.0, 2e-4), (0.3, 1e-5), (-0.5, -1e-6), (1.0, 0.02)] {
            let (width, lost) = (3e-4, 2e-4);
            let travel = Joint { held, programmed: 1.0, free, lost }.built_up(width);
            assert_abs_diff_eq!(driven(held, free + travel * lost, width), travel, epsilon = 1e-9);
        }
    }
}
