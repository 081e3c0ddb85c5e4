//! The program as it runs: calls, loops and branches followed as far as they are known when reading.

use super::again::Gathering;
use super::cycle::Begun;
use super::eval::{BROKEN_AGGREGATE, NOT_A_NUMBER, Scope};
use super::literal::Literal;
use super::memory::{Layer, Left};
use super::motion::{self, Simple};
use super::outcome::Outcome;
use super::predefined;
use super::state::{State, Switches};
use super::symbols::{Names, RoutineId, Symbols};
use super::tree::{File, RoutineKind, Statement};
use super::uses::{Ran, Use};
use super::value::Place;
use super::{Offset, Site};
use crate::program::{ExternalAxes, InactiveUnit, Kept, Target, Tool, Wobj};
use crate::text::{Diagnostic, LineIndex, Severity, Source, Span};
use std::collections::{BTreeSet, HashMap, HashSet};
use std::sync::Arc;

/// Statements run in all, and for each byte of the program besides: ends loops whose condition never changes.
const STEPS: usize = 500_000;
const STEPS_PER_BYTE: usize = 4;
/// So many bytes of a statement count as one more: long ones take longer.
const BYTES_PER_STEP: usize = 256;
/// Targets in all, loops expanded, and for each byte of the program besides: a file of one line must not fill the memory.
const TARGETS: usize = 200_000;
const TARGETS_PER_BYTE: usize = 1;
/// Motions in all, where those that are alike are held once: a loop that never ends is to be told in minutes.
const MOTIONS: u32 = 20_000_000;
/// Largest deviation of |q|² from 1 that a controller takes for a matter of printing: its length is 1 ± 0.001 then. ABB's page
/// on `orient` asks for a sum of squares of 1; three decimals, the fewest that posts print, keep within this.
pub(super) const MAX_NORM_ERROR: f64 = 2e-3;

/// Whether the statement behind is run next.
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
    /// What it leaves where an error goes to whoever called it.
    pub(super) raises: Vec<Left>,
    /// A GOTO stands in it.
    pub(super) jumps: bool,
    /// What was in force when an error was noted last.
    pub(super) noted: Option<(u64, State)>,
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
    /// Nothing but what holds behind it.
    Dry,
}

/// The last tool or work object argument and what it meant, while no name can have changed.
#[derive(Clone, Copy, Default)]
pub(super) struct Cached {
    pub(super) place: Option<Place>,
    pub(super) epoch: u64,
    pub(super) index: u16,
}

pub(super) struct Runner<'a> {
    pub(super) symbols: Symbols<'a>,
    pub(super) written: usize,
    pub(super) frames: Vec<Frame>,
    pub(super) layers: Vec<Layer>,
    pub(super) state: State,
    pub(super) mode: Mode,
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
    /// A procedure was called whose name is known only at run time.
    pub(super) any_called: bool,
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
    pub(super) own: HashMap<Place, u32>,
    /// Robtargets put together from parts that some run does not know, or has where they cannot be edited.
    pub(super) unassembled: HashSet<Place>,
    pub(super) pinned: BTreeSet<u32>,
    /// Data whose declarations are among them with all that they take over from others.
    pub(super) pinned_data: BTreeSet<usize>,
    /// Offsets that may not be edited, by their first number.
    pub(super) held: HashSet<Place>,
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
    pub(super) seen: HashSet<(usize, Span, &'static str)>,
    pub(super) diagnostics: Vec<Diagnostic>,
    pub(super) lines: Vec<LineIndex>,
    pub(super) motions: u32,
    /// Motions without a target, by reason.
    pub(super) unknown: Vec<(&'static str, usize)>,
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
            state: State::default(),
            mode: Mode::Real,
            guards: 0,
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
            any_called: false,
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

    /// Runs `main`; where there is none, or it moves nothing, every procedure that no other calls.
    pub(super) fn run(self, files: &[File]) -> Outcome {
        self.run_gathering(files).0
    }

    /// [`Runner::run`] with what was gathered, and how many motions were executed.
    pub(super) fn run_gathering(mut self, files: &[File]) -> (Outcome, Gathering, u32) {
        let procs = self.follow();
        self.look_aside(&procs);
        self.keep_what_is_not_run();
        self.tell_traps_that_move();
        let gathering = std::mem::replace(&mut self.gathering, Gathering::All);
        let motions = self.motions;
        (self.finish(files), gathering, motions)
    }

    /// What [`Runner::run`] runs; the procedures of the program.
    pub(super) fn follow(&mut self) -> Vec<RoutineId> {
        let procs = self.procedures();
        let main = procs.iter().copied().find(|id| self.routine_name(*id).eq_ignore_ascii_case(b"main"));
        self.begin_cycle();
        self.enter_all(main.as_slice());
        if let Some(main) = main {
            self.tell_next_cycle(main);
        }
        if self.motions == 0 {
            let others: Vec<RoutineId> = self.uncalled(&procs).into_iter().filter(|id| Some(*id) != main).collect();
            self.enter_all(&others);
        }
        procs
    }

    fn enter_all(&mut self, entries: &[RoutineId]) {
        for &id in entries {
            if self.start(id) == Flow::Gone && self.steps >= self.most_steps {
                break;
            }
        }
    }

    /// Procedures of the program itself, in the order of the text.
    fn procedures(&self) -> Vec<RoutineId> {
        let own = |id: &RoutineId| id.file < self.written && self.symbols.routine(*id).kind == RoutineKind::Proc;
        self.symbols.all().filter(own).collect()
    }

    pub(super) fn routine_name(&self, id: RoutineId) -> &'a [u8] {
        &self.bytes(id.file)[self.symbols.routine(id).name.range()]
    }

    pub(super) fn scope(&self) -> Scope {
        match self.frames.last() {
            #[allow(clippy::cast_possible_truncation)]
            Some(frame) => {
                Scope { source: frame.routine.file as u16, module: frame.module, local: true, running: true }
            }
            None => Scope { source: 0, module: 0, local: false, running: true },
        }
    }

    pub(super) fn bytes(&self, source: usize) -> &'a [u8] {
        let sources = self.symbols.sources;
        &sources[source].bytes
    }

    /// Runs something for what holds behind it, or for what it uses.
    pub(super) fn quietly<T>(&mut self, mode: Mode, run: impl FnOnce(&mut Self) -> T) -> T {
        let before = self.mode;
        self.mode = before.max(mode);
        let done = run(self);
        self.mode = before;
        done
    }

    pub(super) fn block(&mut self, block: &'a [Statement]) -> Flow {
        for statement in block {
            self.steps = self.steps.saturating_add(1);
            if self.steps > self.most_steps || self.targets.len() > self.most_targets || self.motions > MOTIONS {
                return self.give_up();
            }
            let flow = match statement {
                Statement::Simple(span) => {
                    self.steps = self.steps.saturating_add(span.len() / BYTES_PER_STEP);
                    if self.mode == Mode::Real {
                        self.ran.add(self.scope().source, span.start);
                    }
                    self.simple(*span)
                }
                Statement::Mark(mark) => {
                    self.state.mark = Some(*mark);
                    self.state.mark_unknown = self.jumping.marks;
                    Flow::Next
                }
                Statement::If { arms, otherwise, at } => self.condition(arms, otherwise, *at),
                Statement::For { variable, from, to, step, body, at } => {
                    self.counted([*from, *to], *step, *variable, body, *at)
                }
                Statement::While { condition, body, at } => self.repeat(*condition, body, *at),
                Statement::Test { subject, cases, otherwise, at } => self.choice(*subject, cases, otherwise, *at),
                Statement::Return(value) => {
                    if !value.is_empty() {
                        let value = self.evaluate(self.scope(), *value);
                        self.pin_value(&value);
                    }
                    self.leave();
                    Flow::Gone
                }
                Statement::Raise => self.raise(),
                // Of a handler, which is not run, or out of place.
                Statement::Exit | Statement::Retry | Statement::TryNext => Flow::Gone,
                Statement::Connect(_) => {
                    self.events += 1;
                    Flow::Next
                }
                Statement::Goto(label) => {
                    self.note(
                        *label,
                        "rapid.goto",
                        "GOTO is not followed: statements are taken in the order of the text, and what the routine \
                         changes is not known in it",
                    );
                    Flow::Next
                }
            };
            // Where labels stand, what is behind may be reached in other ways.
            if flow == Flow::Gone && !self.frames.last().is_some_and(|frame| frame.jumps) {
                return flow;
            }
        }
        Flow::Next
    }

    pub(super) fn give_up(&mut self) -> Flow {
        if self.steps < usize::MAX {
            // Once is enough: whatever runs on ends at its next step.
            self.steps = usize::MAX;
            if self.looking_aside {
                return Flow::Gone;
            }
            let place = self
                .frames
                .last()
                .map_or((0, Span::default()), |f| (f.routine.file, self.symbols.routine(f.routine).name));
            let (targets, steps) = (self.most_targets, self.most_steps);
            let message = match self.gathering {
                Gathering::All => format!("the program runs through more than {targets} targets or {steps} statements"),
                _ => format!(
                    "the program runs through more than {MOTIONS} motions, {targets} different ones, or {steps} statements \
                     between them"
                ),
            };
            let error = Diagnostic::error("rapid.endless", "", message).at(&self.symbols.sources[place.0], place.1);
            self.diagnostics.push(error.help("split the program, or bound its loops"));
        }
        Flow::Gone
    }

    /// The program does what no controller lets it do.
    pub(super) fn refuse(&mut self, source: u16, span: Span, code: &'static str, message: &str, help: &str) {
        if self.mode == Mode::Real && self.seen.insert((usize::from(source), span, code)) {
            let error = Diagnostic::error(code, "", message).at(&self.symbols.sources[usize::from(source)], span);
            self.diagnostics.push(error.help(help));
        }
    }

    pub(super) fn note(&mut self, span: Span, code: &'static str, message: &str) {
        self.tell(span, code, message, Severity::Note);
    }

    pub(super) fn tell(&mut self, span: Span, code: &'static str, message: &str, severity: Severity) {
        let source = self.scope().source as usize;
        if self.mode == Mode::Real && self.seen.insert((source, span, code)) {
            let told = Diagnostic::error(code, "", message).at(&self.symbols.sources[source], span);
            self.diagnostics.push(told.severity(severity));
        }
    }

    /// Keeps a motion whose target is not known.
    pub(super) fn keep_motion(&mut self, span: Span, reason: &'static str) {
        self.stands = None;
        if self.mode != Mode::Real {
            return;
        }
        // What no controller loads, whatever runs before.
        let fault = matches!(reason, NOT_A_NUMBER | BROKEN_AGGREGATE | NOT_UNIT);
        self.keep_as(self.scope().source as usize, span, reason, fault);
        match self.unknown.iter_mut().find(|(known, _)| *known == reason) {
            Some((_, count)) => *count += 1,
            None => self.unknown.push((reason, 1)),
        }
    }

    /// Keeps a statement of the running routine.
    pub(super) fn keep_here(&mut self, span: Span, reason: &'static str) {
        if self.mode == Mode::Real {
            self.keep(self.scope().source as usize, span, reason);
        }
    }

    pub(super) fn keep(&mut self, source: usize, span: Span, reason: &'static str) {
        self.keep_as(source, span, reason, false);
    }

    fn keep_as(&mut self, source: usize, span: Span, reason: &'static str, fault: bool) {
        if source < self.written && self.seen.insert((source, span, reason)) {
            let line = self.lines[source].line(span.start);
            let help = "";
            self.kept.push(Kept { source, span, line: line as usize, reason, fault, help });
        }
    }

    fn simple(&mut self, span: Span) -> Flow {
        let scope = self.scope();
        let bytes = self.bytes(scope.source as usize);
        let Some(simple) = motion::split(bytes, scope.source, span) else {
            self.keep_here(span, "statement is not understood");
            self.events += 1;
            return Flow::Next;
        };
        let call = match simple {
            Simple::Assignment { target, value } => {
                let failures = self.failures;
                if self.guards > 0 && bytes[target.range()].contains(&b'{') {
                    // For its index.
                    self.evaluate(scope, target);
                }
                self.assign(scope, target, value);
                // What the handler changes may be what would have been assigned.
                if self.failures > failures {
                    self.may_be_handled(true);
                }
                return Flow::Next;
            }
            Simple::Call(call) => call,
        };
        if call.late_bound {
            return self.enter_late(scope, &call, span);
        }
        let name = &bytes[call.name.range()];
        if let Some(id) = self.symbols.find_routine(scope.module, name) {
            return self.enter(scope, id, &call, span);
        }
        let shape = motion::shape(name);
        // A motion that is stopped stops the program; a search may find nothing.
        let plain = shape.is_some_and(|shape| shape.zone != motion::Zone::Absent);
        let known = if shape.is_none() { predefined::instruction(name) } else { None };
        let fails = match known {
            _ if plain => call.option(bytes, b"Conc").is_some(),
            Some(known) => known.may_fail(),
            None => true,
        };
        let (fails, failures) = (self.guards > 0 && fails, self.failures);
        if fails {
            self.may_fail();
            self.may_be_handled(false);
        }
        let flow = match (shape, known) {
            (Some(shape), _) => {
                self.motion(scope, &call, shape, span);
                if self.skipped_since(failures) {
                    self.stands = None;
                }
                Flow::Next
            }
            (None, Some(instruction)) => self.instruction(scope, &call, instruction, span),
            (None, None) => {
                self.unknown_procedure(scope, &call, span);
                Flow::Next
            }
        };
        if fails && flow == Flow::Next {
            self.may_be_handled(true);
        }
        flow
    }
}

/// What no controller moves to.
pub(super) const NOT_UNIT: &str = "orientation is not a unit quaternion";
