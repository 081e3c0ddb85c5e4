//! The line of a place in a text.

/// Where the line begins.
pub(crate) fn line_start(bytes: &[u8], at: usize) -> usize {
    memchr::memrchr2(b'\n', b'\r', &bytes[..at]).map_or(0, |end| end + 1)
}

/// The blanks at its start, up to the place.
pub(crate) fn indent(bytes: &[u8], at: usize) -> &[u8] {
    let line = &bytes[line_start(bytes, at)..at];
    &line[..line.iter().take_while(|byte| matches!(byte, b' ' | b'\t')).count()]
}

/// How it ends, and the number of bytes up to the next line.
pub(crate) fn line_end(bytes: &[u8], at: usize) -> (&[u8], usize) {
    let rest = &bytes[at..];
    let end = memchr::memchr2(b'\n', b'\r', rest).unwrap_or(rest.len());
    let returns = rest[end..].iter().take_while(|byte| **byte == b'\r').count();
    let feed = rest.get(end + returns) == Some(&b'\n');
    // A carriage return alone ends a line.
    let len = if feed { returns + 1 } else { returns.min(1) };
    (if len == 0 { b"\n" } else { &rest[end..end + len] }, end + len)
}
