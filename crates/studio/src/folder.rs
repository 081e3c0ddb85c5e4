//! The folder that the window shows: its listing, and files that are read and written as a whole.

use crate::name::Name;
use crate::refused::Refused;
use axum::body::Body;
use axum::http::StatusCode;
use http_body_util::BodyExt;
use serde::Serialize;
use std::fs::{self, File, Metadata, OpenOptions};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

/// Largest file that can be added, bytes: a program of about two million targets.
pub(crate) const LARGEST_FILE: u64 = 256 << 20;
/// Largest file that the window shows as text, bytes.
pub(crate) const LARGEST_SHOWN: u64 = 64 << 20;
/// Largest number of files that are listed.
const MOST_FILES: usize = 5000;
/// Largest depth of the folders that are listed.
const DEEPEST: usize = 4;

/// A file of the folder.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Entry {
    name: Name,
    /// Size, bytes.
    size: u64,
    /// Time of the last change, seconds since 1970.
    modified_s: u64,
    /// The beginning of a small file, from which the page recognises cells and tables.
    head: String,
}

/// What is in the folder.
#[derive(Clone, Debug, Default, Serialize)]
pub(crate) struct Listing {
    files: Vec<Entry>,
    /// Number of further files that are not listed. Hidden files do not count.
    left_out: usize,
}

/// Number of bytes of a file's beginning in the listing.
const HEAD: u64 = 400;

/// A file as it was read.
pub(crate) struct Content {
    pub(crate) bytes: Vec<u8>,
    /// The version, which changes with each write.
    pub(crate) version: String,
}

/// What a write expects to find.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Expected {
    /// No file of this name.
    Nothing,
    /// The file as it was read, by its version.
    Version(String),
    /// Any file is replaced.
    Anything,
}

#[derive(Debug)]
pub(crate) struct Folder {
    root: PathBuf,
}

impl Folder {
    pub(crate) fn open(path: &Path) -> io::Result<Self> {
        let root = fs::canonicalize(path)?;
        fs::read_dir(&root)?;
        sweep(&root, DEEPEST);
        Ok(Self { root })
    }

    pub(crate) fn root(&self) -> &Path {
        &self.root
    }

    /// The real path of an existing file. Links are followed, and must end inside the folder.
    pub(crate) fn existing(&self, name: &Name) -> Result<PathBuf, Refused> {
        let path = fs::canonicalize(self.join(name)).map_err(|error| Refused::of(name, &error))?;
        if !path.starts_with(&self.root) {
            let message = format!("{name} is a link to a place outside of the folder: copy the file into the folder");
            return Err(Refused::new(StatusCode::FORBIDDEN, message));
        }
        Ok(path)
    }

    /// Whether a file that a run writes is inside the folder: no existing part of its path may lead out by a link.
    pub(crate) fn is_inside(&self, name: &Name) -> Result<(), Refused> {
        let mut path = self.root.clone();
        for part in name.parts() {
            path.push(part);
            match fs::canonicalize(&path) {
                Ok(real) if real.starts_with(&self.root) => path = real,
                Err(error) if error.kind() == io::ErrorKind::NotFound && fs::symlink_metadata(&path).is_err() => {
                    return Ok(());
                }
                Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(Refused::of(name, &error)),
                _ => {
                    let message = format!("{name} leads through a link out of the folder: choose another name");
                    return Err(Refused::new(StatusCode::FORBIDDEN, message));
                }
            }
        }
        Ok(())
    }

    fn join(&self, name: &Name) -> PathBuf {
        name.parts().fold(self.root.clone(), |path, part| path.join(part))
    }

    /// The real path of a file to be written. Its folders are created, and links among them must stay inside the folder.
    fn writable(&self, name: &Name) -> Result<PathBuf, Refused> {
        let refused = |error: io::Error| Refused::of(name, &error);
        let mut folder = self.root.clone();
        let parts: Vec<&str> = name.parts().collect();
        let (file, folders) = parts.split_last().unwrap_or((&"", &[]));
        for part in folders {
            folder.push(part);
            match fs::create_dir(&folder) {
                Err(error) if error.kind() != io::ErrorKind::AlreadyExists => return Err(refused(error)),
                _ => {}
            }
            folder = fs::canonicalize(&folder).map_err(refused)?;
            if !folder.starts_with(&self.root) {
                let message = format!("{name} leads through a link out of the folder");
                return Err(Refused::new(StatusCode::FORBIDDEN, message));
            }
        }
        let path = folder.join(file);
        match fs::symlink_metadata(&path) {
            Ok(found) if found.is_file() && !found.permissions().readonly() => Ok(path),
            Ok(found) if found.is_file() => Err(Refused::new(
                StatusCode::FORBIDDEN,
                format!("{name} is write-protected: permit writing, or choose another name"),
            )),
            Ok(_) => {
                Err(Refused::new(StatusCode::FORBIDDEN, format!("{name} is a link or a folder: choose another name")))
            }
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(path),
            Err(error) => Err(refused(error)),
        }
    }

    /// Files of the folder and its folders, by name. Links are not followed.
    pub(crate) fn list(&self) -> Listing {
        let mut listing = Listing::default();
        self.look_into(&self.root, "", DEEPEST, &mut listing);
        listing.files.sort_by(|a, b| a.name.cmp(&b.name));
        listing
    }

    fn look_into(&self, folder: &Path, before: &str, depth: usize, listing: &mut Listing) {
        for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
            let name = entry.file_name();
            if name.as_encoded_bytes().starts_with(b".") {
                continue;
            }
            let Ok(metadata) = entry.metadata() else { continue };
            let usable = name.into_string().ok().and_then(|name| Name::try_from(format!("{before}{name}")).ok());
            match usable {
                Some(name) if metadata.is_dir() && depth > 1 => {
                    self.look_into(&entry.path(), &format!("{name}/"), depth - 1, listing);
                }
                Some(name) if metadata.is_file() && listing.files.len() < MOST_FILES => {
                    let head = head(&entry.path()).unwrap_or_default();
                    let modified_s = seconds(&metadata);
                    listing.files.push(Entry { name, size: metadata.len(), modified_s, head });
                }
                _ => listing.left_out += 1,
            }
        }
    }

    /// A file of at most `most` bytes.
    pub(crate) fn read(&self, name: &Name, most: u64) -> Result<Content, Refused> {
        let path = self.existing(name)?;
        let refused = |error: io::Error| Refused::of(name, &error);
        // Reading a pipe or a device with such a name might never end.
        if !fs::metadata(&path).map_err(refused)?.is_file() {
            return Err(Refused::new(StatusCode::FORBIDDEN, format!("{name} is not a file")));
        }
        let file = File::open(&path).map_err(refused)?;
        let version = version(&file.metadata().map_err(refused)?);
        let mut bytes = Vec::new();
        file.take(most + 1).read_to_end(&mut bytes).map_err(refused)?;
        if bytes.len() as u64 > most {
            return Err(Refused::too_large(name, most));
        }
        Ok(Content { bytes, version })
    }

    /// Writes a file completely or not at all, and returns its new version.
    pub(crate) async fn write(&self, name: &Name, mut body: Body, expected: &Expected) -> Result<String, Refused> {
        let path = self.writable(name)?;
        let refused = |error: io::Error| Refused::of(name, &error);
        let mut staged = Staged::next_to(&path).map_err(refused)?;
        let mut size = 0;
        while let Some(frame) = body.frame().await {
            let Ok(frame) = frame else {
                return Err(Refused::new(
                    StatusCode::BAD_REQUEST,
                    format!("{name} did not arrive whole: nothing was written"),
                ));
            };
            let Ok(data) = frame.into_data() else { continue };
            size += data.len() as u64;
            if size > LARGEST_FILE {
                return Err(Refused::too_large(name, LARGEST_FILE));
            }
            staged.file.write_all(&data).map_err(refused)?;
        }
        self.place(name, &path, staged, expected)
    }

    fn place(&self, name: &Name, path: &Path, staged: Staged, expected: &Expected) -> Result<String, Refused> {
        let refused = |error: io::Error| Refused::of(name, &error);
        let found = fs::metadata(path).ok();
        let conflict = |message: String| Err(Refused::new(StatusCode::PRECONDITION_FAILED, message));
        match (expected, &found) {
            (Expected::Nothing, Some(_)) => return conflict(format!("{name} is in the folder already")),
            (Expected::Version(_), None) => return conflict(format!("{name} is no longer in the folder")),
            (Expected::Version(read), Some(found)) if *read != version(found) => {
                return conflict(format!("{name} was changed by another program meanwhile: load it again"));
            }
            _ => {}
        }
        if let Some(found) = found {
            staged.file.set_permissions(found.permissions()).map_err(refused)?;
        }
        staged.file.sync_all().map_err(refused)?;
        staged.become_(path).map_err(refused)?;
        let written = fs::metadata(path).map_err(refused)?;
        Ok(version(&written))
    }
}

/// Removes the unfinished files of servers that were killed.
fn sweep(folder: &Path, depth: usize) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let Ok(metadata) = entry.metadata() else { continue };
        if metadata.is_dir() && depth > 1 {
            sweep(&entry.path(), depth - 1);
        } else if metadata.is_file() && entry.file_name().as_encoded_bytes().starts_with(STAGED.as_bytes()) {
            // Another window may be writing a younger one.
            let is_old = metadata.modified().is_ok_and(|time| time.elapsed().is_ok_and(|age| age > ABANDONED));
            if is_old {
                // Nothing more can be done about a temporary file that stays.
                let _ = fs::remove_file(entry.path());
            }
        }
    }
}

/// The beginning of the names of unfinished files.
const STAGED: &str = ".deflex-studio-";
/// Age of an unfinished file, beyond which no upload can still be writing it.
const ABANDONED: Duration = Duration::from_secs(3600);

/// The beginning of a file, up to the first bytes that are no text.
fn head(path: &Path) -> io::Result<String> {
    let mut bytes = Vec::new();
    File::open(path)?.take(HEAD).read_to_end(&mut bytes)?;
    let text = String::from_utf8_lossy(&bytes);
    Ok(if text.contains('\0') { String::new() } else { text.into_owned() })
}

fn seconds(metadata: &Metadata) -> u64 {
    let since = metadata.modified().ok().and_then(|time| time.duration_since(SystemTime::UNIX_EPOCH).ok());
    since.map_or(0, |since| since.as_secs())
}

fn version(metadata: &Metadata) -> String {
    let since = metadata.modified().ok().and_then(|time| time.duration_since(SystemTime::UNIX_EPOCH).ok());
    format!("\"{:x}-{:x}\"", metadata.len(), since.map_or(0, |since| since.as_nanos()))
}

/// A hidden file that is removed when this value is dropped.
struct Staged {
    path: PathBuf,
    file: File,
}

impl Staged {
    fn next_to(target: &Path) -> io::Result<Self> {
        let folder = target.parent().unwrap_or(Path::new("."));
        let path = folder.join(format!("{STAGED}{}", crate::guard::random_text()?));
        let file = OpenOptions::new().write(true).create_new(true).open(&path)?;
        Ok(Self { path, file })
    }

    fn become_(mut self, target: &Path) -> io::Result<()> {
        fs::rename(&self.path, target)?;
        // Nothing is left to remove.
        self.path = PathBuf::new();
        Ok(())
    }
}

impl Drop for Staged {
    fn drop(&mut self) {
        if !self.path.as_os_str().is_empty() {
            // Nothing more can be done about a temporary file that stays.
            let _ = fs::remove_file(&self.path);
        }
    }
}
