//! APT/CL cutter location data.

use super::{Change, Insert, Program, RewriteOptions, Rewritten};
use crate::text::{Diagnostic, Source};

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

/// Where the number tokens of positions stand.
#[derive(Debug, Default)]
pub(crate) struct Layout {}

/// Reads one CL file.
///
/// # Errors
/// The file as a whole is refused (APT-360 source, not CL, no unit): every reason found.
pub fn read(_source: Source, _options: &ClOptions) -> Result<Program, Vec<Diagnostic>> {
    Err(Vec::new())
}

pub(super) fn rewrite(
    _program: &Program,
    _layout: &Layout,
    _changes: &[Option<Change>],
    _inserts: &[Insert],
    _options: &RewriteOptions,
) -> Rewritten {
    Rewritten::default()
}
