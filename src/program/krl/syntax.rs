//! Lines to routines, data lists and blocks. A line that is not understood stays as it is and takes no other with it.

use super::lex::{Cursor, LexemeKind, Line, lines};
use super::tree::{Condition, Data, File, Param, Routine, Statement};
use crate::program::Reason;
use crate::text::{Source, Span};

/// Blocks within one another: more than anybody writes.
pub(super) const MAX_DEPTH: usize = 100;

/// Blocks are nested too deep; where.
#[derive(Debug)]
pub(super) struct TooDeep(pub(super) Span);

/// Words that two words in a row do not make a declaration after.
const STATEMENTS: [&[u8]; 34] = [
    b"PTP",
    b"LIN",
    b"CIRC",
    b"SPTP",
    b"SLIN",
    b"SCIRC",
    b"SPL",
    b"PTP_REL",
    b"LIN_REL",
    b"CIRC_REL",
    b"SPTP_REL",
    b"SLIN_REL",
    b"SCIRC_REL",
    b"SPL_REL",
    b"ASYPTP",
    b"ASYCONT",
    b"WAIT",
    b"HALT",
    b"CONTINUE",
    b"BRAKE",
    b"RESUME",
    b"INTERRUPT",
    b"TRIGGER",
    b"GOTO",
    b"RETURN",
    b"PULSE",
    b"ANIN",
    b"ANOUT",
    b"CONFIRM",
    b"TIME_BLOCK",
    b"CONST_VEL",
    b"STOP",
    b"SYNC",
    b"ASYCANCEL",
];

/// Types of the system.
const TYPES: [&[u8]; 16] = [
    b"INT",
    b"REAL",
    b"BOOL",
    b"CHAR",
    b"FRAME",
    b"POS",
    b"E6POS",
    b"AXIS",
    b"E6AXIS",
    b"LOAD",
    b"FDAT",
    b"LDAT",
    b"PDAT",
    b"CP",
    b"INERTIA",
    b"SPL_VELOCITY",
];

/// A block's statements, and what ended it: which word, and what stands after it.
type Block = (Vec<Statement>, Option<(usize, Span)>);

/// Reads a file.
pub(super) fn parse(source: &Source, index: u16) -> Result<File, TooDeep> {
    let mut parser = Parser {
        bytes: &source.bytes,
        index,
        lines: lines(&source.bytes).collect(),
        at: 0,
        depth: 0,
        file: File::default(),
    };
    parser.file()?;
    Ok(parser.file)
}

struct Parser<'a> {
    bytes: &'a [u8],
    index: u16,
    lines: Vec<Line>,
    at: usize,
    depth: usize,
    file: File,
}

impl<'a> Parser<'a> {
    fn cursor(&self, span: Span) -> Cursor<'a> {
        Cursor::new(self.bytes, self.index, span)
    }

    fn file(&mut self) -> Result<(), TooDeep> {
        while let Some(line) = self.lines.get(self.at).copied() {
            self.at += 1;
            if self.file.routines.is_empty() {
                self.file.mark = line.mark.or(self.file.mark);
            }
            if line.code.is_empty() {
                continue;
            }
            let mut cursor = self.cursor(line.code);
            let is_global = cursor.accept_word(b"GLOBAL");
            if cursor.accept_word(b"DEF") {
                self.routine(cursor, is_global, false)?;
            } else if cursor.accept_word(b"DEFFCT") {
                // The type, maybe an array's.
                cursor.next();
                if cursor.accept_mark(b'[') {
                    while !cursor.is_done() && !cursor.accept_mark(b']') {
                        cursor.next();
                    }
                }
                self.routine(cursor, is_global, true)?;
            } else if cursor.accept_word(b"DEFDAT") {
                self.file.module = name(&mut cursor);
                self.data_list();
            } else {
                self.file.odd.push((line.code, Reason::StatementOutside));
            }
        }
        Ok(())
    }

    fn routine(&mut self, mut cursor: Cursor<'a>, is_global: bool, is_function: bool) -> Result<(), TooDeep> {
        let name = name(&mut cursor);
        let mut params = Vec::new();
        if cursor.accept_mark(b'(') {
            while let Some(param) = cursor.accept(LexemeKind::Word) {
                let mut is_out = true;
                while !cursor.is_done() && !matches!(cursor.peek().kind, LexemeKind::Mark(b',' | b')')) {
                    if cursor.accept_word(b"IN") {
                        is_out = false;
                    } else {
                        cursor.next();
                    }
                }
                params.push(Param { name: param.span(), is_out });
                cursor.accept_mark(b',');
            }
        }
        if self.file.routines.is_empty() && self.file.module.is_empty() {
            self.file.module = name;
        }
        let mut data = Vec::new();
        let (body, end) = self.block(&[b"END", b"ENDFCT"], &mut data)?;
        if end.is_none() {
            self.file.cut = Some(name);
        }
        self.file.routines.push(Routine { name, is_function, is_global, params, data, body });
        Ok(())
    }

    /// Declarations, and elements of arrays, up to ENDDAT.
    fn data_list(&mut self) {
        while let Some(line) = self.lines.get(self.at).copied() {
            self.at += 1;
            if line.code.is_empty() {
                continue;
            }
            let mut cursor = self.cursor(line.code);
            if cursor.accept_word(b"ENDDAT") {
                return;
            }
            match self.declaration(line.code) {
                Some(mut data) => self.file.data.append(&mut data),
                None => self.file.values.push(line.code),
            }
        }
        self.file.cut = Some(self.file.module);
    }

    /// `[GLOBAL] [DECL] [CONST] type name […]`; `None` where a line is something else.
    fn declaration(&mut self, code: Span) -> Option<Vec<Data>> {
        let mut cursor = self.cursor(code);
        let (mut is_global, mut is_constant, mut is_declared) = (false, false, false);
        loop {
            if cursor.accept_word(b"DECL") {
                is_declared = true;
            } else if cursor.accept_word(b"GLOBAL") {
                is_global = true;
            } else if cursor.accept_word(b"CONST") {
                is_constant = true;
            } else {
                break;
            }
        }
        let kind = cursor.accept(LexemeKind::Word)?;
        let word = cursor.text(kind);
        let is = |known: &[u8]| word.eq_ignore_ascii_case(known);
        if !is_declared && STATEMENTS.iter().any(|known| is(known)) {
            return None;
        }
        // Types, routines and signals of other files have no value of their own.
        if [&b"STRUC"[..], b"ENUM", b"EXT", b"EXTFCT", b"EXTP", b"EXTFCTP", b"IMPORT", b"SIGNAL"].iter().any(|k| is(k))
        {
            return Some(Vec::new());
        }
        let mut dims = false;
        if cursor.peek().kind == LexemeKind::Mark(b'[') && is_declared {
            // `CHAR[16] name` is read too.
            dims = brackets(&mut cursor);
        }
        if cursor.peek().kind != LexemeKind::Word {
            return is_declared.then(Vec::new);
        }
        // DECL may be left out before types of the system alone: anything else is a statement of some option package.
        let is_type = || word.to_ascii_uppercase().ends_with(b"_T") || TYPES.iter().any(|known| is(known));
        if !is_declared && !is_global && !is_constant && !is_type() {
            return None;
        }
        let mut found = Vec::new();
        while let Some(name) = cursor.accept(LexemeKind::Word) {
            let is_array = cursor.peek().kind == LexemeKind::Mark(b'[') && brackets(&mut cursor) || dims;
            let value = cursor.accept_mark(b'=').then(|| {
                let start = cursor.peek().start;
                let mut depth = 0_usize;
                loop {
                    let next = cursor.peek();
                    match next.kind {
                        LexemeKind::End => return Span::new(start, next.start.max(start)),
                        LexemeKind::Mark(b',') if depth == 0 => return Span::new(start, next.start),
                        LexemeKind::Mark(b'{' | b'(' | b'[') => depth += 1,
                        LexemeKind::Mark(b'}' | b')' | b']') => depth = depth.saturating_sub(1),
                        _ => {}
                    }
                    cursor.next();
                }
            });
            let (kind, name) = (kind.span(), name.span());
            found.push(Data { kind, name, is_global, is_constant, is_array, value });
            if !cursor.accept_mark(b',') {
                break;
            }
        }
        Some(found)
    }

    /// Statements up to one of these words, which of them it was, and the words after it.
    pub(super) fn block(&mut self, ends: &[&[u8]], data: &mut Vec<Data>) -> Result<Block, TooDeep> {
        self.depth += 1;
        let mut block = Vec::new();
        while let Some(line) = self.lines.get(self.at).copied() {
            if self.depth > MAX_DEPTH {
                return Err(TooDeep(line.code));
            }
            let mut cursor = self.cursor(line.code);
            if let Some(which) = ends.iter().position(|end| cursor.accept_word(end)) {
                self.at += 1;
                self.depth -= 1;
                block.extend(line.mark.map(Statement::Mark));
                return Ok((block, Some((which, cursor.rest()))));
            }
            // A routine that is not closed does not take the next one with it.
            let opens = |mut cursor: Cursor<'_>| {
                cursor.accept_word(b"GLOBAL");
                cursor.is_at(b"DEF") || cursor.is_at(b"DEFFCT") || cursor.is_at(b"DEFDAT")
            };
            if opens(cursor) {
                break;
            }
            self.at += 1;
            block.extend(line.mark.map(Statement::Mark));
            if !line.code.is_empty() {
                self.statement(line.code, cursor, &mut block, data)?;
            }
        }
        self.depth -= 1;
        Ok((block, None))
    }

    fn statement(
        &mut self,
        at: Span,
        mut cursor: Cursor<'a>,
        block: &mut Vec<Statement>,
        data: &mut Vec<Data>,
    ) -> Result<(), TooDeep> {
        let missing = |file: &mut File, closed: bool| {
            if !closed {
                file.cut = Some(at);
            }
        };
        if cursor.accept_word(b"IF") {
            let (condition, _) = cursor.until(&[b"THEN"]);
            let (then, mut end) = self.block(&[b"ENDIF", b"ELSE"], data)?;
            let mut otherwise = Vec::new();
            if matches!(end, Some((1, _))) {
                (otherwise, end) = self.block(&[b"ENDIF"], data)?;
            }
            missing(&mut self.file, end.is_some());
            block.push(Statement::If { condition, then, otherwise, at });
        } else if cursor.accept_word(b"FOR") {
            let variable = cursor.next().span();
            cursor.accept_mark(b'=');
            let (from, _) = cursor.until(&[b"TO"]);
            let (to, which) = cursor.until(&[b"STEP"]);
            let step = which.map(|_| cursor.rest());
            let (body, end) = self.block(&[b"ENDFOR"], data)?;
            missing(&mut self.file, end.is_some());
            block.push(Statement::For { variable, from, to, step, body, at });
        } else if cursor.accept_word(b"WHILE") {
            let span = cursor.rest();
            let (body, end) = self.block(&[b"ENDWHILE"], data)?;
            missing(&mut self.file, end.is_some());
            let condition = Some(Condition { span, is_behind: false });
            block.push(Statement::Loop { condition, body, at });
        } else if cursor.accept_word(b"REPEAT") {
            let (body, end) = self.block(&[b"UNTIL"], data)?;
            missing(&mut self.file, end.is_some());
            let condition = end.map(|(_, span)| Condition { span, is_behind: true });
            block.push(Statement::Loop { condition, body, at });
        } else if cursor.accept_word(b"LOOP") {
            let (body, end) = self.block(&[b"ENDLOOP"], data)?;
            missing(&mut self.file, end.is_some());
            block.push(Statement::Loop { condition: None, body, at });
        } else if cursor.accept_word(b"SWITCH") {
            self.switch(at, cursor.rest(), block, data)?;
        } else if cursor.accept_word(b"SPLINE") || cursor.accept_word(b"PTP_SPLINE") {
            cursor.accept_word(b"WITH");
            let with = cursor.rest();
            let (body, end) = self.block(&[b"ENDSPLINE"], data)?;
            missing(&mut self.file, end.is_some());
            block.push(Statement::Spline { with, body });
        } else if cursor.accept_word(b"GOTO") {
            block.push(Statement::Jump);
        } else if cursor.accept_word(b"RETURN") {
            block.push(Statement::Return(cursor.rest()));
        } else if cursor.accept_word(b"EXIT") {
            block.push(Statement::Exit);
        } else if let Some(mut found) = self.declaration(at) {
            data.append(&mut found);
        } else if is_label(cursor) {
            block.push(Statement::Label);
        } else {
            block.push(Statement::Simple(at));
        }
        Ok(())
    }

    fn switch(
        &mut self,
        at: Span,
        subject: Span,
        block: &mut Vec<Statement>,
        data: &mut Vec<Data>,
    ) -> Result<(), TooDeep> {
        let ends: [&[u8]; 3] = [b"ENDSWITCH", b"CASE", b"DEFAULT"];
        // What stands before the first CASE is never run.
        let (_, mut end) = self.block(&ends, data)?;
        let (mut cases, mut otherwise) = (Vec::new(), Vec::new());
        loop {
            match end {
                Some((1, values)) => {
                    let (body, next) = self.block(&ends, data)?;
                    cases.push((values, body));
                    end = next;
                }
                Some((2, _)) => (otherwise, end) = self.block(&ends, data)?,
                Some(_) => break,
                None => {
                    self.file.cut = Some(at);
                    break;
                }
            }
        }
        block.push(Statement::Switch { subject, cases, otherwise, at });
        Ok(())
    }
}

/// A module's or routine's name; some begin with a digit.
fn name(cursor: &mut Cursor<'_>) -> Span {
    let mut name = cursor.next().span();
    loop {
        let next = cursor.peek();
        if next.start != name.range().end || !matches!(next.kind, LexemeKind::Word | LexemeKind::Number) {
            return name;
        }
        name = name.to(cursor.next().span());
    }
}

/// Passes `[…]`.
fn brackets(cursor: &mut Cursor<'_>) -> bool {
    while !cursor.is_done() && !cursor.accept_mark(b']') {
        cursor.next();
    }
    true
}

/// `name:`
fn is_label(mut cursor: Cursor<'_>) -> bool {
    cursor.accept(LexemeKind::Word).is_some() && cursor.accept_mark(b':') && cursor.is_done()
}
