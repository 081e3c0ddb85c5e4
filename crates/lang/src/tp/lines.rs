//! `/PROG … /END`: sections, and the statements of `/MN` with their continuations.

use crate::Span;
use std::borrow::Cow;
use std::ops::Range;

/// Ranges of the sections that are read.
///
/// # Examples
/// ```
/// let text = b"/PROG PART\n/MN\n   1:L P[1] 10mm/sec FINE ;\n/POS\n/END\n";
/// let sections = deflex_lang::tp::lines::sections(text);
/// assert_eq!(&text[sections.name.unwrap().range()], b"PART");
/// assert!(sections.ends && sections.positions.is_some());
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sections {
    /// Name that `/PROG` gives.
    pub name: Option<Span>,
    /// `/ATTR` and `/APPL`, from the first of them on.
    pub head: Range<usize>,
    /// `/MN`.
    pub statements: Option<Range<usize>>,
    /// `/POS`.
    pub positions: Option<Range<usize>>,
    /// Whether `/END` is there.
    pub ends: bool,
}

/// Lines without their ends, as ranges.
fn lines(bytes: &[u8], from: usize) -> impl Iterator<Item = Range<usize>> {
    let mut at = from;
    std::iter::from_fn(move || {
        let rest = bytes.get(at..).filter(|rest| !rest.is_empty())?;
        let len = memchr::memchr2(b'\n', b'\r', rest).unwrap_or(rest.len());
        let line = at..at + len;
        // CR LF, LF and a lone CR end lines; CR CR LF is one end, as one exporter wrote it.
        at += len;
        while bytes.get(at) == Some(&b'\r') && matches!(bytes.get(at + 1), Some(b'\r' | b'\n')) {
            at += 1;
        }
        at += 1;
        Some(line)
    })
}

/// Finds the sections.
///
/// # Examples
/// ```
/// assert!(deflex_lang::tp::lines::sections(b"/PROG PART\n/MN\n/END\n").statements.is_some());
/// ```
pub fn sections(bytes: &[u8]) -> Sections {
    let mut found = Sections::default();
    let mut open: Option<(&'static str, usize)> = None;
    let close = |open: &mut Option<(&'static str, usize)>, found: &mut Sections, end: usize| {
        match open.take() {
            Some(("/MN", start)) => found.statements = Some(start..end),
            Some(("/POS", start)) => found.positions = Some(start..end),
            Some(("/ATTR" | "/APPL", start)) if found.head.is_empty() => found.head = start..end,
            Some(("/ATTR" | "/APPL", _)) => found.head.end = end,
            _ => {}
        };
    };
    let start = if bytes.starts_with(b"\xEF\xBB\xBF") { 3 } else { 0 };
    for line in lines(bytes, start) {
        let text = bytes[line.clone()].trim_ascii();
        if text.first() != Some(&b'/') {
            continue;
        }
        let word = text.split(u8::is_ascii_whitespace).next().unwrap_or_default();
        let known = ["/PROG", "/ATTR", "/APPL", "/MN", "/POS", "/END"];
        let Some(section) = known.into_iter().find(|name| word.eq_ignore_ascii_case(name.as_bytes())) else { continue };
        // A remark of `/MN` cannot begin a line; a second `/PROG` in one file is not read.
        close(&mut open, &mut found, line.start);
        match section {
            "/PROG" => {
                let name = text[word.len()..].trim_ascii_start();
                let at = line.end - (bytes[line.clone()].trim_ascii_start().len() - (text.len() - name.len()));
                let len = name.iter().position(u8::is_ascii_whitespace).unwrap_or(name.len());
                found.name.get_or_insert(Span::new(at, at + len));
            }
            "/END" => {
                found.ends = true;
                break;
            }
            section => open = Some((section, line.end)),
        }
    }
    close(&mut open, &mut found, bytes.len());
    found
}

/// A statement of `/MN` with its continuation lines.
///
/// # Examples
/// ```
/// let text = b"   1:L P[1] 10mm/sec FINE ;\n";
/// let line = &deflex_lang::tp::lines::statements(text, 0..text.len())[0];
/// assert_eq!((&*line.text, line.line), (&b"L P[1] 10mm/sec FINE"[..], 1));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Line<'a> {
    /// Without number, colon and the semicolon at its end; continuation lines joined by a blank.
    pub text: Cow<'a, [u8]>,
    /// First to last byte.
    pub span: Span,
    /// Line of the first byte, from 1.
    pub line: usize,
}

/// The statements of `/MN`.
///
/// # Examples
/// ```
/// let text = b"   1:R[1]=2 ;\n   2:L P[1] 10mm/sec FINE ;\n";
/// assert_eq!(deflex_lang::tp::lines::statements(text, 0..text.len()).len(), 2);
/// ```
pub fn statements(bytes: &[u8], section: Range<usize>) -> Vec<Line<'_>> {
    let mut out: Vec<Line<'_>> = Vec::new();
    let mut open = false;
    let (mut counted, mut number) = (0, 1);
    for line in lines(&bytes[..section.end], section.start) {
        let text = &bytes[line.clone()];
        let (numbered, body) = unnumbered(text);
        let body = body.trim_ascii();
        // Lines are counted where a statement stands: once through the text altogether.
        if body.is_empty() && !numbered {
            continue;
        }
        let ends = body.last() == Some(&b';');
        let body = if ends { body[..body.len() - 1].trim_ascii_end() } else { body };
        let end = line.start + text.trim_ascii_end().len();
        match out.last_mut() {
            Some(last) if open && !numbered && !is_case(&last.text, body) => {
                let text = last.text.to_mut();
                text.push(b' ');
                text.extend_from_slice(body);
                last.span.end = Span::new(0, end).end;
            }
            _ => {
                let start = line.start + (text.len() - text.trim_ascii_start().len());
                number += line_ends(&bytes[counted..start]);
                counted = start;
                out.push(Line { text: Cow::Borrowed(body), span: Span::new(start, end), line: number });
            }
        }
        open = !ends;
    }
    out
}

/// Whether a line is the next row of a `SELECT`, whose rows may go on without a semicolon.
fn is_case(before: &[u8], body: &[u8]) -> bool {
    let starts = |text: &[u8], word: &[u8]| text.get(..word.len()).is_some_and(|own| own.eq_ignore_ascii_case(word));
    let row =
        |text: &[u8]| text.starts_with(b"=") || starts(text, b"ELSE") && text[4..].trim_ascii_start().starts_with(b",");
    row(body) && (row(before) || starts(before, b"SELECT"))
}

/// Number of line ends in a text, as editors count them.
fn line_ends(bytes: &[u8]) -> usize {
    let lone = |at: usize| bytes[at] == b'\r' && !matches!(bytes.get(at + 1), Some(b'\n' | b'\r'));
    memchr::memchr2_iter(b'\n', b'\r', bytes).filter(|&at| bytes[at] == b'\n' || lone(at)).count()
}

/// Number of digits of the statement number at the beginning of a line; `None` without a number.
///
/// # Examples
/// ```
/// assert_eq!(deflex_lang::tp::lines::numbers(b"12:L P[1] 10mm/sec FINE"), Some(2));
/// ```
pub fn numbers(statement: &[u8]) -> Option<usize> {
    let digits = statement.iter().take_while(|b| b.is_ascii_digit()).count();
    (unnumbered(statement).0).then_some(digits)
}

/// A line without its number and colon, and whether it has a number.
fn unnumbered(line: &[u8]) -> (bool, &[u8]) {
    let text = line.trim_ascii_start();
    let digits = text.iter().take_while(|b| b.is_ascii_digit()).count();
    match text[digits..].trim_ascii_start().split_first() {
        Some((b':', rest)) => (digits > 0, rest),
        _ => (false, text),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &[u8] = b"/PROG  MILL\tMacro\r\n/ATTR\r\nCOMMENT = \"a/POS\";\r\n/MN\r\n   1:  UFRAME_NUM=1 ;\r\n   2:C P[1]    \r\n    :  P[2] 100mm/sec FINE    ;\r\n\
        3: ! a; b ;\r\n  ------ ;\r\n/POS\r\nP[1]{};\r\n/END\r\n";

    #[test]
    fn sections_are_found_by_the_beginning_of_their_lines() {
        let found = sections(TEXT);
        assert_eq!(&TEXT[found.name.unwrap().range()], b"MILL");
        assert_eq!(&TEXT[found.positions.unwrap()], b"\r\nP[1]{};\r\n");
        assert!(found.ends);
        assert!(TEXT[found.head].ends_with(b"a/POS\";\r\n"));
    }

    #[test]
    fn rows_of_a_select_are_statements_with_and_without_a_semicolon() {
        let text = b"1: SELECT R[1]=1,CALL A\n : =2,CALL B ;\n : ELSE,CALL C\n2: R[1]=2 ;\n";
        let found = statements(text, 0..text.len());
        let texts: Vec<_> = found.iter().map(|line| str::from_utf8(&line.text).unwrap()).collect();
        assert_eq!(texts, ["SELECT R[1]=1,CALL A", "=2,CALL B", "ELSE,CALL C", "R[1]=2"]);
    }

    #[test]
    fn statements_are_joined_with_their_continuations() {
        let found = statements(TEXT, sections(TEXT).statements.unwrap());
        let texts: Vec<_> = found.iter().map(|line| (str::from_utf8(&line.text).unwrap(), line.line)).collect();
        assert_eq!(texts, [("UFRAME_NUM=1", 5), ("C P[1] P[2] 100mm/sec FINE", 6), ("! a; b", 8), ("------", 9)]);
        assert!(TEXT[found[1].span.range()].ends_with(b"FINE    ;"));
    }
}
