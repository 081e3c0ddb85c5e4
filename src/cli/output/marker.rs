//! The marker of a set that is being put in place, and what becomes of one that a killed run left.

use super::lock;
use super::place::{self, How};
use crate::cli::file_state::State;
use crate::cli::message;
use deflex::text::{Diagnostic, Severity};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::fs::{self, File};
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
    of(folder, id).exists()
}

/// The marker of a run in a folder.
pub(super) fn of(folder: &Path, id: &str) -> PathBuf {
    folder.join(format!("{PREFIX}{id}{SUFFIX}"))
}

/// What stands in it.
pub(super) fn text(entries: &[Entry]) -> Vec<u8> {
    let said = "these outputs of one run are unfinished: some are new, some are those of before; \
                the next run of deflex that writes to this folder finishes them";
    let text = Marker { deflex: said.to_owned(), files: entries.to_vec() };
    serde_json::to_vec_pretty(&text).unwrap_or_default()
}

/// The folders of outputs, in their order.
pub(super) fn folders(entries: &[Entry]) -> BTreeSet<PathBuf> {
    entries.iter().filter_map(|entry| entry.target.parent()).map(Path::to_owned).collect()
}

/// Takes the markers of a run away.
pub(super) fn unmark(folders: &BTreeSet<PathBuf>, id: &str) {
    for folder in folders {
        // A marker that will not go says what is no longer true; the next run removes it.
        if fs::remove_file(of(folder, id)).is_ok() {
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
    let Ok(text) = fs::read(of(here, id)) else { return };
    // A marker gets its name when it is whole: what cannot be read is nobody's.
    let Ok(Marker { files, .. }) = serde_json::from_slice::<Marker>(&text) else { return };
    let folders = folders(&files);
    let others: Vec<Option<File>> =
        folders.iter().filter(|folder| *folder != here).map(|folder| lock::try_lock_folder(folder)).collect();
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
pub(in crate::cli) fn unfinished(folder: &Path) -> Vec<(PathBuf, String)> {
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    let names = entries.flatten().filter_map(|entry| entry.file_name().into_string().ok());
    let marked = |name: String| {
        let text = fs::read(folder.join(id_of(&name).map(|_| &name)?)).ok()?;
        let marker: Marker = serde_json::from_slice(&text).ok()?;
        Some(marker.files.into_iter().map(move |entry| (entry.target, name.clone())))
    };
    names.filter_map(marked).flatten().collect()
}
