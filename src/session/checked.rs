//! Checks a program against tolerances, with the answer in memory.

use super::tolerances::{Found, Programs, Tolerances};
use super::{CellFile, ProgramFiles, Run};
use crate::session::long::Long;
use crate::session::report::{pretty, write_joined};
use deflex::correct::WayFault;
use deflex::report::html::{PathKind, PathTrace};
use deflex::report::{CheckFile, FileSummary, Origin, check_json, check_text, junit, sarif};
use deflex::text::Diagnostic;
use std::sync::Arc;

/// The cell of a run, with the limit of the correction that a check states for programs without an original.
pub(crate) fn limited(
    cell: &Arc<CellFile>,
    tolerances: &Tolerances,
    has_original: bool,
) -> Result<Arc<CellFile>, Vec<Diagnostic>> {
    let Some(most) = tolerances.max_correction.filter(|_| !has_original) else { return Ok(Arc::clone(cell)) };
    let mut limited = CellFile::parse(cell.source.clone())?;
    limited.cell.limits.max_correction = 1e-3 * most;
    Ok(Arc::new(limited))
}

/// What a check found in one program.
///
/// # Examples
/// ```
/// use deflex::session::{Tolerances, check};
/// # let (program, run) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/run.rs"));
/// let checked = check(&program, None, &run, &Tolerances { max_error: 0.02, ..Tolerances::default() })?;
/// assert!(!checked.file.passed() && checked.text().contains("exceeded"));
/// assert!(checked.csv.starts_with(b"target,") && checked.notes.is_empty());
/// assert!(checked.json()?.contains("verdicts") && checked.sarif()?.contains("sarif") && checked.junit().contains("<testcase"));
/// # Ok::<(), deflex::text::Diagnostics>(())
/// ```
#[derive(Debug)]
#[non_exhaustive]
pub struct Checked {
    /// The findings and the verdicts.
    pub file: CheckFile,
    /// The report as `--report` writes it.
    pub csv: Vec<u8>,
    /// Warnings and notes of the run.
    pub notes: Vec<Diagnostic>,
    cell: Origin,
    /// Summary and path, if a page is wanted.
    path: Option<(FileSummary, PathTrace)>,
}

impl Checked {
    /// The text that the command prints.
    #[must_use]
    pub fn text(&self) -> String {
        check_text(std::slice::from_ref(&self.file))
    }

    /// The text that `--json` writes.
    ///
    /// # Errors
    /// It cannot be written as JSON.
    pub fn json(&self) -> Result<String, Vec<Diagnostic>> {
        pretty(&answer_json(&self.cell, std::slice::from_ref(&self.file)))
    }

    /// The text that `--output-format sarif` prints.
    ///
    /// # Errors
    /// It cannot be written as JSON.
    pub fn sarif(&self) -> Result<String, Vec<Diagnostic>> {
        pretty(&sarif(std::slice::from_ref(&self.file)))
    }

    /// The text that `--output-format junit` prints.
    #[must_use]
    pub fn junit(&self) -> String {
        junit(std::slice::from_ref(&self.file))
    }
}

/// The JSON of all findings, with the origins of the inputs.
pub(crate) fn answer_json(cell: &Origin, files: &[CheckFile]) -> serde_json::Value {
    let mut all = check_json(files);
    all["cell"] = serde_json::json!(cell);
    all
}

/// Checks a program, as `deflex check` does. `against` is the original of a corrected program; errors are then counted
/// from its targets.
///
/// # Errors
/// Every error for which the command ends with exit code 2, and `run.called-off` after a cancellation. Findings are no
/// errors.
///
/// # Examples
/// ```
/// use deflex::session::{Tolerances, check};
/// # let (program, run) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/run.rs"));
/// let wide = Tolerances { max_error: 5.0, ..Tolerances::default() };
/// assert!(check(&program, None, &run, &wide)?.file.passed());
/// # Ok::<(), deflex::text::Diagnostics>(())
/// ```
pub fn check(
    program: &ProgramFiles,
    against: Option<&ProgramFiles>,
    run: &Run,
    tolerances: &Tolerances,
) -> Result<Checked, Vec<Diagnostic>> {
    program.marked()?;
    let mut run = run.clone();
    run.setup.cell = limited(&run.setup.cell, tolerances, against.is_some())?;
    let long = match Long::of(program, &run) {
        Some(long) => long.check(against, tolerances),
        None => Ok(None),
    };
    let found = long.and_then(|found| found.map_or_else(|| whole(program, against, &run, tolerances), Ok));
    let (mut found, csv) = found.map_err(|errors| run.setup.failed(run.setup.cell.own(errors)))?;
    let mut notes = run.setup.notes();
    add_notes(&mut notes, found.notes);
    found.file.sources = program.origins();
    if let Some((summary, _)) = &mut found.path {
        summary.sources.clone_from(&found.file.sources);
    }
    let (cell, notes) = (run.setup.cell.origin(), run.setup.cell.own(notes));
    Ok(Checked { file: found.file, csv, notes, cell, path: found.path })
}

/// The page that `deflex check --html` writes. The program is run anew, because the page also shows the stiffness along
/// the path.
///
/// # Errors
/// Those of [`check`].
///
/// # Examples
/// ```
/// use deflex::session::{Tolerances, check_page};
/// # let (program, run) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/run.rs"));
/// let page = check_page(&program, None, &run, &Tolerances { max_error: 0.02, ..Tolerances::default() })?;
/// assert!(page.starts_with("<!DOCTYPE html>"));
/// # Ok::<(), deflex::text::Diagnostics>(())
/// ```
pub fn check_page(
    program: &ProgramFiles,
    against: Option<&ProgramFiles>,
    run: &Run,
    tolerances: &Tolerances,
) -> Result<String, Vec<Diagnostic>> {
    let run = run.drawing();
    let checked = check(program, against, &run, tolerances)?;
    Ok(run.page(PathKind::Check, checked.path, Some(tolerances.max_error)))
}

fn whole(
    files: &ProgramFiles,
    against: Option<&ProgramFiles>,
    run: &Run,
    tolerances: &Tolerances,
) -> Result<(Found, Vec<u8>), Vec<Diagnostic>> {
    let original = against.map(|original| run.parse(original)).transpose()?;
    let program = run.parse(files)?;
    let programs = Programs { name: files.name(), program: &program, original: original.as_ref() };
    let found = tolerances.whole(&programs, &run.setup, &run.options_followed(files), run.path(PathKind::Check))?;
    let mut csv = Vec::new();
    // Writing to a Vec cannot fail.
    let _ = write_joined(found.rows.as_slice(), &mut csv);
    Ok((found, csv))
}

/// Adds notes on a program that are new. Faults of the path between targets are findings, so the notes about them are
/// left out.
pub(crate) fn add_notes(notes: &mut Vec<Diagnostic>, more: Vec<Diagnostic>) {
    let is_new = |note: &Diagnostic| !WayFault::is_code(note.code) && !notes.contains(note);
    let more: Vec<Diagnostic> = more.into_iter().filter(is_new).collect();
    notes.extend(more);
}
