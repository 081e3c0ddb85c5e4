//! Geometry of the arm: converts motor angles to poses, and back. This module does not know programs or loads.
//!
//! Modified Denavit-Hartenberg rows (Craig): `T_i = Rx(alpha) Tx(a) Rz(theta + joint) Tz(d)`,
//! `base_from_flange = T_1 … T_6`. Lengths are metres, angles radians. All joint vectors are
//! **motor angles**, with the maker's signs and zero positions: on a parallelogram arm motor 3 sets the
//! forearm's angle to link 1, so that serial joint 3 is motor 3 − motor 2. The controller shows **axis
//! angles**; they differ from motor angles only if it counts axis 3 against the ground (see [`Axes`]).

#[doc(hidden)]
pub mod batch;
mod builtin;
mod closed_form;
mod configuration;
mod excursion;
mod forward;
mod home;
mod inverse;
#[doc(hidden)]
pub mod kinematics;
mod limits;
mod links;
mod model;
mod named;
mod solutions;
mod start;
mod tables;
mod turn;
mod unit;

pub use batch::{BatchArm, BatchSolutions, WrittenTarget};
pub use builtin::{BUILTIN, Builtin, Reach};
pub use closed_form::{Branch, wrap};
pub use configuration::{conf_is, conf_like, confdata_of, config_of, status_of, turn_numbers};
pub use deflex_lanes::Pose;
pub use deflex_program::{AxisName, EXTERNAL_AXES, External};
pub use excursion::Excursion;
pub use forward::NUDGE;
#[cfg(test)]
pub(crate) use inverse::pose_gap;
pub use inverse::{Unreachable, is_close, polish};
pub use limits::{LimitViolation, LimitedAngle};
pub use links::{DhRow, Frames, Links};
pub use model::{Axes, Limits, Robot, gravity_at};
pub use start::{Start, StartedFrom};
pub use tables::{PoseMatrix, pose_matrix, pose_of_matrix};
pub use turn::{turn_between, turns_between};
pub use unit::{Carries, Unit, UnitKind, Units};

/// Six motor angles, rad (or six joint torques, N·m, in the same coordinates).
pub type Joints = nalgebra::Vector6<f64>;

/// The 6×6 Jacobian, rows (vx, vy, vz, wx, wy, wz) in base axes, m/rad and rad/rad.
pub type Jacobian = nalgebra::Matrix6<f64>;
