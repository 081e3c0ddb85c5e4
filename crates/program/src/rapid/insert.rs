//! Inserted points between two targets: each becomes a motion before the instruction, in the layout of the file.

use super::expression::{Arguments, Call, ExpressionKind};
use super::lex::{Cursor, LexemeKind};
use super::motion::{self, Shape, ToolAt, Zone};
use super::syntax::Reader;
use super::tree::StatementKind;
use super::value::quarters;
use super::value::unit;
use super::writer::Writer;
use super::{Given, Layout, TargetInText};
use crate::line::{indent, line_end, line_start};
use crate::token::single;
use crate::{Conf, Goal, Insert, Inserted, Motion, Passing, Program, Reason, Target};
use deflex_lang::ir::SourceSpan;
use deflex_text::{Edit, Span, number};

/// Zones for a point that the controller flies by, with the radius of their TCP path, mm.
const FLY_BY: [(&[u8], f64); 2] = [(b"z0", 0.3), (b"z1", 1.0)];
/// The value of `z0`, for a program that uses the names of both zones for others.
const SMALLEST: &[u8] = b"[FALSE,0.3,0.3,0.3,0.03,0.3,0.03]";
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
    let Like { target, call, shape, tool_at } = match like(program, before) {
        Ok(like) => like,
        Err(why) => return Some(why),
    };
    let source = &program.sources[usize::from(target.source)];
    let (start, place) = (target.span.start as usize, (target.source, target.span.start));
    let is_first = line_start(&source.bytes, start) + indent(&source.bytes, start).len() == start;
    match () {
        () if layout.runs_elsewhere.contains(&place) => Some(Reason::RunsElsewhere),
        () if layout.after_compact_if.contains(&place) => Some(Reason::CompactIf),
        () if !shape.is_only_motion => Some(Reason::ProcessMotion),
        () if call.arguments.has(&source.bytes, b"T") => Some(Reason::OwnTime),
        // ABB allows the argument in synchronised motions alone, of which the other task has one with each identity.
        () if call.arguments.has(&source.bytes, b"ID") => Some(Reason::Synchronised),
        () if calls_a_function(&call.arguments, &shape, tool_at) => Some(Reason::CallsFunction),
        () if !is_first => Some(Reason::NotAtLineStart),
        () => None,
    }
}

/// Whether an argument that an inserted motion repeats calls a function, which may count its calls. Targets are not repeated.
fn calls_a_function(arguments: &Arguments, shape: &Shape, tool_at: usize) -> bool {
    let repeated = arguments.positional.get(shape.to + 1..=tool_at).unwrap_or_default();
    let mut calls = false;
    for argument in repeated.iter().chain(arguments.optional_values()) {
        argument.each(&mut |part| calls |= matches!(part.kind, ExpressionKind::Call(_)));
    }
    calls
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
    content.extend_from_slice(fly_by(writer.program, own, insert.room_mm));
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
fn fly_by<'z>(program: &Program, own: &'z [u8], room_mm: f64) -> &'z [u8] {
    // Zones of adjacent points meet at the middle between them.
    let fits = |radius: f64| radius <= 0.5 * room_mm;
    if matches!(passing_of(program, own), Some(Passing::Zone(radius)) if fits(radius)) {
        return own;
    }
    let zones = || predefined_zones(program);
    zones().filter(|zone| fits(zone.1)).last().or(zones().next()).map_or(SMALLEST, |zone| zone.0)
}

/// The predefined zones that may be written, the smallest first: those whose names the program does not use for others.
fn predefined_zones(program: &Program) -> impl Iterator<Item = &'static (&'static [u8], f64)> {
    let is_free = |name: &[u8]| declared_zones(program).iter().all(|zone| !zone.name.eq_ignore_ascii_case(name));
    FLY_BY.iter().filter(move |(name, _)| is_free(name))
}

/// How the controller passes a point with this zone: a predefined one, one that is written out, or one that the program declares as a constant.
/// `None` if the value is only known at run time.
fn passing_of(program: &Program, zone: &[u8]) -> Option<Passing> {
    let mut declared = declared_zones(program).iter().filter(|declared| declared.name.eq_ignore_ascii_case(zone));
    match (declared.next(), declared.next()) {
        (Some(only), None) => only.passing,
        (Some(_), Some(_)) => None,
        (None, _) if zone.eq_ignore_ascii_case(b"fine") => Some(Passing::Stop),
        (None, _) => match zone.strip_prefix(b"z").or(zone.strip_prefix(b"Z")) {
            // z0 is the smallest zone.
            Some(mm) if mm.iter().all(u8::is_ascii_digit) => {
                number::read(mm).map(|mm| Passing::Zone(mm.max(FLY_BY[0].1)))
            }
            _ => written_out(zone),
        },
    }
}

/// The zone that is written out, `[finep,pzone_tcp,…]`.
fn written_out(zone: &[u8]) -> Option<Passing> {
    let mut fields = zone.strip_prefix(b"[")?.split(|b| *b == b',').map(|field| field.trim_ascii());
    let (is_stop, radius) = (fields.next()?, fields.next()?);
    match () {
        () if is_stop.eq_ignore_ascii_case(b"TRUE") => Some(Passing::Stop),
        () if is_stop.eq_ignore_ascii_case(b"FALSE") => number::read(radius).map(Passing::Zone),
        () => None,
    }
}

/// A name that a program declares for zonedata, or for a parameter of this type.
#[derive(Debug)]
pub(super) struct DeclaredZone {
    name: Box<[u8]>,
    /// The value of a constant that is written out.
    passing: Option<Passing>,
}

/// The zones that the texts of a program declare.
fn declared_zones(program: &Program) -> &[DeclaredZone] {
    let texts = || program.sources.iter().map(|source| &source.bytes[..]);
    Layout::of(program).map_or(&[], |layout| layout.zones.get_or_init(|| texts().flat_map(zones_in).collect()))
}

/// The zones that a text declares.
fn zones_in(text: &[u8]) -> impl Iterator<Item = DeclaredZone> {
    const TYPE: &[u8] = b"zonedata";
    let is_word = |byte: &u8| byte.is_ascii_alphanumeric() || *byte == b'_';
    let is_type = |at: &usize| text.get(*at..at + TYPE.len()).is_some_and(|word| word.eq_ignore_ascii_case(TYPE));
    memchr::memchr2_iter(b'z', b'Z', text).filter(is_type).filter_map(move |at| {
        let rest = text[at + TYPE.len()..].trim_ascii_start();
        let (name, rest) = rest.split_at(rest.iter().position(|byte| !is_word(byte)).unwrap_or(rest.len()));
        let before = text[..at].trim_ascii_end();
        // A declaration in a comment has no value.
        let line = &before[memchr::memrchr2(b'\n', b'\r', before).map_or(0, |end| end + 1)..];
        let is_constant = before.len() >= 5
            && before[before.len() - 5..].eq_ignore_ascii_case(b"CONST")
            && memchr::memchr(b'!', line).is_none();
        let value = rest.trim_ascii_start().strip_prefix(b":=").filter(|_| is_constant).map(<[u8]>::trim_ascii_start);
        let is_name = !name.is_empty();
        is_name.then(|| DeclaredZone { name: name.into(), passing: value.and_then(written_out) })
    })
}

/// The target that an instruction has written out as its first argument.
fn own_literal(target: &Target, layout: &Layout, i: usize) -> Option<Span> {
    let literal = match layout.sites.get(i)? {
        TargetInText::Literal { literal, given: Given::Inline } => layout.literals.get(*literal as usize)?.span(),
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

/// The zone of a target's instruction.
struct ZoneInText {
    argument: Span,
    /// How the controller passes the point if an optional argument replaces the zone: `\Z` by its length in mm, `\Inpos` by a stop.
    replaced: Option<Option<Passing>>,
}

/// The zone of a target's instruction; `None` for instructions without a zone.
fn zone_in_text(program: &Program, i: usize) -> Option<ZoneInText> {
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
    let length = || number::read(&bytes[arguments.named(bytes, b"Z")?.span.range()]).map(Passing::Zone);
    let replaced = match () {
        () if arguments.has(bytes, b"Inpos") => Some(Some(Passing::Stop)),
        () if arguments.has(bytes, b"Z") => Some(length()),
        () => None,
    };
    Some(ZoneInText { argument: arguments.positional.get(tool_at.checked_sub(1)?)?.span, replaced })
}

/// See [`Program::passing`](crate::Program::passing); `None` for instructions without a zone, and for zones that are only known at run time.
pub(super) fn passing(program: &Program, i: usize) -> Option<Passing> {
    let zone = zone_in_text(program, i)?;
    let bytes = &program.sources[program.targets[i].source as usize].bytes;
    zone.replaced.unwrap_or_else(|| passing_of(program, &bytes[zone.argument.range()]))
}

/// See [`Program::passing_edits`](crate::Program::passing_edits): the argument becomes the name of a predefined zone.
pub(super) fn passing_edits(program: &Program, wanted: &[(usize, Passing)]) -> Vec<Option<Edit>> {
    let is_fine = matches!(passing_of(program, b"fine"), Some(Passing::Stop));
    let edit = |(i, wanted): &(usize, Passing)| {
        program.targets.get(*i).filter(|target| usize::from(target.source) < program.written)?;
        let zone = zone_in_text(program, *i).filter(|zone| zone.replaced.is_none())?;
        let name = match (wanted, passing(program, *i)) {
            (Passing::Stop, _) => Some(&b"fine"[..]).filter(|_| is_fine)?,
            // Only a zone of known radius can be shown to become smaller.
            (Passing::Zone(most), Some(Passing::Zone(radius))) => {
                predefined_zones(program).filter(|zone| zone.1 <= *most && zone.1 < radius).last()?.0
            }
            _ => return None,
        };
        Some(Edit { span: zone.argument, content: name.to_vec().into() })
    };
    wanted.iter().map(edit).collect()
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
