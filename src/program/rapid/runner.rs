//! The state of a run: known values, statements met, and results.

use super::gathering::Gathering;
use super::known::RoutineId;
use super::layers::{Layer, Left};
use super::literal::Literal;
use super::ran::{Ran, Use};
use super::state::{Begun, ModalState, Switches};
use super::symbols::{Content, Names, Symbols};
use super::tree::File;
use super::value::SourceSpan;
use super::{Offset, TargetInText};
use crate::program::{ExternalAxes, InactiveUnit, Kept, Reason, Target, Tool, UnknownMotion, Wobj};
use crate::text::{Diagnostic, LineIndex, Source, Span};
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::sync::Arc;

/// Most statements run in all, in addition to those per byte of the program; ends loops whose condition never changes.
const STEPS: usize = 500_000;
const STEPS_PER_BYTE: usize = 4;
/// Most targets in all, with loops expanded, in addition to those per byte: a file of one line must not fill the memory.
const TARGETS: usize = 200_000;
const TARGETS_PER_BYTE: usize = 1;
/// Whether the next statement is run.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Flow {
    Next,
    /// The program continues elsewhere, with the state that was noted for that point.
    Gone,
}

/// A routine that is being run.
pub(super) struct Frame {
    pub(super) routine: RoutineId,
    pub(super) module: usize,
    pub(super) names: Names,
    /// The layer that began with it.
    pub(super) layer: usize,
    /// States at which it returns before its end.
    pub(super) returns: Vec<Left>,
    /// States at which it passes an error to its caller.
    pub(super) raises: Vec<Left>,
    /// It contains a GOTO.
    pub(super) jumps: bool,
    /// The modal state at the last noted error.
    pub(super) noted: Option<(u64, ModalState)>,
    /// The robot's position where it returns before its end; `None` before the first such statement.
    pub(super) returns_from: Option<Option<u32>>,
}

/// What a run is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Mode {
    /// The targets of the program.
    Real,
    /// The data that routines would use that nothing runs.
    Aside,
    /// Only the state after it.
    Dry,
}

/// The last tool or work object argument and its meaning, valid while no name can have changed.
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
    pub(super) layers: Vec<Layer<'a>>,
    /// The values, before any routine ran, of data that a routine has changed.
    pub(super) before_all: BTreeMap<usize, Content<'a>>,
    pub(super) state: ModalState,
    pub(super) mode: Mode,
    /// Whether a handler may take over a stopped motion: see [`Self::handles_stops`].
    pub(super) stops_are_handled: bool,
    /// Number of calling routines that catch errors.
    pub(super) guards: usize,
    /// How often an expression in one could have failed.
    pub(super) failures: usize,
    /// States that calling routines with a GOTO may switch on at any of their statements.
    pub(super) jumping: Switches,
    /// Number of nested loops that are run only for the state at the start of a round.
    pub(super) dry: usize,
    pub(super) steps: usize,
    pub(super) most_steps: usize,
    pub(super) most_targets: usize,
    /// Routines that were run.
    pub(super) entered: HashSet<RoutineId>,
    /// Routines that call themselves so often that they were not followed.
    pub(super) endless: BTreeSet<RoutineId>,
    /// Routines that were run only for the data that they would use.
    pub(super) entered_aside: HashSet<RoutineId>,
    pub(super) looking_aside: bool,
    /// Literals that parameters stood for, by routine and name.
    pub(super) given: HashMap<(RoutineId, Box<[u8]>), Vec<u32>>,
    /// Calls of procedures chosen at run time: the start of their names in upper case, empty if any name is possible.
    pub(super) called_late: Vec<Box<[u8]>>,
    pub(super) epoch: u64,
    /// Assignments so far: a loop without any never ends by itself.
    pub(super) changes: u64,
    /// Number of statements that are neither motions nor without effect.
    pub(super) events: u64,
    pub(super) tool: Cached,
    pub(super) wobj: Cached,
    /// The last speed argument and its value.
    pub(super) speed: (Cached, Option<f64>),
    pub(super) literals: Vec<Literal>,
    /// The first literal of each source in `literals`.
    pub(super) first_literal: Vec<usize>,
    pub(super) own: HashMap<SourceSpan, u32>,
    /// Robtargets assembled from parts that some run does not know, or uses where they cannot be edited.
    pub(super) unassembled: HashSet<SourceSpan>,
    pub(super) pinned: BTreeSet<u32>,
    /// Data whose declarations are pinned, with the data from which these take their values.
    pub(super) pinned_data: BTreeSet<usize>,
    /// Offsets that must not be edited, by their first number.
    pub(super) held: HashSet<SourceSpan>,
    pub(super) names: HashMap<u32, Arc<str>>,
    pub(super) tools: Vec<Tool>,
    pub(super) tool_numbers: HashMap<Vec<u8>, u16>,
    pub(super) wobjs: Vec<Wobj>,
    pub(super) wobj_numbers: HashMap<Vec<u8>, u16>,
    pub(super) targets: Vec<Target>,
    pub(super) sites: Vec<TargetInText>,
    pub(super) gathering: Gathering,
    /// Number of WHILE loops begun so far, which numbers them.
    pub(super) loops: u64,
    /// Ordinal of the motion at whose end the robot stands, 0 at the start of the routine; `None` if known only at run time.
    pub(super) stands: Option<u32>,
    /// Ordinal of the last target.
    pub(super) last: u32,
    /// Targets at which the robot may stand.
    pub(super) standing: BTreeSet<usize>,
    pub(super) offsets: Vec<Offset>,
    /// Statements that were run.
    pub(super) ran: Ran,
    /// Uses by routines that nothing runs.
    pub(super) aside: Vec<Use>,
    /// Sets of units that were deactivated together, the first empty; [`Axes::inactive`] is an index into them.
    pub(super) inactive: Vec<Arc<[InactiveUnit]>>,
    /// External axes of the last target that has any.
    pub(super) external: Option<Arc<ExternalAxes>>,
    /// The external axes have moved by themselves since the last target.
    pub(super) axes_moved: bool,
    pub(super) kept: Vec<Kept>,
    /// Statements that were kept, with the reason.
    pub(super) seen: HashSet<(usize, Span, Reason)>,
    /// Diagnostics that were reported, by code.
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
