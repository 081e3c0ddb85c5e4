//! Parts that the parsers of all languages share: a cursor over the lexemes of a text, and operators with levels of precedence.

use crate::Span;
use crate::ir::{
    Binary, Callee, Expression, ExpressionKind, Fault, FunctionId, Program, Slot, SourceSpan, Statement, StatementKind,
    Switch,
};
use crate::lexeme::{Lexeme, LexemeKind};
use crate::reason::Reason;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Deepest nesting of blocks; with the expressions in them it is twice that. This is far beyond any program, and within any stack.
const DEEPEST: usize = 64;

/// Operators of one level of precedence, as they are written.
pub(crate) type Level = &'static [(&'static str, Binary)];

/// The operators of sums.
pub(crate) const SUM: Level = &[("+", Binary::Add), ("-", Binary::Subtract)];

/// A cursor over lexemes, with the program that is built from them and the state of the parser of a language.
pub(crate) struct Cursor<'a, 'n, L> {
    pub(crate) own: L,
    pub(crate) lexemes: &'n [Lexeme<'a>],
    pub(crate) at: usize,
    pub(crate) source: u16,
    /// Number of open blocks and expressions.
    pub(crate) depth: usize,
    pub(crate) program: Program,
    pub(crate) called: BTreeSet<FunctionId>,
    foreign: BTreeSet<Arc<str>>,
}

impl<'a, L> Cursor<'a, '_, L> {
    pub(crate) fn new(own: L, program: Program) -> Self {
        let (called, foreign) = (BTreeSet::new(), BTreeSet::new());
        Self { own, lexemes: &[], at: 0, source: 0, depth: 0, program, called, foreign }
    }

    pub(crate) fn peek(&self) -> Option<Lexeme<'a>> {
        self.lexemes.get(self.at).copied()
    }

    pub(crate) fn next_is(&self, text: &str) -> bool {
        self.peek().is_some_and(|lexeme| lexeme.is(text))
    }

    /// Whether the lexeme after the next one is this one.
    pub(crate) fn second_is(&self, text: &str) -> bool {
        self.lexemes.get(self.at + 1).is_some_and(|lexeme| lexeme.is(text))
    }

    pub(crate) fn take(&mut self, text: &str) -> bool {
        let is = self.next_is(text);
        self.at += usize::from(is);
        is
    }

    /// Reads this name or sign; `None` if another lexeme is next.
    pub(crate) fn expect(&mut self, text: &str) -> Option<()> {
        self.take(text).then_some(())
    }

    /// Reads the next lexeme if it is a name.
    pub(crate) fn take_name(&mut self) -> Option<Lexeme<'a>> {
        let name = self.peek().filter(|lexeme| lexeme.kind == LexemeKind::Name);
        self.at += usize::from(name.is_some());
        name
    }

    /// Whether all lexemes are read.
    pub(crate) fn is_over(&self) -> bool {
        self.at >= self.lexemes.len()
    }

    /// The place of the next lexeme, or the end of the last one.
    pub(crate) fn here(&self) -> Span {
        let last = || self.lexemes.last().map_or(Span::default(), |l| Span { start: l.span.end, end: l.span.end });
        self.peek().map_or_else(last, |lexeme| lexeme.span)
    }

    pub(crate) fn place(&self, span: Span) -> SourceSpan {
        SourceSpan { source: self.source, span }
    }

    /// The place from a lexeme to the last one that was read.
    pub(crate) fn since(&self, start: Span) -> SourceSpan {
        let last = self.lexemes.get(self.at.wrapping_sub(1)).map_or(start, |lexeme| lexeme.span);
        self.place(if last.end < start.end { start } else { start.to(last) })
    }

    /// An expression with the place from a lexeme to the last one that was read.
    pub(crate) fn expression_at(&self, kind: ExpressionKind, start: Span) -> Expression {
        Expression { kind, place: self.since(start) }
    }

    /// An expression that is known only at run time.
    pub(crate) fn unknown(&self, reason: Reason, start: Span) -> Expression {
        Expression::unknown(reason, Vec::new(), self.since(start))
    }

    /// A number literal with its sign. If its value cannot be represented, it is unknown for the reason `unreadable`.
    pub(crate) fn number(&mut self, sign: Option<Span>, lexeme: Lexeme<'_>, unreadable: Reason) -> Expression {
        let place = self.place(sign.map_or(lexeme.span, |sign| sign.to(lexeme.span)));
        let sign: &[u8] = if sign.is_some() { b"-" } else { b"" };
        self.program.literal(&[sign, lexeme.text].concat(), place, unreadable)
    }

    /// The statement of a comment `deflex air`, with the word after `deflex`.
    pub(crate) fn mark(&self, said: &[u8], span: Span) -> Statement {
        let place = self.place(span);
        let value = Expression { kind: ExpressionKind::Text(said.to_ascii_lowercase().into()), place };
        Statement { kind: StatementKind::assign(Switch::Mark.slot(), value), place }
    }

    /// Begins a block at `place`.
    pub(crate) fn begin_block(&mut self, place: SourceSpan) -> Result<(), Fault> {
        if self.depth >= DEEPEST {
            return Err(Fault { place, message: "blocks are nested deeper than 64" });
        }
        self.depth += 1;
        Ok(())
    }

    /// A call of a routine that no source has and the language does not define.
    pub(crate) fn foreign(&mut self, name: Arc<str>, place: SourceSpan) -> Callee {
        if self.foreign.insert(Arc::clone(&name)) {
            self.program.foreign.push((name, place));
        }
        Callee::Foreign
    }

    /// Reads a part of an expression; `None` if it is nested too deep.
    pub(crate) fn inner<T>(&mut self, read: impl FnOnce(&mut Self) -> Option<T>) -> Option<T> {
        self.depth += 1;
        let inner = if self.depth < 2 * DEEPEST { read(self) } else { None };
        self.depth -= 1;
        inner
    }

    /// Reads operands with operators of these levels, the loosest first. Each level is read from left to right.
    pub(crate) fn binary(
        &mut self,
        levels: &[Level],
        operand: fn(&mut Self) -> Option<Expression>,
    ) -> Option<Expression> {
        let Some((operators, tighter)) = levels.split_first() else { return operand(self) };
        if self.depth >= 2 * DEEPEST {
            return None;
        }
        let start = self.here();
        let mut left = self.binary(tighter, operand)?;
        while let Some((_, operator)) = operators.iter().find(|(sign, _)| self.next_is(sign)) {
            self.at += 1;
            let right = self.binary(tighter, operand)?;
            left = self.expression_at(ExpressionKind::Binary(*operator, Box::new([left, right])), start);
        }
        Some(left)
    }
}

/// Gives a global variable a slot, after those of [`Switch`], if it has none.
pub(crate) fn declare<K: Ord>(globals: &mut BTreeMap<K, Slot>, name: K) {
    let next = Slot::Global((Switch::ALL.len() + globals.len()) as u32);
    globals.entry(name).or_insert(next);
}

/// The names of all global variables by their slots, those of [`Switch`] first.
pub(crate) fn global_names<K>(globals: &BTreeMap<K, Slot>, name: impl Fn(&K) -> Arc<str>) -> Vec<Arc<str>> {
    let named: BTreeMap<Slot, Arc<str>> = globals.iter().map(|(key, slot)| (*slot, name(key))).collect();
    Switch::ALL.iter().map(|switch| Arc::from(format!("{switch:?}"))).chain(named.into_values()).collect()
}

/// The bytes as text.
pub(crate) fn text(bytes: &[u8]) -> Arc<str> {
    String::from_utf8_lossy(bytes).into()
}
