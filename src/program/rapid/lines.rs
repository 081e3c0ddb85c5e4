//! Lines of a program's text, without a look at what they mean.

/// Bytes of the body in a chunk: some five hundred targets. A quarter of it is no faster, for all the calls of the system. Not a
/// matter of threads: any number of them sees the same chunks.
pub const CHUNK: usize = 64 * 1024;

/// Ends a chunk that is not the last.
pub(super) const END: &[u8] = b"\nENDPROC\nENDMODULE\n";

/// The line at the start of `bytes`, with its end.
pub(super) fn line_of(bytes: &[u8]) -> &[u8] {
    &bytes[..memchr::memchr(b'\n', bytes).map_or(bytes.len(), |end| end + 1)]
}

pub(super) fn first_word(text: &[u8]) -> &[u8] {
    &text[..text.iter().position(|b| !b.is_ascii_alphanumeric()).unwrap_or(text.len())]
}

pub(super) fn is_motion(word: &[u8]) -> bool {
    [&b"MoveL"[..], b"MoveJ", b"MoveAbsJ"].iter().any(|motion| motion.eq_ignore_ascii_case(word))
}
