//! Writes long outputs in large blocks.

use std::fs::File;
use std::io::{self, Write};

/// Blocks of this size that begin at multiples of it take two thirds of the time that the same bytes take in smaller
/// writes. Larger blocks are as cheap only while the system has free memory of their size.
const BLOCK: usize = 64 * 1024;

/// Collects bytes into blocks and writes them to a file. [`Write::flush`] writes the last, incomplete block, so the
/// writer must call it.
#[derive(Debug)]
pub(crate) struct Blocks {
    file: File,
    waiting: Vec<u8>,
}

impl Blocks {
    /// Begins at the start of the file.
    pub(crate) fn new(file: File) -> Self {
        Self { file, waiting: Vec::with_capacity(BLOCK) }
    }

    /// The file, without the bytes that still wait to be written to it.
    pub(crate) fn emptied(&mut self) -> &mut File {
        self.waiting.clear();
        &mut self.file
    }
}

impl Write for Blocks {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.waiting.len() == BLOCK {
            self.flush()?;
        }
        let len = bytes.len().min(BLOCK - self.waiting.len());
        self.waiting.extend_from_slice(&bytes[..len]);
        Ok(len)
    }

    #[inline]
    fn write_all(&mut self, mut bytes: &[u8]) -> io::Result<()> {
        if bytes.len() > BLOCK - self.waiting.len() {
            let (first, rest) = bytes.split_at(BLOCK - self.waiting.len());
            self.waiting.extend_from_slice(first);
            self.flush()?;
            // Complete blocks are written directly.
            let blocks = rest.chunks_exact(BLOCK);
            bytes = blocks.remainder();
            for block in blocks {
                self.file.write_all(block)?;
            }
        }
        self.waiting.extend_from_slice(bytes);
        Ok(())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.write_all(&self.waiting)?;
        self.waiting.clear();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Read, Seek};

    #[test]
    fn a_file_gets_all_bytes_in_their_order() {
        let mut file = tempfile::tempfile().unwrap();
        let text: Vec<u8> = (0..3 * BLOCK + 7).map(|i| (i % 251) as u8).collect();
        for step in [1000, BLOCK - 1, BLOCK, 2 * BLOCK, text.len()] {
            let mut blocks = Blocks::new(file.try_clone().unwrap());
            text.chunks(step).for_each(|chunk| blocks.write_all(chunk).unwrap());
            let whole = file.metadata().unwrap().len();
            assert!(whole.is_multiple_of(BLOCK as u64), "{whole}");
            blocks.flush().unwrap();
            let mut read = Vec::new();
            file.rewind().unwrap();
            file.read_to_end(&mut read).unwrap();
            assert!(read == text, "{step}");
            file.set_len(0).unwrap();
            file.rewind().unwrap();
        }
    }
}
