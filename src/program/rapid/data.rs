//! What variables hold while the program runs, and what is no longer known of them.

use super::eval::{RUN_TIME, Scope};
use super::lex::{Cursor, Kind};
use super::motion::{self, Call};
use super::run::Runner;
use super::symbols::{Content, Upper, Variable, first_word};
use super::tree::{Statement, Storage};
use super::value::{Value, parts};
use crate::text::{Span, decode};
use std::sync::Arc;

const CHANGED: &str = "target changed at run time";

impl<'a> Runner<'a> {
    /// The variable that a name means.
    pub(super) fn find(&self, scope: Scope, key: &[u8]) -> Option<usize> {
        let local = self.frames.last().filter(|_| scope.local).and_then(|f| f.names.get(key)).copied();
        local.or_else(|| self.symbols.find_data(scope.module, key))
    }

    /// Whether a variable belongs to the running routine.
    pub(super) fn local_data(&self, at: usize) -> bool {
        self.frames.last().is_some_and(|f| f.names.values().any(|v| *v == at))
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
            value = value.without_tokens();
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

    pub(super) fn new_variable(
        &mut self,
        bytes: &[u8],
        file: usize,
        module: usize,
        kind: Span,
        name: Span,
        value: Value,
    ) -> usize {
        self.symbols.variables.push(Variable {
            name: decode(&bytes[name.range()]).as_ref().into(),
            kind: Arc::from(&*Upper::new(&bytes[kind.range()])),
            storage: Storage::Var,
            #[allow(clippy::cast_possible_truncation)]
            source: file as u16,
            module,
            content: Content::Is(value),
            assigned: false,
            volatile: false,
            declared: None,
        });
        self.symbols.variables.len() - 1
    }

    pub(super) fn assign(&mut self, scope: Scope, target: Span, value: Span) {
        let bytes = self.bytes(scope.source as usize);
        let value = self.evaluate(scope, value);
        self.pin_value(&value);
        (self.epoch, self.changes) = (self.epoch + 1, self.changes + 1);
        let word = first_word(bytes, target);
        let Some(at) = self.find(scope, &Upper::new(&bytes[word.range()])) else { return };
        let whole = word == target;
        let new = if self.unsure > 0 || !whole && !self.store(scope, at, target, &value) {
            Value::Unknown(RUN_TIME)
        } else if whole {
            value.detached(RUN_TIME)
        } else {
            return;
        };
        self.symbols.variables[at].content = Content::Is(new);
    }

    /// Stores into a component or element; false where that place is not known.
    pub(super) fn store(&mut self, scope: Scope, at: usize, target: Span, value: &Value) -> bool {
        let bytes = self.bytes(scope.source as usize);
        let mut cursor = Cursor::new(bytes, target);
        cursor.next();
        let mut path = Vec::new();
        let mut kind = Arc::clone(&self.symbols.variables[at].kind);
        loop {
            let lexeme = cursor.next();
            match lexeme.kind {
                Kind::End => break,
                Kind::Mark(b'.') => {
                    let field = cursor.next();
                    let Some((index, next)) = self.field(&kind, &Upper::new(cursor.text(field))) else { return false };
                    path.push(index);
                    kind = next;
                }
                Kind::Mark(b'{') => {
                    let mut call = Call::empty(target);
                    let from = cursor.peek().start;
                    let mut end = from;
                    while !matches!(cursor.peek().kind, Kind::Mark(b'}') | Kind::End) {
                        end = cursor.next().end;
                    }
                    cursor.accept(Kind::Mark(b'}'));
                    let mut inner = Cursor::new(bytes, Span::new(from, end));
                    if motion::arguments(&mut inner, scope.source, &mut call).is_none() {
                        return false;
                    }
                    for index in call.positional() {
                        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
                        match self.evaluate(scope, *index).num() {
                            Some(i) if i >= 1.0 => path.push(i.round() as usize - 1),
                            _ => return false,
                        }
                    }
                }
                _ => return false,
            }
        }
        let old = self.content(at).detached(RUN_TIME);
        match replaced(&old, &path, &value.detached(RUN_TIME)) {
            Some(new) => {
                self.symbols.variables[at].content = Content::Is(new);
                true
            }
            None => false,
        }
    }

    /// Data that a block changes are not known while and after it runs an unknown number of times.
    pub(super) fn forget_assigned(&mut self, body: &[Statement]) {
        let Some(frame) = self.frames.last() else { return };
        let mut own = Vec::new();
        self.symbols.assigned_names(frame.routine, body, &mut own);
        let module = frame.module;
        let mut names: Vec<_> = own.into_iter().map(|n| (true, module, n)).collect();
        for callee in self.reached(frame.routine, body) {
            let module = self.symbols.module_of(callee);
            names.extend(self.symbols.changed_by(callee).iter().map(|n| (false, module, n.clone())));
        }
        (self.epoch, self.changes) = (self.epoch + 1, self.changes + 1);
        for (local, module, name) in names {
            if let Some(at) = self.find(Scope { source: 0, module, local }, &name) {
                self.symbols.variables[at].content = Content::Is(Value::Unknown(RUN_TIME));
            }
        }
    }

    /// The same for a function, which is not followed: what it changes through its arguments, and of the module.
    pub(super) fn forget_what_a_function_changes(&mut self, scope: Scope, call: &Call) {
        let bytes = self.bytes(scope.source as usize);
        for word in self.symbols.changed_arguments(scope.module, bytes, call) {
            if let Some(at) = self.find(scope, &Upper::new(&bytes[word.range()])) {
                self.symbols.variables[at].content = Content::Is(Value::Unknown(RUN_TIME));
                (self.epoch, self.changes) = (self.epoch + 1, self.changes + 1);
            }
        }
        let Some(id) = self.symbols.find_routine(scope.module, &bytes[call.name.range()]) else { return };
        let mut names = Vec::new();
        self.symbols.assigned_names(id, &self.symbols.routine(id).body, &mut names);
        for name in names {
            if let Some(at) = self.symbols.find_data(self.symbols.module_of(id), &name) {
                self.symbols.variables[at].content = Content::Is(Value::Unknown(RUN_TIME));
                self.epoch += 1;
            }
        }
    }

    /// `Incr`, `Decr`, `Add`, `Clear`.
    pub(super) fn step_variable(&mut self, scope: Scope, call: &Call, name: &[u8]) {
        let bytes = self.bytes(scope.source as usize);
        let Some(&first) = call.positional().first() else { return };
        let word = first_word(bytes, first);
        let Some(at) = self.find(scope, &Upper::new(&bytes[word.range()])) else { return };
        (self.epoch, self.changes) = (self.epoch + 1, self.changes + 1);
        let by = match name {
            b"INCR" => Some(1.0),
            b"DECR" => Some(-1.0),
            b"ADD" => call.positional().get(1).and_then(|a| self.evaluate(scope, *a).num()),
            _ => None,
        };
        let old = if name == b"CLEAR" { Some(0.0) } else { self.content(at).num() };
        let new = match (old, by) {
            _ if self.unsure > 0 || word != first => None,
            (Some(old), Some(by)) => Some(old + by),
            (Some(_), None) if name == b"CLEAR" => Some(0.0),
            _ => None,
        };
        let value = new.map_or(Value::Unknown(RUN_TIME), |v| Value::Num(v, None));
        self.symbols.variables[at].content = Content::Is(value);
    }
}

/// `value` with the item at `path` replaced.
fn replaced(value: &Value, path: &[usize], new: &Value) -> Option<Value> {
    let Some((first, rest)) = path.split_first() else { return Some(new.clone()) };
    let list = match value {
        Value::Target(pose) => parts(pose),
        other => other.clone(),
    };
    let mut items = list.list()?.to_vec();
    let item = items.get_mut(*first)?;
    *item = replaced(item, rest, new)?;
    Some(Value::List(items.into(), None))
}
