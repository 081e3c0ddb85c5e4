//! Plans measurements that distinguish effects: which targets, in which order, under which loads.
//!
//! ```text
//! [plan] → spots that the arm reaches → rows by exchange → a program for the cell's controller and an empty table
//!        → both read as `identify` will read them → d′ of each pair, and how often simulated effects are named correctly
//! ```

mod criterion;
mod draws;
mod exchange;
mod judge;
mod pool;
mod sheet;
mod write;

use super::candidate::{Candidate, with};
use super::candidates;
use super::identify::LEAST_ROWS;
use criterion::Criterion;
use deflex_cell::{Cell, PlanSection};
use deflex_correct::{millimetres_and_degrees, named_tool};
use deflex_effects::{Shape, ToolFrame, kind};
use deflex_program::{Language, Program};
use deflex_robot::Pose;
use deflex_text::Diagnostic;
use draws::Draws;
use exchange::Exchange;
use nalgebra::Vector3;
use pool::Spot;
use serde::Serialize;
use sheet::{Bench, Row, Sheet};

/// Speeds of the TCP into a row, m/s. Two speeds distinguish errors that grow with the speed.
const SPEEDS: [f64; 2] = [0.02, 0.06];
/// Largest number of variants of a kind: a few of dozens of time constants represent all of them.
const VARIANTS: usize = 3;
/// Number of random rows over which the size of every effect is defined before there is a plan.
const REFERENCE: usize = 60;

/// The input of a plan.
///
/// # Examples
/// ```
/// use deflex_identify::{Ask, PlanInput, PlanProgram};
/// use deflex_cell::Cell;
/// use deflex_program::Language;
///
/// /// The input for a plan of 24 rows anywhere in the box of `[plan]`.
/// fn input(cell: &Cell) -> PlanInput<'_> {
///     let program = PlanProgram { name: "plan", language: Language::Rapid, ask: Ask::Never };
///     PlanInput { cell, rows: 24, pool: &[], undecided: &[], program, progress: &|_| () }
/// }
/// ```
pub struct PlanInput<'a> {
    /// The declared cell, with `[plan]`.
    pub cell: &'a Cell,
    /// Number of rows to measure.
    pub rows: usize,
    /// Programs whose targets are the places to choose from. If there are none, any place in the box of `[plan]` can be
    /// chosen.
    pub pool: &'a [Program],
    /// Pairs of kinds that an identification left undecided. They count more than all other pairs; if there are none,
    /// all pairs count alike.
    pub undecided: &'a [(String, String)],
    /// How the program is written.
    pub program: PlanProgram<'a>,
    /// Receives the share of the work that is done.
    pub progress: &'a (dyn Fn(f64) + Sync),
}

/// How the program of a plan is written.
///
/// # Examples
/// ```
/// use deflex_identify::{Ask, PlanProgram};
/// use deflex_program::Language;
///
/// let program = PlanProgram { name: "plan", language: Language::Rapid, ask: Ask::Load };
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlanProgram<'a> {
    /// Its name, from which an identifier is made.
    pub name: &'a str,
    /// RAPID, KRL or TP.
    pub language: Language,
    /// When the program waits for the operator.
    pub ask: Ask,
}

/// When the program of a plan waits until the operator lets it continue.
///
/// # Examples
/// ```
/// use deflex_identify::Ask;
///
/// assert_eq!(Ask::default(), Ask::Never); // the program waits for ten seconds at each target
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Ask {
    /// Never: it waits for ten seconds at each target.
    #[default]
    Never,
    /// At each change of the load.
    Load,
    /// At each target, and at each change of the load.
    Target,
}

/// A measurement plan.
///
/// # Examples
/// ```
/// use deflex_identify::Plan;
///
/// /// What a plan promises.
/// fn promise(plan: &Plan) -> String {
///     format!("{} rows in {:.0} min, {:.0} % named", plan.rows.len(), plan.duration_s / 60.0, 100.0 * plan.chance_right)
/// }
/// ```
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct Plan {
    /// Rows in running order.
    pub rows: Vec<PlannedRow>,
    /// Every pair of kinds, the hardest to distinguish first.
    pub pairs: Vec<PlannedPair>,
    /// The pair that is hardest to distinguish.
    pub weakest: Option<PlannedPair>,
    /// Expected probability that one effect of `effect_mm`, of any kind, is named outright, and no other.
    pub chance_right: f64,
    /// Expected probability that another effect is named outright.
    pub chance_wrong: f64,
    /// The same for each kind; the kind that is least often named correctly is the first.
    pub kinds: Vec<PlannedKind>,
    /// Number of simulated measurements.
    pub simulated: usize,
    /// Number of changes of the load.
    pub load_changes: usize,
    /// Time that the measurement takes, s: the travel, ten seconds for each row, two minutes for each change of the
    /// load.
    pub duration_s: f64,
    /// Notes for the reader of the plan.
    pub notes: Vec<String>,
    /// The robot's base in the work object: position, mm, and rotation vector, degrees.
    #[serde(skip)]
    pub wobj_from_base: [f64; 6],
    /// The program.
    #[serde(skip)]
    pub program: String,
    /// The table, with empty measured columns.
    #[serde(skip)]
    pub table: String,
}

/// One row to measure.
///
/// # Examples
/// ```
/// use deflex_identify::Plan;
///
/// /// The targets at which the arm carries a load.
/// fn loaded(plan: &Plan) -> Vec<u32> {
///     plan.rows.iter().filter(|row| row.load_n != [0.0; 3]).map(|row| row.target).collect()
/// }
/// ```
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct PlannedRow {
    /// Ordinal of the target in the program.
    pub target: u32,
    /// TCP in the work object, mm.
    pub position_mm: [f64; 3],
    /// Orientation, scalar first.
    pub quat: [f64; 4],
    /// Axis angles, degrees.
    pub axes_deg: [f64; 6],
    /// Force on the tool, work object axes, N.
    pub load_n: [f64; 3],
    /// Time from the first row, s.
    pub time_s: f64,
    /// Whether `identify` will hold it out.
    pub held_out: bool,
}

/// How well the planned rows distinguish two kinds.
///
/// # Examples
/// ```
/// use deflex_identify::Plan;
///
/// /// The two kinds that the plan distinguishes least.
/// fn weakest(plan: &Plan) -> Option<(&str, &str)> {
///     plan.weakest.as_ref().map(|pair| (&*pair.a, &*pair.b))
/// }
/// ```
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct PlannedPair {
    /// The kind that is there.
    pub a: String,
    /// The kind that may be named in its place.
    pub b: String,
    /// The part of the trace of `a` that `b` cannot imitate, over the noise: above 5 the two can be distinguished,
    /// below 3 they cannot.
    pub d_prime: f64,
    /// The reason, if `d_prime` is small.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub why: Option<&'static str>,
}

/// How well the planned rows show one kind.
///
/// # Examples
/// ```
/// use deflex_identify::Plan;
///
/// /// The kind that is least often named correctly.
/// fn hardest(plan: &Plan) -> Option<&str> {
///     plan.kinds.first().map(|kind| &*kind.kind)
/// }
/// ```
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct PlannedKind {
    /// The kind that is there.
    pub kind: String,
    /// d′ from no effect.
    pub d_prime: f64,
    /// Expected probability that it alone is named outright.
    pub chance_right: f64,
    /// Expected probability that another kind is named outright.
    pub chance_wrong: f64,
}

/// The frames of the cell.
#[derive(Clone, Copy, Debug)]
struct Frames {
    base_from_wobj: Pose,
    world_from_wobj: Pose,
    tool: ToolFrame,
}

impl Frames {
    fn base_from_flange(&self, wobj_from_tcp: &Pose) -> Pose {
        self.base_from_wobj * wobj_from_tcp * self.tool.flange_from_tcp.inverse()
    }
}

/// Makes a measurement plan.
///
/// # Errors
/// No `[plan]`, too few rows, no place that the arm reaches, loads on an arm without a stiffness.
///
/// # Examples
/// ```no_run
/// use deflex_identify::{Ask, PlanInput, PlanProgram, plan};
/// use deflex_cell::Cell;
/// use deflex_program::Language;
/// use deflex_text::Source;
///
/// let cell = Cell::read(&Source::new("cell.toml", std::fs::read("cell.toml")?))?; // with a [plan] table
/// let program = PlanProgram { name: "plan", language: Language::Rapid, ask: Ask::Never };
/// let plan = plan(&PlanInput { cell: &cell, rows: 24, pool: &[], undecided: &[], program, progress: &|_| () })?;
/// println!("{} rows", plan.rows.len());
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
pub fn plan(input: &PlanInput) -> Result<Plan, Vec<Diagnostic>> {
    let cell = input.cell;
    let section = section(cell)?;
    if input.rows < LEAST_ROWS {
        let message = format!("--rows {}: {LEAST_ROWS} rows are the fewest that can be fitted and judged", input.rows);
        return Err(vec![
            Diagnostic::error("plan.rows", "", message).help("24 rows are enough for most single effects"),
        ]);
    }
    let world_from_wobj = cell.wobjs.get(&section.wobj.to_ascii_uppercase()).copied().unwrap_or_else(Pose::identity);
    let frames = Frames {
        base_from_wobj: cell.arm.robot.world_from_base.inverse() * world_from_wobj,
        world_from_wobj,
        tool: named_tool(cell, &section.tool)?,
    };
    let mut notes = Vec::new();
    let spots = if input.pool.is_empty() {
        pool::spots(cell, section, &frames)
    } else {
        pool::of_programs(cell, section, input.pool, &mut notes)?
    };
    if spots.len() < LEAST_ROWS {
        let message =
            format!("only {} places are reached well within the axis limits and off singular wrists", spots.len());
        let help = "move or enlarge box_mm of [plan], allow more tilt_deg, or check wobj, tool and [robot]";
        return Err(vec![Diagnostic::error("cell.plan", "", message).help(help)]);
    }
    let arm = with(&cell.arm, &[]);
    let bench = Bench { section, arm: &arm, frames, spots, start: cell.start, speed_unit: cell.controller.speed_unit };
    let mut draws = Draws::of(3);
    let reference = start(&bench, REFERENCE, &mut draws)?;
    let sheet = start(&bench, input.rows, &mut draws)?;
    let all: Vec<usize> = (0..reference.rows.len()).collect();
    let mut listed = listed(candidates::all(&arm, &bench.problem(&reference, &all), &cell.covariances));
    let named = named(section, &listed, &mut notes)?;
    // The frame of the part is a nuisance, also if it need not be detected.
    listed.retain(|c| named.contains(&c.kind) || c.law().is_some_and(|law| law.like_device_frame));
    let columns = bench.columns(&mut listed, &reference, &all);
    let count = listed.iter().map(|candidate| candidate.columns().end).max().unwrap_or(0);
    let nuisance = (count..columns.ncols() + bench.drifts(&reference).ncols()).collect();
    let mut criterion = Criterion::new(&listed, &named, nuisance, (section.noise_mm, bench.axes()));
    criterion.scale(&columns, section.effect_mm);
    if !input.undecided.is_empty() {
        criterion.favour_undecided(input.undecided);
    }
    let exchange = Exchange { bench: &bench, criterion: &criterion, candidates: &listed, speeds: SPEEDS.to_vec() };
    let sheet = exchange.run(sheet, &|share| (input.progress)(0.7 * share));
    let rows = write::rows(&bench, &sheet);
    let program = write::program(&bench, &sheet, &input.program)?;
    let table = write::table(section, &rows);
    let judged = judge::judge(cell, section, (&program, input.program.language), &rows, &named, &|share| {
        (input.progress)(0.7 + 0.3 * share)
    })?;
    let load_changes = sheet.loads.windows(2).filter(|pair| pair[0] != pair[1]).count();
    let duration_s = rows.last().map_or(0.0, |row| row.time_s);
    let wobj_from_base = millimetres_and_degrees(&bench.frames.base_from_wobj.inverse());
    Ok(Plan {
        rows,
        weakest: judged.pairs.first().cloned(),
        pairs: judged.pairs,
        chance_right: judged.right,
        chance_wrong: judged.wrong,
        kinds: judged.kinds,
        simulated: judged.simulated,
        load_changes,
        duration_s,
        notes,
        wobj_from_base,
        program,
        table,
    })
}

/// The section `[plan]` of the cell, if it has one that can be planned from.
fn section(cell: &Cell) -> Result<&PlanSection, Vec<Diagnostic>> {
    let Some(section) = &cell.plan else {
        let help = "add [plan] with wobj, tool, box_mm, tilt_deg, instrument, noise_mm and effect_mm (docs/formats.md)";
        return Err(vec![Diagnostic::error("cell.plan", "", "the cell has no [plan] section").help(help)]);
    };
    let loaded = section.loads.iter().any(|load| *load != Vector3::zeros());
    if loaded && cell.arm.stiffness.is_none() {
        let help = "add joint_nm_per_rad = [ … ] to [robot.stiffness], or plan without loads_n";
        let message = "[plan] loads_n acts on an arm, but the cell declares no [robot.stiffness]";
        return Err(vec![Diagnostic::error("cell.plan", "", message).help(help)]);
    }
    Ok(section)
}

/// The candidates that a plan can be made for: laws with few numbers, and a few variants of each kind.
fn listed(all: Vec<Candidate>) -> Vec<Candidate> {
    let is_law = |c: &Candidate| c.is_typical_size() && c.law().is_some_and(|law| law.shape == Shape::Law);
    let all: Vec<Candidate> = all.into_iter().filter(is_law).collect();
    let mut kept: Vec<Candidate> = Vec::new();
    for candidate in &all {
        if kept.iter().any(|known| known.kind == candidate.kind) {
            continue;
        }
        let of: Vec<&Candidate> = all.iter().filter(|other| other.kind == candidate.kind).collect();
        let count = of.len().min(VARIANTS);
        kept.extend((0..count).map(|i| of[(2 * i + 1) * of.len() / (2 * count)].clone()));
    }
    kept
}

/// The kinds to distinguish: those that `[plan]` names, or all. A note names those that no rows of this plan can show.
fn named(section: &PlanSection, listed: &[Candidate], notes: &mut Vec<String>) -> Result<Vec<String>, Vec<Diagnostic>> {
    let mut all: Vec<String> = listed.iter().map(|candidate| candidate.kind.clone()).collect();
    all.dedup();
    if section.effects.is_empty() {
        return Ok(all);
    }
    let (there, missing): (Vec<&str>, Vec<&str>) =
        section.effects.iter().partition(|name| all.iter().any(|kind| kind == **name));
    if !missing.is_empty() {
        let curve = |name: &&str| kind(name).is_some_and(|kind| kind.shape != Shape::Law);
        let why = match missing.iter().any(curve) {
            true => "harmonics, curves and maps need many rows along a joint, not a few that are well chosen",
            false => "no load, time or temperature of this plan shows them",
        };
        notes.push(format!("not planned for: {} ({why})", missing.join(", ")));
    }
    if there.is_empty() {
        let message = format!("no rows of this plan show {}", missing.join(", "));
        return Err(vec![
            Diagnostic::error("cell.plan", "", message).help("name others in [plan] effects, or add loads_n"),
        ]);
    }
    Ok(there.into_iter().map(str::to_owned).collect())
}

/// Random rows from which an exchange begins, with as many changes of the load as `[plan]` allows.
fn start(bench: &Bench, count: usize, draws: &mut Draws) -> Result<Sheet, Vec<Diagnostic>> {
    /// Number of spots that are tried for a row before the row before it is removed again.
    const TRIED: usize = 200;
    /// Number of removed rows after which the search for rows fails.
    const GIVEN_UP: usize = 1000;
    let mut given_up = 0;
    let mut rows: Vec<Row> = Vec::with_capacity(count);
    let spot = |row: Option<&Row>| -> Option<&Spot> { row.map(|row| &bench.spots[row.spot]) };
    while rows.len() < count {
        let new = (0..TRIED).find_map(|_| {
            let new = Row { spot: draws.index(bench.spots.len()), speed: SPEEDS[draws.index(SPEEDS.len())] };
            bench.follows(spot(rows.last()), &bench.spots[new.spot]).then_some(new)
        });
        match new {
            Some(new) => rows.push(new),
            None if given_up == GIVEN_UP => {
                let message = "the arm does not come from one place to the next without changing its branch";
                let help = "give `[robot] start_deg` as the arm stands there, a larger box_mm, or a longer --pool";
                return Err(vec![Diagnostic::error("cell.plan", "", message).help(help)]);
            }
            None => {
                given_up += 1;
                rows.pop();
            }
        }
    }
    let stretches = if bench.section.loads.len() > 1 { (bench.section.load_changes + 1).min(count) } else { 1 };
    let loads = (0..count).map(|i| (i * stretches / count) % bench.section.loads.len()).collect();
    Ok(Sheet { rows, loads })
}
