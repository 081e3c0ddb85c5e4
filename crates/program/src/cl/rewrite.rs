//! Makes edits of number tokens for wanted positions.

use super::layout::{GroupSlot, Layout, Slot};
use super::lex::chunks;
use super::modal::Xyz;
use super::number::number;
use super::vector::{add, norm, scale, sub};
use crate::front_end::{FrontEnd, Wanted};
use crate::{Change, Goal, NO_TURN, Program, Reason, RewriteOptions, Rewritten};
use deflex_text::{Content, Edit, Source, Span, number as text_number};

/// Corrections that differ by less than this are equal, mm: below the last printed digit.
const SAME_MM: f64 = 1e-6;

/// Significant columns of a card.
const CARD_COLUMNS: usize = 72;

impl FrontEnd for Layout {
    /// An arc moves as a whole if all its points move equally. The tool axis stays as printed, and nothing is inserted: corrected CL programs
    /// are posted in another language instead.
    fn rewrite(&self, program: &Program, wanted: Wanted<'_>) -> Rewritten {
        let Wanted { changes, inserts, options } = wanted;
        let mut out = Rewritten { edits: vec![Vec::new(); program.written], ..Rewritten::default() };
        let Some(source) = program.sources.first() else { return out };
        let mut writer =
            Writer { source, layout: self, options, edits: Vec::new(), grown: Grown::default(), group: Ok(()) };
        // The displacement of each target, mm in the work object, after refusals.
        let mut moved: Vec<[f64; 3]> = Vec::with_capacity(changes.len());
        for (at, (target, change)) in program.targets.iter().zip(changes).enumerate() {
            let Goal::Axis { position_mm, .. } = target.goal else { continue };
            let wanted = change.as_ref().map_or([0.0; 3], |c| sub(c.position_mm, position_mm));
            let before = at.checked_sub(1).map_or([0.0; 3], |b| moved[b]);
            let result = if change.as_ref().is_some_and(|c| c.quat.is_some()) {
                Err(Reason::ToolAxisLeft)
            } else {
                writer.write(program, changes, at, wanted, before)
            };
            match result {
                Ok(()) => moved.push(wanted),
                Err(reason) => {
                    // An increment counts from the new position of the target before it.
                    let follows =
                        matches!(self.slots[at], Slot::Step { .. } | Slot::StepEnd { .. } | Slot::AlongAxis { .. });
                    moved.push(if follows { before } else { [0.0; 3] });
                    out.kept.push((at, reason));
                }
            }
            out.written.push((add(position_mm, moved[at]), NO_TURN));
        }
        out.inserted = vec![None; inserts.len()];
        writer.edits.sort_by_key(|e| e.span);
        if let Some(first) = out.edits.first_mut() {
            *first = writer.edits;
        }
        out
    }
}

struct Writer<'a> {
    source: &'a Source,
    layout: &'a Layout,
    options: &'a RewriteOptions<'a>,
    edits: Vec<Edit>,
    grown: Grown,
    /// Whether the arc or hole that is being written stays one.
    group: Result<(), Reason>,
}

/// Number of bytes by which each card has grown.
type Grown = std::collections::BTreeMap<usize, usize>;

impl Writer<'_> {
    /// Moves the target `at` by `wanted`, after the target before it has moved by `before`, mm.
    fn write(
        &mut self,
        program: &Program,
        changes: &[Option<Change>],
        at: usize,
        wanted: [f64; 3],
        before: [f64; 3],
    ) -> Result<(), Reason> {
        let slot = self.layout.slots[at];
        let start = self.layout.starts.binary_search_by_key(&at, |s| s.first).ok().map(|i| self.layout.starts[i]);
        // A target that counts from a printed start moves the start too.
        let before = if start.is_some() { wanted } else { before };
        match slot {
            Slot::Point { xyz, frame } => return self.shift(&[xyz], frame, wanted),
            Slot::Step { xyz, frame } => self.shift(&[xyz], frame, sub(wanted, before))?,
            Slot::AlongAxis { .. } if norm(sub(wanted, before)) > SAME_MM => {
                return Err(Reason::IncrementAlongAxis);
            }
            Slot::AlongAxis { .. } => {}
            Slot::OnWay { group } | Slot::GroupEnd { group, .. } | Slot::StepEnd { group, .. } => {
                let slot = &self.layout.groups[group as usize];
                if slot.straight {
                    self.group = Ok(());
                } else if slot.first == at {
                    self.group = self.rigid(program, changes, group, wanted, before);
                }
                self.group?;
            }
        }
        let centres = |group: u32| self.layout.groups[group as usize].centres.into_iter().flatten();
        match slot {
            Slot::GroupEnd { xyz, frame, group } => {
                let all: Vec<Xyz> = std::iter::once(xyz).chain(centres(group)).collect();
                self.shift(&all, frame, wanted)?;
            }
            Slot::StepEnd { frame, group } => {
                let all: Vec<Xyz> = centres(group).collect();
                self.shift(&all, frame, wanted)?;
            }
            _ => {}
        }
        start.map_or(Ok(()), |start| self.shift(&[start.xyz], start.frame, wanted))
    }

    /// An arc stays an arc if its start, its points and its end move equally; a hole stays a hole if all its motions do.
    fn rigid(
        &self,
        program: &Program,
        changes: &[Option<Change>],
        group: u32,
        wanted: [f64; 3],
        before: [f64; 3],
    ) -> Result<(), Reason> {
        let GroupSlot { first, with_start, .. } = self.layout.groups[group as usize];
        let alike = |at: usize| match (&changes[at], program.targets[at].goal) {
            (Some(c), Goal::Axis { position_mm, .. }) => norm(sub(sub(c.position_mm, position_mm), wanted)) <= SAME_MM,
            _ => norm(wanted) <= SAME_MM,
        };
        let mut members = (first..changes.len()).take_while(|&at| self.layout.slots[at].group() == Some(group));
        let from_start = !with_start || norm(sub(wanted, before)) <= SAME_MM;
        let varies = if with_start { Reason::VariesAlongArc } else { Reason::VariesAlongHole };
        if from_start && members.all(alike) { Ok(()) } else { Err(varies) }
    }

    /// Moves printed positions by an offset in the work object, mm: all of them, or none.
    fn shift(&mut self, positions: &[Xyz], frame: u16, offset_mm: [f64; 3]) -> Result<(), Reason> {
        let frame = &self.layout.frames[frame as usize];
        let offset = scale(frame.back(offset_mm), 1.0 / frame.mm_per_unit);
        // An inch needs more digits than a millimetre for the same step.
        let more = if frame.mm_per_unit > 1.0 { 2 } else { 0 };
        let edits_before = self.edits.len();
        let grown_before = if self.layout.cards { Some(self.grown.clone()) } else { None };
        for xyz in positions {
            for (span, by) in xyz.iter().zip(offset) {
                if let Err(reason) = self.number(*span, by, more) {
                    self.edits.truncate(edits_before);
                    self.grown = grown_before.unwrap_or_default();
                    return Err(reason);
                }
            }
        }
        Ok(())
    }

    fn number(&mut self, token: Span, by: f64, more: usize) -> Result<(), Reason> {
        if by == 0.0 {
            return Ok(());
        }
        let bytes = &self.source.bytes;
        let [head, tail] = chunks(bytes, token);
        let mut text = bytes[head.range()].to_vec();
        text.extend_from_slice(&bytes[tail.range()]);
        let Some(was) = number(&text) else { return Err(Reason::NumberUnreadable) };
        let decimals = decimals(&text).max(self.options.position_decimals + more);
        let mut new = Vec::with_capacity(text.len() + 4);
        text_number::write_fixed(&mut new, was + by, decimals);
        if number(&new) == Some(was) || number(&new) == number(&rounded(was, decimals)) {
            return Ok(());
        }
        if tail.is_empty() { self.whole(token, new) } else { self.cut(head, tail, new) }
    }

    /// Replaces a token on one line, right-aligned in its field as long as there are blanks before it.
    fn whole(&mut self, token: Span, mut new: Vec<u8>) -> Result<(), Reason> {
        let bytes = &self.source.bytes;
        let start = token.start as usize;
        let blanks = bytes[..start].iter().rev().take_while(|b| **b == b' ').count();
        // One blank stays: it may be the only separator of two numbers.
        let room = blanks.saturating_sub(1);
        let taken = new.len().saturating_sub(token.len()).min(room);
        let width = token.len() + taken;
        if blanks > 0 && new.len() < width {
            let pad = width - new.len();
            new.splice(0..0, std::iter::repeat_n(b' ', pad));
        }
        if self.layout.cards {
            while new.len() < width {
                new.insert(0, b' ');
            }
            if new.len() > width {
                self.grow_card(token.end as usize, new.len() - width)?;
            }
        }
        self.edits.push(Edit { span: Span::new(start - taken, token.end as usize), content: new.into() });
        Ok(())
    }

    /// Replaces a token on two lines: its first part keeps its length.
    fn cut(&mut self, head: Span, tail: Span, new: Vec<u8>) -> Result<(), Reason> {
        if self.layout.cards {
            return Err(Reason::NumberOverCards);
        }
        let at = head.len().min(new.len() - 1);
        self.edits.push(Edit { span: head, content: new[..at].into() });
        self.edits.push(Edit { span: tail, content: new[at..].into() });
        Ok(())
    }

    /// Removes blanks before column 73 of a card that has grown.
    fn grow_card(&mut self, at: usize, by: usize) -> Result<(), Reason> {
        let bytes = &self.source.bytes;
        let start = bytes[..at].iter().rposition(|b| matches!(b, b'\n' | b'\r')).map_or(0, |p| p + 1);
        let end = start + CARD_COLUMNS;
        let grown = self.grown.get(&start).copied().unwrap_or(0);
        let free = bytes[at..end.max(at)].iter().rev().take_while(|b| **b == b' ').count();
        if free < grown + by {
            return Err(Reason::NoRoomOnCard);
        }
        self.grown.insert(start, grown + by);
        self.edits.push(Edit { span: Span::new(end - grown - by, end - grown), content: Content::new() });
        Ok(())
    }
}

/// Number of digits of a token after the point, with its exponent taken into account.
fn decimals(token: &[u8]) -> usize {
    /// More digits than a double has.
    const MOST_DIGITS: i64 = 17;
    let exponent = token
        .iter()
        .position(|b| matches!(b, b'e' | b'E' | b'd' | b'D'))
        .and_then(|at| std::str::from_utf8(&token[at + 1..]).ok()?.parse::<i64>().ok());
    let printed = i64::try_from(text_number::decimals(token)).unwrap_or(MOST_DIGITS);
    usize::try_from((printed - exponent.unwrap_or(0)).clamp(0, MOST_DIGITS)).unwrap_or(0)
}

fn rounded(value: f64, decimals: usize) -> Vec<u8> {
    let mut out = Vec::new();
    text_number::write_fixed(&mut out, value, decimals);
    out
}
