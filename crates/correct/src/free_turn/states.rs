//! The possible states of an arm at one target: every turn of a grid about the tool axis, every branch, every whole turn of axes 4 and 6
//! within the limits.

use super::axes::Position;
use crate::spin;
use deflex_equilibrium::Setting;
use deflex_robot::{Joints, Pose, Robot};
use nalgebra::Vector3;
use std::f64::consts::TAU;

/// Number of turns of the grid: 5° apart, which one millimetre of path allows.
pub(super) const TURNS: usize = 72;

/// Angle between two turns of the grid, rad.
pub(super) const STEP: f64 = TAU / TURNS as f64;

/// Whole turns of axes 4 and 6 that are tried: wrists have at most two and a half to each side.
const WHOLE: [f64; 5] = [-2.0, -1.0, 0.0, 1.0, 2.0];

/// The data of a target that the kinematics need.
#[derive(Clone, Debug)]
pub(super) struct FreeTarget {
    /// TCP in the work object, m.
    pub(super) position: Vector3<f64>,
    /// Tool axis in the work object, tip to spindle.
    pub(super) axis: Vector3<f64>,
    /// Motor angles at which an inverse without a closed form starts, rad.
    pub(super) near: Joints,
    /// Turn (rad) and motor angles (rad), if they are not free.
    pub(super) fixed: Option<(f64, Joints)>,
    /// The only branch, by cfx, if the program states it.
    pub(super) branch: Option<usize>,
}

/// A possible state at a target.
#[derive(Clone, Copy, Debug)]
pub(super) struct PostureChoice {
    /// Turn about the tool axis, rad; see [`spin::turned`].
    pub(super) turn: f64,
    /// Branch of the inverse, by cfx.
    pub(super) branch: usize,
    /// Motor angles, rad.
    pub(super) motor: Joints,
    /// Index of the lane of the free axes over the stretch.
    pub(super) lane: u16,
    /// Their positions, mm or degrees.
    pub(super) position: Position,
}

/// Reasons why states are impossible, counted over turns and branches.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Refused {
    /// Out of reach.
    pub(super) reach: usize,
    /// Beyond an axis limit.
    pub(super) limits: usize,
    /// The wrist is closer to singular than the margin.
    pub(super) singular: usize,
}

impl std::ops::AddAssign for Refused {
    fn add_assign(&mut self, other: Self) {
        self.reach += other.reach;
        self.limits += other.limits;
        self.singular += other.singular;
    }
}

impl FreeTarget {
    /// The flange at a turn (rad).
    pub(super) fn base_from_flange(&self, setting: &Setting, turn: f64) -> Pose {
        setting.base_from_flange(&spin::turned(self.position, &self.axis, turn))
    }

    /// Every state with the free axes at a position, rising by turn from 0, and the refused ones. `margin` is the least angle of axis 5 from a
    /// singular wrist, rad.
    pub(super) fn states(
        &self,
        robot: &Robot,
        margin: f64,
        (setting, position): (&Setting, Position),
    ) -> (Vec<PostureChoice>, Refused) {
        let lane = 0;
        let (mut out, mut refused) = (Vec::new(), Refused::default());
        if let Some((turn, motor)) = self.fixed {
            out.push(PostureChoice { turn, branch: branch_of(robot, &motor), motor, lane, position });
            return (out, refused);
        }
        let mut near = self.near;
        for index in 0..TURNS {
            let turn = index as f64 * STEP;
            let Ok(solutions) = robot.inverse(&self.base_from_flange(setting, turn), &near) else {
                refused.reach += 1;
                continue;
            };
            for (branch, motor) in solutions.into_iter().enumerate() {
                let Some(motor) = motor.filter(|_| self.branch.is_none_or(|only| only == branch)) else { continue };
                // An inverse without a closed form is followed from turn to turn.
                near = motor;
                if singular(robot, &motor, margin) {
                    refused.singular += 1;
                    continue;
                }
                let before = out.len();
                for motor in whole_turns(&motor) {
                    if robot.limit_violation(&motor).is_none() {
                        out.push(PostureChoice { turn, branch, motor, lane, position });
                    }
                }
                refused.limits += usize::from(out.len() == before);
            }
        }
        (out, refused)
    }
}

/// The same pose with axes 4 and 6 turned by further whole turns.
fn whole_turns(motor: &Joints) -> impl Iterator<Item = Joints> {
    let motor = *motor;
    WHOLE.into_iter().flat_map(move |fourth| {
        WHOLE.into_iter().map(move |sixth| {
            let mut motor = motor;
            motor[3] += fourth * TAU;
            motor[5] += sixth * TAU;
            motor
        })
    })
}

/// Whether axis 5 is closer than `margin` (rad) to where axes 4 and 6 line up.
pub(super) fn singular(robot: &Robot, motor: &Joints, margin: f64) -> bool {
    robot.serial_from_motor(motor)[4].sin().abs() < margin.sin()
}

/// Branch of motor angles (rad), by cfx.
pub(super) fn branch_of(robot: &Robot, motor: &Joints) -> usize {
    let (rear, behind) = robot.posture(motor);
    let flipped = robot.serial_from_motor(motor)[4] < 0.0;
    deflex_robot::Branch { rear, behind, flipped }.cfx()
}
