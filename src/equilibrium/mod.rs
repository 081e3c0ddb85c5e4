//! The two questions put to a cell: where does a command end up ([`Arm::predict`]), and which command ends up where it should
//! ([`Arm::command`]), for one target or for a batch. Knows no text.
//!
//! ```text
//! Model      the arm with its effects, ready to be evaluated
//! Block      what is known of targets, lane by lane
//! Evaluation the arm in one state: where it is, what acts on it, by how much it yields
//! Forward    rounds of evaluations until what yields is what was put in
//! Inverse    rounds of evaluations at the wanted pose until the command is found
//! ```

mod arm;
mod batch;
mod block;
mod command;
mod evaluation;
mod forward;
mod friction;
mod inverse;
mod model;
mod number;
mod predict;

pub use arm::Arm;
pub(crate) use batch::{Batch, Given, Nearby, Room, Settled};
pub(crate) use block::{Setting, Site};
pub use command::Command;
pub(crate) use command::{InverseSolution, Start};
pub(crate) use friction::Dragged;
pub(crate) use number::Number;
pub use predict::{Equilibrium, Load};
pub(crate) use predict::{PredictedPose, WarmStart};

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
