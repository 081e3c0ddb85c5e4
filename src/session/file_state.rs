//! The state of a file at one moment, and the identity of the file to which a path leads.

use file_id::FileId;
use std::fs::Metadata;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// Properties by which two states of a file can be distinguished without reading it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub(crate) struct FileState {
    length: u64,
    /// Time of the last change of the content, in nanoseconds from 1970; earlier times are negative.
    modified_ns: Option<i64>,
    /// Device, inode, and the time of the last change of its metadata in s and ns; 0 on systems that have none.
    own: [i64; 4],
}

impl FileState {
    pub(crate) fn of(metadata: &Metadata) -> Self {
        #[cfg(unix)]
        let own = {
            use std::os::unix::fs::MetadataExt;
            [metadata.dev().cast_signed(), metadata.ino().cast_signed(), metadata.ctime(), metadata.ctime_nsec()]
        };
        #[cfg(not(unix))]
        let own = [0; 4];
        Self { length: metadata.len(), modified_ns: metadata.modified().ok().and_then(nanoseconds), own }
    }

    /// The state without the properties that change when the file gets a second name.
    pub(crate) fn of_content(metadata: &Metadata) -> Self {
        let mut state = Self::of(metadata);
        state.own[2..].fill(0);
        state
    }

    /// Whether both are states of the same file, whose content may have changed in between.
    pub(crate) fn same_file(&self, other: &Self) -> bool {
        self.own[..2] == other.own[..2]
    }
}

/// A time as 64-bit nanoseconds, which cover 292 years before and after 1970; `None` outside of them.
fn nanoseconds(time: SystemTime) -> Option<i64> {
    match time.duration_since(SystemTime::UNIX_EPOCH) {
        Ok(after) => after.as_nanos().try_into().ok(),
        Err(before) => before.duration().as_nanos().try_into().ok().map(|before: i64| -before),
    }
}

/// Identifies the file to which a path leads. Hard links and symbolic links to one file have the same identity.
#[derive(Clone, Debug)]
pub(crate) struct Identity {
    path: PathBuf,
    /// `None` if the file does not exist yet.
    id: Option<FileId>,
}

impl Identity {
    /// The identity of a path, of which as many parts are resolved as exist.
    pub(crate) fn of(path: &Path) -> Self {
        let canonical = std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        Self { path: canonical, id: file_id::get_file_id(path).ok() }
    }
}

impl PartialEq for Identity {
    fn eq(&self, other: &Self) -> bool {
        self.path == other.path || self.id.is_some() && self.id == other.id
    }
}
