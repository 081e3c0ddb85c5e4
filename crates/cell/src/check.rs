//! Checks values, and places each message at the key in the file.

use super::nearest;
use deflex_program::orientation::quaternion_of_zyx_deg;
use deflex_robot::Pose;
use deflex_text::{Diagnostic, Severity, Source, Span};
use nalgebra::{Quaternion, Translation3, UnitQuaternion};
use toml_edit::{Document, Item, TableLike};

/// Largest deviation of a declared quaternion's norm from 1: four printed decimals.
const QUAT_NORM: f64 = 1e-3;

/// Number of messages that are placed at a line of the file. Further messages only name their key.
const MOST_PLACED: usize = 500;

/// Collects the messages about one cell file.
pub(super) struct Check<'a> {
    pub(super) source: &'a Source,
    document: Option<Document<String>>,
    pub(super) errors: Vec<Diagnostic>,
    /// Warnings about values that are possible but seldom intended.
    pub(super) warnings: Vec<Diagnostic>,
}

/// An orientation in a cell file. Only one of these may be given.
pub(super) struct Turn {
    /// Quaternion, scalar first.
    pub(super) quat: Option<[f64; 4]>,
    /// KUKA's A, B, C: turns about z, then about the new y, then about the new x.
    pub(super) abc_deg: Option<[f64; 3]>,
    /// FANUC's W, P, R: turns about the fixed axes x, y, z.
    pub(super) wpr_deg: Option<[f64; 3]>,
}

impl<'a> Check<'a> {
    pub(super) fn new(source: &'a Source, text: &str) -> Self {
        Self { source, document: Document::parse(text.to_owned()).ok(), errors: Vec::new(), warnings: Vec::new() }
    }

    /// Adds an error at a key such as `cut.engagement.depth_mm`; the index in `effect.2.kind` counts from 0. If the
    /// file does not have the key, its nearest parent in the file is marked.
    pub(super) fn error(&mut self, key: &str, message: impl Into<String>, help: impl Into<String>) {
        let diagnostic = Diagnostic::error("cell.value", &self.source.name, message).help(help);
        // Finding the line of a message counts the lines from the top of the file, which is too slow for more messages
        // than are printed.
        let placed = self.errors.len() + self.warnings.len() < MOST_PLACED;
        let diagnostic = match self.span(key).filter(|_| placed) {
            Some(span) => diagnostic.at(self.source, span),
            None => diagnostic,
        };
        self.errors.push(diagnostic);
    }

    /// Adds a warning at a key.
    pub(super) fn warn(&mut self, key: &str, message: impl Into<String>, help: impl Into<String>) {
        self.error(key, message, help);
        self.warnings.extend(self.errors.pop().map(|error| error.severity(Severity::Warning)));
    }

    /// Whether the file has a key.
    pub(super) fn has(&self, key: &str) -> bool {
        self.span(key).is_some()
    }

    fn span(&self, key: &str) -> Option<Span> {
        let document = self.document.as_ref()?;
        let mut span = None;
        let mut table: &dyn TableLike = document.as_table();
        let mut parts = key.split('.').peekable();
        while let Some(part) = parts.next() {
            let item = table.get(part)?;
            span = item.span().or(span);
            let next = match item {
                Item::ArrayOfTables(tables) => {
                    let index: usize = parts.next()?.parse().ok()?;
                    let inner = tables.get(index)?;
                    span = inner.span().or(span);
                    Some(inner as &dyn TableLike)
                }
                item => item.as_table_like(),
            };
            match next {
                Some(next) if parts.peek().is_some() => table = next,
                _ => break,
            }
        }
        // A byte order mark was removed before the text was parsed.
        span.map(|range| Span::new(range.start, range.end))
    }

    pub(super) fn finite(&mut self, key: &str, values: &[f64]) {
        if let Some(value) = values.iter().find(|value| !value.is_finite()) {
            self.error(key, format!("{key}: {value}, expected a finite number"), "check the value");
        }
    }

    pub(super) fn positive(&mut self, key: &str, values: &[f64]) {
        if let Some(value) = values.iter().find(|value| !(value.is_finite() && **value > 0.0)) {
            self.error(key, format!("{key}: {value}, expected a number above 0"), "check the value and its unit");
        }
    }

    pub(super) fn quat(&mut self, key: &str, quat: [f64; 4]) {
        let norm = quat.iter().map(|v| v * v).sum::<f64>().sqrt();
        if norm.is_nan() || (norm - 1.0).abs() > QUAT_NORM {
            self.error(
                key,
                format!("{key} has norm {norm:.6}, expected 1"),
                "a quaternion is [q1, q2, q3, q4], scalar first",
            );
        }
    }

    /// The quaternion of an orientation that is given by one of the keys of table `key` whose names begin with `name`;
    /// `None` if there is none.
    pub(super) fn turn(&mut self, key: &str, name: &str, turn: Turn) -> Option<[f64; 4]> {
        let Turn { quat, abc_deg, wpr_deg } = turn;
        let given = [("quat", quat.is_some()), ("abc_deg", abc_deg.is_some()), ("wpr_deg", wpr_deg.is_some())];
        let given: Vec<String> =
            given.iter().filter(|(_, given)| *given).map(|(ending, _)| format!("{name}_{ending}")).collect();
        if let [_, second, ..] = &given[..] {
            let message = format!("{key}: {} say the same orientation", given.join(" and "));
            self.error(&format!("{key}.{second}"), message, "keep one of them");
        }
        if let Some(deg) = abc_deg.or(wpr_deg) {
            self.finite(&format!("{key}.{}", given[0]), &deg);
        }
        let angles = abc_deg.or(wpr_deg.map(|[w, p, r]| [r, p, w]));
        quat.or(angles.map(quaternion_of_zyx_deg))
    }

    /// The frame, in metres, that two keys of table `key` give.
    pub(super) fn frame(&mut self, key: &str, names: [&str; 2], position_mm: [f64; 3], quat: [f64; 4]) -> Pose {
        self.finite(&format!("{key}.{}", names[0]), &position_mm);
        self.quat(&format!("{key}.{}", names[1]), quat);
        let rotation = UnitQuaternion::new_normalize(Quaternion::new(quat[0], quat[1], quat[2], quat[3]));
        let [x, y, z] = position_mm.map(|v| 1e-3 * v);
        Pose::from_parts(Translation3::new(x, y, z), rotation.to_rotation_matrix())
    }

    /// The value of a word; an error if the word is not in the list.
    pub(super) fn word<T: Copy>(&mut self, key: &str, word: &str, known: &[(&str, T)]) -> Option<T> {
        let found = known.iter().find(|(name, _)| *name == word).map(|(_, value)| *value);
        if found.is_none() {
            let names: Vec<&str> = known.iter().map(|(name, _)| *name).collect();
            let meant = nearest(word, names.iter().copied()).map_or(String::new(), |n| format!("did you mean `{n}`? "));
            self.error(
                key,
                format!("{key} = \"{word}\" is not known"),
                format!("{meant}expected one of {}", names.join(", ")),
            );
        }
        found
    }

    /// A value that the run cannot do without; an error if it is missing.
    pub(super) fn need<T>(&mut self, parent: &str, key: &str, value: Option<T>, why: &str) -> Option<T> {
        if value.is_none() {
            self.error(parent, format!("{parent}.{key} is missing: {why}"), format!("add `{key} = …` to [{parent}]"));
        }
        value
    }
}
