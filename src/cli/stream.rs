//! `compensate` for long programs: copies from file to file in constant memory.

use super::batch::{Batch, in_one_file, place, post_options};
use super::predicted::Passed;
use super::progress;
use super::report::ProgramReports;
use super::run::Done;
use crate::session::job::Job;
use crate::session::output::{Outputs, Temporary};
use crate::session::text::Text;
use deflex::correct::{LaidOut, StreamError, Streamed, compensate_long, post_long};
use deflex::program::{InChunks, Language};
use deflex::report::html::PathKind;
use deflex::text::Diagnostic;
use indicatif::ProgressBar;
use std::io;
use std::path::Path;

/// Writes the corrected program into staged files, chunk by chunk; `None` if only the whole program shows its meaning,
/// or if an option needs the whole.
pub(super) fn compensate(batch: &Batch<'_>, job: &Job, bar: &ProgressBar) -> Result<Option<Done>, Vec<Diagnostic>> {
    let Some(program) = batch.setup.long(job) else { return Ok(None) };
    // A `.pgf` list is copied with its modules, and CL data are posted as a whole in other languages than RAPID.
    if !job.companions.is_empty() || (job.language == Language::Cl && batch.args.post != Language::Rapid) {
        return Ok(None);
    }
    let bar = progress::of_one(bar, batch.programs);
    program.by_chunks(|program| {
        if let Some(bar) = bar {
            progress::bytes(bar, program.text().bytes()?);
        }
        let long = Long { batch, job, program, outputs: batch.outputs.sibling(), bar };
        if job.language.is_edited() { long.edit() } else { long.post() }
    })
}

/// A long program that is being corrected.
struct Long<'a> {
    batch: &'a Batch<'a>,
    job: &'a Job,
    program: InChunks<'a, &'a Text>,
    outputs: Outputs,
    bar: Option<&'a ProgressBar>,
}

impl<'a> Long<'a> {
    /// Edits the numbers in the program's own text.
    fn edit(mut self) -> Result<Option<Done>, Vec<Diagnostic>> {
        let setup = self.batch.setup;
        let file = &self.job.files[0];
        let mut text = self.outputs.open(&place(self.batch.args, file))?;
        let mut reports = self.reports(file)?;
        // The temporary file exists until the program is written.
        let mut spooled = None;
        let scratch = || {
            let (temporary, file) = Temporary::spool()?;
            spooled = Some(temporary);
            Ok(file)
        };
        let run = (&setup.cell.cell, &setup.options, self.threads());
        let done = reports.filled(self.bar, |sinks| compensate_long(&self.program, scratch, run, &mut text, sinks));
        drop(spooled);
        self.done(done, reports)
    }

    /// Posts CL data as RAPID.
    fn post(mut self) -> Result<Option<Done>, Vec<Diagnostic>> {
        let (args, setup, bar, threads) = (self.batch.args, self.batch.setup, self.bar, self.threads());
        let cell = &setup.cell.cell;
        let read = |targets, bytes| bar.into_iter().for_each(|bar| progress::read(bar, targets, bytes));
        let post = post_options(args, &self.job.files[0]);
        let laid_out = LaidOut::new(&self.program, (cell, &setup.options, threads), &post, &read);
        let Some(laid_out) = setup.through(self.job.texts[0].name(), laid_out)? else { return Ok(None) };
        in_one_file(args, laid_out.files())?;
        let mut reports = self.reports(Path::new(laid_out.main_file()))?;
        let mut refused = None;
        let open = |name: &str| {
            let file = self.outputs.open(&place(args, Path::new(name)));
            // The reason for which a name is refused is kept, because an I/O error has no room for its help text.
            file.map_err(|why| {
                refused = Some(why);
                io::Error::from(io::ErrorKind::Other)
            })
        };
        let done = reports.filled(bar, |sinks| post_long(&self.program, &laid_out, (cell, threads), open, sinks));
        match refused {
            Some(why) => Err(why),
            None => self.done(done, reports),
        }
    }

    /// Opens the reports of the program. Refuses a report that has the same path as the program.
    fn reports(&mut self, file: &Path) -> Result<ProgramReports<'a>, Vec<Diagnostic>> {
        let (args, programs) = (self.batch.args, self.batch.programs);
        let default = self.batch.default_report(file);
        ProgramReports::open(
            default,
            args.reports.report.as_deref(),
            programs,
            self.batch.path.clone(),
            self.batch.noticed(self.job),
            &mut self.outputs,
        )
    }

    /// The number of threads for this program: the programs of a batch share the threads.
    fn threads(&self) -> usize {
        rayon::current_num_threads().div_ceil(self.batch.programs)
    }

    fn done(
        self,
        done: Result<Streamed, StreamError>,
        reports: ProgramReports<'_>,
    ) -> Result<Option<Done>, Vec<Diagnostic>> {
        let text = &self.job.texts[0];
        let passed = Passed::of(done, reports, self.outputs, text, self.batch.setup)?;
        Ok(passed.map(|passed| Done::streamed(text.name(), PathKind::Compensate, passed)))
    }
}
