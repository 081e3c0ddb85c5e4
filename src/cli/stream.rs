//! `compensate` on a long program: from file to file in constant memory.

use super::args::{Compensate, Format};
use super::lines::Lines;
use super::output::{Outputs, Temporary, is_stdout};
use super::run::{Setup, in_one_file, post_options, report_beside};
use super::{progress, report};
use deflex::correct::{self, Outline, Poster, Sinks, StreamError, compensate_pieces, post_pieces};
use deflex::program::cl::ClOptions;
use deflex::program::rapid::{self, PIECE};
use deflex::program::{Language, cl, detect};
use deflex::report::html::{PathKind, PathTrace};
use deflex::report::{CSV_HEADER, FileSummary, csv_rows};
use deflex::text::{Diagnostic, Source};
use indicatif::ProgressBar;
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
        let whole =
            listed || args.subdivide.is_some() || args.model.forces.is_some() || !args.reading.context.is_empty();
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

    /// As the user typed it.
    fn name(&self) -> String {
        self.path.display().to_string()
    }

    fn file_name(&self) -> &Path {
        Path::new(self.path.file_name().unwrap_or(self.path.as_os_str()))
    }

    /// The pieces of CL data; `None` where they can only be read whole.
    fn pieces(&mut self, options: &ClOptions) -> Result<Option<cl::Pieces<File>>, Vec<Diagnostic>> {
        let pieces = cl::Pieces::new(&self.name(), self.reread()?, options);
        pieces.map_err(|error| cannot_read(&self.path, &error))
    }

    /// The file from its start.
    fn reread(&mut self) -> Result<File, Vec<Diagnostic>> {
        let again = self.file.rewind().and_then(|()| self.file.try_clone());
        again.map_err(|error| cannot_read(&self.path, &error))
    }

    /// The language, as far as the head tells.
    fn language(&mut self, format: Option<Format>) -> Result<Option<Language>, Vec<Diagnostic>> {
        /// What [`detect`] looks at.
        const HEAD: u64 = 64 * 1024;
        Ok(match format {
            Some(Format::Rapid) => Some(Language::Rapid),
            Some(Format::Cl) => Some(Language::Cl),
            None => {
                let mut head = Vec::new();
                let read = self.reread()?.take(HEAD).read_to_end(&mut head);
                read.map_err(|error| cannot_read(&self.path, &error))?;
                detect(&self.name(), &head)
            }
        })
    }

    /// Streams the program into staged outputs; `None` where it is not straight.
    pub(super) fn compensate(
        &mut self,
        args: &Compensate,
        setup: &Setup,
        outputs: Outputs,
    ) -> Result<Option<Streamed>, Vec<Diagnostic>> {
        let bar = progress::bytes(self.bytes, args.common.quiet);
        let done = match self.language(args.reading.format)? {
            Some(Language::Rapid) => self.edit(args, setup, outputs, &bar),
            Some(Language::Cl) => self.post(args, setup, outputs, &bar),
            None => Ok(None),
        };
        bar.finish_and_clear();
        done
    }

    /// RAPID, edited in place.
    fn edit(
        &mut self,
        args: &Compensate,
        setup: &Setup,
        mut outputs: Outputs,
        bar: &ProgressBar,
    ) -> Result<Option<Streamed>, Vec<Diagnostic>> {
        let pieces = rapid::Pieces::new(&self.name(), self.reread()?);
        let Some(pieces) = pieces.map_err(|error| cannot_read(&self.path, &error))? else { return Ok(None) };
        let file = self.file_name();
        let mut program = outputs.open(&place(args, file))?;
        let mut reports = ProgramReports::open(args, file, &mut outputs)?;
        let (cell, threads) = (&setup.cell.cell, rayon::current_num_threads());
        let done =
            reports.filled(bar, |sinks| compensate_pieces(pieces, cell, &setup.options, threads, &mut program, sinks));
        self.streamed(done, setup, outputs, reports.path)
    }

    /// CL, posted as RAPID.
    fn post(
        &mut self,
        args: &Compensate,
        setup: &Setup,
        mut outputs: Outputs,
        bar: &ProgressBar,
    ) -> Result<Option<Streamed>, Vec<Diagnostic>> {
        let Some(options) = setup.cell.cl_options(setup.options.tool.as_deref()) else { return Ok(None) };
        // Once through for what the head of the program needs, then once more.
        let Some(pieces) = self.pieces(&options)? else { return Ok(None) };
        let outline = match Outline::of_pieces(pieces, |targets, bytes| progress::read(bar, targets, bytes)) {
            Ok(outline) => outline,
            Err(why) => return self.streamed(Err(why), setup, outputs, None),
        };
        let Some(pieces) = self.pieces(&options)? else { return Ok(None) };
        bar.reset();
        let poster = Poster::new(outline, &setup.cell.cell, &post_options(args, self.file_name()))?;
        in_one_file(args, poster.files())?;
        let mut reports = ProgramReports::open(args, Path::new(poster.main_file()), &mut outputs)?;
        let (cell, threads) = (&setup.cell.cell, rayon::current_num_threads());
        let mut refused = None;
        let open = |name: &str| {
            let file = outputs.open(&place(args, Path::new(name)));
            // What is wrong with the name is said in more words than an I/O error has.
            file.map_err(|why| {
                refused = Some(why);
                io::Error::from(io::ErrorKind::Other)
            })
        };
        let done =
            reports.filled(bar, |sinks| post_pieces(pieces, cell, &setup.options, threads, &poster, open, sinks));
        match refused {
            Some(why) => Err(why),
            None => self.streamed(done, setup, outputs, reports.path),
        }
    }

    fn streamed(
        &mut self,
        done: Result<correct::Streamed, StreamError>,
        setup: &Setup,
        outputs: Outputs,
        mut path: Option<PathTrace>,
    ) -> Result<Option<Streamed>, Vec<Diagnostic>> {
        match done {
            Ok(done) if done.failures.is_empty() => {
                if let Some(path) = &mut path {
                    self.file.rewind().map_err(|error| cannot_read(&self.path, &error))?;
                    let mut lines = Lines::new(BufReader::new(&self.file));
                    path.quote(|_, line| lines.get(line));
                }
                let summary = FileSummary::of(&self.name(), &done.summary, &[]);
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

/// Where a file of the program goes.
fn place(args: &Compensate, file: &Path) -> PathBuf {
    match &args.out_dir {
        Some(dir) => dir.join(file),
        None => args.output.clone().unwrap_or_else(|| PathBuf::from("-")),
    }
}

/// Reports of a program that are written as it goes through.
struct ProgramReports {
    rows: Copies,
    /// For `--html`.
    path: Option<PathTrace>,
}

impl ProgramReports {
    /// `file` is the program's own name, which a report beside it takes.
    fn open(args: &Compensate, file: &Path, outputs: &mut Outputs) -> Result<Self, Vec<Diagnostic>> {
        let beside = report_beside(args, file);
        let reports = beside.iter().chain(&args.reports.report).map(|path| outputs.open_report(path));
        let mut rows = Copies(reports.collect::<Result<_, _>>()?);
        rows.write_all(CSV_HEADER.as_bytes()).map_err(|error| cannot_write(&error))?;
        let path = args.reports.html.as_ref().map(|_| PathTrace::new(PathKind::Compensate, 1));
        Ok(Self { rows, path })
    }

    /// Fills them with what `run` comes to.
    fn filled<T>(&mut self, bar: &ProgressBar, run: impl FnOnce(&mut Sinks<'_>) -> T) -> T {
        let (wanted, path) = (!self.rows.0.is_empty(), &mut self.path);
        run(&mut Sinks {
            report: &mut self.rows,
            rows: &|rows| if wanted { csv_rows(rows) } else { Vec::new() },
            each: &mut |rows| path.iter_mut().for_each(|path| path.extend(rows)),
            progress: &|targets, bytes| progress::at(bar, targets, bytes),
        })
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
