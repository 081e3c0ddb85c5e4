//! The state of a run: what is known, what was met, and what comes of it.

use super::gathering::Gathering;
use super::known::RoutineId;
use super::layers::{Layer, Left};
use super::literal::Literal;
use super::ran::{Ran, Use};
use super::state::{Begun, ModalState, Switches};
use super::symbols::{Content, Names, Symbols};
use super::tree::File;
use super::value::SourceSpan;
use super::{Offset, Site};
use crate::program::{ExternalAxes, InactiveUnit, Kept, Reason, Target, Tool, UnknownMotion, Wobj};
use crate::text::{Diagnostic, LineIndex, Source, Span};
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::sync::Arc;

/// Statements run in all, and for each byte of the program besides: ends loops whose condition never changes.
const STEPS: usize = 500_000;
const STEPS_PER_BYTE: usize = 4;
/// Targets in all, loops expanded, and for each byte of the program besides: a file of one line must not fill the memory.
const TARGETS: usize = 200_000;
const TARGETS_PER_BYTE: usize = 1;
/// Whether the next statement is run.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Flow {
    Next,
    /// The program goes on elsewhere: what it leaves there is noted.
    Gone,
}

/// A routine that is being run.
pub(super) struct Frame {
    pub(super) routine: RoutineId,
    pub(super) module: usize,
    pub(super) names: Names,
    /// The layer that began with it.
    pub(super) layer: usize,
    /// What it leaves where it returns before its end.
    pub(super) returns: Vec<Left>,
    /// What it leaves where an error goes to its caller.
    pub(super) raises: Vec<Left>,
    /// A GOTO stands in it.
    pub(super) jumps: bool,
    /// What was in force when an error was noted last.
    pub(super) noted: Option<(u64, ModalState)>,
    /// Where the robot stands where it returns before its end; none before the first such place.
    pub(super) returns_from: Option<Option<u32>>,
}

/// What comes of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Mode {
    /// Targets.
    Real,
    /// What routines that nothing runs would use.
    Aside,
    /// Nothing but what holds after it.
    Dry,
}

/// The last tool or work object argument and what it meant, while no name can have changed.
#[derive(Clone, Copy, Default)]
pub(super) struct Cached {
    pub(super) place: Option<SourceSpan>,
    pub(super) epoch: u64,
    pub(super) index: u16,
}

pub(super) struct Runner<'a> {
    pub(super) symbols: Symbols<'a>,
    pub(super) written: usize,
    pub(super) frames: Vec<Frame>,
    pub(super) layers: Vec<Layer>,
    /// What data held before any routine ran, of those that one has changed.
    pub(super) before_all: BTreeMap<usize, Content>,
    pub(super) state: ModalState,
    pub(super) mode: Mode,
    /// Whether a motion that is stopped may go to a handler: see [`Self::handles_stops`].
    pub(super) stops_are_handled: bool,
    /// Routines on the way that catch errors.
    pub(super) guards: usize,
    /// How often an expression could have failed under one.
    pub(super) failures: usize,
    /// Routines with a GOTO on the way that may switch displacement or axis offsets on, or mark, at any of their statements.
    pub(super) jumping: Switches,
    /// Loops within one another that are run for what holds when their rounds begin.
    pub(super) dry: usize,
    pub(super) steps: usize,
    pub(super) most_steps: usize,
    pub(super) most_targets: usize,
    /// Routines that were run.
    pub(super) entered: HashSet<RoutineId>,
    /// Routines that call themselves so often that they were not followed.
    pub(super) endless: BTreeSet<RoutineId>,
    /// Routines that were run for what they would use, were they run.
    pub(super) entered_aside: HashSet<RoutineId>,
    pub(super) looking_aside: bool,
    /// Literals that parameters stood for, by routine and name.
    pub(super) given: HashMap<(RoutineId, Box<[u8]>), Vec<u32>>,
    /// Calls of procedures that are chosen at run time: what their names begin with, in capitals; nothing where it may be any.
    pub(super) called_late: Vec<Box<[u8]>>,
    pub(super) epoch: u64,
    /// Assignments so far: a loop without any never ends by itself.
    pub(super) changes: u64,
    /// Anything but motions and what changes nothing.
    pub(super) events: u64,
    pub(super) tool: Cached,
    pub(super) wobj: Cached,
    /// The last speed argument and its value.
    pub(super) speed: (Cached, Option<f64>),
    pub(super) literals: Vec<Literal>,
    /// Literals of each source within `literals`.
    pub(super) first_literal: Vec<usize>,
    pub(super) next_literal: usize,
    pub(super) own: HashMap<SourceSpan, u32>,
    /// Robtargets put together from parts that some run does not know, or has where they cannot be edited.
    pub(super) unassembled: HashSet<SourceSpan>,
    pub(super) pinned: BTreeSet<u32>,
    /// Data whose declarations are among them with all that they take over from others.
    pub(super) pinned_data: BTreeSet<usize>,
    /// Offsets that may not be edited, by their first number.
    pub(super) held: HashSet<SourceSpan>,
    pub(super) names: HashMap<u32, Arc<str>>,
    pub(super) tools: Vec<Tool>,
    pub(super) tool_numbers: HashMap<Vec<u8>, u16>,
    pub(super) wobjs: Vec<Wobj>,
    pub(super) wobj_numbers: HashMap<Vec<u8>, u16>,
    pub(super) targets: Vec<Target>,
    pub(super) sites: Vec<Site>,
    pub(super) gathering: Gathering,
    /// WHILE loops begun so far: their numbers.
    pub(super) loops: u64,
    /// Ordinal of the motion at whose end the robot stands, 0 where the routine was started; `None` where that is known only at
    /// run time.
    pub(super) stands: Option<u32>,
    /// Ordinal of the last target.
    pub(super) last: u32,
    /// Targets that the robot may stand at.
    pub(super) standing: BTreeSet<usize>,
    pub(super) offsets: Vec<Offset>,
    /// Statements that were run.
    pub(super) ran: Ran,
    /// Uses by routines that nothing runs.
    pub(super) aside: Vec<Use>,
    /// Units that were found deactivated together, the first being none; [`Axes::inactive`] numbers them.
    pub(super) inactive: Vec<Arc<[InactiveUnit]>>,
    /// External axes of the last target that has any.
    pub(super) external: Option<Arc<ExternalAxes>>,
    /// The external axes have moved by themselves since the last target.
    pub(super) axes_moved: bool,
    pub(super) kept: Vec<Kept>,
    /// What was kept, and where.
    pub(super) seen: HashSet<(usize, Span, Reason)>,
    /// What was said, by its code, and where.
    pub(super) reported: HashSet<(usize, Span, &'static str)>,
    pub(super) diagnostics: Vec<Diagnostic>,
    pub(super) lines: Vec<LineIndex>,
    pub(super) motions: u32,
    /// Motions without a target, by reason.
    pub(super) unknown: Vec<UnknownMotion>,
    pub(super) arcs: usize,
    pub(super) begun: Begun,
}

impl<'a> Runner<'a> {
    pub(super) fn new(sources: &'a [Source], files: &'a [File], written: usize) -> Self {
        let mut first_literal = Vec::new();
        let mut literals = Vec::new();
        for file in files {
            first_literal.push(literals.len());
            literals.extend_from_slice(&file.literals);
        }
        first_literal.push(literals.len());
        let bytes: usize = sources.iter().map(|s| s.bytes.len()).sum();
        let mut runner = Self {
            symbols: Symbols::new(sources, files),
            written,
            frames: Vec::new(),
            layers: Vec::new(),
            before_all: BTreeMap::new(),
            state: ModalState::default(),
            mode: Mode::Real,
            guards: 0,
            stops_are_handled: false,
            failures: 0,
            jumping: Switches::NONE,
            dry: 0,
            steps: 0,
            most_steps: STEPS + STEPS_PER_BYTE * bytes,
            most_targets: TARGETS + TARGETS_PER_BYTE * bytes,
            entered: HashSet::new(),
            endless: BTreeSet::new(),
            entered_aside: HashSet::new(),
            looking_aside: false,
            given: HashMap::new(),
            called_late: Vec::new(),
            epoch: 1,
            changes: 0,
            events: 0,
            tool: Cached::default(),
            wobj: Cached::default(),
            speed: (Cached::default(), None),
            literals,
            first_literal,
            next_literal: 0,
            own: HashMap::new(),
            unassembled: HashSet::new(),
            pinned: BTreeSet::new(),
            pinned_data: BTreeSet::new(),
            held: HashSet::new(),
            names: HashMap::new(),
            tools: Vec::new(),
            tool_numbers: HashMap::new(),
            wobjs: Vec::new(),
            wobj_numbers: HashMap::new(),
            targets: Vec::new(),
            sites: Vec::new(),
            gathering: Gathering::All,
            loops: 0,
            stands: Some(0),
            last: 0,
            standing: BTreeSet::new(),
            offsets: Vec::new(),
            ran: Ran::new(sources),
            aside: Vec::new(),
            inactive: vec![Arc::new([])],
            external: None,
            axes_moved: false,
            kept: Vec::new(),
            seen: HashSet::new(),
            reported: HashSet::new(),
            diagnostics: Vec::new(),
            lines: sources.iter().map(LineIndex::new).collect(),
            motions: 0,
            unknown: Vec::new(),
            arcs: 0,
            begun: Begun::default(),
        };
        for (source, file) in files.iter().enumerate().take(written) {
            for &(span, reason) in &file.odd {
                runner.keep(source, span, reason);
            }
        }
        runner.state.mark = files.iter().take(written).find_map(|f| f.mark);
        let at_any_moment = runner.symbols.known.at_any_moment.switches;
        runner.state.lose(Switches { marks: false, ..at_any_moment });
        runner
    }
}
