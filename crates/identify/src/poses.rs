//! Reads rows that have their own motor angles (`--poses`): checks whether they can be correct, and finds the frame of
//! the instrument.

use super::data::{Blocks, Extent, Problem};
use super::device::Device;
use super::reading::{ELSEWHERE_MM, Reading};
use super::statistics::median;
use deflex_cell::Cell;
use deflex_correct::{Point, Prepared, named_tool};
use deflex_effects::ToolFrame;
use deflex_measured::{MeasuredRow, Table};
use deflex_robot::{Joints, Pose, Robot};
use deflex_text::Diagnostic;
use nalgebra::{Matrix3, Quaternion, Rotation3, Translation3, UnitQuaternion, Vector3};
use std::f64::consts::TAU;

/// Largest number of messages about rows; further errors are only counted.
const MESSAGES: usize = 20;
/// Median distance after registration, as a share of the spread of the points, from which on the points do not follow
/// the joints.
const NOTHING: f64 = 0.5;
/// Share to which another interpretation of the file must reduce the distances or angles to be the one that was meant.
const CLEARLY: f64 = 0.1;
/// Points that are this many medians off are left out of the registration.
const FAR: f64 = 5.0;
/// Largest median angle between measured orientations and those by the joints, rad: the links of a robot are known
/// better than that.
const ALIKE: f64 = 0.17;
/// Median angle below which no other interpretation of the orientations is tried, rad.
const FINE: f64 = 3e-3;

/// One row of the table with its motor angles, rad, and its reading.
struct PoseRow<'a> {
    row: &'a MeasuredRow,
    motor: Joints,
    reading: Reading,
}

/// Position of the TCP by the joints in the base frame, and as measured in the frame of the device, m.
type Pair = (Vector3<f64>, Vector3<f64>);

impl Problem {
    /// The problem of tables whose rows have their own motor angles. The pose of the device is unknown.
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
        let mut problem = Self::empty(Extent::Robot);
        for table in tables {
            let table = &table;
            let rows = readable(&cell.arm.robot, table)?;
            let blocks = Blocks::of(&rows.iter().map(|read| read.row.holdout).collect::<Vec<_>>());
            let fitted: Vec<&PoseRow> =
                rows.iter().enumerate().filter(|(i, _)| !blocks.held_out(*i)).map(|(_, read)| read).collect();
            let device = measuring_frame(&cell.arm.robot, &tool, table, &rows, &fitted)?;
            let mut points = Vec::with_capacity(rows.len());
            let mut previous = None;
            let run = problem.runs.len();
            for (order, PoseRow { row, motor, reading }) in rows.iter().enumerate() {
                let travel = cell.arm.go_on(*motor, Joints::zeros(), &mut previous).travel;
                let base_from_tcp = cell.arm.robot.forward(motor) * tool.flange_from_tcp;
                let mut point = Point::measured(base_from_tcp, *motor, travel);
                (point.time, point.temperature) = (row.time_s.unwrap_or(0.0), row.temperature_c);
                point.payload = row.payload_kg.unwrap_or(0.0);
                if let Some(force) = row.force_n {
                    point.set_force(force.into());
                }
                points.push(point);
                problem.push(run, order, order, row, *motor, travel, *reading, &blocks);
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
            // Lengths have no frame of their own, and are computed in that of the base.
            problem.devices.push(device.map_or(Device::Known, |(device, _)| device));
            problem.find_fixed_point(run, table)?;
        }
        problem.scale_weights(false);
        Ok(problem)
    }
}

/// The rows of a table, or errors if a row lacks its angles or its reading, or has angles that the arm does not reach.
fn readable<'a>(robot: &Robot, table: &'a Table) -> Result<Vec<PoseRow<'a>>, Vec<Diagnostic>> {
    let mut rows = Vec::with_capacity(table.rows.len());
    let mut errors = Vec::new();
    for row in &table.rows {
        let reading = Reading::of(row)
            .filter(|reading| !matches!(reading, Reading::Normal(_)) && reading.count() == reading.len());
        if row.probe_tool.is_some() {
            errors.push(
                row_error(table, row, "probe_tool says that the robot itself probed this row".to_owned())
                    .help("give such rows with --run and the program that cut the part"),
            );
            continue;
        }
        let (Some(deg), Some(reading)) = (row.motor_deg, reading) else {
            errors.push(
                row_error(table, row, "a row of --poses lacks its motor angles or what was measured".to_owned())
                    .help("it needs q1_deg … q6_deg, and x_mm, y_mm, z_mm or distance_mm"),
            );
            continue;
        };
        let motor = robot.motor_from_axes_deg(&deg);
        // An axis may be counted from another turn, so that angles up to one turn outside its range are allowed.
        let limits = &robot.limits;
        let beyond = (0..6).find(|&j| !(limits.min[j] - TAU..=limits.max[j] + TAU).contains(&deg[j].to_radians()));
        match beyond {
            Some(j) => {
                let (min, max) = (limits.min[j].to_degrees(), limits.max[j].to_degrees());
                let message = format!("q{}_deg is {}, and the axis goes from {min:.0}° to {max:.0}°", j + 1, deg[j]);
                errors
                    .push(row_error(table, row, message).help("remove the row, or give the motor's angle in degrees"));
            }
            None => rows.push(PoseRow { row, motor, reading }),
        }
    }
    if rows.is_empty() && errors.is_empty() {
        errors.push(Diagnostic::error("measured.row", &table.file, "the file has no rows"));
    }
    or_errors(rows, errors)
}

/// The result if there are no errors, or the first errors with the number of further ones.
fn or_errors<T>(result: T, mut errors: Vec<Diagnostic>) -> Result<T, Vec<Diagnostic>> {
    let more = errors.len().saturating_sub(MESSAGES);
    errors.truncate(MESSAGES);
    if let Some(last) = errors.last_mut().filter(|_| more > 0) {
        last.message = format!("{}; so are {more} more rows", last.message);
    }
    if errors.is_empty() { Ok(result) } else { Err(errors) }
}

/// An error at the line of a row.
fn row_error(table: &Table, row: &MeasuredRow, message: String) -> Diagnostic {
    let mut diagnostic = Diagnostic::error("measured.row", &table.file, message);
    (diagnostic.line, diagnostic.column) = (usize::try_from(row.line).unwrap_or(0), 1);
    diagnostic
}

/// The frame of the device in the base, with the orientation of the probe on the tool; `None` if the rows have no
/// positions.
///
/// # Errors
/// Rows whose positions do not follow the joints, or lie farther from the arm than it reaches.
fn measuring_frame(
    robot: &Robot,
    tool: &ToolFrame,
    table: &Table,
    rows: &[PoseRow],
    fitted: &[&PoseRow],
) -> Result<Option<(Device, Pose)>, Vec<Diagnostic>> {
    let pair = |read: &PoseRow| match read.reading {
        Reading::Position(measured) => {
            Some((tcp_by_joints(robot, tool, &read.motor).translation.vector, measured * 1e-3))
        }
        _ => None,
    };
    let pairs: Vec<Pair> = fitted.iter().filter_map(|read| pair(read)).collect();
    if pairs.is_empty() {
        return Ok(None);
    }
    let base_from_device = robust_registration(&pairs);
    if let Some(reason) = misplaced_points(robot, tool, fitted, &pairs, &base_from_device) {
        return Err(vec![Diagnostic::error("measured.poses", &table.file, reason.0).help(reason.1)]);
    }
    let reach = (0..6).map(|i| robot.links.rows()[i]).map(|dh| dh.a.hypot(dh.d)).sum::<f64>()
        + tool.flange_from_tcp.translation.vector.norm();
    let mut errors = Vec::new();
    for read in rows {
        let Some(pair) = pair(read) else { continue };
        let off = distance(&base_from_device, &pair);
        if off > reach {
            let message = format!(
                "the measured point lies {:.0} mm from where these motor angles put the reflector, and the arm reaches {:.0} mm",
                1e3 * off,
                1e3 * reach
            );
            errors.push(row_error(table, read.row, message).help("remove the row, or correct its x_mm, y_mm, z_mm"));
        }
    }
    or_errors((), errors)?;
    let tcp_from_probe = probe_orientation(robot, tool, fitted, &base_from_device)
        .map_err(|(message, help)| vec![Diagnostic::error("measured.poses", &table.file, message).help(help)])?;
    Ok(Some((Device::Frame { tcp_from_probe }, base_from_device)))
}

/// Pose of the TCP in the base frame by the motor angles, rad.
fn tcp_by_joints(robot: &Robot, tool: &ToolFrame, motor: &Joints) -> Pose {
    robot.forward(motor) * tool.flange_from_tcp
}

/// Distance of the two points of a pair, m.
fn distance(base_from_device: &Pose, (base, device): &Pair) -> f64 {
    (base_from_device.rotation * device + base_from_device.translation.vector - base).norm()
}

/// Another interpretation of the motor angles and positions of a file.
type Interpretation = fn(Joints, Vector3<f64>) -> (Joints, Vector3<f64>);

/// Why the points as a whole are not where the joints put them, and how to correct the file; `None` if they are there.
fn misplaced_points(
    robot: &Robot,
    tool: &ToolFrame,
    fitted: &[&PoseRow],
    pairs: &[Pair],
    base_from_device: &Pose,
) -> Option<(String, String)> {
    let off = median(pairs.iter().map(|pair| distance(base_from_device, pair)).collect());
    let middle = |of: fn(&Pair) -> Vector3<f64>| pairs.iter().map(of).sum::<Vector3<f64>>() / pairs.len() as f64;
    let (base, device) = (middle(|pair| pair.0), middle(|pair| pair.1));
    let spread = median(pairs.iter().map(|pair| (pair.0 - base).norm().max((pair.1 - device).norm())).collect());
    if off < (1e-3 * ELSEWHERE_MM).min(NOTHING * spread) {
        return None;
    }
    const INTERPRETATIONS: [(&str, Interpretation); 12] = [
        ("the angles are radians: give degrees", |q, p| (q.map(f64::to_degrees), p)),
        ("the positions are metres: multiply by 1000", |q, p| (q, p * 1e3)),
        ("the positions are inches: multiply by 25.4", |q, p| (q, p * 25.4)),
        ("x and y are swapped, or one axis of the device's frame has the wrong sign", |q, p| {
            (q, Vector3::new(p.y, p.x, p.z))
        }),
        ("the angles are radians and the positions metres", |q, p| (q.map(f64::to_degrees), p * 1e3)),
        ("the angles are radians and the positions inches", |q, p| (q.map(f64::to_degrees), p * 25.4)),
        ("q1_deg has the wrong sign", |q, p| (negated(q, 0), p)),
        ("q2_deg has the wrong sign", |q, p| (negated(q, 1), p)),
        ("q3_deg has the wrong sign", |q, p| (negated(q, 2), p)),
        ("q4_deg has the wrong sign", |q, p| (negated(q, 3), p)),
        ("q5_deg has the wrong sign", |q, p| (negated(q, 4), p)),
        ("q6_deg has the wrong sign", |q, p| (negated(q, 5), p)),
    ];
    let read_as = |interpretation: Interpretation| {
        let pair = |read: &&PoseRow| match read.reading {
            Reading::Position(measured) => {
                let (motor, measured) = interpretation(read.motor, measured * 1e-3);
                Some((tcp_by_joints(robot, tool, &motor).translation.vector, measured))
            }
            _ => None,
        };
        let pairs: Vec<Pair> = fitted.iter().filter_map(pair).collect();
        let base_from_device = robust_registration(&pairs);
        median(pairs.iter().map(|pair| distance(&base_from_device, pair)).collect())
    };
    let meant = INTERPRETATIONS.iter().find(|(_, other)| read_as(*other) < CLEARLY * off);
    let message = format!(
        "measured points lie {:.1} mm (median) from where the motor angles put the reflector, wherever the device stands",
        1e3 * off
    );
    match meant {
        Some((reason, _)) => Some((message, (*reason).to_owned())),
        None if off > NOTHING * spread => {
            let help = "the rows belong to another robot or tool, or the motor angles have other zeros or signs: compare [robot.kinematics]";
            Some((message, help.to_owned()))
        }
        // The points are far off but follow the joints: the identification can find what is wrong with the tool or the
        // links.
        None => None,
    }
}

/// Motor angles with the sign of one of them changed.
fn negated(mut motor: Joints, joint: usize) -> Joints {
    motor[joint] = -motor[joint];
    motor
}

/// The measured orientation of a row.
fn orientation(row: &MeasuredRow) -> Option<UnitQuaternion<f64>> {
    row.quat.map(|[w, x, y, z]| UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z)))
}

/// Orientation of the probe on the tool; the identity if no orientations were measured.
///
/// # Errors
/// Orientations that do not follow the joints: a message, and how to correct the file.
fn probe_orientation(
    robot: &Robot,
    tool: &ToolFrame,
    fitted: &[&PoseRow],
    base_from_device: &Pose,
) -> Result<UnitQuaternion<f64>, (String, String)> {
    let turned: Vec<(Rotation3<f64>, UnitQuaternion<f64>)> = fitted
        .iter()
        .filter_map(|read| {
            let there = base_from_device.rotation.inverse() * tcp_by_joints(robot, tool, &read.motor).rotation;
            Some((there, orientation(read.row)?))
        })
        .collect();
    if turned.is_empty() {
        return Ok(UnitQuaternion::identity());
    }
    type Meant = fn(UnitQuaternion<f64>) -> UnitQuaternion<f64>;
    let read_as = |meant: Meant| {
        let mounts: Vec<Rotation3<f64>> =
            turned.iter().map(|(there, measured)| there.inverse() * meant(*measured).to_rotation_matrix()).collect();
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
    let message = format!(
        "measured orientations differ by {:.1}° (median) from those that the motor angles give",
        off.to_degrees()
    );
    match meant {
        Some((reason, _)) => Err((message, (*reason).to_owned())),
        None if off > ALIKE => {
            let help = "qw, qx, qy, qz is the probe's orientation in the device's frame, scalar first; leave the columns out where there is none";
            Err((message, help.to_owned()))
        }
        None => Ok(mount),
    }
}

/// The orientation that four numbers mean if the scalar is the last of them.
fn scalar_last(q: UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::new_unchecked(Quaternion::new(q.k, q.w, q.i, q.j))
}

/// The mean of rotations: the rotation for which the sum of their squared distances is smallest.
fn mean_rotation(all: &[Rotation3<f64>]) -> Rotation3<f64> {
    nearest_rotation(&all.iter().map(Rotation3::matrix).sum())
}

/// The rotation R with the largest trace(Rᵀ M) (Kabsch 1976).
fn nearest_rotation(matrix: &Matrix3<f64>) -> Rotation3<f64> {
    // The singular value decomposition is also defined for a singular matrix, which points in a plane give.
    let svd = matrix.svd(true, true);
    let (Some(u), Some(vt)) = (svd.u, svd.v_t) else { return Rotation3::identity() };
    let flip = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, (u * vt).determinant().signum()));
    Rotation3::from_matrix_unchecked(u * flip * vt)
}

/// Rigid registration without the points that are far off.
fn robust_registration(pairs: &[Pair]) -> Pose {
    /// Largest number of rounds, enough for blunders of several sizes.
    const TRIMMING_ROUNDS: usize = 10;
    let mut kept = pairs.to_vec();
    let mut pose = registration(&kept);
    for _ in 0..TRIMMING_ROUNDS {
        let limit = (FAR * median(kept.iter().map(|pair| distance(&pose, pair)).collect())).max(1e-3 * ELSEWHERE_MM);
        let near: Vec<Pair> = pairs.iter().copied().filter(|pair| distance(&pose, pair) <= limit).collect();
        if near.len() == kept.len() {
            break;
        }
        kept = near;
        pose = registration(&kept);
    }
    pose
}

/// The pose of the device in the base that brings the points of the pairs together with the least sum of squared
/// distances (Kabsch 1976).
fn registration(pairs: &[Pair]) -> Pose {
    let n = pairs.len().max(1) as f64;
    let base = pairs.iter().map(|pair| pair.0).sum::<Vector3<f64>>() / n;
    let device = pairs.iter().map(|pair| pair.1).sum::<Vector3<f64>>() / n;
    let rotation = nearest_rotation(&pairs.iter().map(|(b, d)| (b - base) * (d - device).transpose()).sum());
    Pose::from_parts(Translation3::from(base - rotation * device), rotation)
}
