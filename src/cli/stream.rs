//! `compensate` on long programs: from file to file in constant memory.

use super::batch::{Batch, in_one_file, place, post_options, report_beside};
use super::files::{cannot_read, cannot_write, source};
use super::job::{Job, Text};
use super::output::{Outputs, Temporary};
use super::report::ProgramReports;
use super::run::Done;
use super::{lines, progress, report};
use deflex::correct::{
    self, Options, Outline, Poster, StreamError, compensate_chunks, compensate_declared, compensate_executed,
    post_chunks,
};
use deflex::program::cl::ClOptions;
use deflex::program::{ChunkReader, Language, cl, krl, rapid};
use deflex::report::FileSummary;
use deflex::text::{Diagnostic, Patch, apply};
use indicatif::ProgressBar;
use std::borrow::Cow;
use std::fs::File;
use std::io::{self, Seek, Write};
use std::path::Path;

/// Streams a program into staged outputs; `None` where only the whole of it tells what it means, or is asked for.
pub(super) fn compensate(batch: &Batch<'_>, job: &Job, bar: &ProgressBar) -> Result<Option<Done>, Vec<Diagnostic>> {
    let [Text::File { name, path }] = &job.texts[..] else { return Ok(None) };
    // A list of modules goes along with them.
    if !job.companions.is_empty() {
        return Ok(None);
    }
    // In a batch the bar counts programs.
    let bar = Some(bar).filter(|_| batch.programs == 1);
    let readings: &[Reading<'_>] = match job.language {
        Language::Rapid => &[Long::edit, Long::patch, Long::run_again],
        Language::Krl => &[Long::edit_krl],
        // The positions of a TP program stand behind all its motions: it is held as a whole.
        Language::Cl if batch.args.post == Language::Rapid => &[Long::post],
        _ => &[],
    };
    for reading in readings {
        let file = File::open(path).map_err(|error| cannot_read(name, &error))?;
        if let Some(bar) = bar {
            let bytes = file.metadata().map_err(|error| cannot_read(name, &error))?.len();
            progress::bytes(bar, bytes);
        }
        let long = Long { batch, job, name, path, file, outputs: batch.outputs.sibling(), bar };
        if let Some(done) = reading(long)? {
            return Ok(Some(done));
        }
    }
    Ok(None)
}

/// One way to read a long program; `None` where it does not read like that.
type Reading<'a> = fn(Long<'a>) -> Result<Option<Done>, Vec<Diagnostic>>;

/// A long program on its way.
struct Long<'a> {
    batch: &'a Batch<'a>,
    job: &'a Job,
    /// As the user typed it.
    name: &'a str,
    path: &'a Path,
    file: File,
    outputs: Outputs,
    bar: Option<&'a ProgressBar>,
}

impl<'a> Long<'a> {
    /// KRL, edited in place.
    fn edit_krl(self) -> Result<Option<Done>, Vec<Diagnostic>> {
        let (name, context) = (self.name, self.batch.setup.context.sources());
        self.rewrite(|file| krl::Chunks::new(name, file, context))
    }

    /// Writes what the chunks become, one behind the other.
    fn rewrite<C: ChunkReader + Send>(
        mut self,
        chunks: impl Fn(File) -> io::Result<Option<C>>,
    ) -> Result<Option<Done>, Vec<Diagnostic>> {
        let name = self.name;
        let mut chunks = |long: &mut Self| chunks(long.reread()?).map_err(|error| cannot_read(name, &error));
        let Some(options) = self.with_turns(&mut chunks)? else { return Ok(None) };
        let Some(chunks) = chunks(&mut self)? else { return Ok(None) };
        let file = &self.job.files[0];
        let mut program = self.outputs.open(&place(self.batch.args, file))?;
        let mut reports = self.reports(file)?;
        let (setup, threads) = (self.batch.setup, self.threads());
        let done = reports.filled(self.bar, |sinks| {
            compensate_chunks(chunks, &setup.cell.cell, &options, threads, &mut program, sinks)
        });
        self.done(done, reports, |_| false)
    }

    /// RAPID, edited in place.
    fn edit(self) -> Result<Option<Done>, Vec<Diagnostic>> {
        let (name, context) = (self.name, self.batch.setup.context.sources());
        self.rewrite(|file| rapid::Chunks::of_file(name, file, context))
    }

    /// The run's options with the turns that are chosen along the program, where they are free: once more through it. `None` where
    /// only the whole of it tells them.
    fn with_turns<C: ChunkReader>(
        &mut self,
        chunks: &mut impl FnMut(&mut Self) -> Result<Option<C>, Vec<Diagnostic>>,
    ) -> Result<Option<Cow<'a, Options>>, Vec<Diagnostic>> {
        let setup = self.batch.setup;
        setup.options_with_turns(self.name, self.job.language, || chunks(self))
    }

    /// RAPID with loops through more motions than can be held: what changes is agreed on in a first run.
    fn run_again(mut self) -> Result<Option<Done>, Vec<Diagnostic>> {
        let source = source(self.path)?;
        let read = rapid::Executed::read(vec![source], self.batch.setup.context.sources().to_vec())?;
        let Some(executed) = read else { return Ok(None) };
        let (args, file, names) = (self.batch.args, &self.job.files[0], rapid::Names::of(executed.distinct()));
        let mut program = self.outputs.open(&place(args, file))?;
        let mut reports = self.reports(file)?;
        let (setup, threads) = (self.batch.setup, self.threads());
        let done = reports.filled(self.bar, |sinks| {
            let (done, edits) = compensate_executed(&executed, &setup.cell.cell, &setup.options, threads, sinks)?;
            if done.failures.is_empty() {
                apply(&executed.distinct().sources[0].bytes, &edits[0], &mut program).map_err(StreamError::Write)?;
                program.flush().map_err(StreamError::Write)?;
            }
            Ok(done)
        });
        self.done(done, reports, |name| names.uses(name))
    }

    /// RAPID with declared targets or several routines: what changes is collected first.
    fn patch(mut self) -> Result<Option<Done>, Vec<Diagnostic>> {
        let (context, name, path) = (self.batch.setup.context.sources(), self.name, self.path);
        let failed = |error: io::Error| cannot_read(name, &error);
        // Places of their own in the same file.
        let open = || File::open(path).map_err(failed);
        let chunks = rapid::Declared::new(name, open()?, open()?, context);
        let Some(chunks) = chunks.map_err(failed)? else { return Ok(None) };
        let file = &self.job.files[0];
        let mut program = self.outputs.open(&place(self.batch.args, file))?;
        let mut reports = self.reports(file)?;
        let (_scratch, scratch) = Temporary::spool().map_err(|error| cannot_write(&error))?;
        let mut patch = Patch::new(scratch);
        let (setup, threads) = (self.batch.setup, self.threads());
        let (names, original) = (chunks.names(), self.reread()?);
        let done = reports.filled(self.bar, |sinks| {
            let done = compensate_declared(chunks, &setup.cell.cell, &setup.options, threads, &mut patch, sinks)?;
            if done.failures.is_empty() {
                patch.apply(original, &mut program).map_err(StreamError::Write)?;
            }
            Ok(done)
        });
        self.done(done, reports, |name| names.uses(name))
    }

    /// CL, posted as RAPID.
    fn post(mut self) -> Result<Option<Done>, Vec<Diagnostic>> {
        let (args, setup) = (self.batch.args, self.batch.setup);
        let Some(options) = setup.cell.cl_options(setup.options.tool.as_deref()) else { return Ok(None) };
        let Some(run) = self.with_turns(&mut |long| long.chunks(&options))? else { return Ok(None) };
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
    fn chunks(&mut self, options: &ClOptions) -> Result<Option<cl::Chunks<File>>, Vec<Diagnostic>> {
        cl::Chunks::new(self.name, self.reread()?, options).map_err(|error| cannot_read(self.name, &error))
    }

    /// The file from its start.
    fn reread(&mut self) -> Result<File, Vec<Diagnostic>> {
        let again = self.file.rewind().and_then(|()| self.file.try_clone());
        again.map_err(|error| cannot_read(self.name, &error))
    }

    fn done(
        mut self,
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
        let noticed = reports.notes(self.name)?;
        let (rows, mut path) = reports.done(self.name, done.summary.targets);
        if let Some(path) = &mut path {
            lines::quote(path, self.reread()?);
        }
        let summary = FileSummary::of(self.name, &done.summary, &[]);
        let line = report::line(&summary, true);
        let notes = done.notes.into_iter().chain(noticed).collect();
        Ok(Some(Done { outputs: self.outputs, rows, summary, line, notes, path }))
    }

    fn refused(&self, why: StreamError) -> Result<Option<Done>, Vec<Diagnostic>> {
        match why {
            StreamError::NotStreamable => Ok(None),
            StreamError::Refused(errors) => Err(self.batch.setup.cell.own(errors)),
            StreamError::Read(error) => Err(cannot_read(self.name, &error)),
            StreamError::Write(error) => Err(cannot_write(&error)),
        }
    }
}
