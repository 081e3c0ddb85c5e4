//! Inserted points between two targets: each becomes a motion before the instruction, in the layout of the file.

use super::expression::{Arguments, Call};
use super::lex::{Cursor, LexemeKind};
use super::motion::{self, Shape, ToolAt, Zone};
use super::syntax::Reader;
use super::tree::StatementKind;
use super::value::quarters;
use super::value::unit;
use super::writer::Writer;
use super::{Layout, TargetInText};
use crate::line::{indent, line_end, line_start};
use crate::token::single;
use crate::{Conf, Goal, Insert, Inserted, Motion, Passing, Program, Reason, Target};
use deflex_lang::ir::SourceSpan;
use deflex_text::{Edit, Span, number};

/// Zones for a point that the controller flies by, with the radius of their TCP path, mm.
const FLY_BY: [(&[u8], f64); 2] = [(b"z0", 0.3), (b"z1", 1.0)];
/// External axes for a target that states none.
const NO_AXES: &[u8] = b"[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]";

/// `[x,y,z],[q1,q2,q3,q4]` as text, and the pose rounded to single precision.
fn numbers(writer: &Writer<'_>, (position_mm, quat): ([f64; 3], [f64; 4])) -> (Vec<u8>, ([f64; 3], [f64; 4])) {
    let mut text = b"[".to_vec();
    let mut held = [0.0; 7];
    let quat = unit(quat);
    for (i, value) in position_mm.into_iter().chain(quat).enumerate() {
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

/// The motion before which a point is inserted, and that the inserted motion resembles.
struct Like<'p> {
    target: &'p Target,
    call: Box<Call>,
    shape: Shape,
    /// Position of the tool among its arguments.
    tool_at: usize,
}

fn like(program: &Program, before: usize) -> Result<Like<'_>, Reason> {
    let target = program.targets.get(before).ok_or(Reason::NoSuchTarget)?;
    let bytes = &program.sources[usize::from(target.source)].bytes;
    if !matches!(target.motion, Motion::Linear | Motion::Circular) {
        return Err(Reason::OnlyLinesAndArcs);
    }
    let StatementKind::Call(call) = Reader::new(bytes, target.span, &[], 0).statement() else {
        return Err(Reason::Motion);
    };
    let shape = motion::shape(&bytes[call.name.range()]).ok_or(Reason::ZoneUnknown)?;
    let tool_at = match shape.tool {
        ToolAt::Index(at) => at,
        ToolAt::Last => call.arguments.positional.len().checked_sub(1).ok_or(Reason::Motion)?,
    };
    Ok(Like { target, call, shape, tool_at })
}

/// Why nothing can be inserted before a target.
pub(super) fn refusal(program: &Program, layout: &Layout, before: usize) -> Option<Reason> {
    let Like { target, call, shape, .. } = match like(program, before) {
        Ok(like) => like,
        Err(why) => return Some(why),
    };
    let source = &program.sources[usize::from(target.source)];
    let start = target.span.start as usize;
    let is_first = line_start(&source.bytes, start) + indent(&source.bytes, start).len() == start;
    match () {
        () if layout.after_compact_if.contains(&(target.source, target.span.start)) => Some(Reason::CompactIf),
        () if !shape.is_only_motion => Some(Reason::ProcessMotion),
        () if call.arguments.has(&source.bytes, b"T") => Some(Reason::OwnTime),
        () if !is_first => Some(Reason::NotAtLineStart),
        () => None,
    }
}

/// Copies an optional argument with its value, also in the form `\Name?parameter`, which passes on whether there is one.
fn copy_named(call: &Call, bytes: &[u8], name: &[u8], out: &mut Vec<u8>) {
    if let Some(value) = call.arguments.named(bytes, name) {
        let is_conditional = bytes[..value.span.range().start].trim_ascii_end().ends_with(b"?");
        out.push(b'\\');
        out.extend_from_slice(name);
        out.extend_from_slice(if is_conditional { b"?" } else { b":=" });
        out.extend_from_slice(&bytes[value.span.range()]);
    }
}

/// The motion for an insert.
pub(super) fn instruction(writer: &Writer<'_>, insert: &Insert) -> Result<Inserted, Reason> {
    let (text, pose) = numbers(writer, (insert.position_mm, insert.quat));
    let via = insert.via.map(|via| numbers(writer, via).0);
    let Like { target, call, shape, tool_at } = like(writer.program, insert.before)?;
    let source = &writer.program.sources[usize::from(target.source)];
    let bytes = &source.bytes;
    let argument = |at: usize| {
        let argument = call.arguments.positional.get(at).ok_or(Reason::Motion)?;
        Ok::<_, Reason>(&bytes[argument.span.range()])
    };
    let (conf, axes) = rest(writer.layout, writer, insert.before, insert.conf, &target.goal);
    let axes = insert.external.map_or(axes, |external| external_axes(&external, writer.options.position_decimals));
    let mut content = if via.is_some() { b"MoveC ".to_vec() } else { b"MoveL ".to_vec() };
    for numbers in via.iter().chain([&text]) {
        for part in [b"[", &numbers[..], b",", &conf, b",", &axes, b"],"] {
            content.extend_from_slice(part);
        }
    }
    content.extend_from_slice(argument(shape.to + 1)?);
    copy_named(&call, bytes, b"V", &mut content);
    content.push(b',');
    let own = if shape.zone == Zone::BeforeTool && tool_at > 0 { argument(tool_at - 1)? } else { b"fine" };
    content.extend_from_slice(fly_by(own, insert.room_mm));
    content.push(b',');
    content.extend_from_slice(argument(tool_at)?);
    copy_named(&call, bytes, b"WObj", &mut content);
    copy_named(&call, bytes, b"TLoad", &mut content);
    content.push(b';');
    content.extend_from_slice(line_end(&source.bytes, target.span.end as usize).0);
    content.extend_from_slice(indent(&source.bytes, target.span.start as usize));
    let at = Span { start: target.span.start, end: target.span.start };
    Ok(Inserted { source: target.source as usize, at, text: content, pose })
}

/// External axes as text.
fn external_axes(external: &[Option<f64>], decimals: usize) -> Vec<u8> {
    let mut text = b"[".to_vec();
    for (i, axis) in external.iter().enumerate() {
        if i > 0 {
            text.push(b',');
        }
        match axis {
            Some(position) => number::write_fixed(&mut text, *position, decimals),
            None => text.extend_from_slice(b"9E+09"),
        }
    }
    text.push(b']');
    text
}

/// The zone for a point that the controller flies by, with `room_mm` about it: the instruction's own zone if that fits.
fn fly_by(own: &[u8], room_mm: f64) -> &[u8] {
    // Zones of adjacent points meet at the middle between them.
    let fits = |radius: f64| radius <= 0.5 * room_mm;
    if radius_mm(own).is_some_and(fits) {
        return own;
    }
    FLY_BY.iter().rev().find(|(_, radius)| fits(*radius)).map_or(FLY_BY[0].0, |(name, _)| name)
}

/// Radius of the TCP path of a predefined or written-out zone, mm; `None` for a stop and for other names.
fn radius_mm(zone: &[u8]) -> Option<f64> {
    let upper = zone.to_ascii_uppercase();
    if let Some(mm) = upper.strip_prefix(b"Z") {
        // z0 is the smallest zone.
        return number::read(mm).filter(|_| mm.iter().all(u8::is_ascii_digit)).map(|mm| mm.max(FLY_BY[0].1));
    }
    let mut fields = upper.strip_prefix(b"[")?.split(|b| *b == b',');
    let flies = fields.next()?.trim_ascii() == b"FALSE";
    number::read(fields.next()?.trim_ascii()).filter(|_| flies)
}

/// The target that an instruction has written out as its first argument.
fn own_literal(target: &Target, layout: &Layout, i: usize) -> Option<Span> {
    let literal = match layout.sites.get(i)? {
        TargetInText::Literal { literal, argument: None } => layout.literals.get(*literal as usize)?.span(),
        _ => return None,
    };
    target.span.range().contains(&(literal.start as usize)).then_some(literal)
}

/// The text of an instruction before and after the target that it has written out.
pub(super) fn around_literal<'p>(program: &'p Program, layout: &Layout, i: usize) -> Option<[&'p [u8]; 2]> {
    let target = program.targets.get(i)?;
    let (literal, span) = (own_literal(target, layout, i)?.range(), target.span.range());
    let bytes = &program.sources[target.source as usize].bytes;
    Some([bytes.get(span.start..literal.start)?, bytes.get(literal.end..span.end)?])
}

/// The argument that states the zone of a target's instruction; `None` for instructions without a zone.
fn zone_argument(program: &Program, i: usize) -> Option<Span> {
    let (target, layout) = (program.targets.get(i)?, Layout::of(program)?);
    let bytes = &program.sources[target.source as usize].bytes;
    let shape = |name: Span| motion::shape(&bytes[name.range()]).filter(|shape| shape.zone == Zone::BeforeTool);
    let (arguments, shape, passed): (Arguments, _, _) = match own_literal(target, layout, i) {
        // The numbers of a written-out target need not be read again.
        Some(literal) => {
            let mut cursor = Cursor::new(bytes, target.span);
            let shape = shape(cursor.accept(LexemeKind::Word)?.span())?;
            let rest = Span { start: literal.end, ..target.span };
            (Reader::new(bytes, rest, &[], 0).arguments(), shape, shape.to + 1)
        }
        None => {
            let StatementKind::Call(call) = Reader::new(bytes, target.span, &[], 0).statement() else { return None };
            (call.arguments, shape(call.name)?, 0)
        }
    };
    let tool_at = match shape.tool {
        ToolAt::Index(at) => at.checked_sub(passed)?,
        ToolAt::Last => arguments.positional.len().checked_sub(1)?,
    };
    Some(arguments.positional.get(tool_at.checked_sub(1)?)?.span)
}

/// See [`Program::passing`](crate::Program::passing); `None` for instructions without a zone.
pub(super) fn passing(program: &Program, i: usize) -> Option<Passing> {
    let bytes = &program.sources[program.targets.get(i)?.source as usize].bytes;
    let zone = &bytes[zone_argument(program, i)?.range()];
    let written_out = zone.strip_prefix(b"[").and_then(|fields| fields.split(|byte| *byte == b',').next());
    if zone.eq_ignore_ascii_case(b"fine")
        || written_out.is_some_and(|fine| fine.trim_ascii().eq_ignore_ascii_case(b"TRUE"))
    {
        return Some(Passing::Stop);
    }
    radius_mm(zone).map(Passing::Zone)
}

/// See [`Program::passing_edits`](crate::Program::passing_edits): the argument becomes the name of a predefined zone.
pub(super) fn passing_edits(program: &Program, wanted: &[(usize, Passing)]) -> Vec<Option<Edit>> {
    let is_declared = |name: &[u8]| program.sources.iter().any(|source| declares_zone(&source.bytes, name));
    let is_predefined = |name: &&[u8]| !is_declared(name);
    let stop = Some(&b"fine"[..]).filter(is_predefined);
    let zones: Vec<_> = FLY_BY.iter().rev().filter(|(name, _)| is_predefined(name)).collect();
    let edit = |(i, wanted): &(usize, Passing)| {
        program.targets.get(*i).filter(|target| usize::from(target.source) < program.written)?;
        let span = zone_argument(program, *i)?;
        let name = match (wanted, passing(program, *i)) {
            (Passing::Stop, _) => stop?,
            // Only a zone of known radius can be shown to become smaller.
            (Passing::Zone(most), Some(Passing::Zone(radius))) => {
                zones.iter().find(|zone| zone.1 <= *most && zone.1 < radius)?.0
            }
            _ => return None,
        };
        Some(Edit { span, content: name.to_vec().into() })
    };
    wanted.iter().map(edit).collect()
}

/// Whether a text declares zonedata under the name of a predefined zone.
fn declares_zone(text: &[u8], name: &[u8]) -> bool {
    let is_word = |byte: &u8| byte.is_ascii_alphanumeric() || *byte == b'_';
    text.windows(b"zonedata".len()).enumerate().filter(|(_, word)| word.eq_ignore_ascii_case(b"zonedata")).any(
        |(at, word)| {
            let rest = text[at + word.len()..].trim_ascii_start();
            let end = rest.iter().position(|byte| !is_word(byte)).unwrap_or(rest.len());
            rest[..end].eq_ignore_ascii_case(name)
        },
    )
}

/// See [`Program::inserted_passing`](crate::Program::inserted_passing).
pub(super) const CLOSE_BY: Passing = Passing::Zone(FLY_BY[0].1);

/// Configuration and external axes of the target, as text.
fn rest(layout: &Layout, writer: &Writer<'_>, i: usize, own: Option<Conf>, goal: &Goal) -> (Vec<u8>, Vec<u8>) {
    let literal = match layout.sites[i] {
        TargetInText::Literal { literal, .. } => Some(literal),
        TargetInText::Offset(at) => Some(layout.offsets[at as usize].root),
        TargetInText::None => None,
    };
    let written = match goal {
        Goal::Pose { conf, .. } => *conf,
        Goal::Axis { .. } | Goal::Joints { .. } => None,
    };
    let conf = match own.or(written).and_then(quarters) {
        Some([a, b, c, d]) => format!("[{a},{b},{c},{d}]").into_bytes(),
        None => b"[0,0,0,0]".to_vec(),
    };
    let axes = literal.map(|l| {
        let literal = &layout.literals[l as usize];
        writer.bytes(SourceSpan { source: literal.source, span: literal.external() })
    });
    let axes = axes.filter(|a| a.starts_with(b"[")).unwrap_or(NO_AXES);
    (conf, axes.to_vec())
}
