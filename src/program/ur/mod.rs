//! Universal Robots' URScript (`.script`), read by `deflex-lang`.

use super::lowered::{Lowered, Style, build, refused, single};
use super::{Language, Program};
use crate::text::{Diagnostic, Source};
use deflex_lang::urscript::{self, UrScript};
use std::f64::consts::PI;

pub(super) static STYLE: Style = Style {
    dialect: &UrScript,
    mm: 1e3,
    position_decimals: None,
    more_decimals: 3,
    deg: 180.0 / PI,
    // 1e-8 rad are 3e-6 mm at 300 mm.
    turn_decimals: 8,
    held: single,
    tool: "TCP",
    frame: "base",
};

const CODES: [&str; 2] = ["ur.too-large", "ur.no-text"];

/// Reads files as one program; `context` files only define routines.
///
/// # Errors
/// The program as a whole is refused (no text, no URScript, cut off): every reason found.
pub fn read(mut sources: Vec<Source>, context: Vec<Source>) -> Result<Program, Vec<Diagnostic>> {
    let written = sources.len();
    sources.extend(context);
    if let Some(error) =
        sources.iter().find_map(|source| refused(source, CODES, "URScript", "give the .script file, not the .urp"))
    {
        return Err(error.into());
    }
    let texts: Vec<&[u8]> = sources.iter().map(|source| &source.bytes[..]).collect();
    let program = urscript::read(&texts, written).map_err(|fault| {
        let source = &sources[usize::from(fault.place.source)];
        let error = Diagnostic::error("ur.syntax", &source.name, fault.message).at(source, fault.place.span);
        Vec::from(error.help("a controller does not run this; get the file again from its source"))
    })?;
    let made =
        |text: &[u8]| sources[..written].iter().any(|source| memchr::memmem::find(&source.bytes, text).is_some());
    let makers: [(&[u8], &str); 5] = [
        (b"RoboDK", "robodk"),
        (b"$ 1 \"", "polyscope"),
        (b"ref_frame", "robodk"),
        (b"SprutCAM", "sprutcam"),
        (b"Autodesk", "autodesk"),
    ];
    let dialect = makers.iter().find(|(text, _)| made(text)).map_or("ur", |(_, maker)| maker);
    build(Lowered {
        language: Language::Ur,
        dialect,
        style: &STYLE,
        program: &program,
        sources,
        written,
        diagnostics: Vec::new(),
    })
}
