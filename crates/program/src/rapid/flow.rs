//! Branches and loops: followed if their conditions are known; otherwise every branch runs, and the states after them are joined.

use super::eval::Scope;
use super::expression::{Arguments, Expression, ExpressionKind};
use super::layers::EndState;
use super::run::MOTIONS;
use super::runner::{Continuation, Mode, Runner};
use super::state::Switches;
use super::symbols::{Content, Upper};
use super::tree::{For, If, Statement, StatementKind, Test, While, any};
use super::value::Value;
use crate::Reason;
use deflex_text::Span;
use std::collections::{BTreeMap, BTreeSet};

/// Most rounds of a WHILE; with more, its end counts as known only at run time.
const MAX_ROUNDS: usize = 100_000;
/// Number of motions after which the number of all motions is estimated from the rounds so far.
const LOOK_AHEAD: u32 = 100_000;
/// Factor of that estimate over the bound at which a loop is given up: rounds may become shorter.
const MARGIN: f64 = 4.0;
/// Rounds that are run to find the state at the beginning of any round: a switch becomes unknown only once.
const DRY_ROUNDS: usize = 3;
/// Deepest nesting of loops for which this is done; in deeper ones the state is unknown.
const DRY_DEPTH: usize = 2;

/// A position in the results so far.
#[derive(Clone)]
struct Marker {
    targets: usize,
    offsets: usize,
    motions: u32,
    arcs: usize,
    unknown: usize,
}

impl<'a> Runner<'a> {
    pub(super) fn condition(&mut self, of: &'a If, at: Span) -> Continuation {
        let failures = self.errors.failures;
        for (i, arm) in of.arms.iter().enumerate() {
            match self.evaluate(self.scope(), &arm.condition).bool() {
                Some(true) => return self.block(&arm.body),
                Some(false) => {}
                None => {
                    self.note(
                        at,
                        "rapid.condition",
                        "condition is known only at run time: every branch is taken, in the order of the text",
                    );
                    // The calls of the other conditions may run or not.
                    for arm in &of.arms[i + 1..] {
                        self.evaluate(self.scope(), &arm.condition);
                    }
                    let rest = of.arms[i..].iter().map(|arm| &arm.body[..]).chain([&of.otherwise[..]]);
                    return self.branches(rest.chain(self.skipped_since(failures).then_some(&[][..])));
                }
            }
        }
        self.block(&of.otherwise)
    }

    /// Runs every branch from the state before them all, because any may be the one that runs.
    pub(super) fn branches(&mut self, branches: impl Iterator<Item = &'a [Statement]>) -> Continuation {
        self.counters.events += 1;
        let mut joined: Option<EndState> = None;
        let (before, mut behind) = (self.position.standing.clone(), BTreeSet::new());
        let (stood, mut stands) = (self.position.stands, None);
        for branch in branches {
            self.open();
            self.position.standing.clone_from(&before);
            self.position.stands = stood;
            let flow = self.block(branch);
            let left = self.take();
            behind.append(&mut self.position.standing);
            if flow == Continuation::Next {
                let here = self.position.stands;
                stands = Some(stands.map_or(here, |known: Option<u32>| known.filter(|_| known == here)));
                joined = Some(match joined {
                    Some(joined) => self.join(joined, left),
                    None => left,
                });
            }
        }
        self.position.standing = behind;
        self.position.stands = stands.unwrap_or_default();
        match joined {
            Some(left) => {
                self.apply(left);
                Continuation::Next
            }
            None => Continuation::Elsewhere,
        }
    }

    /// Whether a block has a GOTO, which may leave it at any statement.
    pub(super) fn jumps(block: &[Statement]) -> bool {
        any(block, &|statement| matches!(statement, StatementKind::Goto(_)))
    }

    pub(super) fn counted(&mut self, of: &'a For, at: Span) -> Continuation {
        self.counters.events += 1;
        let scope = self.scope();
        let [from, to] = [&of.from, &of.to].map(|bound| self.evaluate(scope, bound).num());
        let step = of.step.as_ref().map(|step| self.evaluate(scope, step).num());
        let (body, variable) = (&of.body, of.variable);
        let bytes = self.bytes(scope.source as usize);
        let key: Box<[u8]> = Box::from(&*Upper::new(&bytes[variable.range()]));
        let counter = self.new_variable(
            bytes,
            scope.source as usize,
            scope.module,
            variable,
            variable,
            Value::Unknown(Reason::Loop),
        );
        let hidden = self.frames.last_mut().and_then(|f| f.names.insert(key.clone(), counter));
        self.counters.epoch += 1;
        let known = match (from, to, step) {
            _ if Self::jumps(body) => None,
            (Some(from), Some(to), None) => Some(Rounds { from, to, step: if to >= from { 1.0 } else { -1.0 } }),
            (Some(from), Some(to), Some(Some(step))) => Some(Rounds { from, to, step }),
            _ => None,
        };
        #[allow(clippy::cast_precision_loss)]
        let most = self.budget.most_steps as f64;
        let known = known.filter(|rounds| rounds.number().abs() <= most && rounds.are_known());
        let flow = match known {
            Some(rounds) => self.count(counter, rounds, body, at),
            None => {
                self.note(at, "rapid.loop", "loop bounds are known only at run time: the loop is taken once");
                self.rounds(body)
            }
        };
        self.symbols.variables.truncate(counter);
        if let Some(frame) = self.frames.last_mut() {
            match hidden {
                Some(at) => frame.names.insert(key, at),
                None => frame.names.remove(&key),
            };
        }
        self.counters.epoch += 1;
        flow
    }

    fn count(&mut self, counter: usize, rounds: Rounds, body: &'a [Statement], at: Span) -> Continuation {
        let Rounds { from, to, step } = rounds;
        if step == 0.0 {
            return Continuation::Next;
        }
        let (mut value, mut done, began) = (from, 0.0, self.counters.motions);
        while if step > 0.0 { value <= to } else { value >= to } {
            self.symbols.variables[counter].content = Content::Is(Value::Num(value, None));
            self.budget.spend(1);
            if self.budget.is_spent() {
                return self.give_up(at);
            }
            let flow = self.block(body);
            if flow != Continuation::Next {
                return flow;
            }
            value += step;
            done += 1.0;
            let moved = self.counters.motions - began;
            if moved > LOOK_AHEAD && f64::from(moved) / done * rounds.number() > MARGIN * f64::from(MOTIONS) {
                return self.give_up(at);
            }
        }
        Continuation::Next
    }

    pub(super) fn repeat(&mut self, of: &'a While, at: Span) -> Continuation {
        let While { condition, body } = of;
        self.counters.events += 1;
        let number = self.counters.loops;
        self.counters.loops += 1;
        let scope = self.scope();
        let before = self.marker();
        self.gathering.enter_loop(number);
        let mut rounds = 0;
        let mut known = self.evaluate(scope, condition).bool();
        // A condition that nothing in the loop changes never ends it.
        let endless = known == Some(true) && !self.depends(scope, condition, body);
        while !endless && rounds < MAX_ROUNDS && !Self::jumps(body) {
            match known {
                Some(false) => return Continuation::Next,
                None => break,
                Some(true) => {
                    let changes = self.counters.changes;
                    let flow = self.block(body);
                    if flow != Continuation::Next {
                        return flow;
                    }
                    // After a round without changes of data, the loop never ends.
                    if self.counters.changes == changes {
                        rounds = MAX_ROUNDS;
                        break;
                    }
                }
            }
            rounds += 1;
            known = self.evaluate(scope, condition).bool();
        }
        if rounds == MAX_ROUNDS {
            self.back_to(before);
            self.gathering.give_up_loop(number, self.found.targets.len());
            self.position.stands = None;
        }
        self.note(at, "rapid.loop", "how often this loop runs is known only at run time: it is taken once");
        self.rounds(body)
    }

    /// An unknown number of rounds: runs one, from the state in which any round may begin.
    fn rounds(&mut self, body: &'a [Statement]) -> Continuation {
        let Some(routine) = self.frames.last().map(|frame| frame.routine) else { return Continuation::Next };
        self.counters.events += 1;
        let changes = self.symbols.changed_in(routine, body);
        self.forget(&changes, Reason::Loop);
        self.state.axes.lose_positions();
        // An error in a round before may have gone to the handler.
        self.run_handler();
        if changes.switches != Switches::NONE {
            self.settle(body);
        }
        let (mut before, stood, motions) =
            (self.position.standing.clone(), self.position.stands.take(), self.counters.motions);
        self.open();
        let flow = self.block(body);
        let left = self.take();
        // Another round may come before, or none.
        self.position.stands = if self.counters.motions == motions { stood } else { None };
        if changes.switches.displacement {
            // The next round may count from where this one ends.
            self.hold_where_it_stands();
        }
        self.position.standing.append(&mut before);
        if flow == Continuation::Next {
            let none = EndState { changed: BTreeMap::new(), state: self.state };
            let left = self.join(left, none);
            self.apply(left);
        }
        Continuation::Next
    }

    /// Finds the switches at the beginning of any round of a loop.
    fn settle(&mut self, body: &'a [Statement]) {
        if self.dry == DRY_DEPTH {
            self.state.lose(Switches::ALL);
            return;
        }
        self.dry += 1;
        for _ in 0..DRY_ROUNDS {
            self.open();
            let flow = self.quietly(Mode::Dry, |this| this.block(body));
            let left = self.take();
            let joined = if flow == Continuation::Next { self.state.join(left.state) } else { self.state };
            if joined == self.state {
                break;
            }
            self.state = joined;
        }
        self.dry -= 1;
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
                    let is_part = matches!(variable.content, Content::Part(_));
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

    /// The position after the results so far.
    fn marker(&self) -> Marker {
        Marker {
            targets: self.found.targets.len(),
            offsets: self.found.offsets.len(),
            motions: self.counters.motions,
            arcs: self.counters.arcs,
            unknown: self.found.unknown.len(),
        }
    }

    /// Discards the results since a marker.
    fn back_to(&mut self, marker: Marker) {
        self.found.targets.truncate(marker.targets);
        self.found.sites.truncate(marker.targets);
        self.found.offsets.truncate(marker.offsets);
        self.found.unknown.truncate(marker.unknown);
        (self.counters.motions, self.counters.arcs) = (marker.motions, marker.arcs);
    }

    pub(super) fn choice(&mut self, of: &'a Test, at: Span) -> Continuation {
        self.counters.events += 1;
        let scope = self.scope();
        let failures = self.errors.failures;
        let subject = self.evaluate(scope, &of.subject);
        for (i, case) in of.cases.iter().enumerate() {
            match self.matches(scope, &subject, &case.values) {
                Some(true) => return self.block(&case.body),
                Some(false) => {}
                None => {
                    self.note(
                        at,
                        "rapid.condition",
                        "value is known only at run time: every case is taken, in the order of the text",
                    );
                    let rest = of.cases[i..].iter().map(|case| &case.body[..]).chain([&of.otherwise[..]]);
                    return self.branches(rest.chain(self.skipped_since(failures).then_some(&[][..])));
                }
            }
        }
        self.block(&of.otherwise)
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
