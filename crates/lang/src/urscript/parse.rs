//! Lexemes to the intermediate representation.

use super::builtins;
use super::lex::lexemes;
use crate::Span;
use crate::ir::{
    Argument, Binary, Callee, Expression, ExpressionKind as Is, Fault, Function, FunctionId, Motion, Parameter, Path,
    Place, Program, Slot, Statement, StatementKind, Switch, TokenId, Unary,
};
use crate::lexeme::{Kind, Lexeme};
use crate::value::Reason;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Deepest nesting of blocks and expressions: far beyond any program, and within any stack.
const DEEPEST: usize = 64;

/// What is known of names before statements are read.
#[derive(Default)]
struct Names<'a> {
    /// The routines with this name, in the order of the text.
    functions: BTreeMap<&'a [u8], Vec<FunctionId>>,
    /// Routines of files that are only read, which may vouch for others.
    context: BTreeSet<FunctionId>,
    /// Each routine by the place of the word that begins it.
    begins: BTreeMap<Place, FunctionId>,
    globals: BTreeMap<&'a [u8], Slot>,
    /// Names that a routine and one around it both use.
    unclear: BTreeSet<&'a [u8]>,
}

pub(super) fn read(sources: &[&[u8]], written: usize) -> Result<Program, Fault> {
    let all: Vec<Vec<Lexeme<'_>>> = sources.iter().map(|bytes| lexemes(bytes)).collect();
    let mut unclear = BTreeSet::new();
    loop {
        let names = survey(&all, written, std::mem::take(&mut unclear));
        let mut parser = Parser::new(&names, all.len());
        for (source, lexemes) in all.iter().enumerate() {
            parser.file(source, lexemes)?;
        }
        let found = parser.unclear();
        if found.is_subset(&names.unclear) {
            return Ok(parser.program(written));
        }
        unclear = names.unclear.union(&found).copied().collect();
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
            let next = lexemes.get(at + 1).filter(|next| next.kind == Kind::Name);
            let outside = routines == 0;
            if begins && (lexeme.is("def") || lexeme.is("thread") || lexeme.is("sec")) {
                if let Some(name) = next {
                    names.functions.entry(name.text).or_default().push(FunctionId(count));
                }
                names.context.extend((source >= written).then_some(FunctionId(count)));
                names.begins.insert(Place { source: source as u16, span: lexeme.span }, FunctionId(count));
                count += 1;
                routines += 1;
                open.push(true);
            } else if begins && (lexeme.is("if") || lexeme.is("while")) {
                open.push(false);
            } else if begins && lexeme.is("end") {
                routines -= usize::from(open.pop() == Some(true));
            } else if begins && lexeme.is("global") {
                globals.extend(next.map(|name| name.text));
            } else if begins && outside && lexeme.kind == Kind::Name && lexemes.get(at + 1).is_some_and(|l| l.is("=")) {
                globals.push(lexeme.text);
            }
            begins = matches!(lexeme.kind, Kind::Line | Kind::Mark) || lexeme.is(":");
        }
    }
    for name in globals {
        let next = Slot::Global((Switch::ALL.len() + names.globals.len()) as u32);
        names.globals.entry(name).or_insert(next);
    }
    names
}

/// The routine that is being read.
#[derive(Default)]
struct Scope<'a> {
    /// Its variables by name.
    locals: BTreeMap<&'a [u8], u32>,
    /// Those that no declaration and no parameter makes its own.
    free: BTreeSet<&'a [u8]>,
    /// Those of the routines within it.
    inner: BTreeSet<&'a [u8]>,
}

struct Parser<'a, 'n> {
    names: &'n Names<'a>,
    lexemes: &'n [Lexeme<'a>],
    at: usize,
    source: u16,
    depth: usize,
    /// Routines around the statement, innermost last.
    scopes: Vec<Scope<'a>>,
    /// Free names of routines and of those around them that are the same.
    clashes: BTreeSet<&'a [u8]>,
    called: BTreeSet<FunctionId>,
    /// Routines outside all others, of the first source.
    outer: Vec<(FunctionId, u16)>,
    threads: BTreeSet<FunctionId>,
    foreign: BTreeSet<&'a [u8]>,
    program: Program,
}

impl<'a, 'n> Parser<'a, 'n> {
    fn new(names: &'n Names<'a>, files: usize) -> Self {
        let mut globals: Vec<(Slot, &[u8])> = names.globals.iter().map(|(name, slot)| (*slot, *name)).collect();
        globals.sort_unstable();
        let switches = Switch::ALL.iter().map(|switch| Arc::from(format!("{switch:?}")));
        let named = globals.iter().map(|(_, name)| text(name));
        let volatile = names.unclear.iter().filter_map(|name| Some((*names.globals.get(name)?, Reason::Scope)));
        let mut program =
            Program { globals: switches.chain(named).collect(), volatile: volatile.collect(), ..Program::default() };
        // The statements of each file that stand in no routine come first.
        program.functions.resize_with(files + names.begins.len(), Function::default);
        Self {
            names,
            lexemes: &[],
            at: 0,
            source: 0,
            depth: 0,
            scopes: Vec::new(),
            clashes: BTreeSet::new(),
            called: BTreeSet::new(),
            outer: Vec::new(),
            threads: BTreeSet::new(),
            foreign: BTreeSet::new(),
            program,
        }
    }

    fn file(&mut self, source: usize, lexemes: &'n [Lexeme<'a>]) -> Result<(), Fault> {
        (self.lexemes, self.at, self.source) = (lexemes, 0, source as u16);
        self.scopes.push(Scope::default());
        let body = self.block()?;
        if let Some(lexeme) = self.lexemes.get(self.at) {
            return Err(self.fault(lexeme.span, "`end`, `else` or `elif` without a block that it belongs to"));
        }
        let scope = self.scopes.pop().unwrap_or_default();
        let function = &mut self.program.functions[source];
        (function.body, function.locals) = (body, scope.locals.len() as u32);
        Ok(())
    }

    /// Free names that routines around have too.
    fn unclear(&self) -> BTreeSet<&'a [u8]> {
        self.clashes.clone()
    }

    fn program(mut self, written: usize) -> Program {
        let file = FunctionId(0);
        let is_started = |id: &FunctionId| !self.called.contains(id) && !self.threads.contains(id);
        let outer: Vec<FunctionId> = self
            .outer
            .iter()
            .filter(|(_, source)| usize::from(*source) < written)
            .map(|(id, _)| *id)
            .filter(is_started)
            .collect();
        // What no other calls is started by itself, or by an operator.
        self.program.entries = [file].into_iter().chain(outer).collect();
        self.program.threads = self.threads.into_iter().collect();
        self.program
    }

    fn place(&self, span: Span) -> Place {
        Place { source: self.source, span }
    }

    fn fault(&self, span: Span, message: &'static str) -> Fault {
        Fault { place: self.place(span), message }
    }

    fn peek(&self) -> Option<&'n Lexeme<'a>> {
        self.lexemes.get(self.at)
    }

    fn next_is(&self, text: &str) -> bool {
        self.peek().is_some_and(|lexeme| lexeme.is(text))
    }

    fn take(&mut self, text: &str) -> bool {
        let is = self.next_is(text);
        self.at += usize::from(is);
        is
    }

    fn ends(&self) -> bool {
        self.peek().is_none_or(|lexeme| matches!(lexeme.kind, Kind::Line | Kind::Mark))
    }

    /// Where the lexeme that is next begins, or the last one ends.
    fn here(&self) -> Span {
        let last = || self.lexemes.last().map_or(Span::default(), |l| Span { start: l.span.end, end: l.span.end });
        self.peek().map_or_else(last, |lexeme| lexeme.span)
    }

    /// From a lexeme to the last one read.
    fn since(&self, start: Span) -> Place {
        let last = self.lexemes.get(self.at.wrapping_sub(1)).map_or(start, |lexeme| lexeme.span);
        self.place(if last.end < start.end { start } else { start.to(last) })
    }

    /// Statements up to the word that ends their block.
    fn block(&mut self) -> Result<Vec<Statement>, Fault> {
        let mut all = Vec::new();
        if self.depth >= DEEPEST {
            return Err(self.fault(self.here(), "blocks are nested deeper than 64"));
        }
        self.depth += 1;
        while let Some(lexeme) = self.peek() {
            match lexeme.kind {
                Kind::Line => self.at += 1,
                Kind::Mark => {
                    self.at += 1;
                    all.extend(self.mark(lexeme));
                }
                _ if ["end", "else", "elif"].iter().any(|word| lexeme.is(word)) => break,
                _ => self.statement(&mut all)?,
            }
        }
        self.depth -= 1;
        Ok(all)
    }

    /// `# deflex air`
    fn mark(&self, lexeme: &Lexeme<'_>) -> Option<Statement> {
        let mut words = lexeme.text[1..].split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        let said = words.nth(1)?.to_ascii_lowercase();
        let place = self.place(lexeme.span);
        let value = Expression { kind: Is::Text(said.into()), place };
        Some(Statement { kind: StatementKind::Assign { slot: Switch::Mark.slot(), path: Vec::new(), value }, place })
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

    /// A line that is not understood: it may do anything, and uses what it names.
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
            if lexeme.kind == Kind::Number {
                let signed = i.checked_sub(1).map(|before| line[before]).filter(|before| before.is("-"));
                reads.push(self.number(signed.map(|sign| sign.span), lexeme));
            } else if lexeme.kind == Kind::Name {
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
        let word = if lexeme.kind == Kind::Name { lexeme.text } else { b"" };
        let simple = |parser: &mut Self, kind| {
            parser.at += 1;
            Ok(Some(Read::Statement(kind)))
        };
        match word {
            b"def" | b"thread" | b"sec" => self.function().map(Some),
            b"if" => self.conditional(start).map(Some),
            b"while" => {
                self.at += 1;
                let Some(condition) = self.condition() else {
                    return Err(self.fault(start, "expected `while`, a condition and `:`"));
                };
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
            b"pass" | b"enter_critical" | b"exit_critical" if !self.is_call() => {
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
            _ if lexeme.kind == Kind::Name && self.is_call() && motion_path(word).is_some() => {
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

    /// Whether the word that is next is called.
    fn is_call(&self) -> bool {
        self.lexemes.get(self.at + 1).is_some_and(|next| next.is("("))
    }

    fn close(&mut self, start: Span) -> Result<(), Fault> {
        if self.take("end") {
            return Ok(());
        }
        Err(self.fault(start, "a block without its `end`"))
    }

    /// A condition with its colon.
    fn condition(&mut self) -> Option<Expression> {
        let condition = self.expression()?;
        self.take(":").then_some(condition)
    }

    fn conditional(&mut self, start: Span) -> Result<Read, Fault> {
        let (mut arms, mut otherwise) = (Vec::new(), Vec::new());
        while self.take(if arms.is_empty() { "if" } else { "elif" }) {
            let Some(condition) = self.condition() else {
                return Err(self.fault(start, "expected `if` or `elif`, a condition and `:`"));
            };
            arms.push((condition, self.block()?));
        }
        if self.take("else") {
            if !self.take(":") {
                return Err(self.fault(self.here(), "expected `:` after `else`"));
            }
            otherwise = self.block()?;
        }
        self.close(start)?;
        Ok(Read::Statement(StatementKind::If { arms, otherwise }))
    }

    fn function(&mut self) -> Result<Read, Fault> {
        let start = self.here();
        let expected = "expected `def name(parameters):`";
        self.at += 1;
        let Some(&id) = self.names.begins.get(&self.place(start)) else {
            return Err(self.fault(start, expected));
        };
        let is_thread = self.lexemes[self.at - 1].is("thread");
        let Some(name) = self.peek().filter(|lexeme| lexeme.kind == Kind::Name) else {
            return Err(self.fault(start, expected));
        };
        self.at += 1;
        if self.scopes.len() == 1 && !is_thread {
            self.outer.push((id, self.source));
        }
        if !self.take("(") {
            return Err(self.fault(start, expected));
        }
        self.scopes.push(Scope::default());
        let mut parameters = Vec::new();
        while !self.take(")") {
            let Some(parameter) = self.peek().filter(|lexeme| lexeme.kind == Kind::Name) else {
                return Err(self.fault(start, expected));
            };
            self.at += 1;
            self.variable(parameter.text, Use::Local);
            let default = if self.take("=") { self.expression() } else { None };
            parameters.push(Parameter { name: text(parameter.text), default });
            if !self.take(",") && !self.next_is(")") {
                return Err(self.fault(start, expected));
            }
        }
        if !self.take(":") {
            return Err(self.fault(start, expected));
        }
        let place = self.since(start);
        let body = self.block()?;
        self.close(start)?;
        let scope = self.scopes.pop().unwrap_or_default();
        self.clashes.extend(scope.inner.iter().filter(|name| scope.locals.contains_key(*name)));
        if let Some(outer) = self.scopes.last_mut() {
            outer.inner.extend(scope.free.iter().chain(&scope.inner));
        }
        let locals = scope.locals.len() as u32;
        self.program.functions[id.0 as usize] = Function { name: text(name.text), parameters, locals, body, place };
        Ok(Read::Nothing)
    }

    /// `name = value`, `name[index] = value`
    fn assignment(&mut self, to: Use) -> Option<StatementKind> {
        let name = self.peek().filter(|lexeme| lexeme.kind == Kind::Name)?;
        self.at += 1;
        let (mut path, mut field) = (Vec::new(), false);
        loop {
            if self.take("[") {
                path.push(self.expression()?);
                if !self.take("]") {
                    return None;
                }
            } else if self.take(".") {
                field = true;
                self.at += 1;
            } else {
                break;
            }
        }
        if !self.take("=") {
            return None;
        }
        let value = self.expression()?;
        let slot = self.variable(name.text, to);
        if field {
            let (writes, reason) = (Some(vec![slot]), Reason::Computed);
            return Some(StatementKind::Opaque { writes, reads: path.into_iter().chain([value]).collect(), reason });
        }
        Some(StatementKind::Assign { slot, path, value })
    }

    fn variable(&mut self, name: &'a [u8], usage: Use) -> Slot {
        let Some(scope) = self.scopes.last_mut() else { return Slot::Local(0) };
        let own = scope.locals.get(name).filter(|_| !scope.free.contains(name)).copied();
        if let (Some(own), Use::Free | Use::Local) = (own, usage) {
            return Slot::Local(own);
        }
        if let (Some(global), Use::Free | Use::Global) = (self.names.globals.get(name), usage) {
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
        if given.get("mode").is_some_and(|mode| !zero(mode)) {
            path = Path::Other(Reason::Tangent);
        }
        let timed = given.get("t").is_some_and(|time| !zero(time));
        let speed = match (given.remove("v"), timed, path) {
            (_, true, _) => Some(Expression { kind: Is::Unknown(Reason::Computed, Vec::new()), place }),
            (Some(speed), ..) => Some(speed),
            (None, _, Path::Linear | Path::Circular | Path::Other(_)) => {
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
        let mut all = Vec::new();
        if !self.take("(") {
            return None;
        }
        while !self.take(")") {
            let name = self.peek().filter(|lexeme| lexeme.kind == Kind::Name);
            let name = name.filter(|_| self.lexemes.get(self.at + 1).is_some_and(|next| next.is("=")));
            self.at += if name.is_some() { 2 } else { 0 };
            all.push(Argument { name: name.map(|name| text(name.text)), value: self.expression()? });
            if !self.take(",") && !self.next_is(")") {
                return None;
            }
        }
        Some(all)
    }

    fn expression(&mut self) -> Option<Expression> {
        self.binary(0)
    }

    /// Operators from a level of precedence up.
    fn binary(&mut self, level: usize) -> Option<Expression> {
        if level == LEVELS.len() {
            return self.unary();
        }
        if self.depth >= 2 * DEEPEST {
            return None;
        }
        let start = self.here();
        let mut left = self.binary(level + 1)?;
        while let Some((_, operator)) = LEVELS[level].iter().find(|(word, _)| self.next_is(word)) {
            self.at += 1;
            let right = self.binary(level + 1)?;
            let kind = Is::Binary(*operator, Box::new([left, right]));
            left = Expression { kind, place: self.since(start) };
        }
        Some(left)
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
        let is_whole = !self.lexemes.get(self.at + 1).is_some_and(|next| next.is("[") || next.is("."));
        let number = self.peek().filter(|lexeme| lexeme.kind == Kind::Number && is_whole);
        if let (Some(Unary::Negate), Some(number)) = (operator, number) {
            self.at += 1;
            return Some(self.number(Some(start), number));
        }
        self.depth += 1;
        let operand = if self.depth < 2 * DEEPEST { self.unary() } else { None };
        self.depth -= 1;
        let operand = operand?;
        let Some(operator) = operator else { return Some(operand) };
        Some(Expression { kind: Is::Unary(operator, Box::new(operand)), place: self.since(start) })
    }

    /// A literal with its sign.
    fn number(&mut self, sign: Option<Span>, lexeme: &Lexeme<'_>) -> Expression {
        let place = self.place(sign.map_or(lexeme.span, |sign| sign.to(lexeme.span)));
        let value = std::str::from_utf8(lexeme.text).ok().and_then(|text| text.parse::<f64>().ok());
        let value = value.unwrap_or(f64::NAN);
        if !value.is_finite() {
            return Expression { kind: Is::Unknown(Reason::Computed, Vec::new()), place };
        }
        let id = TokenId(self.program.tokens.len() as u32);
        self.program.tokens.push(place);
        Expression { kind: Is::Number(if sign.is_some() { -value } else { value }, id), place }
    }

    /// An operand with its indices and methods.
    fn item(&mut self) -> Option<Expression> {
        let start = self.here();
        let mut value = self.operand()?;
        loop {
            if self.take("[") {
                let index = self.expression()?;
                if !self.take("]") {
                    return None;
                }
                value = Expression { kind: Is::Item(Box::new([value, index])), place: self.since(start) };
            } else if self.take(".") {
                let method = self.peek().filter(|lexeme| lexeme.kind == Kind::Name)?;
                self.at += 1;
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
                value = Expression { kind, place: self.since(start) };
            } else {
                return Some(value);
            }
        }
    }

    fn operand(&mut self) -> Option<Expression> {
        let lexeme = self.peek()?;
        let start = lexeme.span;
        self.at += 1;
        self.depth += 1;
        let kind = if self.depth < 2 * DEEPEST { self.operand_kind(lexeme) } else { None };
        self.depth -= 1;
        Some(Expression { kind: kind?, place: self.since(start) })
    }

    fn operand_kind(&mut self, lexeme: &Lexeme<'a>) -> Option<Is> {
        match lexeme.kind {
            Kind::Number => Some(self.number(None, lexeme).kind),
            Kind::Text => Some(Is::Text(lexeme.text.into())),
            Kind::Sign if lexeme.text == b"(" => {
                let inner = self.expression()?;
                self.take(")").then_some(inner.kind)
            }
            Kind::Sign if lexeme.text == b"[" => self.items().map(Is::List),
            Kind::Name => match lexeme.text {
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
        let mut all = Vec::new();
        while !self.take("]") {
            all.push(self.expression()?);
            if !self.take(",") && !self.next_is("]") {
                return None;
            }
        }
        Some(all)
    }

    /// `run name()`
    fn thread(&mut self) -> Option<Is> {
        let name = self.peek().filter(|lexeme| lexeme.kind == Kind::Name)?;
        self.at += 1;
        let arguments = self.arguments()?;
        match self.names.functions.get(name.text).map(Vec::as_slice) {
            Some(known) => self.threads.extend(known),
            None => return Some(Is::Call(self.unknown_routine(name), arguments)),
        }
        Some(Is::Unknown(Reason::Input, arguments.into_iter().map(|argument| argument.value).collect()))
    }

    fn call(&mut self, name: &Lexeme<'a>) -> Option<Is> {
        let arguments = self.arguments()?;
        let callee = match self.functions(name.text) {
            Some(&[one]) => {
                self.called.insert(one);
                Callee::Function(one)
            }
            // Of several with one name the last one that is read holds, and nothing says which one that is.
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

    /// The routines with a name. Those of files that are only read may have it in capitals, as a cell has names.
    fn functions(&self, name: &[u8]) -> Option<&'n [FunctionId]> {
        let functions = &self.names.functions;
        let capital = || functions.get(&name.to_ascii_uppercase()[..]);
        let vouched = || capital().filter(|ids| ids.iter().all(|id| self.names.context.contains(id)));
        let known = functions.get(name).map(Vec::as_slice);
        // A routine of the language itself is no one's to define.
        known.or_else(|| if builtins::find(name).is_some() { None } else { vouched().map(Vec::as_slice) })
    }

    fn unknown_routine(&mut self, name: &Lexeme<'a>) -> Callee {
        if self.foreign.insert(name.text) {
            self.program.foreign.push((text(name.text), self.place(name.span)));
        }
        Callee::Foreign
    }
}

/// What has been read.
enum Read {
    Statement(StatementKind),
    /// Nothing that runs.
    Nothing,
}

/// How a name is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Use {
    Free,
    Global,
    Local,
}

/// Speed of a motion on a path that names none, m/s.
const DEFAULT_SPEED: f64 = 0.25;

/// How a motion instruction goes, and what its arguments are called; `None` where the word is none.
fn motion_path(word: &[u8]) -> Option<(Path, &'static [&'static str])> {
    const LINE: &[&str] = &["to", "a", "v", "t", "r"];
    Some(match word {
        b"movej" => (Path::Joint, &["to", "a", "joint_v", "joint_t", "r"]),
        b"movel" => (Path::Linear, LINE),
        b"movep" => (Path::Linear, &["to", "a", "v", "r"]),
        b"movec" => (Path::Circular, &["via", "to", "a", "v", "r", "mode"]),
        b"optimovej" => (Path::Joint, &["to", "a_share", "v_share", "r"]),
        b"optimovel" => (Path::Other(Reason::Input), &["to", "a_share", "v_share", "r"]),
        b"servoj" | b"servol" | b"servoc" | b"speedj" | b"speedl" | b"movex" => (Path::Unknown(Reason::Follows), &[]),
        b"move_until_contact" => (Path::Unknown(Reason::Follows), &[]),
        _ => return None,
    })
}

/// Operators, loosest first.
const LEVELS: [&[(&str, Binary)]; 6] = [
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
    &[("+", Binary::Add), ("-", Binary::Subtract)],
    &[("*", Binary::Multiply), ("/", Binary::Divide), ("%", Binary::Remainder)],
];

fn text(bytes: &[u8]) -> Arc<str> {
    String::from_utf8_lossy(bytes).into()
}
