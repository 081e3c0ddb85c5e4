//! Modules, routines and blocks: shallow, so that a statement not understood stays its own affair.

use super::lex::{Cursor, Key, Kind, Lexeme, key};
use super::literal::Literal;
use crate::program::Mark;
use crate::text::{Diagnostic, Source, Span};

/// Deeper nesting of blocks is refused: nobody writes it, and the walk over it is recursive.
const MAX_DEPTH: usize = 100;

/// One file's modules, and every complete robtarget literal in it in text order.
#[derive(Debug, Default)]
pub(super) struct File {
    pub(super) modules: Vec<Module>,
    pub(super) literals: Vec<Literal>,
    /// Statements that are not understood, with the reason.
    pub(super) odd: Vec<(Span, &'static str)>,
    /// The last mark before the first routine: in force from the start.
    pub(super) mark: Option<Mark>,
    /// The file ends inside a module: its last lexeme.
    pub(super) cut: Option<Span>,
}

#[derive(Debug, Default)]
pub(super) struct Module {
    pub(super) data: Vec<Data>,
    pub(super) records: Vec<Record>,
    pub(super) routines: Vec<Routine>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Storage {
    Const,
    Pers,
    Var,
}

/// `[LOCAL|TASK] VAR|PERS|CONST type name[{…}] [:= value];`
#[derive(Clone, Debug)]
pub(super) struct Data {
    pub(super) storage: Storage,
    pub(super) local: bool,
    pub(super) kind: Span,
    pub(super) name: Span,
    pub(super) dims: Option<Span>,
    pub(super) value: Option<Span>,
    pub(super) statement: Span,
}

#[derive(Debug)]
pub(super) struct Record {
    pub(super) name: Span,
    /// Type and name of each component.
    pub(super) fields: Vec<(Span, Span)>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum RoutineKind {
    Proc,
    Func,
    Trap,
}

#[derive(Debug)]
pub(super) struct Routine {
    pub(super) kind: RoutineKind,
    pub(super) local: bool,
    pub(super) name: Span,
    pub(super) params: Vec<Param>,
    pub(super) data: Vec<Data>,
    pub(super) body: Vec<Statement>,
    /// ERROR, UNDO and BACKWARD parts: not on the way of a run without faults.
    pub(super) handlers: Vec<Statement>,
}

#[derive(Debug)]
pub(super) struct Param {
    pub(super) kind: Span,
    pub(super) name: Span,
    /// VAR, PERS or INOUT: the caller's own variable.
    pub(super) by_reference: bool,
    pub(super) optional: bool,
}

#[derive(Debug)]
pub(super) enum Statement {
    /// A call or an assignment, up to and with its `;`.
    Simple(Span),
    If {
        arms: Vec<(Span, Vec<Statement>)>,
        otherwise: Vec<Statement>,
        at: Span,
    },
    For {
        variable: Span,
        from: Span,
        to: Span,
        step: Option<Span>,
        body: Vec<Statement>,
        at: Span,
    },
    While {
        condition: Span,
        body: Vec<Statement>,
        at: Span,
    },
    Test {
        subject: Span,
        cases: Vec<(Span, Vec<Statement>)>,
        otherwise: Vec<Statement>,
        at: Span,
    },
    Return,
    /// EXIT and RAISE end the run as read.
    Exit,
    Goto(Span),
    Mark(Mark),
}

/// Reads one file.
pub(super) fn parse(source: &Source, index: u16) -> Result<File, Diagnostic> {
    let bytes = &source.bytes;
    let cursor = Cursor::new(bytes, Span::new(0, bytes.len()));
    let mut parser = Parser { cursor, source, index, file: File::default(), ended: false };
    parser.header();
    parser.modules()?;
    Ok(parser.file)
}

struct Parser<'a> {
    cursor: Cursor<'a>,
    source: &'a Source,
    index: u16,
    file: File,
    /// The module read last had its ENDMODULE.
    ended: bool,
}

/// How a simple statement's scan ended.
enum Scan {
    Done,
    Broken(&'static str),
}

impl<'a> Parser<'a> {
    fn key_of(&self, lexeme: Lexeme) -> Option<Key> {
        if lexeme.kind == Kind::Word { key(self.cursor.text(lexeme)) } else { None }
    }

    fn peek_key(&mut self) -> Option<Key> {
        let lexeme = self.cursor.peek();
        self.key_of(lexeme)
    }

    fn odd(&mut self, from: usize, reason: &'static str) {
        let end = self.cursor.behind.max(from);
        self.file.odd.push((Span::new(from, end), reason));
    }

    /// `%%%` lines, and what stands between them.
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
                Kind::End => {
                    self.cursor = start;
                    return;
                }
                Kind::Mark(b'%') => {
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
        (0..3).all(|_| self.cursor.accept(Kind::Mark(b'%')).is_some())
    }

    fn modules(&mut self) -> Result<(), Diagnostic> {
        loop {
            let lexeme = self.cursor.peek();
            match self.key_of(lexeme) {
                Some(Key::Module) => {
                    self.cursor.pass(lexeme);
                    self.module_head();
                    let module = self.module()?;
                    if self.cursor.peek().kind == Kind::End && !self.ended {
                        let last = self.cursor.behind;
                        self.file.cut = Some(Span::new(last.saturating_sub(1), last));
                    }
                    self.file.modules.push(module);
                }
                _ if lexeme.kind == Kind::End => return Ok(()),
                // Routines and data without a module around them: a snippet, read all the same.
                Some(
                    Key::Proc | Key::Func | Key::Trap | Key::Local | Key::Task | Key::Var | Key::Pers | Key::Const,
                ) => {
                    let module = self.module()?;
                    self.file.modules.push(module);
                }
                Some(Key::EndModule) => self.cursor.pass(lexeme),
                _ => {
                    self.cursor.pass(lexeme);
                    let end = self.scan();
                    let reason = if let Scan::Broken(reason) = end { reason } else { "outside a module" };
                    self.odd(lexeme.start, reason);
                }
            }
        }
    }

    /// The name, which may begin with a digit, and `(SYSMODULE, NOSTEPIN …)`.
    fn module_head(&mut self) {
        self.cursor.skip();
        while self.cursor.at < self.cursor.end {
            let byte = self.cursor.bytes[self.cursor.at];
            if super::lex::is_space(byte) || matches!(byte, b'(' | b'!' | b';') {
                break;
            }
            self.cursor.at += 1;
        }
        if self.cursor.accept(Kind::Mark(b'(')).is_some() {
            while !matches!(self.cursor.next().kind, Kind::Mark(b')') | Kind::End) {}
        }
    }

    fn module(&mut self) -> Result<Module, Diagnostic> {
        let mut module = Module::default();
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
                    self.odd(start.start, "module without ENDMODULE before it");
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
                _ if start.kind == Kind::End => return Ok(module),
                _ => {
                    self.cursor.pass(start);
                    let reason = match self.scan() {
                        Scan::Broken(reason) => reason,
                        Scan::Done => "statement outside a routine",
                    };
                    if start.kind != Kind::Placeholder {
                        self.odd(start.start, reason);
                    }
                }
            }
        }
    }

    fn member(&mut self, module: &mut Module, start: usize) -> Result<(), Diagnostic> {
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
                    self.cursor.accept(Kind::Word);
                    return self.routine(module, RoutineKind::Func, local);
                }
                Some(Key::Trap) => return self.routine(module, RoutineKind::Trap, local),
                Some(Key::Record) => {
                    self.record(module, start);
                    return Ok(());
                }
                _ => {
                    // ALIAS, and anything else: passed whole.
                    if let Scan::Broken(reason) = self.scan() {
                        self.odd(start, reason);
                    }
                    return Ok(());
                }
            }
        }
    }

    fn record(&mut self, module: &mut Module, start: usize) {
        let Some(name) = self.cursor.accept(Kind::Word) else { return self.odd(start, "record without a name") };
        let mut fields = Vec::new();
        loop {
            let kind = self.cursor.next();
            if kind.kind == Kind::End || self.key_of(kind) == Some(Key::EndRecord) {
                break;
            }
            if let Some(field) = self.cursor.accept(Kind::Word) {
                fields.push((kind.span(), field.span()));
            }
            self.scan();
        }
        module.records.push(Record { name: name.span(), fields });
    }

    /// Behind VAR, PERS or CONST.
    fn data(&mut self, start: usize, storage: Storage, local: bool) -> Option<Data> {
        let head = (self.cursor.accept(Kind::Word), self.cursor.accept(Kind::Word));
        let (Some(kind), Some(name)) = head else {
            let placeholder = self.cursor.peek().kind == Kind::Placeholder;
            let reason = match self.scan() {
                Scan::Broken(reason) => reason,
                Scan::Done if placeholder => "declaration with a placeholder",
                Scan::Done => "declaration without type and name",
            };
            self.odd(start, reason);
            return None;
        };
        let mut dims = None;
        if let Some(open) = self.cursor.accept(Kind::Mark(b'{')) {
            while !matches!(self.cursor.peek().kind, Kind::Mark(b'}' | b';') | Kind::End | Kind::Assign) {
                self.cursor.next();
            }
            dims = Some(Span::new(open.end, self.cursor.behind));
            self.cursor.accept(Kind::Mark(b'}'));
        }
        let assigned = self.cursor.accept(Kind::Assign).is_some();
        let from = self.cursor.peek().start;
        let end = self.scan();
        let behind = self.cursor.behind;
        if let Scan::Broken(reason) = end {
            self.odd(start, reason);
            if reason != NO_SEMICOLON {
                return None;
            }
        }
        let stop = if self.cursor.bytes.get(behind.wrapping_sub(1)) == Some(&b';') { behind - 1 } else { behind };
        let value = (assigned && stop > from).then(|| Span::new(from, stop));
        let statement = Span::new(start, behind);
        Some(Data { storage, local, kind: kind.span(), name: name.span(), dims, value, statement })
    }

    fn routine(&mut self, module: &mut Module, kind: RoutineKind, local: bool) -> Result<(), Diagnostic> {
        let start = self.cursor.behind;
        let name = self.cursor.peek();
        let name = if matches!(name.kind, Kind::Word | Kind::Number) {
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
        let mut routine =
            Routine { kind, local, name, params, data: Vec::new(), body: Vec::new(), handlers: Vec::new() };
        routine.body = self.block(&mut routine.data, 0)?;
        loop {
            let end = self.cursor.peek();
            match self.key_of(end) {
                Some(Key::Error | Key::Undo | Key::Backward) => {
                    self.cursor.pass(end);
                    if self.cursor.peek().kind == Kind::Mark(b'(') {
                        while !matches!(self.cursor.next().kind, Kind::Mark(b')' | b';') | Kind::End) {}
                    }
                    routine.handlers.append(&mut self.block(&mut routine.data, 0)?);
                }
                Some(Key::EndProc | Key::EndFunc | Key::EndTrap) => {
                    self.cursor.pass(end);
                    break;
                }
                // The end is missing; the next member or the module's end says so.
                Some(Key::EndModule | Key::Module | Key::Proc | Key::Func | Key::Trap | Key::Local | Key::Record) => {
                    self.file.odd.push((end.span(), "routine before it has no end"));
                    break;
                }
                _ if end.kind == Kind::End => {
                    self.file.odd.push((Span::new(name.start as usize, end.end), "routine without an end"));
                    break;
                }
                _ => {
                    // A part of a block without its head: ELSE, ENDIF, CASE, …
                    self.cursor.pass(end);
                    self.odd(end.start, "no block that this belongs to");
                    routine.body.append(&mut self.block(&mut routine.data, 0)?);
                }
            }
        }
        module.routines.push(routine);
        Ok(())
    }

    fn params(&mut self) -> Vec<Param> {
        let mut params = Vec::new();
        if self.cursor.accept(Kind::Mark(b'(')).is_none() {
            return params;
        }
        let mut words: Vec<Lexeme> = Vec::new();
        let (mut by_reference, mut optional) = (false, false);
        loop {
            let lexeme = self.cursor.next();
            match lexeme.kind {
                Kind::Word => match key(self.cursor.text(lexeme)) {
                    Some(Key::Var | Key::Pers) => by_reference = true,
                    _ if self.cursor.text(lexeme).eq_ignore_ascii_case(b"INOUT") => by_reference = true,
                    _ => words.push(lexeme),
                },
                Kind::Mark(b',' | b'|' | b')' | b'\\') | Kind::End => {
                    if let [kind, name, ..] = words[..] {
                        params.push(Param { kind: kind.span(), name: name.span(), by_reference, optional });
                    }
                    words.clear();
                    by_reference = false;
                    if matches!(lexeme.kind, Kind::Mark(b')') | Kind::End) {
                        return params;
                    }
                    // `\A | B`: both optional.
                    optional = lexeme.kind == Kind::Mark(b'\\') || optional && lexeme.kind == Kind::Mark(b'|');
                }
                _ => {}
            }
        }
    }

    /// Statements up to a word that this level does not know; that word is left.
    fn block(&mut self, data: &mut Vec<Data>, depth: usize) -> Result<Vec<Statement>, Diagnostic> {
        if depth > MAX_DEPTH {
            let here = self.cursor.peek().span();
            return Err(Diagnostic::error("rapid.too-deep", "", format!("blocks are nested deeper than {MAX_DEPTH}"))
                .at(self.source, here)
                .help("split the routine into several"));
        }
        let mut block = Vec::new();
        loop {
            let start = self.cursor.peek();
            if let Some(mark) = self.cursor.mark.take() {
                block.push(Statement::Mark(mark));
            }
            let at = start.start;
            match self.key_of(start) {
                None if start.kind == Kind::End => return Ok(block),
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
                    let condition = self.expression(&[b"DO"]);
                    self.cursor.accept_word(b"DO");
                    let head = Span::new(at, self.cursor.behind);
                    let body = self.block(data, depth + 1)?;
                    self.close(Key::EndWhile, head);
                    block.push(Statement::While { condition, body, at: head });
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
                    let name = self.cursor.peek().span();
                    if let Scan::Broken(reason) = self.scan() {
                        self.odd(at, reason);
                    }
                    match k {
                        Key::Return => block.push(Statement::Return),
                        Key::Exit | Key::Raise => block.push(Statement::Exit),
                        Key::Goto => block.push(Statement::Goto(name)),
                        _ => {}
                    }
                }
                Some(_) => return Ok(block),
            }
        }
    }

    /// An expression up to one of `words` or what cannot be in one.
    fn expression(&mut self, words: &[&[u8]]) -> Span {
        let start = self.cursor.peek().start;
        self.cursor.behind = start;
        let mut depth = 0_usize;
        loop {
            let lexeme = self.cursor.peek();
            match lexeme.kind {
                Kind::End | Kind::Mark(b';') => break,
                Kind::Mark(b'[' | b'(' | b'{') => depth += 1,
                Kind::Mark(b']' | b')' | b'}') => depth = depth.saturating_sub(1),
                Kind::Mark(b':') if depth == 0 => break,
                Kind::Word => {
                    let text = self.cursor.text(lexeme);
                    if words.iter().any(|w| w.eq_ignore_ascii_case(text)) || key(text).is_some() {
                        break;
                    }
                }
                _ => {}
            }
            self.cursor.pass(lexeme);
        }
        Span::new(start, self.cursor.behind)
    }

    fn close(&mut self, wanted: Key, head: Span) {
        let lexeme = self.cursor.peek();
        if self.key_of(lexeme) == Some(wanted) {
            self.cursor.pass(lexeme);
            // `ENDIF;` is not RAPID, yet there.
            self.cursor.accept(Kind::Mark(b';'));
        } else {
            self.file.odd.push((head, "block without an end"));
        }
    }

    /// Behind IF: the block form, or the compact form with one statement and no THEN.
    fn condition(&mut self, data: &mut Vec<Data>, at: usize, depth: usize) -> Result<Option<Statement>, Diagnostic> {
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
                let name = self.cursor.peek().span();
                self.scan();
                match k {
                    Key::Return => Some(Statement::Return),
                    Key::Exit | Key::Raise => Some(Statement::Exit),
                    Key::Goto => Some(Statement::Goto(name)),
                    _ => None,
                }
            }
            None if start.kind != Kind::End => self.simple(start),
            _ => {
                self.odd(at, "IF without THEN or statement");
                None
            }
        };
        Ok(inner.map(|s| Statement::If { arms: vec![(condition, vec![s])], otherwise: Vec::new(), at: head }))
    }

    /// A condition up to THEN or, in the compact form, up to the first word behind a whole operand.
    fn operand_run(&mut self) -> Span {
        let start = self.cursor.peek().start;
        self.cursor.behind = start;
        let (mut depth, mut operand) = (0_usize, false);
        loop {
            let lexeme = self.cursor.peek();
            match lexeme.kind {
                Kind::End | Kind::Mark(b';') => break,
                Kind::Mark(b'[' | b'(' | b'{') => (depth, operand) = (depth + 1, false),
                Kind::Mark(b']' | b')' | b'}') => (depth, operand) = (depth.saturating_sub(1), true),
                Kind::Number | Kind::Text => operand = true,
                Kind::Mark(b'%') if depth == 0 && operand => break,
                Kind::Word => {
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
        Span::new(start, self.cursor.behind)
    }

    /// Behind FOR.
    fn counted(&mut self, data: &mut Vec<Data>, at: usize, depth: usize) -> Result<Option<Statement>, Diagnostic> {
        let variable = self.cursor.accept(Kind::Word);
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
            self.file.odd.push((head, "FOR without variable, FROM or TO"));
            return Ok(None);
        };
        Ok(Some(Statement::For { variable: variable.span(), from, to, step, body, at: head }))
    }

    /// Behind TEST.
    fn test(&mut self, data: &mut Vec<Data>, at: usize, depth: usize) -> Result<Statement, Diagnostic> {
        let subject = self.expression(&[]);
        let head = Span::new(at, self.cursor.behind);
        let (mut cases, mut otherwise) = (Vec::new(), Vec::new());
        loop {
            match self.peek_key() {
                Some(Key::Case) => {
                    self.cursor.next();
                    let values = self.expression(&[]);
                    self.cursor.accept(Kind::Mark(b':'));
                    cases.push((values, self.block(data, depth + 1)?));
                }
                Some(Key::Default) => {
                    self.cursor.next();
                    self.cursor.accept(Kind::Mark(b':'));
                    otherwise = self.block(data, depth + 1)?;
                }
                _ => break,
            }
        }
        self.close(Key::EndTest, head);
        Ok(Statement::Test { subject, cases, otherwise, at: head })
    }

    /// A call, an assignment, a label or what cannot be read.
    fn simple(&mut self, start: Lexeme) -> Option<Statement> {
        self.cursor.pass(start);
        match start.kind {
            Kind::Mark(b';') => return None,
            Kind::Placeholder => {
                self.cursor.accept(Kind::Mark(b';'));
                return None;
            }
            Kind::Word if self.cursor.accept(Kind::Mark(b':')).is_some() => return None,
            _ => {}
        }
        let end = self.scan();
        let span = Span::new(start.start, self.cursor.behind);
        match end {
            Scan::Broken(reason) => self.odd(start.start, reason),
            Scan::Done if !matches!(start.kind, Kind::Word | Kind::Mark(b'%')) => {
                self.odd(start.start, "not a statement")
            }
            Scan::Done => return Some(Statement::Simple(span)),
        }
        None
    }

    /// Passes the rest of a statement with its `;`, noting robtarget literals. `;` does not occur in
    /// brackets, so it always ends one; so does a word that opens or closes a block.
    fn scan(&mut self) -> Scan {
        let mut depth = 0_usize;
        let mut operand =
            self.cursor.bytes[..self.cursor.behind].last().is_some_and(|b| matches!(b, b']' | b')' | b'}'));
        let mut words = usize::from(!operand);
        let mut placeholder = false;
        loop {
            let before = self.cursor.behind;
            let lexeme = self.cursor.peek();
            match lexeme.kind {
                Kind::End => return Scan::Broken(if depth > 0 { UNCLOSED } else { NO_SEMICOLON }),
                Kind::Mark(b';') => {
                    self.cursor.pass(lexeme);
                    return match depth {
                        0 if placeholder => Scan::Broken("placeholder in a statement"),
                        0 => Scan::Done,
                        _ => Scan::Broken(UNCLOSED),
                    };
                }
                Kind::Mark(b'[') => {
                    if let Some((literal, _)) = Literal::read(self.cursor.bytes, self.index, lexeme.start) {
                        let end = literal.span().end as usize;
                        self.file.literals.push(literal);
                        self.cursor.at = end;
                        self.cursor.behind = end;
                        operand = true;
                        continue;
                    }
                    (depth, operand) = (depth + 1, false);
                }
                Kind::Mark(b'(' | b'{') => (depth, operand) = (depth + 1, false),
                Kind::Mark(b']' | b')' | b'}') => {
                    if depth == 0 {
                        // Passed up to `;` so that only this statement is lost.
                        self.cursor.pass(lexeme);
                        while !matches!(self.cursor.peek().kind, Kind::End | Kind::Mark(b';'))
                            && self.peek_key().is_none()
                        {
                            self.cursor.next();
                        }
                        self.cursor.accept(Kind::Mark(b';'));
                        return Scan::Broken("bracket closed that was not opened");
                    }
                    (depth, operand) = (depth - 1, true);
                }
                Kind::Word => {
                    let text = self.cursor.text(lexeme);
                    let option = lexeme.start > 0 && matches!(self.cursor.bytes[lexeme.start - 1], b'\\' | b'.');
                    if let Some(found) = key(text)
                        && !option
                        && !(matches!(found, Key::Error | Key::Default | Key::Exit | Key::Test | Key::Task)
                            && depth > 0)
                    {
                        return Scan::Broken(if depth > 0 { UNCLOSED } else { NO_SEMICOLON });
                    }
                    let operator = is_operator(text);
                    if operand && depth == 0 && !operator && words > 0 {
                        let gap = &self.cursor.bytes[before..lexeme.start];
                        if gap.iter().any(|b| matches!(b, b'\n' | b'\r')) {
                            return Scan::Broken(NO_SEMICOLON);
                        }
                    }
                    words += usize::from(operand);
                    operand = !operator;
                }
                Kind::Number | Kind::Text => operand = true,
                Kind::Placeholder => (placeholder, operand) = (true, true),
                _ => operand = false,
            }
            self.cursor.pass(lexeme);
        }
    }
}

pub(super) const NO_SEMICOLON: &str = "missing semicolon";
const UNCLOSED: &str = "bracket without an end";

fn storage(key: Key) -> Storage {
    match key {
        Key::Const => Storage::Const,
        Key::Pers => Storage::Pers,
        _ => Storage::Var,
    }
}

fn is_operator(word: &[u8]) -> bool {
    [&b"DIV"[..], b"MOD", b"AND", b"OR", b"XOR", b"NOT", b"WITH", b"TO", b"STEP", b"FROM"]
        .iter()
        .any(|o| o.eq_ignore_ascii_case(word))
}
