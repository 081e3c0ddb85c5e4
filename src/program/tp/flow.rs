//! What a statement makes of what is known, and where a run goes on.

use super::calls::{Called, Calls};
use super::expression::{self, Registers};
use super::lines::Line;
use super::state::{Marked, ModalState};
use super::statement::{self, Frame, StatementKind};
use crate::program::Reason;
use std::collections::{BTreeMap, BTreeSet};

/// Where a run may go on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Next {
    /// At this statement; after the last one it ends.
    At(usize),
    /// At any statement.
    Anywhere,
}

/// The statements of a program with what belongs together.
#[derive(Debug)]
pub(super) struct Flow<'a> {
    pub(super) kinds: Vec<StatementKind<'a>>,
    /// Statements within a block of point logic: they run in parallel.
    inner: Vec<bool>,
    labels: BTreeMap<u32, usize>,
    /// Of `IF`, where it goes on if not so; of `ELSE`, after `ENDIF`; of `FOR`, its `ENDFOR`, and the other way round; of the
    /// cases of a `SELECT`, after it.
    partner: BTreeMap<usize, usize>,
    /// Of the cases of a `SELECT`, its first.
    first_case: BTreeMap<usize, usize>,
    calls: &'a Calls,
    /// What statements of point logic may change, by the motion that they belong to.
    logic: BTreeMap<usize, Called>,
    /// What is known before the first statement.
    pub(super) start: ModalState,
}

impl<'a> Flow<'a> {
    /// `displaced`: why the paths of the whole program are moved at run time, where they are.
    pub(super) fn new(lines: &'a [Line<'a>], calls: &'a Calls, displaced: Option<Reason>) -> Self {
        let kinds: Vec<StatementKind<'a>> = lines.iter().map(statement::kind).collect();
        let mut flow = Self {
            inner: inner(lines, &kinds),
            kinds,
            labels: BTreeMap::new(),
            partner: BTreeMap::new(),
            first_case: BTreeMap::new(),
            calls,
            logic: BTreeMap::new(),
            start: ModalState { displaced, ..ModalState::default() },
        };
        flow.link();
        let mut block = None;
        for at in 0..flow.kinds.len() {
            match block.filter(|_| flow.inner[at]) {
                Some(motion) => calls.take(&flow.kinds[at], flow.logic.entry(motion).or_default()),
                None => block = Some(at),
            }
        }
        flow
    }

    /// Finds what belongs together. What has lost its partner is not known.
    fn link(&mut self) {
        let (mut open, mut select): (Vec<(usize, Vec<usize>)>, Option<usize>) = (Vec::new(), None);
        let mut odd = Vec::new();
        for at in 0..self.kinds.len() {
            if self.inner[at] {
                continue;
            }
            match &self.kinds[at] {
                StatementKind::Label(number) => {
                    if let Some(number) = expression::count(number, &Registers::new()) {
                        self.labels.entry(number).or_insert(at);
                    }
                }
                StatementKind::If(_) | StatementKind::For(..) => open.push((at, Vec::new())),
                StatementKind::Else => match open.last_mut() {
                    Some((first, ends)) if matches!(self.kinds[*first], StatementKind::If(_)) && ends.is_empty() => {
                        ends.push(at)
                    }
                    _ => odd.push(at),
                },
                StatementKind::EndIf | StatementKind::EndFor => {
                    let wanted = matches!(self.kinds[at], StatementKind::EndIf);
                    match open.pop_if(|(first, _)| matches!(self.kinds[*first], StatementKind::If(_)) == wanted) {
                        Some((first, _)) if !wanted => {
                            self.partner.insert(first, at);
                            self.partner.insert(at, first);
                        }
                        Some((first, other)) => {
                            self.partner.insert(first, other.first().map_or(at, |other| other + 1));
                            other.first().and_then(|other| self.partner.insert(*other, at));
                        }
                        None => odd.push(at),
                    }
                }
                _ => {}
            }
            select = match self.kinds[at] {
                StatementKind::SelectCase(..) => Some(at),
                StatementKind::Case(_) | StatementKind::ElseCase(_) if select.is_none() => {
                    odd.push(at);
                    None
                }
                StatementKind::Case(_) | StatementKind::ElseCase(_) => select,
                _ => None,
            };
            if let Some(first) = select {
                self.first_case.insert(at, first);
                // The last of them says where it goes on.
                for case in first..=at {
                    self.partner.insert(case, at + 1);
                }
            }
        }
        for at in odd.into_iter().chain(open.into_iter().map(|(first, _)| first)) {
            self.kinds[at] = StatementKind::Unknown;
        }
    }

    /// Whether a statement runs a program that counts from where the robot stands.
    pub(super) fn counts_on(&self, at: usize) -> bool {
        statement::runs(&self.kinds[at]).into_iter().any(|name| self.calls.of(name).increments)
    }

    fn partner(&self, at: usize) -> Next {
        self.partner.get(&at).map_or(Next::Anywhere, |partner| Next::At(*partner))
    }

    fn label(&self, index: &[u8], state: &ModalState) -> Option<Next> {
        match expression::count(index, &state.registers) {
            // A controller stops at a label that is not there.
            Some(number) => self.labels.get(&number).map(|at| Next::At(*at)),
            None => Some(Next::Anywhere),
        }
    }

    /// What is known after statement `at`, and where it goes on: one way or several.
    pub(super) fn step(&self, at: usize, mut state: ModalState) -> Vec<(Next, ModalState)> {
        if self.inner[at] {
            // Its effects came with the motion that it belongs to.
            return vec![(Next::At(at + 1), state)];
        }
        match &self.kinds[at] {
            StatementKind::If(condition) => {
                let (rest, holds) = expression::condition(condition, &state.registers);
                let holds = holds.filter(|_| rest.trim_ascii().is_empty());
                either(holds, (Next::At(at + 1), state.clone()), (self.partner(at), state))
            }
            StatementKind::Else => vec![(self.partner(at), state)],
            StatementKind::When(text) => {
                let (rest, holds) = expression::condition(text, &state.registers);
                let (rest, holds) = match rest.trim_ascii_start().first() {
                    Some(b',') => (rest, holds),
                    _ => (statement::behind_condition(text), None),
                };
                let mut out = Vec::new();
                if holds != Some(true) {
                    out.push((Next::At(at + 1), state.clone()));
                }
                if holds != Some(false) {
                    out.extend(self.plain(at, &statement::guarded(rest), Next::At(at + 1), state));
                }
                out
            }
            StatementKind::SelectCase(..) | StatementKind::Case(_) | StatementKind::ElseCase(_) => self.case(at, state),
            StatementKind::For(register, from, to, down) => {
                let (first, last) =
                    (expression::value(from, &state.registers), expression::value(to, &state.registers));
                let enters = first.zip(last).map(|(first, last)| if *down { first >= last } else { first <= last });
                state.set(register, from);
                let mut over = state.clone();
                over.set(register, b"");
                let behind = match self.partner(at) {
                    Next::At(end) => Next::At(end + 1),
                    anywhere => anywhere,
                };
                either(enters, (Next::At(at + 1), state), (behind, over))
            }
            StatementKind::EndFor => self.again(at, state),
            kind => self.plain(at, kind, Next::At(at + 1), state),
        }
    }

    /// A statement that is not one of several that belong together; `behind` is what follows it.
    fn plain(
        &self,
        at: usize,
        kind: &StatementKind<'_>,
        behind: Next,
        mut state: ModalState,
    ) -> Vec<(Next, ModalState)> {
        match kind {
            StatementKind::Mark(mark) => state.mark = Marked::Known(Some(*mark)),
            StatementKind::Motion(motion) => {
                for name in &motion.calls {
                    state.call(self.calls.of(name));
                }
                if let Some(logic) = self.logic.get(&at) {
                    state.call(logic);
                }
                (state.standing, state.elsewhere) = (BTreeSet::from([at]), false);
                if motion.runs_others {
                    state.runs_beside();
                }
                if let Some(skip) = motion.skip.and_then(|label| self.label(label, &state)) {
                    return vec![(behind, state.clone()), (skip, state)];
                }
            }
            StatementKind::Select(frame, value) => state.select(*frame, expression::count(value, &state.registers)),
            StatementKind::Redefine(frame, index) => match expression::count(index, &state.registers) {
                Some(number) => drop(state.redefined.insert((*frame, number))),
                None => drop(state.all_redefined.insert(*frame)),
            },
            StatementKind::Register(register, value) => state.set(register, value),
            StatementKind::Jump(label) => return self.label(label, &state).map(|to| (to, state)).into_iter().collect(),
            StatementKind::Timeout(label) => {
                let to = self.label(label, &state);
                return [Some(behind), to].into_iter().flatten().map(|next| (next, state.clone())).collect();
            }
            StatementKind::Call(name) => state.call(self.calls.of(name)),
            StatementKind::Macro => state.call(&Called::unknown()),
            StatementKind::Concurrent(name) => {
                // What moves the robot does not run in parallel.
                let elsewhere = state.elsewhere;
                state.call(self.calls.of(name));
                state.elsewhere = elsewhere;
                state.runs_beside();
            }
            StatementKind::Displace(why) => state.displaced = Some(*why),
            StatementKind::RedefineAny => {
                state.selected = [None; 2];
                state.all_redefined.extend([Frame::User, Frame::Tool]);
            }
            StatementKind::End => return Vec::new(),
            StatementKind::Unknown => {
                state.forget();
                return vec![(Next::Anywhere, state)];
            }
            // Within a condition none of these is a statement.
            StatementKind::If(_)
            | StatementKind::Else
            | StatementKind::When(_)
            | StatementKind::SelectCase(..)
            | StatementKind::Case(_)
            | StatementKind::ElseCase(_) => {}
            StatementKind::For(..)
            | StatementKind::EndFor
            | StatementKind::EndIf
            | StatementKind::Label(_)
            | StatementKind::Plain => {}
        }
        vec![(behind, state)]
    }

    /// A case of a `SELECT`: its statement, and after all cases; or the next case.
    fn case(&self, at: usize, state: ModalState) -> Vec<(Next, ModalState)> {
        let first = self.first_case.get(&at).map(|first| &self.kinds[*first]);
        let Some(StatementKind::SelectCase(operand, first)) = first else { return vec![(Next::Anywhere, state)] };
        let (value, kind) = match &self.kinds[at] {
            StatementKind::SelectCase(..) => statement::case(first, &state.registers),
            StatementKind::Case(text) => statement::case(text, &state.registers),
            StatementKind::ElseCase(text) => (None, statement::guarded(text)),
            _ => (None, StatementKind::Unknown),
        };
        #[allow(clippy::float_cmp)] // whole numbers
        let holds = match &self.kinds[at] {
            StatementKind::ElseCase(_) => Some(true),
            _ => expression::value(operand, &state.registers).zip(value).map(|(a, b)| a == b),
        };
        let mut out = Vec::new();
        if holds != Some(true) {
            out.push((Next::At(at + 1), state.clone()));
        }
        if holds != Some(false) {
            out.extend(self.plain(at, &kind, self.partner(at), state));
        }
        out
    }

    /// `ENDFOR`: once more, or on.
    fn again(&self, at: usize, mut state: ModalState) -> Vec<(Next, ModalState)> {
        let Next::At(start) = self.partner(at) else { return vec![(Next::Anywhere, state)] };
        let StatementKind::For(register, _, to, down) = &self.kinds[start] else {
            return vec![(Next::Anywhere, state)];
        };
        // A bound in a register may have been changed on the way.
        let last = expression::value(to, &Registers::new());
        let number = expression::count(register, &state.registers);
        let counter = number.and_then(|number| state.registers.get(&number).copied());
        let next = counter.map(|counter| if *down { counter - 1.0 } else { counter + 1.0 });
        let enters = next.zip(last).map(|(next, last)| if *down { next >= last } else { next <= last });
        // What is left in the counter after the loop is the controller's affair.
        let mut over = state.clone();
        over.set(register, b"");
        match number {
            Some(number) => state.put(number, next),
            None => state.registers.clear(),
        }
        either(enters, (Next::At(start + 1), state), (Next::At(at + 1), over))
    }
}

/// One way, the other, or both.
fn either(holds: Option<bool>, so: (Next, ModalState), not: (Next, ModalState)) -> Vec<(Next, ModalState)> {
    match holds {
        Some(true) => vec![so],
        Some(false) => vec![not],
        None => vec![so, not],
    }
}

/// Which statements stand in blocks of point logic: after a motion that announces one, up to a line of dashes.
pub(super) fn inner(lines: &[Line<'_>], kinds: &[StatementKind<'_>]) -> Vec<bool> {
    let mut within = false;
    let one = |(line, kind): (&Line<'_>, &StatementKind<'_>)| {
        let was = within;
        within = match kind {
            StatementKind::Motion(motion) if !within => motion.point_logic,
            _ => within && !line.text.starts_with(b"---"),
        };
        was
    };
    lines.iter().zip(kinds).map(one).collect()
}
