//! Expressions. Each is read once, into a tree with the places of its names and numbers.

use super::lex::{Cursor, LexemeKind};
use super::names;
use super::value::{INERTIA, Literal, Name, POSE, Value, upper};
use crate::Reason;
use deflex_lang::ir::{Binary, SourceSpan};
use deflex_text::{Span, number};

/// Largest nesting depth of brackets.
const MAX_DEPTH: usize = 40;

#[derive(Clone, Debug)]
pub(super) enum Expression {
    /// A literal.
    Known(Value),
    /// A variable, or a part of it.
    Path(Box<Path>),
    Call(Box<Call>),
    /// `{[TYPE:] X 1.0, Y A, …}`
    Aggregate(Vec<(Name, Expression)>),
    /// Operands with operators of one level, from left to right; without an operator it is an expression in brackets.
    Chain(Box<Expression>, Vec<(Operator, Expression)>),
    /// Its value is known only at run time; with the expressions that it reads.
    Unknown(Reason, Vec<Expression>),
    /// No controller loads it: the reason, its place, and the expressions that it reads.
    Refused(Reason, Span, Vec<Expression>),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Operator {
    /// `frame : position`
    Frame,
    Other(Binary),
}

/// `name[i,j].component…`
#[derive(Clone, Debug)]
pub(super) struct Path {
    pub(super) name: Name,
    /// Place of the name.
    pub(super) at: Span,
    pub(super) steps: Vec<PathStep>,
}

#[derive(Clone, Debug)]
pub(super) enum PathStep {
    /// Without an expression, `name[]`, it is the whole array.
    Index(Vec<Expression>),
    Component(Name, Span),
}

/// `name(arguments)`
#[derive(Clone, Debug)]
pub(super) struct Call {
    pub(super) name: Name,
    /// The text from the end of the name to the end of the statement.
    pub(super) rest: Span,
    /// `None` for an argument that is left out.
    pub(super) arguments: Vec<Option<Expression>>,
}

/// `path = value`
#[derive(Clone, Debug)]
pub(super) struct Setting {
    pub(super) to: Path,
    pub(super) value: Expression,
}

/// A part of an expression or a statement.
#[derive(Clone, Copy, Debug)]
pub(super) enum ExpressionPart<'e> {
    Path(&'e Path),
    Call(&'e Call),
    Other(&'e Expression),
}

impl ExpressionPart<'_> {
    /// Number of complete numeric positions in it, without those in its parts.
    pub(super) fn positions(&self) -> usize {
        let Self::Other(Expression::Aggregate(fields)) = self else { return 0 };
        let is_number = |value: &Expression| matches!(value, Expression::Known(Value::Number(_, Some(_))));
        let is_named = |part: &[u8]| fields.iter().any(|(name, value)| name[..] == *part && is_number(value));
        usize::from(POSE.into_iter().all(is_named))
    }
}

impl Expression {
    pub(super) fn unknown(why: Reason) -> Self {
        Self::Unknown(why, Vec::new())
    }

    /// This expression and another, joined by an operator.
    pub(super) fn with(self, operator: Binary, other: Self) -> Self {
        Self::Chain(Box::new(self), vec![(Operator::Other(operator), other)])
    }

    /// The expressions of which it consists.
    fn parts(&self) -> Vec<&Self> {
        match self {
            Self::Known(_) => Vec::new(),
            Self::Path(path) => path.indices().collect(),
            Self::Call(call) => call.arguments.iter().flatten().collect(),
            Self::Aggregate(fields) => fields.iter().map(|(_, value)| value).collect(),
            Self::Chain(first, rest) => std::iter::once(&**first).chain(rest.iter().map(|(_, of)| of)).collect(),
            Self::Unknown(_, parts) | Self::Refused(_, _, parts) => parts.iter().collect(),
        }
    }

    /// Calls `of` with the expression and all its parts.
    pub(super) fn each<'e>(&'e self, of: &mut impl FnMut(ExpressionPart<'e>)) {
        match self {
            Self::Path(path) => return path.each(of),
            Self::Call(call) => of(ExpressionPart::Call(call)),
            _ => of(ExpressionPart::Other(self)),
        }
        self.parts().into_iter().for_each(|part| part.each(of));
    }

    /// Whether it is or contains a position without some components.
    pub(super) fn leaves_components_out(&self) -> bool {
        let Self::Aggregate(fields) = self else { return self.parts().into_iter().any(Self::leaves_components_out) };
        let named = fields.iter().filter(|(name, _)| POSE.contains(&&name[..])).count();
        let is_part = |(name, value): &(Name, Self)| name[..] != *INERTIA && value.leaves_components_out();
        (1..POSE.len()).contains(&named) || fields.iter().any(is_part)
    }

    /// The same for the target of a motion. The target itself is assigned to no data, but an argument of a function in it may be.
    pub(super) fn gives_components_out(&self) -> bool {
        match self {
            Self::Aggregate(_) => self.parts().into_iter().any(Self::leaves_components_out),
            _ => self.leaves_components_out(),
        }
    }
}

impl Path {
    pub(super) fn each<'e>(&'e self, of: &mut impl FnMut(ExpressionPart<'e>)) {
        of(ExpressionPart::Path(self));
        self.indices().for_each(|index| index.each(of));
    }

    fn indices(&self) -> impl Iterator<Item = &Expression> {
        let all = self.steps.iter().filter_map(|step| if let PathStep::Index(all) = step { Some(all) } else { None });
        all.flatten()
    }

    /// Its last component.
    pub(super) fn component(&self) -> Option<&Name> {
        self.steps.iter().rev().find_map(|step| if let PathStep::Component(name, _) = step { Some(name) } else { None })
    }
}

impl Call {
    /// Place of the name.
    pub(super) fn at(&self) -> Span {
        let end = self.rest.start as usize;
        Span::new(end - self.name.len(), end)
    }

    /// Names of the variables among the arguments, with the place of each argument.
    pub(super) fn variables(&self) -> impl Iterator<Item = (usize, &Name)> {
        self.arguments.iter().enumerate().filter_map(|(at, given)| match given {
            Some(Expression::Path(path)) => Some((at, &path.name)),
            _ => None,
        })
    }
}

impl Cursor<'_> {
    /// The rest of the span as one expression.
    pub(super) fn whole(mut self) -> Expression {
        let mut from_start = self;
        let value = self.expression();
        if self.is_done() { value } else { Expression::Unknown(Reason::Expression, from_start.parts(LexemeKind::End)) }
    }

    /// Comparisons and logical operators. They are read as one level, and an expression that mixes them without brackets is unknown.
    pub(super) fn expression(&mut self) -> Expression {
        let first = self.sum();
        let mut rest = Vec::new();
        while let Some(operator) = self.logic() {
            self.next();
            rest.push((operator, self.sum()));
        }
        let Some(&(operator, _)) = rest.first() else { return first };
        let joins = matches!(operator, Some(Binary::And | Binary::Or | Binary::Xor));
        let one = rest.len() == 1 || joins && rest.iter().all(|(other, _)| *other == operator);
        match operator {
            Some(operator) if one => {
                let rest = rest.into_iter().map(|(_, value)| (Operator::Other(operator), value));
                Expression::Chain(Box::new(first), rest.collect())
            }
            _ => {
                let all = std::iter::once(first).chain(rest.into_iter().map(|(_, value)| value));
                Expression::Unknown(Reason::Computed, all.collect())
            }
        }
    }

    /// The next comparison or logical operator; `Some(None)` for one whose result is not evaluated.
    fn logic(&self) -> Option<Option<Binary>> {
        let lexeme = self.peek();
        Some(match lexeme.kind {
            LexemeKind::Equal => Some(Binary::Equal),
            LexemeKind::Unequal => Some(Binary::NotEqual),
            LexemeKind::AtMost => Some(Binary::AtMost),
            LexemeKind::AtLeast => Some(Binary::AtLeast),
            LexemeKind::Mark(b'<') => Some(Binary::Less),
            LexemeKind::Mark(b'>') => Some(Binary::Greater),
            LexemeKind::Word => match &upper(self.text(lexeme))[..] {
                b"AND" => Some(Binary::And),
                b"OR" => Some(Binary::Or),
                b"EXOR" => Some(Binary::Xor),
                b"B_AND" | b"B_OR" | b"B_EXOR" => None,
                _ => return None,
            },
            _ => return None,
        })
    }

    fn chain(&mut self, levels: &[&[(u8, Operator)]]) -> Expression {
        let Some((operators, tighter)) = levels.split_first() else { return self.unary() };
        let first = self.chain(tighter);
        let mut rest = Vec::new();
        while let LexemeKind::Mark(mark) = self.peek().kind
            && let Some((_, operator)) = operators.iter().find(|(known, _)| *known == mark)
        {
            self.next();
            rest.push((*operator, self.chain(tighter)));
        }
        if rest.is_empty() { first } else { Expression::Chain(Box::new(first), rest) }
    }

    /// `sum`, `product` and `geometric` of the grammar, from the loosest operators to the tightest.
    fn sum(&mut self) -> Expression {
        self.chain(&[
            &[(b'+', Operator::Other(Binary::Add)), (b'-', Operator::Other(Binary::Subtract))],
            &[(b'*', Operator::Other(Binary::Multiply)), (b'/', Operator::Other(Binary::Divide))],
            &[(b':', Operator::Frame)],
        ])
    }

    fn deeper<T>(&mut self, read: impl FnOnce(&mut Self) -> T) -> T {
        self.depth += 1;
        let inner = read(self);
        self.depth -= 1;
        inner
    }

    /// `unary` and `primary` of the grammar.
    fn unary(&mut self) -> Expression {
        let lexeme = self.peek();
        if self.depth > MAX_DEPTH {
            self.next();
            return Expression::unknown(Reason::ExpressionTooDeep);
        }
        let known = match lexeme.kind {
            LexemeKind::Word => return self.word(),
            LexemeKind::Mark(b'{') => return self.aggregate(),
            LexemeKind::Mark(sign @ (b'-' | b'+')) => {
                self.next();
                match self.accept(LexemeKind::Number) {
                    Some(digits) => self.literal(lexeme.span().to(digits.span())),
                    None => {
                        let (zero, of) = (Expression::Known(Value::Number(0.0, None)), self.deeper(Self::unary));
                        return zero.with(if sign == b'-' { Binary::Subtract } else { Binary::Add }, of);
                    }
                }
            }
            LexemeKind::Mark(b'(') => {
                self.next();
                let inner = self.deeper(Self::expression);
                self.accept_mark(b')');
                return Expression::Chain(Box::new(inner), Vec::new());
            }
            LexemeKind::Mark(b'#') => {
                self.next();
                let word = self.next();
                Value::constant(self.text(word))
            }
            kind => {
                self.next();
                match kind {
                    LexemeKind::Number => self.literal(lexeme.span()),
                    LexemeKind::Bits => bits(self.text(lexeme)),
                    LexemeKind::Text => Value::unknown(Reason::Computed),
                    _ => Value::unknown(Reason::Expression),
                }
            }
        };
        Expression::Known(known)
    }

    fn word(&mut self) -> Expression {
        if self.accept_word(b"NOT") || self.accept_word(b"B_NOT") {
            return self.deeper(Self::unary).with(Binary::Equal, Expression::Known(Value::Bool(false)));
        }
        if self.is_at(b"TRUE") || self.is_at(b"FALSE") {
            let is_true = self.is_at(b"TRUE");
            self.next();
            return Expression::Known(Value::Bool(is_true));
        }
        match self.call() {
            Some(call) => Expression::Call(Box::new(call)),
            None => self.path().map_or(Expression::unknown(Reason::NotAName), |path| Expression::Path(Box::new(path))),
        }
    }

    /// `name[i,j].component…`
    pub(super) fn path(&mut self) -> Option<Path> {
        let first = self.accept(LexemeKind::Word)?;
        let mut path = Path { name: upper(self.text(first)), at: first.span(), steps: Vec::new() };
        loop {
            if self.accept_mark(b'[') {
                let mut indices = Vec::new();
                while !self.is_done() && !self.accept_mark(b']') {
                    if !self.accept_mark(b',') {
                        indices.push(self.deeper(Self::expression));
                    }
                }
                path.steps.push(PathStep::Index(indices));
            } else if self.accept_mark(b'.') {
                let word = self.accept(LexemeKind::Word)?;
                path.steps.push(PathStep::Component(upper(self.text(word)), word.span()));
            } else {
                return Some(path);
            }
        }
    }

    /// `name(arguments)`; if it is not a call, the cursor does not move.
    pub(super) fn call(&mut self) -> Option<Call> {
        let mut inner = *self;
        let name = inner.accept(LexemeKind::Word)?;
        let (name, rest) = (upper(self.text(name)), inner.rest());
        if !inner.accept_mark(b'(') {
            return None;
        }
        let mut arguments = Vec::new();
        while !inner.is_done() && !inner.accept_mark(b')') {
            if inner.accept_mark(b',') {
                arguments.push(None);
                continue;
            }
            arguments.push(Some(inner.deeper(Self::expression)));
            if !inner.accept_mark(b',') && inner.peek().kind != LexemeKind::Mark(b')') {
                inner.next();
            }
        }
        *self = inner;
        Some(Call { name, rest, arguments })
    }

    fn aggregate(&mut self) -> Expression {
        let start = self.rest().start;
        self.next();
        let mut inner = *self;
        if inner.accept(LexemeKind::Word).is_some() && inner.accept_mark(b':') {
            *self = inner;
        }
        let mut fields: Vec<(Name, Expression)> = Vec::with_capacity(POSE.len());
        while let Some(name) = self.accept(LexemeKind::Word) {
            let name = upper(self.text(name));
            self.accept_brackets();
            let value = self.deeper(Self::sum);
            fields.push((name, value));
            if !self.accept_mark(b',') {
                break;
            }
        }
        let is_closed = self.accept_mark(b'}');
        let is_twice = (1..fields.len()).any(|at| fields[..at].iter().any(|(name, _)| *name == fields[at].0));
        if is_closed && !is_twice {
            return Expression::Aggregate(fields);
        }
        let mut values: Vec<Expression> = fields.into_iter().map(|(_, value)| value).collect();
        if is_twice {
            return Expression::Refused(Reason::ComponentTwice, Span { start, end: self.rest().start }, values);
        }
        // The rest is not understood, but the data that it names are read.
        values.append(&mut self.deeper(|inner| inner.parts(LexemeKind::Mark(b'}'))));
        self.next();
        Expression::Unknown(Reason::Aggregate, values)
    }

    /// The expressions, up to a lexeme of this kind, in a text that is not understood as a whole.
    pub(super) fn parts(&mut self, end: LexemeKind) -> Vec<Expression> {
        let mut parts = Vec::new();
        while !self.is_done() && self.peek().kind != end {
            let lexeme = self.peek();
            let word = upper(self.text(lexeme));
            let is_call = || {
                let mut inner = *self;
                inner.next();
                inner.peek().kind == LexemeKind::Mark(b'(')
            };
            let is_statement = names::HARMLESS_STATEMENTS.contains(&&word[..]) || matches!(&word[..], b"FOR" | b"SEC");
            let begins = matches!(lexeme.kind, LexemeKind::Word | LexemeKind::Mark(b'{'));
            if !begins || is_statement || names::NO_CALLS.contains(&&word[..]) && is_call() {
                self.next();
            } else {
                parts.push(self.expression());
            }
        }
        parts
    }

    /// A list of expressions separated by commas, and the expressions in any text after the last one.
    pub(super) fn list(mut self) -> Vec<Expression> {
        let mut all = vec![self.expression()];
        while self.accept_mark(b',') {
            all.push(self.expression());
        }
        if !self.is_done() {
            all.push(Expression::Unknown(Reason::Expression, self.parts(LexemeKind::End)));
        }
        all
    }

    /// `path = value`
    pub(super) fn setting(&mut self) -> Option<Setting> {
        let to = self.path()?;
        self.accept_mark(b'=').then(|| Setting { to, value: self.expression() })
    }

    /// A number with its token.
    fn literal(&self, span: Span) -> Value {
        let text = &self.bytes[span.range()];
        let is_negative = text.first() == Some(&b'-');
        let digits = text.strip_prefix(b"-").or_else(|| text.strip_prefix(b"+")).unwrap_or(text).trim_ascii_start();
        let known = |value: f64| if is_negative { -value } else { value };
        number::read(digits).map_or(Value::unknown(Reason::NotANumber), |value| {
            Value::Number(known(value), Some(Literal::at(SourceSpan { source: self.source, span })))
        })
    }
}

/// `'B0101'`, `'H1F'`, `'D12'`.
fn bits(text: &[u8]) -> Value {
    let known = || {
        let (kind, digits) = text.get(1..text.len().checked_sub(1)?)?.split_first()?;
        let radix = match kind {
            b'B' | b'b' => 2,
            b'H' | b'h' => 16,
            b'D' | b'd' => 10,
            _ => return None,
        };
        u32::from_str_radix(std::str::from_utf8(digits).ok()?, radix).ok()
    };
    known().map_or(Value::unknown(Reason::NotABitString), |value| Value::Number(f64::from(value), None))
}
