//! The ordered pass over the targets: wanted poses, nominal joints, feed, cut.

use super::KeptReason;
use super::ahead::{Ahead, Approach};
use super::carried::{Carried, Chosen, Free, SettingAndTool};
use super::context::Context;
use super::frames::{self, WobjFrame, pose};
use super::load::PointLoad;
use super::mount::{Mount, Moved, Stand, is_entered_elsewhere};
use super::point::{Point, tool_axis};
use super::refusal::Refusal;
use super::segment::Kind;
use super::spin;
use super::travel::CHORD;
use super::{Options, Prepared};
use deflex_cell::Cell;
use deflex_drive::Track;
use deflex_effects::{Need, Parts, ToolFrame};
use deflex_equilibrium::{Dragged, Setting, direction};
use deflex_lanes::WIDTH;
use deflex_program::{ArcTurn, Editable, Goal, Language, Mark, Motion, Predecessor, Program, Reason, Role, Target};
use deflex_robot::{
    BatchArm, BatchSolutions, EXTERNAL_AXES, External, Joints, Pose, StartedFrom, WrittenTarget, is_close,
};
use deflex_text::Diagnostic;
use nalgebra::{Matrix3, Rotation3, Unit, Vector3};
use smallvec::SmallVec;
use std::sync::Arc;

/// The ordered pass over a program, or over a chunk of one.
pub(super) fn prepare(context: Context<'_>, carried: &mut Carried<'_>) -> Result<Prepared, Vec<Diagnostic>> {
    let Context { program, cell, options, .. } = context;
    let faults = program.faults();
    let tools = frames::tools(program, cell, options);
    let wobjs = frames::wobjs(program, cell);
    let (tools, wobjs) = match (tools, wobjs) {
        (Ok(tools), Ok(wobjs)) if faults.is_empty() => (tools, wobjs),
        (tools, wobjs) => {
            return Err(faults.into_iter().chain([tools.err(), wobjs.err()].into_iter().flatten().flatten()).collect());
        }
    };
    let tools: Vec<ToolFrame> = tools.into_iter().map(|tool| tool.unwrap_or(NO_TOOL)).collect();
    // Work objects that no target uses may be missing.
    let wobjs: Vec<_> = wobjs.into_iter().map(|wobj| wobj.unwrap_or(Ok(WobjFrame::fixed(IDENTITY)))).collect();
    let wobj_of = |target: &Target| wobjs[usize::from(target.wobj)];
    unsaid_units(program, cell, !matches!(carried.free, Free::No))?;
    let holds_part = |target: &Target| program.wobjs[usize::from(target.wobj)].data.is_some_and(|wobj| wobj.robhold);
    let misfit = |target: &Target| {
        let tool = program.tools[usize::from(target.tool)].data.filter(|_| options.tool.is_none());
        (tool.is_none_or(|tool| tool.robhold) == holds_part(target)).then_some(KeptReason::Misfit)
    };
    if program.targets.iter().any(holds_part) {
        stationary(program, cell)?;
    }
    // Chosen turns differ from target to target.
    let many = if matches!(carried.free, Free::No) { BatchArm::of(&cell.arm.robot) } else { None };
    let first = carried.done;
    carried.done += program.targets.len();
    let mut walk = Walk {
        program,
        cell,
        options,
        carried,
        many,
        ahead: Ahead::new(cell),
        errors: Vec::new(),
        points: Vec::with_capacity(program.targets.len()),
        first,
        last_moved: None,
    };
    // The program's indices of tool and work object, and the setting for both.
    let mut last = None;
    let mut setting_and_tool = |carried: &mut Carried<'_>, target: &Target| match last {
        Some((tool, wobj, known)) if (tool, wobj) == (target.tool, target.wobj) => known,
        _ => {
            let frame = wobj_of(target).unwrap_or(WobjFrame::fixed(IDENTITY));
            let name = options.tool.as_deref().unwrap_or(&program.tools[usize::from(target.tool)].name);
            let tool = tools[usize::from(target.tool)];
            let setting = carried.setting(if holds_part(target) {
                Mount::held(cell, tool.flange_from_tcp, ToolFrame { flange_from_tcp: frame.frame, ..tool })
            } else {
                Mount::new(cell, frame, tool)
            });
            let known = SettingAndTool { setting, tool: carried.laws.tool(name) };
            last = Some((target.tool, target.wobj, known));
            known
        }
    };
    for (block, targets) in program.targets.chunks(WIDTH).enumerate() {
        let settings: SmallVec<[SettingAndTool; WIDTH]> =
            targets.iter().map(|target| setting_and_tool(walk.carried, target)).collect();
        let stands: SmallVec<[Stand; WIDTH]> = targets
            .iter()
            .zip(&settings)
            .enumerate()
            .map(|(lane, (target, setting_and_tool))| {
                let why = wobj_of(target).err().or(misfit(target));
                walk.stand((block * WIDTH + lane, target), *setting_and_tool, why)
            })
            .collect();
        let Walk { ahead, many, carried, points, errors, .. } = &mut walk;
        let before = points.last().or(carried.before.as_ref()).filter(|_| errors.is_empty());
        ahead.look(many.as_ref(), (targets, &settings, &stands), carried, before);
        for (lane, target) in targets.iter().enumerate() {
            walk.step((block * WIDTH + lane, lane), target, settings[lane], &stands[lane]);
        }
    }
    let unsprung = cell.arm.stiffness.is_none() && !walk.carried.unsprung;
    if let Some(at) = walk.points.iter().position(Point::cuts).filter(|_| unsprung) {
        // Points end at a refused target: their index is that of the target only while none was refused.
        let target = &program.targets[at];
        if walk.errors.is_empty() {
            walk.carried.unsprung = true;
            walk.refuse(
                target,
                "cell.no-stiffness",
                "a cutting force acts here, but the cell declares no [robot.stiffness] joint_nm_per_rad",
                "add joint_nm_per_rad = [ … ] to [robot.stiffness], or set [cut] force = \"none\"",
            );
        }
    }
    let Walk { mut points, errors, carried, .. } = walk;
    // An arc is known if both its points are.
    for end in (1..points.len()).filter(|end| errors.is_empty() && program.targets[end - 1].role == Role::Via) {
        let why = points[end - 1].unsolved.or(points[end].unsolved);
        (points[end - 1].unsolved, points[end].unsolved) = (why, why);
    }
    let before = carried.before.clone();
    if errors.is_empty() {
        let mut prepared = Prepared {
            points,
            between: Vec::new(),
            before,
            started: carried.started,
            shared: carried.shared(),
            turns_are_chosen: matches!(carried.free, Free::Chosen(_)),
            notes: std::mem::take(&mut carried.notes),
        };
        if let Some(loads) = context.loads {
            loads.apply(&mut prepared);
        }
        if cell.arm.follows_load() {
            prepared.follow_loads(&cell.arm);
        }
        carried.before = prepared.points.last().cloned().or_else(|| carried.before.take());
        Ok(prepared)
    } else {
        carried.before = points.last().cloned().or_else(|| carried.before.take());
        Err(errors)
    }
}

/// CL data do not state positions of units: the cell has to, for units that carry the robot or the work object.
fn unsaid_units(program: &Program, cell: &Cell, are_chosen: bool) -> Result<(), Vec<Diagnostic>> {
    let (Language::Cl, Some(source), Some(target)) =
        (program.language, program.sources.first(), program.targets.first())
    else {
        return Ok(());
    };
    let wobj = program.wobjs.get(usize::from(target.wobj));
    let under_wobj = wobj.and_then(|wobj| cell.wobj_units.get(&wobj.name.to_ascii_uppercase()).copied());
    let mut carrying = [cell.units.under_robot(), under_wobj].into_iter().flat_map(|top| cell.units.chain(top));
    let unsaid = |unit: &usize| {
        let said = target.external.as_ref().and_then(|external| external.position(cell.units.all()[*unit].named));
        said.is_none() && !(are_chosen && cell.units.all()[*unit].free)
    };
    match carrying.find(unsaid) {
        Some(unit) => {
            let unit = &cell.units.all()[unit];
            let message = format!("CL data do not state the position of unit `{}` of the cell", unit.name);
            let help = format!("state it in the cell: [cl] external = {{ {} = 0.0 }}", unit.named);
            Err(vec![Diagnostic::error("cell.unit", &source.name, message).help(help)])
        }
        None => Ok(()),
    }
}

/// Positions of units whose position is free and has not been chosen: the middle of their limits.
fn middle(language: Language, cell: &Cell, target: &Target) -> External {
    let mut external = [f64::NAN; EXTERNAL_AXES];
    for unit in cell.units.all().iter().filter(|unit| unit.free && language == Language::Cl) {
        let said = target.external.as_ref().and_then(|external| external.position(unit.named));
        external[unit.axis] = said.map_or(0.5 * (unit.min + unit.max), |_| f64::NAN);
    }
    external
}

/// Refuses what is not supported with a stationary tool.
fn stationary(program: &Program, cell: &Cell) -> Result<(), Vec<Diagnostic>> {
    let on_tool = Parts::TCP.and(Parts::WOBJ).and(Parts::TIP).and(Parts::FLANGE);
    let effect = cell.arm.effects.iter().find(|effect| effect.law().parts().has(on_tool));
    let message = match (effect, &cell.stock) {
        (Some(effect), _) => format!("effect `{}` cannot be computed for a stationary tool", effect.kind()),
        (None, Some(_)) => "[stock] cannot be computed for a part that the robot holds".to_owned(),
        (None, None) => return Ok(()),
    };
    let name = program.sources.first().map_or("", |source| &source.name);
    Err(vec![Diagnostic::error("cell.stationary", name, message).help("leave it out of the cell for this program")])
}

/// Stands for the tool of kept targets whose tool is not declared: they are not solved.
pub(super) const NO_TOOL: ToolFrame =
    ToolFrame { flange_from_tcp: IDENTITY, mass: 0.0, cog: Vector3::new(0.0, 0.0, 0.0) };
const IDENTITY: Pose = Pose {
    rotation: Rotation3::from_matrix_unchecked(Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)),
    translation: nalgebra::Translation3::new(0.0, 0.0, 0.0),
};

struct Walk<'a, 'c> {
    program: &'a Program,
    cell: &'a Cell,
    options: &'a Options,
    carried: &'a mut Carried<'c>,
    many: Option<BatchArm<'a>>,
    ahead: Ahead,
    errors: Vec<Diagnostic>,
    points: Vec<Point>,
    /// Number of targets of the chunks before.
    first: usize,
    /// Units of the last target that is on units, with its setting.
    last_moved: Option<(u32, Arc<Moved>)>,
}

/// How the controller turns the tool on the arc to a target.
fn arc_turn(program: &Program, cell: &Cell, target: &Target) -> ArcTurn {
    target.arc_turn.or(cell.controller.arc_turn).unwrap_or(program.language.about().arc_turn)
}

/// What is known of the place at which the segment to a target begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Begin {
    Known,
    /// Only the direction from it to the target.
    Direction,
    Unknown,
}

impl Walk<'_, '_> {
    fn mount(&self, index: u32) -> &Mount {
        &self.carried.settings[index as usize]
    }

    /// The base and the work object of a target, as its units carry them.
    fn stand(
        &mut self,
        (i, target): (usize, &Target),
        SettingAndTool { setting, .. }: SettingAndTool,
        wobj: Option<KeptReason>,
    ) -> Stand {
        let apart = is_entered_elsewhere(target);
        let why = match target.editable {
            Editable::No(why) if !target.located => Some(why.into()),
            _ => wobj,
        };
        if why.is_some() {
            return Stand { moved: None, unsolved: why, apart };
        }
        let at_rest = target.external.as_ref().is_none_or(|external| external.is_at_rest());
        if at_rest && self.cell.units.all().is_empty() {
            return Stand { apart, ..Stand::default() };
        }
        let last = self.last_moved.as_ref().filter(|(last, _)| *last == setting).map(|(_, moved)| moved);
        let chosen = match &self.carried.free {
            Free::No => [f64::NAN; EXTERNAL_AXES],
            Free::Sought => middle(self.program.language, self.cell, target),
            Free::Chosen(chosen) => chosen[self.first + i]
                .external
                .as_deref()
                .copied()
                .unwrap_or_else(|| middle(self.program.language, self.cell, target)),
        };
        let before = i.checked_sub(1).and_then(|before| self.program.targets[before].external.as_deref());
        match Stand::of(self.cell, target, self.mount(setting), last, before, &chosen) {
            Ok(stand) => {
                self.last_moved = stand.moved.clone().map(|moved| (setting, moved));
                stand
            }
            Err(message) => {
                let message = format!("target {} is not reached: {message}", target.ordinal);
                let help = "check `min` and `max` of the cell's [[unit]], or the program";
                self.refuse(target, "robot.unreachable", &message, help);
                Stand::default()
            }
        }
    }

    /// Adds a target whose pose is unknown.
    fn pass_over(&mut self, target: &Target, why: KeptReason, SettingAndTool { setting, tool }: SettingAndTool) {
        if self.may_cut_unknown_stock(target, why, tool) {
            return;
        }
        let mut travel = self.last().map_or_else(Joints::zeros, |previous| previous.travel);
        let at = match target.goal {
            Goal::Pose { position_mm, quat, .. } => pose(position_mm, quat),
            Goal::Axis { position_mm, .. } => pose(position_mm, [1.0, 0.0, 0.0, 0.0]),
            Goal::Joints { deg } => {
                if self.carried.near.is_none() {
                    self.carried.started = StartedFrom::JointTarget;
                }
                let motor = self.cell.arm.robot.motor_from_axes_deg(&deg);
                travel = self.travel_to(&motor);
                self.carried.near = Some(motor);
                IDENTITY
            }
        };
        // Before the first target the joints are unknown: not a number.
        let motor = self.carried.near.unwrap_or_else(|| Joints::repeat(f64::NAN));
        let point = Point::unsolved(why, at, Dragged { motor, twist: Joints::zeros(), travel }, setting, self.last());
        self.points.push(point);
    }

    fn step(&mut self, (i, lane): (usize, usize), target: &Target, setting_and_tool: SettingAndTool, stand: &Stand) {
        let SettingAndTool { setting, tool } = setting_and_tool;
        if let Some(why) = stand.unsolved {
            return self.pass_over(target, why, setting_and_tool);
        }
        if !self.ahead.knows_approaches() {
            let chord = self.chord(i, target, setting, stand);
            self.ahead.set_chord(lane, &chord);
        }
        let chord = self.ahead.chord(lane);
        let wobj_from_tcp = match target.goal {
            Goal::Pose { position_mm, quat, .. } => {
                self.ahead.pose(lane).unwrap_or_else(|| pose(position_mm, quat))
            }
            Goal::Axis { position_mm, axis, .. } => match self.turned(lane, position_mm, axis, chord) {
                Some(pose) => pose,
                None => return self.refuse(target, "cl.spin", "the spin rule gives no direction for the TCP's x axis here", "choose another `[cl] spin` rule or `spin_deg`: its direction is parallel to the tool axis at the first target"),
            },
            Goal::Joints { deg } => {
                let motor = self.cell.arm.robot.motor_from_axes_deg(&deg);
                stand.setting(self.mount(setting)).wobj_from_tcp(&self.cell.arm.robot.forward(&motor))
            }
        };
        let chosen = match &self.carried.free {
            Free::Chosen(chosen) => Some(chosen[self.first + i].clone()),
            Free::No | Free::Sought => None,
        };
        let wobj_from_tcp = match chosen.as_ref().and_then(|chosen| chosen.turn) {
            Some(turn) => spin::turned(wobj_from_tcp.translation.vector, &tool_axis(&wobj_from_tcp), turn),
            None => wobj_from_tcp,
        };
        let on_arc = match self.on_arc(i, setting, stand, &wobj_from_tcp) {
            Ok(on_arc) => on_arc,
            Err(why) => return self.pass_over(target, why.into(), setting_and_tool),
        };
        let wobj_from_tcp = on_arc.unwrap_or(wobj_from_tcp);
        let run_at = stand.setting(self.mount(setting));
        // The look-ahead has the orientation of the text.
        let soon = if on_arc.is_none() { self.joints_soon((target, lane), run_at) } else { None };
        let joints = match (chosen, soon) {
            (Some(Chosen { turn: Some(_), near, .. }), _) => self.joints_near(*run_at, &wobj_from_tcp, &near),
            (_, Some(soon)) => Ok(soon),
            (_, None) => self.joints(target, stand, *run_at, &wobj_from_tcp),
        };
        let motor = match joints {
            Ok(motor) => motor,
            Err(_) if matches!(self.carried.free, Free::Sought) => {
                self.carried.unreached.push(self.first + i);
                self.carried.near.unwrap_or_else(Joints::zeros)
            }
            Err(error) => {
                let message = format!("target {} is not reached: {error}", target.ordinal);
                return self.refuse(
                    target,
                    "robot.unreachable",
                    &message,
                    "check work object, tool and `[robot]` of the cell, or the program",
                );
            }
        };
        let travel = self.travel_to(&motor);
        let starts_unknown = self.starts_unknown(target);
        self.follow_unknown_travel(starts_unknown, &motor);
        self.carried.near = Some(motor);
        let previous = self.points.last().or(self.carried.before.as_ref());

        let feed = target.feed_mm_s.map(|feed| 1e-3 * feed);
        let row = self.options.forces.as_ref().and_then(|forces| forces.of(target.ordinal, target.name.as_deref()));
        let axis = tool_axis(&wobj_from_tcp);
        if on_arc.is_some() || !self.ahead.knows_approaches() {
            self.ahead.set_approach(lane, &Unit::new_unchecked(axis), self.carried.laws.lean(tool));
        }
        let Approach { size, direction, feed_frame } = self.ahead.approach(lane);
        let joined = previous.filter(|previous| previous.is_located() && !stand.apart);
        let length = if joined.is_some() { size } else { 0.0 };
        let lag = match (feed, length) {
            (Some(feed), length) if feed > 0.0 => length / feed,
            _ => 0.0,
        };
        // A surface normal in the text is more accurate than the lean that the cell declares.
        let printed = surface_normal(target);
        let on_surface = printed.zip(direction).and_then(|(normal, direction)| frame_on(normal, direction));
        let feed_frame = if printed.is_some() { on_surface.as_ref() } else { feed_frame };
        let leaned = feed_frame.is_some() && printed.is_none();
        // A motion without a feed direction, such as a plunge along the tool axis, has the force of the cut before it.
        let held = joined.map(|previous| &previous.load).filter(|load| load.turns_with_feed());
        let frame = feed_frame.or(match held {
            Some(PointLoad::Law { wobj_from_feed, .. }) => Some(wobj_from_feed),
            _ => None,
        });
        let table = self.options.has_force_table(self.cell);
        let in_feed_frame = self.carried.laws.in_feed_frame((target, tool), table);
        // CL data without a feed have none at run time either: such a motion counts as air.
        let is_cut_unknown =
            self.program.language != Language::Cl && self.carried.laws.is_cut_unknown(target, tool) && !table;
        let unknown = if is_cut_unknown {
            Some(KeptReason::CutUnknown)
        } else {
            // A plunge before all other cuts has no force.
            let has_frame = frame.is_some() || held.is_some() || previous.is_none() && direction.is_some();
            // Only the direction is known of a path that does not begin at the target before.
            let has_begin = target.begins_mm.is_some() && stand.moved.is_none();
            let begin = match starts_unknown {
                false => Begin::Known,
                true if has_begin && feed_frame.is_some() && in_feed_frame => Begin::Direction,
                true => Begin::Unknown,
            };
            let is_unknown = self.depends_on_unknown(target, begin, has_frame);
            is_unknown.then_some(KeptReason::PredecessorUnknown)
        };
        if let Some(why) = unknown {
            let dragged = Dragged { motor, twist: Joints::zeros(), travel };
            return self.leave(target, why, (wobj_from_tcp, dragged), setting_and_tool, stand);
        }
        let (cut, given, axes) = ((target, tool), row.and_then(|r| r.force), (frame, leaned, held));
        let load = match self.carried.laws.load(cut, given, axes, &wobj_from_tcp, table) {
            Ok(load) => load,
            Err(Refusal { code, message, help }) => return self.refuse(target, code, &message, &help),
        };
        let through = match self.carried.laws.through(cut, table) {
            Ok(through) => through,
            Err(Refusal { code, message, help }) => return self.refuse(target, code, &message, &help),
        };
        let cuts = !matches!(load, PointLoad::Air);
        let plunges = length > CHORD && feed_frame.is_none() && in_feed_frame;
        let point = Point {
            setting,
            moved: stand.moved.clone(),
            unsolved: None,
            wobj_from_tcp,
            reference: wobj_from_tcp,
            motor,
            travel,
            normal: match (printed, self.carried.laws.has_engagement(tool), frame) {
                (Some(normal), ..) => normal,
                (None, true, Some(frame)) => frame.matrix().column(2).into(),
                _ => axis,
            },
            velocity: match joined.and_then(|previous| self.moved_from(previous, stand)) {
                Some(before) if lag > 0.0 => (wobj_from_tcp.translation.vector - before) / lag,
                _ => direction.zip(feed).map_or_else(Vector3::zeros, |(d, feed)| d * feed),
            },
            cut_length: previous.map_or(0.0, |p| p.cut_length) + if cuts { length } else { 0.0 },
            time: row.and_then(|r| r.time).unwrap_or_else(|| previous.map_or(0.0, |p| p.time) + lag),
            temperature: row.and_then(|r| r.temperature),
            payload: row.and_then(|r| r.payload).unwrap_or(0.0),
            load,
            through,
            arc_turn: arc_turn(self.program, self.cell, target),
            turned_by_arc: on_arc.is_some(),
            plunges,
            milled: None,
            part: None,
            torque: None,
        };
        self.points.push(point);
    }

    /// The point before the next one.
    fn last(&self) -> Option<&Point> {
        self.points.last().or(self.carried.before.as_ref())
    }

    /// A point of an arc with the orientation that the turn on the arc gives the tool there, whatever its text says: a circle point, or the
    /// end if the tool is fixed to the path. `None` for other targets, and if the orientation of the text counts: the controller turns the
    /// tool to it, or the start of the arc is unknown.
    fn on_arc(&self, i: usize, setting: u32, stand: &Stand, here: &Pose) -> Result<Option<Pose>, Reason> {
        let (program, is_end) = (self.program, Kind::of(self.program, i) == Kind::Arc);
        let end = if is_end { i } else { i + 1 };
        if end == program.targets.len() || Kind::of(program, end) != Kind::Arc {
            return Ok(None);
        }
        let turn = arc_turn(program, self.cell, &program.targets[end]);
        if turn == ArcTurn::ThroughCirclePoint || is_end && turn != ArcTurn::Fixed {
            return Ok(None);
        }
        let pose = self.pose_on_arc(end, (setting, stand), here, turn);
        let starts_known =
            program.targets[i].predecessor == Predecessor::Previous && self.last().is_some_and(Point::is_located);
        match turn {
            ArcTurn::Fixed => pose.map(Some).ok_or(Reason::Tangent),
            // The tool turns from an orientation that is not known.
            _ if !starts_known => Err(Reason::PathStartUnknown),
            _ => Ok(pose),
        }
    }

    /// The pose on the arc to target `end`, at the circle point or the end, whichever is `here`; `None` if the start of the arc is unknown.
    fn pose_on_arc(&self, end: usize, place: (u32, &Stand), here: &Pose, turn: ArcTurn) -> Option<Pose> {
        let [via, to] = [end - 1, end].map(|i| &self.program.targets[i]);
        let is_end = self.points.len() == end;
        let start = self.start(self.points[..self.points.len() - usize::from(is_end)].last(), place)?;
        let [circle, to_pose] = match (is_end, to.goal) {
            (true, _) => [self.points.last()?.wobj_from_tcp, *here],
            (false, Goal::Pose { position_mm, quat, .. }) => [*here, pose(position_mm, quat)],
            (false, _) => return None,
        };
        let arc = Track::arc(&start, &circle, &to_pose, turn);
        let arc = if self.program.language.about().chooses_turn { arc } else { arc.by_shorter_turn() };
        let share = if is_end { arc.via().map(|_| 1.0) } else { arc.via() };
        let share = share.filter(|_| via.predecessor == Predecessor::Previous)?;
        Some(Pose { rotation: arc.pose(share).rotation, ..*here })
    }

    /// The pose of a point, or of the last point of the chunk before, in the work object in force; `None` if it is unknown.
    fn start(&self, point: Option<&Point>, (setting, stand): (u32, &Stand)) -> Option<Pose> {
        let before = point.or(self.carried.before.as_ref());
        let before = before.filter(|before| before.is_located() && !stand.apart)?;
        // The work object where the path begins.
        let now = self.mount(setting).at(before.moved.as_ref())?;
        let was = before.moved.as_ref().map_or(&self.mount(before.setting).setting, |moved| &moved.setting);
        Some(match *was == now || before.setting == setting {
            true => before.wobj_from_tcp,
            false => now.wobj_from_tcp(&was.base_from_flange(&before.wobj_from_tcp)),
        })
    }

    /// Travel of a programmed motion to these motor angles, rad, with sharp friction: [`Prepared::follow_loads`] computes the travel of other
    /// friction when the forces are known.
    fn travel_to(&self, motor: &Joints) -> Joints {
        let held = self.last().map_or_else(Joints::zeros, |previous| previous.travel);
        self.carried.near.map_or(held, |near| direction(&near, motor, &held))
    }

    /// Whether the segment to a target begins at an unknown point.
    fn starts_unknown(&self, target: &Target) -> bool {
        match target.predecessor {
            Predecessor::Previous => self.last().is_some_and(|last| !last.is_located()),
            Predecessor::Start => false,
            _ => true,
        }
    }

    /// Updates what is unknown of the travel of the joints, for a motion to these motor angles.
    fn follow_unknown_travel(&mut self, starts_unknown: bool, motor: &Joints) {
        let (arm, known) = (&self.cell.arm, Joints::zeros());
        self.carried.unknown_travel = match self.carried.near {
            _ if starts_unknown => arm.unknown_travel(&Joints::repeat(2.0), &known),
            Some(near) if self.carried.unknown_travel != known => {
                arm.unknown_travel(&self.carried.unknown_travel, &(motor - near))
            }
            _ => return,
        };
    }

    /// Whether the force or the error at a target depends on motions before it that are unknown.
    fn depends_on_unknown(&self, target: &Target, begin: Begin, has_frame: bool) -> bool {
        /// Largest unknown part of the travel: 0.1 µm for a gap of 1e-4 rad at an arm of 1 m, less than programs print.
        const UNKNOWN_TRAVEL: f64 = 1e-3;
        let arm = &self.cell.arm;
        let follows_the_way = self.carried.laws.follows_the_way(target, self.options.has_force_table(self.cell));
        // A cut along the tool axis takes its directions from the cut before it, which is not computed if that was kept. The first target
        // takes them from the way to the next one, which may be unknown too.
        let frame_is_unknown = !has_frame && self.last().is_none_or(|last| last.unsolved.is_some());
        let follows_the_begin = match begin {
            Begin::Known => false,
            Begin::Direction => arm.follows_travel() || arm.needs(Need::Speed),
            Begin::Unknown => follows_the_way || arm.follows_travel() || arm.needs(Need::Speed),
        };
        follows_the_begin || frame_is_unknown && follows_the_way || self.carried.unknown_travel.amax() > UNKNOWN_TRAVEL
    }

    /// Adds a target that is kept although its pose is known.
    fn leave(
        &mut self,
        target: &Target,
        why: KeptReason,
        (wobj_from_tcp, dragged): (Pose, Dragged),
        SettingAndTool { setting, tool }: SettingAndTool,
        stand: &Stand,
    ) {
        if self.may_cut_unknown_stock(target, why, tool) {
            return;
        }
        let point = Point::unsolved(why, wobj_from_tcp, dragged, setting, self.last());
        self.points.push(Point { moved: stand.moved.clone(), ..point });
    }

    /// Pose of a CL target.
    fn turned(&mut self, lane: usize, position_mm: [f64; 3], axis: [f64; 3], chord: Vector3<f64>) -> Option<Pose> {
        if let Some((pose, held)) = self.ahead.turned(lane) {
            self.carried.spun = held;
            return Some(pose);
        }
        spin::pose(self.ahead.spin(), position_mm, axis, chord, &mut self.carried.spun)
    }

    /// Refuses a target from which on the stock would not be known, because its move may cut. Returns whether it did.
    fn may_cut_unknown_stock(&mut self, target: &Target, why: KeptReason, tool: usize) -> bool {
        let is_refused = self.cell.stock.is_some() && self.carried.laws.may_cut(target, tool);
        if is_refused {
            let message = format!("it cannot be computed what this move cuts from the stock: {why}");
            let help = format!("mark it `{}`, or leave [stock] out", self.program.language.mark(Mark::Air));
            self.refuse(target, "cell.stock", &message, &help);
        }
        is_refused
    }

    fn refuse(&mut self, target: &Target, code: &'static str, message: &str, help: &str) {
        self.ahead.forget_approaches();
        self.errors.push(self.program.error_at(target, code, message).help(help));
    }

    /// Whether a mechanical unit moves on the path to the present target.
    fn units_move(&self, stand: &Stand) -> bool {
        let same = |last: &Point| match (&last.moved, &stand.moved) {
            (Some(from), Some(to)) => Arc::ptr_eq(from, to),
            (from, to) => from.is_none() && to.is_none(),
        };
        self.last().is_some_and(|last| !same(last))
    }

    /// Position of the TCP at the point before, in the present work object, m; `None` if no unit has moved on the segment.
    fn moved_from(&self, previous: &Point, stand: &Stand) -> Option<Vector3<f64>> {
        let (from, to) = (previous.moved.as_ref()?, stand.moved.as_ref().filter(|to| !to.setting.held)?);
        let base_from_tcp = from.setting.base_from_wobj * previous.wobj_from_tcp;
        (!Arc::ptr_eq(from, to)).then(|| to.setting.base_from_wobj.inv_mul(&base_from_tcp).translation.vector)
    }

    /// Chord to the target, or from it for the first target, work object axes, m. A motion without a length keeps the last chord.
    fn chord(&self, i: usize, target: &Target, setting: u32, stand: &Stand) -> Vector3<f64> {
        let targets = &self.program.targets;
        let at = |t: &Target| match t.goal {
            Goal::Pose { position_mm, .. } | Goal::Axis { position_mm, .. } => Some(Vector3::from(position_mm) * 1e-3),
            Goal::Joints { .. } => None,
        };
        let Some(here) = at(target) else { return Vector3::zeros() };
        if let Some(begins_mm) = target.begins_mm.filter(|_| stand.moved.is_none()) {
            return here - Vector3::from(begins_mm) * 1e-3;
        }
        let previous = self.points.last().or(self.carried.before.as_ref()).filter(|_| !stand.apart);
        if let Some(previous) = previous.filter(|previous| previous.is_located()) {
            let there = previous.wobj_from_tcp.translation;
            if previous.setting == setting {
                return here - there.vector;
            }
            // The work object at that point.
            let from = previous.moved.as_ref();
            let before = from.map_or(&self.mount(previous.setting).setting, |moved| &moved.setting);
            if let Some(now) = self.mount(setting).at(from) {
                if before.held || now.held || before.tool != now.tool {
                    let flange = before.base_from_flange(&previous.wobj_from_tcp);
                    return here - now.wobj_from_tcp(&flange).translation.vector;
                }
                let (before, now) = (&before.base_from_wobj, &now.base_from_wobj);
                let into = if before == now { there } else { now.inv_mul(&(before * there)).translation };
                return here - into.vector;
            }
        }
        let follows = |t: &&Target| t.wobj == target.wobj && t.predecessor == Predecessor::Previous;
        let out = targets[i + 1..].iter().take_while(follows).filter_map(at).map(|next| next - here);
        out.into_iter().find(|chord| chord.norm() > CHORD).unwrap_or_else(Vector3::zeros)
    }

    /// Motor angles of a linear motion from the look-ahead, if they are surely the nearest.
    fn joints_soon(&self, (target, lane): (&Target, usize), setting: &Setting) -> Option<Joints> {
        let (near, robot) = (self.carried.near.as_ref()?, self.many.as_ref().filter(|_| !setting.held)?);
        let (position_mm, quat) = match &target.goal {
            Goal::Pose { conf: Some(_), .. } if target.motion == Motion::Joint => return None,
            Goal::Pose { position_mm, quat, .. } => (position_mm, quat),
            Goal::Axis { .. } if self.ahead.turned(lane).is_some() => return self.ahead.motor(lane, near),
            Goal::Axis { .. } | Goal::Joints { .. } => return None,
        };
        // The path may have changed its branch meanwhile.
        self.ahead
            .motor(lane, near)
            .or_else(|| {
                let Setting { base_from_wobj, tool, .. } = setting;
                let place =
                    WrittenTarget { base_from_wobj, position_mm, quat, flange_from_tcp: &tool.flange_from_tcp, near };
                let mut found = BatchSolutions::default();
                robot.find(1, |_| place, &mut found);
                found.nearest(0, near)
            })
            .filter(|motor| is_close(motor, near))
    }

    /// Motor angles nearest to known ones at a pose.
    fn joints_near(
        &mut self,
        setting: Setting,
        wobj_from_tcp: &Pose,
        near: &Joints,
    ) -> Result<Joints, deflex_robot::Unreachable> {
        if self.carried.near.is_none() {
            self.carried.started = StartedFrom::FreeTurn;
        }
        self.cell.arm.robot.inverse_near(&setting.base_from_flange(wobj_from_tcp), near)
    }

    /// Motor angles at a pose: joint motions go to their configuration, linear motions to the angles that the line leads to.
    fn joints(
        &mut self,
        target: &Target,
        stand: &Stand,
        setting: Setting,
        wobj_from_tcp: &Pose,
    ) -> Result<Joints, deflex_robot::Unreachable> {
        let robot = &self.cell.arm.robot;
        let base_from_flange = &setting.base_from_flange(wobj_from_tcp);
        let conf = match target.goal {
            Goal::Joints { deg } => {
                if self.carried.near.is_none() {
                    self.carried.started = StartedFrom::JointTarget;
                }
                return Ok(robot.motor_from_axes_deg(&deg));
            }
            Goal::Pose { conf, .. } => conf,
            Goal::Axis { .. } => None,
        };
        let Some(near) = self.carried.near else {
            let start = robot.start(base_from_flange, conf, self.cell.start.as_ref())?;
            self.carried.started = start.how;
            return Ok(start.motor);
        };
        match target.motion {
            Motion::Joint => robot.inverse_conf(base_from_flange, conf, &near),
            // The path of the flange is known if it begins at the target before, no unit moves on it, and the tool does not turn freely.
            _ if target.predecessor != Predecessor::Previous
                || self.units_move(stand)
                || matches!(self.carried.free, Free::Sought) =>
            {
                robot.inverse_near(base_from_flange, &near)
            }
            // A stationary tool stands still while the flange moves.
            _ if setting.held => robot.inverse_along(&Pose::identity(), base_from_flange, &near),
            _ => robot.inverse_along(&setting.tool.flange_from_tcp, base_from_flange, &near),
        }
    }
}

/// The surface normal that the text states at a target, unit length, work object axes.
fn surface_normal(target: &Target) -> Option<Vector3<f64>> {
    match target.goal {
        Goal::Axis { normal, .. } => normal.map(Vector3::from),
        Goal::Pose { .. } | Goal::Joints { .. } => None,
    }
}

/// The feed frame on a surface: z is the normal, x the feed at a right angle to it; `None` if the feed is along the normal.
fn frame_on(normal: Vector3<f64>, feed: Vector3<f64>) -> Option<Rotation3<f64>> {
    /// Sine below which a feed has no direction on the surface.
    const PARALLEL: f64 = 1e-6;
    let x = (feed - normal * feed.dot(&normal)).try_normalize(PARALLEL)?;
    Some(Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, normal.cross(&x), normal])))
}
