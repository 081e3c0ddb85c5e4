//! What was understood of programs, as a table and as JSON (`docs/reference.md`, `inspect --json`).

use crate::program::{Language, Program, RoundTrip};
use crate::text::{Diagnostic, printable_line};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write;

/// One inspected file.
#[derive(Clone, Debug, Serialize)]
pub struct InspectFile {
    /// As the user typed it.
    pub path: String,
    /// Its [word](Language::word); `None` where it was not recognised.
    pub language: Option<&'static str>,
    /// Who made it, as far as the text tells.
    pub dialect: Option<&'static str>,
    /// Executed motions.
    pub motion_targets: usize,
    /// Complete numeric positions in the text.
    pub literal_targets: usize,
    /// Arcs among the executed motions.
    pub arcs: usize,
    /// Why the file as a whole is not read.
    pub refused: Option<String>,
    /// Statements that come out as they went in, and why.
    pub kept: Vec<KeptLine>,
    /// Whether it survives a write, unchanged and shifted.
    pub round_trip: bool,
    /// What differed, where it does not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub round_trip_fault: Option<String>,
    /// Names of the tools used.
    pub tools: Vec<String>,
    /// Names of the work objects used.
    pub wobjs: Vec<String>,
}

/// Statements that are kept or refused, and what is asked of the machine besides motion, by line.
fn kept_lines(program: &Program) -> Vec<KeptLine> {
    let kept = program.kept.iter().map(|kept| KeptLine { line: kept.line, reason: kept.reason });
    let actions = program.actions.iter().map(|action| KeptLine { line: action.line, reason: action.kind.what() });
    let mut lines: Vec<KeptLine> = kept.chain(actions).collect();
    lines.sort_by_key(|kept| kept.line);
    lines
}

/// A kept statement.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct KeptLine {
    /// Line.
    pub line: usize,
    /// Reason.
    pub reason: &'static str,
}

impl InspectFile {
    /// A program that was read, and what its round trip showed.
    #[must_use]
    pub fn read(path: &str, program: &Program, proof: &RoundTrip) -> Self {
        // The names of CL input are the cell's, not the file's.
        fn names<'a>(own: bool, names: impl Iterator<Item = &'a str>) -> Vec<String> {
            names.filter(|_| own).map(str::to_owned).collect()
        }
        let own = program.language != Language::Cl;
        Self {
            path: path.to_owned(),
            language: Some(program.language.word()),
            dialect: Some(program.dialect),
            motion_targets: program.motion_targets(),
            literal_targets: program.literal_targets,
            arcs: program.arcs,
            refused: None,
            kept: kept_lines(program),
            round_trip: proof.holds(),
            round_trip_fault: proof.why.clone(),
            tools: names(own, program.tools.iter().map(|tool| &*tool.name)),
            wobjs: names(own, program.wobjs.iter().map(|wobj| &*wobj.name)),
        }
    }

    /// A file that is refused as a whole.
    #[must_use]
    pub fn refused(path: &str, language: Option<Language>, errors: &[Diagnostic]) -> Self {
        let reason = errors.first().map_or_else(|| "not read".to_owned(), |error| error.message.clone());
        Self {
            path: path.to_owned(),
            language: language.map(Language::word),
            dialect: None,
            motion_targets: 0,
            literal_targets: 0,
            arcs: 0,
            refused: Some(reason),
            kept: Vec::new(),
            round_trip: false,
            round_trip_fault: None,
            tools: Vec::new(),
            wobjs: Vec::new(),
        }
    }
}

/// The answer for scripts.
#[derive(Clone, Debug, Serialize)]
pub struct InspectFiles<'a> {
    /// In the order given.
    pub files: &'a [InspectFile],
}

/// The answer for people: a row a file, then what was kept and refused.
#[must_use]
pub fn inspect_table(files: &[InspectFile]) -> String {
    let width = files.iter().map(|file| file.path.chars().count()).max().unwrap_or(0).max(4);
    let mut out = format!(
        "{:width$}  {:8}  {:14}  {:>8}  {:>8}  {:>5}  {:>5}  round trip\n",
        "file", "language", "dialect", "motions", "literals", "arcs", "kept"
    );
    for file in files {
        let (language, dialect) = (file.language.unwrap_or("?"), file.dialect.unwrap_or("-"));
        let proof = match (&file.refused, file.round_trip) {
            (Some(_), _) => "refused",
            (None, true) => "holds",
            (None, false) => "FAILS",
        };
        // Writing to a String cannot fail.
        let _ = writeln!(
            out,
            "{:width$}  {language:8}  {dialect:14}  {:>8}  {:>8}  {:>5}  {:>5}  {proof}",
            printable_line(&file.path),
            file.motion_targets,
            file.literal_targets,
            file.arcs,
            file.kept.len(),
        );
    }
    for file in files {
        details(file, &mut out);
    }
    out
}

/// Tools, kept statements by reason and what is wrong, of one file.
fn details(file: &InspectFile, out: &mut String) {
    let mut say = |line: String| {
        // Writing to a String cannot fail.
        let _ = writeln!(out, "{}: {}", printable_line(&file.path), printable_line(&line));
    };
    if let Some(reason) = &file.refused {
        say(format!("refused: {reason}"));
        return;
    }
    if !file.tools.is_empty() {
        say(format!("tools {}; work objects {}", file.tools.join(", "), file.wobjs.join(", ")));
    }
    let mut reasons: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for kept in &file.kept {
        reasons.entry(kept.reason).or_default().push(kept.line);
    }
    for (reason, lines) in reasons {
        const SHOWN: usize = 5; // the rest is in the JSON
        let shown: Vec<String> = lines.iter().take(SHOWN).map(ToString::to_string).collect();
        let more = if lines.len() > SHOWN { ", …" } else { "" };
        say(format!("{} kept: {reason} (line {}{more})", lines.len(), shown.join(", ")));
    }
    if let Some(fault) = &file.round_trip_fault {
        say(format!("round trip: {fault}"));
    }
}
