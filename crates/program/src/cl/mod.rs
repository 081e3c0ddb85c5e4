//! APT/CL cutter location data.
//!
//! | file | from | to |
//! |---|---|---|
//! | `lex`, `number`, `cards` | bytes | records of tokens: lines, continuation, comments, free text |
//! | `statement` | tokens | major word and items |
//! | `words`, `refusal` | major word | its effect, and how it is treated |
//! | `read`, `setup`, `motion`, `circle`, `hole`, `auxiliary`, `comment` | statements | targets, actions, collected in `reader` |
//! | `modal`, `machine`, `state`, `frame`, `units`, `arc`, `dialect` | | the state between statements |
//! | [`Chunks`] | bytes of a long file | targets, a stretch at a time |
//! | `layout`, `rewrite` | wanted positions | edits on number tokens |
//! | `corrected`, `feeds` | corrected tips and axes | the same CL data with them |

mod arc;
mod auxiliary;
mod cards;
mod chunks;
mod circle;
mod comment;
mod corrected;
mod dialect;
mod feeds;
mod frame;
mod hole;
mod layout;
mod lex;
mod machine;
mod modal;
mod motion;
mod number;
mod plain;
mod read;
mod reader;
mod refusal;
mod rewrite;
mod setup;
mod state;
mod statement;
mod units;
mod vector;
mod words;

pub use chunks::Chunks;
pub use corrected::{CorrectedPoint, write};
pub(crate) use layout::Layout;
pub(crate) use refusal::help;
pub use words::may_be_declared_harmless;

use super::{ExternalAxes, Program};
use deflex_text::{Diagnostic, Source, Span};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// The options of the cell file for CL input (`[cl]`), in the units of the file.
///
/// # Examples
/// ```
/// use deflex_program::cl::{ClOptions, Units};
///
/// let options = ClOptions { units: Some(Units::Millimetre), ..ClOptions::default() };
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ClOptions {
    /// Tool of the positions before the first tool number, and of all positions if `tools` is empty.
    pub tool: Option<String>,
    /// Tool numbers and names of the file (`LOADTL/1`, `TOOL PATH/…,TOOL,NAME`) to tools of the cell.
    pub tools: BTreeMap<String, String>,
    /// Whether every tool number stands for `tool`, without a mapping and without a refusal.
    pub any_tool: bool,
    /// Words, upper case, that move and change nothing on the user's machine.
    pub harmless: BTreeSet<String>,
    /// Work object for every target.
    pub wobj: String,
    /// Unit of length if the file does not state it.
    pub units: Option<Units>,
    /// The tool point of `GOTO`.
    pub point: Point,
    /// Corner radius, mm, by which centre output is shifted to the tip. Needed for [`Point::Centre`].
    pub corner_radius_mm: Option<f64>,
    /// The corner radii of tools that have one of their own, by name in upper case.
    pub corner_radii_mm: BTreeMap<String, f64>,
    /// Largest distance between an arc and its chords, mm.
    pub arc_tolerance_mm: f64,
    /// Positions of the mechanical units, which CL data do not state.
    pub external: Option<Arc<ExternalAxes>>,
}

/// Tolerance of chords of arcs, mm: a tenth of what a robot repeats.
const ARC_TOLERANCE_MM: f64 = 0.005;

/// The options without a declaration: no unit, the tip, the robot's own tool and work object.
impl Default for ClOptions {
    fn default() -> Self {
        Self {
            tool: Some("tool0".to_owned()),
            tools: BTreeMap::new(),
            any_tool: false,
            harmless: BTreeSet::new(),
            wobj: "wobj0".to_owned(),
            units: None,
            point: Point::Tip,
            corner_radius_mm: None,
            corner_radii_mm: BTreeMap::new(),
            arc_tolerance_mm: ARC_TOLERANCE_MM,
            external: None,
        }
    }
}

impl ClOptions {
    /// The cell's tool for a number or name.
    fn tool_of(&self, id: &str) -> Option<&str> {
        let same = |(known, _): &(&String, &String)| known.eq_ignore_ascii_case(id);
        self.tools.iter().find(same).map(|(_, tool)| tool.as_str())
    }

    fn is_harmless(&self, major: &[u8]) -> bool {
        !self.harmless.is_empty() && self.harmless.iter().any(|word| word.as_bytes().eq_ignore_ascii_case(major))
    }

    /// Corner radius of a tool of the cell, mm.
    fn corner_radius_of(&self, tool: &str) -> f64 {
        let own = self.corner_radii_mm.get(&tool.to_ascii_uppercase()).copied();
        own.or(self.corner_radius_mm).unwrap_or(0.0)
    }
}

/// Length unit.
///
/// # Examples
/// ```
/// use deflex_program::cl::{ClOptions, Units};
///
/// let options = ClOptions { units: Some(Units::Inch), ..ClOptions::default() };
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Units {
    /// Millimetres.
    Millimetre,
    /// Inches.
    Inch,
}

/// Tool point that CL positions name.
///
/// # Examples
/// ```
/// use deflex_program::cl::{ClOptions, Point};
///
/// let options = ClOptions { point: Point::Centre, ..ClOptions::default() };
/// ```
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
/// The file is refused (APT-360 source, not CL, no unit): all reasons that were found.
///
/// # Examples
/// ```
/// use deflex_program::cl::{self, ClOptions, Units};
/// use deflex_text::Source;
///
/// let options = ClOptions { units: Some(Units::Millimetre), any_tool: true, ..ClOptions::default() };
/// let file = Source::new("blade.aptsource", std::fs::read("../../samples/blade/blade.aptsource")?);
/// assert_eq!(cl::read(file, &options)?.targets.len(), 2302);
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
pub fn read(source: Source, options: &ClOptions) -> Result<Program, Vec<Diagnostic>> {
    if let Some(refusal) = refused(options) {
        return Err(vec![refusal]);
    }
    let lexer = lex::Lexer::new(&source.bytes, source.lines_before);
    let cards = lexer.is_cards();
    let mut reader = reader::Reader::new(&source.bytes, options);
    reader.run(lexer);
    let refusal = source_language(&reader, &source)
        .or_else(|| without_unit(&reader, &source))
        .or_else(|| foreign(&reader, &source));
    if let Some(refusal) = refusal {
        return Err(vec![refusal]);
    }
    reader.layout.cards = cards;
    let mut program = reader.program(source);
    program.diagnostics = reader.warnings(&program.sources[0].name);
    Ok(program)
}

/// Refuses options with which no file can be read.
fn refused(options: &ClOptions) -> Option<Diagnostic> {
    let radius = options.corner_radius_mm.or(options.corner_radii_mm.values().next().copied());
    if options.point == Point::Centre && radius.is_none() {
        let message = "`point = \"centre\"` in [cl] needs the cutter's corner radius";
        return Some(
            Diagnostic::error("cl.no-corner-radius", "", message)
                .help("set `corner_radius_mm` under [cut.cutter] in the cell file"),
        );
    }
    (options.arc_tolerance_mm.is_nan() || options.arc_tolerance_mm <= 0.0)
        .then(|| Diagnostic::error("cl.arc-tolerance", "", "the arc tolerance must be above 0 mm"))
}

/// Refuses a file with a position whose unit is not declared.
fn without_unit(reader: &reader::Reader, source: &Source) -> Option<Diagnostic> {
    let message = "no UNITS statement, and no `units` in [cl]: expected millimetres or inches";
    let help = "set `units = \"mm\"` or `units = \"inch\"` under [cl] in the cell file";
    Some(Diagnostic::error("cl.no-unit", &source.name, message).at(source, reader.no_unit?).help(help))
}

/// Least number of positions for each statement of APT-360 in CL data, which have none, or a vendor's word that looks like one. With fewer
/// positions the file is APT-360 source.
const POSITIONS_PER_SOURCE_WORD: usize = 4;

/// Refuses APT-360 source: symbolic geometry that only an APT processor turns into positions.
fn source_language(reader: &reader::Reader, source: &Source) -> Option<Diagnostic> {
    let at = reader.first_source_word.filter(|_| is_source_language(reader))?;
    let message = "APT-360 source (symbolic geometry), expected CL data with numeric positions";
    let help = "run it through an APT processor and give its CL output";
    Some(Diagnostic::error("cl.apt-source", &source.name, message).at(source, at).help(help))
}

fn is_source_language(reader: &reader::Reader) -> bool {
    reader.source_words > 0 && reader.source_words * POSITIONS_PER_SOURCE_WORD >= reader.literal_targets
}

/// Refuses a file without a CL statement.
fn foreign(reader: &reader::Reader, source: &Source) -> Option<Diagnostic> {
    if !is_foreign(reader) {
        return None;
    }
    let first = reader.kept.first().map_or(Span::default(), |k| k.span);
    let message = "no CL statement found, expected APT/CL data (`GOTO/x,y,z`)";
    Some(
        Diagnostic::error("cl.not-cl", &source.name, message)
            .at(source, first)
            .help("give a CL file, or `--input-format rapid`"),
    )
}

fn is_foreign(reader: &reader::Reader) -> bool {
    reader.understood == 0 && reader.ordinal == 0
}
