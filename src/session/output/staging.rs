//! Temporary files in which outputs wait until all of them are complete. They are hidden files in the folders of their
//! targets.

use super::{lock, marker};
use std::fs::{self, File, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// A folder into which this run writes temporary files.
#[derive(Debug)]
struct Staging {
    folder: PathBuf,
    /// Lock that is held until the run ends.
    _lock: File,
    files: Vec<PathBuf>,
    /// Number of the next file.
    number: usize,
}

/// All folders into which this run writes temporary files, and the ID of the run.
#[derive(Debug)]
struct All {
    /// Empty if there are no temporary files: the next run in this process gets a new ID.
    id: String,
    folders: Vec<Staging>,
}

static STAGING: Mutex<All> = Mutex::new(All { id: String::new(), folders: Vec::new() });

fn staging() -> MutexGuard<'static, All> {
    // A panic cannot leave the list half-changed, so a poisoned lock is still usable.
    STAGING.lock().unwrap_or_else(PoisonError::into_inner)
}

/// ID of this run.
pub(super) fn id() -> String {
    staging().id.clone()
}

/// Creates a temporary file in a folder.
pub(super) fn create(folder: &Path) -> io::Result<(PathBuf, File)> {
    // Stays locked until the file exists, so that an interruption finds every file in the list.
    let mut all = staging();
    let path = next(&mut all, folder)?;
    let file = OpenOptions::new().read(true).write(true).create_new(true).open(&path)?;
    Ok((path, file))
}

/// Reserves the path of a temporary file in a folder.
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

/// Removes a file from the list, because it was renamed or removed.
pub(super) fn forget(path: &Path) {
    for staging in &mut staging().folders {
        staging.files.retain(|file| file != path);
    }
}

/// Removes the temporary files in a folder, so that the folder itself can be removed.
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

/// Removes all temporary files of the run.
pub(super) fn leave_all() {
    staging().leave();
}

/// Removes all temporary files at the end of the process. The lock is never released, so that other threads cannot
/// create further ones.
pub(super) fn leave_for_good() {
    let mut all = staging();
    all.leave();
    std::mem::forget(all);
}

impl Staging {
    fn new(folder: &Path, id: &str) -> io::Result<Self> {
        // Waits for its turn, so that a run that removes files of killed runs does not find a lock file whose lock is
        // not held yet.
        let alone = lock::take_turn(folder);
        let held = OpenOptions::new().write(true).create_new(true).open(lock::of(folder, id))?;
        // On file systems without locks, the files of killed runs stay.
        let _ = held.lock();
        if alone.is_some() {
            sweep(folder, marker::owner(&held.metadata()?));
        }
        drop(alone);
        Ok(Self { folder: folder.to_owned(), _lock: held, files: Vec::new(), number: 0 })
    }

    fn remove(self, id: &str) {
        // If a temporary file cannot be removed, nothing else can be done.
        self.files.iter().for_each(|file| drop(fs::remove_file(file)));
        let _ = fs::remove_file(lock::of(&self.folder, id));
    }
}

/// Finishes the sets of killed runs of a user, and removes their temporary files. The caller holds the folder's lock.
fn sweep(folder: &Path, user: u32) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    let mut names: Vec<String> = entries.flatten().filter_map(|entry| entry.file_name().into_string().ok()).collect();
    names.sort();
    for id in names.iter().filter_map(|name| marker::id_of(name)) {
        if !lock::is_held(folder, id) {
            marker::recover(folder, id, user);
        }
    }
    // Whether the files of an ID can be removed: a run of this user was killed, and left no marker. With a marker, the
    // set could not be finished, and these files are the only copy of its outputs.
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
