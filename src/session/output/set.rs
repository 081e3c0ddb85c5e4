//! Writes several outputs that belong together: a program with its report and page, or all files of a batch.
//!
//! The files are renamed one by one. Meanwhile, each folder has a marker file, `deflex-unfinished-ID.json`, which lists
//! them. The marker is on the disk before the first file is renamed, and is removed after the last one. At any moment
//! all files are therefore old, or all are new, or the marker exists. If the run is killed in between, the next run
//! that writes to the folder renames the remaining files. A lock on each folder makes two runs wait for each other.

use super::marker::{sync_folder, unmark};
use super::place::{self, How, Move, folder_of};
use super::{PLACING, lock, marker, old, staging};
use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::PathBuf;
use std::sync::PoisonError;

/// Renames all files to their targets. After an error all targets are as before.
pub(super) fn put_in_place(moves: &[Move]) -> Result<(), (PathBuf, io::Error)> {
    let folders: BTreeSet<PathBuf> = moves.iter().map(|go| folder_of(&go.target).to_owned()).collect();
    // All runs lock folders in the same order, so that two runs never wait for each other forever. An interruption does
    // not wait for these locks.
    let turn = |folder: &PathBuf| lock::lock_folder(folder).map_err(|error| (folder.clone(), error));
    let _turns: Vec<Option<File>> = folders.iter().map(turn).collect::<Result<_, _>>()?;
    let _placing = PLACING.lock().unwrap_or_else(PoisonError::into_inner);
    // A single renamed file needs no marker, because it is either old or new.
    let several = moves.len() > 1 || moves.iter().any(|go| go.how == How::Overwrite);
    let id = staging::id();
    if several {
        mark(&folders, moves, &id)?;
    }
    let mut undo = Vec::with_capacity(moves.len());
    for go in moves {
        let failed = |error| (go.target.clone(), error);
        let done = old::keep_old(&go.target, go.how).and_then(|old| {
            let done = place::place(go);
            undo.push((go, old));
            done
        });
        if let Err(error) = done.map_err(failed) {
            for (go, old) in undo.into_iter().rev() {
                old.restore(&go.target, go.how);
            }
            unmark(&folders, &id);
            return Err(error);
        }
    }
    folders.iter().for_each(|folder| sync_folder(folder));
    drop(undo);
    if several {
        unmark(&folders, &id);
    }
    Ok(())
}

fn mark(folders: &BTreeSet<PathBuf>, moves: &[Move], id: &str) -> Result<(), (PathBuf, io::Error)> {
    for folder in folders {
        let path = marker::of(folder, id);
        let write = || -> io::Result<()> {
            let text = marker::text(folder, folders, moves)?;
            let (waits, mut file) = staging::create(folder)?;
            let written = file.write_all(&text).and_then(|()| file.sync_all()).and_then(|()| fs::rename(&waits, &path));
            if written.is_err() {
                let _ = fs::remove_file(&waits);
            }
            staging::forget(&waits);
            written
        };
        if let Err(error) = write() {
            unmark(folders, id);
            return Err((path, error));
        }
        sync_folder(folder);
    }
    Ok(())
}
