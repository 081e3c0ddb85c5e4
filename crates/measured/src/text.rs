//! Converts the line ends of a table to line feeds, because a CSV reader counts line feeds.

use std::io::{Read, Result};

/// Converts line ends of all systems to line feeds, and adds one at the end of the last line. The line numbers of a CSV
/// reader are then those of the file.
pub(super) struct LineFeeds<R> {
    inner: R,
    last: Option<u8>,
    ended: bool,
}

impl<R> LineFeeds<R> {
    pub(super) fn new(inner: R) -> Self {
        Self { inner, last: None, ended: false }
    }
}

impl<R: Read> Read for LineFeeds<R> {
    fn read(&mut self, out: &mut [u8]) -> Result<usize> {
        while !self.ended && !out.is_empty() {
            let read = self.inner.read(out)?;
            if read == 0 {
                self.ended = true;
                if self.last.is_some_and(|last| !matches!(last, b'\n' | b'\r')) {
                    out[0] = b'\n';
                    return Ok(1);
                }
                break;
            }
            let mut kept = 0;
            for i in 0..read {
                let byte = out[i];
                // Of a carriage return and a line feed, the carriage return is converted and the line feed is dropped.
                if !(byte == b'\n' && self.last == Some(b'\r')) {
                    out[kept] = if byte == b'\r' { b'\n' } else { byte };
                    kept += 1;
                }
                self.last = Some(byte);
            }
            if kept > 0 {
                return Ok(kept);
            }
        }
        Ok(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_line_ends_with_one_line_feed() {
        for (text, expected) in
            [("a\r\nb\r\n", "a\nb\n"), ("a\rb", "a\nb\n"), ("a\n\r\nb\n", "a\n\nb\n"), ("", ""), ("\r\n\n", "\n\n")]
        {
            for size in 1..4 {
                let (mut reader, mut all) = (LineFeeds::new(text.as_bytes()), Vec::new());
                let mut piece = vec![0; size];
                while let n @ 1.. = reader.read(&mut piece).unwrap() {
                    all.extend_from_slice(&piece[..n]);
                }
                assert_eq!(String::from_utf8(all).unwrap(), expected, "{text:?} by {size}");
            }
        }
    }
}
