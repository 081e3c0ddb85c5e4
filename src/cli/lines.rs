//! Lines of a program that is too long to be held.

use deflex::report::html::PathTrace;
use deflex::text::Source;
use std::collections::{BTreeMap, BTreeSet};
use std::io::{BufRead, BufReader, Read};

/// No line is held further than this.
const LONGEST: usize = 1000;

/// The wanted lines, from 1, as far as they can be read: one pass, and no more memory than they take. Lines end as in
/// [`Source::line_column`]: with CR LF, LF, CR CR LF or a lone CR.
pub(super) fn read(input: impl BufRead, wanted: &BTreeSet<u32>) -> BTreeMap<u32, String> {
    let mut reader = Reader { input, line: 1, after_cr: false };
    let text = |line: &u32| Some((*line, Source::new("", reader.line(*line)?).line_at(0).into_owned()));
    wanted.iter().map_while(text).collect()
}

/// Quotes the program on its page.
pub(super) fn quote(path: &mut PathTrace, file: impl Read) {
    // Calls go back and forth in the file: which lines first, then one pass over it.
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
    /// Line of the next byte.
    line: u32,
    /// The byte before was a CR that may have ended its line.
    after_cr: bool,
}

impl<R: BufRead> Reader<R> {
    /// A line after those read before; `None` where the input does not have it.
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
