//! The program as it runs: calls, loops and branches followed as far as they are known when reading.

use super::eval::{RUN_TIME, Scope};
use super::lex::{Cursor, Kind};
use super::literal::{Literal, UNUSED_AXIS};
use super::motion::{self, Call, Shape, Simple, ToolAt, Zone};
use super::symbols::{self, Content, Names, RoutineId, Symbols, Upper, Variable, declared, first_word};
use super::syntax::{File, RoutineKind, Statement, Storage};
use super::value::{Place, Pose, Value, axes_in_use, predefined, unit};
use super::{Layout, Site};
use crate::program::{Editable, Goal, Kept, Mark, Motion, Role, Target, Tool, ToolData, Wobj};
use crate::text::{Diagnostic, LineIndex, Severity, Source, Span};
use std::collections::{HashMap, HashSet};
use std::rc::Rc;
use std::sync::Arc;

/// Calls deeper than this are not followed: a procedure that calls itself has no end when reading.
const MAX_CALLS: usize = 48;
/// Statements run in all: ends loops whose condition never changes.
const MAX_STEPS: usize = 30_000_000;
/// A WHILE that goes round more often is taken for one whose end is known only at run time.
const MAX_ROUNDS: usize = 100_000;
/// Targets in all, loops expanded.
const MAX_TARGETS: usize = 10_000_000;
/// Largest deviation of |q|² from 1 that can be a matter of printing (LANGUAGES: repairable up to 0.1).
const MAX_NORM_ERROR: f64 = 0.1;

const CONTEXT: &str = "declared in a context module";

/// Whether the statements behind are still run.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Flow {
    Next,
    Return,
    Stop,
}

/// A routine that is being run.
struct Frame {
    routine: RoutineId,
    module: usize,
    names: Names,
}

/// What the instructions before leave in force.
#[derive(Clone, Copy, Debug, Default)]
struct State {
    mark: Option<Mark>,
    program_displacement: bool,
    axis_offset: bool,
}

/// The last tool or work object argument and what it meant, while no name can have changed.
#[derive(Clone, Copy, Default)]
struct Cached {
    place: Option<Place>,
    epoch: u64,
    index: u16,
}

pub(super) struct Runner<'a> {
    pub(super) symbols: Symbols<'a>,
    written: usize,
    frames: Vec<Frame>,
    state: State,
    /// Inside a branch or loop whose condition is not known.
    unsure: usize,
    steps: usize,
    epoch: u64,
    /// Assignments so far: a loop without any never ends by itself.
    changes: u64,
    tool: Cached,
    wobj: Cached,
    literals: Vec<Literal>,
    /// Literals of each source within `literals`.
    first_literal: Vec<usize>,
    next_literal: usize,
    own: HashMap<Place, u32>,
    pinned: HashSet<u32>,
    names: HashMap<u32, Arc<str>>,
    tools: Vec<Tool>,
    wobjs: Vec<Wobj>,
    targets: Vec<Target>,
    sites: Vec<Site>,
    offsets: Vec<super::Offset>,
    external: Option<[f64; 6]>,
    external_moves: bool,
    on_axes: Vec<bool>,
    kept: Vec<Kept>,
    seen: HashSet<(usize, Span, &'static str)>,
    pub(super) diagnostics: Vec<Diagnostic>,
    lines: Vec<LineIndex>,
    motions: u32,
    arcs: usize,
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
        let mut runner = Self {
            symbols: Symbols::new(sources, files),
            written,
            frames: Vec::new(),
            state: State::default(),
            unsure: 0,
            steps: 0,
            epoch: 1,
            changes: 0,
            tool: Cached::default(),
            wobj: Cached::default(),
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
            lines: sources.iter().map(|s| LineIndex::new(s)).collect(),
            motions: 0,
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

    /// Runs `main`, or every procedure that no other calls.
    pub(super) fn run(mut self) -> Outcome {
        for id in self.entries() {
            if self.call(id, &[]) == Flow::Stop && self.steps >= MAX_STEPS {
                break;
            }
        }
        self.finish()
    }

    fn entries(&self) -> Vec<RoutineId> {
        let written = |id: &RoutineId| id.file < self.written;
        let procs: Vec<RoutineId> = self
            .symbols
            .all()
            .filter(|id| written(id) && self.symbols.routine(*id).kind == RoutineKind::Proc)
            .collect();
        let name = |id: &RoutineId| &self.symbols.sources[id.file].bytes[self.symbols.routine(*id).name.range()];
        if let Some(main) = procs.iter().find(|id| name(id).eq_ignore_ascii_case(b"main")) {
            return vec![*main];
        }
        let mut called = HashSet::new();
        for &id in &procs {
            let mut calls = Vec::new();
            self.calls(id, &self.symbols.routine(id).body, &mut calls);
            called.extend(calls.into_iter().filter(|c| *c != id));
        }
        let entries: Vec<RoutineId> = procs.iter().filter(|id| !called.contains(*id)).copied().collect();
        // Where each calls another in a ring: the first.
        if entries.is_empty() { procs.into_iter().take(1).collect() } else { entries }
    }

    /// Routines that a block calls by name.
    fn calls(&self, id: RoutineId, block: &[Statement], out: &mut Vec<RoutineId>) {
        for statement in block {
            match statement {
                Statement::Simple(span) => {
                    let bytes = &self.symbols.sources[id.file].bytes;
                    let word = first_word(bytes, *span);
                    let module = self.symbols.module_of(id);
                    if !word.is_empty() {
                        out.extend(self.symbols.find_routine(module, &bytes[word.range()]));
                    } else if let Some(name) = late_name(&bytes[span.range()]) {
                        out.extend(self.symbols.find_routine(module, name));
                    }
                }
                Statement::If { arms, otherwise, .. } => {
                    arms.iter().for_each(|(_, b)| self.calls(id, b, out));
                    self.calls(id, otherwise, out);
                }
                Statement::For { body, .. } | Statement::While { body, .. } => self.calls(id, body, out),
                Statement::Test { cases, otherwise, .. } => {
                    cases.iter().for_each(|(_, b)| self.calls(id, b, out));
                    self.calls(id, otherwise, out);
                }
                Statement::Return | Statement::Exit | Statement::Goto(_) | Statement::Mark(_) => {}
            }
        }
    }

    fn scope(&self) -> Scope {
        match self.frames.last() {
            #[allow(clippy::cast_possible_truncation)]
            Some(frame) => Scope { source: frame.routine.file as u16, module: frame.module, local: true },
            None => Scope { source: 0, module: 0, local: false },
        }
    }

    fn bytes(&self, source: usize) -> &'a [u8] {
        let sources = self.symbols.sources;
        &sources[source].bytes
    }

    /// The variable that a name means.
    pub(super) fn find(&self, scope: Scope, key: &[u8]) -> Option<usize> {
        let local = self.frames.last().filter(|_| scope.local).and_then(|f| f.names.get(key)).copied();
        local.or_else(|| self.symbols.find_data(scope.module, key))
    }

    /// Whether a variable belongs to the running routine.
    pub(super) fn local_data(&self, at: usize) -> bool {
        self.frames.last().is_some_and(|f| f.names.values().any(|v| *v == at))
    }

    fn call(&mut self, id: RoutineId, arguments: &[(usize, Bound)]) -> Flow {
        if self.frames.len() >= MAX_CALLS {
            return Flow::Next;
        }
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
                        None => Value::Unknown("argument is not known"),
                    };
                    self.new_variable(bytes, id.file, module, param.kind, param.name, value)
                }
            };
            names.insert(Box::from(&*Upper::new(&bytes[param.name.range()])), at);
        }
        let assigned = if routine.data.is_empty() {
            Vec::new()
        } else {
            let mut out = Vec::new();
            self.symbols.assigned_names(id, &routine.body, &mut out);
            self.symbols.assigned_names(id, &routine.handlers, &mut out);
            out
        };
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

    fn new_variable(
        &mut self,
        bytes: &[u8],
        file: usize,
        module: usize,
        kind: Span,
        name: Span,
        value: Value,
    ) -> usize {
        self.symbols.variables.push(Variable {
            name: String::from_utf8_lossy(&bytes[name.range()]).as_ref().into(),
            kind: Arc::from(&*Upper::new(&bytes[kind.range()])),
            storage: Storage::Var,
            #[allow(clippy::cast_possible_truncation)]
            source: file as u16,
            module,
            content: Content::Is(value),
            assigned: false,
            volatile: false,
            declared: None,
        });
        self.symbols.variables.len() - 1
    }

    fn assigned_in(&self, id: RoutineId, name: Span) -> bool {
        let key = Upper::new(&self.bytes(id.file)[name.range()]);
        let mut out = Vec::new();
        self.symbols.assigned_names(id, &self.symbols.routine(id).body, &mut out);
        out.iter().any(|n| **n == *key)
    }

    fn block(&mut self, block: &'a [Statement]) -> Flow {
        for statement in block {
            self.steps += 1;
            if self.steps > MAX_STEPS || self.targets.len() > MAX_TARGETS {
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

    fn give_up(&mut self) -> Flow {
        if self.steps <= MAX_STEPS + 1 || self.targets.len() == MAX_TARGETS + 1 {
            self.steps = MAX_STEPS + 2;
            let error = format!("the program runs through more than {MAX_TARGETS} targets or {MAX_STEPS} statements");
            self.diagnostics
                .push(Diagnostic::error("rapid.endless", "", error).help("split the program, or bound its loops"));
        }
        Flow::Stop
    }

    fn note(&mut self, span: Span, code: &'static str, message: &str) {
        let source = self.scope().source as usize;
        if self.seen.insert((source, span, code)) {
            let note = Diagnostic::error(code, "", message).at(&self.symbols.sources[source], span);
            self.diagnostics.push(note.severity(Severity::Note));
        }
    }

    /// Keeps a statement of the running routine.
    fn keep_here(&mut self, span: Span, reason: &'static str) {
        self.keep(self.scope().source as usize, span, reason);
    }

    fn keep(&mut self, source: usize, span: Span, reason: &'static str) {
        if source < self.written && self.seen.insert((source, span, reason)) {
            let line = self.lines[source].line(span.start);
            self.kept.push(Kept { source, span, line: line as usize, reason });
        }
    }

    fn condition(&mut self, arms: &'a [(Span, Vec<Statement>)], otherwise: &'a [Statement], at: Span) -> Flow {
        for (i, (condition, body)) in arms.iter().enumerate() {
            match self.evaluate(self.scope(), *condition).bool() {
                Some(true) => return self.block(body),
                Some(false) => {}
                None => {
                    self.note(
                        at,
                        "rapid.condition",
                        "condition is known only at run time: every branch is taken, in the order of the text",
                    );
                    let rest = arms[i..].iter().map(|(_, b)| &b[..]).chain([otherwise]);
                    return self.branches(rest);
                }
            }
        }
        self.block(otherwise)
    }

    /// Every branch in turn, since any may be the one that runs.
    fn branches(&mut self, branches: impl Iterator<Item = &'a [Statement]>) -> Flow {
        self.unsure += 1;
        let before = self.state;
        let mut after = before;
        for branch in branches {
            self.state = State { mark: after.mark, ..before };
            self.block(branch);
            after.mark = self.state.mark;
            after.program_displacement |= self.state.program_displacement;
            after.axis_offset |= self.state.axis_offset;
        }
        self.state = after;
        self.unsure -= 1;
        Flow::Next
    }

    fn counted(
        &mut self,
        [from, to]: [Span; 2],
        step: Option<Span>,
        variable: Span,
        body: &'a [Statement],
        at: Span,
    ) -> Flow {
        let scope = self.scope();
        let (from, to) = (self.evaluate(scope, from).num(), self.evaluate(scope, to).num());
        let step = step.map(|s| self.evaluate(scope, s).num());
        let key: Box<[u8]> = Box::from(&*Upper::new(&self.bytes(scope.source as usize)[variable.range()]));
        let bytes = self.bytes(scope.source as usize);
        let counter =
            self.new_variable(bytes, scope.source as usize, scope.module, variable, variable, Value::Unknown(RUN_TIME));
        let hidden = self.frames.last_mut().and_then(|f| f.names.insert(key.clone(), counter));
        let flow = match (from, to, step) {
            #[allow(clippy::cast_precision_loss)]
            (Some(from), Some(to), None | Some(Some(_)))
                if ((to - from) / step.flatten().unwrap_or(1.0)).abs() <= MAX_TARGETS as f64 =>
            {
                let step = step.flatten().unwrap_or(if to >= from { 1.0 } else { -1.0 });
                self.count(counter, from, to, step, body)
            }
            _ => {
                self.note(at, "rapid.loop", "loop bounds are known only at run time: the loop is taken once");
                self.forget_assigned(body);
                self.unsure += 1;
                self.block(body);
                self.unsure -= 1;
                Flow::Next
            }
        };
        self.symbols.variables.truncate(counter);
        if let Some(frame) = self.frames.last_mut() {
            match hidden {
                Some(at) => frame.names.insert(key, at),
                None => frame.names.remove(&key),
            };
        }
        flow
    }

    fn count(&mut self, counter: usize, from: f64, to: f64, step: f64, body: &'a [Statement]) -> Flow {
        if step == 0.0 {
            return Flow::Next;
        }
        let mut value = from;
        while if step > 0.0 { value <= to } else { value >= to } {
            self.symbols.variables[counter].content = Content::Is(Value::Num(value, None));
            self.steps += 1;
            if self.steps > MAX_STEPS {
                return self.give_up();
            }
            let flow = self.block(body);
            if flow != Flow::Next {
                return flow;
            }
            value += step;
        }
        Flow::Next
    }

    fn repeat(&mut self, condition: Span, body: &'a [Statement], at: Span) -> Flow {
        let scope = self.scope();
        let before = self.marker();
        // A condition that nothing in the loop changes never ends it.
        let endless = self.evaluate(scope, condition).bool() == Some(true) && !self.depends(scope, condition, body);
        let mut rounds = 0;
        while !endless && rounds < MAX_ROUNDS {
            match self.evaluate(scope, condition).bool() {
                Some(false) => return Flow::Next,
                None => break,
                Some(true) => {
                    let changes = self.changes;
                    let flow = self.block(body);
                    if flow != Flow::Next {
                        return flow;
                    }
                    if self.changes == changes {
                        return Flow::Next;
                    }
                }
            }
            rounds += 1;
        }
        if rounds == MAX_ROUNDS {
            self.back_to(before);
        }
        self.note(at, "rapid.loop", "how often this loop runs is known only at run time: it is taken once");
        self.forget_assigned(body);
        if endless {
            // What stands behind is reached only by leaving the routine.
            return self.block(body);
        }
        self.branches(std::iter::once(body))
    }

    /// Whether a block may change a name in an expression, or the expression calls a function.
    fn depends(&self, scope: Scope, expression: Span, body: &'a [Statement]) -> bool {
        let Some(frame) = self.frames.last() else { return true };
        let mut assigned = Vec::new();
        let mut visited = HashSet::new();
        let mut todo = vec![(frame.routine, body)];
        while let Some((id, block)) = todo.pop() {
            self.symbols.assigned_names(id, block, &mut assigned);
            let mut calls = Vec::new();
            self.calls(id, block, &mut calls);
            for callee in calls {
                if visited.insert(callee) {
                    todo.push((callee, &self.symbols.routine(callee).body));
                }
            }
        }
        let mut cursor = Cursor::new(self.bytes(scope.source as usize), expression);
        loop {
            let lexeme = cursor.next();
            match lexeme.kind {
                Kind::End => return false,
                Kind::Mark(b'(') => return true,
                Kind::Word => {
                    let name = Upper::new(cursor.text(lexeme));
                    let volatile = self.find(scope, &name).is_some_and(|at| self.symbols.variables[at].volatile);
                    if volatile || assigned.iter().any(|n| **n == *name) {
                        return true;
                    }
                }
                _ => {}
            }
        }
    }

    /// How much was found so far.
    fn marker(&self) -> Marker {
        Marker { targets: self.targets.len(), offsets: self.offsets.len(), motions: self.motions, arcs: self.arcs }
    }

    /// Forgets what was found since.
    fn back_to(&mut self, marker: Marker) {
        self.targets.truncate(marker.targets);
        self.sites.truncate(marker.targets);
        self.on_axes.truncate(marker.targets);
        self.offsets.truncate(marker.offsets);
        (self.motions, self.arcs) = (marker.motions, marker.arcs);
    }

    fn choice(
        &mut self,
        subject: Span,
        cases: &'a [(Span, Vec<Statement>)],
        otherwise: &'a [Statement],
        at: Span,
    ) -> Flow {
        let scope = self.scope();
        let subject = self.evaluate(scope, subject);
        for (i, (values, body)) in cases.iter().enumerate() {
            match self.matches(scope, &subject, *values) {
                Some(true) => return self.block(body),
                Some(false) => {}
                None => {
                    self.note(
                        at,
                        "rapid.condition",
                        "value is known only at run time: every case is taken, in the order of the text",
                    );
                    return self.branches(cases[i..].iter().map(|(_, b)| &b[..]).chain([otherwise]));
                }
            }
        }
        self.block(otherwise)
    }

    /// Whether `subject` is among the values of a CASE.
    fn matches(&mut self, scope: Scope, subject: &Value, values: Span) -> Option<bool> {
        let bytes = self.bytes(scope.source as usize);
        let mut cursor = Cursor::new(bytes, values);
        let mut call = Call::empty(values);
        motion::arguments(&mut cursor, scope.source, &mut call)?;
        let mut sure = true;
        for span in call.positional() {
            #[allow(clippy::float_cmp)] // RAPID's own comparison
            let same = match (subject, self.evaluate(scope, *span)) {
                (Value::Num(a, _), Value::Num(b, _)) => *a == b,
                (Value::Bool(a), Value::Bool(b)) => *a == b,
                (Value::Text(a), Value::Text(b)) => *a == b,
                _ => {
                    sure = false;
                    continue;
                }
            };
            if same {
                return Some(true);
            }
        }
        sure.then_some(false)
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
    fn enter(&mut self, scope: Scope, id: RoutineId, call: &Call, span: Span) -> Flow {
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
            let is = |p: &super::syntax::Param| callee[p.name.range()].eq_ignore_ascii_case(name);
            if let Some(at) = routine.params.iter().position(is) {
                let value = if value.is_empty() { Bound::Value(Value::Bool(true)) } else { self.bind(scope, *value) };
                bound.push((at, value));
            }
        }
        let flow = self.call(id, &bound);
        self.symbols.variables.truncate(before);
        flow
    }

    fn bind(&mut self, scope: Scope, argument: Span) -> Bound {
        let bytes = self.bytes(scope.source as usize);
        let word = first_word(bytes, argument);
        if word == argument
            && let Some(at) = self.find(scope, &Upper::new(&bytes[word.range()]))
        {
            return Bound::Variable(at);
        }
        let value = match self.evaluate(scope, argument) {
            Value::Num(v, _) => Value::Num(v, None),
            other => other,
        };
        if word == argument {
            // A name that the files do not declare, or a predefined one: it goes along with its value.
            let none = Span { start: word.start, end: word.start };
            return Bound::Variable(self.new_variable(bytes, scope.source as usize, scope.module, none, word, value));
        }
        Bound::Value(value)
    }

    fn assign(&mut self, scope: Scope, target: Span, value: Span) {
        let bytes = self.bytes(scope.source as usize);
        let value = self.evaluate(scope, value);
        self.pin_value(&value);
        (self.epoch, self.changes) = (self.epoch + 1, self.changes + 1);
        let word = first_word(bytes, target);
        let Some(at) = self.find(scope, &Upper::new(&bytes[word.range()])) else { return };
        let whole = word == target;
        let new = if self.unsure > 0 || !whole && !self.store(scope, at, target, &value) {
            Value::Unknown(RUN_TIME)
        } else if whole {
            value.detached(RUN_TIME)
        } else {
            return;
        };
        self.symbols.variables[at].content = Content::Is(new);
    }

    /// Stores into a component or element; false where that place is not known.
    fn store(&mut self, scope: Scope, at: usize, target: Span, value: &Value) -> bool {
        let bytes = self.bytes(scope.source as usize);
        let mut cursor = Cursor::new(bytes, target);
        cursor.next();
        let mut path = Vec::new();
        let mut kind = Arc::clone(&self.symbols.variables[at].kind);
        loop {
            let lexeme = cursor.next();
            match lexeme.kind {
                Kind::End => break,
                Kind::Mark(b'.') => {
                    let field = cursor.next();
                    let Some((index, next)) = self.field(&kind, &Upper::new(cursor.text(field))) else { return false };
                    path.push(index);
                    kind = next;
                }
                Kind::Mark(b'{') => {
                    let mut call = Call::empty(target);
                    let from = cursor.peek().start;
                    let mut end = from;
                    while !matches!(cursor.peek().kind, Kind::Mark(b'}') | Kind::End) {
                        end = cursor.next().end;
                    }
                    cursor.accept(Kind::Mark(b'}'));
                    let mut inner = Cursor::new(bytes, Span::new(from, end));
                    if motion::arguments(&mut inner, scope.source, &mut call).is_none() {
                        return false;
                    }
                    for index in call.positional() {
                        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
                        match self.evaluate(scope, *index).num() {
                            Some(i) if i >= 1.0 => path.push(i.round() as usize - 1),
                            _ => return false,
                        }
                    }
                }
                _ => return false,
            }
        }
        let old = self.content(at).detached(RUN_TIME);
        match replaced(&old, &path, &value.detached(RUN_TIME)) {
            Some(new) => {
                self.symbols.variables[at].content = Content::Is(new);
                true
            }
            None => false,
        }
    }

    /// Data that a block changes are not known while and after it runs an unknown number of times.
    fn forget_assigned(&mut self, body: &[Statement]) {
        let Some(frame) = self.frames.last() else { return };
        let mut names = Vec::new();
        let mut todo = vec![(frame.routine, body)];
        let mut visited = HashSet::new();
        let mut first = true;
        while let Some((id, block)) = todo.pop() {
            let mut out = Vec::new();
            self.symbols.assigned_names(id, block, &mut out);
            let local = std::mem::take(&mut first);
            names.extend(out.into_iter().map(|n| (local, self.symbols.module_of(id), n)));
            let mut calls = Vec::new();
            self.calls(id, block, &mut calls);
            for callee in calls {
                if visited.insert(callee) {
                    todo.push((callee, &self.symbols.routine(callee).body));
                }
            }
        }
        (self.epoch, self.changes) = (self.epoch + 1, self.changes + 1);
        for (local, module, name) in names {
            if let Some(at) = self.find(Scope { source: 0, module, local }, &name) {
                self.symbols.variables[at].content = Content::Is(Value::Unknown(RUN_TIME));
            }
        }
    }

    /// The same for a function of the program, which is not followed.
    pub(super) fn forget_what_calls_change(&mut self, scope: Scope, name: &[u8]) {
        let Some(id) = self.symbols.find_routine(scope.module, name) else { return };
        let mut names = Vec::new();
        self.symbols.assigned_names(id, &self.symbols.routine(id).body, &mut names);
        for name in names {
            if let Some(at) = self.symbols.find_data(self.symbols.module_of(id), &name) {
                self.symbols.variables[at].content = Content::Is(Value::Unknown(RUN_TIME));
                self.epoch += 1;
            }
        }
    }

    /// An instruction that is neither a known motion nor in the files.
    fn instruction(&mut self, scope: Scope, call: &Call, span: Span) {
        let bytes = self.bytes(scope.source as usize);
        let name = Upper::new(&bytes[call.name.range()]);
        match &*name {
            b"PDISPON" | b"PDISPSET" => self.state.program_displacement = true,
            b"PDISPOFF" => self.state.program_displacement &= self.unsure > 0,
            b"EOFFSON" | b"EOFFSSET" => self.state.axis_offset = true,
            b"EOFFSOFF" => self.state.axis_offset &= self.unsure > 0,
            b"MOVEEXTJ" => self.keep_here(span, "moves external axes only"),
            b"INCR" | b"DECR" | b"ADD" | b"CLEAR" => return self.step_variable(scope, call, &name),
            _ => {}
        }
        if symbols::harmless(&bytes[call.name.range()]) {
            return;
        }
        // A motion instruction of the user's own is known by the types of its arguments.
        let mut targets = Vec::new();
        let mut tool = None;
        for (i, argument) in call.positional().iter().enumerate() {
            match self.kind_of(scope, *argument) {
                Some(kind) if *kind == *b"ROBTARGET" => targets.push(i),
                Some(kind) if *kind == *b"TOOLDATA" => tool = Some(i),
                _ => {}
            }
        }
        match (targets.last(), tool) {
            (Some(&to), Some(tool)) if tool > to => {
                let last = name.last();
                let motion = match (last, targets.len()) {
                    (Some(b'C'), 2) => Motion::Circular,
                    (Some(b'J'), _) => Motion::Joint,
                    _ => Motion::Linear,
                };
                let via = (motion == Motion::Circular).then(|| targets[0]);
                let shape = Shape { motion, via, to, tool: ToolAt::Index(tool), zone: Zone::Absent };
                self.motion(scope, call, shape, span);
            }
            (Some(_), _) => {
                for at in targets {
                    let value = self.evaluate(scope, call.positional()[at]);
                    self.pin_value(&value);
                }
                self.keep_here(span, "robtarget given to a procedure that is not known");
            }
            _ => {}
        }
        // What it is given it may change.
        for argument in call.positional() {
            let word = first_word(bytes, *argument);
            if word.is_empty() {
                continue;
            }
            if let Some(at) = self.find(scope, &Upper::new(&bytes[word.range()])) {
                let variable = &self.symbols.variables[at];
                if variable.assigned && variable.storage != Storage::Const {
                    self.symbols.variables[at].content = Content::Is(Value::Unknown(RUN_TIME));
                    self.epoch += 1;
                }
            }
        }
    }

    /// `Incr`, `Decr`, `Add`, `Clear`.
    fn step_variable(&mut self, scope: Scope, call: &Call, name: &[u8]) {
        let bytes = self.bytes(scope.source as usize);
        let Some(&first) = call.positional().first() else { return };
        let word = first_word(bytes, first);
        let Some(at) = self.find(scope, &Upper::new(&bytes[word.range()])) else { return };
        (self.epoch, self.changes) = (self.epoch + 1, self.changes + 1);
        let by = match name {
            b"INCR" => Some(1.0),
            b"DECR" => Some(-1.0),
            b"ADD" => call.positional().get(1).and_then(|a| self.evaluate(scope, *a).num()),
            _ => None,
        };
        let old = if name == b"CLEAR" { Some(0.0) } else { self.content(at).num() };
        let new = match (old, by) {
            _ if self.unsure > 0 || word != first => None,
            (Some(old), Some(by)) => Some(old + by),
            (Some(_), None) if name == b"CLEAR" => Some(0.0),
            _ => None,
        };
        let value = new.map_or(Value::Unknown(RUN_TIME), |v| Value::Num(v, None));
        self.symbols.variables[at].content = Content::Is(value);
    }

    /// Declared type of an argument, in upper case, as far as its text shows it.
    fn kind_of(&mut self, scope: Scope, argument: Span) -> Option<Arc<[u8]>> {
        let bytes = self.bytes(scope.source as usize);
        let robtarget = || Some(Arc::from(&b"ROBTARGET"[..]));
        if bytes.get(argument.start as usize) == Some(&b'[') {
            let value = self.evaluate(scope, argument);
            return if self.as_target(&value).is_some() { robtarget() } else { None };
        }
        let word = first_word(bytes, argument);
        let name = Upper::new(&bytes[word.range()]);
        match &*name {
            b"OFFS" | b"RELTOOL" => return robtarget(),
            b"TOOL0" => return Some(Arc::from(&b"TOOLDATA"[..])),
            _ => {}
        }
        let at = self.find(scope, &name)?;
        let component = bytes[word.end as usize..argument.end as usize].contains(&b'.');
        (!component).then(|| Arc::clone(&self.symbols.variables[at].kind))
    }

    /// One executed motion.
    fn motion(&mut self, scope: Scope, call: &Call, shape: Shape, span: Span) {
        let arguments = call.positional();
        let Some(&to) = arguments.get(shape.to) else {
            return self.keep_here(span, "motion without a target");
        };
        let tool_at = match shape.tool {
            ToolAt::Index(at) => Some(at),
            ToolAt::Last => arguments.len().checked_sub(1),
        };
        let Some(&tool) = tool_at
            .filter(|at| *at > shape.to + 1 || *at > shape.to && shape.zone == Zone::Absent)
            .and_then(|at| arguments.get(at))
        else {
            return self.keep_here(span, "motion without a tool");
        };
        self.motions += 1;
        let bytes = self.bytes(scope.source as usize);
        let tool = self.tool_index(scope, tool);
        let wobj = self.wobj_index(scope, call.option(bytes, b"WObj"));
        let feed_mm_s = self.speed(scope, call, arguments.get(shape.to + 1).copied());
        let line = self.lines[scope.source as usize].line(span.start);
        let target = Target {
            ordinal: self.motions,
            role: Role::End,
            motion: shape.motion,
            goal: Goal::Joints { deg: [0.0; 6] },
            tool,
            wobj,
            feed_mm_s,
            spindle_rpm: None,
            rapid: false,
            mark: self.state.mark,
            editable: Editable::No("joint target"),
            name: None,
            source: scope.source,
            span,
            line,
        };
        if shape.motion == Motion::AbsoluteJoint {
            match self.evaluate(scope, to).joints() {
                Some(deg) => self.push(Target { goal: Goal::Joints { deg }, ..target }, Site::None, false),
                None => self.keep_here(span, "joint target computed at run time"),
            }
            return;
        }
        let via = shape.via.and_then(|at| Some((at, *arguments.get(at)?)));
        if shape.motion == Motion::Circular {
            self.arcs += 1;
        }
        if let Some((at, via)) = via {
            let target = Target { role: Role::Via, ..target.clone() };
            self.point(scope, call, at, via, target);
        }
        self.point(scope, call, shape.to, to, target);
    }

    /// One robtarget of a motion.
    fn point(&mut self, scope: Scope, call: &Call, at: usize, argument: Span, mut target: Target) {
        let pose = match call.literal(at) {
            Some((_, literal, written)) => {
                let (literal, written) = (*literal, *written);
                Rc::new(self.literal_pose(&literal, written))
            }
            None => {
                let value = self.evaluate(scope, argument);
                match self.as_target(&value) {
                    Some(pose) => pose,
                    None => {
                        let reason = match value {
                            Value::List(..) => value.unknown().unwrap_or("not a complete robtarget"),
                            _ => value.unknown().unwrap_or("not a robtarget"),
                        };
                        return self.keep_here(target.span, reason);
                    }
                }
            }
        };
        let written = &pose.written;
        let norm = written.quat.iter().map(|c| c * c).sum::<f64>();
        if !((norm - 1.0).abs() <= MAX_NORM_ERROR) {
            return self.keep_here(target.span, "orientation is not a unit quaternion");
        }
        target.goal = Goal::Pose { position_mm: written.position_mm, quat: unit(written.quat), conf: written.conf };
        let bytes = self.bytes(scope.source as usize);
        let named = !matches!(bytes.get(argument.start as usize), None | Some(b'['));
        if named && pose.steps.is_empty() {
            target.name = self.name_of(pose.root, &bytes[argument.range()]);
        }
        (target.editable, target.motion) = (self.editable(&target, &pose), target.motion);
        let site = match pose.root {
            None => Site::None,
            Some(root) if pose.steps.is_empty() => {
                let argument = Place { source: scope.source, span: argument };
                Site::Literal { literal: root, argument: named.then_some(argument) }
            }
            Some(root) => {
                self.offsets.push(super::Offset { root, steps: pose.steps.clone().into() });
                #[allow(clippy::cast_possible_truncation)]
                Site::Offset((self.offsets.len() - 1) as u32)
            }
        };
        let in_use = axes_in_use(&written.external);
        let external = written.external.map(|v| if v < UNUSED_AXIS { v } else { UNUSED_AXIS });
        #[allow(clippy::float_cmp)] // as written: any difference is a motion of the axis
        if in_use {
            self.external_moves |= *self.external.get_or_insert(external) != external;
        }
        self.push(target, site, in_use);
    }

    fn push(&mut self, target: Target, site: Site, in_use: bool) {
        self.targets.push(target);
        self.sites.push(site);
        self.on_axes.push(in_use);
    }

    /// The name of a declared target as used: `p10`, `p{3}`.
    fn name_of(&mut self, root: Option<u32>, text: &[u8]) -> Option<Arc<str>> {
        let new = || -> Arc<str> { String::from_utf8_lossy(text).as_ref().into() };
        match root {
            // Through parameters the same literal has several names: the first is its own.
            Some(root) => Some(Arc::clone(self.names.entry(root).or_insert_with(new))),
            None => Some(new()),
        }
    }

    fn editable(&self, target: &Target, pose: &Pose) -> Editable {
        let tool = self.tools[target.tool as usize].data;
        let wobj = self.wobjs[target.wobj as usize].data;
        let stationary = tool.is_some_and(|t: ToolData| !t.robhold) || wobj.is_some_and(|w| w.robhold);
        let reason = if self.state.program_displacement {
            Some("program displacement is active")
        } else if self.state.axis_offset {
            Some("offset of external axes is active")
        } else if stationary {
            Some("stationary tool")
        } else if wobj.is_some_and(|w| !w.fixed) {
            Some("work object moved by a mechanical unit")
        } else if let Some(why) = pose.fixed {
            Some(why)
        } else if let Some(last) = pose.steps.last() {
            match last.tokens {
                None => Some("offset computed from an expression"),
                Some(tokens) if tokens.iter().any(|t| t.source as usize >= self.written) => Some(CONTEXT),
                Some(_) => return Editable::Position,
            }
        } else {
            match pose.root {
                None => Some(RUN_TIME),
                Some(root) if self.literals[root as usize].source as usize >= self.written => Some(CONTEXT),
                Some(_) => return Editable::Pose,
            }
        };
        Editable::No(reason.unwrap_or(RUN_TIME))
    }

    fn tool_index(&mut self, scope: Scope, argument: Span) -> u16 {
        let place = Place { source: scope.source, span: argument };
        if self.fresh(self.tool, place) {
            return self.tool.index;
        }
        let (name, value) = self.named(scope, argument);
        let tool = Tool { name, data: value.tool() };
        let same = |t: &Tool| t.name.eq_ignore_ascii_case(&tool.name) && t.data == tool.data;
        let found = self.tools.iter().position(same);
        let index = found.unwrap_or_else(|| {
            self.tools.push(tool);
            self.tools.len() - 1
        });
        let index = u16::try_from(index).unwrap_or(u16::MAX);
        self.tool = Cached { place: Some(place), epoch: self.epoch, index };
        index
    }

    fn wobj_index(&mut self, scope: Scope, argument: Option<Span>) -> u16 {
        let argument = argument.filter(|a| !a.is_empty());
        // No argument: the same empty place whatever the instruction.
        let place = Place { source: scope.source, span: argument.unwrap_or_default() };
        if self.fresh(self.wobj, place) {
            return self.wobj.index;
        }
        let (name, value) = match argument {
            Some(argument) => self.named(scope, argument),
            None => ("wobj0".into(), predefined(b"WOBJ0").unwrap_or(Value::Unknown(RUN_TIME))),
        };
        let wobj = Wobj { name, data: value.wobj() };
        let same = |w: &Wobj| w.name.eq_ignore_ascii_case(&wobj.name) && w.data == wobj.data;
        let found = self.wobjs.iter().position(same);
        let index = found.unwrap_or_else(|| {
            self.wobjs.push(wobj);
            self.wobjs.len() - 1
        });
        let index = u16::try_from(index).unwrap_or(u16::MAX);
        self.wobj = Cached { place: Some(place), epoch: self.epoch, index };
        index
    }

    /// Whether an argument reads like the last one, and nothing was assigned or called in between.
    fn fresh(&self, cached: Cached, place: Place) -> bool {
        cached.epoch == self.epoch
            && cached.place.is_some_and(|last| {
                let text = |p: Place| &self.bytes(p.source as usize)[p.span.range()];
                last.source == place.source && text(last) == text(place)
            })
    }

    /// Tool or work object: the name that it was declared with, also through parameters, and its value.
    fn named(&mut self, scope: Scope, argument: Span) -> (Arc<str>, Value) {
        let bytes = self.bytes(scope.source as usize);
        let word = first_word(bytes, argument);
        if word == argument
            && let Some(at) = self.find(scope, &Upper::new(&bytes[word.range()]))
        {
            let name = Arc::clone(&self.symbols.variables[at].name);
            return (name, self.content(at));
        }
        (String::from_utf8_lossy(&bytes[argument.range()]).as_ref().into(), self.evaluate(scope, argument))
    }

    /// Programmed TCP speed, mm/s.
    fn speed(&mut self, scope: Scope, call: &Call, argument: Option<Span>) -> Option<f64> {
        let bytes = self.bytes(scope.source as usize);
        if call.option(bytes, b"T").is_some() {
            return None;
        }
        if let Some(own) = call.option(bytes, b"V") {
            return self.evaluate(scope, own).num();
        }
        let value = self.evaluate(scope, argument?);
        value.list()?.first()?.num().filter(|v| *v > 0.0)
    }

    /// Which literal of the text this is; the next one almost always.
    pub(super) fn literal_id(&mut self, literal: &Literal) -> Option<u32> {
        let source = literal.source as usize;
        let at = if self.literals.get(self.next_literal) == Some(literal) {
            self.next_literal
        } else {
            let first = self.first_literal[source];
            let of_source = &self.literals[first..self.first_literal[source + 1]];
            first + of_source.binary_search_by_key(&literal.span().start, |l| l.span().start).ok()?
        };
        self.next_literal = at + 1;
        u32::try_from(at).ok()
    }

    /// A robtarget put together from parts, as a literal of its own.
    pub(super) fn own_literal(&mut self, literal: Literal) -> Option<u32> {
        let place = Place { source: literal.source, span: literal.span() };
        if let Some(id) = self.own.get(&place) {
            return Some(*id);
        }
        let id = u32::try_from(self.literals.len()).ok()?;
        self.literals.push(literal);
        self.own.insert(place, id);
        Some(id)
    }

    /// A literal that other values are made of: moving it would move them too.
    pub(super) fn pin(&mut self, root: Option<u32>) {
        self.pinned.extend(root);
    }

    pub(super) fn pin_value(&mut self, value: &Value) {
        match value {
            Value::Target(pose) => self.pin(pose.root),
            Value::List(items, _) => items.iter().for_each(|v| self.pin_value(v)),
            _ => {}
        }
    }

    fn root(&self, site: &Site) -> Option<u32> {
        match site {
            Site::None => None,
            Site::Literal { literal, .. } => Some(*literal),
            Site::Offset(at) => Some(self.offsets[*at as usize].root),
        }
    }

    fn finish(mut self) -> Outcome {
        if self.external_moves {
            for (target, _) in self.targets.iter_mut().zip(&self.on_axes).filter(|(_, on)| **on) {
                if !matches!(target.editable, Editable::No(_)) {
                    target.editable = Editable::No("external axes move the robot or the part");
                }
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
struct Marker {
    targets: usize,
    offsets: usize,
    motions: u32,
    arcs: usize,
}

/// What a parameter stands for.
#[derive(Clone, Debug)]
enum Bound {
    Variable(usize),
    Value(Value),
}

/// `value` with the item at `path` replaced.
fn replaced(value: &Value, path: &[usize], new: &Value) -> Option<Value> {
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
fn late_name(statement: &[u8]) -> Option<&[u8]> {
    let inner = statement.strip_prefix(b"%")?;
    let from = inner.iter().position(|b| *b == b'"')? + 1;
    let to = from + inner[from..].iter().position(|b| *b == b'"')?;
    inner[from..to].rsplit(|b| *b == b':').next()
}
