//! What expressions are worth.

use super::lex::{Cursor, LexemeKind};
use super::names;
use super::run::Runner;
use super::state::Id;
use super::value::{Name, NumberToken, REST, Step, Value, chained, flat, upper};
use crate::program::Reason;
use crate::text::{Span, decode, number};
use std::rc::Rc;

/// Brackets within one another.
const MAX_DEPTH: usize = 40;
/// Computed numbers closer than this count as equal: controllers count in single precision.
const SAME: f64 = 1e-4;

/// A variable, or a part of it.
#[derive(Clone, Debug)]
pub(super) struct Path {
    pub(super) id: Id,
    pub(super) name: Name,
    pub(super) steps: Vec<Step>,
    /// Whether all indices are known.
    pub(super) known: bool,
    /// As the author wrote it, with the indices that hold: `Points[3]`.
    pub(super) label: String,
}

impl<'a> Runner<'a> {
    /// The variable of a name where the program is.
    pub(super) fn resolve(&mut self, name: &Name) -> Id {
        if let Some(id) = self.frames.last().and_then(|frame| frame.names.get(name)) {
            return *id;
        }
        self.symbols.find(self.here(), name)
    }

    /// What a variable holds here.
    pub(super) fn value(&self, id: Id) -> Value {
        let held = self.state.values.get(&id).or_else(|| self.symbols.start.get(id));
        held.cloned().unwrap_or(Value::unknown(Reason::Unset))
    }

    pub(super) fn pin(&mut self, value: &Value) {
        let pinned = &mut self.pinned;
        value.places(&mut |place| {
            pinned.insert(place);
        });
    }

    /// Puts a value at a path; its numbers stay where the way there is not known.
    pub(super) fn put(&mut self, whole: &mut Value, path: &[Step], value: Value) {
        whole.set(path, value, &mut |place| {
            self.pinned.insert(place);
        });
    }

    pub(super) fn evaluate(&mut self, span: Span) -> Value {
        let mut cursor = self.cursor(span);
        let value = self.expression(&mut cursor);
        // Conditions, bounds, returned values: their numbers are read.
        self.pin(&value);
        value
    }

    /// Comparisons and logic: on one level, so that what mixes them without brackets is not known.
    pub(super) fn expression(&mut self, cursor: &mut Cursor<'a>) -> Value {
        self.expression_at(cursor, 0)
    }

    /// An expression within so many brackets.
    pub(super) fn expression_at(&mut self, cursor: &mut Cursor<'a>, depth: usize) -> Value {
        let first = self.sum(cursor, depth);
        self.logic(first, cursor, depth)
    }

    fn logic(&mut self, mut value: Value, cursor: &mut Cursor<'a>, depth: usize) -> Value {
        let (mut compared, mut combined) = (0, None);
        let mut mixed = false;
        loop {
            let lexeme = cursor.peek();
            let operator: Name = match lexeme.kind {
                LexemeKind::Equal
                | LexemeKind::Unequal
                | LexemeKind::AtMost
                | LexemeKind::AtLeast
                | LexemeKind::Mark(b'<' | b'>') => {
                    compared += 1;
                    upper(cursor.text(lexeme))
                }
                LexemeKind::Word => {
                    let word = upper(cursor.text(lexeme));
                    if ![&b"AND"[..], b"OR", b"EXOR", b"B_AND", b"B_OR", b"B_EXOR"].contains(&&word[..]) {
                        break;
                    }
                    // Which of two comes first is not looked at.
                    mixed |= combined.replace(word.clone()).is_some_and(|other| other != word);
                    word
                }
                _ => break,
            };
            cursor.next();
            let other = self.sum(cursor, depth);
            self.pin(&value);
            self.pin(&other);
            value = operate(&operator, &value, &other);
        }
        mixed |= compared > 1 || compared > 0 && combined.is_some();
        if mixed { Value::unknown(Reason::Computed) } else { value }
    }

    fn sum(&mut self, cursor: &mut Cursor<'a>, depth: usize) -> Value {
        let mut value = self.product(cursor, depth);
        while let LexemeKind::Mark(operator @ (b'+' | b'-')) = cursor.peek().kind {
            cursor.next();
            let other = self.product(cursor, depth);
            value = self.arithmetic(operator, &value, &other);
        }
        value
    }

    fn product(&mut self, cursor: &mut Cursor<'a>, depth: usize) -> Value {
        let mut value = self.geometric(cursor, depth);
        while let LexemeKind::Mark(operator @ (b'*' | b'/')) = cursor.peek().kind {
            cursor.next();
            let other = self.geometric(cursor, depth);
            value = self.arithmetic(operator, &value, &other);
        }
        value
    }

    fn arithmetic(&mut self, operator: u8, a: &Value, b: &Value) -> Value {
        self.pin(a);
        self.pin(b);
        let (Some(a), Some(b)) = (a.number(), b.number()) else { return Value::unknown(Reason::Computed) };
        let value = match operator {
            b'+' => a + b,
            b'-' => a - b,
            b'*' => a * b,
            // Two INT give an INT: where that matters, which they are is not looked at.
            _ if b == 0.0 || a.fract() == 0.0 && b.fract() == 0.0 && (a / b).fract() != 0.0 => {
                return Value::unknown(Reason::Computed);
            }
            _ => a / b,
        };
        if value.is_finite() { Value::Number(value, None) } else { Value::unknown(Reason::Computed) }
    }

    /// `frame : position`
    fn geometric(&mut self, cursor: &mut Cursor<'a>, depth: usize) -> Value {
        let mut value = self.unary(cursor, depth);
        while cursor.accept_mark(b':') {
            let other = self.unary(cursor, depth);
            self.pin(&value);
            self.pin(&other);
            value = chained(&value, &other).unwrap_or(Value::unknown(Reason::ChainOfUnknown));
        }
        value
    }

    fn unary(&mut self, cursor: &mut Cursor<'a>, depth: usize) -> Value {
        let lexeme = cursor.peek();
        if depth > MAX_DEPTH {
            cursor.next();
            return Value::unknown(Reason::ExpressionTooDeep);
        }
        match lexeme.kind {
            LexemeKind::Mark(sign @ (b'-' | b'+')) => {
                cursor.next();
                let next = cursor.peek();
                if next.kind == LexemeKind::Number {
                    cursor.next();
                    return literal(cursor, Span::new(lexeme.start, next.end), sign == b'-');
                }
                let value = self.unary(cursor, depth + 1);
                self.pin(&value);
                let signed = |v: f64| Value::Number(if sign == b'-' { -v } else { v }, None);
                value.number().map_or(Value::unknown(Reason::Computed), signed)
            }
            LexemeKind::Word if cursor.is_at(b"NOT") || cursor.is_at(b"B_NOT") => {
                cursor.next();
                let value = self.unary(cursor, depth + 1);
                value.bool().map_or(Value::unknown(Reason::Computed), |v| Value::Bool(!v))
            }
            _ => self.primary(cursor, depth),
        }
    }

    fn primary(&mut self, cursor: &mut Cursor<'a>, depth: usize) -> Value {
        let lexeme = cursor.peek();
        match lexeme.kind {
            LexemeKind::Number => {
                cursor.next();
                literal(cursor, lexeme.span(), false)
            }
            LexemeKind::Bits => {
                cursor.next();
                bits(cursor.text(lexeme)).map_or(Value::unknown(Reason::NotABitString), |v| Value::Number(v, None))
            }
            LexemeKind::Text => {
                cursor.next();
                Value::Text(cursor.text(lexeme).into())
            }
            LexemeKind::Mark(b'#') => {
                cursor.next();
                let word = cursor.next();
                Value::Constant(upper(cursor.text(word)))
            }
            LexemeKind::Mark(b'(') => {
                cursor.next();
                let value = self.expression_at(cursor, depth + 1);
                cursor.accept_mark(b')');
                self.pin(&value);
                value
            }
            LexemeKind::Mark(b'{') => self.aggregate(cursor, depth + 1),
            LexemeKind::Word => self.word(cursor, depth),
            _ => {
                cursor.next();
                Value::unknown(Reason::Expression)
            }
        }
    }

    fn word(&mut self, cursor: &mut Cursor<'a>, depth: usize) -> Value {
        let name = upper(cursor.text(cursor.peek()));
        match &name[..] {
            b"TRUE" | b"FALSE" => {
                cursor.next();
                return Value::Bool(name[0] == b'T');
            }
            _ => {}
        }
        let mut behind = *cursor;
        behind.next();
        if behind.peek().kind == LexemeKind::Mark(b'(') {
            *cursor = behind;
            return self.function(&name, cursor, depth);
        }
        match self.path(cursor, depth) {
            Some(path) => self.read(&path),
            None => Value::unknown(Reason::NotAName),
        }
    }

    /// `name[i,j].component…`
    pub(super) fn path(&mut self, cursor: &mut Cursor<'a>, depth: usize) -> Option<Path> {
        let first = cursor.accept(LexemeKind::Word)?;
        let name = upper(cursor.text(first));
        let id = self.resolve(&name);
        let label = decode(cursor.text(first)).into_owned();
        let mut path = Path { id, name, steps: Vec::new(), known: true, label };
        loop {
            if cursor.accept_mark(b'[') {
                // `name[]` is the whole of it.
                let mut indices = Vec::new();
                while !cursor.is_done() && !cursor.accept_mark(b']') {
                    if cursor.accept_mark(b',') {
                        continue;
                    }
                    let value = self.expression_at(cursor, depth + 1);
                    self.pin(&value);
                    indices.push(value.index());
                }
                let all: Option<Vec<i64>> = indices.iter().copied().collect();
                let element = all.as_deref().and_then(flat);
                path.known &= element.is_some() || all.as_ref().is_some_and(Vec::is_empty);
                if let (Some(element), Some(all)) = (element, all) {
                    path.steps.push(Step::Element(element));
                    let shown: Vec<String> = all.iter().map(ToString::to_string).collect();
                    path.label += &format!("[{}]", shown.join(","));
                }
            } else if cursor.peek().kind == LexemeKind::Mark(b'.') {
                cursor.next();
                let word = cursor.accept(LexemeKind::Word)?;
                path.steps.push(Step::Component(upper(cursor.text(word))));
                path.label += &format!(".{}", decode(cursor.text(word)));
            } else {
                return Some(path);
            }
        }
    }

    /// What stands at a path; what it may be is pinned where it is not known.
    pub(super) fn read(&mut self, path: &Path) -> Value {
        if path.name.first() == Some(&b'$') && !names::SETTLED.contains(&&path.name[..]) {
            return Value::unknown(Reason::SystemValue);
        }
        let whole = self.value(path.id);
        if self.volatile.contains(&path.id) {
            self.pin(&whole);
            return whole.get(&path.steps).forgotten(Reason::AnyMoment);
        }
        if !path.known {
            self.pin(&whole);
            return Value::unknown(Reason::IndexUnknown);
        }
        if self.symbols.is_table(path.id)
            && let (Value::Array(items), Some(Step::Element(at))) = (&whole, path.steps.first())
            && !items.contains_key(at)
            && !items.contains_key(&REST)
        {
            let own = Value::Own(format!("{}[{at}]", decode(&path.name)).into());
            return own.get(&path.steps[1..]);
        }
        let value = whole.get(&path.steps);
        match value {
            Value::Unknown(_, Some(_)) => self.pin(&value),
            // An INT takes no decimals.
            Value::Number(number, Some(_)) if !self.symbols.is_real(path.id, &path.steps) => {
                self.pin(&value);
                return Value::Number(number, None);
            }
            _ => {}
        }
        value
    }

    /// `{[TYPE:] X 1.0, Y 2.0, …}`
    fn aggregate(&mut self, cursor: &mut Cursor<'a>, depth: usize) -> Value {
        let start = cursor.rest().start;
        cursor.accept_mark(b'{');
        let mut behind = *cursor;
        if behind.accept(LexemeKind::Word).is_some() && behind.accept_mark(b':') {
            *cursor = behind;
        }
        let mut fields: Vec<(Name, Value)> = Vec::with_capacity(6);
        let mut twice = false;
        while let Some(name) = cursor.accept(LexemeKind::Word) {
            let name = upper(cursor.text(name));
            if cursor.accept_mark(b'[') {
                while !cursor.is_done() && !cursor.accept_mark(b']') {
                    cursor.next();
                }
            }
            let value = self.sum(cursor, depth);
            twice |= fields.iter().any(|(known, _)| *known == name);
            fields.push((name, value));
            if !cursor.accept_mark(b',') {
                break;
            }
        }
        if twice {
            fields.iter().for_each(|(_, value)| self.pin(value));
            cursor.accept_mark(b'}');
            self.refuse(Span { start, end: cursor.rest().start }, Reason::ComponentTwice);
            Value::unknown(Reason::ComponentTwice)
        } else if cursor.accept_mark(b'}') {
            Value::Record(Rc::new(fields))
        } else {
            // What it is made of is read, if nothing else.
            fields.iter().for_each(|(_, value)| self.pin(value));
            while !cursor.is_done() && !cursor.accept_mark(b'}') {
                cursor.next();
            }
            Value::unknown(Reason::Aggregate)
        }
    }
}

/// A number with its token.
fn literal(cursor: &Cursor<'_>, span: Span, negative: bool) -> Value {
    let text = &cursor.bytes[span.range()];
    let digits = text.strip_prefix(b"-").or_else(|| text.strip_prefix(b"+")).unwrap_or(text).trim_ascii_start();
    match number::read(digits) {
        Some(value) => Value::Number(if negative { -value } else { value }, NumberToken::new(cursor.source, span)),
        None => Value::unknown(Reason::NotANumber),
    }
}

/// `'B0101'`, `'H1F'`, `'D12'`.
fn bits(text: &[u8]) -> Option<f64> {
    let inner = text.get(1..text.len().checked_sub(1)?)?;
    let (kind, digits) = inner.split_first()?;
    let radix = match kind {
        b'B' | b'b' => 2,
        b'H' | b'h' => 16,
        b'D' | b'd' => 10,
        _ => return None,
    };
    u32::from_str_radix(std::str::from_utf8(digits).ok()?, radix).ok().map(f64::from)
}

/// Comparisons and logic of known values.
fn operate(operator: &[u8], a: &Value, b: &Value) -> Value {
    let unknown = Value::unknown(Reason::Computed);
    if let (Some(a), Some(b)) = (a.bool(), b.bool()) {
        return match operator {
            b"AND" => Value::Bool(a && b),
            b"OR" => Value::Bool(a || b),
            b"EXOR" | b"<>" => Value::Bool(a != b),
            b"==" => Value::Bool(a == b),
            _ => unknown,
        };
    }
    // One side may be enough.
    match (operator, a.bool().or(b.bool())) {
        (b"AND", Some(false)) => return Value::Bool(false),
        (b"OR", Some(true)) => return Value::Bool(true),
        _ => {}
    }
    if let (Value::Constant(a), Value::Constant(b)) = (a, b) {
        return match operator {
            b"==" => Value::Bool(a == b),
            b"<>" => Value::Bool(a != b),
            _ => unknown,
        };
    }
    let (Some(a), Some(b)) = (a.number(), b.number()) else { return unknown };
    #[allow(clippy::float_cmp)] // whole numbers
    if a.fract() == 0.0 && b.fract() == 0.0 || (a - b).abs() > SAME * (1.0 + a.abs()) {
        return match operator {
            b"==" => Value::Bool(a == b),
            b"<>" => Value::Bool(a != b),
            b"<" => Value::Bool(a < b),
            b">" => Value::Bool(a > b),
            b"<=" => Value::Bool(a <= b),
            b">=" => Value::Bool(a >= b),
            _ => unknown,
        };
    }
    unknown
}

impl Runner<'_> {
    /// Whether a value is among those of a CASE.
    pub(super) fn is_among(&mut self, subject: &Value, values: Span) -> Option<bool> {
        let mut cursor = self.cursor(values);
        let mut sure = true;
        while !cursor.is_done() {
            let value = self.sum(&mut cursor, 0);
            self.pin(&value);
            match operate(b"==", subject, &value).bool() {
                Some(true) => return Some(true),
                Some(false) => {}
                None => sure = false,
            }
            if !cursor.accept_mark(b',') {
                break;
            }
        }
        sure.then_some(false)
    }
}
