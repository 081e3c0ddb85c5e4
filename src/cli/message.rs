//! Diagnostics on stderr, with the source line and a caret.

use annotate_snippets::{AnnotationKind, Group, Level, Origin, Renderer, Snippet};
use deflex::text::{Diagnostic, Severity};
use std::io::{self, IsTerminal, Write};

/// More messages than this of one run are only counted.
const MOST: usize = 50;

/// Prints diagnostics to stderr; notes and warnings are left out when `quiet`.
pub(super) fn print(diagnostics: &[Diagnostic], quiet: bool) {
    let no_color = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
    let color = io::stderr().is_terminal() && !no_color;
    let mut stderr = io::stderr().lock();
    let shown: Vec<&Diagnostic> = diagnostics.iter().filter(|d| !quiet || d.severity == Severity::Error).collect();
    for diagnostic in shown.iter().take(MOST) {
        // Nobody is left to tell where stderr is closed.
        let _ = writeln!(stderr, "{}", render(diagnostic, color));
    }
    if shown.len() > MOST {
        let _ = writeln!(stderr, "… and {} more", shown.len() - MOST);
    }
}

/// Lines for people, to stderr.
pub(super) fn say(lines: &[String]) {
    let mut stderr = io::stderr().lock();
    for line in lines {
        let _ = writeln!(stderr, "{line}");
    }
}

/// One diagnostic as text.
pub(super) fn render(diagnostic: &Diagnostic, color: bool) -> String {
    let level = match diagnostic.severity {
        Severity::Note => Level::NOTE,
        Severity::Warning => Level::WARNING,
        Severity::Error => Level::ERROR,
    };
    let title = level.primary_title(&diagnostic.message).id(diagnostic.code);
    let mut group = Group::with_title(title);
    let snippet = diagnostic.snippet.as_ref().filter(|(line, _)| !line.is_empty());
    // The renderer counts columns in the snippet: right only where it starts with the line.
    let whole = snippet.is_some_and(|(line, marked)| line[..marked.start].chars().count() + 1 == diagnostic.column);
    if !diagnostic.file.is_empty() && !whole {
        let mut origin = Origin::path(&diagnostic.file);
        if diagnostic.line > 0 {
            origin = origin.line(diagnostic.line).char_column(diagnostic.column);
        }
        group = group.element(origin);
    }
    if let Some((line, marked)) = snippet {
        let mark = AnnotationKind::Primary.span(marked.clone());
        let mut text = Snippet::source(line.as_str()).line_start(diagnostic.line).annotation(mark);
        if whole {
            text = text.path(&diagnostic.file);
        }
        group = group.element(text);
    }
    if let Some(help) = &diagnostic.help {
        group = group.element(Level::HELP.message(help));
    }
    let renderer = if color { Renderer::styled() } else { Renderer::plain() };
    renderer.render(&[group])
}

#[cfg(test)]
mod tests {
    use super::render;
    use deflex::text::{Diagnostic, Source, Span};

    #[test]
    fn says_file_line_column_and_marks_the_bytes() {
        let source = Source::new("part.mod", "MODULE A\n  MoveL p10, v100;\n");
        let at = source.bytes.iter().position(|b| *b == b'p').unwrap_or(0);
        let diagnostic = Diagnostic::error("rapid.unknown", "", "`p10` is not declared")
            .at(&source, Span::new(at, at + 3))
            .help("declare it");
        insta::assert_snapshot!(render(&diagnostic, false));
    }

    #[test]
    fn a_file_without_a_place_is_named_all_the_same() {
        insta::assert_snapshot!(render(
            &Diagnostic::error("io.read", "x.mod", "not there").help("check the path"),
            false
        ));
    }
}
