//! Whether bytes are text.

/// A byte with which no text begins, but encrypted modules do.
#[doc(hidden)]
pub const ENCRYPTED: u8 = 0xF0;

/// The offset at which a file shows that it is no text: its first byte, or a control character, of which real files have few.
#[doc(hidden)]
pub fn no_text(bytes: &[u8]) -> Option<usize> {
    /// Number of bytes that are examined at the beginning.
    const LOOK: usize = 64 * 1024;
    /// Least number of bytes for each control character in a text.
    const BYTES_PER_CONTROL: usize = 100;
    let control = |b: &u8| b.is_ascii_control() && !b.is_ascii_whitespace();
    let start = if bytes.starts_with(b"\xEF\xBB\xBF") { 3 } else { 0 };
    if bytes.get(start).is_some_and(|b| *b >= ENCRYPTED) {
        return Some(start);
    }
    // The last block of a file may be filled with NUL, or with the character for the end of a file.
    let filled = bytes.iter().rev().take_while(|b| matches!(b, 0 | 0x1A)).count();
    let head = &bytes[..(bytes.len() - filled).min(LOOK)];
    let count = head.iter().filter(|b| control(b)).count();
    if count * BYTES_PER_CONTROL > head.len() { head.iter().position(control) } else { None }
}
