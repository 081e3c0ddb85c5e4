//! The places of the number tokens of positions.

use super::frame::Frame;
use super::modal::Xyz;

/// The places of the number tokens of positions.
#[derive(Debug, Default)]
pub(crate) struct Layout {
    /// Frames of printed positions.
    pub(super) frames: Vec<Frame>,
    /// One for each target.
    pub(super) slots: Vec<Slot>,
    /// Arcs and holes, in order.
    pub(super) groups: Vec<GroupSlot>,
    /// Starts printed by `FROM`, in order.
    pub(super) starts: Vec<StartSlot>,
    /// Height of the printed point above the tip along the axis, mm, one for each tool.
    pub(super) raised_mm: Vec<f64>,
    /// Whether the file is a deck of cards: no text may extend past column 72.
    pub(super) cards: bool,
}

/// The part of the text from which a target comes.
#[derive(Clone, Copy, Debug)]
pub(super) enum Slot {
    /// Three numbers.
    Point { xyz: Xyz, frame: u16 },
    /// Three increments from the target before.
    Step { xyz: Xyz, frame: u16 },
    /// One increment along the tool axis.
    AlongAxis { frame: u16 },
    /// Nothing of its own: a point of an arc before its end, or in a hole.
    OnWay { group: u32 },
    /// The end of an arc, or the bottom of a hole.
    GroupEnd { xyz: Xyz, frame: u16, group: u32 },
    /// The end of an arc, as increments from its start.
    StepEnd { frame: u16, group: u32 },
}

impl Slot {
    pub(super) fn group(&self) -> Option<u32> {
        match self {
            Self::OnWay { group } | Self::GroupEnd { group, .. } | Self::StepEnd { group, .. } => Some(*group),
            _ => None,
        }
    }

    /// The frame in which it is printed.
    pub(super) fn frame(&self) -> Option<u16> {
        match self {
            Self::Point { frame, .. }
            | Self::Step { frame, .. }
            | Self::AlongAxis { frame }
            | Self::GroupEnd { frame, .. }
            | Self::StepEnd { frame, .. } => Some(*frame),
            Self::OnWay { .. } => None,
        }
    }
}

/// The numbers that move together with an arc or a hole.
#[derive(Clone, Copy, Debug)]
pub(super) struct GroupSlot {
    /// Its first target.
    pub(super) first: usize,
    /// An arc's centre, as often as printed.
    pub(super) centres: [Option<Xyz>; 2],
    /// Whether it is no arc that can be followed, so that the motion to its end is straight.
    pub(super) straight: bool,
    /// Whether it begins at the target before it, so that both move together (arcs).
    pub(super) with_start: bool,
}

/// A start that `FROM` prints.
#[derive(Clone, Copy, Debug)]
pub(super) struct StartSlot {
    /// The target of the first motion from there.
    pub(super) first: usize,
    pub(super) xyz: Xyz,
    pub(super) frame: u16,
}
