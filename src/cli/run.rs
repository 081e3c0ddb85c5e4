//! The common part of `compensate`, `predict` and `check`: runs programs in parallel, and gathers their results in the
//! order of the inputs.

use super::args::Reports;
use super::predicted::Passed;
use super::report;
use super::{Answer, Outcome, STACK_BYTES, message, progress};
use crate::session::finished::Finished;
use crate::session::job::Job;
use crate::session::output::Outputs;
use crate::session::read::parted;
use crate::session::report::{Noticed, Rows};
use crate::session::setup::Setup;
use deflex::correct::{Corrected, KeptCount, KeptReason};
use deflex::program::{Program, Reason};
use deflex::report::html::{PathKind, PathPage, PathTrace};
use deflex::report::{Digest, FileSummary, Origin};
use deflex::text::{Diagnostic, Severity, printable_line};
use indicatif::ProgressBar;
use std::sync::{Mutex, PoisonError};

/// Results of one program.
pub(super) struct Done {
    /// Output files that are already staged.
    pub(super) outputs: Outputs,
    /// Rows for the `--report` of all programs; `None` if no report is wanted, or if it is staged already.
    pub(super) rows: Option<Rows>,
    pub(super) summary: FileSummary,
    /// The summary for the terminal.
    pub(super) text: String,
    pub(super) notes: Vec<Diagnostic>,
    /// The path for `--html`.
    pub(super) path: Option<PathTrace>,
    /// The targets with the largest errors.
    pub(super) digest: Digest,
}

impl Done {
    /// Adds names and hashes of the program's files, which a JSON summary or a page states.
    pub(super) fn made_from(mut self, origins: Vec<Origin>) -> Self {
        self.summary.sources = origins;
        self
    }

    pub(super) fn new(
        (name, kind): (&str, PathKind),
        program: &Program,
        corrected: Corrected,
        outputs: Outputs,
        path: Option<PathTrace>,
        noticed: Noticed<'_>,
    ) -> Result<Self, Vec<Diagnostic>> {
        let Finished { rows, summary, notes, path, digest } = Finished::new(name, program, corrected, path, noticed)?;
        let text = report::summary_text(&summary, kind);
        Ok(Self { outputs, rows: Some(rows), summary, text, notes, path, digest })
    }

    /// Results of a program that was read chunk by chunk.
    pub(super) fn streamed(name: &str, kind: PathKind, passed: Passed) -> Self {
        let Passed { streamed, outputs, rows, path, digest } = passed;
        let summary = FileSummary::of_streamed(name, &streamed);
        let text = report::summary_text(&summary, kind);
        Self { outputs, rows, summary, text, notes: streamed.notes, path, digest }
    }
}

/// Names and hashes of a program's files, if a report states them; otherwise empty.
pub(super) fn origins(job: &Job, reports: &Reports) -> Result<Vec<Origin>, Vec<Diagnostic>> {
    if reports.json.is_some() || reports.html.is_some() { job.origins() } else { Ok(Vec::new()) }
}

/// Runs every program, and returns the results and the errors. If any program has an error, no result is returned,
/// except with `--keep-going`.
pub(super) fn each<T: Send>(
    jobs: Vec<Job>,
    (quiet, keep_going): (bool, bool),
    failed: Vec<Diagnostic>,
    one: impl Fn(Job, &ProgressBar) -> Result<T, Vec<Diagnostic>> + Sync,
) -> Result<(Vec<T>, Vec<Diagnostic>), Vec<Diagnostic>> {
    let bar = progress::bar(jobs.len(), quiet);
    let count = rayon::current_num_threads().min(jobs.len());
    let (queue, done) = (Mutex::new(jobs.into_iter().enumerate()), Mutex::new(Vec::new()));
    let next = || queue.lock().unwrap_or_else(PoisonError::into_inner).next();
    let work = || {
        while let Some((at, job)) = next() {
            bar.set_message(printable_line(&job.name).into_owned());
            let answer = one(job, &bar);
            bar.inc(1);
            done.lock().unwrap_or_else(PoisonError::into_inner).push((at, answer));
        }
    };
    // These threads are not from the pool: a program waits for its chunks, and the chunks need the threads of the pool.
    std::thread::scope(|scope| {
        for _ in 0..count {
            if std::thread::Builder::new().stack_size(STACK_BYTES).spawn_scoped(scope, work).is_err() {
                // If the system starts no further thread, this thread does the work.
                work();
            }
        }
    });
    let mut done = done.into_inner().unwrap_or_else(PoisonError::into_inner);
    done.sort_by_key(|(at, _)| *at);
    let done: Vec<_> = done.into_iter().map(|(_, answer)| answer).collect();
    bar.finish_and_clear();
    let (done, more) = parted(done);
    let failed = [failed, more].concat();
    let go_on = keep_going && !done.is_empty();
    if failed.is_empty() || go_on { Ok((done, failed)) } else { Err(failed) }
}

/// One warning if the error between targets of corrected programs is larger than the cell's limit.
fn left_on_the_way(setup: &Setup, summaries: &[FileSummary]) -> Option<Diagnostic> {
    let most = 1e3 * setup.cell.cell.limits.max_path_error;
    // Programs that were corrected along their driven path have a more exact message.
    let over = || summaries.iter().filter(|sum| sum.counts.remaining_path_max_mm > most && sum.driven_path.is_none());
    let worst = over().max_by(|a, b| a.counts.remaining_path_max_mm.total_cmp(&b.counts.remaining_path_max_mm))?;
    let others = match over().count() {
        1 => String::new(),
        count => format!(", the largest of {count} programs"),
    };
    let message = format!(
        "an error of up to {:.4} mm remains between targets (rms {:.4} mm){others}, more than max_path_error_mm = {most}",
        worst.counts.remaining_path_max_mm, worst.counts.remaining_path_rms_mm
    );
    let help = match setup.options.subdivide {
        None => "`--subdivide MM` inserts targets; the column remaining_path_mm of the report shows where",
        // Targets here are already so close to each other that further ones cannot follow the force.
        Some(_) => {
            "the tip jumps where the force sets in, ends or turns at once: lead in and out of the cut gently; the column \
             remaining_path_mm of the report shows where"
        }
    };
    let note = Diagnostic::error("limits.max-path-error", &worst.path, message);
    Some(note.severity(Severity::Note).help(help))
}

/// A warning or note if the corrected program is equal to the original one.
fn corrected_nothing(summary: &FileSummary) -> Option<Diagnostic> {
    if summary.counts.corrected > 0 || summary.counts.targets == 0 || summary.driven_path.is_some() {
        return None;
    }
    let reasons: Vec<String> = summary.counts.kept.iter().map(deflex::report::kept_text).collect();
    let is_shared = |kept: &KeptCount| {
        use Reason::{AlongOtherPosture, AlongOutOfReach, AlongTooFar, SharedTarget};
        matches!(kept.reason, KeptReason::Program(SharedTarget | AlongOutOfReach | AlongTooFar | AlongOtherPosture))
    };
    let (severity, why, help) = match reasons.is_empty() {
        true => {
            (Severity::Note, "no target needs a correction".to_owned(), "check `[cut]` of the cell, if one should cut")
        }
        false => (
            Severity::Warning,
            format!("kept: {}", reasons.join(", ")),
            match summary.counts.kept.iter().any(is_shared) {
                true => "`--allow-clones` gives each motion a declaration of its own; `deflex inspect` names the lines",
                false => "column `reason` of the report says why; `deflex inspect` names the lines",
            },
        ),
    };
    let diagnostic = Diagnostic::error("compensate.nothing", &summary.path, format!("nothing was corrected; {why}"));
    Some(diagnostic.severity(severity).help(help))
}

/// Gathers the results of the programs, writes the files, and prints the summary.
pub(super) fn finish(
    mut outputs: Outputs,
    setup: &Setup,
    kind: PathKind,
    (done, failed): (Vec<Done>, Vec<Diagnostic>),
    reports: &Reports,
    quiet: bool,
) -> Outcome {
    let mut notes = setup.notes();
    let (mut rows, mut summaries, mut texts, mut paths) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for program in done {
        outputs.append(program.outputs, &program.summary.path)?;
        notes.extend(program.notes.into_iter().filter(|note| !notes.contains(note)).collect::<Vec<_>>());
        rows.extend(program.rows);
        paths.extend(program.path.map(|path| (program.summary.clone(), path)));
        summaries.push(program.summary);
        texts.push(program.text);
    }
    if kind == PathKind::Compensate {
        notes.splice(0..0, summaries.iter().filter_map(corrected_nothing));
    }
    notes.extend(left_on_the_way(setup, &summaries).filter(|_| kind == PathKind::Compensate));
    if let Some(path) = reports.report.as_ref().filter(|_| !rows.is_empty()) {
        report::joined(&mut outputs, path, &rows)?;
    }
    let cell = setup.cell.origin();
    report::json(&mut outputs, reports.json.as_ref(), &cell, &summaries)?;
    let page = PathPage { kind, cell: &cell, programs: &paths, scene: Some(&setup.cell.cell), tolerance_mm: None };
    outputs.add_report(reports.html.as_ref(), || Ok(page.html()))?;
    outputs.commit()?;
    message::print(&setup.cell.own(notes), quiet);
    if !quiet {
        texts.retain(|text| !text.is_empty());
        message::print_lines(&texts);
    }
    // The results are written. The programs with errors have been listed, and make the exit code 2.
    if failed.is_empty() { Ok(Answer::Yes) } else { Err(failed) }
}
