//! The cell file: one TOML file that describes a milling cell.
//!
//! Values are converted to SI units. The file has other units, which the names of its keys state.

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

pub use backup::backup_template;
pub(crate) use cut::MillingParts;
pub use cut::{Cut, CutForce, EngagementSource, MillingCut, MissingCutKey};
pub use deflex_text::nearest;
pub use extend::{NewEffect, extended, with_effects, with_path_law, with_stiffness};
pub use plan::{Instrument, PlanSection};
pub use stock::{HeldPart, PartSection, StockSection};
pub use template::{described_template, examples_left, template};
pub use uncertainty::Uncertainty;
pub use unit::MOST_FREE;
pub use urdf::{Described, described};

use deflex_drive::PathLaw;
use deflex_effects::ToolFrame;
use deflex_equilibrium::Arm;
use deflex_measured::ColumnNames;
use deflex_program::cl::ClOptions;
use deflex_program::jbi::SpeedUnit;
use deflex_program::post::Templates;
use deflex_program::{ArcTurn, Language};
use deflex_robot::{Joints, Pose, Units};
use deflex_text::{Diagnostic, Source};
use nalgebra::{DMatrix, Vector3};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// A milling cell, read and checked.
///
/// # Examples
/// ```
/// use deflex_cell::Cell;
/// use deflex_text::Source;
///
/// let mut cell = Cell::read(&Source::new("cell.toml", std::fs::read("../../samples/slot/cell.toml")?))?;
/// println!("{}", cell.arm.robot.model);
/// assert_eq!(cell.milling("tMill").expect("a complete description").cutter.diameter, 0.025); // m
/// cell.take_meshes(|name| Ok(Source::new(name, std::fs::read(name).unwrap_or_default())))?;
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Debug)]
#[non_exhaustive]
pub struct Cell {
    /// The robot, its declared stiffness and its effects, in the order of the file. If the cell declares a stiffness
    /// and no `joint_stiffness` effect, such an effect with all factors 1 is added as the first one.
    pub arm: Arm,
    /// Covariance of the parameters of each effect in `arm.effects`, in their units and order, if the file states one.
    pub covariances: Vec<Option<DMatrix<f64>>>,
    /// For effects that were identified together, the covariance of all their parameters is L Lᵀ. For each effect in
    /// `arm.effects`, these are the rows of L that belong to its parameters; `None` for other effects.
    pub joint_factors: Vec<Option<DMatrix<f64>>>,
    /// Motor angles before the first motion, from `[robot] start_deg`, rad.
    pub start: Option<Joints>,
    /// Tools by name in upper case, because RAPID names are case-insensitive. Tools whose frame the program has to
    /// declare are missing here.
    pub tools: BTreeMap<String, ToolFrame>,
    /// The tables `[tools.X.cutter]`, `[tools.X.engagement]` and `[tools.X.coefficients]` of tools that have any, by
    /// name in upper case.
    pub(crate) tool_milling: BTreeMap<String, MillingParts>,
    /// Work objects by name in upper case: the object frame in the world frame.
    pub wobjs: BTreeMap<String, Pose>,
    /// Index of the mechanical unit that carries a work object, by the name of the work object in upper case. The pose
    /// in `wobjs` is then in the unit's frame.
    pub wobj_units: BTreeMap<String, usize>,
    /// Names of tools and work objects as the cell file spells them, by name in upper case.
    pub spelled: BTreeMap<String, String>,
    /// The `[limits]` table.
    pub limits: CorrectionLimits,
    /// The `[controller]` table. Effects that the controller compensates are left out of `arm.effects`; `left_out`
    /// lists them.
    pub controller: Controller,
    /// The `[cl]` table, if there is one.
    pub cl: Option<Cl>,
    /// The `[cut]` table, if there is one.
    pub cut: Option<Cut>,
    /// Warnings about values that are possible but seldom intended, usually because they are in another unit. Each
    /// states the usual range.
    pub notes: Vec<Diagnostic>,
    /// The `[stock]` table, if there is one.
    pub stock: Option<StockSection>,
    /// The `[[unit]]` tables: mechanical units in addition to the robot.
    pub units: Arc<Units>,
    /// The `[part]` table, if there is one.
    pub part: Option<PartSection>,
    /// The `[plan]` table, if there is one.
    #[doc(hidden)]
    pub plan: Option<PlanSection>,
    /// `[measured] columns`: names of the columns in the measured files and tables of forces.
    pub columns: Option<ColumnNames>,
    /// The language of the robot's controller; `None` if the cell does not show it.
    pub language: Option<Language>,
}

impl Cell {
    /// The names of declared tools or work objects, spelled as in the file, for messages.
    #[must_use]
    #[doc(hidden)]
    pub fn names_of<'a, T>(&'a self, declared: &'a BTreeMap<String, T>) -> Vec<&'a str> {
        declared.keys().map(|name| self.spelled.get(name).map_or(&**name, String::as_str)).collect()
    }
}

/// The `[limits]` table: limits beyond which a correction is refused or reported, m.
///
/// # Examples
/// ```
/// # let (_, cell) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/slot.rs"));
/// assert_eq!(cell.limits.max_correction, 1e-3); // m
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CorrectionLimits {
    /// Largest correction of a target.
    pub max_correction: f64,
    /// Largest difference between the corrections of successive targets.
    pub max_step: f64,
    /// Largest error between targets that is not reported.
    pub max_path_error: f64,
}

/// The `[controller]` table.
///
/// # Examples
/// ```
/// use deflex_cell::Cell;
/// use deflex_program::Language;
/// use deflex_text::Source;
///
/// let text = "[robot]\nmodel = \"irb6660-205-1.9\"\n[controller]\nharmless = [\"rSpindle\"]\n";
/// let controller = Cell::read(&Source::new("cell.toml", text))?.controller;
/// assert!(!controller.declared && !controller.gravity); // it does not state what it compensates
/// assert_eq!(controller.declarations(Language::Rapid).len(), 1);
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Controller {
    /// Whether the file states what the controller compensates. If it does not, and an effect depends on it, a note
    /// says so once.
    pub declared: bool,
    /// `[controller.path]`: how the controller leads the axes along a path.
    pub path: Option<ControllerPath>,
    /// How the controller turns the tool on arcs for which the program does not state it. `None`: as the maker's manual says.
    pub arc_turn: Option<ArcTurn>,
    /// The unit of the speeds in INFORM.
    pub speed_unit: SpeedUnit,
    /// Whether the controller compensates `gravity`.
    pub gravity: bool,
    /// Whether the controller compensates `geometry`.
    pub geometry: bool,
    /// Kinds of effects in the file that are left out, because the controller compensates them.
    pub left_out: Vec<String>,
    /// Routines of the controller that change neither frames nor positions, as the user declares; in upper case.
    pub harmless: BTreeSet<String>,
}

impl Controller {
    /// Source texts in a language that declare the harmless routines, each with an empty body. A declaration of the
    /// same name in the program or in an earlier context takes precedence.
    #[must_use]
    pub fn declarations(&self, language: Language) -> Vec<Source> {
        if self.harmless.is_empty() {
            return Vec::new();
        }
        let names: Vec<&str> = self.harmless.iter().map(String::as_str).collect();
        (language.about().declare)(&names).into_iter().map(|(name, text)| Source::new(name, text)).collect()
    }
}

/// The `[controller.path]` table.
///
/// # Examples
/// ```
/// use deflex_cell::Cell;
/// use deflex_text::Source;
///
/// let cell = Cell::read(&Source::new("cell.toml", "[robot]\nmodel = \"irb6660-205-1.9\"\n"))?;
/// assert!(cell.controller.path.is_none()); // the cell states no [controller.path]
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct ControllerPath {
    /// The law of its interpolation.
    pub law: PathLaw,
    /// Zone radius, m, at points for which the program requests a zone without a radius (`C_DIS`, `CNT`, CL data).
    pub zone: Option<f64>,
    /// Share of the distance between driven and programmed path that the law did not explain in logs that were not used
    /// for the fit. 0 if the cell states none.
    pub error_share: f64,
    /// Shortest time between two points for which the controller can plan a motion, s.
    pub planning: Option<f64>,
}

/// The `[cl]` table.
///
/// # Examples
/// ```
/// use deflex_cell::Cell;
/// use deflex_text::Source;
///
/// let cell = Cell::read(&Source::new("cell.toml", std::fs::read("../../samples/blade/cell.toml")?))?;
/// let cl = cell.cl.expect("a [cl] table");
/// println!("{:.0} degrees from a singular wrist", cl.singular_margin.to_degrees());
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Cl {
    /// Options of the front end that reads CL data.
    pub options: ClOptions,
    /// `[cl.post]`: lines that call routines of the cell.
    #[doc(hidden)]
    pub post: Templates,
    /// Turn of the tool about its axis, which CL data leave free.
    pub spin: Spin,
    /// Smallest distance of axis 5 from a singular wrist, rad, where deflex chooses the turn.
    pub singular_margin: f64,
}

impl Cl {
    /// Default of [`Cl::singular_margin`], rad (`docs/reference.md`).
    #[doc(hidden)]
    pub const SINGULAR_MARGIN: f64 = 10.0 * std::f64::consts::PI / 180.0;
}

/// Rule for the turn about the tool axis: the TCP's x axis points in a reference direction, projected onto the plane
/// perpendicular to the tool axis, and is then turned by `turn` about this axis.
///
/// # Examples
/// ```
/// use deflex_cell::{Spin, SpinRule};
///
/// // The x axis of the TCP points in the direction of the feed.
/// let spin = Spin { rule: SpinRule::Feed, turn: 0.0 };
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spin {
    /// Reference direction.
    pub rule: SpinRule,
    /// Turn about the tool axis, rad.
    pub turn: f64,
}

/// Reference direction of [`Spin`].
///
/// # Examples
/// ```
/// use deflex_cell::SpinRule;
/// use nalgebra::Vector3;
///
/// let towards = SpinRule::Towards(Vector3::new(0.1, 0.0, 0.0)); // m, in the work object
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SpinRule {
    /// The x axis of the work object.
    Fixed,
    /// The direction of the feed.
    Feed,
    /// Towards a point in the work object, m.
    Towards(Vector3<f64>),
    /// Chosen along the path for the smallest predicted error.
    Stiffest,
}

/// Frame of a constant force.
///
/// # Examples
/// ```
/// use deflex_cell::{Cell, CutForce, ForceFrame};
/// use deflex_text::Source;
///
/// let text = "[robot]\nmodel = \"irb6660-205-1.9\"\n[cut]\nforce = \"constant\"\nforce_n = [0, 0, 90]\nframe = \"feed\"\n";
/// let cell = Cell::read(&Source::new("cell.toml", text))?;
/// assert!(matches!(cell.cut.expect("a cut").force, CutForce::Constant { frame: ForceFrame::Feed, .. }));
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ForceFrame {
    /// The work object.
    Wobj,
    /// The TCP frame.
    Tool,
    /// x in the direction of the feed, z along the surface normal.
    Feed,
}
