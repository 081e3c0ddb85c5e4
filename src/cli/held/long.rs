//! Long programs, a chunk at a time: faster than as a whole, and they can be followed and called off.

use super::{Done, ProgramFiles, Run, noticed};
use crate::cli::files::cannot_read;
use crate::cli::job::HEAD;
use crate::cli::lines::quote;
use crate::cli::readings::{self, Reading};
use crate::cli::report::Noticed;
use deflex::correct::{
    self, Outline, Poster, Sinks, StreamError, Streamed, compensate_long, post_chunks, predict_chunks,
};
use deflex::program::{AnyChunks, Language, cl};
use deflex::report::html::{PathKind, PathTrace};
use deflex::report::{CSV_HEADER, FileSummary, csv_rows};
use deflex::text::{Diagnostic, Source};
use std::io::{self, Cursor, Write};
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

/// A long program, in one file.
pub(super) struct Long<'a> {
    program: &'a ProgramFiles,
    source: &'a Source,
    run: &'a Run,
    /// Whether its text is long: else what it runs through may be.
    long: bool,
    stopped: AtomicBool,
}

type Answer = Result<Option<Done>, Vec<Diagnostic>>;
type Text<'a> = Cursor<&'a [u8]>;

/// What comes of the rows of a program.
struct Reports<'a> {
    path: Option<PathTrace>,
    csv: Vec<u8>,
    noticed: Noticed<'a>,
}

impl<'a> Long<'a> {
    /// `None` where the program is of several files.
    pub(super) fn of(program: &'a ProgramFiles, run: &'a Run) -> Option<Self> {
        let [source] = program.sources()[..] else { return None };
        let long = source.bytes.len() as u64 > HEAD;
        let alone = program.companions().is_empty();
        alone.then(|| Self { program, source, run, long, stopped: AtomicBool::new(false) })
    }

    /// `None` where only the whole of it tells what it means.
    pub(super) fn compensate(&self) -> Answer {
        if self.program.language() == Language::Cl {
            return if self.long { self.post() } else { Ok(None) };
        }
        for &reading in self.readings() {
            if let Some(done) = self.edit(reading)? {
                return Ok(Some(done));
            }
        }
        Ok(None)
    }

    fn readings(&self) -> &'static [Reading] {
        if self.long { &Reading::ALL } else { &[Reading::Executed] }
    }

    fn text(&self) -> Text<'a> {
        Cursor::new(&self.source.bytes)
    }

    fn threads() -> usize {
        rayon::current_num_threads()
    }

    /// RAPID and KRL: their own text, edited.
    fn edit(&self, reading: Reading) -> Answer {
        let Some(chunks) = self.chunks(self.program, reading)? else { return Ok(None) };
        let (mut text, names) = (self.held(), chunks.names());
        let (reports, done) = self.filled((PathKind::Compensate, noticed(self.program, self.run)), |sinks| {
            let (setup, scratch) = (&self.run.setup, || Ok(Cursor::new(Vec::new())));
            let run = (&setup.cell.cell, &setup.options, Self::threads());
            compensate_long(chunks, (self.text(), scratch), run, &mut text, sinks)
        });
        let files = vec![(self.program.names()[0].clone(), text.bytes)];
        self.done(done, reports, files, |name| names.as_ref().is_some_and(|names| names.uses(name)))
    }

    /// CL, posted as RAPID.
    fn post(&self) -> Answer {
        let setup = &self.run.setup;
        let Some(options) = setup.cell.cl_options(setup.options.tool.as_deref()) else { return Ok(None) };
        let chunks = || self.read(cl::Chunks::new(&self.source.name, self.text(), &options));
        let (Some(first), Some(again), Some(chunks)) = (chunks()?, chunks()?, chunks()?) else { return Ok(None) };
        let mut outline = match Outline::of_chunks(first, |_, _| ()) {
            Ok(outline) => outline,
            Err(why) => return self.refused(why),
        };
        let post = self.run.post.clone().unwrap_or_else(|| Run::posted_from(&self.program.names()[0]));
        if setup.options.subdivide.is_some() && post.max_targets.is_some() {
            // How many parts there are is told by what is inserted.
            let (cell, threads) = (&setup.cell.cell, Self::threads());
            let counted = correct::count_chunks(again, cell, &setup.options, threads, &mut outline, &|_, _| ());
            if let Err(why) = counted {
                return self.refused(why);
            }
        }
        let poster = Poster::new(outline, &setup.cell.cell, &post)?;
        let files: Mutex<Vec<(PathBuf, Vec<u8>)>> = Mutex::default();
        let open = |name: &str| Ok(Posted { name: name.into(), text: self.held(), files: &files });
        let (reports, done) = self.filled((PathKind::Compensate, noticed(self.program, self.run)), |sinks| {
            post_chunks(chunks, &setup.cell.cell, &setup.options, Self::threads(), &poster, open, sinks)
        });
        let files = files.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
        self.done(done, reports, files, |_| false)
    }

    /// What becomes of it as it is; `None` where only the whole of it, or of its original, tells what it means.
    pub(super) fn predict(&self, against: Option<&ProgramFiles>) -> Answer {
        for &reading in self.readings() {
            let Some(chunks) = self.chunks(self.program, reading)? else { continue };
            let before = match against {
                Some(original) => match self.chunks(original, reading)? {
                    Some(before) => Some(before),
                    None => continue,
                },
                None => None,
            };
            let names = [chunks.names(), before.as_ref().and_then(AnyChunks::names)];
            let noticed = Noticed::new(self.run.setup.options.forces.as_ref(), None);
            let (reports, done) = self.filled((PathKind::Predict, noticed), |sinks| {
                let setup = &self.run.setup;
                predict_chunks(chunks, before, &setup.cell.cell, &setup.options, Self::threads(), None, sinks)
            });
            if matches!(done, Err(StreamError::NotStreamable)) {
                continue;
            }
            let named = |name: &str| names.iter().flatten().any(|names| names.uses(name));
            return self.done(done, reports, Vec::new(), named);
        }
        Ok(None)
    }

    fn chunks<'p>(
        &self,
        program: &'p ProgramFiles,
        reading: Reading,
    ) -> Result<Option<AnyChunks<Text<'p>>>, Vec<Diagnostic>> {
        let [source] = program.sources()[..] else { return Ok(None) };
        readings::chunks((&self.run.setup, program.context()), program.language(), &source, reading)
    }

    fn read<T>(&self, read: io::Result<T>) -> Result<T, Vec<Diagnostic>> {
        read.map_err(|error| cannot_read(&self.source.name, &error))
    }

    /// Room for a text, which is full when the run is called off: a report takes some more than the program.
    fn held(&self) -> HeldText<'_> {
        HeldText { bytes: Vec::with_capacity(2 * self.source.bytes.len()), stopped: &self.stopped }
    }

    fn filled<'n>(
        &self,
        (kind, noticed): (PathKind, Noticed<'n>),
        run: impl FnOnce(&mut Sinks<'_>) -> Result<Streamed, StreamError>,
    ) -> (Reports<'n>, Result<Streamed, StreamError>) {
        let mut csv = self.held();
        csv.bytes.extend_from_slice(CSV_HEADER.as_bytes());
        let mut reports = Reports { path: self.run.path(kind), csv: Vec::new(), noticed };
        let done = run(&mut Sinks {
            report: &mut csv,
            rows: &csv_rows,
            each: &mut |rows| {
                reports.noticed.take(rows);
                reports.path.iter_mut().for_each(|path| path.extend(rows));
            },
            progress: &|targets, bytes| {
                let goes_on = self.run.follow.as_ref().is_none_or(|follow| follow(targets, bytes));
                self.stopped.fetch_or(!goes_on, Ordering::Relaxed);
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
        named: impl Fn(&str) -> bool,
    ) -> Answer {
        let done = match done {
            Ok(done) => done,
            Err(why) => return self.refused(why),
        };
        if let Some(forces) = &self.run.setup.forces {
            forces.check_targets(done.last, named)?;
        }
        if !done.failures.is_empty() {
            return Err(done.failures);
        }
        let name = self.program.name();
        let noticed = reports.noticed.notes(name)?;
        let summary = FileSummary::of(name, &done.summary, &[]);
        let notes = done.notes.into_iter().chain(noticed).collect();
        if let Some(path) = &mut reports.path {
            quote(path, self.text());
        }
        Ok(Some(Done { files, csv: reports.csv, summary, notes, path: reports.path }))
    }

    fn refused(&self, why: StreamError) -> Answer {
        match why {
            _ if self.stopped.load(Ordering::Relaxed) => {
                Err(Diagnostic::error("run.called-off", self.program.name(), "the run was called off").into())
            }
            StreamError::NotStreamable => Ok(None),
            StreamError::Refused(errors) => Err(errors),
            StreamError::Read(error) => Err(cannot_read(&self.source.name, &error)),
            StreamError::Write(error) => Err(crate::cli::files::cannot_write(&error)),
        }
    }
}

/// A text in memory.
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

/// A module of a posted program, which joins the others when it is through.
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
