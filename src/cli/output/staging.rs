//! Where outputs wait until all of them are there: hidden files beside their targets, held by the run that made them.

use super::{lock, marker};
use std::fs::{self, File, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// A folder that this run stages into.
#[derive(Debug)]
struct Staging {
    folder: PathBuf,
    /// Held for as long as this run lives.
    _lock: File,
    files: Vec<PathBuf>,
    /// Of the next file.
    number: usize,
}

static STAGING: Mutex<Vec<Staging>> = Mutex::new(Vec::new());

fn staging() -> MutexGuard<'static, Vec<Staging>> {
    // A list of paths is whole even where a thread died holding it.
    STAGING.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Makes a file beside what belongs into a folder.
pub(super) fn create(folder: &Path) -> io::Result<(PathBuf, File)> {
    // Kept while the file is made: an interruption finds every file that there is.
    let mut all = staging();
    let path = next(&mut all, folder)?;
    let file = OpenOptions::new().read(true).write(true).create_new(true).open(&path)?;
    Ok((path, file))
}

/// A name for such a file.
pub(super) fn reserve(folder: &Path) -> io::Result<PathBuf> {
    next(&mut staging(), folder)
}

fn next(all: &mut Vec<Staging>, folder: &Path) -> io::Result<PathBuf> {
    let at = match all.iter().position(|staging| staging.folder == folder) {
        Some(at) => at,
        None => {
            all.push(Staging::new(folder)?);
            all.len() - 1
        }
    };
    let staging = &mut all[at];
    let path = lock::waiting(folder, staging.number);
    staging.number += 1;
    staging.files.push(path.clone());
    Ok(path)
}

/// A file that has another name now, or is gone.
pub(super) fn forget(path: &Path) {
    for staging in staging().iter_mut() {
        staging.files.retain(|file| file != path);
    }
}

/// Removes what waits in a folder, which may be removed itself then.
pub(super) fn leave(folder: &Path) {
    let mut all = staging();
    if let Some(at) = all.iter().position(|staging| staging.folder == folder) {
        all.swap_remove(at).remove();
    }
}

/// Removes all that waits.
pub(super) fn leave_all() {
    staging().drain(..).for_each(Staging::remove);
}

/// The same at the end of the process, whose other threads make nothing more.
pub(super) fn leave_for_good() {
    let mut all = staging();
    all.drain(..).for_each(Staging::remove);
    std::mem::forget(all);
}

impl Staging {
    fn new(folder: &Path) -> io::Result<Self> {
        // Whoever removes what killed runs left must not take a lock that is not held yet for theirs.
        let alone = lock::take_turn(folder);
        if alone.is_some() {
            sweep(folder);
        }
        let path = lock::of(folder, lock::run_id());
        let held = OpenOptions::new().write(true).create(true).truncate(false).open(&path)?;
        // Not every file system has locks: what a killed run leaves there stays.
        let _ = held.lock();
        drop(alone);
        Ok(Self { folder: folder.to_owned(), _lock: held, files: Vec::new(), number: 0 })
    }

    fn remove(self) {
        // Nothing more can be done about a temporary file that will not go.
        self.files.iter().for_each(|file| drop(fs::remove_file(file)));
        let _ = fs::remove_file(lock::of(&self.folder, lock::run_id()));
    }
}

/// Finishes the sets and removes the files of runs that were killed. The folder's lock is held.
fn sweep(folder: &Path) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    let mut names: Vec<String> = entries.flatten().filter_map(|entry| entry.file_name().into_string().ok()).collect();
    names.sort();
    for id in names.iter().filter_map(|name| marker::id_of(name)) {
        if !lock::is_held(folder, id) {
            marker::recover(folder, id);
        }
    }
    let unfinished: Vec<&str> = names.iter().filter_map(|name| marker::id_of(name)).collect();
    for (name, id) in names.iter().filter_map(|name| Some((name, lock::owner(name)?))) {
        // What belongs to a set that could not be finished is its only copy.
        let needed = unfinished.contains(&id) && marker::exists(folder, id);
        if !lock::is_held(folder, id) && !needed && !lock::is_lock(name) {
            let _ = fs::remove_file(folder.join(name));
        }
    }
    for (name, id) in names.iter().filter_map(|name| Some((name, lock::owner(name)?))) {
        if lock::is_lock(name) && !lock::is_held(folder, id) {
            let _ = fs::remove_file(folder.join(name));
        }
    }
}
