//! The effect of each step of a routine, the tests that decide between paths, and the state where paths meet.

use super::eval::Scope;
use super::expression::{Arguments, Expression, ExpressionKind};
use super::run::MOTIONS;
use super::runner::{Mode, Runner, RunningLoop};
use super::state::{Site, State};
use super::steps::{Action, Decision, Step, Test};
use super::symbols::Upper;
use super::tree::{Statement, StatementKind, Storage};
use super::value::Value;
use crate::Reason;
use deflex_lang::walk::{Machine, Meeting, Stop, VALUES_PER_STEP, walk};
use deflex_text::Span;
use std::rc::Rc;

/// Most rounds of a WHILE; with more, its end counts as known only at run time.
const MAX_ROUNDS: u32 = 100_000;
/// Number of motions after which the number of all motions is estimated from the rounds so far.
const LOOK_AHEAD: u32 = 100_000;
/// Factor of that estimate over the bound at which a loop is given up: rounds may become shorter.
const MARGIN: f64 = 4.0;

/// A position in the results so far.
#[derive(Clone, Copy)]
pub(super) struct Marker {
    number: u64,
    targets: usize,
    offsets: usize,
    motions: u32,
    arcs: usize,
    unknown: usize,
    last: Option<Site>,
    steps: usize,
}

impl<'a> Machine for Runner<'a> {
    type Step = Step<'a>;
    type Test = Test<'a>;
    type State = State;
    type Mark = Marker;

    fn step(&mut self, _: usize, step: Step<'a>, state: &mut State) -> Result<(), Stop> {
        self.at(step.within, state, |this| match step.what {
            Action::Statements(row) => row.iter().try_for_each(|statement| this.statement(statement)),
            Action::BeginLoop(of) => {
                this.begin_loop(of);
                Ok(())
            }
            Action::NextRound(of) => this.next_round(of, step.at),
        })
    }

    fn holds(&mut self, _: usize, test: Test<'a>, state: &mut State) -> Result<Option<bool>, Stop> {
        self.at(test.within, state, |this| {
            this.counters.events += 1;
            this.count(test.at)?;
            Ok(this.decide(test))
        })
    }

    fn join(&mut self, known: &mut State, other: &State, meeting: Meeting) -> bool {
        self.budget.spend((known.values.len() + other.values.len()) / VALUES_PER_STEP);
        let why = match meeting {
            Meeting::Branches => Reason::Branches,
            Meeting::Rounds => Reason::Loop,
        };
        self.join_states(known, other, why)
    }

    fn lose_place(&self, state: &mut State) {
        state.lose_place();
    }

    fn forget_last(&mut self) {
        self.found.last = None;
    }

    fn is_same(&self, a: &State, b: &State) -> bool {
        a.is(b)
    }

    fn is_recording(&mut self) -> &mut bool {
        &mut self.is_recording
    }

    fn mark(&mut self) -> Marker {
        self.counters.marks += 1;
        let number = self.counters.marks;
        self.gathering.mark(number);
        Marker {
            number,
            targets: self.found.targets.len(),
            offsets: self.found.offsets.len(),
            motions: self.counters.motions,
            arcs: self.counters.arcs,
            unknown: self.found.unknown.len(),
            last: self.found.last,
            steps: self.budget.steps,
        }
    }

    fn back_to(&mut self, marker: Marker) {
        self.found.targets.truncate(marker.targets);
        self.found.sites.truncate(marker.targets);
        self.found.offsets.truncate(marker.offsets);
        self.found.unknown.truncate(marker.unknown);
        self.found.last = marker.last;
        (self.counters.motions, self.counters.arcs) = (marker.motions, marker.arcs);
        self.gathering.back_to(marker.number, marker.targets);
    }

    fn counts_rounds(&self, test: Test<'a>) -> bool {
        !matches!(test.what, Decision::Runs(_) | Decision::Continues)
    }

    fn is_too_much(&self, since: Marker) -> bool {
        self.budget.steps.saturating_sub(since.steps) > self.budget.most_steps / 4
    }
}

impl<'a> Runner<'a> {
    /// Runs the steps of a routine from a state; returns the state at its end.
    pub(super) fn walk(&mut self, routine: super::known::RoutineId, state: State) -> Result<State, Stop> {
        let routines = Rc::clone(&self.routines);
        walk(self, &routines.flow, routines.number(routine), state)
    }

    /// Runs something in a state, at a place within a FOR loop.
    fn at<T>(&mut self, within: Option<usize>, state: &mut State, run: impl FnOnce(&mut Self) -> T) -> T {
        std::mem::swap(&mut self.state, state);
        if let Some(frame) = self.frames.last_mut() {
            frame.within = within;
        }
        let done = run(self);
        std::mem::swap(&mut self.state, state);
        done
    }

    fn decide(&mut self, test: Test<'a>) -> Option<bool> {
        let (scope, failures) = (self.scope(), self.errors.failures);
        let (holds, code, message) = match test.what {
            Decision::Runs(statement) => return self.runs(scope, statement),
            Decision::Continues => return Some(self.raise()),
            Decision::Condition(condition) => (
                self.evaluate(scope, condition).bool(),
                "rapid.condition",
                "condition is known only at run time: every branch is taken, in the order of the text",
            ),
            Decision::Case(of, case) => {
                let subject = self.evaluate(scope, &of.subject);
                (
                    self.matches(scope, &subject, &of.cases[case].values),
                    "rapid.condition",
                    "value is known only at run time: every case is taken, in the order of the text",
                )
            }
            Decision::Round(of) => (
                self.has_round(of),
                "rapid.loop",
                "how often this loop runs is known only at run time: it is taken once",
            ),
            Decision::While(of) => {
                let holds = self.evaluate(scope, &of.condition).bool();
                let rounds =
                    self.frames.last_mut().map(|frame| frame.rounds.entry(std::ptr::from_ref(of)).or_default());
                let rounds = rounds.map_or(0, |rounds| {
                    *rounds = if holds == Some(true) { *rounds + 1 } else { 0 };
                    *rounds
                });
                // A condition that nothing in the loop changes never ends it.
                let is_steady = holds == Some(true) && !self.depends(scope, &of.condition, &of.body);
                if is_steady {
                    self.wait_for(scope, &of.condition);
                }
                // After a condition that fails, TRYNEXT continues without the loop.
                let is_known = !is_steady && rounds <= MAX_ROUNDS && !self.skipped_since(failures);
                let holds = holds.filter(|goes_on| !goes_on || is_known);
                (holds, "rapid.loop", "how often this loop runs is known only at run time: it is taken once")
            }
        };
        if holds.is_none() {
            self.note(test.at, code, message);
        }
        holds
    }

    /// Whether an IF or TEST runs, or is skipped because one of its conditions fails.
    fn runs(&mut self, scope: Scope, statement: &'a Statement) -> Option<bool> {
        let failures = self.errors.failures;
        match &statement.kind {
            StatementKind::If(of) => {
                of.arms.iter().any(|arm| self.evaluate(scope, &arm.condition).bool() == Some(true));
            }
            StatementKind::Test(of) => {
                let subject = self.evaluate(scope, &of.subject);
                of.cases.iter().any(|case| self.matches(scope, &subject, &case.values) == Some(true));
            }
            _ => {}
        }
        (!self.skipped_since(failures)).then_some(true)
    }

    /// Whether `subject` is among the values of a CASE.
    fn matches(&mut self, scope: Scope, subject: &Value, values: &'a Arguments) -> Option<bool> {
        let mut sure = !values.is_cut;
        for value in &values.positional {
            let value = self.evaluate(scope, value);
            match super::eval::equal(subject, &value) {
                Some(true) => return Some(true),
                Some(false) => {}
                None => sure = false,
            }
        }
        sure.then_some(false)
    }

    /// Evaluates the bounds of a FOR loop.
    fn begin_loop(&mut self, of: usize) {
        let routines = Rc::clone(&self.routines);
        let (scope, bounds) = (self.scope(), routines.loops[of].of);
        let [from, to] = [&bounds.from, &bounds.to].map(|bound| self.evaluate(scope, bound).num());
        let step = bounds.step.as_ref().map(|step| self.evaluate(scope, step).num());
        let rounds = from.zip(to).and_then(|(from, to)| {
            let step = step.unwrap_or(Some(if to >= from { 1.0 } else { -1.0 }))?;
            Some(Rounds { from, to, step })
        });
        #[allow(clippy::cast_precision_loss)]
        let most = self.budget.most_steps as f64;
        let rounds = rounds.filter(|rounds| rounds.number().abs() <= most && rounds.are_known());
        let variables = self.loop_variables(of);
        let known = rounds.map(|Rounds { from, to, step }| [from, to, step]);
        for (at, variable) in variables.into_iter().enumerate() {
            let value = known.map_or(Value::Unknown(Reason::Loop), |known| Value::Num(known[at], None));
            self.state.values.insert(variable, value);
        }
        let motions = self.counters.motions;
        let running = self.frames.last_mut().and_then(|frame| frame.loops.iter_mut().find(|running| running.of == of));
        if let Some(running) = running {
            (running.from, running.motions) = (from.unwrap_or_default(), motions);
        }
        self.touch();
    }

    /// The variable of a FOR loop of the running routine, and those that hold its last value and its step.
    fn loop_variables(&mut self, of: usize) -> [usize; 3] {
        if let Some(known) = self.running_loop(of) {
            return known.variables;
        }
        let (scope, name) = (self.scope(), self.routines.loops[of].of.variable);
        let bytes = self.bytes(scope.source as usize);
        let variables = [(); 3].map(|()| {
            let value = Value::Unknown(Reason::Loop);
            self.new_variable(bytes, scope.source as usize, scope.module, name, name, value)
        });
        if let Some(frame) = self.frames.last_mut() {
            frame.loops.push(RunningLoop { of, variables, from: 0.0, motions: 0 });
        }
        variables
    }

    /// The variable of this name that a FOR loop around the running statement declares.
    pub(super) fn loop_variable(&self, name: &[u8]) -> Option<usize> {
        let frame = self.frames.last()?;
        let mut around = std::iter::successors(frame.within, |of| self.routines.loops[*of].outer);
        let of = around.find(|of| *self.routines.loops[*of].name == *name)?;
        self.running_loop(of).map(|running| running.variables[0])
    }

    fn running_loop(&self, of: usize) -> Option<RunningLoop> {
        self.frames.last()?.loops.iter().find(|running| running.of == of).copied()
    }

    fn rounds(&mut self, of: usize) -> Option<Rounds> {
        let [from, to, step] = self.loop_variables(of).map(|variable| self.content(variable).num());
        Some(Rounds { from: from?, to: to?, step: step? })
    }

    fn has_round(&mut self, of: usize) -> Option<bool> {
        let Rounds { from, to, step } = self.rounds(of)?;
        Some(if step > 0.0 { from <= to } else { step < 0.0 && from >= to })
    }

    fn next_round(&mut self, of: usize, at: Span) -> Result<(), Stop> {
        let [variable, ..] = self.loop_variables(of);
        let Some(Rounds { from: before, to, step }) = self.rounds(of) else {
            self.state.values.insert(variable, Value::Unknown(Reason::Loop));
            return Ok(());
        };
        self.state.values.insert(variable, Value::Num(before + step, None));
        if let Some(RunningLoop { from, motions, .. }) = self.running_loop(of).filter(|_| self.is_recording) {
            let (moved, done) = (self.counters.motions.saturating_sub(motions), (before - from) / step + 1.0);
            let all = f64::from(moved) / done * ((to - from) / step + 1.0);
            if moved > LOOK_AHEAD && all > MARGIN * f64::from(MOTIONS) {
                return Err(self.give_up(at));
            }
        }
        Ok(())
    }

    /// The program waits until a condition holds: if it does not hold yet, something else changes the data that it names.
    pub(super) fn wait_for(&mut self, scope: Scope, condition: &Expression) {
        let bytes = self.bytes(scope.source as usize);
        for name in condition.names() {
            let found = self.find(scope, &Upper::new(&bytes[name.range()]));
            if let Some(at) = found.filter(|at| self.symbols.variables[*at].storage != Storage::Const) {
                self.forget_data(at, Reason::WaitedFor);
            }
        }
    }

    /// Whether a block may change a name in an expression, or the expression calls a function.
    fn depends(&self, scope: Scope, expression: &Expression, body: &[Statement]) -> bool {
        let bytes = self.bytes(scope.source as usize);
        let (mut is_fixed, truth) = (true, [&b"TRUE"[..], b"FALSE"]);
        expression.each(&mut |part: &Expression| match part.kind {
            ExpressionKind::Call(_) => is_fixed = false,
            ExpressionKind::Name => {
                is_fixed &= truth.iter().any(|word| word.eq_ignore_ascii_case(&bytes[part.span.range()]));
            }
            _ => {}
        });
        if is_fixed {
            return false;
        }
        let Some(frame) = self.frames.last() else { return true };
        let changes = self.symbols.changed_in(frame.routine, body);
        if changes.anything || self.symbols.routine(frame.routine).error.is_some() {
            return true;
        }
        let mut depends = false;
        expression.each(&mut |part: &Expression| match part.kind {
            ExpressionKind::Call(_) => depends = true,
            ExpressionKind::Name => {
                let name = Upper::new(&bytes[part.span.range()]);
                let found = self.find(scope, &name);
                let is_changed = found.is_some_and(|at| {
                    let variable = &self.symbols.variables[at];
                    let is_part = matches!(variable.content, super::symbols::Content::Part(_));
                    variable.volatile.is_some() || changes.data.contains(&at) || is_part
                });
                // A parameter by reference may be any of what else is changed.
                let alias = found.is_some_and(|at| !changes.own.is_empty() && at >= self.symbols.data);
                depends |= is_changed || alias || changes.own.contains(&*name);
            }
            _ => {}
        });
        depends
    }

    /// Whether motions go to the result.
    pub(super) fn is_real(&self) -> bool {
        self.mode == Mode::Real && self.is_recording
    }

    /// The place of a statement in the running chain of calls.
    pub(super) fn site(&self, at: Span) -> Site {
        Site { calls: self.calls, source: self.scope().source, start: at.start }
    }
}

/// The rounds of a FOR.
#[derive(Clone, Copy)]
struct Rounds {
    from: f64,
    to: f64,
    step: f64,
}

impl Rounds {
    /// The number of steps from the first value to the last bound.
    fn number(self) -> f64 {
        (self.to - self.from) / self.step
    }

    /// Whether single precision, in which the controller counts, goes round as often as double precision.
    fn are_known(self) -> bool {
        let is_whole = |v: f64| v.fract() == 0.0 && v.abs() < f64::from(1_u32 << 24);
        if [self.from, self.to, self.step].into_iter().all(is_whole) {
            return true;
        }
        // A bound that is neither met nor nearly met by any round.
        let number = self.number();
        number < 0.0 || (number - number.round()).abs() > 1e-3
    }
}
