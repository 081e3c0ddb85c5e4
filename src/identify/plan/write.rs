//! A plan as a RAPID program, and as a table to be filled in.

use super::PlannedRow;
use super::sheet::{Bench, Sheet};
use crate::cell::{Instrument, PlanSection};
use crate::identify::data::Blocks;
use crate::program::orientation::quaternion;
use crate::program::post::{Place, PostedPoint, RapidPlan, RapidPost};
use crate::program::{Mark, ToolData, WobjData};
use crate::robot::Pose;
use nalgebra::Vector3;
use std::fmt::Write;
use std::sync::Arc;

/// The rows, as they will be read.
pub(super) fn rows(bench: &Bench, sheet: &Sheet) -> Vec<PlannedRow> {
    let blocks = Blocks::of(&vec![None; sheet.rows.len()]);
    let points = bench.points(sheet);
    let row = |(i, point): (usize, &crate::correct::Point)| {
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

/// The program: each target a stop; straight ways where the arm can go them in one sweep, joint moves else.
pub(super) fn program(bench: &Bench, sheet: &Sheet, name: &str) -> String {
    let section = bench.section;
    let loaded = section.loads.iter().any(|load| *load != Vector3::zeros());
    let posted = (0..sheet.rows.len()).map(|i| {
        let row = sheet.rows[i];
        let (spot, load) = (&bench.spots[row.spot], section.loads[sheet.loads[i]]);
        let changes = i == 0 || sheet.loads[i - 1] != sheet.loads[i];
        let said = (loaded && changes).then(|| format!("! load from here on: {}, {}, {} N", load.x, load.y, load.z));
        let straight = i > 0 && bench.is_straight(&bench.spots[sheet.rows[i - 1].spot], spot);
        PostedPoint {
            position_mm: spot.position_mm,
            quat: spot.quat,
            conf: spot.conf,
            // RAPID has quarter turns instead.
            turns: [0; 3],
            speed_mm_s: row.speed * 1e3,
            rapid: false,
            stop: true,
            joint: !straight,
            lines: said.map(Arc::from),
            // Joint moves are taken for air else.
            mark: loaded.then_some(if load == Vector3::zeros() { Mark::Air } else { Mark::Cut }),
            tool: 0,
            wobj: 0,
            external: None,
        }
    });
    let posted: Vec<PostedPoint> = posted.collect();
    let mut speeds: Vec<f64> = posted.iter().map(|point| point.speed_mm_s).collect();
    speeds.sort_by(f64::total_cmp);
    speeds.dedup();
    let post = RapidPost::new(RapidPlan {
        units: Vec::new(),
        external: [None; crate::robot::EXTERNAL_AXES],
        name: name.to_owned(),
        title: vec![
            "Measurement plan: stop at each target, measure, go on.".to_owned(),
            "Row n of the table belongs to the n-th motion.".to_owned(),
        ],
        tools: vec![(section.tool.clone(), tool(bench))],
        wobjs: vec![(section.wobj.clone(), wobj(&bench.frames.world_from_wobj))],
        speeds,
        points: posted.len(),
        max_points: None,
        rapid_mm_s: 1e3 * super::SPEEDS[0],
        corner_tolerance_mm: 0.0,
    });
    let body = post.chunk(&Place::default(), &posted, Some(""));
    let bytes = [&post.head().bytes[..], &body.bytes[..]].concat();
    String::from_utf8_lossy(&bytes).into_owned()
}

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

/// The table with its measured columns empty.
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
