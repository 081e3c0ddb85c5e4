//! A line of material through the blank.

use super::blank::Blank;
use smallvec::{SmallVec, smallvec};

/// The owner of ends that nothing has cut.
pub(super) const BLANK: u32 = 0;

/// Less than this on a line is no cut, m: rounding to single precision leaves as much of a floor that is passed twice.
pub(super) const LEAST_CUT: f64 = 1e-7;

/// An interval of material, m above the lowest point of the blank, with the owners of its ends: 0 for the blank, otherwise the number of
/// the sweep, from 1. If a line has no material left, one empty interval remains for its owner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Span {
    pub(super) low: f32,
    pub(super) high: f32,
    pub(super) low_by: u32,
    pub(super) high_by: u32,
}

/// A line: its intervals of material from below, and the sweep that has come nearest to its top since the top was cut.
#[derive(Debug)]
pub(super) struct Line {
    pub(super) spans: SmallVec<[Span; 1]>,
    pub(super) near_by: u32,
    pub(super) near: f32,
    /// The cut that changed it last, and the indices in the history of its first and its last earlier state.
    pub(super) changed: u32,
    pub(super) first: u32,
    pub(super) last: u32,
}

impl Clone for Line {
    #[inline]
    fn clone(&self) -> Self {
        // Copies bytes: `SmallVec::clone` would copy span by span.
        Self { spans: SmallVec::from_slice(&self.spans), ..*self }
    }
}

impl Line {
    pub(super) fn of(blank: &Blank, [x, y]: [f64; 2], bottom: f64) -> Self {
        let mut line =
            Self { spans: SmallVec::new(), near_by: BLANK, near: f32::INFINITY, changed: 0, first: 0, last: 0 };
        blank.spans(x, y, |low, high| {
            let (low, high) = (single(low - bottom), single(high - bottom));
            line.spans.push(Span { low, high, low_by: BLANK, high_by: BLANK });
        });
        line
    }

    /// Length of material, m.
    pub(super) fn length(&self) -> f64 {
        self.spans.iter().map(|span| f64::from(span.high) - f64::from(span.low)).sum()
    }

    pub(super) fn top(&self) -> Option<f64> {
        self.spans.last().filter(|span| span.high > span.low).map(|span| f64::from(span.high))
    }

    /// Whether a sweep has touched its top, so that none can be nearer.
    #[inline]
    pub(super) fn is_touched(&self) -> bool {
        f64::from(self.near) <= LEAST_CUT
    }

    /// Whether a cut at or above a height (m) cannot change it: its top is no higher, and has been touched.
    #[inline]
    pub(super) fn lies_under(&self, height: f64) -> bool {
        self.is_touched() && self.spans.last().is_none_or(|span| f64::from(span.high) <= height + LEAST_CUT)
    }

    /// Whether it has material within a distance of a height, m.
    #[inline]
    pub(super) fn has_material(&self, height: f64, within: f64) -> bool {
        self.spans.iter().any(|span| {
            let (low, high) = (f64::from(span.low), f64::from(span.high));
            high > low && (low - within..=high + within).contains(&height)
        })
    }

    /// Removes an interval. Returns the length that was material, m.
    pub(super) fn cut(&mut self, low: f64, high: f64, by: u32) -> f64 {
        let mut removed = 0.0;
        let mut i = 0;
        while i < self.spans.len() {
            let span = self.spans[i];
            let (bottom, top) = (f64::from(span.low), f64::from(span.high));
            if high.min(top) - low.max(bottom) <= LEAST_CUT {
                i += 1;
                continue;
            }
            let below = (low > bottom + LEAST_CUT).then(|| Span { high: single(low), high_by: by, ..span });
            let above = (high < top - LEAST_CUT).then(|| Span { low: single(high), low_by: by, ..span });
            let left = |part: &Option<Span>| part.map_or(0.0, |s| f64::from(s.high) - f64::from(s.low));
            removed += top - bottom - left(&below) - left(&above);
            match (below, above) {
                (Some(below), Some(above)) => {
                    self.spans[i] = below;
                    self.spans.insert(i + 1, above);
                    i += 2;
                }
                (Some(part), None) | (None, Some(part)) => {
                    self.spans[i] = part;
                    i += 1;
                }
                (None, None) => {
                    self.spans.remove(i);
                    if self.spans.is_empty() {
                        self.spans = smallvec![Span { low: span.low, high: span.low, low_by: by, high_by: by }];
                        i = 1;
                    }
                }
            }
        }
        if removed > 0.0 {
            (self.near_by, self.near) = (BLANK, f32::INFINITY);
        }
        removed
    }

    /// Remembers a sweep that came nearer to the top than any before.
    #[inline]
    pub(super) fn pass(&mut self, distance: f64, by: u32) {
        (self.near_by, self.near) = (by, single(distance));
    }
}

#[expect(clippy::cast_possible_truncation, reason = "lines are kept in single precision: 0.00004 mm at 600 mm")]
fn single(value: f64) -> f32 {
    value as f32
}
