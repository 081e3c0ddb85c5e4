use super::{Source, Span, printable_line};
use std::fmt;

/// Severity of a message.
///
/// # Examples
/// ```
/// use deflex_text::{Diagnostic, Severity};
///
/// let message = Diagnostic::error("user.code", "part.mod", "the part is missing").severity(Severity::Warning);
/// assert_eq!(message.to_string(), "part.mod: warning: the part is missing [user.code]");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Severity {
    /// Information; the run continues.
    Note,
    /// Something that is probably wrong; the run continues.
    Warning,
    /// An error; nothing is written.
    Error,
}

/// A message about one place: what is wrong, what was expected, and what to do.
///
/// # Examples
/// ```
/// use deflex_text::{Diagnostic, Severity, Source, Span};
///
/// let source = Source::new("part.mod", "MODULE A\nENDMODULE\n");
/// let found = Diagnostic::error("a.code", &source.name, "what is wrong").at(&source, Span { start: 9, end: 18 });
/// assert_eq!((found.line, found.column), (2, 1));
/// let note = found.help("what to do").severity(Severity::Note);
/// assert!(note.to_string().contains("what is wrong"));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Diagnostic {
    /// Stable short name, e.g. `rapid.unclosed-bracket`, for scripts and tests.
    pub code: &'static str,
    /// Severity of the message.
    pub severity: Severity,
    /// What is wrong and what was expected, one sentence.
    pub message: String,
    /// What to do.
    pub help: Option<String>,
    /// File, as the user typed it; empty if the message is not about a file.
    pub file: String,
    /// Line, from 1; 0 if the message is about the whole file.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
    /// The line of the file with the place, and the range of bytes in it to mark.
    pub snippet: Option<(String, std::ops::Range<usize>)>,
    /// The numbers in the message with their names, for scripts.
    pub figures: Vec<(&'static str, f64)>,
}

impl Diagnostic {
    /// An error about a whole file, or about none if `file` is empty.
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

    /// Adds a place in a source.
    #[must_use]
    pub fn at(self, source: &Source, span: Span) -> Self {
        let place = source.line_column(span.start as usize);
        self.on_line(source, span, u32::try_from(place.line).unwrap_or(u32::MAX))
    }

    /// Adds a place whose line is known. Counting lines takes time: a program with a message for each target would be
    /// counted through for each.
    #[must_use]
    #[doc(hidden)]
    pub fn on_line(mut self, source: &Source, span: Span, line: u32) -> Self {
        self.file.clone_from(&source.name);
        self.line = line as usize;
        self.column = source.column(span.start as usize);
        self.snippet = Some(snippet(source, span));
        self
    }

    /// Adds what to do.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(readable(help.into()));
        self
    }

    /// Sets the severity.
    #[must_use]
    pub fn severity(mut self, severity: Severity) -> Self {
        self.severity = severity;
        self
    }
}

/// Largest length of a message, bytes, about a page: words of an input that it quotes can be long.
const LONGEST: usize = 4000;

/// A text that is shortened in the middle if it is too long to read.
fn readable(text: String) -> String {
    if text.len() <= LONGEST {
        return text;
    }
    let is_between_characters = |at: &usize| text.is_char_boundary(*at);
    let head = (0..=LONGEST * 3 / 4).rev().find(is_between_characters).unwrap_or(0);
    let tail = (text.len() - LONGEST / 4..=text.len()).find(is_between_characters).unwrap_or(text.len());
    format!("{} … ({} bytes left out) … {}", &text[..head], tail - head, &text[tail..])
}

/// One line, `file:line:column: error: message [code]`, without control characters. The command line shows the snippet
/// in addition.
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

/// A single message as a list, so that `?` converts it.
impl From<Diagnostic> for Vec<Diagnostic> {
    fn from(diagnostic: Diagnostic) -> Self {
        vec![diagnostic]
    }
}

/// The line around a span, shortened to a readable length, and the range of the span in it.
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
        let diagnostic = Diagnostic::error("x", "", format!("`{word}` is not declared")).help(word);
        for text in [&diagnostic.message, diagnostic.help.as_ref().unwrap_or(&diagnostic.message)] {
            assert!(text.len() < LONGEST + 50 && text.contains("bytes left out"), "{} bytes", text.len());
        }
        assert!(diagnostic.message.ends_with("` is not declared"));
    }
}
