//! Expressions: aggregates, references, calls; numbers keep the place of their tokens.

use super::lex::{ASSIGN, Kind, Token};
use crate::text::{Span, number};

/// Brackets nest at most this deep: deeper is no program, and the stack is not a place for input.
const DEEPEST: usize = 48;

/// An expression.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Expr {
    /// A number; `token` covers sign and digits where it is a literal.
    Number { value: f64, token: Option<Span> },
    /// TRUE or FALSE.
    Bool(bool),
    /// A string, quotes taken off.
    Text(Vec<u8>),
    /// `[…]`.
    List(Vec<Expr>),
    /// A name, upper case, with indices.
    Name { name: String, indices: Vec<Expr>, span: Span },
    /// A function call.
    Call { name: String, args: Vec<Arg>, span: Span },
    /// `a op b`.
    Binary(Box<Expr>, u8, Box<Expr>),
    /// Something that is not modelled: components, logic.
    Other,
}

/// An argument.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Arg {
    /// Name of an optional argument (`\WObj`), upper case.
    pub(super) option: Option<String>,
    /// Its value; a switch has none.
    pub(super) value: Option<Expr>,
    /// All of it.
    pub(super) span: Span,
}

/// A reader of tokens.
pub(super) struct Cursor<'a> {
    pub(super) bytes: &'a [u8],
    pub(super) tokens: &'a [Token],
    pub(super) at: usize,
}

impl Cursor<'_> {
    fn peek(&self) -> Option<Token> {
        self.tokens[self.at..].iter().find(|t| t.kind != Kind::Comment).copied()
    }

    fn next(&mut self) -> Option<Token> {
        while let Some(token) = self.tokens.get(self.at) {
            self.at += 1;
            if token.kind != Kind::Comment {
                return Some(*token);
            }
        }
        None
    }

    fn take(&mut self, mark: u8) -> bool {
        let found = self.peek().is_some_and(|t| t.kind == Kind::Mark(mark));
        if found {
            self.next();
        }
        found
    }

    pub(super) fn done(&self) -> bool {
        self.peek().is_none()
    }

    fn word(&self, token: Token) -> String {
        upper(&self.bytes[token.span.range()])
    }

    /// An expression, or `None` where there is none that is understood.
    pub(super) fn expr(&mut self, depth: usize) -> Option<Expr> {
        let mut left = self.term(depth)?;
        while let Some(Token { kind: Kind::Mark(op @ (b'+' | b'-')), .. }) = self.peek() {
            self.next();
            let right = self.term(depth)?;
            left = Expr::Binary(Box::new(left), op, Box::new(right));
        }
        // Comparisons and logic are not evaluated, but must not stop the reading.
        while let Some(token) = self.peek() {
            let logic = match token.kind {
                Kind::Mark(b'=' | b'<' | b'>') => true,
                Kind::Word => matches!(self.word(token).as_str(), "AND" | "OR" | "XOR"),
                _ => false,
            };
            if !logic {
                break;
            }
            self.next();
            while self.take(b'=') || self.take(b'>') {}
            self.term(depth)?;
            left = Expr::Other;
        }
        Some(left)
    }

    fn term(&mut self, depth: usize) -> Option<Expr> {
        let mut left = self.primary(depth)?;
        loop {
            let Some(next) = self.peek() else { return Some(left) };
            let op = match next {
                Token { kind: Kind::Mark(op @ (b'*' | b'/')), .. } => op,
                token if token.kind == Kind::Word && matches!(self.word(token).as_str(), "DIV" | "MOD") => b'?',
                _ => return Some(left),
            };
            self.next();
            let right = self.primary(depth)?;
            left = if op == b'?' { Expr::Other } else { Expr::Binary(Box::new(left), op, Box::new(right)) };
        }
    }

    fn primary(&mut self, depth: usize) -> Option<Expr> {
        if depth > DEEPEST {
            return None;
        }
        let token = self.next()?;
        match token.kind {
            Kind::Number => {
                let value = number::read(&self.bytes[token.span.range()])?;
                Some(Expr::Number { value, token: Some(token.span) })
            }
            Kind::Text => {
                let text = &self.bytes[token.span.range()];
                Some(Expr::Text(text.get(1..text.len().saturating_sub(1)).unwrap_or_default().to_vec()))
            }
            Kind::Mark(sign @ (b'-' | b'+')) => match self.primary(depth + 1)? {
                Expr::Number { value, token: digits } => {
                    let value = if sign == b'-' { -value } else { value };
                    Some(Expr::Number { value, token: digits.map(|digits| token.span.to(digits)) })
                }
                other => Some(Expr::Binary(Box::new(Expr::Number { value: 0.0, token: None }), sign, Box::new(other))),
            },
            Kind::Mark(b'[') => {
                let mut items = Vec::new();
                if self.take(b']') {
                    return Some(Expr::List(items));
                }
                loop {
                    items.push(self.expr(depth + 1)?);
                    if self.take(b']') {
                        return Some(Expr::List(items));
                    }
                    if !self.take(b',') {
                        return None;
                    }
                }
            }
            Kind::Mark(b'(') => {
                let inner = self.expr(depth + 1)?;
                self.take(b')').then_some(match inner {
                    // A bracketed literal is an expression: its token alone is not the value's.
                    Expr::Number { value, .. } => Expr::Number { value, token: None },
                    other => other,
                })
            }
            Kind::Mark(b'<') => {
                // A placeholder such as <EXP>.
                self.next()?;
                self.take(b'>').then_some(Expr::Other)
            }
            Kind::Word => self.named(token, depth),
            _ => None,
        }
    }

    fn named(&mut self, token: Token, depth: usize) -> Option<Expr> {
        let name = self.word(token);
        match name.as_str() {
            "TRUE" => return Some(Expr::Bool(true)),
            "FALSE" => return Some(Expr::Bool(false)),
            "NOT" => {
                self.primary(depth + 1)?;
                return Some(Expr::Other);
            }
            _ => {}
        }
        if self.take(b'(') {
            let args = self.args(depth + 1, Some(b')'))?;
            let end = self.tokens[self.at - 1].span;
            return Some(Expr::Call { name, args, span: token.span.to(end) });
        }
        let mut indices = Vec::new();
        let mut span = token.span;
        if self.take(b'{') {
            loop {
                indices.push(self.expr(depth + 1)?);
                if self.take(b'}') {
                    break;
                }
                if !self.take(b',') {
                    return None;
                }
            }
            span = span.to(self.tokens[self.at - 1].span);
        }
        if self.peek().is_some_and(|t| t.kind == Kind::Mark(b'.')) {
            // A component: what it holds is not followed.
            while self.take(b'.') {
                self.next()?;
                while self.take(b'{') {
                    self.expr(depth + 1)?;
                    self.take(b'}');
                }
            }
            return Some(Expr::Other);
        }
        Some(Expr::Name { name, indices, span })
    }

    /// Arguments to `close`, or to the end of the tokens.
    pub(super) fn args(&mut self, depth: usize, close: Option<u8>) -> Option<Vec<Arg>> {
        let mut args = Vec::new();
        loop {
            if let Some(close) = close {
                if self.take(close) {
                    return Some(args);
                }
            } else if self.done() {
                return Some(args);
            }
            if self.take(b',') {
                continue;
            }
            let start = self.peek()?.span;
            let mut option = None;
            let mut value = None;
            if self.take(b'\\') {
                let token = self.next()?;
                option = Some(self.word(token));
                if self.take(ASSIGN) || self.take(b'?') {
                    value = Some(self.expr(depth)?);
                }
            } else {
                value = Some(self.expr(depth)?);
                // A named argument (`ToPoint:=p10`).
                if self.take(ASSIGN) {
                    value = Some(self.expr(depth)?);
                }
                // `*` marks, array wildcards and the like are no expressions.
            }
            args.push(Arg { option, value, span: start.to(self.tokens[self.at - 1].span) });
        }
    }
}

/// Upper case, bytes as Latin-1: RAPID names are case-insensitive.
pub(super) fn upper(bytes: &[u8]) -> String {
    bytes.iter().map(|b| b.to_ascii_uppercase() as char).collect()
}
