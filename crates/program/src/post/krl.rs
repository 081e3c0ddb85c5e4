//! Writes points as KRL: one `.src`, or parts that the first one calls.

use super::names::identifier;
use super::statements::Statements;
use super::template::decimal;
use super::writer::{PostWriter, PostedPoint, WriterPosition};
use super::zone::radius;
use crate::orientation::{rotation, zyx_deg};
use crate::{Mark, NO_TURN, ToolData, WobjData};
use deflex_text::number::write_fixed;

/// Most points of a file: controllers do not load long files. RoboDK's post-processor for the KRC4 splits at the same number of lines.
pub(crate) const MOST_POINTS: usize = 1400;
/// Decimals of millimetres, as in RAPID.
const MM: usize = 4;
/// Decimals of angles: 5e-6 mm at 300 mm.
const DEG: usize = 6;
/// Decimals of speeds, m/s.
const SPEED: usize = 6;
/// Speed of joint motions, % of the largest axis speeds.
const JOINT_SPEED: u32 = 20;
/// Names have 24 characters, of which parts take some.
const SHORTER: usize = 32 - 24 + 8;

/// The statements of KRL in posted programs.
pub(crate) const STATEMENTS: Statements = Statements {
    dwell: |seconds| format!("WAIT SEC {}", decimal(seconds)),
    // A message with an answer would need declarations. The pendant shows the line of a HALT, and the program continues with Start.
    stops_with_message: |text| vec![format!("; {text}"), "HALT".to_owned()],
    write: Some(|post, points, axes, end| Ok(post.krl(points, axes, end))),
    most_points: Some(MOST_POINTS),
    stands_still: true,
    ..Statements::RAPID
};

/// The tool moves in the base, and does not stand still.
const MODE: &[u8] = b"$IPO_MODE = #BASE\r\n";

impl PostWriter {
    /// Writes the program: points with the axis angles there (degrees), and the lines of its end; its files by name, the
    /// one to start first.
    ///
    /// A motion whose path is unknown is a joint motion to axis angles, which decides the posture.
    #[must_use]
    pub(crate) fn krl(&self, points: &[PostedPoint], axes_deg: &[[f64; 6]], end: &str) -> Vec<(String, Vec<u8>)> {
        let name = identifier(&self.plan.name, SHORTER);
        let most = self.part.unwrap_or(usize::MAX);
        let mut files = Vec::new();
        let mut main = self.file(&name);
        main.extend_from_slice(format!("BAS (#INITMOV,0)\r\nBAS (#VEL_PTP,{JOINT_SPEED})\r\n").as_bytes());
        let mut place = WriterPosition::default();
        let parts = points.chunks(most).zip(axes_deg.chunks(most));
        let count = points.len().div_ceil(most).max(1);
        for (part, (points, axes)) in parts.enumerate() {
            let mut text =
                if count > 1 { self.file(&format!("{name}_{}", part + 1)) } else { std::mem::take(&mut main) };
            let mut in_force = InForce::default();
            text.extend_from_slice(MODE);
            for (i, point) in points.iter().enumerate() {
                let here = place.after(std::slice::from_ref(point));
                let next = points.get(i + 1);
                self.krl_motion(&mut text, &here, point, next, &axes[i], &mut in_force);
                place = here;
            }
            if count > 1 {
                text.extend_from_slice(b"END\r\n");
                main.extend_from_slice(format!("{name}_{}( )\r\n", part + 1).as_bytes());
                files.push((format!("{name}_{}.src", part + 1), text));
            } else {
                main = text;
            }
        }
        lines(&mut main, end);
        main.extend_from_slice(b"END\r\n");
        files.insert(0, (format!("{name}.src"), main));
        files
    }

    fn file(&self, name: &str) -> Vec<u8> {
        let mut text = format!("&ACCESS RVP\r\n&REL 1\r\nDEF {name}( )\r\n");
        self.plan.plain_title().for_each(|line| text += &format!("; {line}\r\n"));
        text.into_bytes()
    }

    fn krl_motion(
        &self,
        text: &mut Vec<u8>,
        place: &WriterPosition,
        point: &PostedPoint,
        next: Option<&PostedPoint>,
        axes_deg: &[f64; 6],
        in_force: &mut InForce,
    ) {
        if let Some(own) = &point.lines {
            lines(text, own);
            // A routine of a template may move with settings of its own.
            if own.lines().any(calls) {
                text.extend_from_slice(MODE);
                *in_force = InForce { mark: in_force.mark, ..InForce::default() };
            }
        }
        if in_force.tool.replace(point.tool) != Some(point.tool)
            && let Some((name, data)) = self.plan.tools.get(usize::from(point.tool))
        {
            tool(text, name, data);
        }
        if in_force.base.replace(point.wobj) != Some(point.wobj)
            && let Some((name, data)) = self.plan.wobjs.get(usize::from(point.wobj))
        {
            base(text, name, data);
        }
        if in_force.mark != point.mark {
            point.mark.iter().for_each(|mark| lines(text, &format!("; {}", mark.comment())));
            in_force.mark = point.mark;
        }
        if place.is_first() || point.joint {
            text.extend_from_slice(b"PTP {");
            components(text, [b"A1", b"A2", b"A3", b"A4", b"A5", b"A6"], axes_deg, [DEG; 6]);
            externals(text, self.external(point));
            text.extend_from_slice(b"}\r\n");
            return;
        }
        let speed = 1e-3 * self.speed_mm_s(point);
        #[allow(clippy::float_cmp)] // exactly the same number
        if in_force.speed != Some(speed) {
            text.extend_from_slice(b"$VEL.CP = ");
            write_fixed(text, speed, SPEED);
            text.extend_from_slice(b"\r\n");
            in_force.speed = Some(speed);
        }
        let zone = next.and_then(|next| radius(self.zone_at(place, point, Some(next))));
        if let Some(zone) = zone.filter(|zone| in_force.zone != Some(*zone)) {
            text.extend_from_slice(b"$APO.CDIS = ");
            write_fixed(text, zone, 1);
            text.extend_from_slice(b"\r\n");
            in_force.zone = Some(zone);
        }
        text.extend_from_slice(b"LIN ");
        frame(text, &point.position_mm, point.quat);
        if self.external(point).iter().any(Option::is_some) {
            text.pop();
            externals(text, self.external(point));
            text.push(b'}');
        }
        text.extend_from_slice(if zone.is_some() { b" C_DIS\r\n" } else { b"\r\n" });
    }
}

/// The state that the file has set so far.
#[derive(Default)]
struct InForce {
    tool: Option<u16>,
    base: Option<u16>,
    mark: Option<Mark>,
    /// m/s
    speed: Option<f64>,
    /// mm
    zone: Option<f64>,
}

/// Whether a line is more than a comment, a wait, or an output.
fn calls(line: &str) -> bool {
    let line = line.trim_start().to_ascii_uppercase();
    ![";", "WAIT", "HALT", "$OUT"].iter().any(|known| line.starts_with(known)) && !line.is_empty()
}

fn lines(text: &mut Vec<u8>, lines: &str) {
    for line in lines.lines() {
        text.extend_from_slice(line.as_bytes());
        text.extend_from_slice(b"\r\n");
    }
}

fn components(text: &mut Vec<u8>, names: [&[u8]; 6], values: &[f64; 6], decimals: [usize; 6]) {
    for (i, (name, value)) in names.into_iter().zip(values).enumerate() {
        if i > 0 {
            text.push(b',');
        }
        text.extend_from_slice(name);
        text.push(b' ');
        write_fixed(text, *value, decimals[i]);
    }
}

/// `,E1 …` for the axes in use.
fn externals(text: &mut Vec<u8>, external: &[Option<f64>; crate::EXTERNAL_AXES]) {
    for (number, position) in (1_u32..).zip(external) {
        let Some(position) = position else { continue };
        text.extend_from_slice(format!(",E{number} ").as_bytes());
        write_fixed(text, *position, MM);
    }
}

/// `{X …,Y …,Z …,A …,B …,C …}`
fn frame(text: &mut Vec<u8>, [x, y, z]: &[f64; 3], quat: [f64; 4]) {
    let [a, b, c] = zyx_deg(&rotation(quat));
    text.push(b'{');
    components(text, [b"X", b"Y", b"Z", b"A", b"B", b"C"], &[*x, *y, *z, a, b, c], [MM, MM, MM, DEG, DEG, DEG]);
    text.push(b'}');
}

/// The tool by its number if its name has one, otherwise its frame.
fn tool(text: &mut Vec<u8>, name: &str, data: &ToolData) {
    if let Some(number) = numbered(name, "TOOL_DATA") {
        text.extend_from_slice(format!("$TOOL = TOOL_DATA[{number}]\r\n$LOAD = LOAD_DATA[{number}]\r\n").as_bytes());
        return;
    }
    text.extend_from_slice(b"$TOOL = ");
    frame(text, &data.tcp_mm, data.tcp_quat);
    text.extend_from_slice(b"\r\n$LOAD = {M ");
    write_fixed(text, data.mass_kg, MM);
    text.extend_from_slice(b",CM ");
    frame(text, &data.cog_mm, NO_TURN);
    text.extend_from_slice(b",J {X 0.0,Y 0.0,Z 0.0}}\r\n");
}

fn base(text: &mut Vec<u8>, name: &str, data: &WobjData) {
    if let Some(number) = numbered(name, "BASE_DATA") {
        text.extend_from_slice(format!("$BASE = BASE_DATA[{number}]\r\n").as_bytes());
        return;
    }
    text.extend_from_slice(b"$BASE = ");
    frame(text, &data.uframe_mm, data.uframe_quat);
    text.extend_from_slice(b"\r\n");
}

/// `TABLE[n]`
fn numbered(name: &str, table: &str) -> Option<u32> {
    let (known, rest) = name.split_at_checked(table.len())?;
    let number = rest.strip_prefix('[')?.strip_suffix(']')?.parse().ok()?;
    known.eq_ignore_ascii_case(table).then_some(number)
}
