//! Builds routines, data lists and blocks from lines. A line that is not understood does not affect the reading of other lines.

use super::expression::{Expression, Operator, Path, Setting};
use super::lex::{Cursor, LexemeKind, Line, lines};
use super::names;
use super::tree::{Data, File, If, Loop, Move, Param, Routine, Started, Statement, StatementKind, Type};
use super::value::{Name, Value, upper};
use crate::{Motion, Reason};
use deflex_lang::ir::Binary;
use deflex_text::{Source, Span};

/// Largest nesting depth of blocks: more than programs have.
pub(super) const MAX_DEPTH: usize = 100;

/// The place where blocks are nested too deep.
#[derive(Debug)]
pub(super) struct TooDeep(pub(super) Span);

/// First words of statements in which two words in a row are not a declaration, in addition to motions and to statements that change no
/// data.
const STATEMENTS: [&[u8]; 6] = [b"TRIGGER", b"GOTO", b"RETURN", b"ANIN", b"ASYCANCEL", b"TIME_BLOCK"];

/// Types of the system.
const TYPES: [&[u8]; 16] = [
    b"INT", b"REAL", b"BOOL", b"CHAR", b"FRAME", b"POS", b"E6POS", b"AXIS", b"E6AXIS", b"LOAD", b"FDAT", b"LDAT",
    b"PDAT", b"CP", b"INERTIA", b"SPL_VELOCITY",
];

/// Whether a word in upper case is a type of the system, which begins a declaration.
pub(crate) fn is_type(word: &[u8]) -> bool {
    TYPES.contains(&word)
}

/// The statements of a block, the word that ended it, and the text after that word.
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

    fn name_at(&self, span: Span) -> Name {
        upper(&self.bytes[span.range()])
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
                cursor.accept_brackets();
                self.routine(cursor, is_global, true)?;
            } else if cursor.accept_word(b"DEFDAT") {
                let at = name(&mut cursor);
                self.file.module = self.name_at(at);
                self.data_list(at);
            } else {
                self.file.odd.push((line.code, Reason::StatementOutside));
            }
        }
        Ok(())
    }

    fn routine(&mut self, mut cursor: Cursor<'a>, is_global: bool, is_function: bool) -> Result<(), TooDeep> {
        let at = name(&mut cursor);
        let name = self.name_at(at);
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
                params.push(Param { name: upper(cursor.text(param)), is_out });
                cursor.accept_mark(b',');
            }
        }
        if self.file.routines.is_empty() && self.file.module.is_empty() {
            self.file.module = name.clone();
        }
        let mut data = Vec::new();
        let (body, end) = self.block(&[b"END", b"ENDFCT"], &mut data)?;
        if end.is_none() {
            self.file.cut = Some(at);
        }
        self.file.routines.push(Routine { name, is_function, is_global, params, data, body });
        Ok(())
    }

    /// Declarations, and elements of arrays, up to ENDDAT.
    fn data_list(&mut self, at: Span) {
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
                None => match self.cursor(line.code).setting() {
                    Some(setting) => self.file.values.push((setting, line.code)),
                    None => self.file.odd.push((line.code, Reason::NotUnderstood)),
                },
            }
        }
        self.file.cut = Some(at);
    }

    /// `[GLOBAL] [DECL] [CONST] type name […]`; `None` if the line is not a declaration.
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
        let name = upper(word);
        let moves = || names::motion(&name).is_some() || names::relative(&name).is_some();
        let is_statement = || STATEMENTS.iter().chain(&names::HARMLESS_STATEMENTS).any(|known| is(known));
        if !is_declared && (moves() || is_statement()) {
            return None;
        }
        // Types and routines of other files have no value of their own.
        match &name[..] {
            b"STRUC" => self.structure(cursor),
            b"IMPORT" => self.import(cursor),
            _ => {}
        }
        if [&b"STRUC"[..], b"ENUM", b"EXT", b"EXTFCT", b"EXTP", b"EXTFCTP", b"IMPORT"].iter().any(|k| is(k)) {
            return Some(Vec::new());
        }
        if is(b"SIGNAL") {
            let word = cursor.accept(LexemeKind::Word)?;
            let (kind, name) = (Some(Type::Signal), upper(cursor.text(word)));
            return Some(vec![Data { kind, name, is_global, is_constant: false, is_array: false, value: None }]);
        }
        // `CHAR[16] name` is read too.
        let dims = is_declared && cursor.accept_brackets();
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
            let is_array = cursor.accept_brackets() || dims;
            let value = cursor.accept_mark(b'=').then(|| cursor.expression());
            let name = upper(cursor.text(name));
            found.push(Data { kind: type_of(word), name, is_global, is_constant, is_array, value });
            if !cursor.accept_mark(b',') {
                break;
            }
        }
        Some(found)
    }

    /// `STRUC name INT a,b, REAL c`: notes the components that are whole numbers.
    fn structure(&mut self, mut cursor: Cursor<'a>) {
        cursor.next();
        let mut is_whole = false;
        while let Some(first) = cursor.accept(LexemeKind::Word) {
            let second = cursor.accept(LexemeKind::Word);
            if second.is_some() {
                is_whole = cursor.text(first).eq_ignore_ascii_case(b"INT");
            }
            if is_whole {
                self.file.whole.push(upper(cursor.text(second.unwrap_or(first))));
            }
            cursor.accept_brackets();
            cursor.accept_mark(b',');
        }
    }

    /// `IMPORT type name IS /R1/module..name`: the last two words are those of the other file.
    fn import(&mut self, mut cursor: Cursor<'a>) {
        let mut words = Vec::new();
        while !cursor.is_done() {
            let lexeme = cursor.next();
            if lexeme.kind == LexemeKind::Word {
                words.push(upper(cursor.text(lexeme)));
            }
        }
        if let [.., module, name] = &words[..] {
            self.file.imports.push((module.clone(), name.clone()));
        }
    }

    /// Reads statements up to one of these words. Returns which of them it was, and the text after it.
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
                block.extend(marked(line));
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
            block.extend(marked(line));
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
        let mut open = None;
        let mut closed = |end: &Option<(usize, Span)>| open = if end.is_none() { Some(at) } else { open };
        let kind = if cursor.accept_word(b"IF") {
            let (condition, _) = cursor.until(&[b"THEN"]);
            let condition = self.cursor(condition).whole();
            let (then, mut end) = self.block(&[b"ENDIF", b"ELSE"], data)?;
            let mut otherwise = Vec::new();
            if matches!(end, Some((1, _))) {
                (otherwise, end) = self.block(&[b"ENDIF"], data)?;
            }
            closed(&end);
            StatementKind::If(Box::new(If { condition, then, otherwise }))
        } else if cursor.accept_word(b"FOR") {
            let counter = cursor.next();
            let counter = Path { name: upper(cursor.text(counter)), at: counter.span(), steps: Vec::new() };
            cursor.accept_mark(b'=');
            let (from, _) = cursor.until(&[b"TO"]);
            let (to, which) = cursor.until(&[b"STEP"]);
            let [from, to] = [from, to].map(|span| self.cursor(span).whole());
            let step = which.map_or(Expression::Known(Value::Number(1.0, None)), |_| cursor.whole());
            let mut bound = |name: &str, value| held(name, at, value, Some(Type::Whole), block, data);
            let (to, step) = (bound("TO", to), bound("STEP", step));
            block.push(assignment(counter.clone(), from, at));
            let (mut then, end) = self.block(&[b"ENDFOR"], data)?;
            closed(&end);
            // Up to the last value, or down to it.
            let read = || Expression::Path(Box::new(counter.clone()));
            let way = read().with(Binary::Subtract, to).with(Binary::Multiply, step.clone());
            let condition = way.with(Binary::AtMost, Expression::Known(Value::Number(0.0, None)));
            then.push(assignment(counter.clone(), read().with(Binary::Add, step), at));
            let end = Expression::unknown(Reason::CounterAfterLoop);
            let otherwise = vec![assignment(counter.clone(), end, at), Statement { kind: StatementKind::Exit, at }];
            let round = StatementKind::If(Box::new(If { condition, then, otherwise }));
            let (condition, body) = (Expression::Known(Value::Bool(true)), vec![Statement { kind: round, at }]);
            StatementKind::Loop(Box::new(Loop { condition, is_until: false, body }))
        } else if cursor.accept_word(b"WHILE") {
            let condition = cursor.whole();
            let (body, end) = self.block(&[b"ENDWHILE"], data)?;
            closed(&end);
            StatementKind::Loop(Box::new(Loop { condition, is_until: false, body }))
        } else if cursor.accept_word(b"REPEAT") {
            let (body, end) = self.block(&[b"UNTIL"], data)?;
            closed(&end);
            let condition = end.map_or(Expression::Known(Value::Bool(false)), |(_, span)| self.cursor(span).whole());
            StatementKind::Loop(Box::new(Loop { condition, is_until: true, body }))
        } else if cursor.accept_word(b"LOOP") {
            let (body, end) = self.block(&[b"ENDLOOP"], data)?;
            closed(&end);
            let condition = Expression::Known(Value::Bool(true));
            StatementKind::Loop(Box::new(Loop { condition, is_until: false, body }))
        } else if cursor.accept_word(b"SWITCH") {
            let subject = held("CASE", at, cursor.whole(), None, block, data);
            self.switch(at, &subject, block, data)?;
            return Ok(());
        } else if cursor.accept_word(b"SPLINE") || cursor.accept_word(b"PTP_SPLINE") {
            cursor.accept_word(b"WITH");
            block.push(Statement { kind: StatementKind::SplineBegins(settings(cursor).0), at });
            let (mut body, end) = self.block(&[b"ENDSPLINE"], data)?;
            closed(&end);
            block.append(&mut body);
            StatementKind::SplineEnds
        } else if cursor.accept_word(b"GOTO") {
            StatementKind::Jump(upper(cursor.text(cursor.peek())))
        } else if cursor.accept_word(b"RETURN") {
            StatementKind::Return(if cursor.is_done() { Vec::new() } else { vec![cursor.whole()] })
        } else if cursor.accept_word(b"EXIT") {
            StatementKind::Exit
        } else if let Some(mut found) = self.declaration(at) {
            data.append(&mut found);
            return Ok(());
        } else if is_label(cursor) {
            StatementKind::Label(upper(cursor.text(cursor.peek())))
        } else {
            simple(cursor)
        };
        self.file.cut = open.or(self.file.cut);
        block.push(Statement { kind, at });
        Ok(())
    }

    /// Branches of branches, up to ENDSWITCH.
    fn switch(
        &mut self,
        at: Span,
        subject: &Expression,
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
                    let equal = |value| (Operator::Other(Binary::Or), subject.clone().with(Binary::Equal, value));
                    let values = self.cursor(values).list().into_iter().map(equal).collect();
                    cases.push((Expression::Chain(Box::new(Expression::Known(Value::Bool(false))), values), body));
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
        for (condition, then) in cases.into_iter().rev() {
            let kind = StatementKind::If(Box::new(If { condition, then, otherwise }));
            otherwise = vec![Statement { kind, at }];
        }
        block.append(&mut otherwise);
        Ok(())
    }
}

/// Stores the value of an expression at the start of a statement, under a name that no program can have.
fn held(
    name: &str,
    at: Span,
    value: Expression,
    kind: Option<Type>,
    block: &mut Vec<Statement>,
    data: &mut Vec<Data>,
) -> Expression {
    if matches!(value, Expression::Known(_)) {
        return value;
    }
    let name = upper(format!(" {name}{}", at.start).as_bytes());
    let own = Data { kind, name: name.clone(), is_global: false, is_constant: false, is_array: false, value: None };
    data.push(own);
    let path = Path { name, at, steps: Vec::new() };
    block.push(assignment(path.clone(), value, at));
    Expression::Path(Box::new(path))
}

fn assignment(to: Path, value: Expression, at: Span) -> Statement {
    Statement { kind: StatementKind::Assign(Box::new(Setting { to, value })), at }
}

/// A statement that fits on its line.
pub(super) fn simple(mut cursor: Cursor<'_>) -> StatementKind {
    let start = cursor;
    let word = upper(cursor.text(cursor.peek()));
    if let Some(motion) = names::motion(&word) {
        cursor.next();
        return StatementKind::Move(Box::new(Move { is_curve: word[..] == *b"SPL", ..moves(motion, cursor) }));
    }
    if let Some(reason) = names::relative(&word) {
        cursor.next();
        return StatementKind::Relative(reason, cursor.list());
    }
    match &word[..] {
        // A TRIGGER does not start another TRIGGER.
        b"TRIGGER" if cursor.depth == 0 => {
            cursor.next();
            let started = started(cursor);
            let is_known = started.run.is_some();
            return if is_known {
                StatementKind::Trigger(Box::new(started))
            } else {
                StatementKind::NotUnderstood(started.when)
            };
        }
        b"INTERRUPT" | b"GLOBAL" if cursor.depth == 0 => {
            cursor.accept_word(b"GLOBAL");
            // Some versions have options between these words (WITH BRAKE).
            let declares = { cursor }.until(&[b"DECL"]).1.is_some();
            let off = |mut cursor: Cursor<'_>| Started { when: cursor.parts(LexemeKind::End), run: None };
            return StatementKind::Interrupt(Box::new(if declares { started(cursor) } else { off(cursor) }));
        }
        // From here on, the value is computed again and again.
        b"ANIN" => {
            cursor.next();
            if cursor.accept_word(b"OFF") {
                return StatementKind::Harmless(cursor.parts(LexemeKind::End));
            }
            let is_on = cursor.accept_word(b"ON");
            let at = cursor.rest();
            let setting = cursor.setting().filter(|_| is_on && cursor.is_done());
            return setting.map_or_else(
                || StatementKind::NotUnderstood({ start }.parts(LexemeKind::End)),
                |setting| {
                    let run = Some(Statement { kind: StatementKind::Assign(Box::new(setting)), at });
                    StatementKind::Trigger(Box::new(Started { when: Vec::new(), run }))
                },
            );
        }
        b"RESUME" => return StatementKind::Resume,
        b"TIME_BLOCK" => return StatementKind::TimeBlock(cursor.parts(LexemeKind::End)),
        b"ON_ERROR_PROCEED" => return StatementKind::Proceed,
        _ => {}
    }
    if let Some(setting) = cursor.setting().filter(|_| cursor.is_done()) {
        return StatementKind::Assign(Box::new(setting));
    }
    cursor = start;
    if names::HARMLESS_STATEMENTS.contains(&&word[..]) {
        let waits = word[..] == *b"WAIT" && {
            let mut after = cursor;
            after.next();
            after.accept_word(b"FOR")
        };
        let kind = if waits { StatementKind::WaitFor } else { StatementKind::Harmless };
        return kind(cursor.parts(LexemeKind::End));
    }
    match cursor.call().filter(|_| cursor.is_done()) {
        Some(call) => StatementKind::Call(Box::new(call)),
        None => StatementKind::NotUnderstood({ start }.parts(LexemeKind::End)),
    }
}

/// A motion after its word.
fn moves(motion: Motion, mut cursor: Cursor<'_>) -> Move {
    let first = cursor.expression();
    let second = cursor.accept_mark(b',').then(|| cursor.expression());
    let angle = (cursor.accept_mark(b',') && cursor.accept_word(b"CA")).then(|| Box::new(cursor.expression()));
    let approximate = &names::APPROXIMATE[1..];
    let pass = |cursor: &mut Cursor<'_>| while approximate.iter().any(|word| cursor.accept_word(word)) {};
    pass(&mut cursor);
    let (mut with, mut is_whole) = (Vec::new(), true);
    if cursor.accept_word(b"WITH") {
        let (span, is_approximate) = cursor.until(approximate);
        (with, is_whole) = settings(cursor.within(span));
        if is_approximate.is_some() {
            pass(&mut cursor);
        }
    }
    let (via, end) = match second {
        Some(second) => (Some(Box::new(first)), second),
        None => (None, first),
    };
    Move { motion, is_curve: false, via, end, angle, with, is_whole: is_whole && cursor.is_done() }
}

/// The settings of WITH, and whether nothing else follows.
fn settings(mut cursor: Cursor<'_>) -> (Vec<Setting>, bool) {
    let mut all = Vec::new();
    while let Some(setting) = cursor.setting() {
        all.push(setting);
        if !cursor.accept_mark(b',') {
            break;
        }
    }
    (all, cursor.is_done())
}

/// `WHEN … DO …`
fn started(mut cursor: Cursor<'_>) -> Started {
    let (when, is_said) = cursor.until(&[b"DO"]);
    let (at, _) = cursor.until(&[b"PRIO"]);
    let mut inner = cursor.within(at);
    inner.depth += 1;
    let run = is_said.map(|_| Statement { kind: simple(inner), at });
    Started { when: cursor.within(when).parts(LexemeKind::End), run }
}

fn marked(line: Line) -> Option<Statement> {
    line.mark.map(|mark| Statement { kind: StatementKind::Mark(mark), at: line.code })
}

fn type_of(word: &[u8]) -> Option<Type> {
    let known = [(&b"INT"[..], Type::Whole), (b"REAL", Type::Real), (b"FRAME", Type::Frame), (b"POS", Type::Pos)];
    let own = || TYPES.iter().all(|known| !word.eq_ignore_ascii_case(known)).then_some(Type::Structure);
    known.into_iter().find(|(name, _)| word.eq_ignore_ascii_case(name)).map(|(_, of)| of).or_else(own)
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

/// `name:`
fn is_label(mut cursor: Cursor<'_>) -> bool {
    cursor.accept(LexemeKind::Word).is_some() && cursor.accept_mark(b':') && cursor.is_done()
}
