//! CL input: corrected points to a RAPID program.

use super::{Corrected, Row, Status, frames};
use crate::cell::{Cell, CutForce};
use crate::program::post::{PostedPoint, RapidPlan, RapidWriter};
use crate::program::{Goal, Mark, Program, ToolData, WobjData};
use crate::robot::Pose;
use crate::text::{Diagnostic, Severity};
use std::collections::BTreeMap;
use std::io::{self, Write};

/// What the posted program has that CL data do not say.
#[derive(Clone, Debug)]
pub struct PostOptions {
    /// Name of the program; made an identifier.
    pub name: String,
    /// Lines of the head comment.
    pub title: Vec<String>,
    /// Most targets a module.
    pub max_targets: Option<usize>,
    /// Speed of rapid travel, mm/s.
    pub rapid_mm_s: f64,
    /// Speed of moves where the file has no feed at all, mm/s.
    pub feed_mm_s: Option<f64>,
}

/// How far a zone may pass a cutting corner, mm: below what a robot repeats.
const CORNER_TOLERANCE_MM: f64 = 0.05;

/// Writes the program; `open` gives the destination of a module's file by its name.
///
/// Moves before the file's first feed get that feed: slow, which is safe. Rapid travel and air are marked, so that the
/// posted program tells them apart again.
///
/// # Errors
/// No feed is known; what the destination reports, as a message.
pub fn post<W: Write>(
    program: &Program,
    cell: &Cell,
    corrected: &Corrected,
    options: &PostOptions,
    open: impl FnMut(&str) -> io::Result<W>,
) -> Result<(Vec<String>, Vec<Diagnostic>), Vec<Diagnostic>> {
    let source = program.sources.first();
    let name = source.map_or("", |s| s.name.as_str());
    let moves = || program.targets.iter().filter(|target| !target.rapid);
    let first_feed = moves().find_map(|target| target.feed_mm_s).or(options.feed_mm_s);
    let mut notes = Vec::new();
    if let (Some(early), Some(source)) = (moves().find(|target| target.feed_mm_s.is_none()), source) {
        let place = Diagnostic::error("post.feed", name, "this move has no feed").at(source, early.span);
        match first_feed {
            None => return Err(vec![place.help("add FEDRAT/ to the file, or give --feed MM_S")]),
            Some(feed) => notes.push(
                Diagnostic { message: format!("moves before the first feed get {feed} mm/s"), ..place }
                    .severity(Severity::Note),
            ),
        }
    }
    let first_feed = first_feed.unwrap_or(options.rapid_mm_s);
    let feed = |target: &crate::program::Target| target.feed_mm_s.unwrap_or(first_feed);
    let mut speeds: Vec<f64> = moves().map(feed).collect();
    speeds.sort_by(f64::total_cmp);
    speeds.dedup();
    let plan = RapidPlan {
        name: options.name.clone(),
        title: options.title.clone(),
        tools: program.tools.iter().map(|tool| (tool.name.to_string(), tool_data(cell, &tool.name))).collect(),
        wobjs: program.wobjs.iter().map(|wobj| (wobj.name.to_string(), wobj_data(cell, &wobj.name))).collect(),
        speeds,
        points: corrected.posted.len(),
        max_points: options.max_targets,
        rapid_mm_s: options.rapid_mm_s,
        corner_tolerance_mm: CORNER_TOLERANCE_MM,
    };
    let marks = Marks::new(program, cell, &corrected.rows);
    let failed = |error: io::Error| vec![Diagnostic::error("io.write", name, format!("cannot be posted: {error}"))];
    let mut writer = RapidWriter::new(plan, open).map_err(failed)?;
    for posted in &corrected.posted {
        let target = &program.targets[posted.target];
        let point = PostedPoint {
            position_mm: posted.position_mm,
            quat: posted.quat,
            conf: posted.conf,
            speed_mm_s: feed(target),
            rapid: target.rapid,
            stop: matches!(target.goal, Goal::Joints { .. }),
            mark: marks.of(target),
            tool: target.tool,
            wobj: target.wobj,
        };
        writer.point(&point).map_err(failed)?;
    }
    Ok((writer.finish().map_err(failed)?, notes))
}

/// Which targets cut, by ordinal; and what those get that have no mark of their own.
struct Marks(BTreeMap<u32, Mark>, Option<Mark>);

impl Marks {
    fn new(program: &Program, cell: &Cell, rows: &[Row]) -> Self {
        let no_force = cell.cut.as_ref().is_none_or(|cut| cut.force == CutForce::None);
        let mark = |row: &Row| (row.target, if row.status == Status::Ok { Mark::Cut } else { Mark::Air });
        if no_force {
            // Everything is air, which says nothing about the program; a mark ends the one of rapid travel.
            let cut = program.targets.iter().any(|target| target.rapid).then_some(Mark::Cut);
            return Self(BTreeMap::new(), cut);
        }
        Self(rows.iter().map(mark).collect(), None)
    }

    fn of(&self, target: &crate::program::Target) -> Option<Mark> {
        let air = target.rapid.then_some(Mark::Air);
        target.mark.or(air).or_else(|| self.0.get(&target.ordinal).copied()).or(self.1)
    }
}

fn tool_data(cell: &Cell, name: &str) -> ToolData {
    let tool = cell.tools.get(&name.to_ascii_uppercase());
    let (tcp_mm, tcp_quat) = frames::millimetres(&tool.map_or_else(Pose::identity, |tool| tool.flange_from_tcp));
    ToolData {
        robhold: true,
        tcp_mm,
        tcp_quat,
        mass_kg: tool.map_or(0.0, |tool| tool.mass),
        cog_mm: tool.map_or([0.0; 3], |tool| (tool.cog * 1e3).into()),
    }
}

fn wobj_data(cell: &Cell, name: &str) -> WobjData {
    let pose = cell.wobjs.get(&name.to_ascii_uppercase()).copied().unwrap_or_else(Pose::identity);
    let (uframe_mm, uframe_quat) = frames::millimetres(&pose);
    let oframe_quat = [1.0, 0.0, 0.0, 0.0];
    WobjData { robhold: false, fixed: true, uframe_mm, uframe_quat, oframe_mm: [0.0; 3], oframe_quat }
}
