//! Parses modules, routines and declarations. The end of a statement is found before the statement is read, so that one that is not
//! understood affects no other.

mod blocks;
mod expressions;

pub(super) use expressions::Reader;

use super::lex::{Cursor, Key, Lexeme, LexemeKind, key};
use super::parser::{Parser, Scan};
use super::tree::{Data, File, Module, Param, Record, Routine, RoutineKind, Storage};
use crate::Reason;
use deflex_text::{Source, Span};

/// Deepest nesting of blocks. Real programs nest less, and the code that follows blocks is recursive.
pub(super) const MAX_DEPTH: usize = 100;

/// The position at which blocks nest deeper than [`MAX_DEPTH`].
pub(super) struct TooDeep(pub(super) Span);

/// Reads one file.
pub(super) fn parse(source: &Source, index: u16) -> Result<File, TooDeep> {
    let bytes = &source.bytes;
    let cursor = Cursor::new(bytes, Span::new(0, bytes.len()));
    let mut parser = Parser { cursor, index, file: File::default(), ended: false };
    parser.header();
    parser.modules()?;
    Ok(parser.file)
}

impl Parser<'_> {
    /// Skips `%%%` lines and the text between them.
    fn header(&mut self) {
        let start = self.cursor;
        if !self.percent() {
            self.cursor = start;
            return;
        }
        loop {
            let before = self.cursor;
            let lexeme = self.cursor.next();
            match lexeme.kind {
                LexemeKind::End => {
                    self.cursor = start;
                    return;
                }
                LexemeKind::Mark(b'%') => {
                    self.cursor = before;
                    if self.percent() {
                        return;
                    }
                    self.cursor.next();
                }
                _ => {}
            }
        }
    }

    fn percent(&mut self) -> bool {
        (0..3).all(|_| self.cursor.accept(LexemeKind::Mark(b'%')).is_some())
    }

    fn modules(&mut self) -> Result<(), TooDeep> {
        loop {
            let lexeme = self.cursor.peek();
            match self.key_of(lexeme) {
                Some(Key::Module) => {
                    self.cursor.pass(lexeme);
                    let name = self.module_head();
                    let module = self.module(name)?;
                    if self.cursor.peek().kind == LexemeKind::End && !self.ended {
                        let last = self.cursor.passed;
                        self.file.cut = Some(Span::new(last.saturating_sub(1), last));
                    }
                    self.file.modules.push(module);
                }
                _ if lexeme.kind == LexemeKind::End => return Ok(()),
                // A snippet: routines and data without a module are read too.
                Some(
                    Key::Proc | Key::Func | Key::Trap | Key::Local | Key::Task | Key::Var | Key::Pers | Key::Const,
                ) => {
                    let module = self.module(Span::default())?;
                    self.file.modules.push(module);
                }
                Some(Key::EndModule) => self.cursor.pass(lexeme),
                _ => {
                    self.cursor.pass(lexeme);
                    let end = self.scan();
                    let reason = if let Scan::Broken(reason) = end { reason } else { Reason::OutsideModule };
                    self.odd(lexeme.start, reason);
                }
            }
        }
    }

    /// The name, which may begin with a digit, and `(SYSMODULE, NOSTEPIN …)`. Returns the span of the name.
    fn module_head(&mut self) -> Span {
        self.cursor.skip();
        let start = self.cursor.at;
        while self.cursor.at < self.cursor.end {
            let byte = self.cursor.bytes[self.cursor.at];
            if super::lex::is_space(byte) || matches!(byte, b'(' | b'!' | b';') {
                break;
            }
            self.cursor.at += 1;
        }
        let name = Span::new(start, self.cursor.at);
        if self.cursor.accept(LexemeKind::Mark(b'(')).is_some() {
            while !matches!(self.cursor.next().kind, LexemeKind::Mark(b')') | LexemeKind::End) {}
        }
        name
    }

    fn module(&mut self, name: Span) -> Result<Module, TooDeep> {
        let mut module = Module { name, ..Module::default() };
        self.ended = false;
        loop {
            let start = self.cursor.peek();
            if module.routines.is_empty() && self.file.modules.is_empty() {
                self.file.mark = self.cursor.mark.take().or(self.file.mark);
            }
            match self.key_of(start) {
                Some(Key::EndModule) => {
                    self.cursor.pass(start);
                    self.ended = true;
                    return Ok(module);
                }
                Some(Key::Module) => {
                    self.odd(start.start, Reason::ModuleUnclosed);
                    return Ok(module);
                }
                Some(
                    Key::Local
                    | Key::Task
                    | Key::Var
                    | Key::Pers
                    | Key::Const
                    | Key::Proc
                    | Key::Func
                    | Key::Trap
                    | Key::Record
                    | Key::Alias,
                ) => {
                    self.member(&mut module, start.start)?;
                }
                _ if start.kind == LexemeKind::End => return Ok(module),
                _ => {
                    self.cursor.pass(start);
                    let reason = match self.scan() {
                        Scan::Broken(reason) => reason,
                        Scan::Done => Reason::StatementOutside,
                    };
                    if start.kind != LexemeKind::Placeholder {
                        self.odd(start.start, reason);
                    }
                }
            }
        }
    }

    fn member(&mut self, module: &mut Module, start: usize) -> Result<(), TooDeep> {
        let mut local = false;
        loop {
            let lexeme = self.cursor.next();
            match self.key_of(lexeme) {
                Some(Key::Local) => local = true,
                Some(Key::Task) => {}
                Some(k @ (Key::Var | Key::Pers | Key::Const)) => {
                    if let Some(data) = self.data(start, storage(k), local) {
                        module.data.push(data);
                    }
                    return Ok(());
                }
                Some(Key::Proc) => return self.routine(module, RoutineKind::Proc, local),
                Some(Key::Func) => {
                    self.cursor.accept(LexemeKind::Word);
                    return self.routine(module, RoutineKind::Func, local);
                }
                Some(Key::Trap) => return self.routine(module, RoutineKind::Trap, local),
                Some(Key::Record) => {
                    self.record(module, start);
                    return Ok(());
                }
                _ => {
                    // ALIAS and anything else is skipped whole.
                    if let Scan::Broken(reason) = self.scan() {
                        self.odd(start, reason);
                    }
                    return Ok(());
                }
            }
        }
    }

    fn record(&mut self, module: &mut Module, start: usize) {
        let Some(name) = self.cursor.accept(LexemeKind::Word) else {
            return self.odd(start, Reason::RecordWithoutName);
        };
        let mut fields = Vec::new();
        loop {
            let kind = self.cursor.next();
            if kind.kind == LexemeKind::End || self.key_of(kind) == Some(Key::EndRecord) {
                break;
            }
            if let Some(field) = self.cursor.accept(LexemeKind::Word) {
                fields.push((kind.span(), field.span()));
            }
            self.scan();
        }
        module.records.push(Record { name: name.span(), fields });
    }

    /// After VAR, PERS or CONST.
    fn data(&mut self, start: usize, storage: Storage, local: bool) -> Option<Data> {
        let head = (self.cursor.accept(LexemeKind::Word), self.cursor.accept(LexemeKind::Word));
        let (Some(kind), Some(name)) = head else {
            let placeholder = self.cursor.peek().kind == LexemeKind::Placeholder;
            let reason = match self.scan() {
                Scan::Broken(reason) => reason,
                Scan::Done if placeholder => Reason::PlaceholderDeclaration,
                Scan::Done => Reason::DeclarationIncomplete,
            };
            self.odd(start, reason);
            return None;
        };
        let is_array = self.cursor.accept(LexemeKind::Mark(b'{')).is_some();
        if is_array {
            while !matches!(
                self.cursor.peek().kind,
                LexemeKind::Mark(b'}' | b';') | LexemeKind::End | LexemeKind::Assign
            ) {
                self.cursor.next();
            }
            self.cursor.accept(LexemeKind::Mark(b'}'));
        }
        let assigned = self.cursor.accept(LexemeKind::Assign).is_some();
        let from = self.cursor.peek().start;
        let literals = self.file.literals.len();
        let scanned = self.scan();
        let end = self.cursor.passed;
        if let Scan::Broken(reason) = scanned {
            self.odd(start, reason);
            if reason != Reason::NoSemicolon {
                return None;
            }
        }
        let stop = if self.cursor.bytes.get(end.wrapping_sub(1)) == Some(&b';') { end - 1 } else { end };
        let value = (assigned && stop > from).then(|| self.reader(Span::new(from, stop), literals).whole());
        let statement = Span::new(start, end);
        Some(Data { storage, local, kind: kind.span(), name: name.span(), is_array, value, statement })
    }

    fn routine(&mut self, module: &mut Module, kind: RoutineKind, local: bool) -> Result<(), TooDeep> {
        let start = self.cursor.passed;
        let name = self.cursor.peek();
        let name = if matches!(name.kind, LexemeKind::Word | LexemeKind::Number) {
            self.cursor.pass(name);
            // `20mm` is a number and a word to the lexer.
            let mut end = name.end;
            while self.cursor.bytes.get(end).is_some_and(|b| b.is_ascii_alphanumeric() || *b == b'_') {
                end += 1;
            }
            self.cursor.at = end;
            Span::new(name.start, end)
        } else {
            Span::new(start, start)
        };
        let params = if kind == RoutineKind::Trap { Vec::new() } else { self.params() };
        let mut routine = Routine {
            kind,
            local,
            name,
            text: name,
            params,
            data: Vec::new(),
            body: Vec::new(),
            handlers: Vec::new(),
            error: None,
        };
        routine.body = self.block(&mut routine.data, 0)?;
        loop {
            let end = self.cursor.peek();
            match self.key_of(end) {
                Some(Key::Error | Key::Undo | Key::Backward) => {
                    self.cursor.pass(end);
                    if self.cursor.peek().kind == LexemeKind::Mark(b'(') {
                        while !matches!(self.cursor.next().kind, LexemeKind::Mark(b')' | b';') | LexemeKind::End) {}
                    }
                    let start = routine.handlers.len();
                    routine.handlers.append(&mut self.block(&mut routine.data, 0)?);
                    if self.key_of(end) == Some(Key::Error) {
                        routine.error = Some(start..routine.handlers.len());
                    }
                }
                Some(Key::EndProc | Key::EndFunc | Key::EndTrap) => {
                    self.cursor.pass(end);
                    break;
                }
                // The end of the routine is missing, as the next member or the end of the module shows.
                Some(Key::EndModule | Key::Module | Key::Proc | Key::Func | Key::Trap | Key::Local | Key::Record) => {
                    self.file.odd.push((end.span(), Reason::RoutineUnclosedBefore));
                    break;
                }
                _ if end.kind == LexemeKind::End => {
                    self.file.odd.push((Span::new(name.start as usize, end.end), Reason::RoutineUnclosed));
                    break;
                }
                _ => {
                    // A part of a block without its head: ELSE, ENDIF, CASE, …
                    self.cursor.pass(end);
                    self.odd(end.start, Reason::NoBlock);
                    routine.body.append(&mut self.block(&mut routine.data, 0)?);
                }
            }
        }
        routine.text = Span::new(name.start as usize, self.cursor.passed);
        module.routines.push(routine);
        Ok(())
    }

    fn params(&mut self) -> Vec<Param> {
        let mut params = Vec::new();
        if self.cursor.accept(LexemeKind::Mark(b'(')).is_none() {
            return params;
        }
        let mut words: Vec<Lexeme> = Vec::new();
        let (mut by_reference, mut optional) = (false, false);
        loop {
            let lexeme = self.cursor.next();
            match lexeme.kind {
                LexemeKind::Word => match key(self.cursor.text(lexeme)) {
                    Some(Key::Var | Key::Pers) => by_reference = true,
                    _ if self.cursor.text(lexeme).eq_ignore_ascii_case(b"INOUT") => by_reference = true,
                    _ => words.push(lexeme),
                },
                LexemeKind::Mark(b',' | b'|' | b')' | b'\\') | LexemeKind::End => {
                    if let [kind, name, ..] = words[..] {
                        params.push(Param { kind: kind.span(), name: name.span(), by_reference, optional });
                    }
                    words.clear();
                    by_reference = false;
                    if matches!(lexeme.kind, LexemeKind::Mark(b')') | LexemeKind::End) {
                        return params;
                    }
                    // `\A | B`: both optional.
                    optional =
                        lexeme.kind == LexemeKind::Mark(b'\\') || optional && lexeme.kind == LexemeKind::Mark(b'|');
                }
                _ => {}
            }
        }
    }
}

fn storage(key: Key) -> Storage {
    match key {
        Key::Const => Storage::Const,
        Key::Pers => Storage::Pers,
        _ => Storage::Var,
    }
}
