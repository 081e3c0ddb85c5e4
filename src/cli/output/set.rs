//! Several outputs that belong together: a program, its report and its page, or all of a batch.
//!
//! Files get their names one by one. While they do, a marker in each folder (`deflex-unfinished-ID.json`) says so and
//! lists them; it is on the disk before the first file gets its name, and goes after the last one has. So at any moment all
//! files are old, or all are new, or the marker is there. The next run that writes to the folder finishes such a set: all
//! that it needs is in the waiting files. Two runs take turns by a lock on the folders.

use super::super::message;
use super::super::watch::State;
use super::place::{self, How};
use super::staging;
use deflex::text::{Diagnostic, Severity};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

const PREFIX: &str = "deflex-unfinished-";
const SUFFIX: &str = ".json";

/// One output on its way.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Entry {
    pub(super) waits: PathBuf,
    pub(super) target: PathBuf,
    pub(super) how: How,
    /// The target's state before; `None` where there was no file.
    before: Option<State>,
}

impl Entry {
    pub(super) fn new(waits: PathBuf, target: PathBuf, how: How) -> Self {
        let before = state(&target);
        Self { waits, target, how, before }
    }

    /// Whether nobody else has written the target since; what is overwritten in place may have been begun.
    fn untouched(&self) -> bool {
        let now = state(&self.target);
        match self.how {
            How::Rename => now == self.before,
            How::Overwrite => now.is_some(),
        }
    }
}

fn state(path: &Path) -> Option<State> {
    fs::metadata(path).ok().map(|metadata| State::of_content(&metadata))
}

/// The marker's text.
#[derive(Debug, Serialize, Deserialize)]
struct Marker {
    deflex: String,
    files: Vec<Entry>,
}

/// The run whose marker has this name.
pub(super) fn id_of(name: &str) -> Option<&str> {
    name.strip_prefix(PREFIX)?.strip_suffix(SUFFIX)
}

/// Whether the marker of a run is in a folder.
pub(super) fn exists(folder: &Path, id: &str) -> bool {
    marker(folder, id).exists()
}

fn marker(folder: &Path, id: &str) -> PathBuf {
    folder.join(format!("{PREFIX}{id}{SUFFIX}"))
}

/// Gives every output its name. On an error all targets are as before.
pub(super) fn put_in_place(entries: &[Entry]) -> Result<(), (PathBuf, io::Error)> {
    let folders = folders(entries);
    // In their order, so that two runs never wait for each other.
    let _turn: Vec<Option<File>> = folders.iter().map(|folder| staging::lock_folder(folder)).collect();
    // One file is old or new by itself.
    let several = entries.len() > 1 || entries.iter().any(|entry| entry.how == How::Overwrite);
    if several {
        mark(&folders, entries)?;
    }
    let mut undo = Vec::with_capacity(entries.len());
    for entry in entries {
        let failed = |error| (entry.target.clone(), error);
        let done = place::keep_old(&entry.target, entry.how).and_then(|old| {
            let done = place::place(&entry.waits, &entry.target, entry.how);
            undo.push((entry, old));
            done
        });
        if let Err(error) = done.map_err(failed) {
            for (entry, old) in undo.into_iter().rev() {
                old.restore(&entry.target, entry.how);
            }
            unmark(&folders, staging::run_id());
            return Err(error);
        }
    }
    folders.iter().for_each(|folder| sync_folder(folder));
    drop(undo);
    if several {
        unmark(&folders, staging::run_id());
    }
    Ok(())
}

fn folders(entries: &[Entry]) -> BTreeSet<PathBuf> {
    entries.iter().filter_map(|entry| entry.target.parent()).map(Path::to_owned).collect()
}

fn mark(folders: &BTreeSet<PathBuf>, entries: &[Entry]) -> Result<(), (PathBuf, io::Error)> {
    let said = "these outputs of one run are unfinished: some are new, some are those of before; \
                the next run of deflex that writes to this folder finishes them";
    let text = Marker { deflex: said.to_owned(), files: entries.to_vec() };
    let text = serde_json::to_vec_pretty(&text).unwrap_or_default();
    for folder in folders {
        let path = marker(folder, staging::run_id());
        let write = || -> io::Result<()> {
            let (waits, mut file) = staging::create(folder)?;
            let written = file.write_all(&text).and_then(|()| file.sync_all()).and_then(|()| fs::rename(&waits, &path));
            if written.is_err() {
                let _ = fs::remove_file(&waits);
            }
            staging::forget(&waits);
            written
        };
        if let Err(error) = write() {
            unmark(folders, staging::run_id());
            return Err((path, error));
        }
        sync_folder(folder);
    }
    Ok(())
}

fn unmark(folders: &BTreeSet<PathBuf>, id: &str) {
    for folder in folders {
        // A marker that will not go says what is no longer true; the next run removes it.
        if fs::remove_file(marker(folder, id)).is_ok() {
            sync_folder(folder);
        }
    }
}

/// Makes names last through a power failure, where the system lets folders be opened.
pub(super) fn sync_folder(folder: &Path) {
    if let Ok(folder) = File::open(folder) {
        let _ = folder.sync_all();
    }
}

/// Finishes the set of a run that was killed. The lock of `here` is held.
pub(super) fn recover(here: &Path, id: &str) {
    let Ok(text) = fs::read(marker(here, id)) else { return };
    // A marker gets its name when it is whole: what cannot be read is nobody's.
    let Ok(Marker { files, .. }) = serde_json::from_slice::<Marker>(&text) else { return };
    let folders = folders(&files);
    let others: Vec<Option<File>> =
        folders.iter().filter(|folder| *folder != here).map(|folder| staging::try_lock_folder(folder)).collect();
    if others.iter().any(Option::is_none) {
        return;
    }
    // Marked in some folders only: no file has its new name yet, or all have.
    if !folders.iter().all(|folder| exists(folder, id)) {
        files.iter().for_each(|entry| drop(fs::remove_file(&entry.waits)));
        return unmark(&folders, id);
    }
    let mut kept = Vec::new();
    for entry in files.iter().filter(|entry| entry.waits.exists()) {
        if !entry.untouched() {
            kept.push(entry.target.display().to_string());
            let _ = fs::remove_file(&entry.waits);
        } else if place::place(&entry.waits, &entry.target, entry.how).is_err() {
            // It stays marked: neither finished nor forgotten.
            return;
        }
    }
    folders.iter().for_each(|folder| sync_folder(folder));
    unmark(&folders, id);
    message::print(&told(&files, &kept), false);
}

fn told(files: &[Entry], kept: &[String]) -> Vec<Diagnostic> {
    let first = files.first().map_or_else(String::new, |entry| entry.target.display().to_string());
    let finished = format!("the {} outputs of a run that was killed are finished now", files.len());
    let mut all = vec![Diagnostic::error("io.finished", &first, finished).severity(Severity::Note)];
    if !kept.is_empty() {
        let message = format!("left as changed since, though their set is newer: {}", kept.join(", "));
        let help = "run again what wrote them";
        all.push(Diagnostic::error("io.mixed", &first, message).severity(Severity::Warning).help(help));
    }
    all
}

/// The files of unfinished sets in a folder, and the marker that says so.
pub(in super::super) fn unfinished(folder: &Path) -> Vec<(PathBuf, String)> {
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    let names = entries.flatten().filter_map(|entry| entry.file_name().into_string().ok());
    let marked = |name: String| {
        let text = fs::read(folder.join(id_of(&name).map(|_| &name)?)).ok()?;
        let marker: Marker = serde_json::from_slice(&text).ok()?;
        Some(marker.files.into_iter().map(move |entry| (entry.target, name.clone())))
    };
    names.filter_map(marked).flatten().collect()
}
