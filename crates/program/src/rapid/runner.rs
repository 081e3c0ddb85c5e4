//! The state of a run: known values, statements met, and results.

use super::gathering::Gathering;
use super::known::RoutineId;
use super::literal::Literal;
use super::ran::{Ran, Step, Use, UsedArc};
use super::state::{Begun, ModalState, Site, Standing, State};
use super::steps::Routines;
use super::symbols::{Names, Symbols};
use super::tree::{File, While};
use super::value::{HeldNumber, Number};
use super::{Offset, TargetInText};
use crate::kept::KeptStatements;
use crate::{ExternalAxes, InactiveUnit, Mark, Target, Tool, UnknownMotion, Wobj};
use deflex_lang::ir::SourceSpan;
use deflex_text::{Diagnostic, Source, Span};
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::rc::Rc;
use std::sync::Arc;

/// Most statements run in all, in addition to those per byte of the program.
const STEPS: usize = 500_000;
const STEPS_PER_BYTE: usize = 4;
/// Most targets in all, with loops expanded, in addition to those per byte: a file of one line must not fill the memory.
const TARGETS: usize = 200_000;
const TARGETS_PER_BYTE: usize = 1;

/// A routine that is being run.
#[derive(Default)]
pub(super) struct Frame {
    pub(super) routine: RoutineId,
    pub(super) module: usize,
    pub(super) names: Names,
    /// Its FOR loops so far.
    pub(super) loops: Vec<RunningLoop>,
    /// Rounds of its WHILE loops so far, by address.
    pub(super) rounds: HashMap<*const While, u32>,
    /// The innermost FOR loop around the running statement.
    pub(super) within: Option<usize>,
    /// The state in which its handler returns.
    pub(super) returned: Option<State>,
    /// The state in which it passes an error to its caller.
    pub(super) raised: Option<State>,
    /// The version and modal state at the last error that was recorded.
    pub(super) noted: Option<(u64, ModalState)>,
}

/// A FOR loop of a running routine.
#[derive(Clone, Copy)]
pub(super) struct RunningLoop {
    /// The number of the loop.
    pub(super) of: usize,
    /// Its variable, and those that hold its last value and its step.
    pub(super) variables: [usize; 3],
    /// Its first value, and the number of motions before it.
    pub(super) from: f64,
    pub(super) motions: u32,
}

/// What a run is for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Mode {
    /// The targets of the program.
    #[default]
    Real,
    /// The data that a routine which the program never calls would use, and no targets.
    UsesAlone,
}

/// The last tool or work object argument and its meaning, valid while no name can have changed.
#[derive(Clone, Copy, Default)]
pub(super) struct Cached {
    pub(super) place: Option<SourceSpan>,
    pub(super) version: u64,
    pub(super) index: u16,
}

/// The run of a program: the state at the present statement, and what was found so far.
#[derive(Default)]
pub(super) struct Runner<'a> {
    pub(super) symbols: Symbols<'a>,
    /// Files that will be written; those after them give declarations only.
    pub(super) written: usize,
    pub(super) routines: Rc<Routines<'a>>,
    pub(super) frames: Vec<Frame>,
    /// The number of the running chain of calls, and of all chains so far by the chain of the caller and the place of the call.
    pub(super) calls: u32,
    pub(super) chains: HashMap<(u32, SourceSpan), u32>,
    pub(super) state: State,
    pub(super) mode: Mode,
    /// Whether results are recorded. They are not while the states where paths meet are being found.
    pub(super) is_recording: bool,
    /// The mark before the first routine.
    pub(super) mark_at_start: Option<Mark>,
    /// Whether the expression that is evaluated is only shown to people, so that reading a robtarget does not hold it.
    pub(super) is_shown: bool,
    pub(super) errors: Errors,
    pub(super) units: Units,
    pub(super) budget: Budget,
    pub(super) counters: Counters,
    pub(super) reached: Reached,
    pub(super) numbers: Numbers,
    pub(super) used: UsedFrames,
    pub(super) found: Found,
    pub(super) gathering: Gathering,
    pub(super) messages: Messages,
    pub(super) begun: Begun,
}

/// Errors that handlers may catch.
#[derive(Default)]
pub(super) struct Errors {
    /// Whether a handler may take over a stopped motion: see [`Runner::handles_stops`].
    pub(super) stops_are_handled: bool,
    /// Number of running routines that catch errors.
    pub(super) guards: usize,
    /// How often an expression in one could have failed.
    pub(super) failures: usize,
}

/// External axes.
#[derive(Default)]
pub(super) struct Units {
    /// Sets of units that were deactivated together, the first empty; [`Axes::inactive`](super::state::Axes::inactive) is an index into them.
    pub(super) inactive: Vec<Arc<[InactiveUnit]>>,
    /// External axes of the last target that has any.
    pub(super) external: Option<Arc<ExternalAxes>>,
    /// The external axes have moved by themselves since the last target.
    pub(super) axes_moved: bool,
}

/// The bounds of a run, which end loops whose condition never changes, and what is used of them.
#[derive(Default)]
pub(super) struct Budget {
    /// Steps so far: about one for each statement.
    pub(super) steps: usize,
    pub(super) most_steps: usize,
    /// Most targets that are held.
    pub(super) most_targets: usize,
}

impl Budget {
    pub(super) fn spend(&mut self, steps: usize) {
        self.steps = self.steps.saturating_add(steps);
    }

    /// Takes steps back, unless the run was ended.
    pub(super) fn give_back(&mut self, steps: usize) {
        if !self.has_ended() {
            self.steps = self.steps.saturating_sub(steps);
        }
    }

    pub(super) fn is_spent(&self) -> bool {
        self.steps > self.most_steps
    }

    /// Ends the run: everything that still runs ends at its next step.
    pub(super) fn end(&mut self) {
        self.steps = usize::MAX;
    }

    pub(super) fn has_ended(&self) -> bool {
        self.steps == usize::MAX
    }
}

/// Counts of what has happened.
#[derive(Default)]
pub(super) struct Counters {
    /// Versions of the state.
    pub(super) versions: u64,
    /// Statements that are neither motions nor without effect.
    pub(super) events: u64,
    /// Markers in the results.
    pub(super) marks: u64,
    /// Executed motions, and the arcs among them.
    pub(super) motions: u32,
    pub(super) arcs: usize,
}

/// Routines and statements that were run.
#[derive(Default)]
pub(super) struct Reached {
    pub(super) ran: Ran,
    pub(super) entered: HashSet<RoutineId>,
    /// Routines that call themselves so often that they were not followed.
    pub(super) endless: BTreeSet<RoutineId>,
    /// Routines that were run only for the data that they would use.
    pub(super) entered_for_uses: HashSet<RoutineId>,
    /// Whether a routine that nothing calls is being run.
    pub(super) runs_uncalled: bool,
    /// Whether these runs came to no end, so that any routine may run in any way.
    pub(super) is_uncalled_cut: bool,
    /// Uses by routines that nothing runs.
    pub(super) uses: Vec<Use>,
    pub(super) used_arcs: BTreeSet<UsedArc>,
    pub(super) steps: BTreeSet<Step>,
    /// The lines and arcs of routines of the program, by the routine that nothing calls and that runs them too.
    pub(super) run_by_uncalled: BTreeMap<RoutineId, BTreeSet<Standing>>,
    /// Numbers that only routines hold that nothing runs, with these routines.
    pub(super) held_by: HashMap<Number, BTreeSet<RoutineId>>,
    /// Calls of procedures chosen at run time: the start of their names in upper case, empty if any name is possible.
    pub(super) called_late: Vec<Box<[u8]>>,
}

impl Reached {
    /// Records that a routine that nothing runs holds a number.
    pub(super) fn hold(&mut self, HeldNumber { number, is_new }: HeldNumber, by: RoutineId) {
        if is_new {
            self.held_by.insert(number, BTreeSet::from([by]));
        } else if let Some(all) = self.held_by.get_mut(&number) {
            all.insert(by);
        }
    }
}

/// The robtargets of the text, and the reasons not to edit their numbers.
#[derive(Default)]
pub(super) struct Numbers {
    /// Complete robtargets by file, then those that are assembled from parts.
    pub(super) literals: Vec<Literal>,
    /// The first literal of each file in `literals`.
    pub(super) first_literal: Vec<usize>,
    /// Robtargets that are assembled from parts.
    pub(super) own: HashMap<SourceSpan, u32>,
    /// Those of which some run does not know the parts, or uses them where they cannot be edited.
    pub(super) unassembled: HashSet<SourceSpan>,
    /// Those that must not be edited.
    pub(super) held: HashSet<Number>,
    /// Data whose declarations are pinned, with the data from which these take their values.
    pub(super) pinned_data: BTreeSet<usize>,
    /// Robtargets that variables have held, by the number of the variable; without those of `read`.
    pub(super) origins: HashMap<usize, HashSet<Number>>,
    /// Variables that were read where it is unknown which robtarget they hold.
    pub(super) read: HashSet<usize>,
    /// Robtargets that parameters and data of routines with handlers stood for, by routine and name.
    pub(super) given: HashMap<(RoutineId, Box<[u8]>), HashSet<Number>>,
    /// Names of literals as motions spell them.
    pub(super) names: HashMap<u32, Arc<str>>,
}

/// Tools and work objects that motions use.
#[derive(Default)]
pub(super) struct UsedFrames {
    pub(super) tools: Vec<Tool>,
    pub(super) tool_numbers: HashMap<Vec<u8>, u16>,
    pub(super) wobjs: Vec<Wobj>,
    pub(super) wobj_numbers: HashMap<Vec<u8>, u16>,
    pub(super) last_tool: Cached,
    pub(super) last_wobj: Cached,
    /// The last speed argument and its value.
    pub(super) last_speed: (Cached, Option<f64>),
}

/// The motions of the program so far.
#[derive(Default)]
pub(super) struct Found {
    pub(super) targets: Vec<Target>,
    /// One per target.
    pub(super) sites: Vec<TargetInText>,
    pub(super) offsets: Vec<Offset>,
    /// See [`Layout::standing`](super::Layout).
    pub(super) standing: Vec<Offset>,
    /// The roots and first numbers of these.
    pub(super) standing_places: HashSet<(u32, Option<SourceSpan>)>,
    /// See [`Layout::joints_elsewhere`](super::Layout).
    pub(super) joints_elsewhere: BTreeSet<u32>,
    /// See [`Layout::bound_to_point`](super::Layout).
    pub(super) bound_to_point: BTreeSet<u32>,
    /// Motions without a target.
    pub(super) unknown: Vec<UnknownMotion>,
    /// The place of the last target.
    pub(super) last: Option<Site>,
    /// Targets from which a displacement is counted.
    pub(super) counted_from: BTreeSet<Standing>,
}

/// Messages to the user.
#[derive(Default)]
pub(super) struct Messages {
    pub(super) kept: KeptStatements,
    /// Diagnostics that were reported, by code.
    pub(super) reported: HashSet<(usize, Span, &'static str)>,
    /// Calls of routines in no file, by the routines that nothing runs in which they are.
    pub(super) undeclared_in_uncalled: Vec<(RoutineId, Diagnostic)>,
    pub(super) diagnostics: Vec<Diagnostic>,
}

impl Messages {
    /// Reports what no other message says.
    pub(super) fn report_once(&mut self, new: Diagnostic) {
        if !self.diagnostics.iter().any(|other| other.code == new.code && other.message == new.message) {
            self.diagnostics.push(new);
        }
    }
}

impl<'a> Runner<'a> {
    pub(super) fn new(sources: &'a [Source], files: &'a [File], written: usize) -> Self {
        let bytes: usize = sources.iter().map(|s| s.bytes.len()).sum();
        let symbols = Symbols::new(sources, files);
        let mut runner = Self {
            routines: Rc::new(Routines::new(&symbols)),
            symbols,
            written,
            is_recording: true,
            mark_at_start: files.iter().take(written).find_map(|file| file.mark),
            units: Units { inactive: vec![Arc::new([])], ..Units::default() },
            budget: Budget {
                steps: 0,
                most_steps: STEPS + STEPS_PER_BYTE * bytes,
                most_targets: TARGETS + TARGETS_PER_BYTE * bytes,
            },
            reached: Reached { ran: Ran::new(sources), ..Reached::default() },
            numbers: Numbers::of(files),
            messages: Messages { kept: KeptStatements::new(sources, written), ..Messages::default() },
            ..Self::default()
        };
        for (source, file) in files.iter().enumerate().take(written) {
            for &(span, reason) in &file.odd {
                runner.messages.kept.keep(source, span, reason);
            }
        }
        runner.begin();
        runner
    }
}
