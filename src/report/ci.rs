//! Formats that CI systems read: JUnit XML and SARIF 2.1.0.

use super::{Origin, VERSION};
use crate::text::{Diagnostic, printable};
use serde_json::{Value, json};
use std::fmt::Write;

/// The check of one program.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct CheckFile {
    /// Program, as the user typed it.
    pub path: String,
    /// Executed motions.
    pub targets: usize,
    /// What is wrong, at its place.
    pub findings: Vec<Diagnostic>,
    /// How many findings there are besides.
    pub more: usize,
    /// The program's files, where they were asked for.
    pub sources: Vec<Origin>,
}

impl CheckFile {
    /// The check of the program at `path` with so many executed motions.
    #[must_use]
    pub fn new(path: impl Into<String>, targets: usize, (findings, more): (Vec<Diagnostic>, usize)) -> Self {
        Self { path: path.into(), targets, findings, more, sources: Vec::new() }
    }

    /// How many findings there are, listed or not.
    #[must_use]
    pub fn count(&self) -> usize {
        self.findings.len() + self.more
    }

    /// The words for those that are not listed.
    #[must_use]
    pub fn rest(&self) -> Option<String> {
        (self.more > 0).then(|| format!("{} more findings: --report CSV has every target", self.more))
    }
}

/// JUnit XML: one test case a program, one failure for what is wrong with it. Elements and attributes are those that
/// the strictest reader in use (Jenkins' junit-10.xsd) knows.
#[must_use]
pub fn junit(files: &[CheckFile]) -> String {
    let failed = files.iter().filter(|file| !file.findings.is_empty()).count();
    let mut out = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n");
    // Writing to a String cannot fail.
    let _ = writeln!(out, "<testsuites name=\"deflex\" tests=\"{}\" failures=\"{failed}\" errors=\"0\">", files.len());
    let _ = writeln!(
        out,
        "  <testsuite name=\"deflex check\" tests=\"{}\" failures=\"{failed}\" errors=\"0\" skipped=\"0\">",
        files.len()
    );
    for file in files {
        let _ = write!(out, "    <testcase name=\"{0}\" classname=\"deflex.check\"", escape(&file.path));
        if file.findings.is_empty() {
            out.push_str("/>\n");
            continue;
        }
        let rest = file.rest().into_iter();
        let text: Vec<String> =
            file.findings.iter().map(ToString::to_string).chain(rest).map(|text| escape(&text)).collect();
        let message = format!("{} of {} targets", file.count(), file.targets);
        let _ = write!(
            out,
            ">\n      <failure message=\"{}\" type=\"tolerance\">{}</failure>\n    </testcase>\n",
            escape(&message),
            text.join("\n")
        );
    }
    out.push_str("  </testsuite>\n</testsuites>\n");
    out
}

fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in printable(text).chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            c => out.push(c),
        }
    }
    out
}

/// Results of one SARIF run: code scanning on GitHub refuses files with more than 25,000.
const MOST_RESULTS: usize = 24_999;

/// SARIF 2.1.0: one result a finding, on its line. What is over the number that services take is counted in a last note.
#[must_use]
pub fn sarif(files: &[CheckFile]) -> Value {
    let findings = || files.iter().flat_map(|file| file.findings.iter().map(move |finding| (file, finding)));
    let mut rules: Vec<&Diagnostic> = findings().map(|(_, finding)| finding).collect();
    rules.sort_by_key(|finding| finding.code);
    rules.dedup_by_key(|finding| finding.code);
    let result = |(file, finding): (&CheckFile, &Diagnostic)| {
        let path = if finding.file.is_empty() { &file.path } else { &finding.file };
        json!({
            "ruleId": finding.code,
            "ruleIndex": rules.partition_point(|rule| rule.code < finding.code),
            "level": "error",
            "message": { "text": finding.message },
            "locations": [{ "physicalLocation": {
                "artifactLocation": { "uri": uri(path) },
                "region": { "startLine": finding.line.max(1), "startColumn": finding.column.max(1) },
            } }],
        })
    };
    let mut results: Vec<Value> = findings().take(MOST_RESULTS).map(result).collect();
    let more = files.iter().map(CheckFile::count).sum::<usize>() - results.len();
    if more > 0 {
        let text = format!("{more} more findings are not listed here: `deflex check --report CSV` has every target");
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

/// What a rule asks, in a phrase.
fn short(code: &str) -> String {
    match code {
        "check.max-path-error" => "Error above the tolerance on the way into a target".to_owned(),
        "check.max-error" => "Error above the tolerance".to_owned(),
        "axis-limit" => "An axis beyond its limit on the way into a target".to_owned(),
        "axis-speed" => "An axis too slow for the feed on the way into a target".to_owned(),
        "singular" => "A singular posture on the way into a target".to_owned(),
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

/// The check for scripts.
#[must_use]
pub fn check_json(files: &[CheckFile]) -> Value {
    let finding = |finding: &Diagnostic| {
        let mut told = json!({
            "file": finding.file,
            "line": finding.line,
            "column": finding.column,
            "code": finding.code,
            "message": finding.message,
        });
        for (name, value) in &finding.figures {
            // Counts are whole numbers.
            told[*name] = if value.fract() == 0.0 { json!(*value as i64) } else { json!(value) };
        }
        told
    };
    let file = |file: &CheckFile| {
        json!({
            "path": file.path,
            "targets": file.targets,
            "passed": file.findings.is_empty(),
            "findings": file.findings.iter().map(finding).collect::<Vec<_>>(),
            "more_findings": file.more,
            "sources": file.sources,
        })
    };
    json!({
        "deflex": VERSION,
        "passed": files.iter().all(|file| file.findings.is_empty()),
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
        let log = sarif(&[CheckFile::new("a.mod", findings.len(), (findings, 0))]);
        let results = log["runs"][0]["results"].as_array().unwrap();
        assert_eq!(results.len(), MOST_RESULTS + 1);
        assert!(results[MOST_RESULTS]["message"]["text"].as_str().unwrap().starts_with("7 more findings"));
    }
}
