//! Chooses the targets to insert so that the error between targets is within a tolerance.
//!
//! The needed command anywhere on a segment is explicit: the inverse equilibrium of the programmed pose there, under the force of the
//! segment. It is compared with the controller's interpolation between the commands at both ends of an interval, at the quarters and in
//! the middle. If they differ, the middle becomes a target. At the start of a segment the needed command may jump, because the force of
//! the segment begins there: the first inserted target is so close to the start that the jump is short.
//! [`deviation`](super::deviation) judges the result with the forward model.

use super::deviation::{Commanded, JUMP_WITHIN, Node, WalkedPath};
use super::halved::{Halved, Interval, Tick};
use super::point::Point;
use super::segment::{Kind, Segment, Start};
use super::solve::{CorrectionMode, Solved, Solver, controller_motor};
use super::{Prepared, frames};
use deflex_cell::Cell;
use deflex_drive::Track;
use deflex_equilibrium::{Dragged, direction};
use deflex_program::{Insert, Program};
use deflex_robot::{conf_is, conf_like};
use nalgebra::Vector3;

/// Share of the tolerance that is allowed at the compared points: the rest is for the points between, and for the feedback of the
/// deflection on the force.
const SHARE: f64 = 0.8;

/// Resolution of single precision, m.
const RESOLUTION: f64 = 2e-7;

/// Least length over which a jump is spread, m: a controller still distinguishes it from a standstill.
const JUMP_LEAST: f64 = 0.02e-3;

/// Intervals shorter than this are not halved, m: a jump inside comes from a joint that turns back.
const SHORTEST: f64 = 0.1e-3;

/// Arcs shorter than this are lines, rad: a `MoveC` needs a degree between circle point and end, seen from its start.
const SHORTEST_ARC: f64 = 8.0 * std::f64::consts::PI / 180.0;

/// Number of ticks by which positions on a segment are counted.
const TICKS: Tick = 1 << 20;

/// The inserted points, and the circle points that move because of them.
pub(super) struct Subdivision {
    /// The inserted points, in order.
    pub(super) nodes: Vec<Node>,
    /// New positions of the circle points of arcs that were split, by index.
    pub(super) vias: Vec<(usize, Point, Solved)>,
}

/// A segment that is being subdivided.
struct Plan<'p> {
    segment: Segment<'p>,
    /// The command at the start.
    from: Solved,
    /// The joints at the start.
    dragged: Dragged,
    to: Solved,
    mode: CorrectionMode,
    length: f64,
    /// Share at which the ticks begin, after a jump.
    first: f64,
    /// Needed commands by tick; `None` if there is no solution.
    needed: Halved<Solved>,
}

/// Targets to insert so that the error between targets is at most `tolerance` (m). `last` is the end of the targets before.
pub(super) fn subdivide(
    program: &Program,
    solver: &Solver<'_>,
    commanded: &Commanded,
    modes: &[CorrectionMode],
    last: Option<&Start>,
    tolerance: f64,
) -> Subdivision {
    let prepared = solver.prepared;
    let walked = WalkedPath { program, prepared, commanded, last };
    let enough = (SHARE * tolerance).max(RESOLUTION);
    let starts: Vec<(usize, Start)> = (0..prepared.points.len())
        .filter(|i| matches!(Kind::of(program, *i), Kind::Line | Kind::Arc) && modes[*i] != CorrectionMode::Keep)
        .filter_map(|i| Some((i, walked.before(i)?)))
        .filter_map(|(i, from)| Some((i, walked.start(from)?)))
        .collect();
    let mut plans: Vec<Plan<'_>> =
        starts.iter().filter_map(|(i, start)| Plan::new(&walked, *i, start, modes[*i])).collect();
    // The needed commands at the start of each segment, under its own force.
    let begin = solve(solver, &plans, &(0..plans.len()).map(|at| (at, 0.0)).collect::<Vec<_>>());
    for (plan, needed) in plans.iter_mut().zip(begin) {
        plan.begin(needed, enough);
    }
    loop {
        let wanted: Vec<(usize, Tick)> = plans
            .iter()
            .enumerate()
            .flat_map(|(at, plan)| plan.needed.wanted().into_iter().map(move |tick| (at, tick)))
            .collect();
        if wanted.is_empty() {
            break;
        }
        let places: Vec<(usize, f64)> = wanted.iter().map(|(at, tick)| (*at, plans[*at].share(*tick))).collect();
        for ((at, tick), needed) in wanted.iter().zip(solve(solver, &plans, &places)) {
            plans[*at].needed.values.insert(*tick, needed);
        }
        plans.iter_mut().for_each(|plan| plan.judge(enough));
    }
    let mut subdivision = Subdivision { nodes: Vec::new(), vias: Vec::new() };
    plans.into_iter().for_each(|plan| plan.finish(&mut subdivision));
    subdivision
}

/// The commands needed at shares of segments; `None` if there is no solution.
fn solve(solver: &Solver<'_>, plans: &[Plan<'_>], places: &[(usize, f64)]) -> Vec<Option<Solved>> {
    let points = solver.parallelism.map(places.len(), |k| {
        let (plan, share) = (&plans[places[k].0], places[k].1);
        plan.point(solver, share)
    });
    let reached: Vec<bool> = points.iter().map(Option::is_some).collect();
    // A point out of reach is replaced by another, whose result is not used.
    let points = points
        .into_iter()
        .zip(places)
        .map(|(point, (at, share))| point.unwrap_or_else(|| plans[*at].segment.at(*share)));
    let batch: Prepared = solver.prepared.with_points(points.collect());
    let modes: Vec<CorrectionMode> = places.iter().map(|(at, _)| plans[*at].mode).collect();
    let travels: Vec<_> = batch.points.iter().map(|point| point.travel).collect();
    let solver = Solver::new(solver.arm, &batch, solver.parallelism);
    let first = solver.first(&modes);
    let solved = solver.commands(&modes, &first, &travels);
    solved.into_iter().zip(reached).map(|(solved, reached)| solved.ok().filter(|_| reached)).collect()
}

impl<'p> Plan<'p> {
    fn new(walked: &WalkedPath<'p>, i: usize, start: &'p Start, mode: CorrectionMode) -> Option<Self> {
        let segment = Segment::into(walked.program, walked.prepared, i, start)?;
        let motor = walked.commanded.step(i)?.motor;
        let length = segment.track.length();
        let begins = start.seen(&start.commanded, walked.prepared, i)?;
        let from = Solved { motor: start.motor, wobj_from_tcp: begins };
        let to = Solved { motor, wobj_from_tcp: walked.commanded.poses[i] };
        let plan =
            Self { segment, from, dragged: start.dragged(), to, mode, length, first: 0.0, needed: Halved::new(TICKS) };
        (length > 2.0 * JUMP_LEAST).then_some(plan)
    }

    fn share(&self, tick: Tick) -> f64 {
        self.first + (1.0 - self.first) * f64::from(tick) / f64::from(TICKS)
    }

    /// Length of an interval, m.
    fn size(&self, interval: Interval) -> f64 {
        (self.share(interval.to) - self.share(interval.from)) * self.length
    }

    /// Finds whether the needed command jumps at the start.
    fn begin(&mut self, needed: Option<Solved>, enough: f64) {
        let Some(needed) = needed else { return self.needed.open.clear() };
        let shift = self.from.wobj_from_tcp.translation.vector - needed.wobj_from_tcp.translation.vector;
        let track = &self.segment.track;
        let jump = if self.segment.corner { track.across_start(&shift) } else { track.across(0.0, &shift) }.norm();
        if jump > enough && self.length > JUMP_WITHIN {
            // On average over the length of the jump, half of the allowed error.
            let over = (JUMP_WITHIN * enough / jump).clamp(JUMP_LEAST, JUMP_WITHIN);
            self.first = (over / self.length).min(0.5);
        } else {
            self.needed.values.insert(0, Some(self.from.clone()));
        }
        if !self.segment.track.is_arc() {
            self.needed.values.insert(TICKS, Some(self.to.clone()));
        }
    }

    /// The point at a share of the segment; `None` if it is out of reach.
    fn point(&self, solver: &Solver<'_>, share: f64) -> Option<Point> {
        /// Share of the length over which the direction of travel is determined.
        const STEP: f64 = 1e-3;
        let mut point = self.segment.at(share);
        let arm = solver.arm;
        let near = self.from.motor + (self.to.motor - self.from.motor) * share;
        let motor = |share: f64| {
            controller_motor(&arm.robot, &self.segment.setting(share), &self.segment.track.pose(share), &near)
        };
        let here = motor(share)?;
        point.travel = if !arm.presliding().is_sharp() {
            arm.travel(&self.dragged, &here, &point.twist())
        } else if share < STEP {
            direction(&here, &motor(share + STEP)?, &point.travel)
        } else {
            direction(&motor(share - STEP)?, &here, &point.travel)
        };
        point.motor = here;
        Some(point)
    }

    /// Whether the controller's interpolation on a part is an arc. The last part is the instruction of the text: an arc.
    fn is_arc(&self, interval: Interval) -> bool {
        let angle = || self.size(interval) * (self.segment.track.angle() / self.length);
        self.segment.track.is_arc() && (interval.to == TICKS || angle() >= SHORTEST_ARC)
    }

    /// Halves the intervals on which the controller's interpolation between the commands is not the needed command.
    fn judge(&mut self, enough: f64) {
        let mut needed = std::mem::replace(&mut self.needed, Halved::new(TICKS));
        needed.judge(|interval, five| {
            let [a, b, c, d, e] = &five.map(|solved| solved.wobj_from_tcp);
            let between = match self.is_arc(interval) {
                true => Track::arc(a, c, e, self.segment.arc_turn()),
                false => Track::line(a, e),
            };
            let mut off = [(1, b), (2, c), (3, d)].into_iter().map(|(k, needed)| {
                let share = f64::from(k) / 4.0;
                let shift: Vector3<f64> = between.pose(share).translation.vector - needed.translation.vector;
                self.segment.track.across(self.share(interval.from + k * interval.quarter()), &shift).norm()
            });
            let shortest = if self.segment.track.is_arc() && interval.to == TICKS {
                2.0 * SHORTEST_ARC / (self.segment.track.angle() / self.length)
            } else {
                2.0 * SHORTEST
            };
            off.all(|off| off <= enough) || self.size(interval) < shortest || interval.quarter() < 2
        });
        self.needed = needed;
    }

    fn finish(mut self, out: &mut Subdivision) {
        self.needed.done.sort_unstable();
        let end = self.segment.end;
        let node = |tick: Tick, via: Option<Tick>| {
            Some(Node {
                before: end,
                share: self.share(tick),
                length: self.length,
                commanded: self.needed.at(tick)?.wobj_from_tcp,
                via: via.and_then(|via| self.needed.at(via)).map(|via| via.wobj_from_tcp),
                moved: self.segment.moved(self.share(tick)),
            })
        };
        let split = self.needed.done.len() > 1 || self.first > 0.0;
        if !split {
            return;
        }
        if self.first > 0.0 {
            out.nodes.extend(node(0, None));
        }
        for &interval in &self.needed.done {
            let (to, middle) = (interval.to, interval.middle());
            let arc = self.is_arc(interval) && self.needed.five(interval).is_some();
            if to < TICKS {
                out.nodes.extend(node(to, arc.then_some(middle)));
            } else if arc && let Some(via) = self.needed.at(middle) {
                out.vias.push((end - 1, self.segment.at(self.share(middle)), via));
            }
        }
    }
}

/// The motions to insert for nodes.
pub(super) fn inserts(program: &Program, cell: &Cell, prepared: &Prepared, nodes: &[Node]) -> Vec<Insert> {
    let neighbour =
        |k: Option<usize>, node: &Node| k.and_then(|k| nodes.get(k)).filter(|other| other.before == node.before);
    let insert = |(k, node): (usize, &Node)| {
        let (target, point) = (&program.targets[node.before], &prepared.points[node.before]);
        let from = neighbour(k.checked_sub(1), node).map_or(0.0, |before| before.share);
        let to = neighbour(Some(k + 1), node).map_or(1.0, |after| after.share);
        let room = (node.share - from).min(to - node.share) * node.length;
        // The configuration is updated only if it is that of the arm: some post-processors write a placeholder.
        let robot = &cell.arm.robot;
        let written_conf = target.conf().filter(|written| conf_is(robot, &point.motor, *written));
        let setting = node.moved.as_ref().map_or(prepared.setting(node.before), |moved| &moved.setting);
        let motor = controller_motor(robot, setting, &node.commanded, &point.motor);
        // As written, that is without the offsets of the controller.
        let external = node.moved.as_ref().map(|moved| match (&target.external, program.language) {
            (Some(axes), language) if language.is_edited() => {
                let moving = |i: usize| moved.external[i] - axes.offset[i];
                std::array::from_fn(|i| {
                    axes.written[i].map(|written| if axes.at_rest[i] { written } else { moving(i) })
                })
            }
            _ => moved.external.map(|position| (!position.is_nan()).then_some(position)),
        });
        let (position_mm, quat) = frames::millimetres(&node.commanded);
        Insert {
            conf: motor.zip(written_conf).map(|(motor, written)| conf_like(robot, &motor, written)),
            via: node.via.as_ref().map(frames::millimetres),
            external,
            ..Insert::line(node.before, (position_mm, quat), 1e3 * room)
        }
    };
    nodes.iter().enumerate().map(insert).collect()
}

/// Nodes in the controller's precision, without those that could not be written.
pub(super) fn as_written(nodes: Vec<Node>, written: impl Fn(usize) -> Option<([f64; 3], [f64; 4])>) -> Vec<Node> {
    let held = |(k, node): (usize, Node)| {
        let (position_mm, quat) = written(k)?;
        Some(Node { commanded: frames::pose(position_mm, quat), ..node })
    };
    nodes.into_iter().enumerate().filter_map(held).collect()
}
