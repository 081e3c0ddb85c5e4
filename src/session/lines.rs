//! Reads single lines of a program that is too long to be held in memory.

use deflex::report::html::PathTrace;
use deflex::text::Source;
use std::collections::{BTreeMap, BTreeSet};
use std::io::{BufRead, BufReader, Read};

/// Lines are cut after this many bytes.
const LONGEST: usize = 1000;

/// The text of the wanted lines, counted from 1, as far as the input has them. The input is read once, and only the
/// wanted lines take memory. Lines end as in [`Source::line_column`]: with CR LF, LF, CR CR LF or a lone CR.
pub(crate) fn read(input: impl BufRead, wanted: &BTreeSet<u32>) -> BTreeMap<u32, String> {
    let mut reader = Reader { input, line: 1, after_cr: false };
    let text = |line: &u32| Some((*line, Source::new("", reader.line(*line)?).line_at(0).into_owned()));
    wanted.iter().map_while(text).collect()
}

/// Adds the lines of the program to its page.
pub(crate) fn quote(path: &mut PathTrace, file: impl Read) {
    // The path visits lines in running order, so the wanted lines are collected first and then read in one pass.
    let mut wanted = BTreeSet::new();
    path.quote(|_, line| {
        wanted.insert(line);
        None
    });
    let lines = self::read(BufReader::new(file), &wanted);
    path.quote(|_, line| lines.get(&line).cloned());
}

struct Reader<R> {
    input: R,
    /// Number of the line to which the next byte belongs, from 1.
    line: u32,
    /// The last byte was a CR, which may have ended its line: then a LF that follows belongs to the same line end.
    after_cr: bool,
}

impl<R: BufRead> Reader<R> {
    /// Reads a line that is not before the last one read; `None` if the input has fewer lines.
    fn line(&mut self, wanted: u32) -> Option<Vec<u8>> {
        let mut text = Vec::new();
        loop {
            let bytes = self.input.fill_buf().ok()?;
            if bytes.is_empty() {
                return (self.line == wanted).then_some(text);
            }
            let mut taken = 0;
            for &byte in bytes {
                let ended_before = self.after_cr && !matches!(byte, b'\n' | b'\r');
                self.line += u32::from(ended_before);
                self.after_cr = false;
                if self.line > wanted {
                    break;
                }
                taken += 1;
                match byte {
                    b'\n' => self.line += 1,
                    b'\r' => self.after_cr = true,
                    _ if self.line == wanted && text.len() < LONGEST => text.push(byte),
                    _ => {}
                }
                if self.line > wanted {
                    break;
                }
            }
            self.input.consume(taken);
            if self.line > wanted {
                return Some(text);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::read;
    use deflex::text::Source;
    use std::collections::BTreeMap;
    use std::io::BufReader;

    #[test]
    fn lines_are_those_of_a_source_however_they_end() {
        let text = "a\nbc\r\nd\r\r\n\ne\rf\r\n\u{e4}";
        let source = Source::new("", text);
        let mut lines: BTreeMap<u32, String> = (1..=7).map(|line| (line, String::new())).collect();
        for at in 0..text.len() {
            if !matches!(source.bytes[at], b'\n' | b'\r') {
                lines.insert(source.line_column(at).line as u32, source.line_at(at).into_owned());
            }
        }
        for buffer in 1..9 {
            for step in 1..4 {
                let wanted = (1..=7).step_by(step).collect();
                let found = read(BufReader::with_capacity(buffer, text.as_bytes()), &wanted);
                assert_eq!(
                    found,
                    lines.iter().filter(|(line, _)| wanted.contains(line)).map(|(l, t)| (*l, t.clone())).collect()
                );
            }
            // Beyond the end there is nothing.
            assert_eq!(
                read(BufReader::with_capacity(buffer, text.as_bytes()), &[2, 8].into()),
                [(2, lines[&2].clone())].into()
            );
        }
    }
}
