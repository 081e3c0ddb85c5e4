//! A chunk of a long program: a stretch of its text, with a head and an end that make it a program.

use super::index::Entry;
use super::kinds::Kinds;
use super::lines::END;
use super::routines::StretchPart;
use crate::chunk::Elsewhere;
use crate::{Mark, Program};
use deflex_text::Source;
use std::ops::Range;
use std::sync::Arc;

/// A stretch of a program, with a head and an end that make it a program.
#[derive(Debug)]
pub struct Chunk {
    pub(super) dialect: &'static str,
    pub(super) context: Arc<[Source]>,
    /// Head, stretch and end.
    pub(super) source: Source,
    /// Bytes of the head.
    pub(super) head: usize,
    /// The bytes of it that are in the file: the stretch, in the first chunk also the head, and in the last one also the file's own end.
    pub(super) own: Range<usize>,
    /// The statements.
    pub(super) stretch: Range<usize>,
    /// Lines of the file before the stretch.
    pub(super) lines_before: usize,
    /// Whether the head has no robtarget of its own, and no module of context declares any.
    pub(super) plain_head: bool,
    /// The declarations that were put into the head.
    pub(super) declared: Range<usize>,
    /// The meaning of lines after this head.
    pub(super) kinds: Arc<Kinds>,
    pub(super) mark_before: Option<Mark>,
    /// Declarations of targets that are elsewhere in the file.
    pub(super) elsewhere: Vec<Elsewhere>,
    /// Offset of `own` in the file, if it matters.
    pub(super) at: u64,
    /// Lines of the stretch at which it continues elsewhere in the file, with their line numbers in the file.
    pub(super) lines: Vec<(usize, usize)>,
    /// Number of motions before it.
    pub(super) motions_before: u32,
    pub(super) motions: u32,
    pub(super) last_line: usize,
    pub(super) mark_at_end: Option<Mark>,
    pub(super) last: bool,
}

impl Chunk {
    /// Bytes of the file in this chunk.
    #[must_use]
    pub fn len(&self) -> usize {
        self.own.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.own.is_empty()
    }

    /// The head of the program itself, with a declaration in place of those of the chunk.
    pub(super) fn head_with(&self, declaration: &[u8]) -> Vec<u8> {
        let head = &self.source.bytes[..self.head];
        [&head[..self.declared.start], declaration, &head[self.declared.end..]].concat()
    }

    /// The program of one statement after a head.
    pub(super) fn program_of(&self, head: Vec<u8>, statement: &[u8]) -> Option<Program> {
        let source = Source::new(self.source.name.clone(), [&head, statement, END].concat());
        super::read_as(self.dialect, vec![source], Vec::new()).ok()
    }

    /// The stretch.
    pub(super) fn body(&self) -> &[u8] {
        &self.source.bytes[self.stretch.clone()]
    }

    /// Puts declarations from elsewhere in the file into the head, at an offset.
    pub(super) fn declare(&mut self, data: usize, text: &[u8], entries: &[Entry]) {
        let mut start = data;
        for entry in entries {
            let own = start..start + entry.len as usize;
            start = own.end;
            match self.elsewhere.last_mut() {
                // Neighbours that only this chunk uses are one stretch of the file.
                Some(last) if !last.shared && !entry.shared() && last.at + last.own.len() as u64 == entry.start => {
                    last.own.end = own.end;
                }
                _ => self.elsewhere.push(Elsewhere { own, at: entry.start, shared: entry.shared() }),
            }
        }
        let (before, after) = self.source.bytes.split_at(data);
        self.source.bytes = [before, text, after].concat();
        let shifted = |range: &Range<usize>| range.start + text.len()..range.end + text.len();
        (self.own, self.stretch) = (shifted(&self.own), shifted(&self.stretch));
        self.head += text.len();
        self.declared = data..data + text.len();
        // More than there are: see `Declared`.
        self.source.lines_before -= entries.len();
    }

    /// Sets the places in the file of the parts of the stretch.
    pub(super) fn place(&mut self, parts: &[StretchPart]) {
        let mut end = self.stretch.start;
        // The end of the last chunk is not in the file.
        self.own = end..end;
        for part in parts {
            let own = std::mem::replace(&mut self.own, end..end + part.len);
            let at = std::mem::replace(&mut self.at, part.start);
            end = self.own.end;
            if !self.lines.is_empty() {
                self.elsewhere.push(Elsewhere { own, at, shared: false });
            }
            self.lines.push((part.running_line, part.line));
        }
    }
}
