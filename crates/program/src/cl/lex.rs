//! Bytes to records: lines, continuation, comments, cards, free text; and records to tokens.
//!
//! Every input can be read: every byte belongs to a record, a comment or the blanks between them.

use super::cards::Cards;
use super::number::{MAX_NUMBER, number};
use deflex_text::Span;
use deflex_text::number::read_leading;
use nom::{
    IResult, Parser,
    branch::alt,
    bytes::complete::{take_till, take_while, take_while1},
    character::complete::char,
    sequence::{delimited, preceded, terminated},
};

/// The kind of a token.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum TokenKind {
    Number,
    Word,
    Text,
    Comma,
    Slash,
    Open,
    Close,
    Equals,
}

/// A token. The span of a number on two lines includes the continuation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Token {
    pub(super) kind: TokenKind,
    pub(super) span: Span,
    /// The number's value, 0 for all else.
    pub(super) value: f64,
}

/// The kind of a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum RecordKind {
    /// `$$ …`
    Comment,
    /// `PPRINT …` and its like: the rest of the line is text.
    FreeText,
    /// A statement, in tokens.
    Statement,
}

/// One logical record, continuation lines joined.
#[derive(Clone, Copy, Debug)]
pub(super) struct Record {
    pub(super) kind: RecordKind,
    /// First to last significant byte.
    pub(super) span: Span,
    /// Line of the first byte, from 1.
    pub(super) line: usize,
}

/// Words whose statement is text to the end of the line: `$` and `/` mean nothing there.
const FREE_TEXT: [&[u8]; 7] = [b"PARTNO", b"REMARK", b"PPRINT", b"INSERT", b"LETTER", b"TITLES", b"TPRINT"];

fn is_free_text(line: &[u8]) -> bool {
    // Most lines are positions.
    !matches!(line.first(), Some(b'G' | b'g')) && FREE_TEXT.iter().any(|word| starts_with(line, word))
}

/// A position between records.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct RecordStart {
    /// Offset into the bytes.
    pub(super) at: usize,
    /// Line, from 1.
    pub(super) line: usize,
}

/// Offset after the byte order mark that a file may begin with.
pub(super) fn after_byte_order_mark(bytes: &[u8]) -> usize {
    const MARK: &[u8] = b"\xEF\xBB\xBF";
    if bytes.starts_with(MARK) { MARK.len() } else { 0 }
}

/// Reads records one by one.
pub(super) struct Lexer<'a> {
    bytes: &'a [u8],
    at: usize,
    line: usize,
    cards: Cards,
}

impl<'a> Lexer<'a> {
    /// Reads a whole file from its start.
    pub(super) fn new(bytes: &'a [u8], lines_before: usize) -> Self {
        let cards = Cards::detect(bytes);
        Self { bytes, at: after_byte_order_mark(bytes), line: lines_before + 1, cards }
    }

    /// Reads a file, which is no deck of cards, from a position on.
    pub(super) fn resume(bytes: &'a [u8], place: RecordStart) -> Self {
        Self { bytes, at: place.at, line: place.line, cards: Cards::default() }
    }

    pub(super) fn bytes(&self) -> &'a [u8] {
        self.bytes
    }

    pub(super) fn is_cards(&self) -> bool {
        self.cards.is_cards()
    }

    /// The position after the last record, before the end of its line.
    pub(super) fn place(&self) -> RecordStart {
        RecordStart { at: self.at, line: self.line }
    }

    /// Continues from a position after a record that was read in another way.
    pub(super) fn go_on(&mut self, place: RecordStart) {
        (self.at, self.line) = (place.at, place.line);
    }

    /// Whether further bytes could change the last record.
    pub(super) fn is_at_end(&self) -> bool {
        self.at == self.bytes.len()
    }

    /// The next record, its tokens in `tokens` (which is reused).
    pub(super) fn next(&mut self, tokens: &mut Vec<Token>) -> Option<Record> {
        tokens.clear();
        self.skip_blank();
        if self.at >= self.bytes.len() {
            return None;
        }
        let (start, line) = (self.at, self.line);
        let rest = &self.bytes[start..];
        let kind = if rest.starts_with(b"$$") {
            self.comment();
            RecordKind::Comment
        } else if is_free_text(rest) {
            self.at = self.line_end();
            RecordKind::FreeText
        } else {
            self.statement(tokens);
            RecordKind::Statement
        };
        let end = self.at;
        self.at = self.physical_line_end();
        Some(Record { kind, span: Span::new(start, trimmed(self.bytes, start, end)), line })
    }

    fn skip_blank(&mut self) {
        while let Some(&byte) = self.bytes.get(self.at) {
            match byte {
                b'\n' | b'\r' => self.newline(),
                b if is_blank(b) => self.at += 1,
                _ => break,
            }
        }
    }

    /// Steps over one line-end byte and counts lines as [`Source::line_column`](deflex_text::Source) does.
    fn newline(&mut self) {
        let cr_before_more = self.bytes[self.at] == b'\r' && matches!(self.bytes.get(self.at + 1), Some(b'\n' | b'\r'));
        if !cr_before_more {
            self.line += 1;
        }
        self.at += 1;
    }

    fn physical_line_end(&self) -> usize {
        let rest = &self.bytes[self.at..];
        self.at + memchr::memchr2(b'\n', b'\r', rest).unwrap_or(rest.len())
    }

    /// End of the significant columns of this line.
    fn line_end(&self) -> usize {
        let end = self.physical_line_end();
        if self.cards.is_cards() { self.cards.significant_end(self.bytes, self.at, end) } else { end }
    }

    /// Moves to the next line, after any kind of line end; false at the end of the file.
    fn next_line(&mut self) -> bool {
        self.at = self.physical_line_end();
        while matches!(self.bytes.get(self.at), Some(b'\r' | b'\n')) {
            let line = self.line;
            self.newline();
            if self.line > line {
                break;
            }
        }
        self.at < self.bytes.len()
    }

    /// A comment line; `$$-> … $` continues on the rows below it (Creo).
    fn comment(&mut self) {
        let continues = self.bytes[self.at..].starts_with(b"$$->");
        loop {
            let end = self.line_end();
            let line = trim_end(&self.bytes[self.at..end]);
            self.at = end;
            let goes_on = continues && line.ends_with(b"$") && !line.ends_with(b"$$");
            if !goes_on || !self.next_line() {
                return;
            }
        }
    }

    /// Tokens up to the end of a line that does not continue.
    fn statement(&mut self, tokens: &mut Vec<Token>) {
        let mut end = self.line_end();
        loop {
            let line = &self.bytes[self.at..end];
            let Some(&first) = line.first() else { return };
            if matches!(first, b'0'..=b'9' | b'-' | b'+')
                && let Some(token) = plain_token(line, self.at)
            {
                self.at += token.span.len();
                tokens.push(token);
                continue;
            }
            let (kind, len) = match first {
                b'$' if line.get(1) == Some(&b'$') => return,
                b'$' => {
                    let cut = self.at;
                    if !self.next_line() {
                        return;
                    }
                    end = self.line_end();
                    self.join(tokens, cut, end);
                    continue;
                }
                b',' => (TokenKind::Comma, 1),
                b'/' => (TokenKind::Slash, 1),
                b'(' => (TokenKind::Open, 1),
                b')' => (TokenKind::Close, 1),
                b'=' => (TokenKind::Equals, 1),
                b'\'' | b'"' => match quoted(line) {
                    Ok((rest, _)) => (TokenKind::Text, line.len() - rest.len()),
                    Err(_) => (TokenKind::Word, 1),
                },
                b if is_blank(b) => {
                    self.at += line.len() - blanks(line).map_or(line.len(), |(rest, _)| rest.len());
                    continue;
                }
                _ => (TokenKind::Word, chunk(line).map_or(1, |(rest, _)| line.len() - rest.len())),
            };
            let span = Span::new(self.at, self.at + len);
            self.at += len;
            tokens.push(classify(kind, span, &self.bytes[span.range()]));
        }
    }

    /// Joins a number that a `$` at `cut` has cut in half: `…, 0$` with `.752602` in the first
    /// column of the next line is 0.752602.
    fn join(&mut self, tokens: &mut [Token], cut: usize, end: usize) {
        let Some(last) = tokens.last_mut() else { return };
        let (head, line) = (last.span, &self.bytes[self.at..end]);
        let half = last.kind == TokenKind::Number || matches!(self.bytes[head.range()], [b'+' | b'-']);
        if !half || head.end as usize != cut {
            return;
        }
        let Ok((rest, tail)) = chunk(line) else { return };
        let mut joined = [0; MAX_NUMBER];
        let Some(text) = concatenate(&mut joined, &self.bytes[head.range()], tail) else { return };
        if let Some(value) = number(text) {
            let len = line.len() - rest.len();
            *last = Token { kind: TokenKind::Number, span: Span::new(head.start as usize, self.at + len), value };
            self.at += len;
        }
    }
}

/// The two parts of a token on two lines, or the whole token and an empty span.
pub(super) fn chunks(bytes: &[u8], span: Span) -> [Span; 2] {
    let (start, end) = (span.start as usize, span.end as usize);
    let text = &bytes[span.range()];
    match text.iter().position(|&b| b == b'$') {
        None => [span, Span::new(end, end)],
        Some(cut) => {
            let line = text.iter().rposition(|b| matches!(b, b'\n' | b'\r')).map_or(text.len(), |p| p + 1);
            [Span::new(start, start + cut), Span::new(start + line, end)]
        }
    }
}

fn classify(kind: TokenKind, span: Span, text: &[u8]) -> Token {
    let value = if kind == TokenKind::Word { number(text) } else { None };
    match value {
        Some(value) => Token { kind: TokenKind::Number, span, value },
        None => Token { kind, span, value: 0.0 },
    }
}

/// The number at the start of a text, if it has the usual form; [`classify`] gives the same.
#[inline]
fn plain_token(line: &[u8], at: usize) -> Option<Token> {
    let number = read_leading(line)?;
    let alone = line.get(number.len()).is_none_or(|b| ends_chunk(*b));
    alone.then(|| Token { kind: TokenKind::Number, span: Span::new(at, at + number.len()), value: number.value })
}

/// A word or a number: bytes up to a separator.
fn chunk(input: &[u8]) -> IResult<&[u8], &[u8]> {
    take_while1(|b: u8| !ends_chunk(b)).parse(input)
}

fn ends_chunk(byte: u8) -> bool {
    matches!(byte, b',' | b'/' | b'(' | b')' | b'=' | b'$' | b'\'' | b'"') || is_blank(byte)
}

fn blanks(input: &[u8]) -> IResult<&[u8], &[u8]> {
    take_while(is_blank).parse(input)
}

fn quoted(input: &[u8]) -> IResult<&[u8], &[u8]> {
    let single = delimited(char('\''), take_till(|b| b == b'\''), char('\''));
    let double = terminated(preceded(char('"'), take_till(|b| b == b'"')), char('"'));
    alt((single, double)).parse(input)
}

fn is_blank(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | b'\x0B' | b'\x0C' | b'\0' | b'\x1A')
}

fn starts_with(bytes: &[u8], word: &[u8]) -> bool {
    bytes.len() >= word.len() && bytes[..word.len()].eq_ignore_ascii_case(word)
}

fn concatenate<'b>(buffer: &'b mut [u8; MAX_NUMBER], a: &[u8], b: &[u8]) -> Option<&'b [u8]> {
    let len = a.len() + b.len();
    buffer.get_mut(..a.len())?.copy_from_slice(a);
    buffer.get_mut(a.len()..len)?.copy_from_slice(b);
    Some(&buffer[..len])
}

fn trimmed(bytes: &[u8], start: usize, end: usize) -> usize {
    start + trim_end(&bytes[start..end]).len()
}

fn trim_end(line: &[u8]) -> &[u8] {
    let len = line.iter().rposition(|&b| !is_blank(b)).map_or(0, |p| p + 1);
    &line[..len]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn kinds(text: &str) -> Vec<(TokenKind, String)> {
        let mut tokens = Vec::new();
        let mut lexer = Lexer::new(text.as_bytes(), 0);
        lexer.next(&mut tokens).expect("a record");
        tokens.iter().map(|t| (t.kind, text[t.span.range()].to_owned())).collect()
    }

    #[test]
    fn a_continuation_cuts_numbers_and_nothing_else() {
        let cut = kinds("GOTO/1, 0$ comment\n.752602,2$\n ,3");
        let numbers: Vec<&str> = cut.iter().filter(|t| t.0 == TokenKind::Number).map(|t| t.1.as_str()).collect();
        assert_eq!(numbers, ["1", "0$ comment\n.752602", "2", "3"]);
        let apart = kinds("GOTO/1,2 $\n3");
        assert_eq!(apart.iter().filter(|t| t.0 == TokenKind::Number).count(), 3);
    }

    #[test]
    fn words_that_begin_with_digits_are_words() {
        let tokens = kinds("CYCLE/1STPECK,5.,3DCOMP,1e,--2,1.2.3");
        let numbers: Vec<&str> = tokens.iter().filter(|t| t.0 == TokenKind::Number).map(|t| t.1.as_str()).collect();
        assert_eq!(numbers, ["5."]);
    }

    proptest! {
        #[test]
        fn plain_tokens_are_those_of_the_reference(text in "[-+]?[0-9]{0,9}\\.?[0-9]{0,12}[-+.eE,/=$ \tx]?[0-9,]{0,3}") {
            if let Some(token) = plain_token(text.as_bytes(), 7) {
                let (_, all) = chunk(text.as_bytes()).unwrap();
                let reference = classify(TokenKind::Word, Span::new(0, all.len()), all);
                prop_assert_eq!((reference.kind, reference.value.to_bits()), (token.kind, token.value.to_bits()));
                prop_assert_eq!(token.span, Span::new(7, 7 + all.len()));
            }
        }

        #[test]
        fn records_are_in_order_and_cover_all_that_is_not_blank(text in "[GO/1., \n\r'()=x]{0,80}") {
            let mut tokens = Vec::new();
            let mut lexer = Lexer::new(text.as_bytes(), 0);
            let mut end = 0;
            while let Some(record) = lexer.next(&mut tokens) {
                let between = &text.as_bytes()[end..record.span.start as usize];
                let blank = between.iter().all(|b| is_blank(*b) || matches!(b, b'\n' | b'\r'));
                prop_assert!(blank);
                let ordered = tokens.windows(2).all(|t| t[0].span.end <= t[1].span.start);
                prop_assert!(ordered);
                end = record.span.end as usize;
            }
        }
    }
}
