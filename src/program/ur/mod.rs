//! Universal Robots' URScript (`.script`), read by `deflex-lang`.

use super::lowered::{Lowered, Style, build};
use super::{Language, Program};
use crate::text::{Diagnostic, Source, Span};
use deflex_lang::ir::{self, ExpressionKind};
use deflex_lang::urscript::{self, UrScript};
use std::f64::consts::PI;

pub(super) static STYLE: Style = Style {
    dialect: &UrScript,
    mm: 1e3,
    more_decimals: 3,
    deg: 180.0 / PI,
    // 1e-8 rad are 3e-6 mm at 300 mm.
    turn_decimals: 8,
    tool: "TCP",
    frame: "base",
};

/// Reads files as one program; `context` files only define routines.
///
/// # Errors
/// The program as a whole is refused (no text, no URScript, cut off): every reason found.
pub fn read(mut sources: Vec<Source>, context: Vec<Source>) -> Result<Program, Vec<Diagnostic>> {
    let written = sources.len();
    sources.extend(context);
    if let Some(error) = sources.iter().find_map(refused) {
        return Err(error.into());
    }
    let texts: Vec<&[u8]> = sources.iter().map(|source| &source.bytes[..]).collect();
    let program = urscript::read(&texts, written).map_err(|fault| {
        let source = &sources[usize::from(fault.place.source)];
        let error = Diagnostic::error("ur.syntax", &source.name, fault.message).at(source, fault.place.span);
        Vec::from(error.help("a controller does not run this; get the file again from its source"))
    })?;
    let literal_targets = literals(&program, written);
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
        literal_targets,
        arcs: |_| Vec::new(),
        diagnostics: Vec::new(),
    })
}

/// Why a file as a whole is not read.
fn refused(source: &Source) -> Option<Diagnostic> {
    let whole = |code, message: &str, at: usize| {
        Diagnostic::error(code, &source.name, message).at(source, Span::new(at, (at + 1).min(source.bytes.len())))
    };
    if u32::try_from(source.bytes.len()).is_err() {
        return Some(whole("ur.too-large", "file is larger than 4 GiB", 0).help("split it"));
    }
    let at = super::detect::no_text(&source.bytes)?;
    Some(whole("ur.no-text", "the file is no text: expected URScript", at).help("give the .script file, not the .urp"))
}

/// Poses in the text all of whose numbers are literals.
fn literals(program: &ir::Program, written: usize) -> usize {
    let mut count = 0;
    for function in &program.functions {
        for statement in &function.body {
            statement.each(&mut |statement| {
                for expression in statement.expressions() {
                    expression.each(&mut |part| {
                        if let ExpressionKind::Pose(items) = &part.kind {
                            let literal = items.iter().all(|item| matches!(item.kind, ExpressionKind::Number(..)));
                            count += usize::from(literal && usize::from(part.place.source) < written);
                        }
                    });
                }
            });
        }
    }
    count
}
