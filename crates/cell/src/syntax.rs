//! Parses the text of a cell file, and reports syntax errors and unknown keys.

use super::{nearest, raw};
use deflex_text::{Diagnostic, Source, Span};

/// Largest number of unknown keys that are reported for a file.
const MESSAGES: usize = 20;

/// Parses the TOML. Each unknown key is recorded and then replaced by blanks, so that one run reports all of them.
pub(super) fn parse(source: &Source, text: &str) -> Result<(raw::Cell, Vec<Diagnostic>), Vec<Diagnostic>> {
    let mut blanked = text.to_owned();
    let mut errors: Vec<Diagnostic> = Vec::new();
    loop {
        let error = match toml::from_str(&blanked) {
            Ok(raw) => return Ok((raw, errors)),
            Err(error) => error,
        };
        let diagnostic = syntax(source, &error);
        // A mistyped required key is reported once, as an unknown key.
        let quoted = error.message().split('`').nth(1).map(|name| format!("did you mean `{name}`?"));
        let mistyped = error.message().starts_with("missing field") && errors.iter().any(|known| known.help == quoted);
        if !mistyped {
            errors.push(diagnostic);
        }
        let unknown = error.message().starts_with("unknown field") && errors.len() < MESSAGES;
        match error.span().filter(|_| unknown).and_then(|key| without(&blanked, key.start)) {
            Some(next) => blanked = next,
            None => return Err(errors),
        }
    }
}

/// The text with the assignment `key = value` that starts at a byte replaced by blanks; `None` if it is not at the
/// start of a line.
fn without(text: &str, start: usize) -> Option<String> {
    let line = text[..start].rfind('\n').map_or(0, |at| at + 1);
    if !text[line..start].trim().is_empty() {
        return None;
    }
    let document = toml_edit::Document::parse(text).ok()?;
    let end = assignment_end(document.as_table(), start)?;
    let blank = text[start..end].chars().map(|c| if c == '\n' { "\n".to_owned() } else { " ".repeat(c.len_utf8()) });
    Some([&text[..start], &blank.collect::<String>(), &text[end..]].concat())
}

/// Position at which the value of the key that starts at a byte ends.
fn assignment_end(table: &dyn toml_edit::TableLike, start: usize) -> Option<usize> {
    for (name, item) in table.iter() {
        let key = table.key(name)?.span()?;
        if key.start == start {
            return item.as_value()?.span().map(|value| value.end);
        }
        let inner = match item {
            toml_edit::Item::ArrayOfTables(tables) => tables.iter().find_map(|table| assignment_end(table, start)),
            item => item.as_table_like().and_then(|table| assignment_end(table, start)),
        };
        if inner.is_some() {
            return inner;
        }
    }
    None
}

/// A TOML error as a diagnostic, with the most similar known key.
fn syntax(source: &Source, error: &toml::de::Error) -> Diagnostic {
    let message = error.message();
    let quoted: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
    let (message, help) = match quoted.split_first() {
        Some((wrong, known)) if message.starts_with("unknown field") => {
            let near = nearest(wrong, known.iter().copied());
            let all = || format!("known keys here: {}", known.join(", "));
            (format!("unknown key `{wrong}`"), near.map_or_else(all, |near| format!("did you mean `{near}`?")))
        }
        Some((missing, _)) if message.starts_with("missing field") => {
            (format!("key `{missing}` is missing"), format!("add `{missing} = …` here"))
        }
        _ if message.starts_with("invalid type: string") && message.contains("f64") => {
            (in_words(message), "write the number without quotes".to_owned())
        }
        _ if message.starts_with("invalid length") => {
            (in_words(message), "give one value for each; lists of six have one value for each joint".to_owned())
        }
        _ => {
            let help = "decimals take a point, text stands in quotes; `deflex init --robot MODEL` prints a whole cell";
            (in_words(message), help.to_owned())
        }
    };
    let diagnostic = Diagnostic::error("cell.syntax", &source.name, message).help(help);
    match error.span() {
        Some(range) => diagnostic.at(source, Span::new(range.start, range.end)),
        None => diagnostic,
    }
}

/// The text of a serde error, without names of Rust types.
pub(super) fn in_words(message: &str) -> String {
    let words = [("f64", "a number"), ("u32", "a whole number"), ("floating point", "number")];
    words.iter().fold(message.to_owned(), |message, (name, word)| message.replace(name, word))
}
