//! Instructions that decide which instruction runs next: blocks, jumps and calls.

use super::assign::held;
use super::parser::{CONDITION, JOB_START, Parser};
use crate::Span;
use crate::ir::{
    Argument, Binary, Callee, Expression, ExpressionKind as Is, Fault, Slot, Statement, StatementKind, Switch,
};
use crate::lexeme::Lexeme;
use crate::reason::Reason;

/// The counter of a loop, with its first and last value and its step.
struct Count {
    kind: &'static [u8],
    slot: Slot,
    from: Expression,
    to: Expression,
    step: Expression,
}

impl Parser<'_, '_> {
    /// Reads `IF` and a condition, if they follow an instruction.
    pub(super) fn perhaps(&mut self, kinds: Vec<StatementKind>, start: Span) -> Option<Vec<StatementKind>> {
        if !CONDITION.iter().any(|word| self.take(word)) {
            return self.is_over().then_some(kinds);
        }
        let condition = self.condition();
        let place = self.since(start);
        let body = kinds.into_iter().map(|kind| Statement { kind, place }).collect();
        Some(vec![StatementKind::If { arms: vec![(condition, body)], otherwise: Vec::new() }])
    }

    /// A condition, with the lines after it that extend it.
    fn conditions(&mut self) -> Expression {
        let mut condition = self.condition();
        self.own.line += 1;
        while self.open() && ["ANDIF", "ORIF", "ANDEXP", "OREXP"].iter().any(|word| self.next_is(word)) {
            let start = self.here();
            self.at += 1;
            let more = self.condition();
            condition = self.expression_at(Is::Unknown(Reason::Input, vec![condition, more]), start);
            self.own.line += 1;
        }
        condition
    }

    /// A block up to the line that ends it, which is not read.
    fn body(&mut self, ends: &[&str], start: Span) -> Result<Vec<Statement>, Fault> {
        let body = self.block(ends)?;
        if self.own.line >= self.own.lines.len() {
            return Err(Fault { place: self.place(start), message: "a block without its end" });
        }
        Ok(body)
    }

    /// The arms from the present line on; `condition` reads all lines of the condition of an arm.
    fn arms(
        &mut self,
        ends: &[&str],
        start: Span,
        mut condition: impl FnMut(&mut Self) -> Expression,
    ) -> Result<StatementKind, Fault> {
        let (mut arms, mut otherwise) = (Vec::new(), Vec::new());
        loop {
            self.at = 1;
            let condition = match self.lexemes[0].text {
                b"ENDIF" | b"ENDSWITCH" => break,
                b"ELSE" | b"DEFAULT" => None,
                _ => Some(condition(self)),
            };
            self.own.line += usize::from(condition.is_none());
            let body = self.body(ends, start)?;
            match condition {
                Some(condition) => arms.push((condition, body)),
                None => otherwise = body,
            }
        }
        self.own.line += 1;
        Ok(StatementKind::If { arms, otherwise })
    }

    pub(super) fn conditional(&mut self, start: Span) -> Result<Vec<StatementKind>, Fault> {
        Ok(vec![self.arms(&["ELSEIF", "ELSEIFEXP", "ELSE", "ENDIF"], start, Self::conditions)?])
    }

    pub(super) fn repeated(&mut self, start: Span) -> Result<Vec<StatementKind>, Fault> {
        let condition = Some(self.conditions());
        let body = self.body(&["ENDWHILE"], start)?;
        self.own.line += 1;
        Ok(vec![StatementKind::Loop { condition, body }])
    }

    /// `I000=1 TO 10 STEP 2` or `I000 START= 1 TO 10`
    fn count(&mut self) -> Option<Count> {
        let target = self.target()?;
        let slot = target.single().filter(|_| self.take("START") | self.take("="))?;
        self.take("=");
        let from = self.expression();
        let to = if self.take("TO") { self.expression() } else { None };
        let step = if self.take("STEP") {
            self.take("=");
            self.expression()
        } else {
            Some(Expression::constant(1.0))
        };
        Some(Count { kind: target.kind, slot, from: from?, to: to?, step: step? })
    }

    /// `FOR` … `NEXT I000`
    pub(super) fn counted(&mut self, start: Span) -> Result<Vec<StatementKind>, Fault> {
        let count = self.count();
        let rest = self.rest(Reason::Computed);
        self.own.line += 1;
        let mut body = self.body(&["NEXT"], start)?;
        self.own.line += 1;
        let place = self.place(start);
        let Some(Count { kind, slot, from, to, step }) = count else {
            let condition = Some(Expression::unknown(Reason::Computed, vec![rest], place));
            return Ok(vec![self.not_understood(Vec::new(), place), StatementKind::Loop { condition, body }]);
        };
        let compute = |operator, by| {
            let read = Expression { kind: Is::Read(slot), place };
            Expression { kind: Is::Binary(operator, Box::new([read, by])), place }
        };
        // Which way it counts is known of a number only.
        let condition = match step.kind {
            Is::Number(by, _) | Is::Constant(by) if by > 0.0 => compute(Binary::AtMost, to),
            Is::Number(..) | Is::Constant(_) => compute(Binary::AtLeast, to),
            _ => Expression::unknown(Reason::Computed, vec![to], place),
        };
        let next = StatementKind::assign(slot, held(kind, compute(Binary::Add, step)));
        body.push(Statement { kind: next, place });
        let first = StatementKind::assign(slot, held(kind, from));
        Ok(vec![first, StatementKind::Loop { condition: Some(condition), body }])
    }

    pub(super) fn switch(&mut self, start: Span) -> Result<Vec<StatementKind>, Fault> {
        let ends = ["CASE", "DEFAULT", "ENDSWITCH"];
        let of = self.expression().unwrap_or_else(|| self.rest(Reason::Computed));
        self.own.line += 1;
        // Nothing stands before the first case.
        let before = self.body(&ends, start)?;
        let cases = self.arms(&ends, start, |parser| {
            let place = parser.since(start);
            let kind = match parser.expression().filter(|_| parser.is_over()) {
                Some(value) => Is::Binary(Binary::Equal, Box::new([of.clone(), value])),
                None => Is::Unknown(Reason::Computed, vec![of.clone()]),
            };
            parser.own.line += 1;
            Expression { kind, place }
        })?;
        Ok(before.into_iter().map(|statement| statement.kind).chain([cases]).collect())
    }

    /// The text up to the next blank: the name of a label or a job.
    pub(super) fn name(&mut self) -> String {
        let from = self.at;
        let mut end = None;
        while let Some(lexeme) = self.peek().filter(|lexeme| !lexeme.is("(")) {
            if end.is_some_and(|end| lexeme.span.start != end) {
                break;
            }
            end = Some(lexeme.span.end);
            self.at += 1;
        }
        joined(&self.lexemes[from..self.at])
    }

    /// The text before a condition.
    fn up_to_condition(&mut self) -> String {
        let from = self.at;
        while self.peek().is_some_and(|lexeme| !lexeme.text.starts_with(b"IF")) {
            self.at += 1;
        }
        joined(&self.lexemes[from..self.at])
    }

    /// The labels with the next name. If there are several, it is unknown which one the controller finds first.
    pub(super) fn labels_named(&mut self) -> Vec<String> {
        let name = self.name();
        let count = self.own.labels.get(&name).copied().unwrap_or(0);
        (0..count.max(1)).map(|at| format!("{name} {at}")).collect()
    }

    pub(super) fn jump(&mut self, start: Span) -> Option<Vec<StatementKind>> {
        let places: Vec<String> = if self.take("*") {
            self.labels_named()
        } else if self.next_is("LABEL") {
            self.up_to_condition();
            // To any of them, or to none.
            self.own.labels.iter().flat_map(|(name, count)| (0..*count).map(move |at| format!("{name} {at}"))).collect()
        } else if self.take_own_job() {
            self.own.restarts = true;
            vec![JOB_START.to_owned()]
        } else {
            // Another job, which does not come back here.
            let mut kinds = self.call(start)?;
            kinds.push(StatementKind::Return(None));
            return self.perhaps(kinds, start);
        };
        let last = places.len().saturating_sub(1);
        let jumps = places.into_iter().enumerate().map(|(at, to)| {
            let condition = (at < last).then(|| self.unknown(Reason::Input, start));
            StatementKind::Jump { to: to.into(), condition }
        });
        let jumps = jumps.collect();
        self.perhaps(jumps, start)
    }

    /// Takes `JOB:NAME` if that is the name of the present job, and nothing else.
    fn take_own_job(&mut self) -> bool {
        let from = self.at;
        let is_own = self.take("JOB") && self.take(":") && {
            let name = self.name();
            let jobs = self.own.jobs.get(name.as_bytes());
            self.own.job.is_some_and(|job| job.name == name.as_bytes()) && jobs.is_some_and(|jobs| jobs.len() == 1)
        };
        let ends = self.is_over() || CONDITION.iter().any(|word| self.next_is(word));
        if !(is_own && ends) {
            self.at = from;
        }
        is_own && ends
    }

    /// `JOB:NAME`, with its arguments.
    pub(super) fn call(&mut self, start: Span) -> Option<Vec<StatementKind>> {
        let name = if self.take("JOB") {
            self.expect(":")?;
            self.name()
        } else {
            self.up_to_condition()
        };
        // `ARGF"1;2"`, `(1, 2)`, `ARGFB001` are values; with another user frame the job runs elsewhere.
        let from = self.at;
        let arguments = self.named(&CONDITION);
        let elsewhere = self.lexemes[from..self.at].iter().any(|lexeme| lexeme.is("UF"));
        let call = match self.own.jobs.get(name.as_bytes()).map(Vec::as_slice) {
            Some(&[one]) => {
                self.called.insert(one);
                self.routine(Callee::Function(one), arguments, start)
            }
            several => {
                let several = several.unwrap_or_default().to_vec();
                self.called.extend(several);
                self.foreign_call(&name, arguments, start)
            }
        };
        // The frame in force after the call is not followed either.
        let moved = elsewhere.then(|| StatementKind::assign(Switch::Frame.slot(), self.unknown(Reason::Frame, start)));
        Some(moved.into_iter().chain([call]).collect())
    }

    /// A call of a routine that is in no file.
    pub(super) fn foreign_call(&mut self, name: &str, arguments: Vec<Expression>, start: Span) -> StatementKind {
        let place = self.since(start);
        let callee = self.foreign(name.into(), place);
        self.routine(callee, arguments, start)
    }

    fn routine(&self, callee: Callee, arguments: Vec<Expression>, start: Span) -> StatementKind {
        let arguments = arguments.into_iter().map(Argument::from).collect();
        StatementKind::Evaluate(self.expression_at(Is::Call(callee, arguments), start))
    }

    /// `MACRO1 MJ#(3) ARGF1`
    pub(super) fn macro_call(&mut self, start: Span) -> StatementKind {
        let end = self.lexemes.iter().position(|lexeme| lexeme.text.starts_with(b"ARGF"));
        let name = joined(&self.lexemes[..end.unwrap_or(self.lexemes.len())]);
        let arguments = self.named(&[]);
        self.foreign_call(&name, arguments, start)
    }
}

/// Lexemes without the blanks between them.
fn joined(lexemes: &[Lexeme<'_>]) -> String {
    lexemes.iter().map(|lexeme| String::from_utf8_lossy(lexeme.text)).collect()
}
