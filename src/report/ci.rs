//! Formats that CI systems read: JUnit XML and SARIF 2.1.0.

use crate::text::Diagnostic;
use serde_json::{Value, json};
use std::fmt::Write;

/// The check of one program.
#[derive(Clone, Debug)]
pub struct CheckFile {
    /// Program, as the user typed it.
    pub path: String,
    /// Executed motions.
    pub targets: usize,
    /// What is wrong, at its place.
    pub findings: Vec<Diagnostic>,
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
        let text: Vec<String> = file.findings.iter().map(|finding| escape(&finding.to_string())).collect();
        let message = format!("{} of {} targets", file.findings.len(), file.targets);
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
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            c if c < ' ' && !matches!(c, '\n' | '\t') => out.push('\u{fffd}'),
            c => out.push(c),
        }
    }
    out
}

/// SARIF 2.1.0: one result a finding, on its line.
#[must_use]
pub fn sarif(files: &[CheckFile]) -> Value {
    let mut rules: Vec<&str> = files.iter().flat_map(|file| &file.findings).map(|finding| finding.code).collect();
    rules.sort_unstable();
    rules.dedup();
    let results: Vec<Value> = files
        .iter()
        .flat_map(|file| file.findings.iter().map(move |finding| (file, finding)))
        .map(|(file, finding)| {
            json!({
                "ruleId": finding.code,
                "level": "error",
                "message": { "text": finding.message },
                "locations": [{ "physicalLocation": {
                    "artifactLocation": { "uri": uri(if finding.file.is_empty() { &file.path } else { &finding.file }) },
                    "region": { "startLine": finding.line.max(1), "startColumn": finding.column.max(1) },
                } }],
            })
        })
        .collect();
    json!({
        "$schema": "https://json.schemastore.org/sarif-2.1.0.json",
        "version": "2.1.0",
        "runs": [{
            "tool": { "driver": {
                "name": "deflex",
                "version": env!("CARGO_PKG_VERSION"),
                "rules": rules.iter().map(|id| json!({ "id": id })).collect::<Vec<_>>(),
            } },
            "columnKind": "unicodeCodePoints",
            "results": results,
        }],
    })
}

/// A path as a URI reference.
fn uri(path: &str) -> String {
    path.bytes()
        .map(|b| match b {
            b'\\' => "/".to_owned(),
            b'A'..=b'Z' | b'a'..=b'z' | b'0'..=b'9' | b'/' | b'.' | b'-' | b'_' | b'~' => (b as char).to_string(),
            b => format!("%{b:02X}"),
        })
        .collect()
}

/// The check for scripts.
#[must_use]
pub fn check_json(files: &[CheckFile]) -> Value {
    let finding = |finding: &Diagnostic| {
        json!({
            "file": finding.file,
            "line": finding.line,
            "column": finding.column,
            "code": finding.code,
            "message": finding.message,
        })
    };
    let file = |file: &CheckFile| {
        json!({
            "path": file.path,
            "targets": file.targets,
            "passed": file.findings.is_empty(),
            "findings": file.findings.iter().map(finding).collect::<Vec<_>>(),
        })
    };
    json!({
        "passed": files.iter().all(|file| file.findings.is_empty()),
        "files": files.iter().map(file).collect::<Vec<_>>(),
    })
}
