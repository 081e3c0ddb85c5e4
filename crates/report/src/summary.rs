use super::Origin;
use deflex_correct::{Corrected, DrivenSummary, KeptCount, Streamed, Summary};
use deflex_text::Diagnostic;
use serde::Serialize;

/// The command that made a page.
///
/// # Examples
/// ```
/// use deflex_report::html::{PathKind, PathTrace};
///
/// let trace = PathTrace::new(PathKind::Predict, 1); // the errors of one program as it is
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum PathKind {
    /// A program was corrected.
    Compensate,
    /// The errors of a program as it is.
    Predict,
    /// The errors of a program, judged by `check`; [`FileSummary::failures`] are listed.
    Check,
}

/// The summary of one program, for `--json`.
///
/// # Examples
/// ```
/// # let (program, cell) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/slot.rs"));
/// # let corrected = deflex_correct::compensate(&program, &cell, &Default::default())?;
/// use deflex_correct::Summary;
/// use deflex_report::FileSummary;
///
/// let summary = FileSummary::of("slot.mod", &Summary::of(&corrected.rows), &[]);
/// assert!(summary.failures.is_empty() && summary.counts.max_remaining_mm < 1e-3);
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct FileSummary {
    /// Program, as the user typed it.
    pub path: String,
    /// Counts and sizes.
    #[serde(flatten)]
    pub counts: Summary,
    /// The path that the controller drives; `None` if it was not computed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub driven_path: Option<DrivenSummary>,
    /// Targets that were not solved or exceed a limit.
    pub failures: Vec<FailureLine>,
    /// How many more failures there are that are not listed.
    #[serde(skip)]
    pub more_failures: usize,
    /// The program's files, where they were requested.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub sources: Vec<Origin>,
}

/// A failed target.
///
/// # Examples
/// ```
/// # let (program, cell) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/slot.rs"));
/// # let corrected = deflex_correct::compensate(&program, &cell, &Default::default())?;
/// use deflex_correct::Summary;
/// use deflex_report::FileSummary;
///
/// for failure in FileSummary::of("slot.mod", &Summary::of(&corrected.rows), &corrected.failures).failures {
///     println!("line {}: {}", failure.line, failure.message);
/// }
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct FailureLine {
    /// File; empty if the failure is about the program as a whole.
    pub file: String,
    /// Line in the program.
    pub line: usize,
    /// What is wrong.
    pub message: String,
}

impl FileSummary {
    /// The summary of a run.
    ///
    /// # Examples
    /// ```
    /// # let (program, cell) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/slot.rs"));
    /// let corrected = deflex_correct::compensate(&program, &cell, &Default::default())?;
    /// let summary = deflex_report::FileSummary::new("slot.mod", &corrected);
    /// assert!(summary.counts.corrected > 0);
    /// # Ok::<(), deflex_text::Diagnostics>(())
    /// ```
    #[must_use]
    pub fn new(path: &str, corrected: &Corrected) -> Self {
        let sum = Summary::of(&corrected.rows).with_inserted(corrected.inserted);
        Self { driven_path: corrected.driven, ..Self::of(path, &sum, &corrected.failures) }
    }

    /// The number of targets of each status. They add up to the number of all targets.
    pub(super) fn parts(&self, kind: PathKind) -> Vec<(&'static str, usize)> {
        let Summary { corrected, unchanged, air, inserted, ref kept, .. } = self.counts;
        let kept = kept.iter().map(|kept| kept.count).sum();
        let rest = [("air", air), ("inserted", inserted), ("kept", kept)];
        match kind {
            PathKind::Compensate => {
                [("corrected", corrected), ("unchanged", unchanged)].into_iter().chain(rest).collect()
            }
            PathKind::Predict | PathKind::Check => [("cut", unchanged)].into_iter().chain(rest).collect(),
        }
    }

    /// The same summary with findings of `check` as failures; `more` of them are not listed.
    #[must_use]
    #[doc(hidden)]
    pub fn with_findings(self, findings: &[Diagnostic], more: usize) -> Self {
        Self { failures: lines(findings), more_failures: more, ..self }
    }

    /// The summary of a program that was streamed.
    #[must_use]
    #[doc(hidden)]
    pub fn of_streamed(path: &str, streamed: &Streamed) -> Self {
        Self { driven_path: streamed.driven, ..Self::of(path, &streamed.summary, &[]) }
    }

    /// The summary from counts that were collected in parts.
    #[must_use]
    pub fn of(path: &str, sum: &Summary, failures: &[Diagnostic]) -> Self {
        Self {
            path: path.to_owned(),
            counts: sum.clone(),
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

/// `target computed at run time (3)`: a reason and how many targets it keeps.
///
/// # Examples
/// ```
/// use deflex_correct::{KeptCount, KeptReason};
///
/// let kept = KeptCount { reason: KeptReason::ProgramRefused, count: 1200 };
/// assert_eq!(deflex_report::kept_text(&kept), format!("{} (1,200)", KeptReason::ProgramRefused.text()));
/// ```
#[must_use]
pub fn kept_text(kept: &KeptCount) -> String {
    format!("{} ({})", kept.reason, grouped(kept.count))
}

/// `1,236 targets: 1,211 corrected, 20 air, 5 kept: target computed at run time (3), … (2)`: the parts add up to the number of targets.
/// A prediction corrects nothing: there the targets cut, are in the air, or are kept.
///
/// # Examples
/// ```
/// # let (program, cell) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/slot.rs"));
/// # let corrected = deflex_correct::compensate(&program, &cell, &Default::default())?;
/// use deflex_correct::Summary;
/// use deflex_report::html::PathKind;
/// use deflex_report::{FileSummary, summary_line};
///
/// let summary = FileSummary::of("slot.mod", &Summary::of(&corrected.rows), &[]);
/// assert!(summary_line(&summary, PathKind::Compensate).starts_with("81 targets: 81 corrected"));
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[must_use]
pub fn summary_line(summary: &FileSummary, kind: PathKind) -> String {
    let first = match kind {
        PathKind::Compensate if summary.counts.corrected == 0 && summary.driven_path.is_none() => {
            "nothing was corrected: "
        }
        _ => "",
    };
    let mut line =
        format!("{first}{}: {}", counted(summary.counts.targets, "target"), parts_text(&summary.parts(kind)));
    if !summary.counts.kept.is_empty() {
        let reasons: Vec<String> = summary.counts.kept.iter().map(kept_text).collect();
        line += &format!(": {}", reasons.join(", "));
    }
    line
}

/// The counts as text. Counts of 0 are left out, except those of corrected or cut targets and of air.
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

/// A count with a comma between thousands.
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
