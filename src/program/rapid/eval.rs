//! Expressions: read and worked out in one walk, as far as every value is known when reading.

use super::lex::{Cursor, Kind, Lexeme};
use super::literal::{Literal, Written};
use super::motion::{self, Call};
use super::run::{ABSENT, NOT_KNOWN, Runner};
use super::symbols::{Content, Upper};
use super::tree::Storage;
use super::value::{self, NO_TURN, Place, Pose, Step, Value, multiply};
use crate::text::{self, Span};
use std::rc::Rc;
use std::sync::Arc;

/// Brackets deeper than this are not looked into.
const MAX_DEPTH: usize = 40;
const TOO_DEEP: &str = "expression is nested too deeply";
pub(super) const RUN_TIME: &str = "target computed at run time";
/// What no controller loads.
pub(super) const NOT_A_NUMBER: &str = "not a number";
pub(super) const BROKEN_AGGREGATE: &str = "aggregate is not understood";
const CHANGED: &str = "target changed at run time";

/// Where an expression stands: decides what its names mean.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scope {
    pub(super) source: u16,
    pub(super) module: usize,
    /// Names of the running routine are seen; not so in an initial value.
    pub(super) local: bool,
}

impl Runner<'_> {
    /// The value of an expression.
    pub(super) fn evaluate(&mut self, scope: Scope, span: Span) -> Value {
        let sources = self.symbols.sources;
        let mut cursor = Cursor::new(&sources[scope.source as usize].bytes, span);
        let value = self.expression(scope, &mut cursor, 0, 0);
        if cursor.peek().kind == Kind::End { value } else { Value::Unknown("expression is not understood") }
    }

    /// Operators of at least `level`: OR XOR (0), AND (1), NOT (2), relations (3), + − (4), * / DIV MOD (5).
    fn expression(&mut self, scope: Scope, cursor: &mut Cursor<'_>, level: u8, depth: usize) -> Value {
        if depth > MAX_DEPTH {
            return Value::Unknown(TOO_DEEP);
        }
        let mut left = match level {
            6 => return self.unary(scope, cursor, depth),
            2 if cursor.accept_word(b"NOT") => {
                return match self.expression(scope, cursor, 2, depth + 1) {
                    Value::Bool(b) => Value::Bool(!b),
                    _ => Value::Unknown(RUN_TIME),
                };
            }
            _ => self.expression(scope, cursor, level + 1, depth),
        };
        loop {
            let lexeme = cursor.peek();
            let Some(operator) = operator(cursor, lexeme).filter(|o| o.0 == level) else { return left };
            cursor.pass(lexeme);
            let right = self.expression(scope, cursor, level + 1, depth + 1);
            left = apply(operator.1, &left, &right);
        }
    }

    fn unary(&mut self, scope: Scope, cursor: &mut Cursor<'_>, depth: usize) -> Value {
        if depth > MAX_DEPTH {
            return Value::Unknown(TOO_DEEP);
        }
        let sign = cursor.peek();
        if !matches!(sign.kind, Kind::Mark(b'-' | b'+')) {
            return self.primary(scope, cursor, depth);
        }
        cursor.pass(sign);
        let minus = sign.kind == Kind::Mark(b'-');
        match self.unary(scope, cursor, depth + 1) {
            // One sign belongs to the token; of two the outer one makes an expression of it.
            Value::Num(value, place) => {
                let unsigned = |p: &Place| !matches!(cursor.bytes[p.span.start as usize], b'-' | b'+');
                let place = place.filter(unsigned).map(|p| Place { span: sign.span().to(p.span), ..p });
                Value::Num(if minus { -value } else { value }, place)
            }
            Value::List(items, _) if minus => match items.iter().map(Value::num).collect::<Option<Vec<_>>>() {
                Some(nums) => Value::List(nums.into_iter().map(|v| Value::Num(-v, None)).collect(), None),
                None => Value::Unknown(RUN_TIME),
            },
            other => other,
        }
    }

    fn primary(&mut self, scope: Scope, cursor: &mut Cursor<'_>, depth: usize) -> Value {
        let lexeme = cursor.peek();
        match lexeme.kind {
            Kind::Number => {
                cursor.pass(lexeme);
                number(cursor.text(lexeme)).map_or(Value::Unknown(NOT_A_NUMBER), |v| {
                    Value::Num(v, Some(Place { source: scope.source, span: lexeme.span() }))
                })
            }
            Kind::Text => {
                cursor.pass(lexeme);
                Value::Text(Rc::from(cursor.bytes.get(lexeme.start + 1..lexeme.end - 1).unwrap_or_default()))
            }
            Kind::Mark(b'(') => {
                cursor.pass(lexeme);
                let inner = self.expression(scope, cursor, 0, depth + 1);
                cursor.accept(Kind::Mark(b')'));
                // In brackets it is an expression: not a token to replace.
                if let Value::Num(value, _) = inner { Value::Num(value, None) } else { inner }
            }
            Kind::Mark(b'[') => self.aggregate(scope, cursor, lexeme, depth),
            Kind::Word => {
                cursor.pass(lexeme);
                if cursor.peek().kind == Kind::Mark(b'(') {
                    let start = cursor.next();
                    let mut call = Call::empty(lexeme.span());
                    let split = motion::arguments(cursor, scope.source, &mut call);
                    if split.is_none() {
                        skip_brackets(cursor, start.start);
                    } else {
                        cursor.accept(Kind::Mark(b')'));
                    }
                    let value = self.function(scope, &call, depth);
                    return self.component(scope, cursor, value, b"", None, depth);
                }
                self.variable(scope, cursor, lexeme, depth)
            }
            Kind::End => Value::Unknown("expression is not understood"),
            _ => {
                cursor.pass(lexeme);
                Value::Unknown("expression is not understood")
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
            return Value::Unknown(TOO_DEEP);
        }
        cursor.pass(open);
        let mut items = Vec::new();
        while !matches!(cursor.peek().kind, Kind::Mark(b']' | b';') | Kind::End) {
            let before = cursor.at;
            items.push(self.expression(scope, cursor, 0, depth + 1));
            if cursor.accept(Kind::Mark(b',')).is_none() && cursor.peek().kind != Kind::Mark(b']') {
                // Not understood: its bracket is passed so that what follows is.
                cursor.at = cursor.at.max(before);
                skip_brackets(cursor, open.start);
                return Value::Unknown(BROKEN_AGGREGATE);
            }
        }
        cursor.accept(Kind::Mark(b']'));
        Value::List(items.into(), Some(Place { source: scope.source, span: Span::new(open.start, cursor.behind) }))
    }

    /// A complete literal as a value that knows where it stands.
    pub(super) fn literal_pose(&mut self, literal: &Literal, written: Written) -> Pose {
        Pose { written, root: self.literal_id(literal), steps: Vec::new(), fixed: None }
    }

    /// A value as a robtarget, if it is one.
    pub(super) fn as_target(&mut self, value: &Value) -> Option<Rc<Pose>> {
        match value {
            Value::Target(pose) => Some(Rc::clone(pose)),
            Value::List(..) => {
                let (written, literal) = value.assemble()?;
                let root = literal.and_then(|l| self.own_literal(l));
                let text = matches!(value, Value::List(_, Some(_)));
                let why = if text { "target with an expression in it" } else { RUN_TIME };
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
                let kind = Arc::clone(&self.symbols.variables[at].kind);
                let value = self.content(at);
                self.component(scope, cursor, value, &kind, Some(at), depth)
            }
            None => {
                let value = value::predefined(&key).unwrap_or(Value::Unknown(undeclared(cursor.text(name))));
                self.component(scope, cursor, value, b"", None, depth)
            }
        }
    }

    /// What a variable holds now.
    pub(super) fn content(&mut self, at: usize) -> Value {
        let variable = &self.symbols.variables[at];
        let span = match &variable.content {
            Content::Is(value) => return value.clone(),
            Content::Busy => return Value::Unknown("initial value needs itself"),
            Content::Declared(span) => *span,
        };
        let (source, module, kind) = (variable.source, variable.module, Arc::clone(&variable.kind));
        let (assigned, volatile, storage) = (variable.assigned, variable.volatile, variable.storage);
        self.symbols.variables[at].content = Content::Busy;
        let mut value = self.evaluate(
            Scope { source, module, local: self.symbols.variables[at].declared.is_some() && self.local_data(at) },
            span,
        );
        if *kind == *b"ROBTARGET"
            && let Value::List(..) = value
            && let Some(pose) = self.as_target(&value)
        {
            value = Value::Target(pose);
        } else if *kind != *b"ROBTARGET" {
            value = strip(value);
        }
        if volatile {
            value = Value::Unknown(CHANGED);
        } else if assigned {
            // PERS data keep what the last run left: the text is not what is there.
            let lost =
                storage == Storage::Pers && *kind != *b"TOOLDATA" && *kind != *b"WOBJDATA" && *kind != *b"ROBTARGET";
            value = if lost { Value::Unknown(CHANGED) } else { value.detached(CHANGED) };
        }
        self.symbols.variables[at].content = Content::Is(value.clone());
        value
    }

    /// `{index}` and `.component` behind a value.
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
                Kind::Mark(b'{') => {
                    cursor.pass(lexeme);
                    loop {
                        let index = self.expression(scope, cursor, 0, depth + 1);
                        value = element(&value, &index);
                        if cursor.accept(Kind::Mark(b',')).is_none() {
                            break;
                        }
                    }
                    cursor.accept(Kind::Mark(b'}'));
                }
                Kind::Mark(b'.') => {
                    cursor.pass(lexeme);
                    let Some(field) = cursor.accept(Kind::Word) else {
                        return Value::Unknown("component is not understood");
                    };
                    if let Value::Target(pose) = &value {
                        self.pin(pose.root);
                        value = value::parts(pose);
                        kind = b"ROBTARGET".to_vec();
                    }
                    let Some((at, next)) = self.field(&kind, &Upper::new(cursor.text(field))) else {
                        value = Value::Unknown("component is not known");
                        kind.clear();
                        continue;
                    };
                    let item = value.list().and_then(|items| items.get(at)).map(strip_ref);
                    value = item.unwrap_or(Value::Unknown(RUN_TIME));
                    kind = next.to_vec();
                }
                _ => {
                    // An element of an array of robtargets may be made of parts.
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

    fn function(&mut self, scope: Scope, call: &Call, depth: usize) -> Value {
        let sources = self.symbols.sources;
        let bytes: &[u8] = &sources[scope.source as usize].bytes;
        let name = Upper::new(&bytes[call.name.range()]);
        if depth > MAX_DEPTH {
            return Value::Unknown(TOO_DEEP);
        }
        let mut values = Vec::new();
        for span in call.positional() {
            let mut cursor = Cursor::new(bytes, *span);
            values.push(self.expression(scope, &mut cursor, 0, depth + 1));
        }
        self.forget_what_a_function_changes(scope, call);
        if self.symbols.find_routine(scope.module, &bytes[call.name.range()]).is_some() {
            values.iter().for_each(|v| self.pin_value(v));
            return Value::Unknown(RUN_TIME);
        }
        let num = |i: usize| values.get(i).and_then(Value::num);
        let known = match (&*name, values.len()) {
            (b"PRESENT", 1) => {
                return match &values[0] {
                    Value::Unknown(ABSENT) => Value::Bool(false),
                    Value::Unknown(NOT_KNOWN) => Value::Unknown(RUN_TIME),
                    _ => Value::Bool(true),
                };
            }
            (b"OFFS", 4) => return self.shifted(&values, false, NO_TURN),
            (b"RELTOOL", 4) => {
                let Some(turn) = self.turn(scope, call, depth) else {
                    self.pin_value(&values[0]);
                    return Value::Unknown(RUN_TIME);
                };
                return self.shifted(&values, true, turn);
            }
            (b"ABS", 1) => num(0).map(f64::abs),
            (b"SQRT", 1) => num(0).map(f64::sqrt),
            (b"SIN", 1) => num(0).map(|v| v.to_radians().sin()),
            (b"COS", 1) => num(0).map(|v| v.to_radians().cos()),
            (b"TAN", 1) => num(0).map(|v| v.to_radians().tan()),
            (b"ASIN", 1) => num(0).map(|v| v.asin().to_degrees()),
            (b"ACOS", 1) => num(0).map(|v| v.acos().to_degrees()),
            (b"ATAN", 1) => num(0).map(|v| v.atan().to_degrees()),
            (b"ATAN2", 2) => num(0).zip(num(1)).map(|(y, x)| y.atan2(x).to_degrees()),
            (b"POW", 2) => num(0).zip(num(1)).map(|(a, b)| a.powf(b)),
            (b"EXP", 1) => num(0).map(f64::exp),
            (b"ROUND", 1) if call.optional().is_empty() => num(0).map(f64::round),
            (b"TRUNC", 1) if call.optional().is_empty() => num(0).map(f64::trunc),
            (b"NUMTOSTR", 2) => {
                if let (Some(value), Some(decimals)) = (num(0), num(1)) {
                    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
                    let decimals = decimals.clamp(0.0, 9.0) as usize;
                    let mut text = Vec::new();
                    text::number::write_fixed(&mut text, value, decimals);
                    return Value::Text(text.into());
                }
                None
            }
            (b"DIM", 2) => dimension(&values[0], num(1)),
            _ => None,
        };
        if known.is_none() {
            values.iter().for_each(|v| self.pin_value(v));
        }
        known.filter(|v| v.is_finite()).map_or(Value::Unknown(RUN_TIME), |v| Value::Num(v, None))
    }

    /// `\Rx`, `\Ry`, `\Rz` of `RelTool`: turns about x, then the new y, then the new z.
    fn turn(&mut self, scope: Scope, call: &Call, depth: usize) -> Option<[f64; 4]> {
        let sources = self.symbols.sources;
        let bytes: &[u8] = &sources[scope.source as usize].bytes;
        let mut turn = NO_TURN;
        for (axis, name) in [&b"Rx"[..], b"Ry", b"Rz"].into_iter().enumerate() {
            let Some(span) = call.option(bytes, name) else { continue };
            let mut cursor = Cursor::new(bytes, span);
            let half = self.expression(scope, &mut cursor, 0, depth + 1).num()?.to_radians() / 2.0;
            let mut q = [half.cos(), 0.0, 0.0, 0.0];
            q[axis + 1] = half.sin();
            turn = multiply(turn, q);
        }
        Some(turn)
    }

    /// `Offs` or `RelTool` of known values.
    fn shifted(&mut self, values: &[Value], in_tool: bool, turn: [f64; 4]) -> Value {
        let Some(base) = self.as_target(&values[0]) else {
            return Value::Unknown(values[0].unknown().unwrap_or(RUN_TIME));
        };
        let [Value::Num(x, tx), Value::Num(y, ty), Value::Num(z, tz)] = &values[1..4] else {
            self.pin(base.root);
            return Value::Unknown(RUN_TIME);
        };
        let tokens = match (tx, ty, tz) {
            (Some(x), Some(y), Some(z)) => Some([*x, *y, *z]),
            _ => None,
        };
        let step = Step { offset_mm: [*x, *y, *z], tokens, in_tool, turn };
        let mut pose = (*base).clone();
        (pose.written.position_mm, pose.written.quat) = step.apply(pose.written.position_mm, pose.written.quat);
        if pose.root.is_some() {
            pose.steps.push(step);
        }
        Value::Target(Rc::new(pose))
    }
}

/// Level and sign of the operator that a lexeme is.
fn operator(cursor: &Cursor<'_>, lexeme: Lexeme) -> Option<(u8, &'static str)> {
    Some(match lexeme.kind {
        Kind::Mark(b'=') => (3, "="),
        Kind::Mark(b'<') => (3, "<"),
        Kind::Mark(b'>') => (3, ">"),
        Kind::Unequal => (3, "<>"),
        Kind::AtMost => (3, "<="),
        Kind::AtLeast => (3, ">="),
        Kind::Mark(b'+') => (4, "+"),
        Kind::Mark(b'-') => (4, "-"),
        Kind::Mark(b'*') => (5, "*"),
        Kind::Mark(b'/') => (5, "/"),
        Kind::Word => match &*Upper::new(cursor.text(lexeme)) {
            b"OR" => (0, "OR"),
            b"XOR" => (0, "XOR"),
            b"AND" => (1, "AND"),
            b"DIV" => (5, "DIV"),
            b"MOD" => (5, "MOD"),
            _ => return None,
        },
        _ => return None,
    })
}

fn apply(operator: &str, left: &Value, right: &Value) -> Value {
    let unknown = || Value::Unknown(left.unknown().or(right.unknown()).unwrap_or(RUN_TIME));
    // One side can be enough.
    match (operator, left.bool(), right.bool()) {
        ("OR", Some(true), _) | ("OR", _, Some(true)) => return Value::Bool(true),
        ("AND", Some(false), _) | ("AND", _, Some(false)) => return Value::Bool(false),
        _ => {}
    }
    match (left, right) {
        (Value::Num(a, _), Value::Num(b, _)) => number_operation(operator, *a, *b).unwrap_or_else(unknown),
        (Value::Bool(a), Value::Bool(b)) => match operator {
            "OR" => Value::Bool(a | b),
            "AND" => Value::Bool(a & b),
            "XOR" | "<>" => Value::Bool(a != b),
            "=" => Value::Bool(a == b),
            _ => unknown(),
        },
        (Value::Text(a), Value::Text(b)) => match operator {
            "+" => Value::Text([&**a, &**b].concat().into()),
            "=" => Value::Bool(a == b),
            "<>" => Value::Bool(a != b),
            _ => unknown(),
        },
        // pos + pos, pos * num
        (Value::List(a, _), Value::List(b, _)) if matches!(operator, "+" | "-") && a.len() == b.len() => {
            Value::List(a.iter().zip(b.iter()).map(|(a, b)| apply(operator, a, b)).collect(), None)
        }
        (Value::List(a, _), Value::Num(..)) if matches!(operator, "*" | "/") => {
            Value::List(a.iter().map(|a| apply(operator, a, right)).collect(), None)
        }
        (Value::Num(..), Value::List(b, _)) if operator == "*" => {
            Value::List(b.iter().map(|b| apply(operator, left, b)).collect(), None)
        }
        _ => unknown(),
    }
}

#[allow(clippy::float_cmp)] // RAPID's own comparison
fn number_operation(operator: &str, a: f64, b: f64) -> Option<Value> {
    let number = |v: f64| v.is_finite().then_some(Value::Num(v, None));
    match operator {
        "+" => number(a + b),
        "-" => number(a - b),
        "*" => number(a * b),
        "/" => number(a / b),
        "DIV" => number((a / b).trunc()),
        "MOD" => number(a % b),
        "=" => Some(Value::Bool(a == b)),
        "<>" => Some(Value::Bool(a != b)),
        "<" => Some(Value::Bool(a < b)),
        ">" => Some(Value::Bool(a > b)),
        "<=" => Some(Value::Bool(a <= b)),
        ">=" => Some(Value::Bool(a >= b)),
        _ => None,
    }
}

/// An element by an index counted from 1.
fn element(value: &Value, index: &Value) -> Value {
    let (Some(items), Some(index)) = (value.list(), index.num()) else {
        return Value::Unknown(value.unknown().or(index.unknown()).unwrap_or(RUN_TIME));
    };
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let at = if index >= 1.0 { Some(index.round() as usize - 1) } else { None };
    at.and_then(|at| items.get(at)).cloned().unwrap_or(Value::Unknown("index outside the array"))
}

fn dimension(value: &Value, number: Option<f64>) -> Option<f64> {
    let mut items = value.list()?;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    for _ in 1..number?.clamp(1.0, 3.0) as usize {
        items = items.first()?.list()?;
    }
    #[allow(clippy::cast_precision_loss)]
    Some(items.len() as f64)
}

/// Numbers without their tokens: a variable's number is not the text at its use. Robtargets keep theirs.
fn strip(value: Value) -> Value {
    match value {
        Value::Num(v, _) => Value::Num(v, None),
        Value::List(items, _) => Value::List(items.iter().map(strip_ref).collect(), None),
        other => other,
    }
}

fn strip_ref(value: &Value) -> Value {
    strip(value.clone())
}

/// `12`, `1.5E3`, `0x1F`, `0b101`, `0o17`.
fn number(token: &[u8]) -> Option<f64> {
    if let [b'0', base @ (b'x' | b'X' | b'o' | b'O' | b'b' | b'B'), digits @ ..] = token {
        let radix = match base.to_ascii_lowercase() {
            b'x' => 16,
            b'o' => 8,
            _ => 2,
        };
        return u32::from_str_radix(std::str::from_utf8(digits).ok()?, radix).ok().map(f64::from);
    }
    text::number::read(token)
}

/// Passes the bracketed text that begins at `open`, to behind its end.
fn skip_brackets(cursor: &mut Cursor<'_>, open: usize) {
    cursor.at = open;
    let mut depth = 0_usize;
    loop {
        let lexeme = cursor.next();
        match lexeme.kind {
            Kind::Mark(b'[' | b'(' | b'{') => depth += 1,
            Kind::Mark(b']' | b')' | b'}') => {
                depth = depth.saturating_sub(1);
                if depth == 0 {
                    return;
                }
            }
            Kind::End => return,
            _ => {}
        }
    }
}

/// Why a name that nothing declares has no value.
fn undeclared(name: &[u8]) -> &'static str {
    if text::number::is_none(name) { NOT_A_NUMBER } else { "name is not declared in the files given" }
}
