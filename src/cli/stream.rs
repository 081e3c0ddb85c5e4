//! `compensate` on a long program: from file to file in constant memory.

use super::args::{Compensate, Format};
use super::lines::Lines;
use super::output::{Outputs, Temporary, is_stdout};
use super::run::{Setup, report_beside};
use super::{progress, report};
use deflex::correct::{Sinks, StreamError, compensate_pieces};
use deflex::program::rapid::{PIECE, Pieces};
use deflex::report::html::{PathKind, PathTrace};
use deflex::report::{CSV_HEADER, FileSummary, csv_rows};
use deflex::text::{Diagnostic, Source};
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, Write};
use std::path::{Path, PathBuf};

/// The input of a run that may be long.
pub(super) struct Input {
    path: PathBuf,
    file: File,
    bytes: u64,
    /// What came through a pipe, kept so that it can be read twice.
    _spooled: Option<Temporary>,
}

/// A long program, done and staged.
pub(super) struct Streamed {
    pub(super) outputs: Outputs,
    pub(super) summary: FileSummary,
    pub(super) line: String,
    pub(super) notes: Vec<Diagnostic>,
    pub(super) path: Option<PathTrace>,
}

impl Input {
    /// Opens the one input of a run; a pipe is taken into a temporary file. `None` where the whole is asked for anyway, or
    /// is not worth the trouble.
    pub(super) fn open(args: &Compensate) -> Result<Option<Self>, Vec<Diagnostic>> {
        let [path] = &args.inputs[..] else { return Ok(None) };
        let listed = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("pgf"));
        let cl = args.reading.format == Some(Format::Cl);
        let whole =
            cl || listed || args.subdivide.is_some() || args.model.forces.is_some() || !args.reading.context.is_empty();
        if whole {
            return Ok(None);
        }
        if is_stdout(path) {
            return Self::spooled(path).map(Some);
        }
        // What cannot be opened is told by whoever reads it whole.
        let Some((file, bytes)) = File::open(path).ok().and_then(|file| file.metadata().ok().map(|m| (file, m.len())))
        else {
            return Ok(None);
        };
        Ok((bytes > PIECE as u64).then(|| Self { path: path.clone(), file, bytes, _spooled: None }))
    }

    fn spooled(path: &Path) -> Result<Self, Vec<Diagnostic>> {
        let failed = |error: io::Error| cannot_read(path, &error);
        let (spooled, mut file) = Temporary::spool().map_err(failed)?;
        let bytes = io::copy(&mut io::stdin().lock(), &mut file).map_err(failed)?;
        file.rewind().map_err(failed)?;
        Ok(Self { path: path.to_owned(), file, bytes, _spooled: Some(spooled) })
    }

    /// The whole input, for a program that is not straight.
    pub(super) fn whole(mut self) -> Result<Source, Vec<Diagnostic>> {
        let mut bytes = Vec::new();
        let read = self.file.rewind().and_then(|()| self.file.read_to_end(&mut bytes));
        read.map_err(|error| cannot_read(&self.path, &error))?;
        Ok(Source::new(self.path.display().to_string(), bytes))
    }

    /// Streams the program into staged outputs; `None` where it is not straight.
    pub(super) fn compensate(
        &mut self,
        args: &Compensate,
        setup: &Setup,
        mut outputs: Outputs,
    ) -> Result<Option<Streamed>, Vec<Diagnostic>> {
        let name = self.path.display().to_string();
        let failed = |error: io::Error| cannot_read(&self.path, &error);
        let input = self.file.try_clone().map_err(failed)?;
        let Some(pieces) = Pieces::new(&name, input).map_err(failed)? else { return Ok(None) };
        let file = Path::new(self.path.file_name().unwrap_or(self.path.as_os_str()));
        let program = match &args.out_dir {
            Some(dir) => dir.join(file),
            None => args.output.clone().unwrap_or_else(|| PathBuf::from("-")),
        };
        let beside = report_beside(args, file);
        let mut program = outputs.open(&program)?;
        let reports = beside.iter().chain(&args.reports.report).map(|path| outputs.open_report(path));
        let mut report = Copies(reports.collect::<Result<_, _>>()?);
        let wanted = !report.0.is_empty();
        let no_report = |error: io::Error| cannot_write(&error);
        report.write_all(CSV_HEADER.as_bytes()).map_err(no_report)?;

        let bar = progress::bytes(self.bytes, args.common.quiet);
        let mut path = args.reports.html.as_ref().map(|_| PathTrace::new(PathKind::Compensate, 1));
        let mut sinks = Sinks {
            program: &mut program,
            report: &mut report,
            rows: &|rows| if wanted { csv_rows(rows) } else { Vec::new() },
            each: &mut |rows| path.iter_mut().for_each(|path| path.extend(rows)),
            progress: &|targets, bytes| progress::at(&bar, targets, bytes),
        };
        let threads = rayon::current_num_threads();
        let done = compensate_pieces(pieces, &setup.cell.cell, &setup.options, threads, &mut sinks);
        bar.finish_and_clear();
        match done {
            Ok(done) if done.failures.is_empty() => {
                if let Some(path) = &mut path {
                    self.file.rewind().map_err(failed)?;
                    let mut lines = Lines::new(BufReader::new(&self.file));
                    path.quote(|_, line| lines.get(line));
                }
                let summary = FileSummary::of(&name, &done.summary, &[]);
                let line = report::line(&summary, true);
                Ok(Some(Streamed { outputs, summary, line, notes: done.notes, path }))
            }
            Ok(done) => Err(done.failures),
            Err(StreamError::NotStraight) => Ok(None),
            Err(StreamError::Refused(errors)) => Err(setup.cell.own(errors)),
            Err(StreamError::Read(error)) => Err(cannot_read(&self.path, &error)),
            Err(StreamError::Write(error)) => Err(cannot_write(&error)),
        }
    }
}

/// The same bytes to several files.
struct Copies(Vec<File>);

impl Write for Copies {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        for file in &mut self.0 {
            file.write_all(bytes)?;
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

fn cannot_read(path: &Path, error: &io::Error) -> Vec<Diagnostic> {
    let name = path.display().to_string();
    Diagnostic::error("io.read", &name, format!("cannot be read: {error}")).help("check the path").into()
}

fn cannot_write(error: &io::Error) -> Vec<Diagnostic> {
    Diagnostic::error("io.write", "", format!("the outputs cannot be written: {error}"))
        .help("check that there is room on the disk")
        .into()
}
