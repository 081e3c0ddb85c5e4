//! What a file was at a moment.

use std::fs::Metadata;
use std::time::SystemTime;

/// What tells one state of a file from another without reading it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub(super) struct State {
    length: u64,
    pub(super) modified: Option<SystemTime>,
    /// Device, inode and the time of the last change of any of them; 0 where the system has none.
    own: [i64; 4],
}

impl State {
    pub(super) fn of(metadata: &Metadata) -> Self {
        #[cfg(unix)]
        let own = {
            use std::os::unix::fs::MetadataExt;
            [metadata.dev().cast_signed(), metadata.ino().cast_signed(), metadata.ctime(), metadata.ctime_nsec()]
        };
        #[cfg(not(unix))]
        let own = [0; 4];
        Self { length: metadata.len(), modified: metadata.modified().ok(), own }
    }

    /// Without what a second name for the same file changes.
    pub(super) fn of_content(metadata: &Metadata) -> Self {
        let mut state = Self::of(metadata);
        state.own[2..].fill(0);
        state
    }
}
