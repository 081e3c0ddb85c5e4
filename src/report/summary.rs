use super::html::PathKind;
use super::{CheckFile, Origin};
use crate::correct::{Corrected, DrivenSummary, Summary};
use crate::text::Diagnostic;
use serde::Serialize;
use std::fmt;

/// What one program came to, for `--json`.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct FileSummary {
    /// Program, as the user typed it.
    pub path: String,
    /// Executed motions, inserted ones among them: the sum of those that are corrected, unchanged, in the air, inserted and kept.
    pub targets: usize,
    /// Targets whose numbers changed.
    pub corrected: usize,
    /// Targets that cut and whose numbers did not change, though they might: all that cut in a prediction.
    pub unchanged: usize,
    /// Targets without cutting force whose numbers did not change.
    pub air: usize,
    /// Targets that `--subdivide` inserted.
    pub inserted: usize,
    /// Not to be changed, by reason.
    pub kept: Vec<KeptCount>,
    /// Of the kept ones those that were not judged, because it is not known where the controller goes, by reason.
    pub unjudged: Vec<KeptCount>,
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
    /// How the controller drives it, where that was looked at.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub driven_path: Option<DrivenSummary>,
    /// Targets without an answer or over a limit.
    pub failures: Vec<FailureLine>,
    /// How many there are besides.
    #[serde(skip)]
    pub more_failures: usize,
    /// The program's files, where they were requested.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub sources: Vec<Origin>,
}

/// How many targets were kept, or not judged, for a reason.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct KeptCount {
    /// Reason.
    pub reason: &'static str,
    /// Targets.
    pub count: usize,
}

impl KeptCount {
    /// One a reason.
    #[must_use]
    pub fn all(counts: &[(&'static str, usize)]) -> Vec<Self> {
        counts.iter().map(|&(reason, count)| Self { reason, count }).collect()
    }
}

impl fmt::Display for KeptCount {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", grouped(self.count), self.reason)
    }
}

/// A failed target.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct FailureLine {
    /// File; empty where the program as a whole is meant.
    pub file: String,
    /// Line in the program.
    pub line: usize,
    /// What is wrong.
    pub message: String,
}

impl FileSummary {
    /// Sums up a run.
    #[must_use]
    pub fn new(path: &str, corrected: &Corrected) -> Self {
        let sum = Summary::of(&corrected.rows).with_inserted(corrected.inserted);
        Self { driven_path: corrected.driven, ..Self::of(path, &sum, &corrected.failures) }
    }

    /// Parts of the targets, whose sum they are.
    pub(super) fn parts(&self, kind: PathKind) -> Vec<(&'static str, usize)> {
        let kept = self.kept.iter().map(|kept| kept.count).sum();
        let rest = [("air", self.air), ("inserted", self.inserted), ("kept", kept)];
        match kind {
            PathKind::Compensate => {
                [("corrected", self.corrected), ("unchanged", self.unchanged)].into_iter().chain(rest).collect()
            }
            PathKind::Predict | PathKind::Check => [("cut", self.unchanged)].into_iter().chain(rest).collect(),
        }
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
            unchanged: sum.unchanged,
            inserted: sum.inserted,
            kept: KeptCount::all(&sum.kept),
            unjudged: KeptCount::all(&sum.unjudged),
            max_error_mm: sum.max_error_mm,
            rms_error_mm: sum.rms_error_mm,
            max_correction_mm: sum.max_correction_mm,
            max_remaining_mm: sum.max_remaining_mm,
            max_kept_mm: sum.max_kept_mm,
            remaining_path_max_mm: sum.remaining_path_max_mm,
            remaining_path_rms_mm: sum.remaining_path_rms_mm,
            driven_path: None,
            failures: lines(failures),
            more_failures: 0,
            sources: Vec::new(),
        }
    }
}

fn lines(failures: &[Diagnostic]) -> Vec<FailureLine> {
    let line = |failure: &Diagnostic| FailureLine {
        file: failure.file.clone(),
        line: failure.line,
        message: failure.message.clone(),
    };
    failures.iter().map(line).collect()
}

/// `1,236 targets: 1,211 corrected, 20 air, 5 kept: 3 computed at run time, 2 …`: the parts are the whole. Nothing is corrected in
/// a prediction: targets cut, are in the air or kept.
#[must_use]
pub fn summary_line(summary: &FileSummary, kind: PathKind) -> String {
    let first = match kind {
        PathKind::Compensate if summary.corrected == 0 && summary.driven_path.is_none() => "nothing was corrected: ",
        _ => "",
    };
    let mut line = format!("{first}{}: {}", counted(summary.targets, "target"), parts_text(&summary.parts(kind)));
    if !summary.kept.is_empty() {
        let reasons: Vec<String> = summary.kept.iter().map(ToString::to_string).collect();
        line += &format!(": {}", reasons.join(", "));
    }
    line
}

/// Parts of the targets; those of which there are none are left out, but for what was corrected or cut, and what is air.
pub(super) fn parts_text(parts: &[(&'static str, usize)]) -> String {
    let named = |(what, count): &(&str, usize)| *count > 0 || ["corrected", "cut", "air"].contains(what);
    let parts: Vec<String> =
        parts.iter().filter(|part| named(part)).map(|(what, count)| format!("{} {what}", grouped(*count))).collect();
    parts.join(", ")
}

/// `1 target`, `1,236 targets`.
pub(crate) fn counted(count: usize, what: &str) -> String {
    format!("{} {what}{}", grouped(count), if count == 1 { "" } else { "s" })
}

/// A count with thousands set apart.
pub(crate) fn grouped(count: usize) -> String {
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
