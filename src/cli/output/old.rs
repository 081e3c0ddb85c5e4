//! What a file was before it was replaced, for as long as it may have to come back.

use super::place::{How, folder_of, overwrite};
use super::staging;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// What a file was before it was replaced.
pub(super) enum Old {
    /// There was none.
    Nothing,
    /// Another name for it, which goes with this.
    Link(PathBuf),
    /// Its content, where it has no second name.
    Content(Vec<u8>),
}

/// Keeps what a file is.
pub(super) fn keep_old(target: &Path, how: How) -> io::Result<Old> {
    let Ok(metadata) = fs::metadata(target) else { return Ok(Old::Nothing) };
    if !metadata.is_file() {
        return Err(io::Error::new(io::ErrorKind::IsADirectory, "it is not a file any more"));
    }
    if how == How::Rename {
        let path = staging::reserve(folder_of(target))?;
        if fs::hard_link(target, &path).is_ok() {
            return Ok(Old::Link(path));
        }
        staging::forget(&path);
    }
    fs::read(target).map(Old::Content)
}

impl Old {
    /// Puts it back; what cannot be put back stays as it is.
    pub(super) fn restore(mut self, target: &Path, how: How) {
        let _ = match (&mut self, how) {
            (Self::Nothing, _) => fs::remove_file(target),
            (Self::Link(path), How::Rename) => fs::rename(path, target),
            (Self::Content(bytes), How::Rename) => fs::write(target, bytes),
            (Self::Link(_), How::Overwrite) => Ok(()),
            (Self::Content(bytes), How::Overwrite) => overwrite(&mut &bytes[..], target),
        };
    }
}

impl Drop for Old {
    fn drop(&mut self) {
        if let Self::Link(path) = self {
            // Gone already where it was put back.
            let _ = fs::remove_file(&*path);
            staging::forget(path);
        }
    }
}
