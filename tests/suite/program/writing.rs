//! Changes of programs, and the text with them.

use deflex::program::{Change, Insert, Program, Reason, RewriteOptions};
use deflex::text::applied;

/// Moves a target to a position.
pub(super) fn to(position_mm: [f64; 3]) -> Option<Change> {
    Some(Change { position_mm, quat: None, conf: None, external: None })
}

/// The text with these changes and inserts, and the targets whose changes are not written.
pub(super) fn written(
    program: &Program,
    changes: &[Option<Change>],
    inserts: &[Insert],
) -> (String, Vec<(usize, Reason)>) {
    let rewritten = program.rewrite(changes, inserts, &RewriteOptions::default());
    let out = applied(&program.sources[0].bytes, &rewritten.edits[0]);
    (String::from_utf8(out).unwrap(), rewritten.kept)
}
