//! Universal Robots' URScript (`.script`), read by `deflex-lang`.

use super::lowered::{self, Lowering, Style};
use super::token::single;
use super::{Language, Program};
use deflex_lang::urscript::{self, UrScript};
use deflex_text::{Diagnostic, Source};
use std::f64::consts::PI;
use std::ops::Range;

pub(super) static STYLE: Style = Style {
    dialect: &UrScript,
    mm: 1e3,
    position_decimals: None,
    more_decimals: 3,
    deg: 180.0 / PI,
    // 1e-8 rad are 3e-6 mm at 300 mm.
    turn_decimals: 8,
    held: |_, value| single(value),
    tool: "TCP",
    frame: "base",
    passes: blend,
    stops: b"r=0",
};

static LOWERING: Lowering = Lowering {
    language: Language::Ur,
    style: &STYLE,
    parse: urscript::read,
    codes: ["ur.too-large", "ur.no-text", "ur.syntax"],
    expected: "URScript",
    which: "give the .script file, not the .urp",
    again: "a controller does not run this; get the file again from its source",
    dialect,
    warnings: |_| Vec::new(),
};

/// Reads files as one program; `context` files only define routines.
///
/// # Errors
/// The program is refused (no text, no URScript, cut off): all reasons that were found.
///
/// # Examples
/// ```
/// use deflex_program::ur;
/// use deflex_text::Source;
///
/// let text = std::fs::read("../../samples/ur/contour.script")?;
/// let program = ur::read(vec![Source::new("contour.script", text)], vec![])?;
/// assert!(!program.targets.is_empty());
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
pub fn read(sources: Vec<Source>, context: Vec<Source>) -> Result<Program, Vec<Diagnostic>> {
    lowered::read(&LOWERING, sources, context)
}

/// The software that wrote one of the files, if its comments name it.
fn dialect(sources: &[Source]) -> &'static str {
    let makers: [(&[u8], &str); 5] = [
        (b"RoboDK", "robodk"),
        (b"$ 1 \"", "polyscope"),
        (b"ref_frame", "robodk"),
        (b"SprutCAM", "sprutcam"),
        (b"Autodesk", "autodesk"),
    ];
    let made = |text: &[u8]| sources.iter().any(|source| memchr::memmem::find(&source.bytes, text).is_some());
    makers.iter().find(|(text, _)| made(text)).map_or("ur", |(_, maker)| maker)
}

/// The blend radius of a motion, `r=0.005` among its arguments.
fn blend(text: &[u8]) -> Option<Range<usize>> {
    let (mut depth, mut from) = (0_usize, 0);
    for (at, byte) in text.iter().enumerate() {
        let is_end = matches!(byte, b',' | b')') && depth == 1;
        if is_end {
            let argument = &text[from..at];
            let value =
                argument.trim_ascii().strip_prefix(b"r").and_then(|rest| rest.trim_ascii_start().strip_prefix(b"="));
            if value.is_some() {
                let blanks = argument.len() - argument.trim_ascii_start().len();
                return Some(from + blanks..from + argument.trim_ascii_end().len());
            }
        }
        match byte {
            b'(' | b'[' => depth += 1,
            b')' | b']' => depth = depth.saturating_sub(1),
            _ => {}
        }
        if is_end || depth == 1 && *byte == b'(' {
            from = at + 1;
        }
    }
    None
}
