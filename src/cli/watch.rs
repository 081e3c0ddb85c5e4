//! Inputs that change while they are read: a program is read several times over, and must be the same each time.

use super::file_state::{FileState, Identity};
use super::message;
use super::output::marker;
use deflex::report::Origin;
use deflex::text::{Diagnostic, Severity};
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, SystemTime};

/// A file as it was when it was first opened.
#[derive(Debug)]
struct Watched {
    identity: Identity,
    state: FileState,
    /// Hash of the content, for files that were written so recently that a later write may have the same time.
    hash: Option<String>,
}

/// Systems count times of files in ticks of up to 10 ms, some network drives in seconds.
const TICK: Duration = Duration::from_millis(50);

/// All that was opened.
#[derive(Debug)]
struct All {
    files: BTreeMap<PathBuf, Watched>,
    /// By folder, what killed runs left unfinished there.
    unfinished: BTreeMap<PathBuf, Vec<(PathBuf, String)>>,
}

/// `None` where no run of the command goes on: what a caller of the library holds in memory is not watched.
static WATCHED: Mutex<Option<All>> = Mutex::new(None);

fn watched() -> MutexGuard<'static, Option<All>> {
    // Entries are put in whole.
    WATCHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Watches what is opened from here on.
pub(super) fn start() {
    *watched() = Some(All { files: BTreeMap::new(), unfinished: BTreeMap::new() });
}

/// Remembers a file before it is read; what is no regular file (a pipe, a device) can be read once only, and is not watched.
pub(super) fn watch(path: &Path) {
    let Ok(metadata) = fs::metadata(path) else { return };
    if !metadata.is_file() || watched().as_ref().is_none_or(|all| all.files.contains_key(path)) {
        return;
    }
    message::print(unfinished(path).as_slice(), false);
    let fresh = |modified: SystemTime| modified.elapsed().map_or(true, |age| age < TICK);
    let hash = metadata.modified().map_or(true, fresh).then(|| hash(path).ok()).flatten();
    let entry = Watched { identity: Identity::of(path), state: FileState::of(&metadata), hash };
    if let Some(all) = watched().as_mut() {
        all.files.insert(path.to_owned(), entry);
    }
}

/// The input of this run that a file is.
pub(super) fn input_that_is(identity: &Identity) -> Option<PathBuf> {
    let watched = watched();
    let mut files = watched.iter().flat_map(|all| &all.files);
    files.find(|(_, file)| file.identity == *identity).map(|(input, _)| input.clone())
}

/// A warning for a file that belongs to a set which is unfinished.
fn unfinished(path: &Path) -> Option<Diagnostic> {
    let target = fs::canonicalize(path).ok()?;
    let folder = target.parent()?.to_owned();
    let mut all = watched();
    let files = all.as_mut()?.unfinished.entry(folder).or_insert_with_key(|folder| marker::unfinished(folder));
    let (_, marker) = files.iter().find(|(file, _)| *file == target)?;
    let message = format!("is one of several outputs that a killed run left unfinished ({marker})");
    let help = "run again what wrote it: its files are not of one run";
    let file = path.display().to_string();
    Some(Diagnostic::error("io.unfinished", &file, message).severity(Severity::Warning).help(help))
}

/// One message for each file that is not as it was.
pub(super) fn changed() -> Result<(), Vec<Diagnostic>> {
    let same = |(path, before): (&PathBuf, &Watched)| {
        let now = fs::metadata(path).ok().map(|metadata| FileState::of(&metadata));
        now == Some(before.state) && before.hash.as_ref().is_none_or(|before| hash(path).ok().as_ref() == Some(before))
    };
    let watched = watched();
    let errors: Vec<Diagnostic> =
        watched.iter().flat_map(|all| &all.files).filter(|entry| !same(*entry)).map(|(path, _)| told(path)).collect();
    if errors.is_empty() { Ok(()) } else { Err(errors) }
}

fn told(path: &Path) -> Diagnostic {
    let message = "changed while it was read: nothing is written";
    Diagnostic::error("io.changed", &path.display().to_string(), message)
        .help("run again when no other program writes to it")
}

fn hash(path: &Path) -> io::Result<String> {
    Origin::read("", File::open(path)?).map(|origin| origin.sha256)
}
