//! Chooses a free turn about the tool axis (`[cl] spin = "stiffest"`, `--free-spin`) and the positions of free external axes (`[[unit]]
//! free = true`) along the whole path, for the least predicted error under the force that acts.
//!
//! It uses dynamic programming over a grid of turns, the branches of the inverse and the cells of the free axes ([`axes`]) at knots along
//! the path ([`states`], [`search`]). Between knots the turn is linear in the length, and the steps of the grid are smoothed ([`follow`]).
//! The constraints are axis limits, axis speeds at the programmed feed if they are known, the rates of the turn and of the free axes, and
//! the margin from singular wrists.

mod axes;
mod faults;
mod follow;
mod path;
mod search;
mod site;
mod states;

use super::carried::{Carried, Chosen, ChosenTurns, Free};
use super::context::Context;
use super::flow::StreamError;
use super::messages::Messages;
use super::point::Point;
use super::{Cuts, Options, removal};
use axes::{Grid, Position};
use deflex_cell::{Cell, SpinRule};
use deflex_program::chunk::leaves_its_start;
use deflex_program::{ChunkReader, Language, Next, StreamableChunk};
use deflex_text::{Diagnostic, Severity};
use path::{Path, Refusal};
use std::collections::BTreeSet;

/// Number of targets whose errors are evaluated together: some megabytes.
const TOGETHER: usize = 8192;

/// Most rounds of the search; after each, unreachable targets between knots become knots, or faults are avoided.
const MOST_SEARCHES: usize = 12;

/// The state of the ordered pass before the first target of a program that is held as a whole, or whose turns are known already. Free turns
/// about the tool axis are chosen here.
///
/// # Errors
/// See [`choose`].
pub(super) fn carried(context: Context<'_>) -> Result<Carried<'_>, Vec<Diagnostic>> {
    let Context { program, cell, options, .. } = context;
    if options.turns.is_none() && has_free_turns(program.language, cell, options) {
        return Ok(Carried::with_turns(cell, Some(&choose(context)?)));
    }
    Ok(Carried::with_turns(cell, options.turns.as_ref()))
}

/// Whether the turns about the tool axis of a program have to be chosen.
#[must_use]
pub(crate) fn has_free_turns(language: Language, cell: &Cell, options: &Options) -> bool {
    match language {
        Language::Cl => cell.cl.as_ref().is_some_and(|cl| cl.spin.rule == SpinRule::Stiffest),
        _ => options.free_spin,
    }
}

/// Chooses the turn, and the positions of free external axes, at every target.
///
/// # Errors
/// As [`Prepared::new`](super::Prepared::new), except for targets out of reach; a target or a motion for which no turn is possible.
fn choose(context: Context<'_>) -> Result<ChosenTurns, Vec<Diagnostic>> {
    let mut carried = Carried::new(context.cell);
    carried.free = Free::Sought;
    let mut prepared = super::path::prepare(context, &mut carried)?;
    removal::run(context, &mut prepared, Cuts::Programmed, &context.cell.arm)?;
    let mut path = Path::of_program(context.program, context.cell, prepared);
    path.unreached = carried.unreached;
    path.choose()
}

/// Chooses the turns of a program that is read a chunk at a time, as [`compensate`](super::compensate) does for a whole program; `None` if they
/// are not free. The result is for [`Options::turns`] of the following runs.
///
/// # Errors
/// See [`StreamError`].
///
/// # Examples
/// ```
/// # use deflex_cell::Cell;
/// # use deflex_correct::{Options, Sinks, StreamError, Streamed};
/// use deflex_correct::choose_turns;
/// use deflex_program::rapid;
///
/// /// The options for the runs of a program whose turns about the tool axis are free.
/// fn with_turns(cell: &Cell, options: Options) -> Result<Options, StreamError> {
///     let file = std::fs::File::open("part.mod").map_err(StreamError::Read)?;
///     let Some(chunks) = rapid::Chunks::new("part.mod", file, &[]).map_err(StreamError::Read)? else {
///         return Err(StreamError::NotStreamable);
///     };
///     let turns = choose_turns(chunks, cell, &options)?;
///     Ok(Options { turns, ..options })
/// }
/// ```
pub fn choose_turns(
    mut chunks: impl ChunkReader,
    cell: &Cell,
    options: &Options,
) -> Result<Option<ChosenTurns>, StreamError> {
    // Only the whole program shows which targets several motions share.
    if !chunks.has_own_numbers() || cell.stock.is_some() {
        return Err(StreamError::NotStreamable);
    }
    let mut carried = Carried::new(cell);
    carried.free = Free::Sought;
    let (mut refused, mut path) = (Messages::default(), None::<Path<'_>>);
    loop {
        let chunk = match chunks.take().map_err(StreamError::Read)? {
            Next::Chunk(chunk) => chunk.read(),
            Next::NotStreamable => None,
            Next::End => break,
        };
        let Some(chunk) = chunk else { return Err(StreamError::NotStreamable) };
        let StreamableChunk { program, last, .. } = &chunk;
        if !has_free_turns(program.language, cell, options) {
            return Ok(None);
        }
        let leaves = path.is_some() || *last || leaves_its_start(&program.targets);
        if !leaves || program.targets.iter().any(path::has_moved_alone) {
            return Err(StreamError::NotStreamable);
        }
        match super::path::prepare(Context::chunk(&chunk, cell, options), &mut carried) {
            Ok(prepared) => path.get_or_insert_with(|| Path::new(program, cell)).extend(program, prepared),
            Err(why) => refused.add_once(why),
        }
    }
    if !refused.is_empty() {
        return Err(StreamError::Refused(refused.all()));
    }
    let Some(mut path) = path else { return Ok(None) };
    path.unreached = carried.unreached;
    path.choose().map(Some).map_err(StreamError::Refused)
}

impl Path<'_> {
    /// The choice along all of the path.
    fn choose(&mut self) -> Result<ChosenTurns, Vec<Diagnostic>> {
        let (mut grid, mut about) = (Grid::coarse(&self.axes), self.base.clone());
        loop {
            let chosen = self.choose_on(&grid, &mut about);
            if grid.is_fine(&self.axes) {
                return chosen.map(|chosen| ChosenTurns { notes: notes(self, &chosen), chosen: chosen.into() });
            }
            // A finer grid may succeed where a coarse one fails.
            self.base.clone_from(&about);
            grid = grid.finer(&self.axes);
        }
    }

    /// The choice on a grid, and the positions of the free axes around which the next grid is made. A finer grid has only near positions:
    /// around a trajectory with a fault it would find the nearest detour, not the best trajectory.
    fn choose_on(&mut self, grid: &Grid, about: &mut Vec<Position>) -> Result<Vec<Chosen>, Vec<Diagnostic>> {
        self.kept_clear.clear();
        let mut forced = BTreeSet::new();
        let (mut left, mut wrong) = (None, Vec::new());
        for _ in 0..MOST_SEARCHES {
            (left, wrong) = (None, Vec::new());
            let knots = self.knots(&forced);
            let found = self.search(&knots, grid)?;
            let as_found: (Vec<f64>, Vec<Position>) = found.iter().map(|state| (state.turn, state.position)).unzip();
            *about = self.positions(&knots, &as_found.1);
            for (turns, positions) in [self.smoothed(&knots, &found, grid), as_found] {
                match self.follow(&knots, &found, (&turns, &positions)) {
                    Ok(chosen) => {
                        wrong = self.way_faults(&chosen);
                        if wrong.is_empty() {
                            *about = self.positions(&knots, &positions);
                            return Ok(chosen);
                        }
                    }
                    Err(at) => left = Some(at),
                }
            }
            self.keep_clear_of(&wrong);
            forced.extend(wrong.iter().flat_map(|fault| [fault.index - 1, fault.index]).chain(left));
        }
        if let Some(fault) = wrong.first() {
            let why = fault.text();
            return Err(self.refuse(
                fault.index,
                &format!("no turn about the tool axis is possible here: {why}"),
                Refusal::Between,
            ));
        }
        let at = left.unwrap_or(0);
        Err(self.refuse(
            at,
            "no turn about the tool axis here leads from the turn of the target before to that of the next target",
            Refusal::Between,
        ))
    }
}

/// Notes about the choice.
fn notes(path: &Path<'_>, chosen: &[Chosen]) -> Vec<Diagnostic> {
    let note = |code, message: String| Diagnostic::error(code, &path.file, message).severity(Severity::Note);
    let mut notes = vec![note("spin.chosen", gain(path, chosen))];
    notes.extend(path.held.iter().map(|why| note("spin.unit", why.clone())));
    notes
}

/// The note about the gain of the choice, over the targets that cut.
fn gain(path: &Path<'_>, chosen: &[Chosen]) -> String {
    let cuts = |i: &usize| path.sites[*i].cuts() && path.sites[*i].is_end;
    let reached = |i: &usize| path.unreached.binary_search(i).is_err();
    let all: Vec<usize> = (0..chosen.len()).filter(cuts).collect();
    let both: Vec<usize> = all.iter().copied().filter(reached).collect();
    let rms_mm = |some: &[usize], point: &dyn Fn(&usize) -> Point| {
        let squares = |some: &[usize]| path.squared_errors(some, some.iter().map(point).collect());
        let sum: f64 = some.chunks(TOGETHER).flat_map(squares).sum();
        1e3 * (sum / some.len() as f64).sqrt()
    };
    let chosen_point = |i: &usize| path.chosen_point(*i, &chosen[*i]);
    let written = match path.language {
        Language::Cl => "`spin_deg` throughout",
        _ => "the turn as written",
    };
    let mut units = String::new();
    for axis in &path.axes {
        let at = chosen.iter().filter_map(|chosen| Some(chosen.external.as_ref()?[axis.axis]));
        let (least, most) = at.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), at| (a.min(at), b.max(at)));
        if least <= most {
            units += &format!("; unit `{}` moves between {least} and {most}", axis.name);
        }
    }
    let turned = chosen.iter().filter(|chosen| chosen.turn.is_some()).count();
    let mut message = format!("the turn about the tool axis is chosen at {turned} targets");
    // Errors are compared where both are known.
    if !both.is_empty() {
        let (before, after) = (rms_mm(&both, &|i| path.sites[*i].point()), rms_mm(&both, &chosen_point));
        let on = if both.len() < all.len() { format!(" on the {} that both reach", both.len()) } else { String::new() };
        message +=
            &format!(": predicted error rms {before:.4} mm with {written}, {after:.4} mm with the chosen one{on}");
    } else if !all.is_empty() {
        message += &format!(": predicted error rms {:.4} mm", rms_mm(&all, &chosen_point));
    }
    message += &units;
    if !path.unreached.is_empty() {
        message += &format!("; with {written}, {} targets are out of reach", path.unreached.len());
    }
    message
}
