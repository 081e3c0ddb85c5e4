//! Where the number tokens of positions stand.

use super::frame::Frame;
use super::modal::Xyz;

/// Where the number tokens of positions stand.
#[derive(Debug, Default)]
pub(crate) struct Layout {
    /// Frames that positions are printed in.
    pub(super) frames: Vec<Frame>,
    /// One a target.
    pub(super) slots: Vec<Slot>,
    /// Arcs and holes, in order.
    pub(super) groups: Vec<GroupSlot>,
    /// Starts printed by `FROM`, in order.
    pub(super) starts: Vec<StartSlot>,
    /// How far the printed point stands up from the tip along the axis, mm, one a tool.
    pub(super) raised_mm: Vec<f64>,
    /// The file is a deck of cards: nothing may grow past column 72.
    pub(super) cards: bool,
}

impl Layout {
    /// Index of a frame, added where it is new.
    pub(super) fn frame(&mut self, frame: Frame) -> u16 {
        let at = self.frames.iter().position(|f| *f == frame).unwrap_or_else(|| {
            self.frames.push(frame);
            self.frames.len() - 1
        });
        u16::try_from(at).unwrap_or(u16::MAX)
    }
}

/// What of the text makes one target.
#[derive(Clone, Copy, Debug)]
pub(super) enum Slot {
    /// Three numbers.
    Point { xyz: Xyz, frame: u16 },
    /// Three increments from the target before.
    Step { xyz: Xyz, frame: u16 },
    /// One increment along the tool axis.
    AlongAxis { frame: u16 },
    /// Nothing of its own: a point on the way of an arc, or in a hole.
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

    /// The frame that it is printed in.
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

/// The numbers that an arc or a hole moves with, as a whole.
#[derive(Clone, Copy, Debug)]
pub(super) struct GroupSlot {
    /// Its first target.
    pub(super) first: usize,
    /// An arc's centre, as often as printed.
    pub(super) centres: [Option<Xyz>; 2],
    /// It is no arc that can be followed: the end is gone to straight.
    pub(super) straight: bool,
    /// It begins where the target before it is: both move alike (arcs).
    pub(super) with_start: bool,
}

/// A start that `FROM` prints.
#[derive(Clone, Copy, Debug)]
pub(super) struct StartSlot {
    /// The target that is first moved to from there.
    pub(super) first: usize,
    pub(super) xyz: Xyz,
    pub(super) frame: u16,
}
