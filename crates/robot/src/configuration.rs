//! Computes configurations (confdata, S and T, CONFIG) from motor angles, in the notation of the controllers.

use super::{Joints, Robot};
use deflex_program::{Conf, Confdata, Config, StatusAndTurn};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// ABB's quarter-turn index of an axis: 0 for 0…90°, 1 for 90…180°, −1 for 0…−90° (exactly −90° is −2).
///
/// `int(θ/90)` for θ ≥ 0, `int(θ/90 − 1)` for θ < 0 (ABB RAPID reference manual, confdata).
#[must_use]
pub(crate) fn quarter_turn(angle: f64) -> i32 {
    let quarters = angle / FRAC_PI_2;
    #[allow(clippy::cast_possible_truncation)]
    let index = if angle >= 0.0 { quarters.trunc() } else { (quarters - 1.0).trunc() } as i32;
    index
}

/// Angles that differ from half a turn by at most this, rad, count as half a turn: FANUC counts 180° ± 0.0005° in turn 1 (measured on a
/// virtual controller: GitHub, LeroyDu56/CrossArm, validation, section 14).
const HALF_TURN: f64 = 0.0005 / 180.0 * PI;

/// FANUC's turn number of an axis: 0 between −180° and 180°, 1 from 180° on, −1 from −180° down.
fn whole_turn(angle: f64) -> i32 {
    #[allow(clippy::cast_possible_truncation)]
    let turns = ((angle.abs() + HALF_TURN + PI) / TAU).trunc() as i32;
    if angle < 0.0 { -turns } else { turns }
}

/// FANUC's turn numbers of axes 1, 4 and 6, for angles as the controller counts them, degrees.
#[must_use]
#[doc(hidden)]
pub fn turn_numbers(axes_deg: &[f64; 6]) -> [i32; 3] {
    [axes_deg[0], axes_deg[3], axes_deg[5]].map(|deg| whole_turn(deg.to_radians()))
}

/// 4 if the wrist centre is behind axis 1, plus 2 if it is behind the lower arm, plus 1 if joint 5 is negative.
fn posture(robot: &Robot, motor: &Joints) -> i32 {
    let (rear, behind) = robot.posture(motor);
    4 * i32::from(rear) + 2 * i32::from(behind) + i32::from(robot.axes.sign[4] * motor[4] < 0.0)
}

/// confdata for motor angles (rad): quarter turns of axes 1, 4 and 6, and the number of the posture.
#[must_use]
#[doc(hidden)]
pub fn confdata_of(robot: &Robot, motor: &Joints) -> Confdata {
    Confdata {
        cf1: quarter_turn(motor[0]),
        cf4: quarter_turn(motor[3]),
        cf6: quarter_turn(motor[5]),
        cfx: posture(robot, motor),
    }
}

/// `S` and `T` for motor angles (rad). Bits that do not describe the robot are copied from `like`.
fn status_like(robot: &Robot, motor: &Joints, like: StatusAndTurn) -> StatusAndTurn {
    let (rear, behind) = robot.posture(motor);
    let status = i32::from(rear) + 2 * i32::from(!behind) + 4 * below_zero(motor[4]);
    let turn = (0..6).map(|axis| below_zero(motor[axis]) << axis).sum::<i32>();
    StatusAndTurn { status: like.status & !7 | status, turn: like.turn & !63 | turn }
}

/// `S` and `T` for motor angles (rad). Bits that do not describe the robot are zero.
#[must_use]
#[doc(hidden)]
pub fn status_of(robot: &Robot, motor: &Joints) -> StatusAndTurn {
    status_like(robot, motor, StatusAndTurn { status: 0, turn: 0 })
}

/// FANUC's configuration for motor angles, rad.
#[must_use]
#[doc(hidden)]
pub fn config_of(robot: &Robot, motor: &Joints) -> Config {
    Config { posture: posture(robot, motor), turns: [motor[0], motor[3], motor[5]].map(whole_turn) }
}

/// KUKA's turn bit of an axis: 1 for negative angles.
fn below_zero(angle: f64) -> i32 {
    /// Angles down to this below zero are rounding errors of zero, rad.
    const ZERO: f64 = 1e-12;
    i32::from(angle < -ZERO)
}

/// The configuration of motor angles (rad), in the notation of `like`.
///
/// # Examples
/// ```
/// # let robot = deflex_robot::Builtin::named("irb6660-205-1.9").expect("a built-in robot").robot();
/// use deflex_program::{Conf, Confdata};
/// use deflex_robot::conf_like;
///
/// let motor = robot.motor_from_axes_deg(&[10.0, 0.0, 0.0, 0.0, 30.0, 0.0]);
/// let conf = conf_like(&robot, &motor, Conf::Quarters(Confdata { cf1: 1, cf4: 0, cf6: 0, cfx: 0 }));
/// assert_eq!(conf, Conf::Quarters(Confdata { cf1: 0, cf4: 0, cf6: 0, cfx: 0 }));
/// ```
#[must_use]
pub fn conf_like(robot: &Robot, motor: &Joints, like: Conf) -> Conf {
    match like {
        Conf::Quarters(_) => Conf::Quarters(confdata_of(robot, motor)),
        Conf::Turns(_) => Conf::Turns(config_of(robot, motor)),
        Conf::Status(like) => Conf::Status(status_like(robot, motor, like)),
        Conf::Near(_) => like,
    }
}

/// Whether motor angles (rad) have a configuration, as `conf_like(robot, motor, conf) == conf`. Mostly the turns
/// differ, and the posture is not computed.
#[must_use]
#[doc(hidden)]
pub fn conf_is(robot: &Robot, motor: &Joints, conf: Conf) -> bool {
    let turned = |index: fn(f64) -> i32, wanted: [i32; 3]| {
        [0, 3, 5].into_iter().zip(wanted).all(|(axis, wanted)| index(motor[axis]) == wanted)
    };
    let turned = match conf {
        Conf::Quarters(conf) => turned(quarter_turn, [conf.cf1, conf.cf4, conf.cf6]),
        Conf::Turns(conf) => turned(whole_turn, conf.turns),
        Conf::Status(_) | Conf::Near(_) => true,
    };
    turned && conf_like(robot, motor, conf) == conf
}

/// Motor angles (rad) with whole turns added to axes 1, 4 and 6 so that they have a configuration. The posture of the
/// configuration must be theirs. Angles for which no turns fit are returned unchanged.
pub(super) fn turned_to(motor: &Joints, conf: Conf) -> Joints {
    /// No axis turns by more whole turns than this in either direction.
    const TURNS: [i32; 7] = [0, 1, -1, 2, -2, 3, -3];
    let (index, wanted): (fn(f64) -> i32, _) = match conf {
        Conf::Quarters(conf) => (quarter_turn, [conf.cf1, conf.cf4, conf.cf6]),
        Conf::Turns(conf) => (whole_turn, conf.turns),
        Conf::Status(conf) => (below_zero, [0, 3, 5].map(|axis| conf.turn >> axis & 1)),
        Conf::Near(_) => return *motor,
    };
    let mut turned = *motor;
    for (axis, wanted) in [0, 3, 5].into_iter().zip(wanted) {
        let angles = TURNS.map(|turns| motor[axis] + f64::from(turns) * TAU);
        turned[axis] = angles.into_iter().find(|angle| index(*angle) == wanted).unwrap_or(motor[axis]);
    }
    turned
}

/// Index of the branch that a configuration names; `None` if it names none.
pub(super) fn branch_index(robot: &Robot, conf: Conf) -> Option<usize> {
    let posture = match conf {
        Conf::Quarters(conf) => conf.cfx,
        Conf::Turns(conf) => conf.posture,
        Conf::Status(StatusAndTurn { status, .. }) => {
            let below = (status & 4 != 0) == (robot.axes.sign[4] > 0.0);
            4 * (status & 1) + 2 * i32::from(status & 2 == 0) + i32::from(below)
        }
        // This configuration consists of nearby angles.
        Conf::Near(_) => return None,
    };
    usize::try_from(posture).ok()
}

#[cfg(test)]
mod tests {
    use super::{quarter_turn, status_like, whole_turn};
    use deflex_program::{Conf, StatusAndTurn};

    #[test]
    fn quarter_turns_follow_the_manual() {
        for (degrees, index) in [(0.0, 0), (89.9, 0), (90.0, 1), (-0.1, -1), (-89.9, -1), (-90.0, -2), (-200.0, -3)] {
            assert_eq!(quarter_turn(f64::to_radians(degrees)), index, "{degrees}");
        }
    }

    #[test]
    fn status_and_turn_are_those_of_taught_points() {
        // A usual posture with the wrist bent up: taught points have S 2, or S 6 if axis 5 is negative.
        let robot = crate::BUILTIN.iter().find(|robot| robot.model == "kr210-r2700-2").unwrap().robot();
        let like = StatusAndTurn { status: 16, turn: 64 };
        for (deg, status, turn) in [
            ([-5.0, -90.0, 95.0, 0.0, 40.0, -3.0], 2, 0b10_0011),
            ([5.0, -90.0, 95.0, 10.0, -40.0, -3.0], 6, 0b11_0010),
            ([5.0, -20.0, -50.0, 10.0, 40.0, 3.0], 0, 0b00_0110),
        ] {
            let motor = crate::Joints::from(deg.map(f64::to_radians));
            let found = status_like(&robot, &motor, like);
            assert_eq!(found, StatusAndTurn { status: 16 + status, turn: 64 + turn }, "{deg:?}");
            let conf = Conf::Status(found);
            let flange = robot.forward(&motor);
            let near = crate::Joints::zeros();
            assert!((robot.inverse_conf(&flange, Some(conf), &near).unwrap() - motor).amax() < 1e-9, "{deg:?}");
        }
    }

    #[test]
    fn whole_turns_begin_at_half_a_turn() {
        for (degrees, turn) in
            [(0.0, 0), (179.99, 0), (180.0, 1), (-180.0, -1), (-179.99, 0), (539.9, 1), (540.0, 2), (-400.0, -1)]
        {
            assert_eq!(whole_turn(f64::to_radians(degrees)), turn, "{degrees}");
        }
    }
}
