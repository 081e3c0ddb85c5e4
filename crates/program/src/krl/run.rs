//! Runs the program: follows calls, loops and branches as far as deflex knows them.

use super::lex::Cursor;
use super::state::{Changes, ModalState};
use super::steps::{Routines, routines};
use super::symbols::{Id, MARK, RoutineId, SPLINE, Symbols};
use super::tree::{File, Loop, Routine, Statement, StatementKind};
use super::value::{Literal, Name, Selector, Value, upper};
use crate::kept::KeptStatements;
use crate::{Mark, Reason, Target, Tool, UnknownMotion, Wobj};
use deflex_lang::ir::SourceSpan;
use deflex_lang::walk::{Stop, VALUES_PER_STEP};
use deflex_text::{Diagnostic, Severity, Source, Span, decode};
use std::collections::{BTreeSet, HashMap, HashSet};
use std::rc::Rc;

/// Most statements that are run: this many, plus a number for each byte of the program. A loop that takes a quarter of them is run as one
/// round.
const STEPS: usize = 2_000_000;
const STEPS_PER_BYTE: usize = 8;
/// Most targets with all loops expanded: this many, plus a number for each byte of the program, so that a short file cannot fill the
/// memory.
const TARGETS: usize = 200_000;
const TARGETS_PER_BYTE: usize = 1;
/// Largest depth of calls.
pub(super) const MAX_CALLS: usize = 60;
/// A call of a routine that is running.
pub(super) struct Frame {
    pub(super) routine: RoutineId,
    pub(super) names: HashMap<Name, Id>,
}

impl Frame {
    /// A frame outside of all routines, which has only the names of a file.
    pub(super) fn of_file(file: usize) -> Self {
        Self { routine: RoutineId { file, at: usize::MAX }, names: HashMap::new() }
    }
}

/// The value of a parameter at the end of a routine.
pub(super) struct ParameterAtEnd {
    pub(super) value: Value,
    /// Whether a TRIGGER may still change it.
    pub(super) is_triggered: bool,
}

/// Places of a target's six numbers X Y Z A B C in the text; `None` for a number that is not in the text.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PositionTokens {
    pub(crate) tokens: [Option<SourceSpan>; 6],
    /// X, Y and Z less the numbers of their tokens, mm.
    pub(crate) offsets: [f64; 3],
    /// `$APO.CDIS` when the motion runs, mm, if it is known.
    pub(crate) approximation_mm: Option<f64>,
}

impl PositionTokens {
    pub(super) fn of(literals: [Option<Literal>; 6]) -> Self {
        let offset = |at: usize| literals[at].map_or(0.0, |literal| literal.offset);
        Self {
            tokens: literals.map(|literal| literal.map(|literal| literal.place)),
            offsets: std::array::from_fn(offset),
            approximation_mm: None,
        }
    }

    /// A component of the position less the number of its token.
    pub(super) fn offset(&self, component: usize) -> f64 {
        self.offsets.get(component).copied().unwrap_or(0.0)
    }
}

#[derive(Default)]
pub(super) struct Runner<'a> {
    pub(super) symbols: Symbols<'a>,
    pub(super) routines: Rc<Routines<'a>>,
    pub(super) written: usize,
    pub(super) state: ModalState,
    pub(super) frames: Vec<Frame>,
    /// Whether targets are recorded. They are not while the state at the start of any round of a loop is being found.
    pub(super) is_recording: bool,
    /// Number of the running chain of calls.
    context: u32,
    contexts: HashMap<(u32, usize), u32>,
    /// Place of the last target, in its chain of calls.
    pub(super) last: Option<f64>,
    /// Whether anything in a loop can change its condition; computed once for each loop.
    pub(super) steady: HashMap<*const Loop, bool>,
    pub(super) steps: usize,
    pub(super) most_steps: usize,
    pub(super) most_targets: usize,
    pub(super) entered: HashSet<RoutineId>,
    /// Numbers that are read by more than motions, or must not be edited for another reason.
    pub(super) pinned: HashSet<SourceSpan>,
    /// Numbers in the text that each datum has been given.
    pub(super) given: HashMap<Id, HashSet<SourceSpan>>,
    /// Data that are read with the value of the last run, or by a routine that does not run here: the numbers that they are given here are theirs.
    pub(super) read_later: HashSet<Id>,
    /// Data that may change at any moment.
    pub(super) volatile: HashSet<Id>,
    /// Routines that may run at any moment, or again while they run.
    pub(super) at_any_moment: HashSet<RoutineId>,
    /// Data that these routines name.
    pub(super) read_at_any_moment: HashSet<Id>,
    /// The routines that each routine calls directly.
    pub(super) calls: HashMap<RoutineId, BTreeSet<RoutineId>>,
    /// Whether an interrupt may end a routine half-way (RESUME).
    pub(super) resumes: bool,
    /// Whether the program assigns positions without some components.
    pub(super) leaves_components_out: bool,
    /// The data that routines could change; computed once for each routine.
    pub(super) changes: HashMap<RoutineId, Rc<Changes>>,
    pub(super) tools: Vec<Tool>,
    pub(super) wobjs: Vec<Wobj>,
    pub(super) targets: Vec<Target>,
    pub(super) sites: Vec<PositionTokens>,
    /// External axes of each target; `None` for axes that its position does not name.
    pub(super) external: Vec<[Option<f64>; 6]>,
    /// External axes that a motion moves to a position that is unknown or not zero.
    pub(super) used_axes: [bool; 6],
    /// External axes that are somewhere known only at run time.
    pub(super) unknown_axes: [bool; 6],
    pub(super) motions: u32,
    pub(super) arcs: usize,
    /// Motions that run and whose target is unknown, in running order.
    pub(super) unknown: Vec<UnknownMotion>,
    pub(super) kept: KeptStatements,
    /// Texts of the messages so far; each is given once.
    reported: BTreeSet<String>,
    pub(super) diagnostics: Vec<Diagnostic>,
}

impl<'a> Runner<'a> {
    pub(super) fn new(sources: &'a [Source], files: &'a [File], written: usize) -> Self {
        let bytes: usize = sources.iter().map(|s| s.bytes.len()).sum();
        let mut runner = Self {
            symbols: Symbols::new(sources, files),
            routines: Rc::new(routines(files)),
            written,
            is_recording: true,
            most_steps: STEPS + STEPS_PER_BYTE * bytes,
            most_targets: TARGETS + TARGETS_PER_BYTE * bytes,
            kept: KeptStatements::new(sources, written),
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

    /// Runs everything that an operator may select: the first routine of each file that no other routine calls.
    pub(super) fn run(&mut self) {
        self.expect_interrupts();
        self.find_what_runs_at_any_moment();
        self.leaves_components_out = self.finds_incomplete_positions();
        for root in self.symbols.roots(self.written) {
            self.state = ModalState::default();
            let mark = self.symbols.files[root.file].mark;
            if let Some(mark) = mark {
                self.set_mark(mark);
            }
            let routine: *const Routine = self.symbols.routine(root);
            if self
                .within(routine.addr(), |runner| runner.enter(root, &[], &[]))
                .is_err_and(|stop| stop == Stop::TooLong)
            {
                break;
            }
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
        let id = MARK;
        self.state.values.insert(id, Value::Number(f64::from(u8::from(mark == Mark::Cut)), None));
    }

    /// Runs a routine with values for its parameters, of which some may change under another name.
    pub(super) fn enter(
        &mut self,
        id: RoutineId,
        values: &[Value],
        aliased: &[bool],
    ) -> Result<Vec<ParameterAtEnd>, Stop> {
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
        // The declaration of a parameter in the routine has given its type.
        for data in routine.data.iter().filter(|data| routine.params.iter().all(|param| param.name != data.name)) {
            let local = self.symbols.local(Value::unknown(Reason::Unset));
            self.symbols.declare_type(local, data.kind);
            names.insert(data.name.clone(), local);
        }
        self.frames.push(Frame { routine: id, names });
        let ended = self.walk(id);
        let left = |id: &Id| ParameterAtEnd { value: self.value(*id), is_triggered: self.state.loose.contains(id) };
        let out = own.iter().map(left).collect();
        // The routine's own data do not outlive it.
        let locals: HashSet<Id> = self.frames.pop().into_iter().flat_map(|frame| frame.names.into_values()).collect();
        self.state.values.retain(|id, _| !locals.contains(id));
        self.state.tighten(&locals);
        self.volatile = before;
        ended.map(|()| out)
    }

    /// Whether data may change at any moment.
    pub(super) fn is_volatile(&self, id: Id) -> bool {
        self.volatile.contains(&id) || self.state.loose.contains(&id)
    }

    /// Calls `run` in the chain of calls that the statement at `address` continues. Each chain has a number.
    pub(super) fn within<T>(&mut self, address: usize, run: impl FnOnce(&mut Self) -> T) -> T {
        let (next, around) = (self.contexts.len() as u32 + 1, self.context);
        self.context = *self.contexts.entry((around, address)).or_insert(next);
        let done = run(self);
        self.context = around;
        done
    }

    /// A number for a place in the text, in the running chain of calls.
    pub(super) fn site(&self, at: Span) -> f64 {
        f64::from(self.context) * (f64::from(u32::MAX) + 1.0) + f64::from(at.start)
    }

    /// Counts a statement that runs.
    pub(super) fn count(&mut self, at: Span) -> Result<(), Stop> {
        self.steps += 1;
        let is_too_long = self.steps > self.most_steps || self.targets.len() > self.most_targets;
        if is_too_long { self.give_up(at) } else { Ok(()) }
    }

    /// Ends the run with an error, because no end of the program was found.
    pub(super) fn give_up(&mut self, span: Span) -> Result<(), Stop> {
        let source = &self.symbols.sources[self.here()];
        let error = Diagnostic::error("krl.endless", &source.name, "deflex found no end of the program");
        self.report(error.help("split it, or give loops bounds that end them"), self.here(), Some(span));
        Err(Stop::TooLong)
    }

    pub(super) fn keep(&mut self, source: usize, span: Span, reason: Reason) {
        if self.is_recording {
            self.kept.keep(source, span, reason);
        }
    }

    /// Records something that a controller does not load. No program will be written.
    pub(super) fn refuse(&mut self, span: Span, reason: Reason) {
        if self.is_recording {
            self.kept.refuse(self.here(), span, reason);
        }
    }

    /// Records a motion with an unknown target.
    pub(super) fn keep_motion(&mut self, span: Span, reason: Reason) {
        if self.is_recording {
            let here = self.here();
            #[allow(clippy::cast_possible_truncation)] // as a target has it
            self.unknown.push(self.kept.unknown_motion(self.motions, here as u16, span, reason));
            self.kept.keep(here, span, reason);
        }
    }

    /// Adds a message at a place of a file, unless it was given already.
    pub(super) fn report(&mut self, message: Diagnostic, file: usize, place: Option<Span>) {
        if self.reported.insert(message.message.clone()) {
            let source = &self.symbols.sources[file];
            self.diagnostics.push(if let Some(span) = place { message.at(source, span) } else { message });
        }
    }

    /// Warns of a routine that is not in the files.
    pub(super) fn report_unknown(&mut self, name: &Name, span: Span) {
        let source = &self.symbols.sources[self.here()];
        let message = format!("`{}` is not in the files: what it could change is unknown after it", decode(name));
        let warning = Diagnostic::error("krl.unknown-routine", &source.name, message).severity(Severity::Warning);
        let help = "give the file that has it with --context; or, where it changes neither frames nor positions, name it in \
                    `[controller] harmless` of the cell";
        self.report(warning.help(help), self.here(), Some(span));
    }

    /// Warns of a routine that an interrupt or a TRIGGER starts, and that is not in the files.
    pub(super) fn report_started(&mut self, run: &Statement) {
        let cursor = Cursor::new(self.bytes(self.here()), 0, run.at);
        let first = cursor.peek();
        self.report_unknown(&upper(cursor.text(first)), first.span());
    }

    pub(super) fn report_curve(&mut self, motion: Span) {
        let source = &self.symbols.sources[self.here()];
        let span = Span { end: motion.start + 3, ..motion };
        let message = "the curve through SPL points is computed as straight lines: figures at the points are right, those between them only as far as the curve keeps to the lines";
        let note = Diagnostic::error("krl.spline", &source.name, message).severity(Severity::Note);
        self.report(note.help("put SPL points close together, or use SLIN"), self.here(), Some(span));
    }

    pub(super) fn simple(&mut self, statement: &'a Statement) -> Result<(), Stop> {
        if !std::mem::take(&mut self.state.proceeds) {
            return self.run_simple(statement);
        }
        // If the statement fails, the program continues, and the data that it sets keep their values.
        let changes = self.changes_in(std::slice::from_ref(statement));
        self.run_simple(statement)?;
        self.forget(&changes, Reason::StatementMayFail);
        Ok(())
    }

    fn run_simple(&mut self, statement: &'a Statement) -> Result<(), Stop> {
        match &statement.kind {
            StatementKind::Assign(setting) => self.assignment(setting),
            StatementKind::Mark(mark) => self.set_mark(*mark),
            StatementKind::Call(call) => return self.call(call, statement),
            StatementKind::Move(of) => self.motion(of, statement.at),
            StatementKind::Relative(why, to) => self.relative(to, statement.at, *why),
            StatementKind::Trigger(started) => self.trigger(started),
            StatementKind::Proceed => self.state.proceeds = true,
            StatementKind::Harmless(parts) | StatementKind::Return(parts) => {
                parts.iter().for_each(|part| drop(self.evaluate(part)));
            }
            StatementKind::TimeBlock(parts) => {
                parts.iter().for_each(|part| drop(self.evaluate(part)));
                self.set_speed(Value::unknown(Reason::Computed));
            }
            StatementKind::WaitFor(parts) => {
                let values: Vec<Value> = parts.iter().map(|part| self.evaluate(part)).collect();
                if !matches!(&values[..], [value] if value.bool() == Some(true)) {
                    parts.iter().for_each(|part| self.wait_for(part));
                }
            }
            StatementKind::SplineBegins(with) => {
                let before: Vec<Value> = self.with(with).into();
                let saved = before.into_iter().enumerate().map(|(at, value)| (at as i64, value)).collect();
                self.state.values.insert(SPLINE, Value::Array(Rc::new(saved)));
            }
            StatementKind::SplineEnds => {
                let saved = self.value(SPLINE);
                self.restore(&std::array::from_fn(|at| saved.get(&[Selector::Element(at as i64)])));
                self.state.values.remove(&SPLINE);
            }
            StatementKind::NotUnderstood(_) => {
                self.keep(self.here(), statement.at, Reason::NotUnderstood);
                let ids = statement.names().into_iter().map(|name| self.resolve(name)).collect();
                self.forget(&Changes { anything: true, ids, ..Changes::default() }, Reason::ByStatement);
            }
            _ => {}
        }
        Ok(())
    }
}
