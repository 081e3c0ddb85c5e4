//! Where the motions of a run end: the starts of lines that do not begin at the target before.

use crate::Target;
use crate::target::EndPosition;
use deflex_lang::ir::SourceSpan;
use deflex_lang::run::Moved;
use std::collections::HashMap;

/// The last executed motion of each statement, with the position at its end.
#[derive(Default)]
pub(crate) struct Ends<'a>(HashMap<SourceSpan, (&'a Moved, Option<EndPosition>)>);

impl<'a> Ends<'a> {
    /// Records that a motion ends at a target.
    pub(crate) fn add(&mut self, moved: &'a Moved, target: &Target) {
        self.0.insert(moved.place, (moved, EndPosition::of(target)));
    }

    /// The position at which the path of a motion begins. It is known only if the last execution of the statement before it ended there.
    pub(crate) fn begin_of(&self, moved: &Moved) -> Option<EndPosition> {
        let end = moved.begins.as_ref()?;
        let (before, position) = self.0.get(&end.place)?;
        position.filter(|_| before.ends_at(end))
    }
}
