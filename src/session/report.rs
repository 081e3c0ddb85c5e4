//! Rows of the report, what a run reports about them, and JSON.

use super::again::Again;
use super::forces::LeftOut;
use super::output::Temporary;
use deflex::correct::Row;
use deflex::measured::Forces;
use deflex::report::html::PathTrace;
use deflex::report::{Digest, csv_field, write_csv};
use deflex::text::Diagnostic;
use serde::Serialize;
use std::io::{self, BufRead, BufReader, Write};

/// The report of one program.
#[derive(Default)]
pub(crate) struct Rows {
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
    pub(crate) fn new(rows: &[Row]) -> Self {
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
    pub(crate) fn draw(&self, path: &mut PathTrace, rows: &[Row]) {
        let mut rest = rows;
        for (file, count) in &self.files {
            let (now, after) = rest.split_at((*count).min(rest.len()));
            if self.files.len() > 1 {
                path.continue_in(file);
            }
            path.extend(now);
            rest = after;
        }
    }

    /// Rows of one file that were written to a temporary file.
    pub(crate) fn spooled(csv: Temporary, file: &str, rows: usize) -> Self {
        Self { csv: Csv::Spooled(csv), files: vec![(file.to_owned(), rows)] }
    }

    /// Moves the rows to a temporary file, because the reports of a batch do not fit in memory.
    pub(crate) fn spool(&mut self) -> io::Result<()> {
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
pub(crate) struct Noticed<'a> {
    pub(crate) forces: Option<&'a Forces>,
    /// Recognises a program that has been corrected already; `None` if the program is not corrected, or with `--again`.
    pub(crate) again: Option<Again>,
    left_out: LeftOut,
    /// The targets with the largest errors.
    digest: Digest,
}

impl<'a> Noticed<'a> {
    pub(crate) fn new(forces: Option<&'a Forces>, again: Option<Again>) -> Self {
        Self { forces, again, left_out: LeftOut::default(), digest: Digest::default() }
    }

    /// Adds rows in running order.
    pub(crate) fn take(&mut self, rows: &[Row]) {
        self.left_out.take(self.forces, rows);
        self.digest.take(rows);
        if let Some(again) = &mut self.again {
            again.take(rows);
        }
    }

    /// The targets with the largest errors so far.
    pub(crate) fn digest(&self) -> &Digest {
        &self.digest
    }

    /// The targets with the largest errors.
    pub(crate) fn into_digest(self) -> Digest {
        self.digest
    }

    /// Notes on the program `name`; an error if it has been corrected already.
    pub(crate) fn notes(&self, name: &str) -> Result<Vec<Diagnostic>, Vec<Diagnostic>> {
        match self.again.as_ref().and_then(|again| again.refusal(name)) {
            Some(refusal) => Err(refusal.into()),
            None => Ok(self.left_out.note(name).into_iter().collect()),
        }
    }
}

/// Writes a report to any writer.
pub(crate) fn write_joined(programs: &[Rows], out: &mut impl Write) -> io::Result<()> {
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

/// Indented JSON with the keys in the order of the struct and a line end at the end.
pub(crate) fn pretty(value: &impl Serialize) -> Result<String, Vec<Diagnostic>> {
    match serde_json::to_string_pretty(value) {
        Ok(text) => Ok(text + "\n"),
        Err(error) => Err(Diagnostic::error("io.json", "", format!("cannot be written as JSON: {error}")).into()),
    }
}
