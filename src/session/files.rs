use super::{CellFile, Run};
use crate::session::context::Context;
use crate::session::input;
use crate::session::job::{Job, Long};
use crate::session::read::all;
use crate::session::text::Text;
use deflex::program::{Language, Program};
use deflex::report::Origin;
use deflex::text::{Diagnostic, Source};
use std::hash::{Hash, Hasher};
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

/// The parts of a program's files, for a copy in another process.
///
/// # Examples
/// ```
/// use deflex::session::{ProgramFiles, ProgramParts};
///
/// let files = ProgramFiles::read(&["samples/slot/slot.mod".into()], &[], None)?;
/// let ProgramParts { name, texts, .. } = files.parts();
/// assert!(name == "samples/slot/slot.mod" && texts.len() == 1);
/// assert!(ProgramFiles::from(files.parts()) == files);
/// # Ok::<(), deflex::text::Diagnostics>(())
/// ```
#[derive(Clone, Debug)]
pub struct ProgramParts {
    /// Name of the program: see [`ProgramFiles::name`].
    pub name: String,
    /// Language of all files.
    pub language: Language,
    /// Texts of the files.
    pub texts: Vec<Source>,
    /// Names of the files in an output folder.
    pub files: Vec<PathBuf>,
    /// Files that are copied into the output folder without a change.
    pub companions: Vec<(PathBuf, Vec<u8>)>,
    /// Modules that declare names and are never written.
    pub context: Vec<Source>,
}

impl From<ProgramParts> for ProgramFiles {
    fn from(parts: ProgramParts) -> Self {
        let ProgramParts { name, language, texts, files, companions, context } = parts;
        let texts = texts.into_iter().map(Text::Held).collect();
        Self { job: Job::of_parts(name, texts, files, companions, language), context: Context::from(context) }
    }
}

/// Programs are equal if the names and bytes of all their files are.
impl PartialEq for ProgramFiles {
    fn eq(&self, other: &Self) -> bool {
        self.key() == other.key()
    }
}

impl Eq for ProgramFiles {}

impl Hash for ProgramFiles {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.key().hash(state);
    }
}

impl ProgramFiles {
    /// What distinguishes the program from others.
    fn key(&self) -> impl PartialEq + Hash + '_ {
        let sources = self.sources().into_iter().chain(self.context.sources());
        let sources: Vec<_> = sources.map(|source| (&source.name, &source.bytes)).collect();
        (&self.job.name, self.job.language, sources, &self.job.files, &self.job.companions)
    }

    /// Reads the files of one program: RAPID modules, a `.pgf` list, or one file in another language. `context` are
    /// modules that declare names and are never written. `format` is the value of `--input-format`, for files whose
    /// content and ending do not show the language.
    ///
    /// # Errors
    /// Files that cannot be read or whose language is unknown; several files that are not RAPID modules.
    pub fn read(paths: &[PathBuf], context: &[PathBuf], format: Option<&str>) -> Result<Self, Vec<Diagnostic>> {
        let format = format.map(known).transpose()?;
        let jobs = all(paths.iter().map(|path| Job::of(path, format)))?;
        let (job, context) = crate::session::read::both(Job::one(jobs), Context::read(context))?;
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
        self.job.long(
            self.context.with(&self.job.context, self.job.language, Some(&run.setup.cell.cell)).ok()?,
            run.setup.cl_options(),
        )
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

    /// The parts of the program, from which another process makes it again.
    ///
    /// # Examples
    /// ```
    /// # let (program, _) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/run.rs"));
    /// let parts = program.parts();
    /// assert_eq!(parts.texts.len(), program.sources().len());
    /// # Ok::<(), deflex::text::Diagnostics>(())
    /// ```
    #[must_use]
    pub fn parts(&self) -> ProgramParts {
        ProgramParts {
            name: self.job.name.clone(),
            language: self.job.language,
            texts: self.sources().into_iter().cloned().collect(),
            files: self.job.files.clone(),
            companions: self.job.companions.clone(),
            context: self.context.sources().to_vec(),
        }
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
