//! Detects inputs that change during a run. A program is read several times and must have the same bytes each time.

use super::marker;
use super::warn;
use crate::session::file_state::{FileState, Identity};
use deflex::report::Origin;
use deflex::text::{Diagnostic, Severity};
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, SystemTime};

/// State of a file when the run first opened it.
#[derive(Debug)]
struct Watched {
    identity: Identity,
    state: FileState,
    /// Hash of the content, if the file was written so recently that a later write could have the same time stamp.
    hash: Option<String>,
}

/// Files changed longer ago than this are compared by their time stamps alone. Local systems count the time in ticks of
/// up to 10 ms, some network drives in seconds.
const TICK: Duration = Duration::from_millis(50);

/// The files that this run has opened.
#[derive(Debug)]
struct All {
    files: BTreeMap<PathBuf, Watched>,
    /// For each folder, the outputs that killed runs left unfinished in it, each with its marker file.
    unfinished: BTreeMap<PathBuf, Vec<(PathBuf, String)>>,
}

/// `None` while no command runs: texts that a caller of the library holds in memory are not watched.
static WATCHED: Mutex<Option<All>> = Mutex::new(None);

fn watched() -> MutexGuard<'static, Option<All>> {
    // A panic cannot leave an entry half-written, so a poisoned lock is still usable.
    WATCHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Watches all files that are opened from now on.
pub(crate) fn start() {
    *watched() = Some(All { files: BTreeMap::new(), unfinished: BTreeMap::new() });
}

/// Records the state of a file before it is read. Pipes and devices can be read only once, and are not watched.
pub(crate) fn watch(path: &Path) {
    let Ok(metadata) = fs::metadata(path) else { return };
    if !metadata.is_file() || watched().as_ref().is_none_or(|all| all.files.contains_key(path)) {
        return;
    }
    warn(unfinished(path).as_slice());
    let fresh = |modified: SystemTime| modified.elapsed().map_or(true, |age| age < TICK);
    let hash = metadata.modified().map_or(true, fresh).then(|| hash(path).ok()).flatten();
    let entry = Watched { identity: Identity::of(path), state: FileState::of(&metadata), hash };
    if let Some(all) = watched().as_mut() {
        all.files.insert(path.to_owned(), entry);
    }
}

/// The input of this run that is the same file as `identity`, also under another name.
pub(super) fn input_that_is(identity: &Identity) -> Option<PathBuf> {
    let watched = watched();
    let mut files = watched.iter().flat_map(|all| &all.files);
    files.find(|(_, file)| file.identity == *identity).map(|(input, _)| input.clone())
}

/// A warning if the file belongs to a set of outputs that a killed run left unfinished.
fn unfinished(path: &Path) -> Option<Diagnostic> {
    let target = fs::canonicalize(path).ok()?;
    let folder = target.parent()?.to_owned();
    let mut all = watched();
    let files = all.as_mut()?.unfinished.entry(folder).or_insert_with_key(|folder| marker::unfinished(folder));
    let (_, marker) = files.iter().find(|(file, _)| *file == target)?;
    let message = format!("is one of several outputs that a killed run left unfinished ({marker})");
    let help = "repeat the run that wrote it: its files come from two different runs";
    let file = path.display().to_string();
    Some(Diagnostic::error("io.unfinished", &file, message).severity(Severity::Warning).help(help))
}

/// An error for each input that has changed since it was first opened.
pub(super) fn changed() -> Result<(), Vec<Diagnostic>> {
    let same = |(path, before): (&PathBuf, &Watched)| {
        let now = fs::metadata(path).ok().map(|metadata| FileState::of(&metadata));
        now == Some(before.state) && before.hash.as_ref().is_none_or(|before| hash(path).ok().as_ref() == Some(before))
    };
    let watched = watched();
    let errors: Vec<Diagnostic> = watched
        .iter()
        .flat_map(|all| &all.files)
        .filter(|entry| !same(*entry))
        .map(|(path, _)| changed_error(path))
        .collect();
    if errors.is_empty() { Ok(()) } else { Err(errors) }
}

fn changed_error(path: &Path) -> Diagnostic {
    let message = "changed while it was read: nothing is written";
    Diagnostic::error("io.changed", &path.display().to_string(), message)
        .help("run again when no other program writes to it")
}

fn hash(path: &Path) -> io::Result<String> {
    Origin::read("", File::open(path)?).map(|origin| origin.sha256)
}
