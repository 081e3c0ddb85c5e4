//! Reads calls, assignments and expressions whose end in the text is known.
//!
//! Text that is not understood becomes an unknown expression that has the names and calls in it: a controller does not load it, but deflex
//! has to know what it may change.

use super::super::expression::{
    Arguments, Call, Chain, Expression, ExpressionKind, NOT, Operation, OptionalArgument, Part, PartStep, level,
};
use super::super::lex::{Cursor, Lexeme, LexemeKind};
use super::super::literal::Literal;
use super::super::tree::{Assignment, StatementKind};
use crate::{Reason, token};
use deflex_lang::ir::Binary;
use deflex_text::Span;

/// Deepest nesting of brackets, signs and NOT, far beyond any program and within any stack.
const MAX_DEPTH: usize = 40;

/// Reads a stretch of a file.
#[derive(Clone)]
pub(in super::super) struct Reader<'r> {
    cursor: Cursor<'r>,
    /// The robtargets of the file from the stretch on, the first of which has the index `first`.
    literals: &'r [Literal],
    first: usize,
    /// The next of them.
    next: usize,
    depth: usize,
}

impl<'r> Reader<'r> {
    /// A reader of a stretch without its `;`. Robtargets are found only among `literals`, the first of which has the index `first` in its file.
    pub(in super::super) fn new(bytes: &'r [u8], span: Span, literals: &'r [Literal], first: usize) -> Self {
        let ends = bytes.get(span.range()).is_some_and(|text| text.ends_with(b";"));
        let span = Span { end: span.end - u32::from(ends), ..span };
        Self { cursor: Cursor::new(bytes, span), literals, first, next: 0, depth: 0 }
    }

    /// The call or the assignment that the stretch is.
    pub(in super::super) fn statement(mut self) -> StatementKind {
        let first = self.cursor.next();
        if first.kind == LexemeKind::Mark(b'%') {
            let name = self.expression(0);
            let name = self.rest(name, |kind| kind == LexemeKind::Mark(b'%'));
            let is_closed = self.cursor.accept(LexemeKind::Mark(b'%')).is_some();
            let mut call = self.call(name.span, Some(Box::new(name)));
            call.arguments.is_cut |= !is_closed;
            return StatementKind::Call(Box::new(call));
        }
        let mut assignment = self.clone();
        let to = assignment.parts(Expression { kind: ExpressionKind::Name, span: first.span() });
        if assignment.cursor.accept(LexemeKind::Assign).is_some() {
            let value = assignment.whole();
            return StatementKind::Assign(Box::new(Assignment { to, value }));
        }
        StatementKind::Call(Box::new(self.call(first.span(), None)))
    }

    /// A statement's call, from its arguments on.
    fn call(mut self, name: Span, late: Option<Box<Expression>>) -> Call {
        let mut arguments = self.arguments();
        arguments.is_cut |= self.cursor.peek().kind != LexemeKind::End;
        Call { name, late, arguments }
    }

    /// The expression that the stretch is.
    pub(in super::super) fn whole(mut self) -> Expression {
        let first = self.expression(0);
        self.rest(first, |_| false)
    }

    /// Arguments up to the end or a closing bracket.
    pub(in super::super) fn arguments(&mut self) -> Arguments {
        let (mut positional, mut optional, mut is_cut) = (Vec::new(), Vec::new(), false);
        loop {
            let lexeme = self.cursor.peek();
            match lexeme.kind {
                LexemeKind::End | LexemeKind::Mark(b';' | b')') => break,
                LexemeKind::Mark(b',') => self.cursor.pass(lexeme),
                LexemeKind::Mark(b'\\') => {
                    self.cursor.pass(lexeme);
                    let Some(name) = self.cursor.accept(LexemeKind::Word) else {
                        is_cut = true;
                        continue;
                    };
                    let then = self.cursor.peek();
                    let is_given = matches!(then.kind, LexemeKind::Assign | LexemeKind::Mark(b'?'));
                    let value = is_given.then(|| {
                        self.cursor.pass(then);
                        self.nested(Self::argument)
                    });
                    optional.push(OptionalArgument { name: name.span(), value });
                }
                LexemeKind::Mark(b']' | b'}') => {
                    self.cursor.pass(lexeme);
                    is_cut = true;
                }
                _ => {
                    let mut argument = self.nested(Self::argument);
                    // `Name := value`: a positional argument with its name.
                    if self.cursor.accept(LexemeKind::Assign).is_some() {
                        argument = self.nested(Self::argument);
                    }
                    positional.push(argument);
                }
            }
        }
        Arguments { positional: positional.into(), optional: optional.into(), is_cut }
    }

    fn argument(&mut self) -> Expression {
        let first = self.expression(0);
        self.rest(first, is_delimiter)
    }

    /// The expression that was read, if it ends where it should; otherwise it is not understood, with all up to there.
    fn rest(&mut self, first: Expression, is_end: impl Fn(LexemeKind) -> bool) -> Expression {
        let ends = |kind: LexemeKind| kind == LexemeKind::End || is_end(kind);
        if ends(self.cursor.peek().kind) {
            return first;
        }
        let start = first.span.start as usize;
        let mut parts = vec![first];
        loop {
            let lexeme = self.cursor.peek();
            if ends(lexeme.kind) {
                return self.since(start, ExpressionKind::Unknown(Reason::Expression, parts.into()));
            }
            if is_delimiter(lexeme.kind) {
                self.cursor.pass(lexeme);
            } else {
                parts.push(self.expression(0));
            }
        }
    }

    /// Operands with operators of at least this level.
    fn expression(&mut self, least: u8) -> Expression {
        let start = self.cursor.peek().start;
        let mut left = if least <= NOT && self.cursor.accept_word(b"NOT") {
            let inner = self.nested(|reader| reader.expression(NOT));
            self.negated(start, inner)
        } else {
            self.unary()
        };
        // The right side of an operator takes all operators of higher levels, so the levels never rise from left to right.
        let mut operations: Vec<Operation> = Vec::new();
        loop {
            let lexeme = self.cursor.peek();
            let operator = self.operator(lexeme).filter(|operator| level(*operator) >= least);
            let before = operations.first().map(|operation| level(operation.operator));
            if before.is_some() && operator.map(level) != before {
                let operations = std::mem::take(&mut operations).into();
                left = self.since(start, ExpressionKind::Chain(Box::new(Chain { first: left, operations })));
            }
            let Some(operator) = operator else { return left };
            self.cursor.pass(lexeme);
            let right = self.expression(level(operator) + 1);
            operations.push(Operation { operator, right });
        }
    }

    /// `NOT` with its operand. By the table of priorities `NOT a AND b` is `NOT (a AND b)`, and in most other languages it is `(NOT a) AND b`: the
    /// value is not known, because a program may have been written and tested with either in mind.
    fn negated(&mut self, start: usize, inner: Expression) -> Expression {
        let mut operands = vec![inner];
        loop {
            let lexeme = self.cursor.peek();
            if self.operator(lexeme) != Some(Binary::And) {
                break;
            }
            self.cursor.pass(lexeme);
            operands.push(self.expression(NOT));
        }
        let kind = match <[Expression; 1]>::try_from(operands) {
            Ok([inner]) => ExpressionKind::Not(Box::new(inner)),
            Err(operands) => ExpressionKind::Unknown(Reason::Expression, operands.into()),
        };
        self.since(start, kind)
    }

    fn operator(&self, lexeme: Lexeme) -> Option<Binary> {
        const WORDS: [(&[u8], Binary); 5] = [
            (b"OR", Binary::Or),
            (b"AND", Binary::And),
            (b"DIV", Binary::Quotient),
            (b"MOD", Binary::Remainder),
            (b"XOR", Binary::Xor),
        ];
        Some(match lexeme.kind {
            LexemeKind::Mark(b'=') => Binary::Equal,
            LexemeKind::Mark(b'<') => Binary::Less,
            LexemeKind::Mark(b'>') => Binary::Greater,
            LexemeKind::Unequal => Binary::NotEqual,
            LexemeKind::AtMost => Binary::AtMost,
            LexemeKind::AtLeast => Binary::AtLeast,
            LexemeKind::Mark(b'+') => Binary::Add,
            LexemeKind::Mark(b'-') => Binary::Subtract,
            LexemeKind::Mark(b'*') => Binary::Multiply,
            LexemeKind::Mark(b'/') => Binary::Divide,
            LexemeKind::Word => {
                let word = self.cursor.text(lexeme);
                WORDS.into_iter().find(|(name, _)| name.eq_ignore_ascii_case(word))?.1
            }
            _ => return None,
        })
    }

    fn unary(&mut self) -> Expression {
        let sign = self.cursor.peek();
        let is_minus = match sign.kind {
            LexemeKind::Mark(b'-') => true,
            LexemeKind::Mark(b'+') => false,
            _ => return self.primary(),
        };
        self.cursor.pass(sign);
        let inner = self.nested(Self::unary);
        let is_unsigned = !matches!(self.cursor.bytes.get(inner.span.start as usize), Some(b'-' | b'+'));
        let kind = match inner.kind {
            // One sign belongs to the number; of two the outer one makes an expression of it.
            ExpressionKind::Number(value) if is_unsigned => {
                ExpressionKind::Number(value.map(|value| if is_minus { -value } else { value }))
            }
            _ if is_minus => ExpressionKind::Negated(Box::new(inner)),
            _ => ExpressionKind::Bracketed(Box::new(inner)),
        };
        self.since(sign.start, kind)
    }

    fn primary(&mut self) -> Expression {
        let lexeme = self.cursor.peek();
        if is_delimiter(lexeme.kind) {
            let span = Span::new(lexeme.start, lexeme.start);
            return Expression { kind: ExpressionKind::Unknown(Reason::Expression, Box::new([])), span };
        }
        if lexeme.kind == LexemeKind::Mark(b'[')
            && let Some(literal) = self.literal(lexeme.start)
        {
            return literal;
        }
        self.cursor.pass(lexeme);
        let kind = match lexeme.kind {
            LexemeKind::Number => ExpressionKind::Number(token::unsigned(self.cursor.text(lexeme))),
            LexemeKind::Text => ExpressionKind::Text,
            LexemeKind::Mark(b'(') => {
                let inner = self.nested(|reader| reader.expression(0));
                let inner = self.rest(inner, is_closing);
                self.cursor.accept(LexemeKind::Mark(b')'));
                ExpressionKind::Bracketed(Box::new(inner))
            }
            LexemeKind::Mark(b'[') => self.aggregate(),
            LexemeKind::Word => {
                let of = if self.cursor.peek().kind == LexemeKind::Mark(b'(') {
                    self.function(lexeme.span())
                } else {
                    Expression { kind: ExpressionKind::Name, span: lexeme.span() }
                };
                return self.parts(of);
            }
            _ => ExpressionKind::Unknown(Reason::Expression, Box::new([])),
        };
        self.since(lexeme.start, kind)
    }

    /// The complete robtarget that begins here.
    fn literal(&mut self, start: usize) -> Option<Expression> {
        let begins = |literal: &Literal| literal.span().start as usize;
        while self.literals.get(self.next).is_some_and(|literal| begins(literal) < start) {
            self.next += 1;
        }
        let span = self.literals.get(self.next).filter(|literal| begins(literal) == start)?.span();
        let kind = ExpressionKind::Literal(u32::try_from(self.first + self.next).ok()?);
        self.next += 1;
        (self.cursor.at, self.cursor.passed) = (span.end as usize, span.end as usize);
        Some(Expression { kind, span })
    }

    /// After `[`.
    fn aggregate(&mut self) -> ExpressionKind {
        let mut items = Vec::new();
        while !matches!(self.cursor.peek().kind, LexemeKind::Mark(b']' | b';') | LexemeKind::End) {
            items.push(self.nested(|reader| reader.expression(0)));
            if self.cursor.accept(LexemeKind::Mark(b',')).is_none() && self.cursor.peek().kind != LexemeKind::Mark(b']')
            {
                items.extend(self.skipped());
                self.cursor.accept(LexemeKind::Mark(b']'));
                return ExpressionKind::Unknown(Reason::Aggregate, items.into());
            }
        }
        self.cursor.accept(LexemeKind::Mark(b']'));
        ExpressionKind::Aggregate(items.into())
    }

    /// The call of a function, from its bracket on.
    fn function(&mut self, name: Span) -> Expression {
        self.cursor.next();
        let mut arguments = self.arguments();
        arguments.is_cut |= self.cursor.accept(LexemeKind::Mark(b')')).is_none();
        self.since(name.start as usize, ExpressionKind::Call(Box::new(Call { name, late: None, arguments })))
    }

    /// A value with the indices and components after it.
    fn parts(&mut self, of: Expression) -> Expression {
        let start = of.span.start as usize;
        let mut steps = Vec::new();
        let mut is_whole = true;
        while is_whole {
            let lexeme = self.cursor.peek();
            match lexeme.kind {
                LexemeKind::Mark(b'{') => {
                    self.cursor.pass(lexeme);
                    let mut indices = Vec::new();
                    loop {
                        let index = self.nested(|reader| reader.expression(0));
                        indices.push(self.rest(index, is_delimiter));
                        if self.cursor.accept(LexemeKind::Mark(b',')).is_none() {
                            break;
                        }
                    }
                    is_whole = self.cursor.accept(LexemeKind::Mark(b'}')).is_some();
                    steps.push(PartStep::Index(indices.into()));
                }
                LexemeKind::Mark(b'.') => {
                    self.cursor.pass(lexeme);
                    let component = self.cursor.accept(LexemeKind::Word);
                    is_whole = component.is_some();
                    steps.extend(component.map(|name| PartStep::Component(name.span())));
                }
                _ => break,
            }
        }
        if steps.is_empty() && is_whole {
            return of;
        }
        let part = self.since(start, ExpressionKind::Part(Box::new(Part { of, steps: steps.into() })));
        if is_whole {
            return part;
        }
        self.since(start, ExpressionKind::Unknown(Reason::Component, Box::new([part])))
    }

    /// Reads one level deeper.
    fn nested(&mut self, read: impl FnOnce(&mut Self) -> Expression) -> Expression {
        if self.depth == MAX_DEPTH {
            let start = self.cursor.peek().start;
            self.cursor.passed = start;
            let parts = self.skipped();
            return self.since(start, ExpressionKind::Unknown(Reason::ExpressionTooDeep, parts.into()));
        }
        self.depth += 1;
        let inner = read(self);
        self.depth -= 1;
        inner
    }

    /// Skips the text up to the bracket that closes the present one. Returns the names in it, and the calls without their arguments.
    fn skipped(&mut self) -> Vec<Expression> {
        let (mut parts, mut open) = (Vec::new(), 0_usize);
        loop {
            let lexeme = self.cursor.peek();
            match lexeme.kind {
                LexemeKind::End | LexemeKind::Mark(b';') => return parts,
                LexemeKind::Mark(b'[' | b'(' | b'{') => open += 1,
                kind if is_closing(kind) && open == 0 => return parts,
                kind if is_closing(kind) => open -= 1,
                _ => {}
            }
            self.cursor.pass(lexeme);
            if lexeme.kind == LexemeKind::Word {
                let kind = if self.cursor.peek().kind == LexemeKind::Mark(b'(') {
                    let arguments = Arguments { is_cut: true, ..Arguments::default() };
                    ExpressionKind::Call(Box::new(Call { name: lexeme.span(), late: None, arguments }))
                } else {
                    ExpressionKind::Name
                };
                parts.push(Expression { kind, span: lexeme.span() });
            }
        }
    }

    /// An expression from an offset to the end of the lexeme taken last.
    fn since(&self, start: usize, kind: ExpressionKind) -> Expression {
        Expression { kind, span: Span::new(start, self.cursor.passed.max(start)) }
    }
}

/// Whether a lexeme ends an argument.
fn is_delimiter(kind: LexemeKind) -> bool {
    is_closing(kind) || matches!(kind, LexemeKind::End | LexemeKind::Assign | LexemeKind::Mark(b',' | b';' | b'\\'))
}

fn is_closing(kind: LexemeKind) -> bool {
    matches!(kind, LexemeKind::Mark(b']' | b')' | b'}'))
}
