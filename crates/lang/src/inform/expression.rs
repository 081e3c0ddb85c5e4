//! Variables, expressions and conditions.

use super::parser::Parser;
use crate::cursor::{Level, SUM};
use crate::ir::{Binary, Expression, ExpressionKind as Is, Slot, Unary};
use crate::lexeme::{Lexeme, LexemeKind};
use crate::reason::Reason;

/// A variable as it is written.
#[derive(Clone, Copy)]
pub(super) struct Variable {
    /// Whether it is a local variable of the job.
    pub(super) is_local: bool,
    pub(super) kind: &'static [u8],
    /// Its number; `None` if an index chooses one of the kind.
    pub(super) number: Option<u32>,
}

/// `P012`, `LB000`, or `LP`, after which an index has to follow. `PX012` is `P012` with its other axes.
pub(super) fn variable(word: &[u8]) -> Option<Variable> {
    const KINDS: [&[u8]; 8] = [b"B", b"I", b"D", b"R", b"S", b"P", b"BP", b"EX"];
    let (is_local, word) = word.strip_prefix(b"L").map_or((false, word), |word| (true, word));
    let digits = word.iter().position(u8::is_ascii_digit).unwrap_or(word.len());
    let (kind, number) = word.split_at(digits);
    let kind = if kind == b"PX" { b"P" } else { kind };
    let kind = KINDS.into_iter().find(|known| *known == kind)?;
    let number = if number.is_empty() { None } else { Some(std::str::from_utf8(number).ok()?.parse().ok()?) };
    Some(Variable { is_local, kind, number })
}

/// The number of a teaching position: `C00001`.
fn taught(word: &[u8]) -> Option<u32> {
    std::str::from_utf8(word.strip_prefix(b"C")?).ok()?.parse().ok()
}

/// One variable, or several from which an index chooses one.
pub(super) struct Variables {
    pub(super) kind: &'static [u8],
    pub(super) slots: Vec<Slot>,
    pub(super) index: Option<Expression>,
}

impl Variables {
    /// The variable, if no index chooses it.
    pub(super) fn single(&self) -> Option<Slot> {
        self.slots.first().copied().filter(|_| self.index.is_none())
    }
}

/// Operators that join comparisons, loosest first.
const JOINED: [Level; 2] = [&[("OR", Binary::Or)], &[("AND", Binary::And)]];

/// Operators of one comparison.
const COMPARED: Level = &[
    ("=", Binary::Equal),
    ("==", Binary::Equal),
    ("<>", Binary::NotEqual),
    ("<=", Binary::AtMost),
    (">=", Binary::AtLeast),
    ("<", Binary::Less),
    (">", Binary::Greater),
];

/// Operators of numbers, loosest first.
const NUMBERS: [Level; 2] = [SUM, &[("*", Binary::Multiply), ("/", Binary::Divide)]];

impl<'a> Parser<'a, '_> {
    /// The next lexeme as a variable; `None` if it is not one.
    pub(super) fn next_variable(&self) -> Option<Variable> {
        variable(self.peek()?.text).filter(|variable| variable.number.is_some() || self.second_is("["))
    }

    /// All variables that a name may mean: those of a kind if it has no number.
    pub(super) fn slots(&mut self, variable: Variable) -> Vec<Slot> {
        let Variable { is_local, kind, number } = variable;
        let Some(number) = number else {
            let own = self.own.locals.iter().filter(|((known, _), _)| is_local && *known == kind);
            let others = self.own.globals.iter().filter(|((known, _), _)| !is_local && *known == kind);
            return own.map(|(_, at)| Slot::Local(*at)).chain(others.map(|(_, slot)| *slot)).collect();
        };
        if !is_local {
            return vec![self.own.globals.get(&(kind, number)).copied().unwrap_or(Slot::Global(0))];
        }
        let next = self.own.locals.len() as u32;
        vec![Slot::Local(*self.own.locals.entry((kind, number)).or_insert(next))]
    }

    /// Reads `P012`, or `P[I000]`, which may be any variable of its kind.
    pub(super) fn variables(&mut self) -> Option<Variables> {
        let variable = self.next_variable()?;
        self.at += 1;
        let index = if variable.number.is_none() && self.take("[") {
            Some(self.expression().filter(|_| self.take("]"))?)
        } else {
            None
        };
        Some(Variables { kind: variable.kind, slots: self.slots(variable), index })
    }

    /// The rest of the line as an unknown expression with everything that it names.
    pub(super) fn rest(&mut self, reason: Reason) -> Expression {
        let start = self.here();
        let parts = self.named(&[]);
        self.expression_at(Is::Unknown(reason, parts), start)
    }

    /// The expressions that the rest of the line names.
    pub(super) fn named(&mut self, ends: &[&str]) -> Vec<Expression> {
        let mut parts = Vec::new();
        while let Some(lexeme) = self.peek().filter(|lexeme| !ends.iter().any(|end| lexeme.is(end))) {
            let from = self.at;
            if let Some(operand) = self.operand() {
                parts.push(operand);
                continue;
            }
            self.at = from + 1;
            // `ARGFB001` names `B001`.
            let argument = lexeme.text.strip_prefix(b"ARGF").and_then(variable);
            if let Some(argument) = argument.filter(|argument| argument.number.is_some()) {
                let slots = self.slots(argument);
                parts.extend(slots.into_iter().map(|slot| self.expression_at(Is::Read(slot), lexeme.span)));
            }
        }
        parts
    }

    /// A position: `C00001`, `P012`, `P[I000]`.
    pub(super) fn position(&mut self) -> Option<Expression> {
        let lexeme = self.peek()?;
        if let Some(number) = taught(lexeme.text) {
            self.at += 1;
            let known = self.own.job.and_then(|job| job.positions.get(&number).cloned());
            return Some(known.unwrap_or_else(|| self.unknown(Reason::Unset, lexeme.span)));
        }
        self.next_variable().filter(|variable| variable.kind == b"P").and_then(|_| self.operand())
    }

    /// Conditions joined by `AND` and `OR`; a condition that is not understood is unknown.
    pub(super) fn condition(&mut self) -> Expression {
        let (start, from) = (self.here(), self.at);
        if let Some(condition) = self.binary(&JOINED, Self::compared).filter(|_| self.is_over()) {
            return condition;
        }
        self.at = from;
        let rest = self.rest(Reason::Input);
        self.expression_at(rest.kind, start)
    }

    fn compared(&mut self) -> Option<Expression> {
        let (start, from) = (self.here(), self.at);
        let left = self.expression();
        let operator = COMPARED.iter().find(|(sign, _)| self.next_is(sign));
        if let (Some(left), Some((_, operator))) = (left, operator) {
            self.at += 1;
            let right = self.expression()?;
            return Some(self.expression_at(Is::Binary(*operator, Box::new([left, right])), start));
        }
        self.at = from;
        self.expect("(")?;
        self.inner(|parser| parser.binary(&JOINED, Self::compared)).filter(|_| self.take(")"))
    }

    pub(super) fn expression(&mut self) -> Option<Expression> {
        self.binary(&NUMBERS, Self::operand)
    }

    pub(super) fn operand(&mut self) -> Option<Expression> {
        self.inner(Self::shallow_operand)
    }

    fn shallow_operand(&mut self) -> Option<Expression> {
        let lexeme = self.peek()?;
        let start = lexeme.span;
        if lexeme.kind == LexemeKind::Name {
            return self.word(lexeme);
        }
        self.at += 1;
        match lexeme.kind {
            LexemeKind::Number => Some(self.number(None, lexeme, Reason::NotUnderstood)),
            LexemeKind::Text => Some(self.expression_at(Is::Text(lexeme.text.into()), start)),
            LexemeKind::Sign if lexeme.text == b"(" => self.expression().filter(|_| self.take(")")),
            LexemeKind::Sign if lexeme.text == b"-" => {
                let number = self.peek().filter(|next| next.kind == LexemeKind::Number && next.span.start == start.end);
                if let Some(number) = number {
                    self.at += 1;
                    return Some(self.number(Some(start), number, Reason::NotUnderstood));
                }
                let operand = self.operand()?;
                Some(self.expression_at(Is::Unary(Unary::Negate, Box::new(operand)), start))
            }
            _ => {
                self.at -= 1;
                None
            }
        }
    }

    fn word(&mut self, lexeme: Lexeme<'a>) -> Option<Expression> {
        let start = lexeme.span;
        if self.next_variable().is_some() {
            let Variables { slots, index, .. } = self.variables()?;
            let mut read = slots.into_iter().map(|slot| self.expression_at(Is::Read(slot), start));
            let Some(index) = index else { return read.next() };
            // Which one is not known: it may be any.
            let parts = read.chain([index]).collect();
            return Some(self.expression_at(Is::Unknown(Reason::Computed, parts), start));
        }
        self.at += 1;
        if let Some(position) = self.own.job.and_then(|job| job.positions.get(&taught(lexeme.text)?).cloned()) {
            return Some(position);
        }
        let kind = match lexeme.text {
            _ if self.take("#") => {
                // `IN#(1)`: a signal, by its number.
                let number = if self.next_is("(") { self.operand() } else { None };
                Is::Unknown(Reason::Input, number.into_iter().collect())
            }
            b"ON" => Is::Truth(true),
            b"OFF" => Is::Truth(false),
            [b'$', ..] | [b'F', b'L', ..] | [b'T', b'M', ..] => Is::Unknown(Reason::Input, Vec::new()),
            _ => {
                self.at -= 1;
                return None;
            }
        };
        Some(self.expression_at(kind, start))
    }
}
