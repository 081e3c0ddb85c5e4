//! Statements at which a program waits between two motions.

use crate::Program;
use nom::number::complete::double;
use std::ops::Range;

/// Words between two motions after which the second may not follow the first, and `CONTINUE`, with which KRL does not wait.
const BRANCHES: [&str; 21] = [
    "IF", "ELSE", "ELIF", "ELSEIF", "ENDIF", "TEST", "CASE", "SWITCH", "SELECT", "FOR", "ENDFOR", "WHILE", "ENDWHILE",
    "LOOP", "REPEAT", "GOTO", "JMP", "JUMP", "ENDPROC", "END", "CONTINUE",
];

/// What a program waits for between two motions. The arm stands still meanwhile: the controller cannot round the corner before it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[doc(hidden)]
pub struct Wait {
    /// The word of the first statement that waits.
    pub word: &'static str,
    /// Sum of the times that the text states as numbers, s.
    pub seconds: f64,
}

impl Program {
    /// How the program waits between two targets; `None` if it does not, or if the second target may not follow the first.
    #[must_use]
    #[doc(hidden)]
    pub fn waits_between(&self, target: usize, next: usize) -> Option<Wait> {
        let (before, after) = (self.targets.get(target)?, self.targets.get(next)?);
        if before.source != after.source {
            return None;
        }
        self.waits_in(before.source, before.span.range().end..after.span.range().start)
    }

    /// The same between the start of a chunk, whose own text begins there, and its first target.
    #[must_use]
    #[doc(hidden)]
    pub fn waits_before(&self, target: usize, from: usize) -> Option<Wait> {
        let target = self.targets.get(target)?;
        self.waits_in(target.source, from..target.span.range().start)
    }

    fn waits_in(&self, source: u16, span: Range<usize>) -> Option<Wait> {
        let text = self.sources[usize::from(source)].bytes.get(span)?;
        let (comment, about) = (self.language.comment(), self.language.about());
        let code = text
            .split(|byte| *byte == b'\n')
            .map(|line| line.split(|byte| Some(*byte) == comment).next().unwrap_or(line));
        let mut found: Option<Wait> = None;
        for mut rest in code {
            while let Some((word, after)) = next_word(rest) {
                rest = after;
                let is = |known: &&&str| word.eq_ignore_ascii_case(known.as_bytes());
                if BRANCHES.iter().any(|known| is(&known)) {
                    return None;
                }
                let stated = is(&&about.dwell.word).then(|| seconds(after, about.dwell.before_number)).flatten();
                let waits = about.waits.iter().find(is).copied().or(stated.map(|_| about.dwell.word));
                if let Some(word) = waits {
                    found.get_or_insert(Wait { word, seconds: 0.0 }).seconds += stated.unwrap_or(0.0);
                    // What the statement waits for is no statement of its own (`WAIT FOR`).
                    let ends = after.iter().position(|byte| *byte == b';');
                    rest = ends.map_or(&[][..], |end| &after[end..]);
                }
            }
        }
        found
    }
}

/// The next word of a line, and the line after it.
fn next_word(line: &[u8]) -> Option<(&[u8], &[u8])> {
    let is_of_word = |byte: &u8| byte.is_ascii_alphanumeric() || *byte == b'_';
    let line = &line[line.iter().position(is_of_word)?..];
    Some(line.split_at(line.iter().position(|byte| !is_of_word(byte)).unwrap_or(line.len())))
}

/// The number of seconds that the line after the first word of a statement states, if it is not an expression.
fn seconds(line: &[u8], before_number: Option<&str>) -> Option<f64> {
    let known = |word: &[u8]| before_number.is_some_and(|known| word.eq_ignore_ascii_case(known.as_bytes()));
    let line = next_word(line).filter(|(word, _)| known(word)).map_or(line, |(_, after)| after);
    let is_sign = |byte: &u8| b" \t\\=,/(".contains(byte);
    let line = &line[line.iter().position(|byte| !is_sign(byte))?..];
    let (after, seconds) = double::<_, nom::error::Error<&[u8]>>(line).ok()?;
    // `(sec)` is the unit of FANUC TP.
    let is_whole = after.trim_ascii_start().first().is_none_or(|byte| b";)(".contains(byte));
    Some(seconds).filter(|seconds| is_whole && seconds.is_finite() && *seconds > 0.0)
}
