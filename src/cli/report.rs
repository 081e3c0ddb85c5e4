//! Report rows of several programs in one file.

use super::again::Again;
use super::blocks::Blocks;
use super::forces::LeftOut;
use super::output::{Outputs, Temporary, cannot_write};
use super::{files, progress};
use deflex::correct::{Row, Sinks};
use deflex::measured::Forces;
use deflex::report::html::{PathKind, PathTrace};
use deflex::report::{CSV_HEADER, Digest, FileSummary, Origin, VERSION, csv_field, csv_rows, write_csv};
use deflex::text::{Diagnostic, printable_line};
use indicatif::ProgressBar;
use serde::Serialize;
use std::fmt::Write as _;
use std::io::{self, BufRead, BufReader, Seek, Write};
use std::path::{Path, PathBuf};

/// The report of one program.
#[derive(Default)]
pub(super) struct Rows {
    csv: Csv,
    /// Files of the rows, with how many rows in a row.
    files: Vec<(String, usize)>,
}

/// A report, as `docs/reference.md` has it.
enum Csv {
    Held(Vec<u8>),
    Spooled(Temporary),
}

impl Default for Csv {
    fn default() -> Self {
        Self::Held(Vec::new())
    }
}

impl Rows {
    pub(super) fn new(rows: &[Row]) -> Self {
        let mut csv = Vec::with_capacity(64 + 256 * rows.len());
        // Writing to a Vec cannot fail.
        let _ = write_csv(rows, &mut csv);
        let mut files: Vec<(String, usize)> = Vec::new();
        for row in rows {
            let file = row.names.as_deref().map_or("", |names| &names.file);
            match files.last_mut() {
                Some((last, count)) if last == file => *count += 1,
                _ => files.push((file.to_owned(), 1)),
            }
        }
        Self { csv: Csv::Held(csv), files }
    }

    /// Draws the rows, of which these are the CSV text, file by file.
    pub(super) fn draw(&self, path: &mut PathTrace, rows: &[Row]) {
        let mut rest = rows;
        for (file, count) in &self.files {
            let (now, behind) = rest.split_at((*count).min(rest.len()));
            if self.files.len() > 1 {
                path.continue_in(file);
            }
            path.extend(now);
            rest = behind;
        }
    }

    /// Rows of one file that were written to a temporary file.
    pub(super) fn spooled(csv: Temporary, file: &str, rows: usize) -> Self {
        Self { csv: Csv::Spooled(csv), files: vec![(file.to_owned(), rows)] }
    }

    /// Moves the rows to a temporary file, because the reports of a batch do not fit in memory.
    pub(super) fn spool(&mut self) -> io::Result<()> {
        if let Csv::Held(csv) = &self.csv {
            let (temporary, mut file) = Temporary::spool()?;
            file.write_all(csv)?;
            self.csv = Csv::Spooled(temporary);
        }
        Ok(())
    }

    /// Writes the rows without a header.
    fn write(&self, out: &mut impl Write) -> io::Result<()> {
        io::copy(&mut self.read()?, out).map(|_| ())
    }

    fn read(&self) -> io::Result<Box<dyn BufRead + '_>> {
        Ok(match &self.csv {
            Csv::Held(csv) => Box::new(&csv[..]),
            Csv::Spooled(temporary) => Box::new(BufReader::new(temporary.reopen()?)),
        })
    }
}

/// Collects what a run reports about the rows of one program.
#[derive(Debug, Default)]
pub(super) struct Noticed<'a> {
    pub(super) forces: Option<&'a Forces>,
    /// Recognises a program that has been corrected already; `None` if the program is not corrected, or with `--again`.
    pub(super) again: Option<Again>,
    left_out: LeftOut,
    /// The targets with the largest errors.
    digest: Digest,
}

impl<'a> Noticed<'a> {
    pub(super) fn new(forces: Option<&'a Forces>, again: Option<Again>) -> Self {
        Self { forces, again, left_out: LeftOut::default(), digest: Digest::default() }
    }

    /// Adds rows in running order.
    pub(super) fn take(&mut self, rows: &[Row]) {
        self.left_out.take(self.forces, rows);
        self.digest.take(rows);
        if let Some(again) = &mut self.again {
            again.take(rows);
        }
    }

    /// The targets with the largest errors.
    pub(super) fn into_digest(self) -> Digest {
        self.digest
    }

    /// Notes on the program `name`; an error if it has been corrected already.
    pub(super) fn notes(&self, name: &str) -> Result<Vec<Diagnostic>, Vec<Diagnostic>> {
        match self.again.as_ref().and_then(|again| again.refusal(name)) {
            Some(refusal) => Err(refusal.into()),
            None => Ok(self.left_out.note(name).into_iter().collect()),
        }
    }
}

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
            let (temporary, file) = Temporary::spool().map_err(|error| files::cannot_write(&error))?;
            rows.push(Blocks::new(file));
            spooled = Some(temporary);
        }
        let mut rows = Copies(rows);
        rows.write_all(CSV_HEADER.as_bytes()).map_err(|error| files::cannot_write(&error))?;
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
        self.rows.0.iter_mut().try_for_each(&mut empty).map_err(|error| files::cannot_write(&error))?;
        Ok(Self { path, ..self })
    }

    /// Notes on the program `name`; an error if it has been corrected already.
    pub(super) fn notes(&self, name: &str) -> Result<Vec<Diagnostic>, Vec<Diagnostic>> {
        self.noticed.notes(name)
    }

    /// The targets with the largest errors.
    pub(super) fn digest(&self) -> Digest {
        self.noticed.digest.clone()
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

/// Writes a report to any writer.
pub(super) fn write_joined(programs: &[Rows], out: &mut impl Write) -> io::Result<()> {
    match programs {
        [rows] if rows.files.len() <= 1 => rows.write(out),
        _ => join(programs, out),
    }
}

fn join(programs: &[Rows], out: &mut impl Write) -> io::Result<()> {
    let mut line = Vec::new();
    for (i, rows) in programs.iter().enumerate() {
        let mut csv = rows.read()?;
        let mut next = |out: &mut dyn Write, file: Option<&str>| -> io::Result<()> {
            line.clear();
            csv.read_until(b'\n', &mut line)?;
            match file.filter(|_| !line.is_empty()) {
                None => Ok(()),
                Some(file) => {
                    out.write_all(line.trim_ascii_end())?;
                    writeln!(out, ",{file}")
                }
            }
        };
        next(out, (i == 0).then_some("file"))?;
        for (file, count) in &rows.files {
            let file = csv_field(file);
            (0..*count).try_for_each(|_| next(out, Some(&file)))?;
        }
    }
    Ok(())
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

/// Indented JSON with the keys in the order of the struct and a line end at the end.
pub(super) fn pretty(value: &impl Serialize) -> Result<String, Vec<Diagnostic>> {
    match serde_json::to_string_pretty(value) {
        Ok(text) => Ok(text + "\n"),
        Err(error) => Err(Diagnostic::error("io.json", "", format!("cannot be written as JSON: {error}")).into()),
    }
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
    if let Some(path) = &summary.driven_path {
        let figures = path.corrected.unwrap_or(path.programmed);
        add("driven path", None, figures.max_mm);
        let _ = write!(text, ", run time {:.2} s", figures.run_time_s);
    }
    text
}
