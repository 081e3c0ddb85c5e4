//! The state between statements: an arc whose end has not come yet, a matrix in comments, a drilling cycle.

use super::arc::Circle;
use super::lex::Record;
use super::modal::{Feed, Xyz};

/// An arc that was read, and whose end has not come yet.
#[derive(Clone, Copy, Debug)]
pub(super) struct PendingArc {
    pub(super) circle: Circle,
    pub(super) centres: [Option<Xyz>; 2],
    pub(super) record: Record,
    /// How well the direction of travel is known.
    pub(super) sense: Known,
}

/// The source of an arc's direction of travel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Known {
    /// The text states it.
    Stated,
    /// The convention of the system that wrote the file.
    Dialect,
    /// A guess: the convention of most CAM systems.
    Guessed,
}

/// An arc among the targets whose direction of travel is not stated.
#[derive(Clone, Copy, Debug)]
pub(super) struct Checked {
    pub(super) arc: PendingArc,
    pub(super) start: [f64; 3],
    pub(super) end: [f64; 3],
}

/// A CATIA matrix in comments, with the rows so far.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct MatrixRows {
    pub(super) open: bool,
    pub(super) rows: usize,
    pub(super) values: [f64; 12],
}

/// The hole at a position under a cycle; lengths are in printed units, above the hole's mouth along the tool axis.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Hole {
    /// Height at which feed begins.
    pub(super) clear: f64,
    /// Height to which rapid travel goes.
    pub(super) approach: f64,
    /// Height of the retraction; `None` for the height from which the tool came.
    pub(super) retract: Option<f64>,
    pub(super) depth: f64,
    /// Depths of pecks, rising, the last one the depth.
    pub(super) pecks: Vec<f64>,
    /// Whether the tool stays in the hole between pecks.
    pub(super) breaks_chips: bool,
    /// Whether it retracts with feed.
    pub(super) feeds_out: bool,
    pub(super) feed: Option<Feed>,
    pub(super) dwell: f64,
}

/// The cycle in force, and the one that `CYCLE/ON` restores.
#[derive(Clone, Debug, Default)]
pub(super) struct Cycle {
    pub(super) active: Option<Hole>,
    pub(super) last: Option<Hole>,
    /// Height above the mouth before the first hole, for a retraction to the height from which the tool came.
    pub(super) initial: Option<f64>,
    /// Whether the cycle was refused: its positions are no path.
    pub(super) refused: bool,
}

impl Cycle {
    pub(super) fn is_active(&self) -> bool {
        self.active.is_some() || self.refused
    }

    /// The hole at a position; `None` under a refused cycle.
    pub(super) fn hole(&self) -> Option<Hole> {
        self.active.clone()
    }
}
