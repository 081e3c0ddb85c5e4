//! Where the sources of the library, the command and the crates are.

use std::path::{Path, PathBuf};

/// `src`, and the `src` of each crate in the order of their names.
pub(crate) fn source_folders() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let entries = std::fs::read_dir(root.join("crates")).unwrap();
    let mut folders: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path().join("src")).collect();
    folders.push(root.join("src"));
    folders.sort();
    folders
}
