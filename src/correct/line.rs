//! The line from targets to rows: compensate and predict.

use super::against::{self, Subdivided};
use super::collected::{Collected, check_limits};
use super::contradictions::contradictions;
use super::corrected::{Corrected, Posted};
use super::deviation::{Commanded, WalkedPath};
use super::inserted::Stops;
use super::laws::Laws;
use super::messages::Repeated;
use super::ordered::OrderedStage;
use super::parallelism::Parallelism;
use super::path;
use super::point::Point;
use super::row::Status;
use super::segment::Start;
use super::solve::{self, CorrectionMode, Last, Reached, Solved, Solver};
use super::{
    ChosenTurns, Cuts, Options, Prepared, along, carried, deviation, frames, free_turn, mount, removal, segment, sigma,
    stance, stiffness, subdivide,
};
use crate::cell::Cell;
use crate::equilibrium::{Dragged, EquilibriumError, InverseSolution, WarmStart};
use crate::program::post::Place;
use crate::program::{
    Change, Conf, Editable, Goal, Insert, Language, Mark, Program, RewriteOptions, Rewritten, Target,
};
use crate::robot::{AxisName, EXTERNAL_AXES, External, Joints, conf_is, conf_like, confdata_of, turn_between};
use crate::text::{Diagnostic, Severity};
use nalgebra::Vector3;

/// Corrections up to this size do not count as a change: rounding of f64.
const NO_CHANGE_M: f64 = 1e-12;
const NO_CHANGE_RAD: f64 = 1e-11;
/// What holding a quaternion's components in single precision turns by itself stays below this, rad.
const WRITTEN_RAD: f64 = 1e-6;

/// Predicts what the cell would make of a program, without correcting it.
///
/// `against`, the original of a corrected program, is what errors are counted from; it defines depth and force too.
///
/// # Errors
/// What [`Prepared::new`] refuses; an original with other targets than these: some may have been inserted on its path.
pub fn predict(
    program: &Program,
    cell: &Cell,
    options: &Options,
    against: Option<&Program>,
) -> Result<Corrected, Vec<Diagnostic>> {
    let (mut prepared, mut subdivided) = match against {
        Some(original) => against::judged(program, original, cell, options)?,
        None => (Prepared::new(program, cell, options)?, None),
    };
    if removal::run(program, (cell, options), &mut prepared, Cuts::Deflected)?.is_some()
        && let Some(subdivided) = &mut subdivided
    {
        subdivided.settle(&mut prepared, &cell.arm);
    }
    let prepared = WithOriginal { prepared: &prepared, subdivided: subdivided.as_ref(), is_judged: against.is_some() };
    let ends = OrderedStage::new(None);
    // Nobody else has a chunk that could break off.
    let predicted = warm_start(program, cell, options, (prepared, &ends), 0, Parallelism::Threads);
    Ok(predicted.unwrap_or_default().with_repeated())
}

/// A program, or a chunk of it, and what it is judged by.
#[derive(Clone, Copy)]
pub(super) struct WithOriginal<'a> {
    pub(super) prepared: &'a Prepared,
    /// The original, where it has fewer targets.
    pub(super) subdivided: Option<&'a Subdivided<'a>>,
    /// Whether there is one.
    pub(super) is_judged: bool,
}

/// What becomes of chunk `n` of a program as it is, prepared, where `ends` has those of the chunks before; `None` where one of
/// these died.
pub(super) fn warm_start(
    program: &Program,
    cell: &Cell,
    options: &Options,
    (judged, ends): (WithOriginal<'_>, &OrderedStage<Option<Start>>),
    n: usize,
    parallelism: Parallelism,
) -> Option<Corrected> {
    let prepared = judged.prepared;
    let solver = Solver::new(&cell.arm, prepared, parallelism);
    let there = solver.forward(|i| prepared.points[i].as_programmed(), |_| WarmStart::default());
    let mut out = Collected::new(program, prepared);
    for (i, there) in there.iter().enumerate() {
        match there {
            _ if out.is_unsolved(i) => out.unsolved_row(i),
            Ok(there) => {
                out.row(i, there);
                out.joints(i, &cell.arm.robot, &prepared.points[i].motor);
            }
            Err(error) => out.fail(i, error),
        }
    }
    let commanded = Commanded {
        poses: &|i| prepared.points[i].wobj_from_tcp,
        motors: &|i| {
            let point = &prepared.points[i];
            point.unsolved.is_none().then_some((point.motor, point.travel))
        },
        predicted_poses: &there,
        near: &|_| WarmStart::default(),
        nodes: &[],
    };
    let before = ends.take(n, |last| deviation::pass_end(program, prepared, &commanded, last))?;
    let on_the_way = along::look(program, prepared, &cell.arm.robot, &commanded, before.as_ref());
    out.paths(&match judged.subdivided {
        Some(subdivided) => subdivided.measure(prepared, &there, &cell.arm, parallelism),
        None => deviation::measure(program, &solver, &commanded, before.as_ref()).targets,
    });
    sigma::fill(&mut out.rows, program, cell, prepared, parallelism);
    if options.stiffness {
        stiffness::fill(&mut out.rows, program, cell, prepared, parallelism);
    }
    if options.stance {
        stance::fill(&mut out.rows, program, cell, prepared);
    }
    let notes = notes(program, cell, prepared, n);
    let moved_mm = if judged.is_judged { prepared.moved_mm() } else { Vec::new() };
    let mut repeated = Repeated::default();
    doubtful_cuts(program, cell, (prepared, options), &mut repeated);
    unweighed_loads(program, cell, &mut repeated);
    unsolved(program, prepared, &mut repeated);
    repeated.say_on_the_way(program, &on_the_way);
    Some(Corrected { moved_mm, repeated, on_the_way, ..out.finish(notes, None, Vec::new()) })
}

/// Corrects a program: the command whose loaded TCP lands on each programmed target.
///
/// `remaining_mm` comes from the forward model on the numbers as written, never from the inverse.
///
/// # Errors
/// What [`Prepared::new`] refuses. Targets without an answer are in [`Corrected::failures`].
pub fn compensate(program: &Program, cell: &Cell, options: &Options) -> Result<Corrected, Vec<Diagnostic>> {
    let carried =
        Carried { path: OrderedStage::new(free_turn::carried(program, cell, options)?), ..Carried::new(cell, None) };
    // Nobody else has a chunk that could break off.
    let corrected = chunk(program, cell, options, &carried, 0, Parallelism::Threads).unwrap_or(Err(Vec::new()))?;
    Ok(corrected.with_repeated())
}

/// What goes from chunk to chunk of a program, each through its own ordered pass.
pub(super) struct Carried<'a> {
    path: OrderedStage<carried::Carried<'a>>,
    /// Of the corrected motion before rounding, which decides the directions of travel.
    commanded: OrderedStage<Last>,
    /// Of the motion as written.
    reached: OrderedStage<Last>,
    /// Last correction as written, base axes, m.
    shift: OrderedStage<Option<Vector3<f64>>>,
    /// How far the program is posted (CL input).
    pub(super) posted: OrderedStage<Place>,
    /// Where the way to the next chunk begins.
    end: OrderedStage<Option<Start>>,
    /// The same as written.
    written: OrderedStage<Option<Start>>,
    /// Zone of the last target that ends a motion.
    zone_mm: OrderedStage<Option<f64>>,
}

impl<'a> Carried<'a> {
    /// Before the first chunk.
    pub(super) fn new(cell: &'a Cell, turns: Option<&ChosenTurns>) -> Self {
        Self {
            path: OrderedStage::new(carried::Carried::with_turns(cell, turns)),
            commanded: OrderedStage::new(None),
            reached: OrderedStage::new(None),
            shift: OrderedStage::new(None),
            posted: OrderedStage::new(Place::default()),
            end: OrderedStage::new(None),
            written: OrderedStage::new(None),
            zone_mm: OrderedStage::new(None),
        }
    }

    /// Lets no chunk wait for one that died.
    pub(super) fn break_off(&self) {
        self.path.break_off();
        self.commanded.break_off();
        self.reached.break_off();
        self.shift.break_off();
        self.posted.break_off();
        self.end.break_off();
        self.written.break_off();
        self.zone_mm.break_off();
    }

    /// Passes on what a chunk that is refused does not change.
    fn skip(&self, n: usize, options: &Options) {
        self.commanded.take(n, |_| ());
        if options.subdivide.is_some() {
            self.end.take(n, |_| ());
            self.zone_mm.take(n, |_| ());
        }
        self.reached.take(n, |_| ());
        self.written.take(n, |_| ());
        self.shift.take(n, |_| ());
    }
}

/// Corrects chunk `n` of a program, of which the ordered passes know all chunks before; `None` where one of these died.
pub(super) fn chunk(
    program: &Program,
    cell: &Cell,
    options: &Options,
    carried: &Carried<'_>,
    n: usize,
    parallelism: Parallelism,
) -> Option<Result<Corrected, Vec<Diagnostic>>> {
    let prepared = carried.path.take(n, |path| path::prepare(program, cell, options, path))?;
    let prepared = prepared.and_then(|mut prepared| {
        removal::run(program, (cell, options), &mut prepared, Cuts::Programmed)?;
        Ok(prepared)
    });
    let mut prepared = match prepared {
        Ok(prepared) => prepared,
        Err(refused) => {
            carried.skip(n, options);
            return Some(Err(refused));
        }
    };
    if options.subdivide.is_some() {
        segment::follow_arcs(program, &mut prepared);
    }
    let arm = &cell.arm;
    let mode = |(target, point): (&Target, &Point)| match point.unsolved {
        Some(_) => CorrectionMode::Keep,
        None => CorrectionMode::of(target.editable, options.correct),
    };
    let modes: Vec<CorrectionMode> = program.targets.iter().zip(&prepared.points).map(mode).collect();
    let solver = Solver::new(arm, &prepared, parallelism);
    let first = solver.first(&modes);
    let travels = carried.commanded.take(n, |last| solve::settle_travel(arm, &prepared, &first, last))?;
    let mut solved = solver.commands(&modes, &first, &travels);
    let (mut nodes, mut vias) = (Vec::new(), Vec::new());
    if let Some(tolerance) = options.subdivide {
        let commanded = Commanded {
            poses: &|i| solved[i].as_ref().map_or(prepared.points[i].wobj_from_tcp, |solved| solved.wobj_from_tcp),
            motors: &|i| solved[i].as_ref().ok().map(|solved| (solved.motor, travels[i])),
            predicted_poses: &[],
            near: &|_| WarmStart::default(),
            nodes: &[],
        };
        let before = carried.end.take(n, |last| deviation::pass_end(program, &prepared, &commanded, last))?;
        let found = subdivide::subdivide(program, &solver, &commanded, &modes, before.as_ref(), tolerance);
        nodes = found.nodes;
        vias = found.vias;
    }
    drop(solver);
    for (via, point, command) in vias {
        (prepared.points[via], solved[via]) = (point, Ok(command));
    }
    let inserts = subdivide::inserts(program, cell, &prepared, &nodes);
    let solver = Solver::new(arm, &prepared, parallelism);

    let mut out = Collected::new(program, &prepared);
    let mut changes: Vec<Option<Change>> = Vec::with_capacity(program.targets.len());
    let mut motors: Vec<Joints> = prepared.points.iter().map(|p| p.motor).collect();
    for (i, solved) in solved.iter().enumerate() {
        changes.push(match solved {
            Ok(solved) => {
                if let Some(violation) =
                    arm.robot.limit_violation(&solved.motor).filter(|_| modes[i] != CorrectionMode::Keep)
                {
                    out.fail(i, &EquilibriumError::Unreachable(violation.into()));
                }
                motors[i] = solved.motor;
                change(&program.targets[i], (&prepared, i), solved, modes[i], cell)
            }
            Err(error) => {
                out.fail(i, error);
                None
            }
        });
    }
    let rewrite = RewriteOptions { allow_clones: options.allow_clones, ..RewriteOptions::default() };
    let (rewritten, printed) = if program.language.is_edited() {
        (Some(program.rewrite(&changes, &inserts, &rewrite)), Vec::new())
    } else {
        let printed = |i: usize| {
            let pose = solved[i].as_ref().map_or(prepared.points[i].wobj_from_tcp, |s| s.wobj_from_tcp);
            solve::as_posted(&pose, options.post)
        };
        (None, parallelism.map(prepared.points.len(), printed))
    };
    if let Some(refused) = rewritten.as_ref().and_then(|rewritten| axes_left(program, &changes, rewritten)) {
        carried.skip(n, options);
        return Some(Err(vec![refused]));
    }
    let written = rewritten.as_ref().map_or(&printed, |rewritten| &rewritten.written);
    let mut nodes = match &rewritten {
        Some(rewritten) => subdivide::as_written(nodes, |k| rewritten.inserted[k]),
        None => subdivide::as_written(nodes, |k| {
            let pose = frames::pose(inserts[k].position_mm, inserts[k].quat);
            Some(solve::as_posted(&pose, options.post))
        }),
    };

    // What the controller will really hold, run forward.
    let changed =
        |i: usize| changes[i].is_some() || !program.language.is_edited() || turns_along(program, i, &written[i]);
    let reached = solver.reached(written, (&modes, &first), &motors, changed);
    for (i, reached) in reached.iter().enumerate() {
        if let Err(error) = reached {
            out.fail(i, error);
        }
    }
    let held = |(reached, motor): (&Result<Reached, _>, &Joints)| reached.as_ref().map_or(*motor, |r| r.motor);
    let held: Vec<Joints> = reached.iter().zip(&motors).map(held).collect();
    let mut stops = Stops::of(&nodes, &prepared, arm);
    let travels = carried.reached.take(n, |last| stops.travels(arm, program, &nodes, &held, last))?;
    let after = solver.forward(
        |i| (&travels[i].motor, &travels[i].travel),
        |i| {
            let (Ok(aim), Ok(solved), Ok(uncorrected)) = (first[i].aim(), &solved[i], &first[i].uncorrected) else {
                return WarmStart::default();
            };
            // What printing leaves of the command.
            let rounded = Vector3::from(written[i].0) * 1e-3 - solved.wobj_from_tcp.translation.vector;
            aim.corrected(prepared.points[i].normal.dot(&rounded), uncorrected)
        },
    );

    let kept = rewritten.as_ref().map_or(&[][..], |r| &r.kept[..]);
    for (i, first) in first.iter().enumerate() {
        if out.is_unsolved(i) {
            out.unsolved_row(i);
            continue;
        }
        let uncorrected = match &first.uncorrected {
            Ok(uncorrected) => uncorrected,
            Err(error) => {
                out.fail(i, error);
                continue;
            }
        };
        out.row(i, uncorrected);
        out.joints(i, &arm.robot, &travels[i].motor);
        let point = &prepared.points[i];
        if let (Some(row), Ok(after)) = (out.rows.last_mut().filter(|_| program.targets[i].is_end()), &after[i]) {
            if let (true, Ok(reached)) = (changed(i), &reached[i]) {
                let shift = Vector3::from(written[i].0) * 1e-3 - point.wobj_from_tcp.translation.vector;
                row.correction_mm = (shift * 1e3).into();
                row.correction_deg = reached.turn.map(f64::to_degrees).into();
            }
            row.remaining_mm = (1e3 * after.shift).into();
            let reason = kept.binary_search_by_key(&i, |(target, _)| *target).ok().map(|at| kept[at].1);
            let reason = reason.or(match program.targets[i].editable {
                Editable::No(reason) => Some(reason),
                _ => None,
            });
            if let Some(reason) = reason {
                row.status = Status::Kept(reason);
                (row.correction_mm, row.correction_deg) = ([0.0; 3], [0.0; 3]);
            }
        }
        if let Err(error) = &after[i] {
            out.fail(i, error);
        }
    }
    let commanded = Commanded {
        // Joint targets have no numbers of a pose.
        poses: &|i| match program.targets[i].goal {
            Goal::Joints { .. } => prepared.points[i].wobj_from_tcp,
            Goal::Pose { .. } | Goal::Axis { .. } => frames::pose(written[i].0, written[i].1),
        },
        motors: &|i| {
            (reached[i].is_ok() && prepared.points[i].unsolved.is_none())
                .then_some((travels[i].motor, travels[i].travel))
        },
        predicted_poses: &after,
        near: &|i| first[i].aim().map_or_else(|_| WarmStart::default(), InverseSolution::nearby),
        nodes: &[],
    };
    let before = carried.written.take(n, |last| deviation::pass_end(program, &prepared, &commanded, last))?;
    let way = WalkedPath { program, prepared: &prepared, commanded: &commanded, last: before.as_ref() };
    stops.place(&way, &mut nodes, arm);
    let commanded = Commanded { nodes: &nodes, ..commanded };
    let on_the_way = along::look(program, &prepared, &arm.robot, &commanded, before.as_ref());
    out.paths(&deviation::measure(program, &solver, &commanded, before.as_ref()).whole(&nodes));
    carried.shift.take(n, |last| check_limits(&mut out, cell, &prepared, written, &changes, last))?;
    sigma::fill(&mut out.rows, program, cell, &prepared, parallelism);
    if options.stiffness {
        stiffness::fill(&mut out.rows, program, cell, &prepared, parallelism);
    }
    if options.stance {
        stance::fill(&mut out.rows, program, cell, &prepared);
    }
    let posted = if program.language.is_edited() {
        Vec::new()
    } else {
        posted(cell, &prepared, written, &travels, (&inserts, options.post))
    };
    let notes = notes(program, cell, &prepared, n);
    let mut repeated = Repeated::default();
    doubtful_cuts(program, cell, (&prepared, options), &mut repeated);
    unweighed_loads(program, cell, &mut repeated);
    unsolved(program, &prepared, &mut repeated);
    repeated.say_on_the_way(program, &on_the_way);
    if options.subdivide.is_some() {
        let before = carried.zone_mm.take(n, |last| std::mem::replace(last, last_zone(program).unwrap_or(*last)))?;
        if let Some(rewritten) = &rewritten {
            insertions(program, rewritten, &inserts, before, &mut repeated);
        }
    }
    let inserted = match &rewritten {
        Some(rewritten) => rewritten.inserted.iter().flatten().count(),
        None => posted.len() - prepared.points.len(),
    };
    Some(Ok(Corrected { repeated, on_the_way, inserted, ..out.finish(notes, rewritten, posted) }))
}

/// A target whose external axes were chosen, but could not be written.
fn axes_left(program: &Program, changes: &[Option<Change>], rewritten: &Rewritten) -> Option<Diagnostic> {
    let is_chosen = |i: &usize| changes[*i].as_ref().is_some_and(|change| change.external.is_some());
    let (i, why) = rewritten.kept.iter().find(|(i, _)| is_chosen(i))?;
    let target = &program.targets[*i];
    let source = &program.sources[usize::from(target.source)];
    let message =
        format!("target {}: the chosen position of its external axes cannot be written: {why}", target.ordinal);
    let help = "give the target numbers of its own, or leave `free` out of the cell's [[unit]]";
    Some(Diagnostic::error("spin.unit", "", message).on_line(source, target.span, target.line).help(help))
}

/// Zone of the last target that ends a motion, mm; `None` of a program without one.
fn last_zone(program: &Program) -> Option<Option<f64>> {
    program.targets.iter().rposition(Target::is_end).map(|last| program.zone_mm(last))
}

/// What is said of moves of which neither program nor cell tells how they cut.
fn doubtful_cuts(program: &Program, cell: &Cell, (prepared, options): (&Prepared, &Options), repeated: &mut Repeated) {
    if options.forces.is_some() {
        return;
    }
    for (target, point) in program.targets.iter().zip(&prepared.points).filter(|(target, _)| target.is_end()) {
        let source = &program.sources[usize::from(target.source)];
        let mut say = |code, severity, message: &str, help: &str| {
            let said = Diagnostic::error(code, "", message).on_line(source, target.span, target.line);
            repeated.say(said.severity(severity).help(help));
        };
        if Laws::is_cut_unknown(cell, target) {
            let why = match program.language {
                Language::Cl => "no FEDRAT gives a feed here",
                _ => "the speed is known only at run time",
            };
            let message = format!("{why}: `max_cutting_feed_mm_s` cannot tell whether this cuts, and it counts as air");
            let help = format!(
                "mark the motion `{}` or `{}`",
                program.language.mark(Mark::Cut),
                program.language.mark(Mark::Air)
            );
            say("cut.unknown-speed", Severity::Warning, &message, &help);
        }
        if point.plunges {
            let message = "this motion feeds along the tool axis, and [cut] does not know its force: the force of the cut \
                           before it is used, or none";
            let air = program.language.mark(Mark::Air);
            let help = format!("[stock] with `mode = \"stock\"` finds what it cuts; `{air}` says that it cuts nothing");
            say("cut.plunge", Severity::Note, message, &help);
        }
    }
}

/// Says which loads gravity does not act on, where it acts on any.
fn unweighed_loads(program: &Program, cell: &Cell, repeated: &mut Repeated) {
    if !cell.arm.weighs_payload() {
        return;
    }
    for target in program.targets.iter().filter(|target| target.is_end() && target.extra_load) {
        let source = &program.sources[usize::from(target.source)];
        let message = "a load besides that of the tool (`GripLoad`, `\\TLoad`) is not weighed: gravity acts on the mass of \
                       the tool's own tooldata";
        let said = Diagnostic::error("rapid.load", "", message).on_line(source, target.span, target.line);
        let help = "give the tool's tooldata the whole load where it holds for all of the program";
        repeated.say(said.severity(Severity::Warning).help(help));
    }
}

/// Warnings about what was to be inserted; `before` is the zone of the target before the program's first, mm.
fn insertions(
    program: &Program,
    rewritten: &Rewritten,
    inserts: &[Insert],
    before: Option<f64>,
    repeated: &mut Repeated,
) {
    let mut say = |i: usize, code, message: &str, help: &str| {
        let target = &program.targets[i];
        let source = &program.sources[usize::from(target.source)];
        let said = Diagnostic::error(code, "", message).on_line(source, target.span, target.line).help(help);
        repeated.say(said.severity(Severity::Warning));
    };
    for &(i, reason) in &rewritten.not_inserted {
        let message = format!("no target can be inserted here: {reason}");
        say(i, "subdivide.not-inserted", &message, "what is left on the way stays: see remaining_path_mm");
    }
    let zones = |i: usize| {
        let start = program.targets[..i].iter().rposition(Target::is_end);
        [program.zone_mm(i), start.map_or(before, |start| program.zone_mm(start))]
    };
    let inserted = inserts.iter().zip(&rewritten.inserted).filter(|(_, inserted)| inserted.is_some());
    for beside in inserted.map(|(insert, _)| insert).collect::<Vec<_>>().chunk_by(|a, b| a.before == b.before) {
        let (i, wide) = (beside[0].before, zones(beside[0].before).into_iter().flatten().fold(0.0, f64::max));
        if beside.iter().any(|insert| wide > insert.room_mm) {
            let message = "the zone here, or at the target before, is wider than the distance to the inserted target";
            let help = "the controller rounds there, which is not modelled: write `fine` or a smaller zone";
            say(i, "subdivide.zone", message, help);
        }
    }
}

/// Targets and the points inserted before them, in the order that they are posted in.
fn posted(
    cell: &Cell,
    prepared: &Prepared,
    written: &[([f64; 3], [f64; 4])],
    reached: &[Dragged],
    (inserts, post_in): (&[Insert], Option<Language>),
) -> Vec<Posted> {
    let robot = &cell.arm.robot;
    // As they were chosen, where the cell leaves them to be.
    let chosen = |external: Option<&External>| {
        let external =
            external.filter(|_| prepared.turns_are_chosen && cell.units.all().iter().any(|unit| unit.free))?;
        Some(Box::new(external.map(|position| (!position.is_nan()).then_some(position))))
    };
    let post = |target: usize,
                (position_mm, quat): ([f64; 3], [f64; 4]),
                motor: &Joints,
                external: Option<Box<[Option<f64>; EXTERNAL_AXES]>>| Posted {
        target,
        external,
        position_mm,
        quat,
        conf: confdata_of(robot, motor),
        motor_deg: robot.axes_deg_from_motor(motor),
    };
    let mut out = Vec::with_capacity(written.len() + inserts.len());
    let mut inserts = inserts.iter().peekable();
    for i in 0..prepared.points.len() {
        while let Some(insert) = inserts.next_if(|insert| insert.before == i) {
            let pose = frames::pose(insert.position_mm, insert.quat);
            let printed = solve::as_posted(&pose, post_in);
            // Its correction was solved: a point that the arm does not reach would not stand here.
            let at = insert.external.map(|external| external.map(|position| position.unwrap_or(f64::NAN)));
            let moved = at.and_then(|external| prepared.mount(i).moved(external));
            let setting = moved.as_ref().map_or_else(|| prepared.setting(i), |moved| &moved.setting);
            if let Ok(motor) = solve::controller_joints(&cell.arm, setting, &printed, &reached[i].motor) {
                out.push(post(i, printed, &motor, chosen(at.as_ref())));
            }
        }
        out.push(post(i, written[i], &reached[i].motor, chosen(prepared.external(i))));
    }
    out
}

/// The change of a target, or `None` where nothing is to be changed.
fn change(
    target: &Target,
    (prepared, i): (&Prepared, usize),
    solved: &Solved,
    mode: CorrectionMode,
    cell: &Cell,
) -> Option<Change> {
    let point = &prepared.points[i];
    let as_written = match target.goal {
        Goal::Pose { position_mm, quat, .. } if prepared.turns_are_chosen => Some(frames::pose(position_mm, quat)),
        _ => None,
    };
    let (from, to) = (as_written.as_ref().unwrap_or(&point.wobj_from_tcp), &solved.wobj_from_tcp);
    let shifted = (to.translation.vector - from.translation.vector).norm_squared() >= NO_CHANGE_M * NO_CHANGE_M;
    // Twice the angle's square.
    let turned = (to.rotation.matrix() - from.rotation.matrix()).norm_squared() >= 2.0 * NO_CHANGE_RAD * NO_CHANGE_RAD;
    let external = chosen_axes(target, prepared, i);
    if mode == CorrectionMode::Keep || !(shifted || turned || external.is_some()) {
        return None;
    }
    let (position_mm, quat) = frames::millimetres(&solved.wobj_from_tcp);
    let robot = &cell.arm.robot;
    // The configuration follows only where it was true: posts write dummies.
    // Joint motions of KRL go by S and T, whatever these are: where they are not those of the arm, that is said.
    let goes_by = |written: &Conf| matches!(written, Conf::Status(_));
    let holds =
        |written: &Conf| prepared.turns_are_chosen || goes_by(written) || conf_is(robot, &point.motor, *written);
    let was = target.conf().filter(holds);
    let conf = was.filter(|was| !conf_is(robot, &solved.motor, *was)).map(|was| conf_like(robot, &solved.motor, was));
    Some(Change { position_mm, quat: (mode == CorrectionMode::Pose && turned).then_some(quat), conf, external })
}

/// Positions of external axes as written, where they were chosen and are others than the program's.
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

/// Whether a target of which only the position is edited turns because what it is made from is corrected.
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

/// What is said of chunk `n` of a run. Frames may be met in any chunk: what was said of one is not said again.
fn notes(program: &Program, cell: &Cell, prepared: &Prepared, n: usize) -> Vec<Diagnostic> {
    let mut notes = if n == 0 { notes_of_all(program, cell, prepared) } else { Vec::new() };
    notes.extend(contradictions(program, cell));
    notes
}

/// What is said of a run, once.
fn notes_of_all(program: &Program, cell: &Cell, prepared: &Prepared) -> Vec<Diagnostic> {
    let mut notes = program.diagnostics.clone();
    notes.extend(prepared.notes.iter().cloned());
    if prepared.started == crate::robot::StartedFrom::NearestHome
        && let Some(first) = program.targets.first()
    {
        let source = &program.sources[usize::from(first.source)];
        let said_by = match program.language {
            Language::Rapid => "no MoveAbsJ, no `[robot] start_deg` and no fitting confdata say",
            Language::Krl => "no PTP to axis angles, no `[robot] start_deg` and no fitting S and T say",
            Language::Ls => "no joint position, no `[robot] start_deg` and no fitting CONFIG say",
            Language::Ur => "no movej to axis angles, no `[robot] start_deg` and no qnear say",
            Language::Cl => "CL data cannot say, and no `[robot] start_deg` says",
        };
        let how = format!("{said_by} how the arm stands at the first target: the branch nearest home is taken");
        notes.push(
            Diagnostic::error("robot.start", "", how)
                .on_line(source, first.span, first.line)
                .severity(Severity::Note)
                .help("give `[robot] start_deg` in the cell"),
        );
    }
    for kind in &cell.controller.left_out {
        let message = format!("effect `{kind}` is left out: the controller corrects it (`[controller] compensates`)");
        notes.push(Diagnostic::error("cell.controller", "", message).severity(Severity::Note));
    }
    notes
}

/// Why targets are not solved, where that can be mended.
fn unsolved(program: &Program, prepared: &Prepared, repeated: &mut Repeated) {
    for (target, point) in program.targets.iter().zip(&prepared.points).filter(|(target, _)| target.is_end()) {
        let Some((why, help)) = point.unsolved.and_then(|why| Some((why, mount::help(why, program.language)?))) else {
            continue;
        };
        let source = &program.sources[usize::from(target.source)];
        let said = Diagnostic::error("target.kept", "", format!("{why}: the target stays unchanged and is not solved"));
        repeated.say(said.on_line(source, target.span, target.line).severity(Severity::Warning).help(help));
    }
}
