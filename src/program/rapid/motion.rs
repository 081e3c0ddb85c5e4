//! The motion instructions, and the positions of their arguments.

use super::lex::{Cursor, LexemeKind};
use super::literal::{Literal, Written};
use crate::program::Motion;
use crate::text::Span;

/// The positions of a motion's arguments, counted from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Shape {
    pub(super) motion: Motion,
    /// Circle point.
    pub(super) via: Option<usize>,
    /// The target; the speed follows it.
    pub(super) to: usize,
    pub(super) tool: ToolAt,
    /// The position of the zone.
    pub(super) zone: Zone,
    /// The instruction only moves: no signal, trigger, search, or procedure during the motion that could fail.
    pub(super) plain: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ToolAt {
    Index(usize),
    Last,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Zone {
    BeforeTool,
    Absent,
}

/// The shape of a known motion instruction; `None` for any other name.
pub(super) fn shape(name: &[u8]) -> Option<Shape> {
    let mut upper = [0_u8; 32];
    let upper = upper.get_mut(..name.len())?;
    upper.copy_from_slice(name);
    upper.make_ascii_uppercase();
    let upper: &[u8] = upper;
    if upper == b"MOVEABSJ" {
        let zone = Zone::BeforeTool;
        return Some(Shape {
            motion: Motion::AbsoluteJoint,
            via: None,
            to: 0,
            tool: ToolAt::Index(3),
            zone,
            plain: true,
        });
    }
    // A name is the family, the kind of motion, and what else the instruction does.
    const FAMILIES: [(&[u8], usize); 11] = [
        (b"EGMMOVE", 1),
        (b"MOVE", 0),
        (b"TRIGG", 0),
        (b"SEARCH", 2),
        (b"ARC", 0),
        (b"CAP", 0),
        (b"DISP", 0),
        (b"SPOTM", 0),
        (b"SPOT", 0),
        (b"PAINT", 0),
        (b"FCPRESS", 0),
    ];
    let (family, first) = FAMILIES.iter().find(|(f, _)| upper.starts_with(f) && upper.len() > f.len())?;
    let motion = match upper[family.len()] {
        b'L' => Motion::Linear,
        b'J' => Motion::Joint,
        b'C' => Motion::Circular,
        _ => return None,
    };
    let rest = &upper[family.len() + 1..];
    let known: &[&[u8]] = match *family {
        b"MOVE" => &[b"", b"DO", b"AO", b"GO", b"SYNC"],
        b"TRIGG" => &[b"", b"IOS"],
        b"SEARCH" | b"SPOT" | b"SPOTM" | b"EGMMOVE" | b"FCPRESS" | b"PAINT" => &[b""],
        _ => &[b"", b"START", b"END", b"1", b"2", b"1START", b"1END", b"2START", b"2END"],
    };
    if !known.contains(&rest) {
        return None;
    }
    let circular = motion == Motion::Circular;
    let to = first + usize::from(circular);
    let tool = match *family {
        b"MOVE" => ToolAt::Index(to + 3),
        _ if rest == b"IOS" => ToolAt::Index(to + 3),
        _ => ToolAt::Last,
    };
    let zone = if *family == b"SEARCH" { Zone::Absent } else { Zone::BeforeTool };
    let plain = *family == b"MOVE" && rest.is_empty();
    Some(Shape { motion, via: circular.then_some(*first), to, tool, zone, plain })
}

/// Most arguments of one instruction that are read.
pub(super) const MAX_ARGUMENTS: usize = 20;

/// A call, split into name and arguments.
#[derive(Clone, Copy, Debug)]
pub(super) struct Call {
    /// The procedure's name, or the expression between `%` and `%`.
    pub(super) name: Span,
    pub(super) late_bound: bool,
    positional: [Span; MAX_ARGUMENTS],
    pub(super) count: usize,
    optional: [(Span, Span); MAX_ARGUMENTS],
    optionals: usize,
    /// Complete robtarget literals among the positional arguments, at most two (a circle's).
    pub(super) literals: [Option<(usize, Literal, Written)>; 2],
}

impl Call {
    pub(super) fn positional(&self) -> &[Span] {
        &self.positional[..self.count]
    }

    /// The same call without its arguments.
    pub(super) fn without_arguments(&self) -> Self {
        Self { count: 0, optionals: 0, ..*self }
    }

    /// `\Name` or `\Name := value`; the value's span is empty without one.
    pub(super) fn optional(&self) -> &[(Span, Span)] {
        &self.optional[..self.optionals]
    }

    /// All arguments, by position or by name.
    pub(super) fn given(&self) -> impl Iterator<Item = Span> {
        self.positional().iter().copied().chain(self.optional().iter().map(|(_, value)| *value))
    }

    pub(super) fn option(&self, bytes: &[u8], name: &[u8]) -> Option<Span> {
        self.optional().iter().find(|(n, _)| bytes[n.range()].eq_ignore_ascii_case(name)).map(|o| o.1)
    }

    pub(super) fn literal(&self, index: usize) -> Option<&(usize, Literal, Written)> {
        self.literals.iter().flatten().find(|l| l.0 == index)
    }
}

/// A simple statement, split at its first level; deeper levels are read when needed.
pub(super) enum Simple {
    Call(Box<Call>),
    Assignment { target: Span, value: Span },
}

/// Splits a statement.
pub(super) fn split(bytes: &[u8], source: u16, span: Span) -> Option<Simple> {
    let mut cursor = Cursor::new(bytes, span);
    let first = cursor.next();
    let mut call = Call {
        name: first.span(),
        late_bound: false,
        positional: [Span::default(); MAX_ARGUMENTS],
        count: 0,
        optional: [(Span::default(), Span::default()); MAX_ARGUMENTS],
        optionals: 0,
        literals: [None; 2],
    };
    if first.kind == LexemeKind::Mark(b'%') {
        call.late_bound = true;
        let from = cursor.peek().start;
        cursor.behind = from;
        while !matches!(cursor.peek().kind, LexemeKind::Mark(b'%' | b';') | LexemeKind::End) {
            cursor.next();
        }
        call.name = Span::new(from, cursor.behind);
        cursor.accept(LexemeKind::Mark(b'%'))?;
    } else if first.kind != LexemeKind::Word {
        return None;
    } else {
        // `:=` after the name and its components makes an assignment.
        let start = cursor;
        let mut depth = 0_usize;
        loop {
            let lexeme = cursor.peek();
            match lexeme.kind {
                LexemeKind::Mark(b'{') => depth += 1,
                LexemeKind::Mark(b'}') => depth = depth.saturating_sub(1),
                LexemeKind::Assign if depth == 0 => {
                    let target = Span::new(first.start, cursor.behind);
                    cursor.pass(lexeme);
                    return Some(Simple::Assignment {
                        target,
                        value: Span::new(cursor.peek().start, end(bytes, span)),
                    });
                }
                LexemeKind::Mark(b'.') => {}
                LexemeKind::Word if depth > 0 || bytes.get(lexeme.start.wrapping_sub(1)) == Some(&b'.') => {}
                _ if depth > 0 && !matches!(lexeme.kind, LexemeKind::End | LexemeKind::Mark(b';')) => {}
                _ => break,
            }
            cursor.pass(lexeme);
        }
        cursor = start;
    }
    arguments(&mut cursor, source, &mut call)?;
    Some(Simple::Call(Box::new(call)))
}

/// The end of a statement without its `;`.
fn end(bytes: &[u8], span: Span) -> usize {
    let range = span.range();
    if bytes.get(range.end.wrapping_sub(1)) == Some(&b';') { range.end - 1 } else { range.end }
}

/// Splits arguments up to `;` or the closing bracket.
pub(super) fn arguments(cursor: &mut Cursor<'_>, source: u16, call: &mut Call) -> Option<()> {
    loop {
        let lexeme = cursor.peek();
        match lexeme.kind {
            LexemeKind::End | LexemeKind::Mark(b';' | b')') => return Some(()),
            LexemeKind::Mark(b',') => cursor.pass(lexeme),
            LexemeKind::Mark(b'\\') => {
                cursor.pass(lexeme);
                let name = cursor.accept(LexemeKind::Word)?;
                let value = match cursor.peek() {
                    l if l.kind == LexemeKind::Assign || l.kind == LexemeKind::Mark(b'?') => {
                        cursor.pass(l);
                        argument(cursor)
                    }
                    _ => Span::new(name.end, name.end),
                };
                *call.optional.get_mut(call.optionals)? = (name.span(), value);
                call.optionals += 1;
            }
            _ => {
                let slot = call.count;
                if lexeme.kind == LexemeKind::Mark(b'[')
                    && let Some((literal, written)) = Literal::read(cursor.bytes, source, lexeme.start)
                {
                    let span = literal.span();
                    (cursor.at, cursor.behind) = (span.end as usize, span.end as usize);
                    *call.positional.get_mut(slot)? = span;
                    if let Some(free) = call.literals.iter_mut().find(|l| l.is_none()) {
                        *free = Some((slot, literal, written));
                    }
                    // A literal is never part of an expression; anything that follows is skipped.
                    argument(cursor);
                } else {
                    let mut span = argument(cursor);
                    // `Name := value`: a positional argument with its name.
                    if cursor.peek().kind == LexemeKind::Assign {
                        cursor.next();
                        span = argument(cursor);
                    }
                    *call.positional.get_mut(slot)? = span;
                }
                call.count += 1;
            }
        }
    }
}

/// Passes one argument.
fn argument(cursor: &mut Cursor<'_>) -> Span {
    let start = cursor.peek().start;
    cursor.behind = start;
    let mut depth = 0_usize;
    loop {
        let lexeme = cursor.peek();
        match lexeme.kind {
            LexemeKind::End => break,
            LexemeKind::Mark(b'[' | b'(' | b'{') => depth += 1,
            LexemeKind::Mark(b']' | b')' | b'}') if depth == 0 => break,
            LexemeKind::Mark(b']' | b')' | b'}') => depth -= 1,
            LexemeKind::Mark(b',' | b';' | b'\\') | LexemeKind::Assign if depth == 0 => break,
            _ => {}
        }
        cursor.pass(lexeme);
    }
    Span::new(start, cursor.behind)
}

impl Call {
    /// An empty one, for the arguments of a function.
    pub(super) fn empty(name: Span) -> Self {
        Self {
            name,
            late_bound: false,
            positional: [Span::default(); MAX_ARGUMENTS],
            count: 0,
            optional: [(Span::default(), Span::default()); MAX_ARGUMENTS],
            optionals: 0,
            literals: [None; 2],
        }
    }
}
