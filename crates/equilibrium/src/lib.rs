//! Static equilibria of the loaded arm, for one target or for a batch: the actual pose of a command ([`Arm::predict`]),
//! and the command that reaches a wanted pose ([`Arm::command`]). This module does not know programs or files.
//!
//! ```text
//! Model      the arm with its effects, prepared for evaluations
//! Block      the inputs of the targets, lane by lane
//! Evaluation the arm in one state: its pose, its loads, and its deflection under them
//! Forward    evaluations until the deflection that was assumed is the one that the loads cause
//! Inverse    evaluations at the wanted pose until the command no longer changes
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
pub use batch::{Aimed, Batch, Given, Nearby, Room, Settled};
pub use block::{Setting, Site};
pub use command::{Command, InverseSolution, Start};
pub use friction::{Dragged, Settling, TRAVEL_THRESHOLD, direction};
pub(crate) use number::Number;
pub use predict::{Equilibrium, Load, PredictedPose, WarmStart};

use deflex_robot::Unreachable;

/// Why a target has no equilibrium or cannot be reached.
///
/// # Examples
/// ```
/// use deflex_equilibrium::EquilibriumError;
///
/// let error = EquilibriumError::NoEquilibrium { rounds: 100, step_mm: 0.2, axis: 2 };
/// assert!(error.to_string().ends_with("mostly with axis 2"));
/// ```
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EquilibriumError {
    /// The arm does not reach the pose.
    #[error(transparent)]
    Unreachable(#[from] Unreachable),
    /// The iteration does not converge. Usually the force grows faster with the deflection than the springs of the arm do, so that the
    /// tool is pulled into the material.
    #[error(
        "no equilibrium: after {rounds} iterations the tool still moves by {step_mm:.4} mm in each, mostly with axis {axis}"
    )]
    NoEquilibrium {
        /// Number of iterations.
        rounds: usize,
        /// Last step of the TCP, mm.
        step_mm: f64,
        /// The axis, 1 to 6, that still moves most; 0 where that is not known.
        axis: usize,
    },
    /// A parameter or a load is infinite or not a number.
    #[error("the equilibrium is not finite: a parameter of the cell or a force is out of range")]
    NotFinite,
}
