//! Lowers lexemes to the intermediate representation.

use super::builtins;
use super::lex::lexemes;
use crate::Span;
use crate::cursor::{Cursor, Level, SUM, declare, global_names, text};
use crate::ir::{
    Argument, Binary, Callee, Expression, ExpressionKind as Is, Fault, Function, FunctionId, Motion, Parameter, Path,
    Program, Slot, SourceSpan, Statement, StatementKind, Unary,
};
use crate::lexeme::{self, Lexeme, LexemeKind};
use crate::reason::Reason;
use std::collections::{BTreeMap, BTreeSet};

/// The names that are found before statements are read.
#[derive(Default)]
struct Names<'a> {
    /// The routines with this name, in the order of the text.
    functions: BTreeMap<&'a [u8], Vec<FunctionId>>,
    /// Routines of context files, which may be declared in place of others (`harmless`).
    context: BTreeSet<FunctionId>,
    /// Each routine by the place of the word that begins it.
    begins: BTreeMap<SourceSpan, FunctionId>,
    globals: BTreeMap<&'a [u8], Slot>,
    /// Names that a routine and an enclosing routine both use.
    unclear: BTreeSet<&'a [u8]>,
}

/// Reads a program; `sources` beyond the first `written` only define routines.
///
/// # Errors
/// The text is not URScript: its blocks do not close, or a line begins an unknown kind of block.
///
/// # Examples
/// ```
/// let program = deflex_lang::urscript::read(&[b"movel(p[0.5, 0.1, 0.2, 0, 3.14, 0], v=0.025)\n"], 1).unwrap();
/// assert_eq!(program.tokens.len(), 7);
/// ```
pub fn read(sources: &[&[u8]], written: usize) -> Result<Program, Fault> {
    let all: Vec<Vec<Lexeme<'_>>> = sources.iter().map(|bytes| lexemes(bytes)).collect();
    let mut unclear = BTreeSet::new();
    loop {
        let names = survey(&all, written, std::mem::take(&mut unclear));
        let mut parser = Parser::of(&names, all.len());
        for (source, lexemes) in all.iter().enumerate() {
            parser.file(source, lexemes)?;
        }
        if parser.own.clashes.is_subset(&names.unclear) {
            return Ok(parser.program(written));
        }
        unclear = names.unclear.union(&parser.own.clashes).copied().collect();
    }
}

/// Finds the routines and the globals.
fn survey<'a>(all: &[Vec<Lexeme<'a>>], written: usize, unclear: BTreeSet<&'a [u8]>) -> Names<'a> {
    let mut names = Names { unclear, ..Names::default() };
    let mut count = all.len() as u32;
    let mut globals: Vec<&[u8]> = names.unclear.iter().copied().collect();
    for (source, lexemes) in all.iter().enumerate() {
        // Blocks that are open, and how many of them are routines.
        let (mut open, mut routines, mut begins): (Vec<bool>, usize, bool) = (Vec::new(), 0, true);
        for (at, lexeme) in lexemes.iter().enumerate() {
            let next = lexemes.get(at + 1).filter(|next| next.kind == LexemeKind::Name);
            let outside = routines == 0;
            if begins && (lexeme.is("def") || lexeme.is("thread") || lexeme.is("sec")) {
                if let Some(name) = next {
                    names.functions.entry(name.text).or_default().push(FunctionId(count));
                }
                names.context.extend((source >= written).then_some(FunctionId(count)));
                names.begins.insert(SourceSpan { source: source as u16, span: lexeme.span }, FunctionId(count));
                count += 1;
                routines += 1;
                open.push(true);
            } else if begins && (lexeme.is("if") || lexeme.is("while")) {
                open.push(false);
            } else if begins && lexeme.is("end") {
                routines -= usize::from(open.pop() == Some(true));
            } else if begins && lexeme.is("global") {
                globals.extend(next.map(|name| name.text));
            } else if begins
                && outside
                && lexeme.kind == LexemeKind::Name
                && lexemes.get(at + 1).is_some_and(|l| l.is("="))
            {
                globals.push(lexeme.text);
            }
            begins = matches!(lexeme.kind, LexemeKind::Line | LexemeKind::Mark) || lexeme.is(":");
        }
    }
    for name in globals {
        declare(&mut names.globals, name);
    }
    names
}

/// The routine that is being read.
#[derive(Default)]
struct Scope<'a> {
    /// Its variables by name.
    locals: BTreeMap<&'a [u8], u32>,
    /// Names without a declaration and a parameter in it.
    free: BTreeSet<&'a [u8]>,
    /// The names without a declaration in the routines inside it.
    inner: BTreeSet<&'a [u8]>,
}

/// A parser of files.
type Parser<'a, 'n> = Cursor<'a, 'n, Known<'a, 'n>>;

/// The state of the parser: all routines, and the one that is being read.
struct Known<'a, 'n> {
    names: &'n Names<'a>,
    /// Routines around the statement, innermost last.
    scopes: Vec<Scope<'a>>,
    /// Names without a declaration that a routine and an enclosing one share.
    clashes: BTreeSet<&'a [u8]>,
    /// Routines of the first source that are inside no other routine.
    outer: Vec<(FunctionId, u16)>,
    threads: BTreeSet<FunctionId>,
}

impl<'a, 'n> Parser<'a, 'n> {
    fn of(names: &'n Names<'a>, files: usize) -> Self {
        let volatile = names.unclear.iter().filter_map(|name| Some((*names.globals.get(name)?, Reason::Scope)));
        let mut program = Program {
            globals: global_names(&names.globals, |name| text(name)),
            volatile: volatile.collect(),
            ..Program::default()
        };
        // The statements of each file that stand in no routine come first.
        program.functions.resize_with(files + names.begins.len(), Function::default);
        let (scopes, clashes) = (Vec::new(), BTreeSet::new());
        let own = Known { names, scopes, clashes, outer: Vec::new(), threads: BTreeSet::new() };
        Cursor::new(own, program)
    }

    fn file(&mut self, source: usize, lexemes: &'n [Lexeme<'a>]) -> Result<(), Fault> {
        (self.lexemes, self.at, self.source) = (lexemes, 0, source as u16);
        self.own.scopes.push(Scope::default());
        let body = self.block()?;
        if let Some(lexeme) = self.lexemes.get(self.at) {
            return Err(self.fault(lexeme.span, "`end`, `else` or `elif` without a block that it belongs to"));
        }
        let scope = self.own.scopes.pop().unwrap_or_default();
        let function = &mut self.program.functions[source];
        (function.body, function.locals) = (body, scope.locals.len() as u32);
        Ok(())
    }

    fn program(mut self, written: usize) -> Program {
        let file = FunctionId(0);
        let is_candidate =
            |(id, source): &&(FunctionId, u16)| usize::from(*source) < written && !self.own.threads.contains(id);
        let candidates: Vec<FunctionId> = self.own.outer.iter().filter(is_candidate).map(|(id, _)| *id).collect();
        let started = self.program.started(&candidates, &self.called);
        self.program.entries = [file].into_iter().chain(started).collect();
        self.program.threads = self.own.threads.into_iter().collect();
        self.program
    }

    fn fault(&self, span: Span, message: &'static str) -> Fault {
        Fault { place: self.place(span), message }
    }

    fn ends(&self) -> bool {
        self.peek().is_none_or(|lexeme| matches!(lexeme.kind, LexemeKind::Line | LexemeKind::Mark))
    }

    /// Reads statements up to the word that ends their block.
    fn block(&mut self) -> Result<Vec<Statement>, Fault> {
        let mut all = Vec::new();
        let place = self.place(self.here());
        self.begin_block(place)?;
        while let Some(lexeme) = self.peek() {
            match lexeme.kind {
                LexemeKind::Line => self.at += 1,
                LexemeKind::Mark => {
                    self.at += 1;
                    // `# deflex air`
                    let said = lexeme::mark(&lexeme.text[1..]).filter(|said| !said.is_empty());
                    all.extend(said.map(|said| self.mark(said, lexeme.span)));
                }
                _ if ["end", "else", "elif"].iter().any(|word| lexeme.is(word)) => break,
                _ => self.statement(&mut all)?,
            }
        }
        self.depth -= 1;
        Ok(all)
    }

    fn statement(&mut self, all: &mut Vec<Statement>) -> Result<(), Fault> {
        let (from, start) = (self.at, self.here());
        let kind = match self.known_statement(start)? {
            Some(Read::Nothing) if self.ends() => return Ok(()),
            Some(Read::Statement(kind)) if self.ends() => kind,
            Some(Read::Nothing | Read::Statement(StatementKind::If { .. } | StatementKind::Loop { .. })) => {
                return Err(self.fault(self.here(), "expected the end of the line"));
            }
            _ => {
                self.at = from;
                self.not_understood()?
            }
        };
        all.push(Statement { kind, place: self.since(start) });
        Ok(())
    }

    /// A line that is not understood: it may do anything, and uses everything that it names.
    fn not_understood(&mut self) -> Result<StatementKind, Fault> {
        let (from, start) = (self.at, self.here());
        while !self.ends() {
            self.at += 1;
        }
        let line = &self.lexemes[from..self.at];
        if line.last().is_some_and(|lexeme| lexeme.is(":")) {
            return Err(self.fault(start, "a block that URScript does not have: expected def, thread, if or while"));
        }
        let mut reads = Vec::new();
        for (i, lexeme) in line.iter().enumerate() {
            if lexeme.kind == LexemeKind::Number {
                let signed = i.checked_sub(1).map(|before| line[before]).filter(|before| before.is("-"));
                reads.push(self.number(signed.map(|sign| sign.span), *lexeme, Reason::Computed));
            } else if lexeme.kind == LexemeKind::Name {
                let kind = Is::Read(self.variable(lexeme.text, Use::Free));
                reads.push(Expression { kind, place: self.place(lexeme.span) });
            }
        }
        let place = self.since(start);
        self.program.not_understood.push(place);
        Ok(StatementKind::Opaque { writes: None, reads, reason: Reason::NotUnderstood })
    }

    fn known_statement(&mut self, start: Span) -> Result<Option<Read>, Fault> {
        let Some(lexeme) = self.peek() else { return Ok(Some(Read::Nothing)) };
        let word = if lexeme.kind == LexemeKind::Name { lexeme.text } else { b"" };
        let simple = |parser: &mut Self, kind| {
            parser.at += 1;
            Ok(Some(Read::Statement(kind)))
        };
        match word {
            b"def" | b"thread" | b"sec" => self.function().map(Some),
            b"if" => self.conditional(start).map(Some),
            b"while" => {
                self.at += 1;
                let expected = "expected `while`, a condition and `:`";
                let condition = self.condition().ok_or_else(|| self.fault(start, expected))?;
                let body = self.block()?;
                self.close(start)?;
                Ok(Some(Read::Statement(StatementKind::Loop { condition: Some(condition), body })))
            }
            b"break" => simple(self, StatementKind::Break),
            b"continue" => simple(self, StatementKind::Continue),
            b"halt" => {
                self.at += 1;
                if self.take("(") && !self.take(")") {
                    return Ok(None);
                }
                Ok(Some(Read::Statement(StatementKind::Halt)))
            }
            b"pass" | b"enter_critical" | b"exit_critical" if !self.second_is("(") => {
                self.at += 1;
                Ok(Some(Read::Nothing))
            }
            b"return" => {
                self.at += 1;
                let value = if self.ends() { None } else { self.expression() };
                Ok(Some(Read::Statement(StatementKind::Return(value))))
            }
            b"kill" | b"join" => {
                self.at += 1;
                Ok(self.expression().map(|value| Read::Statement(StatementKind::Evaluate(value))))
            }
            b"global" | b"local" => {
                self.at += 1;
                let to = if word == b"global" { Use::Global } else { Use::Local };
                Ok(self.assignment(to).map(Read::Statement))
            }
            _ if lexeme.kind == LexemeKind::Name && self.second_is("(") && motion_path(word).is_some() => {
                Ok(self.motion(word).map(|motion| Read::Statement(StatementKind::Move(Box::new(motion)))))
            }
            _ => {
                let from = self.at;
                if let Some(kind) = self.assignment(Use::Free) {
                    return Ok(Some(Read::Statement(kind)));
                }
                self.at = from;
                Ok(self.expression().map(|value| Read::Statement(StatementKind::Evaluate(value))))
            }
        }
    }

    /// Reads a word or sign without which the text has a fault at `place`.
    fn need(&mut self, text: &str, place: Span, fault: &'static str) -> Result<(), Fault> {
        if self.take(text) { Ok(()) } else { Err(self.fault(place, fault)) }
    }

    fn close(&mut self, start: Span) -> Result<(), Fault> {
        self.need("end", start, "a block without its `end`")
    }

    /// A condition with its colon.
    fn condition(&mut self) -> Option<Expression> {
        let condition = self.expression()?;
        self.take(":").then_some(condition)
    }

    fn conditional(&mut self, start: Span) -> Result<Read, Fault> {
        let (mut arms, mut otherwise) = (Vec::new(), Vec::new());
        while self.take(if arms.is_empty() { "if" } else { "elif" }) {
            let expected = "expected `if` or `elif`, a condition and `:`";
            let condition = self.condition().ok_or_else(|| self.fault(start, expected))?;
            arms.push((condition, self.block()?));
        }
        if self.take("else") {
            self.need(":", self.here(), "expected `:` after `else`")?;
            otherwise = self.block()?;
        }
        self.close(start)?;
        Ok(Read::Statement(StatementKind::If { arms, otherwise }))
    }

    fn function(&mut self) -> Result<Read, Fault> {
        let start = self.here();
        let expected = "expected `def name(parameters):`";
        self.at += 1;
        let id = self.own.names.begins.get(&self.place(start)).copied();
        let id = id.ok_or_else(|| self.fault(start, expected))?;
        let is_thread = self.lexemes[self.at - 1].is("thread");
        let name = self.take_name().ok_or_else(|| self.fault(start, expected))?;
        if self.own.scopes.len() == 1 && !is_thread {
            self.own.outer.push((id, self.source));
        }
        self.need("(", start, expected)?;
        self.own.scopes.push(Scope::default());
        let parameters = self.list(")", Self::parameter).ok_or_else(|| self.fault(start, expected))?;
        self.need(":", start, expected)?;
        let place = self.since(start);
        let body = self.block()?;
        self.close(start)?;
        let scope = self.own.scopes.pop().unwrap_or_default();
        self.own.clashes.extend(scope.inner.iter().filter(|name| scope.locals.contains_key(*name)));
        if let Some(outer) = self.own.scopes.last_mut() {
            outer.inner.extend(scope.free.iter().chain(&scope.inner));
        }
        let locals = scope.locals.len() as u32;
        self.program.functions[id.0 as usize] = Function { name: text(name.text), parameters, locals, body, place };
        Ok(Read::Nothing)
    }

    fn parameter(&mut self) -> Option<Parameter> {
        let name = self.take_name()?;
        self.variable(name.text, Use::Local);
        let default = if self.take("=") { self.expression() } else { None };
        Some(Parameter { name: text(name.text), default })
    }

    /// `name = value`, `name[index] = value`
    fn assignment(&mut self, to: Use) -> Option<StatementKind> {
        let name = self.take_name()?;
        let (mut path, mut field) = (Vec::new(), false);
        loop {
            if self.take("[") {
                path.push(self.expression()?);
                self.expect("]")?;
            } else if self.take(".") {
                field = true;
                self.at += 1;
            } else {
                break;
            }
        }
        self.expect("=")?;
        let value = self.expression()?;
        let slot = self.variable(name.text, to);
        if field {
            let (writes, reason) = (Some(vec![slot]), Reason::Computed);
            return Some(StatementKind::Opaque { writes, reads: path.into_iter().chain([value]).collect(), reason });
        }
        Some(StatementKind::Assign { slot, path, value })
    }

    fn variable(&mut self, name: &'a [u8], usage: Use) -> Slot {
        let Some(scope) = self.own.scopes.last_mut() else { return Slot::Local(0) };
        let own = scope.locals.get(name).filter(|_| !scope.free.contains(name)).copied();
        if let (Some(own), Use::Free | Use::Local) = (own, usage) {
            return Slot::Local(own);
        }
        if let (Some(global), Use::Free | Use::Global) = (self.own.names.globals.get(name), usage) {
            return *global;
        }
        if usage == Use::Free {
            scope.free.insert(name);
        } else {
            scope.free.remove(name);
        }
        let next = scope.locals.len() as u32;
        Slot::Local(*scope.locals.entry(name).or_insert(next))
    }

    /// `movel(pose, a=1.2, v=0.25, t=0, r=0)`
    fn motion(&mut self, word: &[u8]) -> Option<Motion> {
        let (path, names) = motion_path(word)?;
        self.at += 1;
        let start = self.here();
        let arguments = self.arguments()?;
        let mut given: BTreeMap<&str, Expression> = BTreeMap::new();
        let mut others = Vec::new();
        for (at, argument) in arguments.into_iter().enumerate() {
            let name = match argument.name.as_deref() {
                Some("q" | "pose" | "pose_to") => Some(&"to"),
                Some("pose_via") => Some(&"via"),
                Some(name) => names.iter().find(|known| **known == name),
                None => names.get(at),
            };
            match name {
                Some(name) => drop(given.insert(name, argument.value)),
                None => others.push(argument.value),
            }
        }
        let place = self.since(start);
        let mut path = path;
        let zero = |e: &Expression| matches!(e.kind, Is::Number(value, _) if value == 0.0);
        if let Some(mode) = given.get("mode").filter(|mode| !zero(mode)) {
            let is_fixed = matches!(mode.kind, Is::Number(mode, _) if mode - 1.0 == 0.0);
            path = if is_fixed { Path::Tangent } else { Path::Other(Reason::Tangent) };
        }
        let timed = given.get("t").is_some_and(|time| !zero(time));
        let speed = match (given.remove("v"), timed, path) {
            (_, true, _) => Some(Expression { kind: Is::Unknown(Reason::Computed, Vec::new()), place }),
            (Some(speed), ..) => Some(speed),
            (None, _, Path::Linear | Path::Circular | Path::Tangent | Path::Other(_)) => {
                Some(Expression { kind: Is::Constant(DEFAULT_SPEED), place })
            }
            _ => None,
        };
        let (via, to, blend) = (given.remove("via"), given.remove("to"), given.remove("r"));
        others.extend(given.into_values());
        Some(Motion { path, via, to, speed, blend, others })
    }

    /// `(…)`
    fn arguments(&mut self) -> Option<Vec<Argument>> {
        self.expect("(")?;
        self.list(")", |parser| {
            let name = if parser.second_is("=") { parser.take_name() } else { None };
            parser.at += usize::from(name.is_some());
            Some(Argument { name: name.map(|name| text(name.text)), value: parser.expression()? })
        })
    }

    fn expression(&mut self) -> Option<Expression> {
        self.binary(&LEVELS, Self::unary)
    }

    fn unary(&mut self) -> Option<Expression> {
        let start = self.here();
        let operator = match self.peek() {
            Some(lexeme) if lexeme.is("-") => Some(Unary::Negate),
            Some(lexeme) if lexeme.is("not") => Some(Unary::Not),
            Some(lexeme) if lexeme.is("+") => None,
            _ => return self.item(),
        };
        self.at += 1;
        // A sign belongs to its number, where that is an operand by itself.
        let is_whole = !self.second_is("[") && !self.second_is(".");
        let number = self.peek().filter(|lexeme| lexeme.kind == LexemeKind::Number && is_whole);
        if let (Some(Unary::Negate), Some(number)) = (operator, number) {
            self.at += 1;
            return Some(self.number(Some(start), number, Reason::Computed));
        }
        let operand = self.inner(Self::unary)?;
        let Some(operator) = operator else { return Some(operand) };
        Some(self.expression_at(Is::Unary(operator, Box::new(operand)), start))
    }

    /// An operand with its indices and methods.
    fn item(&mut self) -> Option<Expression> {
        let start = self.here();
        let mut value = self.operand()?;
        loop {
            if self.take("[") {
                let index = self.expression()?;
                self.expect("]")?;
                value = self.expression_at(Is::Item(Box::new([value, index])), start);
            } else if self.take(".") {
                let method = self.take_name()?;
                let arguments = if self.next_is("(") { self.arguments()? } else { Vec::new() };
                let changes =
                    [&b"append"[..], b"clear", b"extend", b"insert", b"pop", b"remove"].contains(&method.text);
                let object = Argument { name: None, value };
                let all = [object].into_iter().chain(arguments);
                // A method that changes its object may change any variable that holds it.
                let kind = if changes {
                    Is::Call(Callee::Foreign, all.collect())
                } else {
                    Is::Unknown(Reason::Input, all.map(|argument| argument.value).collect())
                };
                value = self.expression_at(kind, start);
            } else {
                return Some(value);
            }
        }
    }

    fn operand(&mut self) -> Option<Expression> {
        let lexeme = self.peek()?;
        let start = lexeme.span;
        self.at += 1;
        let kind = self.inner(|parser| parser.operand_kind(lexeme))?;
        Some(self.expression_at(kind, start))
    }

    fn operand_kind(&mut self, lexeme: Lexeme<'a>) -> Option<Is> {
        match lexeme.kind {
            LexemeKind::Number => Some(self.number(None, lexeme, Reason::Computed).kind),
            LexemeKind::Text => Some(Is::Text(lexeme.text.into())),
            LexemeKind::Sign if lexeme.text == b"(" => {
                self.expression().filter(|_| self.take(")")).map(|inner| inner.kind)
            }
            LexemeKind::Sign if lexeme.text == b"[" => self.items().map(Is::List),
            LexemeKind::Name => match lexeme.text {
                b"p" if self.take("[") => self.items().map(|items| Is::Pose(items, None)),
                b"True" | b"TRUE" | b"true" => Some(Is::Truth(true)),
                b"False" | b"FALSE" | b"false" => Some(Is::Truth(false)),
                b"run" => self.thread(),
                _ if self.next_is("(") => self.call(lexeme),
                name => Some(Is::Read(self.variable(name, Use::Free))),
            },
            _ => None,
        }
    }

    fn items(&mut self) -> Option<Vec<Expression>> {
        self.list("]", Self::expression)
    }

    /// Items with commas between them, up to a bracket.
    fn list<I>(&mut self, end: &str, item: impl Fn(&mut Self) -> Option<I>) -> Option<Vec<I>> {
        let mut all = Vec::new();
        while !self.take(end) {
            all.push(item(self)?);
            if !self.next_is(end) {
                self.expect(",")?;
            }
        }
        Some(all)
    }

    /// `run name()`
    fn thread(&mut self) -> Option<Is> {
        let name = self.take_name()?;
        let arguments = self.arguments()?;
        match self.own.names.functions.get(name.text).map(Vec::as_slice) {
            Some(known) => self.own.threads.extend(known),
            None => return Some(Is::Call(self.unknown_routine(name), arguments)),
        }
        Some(Is::Unknown(Reason::Input, arguments.into_iter().map(|argument| argument.value).collect()))
    }

    fn call(&mut self, name: Lexeme<'a>) -> Option<Is> {
        let arguments = self.arguments()?;
        let callee = match self.functions(name.text) {
            Some(&[one]) => {
                self.called.insert(one);
                Callee::Function(one)
            }
            // Of several routines with one name the last one that runs counts, and it is not known which one that is.
            Some(several) => {
                self.called.extend(several);
                Callee::Foreign
            }
            None => match builtins::find(name.text) {
                Some(builtin) => Callee::Builtin(builtin),
                None => self.unknown_routine(name),
            },
        };
        Some(Is::Call(callee, arguments))
    }

    /// The routines with a name. Those of context files may have it in capitals, as the cell stores names.
    fn functions(&self, name: &[u8]) -> Option<&'n [FunctionId]> {
        let functions = &self.own.names.functions;
        let capital = || functions.get(&name.to_ascii_uppercase()[..]);
        let vouched = || capital().filter(|ids| ids.iter().all(|id| self.own.names.context.contains(id)));
        let known = functions.get(name).map(Vec::as_slice);
        // A routine of the language itself is no one's to define.
        known.or_else(|| if builtins::find(name).is_some() { None } else { vouched().map(Vec::as_slice) })
    }

    fn unknown_routine(&mut self, name: Lexeme<'_>) -> Callee {
        let place = self.place(name.span);
        self.foreign(text(name.text), place)
    }
}

/// The kind of a statement that was read.
enum Read {
    Statement(StatementKind),
    /// A declaration, which does not run.
    Nothing,
}

/// How a name is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Use {
    Free,
    Global,
    Local,
}

/// Speed of a path motion that states none, m/s.
const DEFAULT_SPEED: f64 = 0.25;

/// The kind of path of a motion instruction, and the names of its arguments; `None` for other words.
fn motion_path(word: &[u8]) -> Option<(Path, &'static [&'static str])> {
    const LINE: &[&str] = &["to", "a", "v", "t", "r"];
    Some(match word {
        b"movej" => (Path::Joint, &["to", "a", "joint_v", "joint_t", "r"]),
        b"movel" => (Path::Linear, LINE),
        b"movep" => (Path::Linear, &["to", "a", "v", "r"]),
        b"movec" => (Path::Circular, &["via", "to", "a", "v", "r", "mode"]),
        b"optimovej" => (Path::Joint, &["to", "a_share", "v_share", "r"]),
        b"optimovel" => (Path::Other(Reason::Input), &["to", "a_share", "v_share", "r"]),
        b"servoj" | b"servol" | b"servoc" | b"speedj" | b"speedl" | b"direct_torque" | b"movex" => {
            (Path::Unknown(Reason::Follows), &[])
        }
        b"move_until_contact" => (Path::Unknown(Reason::Follows), &[]),
        _ => return None,
    })
}

/// Operators, loosest first.
const LEVELS: [Level; 6] = [
    &[("or", Binary::Or)],
    &[("xor", Binary::Xor)],
    &[("and", Binary::And)],
    &[
        ("==", Binary::Equal),
        ("!=", Binary::NotEqual),
        ("<=", Binary::AtMost),
        (">=", Binary::AtLeast),
        ("<", Binary::Less),
        (">", Binary::Greater),
    ],
    SUM,
    &[("*", Binary::Multiply), ("/", Binary::Divide), ("%", Binary::Remainder)],
];
