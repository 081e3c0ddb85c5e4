use super::Span;
use std::borrow::Cow;

/// One input file: its name in messages, and its bytes, which are never converted.
///
/// # Examples
/// ```
/// use deflex_text::{LineColumn, Source, Span};
///
/// let source = Source::new("part.mod", "MODULE A\nENDMODULE\n");
/// assert_eq!((source.bytes.len(), &*source.text(Span { start: 0, end: 6 })), (19, "MODULE"));
/// assert_eq!(source.line_column(11), LineColumn { line: 2, column: 3 });
/// ```
#[derive(Clone, Debug)]
pub struct Source {
    /// Path as the user typed it, `-` for standard input.
    pub name: String,
    /// The file's bytes.
    pub bytes: Vec<u8>,
    /// Number of lines before the first byte: not 0 for a chunk of a program.
    pub lines_before: usize,
}

/// A position as people count it: line and column from 1, the column in characters.
///
/// # Examples
/// ```
/// use deflex_text::{LineColumn, Source};
///
/// let source = Source::new("part.mod", "first\nsecond");
/// assert_eq!(source.line_column(8), LineColumn { line: 2, column: 3 });
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LineColumn {
    /// Line.
    pub line: usize,
    /// Column.
    pub column: usize,
}

impl Source {
    /// A whole file.
    #[must_use]
    pub fn new(name: impl Into<String>, bytes: impl Into<Vec<u8>>) -> Self {
        Self { name: name.into(), bytes: bytes.into(), lines_before: 0 }
    }

    /// The bytes of a span.
    #[must_use]
    #[doc(hidden)]
    pub fn slice(&self, span: Span) -> &[u8] {
        &self.bytes[span.range()]
    }

    /// Bytes as text for messages: UTF-8 if valid, otherwise Latin-1 (each byte is a character).
    #[must_use]
    pub fn text(&self, span: Span) -> Cow<'_, str> {
        decode(self.slice(span))
    }

    /// Line and column of an offset. CR LF, LF and a single CR end a line. It takes time proportional to the offset, so
    /// it is for messages only.
    #[must_use]
    pub fn line_column(&self, offset: usize) -> LineColumn {
        let offset = offset.min(self.bytes.len());
        let mut line = self.lines_before + 1;
        let mut start = 0;
        for (at, &byte) in self.bytes[..offset].iter().enumerate() {
            let ends = match byte {
                b'\n' => true,
                // CR CR LF, which one release of RobotStudio wrote, is one line end.
                b'\r' => !matches!(self.bytes.get(at + 1), Some(b'\n' | b'\r')),
                _ => false,
            };
            if ends {
                line += 1;
                start = at + 1;
            }
        }
        LineColumn { line, column: decode(&self.bytes[start..offset]).chars().count() + 1 }
    }

    /// The line around an offset. Of a line that is too long to read, only the part after the offset.
    #[must_use]
    #[doc(hidden)]
    pub fn line_at(&self, offset: usize) -> Cow<'_, str> {
        const NEAR: usize = 1000;
        let ends = |b: &u8| matches!(b, b'\n' | b'\r');
        let offset = offset.min(self.bytes.len());
        let near = offset.saturating_sub(NEAR);
        let start = match self.bytes[near..offset].iter().rposition(ends) {
            Some(end) => near + end + 1,
            None if near == 0 => 0,
            None => offset,
        };
        let rest = &self.bytes[offset..self.bytes.len().min(offset + NEAR)];
        let end = offset + rest.iter().position(ends).unwrap_or(rest.len());
        decode(&self.bytes[start..end])
    }

    /// Column of an offset, from 1. It takes time proportional to the length of the line.
    #[must_use]
    #[doc(hidden)]
    pub fn column(&self, offset: usize) -> usize {
        let before = &self.bytes[..offset.min(self.bytes.len())];
        let start = before.iter().rposition(|b| matches!(b, b'\n' | b'\r')).map_or(0, |at| at + 1);
        decode(&before[start..]).chars().count() + 1
    }
}

/// Bytes as text for people: UTF-8 if valid, otherwise Latin-1 (each byte is a character).
#[doc(hidden)]
pub fn decode(bytes: &[u8]) -> Cow<'_, str> {
    match std::str::from_utf8(bytes) {
        Ok(text) => Cow::Borrowed(text),
        Err(_) => Cow::Owned(bytes.iter().map(|&b| b as char).collect()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_end_with_lf_cr_lf_cr_cr_lf_and_cr() {
        let source = Source::new("x", &b"a\nb\r\nc\r\r\nd\re"[..]);
        let lines: Vec<usize> = [0, 2, 5, 9, 11].map(|o| source.line_column(o).line).to_vec();
        assert_eq!(lines, [1, 2, 3, 4, 5]);
    }

    #[test]
    fn the_line_around_an_offset() {
        let source = Source::new("x", &b"a\r\n bc \rd"[..]);
        let lines: Vec<_> = [0, 3, 5, 6, 8, 99].map(|offset| source.line_at(offset)).to_vec();
        assert_eq!(lines, ["a", " bc ", " bc ", " bc ", "d", "d"]);
        let long = Source::new("x", "y".repeat(5000));
        assert_eq!(long.line_at(4000).len(), 1000);
    }

    #[test]
    fn columns_count_characters_not_bytes() {
        let utf8 = Source::new("x", "äö;".as_bytes());
        assert_eq!(utf8.line_column(4).column, 3);
        assert_eq!(utf8.column(4), 3);
        let latin1 = Source::new("x", &[0xE4, 0xF6, b';'][..]);
        assert_eq!(latin1.line_column(2).column, 3);
    }
}
