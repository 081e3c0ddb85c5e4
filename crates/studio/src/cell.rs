//! A cell file as a form. The text becomes fields, and a change of a field changes the text at that place only. All comments and
//! all other bytes stay.
//!
//! This module does not know the keys of a cell file. Keys have their unit in their name. The comment after a value explains it,
//! and ` | ` between words lists the possible values. `<<` marks an example that the user has to replace. The form offers keys
//! and sections that are commented out, and those that only a template has.

use serde::{Deserialize, Serialize};
use std::ops::Range;
use toml_edit::{Array, Document, Item, Table, Value};

/// The mark of an example.
const EXAMPLE: &str = "<<";
/// Largest number of lines of a value that is commented out.
const LONGEST_OFFER: usize = 40;

/// A step into the document.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged)]
pub(crate) enum PathStep {
    Key(String),
    Index(usize),
}

/// A value as the form shows it. Numbers stay as they are written.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", content = "value", rename_all = "kebab-case")]
enum Shown {
    Number(String),
    Text(String),
    Flag(bool),
    Numbers(Vec<String>),
    Rows(Vec<Vec<String>>),
    /// Anything else, as TOML.
    Other(String),
}

#[derive(Clone, Debug, PartialEq, Serialize)]
struct Field {
    key: String,
    path: Vec<PathStep>,
    #[serde(flatten)]
    shown: Shown,
    /// First and last line, counted from 1.
    lines: [usize; 2],
    help: String,
    is_example: bool,
    choices: Vec<String>,
}

/// A key or a section that can be added.
#[derive(Clone, Debug, PartialEq, Serialize)]
struct Offer {
    key: String,
    place: OfferSource,
    line: usize,
    help: String,
}

/// Where it was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum OfferSource {
    /// In the file itself, commented out.
    Own,
    /// In the template.
    Template,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
struct Section {
    title: String,
    path: Vec<PathStep>,
    line: usize,
    /// The comments directly above the header.
    help: String,
    fields: Vec<Field>,
    offers: Vec<Offer>,
}

/// A syntax error of the TOML text.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Wrong {
    line: usize,
    column: usize,
    message: String,
}

/// A cell file as a form.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(crate) struct Form {
    sections: Vec<Section>,
    /// Sections that are commented out.
    offers: Vec<Offer>,
    wrong: Option<Wrong>,
}

/// The lines of a text with their positions.
struct Lines<'a> {
    text: &'a str,
    starts: Vec<usize>,
}

impl<'a> Lines<'a> {
    fn of(text: &'a str) -> Self {
        let starts = std::iter::once(0).chain(text.match_indices('\n').map(|(at, _)| at + 1)).collect();
        Self { text, starts }
    }

    /// The number of the line that a byte is in, from 1.
    fn line(&self, at: usize) -> usize {
        self.starts.partition_point(|start| *start <= at)
    }

    fn count(&self) -> usize {
        self.starts.len()
    }

    /// The bytes of a line with its end, by its number.
    fn range(&self, line: usize) -> Range<usize> {
        let end = self.starts.get(line).copied().unwrap_or(self.text.len());
        self.starts[line - 1]..end
    }

    /// A line without its end.
    fn get(&self, line: usize) -> &'a str {
        self.text[self.range(line)].trim_end_matches(['\n', '\r'])
    }
}

/// The form of a text, with the keys and sections that only the template has.
pub(crate) fn form_with(text: &str, template: &str) -> Form {
    let mut own = form(text);
    let more = form(template);
    if own.wrong.is_some() {
        return own;
    }
    for Section { title, fields, mut offers, help, line, .. } in more.sections {
        let keys = fields.into_iter().map(|Field { key, lines, help, .. }| (key, lines[0], help));
        let offered = offers.drain(..).map(|Offer { key, line, help, .. }| (key, line, help));
        let all: Vec<(String, usize, String)> = keys.chain(offered).collect();
        match own.sections.iter_mut().find(|section| section.title == title) {
            Some(section) => {
                for (key, line, help) in all {
                    let is_there = section.fields.iter().any(|field| field.key == key)
                        || section.offers.iter().any(|offer| offer.key == key);
                    if !is_there {
                        section.offers.push(Offer { key, place: OfferSource::Template, line, help });
                    }
                }
            }
            None => own.offer_section(Offer { key: title, place: OfferSource::Template, line, help }),
        }
    }
    for offer in more.offers {
        own.offer_section(Offer { place: OfferSource::Template, ..offer });
    }
    own
}

impl Form {
    /// Offers a section of the template if the text has neither it nor another one of its kind, because each cell has its own
    /// tools and work objects.
    fn offer_section(&mut self, offer: Offer) {
        let (group, is_named) = match offer.key.split_once('.') {
            Some((group @ ("tools" | "wobjs"), _)) => (group, true),
            _ => (offer.key.as_str(), false),
        };
        let is_of = |title: &str| {
            let rest = title.strip_prefix(group);
            rest.is_some_and(|rest| rest.is_empty() || rest.starts_with(' ') || is_named && rest.starts_with('.'))
        };
        let offered = self.offers.iter().any(|own| own.key == offer.key);
        if !offered && !self.sections.iter().any(|section| is_of(&section.title)) {
            self.offers.push(offer);
        }
    }
}

/// The form of a text.
fn form(text: &str) -> Form {
    let document = match Document::parse(text) {
        Ok(document) => document,
        Err(error) => {
            let at = error.span().map_or(0, |span| span.start).min(text.len());
            let lines = Lines::of(text);
            let line = lines.line(at);
            let column = text.get(lines.range(line).start..at).map_or(1, |before| before.chars().count() + 1);
            let wrong = Wrong { line, column, message: error.message().replace('\n', ", ") };
            return Form { wrong: Some(wrong), ..Form::default() };
        }
    };
    let lines = Lines::of(text);
    let mut form = Form::default();
    add_table(document.as_table(), &mut Vec::new(), &lines, &mut form.sections);
    form.sections.sort_by_key(|section| section.line);
    add_offers(&lines, &mut form);
    form
}

fn add_table(table: &Table, path: &mut Vec<PathStep>, lines: &Lines<'_>, sections: &mut Vec<Section>) {
    let mut fields = Vec::new();
    for (key, item) in table {
        path.push(PathStep::Key(key.to_owned()));
        match item {
            Item::Table(inner) => add_table(inner, path, lines, sections),
            Item::ArrayOfTables(all) => {
                for (i, inner) in all.iter().enumerate() {
                    path.push(PathStep::Index(i));
                    add_table(inner, path, lines, sections);
                    path.pop();
                }
            }
            Item::Value(value) => fields.extend(field(key, path, value, lines)),
            Item::None => {}
        }
        path.pop();
    }
    // A table that only contains other tables has no line of its own.
    if fields.is_empty() && (table.is_implicit() || path.is_empty()) {
        return;
    }
    let header = table.span().filter(|_| !path.is_empty()).map(|span| lines.line(span.start));
    let line = header.or(fields.first().map(|field: &Field| field.lines[0])).unwrap_or(1);
    let help = header.map_or(String::new(), |line| help_above(lines, line));
    sections.push(Section { title: title(path), path: path.clone(), line, help, fields, offers: Vec::new() });
}

/// The name of a section for people, who count from 1: the second effect is `effect 2`.
fn title(path: &[PathStep]) -> String {
    let mut title = String::new();
    for step in path {
        match step {
            PathStep::Key(key) if title.is_empty() => title = key.clone(),
            PathStep::Key(key) => title = format!("{title}.{key}"),
            PathStep::Index(at) => title = format!("{title} {}", at + 1),
        }
    }
    title
}

fn field(key: &str, path: &[PathStep], value: &Value, lines: &Lines<'_>) -> Option<Field> {
    let span = value.span()?;
    let last = lines.line(span.end.max(1) - 1);
    let after = lines.text.get(span.end..lines.range(last).end).unwrap_or_default();
    let comment = after.trim_start().strip_prefix('#').unwrap_or_default().trim();
    let (help, is_example) = without_mark(comment);
    Some(Field {
        key: key.to_owned(),
        path: path.to_owned(),
        shown: shown(value, lines),
        lines: [lines.line(span.start), last],
        choices: choices(help),
        help: help.to_owned(),
        is_example,
    })
}

fn without_mark(comment: &str) -> (&str, bool) {
    match comment.strip_prefix(EXAMPLE) {
        Some(help) => (help.trim(), true),
        None => (comment, false),
    }
}

fn shown(value: &Value, lines: &Lines<'_>) -> Shown {
    let written = |value: &Value| {
        let span = value.span().unwrap_or(0..0);
        lines.text.get(span).unwrap_or_default().to_owned()
    };
    let numbers = |array: &Array| {
        let is_number = |value: &Value| value.is_integer() || value.is_float();
        array.iter().all(is_number).then(|| array.iter().map(written).collect::<Vec<_>>())
    };
    match value {
        Value::Integer(_) | Value::Float(_) => Shown::Number(written(value)),
        Value::String(text) => Shown::Text(text.value().clone()),
        Value::Boolean(flag) => Shown::Flag(*flag.value()),
        Value::Array(array) if !array.is_empty() => {
            let rows = || array.iter().map(|row| row.as_array().and_then(numbers)).collect::<Option<Vec<_>>>();
            numbers(array)
                .map(Shown::Numbers)
                .or_else(|| rows().map(Shown::Rows))
                .unwrap_or_else(|| Shown::Other(written(value)))
        }
        _ => Shown::Other(written(value)),
    }
}

/// The words that a comment lists, as in `what it is: one | two (why) | three`.
fn choices(help: &str) -> Vec<String> {
    let parts: Vec<&str> = help.split(" | ").map(str::trim).collect();
    if parts.len() < 2 {
        return Vec::new();
    }
    let word = |text: &str| {
        let end = text.find(|c: char| !(c.is_alphanumeric() || c == '-' || c == '_')).unwrap_or(text.len());
        (end > 0).then(|| text[..end].to_owned())
    };
    // An explanation of the key may precede the first word, and one of the word may follow it.
    let first =
        parts[0].rsplit_once(": ").filter(|(before, _)| before.contains(' ')).map_or(parts[0], |(_, first)| first);
    std::iter::once(first).chain(parts[1..].iter().copied()).map(word).collect::<Option<_>>().unwrap_or_default()
}

/// The text after `#`, if the line is a comment.
fn commented(line: &str) -> Option<&str> {
    line.trim_start().strip_prefix('#').map(|rest| rest.strip_prefix(' ').unwrap_or(rest))
}

/// The comments directly above a header, except for those that are a key or a section commented out.
fn help_above(lines: &Lines<'_>, header: usize) -> String {
    let mut help: Vec<&str> = Vec::new();
    for line in (1..header).rev() {
        match commented(lines.get(line)) {
            Some(text) if offered_header(text).is_none() && offered_key(lines, line).is_none() => {
                help.push(text.trim())
            }
            _ => break,
        }
    }
    help.reverse();
    help.join(" ")
}

/// The name of a section and its comment, if a comment contains its header.
fn offered_header(text: &str) -> Option<(String, String)> {
    if !text.starts_with('[') {
        return None;
    }
    let table = Document::parse(text).ok()?;
    let name = text.trim_start_matches('[').split(']').next()?.to_owned();
    let is_header = table.as_table().iter().all(|(_, item)| !item.is_value());
    let comment = text.split_once('#').map_or(String::new(), |(_, comment)| comment.trim().to_owned());
    (is_header && !name.is_empty()).then_some((name, comment))
}

/// A key that is commented out and begins at this line: the key, its comment, and its last line.
fn offered_key(lines: &Lines<'_>, line: usize) -> Option<(String, String, usize)> {
    let first = commented(lines.get(line))?;
    let (key, rest) = first.split_once('=')?;
    let key = key.trim();
    let is_key = !key.is_empty() && key.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-');
    if !is_key || rest.trim().is_empty() {
        return None;
    }
    let mut text = String::new();
    for last in line..=lines.count().min(line + LONGEST_OFFER) {
        text += &filled(commented(lines.get(last))?);
        text.push('\n');
        if let Ok(found) = Document::parse(text.as_str()) {
            let span = found.get(key)?.span()?;
            let comment = text.get(span.end..)?.trim().trim_start_matches('#').trim();
            return Some((key.to_owned(), without_mark(comment).0.to_owned(), last));
        }
    }
    None
}

/// The lines of a section that is commented out: from its header up to the next header, or the next line that is no comment.
fn offered_lines(lines: &Lines<'_>, header: usize) -> Range<usize> {
    let goes_on = |line: &usize| commented(lines.get(*line)).is_some_and(|text| offered_header(text).is_none());
    header..(header + 1..=lines.count()).take_while(goes_on).last().unwrap_or(header) + 1
}

fn add_offers(lines: &Lines<'_>, form: &mut Form) {
    let mut line = 1;
    while line <= lines.count() {
        let Some(text) = commented(lines.get(line)) else {
            line += 1;
            continue;
        };
        if let Some((key, help)) = offered_header(text) {
            let help = if help.is_empty() { help_above(lines, line) } else { help };
            form.offers.push(Offer { key, place: OfferSource::Own, line, help });
            line = offered_lines(lines, line).end;
        } else if let Some((key, help, last)) = offered_key(lines, line) {
            let section = form.sections.iter_mut().rfind(|section| section.line <= line);
            if let Some(section) = section.filter(|section| section.fields.iter().all(|field| field.key != key)) {
                section.offers.push(Offer { key, place: OfferSource::Own, line, help });
            }
            line = last + 1;
        } else {
            line += 1;
        }
    }
}

/// A change of a cell file.
#[derive(Clone, Debug, Deserialize)]
#[serde(tag = "what", rename_all = "kebab-case", deny_unknown_fields)]
pub(crate) enum Edit {
    /// Replaces a value by a number as it was typed, by a text, or by any TOML if the old value is neither.
    Set { path: Vec<PathStep>, value: String },
    /// Accepts an example as the user's own value.
    Accept { path: Vec<PathStep> },
    /// Comments a key out.
    Omit { path: Vec<PathStep> },
    /// Adds a key to the section at this path, from a line where it is commented out or from the template.
    Take { path: Vec<PathStep>, place: OfferSource, line: usize },
    /// Adds a section without its optional keys.
    TakeSection { place: OfferSource, line: usize },
    /// Copies a section, with all sections in it, under another name.
    Copy { path: Vec<PathStep>, name: String },
    /// Removes a section and all sections in it.
    Remove { path: Vec<PathStep> },
}

impl Edit {
    /// The text with the change. All other bytes stay.
    ///
    /// # Errors
    /// A sentence for the user, where there is no such place or the value does not fit there.
    pub(crate) fn apply(&self, text: &str, template: &str) -> Result<String, String> {
        let document = Document::parse(text).map_err(|error| format!("the text is not TOML: {}", error.message()))?;
        let lines = Lines::of(text);
        let changed = match self {
            Self::Set { path, value } => set(&document, &lines, path, value)?,
            Self::Accept { path } => without_example(text, &lines, &find(&document, path)?.span),
            Self::Omit { path } => omit(&lines, &find(&document, path)?.span),
            Self::Take { place: OfferSource::Own, line, .. } => take_key(&lines, *line)?,
            Self::Take { path, place: OfferSource::Template, line } => {
                key_from(&Lines::of(template), *line, text, path)?
            }
            Self::TakeSection { place: OfferSource::Own, line } => take_section(&lines, *line)?,
            Self::TakeSection { place: OfferSource::Template, line } => section_from(template, *line, text)?,
            Self::Copy { path, name } => copy(text, path, name)?,
            Self::Remove { path } => remove(text, path)?,
        };
        Document::parse(changed.as_str()).map_err(|error| format!("this does not fit here: {}", error.message()))?;
        Ok(changed)
    }
}

/// A value of the document, and the bytes that state it.
struct SpannedValue<'a> {
    value: &'a Value,
    span: Range<usize>,
}

const GONE: &str = "this place is no longer in the file: load it again";

fn find<'a>(document: &'a Document<&str>, path: &[PathStep]) -> Result<SpannedValue<'a>, String> {
    let item = path.iter().try_fold(document.as_item(), |item, step| match step {
        PathStep::Key(key) => item.get(key),
        PathStep::Index(at) => item.get(*at),
    });
    let value = item.and_then(Item::as_value).ok_or(GONE)?;
    Ok(SpannedValue { value, span: value.span().ok_or(GONE)? })
}

fn set(document: &Document<&str>, lines: &Lines<'_>, path: &[PathStep], typed: &str) -> Result<String, String> {
    let SpannedValue { value, span } = find(document, path)?;
    let parsed = |text: &str| {
        let parsed = text.parse::<Value>();
        parsed.map_err(|error| format!("{text:?} is not a TOML value: {}", error.message().replace('\n', ", ")))
    };
    let written = match value {
        Value::Integer(_) | Value::Float(_) => {
            let text = with_a_point(typed.trim());
            match parsed(&text) {
                Ok(Value::Integer(_) | Value::Float(_)) => text,
                _ => return Err(format!("{typed:?} is not a number: write it like 0.05 or 8.5e5")),
            }
        }
        Value::String(_) => Value::from(typed).to_string(),
        _ => {
            parsed(typed.trim())?;
            typed.trim().to_owned()
        }
    };
    let mut text = lines.text.to_owned();
    text.replace_range(span.clone(), &written);
    let span = span.start..span.start + written.len();
    Ok(without_example(&text, &Lines::of(&text), &span))
}

/// A number with its decimal comma replaced by a point.
fn with_a_point(number: &str) -> String {
    let is_decimal_comma = number.matches(',').count() == 1 && !number.contains('.');
    if is_decimal_comma { number.replace(',', ".") } else { number.to_owned() }
}

/// The text without the mark of an example in the comment after a value, or after an element of an array.
fn without_example(text: &str, lines: &Lines<'_>, span: &Range<usize>) -> String {
    let mut changed = text.to_owned();
    let end = lines.range(lines.line(span.end.max(1) - 1)).end;
    let after = &text[span.end..end];
    // Within an array no comment begins with the mark.
    let mark = after.find('#').map(|hash| (hash, after[hash + 1..].trim_start()));
    if let Some((hash, comment)) = mark.filter(|(_, comment)| comment.starts_with(EXAMPLE)) {
        let help = comment[EXAMPLE.len()..].trim();
        let from = span.end + if help.is_empty() { after[..hash].trim_end().len() } else { hash };
        let to = span.end + after.trim_end_matches(['\n', '\r']).len();
        let kept = if help.is_empty() { String::new() } else { format!("# {help}") };
        changed.replace_range(from..to, &kept);
    }
    changed
}

/// The text with some lines changed.
fn with_lines(lines: &Lines<'_>, range: Range<usize>, change: impl Fn(&str) -> String) -> String {
    let (from, to) = (lines.range(range.start).start, lines.range(range.end - 1).end);
    let inside: String = range.map(|line| change(&lines.text[lines.range(line)])).collect();
    format!("{}{inside}{}", &lines.text[..from], &lines.text[to..])
}

fn omit(lines: &Lines<'_>, span: &Range<usize>) -> String {
    let (first, last) = (lines.line(span.start), lines.line(span.end.max(1) - 1));
    with_lines(lines, first..last + 1, |line| format!("# {line}"))
}

/// A line without its `# `.
fn uncommented(line: &str) -> String {
    let before = line.len() - line.trim_start().len();
    let text = line.trim_start().strip_prefix('#').unwrap_or(line);
    format!("{}{}", &line[..before], text.strip_prefix(' ').unwrap_or(text))
}

/// The lines of a key without their `# `. Its value is marked as an example, because it is not the user's own yet.
fn taken(lines: &Lines<'_>, first: usize, last: usize) -> String {
    let text: String = (first..=last).map(|line| filled(&uncommented(&lines.text[lines.range(line)]))).collect();
    as_example(&text)
}

/// A line with zeros in place of the blanks of a list, `[ , , ]`.
fn filled(line: &str) -> String {
    let Some((before, list)) = line.split_once("= [") else { return line.to_owned() };
    let Some((blanks, after)) = list.split_once(']') else { return line.to_owned() };
    let commas = blanks.matches(',').count();
    if commas == 0 || blanks.chars().any(|c| c != ',' && c != ' ') {
        return line.to_owned();
    }
    format!("{before}= [{}]{after}", vec!["0"; commas + 1].join(", "))
}

/// One key and its value, marked as an example.
fn as_example(text: &str) -> String {
    let end = Document::parse(text).ok().and_then(|document| {
        let (_, item) = document.as_table().iter().next()?;
        item.span().map(|span| span.end)
    });
    let Some(end) = end else { return text.to_owned() };
    let (value, after) = text.split_at(end);
    match after.split_once('#') {
        Some((_, comment)) if comment.trim_start().starts_with(EXAMPLE) => text.to_owned(),
        Some((gap, comment)) => format!("{value}{gap}# {EXAMPLE} {}", comment.trim_start()),
        None => {
            let line_end = &after[after.trim_end_matches(['\n', '\r']).len()..];
            format!("{value}   # {EXAMPLE}{line_end}")
        }
    }
}

fn checked(lines: &Lines<'_>, line: usize) -> Result<usize, String> {
    if (1..=lines.count()).contains(&line) { Ok(line) } else { Err(GONE.to_owned()) }
}

fn take_key(lines: &Lines<'_>, line: usize) -> Result<String, String> {
    let (_, _, last) = offered_key(lines, checked(lines, line)?).ok_or(GONE)?;
    let range = lines.range(line).start..lines.range(last).end;
    Ok(format!("{}{}{}", &lines.text[..range.start], taken(lines, line, last), &lines.text[range.end..]))
}

fn take_section(lines: &Lines<'_>, line: usize) -> Result<String, String> {
    commented(lines.get(checked(lines, line)?)).and_then(offered_header).ok_or(GONE)?;
    let range = offered_lines(lines, line);
    let mut changes = vec![(line, line, uncommented(&lines.text[lines.range(line)]))];
    let mut at = line + 1;
    while at < range.end {
        let Some((_, help, last)) = offered_key(lines, at) else {
            at += 1;
            continue;
        };
        if !(help.contains("left out") || help.starts_with("instead")) {
            changes.push((at, last, taken(lines, at, last)));
        }
        at = last + 1;
    }
    let mut text = lines.text.to_owned();
    for (first, last, changed) in changes.into_iter().rev() {
        text.replace_range(lines.range(first).start..lines.range(last).end, &changed);
    }
    Ok(text)
}

/// The text with a key of the template at the end of a section.
fn key_from(template: &Lines<'_>, line: usize, text: &str, path: &[PathStep]) -> Result<String, String> {
    let first = checked(template, line)?;
    let added = match offered_key(template, first) {
        Some((_, _, last)) => taken(template, first, last),
        None => as_example(&template.text[template.range(first)]),
    };
    let (_, range) = own_lines(text, path).into_iter().find(|(section, _)| section == path).ok_or(GONE)?;
    let lines = Lines::of(text);
    Ok(with_added(text, lines.range(range.end - 1).end, &added))
}

/// The text with a section of the template at its end.
fn section_from(template: &str, line: usize, text: &str) -> Result<String, String> {
    let lines = Lines::of(template);
    let header = checked(&lines, line)?;
    let added = match commented(lines.get(header)).and_then(offered_header) {
        Some(_) => {
            let taken = take_section(&lines, header)?;
            let lines = Lines::of(&taken);
            offered_lines_after(&lines, header).map(|line| lines.text[lines.range(line)].to_owned()).collect::<String>()
        }
        None => {
            let sections = form(template).sections;
            let section = sections.iter().find(|section| section.line == header).ok_or(GONE)?;
            let own = own_lines(template, &section.path).into_iter().find(|(path, _)| *path == section.path);
            own.ok_or(GONE)?.1.map(|line| &lines.text[lines.range(line)]).collect()
        }
    };
    let gap = if text.ends_with("\n\n") || text.is_empty() { "" } else { "\n" };
    Ok(with_added(text, text.len(), &format!("{gap}{added}")))
}

/// The lines of a section that was just added: up to the next empty line or the next header, commented out or not.
fn offered_lines_after(lines: &Lines<'_>, header: usize) -> Range<usize> {
    let goes_on = |line: &usize| {
        let text = lines.get(*line);
        let is_header = offered_header(commented(text).unwrap_or(text)).is_some();
        !text.trim().is_empty() && !is_header
    };
    header..(header + 1..=lines.count()).take_while(goes_on).last().unwrap_or(header) + 1
}

fn with_added(text: &str, at: usize, added: &str) -> String {
    let newline = if at == 0 || text[..at].ends_with('\n') { "" } else { "\n" };
    let end = if added.ends_with('\n') { "" } else { "\n" };
    format!("{}{newline}{added}{end}{}", &text[..at], &text[at..])
}

/// The lines of each section at a path and in it, in their order: from the header to the last value, with the comments directly
/// after it.
fn own_lines(text: &str, path: &[PathStep]) -> Vec<(Vec<PathStep>, Range<usize>)> {
    let lines = Lines::of(text);
    let sections = form(text).sections.into_iter().filter(|section| section.path.starts_with(path));
    let range = |section: &Section| {
        let last = section.fields.iter().map(|field| field.lines[1]).max().unwrap_or(section.line);
        let is_own = |line: &usize| commented(lines.get(*line)).is_some();
        let end = (last + 1..=lines.count()).take_while(is_own).last().unwrap_or(last);
        section.line..end + 1
    };
    sections.map(|section| (section.path.clone(), range(&section))).collect()
}

fn copy(text: &str, path: &[PathStep], name: &str) -> Result<String, String> {
    let Some((last, before)) = path.split_last() else { return Err(GONE.to_owned()) };
    let lines = Lines::of(text);
    let own = own_lines(text, path);
    let end = own.last().ok_or(GONE)?.1.end;
    let mut taken = before.to_owned();
    if matches!(last, PathStep::Key(_)) {
        let is_name = |c: char| c.is_alphanumeric() || "_-.[] #$".contains(c);
        if name.trim().is_empty() || !name.chars().all(is_name) {
            return Err(format!("{name:?} cannot be a name: expected letters, digits and _"));
        }
        taken.push(PathStep::Key(name.to_owned()));
        if !own_lines(text, &taken).is_empty() {
            return Err(format!("`{name}` is in the file already: choose another name"));
        }
    }
    let mut added = String::new();
    for (section, range) in &own {
        let header = lines.get(range.start);
        added.push('\n');
        match last {
            PathStep::Key(_) => {
                let steps = taken.iter().chain(&section[path.len()..]).cloned();
                let comment = header.find('#').filter(|_| !header.contains('"')).map_or("", |at| &header[at..]);
                added += format!("[{}] {comment}", header_of(steps)).trim_end();
            }
            PathStep::Index(_) => added += header,
        }
        added.push('\n');
        for line in range.start + 1..range.end {
            added += lines.get(line);
            added.push('\n');
        }
    }
    let at = lines.range(end - 1).end;
    let newline = if text[..at].ends_with('\n') { "" } else { "\n" };
    Ok(format!("{}{newline}{added}{}", &text[..at], &text[at..]))
}

/// Keys with points between, quoted where they must be.
fn header_of(steps: impl Iterator<Item = PathStep>) -> String {
    let keys: Vec<String> = steps
        .map(|step| match step {
            PathStep::Key(key) => toml_edit::Key::new(key).display_repr().into_owned(),
            PathStep::Index(at) => at.to_string(),
        })
        .collect();
    keys.join(".")
}

fn remove(text: &str, path: &[PathStep]) -> Result<String, String> {
    let own = own_lines(text, path);
    if own.is_empty() || path.is_empty() {
        return Err(GONE.to_owned());
    }
    let lines = Lines::of(text);
    let mut changed = text.to_owned();
    for (_, range) in own.iter().rev() {
        changed.replace_range(lines.range(range.start).start..lines.range(range.end - 1).end, "");
    }
    Ok(changed)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a failure is a failed test

    use super::{Edit, OfferSource, PathStep, Shown, form, form_with};

    const CELL: &str = r#"# A cell.
[robot]
model = "irb"   # geometry: from the maker
# start_deg = [0, 0, 0]   # how the arm stands
[cut]
force = "constant"  # none | constant | table

# The cutter.
[cut.cutter]
diameter_mm = 25.0   # << half of it: a ball
teeth = 2            # <<
mode = "slot"        # << slot | up (conventional) | down (climb)

# What is cut.
# [stock]
# wobj = "w"   # in whose axes; left out: the first
# box_mm = [
#   [0.0, 0.0, 0.0],
#   [3e2, 1, 1]]

[tools.tMill]
tcp_mm = [0.0, 0.0, 310.0] # << tooldata
[tools.tMill.cutter]
units = "mm"  # << where the file does not say: mm | inch
"#;

    fn path(text: &str) -> Vec<PathStep> {
        text.split('.')
            .map(|step| step.parse().map_or_else(|_| PathStep::Key(step.to_owned()), PathStep::Index))
            .collect()
    }

    fn set(text: &str, at: &str, value: &str) -> Result<String, String> {
        Edit::Set { path: path(at), value: value.to_owned() }.apply(text, "")
    }

    #[test]
    fn sections_fields_and_offers_are_found_with_their_lines() {
        let form = form(CELL);
        let titles: Vec<(&str, usize)> = form.sections.iter().map(|s| (s.title.as_str(), s.line)).collect();
        assert_eq!(
            titles,
            [("robot", 2), ("cut", 5), ("cut.cutter", 9), ("tools.tMill", 21), ("tools.tMill.cutter", 23)]
        );
        let [robot, cut, cutter, tool, inner] = &form.sections[..] else { panic!("{form:?}") };
        assert_eq!((robot.offers[0].key.as_str(), robot.offers[0].line), ("start_deg", 4));
        assert_eq!(cut.fields[0].choices, ["none", "constant", "table"]);
        assert_eq!(cutter.help, "The cutter.");
        assert_eq!(cutter.fields[0].shown, Shown::Number("25.0".to_owned()));
        assert!(cutter.fields[0].is_example && !cut.fields[0].is_example);
        assert_eq!(cutter.fields[2].choices, ["slot", "up", "down"]);
        assert!(cutter.fields[0].choices.is_empty());
        assert_eq!(tool.fields[0].shown, Shown::Numbers(["0.0", "0.0", "310.0"].map(str::to_owned).into()));
        assert_eq!(inner.fields[0].choices, ["mm", "inch"]);
        let offers: Vec<_> =
            form.offers.iter().map(|offer| (offer.key.as_str(), offer.line, offer.help.as_str())).collect();
        assert_eq!(offers, [("stock", 15, "What is cut.")]);
        assert_eq!(form.wrong, None);
    }

    #[test]
    fn an_edit_changes_its_place_alone() {
        let edited = set(CELL, "cut.cutter.diameter_mm", "12,5").unwrap();
        assert_eq!(edited, CELL.replace("25.0   # << half", "12.5   # half"));
        assert_eq!(set(CELL, "cut.cutter.teeth", "3").unwrap(), CELL.replace("teeth = 2            # <<", "teeth = 3"));
        assert_eq!(
            set(CELL, "tools.tMill.tcp_mm.2", "-1e2").unwrap(),
            CELL.replace("310.0] # << tooldata", "-1e2] # tooldata")
        );
        assert_eq!(set(CELL, "cut.force", "a \"b\"").unwrap(), CELL.replace("\"constant\"", "'a \"b\"'"));
        let accepted = Edit::Accept { path: path("cut.cutter.mode") }.apply(CELL, "").unwrap();
        assert_eq!(accepted, CELL.replace("# << slot", "# slot"));
        for (at, value) in [
            ("cut.cutter.teeth", "x"),
            ("cut.cutter.teeth", "2\nx = 1"),
            ("cut.nothing", "1"),
            ("tools.tMill.tcp_mm.3", "1"),
        ] {
            assert!(set(CELL, at, value).is_err(), "{at} {value}");
        }
    }

    #[test]
    fn what_only_the_template_has_is_offered_and_added() {
        let text = "[robot]\nmodel = \"x\" # mine\n\n[tools.t]\nmass_kg = 1\n\n[[effect]]\nkind = \"a\"";
        let template = format!("{CELL}\n# [[effect]]\n# kind = \"b\"\n");
        let form = form_with(text, &template);
        let titles: Vec<&str> = form.offers.iter().map(|offer| offer.key.as_str()).collect();
        // It has a tool and an effect of its own.
        assert_eq!(titles, ["cut", "cut.cutter", "stock"]);
        assert_eq!((form.sections[0].offers[0].key.as_str(), form.sections[0].offers[0].line), ("start_deg", 4));
        let take = |line| Edit::TakeSection { place: OfferSource::Template, line }.apply(text, &template).unwrap();
        assert_eq!(
            take(15),
            format!(
                "{text}\n\n[stock]\n# wobj = \"w\"   # in whose axes; left out: the first\nbox_mm = [\n  [0.0, 0.0, 0.0],\n  [3e2, 1, 1]]   # <<\n"
            )
        );
        assert_eq!(take(5), format!("{text}\n\n[cut]\nforce = \"constant\"  # none | constant | table\n"));
        let key =
            Edit::Take { path: path("robot"), place: OfferSource::Template, line: 4 }.apply(text, &template).unwrap();
        assert_eq!(key, text.replace("# mine\n", "# mine\nstart_deg = [0, 0, 0]   # << how the arm stands\n"));
    }

    fn own(line: usize) -> Edit {
        Edit::Take { path: Vec::new(), place: OfferSource::Own, line }
    }

    #[test]
    fn keys_and_sections_go_and_come_back() {
        let without = Edit::Omit { path: path("cut.cutter.teeth") }.apply(CELL, "").unwrap();
        assert_eq!(without, CELL.replace("teeth = 2 ", "# teeth = 2 "));
        assert_eq!(own(11).apply(&without, "").unwrap(), CELL);
        let taken = Edit::TakeSection { place: OfferSource::Own, line: 15 }.apply(CELL, "").unwrap();
        let expected = CELL.replace("# [stock]", "[stock]").replace("# box_mm", "box_mm");
        assert_eq!(taken, expected.replace("#   [0.0", "  [0.0").replace("#   [3e2, 1, 1]]", "  [3e2, 1, 1]]   # <<"));
        let stance = Edit::Take { path: path("robot"), place: OfferSource::Own, line: 4 }.apply(CELL, "").unwrap();
        assert_eq!(stance, CELL.replace("# start_deg = [0, 0, 0]   # how", "start_deg = [0, 0, 0]   # << how"));
        assert!(own(1).apply(CELL, "").is_err());
        assert!(own(999).apply(CELL, "").is_err());
    }

    #[test]
    fn a_list_that_is_left_blank_becomes_fields_to_fill_in() {
        let text = "# [a]\n# b_mm = [ , , ]\n";
        let taken = Edit::TakeSection { place: OfferSource::Own, line: 1 }.apply(text, "").unwrap();
        assert_eq!(taken, "[a]\nb_mm = [0, 0, 0]   # <<\n");
        assert_eq!(set(&taken, "a.b_mm.1", "2.5").unwrap(), "[a]\nb_mm = [0, 2.5, 0]\n");
    }

    #[test]
    fn a_tool_is_copied_with_what_is_inside_and_removed_again() {
        let copied = Edit::Copy { path: path("tools.tMill"), name: "t[2]".to_owned() }.apply(CELL, "").unwrap();
        let added = "\n[tools.\"t[2]\"]\ntcp_mm = [0.0, 0.0, 310.0] # << tooldata\n\n[tools.\"t[2]\".cutter]\nunits = \"mm\"  # << where the file does not say: mm | inch\n";
        assert_eq!(copied, format!("{CELL}{added}"));
        assert!(Edit::Copy { path: path("tools.tMill"), name: "tMill".to_owned() }.apply(CELL, "").is_err());
        let removed = Edit::Remove { path: vec![PathStep::Key("tools".into()), PathStep::Key("t[2]".into())] }
            .apply(&copied, "")
            .unwrap();
        assert_eq!(removed, format!("{CELL}\n\n"));
        let effects = "[[effect]]\na = 1\n[[effect]]\na = 2\n";
        assert_eq!(Edit::Remove { path: path("effect.0") }.apply(effects, "").unwrap(), "[[effect]]\na = 2\n");
        assert_eq!(set(effects, "effect.1.a", "3").unwrap(), "[[effect]]\na = 1\n[[effect]]\na = 3\n");
    }

    #[test]
    fn what_is_wrong_has_its_place() {
        let wrong = form("[robot]\nmodel = \n").wrong.unwrap();
        assert_eq!((wrong.line, wrong.column > 1), (2, true), "{wrong:?}");
        assert!(set("[robot]\nmodel = \n", "robot.model", "x").is_err());
    }
}
