//! Runs programs chunk by chunk. This is faster than running a program as a whole, and the caller can follow and cancel
//! the run.

use super::{Done, ProgramFiles, Run, noticed};
use crate::session::Tolerances;
use crate::session::job;
use crate::session::lines::quote;
use crate::session::report::Noticed;
use crate::session::text::Text;
use crate::session::tolerances::{Chunks, Found, Listed};
use deflex::correct::{Judge, LaidOut, Sinks, StreamError, Streamed, compensate_long, post_long, predict_long};
use deflex::program::InChunks;
use deflex::report::html::{PathKind, PathTrace};
use deflex::report::{CSV_HEADER, FileSummary, Findings, Unrounded, csv_rows};
use deflex::text::{Diagnostic, Source};
use std::io::{self, Cursor, Write};
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

/// A long program in one file.
pub(super) struct Long<'a> {
    files: &'a ProgramFiles,
    program: job::Long<'a>,
    run: &'a Run,
    stopped: AtomicBool,
}

// `None`: the program can be understood only as a whole.
type Answer = Result<Option<Done>, Vec<Diagnostic>>;

/// Results that are collected from the rows of a program.
struct Reports<'a> {
    path: Option<PathTrace>,
    csv: Vec<u8>,
    noticed: Noticed<'a>,
    numbers: Option<Unrounded>,
}

impl<'a> Long<'a> {
    /// `None` if the program has several files.
    pub(super) fn of(files: &'a ProgramFiles, run: &'a Run) -> Option<Self> {
        let program = files.long(run)?;
        files.companions().is_empty().then(|| Self { files, program, run, stopped: AtomicBool::new(false) })
    }

    /// Corrects the program; `None` if it can be understood only as a whole.
    pub(super) fn compensate(&self) -> Answer {
        self.program.by_chunks(|program| match self.files.language().is_edited() {
            true => self.edit(&program),
            false => self.post(&program),
        })
    }

    fn threads() -> usize {
        rayon::current_num_threads()
    }

    /// Edits the numbers in the program's own text.
    fn edit(&self, program: &InChunks<'_, &Text>) -> Answer {
        let mut text = self.held();
        let (reports, done) = self.filled((PathKind::Compensate, noticed(self.files, self.run)), |sinks| {
            let (setup, scratch) = (&self.run.setup, || Ok(Cursor::new(Vec::new())));
            let run = (&setup.cell.cell, &setup.options, Self::threads());
            compensate_long(program, scratch, run, &mut text, sinks)
        });
        let files = vec![(self.files.names()[0].clone(), text.bytes)];
        self.done(done, reports, files)
    }

    /// Posts CL data as RAPID.
    fn post(&self, program: &InChunks<'_, &Text>) -> Answer {
        let setup = &self.run.setup;
        let (cell, threads) = (&setup.cell.cell, Self::threads());
        let post = self.run.post.clone().unwrap_or_else(|| Run::posted_from(&self.files.names()[0]));
        let laid_out = LaidOut::new(program, (cell, &setup.options, threads), &post, &|_, _| ());
        let Some(laid_out) = self.through(laid_out)? else { return Ok(None) };
        let files: Mutex<Vec<(PathBuf, Vec<u8>)>> = Mutex::default();
        let open = |name: &str| Ok(Posted { name: name.into(), text: self.held(), files: &files });
        let (reports, done) = self.filled((PathKind::Compensate, noticed(self.files, self.run)), |sinks| {
            post_long(program, &laid_out, (cell, threads), open, sinks)
        });
        let files = files.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
        self.done(done, reports, files)
    }

    /// The original to read in chunks, if there is one; `None` if it can be understood only as a whole.
    fn original<'f>(&self, against: Option<&'f ProgramFiles>) -> Option<Option<job::Long<'f>>> {
        against.map_or(Some(None), |original| original.long(self.run).map(Some))
    }

    /// Predicts the program without correcting it; `None` if it, or its original, can be understood only as a whole.
    pub(super) fn predict(&self, against: Option<&ProgramFiles>) -> Answer {
        let Some(original) = self.original(against) else { return Ok(None) };
        self.program.by_chunks(|program| {
            let noticed = Noticed::new(self.run.setup.options.forces.as_ref(), None);
            let (reports, done) = self.filled((PathKind::Predict, noticed), |sinks| {
                let setup = &self.run.setup;
                let run = (&setup.cell.cell, &setup.options, Self::threads());
                predict_long(&program, original.as_ref(), run, None, sinks)
            });
            self.done(done, reports, Vec::new())
        })
    }

    /// Checks the program, and returns what was found with the report; `None` if it, or its original, can be understood
    /// only as a whole.
    pub(super) fn check(
        &self,
        against: Option<&ProgramFiles>,
        tolerances: &Tolerances,
    ) -> Result<Option<(Found, Vec<u8>)>, Vec<Diagnostic>> {
        let Some(original) = self.original(against) else { return Ok(None) };
        let setup = &self.run.setup;
        self.program.by_chunks(|program| {
            let noticed = Noticed::new(setup.options.forces.as_ref(), None);
            let mut listed = Listed::default();
            let judge = Judge {
                corrects: tolerances.corrects(original.is_some()),
                refusals: Findings::MOST,
                findings: &|judged| tolerances.findings(judged),
                found: &mut |more| listed.add(more),
            };
            let (mut reports, done) = self.filled((PathKind::Check, noticed), |sinks| {
                let run = (&setup.cell.cell, &setup.options, Self::threads());
                predict_long(&program, original.as_ref(), run, Some(judge), sinks)
            });
            let Some(mut streamed) = self.passed(done, &mut reports)? else { return Ok(None) };
            if !streamed.refused.is_empty() {
                // No target of a refused program is judged.
                (reports.csv, reports.path) = (CSV_HEADER.into(), self.run.path(PathKind::Check));
            }
            let name = self.files.name();
            streamed.notes.extend(reports.noticed.notes(name)?);
            let digest = reports.noticed.into_digest();
            let chunks = Chunks { name, streamed, digest, listed, path: reports.path };
            Ok(Some((tolerances.streamed(chunks, &setup.cell)?, reports.csv)))
        })
    }

    /// Memory for an output text, which refuses further bytes after the run was cancelled. Its first size is a guess: a
    /// report is longer than its program.
    fn held(&self) -> HeldText<'_> {
        HeldText { bytes: Vec::with_capacity(2 * self.source().bytes.len()), stopped: &self.stopped }
    }

    fn filled<'n>(
        &self,
        (kind, noticed): (PathKind, Noticed<'n>),
        run: impl FnOnce(&mut Sinks<'_>) -> Result<Streamed, StreamError>,
    ) -> (Reports<'n>, Result<Streamed, StreamError>) {
        let mut csv = self.held();
        csv.bytes.extend_from_slice(CSV_HEADER.as_bytes());
        let (path, numbers) = (self.run.path(kind), self.run.numbers());
        let mut reports = Reports { path, csv: Vec::new(), noticed, numbers };
        let done = run(&mut Sinks {
            report: &mut csv,
            rows: &csv_rows,
            each: &mut |rows| {
                reports.noticed.take(rows);
                reports.path.iter_mut().for_each(|path| path.extend(rows));
                reports.numbers.iter_mut().for_each(|numbers| numbers.take(rows));
            },
            progress: &|targets, bytes| {
                let continues = self.run.follow.as_ref().is_none_or(|follow| follow(targets, bytes));
                self.stopped.fetch_or(!continues, Ordering::Relaxed);
            },
        });
        reports.csv = csv.bytes;
        (reports, done)
    }

    fn done(
        &self,
        done: Result<Streamed, StreamError>,
        mut reports: Reports<'_>,
        files: Vec<(PathBuf, Vec<u8>)>,
    ) -> Answer {
        let Some(done) = self.passed(done, &mut reports)? else { return Ok(None) };
        let name = self.files.name();
        let noticed = reports.noticed.notes(name)?;
        let summary = FileSummary::of_streamed(name, &done);
        let notes = done.notes.into_iter().chain(noticed).collect();
        let Reports { path, csv, numbers, .. } = reports;
        Ok(Some(Done { files, csv, summary, notes, path, numbers }))
    }

    /// The result of a run that has no failures, with the program's lines in its path.
    fn passed(
        &self,
        done: Result<Streamed, StreamError>,
        reports: &mut Reports<'_>,
    ) -> Result<Option<Streamed>, Vec<Diagnostic>> {
        let Some(done) = self.through(done)? else { return Ok(None) };
        self.run.setup.check_forces(&done)?;
        if !done.failures.is_empty() {
            return Err(done.failures);
        }
        if let Some(path) = &mut reports.path {
            quote(path, &self.source().bytes[..]);
        }
        Ok(Some(done))
    }

    fn through<T>(&self, done: Result<T, StreamError>) -> Result<Option<T>, Vec<Diagnostic>> {
        if done.is_err() && self.stopped.load(Ordering::Relaxed) {
            return Err(Diagnostic::error("run.called-off", self.files.name(), "the run was cancelled").into());
        }
        self.run.setup.through(&self.source().name, done)
    }

    fn source(&self) -> &'a Source {
        self.files.sources()[0]
    }
}

/// An output text in memory.
struct HeldText<'a> {
    bytes: Vec<u8>,
    stopped: &'a AtomicBool,
}

impl Write for HeldText<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.stopped.load(Ordering::Relaxed) {
            return Err(io::Error::other("called off"));
        }
        self.bytes.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// A module of a posted program; it joins the finished files when it is dropped.
struct Posted<'a> {
    name: PathBuf,
    text: HeldText<'a>,
    files: &'a Mutex<Vec<(PathBuf, Vec<u8>)>>,
}

impl Write for Posted<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.text.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Drop for Posted<'_> {
    fn drop(&mut self) {
        let file = (std::mem::take(&mut self.name), std::mem::take(&mut self.text.bytes));
        self.files.lock().unwrap_or_else(std::sync::PoisonError::into_inner).push(file);
    }
}
