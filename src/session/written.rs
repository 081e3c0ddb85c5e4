//! The bytes of a corrected program.

use deflex::cell::Cell;
use deflex::correct::{self, Corrected, PostOptions, RAPID_MM_S};
use deflex::program::{Language, Program};
use deflex::text::Diagnostic;
use std::path::{Path, PathBuf};

/// Files of a corrected program under their names, and notes about them.
pub(crate) struct Written {
    pub(crate) files: Vec<(PathBuf, Vec<u8>)>,
    pub(crate) notes: Vec<Diagnostic>,
}

/// Edits or posts a corrected program.
pub(crate) fn written(
    program: &Program,
    corrected: &Corrected,
    cell: &Cell,
    files: &[PathBuf],
    post: impl FnOnce() -> PostOptions,
) -> Result<Written, Vec<Diagnostic>> {
    if !program.language.is_edited() {
        let posted = correct::post(program, cell, corrected, &post())?;
        let files = posted.files.into_iter().map(|(name, bytes)| (name.into(), bytes)).collect();
        return Ok(Written { files, notes: posted.notes });
    }
    let edits = corrected.rewritten.as_ref().map_or(&[][..], |rewritten| &rewritten.edits[..]);
    let edited = program.edited(edits).into_iter().take(program.written);
    let files = edited.zip(files).map(|(source, file)| (file.clone(), source.bytes)).collect();
    Ok(Written { files, notes: Vec::new() })
}

/// Settings for posting CL data from `file` as a RAPID program that is named after the file `named`.
pub(crate) fn posted_from(file: &Path, named: &Path) -> PostOptions {
    let stem = named.file_stem().unwrap_or(named.as_os_str()).to_string_lossy().into_owned();
    PostOptions {
        name: if stem == "-" { "program".to_owned() } else { stem },
        title: vec![format!("posted by deflex {} from {}", env!("CARGO_PKG_VERSION"), file.display())],
        max_targets: None,
        rapid_mm_s: RAPID_MM_S,
        feed_mm_s: None,
        language: Language::Rapid,
    }
}
