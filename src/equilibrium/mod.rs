//! The two questions put to a cell: where does a command end up ([`Arm::predict`]), and which command ends
//! up where it should ([`Arm::command`]). Knows no text.

mod arm;
mod command;
mod eight;
mod predict;

pub use arm::Arm;
pub(crate) use arm::Near;
pub use command::Command;
pub(crate) use command::{Aim, Start};
pub(crate) use eight::{Cut, EightArm, Given, Room, Setting, Site};
pub use predict::Equilibrium;
pub(crate) use predict::{Foreseen, Landing, Rounds};

use crate::robot::Unreachable;

/// Why a target has no answer.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EquilibriumError {
    /// The arm does not get there.
    #[error(transparent)]
    Unreachable(#[from] Unreachable),
    /// The load grows faster than the arm gives way: it is pulled in without end.
    #[error(
        "no equilibrium: after {rounds} rounds the tool still moves {step_mm:.4} mm a round, mostly by axis {axis}"
    )]
    NoEquilibrium {
        /// Rounds tried.
        rounds: usize,
        /// Last step of the TCP, mm.
        step_mm: f64,
        /// Axis (1 to 6) that still moves most.
        axis: usize,
    },
    /// A parameter or a load is not a number.
    #[error("the equilibrium is not finite: a parameter of the cell or a force is out of range")]
    NotFinite,
}
