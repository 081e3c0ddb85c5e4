//! The bytes of a corrected program.

use deflex::cell::Cell;
use deflex::correct::{Corrected, Options, PostOptions, RAPID_MM_S, compensate, compensate_driven, post};
use deflex::program::{Language, Program};
use deflex::text::Diagnostic;
use std::path::{Path, PathBuf};

/// Files of a corrected program under their names, and notes about them.
pub(crate) struct Written {
    pub(crate) files: Vec<(PathBuf, Vec<u8>)>,
    pub(crate) notes: Vec<Diagnostic>,
}

/// The correction of a program.
pub(crate) struct Edited {
    /// The program that is edited, if it is not the given one.
    pub(crate) shaped: Option<Program>,
    pub(crate) corrected: Corrected,
}

impl Edited {
    /// Corrects a program. `max_path_error` is the largest distance of the driven path from the programmed one, m.
    ///
    /// # Errors
    /// A target has no correction, or the path cannot be kept within the distance.
    pub(crate) fn new(
        program: &Program,
        cell: &Cell,
        options: &Options,
        max_path_error: Option<f64>,
    ) -> Result<Self, Vec<Diagnostic>> {
        let edited = match max_path_error {
            Some(most) => {
                let driven = compensate_driven(program, cell, options, most)?;
                Self { shaped: Some(driven.program), corrected: driven.corrected }
            }
            None => Self { shaped: None, corrected: compensate(program, cell, options)? },
        };
        if edited.corrected.failures.is_empty() { Ok(edited) } else { Err(edited.corrected.failures) }
    }
}

/// Edits or posts a corrected program.
pub(crate) fn written(
    program: &Program,
    corrected: &Corrected,
    cell: &Cell,
    files: &[PathBuf],
    post_options: impl FnOnce() -> PostOptions,
) -> Result<Written, Vec<Diagnostic>> {
    if !program.language.is_edited() {
        let posted = post(program, cell, corrected, &post_options())?;
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
