//! The main loop of an identification: it linearises about the present fit, compares sets by their evidence, chooses
//! one, fits it, and begins again until the set no longer changes.

use super::candidate::{Candidate, Home, twins, with};
use super::candidates;
use super::columns::Columns;
use super::data::{Observation, Problem};
use super::decisions::NAMED;
use super::design::Design;
use super::device::Device;
use super::device_pose;
use super::differences::Reuse;
use super::found::{Choice, Findings, Linearised, Map, Members, Ranking, Refused};
use super::gear::{self, Comb, Grid, Term};
use super::moments::Moments;
use super::noise;
use super::outcome::{Identification, SetShare};
use super::score::{Score, posterior, score};
use super::search::{Search, sorted};
use deflex_cell::Cell;
use deflex_effects::Shape;
use deflex_equilibrium::Arm;
use deflex_measured::Table;
use deflex_program::Program;
use deflex_text::Diagnostic;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};

/// The input of an identification. Programs and tables are dropped as soon as their rows are read, because with
/// hundreds of thousands of rows they are most of the memory.
///
/// # Examples
/// ```
/// # use deflex_cell::Cell;
/// # use deflex_measured::Table;
/// # use deflex_program::rapid;
/// # use deflex_text::Source;
/// # let read = |name: &str| std::fs::read(format!("../../samples/closed-loop/{name}")).map(|bytes| Source::new(name, bytes));
/// # let cell = Cell::read(&read("cell.toml")?)?;
/// # let program = rapid::read(vec![read("part.mod")?], vec![])?;
/// # let table = Table::read(&read("measured.csv")?)?;
/// use deflex_identify::{Input, Written};
///
/// let input = Input {
///     cell: &cell,
///     runs: vec![(program, table).into()],
///     poses: vec![],
///     tool: None,
///     data_hash: "hash of the data",
///     written: Written::WholeModel,
///     progress: &|share| share < 1.0,
/// };
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
pub struct Input<'a> {
    /// The declared cell.
    pub cell: &'a Cell,
    /// Programs with what was measured on them.
    pub runs: Vec<MeasuredRun>,
    /// Measured rows with their own motor angles.
    pub poses: Vec<Table>,
    /// The tool of `poses`; needed if the cell has several.
    pub tool: Option<&'a str>,
    /// Hash of the data, for the provenance of the effects that are added.
    pub data_hash: &'a str,
    /// Which effects of the model go into the cell.
    pub written: Written,
    /// Receives the share of the work that is done, estimated from the rounds; returning `false` cancels the run.
    pub progress: &'a Progress<'a>,
}

/// A program with what was measured on it.
///
/// # Examples
/// ```
/// # use deflex_cell::Cell;
/// # use deflex_measured::Table;
/// # use deflex_program::rapid;
/// # use deflex_text::Source;
/// # let read = |name: &str| std::fs::read(format!("../../samples/closed-loop/{name}")).map(|bytes| Source::new(name, bytes));
/// # let cell = Cell::read(&read("cell.toml")?)?;
/// # let program = rapid::read(vec![read("part.mod")?], vec![])?;
/// # let table = Table::read(&read("measured.csv")?)?;
/// use deflex_identify::MeasuredRun;
///
/// let run = MeasuredRun { program, original: None, table };
/// println!("{} measured rows", run.table.rows.len());
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Debug)]
pub struct MeasuredRun {
    /// The program that ran.
    pub program: Program,
    /// The original of a corrected program, if there is one: `normal_mm`, and places without a target, are counted from
    /// its path.
    pub original: Option<Program>,
    /// What was measured.
    pub table: Table,
}

impl From<(Program, Table)> for MeasuredRun {
    fn from((program, table): (Program, Table)) -> Self {
        Self { program, original: None, table }
    }
}

/// Which effects of a model go into the cell.
///
/// # Examples
/// ```
/// use deflex_identify::Written;
///
/// assert_eq!(Written::default(), Written::WholeModel);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Written {
    /// All of them, named or not: the errors after are smallest with all.
    #[default]
    WholeModel,
    /// Only those that are named, fitted without the others (`--sparse`).
    NamedAlone,
}

/// Receives the share of the work that is done, from 0 to 1; returning `false` cancels it.
pub type Progress<'a> = dyn Fn(f64) -> bool + Sync + 'a;

/// Reports the progress.
///
/// # Errors
/// `run.called-off` if the run is cancelled.
fn reached(progress: &Progress<'_>, share: f64) -> Result<(), Vec<Diagnostic>> {
    if progress(share) {
        return Ok(());
    }
    Err(Diagnostic::error("run.called-off", "", "the run was cancelled").into())
}

/// Fewest rows that can be divided into fitted and held-out blocks.
const LEAST_ROWS: usize = 8;
/// Largest number of rounds of linearising, choosing and fitting.
const CHOOSING_ROUNDS: usize = 6;
/// Largest number of rows to which the written numbers are fitted again. In a denser table the rows of the search
/// determine them well enough.
const FITTED: usize = 4_000;
/// Over the whole robot new outliers are few if they are at most one row in this many.
const FEW: usize = 500;
/// Largest number of rounds of the search for gear harmonics, before flexible candidates are allowed.
const GEAR_ROUNDS: usize = 4;
/// Share of the work that is done when the rows are solved.
const SOLVED: f64 = 0.05;
/// Share of the work that is done when the gear harmonics are found.
const SOUGHT: f64 = 0.3;
/// Share of the work that is done when the set is chosen.
const CHOSEN: f64 = 0.85;
/// Share of the work that is done when the set is judged.
const JUDGED: f64 = 0.95;

/// The state of an identification.
pub(super) struct Engine {
    /// The arm of the declared cell.
    pub(super) declared: Arm,
    pub(super) problem: Problem,
    pub(super) candidates: Vec<Candidate>,
    /// The chosen set: indices of candidates.
    pub(super) chosen: Vec<usize>,
    /// Standard deviation of the white noise for each axis, mm.
    pub(super) sigma: f64,
    /// The shape of the noise.
    pub(super) shape: noise::Shape,
    /// Posterior covariance of the chosen columns, in typical sizes, in the order of `chosen`.
    pub(super) covariance: DMatrix<f64>,
    /// The map of the error that no effect explains, if there is one.
    pub(super) map: Option<Map>,
    /// Columns of earlier linearisations that can be used again.
    pub(super) reuse: Reuse,
    /// Columns of the last search for gear harmonics.
    comb: Option<Grid>,
    /// Rows that are judged but not used in the search: in a dense table neighbouring rows contain nearly the same
    /// information.
    aside: Vec<Observation>,
    /// Posterior over sets of effects and faults, most likely first.
    pub(super) sets: Vec<SetShare>,
    /// Variance of the predictions over all sets, relative to the variance within the chosen one.
    pub(super) spread: f64,
    /// Why the effects that were found are not added, if they are not.
    pub(super) refused: Option<Refused>,
    /// A sentence about a possible fault of the table.
    pub(super) doubt: Option<String>,
    /// The last residual with all that it depends on, because many steps need the same one.
    last: Mutex<Option<(Settled, DVector<f64>)>>,
}

/// All that a residual depends on: the number of scalars, the instruments, and the effects.
type Settled = (usize, Vec<Device>, Vec<toml::Table>);

/// Finds the effects that a cell lacks.
///
/// # Errors
/// Tables that do not belong to their programs, too few rows, targets that the cell does not solve; `run.called-off`.
///
/// # Examples
/// ```no_run
/// use deflex_identify::{Input, Written, identify};
/// use deflex_cell::Cell;
/// use deflex_measured::Table;
/// use deflex_program::rapid;
/// use deflex_text::Source;
///
/// let read = |path: &str| std::fs::read(path).map(|bytes| Source::new(path, bytes));
/// let cell = Cell::read(&read("../../samples/closed-loop/cell.toml")?)?;
/// let program = rapid::read(vec![read("../../samples/closed-loop/part.mod")?], vec![])?;
/// let table = Table::read(&read("../../samples/closed-loop/measured.csv")?)?;
/// let found = identify(Input {
///     cell: &cell,
///     runs: vec![(program, table).into()],
///     poses: vec![],
///     tool: None,
///     data_hash: "",
///     written: Written::WholeModel,
///     progress: &|_| true,
/// })?;
/// println!("{:.3} mm, then {:.3} mm", found.before.rms_mm, found.after.rms_mm);
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
pub fn identify(input: Input<'_>) -> Result<Identification, Vec<Diagnostic>> {
    let Input { cell, runs, poses, tool, data_hash, written, progress } = input;
    let mut problem =
        if poses.is_empty() { Problem::of_runs(cell, runs)? } else { Problem::of_poses(cell, poses, tool)? };
    let held_out = problem.rows.iter().filter(|row| row.held_out).count();
    if problem.rows.len() < LEAST_ROWS || held_out == 0 || held_out == problem.rows.len() {
        let message =
            format!("{} measured rows, {held_out} of them held out: too few to fit and to judge", problem.rows.len());
        return Err(vec![
            Diagnostic::error("identify.rows", "", message)
                .help(format!("at least {LEAST_ROWS} rows are needed, some held out and some not")),
        ]);
    }
    let declared = with(&cell.arm, &[]);
    problem.cut_stocks(&declared, cell)?;
    let before = problem.residual(&declared);
    if before.iter().any(|v| !v.is_finite()) {
        let message = "the declared cell has no equilibrium at some measured targets";
        return Err(vec![
            Diagnostic::error("identify.unsolved", "", message).help("run `deflex predict` on the program first"),
        ]);
    }
    let mut engine = Engine::new(declared, problem, &cell.covariances);
    let before = if engine.aside.is_empty() { before } else { engine.problem.residual(&engine.declared) };
    if !engine.problem.free_device {
        engine.check_plausibility(&before)?;
    }
    engine.run(cell, &before, (data_hash, written), progress)
}

impl Engine {
    /// An identification of a problem before its first step. `covariances` has those of the declared effects.
    pub(super) fn new(declared: Arm, mut problem: Problem, covariances: &[Option<DMatrix<f64>>]) -> Self {
        let aside = problem.set_aside();
        let candidates = candidates::all(&declared, &problem, covariances);
        let reuse = Reuse::of(if problem.free_device { 0 } else { candidates.len() });
        let presliding = declared.presliding();
        let shape = noise::Shape { drift: 0.0, correlation: 0.0, field: None };
        let covariance = DMatrix::zeros(0, 0);
        let mut engine = Self {
            declared,
            problem,
            candidates,
            chosen: Vec::new(),
            sigma: 1.0,
            shape,
            covariance,
            map: None,
            reuse,
            comb: None,
            aside,
            sets: Vec::new(),
            spread: 1.0,
            refused: None,
            doubt: None,
            last: Mutex::new(None),
        };
        engine.set_presliding(presliding);
        engine
    }

    /// The arm with the chosen effects and the map.
    pub(super) fn arm(&self) -> Arm {
        let changes: Vec<(&Home, &[f64])> =
            self.chosen.iter().map(|&c| (&self.candidates[c].home, &self.candidates[c].values[..])).collect();
        self.arm_of(&changes)
    }

    /// The arm with these numbers of effects, and the map.
    pub(super) fn arm_of(&self, changes: &[(&Home, &[f64])]) -> Arm {
        let mut arm = with(&self.declared, changes);
        arm.effects.extend(self.map.iter().map(|map| map.effect.clone_box()));
        arm
    }

    /// Measured minus predicted by the arm with the chosen effects, mm.
    pub(super) fn residual(&self) -> DVector<f64> {
        let arm = self.arm();
        if self.problem.free_device {
            return self.problem.residual(&arm);
        }
        let effects = arm.effects.iter().map(|effect| effect.to_table()).collect();
        let key = (self.problem.scalars, self.problem.devices.clone(), effects);
        // The lock is not held while rows are solved, because the threads that solve them may need it.
        let last = || self.last.lock().unwrap_or_else(PoisonError::into_inner);
        let known = last().as_ref().filter(|(known, _)| *known == key).map(|(_, residual)| residual.clone());
        known.unwrap_or_else(|| {
            let residual = self.problem.residual(&arm);
            *last() = Some((key, residual.clone()));
            residual
        })
    }

    /// The columns of the wanted candidates about the present fit, with their moments under each shape of the noise.
    pub(super) fn linearise(&mut self, wanted: &[usize], shapes: &[noise::Shape]) -> Linearised {
        let base = self.residual();
        let (design, always) = Design::new(
            &self.declared,
            &self.problem,
            &mut self.candidates,
            &self.chosen,
            wanted,
            &base,
            &mut self.reuse,
        );
        let data = self.pseudo(&design, base, wanted);
        let moments = self.moments(&design, &data, shapes, None);
        Linearised { moments, always, design, data }
    }

    /// Moments of the fitted rows under each shape of the noise: see [`Moments::on`].
    fn moments(
        &self,
        design: &Design,
        data: &DVector<f64>,
        shapes: &[noise::Shape],
        own: Option<&[Range<usize>]>,
    ) -> Vec<Moments> {
        let series = self.problem.series(|row| !row.held_out);
        let declared = self.problem.declared_sigma_mm;
        let moments = if shapes.iter().any(|shape| shape.field.is_some()) {
            // Only the rows of a part have a field, and there the design has no curves whose columns are not kept.
            let stacked = stacked(design.kept(), data);
            shapes.iter().map(|&shape| Moments::of(&stacked, &series, shape)).collect()
        } else {
            Moments::on(design, data, &series, shapes, own)
        };
        moments.into_iter().map(|moments| Moments { declared, ..moments }).collect()
    }

    /// As [`Engine::linearise`], under those of many shapes of the noise that are best for a candidate alone. To find
    /// these shapes only the products of the columns of each candidate are needed.
    fn linearise_narrowed(&mut self, wanted: &[usize], shapes: &[noise::Shape]) -> Linearised {
        let linear = self.linearise(wanted, &[]);
        let mut own: Vec<Range<usize>> = wanted.iter().map(|&c| self.candidates[c].columns()).collect();
        own.sort_by_key(|columns| columns.start);
        own.dedup();
        let alone = self.moments(&linear.design, &linear.data, shapes, Some(&own));
        let search = Search::new(&self.candidates, &alone, &linear.always);
        search.narrow(wanted);
        let worth_trying: Vec<noise::Shape> = search.active().into_iter().map(|s| shapes[s]).collect();
        let moments = self.moments(&linear.design, &linear.data, &worth_trying, None);
        Linearised { moments, ..linear }
    }

    /// Evidence of columns under the best of several shapes of the noise.
    fn score_of(&self, linear: &Linearised, columns: &Columns, shapes: &[noise::Shape]) -> Score {
        let kept = linear.design.kept().select_columns(columns.list.iter().map(|column| &column.0));
        let stacked = stacked(&kept, &linear.data);
        let series = self.problem.series(|row| !row.held_out);
        let declared = self.problem.declared_sigma_mm;
        let of = |&shape: &noise::Shape| Moments { declared, ..Moments::of(&stacked, &series, shape) };
        let moments: Vec<Moments> = shapes.par_iter().map(of).collect();
        score(&moments, &columns.numbered(), None)
    }

    /// The same columns with the data of the present numbers.
    pub(super) fn renewed(&self, linear: Linearised, wanted: &[usize]) -> Linearised {
        let data = self.pseudo(&linear.design, self.residual(), wanted);
        if linear.moments.iter().any(|moments| moments.shape.field.is_some()) {
            let shapes: Vec<noise::Shape> = linear.moments.iter().map(|moments| moments.shape).collect();
            let moments = self.moments(&linear.design, &data, &shapes, None);
            return Linearised { moments, data, ..linear };
        }
        let series = self.problem.series(|row| !row.held_out);
        let moments = linear.moments.into_iter().map(|m| m.with_data(&linear.design, &data, &series)).collect();
        Linearised { moments, data, ..linear }
    }

    /// Pseudo-data: a residual plus the linear contribution of the chosen numbers, as if each had its start value.
    /// Patterns are not in the residual.
    fn pseudo(&self, design: &Design, residual: DVector<f64>, wanted: &[usize]) -> DVector<f64> {
        let mut data = residual;
        for &c in self.chosen.iter().filter(|c| wanted.contains(c)) {
            let candidate = &self.candidates[c];
            if candidate.is_pattern() {
                continue;
            }
            let off = |k: usize| (candidate.values[k] - candidate.start[k]) / candidate.typical[k];
            design.add(candidate.columns().enumerate().map(|(k, column)| (column, off(k))), &mut data);
        }
        data
    }

    /// Cuts the stocks with the fitted arm and fits the chosen numbers again, in turns, until the forces are those that
    /// act on the fitted arm.
    fn settle_cuts(&mut self, cell: &Cell) -> Result<(), Vec<Diagnostic>> {
        /// Largest number of cuts.
        const CUTS: usize = 8;
        /// Rms change of the rows by the forces, as a share of the noise, at which the cuts end. Only as many rows as
        /// the inverse square of this share could show a smaller change.
        const SETTLED: f64 = 0.02;
        if self.problem.stocks.is_empty() {
            return Ok(());
        }
        for _ in 0..CUTS {
            let before = self.residual();
            self.problem.cut_stocks(&self.arm(), cell)?;
            self.last = Mutex::new(None);
            // The kept columns were computed with the forces before the cut.
            self.reuse.forget_all();
            let moved = (self.residual() - before).norm() / (self.problem.scalars as f64).sqrt();
            if moved < SETTLED * self.sigma {
                break;
            }
            self.refit();
        }
        Ok(())
    }

    /// Finds the effects and makes the answer. `before` is the residual of the declared cell, mm.
    fn run(
        &mut self,
        cell: &Cell,
        before: &DVector<f64>,
        (data_hash, written): (&str, Written),
        progress: &Progress<'_>,
    ) -> Result<Identification, Vec<Diagnostic>> {
        let shapes = noise::shapes();
        let mut linear = None;
        let mut posteriors = Vec::new();
        let mut ranking = Ranking::default();
        let places = device_pose::places(&self.problem);
        // Gear harmonics are searched before curves, which could imitate them, are allowed: first with an empty set,
        // then together with the other effects.
        for round in 0..if self.problem.free_device { 0 } else { GEAR_ROUNDS } {
            reached(progress, within(SOLVED, SOUGHT, round, GEAR_ROUNDS))?;
            let wanted: Vec<usize> =
                (0..self.candidates.len()).filter(|&c| is_inflexible(&self.candidates[c])).collect();
            let tried = if round == 0 { shapes.clone() } else { self.shapes_about() };
            let now = self.linearise_narrowed(&wanted, &tried);
            let search = Search::new(&self.candidates, &now.moments, &now.always);
            let set = search.best_of(&self.chosen, &wanted);
            let score = self.score_of(&now, &search.columns(&set), &shapes);
            (self.sigma, self.shape) = (score.sigma, shapes[score.shape]);
            reached(progress, within(SOLVED, SOUGHT, 2 * round + 1, 2 * GEAR_ROUNDS))?;
            // Effects that were found without gear harmonics may only imitate them.
            if round == 0 && self.add_gear(&now) {
                continue;
            }
            self.choose(set);
            self.settle_cuts(cell)?;
            let tails = self.widen_tails();
            let jump = self.add_jumps();
            if !self.add_gear(&now) && !jump && !tails {
                break;
            }
        }
        let whole = self.problem.free_device;
        if !whole {
            self.choose_presliding();
        }
        let mut visited: Vec<Vec<usize>> = Vec::new();
        let mut whole_arm = None;
        for round in 0..CHOOSING_ROUNDS {
            let shapes = self.shapes_about();
            let wanted: Vec<usize> = (0..self.candidates.len()).collect();
            // The last design is dropped first: two at a time need twice the memory.
            drop(linear.take());
            reached(progress, within(SOUGHT, CHOSEN, round, CHOOSING_ROUNDS))?;
            let now = self.linearise(&wanted, &shapes);
            reached(progress, within(SOUGHT, CHOSEN, 2 * round + 1, 2 * CHOOSING_ROUNDS))?;
            let staged = whole.then(|| self.choose_in_stages(&now));
            let search = Search::new(&self.candidates, &now.moments, &now.always);
            let everything = |_: &Candidate| true;
            let Choice { set, sigma, shape } = staged.unwrap_or_else(|| {
                let set = search.likeliest(search.best(&self.chosen, &everything));
                let score = search.full(&set);
                Choice { set, sigma: score.sigma, shape: score.shape }
            });
            posteriors = set
                .iter()
                .filter(|&&c| !self.candidates[c].is_pattern())
                .map(|&c| match whole {
                    true => (c, (1.0, Vec::new())),
                    false => (c, search.rivals(&set, c, &Candidate::is_named)),
                })
                .collect();
            if round == 0 {
                ranking = self.ranking(&search, &now);
            }
            (self.sigma, self.shape) = (sigma, shapes[shape]);
            let same = if whole {
                self.families(&set) == self.families(&self.chosen)
            } else {
                // Two sets that are equally good can lead to one another.
                sorted(&set) == sorted(&self.chosen) || visited.contains(&sorted(&set))
            };
            visited.push(sorted(&self.chosen));
            if same && !whole {
                (self.sets, self.spread) = self.posterior_over_sets(&search, &now, &set, (sigma, shape));
            }
            let gate = same && !whole && self.shape.field.is_none();
            let field = if gate { self.field(&search, &now, &set) } else { None };
            let gains = |members: &Members| self.gains_on(&search, &set, members);
            whole_arm = (!whole).then(|| self.members_of_whole_arm(&search, &set)).filter(gains);
            if whole_arm.is_some() {
                linear = Some(now);
                break;
            }
            self.choose(set.clone());
            self.settle_cuts(cell)?;
            let unlisted = gate && round + 1 < CHOOSING_ROUNDS && self.add_unlisted();
            let field = field.filter(|_| !unlisted);
            // Of ten thousand rows a few further ones are outliers in every round, which is no reason for another
            // round.
            let few = if whole { self.problem.rows.len() / FEW } else { 0 };
            let outliers = self.mark_outliers() > few;
            // Together with a field a harmonic can imitate any error, and it would be withdrawn.
            let seek = !whole && round + 1 < CHOOSING_ROUNDS && self.shape.field.is_none();
            let gear = seek && self.add_gear(&now);
            let jump = seek && self.add_jumps();
            let tails = !whole && round + 1 < CHOOSING_ROUNDS && self.widen_tails();
            let weighed = self.weigh_turns();
            let new = outliers || gear || jump || tails || unlisted || weighed;
            if new {
                visited.clear();
            }
            let settled = same && !new && (whole || !self.prune());
            linear = Some(now);
            if settled && field.is_none() {
                break;
            }
            self.shape = field.filter(|_| settled).unwrap_or(self.shape);
        }
        reached(progress, CHOSEN)?;
        if whole {
            self.drop_without_gain();
            posteriors.retain(|(c, _)| self.chosen.contains(c));
        } else {
            if whole_arm.is_none() && (self.is_unlisted() || self.forces_are_wrong()) {
                let all: Vec<usize> = (0..self.candidates.len()).collect();
                let white = noise::Shape { field: None, ..self.shape };
                drop(linear.take());
                let now = self.linearise(&all, &[white]);
                let search = Search::new(&self.candidates, &now.moments, &now.always);
                let members = self.members_of_whole_arm(&search, &self.chosen);
                let value = search.objective(&self.chosen);
                // The forces of the table are wrong only if no model of the arm explains the rows as well.
                let explains_more = self.is_unlisted() || self.whole_arm_evidence(&members) > value;
                whole_arm = Some(members).filter(|_| explains_more);
            }
            match &whole_arm {
                Some(members) => posteriors = self.take_whole_arm(members),
                None => {
                    self.prune();
                    posteriors.retain(|(c, _)| self.chosen.contains(c));
                    self.contest(&mut posteriors);
                }
            }
        }
        if self.forces_are_wrong() {
            self.withdraw_all(&mut posteriors);
        }
        if !whole && whole_arm.is_none() {
            self.withdraw_faint(&mut posteriors);
        }
        if written == Written::NamedAlone {
            self.withdraw_unless(&mut posteriors, |_, share, _| share >= NAMED);
        }
        self.settle_cuts(cell)?;
        // Effects are not added if the extended cell is worse than the declared one on rows that are left out. Over the
        // whole robot every stage has already gained.
        if !whole && !posteriors.is_empty() {
            self.refused = self.worse_where_left_out();
            if self.refused.is_some() {
                posteriors.clear();
                self.remove_all_effects();
                device_pose::restore(&mut self.problem, &places);
            }
        }
        self.map = match written {
            Written::WholeModel if !whole && !self.forces_are_wrong() => self.field_map(&posteriors),
            _ => None,
        };
        reached(progress, JUDGED)?;
        let elsewhere = self.elsewhere();
        let map = self.map.take();
        drop(linear.take());
        let unexplained = self.unexplained();
        self.map = map;
        let stages = if whole { self.stage_errors() } else { Vec::new() };
        let dense = !self.aside.is_empty();
        let every = self.problem.rows.len() + self.aside.len() <= FITTED;
        if dense {
            // All rows are judged from here on, and the columns of the rows of the search are no longer needed.
            (self.comb, self.reuse) = (None, Reuse::of(0));
            self.problem.add_again(std::mem::take(&mut self.aside));
            self.mark_outliers();
            if every {
                let map = self.map.take();
                self.refit();
                self.map = map.and_then(|map| self.renewed_map(map));
            }
        }
        let after = self.left_by_cell();
        let before = if dense { self.problem.residual(&self.declared) } else { before.clone() };
        let findings = Findings { elsewhere, posteriors, ranking, unexplained, stages, refit: every && !whole };
        Ok(self.outcome(&before, &after, findings, data_hash))
    }

    /// The shapes of the noise that are tried near the present one.
    pub(super) fn shapes_about(&self) -> Vec<noise::Shape> {
        match self.shape {
            noise::Shape { field: Some(_), .. } => vec![self.shape],
            _ if self.problem.free_device => noise::coarse(),
            noise::Shape { drift, .. } if drift > 0.0 => noise::near(self.shape),
            _ => noise::few(),
        }
    }

    /// The posterior over sets, and the variance of the predictions over all of them, relative to the variance within
    /// the chosen set.
    pub(super) fn posterior_over_sets(
        &self,
        search: &Search,
        linear: &Linearised,
        set: &[usize],
        (sigma, shape): (f64, usize),
    ) -> (Vec<SetShare>, f64) {
        /// Largest relative variance: with a larger one the sets disagree by more than the uncertainty of numbers.
        const WIDEST_SPREAD: f64 = 25.0;
        let moments = &linear.moments[shape];
        let frames = linear.always.len();
        let in_cell = |column: usize| {
            let of = |c: &Candidate| c.is_pattern() && c.columns().contains(&column);
            !self.candidates.iter().any(of)
        };
        let predicted = |set: &[usize]| {
            let columns = search.columns(set);
            let mut sum = DVector::zeros(linear.data.len());
            let (mean, covariance) = posterior(moments, &columns, sigma)?;
            let numbers = columns.list.iter().enumerate().skip(frames).filter(|(_, (column, _))| in_cell(*column));
            let numbers: Vec<(usize, usize, f64)> = numbers.map(|(k, &(column, size))| (k, column, size)).collect();
            linear.design.add(numbers.iter().map(|&(k, column, size)| (column, mean[k] * size)), &mut sum);
            Some((sum, numbers, covariance))
        };
        let sets = search.sets(set);
        let reported = sets.iter().map(|(probability, set)| SetShare {
            kinds: search.names(set).into_iter().map(str::to_owned).collect(),
            probability: *probability,
        });
        let reported: Vec<SetShare> = reported.collect();
        let Some((own, numbers, covariance)) = predicted(set) else { return (reported, 1.0) };
        let kept = linear.design.kept();
        let gram = DMatrix::from_fn(numbers.len(), numbers.len(), |i, j| {
            let ((a, left, s), (b, right, t)) = (numbers[i], numbers[j]);
            if left.max(right) >= kept.ncols() {
                return 0.0;
            }
            kept.column(left).dot(&kept.column(right)) * s * t * covariance[(a, b)]
        });
        let within = gram.sum();
        let between: f64 = sets
            .iter()
            .filter_map(|(share, other)| predicted(other).map(|(there, ..)| share * (there - &own).norm_squared()))
            .sum();
        let spread = if within > 0.0 { (1.0 + between / within).min(WIDEST_SPREAD) } else { 1.0 };
        (reported, spread)
    }

    /// The families of the members of a set, sorted; twins with other prior sizes are one family.
    fn families(&self, set: &[usize]) -> Vec<&str> {
        let mut all: Vec<&str> = set.iter().map(|&c| &self.candidates[c].family[..]).collect();
        all.sort_unstable();
        all
    }

    /// Chooses a set and fits it. Candidates that leave the set get their start values.
    pub(super) fn choose(&mut self, set: Vec<usize>) {
        // Over the whole robot a twin continues with the numbers of the member that it replaces.
        for &c in set.iter().filter(|c| !self.chosen.contains(c)) {
            let known = self.chosen.iter().find(|&&o| twins(&self.candidates[o], &self.candidates[c]));
            if let Some(&known) = known.filter(|_| self.problem.free_device) {
                self.candidates[c].values = self.candidates[known].values.clone();
            }
        }
        for &c in self.chosen.iter().filter(|c| !set.contains(c)) {
            let candidate = &mut self.candidates[c];
            candidate.values.clone_from(&candidate.start);
        }
        self.chosen = set;
        self.refit();
    }

    /// Searches for gear harmonics in the residual of the other effects, and adds them as candidates. Returns whether
    /// there is a new one.
    pub(super) fn add_gear(&mut self, linear: &Linearised) -> bool {
        let left = self.pseudo_left();
        let known = self.comb.take();
        // The fits since the linearisation have numbered the columns of the chosen candidates again, so that a
        // candidate is needed that is not chosen.
        let constant =
            |c: &usize| !self.chosen.contains(c) && self.candidates[*c].law().is_some_and(|law| law.is_joint_constant);
        let Some(zero) = (0..self.candidates.len()).find(constant).map(|c| &self.candidates[c]) else { return false };
        let comb = Comb::new(&self.problem, linear.design.kept(), zero, (self.shape, self.sigma), known);
        let (terms, looked_at) = comb.terms(&left);
        let grid = comb.into_grid();
        let known = |terms: &[Term]| {
            let same = |c: &Candidate| is_periodic(c) && gear::terms_of(c) == terms;
            self.candidates.iter().any(same)
        };
        let new: Vec<Candidate> = (1..=terms.len())
            .map(|n| &terms[..n])
            .filter(|terms| !known(terms))
            .map(|terms| gear::candidate(terms, looked_at))
            .collect();
        let any = !new.is_empty();
        self.candidates.extend(new);
        self.comb = grid;
        any
    }

    /// The residual of the chosen effects without gear harmonics, less the chosen patterns, mm.
    pub(super) fn pseudo_left(&mut self) -> DVector<f64> {
        let gear = |c: &usize| is_periodic(&self.candidates[*c]);
        let others: Vec<(&Home, &[f64])> = self
            .chosen
            .iter()
            .filter(|c| !gear(c))
            .map(|&c| (&self.candidates[c].home, &self.candidates[c].values[..]))
            .collect();
        let mut left = self.problem.residual(&with(&self.declared, &others));
        let patterns = self.patterns();
        if !patterns.is_empty() {
            let (design, _) = Design::new(
                &self.declared,
                &self.problem,
                &mut self.candidates,
                &[],
                &patterns,
                &left.clone(),
                &mut Reuse::of(0),
            );
            for &c in &patterns {
                design.add(self.candidates[c].pattern_numbers().map(|(column, number)| (column, -number)), &mut left);
            }
        }
        left
    }

    /// The chosen candidates that are patterns.
    pub(super) fn patterns(&self) -> Vec<usize> {
        self.chosen.iter().copied().filter(|&c| self.candidates[c].is_pattern()).collect()
    }
}

/// The share of the work that is done before a round, if all rounds take the work from share `from` to share `to`.
fn within(from: f64, to: f64, round: usize, rounds: usize) -> f64 {
    from + (to - from) * round as f64 / rounds as f64
}

/// A matrix of columns with the data as the last column.
pub(super) fn stacked(columns: &DMatrix<f64>, data: &DVector<f64>) -> DMatrix<f64> {
    let mut stacked = columns.clone().insert_column(columns.ncols(), 0.0);
    stacked.set_column(columns.ncols(), data);
    stacked
}

/// Whether a candidate cannot imitate many others: it is neither an unlisted pattern nor a curve.
pub(super) fn is_inflexible(candidate: &Candidate) -> bool {
    !candidate.is_flexible()
}

/// Whether a candidate is a gear harmonic.
fn is_periodic(candidate: &Candidate) -> bool {
    candidate.law().is_some_and(|law| law.shape == Shape::Periodic)
}
