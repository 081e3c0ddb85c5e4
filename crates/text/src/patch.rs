//! Replaces ranges of a file that is too long to be held in memory.

use std::io::{self, BufRead, BufReader, BufWriter, Read, Seek, SeekFrom, Write};

/// Number of bytes that are read or written at once.
const AT_ONCE: usize = 64 * 1024;

/// Replacements of ranges of a file. The new texts are in a scratch file; only their positions are in memory.
///
/// # Examples
/// ```
/// use deflex_text::Patch;
/// use std::io::Cursor;
///
/// let (mut patch, mut out) = (Patch::new(Cursor::new(vec![])), Vec::new());
/// patch.replace(6, 3, b"10.25")?;
/// patch.apply(&b"MoveL 100, 200"[..], &mut out)?;
/// assert_eq!(out, b"MoveL 10.25, 200");
/// # Ok::<(), std::io::Error>(())
/// ```
#[derive(Debug)]
pub struct Patch<S: Write> {
    scratch: BufWriter<S>,
    /// Number of bytes in the scratch file.
    waiting: u64,
    parts: Vec<Replacement>,
}

/// One replacement: the range of `old` bytes from `start`, and the range of its new text in the scratch file.
#[derive(Clone, Copy, Debug)]
struct Replacement {
    start: u64,
    waits: u64,
    old: u32,
    new: u32,
}

impl<S: Read + Write + Seek> Patch<S> {
    /// A patch without replacements. `scratch` must be empty.
    pub fn new(scratch: S) -> Self {
        Self { scratch: BufWriter::with_capacity(AT_ONCE, scratch), waiting: 0, parts: Vec::new() }
    }

    /// Replaces `old` bytes from `start` on. Replacements can come in any order, but must be disjoint.
    ///
    /// # Errors
    /// Every error of the scratch file; a text of more than 4 GiB.
    pub fn replace(&mut self, start: u64, old: u32, text: &[u8]) -> io::Result<()> {
        let new = u32::try_from(text.len()).map_err(|_| io::ErrorKind::FileTooLarge)?;
        self.scratch.write_all(text)?;
        self.parts.push(Replacement { start, waits: self.waiting, old, new });
        self.waiting += text.len() as u64;
        Ok(())
    }

    /// Writes `original` with all replacements.
    ///
    /// # Errors
    /// Every error of the three files.
    pub fn apply(mut self, original: impl Read, out: &mut impl Write) -> io::Result<()> {
        self.parts.sort_unstable_by_key(|part| part.start);
        let mut scratch = self.scratch.into_inner().map_err(io::IntoInnerError::into_error)?;
        scratch.rewind()?;
        let (mut scratch, mut at) = (BufReader::with_capacity(AT_ONCE, scratch), 0);
        let (mut original, mut done) = (BufReader::with_capacity(AT_ONCE, original), 0);
        for part in &self.parts {
            pass(&mut original, part.start - done, out)?;
            pass(&mut original, part.old.into(), &mut io::sink())?;
            done = part.start + u64::from(part.old);
            // Usually the next text follows the last one, and what was read ahead stays valid.
            if part.waits != at {
                scratch.seek(SeekFrom::Start(part.waits))?;
            }
            pass(&mut scratch, part.new.into(), out)?;
            at = part.waits + u64::from(part.new);
        }
        io::copy(&mut original, out)?;
        out.flush()
    }
}

/// Copies a number of bytes between buffers. `io::copy` would make a system call for each range.
fn pass(from: &mut impl BufRead, mut count: u64, out: &mut impl Write) -> io::Result<()> {
    while count > 0 {
        let bytes = from.fill_buf()?;
        if bytes.is_empty() {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        let len = bytes.len().min(usize::try_from(count).unwrap_or(usize::MAX));
        out.write_all(&bytes[..len])?;
        from.consume(len);
        count -= len as u64;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::io::Cursor;

    proptest! {
        #[test]
        fn a_patch_in_any_order_is_the_edits_in_theirs(
            stretches in prop::collection::vec((0..9_usize, 1..9_usize, "[a-z]{0,9}"), 0..9),
            turn in 0..9_usize,
        ) {
            let (mut original, mut expected, mut parts) = (String::new(), String::new(), Vec::new());
            for (kept, old, new) in &stretches {
                original += &"-".repeat(*kept);
                expected += &"-".repeat(*kept);
                parts.push((original.len() as u64, *old as u32, new));
                original += &"x".repeat(*old);
                expected += new;
            }
            parts.rotate_left(turn.min(stretches.len()));
            let mut patch = Patch::new(Cursor::new(Vec::new()));
            for (start, old, new) in parts {
                patch.replace(start, old, new.as_bytes()).unwrap();
            }
            let mut out = Vec::new();
            patch.apply(original.as_bytes(), &mut out).unwrap();
            prop_assert_eq!(String::from_utf8(out).unwrap(), expected);
        }
    }
}
