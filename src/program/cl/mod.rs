//! APT/CL cutter location data.
//!
//! | file | from | to |
//! |---|---|---|
//! | `lex`, `cards` | bytes | records of tokens: lines, continuation, comments, free text |
//! | `statement` | tokens | major word and items |
//! | `read`, `setup`, `motion`, `modal`, `frame`, `arc`, `dialect`, `words` | statements | targets |
//! | `layout`, `rewrite` | wanted positions | edits on number tokens |
//! | [`spin`](fn@spin) | tool axis | orientation of the TCP |

mod arc;
mod cards;
mod dialect;
mod frame;
mod layout;
mod lex;
mod modal;
mod motion;
mod read;
mod rewrite;
mod setup;
mod spin;
mod statement;
mod vector;
mod words;

pub(crate) use layout::Layout;
pub(super) use rewrite::rewrite;
pub use spin::{SpinRule, spin};

use super::{Language, Program, Tool, Wobj};
use crate::text::{Diagnostic, Source, Span};

/// What the cell file says about CL input (`[cl]`), in the file's own units.
#[derive(Clone, Debug, PartialEq)]
pub struct ClOptions {
    /// Tool for every target.
    pub tool: String,
    /// Work object for every target.
    pub wobj: String,
    /// Unit where the file does not say.
    pub units: Option<Units>,
    /// Which tool point `GOTO` names.
    pub point: Point,
    /// Corner radius, mm: shifts centre output to the tip. Needed for [`Point::Centre`].
    pub corner_radius_mm: Option<f64>,
    /// Largest distance between an arc and its chords, mm.
    pub arc_tolerance_mm: f64,
}

/// Length unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Units {
    /// Millimetres.
    Millimetre,
    /// Inches.
    Inch,
}

/// Tool point that CL positions name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Point {
    /// End of the tool, on its axis.
    Tip,
    /// Centre of the corner radius, on the axis.
    Centre,
}

/// Reads one CL file.
///
/// Positions are in the first frame that the file names (as printed, for almost every file): that is
/// the work object. Targets have a tool axis ([`Goal::Axis`](super::Goal::Axis)); arcs are cut into
/// chords of at most `arc_tolerance_mm`, their points before their end.
///
/// # Errors
/// The file as a whole is refused (APT-360 source, not CL, no unit): every reason found.
pub fn read(source: Source, options: &ClOptions) -> Result<Program, Vec<Diagnostic>> {
    if options.point == Point::Centre && options.corner_radius_mm.is_none() {
        return Err(vec![
            Diagnostic::error(
                "cl.no-corner-radius",
                "",
                "`point = \"centre\"` in [cl] needs the cutter's corner radius",
            )
            .help("set `corner_radius_mm` under [cut.cutter] in the cell file"),
        ]);
    }
    if options.arc_tolerance_mm.is_nan() || options.arc_tolerance_mm <= 0.0 {
        return Err(vec![Diagnostic::error("cl.arc-tolerance", "", "the arc tolerance must be above 0 mm")]);
    }
    let mut reader = read::Reader::new(&source, options);
    reader.run();
    let refusal =
        source_language(&reader, &source).or_else(|| reader.refusal.take()).or_else(|| foreign(&reader, &source));
    if let Some(refusal) = refusal {
        return Err(vec![refusal]);
    }
    let read::Reader { dialect, targets, kept, diagnostics, mut layout, literal_targets, arcs, cutter, .. } = reader;
    layout.cards = cards::Cards::detect(&source.bytes).is_cards();
    Ok(Program {
        sources: vec![source],
        written: 1,
        language: Language::Cl,
        dialect: dialect.name(),
        tools: vec![Tool { name: options.tool.as_str().into(), data: None }],
        wobjs: vec![Wobj { name: options.wobj.as_str().into(), data: None }],
        targets,
        kept,
        literal_targets,
        arcs,
        cutter,
        diagnostics,
        layout: super::Layout::Cl(layout),
    })
}

/// One statement of APT-360 in this many positions makes a file source: CL data have none, or a
/// vendor's word that looks like one.
const POSITIONS_PER_SOURCE_WORD: usize = 4;

/// Refuses APT-360 source: symbolic geometry that only an APT processor turns into positions.
fn source_language(reader: &read::Reader, source: &Source) -> Option<Diagnostic> {
    let at = reader.first_source_word?;
    if reader.source_words * POSITIONS_PER_SOURCE_WORD < reader.literal_targets {
        return None;
    }
    let message = "APT-360 source (symbolic geometry), expected CL data with numeric positions";
    let help = "run it through an APT processor and give its CL output";
    Some(Diagnostic::error("cl.apt-source", &source.name, message).at(source, at).help(help))
}

/// Refuses what has no CL statement in it.
fn foreign(reader: &read::Reader, source: &Source) -> Option<Diagnostic> {
    if reader.understood > 0 || !reader.targets.is_empty() {
        return None;
    }
    let first = reader.kept.first().map_or(Span::default(), |k| k.span);
    let message = "no CL statement found, expected APT/CL data (`GOTO/x,y,z`)";
    Some(
        Diagnostic::error("cl.not-cl", &source.name, message)
            .at(source, first)
            .help("give a CL file, or `--format rapid`"),
    )
}
