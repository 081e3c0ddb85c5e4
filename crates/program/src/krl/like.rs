//! Lines that differ only in the numbers of their positions. One of them is read together with the program before it; of the others only
//! the numbers are read.

use super::Layout;
use super::lex;
use super::run::PositionTokens;
use super::syntax;
use super::tree::{Statement, StatementKind};
use super::value::{EXTERNAL, POSE, upper};
use crate::EXTERNAL_AXES;
use crate::orientation::quaternion_of_zyx_deg;
use crate::{Editable, ExternalAxes, Goal, Mark, Motion, Program, Role, Target, Tool, Wobj, intern};
use deflex_lang::ir::SourceSpan;
use deflex_text::{Diagnostic, Source, Span, number};
use std::sync::Arc;

/// Ends the text of a program of which only the beginning is read.
const END: &[u8] = b"\nEND\n";

/// First words of statements that may follow the last line. None of them jumps back, or changes the meaning of a line before.
const AFTER: [&[u8]; 8] = [b"PTP", b"LIN", b"SPTP", b"SLIN", b"HALT", b"WAIT", b"$OUT", b"$VEL"];

/// A kind of line.
#[derive(Debug)]
pub(super) struct Like {
    pub(super) lead: Lead,
    columns: Vec<Column>,
    /// The text after the last number.
    after: Vec<u8>,
    /// Length of the part of that text that belongs to the statement, bytes; the rest is a comment.
    code: usize,
    /// See [`Reader`].
    used: Axes,
    /// See [`PositionTokens::approximation_mm`].
    approximation_mm: Option<f64>,
    target: Target,
    tool: Tool,
    wobj: Wobj,
}

/// Settings that are in force at a line and are not written in it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Lead {
    /// The line that sets the speed; empty if the head sets it.
    pub(super) speed: Vec<u8>,
    pub(super) mark: Option<Mark>,
}

impl Lead {
    fn text(&self) -> Vec<u8> {
        let speed: &[u8] = if self.speed.is_empty() { b"" } else { b"\n" };
        let mark = self.mark.map_or(String::new(), |mark| format!("; {}\n", mark.comment()));
        [&self.speed, speed, mark.as_bytes()].concat()
    }
}

/// The meaning of a number in a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Number {
    /// One of X Y Z A B C, by its index.
    Pose(usize),
    /// An external axis, by its index.
    Axis(usize),
    /// `S` or `T`, which path motions ignore.
    Status,
}

/// The text before a number, without blanks at its ends, and the meaning of the number.
type Column = (Vec<u8>, Number);

/// The content of a line, as its numbers give it.
pub(super) struct Line {
    pub(super) goal: Goal,
    pub(super) site: PositionTokens,
    /// Offset at which its statement ends.
    pub(super) end: usize,
    /// External axes that it names, mm or degrees.
    axes: [Option<f64>; EXTERNAL_AXES],
}

/// The size of the part of a file before a line.
#[derive(Clone, Copy, Debug)]
pub(super) struct Before {
    /// Number of line ends.
    pub(super) lines: usize,
    /// Number of motions.
    pub(super) motions: u32,
}

/// Reads lines after a head.
#[derive(Debug, Default)]
pub(super) struct Reader {
    name: String,
    head: Vec<u8>,
    context: Vec<Source>,
    /// Motions, targets and numeric positions of the head.
    motions: usize,
    targets: usize,
    literals: usize,
    /// External axes that are in use from the first line on, in all of the program.
    used: Axes,
    /// Those that all lines name.
    named: Axes,
    /// Messages about the program as a whole, such as one about a tool without a load.
    messages: Vec<Diagnostic>,
}

pub(super) type Axes = [bool; EXTERNAL_AXES];

/// External axes that have a position other than zero at any target.
fn used(program: &Program) -> Axes {
    let moved = |axis: usize| {
        let at = |target: &Target| target.external.as_ref().and_then(|external| external.written[axis]);
        program.targets.iter().any(|target| at(target).is_some_and(|at| at != 0.0))
    };
    std::array::from_fn(moved)
}

/// Whether a line is an assignment like `$VEL.CP=0.05`, the only one that may be between the lines.
pub(super) fn is_speed(text: &[u8]) -> bool {
    const NAME: &[u8] = b"$VEL.CP";
    let Some(rest) = text.get(NAME.len()..).filter(|_| text[..NAME.len()].eq_ignore_ascii_case(NAME)) else {
        return false;
    };
    let value = rest.trim_ascii_start().strip_prefix(b"=").map(<[u8]>::trim_ascii);
    value.is_some_and(|value| value.first().is_some_and(u8::is_ascii_digit) && number::read(value).is_some())
}

impl Reader {
    /// The reader, and a program with the targets of the head. `None` if the head has more than one routine, jumps back, or has anything
    /// that is not known, or if the line after it is of no kind. `moving` are axes that are known to be in use after the head.
    pub(super) fn new(
        (name, head, context): (&str, &[u8], &[Source]),
        line: &[u8],
        moving: Axes,
    ) -> Option<(Self, Program)> {
        let file = syntax::parse(&Source::new(name, head), 0).ok()?;
        let [routine] = &file.routines[..] else { return None };
        let goes_back = |of: &&Statement| {
            matches!(of.kind, StatementKind::Jump(_) | StatementKind::Resume | StatementKind::Trigger(_))
        };
        if routine.statements().iter().any(goes_back) {
            return None;
        }
        let (name, head, context) = (name.to_owned(), head.to_vec(), context.to_vec());
        let mut reader = Self { name, head, context, used: moving, ..Self::default() };
        let first = reader.read(&[line, END])?;
        reader.messages.clone_from(&first.diagnostics);
        let mut program =
            reader.program(&[END]).filter(|_| reader.messages.iter().all(|diagnostic| diagnostic.line == 0))?;
        program.diagnostics.clone_from(&reader.messages);
        (reader.motions, reader.targets) = (program.motion_targets(), program.targets.len());
        reader.literals = program.literal_targets;
        reader.used = std::array::from_fn(|axis| moving[axis] || used(&first)[axis]);
        let last = first.targets.last().and_then(|last| last.external.as_ref());
        reader.named = last.map_or([false; EXTERNAL_AXES], |last| last.written.map(|written| written.is_some()));
        // An axis that is in use after the head is so in it.
        for (target, other) in program.targets.iter_mut().zip(reader.program(&[line, END])?.targets) {
            target.external = other.external;
        }
        reader.like(&Lead::default(), line)?;
        Some((reader, program))
    }

    pub(super) fn name(&self) -> &str {
        &self.name
    }

    pub(super) fn head(&self) -> &[u8] {
        &self.head
    }

    /// Whether a line names an axis that none is known to move.
    pub(super) fn has_axes_at_rest(&self) -> bool {
        self.named.iter().zip(self.used).any(|(named, used)| *named && !used)
    }

    /// Whether no other axes are in use in a program than are known to be.
    fn knows_axes_of(&self, program: &Program) -> bool {
        used(program).iter().zip(self.used).all(|(used, known)| known || !used)
    }

    /// The program that consists of the head and these parts; `None` if anything in it is not known, or if it has messages that the
    /// program as a whole does not have.
    fn program(&self, parts: &[&[u8]]) -> Option<Program> {
        let is_of_program = |diagnostic: &Diagnostic| self.messages.contains(diagnostic);
        self.read(parts).filter(|program| program.diagnostics.iter().all(is_of_program))
    }

    /// The program that consists of the head and these parts; `None` if anything in it is not known.
    fn read(&self, parts: &[&[u8]]) -> Option<Program> {
        let text = [&[&self.head[..]][..], parts].concat().concat();
        let mut program = super::read(vec![Source::new(self.name.clone(), text)], self.context.clone()).ok()?;
        for axes in program.targets.iter_mut().filter_map(|target| target.external.as_mut()) {
            if axes.at_rest.iter().zip(self.used).any(|(at_rest, used)| *at_rest && used) {
                let at_rest = std::array::from_fn(|axis| axes.at_rest[axis] && !self.used[axis]);
                *axes = Arc::new(ExternalAxes { at_rest, ..(**axes).clone() });
            }
        }
        let elsewhere = std::mem::take(&mut layout(&mut program)?.runs_elsewhere);
        let is_elsewhere = |target: &Target| elsewhere.contains(&(target.source, target.span.start));
        let known = program.kept.is_empty() && program.unknown.is_empty() && !program.targets.iter().any(is_elsewhere);
        Some(program).filter(|_| known)
    }

    /// The kind of a line after this speed and mark.
    pub(super) fn like(&self, lead: &Lead, line: &[u8]) -> Option<Like> {
        let before = lead.text();
        let mut program = self.program(&[&before, line, END]).filter(|program| self.knows_axes_of(program))?;
        if program.motion_targets() != self.motions + 1 || program.targets.len() != self.targets + 1 {
            return None;
        }
        let site = *layout(&mut program)?.sites.last()?;
        let target = program.targets.pop()?;
        let plain = target.motion == Motion::Linear && target.role == Role::End && target.editable == Editable::Pose;
        let start = self.head.len() + before.len() + (line.len() - line.trim_ascii_start().len());
        let text = line.trim_ascii();
        // A mark in the same line would hold for the lines after it.
        let marked = lex::lines(line).any(|line| line.mark.is_some());
        if !plain || marked || target.span.start as usize != start || target.name.is_some() {
            return None;
        }
        let (columns, at) = columns(text)?;
        let after = text[at..].to_vec();
        let code = (target.span.end as usize).checked_sub(start + at)?;
        let tool = program.tools.get(usize::from(target.tool))?.clone();
        let wobj = program.wobjs.get(usize::from(target.wobj))?.clone();
        let (used, approximation_mm) = (self.used, site.approximation_mm);
        let like = Like { lead: lead.clone(), columns, after, code, used, approximation_mm, target, tool, wobj };
        // A line takes an axis that it does not name from the line before it, which may be of another kind.
        let names = |axis: usize| like.columns.iter().any(|(_, number)| *number == Number::Axis(axis));
        let has = |axis: usize| like.target.external.as_ref().is_some_and(|axes| axes.written[axis].is_some());
        let whole = (0..EXTERNAL_AXES).all(|axis| [names(axis), has(axis)] == [self.named[axis]; 2]);
        let again = like.read(text, start)?;
        let same = again.goal == like.target.goal
            && again.site.tokens == site.tokens
            && again.end == like.target.span.end as usize
            && like.external(&again, &None) == like.target.external;
        Some(like).filter(|_| same && whole)
    }

    /// The targets after the last line of a program, which is of this kind, and the offset in the source of these targets at which the
    /// text after that line begins. `before` is the part of the file up to the end of that line.
    pub(super) fn tail(&self, like: &Like, line: &[u8], after: &[u8], before: Before) -> Option<(Program, usize)> {
        let mut ended = false;
        for line in lex::lines(after) {
            let code = &after[line.code.range()];
            let name = |byte: &u8| byte.is_ascii_alphanumeric() || matches!(byte, b'_' | b'$');
            let word = &code[..code.iter().position(|byte| !name(byte)).unwrap_or(code.len())];
            let known = AFTER.iter().any(|known| word.eq_ignore_ascii_case(known));
            if ended && !code.is_empty() || !(known || code.is_empty() || code.eq_ignore_ascii_case(b"END")) {
                return None;
            }
            ended |= word.eq_ignore_ascii_case(b"END");
        }
        // The text after the last line begins on a line of its own.
        let begun: &[u8] = if line.ends_with(b"\n") { b"" } else { b"\n" };
        let lead = like.lead.text();
        let mut program = self.program(&[&lead, line, begun, after])?;
        let from = self.head.len() + lead.len() + line.len() + begun.len();
        let mut source = program.sources[0].clone();
        source.lines_before = before.lines.checked_sub(line_ends(&source.bytes[..from]))?;
        let (of_head, motions_of_head) = (self.targets + 1, self.motions + 1);
        program.literal_targets = program.literal_targets.checked_sub(self.literals + 1)?;
        let layout = layout(&mut program)?;
        let sites = layout.sites.split_off(of_head);
        let begins = |place: &SourceSpan| place.span.start as usize >= from;
        if !sites.iter().flat_map(|site| &site.tokens).flatten().all(begins) {
            return None;
        }
        *layout = Layout { sites, motions: layout.motions.checked_sub(motions_of_head)?, ..Layout::default() };
        let is_known = self.knows_axes_of(&program);
        let mut targets = program.targets.split_off(of_head);
        let last = program.targets.pop().filter(|last| last.editable == Editable::Pose)?;
        let own = like.read(line.trim_ascii(), 0).filter(|_| is_known)?;
        if last.external != like.external(&own, &None) {
            return None;
        }
        for target in &mut targets {
            target.line = target.line.checked_add(source.lines_before.try_into().ok()?)?;
            target.ordinal = (target.ordinal as usize).checked_sub(motions_of_head)?.try_into().ok()?;
            target.ordinal = target.ordinal.checked_add(before.motions)?;
        }
        (program.targets, program.sources) = (targets, [source].into());
        Some((program, from))
    }
}

impl Like {
    /// Whether a line, without blanks at its ends, begins and ends like the lines of this kind. Its numbers are checked when it is read.
    pub(super) fn looks_like(&self, text: &[u8]) -> bool {
        text.starts_with(&self.columns[0].0) && text.ends_with(&self.after)
    }

    /// Whether a line, without blanks at its ends, is of this kind.
    pub(super) fn fits(&self, text: &[u8]) -> bool {
        let mut is_known = true;
        let known = |number, _, (value, _)| {
            is_known &= !matches!(number, Number::Axis(axis) if value != 0.0 && !self.used[axis]);
        };
        text.ends_with(&self.after) && self.numbers(text, known).is_some() && is_known
    }

    pub(super) fn target(&self) -> &Target {
        &self.target
    }

    /// Numbers of its tool and its base among those of a program.
    pub(super) fn frames(&self, tools: &mut Vec<Tool>, wobjs: &mut Vec<Wobj>) -> Option<[u16; 2]> {
        Some([intern(tools, &self.tool, Tool::is)?, intern(wobjs, &self.wobj, Wobj::is)?])
    }

    /// Reads a line of this kind, without blanks at its ends, that begins at this offset.
    pub(super) fn read(&self, text: &[u8], start: usize) -> Option<Line> {
        let (mut numbers, mut axes) = ([0.0; 6], [None; EXTERNAL_AXES]);
        let mut site = PositionTokens { approximation_mm: self.approximation_mm, ..PositionTokens::default() };
        let each = |number, at: usize, (value, len)| match number {
            Number::Pose(component) => {
                numbers[component] = value;
                site.tokens[component] = Some(SourceSpan { source: 0, span: Span::new(start + at, start + at + len) });
            }
            Number::Axis(axis) => axes[axis] = Some(value),
            Number::Status => {}
        };
        let end = self.numbers(text, each)?;
        // An axis that begins to move here was taken as resting in all lines before.
        if axes.iter().zip(self.used).any(|(at, used)| !used && at.is_some_and(|at| at != 0.0)) {
            return None;
        }
        let [x, y, z, a, b, c] = numbers;
        let quat = quaternion_of_zyx_deg([a, b, c]);
        let goal = Goal::Pose { position_mm: [x, y, z], quat, conf: None };
        Some(Line { goal, site, end: start + end + self.code, axes })
    }

    /// External axes of a line of this kind, if the line before it has the axes `before`.
    pub(super) fn external(&self, line: &Line, before: &Option<Arc<ExternalAxes>>) -> Option<Arc<ExternalAxes>> {
        let own = self.target.external.as_ref()?;
        let written: [Option<f64>; EXTERNAL_AXES] = std::array::from_fn(|axis| line.axes[axis].or(own.written[axis]));
        let same = |other: &&Arc<ExternalAxes>| other.written == written && other.at_rest == own.at_rest;
        let known = [Some(own), before.as_ref()].into_iter().flatten().find(same).cloned();
        Some(known.unwrap_or_else(|| Arc::new(ExternalAxes { written, ..(**own).clone() })))
    }

    /// Calls `each` with the meaning, the offset, the value and the length of each number in a line of this kind. Returns the offset at which
    /// the last one ends.
    fn numbers(&self, text: &[u8], mut each: impl FnMut(Number, usize, (f64, usize))) -> Option<usize> {
        let mut at = 0;
        for (before, number) in &self.columns {
            at += blanks(&text[at..]);
            let after = text[at..].strip_prefix(&before[..])?;
            at = text.len() - after.len() + blanks(after);
            let value = number.value(&text[at..])?;
            each(*number, at, value);
            at += value.1;
        }
        (text[at..] == self.after[..]).then_some(at)
    }
}

/// The numbers of the position in a line, and the offset at which the last of them ends; `None` if the position has anything else.
fn columns(text: &[u8]) -> Option<(Vec<Column>, usize)> {
    let (mut found, mut at, mut name) = (Vec::new(), 0, memchr::memchr(b'{', text)? + 1);
    loop {
        name += blanks(&text[name..]);
        let end = name + text[name..].iter().position(|byte| !byte.is_ascii_alphanumeric())?;
        let word = upper(&text[name..end]);
        let place = |names: [&[u8]; 6]| names.iter().position(|known| word[..] == **known);
        let number = match &word[..] {
            b"S" | b"T" => Number::Status,
            _ => place(POSE).map(Number::Pose).or_else(|| place(EXTERNAL).map(Number::Axis))?,
        };
        found.push((text[at..end].trim_ascii().to_vec(), number));
        let value = end + blanks(&text[end..]);
        at = value + number.value(&text[value..])?.1;
        name = at + blanks(&text[at..]) + 1;
        match text[name - 1..].first()? {
            b'}' => return Some((found, at)),
            b',' => {}
            _ => return None,
        }
    }
}

/// Adds the external axes that a line, up to its comment, has elsewhere than at zero.
pub(super) fn moved_axes(line: &[u8], found: &mut Axes) {
    let code = &line[..memchr::memchr(b';', line).unwrap_or(line.len())];
    for at in memchr::memchr2_iter(b'E', b'e', code) {
        let axis =
            EXTERNAL.iter().position(|name| code[at..].get(..2).is_some_and(|own| own.eq_ignore_ascii_case(name)));
        let begins = at > 0 && matches!(code[at - 1], b',' | b' ' | b'\t' | b'{');
        let (Some(axis), true) = (axis, begins) else { continue };
        let value = &code[at + 2..];
        let number = number::read_leading(&value[blanks(value)..]);
        found[axis] |= number.is_some_and(|number| number.value != 0.0);
    }
}

impl Number {
    /// The value at the beginning of a text, and the length of its token.
    fn value(self, text: &[u8]) -> Option<(f64, usize)> {
        // `'B00010110'`
        let binary = text.strip_prefix(b"'B").filter(|_| self == Self::Status);
        if let Some(digits) = binary {
            let len = digits.iter().take_while(|digit| matches!(digit, b'0' | b'1')).count();
            return (digits.get(len) == Some(&b'\'') && len > 0).then_some((0.0, len + 3));
        }
        let number = number::read_leading(text)?;
        let next = text.get(number.len());
        let other = next.is_some_and(|next| next.is_ascii_alphanumeric() || matches!(next, b'.' | b'_'));
        (!other).then_some((number.value, number.len()))
    }
}

pub(super) fn line_ends(text: &[u8]) -> usize {
    memchr::memchr_iter(b'\n', text).count()
}

fn blanks(text: &[u8]) -> usize {
    text.iter().take_while(|byte| byte.is_ascii_whitespace()).count()
}

/// The places of the numbers of a KRL program; `None` for a program in another language.
pub(super) fn layout(program: &mut Program) -> Option<&mut Layout> {
    match &mut program.layout {
        crate::Layout::Krl(layout) => Some(layout),
        _ => None,
    }
}
