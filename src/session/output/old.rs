//! Keeps the former state of a file, so that it can be restored if a later output cannot be written.

use super::place::{How, folder_of, overwrite};
use super::staging;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// The former state of a file that is replaced.
pub(super) enum Old {
    /// The file did not exist.
    Nothing,
    /// A second name (hard link) for the former file, which is removed when this is dropped.
    Link(PathBuf),
    /// The former content, if the file system has no hard links or the file is overwritten.
    Content(Vec<u8>),
}

/// Stores the present state of a file.
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
    /// Restores the former state. If that fails, the file stays as it is.
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
            // Does nothing if the file was restored, because then the second name is gone.
            let _ = fs::remove_file(&*path);
            staging::forget(path);
        }
    }
}
