//! The turn about the tool axis where it is free (`[cl] spin = "stiffest"`, `--free-spin`), and the positions of free external
//! axes (`[[unit]] free = true`): chosen along the whole path for the least predicted error under the force that acts.
//!
//! Dynamic programming over a grid of turns, the branches of the inverse and the cells of the free axes ([`axes`]) at knots along
//! the path ([`states`], [`search`]); between knots the turn runs linearly with the length, and what the grid left of steps is
//! smoothed ([`follow`]). Constraints: axis limits, axis speeds at the programmed feed where they are known, the rates of turn
//! and of the free axes, and the margin from singular wrists.

mod axes;
mod follow;
mod path;
mod search;
mod states;

use super::carried::{Carried, Chosen, Free};
use super::point::Point;
use super::{Cuts, Options, removal};
use crate::cell::{Cell, SpinRule};
use crate::program::{Language, Program};
use crate::text::{Diagnostic, Severity};
use axes::Grid;
use path::{Path, Refusal};
use std::collections::BTreeSet;
use std::sync::Arc;

/// Margin from a singular wrist of RAPID input, whose cell may have no `[cl]`, rad (`docs/reference.md`).
pub(crate) const SINGULAR_MARGIN: f64 = 10.0 * std::f64::consts::PI / 180.0;

/// Rounds in which targets between knots that cannot be reached become knots.
const ROUNDS: usize = 4;

/// What the ordered pass takes to the first target of a program that is held whole: its turns about the tool axis are chosen,
/// where they are free.
///
/// # Errors
/// See [`choose`].
pub(super) fn carried<'a>(
    program: &Program,
    cell: &'a Cell,
    options: &Options,
) -> Result<Carried<'a>, Vec<Diagnostic>> {
    let mut carried = Carried::new(cell);
    if is_asked(program.language, cell, options) {
        let found = choose(program, cell, options)?;
        carried.free = Free::Chosen(found.chosen);
        carried.notes.extend(found.notes);
    }
    Ok(carried)
}

/// What was chosen along a path.
#[derive(Debug)]
pub(super) struct FreeTurn {
    pub(super) chosen: Arc<[Chosen]>,
    /// What it gains.
    pub(super) notes: Vec<Diagnostic>,
}

/// Whether the turn of a program's targets is to be chosen.
pub(super) fn is_asked(language: Language, cell: &Cell, options: &Options) -> bool {
    match language {
        Language::Cl => cell.cl.as_ref().is_some_and(|cl| cl.spin.rule == SpinRule::Stiffest),
        Language::Rapid | Language::Krl | Language::Ls => options.free_spin,
    }
}

/// Chooses the turn, and the positions of free external axes, at every target.
///
/// # Errors
/// What [`Prepared::new`](super::Prepared::new) refuses, but for targets out of reach; a target or a move at which no turn can be
/// taken.
pub(super) fn choose(program: &Program, cell: &Cell, options: &Options) -> Result<FreeTurn, Vec<Diagnostic>> {
    let mut carried = Carried::new(cell);
    carried.free = Free::Sought;
    let mut prepared = super::path::prepare(program, cell, options, &mut carried)?;
    removal::run(program, cell, &mut prepared, Cuts::Programmed)?;
    let mut path = Path::new(program, cell, &prepared, &carried.unreached);
    let mut forced = BTreeSet::new();
    let mut grid = Grid::coarse(&path.axes);
    while !grid.is_fine(&path.axes) {
        let knots = path.knots(&forced);
        let found = path.search(&knots, &grid)?;
        path.base = path.positions(&knots, &found.iter().map(|state| state.position).collect::<Vec<_>>());
        grid = grid.finer(&path.axes);
    }
    let mut left = None;
    for _ in 0..ROUNDS {
        let knots = path.knots(&forced);
        let found = path.search(&knots, &grid)?;
        let as_found =
            (found.iter().map(|state| state.turn).collect(), found.iter().map(|state| state.position).collect());
        for (turns, positions) in [path.smoothed(&knots, &found, &grid), as_found] {
            match path.follow(&knots, &found, (&turns, &positions)) {
                Ok(chosen) => return Ok(FreeTurn { notes: notes(&path, &chosen), chosen: chosen.into() }),
                Err(at) => left = Some(at),
            }
        }
        forced.extend(left);
    }
    let at = left.unwrap_or(0);
    Err(path.refuse(at, "no turn between its neighbours' can be taken here", Refusal::Between))
}

/// What is to be said of the choice.
fn notes(path: &Path<'_>, chosen: &[Chosen]) -> Vec<Diagnostic> {
    let source = path.program.sources.first().map_or("", |source| source.name.as_str());
    let note = |code, message: String| Diagnostic::error(code, source, message).severity(Severity::Note);
    let mut notes = vec![note("spin.chosen", gain(path, chosen))];
    notes.extend(path.held.iter().map(|why| note("spin.unit", why.clone())));
    notes
}

/// What the choice gains, over the targets that cut.
fn gain(path: &Path<'_>, chosen: &[Chosen]) -> String {
    let program = path.program;
    let cuts = |i: &usize| path.prepared.points[*i].cuts() && program.targets[*i].is_end();
    let reached = |i: &usize| path.unreached.binary_search(i).is_err();
    let all: Vec<usize> = (0..chosen.len()).filter(cuts).collect();
    let both: Vec<usize> = all.iter().copied().filter(reached).collect();
    let rms_mm = |points: Vec<Point>| {
        let squares = path.squared_errors(&both, points);
        1e3 * (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
    };
    let with = |i: &usize| path.chosen_point(*i, &chosen[*i]);
    let before = rms_mm(both.iter().map(|&i| path.prepared.points[i].clone()).collect());
    let after = rms_mm(both.iter().map(with).collect());
    let written = match program.language {
        Language::Cl => "`spin_deg` throughout",
        Language::Rapid | Language::Krl | Language::Ls => "the turn as written",
    };
    let mut units = String::new();
    for axis in &path.axes {
        let at = chosen.iter().filter_map(|chosen| Some(chosen.external.as_ref()?[axis.axis]));
        let (least, most) = at.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), at| (a.min(at), b.max(at)));
        if least <= most {
            units += &format!("; unit `{}` is sent from {least} to {most}", axis.name);
        }
    }
    let mut message = format!(
        "the turn about the tool axis is chosen at {} targets: predicted error rms {before:.4} mm with {written}, {after:.4} mm with the chosen one{units}",
        chosen.iter().filter(|chosen| chosen.turn.is_some()).count(),
    );
    if !path.unreached.is_empty() {
        message += &format!("; with {written} {} targets are not reached", path.unreached.len());
    }
    message
}
