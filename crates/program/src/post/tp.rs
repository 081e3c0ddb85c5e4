//! Writes points as FANUC TP programs in text form.

use super::plan::PostPlan;
use super::statements::Statements;
use super::zone::{FINE, is_nearly_straight, zone};
use super::{PostedPoint, names};
use crate::orientation::{from_zyx_deg, quaternion, rotation, zyx_deg};
use crate::token::single;
use crate::tp::MOST_POINTS;
use crate::{Config, Language};
use deflex_text::Diagnostic;
use deflex_text::number::{printed, write_fixed};
use std::fmt::Write;

/// Decimals of millimetres and degrees, as controllers print them.
const DECIMALS: usize = 3;
/// Speed of J motions, per cent: CL data state none.
const JOINT_PERCENT: u32 = 20;
/// Characters of a program name that are reserved for an ending (`_12`).
const ENDING: usize = 4;

/// The statements of FANUC TP in posted programs.
pub(crate) const STATEMENTS: Statements = Statements {
    dwell: |seconds| format!("WAIT {seconds:.2}(sec)"),
    stops_with_message: |text| {
        /// Most characters of a TP message.
        const MESSAGE: usize = 24;
        let short: String = text.replace(',', "").chars().take(MESSAGE).collect();
        vec![format!("MESSAGE[{short}]"), "PAUSE".to_owned()]
    },
    write: Some(|post, points, _, end| programs(post.plan(), points, end)),
    held: Some(held_pose),
    without_axes: Some("FANUC TP is posted without external axes: their motion group is not known"),
    ..Statements::RAPID
};

/// A pose (mm, scalar first) that is printed as X … R, in the controller's precision.
pub(crate) fn held_pose(mm: [f64; 3], quat: [f64; 4]) -> ([f64; 3], [f64; 4]) {
    let held = |value: f64| single(printed(value, DECIMALS));
    (mm.map(held), quaternion(&from_zyx_deg(zyx_deg(&rotation(quat)).map(held))))
}

/// Writes a program: one file, or parts and a program that calls them in turn.
///
/// # Errors
/// A tool or a work object whose name is not a number (`UT 1`, `UF 1`).
pub(crate) fn programs(
    plan: &PostPlan,
    points: &[PostedPoint],
    end: &str,
) -> Result<Vec<(String, Vec<u8>)>, Vec<Diagnostic>> {
    names::refuse(plan, Language::Ls)?;
    let tools: Vec<u32> = plan.tools.iter().filter_map(|(name, _)| names::number(name, "UT")).collect();
    let wobjs: Vec<u32> = plan.wobjs.iter().filter_map(|(name, _)| names::number(name, "UF")).collect();
    let name = names::identifier(&plan.name, ENDING).to_ascii_uppercase();
    let most = plan.max_points.unwrap_or(MOST_POINTS).clamp(1, MOST_POINTS);
    let parts: Vec<&[PostedPoint]> = points.chunks(most).collect();
    let mut writer = Writer { plan, points, tools: &tools, wobjs: &wobjs };
    if parts.len() <= 1 {
        let text = writer.part(&name, 0, points.len(), end);
        return Ok(vec![(format!("{name}.ls"), text)]);
    }
    let mut main = Lines::default();
    plan.title.iter().for_each(|line| main.remark(line));
    let mut files = Vec::new();
    for (i, part) in parts.iter().enumerate() {
        let part_name = format!("{name}_{}", i + 1);
        main.add(&format!("  CALL {part_name}    "));
        let last = if i + 1 == parts.len() { end } else { "" };
        files.push((format!("{part_name}.ls"), writer.part(&part_name, i * most, i * most + part.len(), last)));
    }
    files.insert(0, (format!("{name}.ls"), main.program(&name, "")));
    Ok(files)
}

struct Writer<'a> {
    plan: &'a PostPlan,
    points: &'a [PostedPoint],
    tools: &'a [u32],
    wobjs: &'a [u32],
}

impl Writer<'_> {
    /// The points from one to another as a program.
    fn part(&mut self, name: &str, from: usize, to: usize, end: &str) -> Vec<u8> {
        let (mut lines, mut positions) = (Lines::default(), String::new());
        if from == 0 {
            self.plan.title.iter().for_each(|line| lines.remark(line));
        }
        let (mut frames, mut mark) = (None, None);
        for at in from..to {
            let point = &self.points[at];
            let number = at - from + 1;
            let now = (self.wobjs[usize::from(point.wobj)], self.tools[usize::from(point.tool)]);
            let selects =
                |line: &str| ["CALL", "UFRAME", "UTOOL"].iter().any(|word| line.to_ascii_uppercase().contains(word));
            let is_changed = point.lines.iter().flat_map(|text| text.lines()).any(selects);
            point.lines.iter().flat_map(|text| text.lines()).for_each(|line| lines.instruction(line));
            // A program that is called here, such as a change of the tool, may select others.
            if frames != Some(now) || is_changed {
                lines.add(&format!("  UFRAME_NUM={}", now.0));
                lines.add(&format!("  UTOOL_NUM={}", now.1));
                frames = Some(now);
            }
            if mark != point.mark {
                point.mark.iter().for_each(|mark| lines.add(&format!("  !{}", mark.comment())));
                mark = point.mark;
            }
            // The path to the first point is unknown: a joint motion, not a straight line.
            let stop = self.stop(at, to);
            if at == 0 || point.joint {
                lines.add(&format!("J P[{number}] {JOINT_PERCENT}% {stop}    "));
            } else {
                let speed = if point.rapid { self.plan.rapid_mm_s } else { point.speed_mm_s };
                lines.add(&format!("L P[{number}] {}mm/sec {stop}    ", tenths(speed)));
            }
            position(&mut positions, number, point, now);
        }
        end.lines().for_each(|line| lines.instruction(line));
        lines.program(name, &positions)
    }

    /// How a motion ends: at its point, or past it without a stop if the path continues nearly straight.
    fn stop(&self, at: usize, to: usize) -> &'static str {
        let (Some(before), Some(next)) =
            (at.checked_sub(1).map(|before| &self.points[before]), self.points.get(at + 1))
        else {
            return "FINE";
        };
        let point = &self.points[at];
        let enters = point.rapid && !next.rapid;
        if point.stop || enters || at + 1 == to || next.lines.is_some() || next.joint {
            return "FINE";
        }
        let [q, p, n] = [before.position_mm, point.position_mm, next.position_mm];
        // The rounding of CNT depends on arm and speed: if RAPID's smallest zone would be too large, the motion stops.
        match zone(q, p, n, point.rapid, self.plan.corner_tolerance_mm) {
            FINE => "FINE",
            _ if is_nearly_straight(q, p, n, self.plan.corner_tolerance_mm) => "CNT100",
            _ => "CNT0",
        }
    }
}

/// Numbered statements.
#[derive(Default)]
struct Lines {
    text: String,
    count: usize,
}

impl Lines {
    fn add(&mut self, statement: &str) {
        self.count += 1;
        // Writing to a String cannot fail.
        let _ = writeln!(self.text, "{:4}:{statement} ;", self.count);
    }

    fn remark(&mut self, text: &str) {
        let plain: String = text.chars().map(|c| if c.is_ascii_graphic() && c != ';' { c } else { ' ' }).collect();
        self.add(&format!("  !{}", plain.trim_end()));
    }

    /// A line of a template, with or without its semicolon.
    fn instruction(&mut self, line: &str) {
        self.add(&format!("  {}", line.trim().trim_end_matches(';').trim_end()));
    }

    fn program(&self, name: &str, positions: &str) -> Vec<u8> {
        format!(
            "/PROG  {name}\n/ATTR\nOWNER\t\t= MNEDITOR;\nCOMMENT\t\t= \"\";\nPROG_SIZE\t= 0;\nVERSION\t\t= 0;\n\
             LINE_COUNT\t= {};\nMEMORY_SIZE\t= 0;\nPROTECT\t\t= READ_WRITE;\nTCD:  STACK_SIZE\t= 0,\n      \
             TASK_PRIORITY\t= 50,\n      TIME_SLICE\t= 0,\n      BUSY_LAMP_OFF\t= 0,\n      ABORT_REQUEST\t= 0,\n      \
             PAUSE_REQUEST\t= 0;\nDEFAULT_GROUP\t= 1,*,*,*,*;\nCONTROL_CODE\t= 00000000 00000000;\n/MN\n{}/POS\n{positions}/END\n",
            self.count, self.text
        )
        .into_bytes()
    }
}

/// A speed as the teach pendant shows it: with tenths, unless they are zero.
fn tenths(mm_s: f64) -> String {
    let text = format!("{:.1}", mm_s.max(0.1));
    text.strip_suffix(".0").map_or(text.clone(), str::to_owned)
}

/// A position with its configuration.
fn position(out: &mut String, number: usize, point: &PostedPoint, (uf, ut): (u32, u32)) {
    let config = Config { posture: point.conf.cfx, turns: point.turns };
    let [x, y, z] = point.position_mm.map(field);
    let [r, p, w] = zyx_deg(&rotation(point.quat)).map(field);
    // Writing to a String cannot fail.
    let _ = writeln!(
        out,
        "P[{number}]{{\n   GP1:\n\tUF : {uf}, UT : {ut},\t\tCONFIG : '{config}',\n\tX = {x}  mm,\t\
         Y = {y}  mm,\tZ = {z}  mm,\n\tW = {w} deg,\tP = {p} deg,\tR = {r} deg\n}};"
    );
}

/// A number in the width of the controller.
fn field(value: f64) -> String {
    let mut text = Vec::new();
    write_fixed(&mut text, value, DECIMALS);
    format!("{:>9}", String::from_utf8_lossy(&text))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_held_is_what_is_printed() {
        let (mm, quat) = held_pose([1.23456, -0.0004, 7.0], [0.0, 1.0, 0.0, 0.0]);
        assert!((mm[0] - 1.235).abs() < 1e-6 && mm[1].abs() < 1e-12 && (quat[1].abs() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn speeds_have_tenths_where_they_need_them() {
        assert_eq!([tenths(500.0), tenths(27.43), tenths(0.01)], ["500", "27.4", "0.1"]);
    }
}
