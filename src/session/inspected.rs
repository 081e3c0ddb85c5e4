use crate::session::context::Context;
use crate::session::input;
use crate::session::job::{Job, belongs_to_another};
use crate::session::read::all;
use crate::session::report::pretty;
use deflex::program::{Language, detect, round_trip};
use deflex::report::{InspectFile, InspectFiles, inspect_table};
use deflex::text::Diagnostic;
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Ending of lists of modules, which are looked for in a folder in addition to the endings of the languages.
const LISTS: &str = "pgf";
/// Endings that other kinds of files have too, so the content of the file decides.
const SHARED: [&str; 2] = ["txt", "dat"];

/// What deflex understands of files. A refused file is a result, too.
///
/// # Examples
/// ```
/// use deflex::session::inspect;
///
/// let found = inspect(&["samples/slot/slot.mod".into()], &[], None, &|_, _| ())?;
/// assert_eq!(found.files[0].motion_targets, 81);
/// assert!(found.text().contains("slot.mod") && found.json()?.contains("round_trip"));
/// found.understood()?;
/// # Ok::<(), deflex::text::Diagnostics>(())
/// ```
#[derive(Debug)]
#[non_exhaustive]
pub struct Inspected {
    /// The files in their order.
    pub files: Vec<InspectFile>,
    /// Why each file is refused; empty if it is not.
    refusals: Vec<Vec<Diagnostic>>,
}

impl Inspected {
    /// An error if all files are refused.
    ///
    /// # Errors
    /// The reasons of all files.
    pub fn understood(&self) -> Result<(), Vec<Diagnostic>> {
        let none = !self.files.is_empty() && self.refusals.iter().all(|refusal| !refusal.is_empty());
        if none { Err(self.refusals.concat()) } else { Ok(()) }
    }

    /// The table that the command prints.
    #[must_use]
    pub fn text(&self) -> String {
        inspect_table(&self.files)
    }

    /// The text that `--json` writes.
    ///
    /// # Errors
    /// It cannot be written as JSON.
    pub fn json(&self) -> Result<String, Vec<Diagnostic>> {
        pretty(&InspectFiles { files: &self.files })
    }
}

/// The programs that `deflex inspect` finds: files as they are given, and the programs in folders and their subfolders, by path.
///
/// # Errors
/// A folder cannot be read, or there is no program.
///
/// # Examples
/// ```
/// let found = deflex::session::programs_in(&["samples/slot".into()])?;
/// assert!(found.contains(&"samples/slot/slot.mod".into()));
/// # Ok::<(), deflex::text::Diagnostics>(())
/// ```
pub fn programs_in(paths: &[PathBuf]) -> Result<Vec<PathBuf>, Vec<Diagnostic>> {
    let found: Vec<PathBuf> = all(paths.iter().map(|path| programs(path)))?.into_iter().flatten().collect();
    if !found.is_empty() {
        return Ok(found);
    }
    let folders: Vec<String> = paths.iter().map(|path| path.display().to_string()).collect();
    let message = format!("there is no program in {}", folders.join(", "));
    let help = "programs are recognised by their endings; give a file with another ending by its name";
    Err(Diagnostic::error("program.none", "", message).help(help).into())
}

/// Inspects files, as `deflex inspect` does. `context` are modules that declare names; `format` states the language of files that do not
/// show it. `progress` receives each file as its turn comes, and how many files are done.
///
/// # Errors
/// A file cannot be read. That a file is refused is no error.
///
/// # Examples
/// ```
/// use deflex::session::inspect;
///
/// let found = inspect(&["samples/slot/cell.toml".into()], &[], None, &|_, _| ())?;
/// assert!(found.files[0].refused.is_some() && found.understood().is_err());
/// # Ok::<(), deflex::text::Diagnostics>(())
/// ```
pub fn inspect(
    files: &[PathBuf],
    context: &[PathBuf],
    format: Option<Language>,
    progress: &(dyn Fn(&Path, usize) + Sync),
) -> Result<Inspected, Vec<Diagnostic>> {
    let context = Context::read(context)?;
    let done = AtomicUsize::new(0);
    let one = |path: &PathBuf| {
        progress(path, done.load(Ordering::Relaxed));
        let file = one(path, format, &context);
        done.fetch_add(1, Ordering::Relaxed);
        file
    };
    let inspected: Vec<_> = files.par_iter().map(one).collect();
    let (files, refusals) = all(inspected)?.into_iter().unzip();
    Ok(Inspected { files, refusals })
}

/// The path itself if it is a file, else the programs in the folder and its subfolders, sorted by path.
fn programs(path: &Path) -> Result<Vec<PathBuf>, Vec<Diagnostic>> {
    if !path.is_dir() {
        return Ok(vec![path.to_owned()]);
    }
    let failed = |error: std::io::Error| {
        Diagnostic::error("io.read", &path.display().to_string(), format!("the file cannot be read: {error}"))
    };
    let mut found = Vec::new();
    for entry in std::fs::read_dir(path).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        let (path, kind) = (entry.path(), entry.file_type().map_err(failed)?);
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase());
        if kind.is_dir() {
            found.extend(programs(&path)?);
        } else if ending.is_some_and(|ending| is_program(&path, &ending)) {
            found.push(path);
        }
    }
    found.sort();
    Ok(found)
}

fn is_program(path: &Path, ending: &str) -> bool {
    let own = ending == LISTS || Language::ALL.iter().any(|language| language.endings().contains(&ending));
    own || SHARED.contains(&ending) && !belongs_to_another(path) && has_program(path)
}

/// Whether the content of a text file is a program.
fn has_program(path: &Path) -> bool {
    std::fs::read(path).is_ok_and(|bytes| detect("", &bytes).is_some())
}

/// The result for one file. A refused program is a result; a file that cannot be opened is an error.
fn one(
    path: &Path,
    format: Option<Language>,
    context: &Context,
) -> Result<(InspectFile, Vec<Diagnostic>), Vec<Diagnostic>> {
    let refused = |language: Option<Language>, errors: Vec<Diagnostic>| {
        let path = path.display().to_string();
        (InspectFile::refused(&path, language, &errors), errors)
    };
    let job = match Job::of(path, format) {
        Ok(job) => job,
        Err(errors) if errors.iter().any(|error| error.code == "io.read") => return Err(errors),
        Err(errors) => return Ok(refused(None, errors)),
    };
    let (name, language) = (job.name.clone(), job.language);
    Ok(match input::program_alone(job, context) {
        Ok(program) => {
            let proof = round_trip(&program, |written, context| input::reread(language, written, context));
            (InspectFile::read(&name, &program, &proof), Vec::new())
        }
        Err(errors) => refused(Some(language), errors),
    })
}
