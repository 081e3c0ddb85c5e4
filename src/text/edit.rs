use super::Span;
use smallvec::SmallVec;
use std::io::{self, Write};
use std::ops::Range;

/// A token's text: a number has room in place.
pub(crate) type Token = SmallVec<[u8; 24]>;

/// What stands instead of a span: a pose has room in place.
pub(crate) type Content = SmallVec<[u8; 96]>;

/// Replacement of one span by other bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Edit {
    /// What is replaced; empty to insert.
    pub span: Span,
    pub(crate) content: Content,
}

/// Writes `bytes` with `edits` applied, in one pass front to back; all else byte for byte.
///
/// `edits` must be sorted by start and disjoint: a caller's invariant, checked in debug builds.
///
/// # Errors
/// What `out` reports.
pub fn apply(bytes: &[u8], edits: &[Edit], out: &mut impl Write) -> io::Result<()> {
    apply_within(bytes, 0..bytes.len(), edits, out)
}

/// The same as bytes.
#[must_use]
pub(crate) fn applied(bytes: &[u8], edits: &[Edit]) -> Vec<u8> {
    let mut out = Vec::with_capacity(bytes.len());
    // Writing to a Vec cannot fail.
    let _ = apply(bytes, edits, &mut out);
    out
}

/// Writes a stretch of `bytes` with `edits`, all of them within it, as [`apply`] does.
pub(crate) fn apply_within(
    bytes: &[u8],
    stretch: Range<usize>,
    edits: &[Edit],
    out: &mut impl Write,
) -> io::Result<()> {
    let mut done = stretch.start;
    for edit in edits {
        let range = edit.span.range();
        debug_assert!(range.start >= done, "edits overlap or are unsorted at {}", range.start);
        out.write_all(&bytes[done..range.start])?;
        out.write_all(&edit.content)?;
        done = range.end;
    }
    out.write_all(&bytes[done..stretch.end])
}
