//! The cell file: one TOML file that says everything about a milling cell.
//!
//! Numbers here are as the file has them converted to SI; the file's own units stand in its keys.

mod check;
mod cut;
mod extend;
mod nearest;
mod raw;
mod read;
mod syntax;
mod template;
mod uncertainty;

pub use extend::{NewEffect, extended};
pub use nearest::nearest;
pub use template::{examples_left, template};

use crate::cutting::{Coefficients, Cutter, Engagement};
use crate::effects::ToolFrame;
use crate::equilibrium::Arm;
use crate::program::cl::ClOptions;
use crate::robot::{Joints, Pose};
use nalgebra::{DMatrix, Vector3};
use std::collections::BTreeMap;

/// A milling cell, read and checked.
#[derive(Debug)]
#[non_exhaustive]
pub struct Cell {
    /// Robot, declared stiffness and effects, in the order of the file. A cell with a declared stiffness and no
    /// `joint_stiffness` effect has one with all factors 1, first.
    pub arm: Arm,
    /// Covariance of each of `arm.effects`' parameters, in their units and order, where the file has one.
    pub covariances: Vec<Option<DMatrix<f64>>>,
    /// Where `[robot] start_deg` starts, rad.
    pub start: Option<Joints>,
    /// Tools by name, upper case (RAPID names are case-insensitive).
    pub tools: BTreeMap<String, ToolFrame>,
    /// Work objects by name, upper case: the object frame in the world.
    pub wobjs: BTreeMap<String, Pose>,
    /// `[limits]`.
    pub limits: CorrectionLimits,
    /// `[controller] compensates`: effects covered by it are left out of `arm.effects`; this says which.
    pub controller: Controller,
    /// `[cl]`, where present.
    pub cl: Option<Cl>,
    /// `[cut]`, where present.
    pub cut: Option<Cut>,
}

/// `[limits]`: what would surprise the machine, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CorrectionLimits {
    /// Largest correction of one target.
    pub max_correction: f64,
    /// Largest difference between the corrections of neighbouring targets.
    pub max_step: f64,
}

/// `[controller]`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Controller {
    /// Whether the file has the section at all: said once where an effect would matter.
    pub declared: bool,
    /// `gravity` is corrected by the controller.
    pub gravity: bool,
    /// `geometry` is corrected by the controller.
    pub geometry: bool,
    /// Kinds of effects in the file that are left out because the controller corrects them.
    pub left_out: Vec<String>,
}

/// `[cl]`.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Cl {
    /// What the front end needs.
    pub options: ClOptions,
    /// Turn about the tool axis.
    pub spin: Spin,
}

/// Where the TCP's x axis points, projected square to the tool axis, then turned by `turn` about it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spin {
    /// Reference direction.
    pub rule: SpinRule,
    /// Turn about the tool axis, rad.
    pub turn: f64,
}

/// Reference direction of [`Spin`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SpinRule {
    /// The work object's x axis.
    Fixed,
    /// The feed.
    Feed,
    /// A point in the work object, m.
    Towards(Vector3<f64>),
}

/// `[cut]`.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Cut {
    /// The force.
    pub force: CutForce,
    /// Faster moves are air, m/s.
    pub max_cutting_feed: Option<f64>,
}

/// `[cut] force`.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum CutForce {
    /// No force.
    None,
    /// The same force on every cutting target, N.
    Constant {
        /// Force on the tool.
        force: Vector3<f64>,
        /// Axes it is given in.
        frame: ForceFrame,
    },
    /// A force per target from a table.
    Table,
    /// The milling force integral.
    Mechanistic {
        /// `[cut.cutter]`.
        cutter: Cutter,
        /// `[cut.engagement]`.
        engagement: Engagement,
        /// Whether the feed per tooth is left to feed, spindle speed and teeth.
        feed_from_program: bool,
        /// Spindle speed where the program does not say, 1/min.
        spindle_rpm: Option<f64>,
        /// `[cut.coefficients]` or the named material.
        coefficients: Coefficients,
    },
}

/// Axes of a constant force.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ForceFrame {
    /// Work object.
    Wobj,
    /// TCP frame.
    Tool,
    /// x feed, z surface normal.
    Feed,
}
