//! The commands of deflex with their results in memory, for programs in other languages and notebooks. The command line uses the same
//! code for reading and writing files: no other part of the library does.
//!
//! ```
//! use deflex::session::{CellFile, ProgramFiles, Run, compensate};
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

// The command line alone uses some of it.
#![cfg_attr(not(feature = "cli"), allow(dead_code))]

pub(crate) mod again;
pub(crate) mod blocks;
pub(crate) mod checked;
mod compared;
pub(crate) mod context;
pub(crate) mod file_state;
mod files;
pub(crate) mod finished;
pub(crate) mod forces;
mod identified;
pub(crate) mod input;
mod inspected;
pub(crate) mod job;
pub(crate) mod lines;
mod long;
pub(crate) mod output;
mod planned;
pub(crate) mod read;
pub(crate) mod report;
pub(crate) mod setup;
mod simulated;
mod template;
pub(crate) mod text;
pub(crate) mod tolerances;
mod write;
pub(crate) mod written;

pub use checked::{Checked, check, check_page};
pub use compared::{Compared, diff};
pub use files::{ProgramFiles, ProgramParts};
pub use identified::{Identified, MeasuredFile, MeasuredRunFiles, identify, identify_path};
pub use input::CellFile;
pub use inspected::{Inspected, inspect, programs_in};
pub use planned::{Planned, plan};
pub use simulated::{Simulated, SimulationProgress, simulate};
pub use template::{CellSource, init};
pub use tolerances::Tolerances;
pub use write::write;

use again::Again;
use deflex::correct::{self, Corrected, CutProgress, LoadedPath, Options, PostOptions};
use deflex::program::{Language, Program};
use deflex::report::html::{PathKind, PathPage, PathTrace};
use deflex::report::{FileSummary, Unrounded};
use deflex::text::{Diagnostic, Source};
use finished::Finished;
use forces::ForceFile;
use long::Long;
use report::{Noticed, write_joined};
use setup::Setup;
use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use written::{Edited, Written, posted_from, written};

/// Receives the number of targets and of program bytes that are done. The run is cancelled when it returns `false`.
pub type Follow = dyn Fn(usize, u64) -> bool + Send + Sync;

/// The cell and the options of a run.
///
/// # Examples
/// ```
/// use deflex::session::{CellFile, Run};
/// use deflex::text::Source;
///
/// let mut run = Run::new(CellFile::read("samples/closed-loop/cell.toml".as_ref())?.into());
/// run.options().subdivide = Some(2e-5); // m: inserts targets, as `--subdivide 0.02` does
/// run.take_forces(&Source::new("forces", "target,fx_n,fy_n,fz_n\n1,0,0,120\n2,0,0,90\n"))?;
/// run.read_forces("samples/closed-loop/measured.csv".as_ref())?; // replaces them
/// assert_eq!(run.inputs().count(), 1); // the cell
/// assert_eq!(Run::posted_from("blade.aptsource".as_ref()).name, "blade");
/// # Ok::<(), deflex::text::Diagnostics>(())
/// ```
#[derive(Clone)]
pub struct Run {
    setup: Setup,
    /// Whether a program that has been corrected already is corrected once more.
    pub again: bool,
    /// Keeps the path that the controller drives and the loaded arm takes within this distance of the programmed one, m:
    /// `--max-path-error`.
    pub max_path_error: Option<f64>,
    /// How CL data are posted; `None` posts them under the name of their file with the defaults of the command.
    pub post: Option<PostOptions>,
    /// Receives the progress of long programs and of the cut of a stock; other work is too short to report any.
    pub follow: Option<Arc<Follow>>,
    /// Whether the path is kept for a page.
    draws: bool,
    /// Whether the numbers of the report are kept unrounded.
    keeps_numbers: bool,
}

impl Run {
    /// A run with this cell and the default options of the command.
    #[must_use]
    pub fn new(cell: Arc<CellFile>) -> Self {
        let setup = Setup { cell, forces: None, context: context::Context::default(), options: Options::default() };
        Self { setup, again: false, max_path_error: None, post: None, follow: None, draws: false, keeps_numbers: false }
    }

    /// The options of the library. Set its `forces` with [`Run::read_forces`] or [`Run::take_forces`], which check
    /// them.
    pub fn options(&mut self) -> &mut Options {
        &mut self.setup.options
    }

    /// Reads forces by target from the file at a path, as `--forces` does.
    ///
    /// # Errors
    /// The file cannot be read, or is not a table of forces.
    pub fn read_forces(&mut self, path: &Path) -> Result<(), Vec<Diagnostic>> {
        let names = self.setup.cell.cell.columns.as_ref();
        let read = ForceFile::read(path, names)?;
        self.set_forces(read);
        Ok(())
    }

    /// Takes forces by target from a table in memory.
    ///
    /// # Errors
    /// The text is not a table of forces.
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

    /// Files that the run reads in addition to the program: the cell, and modules that declare names.
    pub fn inputs(&self) -> impl Iterator<Item = &Path> {
        let context = self.setup.context.sources().iter();
        context.map(|source| Path::new(&source.name)).chain([Path::new(&self.setup.cell.name)])
    }

    /// How CL data from this file are posted by default.
    #[must_use]
    pub fn posted_from(file: &Path) -> PostOptions {
        posted_from(file, file)
    }

    /// The same run with what a page needs: the path, and the stiffness along it.
    fn drawing(&self) -> Self {
        let mut run = Self { draws: true, ..self.clone() };
        let options = run.options();
        (options.stiffness, options.stance) = (true, true);
        run
    }

    /// The options for a program that is held as a whole: `follow` receives the progress of the cut, if the cell has a
    /// stock.
    fn options_followed(&self, program: &ProgramFiles) -> Cow<'_, Options> {
        let bytes: usize = program.sources().iter().map(|source| source.bytes.len()).sum();
        let cut_progress =
            |follow: Arc<Follow>| CutProgress::new(move |share| follow(0, (share * bytes as f64) as u64));
        self.setup.options_followed(self.follow.clone().map(cut_progress))
    }

    /// A place to keep the unrounded numbers of the report, if they are wanted.
    fn numbers(&self) -> Option<Unrounded> {
        self.keeps_numbers.then(Unrounded::default)
    }

    /// An empty path for a page, if one is wanted.
    fn path(&self, kind: PathKind) -> Option<PathTrace> {
        self.draws.then(|| PathTrace::new(kind, 1))
    }

    /// The page of a run that kept its path.
    fn page(&self, kind: PathKind, path: Option<(FileSummary, PathTrace)>, tolerance_mm: Option<f64>) -> String {
        let cell = self.setup.cell.origin();
        let scene = Some(&self.setup.cell.cell);
        PathPage { kind, cell: &cell, programs: path.as_slice(), scene, tolerance_mm }.html()
    }

    /// Parses a program and checks that the table of forces belongs to it.
    fn parse(&self, program: &ProgramFiles) -> Result<Program, Vec<Diagnostic>> {
        let parsed = program.parse(&self.setup.cell, self.setup.options.tool.as_deref())?;
        self.setup.forces.as_ref().map_or(Ok(()), |forces| forces.check(&parsed))?;
        Ok(parsed)
    }
}

/// Results of a run of one program.
///
/// # Examples
/// ```
/// use deflex::session::{CellFile, ProgramFiles, Run, predict};
/// use std::sync::Arc;
///
/// let cell = Arc::new(CellFile::read("samples/slot/cell.toml".as_ref())?);
/// let program = ProgramFiles::read(&["samples/slot/slot.mod".into()], &[], None)?;
/// let done = predict(&program, None, &Run::new(cell))?;
/// assert!(done.files.is_empty() && done.csv.starts_with(b"target,"));
/// # Ok::<(), deflex::text::Diagnostics>(())
/// ```
#[derive(Debug)]
#[non_exhaustive]
pub struct Done {
    /// Names and bytes of the corrected program's files; empty after a prediction.
    pub files: Vec<(PathBuf, Vec<u8>)>,
    /// The report as `--report` writes it.
    pub csv: Vec<u8>,
    /// The program's entry in what `--json` writes.
    pub summary: FileSummary,
    /// Warnings and notes of the run.
    pub notes: Vec<Diagnostic>,
    /// The path, if it is kept for a page.
    path: Option<PathTrace>,
    /// Unrounded numbers of the report, if they are kept.
    numbers: Option<Unrounded>,
}

impl Done {
    /// What a page draws.
    fn drawn(self) -> Option<(FileSummary, PathTrace)> {
        self.path.map(|path| (self.summary, path))
    }
}

/// The page that `deflex compensate --html` writes. The program is run anew, because the page also shows the stiffness
/// along the path.
///
/// # Errors
/// Those of [`compensate`].
///
/// # Examples
/// ```
/// # let (program, run) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/run.rs"));
/// let page = deflex::session::compensate_page(&program, &run)?;
/// assert!(page.starts_with("<!DOCTYPE html>"));
/// # Ok::<(), deflex::text::Diagnostics>(())
/// ```
pub fn compensate_page(program: &ProgramFiles, run: &Run) -> Result<String, Vec<Diagnostic>> {
    let run = run.drawing();
    compensate(program, &run).map(|done| run.page(PathKind::Compensate, done.drawn(), None))
}

/// The page that `deflex predict --html` writes. The program is run anew, as in [`compensate_page`].
///
/// # Errors
/// Those of [`predict`].
///
/// # Examples
/// ```
/// # let (program, run) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/run.rs"));
/// let page = deflex::session::predict_page(&program, None, &run)?;
/// assert!(page.starts_with("<!DOCTYPE html>"));
/// # Ok::<(), deflex::text::Diagnostics>(())
/// ```
pub fn predict_page(
    program: &ProgramFiles,
    against: Option<&ProgramFiles>,
    run: &Run,
) -> Result<String, Vec<Diagnostic>> {
    let run = run.drawing();
    predict(program, against, &run).map(|done| run.page(PathKind::Predict, done.drawn(), None))
}

/// The numbers of the report of [`compensate`] without rounding. The program is run anew.
///
/// # Errors
/// Those of [`compensate`].
///
/// # Examples
/// ```
/// # let (program, run) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/run.rs"));
/// let columns = deflex::session::compensate_unrounded(&program, &run)?.columns();
/// let (_, errors_mm) = columns.iter().find(|(name, _)| *name == "error_mm").expect("a column of the report");
/// assert!(errors_mm.iter().all(|mm| *mm > 0.0));
/// # Ok::<(), deflex::text::Diagnostics>(())
/// ```
pub fn compensate_unrounded(program: &ProgramFiles, run: &Run) -> Result<Unrounded, Vec<Diagnostic>> {
    let run = Run { keeps_numbers: true, ..run.clone() };
    compensate(program, &run).map(|done| done.numbers.unwrap_or_default())
}

/// The numbers of the report of [`predict`] without rounding. The program is run anew.
///
/// # Errors
/// Those of [`predict`].
///
/// # Examples
/// ```
/// # let (program, run) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/run.rs"));
/// let columns = deflex::session::predict_unrounded(&program, None, &run)?.columns();
/// assert!(columns.iter().any(|(name, _)| *name == "remaining_mm"));
/// # Ok::<(), deflex::text::Diagnostics>(())
/// ```
pub fn predict_unrounded(
    program: &ProgramFiles,
    against: Option<&ProgramFiles>,
    run: &Run,
) -> Result<Unrounded, Vec<Diagnostic>> {
    let run = Run { keeps_numbers: true, ..run.clone() };
    predict(program, against, &run).map(|done| done.numbers.unwrap_or_default())
}

/// Corrects a program, as `deflex compensate` does.
///
/// # Errors
/// Every error for which the command ends with exit code 2, and `run.called-off` after a cancellation.
///
/// # Examples
/// ```
/// use deflex::session::{CellFile, ProgramFiles, Run, compensate};
/// use std::sync::Arc;
///
/// let cell = Arc::new(CellFile::read("samples/slot/cell.toml".as_ref())?);
/// let program = ProgramFiles::read(&["samples/slot/slot.mod".into()], &[], None)?;
/// let done = compensate(&program, &Run::new(cell))?;
/// let (name, bytes) = &done.files[0];
/// assert_eq!(name.to_str(), Some("slot.mod"));
/// assert!(bytes.starts_with(b"%%%") && done.summary.counts.max_remaining_mm < 1e-3);
/// # Ok::<(), deflex::text::Diagnostics>(())
/// ```
pub fn compensate(program: &ProgramFiles, run: &Run) -> Result<Done, Vec<Diagnostic>> {
    program.marked()?;
    // CL data in other languages than RAPID are posted as a whole.
    let posts = run.post.as_ref().is_none_or(|post| post.language == Language::Rapid);
    // The driven path can be corrected only with the whole program in memory.
    let streams = posts && run.max_path_error.is_none();
    let done = match Long::of(program, run).filter(|_| streams) {
        Some(long) => long.compensate()?,
        None => None,
    };
    let done = done.map_or_else(|| compensate_whole(program, run), Ok);
    with_notes(done, program, run)
}

/// Predicts the errors of a program without correcting it, as `deflex predict` does. `against` is the original of a
/// corrected program; errors are then counted from its targets.
///
/// # Errors
/// Every error for which the command ends with exit code 2, and `run.called-off` after a cancellation.
///
/// # Examples
/// ```
/// use deflex::session::{CellFile, ProgramFiles, Run, predict};
/// use std::sync::Arc;
///
/// let cell = Arc::new(CellFile::read("samples/slot/cell.toml".as_ref())?);
/// let program = ProgramFiles::read(&["samples/slot/slot.mod".into()], &[], None)?;
/// let done = predict(&program, None, &Run::new(cell))?;
/// assert!(done.summary.counts.max_error_mm > 0.1);
/// # Ok::<(), deflex::text::Diagnostics>(())
/// ```
pub fn predict(program: &ProgramFiles, against: Option<&ProgramFiles>, run: &Run) -> Result<Done, Vec<Diagnostic>> {
    program.marked()?;
    let done = match Long::of(program, run) {
        Some(long) => long.predict(against)?,
        None => None,
    };
    let done = done.map_or_else(|| predict_whole(program, against, run), Ok);
    with_notes(done, program, run)
}

/// The path that the controller drives and the loaded arm takes, as `deflex predict --path` samples it.
///
/// # Errors
/// Every error for which the command ends with exit code 2.
///
/// # Examples
/// ```
/// use deflex::session::{Run, driven_path};
/// # let (program, run): (_, Run) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/run.rs"));
/// let path = driven_path(&program, &run)?;
/// assert!(path.samples.len() > 100 && path.notes.iter().all(|note| note.severity != deflex::text::Severity::Error));
/// # Ok::<(), deflex::text::Diagnostics>(())
/// ```
pub fn driven_path(program: &ProgramFiles, run: &Run) -> Result<LoadedPath, Vec<Diagnostic>> {
    run.setup.driven_path(&run.parse(program)?)
}

/// Reads a table or another file as the commands do; `-` is stdin.
///
/// # Errors
/// The file cannot be read, or is too long.
///
/// # Examples
/// ```
/// let table = deflex::session::read_file("samples/closed-loop/measured.csv".as_ref())?;
/// assert!(table.bytes.starts_with(b"target,"));
/// # Ok::<(), deflex::text::Diagnostics>(())
/// ```
pub fn read_file(path: &Path) -> Result<Source, Vec<Diagnostic>> {
    read::source(path)
}

/// Adds the notes of the run and the hashes of the program's files.
fn with_notes(done: Result<Done, Vec<Diagnostic>>, program: &ProgramFiles, run: &Run) -> Result<Done, Vec<Diagnostic>> {
    let mut done = done.map_err(|errors| run.setup.failed(run.setup.cell.own(errors)))?;
    done.notes.splice(0..0, run.setup.notes());
    done.notes = run.setup.cell.own(done.notes);
    done.summary.sources = program.origins();
    Ok(done)
}

/// Collects what the run reports about the rows of a program that is corrected.
fn noticed<'a>(program: &ProgramFiles, run: &'a Run) -> Noticed<'a> {
    let files = program.sources().into_iter().map(|source| Path::new(&source.name));
    Noticed::new(run.setup.options.forces.as_ref(), (!run.again).then(|| Again::in_folders_of(files)))
}

fn compensate_whole(program: &ProgramFiles, run: &Run) -> Result<Done, Vec<Diagnostic>> {
    let noticed = noticed(program, run);
    let parsed = run.parse(program)?;
    let cell = &run.setup.cell.cell;
    let Edited { shaped, corrected } = Edited::new(&parsed, cell, &run.options_followed(program), run.max_path_error)?;
    let names = program.names();
    let post = || run.post.clone().unwrap_or_else(|| Run::posted_from(&names[0]));
    let Written { files, notes } = written(shaped.as_ref().unwrap_or(&parsed), &corrected, cell, names, post)?;
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
    let done = Finished::new(name, program, corrected, run.path(kind), noticed)?;
    let mut csv = Vec::new();
    // Writing to a Vec cannot fail.
    let _ = write_joined(std::slice::from_ref(&done.rows), &mut csv);
    if let Some(follow) = &run.follow {
        follow(targets, program.sources.iter().map(|source| source.bytes.len() as u64).sum());
    }
    Ok(Done { files: Vec::new(), csv, summary: done.summary, notes: done.notes, path: done.path, numbers })
}
