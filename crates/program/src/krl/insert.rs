//! Inserted points between two targets: each becomes a motion before the statement, in the layout of the file.

use super::Layout;
use super::lex::{Cursor, lines};
use super::names::APPROXIMATE;
use super::numbers::{ANGLE_DECIMALS, POSITION_DECIMALS, bytes, near};
use super::syntax::simple;
use super::tree::StatementKind;
use super::value::{EXTERNAL, POSE, upper};
use crate::line::{indent, line_end};
use crate::orientation::{quaternion_of_zyx_deg, rotation, zyx_deg};
use crate::token::{signed, single};
use crate::{Editable, Insert, Inserted, Motion, Passing, Program, Reason, Role, Target};
use deflex_text::{Edit, Source, Span, number};
use std::ops::Range;

/// Places where nothing may be inserted.
struct Barred {
    /// Blocks of splines.
    splines: Vec<Range<usize>>,
    /// Folds of inline forms.
    forms: Vec<Range<usize>>,
    /// Starts of motions to which a statement before them refers.
    referred_to: Vec<(u32, Reason)>,
    /// A TRIGGER or a `STOP WHEN PATH` whose motion is not in the text after it.
    is_trigger_open: bool,
}

impl Barred {
    fn of(source: &Source) -> Self {
        let mut barred =
            Self { splines: Vec::new(), forms: forms(&source.bytes), referred_to: Vec::new(), is_trigger_open: false };
        let (mut open, mut referring) = (None, None);
        for line in lines(&source.bytes).filter(|line| !line.code.is_empty()) {
            let cursor = Cursor::new(&source.bytes, 0, line.code);
            match &upper(cursor.text(cursor.peek()))[..] {
                b"SPLINE" | b"PTP_SPLINE" => open = Some(line.code.range().start),
                b"STOP" => referring = Some(Reason::Triggered),
                b"ENDSPLINE" => barred.splines.extend(open.take().map(|start| start..line.code.range().end)),
                _ => {}
            }
            match simple(cursor) {
                StatementKind::Trigger(_) => referring = Some(Reason::Triggered),
                StatementKind::Proceed => referring = referring.or(Some(Reason::Proceeds)),
                StatementKind::Move(_) | StatementKind::Relative(..) => {
                    barred.referred_to.extend(referring.take().map(|why| (line.code.start, why)));
                }
                // Between such a statement and its motion. ON_ERROR_PROCEED is for the very next statement.
                StatementKind::Assign(_) | StatementKind::Harmless(_) | StatementKind::WaitFor(_) => {
                    referring = referring.filter(|why| *why == Reason::Triggered);
                }
                _ => barred.is_trigger_open |= referring.take() == Some(Reason::Triggered),
            }
        }
        barred
    }

    fn why(&self, target: &Target) -> Option<Reason> {
        let at = target.span.range().start;
        let within = |ranges: &[Range<usize>]| ranges.iter().any(|range| range.contains(&at));
        let referred_to = self.referred_to.binary_search_by_key(&target.span.start, |(start, _)| *start);
        match () {
            () if within(&self.splines) => Some(Reason::InSpline),
            // Forms go to named points alone.
            () if target.name.is_some() && within(&self.forms) => Some(Reason::InInlineForm),
            () if self.is_trigger_open => Some(Reason::Triggered),
            () => referred_to.ok().map(|at| self.referred_to[at].1),
        }
    }
}

/// Folds that the controller writes. Their first line has the parameters of an inline form (`;%{PE}`).
fn forms(bytes: &[u8]) -> Vec<Range<usize>> {
    let (mut found, mut open) = (Vec::new(), Vec::new());
    for at in memchr::memchr_iter(b';', bytes) {
        let rest = &bytes[at + 1..];
        let line = &rest[..memchr::memchr2(b'\n', b'\r', rest).unwrap_or(rest.len())];
        let begins = |word: &[u8]| line.len() >= word.len() && line[..word.len()].eq_ignore_ascii_case(word);
        if begins(b"FOLD") {
            open.push((at, memchr::memmem::find(line, b"%{").is_some()));
        } else if begins(b"ENDFOLD")
            && let Some((start, true)) = open.pop()
        {
            found.push(start..at);
        }
    }
    found
}

/// See [`Program::passing_edits`](crate::Program::passing_edits): without its words of approximation a statement positions
/// exactly. Splines and inline forms stay, and statements in which more follows than these words.
pub(super) fn without_approximation(program: &Program, wanted: &[(usize, Passing)]) -> Vec<Option<Edit>> {
    let barred: Vec<Barred> = program.sources.iter().take(program.written).map(Barred::of).collect();
    let edit = |(target, passing): &(usize, Passing)| {
        let target = program.targets.get(*target).filter(|target| target.role == Role::End)?;
        let source = usize::from(target.source);
        if *passing != Passing::Stop || barred.get(source)?.why(target).is_some() {
            return None;
        }
        let text = &program.sources[source].bytes;
        let mut cursor = Cursor::new(text, 0, target.span);
        let word = cursor.next();
        if !matches!(&upper(cursor.text(word))[..], b"LIN" | b"CIRC" | b"PTP") {
            return None;
        }
        let end = cursor.until(&APPROXIMATE).0.range().end;
        let after = text.get(end..target.span.range().end)?;
        let mut words = after.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty()).peekable();
        words.peek()?;
        let is_known = |word: &[u8]| APPROXIMATE[1..].iter().any(|known| word.eq_ignore_ascii_case(known));
        let blanks = text[..end].iter().rev().take_while(|byte| byte.is_ascii_whitespace()).count();
        let span = Span::new(end - blanks, target.span.range().end);
        words.all(is_known).then(|| Edit { span, content: Vec::new().into() })
    };
    wanted.iter().map(edit).collect()
}

/// See [`Program::insertions_refused`].
pub(super) fn refused(program: &Program, layout: &Layout, before: &[usize]) -> Vec<Option<Reason>> {
    let barred: Vec<Barred> = program.sources.iter().take(program.written).map(Barred::of).collect();
    let why = |i: &usize| {
        let target = &program.targets[*i];
        let source = usize::from(target.source);
        let word = Cursor::new(&program.sources[source].bytes, 0, target.span).next();
        match () {
            () if !matches!(target.motion, Motion::Linear | Motion::Circular) || target.role != Role::End => {
                Some(Reason::OnlyLinesAndArcs)
            }
            () if layout.runs_elsewhere.contains(&(target.source, target.span.start)) => Some(Reason::RunsElsewhere),
            () if target.editable != Editable::Pose => Some(Reason::LeavesComponents),
            () if !layout.sites[*i].tokens[3..].iter().all(Option::is_some) => Some(Reason::LeavesComponents),
            () if form(&program.sources[source].bytes[word.span().range()]).is_none() => Some(Reason::Motion),
            () => barred.get(source)?.why(target),
        }
    };
    before.iter().map(why).collect()
}

/// How an inserted line and an arc begin, for a motion with this word.
fn form(word: &[u8]) -> Option<[&'static [u8]; 2]> {
    match &upper(word)[..] {
        b"LIN" | b"CIRC" => Some([b"LIN {", b"CIRC {"]),
        b"SLIN" | b"SCIRC" => Some([b"SLIN {", b"SCIRC {"]),
        _ => None,
    }
}

/// The motion for an insert.
pub(super) fn line(program: &Program, layout: &Layout, insert: &Insert) -> Result<Inserted, Reason> {
    let target = program.targets.get(insert.before).ok_or(Reason::NoSuchTarget)?;
    let source = usize::from(target.source);
    let text = program.sources[source].bytes.get(target.span.range()).ok_or(Reason::NoSuchStatement)?;
    let site = &layout.sites[insert.before];
    let [_, _, _, Some(a), Some(b), Some(c)] = site.tokens else {
        return Err(Reason::LeavesComponents);
    };
    let mut cursor = Cursor::new(&program.sources[source].bytes, 0, target.span);
    let word = cursor.next();
    let names = form(cursor.text(word)).ok_or(Reason::Motion)?;
    // The inserted point is passed in the same way as the end of the motion.
    let (point, _) = cursor.until(&APPROXIMATE);
    let after = text.get(point.range().end - target.span.range().start..).unwrap_or_default();
    let old = [a, b, c].map(|place| signed(bytes(program, place)).unwrap_or(0.0));
    let mut content = Vec::new();
    content.extend_from_slice(names[usize::from(insert.via.is_some())]);
    if let Some((position_mm, _)) = insert.via {
        // Its angles count for nothing.
        put(&mut content, POSE.iter().zip(position_mm), POSITION_DECIMALS);
        content.extend_from_slice(b"},{");
    }
    let position = put(&mut content, POSE.iter().zip(insert.position_mm), POSITION_DECIMALS);
    let angles = POSE[3..].iter().zip(near(zyx_deg(&rotation(insert.quat)), old));
    let angles = put(&mut content, angles, ANGLE_DECIMALS);
    let own = target.external.as_ref().map(|external| external.written);
    let axes = EXTERNAL.iter().zip(insert.external.or(own).unwrap_or_default());
    put(&mut content, axes.filter_map(|(name, axis)| Some((name, axis?))), POSITION_DECIMALS);
    content.push(b'}');
    if !after.is_empty() {
        content.push(b' ');
        content.extend_from_slice(after);
    }
    let bytes = &program.sources[source].bytes;
    content.extend_from_slice(line_end(bytes, target.span.end as usize).0);
    content.extend_from_slice(indent(bytes, target.span.start as usize));
    let held = |numbers: Vec<f64>| std::array::from_fn(|i| numbers[i]);
    let pose = (held(position), quaternion_of_zyx_deg(held(angles)));
    let at = Span { start: target.span.start, end: target.span.start };
    Ok(Inserted { source, at, text: content, pose })
}

/// Writes `X 1.000,Y 2.000` after a brace or other components. Returns the numbers in single precision.
fn put<'n>(out: &mut Vec<u8>, components: impl Iterator<Item = (&'n &'n [u8], f64)>, decimals: usize) -> Vec<f64> {
    let mut held = Vec::new();
    for (name, value) in components {
        if out.last() != Some(&b'{') {
            out.push(b',');
        }
        out.extend_from_slice(name);
        out.push(b' ');
        let from = out.len();
        number::write_fixed(out, value, decimals);
        held.push(single(number::read(&out[from..]).unwrap_or(value)));
    }
    held
}
