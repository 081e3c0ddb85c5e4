//! The pipeline from a program and a cell to corrected poses and report rows.
//!
//! ```text
//! targets → frames (tools, work objects) → path (poses, joints, feed, cut)
//!         → solve (uncorrected error, command) → rewrite → verify (forward, on the numbers as written)
//! ```
//! Each stage is a pass over all points in running order. Everything that depends on the point before (branch, feed,
//! travel) is computed in a cheap ordered pass. Equilibria are solved in parallel and collected in order, so that the same
//! program gives the same bytes for any number of threads.

mod against;
mod ahead;
mod along;
mod between;
mod carried;
mod collected;
mod compared;
mod context;
mod contradictions;
mod corrected;
mod correction;
mod course;
mod cut_stock;
mod deviation;
mod driven;
mod flow;
mod followed;
mod frames;
mod free_turn;
mod halved;
mod inserted;
mod judge;
mod kept;
mod laws;
mod line;
mod load;
mod loads_before;
mod long;
mod machine_actions;
mod messages;
mod mount;
mod ordered;
mod original_loads;
mod parallelism;
mod path;
mod point;
mod poses;
mod post;
mod refusal;
mod remarks;
mod removal;
mod row;
mod segment;
mod shaped;
mod sigma;
mod solve;
mod spin;
mod stance;
mod stiffness;
mod stream;
mod subdivide;
mod travel;

pub use along::{WayFault, WayFinding};
pub use between::Between;
pub use carried::ChosenTurns;
pub use corrected::{Corrected, DrivenFigures, DrivenSummary, Posted};
pub use course::{Course, LoadedPath, LoadedSample};
pub use cut_stock::cut_stock;
pub use deviation::PathDeviation;
pub use driven::loaded_path;
pub use flow::{Sinks, StreamError, Streamed};
pub use frames::{declared_names, named_tool};
pub use free_turn::choose_turns;
pub(crate) use free_turn::has_free_turns;
pub use judge::{Judge, Judged, predict_chunks};
pub use kept::{KeptCount, KeptReason};
pub use line::{compensate, predict};
pub use long::{LaidOut, compensate_long, post_long, predict_long};
pub use messages::Messages;
pub use point::Point;
pub use poses::{ArmState, Standing, external_of, predict_poses, tool_of};
pub use post::{Outline, PostOptions, PostedProgram, Poster, RAPID_MM_S, post};
pub use removal::{CutProgress, Cuts, Removal};
pub use row::{Row, RowNames, Stance, Status, Stiffness, Summary};
pub use shaped::{DrivenCompensation, compensate_driven};
pub use sigma::SIGMA_STEP;
pub use stance::millimetres_and_degrees;
pub use stream::{compensate_chunks, compensate_declared, compensate_executed, post_chunks};

use context::Context;
use deflex_cell::{Cell, CutForce, SpinRule};
use deflex_effects::{Presliding, Situation, ToolFrame};
use deflex_equilibrium::Dragged;
use deflex_equilibrium::{Setting, Site};
use deflex_measured::Forces;
use deflex_program::{Language, Program};
use deflex_robot::{External, Joints, Pose, Robot, StartedFrom};
use deflex_stock::Front;
use deflex_text::Diagnostic;
use mount::Mount;
use std::sync::Arc;

/// The part of a target's pose that is corrected.
///
/// # Examples
/// ```
/// use deflex_correct::{Correct, Options};
///
/// let options = Options { correct: Correct::Position, ..Options::default() }; // orientations stay as they are
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Correct {
    /// Position and orientation.
    #[default]
    Pose,
    /// Position only: orientation tokens stay. The loaded TCP still lands on the programmed position.
    Position,
}

/// Options of a run.
///
/// # Examples
/// ```
/// use deflex_correct::{Correct, Options};
///
/// // Correct positions alone, and insert targets until at most 0.02 mm remains between two of them.
/// let options = Options { correct: Correct::Position, subdivide: Some(2e-5), ..Options::default() };
/// ```
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Whether pose or position is corrected.
    pub correct: Correct,
    /// Forces, times, temperatures and payloads by target; overrides `[cut]`.
    pub forces: Option<Forces>,
    /// A tool of the cell to use for every target instead of the program's.
    pub tool: Option<String>,
    /// Declared targets used with different corrections may get clones.
    pub allow_clones: bool,
    /// The language in which CL data are posted; `None` means RAPID.
    pub post: Option<Language>,
    /// Insert targets until the error between targets is below this, m.
    pub subdivide: Option<f64>,
    /// Compute the stiffness of the TCP at every target too: six more equilibria each.
    pub stiffness: bool,
    /// Report the posture of the arm at every target too.
    pub stance: bool,
    /// Choose the turn about the tool axis of RAPID targets for the least predicted error, instead of the written one.
    pub free_spin: bool,
    /// The turns about the tool axis, if [`choose_turns`] has chosen them already. With `None` the run chooses those that are free.
    pub turns: Option<ChosenTurns>,
    /// Receives the progress of the cuts of the stock with which the run begins: one along the programmed path, and one by the deflected
    /// tool if a program is predicted or simulated.
    pub cut_progress: CutProgress,
}

impl Options {
    /// Whether forces come from a table. A table with times or temperatures alone leaves them to `[cut]` of the cell, if that has a force.
    fn has_force_table(&self, cell: &Cell) -> bool {
        let has_own = cell.cut.as_ref().is_some_and(|cut| !matches!(cut.force, CutForce::Table));
        self.forces.as_ref().is_some_and(|forces| forces.forces_given || !has_own)
    }
}

/// Whether programs of a cell can only be corrected as a whole: they cut a stock, or the whole path is checked for the accelerations of its
/// axes.
#[must_use]
#[doc(hidden)]
pub fn holds_whole(cell: &Cell) -> bool {
    cell.stock.is_some() || cell.controller.path.is_some_and(|path| path.law.limits_axes())
}

/// Whether a program can only be corrected as a whole, because of its cell or because its turns about the tool axis are still to be chosen.
fn is_held_whole(cell: &Cell, options: &Options) -> bool {
    let stiffest = cell.cl.as_ref().is_some_and(|cl| cl.spin.rule == SpinRule::Stiffest);
    holds_whole(cell) || (options.turns.is_none() && (options.free_spin || stiffest))
}

/// A program with everything that precedes its equilibria. Callers with computations of their own use it, such as the alignment of
/// measured rows.
///
/// # Examples
/// ```
/// # let (program, cell) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/slot.rs"));
/// use deflex_correct::{Options, Prepared};
///
/// let prepared = Prepared::new(&program, &cell, &Options::default())?;
/// assert_eq!(prepared.points.len(), program.targets.len());
/// println!("work object at {}", prepared.base_from_wobj(0));
/// assert!(prepared.tool(0).mass > 0.0 && prepared.situation(0).payload == 0.0); // kg
/// let pose = prepared.points[0].wobj_from_tcp;
/// assert!((prepared.seen(0, pose).translation.vector - pose.translation.vector).norm() < 1e-9); // the tool moves, not the part
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Debug)]
pub struct Prepared {
    /// One point for each target of the program, in running order, then those that were added between targets.
    pub points: Vec<Point>,
    /// Positions of the added points.
    between: Vec<Between>,
    /// The last point before these, if they are a chunk of a program.
    before: Option<Point>,
    /// How the first target's branch was chosen.
    pub(crate) started: StartedFrom,
    shared: Arc<Shared>,
    /// Whether the turns about the tool axis were chosen, and are not the program's.
    turns_are_chosen: bool,
    /// Notes about the stock, each once.
    notes: Vec<Diagnostic>,
}

/// Data to which many points refer by index.
#[derive(Clone, Debug, Default)]
struct Shared {
    /// Tools, work objects and units of the points.
    settings: Vec<Mount>,
    /// Laws of the cutting force.
    laws: Vec<laws::Law>,
    /// Cutters in the stock.
    fronts: Vec<Arc<Front>>,
}

impl Prepared {
    /// Computes poses, joints, feed and cut of every target.
    ///
    /// # Errors
    /// Tools or work objects are not declared, targets are out of reach, forces are missing: every reason that was found.
    pub fn new(program: &Program, cell: &Cell, options: &Options) -> Result<Self, Vec<Diagnostic>> {
        Self::of(Context::whole(program, cell, options))
    }

    /// The same in a context.
    fn of(context: Context<'_>) -> Result<Self, Vec<Diagnostic>> {
        let mut prepared = path::prepare(context, &mut free_turn::carried(context)?)?;
        removal::cut_as_programmed(context, &mut prepared)?;
        Ok(prepared)
    }

    /// Points that were measured without a program; their work object is the base.
    #[doc(hidden)]
    pub fn of_points(points: Vec<Point>, robot: &Robot, tool: ToolFrame) -> Self {
        Self::of_points_in(Pose::identity(), points, robot, tool)
    }

    /// Points in one work object, without a program.
    #[doc(hidden)]
    pub fn of_points_in(base_from_wobj: Pose, points: Vec<Point>, robot: &Robot, tool: ToolFrame) -> Self {
        let base = Setting { base_from_wobj, gravity: robot.gravity(), tool, held: false };
        let shared = Arc::new(Shared { settings: vec![Mount::fixed(base)], ..Shared::default() });
        Self::sharing(shared, points, StartedFrom::JointTarget)
    }

    /// Travel into every point along the programmed motion, with friction that builds up over the presliding angles.
    #[doc(hidden)]
    pub fn travels(&self, presliding: &Presliding) -> Vec<Joints> {
        let mut last: Option<Dragged> = None;
        let into = |point: &Point| {
            let (motor, twist) = (point.motor, point.twist());
            let travel = last.map_or_else(Joints::zeros, |last| last.travel_to(&motor, &twist, presliding));
            last = Some(Dragged { motor, twist, travel });
            travel
        };
        self.points.iter().map(into).collect()
    }

    /// Moves the work objects; the points and the measured forces at them stay as they are in the base.
    #[doc(hidden)]
    pub fn place_in(&mut self, base_from_wobj: impl Fn(&Pose) -> Pose) {
        let before = self.shared.settings.clone();
        let settings = &mut Arc::make_mut(&mut self.shared).settings;
        for Mount { setting, .. } in settings.iter_mut() {
            setting.base_from_wobj = base_from_wobj(&setting.base_from_wobj);
        }
        for point in &mut self.points {
            let at = point.setting as usize;
            let base_from_tcp = before[at].setting.base_from_wobj * point.wobj_from_tcp;
            point.wobj_from_tcp = settings[at].setting.base_from_wobj.inv_mul(&base_from_tcp);
            point.reference = point.wobj_from_tcp;
            let turned =
                settings[at].setting.base_from_wobj.rotation.inverse() * before[at].setting.base_from_wobj.rotation;
            point.turn_measured_force(&turned);
        }
    }

    /// Some of the points with the work object moved and turned by `by`, in its own axes, together with all poses in it. `None` for points
    /// that the arm does not reach there.
    #[doc(hidden)]
    pub fn relocated(&self, robot: &Robot, points: &[usize], by: &Pose) -> (Self, Vec<Option<usize>>) {
        let mut there = self.with_points(Vec::new());
        for mount in &mut Arc::make_mut(&mut there.shared).settings {
            mount.setting.base_from_wobj *= *by;
        }
        let place = |&from: &usize| {
            let mut point = self.points[from].clone();
            if let Some(moved) = &mut point.moved {
                Arc::make_mut(moved).setting.base_from_wobj *= *by;
            }
            there.points.push(point);
            let at = there.points.len() - 1;
            let base_from_tcp = there.base_from_wobj(at) * there.points[at].wobj_from_tcp;
            let flange = base_from_tcp * there.tool(at).flange_from_tcp.inverse();
            match robot.inverse_near(&flange, &there.points[at].motor) {
                Ok(motor) => {
                    there.points[at].motor = motor;
                    Some(at)
                }
                Err(_) => {
                    there.points.pop();
                    None
                }
            }
        };
        let placed = points.iter().map(place).collect();
        (there, placed)
    }

    /// Declared work object of point `i` in the base.
    #[must_use]
    pub fn base_from_wobj(&self, i: usize) -> Pose {
        let setting = self.setting(i);
        if setting.held {
            return setting.base_from_wobj * self.points[i].reference.inverse();
        }
        setting.base_from_wobj
    }

    /// The TCP in the work object of point `i`, from a pose that was computed with [`Prepared::situation`].
    #[must_use]
    pub fn seen(&self, i: usize, pose: Pose) -> Pose {
        self.points[i].seen(self.setting(i), pose)
    }

    /// Declared tool of point `i`; with a stationary tool, the work object in the flange.
    #[must_use]
    pub fn tool(&self, i: usize) -> &ToolFrame {
        &self.setting(i).tool
    }

    /// Laws of the cutting force.
    fn laws(&self) -> &[laws::Law] {
        &self.shared.laws
    }

    /// Other points with the same settings and laws.
    fn with_points(&self, points: Vec<Point>) -> Self {
        Self::sharing(Arc::clone(&self.shared), points, self.started)
    }

    fn sharing(shared: Arc<Shared>, points: Vec<Point>, started: StartedFrom) -> Self {
        Self { points, between: Vec::new(), before: None, started, shared, turns_are_chosen: false, notes: Vec::new() }
    }

    /// Whether the robot holds the part against a stationary tool at point `i`.
    #[doc(hidden)]
    pub fn is_held(&self, i: usize) -> bool {
        self.setting(i).held
    }

    fn setting(&self, i: usize) -> &Setting {
        let point = &self.points[i];
        point.moved.as_ref().map_or_else(|| &self.mount(i).setting, |moved| &moved.setting)
    }

    /// Tool, work object and units of point `i`, at any position of the units.
    fn mount(&self, i: usize) -> &Mount {
        &self.shared.settings[self.points[i].setting as usize]
    }

    /// External axes at point `i`, mm or degrees; NaN for one that is not known, `None` if there are none.
    #[must_use]
    #[doc(hidden)]
    pub fn external(&self, i: usize) -> Option<&External> {
        self.points[i].moved.as_ref().map(|moved| &moved.external)
    }

    /// Why the target of point `i` is not solved; `None` if it is.
    #[must_use]
    #[doc(hidden)]
    pub fn unsolved(&self, i: usize) -> Option<KeptReason> {
        self.points[i].unsolved
    }

    /// Error at the contact point of point `i` along its surface normal, m.
    #[doc(hidden)]
    pub fn normal_error(&self, i: usize, actual: &Pose) -> f64 {
        let point = &self.points[i];
        let shift = actual.translation.vector - point.reference.translation.vector;
        point.normal_error(&self.shared.laws, &shift, &point::tool_axis(actual))
    }

    /// The situation of point `i`, for the two computations of [`Arm`](deflex_equilibrium::Arm).
    #[must_use]
    pub fn situation(&self, i: usize) -> Situation<'_> {
        self.points[i].situation(self.setting(i), &self.shared.laws)
    }

    /// The part of the situation that simple effects need.
    pub(crate) fn site(&self, i: usize) -> Site<'_> {
        self.points[i].site(self.setting(i), &self.shared.laws)
    }
}
