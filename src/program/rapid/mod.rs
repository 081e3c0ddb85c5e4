//! ABB RAPID.

use super::{Change, Insert, Program, RewriteOptions, Rewritten};
use crate::text::{Diagnostic, Source};

/// Where the number tokens of robtargets stand.
#[derive(Debug, Default)]
pub(crate) struct Layout {}

/// Reads modules as one program with shared names; `context` modules only declare.
///
/// # Errors
/// The program as a whole is refused (encrypted, not RAPID): every reason found.
pub fn read(_sources: Vec<Source>, _context: Vec<Source>) -> Result<Program, Vec<Diagnostic>> {
    Err(Vec::new())
}

pub(super) fn rewrite(
    _program: &Program,
    _layout: &Layout,
    _changes: &[Option<Change>],
    _inserts: &[Insert],
    _options: &RewriteOptions,
) -> Rewritten {
    Rewritten::default()
}
