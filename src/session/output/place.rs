//! Replaces a file as an editor saves it: through symbolic links, and with the owner, group and permissions of the
//! former file.

use serde::{Deserialize, Serialize};
use std::fs::{self, File, Metadata, OpenOptions};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// How a file gets its new content.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum How {
    /// The temporary file is renamed to it.
    Rename,
    /// The content is written into the existing file, because it has further hard links, or an owner that a new file
    /// cannot have.
    Overwrite,
}

/// A temporary file, its target, and how it replaces the target.
#[derive(Clone, Debug)]
pub(super) struct Move {
    pub(super) temporary: PathBuf,
    pub(super) target: PathBuf,
    pub(super) how: How,
}

/// The file that a path means. Symbolic links are followed, so that the target of a link is replaced and not the link
/// itself. For a link to a file that does not exist, it is the path of that file.
///
/// # Errors
/// The links form a circle.
pub(super) fn resolved(path: &Path) -> io::Result<PathBuf> {
    /// Number of links that Linux follows.
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

/// Checks that a file can be replaced. Like an editor, deflex refuses to replace a read-only file, although its folder
/// would allow it.
pub(super) fn writable(target: &Path, existing: &Metadata) -> io::Result<()> {
    if existing.permissions().readonly() {
        return Err(io::Error::new(io::ErrorKind::PermissionDenied, "the file is read-only"));
    }
    OpenOptions::new().write(true).open(target).map(drop)
}

/// Gives a new file the owner, group and permissions of an existing one, and returns how it can replace that file.
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
    // Set after the owner, because a change of owner clears the set-user-ID bits.
    new.set_permissions(existing.permissions())?;
    Ok(How::Rename)
}

/// Replaces the target by the temporary file.
pub(super) fn place(go: &Move) -> io::Result<()> {
    match go.how {
        How::Rename => fs::rename(&go.temporary, &go.target),
        How::Overwrite => overwrite(&mut File::open(&go.temporary)?, &go.target),
    }
}

/// Writes into an existing file. The file is shortened only after the whole content is in it.
pub(super) fn overwrite(from: &mut impl Read, target: &Path) -> io::Result<()> {
    let mut to = OpenOptions::new().write(true).open(target)?;
    let length = io::copy(from, &mut to)?;
    to.set_len(length)?;
    to.sync_all()
}
