use super::{CellFile, Run};
use crate::cli::files::all;
use crate::cli::input::{self, Context};
use crate::cli::job::{Job, Long};
use crate::cli::text::Text;
use deflex::program::{Language, Program};
use deflex::text::{Diagnostic, Source};
use std::path::PathBuf;

/// The files of one program, read and not yet parsed.
#[derive(Clone, Debug)]
pub struct ProgramFiles {
    /// Its texts are held.
    job: Job,
    context: Context,
}

impl ProgramFiles {
    /// Reads files that are one program: RAPID modules or a `.pgf` list, or one file of CL data. `context` are modules that
    /// declare names and are never written; `format` is that of `--input-format`, where neither content nor ending show it.
    ///
    /// # Errors
    /// Files that cannot be read or are of no known language; several that are no RAPID modules.
    pub fn read(paths: &[PathBuf], context: &[PathBuf], format: Option<&str>) -> Result<Self, Vec<Diagnostic>> {
        let format = format.map(known).transpose()?;
        let jobs = all(paths.iter().map(|path| Job::of(path, format)))?;
        let (job, context) = crate::cli::files::both(Job::one(jobs), Context::of(context))?;
        Self::of(job, context)
    }

    pub(in crate::cli) fn of(job: Job, context: Context) -> Result<Self, Vec<Diagnostic>> {
        Ok(Self { job: job.held()?, context })
    }

    /// Name for messages and reports: the files as they were given.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.job.name
    }

    /// Language of all files.
    #[must_use]
    pub fn language(&self) -> Language {
        self.job.language
    }

    /// The files.
    #[must_use]
    pub fn sources(&self) -> Vec<&Source> {
        self.job.texts.iter().filter_map(Text::source).collect()
    }

    /// The program in one text, where it may be read in chunks.
    pub(super) fn long(&self, run: &Run) -> Option<Long<'_>> {
        self.job.long(self.context.knowing(&run.setup.cell.cell, self.job.language), run.setup.cl_options())
    }

    /// Names of the files in an output folder.
    #[must_use]
    pub fn names(&self) -> &[PathBuf] {
        &self.job.files
    }

    /// What else belongs into the output folder as it is: a `.pgf` list.
    #[must_use]
    pub fn companions(&self) -> &[(PathBuf, Vec<u8>)] {
        &self.job.companions
    }

    /// Parses them for a run with a cell, whose `[cl]` and tools CL data need; `tool` is that of `--tool`.
    ///
    /// # Errors
    /// What the language's reader refuses; a cell that does not say how CL data are read.
    pub fn parse(&self, cell: &CellFile, tool: Option<&str>) -> Result<Program, Vec<Diagnostic>> {
        input::program(self.job.clone(), &self.context, cell, tool)
    }

    /// Parses them where no cell is known: for what is independent of it.
    ///
    /// # Errors
    /// What the language's reader refuses.
    pub fn parse_alone(&self) -> Result<Program, Vec<Diagnostic>> {
        input::program_alone(self.job.clone(), &self.context)
    }

    pub(super) fn marked(&self) -> Result<(), Vec<Diagnostic>> {
        self.job.marked()
    }
}

fn known(format: &str) -> Result<Language, Vec<Diagnostic>> {
    Language::ALL.into_iter().find(|language| language.word() == format).ok_or_else(|| {
        Diagnostic::error("usage.format", "", format!("`{format}` is not a program format"))
            .help(format!("give one of {}", Language::ALL.map(Language::word).join(", ")))
            .into()
    })
}
