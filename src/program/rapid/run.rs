//! The program as it runs: calls, loops and branches followed as far as they are known when reading.

use super::eval::{BROKEN_AGGREGATE, NOT_A_NUMBER, Scope};
use super::literal::Literal;
use super::motion::{self, Call, Simple};
use super::symbols::{Names, RoutineId, Symbols, Upper, declared};
use super::tree::{File, RoutineKind, Statement};
use super::value::{Place, Value};
use super::{Layout, Site};
use crate::program::{Editable, Goal, Kept, Mark, Motion, Target, Tool, Wobj};
use crate::text::{Diagnostic, LineIndex, Severity, Source, Span};
use std::collections::{HashMap, HashSet};
use std::sync::Arc;

/// Calls deeper than this are not followed: a procedure that calls itself has no end when reading.
pub(super) const MAX_CALLS: usize = 48;
/// Statements run in all, and for each byte of the program besides: ends loops whose condition never changes.
const STEPS: usize = 500_000;
const STEPS_PER_BYTE: usize = 4;
/// A WHILE that goes round more often is taken for one whose end is known only at run time.
pub(super) const MAX_ROUNDS: usize = 100_000;
/// Targets in all, loops expanded, and for each byte of the program besides: a file of one line must not fill the memory.
const TARGETS: usize = 200_000;
const TARGETS_PER_BYTE: usize = 1;
/// Largest deviation of |q|² from 1 that can be a matter of printing (LANGUAGES: repairable up to 0.1).
pub(super) const MAX_NORM_ERROR: f64 = 0.1;

/// What an optional parameter holds that the call does not give.
pub(super) const ABSENT: &str = "optional argument that is not given";
/// What a parameter holds of a procedure that nothing in the files calls.
pub(super) const NOT_KNOWN: &str = "argument is not known";
pub(super) const CONTEXT: &str = "declared in a context module";

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
    pub(super) offsets: Vec<super::Offset>,
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

/// What a run gives.
pub(super) struct Outcome {
    pub(super) tools: Vec<Tool>,
    pub(super) wobjs: Vec<Wobj>,
    pub(super) targets: Vec<Target>,
    pub(super) kept: Vec<Kept>,
    pub(super) arcs: usize,
    pub(super) diagnostics: Vec<Diagnostic>,
    pub(super) layout: Layout,
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
            if self.call(id, &[]) == Flow::Stop && self.steps >= self.most_steps {
                break;
            }
        }
    }

    /// Routines with motions in them that nothing in the files runs: their targets stay as they are.
    fn keep_what_is_not_run(&mut self) {
        let idle = |id: &RoutineId| id.file < self.written && !self.entered.contains(id);
        for id in self.symbols.all().filter(idle).collect::<Vec<_>>() {
            let routine = self.symbols.routine(id);
            if self.symbols.moves(id, &routine.body) {
                self.keep(id.file, routine.name, "routine that nothing in the files runs");
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

    /// Those of `procs` that no other calls.
    fn uncalled(&self, procs: &[RoutineId]) -> Vec<RoutineId> {
        let mut called = HashSet::new();
        for &id in procs {
            let mut calls = Vec::new();
            self.calls(id, &self.symbols.routine(id).body, &mut calls);
            called.extend(calls.into_iter().filter(|c| *c != id));
        }
        let entries: Vec<RoutineId> = procs.iter().filter(|id| !called.contains(*id)).copied().collect();
        // Where each calls another in a ring: the first.
        if entries.is_empty() { procs.iter().copied().take(1).collect() } else { entries }
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

    pub(super) fn call(&mut self, id: RoutineId, arguments: &[(usize, Bound)]) -> Flow {
        if self.frames.len() >= MAX_CALLS {
            return Flow::Next;
        }
        self.entered.insert(id);
        let routine = self.symbols.routine(id);
        let bytes = self.bytes(id.file);
        let module = self.symbols.module_of(id);
        let mut names = Names::new();
        for (p, param) in routine.params.iter().enumerate() {
            let bound = arguments.iter().find(|(at, _)| *at == p).map(|(_, b)| b.clone());
            let at = match bound {
                Some(Bound::Variable(at)) if param.by_reference || !self.assigned_in(id, param.name) => at,
                bound => {
                    let value = match bound {
                        Some(Bound::Value(value)) => value,
                        Some(Bound::Variable(at)) => self.content(at),
                        None if param.optional && !self.frames.is_empty() => Value::Unknown(ABSENT),
                        None => Value::Unknown(NOT_KNOWN),
                    };
                    self.new_variable(bytes, id.file, module, param.kind, param.name, value)
                }
            };
            names.insert(Box::from(&*Upper::new(&bytes[param.name.range()])), at);
        }
        let assigned = self.symbols.changed_by(id);
        for data in &routine.data {
            let mut variable = declared(bytes, id.file, module, data);
            let key = Upper::new(&bytes[data.name.range()]);
            variable.assigned = assigned.iter().any(|n| **n == *key);
            names.insert(Box::from(&*key), self.symbols.variables.len());
            self.symbols.variables.push(variable);
        }
        let kept = self.symbols.variables.len();
        self.frames.push(Frame { routine: id, module, names });
        self.epoch += 1;
        let flow = self.block(&routine.body);
        self.frames.pop();
        self.epoch += 1;
        // Variables of routines called from here are gone; those bound above stay until the caller ends.
        self.symbols.variables.truncate(kept);
        if flow == Flow::Stop { Flow::Stop } else { Flow::Next }
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

    pub(super) fn simple(&mut self, span: Span) -> Flow {
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
        let name = &bytes[call.name.range()];
        if call.late_bound {
            let Value::Text(name) = self.evaluate(scope, call.name) else {
                self.keep_here(span, "procedure chosen at run time");
                return Flow::Next;
            };
            let name = name.rsplit(|b| *b == b':').next().unwrap_or_default();
            return match self.symbols.find_routine(scope.module, name) {
                Some(id) => self.enter(scope, id, &call, span),
                None => {
                    self.keep_here(span, "procedure is not in the files given");
                    Flow::Next
                }
            };
        }
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

    /// A call of a procedure that is in the files.
    pub(super) fn enter(&mut self, scope: Scope, id: RoutineId, call: &Call, span: Span) -> Flow {
        if self.frames.len() >= MAX_CALLS {
            self.keep_here(span, "calls are nested too deeply");
            return Flow::Next;
        }
        // Under a condition that is not known, a procedure that calls itself has no end.
        if self.unsure > 0 && self.frames.iter().any(|f| f.routine == id) {
            self.keep_here(span, "procedure that calls itself");
            return Flow::Next;
        }
        let routine = self.symbols.routine(id);
        let callee = self.bytes(id.file);
        let mut bound = Vec::new();
        let before = self.symbols.variables.len();
        let required = routine.params.iter().enumerate().filter(|(_, p)| !p.optional);
        for ((at, _), argument) in required.zip(call.positional()) {
            bound.push((at, self.bind(scope, *argument)));
        }
        for (name, value) in call.optional() {
            let name = &self.bytes(scope.source as usize)[name.range()];
            let is = |p: &super::tree::Param| callee[p.name.range()].eq_ignore_ascii_case(name);
            if let Some(at) = routine.params.iter().position(is) {
                let value = if value.is_empty() { Bound::Value(Value::Bool(true)) } else { self.bind(scope, *value) };
                bound.push((at, value));
            }
        }
        let flow = self.call(id, &bound);
        self.symbols.variables.truncate(before);
        flow
    }

    /// Whether each motion of a plain program is to an inline target.
    fn inline(&self) -> bool {
        let inline = |site: &Site| matches!(site, Site::Literal { argument: None, .. } | Site::None);
        self.sites.iter().all(inline) && self.targets.iter().all(|target| target.name.is_none())
    }

    /// Whether each statement was a motion to a literal target or one that leaves nothing behind.
    fn plain(&self, files: &[File]) -> bool {
        // Entering and leaving the one procedure; assignments and unknown calls count on.
        const EPOCH: u64 = 3;
        let Some((file, context)) = files.split_first().filter(|_| self.written == 1) else { return false };
        let only_data = |file: &File| file.odd.is_empty() && file.modules.iter().all(|m| m.routines.is_empty());
        let [module] = &file.modules[..] else { return false };
        let [proc] = &module.routines[..] else { return false };
        let literal = |site: &Site| matches!(site, Site::Literal { .. } | Site::None);
        let known = |target: &Target| match target.goal {
            Goal::Joints { .. } => true,
            _ => target.editable == Editable::Pose,
        };
        proc.kind == RoutineKind::Proc
            && context.iter().all(only_data)
            && proc.params.is_empty()
            && proc.handlers.is_empty()
            && proc.body.iter().all(|s| matches!(s, Statement::Simple(_) | Statement::Mark(_)))
            && file.odd.is_empty()
            && self.steps == proc.body.len()
            && (self.epoch, self.changes) == (EPOCH, 0)
            && !self.state.program_displacement
            && !self.state.axis_offset
            && self.external.is_none()
            && self.pinned.is_empty()
            && self.unknown.is_empty()
            && self.arcs == 0
            && self.sites.iter().all(literal)
            && self.targets.iter().all(known)
    }

    pub(super) fn finish(mut self, files: &[File]) -> Outcome {
        let plain = self.plain(files);
        let straight = plain && self.inline();
        if self.external_moves {
            for (target, _) in self.targets.iter_mut().zip(&self.on_axes).filter(|(_, on)| **on) {
                if !matches!(target.editable, Editable::No(_)) {
                    target.editable = Editable::No("external axes move the robot or the part");
                }
            }
        }
        // Nor does an offset change where it is run again and cannot be edited then.
        let offset = |site: &Site| match *site {
            Site::Offset(at) => self.offsets[at as usize].steps.last()?.tokens.map(|tokens| tokens[0]),
            _ => None,
        };
        let of_kept =
            |(target, site): (&Target, &Site)| offset(site).filter(|_| matches!(target.editable, Editable::No(_)));
        let held: HashSet<Place> = self.targets.iter().zip(&self.sites).filter_map(of_kept).collect();
        for i in 0..self.targets.len() {
            let shared = offset(&self.sites[i]).is_some_and(|place| held.contains(&place));
            if shared && self.targets[i].editable == Editable::Position {
                self.targets[i].editable = Editable::No("its offset is also used where it cannot be edited");
            }
        }
        // What cannot be edited must not move with its base.
        for i in 0..self.targets.len() {
            if matches!(self.targets[i].editable, Editable::No(_)) {
                let root = self.root(&self.sites[i]);
                self.pin(root);
            }
        }
        for i in 0..self.targets.len() {
            let pinned = self.root(&self.sites[i]).is_some_and(|r| self.pinned.contains(&r));
            let target = &mut self.targets[i];
            if pinned && target.editable == Editable::Pose {
                target.editable = Editable::No("its declaration is also used where it cannot be edited");
            }
        }
        for i in 0..self.targets.len() {
            let target = &self.targets[i];
            if let (Editable::No(reason), true) = (target.editable, target.motion != Motion::AbsoluteJoint) {
                let (source, span) = (target.source as usize, target.span);
                self.keep(source, span, reason);
            }
        }
        self.kept.sort_by_key(|k| (k.source, k.span.start));
        let layout = Layout {
            literals: self.literals,
            sites: self.sites,
            offsets: self.offsets,
            motions: self.motions as usize,
            unknown: self.unknown,
            straight,
            plain,
            mark_behind: self.state.mark,
        };
        Outcome {
            tools: self.tools,
            wobjs: self.wobjs,
            targets: self.targets,
            kept: self.kept,
            arcs: self.arcs,
            diagnostics: self.diagnostics,
            layout,
        }
    }
}
/// A place in what is found.
#[derive(Clone, Copy)]
pub(super) struct Marker {
    pub(super) targets: usize,
    pub(super) offsets: usize,
    pub(super) motions: u32,
    pub(super) arcs: usize,
}

/// What a parameter stands for.
#[derive(Clone, Debug)]
pub(super) enum Bound {
    Variable(usize),
    Value(Value),
}

/// `value` with the item at `path` replaced.
pub(super) fn replaced(value: &Value, path: &[usize], new: &Value) -> Option<Value> {
    let Some((first, rest)) = path.split_first() else { return Some(new.clone()) };
    let list = match value {
        Value::Target(pose) => super::value::parts(pose),
        other => other.clone(),
    };
    let mut items = list.list()?.to_vec();
    let item = items.get_mut(*first)?;
    *item = replaced(item, rest, new)?;
    Some(Value::List(items.into(), None))
}

/// The name in `%"name"%` or `%"module:name"%`.
pub(super) fn late_name(statement: &[u8]) -> Option<&[u8]> {
    let inner = statement.strip_prefix(b"%")?;
    let from = inner.iter().position(|b| *b == b'"')? + 1;
    let to = from + inner[from..].iter().position(|b| *b == b'"')?;
    inner[from..to].rsplit(|b| *b == b':').next()
}
