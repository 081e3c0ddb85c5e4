//! Literals with one motion each. No other motion uses them, so a change becomes an edit at once. The result is that of
//! [`Writer::literals`](super::rewrite) and the steps after it.

use super::literal::{Literal, POSE};
use super::writer::{Pose, Writer, toward};
use super::{Given, TargetInText};
use crate::token::{MAX_DECIMALS, single};
use crate::{Change, Editable, Goal, RewriteOptions};
use deflex_text::number::{Fixed, Leading, Numbers, Printed, read_leading};
use deflex_text::{Content, Edit, Span};
use std::collections::HashMap;

/// Most bytes of a pose with new numbers; longer poses are edited token by token.
const ROOM: usize = 192;

/// Number of poses printed together.
const AHEAD: usize = 8;

/// Poses printed ahead, so that none is read right after it was written to memory.
#[derive(Default)]
struct Ahead {
    /// The layout of the last numbers.
    numbers: Option<Numbers>,
    printed: [Printed; AHEAD],
    /// Their texts, each from the first number to the last.
    texts: [Text; AHEAD],
    /// Whether each text exists and is valid as it is.
    valid: [bool; AHEAD],
}

/// Numbers with the text between them.
struct Text {
    bytes: [u8; ROOM],
    len: usize,
}

impl Default for Text {
    fn default() -> Self {
        Self { bytes: [0; ROOM], len: 0 }
    }
}

/// Whether each target has a literal of its own, in the order of the targets.
pub(super) fn is_own(sites: &[TargetInText]) -> bool {
    let mut next = 0;
    sites.iter().all(|site| match site {
        TargetInText::None => true,
        TargetInText::Literal { given: Given::Base, .. } | TargetInText::Offset(_) => false,
        TargetInText::Literal { literal, .. } => {
            next += 1;
            *literal + 1 == next
        }
    })
}

impl Writer<'_> {
    /// Edits all literals; returns the poses of all targets as the controller will hold them.
    pub(super) fn own(&mut self, changes: &[Option<Change>]) -> Vec<Pose> {
        let (nothing, nowhere) = (HashMap::new(), HashMap::new());
        let mut written = Vec::with_capacity(changes.len());
        if let Some(edits) = self.edits.first_mut() {
            edits.reserve(self.layout.literals.len());
        }
        let mut ahead = Ahead::default();
        let sites = &self.layout.sites;
        for i in 0..sites.len().min(changes.len()) {
            if i % AHEAD == 0 {
                self.print_ahead(i, changes, &mut ahead);
            }
            let (change, k) = (changes[i].as_ref(), i % AHEAD);
            if let (true, TargetInText::Literal { literal, .. }, Editable::Pose) =
                (ahead.valid[k], sites[i], self.program.targets[i].editable)
            {
                let [x, y, z, quat @ .., _] = ahead.printed[k].held;
                written.push(([x, y, z], quat));
                self.at_once(&self.layout.literals[literal as usize], &ahead.texts[k]);
                continue;
            }
            let (pose, change) = match (sites[i], self.program.targets[i].editable, change) {
                (TargetInText::Literal { literal, .. }, Editable::Pose, Some(change)) => {
                    let literal = &self.layout.literals[literal as usize];
                    (self.pose(i, literal, change), None)
                }
                (_, _, change) => (None, change),
            };
            self.keep(i, change, |writer| writer.reason(i));
            written.push(pose.unwrap_or_else(|| self.written(i, &[], &nothing, &nowhere)));
        }
        written
    }

    /// Edits a literal; returns its new pose, or `None` if the pose stays as written.
    fn pose(&mut self, i: usize, literal: &Literal, change: &Change) -> Option<Pose> {
        if let Some((edit, (position, quat))) = self.stretch(i, literal, change) {
            self.edits.get_mut(literal.source as usize)?.extend(edit);
            return Some((position, quat));
        }
        let print = self.print(i, literal, change);
        let (position, quat) = self.literal_pose(literal, Some(&print));
        self.edit_literal(literal, print);
        Some((position, quat))
    }

    /// Prints the next poses that have seven new numbers; most literals have the same decimals.
    fn print_ahead(&self, from: usize, changes: &[Option<Change>], ahead: &mut Ahead) {
        let RewriteOptions { position_decimals, quat_decimals, .. } = *self.options;
        let least = [position_decimals, quat_decimals].map(|least| u8::try_from(least).unwrap_or(Leading::ODD));
        let mut wanted = [[0.0; 8]; AHEAD];
        for k in 0..AHEAD {
            ahead.valid[k] = false;
            let (Some(TargetInText::Literal { literal, .. }), Some(Some(change))) =
                (self.layout.sites.get(from + k), changes.get(from + k))
            else {
                continue;
            };
            let Goal::Pose { quat: is, conf, .. } = self.program.targets[from + k].goal else { continue };
            let Some(quat) = change.turn(is) else { continue };
            if change.conf.is_some_and(|wanted| Some(wanted) != conf) || change.external.is_some() {
                continue;
            }
            let was = self.layout.literals[*literal as usize].pose_decimals();
            let mut decimals = [1; POSE + 1];
            for (i, decimals) in decimals[..POSE].iter_mut().enumerate() {
                *decimals = was[i].max(least[usize::from(i >= 3)]);
            }
            if k == 0 && !ahead.numbers.as_ref().is_some_and(|numbers| numbers.have(decimals)) {
                ahead.numbers = Numbers::new(decimals);
            }
            ahead.valid[k] = ahead.numbers.as_ref().is_some_and(|numbers| numbers.have(decimals));
            let ([x, y, z], [q1, q2, q3, q4]) = (change.position_mm, toward(quat, is));
            wanted[k] = [x, y, z, q1, q2, q3, q4, 0.0];
        }
        let Some(numbers) = &ahead.numbers else { return };
        for ((valid, wanted), printed) in ahead.valid.iter_mut().zip(&wanted).zip(&mut ahead.printed) {
            *valid = *valid && numbers.print(wanted, printed);
        }
        for k in 0..AHEAD {
            let valid = ahead.valid[k];
            ahead.valid[k] = valid && self.compose(from + k, &ahead.printed[k], &mut ahead.texts[k]).is_some();
        }
    }

    /// The text of new numbers; `None` if the literal must be edited token by token.
    fn compose(&self, i: usize, printed: &Printed, Text { bytes: text, len }: &mut Text) -> Option<()> {
        let (TargetInText::Literal { literal, .. }, Goal::Pose { position_mm, .. }) =
            (*self.layout.sites.get(i)?, self.program.targets.get(i)?.goal)
        else {
            return None;
        };
        let literal = &self.layout.literals[literal as usize];
        let bytes = &self.program.sources[literal.source as usize].bytes[..];
        let was = literal.pose_decimals();
        for k in (0..POSE).filter(|k| printed.may_be_the_same(*k, was[*k])) {
            let old = if k < 3 { position_mm[k] } else { read_leading(bytes.get(literal.token(k).range())?)?.value };
            #[allow(clippy::float_cmp)] // the very number keeps its looks
            if printed.values[k] == old {
                return None;
            }
        }
        let mut at = 0;
        for k in 0..POSE {
            if k > 0 {
                // The text between two numbers is kept.
                let between = bytes.get(literal.token(k - 1).range().end..literal.token(k).range().start)?;
                match between {
                    [one] => *text.get_mut(at)? = *one,
                    _ => text.get_mut(at..at + between.len())?.copy_from_slice(between),
                }
                at += between.len();
            }
            at += printed.put(k, text.get_mut(at..)?.first_chunk_mut()?);
        }
        *len = at;
        Some(())
    }

    /// Edits a pose by its new numbers, all of them at once.
    fn at_once(&mut self, literal: &Literal, text: &Text) {
        let bytes = &self.program.sources[literal.source as usize].bytes[..];
        let (span, text) = (literal.token(0).to(literal.token(POSE - 1)), &text.bytes[..text.len]);
        let changes = bytes.get(span.range()) != Some(text);
        if let Some(edits) = self.edits.get_mut(literal.source as usize).filter(|_| changes) {
            // Filled in place.
            edits.push(Edit { span, content: Content::new() });
            if let Some(edit) = edits.last_mut() {
                edit.content.extend_from_slice(text);
            }
        }
    }

    /// A pose whose numbers keep only their decimals: one edit from the first changed number to the last, and the new numbers as
    /// the controller holds them. `None` if the literal must be edited token by token.
    fn stretch(&self, i: usize, literal: &Literal, change: &Change) -> Option<(Option<Edit>, Pose)> {
        let Goal::Pose { position_mm, quat: is, conf } = self.program.targets[i].goal else { return None };
        if change.conf.is_some_and(|wanted| Some(wanted) != conf) || change.external.is_some() {
            return None;
        }
        let [x, y, z] = change.position_mm;
        let turn = change.turn(is).map(|wanted| toward(wanted, is));
        let [q1, q2, q3, q4] = turn.unwrap_or(is);
        let wanted = [x, y, z, q1, q2, q3, q4];
        let edited = if turn.is_some() { POSE } else { 3 };

        let RewriteOptions { position_decimals, quat_decimals, .. } = *self.options;
        let bytes = &self.program.sources[literal.source as usize].bytes[..];
        let mut held = [0.0; POSE];
        let mut text = [0; ROOM];
        // The position of the edit in the source, and the bytes of its text.
        let (mut start, mut done, mut len) = (0, 0, 0);
        for k in 0..POSE {
            let token = literal.token(k).range();
            let old = bytes.get(token.clone())?;
            let was = literal.decimals(k)?;
            if k >= edited {
                held[k] = single(read_leading(old)?.value);
                continue;
            }
            let least = if k < 3 { position_decimals } else { quat_decimals };
            let new = Fixed::of(wanted[k], was.max(least).min(MAX_DECIMALS))?;
            let value = new.value()?;
            held[k] = single(value);
            #[allow(clippy::float_cmp)] // the very number means no change
            let same = match k {
                0..3 => value == position_mm[k],
                _ if was < least => value == read_leading(old)?.value,
                // With equal decimals, the comparison of digits below decides.
                _ => false,
            };
            if same {
                continue;
            }
            // The text between two edited numbers is kept.
            let between = if len == 0 { &[][..] } else { bytes.get(done..token.start)? };
            match between {
                [one] => *text.get_mut(len)? = *one,
                _ => text.get_mut(len..len + between.len())?.copy_from_slice(between),
            }
            let at = len + between.len();
            let new_len = new.put(text.get_mut(at..)?.first_chunk_mut()?);
            if text.get(at..at + new_len)? == old {
                continue;
            }
            if len == 0 {
                start = token.start;
            }
            (done, len) = (token.end, at + new_len);
        }
        let edit = (len > 0).then(|| Edit { span: Span::new(start, done), content: Content::from_slice(&text[..len]) });
        let [x, y, z, quat @ ..] = held;
        Some((edit, ([x, y, z], quat)))
    }
}
