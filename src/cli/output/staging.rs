//! Where outputs wait until all of them are there: hidden files in the folders of their targets, held by the run that made them.

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

/// All folders that this run stages into, under one ID.
#[derive(Debug)]
struct All {
    /// Empty where nothing is staged: the next run in this process gets another.
    id: String,
    folders: Vec<Staging>,
}

static STAGING: Mutex<All> = Mutex::new(All { id: String::new(), folders: Vec::new() });

fn staging() -> MutexGuard<'static, All> {
    // A list of paths is whole even where a thread died holding it.
    STAGING.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Names this run.
pub(super) fn id() -> String {
    staging().id.clone()
}

/// Makes a file in a folder.
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

fn next(all: &mut All, folder: &Path) -> io::Result<PathBuf> {
    if all.id.is_empty() {
        all.id = lock::new_id()?;
    }
    let at = match all.folders.iter().position(|staging| staging.folder == folder) {
        Some(at) => at,
        None => {
            all.folders.push(Staging::new(folder, &all.id)?);
            all.folders.len() - 1
        }
    };
    let staging = &mut all.folders[at];
    let path = lock::waiting(folder, &all.id, staging.number);
    staging.number += 1;
    staging.files.push(path.clone());
    Ok(path)
}

/// A file that has another name now, or is gone.
pub(super) fn forget(path: &Path) {
    for staging in &mut staging().folders {
        staging.files.retain(|file| file != path);
    }
}

/// Removes what waits in a folder, which may be removed itself then.
pub(super) fn leave(folder: &Path) {
    let mut all = staging();
    if let Some(at) = all.folders.iter().position(|staging| staging.folder == folder) {
        let id = all.id.clone();
        all.folders.swap_remove(at).remove(&id);
    }
}

impl All {
    fn leave(&mut self) {
        let id = std::mem::take(&mut self.id);
        self.folders.drain(..).for_each(|staging| staging.remove(&id));
    }
}

/// Removes all that waits.
pub(super) fn leave_all() {
    staging().leave();
}

/// The same at the end of the process, whose other threads make nothing more.
pub(super) fn leave_for_good() {
    let mut all = staging();
    all.leave();
    std::mem::forget(all);
}

impl Staging {
    fn new(folder: &Path, id: &str) -> io::Result<Self> {
        // A run that removes what killed runs left must not mistake a lock that is not held yet for one of those.
        let alone = lock::take_turn(folder);
        let held = OpenOptions::new().write(true).create_new(true).open(lock::of(folder, id))?;
        // Not every file system has locks: what a killed run leaves there stays.
        let _ = held.lock();
        if alone.is_some() {
            sweep(folder, marker::owner(&held.metadata()?));
        }
        drop(alone);
        Ok(Self { folder: folder.to_owned(), _lock: held, files: Vec::new(), number: 0 })
    }

    fn remove(self, id: &str) {
        // Nothing more can be done about a temporary file that will not go.
        self.files.iter().for_each(|file| drop(fs::remove_file(file)));
        let _ = fs::remove_file(lock::of(&self.folder, id));
    }
}

/// Finishes the sets and removes the files of runs of a user that were killed. The folder's lock is held.
fn sweep(folder: &Path, user: u32) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    let mut names: Vec<String> = entries.flatten().filter_map(|entry| entry.file_name().into_string().ok()).collect();
    names.sort();
    for id in names.iter().filter_map(|name| marker::id_of(name)) {
        if !lock::is_held(folder, id) {
            marker::recover(folder, id, user);
        }
    }
    // Of a run that held a lock here once; what belongs to a set that could not be finished is its only copy.
    let left = |id: &str| {
        marker::is_file_of(&lock::of(folder, id), user) && !lock::is_held(folder, id) && !marker::exists(folder, id)
    };
    let (locks, files): (Vec<&String>, Vec<&String>) = names.iter().partition(|name| lock::is_lock(name));
    for name in files.into_iter().chain(locks) {
        let path = folder.join(name);
        if lock::owner(name).is_some_and(left) && marker::is_file_of(&path, user) {
            let _ = fs::remove_file(path);
        }
    }
}
