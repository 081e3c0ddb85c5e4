//! Parses blocks: statements up to the word that ends them, with branches and loops.

use super::super::lex::{Cursor, Key, LexemeKind};
use super::super::parser::{Parser, Scan};
use super::super::tree::{Arm, Case, Connect, Data, For, If, Statement, StatementKind, Test, While};
use super::{MAX_DEPTH, TooDeep, storage};
use crate::Reason;
use deflex_text::Span;

impl Parser<'_> {
    /// Parses statements up to a word that ends this level, without passing that word.
    pub(super) fn block(&mut self, data: &mut Vec<Data>, depth: usize) -> Result<Vec<Statement>, TooDeep> {
        if depth > MAX_DEPTH {
            let here = self.cursor.peek().span();
            return Err(TooDeep(here));
        }
        let mut block = Vec::new();
        loop {
            let start = self.cursor.peek();
            if let Some(mark) = self.cursor.mark.take() {
                block.push(Statement { kind: StatementKind::Mark(mark), at: Span::new(start.start, start.start) });
            }
            let at = start.start;
            match self.key_of(start) {
                None if start.kind == LexemeKind::End => return Ok(block),
                None => {
                    if let Some(statement) = self.simple(start) {
                        block.push(statement);
                    }
                }
                Some(Key::Var | Key::Pers | Key::Const | Key::Task) => {
                    self.cursor.pass(start);
                    if let Some(k) = self.key_of(start).filter(|k| *k != Key::Task)
                        && let Some(found) = self.data(at, storage(k), false)
                    {
                        data.push(found);
                    }
                }
                Some(key @ (Key::If | Key::For | Key::While | Key::Test)) => {
                    self.cursor.pass(start);
                    block.extend(match key {
                        Key::If => self.condition(data, at, depth)?,
                        Key::For => self.counted(data, at, depth)?,
                        Key::While => Some(self.repeated(data, at, depth)?),
                        _ => Some(self.test(data, at, depth)?),
                    });
                }
                Some(
                    k @ (Key::Return | Key::Exit | Key::Raise | Key::Retry | Key::TryNext | Key::Goto | Key::Connect),
                ) => {
                    self.cursor.pass(start);
                    let statement = self.leaving(k, at);
                    block.push(statement);
                }
                Some(_) => return Ok(block),
            }
        }
    }

    fn close(&mut self, wanted: Key, head: Span) {
        let lexeme = self.cursor.peek();
        if self.key_of(lexeme) == Some(wanted) {
            self.cursor.pass(lexeme);
            // `ENDIF;` is not RAPID, yet programs contain it.
            self.cursor.accept(LexemeKind::Mark(b';'));
        } else {
            self.file.odd.push((head, Reason::BlockUnclosed));
        }
    }

    /// After IF: the block form, or the compact form with one statement and no THEN.
    fn condition(&mut self, data: &mut Vec<Data>, at: usize, depth: usize) -> Result<Option<Statement>, TooDeep> {
        let condition = self.condition_of_if();
        let head = Span::new(at, self.cursor.passed);
        let branch =
            |arms, otherwise| Statement { kind: StatementKind::If(Box::new(If { arms, otherwise })), at: head };
        if self.cursor.accept_word(b"THEN") {
            let mut arms = vec![Arm { condition, body: self.block(data, depth + 1)? }];
            let mut otherwise = Vec::new();
            loop {
                match self.peek_key() {
                    Some(Key::ElseIf) => {
                        self.cursor.next();
                        let condition = self.expression(&[b"THEN"]);
                        self.cursor.accept_word(b"THEN");
                        arms.push(Arm { condition, body: self.block(data, depth + 1)? });
                    }
                    Some(Key::Else) => {
                        self.cursor.next();
                        otherwise = self.block(data, depth + 1)?;
                    }
                    _ => break,
                }
            }
            self.close(Key::EndIf, head);
            return Ok(Some(branch(arms, otherwise)));
        }
        let start = self.cursor.peek();
        #[allow(clippy::cast_possible_truncation)] // no file is larger than 4 GiB
        self.file.after_compact_if.push(start.start as u32);
        let inner = match self.key_of(start) {
            Some(k @ (Key::Return | Key::Exit | Key::Raise | Key::Retry | Key::TryNext | Key::Goto)) => {
                self.cursor.pass(start);
                Some(self.leaving(k, start.start))
            }
            None if start.kind != LexemeKind::End => self.simple(start),
            _ => {
                self.odd(at, Reason::IfIncomplete);
                None
            }
        };
        Ok(inner.map(|statement| branch(vec![Arm { condition, body: vec![statement] }], Vec::new())))
    }

    /// After FOR.
    fn counted(&mut self, data: &mut Vec<Data>, at: usize, depth: usize) -> Result<Option<Statement>, TooDeep> {
        let variable = self.cursor.accept(LexemeKind::Word);
        let from_word = self.cursor.accept_word(b"FROM");
        let from = self.expression(&[b"TO", b"STEP", b"DO"]);
        let to_word = self.cursor.accept_word(b"TO");
        let to = self.expression(&[b"STEP", b"DO"]);
        let step = if self.cursor.accept_word(b"STEP") { Some(self.expression(&[b"DO"])) } else { None };
        self.cursor.accept_word(b"DO");
        let head = Span::new(at, self.cursor.passed);
        let body = self.block(data, depth + 1)?;
        self.close(Key::EndFor, head);
        let (Some(variable), true, true) = (variable, from_word, to_word) else {
            self.file.odd.push((head, Reason::ForIncomplete));
            return Ok(None);
        };
        let round = For { variable: variable.span(), from, to, step, body };
        Ok(Some(Statement { kind: StatementKind::For(Box::new(round)), at: head }))
    }

    /// After WHILE.
    fn repeated(&mut self, data: &mut Vec<Data>, at: usize, depth: usize) -> Result<Statement, TooDeep> {
        let condition = self.expression(&[b"DO"]);
        self.cursor.accept_word(b"DO");
        let head = Span::new(at, self.cursor.passed);
        let body = self.block(data, depth + 1)?;
        self.close(Key::EndWhile, head);
        Ok(Statement { kind: StatementKind::While(Box::new(While { condition, body })), at: head })
    }

    /// After TEST.
    fn test(&mut self, data: &mut Vec<Data>, at: usize, depth: usize) -> Result<Statement, TooDeep> {
        let subject = self.expression(&[]);
        let head = Span::new(at, self.cursor.passed);
        let (mut cases, mut otherwise) = (Vec::new(), Vec::new());
        loop {
            match self.peek_key() {
                Some(Key::Case) => {
                    self.cursor.next();
                    let values = self.values();
                    self.cursor.accept(LexemeKind::Mark(b':'));
                    cases.push(Case { values, body: self.block(data, depth + 1)? });
                }
                Some(Key::Default) => {
                    self.cursor.next();
                    self.cursor.accept(LexemeKind::Mark(b':'));
                    otherwise = self.block(data, depth + 1)?;
                }
                _ => break,
            }
        }
        self.close(Key::EndTest, head);
        Ok(Statement { kind: StatementKind::Test(Box::new(Test { subject, cases, otherwise })), at: head })
    }

    /// After RETURN, EXIT, RAISE, RETRY, TRYNEXT, GOTO or CONNECT, which is at `at`.
    fn leaving(&mut self, word: Key, at: usize) -> Statement {
        let first = self.cursor.peek().span();
        let literals = self.file.literals.len();
        if let Scan::Broken(reason) = self.scan() {
            self.odd(at, reason);
        }
        let at = Span::new(at, self.cursor.passed);
        let rest = Span { start: first.start.min(at.end), ..at };
        let kind = match word {
            Key::Return => {
                let value = self.reader(rest, literals).whole();
                StatementKind::Return(Some(Box::new(value)).filter(|value| !value.span.is_empty()))
            }
            Key::Exit => StatementKind::Exit,
            Key::Retry => StatementKind::Retry,
            Key::TryNext => StatementKind::TryNext,
            Key::Goto => StatementKind::Goto(self.cursor.bytes[first.range()].to_ascii_uppercase().into()),
            Key::Connect => self.connect(rest),
            _ => StatementKind::Raise,
        };
        Statement { kind, at }
    }

    /// The parts of a CONNECT, after its word.
    fn connect(&self, rest: Span) -> StatementKind {
        let mut cursor = Cursor::new(self.cursor.bytes, rest);
        let (mut with, mut trap) = (rest.end, Span { start: rest.end, end: rest.end });
        loop {
            let lexeme = cursor.next();
            match lexeme.kind {
                LexemeKind::End => break,
                LexemeKind::Word if cursor.text(lexeme).eq_ignore_ascii_case(b"WITH") => with = lexeme.span().start,
                LexemeKind::Word => trap = lexeme.span(),
                _ => {}
            }
        }
        let interrupt = self.reader(Span { end: with, ..rest }, self.file.literals.len()).whole();
        StatementKind::Connect(Box::new(Connect { interrupt, trap }))
    }
}
