//! Points between two targets: a straight move of its own before the instruction, in the file's layout.

use super::clone::layout_at;
use super::motion::{self, Simple, ToolAt, Zone};
use super::rewrite::{Writer, quarters, single};
use super::value::{Place, unit};
use super::{Layout, Site};
use crate::program::{Goal, Insert, Motion};
use crate::text::{Edit, Span, number};

/// Where the instruction stops at its point, the piece before it must not: the smallest fly-by zone that
/// every controller has.
const FLY_BY: &[u8] = b"z1";
/// External axes of a target that has none written.
const NO_AXES: &[u8] = b"[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]";

/// Writes the inserts; gives each as the controller will hold it.
pub(super) fn write(writer: &mut Writer<'_>, inserts: &[Insert]) -> Vec<([f64; 3], [f64; 4])> {
    let mut poses = Vec::new();
    for insert in inserts {
        let (text, pose) = numbers(writer, insert);
        poses.push(pose);
        match instruction(writer, insert, &text) {
            Ok((source, edit)) => {
                // Several points before one instruction, in their order: one edit.
                let edits = &mut writer.edits[source];
                match edits.iter_mut().find(|e| e.span == edit.span) {
                    Some(other) => other.content.extend_from_slice(&edit.content),
                    None => edits.push(edit),
                }
            }
            Err(reason) => writer.kept.push((insert.before, reason)),
        }
    }
    writer.kept.dedup();
    poses
}

/// `[x,y,z],[q1,q2,q3,q4]` and what single precision makes of it.
fn numbers(writer: &Writer<'_>, insert: &Insert) -> (Vec<u8>, ([f64; 3], [f64; 4])) {
    let mut text = b"[".to_vec();
    let mut held = [0.0; 7];
    let quat = unit(insert.quat);
    for (i, value) in insert.position_mm.into_iter().chain(quat).enumerate() {
        if i > 0 {
            text.extend_from_slice(if i == 3 { b"],[" } else { b"," });
        }
        let decimals = if i < 3 { writer.options.position_decimals } else { writer.options.quat_decimals };
        let from = text.len();
        number::write_fixed(&mut text, value, decimals);
        held[i] = single(number::read(&text[from..]).unwrap_or(value));
    }
    text.push(b']');
    let [x, y, z, q1, q2, q3, q4] = held;
    (text, ([x, y, z], unit([q1, q2, q3, q4])))
}

fn instruction(writer: &Writer<'_>, insert: &Insert, numbers: &[u8]) -> Result<(usize, Edit), &'static str> {
    let target = writer.program.targets.get(insert.before).ok_or("no such target")?;
    let source = &writer.program.sources[target.source as usize];
    let bytes = &source.bytes;
    if target.source as usize >= writer.program.written {
        return Err("declared in a context module");
    }
    if target.motion != Motion::Linear {
        return Err("only straight motions can be subdivided");
    }
    let same = |t: &&crate::program::Target| t.source == target.source && t.span == target.span;
    let near = writer.program.targets[insert.before.saturating_sub(1)..].iter().take(3).filter(same).count();
    if near != 1 || writer.program.targets.iter().filter(same).take(2).count() != 1 {
        return Err("motion runs more than once: a point before it would too");
    }
    let Some(Simple::Call(call)) = motion::split(bytes, target.source, target.span) else {
        return Err("motion is not understood");
    };
    let Some(shape) = motion::shape(&bytes[call.name.range()]) else {
        return Err("not a known motion instruction: its zone is not known");
    };
    if call.option(bytes, b"T").is_some() {
        return Err("motion with a time of its own");
    }
    let arguments = call.positional();
    let tool_at = match shape.tool {
        ToolAt::Index(at) => at,
        ToolAt::Last => arguments.len() - 1,
    };
    let text = |span: Span| &bytes[span.range()];
    let argument = |at: usize| arguments.get(at).map(|s| text(*s)).ok_or("motion is not understood");
    let (indent, line_end) = layout_at(source, target.span.start);
    let line =
        bytes[..target.span.start as usize].iter().rposition(|b| matches!(b, b'\n' | b'\r')).map_or(0, |p| p + 1);
    if line + indent.len() != target.span.start as usize {
        return Err("motion does not begin its line");
    }
    let mut content = b"MoveL [".to_vec();
    content.extend_from_slice(numbers);
    content.push(b',');
    let (conf, axes) = rest(writer.layout, writer, insert.before, &target.goal);
    content.extend_from_slice(&conf);
    content.push(b',');
    content.extend_from_slice(&axes);
    content.extend_from_slice(b"],");
    content.extend_from_slice(argument(shape.to + 1)?);
    if let Some(speed) = call.option(bytes, b"V") {
        content.extend_from_slice(b"\\V:=");
        content.extend_from_slice(text(speed));
    }
    content.push(b',');
    let zone = if shape.zone == Zone::BeforeTool && tool_at > 0 { argument(tool_at - 1)? } else { FLY_BY };
    let stops = zone.eq_ignore_ascii_case(b"fine") || zone.to_ascii_uppercase().starts_with(b"[TRUE");
    content.extend_from_slice(if stops { FLY_BY } else { zone });
    content.push(b',');
    content.extend_from_slice(argument(tool_at)?);
    if let Some(wobj) = call.option(bytes, b"WObj") {
        content.extend_from_slice(b"\\WObj:=");
        content.extend_from_slice(text(wobj));
    }
    if let Some(load) = call.option(bytes, b"TLoad") {
        content.extend_from_slice(b"\\TLoad:=");
        content.extend_from_slice(text(load));
    }
    content.push(b';');
    content.extend_from_slice(line_end);
    content.extend_from_slice(indent);
    let at = Span { start: target.span.start, end: target.span.start };
    Ok((target.source as usize, Edit { span: at, content: content.into() }))
}

/// Configuration and external axes of the target, as text.
fn rest(layout: &Layout, writer: &Writer<'_>, i: usize, goal: &Goal) -> (Vec<u8>, Vec<u8>) {
    let literal = match layout.sites[i] {
        Site::Literal { literal, .. } => Some(literal),
        Site::Offset(at) => Some(layout.offsets[at as usize].root),
        Site::None => None,
    };
    let conf = match goal {
        Goal::Pose { conf: Some(conf), .. } => {
            let [a, b, c, d] = quarters(*conf);
            format!("[{a},{b},{c},{d}]").into_bytes()
        }
        _ => b"[0,0,0,0]".to_vec(),
    };
    let axes = literal.map(|l| {
        let literal = &layout.literals[l as usize];
        writer.bytes(Place { source: literal.source, span: literal.external() })
    });
    let axes = axes.filter(|a| a.starts_with(b"[")).unwrap_or(NO_AXES);
    (conf, axes.to_vec())
}
