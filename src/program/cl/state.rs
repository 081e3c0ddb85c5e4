//! What holds from one statement to the next: an arc without its end yet, a matrix in comments, a drilling cycle.

use super::arc::Circle;
use super::lex::Record;
use super::modal::{Feed, Xyz};

/// Arc read, its end not yet.
#[derive(Clone, Copy, Debug)]
pub(super) struct PendingArc {
    pub(super) circle: Circle,
    pub(super) centres: [Option<Xyz>; 2],
    pub(super) record: Record,
    /// How well the direction of travel is known.
    pub(super) sense: Known,
}

/// How well an arc's direction of travel is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Known {
    /// The text says it.
    Said,
    /// The system that wrote the file prints it so.
    Dialect,
    /// It is not declared: what most CAM systems do.
    Guessed,
}

/// An arc whose direction of travel no word says, already among the targets.
#[derive(Clone, Copy, Debug)]
pub(super) struct Checked {
    pub(super) arc: PendingArc,
    pub(super) start: [f64; 3],
    pub(super) end: [f64; 3],
}

/// A CATIA matrix in comments: rows still to come.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct MatrixRows {
    pub(super) open: bool,
    pub(super) rows: usize,
    pub(super) values: [f64; 12],
}

/// What becomes of a position under a cycle; lengths in printed units, over the hole's mouth along the tool axis.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Hole {
    /// Where feed begins.
    pub(super) clear: f64,
    /// Where rapid travel arrives.
    pub(super) approach: f64,
    /// Where the tool is retracted to; back to where it came from where that is left to the machine.
    pub(super) retract: Option<f64>,
    pub(super) depth: f64,
    /// Depths of pecks, rising, the last one the depth.
    pub(super) pecks: Vec<f64>,
    /// Between pecks the tool stays in the hole.
    pub(super) breaks_chips: bool,
    /// It comes out with feed.
    pub(super) feeds_out: bool,
    pub(super) feed: Option<Feed>,
    pub(super) dwell: f64,
}

/// The cycle in force, and the one that `CYCLE/ON` brings back.
#[derive(Clone, Debug, Default)]
pub(super) struct Cycle {
    pub(super) active: Option<Hole>,
    pub(super) last: Option<Hole>,
    /// Height over the mouth before the first hole, for a retraction that is left to the machine.
    pub(super) initial: Option<f64>,
    /// A cycle that was refused: its positions are no path.
    pub(super) refused: bool,
}

impl Cycle {
    pub(super) fn is_active(&self) -> bool {
        self.active.is_some() || self.refused
    }

    /// What a position stands for; none under a cycle that was refused.
    pub(super) fn hole(&self) -> Option<Hole> {
        self.active.clone()
    }
}
