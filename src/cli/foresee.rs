//! `predict` and `check` on long programs, in constant memory.

use super::against::Originals;
use super::files::{self, cannot_read, source};
use super::job::{Job, Text};
use super::output::{Outputs, cannot_write};
use super::report::{Noticed, ProgramReports, Rows};
use super::setup::Setup;
use super::{lines, progress};
use deflex::correct::{Judge, Judged, StreamError, Streamed, predict_chunks};
use deflex::program::{AnyChunks, Language};
use deflex::report::Findings;
use deflex::report::html::PathTrace;
use deflex::text::Diagnostic;
use indicatif::ProgressBar;
use std::fs::File;
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
pub(super) struct Foreseen {
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
) -> Result<Option<Foreseen>, Vec<Diagnostic>> {
    let [Text::File { name, path }] = &job.texts[..] else { return Ok(None) };
    let original = batch.originals.job(job)?;
    // In a batch the bar counts programs.
    let bar = Some(bar).filter(|_| batch.programs == 1);
    for kind in ChunkKind::ALL {
        let Some(chunks) = chunks(batch.setup, job, kind)? else { continue };
        let again = || self::chunks(batch.setup, job, kind);
        let Some(options) = batch.setup.options_with_turns(name, job.language, again)? else { continue };
        let before = match &original {
            Some(original) => match self::chunks(batch.setup, original, kind)? {
                Some(chunks) => Some(chunks),
                None => continue,
            },
            None => None,
        };
        if let Some(bar) = bar {
            let bytes = std::fs::metadata(path).map_err(|error| cannot_read(name, &error))?.len();
            progress::bytes(bar, bytes);
        }
        let names = [chunks.names(), before.as_ref().and_then(AnyChunks::names)];
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
        let done = reports.filled(bar, |sinks| predict_chunks(chunks, before, cell, &options, threads, judge, sinks));
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
            lines::quote(trace, open(job)?);
        }
        return Ok(Some(Foreseen { streamed, findings, outputs, rows, path: trace }));
    }
    Ok(None)
}

/// How a program is read.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum ChunkKind {
    /// Without an index, if it begins like that.
    Any,
    /// By an index.
    Indexed,
    /// By running it.
    Executed,
}

impl ChunkKind {
    /// In the order in which they are tried.
    pub(super) const ALL: [Self; 3] = [Self::Any, Self::Indexed, Self::Executed];
}

/// The chunks of a program; `None` where it can only be read whole.
fn chunks(setup: &Setup, job: &Job, kind: ChunkKind) -> Result<Option<AnyChunks<File>>, Vec<Diagnostic>> {
    let [Text::File { name, path }] = &job.texts[..] else { return Ok(None) };
    let failed = |error: std::io::Error| cannot_read(name, &error);
    let context = setup.context.sources();
    match job.language {
        Language::Cl | Language::Krl if kind == ChunkKind::Executed => Ok(None),
        Language::Cl => {
            let Some(options) = setup.cell.cl_options(setup.options.tool.as_deref()) else { return Ok(None) };
            AnyChunks::cl(name, open(job)?, &options).map_err(failed)
        }
        Language::Rapid => {
            let inline = match kind {
                ChunkKind::Any => AnyChunks::inline(name, open(job)?, context).map_err(failed)?,
                ChunkKind::Indexed => None,
                ChunkKind::Executed => return AnyChunks::executed(source(path)?, context),
            };
            match inline {
                Some(chunks) => Ok(Some(chunks)),
                None => AnyChunks::indexed(name, open(job)?, open(job)?, context).map_err(failed),
            }
        }
        Language::Krl => AnyChunks::krl(name, open(job)?, context).map_err(failed),
        Language::Ls => Ok(None),
    }
}

fn open(job: &Job) -> Result<File, Vec<Diagnostic>> {
    match &job.texts[..] {
        [Text::File { name, path }] => File::open(path).map_err(|error| cannot_read(name, &error)),
        _ => Err(Vec::new()),
    }
}
