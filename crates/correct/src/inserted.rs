//! Inserted targets as the controller runs them: in running order with the others, with their joints and directions of travel. Each is
//! judged by the point of the programmed path that is nearest to the position of the loaded tool.

use super::Prepared;
use super::deviation::{Node, WalkedPath};
use super::parallelism::Parallelism;
use super::point::Point;
use super::segment::{Kind, Segment, Start};
use super::solve::{Last, Solver, controller_motor};
use deflex_equilibrium::{Arm, Dragged, WarmStart};
use deflex_program::{Program, Role};
use deflex_robot::{Joints, Pose};
use nalgebra::Vector3;

/// An inserted target is at its point of the path when it moves by less than this, m.
const SETTLED: f64 = 1e-9;
/// Largest number of rounds. Force and deflection hardly change along the path, so that each round gains two digits or more.
const MOST_STEPS: usize = 8;

/// A target on the segment to a target of the original.
#[derive(Clone, Debug)]
pub(super) struct Inserted {
    /// Index among the targets of the corrected program, or among the stops of a correction.
    pub(super) target: usize,
    /// Index of the target of the original.
    pub(super) before: usize,
    /// Share of the segment.
    pub(super) share: f64,
    pub(super) role: Role,
}

/// Puts inserted targets on the path. `at` gives the point of each at its share of the segment. Each segment gets as many rounds as its own
/// targets need, so that a program gives the same figures in chunks as in one piece.
pub(super) fn place(
    inserted: &mut [Inserted],
    (prepared, segments): (&Prepared, &[Option<Segment<'_>>]),
    arm: &Arm,
    at: impl Fn(&Inserted) -> Point,
) {
    let mut open: Vec<&mut [Inserted]> = inserted.chunk_by_mut(|a, b| a.before == b.before).collect();
    for _ in 0..MOST_STEPS {
        let batch = prepared.with_points(open.iter().flat_map(|own| own.iter()).map(&at).collect());
        let solver = Solver::new(arm, &batch, Parallelism::Threads);
        let predicted = solver.forward(|k| batch.points[k].as_programmed(), |_| WarmStart::default());
        let mut landed = batch.points.iter().zip(&predicted).map(|(point, predicted)| {
            let shift = predicted.as_ref().ok()?.shift;
            Some(point.reference.translation.vector + shift)
        });
        open.retain_mut(|own| {
            let landed: Vec<_> = landed.by_ref().take(own.len()).collect();
            nearest(own, &landed, segments)
        });
        if open.is_empty() {
            break;
        }
    }
}

/// The same for targets whose points are known and do not follow from a law.
pub(super) fn settle(
    inserted: &mut [Inserted],
    (points, segments): (&mut Prepared, &[Option<Segment<'_>>]),
    arm: &Arm,
) {
    let referred = |points: &Prepared, inserted: &Inserted| {
        let point = points.points[inserted.target].clone();
        let segment = segments[inserted.before].as_ref();
        Point { reference: segment.map_or(point.reference, |segment| segment.track.pose(inserted.share)), ..point }
    };
    place(inserted, (points, segments), arm, |inserted| referred(points, inserted));
    for inserted in inserted {
        points.points[inserted.target] = referred(points, inserted);
    }
}

/// Moves the targets on one segment to the points of the path that are nearest to where the loaded tool has landed (m, work object axes;
/// `None` without an equilibrium), and keeps their order. Returns whether any has moved.
fn nearest(inserted: &mut [Inserted], landed: &[Option<Vector3<f64>>], segments: &[Option<Segment<'_>>]) -> bool {
    let (mut moved, mut least) = (false, 0.0);
    for (inserted, landed) in inserted.iter_mut().zip(landed) {
        let (Some(segment), Some(landed)) = (&segments[inserted.before], landed) else { continue };
        let share = segment.track.nearest(landed).max(least);
        moved |= (share - inserted.share).abs() * segment.track.length() > SETTLED;
        (inserted.share, least) = (share, share);
    }
    moved
}

/// The segments to targets from their starts.
pub(super) fn segments<'p>(
    program: &Program,
    prepared: &'p Prepared,
    starts: &'p [Option<Start>],
) -> Vec<Option<Segment<'p>>> {
    let into = |(i, start): (usize, &'p Option<Start>)| Segment::into(program, prepared, i, start.as_ref()?);
    starts.iter().enumerate().map(into).collect()
}

/// The intermediate commands on the segments to targets, in running order: the nodes of a correction, and the circle points of nodes that
/// end arcs.
pub(super) struct Stops {
    all: Vec<Stop>,
}

struct Stop {
    /// Index of the node.
    node: usize,
    /// Index of the target at the end of its segment.
    before: usize,
    pose: Pose,
    motor: Joints,
    twist: Joints,
    travel: Joints,
    role: Role,
}

impl Stops {
    /// The stops for nodes as written.
    pub(super) fn of(nodes: &[Node], prepared: &Prepared, arm: &Arm) -> Self {
        let mut all = Vec::with_capacity(nodes.len());
        for (k, node) in nodes.iter().enumerate() {
            let near = &prepared.points[node.before].motor;
            let setting = node.moved.as_ref().map_or(prepared.setting(node.before), |moved| &moved.setting);
            for (pose, role) in [(node.via, Role::Via), (Some(node.commanded), Role::End)] {
                let Some(pose) = pose else { continue };
                let motor = controller_motor(&arm.robot, setting, &pose, near).unwrap_or(*near);
                let twist = prepared.points[node.before].twist();
                all.push(Stop { node: k, before: node.before, pose, motor, twist, travel: Joints::zeros(), role });
            }
        }
        Self { all }
    }

    /// Directions of travel to the targets, which go to these motor angles, and to the stops on their segments. Without lost motion they
    /// have no effect, and stay those of the programmed motion.
    pub(super) fn travels(
        &mut self,
        arm: &Arm,
        program: &Program,
        prepared: &Prepared,
        motor: impl Fn(usize) -> Joints,
        last: &mut Last,
    ) -> Vec<Dragged> {
        let points = prepared.points.iter().enumerate();
        if !arm.follows_travel() {
            return points.map(|(i, point)| Dragged { motor: motor(i), ..point.step() }).collect();
        }
        let mut next = 0;
        let mut out = Vec::with_capacity(points.len());
        for (i, point) in points {
            // The circle point of an arc comes after the stops that are inserted before it.
            let end = if Kind::of(program, i) == Kind::Point { i + 1 } else { i };
            while let Some(stop) = self.all.get_mut(next).filter(|stop| stop.before <= end) {
                stop.travel = arm.go_on(stop.motor, stop.twist, last).travel;
                next += 1;
            }
            out.push(arm.go_on(motor(i), point.twist(), last));
        }
        out
    }

    /// The nodes at the points of the path where the loaded tool lands.
    pub(super) fn place(&self, walked: &WalkedPath<'_>, arm: &Arm) -> Vec<Node> {
        let (program, prepared, mut nodes) = (walked.program, walked.prepared, walked.commanded.nodes.clone());
        if nodes.is_empty() {
            return nodes;
        }
        let mut starts = vec![None; prepared.points.len()];
        for node in nodes.iter() {
            if starts[node.before].is_none() {
                starts[node.before] = walked.before(node.before).and_then(|from| walked.start(from));
            }
        }
        let segments = segments(program, prepared, &starts);
        let stop = |(target, stop): (usize, &Stop)| {
            let Node { before, share, .. } = nodes[stop.node];
            Inserted { target, before, share, role: stop.role }
        };
        let mut inserted: Vec<Inserted> = self.all.iter().enumerate().map(stop).collect();
        place(&mut inserted, (prepared, &segments), arm, |inserted| {
            let (stop, own) = (&self.all[inserted.target], &prepared.points[inserted.before]);
            let there =
                segments[inserted.before].as_ref().map_or_else(|| own.clone(), |segment| segment.at(inserted.share));
            let moved = nodes[stop.node].moved.clone();
            Point { wobj_from_tcp: stop.pose, motor: stop.motor, travel: stop.travel, moved, ..there }
        });
        for inserted in inserted.iter().filter(|inserted| inserted.role == Role::End) {
            nodes[self.all[inserted.target].node].share = inserted.share;
        }
        nodes
    }
}
