//! `--against`: the programs as they were before a correction.

use crate::session::job::Job;
use crate::session::read::all;
use crate::session::setup::Setup;
use deflex::program::{Language, Program};
use deflex::text::Diagnostic;
use std::path::Path;

/// `--against`: one original, or a folder with an original of each program's name.
pub(super) struct Originals<'a> {
    against: Option<&'a Path>,
    format: Option<Language>,
}

impl<'a> Originals<'a> {
    pub(super) fn new(
        against: Option<&'a Path>,
        jobs: &[Job],
        format: Option<Language>,
    ) -> Result<Self, Vec<Diagnostic>> {
        if against.is_some_and(|path| !path.is_dir()) && jobs.len() > 1 {
            let message = "--against names one program, but there are several inputs";
            let help = "give the folder of originals, with the same file names";
            return Err(vec![Diagnostic::error("usage.against", "", message).help(help)]);
        }
        Ok(Self { against, format })
    }

    /// The original of a program.
    pub(super) fn of(&self, job: &Job, setup: &Setup) -> Result<Option<Program>, Vec<Diagnostic>> {
        self.job(job)?.map(|original| setup.program(original)).transpose()
    }

    /// The same, not yet parsed.
    pub(super) fn job(&self, job: &Job) -> Result<Option<Job>, Vec<Diagnostic>> {
        let Some(path) = self.against else { return Ok(None) };
        // What is read with the corrected program is read with its original.
        let read_alike = |original: Job| original.with_context_of(job);
        if path.is_dir() {
            // The originals are one program, because the corrected files are.
            let files = all(job.files.iter().map(|file| Job::of(&path.join(file), self.format)))?;
            return Job::one(files).map(read_alike).map(Some);
        }
        Job::of(path, self.format).map(read_alike).map(Some)
    }
}
