//! Reads the targets of a chunk: by kinds of lines where possible, otherwise statement by statement.

use super::chunk::Chunk;
use super::streamable;
use crate::chunk::Elsewhere;
use crate::{Predecessor, StreamableChunk};
use std::ops::Range;

impl Chunk {
    /// Reads the chunk; `None` if it proves not streamable.
    #[must_use]
    pub fn read(mut self) -> Option<StreamableChunk> {
        let lines = std::mem::take(&mut self.lines);
        let mut chunk = match streamable::read(&self) {
            Some(read) => StreamableChunk {
                program: read.into_program(self.dialect, self.source),
                own: self.own,
                elsewhere: self.elsewhere,
                at: self.at,
                last: self.last,
            },
            None => self.read_plain()?,
        };
        for target in chunk.program.targets.iter_mut().filter(|_| !lines.is_empty()) {
            let line = target.line as usize;
            let (running, file) = lines[lines.partition_point(|(running, _)| *running <= line).checked_sub(1)?];
            target.line = u32::try_from(line - running + file).ok()?;
        }
        Some(chunk)
    }

    /// Reads every statement by itself.
    fn read_plain(self) -> Option<StreamableChunk> {
        let mut program = super::read_as(self.dialect, vec![self.source], self.context.to_vec()).ok()?;
        let streamable = super::Layout::of(&program).is_some_and(|layout| {
            // A mark after the last motion has no effect.
            let marks = self.last || layout.mark_at_end == self.mark_at_end;
            let held = || layout.plain && holds(layout, &self.own, &self.elsewhere);
            let kind = if self.elsewhere.is_empty() { layout.streamable } else { held() };
            kind && layout.motions == self.motions as usize && marks
        });
        // The two readers count such line ends differently.
        let lines = program.targets.last().is_none_or(|target| target.line as usize == self.last_line);
        for target in &mut program.targets {
            // The first target follows the end of the previous chunk.
            target.predecessor = Predecessor::Previous;
            target.ordinal = target.ordinal.checked_add(self.motions_before)?;
        }
        (streamable && lines && program.diagnostics.is_empty() && program.kept.is_empty()).then_some(StreamableChunk {
            program,
            own: self.own,
            elsewhere: self.elsewhere,
            at: self.at,
            last: self.last,
        })
    }
}

/// Whether all targets stand in the chunk's own text or in the declarations that were added for it.
fn holds(layout: &super::Layout, own: &Range<usize>, elsewhere: &[Elsewhere]) -> bool {
    layout.sites.iter().all(|site| match site {
        super::TargetInText::Literal { literal, .. } => {
            let span = layout.literals[*literal as usize].span().range();
            let after = elsewhere.partition_point(|declared| declared.own.end < span.end);
            let declared = elsewhere.get(after).is_some_and(|declared| declared.own.start <= span.start);
            declared || own.start <= span.start && span.end <= own.end
        }
        _ => true,
    })
}
