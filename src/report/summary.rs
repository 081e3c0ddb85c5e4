use super::{CheckFile, Origin};
use crate::correct::{Corrected, Summary};
use crate::program::Program;
use crate::text::Diagnostic;
use serde::Serialize;
use std::fmt::Write;

/// What one program came to, for `--json`.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct FileSummary {
    /// Program, as the user typed it.
    pub path: String,
    /// Executed motions.
    pub targets: usize,
    /// Targets whose numbers changed.
    pub corrected: usize,
    /// Without cutting force.
    pub air: usize,
    /// Not changed, by reason.
    pub kept: Vec<KeptCount>,
    /// Largest predicted error without correction, mm.
    pub max_error_mm: f64,
    /// Root mean square of it over cutting targets, mm; over all where none cuts.
    pub rms_error_mm: f64,
    /// Largest correction, mm.
    pub max_correction_mm: f64,
    /// Largest error that remains on a cutting target, mm.
    pub max_remaining_mm: f64,
    /// Largest error of a kept target, which stays, mm.
    pub max_kept_mm: f64,
    /// Largest distance of the tip from the programmed path on the way into cutting targets, mm; into all where none cuts.
    pub remaining_path_max_mm: f64,
    /// Root mean square of it over their length, mm.
    pub remaining_path_rms_mm: f64,
    /// Targets without an answer or over a limit.
    pub failures: Vec<FailureLine>,
    /// How many there are besides.
    #[serde(skip)]
    pub more_failures: usize,
    /// The program's files, where they were asked for.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub sources: Vec<Origin>,
}

/// How many targets were kept for a reason.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct KeptCount {
    /// Reason.
    pub reason: &'static str,
    /// Targets.
    pub count: usize,
}

/// A failed target.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct FailureLine {
    /// Line in the program.
    pub line: usize,
    /// What is wrong.
    pub message: String,
}

impl FileSummary {
    /// Sums up a run.
    #[must_use]
    pub fn new(path: &str, program: &Program, corrected: &Corrected) -> Self {
        Self::of(path, &Summary::of(&corrected.rows).with_unknown(program.unknown_targets()), &corrected.failures)
    }

    /// The same with what a check found for failures.
    #[must_use]
    pub fn with_findings(self, found: &CheckFile) -> Self {
        Self { failures: lines(&found.findings), more_failures: found.more, ..self }
    }

    /// The same from what was counted already.
    #[must_use]
    pub fn of(path: &str, sum: &Summary, failures: &[Diagnostic]) -> Self {
        Self {
            path: path.to_owned(),
            targets: sum.targets,
            corrected: sum.corrected,
            air: sum.air,
            kept: sum.kept.iter().map(|&(reason, count)| KeptCount { reason, count }).collect(),
            max_error_mm: sum.max_error_mm,
            rms_error_mm: sum.rms_error_mm,
            max_correction_mm: sum.max_correction_mm,
            max_remaining_mm: sum.max_remaining_mm,
            max_kept_mm: sum.max_kept_mm,
            remaining_path_max_mm: sum.remaining_path_max_mm,
            remaining_path_rms_mm: sum.remaining_path_rms_mm,
            failures: lines(failures),
            more_failures: 0,
            sources: Vec::new(),
        }
    }
}

fn lines(failures: &[Diagnostic]) -> Vec<FailureLine> {
    failures.iter().map(|failure| FailureLine { line: failure.line, message: failure.message.clone() }).collect()
}

/// `1,236 targets: 1,211 corrected, 20 air, 5 kept: 3 computed at run time, 2 …`
#[must_use]
pub fn summary_line(summary: &FileSummary) -> String {
    let mut line = format!(
        "{} targets: {} corrected, {} air",
        grouped(summary.targets),
        grouped(summary.corrected),
        grouped(summary.air)
    );
    let kept: usize = summary.kept.iter().map(|kept| kept.count).sum();
    if kept > 0 {
        // Writing to a String cannot fail.
        let _ = write!(line, ", {} kept: ", grouped(kept));
        let reasons: Vec<String> = summary.kept.iter().map(|k| format!("{} {}", grouped(k.count), k.reason)).collect();
        line += &reasons.join(", ");
    }
    line
}

/// A count with thousands set apart.
fn grouped(count: usize) -> String {
    let digits = count.to_string();
    let mut out = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push(',');
        }
        out.push(digit);
    }
    out
}

#[cfg(test)]
mod tests {
    #[test]
    fn thousands_are_set_apart() {
        assert_eq!([super::grouped(7), super::grouped(1236), super::grouped(1_000_000)], ["7", "1,236", "1,000,000"]);
    }
}
