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

/// The unit of the speeds `V=` of a controller, which one of its parameters sets.
///
/// # Examples
/// ```
/// use deflex_program::jbi::SpeedUnit;
///
/// let units = SpeedUnit::WORDS.map(|(word, unit)| (word, unit.mm_s())); // as `[controller] speed_unit` of the cell has them
/// assert_eq!(units[1], ("cm/min", 10.0 / 60.0));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SpeedUnit {
    /// Millimetres a second.
    #[default]
    MillimetresPerSecond,
    /// Centimetres a minute.
    CentimetresPerMinute,
    /// Millimetres a minute.
    MillimetresPerMinute,
    /// Inches a minute.
    InchesPerMinute,
}

impl SpeedUnit {
    /// All of them, with their words in the cell file.
    pub const WORDS: [(&'static str, Self); 4] = [
        ("mm/s", Self::MillimetresPerSecond),
        ("cm/min", Self::CentimetresPerMinute),
        ("mm/min", Self::MillimetresPerMinute),
        ("inch/min", Self::InchesPerMinute),
    ];

    /// The unit in mm/s.
    #[must_use]
    pub fn mm_s(self) -> f64 {
        match self {
            Self::MillimetresPerSecond => 1.0,
            Self::CentimetresPerMinute => 10.0 / 60.0,
            Self::MillimetresPerMinute => 1.0 / 60.0,
            Self::InchesPerMinute => 25.4 / 60.0,
        }
    }
}

/// Takes the speeds of a job that was read as numbers in this unit. The unit of a variable is known for mm/s only: in other units, its speed is
/// unknown.
#[doc(hidden)]
pub fn take_speeds_in(program: &mut Program, unit: SpeedUnit) {
    if program.language != Language::Jbi || unit == SpeedUnit::MillimetresPerSecond {
        return;
    }
    for target in &mut program.targets {
        let text = program.sources[usize::from(target.source)].slice(target.span);
        let is_number = text.windows(4).any(|word| word.starts_with(b" V=") && word[3].is_ascii_digit());
        target.feed_mm_s = target.feed_mm_s.filter(|_| is_number).map(|number| number * unit.mm_s());
    }
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
