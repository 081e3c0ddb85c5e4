//! Writes a plan as a program of the cell's controller, and as a table that the operator fills in.

use super::sheet::{Bench, DWELL_S, Sheet};
use super::{Ask, PlanProgram, PlannedRow};
use crate::data::Blocks;
use deflex_cell::{Instrument, PlanSection};
use deflex_program::orientation::quaternion;
use deflex_program::post::{PostPlan, PostWriter, PostedPoint, Templates, WriterPosition, refuse_names};
use deflex_program::{ActionKind, Language, Mark, ToolData, WobjData};
use deflex_robot::{Pose, config_of};
use deflex_text::Diagnostic;
use nalgebra::Vector3;
use std::fmt::Write;
use std::sync::Arc;

/// The rows of a plan, as `identify` will read them.
pub(super) fn rows(bench: &Bench, sheet: &Sheet) -> Vec<PlannedRow> {
    let blocks = Blocks::of(&vec![None; sheet.rows.len()]);
    let points = bench.points(sheet);
    let row = |(i, point): (usize, &deflex_correct::Point)| {
        let spot = &bench.spots[sheet.rows[i].spot];
        PlannedRow {
            target: u32::try_from(i + 1).unwrap_or(u32::MAX),
            position_mm: spot.position_mm,
            quat: spot.quat,
            axes_deg: bench.arm.robot.axes_deg_from_motor(&spot.motor),
            load_n: bench.section.loads[sheet.loads[i]].into(),
            time_s: point.time,
            held_out: blocks.held_out(i),
        }
    };
    points.iter().enumerate().map(row).collect()
}

/// The program. The arm stops and waits at each target. It moves in a straight line where [`Bench::is_straight`] allows
/// it, and with a joint motion elsewhere.
///
/// # Errors
/// A tool or a work object whose name the language has no place for.
pub(super) fn program(bench: &Bench, sheet: &Sheet, how: &PlanProgram) -> Result<String, Vec<Diagnostic>> {
    let section = bench.section;
    let lines_of = Lines { language: how.language, loaded: section.loads.iter().any(|load| *load != Vector3::zeros()) };
    let count = sheet.rows.len();
    // The lines between the motion to row i − 1 and the motion to row i.
    let between = |i: usize| {
        let changes = i < count && (i == 0 || sheet.loads[i - 1] != sheet.loads[i]);
        let load = |i: usize| section.loads[sheet.loads[i]];
        let mut lines = Vec::new();
        if i > 0 {
            lines.extend(match how.ask {
                Ask::Target => lines_of.message("Measure, then go on."),
                _ => vec![lines_of.wait()],
            });
        }
        if changes && lines_of.loaded {
            lines.push(lines_of.remark(&format!("load from here on: {}", in_newtons(&load(i)))));
            if how.ask != Ask::Never {
                lines.extend(lines_of.message(&format!("Load {}", in_newtons(&load(i)))));
            }
        }
        lines.join("\n")
    };
    let robot = &bench.arm.robot;
    let posted = (0..count).map(|i| {
        let row = sheet.rows[i];
        let (spot, load) = (&bench.spots[row.spot], section.loads[sheet.loads[i]]);
        let straight = i > 0 && bench.is_straight(&bench.spots[sheet.rows[i - 1].spot], spot);
        PostedPoint {
            position_mm: spot.position_mm,
            quat: spot.quat,
            conf: spot.conf,
            turns: config_of(robot, &spot.motor).turns,
            speed_mm_s: row.speed * 1e3,
            rapid: false,
            stop: true,
            joint: !straight,
            lines: Some(between(i)).filter(|lines| !lines.is_empty()).map(Arc::from),
            // Without a mark joint motions would be read as air.
            mark: lines_of.loaded.then_some(if load == Vector3::zeros() { Mark::Air } else { Mark::Cut }),
            tool: 0,
            wobj: 0,
            external: None,
        }
    });
    let posted: Vec<PostedPoint> = posted.collect();
    let mut speeds: Vec<f64> = posted.iter().map(|point| point.speed_mm_s).collect();
    speeds.sort_by(f64::total_cmp);
    speeds.dedup();
    // Controllers that count from the robot's base have no world frame.
    let world_from_wobj = bench.frames.world_from_wobj;
    let in_base = how.language.robot_base().is_some();
    let frame = if in_base { robot.world_from_base.inverse() * world_from_wobj } else { world_from_wobj };
    let plan = PostPlan {
        units: Vec::new(),
        external: [None; deflex_robot::EXTERNAL_AXES],
        name: how.name.to_owned(),
        title: vec![
            "Measurement plan: wait at each target, measure.".to_owned(),
            "Row n of the table belongs to the n-th motion.".to_owned(),
        ],
        tools: vec![(section.tool.clone(), tool(bench))],
        wobjs: vec![(section.wobj.clone(), wobj(&frame))],
        speeds,
        points: posted.len(),
        max_points: None,
        rapid_mm_s: 1e3 * super::SPEEDS[0],
        speed_unit: bench.speed_unit,
        corner_tolerance_mm: 0.0,
    };
    refuse_names(&plan, how.language)?;
    let post = PostWriter::new(plan);
    let end = between(count);
    let bytes = match how.language.about().post.write {
        Some(write) => {
            let axes = sheet.rows.iter().map(|row| robot.axes_deg_from_motor(&bench.spots[row.spot].motor));
            one(write(&post, &posted, &axes.collect::<Vec<_>>(), &end)?)
        }
        None => {
            let body = post.chunk(&WriterPosition::default(), &posted, Some(&end));
            [&post.head().bytes[..], &body.bytes[..]].concat()
        }
    };
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

/// The only file of a program that is not split.
fn one(files: Vec<(String, Vec<u8>)>) -> Vec<u8> {
    files.into_iter().next().map(|(_, bytes)| bytes).unwrap_or_default()
}

fn in_newtons(load: &Vector3<f64>) -> String {
    format!("{}, {}, {} N", load.x, load.y, load.z)
}

/// Writes the lines of a program that are no motions.
struct Lines {
    language: Language,
    /// Whether any row is under a load.
    loaded: bool,
}

impl Lines {
    /// A comment.
    fn remark(&self, text: &str) -> String {
        format!("{} {text}", char::from(self.language.comment().unwrap_or(b'!')))
    }

    /// An instruction to wait until the row is measured.
    fn wait(&self) -> String {
        let dwell = ActionKind::Dwell { seconds: DWELL_S };
        Templates::default().lines(&dwell, "", self.language).unwrap_or_default()
    }

    /// A message that the operator has to acknowledge before the program continues.
    fn message(&self, text: &str) -> Vec<String> {
        (self.language.about().post.stops_with_message)(text)
    }
}

/// Position, mm, and quaternion of a pose.
fn frame(pose: &Pose) -> ([f64; 3], [f64; 4]) {
    ((pose.translation.vector * 1e3).into(), quaternion(&pose.rotation))
}

fn tool(bench: &Bench) -> ToolData {
    let tool = &bench.frames.tool;
    let (tcp_mm, tcp_quat) = frame(&tool.flange_from_tcp);
    ToolData { robhold: true, tcp_mm, tcp_quat, mass_kg: tool.mass, cog_mm: (tool.cog * 1e3).into() }
}

fn wobj(world_from_wobj: &Pose) -> WobjData {
    let (uframe_mm, uframe_quat) = frame(world_from_wobj);
    let (oframe_mm, oframe_quat) = ([0.0; 3], [1.0, 0.0, 0.0, 0.0]);
    WobjData { robhold: false, fixed: true, uframe_mm, uframe_quat, oframe_mm, oframe_quat }
}

/// The table of a plan, with empty measured columns.
pub(super) fn table(section: &PlanSection, rows: &[PlannedRow]) -> String {
    let (columns, empty) = match section.instrument {
        Instrument::Position => ("x_mm,y_mm,z_mm", ",,"),
        Instrument::Normal => ("normal_mm", ""),
        Instrument::Distance => ("distance_mm", ""),
    };
    let mut out = format!("target,{columns},fx_n,fy_n,fz_n,time_s\n");
    for PlannedRow { target, load_n: [x, y, z], time_s, .. } in rows {
        // Writing to a String cannot fail.
        let _ = writeln!(out, "{target},{empty},{x},{y},{z},{time_s:.1}");
    }
    out
}
