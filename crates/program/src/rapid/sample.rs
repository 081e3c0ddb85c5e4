//! Reads lines that resemble the line before.

use super::index::is_word;
use super::literal::{Literal, POSE, Written};
use super::shape::{Pose, Shape, pose};
use crate::{Conf, Goal};
use deflex_text::number::{Leading, read_leading};
use std::ops::Range;

/// The line before, with an inline robtarget: most lines differ from it only in the numbers of the pose.
pub(super) struct Sample<'a> {
    /// The text before the pose, from the point at which comparison starts.
    before: &'a [u8],
    pose: [Number<'a>; POSE],
    literal: Literal,
    /// The shape of the line, if the line before it had its numbers at the same columns.
    shape: Option<Shape>,
    /// The pose of the robtarget, if there is no shape.
    at: Pose,
    conf: Option<Conf>,
    /// Number of bytes of the line before the literal and after it.
    literal_at: usize,
    after: usize,
    /// Number of blanks at the start and the end of the line.
    pub(super) indent: usize,
    pub(super) trailing: usize,
}

/// The robtarget of a line that resembles another: borrowed, and copied once.
#[derive(Clone, Copy)]
pub(super) struct FoundTarget<'s> {
    /// A literal that differs from its own only in where it starts.
    pub(super) literal: &'s Literal,
    pub(super) start: u32,
    pub(super) pose: &'s Pose,
    pub(super) conf: &'s Option<Conf>,
}

impl FoundTarget<'_> {
    pub(super) fn literal(&self) -> Literal {
        let mut literal = *self.literal;
        literal.move_to(self.start);
        literal
    }

    #[inline]
    pub(super) fn goal(&self) -> Goal {
        let (position_mm, quat) = *self.pose;
        Goal::Pose { position_mm, quat, conf: *self.conf }
    }
}

/// A number of a line.
#[derive(Clone, Copy)]
struct Number<'a> {
    /// The number with the text up to the next number or the next line.
    text: &'a [u8],
    is: Leading,
}

impl<'a> Sample<'a> {
    /// A sample from a line, or from its part after `start`.
    pub(super) fn new(line: &'a [u8], start: usize, literal: Literal, written: &Written) -> Option<Self> {
        let at = |i: usize| literal.token(i).range().start - start;
        let mut pose = [Number { text: line, is: Leading::default() }; POSE];
        for (i, number) in pose.iter_mut().enumerate() {
            number.text = &line[at(i)..if i + 1 < POSE { at(i + 1) } else { line.len() }];
            number.is = read_leading(number.text).filter(|is| is.len() == literal.token(i).len())?;
        }
        // Without a line end, the text is not the whole line.
        line.ends_with(b"\n").then(|| Self {
            before: &line[..at(0)],
            pose,
            literal,
            shape: None,
            at: ([0.0; 3], [0.0; 4]),
            conf: written.conf,
            literal_at: literal.span().range().start - start,
            after: start + line.len() - literal.span().range().end,
            indent: line.len() - line.trim_ascii_start().len(),
            trailing: line.len() - line.trim_ascii_end().len(),
        })
    }

    /// Reads the line at `start` if it resembles this one, which it replaces: its robtarget, and its length with the line end.
    #[inline(always)]
    pub(super) fn read(&mut self, bytes: &'a [u8], start: usize) -> Option<(FoundTarget<'_>, usize)> {
        let soon = self.shape.as_mut().is_some_and(|shape| shape.read(bytes, start));
        let len = if soon {
            self.literal_at + self.literal.span().len() + self.after
        } else {
            self.read_closer(bytes, start)?
        };
        let start = u32::try_from(start + self.literal_at).ok()?;
        let pose = self.shape.as_ref().filter(|_| soon).map_or(&self.at, Shape::pose);
        Some((FoundTarget { literal: &self.literal, start, pose, conf: &self.conf }, len))
    }

    /// Reads the line number by number; returns its length with the line end.
    #[inline(never)]
    fn read_closer(&mut self, bytes: &'a [u8], start: usize) -> Option<usize> {
        let line = bytes.get(start..)?;
        let mut rest = line.strip_prefix(self.before)?;
        let mut places = [(0, Leading::default()); POSE];
        for (place, number) in places.iter_mut().zip(&mut self.pose) {
            let at = line.len() - rest.len() - self.literal_at;
            rest = match rest.strip_prefix(number.text) {
                Some(after) => after,
                None => {
                    let is = read_leading(rest)?;
                    let after = rest[is.len()..].strip_prefix(&number.text[number.is.len()..])?;
                    *number = Number { text: &rest[..rest.len() - after.len()], is };
                    after
                }
            };
            *place = (at, number.is);
        }
        let [x, y, z, quat @ ..] = places.map(|(_, number)| number.value);
        let len = line.len() - rest.len();
        let literal = self.literal.like(start + self.literal_at, len - self.after - self.literal_at, &places)?;
        self.shape = if literal.is_laid_out_like(&self.literal) {
            Shape::new(&line[..len], self.literal_at, &literal)
        } else {
            None
        };
        self.literal = literal;
        self.at = pose([x, y, z], quat)?;
        Some(len)
    }
}

/// The line before, which names its target.
pub(super) struct Named<'a> {
    /// The text before the name, and after it to the line end.
    before: &'a [u8],
    after: &'a [u8],
    pub(super) indent: usize,
    pub(super) trailing: usize,
}

impl<'a> Named<'a> {
    /// A sample from a line, with its line end, and the range of the name.
    pub(super) fn new(line: &'a [u8], name: Range<usize>) -> Option<Self> {
        line.ends_with(b"\n").then(|| Self {
            before: &line[..name.start],
            after: &line[name.end..],
            indent: line.len() - line.trim_ascii_start().len(),
            trailing: line.len() - line.trim_ascii_end().len(),
        })
    }

    /// The range of the name on the line at `start`, if only the name differs, and the length of the line with its line end.
    pub(super) fn read(&self, bytes: &[u8], start: usize) -> Option<(Range<usize>, usize)> {
        let rest = bytes.get(start..)?.strip_prefix(self.before)?;
        let len = rest.iter().position(|b| !is_word(*b))?;
        rest[len..].starts_with(self.after).then(|| {
            let name = start + self.before.len();
            (name..name + len, self.before.len() + len + self.after.len())
        })
    }
}
