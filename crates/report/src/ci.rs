//! Formats that CI systems read: JUnit XML and SARIF 2.1.0.

use super::html::escape;
use super::summary::{counted, grouped};
use super::{Origin, Spot, VERSION, kept_text};
use deflex_correct::KeptCount;
use deflex_text::Diagnostic;
use serde::Serialize;
use serde_json::{Value, json};
use std::fmt::Write;

/// The result of `check` for one program.
///
/// # Examples
/// ```
/// use deflex_report::{CheckFile, Judgement};
///
/// let file = CheckFile::new("part.mod", Judgement::default(), (vec![], 7)); // none of the findings is listed
/// assert_eq!((&file.path[..], file.count()), ("part.mod", 7));
/// ```
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct CheckFile {
    /// Program, as the user typed it.
    pub path: String,
    /// Which targets were judged, and the verdicts.
    pub judgement: Judgement,
    /// The findings, each with its line.
    pub findings: Vec<Diagnostic>,
    /// How many more findings there are that are not listed.
    pub more: usize,
    /// The program's files, where they were requested.
    pub sources: Vec<Origin>,
}

/// What a check judged of a program. Each target is judged, in the air, or not judged.
///
/// # Examples
/// ```
/// use deflex_report::Judgement;
///
/// let none = Judgement::default();
/// assert!(none.targets == 0 && none.unjudged.is_empty());
/// ```
#[derive(Clone, Debug, Default)]
pub struct Judgement {
    /// Executed motions.
    pub targets: usize,
    /// Without cutting force.
    pub air: usize,
    /// Not judged, by reason.
    pub unjudged: Vec<KeptCount>,
    /// The first of them, at their places.
    pub skipped: Vec<Diagnostic>,
    /// How many more have a place.
    pub more_skipped: usize,
    /// Whether the check may pass although some targets are not judged (`--allow-unjudged`).
    pub allows_unjudged: bool,
    /// The largest errors that were found, and the limits.
    #[doc(hidden)]
    pub verdicts: Verdicts,
}

/// The three verdicts, each with a limit of its own.
#[derive(Clone, Debug, Default, Serialize)]
#[doc(hidden)]
pub struct Verdicts {
    /// Errors of the targets: `--max-error`.
    pub targets: Verdict,
    /// Distances from the programmed path between targets: `--max-path-error`.
    pub ways: Verdict,
    /// Jumps of the tip where the force sets in, ends or turns at once: `--max-jump`.
    pub jumps: Verdict,
}

/// The largest error of a kind, and its limit.
#[derive(Clone, Debug, Default, Serialize)]
#[doc(hidden)]
pub struct Verdict {
    /// Limit, mm; `None` if the error is reported and not judged.
    pub limit_mm: Option<f64>,
    /// The largest error that was found; `None` if there was none.
    pub largest: Option<Spot>,
}

impl Verdict {
    /// Whether the largest error is above the limit.
    #[must_use]
    pub(crate) fn fails(&self) -> bool {
        self.largest.as_ref().zip(self.limit_mm).is_some_and(|(largest, limit)| largest.mm > limit)
    }
}

impl Verdicts {
    /// The verdicts with the words for what is measured, and the help for a failure.
    fn all(&self) -> [(&Verdict, &'static str, &'static str); 3] {
        [
            (&self.targets, "targets", "correct the program with `deflex compensate`"),
            (
                &self.ways,
                "paths between targets",
                "insert targets with `deflex compensate --subdivide MM`, or raise the limit `--max-path-error`",
            ),
            (
                &self.jumps,
                "jumps of the force",
                "lead in and out of the cut gently, because no inserted target removes a jump; or raise the limit `--max-jump`",
            ),
        ]
    }

    /// A table with the largest error of each verdict and its limit, and the remedy for each that fails.
    fn table(&self) -> String {
        let judged: Vec<_> = self
            .all()
            .into_iter()
            .filter_map(|(verdict, what, help)| Some((verdict, what, help, verdict.largest.as_ref()?)))
            .collect();
        if judged.is_empty() {
            return String::new();
        }
        let places: Vec<String> =
            judged.iter().map(|(.., largest)| format!("target {}, line {}", largest.target, largest.line)).collect();
        let wide = places.iter().map(String::len).max().unwrap_or_default();
        let mut out = format!("  {:23}largest error  {:wide$}  tolerance\n", "", "at");
        // Writing to a String cannot fail.
        for ((verdict, what, _, largest), place) in judged.iter().zip(&places) {
            let _ = write!(out, "  {what:23}{:10.4} mm  {place:wide$}  ", largest.mm);
            let _ = match verdict.limit_mm {
                Some(limit) => writeln!(out, "{limit} mm{}", if verdict.fails() { ", exceeded" } else { "" }),
                None => writeln!(out, "none given, not judged"),
            };
        }
        for (.., help, _) in judged.iter().filter(|(verdict, ..)| verdict.fails()) {
            let _ = writeln!(out, "  help: {help}");
        }
        out
    }
}

impl Judgement {
    /// Targets that were not judged.
    #[must_use]
    pub(crate) fn unjudged_count(&self) -> usize {
        self.unjudged.iter().map(|unjudged| unjudged.count).sum()
    }

    /// Targets that were judged and cut.
    #[must_use]
    pub(crate) fn judged(&self) -> usize {
        self.targets.saturating_sub(self.air + self.unjudged_count())
    }

    /// Number of targets that had to be judged and were not.
    fn missing(&self) -> usize {
        if self.allows_unjudged { 0 } else { self.unjudged_count() }
    }
}

impl CheckFile {
    /// The check of the program at `path`.
    #[must_use]
    pub fn new(path: impl Into<String>, judgement: Judgement, (findings, more): (Vec<Diagnostic>, usize)) -> Self {
        Self { path: path.into(), judgement, findings, more, sources: Vec::new() }
    }

    /// Whether there are no findings, and every target was judged that had to be.
    #[must_use]
    #[doc(hidden)]
    pub fn passed(&self) -> bool {
        self.findings.is_empty() && self.judgement.missing() == 0
    }

    /// How many findings there are, listed or not.
    #[must_use]
    pub fn count(&self) -> usize {
        self.findings.len() + self.more
    }

    /// The sentence about the findings that are not listed.
    #[must_use]
    pub(crate) fn rest(&self) -> Option<String> {
        (self.more > 0).then(|| format!("{}: --report CSV has every target", more_of(self.more, "finding")))
    }

    /// The result in words: `ok`, `2 findings, 3 not judged`.
    fn verdict(&self) -> String {
        let findings = (self.count() > 0).then(|| counted(self.count(), "finding"));
        let missing = self.judgement.missing();
        let missing = (missing > 0).then(|| format!("{} not judged", grouped(missing)));
        let all: Vec<String> = findings.into_iter().chain(missing).collect();
        if all.is_empty() { "ok".to_owned() } else { all.join(", ") }
    }
}

/// `1 more finding`, `2000 more findings`.
fn more_of(count: usize, what: &str) -> String {
    format!("{count} more {what}{}", if count == 1 { "" } else { "s" })
}

/// The answer as text: one line for each finding, then the result of each program.
#[must_use]
#[doc(hidden)]
pub fn check_text(files: &[CheckFile]) -> String {
    let mut out = String::new();
    // Writing to a String cannot fail.
    for file in files {
        for finding in &file.findings {
            let _ = writeln!(out, "{finding}");
        }
        out.extend(file.rest().map(|rest| rest + "\n"));
        let sum = &file.judgement;
        let _ = write!(out, "{}: {}, {}", file.path, counted(sum.targets, "target"), file.verdict());
        let _ = write!(out, " ({} judged, {} air", grouped(sum.judged()), grouped(sum.air));
        let unjudged = sum.unjudged_count();
        if unjudged > 0 {
            let reasons: Vec<String> = sum.unjudged.iter().map(kept_text).collect();
            let _ = write!(out, ", {} not judged: {}", grouped(unjudged), reasons.join(", "));
        }
        out.push_str(")\n");
        out += &sum.verdicts.table();
    }
    out
}

/// JUnit XML: one test case for each program, with a failure if it has findings, and one skipped test case for each target that was not
/// judged. Elements and attributes are those that the strictest reader in use (Jenkins' junit-10.xsd) knows.
///
/// # Examples
/// ```
/// use deflex_report::{CheckFile, Judgement, junit};
///
/// let xml = junit(&[CheckFile::new("part.mod", Judgement::default(), (vec![], 0))]);
/// assert!(xml.contains("<testcase"));
/// ```
#[must_use]
pub fn junit(files: &[CheckFile]) -> String {
    let failed = files.iter().filter(|file| !file.passed()).count();
    let skipped: usize = files.iter().map(|file| file.judgement.skipped.len()).sum();
    let tests = files.len() + skipped;
    let mut out = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n");
    // Writing to a String cannot fail.
    let _ = writeln!(out, "<testsuites name=\"deflex\" tests=\"{tests}\" failures=\"{failed}\" errors=\"0\">");
    let _ = writeln!(
        out,
        "  <testsuite name=\"deflex check\" tests=\"{tests}\" failures=\"{failed}\" errors=\"0\" skipped=\"{skipped}\">"
    );
    for file in files {
        let _ = write!(out, "    <testcase name=\"{}\" classname=\"deflex.check\"", escape(&file.path));
        if file.passed() {
            out.push_str("/>\n");
        } else {
            let missing = file.judgement.missing();
            let missing = (missing > 0).then(|| {
                let reasons: Vec<String> = file.judgement.unjudged.iter().map(kept_text).collect();
                format!("not judged: {}; `--allow-unjudged` lets them pass", reasons.join(", "))
            });
            let all = file.findings.iter().map(ToString::to_string).chain(file.rest()).chain(missing);
            let text: Vec<String> = all.map(|text| escape(&text)).collect();
            let message = format!("{} of {}", file.verdict(), counted(file.judgement.targets, "target"));
            let _ = write!(
                out,
                ">\n      <failure message=\"{}\" type=\"tolerance\">{}</failure>\n    </testcase>\n",
                escape(&message),
                text.join("\n")
            );
        }
        for skipped in &file.judgement.skipped {
            let place = format!("{}:{}:{}", skipped.file, skipped.line, skipped.column);
            let _ = writeln!(
                out,
                "    <testcase name=\"{}\" classname=\"deflex.check\">\n      <skipped>{}</skipped>\n    </testcase>",
                escape(&place),
                escape(&skipped.message)
            );
        }
    }
    out.push_str("  </testsuite>\n</testsuites>\n");
    out
}

/// Results of one SARIF run: code scanning on GitHub refuses files with more than 25,000.
const MOST_RESULTS: usize = 24_999;

/// SARIF 2.1.0: one result for each finding, on its line, and one of kind `notApplicable` for each target that was not judged. Results
/// beyond the number that services accept are counted in a last note.
///
/// # Examples
/// ```
/// use deflex_report::{CheckFile, Judgement, sarif};
///
/// let run = sarif(&[CheckFile::new("part.mod", Judgement::default(), (vec![], 0))]);
/// assert_eq!(run["version"], "2.1.0");
/// ```
#[must_use]
pub fn sarif(files: &[CheckFile]) -> Value {
    let findings = || {
        files.iter().flat_map(|file| {
            let all = file.findings.iter().map(|finding| (finding, true));
            all.chain(file.judgement.skipped.iter().map(|skipped| (skipped, false))).map(move |found| (file, found))
        })
    };
    let mut rules: Vec<&Diagnostic> = findings().map(|(_, (finding, _))| finding).collect();
    rules.sort_by_key(|finding| finding.code);
    rules.dedup_by_key(|finding| finding.code);
    let result = |(file, (finding, judged)): (&CheckFile, (&Diagnostic, bool))| {
        let path = if finding.file.is_empty() { &file.path } else { &finding.file };
        let mut result = json!({
            "ruleId": finding.code,
            "ruleIndex": rules.partition_point(|rule| rule.code < finding.code),
            "level": "error",
            "message": { "text": finding.message },
            "locations": [{ "physicalLocation": {
                "artifactLocation": { "uri": uri(path) },
                "region": { "startLine": finding.line.max(1), "startColumn": finding.column.max(1) },
            } }],
        });
        if !judged {
            (result["kind"], result["level"]) = (json!("notApplicable"), json!("none"));
        }
        result
    };
    let mut results: Vec<Value> = findings().take(MOST_RESULTS).map(result).collect();
    let all = |file: &CheckFile| file.count() + file.judgement.skipped.len() + file.judgement.more_skipped;
    let more = files.iter().map(all).sum::<usize>() - results.len();
    if more > 0 {
        let text =
            format!("{} are not listed here: `deflex check --report CSV` has every target", more_of(more, "finding"));
        results.push(json!({ "kind": "informational", "level": "none", "message": { "text": text } }));
    }
    let rule = |rule: &&Diagnostic| {
        json!({
            "id": rule.code,
            "shortDescription": { "text": short(rule.code) },
            "help": { "text": rule.help.as_deref().unwrap_or("see the message") },
        })
    };
    json!({
        "$schema": "https://json.schemastore.org/sarif-2.1.0.json",
        "version": "2.1.0",
        "runs": [{
            "tool": { "driver": {
                "name": "deflex",
                "version": VERSION,
                "rules": rules.iter().map(rule).collect::<Vec<_>>(),
            } },
            "columnKind": "unicodeCodePoints",
            "results": results,
        }],
    })
}

/// A short description of a rule.
fn short(code: &str) -> String {
    match code {
        "check.max-path-error" => "Error above the tolerance on the path to a target".to_owned(),
        "check.max-error" => "Error above the tolerance".to_owned(),
        "axis-limit" => "An axis beyond its limit on the path to a target".to_owned(),
        "axis-speed" => "An axis too slow for the feed on the path to a target".to_owned(),
        "singular" => "A singular posture on the path to a target".to_owned(),
        "unreachable" => "A path out of reach between targets".to_owned(),
        "limits.max-correction" => "Correction above the limit".to_owned(),
        "limits.max-step" => "Correction steps too far between neighbours".to_owned(),
        "robot.unreachable" => "Target out of reach or beyond an axis limit".to_owned(),
        "target.unsolved" => "Target without a solution".to_owned(),
        other => other.replace(['.', '-'], " "),
    }
}

/// A path as a URI reference: absolute ones as `file:`, others relative to wherever the run was.
fn uri(path: &str) -> String {
    let path = path.replace('\\', "/");
    let path = path.trim_start_matches("./");
    let drive = matches!(path.as_bytes(), [b'A'..=b'Z' | b'a'..=b'z', b':', b'/', ..]);
    let mut out = match path {
        _ if drive => "file:///".to_owned(),
        path if path.starts_with('/') => "file://".to_owned(),
        _ => String::new(),
    };
    for (i, b) in path.bytes().enumerate() {
        match b {
            b'A'..=b'Z' | b'a'..=b'z' | b'0'..=b'9' | b'/' | b'.' | b'-' | b'_' | b'~' => out.push(char::from(b)),
            b':' if drive && i == 1 => out.push(':'),
            // Writing to a String cannot fail.
            b => drop(write!(out, "%{b:02X}")),
        }
    }
    out
}

/// The answer as JSON.
#[must_use]
#[doc(hidden)]
pub fn check_json(files: &[CheckFile]) -> Value {
    let finding = |finding: &Diagnostic| {
        let mut entry = json!({
            "file": finding.file,
            "line": finding.line,
            "column": finding.column,
            "code": finding.code,
            "message": finding.message,
        });
        for (name, value) in &finding.figures {
            // Counts are whole numbers.
            entry[*name] = if value.fract() == 0.0 { json!(*value as i64) } else { json!(value) };
        }
        entry
    };
    let file = |file: &CheckFile| {
        json!({
            "path": file.path,
            "targets": file.judgement.targets,
            "judged": file.judgement.judged(),
            "air": file.judgement.air,
            "unjudged": file.judgement.unjudged,
            "passed": file.passed(),
            "verdicts": file.judgement.verdicts,
            "findings": file.findings.iter().map(finding).collect::<Vec<_>>(),
            "more_findings": file.more,
            "sources": file.sources,
        })
    };
    json!({
        "deflex": VERSION,
        "passed": files.iter().all(CheckFile::passed),
        "files": files.iter().map(file).collect::<Vec<_>>(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_uri_references() {
        for (path, wanted) in [
            ("a b.mod", "a%20b.mod"),
            ("./sub/ä.mod", "sub/%C3%A4.mod"),
            ("sub\\a.mod", "sub/a.mod"),
            ("/tmp/100%.mod", "file:///tmp/100%25.mod"),
            ("C:\\parts\\a:b.mod", "file:///C:/parts/a%3Ab.mod"),
            ("a:b.mod", "a%3Ab.mod"),
        ] {
            assert_eq!(uri(path), wanted);
        }
    }

    #[test]
    fn a_run_holds_no_more_results_than_services_take() {
        let findings = vec![Diagnostic::error("check.max-error", "a.mod", "off"); MOST_RESULTS + 7];
        let log = sarif(&[CheckFile::new("a.mod", Judgement::default(), (findings, 0))]);
        let results = log["runs"][0]["results"].as_array().unwrap();
        assert_eq!(results.len(), MOST_RESULTS + 1);
        assert!(results[MOST_RESULTS]["message"]["text"].as_str().unwrap().starts_with("7 more findings"));
    }
}
