//! A program's motions through the stock, in order: the material that each removes, and the force at each target if it follows from that.

mod deflected;
mod places;
mod programmed;
mod progress;
mod yielding;

use super::Prepared;
use super::context::Context;
use super::course::Course;
use super::driven::{DrivenMotion, Sampling, as_written};
use super::frames;
use super::load::{PointLoad, Through};
use super::mount::Mount;
use super::point::{FedForce, Milled, Point};
use super::segment::Kind;
use super::travel::CHORD;
use deflex_cell::Cell;
use deflex_equilibrium::Arm;
use deflex_program::{Program, Role};
use deflex_robot::Pose;
use deflex_stock::{Blank, Engaged, Front, Moment, Stock, ToolPose};
use deflex_text::limits::STOCK_LINES;
use deflex_text::{Diagnostic, Severity};
use nalgebra::{Unit, Vector3};
use places::Place;
pub use progress::CutProgress;
use std::sync::Arc;
use yielding::Stages;

/// Whose poses remove the material.
///
/// # Examples
/// ```
/// use deflex_correct::{Cuts, Options, Removal, cut_stock};
/// use deflex_cell::Cell;
/// use deflex_program::Program;
/// use deflex_text::Diagnostic;
///
/// /// The stock that the loaded arm leaves.
/// fn cut(program: &Program, cell: &Cell) -> Result<Removal, Vec<Diagnostic>> {
///     cut_stock(program, cell, &Options::default(), None, Cuts::Deflected)
/// }
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cuts {
    /// The programmed poses, which a corrected tool follows.
    Programmed,
    /// The poses of the loaded arm on the commanded path.
    Deflected,
    /// The poses of the loaded arm on the path that its controller drives, at the driven speed; on the commanded path if the cell has no law
    /// of its controller.
    Driven,
}

/// A stock that a program has cut.
///
/// # Examples
/// ```
/// use deflex_correct::Removal;
///
/// /// The volume that is removed, cm³.
/// fn removed(removal: &Removal) -> f64 {
///     1e6 * removal.stock.removed()
/// }
/// ```
#[derive(Debug)]
#[non_exhaustive]
pub struct Removal {
    /// The remaining stock.
    pub stock: Stock,
    /// Name of the work object in which it stands.
    pub wobj: Arc<str>,
    /// Notes about assumptions on the driven path.
    pub notes: Vec<Diagnostic>,
}

/// Volume above which a motion that does not cut is a collision, m³: a twentieth of a cubic millimetre, for the rounding of printed poses
/// that lift off a surface just cut.
const COLLISION: f64 = 0.05e-9;

/// Spacing of the lines without `resolution_mm`: this share of the smallest cutter's diameter, within a range, m.
const RESOLUTION_SHARE: f64 = 0.025;
const RESOLUTION: std::ops::RangeInclusive<f64> = 0.1e-3..=1e-3;
/// Largest spacing, as a share of the smallest cutter's diameter: with fewer than eight lines across the cutter, a cut can fall between them.
const COARSEST_SHARE: f64 = 0.125;

/// Cuts the cell's stock with the programmed path, and puts the forces that follow from it into the points. A program whose points were moved
/// on purpose has the forces of its original, which has cut the stock.
///
/// # Errors
/// As [`run`].
pub(super) fn cut_as_programmed(context: Context<'_>, prepared: &mut Prepared) -> Result<(), Vec<Diagnostic>> {
    if context.loads.is_none() {
        run(context, prepared, Cuts::Programmed, &context.cell.arm)?;
    }
    Ok(())
}

/// Cuts the cell's stock with a prepared program, and puts the forces that follow from it into the points. `arm` is the arm that deflects
/// with [`Cuts::Deflected`] and [`Cuts::Driven`].
///
/// # Errors
/// A stock in a work object that is not declared; motions that do not cut and run through material; `run.called-off`.
pub(super) fn run(
    context: Context<'_>,
    prepared: &mut Prepared,
    cuts: Cuts,
    arm: &Arm,
) -> Result<Option<Removal>, Vec<Diagnostic>> {
    let Context { program, cell, options, .. } = context;
    let Some(section) = &cell.stock else { return Ok(None) };
    let Some(StockMount { wobj, mount }) = stock_mount(program, cell, prepared)? else { return Ok(None) };
    let Some(blank) = &section.blank else {
        let name = section.stl.as_deref().unwrap_or_default();
        let unread = Diagnostic::error("cell.stock", "", format!("[stock] stl = \"{name}\" has not been read"));
        return Err(vec![unread.help("call Cell::take_meshes before the cell is used")]);
    };
    let smallest = prepared.shared.fronts.iter().map(|front| 2.0 * front.solid().radius).fold(f64::INFINITY, f64::min);
    let resolution = spacing(blank, section.resolution, smallest)?;
    // Only once: if the compliance of the part is known, it was computed on the path by which the program is judged.
    let is_known = prepared.points.iter().any(|point| point.part.is_some());
    let held = cell.part.as_ref().and_then(|part| part.held.as_ref()).filter(|_| cuts == Cuts::Programmed && !is_known);
    let mut walk = Walk {
        program,
        arm,
        cuts,
        stock: Stock::new(blank.clone(), resolution),
        mount,
        fronts: prepared.shared.fronts.clone(),
        progress: &options.cut_progress,
        called_off: false,
        errors: Vec::new(),
        collided: false,
        bottoms: 0,
        first_bottom: None,
        peak: 0.0,
        bound: 0.0,
        cut_length: 0.0,
        stages: held.map(Stages::new),
        motion: None,
    };
    let mut notes = Vec::new();
    if cuts == Cuts::Driven {
        let course = Course::new(program, cell, prepared);
        match course.and_then(|course| DrivenMotion::along(course, context, prepared, Sampling::All)) {
            Ok(motion) => {
                notes.extend(motion.course().notes(program, cell));
                walk.motion = cell.controller.path.is_some().then_some(motion);
            }
            Err(errors) if cell.controller.path.is_some() => notes.extend(errors.into_iter().next().map(as_written)),
            Err(_) => {}
        }
    }
    if let Some(stages) = &walk.stages {
        stages.check(&walk.stock)?;
    }
    match cuts {
        Cuts::Programmed => programmed::cut(&mut walk, prepared),
        Cuts::Deflected | Cuts::Driven => deflected::cut(&mut walk, prepared),
    }
    walk.goes_on(prepared.points.len(), prepared.points.len());
    if !walk.errors.is_empty() {
        return Err(walk.errors);
    }
    if let Some(mut stages) = walk.stages.take() {
        stages.take_last_snapshot(&walk.stock);
        let notes = stages.settle(&walk, prepared)?;
        prepared.notes.extend(notes);
    }
    if cuts == Cuts::Programmed {
        prepared.notes.extend(walk.notes(resolution, section.resolution.is_none()));
    }
    if arm.follows_load() || prepared.points.iter().any(|point| point.torque.is_some()) {
        prepared.follow_loads(arm);
    }
    Ok(Some(Removal { stock: walk.stock, wobj, notes }))
}

/// Spacing of the stock's lines, m: as declared, or from the smallest cutter, so that it fits into memory.
fn spacing(blank: &Blank, said: Option<f64>, smallest: f64) -> Result<f64, Vec<Diagnostic>> {
    let fits = |spacing: f64| STOCK_LINES.exceeded(Stock::lines_over(blank, spacing));
    // A fifth coarser at a time, from the finest spacing up to beyond any blank.
    let coarser =
        |from: f64| std::iter::successors(Some(from), |at| Some(1.2 * at)).take(400).find(|at| fits(*at).is_none());
    let chosen = (RESOLUTION_SHARE * smallest).clamp(*RESOLUTION.start(), *RESOLUTION.end());
    let wanted = said.unwrap_or(chosen);
    if let Some(said) = said.filter(|said| *said > COARSEST_SHARE * smallest) {
        let message = format!("lines {} mm apart miss the cut of a cutter of {} mm", 1e3 * said, 1e3 * smallest);
        let help =
            format!("resolution_mm is at most {:.3} for this cutter; leave it out", 1e3 * COARSEST_SHARE * smallest);
        return Err(Diagnostic::error("stock.resolution", "", message).help(help).into());
    }
    let (Some(over), least) = (fits(wanted), coarser(wanted)) else { return Ok(wanted) };
    match (said, least) {
        (None, Some(least)) => Ok(least),
        (_, least) => {
            let least =
                least.map_or_else(String::new, |least| format!(": at least {:.3} mm for this one", 1e3 * least));
            let error = Diagnostic::error("stock.resolution", "", over);
            Err(error.help(format!("{}{least}", STOCK_LINES.help)).into())
        }
    }
}

/// Where the stock stands.
struct StockMount {
    /// Name of its work object.
    wobj: Arc<str>,
    mount: Mount,
}

/// The work object of the stock: the declared one, or that of the first motion that cuts; `None` if nothing cuts.
fn stock_mount(program: &Program, cell: &Cell, prepared: &Prepared) -> Result<Option<StockMount>, Vec<Diagnostic>> {
    let declared = cell.stock.as_ref().and_then(|stock| stock.wobj.as_deref());
    let name = |i: usize| &program.wobjs[usize::from(program.targets[i].wobj)].name;
    let used = |i: usize| StockMount { wobj: Arc::clone(name(i)), mount: prepared.mount(i).clone() };
    let first = prepared.points.iter().position(|point| point.through.is_some_and(|through| through.cuts));
    let Some(declared) = declared else { return Ok(first.map(used)) };
    if let Some(i) = (0..prepared.points.len()).find(|i| name(*i).eq_ignore_ascii_case(declared)) {
        return Ok(Some(used(i)));
    }
    let Some(i) = first else { return Ok(None) };
    let at = |frame| StockMount { wobj: declared.into(), mount: Mount::new(cell, frame, *prepared.tool(i)) };
    frames::wobj(program, cell, declared).map(at).map(Some).ok_or_else(|| {
        vec![
            Diagnostic::error(
                "cell.stock",
                "",
                format!("[stock] wobj = \"{declared}\" is declared neither in the program nor in the cell"),
            )
            .help(format!("add [wobjs.{declared}] to the cell, or name the work object that the program uses")),
        ]
    })
}

/// A stock during a run of a program.
struct Walk<'a> {
    program: &'a Program,
    arm: &'a Arm,
    cuts: Cuts,
    stock: Stock,
    /// The stock's work object.
    mount: Mount,
    fronts: Vec<Arc<Front>>,
    progress: &'a CutProgress,
    called_off: bool,
    errors: Vec<Diagnostic>,
    /// Whether the motion before was a collision: of consecutive ones, only the first is reported.
    collided: bool,
    /// Number of targets where a flat bottom descends into material.
    bottoms: usize,
    first_bottom: Option<usize>,
    peak: f64,
    bound: f64,
    /// Length cut up to here, m.
    cut_length: f64,
    /// States of the stock from time to time, if the part yields.
    stages: Option<Stages>,
    /// The driven motion, if it cuts.
    motion: Option<DrivenMotion<'a>>,
}

/// Distance from the start of a segment at which its first force is computed, m.
const START_ON: f64 = 0.25e-3;

/// The results of a motion through the stock.
struct Passed {
    /// Index of its target.
    target: usize,
    through: Through,
    /// Length of the segment, m, and the removed volume, m³.
    length: f64,
    removed: f64,
    /// If the force follows from the stock: shares of the segment and the force there.
    forces: Vec<(f64, FedForce)>,
    /// The engagement at its end.
    engaged: Engaged,
    /// Sums over the segment: of the weights (m²), and of [`Met::cut`] and [`Met::left`] (m³). The weight is the section that is cut times the
    /// share of the segment.
    weight: f64,
    cut: Vector3<f64>,
    left: Vector3<f64>,
}

/// The material that the tool meets at a point.
#[derive(Clone, Copy, Default)]
struct Met {
    engaged: Engaged,
    /// The force.
    force: FedForce,
    /// Vector from the tip to where it cuts, m, stock's axes.
    cut: Vector3<f64>,
    /// Vector from the tip to the face that it leaves, m, stock's axes. The face is the envelope of the moving cutter. It touches the cutter
    /// where the motion is tangential, which is level with the axis of the tool and not in front of it.
    left: Vector3<f64>,
}

impl Met {
    /// The material that a tool meets at the end of a displacement (stock's axes).
    fn new(engaged: Engaged, force: FedForce, tool: &ToolPose, displacement: &Vector3<f64>) -> Self {
        let cut = engaged.place - tool.tip;
        let forward = displacement.try_normalize(0.0).map_or_else(Vector3::zeros, |along| along * along.dot(&cut));
        Self { engaged, force, cut, left: cut - forward }
    }
}

impl Passed {
    fn new(target: usize, through: Through, length: f64) -> Self {
        Self {
            target,
            through,
            length,
            removed: 0.0,
            forces: Vec::new(),
            engaged: Engaged::default(),
            weight: 0.0,
            cut: Vector3::zeros(),
            left: Vector3::zeros(),
        }
    }

    /// Adds the result at the next share of the segment.
    fn push(&mut self, share: f64, met: &Met) {
        let weight = share * met.engaged.section;
        self.weight += weight;
        self.cut += met.cut * weight;
        self.left += met.left * weight;
        self.engaged = met.engaged;
        if self.through.feed_per_tooth.is_some() {
            self.forces.push((share, met.force));
        }
    }
}

/// The end of a segment that cuts, from which a segment that continues straight on begins with the same material.
#[derive(Clone, Copy)]
struct End {
    /// Index of the point.
    target: usize,
    front: u32,
    feed_per_tooth: f64,
    /// Direction of the segment, stock's axes.
    direction: Vector3<f64>,
}

impl End {
    /// Sine of a turn of the path that changes the force by some thousandths.
    const STRAIGHT_ON: f64 = 2e-3;

    /// Whether a displacement (stock's axes) to another point continues straight on, with the same cutter.
    fn goes_on(&self, prepared: &Prepared, target: usize, displacement: &Vector3<f64>) -> bool {
        let (before, point) = (&prepared.points[self.target], &prepared.points[target]);
        let same = point
            .through
            .is_some_and(|through| through.front == self.front && through.feed_per_tooth == Some(self.feed_per_tooth));
        let straight = displacement.dot(&self.direction) > 0.0
            && displacement.cross(&self.direction).norm() < Self::STRAIGHT_ON * displacement.norm();
        same && straight && before.setting == point.setting
    }
}

/// A short displacement from the start of a segment. The material is computed there, because at the start the front touches what has just
/// been cut.
fn ahead(displacement: &Vector3<f64>) -> Vector3<f64> {
    displacement * (START_ON / displacement.norm()).min(0.5)
}

impl Walk<'_> {
    /// Reports the number of points that are done. Returns `false` if the run is cancelled.
    fn goes_on(&mut self, done: usize, points: usize) -> bool {
        let goes_on = self.progress.goes_on(done, points);
        // Reported once.
        if !goes_on && !std::mem::replace(&mut self.called_off, true) {
            let name = self.program.sources.first().map_or("", |source| &source.name);
            self.errors.push(Diagnostic::error("run.called-off", name, "the run was cancelled"));
        }
        goes_on
    }

    /// The wanted pose of the TCP at a target.
    fn goal(&self, point: &Point) -> Pose {
        match self.cuts {
            Cuts::Programmed => point.reference,
            Cuts::Deflected | Cuts::Driven => point.wobj_from_tcp,
        }
    }

    /// The work object of a point in the stock.
    fn stock_from_wobj(&self, prepared: &Prepared, i: usize) -> Pose {
        let point = &prepared.points[i];
        match &point.moved {
            Some(_) if self.mount.shares_wobj(prepared.mount(i)) => Pose::identity(),
            moved => {
                let setting = self.mount.at(moved.as_ref()).unwrap_or(self.mount.setting);
                setting.base_from_wobj.inverse() * prepared.base_from_wobj(i)
            }
        }
    }

    /// A TCP in the work object of a point, in the stock.
    fn tool(&self, prepared: &Prepared, i: usize, tip: &Vector3<f64>, axis: &Vector3<f64>) -> ToolPose {
        let stock_from_wobj = self.stock_from_wobj(prepared, i);
        ToolPose {
            tip: (stock_from_wobj * nalgebra::Point3::from(*tip)).coords,
            axis: Unit::new_normalize(stock_from_wobj.rotation * axis),
        }
    }

    /// The displacement to a point of the segment, work object axes, m; for the first one, that to the second.
    fn displacement(&self, places: &[Place], k: usize) -> Vector3<f64> {
        let at = |k: usize| places.get(k).map(|place| place.pose.translation.vector);
        match (k.checked_sub(1).and_then(at), at(k), at(k + 1)) {
            (Some(before), Some(here), _) => here - before,
            (None, Some(here), Some(next)) => next - here,
            _ => Vector3::zeros(),
        }
    }

    /// The engagement of a tool at the end of a displacement (stock's axes).
    fn meets(
        front: &Front,
        (stock, moment): (&Stock, &Moment),
        tool: &ToolPose,
        displacement: &Vector3<f64>,
    ) -> Engaged {
        if displacement.norm() > CHORD {
            front.engaged_at(stock, moment, tool, displacement)
        } else {
            Engaged::default()
        }
    }

    /// Adds the results of a motion.
    fn finish(&mut self, prepared: &mut Prepared, passed: Passed) {
        let Passed { target: i, through, length, removed, forces, engaged, weight, cut, left } = passed;
        let collides = !through.cuts && removed > COLLISION;
        if collides && !self.collided {
            self.collision(i, removed);
        }
        self.collided = collides;
        if engaged.bottom && through.feed_per_tooth.is_some() {
            self.bottoms += 1;
            self.first_bottom.get_or_insert(i);
        }
        self.cut_length += if removed > COLLISION { length } else { 0.0 };
        let via = i.checked_sub(1).filter(|via| self.program.targets[*via].role == Role::Via);
        if let Some(via) = via {
            prepared.points[via].cut_length = self.cut_length;
        }
        // Where it leaves the material, the flank touches the face anywhere and cuts next to nothing.
        let mean = |sum: Vector3<f64>| if weight > 0.0 { sum / weight } else { Vector3::zeros() };
        let mut milled = Milled { removed, cut: mean(cut), left: mean(left), ..Milled::default() };
        if through.feed_per_tooth.is_some() {
            milled.engaged = Some([engaged.depth, engaged.arc]);
            milled.forces = forces.into();
            if let Some(via) = via
                && let (Some(force), Some(_)) =
                    (milled.at(0.5), prepared.points[via].through.and_then(|t| t.feed_per_tooth))
            {
                prepared.points[via].load = PointLoad::of_stock(force.programmed);
            }
        }
        let point = &mut prepared.points[i];
        if let (Some(_), Some((_, force))) = (through.feed_per_tooth, milled.forces.last()) {
            point.load = PointLoad::of_stock(force.programmed);
        }
        point.cut_length = self.cut_length;
        point.milled = Some(Box::new(milled));
    }

    /// Adds the size of a force, and the bound of its error because of the rim.
    fn weigh(&mut self, engaged: &Engaged, force: &Vector3<f64>, feed_per_tooth: f64) {
        self.peak = self.peak.max(force.norm());
        self.bound = self.bound.max(engaged.bound[0] + feed_per_tooth * engaged.bound[1]);
    }

    fn collision(&mut self, i: usize, removed: f64) {
        let target = &self.program.targets[i];
        let kind = match (Kind::of(self.program, i), target.feed_mm_s) {
            (Kind::Joint, _) => "a joint move",
            (_, None) if !target.rapid => "a move without a known speed, which counts as one that does not cut,",
            _ => "a move that does not cut",
        };
        let message = format!(
            "target {}: {kind} runs through the stock and would remove {:.2} mm³",
            target.ordinal,
            1e9 * removed
        );
        self.errors.push(self.program.error_at(target, "stock.rapid", message).help(
            "retract above the material first, or check [stock]: its box, its work object, and `max_cutting_feed_mm_s`",
        ));
    }

    fn notes(&self, resolution: f64, chosen: bool) -> Vec<Diagnostic> {
        let mut notes = Vec::new();
        let why = if chosen { ", which follows from the smallest cutter" } else { "" };
        let share = if self.peak > 0.0 { 100.0 * self.bound / self.peak } else { 0.0 };
        let message = format!(
            "stock: computed with lines {:.3} mm apart{why}; the rim of the engaged surface leaves the cutting force uncertain by {:.1} N ({share:.1} % of the largest force)",
            1e3 * resolution,
            self.bound
        );
        notes.push(Diagnostic::error("stock.resolution", "", message).severity(Severity::Note));
        if let Some(i) = self.first_bottom {
            let target = &self.program.targets[i];
            let message = format!(
                "target {}: the flat bottom of the cutter plunges into material{}: the model has the forces on its corner and side, but not that on its bottom",
                target.ordinal,
                if self.bottoms > 1 { format!(" (and at {} targets more)", self.bottoms - 1) } else { String::new() }
            );
            let said = self.program.error_at(target, "stock.bottom", message).severity(Severity::Warning);
            notes.push(said.help("ramp in gently, and expect a larger force there"));
        }
        notes
    }
}
