//! The statements that the reader of a language keeps as they are.

use crate::{Kept, Reason, UnknownMotion};
use deflex_text::{LineIndex, Source, Span};
use std::collections::HashSet;

/// The kept statements of a program so far, each once for each reason.
#[derive(Debug, Default)]
pub(crate) struct KeptStatements {
    /// Number of files that will be written; statements of the others are not reported.
    written: usize,
    lines: Vec<LineIndex>,
    known: HashSet<(usize, Span, Reason)>,
    all: Vec<Kept>,
}

impl KeptStatements {
    pub(crate) fn new(sources: &[Source], written: usize) -> Self {
        Self { written, lines: sources.iter().map(LineIndex::new).collect(), ..Self::default() }
    }

    /// Line of a place in a file, from 1.
    pub(crate) fn line(&self, source: u16, place: Span) -> u32 {
        self.lines[usize::from(source)].line(place.start)
    }

    /// Keeps a statement.
    pub(crate) fn keep(&mut self, source: usize, span: Span, reason: Reason) {
        self.add(Kept { source, span, line: 0, reason, fault: false });
    }

    /// Records a statement that no controller loads, so that no program is written.
    pub(crate) fn refuse(&mut self, source: usize, span: Span, reason: Reason) {
        self.add(Kept { source, span, line: 0, reason, fault: true });
    }

    fn add(&mut self, kept: Kept) {
        if kept.source < self.written && self.known.insert((kept.source, kept.span, kept.reason)) {
            let line = self.lines[kept.source].line(kept.span.start) as usize;
            self.all.push(Kept { line, ..kept });
        }
    }

    /// The motion of this ordinal, at a place in the text, whose target is unknown.
    pub(crate) fn unknown_motion(&self, ordinal: u32, source: u16, span: Span, reason: Reason) -> UnknownMotion {
        UnknownMotion { ordinal, reason, source, span, line: self.line(source, span) }
    }

    /// All of them, in the order of the text.
    pub(crate) fn in_order(mut self) -> Vec<Kept> {
        self.all.sort_by_key(|kept| (kept.source, kept.span.start));
        self.all
    }
}
