//! Inserted points between two targets: each gets a motion before the statement and a position after the others. The statements that follow
//! are renumbered, as a controller prints them.

use super::Layout;
use super::position::{self, Body, Pose, Position};
use super::renumber::{Shifts, counted, renumber};
use super::written::{DECIMALS, nearest};
use crate::EXTERNAL_AXES;
use crate::line::{line_end, line_start};
use crate::orientation::{from_zyx_deg, quaternion, rotation, zyx_deg};
use crate::token::{New, single};
use crate::{Conf, Editable, Insert, Motion, Program, Reason, RewriteOptions, Rewritten, Role, Target};
use deflex_lang::tp::lex::brackets;
use deflex_lang::tp::lines::{Line, numbers, sections};
use deflex_lang::tp::{Lasting, lasting};
use deflex_text::{Content, Edit, Span, apply};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

/// The largest number of a new position: three digits, as in every program of the corpus with which posted programs are compared.
pub(crate) const MOST_POINTS: usize = 999;
/// The most statements of a program: RoboDK's post for these controllers splits longer ones (`MAX_LINES_X_PROG`).
const MOST_LINES: usize = 9999;

/// Why nothing can be inserted before a target, from its statement and its position.
pub(super) fn refusal(program: &Program, layout: &Layout, before: usize) -> Option<Reason> {
    statement(program, layout, before).err()
}

/// The parts of a statement that an inserted motion before it takes over.
struct Like<'a> {
    /// The whole statement, from its number on.
    text: &'a [u8],
    lasting: Lasting<'a>,
    position: &'a Position,
    pose: &'a Pose,
}

impl Like<'_> {
    /// Its number.
    fn number(&self) -> Option<i64> {
        std::str::from_utf8(&self.text[..numbers(self.text)?]).ok()?.parse().ok()
    }
}

fn statement<'a>(program: &'a Program, layout: &'a Layout, before: usize) -> Result<Like<'a>, Reason> {
    let target = program.targets.get(before).ok_or(Reason::OnlyLinesAndArcs)?;
    if !matches!(target.motion, Motion::Linear | Motion::Circular) || target.role != Role::End {
        return Err(Reason::OnlyLinesAndArcs);
    }
    let text = &program.sources[0].bytes[target.span.range()];
    let lasting = lasting(text)?;
    if lasting.letter.eq_ignore_ascii_case(&b'A') {
        return Err(Reason::ArcMotion);
    }
    if target.editable != Editable::Pose {
        return Err(Reason::NoEditablePose);
    }
    let groups =
        |i: usize| program.targets[i].external.as_ref().map(|external| &external.groups[..]).unwrap_or_default();
    if before.checked_sub(1).is_some_and(|last| groups(last) != groups(before)) {
        return Err(Reason::OtherGroupMoves);
    }
    let site = layout.sites.get(before).copied().flatten().ok_or(Reason::NoEditablePose)?;
    match layout.positions.get(site as usize) {
        Some(position @ Position { body: Body::Pose(pose), .. }) => Ok(Like { text, lasting, position, pose }),
        _ => Err(Reason::NoEditablePose),
    }
}

/// Writes the inserts into `out`, which has the edits of the positions already. Returns each as the controller will store it.
pub(super) fn write(
    program: &Program,
    layout: &Layout,
    inserts: &[Insert],
    options: &RewriteOptions,
    out: &mut Rewritten,
) {
    if inserts.is_empty() {
        return;
    }
    let mut writer = Writer::new(program, layout, options);
    let is_kept = |i: usize| out.kept.binary_search_by_key(&i, |(kept, _)| *kept).is_ok();
    let mut lines = BTreeMap::new();
    for together in inserts.chunk_by(|a, b| a.before == b.before) {
        let before = together[0].before;
        let arc = program.targets.get(before).is_some_and(|target| target.motion == Motion::Circular);
        let whole = !arc || !(is_kept(before) || before.checked_sub(1).is_some_and(is_kept));
        let written = if whole { writer.positions(before, together) } else { Err(Reason::Arc) };
        match written {
            Ok((like, numbers, poses)) => {
                lines.insert(program.targets[before].span.start as usize, (like, numbers));
                out.inserted.extend(poses.into_iter().map(Some));
            }
            Err(why) => {
                out.inserted.extend(together.iter().map(|_| None));
                out.not_inserted.push((before, why));
            }
        }
    }
    let Some(edits) = out.edits.first_mut() else { return };
    let bytes = &program.sources[0].bytes;
    let shifts = Shifts::new(lines.iter().map(|(start, (_, numbers))| (*start, numbers.len())));
    edits.extend(renumber(bytes, &writer.lines, &writer.inner, |start| shifts.at(start)));
    for (start, (like, numbers)) in lines {
        let at = line_start(bytes, start);
        let mut text = Vec::new();
        for (k, points) in numbers.into_iter().enumerate() {
            let number = like.number().map(|number| number + shifts.before(start) + k as i64);
            line(bytes, (at, start), &like, number, points, &mut text);
        }
        edits.push(Edit { span: Span::new(at, at), content: Content::from_vec(text) });
    }
    if let (Some(last), false) = (layout.positions.last(), writer.text.is_empty()) {
        let at = Span { start: last.span.end, end: last.span.end };
        edits.push(Edit { span: at, content: Content::from_vec(writer.text) });
    }
    edits.sort_by_key(|edit| edit.span);
}

/// Edits that remove inserted motions; `spans` are their statements.
pub(super) fn removal(program: &Program, layout: &Layout, spans: &[Span]) -> Vec<Edit> {
    let bytes = &program.sources[0].bytes;
    let (lines, inner) = counted(bytes);
    let taken: BTreeSet<Span> = spans.iter().copied().collect();
    let shifts = Shifts::new(taken.iter().map(|span| (span.start as usize, 1)));
    let left = lines.into_iter().zip(inner).filter(|(line, _)| !taken.contains(&line.span));
    let (left, inner): (Vec<Line<'_>>, Vec<bool>) = left.unzip();
    let mut edits: Vec<Edit> = renumber(bytes, &left, &inner, |start| -shifts.at(start)).collect();
    let without = |range: Range<usize>| Edit { span: Span::new(range.start, range.end), content: Content::new() };
    for span in &taken {
        let end = span.end as usize;
        edits.push(without(line_start(bytes, span.start as usize)..end + line_end(bytes, end).1));
    }
    let used = |by_taken: bool| {
        let by = |target: &Target| taken.contains(&target.span) == by_taken;
        let of = program.targets.iter().zip(&layout.sites).filter(|(target, _)| by(target));
        of.filter_map(|(_, site)| *site).collect::<BTreeSet<_>>()
    };
    for site in used(true).difference(&used(false)) {
        let span = layout.positions[*site as usize].span;
        let start = span.start as usize;
        let blanks = bytes[..start].iter().rev().take_while(|byte| byte.is_ascii_whitespace()).count();
        edits.push(without(start - blanks..span.end as usize));
    }
    edits.sort_by_key(|edit| edit.span);
    edits
}

/// Position, mm, and orientation, scalar first.
type Pair = ([f64; 3], [f64; 4]);

type Written<'a> = (Like<'a>, Vec<(Option<usize>, usize)>, Vec<Pair>);

struct Writer<'a> {
    program: &'a Program,
    layout: &'a Layout,
    options: &'a RewriteOptions<'a>,
    lines: Vec<Line<'a>>,
    inner: Vec<bool>,
    /// Largest number of a position.
    largest: usize,
    /// Number of statements, including the inserted ones.
    count: usize,
    /// New positions.
    text: Vec<u8>,
}

impl<'a> Writer<'a> {
    fn new(program: &'a Program, layout: &'a Layout, options: &'a RewriteOptions<'a>) -> Self {
        let bytes = &program.sources[0].bytes;
        let (lines, inner) = counted(bytes);
        let (count, largest) = (lines.len(), largest(bytes, &lines, layout));
        Self { program, layout, options, lines, inner, largest, count, text: Vec::new() }
    }

    /// Adds the positions of all motions that are inserted before a target, or none. Returns the form of the motions, the numbers of their
    /// circle points and ends, and the poses as the controller will store them.
    fn positions(&mut self, before: usize, inserts: &[Insert]) -> Result<Written<'a>, Reason> {
        let like = statement(self.program, self.layout, before)?;
        let points = inserts.len() + inserts.iter().filter(|insert| insert.via.is_some()).count();
        if self.largest + points > MOST_POINTS {
            return Err(Reason::NoPositionNumbers);
        }
        if self.count + inserts.len() > MOST_LINES {
            return Err(Reason::NoLineNumbers);
        }
        let (mut text, mut numbers, mut poses, mut largest) = (Vec::new(), Vec::new(), Vec::new(), self.largest);
        for insert in inserts {
            let mut add = |pose, conf, external| {
                largest += 1;
                let held = self.position(&like, largest, pose, conf, external, &mut text)?;
                Ok::<_, Reason>((largest, held))
            };
            let via = insert.via.map(|via| add(via, None, insert.external)).transpose()?;
            let (end, pose) = add((insert.position_mm, insert.quat), insert.conf, insert.external)?;
            numbers.push((via.map(|(number, _)| number), end));
            poses.push(pose);
        }
        self.text.append(&mut text);
        (self.largest, self.count) = (largest, self.count + inserts.len());
        Ok((like, numbers, poses))
    }

    /// A copy of the target's position (groups, frames, configuration) with other numbers.
    fn position(
        &self,
        like: &Like<'_>,
        number: usize,
        (position_mm, quat): Pair,
        conf: Option<Conf>,
        external: Option<[Option<f64>; EXTERNAL_AXES]>,
        out: &mut Vec<u8>,
    ) -> Result<Pair, Reason> {
        let bytes = &self.program.sources[0].bytes;
        let (span, pose) = (like.position.span.range(), like.pose);
        let (after, _) = position::head(&bytes[span.clone()]).map_err(|_| Reason::NoEditablePose)?;
        let body = span.end - after.len();
        let decimals = DECIMALS.min(self.options.position_decimals);
        let mut edits = Vec::new();
        let mut put = |place: Span, value: f64, decimals: usize| {
            let new = New::of(&bytes[place.range()], value, decimals);
            if let Some(token) = new.token {
                let span = Span::new(place.start as usize - body, place.end as usize - body);
                edits.push(Edit { span, content: Content::from_slice(&token) });
            }
            single(new.value.unwrap_or(value))
        };
        let [r, p, w] = zyx_deg(&rotation(quat));
        let [x, y, z] = position_mm;
        let [_, _, _, w0, p0, r0] = pose.values;
        let [w, p, r] = nearest([w, p, r], [w0, p0, r0]);
        let mut held = [x, y, z, w, p, r];
        for (place, value) in pose.tokens.iter().zip(&mut held) {
            *value = put(*place, *value, decimals);
        }
        if let (Some(Conf::Turns(wanted)), Some(written)) = (conf, pose.config) {
            if wanted.posture != written.config.posture {
                return Err(Reason::ConfigChanges);
            }
            for (place, turn) in written.tokens.iter().zip(wanted.turns) {
                put(*place, f64::from(turn), 0);
            }
        }
        if let Some(external) = external {
            let tokens = position::external_tokens(bytes, like.position);
            for (place, value) in tokens.into_iter().zip(external) {
                if let (Some(place), Some(value)) = (place, value) {
                    put(place, value, decimals);
                }
            }
        }
        edits.sort_by_key(|edit| edit.span);
        out.extend_from_slice(line_end(bytes, span.start).0);
        out.extend_from_slice(format!("P[{number}]{{").as_bytes());
        // Writing to a Vec cannot fail.
        let _ = apply(after, &edits, out);
        let [x, y, z, w, p, r] = held;
        Ok(([x, y, z], quaternion(&from_zyx_deg([r, p, w]))))
    }
}

/// The largest number of a position, also of one that cannot be read, or in a statement.
fn largest(bytes: &[u8], lines: &[Line<'_>], layout: &Layout) -> usize {
    let named = |text: &[u8]| {
        let numbers = memchr::memmem::find_iter(text, b"P[").filter_map(|at| {
            let within = brackets(&text[at + 1..]).ok()?.1;
            let len = within.iter().take_while(|byte| byte.is_ascii_digit()).count();
            std::str::from_utf8(&within[..len]).ok()?.parse().ok()
        });
        numbers.max().unwrap_or(0)
    };
    let remark = |line: &&Line<'_>| line.text.starts_with(b"!") || line.text.starts_with(b"//");
    let in_lines = lines.iter().filter(|line| !remark(line)).map(|line| named(&line.text.to_ascii_uppercase())).max();
    let in_positions = sections(bytes).positions.map_or(0, |section| named(&bytes[section].to_ascii_uppercase()));
    let own = layout.positions.iter().map(|position| position.number as usize).max();
    in_lines.max(own).unwrap_or(0).max(in_positions)
}

/// `  12:C P[31]    :  P[32] 30mm/sec CNT100 ACC80    ;`, in the layout of the statement before which it is inserted.
fn line(
    bytes: &[u8],
    (at, start): (usize, usize),
    like: &Like<'_>,
    number: Option<i64>,
    (via, end): (Option<usize>, usize),
    out: &mut Vec<u8>,
) {
    let Lasting { letter_at, points, speed, options, .. } = &like.lasting;
    let digits = numbers(like.text).unwrap_or(0);
    match number {
        Some(number) => {
            let blanks = bytes[at..start].iter().rev().take_while(|byte| **byte == b' ').count();
            out.extend_from_slice(&bytes[at..start - blanks]);
            out.extend_from_slice(format!("{number:>width$}", width = blanks + digits).as_bytes());
        }
        None => out.extend_from_slice(&bytes[at..start]),
    }
    out.extend_from_slice(&like.text[digits..*letter_at]);
    let small = like.text[*letter_at].is_ascii_lowercase();
    out.push(match (via.is_some(), small) {
        (true, false) => b'C',
        (true, true) => b'c',
        (false, false) => b'L',
        (false, true) => b'l',
    });
    out.extend_from_slice(&like.text[letter_at + 1..points[0].start]);
    if let Some(via) = via {
        out.extend_from_slice(format!("P[{via}]").as_bytes());
        let second = points.get(1).map_or(points[0].end, |second| second.start);
        out.extend_from_slice(&like.text[points[0].end..second]);
    }
    out.extend_from_slice(format!("P[{end}]").as_bytes());
    if !speed.is_empty() {
        out.push(b' ');
        out.extend_from_slice(speed);
    }
    // No stop, because the tool would dwell in the cut. The path is almost straight there, so that nothing is rounded.
    out.extend_from_slice(b" CNT100");
    for option in options {
        out.push(b' ');
        out.extend_from_slice(option);
    }
    let is_over = like.text.iter().rev().take_while(|byte| byte.is_ascii_whitespace() || **byte == b';').count();
    out.extend_from_slice(&like.text[like.text.len() - is_over..]);
    out.extend_from_slice(line_end(bytes, start + like.text.len()).0);
}
