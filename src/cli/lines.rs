//! Lines of a program that is too long to be held.

use deflex::text::Source;
use std::io::BufRead;

/// No line is read further than this.
const LONGEST: usize = 1000;

/// Lines that are asked for one behind the other, in constant memory. They end as in [`Source::line_column`]: with CR LF, LF,
/// CR CR LF or a lone CR.
pub(super) struct Lines<R> {
    input: R,
    /// Line of the next byte, from 1.
    line: u32,
    /// The byte before was a CR that may have ended its line.
    after_cr: bool,
    /// What was asked for last: targets share lines.
    last: (u32, String),
}

impl<R: BufRead> Lines<R> {
    pub(super) fn new(input: R) -> Self {
        Self { input, line: 1, after_cr: false, last: (0, String::new()) }
    }

    /// The text of a line at or behind the one asked for before; `None` where it cannot be read.
    pub(super) fn get(&mut self, wanted: u32) -> Option<String> {
        if wanted > self.last.0 {
            let text = self.read(wanted)?;
            self.last = (wanted, Source::new("", text).line_at(0).into_owned());
        }
        (wanted == self.last.0).then(|| self.last.1.clone())
    }

    fn read(&mut self, wanted: u32) -> Option<Vec<u8>> {
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
    use super::Lines;
    use deflex::text::Source;
    use std::io::BufReader;

    #[test]
    fn lines_are_those_of_a_source_however_they_end() {
        let text = "a\nbc\r\nd\r\r\n\ne\rf\r\n\u{e4}";
        let source = Source::new("", text);
        let mut lines = vec![String::new(); 8];
        for at in 0..text.len() {
            if !matches!(source.bytes[at], b'\n' | b'\r') {
                lines[source.line_column(at).line] = source.line_at(at).into_owned();
            }
        }
        for buffer in 1..9 {
            for step in 1..4 {
                let mut read = Lines::new(BufReader::with_capacity(buffer, text.as_bytes()));
                for wanted in (1..=7).step_by(step) {
                    assert_eq!(read.get(wanted).as_ref(), Some(&lines[wanted as usize]), "line {wanted}");
                    assert_eq!(read.get(wanted).as_ref(), Some(&lines[wanted as usize]), "line {wanted} again");
                }
                assert_eq!(read.get(8), None);
            }
        }
    }
}
