use super::ProgramFiles;
use crate::session::read::both;
use crate::session::report::pretty;
use deflex::program::Program;
use deflex::report::html::diff_page;
use deflex::report::{Difference, diff_csv, diff_summary, diff_text, difference};
use deflex::text::Diagnostic;

/// What changed between two programs.
///
/// # Examples
/// ```
/// use deflex::session::{ProgramFiles, diff};
///
/// let program = ProgramFiles::read(&["samples/slot/slot.mod".into()], &[], None)?;
/// let same = diff(&program, &program)?;
/// assert!(same.found.is_empty() && same.text().contains("the programs are the same") && same.summary() == same.text());
/// assert!(same.csv().starts_with(b"target,") && same.json()?.contains("\"moved\": []"));
/// assert!(same.page().starts_with("<!DOCTYPE html>"));
/// # Ok::<(), deflex::text::Diagnostics>(())
/// ```
#[derive(Debug)]
#[non_exhaustive]
pub struct Compared {
    /// The differences.
    pub found: Difference,
    original: Program,
    corrected: String,
}

impl Compared {
    /// The table that `--report` writes.
    #[must_use]
    pub fn csv(&self) -> Vec<u8> {
        diff_csv(&self.found).into_bytes()
    }

    /// The text that `--json` writes.
    ///
    /// # Errors
    /// It cannot be written as JSON.
    pub fn json(&self) -> Result<String, Vec<Diagnostic>> {
        pretty(&self.found)
    }

    /// The page that `--html` writes.
    #[must_use]
    pub fn page(&self) -> String {
        diff_page(&self.original, &self.corrected, &self.found)
    }

    /// The text that the command writes to a file or pipe: all differences.
    #[must_use]
    pub fn text(&self) -> String {
        diff_text(&self.found)
    }

    /// The text that the command shows on a terminal: the largest differences.
    #[must_use]
    pub fn summary(&self) -> String {
        diff_summary(&self.found)
    }
}

/// Compares two programs target by target, as `deflex diff` does.
///
/// # Errors
/// Every error for which the command ends with exit code 2.
///
/// # Examples
/// ```
/// use deflex::session::diff;
/// # let (program, _) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/run.rs"));
/// assert!(diff(&program, &program)?.found.moved.is_empty());
/// # Ok::<(), deflex::text::Diagnostics>(())
/// ```
pub fn diff(original: &ProgramFiles, corrected: &ProgramFiles) -> Result<Compared, Vec<Diagnostic>> {
    let (first, second) = both(original.parse_alone(), corrected.parse_alone())?;
    let found = difference(&first, &second);
    Ok(Compared { found, original: first, corrected: corrected.name().to_owned() })
}
