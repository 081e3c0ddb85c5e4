//! Jobs to the intermediate representation.

use super::lex::lexemes;
use super::words::{self, Does};
use super::{builtin, header};
use crate::Span;
use crate::ir::{
    Argument, Binary, Callee, Expression, ExpressionKind as Is, Fault, Function, FunctionId, Motion, Path, Place,
    Program, Slot, Statement, StatementKind, Switch, Unary,
};
use crate::lexeme::{Kind, Lexeme};
use crate::value::{Given, Reason};
use header::Header;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Deepest nesting of blocks and expressions: far beyond any job, and within any stack.
const DEEPEST: usize = 64;

/// A variable's kind: `b"P"`, and its number.
type Numbered<'a> = (&'a [u8], u32);

/// A job's text, cut into lines.
struct Job<'a> {
    id: FunctionId,
    source: u16,
    /// Teaching positions by number.
    positions: BTreeMap<u32, Expression>,
    lines: Vec<Line<'a>>,
    /// Whether a base axis carries the robot.
    has_base_axis: bool,
}

enum Line<'a> {
    Code(Vec<Lexeme<'a>>),
    Mark(&'a [u8], Span),
}

#[derive(Default)]
struct Parser<'a> {
    program: Program,
    jobs: BTreeMap<&'a [u8], Vec<FunctionId>>,
    globals: BTreeMap<Numbered<'a>, Slot>,
    /// Position variables that jobs bring along, with what they are when the job is loaded.
    loaded: BTreeMap<u32, Vec<Expression>>,
    /// Position variables that some statement writes.
    written: BTreeSet<Slot>,
    /// Whether all circles are three points in a row, which is what is known of how they go.
    has_plain_circles: bool,
    called: BTreeSet<FunctionId>,
    foreign: BTreeSet<String>,
    frame_changes: bool,
    tool_changes: bool,
    // The job that is being read.
    job: Option<Job<'a>>,
    locals: BTreeMap<Numbered<'a>, u32>,
    /// How often each label stands in the job, and how often it has been passed.
    labels: BTreeMap<String, u32>,
    passed: BTreeMap<String, u32>,
    /// Points of the circle that is open, and the one on the way.
    circle: (u32, Option<Expression>),
    code: Vec<Lexeme<'a>>,
    at: usize,
    line: usize,
    depth: usize,
}

pub(super) fn read(sources: &[&[u8]], written: usize) -> Result<Program, Fault> {
    let mut program = Program::default();
    program.functions.resize_with(sources.len(), Function::default);
    let (mut jobs, mut names, mut loaded) = (Vec::new(), BTreeMap::<&[u8], Vec<FunctionId>>::new(), BTreeMap::new());
    for (source, bytes) in sources.iter().enumerate() {
        for job in Header::jobs(bytes, source as u16, &mut program, &mut loaded)? {
            let id = FunctionId(program.functions.len() as u32);
            program.functions.push(Function { name: text(job.name), place: job.place, ..Function::default() });
            names.entry(job.name).or_default().push(id);
            jobs.push(Job {
                id,
                source: source as u16,
                positions: job.positions,
                lines: job.lines.into_iter().filter_map(line).collect(),
                has_base_axis: job.has_base_axis,
            });
        }
    }
    let mut globals = BTreeMap::new();
    for (kind, number) in jobs.iter().flat_map(|job| &job.lines).flat_map(Line::variables) {
        let next = Slot::Global((Switch::ALL.len() + globals.len()) as u32);
        globals.entry((kind, number)).or_insert(next);
    }
    for number in loaded.keys() {
        let next = Slot::Global((Switch::ALL.len() + globals.len()) as u32);
        globals.entry((b"P", *number)).or_insert(next);
    }
    program.globals = Switch::ALL.iter().map(|switch| Arc::from(format!("{switch:?}"))).collect();
    let mut named: Vec<(Slot, Arc<str>)> =
        globals.iter().map(|((kind, number), slot)| (*slot, format!("{}{number}", text(kind)).into())).collect();
    named.sort_unstable();
    program.globals.extend(named.into_iter().map(|(_, name)| name));
    let has_plain_circles = jobs.iter().all(|job| has_plain_circles(&job.lines));
    let mut parser = Parser { program, jobs: names, globals, loaded, has_plain_circles, ..Parser::default() };
    let mut begun = Vec::new();
    for job in jobs {
        begun.extend((usize::from(job.source) < written).then_some(job.id));
        parser.job(job)?;
    }
    Ok(parser.program(begun))
}

/// A line with something in it.
fn line((start, bytes): (usize, &[u8])) -> Option<Line<'_>> {
    if let Some(comment) = bytes.strip_prefix(b"'") {
        let mut words = comment.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        let is_mark = words.next().is_some_and(|word| word.eq_ignore_ascii_case(b"deflex"));
        return is_mark
            .then(|| words.next())
            .flatten()
            .map(|said| Line::Mark(said, Span::new(start, start + bytes.len())));
    }
    let code = lexemes(bytes, start);
    (!code.is_empty()).then_some(Line::Code(code))
}

impl<'a> Line<'a> {
    /// The global variables that a line names.
    fn variables(&self) -> impl Iterator<Item = Numbered<'a>> {
        let code: &[Lexeme<'a>] = if let Line::Code(code) = self { code } else { &[] };
        code.iter()
            .filter_map(|lexeme| variable(lexeme.text))
            .filter(|(local, ..)| !local)
            .map(|(_, kind, number)| (kind, number))
    }

    /// The words of a motion that a line has, without its sign for another robot.
    fn motion(&self) -> Option<&[u8]> {
        let Line::Code(code) = self else { return None };
        code.iter()
            .find(|lexeme| lexeme.kind == Kind::Name)
            .map(|word| word.text)
            .filter(|word| motion_path(word).is_some())
    }
}

/// `P012`, `LB000`: whether it is a job's own, its kind and its number. `PX012` is `P012` with its other axes.
fn variable(word: &[u8]) -> Option<(bool, &[u8], u32)> {
    let (local, word) = match word {
        [b'L', rest @ ..] if rest.len() > 1 => (true, rest),
        _ => (false, word),
    };
    let digits = word.iter().position(u8::is_ascii_digit)?;
    let (kind, number) = word.split_at(digits);
    let kind: &[u8] = kind_of(kind)?;
    let number = std::str::from_utf8(number).ok()?.parse().ok()?;
    Some((local, kind, number))
}

fn kind_of(word: &[u8]) -> Option<&'static [u8]> {
    const KINDS: [&[u8]; 8] = [b"B", b"I", b"D", b"R", b"S", b"P", b"BP", b"EX"];
    KINDS.into_iter().find(|kind| *kind == if word == b"PX" { b"P" } else { word })
}

/// Whether circles of a job are three points in a row each, with another motion before them that always comes first.
fn has_plain_circles(lines: &[Line<'_>]) -> bool {
    // Points of the circle that is open, and whether the motion before is the one in the text.
    let (mut points, mut before) = (0, false);
    for line in lines {
        let Line::Code(code) = line else { continue };
        match line.motion() {
            Some(b"MOVC") if points > 0 || before => points += 1,
            Some(b"MOVC") => return false,
            Some(_) => {
                if !matches!(points, 0 | 3) {
                    return false;
                }
                (points, before) = (0, true);
            }
            None => {
                if matches!(points, 1 | 2) {
                    return false;
                }
                let quiet = words::find(code[0].text) == Some(Does::Nothing);
                before &= quiet;
                if points == 3 && !quiet {
                    points = 0;
                }
            }
        }
        if points > 3 || points > 0 && code.iter().any(|lexeme| lexeme.is("FPT")) {
            return false;
        }
    }
    matches!(points, 0 | 3)
}

/// How a motion instruction goes; `None` where the word is none.
fn motion_path(word: &[u8]) -> Option<Path> {
    Some(match word {
        b"MOVJ" => Path::Joint,
        b"MOVL" => Path::Linear,
        b"MOVC" => Path::Circular,
        b"MOVS" => Path::Other(Reason::Spline),
        b"IMOV" => Path::Unknown(Reason::Relative),
        b"SMOVL" | b"SMOVC" | b"SMOVS" | b"SYMOVL" | b"SYMOVC" | b"SYMOVJ" | b"EIMOVL" | b"EIMOVC" => {
            Path::Unknown(Reason::Follows)
        }
        _ => return None,
    })
}

impl<'a> Parser<'a> {
    fn job(&mut self, job: Job<'a>) -> Result<(), Fault> {
        let id = job.id.0 as usize;
        self.job = Some(job);
        (self.line, self.depth) = (0, 0);
        self.locals.clear();
        self.labels.clear();
        self.passed.clear();
        self.circle = (0, None);
        self.survey();
        let body = self.block(&[])?;
        let function = &mut self.program.functions[id];
        (function.body, function.locals) = (body, self.locals.len() as u32);
        Ok(())
    }

    fn program(mut self, begun: Vec<FunctionId>) -> Program {
        // Variables keep their values from run to run: what is written anywhere may hold any of it when a run begins.
        let everything = if self.foreign.is_empty() { None } else { Some(Reason::Foreign) };
        let everything = everything.or((!self.program.not_understood.is_empty()).then_some(Reason::NotUnderstood));
        let mut first = Vec::new();
        let mut assign = |slot: Slot, value: Expression| {
            let place = value.place;
            first.push(Statement { kind: StatementKind::Assign { slot, path: Vec::new(), value }, place });
        };
        let mut loaded = std::mem::take(&mut self.loaded);
        // What comes with a job is what a variable holds until it is written.
        let begins =
            loaded.iter().filter_map(|(number, values)| Some((*self.globals.get(&(&b"P"[..], *number))?, values)));
        let left = self.program.left(begins.flat_map(|(slot, values)| values.iter().map(move |value| (slot, value))));
        for ((kind, number), slot) in &self.globals {
            let mut values = if *kind == b"P" { loaded.remove(number).unwrap_or_default() } else { Vec::new() };
            let is_written = values.len() > 1 || self.written.contains(slot);
            let reason = is_written.then_some(Reason::Variable).or(everything.filter(|_| *kind == b"P"));
            if let Some(reason) = reason {
                let tokens = left.get(slot).into_iter().flatten();
                values
                    .extend(tokens.map(|token| Expression { kind: Is::Number(0.0, *token), place: Place::default() }));
                assign(*slot, builtin::left(reason, values));
            } else if let Some(value) = values.pop() {
                assign(*slot, value);
            }
        }
        for (changes, switch, reason) in
            [(self.frame_changes, Switch::Frame, Reason::Frame), (self.tool_changes, Switch::Tool, Reason::Tool)]
        {
            if changes {
                assign(switch.slot(), Expression { kind: Is::Unknown(reason, Vec::new()), place: Place::default() });
            }
        }
        self.program.functions[0].body = first;
        self.program.variables_outlive_runs = true;
        let started = begun.into_iter().filter(|id| !self.called.contains(id));
        self.program.entries = [FunctionId(0)].into_iter().chain(started).collect();
        self.program
    }

    fn place(&self, span: Span) -> Place {
        Place { source: self.job.as_ref().map_or(0, |job| job.source), span }
    }

    fn lines(&self) -> &[Line<'a>] {
        self.job.as_ref().map_or(&[], |job| &job.lines)
    }

    fn peek(&self) -> Option<Lexeme<'a>> {
        self.code.get(self.at).copied()
    }

    fn next_is(&self, text: &str) -> bool {
        self.peek().is_some_and(|lexeme| lexeme.is(text))
    }

    fn take(&mut self, text: &str) -> bool {
        let is = self.next_is(text);
        self.at += usize::from(is);
        is
    }

    fn here(&self) -> Span {
        self.peek().or(self.code.last().copied()).map_or(Span::default(), |lexeme| lexeme.span)
    }

    /// From a lexeme to the last one read.
    fn since(&self, start: Span) -> Place {
        let last = self.code.get(self.at.wrapping_sub(1)).map_or(start, |lexeme| lexeme.span);
        self.place(if last.end < start.end { start } else { start.to(last) })
    }

    fn expression_at(&self, kind: Is, start: Span) -> Expression {
        Expression { kind, place: self.since(start) }
    }

    /// Begins with the next line, where it is an instruction.
    fn open(&mut self) -> bool {
        let Some(Line::Code(code)) = self.lines().get(self.line) else { return false };
        (self.code, self.at) = (code.clone(), 0);
        true
    }

    /// The job's own variables, and how often each label stands in it.
    fn survey(&mut self) {
        for line in 0..self.lines().len() {
            self.line = line;
            let is_code = self.open();
            for lexeme in self.code.clone().into_iter().filter(|_| is_code) {
                if let Some((true, kind, number)) = variable(lexeme.text) {
                    self.slot(true, kind, number);
                }
            }
            if is_code && self.take("*") {
                let name = self.name();
                *self.labels.entry(name).or_default() += 1;
            }
        }
        self.line = 0;
    }

    /// What stands without a blank from here on: the name of a label or a job.
    fn name(&mut self) -> String {
        let (mut name, mut end) = (String::new(), None);
        let goes_on =
            |lexeme: &Lexeme<'_>, end: Option<u32>| end.is_none_or(|end| lexeme.span.start == end) && !lexeme.is("(");
        while let Some(lexeme) = self.peek().filter(|lexeme| goes_on(lexeme, end)) {
            name.push_str(&text(lexeme.text));
            end = Some(lexeme.span.end);
            self.at += 1;
        }
        name
    }

    /// Statements up to an instruction that ends their block, which is left open.
    fn block(&mut self, ends: &[&str]) -> Result<Vec<Statement>, Fault> {
        let mut all = Vec::new();
        if self.depth >= DEEPEST {
            return Err(Fault { place: self.since(self.here()), message: "blocks are nested deeper than 64" });
        }
        self.depth += 1;
        while self.line < self.lines().len() {
            if let Line::Mark(said, span) = &self.lines()[self.line] {
                let place = self.place(*span);
                let value = Expression { kind: Is::Text(said.to_ascii_lowercase().into()), place };
                let kind = StatementKind::Assign { slot: Switch::Mark.slot(), path: Vec::new(), value };
                all.push(Statement { kind, place });
                self.line += 1;
                continue;
            }
            self.open();
            if self.code.first().is_some_and(|word| ends.iter().any(|end| word.is(end))) {
                break;
            }
            self.statement(&mut all)?;
        }
        self.depth -= 1;
        Ok(all)
    }

    fn statement(&mut self, all: &mut Vec<Statement>) -> Result<(), Fault> {
        let (start, line) = (self.here(), self.line);
        let kinds = match self.known_statement(start)? {
            Some(kinds) if self.line != line || self.at >= self.code.len() => kinds,
            _ => {
                self.line = line;
                self.open();
                let reads = vec![self.rest(Reason::NotUnderstood)];
                let place = self.since(start);
                self.program.not_understood.push(place);
                vec![StatementKind::Opaque { writes: None, reads, reason: Reason::NotUnderstood }]
            }
        };
        let place = if self.line == line { self.since(start) } else { self.place(start) };
        if self.line == line {
            self.line += 1;
        }
        all.extend(kinds.into_iter().map(|kind| Statement { kind, place }));
        Ok(())
    }

    /// What the rest of the line names, as something that is not known.
    fn rest(&mut self, reason: Reason) -> Expression {
        let start = self.here();
        let parts = self.named(false);
        self.expression_at(Is::Unknown(reason, parts), start)
    }

    /// What the rest of the line names, or what it names before `IF`.
    fn named(&mut self, ends_at_if: bool) -> Vec<Expression> {
        let mut parts = Vec::new();
        while let Some(lexeme) =
            self.peek().filter(|lexeme| !ends_at_if || !(lexeme.is("IF") || lexeme.is("IFEXPRESS")))
        {
            let from = self.at;
            match self.operand() {
                Some(operand) => parts.push(operand),
                None => {
                    self.at = from + 1;
                    // `ARGFB001` names `B001`.
                    let argument = lexeme.text.strip_prefix(b"ARGF").and_then(variable);
                    if let Some((local, kind, number)) = argument {
                        let slot = self.slot(local, kind, number);
                        parts.push(self.expression_at(Is::Read(slot), lexeme.span));
                    }
                }
            }
        }
        parts
    }

    /// The next statement; `None` where it is not understood. Blocks go on to their last line.
    fn known_statement(&mut self, start: Span) -> Result<Option<Vec<StatementKind>>, Fault> {
        let Some(word) = self.peek() else { return Ok(Some(Vec::new())) };
        self.at += 1;
        if word.is("*") {
            let name = self.name();
            let count = self.passed.entry(name.clone()).or_default();
            *count += 1;
            return Ok(Some(vec![StatementKind::Label(format!("{name} {}", *count - 1).into())]));
        }
        Ok(match word.text {
            b"IFTHEN" | b"IFTHENEXP" => return self.conditional(start).map(Some),
            b"WHILE" | b"WHILEEXP" => {
                let condition = self.conditions();
                let body = self.body(&["ENDWHILE"], start)?;
                Some(vec![StatementKind::Loop { condition: Some(condition), body }])
            }
            b"FOR" => return self.counted(start),
            b"SWITCH" => return self.switch(start).map(Some),
            b"END" => Some(vec![StatementKind::Return(None)]),
            b"RET" => {
                // The caller may use what it returns in any way: only the run knows how.
                let given = StatementKind::Evaluate(Expression {
                    kind: Is::Unknown(Reason::Input, self.named(true)),
                    place: self.since(start),
                });
                self.perhaps(vec![given, StatementKind::Return(None)], start)
            }
            b"ABORT" => self.perhaps(vec![StatementKind::Halt], start),
            b"JUMP" => self.jump(start),
            b"CALL" => {
                let call = self.call(start);
                call.and_then(|call| self.perhaps(call, start))
            }
            b"PSTART" => {
                let call = self.call(start);
                if let Some([StatementKind::Evaluate(Expression { kind: Is::Call(Callee::Function(id), _), .. }), ..]) =
                    call.as_deref()
                {
                    self.program.threads.push(*id);
                    Some(Vec::new())
                } else {
                    // It may write any variable at any moment.
                    let all = self.globals.values().map(|slot| (*slot, Reason::Thread));
                    self.program.volatile = all.collect();
                    call
                }
            }
            b"PWAIT" | b"TSYNC" => {
                let rest = self.rest(Reason::Input);
                Some(vec![StatementKind::Evaluate(rest)])
            }
            b"SET" => self.set(|_, value| value),
            b"INC" => self.set(|old, _| old.with(Binary::Add, 1.0)),
            b"DEC" => self.set(|old, _| old.with(Binary::Subtract, 1.0)),
            b"ADD" | b"SUB" | b"MUL" | b"DIV" => {
                let operator = match word.text {
                    b"ADD" => Binary::Add,
                    b"SUB" => Binary::Subtract,
                    b"MUL" => Binary::Multiply,
                    _ => Binary::Divide,
                };
                self.set(|old, value| {
                    let place = value.place;
                    Expression { kind: Is::Binary(operator, Box::new([old, value])), place }
                })
            }
            b"SETE" => self.set_element(),
            b"GETE" => self.get_element(start),
            b"CLEAR" => self.clear(),
            b"SFTON" => self.shift(start),
            b"MACRO" | b"MACRO1" | b"MACRO2" => {
                let words = self.code.iter().take_while(|lexeme| !lexeme.text.starts_with(b"ARGF"));
                let name: String = words.map(|lexeme| String::from_utf8_lossy(lexeme.text)).collect();
                let arguments = self.named(false).into_iter().map(|value| Argument { name: None, value }).collect();
                Some(vec![self.foreign(&name, arguments, start)])
            }
            _ if word.is("+") => None,
            text if motion_path(text).is_some() => self.motion(text, start),
            text => words::find(text).map(|does| self.instruction(does, text, start)),
        })
    }

    /// An instruction that may say `IF` and a condition.
    fn perhaps(&mut self, kinds: Vec<StatementKind>, start: Span) -> Option<Vec<StatementKind>> {
        if !self.take("IF") && !self.take("IFEXPRESS") {
            return (self.at >= self.code.len()).then_some(kinds);
        }
        let condition = self.condition();
        let place = self.since(start);
        let body = kinds.into_iter().map(|kind| Statement { kind, place }).collect();
        Some(vec![StatementKind::If { arms: vec![(condition, body)], otherwise: Vec::new() }])
    }

    /// A condition, with what the lines after it add.
    fn conditions(&mut self) -> Expression {
        let mut condition = self.condition();
        self.line += 1;
        while self.open() && ["ANDIF", "ORIF", "ANDEXP", "OREXP"].iter().any(|word| self.next_is(word)) {
            let start = self.here();
            self.at += 1;
            let more = self.condition();
            let place = self.since(start);
            condition = Expression { kind: Is::Unknown(Reason::Input, vec![condition, more]), place };
            self.line += 1;
        }
        condition
    }

    /// A block and the line that ends it.
    fn body(&mut self, ends: &[&str], start: Span) -> Result<Vec<Statement>, Fault> {
        let body = self.block(ends)?;
        if self.line >= self.lines().len() {
            return Err(Fault { place: self.place(start), message: "a block without its end" });
        }
        if ends.len() == 1 {
            self.line += 1;
        }
        Ok(body)
    }

    fn conditional(&mut self, start: Span) -> Result<Vec<StatementKind>, Fault> {
        let (mut arms, mut otherwise) = (Vec::new(), Vec::new());
        let mut condition = Some(self.conditions());
        loop {
            let body = self.body(&["ELSEIF", "ELSEIFEXP", "ELSE", "ENDIF"], start)?;
            match condition.take() {
                Some(condition) => arms.push((condition, body)),
                None => otherwise = body,
            }
            let word = self.peek();
            self.at += 1;
            if word.is_some_and(|word| word.is("ELSE")) {
                self.line += 1;
            } else if word.is_some_and(|word| word.is("ENDIF")) {
                self.line += 1;
                return Ok(vec![StatementKind::If { arms, otherwise }]);
            } else {
                condition = Some(self.conditions());
            }
        }
    }

    /// `FOR I000=1 TO 10 STEP 2` or `FOR I000 START= 1 TO 10` … `NEXT I000`
    fn counted(&mut self, start: Span) -> Result<Option<Vec<StatementKind>>, Fault> {
        let target = self.target();
        let known = match target {
            Some(Target::Variable(kind, slot)) if self.take("START") | self.take("=") => {
                self.take("=");
                let from = self.expression();
                let to = if self.take("TO") { self.expression() } else { None };
                let step = if self.take("STEP") {
                    self.take("=");
                    self.expression()
                } else {
                    Some(Expression::constant(1.0))
                };
                match (from, to, step) {
                    (Some(from), Some(to), Some(step)) => Some((kind, slot, from, to, step)),
                    _ => None,
                }
            }
            _ => None,
        };
        let rest = self.rest(Reason::Computed);
        self.line += 1;
        let mut body = self.body(&["NEXT"], start)?;
        let place = self.place(start);
        let (slot, from, condition, next) = match known {
            Some((kind, slot, from, to, step)) => {
                let read = || Expression { kind: Is::Read(slot), place };
                // Which way it counts is known of a number only.
                let upwards = match &step.kind {
                    Is::Number(by, _) | Is::Constant(by) => Some(*by > 0.0),
                    _ => None,
                };
                let condition = match upwards {
                    Some(upwards) => {
                        let operator = if upwards { Binary::AtMost } else { Binary::AtLeast };
                        Is::Binary(operator, Box::new([read(), to]))
                    }
                    None => Is::Unknown(Reason::Computed, vec![to]),
                };
                let next = Is::Binary(Binary::Add, Box::new([read(), step]));
                let next = self.held(kind, Expression { kind: next, place });
                (slot, self.held(kind, from), Expression { kind: condition, place }, next)
            }
            None => {
                let condition = Expression { kind: Is::Unknown(Reason::Computed, vec![rest]), place };
                let body = StatementKind::Loop { condition: Some(condition), body };
                self.program.not_understood.push(place);
                let opaque = StatementKind::Opaque { writes: None, reads: Vec::new(), reason: Reason::NotUnderstood };
                return Ok(Some(vec![opaque, body]));
            }
        };
        let assign = |value| StatementKind::Assign { slot, path: Vec::new(), value };
        body.push(Statement { kind: assign(next), place });
        Ok(Some(vec![assign(from), StatementKind::Loop { condition: Some(condition), body }]))
    }

    fn switch(&mut self, start: Span) -> Result<Vec<StatementKind>, Fault> {
        let of = self.expression().unwrap_or_else(|| self.rest(Reason::Computed));
        self.line += 1;
        // Nothing stands before the first case.
        let mut body = self.body(&["CASE", "DEFAULT", "ENDSWITCH"], start)?;
        let (mut arms, mut otherwise) = (Vec::new(), Vec::new());
        loop {
            let word = self.peek();
            self.at += 1;
            if word.is_some_and(|word| word.is("ENDSWITCH")) {
                self.line += 1;
                let kind = StatementKind::If { arms, otherwise };
                let place = self.place(start);
                body.push(Statement { kind, place });
                return Ok(body.into_iter().map(|statement| statement.kind).collect());
            }
            let case = word.is_some_and(|word| word.is("CASE")).then(|| {
                let place = self.since(start);
                match self.expression() {
                    Some(value) if self.at >= self.code.len() => {
                        Expression { kind: Is::Binary(Binary::Equal, Box::new([of.clone(), value])), place }
                    }
                    _ => Expression { kind: Is::Unknown(Reason::Computed, vec![of.clone()]), place },
                }
            });
            self.line += 1;
            let inner = self.body(&["CASE", "DEFAULT", "ENDSWITCH"], start)?;
            match case {
                Some(condition) => arms.push((condition, inner)),
                None => otherwise = inner,
            }
        }
    }

    /// The labels of the name that comes next: of several, it is not known which one is found first.
    fn labels_named(&mut self) -> Vec<String> {
        let name = self.name();
        let count = self.labels.get(&name).copied().unwrap_or(0);
        (0..count.max(1)).map(|at| format!("{name} {at}")).collect()
    }

    fn jump(&mut self, start: Span) -> Option<Vec<StatementKind>> {
        let places: Vec<String> = if self.take("*") {
            self.labels_named()
        } else if self.next_is("LABEL") {
            while self.peek().is_some_and(|lexeme| !lexeme.text.starts_with(b"IF")) {
                self.at += 1;
            }
            // To any of them, or to none.
            self.labels.iter().flat_map(|(name, count)| (0..*count).map(move |at| format!("{name} {at}"))).collect()
        } else {
            // Another job, which does not come back here.
            let mut kinds = self.call(start)?;
            kinds.push(StatementKind::Return(None));
            return self.perhaps(kinds, start);
        };
        let unknown = |place| Expression { kind: Is::Unknown(Reason::Input, Vec::new()), place };
        let place = self.since(start);
        let last = places.len().saturating_sub(1);
        let jumps = places
            .into_iter()
            .enumerate()
            .map(|(at, to)| StatementKind::Jump { to: to.into(), condition: (at < last).then(|| unknown(place)) });
        self.perhaps(jumps.collect(), start)
    }

    /// `JOB:NAME`, with its arguments.
    fn call(&mut self, start: Span) -> Option<Vec<StatementKind>> {
        let name = if self.take("JOB") {
            if !self.take(":") {
                return None;
            }
            self.name()
        } else {
            let from = self.at;
            while self.peek().is_some_and(|lexeme| !lexeme.text.starts_with(b"IF")) {
                self.at += 1;
            }
            self.code[from..self.at].iter().map(|lexeme| String::from_utf8_lossy(lexeme.text)).collect()
        };
        // `ARGF"1;2"`, `(1, 2)`, `ARGFB001` are values; with another user frame the job runs elsewhere.
        let from = self.at;
        let arguments: Vec<Argument> =
            self.named(true).into_iter().map(|value| Argument { name: None, value }).collect();
        let elsewhere = self.code[from..self.at].iter().any(|lexeme| lexeme.is("UF"));
        let place = self.since(start);
        let call = match self.jobs.get(name.as_bytes()).map(Vec::as_slice) {
            Some(&[one]) => {
                self.called.insert(one);
                let call = Is::Call(Callee::Function(one), arguments);
                StatementKind::Evaluate(Expression { kind: call, place })
            }
            several => {
                let several = several.unwrap_or_default().to_vec();
                self.called.extend(several);
                self.foreign(&name, arguments, start)
            }
        };
        // What is in force afterwards is not followed either.
        let value = Expression { kind: Is::Unknown(Reason::Frame, Vec::new()), place };
        let moved = StatementKind::Assign { slot: Switch::Frame.slot(), path: Vec::new(), value };
        Some(elsewhere.then_some(moved).into_iter().chain([call]).collect())
    }

    /// A call of something that no file has.
    fn foreign(&mut self, name: &str, arguments: Vec<Argument>, start: Span) -> StatementKind {
        let place = self.since(start);
        if self.foreign.insert(name.to_owned()) {
            self.program.foreign.push((name.into(), place));
        }
        StatementKind::Evaluate(Expression { kind: Is::Call(Callee::Foreign, arguments), place })
    }

    /// Every variable of a kind, of this job or of all.
    fn all(&self, local: bool, kind: &[u8]) -> Vec<Slot> {
        let own = self.locals.iter().filter(|((known, _), _)| local && *known == kind).map(|(_, at)| Slot::Local(*at));
        let others = self.globals.iter().filter(|((known, _), _)| !local && *known == kind).map(|(_, slot)| *slot);
        own.chain(others).collect()
    }

    /// `LP[`: whether a variable that an index chooses is a job's own, and its kind.
    fn chosen(&self, lexeme: Lexeme<'_>) -> Option<(bool, &'static [u8])> {
        let (local, word) = match lexeme.text {
            [b'L', rest @ ..] if kind_of(rest).is_some() => (true, rest),
            word => (false, word),
        };
        let kind = kind_of(word)?;
        self.code.get(self.at + 1).filter(|next| next.is("[")).map(|_| (local, kind))
    }

    /// What an instruction gives a value to.
    fn target(&mut self) -> Option<Target> {
        let lexeme = self.peek().filter(|lexeme| lexeme.kind == Kind::Name)?;
        if let Some((local, kind, number)) = variable(lexeme.text) {
            self.at += 1;
            let slot = self.slot(local, kind, number);
            self.written.insert(slot);
            return Some(Target::Variable(kind_of(kind)?, slot));
        }
        let (local, kind) = self.chosen(lexeme)?;
        self.at += 2;
        let index = self.expression()?;
        if !self.take("]") {
            return None;
        }
        let slots = self.all(local, kind);
        self.written.extend(&slots);
        Some(Target::Any(slots, index))
    }

    fn slot(&mut self, local: bool, kind: &'a [u8], number: u32) -> Slot {
        if !local {
            return self.globals.get(&(kind, number)).copied().unwrap_or(Slot::Global(0));
        }
        let next = self.locals.len() as u32;
        Slot::Local(*self.locals.entry((kind, number)).or_insert(next))
    }

    /// A value as a variable of a kind holds it: whole numbers, or it is not known how they are rounded.
    fn held(&self, kind: &[u8], value: Expression) -> Expression {
        if !matches!(kind, b"B" | b"I" | b"D") {
            return value;
        }
        let place = value.place;
        let arguments = vec![Argument { name: None, value }];
        Expression { kind: Is::Call(Callee::Builtin(builtin::WHOLE), arguments), place }
    }

    /// `SET target value` and its like.
    fn set(&mut self, of: impl FnOnce(Expression, Expression) -> Expression) -> Option<Vec<StatementKind>> {
        let start = self.here();
        // Outputs and flags are read at run time only.
        let outputs = [&b"OT"[..], b"OG", b"FL", b"MREG", b"TF"];
        if self.peek().is_some_and(|lexeme| outputs.iter().any(|word| lexeme.text.starts_with(word))) {
            return Some(vec![StatementKind::Evaluate(self.rest(Reason::Input))]);
        }
        let target = self.target()?;
        let element = self.next_is("(") && matches!(target, Target::Variable(b"P" | b"BP" | b"EX", _));
        self.take("EXPRESS");
        let place = self.since(start);
        let value = if self.peek().is_none() { None } else { self.expression() };
        match target {
            Target::Variable(kind, slot) if !element && self.at >= self.code.len() => {
                let old = Expression { kind: Is::Read(slot), place };
                let value = of(old, value.unwrap_or_else(|| Expression::constant(0.0)));
                Some(vec![StatementKind::Assign { slot, path: Vec::new(), value: self.held(kind, value) }])
            }
            target => {
                let reads = value.into_iter().chain([self.rest(Reason::Computed)]).collect();
                Some(vec![target.lost(reads, Reason::Computed)])
            }
        }
    }

    /// `SETE P012 (3) 2000`: micrometres and ten-thousandths of a degree.
    fn set_element(&mut self) -> Option<Vec<StatementKind>> {
        let target = self.target()?;
        let element = self.element();
        let value = self.expression();
        match (target, element, value) {
            (Target::Variable(b"P", slot), Some(at), Some(value)) if self.at >= self.code.len() => {
                let literal = matches!(value.kind, Is::Number(..));
                let value = if literal { value } else { self.held(b"D", value) };
                let value = value.with(Binary::Multiply, unit(at));
                Some(vec![StatementKind::Assign { slot, path: vec![Expression::constant(f64::from(at))], value }])
            }
            (target, _, value) => {
                let reads = value.into_iter().chain([self.rest(Reason::Computed)]).collect();
                Some(vec![target.lost(reads, Reason::Computed)])
            }
        }
    }

    /// `(3)`: an element of a position, from 0.
    fn element(&mut self) -> Option<u8> {
        let [open, number, close, ..] = self.code.get(self.at..)? else { return None };
        let digits = std::str::from_utf8(number.text).ok()?;
        let at = digits.parse::<u8>().ok().filter(|at| (1..=6).contains(at));
        let at = at.filter(|_| open.is("(") && number.kind == Kind::Number && close.is(")"))?;
        self.at += 3;
        Some(at - 1)
    }

    /// `GETE D000 P012 (3)`
    fn get_element(&mut self, start: Span) -> Option<Vec<StatementKind>> {
        let target = self.target()?;
        let from = self.operand()?;
        let (target, value) = match (target, self.element()) {
            (Target::Variable(kind, slot), Some(at)) if self.at >= self.code.len() => {
                let item = Is::Item(Box::new([from, Expression::constant(f64::from(at))]));
                let item = self.expression_at(item, start);
                let value = item.with(Binary::Multiply, 1.0 / unit(at));
                return Some(vec![StatementKind::Assign { slot, path: Vec::new(), value: self.held(kind, value) }]);
            }
            (target, _) => (target, from),
        };
        let reads = vec![value, self.rest(Reason::Computed)];
        Some(vec![target.lost(reads, Reason::Computed)])
    }

    /// `CLEAR B003 10`
    fn clear(&mut self) -> Option<Vec<StatementKind>> {
        let (local, kind, _) = self.peek().and_then(|lexeme| variable(lexeme.text))?;
        let slots = self.all(local, kind);
        self.target()?;
        self.written.extend(&slots);
        let reads = vec![self.rest(Reason::Computed)];
        Some(vec![StatementKind::Opaque { writes: Some(slots), reads, reason: Reason::Computed }])
    }

    /// `SFTON P012 UF#(1)`
    fn shift(&mut self, start: Span) -> Option<Vec<StatementKind>> {
        let by = self.operand()?;
        let base = self.base();
        let frame: String = match self.peek() {
            None => base,
            Some(lexeme) if lexeme.is("BF") => base,
            Some(lexeme) if lexeme.is("RF") => header::ROBOT.to_owned(),
            Some(lexeme) if lexeme.is("UF") => {
                let number = self.code.get(self.at + 3).filter(|number| number.kind == Kind::Number);
                number.map_or(String::new(), |number| header::user(&text(number.text)))
            }
            _ => String::new(),
        };
        self.at = self.code.len();
        let named = Expression { kind: Is::Text(frame.into_bytes().into()), place: by.place };
        let arguments = [by, named].map(|value| Argument { name: None, value });
        let call = Is::Call(Callee::Builtin(builtin::SHIFT), arguments.into());
        Some(vec![StatementKind::Evaluate(self.expression_at(call, start))])
    }

    /// What the base coordinates of the job are called.
    fn base(&self) -> String {
        let has_base_axis = self.job.as_ref().is_some_and(|job| job.has_base_axis);
        if has_base_axis { header::BASE.to_owned() } else { header::ROBOT.to_owned() }
    }

    fn instruction(&mut self, does: Does, word: &[u8], start: Span) -> Vec<StatementKind> {
        let calls = |number: u16, parser: &Self| {
            let call = Is::Call(Callee::Builtin(number), Vec::new());
            StatementKind::Evaluate(parser.expression_at(call, start))
        };
        match does {
            Does::Nothing => vec![StatementKind::Evaluate(self.rest(Reason::Input))],
            Does::Asks | Does::Computes => {
                let reason = if does == Does::Asks { Reason::Input } else { Reason::Computed };
                let target = self.target();
                let mut reads = vec![self.rest(reason)];
                if word == b"GETPOS" {
                    reads.extend(self.job.iter().flat_map(|job| job.positions.values().cloned()));
                }
                vec![match target {
                    Some(target) => target.lost(reads, reason),
                    None => StatementKind::Opaque { writes: None, reads, reason },
                }]
            }
            Does::Frame | Does::Tool => {
                *(if does == Does::Frame { &mut self.frame_changes } else { &mut self.tool_changes }) = true;
                let switch = if does == Does::Frame { Switch::Frame } else { Switch::Tool };
                let reason = if does == Does::Frame { Reason::Frame } else { Reason::Tool };
                let reads = vec![self.rest(reason)];
                vec![StatementKind::Opaque { writes: Some(vec![switch.slot()]), reads, reason }]
            }
            Does::Shifts | Does::Unshifts => {
                let number = match word {
                    b"WVON" => builtin::WEAVE,
                    b"WVOF" => builtin::UNWEAVE,
                    b"SFTOF" | b"SFTOF3D" => builtin::UNSHIFT,
                    _ => builtin::SHIFT,
                };
                let call = calls(number, self);
                vec![StatementKind::Evaluate(self.rest(Reason::Input)), call]
            }
        }
    }

    /// `MOVL C00001 V=100.0 PL=0`
    fn motion(&mut self, word: &[u8], start: Span) -> Option<Vec<StatementKind>> {
        let mut path = motion_path(word)?;
        let unknown = |parser: &Self, reason| parser.expression_at(Is::Unknown(reason, Vec::new()), start);
        let to = self.position().unwrap_or_else(|| unknown(self, Reason::NotUnderstood));
        let (mut speed, mut blend, mut others, mut traps) = (None, None, Vec::new(), Vec::new());
        while let Some(tag) = self.peek() {
            self.at += 1;
            let value = if self.take("=") { self.operand() } else { None };
            match (tag.text, value) {
                (b"V", Some(value)) => {
                    // A variable counts tenths of a millimetre a second.
                    let literal = matches!(value.kind, Is::Number(..));
                    speed = Some(if literal { value } else { value.with(Binary::Multiply, 0.1) });
                }
                (b"PL", Some(value)) => {
                    // How far from its end a motion is left at a level is a parameter of the controller.
                    let stops = matches!(value.kind, Is::Number(level, _) if level == 0.0);
                    others.push(value);
                    blend = stops.then(|| Expression::constant(0.0));
                }
                (b"CR", Some(value)) => blend = Some(value),
                (
                    b"VJ" | b"VR" | b"VE" | b"VMAX" | b"ACC" | b"DEC" | b"SPDL" | b"PD" | b"MT" | b"COORD" | b"T"
                    | b"DIS",
                    Some(value),
                ) => others.push(value),
                (b"NWAIT" | b"ENWAIT" | b"CONT" | b"FPT", None) => {}
                (b"TRAP", None) if self.take("*") => traps = self.labels_named(),
                (word, value) => {
                    path = Path::Unknown(match word {
                        _ if path == Path::Unknown(Reason::Relative) => Reason::Relative,
                        b"UNTIL" | b"SRCH" | b"ASRCH" | b"HPSRCH" | b"NSRCH" => Reason::Follows,
                        word if word == b"+" || is_other_axis(word) => Reason::OtherAxes,
                        _ => Reason::NotUnderstood,
                    });
                    others.extend(value);
                    others.extend(self.named(false));
                }
            }
        }
        let blend = Some(blend.unwrap_or_else(|| unknown(self, Reason::Computed)));
        let mut motion = Motion { path, via: None, to: Some(to), speed, blend, others };
        let is_whole = self.circle(word == b"MOVC", &mut motion);
        let jumps = traps
            .into_iter()
            .map(|to| StatementKind::Jump { to: to.into(), condition: Some(unknown(self, Reason::Input)) });
        let moves = is_whole.then(|| StatementKind::Move(Box::new(motion)));
        Some(moves.into_iter().chain(jumps).collect())
    }

    /// Of three points in a row the first is gone to on a line; the second is on the way to the third, and no motion of its own.
    fn circle(&mut self, is_point: bool, motion: &mut Motion) -> bool {
        if !is_point {
            self.circle = (0, None);
            return true;
        }
        if !self.has_plain_circles {
            if motion.path == Path::Circular {
                motion.path = Path::Other(Reason::Circles);
            }
            return true;
        }
        self.circle.0 = self.circle.0 % 3 + 1;
        let is_known = motion.path == Path::Circular;
        match (self.circle.0, self.circle.1.take()) {
            (1, _) if is_known => motion.path = Path::Linear,
            (2, _) if is_known => {
                self.circle.1 = motion.to.take();
                return false;
            }
            (3, Some(via)) if is_known => motion.via = Some(via),
            (_, via) => {
                motion.others.extend(via);
                if is_known {
                    motion.path = Path::Other(Reason::Circles);
                }
            }
        }
        true
    }

    /// A position: `C00001`, `P012`, `P[I000]`.
    fn position(&mut self) -> Option<Expression> {
        let lexeme = self.peek().filter(|lexeme| lexeme.kind == Kind::Name)?;
        let number =
            lexeme.text.strip_prefix(b"C").and_then(|digits| std::str::from_utf8(digits).ok()?.parse::<u32>().ok());
        if let Some(number) = number {
            self.at += 1;
            let known = self.job.as_ref().and_then(|job| job.positions.get(&number).cloned());
            let unset = || self.expression_at(Is::Unknown(Reason::Unset, Vec::new()), lexeme.span);
            return Some(known.unwrap_or_else(unset));
        }
        let kind = variable(lexeme.text).map(|(_, kind, _)| kind).or(self.chosen(lexeme).map(|(_, kind)| kind));
        let is_position = kind == Some(b"P");
        if is_position { self.operand() } else { None }
    }

    /// Conditions joined by `AND` and `OR`; what is not understood is not known.
    fn condition(&mut self) -> Expression {
        let (start, from) = (self.here(), self.at);
        if let Some(condition) = self.joined(0).filter(|_| self.at >= self.code.len()) {
            return condition;
        }
        self.at = from;
        let rest = self.rest(Reason::Input);
        Expression { kind: rest.kind, place: self.since(start) }
    }

    fn joined(&mut self, level: usize) -> Option<Expression> {
        const LEVELS: [(&str, Binary); 2] = [("OR", Binary::Or), ("AND", Binary::And)];
        let Some((word, operator)) = LEVELS.get(level) else { return self.compared() };
        let start = self.here();
        let mut left = self.joined(level + 1)?;
        while self.take(word) {
            let right = self.joined(level + 1)?;
            left = self.expression_at(Is::Binary(*operator, Box::new([left, right])), start);
        }
        Some(left)
    }

    fn compared(&mut self) -> Option<Expression> {
        let start = self.here();
        let from = self.at;
        let left = self.expression();
        let operator = OPERATORS.iter().find(|(sign, _)| self.next_is(sign));
        if let (Some(left), Some((_, operator))) = (left, operator) {
            self.at += 1;
            let right = self.expression()?;
            return Some(self.expression_at(Is::Binary(*operator, Box::new([left, right])), start));
        }
        self.at = from;
        self.depth += 1;
        let inner = if self.take("(") && self.depth < 2 * DEEPEST { self.joined(0) } else { None };
        self.depth -= 1;
        let inner = inner?;
        self.take(")").then_some(inner)
    }

    fn expression(&mut self) -> Option<Expression> {
        self.sum(0)
    }

    fn sum(&mut self, level: usize) -> Option<Expression> {
        const LEVELS: [&[(&str, Binary)]; 2] =
            [&[("+", Binary::Add), ("-", Binary::Subtract)], &[("*", Binary::Multiply), ("/", Binary::Divide)]];
        let Some(operators) = LEVELS.get(level) else { return self.operand() };
        let start = self.here();
        let mut left = self.sum(level + 1)?;
        while let Some((_, operator)) = operators.iter().find(|(sign, _)| self.next_is(sign)) {
            self.at += 1;
            let right = self.sum(level + 1)?;
            left = self.expression_at(Is::Binary(*operator, Box::new([left, right])), start);
        }
        Some(left)
    }

    fn operand(&mut self) -> Option<Expression> {
        self.depth += 1;
        let operand = if self.depth < 2 * DEEPEST { self.shallow_operand() } else { None };
        self.depth -= 1;
        operand
    }

    fn shallow_operand(&mut self) -> Option<Expression> {
        let lexeme = self.peek()?;
        let start = lexeme.span;
        match lexeme.kind {
            Kind::Number => {
                self.at += 1;
                let place = self.place(start);
                Some(self.program.literal(lexeme.text, place))
            }
            Kind::Sign if lexeme.text == b"-" => {
                let next = self.code.get(self.at + 1).copied();
                self.at += 1;
                if let Some(next) = next.filter(|next| next.kind == Kind::Number && next.span.start == start.end) {
                    self.at += 1;
                    let place = self.place(start.to(next.span));
                    return Some(self.program.literal(&[b"-", next.text].concat(), place));
                }
                let operand = self.operand()?;
                Some(self.expression_at(Is::Unary(Unary::Negate, Box::new(operand)), start))
            }
            Kind::Sign if lexeme.text == b"(" => {
                self.at += 1;
                let inner = self.expression()?;
                self.take(")").then_some(inner)
            }
            Kind::Text => {
                self.at += 1;
                Some(self.expression_at(Is::Text(lexeme.text.into()), start))
            }
            Kind::Name => self.word(lexeme),
            Kind::Sign | Kind::Line | Kind::Mark | Kind::Other => None,
        }
    }

    fn word(&mut self, lexeme: Lexeme<'a>) -> Option<Expression> {
        let start = lexeme.span;
        if let Some((local, kind, number)) = variable(lexeme.text) {
            self.at += 1;
            let slot = self.slot(local, kind, number);
            return Some(self.expression_at(Is::Read(slot), start));
        }
        if let Some(position) = self.job.as_ref().and_then(|job| {
            let number = std::str::from_utf8(lexeme.text.strip_prefix(b"C")?).ok()?.parse::<u32>().ok()?;
            job.positions.get(&number).cloned()
        }) {
            self.at += 1;
            return Some(position);
        }
        if let Some((local, kind)) = self.chosen(lexeme) {
            // Which one is not known: it may be any.
            self.at += 2;
            let index = self.expression()?;
            if !self.take("]") {
                return None;
            }
            let any = self.all(local, kind).into_iter().map(|slot| self.expression_at(Is::Read(slot), start));
            let parts = any.chain([index]).collect();
            return Some(self.expression_at(Is::Unknown(Reason::Computed, parts), start));
        }
        self.at += 1;
        if self.take("#") {
            // `IN#(1)`: a signal, by its number.
            let number = if self.next_is("(") { self.operand() } else { None };
            return Some(self.expression_at(Is::Unknown(Reason::Input, number.into_iter().collect()), start));
        }
        match lexeme.text {
            b"ON" => Some(self.expression_at(Is::Truth(true), start)),
            b"OFF" => Some(self.expression_at(Is::Truth(false), start)),
            _ if lexeme.text[0] == b'$' || lexeme.text.starts_with(b"FL") || lexeme.text.starts_with(b"TM") => {
                Some(self.expression_at(Is::Unknown(Reason::Input, Vec::new()), start))
            }
            _ => {
                self.at -= 1;
                None
            }
        }
    }
}

/// What gets a value.
enum Target {
    /// One variable, with its kind.
    Variable(&'static [u8], Slot),
    /// One of these, by an index.
    Any(Vec<Slot>, Expression),
}

impl Target {
    /// It gets a value that is not known.
    fn lost(self, mut reads: Vec<Expression>, reason: Reason) -> StatementKind {
        let slots = match self {
            Self::Variable(_, slot) => vec![slot],
            Self::Any(slots, index) => {
                reads.push(index);
                slots
            }
        };
        StatementKind::Opaque { writes: Some(slots), reads, reason }
    }
}

/// `BC00001`, `EC00001`, `BP001`, `EX001`, `RB1`: axes that the arm does not have.
fn is_other_axis(word: &[u8]) -> bool {
    let word = word.strip_prefix(b"L").unwrap_or(word);
    [&b"BC"[..], b"EC", b"BP", b"EX", b"RB", b"ST"]
        .iter()
        .any(|kind| word.strip_prefix(*kind).is_some_and(|rest| rest.is_empty() || rest.iter().all(u8::is_ascii_digit)))
}

const OPERATORS: [(&str, Binary); 7] = [
    ("=", Binary::Equal),
    ("==", Binary::Equal),
    ("<>", Binary::NotEqual),
    ("<=", Binary::AtMost),
    (">=", Binary::AtLeast),
    ("<", Binary::Less),
    (">", Binary::Greater),
];

/// Millimetres or degrees of a count in an element of a position.
fn unit(element: u8) -> f64 {
    if element < 3 { 1e-3 } else { 1e-4 }
}

pub(super) fn text(bytes: &[u8]) -> Arc<str> {
    String::from_utf8_lossy(bytes).into()
}

/// What a position names, shared by all that name the same.
pub(super) fn given(tool: String, frame: String) -> Arc<Given> {
    Arc::new(Given { tool: tool.into(), frame: frame.into() })
}
