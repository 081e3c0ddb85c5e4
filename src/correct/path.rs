//! Ordered pass over the targets: wanted poses, nominal joints, feed, what cuts.

use super::frames::{self, pose};
use super::{Options, Prepared};
use crate::cell::{Cell, Cut, CutForce, ForceFrame, Spin, SpinRule};
use crate::cutting::{FeedTable, ForceTable, Lean, Milling};
use crate::effects::{Cutting, ForceLaw, Situation, ToolFrame};
use crate::equilibrium::{Setting, Site};
use crate::lanes::{Mask, Vector, WIDTH};
use crate::program::{Conf, Goal, Mark, Motion, Program, Role, Target};
use crate::robot::{Eight, Found, Joints, Place, Pose, StartedFrom};
use crate::text::Diagnostic;
use nalgebra::{Matrix3, Rotation3, Unit, Vector3};
use smallvec::SmallVec;
use std::sync::Arc;

/// Everything known of one target before its equilibrium.
#[derive(Clone, Debug)]
pub struct Point {
    /// Index into the settings.
    pub(super) setting: u32,
    /// Where the program sends the TCP.
    pub wobj_from_tcp: Pose,
    /// Where errors are counted from, and what defines depth and force: the same, but for `--against`.
    pub reference: Pose,
    /// Nominal motor angles at `wobj_from_tcp`, rad.
    pub motor: Joints,
    /// Direction of travel into the target with the joints as programmed, −1, 0, 1.
    pub travel: Joints,
    /// Surface normal, out of the material, work object axes.
    pub normal: Vector3<f64>,
    /// Programmed velocity, m/s, work object axes.
    pub velocity: Vector3<f64>,
    /// Length cut up to here, m.
    pub cut_length: f64,
    /// Time since the start, s.
    pub time: f64,
    /// Temperature, °C.
    pub temperature: Option<f64>,
    /// Payload besides the tool, kg.
    pub payload: f64,
    /// The cut.
    pub(super) load: PointLoad,
}

/// The cut of a [`Point`], without borrowing.
#[derive(Clone, Copy, Debug)]
pub(super) enum PointLoad {
    Air,
    /// N, work object axes.
    Constant(Vector3<f64>),
    /// Index into the laws, and the feed frame in the work object.
    Law(usize, Rotation3<f64>),
}

/// A mechanistic force law for one feed per tooth.
#[derive(Clone, Debug)]
pub(super) struct Law {
    milling: Arc<Milling>,
    table: Arc<FeedTable>,
    /// N/m, feed frame.
    slope: Vector3<f64>,
}

impl ForceLaw for Law {
    fn force(&self, shift: &Vector3<f64>, axis: &Vector3<f64>) -> Vector3<f64> {
        self.table.mean_force(shift, &Unit::new_unchecked(*axis))
    }

    fn forces(&self, wanted: Mask, shift: &Vector, axis: &Vector, force: &mut Vector) {
        self.table.mean_forces(wanted, shift, axis, force);
    }

    fn slope(&self) -> Vector3<f64> {
        self.slope
    }
}

impl Point {
    fn cutting<'a>(&self, laws: &'a [Law]) -> Cutting<'a> {
        match self.load {
            PointLoad::Air => Cutting::Air,
            PointLoad::Constant(force) => Cutting::Constant(force),
            PointLoad::Law(law, wobj_from_feed) => Cutting::Law { law: &laws[law], wobj_from_feed },
        }
    }

    /// Nominal motor angles and the direction of travel into them.
    pub(super) fn as_programmed(&self) -> (&Joints, &Joints) {
        (&self.motor, &self.travel)
    }

    pub(super) fn site<'a>(&'a self, setting: &'a Setting, laws: &'a [Law]) -> Site<'a> {
        Site { setting, wobj_from_tcp: &self.reference, payload: self.payload, cutting: self.cutting(laws) }
    }

    pub(super) fn situation<'a>(&self, setting: &Setting, laws: &'a [Law]) -> Situation<'a> {
        Situation {
            base_from_wobj: setting.base_from_wobj,
            wobj_from_tcp: self.reference,
            tool: setting.tool,
            cutting: self.cutting(laws),
            normal: self.normal,
            velocity: self.velocity,
            cut_length: self.cut_length,
            time: self.time,
            temperature: self.temperature,
            payload: self.payload,
        }
    }

    /// A point that was measured with its motor angles, without a program, in the base; see [`Prepared::of_points`].
    pub(crate) fn measured(base_from_tcp: Pose, motor: Joints, travel: Joints) -> Self {
        Self {
            setting: 0,
            wobj_from_tcp: base_from_tcp,
            reference: base_from_tcp,
            motor,
            travel,
            normal: tool_axis(&base_from_tcp),
            velocity: Vector3::zeros(),
            cut_length: 0.0,
            time: 0.0,
            temperature: None,
            payload: 0.0,
            load: PointLoad::Air,
        }
    }

    /// A measured force, base axes while the point is still placed there, N.
    pub(crate) fn set_force(&mut self, force: Vector3<f64>) {
        self.load = PointLoad::Constant(force);
    }

    /// Whether a cutting force acts.
    #[must_use]
    pub fn cuts(&self) -> bool {
        !matches!(self.load, PointLoad::Air)
    }

    /// Error at the contact point along the surface normal, m (Tang et al., Eq. 15), for the actual pose.
    pub(super) fn normal_error(&self, laws: &[Law], actual: &Pose) -> f64 {
        let shift = actual.translation.vector - self.reference.translation.vector;
        let mut error = shift.dot(&self.normal);
        if let PointLoad::Law(law, wobj_from_feed) = self.load {
            let height = |pose: &Pose| {
                let axis = wobj_from_feed.inverse_transform_vector(&tool_axis(pose));
                laws[law].milling.contact_height(&Unit::new_unchecked(axis))
            };
            if let (Some(now), Some(wanted)) = (height(actual), height(&self.reference)) {
                error += now - wanted;
            }
        }
        error
    }
}

/// Tool axis, tip to spindle: −z of the TCP frame.
pub(super) fn tool_axis(pose: &Pose) -> Vector3<f64> {
    -pose.rotation.matrix().column(2)
}

/// Directions of commanded motion smaller than this are stops, rad (INTERFACE.md).
pub(super) const TRAVEL_THRESHOLD: f64 = 1e-7;

/// Direction of travel from one commanded position to the next, held through stops.
pub(super) fn travel(previous: &Joints, now: &Joints, held: &Joints) -> Joints {
    Joints::from_fn(|i, _| {
        let step = now[i] - previous[i];
        if step.abs() > TRAVEL_THRESHOLD { step.signum() } else { held[i] }
    })
}

/// Chords shorter than this give no direction, m: printed digits.
const CHORD: f64 = 1e-6;

/// What the ordered pass takes along from target to target, and from piece to piece of a long program.
pub(super) struct Carried<'a> {
    laws: Laws<'a>,
    settings: Vec<Setting>,
    started: StartedFrom,
    /// Nominal joints of the target before, which choose the branch.
    near: Option<Joints>,
    /// The last point of the pieces before.
    before: Option<Point>,
    /// Last direction of the TCP's x axis (CL), held where the spin rule gives none.
    spun: Option<Vector3<f64>>,
    /// It was said that a cutting force acts on an arm without a stiffness.
    unsprung: bool,
}

impl<'a> Carried<'a> {
    /// Before the first target.
    pub(super) fn new(cell: &'a Cell) -> Result<Self, Vec<Diagnostic>> {
        Ok(Self {
            laws: Laws::new(cell)?,
            settings: Vec::new(),
            started: StartedFrom::NearestHome,
            near: None,
            before: None,
            spun: None,
            unsprung: false,
        })
    }

    /// Index of a setting. Programs have few: a linear search.
    fn setting(&mut self, wanted: Setting) -> u32 {
        let known = self.settings.iter().position(|known| *known == wanted);
        let index = known.unwrap_or_else(|| {
            self.settings.push(wanted);
            self.settings.len() - 1
        });
        // Targets number their tools and work objects by u16.
        index as u32
    }
}

/// The ordered pass over a program, or over a piece of one.
pub(super) fn prepare(
    program: &Program,
    cell: &Cell,
    options: &Options,
    carried: &mut Carried<'_>,
) -> Result<Prepared, Vec<Diagnostic>> {
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
    let wobjs: Vec<Pose> = wobjs.into_iter().map(|wobj| wobj.unwrap_or(IDENTITY)).collect();
    let mut walk = Walk {
        program,
        cell,
        options,
        carried,
        many: Eight::of(&cell.arm.robot),
        errors: Vec::new(),
        points: Vec::with_capacity(program.targets.len()),
    };
    // Program's indices of tool and work object, and the setting of both.
    let mut last = None;
    let mut setting = |carried: &mut Carried<'_>, target: &Target| match last {
        Some((tool, wobj, setting)) if (tool, wobj) == (target.tool, target.wobj) => setting,
        _ => {
            let (tool, base_from_wobj) = (tools[usize::from(target.tool)], wobjs[usize::from(target.wobj)]);
            let setting = carried.setting(Setting { base_from_wobj, tool });
            last = Some((target.tool, target.wobj, setting));
            setting
        }
    };
    for (block, targets) in program.targets.chunks(WIDTH).enumerate() {
        let settings: SmallVec<[u32; WIDTH]> = targets.iter().map(|target| setting(walk.carried, target)).collect();
        let found = walk.look_ahead(targets, &settings);
        for (lane, target) in targets.iter().enumerate() {
            let setting = settings[lane];
            let at = walk.carried.settings[setting as usize];
            walk.step(block * WIDTH + lane, target, (setting, &at), found[lane].as_ref());
        }
    }
    let unsprung = cell.arm.stiffness.is_none() && !walk.carried.unsprung;
    if let Some(at) = walk.points.iter().position(Point::cuts).filter(|_| unsprung) {
        // Rows stop at refused targets, so that the index is the target's only while there are none.
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
    let Walk { points, errors, carried, .. } = walk;
    carried.before = points.last().cloned().or_else(|| carried.before.take());
    if errors.is_empty() {
        Ok(Prepared {
            points,
            started: carried.started,
            settings: carried.settings.clone(),
            laws: carried.laws.laws.clone(),
        })
    } else {
        Err(errors)
    }
}

/// For kept targets whose tool nobody declares: they are not solved.
const NO_TOOL: ToolFrame = ToolFrame { flange_from_tcp: IDENTITY, mass: 0.0, cog: Vector3::new(0.0, 0.0, 0.0) };
const IDENTITY: Pose = Pose {
    rotation: Rotation3::from_matrix_unchecked(Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)),
    translation: nalgebra::Translation3::new(0.0, 0.0, 0.0),
};

struct Walk<'a, 'c> {
    program: &'a Program,
    cell: &'a Cell,
    options: &'a Options,
    carried: &'a mut Carried<'c>,
    many: Option<Eight<'a>>,
    errors: Vec<Diagnostic>,
    points: Vec<Point>,
}

impl Walk<'_, '_> {
    /// Poses and, most likely, motor angles of up to eight targets.
    fn look_ahead(&self, targets: &[Target], settings: &[u32]) -> [Option<Found>; WIDTH] {
        let near = self.carried.near.unwrap_or_else(Joints::zeros);
        let known = &self.carried.settings;
        fn place<'t>(target: &'t Target, Setting { base_from_wobj, tool }: &'t Setting, near: &'t Joints) -> Place<'t> {
            let (position_mm, quat) = match &target.goal {
                Goal::Pose { position_mm, quat, .. } => (position_mm, quat),
                Goal::Axis { .. } | Goal::Joints { .. } => (&[0.0; 3], &[1.0, 0.0, 0.0, 0.0]),
            };
            Place { base_from_wobj, position_mm, quat, flange_from_tcp: &tool.flange_from_tcp, near }
        }
        let mut found = [None; WIDTH];
        // Of tool axes (CL data) the pose is not known yet.
        let posed = targets.iter().any(|target| matches!(target.goal, Goal::Pose { .. }));
        if let Some(robot) = self.many.as_ref().filter(|_| posed) {
            let place = |lane: usize| place(&targets[lane], &known[settings[lane] as usize], &near);
            robot.find(targets.len(), place, |lane, this| found[lane] = Some(this));
        }
        found
    }

    fn step(&mut self, i: usize, target: &Target, (setting, at): (u32, &Setting), found: Option<&Found>) {
        let Setting { base_from_wobj, tool } = at;
        let chord = self.chord(i, target, base_from_wobj);
        let wobj_from_tcp = match target.goal {
            Goal::Pose { position_mm, quat, .. } => {
                found.map_or_else(|| pose(position_mm, quat), |found| found.wobj_from_tcp)
            }
            Goal::Axis { position_mm, axis } => match self.spin(position_mm, axis, chord) {
                Some(pose) => pose,
                None => return self.refuse(target, "cl.spin", "the spin rule gives no direction for the TCP's x axis here", "choose another `[cl] spin` rule or `spin_deg`: its direction is parallel to the tool axis at the first target"),
            },
            Goal::Joints { deg } => {
                let motor = Joints::from(deg.map(f64::to_radians));
                base_from_wobj.inv_mul(&(self.cell.arm.robot.forward(&motor) * tool.flange_from_tcp))
            }
        };
        let pose = || base_from_wobj * wobj_from_tcp * tool.flange_from_tcp.inverse();
        let soon = self.joints_soon(target, tool, base_from_wobj, found);
        let motor = match soon.map_or_else(|| self.joints(target, &pose()), Ok) {
            Ok(motor) => motor,
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
        let previous = self.points.last().or(self.carried.before.as_ref());
        let held = previous.map_or_else(Joints::zeros, |p| p.travel);
        let travel = self.carried.near.map_or(held, |near| travel(&near, &motor, &held));
        self.carried.near = Some(motor);

        let feed = target.feed_mm_s.map(|feed| 1e-3 * feed);
        let row = self.options.forces.as_ref().and_then(|forces| forces.of(target.ordinal, target.name.as_deref()));
        let size = chord.norm();
        let direction = (size > CHORD).then(|| chord * (1.0 / size));
        let length = if previous.is_some() { size } else { 0.0 };
        let lag = match (feed, length) {
            (Some(feed), length) if feed > 0.0 => length / feed,
            _ => 0.0,
        };
        let axis = tool_axis(&wobj_from_tcp);
        let frame = direction.and_then(|d| self.carried.laws.lean.feed_frame(&Unit::new_unchecked(axis), &d));
        let frame = frame.or_else(|| {
            previous.and_then(|p| match p.load {
                PointLoad::Law(_, frame) => Some(frame),
                _ => None,
            })
        });
        let load = match self.carried.laws.load(
            target,
            row.and_then(|r| r.force),
            frame,
            &wobj_from_tcp,
            self.options.forces.is_some(),
        ) {
            Ok(load) => load,
            Err((code, message, help)) => return self.refuse(target, code, &message, &help),
        };
        let cuts = !matches!(load, PointLoad::Air);
        let point = Point {
            setting,
            wobj_from_tcp,
            reference: wobj_from_tcp,
            motor,
            travel,
            normal: match (self.carried.laws.has_engagement(), frame) {
                (true, Some(frame)) => frame * Vector3::z(),
                _ => axis,
            },
            velocity: direction.zip(feed).map_or_else(Vector3::zeros, |(d, feed)| d * feed),
            cut_length: previous.map_or(0.0, |p| p.cut_length) + if cuts { length } else { 0.0 },
            time: row.and_then(|r| r.time).unwrap_or_else(|| previous.map_or(0.0, |p| p.time) + lag),
            temperature: row.and_then(|r| r.temperature),
            payload: row.and_then(|r| r.payload).unwrap_or(0.0),
            load,
        };
        self.points.push(point);
    }

    fn refuse(&mut self, target: &Target, code: &'static str, message: &str, help: &str) {
        let source = &self.program.sources[usize::from(target.source)];
        self.errors.push(Diagnostic::error(code, "", message).on_line(source, target.span, target.line).help(help));
    }

    /// Chord into the target, out of it at the first, work object axes, m. Zero-length moves hold the last.
    fn chord(&self, i: usize, target: &Target, base_from_wobj: &Pose) -> Vector3<f64> {
        let targets = &self.program.targets;
        let at = |t: &Target| match t.goal {
            Goal::Pose { position_mm, .. } | Goal::Axis { position_mm, .. } => Some(Vector3::from(position_mm) * 1e-3),
            Goal::Joints { .. } => None,
        };
        let Some(here) = at(target) else { return Vector3::zeros() };
        if let Some(previous) = self.points.last().or(self.carried.before.as_ref()) {
            let before = &self.carried.settings[previous.setting as usize].base_from_wobj;
            let there = previous.wobj_from_tcp.translation;
            let into =
                if before == base_from_wobj { there } else { base_from_wobj.inv_mul(&(before * there)).translation };
            return here - into.vector;
        }
        let same = |t: &&Target| t.wobj == target.wobj;
        let out = targets[i + 1..].iter().take_while(same).filter_map(at).map(|next| next - here);
        out.into_iter().find(|chord| chord.norm() > CHORD).unwrap_or_else(Vector3::zeros)
    }

    /// Motor angles of a linear move where they are surely the nearest: nothing else depends on what was looked ahead at.
    fn joints_soon(
        &self,
        target: &Target,
        tool: &ToolFrame,
        base_from_wobj: &Pose,
        found: Option<&Found>,
    ) -> Option<Joints> {
        let (near, robot) = (self.carried.near.as_ref()?, self.many.as_ref()?);
        let Goal::Pose { position_mm, quat, conf } = &target.goal else { return None };
        if target.motion == Motion::Joint && conf.is_some() {
            return None;
        }
        let place = Place { base_from_wobj, position_mm, quat, flange_from_tcp: &tool.flange_from_tcp, near };
        // The path may have turned into another branch since.
        found?.nearest(near).or_else(|| {
            let mut motor = None;
            robot.find(1, |_| place, |_, found| motor = found.nearest(near));
            motor
        })
    }

    /// Motor angles at a flange pose: joint moves go to their configuration, linear moves take the nearest.
    fn joints(&mut self, target: &Target, base_from_flange: &Pose) -> Result<Joints, crate::robot::Unreachable> {
        let robot = &self.cell.arm.robot;
        let conf = match target.goal {
            Goal::Joints { deg } => {
                if self.carried.near.is_none() {
                    self.carried.started = StartedFrom::JointTarget;
                }
                return Ok(Joints::from(deg.map(f64::to_radians)));
            }
            Goal::Pose { conf, .. } => conf,
            Goal::Axis { .. } => None,
        };
        let Some(near) = self.carried.near else {
            let start = robot.start(base_from_flange, conf, self.cell.start.as_ref())?;
            self.carried.started = start.how;
            return Ok(start.motor);
        };
        match (target.motion, conf) {
            (Motion::Joint, Some(conf)) => robot.inverse_conf(base_from_flange, conf, &near),
            _ => robot.inverse_near(base_from_flange, &near),
        }
    }

    /// Pose of a CL target: the turn about the tool axis is the cell's `spin` rule.
    fn spin(&mut self, position_mm: [f64; 3], axis: [f64; 3], chord: Vector3<f64>) -> Option<Pose> {
        let spin = self.cell.cl.as_ref().map_or(Spin { rule: SpinRule::Fixed, turn: 0.0 }, |cl| cl.spin);
        let axis = Vector3::from(axis);
        let position = Vector3::from(position_mm) * 1e-3;
        let reference = match spin.rule {
            SpinRule::Fixed => Vector3::x(),
            SpinRule::Feed => chord,
            SpinRule::Towards(point) => point - position,
        };
        /// Sine below which a direction is parallel to the tool axis.
        const PARALLEL: f64 = 1e-4;
        let across = |v: Vector3<f64>| v - axis * v.dot(&axis);
        let x = reference.try_normalize(CHORD).and_then(|r| across(r).try_normalize(PARALLEL));
        let x = x.or_else(|| self.carried.spun.and_then(|held| across(held).try_normalize(PARALLEL)))?;
        self.carried.spun = Some(x);
        let x = Rotation3::from_axis_angle(&Unit::new_normalize(axis), spin.turn) * x;
        let z = -axis;
        let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, z.cross(&x), z]));
        Some(Pose::from_parts(position.into(), rotation))
    }
}

/// The force laws of a cell, made as feeds turn up.
struct Laws<'a> {
    cut: Option<&'a Cut>,
    milling: Option<(Arc<Milling>, Arc<ForceTable>)>,
    lean: Lean,
    laws: Vec<Law>,
}

/// Code, message, help.
type Refusal = (&'static str, String, String);

impl<'a> Laws<'a> {
    fn new(cell: &'a Cell) -> Result<Self, Vec<Diagnostic>> {
        let cut = cell.cut.as_ref();
        let milling = match cut.map(|cut| &cut.force) {
            Some(CutForce::Mechanistic { cutter, engagement, coefficients, .. }) => {
                Some(Milling::new(*cutter, *engagement, *coefficients).map_err(|error| {
                    vec![Diagnostic::error("cell.cut", "", format!("[cut] {}: {}", error.field, error.message))]
                })?)
            }
            _ => None,
        };
        let lean = milling.as_ref().map(Milling::engagement).map_or((0.0, 0.0), |e| (e.lead, e.tilt));
        let milling = milling.map(|milling| (Arc::new(milling.clone()), Arc::new(ForceTable::new(milling))));
        Ok(Self { cut, milling, lean: Lean::new(lean.0, lean.1), laws: Vec::new() })
    }

    fn has_engagement(&self) -> bool {
        self.milling.is_some()
    }

    fn load(
        &mut self,
        target: &Target,
        given: Option<Vector3<f64>>,
        frame: Option<Rotation3<f64>>,
        wobj_from_tcp: &Pose,
        has_table: bool,
    ) -> Result<PointLoad, Refusal> {
        if !self.may_cut(target) {
            return Ok(PointLoad::Air);
        }
        // A table overrides [cut]: a nonzero row cuts, a zero or absent row is air.
        if has_table {
            return Ok(given.filter(|f| *f != Vector3::zeros()).map_or(PointLoad::Air, PointLoad::Constant));
        }
        match self.cut.map(|cut| &cut.force) {
            None => Err((
                "cell.no-cut",
                "the cell has no [cut] section, and no table of forces was given".to_owned(),
                "add [cut] to the cell (force = \"none\" for no force), or give --forces".to_owned(),
            )),
            Some(CutForce::None) => Ok(PointLoad::Air),
            Some(CutForce::Table) => Err((
                "cell.no-forces",
                "[cut] force = \"table\" needs a table of forces".to_owned(),
                "give --forces CSV with `target` and `fx_n,fy_n,fz_n`".to_owned(),
            )),
            Some(CutForce::Constant { force, frame: axes }) => Ok(match (axes, frame) {
                (ForceFrame::Wobj, _) => PointLoad::Constant(*force),
                (ForceFrame::Tool, _) => PointLoad::Constant(wobj_from_tcp.rotation * force),
                (ForceFrame::Feed, Some(frame)) => PointLoad::Constant(frame * force),
                (ForceFrame::Feed, None) => PointLoad::Air,
            }),
            Some(CutForce::Mechanistic { feed_from_program, spindle_rpm, engagement, cutter, .. }) => {
                let Some(frame) = frame else { return Ok(PointLoad::Air) };
                let feed_per_tooth = if *feed_from_program {
                    let rpm = target.spindle_rpm.or(*spindle_rpm).filter(|rpm| *rpm > 0.0);
                    let (Some(feed), Some(rpm)) = (target.feed_mm_s, rpm) else {
                        return Err((
                            "cell.no-feed-per-tooth",
                            "the feed per tooth is not known: the target has no feed, or nobody says the spindle speed"
                                .to_owned(),
                            "give feed_per_tooth_mm or spindle_rpm in [cut.engagement]".to_owned(),
                        ));
                    };
                    1e-3 * feed * 60.0 / (rpm * f64::from(cutter.teeth))
                } else {
                    engagement.feed_per_tooth
                };
                Ok(PointLoad::Law(self.law(feed_per_tooth), frame))
            }
        }
    }

    /// Which moves cut: not RAPID moves, not joint moves, not above a feed limit; markers overrule.
    fn may_cut(&self, target: &Target) -> bool {
        match target.mark {
            Some(Mark::Air) => false,
            Some(Mark::Cut) => true,
            None => {
                let limit = self.cut.and_then(|cut| cut.max_cutting_feed);
                let fast = limit.is_some_and(|limit| target.feed_mm_s.is_none_or(|feed| 1e-3 * feed > limit));
                !target.rapid && !matches!(target.motion, Motion::Joint | Motion::AbsoluteJoint) && !fast
            }
        }
    }

    /// Index of the law of a feed per tooth. Programs have few feeds: a linear search.
    fn law(&mut self, feed_per_tooth: f64) -> usize {
        let same = |law: &Law| law.table.feed_per_tooth().to_bits() == feed_per_tooth.to_bits();
        if let Some(index) = self.laws.iter().position(same) {
            return index;
        }
        if let Some((milling, table)) = &self.milling {
            /// Small against a depth of cut, large against rounding, m.
            const LIFT: f64 = 1e-6;
            let table = Arc::new(table.at_feed(feed_per_tooth));
            let force = |lift: f64| table.mean_force(&Vector3::new(0.0, 0.0, lift), &milling.axis_in_feed());
            let slope = (force(LIFT) - force(-LIFT)) / (2.0 * LIFT);
            self.laws.push(Law { milling: milling.clone(), table, slope });
        }
        self.laws.len() - 1
    }
}

/// Whether a target is an executed motion's end: one report row.
pub(super) fn is_end(target: &Target) -> bool {
    target.role == Role::End
}

/// confdata as written.
pub(super) fn written_conf(target: &Target) -> Option<Conf> {
    match target.goal {
        Goal::Pose { conf, .. } => conf,
        _ => None,
    }
}
