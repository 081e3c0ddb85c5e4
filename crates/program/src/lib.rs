//! Reads program text as targets, and writes corrected poses into the same text.
//!
//! The front ends know text and nothing of robots: lengths are millimetres and angles are degrees, as written. [`Program`] does not
//! depend on the language. The data that a front end needs to write corrections (the places of the number tokens) are private to it, and
//! only [`Program::rewrite`] uses them.

mod action;
#[doc(hidden)]
pub mod alignment;
mod any_chunks;
#[doc(hidden)]
pub mod chunk;
pub mod cl;
mod detect;
mod ends;
mod external;
mod front_end;
pub mod jbi;
mod kept;
pub mod krl;
mod language;
mod lexeme;
mod line;
mod long;
mod lowered;
mod marks;
mod modules;
pub mod orientation;
#[doc(hidden)]
pub mod post;
pub mod rapid;
mod round_trip;
mod shared;
mod target;
pub(crate) mod token;
pub mod tp;
pub mod ur;
mod waits;

pub use action::{Action, ActionKind};
pub use deflex_lang::Reason;
pub use detect::detect;
pub use external::{AxisName, EXTERNAL_AXES, External};
pub(crate) use language::Layout;
pub use language::{Language, ReadOptions, read};
pub use long::{InChunks, LongProgram, LongText};
pub use marks::unknown_marks;
pub use modules::{ModuleGroup, ModuleNames, Shared, group_modules};
// The interface between the languages' `Chunks` and the pipeline that corrects them; not for callers.
#[doc(hidden)]
pub use any_chunks::{AnyChunks, ChunkReader, UnreadChunk};
#[doc(hidden)]
pub use chunk::{Next, StreamableChunk};
pub use round_trip::{RoundTrip, round_trip};
pub(crate) use target::GroupAxis;
pub use target::{
    ArcTurn, Conf, Confdata, Config, Editable, ExternalAxes, Goal, InactiveUnit, Mark, Motion, Predecessor, Role,
    StatusAndTurn, Target,
};
pub use waits::Wait;

use deflex_text::{Diagnostic, Edit, Source, Span, applied};
use front_end::Wanted;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// A program as read: one or several sources with shared names.
///
/// # Examples
/// ```
/// use deflex_program::{RewriteOptions, rapid};
/// use deflex_text::Source;
///
/// let program = rapid::read(vec![Source::new("slot.mod", std::fs::read("../../samples/slot/slot.mod")?)], vec![])?;
/// println!("{} targets, {} tools", program.targets.len(), program.tools.len());
/// assert_eq!(program.motion_targets(), 81);
/// assert!(program.unknown_targets().is_empty() && program.faults().is_empty()); // every target is written as numbers
/// println!("the robot passes the first target: {:?}, within {:?} mm", program.passing(0), program.zone_mm(0));
/// let unchanged = program.rewrite(&vec![None; program.targets.len()], &[], &RewriteOptions::default());
/// assert_eq!(program.edited(&unchanged.edits)[0].bytes, program.sources[0].bytes);
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Debug)]
#[non_exhaustive]
pub struct Program {
    /// The files, in the order of the command; context files, which are never written, come after the first `written` ones.
    pub sources: Arc<[Source]>,
    /// Number of `sources` that are the program itself; the others only declare names.
    pub written: usize,
    /// Language of all sources.
    pub language: Language,
    /// The system that wrote it, if the text shows it: `robodk`, `nx`, `catia`, …; `rapid` or `cl` if unknown.
    pub dialect: &'static str,
    /// Tools in the order of their first use; [`Target::tool`] is an index into them.
    pub tools: Vec<Tool>,
    /// Work objects in the order of their first use; [`Target::wobj`] is an index into them.
    pub wobjs: Vec<Wobj>,
    /// Points in running order: executed motions, with the via and interpolated points of arcs
    /// before the motion that they belong to (see [`Role`]).
    pub targets: Vec<Target>,
    /// Executed motions whose target is known only at run time, in running order; `targets` has none of them.
    pub unknown: Vec<UnknownMotion>,
    /// Actions between motions, in running order (CL).
    pub actions: Vec<Action>,
    /// Statements that are not understood or not edited, with the reason.
    pub kept: Vec<Kept>,
    /// Complete numeric positions in the text (`docs/reference.md`, `inspect --json`).
    pub literal_targets: usize,
    /// Arcs among the executed motions.
    pub arcs: usize,
    /// The first cutter that cuts, if the text states one (CL `CUTTER`, `TLDATA`).
    pub cutter: Option<CutterInfo>,
    /// Notes and warnings from reading (errors refuse the program).
    pub diagnostics: Vec<Diagnostic>,
    /// The places of the number tokens, for the front end.
    pub(crate) layout: Layout,
}

/// How the controller passes the end of a motion.
///
/// # Examples
/// ```
/// # let program = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/program.rs"));
/// use deflex_program::Passing;
///
/// let stops = (0..program.targets.len()).filter(|index| matches!(program.passing(*index), Passing::Stop));
/// println!("the arm stops at {} targets", stops.count());
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Passing {
    /// The arm stops (`fine`, `FINE`, a KRL motion without approximation).
    Stop,
    /// It rounds the corner within this radius, mm (`pzone_tcp` of RAPID's zonedata).
    Zone(f64),
    /// It passes the point, and the text gives no radius: a zonedata of the program's own, `C_DIS`, `CNT`, CL data.
    Unstated,
}

/// A tool that the program uses.
///
/// # Examples
/// ```
/// # let program = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/program.rs"));
/// println!("{}: {:?}", program.tools[0].name, program.tools[0].data);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Tool {
    /// Its name as written.
    pub name: Arc<str>,
    /// Its tooldata, if the program or a context module declares it; otherwise the cell has to.
    pub data: Option<ToolData>,
}

impl Tool {
    /// Whether another is this one: RAPID does not distinguish upper and lower case.
    pub(crate) fn is(&self, other: &Self) -> bool {
        self.name.eq_ignore_ascii_case(&other.name) && self.data == other.data
    }
}

/// RAPID tooldata: millimetres, kilograms.
///
/// # Examples
/// ```
/// use deflex_program::ToolData;
///
/// let data = ToolData {
///     robhold: true,
///     tcp_mm: [0.0, 0.0, 250.0],
///     tcp_quat: [1.0, 0.0, 0.0, 0.0],
///     mass_kg: 18.0,
///     cog_mm: [0.0, 0.0, 100.0],
/// };
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToolData {
    /// False for a stationary tool, to which the robot brings the part.
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

/// No rotation.
pub(crate) const NO_TURN: [f64; 4] = [1.0, 0.0, 0.0, 0.0];

impl ToolData {
    /// The flange of the robot.
    #[doc(hidden)]
    pub const FLANGE: Self =
        Self { robhold: true, tcp_mm: [0.0; 3], tcp_quat: NO_TURN, mass_kg: 0.0, cog_mm: [0.0; 3] };
}

/// The shape of a cutter in a CL file.
///
/// # Examples
/// ```
/// # let program = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/blade.rs"));
/// if let Some(cutter) = program.cutter {
///     println!("{} mm, corners {} mm", cutter.diameter_mm, cutter.corner_radius_mm);
/// }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CutterInfo {
    /// Diameter, mm.
    pub diameter_mm: f64,
    /// Corner radius, mm.
    pub corner_radius_mm: f64,
}

/// A work object that the program uses.
///
/// # Examples
/// ```
/// # let program = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/program.rs"));
/// println!("{}: {:?}", program.wobjs[0].name, program.wobjs[0].data);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Wobj {
    /// Its name as written; `wobj0` if the instruction names none.
    pub name: Arc<str>,
    /// Its wobjdata, if the program or a context module declares it; otherwise the cell has to.
    pub data: Option<WobjData>,
    /// The mechanical unit that is its user frame (RAPID `ufprog` FALSE, `ufmec`).
    pub unit: Option<Arc<str>>,
}

impl Wobj {
    /// Whether another is this one: RAPID does not distinguish upper and lower case.
    pub(crate) fn is(&self, other: &Self) -> bool {
        self.name.eq_ignore_ascii_case(&other.name) && self.data == other.data && self.unit == other.unit
    }
}

/// RAPID wobjdata: millimetres.
///
/// # Examples
/// ```
/// use deflex_program::WobjData;
///
/// // An object frame at x = 1 m of the world.
/// let (at, none, straight) = ([1000.0, 0.0, 0.0], [0.0; 3], [1.0, 0.0, 0.0, 0.0]);
/// let data = WobjData {
///     robhold: false,
///     fixed: true,
///     uframe_mm: at,
///     uframe_quat: straight,
///     oframe_mm: none,
///     oframe_quat: straight,
/// };
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WobjData {
    /// True if the robot holds the part.
    pub robhold: bool,
    /// False if a mechanical unit is the user frame: see [`Wobj::unit`].
    pub fixed: bool,
    /// User frame in the world (with `robhold`, in tool0), mm.
    pub uframe_mm: [f64; 3],
    /// Its orientation, scalar first, unit norm.
    pub uframe_quat: [f64; 4],
    /// Object frame in the user frame, mm.
    pub oframe_mm: [f64; 3],
    /// Its orientation, scalar first, unit norm.
    pub oframe_quat: [f64; 4],
}

impl WobjData {
    /// The world.
    #[doc(hidden)]
    pub const WORLD: Self = Self {
        robhold: false,
        fixed: true,
        uframe_mm: [0.0; 3],
        uframe_quat: NO_TURN,
        oframe_mm: [0.0; 3],
        oframe_quat: NO_TURN,
    };
}

/// The index of a tool or a work object in the list of a program, to which it is added if it is new.
pub(crate) fn intern<T: Clone>(known: &mut Vec<T>, wanted: &T, is: impl Fn(&T, &T) -> bool) -> Option<u16> {
    let at = known.iter().rposition(|known| is(known, wanted)).unwrap_or_else(|| {
        known.push(wanted.clone());
        known.len() - 1
    });
    u16::try_from(at).ok()
}

/// A statement that is not changed, with the reason.
///
/// # Examples
/// ```
/// # let program = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/program.rs"));
/// for kept in &program.kept {
///     println!("line {} is not changed: {}", kept.line, kept.reason.text());
/// }
/// ```
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
    /// Whether the motion is not what the text states: a NaN, or in CL data a motion that is not read.
    pub fault: bool,
}

/// An executed motion whose target is known only at run time.
///
/// # Examples
/// ```
/// # let program = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/program.rs"));
/// for motion in &program.unknown {
///     println!("line {}: {}", motion.line, motion.reason.text());
/// }
/// assert!(program.unknown.is_empty());
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct UnknownMotion {
    /// Ordinal of the executed motion, counted together with those of [`Target`].
    pub ordinal: u32,
    /// Why its target is unknown.
    pub reason: Reason,
    /// Index into [`Program::sources`].
    pub source: u16,
    /// The instruction.
    pub span: Span,
    /// Line of the instruction, from 1.
    pub line: u32,
}

/// The wanted values of one target.
///
/// # Examples
/// ```
/// use deflex_program::Change;
///
/// // Lift a target by 0.1 mm.
/// let change = Change { position_mm: [0.0, 0.0, 0.1], quat: None, conf: None, external: None };
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// New position in the target's work object, mm.
    pub position_mm: [f64; 3],
    /// New orientation, scalar first; `None` keeps every orientation token.
    pub quat: Option<[f64; 4]>,
    /// New configuration; `None` keeps what is written.
    pub conf: Option<Conf>,
    /// New positions of external axes, mm or degrees as written; `None` keeps what is written.
    pub external: Option<Box<[Option<f64>; EXTERNAL_AXES]>>,
}

/// A motion to insert before a target (`--subdivide`), on the segment to it.
///
/// # Examples
/// ```
/// use deflex_program::Insert;
///
/// // A line to a point 5 mm from its neighbours, before the fourth target.
/// let insert = Insert::line(3, ([10.0, 0.0, -2.0], [0.0, 1.0, 0.0, 0.0]), 5.0);
/// assert_eq!(insert.position_mm, [10.0, 0.0, -2.0]);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Insert {
    /// Index into [`Program::targets`] of the target that it precedes.
    pub before: usize,
    /// Position in that target's work object, mm.
    pub position_mm: [f64; 3],
    /// Orientation, scalar first.
    pub quat: [f64; 4],
    /// Configuration; `None` for that of the target as written.
    pub conf: Option<Conf>,
    /// Circle point of an arc, position (mm) and orientation; `None` for a line.
    pub via: Option<([f64; 3], [f64; 4])>,
    /// External axes, mm or degrees as written, if they move on the segment; `None` keeps those of the target.
    pub external: Option<[Option<f64>; EXTERNAL_AXES]>,
    /// Length of path to the nearer of the points before and after, mm: a zone wider than that overlaps theirs.
    pub room_mm: f64,
}

impl Insert {
    /// A line to a pose (mm, scalar first) before a target, with this room (mm) around it.
    #[must_use]
    pub fn line(before: usize, (position_mm, quat): ([f64; 3], [f64; 4]), room_mm: f64) -> Self {
        Self { before, position_mm, quat, conf: None, via: None, external: None, room_mm }
    }
}

/// Options for writing corrections.
///
/// # Examples
/// ```
/// use deflex_program::RewriteOptions;
///
/// let options = RewriteOptions { allow_clones: true, ..RewriteOptions::default() };
/// ```
#[derive(Clone, Copy, Debug)]
pub struct RewriteOptions<'a> {
    /// Whether a declared target used with different corrections may get a clone of its own.
    pub allow_clones: bool,
    /// Least number of decimals of positions, mm: the number in the file is used if it is larger.
    pub position_decimals: usize,
    /// Least number of decimals of quaternion components.
    pub quat_decimals: usize,
    /// Which targets cut nothing; those beyond its end count as cutting. A motion that cuts nothing goes along with the numbers that it shares with
    /// a motion that cuts.
    pub air: &'a [bool],
    /// Which targets keep the numbers of their robtarget, because a motion that is no target goes to it; those beyond its end need not.
    pub stays: &'a [bool],
}

impl Default for RewriteOptions<'_> {
    fn default() -> Self {
        // 4 decimals are below the spacing of the controller's single precision at 1 m (1.2e-4 mm);
        // 8 decimals of a quaternion are 3e-6 mm at 300 mm.
        Self { allow_clones: false, position_decimals: 4, quat_decimals: 8, air: &[], stays: &[] }
    }
}

/// The results of [`Program::rewrite`].
///
/// # Examples
/// ```
/// # let program = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/program.rs"));
/// use deflex_program::RewriteOptions;
///
/// let unchanged = vec![None; program.targets.len()];
/// let rewritten = program.rewrite(&unchanged, &[], &RewriteOptions::default());
/// assert!(rewritten.edits.iter().all(|edits| edits.is_empty()) && rewritten.kept.is_empty());
/// ```
#[derive(Debug, Default)]
pub struct Rewritten {
    /// Sorted, disjoint edits of each of the program's written sources.
    pub edits: Vec<Vec<Edit>>,
    /// For each target, position (mm) and orientation in the controller's precision: the printed numbers rounded to single
    /// precision; those of unchanged targets as written.
    pub written: Vec<([f64; 3], [f64; 4])>,
    /// The same for each [`Insert`], in order; `None` if it could not be written.
    pub inserted: Vec<Option<([f64; 3], [f64; 4])>>,
    /// The target that each insert precedes.
    pub before: Vec<usize>,
    /// Targets before which nothing could be inserted, with the reason.
    pub not_inserted: Vec<(usize, Reason)>,
    /// Targets whose change could not be written, with the reason.
    pub kept: Vec<(usize, Reason)>,
    /// Targets that cut nothing and have other poses now, because they share numbers with others; see [`RewriteOptions::air`].
    pub along: Vec<usize>,
    /// Targets whose text has another configuration now, in ascending order, with that configuration.
    pub confs: Vec<(usize, Conf)>,
}

/// An inserted motion.
pub(crate) struct Inserted {
    pub(crate) source: usize,
    /// The start of the statement that it precedes, without bytes.
    pub(crate) at: Span,
    pub(crate) text: Vec<u8>,
    /// Position (mm) and orientation in the controller's precision.
    pub(crate) pose: ([f64; 3], [f64; 4]),
}

impl Rewritten {
    /// Adds the motion for an insert before a target, or the reason why it cannot be written.
    pub(crate) fn insert(&mut self, before: usize, written: Result<Inserted, Reason>) {
        self.inserted.push(written.as_ref().ok().map(|inserted| inserted.pose));
        match written {
            Ok(Inserted { source, at, text, .. }) => {
                let edits = &mut self.edits[source];
                // Several points before one statement, in their order: one edit.
                match edits.iter_mut().find(|edit| edit.span == at) {
                    Some(edit) => edit.content.extend_from_slice(&text),
                    None => edits.push(Edit { span: at, content: text.into() }),
                }
            }
            Err(why) => self.not_inserted.push((before, why)),
        }
    }

    /// Whether the circle point of this index, the end of its arc, or a point inserted on the arc could not be written.
    #[must_use]
    #[doc(hidden)]
    pub fn misses_part_of_arc(&self, via: usize) -> bool {
        let is_kept = |i: usize| self.kept.binary_search_by_key(&i, |(kept, _)| *kept).is_ok();
        let inserted = self.before.iter().zip(&self.inserted);
        is_kept(via) || is_kept(via + 1) || inserted.into_iter().any(|(i, written)| *i == via + 1 && written.is_none())
    }
}

impl Program {
    /// A program of these files without targets.
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

    /// Targets with whose numbers joint motions go along that are no targets, because nothing in the program runs them. Whether they can is
    /// for the caller of [`Program::rewrite`] to judge: see [`RewriteOptions::stays`].
    #[must_use]
    #[doc(hidden)]
    pub fn joints_elsewhere(&self) -> Vec<usize> {
        self.layout.front_end().joints_elsewhere(self)
    }

    /// Targets that may get the correction of their own point only, and no displacement because of the motions before and after it: the program
    /// also shows their numbers, or a motion that it does not follow goes there on another path.
    #[must_use]
    #[doc(hidden)]
    pub fn bound_to_point(&self) -> Vec<usize> {
        self.layout.front_end().bound_to_point(self)
    }

    /// Number of executed motions, with loops expanded. An arc counts once; motions whose target is known only at run time count too, although
    /// `targets` has none of them.
    #[must_use]
    pub fn motion_targets(&self) -> usize {
        self.layout.front_end().motion_targets(self)
    }

    /// The numbers of [`Program::motion_targets`] whose target is known only at run time, by reason in the order of first occurrence.
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

    /// How the controller passes a target, by the text.
    #[must_use]
    pub fn passing(&self, target: usize) -> Passing {
        self.layout.front_end().passing(self, target)
    }

    /// Whether the instructions of two targets surely differ in the numbers of their targets only.
    #[must_use]
    #[doc(hidden)]
    pub fn is_worded_like(&self, target: usize, other: usize) -> bool {
        self.layout.front_end().is_worded_like(self, target, other)
    }

    /// For each target index, the edit that makes the controller stop there, or pass it in a smaller zone of at most this radius; `None` if the
    /// text has no name or number to edit. An edit applies to every run of the statement.
    #[must_use]
    #[doc(hidden)]
    pub fn passing_edits(&self, wanted: &[(usize, Passing)]) -> Vec<Option<Edit>> {
        self.layout.front_end().passing_edits(self, wanted)
    }

    /// How the controller passes a point that is inserted shortly before a target.
    #[must_use]
    #[doc(hidden)]
    pub fn inserted_passing(&self, before: usize) -> Passing {
        self.layout.front_end().inserted_passing(self, before)
    }

    /// The zone radius of a target as written, mm; `None` for a stop, and if the text gives no radius.
    #[must_use]
    pub fn zone_mm(&self, target: usize) -> Option<f64> {
        match self.passing(target) {
            Passing::Zone(radius_mm) => Some(radius_mm),
            Passing::Stop | Passing::Unstated => None,
        }
    }

    /// For each of these targets, why nothing can be inserted before it, if its statement and the way to it decide that;
    /// [`Program::rewrite`] also refuses inserts for which there is no room.
    #[must_use]
    #[doc(hidden)]
    pub fn insertions_refused(&self, before: &[usize]) -> Vec<Option<Reason>> {
        let wanted: BTreeSet<(u16, Span)> =
            before.iter().map(|i| &self.targets[*i]).map(|t| (t.source, t.span)).collect();
        let mut runs: BTreeMap<(u16, Span), usize> = BTreeMap::new();
        let known = self.targets.iter().filter(|target| target.is_end()).map(|target| (target.source, target.span));
        let unknown = self.unknown.iter().map(|motion| (motion.source, motion.span));
        for statement in known.chain(unknown).filter(|statement| wanted.contains(statement)) {
            *runs.entry(statement).or_default() += 1;
        }
        let refused = self.layout.front_end().insertions_refused(self, before);
        let all = before.iter().zip(refused).map(|(&i, refused)| {
            let target = &self.targets[i];
            // The way to an arc begins before its circle point.
            let first =
                i.checked_sub(1).map(|via| &self.targets[via]).filter(|via| via.role == Role::Via).unwrap_or(target);
            match () {
                () if usize::from(target.source) >= self.written => Some(Reason::InContextFile),
                () if refused.is_some() => refused,
                () if runs[&(target.source, target.span)] > 1 => Some(Reason::RunsAgain),
                () if first.predecessor != Predecessor::Previous => Some(Reason::PathStartUnknown),
                () => None,
            }
        });
        all.collect()
    }

    /// Edits of a source that remove inserted instructions with these spans.
    #[must_use]
    #[doc(hidden)]
    pub fn removal(&self, source: usize, spans: &[Span]) -> Vec<Edit> {
        self.layout.front_end().removal(self, source, spans)
    }

    /// Whether the positions of external axes in each target are its own, and can be edited.
    #[must_use]
    #[doc(hidden)]
    pub fn writes_axes(&self) -> Vec<bool> {
        self.layout.front_end().writes_axes(self)
    }

    /// The text of the line with the motion of this ordinal.
    #[must_use]
    #[doc(hidden)]
    pub fn line_of(&self, ordinal: u32) -> Option<String> {
        let i = self.targets.binary_search_by_key(&ordinal, |target| target.ordinal).ok()?;
        let target = &self.targets[i];
        Some(self.sources[usize::from(target.source)].line_at(target.span.start as usize).into_owned())
    }

    /// An error at a target, with its file and line.
    #[doc(hidden)]
    pub fn error_at(&self, target: &Target, code: &'static str, message: impl Into<String>) -> Diagnostic {
        let source = &self.sources[usize::from(target.source)];
        Diagnostic::error(code, "", message).on_line(source, target.span, target.line)
    }

    /// The sources with the edits of [`Program::rewrite`]; sources without edits as they are.
    #[must_use]
    pub fn edited(&self, edits: &[Vec<Edit>]) -> Vec<Source> {
        let edited = |(i, source): (usize, &Source)| Source {
            name: source.name.clone(),
            bytes: applied(&source.bytes, edits.get(i).map_or(&[][..], Vec::as_slice)),
            ..*source
        };
        self.sources.iter().enumerate().map(edited).collect()
    }

    /// The reasons why no program may be written from this one: every statement whose motion is not what its text states.
    #[must_use]
    pub fn faults(&self) -> Vec<Diagnostic> {
        let (code, help) = self.language.about().fault;
        let fault = |kept: &Kept| {
            let source = &self.sources[kept.source];
            let help = cl::help(kept.reason).unwrap_or(help);
            Diagnostic::error(code, &source.name, kept.reason.text()).at(source, kept.span).help(help)
        };
        self.kept.iter().filter(|kept| kept.fault).map(fault).collect()
    }

    /// Turns wanted poses into edits of number tokens.
    ///
    /// `changes` has one entry for each target. `None` changes nothing; a program without changes has no edits. A number whose printed value
    /// does not change is not edited.
    #[must_use]
    pub fn rewrite(&self, changes: &[Option<Change>], inserts: &[Insert], options: &RewriteOptions) -> Rewritten {
        debug_assert_eq!(changes.len(), self.targets.len());
        let before: Vec<usize> = inserts.iter().map(|insert| insert.before).collect();
        let refused = if inserts.is_empty() { Vec::new() } else { self.insertions_refused(&before) };
        let allowed: Vec<Insert> =
            inserts.iter().zip(&refused).filter(|(_, why)| why.is_none()).map(|(insert, _)| insert.clone()).collect();
        let mut rewritten = self.layout.front_end().rewrite(self, Wanted { changes, inserts: &allowed, options });
        let mut written = std::mem::take(&mut rewritten.inserted).into_iter();
        rewritten.inserted =
            refused.iter().map(|why| if why.is_some() { None } else { written.next().flatten() }).collect();
        rewritten.not_inserted.extend(before.iter().zip(refused).filter_map(|(i, why)| Some((*i, why?))));
        rewritten.not_inserted.sort_unstable();
        rewritten.not_inserted.dedup();
        Rewritten { before, ..rewritten }
    }
}
