//! The stock as it was at a moment: it can be read while other threads go on cutting, or after they did.

use super::line::{BLANK, Line};
use super::sweep::{Cut, Sweep};
use nalgebra::Vector3;

/// A moment of a [`Stock`](super::Stock): the cuts and sweeps up to then.
///
/// # Examples
/// ```
/// use nalgebra::Vector3;
/// use deflex_stock::{Blank, Stock};
///
/// let mut block = Stock::new(Blank::Box([Vector3::zeros(), Vector3::new(0.1, 0.1, 0.05)]), 1e-3);
/// block.keep_history();
/// let before_the_first_cut = block.now();
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Moment {
    /// Number of cuts up to then.
    pub(super) cuts: u32,
    /// Number of sweeps up to then.
    pub(super) sweeps: u32,
    /// The last sweep as it was then: a sweep grows while the tool moves straight on.
    pub(super) last: Option<Sweep>,
}

impl Moment {
    /// The moment after all sweeps.
    pub(super) const LATEST: Self = Self { cuts: u32::MAX, sweeps: BLANK, last: None };

    /// The number of the last sweep if a displacement (m) leads straight on from it to a tip: no point of the cutter's front at the tip is in
    /// that sweep, and points on the silhouette need no test.
    pub(super) fn before(&self, tip: &Vector3<f64>, displacement: &Vector3<f64>) -> u32 {
        self.last.filter(|last| last.leads_to(tip, displacement)).map_or(BLANK, |_| self.sweeps)
    }
}

/// The earlier states of a band's lines, as far as they are kept.
#[derive(Debug, Default)]
pub(super) struct History {
    /// Number of cuts before the history began.
    start: u32,
    kept: Option<Vec<Kept>>,
}

/// A line as it was until a cut, and the index of its next state.
#[derive(Debug)]
struct Kept {
    line: Line,
    until: u32,
    next: u32,
}

impl History {
    /// Keeps the states of lines from now on, and forgets all before.
    pub(super) fn begin(&mut self, cuts: u32) {
        let mut kept = self.kept.take().unwrap_or_default();
        kept.clear();
        (self.kept, self.start) = (Some(kept), cuts);
    }

    /// Stops keeping states.
    pub(super) fn end(&mut self) {
        self.kept = None;
    }

    /// A line as it was after `cuts` cuts; the history must have begun before.
    ///
    /// The search begins with the oldest state: the lines that are read were mostly uncut at that moment.
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
            // Only the next motion needs to know how near this one came.
            if line.near_by != cut.by {
                self.keep(line, cut.number);
            }
            line.pass(distance, cut.by);
        }
    }
}
