//! Running order: follows routines, calls, loops with known bounds; collects targets.

use super::expr::{Arg, Cursor, Expr, upper};
use super::lex::{ASSIGN, Kind, Token};
use super::module::{Module, Symbols, statement_end, word};
use super::value::{Bound, Names, Scope, option, positional, tokens};
use super::{Layout, Site, SiteKind};
use crate::program::{Conf, Editable, Goal, Kept, Mark, Motion, Role, Target, Tool, ToolData, Wobj, WobjData};
use crate::text::{Source, Span};
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

/// Calls nest at most this deep; recursion is cut there.
const CALLS: usize = 24;
/// Targets of one program at most: loops of a mistyped bound end here.
const MOST: usize = 20_000_000;
/// External axes at or above this are unused (9E9 in its spellings).
const UNUSED_AXIS: f64 = 8.9e9;

/// Where the targets of an instruction stand among its positional arguments.
struct Shape {
    motion: Motion,
    via: Option<usize>,
    to: usize,
    speed: usize,
    tool: Option<usize>,
}

/// Instructions that move: LANGUAGES of the field, by name.
fn shape(name: &str) -> Option<Shape> {
    let shape = |motion, via, to, speed, tool| Some(Shape { motion, via, to, speed, tool: Some(tool) });
    match name {
        "MOVEL" => shape(Motion::Linear, None, 0, 1, 3),
        "MOVEJ" => shape(Motion::Joint, None, 0, 1, 3),
        "MOVEC" => shape(Motion::Circular, Some(0), 1, 2, 4),
        "MOVEABSJ" => shape(Motion::AbsoluteJoint, None, 0, 1, 3),
        "MOVELDO" | "MOVELAO" | "MOVELGO" | "MOVELSYNC" => shape(Motion::Linear, None, 0, 1, 3),
        "MOVEJDO" | "MOVEJAO" | "MOVEJGO" | "MOVEJSYNC" => shape(Motion::Joint, None, 0, 1, 3),
        "MOVECDO" | "MOVECAO" | "MOVECGO" | "MOVECSYNC" => shape(Motion::Circular, Some(0), 1, 2, 4),
        "TRIGGL" => shape(Motion::Linear, None, 0, 1, 4),
        "TRIGGJ" => shape(Motion::Joint, None, 0, 1, 4),
        "TRIGGC" => shape(Motion::Circular, Some(0), 1, 2, 5),
        "TRIGGABSJ" => shape(Motion::AbsoluteJoint, None, 0, 1, 4),
        "TRIGGLIOS" => shape(Motion::Linear, None, 0, 1, 3),
        "SEARCHL" => shape(Motion::Linear, None, 2, 3, 4),
        "SEARCHC" => shape(Motion::Circular, Some(2), 3, 4, 5),
        "ARCL" | "ARCLSTART" | "ARCLEND" => shape(Motion::Linear, None, 0, 1, 5),
        "ARCC" | "ARCCSTART" | "ARCCEND" => shape(Motion::Circular, Some(0), 1, 2, 6),
        "EGMMOVEL" => shape(Motion::Linear, None, 1, 2, 4),
        _ => None,
    }
}

pub(super) struct Run<'a> {
    pub(super) sources: &'a [Source],
    pub(super) modules: &'a [Module],
    pub(super) symbols: &'a Symbols,
    pub(super) written: usize,
    pub(super) targets: Vec<Target>,
    pub(super) tools: Vec<Tool>,
    pub(super) wobjs: Vec<Wobj>,
    pub(super) kept: Vec<Kept>,
    pub(super) layout: Layout,
    pub(super) arcs: usize,
    pub(super) ordinal: u32,
    pub(super) branches: bool,
    lines: LineCounter,
    mark: Option<Mark>,
    displaced: bool,
    sites: BTreeMap<(usize, u32), u32>,
    called: std::collections::BTreeSet<String>,
}

/// Lines by offset, one file after the other: mostly asked in rising order.
#[derive(Default)]
struct LineCounter {
    source: usize,
    offset: usize,
    line: usize,
}

impl LineCounter {
    fn line(&mut self, sources: &[Source], source: usize, offset: usize) -> usize {
        if source != self.source || offset < self.offset || self.line == 0 {
            *self = Self { source, offset: 0, line: sources[source].lines_before + 1 };
        }
        let bytes = &sources[source].bytes;
        for at in self.offset..offset.min(bytes.len()) {
            let next = bytes.get(at + 1);
            self.line += usize::from(match bytes[at] {
                b'\n' => true,
                b'\r' => !matches!(next, Some(b'\n' | b'\r')),
                _ => false,
            });
        }
        self.offset = offset;
        self.line
    }
}

impl<'a> Run<'a> {
    pub(super) fn new(sources: &'a [Source], modules: &'a [Module], symbols: &'a Symbols, written: usize) -> Self {
        Self {
            sources,
            modules,
            symbols,
            written,
            targets: Vec::new(),
            tools: Vec::new(),
            wobjs: Vec::new(),
            kept: Vec::new(),
            layout: Layout::default(),
            arcs: 0,
            ordinal: 0,
            branches: false,
            lines: LineCounter::default(),
            mark: None,
            displaced: false,
            sites: BTreeMap::new(),
            called: std::collections::BTreeSet::new(),
        }
    }

    /// Runs main, or where there is none every routine that no other calls, in the order of the files.
    pub(super) fn program(&mut self) {
        if self.symbols.routines.contains_key("MAIN") {
            self.routine("MAIN", Scope::new(), CALLS);
            return;
        }
        let symbols = self.symbols;
        for name in &symbols.order {
            let Some(routine) = symbols.routines.get(name) else { continue };
            if routine.source < self.written && routine.is_proc && !self.called.contains(name) && !self.is_called(name)
            {
                self.routine(name, Scope::new(), CALLS);
            }
        }
    }

    /// Whether any routine has a statement that starts with this name.
    fn is_called(&self, name: &str) -> bool {
        self.symbols.routines.values().any(|routine| {
            let (bytes, tokens) = (&self.sources[routine.source].bytes, &self.modules[routine.source].tokens);
            routine.body.clone().any(|i| {
                let starts = i == routine.body.start || tokens[i - 1].kind == Kind::Mark(b';');
                starts && tokens[i].kind == Kind::Word && word(bytes, tokens.get(i)) == name
            })
        })
    }

    fn routine(&mut self, name: &str, scope: Scope, calls: usize) {
        if let Some(routine) = self.symbols.routines.get(name).filter(|_| calls > 0) {
            self.called.insert(name.to_owned());
            self.block(routine.source, routine.body.clone(), &scope, calls - 1);
        }
    }

    /// Statements in textual order; loops with known bounds are expanded, other branches are all read.
    fn block(&mut self, source: usize, range: Range<usize>, scope: &Scope, calls: usize) {
        let modules = self.modules;
        let sources = self.sources;
        let (bytes, tokens) = (&sources[source].bytes[..], &modules[source].tokens[..]);
        let mut at = range.start;
        while at < range.end && self.targets.len() < MOST {
            let token = tokens[at];
            if token.kind == Kind::Comment {
                self.comment(&bytes[token.span.range()]);
                at += 1;
                continue;
            }
            if token.kind != Kind::Word {
                at = if token.kind == Kind::Mark(b';') { at + 1 } else { statement_end(tokens, at, range.end) + 1 };
                if token.kind == Kind::Mark(b'%') {
                    self.late_bound(source, bytes, &tokens[..at.min(range.end)], token, scope, calls);
                }
                continue;
            }
            match word(bytes, Some(&token)).as_str() {
                "ERROR" | "UNDO" | "BACKWARD" => {
                    // Handlers run only when something fails.
                    return;
                }
                "FOR" => at = self.for_loop(source, at, range.end, scope, calls),
                "IF" | "ELSEIF" => {
                    let stop = statement_end(tokens, at, range.end);
                    let then = (at..stop).find(|&i| word(bytes, tokens.get(i)) == "THEN");
                    self.branches = true;
                    at = match then {
                        Some(then) => then + 1,
                        None => compact_if(bytes, tokens, at, stop),
                    };
                }
                "WHILE" => {
                    self.branches = true;
                    at = find_word(bytes, tokens, at, range.end, "DO") + 1;
                }
                "TEST" => {
                    self.branches = true;
                    at = find_word(bytes, tokens, at, range.end, "CASE");
                }
                "CASE" | "DEFAULT" => {
                    at = (at..range.end).find(|&i| tokens[i].kind == Kind::Mark(b':')).map_or(range.end, |i| i + 1);
                }
                "ELSE" | "ENDIF" | "ENDWHILE" | "ENDTEST" | "ENDFOR" | "DO" | "THEN" => at += 1,
                "VAR" | "PERS" | "CONST" => at = statement_end(tokens, at, range.end) + 1,
                name => {
                    let stop = statement_end(tokens, at, range.end);
                    // A label ends with a colon.
                    if tokens.get(at + 1).is_some_and(|t| t.kind == Kind::Mark(b':')) {
                        at += 2;
                        continue;
                    }
                    self.statement(source, at, stop, name, scope, calls);
                    for token in tokens[at..stop.min(range.end)].iter().filter(|t| t.kind == Kind::Comment) {
                        self.comment(&bytes[token.span.range()]);
                    }
                    at = stop + 1;
                }
            }
        }
    }

    /// `! deflex air`, `! deflex cut`: in force until the next mark that is run.
    fn comment(&mut self, text: &[u8]) {
        let text = upper(text);
        let mut words = text.trim_start_matches('!').split_whitespace();
        if words.next() == Some("DEFLEX") {
            match words.next() {
                Some("AIR") => self.mark = Some(Mark::Air),
                Some("CUT") => self.mark = Some(Mark::Cut),
                _ => {}
            }
        }
    }

    fn late_bound(&mut self, source: usize, bytes: &[u8], tokens: &[Token], first: Token, scope: &Scope, calls: usize) {
        let text = tokens.iter().find(|t| t.span.start > first.span.start && t.kind == Kind::Text);
        let name = text.map(|t| {
            let text = &bytes[t.span.range()];
            upper(text.get(1..text.len().saturating_sub(1)).unwrap_or_default())
        });
        let name = name.map(|n| n.rsplit(':').next().unwrap_or("").to_owned());
        match name.filter(|n| self.symbols.routines.contains_key(n)) {
            Some(name) => self.routine(&name, Scope::new(), calls),
            None => self.keep(source, first.span, "late-bound call of a routine that is not known"),
        }
        let _ = scope;
    }

    fn for_loop(&mut self, source: usize, at: usize, end: usize, scope: &Scope, calls: usize) -> usize {
        let modules = self.modules;
        let sources = self.sources;
        let (bytes, tokens) = (&sources[source].bytes[..], &modules[source].tokens[..]);
        let mut depth = 0;
        let close = (at..end)
            .find(|&i| {
                match word(bytes, tokens.get(i)).as_str() {
                    "FOR" => depth += 1,
                    "ENDFOR" => depth -= 1,
                    _ => {}
                }
                depth == 0
            })
            .unwrap_or(end);
        let body = find_word(bytes, tokens, at, close, "DO") + 1;
        let from = find_word(bytes, tokens, at, body, "FROM") + 1;
        let to = find_word(bytes, tokens, at, body, "TO") + 1;
        let step = find_word(bytes, tokens, at, body, "STEP") + 1;
        let names = Names { symbols: self.symbols, scope };
        let number = |from: usize, until: usize| {
            let mut cursor = Cursor { bytes, tokens: &tokens[..until.min(body)], at: from.min(until) };
            cursor.expr(0).and_then(|expr| names.number(&expr))
        };
        let to_end = if step < body { step - 1 } else { body - 1 };
        let bounds = (number(from, to.saturating_sub(1)), number(to, to_end));
        let variable = word(bytes, tokens.get(at + 1));
        if let (Some(first), Some(last)) = bounds {
            let default = if last >= first { 1.0 } else { -1.0 };
            let step = if step < body { number(step, body - 1).unwrap_or(0.0) } else { default };
            let count = if step == 0.0 { 0.0 } else { ((last - first) / step).floor() + 1.0 };
            let before = self.targets.len();
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
            for i in 0..count.clamp(0.0, MOST as f64) as usize {
                let mut inner = scope.clone();
                let value = Expr::Number { value: first + step * i as f64, token: None };
                inner.insert(variable.clone(), Bound { source, expr: value });
                self.block(source, body..close, &inner, calls);
                // A loop that moves nothing need not be turned.
                if self.targets.len() == before || self.targets.len() >= MOST {
                    break;
                }
            }
        } else {
            self.branches = true;
            self.block(source, body..close, scope, calls);
        }
        close + 1
    }

    fn statement(&mut self, source: usize, at: usize, stop: usize, name: &str, scope: &Scope, calls: usize) {
        let modules = self.modules;
        let sources = self.sources;
        let (bytes, tokens) = (&sources[source].bytes[..], &modules[source].tokens[..]);
        let last = tokens[stop.saturating_sub(1).max(at)].span;
        let span = tokens[at].span.to(last);
        match name {
            "PDISPON" | "PDISPSET" | "EOFFSON" | "EOFFSSET" => return self.displaced = true,
            "PDISPOFF" | "EOFFSOFF" => return self.displaced = false,
            _ => {}
        }
        let assigns = tokens.get(at + 1).is_some_and(|t| matches!(t.kind, Kind::Mark(ASSIGN | b'.' | b'{')));
        let shape = shape(name);
        let routine = self.symbols.routines.get(name);
        if assigns && shape.is_none() {
            return;
        }
        let mut cursor = Cursor { bytes, tokens: &tokens[..stop], at: at + 1 };
        let args = cursor.args(0, None);
        match (shape, args, routine) {
            (Some(_), None, _) => self.keep(source, span, "move not understood"),
            (Some(shape), Some(args), _) => self.motion(source, span, &shape, &args, scope),
            (None, Some(args), Some(routine)) if routine.is_proc => {
                let mut inner = Scope::new();
                let required: Vec<&String> = routine.parameters.iter().filter(|p| !p.starts_with('\\')).collect();
                let names = Names { symbols: self.symbols, scope };
                for (parameter, arg) in required.iter().zip(positional(&args)) {
                    if let Some(bound) = arg.value.as_ref().and_then(|value| bind(&names, source, value)) {
                        inner.insert((*parameter).clone(), bound);
                    }
                }
                for arg in args.iter().filter(|arg| arg.option.is_some()) {
                    if let (Some(name), Some(value)) = (&arg.option, &arg.value)
                        && let Some(bound) = bind(&names, source, value)
                    {
                        inner.insert(name.clone(), bound);
                    }
                }
                self.routine(name, inner, calls);
            }
            (None, None, Some(_)) => self.keep(source, span, "call not understood"),
            (None, Some(args), None) => {
                let names = Names { symbols: self.symbols, scope };
                let moves = positional(&args).any(|arg| {
                    let found = arg.value.as_ref().and_then(|value| names.follow(source, value).ok());
                    found.is_some_and(|found| is_robtarget(&names, found.expr))
                });
                if moves && !matches!(name, "STOREPATH" | "TPWRITE" | "RETURN") {
                    self.foreign(source, span, &args, scope);
                }
            }
            (None, None, None) => {}
            (None, Some(_), Some(_)) => {}
        }
    }

    /// A move instruction that nobody lists: its target, speed and tool are found by type.
    fn foreign(&mut self, source: usize, span: Span, args: &[Arg], scope: &Scope) {
        let names = Names { symbols: self.symbols, scope };
        let place = |of: &dyn Fn(&Expr) -> bool| positional(args).position(|arg| arg.value.as_ref().is_some_and(of));
        let to = place(&|e| names.follow(source, e).is_ok_and(|f| is_robtarget(&names, f.expr)));
        let tool = place(&|e| match e {
            Expr::Name { name, .. } => {
                name == "TOOL0" || self.symbols.data.get(name).is_some_and(|d| d.kind == "TOOLDATA")
            }
            _ => false,
        });
        let speed = place(&|e| self.speed(source, e, scope).is_some());
        match (to, tool) {
            (Some(to), Some(tool)) => {
                let shape = Shape {
                    motion: Motion::Linear,
                    via: None,
                    to,
                    speed: speed.unwrap_or(usize::MAX),
                    tool: Some(tool),
                };
                self.motion(source, span, &shape, args, scope);
            }
            _ => self.keep(source, span, "instruction not known to move, with a target"),
        }
    }

    fn keep(&mut self, source: usize, span: Span, reason: &'static str) {
        let line = self.lines.line(self.sources, source, span.start as usize);
        self.kept.push(Kept { source, span, line, reason });
    }

    fn motion(&mut self, source: usize, span: Span, shape: &Shape, args: &[Arg], scope: &Scope) {
        let at = |index: usize| positional(args).nth(index).and_then(|arg| arg.value.as_ref());
        let Some(to) = at(shape.to) else { return self.keep(source, span, "move without a target") };
        let tool = shape.tool.and_then(at);
        let tool = self.tool(source, tool, scope);
        let wobj = option(args, "WOBJ").and_then(|arg| arg.value.as_ref());
        let wobj = self.wobj(source, wobj, scope);
        let (Some(tool), Some(wobj)) = (tool, wobj) else {
            self.ordinal += 1;
            return self.keep(source, span, "tool or work object computed at run time");
        };
        let speed = option(args, "V")
            .and_then(|arg| arg.value.as_ref())
            .and_then(|value| Names { symbols: self.symbols, scope }.number(value));
        let timed = option(args, "T").is_some();
        let feed_mm_s = speed.or_else(|| at(shape.speed).and_then(|e| self.speed(source, e, scope))).filter(|_| !timed);
        self.ordinal += 1;
        if let Some(via) = shape.via.and_then(at) {
            self.target(source, span, via, shape.motion, Role::Via, (tool, wobj), feed_mm_s, scope);
            self.arcs += 1;
        }
        self.target(source, span, to, shape.motion, Role::End, (tool, wobj), feed_mm_s, scope);
    }

    #[allow(clippy::too_many_arguments)] // an instruction's parts, named at the only caller
    fn target(
        &mut self,
        source: usize,
        span: Span,
        expr: &Expr,
        motion: Motion,
        role: Role,
        (tool, wobj): (u16, u16),
        feed_mm_s: Option<f64>,
        scope: &Scope,
    ) {
        let names = Names { symbols: self.symbols, scope };
        let read = read_target(&names, source, expr, motion);
        let read = match read {
            Ok(read) => read,
            Err(reason) => return self.keep(source, span, reason),
        };
        let mut editable = read.editable;
        if self.displaced {
            editable = Editable::No("program displacement is active");
        }
        let (tool_data, wobj_data) = (self.tools[usize::from(tool)].data, self.wobjs[usize::from(wobj)].data);
        if tool_data.is_some_and(|t| !t.robhold) || wobj_data.is_some_and(|w| w.robhold) {
            editable = Editable::No("stationary tool");
        } else if wobj_data.is_some_and(|w| !w.fixed) {
            editable = Editable::No("work object moved by a mechanical unit");
        }
        let site = match read.site {
            Some(site) if site.source < self.written => self.site(site),
            Some(_) => {
                editable = Editable::No("declared in a context module");
                u32::MAX
            }
            None => u32::MAX,
        };
        let line = self.lines.line(self.sources, source, span.start as usize);
        if let Editable::No(reason) = editable {
            self.kept.push(Kept { source, span, line, reason });
        }
        self.layout.site_of.push(site);
        self.layout.to_arg.push(read.span);
        self.targets.push(Target {
            ordinal: self.ordinal,
            role,
            motion,
            goal: read.goal,
            tool,
            wobj,
            feed_mm_s,
            spindle_rpm: None,
            rapid: false,
            mark: self.mark,
            editable,
            name: read.name,
            source: u16::try_from(source).unwrap_or(u16::MAX),
            span,
            line: u32::try_from(line).unwrap_or(u32::MAX),
        });
    }

    fn site(&mut self, site: Site) -> u32 {
        let next = u32::try_from(self.layout.sites.len()).unwrap_or(u32::MAX);
        let index = *self.sites.entry((site.source, site.position[0].start)).or_insert(next);
        if index == next {
            self.layout.sites.push(site);
        }
        index
    }

    /// mm/s of a speed argument.
    fn speed(&self, source: usize, expr: &Expr, scope: &Scope) -> Option<f64> {
        let names = Names { symbols: self.symbols, scope };
        if let Expr::Name { name, indices, .. } = expr
            && indices.is_empty()
            && !self.symbols.data.contains_key(name)
            && !scope.contains_key(name)
        {
            return predefined_speed(name);
        }
        let found = names.follow(source, expr).ok()?;
        match found.expr {
            Expr::Name { name, .. } => predefined_speed(name),
            list => names.numbers::<4>(list).map(|speed| speed[0]),
        }
    }

    fn tool(&mut self, source: usize, expr: Option<&Expr>, scope: &Scope) -> Option<u16> {
        let (name, value) = self.record(source, expr, scope, "TOOL0")?;
        if let Some(index) = self.tools.iter().position(|t| t.name.eq_ignore_ascii_case(&name)) {
            return u16::try_from(index).ok();
        }
        let names = Names { symbols: self.symbols, scope };
        let data = match &value {
            Some(value) => Some(tooldata(&names, value)?),
            None if name.eq_ignore_ascii_case("tool0") => Some(TOOL0),
            None => None,
        };
        self.tools.push(Tool { name: name.into(), data });
        u16::try_from(self.tools.len() - 1).ok()
    }

    fn wobj(&mut self, source: usize, expr: Option<&Expr>, scope: &Scope) -> Option<u16> {
        let (name, value) = self.record(source, expr, scope, "wobj0")?;
        if let Some(index) = self.wobjs.iter().position(|w| w.name.eq_ignore_ascii_case(&name)) {
            return u16::try_from(index).ok();
        }
        let names = Names { symbols: self.symbols, scope };
        let data = match &value {
            Some(value) => Some(wobjdata(&names, value)?),
            None if name.eq_ignore_ascii_case("wobj0") => Some(WOBJ0),
            None => None,
        };
        self.wobjs.push(Wobj { name: name.into(), data });
        u16::try_from(self.wobjs.len() - 1).ok()
    }

    /// Name and initial value of a tool or work object argument; the value of an undeclared name is for the cell.
    fn record(
        &self,
        source: usize,
        expr: Option<&Expr>,
        scope: &Scope,
        default: &str,
    ) -> Option<(String, Option<Expr>)> {
        let (mut source, Some(mut expr)) = (source, expr) else { return Some((default.to_owned(), None)) };
        for _ in 0..4 {
            match expr {
                Expr::Name { name, indices, .. } if indices.is_empty() => match scope.get(name) {
                    Some(bound) => (source, expr) = (bound.source, &bound.expr),
                    None => break,
                },
                _ => break,
            }
        }
        match expr {
            Expr::Name { name, indices, span } if indices.is_empty() => match self.symbols.data.get(name) {
                Some(datum) if self.symbols.assigned.contains(name) => {
                    let _ = datum;
                    None
                }
                Some(datum) => Some((datum.name.clone(), Some(datum.value.clone()?))),
                None => Some((self.sources[source].text(*span).trim().to_owned(), None)),
            },
            _ => None,
        }
    }
}

/// Binds an argument to a parameter: what a name stands for at the call.
fn bind(names: &Names, source: usize, value: &Expr) -> Option<Bound> {
    match value {
        Expr::Name { name, indices, .. } => match names.scope.get(name) {
            Some(bound) if indices.is_empty() => Some(bound.clone()),
            _ => Some(Bound { source, expr: value.clone() }),
        },
        other => Some(Bound { source, expr: other.clone() }),
    }
}

fn find_word(bytes: &[u8], tokens: &[Token], from: usize, end: usize, wanted: &str) -> usize {
    (from..end).find(|&i| word(bytes, tokens.get(i)) == wanted).unwrap_or(end)
}

/// Start of the statement of a compact IF: the first word that follows a complete operand.
fn compact_if(bytes: &[u8], tokens: &[Token], at: usize, stop: usize) -> usize {
    let mut operand = false;
    let mut depth = 0usize;
    for i in at + 1..stop {
        match tokens[i].kind {
            Kind::Mark(b'(' | b'[' | b'{') => (depth, operand) = (depth + 1, false),
            Kind::Mark(b')' | b']' | b'}') => (depth, operand) = (depth.saturating_sub(1), true),
            Kind::Word => {
                let name = word(bytes, tokens.get(i));
                let operator = matches!(name.as_str(), "AND" | "OR" | "XOR" | "NOT" | "DIV" | "MOD");
                if operand && depth == 0 && !operator {
                    return i;
                }
                operand = !operator;
            }
            Kind::Number | Kind::Text => operand = true,
            _ => operand = false,
        }
    }
    stop
}

struct ReadTarget {
    goal: Goal,
    editable: Editable,
    site: Option<Site>,
    name: Option<Arc<str>>,
    span: Option<Span>,
}

fn read_target(names: &Names, source: usize, expr: &Expr, motion: Motion) -> Result<ReadTarget, &'static str> {
    let span = match expr {
        Expr::Name { span, .. } | Expr::Call { span, .. } => Some(*span),
        _ => None,
    };
    if let Expr::Call { name, args, .. } = expr {
        return match name.as_str() {
            "OFFS" | "RELTOOL" => offset(names, source, name, args),
            _ => Err("target computed at run time"),
        };
    }
    let found = names.follow(source, expr)?;
    let Expr::List(parts) = found.expr else {
        return match found.expr {
            Expr::Call { name, args, .. } if matches!(name.as_str(), "OFFS" | "RELTOOL") => {
                let mut read = offset(names, found.source, name, args)?;
                read.editable = Editable::No("target computed from another");
                read.site = None;
                Ok(read)
            }
            _ => Err("target computed at run time"),
        };
    };
    let declared: Option<Arc<str>> = found.name.map(Into::into);
    if motion == Motion::AbsoluteJoint {
        let deg = parts.first().and_then(|axes| names.numbers::<6>(axes)).ok_or("joint target not literal")?;
        let editable = Editable::No("joint target");
        return Ok(ReadTarget { goal: Goal::Joints { deg }, editable, site: None, name: declared, span });
    }
    let [trans, rot, conf, ext] = parts.as_slice() else { return Err("not a complete robtarget") };
    let position_mm = names.numbers::<3>(trans).ok_or("target not literal")?;
    let written = names.numbers::<4>(rot).ok_or("target not literal")?;
    let norm = written.iter().map(|q| q * q).sum::<f64>().sqrt();
    if norm.is_nan() || (norm - 1.0).abs() > 0.1 {
        return Err("orientation is not a unit quaternion");
    }
    #[allow(clippy::cast_possible_truncation)]
    let conf_values = names.numbers::<4>(conf).map(|c| c.map(|v| v.round() as i32));
    let conf_read = conf_values.map(|[cf1, cf4, cf6, cfx]| Conf { cf1, cf4, cf6, cfx });
    let track = names.numbers::<6>(ext).is_some_and(|axes| axes[0] != 0.0 && axes[0].abs() < UNUSED_AXIS);
    let literal = tokens::<3>(trans).zip(tokens::<4>(rot));
    let site = literal.map(|(position, quat)| Site {
        kind: SiteKind::Robtarget,
        source: found.source,
        position,
        quat: Some(quat),
        conf: tokens::<4>(conf),
        written_mm: position_mm,
        written_quat: written,
        base: None,
    });
    let editable = match &site {
        Some(_) if track => Editable::No("external axis in use"),
        Some(_) => Editable::Pose,
        None => Editable::No("target not literal"),
    };
    let quat = written.map(|q| q / norm);
    Ok(ReadTarget { goal: Goal::Pose { position_mm, quat, conf: conf_read }, editable, site, name: declared, span })
}

/// `Offs(p, dx, dy, dz)` and `RelTool(p, dx, dy, dz)`: evaluated; editable where the three numbers are literals.
fn offset(names: &Names, source: usize, name: &str, args: &[Arg]) -> Result<ReadTarget, &'static str> {
    let values: Vec<&Expr> = positional(args).filter_map(|arg| arg.value.as_ref()).collect();
    let [base, dx, dy, dz] = values.as_slice() else { return Err("target computed at run time") };
    let base = read_target(names, source, base, Motion::Linear)?;
    let Goal::Pose { position_mm, quat, conf } = base.goal else { return Err("target computed at run time") };
    let number = |expr: &Expr| names.number(expr).ok_or("target computed at run time");
    let d = [number(dx)?, number(dy)?, number(dz)?];
    let turned = ["RX", "RY", "RZ"].iter().any(|axis| option(args, axis).is_some());
    if turned {
        return Err("RelTool with a rotation");
    }
    let shift = if name == "OFFS" { d } else { super::turn(&quat, d) };
    let goal = Goal::Pose { position_mm: std::array::from_fn(|i| position_mm[i] + shift[i]), quat, conf };
    let list = Expr::List(vec![(*dx).clone(), (*dy).clone(), (*dz).clone()]);
    let site = tokens::<3>(&list).filter(|_| base.site.as_ref().is_some_and(|b| b.kind == SiteKind::Robtarget)).map(
        |position| Site {
            kind: if name == "OFFS" { SiteKind::Offs } else { SiteKind::RelTool },
            source,
            position,
            quat: None,
            conf: None,
            written_mm: d,
            written_quat: quat,
            base: base.site.as_ref().map(|b| (b.source, b.position[0].start)),
        },
    );
    let editable = if site.is_some() { Editable::Position } else { Editable::No("target computed from another") };
    Ok(ReadTarget { goal, editable, site, name: None, span: None })
}

fn is_robtarget(names: &Names, expr: &Expr) -> bool {
    let Expr::List(parts) = expr else { return false };
    let [trans, rot, conf, _] = parts.as_slice() else { return false };
    names.numbers::<3>(trans).is_some() && names.numbers::<4>(rot).is_some() && names.numbers::<4>(conf).is_some()
}

/// v5 … v7000; `None` for vmax and unknown names.
fn predefined_speed(name: &str) -> Option<f64> {
    const SPEEDS: [u32; 25] = [
        5, 10, 20, 30, 40, 50, 60, 80, 100, 150, 200, 300, 400, 500, 600, 800, 1000, 1500, 2000, 2500, 3000, 4000,
        5000, 6000, 7000,
    ];
    let speed: u32 = name.strip_prefix('V')?.parse().ok()?;
    SPEEDS.contains(&speed).then(|| f64::from(speed))
}

const TOOL0: ToolData =
    ToolData { robhold: true, tcp_mm: [0.0; 3], tcp_quat: [1.0, 0.0, 0.0, 0.0], mass_kg: 0.0, cog_mm: [0.0; 3] };
const WOBJ0: WobjData = WobjData {
    robhold: false,
    fixed: true,
    uframe_mm: [0.0; 3],
    uframe_quat: [1.0, 0.0, 0.0, 0.0],
    oframe_mm: [0.0; 3],
    oframe_quat: [1.0, 0.0, 0.0, 0.0],
};

fn frame(names: &Names, expr: &Expr) -> Option<([f64; 3], [f64; 4])> {
    let Expr::List(parts) = expr else { return None };
    let [position, quat] = parts.as_slice() else { return None };
    let quat = names.numbers::<4>(quat)?;
    let norm = quat.iter().map(|q| q * q).sum::<f64>().sqrt();
    (norm > 0.5).then_some(())?;
    Some((names.numbers::<3>(position)?, quat.map(|q| q / norm)))
}

fn tooldata(names: &Names, expr: &Expr) -> Option<ToolData> {
    let Expr::List(parts) = expr else { return None };
    let [Expr::Bool(robhold), tframe, Expr::List(load)] = parts.as_slice() else { return None };
    let (tcp_mm, tcp_quat) = frame(names, tframe)?;
    Some(ToolData {
        robhold: *robhold,
        tcp_mm,
        tcp_quat,
        mass_kg: names.number(load.first()?)?.max(0.0),
        cog_mm: names.numbers::<3>(load.get(1)?)?,
    })
}

fn wobjdata(names: &Names, expr: &Expr) -> Option<WobjData> {
    let Expr::List(parts) = expr else { return None };
    let [Expr::Bool(robhold), Expr::Bool(fixed), Expr::Text(_), uframe, oframe] = parts.as_slice() else { return None };
    let ((uframe_mm, uframe_quat), (oframe_mm, oframe_quat)) = (frame(names, uframe)?, frame(names, oframe)?);
    Some(WobjData { robhold: *robhold, fixed: *fixed, uframe_mm, uframe_quat, oframe_mm, oframe_quat })
}
