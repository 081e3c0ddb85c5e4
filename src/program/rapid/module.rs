//! Modules: declarations and routines, found by a shallow pass over the tokens.

use super::expr::{Cursor, Expr, upper};
use super::lex::{ASSIGN, Kind, Token, lex};
use crate::text::{Source, Span};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

/// One module file, lexed.
pub(super) struct Module {
    pub(super) tokens: Vec<Token>,
}

/// A declared datum.
#[derive(Clone, Debug)]
pub(super) struct Datum {
    /// Type, upper case.
    pub(super) kind: String,
    pub(super) source: usize,
    /// As the author spelled it.
    pub(super) name: String,
    /// Initial value.
    pub(super) value: Option<Expr>,
}

/// A routine.
#[derive(Clone, Debug)]
pub(super) struct Routine {
    pub(super) source: usize,
    /// Parameters, upper case, in order (optional ones with a backslash).
    pub(super) parameters: Vec<String>,
    /// Tokens of the body.
    pub(super) body: Range<usize>,
    pub(super) is_proc: bool,
}

/// Names of all modules together.
#[derive(Default)]
pub(super) struct Symbols {
    pub(super) data: BTreeMap<String, Datum>,
    pub(super) routines: BTreeMap<String, Routine>,
    /// Routines in the order of the files.
    pub(super) order: Vec<String>,
    /// Names that a statement assigns: their values are not known at read time.
    pub(super) assigned: BTreeSet<String>,
    /// Declarations that were not understood.
    pub(super) bad: Vec<(usize, Span)>,
    pub(super) modules: usize,
}

impl Module {
    pub(super) fn new(source: &Source) -> Self {
        Self { tokens: lex(&source.bytes) }
    }
}

/// A word of a token, upper case; empty for others.
pub(super) fn word(bytes: &[u8], token: Option<&Token>) -> String {
    match token {
        Some(token) if token.kind == Kind::Word => upper(&bytes[token.span.range()]),
        _ => String::new(),
    }
}

/// Index behind the next `;` at any depth, or `end`.
pub(super) fn statement_end(tokens: &[Token], from: usize, end: usize) -> usize {
    (from..end).find(|&i| tokens[i].kind == Kind::Mark(b';')).unwrap_or(end)
}

impl Symbols {
    /// Adds a module's declarations.
    pub(super) fn add(&mut self, source: usize, bytes: &[u8], tokens: &[Token]) {
        let mut at = 0;
        while at < tokens.len() {
            match word(bytes, tokens.get(at)).as_str() {
                "MODULE" | "SYSMODULE" => {
                    self.modules += 1;
                    at += 1;
                }
                "CONST" | "PERS" | "VAR" => {
                    let end = statement_end(tokens, at, tokens.len());
                    self.datum(source, bytes, tokens, at, end);
                    at = end;
                }
                kind @ ("PROC" | "FUNC" | "TRAP") => at = self.routine(source, bytes, tokens, at, kind),
                "RECORD" => {
                    let close = (at..tokens.len()).find(|&i| word(bytes, tokens.get(i)) == "ENDRECORD");
                    at = close.unwrap_or(tokens.len());
                }
                _ => at += 1,
            }
        }
    }

    fn datum(&mut self, source: usize, bytes: &[u8], tokens: &[Token], at: usize, end: usize) {
        let kind = word(bytes, tokens.get(at + 1));
        let Some(name) = tokens.get(at + 2).filter(|t| t.kind == Kind::Word && at + 2 < end) else {
            self.bad.push((source, tokens[at].span));
            return;
        };
        let assign = (at + 3..end).find(|&i| tokens[i].kind == Kind::Mark(ASSIGN));
        let value = assign.and_then(|assign| {
            let mut cursor = Cursor { bytes, tokens: &tokens[..end], at: assign + 1 };
            cursor.expr(0).filter(|_| cursor.done())
        });
        if assign.is_some() && value.is_none() {
            self.bad.push((source, tokens[at].span.to(tokens[end - 1].span)));
        }
        let spelled: String = bytes[name.span.range()].iter().map(|&b| b as char).collect();
        let datum = Datum { kind, source, name: spelled.clone(), value };
        // The first declaration stands: the program's own modules come before the context.
        self.data.entry(upper(spelled.as_bytes())).or_insert(datum);
    }

    fn routine(&mut self, source: usize, bytes: &[u8], tokens: &[Token], at: usize, kind: &str) -> usize {
        let closing = format!("END{kind}");
        let end = (at..tokens.len()).find(|&i| word(bytes, tokens.get(i)) == closing).unwrap_or(tokens.len());
        let name_at = if kind == "FUNC" { at + 2 } else { at + 1 };
        let name = word(bytes, tokens.get(name_at));
        let mut body = name_at + 1;
        let mut parameters = Vec::new();
        if tokens.get(body).is_some_and(|t| t.kind == Kind::Mark(b'(')) {
            let close = (body..end).find(|&i| tokens[i].kind == Kind::Mark(b')')).unwrap_or(body);
            let mut optional = false;
            let mut last = None;
            for i in body + 1..=close {
                match tokens[i].kind {
                    Kind::Mark(b'\\') => optional = true,
                    Kind::Word => last = Some(word(bytes, tokens.get(i))),
                    Kind::Mark(b',' | b')' | b'|') => {
                        if let Some(name) = last.take() {
                            parameters.push(if optional { format!("\\{name}") } else { name });
                        }
                        optional = false;
                    }
                    _ => {}
                }
            }
            body = close + 1;
        }
        // Local data and assignments of the body.
        let mut i = body;
        while i < end {
            match tokens[i].kind {
                Kind::Mark(ASSIGN) if i > body && self.is_assignment(tokens, body, i) => {
                    let start =
                        (body..i).rev().find(|&k| matches!(tokens[k].kind, Kind::Mark(b';'))).map_or(body, |k| k + 1);
                    // The name nearest before, skipping indices and components, is the statement's first word.
                    let first = (start..i).rev().find(|&k| starts_statement(bytes, tokens, start, k)).unwrap_or(start);
                    self.assigned.insert(word(bytes, tokens.get(first)));
                    i += 1;
                }
                Kind::Word if matches!(word(bytes, tokens.get(i)).as_str(), "CONST" | "PERS" | "VAR") => {
                    let stop = statement_end(tokens, i, end);
                    self.datum(source, bytes, tokens, i, stop);
                    i = stop;
                }
                _ => i += 1,
            }
        }
        if !name.is_empty() {
            self.order.push(name.clone());
            let routine = Routine { source, parameters, body: body..end, is_proc: kind == "PROC" };
            self.routines.entry(name).or_insert(routine);
        }
        end
    }

    /// Whether `:=` at `i` assigns, and is not the value of an optional argument or a named one.
    fn is_assignment(&self, tokens: &[Token], body: usize, i: usize) -> bool {
        let mut k = i;
        let mut depth = 0;
        while k > body {
            k -= 1;
            match tokens[k].kind {
                Kind::Mark(b'}' | b')' | b']') => depth += 1,
                Kind::Mark(b'{' | b'(' | b'[') if depth > 0 => depth -= 1,
                Kind::Mark(b'\\' | b',' | b'(' | b'[') if depth == 0 => return false,
                Kind::Mark(b';') => return true,
                _ => {}
            }
        }
        true
    }
}

/// Whether the assigned name can start at token `k`: a word not behind a point, with only indices after it.
fn starts_statement(bytes: &[u8], tokens: &[Token], start: usize, k: usize) -> bool {
    let reserved = ["THEN", "DO", "ELSE"];
    tokens[k].kind == Kind::Word
        && (k == start || {
            let before = &tokens[k - 1];
            before.kind == Kind::Comment
                || before.kind == Kind::Mark(b':')
                || reserved.contains(&word(bytes, Some(before)).as_str())
        })
}
