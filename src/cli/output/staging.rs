//! Where outputs wait until all of them are there: hidden files beside their targets, held by the run that made them.
//!
//! In every folder that it stages into, a run holds a lock on a file of its own (`.deflex-ID.lock`, its files are
//! `.deflex-ID-N.tmp`). The system lets go of the lock when the run ends in whatever way, so that what a killed run left
//! is known by it, and removed by the next one that writes there.

use super::set;
use std::fs::{self, File, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, SystemTime};

const PREFIX: &str = ".deflex-";
const LOCK: &str = ".lock";
const FILE: &str = ".tmp";

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

/// Names this run among all that write to the same folders, on whatever machine.
pub(super) fn run_id() -> &'static str {
    static ID: OnceLock<String> = OnceLock::new();
    ID.get_or_init(|| {
        let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        format!("{:x}-{:x}", std::process::id(), now.as_nanos() & 0xffff_ffff_ffff)
    })
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
    let path = folder.join(format!("{PREFIX}{}-{}{FILE}", run_id(), staging.number));
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
        let alone = take_turn(folder);
        if alone.is_some() {
            sweep(folder);
        }
        let path = folder.join(format!("{PREFIX}{}{LOCK}", run_id()));
        let lock = OpenOptions::new().write(true).create(true).truncate(false).open(&path)?;
        // Not every file system has locks: what a killed run leaves there stays.
        let _ = lock.lock();
        drop(alone);
        Ok(Self { folder: folder.to_owned(), _lock: lock, files: Vec::new(), number: 0 })
    }

    fn remove(self) {
        // Nothing more can be done about a temporary file that will not go.
        self.files.iter().for_each(|file| drop(fs::remove_file(file)));
        let _ = fs::remove_file(self.folder.join(format!("{PREFIX}{}{LOCK}", run_id())));
    }
}

/// Waits until no other run puts outputs into a folder, and keeps others from doing so; `None` where folders have no locks.
pub(super) fn lock_folder(folder: &Path) -> Option<File> {
    let folder = File::open(folder).ok()?;
    folder.lock().ok().map(|()| folder)
}

/// The same, but no longer than another run takes to put its outputs there: whoever holds a lock on the system's folder for
/// temporary files for longer is none of ours.
fn take_turn(folder: &Path) -> Option<File> {
    const TRIES: u32 = 100;
    (0..TRIES).find_map(|_| {
        try_lock_folder(folder).or_else(|| {
            std::thread::sleep(Duration::from_millis(10));
            None
        })
    })
}

/// The same without waiting.
pub(super) fn try_lock_folder(folder: &Path) -> Option<File> {
    let folder = File::open(folder).ok()?;
    folder.try_lock().ok().map(|()| folder)
}

/// Finishes the sets and removes the files of runs that were killed. The folder's lock is held.
fn sweep(folder: &Path) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    let mut names: Vec<String> = entries.flatten().filter_map(|entry| entry.file_name().into_string().ok()).collect();
    names.sort();
    for id in names.iter().filter_map(|name| set::id_of(name)) {
        if !alive(folder, id) {
            set::recover(folder, id);
        }
    }
    let unfinished: Vec<&str> = names.iter().filter_map(|name| set::id_of(name)).collect();
    for (name, id) in names.iter().filter_map(|name| Some((name, owner(name)?))) {
        // What belongs to a set that could not be finished is its only copy.
        let needed = unfinished.contains(&id) && set::exists(folder, id);
        if !alive(folder, id) && !needed && !name.ends_with(LOCK) {
            let _ = fs::remove_file(folder.join(name));
        }
    }
    for (name, id) in names.iter().filter_map(|name| Some((name, owner(name)?))) {
        if name.ends_with(LOCK) && !alive(folder, id) {
            let _ = fs::remove_file(folder.join(name));
        }
    }
}

/// The run that a hidden file belongs to.
fn owner(name: &str) -> Option<&str> {
    let rest = name.strip_prefix(PREFIX)?;
    match rest.strip_suffix(LOCK) {
        Some(id) => Some(id),
        None => rest.strip_suffix(FILE)?.rsplit_once('-').map(|(id, _)| id),
    }
}

/// Whether the run still holds its lock.
fn alive(folder: &Path, id: &str) -> bool {
    if id == run_id() {
        return true;
    }
    match File::open(folder.join(format!("{PREFIX}{id}{LOCK}"))) {
        Ok(lock) => lock.try_lock().is_err(),
        Err(error) => error.kind() != io::ErrorKind::NotFound,
    }
}

#[cfg(test)]
mod tests {
    use super::owner;

    #[test]
    fn only_our_own_names_have_an_owner() {
        assert_eq!(owner(".deflex-1f-2a.lock"), Some("1f-2a"));
        assert_eq!(owner(".deflex-1f-2a-17.tmp"), Some("1f-2a"));
        for name in ["deflex-1f-2a.lock", ".deflex-1f", ".part.mod.swp", "x.tmp", ".deflex.tmp"] {
            assert_eq!(owner(name), None, "{name}");
        }
    }
}
