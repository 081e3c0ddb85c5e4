//! Several outputs that belong together: a program, its report and its page, or all of a batch.
//!
//! Files get their names one by one. While they do, a marker in each folder (`deflex-unfinished-ID.json`) says so and
//! lists them; it is on the disk before the first file gets its name, and goes after the last one has. So at any moment all
//! files are old, or all are new, or the marker is there. The next run that writes to the folder finishes such a set: all
//! that it needs is in the waiting files. Two runs take turns by a lock on the folders.

use super::marker::{Entry, folders, sync_folder, unmark};
use super::place::{self, How};
use super::{lock, marker, old, staging};
use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::PathBuf;

/// Gives every output its name. On an error all targets are as before.
pub(super) fn put_in_place(entries: &[Entry]) -> Result<(), (PathBuf, io::Error)> {
    let folders = folders(entries);
    // In their order, so that two runs never wait for each other.
    let _turn: Vec<Option<File>> = folders.iter().map(|folder| lock::lock_folder(folder)).collect();
    // One file is old or new by itself.
    let several = entries.len() > 1 || entries.iter().any(|entry| entry.how == How::Overwrite);
    if several {
        mark(&folders, entries)?;
    }
    let mut undo = Vec::with_capacity(entries.len());
    for entry in entries {
        let failed = |error| (entry.target.clone(), error);
        let done = old::keep_old(&entry.target, entry.how).and_then(|old| {
            let done = place::place(&entry.waits, &entry.target, entry.how);
            undo.push((entry, old));
            done
        });
        if let Err(error) = done.map_err(failed) {
            for (entry, old) in undo.into_iter().rev() {
                old.restore(&entry.target, entry.how);
            }
            unmark(&folders, lock::run_id());
            return Err(error);
        }
    }
    folders.iter().for_each(|folder| sync_folder(folder));
    drop(undo);
    if several {
        unmark(&folders, lock::run_id());
    }
    Ok(())
}

fn mark(folders: &BTreeSet<PathBuf>, entries: &[Entry]) -> Result<(), (PathBuf, io::Error)> {
    let text = marker::text(entries);
    for folder in folders {
        let path = marker::of(folder, lock::run_id());
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
            unmark(folders, lock::run_id());
            return Err((path, error));
        }
        sync_folder(folder);
    }
    Ok(())
}
