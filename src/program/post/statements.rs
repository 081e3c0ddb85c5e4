//! What languages write differently in posted programs.

use super::template::decimal;
use super::writer::{PostedPoint, RapidPost};
use crate::text::Diagnostic;

/// Files by name.
pub(crate) type Files = Vec<(String, Vec<u8>)>;
/// Writes points, with the axis angles there (degrees) and the lines of the end, as files.
pub(crate) type Write = fn(&RapidPost, &[PostedPoint], &[[f64; 6]], &str) -> Result<Files, Vec<Diagnostic>>;
/// What a controller holds of a position, mm, and an orientation, scalar first.
pub(crate) type Print = fn([f64; 3], [f64; 4]) -> Held;
/// A position, mm, and an orientation, scalar first.
pub(crate) type Held = ([f64; 3], [f64; 4]);

/// How a language says what posted programs need.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Statements {
    /// Waits for so many seconds, written as a number.
    pub(crate) dwell: fn(f64) -> String,
    /// Shows the operator a message that has to be acknowledged.
    pub(crate) asks: fn(&str) -> Vec<String>,
    /// Writes a program as a whole; RAPID is written in chunks.
    pub(crate) write: Option<Write>,
    /// What a controller holds of a pose that is printed; RAPID prints quaternions.
    pub(crate) held: Option<Print>,
    /// Points of a file where the options give no number.
    pub(crate) most_points: Option<usize>,
    /// Why a program is not split into several files.
    pub(crate) unsplit: Option<&'static str>,
    /// Why programs are posted without external axes.
    pub(crate) without_axes: Option<&'static str>,
    /// Whether work objects of posted programs have to stand still.
    pub(crate) stands_still: bool,
    /// What has to be looked at before the program runs.
    pub(crate) check: Option<&'static str>,
}

impl Statements {
    /// Those of RAPID, which others differ from.
    pub(crate) const RAPID: Self = Self {
        dwell: |seconds| format!("WaitTime {};", decimal(seconds)),
        asks: |text| vec![format!("UIMsgBox \"{text}\";")],
        write: None,
        held: None,
        most_points: None,
        unsplit: None,
        without_axes: None,
        stands_still: false,
        check: None,
    };
}
