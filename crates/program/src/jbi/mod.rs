//! Yaskawa's INFORM (`.JBI`), read by `deflex-lang`.

use super::lowered::{self, Lowering, Style};
use super::{Language, Program};
use deflex_lang::inform::{self, Inform};
use deflex_text::{Diagnostic, Severity, Source};
use std::collections::BTreeSet;
use std::ops::Range;

/// Decimals of a position, mm, and of an orientation, degrees: controllers count micrometres and ten-thousandths of a degree.
pub(super) const DECIMALS: [usize; 2] = [3, 4];

pub(super) static STYLE: Style = Style {
    dialect: &Inform,
    mm: 1.0,
    position_decimals: Some(DECIMALS[0]),
    more_decimals: 0,
    deg: 1.0,
    turn_decimals: DECIMALS[1],
    held: |at, value| deflex_text::number::printed(value, DECIMALS[usize::from(at > 2)]),
    tool: "TOOL",
    frame: inform::ROBOT,
    passes: positioning,
    stops: b"PL=0",
};

static LOWERING: Lowering = Lowering {
    language: Language::Jbi,
    style: &STYLE,
    parse: inform::read,
    codes: ["jbi.too-large", "jbi.no-text", "jbi.syntax"],
    expected: "an INFORM job",
    which: "give the .JBI file that the controller saves",
    again: "a controller does not load this; get the file again from its source",
    dialect: |_| "inform",
    warnings: |sources| sources.iter().filter_map(postures).collect(),
};

/// Reads a job; `context` has the jobs that it calls.
///
/// # Errors
/// The file is no job or is cut off: all reasons that were found.
///
/// # Examples
/// ```
/// use deflex_program::jbi;
/// use deflex_text::Source;
///
/// let program = jbi::read(vec![Source::new("CONTOUR.JBI", std::fs::read("../../samples/yaskawa/CONTOUR.JBI")?)], vec![])?;
/// assert!(!program.targets.is_empty());
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
pub fn read(sources: Vec<Source>, context: Vec<Source>) -> Result<Program, Vec<Diagnostic>> {
    lowered::read(&LOWERING, sources, context)
}

/// A warning if the positions of a job have more than one posture.
fn postures(source: &Source) -> Option<Diagnostic> {
    // Flip, upper or lower arm, front or rear; a base axis has zeros.
    let flags = |line: &&[u8]| {
        let flags = line.trim_ascii().strip_prefix(b"///RCONF")?;
        Some(flags.split(|b| *b == b',').take(3).map(|flag| flag.trim_ascii().to_vec()).collect::<Vec<_>>())
    };
    let lines = || source.bytes.split(|b| matches!(b, b'\n' | b'\r'));
    let groups: BTreeSet<_> = lines().filter_map(|line| flags(&line)).collect();
    let has_base = lines().any(|line| line.starts_with(b"BC"));
    if groups.len() <= 1 || has_base {
        return None;
    }
    let message = "the positions have more than one RCONF, which is not followed: each is taken in the posture nearest to the one before";
    let warning = Diagnostic::error("jbi.posture", &source.name, message).severity(Severity::Warning);
    Some(warning.help("correct the parts of the job with one posture each as jobs of their own"))
}

/// The positioning level (`PL=3`) or the radius (`CR=5.0`) of a motion.
fn positioning(text: &[u8]) -> Option<Range<usize>> {
    let is_word = |at: &usize| *at == 0 || text[at - 1].is_ascii_whitespace();
    let names = |at: &usize| text[*at..].starts_with(b"PL=") || text[*at..].starts_with(b"CR=");
    let at = (0..text.len()).find(|at| is_word(at) && names(at))?;
    let length = text[at..].iter().take_while(|byte| !byte.is_ascii_whitespace()).count();
    Some(at..at + length)
}
