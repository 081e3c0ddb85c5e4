use super::Span;
use smallvec::SmallVec;
use std::io::{self, Write};
use std::ops::Range;

/// The text of a token, which is stored in place if it is a number.
#[doc(hidden)]
pub type Token = SmallVec<[u8; 24]>;

/// The replacement of a span, which is stored in place if it is a pose.
#[doc(hidden)]
pub type Content = SmallVec<[u8; 96]>;

/// Replacement of one span by other bytes.
///
/// # Examples
/// ```
/// use deflex_text::{Edit, Span};
///
/// // Replaces the third byte.
/// let edit = Edit::new(Span::new(2, 3), b"2.5");
/// assert_eq!(edit.span.len(), 1);
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Edit {
    /// The bytes that are replaced; empty for an insertion.
    pub span: Span,
    #[doc(hidden)]
    pub content: Content,
}

impl Edit {
    /// The replacement of a span by `content`.
    #[must_use]
    pub fn new(span: Span, content: &[u8]) -> Self {
        Self { span, content: Content::from_slice(content) }
    }
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
/// use deflex_text::{Edit, Span, apply};
///
/// let edits = [Edit::new(Span::new(2, 3), b"2.5")];
/// let mut text = Vec::new();
/// apply(b"[[0,1],[2,3]]", &edits, &mut text)?;
/// assert_eq!(text, b"[[2.5,1],[2,3]]");
/// # Ok::<(), std::io::Error>(())
/// ```
pub fn apply(bytes: &[u8], edits: &[Edit], out: &mut impl Write) -> io::Result<()> {
    apply_within(bytes, 0..bytes.len(), edits, out)
}

/// The bytes with the edits applied.
#[must_use]
#[doc(hidden)]
pub fn applied(bytes: &[u8], edits: &[Edit]) -> Vec<u8> {
    let mut out = Vec::with_capacity(bytes.len());
    // Writing to a Vec cannot fail.
    let _ = apply(bytes, edits, &mut out);
    out
}

/// Writes a range of `bytes` with the edits within it, as [`apply`] does.
#[doc(hidden)]
pub fn apply_within(bytes: &[u8], stretch: Range<usize>, edits: &[Edit], out: &mut impl Write) -> io::Result<()> {
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
