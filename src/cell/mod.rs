//! The cell file: one TOML file that says everything about a milling cell.
//!
//! Numbers here are as the file has them converted to SI; the file's own units stand in its keys.

mod backup;
mod check;
mod cl;
mod cut;
mod extend;
mod plan;
mod plausible;
mod raw;
mod read;
mod stock;
mod syntax;
mod template;
mod uncertainty;
mod unit;
mod urdf;

pub use crate::text::nearest;
pub use backup::backup_template;
pub use cut::{Cut, CutForce, DeclaredEngagement, Engaged, EngagementMode, MillingCut, MillingParts, MissingCutKey};
pub use extend::{NewEffect, extended, with_path_law};
pub use plan::{Instrument, PlanSection};
pub use stock::{HeldPart, PartSection, StockSection};
pub use template::{described_template, examples_left, template};
pub use uncertainty::Uncertainty;
pub(crate) use unit::MOST_FREE;
pub use urdf::{Described, described};

use crate::drive::PathLaw;
use crate::effects::ToolFrame;
use crate::equilibrium::Arm;
use crate::measured::ColumnNames;
use crate::program::Language;
use crate::program::cl::ClOptions;
use crate::program::post::Templates;
use crate::robot::{Joints, Pose, Units};
use crate::text::{Diagnostic, Source};
use nalgebra::{DMatrix, Vector3};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// A milling cell, read and checked.
#[derive(Debug)]
#[non_exhaustive]
pub struct Cell {
    /// Robot, declared stiffness and effects, in the order of the file. A cell with a declared stiffness and no
    /// `joint_stiffness` effect has one with all factors 1, first.
    pub arm: Arm,
    /// Covariance of each of `arm.effects`' parameters, in their units and order, where the file has one.
    pub covariances: Vec<Option<DMatrix<f64>>>,
    /// Rows of each of `arm.effects`' parameters in the factor L that effects share which were identified together: L Lᵀ is the
    /// covariance of all their parameters.
    pub joint_factors: Vec<Option<DMatrix<f64>>>,
    /// Where `[robot] start_deg` starts, rad.
    pub start: Option<Joints>,
    /// Tools by name, upper case (RAPID names are case-insensitive); those whose frame the program has to declare are not here.
    pub tools: BTreeMap<String, ToolFrame>,
    /// `[tools.X.cutter]`, `[tools.X.engagement]` and `[tools.X.coefficients]` of the tools that have any, by name, upper case.
    pub tool_milling: BTreeMap<String, MillingParts>,
    /// Work objects by name, upper case: the object frame in the world.
    pub wobjs: BTreeMap<String, Pose>,
    /// Index of the mechanical unit that is the user frame of a work object, by its name in upper case: the pose is then in that.
    pub wobj_units: BTreeMap<String, usize>,
    /// Names of tools and work objects as the cell file spells them, by name, upper case.
    pub spelled: BTreeMap<String, String>,
    /// `[limits]`.
    pub limits: CorrectionLimits,
    /// `[controller] compensates`: effects covered by it are left out of `arm.effects`; this says which.
    pub controller: Controller,
    /// `[cl]`, where present.
    pub cl: Option<Cl>,
    /// `[cut]`, where present.
    pub cut: Option<Cut>,
    /// Warnings about values that are possible and yet seldom meant, mostly another unit: each with its usual range.
    pub notes: Vec<Diagnostic>,
    /// `[stock]`, where present.
    pub stock: Option<StockSection>,
    /// `[[unit]]`: mechanical units besides the robot.
    pub units: Arc<Units>,
    /// `[part]`, where present.
    pub part: Option<PartSection>,
    /// `[plan]`, where present.
    pub plan: Option<PlanSection>,
    /// `[measured] columns`: what the shop's measured files and tables of forces call their columns.
    pub columns: Option<ColumnNames>,
    /// The language of the robot's controller; `None` if the cell does not show it.
    pub language: Option<Language>,
}

impl Cell {
    /// Names that the cell declares, spelled as in its file, for messages.
    #[must_use]
    pub fn names_of<'a, T>(&'a self, declared: &'a BTreeMap<String, T>) -> Vec<&'a str> {
        declared.keys().map(|name| self.spelled.get(name).map_or(&**name, String::as_str)).collect()
    }
}

/// `[limits]`: what would surprise the machine, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CorrectionLimits {
    /// Largest correction of one target.
    pub max_correction: f64,
    /// Largest difference between the corrections of neighbouring targets.
    pub max_step: f64,
    /// Largest error between targets, m, that is not reported.
    pub max_path_error: f64,
}

/// `[controller]`.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Controller {
    /// Whether the file says what the controller compensates: its lack is said once where an effect would matter.
    pub declared: bool,
    /// `[controller.path]`: how it leads the axes along a path.
    pub path: Option<ControllerPath>,
    /// `gravity` is corrected by the controller.
    pub gravity: bool,
    /// `geometry` is corrected by the controller.
    pub geometry: bool,
    /// Kinds of effects in the file that are left out because the controller corrects them.
    pub left_out: Vec<String>,
    /// Routines of the controller that the user vouches for, upper case: they change neither frames nor positions.
    pub harmless: BTreeSet<String>,
}

impl Controller {
    /// Context of a program in a language, which declares the routines that the user vouches for: each without a statement. What
    /// the program's own files or a context before these declare under such a name stands.
    #[must_use]
    pub fn declarations(&self, language: Language) -> Vec<Source> {
        if self.harmless.is_empty() {
            return Vec::new();
        }
        let names: Vec<&str> = self.harmless.iter().map(String::as_str).collect();
        (language.about().declare)(&names).into_iter().map(|(name, text)| Source::new(name, text)).collect()
    }
}

/// `[controller.path]`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct ControllerPath {
    /// The law of its interpolation.
    pub law: PathLaw,
    /// Radius at points that are passed though the program's text gives no radius (`C_DIS`, `CNT`, CL data), m.
    pub zone: Option<f64>,
    /// Share of the distance between driven and programmed path that the law did not explain in logs that its fit had not seen; 0
    /// where the cell does not say.
    pub error_share: f64,
    /// Shortest time between two points that the controller can plan, s.
    pub planning: Option<f64>,
    /// Largest acceleration of each axis, °/s², as the pendant counts them.
    pub axis_acceleration: Option<Joints>,
}

/// `[cl]`.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Cl {
    /// What the front end needs.
    pub options: ClOptions,
    /// `[cl.post]`: lines that call the cell's own routines.
    pub post: Templates,
    /// Turn about the tool axis.
    pub spin: Spin,
    /// Least angle of axis 5 from a singular wrist where the turn is chosen, rad.
    pub singular_margin: f64,
}

impl Cl {
    /// Margin from a singular wrist where the cell states none, rad (`docs/reference.md`).
    pub(crate) const SINGULAR_MARGIN: f64 = 10.0 * std::f64::consts::PI / 180.0;
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
    /// Chosen along the path for the least predicted error.
    Stiffest,
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
