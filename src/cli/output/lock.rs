//! Locks on folders, and the names of the hidden files that a run makes.
//!
//! In every folder that it stages into, a run holds a lock on a file of its own (`.deflex-ID.lock`, its files are
//! `.deflex-ID-N.tmp`). The system lets go of the lock when the run ends in whatever way, so that what a killed run left
//! is known by it, and removed by the next one that writes there.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::time::{Duration, SystemTime};

const PREFIX: &str = ".deflex-";
const LOCK: &str = ".lock";
const FILE: &str = ".tmp";

/// Names this run among all that write to the same folders, on whatever machine.
pub(super) fn run_id() -> &'static str {
    static ID: OnceLock<String> = OnceLock::new();
    ID.get_or_init(|| {
        let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        format!("{:x}-{:x}", std::process::id(), now.as_nanos() & 0xffff_ffff_ffff)
    })
}

/// The file by whose lock a run is known to live.
pub(super) fn of(folder: &Path, id: &str) -> PathBuf {
    folder.join(format!("{PREFIX}{id}{LOCK}"))
}

/// Whether a name is that of such a file.
pub(super) fn is_lock(name: &str) -> bool {
    name.ends_with(LOCK)
}

/// The name of this run's file of a number.
pub(super) fn waiting(folder: &Path, number: usize) -> PathBuf {
    folder.join(format!("{PREFIX}{}-{number}{FILE}", run_id()))
}

/// Waits until no other run puts outputs into a folder, and keeps others from doing so; `None` where folders have no locks.
pub(super) fn lock_folder(folder: &Path) -> Option<File> {
    let folder = File::open(folder).ok()?;
    folder.lock().ok().map(|()| folder)
}

/// The same, but no longer than another run takes to put its outputs there: whoever holds a lock on the system's folder for
/// temporary files for longer is none of ours.
pub(super) fn take_turn(folder: &Path) -> Option<File> {
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

/// The run that a hidden file belongs to.
pub(super) fn owner(name: &str) -> Option<&str> {
    let rest = name.strip_prefix(PREFIX)?;
    match rest.strip_suffix(LOCK) {
        Some(id) => Some(id),
        None => rest.strip_suffix(FILE)?.rsplit_once('-').map(|(id, _)| id),
    }
}

/// Whether the run still holds its lock.
pub(super) fn is_held(folder: &Path, id: &str) -> bool {
    if id == run_id() {
        return true;
    }
    match File::open(of(folder, id)) {
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
