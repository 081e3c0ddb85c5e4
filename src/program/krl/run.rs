//! The program as it runs: calls, loops and branches followed as far as they are known when reading.

use super::lex::Cursor;
use super::state::{Changes, Id, ModalState};
use super::symbols::{RoutineId, Symbols};
use super::tree::{File, Routine, Statement, StatementKind};
use super::value::{Name, NumberToken, Value, upper};
use crate::program::{Kept, Mark, Reason, Target, Tool, UnknownMotion, Wobj};
use crate::text::{Diagnostic, LineIndex, Severity, Source, Span, decode};
use std::collections::{BTreeSet, HashMap, HashSet};
use std::rc::Rc;

/// Statements run in all, and for each byte of the program besides: ends loops whose condition never changes.
const STEPS: usize = 500_000;
const STEPS_PER_BYTE: usize = 4;
/// Targets in all, loops expanded, and for each byte of the program besides: a short file must not fill the memory.
const TARGETS: usize = 200_000;
const TARGETS_PER_BYTE: usize = 1;
/// Calls within one another.
pub(super) const MAX_CALLS: usize = 60;
/// Blocks within one another, through calls: more than anybody writes, and what a thread's stack holds.
const MAX_NESTING: usize = 250;

/// Values that are compared and copied in about the time of a statement.
pub(super) const VALUES_PER_STEP: usize = 256;

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
    pub(super) names: HashMap<Name, Id>,
    /// What it leaves where it returns before its end.
    returns: Vec<ModalState>,
    /// What a routine with GOTO changes: it may be any at a label.
    jumps: Option<Rc<Changes>>,
}

impl Frame {
    /// The names of a file alone.
    pub(super) fn of_file(file: usize) -> Self {
        Self { routine: RoutineId { file, at: usize::MAX }, names: HashMap::new(), returns: Vec::new(), jumps: None }
    }
}

/// What a routine leaves in one of its parameters.
pub(super) struct Left {
    pub(super) value: Value,
    /// A TRIGGER may change it still.
    pub(super) is_triggered: bool,
}

/// Where a target's six numbers stand: X Y Z A B C; `None` for one that stands nowhere.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Site {
    pub(crate) tokens: [Option<NumberToken>; 6],
    /// `$APO.CDIS` when the motion runs, mm, where it is known.
    pub(crate) approximation_mm: Option<f64>,
}

#[derive(Default)]
pub(super) struct Runner<'a> {
    pub(super) symbols: Symbols<'a>,
    pub(super) written: usize,
    pub(super) state: ModalState,
    pub(super) frames: Vec<Frame>,
    /// What EXIT leaves of each loop on the way.
    pub(super) loops: Vec<Vec<ModalState>>,
    nested: usize,
    pub(super) steps: usize,
    pub(super) most_steps: usize,
    most_targets: usize,
    pub(super) entered: HashSet<RoutineId>,
    /// Numbers that something else than a motion reads.
    pub(super) pinned: HashSet<NumberToken>,
    /// Data that may change at any moment.
    pub(super) volatile: HashSet<Id>,
    /// Those of them that a TRIGGER on the way may change.
    pub(super) triggered: HashSet<Id>,
    /// Routines that may run at any moment, or again while they run.
    pub(super) beside: HashSet<RoutineId>,
    /// Data that they name.
    pub(super) read_beside: HashSet<Id>,
    /// Whether an interrupt may leave what is called half done.
    pub(super) resumes: bool,
    /// The next statement may fail, and the program goes on after it.
    proceeds: bool,
    /// Motions that leave components to a motion before that is not known.
    pub(super) open_partials: usize,
    /// Whether the program puts positions into data that leave components out.
    pub(super) leaves_components_out: bool,
    /// What routines could change, each found once.
    pub(super) changes: HashMap<RoutineId, Rc<Changes>>,
    pub(super) tools: Vec<Tool>,
    pub(super) wobjs: Vec<Wobj>,
    pub(super) targets: Vec<Target>,
    pub(super) sites: Vec<Site>,
    /// External axes of each target, as far as positions name them.
    pub(super) external: Vec<[Option<f64>; 6]>,
    /// Axes that motions without a target move.
    pub(super) used_axes: [bool; 6],
    pub(super) motions: u32,
    pub(super) arcs: usize,
    /// Motions without a target, by reason.
    pub(super) unknown: Vec<UnknownMotion>,
    pub(super) kept: Vec<Kept>,
    seen: HashSet<(usize, Span, Reason)>,
    pub(super) told: BTreeSet<Name>,
    pub(super) diagnostics: Vec<Diagnostic>,
    pub(super) lines: Vec<LineIndex>,
}

impl<'a> Runner<'a> {
    pub(super) fn new(sources: &'a [Source], files: &'a [File], written: usize) -> Self {
        let bytes: usize = sources.iter().map(|s| s.bytes.len()).sum();
        let mut runner = Self {
            symbols: Symbols::new(sources, files),
            written,
            most_steps: STEPS + STEPS_PER_BYTE * bytes,
            most_targets: TARGETS + TARGETS_PER_BYTE * bytes,
            lines: sources.iter().map(LineIndex::new).collect(),
            ..Self::default()
        };
        for (source, file) in files.iter().enumerate().take(written) {
            for &(span, reason) in &file.odd {
                runner.keep(source, span, reason);
            }
        }
        runner.declare();
        runner
    }

    /// Runs what an operator may select: the first routine of each file that no other calls.
    pub(super) fn run(&mut self) {
        self.expect_interrupts();
        self.find_beside();
        self.leaves_components_out = self.finds_incomplete_positions();
        for root in self.symbols.roots(self.written) {
            self.state = ModalState::default();
            let mark = self.symbols.files[root.file].mark;
            if let Some(mark) = mark {
                self.set_mark(mark);
            }
            self.enter(root, &[], &[]);
        }
        self.keep_what_is_not_run();
        self.settle();
    }

    pub(super) fn bytes(&self, source: usize) -> &'a [u8] {
        &self.symbols.sources[source].bytes
    }

    /// The file whose statements are being run.
    pub(super) fn here(&self) -> usize {
        self.frames.last().map_or(0, |frame| frame.routine.file)
    }

    fn set_mark(&mut self, mark: Mark) {
        let id = self.symbols.mark;
        self.state.values.insert(id, Value::Number(f64::from(u8::from(mark == Mark::Cut)), None));
    }

    /// Runs a routine with values for its parameters, of which some may change under another name.
    pub(super) fn enter(&mut self, id: RoutineId, values: &[Value], aliased: &[bool]) -> Vec<Left> {
        self.entered.insert(id);
        self.steps += (self.state.values.len() + self.volatile.len()) / VALUES_PER_STEP;
        let routine = self.symbols.routine(id);
        let mut names = HashMap::new();
        let mut own = Vec::new();
        for (i, param) in routine.params.iter().enumerate() {
            let value = values.get(i).cloned().unwrap_or(Value::unknown(Reason::ParameterWithoutArgument));
            let local = self.symbols.local(Value::unknown(Reason::Unset));
            if let Some(data) = routine.data.iter().find(|data| data.name == param.name) {
                self.symbols.declare_type(local, data.kind);
            }
            let whole = self.symbols.is_whole(local) && value.number().is_some_and(|v| v.fract() != 0.0);
            let value = if whole { value.forgotten(Reason::WholeNumber) } else { value };
            self.symbols.start[local] = self.symbols.converted(local, &[], value);
            names.insert(param.name.clone(), local);
            own.push(local);
        }
        let before = self.volatile.clone();
        self.volatile.extend(own.iter().zip(aliased).filter(|(_, aliased)| **aliased).map(|(id, _)| *id));
        // A parameter is declared within, too: that says its type.
        for data in routine.data.iter().filter(|data| routine.params.iter().all(|param| param.name != data.name)) {
            let local = self.symbols.local(Value::unknown(Reason::Unset));
            self.symbols.declare_type(local, data.kind);
            names.insert(data.name.clone(), local);
        }
        self.frames.push(Frame { routine: id, names, returns: Vec::new(), jumps: None });
        let loops = std::mem::take(&mut self.loops);
        let jumps = self.jumps(routine).map(Rc::new);
        let has_jumps = jumps.is_some();
        if let Some(frame) = self.frames.last_mut() {
            frame.jumps = jumps;
        }
        let (first, partials) = (self.sites.len(), self.open_partials);
        let flow = self.block(&routine.body);
        if has_jumps && self.open_partials > partials {
            // The motion before may be any.
            let sites = self.sites.get(first..).unwrap_or_default();
            self.pinned.extend(sites.iter().flat_map(|site| site.tokens).flatten());
        }
        self.loops = loops;
        let Some(frame) = self.frames.pop() else { return Vec::new() };
        let mut left = frame.returns;
        if flow == Flow::Next {
            left.push(std::mem::take(&mut self.state));
        }
        self.state = self.joined(left).unwrap_or_default();
        let left = |id: &Id| Left { value: self.value(*id), is_triggered: self.triggered.contains(id) };
        let out = own.iter().map(left).collect();
        // Its own data end with it.
        let locals: HashSet<Id> = frame.names.values().copied().collect();
        self.state.values.retain(|id, _| !locals.contains(id));
        self.triggered.retain(|id| !locals.contains(id));
        self.volatile = before;
        self.volatile.extend(&self.triggered);
        out
    }

    /// What a routine with GOTO changes: its statements may run in any order.
    fn jumps(&mut self, routine: &'a Routine) -> Option<Changes> {
        let jumps = |statement: &&Statement| matches!(statement.kind, StatementKind::Jump);
        routine.statements().iter().any(jumps).then(|| self.changes_in(&routine.body))
    }

    pub(super) fn block(&mut self, block: &'a [Statement]) -> Flow {
        self.nested += 1;
        let mut flow = Flow::Next;
        for statement in block {
            self.steps += 1;
            let most = self.steps > self.most_steps || self.targets.len() > self.most_targets;
            flow =
                if most || self.nested > MAX_NESTING { self.give_up(statement.at) } else { self.statement(statement) };
            if flow == Flow::Gone {
                break;
            }
        }
        self.nested -= 1;
        flow
    }

    /// The program has no end that is found.
    pub(super) fn give_up(&mut self, span: Span) -> Flow {
        if self.diagnostics.iter().all(|d| d.code != "krl.endless") {
            let source = &self.symbols.sources[self.here()];
            let message = "the program runs on without an end that is found";
            let error = Diagnostic::error("krl.endless", &source.name, message).at(source, span);
            self.diagnostics.push(error.help("split it, or give loops bounds that end them"));
        }
        Flow::Gone
    }

    fn statement(&mut self, statement: &'a Statement) -> Flow {
        match &statement.kind {
            StatementKind::If(of) => match self.evaluate(&of.condition).bool() {
                Some(true) => self.block(&of.then),
                Some(false) => self.block(&of.otherwise),
                None => self.branches(&[&of.then, &of.otherwise]),
            },
            StatementKind::For(of) => self.counted(of, statement.at),
            StatementKind::Loop(of) => self.repeat(of),
            StatementKind::Switch(of) => self.choice(of),
            StatementKind::Spline(with, body) => {
                let before = self.with(with);
                let flow = self.block(body);
                self.restore(before);
                flow
            }
            // What stands after it is run from a label on, or not at all.
            StatementKind::Jump => Flow::Next,
            StatementKind::Label => {
                let jumps = self.frames.last().and_then(|frame| frame.jumps.clone());
                if let Some(changes) = jumps {
                    self.forget(&changes, Reason::Jumps);
                }
                Flow::Next
            }
            StatementKind::Return(value) => {
                value.iter().for_each(|value| drop(self.evaluate(value)));
                let left = self.state.clone();
                let Some(frame) = self.frames.last_mut() else { return Flow::Gone };
                frame.returns.push(left);
                // A label after it may be gone to.
                if frame.jumps.is_some() { Flow::Next } else { Flow::Gone }
            }
            StatementKind::Exit => {
                let left = self.state.clone();
                let Some(exits) = self.loops.last_mut() else { return Flow::Next };
                exits.push(left);
                if self.frames.last().is_some_and(|frame| frame.jumps.is_some()) { Flow::Next } else { Flow::Gone }
            }
            StatementKind::Mark(mark) => {
                self.set_mark(*mark);
                Flow::Next
            }
            _ => {
                self.simple(statement);
                Flow::Next
            }
        }
    }

    pub(super) fn keep(&mut self, source: usize, span: Span, reason: Reason) {
        self.note(Kept { source, span, line: 0, reason, fault: false, help: "" });
    }

    /// What a controller does not load: no program is written from this one.
    pub(super) fn refuse(&mut self, span: Span, reason: Reason) {
        self.note(Kept { source: self.here(), span, line: 0, reason, fault: true, help: "" });
    }

    fn note(&mut self, kept: Kept) {
        if kept.source < self.written && self.seen.insert((kept.source, kept.span, kept.reason)) {
            let line = self.lines[kept.source].line(kept.span.start) as usize;
            self.kept.push(Kept { line, ..kept });
        }
    }

    /// A motion whose target is not known.
    pub(super) fn keep_motion(&mut self, span: Span, reason: Reason) {
        let line = self.lines[self.here()].line(span.start);
        #[allow(clippy::cast_possible_truncation)] // as a target has it
        let source = self.here() as u16;
        self.unknown.push(UnknownMotion { ordinal: self.motions, reason, source, span, line });
        self.keep(self.here(), span, reason);
    }

    /// Says once that a routine is not in the files.
    pub(super) fn tell_unknown(&mut self, name: &Name, span: Span) {
        if !self.told.insert(name.clone()) {
            return;
        }
        let source = &self.symbols.sources[self.here()];
        let message = format!("`{}` is not in the files: what it could change is unknown after it", decode(name));
        let warning = Diagnostic::error("krl.unknown-routine", &source.name, message).at(source, span);
        let help = "give the file that has it with --context; or, where it changes neither frames nor positions, name it in \
                    `[controller] harmless` of the cell";
        self.diagnostics.push(warning.severity(Severity::Warning).help(help));
    }

    /// The same of what an interrupt or a TRIGGER starts.
    pub(super) fn tell_started(&mut self, run: &Statement) {
        let cursor = Cursor::new(self.bytes(self.here()), 0, run.at);
        let first = cursor.peek();
        self.tell_unknown(&upper(cursor.text(first)), first.span());
    }

    /// Once: no name of a program has a blank.
    pub(super) fn tell_curve(&mut self, motion: Span) {
        if self.told.insert(upper(b" SPL")) {
            let source = &self.symbols.sources[self.here()];
            let span = Span { end: motion.start + 3, ..motion };
            let message = "the curve through SPL points is computed as straight lines: figures at the points are right, those between them only as far as the curve keeps to the lines";
            let note = Diagnostic::error("krl.spline", &source.name, message).at(source, span);
            self.diagnostics.push(note.severity(Severity::Note).help("put SPL points close together, or use SLIN"));
        }
    }

    fn simple(&mut self, statement: &'a Statement) {
        if !std::mem::take(&mut self.proceeds) {
            return self.run_simple(statement);
        }
        // Where it fails the program goes on all the same, and what it sets is as it was.
        let changes = self.changes_in(std::slice::from_ref(statement));
        self.run_simple(statement);
        self.forget(&changes, Reason::StatementMayFail);
    }

    fn run_simple(&mut self, statement: &'a Statement) {
        match &statement.kind {
            StatementKind::Assign(setting) => self.assignment(setting),
            StatementKind::Call(call) => self.call(call, statement.at),
            StatementKind::Move(of) => self.motion(of, statement.at),
            StatementKind::Relative(why, to) => self.relative(to, statement.at, *why),
            StatementKind::Trigger(started) => self.trigger(started),
            StatementKind::Proceed => self.proceeds = true,
            StatementKind::Harmless(parts) => parts.iter().for_each(|part| drop(self.evaluate(part))),
            StatementKind::NotUnderstood(_) => {
                self.keep(self.here(), statement.at, Reason::NotUnderstood);
                let ids = statement.names().into_iter().map(|name| self.resolve(name)).collect();
                self.forget(&Changes { anything: true, ids, ..Changes::default() }, Reason::ByStatement);
            }
            _ => {}
        }
    }
}
