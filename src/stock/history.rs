//! The stock as it was at a moment: it can be read while other threads cut on, or have cut on.

use super::line::{BLANK, Line};
use super::sweep::{Cut, Sweep};
use nalgebra::Vector3;

/// A moment of a [`Stock`](super::Stock): what has been swept up to then.
#[derive(Clone, Copy, Debug)]
pub struct Moment {
    /// Cuts up to then.
    pub(super) cuts: u32,
    /// Sweeps up to then.
    pub(super) sweeps: u32,
    /// The last of these as it was then: it grows while the tool goes straight on.
    pub(super) last: Option<Sweep>,
}

impl Moment {
    /// After all that has been swept.
    pub(super) const LATEST: Self = Self { cuts: u32::MAX, sweeps: BLANK, last: None };

    /// The number of the last sweep, where a way (m) goes straight on from it to a tip: no point of a cutter's front there is in
    /// it, and those on the silhouette need no test whether they are.
    pub(super) fn before(&self, tip: &Vector3<f64>, way: &Vector3<f64>) -> u32 {
        self.last.filter(|last| last.leads_to(tip, way)).map_or(BLANK, |_| self.sweeps)
    }
}

/// What the lines of a band were before they were changed, as far as it is kept.
#[derive(Debug, Default)]
pub(super) struct History {
    /// Cuts before the history began.
    start: u32,
    kept: Option<Vec<Kept>>,
}

/// A line as it was until a cut, and where what it was next is.
#[derive(Debug)]
struct Kept {
    line: Line,
    until: u32,
    next: u32,
}

impl History {
    /// Keeps what lines are from now on, and nothing of what they were before.
    pub(super) fn begin(&mut self, cuts: u32) {
        let mut kept = self.kept.take().unwrap_or_default();
        kept.clear();
        (self.kept, self.start) = (Some(kept), cuts);
    }

    /// Keeps nothing any more.
    pub(super) fn end(&mut self) {
        self.kept = None;
    }

    /// A line as it was after so many cuts, since the history began.
    ///
    /// From the oldest on: the places that are read are mostly about to be cut then.
    #[inline]
    pub(super) fn at<'a>(&'a self, line: &'a Line, cuts: u32) -> &'a Line {
        if line.changed <= cuts {
            return line;
        }
        let mut at = line.first;
        while let Some(kept) = self.kept.as_ref().and_then(|all| all.get(at as usize)) {
            if kept.until > cuts {
                return &kept.line;
            }
            at = kept.next;
        }
        line
    }

    #[inline]
    fn keep(&mut self, line: &mut Line, cut: u32) {
        if line.changed == cut {
            return;
        }
        if let Some(all) = &mut self.kept {
            let new = u32::try_from(all.len()).unwrap_or(u32::MAX);
            if line.changed <= self.start {
                line.first = new;
            } else if let Some(before) = all.get_mut(line.last as usize) {
                before.next = new;
            }
            all.push(Kept { line: line.clone(), until: cut, next: u32::MAX });
            line.last = new;
        }
        line.changed = cut;
    }

    /// [`Line::cut`].
    #[inline]
    pub(super) fn cut(&mut self, line: &mut Line, low: f64, high: f64, cut: &Cut) -> f64 {
        self.keep(line, cut.number);
        line.cut(low, high, cut.by)
    }

    /// [`Line::pass`].
    #[inline]
    pub(super) fn pass(&mut self, line: &mut Line, distance: f64, cut: &Cut) {
        if distance < f64::from(line.near) {
            // Only the next move needs to know how near it came.
            if line.near_by != cut.by {
                self.keep(line, cut.number);
            }
            line.pass(distance, cut.by);
        }
    }
}
