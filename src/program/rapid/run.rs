//! The program as it runs: calls, loops and branches followed as far as they are known when reading.

use super::eval::{BROKEN_AGGREGATE, NOT_A_NUMBER, Scope};
use super::literal::Literal;
use super::motion::{self, Simple};
use super::outcome::Outcome;
use super::symbols::{Names, RoutineId, Symbols};
use super::tree::{File, RoutineKind, Statement};
use super::value::Place;
use super::{Offset, Site};
use crate::program::{Kept, Mark, Target, Tool, Wobj};
use crate::text::{Diagnostic, LineIndex, Severity, Source, Span};
use std::collections::{HashMap, HashSet};
use std::sync::Arc;

/// Statements run in all, and for each byte of the program besides: ends loops whose condition never changes.
const STEPS: usize = 500_000;
const STEPS_PER_BYTE: usize = 4;
/// Targets in all, loops expanded, and for each byte of the program besides: a file of one line must not fill the memory.
const TARGETS: usize = 200_000;
const TARGETS_PER_BYTE: usize = 1;
/// Largest deviation of |q|² from 1 that can be a matter of printing (LANGUAGES: repairable up to 0.1).
pub(super) const MAX_NORM_ERROR: f64 = 0.1;

/// Whether the statements behind are still run.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Flow {
    Next,
    Return,
    Stop,
}

/// A routine that is being run.
pub(super) struct Frame {
    pub(super) routine: RoutineId,
    pub(super) module: usize,
    pub(super) names: Names,
}

/// What the instructions before leave in force.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct State {
    pub(super) mark: Option<Mark>,
    pub(super) program_displacement: bool,
    pub(super) axis_offset: bool,
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
    pub(super) state: State,
    /// Inside a branch or loop whose condition is not known.
    pub(super) unsure: usize,
    pub(super) steps: usize,
    pub(super) most_steps: usize,
    pub(super) most_targets: usize,
    /// Routines that were run.
    pub(super) entered: HashSet<RoutineId>,
    pub(super) epoch: u64,
    /// Assignments so far: a loop without any never ends by itself.
    pub(super) changes: u64,
    pub(super) tool: Cached,
    pub(super) wobj: Cached,
    /// The last speed argument and its value.
    pub(super) speed: (Cached, Option<f64>),
    pub(super) literals: Vec<Literal>,
    /// Literals of each source within `literals`.
    pub(super) first_literal: Vec<usize>,
    pub(super) next_literal: usize,
    pub(super) own: HashMap<Place, u32>,
    pub(super) pinned: HashSet<u32>,
    pub(super) names: HashMap<u32, Arc<str>>,
    pub(super) tools: Vec<Tool>,
    pub(super) wobjs: Vec<Wobj>,
    pub(super) targets: Vec<Target>,
    pub(super) sites: Vec<Site>,
    pub(super) offsets: Vec<Offset>,
    pub(super) external: Option<[f64; 6]>,
    pub(super) external_moves: bool,
    pub(super) on_axes: Vec<bool>,
    pub(super) kept: Vec<Kept>,
    pub(super) seen: HashSet<(usize, Span, &'static str)>,
    pub(super) diagnostics: Vec<Diagnostic>,
    pub(super) lines: Vec<LineIndex>,
    pub(super) motions: u32,
    /// Motions without a target, by reason.
    pub(super) unknown: Vec<(&'static str, usize)>,
    pub(super) arcs: usize,
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
            state: State::default(),
            unsure: 0,
            steps: 0,
            most_steps: STEPS + STEPS_PER_BYTE * bytes,
            most_targets: TARGETS + TARGETS_PER_BYTE * bytes,
            entered: HashSet::new(),
            epoch: 1,
            changes: 0,
            tool: Cached::default(),
            wobj: Cached::default(),
            speed: (Cached::default(), None),
            literals,
            first_literal,
            next_literal: 0,
            own: HashMap::new(),
            pinned: HashSet::new(),
            names: HashMap::new(),
            tools: Vec::new(),
            wobjs: Vec::new(),
            targets: Vec::new(),
            sites: Vec::new(),
            offsets: Vec::new(),
            external: None,
            external_moves: false,
            on_axes: Vec::new(),
            kept: Vec::new(),
            seen: HashSet::new(),
            diagnostics: Vec::new(),
            lines: sources.iter().map(LineIndex::new).collect(),
            motions: 0,
            unknown: Vec::new(),
            arcs: 0,
        };
        for (source, file) in files.iter().enumerate().take(written) {
            for &(span, reason) in &file.odd {
                runner.keep(source, span, reason);
            }
        }
        runner.state.mark = files.iter().take(written).find_map(|f| f.mark);
        runner
    }

    /// Runs `main`; where there is none, or it moves nothing, every procedure that no other calls.
    pub(super) fn run(mut self, files: &[File]) -> Outcome {
        let procs = self.procedures();
        let main = procs.iter().copied().find(|id| self.routine_name(*id).eq_ignore_ascii_case(b"main"));
        self.enter_all(main.as_slice());
        if self.motions == 0 {
            let others: Vec<RoutineId> = self.uncalled(&procs).into_iter().filter(|id| Some(*id) != main).collect();
            self.enter_all(&others);
        }
        self.keep_what_is_not_run();
        self.finish(files)
    }

    fn enter_all(&mut self, entries: &[RoutineId]) {
        for &id in entries {
            if self.start(id) == Flow::Stop && self.steps >= self.most_steps {
                break;
            }
        }
    }

    /// Routines with motions in them that nothing in the files runs: their targets stay as they are.
    fn keep_what_is_not_run(&mut self) {
        let idle = |id: &RoutineId| id.file < self.written && !self.entered.contains(id);
        for id in self.symbols.all().filter(idle).collect::<Vec<_>>() {
            if self.symbols.moves(id) {
                self.keep(id.file, self.symbols.routine(id).name, "routine that nothing in the files runs");
            }
        }
    }

    /// Procedures of the program itself, in the order of the text.
    fn procedures(&self) -> Vec<RoutineId> {
        let own = |id: &RoutineId| id.file < self.written && self.symbols.routine(*id).kind == RoutineKind::Proc;
        self.symbols.all().filter(own).collect()
    }

    fn routine_name(&self, id: RoutineId) -> &'a [u8] {
        &self.bytes(id.file)[self.symbols.routine(id).name.range()]
    }

    pub(super) fn scope(&self) -> Scope {
        match self.frames.last() {
            #[allow(clippy::cast_possible_truncation)]
            Some(frame) => Scope { source: frame.routine.file as u16, module: frame.module, local: true },
            None => Scope { source: 0, module: 0, local: false },
        }
    }

    pub(super) fn bytes(&self, source: usize) -> &'a [u8] {
        let sources = self.symbols.sources;
        &sources[source].bytes
    }

    pub(super) fn block(&mut self, block: &'a [Statement]) -> Flow {
        for statement in block {
            self.steps = self.steps.saturating_add(1);
            if self.steps > self.most_steps || self.targets.len() > self.most_targets {
                return self.give_up();
            }
            let flow = match statement {
                Statement::Simple(span) => self.simple(*span),
                Statement::Mark(mark) => {
                    self.state.mark = Some(*mark);
                    Flow::Next
                }
                Statement::If { arms, otherwise, at } => self.condition(arms, otherwise, *at),
                Statement::For { variable, from, to, step, body, at } => {
                    self.counted([*from, *to], *step, *variable, body, *at)
                }
                Statement::While { condition, body, at } => self.repeat(*condition, body, *at),
                Statement::Test { subject, cases, otherwise, at } => self.choice(*subject, cases, otherwise, *at),
                Statement::Return => Flow::Return,
                Statement::Exit => Flow::Stop,
                Statement::Goto(label) => {
                    self.note(
                        *label,
                        "rapid.goto",
                        "GOTO is not followed: statements are taken in the order of the text",
                    );
                    Flow::Next
                }
            };
            // Under a condition that is not known, what stands behind may run as well.
            if flow != Flow::Next && self.unsure == 0 {
                return flow;
            }
        }
        Flow::Next
    }

    pub(super) fn give_up(&mut self) -> Flow {
        if self.steps < usize::MAX {
            // Once is enough: whatever runs on ends at its next step.
            self.steps = usize::MAX;
            let place = self
                .frames
                .last()
                .map_or((0, Span::default()), |f| (f.routine.file, self.symbols.routine(f.routine).name));
            let (targets, steps) = (self.most_targets, self.most_steps);
            let message = format!("the program runs through more than {targets} targets or {steps} statements");
            let error = Diagnostic::error("rapid.endless", "", message).at(&self.symbols.sources[place.0], place.1);
            self.diagnostics.push(error.help("split the program, or bound its loops"));
        }
        Flow::Stop
    }

    pub(super) fn note(&mut self, span: Span, code: &'static str, message: &str) {
        let source = self.scope().source as usize;
        if self.seen.insert((source, span, code)) {
            let note = Diagnostic::error(code, "", message).at(&self.symbols.sources[source], span);
            self.diagnostics.push(note.severity(Severity::Note));
        }
    }

    /// Keeps a motion whose target is not known.
    pub(super) fn keep_motion(&mut self, span: Span, reason: &'static str) {
        // What no controller loads, whatever runs before.
        let fault = matches!(reason, NOT_A_NUMBER | BROKEN_AGGREGATE);
        self.keep_as(self.scope().source as usize, span, reason, fault);
        match self.unknown.iter_mut().find(|(known, _)| *known == reason) {
            Some((_, count)) => *count += 1,
            None => self.unknown.push((reason, 1)),
        }
    }

    /// Keeps a statement of the running routine.
    pub(super) fn keep_here(&mut self, span: Span, reason: &'static str) {
        self.keep(self.scope().source as usize, span, reason);
    }

    pub(super) fn keep(&mut self, source: usize, span: Span, reason: &'static str) {
        self.keep_as(source, span, reason, false);
    }

    fn keep_as(&mut self, source: usize, span: Span, reason: &'static str, fault: bool) {
        if source < self.written && self.seen.insert((source, span, reason)) {
            let line = self.lines[source].line(span.start);
            self.kept.push(Kept { source, span, line: line as usize, reason, fault });
        }
    }

    fn simple(&mut self, span: Span) -> Flow {
        let scope = self.scope();
        let bytes = self.bytes(scope.source as usize);
        let Some(simple) = motion::split(bytes, scope.source, span) else {
            self.keep_here(span, "statement is not understood");
            return Flow::Next;
        };
        let call = match simple {
            Simple::Assignment { target, value } => {
                self.assign(scope, target, value);
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
        if let Some(shape) = motion::shape(name) {
            self.motion(scope, &call, shape, span);
            return Flow::Next;
        }
        self.instruction(scope, &call, span);
        Flow::Next
    }
}
