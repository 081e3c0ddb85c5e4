//! The state of a parser of jobs, and the steps that all its parts share.

use super::header::Job;
use super::lex::Line;
use crate::cursor::Cursor;
use crate::ir::{Expression, FunctionId, Slot, SourceSpan, StatementKind};
use crate::reason::Reason;
use std::collections::{BTreeMap, BTreeSet};

/// Words that begin the condition of an instruction.
pub(super) const CONDITION: [&str; 2] = ["IF", "IFEXPRESS"];

/// A variable's kind, `b"P"`, and its number.
type Numbered = (&'static [u8], u32);

/// A parser of jobs.
pub(super) type Parser<'a, 'n> = Cursor<'a, 'n, Known<'a, 'n>>;

/// What is known of the jobs, and of the one that is being read.
#[derive(Default)]
pub(super) struct Known<'a, 'n> {
    pub(super) jobs: BTreeMap<&'a [u8], Vec<FunctionId>>,
    pub(super) globals: BTreeMap<Numbered, Slot>,
    /// Position variables that jobs bring along, with what they are when the job is loaded.
    pub(super) loaded: BTreeMap<u32, Vec<Expression>>,
    /// Variables that some statement writes.
    pub(super) written: BTreeSet<Slot>,
    /// Whether all circles are three points in a row, which is what is known of how they go.
    pub(super) has_plain_circles: bool,
    /// What some instruction defines anew.
    pub(super) defined: BTreeMap<Slot, Reason>,
    // The job that is being read.
    pub(super) job: Option<&'n Job<'a>>,
    pub(super) lines: &'n [Line<'a>],
    pub(super) line: usize,
    pub(super) locals: BTreeMap<Numbered, u32>,
    /// How often each label stands in the job, and how often it has been passed.
    pub(super) labels: BTreeMap<String, u32>,
    pub(super) passed: BTreeMap<String, u32>,
    /// Points of the circle that is open, and the one on the way.
    pub(super) circle: (u32, Option<Expression>),
}

impl Parser<'_, '_> {
    /// Begins with the next line, where it is an instruction.
    pub(super) fn open(&mut self) -> bool {
        let Some(Line::Code(code)) = self.own.lines.get(self.own.line) else { return false };
        (self.lexemes, self.at) = (code, 0);
        true
    }

    /// Something that may do anything.
    pub(super) fn not_understood(&mut self, reads: Vec<Expression>, place: SourceSpan) -> StatementKind {
        self.program.not_understood.push(place);
        StatementKind::Opaque { writes: None, reads, reason: Reason::NotUnderstood }
    }
}
