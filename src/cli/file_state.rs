//! What a file was at a moment, and which file a path leads to.

use file_id::FileId;
use std::fs::Metadata;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// Properties by which two states of a file can be distinguished without reading it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub(super) struct FileState {
    length: u64,
    /// Of the last change of its content, from 1970 on; times before that are negative.
    modified_ns: Option<i64>,
    /// Device, inode and the time of the last change of any of them; 0 where the system has none.
    own: [i64; 4],
}

impl FileState {
    pub(super) fn of(metadata: &Metadata) -> Self {
        #[cfg(unix)]
        let own = {
            use std::os::unix::fs::MetadataExt;
            [metadata.dev().cast_signed(), metadata.ino().cast_signed(), metadata.ctime(), metadata.ctime_nsec()]
        };
        #[cfg(not(unix))]
        let own = [0; 4];
        Self { length: metadata.len(), modified_ns: metadata.modified().ok().and_then(nanoseconds), own }
    }

    /// Without what a second name for the same file changes.
    pub(super) fn of_content(metadata: &Metadata) -> Self {
        let mut state = Self::of(metadata);
        state.own[2..].fill(0);
        state
    }

    /// Whether both are states of one file, whose content may have changed.
    pub(super) fn same_file(&self, other: &Self) -> bool {
        self.own[..2] == other.own[..2]
    }
}

/// A time in the range that 64 bits hold: 292 years around 1970.
fn nanoseconds(time: SystemTime) -> Option<i64> {
    match time.duration_since(SystemTime::UNIX_EPOCH) {
        Ok(after) => after.as_nanos().try_into().ok(),
        Err(before) => before.duration().as_nanos().try_into().ok().map(|before: i64| -before),
    }
}

/// Which file a path leads to: hard links and symbolic links to one file have one identity.
#[derive(Clone, Debug)]
pub(super) struct Identity {
    path: PathBuf,
    /// `None` where there is no file yet.
    id: Option<FileId>,
}

impl Identity {
    /// Of a path that is resolved as far as it can be.
    pub(super) fn of(path: &Path) -> Self {
        let canonical = std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        Self { path: canonical, id: file_id::get_file_id(path).ok() }
    }
}

impl PartialEq for Identity {
    fn eq(&self, other: &Self) -> bool {
        self.path == other.path || self.id.is_some() && self.id == other.id
    }
}
