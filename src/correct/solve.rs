//! Commands for every point: equilibria in parallel, directions of travel in order.

use super::path::{Point, TRAVEL_THRESHOLD, travel};
use super::{Correct, Prepared, frames};
use crate::equilibrium::{Arm, Command, EquilibriumError, Landing, Near, Rounds, Start};
use crate::program::Editable;
use crate::robot::{Joints, Pose, Unreachable};
use crate::text::number;
use rayon::prelude::*;

/// A solved command.
#[derive(Clone, Debug)]
pub(super) struct Solved {
    /// Commanded motor angles, rad.
    pub(super) motor: Joints,
    /// What the controller's own nominal model makes of them: the corrected target.
    pub(super) wobj_from_tcp: Pose,
}

/// What to solve for at each point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Wish {
    /// Leave the command as it is.
    Keep,
    /// Land the whole pose.
    Pose,
    /// Land the TCP, hold the command's orientation.
    Position,
}

impl Wish {
    pub(super) fn of(editable: Editable, correct: Correct) -> Self {
        match (editable, correct) {
            (Editable::No(_), _) => Self::Keep,
            (Editable::Position, _) | (_, Correct::Position) => Self::Position,
            (Editable::Pose, Correct::Pose) => Self::Pose,
        }
    }
}

/// How the points of a pass are spread.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Spread {
    /// Over all threads: a program as a whole.
    Threads,
    /// On this one: a piece of a program whose other pieces are on the others.
    Here,
}

impl Spread {
    /// Every index's value, in order.
    pub(super) fn map<T: Send>(self, count: usize, value: impl Fn(usize) -> T + Sync + Send) -> Vec<T> {
        match self {
            Self::Threads => (0..count).into_par_iter().with_min_len(AT_LEAST).map(value).collect(),
            Self::Here => (0..count).map(value).collect(),
        }
    }

    /// The same with room to work in, which is used again.
    pub(super) fn map_with<T: Send, R>(
        self,
        room: impl Fn() -> R + Sync + Send,
        count: usize,
        value: impl Fn(&mut R, usize) -> T + Sync + Send,
    ) -> Vec<T> {
        match self {
            Self::Threads => (0..count).into_par_iter().with_min_len(AT_LEAST).map_init(room, value).collect(),
            Self::Here => {
                let mut room = room();
                (0..count).map(|i| value(&mut room, i)).collect()
            }
        }
    }
}

/// Points that a thread takes at a time: a millisecond's work.
const AT_LEAST: usize = 256;

/// Forward equilibria of given commands, in order, from starts that are about right.
pub(super) fn forward(
    arm: &Arm,
    prepared: &Prepared,
    commands: &[(Joints, Joints)],
    near: impl Fn(usize) -> Near + Sync + Send,
    spread: Spread,
) -> Vec<Result<Landing, EquilibriumError>> {
    spread.map_with(Rounds::default, commands.len(), |rounds, i| {
        let (motor, travel) = &commands[i];
        arm.land(&prepared.situation(i), (motor, travel), &near(i), rounds)
    })
}

/// Motor angles last commanded and the direction of travel into them.
pub(super) type Last = Option<(Joints, Joints)>;

/// Directions of travel along a sequence of commanded motor angles.
pub(super) fn travels(commands: impl Iterator<Item = Joints>, last: &mut Last) -> Vec<(Joints, Joints)> {
    commands
        .map(|motor| {
            let travel = last.map_or_else(Joints::zeros, |(previous, held)| travel(&previous, &motor, &held));
            *last = Some((motor, travel));
            (motor, travel)
        })
        .collect()
}

/// A command, and a start for equilibria close by.
type Found = Result<(Command, Near), EquilibriumError>;

/// Commands of every point with the travel as programmed, which decides first.
pub(super) fn first(arm: &Arm, prepared: &Prepared, wishes: &[Wish], spread: Spread) -> Vec<Found> {
    spread.map(wishes.len(), |i| {
        let point = &prepared.points[i];
        one(arm, prepared, i, point, wishes[i], &point.travel)
    })
}

/// Corrected commands of every point in their settled directions of travel.
pub(super) fn commands(
    arm: &Arm,
    prepared: &Prepared,
    wishes: &[Wish],
    first: &[Found],
    travels: &[Joints],
    spread: Spread,
) -> Vec<Result<Solved, EquilibriumError>> {
    let follows = arm.follows_command();
    spread.map(wishes.len(), |i| {
        let (point, travel) = (&prepared.points[i], &travels[i]);
        let (command, near) = first[i].as_ref().map_err(Clone::clone)?;
        let again = wishes[i] == Wish::Position && command.lost != Joints::zeros();
        let motor = if (follows || again) && *travel != point.travel {
            one(arm, prepared, i, point, wishes[i], travel)?.0.commanded(travel)
        } else {
            command.commanded(travel)
        };
        let base_from_tcp = arm.nominal_near(near, &motor) * point.tool.flange_from_tcp;
        let mut wobj_from_tcp = point.base_from_wobj.inv_mul(&base_from_tcp);
        match wishes[i] {
            Wish::Keep => wobj_from_tcp = point.wobj_from_tcp,
            Wish::Position => wobj_from_tcp.rotation = point.wobj_from_tcp.rotation,
            Wish::Pose => {}
        }
        Ok(Solved { motor, wobj_from_tcp })
    })
}

fn one(arm: &Arm, prepared: &Prepared, i: usize, point: &Point, wish: Wish, travel: &Joints) -> Found {
    let situation = prepared.situation(i);
    match wish {
        Wish::Keep => Ok((Command::held(&point.motor), arm.near(&point.motor, Joints::zeros()))),
        Wish::Pose => arm.command_from(&situation, &point.reference, Start::At(&point.motor), travel),
        Wish::Position => {
            let command = arm.command_position(&situation, &point.wobj_from_tcp, &point.motor, travel)?;
            let near = arm.near(&command.motor, command.deflection());
            Ok((command, near))
        }
    }
}

/// Directions of the **corrected** motion, in order: lost motion is added in the direction of travel, and the
/// direction follows from what is commanded. A direction holds if the command made with it moves that way; of two
/// that hold, the joint keeps the one it has.
pub(super) fn settle_travel(prepared: &Prepared, commands: &[Found], last: &mut Last) -> Vec<Joints> {
    commands
        .iter()
        .zip(&prepared.points)
        .map(|(command, point)| {
            let Ok((command, _)) = command else { return point.travel };
            let Some((previous, held)) = *last else {
                *last = Some((command.commanded(&Joints::zeros()), Joints::zeros()));
                return Joints::zeros();
            };
            let travel = Joints::from_fn(|i, _| {
                let step = |sign: f64| command.free[i] + sign * command.lost[i] - previous[i];
                let holds = |sign: f64| sign * step(sign) > TRAVEL_THRESHOLD;
                if step(held[i]).abs() <= TRAVEL_THRESHOLD {
                    return held[i];
                }
                let other = if held[i] == 0.0 { point.travel[i] } else { -held[i] };
                [held[i], other, -other].into_iter().find(|&sign| sign != 0.0 && holds(sign)).unwrap_or(point.travel[i])
            });
            *last = Some((command.commanded(&travel), travel));
            travel
        })
        .collect()
}

/// Motor angles that the controller reaches for numbers as it holds them, near known ones.
pub(super) fn controller_joints(
    arm: &Arm,
    point: &Point,
    written: &([f64; 3], [f64; 4]),
    near: &Joints,
) -> Result<Joints, Unreachable> {
    let pose = frames::pose(written.0, written.1);
    arm.robot.inverse_near(&(point.base_from_wobj * pose * point.tool.flange_from_tcp.inverse()), near)
}

/// Numbers as a post-processor prints them and the controller holds them: fixed decimals, single precision.
pub(super) fn as_printed(pose: &Pose, position_decimals: usize, quat_decimals: usize) -> ([f64; 3], [f64; 4]) {
    #[allow(clippy::cast_possible_truncation)]
    let round = |value: f64, decimals: usize| f64::from(number::printed(value, decimals) as f32);
    let (position, quat) = frames::millimetres(pose);
    (position.map(|v| round(v, position_decimals)), quat.map(|v| round(v, quat_decimals)))
}
