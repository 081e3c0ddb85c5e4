//! A program's moves through the stock, in order: what each leaves, and the force at each target where it follows from that.

use super::frames;
use super::load::{Follows, PointLoad};
use super::mount::Mount;
use super::point::{Milled, Point, tool_axis};
use super::segment::Kind;
use super::track::Track;
use super::travel::CHORD;
use super::{Options, Prepared, against};
use crate::cell::Cell;
use crate::effects::{Cutting, Situation};
use crate::program::{Program, Role};
use crate::robot::Pose;
use crate::stock::{Engaged, Front, Stock, ToolPose};
use crate::text::{Diagnostic, Severity};
use nalgebra::{Rotation3, Unit, Vector3};
use std::sync::Arc;

/// Whose poses remove the material.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cuts {
    /// Those that the program means: a corrected tool follows them.
    Programmed,
    /// Those that the loaded arm takes on the way that the program commands.
    Deflected,
}

/// A stock that a program has cut.
#[derive(Debug)]
#[non_exhaustive]
pub struct Removal {
    /// What is left.
    pub stock: Stock,
    /// The stock's frame in the base.
    pub base_from_stock: Pose,
}

/// The force is asked for at least so often on the way into a target, m: engagement changes within a fraction of a cutter.
const ASK_EVERY: f64 = 2e-3;
/// And at most so many times.
const MOST_PLACES: usize = 500;
/// An arc is followed by chords of this length, m: half a hundredth of a millimetre off a radius of 6 mm.
const CHORD_OF_ARC: f64 = 0.5e-3;
/// A turn of the tool is followed in steps of this, rad.
const TURN: f64 = 0.05;
/// A joint move is followed in steps of this, rad: a centimetre at a metre.
const JOINT_STEP: f64 = 0.01;

/// More than this removed by a move that does not cut is a collision, m³: a twentieth of a cubic millimetre, against the
/// rounding of printed poses that lift off a surface just cut.
const COLLISION: f64 = 0.05e-9;

/// Without `resolution_mm`: this share of the smallest cutter's diameter, within a range, m.
const RESOLUTION_SHARE: f64 = 0.025;
const RESOLUTION: std::ops::RangeInclusive<f64> = 0.1e-3..=1e-3;

/// How far on from where a way begins its first force is asked for, m.
const START_ON: f64 = 0.25e-3;

/// The tool at an equilibrium is found so closely, m.
const SETTLED: f64 = 5e-7;
/// Rounds of force and deflection at one place.
const ROUNDS: usize = 15;

/// A place on the way into a target.
#[derive(Clone, Copy)]
struct Place {
    share: f64,
    /// Where the controller leads the TCP, work object of the target.
    pose: Pose,
}

/// Cuts the cell's stock with a prepared program, and puts the forces that follow from it into the points.
///
/// # Errors
/// A stock in a work object that nobody declares; moves that do not cut and run through material.
pub(super) fn run(
    program: &Program,
    cell: &Cell,
    prepared: &mut Prepared,
    cuts: Cuts,
) -> Result<Option<Removal>, Vec<Diagnostic>> {
    let Some(section) = &cell.stock else { return Ok(None) };
    let Some((mount, base_from_stock)) = stock_frame(program, cell, prepared)? else { return Ok(None) };
    let Some(blank) = &section.blank else {
        let name = section.stl.as_deref().unwrap_or_default();
        let unread = Diagnostic::error("cell.stock", "", format!("[stock] stl = \"{name}\" has not been read"));
        return Err(vec![unread.help("call Cell::take_meshes before the cell is used")]);
    };
    let smallest = prepared.fronts.iter().map(|front| 2.0 * front.solid().radius).fold(f64::INFINITY, f64::min);
    let resolution = section
        .resolution
        .unwrap_or_else(|| (RESOLUTION_SHARE * smallest).clamp(*RESOLUTION.start(), *RESOLUTION.end()));
    let mut walk = Walk {
        program,
        cell,
        cuts,
        stock: Stock::new(blank.clone(), resolution),
        mount,
        errors: Vec::new(),
        collided: false,
        bottoms: 0,
        first_bottom: None,
        peak: 0.0,
        bound: 0.0,
        last: None,
    };
    let fronts = prepared.fronts.clone();
    let mut cut_length = 0.0;
    for i in 0..prepared.points.len() {
        if Kind::of(program, i) == Kind::Point {
            continue;
        }
        walk.step(prepared, &fronts, i);
        let point = &mut prepared.points[i];
        if let Some(milled) = &point.milled {
            cut_length += milled.cut_length;
            point.cut_length = cut_length;
        }
        if let (Some(via), Some(milled)) = (i.checked_sub(1), prepared.points[i].milled.clone())
            && program.targets[via].role == Role::Via
        {
            let force = milled.at(0.5);
            prepared.points[via].cut_length = cut_length;
            if let (Some(force), Some(_)) = (force, prepared.points[via].through.and_then(|t| t.feed_per_tooth)) {
                prepared.points[via].load = load(force);
            }
        }
    }
    if !walk.errors.is_empty() {
        return Err(walk.errors);
    }
    if cuts == Cuts::Programmed {
        prepared.notes.extend(walk.notes(resolution, section.resolution.is_none()));
    }
    Ok(Some(Removal { stock: walk.stock, base_from_stock }))
}

/// The load of a force that follows from the stock, N, work object axes.
fn load(force: Vector3<f64>) -> PointLoad {
    if force == Vector3::zeros() { PointLoad::Air } else { PointLoad::Constant { force, follows: Follows::WorkObject } }
}

/// The stock's work object, and where it is in the base when it is cut first; `None` where nothing cuts.
fn stock_frame(program: &Program, cell: &Cell, prepared: &Prepared) -> Result<Option<(Mount, Pose)>, Vec<Diagnostic>> {
    let name = cell.stock.as_ref().and_then(|stock| stock.wobj.as_deref());
    let first = prepared.points.iter().position(|point| point.through.is_some_and(|through| through.cuts));
    let used = |i: usize| (prepared.mount(i).clone(), prepared.base_from_wobj(i));
    let Some(name) = name else { return Ok(first.map(used)) };
    if let Some(i) = (0..prepared.points.len())
        .find(|i| program.wobjs[usize::from(program.targets[*i].wobj)].name.eq_ignore_ascii_case(name))
    {
        return Ok(Some(used(i)));
    }
    let Some(i) = first else { return Ok(None) };
    let at = |frame| {
        let mount = Mount::new(cell, frame, *prepared.tool(i));
        let setting = mount.at(prepared.points[i].moved.as_ref()).unwrap_or(mount.setting);
        (mount, setting.base_from_wobj)
    };
    frames::wobj(program, cell, name).map(at).map(Some).ok_or_else(|| {
        vec![
            Diagnostic::error(
                "cell.stock",
                "",
                format!("[stock] wobj = \"{name}\" is declared neither in the program nor in the cell"),
            )
            .help(format!("add [wobjs.{name}] to the cell, or name the work object that the program uses")),
        ]
    })
}

/// Cuts the cell's stock with a program; errors and depth are counted from the original of a corrected one.
///
/// # Errors
/// What [`Prepared::new`] refuses, and a cell without `[stock]`.
pub fn cut_stock(
    program: &Program,
    cell: &Cell,
    options: &Options,
    original: Option<&Program>,
    cuts: Cuts,
) -> Result<Removal, Vec<Diagnostic>> {
    let mut prepared = match original {
        Some(original) => against::judged(program, original, cell, options)?.0,
        None => Prepared::new(program, cell, options)?,
    };
    run(program, cell, &mut prepared, cuts)?.ok_or_else(|| {
        let message = match &cell.stock {
            None => "the cell has no [stock] to cut",
            Some(_) => "nothing in the program cuts the stock",
        };
        vec![
            Diagnostic::error("cell.no-stock", "", message)
                .help("add [stock] with box_mm or stl to the cell, and a cutter for the tools that cut it"),
        ]
    })
}

struct Walk<'a> {
    program: &'a Program,
    cell: &'a Cell,
    cuts: Cuts,
    stock: Stock,
    /// The stock's work object.
    mount: Mount,
    errors: Vec<Diagnostic>,
    /// The move before was a collision: one is named of a run of them.
    collided: bool,
    /// Targets where a flat bottom goes down into material.
    bottoms: usize,
    first_bottom: Option<usize>,
    peak: f64,
    bound: f64,
    /// Where the tool before is: index of its point, and in the stock.
    last: Option<(usize, ToolPose)>,
}

impl Walk<'_> {
    /// Where the controller is to lead the TCP at a target.
    fn goal(&self, point: &Point) -> Pose {
        match self.cuts {
            Cuts::Programmed => point.reference,
            Cuts::Deflected => point.wobj_from_tcp,
        }
    }

    /// The work object of a point in the stock.
    fn stock_from_wobj(&self, prepared: &Prepared, i: usize) -> Pose {
        let point = &prepared.points[i];
        match &point.moved {
            Some(_) if self.mount.shares_wobj(prepared.mount(i)) => Pose::identity(),
            moved => {
                let setting = self.mount.at(moved.as_ref()).unwrap_or(self.mount.setting);
                setting.base_from_wobj.inverse() * prepared.base_from_wobj(i)
            }
        }
    }

    /// A TCP in the work object of a point, in the stock.
    fn tool(&self, prepared: &Prepared, i: usize, tip: &Vector3<f64>, axis: &Vector3<f64>) -> ToolPose {
        let stock_from_wobj = self.stock_from_wobj(prepared, i);
        ToolPose {
            tip: (stock_from_wobj * nalgebra::Point3::from(*tip)).coords,
            axis: Unit::new_normalize(stock_from_wobj.rotation * axis),
        }
    }

    /// The places on the way into target `i`, the last of them its own.
    fn places(&self, prepared: &Prepared, i: usize, asks: bool) -> (Vec<Place>, f64, Option<Track>) {
        let point = &prepared.points[i];
        let goal = self.goal(point);
        let end = Place { share: 1.0, pose: goal };
        let kind = Kind::of(self.program, i);
        let before = match kind {
            Kind::Arc => i.checked_sub(2),
            _ => i.checked_sub(1),
        };
        let Some(before) = before else { return (vec![end], 0.0, None) };
        let from = &prepared.points[before];
        if from.unsolved.is_some() || point.unsolved.is_some() {
            return (vec![end], 0.0, None);
        }
        let (setting, mount) = (prepared.setting(before), prepared.mount(i));
        if kind == Kind::Joint {
            let way = point.motor - from.motor;
            let n = ((way.amax() / JOINT_STEP).ceil() as usize).clamp(1, 4 * MOST_PLACES);
            let place = |k: usize| {
                let share = k as f64 / n as f64;
                let motor = from.motor + way * share;
                let moved = mount.between(from.moved.as_ref(), point.moved.as_ref(), share);
                let own = moved.as_ref().map_or(&mount.setting, |moved| &moved.setting);
                let base_from_tcp = self.cell.arm.robot.forward(&motor) * own.tool.flange_from_tcp;
                Place { share, pose: own.base_from_wobj.inv_mul(&base_from_tcp) }
            };
            let places = (0..n).map(place).chain([end]).collect();
            return (places, 0.0, None);
        }
        // The same flange, with this target's tool and work object.
        let base_from_flange = setting.base_from_wobj * self.goal(from) * setting.tool.flange_from_tcp.inverse();
        let own = mount.at(from.moved.as_ref());
        let start = if from.setting == point.setting || own.as_ref() == Some(setting) {
            self.goal(from)
        } else {
            let Some(own) = own else { return (vec![end], 0.0, None) };
            own.base_from_wobj.inv_mul(&(base_from_flange * own.tool.flange_from_tcp))
        };
        let track = match kind {
            Kind::Arc => Track::arc(&start, &self.goal(&prepared.points[i - 1]), &goal),
            _ => Track::line(&start, &goal),
        };
        let length = track.length();
        let turn = start.rotation.angle_to(&goal.rotation);
        let mut n = (turn / TURN).ceil().max(1.0);
        if track.is_arc() {
            n = n.max(length / CHORD_OF_ARC).min(20_000.0);
        } else if asks || self.cuts == Cuts::Deflected {
            n = n.max((length / ASK_EVERY).min(MOST_PLACES as f64));
        }
        let n = n.ceil() as usize;
        let place = |k: usize| {
            let share = k as f64 / n as f64;
            Place { share, pose: track.pose(share) }
        };
        let places = (0..n).map(place).chain([end]).collect();
        (places, length, Some(track))
    }

    fn step(&mut self, prepared: &mut Prepared, fronts: &[Arc<Front>], i: usize) {
        let point = &prepared.points[i];
        let Some(through) = point.through else {
            self.last = None;
            return;
        };
        let front = &fronts[through.front as usize];
        let feed_per_tooth = through.feed_per_tooth.filter(|_| through.cuts);
        let (places, length, _) = self.places(prepared, i, feed_per_tooth.is_some());
        let mut milled = Milled::default();
        let mut forces: Vec<(f64, Vector3<f64>)> = Vec::new();
        let mut removed = 0.0;
        let stock_from_wobj = self.stock_from_wobj(prepared, i).rotation;
        let to_wobj = stock_from_wobj.inverse();
        let mut motor = i.checked_sub(1).map_or(point.motor, |before| prepared.points[before].motor);
        let mut engaged = Engaged::default();
        let mut force = Vector3::zeros();
        // Deflection so far: of the tip, work object axes, and of the orientation.
        let mut bent = (Vector3::zeros(), Rotation3::identity());
        let mut last = self.last.filter(|(before, _)| {
            let same = prepared.points[*before].setting == prepared.points[i].setting;
            places.len() > 1 && same && self.cuts == Cuts::Deflected
        });
        for (k, place) in places.iter().enumerate() {
            let axis = tool_axis(&place.pose);
            let nominal = self.tool(prepared, i, &place.pose.translation.vector, &axis);
            let next = places.get(k + 1);
            let way = match (k.checked_sub(1).map(|k| &places[k]), next) {
                (Some(before), _) => place.pose.translation.vector - before.pose.translation.vector,
                (None, Some(next)) => next.pose.translation.vector - place.pose.translation.vector,
                (None, None) => Vector3::zeros(),
            };
            let way = stock_from_wobj * way;
            // Where the way begins, the front touches what has just been cut: a little on is what it meets.
            let on = if k == 0 && next.is_some() { way * (START_ON / way.norm()).min(0.5) } else { Vector3::zeros() };
            let ask = |stock: &Stock, tool: &ToolPose| match feed_per_tooth {
                Some(feed) if way.norm() > CHORD => {
                    let tool = ToolPose { tip: tool.tip + on, ..*tool };
                    let engaged = front.engaged(stock, &tool, &way);
                    (engaged, to_wobj * engaged.force.at(feed))
                }
                _ => (Engaged::default(), Vector3::zeros()),
            };
            let tool = if self.cuts == Cuts::Programmed || !through.cuts {
                (engaged, force) = ask(&self.stock, &nominal);
                nominal
            } else {
                if k + 1 < places.len() {
                    let before = i.checked_sub(1).and_then(|before| prepared.points[before].moved.as_ref());
                    let moved = prepared.mount(i).between(before, prepared.points[i].moved.as_ref(), place.share);
                    let setting = moved.map_or(prepared.mount(i).setting, |moved| moved.setting);
                    let flange = setting.base_from_wobj * place.pose * setting.tool.flange_from_tcp.inverse();
                    if let Ok(found) = self.cell.arm.robot.inverse_near(&flange, &motor) {
                        motor = found;
                    }
                } else {
                    motor = prepared.points[i].motor;
                }
                let own = if feed_per_tooth.is_some() { None } else { Some(prepared.situation(i)) };
                let base = Situation { wobj_from_tcp: place.pose, cutting: Cutting::Air, ..prepared.situation(i) };
                let travel = prepared.points[i].travel;
                let land = |force: &Vector3<f64>| {
                    let situation = match &own {
                        Some(own) => Situation { wobj_from_tcp: place.pose, ..*own },
                        None => Situation { cutting: Cutting::Constant(*force), ..base },
                    };
                    let there = self.cell.arm.predict(&situation, &motor, &travel).ok()?.wobj_from_tcp;
                    let shift = there.translation.vector - place.pose.translation.vector;
                    Some((shift, there.rotation * place.pose.rotation.inverse()))
                };
                let tool = |bent: &(Vector3<f64>, Rotation3<f64>)| {
                    self.tool(prepared, i, &(place.pose.translation.vector + bent.0), &(bent.1 * axis))
                };
                for round in 0..ROUNDS {
                    (engaged, force) = ask(&self.stock, &tool(&bent));
                    let Some(there) = land(&force) else { break };
                    let step = there.0 - bent.0;
                    // Later rounds go half way: a cut that comes and goes with the deflection swings.
                    let share = if round < 5 { 1.0 } else { 0.5 };
                    bent = (bent.0 + step * share, there.1);
                    if step.norm() < SETTLED {
                        break;
                    }
                }
                tool(&bent)
            };
            if k == 0 && places.len() > 1 {
                if feed_per_tooth.is_some() {
                    forces.push((0.0, force));
                }
                // The way goes on from where the tool has been.
                last = Some((i, last.map_or(tool, |(_, tool)| tool)));
                continue;
            }
            if feed_per_tooth.is_some() {
                forces.push((place.share, force));
                let bound = feed_per_tooth.map_or(0.0, |feed| engaged.bound[0] + feed * engaged.bound[1]);
                self.peak = self.peak.max(force.norm());
                self.bound = self.bound.max(bound);
            }
            if let Some((_, from)) = last
                && (through.cuts || self.cuts == Cuts::Programmed)
            {
                removed += self.stock.remove(front.solid(), &from, &tool);
            }
            last = Some((i, tool));
        }
        self.last = last;
        let collides = !through.cuts && removed > COLLISION;
        if collides && !self.collided {
            self.collision(i, removed);
        }
        self.collided = collides;
        if engaged.bottom {
            self.bottoms += 1;
            self.first_bottom.get_or_insert(i);
        }
        milled.removed = removed;
        milled.cut_length = if removed > COLLISION { length } else { 0.0 };
        if feed_per_tooth.is_some() {
            milled.engaged = Some([engaged.depth, engaged.arc]);
            milled.forces = forces.into();
        }
        let point = &mut prepared.points[i];
        if feed_per_tooth.is_some() {
            point.load = load(force);
        }
        point.milled = Some(milled);
    }

    fn collision(&mut self, i: usize, removed: f64) {
        let target = &self.program.targets[i];
        let source = &self.program.sources[usize::from(target.source)];
        let kind = match (Kind::of(self.program, i), target.feed_mm_s) {
            (Kind::Joint, _) => "a joint move",
            (_, None) if !target.rapid => "a move without a known speed, which counts as one that does not cut,",
            _ => "a move that does not cut",
        };
        let message = format!(
            "target {}: {kind} runs through the stock and would remove {:.2} mm³",
            target.ordinal,
            1e9 * removed
        );
        self.errors.push(Diagnostic::error("stock.rapid", "", message).on_line(source, target.span, target.line).help(
            "retract above the material first, or check [stock]: its box, its work object, and `max_cutting_feed_mm_s`",
        ));
    }

    fn notes(&self, resolution: f64, chosen: bool) -> Vec<Diagnostic> {
        let mut notes = Vec::new();
        let why = if chosen { ", from the smallest cutter" } else { "" };
        let share = if self.peak > 0.0 { 100.0 * self.bound / self.peak } else { 0.0 };
        let message = format!(
            "stock: lines {:.3} mm apart{why}; rims of the engagement put a force off by at most {:.1} N ({share:.1} % of the largest)",
            1e3 * resolution,
            self.bound
        );
        notes.push(Diagnostic::error("stock.resolution", "", message).severity(Severity::Note));
        if let Some(i) = self.first_bottom {
            let target = &self.program.targets[i];
            let source = &self.program.sources[usize::from(target.source)];
            let message = format!(
                "target {}: the flat bottom goes down into material{}: its own force is not in the model, only that of corner and side",
                target.ordinal,
                if self.bottoms > 1 { format!(" (and at {} targets more)", self.bottoms - 1) } else { String::new() }
            );
            notes.push(
                Diagnostic::error("stock.bottom", "", message)
                    .on_line(source, target.span, target.line)
                    .severity(Severity::Warning)
                    .help("ramp in gently, and count on more force there"),
            );
        }
        notes
    }
}
