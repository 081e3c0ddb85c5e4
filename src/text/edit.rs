use super::Span;
use smallvec::SmallVec;
use std::io::{self, Write};
use std::ops::Range;

/// The text of a token, which is stored in place if it is a number.
pub(crate) type Token = SmallVec<[u8; 24]>;

/// The replacement of a span, which is stored in place if it is a pose.
pub(crate) type Content = SmallVec<[u8; 96]>;

/// Replacement of one span by other bytes.
///
/// # Examples
/// ```
/// use deflex::program::{Change, RewriteOptions, rapid};
/// use deflex::text::Source;
///
/// let program = rapid::read(vec![Source::new("slot.mod", std::fs::read("samples/slot/slot.mod")?)], vec![])?;
/// let mut changes = vec![None; program.targets.len()];
/// changes[0] = Some(Change { position_mm: [0.0, 0.0, 0.1], quat: None, conf: None, external: None });
/// let edits = &program.rewrite(&changes, &[], &RewriteOptions::default()).edits[0];
/// assert!(edits.iter().all(|edit| edit.span.start < edit.span.end));
/// # Ok::<(), deflex::text::Diagnostics>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Edit {
    /// The bytes that are replaced; empty for an insertion.
    pub span: Span,
    pub(crate) content: Content,
}

/// Writes `bytes` with the edits applied, in one pass. All other bytes are copied.
///
/// `edits` must be sorted by start and disjoint; debug builds check this.
///
/// # Errors
/// Every error of writing to `out`.
///
/// # Examples
/// ```
/// use deflex::program::{Change, Goal, RewriteOptions, rapid};
/// use deflex::text::{Source, apply};
///
/// let program = rapid::read(vec![Source::new("slot.mod", std::fs::read("samples/slot/slot.mod")?)], vec![])?;
/// let mut changes = vec![None; program.targets.len()];
/// changes[0] = Some(Change { position_mm: [0.0, 0.0, 0.1], quat: None, conf: None, external: None });
/// let edits = &program.rewrite(&changes, &[], &RewriteOptions::default()).edits[0];
/// let mut text = Vec::new();
/// apply(&program.sources[0].bytes, edits, &mut text)?;
/// assert!(String::from_utf8_lossy(&text).contains("[[0.0000,0.0000,0.1000],"));
/// # Ok::<(), deflex::text::Diagnostics>(())
/// ```
pub fn apply(bytes: &[u8], edits: &[Edit], out: &mut impl Write) -> io::Result<()> {
    apply_within(bytes, 0..bytes.len(), edits, out)
}

/// The bytes with the edits applied.
#[must_use]
pub(crate) fn applied(bytes: &[u8], edits: &[Edit]) -> Vec<u8> {
    let mut out = Vec::with_capacity(bytes.len());
    // Writing to a Vec cannot fail.
    let _ = apply(bytes, edits, &mut out);
    out
}

/// Writes a range of `bytes` with the edits within it, as [`apply`] does.
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
