//! `compensate` on long programs: from file to file in constant memory.

use super::batch::{Batch, in_one_file, place, post_options, report_beside};
use super::files::{cannot_read, cannot_write};
use super::job::{Job, Text};
use super::output::{Outputs, Temporary};
use super::readings::{self, FileText, LongText, Reading};
use super::report::ProgramReports;
use super::run::Done;
use super::{lines, progress, report};
use deflex::correct::{self, Outline, Poster, StreamError, compensate_long, post_chunks};
use deflex::program::cl::ClOptions;
use deflex::program::{Language, cl};
use deflex::report::FileSummary;
use deflex::text::Diagnostic;
use indicatif::ProgressBar;
use std::fs::File;
use std::io;
use std::path::Path;

/// Streams a program into staged outputs; `None` where only the whole of it tells what it means, or is asked for.
pub(super) fn compensate(batch: &Batch<'_>, job: &Job, bar: &ProgressBar) -> Result<Option<Done>, Vec<Diagnostic>> {
    let [Text::File { name, path }] = &job.texts[..] else { return Ok(None) };
    // A list of modules goes along with them.
    if !job.companions.is_empty() {
        return Ok(None);
    }
    let bar = batch.bar(bar);
    let text = FileText { name, path };
    let long = || -> Result<Long<'_>, Vec<Diagnostic>> {
        if let Some(bar) = bar {
            let bytes = path.metadata().map_err(|error| cannot_read(name, &error))?.len();
            progress::bytes(bar, bytes);
        }
        Ok(Long { batch, job, text, outputs: batch.outputs.sibling(), bar })
    };
    match job.language {
        Language::Cl if batch.args.post == Language::Rapid => long()?.post(),
        Language::Cl => Ok(None),
        Language::Rapid | Language::Krl | Language::Ls => {
            for reading in Reading::ALL {
                if let Some(done) = long()?.edit(reading)? {
                    return Ok(Some(done));
                }
            }
            Ok(None)
        }
    }
}

/// A long program on its way.
struct Long<'a> {
    batch: &'a Batch<'a>,
    job: &'a Job,
    text: FileText<'a>,
    outputs: Outputs,
    bar: Option<&'a ProgressBar>,
}

impl<'a> Long<'a> {
    /// RAPID and KRL: their own text, edited.
    fn edit(mut self, reading: Reading) -> Result<Option<Done>, Vec<Diagnostic>> {
        let (setup, language, text) = (self.batch.setup, self.job.language, self.text);
        let chunks = || readings::chunks((setup, setup.context.sources()), language, &text, reading);
        let Some(options) = setup.options_with_turns(text.name, language, chunks)? else { return Ok(None) };
        let (Some(chunks), original) = (chunks()?, text.open()?) else { return Ok(None) };
        let names = chunks.names();
        let file = &self.job.files[0];
        let mut program = self.outputs.open(&place(self.batch.args, file))?;
        let mut reports = self.reports(file)?;
        // It is there until the program is written.
        let mut spooled = None;
        let scratch = || {
            let (temporary, file) = Temporary::spool()?;
            spooled = Some(temporary);
            Ok(file)
        };
        let (run, threads) = ((&setup.cell.cell, &*options), self.threads());
        let done = reports.filled(self.bar, |sinks| {
            compensate_long(chunks, (original, scratch), (run.0, run.1, threads), &mut program, sinks)
        });
        drop(spooled);
        self.done(done, reports, |name| names.as_ref().is_some_and(|names| names.uses(name)))
    }

    /// CL, posted as RAPID.
    fn post(mut self) -> Result<Option<Done>, Vec<Diagnostic>> {
        let (args, setup) = (self.batch.args, self.batch.setup);
        let Some(options) = setup.cell.cl_options(setup.options.tool.as_deref()) else { return Ok(None) };
        let chunks = || self.chunks(&options);
        let Some(run) = setup.options_with_turns(self.text.name, self.job.language, chunks)? else { return Ok(None) };
        // Once through for what the head of the program needs, then once more.
        let Some(chunks) = self.chunks(&options)? else { return Ok(None) };
        let read = |targets, bytes| self.bar.into_iter().for_each(|bar| progress::read(bar, targets, bytes));
        let mut outline = match Outline::of_chunks(chunks, read) {
            Ok(outline) => outline,
            Err(why) => return self.refused(why),
        };
        if run.subdivide.is_some() && args.max_targets.is_some() {
            // How many parts there are is told by what is inserted.
            let Some(chunks) = self.chunks(&options)? else { return Ok(None) };
            let (cell, threads, bar) = (&setup.cell.cell, self.threads(), self.bar);
            let solved = |targets, bytes| bar.into_iter().for_each(|bar| progress::read(bar, targets, bytes));
            if let Err(why) = correct::count_chunks(chunks, cell, &run, threads, &mut outline, &solved) {
                return self.refused(why);
            }
        }
        let Some(chunks) = self.chunks(&options)? else { return Ok(None) };
        let poster = Poster::new(outline, &setup.cell.cell, &post_options(args, &self.job.files[0]))?;
        in_one_file(args, poster.files())?;
        let mut reports = self.reports(Path::new(poster.main_file()))?;
        let (bar, threads) = (self.bar, self.threads());
        let mut refused = None;
        let open = |name: &str| {
            let file = self.outputs.open(&place(args, Path::new(name)));
            // What is wrong with the name is said in more words than an I/O error has.
            file.map_err(|why| {
                refused = Some(why);
                io::Error::from(io::ErrorKind::Other)
            })
        };
        let done =
            reports.filled(bar, |sinks| post_chunks(chunks, &setup.cell.cell, &run, threads, &poster, open, sinks));
        match refused {
            Some(why) => Err(why),
            // Targets of CL data have no names.
            None => self.done(done, reports, |_| false),
        }
    }

    /// Reports of the program, whose own name one beside it takes.
    fn reports(&mut self, file: &Path) -> Result<ProgramReports<'a>, Vec<Diagnostic>> {
        let (args, programs) = (self.batch.args, self.batch.programs);
        let beside = report_beside(args, file);
        ProgramReports::open(
            beside,
            args.reports.report.as_deref(),
            programs,
            self.batch.path.clone(),
            self.batch.noticed(self.job),
            &mut self.outputs,
        )
    }

    /// Threads are shared among the programs of a batch.
    fn threads(&self) -> usize {
        rayon::current_num_threads().div_ceil(self.batch.programs)
    }

    /// The chunks of CL data; `None` where they can only be read whole.
    fn chunks(&self, options: &ClOptions) -> Result<Option<cl::Chunks<File>>, Vec<Diagnostic>> {
        let name = self.text.name;
        cl::Chunks::new(name, self.text.open()?, options).map_err(|error| cannot_read(name, &error))
    }

    fn done(
        self,
        done: Result<correct::Streamed, StreamError>,
        reports: ProgramReports<'_>,
        named: impl Fn(&str) -> bool,
    ) -> Result<Option<Done>, Vec<Diagnostic>> {
        let done = match done {
            Ok(done) => done,
            Err(why) => return self.refused(why),
        };
        if let Some(forces) = &self.batch.setup.forces {
            forces.check_targets(done.last, named)?;
        }
        if !done.failures.is_empty() {
            return Err(done.failures);
        }
        let noticed = reports.notes(self.text.name)?;
        let (rows, mut path) = reports.done(self.text.name, done.summary.targets);
        if let Some(path) = &mut path {
            lines::quote(path, self.text.open()?);
        }
        let summary = FileSummary::of(self.text.name, &done.summary, &[]);
        let line = report::line(&summary, true);
        let notes = done.notes.into_iter().chain(noticed).collect();
        Ok(Some(Done { outputs: self.outputs, rows, summary, line, notes, path }))
    }

    fn refused(&self, why: StreamError) -> Result<Option<Done>, Vec<Diagnostic>> {
        match why {
            StreamError::NotStreamable => Ok(None),
            StreamError::Refused(errors) => Err(self.batch.setup.cell.own(errors)),
            StreamError::Read(error) => Err(cannot_read(self.text.name, &error)),
            StreamError::Write(error) => Err(cannot_write(&error)),
        }
    }
}
