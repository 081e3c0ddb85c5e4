//! Program text to targets, and corrected poses back into the same text.
//!
//! The front ends know text and nothing of robots: lengths are millimetres and angles degrees, as
//! written. [`Program`] is language-free; what a front end needs to write corrections back (where
//! the number tokens stand) is its own and stays behind [`Program::rewrite`].

mod action;
pub(crate) mod alignment;
mod any_chunks;
pub(crate) mod chunk;
pub mod cl;
mod detect;
mod external;
mod front_end;
pub mod jbi;
pub mod krl;
mod language;
mod long;
mod lowered;
mod marks;
mod modules;
pub mod orientation;
pub mod post;
pub mod rapid;
mod round_trip;
mod target;
pub(crate) mod token;
pub mod tp;
pub mod ur;

pub use action::{Action, ActionKind};
pub use deflex_lang::Reason;
pub use detect::detect;
pub use external::{AxisName, EXTERNAL_AXES, External};
pub(crate) use language::Layout;
pub use language::{Language, ReadOptions, read};
pub use long::{InChunks, LongProgram, LongText};
pub use marks::unknown_marks;
pub use modules::{ModuleNames, group_modules};
// What passes between the languages' `Chunks` and the line that corrects them; not for callers.
#[doc(hidden)]
pub use any_chunks::AnyChunks;
#[doc(hidden)]
pub use chunk::{ChunkReader, Next, StreamableChunk};
pub use round_trip::{RoundTrip, round_trip};
pub use target::{
    Conf, Confdata, Config, Editable, ExternalAxes, Goal, GroupAxis, InactiveUnit, Mark, Motion, Predecessor, Role,
    Status, Target,
};

use crate::text::{Diagnostic, Edit, Source, Span};
use std::sync::Arc;

/// A program as read: one or several sources with shared names.
#[derive(Debug)]
#[non_exhaustive]
pub struct Program {
    /// The files, in the order given; context modules (never written) after `written` of them.
    pub sources: Arc<[Source]>,
    /// How many of `sources` are the program itself; the rest only declare names.
    pub written: usize,
    /// Language of all sources.
    pub language: Language,
    /// Who made it, as far as the text tells: `robodk`, `nx`, `catia`, …, `rapid` or `cl` where unknown.
    pub dialect: &'static str,
    /// Tools in the order first used; [`Target::tool`] indexes them.
    pub tools: Vec<Tool>,
    /// Work objects in the order first used; [`Target::wobj`] indexes them.
    pub wobjs: Vec<Wobj>,
    /// Points in running order: executed motions, with the via and interpolated points of arcs
    /// before the motion that they belong to (see [`Role`]).
    pub targets: Vec<Target>,
    /// Executed motions of which it is known only at run time where they go, in running order; `targets` has none of them.
    pub unknown: Vec<UnknownMotion>,
    /// What is done between motions, in running order (CL).
    pub actions: Vec<Action>,
    /// Statements that are not understood or not edited, with the reason.
    pub kept: Vec<Kept>,
    /// Complete numeric positions in the text (`docs/reference.md`, `inspect --json`).
    pub literal_targets: usize,
    /// Arcs among the executed motions.
    pub arcs: usize,
    /// The cutter, as far as the text says (CL `CUTTER`, `TLDATA`): the first one that cuts.
    pub cutter: Option<CutterInfo>,
    /// What was noticed while reading: notes and warnings (errors refuse the program).
    pub diagnostics: Vec<Diagnostic>,
    /// Where the front end finds its number tokens again.
    pub(crate) layout: Layout,
}

/// Words between two motions after which it is not sure that one follows the other, and `CONTINUE`, by which KRL does not wait.
const BRANCHES: [&str; 17] = [
    "IF", "ELSE", "ELSEIF", "ENDIF", "TEST", "CASE", "SWITCH", "FOR", "ENDFOR", "WHILE", "ENDWHILE", "LOOP", "REPEAT",
    "GOTO", "ENDPROC", "END", "CONTINUE",
];

/// How the controller passes the end of a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Passing {
    /// It comes to rest (`fine`, `FINE`, a KRL motion without approximation).
    Stop,
    /// It rounds the corner within this radius, mm (`pzone_tcp` of RAPID's zonedata).
    Zone(f64),
    /// It passes the point, and the text gives no radius: a zonedata of the program's own, `C_DIS`, `CNT`, CL data.
    Unstated,
}

/// A tool that the program uses.
#[derive(Clone, Debug, PartialEq)]
pub struct Tool {
    /// As the author spelled it.
    pub name: Arc<str>,
    /// Its tooldata where the program or a context module declares it; else the cell must.
    pub data: Option<ToolData>,
}

impl Tool {
    /// Whether another is this one: RAPID does not tell case apart.
    pub(crate) fn is(&self, other: &Self) -> bool {
        self.name.eq_ignore_ascii_case(&other.name) && self.data == other.data
    }
}

/// RAPID tooldata: millimetres, kilograms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToolData {
    /// False for a stationary tool, which the robot brings the part to.
    pub robhold: bool,
    /// TCP in the flange frame tool0, mm.
    pub tcp_mm: [f64; 3],
    /// Orientation of the TCP frame in tool0, scalar first, unit norm.
    pub tcp_quat: [f64; 4],
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of gravity in tool0, mm.
    pub cog_mm: [f64; 3],
}

/// A cutter's shape as far as a CL file tells it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CutterInfo {
    /// Diameter, mm.
    pub diameter_mm: f64,
    /// Corner radius, mm.
    pub corner_radius_mm: f64,
}

/// A work object that the program uses.
#[derive(Clone, Debug, PartialEq)]
pub struct Wobj {
    /// As the author spelled it; `wobj0` where the instruction names none.
    pub name: Arc<str>,
    /// Its wobjdata where the program or a context module declares it; else the cell must.
    pub data: Option<WobjData>,
    /// The mechanical unit that is its user frame (RAPID `ufprog` FALSE, `ufmec`).
    pub unit: Option<Arc<str>>,
}

impl Wobj {
    /// Whether another is this one: RAPID does not tell case apart.
    pub(crate) fn is(&self, other: &Self) -> bool {
        self.name.eq_ignore_ascii_case(&other.name) && self.data == other.data && self.unit == other.unit
    }
}

/// RAPID wobjdata: millimetres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WobjData {
    /// True where the robot holds the part.
    pub robhold: bool,
    /// False where a mechanical unit is the user frame: see [`Wobj::unit`].
    pub fixed: bool,
    /// User frame in the world (or in tool0 where `robhold`), mm.
    pub uframe_mm: [f64; 3],
    /// Its orientation, scalar first, unit norm.
    pub uframe_quat: [f64; 4],
    /// Object frame in the user frame, mm.
    pub oframe_mm: [f64; 3],
    /// Its orientation, scalar first, unit norm.
    pub oframe_quat: [f64; 4],
}

/// A statement that comes out as it went in, and why.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Kept {
    /// Index into [`Program::sources`].
    pub source: usize,
    /// The statement.
    pub span: Span,
    /// Line of its first byte, from 1.
    pub line: usize,
    /// Reason, a short fixed phrase that can be counted: `target computed at run time`.
    pub reason: Reason,
    /// Whether the tool would go elsewhere without it: a NaN, or (CL) a motion that is not read.
    pub fault: bool,
    /// How to mend it; empty where there is nothing special to do.
    pub help: &'static str,
}

/// An executed motion of which it is known only at run time where it goes.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct UnknownMotion {
    /// Ordinal of the executed motion, counted as those of [`Target`].
    pub ordinal: u32,
    /// Why it is not known.
    pub reason: Reason,
    /// Index into [`Program::sources`].
    pub source: u16,
    /// The instruction.
    pub span: Span,
    /// Line of the instruction, from 1.
    pub line: u32,
}

/// What is wanted at one target instead of what is written.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// New position in the target's work object, mm.
    pub position_mm: [f64; 3],
    /// New orientation, scalar first; `None` leaves every orientation token alone.
    pub quat: Option<[f64; 4]>,
    /// New configuration; `None` keeps what is written.
    pub conf: Option<Conf>,
    /// New positions of external axes, mm or degrees as written; `None` keeps what is written.
    pub external: Option<Box<[Option<f64>; EXTERNAL_AXES]>>,
}

/// A motion to insert before a target (`--subdivide`), on the way to it.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Insert {
    /// Index into [`Program::targets`] of the target it precedes.
    pub before: usize,
    /// Position in that target's work object, mm.
    pub position_mm: [f64; 3],
    /// Orientation, scalar first.
    pub quat: [f64; 4],
    /// Configuration there; `None` as the target's, as it is written.
    pub conf: Option<Conf>,
    /// Circle point of an arc, position (mm) and orientation; `None` for a line.
    pub via: Option<([f64; 3], [f64; 4])>,
    /// External axes there, mm or degrees as written, where they move on the way; `None` leaves those of the target.
    pub external: Option<[Option<f64>; EXTERNAL_AXES]>,
    /// Length of path to the nearer of the points before and after, mm: a zone wider than that overlaps theirs.
    pub room_mm: f64,
}

impl Insert {
    /// A line to a pose (mm, scalar first) before a target, with so much room (mm) about it.
    #[must_use]
    pub fn line(before: usize, (position_mm, quat): ([f64; 3], [f64; 4]), room_mm: f64) -> Self {
        Self { before, position_mm, quat, conf: None, via: None, external: None, room_mm }
    }
}

/// How corrections are written.
#[derive(Clone, Copy, Debug)]
pub struct RewriteOptions {
    /// Whether a declared target used with different corrections may get a clone of its own.
    pub allow_clones: bool,
    /// Least decimals of positions, mm: the file's own count is used where larger.
    pub position_decimals: usize,
    /// Least decimals of quaternion components.
    pub quat_decimals: usize,
}

impl Default for RewriteOptions {
    fn default() -> Self {
        // 4 decimals are below the spacing of the controller's single precision at 1 m (1.2e-4 mm);
        // 8 decimals of a quaternion are 3e-6 mm at 300 mm.
        Self { allow_clones: false, position_decimals: 4, quat_decimals: 8 }
    }
}

/// What [`Program::rewrite`] made of the changes.
#[derive(Debug, Default)]
#[non_exhaustive]
pub struct Rewritten {
    /// Sorted, disjoint edits of each of the program's written sources.
    pub edits: Vec<Vec<Edit>>,
    /// Per target: position (mm) and orientation as the controller will hold them, that is the
    /// printed numbers rounded to single precision; unchanged targets as they were written.
    pub written: Vec<([f64; 3], [f64; 4])>,
    /// The same for each [`Insert`], in order; `None` where it could not be written.
    pub inserted: Vec<Option<([f64; 3], [f64; 4])>>,
    /// The target that each insert precedes.
    pub before: Vec<usize>,
    /// Targets before which nothing could be inserted, with the reason.
    pub not_inserted: Vec<(usize, Reason)>,
    /// Targets whose change could not be written, with the reason.
    pub kept: Vec<(usize, Reason)>,
}

impl Program {
    /// A program of these files that moves to nothing yet: chunks are filled from it.
    pub(crate) fn empty(
        language: Language,
        dialect: &'static str,
        (sources, written): (Arc<[Source]>, usize),
        layout: Layout,
    ) -> Self {
        Self {
            sources,
            written,
            language,
            dialect,
            tools: Vec::new(),
            wobjs: Vec::new(),
            targets: Vec::new(),
            unknown: Vec::new(),
            actions: Vec::new(),
            kept: Vec::new(),
            literal_targets: 0,
            arcs: 0,
            cutter: None,
            diagnostics: Vec::new(),
            layout,
        }
    }

    /// Executed motions, loops expanded, an arc counting once; those whose target is known only at run
    /// time count, though `targets` has none of them.
    #[must_use]
    pub fn motion_targets(&self) -> usize {
        self.layout.front_end().motion_targets(self)
    }

    /// Those of [`Program::motion_targets`] whose target is known only at run time, counted by reason in the order first met.
    #[must_use]
    pub fn unknown_targets(&self) -> Vec<(Reason, usize)> {
        let mut counts: Vec<(Reason, usize)> = Vec::new();
        for motion in &self.unknown {
            match counts.iter_mut().find(|(known, _)| *known == motion.reason) {
                Some((_, count)) => *count += 1,
                None => counts.push((motion.reason, 1)),
            }
        }
        counts
    }

    /// How the controller passes a target, as far as the text says.
    #[must_use]
    pub fn passing(&self, target: usize) -> Passing {
        self.layout.front_end().passing(self, target)
    }

    /// The word of a statement between two targets at which the controller waits, so that it cannot round the corner before it; `None`
    /// where there is none, or the text between them does not surely run from one to the other.
    #[must_use]
    pub(crate) fn waits_between(&self, target: usize, next: usize) -> Option<&'static str> {
        let (before, after) = (self.targets.get(target)?, self.targets.get(next)?);
        let source = &self.sources[usize::from(before.source)];
        let span = before.span.range().end..after.span.range().start;
        let text = source.bytes.get(span).filter(|_| before.source == after.source)?;
        let comment = self.language.comment();
        let code = text
            .split(|byte| *byte == b'\n')
            .map(|line| line.split(|byte| Some(*byte) == comment).next().unwrap_or(line));
        let words = code.flat_map(|line| line.split(|byte| !byte.is_ascii_alphanumeric() && *byte != b'_'));
        let mut found = None;
        for word in words.filter(|word| !word.is_empty()) {
            let is = |known: &&&str| word.eq_ignore_ascii_case(known.as_bytes());
            if BRANCHES.iter().any(|known| is(&known)) {
                return None;
            }
            found = found.or_else(|| self.language.waits().iter().find(is).copied());
        }
        found
    }

    /// For targets, by their index, the edit that makes the controller come to rest there, or pass in a smaller zone of at most
    /// this radius; `None` where the text has no name or number to edit for that. An edit holds for each run of the statement.
    #[must_use]
    pub(crate) fn passing_edits(&self, wanted: &[(usize, Passing)]) -> Vec<Option<Edit>> {
        self.layout.front_end().passing_edits(self, wanted)
    }

    /// How the controller passes a point that is inserted close before a target.
    #[must_use]
    pub(crate) fn inserted_passing(&self, before: usize) -> Passing {
        self.layout.front_end().inserted_passing(self, before)
    }

    /// How far from a target the controller leaves the path as written, mm; `None` of a stop, and where the text gives no radius.
    #[must_use]
    pub fn zone_mm(&self, target: usize) -> Option<f64> {
        match self.passing(target) {
            Passing::Zone(radius_mm) => Some(radius_mm),
            Passing::Stop | Passing::Unstated => None,
        }
    }

    /// Why nothing can be inserted before a target, where its statement already tells; others are refused by
    /// [`Program::rewrite`].
    #[must_use]
    pub(crate) fn insertion_refused(&self, before: usize) -> Option<Reason> {
        self.layout.front_end().insertion_refused(self, before)
    }

    /// Edits of a source that take inserted instructions, which have these spans, out of it again.
    #[must_use]
    pub(crate) fn removal(&self, source: usize, spans: &[Span]) -> Vec<Edit> {
        self.layout.front_end().removal(self, source, spans)
    }

    /// Whether the positions of external axes that each target says are its own, and can be edited.
    #[must_use]
    pub(crate) fn writes_axes(&self) -> Vec<bool> {
        self.layout.front_end().writes_axes(self)
    }

    /// The text of the line that the motion with this ordinal stands on.
    #[must_use]
    pub fn line_of(&self, ordinal: u32) -> Option<String> {
        let i = self.targets.binary_search_by_key(&ordinal, |target| target.ordinal).ok()?;
        let target = &self.targets[i];
        Some(self.sources[usize::from(target.source)].line_at(target.span.start as usize).into_owned())
    }

    /// An error at a target, with its file and line.
    pub(crate) fn error_at(&self, target: &Target, code: &'static str, message: impl Into<String>) -> Diagnostic {
        let source = &self.sources[usize::from(target.source)];
        Diagnostic::error(code, "", message).on_line(source, target.span, target.line)
    }

    /// Why no program may be written from this one: every statement whose motion is not what its text says.
    #[must_use]
    pub fn faults(&self) -> Vec<Diagnostic> {
        let (code, help) = self.language.fault();
        let fault = |kept: &Kept| {
            let source = &self.sources[kept.source];
            let help = if kept.help.is_empty() { help } else { kept.help };
            Diagnostic::error(code, &source.name, kept.reason.text()).at(source, kept.span).help(help)
        };
        self.kept.iter().filter(|kept| kept.fault).map(fault).collect()
    }

    /// Turns wanted poses into edits on number tokens.
    ///
    /// `changes` has one entry a target; `None` changes nothing, and a program without changes has no
    /// edits. A number whose printed value does not change is not edited.
    #[must_use]
    pub fn rewrite(&self, changes: &[Option<Change>], inserts: &[Insert], options: &RewriteOptions) -> Rewritten {
        debug_assert_eq!(changes.len(), self.targets.len());
        let rewritten = self.layout.front_end().rewrite(self, changes, inserts, options);
        Rewritten { before: inserts.iter().map(|insert| insert.before).collect(), ..rewritten }
    }
}
