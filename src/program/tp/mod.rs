//! FANUC TP.

use super::Program;
use crate::text::{Diagnostic, Source, Span};

/// Refuses: programs of this language are told from others, and not read.
///
/// # Errors
/// Always.
pub fn read(sources: Vec<Source>, _context: Vec<Source>) -> Result<Program, Vec<Diagnostic>> {
    let refused = |source: &Source| {
        let message = "FANUC TP is recognised, but not read by this version";
        Diagnostic::error("ls.not-read", &source.name, message)
            .at(source, Span::new(0, 0))
            .help("give RAPID or CL data")
    };
    Err(sources.iter().map(refused).collect())
}
