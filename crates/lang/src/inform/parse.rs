//! Lowers jobs to the intermediate representation.

use super::builtin;
use super::expression::variable;
use super::header::{self, Job};
use super::lex::Line;
use super::motion::{has_plain_circles, motion_path};
use super::parser::{CONDITION, JOB_START, Known, Parser};
use super::words::{self, Does};
use crate::Span;
use crate::cursor::{declare, global_names, text};
use crate::ir::{
    Binary, Callee, Expression, ExpressionKind as Is, Fault, Function, FunctionId, Program, Slot, SourceSpan,
    Statement, StatementKind,
};
use crate::reason::Reason;
use std::collections::BTreeMap;

/// Reads jobs; `sources` beyond the first `written` are only called.
///
/// # Errors
/// A file is no job, a job has no name, or its blocks do not close.
///
/// ```
/// let job = b"/JOB\n//NAME A\n//POS\n///NPOS 1,0,0,0,0,0\n///TOOL 1\n///USER 2\n///POSTYPE USER\n///RECTAN\n\
///     C00000=10.000,20.000,-1.500,180.0000,0.0000,0.0000\n//INST\nNOP\nMOVL C00000 V=25.0 PL=0\nEND\n";
/// let program = deflex_lang::inform::read(&[job], 1).unwrap();
/// let outcome = deflex_lang::run::run(&program, &deflex_lang::inform::Inform).unwrap();
/// let pose = outcome.motions[0].to.pose().unwrap();
/// assert_eq!(&*pose.given.as_ref().unwrap().frame, "USER 2");
/// assert_eq!(pose.pose().translation.z, -1.5);
/// ```
pub fn read(sources: &[&[u8]], written: usize) -> Result<Program, Fault> {
    let mut program = Program::default();
    program.functions.resize_with(sources.len(), Function::default);
    let (mut jobs, mut names, mut loaded) = (Vec::new(), BTreeMap::<&[u8], Vec<FunctionId>>::new(), BTreeMap::new());
    for (source, bytes) in sources.iter().enumerate() {
        for job in header::jobs(bytes, source as u16, &mut program, &mut loaded)? {
            let id = FunctionId(program.functions.len() as u32);
            program.functions.push(Function { name: text(job.name), place: job.place, ..Function::default() });
            names.entry(job.name).or_default().push(id);
            jobs.push((id, job));
        }
    }
    let mut globals = BTreeMap::new();
    for lexeme in jobs.iter().flat_map(|(_, job)| &job.lines).flat_map(Line::code) {
        if let Some(variable) = variable(lexeme.text).filter(|variable| !variable.is_local) {
            variable.number.into_iter().for_each(|number| declare(&mut globals, (variable.kind, number)));
        }
    }
    loaded.keys().for_each(|number| declare(&mut globals, (b"P", *number)));
    program.globals = global_names(&globals, |(kind, number)| format!("{}{number}", text(kind)).into());
    let has_plain_circles = jobs.iter().all(|(_, job)| has_plain_circles(&job.lines));
    let own = Known { jobs: names, globals, loaded, has_plain_circles, ..Known::default() };
    let mut parser = Parser::new(own, program);
    for (id, job) in &jobs {
        parser.job(*id, job)?;
    }
    let begun = jobs.iter().filter(|(_, job)| usize::from(job.place.source) < written).map(|(id, _)| *id);
    Ok(parser.program(&begun.collect::<Vec<_>>()))
}

impl<'a, 'n> Parser<'a, 'n> {
    fn job(&mut self, id: FunctionId, job: &'n Job<'a>) -> Result<(), Fault> {
        (self.own.job, self.own.lines) = (Some(job), &job.lines);
        (self.source, self.depth) = (job.place.source, 0);
        self.own.locals.clear();
        self.own.labels.clear();
        self.own.passed.clear();
        self.own.circle = (0, None);
        self.survey();
        self.own.restarts = false;
        let (mut body, locals) = (self.block(&[])?, self.own.locals.len() as u32);
        if self.own.restarts {
            body.insert(0, Statement { kind: StatementKind::Label(JOB_START.into()), place: job.place });
        }
        let function = &mut self.program.functions[id.0 as usize];
        (function.body, function.locals) = (body, locals);
        Ok(())
    }

    fn program(mut self, begun: &[FunctionId]) -> Program {
        // Variables keep their values from run to run: what is written anywhere may hold any of it when a run begins.
        let everything = if self.program.foreign.is_empty() { None } else { Some(Reason::Foreign) };
        let everything = everything.or((!self.program.not_understood.is_empty()).then_some(Reason::NotUnderstood));
        let mut first = Vec::new();
        let mut assign = |slot: Slot, value: Expression| {
            let place = value.place;
            first.push(Statement { kind: StatementKind::assign(slot, value), place });
        };
        let mut loaded = std::mem::take(&mut self.own.loaded);
        // A variable has the value that comes with the job until it is written.
        let begins =
            loaded.iter().filter_map(|(number, values)| Some((*self.own.globals.get(&(&b"P"[..], *number))?, values)));
        let left = self.program.left(begins.flat_map(|(slot, values)| values.iter().map(move |value| (slot, value))));
        for ((kind, number), slot) in &self.own.globals {
            let mut values = if *kind == b"P" { loaded.remove(number).unwrap_or_default() } else { Vec::new() };
            let is_written = values.len() > 1 || self.own.written.contains(slot);
            let reason = is_written.then_some(Reason::Variable).or(everything.filter(|_| *kind == b"P"));
            if let Some(reason) = reason {
                let tokens = left.get(slot).into_iter().flatten();
                values.extend(
                    tokens.map(|token| Expression { kind: Is::Number(0.0, *token), place: SourceSpan::default() }),
                );
                assign(*slot, builtin::left(reason, values));
            } else if let Some(value) = values.pop() {
                assign(*slot, value);
            }
        }
        for (slot, reason) in &self.own.defined {
            assign(*slot, Expression::unknown(*reason, Vec::new(), SourceSpan::default()));
        }
        self.program.functions[0].body = first;
        self.program.variables_outlive_runs = true;
        let started = self.program.started(begun, &self.called);
        self.program.entries = [FunctionId(0)].into_iter().chain(started).collect();
        self.program
    }

    /// Finds the local variables of the job, and how often each label occurs in it.
    fn survey(&mut self) {
        for line in 0..self.own.lines.len() {
            self.own.line = line;
            if !self.open() {
                continue;
            }
            for variable in self.lexemes.iter().filter_map(|lexeme| variable(lexeme.text)) {
                if variable.is_local && variable.number.is_some() {
                    self.slots(variable);
                }
            }
            if self.take("*") {
                let name = self.name();
                *self.own.labels.entry(name).or_default() += 1;
            }
        }
        self.own.line = 0;
    }

    /// Reads statements up to an instruction that ends their block. That instruction is not read.
    pub(super) fn block(&mut self, ends: &[&str]) -> Result<Vec<Statement>, Fault> {
        let (mut all, place) = (Vec::new(), self.since(self.here()));
        self.begin_block(place)?;
        while let Some(line) = self.own.lines.get(self.own.line) {
            if let Line::Mark(said, span) = line {
                all.push(self.mark(said, *span));
                self.own.line += 1;
                continue;
            }
            self.open();
            if ends.iter().any(|end| self.next_is(end)) {
                break;
            }
            self.statement(&mut all)?;
        }
        self.depth -= 1;
        Ok(all)
    }

    fn statement(&mut self, all: &mut Vec<Statement>) -> Result<(), Fault> {
        let (start, line) = (self.here(), self.own.line);
        let known = self.known_statement(start)?;
        let kinds = match known.filter(|_| self.own.line != line || self.is_over()) {
            Some(kinds) => kinds,
            None => {
                self.own.line = line;
                self.open();
                let reads = vec![self.rest(Reason::NotUnderstood)];
                vec![self.not_understood(reads, self.since(start))]
            }
        };
        // A block stands where its first instruction does.
        let is_block = self.own.line != line;
        let place = if is_block { self.place(start) } else { self.since(start) };
        self.own.line += usize::from(!is_block);
        all.extend(kinds.into_iter().map(|kind| Statement { kind, place }));
        Ok(())
    }

    /// The next statement; `None` if it is not understood. Blocks are read to their last line.
    fn known_statement(&mut self, start: Span) -> Result<Option<Vec<StatementKind>>, Fault> {
        let Some(word) = self.peek() else { return Ok(Some(Vec::new())) };
        self.at += 1;
        if word.is("*") {
            let name = self.name();
            let count = self.own.passed.entry(name.clone()).or_default();
            *count += 1;
            return Ok(Some(vec![StatementKind::Label(format!("{name} {}", *count - 1).into())]));
        }
        Ok(match word.text {
            b"IFTHEN" | b"IFTHENEXP" => Some(self.conditional(start)?),
            b"WHILE" | b"WHILEEXP" => Some(self.repeated(start)?),
            b"FOR" => Some(self.counted(start)?),
            b"SWITCH" => Some(self.switch(start)?),
            b"END" => Some(vec![StatementKind::Return(None)]),
            b"RET" => {
                // The caller may use what it returns in any way: only the run knows how.
                let given = Is::Unknown(Reason::Input, self.named(&CONDITION));
                let given = StatementKind::Evaluate(self.expression_at(given, start));
                self.perhaps(vec![given, StatementKind::Return(None)], start)
            }
            b"ABORT" => self.perhaps(vec![StatementKind::Halt], start),
            b"JUMP" => self.jump(start),
            b"CALL" => self.call(start).and_then(|call| self.perhaps(call, start)),
            b"PSTART" => {
                let call = self.call(start);
                if let Some([StatementKind::Evaluate(Expression { kind: Is::Call(Callee::Function(id), _), .. }), ..]) =
                    call.as_deref()
                {
                    self.program.threads.push(*id);
                    Some(Vec::new())
                } else {
                    // It may write any variable at any moment.
                    let all = self.own.globals.values().map(|slot| (*slot, Reason::Thread)).collect();
                    self.program.volatile = all;
                    call
                }
            }
            b"PWAIT" | b"TSYNC" => Some(self.instruction(Does::Nothing, word.text, start)),
            b"WAIT" => {
                // If the variable does not have the value yet, something else changes it.
                let waited_for = self.target();
                let rest = self.rest(Reason::Input);
                Some(vec![match waited_for {
                    Some(variables) => variables.lost([rest], Reason::WaitedFor),
                    None => StatementKind::Evaluate(rest),
                }])
            }
            b"SET" => self.set(|_, value| value),
            b"INC" => self.set(|old, _| old.with(Binary::Add, 1.0)),
            b"DEC" => self.set(|old, _| old.with(Binary::Subtract, 1.0)),
            b"ADD" => self.combine(Binary::Add),
            b"SUB" => self.combine(Binary::Subtract),
            b"MUL" => self.combine(Binary::Multiply),
            b"DIV" => self.combine(Binary::Divide),
            b"SETE" => self.set_element(),
            b"GETE" => self.get_element(start),
            b"CLEAR" => self.clear(),
            b"SFTON" => self.shift(start),
            b"MACRO" | b"MACRO1" | b"MACRO2" => Some(vec![self.macro_call(start)]),
            _ if word.is("+") => None,
            text if motion_path(text).is_some() => self.motion(text, start),
            text => words::find(text).map(|does| self.instruction(does, text, start)),
        })
    }

    /// An instruction that has no rule of its own.
    fn instruction(&mut self, does: Does, word: &[u8], start: Span) -> Vec<StatementKind> {
        match does {
            Does::Nothing => vec![StatementKind::Evaluate(self.rest(Reason::Input))],
            Does::Gives(reason) => {
                let target = self.target();
                let mut reads = vec![self.rest(reason)];
                if word == b"GETPOS" {
                    reads.extend(self.own.job.iter().flat_map(|job| job.positions.values().cloned()));
                }
                vec![match target {
                    Some(target) => target.lost(reads, reason),
                    None => StatementKind::Opaque { writes: None, reads, reason },
                }]
            }
            Does::Defines(switch, reason) => {
                self.own.defined.insert(switch.slot(), reason);
                let reads = vec![self.rest(reason)];
                vec![StatementKind::Opaque { writes: Some(vec![switch.slot()]), reads, reason }]
            }
            Does::Calls(routine) => {
                let call = Expression::builtin(routine, Vec::new(), self.since(start));
                vec![StatementKind::Evaluate(self.rest(Reason::Input)), StatementKind::Evaluate(call)]
            }
        }
    }
}
