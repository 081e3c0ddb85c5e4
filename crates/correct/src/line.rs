//! The pipeline: a program, or a chunk of one, from its targets to corrected numbers and report rows.
//!
//! | stage | finds | carries to the next chunk |
//! |---|---|---|
//! | path | poses, joints, feed and load of every target | [`carried::Carried`] |
//! | load | the forces that follow from a stock | nothing: a program that cuts a stock is held as a whole |
//! | solve | the commands as written, and where the loaded arm ends up | [`correction::Carried`] |
//! | deviation | the error of the tip on the segment to every target | [`Stages::end`] |
//! | rows | the rows of the report, and notes | [`Stages::corrected`] |
//! | follow | the deviation on the path that the controller drives, and the rows that wait for it | [`Followed`] |
//!
//! [`Stages::correct`] runs all stages. [`Stages::predict`] leaves out `solve`: the commands are those of the program. The stages need
//! no code for a chunk that is refused or whose thread panics: see [`ordered`](super::ordered).

use super::against::{self, Original};
use super::collected::Collected;
use super::context::{Context, JudgedPath};
use super::corrected::Corrected;
use super::correction::{self, Correction};
use super::deviation::{self, Commanded, WalkedPath};
use super::flow::Unsolved;
use super::followed::Followed;
use super::ordered::{Order, Ordered, Stopped, Turn};
use super::segment::Start;
use super::solve::Solver;
use super::{
    Cuts, Options, PathDeviation, Prepared, along, carried, driven, free_turn, path, remarks, removal, sigma, stance,
    stiffness,
};
use deflex_cell::Cell;
use deflex_equilibrium::WarmStart;
use deflex_program::{Program, Target};
use deflex_text::Diagnostic;
use nalgebra::Vector3;

/// Predicts where the cell would cut with a program, without correcting it.
///
/// Errors count from `against`, the original of a corrected program; it defines depth and force too.
///
/// # Errors
/// As [`Prepared::new`]; an original with other targets than these, except for targets that were inserted on its path.
///
/// # Examples
/// ```
/// use deflex_correct::{Options, predict};
/// use deflex_cell::Cell;
/// use deflex_program::rapid;
/// use deflex_text::Source;
///
/// let cell = Cell::read(&Source::new("cell.toml", std::fs::read("../../samples/slot/cell.toml")?))?;
/// let program = rapid::read(vec![Source::new("slot.mod", std::fs::read("../../samples/slot/slot.mod")?)], vec![])?;
/// let predicted = predict(&program, &cell, &Options::default(), None)?;
/// assert!(predicted.rows.iter().all(|row| row.error_norm_mm() > 0.1));
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
pub fn predict(
    program: &Program,
    cell: &Cell,
    options: &Options,
    against: Option<&Program>,
) -> Result<Corrected, Vec<Diagnostic>> {
    let context = Context::whole(program, cell, options);
    let (mut prepared, mut original) = match against {
        Some(original) => against::judged(context, original)?,
        None => (Prepared::new(program, cell, options)?, Original::Itself),
    };
    if removal::run(context, &mut prepared, Cuts::Deflected, &cell.arm)?.is_some() {
        original.settle(&mut prepared, &cell.arm);
    }
    let rows = |prepared: &Prepared, judged_path: JudgedPath| {
        let (order, stages) = (Order::default(), Stages::new(cell, carried::Carried::new(cell)));
        let predicted = stages.predict(Context { judged_path, ..context }, &order.turn(0), prepared, &original);
        predicted.map_err(Unsolved::refused)
    };
    if cell.controller.path.is_none() {
        return Ok(rows(&prepared, JudgedPath::Written)?.with_repeated());
    }
    let (judged_path, waypoints) = match &original {
        Original::Itself => (JudgedPath::Driven, None),
        Original::Alike => (JudgedPath::Written, None),
        Original::Subdivided(subdivided) => (JudgedPath::Written, Some(subdivided.waypoints(program))),
    };
    let mut predicted = rows(&prepared, judged_path)?;
    let judged_by = against.map(|program| driven::Original { program, waypoints });
    if let Err(why) = driven::follow_law(&mut predicted, &mut prepared, context, judged_by) {
        if judged_path == JudgedPath::Driven {
            predicted = rows(&prepared, JudgedPath::Written)?;
        }
        predicted.notes.extend(why);
    }
    Ok(predicted.with_repeated())
}

/// Corrects a program: the command whose loaded TCP lands on each programmed target.
///
/// `remaining_mm` comes from the forward model on the numbers as written, never from the inverse.
///
/// # Errors
/// As [`Prepared::new`]. Targets without a solution are in [`Corrected::failures`].
///
/// # Examples
/// ```
/// use deflex_correct::{Options, compensate};
/// use deflex_cell::Cell;
/// use deflex_program::rapid;
/// use deflex_text::Source;
///
/// let cell = Cell::read(&Source::new("cell.toml", std::fs::read("../../samples/slot/cell.toml")?))?;
/// let program = rapid::read(vec![Source::new("slot.mod", std::fs::read("../../samples/slot/slot.mod")?)], vec![])?;
/// let corrected = compensate(&program, &cell, &Options::default())?;
/// assert!(corrected.failures.is_empty());
/// assert!(corrected.rows.iter().all(|row| row.remaining_norm_mm() < 1e-3));
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
pub fn compensate(program: &Program, cell: &Cell, options: &Options) -> Result<Corrected, Vec<Diagnostic>> {
    let context = Context::whole(program, cell, options);
    compensate_in(if program.language.is_edited() { context.driven() } else { context })
}

/// The same in a context.
pub(super) fn compensate_in(context: Context<'_>) -> Result<Corrected, Vec<Diagnostic>> {
    let (order, stages) = (Order::default(), Stages::new(context.cell, free_turn::carried(context)?));
    Ok(stages.correct(context, &order.turn(0)).map_err(Unsolved::refused)?.with_repeated())
}

/// The values that the stages carry from chunk to chunk of a program.
pub(super) struct Stages<'a> {
    path: Ordered<carried::Carried<'a>>,
    solve: correction::Carried,
    /// The start of the segment to the next chunk, as written.
    end: Ordered<Option<Start>>,
    corrected: Ordered<LastCorrected>,
    followed: Followed<'a>,
}

/// Values of the targets before that rows need.
#[derive(Default)]
struct LastCorrected {
    /// Correction as written, base axes, m.
    shift: Option<Vector3<f64>>,
    /// Zone of the last target that ends a motion, mm.
    zone_mm: Option<f64>,
}

impl<'a> Stages<'a> {
    /// The state before the first chunk.
    pub(super) fn new(cell: &'a Cell, path: carried::Carried<'a>) -> Self {
        Self {
            path: Ordered::new(path),
            solve: correction::Carried::new(),
            end: Ordered::new(None),
            corrected: Ordered::new(LastCorrected::default()),
            followed: Followed::new(cell),
        }
    }

    /// Runs the stages `path` and `load`.
    pub(super) fn prepare(&self, context: Context<'_>, turn: &Turn<'_>) -> Result<Prepared, Unsolved> {
        let mut prepared = turn.take(&self.path, |path| path::prepare(context, path))??;
        removal::cut_as_programmed(context, &mut prepared)?;
        Ok(prepared)
    }

    /// Runs all stages.
    pub(super) fn correct(&self, context: Context<'_>, turn: &Turn<'_>) -> Result<Corrected, Unsolved> {
        let program = context.program;
        let mut prepared = self.prepare(context, turn)?;
        let (mut commanded, stops, correction) = correction::solve(context, turn, &self.solve, &mut prepared)?;
        let before = turn.take(&self.end, |last| deviation::pass_end(program, &prepared, &commanded, last))?;
        let last = before.as_ref();
        let walked = WalkedPath { program, prepared: &prepared, commanded: &commanded, last };
        commanded.nodes = stops.place(&walked, &context.cell.arm);
        let driven = match context.judged_path {
            JudgedPath::Driven if context.chunk.is_none() => {
                Some(driven::judge_corrected(context, &mut prepared, &commanded))
            }
            JudgedPath::Driven | JudgedPath::Written => None,
        };
        let walked = WalkedPath { program, prepared: &prepared, commanded: &commanded, last };
        let near = |i: usize| correction.nearby(i);
        let solver = Solver::new(&context.cell.arm, &prepared, context.parallelism);
        let judged_path = if matches!(driven, Some(Err(_))) { JudgedPath::Written } else { context.judged_path };
        let mut paths = deviation::measure(&walked, &solver, &near, judged_path).whole(&commanded.nodes);
        if let Some(Ok(driven)) = &driven {
            driven.fill(&mut paths);
        }
        let mut corrected = self.rows(context, turn, &walked, &paths, Some(correction))?;
        self.follow(context, turn, (&walked, Some(&commanded)), &paths, &mut corrected)?;
        match driven {
            Some(Ok(driven)) => {
                corrected.driven = Some(driven.summary);
                corrected.notes.extend(driven.notes);
            }
            Some(Err(why)) => corrected.notes.extend(why),
            None => {}
        }
        Ok(corrected)
    }

    /// Runs all stages except `solve` for a prepared program.
    pub(super) fn predict(
        &self,
        context: Context<'_>,
        turn: &Turn<'_>,
        prepared: &Prepared,
        original: &Original<'_>,
    ) -> Result<Corrected, Unsolved> {
        let Context { program, cell, parallelism, .. } = context;
        let solver = Solver::new(&cell.arm, prepared, parallelism);
        let landed = solver.forward(|i| prepared.points[i].as_programmed(), |_| WarmStart::default());
        let commanded = Commanded::as_programmed(prepared, landed);
        let before = turn.take(&self.end, |last| deviation::pass_end(program, prepared, &commanded, last))?;
        let walked = WalkedPath { program, prepared, commanded: &commanded, last: before.as_ref() };
        let paths = match original {
            Original::Subdivided(subdivided) => subdivided.measure(prepared, &commanded.landed, context),
            Original::Itself | Original::Alike => {
                deviation::measure(&walked, &solver, &|_| WarmStart::default(), context.judged_path).targets
            }
        };
        let moved_mm = if matches!(original, Original::Itself) { Vec::new() } else { prepared.moved_mm() };
        let mut predicted = Corrected { moved_mm, ..self.rows(context, turn, &walked, &paths, None)? };
        self.follow(context, turn, (&walked, None), &paths, &mut predicted)?;
        Ok(predicted)
    }

    /// The stage `follow`. A program that is held as a whole follows the driven path by itself.
    fn follow(
        &self,
        context: Context<'_>,
        turn: &Turn<'_>,
        (walked, commanded): (&WalkedPath<'_>, Option<&Commanded>),
        paths: &[Option<PathDeviation>],
        corrected: &mut Corrected,
    ) -> Result<(), Unsolved> {
        if context.chunk.is_none() || context.judged_path == JudgedPath::Written {
            return Ok(());
        }
        self.followed.follow((context, turn), walked, commanded, paths, corrected)
    }

    /// The stage `rows`.
    fn rows(
        &self,
        context: Context<'_>,
        turn: &Turn<'_>,
        walked: &WalkedPath<'_>,
        paths: &[Option<PathDeviation>],
        correction: Option<Correction>,
    ) -> Result<Corrected, Stopped> {
        let Context { program, cell, options, .. } = context;
        let WalkedPath { prepared, commanded, .. } = *walked;
        let mut out = Collected::new(context, prepared);
        for i in 0..prepared.points.len() {
            out.target(i, commanded, correction.as_ref());
        }
        out.paths(paths);
        let zone_mm = match &correction {
            Some(correction) => turn.take(&self.corrected, |last| {
                out.check_limits(correction, &mut last.shift);
                let end = program.targets.iter().rposition(Target::is_end);
                let zone_mm = end.map_or(last.zone_mm, |end| program.zone_mm(end));
                std::mem::replace(&mut last.zone_mm, zone_mm)
            })?,
            None => None,
        };
        let rows = &mut out.rows;
        sigma::fill(rows, context, prepared);
        if options.stiffness {
            stiffness::fill(rows, context, prepared);
        }
        if options.stance {
            stance::fill(rows, context, prepared);
        }
        let on_the_way = along::look(walked, &cell.arm.robot);
        let mut repeated = remarks::repeated(context, prepared);
        repeated.add_of_segments(program, &on_the_way);
        let notes = remarks::notes(context, prepared, turn.number);
        let mut corrected = Corrected { notes, on_the_way, repeated, ..out.finish() };
        if let Some(correction) = correction {
            remarks::insertions(context, &correction, zone_mm, &mut corrected.repeated);
            remarks::overlapping_blends(context, &correction, &mut corrected.repeated);
            corrected.posted = correction.posted(context, prepared, &commanded.steps);
            corrected.inserted = correction.inserted(&corrected.posted);
            corrected.rewritten = correction.into_rewritten();
        }
        Ok(corrected)
    }
}
