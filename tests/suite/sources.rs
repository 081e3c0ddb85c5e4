//! Where the sources of the library, the command and the crates are, and what a folder contains.

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

/// Every file in a folder and in the folders below it.
pub(crate) fn files_below(folder: impl Into<PathBuf>) -> Vec<PathBuf> {
    let (mut open, mut files) = (vec![folder.into()], Vec::new());
    while let Some(folder) = open.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() { open.push(path) } else { files.push(path) }
        }
    }
    files
}

/// Every file below a folder whose name has this ending.
pub(crate) fn files_with_ending(folder: impl Into<PathBuf>, ending: &str) -> Vec<PathBuf> {
    let mut files = files_below(folder);
    files.retain(|file| file.extension().is_some_and(|own| own == ending));
    files
}

/// The files of the sources with their code, without the tests at its end.
pub(crate) fn code_without_tests() -> impl Iterator<Item = (PathBuf, String)> {
    let files = source_folders().into_iter().flat_map(|folder| files_with_ending(folder, "rs"));
    files.filter(|path| !path.ends_with("tests.rs")).map(|path| {
        let text = std::fs::read_to_string(&path).unwrap();
        let code = text.split("\n#[cfg(test)]\nmod tests {").next().unwrap().to_owned();
        (path, code)
    })
}
