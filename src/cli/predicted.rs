//! `predict` and `check` on long programs, in constant memory.

use super::against::Originals;
use super::files::{self, cannot_read};
use super::job::{Job, Text};
use super::output::{Outputs, cannot_write};
use super::readings::{self, FileText, LongText, Reading};
use super::report::{Noticed, ProgramReports, Rows};
use super::setup::Setup;
use super::{lines, progress};
use deflex::correct::{Judge, Judged, StreamError, Streamed, predict_chunks};
use deflex::program::AnyChunks;
use deflex::report::Findings;
use deflex::report::html::PathTrace;
use deflex::text::Diagnostic;
use indicatif::ProgressBar;
use std::path::Path;

/// What all programs of a run have in common.
pub(super) struct Batch<'a> {
    pub(super) setup: &'a Setup,
    pub(super) originals: &'a Originals<'a>,
    /// What none may write over.
    pub(super) outputs: &'a Outputs,
    /// The report of all programs.
    pub(super) report: Option<&'a Path>,
    /// An empty path, for `--html`.
    pub(super) path: Option<PathTrace>,
    /// How many they are.
    pub(super) programs: usize,
}

impl Batch<'_> {
    /// The bar of the one program: in a batch it counts programs.
    pub(super) fn bar<'a>(&self, bar: &'a ProgressBar) -> Option<&'a ProgressBar> {
        Some(bar).filter(|_| self.programs == 1)
    }

    /// Rows as the run's report needs them.
    pub(super) fn rows(&self, rows: Option<Rows>) -> Result<Option<Rows>, Vec<Diagnostic>> {
        let (Some(mut rows), Some(path)) = (rows, self.report) else { return Ok(None) };
        if self.programs > 1 {
            rows.spool().map_err(|error| cannot_write(path, &error))?;
        }
        Ok(Some(rows))
    }
}

/// What a check asks of each chunk.
#[derive(Clone, Copy)]
pub(super) struct Question<'a> {
    /// Whether the program is corrected too.
    pub(super) corrects: bool,
    pub(super) findings: &'a (dyn Fn(Judged<'_>) -> Vec<Diagnostic> + Sync),
}

/// A long program that went through.
pub(super) struct Predicted {
    pub(super) streamed: Streamed,
    /// Where there was a question.
    pub(super) findings: Findings,
    /// What it wrote, staged.
    pub(super) outputs: Outputs,
    /// For the report of a batch; that of the one program is staged already.
    pub(super) rows: Option<Rows>,
    /// For `--html`.
    pub(super) path: Option<PathTrace>,
}

/// Streams a program; `None` where only the whole of it, or of its original, tells what it means.
pub(super) fn streamed(
    batch: &Batch<'_>,
    job: &Job,
    bar: &ProgressBar,
    question: Option<Question<'_>>,
) -> Result<Option<Predicted>, Vec<Diagnostic>> {
    let [Text::File { name, path }] = &job.texts[..] else { return Ok(None) };
    let original = batch.originals.job(job)?;
    let bar = batch.bar(bar);
    let text = FileText { name, path };
    for reading in Reading::ALL {
        let chunks = |job: &Job| {
            let [Text::File { name, path }] = &job.texts[..] else { return Ok(None) };
            let context = (batch.setup, batch.setup.context.sources());
            readings::chunks(context, job.language, &FileText { name, path }, reading)
        };
        let Some(own) = chunks(job)? else { continue };
        let Some(options) = batch.setup.options_with_turns(name, job.language, || chunks(job))? else { continue };
        let before = match &original {
            Some(original) => match chunks(original)? {
                Some(before) => Some(before),
                None => continue,
            },
            None => None,
        };
        if let Some(bar) = bar {
            let bytes = std::fs::metadata(path).map_err(|error| cannot_read(name, &error))?.len();
            progress::bytes(bar, bytes);
        }
        let names = [own.names(), before.as_ref().and_then(AnyChunks::names)];
        let mut outputs = batch.outputs.sibling();
        let mut reports = ProgramReports::open(
            None,
            batch.report,
            batch.programs,
            batch.path.clone(),
            Noticed::new(batch.setup.options.forces.as_ref(), None),
            &mut outputs,
        )?;
        let cell = &batch.setup.cell.cell;
        let threads = rayon::current_num_threads().div_ceil(batch.programs);
        let mut findings = Findings::default();
        let mut found = |more| findings.add(more);
        let judge = question.map(|Question { corrects, findings }| Judge {
            corrects,
            refusals: Findings::MOST,
            findings,
            found: &mut found,
        });
        let done = reports.filled(bar, |sinks| predict_chunks(own, before, cell, &options, threads, judge, sinks));
        let streamed = match done {
            Ok(streamed) => streamed,
            Err(StreamError::NotStreamable) => continue,
            Err(StreamError::Refused(errors)) => return Err(batch.setup.cell.own(errors)),
            Err(StreamError::Read(error)) => return Err(cannot_read(name, &error)),
            Err(StreamError::Write(error)) => return Err(files::cannot_write(&error)),
        };
        if let Some(forces) = &batch.setup.forces {
            let named = |name: &str| names.iter().flatten().any(|names| names.uses(name));
            forces.check_targets(streamed.last, named)?;
        }
        if !streamed.refused.is_empty() {
            reports = reports.emptied(batch.path.clone())?;
        }
        let mut streamed = streamed;
        streamed.notes.extend(reports.notes(name)?);
        let rows = if streamed.refused.is_empty() { streamed.summary.targets } else { 0 };
        let (rows, mut trace) = reports.done(name, rows);
        if let Some(trace) = &mut trace {
            lines::quote(trace, text.open()?);
        }
        return Ok(Some(Predicted { streamed, findings, outputs, rows, path: trace }));
    }
    Ok(None)
}
