//! The state of a parser of jobs, and the steps that all its parts share.

use super::header::Job;
use super::lex::Line;
use crate::cursor::Cursor;
use crate::ir::{Expression, FunctionId, Slot, SourceSpan, StatementKind};
use crate::reason::Reason;
use std::collections::{BTreeMap, BTreeSet};

/// Words that begin the condition of an instruction.
pub(super) const CONDITION: [&str; 2] = ["IF", "IFEXPRESS"];
/// Label of the start of a job that jumps there. Labels of the text end in a number.
pub(super) const JOB_START: &str = "";

/// A variable's kind, `b"P"`, and its number.
type Numbered = (&'static [u8], u32);

/// A parser of jobs.
pub(super) type Parser<'a, 'n> = Cursor<'a, 'n, Known<'a, 'n>>;

/// The state of the parser: all jobs, and the one that is being read.
#[derive(Default)]
pub(super) struct Known<'a, 'n> {
    pub(super) jobs: BTreeMap<&'a [u8], Vec<FunctionId>>,
    pub(super) globals: BTreeMap<Numbered, Slot>,
    /// Position variables in the files of jobs, with their values when the job is loaded.
    pub(super) loaded: BTreeMap<u32, Vec<Expression>>,
    /// Variables that some statement writes.
    pub(super) written: BTreeSet<Slot>,
    /// Whether all circles are three consecutive points; the paths of others are unknown.
    pub(super) has_plain_circles: bool,
    /// Settings that some instruction redefines, with the reason.
    pub(super) defined: BTreeMap<Slot, Reason>,
    // The job that is being read.
    pub(super) job: Option<&'n Job<'a>>,
    pub(super) lines: &'n [Line<'a>],
    pub(super) line: usize,
    pub(super) locals: BTreeMap<Numbered, u32>,
    /// How often each label occurs in the job, and how often it was read so far.
    pub(super) labels: BTreeMap<String, u32>,
    pub(super) passed: BTreeMap<String, u32>,
    /// Whether the job jumps to its own start.
    pub(super) restarts: bool,
    /// Number of points of the open circle, and its circle point.
    pub(super) circle: (u32, Option<Expression>),
}

impl Parser<'_, '_> {
    /// Moves to the present line, if it is an instruction.
    pub(super) fn open(&mut self) -> bool {
        let Some(Line::Code(code)) = self.own.lines.get(self.own.line) else { return false };
        (self.lexemes, self.at) = (code, 0);
        true
    }

    /// A statement that may do anything.
    pub(super) fn not_understood(&mut self, reads: Vec<Expression>, place: SourceSpan) -> StatementKind {
        self.program.not_understood.push(place);
        StatementKind::Opaque { writes: None, reads, reason: Reason::NotUnderstood }
    }
}
