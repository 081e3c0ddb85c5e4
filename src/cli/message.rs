//! Prints diagnostics on stderr, with the line of the file and a caret.

use annotate_snippets::{AnnotationKind, Group, Level, Origin, Renderer, Snippet};
use deflex::text::{Diagnostic, Severity, printable, printable_line};
use serde_json::{Value, json};
use std::collections::HashMap;
use std::io::{self, IsTerminal, Write};
use std::ops::Range;
use std::sync::LazyLock;

/// A run prints this many messages and only counts the others.
const MOST_SHOWN: usize = 50;

/// Whether a program reads stderr: with `DEFLEX_MESSAGES=json`, each line is a JSON object instead of text for people.
pub(super) static FOR_A_PROGRAM: LazyLock<bool> =
    LazyLock::new(|| std::env::var_os("DEFLEX_MESSAGES").is_some_and(|form| form == "json"));

/// Prints diagnostics to stderr, without notes and warnings if `quiet`.
pub(super) fn print(diagnostics: &[Diagnostic], quiet: bool) {
    let no_color = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
    let color = io::stderr().is_terminal() && !no_color;
    let mut stderr = io::stderr().lock();
    let shown = diagnostics.iter().filter(|d| !quiet || d.severity == Severity::Error);
    let shown = once(shown);
    for diagnostic in shown.iter().take(MOST_SHOWN) {
        let text = if *FOR_A_PROGRAM { as_json(diagnostic).to_string() } else { render(diagnostic, color) };
        // If stderr is closed, there is no place left to report the failure.
        let _ = writeln!(stderr, "{text}");
    }
    if shown.len() > MOST_SHOWN {
        drop(stderr);
        print_lines(&[format!("… and {} more", shown.len() - MOST_SHOWN)]);
    }
}

/// Merges messages. Messages that differ only in their place become one, with a count and the first lines. Messages
/// that also differ in their numbers are merged only when there are many, so that they do not crowd out the others.
fn once<'a>(diagnostics: impl Iterator<Item = &'a Diagnostic>) -> Vec<Diagnostic> {
    /// From this many messages that differ only in numbers, the rest are merged.
    const ALIKE: usize = 5;
    const LINES: usize = 8;
    type Group<'a> = (Diagnostic, Vec<usize>, bool);
    let mut groups: Vec<Group<'a>> = Vec::new();
    let mut exact = HashMap::new();
    let mut alike: HashMap<_, Vec<usize>> = HashMap::new();
    for found in diagnostics {
        let key = (found.code, found.severity, &found.file, &found.message, &found.help);
        if let Some(&at) = exact.get(&key) {
            let (_, lines, _): &mut Group<'_> = &mut groups[at];
            lines.push(found.line);
            continue;
        }
        let kin = alike.entry((found.code, found.severity, &found.file, without_numbers(&found.message))).or_default();
        if kin.len() > ALIKE {
            let (_, lines, more): &mut Group<'_> = &mut groups[kin[ALIKE]];
            lines.push(found.line);
            *more = true;
            continue;
        }
        exact.insert(key, groups.len());
        kin.push(groups.len());
        groups.push((found.clone(), vec![found.line], false));
    }
    let merged = |(mut first, lines, alike): Group<'_>| {
        let count = lines.len();
        let mut at: Vec<usize> = lines.into_iter().filter(|line| *line > 0).collect();
        at.dedup();
        let shown: Vec<String> = at.iter().take(LINES).map(ToString::to_string).collect();
        let at = match at.len() {
            0 | 1 => String::new(),
            n => format!(", lines {}{}", shown.join(", "), if n > LINES { ", …" } else { "" }),
        };
        first.message += &match (count, alike) {
            (1, _) => String::new(),
            (_, true) => format!(" (and {} more like it{at})", count - 1),
            (_, false) => format!(" ({count} times{at})"),
        };
        first
    };
    groups.into_iter().map(merged).collect()
}

/// The message with its numbers removed.
fn without_numbers(message: &str) -> String {
    let mut text = String::with_capacity(message.len());
    for c in message.chars().filter(|c| !matches!(c, '.' | '-' | '+')) {
        match c.is_ascii_digit() {
            true if text.ends_with('#') => {}
            true => text.push('#'),
            false => text.push(c),
        }
    }
    text
}

/// Prints lines for people to stderr.
pub(super) fn print_lines(lines: &[String]) {
    let mut stderr = io::stderr().lock();
    for line in lines {
        let text = match *FOR_A_PROGRAM {
            true => json!({ "severity": "line", "message": printable(line) }).to_string(),
            false => printable(line).into_owned(),
        };
        let _ = writeln!(stderr, "{text}");
    }
}

/// A diagnostic as a JSON object.
fn as_json(diagnostic: &Diagnostic) -> Value {
    let severity = match diagnostic.severity {
        Severity::Note => "note",
        Severity::Warning => "warning",
        Severity::Error => "error",
    };
    json!({
        "severity": severity,
        "code": diagnostic.code,
        "file": printable_line(&diagnostic.file),
        "line": diagnostic.line,
        "column": diagnostic.column,
        "message": printable_line(&diagnostic.message),
        "help": diagnostic.help.as_deref().map(printable_line),
    })
}

/// A diagnostic as text.
pub(super) fn render(diagnostic: &Diagnostic, color: bool) -> String {
    let level = match diagnostic.severity {
        Severity::Note => Level::NOTE,
        Severity::Warning => Level::WARNING,
        Severity::Error => Level::ERROR,
    };
    // The renderer does not escape control characters everywhere, so they are replaced before.
    let (message, file) = (printable_line(&diagnostic.message), printable_line(&diagnostic.file));
    let help = diagnostic.help.as_deref().map(printable_line);
    let title = level.primary_title(&*message).id(diagnostic.code);
    let mut group = Group::with_title(title);
    let snippet = diagnostic.snippet.as_ref().filter(|(line, _)| !line.is_empty()).map(shown);
    let snippet = snippet.as_ref();
    // The renderer counts columns from the start of the snippet, so its column is right only if the snippet starts with
    // the line.
    let whole = snippet.is_some_and(|(line, marked)| line[..marked.start].chars().count() + 1 == diagnostic.column);
    if !diagnostic.file.is_empty() && !whole {
        let mut origin = Origin::path(&*file);
        if diagnostic.line > 0 {
            origin = origin.line(diagnostic.line).char_column(diagnostic.column);
        }
        group = group.element(origin);
    }
    if let Some((line, marked)) = snippet {
        let mark = AnnotationKind::Primary.span(marked.clone());
        let mut text = Snippet::source(line.as_str()).line_start(diagnostic.line).annotation(mark);
        if whole {
            text = text.path(&*file);
        }
        group = group.element(text);
    }
    if let Some(help) = &help {
        group = group.element(Level::HELP.message(&**help));
    }
    let renderer = if color { Renderer::styled() } else { Renderer::plain() };
    renderer.render(&[group])
}

/// A line of a file without terminal control characters, and the range of the mark in it.
fn shown((line, marked): &(String, Range<usize>)) -> (String, Range<usize>) {
    let [before, mark, after] = [&line[..marked.start], &line[marked.clone()], &line[marked.end..]].map(printable);
    let at = before.len()..before.len() + mark.len();
    ([before, mark, after].concat(), at)
}

#[cfg(test)]
mod tests {
    use super::{once, render};
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
    fn repeated_messages_are_printed_once_with_a_count() {
        let mut all = Vec::new();
        for line in 1..=20 {
            for message in ["fx_n is `a`".to_owned(), format!("target {line} is not reached")] {
                let mut diagnostic = Diagnostic::error("x", "a.csv", message);
                diagnostic.line = line;
                all.push(diagnostic);
            }
        }
        let messages: Vec<String> = once(all.iter()).into_iter().map(|diagnostic| diagnostic.message).collect();
        assert_eq!(messages.len(), 7);
        assert_eq!(messages[0], "fx_n is `a` (20 times, lines 1, 2, 3, 4, 5, 6, 7, 8, …)");
        assert_eq!(messages[6], "target 6 is not reached (and 14 more like it, lines 6, 7, 8, 9, 10, 11, 12, 13, …)");
    }

    #[test]
    fn nothing_in_a_program_or_its_name_steers_the_terminal() {
        let source = Source::new("\u{1b}[2Jx\u{202e}.mod", "  MoveL \u{1b}]0;t\u{7}p10\u{9b}2J;\n");
        let diagnostic = Diagnostic::error("rapid.unknown", "", "`\u{9b}2J` is not declared")
            .at(&source, Span::new(8, 14))
            .help("declare `\u{1b}c`");
        let rendered = render(&diagnostic, false);
        assert!(!rendered.contains(['\u{1b}', '\u{7}', '\u{9b}', '\u{202e}']), "{rendered:?}");
        assert!(!diagnostic.to_string().contains(|c: char| c.is_control()));
    }

    #[test]
    fn a_file_without_a_place_is_named_all_the_same() {
        insta::assert_snapshot!(render(
            &Diagnostic::error("io.read", "x.mod", "not there").help("check the path"),
            false
        ));
    }
}
