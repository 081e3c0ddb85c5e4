use super::Source;

/// The start of each line of a source, to find the line of an offset in logarithmic time.
#[derive(Clone, Debug)]
#[doc(hidden)]
pub struct LineIndex {
    starts: Vec<u32>,
    before: usize,
}

impl LineIndex {
    /// Reads the source once. CR LF, LF, CR CR LF and a single CR end a line, as in [`Source::line_column`].
    #[must_use]
    pub fn new(source: &Source) -> Self {
        let bytes = &source.bytes;
        let mut starts = Vec::new();
        for (at, &byte) in bytes.iter().enumerate() {
            let ends = match byte {
                b'\n' => true,
                b'\r' => !matches!(bytes.get(at + 1), Some(b'\n' | b'\r')),
                _ => false,
            };
            if ends {
                starts.push(u32::try_from(at + 1).unwrap_or(u32::MAX));
            }
        }
        Self { starts, before: source.lines_before }
    }

    /// The line of an offset, from 1.
    #[must_use]
    pub fn line(&self, offset: u32) -> u32 {
        let line = self.starts.partition_point(|&start| start <= offset) + self.before + 1;
        u32::try_from(line).unwrap_or(u32::MAX)
    }
}

/// The lines of a text, without the line feeds between them.
#[doc(hidden)]
pub fn lines(bytes: &[u8]) -> impl Iterator<Item = &[u8]> {
    let mut start = 0;
    let ends = memchr::memchr_iter(b'\n', bytes).chain([bytes.len()]);
    ends.map(move |end| &bytes[std::mem::replace(&mut start, end + 1)..end])
}
