//! Refuses marks with a typing error, which would leave a stretch with the wrong force without a message.

use super::Language;
use deflex_text::{Diagnostic, decode};
use std::io::{self, Read};

/// Number of bytes that are examined at once.
const AT_ONCE: usize = 64 * 1024;

/// Errors for comments that begin like a mark (`! deflex air`, `PPRINT/DEFLEX CUT`) and are none.
///
/// # Errors
/// `input` cannot be read.
#[doc(hidden)]
pub fn unknown_marks(name: &str, language: Language, mut input: impl Read) -> io::Result<Vec<Diagnostic>> {
    let (mut errors, mut text, mut line) = (Vec::new(), Vec::new(), 1);
    loop {
        let held = text.len();
        text.resize(held + AT_ONCE, 0);
        let count = input.read(&mut text[held..])?;
        text.truncate(held + count);
        let whole = if count == 0 { text.len() } else { memchr::memrchr(b'\n', &text).map_or(0, |end| end + 1) };
        look(name, language, &text[..whole], line, &mut errors);
        line += memchr::memchr_iter(b'\n', &text[..whole]).count();
        text.drain(..whole);
        if count == 0 {
            return Ok(errors);
        }
    }
}

fn look(name: &str, language: Language, text: &[u8], first: usize, errors: &mut Vec<Diagnostic>) {
    // Most programs end here.
    if ["eflex", "EFLEX"].iter().all(|word| memchr::memmem::find(text, word.as_bytes()).is_none()) {
        return;
    }
    for (i, row) in text.split(|b| *b == b'\n').enumerate() {
        let Some((start, said)) = mark(language, row).filter(|(_, said)| !known(said)) else { continue };
        let said = decode(said);
        let message = format!("unknown mark `deflex {said}`: expected `deflex air` or `deflex cut`");
        let mut error = Diagnostic::error("program.mark", name, message)
            .help("air: no cutting force from here on; cut: cuts from here on; a comment for people begins otherwise");
        (error.line, error.column) = (first + i, start + 1);
        errors.push(error);
    }
}

fn known(said: &[u8]) -> bool {
    [&b"air"[..], b"cut"].iter().any(|word| said.eq_ignore_ascii_case(word))
}

/// The text of a comment after `deflex`, and its offset.
fn mark(language: Language, row: &[u8]) -> Option<(usize, &[u8])> {
    let (start, comment) = match language.comment() {
        None => {
            let start = row.iter().position(|b| !b.is_ascii_whitespace())?;
            let word = row.get(start..start + 6)?;
            (start, word.eq_ignore_ascii_case(b"PPRINT").then(|| &row[start + 6..])?)
        }
        Some(begin) => {
            // Within a string it is not a comment.
            let mut quoted = false;
            let start = row.iter().position(|b| {
                quoted ^= *b == b'"';
                *b == begin && !quoted
            })?;
            (start, &row[start + 1..])
        }
    };
    let ends = |b: &u8| Some(*b) == language.about().comment_end;
    let apart = |b: &u8| b.is_ascii_whitespace() || matches!(b, b'/' | b'\'' | b'"' | b',') || ends(b);
    let mut words = comment.split(apart).filter(|word| !word.is_empty());
    words.next().filter(|word| word.eq_ignore_ascii_case(b"deflex"))?;
    Some((start, words.next().unwrap_or_default()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(language: Language, text: &str) -> Vec<usize> {
        unknown_marks("x", language, text.as_bytes()).unwrap().iter().map(|error| error.line).collect()
    }

    #[test]
    fn marks_that_mean_nothing_are_reported_at_their_line() {
        let rapid = "! deflex air\n  MoveL p1; ! Deflex aire\n! posted by deflex 0.1.0\nTPWrite \"! deflex x\";\n!deflex\n! DEFLEX CUT\r\n";
        assert_eq!(lines(Language::Rapid, rapid), [2, 5]);
        assert_eq!(
            lines(Language::Cl, "PPRINT/DEFLEX AIR\nPPRINT/ deflex slot\nPPRINT/MADE BY DEFLEX\nGOTO/0,0,0"),
            [2]
        );
        let far = "x\n".repeat(AT_ONCE) + "! deflex slow\n";
        assert_eq!(lines(Language::Rapid, &far), [AT_ONCE + 1]);
    }
}
