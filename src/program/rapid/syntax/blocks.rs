//! Parses blocks: statements up to the word that ends them, with branches and loops.

use super::super::lex::{Key, LexemeKind};
use super::super::parser::{Parser, Scan};
use super::super::tree::{Data, Statement};
use super::{MAX_DEPTH, TooDeep, storage};
use crate::program::Reason;
use crate::text::Span;

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
                block.push(Statement::Mark(mark));
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
                Some(Key::If) => {
                    self.cursor.pass(start);
                    let statement = self.condition(data, at, depth)?;
                    block.extend(statement);
                }
                Some(Key::For) => {
                    self.cursor.pass(start);
                    let statement = self.counted(data, at, depth)?;
                    block.extend(statement);
                }
                Some(Key::While) => {
                    self.cursor.pass(start);
                    let statement = self.repeated(data, at, depth)?;
                    block.push(statement);
                }
                Some(Key::Test) => {
                    self.cursor.pass(start);
                    let statement = self.test(data, at, depth)?;
                    block.push(statement);
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
        let condition = self.operand_run();
        let head = Span::new(at, self.cursor.behind);
        if self.cursor.accept_word(b"THEN") {
            let mut arms = vec![(condition, self.block(data, depth + 1)?)];
            let mut otherwise = Vec::new();
            loop {
                match self.peek_key() {
                    Some(Key::ElseIf) => {
                        self.cursor.next();
                        let condition = self.expression(&[b"THEN"]);
                        self.cursor.accept_word(b"THEN");
                        arms.push((condition, self.block(data, depth + 1)?));
                    }
                    Some(Key::Else) => {
                        self.cursor.next();
                        otherwise = self.block(data, depth + 1)?;
                    }
                    _ => break,
                }
            }
            self.close(Key::EndIf, head);
            return Ok(Some(Statement::If { arms, otherwise, at: head }));
        }
        let start = self.cursor.peek();
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
        Ok(inner.map(|s| Statement::If { arms: vec![(condition, vec![s])], otherwise: Vec::new(), at: head }))
    }

    /// After FOR.
    fn counted(&mut self, data: &mut Vec<Data>, at: usize, depth: usize) -> Result<Option<Statement>, TooDeep> {
        let variable = self.cursor.accept(LexemeKind::Word);
        let from_word = self.cursor.accept_word(b"FROM");
        let from = self.expression(&[b"TO", b"STEP", b"DO"]);
        let to_word = self.cursor.accept_word(b"TO");
        let to = self.expression(&[b"STEP", b"DO"]);
        let step = self.cursor.accept_word(b"STEP").then(|| self.expression(&[b"DO"]));
        self.cursor.accept_word(b"DO");
        let head = Span::new(at, self.cursor.behind);
        let body = self.block(data, depth + 1)?;
        self.close(Key::EndFor, head);
        let (Some(variable), true, true) = (variable, from_word, to_word) else {
            self.file.odd.push((head, Reason::ForIncomplete));
            return Ok(None);
        };
        Ok(Some(Statement::For { variable: variable.span(), from, to, step, body, at: head }))
    }

    /// After WHILE.
    fn repeated(&mut self, data: &mut Vec<Data>, at: usize, depth: usize) -> Result<Statement, TooDeep> {
        let condition = self.expression(&[b"DO"]);
        self.cursor.accept_word(b"DO");
        let head = Span::new(at, self.cursor.behind);
        let body = self.block(data, depth + 1)?;
        self.close(Key::EndWhile, head);
        Ok(Statement::While { condition, body, at: head })
    }

    /// After TEST.
    fn test(&mut self, data: &mut Vec<Data>, at: usize, depth: usize) -> Result<Statement, TooDeep> {
        let subject = self.expression(&[]);
        let head = Span::new(at, self.cursor.behind);
        let (mut cases, mut otherwise) = (Vec::new(), Vec::new());
        loop {
            match self.peek_key() {
                Some(Key::Case) => {
                    self.cursor.next();
                    let values = self.expression(&[]);
                    self.cursor.accept(LexemeKind::Mark(b':'));
                    cases.push((values, self.block(data, depth + 1)?));
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
        Ok(Statement::Test { subject, cases, otherwise, at: head })
    }

    /// After RETURN, EXIT, RAISE, RETRY, TRYNEXT, GOTO or CONNECT, which is at `at`.
    fn leaving(&mut self, word: Key, at: usize) -> Statement {
        let first = self.cursor.peek().span();
        let from = first.start as usize;
        if let Scan::Broken(reason) = self.scan() {
            self.odd(at, reason);
        }
        let end = self.cursor.behind;
        let stop = if self.cursor.bytes.get(end.wrapping_sub(1)) == Some(&b';') { end - 1 } else { end };
        match word {
            Key::Return => Statement::Return(Span::new(from.min(stop), stop)),
            Key::Exit => Statement::Exit,
            Key::Retry => Statement::Retry,
            Key::TryNext => Statement::TryNext,
            Key::Goto => Statement::Goto(first),
            Key::Connect => Statement::Connect(Span::new(at, end)),
            _ => Statement::Raise,
        }
    }
}
