//! What the command does, with the results in memory: for programs in other languages, and notebooks.
//!
//! ```
//! use deflex::cli::session::{CellFile, ProgramFiles, Run, compensate};
//! use std::path::{Path, PathBuf};
//! use std::sync::Arc;
//!
//! # fn main() -> Result<(), deflex::text::Diagnostics> {
//! let cell = Arc::new(CellFile::read(Path::new("samples/slot/cell.toml"))?);
//! let program = ProgramFiles::read(&[PathBuf::from("samples/slot/slot.mod")], &[], None)?;
//! let done = compensate(&program, &Run::new(cell))?;
//! assert!(done.summary.counts.max_remaining_mm < 1e-3);
//! assert!(done.files[0].1.starts_with(b"%%%"));
//! # Ok(())
//! # }
//! ```

mod files;
mod identified;
mod long;
mod planned;
mod simulated;
mod write;

pub use super::input::CellFile;
pub use files::ProgramFiles;
pub use identified::{Identified, MeasuredFile, MeasuredRunFiles, identify, identify_path};
pub use planned::{Planned, plan};
pub use simulated::{Simulated, SimulationProgress, simulate};
pub use write::write;

use super::again::Again;
use super::batch::posted_from;
use super::compensate::written;
use super::forces::ForceFile;
use super::output::Outputs;
use super::report::{Noticed, write_joined};
use super::setup::Setup;
use deflex::correct::{self, Corrected, CutProgress, Options, PostOptions};
use deflex::program::{Language, Program};
use deflex::report::html::{PathKind, PathPage, PathTrace};
use deflex::report::{FileSummary, Origin, Unrounded};
use deflex::text::{Diagnostic, Source};
use long::Long;
use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Receives the targets and the bytes of the program that are done; returning `false` cancels the run.
pub type Follow = dyn Fn(usize, u64) -> bool + Send + Sync;

/// How a program is run.
#[derive(Clone)]
pub struct Run {
    setup: Setup,
    /// Correct a program that has its correction in it already once more.
    pub again: bool,
    /// CL input: how it is posted; left out, under the file's name with what the command has for defaults.
    pub post: Option<PostOptions>,
    /// Who follows a long program, and the cut of a stock; all else is done at once.
    pub follow: Option<Arc<Follow>>,
    /// Whether the path is kept for a page.
    draws: bool,
    /// Whether the numbers of the report are kept as they are before they are printed.
    keeps_numbers: bool,
}

impl Run {
    /// With a cell, and all else as the command has it without options.
    #[must_use]
    pub fn new(cell: Arc<CellFile>) -> Self {
        let setup =
            Setup { cell, forces: None, context: super::input::Context::default(), options: Options::default() };
        Self { setup, again: false, post: None, follow: None, draws: false, keeps_numbers: false }
    }

    /// What the library has to do; its `forces` are those of [`Run::take_forces`].
    pub fn options(&mut self) -> &mut Options {
        &mut self.setup.options
    }

    /// Forces by target from the file at a path, as `--forces` takes them.
    ///
    /// # Errors
    /// The file cannot be read, or is no table of forces.
    pub fn read_forces(&mut self, path: &Path) -> Result<(), Vec<Diagnostic>> {
        let names = self.setup.cell.cell.columns.as_ref();
        let read = ForceFile::read(path, names)?;
        self.set_forces(read);
        Ok(())
    }

    /// The same from a table that is held.
    ///
    /// # Errors
    /// It is no table of forces.
    pub fn take_forces(&mut self, table: &Source) -> Result<(), Vec<Diagnostic>> {
        let names = self.setup.cell.cell.columns.as_ref();
        let read = ForceFile::of(table.name.clone(), &table.bytes[..], names)?;
        self.set_forces(read);
        Ok(())
    }

    fn set_forces(&mut self, (file, forces): (ForceFile, deflex::measured::Forces)) {
        self.setup.forces = Some(file);
        self.setup.options.forces = Some(forces);
    }

    /// Files that the run reads besides the program: the cell, and what declares names.
    pub fn inputs(&self) -> impl Iterator<Item = &Path> {
        let context = self.setup.context.sources().iter();
        context.map(|source| Path::new(&source.name)).chain([Path::new(&self.setup.cell.name)])
    }

    /// How CL input from this file is posted, where nothing else is said.
    #[must_use]
    pub fn posted_from(file: &Path) -> PostOptions {
        posted_from(file, file)
    }

    /// The same for a page: with the path, and the stiffness along it.
    fn drawing(&self) -> Self {
        let mut run = Self { draws: true, ..self.clone() };
        let options = run.options();
        (options.stiffness, options.stance) = (true, true);
        run
    }

    /// The options of a program that is held whole: who follows it sees the stock cut.
    fn options_followed(&self, program: &ProgramFiles) -> Cow<'_, Options> {
        let options = &self.setup.options;
        let Some(follow) = self.follow.clone().filter(|_| self.setup.cell.cell.stock.is_some()) else {
            return Cow::Borrowed(options);
        };
        let bytes: usize = program.sources().iter().map(|source| source.bytes.len()).sum();
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a share of the bytes
        let cut_progress = CutProgress::new(move |share| follow(0, (share * bytes as f64) as u64));
        Cow::Owned(Options { cut_progress, ..options.clone() })
    }

    /// Room for the numbers of the report, where they are wanted.
    fn numbers(&self) -> Option<Unrounded> {
        self.keeps_numbers.then(Unrounded::default)
    }

    /// An empty path, where one is wanted.
    fn path(&self, kind: PathKind) -> Option<PathTrace> {
        self.draws.then(|| PathTrace::new(kind, 1))
    }

    /// The page of a run whose path was kept.
    fn page(&self, kind: PathKind, done: Done) -> String {
        let cell = self.setup.cell.origin();
        let programs = done.path.map(|path| (done.summary, path));
        let scene = Some(&self.setup.cell.cell);
        PathPage { kind, cell: &cell, programs: programs.as_slice(), scene, tolerance_mm: None }.html()
    }

    /// Parses a program and checks that the forces are its own.
    fn parse(&self, program: &ProgramFiles) -> Result<Program, Vec<Diagnostic>> {
        let parsed = program.parse(&self.setup.cell, self.setup.options.tool.as_deref())?;
        self.setup.forces.as_ref().map_or(Ok(()), |forces| forces.check(&parsed))?;
        Ok(parsed)
    }
}

/// What a program came to.
#[derive(Debug)]
#[non_exhaustive]
pub struct Done {
    /// The corrected program's files under their names; none where it is only predicted.
    pub files: Vec<(PathBuf, Vec<u8>)>,
    /// The report as `--report` writes it.
    pub csv: Vec<u8>,
    /// What `--json` says of the program.
    pub summary: FileSummary,
    /// What the command says besides.
    pub notes: Vec<Diagnostic>,
    /// Where it is kept for a page.
    path: Option<PathTrace>,
    /// Numbers of the report, where they are kept.
    numbers: Option<Unrounded>,
}

/// The page that `deflex compensate --html` writes: takes another run, with the stiffness along the path.
///
/// # Errors
/// Those of [`compensate`].
pub fn compensate_page(program: &ProgramFiles, run: &Run) -> Result<String, Vec<Diagnostic>> {
    let run = run.drawing();
    compensate(program, &run).map(|done| run.page(PathKind::Compensate, done))
}

/// The page that `deflex predict --html` writes, in the same way.
///
/// # Errors
/// Those of [`predict`].
pub fn predict_page(
    program: &ProgramFiles,
    against: Option<&ProgramFiles>,
    run: &Run,
) -> Result<String, Vec<Diagnostic>> {
    let run = run.drawing();
    predict(program, against, &run).map(|done| run.page(PathKind::Predict, done))
}

/// The numbers of the report of [`compensate`] as they are before they are printed: takes another run.
///
/// # Errors
/// Those of [`compensate`].
pub fn compensate_unrounded(program: &ProgramFiles, run: &Run) -> Result<Unrounded, Vec<Diagnostic>> {
    let run = Run { keeps_numbers: true, ..run.clone() };
    compensate(program, &run).map(|done| done.numbers.unwrap_or_default())
}

/// The same of [`predict`].
///
/// # Errors
/// Those of [`predict`].
pub fn predict_unrounded(
    program: &ProgramFiles,
    against: Option<&ProgramFiles>,
    run: &Run,
) -> Result<Unrounded, Vec<Diagnostic>> {
    let run = Run { keeps_numbers: true, ..run.clone() };
    predict(program, against, &run).map(|done| done.numbers.unwrap_or_default())
}

/// Corrects a program: what `deflex compensate` does.
///
/// # Errors
/// All for which the command ends with exit code 2, and `run.called-off`.
pub fn compensate(program: &ProgramFiles, run: &Run) -> Result<Done, Vec<Diagnostic>> {
    program.marked()?;
    // CL data in other languages than RAPID are posted as a whole.
    let streams = run.post.as_ref().is_none_or(|post| post.language == Language::Rapid);
    let done = match Long::of(program, run).filter(|_| streams) {
        Some(long) => long.compensate()?,
        None => None,
    };
    let done = done.map_or_else(|| compensate_whole(program, run), Ok);
    told(done, program, run)
}

/// Predicts what becomes of a program as it stands: what `deflex predict` does; `against` is the original of a corrected one.
///
/// # Errors
/// All for which the command ends with exit code 2, and `run.called-off`.
pub fn predict(program: &ProgramFiles, against: Option<&ProgramFiles>, run: &Run) -> Result<Done, Vec<Diagnostic>> {
    program.marked()?;
    let done = match Long::of(program, run) {
        Some(long) => long.predict(against)?,
        None => None,
    };
    let done = done.map_or_else(|| predict_whole(program, against, run), Ok);
    told(done, program, run)
}

/// With what every run says, and what it was made from.
fn told(done: Result<Done, Vec<Diagnostic>>, program: &ProgramFiles, run: &Run) -> Result<Done, Vec<Diagnostic>> {
    let mut done = done.map_err(|errors| run.setup.failed(run.setup.cell.own(errors)))?;
    done.notes.splice(0..0, run.setup.notes());
    done.notes = run.setup.cell.own(done.notes);
    done.summary.sources = program.sources().iter().map(|source| Origin::of(&source.name, &source.bytes)).collect();
    Ok(done)
}

/// What is watched for in the rows of a program that is corrected.
fn noticed<'a>(program: &ProgramFiles, run: &'a Run) -> Noticed<'a> {
    let files = program.sources().into_iter().map(|source| Path::new(&source.name));
    Noticed::new(run.setup.options.forces.as_ref(), (!run.again).then(|| Again::beside(files)))
}

fn compensate_whole(program: &ProgramFiles, run: &Run) -> Result<Done, Vec<Diagnostic>> {
    let noticed = noticed(program, run);
    let parsed = run.parse(program)?;
    let cell = &run.setup.cell.cell;
    let corrected = correct::compensate(&parsed, cell, &run.options_followed(program))?;
    if !corrected.failures.is_empty() {
        return Err(corrected.failures);
    }
    let names = program.names();
    let post = || run.post.clone().unwrap_or_else(|| Run::posted_from(&names[0]));
    let (files, notes) = written(&parsed, &corrected, cell, names, post)?;
    whole(program.name(), &parsed, corrected, noticed, PathKind::Compensate, run).map(|done| {
        let notes = done.notes.into_iter().chain(notes).collect();
        Done { files, notes, ..done }
    })
}

fn predict_whole(program: &ProgramFiles, against: Option<&ProgramFiles>, run: &Run) -> Result<Done, Vec<Diagnostic>> {
    let original = against.map(|original| run.parse(original)).transpose()?;
    let parsed = run.parse(program)?;
    let cell = &run.setup.cell.cell;
    let predicted = correct::predict(&parsed, cell, &run.options_followed(program), original.as_ref())?;
    let noticed = Noticed::new(run.setup.options.forces.as_ref(), None);
    whole(program.name(), &parsed, predicted, noticed, PathKind::Predict, run)
}

fn whole(
    name: &str,
    program: &Program,
    corrected: Corrected,
    noticed: Noticed<'_>,
    kind: PathKind,
    run: &Run,
) -> Result<Done, Vec<Diagnostic>> {
    let targets = corrected.rows.len();
    let mut numbers = run.numbers();
    numbers.iter_mut().for_each(|numbers| numbers.take(&corrected.rows));
    let outputs = Outputs::default();
    let done = super::run::Done::new((name, kind), program, corrected, outputs, run.path(kind), noticed)?;
    let mut csv = Vec::new();
    // Writing to a Vec cannot fail.
    let _ = write_joined(done.rows.as_slice(), &mut csv);
    if let Some(follow) = &run.follow {
        follow(targets, program.sources.iter().map(|source| source.bytes.len() as u64).sum());
    }
    Ok(Done { files: Vec::new(), csv, summary: done.summary, notes: done.notes, path: done.path, numbers })
}
