//! Locks on folders, and the names of the hidden files that a run makes.
//!
//! In every folder that it stages into, a run holds a lock on a file of its own (`.deflex-ID.lock`, its files are
//! `.deflex-ID-N.tmp`). The system lets go of the lock when the run ends in whatever way, so that what a killed run left
//! is known by it, and removed by the next one that writes there.

use crate::cli::message;
use deflex::text::{Diagnostic, Severity};
use std::fs::{self, File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

const PREFIX: &str = ".deflex-";
const LOCK: &str = ".lock";
const FILE: &str = ".tmp";

/// Hexadecimal digits of a run's ID: 128 random bits, which name it among all that write to the same folders, on whatever
/// machine, and which no file made in advance can have.
const ID_DIGITS: usize = 32;

/// A new ID.
pub(super) fn new_id() -> io::Result<String> {
    let mut bits = [0; ID_DIGITS / 2];
    getrandom::fill(&mut bits).map_err(io::Error::other)?;
    Ok(bits.iter().map(|byte| format!("{byte:02x}")).collect())
}

/// Whether a text is an ID.
pub(super) fn is_id(text: &str) -> bool {
    text.len() == ID_DIGITS && text.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'))
}

/// The file by whose lock a run is known to live.
pub(super) fn of(folder: &Path, id: &str) -> PathBuf {
    folder.join(format!("{PREFIX}{id}{LOCK}"))
}

/// Whether a name is that of such a file.
pub(super) fn is_lock(name: &str) -> bool {
    name.ends_with(LOCK)
}

/// The name of a run's file of a number.
pub(super) fn waiting(folder: &Path, id: &str, number: usize) -> PathBuf {
    folder.join(format!("{PREFIX}{id}-{number}{FILE}"))
}

/// The run that a hidden file belongs to.
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

/// How long a run waits for another program's lock on a folder, s.
static TIMEOUT_S: AtomicU64 = AtomicU64::new(DEFAULT_TIMEOUT_S);

/// Putting outputs in place takes well under a second: a process that holds a lock for a minute does something else.
pub(in crate::cli) const DEFAULT_TIMEOUT_S: u64 = 60;

/// Sets `--lock-timeout`.
pub(in crate::cli) fn wait_at_most(seconds: u64) {
    TIMEOUT_S.store(seconds, Ordering::Relaxed);
}

/// Short enough not to be noticed, long enough to cost nothing.
const POLL: Duration = Duration::from_millis(10);

/// What a run waits before it says so, and before it goes on where it need not have the lock: another run has put its outputs
/// in place by then.
const PATIENCE: Duration = Duration::from_secs(1);

/// Keeps other runs from putting outputs into a folder, once no other does; `None` where folders have no locks.
///
/// # Errors
/// Another program holds a lock on it for longer than `--lock-timeout`.
pub(super) fn lock_folder(folder: &Path) -> io::Result<Option<File>> {
    let Ok(file) = File::open(folder) else { return Ok(None) };
    let (start, limit) = (Instant::now(), Duration::from_secs(TIMEOUT_S.load(Ordering::Relaxed)));
    let mut said = false;
    loop {
        match file.try_lock() {
            Ok(()) => return Ok(Some(file)),
            Err(TryLockError::Error(_)) => return Ok(None),
            Err(TryLockError::WouldBlock) if start.elapsed() >= limit => {
                let why = format!("another program has held a lock on its folder for {} s", limit.as_secs());
                return Err(io::Error::new(io::ErrorKind::TimedOut, why));
            }
            Err(TryLockError::WouldBlock) => {
                if !said && start.elapsed() >= PATIENCE {
                    said = true;
                    message::print(&[waits(folder, limit)], false);
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

/// The same for work that can be left to a later run: a process that holds a lock on the system's folder for temporary files for
/// longer than another run takes is none of ours.
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

/// Whether a run still holds its lock.
pub(super) fn is_held(folder: &Path, id: &str) -> bool {
    let path = of(folder, id);
    match fs::symlink_metadata(&path) {
        // What stands there instead of a file (a pipe that would never open) is no lock of ours.
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
