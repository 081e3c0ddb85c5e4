//! Splits the text into lexemes, one line at a time, because a statement ends with its line.

use crate::Mark;
use crate::lexeme::{self, Bytes, Found, decimal};
use deflex_text::Span;
use nom::Parser;
use nom::bytes::complete::{take_till, take_while};
use nom::character::complete::one_of;
use nom::combinator::recognize;

/// The kind of a lexeme.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LexemeKind {
    /// Name, reserved word or system variable.
    Word,
    /// Unsigned number: the sign is an operator.
    Number,
    /// `"…"`.
    Text,
    /// `'B0101'`, `'H1F'`, `'D12'`.
    Bits,
    /// `==`
    Equal,
    /// `<>`
    Unequal,
    /// `<=`
    AtMost,
    /// `>=`
    AtLeast,
    /// Any other printable character.
    Mark(u8),
    /// A byte that KRL does not use, or a string without an end.
    Junk,
    /// The end of the line.
    End,
}

pub(super) type Lexeme = lexeme::Lexeme<LexemeKind>;

/// Blank within a line.
fn is_blank(byte: u8) -> bool {
    byte <= b' ' || matches!(byte, 0x7F | 0xA0)
}

fn is_word(byte: u8) -> bool {
    byte.is_ascii_alphanumeric() || matches!(byte, b'_' | b'$') || byte >= 0xC0
}

/// The text up to the same quote on the line.
fn quoted(input: Bytes<'_>) -> Found<'_> {
    let quote = input[0];
    recognize((one_of("\"'"), take_till(|b| b == quote), one_of("\"'"))).parse(input)
}

/// Kind and length of the lexeme at the start of `input`, after blanks. The length is 0 only at the end.
fn lexeme(input: Bytes<'_>) -> (LexemeKind, usize) {
    let Some(&first) = input.first() else { return (LexemeKind::End, 0) };
    let taken =
        |kind: LexemeKind, found: Found<'_>| found.map_or((LexemeKind::Junk, 1), |(_, part)| (kind, part.len()));
    match first {
        b'0'..=b'9' => taken(LexemeKind::Number, decimal(input)),
        b'.' if input.get(1).is_some_and(u8::is_ascii_digit) => taken(LexemeKind::Number, decimal(input)),
        _ if is_word(first) => taken(LexemeKind::Word, take_while(is_word).parse(input)),
        b'"' => taken(LexemeKind::Text, quoted(input)),
        b'\'' => taken(LexemeKind::Bits, quoted(input)),
        b'=' if input.get(1) == Some(&b'=') => (LexemeKind::Equal, 2),
        b'<' if input.get(1) == Some(&b'>') => (LexemeKind::Unequal, 2),
        b'<' if input.get(1) == Some(&b'=') => (LexemeKind::AtMost, 2),
        b'>' if input.get(1) == Some(&b'=') => (LexemeKind::AtLeast, 2),
        b'!'..=b'~' => (LexemeKind::Mark(first), 1),
        _ => (LexemeKind::Junk, 1),
    }
}

/// A cursor over the lexemes of a span, which is mostly one line.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cursor<'a> {
    pub(super) bytes: &'a [u8],
    /// Index of the source.
    pub(super) source: u16,
    at: usize,
    end: usize,
    /// Number of open brackets.
    pub(super) depth: usize,
}

impl<'a> Cursor<'a> {
    pub(super) fn new(bytes: &'a [u8], source: u16, span: Span) -> Self {
        let range = span.range();
        Self { bytes, source, at: range.start, end: range.end.min(bytes.len()), depth: 0 }
    }

    /// A cursor over another part of the same text.
    pub(super) fn within(&self, span: Span) -> Self {
        Self { at: span.start as usize, end: span.end as usize, ..*self }
    }

    /// The rest of the span.
    pub(super) fn rest(&self) -> Span {
        Span::new(self.at.min(self.end), self.end)
    }

    /// The next lexeme; the cursor does not move.
    pub(super) fn peek(&self) -> Lexeme {
        let rest = &self.bytes[self.at.min(self.end)..self.end];
        let start = self.at + rest.iter().position(|b| !is_blank(*b)).unwrap_or(rest.len());
        let (kind, len) = lexeme(&self.bytes[start..self.end]);
        Lexeme { kind, start, end: start + len }
    }

    /// Returns the next lexeme and moves after it.
    pub(super) fn next(&mut self) -> Lexeme {
        let lexeme = self.peek();
        self.at = lexeme.end;
        lexeme
    }

    /// Moves after the next lexeme and returns it, if it is of this kind.
    pub(super) fn accept(&mut self, kind: LexemeKind) -> Option<Lexeme> {
        let lexeme = self.peek();
        (lexeme.kind == kind).then(|| {
            self.at = lexeme.end;
            lexeme
        })
    }

    pub(super) fn accept_mark(&mut self, mark: u8) -> bool {
        self.accept(LexemeKind::Mark(mark)).is_some()
    }

    /// Moves after `[…]` if that is next. Returns whether it was.
    pub(super) fn accept_brackets(&mut self) -> bool {
        let is = self.accept_mark(b'[');
        while is && !self.is_done() && !self.accept_mark(b']') {
            self.next();
        }
        is
    }

    /// Whether the next lexeme is this word.
    pub(super) fn is_at(&self, word: &[u8]) -> bool {
        let lexeme = self.peek();
        lexeme.kind == LexemeKind::Word && self.text(lexeme).eq_ignore_ascii_case(word)
    }

    /// Moves after the next lexeme if it is this word. Returns whether it was.
    pub(super) fn accept_word(&mut self, word: &[u8]) -> bool {
        let is = self.is_at(word);
        if is {
            self.next();
        }
        is
    }

    pub(super) fn is_done(&self) -> bool {
        self.peek().kind == LexemeKind::End
    }

    pub(super) fn text(&self, lexeme: Lexeme) -> &'a [u8] {
        &self.bytes[lexeme.start..lexeme.end]
    }

    /// Moves to the first of these words outside of brackets. Returns the text before it, and which word it is.
    pub(super) fn until(&mut self, words: &[&[u8]]) -> (Span, Option<usize>) {
        let start = self.at;
        let mut depth = 0_usize;
        loop {
            let lexeme = self.peek();
            match lexeme.kind {
                LexemeKind::End => {
                    self.at = self.end;
                    return (Span::new(start, self.end), None);
                }
                LexemeKind::Mark(b'{' | b'(' | b'[') => depth += 1,
                LexemeKind::Mark(b'}' | b')' | b']') => depth = depth.saturating_sub(1),
                LexemeKind::Word if depth == 0 => {
                    let text = self.text(lexeme);
                    if let Some(which) = words.iter().position(|word| text.eq_ignore_ascii_case(word)) {
                        self.at = lexeme.end;
                        return (Span::new(start, lexeme.start), Some(which));
                    }
                }
                _ => {}
            }
            self.at = lexeme.end;
        }
    }
}

/// A line: its code without blanks at the ends, and the mark in its comment.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line {
    pub(super) code: Span,
    pub(super) mark: Option<Mark>,
}

/// The lines of a file that have code or a mark.
pub(super) fn lines(bytes: &[u8]) -> impl Iterator<Item = Line> {
    let mut at = if bytes.starts_with(b"\xEF\xBB\xBF") { 3 } else { 0 };
    std::iter::from_fn(move || {
        while at < bytes.len() {
            let start = at;
            let end = start + memchr::memchr2(b'\n', b'\r', &bytes[start..]).unwrap_or(bytes.len() - start);
            at = end + 1;
            let line = line(bytes, start, end);
            if line.mark.is_some() || !line.code.is_empty() {
                return Some(line);
            }
        }
        None
    })
}

fn line(bytes: &[u8], start: usize, end: usize) -> Line {
    let text = &bytes[start..end];
    let mut open = false;
    let comment = text.iter().position(|b| {
        open ^= *b == b'"';
        *b == b';' && !open
    });
    let code = &text[..comment.unwrap_or(text.len())];
    let from = code.iter().position(|b| !is_blank(*b)).unwrap_or(code.len());
    let to = code.iter().rposition(|b| !is_blank(*b)).map_or(from, |last| last + 1);
    let code =
        if code.get(from) == Some(&b'&') { Span::new(start, start) } else { Span::new(start + from, start + to) };
    Line { code, mark: comment.and_then(|at| Mark::of(&text[at + 1..])) }
}

/// Whether the code of a line begins with this word.
pub(super) fn is_line_of(line: &[u8], word: &[u8]) -> bool {
    let text = line.trim_ascii_start();
    text.len() > word.len() && text[..word.len()].eq_ignore_ascii_case(word) && !is_word(text[word.len()])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lexemes_of_a_line() {
        let text = b"LIN {X -1.5E-3,S 'B010'} C_DIS";
        let mut cursor = Cursor::new(text, 0, Span::new(0, text.len()));
        let kinds: Vec<LexemeKind> =
            std::iter::from_fn(|| Some(cursor.next().kind).filter(|k| *k != LexemeKind::End)).collect();
        use LexemeKind::{Bits, Mark, Number, Word};
        assert_eq!(kinds, [Word, Mark(b'{'), Word, Mark(b'-'), Number, Mark(b','), Word, Bits, Mark(b'}'), Word]);
    }

    #[test]
    fn comments_heads_and_blank_lines_are_no_code() {
        let text = b"&ACCESS RVP\r\n ;FOLD INI;%{PE}\r\n  A=1 ; b\r\n\r\n; deflex AIR\r\n C=\"x;y\"";
        let found: Vec<(&[u8], Option<crate::Mark>)> =
            lines(text).map(|line| (&text[line.code.range()], line.mark)).collect();
        assert_eq!(found, [(&b"A=1"[..], None), (b"", Some(crate::Mark::Air)), (b"C=\"x;y\"", None)]);
    }
}
