use super::{Source, Span, printable_line};
use std::fmt;

/// How bad it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Severity {
    /// Said, and the run goes on.
    Note,
    /// Suspicious, and the run goes on.
    Warning,
    /// Nothing is written.
    Error,
}

/// One message about one place: what is wrong, what was expected, what to do.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Diagnostic {
    /// Stable short name, e.g. `rapid.unclosed-bracket`, for scripts and tests.
    pub code: &'static str,
    /// How bad it is.
    pub severity: Severity,
    /// What is wrong and what was expected, one sentence.
    pub message: String,
    /// What to do.
    pub help: Option<String>,
    /// File, as the user typed it; empty where no file is concerned.
    pub file: String,
    /// Line and column from 1; 0 where the whole file is meant.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
    /// The source line, for the caret, and the bytes marked in it (byte range into `snippet`).
    pub snippet: Option<(String, std::ops::Range<usize>)>,
    /// The numbers in the message under their names, for scripts.
    pub figures: Vec<(&'static str, f64)>,
}

impl Diagnostic {
    /// An error about a whole file (or none, with an empty name).
    #[must_use]
    pub fn error(code: &'static str, file: &str, message: impl Into<String>) -> Self {
        Self {
            code,
            severity: Severity::Error,
            message: readable(message.into()),
            help: None,
            file: file.to_owned(),
            line: 0,
            column: 0,
            snippet: None,
            figures: Vec::new(),
        }
    }

    /// The same, at a place.
    #[must_use]
    pub fn at(self, source: &Source, span: Span) -> Self {
        let place = source.line_column(span.start as usize);
        self.on_line(source, span, u32::try_from(place.line).unwrap_or(u32::MAX))
    }

    /// The same, at a place whose line is known: a program with a message a target is not counted through for each.
    #[must_use]
    pub fn on_line(mut self, source: &Source, span: Span, line: u32) -> Self {
        self.file.clone_from(&source.name);
        self.line = line as usize;
        self.column = source.column(span.start as usize);
        self.snippet = Some(snippet(source, span));
        self
    }

    /// The same message with what to do.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(readable(help.into()));
        self
    }

    /// The same, as something milder or worse.
    #[must_use]
    pub fn severity(mut self, severity: Severity) -> Self {
        self.severity = severity;
        self
    }
}

/// A message that quotes a word of an input is no longer than this, bytes: as long as a page.
const LONGEST: usize = 4000;

/// A text without its middle if it is too long to be read.
fn readable(text: String) -> String {
    if text.len() <= LONGEST {
        return text;
    }
    let is_between_characters = |at: &usize| text.is_char_boundary(*at);
    let head = (0..=LONGEST * 3 / 4).rev().find(is_between_characters).unwrap_or(0);
    let tail = (text.len() - LONGEST / 4..=text.len()).find(is_between_characters).unwrap_or(text.len());
    format!("{} … ({} bytes left out) … {}", &text[..head], tail - head, &text[tail..])
}

/// One line: `file:line:column: error: message [code]`, without control characters. The CLI renders the snippet with it.
impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.file.is_empty() {
            write!(f, "{}", printable_line(&self.file))?;
            if self.line > 0 {
                write!(f, ":{}:{}", self.line, self.column)?;
            }
            write!(f, ": ")?;
        }
        let word = match self.severity {
            Severity::Note => "note",
            Severity::Warning => "warning",
            Severity::Error => "error",
        };
        write!(f, "{word}: {} [{}]", printable_line(&self.message), self.code)
    }
}

impl std::error::Error for Diagnostic {}

/// One message where many may stand, so that `?` passes it on.
impl From<Diagnostic> for Vec<Diagnostic> {
    fn from(diagnostic: Diagnostic) -> Self {
        vec![diagnostic]
    }
}

/// The line around a span, cut to a readable length, and the marked bytes within it.
fn snippet(source: &Source, span: Span) -> (String, std::ops::Range<usize>) {
    const AROUND: usize = 4000; // longer lines are no text for people
    let bytes = &source.bytes;
    let ends = |b: &u8| matches!(b, b'\n' | b'\r');
    let start = (span.start as usize).min(bytes.len());
    let line_start = bytes[..start].iter().rposition(ends).map_or(0, |p| p + 1);
    let line_end = bytes[start..].iter().position(ends).map_or(bytes.len(), |p| start + p);
    let from = line_start.max(start.saturating_sub(AROUND));
    let to = line_end.min(start + AROUND);
    let stop = (span.end as usize).clamp(start, to);
    let part = |a: usize, b: usize| source.text(Span::new(a, b)).into_owned();
    let (before, marked, after) = (part(from, start), part(start, stop), part(stop, to));
    let at = before.len()..before.len() + marked.len();
    (before + &marked + &after, at)
}

#[cfg(test)]
mod tests {
    use super::{Diagnostic, LONGEST};

    #[test]
    fn no_message_is_longer_than_a_page() {
        let word = "ä".repeat(25_000_000);
        let said = Diagnostic::error("x", "", format!("`{word}` is not declared")).help(word);
        for text in [&said.message, said.help.as_ref().unwrap_or(&said.message)] {
            assert!(text.len() < LONGEST + 50 && text.contains("bytes left out"), "{} bytes", text.len());
        }
        assert!(said.message.ends_with("` is not declared"));
    }
}
