use super::{Joints, Robot};
use crate::program::Conf;
use std::f64::consts::FRAC_PI_2;

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

/// confdata of motor angles (rad): quarter turns of axes 1, 4, 6 and
/// cfx = 4·(wrist centre behind axis 1) + 2·(behind the lower arm) + (axis 5 negative).
#[must_use]
pub fn conf_of(robot: &Robot, motor: &Joints) -> Conf {
    let (rear, behind) = robot.posture(motor);
    Conf {
        cf1: quarter_turn(motor[0]),
        cf4: quarter_turn(motor[3]),
        cf6: quarter_turn(motor[5]),
        cfx: 4 * i32::from(rear) + 2 * i32::from(behind) + i32::from(robot.axes.sign[4] * motor[4] < 0.0),
    }
}

/// Whether motor angles (rad) have this confdata: `conf_of(robot, motor) == conf`, mostly without a look at the posture.
#[must_use]
pub fn conf_is(robot: &Robot, motor: &Joints, conf: Conf) -> bool {
    let quarters = [(0, conf.cf1), (3, conf.cf4), (5, conf.cf6)];
    quarters.into_iter().all(|(i, quarter)| quarter_turn(motor[i]) == quarter) && conf_of(robot, motor) == conf
}

#[cfg(test)]
mod tests {
    use super::quarter_turn;

    #[test]
    fn quarter_turns_follow_the_manual() {
        for (degrees, index) in [(0.0, 0), (89.9, 0), (90.0, 1), (-0.1, -1), (-89.9, -1), (-90.0, -2), (-200.0, -3)] {
            assert_eq!(quarter_turn(f64::to_radians(degrees)), index, "{degrees}");
        }
    }
}
