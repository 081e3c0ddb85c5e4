//! Locks on folders, and the names of the temporary files of a run.
//!
//! In every folder into which it stages files, a run holds a lock on a file of its own, `.deflex-ID.lock`. Its
//! temporary files are `.deflex-ID-N.tmp`. The system releases the lock when the run ends in any way. Files whose lock
//! is free therefore belong to a run that was killed, and the next run that writes to the folder removes them.

use super::warn;
use deflex::text::{Diagnostic, Severity};
use std::fs::{self, File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

const PREFIX: &str = ".deflex-";
const LOCK: &str = ".lock";
const FILE: &str = ".tmp";

/// Number of hexadecimal digits of the ID of a run: 128 random bits. They distinguish all runs that write to a folder,
/// from any machine, and a file with the same name cannot be created in advance.
const ID_DIGITS: usize = 32;

/// A new random ID.
pub(super) fn new_id() -> io::Result<String> {
    let mut bits = [0; ID_DIGITS / 2];
    getrandom::fill(&mut bits).map_err(io::Error::other)?;
    Ok(bits.iter().map(|byte| format!("{byte:02x}")).collect())
}

/// Whether a text is an ID.
pub(super) fn is_id(text: &str) -> bool {
    text.len() == ID_DIGITS && text.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'))
}

/// Path of the file whose lock shows that a run is still alive.
pub(super) fn of(folder: &Path, id: &str) -> PathBuf {
    folder.join(format!("{PREFIX}{id}{LOCK}"))
}

/// Whether a name is that of a lock file.
pub(super) fn is_lock(name: &str) -> bool {
    name.ends_with(LOCK)
}

/// Path of the temporary file with a number of a run.
pub(super) fn waiting(folder: &Path, id: &str, number: usize) -> PathBuf {
    folder.join(format!("{PREFIX}{id}-{number}{FILE}"))
}

/// ID of the run to which a hidden file belongs.
pub(super) fn owner(name: &str) -> Option<&str> {
    let rest = name.strip_prefix(PREFIX)?;
    let id = match rest.strip_suffix(LOCK) {
        Some(id) => id,
        None => {
            let (id, number) = rest.strip_suffix(FILE)?.rsplit_once('-')?;
            number.bytes().all(|byte| byte.is_ascii_digit()).then_some(id)?
        }
    };
    is_id(id).then_some(id)
}

/// Longest time for which a run waits for another program's lock on a folder, s.
static TIMEOUT_S: AtomicU64 = AtomicU64::new(DEFAULT_TIMEOUT_S);

/// Default of `--lock-timeout`, s. Renaming outputs takes much less than a second, so a lock that is held for a minute
/// has another purpose.
pub(crate) const DEFAULT_TIMEOUT_S: u64 = 60;

/// Sets the time of `--lock-timeout`, s.
pub(crate) fn wait_at_most(seconds: u64) {
    TIMEOUT_S.store(seconds, Ordering::Relaxed);
}

/// Time between two attempts to get a lock: too short to be noticed, and long enough to cost nothing.
const POLL: Duration = Duration::from_millis(10);

/// Time after which a waiting run prints a warning, and after which it continues where it can do without the lock.
/// Another run has renamed its outputs by then.
const PATIENCE: Duration = Duration::from_secs(1);

/// Locks a folder against the renaming of outputs by other runs, after waiting for its turn; `None` if the file system
/// has no locks.
///
/// # Errors
/// Another program holds a lock on it for longer than `--lock-timeout`.
pub(super) fn lock_folder(folder: &Path) -> io::Result<Option<File>> {
    let Ok(file) = File::open(folder) else { return Ok(None) };
    let (start, limit) = (Instant::now(), Duration::from_secs(TIMEOUT_S.load(Ordering::Relaxed)));
    let mut has_reported = false;
    loop {
        match file.try_lock() {
            Ok(()) => return Ok(Some(file)),
            Err(TryLockError::Error(_)) => return Ok(None),
            Err(TryLockError::WouldBlock) if start.elapsed() >= limit => {
                let why = format!("another program has held a lock on its folder for {} s", limit.as_secs());
                return Err(io::Error::new(io::ErrorKind::TimedOut, why));
            }
            Err(TryLockError::WouldBlock) => {
                if !has_reported && start.elapsed() >= PATIENCE {
                    has_reported = true;
                    warn(&[waits(folder, limit)]);
                }
                std::thread::sleep(POLL);
            }
        }
    }
}

fn waits(folder: &Path, limit: Duration) -> Diagnostic {
    let message = format!("another program holds a lock on this folder: waiting for at most {} s", limit.as_secs());
    Diagnostic::error("io.lock", &folder.display().to_string(), message)
        .severity(Severity::Warning)
        .help("`--lock-timeout SECONDS` sets how long; Ctrl-C ends the run, and nothing is written")
}

/// The same for work that a later run can do instead. A lock on the system's folder for temporary files that is held
/// longer than [`PATIENCE`] belongs to another kind of program.
pub(super) fn take_turn(folder: &Path) -> Option<File> {
    let start = Instant::now();
    while start.elapsed() < PATIENCE {
        if let Some(held) = try_lock_folder(folder) {
            return Some(held);
        }
        std::thread::sleep(POLL);
    }
    None
}

/// The same without waiting.
pub(super) fn try_lock_folder(folder: &Path) -> Option<File> {
    let folder = File::open(folder).ok()?;
    folder.try_lock().ok().map(|()| folder)
}

/// Whether the run with this ID is still alive: it holds its lock.
pub(super) fn is_held(folder: &Path, id: &str) -> bool {
    let path = of(folder, id);
    match fs::symlink_metadata(&path) {
        // Another kind of file with this name, such as a pipe that could never be opened, is not a lock of deflex.
        Ok(metadata) if !metadata.is_file() => false,
        Ok(_) => File::open(path).map_or(true, |lock| lock.try_lock().is_err()),
        Err(error) => error.kind() != io::ErrorKind::NotFound,
    }
}

#[cfg(test)]
mod tests {
    use super::{new_id, owner};

    #[test]
    fn only_our_own_names_have_an_owner() {
        let id = new_id().unwrap();
        assert_eq!(owner(&format!(".deflex-{id}.lock")), Some(&*id));
        assert_eq!(owner(&format!(".deflex-{id}-17.tmp")), Some(&*id));
        let others = ["deflex-1f-2a.lock", ".deflex-1f-2a.lock", ".deflex-1f", ".part.mod.swp", "x.tmp", ".deflex.tmp"];
        for name in others.map(str::to_owned).into_iter().chain([format!(".deflex-{id}-a.tmp"), format!("{id}.lock")]) {
            assert_eq!(owner(&name), None, "{name}");
        }
    }
}
