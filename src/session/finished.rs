//! The results of a program that was held as a whole.

use super::report::{Noticed, Rows};
use deflex::correct::Corrected;
use deflex::program::Program;
use deflex::report::html::PathTrace;
use deflex::report::{Digest, FileSummary};
use deflex::text::Diagnostic;

/// What a run reports about one program.
pub(crate) struct Finished {
    pub(crate) rows: Rows,
    pub(crate) summary: FileSummary,
    pub(crate) notes: Vec<Diagnostic>,
    /// The path, if it is drawn on a page.
    pub(crate) path: Option<PathTrace>,
    /// The targets with the largest errors.
    pub(crate) digest: Digest,
}

impl Finished {
    /// The results of the program `name`. `path` is an empty path to fill.
    ///
    /// # Errors
    /// Targets that the cell does not solve; a program that has been corrected already.
    pub(crate) fn new(
        name: &str,
        program: &Program,
        corrected: Corrected,
        mut path: Option<PathTrace>,
        mut noticed: Noticed<'_>,
    ) -> Result<Self, Vec<Diagnostic>> {
        if !corrected.failures.is_empty() {
            return Err(corrected.failures);
        }
        noticed.take(&corrected.rows);
        let of_rows = noticed.notes(name)?;
        let summary = FileSummary::new(name, &corrected);
        let rows = Rows::new(&corrected.rows);
        if let Some(path) = &mut path {
            rows.draw(path, &corrected.rows);
            path.quote(|target, _| program.line_of(target));
        }
        let notes = corrected.notes.into_iter().chain(of_rows).collect();
        Ok(Self { rows, summary, notes, path, digest: noticed.into_digest() })
    }
}
