//! Finds the ends of statements and expressions, and reads what is before them.

use super::expression::{Arguments, Expression};
use super::lex::{Key, Lexeme, LexemeKind, key};
use super::literal::Literal;
use super::parser::{Parser, Scan};
use super::syntax::Reader;
use super::tree::{Statement, StatementKind};
use crate::Reason;
use deflex_text::Span;

impl Parser<'_> {
    /// A call, an assignment, a label or an unreadable statement.
    pub(super) fn simple(&mut self, start: Lexeme) -> Option<Statement> {
        self.cursor.pass(start);
        match start.kind {
            LexemeKind::Mark(b';') => return None,
            LexemeKind::Placeholder => {
                self.cursor.accept(LexemeKind::Mark(b';'));
                return None;
            }
            LexemeKind::Word if self.cursor.accept(LexemeKind::Mark(b':')).is_some() => {
                let name = self.cursor.text(start).to_ascii_uppercase().into();
                return Some(Statement { kind: StatementKind::Label(name), at: start.span() });
            }
            _ => {}
        }
        let literals = self.file.literals.len();
        let end = self.scan();
        let at = Span::new(start.start, self.cursor.passed);
        match end {
            Scan::Broken(reason) => self.odd(start.start, reason),
            Scan::Done if !matches!(start.kind, LexemeKind::Word | LexemeKind::Mark(b'%')) => {
                self.odd(start.start, Reason::NotAStatement)
            }
            Scan::Done => return Some(Statement { kind: self.reader(at, literals).statement(), at }),
        }
        None
    }

    /// A reader of a stretch that was scanned, whose first robtarget has the index `first`.
    pub(super) fn reader(&self, stretch: Span, first: usize) -> Reader<'_> {
        Reader::new(self.cursor.bytes, stretch, &self.file.literals[first..], first)
    }

    /// Passes the rest of a statement with its `;`, noting robtarget literals. `;` does not occur in
    /// brackets, so it always ends one; so does a word that opens or closes a block.
    pub(super) fn scan(&mut self) -> Scan {
        let mut depth = 0_usize;
        let mut operand =
            self.cursor.bytes[..self.cursor.passed].last().is_some_and(|b| matches!(b, b']' | b')' | b'}'));
        let mut words = usize::from(!operand);
        let mut placeholder = false;
        loop {
            let before = self.cursor.passed;
            let lexeme = self.cursor.peek();
            match lexeme.kind {
                LexemeKind::End => {
                    return Scan::Broken(if depth > 0 { Reason::BracketUnclosed } else { Reason::NoSemicolon });
                }
                LexemeKind::Mark(b';') => {
                    self.cursor.pass(lexeme);
                    return match depth {
                        0 if placeholder => Scan::Broken(Reason::PlaceholderStatement),
                        0 => Scan::Done,
                        _ => Scan::Broken(Reason::BracketUnclosed),
                    };
                }
                LexemeKind::Mark(b'[') => {
                    if let Some(literal) = Literal::find(self.cursor.bytes, self.index, lexeme.start) {
                        let end = literal.span().end as usize;
                        self.file.literals.push(literal);
                        self.cursor.at = end;
                        self.cursor.passed = end;
                        operand = true;
                        continue;
                    }
                    (depth, operand) = (depth + 1, false);
                }
                LexemeKind::Mark(b'(' | b'{') => (depth, operand) = (depth + 1, false),
                LexemeKind::Mark(b']' | b')' | b'}') => {
                    if depth == 0 {
                        // Skip up to `;`, so that only this statement is lost.
                        self.cursor.pass(lexeme);
                        while !matches!(self.cursor.peek().kind, LexemeKind::End | LexemeKind::Mark(b';'))
                            && self.peek_key().is_none()
                        {
                            self.cursor.next();
                        }
                        self.cursor.accept(LexemeKind::Mark(b';'));
                        return Scan::Broken(Reason::BracketUnopened);
                    }
                    (depth, operand) = (depth - 1, true);
                }
                LexemeKind::Word => {
                    let text = self.cursor.text(lexeme);
                    let option = lexeme.start > 0 && matches!(self.cursor.bytes[lexeme.start - 1], b'\\' | b'.');
                    if let Some(found) = key(text)
                        && !option
                        && !(matches!(found, Key::Error | Key::Default | Key::Exit | Key::Test | Key::Task)
                            && depth > 0)
                    {
                        return Scan::Broken(if depth > 0 { Reason::BracketUnclosed } else { Reason::NoSemicolon });
                    }
                    let operator = is_operator(text);
                    if operand && depth == 0 && !operator && words > 0 {
                        let gap = &self.cursor.bytes[before..lexeme.start];
                        if gap.iter().any(|b| matches!(b, b'\n' | b'\r')) {
                            return Scan::Broken(Reason::NoSemicolon);
                        }
                    }
                    words += usize::from(operand);
                    operand = !operator;
                }
                LexemeKind::Number | LexemeKind::Text => operand = true,
                LexemeKind::Placeholder => (placeholder, operand) = (true, true),
                _ => operand = false,
            }
            self.cursor.pass(lexeme);
        }
    }

    /// An expression up to one of `words`, or up to anything that cannot be part of an expression.
    pub(super) fn expression(&mut self, words: &[&[u8]]) -> Expression {
        let stretch = self.expressions(words);
        self.reader(stretch, self.file.literals.len()).whole()
    }

    /// The values of a CASE.
    pub(super) fn values(&mut self) -> Arguments {
        let stretch = self.expressions(&[]);
        self.reader(stretch, self.file.literals.len()).arguments()
    }

    fn expressions(&mut self, words: &[&[u8]]) -> Span {
        let start = self.cursor.peek().start;
        self.cursor.passed = start;
        let mut depth = 0_usize;
        loop {
            let lexeme = self.cursor.peek();
            match lexeme.kind {
                LexemeKind::End | LexemeKind::Mark(b';') => break,
                LexemeKind::Mark(b'[' | b'(' | b'{') => depth += 1,
                LexemeKind::Mark(b']' | b')' | b'}') => depth = depth.saturating_sub(1),
                LexemeKind::Mark(b':') if depth == 0 => break,
                LexemeKind::Word => {
                    let text = self.cursor.text(lexeme);
                    if words.iter().any(|w| w.eq_ignore_ascii_case(text)) || key(text).is_some() {
                        break;
                    }
                }
                _ => {}
            }
            self.cursor.pass(lexeme);
        }
        Span::new(start, self.cursor.passed)
    }

    /// A condition up to THEN or, in the compact form, up to the first word after a complete operand.
    pub(super) fn condition_of_if(&mut self) -> Expression {
        let start = self.cursor.peek().start;
        self.cursor.passed = start;
        let (mut depth, mut operand) = (0_usize, false);
        loop {
            let lexeme = self.cursor.peek();
            match lexeme.kind {
                LexemeKind::End | LexemeKind::Mark(b';') => break,
                LexemeKind::Mark(b'[' | b'(' | b'{') => (depth, operand) = (depth + 1, false),
                LexemeKind::Mark(b']' | b')' | b'}') => (depth, operand) = (depth.saturating_sub(1), true),
                LexemeKind::Number | LexemeKind::Text => operand = true,
                LexemeKind::Mark(b'%') if depth == 0 && operand => break,
                LexemeKind::Word => {
                    let text = self.cursor.text(lexeme);
                    if key(text).is_some() {
                        break;
                    }
                    let operator = is_operator(text);
                    if operand && depth == 0 && !operator {
                        break;
                    }
                    operand = !operator;
                }
                _ => operand = false,
            }
            self.cursor.pass(lexeme);
        }
        self.reader(Span::new(start, self.cursor.passed), self.file.literals.len()).whole()
    }
}

fn is_operator(word: &[u8]) -> bool {
    [&b"DIV"[..], b"MOD", b"AND", b"OR", b"XOR", b"NOT", b"WITH", b"TO", b"STEP", b"FROM"]
        .iter()
        .any(|o| o.eq_ignore_ascii_case(word))
}
