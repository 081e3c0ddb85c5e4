//! Branches and loops: followed where their conditions are known, else taken once, in text order.

use super::eval::{RUN_TIME, Scope};
use super::lex::{Cursor, Kind};
use super::motion::{self, Call};
use super::run::{Flow, Runner, State};
use super::symbols::{Content, Upper};
use super::tree::Statement;
use super::value::Value;
use crate::text::Span;

/// A WHILE that goes round more often is taken for one whose end is known only at run time.
const MAX_ROUNDS: usize = 100_000;

/// A place in what is found.
#[derive(Clone, Copy)]
struct Marker {
    targets: usize,
    offsets: usize,
    motions: u32,
    arcs: usize,
}

impl<'a> Runner<'a> {
    pub(super) fn condition(
        &mut self,
        arms: &'a [(Span, Vec<Statement>)],
        otherwise: &'a [Statement],
        at: Span,
    ) -> Flow {
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
    pub(super) fn branches(&mut self, branches: impl Iterator<Item = &'a [Statement]>) -> Flow {
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

    pub(super) fn counted(
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
                if ((to - from) / step.flatten().unwrap_or(1.0)).abs() <= self.most_steps as f64 =>
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

    pub(super) fn count(&mut self, counter: usize, from: f64, to: f64, step: f64, body: &'a [Statement]) -> Flow {
        if step == 0.0 {
            return Flow::Next;
        }
        let mut value = from;
        while if step > 0.0 { value <= to } else { value >= to } {
            self.symbols.variables[counter].content = Content::Is(Value::Num(value, None));
            self.steps = self.steps.saturating_add(1);
            if self.steps > self.most_steps {
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

    pub(super) fn repeat(&mut self, condition: Span, body: &'a [Statement], at: Span) -> Flow {
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
    pub(super) fn depends(&self, scope: Scope, expression: Span, body: &'a [Statement]) -> bool {
        let Some(frame) = self.frames.last() else { return true };
        let mut assigned = Vec::new();
        self.symbols.assigned_names(frame.routine, body, &mut assigned);
        for callee in self.reached(frame.routine, body) {
            assigned.extend(self.symbols.changed_by(callee).iter().cloned());
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

    pub(super) fn choice(
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
    pub(super) fn matches(&mut self, scope: Scope, subject: &Value, values: Span) -> Option<bool> {
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
}
