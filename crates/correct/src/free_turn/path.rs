//! A program's targets for the search: knots, motions between them, states and their costs.

use super::axes::{FreeAxis, Grid, Move, Position, Stage, with};
use super::search::Search;
use super::site::Site;
use super::states::{self, FreeTarget, PostureChoice, Refused, singular};
use crate::carried::Chosen;
use crate::load::{Follows, PointLoad};
use crate::mount::{Mount, Moved};
use crate::parallelism::Parallelism;
use crate::path::NO_TOOL;
use crate::point::{Point, tool_axis};
use crate::solve::Solver;
use crate::travel::CHORD;
use crate::{Prepared, spin};
use deflex_cell::{Cell, Cl, MOST_FREE};
use deflex_equilibrium::{PredictedPose, Setting, WarmStart};
use deflex_program::{Editable, Goal, Language, Motion, Program, Role, Target};
use deflex_robot::{Joints, Robot};
use deflex_text::Diagnostic;
use rayon::prelude::*;
use smallvec::SmallVec;
use std::collections::{BTreeSet, HashMap};
use std::sync::Arc;

/// Least distance between knots if the path is denser, m: two cells of the grid at the largest rate.
const KNOT: f64 = 2e-3;

/// Number of knots whose states are evaluated together if no axis is free: some ten thousand equilibria, whose points are some megabytes.
const BLOCK: usize = 32;

/// Weight of a target that does not cut: it decides only between trajectories that cut equally well.
const AIR: f64 = 1e-6;

/// Additional margins for the states of a knot because of faults next to it.
#[derive(Clone, Copy, Debug)]
pub(super) struct KeptClear {
    /// Distance from the axis limits, rad.
    pub(super) limits: f64,
    /// Distance from a singular wrist in addition to the usual margin, rad.
    pub(super) singular: f64,
    /// Factor on the speed of the motion to it.
    pub(super) speed: f64,
}

impl Default for KeptClear {
    fn default() -> Self {
        Self { limits: 0.0, singular: 0.0, speed: 1.0 }
    }
}

/// A program's targets for the search.
pub(super) struct Path<'a> {
    pub(super) language: Language,
    pub(super) cell: &'a Cell,
    /// Settings and laws of the sites.
    prepared: Prepared,
    /// One for each target.
    pub(super) sites: Vec<Site>,
    /// External axes that are free.
    pub(super) axes: SmallVec<[FreeAxis; MOST_FREE]>,
    /// Why free axes of the cell stay as written.
    pub(super) held: Vec<String>,
    /// Positions of the free axes around which the grid is made, one for each target; at first those of the program.
    pub(super) base: Vec<Position>,
    /// Whether the turn of each target is free, and whether its axes are.
    is_free: Vec<[bool; 2]>,
    pub(super) moves: Vec<Move>,
    pub(super) margin: f64,
    /// Additional margins of knots because of faults next to them.
    pub(super) kept_clear: HashMap<usize, KeptClear>,
    /// Targets that are out of reach with the written turn, in rising order.
    pub(super) unreached: Vec<usize>,
    /// Name of the file, for messages.
    pub(super) file: String,
    /// The program, if it is held as a whole, for the lines that messages quote.
    whole: Option<&'a Program>,
}

/// The reason for a refusal.
pub(super) enum Refusal {
    Stand(Refused),
    Move,
    Between,
}

/// The states of a knot.
#[derive(Default)]
struct Standing {
    /// States with different postures or positions of the axes.
    unique: Vec<PostureChoice>,
    /// Units of each of these.
    moved: Vec<Option<Arc<Moved>>>,
    /// States on their lanes, with the index of the state above.
    on_lanes: Vec<(PostureChoice, u32)>,
    refused: Refused,
}

impl<'a> Path<'a> {
    /// The path of a program that is held as a whole.
    pub(super) fn of_program(program: &'a Program, cell: &'a Cell, prepared: Prepared) -> Self {
        let mut path = Self::new(program, cell);
        path.extend(program, prepared);
        path.whole = Some(program);
        path
    }

    /// A path without targets; `first` is the program, or its first chunk.
    pub(super) fn new(first: &Program, cell: &'a Cell) -> Self {
        let (axes, held) = free_axes(first, cell);
        Self {
            language: first.language,
            cell,
            prepared: Prepared::of_points(Vec::new(), &cell.arm.robot, NO_TOOL),
            sites: Vec::new(),
            axes,
            held,
            base: Vec::new(),
            is_free: Vec::new(),
            moves: Vec::new(),
            margin: cell.cl.as_ref().map_or(Cl::SINGULAR_MARGIN, |cl| cl.singular_margin),
            kept_clear: HashMap::new(),
            unreached: Vec::new(),
            file: first.sources.first().map_or_else(String::new, |source| source.name.clone()),
            whole: None,
        }
    }

    /// Adds the targets of the program or of its next chunk.
    pub(super) fn extend(&mut self, program: &Program, prepared: Prepared) {
        let shared = shared_numbers(program);
        let writes_axes = if self.axes.is_empty() { Vec::new() } else { program.writes_axes() };
        let first = self.sites.len();
        for (i, target) in program.targets.iter().enumerate() {
            let site = Site::of(program, &prepared, i);
            let turn = match target.goal {
                _ if site.unsolved.is_some() => false,
                Goal::Axis { .. } => true,
                Goal::Pose { .. } => target.editable == Editable::Pose && !shared(target),
                Goal::Joints { .. } => false,
            };
            let own = program.language == Language::Cl || writes_axes.get(i) == Some(&true);
            self.is_free.push([turn, turn && own && has_free_axes(program, &prepared, &self.axes, i)]);
            if !self.axes.is_empty() {
                self.base.push(written(self.base.last(), &site, &self.axes));
            }
            self.sites.push(site);
        }
        self.prepared = prepared;
        self.prepared.points = Vec::new();
        for (i, target) in program.targets.iter().enumerate() {
            let motion = self.motion_to(target, first + i);
            self.moves.push(motion);
        }
    }

    /// The motion to a target.
    fn motion_to(&self, target: &Target, i: usize) -> Move {
        let before = i.checked_sub(1);
        // If a target is not solved, the posture of the arm is unknown.
        let unsolved = |i: usize| self.sites[i].unsolved.is_some();
        let length = before.map_or(0.0, |before| {
            let [from, to] = [before, i].map(|i| self.sites[i].wobj_from_tcp.translation.vector);
            if self.sites[before].setting == self.sites[i].setting {
                return (to - from).norm();
            }
            let at = |i: usize, at| self.written_setting(i).base_from_wobj * nalgebra::Point3::from(at);
            (at(i, to) - at(before, from)).norm()
        });
        let time = target.feed_mm_s.filter(|feed| *feed > 0.0 && length > CHORD).map(|feed| 1e3 * length / feed);
        let mut room = [0.0; MOST_FREE];
        for (k, axis) in self.axes.iter().enumerate() {
            // The written positions are always allowed.
            let written = before.map_or(0.0, |before| (self.base[i][k] - self.base[before][k]).abs());
            room[k] = axis.room(length, time).max(written);
        }
        Move {
            length,
            time,
            free: matches!(target.motion, Motion::Joint | Motion::AbsoluteJoint)
                || unsolved(i)
                || before.is_some_and(unsolved),
            fixed: !self.is_free[i][0] || before.is_some_and(|before| !self.is_free[before][0]),
            room,
        }
    }

    pub(super) fn mount(&self, i: usize) -> &Mount {
        &self.prepared.shared.settings[self.sites[i].setting as usize]
    }

    /// The setting of a target as written.
    fn written_setting(&self, i: usize) -> &Setting {
        self.sites[i].moved.as_ref().map_or(&self.mount(i).setting, |moved| &moved.setting)
    }

    pub(super) fn robot(&self) -> &'a Robot {
        &self.cell.arm.robot
    }

    /// Whether the turn of a target is free.
    pub(super) fn has_free_turn(&self, i: usize) -> bool {
        self.is_free[i][0]
    }

    /// Whether the free axes are free at a target.
    pub(super) fn has_free_axes(&self, i: usize) -> bool {
        self.is_free[i][1]
    }

    /// The data of a target that the kinematics need.
    pub(super) fn target(&self, i: usize) -> FreeTarget {
        let point = &self.sites[i];
        let decided = self.language != Language::Cl;
        let fixed = (spin::turn_of(&point.wobj_from_tcp), point.motor);
        FreeTarget {
            position: point.wobj_from_tcp.translation.vector,
            axis: tool_axis(&point.wobj_from_tcp),
            near: point.motor,
            fixed: (!self.has_free_turn(i)).then_some(fixed),
            branch: decided.then(|| states::branch_of(self.robot(), &point.motor)),
        }
    }

    /// The units of a target with the free axes at a position.
    pub(super) fn moved(&self, i: usize, position: &Position) -> Option<Arc<Moved>> {
        let written = &self.sites[i].moved;
        if !self.has_free_axes(i) {
            return written.clone();
        }
        let external = with(&written.as_ref()?.external, &self.axes, position);
        self.mount(i).moved(external)
    }

    /// The setting for these units.
    pub(super) fn setting<'b>(&'b self, i: usize, moved: &'b Option<Arc<Moved>>) -> &'b Setting {
        moved.as_ref().map_or_else(|| self.written_setting(i), |moved| &moved.setting)
    }

    /// Indices of the targets whose turn is searched for.
    pub(super) fn knots(&self, forced: &BTreeSet<usize>) -> Vec<usize> {
        let last = self.moves.len().saturating_sub(1);
        let mut since = 0.0;
        let mut knots = Vec::new();
        for i in 0..self.moves.len() {
            since += self.moves[i].length;
            let next_is_apart =
                self.moves.get(i + 1).is_some_and(|motion| motion.free || motion.fixed || motion.length >= KNOT);
            let apart = self.moves[i].free || self.moves[i].fixed || next_is_apart;
            if i == 0 || i == last || apart || since >= KNOT || forced.contains(&i) || self.is_pinned(i) {
                knots.push(i);
                since = 0.0;
            }
        }
        knots
    }

    /// Whether the free axes stay as written at a target.
    fn is_pinned(&self, i: usize) -> bool {
        !self.axes.is_empty() && !self.has_free_axes(i)
    }

    /// The motions to the knots.
    pub(super) fn motions(&self, knots: &[usize]) -> Vec<Move> {
        (0..knots.len()).map(|at| self.motion(knots, at)).collect()
    }

    /// The best state at each knot.
    pub(super) fn search(&self, knots: &[usize], grid: &Grid) -> Result<Vec<PostureChoice>, Vec<Diagnostic>> {
        let robot = self.robot();
        let pinned: Vec<bool> = knots.iter().map(|&i| self.is_pinned(i)).collect();
        let motions = self.motions(knots);
        let stages = grid.stages(&self.axes, &motions, &pinned);
        let mut scales = [0.0; MOST_FREE];
        self.axes.iter().zip(&mut scales).for_each(|(axis, scale)| *scale = axis.si(1.0));
        let mut search = Search::new(&grid.lanes, scales);
        let block = (BLOCK / grid.size()).max(1);
        for (n, block_knots) in knots.chunks(block).enumerate() {
            let first = n * block;
            let standings: Vec<Standing> =
                block_knots.par_iter().enumerate().map(|(k, &i)| self.standing(i, grid, &stages[first + k])).collect();
            let costs = self.costs(block_knots, &standings);
            for (k, ((&i, standing), costs)) in block_knots.iter().zip(&standings).zip(costs).enumerate() {
                if standing.on_lanes.is_empty() {
                    return Err(self.refuse(
                        i,
                        "no turn about the tool axis is possible here",
                        Refusal::Stand(standing.refused),
                    ));
                }
                let at = first + k;
                let stands_for = (i - at.checked_sub(1).map_or(0, |before| knots[before])).max(1) as f64;
                let weighed = |(state, of): &(PostureChoice, u32)| (*state, costs[*of as usize] * stands_for);
                let costs: Vec<(PostureChoice, f64)> = standing.on_lanes.iter().map(weighed).collect();
                if !search.advance((&motions[at], stages[at].begins), robot.axis_speed.as_ref(), &costs) {
                    return Err(self.refuse(
                        i,
                        "no turn about the tool axis leads from the targets before to this one",
                        Refusal::Move,
                    ));
                }
            }
        }
        let chosen = search.best();
        Ok(knots
            .par_iter()
            .enumerate()
            .map(|(at, &i)| self.standing(i, grid, &stages[at]).on_lanes[chosen[at]].0)
            .collect())
    }

    /// The possible states of arm and free axes at a knot.
    fn standing(&self, i: usize, grid: &Grid, stage: &Stage) -> Standing {
        let target = self.target(i);
        let base = self.base.get(i).copied().unwrap_or_default();
        let mut out = Standing::default();
        // Positions so far, and their states among the unique ones.
        let mut seen: HashMap<[u64; MOST_FREE], (u32, u32)> = HashMap::new();
        for lane in (0_u16..).take(grid.lanes.len()).filter(|lane| *lane == grid.still || !self.is_pinned(i)) {
            let Some(position) = grid.position(&self.axes, lane, &base, stage) else { continue };
            let (from, to) = *seen.entry(position.map(f64::to_bits)).or_insert_with(|| {
                let moved = self.moved(i, &position);
                let setting = self.setting(i, &moved);
                let (mut states, refused) = target.states(self.robot(), self.margin, (setting, position));
                if let Some(KeptClear { limits, singular: wider, .. }) = self.kept_clear.get(&i) {
                    let robot = self.robot();
                    let is_clear = |motor: &Joints| {
                        robot.limit_margin(motor) >= *limits && !singular(robot, motor, self.margin + wider)
                    };
                    states.retain(|state| target.fixed.is_some() || is_clear(&state.motor));
                }
                let from = out.unique.len();
                out.unique.extend(states);
                out.moved.resize(out.unique.len(), moved);
                out.refused += refused;
                // A knot has some ten thousand states.
                (from as u32, out.unique.len() as u32)
            });
            out.on_lanes.extend((from..to).map(|of| (PostureChoice { lane, ..out.unique[of as usize] }, of)));
        }
        out
    }

    /// The motion to a knot from the one before.
    pub(super) fn motion(&self, knots: &[usize], at: usize) -> Move {
        let from = at.checked_sub(1).map_or(0, |before| knots[before] + 1);
        let between = &self.moves[from..=knots[at]];
        let faster = self.kept_clear.get(&knots[at]).map_or(1.0, |clear| clear.speed);
        Move {
            length: between.iter().map(|motion| motion.length).sum(),
            time: between.iter().map(|motion| motion.time).sum::<Option<f64>>().map(|time| time / faster),
            free: between.iter().any(|motion| motion.free),
            fixed: between.iter().any(|motion| motion.fixed),
            room: std::array::from_fn(|k| between.iter().map(|motion| motion.room[k]).sum()),
        }
    }

    /// Squared predicted errors (m²) of the states of some knots; infinite where there is no equilibrium.
    fn costs(&self, block: &[usize], standings: &[Standing]) -> Vec<Vec<f64>> {
        let states = block.iter().zip(standings).flat_map(|(&i, standing)| {
            standing.unique.iter().zip(&standing.moved).map(move |(state, moved)| (i, state, moved))
        });
        let (at, points): (Vec<usize>, Vec<Point>) =
            states.map(|(i, state, moved)| (i, self.turned(i, state.turn, (state.motor, moved.clone())))).unzip();
        let mut errors = self.squared_errors(&at, points).into_iter();
        let weighed = |i: usize, square: f64| match &self.sites[i] {
            site if site.unsolved.is_some() => 0.0,
            site if site.cuts() => square,
            _ => AIR * square,
        };
        block
            .iter()
            .zip(standings)
            .map(|(&i, Standing { unique, .. })| {
                errors.by_ref().take(unique.len()).map(|square| weighed(i, square)).collect()
            })
            .collect()
    }

    /// Point `i` with another turn (rad), and with the motor angles (rad) and the positions of units for it.
    fn turned(&self, i: usize, turn: f64, (motor, moved): (Joints, Option<Arc<Moved>>)) -> Point {
        let point = self.sites[i].point();
        let position = point.wobj_from_tcp.translation.vector;
        let pose = spin::turned(position, &tool_axis(&point.wobj_from_tcp), turn);
        let load = match point.load {
            PointLoad::Constant { force, follows: Follows::Tool } => {
                let with = pose.rotation * point.wobj_from_tcp.rotation.inverse();
                PointLoad::Constant { force: with * force, follows: Follows::Tool }
            }
            load => load,
        };
        Point { wobj_from_tcp: pose, reference: pose, motor, moved, load, ..point }
    }

    /// Point `i` with its choice.
    pub(super) fn chosen_point(&self, i: usize, chosen: &Chosen) -> Point {
        let site = &self.sites[i];
        let Some(turn) = chosen.turn else { return site.point() };
        let moved = match (&chosen.external, &site.moved) {
            (Some(external), Some(_)) => {
                let position: SmallVec<[f64; MOST_FREE]> = self.axes.iter().map(|axis| external[axis.axis]).collect();
                let mut all = [0.0; MOST_FREE];
                all[..position.len()].copy_from_slice(&position);
                self.moved(i, &all)
            }
            (_, moved) => moved.clone(),
        };
        self.turned(i, turn, (chosen.near, moved))
    }

    /// Squares of the predicted errors (m²) of points for the targets `at`: along the surface normal if the text has one, otherwise of the
    /// displacement of the TCP.
    pub(super) fn squared_errors(&self, at: &[usize], points: Vec<Point>) -> Vec<f64> {
        let with = self.prepared.with_points(points);
        let solver = Solver::new(&self.cell.arm, &with, Parallelism::Threads);
        let predicted = solver.forward(|k| with.points[k].as_programmed(), |_| WarmStart::default());
        let square = |(k, predicted): (usize, &Result<PredictedPose, _>)| match predicted {
            Ok(there) if self.sites[at[k]].has_normal => {
                with.points[k].normal_error(&with.shared.laws, &there.shift, &there.axis).powi(2)
            }
            Ok(there) => there.shift.norm_squared(),
            Err(_) => f64::INFINITY,
        };
        predicted.iter().enumerate().map(square).collect()
    }

    pub(super) fn refuse(&self, i: usize, what: &str, why: Refusal) -> Vec<Diagnostic> {
        let (why, help) = match why {
            Refusal::Stand(states::Refused { reach, limits, singular }) => (
                format!(
                    ": of the turns and branches that were tried, {reach} are out of reach, {limits} are beyond an axis limit, and {singular} are closer than {:.0}° to a singular wrist",
                    self.margin.to_degrees()
                ),
                "move the part (`[wobjs]`), lower `[cl] singular_margin_deg`, or change the lean of the tool",
            ),
            Refusal::Move => (
                ": it would have to stay on one branch, within the axis limits and speeds, and change by at most 5° for each millimetre of path".to_owned(),
                "insert a joint move or a longer path before it, or move the part (`[wobjs]`)",
            ),
            Refusal::Between => (String::new(), "move the part (`[wobjs]`), or lower `[cl] singular_margin_deg`"),
        };
        let message = format!("target {}: {what}{why}", self.sites[i].ordinal());
        let refused = Diagnostic::error("spin.none", "", message).help(help);
        vec![match self.whole.map(|program| (program, &program.targets[i])) {
            Some((program, target)) => {
                refused.on_line(&program.sources[usize::from(target.source)], target.span, target.line)
            }
            None => self.sites[i].at(&self.file, refused),
        }]
    }
}

/// The external axes that are free along a program, and the reasons why others of the cell are not.
fn free_axes(program: &Program, cell: &Cell) -> (SmallVec<[FreeAxis; MOST_FREE]>, Vec<String>) {
    let axes = FreeAxis::of(cell);
    let why = if !program.language.about().chooses_external {
        "external axes are chosen for RAPID and CL data"
    } else if program.targets.iter().any(has_moved_alone) {
        "external axes move by themselves (MoveExtJ)"
    } else {
        return (axes, Vec::new());
    };
    let held = axes.iter().map(|axis| format!("unit `{}` is free, and stays as it is written: {why}", axis.name));
    (SmallVec::new(), held.collect())
}

/// Whether external axes have moved alone before a target.
pub(super) fn has_moved_alone(target: &Target) -> bool {
    target.external.as_ref().is_some_and(|external| external.moved_alone)
}

/// Whether the free axes move base or work object of a target, and the program states their positions; an arc has those of its end.
fn has_free_axes(program: &Program, prepared: &Prepared, axes: &[FreeAxis], i: usize) -> bool {
    let target = &program.targets[i];
    let written = |axis: &FreeAxis| match (program.language, &target.external) {
        (Language::Cl, _) => true,
        (_, Some(external)) => external.written[axis.axis].is_some() && external.inactive.is_empty(),
        (_, None) => false,
    };
    let is_arc = program.language != Language::Cl && (target.role == Role::Via || target.motion == Motion::Circular);
    !axes.is_empty() && !is_arc && axes.iter().all(|axis| prepared.mount(i).is_moved_by(axis.axis) && written(axis))
}

/// Positions of the free axes as written; for a target without positions, those of the target before.
fn written(before: Option<&Position>, site: &Site, axes: &[FreeAxis]) -> Position {
    let mut at = before.copied().unwrap_or_default();
    for (k, axis) in axes.iter().enumerate() {
        let position = site.moved.as_ref().map(|moved| moved.external[axis.axis]);
        at[k] = position.filter(|position| !position.is_nan()).unwrap_or(at[k]);
    }
    at
}

/// Whether a target's numbers are used more than once. One turn would have to suit all uses, so it stays as written.
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
