//! `predict` and `check` of long programs in constant memory.

use super::against::Originals;
use super::progress;
use super::report::ProgramReports;
use crate::session::Tolerances;
use crate::session::job::Job;
use crate::session::lines;
use crate::session::output::{Outputs, cannot_write};
use crate::session::report::{Noticed, Rows};
use crate::session::setup::Setup;
use crate::session::text::Text;
use crate::session::tolerances::Listed;
use deflex::correct::{Judge, Judged, StreamError, Streamed, predict_long};
use deflex::program::LongText;
use deflex::report::html::PathTrace;
use deflex::report::{Digest, Findings};
use deflex::text::Diagnostic;
use indicatif::ProgressBar;
use std::path::Path;

/// The settings that all programs of a run share.
pub(super) struct Batch<'a> {
    pub(super) setup: &'a Setup,
    pub(super) originals: &'a Originals<'a>,
    /// Files that no program may be written over.
    pub(super) outputs: &'a Outputs,
    /// Path of the report of all programs.
    pub(super) report: Option<&'a Path>,
    /// An empty path to fill for `--html`.
    pub(super) path: Option<PathTrace>,
    /// Number of programs.
    pub(super) programs: usize,
}

impl Batch<'_> {
    /// Prepares rows for the report of the run: the rows of a batch are moved to temporary files.
    pub(super) fn rows(&self, rows: Option<Rows>) -> Result<Option<Rows>, Vec<Diagnostic>> {
        let (Some(mut rows), Some(path)) = (rows, self.report) else { return Ok(None) };
        if self.programs > 1 {
            rows.spool().map_err(|error| cannot_write(path, &error))?;
        }
        Ok(Some(rows))
    }
}

/// Result of a long program that was predicted in chunks.
pub(super) struct Predicted {
    pub(super) passed: Passed,
    /// Findings of `check`; empty for `predict`.
    pub(super) listed: Listed,
}

/// Result of a long program that was read in chunks.
pub(super) struct Passed {
    pub(super) streamed: Streamed,
    /// The targets with the largest errors.
    pub(super) digest: Digest,
    /// Output files that are already staged.
    pub(super) outputs: Outputs,
    /// Rows for the report of a batch. The report of a single program is already staged.
    pub(super) rows: Option<Rows>,
    /// The path for `--html`.
    pub(super) path: Option<PathTrace>,
}

impl Passed {
    /// `None` if the program, whose text is given, can be understood only as a whole.
    pub(super) fn of(
        done: Result<Streamed, StreamError>,
        reports: ProgramReports<'_>,
        outputs: Outputs,
        text: &Text,
        setup: &Setup,
    ) -> Result<Option<Self>, Vec<Diagnostic>> {
        let name = text.name();
        let Some(mut streamed) = setup.through(name, done)? else { return Ok(None) };
        setup.check_forces(&streamed)?;
        if !streamed.failures.is_empty() {
            return Err(streamed.failures);
        }
        streamed.notes.extend(reports.notes(name)?);
        let digest = reports.digest();
        let rows = if streamed.refused.is_empty() { streamed.summary.targets } else { 0 };
        let (rows, mut path) = reports.done(name, rows);
        if let Some(path) = &mut path {
            lines::quote(path, LongText::open(&text)?);
        }
        Ok(Some(Self { streamed, digest, outputs, rows, path }))
    }
}

/// Predicts a program chunk by chunk; `None` if it, or its original, can be understood only as a whole.
pub(super) fn streamed(
    batch: &Batch<'_>,
    job: &Job,
    bar: &ProgressBar,
    tolerances: Option<&Tolerances>,
) -> Result<Option<Predicted>, Vec<Diagnostic>> {
    let setup = batch.setup;
    let Some(program) = setup.long(job) else { return Ok(None) };
    let original = batch.originals.job(job)?;
    let original = match &original {
        Some(original) => match setup.long(original) {
            Some(original) => Some(original),
            None => return Ok(None),
        },
        None => None,
    };
    let bar = progress::of_one(bar, batch.programs);
    program.by_chunks(|program| {
        if let Some(bar) = bar {
            progress::bytes(bar, program.text().bytes()?);
        }
        let mut outputs = batch.outputs.sibling();
        let mut reports = ProgramReports::open(
            None,
            batch.report,
            batch.programs,
            batch.path.clone(),
            Noticed::new(setup.options.forces.as_ref(), None),
            &mut outputs,
        )?;
        let threads = rayon::current_num_threads().div_ceil(batch.programs);
        let run = (&setup.cell.cell, &setup.options, threads);
        let mut listed = Listed::default();
        let mut found = |more| listed.add(more);
        let findings = tolerances.map(|tolerances| |judged: Judged<'_>| tolerances.findings(judged));
        let corrects = tolerances.is_some_and(|tolerances| tolerances.corrects(original.is_some()));
        let judge =
            findings.as_ref().map(|findings| Judge { corrects, refusals: Findings::MOST, findings, found: &mut found });
        let done = reports.filled(bar, |sinks| predict_long(&program, original.as_ref(), run, judge, sinks));
        if done.as_ref().is_ok_and(|streamed| !streamed.refused.is_empty()) {
            reports = reports.emptied(batch.path.clone())?;
        }
        let passed = Passed::of(done, reports, outputs, program.text(), setup)?;
        Ok(passed.map(|passed| Predicted { passed, listed }))
    })
}
