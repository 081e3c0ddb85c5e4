//! One file into another's place, as an editor saves: through symbolic links, with the owner, the group and the permissions
//! that were there.

use serde::{Deserialize, Serialize};
use std::fs::{self, File, Metadata, OpenOptions};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// How a file gets its new content.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum How {
    /// The waiting file takes its name.
    Rename,
    /// The content is written into the file that is there: it has other names too, or an owner that a new file cannot have.
    Overwrite,
}

/// A waiting file, where it goes, and how it gets there.
#[derive(Clone, Debug)]
pub(super) struct Move {
    pub(super) waits: PathBuf,
    pub(super) target: PathBuf,
    pub(super) how: How,
}

/// The file that a path means: through symbolic links, so that the target of a link is replaced, not the link; for a link to
/// nothing, the file that it names.
///
/// # Errors
/// The links lead round in a circle.
pub(super) fn resolved(path: &Path) -> io::Result<PathBuf> {
    /// As many links as Linux follows.
    const MOST_LINKS: usize = 40;
    let mut path = path.to_owned();
    for _ in 0..MOST_LINKS {
        if let Ok(there) = fs::canonicalize(&path) {
            return Ok(there);
        }
        let Ok(link) = fs::read_link(&path) else {
            let in_folder = || Some(fs::canonicalize(folder_of(&path)).ok()?.join(path.file_name()?));
            return Ok(in_folder().unwrap_or(path));
        };
        path = folder_of(&path).join(link);
    }
    Err(io::Error::other("it is a symbolic link that leads back to itself"))
}

/// The folder that a path is in.
pub(super) fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Whether a file may be replaced: an editor would not save over one without write permission, though its folder allows it.
pub(super) fn writable(target: &Path, existing: &Metadata) -> io::Result<()> {
    if existing.permissions().readonly() {
        return Err(io::Error::new(io::ErrorKind::PermissionDenied, "the file is read-only"));
    }
    OpenOptions::new().write(true).open(target).map(drop)
}

/// Gives a new file what an existing one has; how the new one can take its place.
pub(super) fn adopt(new: &File, existing: &Metadata) -> io::Result<How> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::{MetadataExt, fchown};
        let own = new.metadata()?;
        let same = (own.uid(), own.gid()) == (existing.uid(), existing.gid());
        if existing.nlink() > 1 || !same && fchown(new, Some(existing.uid()), Some(existing.gid())).is_err() {
            return Ok(How::Overwrite);
        }
    }
    // After the owner: a change of owner takes set-user-ID bits away.
    new.set_permissions(existing.permissions())?;
    Ok(How::Rename)
}

/// Puts a waiting file into its place.
pub(super) fn place(go: &Move) -> io::Result<()> {
    match go.how {
        How::Rename => fs::rename(&go.waits, &go.target),
        How::Overwrite => overwrite(&mut File::open(&go.waits)?, &go.target),
    }
}

/// Writes into a file that is there; it is cut off only when all is in it.
pub(super) fn overwrite(from: &mut impl Read, target: &Path) -> io::Result<()> {
    let mut to = OpenOptions::new().write(true).open(target)?;
    let length = io::copy(from, &mut to)?;
    to.set_len(length)?;
    to.sync_all()
}
