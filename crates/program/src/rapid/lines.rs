//! Splits a program's text into lines, without reading them.

/// Bytes of the body in a chunk, some two hundred targets: what is computed for them then fits into the second-level cache of a core. A
/// quarter of that is no faster, because system calls take the time. The size does not depend on the number of threads: the chunks are
/// always the same.
pub const CHUNK: usize = 32 * 1024;

/// Largest size of the head, and of the modules that every chunk is read with, bytes.
pub(super) const LONGEST_HEAD: usize = 64 * 1024;

/// The text that ends every chunk but the last.
pub(super) const END: &[u8] = b"\nENDPROC\nENDMODULE\n";

/// The line at the start of `bytes`, with its line end.
pub(super) fn line_of(bytes: &[u8]) -> &[u8] {
    &bytes[..memchr::memchr(b'\n', bytes).map_or(bytes.len(), |end| end + 1)]
}

pub(super) fn first_word(text: &[u8]) -> &[u8] {
    &text[..text.iter().position(|b| !b.is_ascii_alphanumeric()).unwrap_or(text.len())]
}

pub(super) fn is_motion(word: &[u8]) -> bool {
    [&b"MoveL"[..], b"MoveJ", b"MoveAbsJ"].iter().any(|motion| motion.eq_ignore_ascii_case(word))
}
