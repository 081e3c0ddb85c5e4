//! The stage that corrects: the command whose loaded TCP lands on each programmed target, as it will be written.

use super::context::Context;
use super::corrected::Posted;
use super::deviation::{self, Commanded};
use super::flow::{StreamError, Unsolved};
use super::inserted::Stops;
use super::laws::Laws;
use super::load::PointLoad;
use super::ordered::{Ordered, Turn};
use super::point::Point;
use super::segment::Start;
use super::solve::{self, CorrectionMode, First, Last, Reached, Solved, Solver};
use super::{KeptReason, Prepared, frames, segment, subdivide};
use deflex_equilibrium::{Dragged, EquilibriumError, InverseSolution, WarmStart};
use deflex_program::{
    Change, Conf, Editable, Goal, Insert, Motion, Program, Reason, RewriteOptions, Rewritten, Target,
};
use deflex_robot::{
    AxisName, EXTERNAL_AXES, External, Joints, Unreachable, conf_is, conf_like, confdata_of, turn_between,
};
use deflex_text::Diagnostic;
use nalgebra::Vector3;
use std::borrow::Cow;
use std::collections::BTreeMap;

/// Corrections up to this size do not count as a change: rounding of f64.
const NO_CHANGE_M: f64 = 1e-12;
const NO_CHANGE_RAD: f64 = 1e-11;
/// Turns below this are the rounding of a quaternion's components to single precision, rad.
const WRITTEN_RAD: f64 = 1e-6;

/// Commands as they are written, target by target.
pub(super) struct Correction {
    pub(super) modes: Vec<CorrectionMode>,
    /// The results for each target before its direction of travel is settled, and where it ends up without a correction.
    pub(super) first: Vec<First>,
    pub(super) solved: Vec<Result<Solved, EquilibriumError>>,
    /// Positions (mm) and orientations in the controller's precision.
    written: Vec<([f64; 3], [f64; 4])>,
    /// Whether the commanded numbers differ from the program's.
    pub(super) is_commanded: Vec<bool>,
    /// Whether the controller goes to another pose than before.
    pub(super) is_changed: Vec<bool>,
    /// The pose that it reaches for them.
    pub(super) reached: Vec<Result<Reached, EquilibriumError>>,
    pub(super) inserts: Vec<Insert>,
    /// The edits of a program that is edited.
    pub(super) rewritten: Option<Rewritten>,
}

/// The values that the stage carries from chunk to chunk of a program.
pub(super) struct Carried {
    /// The last command of the corrected motion before rounding, which decides the directions of travel.
    settled: Ordered<Last>,
    /// The start of the segment to the next chunk, before rounding.
    unwritten_end: Ordered<Option<Start>>,
    /// The last command of the motion as written.
    travelled: Ordered<Last>,
}

impl Carried {
    /// The state before the first chunk.
    pub(super) fn new() -> Self {
        Self { settled: Ordered::new(None), unwritten_end: Ordered::new(None), travelled: Ordered::new(None) }
    }
}

/// Finds the commands, and where the loaded arm is then.
///
/// # Errors
/// Chosen positions of external axes cannot be written; the run stops.
pub(super) fn solve(
    context: Context<'_>,
    turn: &Turn<'_>,
    carried: &Carried,
    prepared: &mut Prepared,
) -> Result<(Commanded, Stops, Correction), Unsolved> {
    let Context { program, cell, options, parallelism, .. } = context;
    let arm = &cell.arm;
    if options.subdivide.is_some() {
        segment::follow_arcs(program, prepared);
    }
    let mode = |(target, point): (&Target, &Point)| match point.unsolved {
        Some(_) => CorrectionMode::Keep,
        None => CorrectionMode::of(target.editable, options.correct),
    };
    let modes: Vec<CorrectionMode> = program.targets.iter().zip(&prepared.points).map(mode).collect();
    let solver = Solver::new(arm, prepared, parallelism);
    let first = solver.first(&modes);
    let travels = turn.take(&carried.settled, |last| solve::settle_travel(arm, prepared, &first, last))?;
    let mut solved = solver.commands(&modes, &first, &travels);
    let (mut nodes, mut vias) = (Vec::new(), Vec::new());
    if let Some(tolerance) = options.subdivide {
        let commanded = Commanded::as_solved(prepared, &solved, &travels);
        let before =
            turn.take(&carried.unwritten_end, |last| deviation::pass_end(program, prepared, &commanded, last))?;
        let found = subdivide::subdivide(program, &solver, &commanded, &modes, before.as_ref(), tolerance);
        (nodes, vias) = (found.nodes, found.vias);
    }
    drop(solver);
    let bound = if vias.is_empty() { Vec::new() } else { program.bound_to_point() };
    let mut not_inserted: Vec<(usize, Reason)> = Vec::new();
    let mut before = Vec::with_capacity(vias.len());
    for (via, point, command) in vias {
        // The circle point of the last part is another point of the arc.
        if bound.binary_search(&via).is_ok() {
            nodes.retain(|node| node.before != via + 1);
            not_inserted.push((via + 1, Reason::DeclarationUsedElsewhere));
            continue;
        }
        let turned_by_arc = prepared.points[via].turned_by_arc;
        let point = std::mem::replace(&mut prepared.points[via], Point { turned_by_arc, ..point });
        before.push((via, point, std::mem::replace(&mut solved[via], Ok(command))));
    }
    let is_edited = program.language.is_edited();
    // Which targets may go along with the numbers of others.
    let is_air = |(target, point): (&Target, &Point)| {
        let touches = point.milled.as_ref().is_some_and(|milled| milled.removed > 0.0);
        // A motion to an unknown end may meet the stock.
        let stays_out = !target.located && cell.stock.is_none() && !Laws::lacks_speed(cell, target);
        let is_known = point.unsolved.is_none() || stays_out;
        // A motion to where the tool stands already, such as the start of a contour after the approach to it, has no feed direction.
        let is_still = matches!(point.load, PointLoad::Air) && point.velocity == Vector3::zeros();
        let stands = is_still && point.unsolved.is_none();
        (stands || !Laws::cuts(cell, target)) && is_known && !touches && !prepared.turns_are_chosen
    };
    let mut air: Vec<bool> = match is_edited {
        true => program.targets.iter().zip(&prepared.points).map(is_air).collect(),
        false => Vec::new(),
    };
    // Targets whose numbers stay, because a motion elsewhere may not go along with them.
    let mut stays = vec![false; program.targets.len()];
    let elsewhere = program.joints_elsewhere();
    // Why targets are kept because of them, and what was kept when the last of them was found.
    let mut because: BTreeMap<usize, Reason> = BTreeMap::new();
    let mut found: Option<(Reason, Vec<(usize, Reason)>)> = None;
    let (changes, inserts, mut rewritten) = loop {
        let inserts = subdivide::inserts(program, cell, prepared, &nodes);
        let changed = |(i, solved): (usize, &Result<Solved, _>)| {
            change(context, prepared, i, solved.as_ref().ok().filter(|_| modes[i] != CorrectionMode::Keep)?, modes[i])
        };
        let changes: Vec<Option<Change>> = solved.iter().enumerate().map(changed).collect();
        let rewritten = is_edited.then(|| {
            let allow_clones = options.allow_clones;
            let rewrite = RewriteOptions { allow_clones, air: &air, stays: &stays, ..RewriteOptions::default() };
            let mut rewritten = program.rewrite(&changes, &inserts, &rewrite);
            // The rows of motions to unknown ends have no numbers.
            rewritten.along.retain(|i| program.targets[*i].located);
            rewritten
        });
        if let Some(rewritten) = &rewritten {
            let new = |i: usize| NewGoal {
                written: &rewritten.written[i],
                conf: rewritten.confs.binary_search_by_key(&i, |(of, _)| *of).ok().map(|at| rewritten.confs[at].1),
            };
            if let Some((why, before)) = found.take() {
                let is_new = |i: &usize| before.binary_search_by_key(i, |(kept, _)| *kept).is_err();
                because.extend(rewritten.kept.iter().map(|(i, _)| *i).filter(is_new).map(|i| (i, why)));
            }
            let along = |&i: &usize| Some((i, may_go(context, prepared, i, &new(i)).err()?));
            let strays: Vec<(usize, Reason)> = rewritten.along.iter().filter_map(along).collect();
            let along = |&i: &usize| Some((i, joint_may_go(context, prepared, i, &new(i)).err()?));
            let held: Vec<(usize, Reason)> = elsewhere.iter().filter(|i| !stays[**i]).filter_map(along).collect();
            if let Some((_, why)) = strays.first().or(held.first()).copied() {
                // The numbers of a program in chunks are settled already.
                if context.chunk.is_some() {
                    return Err(Unsolved::Failed(StreamError::NotStreamable));
                }
                // One reason after the other, so that it is known what each of them keeps.
                strays.iter().filter(|(_, other)| *other == why).for_each(|(i, _)| air[*i] = false);
                held.iter().filter(|(_, other)| *other == why).for_each(|(i, _)| stays[*i] = true);
                found = Some((why, rewritten.kept.clone()));
                continue;
            }
        }
        // An arc of which a point cannot be written is not divided: its circle point stays at its place on the whole arc.
        let is_whole = |via: usize| rewritten.as_ref().is_some_and(|rewritten| rewritten.misses_part_of_arc(via));
        let (whole, divided) = before.into_iter().partition(|(via, ..)| is_whole(*via));
        before = divided;
        if whole.is_empty() {
            break (changes, inserts, rewritten);
        }
        for (via, point, command) in whole {
            let refused = rewritten.iter().flat_map(|rewritten| &rewritten.not_inserted);
            not_inserted.extend(refused.filter(|(i, _)| *i == via + 1));
            nodes.retain(|node| node.before != via + 1);
            (prepared.points[via], solved[via]) = (point, command);
        }
    };
    if let Some(rewritten) = &mut rewritten {
        rewritten.kept.iter_mut().for_each(|(i, why)| *why = because.get(i).copied().unwrap_or(*why));
        rewritten.not_inserted.extend(not_inserted);
        rewritten.not_inserted.sort_unstable();
    }
    let prepared = &*prepared;
    if let Some(refused) = rewritten.as_ref().and_then(|rewritten| axes_left(program, &changes, rewritten)) {
        return Err(Unsolved::Refused(vec![refused]));
    }
    let written = match &mut rewritten {
        Some(rewritten) => std::mem::take(&mut rewritten.written),
        None => parallelism.map(solved.len(), |i| {
            let pose = solved[i].as_ref().map_or(prepared.points[i].wobj_from_tcp, |solved| solved.wobj_from_tcp);
            solve::as_posted(&pose, options.post)
        }),
    };
    let nodes = subdivide::as_written(nodes, |k| match &rewritten {
        Some(rewritten) => rewritten.inserted[k],
        None => Some(solve::as_posted(&frames::pose(inserts[k].position_mm, inserts[k].quat), options.post)),
    });
    let mut is_commanded: Vec<bool> = changes.iter().map(|change| change.is_some() || !is_edited).collect();
    rewritten.iter().flat_map(|rewritten| &rewritten.along).for_each(|i| is_commanded[*i] = true);
    let is_changed = |i: usize| is_commanded[i] || turns_along(program, i, &written[i]);
    let is_changed: Vec<bool> = (0..written.len()).map(is_changed).collect();

    // The poses to which the controller will go. The text of a circle point may have another orientation than the arc there.
    let mut held_poses = Cow::from(&written);
    for (i, solved) in solved.iter().enumerate().filter(|(i, _)| prepared.points[*i].turned_by_arc) {
        if let Ok(solved) = solved {
            held_poses.to_mut()[i].1 = frames::millimetres(&solved.wobj_from_tcp).1;
        }
    }
    // The forward model on the numbers that the controller will have.
    let solver = Solver::new(arm, prepared, parallelism);
    let reached = solver.reached(&held_poses, (&modes, &first), &solved, &is_changed);
    let mut stops = Stops::of(&nodes, prepared, arm);
    let motor = |i: usize| held(prepared, i, &solved[i], &reached[i]);
    let steps = turn.take(&carried.travelled, |last| stops.travels(arm, program, prepared, motor, last))?;
    let landed = solver.forward(
        |i| (&steps[i].motor, &steps[i].travel),
        |i| {
            let (Ok(aim), Ok(solved), Ok(uncorrected)) = (first[i].aim(), &solved[i], &first[i].uncorrected) else {
                return WarmStart::default();
            };
            // The rounding of the command by printing.
            let rounded = Vector3::from(written[i].0) * 1e-3 - solved.wobj_from_tcp.translation.vector;
            aim.corrected(prepared.points[i].normal.dot(&rounded), uncorrected)
        },
    );
    let commanded = Commanded {
        // Joint targets have no numbers of a pose.
        poses: (0..written.len())
            .map(|i| match program.targets[i].goal {
                Goal::Joints { .. } => prepared.points[i].wobj_from_tcp,
                Goal::Pose { .. } | Goal::Axis { .. } => frames::pose(held_poses[i].0, held_poses[i].1),
            })
            .collect(),
        is_known: (0..reached.len()).map(|i| reached[i].is_ok() && prepared.points[i].unsolved.is_none()).collect(),
        steps,
        landed,
        nodes,
    };
    let correction =
        Correction { modes, first, solved, written, is_commanded, is_changed, reached, inserts, rewritten };
    Ok((commanded, stops, correction))
}

/// The motor angles to which the controller goes at target `i`, with or without a solution.
fn held(
    prepared: &Prepared,
    i: usize,
    solved: &Result<Solved, EquilibriumError>,
    reached: &Result<Reached, EquilibriumError>,
) -> Joints {
    match (reached, solved) {
        (Ok(reached), _) => reached.motor,
        (Err(_), Ok(solved)) => solved.motor,
        (Err(_), Err(_)) => prepared.points[i].motor,
    }
}

impl Correction {
    /// Position of a target as it will be written, work object, mm.
    pub(super) fn written_mm(&self, i: usize) -> Vector3<f64> {
        self.written[i].0.into()
    }

    /// Approximate deflection of the joints under the load of target `i`.
    pub(super) fn nearby(&self, i: usize) -> WarmStart {
        self.first[i].aim().map_or_else(|_| WarmStart::default(), InverseSolution::nearby)
    }

    /// Number of inserted motions among those that are posted.
    pub(super) fn inserted(&self, posted: &[Posted]) -> usize {
        match &self.rewritten {
            Some(rewritten) => rewritten.inserted.iter().flatten().count(),
            None => posted.len() - self.written.len(),
        }
    }

    /// The edits, with the numbers in the controller's precision.
    pub(super) fn into_rewritten(self) -> Option<Rewritten> {
        Some(Rewritten { written: self.written, ..self.rewritten? })
    }

    /// The first reason why target `i` has no solution.
    pub(super) fn error(&self, context: Context<'_>, i: usize) -> Option<EquilibriumError> {
        let solved = match &self.solved[i] {
            Ok(_) if self.modes[i] == CorrectionMode::Keep => None,
            Ok(solved) => {
                context.cell.arm.robot.limit_violation(&solved.motor).map(|past| Unreachable::from(past).into())
            }
            Err(error) => Some(error.clone()),
        };
        solved.or_else(|| self.reached[i].as_ref().err().or(self.first[i].uncorrected.as_ref().err()).cloned())
    }

    /// Why the numbers of target `i` must not or could not be changed.
    pub(super) fn kept(&self, program: &Program, i: usize) -> Option<KeptReason> {
        let kept = self.rewritten.as_ref().map_or(&[][..], |rewritten| &rewritten.kept);
        if self.goes_along(i) {
            return None;
        }
        let unwritten = kept.binary_search_by_key(&i, |(target, _)| *target).ok().map(|at| kept[at].1);
        let reason = unwritten.or(match program.targets[i].editable {
            Editable::No(reason) => Some(reason),
            _ => None,
        });
        reason.map(KeptReason::from)
    }

    /// Whether target `i` cuts nothing and goes along with the numbers that it shares with a motion that cuts.
    pub(super) fn goes_along(&self, i: usize) -> bool {
        self.rewritten.as_ref().is_some_and(|rewritten| rewritten.along.binary_search(&i).is_ok())
    }

    /// Commanded minus programmed position of target `i`, work object axes, m.
    pub(super) fn shift(&self, prepared: &Prepared, i: usize) -> Vector3<f64> {
        Vector3::from(self.written[i].0) * 1e-3 - prepared.points[i].wobj_from_tcp.translation.vector
    }

    /// Targets and the points inserted before them, in the order of the posted program; empty for a program that is edited.
    pub(super) fn posted(&self, context: Context<'_>, prepared: &Prepared, steps: &[Dragged]) -> Vec<Posted> {
        let Context { program, cell, options, .. } = context;
        if program.language.is_edited() {
            return Vec::new();
        }
        let robot = &cell.arm.robot;
        // The chosen positions, if the cell leaves them free.
        let are_chosen = prepared.turns_are_chosen && cell.units.all().iter().any(|unit| unit.free);
        let chosen = |external: Option<&External>| {
            let external = external.filter(|_| are_chosen)?;
            Some(Box::new(external.map(|position| (!position.is_nan()).then_some(position))))
        };
        let post = |target, (position_mm, quat), motor: &Joints, external| Posted {
            target,
            external,
            position_mm,
            quat,
            conf: confdata_of(robot, motor),
            motor_deg: robot.axes_deg_from_motor(motor),
        };
        let mut out = Vec::with_capacity(self.written.len() + self.inserts.len());
        let mut inserts = self.inserts.iter().peekable();
        for i in 0..prepared.points.len() {
            while let Some(insert) = inserts.next_if(|insert| insert.before == i) {
                let pose = frames::pose(insert.position_mm, insert.quat);
                let printed = solve::as_posted(&pose, options.post);
                // Its correction was solved: a point out of reach would not be here.
                let at = insert.external.map(|external| external.map(|position| position.unwrap_or(f64::NAN)));
                let moved = at.and_then(|external| prepared.mount(i).moved(external));
                let setting = moved.as_ref().map_or_else(|| prepared.setting(i), |moved| &moved.setting);
                if let Ok(motor) = solve::controller_joints(&cell.arm, setting, &printed, &steps[i].motor) {
                    out.push(post(i, printed, &motor, chosen(at.as_ref())));
                }
            }
            out.push(post(i, self.written[i], &steps[i].motor, chosen(prepared.external(i))));
        }
        out
    }
}

/// A target whose external axes were chosen, but could not be written.
fn axes_left(program: &Program, changes: &[Option<Change>], rewritten: &Rewritten) -> Option<Diagnostic> {
    let is_chosen = |i: &usize| changes[*i].as_ref().is_some_and(|change| change.external.is_some());
    let (i, why) = rewritten.kept.iter().find(|(i, _)| is_chosen(i))?;
    let target = &program.targets[*i];
    let message =
        format!("target {}: the chosen position of its external axes cannot be written: {why}", target.ordinal);
    let help = "give the target numbers of its own, or leave `free` out of the cell's [[unit]]";
    Some(program.error_at(target, "spin.unit", message).help(help))
}

/// The change of target `i`; `None` if nothing changes.
fn change(
    Context { program, cell, .. }: Context<'_>,
    prepared: &Prepared,
    i: usize,
    solved: &Solved,
    mode: CorrectionMode,
) -> Option<Change> {
    let (target, point) = (&program.targets[i], &prepared.points[i]);
    let as_written = match target.goal {
        Goal::Pose { position_mm, quat, .. } if prepared.turns_are_chosen => Some(frames::pose(position_mm, quat)),
        _ => None,
    };
    let (from, to) = (as_written.as_ref().unwrap_or(&point.wobj_from_tcp), &solved.wobj_from_tcp);
    let shifted = (to.translation.vector - from.translation.vector).norm_squared() >= NO_CHANGE_M * NO_CHANGE_M;
    // Twice the angle's square.
    let turns = mode == CorrectionMode::Pose && !point.turned_by_arc;
    let turned =
        turns && (to.rotation.matrix() - from.rotation.matrix()).norm_squared() >= 2.0 * NO_CHANGE_RAD * NO_CHANGE_RAD;
    let external = chosen_axes(target, prepared, i);
    if !(shifted || turned || external.is_some()) {
        return None;
    }
    let (position_mm, quat) = frames::millimetres(&solved.wobj_from_tcp);
    let robot = &cell.arm.robot;
    // The configuration is updated only if it is that of the arm: some post-processors write a placeholder.
    // Joint motions of KRL go by S and T, even if they are not those of the arm, which is reported.
    let goes_by = |written: &Conf| matches!(written, Conf::Status(_));
    let holds =
        |written: &Conf| prepared.turns_are_chosen || goes_by(written) || conf_is(robot, &point.motor, *written);
    let was = target.conf().filter(holds);
    let conf = was.filter(|was| !conf_is(robot, &solved.motor, *was)).map(|was| conf_like(robot, &solved.motor, was));
    Some(Change { position_mm, quat: turned.then_some(quat), conf, external })
}

/// Where the text of a target leads after the rewriting.
struct NewGoal<'a> {
    written: &'a ([f64; 3], [f64; 4]),
    /// The configuration, if the text has another one.
    conf: Option<Conf>,
}

/// Why a target that cuts nothing may not go to this pose, where the numbers that it shares lead it. It may if it is in reach and no farther
/// away than a correction may be, and a joint motion arrives in the posture that it has, which is the one that its new text states.
fn may_go(
    Context { program, cell, .. }: Context<'_>,
    prepared: &Prepared,
    i: usize,
    NewGoal { written, conf: new }: &NewGoal<'_>,
) -> Result<(), Reason> {
    let (target, point, robot) = (&program.targets[i], &prepared.points[i], &cell.arm.robot);
    let motor = solve::controller_joints(&cell.arm, prepared.setting(i), written, &point.motor)
        .map_err(|_| Reason::AlongOutOfReach)?;
    let goes_by = |conf: &Conf| matches!(conf, Conf::Status(_)) || conf_is(robot, &point.motor, *conf);
    let conf = target.conf().filter(|conf| target.motion == Motion::Joint && goes_by(conf));
    if moved_by(point, written) > cell.limits.max_correction {
        Err(Reason::AlongTooFar)
    } else if conf.is_some_and(|conf| !conf_is(robot, &motor, new.unwrap_or(conf))) {
        Err(Reason::AlongOtherPosture)
    } else {
        Ok(())
    }
}

/// Distance of a written target from its point, m.
fn moved_by(point: &Point, written: &([f64; 3], [f64; 4])) -> f64 {
    (Vector3::from(written.0) * 1e-3 - point.wobj_from_tcp.translation.vector).norm()
}

/// The same for a joint motion to the robtarget of target `i` that is no target itself: where it comes from is not known.
fn joint_may_go(
    Context { program, cell, .. }: Context<'_>,
    prepared: &Prepared,
    i: usize,
    NewGoal { written, conf: new }: &NewGoal<'_>,
) -> Result<(), Reason> {
    let (target, point, robot) = (&program.targets[i], &prepared.points[i], &cell.arm.robot);
    // Which stock it meets is not known either.
    if !target.located || cell.stock.is_some() || prepared.turns_are_chosen {
        return Err(Reason::DeclarationUsedElsewhere);
    }
    let (Some(conf), setting) = (target.conf(), prepared.setting(i)) else { return Ok(()) };
    let base_from_flange = setting.base_from_flange(&point.wobj_from_tcp);
    let from = robot
        .inverse_conf(&base_from_flange, Some(conf), &point.motor)
        .map_err(|_| Reason::DeclarationUsedElsewhere)?;
    let to = solve::controller_joints(&cell.arm, setting, written, &from).map_err(|_| Reason::AlongOutOfReach)?;
    if moved_by(point, written) > cell.limits.max_correction {
        Err(Reason::AlongTooFar)
    } else if conf_is(robot, &from, conf) && !conf_is(robot, &to, new.unwrap_or(conf)) {
        Err(Reason::AlongOtherPosture)
    } else {
        Ok(())
    }
}

/// Positions of external axes as written, if they were chosen and differ from the program's.
fn chosen_axes(target: &Target, prepared: &Prepared, i: usize) -> Option<Box<[Option<f64>; EXTERNAL_AXES]>> {
    let (axes, chosen) = (target.external.as_ref()?, prepared.external(i).filter(|_| prepared.turns_are_chosen)?);
    #[allow(clippy::float_cmp)] // the very number stays
    let differs = |axis: usize| {
        let written = axes.position(AxisName::External(axis))?;
        (!chosen[axis].is_nan() && chosen[axis] != written).then(|| chosen[axis] - axes.offset[axis])
    };
    let wanted: [Option<f64>; EXTERNAL_AXES] = std::array::from_fn(differs);
    wanted.iter().any(Option::is_some).then(|| Box::new(wanted))
}

/// Whether a target of which only the position is edited turns because the pose from which it is computed is corrected.
fn turns_along(program: &Program, i: usize, written: &([f64; 3], [f64; 4])) -> bool {
    let target = &program.targets[i];
    match target.goal {
        Goal::Pose { position_mm, quat, .. } if target.editable == Editable::Position => {
            let [was, is] = [quat, written.1].map(|quat| frames::pose(position_mm, quat).rotation);
            turn_between(&was, &is).norm() > WRITTEN_RAD
        }
        _ => false,
    }
}
