//! Yaskawa's INFORM (`.JBI`), read by `deflex-lang`.

use super::lowered::{Lowered, Style, build, refused};
use super::{Language, Program};
use crate::text::{Diagnostic, Severity, Source};
use deflex_lang::inform::{self, Inform};
use std::collections::BTreeSet;

/// Decimals of a position, mm, and of an orientation, degrees: controllers count micrometres and ten-thousandths of a degree.
pub(super) const DECIMALS: [usize; 2] = [3, 4];

pub(super) static STYLE: Style = Style {
    dialect: &Inform,
    mm: 1.0,
    position_decimals: Some(DECIMALS[0]),
    more_decimals: 0,
    deg: 1.0,
    turn_decimals: DECIMALS[1],
    held: |at, value| crate::text::number::printed(value, DECIMALS[usize::from(at > 2)]),
    tool: "TOOL",
    frame: inform::ROBOT,
};

const CODES: [&str; 2] = ["jbi.too-large", "jbi.no-text"];
const HELP: &str = "give the .JBI file that the controller saves";

/// Reads a job; `context` has the jobs that it calls.
///
/// # Errors
/// The file is no job or is cut off: every reason found.
pub fn read(mut sources: Vec<Source>, context: Vec<Source>) -> Result<Program, Vec<Diagnostic>> {
    let written = sources.len();
    sources.extend(context);
    if let Some(error) = sources.iter().find_map(|source| refused(source, CODES, "an INFORM job", HELP)) {
        return Err(error.into());
    }
    let texts: Vec<&[u8]> = sources.iter().map(|source| &source.bytes[..]).collect();
    let program = inform::read(&texts, written).map_err(|fault| {
        let source = &sources[usize::from(fault.place.source)];
        let error = Diagnostic::error("jbi.syntax", &source.name, fault.message).at(source, fault.place.span);
        Vec::from(error.help("a controller does not load this; get the file again from its source"))
    })?;
    let diagnostics = sources[..written].iter().filter_map(postures).collect();
    build(Lowered {
        language: Language::Jbi,
        dialect: "inform",
        style: &STYLE,
        program: &program,
        sources,
        written,
        diagnostics,
    })
}

/// A warning where the positions of a job are reached in more than one posture.
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
