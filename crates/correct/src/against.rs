//! Judges a corrected program by its original: errors count from the targets and the path of the original.
//!
//! If the correction has inserted targets, those of the original are found among them ([`align`]). An inserted target is judged by the
//! point of the original's path that is nearest to the position of the loaded tool. Its error is a contour error, under the depth and
//! the force of the original's cut there.

use super::context::{Context, JudgedPath};
use super::deviation::{self, Commanded, Deviations, Node, PathDeviation, WalkedPath};
use super::inserted::{self, Inserted, segments};
use super::mount::Moved;
use super::parallelism::Parallelism;
use super::point::Point;
use super::segment::{self, Kind, Segment, Start, waypoint_targets};
use super::solve::Solver;
use super::{Options, Prepared, free_turn, path};
use deflex_cell::Cell;
use deflex_equilibrium::{Arm, EquilibriumError, PredictedPose, WarmStart};
use deflex_program::alignment::{Fit, align};
use deflex_program::{Program, Role};
use deflex_robot::{EXTERNAL_AXES, External, Pose};
use deflex_text::Diagnostic;
use nalgebra::Vector3;
use std::sync::Arc;

/// A command is off the path by its correction and at most this more, m: single precision, and the bend between two targets.
const SLACK: f64 = 0.5e-3;

/// External axes of inserted targets are interpolated to this (mm, degrees), because the correction moves targets along the path.
const EXTERNAL_SLACK: f64 = 1.0;

/// Number of pairs of targets that are solved at once, to bound the memory of dense programs.
const PAIRS: usize = 1 << 16;

const HELP: &str = "--against takes the program that this one was corrected from";

/// An original whose corrected program has inserted targets.
pub(super) struct Subdivided<'a> {
    original: &'a Program,
    prepared: Prepared,
    starts: Vec<Option<Start>>,
    /// Ends of the original's motions, and their indices in the corrected program.
    matched: Vec<(usize, usize)>,
    /// The other targets of the corrected program, in order.
    inserted: Vec<Inserted>,
}

/// The program from which errors count.
pub(super) enum Original<'a> {
    /// The program itself.
    Itself,
    /// A program with the same number of targets.
    Alike,
    /// A program with fewer targets.
    Subdivided(Box<Subdivided<'a>>),
}

impl Original<'_> {
    /// Moves the inserted targets to their points of the path again, after the loaded tool has cut the stock and the forces are known.
    pub(super) fn settle(&mut self, points: &mut Prepared, arm: &Arm) {
        if let Self::Subdivided(subdivided) = self {
            let segments = segments(subdivided.original, &subdivided.prepared, &subdivided.starts);
            inserted::settle(&mut subdivided.inserted, (points, &segments), arm);
        }
    }
}

/// The points of a corrected program, with the poses by which they are judged.
///
/// # Errors
/// As [`Prepared::new`]; targets that are neither the original's nor on its path.
pub(super) fn judged<'a>(
    context: Context<'_>,
    original: &'a Program,
) -> Result<(Prepared, Original<'a>), Vec<Diagnostic>> {
    let Context { program, cell, options, .. } = context;
    let mut prepared = path::prepare(context, &mut free_turn::carried(context)?)?;
    let mut before = Prepared::new(original, cell, options)?;
    prepared.notes.append(&mut before.notes);
    if program.targets.len() <= original.targets.len() {
        prepared.judge_against(&before, (program, cell))?;
        return Ok((prepared, Original::Alike));
    }
    segment::follow_arcs(original, &mut before);
    let subdivided = Subdivided::new((program, &mut prepared), (original, before), cell)?;
    Ok((prepared, Original::Subdivided(Box::new(subdivided))))
}

impl<'a> Subdivided<'a> {
    fn new(
        (program, points): (&Program, &mut Prepared),
        (original, prepared): (&'a Program, Prepared),
        cell: &Cell,
    ) -> Result<Self, Vec<Diagnostic>> {
        let starts = starts(original, &prepared);
        let segments = segments(original, &prepared, &starts);
        let fit = Places {
            arm: &cell.arm,
            corrected: (program, points),
            original: (original, &prepared),
            segments: &segments,
            most: cell.limits.max_correction + SLACK,
        };
        let matched = align(original, program, &fit).map_err(|i| vec![fits_nothing(program, i, fit.most)])?;
        let mut inserted = Vec::with_capacity(program.targets.len() - matched.len());
        let mut at = 0;
        let mut same = Vec::with_capacity(original.targets.len());
        for &(wanted, given) in &matched {
            // An arc that was not split keeps its circle point.
            if given == at + 1 && Kind::of(original, wanted) == Kind::Arc {
                same.push((wanted - 1, given - 1));
                at = given;
            }
            for target in at..given {
                let commanded = points.points[target].wobj_from_tcp.translation.vector;
                let share = segments[wanted].as_ref().map_or(1.0, |segment| segment.track.nearest(&commanded));
                inserted.push(Inserted { target, before: wanted, share, role: program.targets[target].role });
            }
            same.push((wanted, given));
            at = given + 1;
        }
        for (wanted, given) in same {
            points.judge_point(given, &prepared.points[wanted], (program, free_axes(cell)))?;
        }
        points.shared = Arc::clone(&prepared.shared);
        drop(segments);
        let mut subdivided = Self { original, prepared, starts, matched, inserted };
        subdivided.place(points, program, cell)?;
        Ok(subdivided)
    }

    /// For each motion of the corrected program, the motion of the original that it is a part of.
    pub(super) fn waypoints(&self, corrected: &Program) -> Vec<usize> {
        let originals = waypoint_targets(self.original);
        let waypoint = |target: usize| originals.binary_search(&target).unwrap_or(0);
        // The first motion of the original that ends at or after a target of the corrected program.
        let of = |target: usize| {
            let at = self.matched.partition_point(|(_, given)| *given < target);
            self.matched.get(at).map_or(originals.len().saturating_sub(1), |(wanted, _)| waypoint(*wanted))
        };
        waypoint_targets(corrected).into_iter().map(of).collect()
    }

    /// Puts the inserted targets on the path of the original.
    fn place(&mut self, points: &mut Prepared, program: &Program, cell: &Cell) -> Result<(), Vec<Diagnostic>> {
        let free = free_axes(cell);
        let segments = segments(self.original, &self.prepared, &self.starts);
        let at = |inserted: &Inserted, own: &Point| {
            let there = segments[inserted.before].as_ref().map(|segment| segment.at(inserted.share));
            let (wobj_from_tcp, motor, travel, moved) = (own.wobj_from_tcp, own.motor, own.travel, own.moved.clone());
            Point { wobj_from_tcp, motor, travel, moved, ..there.unwrap_or_else(|| own.clone()) }
        };
        let there = |inserted: &Inserted| at(inserted, &points.points[inserted.target]);
        inserted::place(&mut self.inserted, (points, &segments), &cell.arm, there);
        for inserted in &self.inserted {
            let Some(segment) = &segments[inserted.before] else { continue };
            let own = &points.points[inserted.target];
            let external = |moved: &Option<Arc<Moved>>| moved.as_ref().map(|moved| moved.external);
            let apart = match (external(&own.moved), external(&segment.moved(inserted.share))) {
                (None, None) => false,
                (Some(own), Some(interpolated)) => (0..EXTERNAL_AXES)
                    .any(|axis| !free[axis] && (own[axis] - interpolated[axis]).abs() > EXTERNAL_SLACK),
                _ => true,
            };
            if apart {
                return Err(vec![other_axes(program, inserted.target)]);
            }
            points.points[inserted.target] = at(inserted, own);
        }
        Ok(())
    }

    /// The deviation from the original's path on the segment to each target of the corrected program.
    pub(super) fn measure(
        &self,
        points: &Prepared,
        landed: &[Result<PredictedPose, EquilibriumError>],
        context: Context<'_>,
    ) -> Vec<Option<PathDeviation>> {
        let mut judged = self.prepared.with_points(self.prepared.points.clone());
        // The target of the corrected program for each target of the original.
        let mut given = vec![0; judged.points.len()];
        for &(wanted, end) in &self.matched {
            given[wanted] = end;
            judged.points[wanted] = points.points[end].clone();
            if Kind::of(self.original, wanted) == Kind::Arc {
                given[wanted - 1] = end - 1;
            }
            self.merge_forces((wanted, end), points, &mut judged.points[wanted]);
        }
        let ends: Vec<&Inserted> = self.inserted.iter().filter(|inserted| inserted.role != Role::Via).collect();
        let segments = segments(self.original, &self.prepared, &self.starts);
        let node = |inserted: &&Inserted| {
            let via = inserted.target.checked_sub(1).filter(|via| {
                let is_via = |other: &Inserted| other.target == *via && other.role == Role::Via;
                self.inserted.binary_search_by_key(via, |other| other.target).is_ok_and(|k| is_via(&self.inserted[k]))
            });
            let own = &points.points[inserted.target];
            Node {
                before: inserted.before,
                share: inserted.share,
                length: segments[inserted.before].as_ref().map_or(0.0, |segment| segment.track.length()),
                commanded: own.wobj_from_tcp,
                via: via.map(|via| points.points[via].wobj_from_tcp),
                moved: own.moved.clone(),
            }
        };
        let own = || given.iter().map(|end| &points.points[*end]);
        let commanded = Commanded {
            poses: own().map(|point| point.wobj_from_tcp).collect(),
            steps: own().map(Point::step).collect(),
            is_known: own().map(|point| point.unsolved.is_none()).collect(),
            landed: given.iter().map(|end| landed[*end].clone()).collect(),
            nodes: ends.iter().map(node).collect(),
        };
        let solver = Solver::new(&context.cell.arm, &judged, context.parallelism);
        let walked = WalkedPath { program: self.original, prepared: &judged, commanded: &commanded, last: None };
        let Deviations { targets, nodes } =
            deviation::measure(&walked, &solver, &|_| WarmStart::default(), JudgedPath::Written);
        let mut out = vec![None; points.points.len()];
        for &(wanted, end) in &self.matched {
            out[end] = targets[wanted];
        }
        for (inserted, deviation) in ends.iter().zip(nodes) {
            out[inserted.target] = deviation;
        }
        out
    }

    /// Joins the forces along the whole segment to a target of the original, if they follow from the stock.
    fn merge_forces(&self, (wanted, end): (usize, usize), points: &Prepared, judged: &mut Point) {
        let Some(milled) = &mut judged.milled else { return };
        let first = self.inserted.partition_point(|inserted| inserted.before < wanted);
        let own = self.inserted[first..].iter().take_while(|inserted| inserted.before == wanted);
        let ends = own.filter(|inserted| inserted.role != Role::Via).map(|inserted| (inserted.target, inserted.share));
        let (mut forces, mut from) = (Vec::new(), 0.0);
        for (target, to) in ends.chain([(end, 1.0)]) {
            let part = points.points[target].milled.iter().flat_map(|milled| milled.forces.iter());
            forces.extend(part.map(|(share, force)| (from + share * (to - from), *force)));
            from = to;
        }
        milled.forces = forces.into();
    }
}

/// The programmed start of the segment to each target; `None` if the segment is neither a line nor an arc.
fn starts(program: &Program, prepared: &Prepared) -> Vec<Option<Start>> {
    let mut commanded = Commanded::as_programmed(prepared, Vec::new());
    commanded.poses = prepared.points.iter().map(|point| point.reference).collect();
    let walked = WalkedPath { program, prepared, commanded: &commanded, last: None };
    let start = |i: usize| {
        let is_path = matches!(Kind::of(program, i), Kind::Line | Kind::Arc) && prepared.points[i].unsolved.is_none();
        if is_path { walked.start(walked.before(i)?) } else { None }
    };
    (0..prepared.points.len()).map(start).collect()
}

/// Costs for matching corrected targets with points of the original's path.
struct Places<'a> {
    arm: &'a Arm,
    corrected: (&'a Program, &'a Prepared),
    original: (&'a Program, &'a Prepared),
    segments: &'a [Option<Segment<'a>>],
    /// Largest distance of a command from the path, m.
    most: f64,
}

impl Places<'_> {
    fn commanded(&self, corrected: usize) -> &Pose {
        &self.corrected.1.points[corrected].wobj_from_tcp
    }

    /// Whether the numbers are unchanged.
    fn is_unchanged(&self, corrected: usize, original: usize) -> bool {
        self.corrected.0.targets[corrected].goal == self.original.0.targets[original].goal
    }
}

impl Fit for Places<'_> {
    fn is_same(&self, corrected: usize, original: usize) -> bool {
        let (given, wanted) = (&self.corrected.1.points[corrected], &self.original.1.points[original]);
        if given.unsolved.is_some() || wanted.unsolved.is_some() {
            return self.is_unchanged(corrected, original);
        }
        let shift = given.wobj_from_tcp.translation.vector - wanted.reference.translation.vector;
        shift.norm() <= self.most
    }

    fn is_on_way(&self, corrected: usize, original: usize) -> bool {
        let Some(segment) = &self.segments[original] else { return false };
        if self.corrected.1.points[corrected].unsolved.is_some() {
            return false;
        }
        let place: Vector3<f64> = self.commanded(corrected).translation.vector;
        let on_path = segment.track.pose(segment.track.nearest(&place)).translation.vector;
        (place - on_path).norm() <= self.most
    }

    /// Costs by the position of the loaded tool. Unchanged numbers belong to their own target at any distance.
    fn costs(&self, pairs: &[(usize, usize)]) -> Vec<f64> {
        let mut out = Vec::with_capacity(pairs.len());
        for pairs in pairs.chunks(PAIRS) {
            let point = |&(corrected, original): &(usize, usize)| {
                let (given, wanted) = (&self.corrected.1.points[corrected], &self.original.1.points[original]);
                let (wobj_from_tcp, motor, travel) = (given.wobj_from_tcp, given.motor, given.travel);
                Point { wobj_from_tcp, motor, travel, ..wanted.clone() }
            };
            let batch = self.original.1.with_points(pairs.iter().map(point).collect());
            let solver = Solver::new(self.arm, &batch, Parallelism::Threads);
            let predicted = solver.forward(|k| batch.points[k].as_programmed(), |_| WarmStart::default());
            let cost =
                |(&(corrected, original), predicted): (&(usize, usize), Result<PredictedPose, _>)| match predicted {
                    _ if self.is_unchanged(corrected, original) => 0.0,
                    Ok(predicted) => predicted.shift.norm_squared(),
                    Err(_) => self.most * self.most,
                };
            out.extend(pairs.iter().zip(predicted).map(cost));
        }
        out
    }
}

/// The error for a target of the corrected program that matches no point of the original.
fn fits_nothing(program: &Program, i: usize, most: f64) -> Diagnostic {
    let target = &program.targets[i];
    let message = format!(
        "in the order of the program, target {} is neither at a target of the original nor on its path, within {:.1} mm",
        target.ordinal,
        1e3 * most
    );
    program.error_at(target, "against.path", message).help(HELP)
}

/// External axes whose positions may be chosen.
fn free_axes(cell: &Cell) -> [bool; EXTERNAL_AXES] {
    std::array::from_fn(|axis| cell.units.all().iter().any(|unit| unit.free && unit.axis == axis))
}

fn other_axes(program: &Program, i: usize) -> Diagnostic {
    let target = &program.targets[i];
    let message = format!("target {}: its external axes have other positions in the original", target.ordinal);
    program.error_at(target, "against.external", message).help(HELP)
}

/// The error for an original that has more targets than the program.
pub(super) fn other_count(name: &str, targets: usize, original: usize) -> Diagnostic {
    let message = format!("{targets} targets, but the original has {original}");
    Diagnostic::error("against.count", name, message).help(HELP)
}

impl Prepared {
    /// As [`Prepared::new`], with errors counted from the original of this program.
    ///
    /// # Errors
    /// As [`Prepared::new`], of both programs; targets that are neither the original's nor on its path.
    #[doc(hidden)]
    pub fn judged_by(
        original: &Program,
        program: &Program,
        cell: &Cell,
        options: &Options,
    ) -> Result<Self, Vec<Diagnostic>> {
        judged(Context::whole(program, cell, options), original).map(|(prepared, _)| prepared)
    }

    /// Counts errors from the targets of `original`, one for each point: they define depth, force and the wanted poses.
    pub(super) fn judge_against(
        &mut self,
        original: &Self,
        (program, cell): (&Program, &Cell),
    ) -> Result<(), Vec<Diagnostic>> {
        let free = free_axes(cell);
        if original.points.len() != self.points.len() {
            let name = program.sources.first().map_or("", |s| s.name.as_str());
            return Err(vec![other_count(name, self.points.len(), original.points.len())]);
        }
        for (i, point) in original.points.iter().enumerate() {
            self.judge_point(i, point, (program, free))?;
        }
        self.shared = Arc::clone(&original.shared);
        Ok(())
    }

    /// `free`: external axes whose positions may differ.
    fn judge_point(
        &mut self,
        i: usize,
        original: &Point,
        (program, free): (&Program, [bool; EXTERNAL_AXES]),
    ) -> Result<(), Vec<Diagnostic>> {
        let point = &mut self.points[i];
        let external = |point: &Point| point.moved.as_ref().map(|moved| moved.external);
        let (own, before) = (external(point), external(original));
        let is_same = |axis: usize| {
            let at = |external: &Option<External>| external.map(|external| external[axis].to_bits());
            at(&own) == at(&before) || free[axis]
        };
        if own.is_some() != before.is_some() || !(0..EXTERNAL_AXES).all(is_same) {
            return Err(vec![other_axes(program, i)]);
        }
        // Poses in the part are comparable at any position of the units.
        let (wobj_from_tcp, motor, travel, moved) =
            (point.wobj_from_tcp, point.motor, point.travel, point.moved.take());
        *point = Point { wobj_from_tcp, motor, travel, moved, ..original.clone() };
        Ok(())
    }

    /// Distance of each target from the pose by which it is judged, mm.
    pub(super) fn moved_mm(&self) -> Vec<f64> {
        let moved = |point: &Point| point.wobj_from_tcp.translation.vector - point.reference.translation.vector;
        self.points.iter().map(|point| 1e3 * moved(point).norm()).collect()
    }
}
