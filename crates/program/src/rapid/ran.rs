//! The statements that were run, and the targets of motions that were not.

use super::known::RoutineId;
use super::state::Standing;
use crate::Role;
use deflex_lang::ir::SourceSpan;
use deflex_text::Source;

/// The statements that were run: one bit for each byte at which a statement may begin.
#[derive(Default)]
pub(super) struct Ran(Vec<Vec<u64>>);

impl Ran {
    pub(super) fn new(sources: &[Source]) -> Self {
        Self(sources.iter().map(|source| vec![0; source.bytes.len() / 64 + 1]).collect())
    }

    pub(super) fn add(&mut self, source: u16, at: u32) {
        if let Some(word) = self.0[usize::from(source)].get_mut(at as usize / 64) {
            *word |= 1 << (at % 64);
        }
    }

    pub(super) fn has(&self, source: usize, at: u32) -> bool {
        self.0[source].get(at as usize / 64).is_some_and(|word| word & (1 << (at % 64)) != 0)
    }
}

/// An arc in a routine that nothing runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct UsedArc {
    /// The robtargets from which its circle point and its end are made.
    pub(super) roots: [Option<u32>; 2],
    /// See [`Use::by`].
    pub(super) by: Option<RoutineId>,
}

/// A step of a routine that nothing runs, from one motion to the next. `None` is a place that is not known: before the first motion of the
/// routine, after its last one, and where paths meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Step {
    pub(super) from: Option<Standing>,
    pub(super) to: Option<Standing>,
    /// Whether it may be a cut whose feed has another direction than in the program. The first motion of a routine has the direction of the
    /// next one.
    pub(super) cuts: bool,
}

/// The use of a target by a motion in a routine that nothing runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Use {
    /// File and start of the statement.
    pub(super) statement: (u16, u32),
    pub(super) root: u32,
    /// The first number of its offset.
    pub(super) offset: Option<SourceSpan>,
    pub(super) position_mm: [f64; 3],
    pub(super) way: Way,
    /// Whether it is a joint motion through air that goes by the configuration of the text.
    pub(super) is_free: bool,
    /// The routine that an operator started; `None` for uses by the program.
    pub(super) by: Option<RoutineId>,
}

/// The frames of a motion, whether it may cut, and whether the target is its end or its circle point, which is corrected in position only.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Way {
    pub(super) tool: u16,
    pub(super) wobj: u16,
    pub(super) cuts: bool,
    pub(super) role: Role,
}
