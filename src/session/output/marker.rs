//! The marker file of a set of outputs that is being renamed, and the completion of a set that a killed run left
//! unfinished.
//!
//! Any program could have written a marker. It is therefore trusted only about files of its own folder, with names
//! without a path, whose bytes, inode and owner are as it states: only the run that staged the files could know these.

use super::lock;
use super::place::{self, How, Move};
use super::warn;
use crate::session::file_state::FileState;
use deflex::report::Origin;
use deflex::text::{Diagnostic, Severity};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fs::{self, File, Metadata};
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

const PREFIX: &str = "deflex-unfinished-";
const SUFFIX: &str = ".json";

/// Largest size of a marker, bytes: enough for a set of a hundred thousand files.
const MOST_BYTES: u64 = 64 << 20;

/// Number of bytes at each end of a file that are hashed.
const END: u64 = 64 << 10;

/// A name or path as text, or as the system's bytes if it is not valid text.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(untagged)]
enum Name {
    Text(String),
    System(OsString),
}

impl Name {
    fn of(name: impl Into<OsString>) -> Self {
        name.into().into_string().map_or_else(Self::System, Self::Text)
    }

    fn path(&self) -> &Path {
        match self {
            Self::Text(text) => Path::new(text),
            Self::System(name) => Path::new(name),
        }
    }

    /// The path of the name in a folder; `None` if the name contains a path.
    fn within(&self, folder: &Path) -> Option<PathBuf> {
        let joined = folder.join(self.path());
        let plain = joined.parent() == Some(folder) && joined.file_name() == Some(self.path().as_os_str());
        plain.then_some(joined)
    }
}

/// One output of an unfinished set, with its names in the folder of the marker.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Entry {
    waits: Name,
    target: Name,
    how: How,
    sha256: String,
    /// State of the temporary file.
    staged: FileState,
    /// State of the target before; `None` if it did not exist.
    before: Option<FileState>,
}

/// Content of the marker.
#[derive(Debug, Serialize, Deserialize)]
struct Marker {
    deflex: String,
    /// All folders of the set, each of which has a marker.
    folders: Vec<Name>,
    files: Vec<Entry>,
}

/// ID of the run whose marker has this name.
pub(super) fn id_of(name: &str) -> Option<&str> {
    name.strip_prefix(PREFIX)?.strip_suffix(SUFFIX)
}

/// Whether the marker of a run is in a folder.
pub(super) fn exists(folder: &Path, id: &str) -> bool {
    of(folder, id).symlink_metadata().is_ok()
}

/// Path of the marker of a run in a folder.
pub(super) fn of(folder: &Path, id: &str) -> PathBuf {
    folder.join(format!("{PREFIX}{id}{SUFFIX}"))
}

/// Text of the marker of a folder: the outputs in it, and the other folders of the set.
pub(super) fn text(folder: &Path, folders: &BTreeSet<PathBuf>, moves: &[Move]) -> io::Result<Vec<u8>> {
    let text = "a run was killed while it replaced these outputs: some are new, some are still the former ones; \
                the next run of deflex that writes to this folder finishes them";
    let name = |path: &Path| Name::of(path.file_name().unwrap_or_default());
    let entry = |go: &Move| -> io::Result<Entry> {
        let staged = fs::symlink_metadata(&go.temporary)?;
        Ok(Entry {
            waits: name(&go.temporary),
            target: name(&go.target),
            how: go.how,
            sha256: hash(&go.temporary)?,
            staged: FileState::of_content(&staged),
            before: state(&go.target),
        })
    };
    let here = moves.iter().filter(|go| place::folder_of(&go.target) == folder);
    let marker = Marker {
        deflex: text.to_owned(),
        folders: folders.iter().map(Name::of).collect(),
        files: here.map(entry).collect::<io::Result<_>>()?,
    };
    Ok(serde_json::to_vec_pretty(&marker)?)
}

fn state(path: &Path) -> Option<FileState> {
    fs::symlink_metadata(path).ok().map(|metadata| FileState::of_content(&metadata))
}

/// SHA-256 of a file, or of the first and last [`END`] bytes of a long one. The marker also has its device, inode,
/// length and time of change, and reading a gigabyte again would take a third of the run.
fn hash(path: &Path) -> io::Result<String> {
    let mut file = File::open(path)?;
    let mut head = Vec::new();
    (&file).take(END).read_to_end(&mut head)?;
    let rest = file.metadata()?.len().saturating_sub(END);
    file.seek(SeekFrom::End(-i64::try_from(rest.min(END)).unwrap_or(0)))?;
    Origin::read("", head.as_slice().chain(file)).map(|origin| origin.sha256)
}

/// Removes the markers of a run.
pub(super) fn unmark<'a>(folders: impl IntoIterator<Item = &'a PathBuf>, id: &str) {
    for folder in folders {
        // A marker that cannot be removed is out of date; the next run removes it.
        if fs::remove_file(of(folder, id)).is_ok() {
            sync_folder(folder);
        }
    }
}

/// Makes renames durable in case of a power failure, if the system allows opening folders.
pub(super) fn sync_folder(folder: &Path) {
    if let Ok(folder) = File::open(folder) {
        let _ = folder.sync_all();
    }
}

/// User ID of the owner of a file; the same for all files on systems without one.
#[cfg(unix)]
pub(super) fn owner(metadata: &Metadata) -> u32 {
    std::os::unix::fs::MetadataExt::uid(metadata)
}

/// User ID of the owner of a file; the same for all files on systems without one.
#[cfg(not(unix))]
pub(super) fn owner(_: &Metadata) -> u32 {
    0
}

/// Whether a path is a regular file that a user owns.
pub(super) fn is_file_of(path: &Path, user: u32) -> bool {
    fs::symlink_metadata(path).is_ok_and(|metadata| metadata.is_file() && owner(&metadata) == user)
}

/// The reason why a marker, and all files that it names, are left alone.
type Doubt = &'static str;

/// Reads the marker of a run in a folder.
fn read(folder: &Path, id: &str, user: u32) -> Result<Marker, Doubt> {
    let path = of(folder, id);
    if !lock::is_id(id) || !is_file_of(&path, user) {
        return Err("it is not a file that a run of the same user has written");
    }
    if fs::metadata(&path).map_or(true, |metadata| metadata.len() > MOST_BYTES) {
        return Err("it is longer than any marker");
    }
    let text = fs::read(&path).map_err(|_| "it cannot be read")?;
    serde_json::from_slice(&text).map_err(|_| "it does not have the form of a marker")
}

/// One folder's share of an unfinished set.
struct FolderShare {
    folder: PathBuf,
    files: Vec<Entry>,
}

impl FolderShare {
    /// The temporary file of an entry and its target, after all checks; `None` if the temporary file no longer exists.
    fn proven(&self, entry: &Entry, id: &str, user: u32) -> Result<Option<Move>, Doubt> {
        let waits = entry.waits.within(&self.folder).ok_or("it names files of other folders")?;
        let target = entry.target.within(&self.folder).ok_or("it names files of other folders")?;
        let name = waits.file_name().and_then(|name| name.to_str()).filter(|name| !lock::is_lock(name));
        if name.and_then(lock::owner) != Some(id) {
            return Err("it names files that its run did not write");
        }
        if fs::symlink_metadata(&waits).is_err_and(|error| error.kind() == io::ErrorKind::NotFound) {
            return Ok(None);
        }
        let staged = is_file_of(&waits, user) && state(&waits) == Some(entry.staged);
        if !staged || hash(&waits).ok().as_ref() != Some(&entry.sha256) {
            return Err("a file that it names has changed since its run wrote it");
        }
        Ok(Some(Move { temporary: waits, target, how: entry.how }))
    }

    /// All moves of this folder. They are checked before any file is changed.
    fn moves(&self, id: &str, user: u32) -> Result<Vec<(Move, Option<FileState>)>, Doubt> {
        let proven = |entry: &Entry| Some((self.proven(entry, id, user).transpose()?, entry.before));
        self.files.iter().filter_map(proven).map(|(go, before)| Ok((go?, before))).collect()
    }
}

/// Whether no other process has changed a target since. A target that is overwritten in place may already contain a
/// part of the new content.
fn untouched(go: &Move, before: Option<FileState>) -> bool {
    match (state(&go.target), before, go.how) {
        (now, before, How::Rename) => now == before,
        (Some(now), Some(before), How::Overwrite) => {
            now.same_file(&before) && fs::symlink_metadata(&go.target).is_ok_and(|metadata| metadata.is_file())
        }
        (_, _, How::Overwrite) => false,
    }
}

/// Finishes the set of a run of this user that was killed. The caller holds the lock of `here`.
pub(super) fn recover(here: &Path, id: &str, user: u32) {
    if let Err(why) = finish(here, id, user) {
        let message = format!(
            "deflex does not use this marker of an unfinished run, and leaves the files that it names as they are: {why}"
        );
        let doubt = Diagnostic::error("io.marker", &of(here, id).display().to_string(), message)
            .severity(Severity::Warning)
            .help("check the files that it names, then delete the marker");
        warn(&[doubt]);
    }
}

fn finish(here: &Path, id: &str, user: u32) -> Result<(), Doubt> {
    let here = fs::canonicalize(here).map_err(|_| "its folder cannot be read")?;
    let marker = read(&here, id, user)?;
    let mut parts = vec![FolderShare { folder: here, files: marker.files }];
    let (mut turns, mut marked) = (Vec::new(), true);
    for folder in marker.folders.iter().map(Name::path) {
        // A folder that no longer exists contained its part of the set.
        if folder == parts[0].folder || !folder.is_absolute() || !folder.is_dir() {
            continue;
        }
        let Some(turn) = lock::try_lock_folder(folder).filter(|_| !lock::is_held(folder, id)) else {
            // Another run is using the folder.
            return Ok(());
        };
        turns.push(turn);
        if exists(folder, id) {
            let files = read(folder, id, user)?.files;
            parts.push(FolderShare { folder: folder.to_owned(), files });
        } else {
            marked = false;
        }
    }
    let moves = parts.iter().map(|part| part.moves(id, user)).collect::<Result<Vec<_>, _>>()?.concat();
    let folders = || parts.iter().map(|part| &part.folder);
    // Only some folders have a marker: the run was killed either before it renamed the first file, or after it had
    // renamed the last one.
    if !marked {
        moves.iter().for_each(|(go, _)| drop(fs::remove_file(&go.temporary)));
        unmark(folders(), id);
        return Ok(());
    }
    let mut kept = Vec::new();
    for (go, before) in &moves {
        if !untouched(go, *before) {
            kept.push(go.target.display().to_string());
            let _ = fs::remove_file(&go.temporary);
        } else if place::place(go).is_err() {
            return Err("a temporary file cannot be renamed");
        }
    }
    folders().for_each(|folder| sync_folder(folder));
    unmark(folders(), id);
    let targets = parts.iter().flat_map(|part| part.files.iter().filter_map(|entry| entry.target.within(&part.folder)));
    warn(&messages(&targets.collect::<Vec<_>>(), &kept));
    Ok(())
}

fn messages(files: &[PathBuf], kept: &[String]) -> Vec<Diagnostic> {
    let first = files.first().map_or_else(String::new, |target| target.display().to_string());
    let finished = match files.len() {
        1 => "the output of a run that was killed is now complete".to_owned(),
        count => format!("the {count} outputs of a run that was killed are now complete"),
    };
    let mut all = vec![Diagnostic::error("io.finished", &first, finished).severity(Severity::Note)];
    if !kept.is_empty() {
        let message =
            format!("not replaced, because another program has changed them since that run: {}", kept.join(", "));
        let help = "repeat the run that was killed, so that all files come from one run";
        all.push(Diagnostic::error("io.mixed", &first, message).severity(Severity::Warning).help(help));
    }
    all
}

/// The files of unfinished sets in a folder, each with the name of its marker.
pub(super) fn unfinished(folder: &Path) -> Vec<(PathBuf, String)> {
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    let names = entries.flatten().filter_map(|entry| entry.file_name().into_string().ok());
    let marked = |name: String| {
        let id = id_of(&name)?;
        let user = fs::symlink_metadata(folder.join(&name)).map(|metadata| owner(&metadata)).ok()?;
        let files = read(folder, id, user).ok()?.files;
        Some(files.into_iter().filter_map(move |entry| Some((entry.target.within(folder)?, name.clone()))))
    };
    names.filter_map(marked).flatten().collect()
}
