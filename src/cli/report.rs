//! Report rows of several programs in one file.

use super::progress;
use crate::session::blocks::Blocks;
use crate::session::output::{Outputs, Temporary, cannot_write};
use crate::session::read;
use crate::session::report::{Noticed, Rows, pretty, write_joined};
use deflex::correct::Sinks;
use deflex::report::html::{PathKind, PathTrace};
use deflex::report::{CSV_HEADER, Digest, FileSummary, Origin, VERSION, csv_rows};
use deflex::text::{Diagnostic, printable_line};
use indicatif::ProgressBar;
use serde::Serialize;
use std::fmt::Write as _;
use std::io::{self, Seek, Write};
use std::path::{Path, PathBuf};

/// Reports of a program that are written chunk by chunk.
pub(super) struct ProgramReports<'a> {
    rows: Copies,
    /// Rows for the report of a batch, which is written after all programs are done.
    spooled: Option<Temporary>,
    /// The path for `--html`.
    path: Option<PathTrace>,
    noticed: Noticed<'a>,
}

impl<'a> ProgramReports<'a> {
    /// `own` is the path of the program's own report, `joined` that of the report of all `programs`.
    pub(super) fn open(
        own: Option<PathBuf>,
        joined: Option<&Path>,
        programs: usize,
        path: Option<PathTrace>,
        noticed: Noticed<'a>,
        outputs: &mut Outputs,
    ) -> Result<Self, Vec<Diagnostic>> {
        let own = own.as_deref().into_iter().chain(joined.filter(|_| programs == 1));
        let mut rows = own.map(|path| outputs.open_report(path)).collect::<Result<Vec<_>, _>>()?;
        let mut spooled = None;
        if joined.is_some() && programs > 1 {
            let (temporary, file) = Temporary::spool().map_err(|error| read::cannot_write(&error))?;
            rows.push(Blocks::new(file));
            spooled = Some(temporary);
        }
        let mut rows = Copies(rows);
        rows.write_all(CSV_HEADER.as_bytes()).map_err(|error| read::cannot_write(&error))?;
        Ok(Self { rows, spooled, path, noticed })
    }

    /// Fills the reports with the rows that `run` produces.
    pub(super) fn filled<T>(&mut self, bar: Option<&ProgressBar>, run: impl FnOnce(&mut Sinks<'_>) -> T) -> T {
        let (wanted, path, noticed) = (!self.rows.0.is_empty(), &mut self.path, &mut self.noticed);
        run(&mut Sinks {
            report: &mut self.rows,
            rows: &|rows| if wanted { csv_rows(rows) } else { Vec::new() },
            each: &mut |rows| {
                noticed.take(rows);
                path.iter_mut().for_each(|path| path.extend(rows));
            },
            progress: &|targets, bytes| bar.into_iter().for_each(|bar| progress::at(bar, targets, bytes)),
        })
    }

    /// Removes all rows again, before another attempt.
    pub(super) fn emptied(mut self, path: Option<PathTrace>) -> Result<Self, Vec<Diagnostic>> {
        let mut empty = |rows: &mut Blocks| {
            let file = rows.emptied();
            file.set_len(0)?;
            file.rewind()?;
            rows.write_all(CSV_HEADER.as_bytes())?;
            rows.flush()
        };
        self.rows.0.iter_mut().try_for_each(&mut empty).map_err(|error| read::cannot_write(&error))?;
        Ok(Self { path, ..self })
    }

    /// Notes on the program `name`; an error if it has been corrected already.
    pub(super) fn notes(&self, name: &str) -> Result<Vec<Diagnostic>, Vec<Diagnostic>> {
        self.noticed.notes(name)
    }

    /// The targets with the largest errors.
    pub(super) fn digest(&self) -> Digest {
        self.noticed.digest().clone()
    }

    /// The rows of the program `name` for the report of a batch, of which there are `rows`, and its path.
    pub(super) fn done(self, name: &str, rows: usize) -> (Option<Rows>, Option<PathTrace>) {
        (self.spooled.map(|spooled| Rows::spooled(spooled, name, rows)), self.path)
    }
}

/// Writes the same bytes to several files.
struct Copies(Vec<Blocks>);

impl Write for Copies {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        for file in &mut self.0 {
            file.write_all(bytes)?;
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.iter_mut().try_for_each(Blocks::flush)
    }
}

/// Writes a report to a file. The report of several files has a last column `file`.
pub(super) fn joined(outputs: &mut Outputs, path: &Path, programs: &[Rows]) -> Result<(), Vec<Diagnostic>> {
    let mut out = outputs.open_report(path)?;
    write_joined(programs, &mut out).and_then(|()| out.flush()).map_err(|error| cannot_write(path, &error))
}

/// Writes the JSON summary of a run if it has a path.
pub(super) fn json(
    outputs: &mut Outputs,
    path: Option<&PathBuf>,
    cell: &Origin,
    files: &[FileSummary],
) -> Result<(), Vec<Diagnostic>> {
    #[derive(Serialize)]
    struct Files<'a> {
        deflex: &'static str,
        cell: &'a Origin,
        files: &'a [FileSummary],
    }
    outputs.add_report(path, || pretty(&Files { deflex: VERSION, cell, files }))
}

/// The summary of one program for stderr: the number of targets with each result, and one row for each kind of error,
/// in mm.
pub(super) fn summary_text(summary: &FileSummary, kind: PathKind) -> String {
    let mut text = format!("{}: {}", printable_line(&summary.path), deflex::report::summary_line(summary, kind));
    let mut add = |what: &str, rms: Option<f64>, max: f64| {
        let rms = rms.map_or_else(String::new, |rms| format!("rms {rms:.4} mm"));
        // Writing to a String cannot fail.
        let _ = write!(text, "\n  {what:<27}{rms:<16}max {max:.4} mm");
    };
    if summary.counts.max_error_mm > 0.0 {
        let what = if kind == PathKind::Compensate { "error as programmed" } else { "error at targets" };
        add(what, Some(summary.counts.rms_error_mm), summary.counts.max_error_mm);
    }
    if kind == PathKind::Compensate && summary.counts.corrected > 0 {
        add("remaining at targets", None, summary.counts.max_remaining_mm);
        if summary.counts.along > 0 {
            add(&format!("air, moved with a cut ({})", summary.counts.along), None, summary.counts.max_along_mm);
        }
        if summary.counts.max_kept_mm > 0.0 {
            add("remaining at kept targets", None, summary.counts.max_kept_mm);
        }
        if summary.counts.remaining_path_max_mm > 0.0 {
            add(
                "remaining between targets",
                Some(summary.counts.remaining_path_rms_mm),
                summary.counts.remaining_path_max_mm,
            );
        }
    }
    if summary.counts.max_sigma_mm > 0.0 {
        add("their uncertainty (sigma)", None, summary.counts.max_sigma_mm);
    }
    if let Some(path) = &summary.driven_path {
        let figures = path.corrected.unwrap_or(path.programmed);
        add("driven path", None, figures.max_mm);
        let _ = write!(text, ", run time {:.2} s", figures.run_time_s);
    }
    text
}
