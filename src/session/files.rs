use super::{CellFile, Run};
use crate::session::input::{self, Context};
use crate::session::job::{Job, Long};
use crate::session::read::all;
use crate::session::text::Text;
use deflex::program::{Language, Program};
use deflex::report::Origin;
use deflex::text::{Diagnostic, Source};
use std::path::PathBuf;

/// The files of one program, read and not yet parsed.
///
/// # Examples
/// ```
/// use deflex::program::Language;
/// use deflex::session::{CellFile, ProgramFiles};
///
/// let files = ProgramFiles::read(&["samples/blade/blade.aptsource".into()], &[], None)?;
/// assert!(files.language() == Language::Cl && files.name().ends_with("blade.aptsource"));
/// assert_eq!((files.sources().len(), files.names().len()), (1, 1));
/// assert!(files.companions().is_empty()); // it has no .pgf list
/// let cell = CellFile::read("samples/blade/cell.toml".as_ref())?;
/// assert_eq!(files.parse(&cell, None)?.targets.len(), files.parse_alone()?.targets.len());
/// # Ok::<(), deflex::text::Diagnostics>(())
/// ```
#[derive(Clone, Debug)]
pub struct ProgramFiles {
    /// Holds the texts in memory.
    job: Job,
    context: Context,
}

impl ProgramFiles {
    /// Reads the files of one program: RAPID modules, a `.pgf` list, or one file in another language. `context` are
    /// modules that declare names and are never written. `format` is the value of `--input-format`, for files whose
    /// content and ending do not show the language.
    ///
    /// # Errors
    /// Files that cannot be read or whose language is unknown; several files that are not RAPID modules.
    pub fn read(paths: &[PathBuf], context: &[PathBuf], format: Option<&str>) -> Result<Self, Vec<Diagnostic>> {
        let format = format.map(known).transpose()?;
        let jobs = all(paths.iter().map(|path| Job::of(path, format)))?;
        let (job, context) = crate::session::read::both(Job::one(jobs), Context::of(context))?;
        Self::of(job, context)
    }

    pub(crate) fn of(job: Job, context: Context) -> Result<Self, Vec<Diagnostic>> {
        Ok(Self { job: job.held()?, context })
    }

    /// Name of the program in messages and reports: the paths as they were given.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.job.name
    }

    /// Language of all its files.
    #[must_use]
    pub fn language(&self) -> Language {
        self.job.language
    }

    /// Texts of the files, in the order in which they were given.
    #[must_use]
    pub fn sources(&self) -> Vec<&Source> {
        self.job.texts.iter().filter_map(Text::source).collect()
    }

    /// The program as one text that can be read in chunks; `None` if it has several files.
    pub(super) fn long(&self, run: &Run) -> Option<Long<'_>> {
        self.job.long(self.context.knowing(&run.setup.cell.cell, self.job.language), run.setup.cl_options())
    }

    /// Names of the files in an output folder.
    #[must_use]
    pub fn names(&self) -> &[PathBuf] {
        &self.job.files
    }

    /// Files that are copied into the output folder without a change: a `.pgf` list.
    #[must_use]
    pub fn companions(&self) -> &[(PathBuf, Vec<u8>)] {
        &self.job.companions
    }

    /// Parses the program for a run with a cell. CL data are read with the cell's `[cl]` table and tools; `tool` is the
    /// value of `--tool`.
    ///
    /// # Errors
    /// Everything that the reader of the language refuses; for CL data, a cell without a `[cl]` table.
    pub fn parse(&self, cell: &CellFile, tool: Option<&str>) -> Result<Program, Vec<Diagnostic>> {
        input::program(self.job.clone(), &self.context, cell, tool)
    }

    /// Parses the program without a cell, for results that do not depend on one.
    ///
    /// # Errors
    /// Everything that the reader of the language refuses.
    pub fn parse_alone(&self) -> Result<Program, Vec<Diagnostic>> {
        input::program_alone(self.job.clone(), &self.context)
    }

    /// Names and hashes of its files, which results state.
    pub(super) fn origins(&self) -> Vec<Origin> {
        self.sources().iter().map(|source| Origin::of(&source.name, &source.bytes)).collect()
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
