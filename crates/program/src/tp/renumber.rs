//! Renumbers statements after some are added or removed. Statements are numbered from 1, and the attributes state their count.

use deflex_lang::tp::Code;
use deflex_lang::tp::lines::{Line, numbers, sections, statements};
use deflex_text::{Content, Edit, Span};

/// Names of the line count among the attributes, in English and German.
const COUNTS: [&[u8]; 2] = [b"LINE_COUNT", b"ZEILEN"];

/// How much the numbers of statements grow along the text.
pub(super) struct Shifts(Vec<(usize, i64)>);

impl Shifts {
    /// From the places at which statements are added, in order, with their numbers.
    pub(super) fn new(counts: impl Iterator<Item = (usize, usize)>) -> Self {
        let mut sum = 0;
        let add = |(start, count)| {
            sum += i64::try_from(count).unwrap_or(0);
            (start, sum)
        };
        Self(counts.map(add).collect())
    }

    /// The growth at a place, including the statements that are added there.
    pub(super) fn at(&self, start: usize) -> i64 {
        self.0.partition_point(|(at, _)| *at <= start).checked_sub(1).map_or(0, |last| self.0[last].1)
    }

    /// The growth at a place, without the statements that are added there.
    pub(super) fn before(&self, start: usize) -> i64 {
        start.checked_sub(1).map_or(0, |start| self.at(start))
    }
}

/// The statements, and whether each belongs to point logic, whose statements have numbers of their own.
pub(super) fn counted(bytes: &[u8]) -> (Vec<Line<'_>>, Vec<bool>) {
    let lines = sections(bytes).statements.map_or_else(Vec::new, |section| statements(bytes, section));
    let inner = Code::new(&lines).inner;
    (lines, inner)
}

/// Edits for the numbers of statements that change, and for the count among the attributes if it was the last number. A number keeps its
/// width including the blanks before it.
pub(super) fn renumber<'a>(
    bytes: &'a [u8],
    lines: &'a [Line<'a>],
    inner: &'a [bool],
    shift: impl Fn(usize) -> i64 + 'a,
) -> impl Iterator<Item = Edit> + 'a {
    let number = |line: &Line<'_>| numbers(&bytes[line.span.range()]).map(|len| (line.span.start as usize, len));
    let value = |(start, len): (usize, usize)| std::str::from_utf8(&bytes[start..start + len]).ok()?.parse().ok();
    let own: Vec<(usize, usize)> =
        lines.iter().zip(inner).filter(|(_, inner)| !**inner).filter_map(|(line, _)| number(line)).collect();
    let last: Option<(i64, i64)> = own.last().and_then(|at| Some((value(*at)?, shift(at.0))));
    let count = last.and_then(|(last, shift)| {
        let (start, len) = count(bytes)?;
        (value((start, len)) == Some(last)).then(|| (start, len, last + shift))
    });
    let own = own.into_iter().filter_map(move |(start, len)| {
        let now: i64 = value((start, len))?;
        Some((start, len, now + shift(start))).filter(|(_, _, new)| *new != now)
    });
    let with_blanks = move |(start, len, value): (usize, usize, i64)| {
        let blanks = bytes[..start].iter().rev().take_while(|byte| **byte == b' ').count();
        let text = format!("{value:>width$}", width = blanks + len);
        Edit { span: Span::new(start - blanks, start + len), content: Content::from_slice(text.as_bytes()) }
    };
    let count = count.map(|(start, len, value)| Edit {
        span: Span::new(start, start + len),
        content: Content::from_slice(value.to_string().as_bytes()),
    });
    own.map(with_blanks).chain(count)
}

/// Place and number of the digits of the line count among the attributes.
fn count(bytes: &[u8]) -> Option<(usize, usize)> {
    let head = sections(bytes).head;
    let upper = bytes[head.clone()].to_ascii_uppercase();
    let after = COUNTS.iter().find_map(|name| {
        let at = memchr::memmem::find(&upper, name)?;
        let begins = at == 0 || matches!(upper[at - 1], b'\n' | b'\r');
        begins.then_some(at + name.len())
    })?;
    let between = upper[after..].iter().take_while(|byte| matches!(byte, b' ' | b'\t' | b'=')).count();
    let len = upper[after + between..].iter().take_while(|byte| byte.is_ascii_digit()).count();
    (len > 0).then_some((head.start + after + between, len))
}
