//! The turn about the tool axis where it is free (`[cl] spin = "stiffest"`, `--free-spin`): chosen along the whole path for the
//! least predicted error under the force that acts.
//!
//! Dynamic programming over a grid of turns and the branches of the inverse at knots along the path ([`states`], [`search`]);
//! between knots the turn runs linearly with the length, and what the grid left of steps is smoothed. Constraints: axis limits,
//! axis speeds at the programmed feed where they are known, the rate of turn, and the margin from singular wrists.

mod search;
mod states;

use super::carried::{Carried, Chosen, Free};
use super::load::{Follows, PointLoad};
use super::parallelism::Parallelism;
use super::path;
use super::point::{Point, tool_axis};
use super::solve::Solver;
use super::travel::CHORD;
use super::{Cuts, Options, Prepared, removal, spin};
use crate::cell::{Cell, SpinRule};
use crate::equilibrium::{PredictedPose, WarmStart};
use crate::program::{Editable, Goal, Language, Motion, Program, Target};
use crate::robot::{Joints, Robot, wrap};
use crate::text::{Diagnostic, Severity};
use rayon::prelude::*;
use search::{Move, RATE, Search};
use states::{FreeTarget, STEP, State, singular};
use std::collections::{BTreeSet, HashMap};
use std::sync::Arc;

/// Knots are this far apart where the path is denser, m: two cells of the grid at the largest rate.
const KNOT: f64 = 2e-3;

/// Knots whose states are evaluated together: some ten thousand equilibria, whose points are some megabytes.
const BLOCK: usize = 32;

/// What a target that does not cut counts for: only between ways that cut alike.
const AIR: f64 = 1e-6;

/// Margin from a singular wrist of RAPID input, whose cell may have no `[cl]`, rad (`docs/reference.md`).
pub(crate) const SINGULAR_MARGIN: f64 = 10.0 * std::f64::consts::PI / 180.0;

/// Rounds of smoothing.
const SMOOTHING: usize = 30;

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
        carried.notes.push(found.note);
    }
    Ok(carried)
}

/// What was chosen along a path.
#[derive(Debug)]
pub(super) struct FreeTurn {
    pub(super) chosen: Arc<[Chosen]>,
    /// What it gains.
    pub(super) note: Diagnostic,
}

/// Whether the turn of a program's targets is to be chosen.
pub(super) fn is_asked(language: Language, cell: &Cell, options: &Options) -> bool {
    match language {
        Language::Cl => cell.cl.as_ref().is_some_and(|cl| cl.spin.rule == SpinRule::Stiffest),
        Language::Rapid | Language::Krl | Language::Ls => options.free_spin,
    }
}

/// Chooses the turn at every target.
///
/// # Errors
/// What [`Prepared::new`] refuses, but for targets out of reach; a target or a move at which no turn can be taken.
pub(super) fn choose(program: &Program, cell: &Cell, options: &Options) -> Result<FreeTurn, Vec<Diagnostic>> {
    let mut carried = Carried::new(cell);
    carried.free = Free::Sought;
    let mut prepared = path::prepare(program, cell, options, &mut carried)?;
    removal::run(program, cell, &mut prepared, Cuts::Programmed)?;
    let path = Path::new(program, cell, &prepared, &carried.unreached);
    let mut forced = BTreeSet::new();
    let mut left = None;
    for _ in 0..ROUNDS {
        let knots = path.knots(&forced);
        let found = path.search(&knots)?;
        for turns in [path.smoothed(&knots, &found), found.iter().map(|state| state.turn).collect()] {
            match path.follow(&knots, &found, &turns) {
                Ok(chosen) => return Ok(FreeTurn { note: path.gain(&chosen), chosen: chosen.into() }),
                Err(at) => left = Some(at),
            }
        }
        forced.extend(left);
    }
    let at = left.unwrap_or(0);
    Err(path.refuse(at, "no turn between its neighbours' can be taken here", Refusal::Between))
}

/// A program's targets, as the search sees them.
struct Path<'a> {
    program: &'a Program,
    cell: &'a Cell,
    prepared: &'a Prepared,
    targets: Vec<FreeTarget>,
    moves: Vec<Move>,
    margin: f64,
    /// Targets that the turn as written does not reach.
    unreached: &'a [usize],
}

/// What a refusal advises.
enum Refusal {
    Stand(states::Refused),
    Move,
    Between,
}

impl<'a> Path<'a> {
    fn new(program: &'a Program, cell: &'a Cell, prepared: &'a Prepared, unreached: &'a [usize]) -> Self {
        let robot = &cell.arm.robot;
        let decided = program.language != Language::Cl;
        let shared = shared_numbers(program);
        let targets: Vec<FreeTarget> = prepared
            .points
            .iter()
            .enumerate()
            .map(|(i, point)| {
                let target = &program.targets[i];
                let turn = spin::turn_of(&point.wobj_from_tcp);
                let is_free = match target.goal {
                    _ if point.unsolved.is_some() => false,
                    Goal::Axis { .. } => true,
                    Goal::Pose { .. } => target.editable == Editable::Pose && !shared(target),
                    Goal::Joints { .. } => false,
                };
                FreeTarget {
                    setting: *prepared.setting(i),
                    position: point.wobj_from_tcp.translation.vector,
                    axis: tool_axis(&point.wobj_from_tcp),
                    near: point.motor,
                    fixed: (!is_free).then_some((turn, point.motor)),
                    branch: decided.then(|| states::branch_of(robot, &point.motor)),
                }
            })
            .collect();
        // Where a target is not solved nothing is known of how the arm stands.
        let unsolved = |i: usize| prepared.points[i].unsolved.is_some();
        let passed_over = |i: usize| unsolved(i) || i.checked_sub(1).is_some_and(unsolved);
        let moves = (0..targets.len())
            .map(|i| {
                let target = &program.targets[i];
                let before = i.checked_sub(1).map(|before| &targets[before]);
                let at = |target: &FreeTarget| target.setting.base_from_wobj * nalgebra::Point3::from(target.position);
                let length = before.map_or(0.0, |before| (at(&targets[i]) - at(before)).norm());
                Move {
                    length,
                    time: target.feed_mm_s.filter(|feed| *feed > 0.0 && length > CHORD).map(|feed| 1e3 * length / feed),
                    free: matches!(target.motion, Motion::Joint | Motion::AbsoluteJoint) || passed_over(i),
                    fixed: targets[i].fixed.is_some() || before.is_some_and(|before| before.fixed.is_some()),
                }
            })
            .collect();
        let margin = cell.cl.as_ref().map_or(SINGULAR_MARGIN, |cl| cl.singular_margin);
        Self { program, cell, prepared, targets, moves, margin, unreached }
    }

    fn robot(&self) -> &Robot {
        &self.cell.arm.robot
    }

    /// Indices of the targets whose turn is searched for.
    fn knots(&self, forced: &BTreeSet<usize>) -> Vec<usize> {
        let last = self.targets.len().saturating_sub(1);
        let mut since = 0.0;
        let mut knots = Vec::new();
        for i in 0..self.targets.len() {
            since += self.moves[i].length;
            let next_is_apart = self.moves.get(i + 1).is_some_and(|way| way.free || way.fixed || way.length >= KNOT);
            let apart = self.moves[i].free || self.moves[i].fixed || next_is_apart;
            if i == 0 || i == last || apart || since >= KNOT || forced.contains(&i) {
                knots.push(i);
                since = 0.0;
            }
        }
        knots
    }

    /// The best state at each knot.
    fn search(&self, knots: &[usize]) -> Result<Vec<State>, Vec<Diagnostic>> {
        let robot = self.robot();
        let mut search = Search::default();
        for (n, block) in knots.chunks(BLOCK).enumerate() {
            let states: Vec<(Vec<State>, states::Refused)> =
                block.par_iter().map(|&i| self.targets[i].states(robot, self.margin)).collect();
            let costs = self.costs(block, &states);
            for (k, (&i, (states, refused))) in block.iter().zip(&states).enumerate() {
                if states.is_empty() {
                    return Err(self.refuse(
                        i,
                        "the arm can take no turn about the tool axis here",
                        Refusal::Stand(*refused),
                    ));
                }
                let at = n * BLOCK + k;
                let stands_for = (i - at.checked_sub(1).map_or(0, |before| knots[before])).max(1) as f64;
                let costs: Vec<(State, f64)> =
                    states.iter().zip(&costs[k]).map(|(state, cost)| (*state, cost * stands_for)).collect();
                if !search.advance(&self.way(knots, at), robot.axis_speed.as_ref(), &costs) {
                    return Err(self.refuse(
                        i,
                        "no turn can be followed to here from the targets before",
                        Refusal::Move,
                    ));
                }
            }
        }
        let chosen = search.best();
        Ok(knots
            .par_iter()
            .zip(&chosen)
            .map(|(&i, &state)| self.targets[i].states(robot, self.margin).0[state])
            .collect())
    }

    /// The way into a knot from the one before.
    fn way(&self, knots: &[usize], at: usize) -> Move {
        let from = at.checked_sub(1).map_or(0, |before| knots[before] + 1);
        let between = &self.moves[from..=knots[at]];
        Move {
            length: between.iter().map(|way| way.length).sum(),
            time: between.iter().map(|way| way.time).sum(),
            free: between.iter().any(|way| way.free),
            fixed: between.iter().any(|way| way.fixed),
        }
    }

    /// Squared predicted errors (m²) of the states of some knots; infinite where there is no equilibrium.
    fn costs(&self, block: &[usize], states: &[(Vec<State>, states::Refused)]) -> Vec<Vec<f64>> {
        let asked = block.iter().zip(states).flat_map(|(&i, (states, _))| states.iter().map(move |state| (i, state)));
        let (at, points): (Vec<usize>, Vec<Point>) =
            asked.map(|(i, state)| (i, self.turned(i, state.turn, state.motor))).unzip();
        let mut errors = self.squared_errors(&at, points).into_iter();
        let weighed = |i: usize, square: f64| match &self.prepared.points[i] {
            point if point.unsolved.is_some() => 0.0,
            point if point.cuts() => square,
            _ => AIR * square,
        };
        block
            .iter()
            .zip(states)
            .map(|(&i, (states, _))| errors.by_ref().take(states.len()).map(|square| weighed(i, square)).collect())
            .collect()
    }

    /// Point `i` with another turn (rad) and the motor angles (rad) that reach it.
    fn turned(&self, i: usize, turn: f64, motor: Joints) -> Point {
        let (point, target) = (&self.prepared.points[i], &self.targets[i]);
        let pose = spin::turned(target.position, &target.axis, turn);
        let load = match point.load {
            PointLoad::Constant { force, follows: Follows::Tool } => {
                let with = pose.rotation * point.wobj_from_tcp.rotation.inverse();
                PointLoad::Constant { force: with * force, follows: Follows::Tool }
            }
            load => load,
        };
        Point { wobj_from_tcp: pose, reference: pose, motor, load, ..point.clone() }
    }

    /// Squares of the predicted errors (m²) of points that stand for the targets `at`: along the surface normal where the text
    /// prints one, else of the TCP's shift.
    fn squared_errors(&self, at: &[usize], points: Vec<Point>) -> Vec<f64> {
        let with = self.prepared.with_points(points);
        let solver = Solver::new(&self.cell.arm, &with, Parallelism::Threads);
        let predicted = solver.forward(|k| with.points[k].as_programmed(), |_| WarmStart::default());
        let square = |(k, predicted): (usize, &Result<PredictedPose, _>)| match predicted {
            Ok(there) => match self.program.targets[at[k]].goal {
                Goal::Axis { normal: Some(_), .. } => {
                    with.points[k].normal_error(&with.laws, &there.shift, &there.axis).powi(2)
                }
                _ => there.shift.norm_squared(),
            },
            Err(_) => f64::INFINITY,
        };
        predicted.iter().enumerate().map(square).collect()
    }

    /// Turns of the knots (rad) with the grid's steps smoothed: each moves towards the line between its neighbours, by half a
    /// cell at most, so that its cost hardly changes; averages keep the rate of turn.
    fn smoothed(&self, knots: &[usize], found: &[State]) -> Vec<f64> {
        let mut turns: Vec<f64> = found.iter().map(|state| state.turn).collect();
        let ways: Vec<Move> = (0..knots.len()).map(|at| self.way(knots, at)).collect();
        let held = |at: usize| at == 0 || at + 1 == knots.len() || self.targets[knots[at]].fixed.is_some();
        for _ in 0..SMOOTHING {
            let before = turns.clone();
            for at in (0..knots.len()).filter(|&at| !held(at) && !ways[at].free && !ways[at + 1].free) {
                let (into, out) = (ways[at].length, ways[at + 1].length);
                if into + out <= CHORD {
                    continue;
                }
                let (left, right) = (wrap(before[at - 1] - before[at]), wrap(before[at + 1] - before[at]));
                let line = (left * out + right * into) / (into + out);
                let from_grid = wrap(before[at] + 0.5 * line - found[at].turn);
                turns[at] = found[at].turn + from_grid.clamp(-0.5 * STEP, 0.5 * STEP);
            }
            // Both neighbours of a step may have moved away from it.
            for at in 1..knots.len() {
                let turn = wrap(turns[at] - turns[at - 1]).abs();
                if !ways[at].free && !ways[at].fixed && turn > ways[at].length * RATE {
                    (turns[at - 1], turns[at]) = (before[at - 1], before[at]);
                }
            }
        }
        turns
    }

    /// The turn at every target between the knots' (rad), linear in the length, and the motor angles there; else the first
    /// target that the arm cannot follow to.
    fn follow(&self, knots: &[usize], found: &[State], turns: &[f64]) -> Result<Vec<Chosen>, usize> {
        let robot = self.robot();
        let mut chosen: Vec<Chosen> = Vec::with_capacity(self.targets.len());
        for (at, &knot) in knots.iter().enumerate() {
            let first = at.checked_sub(1).map_or(0, |before| knots[before] + 1);
            let way = self.way(knots, at);
            let from = at.checked_sub(1).map_or(turns[at], |before| turns[before]);
            let (whole, mut done) = (wrap(turns[at] - from), 0.0);
            for i in first..=knot {
                done += self.moves[i].length;
                let target = &self.targets[i];
                if let Some((_, motor)) = target.fixed {
                    chosen.push(Chosen { turn: None, near: motor });
                    continue;
                }
                let share = if i == knot || way.length <= CHORD { 1.0 } else { done / way.length };
                let turn = if i == knot { turns[at] } else { from + share * whole };
                let near = match chosen.last() {
                    Some(before) if i != knot => before.near,
                    _ => found[at].motor,
                };
                let motor = robot.inverse_near(&target.base_from_flange(turn), &near).map_err(|_| i)?;
                let rate = chosen.last().and_then(|before| before.turn).map(|before| wrap(turn - before).abs());
                let quick = rate.is_some_and(|turned| turned > self.moves[i].length * RATE + STEP * ROUNDING);
                let other = states::branch_of(robot, &motor) != found[at].branch;
                if other || singular(robot, &motor, self.margin) || (quick && !self.moves[i].free) {
                    return Err(i);
                }
                chosen.push(Chosen { turn: Some(wrap(turn)), near: motor });
            }
        }
        Ok(chosen)
    }

    /// What the chosen turns gain, over the targets that cut.
    fn gain(&self, chosen: &[Chosen]) -> Diagnostic {
        let cuts = |i: &usize| self.prepared.points[*i].cuts() && self.program.targets[*i].is_end();
        let reached = |i: &usize| self.unreached.binary_search(i).is_err();
        let all: Vec<usize> = (0..chosen.len()).filter(cuts).collect();
        let both: Vec<usize> = all.iter().copied().filter(reached).collect();
        let rms_mm = |at: &[usize], points: Vec<Point>| {
            let squares = self.squared_errors(at, points);
            1e3 * (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
        };
        let with = |i: &usize| match chosen[*i].turn {
            Some(turn) => self.turned(*i, turn, chosen[*i].near),
            None => self.prepared.points[*i].clone(),
        };
        let before = rms_mm(&both, both.iter().map(|&i| self.prepared.points[i].clone()).collect());
        let after = rms_mm(&both, both.iter().map(with).collect());
        let what = match self.program.language {
            Language::Cl => "`spin_deg` throughout",
            Language::Rapid | Language::Krl | Language::Ls => "the turn as written",
        };
        let mut message = format!(
            "the turn about the tool axis is chosen at {} targets: predicted error rms {before:.4} mm with {what}, {after:.4} mm with the chosen one",
            chosen.iter().filter(|chosen| chosen.turn.is_some()).count(),
        );
        if !self.unreached.is_empty() {
            message += &format!("; with {what} {} targets are not reached", self.unreached.len());
        }
        let source = self.program.sources.first().map_or("", |source| source.name.as_str());
        Diagnostic::error("spin.chosen", source, message).severity(Severity::Note)
    }

    fn refuse(&self, i: usize, what: &str, why: Refusal) -> Vec<Diagnostic> {
        let target = &self.program.targets[i];
        let source = &self.program.sources[usize::from(target.source)];
        let (why, help) = match why {
            Refusal::Stand(states::Refused { reach, limits, singular }) => (
                format!(
                    ": of its turns and branches {reach} are out of reach, {limits} beyond an axis limit, {singular} closer than {:.0}° to a singular wrist",
                    self.margin.to_degrees()
                ),
                "move the part (`[wobjs]`), lower `[cl] singular_margin_deg`, or lean the tool otherwise",
            ),
            Refusal::Move => (
                " within 5° a millimetre of path, the axis limits and speeds, on one branch".to_owned(),
                "put a joint move or more path between, or move the part (`[wobjs]`)",
            ),
            Refusal::Between => (String::new(), "move the part (`[wobjs]`), or lower `[cl] singular_margin_deg`"),
        };
        let message = format!("target {}: {what}{why}", target.ordinal);
        vec![Diagnostic::error("spin.none", "", message).on_line(source, target.span, target.line).help(help)]
    }
}

/// Rounding of turns that are interpolated, in cells of the grid.
const ROUNDING: f64 = 1e-6;

/// Whether a target's numbers are used more than once: one turn has to suit all uses, so that it stays as written.
fn shared_numbers(program: &Program) -> impl Fn(&Target) -> bool {
    let key = |target: &Target| match &target.name {
        Some(name) => Err(name.to_uppercase()),
        None => Ok((target.source, target.span.start)),
    };
    let mut uses: HashMap<Result<(u16, u32), String>, usize> = HashMap::new();
    for target in &program.targets {
        *uses.entry(key(target)).or_default() += 1;
    }
    move |target| uses.get(&key(target)).is_some_and(|uses| *uses > 1)
}
