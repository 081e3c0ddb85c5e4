//! Instructions that assign values to variables.

use super::builtin;
use super::expression::{Variable, Variables};
use super::header::{ROBOT, user};
use super::parser::Parser;
use crate::Span;
use crate::cursor::text;
use crate::ir::{Binary, Expression, ExpressionKind as Is, Slot, StatementKind};
use crate::lexeme::LexemeKind;
use crate::reason::Reason;

impl Variables {
    /// Makes the variables unknown. If there are several, it is unknown which one is changed.
    pub(super) fn lost(self, reads: impl IntoIterator<Item = Expression>, reason: Reason) -> StatementKind {
        let reads = reads.into_iter().chain(self.index).collect();
        StatementKind::Opaque { writes: Some(self.slots), reads, reason }
    }
}

impl Parser<'_, '_> {
    /// The variables to which an instruction assigns a value.
    pub(super) fn target(&mut self) -> Option<Variables> {
        let target = self.variables()?;
        self.own.written.extend(&target.slots);
        Some(target)
    }

    /// The variable, if it is a single one and nothing of the line is left.
    fn single(&self, target: &Variables) -> Option<Slot> {
        target.single().filter(|_| self.is_over())
    }

    /// Makes the target unknown, because its value is not computed here. It depends on `value` and on the rest of the line.
    fn computed(&mut self, target: Variables, value: Option<Expression>) -> Vec<StatementKind> {
        let rest = self.rest(Reason::Computed);
        vec![target.lost(value.into_iter().chain([rest]), Reason::Computed)]
    }

    /// `SET target value` and its like.
    pub(super) fn set(&mut self, of: impl FnOnce(Expression, Expression) -> Expression) -> Option<Vec<StatementKind>> {
        let start = self.here();
        // Outputs and flags are read at run time only.
        let outputs = [&b"OT"[..], b"OG", b"FL", b"MREG", b"TF"];
        if self.peek().is_some_and(|lexeme| outputs.iter().any(|word| lexeme.text.starts_with(word))) {
            return Some(vec![StatementKind::Evaluate(self.rest(Reason::Input))]);
        }
        let target = self.target()?;
        let has_element = self.next_is("(") && matches!(target.kind, b"P" | b"BP" | b"EX");
        self.take("EXPRESS");
        let place = self.since(start);
        let value = self.expression();
        let Some(slot) = self.single(&target).filter(|_| !has_element) else {
            return Some(self.computed(target, value));
        };
        let old = Expression { kind: Is::Read(slot), place };
        let value = of(old, value.unwrap_or_else(|| Expression::constant(0.0)));
        Some(vec![StatementKind::assign(slot, held(target.kind, value))])
    }

    /// `ADD target value` and its like.
    pub(super) fn combine(&mut self, operator: Binary) -> Option<Vec<StatementKind>> {
        self.set(|old, value| {
            let place = value.place;
            Expression { kind: Is::Binary(operator, Box::new([old, value])), place }
        })
    }

    /// `SETE P012 (3) 2000`: micrometres and ten-thousandths of a degree.
    pub(super) fn set_element(&mut self) -> Option<Vec<StatementKind>> {
        let target = self.target()?;
        let element = self.element();
        let value = self.expression();
        let slot = self.single(&target).filter(|_| target.kind == b"P");
        match (slot, element, value) {
            (Some(slot), Some(at), Some(value)) => {
                let literal = matches!(value.kind, Is::Number(..));
                let value = if literal { value } else { held(b"D", value) };
                let (path, value) = (vec![Expression::constant(f64::from(at))], value.with(Binary::Multiply, unit(at)));
                Some(vec![StatementKind::Assign { slot, path, value }])
            }
            (.., value) => Some(self.computed(target, value)),
        }
    }

    /// `(3)`: an element of a position, from 0.
    fn element(&mut self) -> Option<u8> {
        let [open, number, close, ..] = self.lexemes.get(self.at..)? else { return None };
        let digits = std::str::from_utf8(number.text).ok()?;
        let at = digits.parse::<u8>().ok().filter(|at| (1..=6).contains(at));
        let at = at.filter(|_| open.is("(") && number.kind == LexemeKind::Number && close.is(")"))?;
        self.at += 3;
        Some(at - 1)
    }

    /// `GETE D000 P012 (3)`
    pub(super) fn get_element(&mut self, start: Span) -> Option<Vec<StatementKind>> {
        let target = self.target()?;
        let from = self.operand()?;
        let element = self.element();
        let (Some(slot), Some(at)) = (self.single(&target), element) else {
            return Some(self.computed(target, Some(from)));
        };
        let item = self.expression_at(Is::Item(Box::new([from, Expression::constant(f64::from(at))])), start);
        let value = item.with(Binary::Multiply, 1.0 / unit(at));
        Some(vec![StatementKind::assign(slot, held(target.kind, value))])
    }

    /// `CLEAR B003 10`: a number of variables of a kind, from one on.
    pub(super) fn clear(&mut self) -> Option<Vec<StatementKind>> {
        let from = self.next_variable().filter(|from| from.number.is_some())?;
        self.at += 1;
        let slots = self.slots(Variable { number: None, ..from });
        self.own.written.extend(&slots);
        Some(self.computed(Variables { kind: from.kind, slots, index: None }, None))
    }

    /// `SFTON P012 UF#(1)`
    pub(super) fn shift(&mut self, start: Span) -> Option<Vec<StatementKind>> {
        let by = self.operand()?;
        let base = self.own.job.map_or(ROBOT, |job| job.base()).to_owned();
        let frame = match self.peek() {
            None => base,
            Some(lexeme) if lexeme.is("BF") => base,
            Some(lexeme) if lexeme.is("RF") => ROBOT.to_owned(),
            Some(lexeme) if lexeme.is("UF") => {
                let number = self.lexemes.get(self.at + 3).filter(|number| number.kind == LexemeKind::Number);
                number.map_or(String::new(), |number| user(&text(number.text)))
            }
            _ => String::new(),
        };
        self.at = self.lexemes.len();
        let named = Expression { kind: Is::Text(frame.into_bytes().into()), place: by.place };
        Some(vec![StatementKind::Evaluate(Expression::builtin(builtin::SHIFT, vec![by, named], self.since(start)))])
    }
}

/// The value as a variable of a kind stores it. If an integer variable gets a number that is not whole, its rounding is unknown.
pub(super) fn held(kind: &[u8], value: Expression) -> Expression {
    if !matches!(kind, b"B" | b"I" | b"D") {
        return value;
    }
    let place = value.place;
    Expression::builtin(builtin::WHOLE, vec![value], place)
}

/// Millimetres or degrees for a count in an element of a position.
fn unit(element: u8) -> f64 {
    if element < 3 { 1e-3 } else { 1e-4 }
}
