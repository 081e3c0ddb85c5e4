//! Rows that carry their own motor angles: whether they can be true, and where the instrument stood.

use super::data::{Blocks, Problem};
use super::device::Device;
use super::seen::{ELSEWHERE_MM, Seen};
use crate::cell::Cell;
use crate::correct::{Point, Prepared, named_tool};
use crate::effects::ToolFrame;
use crate::measured::{MeasuredRow, Table};
use crate::robot::{Joints, Pose, Robot};
use crate::text::Diagnostic;
use nalgebra::{Matrix3, Quaternion, Rotation3, Translation3, UnitQuaternion, Vector3};
use std::f64::consts::TAU;

/// Messages about rows before the rest is only counted.
const MESSAGES: usize = 20;
/// Half of the points' own spread: a registration that leaves more explains nothing.
const NOTHING: f64 = 0.5;
/// A reading must leave ten times less than the file's own to be what was meant.
const CLEARLY: f64 = 0.1;
/// Points this many medians off take no part in the registration.
const FAR: f64 = 5.0;
/// Orientations scatter less than this about the joints' own, median, rad: a robot's links are known better.
const ALIKE: f64 = 0.17;
/// Below this scatter, rad, orientations need no other reading.
const FINE: f64 = 3e-3;

/// One row as read.
struct Read<'a> {
    row: &'a MeasuredRow,
    motor: Joints,
    seen: Seen,
}

/// TCP by the joints, base axes, and as measured in the device's frame, m.
type Pair = (Vector3<f64>, Vector3<f64>);

impl Problem {
    /// Aligns rows that carry their own motor angles; the device's pose is unknown.
    pub(super) fn of_poses(cell: &Cell, tables: Vec<Table>, tool: Option<&str>) -> Result<Self, Vec<Diagnostic>> {
        let tool = match (tool, cell.tools.len()) {
            (Some(name), _) => Some(named_tool(cell, name)?),
            (None, 1) => cell.tools.values().next().copied(),
            (None, _) => None,
        };
        let Some(tool) = tool else {
            let message = "--poses needs the one tool that carries the reflector";
            return Err(vec![
                Diagnostic::error("identify.tool", "", message).help("declare one [tools.NAME], or give --tool NAME"),
            ]);
        };
        let mut problem = Self::empty(true);
        for table in tables {
            let table = &table;
            let rows = readable(&cell.arm.robot, table)?;
            let blocks = Blocks::of(&rows.iter().map(|read| read.row.holdout).collect::<Vec<_>>());
            let fitted: Vec<&Read> =
                rows.iter().enumerate().filter(|(i, _)| !blocks.held_out(*i)).map(|(_, read)| read).collect();
            let device = standing(&cell.arm.robot, &tool, table, &rows, &fitted)?;
            let mut points = Vec::with_capacity(rows.len());
            let mut previous = None;
            let run = problem.runs.len();
            for (order, Read { row, motor, seen }) in rows.iter().enumerate() {
                let travel = cell.arm.go_on(*motor, &mut previous).travel;
                let base_from_tcp = cell.arm.robot.forward(motor) * tool.flange_from_tcp;
                let mut point = Point::measured(base_from_tcp, *motor, travel);
                (point.time, point.temperature) = (row.time_s.unwrap_or(0.0), row.temperature_c);
                point.payload = row.payload_kg.unwrap_or(0.0);
                if let Some(force) = row.force_n {
                    point.set_force(force.into());
                }
                points.push(point);
                problem.push(run, order, order, row, *motor, travel, *seen, &blocks);
            }
            let turned: Vec<_> = device.iter().flat_map(|_| &rows).map(|read| orientation(read.row)).collect();
            problem.take_turns(run, &turned);
            problem.orientations +=
                if device.is_none() { rows.iter().filter(|r| r.row.quat.is_some()).count() } else { 0 };
            let mut prepared = Prepared::of_points(points, &cell.arm.robot, tool);
            if let Some((_, base_from_device)) = device {
                prepared.place_in(|_| base_from_device);
            }
            problem.runs.push(prepared);
            // Lengths alone have no frame: the base's will do.
            problem.devices.push(device.map_or(Device::Known, |(device, _)| device));
            problem.find_fixed_point(run, table)?;
        }
        problem.scale_weights(false);
        Ok(problem)
    }
}

/// Rows with all that a pose needs, each of which an arm could have been in.
fn readable<'a>(robot: &Robot, table: &'a Table) -> Result<Vec<Read<'a>>, Vec<Diagnostic>> {
    let mut rows = Vec::with_capacity(table.rows.len());
    let mut errors = Vec::new();
    for row in &table.rows {
        let seen = Seen::of(row).filter(|seen| !matches!(seen, Seen::Normal(_)) && seen.count() == seen.len());
        if row.probe_tool.is_some() {
            errors.push(
                at(table, row, "probe_tool says that the robot itself probed this row".to_owned())
                    .help("give such rows with --run and the program that cut the part"),
            );
            continue;
        }
        let (Some(deg), Some(seen)) = (row.motor_deg, seen) else {
            errors.push(
                at(table, row, "a row of --poses lacks its motor angles or what was measured".to_owned())
                    .help("it needs q1_deg … q6_deg, and x_mm, y_mm, z_mm or distance_mm"),
            );
            continue;
        };
        let motor = robot.motor_from_axes_deg(&deg);
        // The turns of an axis may be counted from elsewhere; no axis turns once more than its range.
        let limits = &robot.limits;
        let beyond = (0..6).find(|&j| !(limits.min[j] - TAU..=limits.max[j] + TAU).contains(&deg[j].to_radians()));
        match beyond {
            Some(j) => {
                let (min, max) = (limits.min[j].to_degrees(), limits.max[j].to_degrees());
                let message = format!("q{}_deg is {}, and the axis goes from {min:.0}° to {max:.0}°", j + 1, deg[j]);
                errors.push(at(table, row, message).help("remove the row, or give the motor's angle in degrees"));
            }
            None => rows.push(Read { row, motor, seen }),
        }
    }
    if rows.is_empty() && errors.is_empty() {
        errors.push(Diagnostic::error("measured.row", &table.file, "the file has no rows"));
    }
    cut(rows, errors)
}

/// The rows, or the first errors and how many more there are.
fn cut<T>(rows: T, mut errors: Vec<Diagnostic>) -> Result<T, Vec<Diagnostic>> {
    let more = errors.len().saturating_sub(MESSAGES);
    errors.truncate(MESSAGES);
    if let Some(last) = errors.last_mut().filter(|_| more > 0) {
        last.message = format!("{}; so are {more} more rows", last.message);
    }
    if errors.is_empty() { Ok(rows) } else { Err(errors) }
}

fn at(table: &Table, row: &MeasuredRow, message: String) -> Diagnostic {
    let mut diagnostic = Diagnostic::error("measured.row", &table.file, message);
    (diagnostic.line, diagnostic.column) = (usize::try_from(row.line).unwrap_or(0), 1);
    diagnostic
}

/// The measuring frame in the base, where rows have positions, and how the probe is mounted; refuses rows that it brings
/// nowhere near the arm.
fn standing(
    robot: &Robot,
    tool: &ToolFrame,
    table: &Table,
    rows: &[Read],
    fitted: &[&Read],
) -> Result<Option<(Device, Pose)>, Vec<Diagnostic>> {
    let pair = |read: &Read| match read.seen {
        Seen::Position(seen) => Some((tcp(robot, tool, &read.motor).translation.vector, seen * 1e-3)),
        _ => None,
    };
    let pairs: Vec<Pair> = fitted.iter().filter_map(|read| pair(read)).collect();
    if pairs.is_empty() {
        return Ok(None);
    }
    let base_from_device = registered(&pairs);
    if let Some(reason) = elsewhere(robot, tool, fitted, &pairs, &base_from_device) {
        return Err(vec![Diagnostic::error("measured.poses", &table.file, reason.0).help(reason.1)]);
    }
    let reach = (0..6).map(|i| robot.links.rows()[i]).map(|dh| dh.a.hypot(dh.d)).sum::<f64>()
        + tool.flange_from_tcp.translation.vector.norm();
    let mut errors = Vec::new();
    for read in rows {
        let Some(pair) = pair(read) else { continue };
        let off = gap(&base_from_device, &pair);
        if off > reach {
            let message = format!(
                "the measured point lies {:.0} mm from where these motor angles put the reflector, and the arm reaches {:.0} mm",
                1e3 * off,
                1e3 * reach
            );
            errors.push(at(table, read.row, message).help("remove the row, or correct its x_mm, y_mm, z_mm"));
        }
    }
    cut((), errors)?;
    let tcp_from_probe = mounted(robot, tool, fitted, &base_from_device)
        .map_err(|(message, help)| vec![Diagnostic::error("measured.poses", &table.file, message).help(help)])?;
    Ok(Some((Device::Frame { tcp_from_probe }, base_from_device)))
}

fn tcp(robot: &Robot, tool: &ToolFrame, motor: &Joints) -> Pose {
    robot.forward(motor) * tool.flange_from_tcp
}

fn gap(base_from_device: &Pose, (base, device): &Pair) -> f64 {
    (base_from_device.rotation * device + base_from_device.translation.vector - base).norm()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// What a file might have been meant as.
type Reading = fn(Joints, Vector3<f64>) -> (Joints, Vector3<f64>);

/// Why the points as a whole are not where the joints put them, and what to do; `None` if they are.
fn elsewhere(
    robot: &Robot,
    tool: &ToolFrame,
    fitted: &[&Read],
    pairs: &[Pair],
    base_from_device: &Pose,
) -> Option<(String, String)> {
    let off = median(pairs.iter().map(|pair| gap(base_from_device, pair)).collect());
    let middle = |of: fn(&Pair) -> Vector3<f64>| pairs.iter().map(of).sum::<Vector3<f64>>() / pairs.len() as f64;
    let (base, device) = (middle(|pair| pair.0), middle(|pair| pair.1));
    let spread = median(pairs.iter().map(|pair| (pair.0 - base).norm().max((pair.1 - device).norm())).collect());
    if off < (1e-3 * ELSEWHERE_MM).min(NOTHING * spread) {
        return None;
    }
    const READINGS: [(&str, Reading); 12] = [
        ("the angles are radians: give degrees", |q, p| (q.map(f64::to_degrees), p)),
        ("the positions are metres: multiply by 1000", |q, p| (q, p * 1e3)),
        ("the positions are inches: multiply by 25.4", |q, p| (q, p * 25.4)),
        ("x and y are swapped, or one axis of the device's frame has the wrong sign", |q, p| {
            (q, Vector3::new(p.y, p.x, p.z))
        }),
        ("the angles are radians and the positions metres", |q, p| (q.map(f64::to_degrees), p * 1e3)),
        ("the angles are radians and the positions inches", |q, p| (q.map(f64::to_degrees), p * 25.4)),
        ("q1_deg has the wrong sign", |q, p| (turned_over(q, 0), p)),
        ("q2_deg has the wrong sign", |q, p| (turned_over(q, 1), p)),
        ("q3_deg has the wrong sign", |q, p| (turned_over(q, 2), p)),
        ("q4_deg has the wrong sign", |q, p| (turned_over(q, 3), p)),
        ("q5_deg has the wrong sign", |q, p| (turned_over(q, 4), p)),
        ("q6_deg has the wrong sign", |q, p| (turned_over(q, 5), p)),
    ];
    let read_as = |reading: Reading| {
        let pair = |read: &&Read| match read.seen {
            Seen::Position(seen) => {
                let (motor, seen) = reading(read.motor, seen * 1e-3);
                Some((tcp(robot, tool, &motor).translation.vector, seen))
            }
            _ => None,
        };
        let pairs: Vec<Pair> = fitted.iter().filter_map(pair).collect();
        let base_from_device = registered(&pairs);
        median(pairs.iter().map(|pair| gap(&base_from_device, pair)).collect())
    };
    let meant = READINGS.iter().find(|(_, reading)| read_as(*reading) < CLEARLY * off);
    let message = format!(
        "measured points lie {:.1} mm (median) from where the motor angles put the reflector, wherever the device stands",
        1e3 * off
    );
    match meant {
        Some((reason, _)) => Some((message, (*reason).to_owned())),
        None if off > NOTHING * spread => {
            let help = "the rows belong to another robot or tool, or the motors are counted otherwise: compare [robot.kinematics]";
            Some((message, help.to_owned()))
        }
        // Far off, but following the joints: what is declared of the tool or the links is to be found.
        None => None,
    }
}

fn turned_over(mut motor: Joints, joint: usize) -> Joints {
    motor[joint] = -motor[joint];
    motor
}

fn orientation(row: &MeasuredRow) -> Option<UnitQuaternion<f64>> {
    row.quat.map(|[w, x, y, z]| UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z)))
}

/// How the probe is turned on the tool; refuses orientations that do not follow the joints, and says how they are meant.
fn mounted(
    robot: &Robot,
    tool: &ToolFrame,
    fitted: &[&Read],
    base_from_device: &Pose,
) -> Result<UnitQuaternion<f64>, (String, String)> {
    let turned: Vec<(Rotation3<f64>, UnitQuaternion<f64>)> = fitted
        .iter()
        .filter_map(|read| {
            let there = base_from_device.rotation.inverse() * tcp(robot, tool, &read.motor).rotation;
            Some((there, orientation(read.row)?))
        })
        .collect();
    if turned.is_empty() {
        return Ok(UnitQuaternion::identity());
    }
    type Meant = fn(UnitQuaternion<f64>) -> UnitQuaternion<f64>;
    let read_as = |meant: Meant| {
        let mounts: Vec<Rotation3<f64>> =
            turned.iter().map(|(there, seen)| there.inverse() * meant(*seen).to_rotation_matrix()).collect();
        let mean = mean_rotation(&mounts);
        let off = mounts.iter().map(|mount| UnitQuaternion::from_rotation_matrix(&(mean.inverse() * mount)).angle());
        (median(off.collect()), UnitQuaternion::from_rotation_matrix(&mean))
    };
    let (off, mount) = read_as(|q| q);
    const MEANINGS: [(&str, Meant); 3] = [
        ("they have the scalar last: qw is the first of four", scalar_last),
        ("they are inverse: give the probe in the device's frame", |q| q.inverse()),
        ("they are inverse and have the scalar last: qw is the first of four, the probe in the device's frame", |q| {
            scalar_last(q).inverse()
        }),
    ];
    let meant = MEANINGS.iter().find(|(_, meant)| off > FINE && read_as(*meant).0 < CLEARLY * off);
    let message =
        format!("measured orientations lie {:.1}° (median) from what the joints make of them", off.to_degrees());
    match meant {
        Some((reason, _)) => Err((message, (*reason).to_owned())),
        None if off > ALIKE => {
            let help = "qw, qx, qy, qz is the probe's orientation in the device's frame, scalar first; leave the columns out where there is none";
            Err((message, help.to_owned()))
        }
        None => Ok(mount),
    }
}

/// What four numbers are if the scalar is the last of them.
fn scalar_last(q: UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::new_unchecked(Quaternion::new(q.k, q.w, q.i, q.j))
}

/// The rotation nearest to all of some.
fn mean_rotation(all: &[Rotation3<f64>]) -> Rotation3<f64> {
    nearest_rotation(&all.iter().map(Rotation3::matrix).sum())
}

/// The rotation R of most trace(Rᵀ M): Kabsch (1976).
fn nearest_rotation(matrix: &Matrix3<f64>) -> Rotation3<f64> {
    // Static 3×3 decomposition: sound on planes too.
    let svd = matrix.svd(true, true);
    let (Some(u), Some(vt)) = (svd.u, svd.v_t) else { return Rotation3::identity() };
    let flip = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, (u * vt).determinant().signum()));
    Rotation3::from_matrix_unchecked(u * flip * vt)
}

/// Rigid registration, in which points far off take no part.
fn registered(pairs: &[Pair]) -> Pose {
    /// Enough for blunders of every size.
    const TRIMMING_ROUNDS: usize = 10;
    let mut kept = pairs.to_vec();
    let mut pose = registration(&kept);
    for _ in 0..TRIMMING_ROUNDS {
        let limit = (FAR * median(kept.iter().map(|pair| gap(&pose, pair)).collect())).max(1e-3 * ELSEWHERE_MM);
        let near: Vec<Pair> = pairs.iter().copied().filter(|pair| gap(&pose, pair) <= limit).collect();
        if near.len() == kept.len() {
            break;
        }
        kept = near;
        pose = registration(&kept);
    }
    pose
}

/// Rigid registration of points in the base (first) to points in the device (second), m: Kabsch.
fn registration(pairs: &[Pair]) -> Pose {
    let n = pairs.len().max(1) as f64;
    let base = pairs.iter().map(|pair| pair.0).sum::<Vector3<f64>>() / n;
    let device = pairs.iter().map(|pair| pair.1).sum::<Vector3<f64>>() / n;
    let rotation = nearest_rotation(&pairs.iter().map(|(b, d)| (b - base) * (d - device).transpose()).sum());
    Pose::from_parts(Translation3::from(base - rotation * device), rotation)
}
