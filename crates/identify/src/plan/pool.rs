//! The spots among which a plan chooses: poses that the arm reaches well within its limits, away from singular wrists,
//! on one branch.

use super::Frames;
use super::draws::halton;
use deflex_cell::{Cell, PlanSection};
use deflex_correct::{Options, Prepared};
use deflex_measured::Forces;
use deflex_program::orientation::quaternion;
use deflex_program::{Confdata, Program, Role, Target};
use deflex_robot::{Joints, Pose, Robot, confdata_of};
use deflex_text::Diagnostic;
use nalgebra::{Rotation3, Translation3, Unit, UnitQuaternion, Vector3};
use std::f64::consts::{PI, TAU};

/// Largest number of spots.
const POSES: usize = 600;
/// Largest number of poses that are tried to find them.
const TRIED: usize = 20_000;
/// Number of poses by which each posture in the middle of the box is judged.
const JUDGED: usize = 150;
/// Number of turns about the tool axis that are tried in the middle of the box.
const SPINS: usize = 8;
/// Smallest angle of axis 5 from zero, where axes 4 and 6 line up, rad.
const SINGULAR: f64 = 0.2;
/// Smallest angle of every axis to its limits, rad.
const MARGIN: f64 = 0.04;
/// Largest angle of every axis from its angle in the middle of the box, rad. Between two spots no axis then turns so
/// far that another branch, or another turn of an axis, would be nearer.
const REACH: f64 = 1.3;

/// A pose to which the tool can be sent.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Spot {
    /// Position of the TCP in the work object, mm, with the digits of the program.
    pub(super) position_mm: [f64; 3],
    /// Orientation of the TCP in the work object, scalar first.
    pub(super) quat: [f64; 4],
    pub(super) wobj_from_tcp: Pose,
    /// Motor angles, rad.
    pub(super) motor: Joints,
    pub(super) conf: Confdata,
}

impl Spot {
    /// The spot of a pose and its motor angles, rad.
    pub(super) fn of(robot: &Robot, wobj_from_tcp: Pose, motor: Joints) -> Self {
        Self {
            position_mm: (wobj_from_tcp.translation.vector * 1e3).into(),
            quat: quaternion(&wobj_from_tcp.rotation),
            wobj_from_tcp,
            motor,
            conf: confdata_of(robot, &motor),
        }
    }
}

/// Spots in the box of `[plan]`.
pub(super) fn spots(cell: &Cell, section: &PlanSection, frames: &Frames) -> Vec<Spot> {
    let robot = &cell.arm.robot;
    let reach = |pose: &Pose, about: &Joints| {
        let motor = robot.inverse_near(&frames.base_from_flange(pose), about).ok()?;
        is_safe(robot, &motor, about).then(|| Spot::of(robot, *pose, motor))
    };
    let among = |about: &Joints, tried: usize, most: usize| {
        (1..=tried).filter_map(|index| reach(&pose(section, index), about)).take(most).collect::<Vec<_>>()
    };
    // The spots are those about the posture in the middle of the box from which most poses are reached.
    let middle = 0.5 * (section.workspace[0] + section.workspace[1]);
    let postures = (0..SPINS).flat_map(|spin| {
        let pose = tool_at(middle, 0.0, 0.0, TAU * spin as f64 / SPINS as f64);
        let flange = frames.base_from_flange(&pose);
        match &cell.start {
            Some(start) => robot.inverse_near(&flange, start).into_iter().collect(),
            None => robot.inverse_all(&flange).unwrap_or_default(),
        }
    });
    let near = cell.start.unwrap_or_else(|| robot.home());
    let ranked = postures.map(|about| (among(&about, JUDGED, JUDGED).len(), (about - near).norm(), about));
    let best = ranked.max_by(|a, b| a.0.cmp(&b.0).then(b.1.total_cmp(&a.1)));
    best.map(|(.., about)| among(&about, TRIED, POSES)).unwrap_or_default()
}

/// Whether the arm may have these motor angles in a program about the posture `about`: within its limits, near that
/// posture, on its branch, and away from a singular wrist.
fn is_safe(robot: &Robot, motor: &Joints, about: &Joints) -> bool {
    let wider = [MARGIN, -MARGIN].map(|step| robot.limit_violation(&motor.map(|angle| angle + step)).is_none());
    wider == [true; 2]
        && (motor - about).amax() <= REACH
        && motor[4].abs() >= SINGULAR
        && (motor[4] < 0.0) == (about[4] < 0.0)
        && robot.posture(motor) == robot.posture(about)
}

/// Pose number `index` of a sequence within the box and the tilt of `[plan]`. Places are denser towards the faces of
/// the box, and tilts towards the largest tilt, because effects are largest there.
fn pose(section: &PlanSection, index: usize) -> Pose {
    let towards_ends = |share: f64| 0.5 - 0.5 * (PI * share).cos();
    let [low, high] = section.workspace;
    let place = Vector3::from_fn(|k, _| low[k] + (high[k] - low[k]) * towards_ends(halton(index, [2, 3, 5][k])));
    let lean = section.tilt * halton(index, 7).sqrt();
    tool_at(place, lean, TAU * halton(index, 11), TAU * halton(index, 13))
}

/// The pose of a tool at a place, m, in the work object. The tool axis points down and leans by `lean` about a
/// horizontal axis in `direction`; the tool is turned by `spin` about its own axis. All angles are in rad.
fn tool_at(place: Vector3<f64>, lean: f64, direction: f64, spin: f64) -> Pose {
    let about = Unit::new_unchecked(Vector3::new(direction.cos(), direction.sin(), 0.0));
    let down = Rotation3::from_axis_angle(&Vector3::x_axis(), PI);
    let rotation =
        Rotation3::from_axis_angle(&about, lean) * down * Rotation3::from_axis_angle(&Vector3::z_axis(), spin);
    // The pose is rounded to the digits that the program has.
    let mm = place.map(|v| (v * 1e7).round() * 1e-7);
    let quat = UnitQuaternion::from_rotation_matrix(&rotation).coords.map(|v| (v * 1e8).round() * 1e-8);
    let rotation = UnitQuaternion::new_normalize(quat.into()).to_rotation_matrix();
    Pose::from_parts(Translation3::from(mm), rotation)
}

/// The targets of programs that the arm can safely take. A note counts those with another tool or work object than the
/// plan, which are left out.
pub(super) fn of_programs(
    cell: &Cell,
    section: &PlanSection,
    programs: &[Program],
    notes: &mut Vec<String>,
) -> Result<Vec<Spot>, Vec<Diagnostic>> {
    let robot = &cell.arm.robot;
    let mut spots: Vec<Spot> = Vec::new();
    let mut others = 0;
    for program in programs {
        // The forces are left out, because the commanded posture does not depend on them.
        let options = Options { forces: Some(Forces::none()), ..Options::default() };
        let prepared = Prepared::new(program, cell, &options)?;
        // Targets with external axes are left out, because their places depend on more than the arm.
        let known = |&(i, target): &(usize, &Target)| {
            target.role == Role::End && target.external.is_none() && prepared.unsolved(i).is_none()
        };
        for (i, target) in program.targets.iter().enumerate().filter(known) {
            let point = &prepared.points[i];
            let tool = &program.tools[usize::from(target.tool)].name;
            let wobj = &program.wobjs[usize::from(target.wobj)].name;
            if !tool.eq_ignore_ascii_case(&section.tool) || !wobj.eq_ignore_ascii_case(&section.wobj) {
                others += 1;
            } else if is_safe(robot, &point.motor, &point.motor) {
                spots.push(Spot::of(robot, point.wobj_from_tcp, point.motor));
            }
        }
    }
    if others > 0 {
        notes.push(format!(
            "{others} targets of the pool have another tool or work object than `{}` and `{}` of [plan]: left out",
            section.tool, section.wobj
        ));
    }
    Ok(spots)
}
