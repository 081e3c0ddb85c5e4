//! Expressions: read and evaluated in one pass, as far as their values are known.

mod functions;
mod operators;

use super::lex::{Cursor, Lexeme, LexemeKind};
use super::literal::{Literal, Written};
use super::motion::{self, Call};
use super::runner::Runner;
use super::symbols::Upper;
use super::value::{self, Pose, SourceSpan, Value};
use crate::program::Reason;
use crate::program::token;
use crate::text::{self, Span};
pub(super) use operators::equal;
use operators::{apply, operator};
use std::rc::Rc;
use std::sync::Arc;

/// Deepest brackets that are evaluated.
const MAX_DEPTH: usize = 40;

/// The place of an expression, which decides the meaning of its names.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scope {
    pub(super) source: u16,
    pub(super) module: usize,
    /// Whether names of the running routine are visible; not in an initial value of a module's data.
    pub(super) local: bool,
    /// Whether it is not an initial value.
    pub(super) running: bool,
}

impl Runner<'_> {
    /// The value of an expression.
    pub(super) fn evaluate(&mut self, scope: Scope, span: Span) -> Value {
        let sources = self.symbols.sources;
        let mut cursor = Cursor::new(&sources[scope.source as usize].bytes, span);
        let value = self.expression(scope, &mut cursor, 0, 0);
        if matches!(value, Value::Unknown(Reason::TextTooLong)) {
            let help = "a controller stops here: RAPID texts have at most 80 characters";
            self.refuse(scope.source, span, "rapid.text-length", Reason::TextTooLong.text(), help);
        }
        if cursor.peek().kind == LexemeKind::End {
            return value;
        }
        self.pin_value(&value);
        Value::Unknown(Reason::Expression)
    }

    /// Operators of at least `level`: OR XOR (0), AND (1), NOT (2), relations (3), + − (4), * / DIV MOD (5).
    fn expression(&mut self, scope: Scope, cursor: &mut Cursor<'_>, level: u8, depth: usize) -> Value {
        if depth > MAX_DEPTH {
            return Value::Unknown(Reason::ExpressionTooDeep);
        }
        let mut left = match level {
            6 => return self.unary(scope, cursor, depth),
            2 if cursor.accept_word(b"NOT") => {
                return match self.expression(scope, cursor, 2, depth + 1) {
                    Value::Bool(b) => Value::Bool(!b),
                    _ => Value::Unknown(Reason::Computed),
                };
            }
            _ => self.expression(scope, cursor, level + 1, depth),
        };
        loop {
            let lexeme = cursor.peek();
            let Some(operator) = operator(cursor, lexeme).filter(|o| o.0 == level) else { return left };
            cursor.pass(lexeme);
            let right = self.expression(scope, cursor, level + 1, depth + 1);
            // A value computed from a robtarget would move with it.
            for side in [&left, &right] {
                if matches!(side, Value::Target(_) | Value::List(..)) {
                    self.pin_value(side);
                }
            }
            if level == 5 && operator.1 != "*" && right.num().is_none_or(|by| by == 0.0) {
                self.expression_may_fail();
            }
            left = apply(operator.1, &left, &right);
        }
    }

    fn unary(&mut self, scope: Scope, cursor: &mut Cursor<'_>, depth: usize) -> Value {
        if depth > MAX_DEPTH {
            return Value::Unknown(Reason::ExpressionTooDeep);
        }
        let sign = cursor.peek();
        if !matches!(sign.kind, LexemeKind::Mark(b'-' | b'+')) {
            return self.primary(scope, cursor, depth);
        }
        cursor.pass(sign);
        let minus = sign.kind == LexemeKind::Mark(b'-');
        match self.unary(scope, cursor, depth + 1) {
            // One sign belongs to the token; of two the outer one makes an expression of it.
            Value::Num(value, place) => {
                let unsigned = |p: &SourceSpan| !matches!(cursor.bytes[p.span.start as usize], b'-' | b'+');
                let place = place.filter(unsigned).map(|p| SourceSpan { span: sign.span().to(p.span), ..p });
                Value::Num(if minus { -value } else { value }, place)
            }
            Value::List(items, _) if minus => match items.iter().map(Value::num).collect::<Option<Vec<_>>>() {
                Some(nums) => Value::List(nums.into_iter().map(|v| Value::Num(-v, None)).collect(), None),
                None => Value::Unknown(Reason::Computed),
            },
            other => other,
        }
    }

    fn primary(&mut self, scope: Scope, cursor: &mut Cursor<'_>, depth: usize) -> Value {
        let lexeme = cursor.peek();
        match lexeme.kind {
            LexemeKind::Number => {
                cursor.pass(lexeme);
                token::unsigned(cursor.text(lexeme)).map_or(Value::Unknown(Reason::NotANumber), |v| {
                    Value::Num(v, Some(SourceSpan { source: scope.source, span: lexeme.span() }))
                })
            }
            LexemeKind::Text => {
                cursor.pass(lexeme);
                Value::Text(Rc::from(cursor.bytes.get(lexeme.start + 1..lexeme.end - 1).unwrap_or_default()))
            }
            LexemeKind::Mark(b'(') => {
                cursor.pass(lexeme);
                let inner = self.expression(scope, cursor, 0, depth + 1);
                cursor.accept(LexemeKind::Mark(b')'));
                // In brackets it is an expression: not a token to replace.
                if let Value::Num(value, _) = inner { Value::Num(value, None) } else { inner }
            }
            LexemeKind::Mark(b'[') => self.aggregate(scope, cursor, lexeme, depth),
            LexemeKind::Word => {
                cursor.pass(lexeme);
                if cursor.peek().kind == LexemeKind::Mark(b'(') {
                    let start = cursor.next();
                    let mut call = Call::empty(lexeme.span());
                    let split = motion::arguments(cursor, scope.source, &mut call);
                    if split.is_none() {
                        skip_brackets(cursor, start.start);
                    } else {
                        cursor.accept(LexemeKind::Mark(b')'));
                    }
                    let value = self.function(scope, &call, depth);
                    return self.component(scope, cursor, value, b"", None, depth);
                }
                self.variable(scope, cursor, lexeme, depth)
            }
            LexemeKind::End => Value::Unknown(Reason::Expression),
            _ => {
                cursor.pass(lexeme);
                Value::Unknown(Reason::Expression)
            }
        }
    }

    fn aggregate(&mut self, scope: Scope, cursor: &mut Cursor<'_>, open: Lexeme, depth: usize) -> Value {
        if let Some((literal, written)) = Literal::read(cursor.bytes, scope.source, open.start) {
            cursor.at = literal.span().end as usize;
            cursor.behind = cursor.at;
            return Value::Target(Rc::new(self.literal_pose(&literal, written)));
        }
        if depth > MAX_DEPTH {
            skip_brackets(cursor, open.start);
            return Value::Unknown(Reason::ExpressionTooDeep);
        }
        cursor.pass(open);
        let mut items = Vec::new();
        while !matches!(cursor.peek().kind, LexemeKind::Mark(b']' | b';') | LexemeKind::End) {
            let before = cursor.at;
            items.push(self.expression(scope, cursor, 0, depth + 1));
            if cursor.accept(LexemeKind::Mark(b',')).is_none() && cursor.peek().kind != LexemeKind::Mark(b']') {
                // Not understood: its bracket is passed so that what follows is.
                cursor.at = cursor.at.max(before);
                skip_brackets(cursor, open.start);
                return Value::Unknown(Reason::Aggregate);
            }
        }
        cursor.accept(LexemeKind::Mark(b']'));
        Value::List(items.into(), Some(SourceSpan { source: scope.source, span: Span::new(open.start, cursor.behind) }))
    }

    /// A complete literal as a value with its place.
    pub(super) fn literal_pose(&mut self, literal: &Literal, written: Written) -> Pose {
        Pose { written, root: self.literal_id(literal), steps: Vec::new(), fixed: None }
    }

    /// A value as a robtarget, if it is one.
    pub(super) fn as_target(&mut self, value: &Value) -> Option<Rc<Pose>> {
        match value {
            Value::Target(pose) => Some(Rc::clone(pose)),
            Value::List(_, place) => {
                let (written, literal) = value.assemble()?;
                let root = literal.and_then(|l| self.own_literal(l));
                self.unassembled.extend(place.filter(|_| root.is_none()));
                let text = matches!(value, Value::List(_, Some(_)));
                let why = if text { Reason::TargetWithExpression } else { Reason::Computed };
                let fixed = root.is_none().then_some(why);
                Some(Rc::new(Pose { written, root, steps: Vec::new(), fixed }))
            }
            _ => None,
        }
    }

    fn variable(&mut self, scope: Scope, cursor: &mut Cursor<'_>, name: Lexeme, depth: usize) -> Value {
        let key = Upper::new(cursor.text(name));
        match self.find(scope, &key) {
            Some(at) => {
                let variable = &self.symbols.variables[at];
                // An initial value consists of constants; a variable would have its value of another moment.
                let changes = !scope.running && variable.assigned;
                let kind = Arc::clone(&variable.kind);
                let mut value = self.content(at);
                if changes {
                    value = Value::Unknown(Reason::InitialValueChanges);
                }
                self.component(scope, cursor, value, &kind, Some(at), depth)
            }
            None => {
                let value = value::predefined(&key).unwrap_or(Value::Unknown(undeclared(cursor.text(name))));
                self.component(scope, cursor, value, b"", None, depth)
            }
        }
    }

    /// `{index}` and `.component` after a value.
    fn component(
        &mut self,
        scope: Scope,
        cursor: &mut Cursor<'_>,
        mut value: Value,
        kind: &[u8],
        variable: Option<usize>,
        depth: usize,
    ) -> Value {
        let mut kind: Vec<u8> = kind.to_vec();
        let plain = cursor.at;
        loop {
            let lexeme = cursor.peek();
            match lexeme.kind {
                LexemeKind::Mark(b'{') => {
                    cursor.pass(lexeme);
                    loop {
                        let index = self.expression(scope, cursor, 0, depth + 1);
                        if index.num().is_none() {
                            self.pin_value(&value);
                        }
                        if !is_within(&value, &index) {
                            self.expression_may_fail();
                        }
                        value = element(&value, &index);
                        if cursor.accept(LexemeKind::Mark(b',')).is_none() {
                            break;
                        }
                    }
                    cursor.accept(LexemeKind::Mark(b'}'));
                }
                LexemeKind::Mark(b'.') => {
                    cursor.pass(lexeme);
                    let Some(field) = cursor.accept(LexemeKind::Word) else {
                        return Value::Unknown(Reason::Component);
                    };
                    if let Value::Target(pose) = &value {
                        self.pin(pose.root);
                        value = value::parts(pose);
                        kind = b"ROBTARGET".to_vec();
                    }
                    let Some((at, next)) = self.field(&kind, &Upper::new(cursor.text(field))) else {
                        value = Value::Unknown(Reason::ComponentUnknown);
                        kind.clear();
                        continue;
                    };
                    let item = value.list().and_then(|items| items.get(at)).map(Value::without_tokens);
                    value = item.unwrap_or(Value::Unknown(Reason::Computed));
                    kind = next.to_vec();
                }
                _ => {
                    // An element of an array of robtargets may be assembled from parts.
                    if cursor.at != plain
                        && variable.is_some()
                        && kind == b"ROBTARGET"
                        && let Some(pose) = self.as_target(&value)
                    {
                        return Value::Target(pose);
                    }
                    return value;
                }
            }
        }
    }

    pub(super) fn field(&self, kind: &[u8], name: &[u8]) -> Option<(usize, Arc<[u8]>)> {
        if let Some(fields) = self.symbols.records.get(kind) {
            let at = fields.iter().position(|(f, _)| **f == *name)?;
            return Some((at, Arc::clone(&fields[at].1)));
        }
        value::component(kind, name).map(|(at, kind)| (at, Arc::from(kind)))
    }
}

/// An element by an index counted from 1.
fn element(value: &Value, index: &Value) -> Value {
    let (Some(items), Some(index)) = (value.list(), index.num()) else {
        return Value::Unknown(value.unknown().or(index.unknown()).unwrap_or(Reason::Computed));
    };
    at(index).and_then(|at| items.get(at)).cloned().unwrap_or(Value::Unknown(Reason::IndexOutside))
}

/// Whether an array is known to have an element of this index.
fn is_within(value: &Value, index: &Value) -> bool {
    value.list().zip(index.num().and_then(at)).is_some_and(|(items, at)| at < items.len())
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
fn at(index: f64) -> Option<usize> {
    (index >= 1.0).then(|| index.round() as usize - 1)
}

/// Skips the bracketed text that begins at `open`.
fn skip_brackets(cursor: &mut Cursor<'_>, open: usize) {
    cursor.at = open;
    let mut depth = 0_usize;
    loop {
        let lexeme = cursor.next();
        match lexeme.kind {
            LexemeKind::Mark(b'[' | b'(' | b'{') => depth += 1,
            LexemeKind::Mark(b']' | b')' | b'}') => {
                depth = depth.saturating_sub(1);
                if depth == 0 {
                    return;
                }
            }
            LexemeKind::End => return,
            _ => {}
        }
    }
}

/// Why a name that nothing declares has no value.
fn undeclared(name: &[u8]) -> Reason {
    if text::number::is_none(name) { Reason::NotANumber } else { Reason::NameUndeclared }
}
