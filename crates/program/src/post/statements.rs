//! The statements of posted programs that differ between languages.

use super::template::decimal;
use super::writer::{PostWriter, PostedPoint};
use deflex_text::Diagnostic;

/// Files by name.
pub(crate) type Files = Vec<(String, Vec<u8>)>;
/// Writes points, with the axis angles there (degrees) and the lines of the end, as files.
pub(crate) type Write = fn(&PostWriter, &[PostedPoint], &[[f64; 6]], &str) -> Result<Files, Vec<Diagnostic>>;
/// Gives a position, mm, and an orientation, scalar first, in the controller's precision.
pub(crate) type Print = fn([f64; 3], [f64; 4]) -> Held;
/// A position, mm, and an orientation, scalar first.
pub(crate) type Held = ([f64; 3], [f64; 4]);

/// The statements of a language in posted programs.
#[derive(Clone, Copy, Debug)]
#[doc(hidden)]
pub struct Statements {
    /// Waits for a number of seconds.
    pub(crate) dwell: fn(f64) -> String,
    /// Shows the operator a message that has to be acknowledged.
    pub stops_with_message: fn(&str) -> Vec<String>,
    /// Writes a program as a whole; RAPID is written in chunks.
    pub write: Option<Write>,
    /// A printed pose in the controller's precision; `None` for RAPID, which prints quaternions.
    pub held: Option<Print>,
    /// Most points of a file if the options give no number.
    pub most_points: Option<usize>,
    /// Why a program is not split into several files.
    pub unsplit: Option<&'static str>,
    /// Why programs are posted without external axes.
    pub without_axes: Option<&'static str>,
    /// Whether work objects of posted programs have to stand still.
    pub stands_still: bool,
    /// Text for a note: what to check before the program runs.
    pub check: Option<&'static str>,
}

impl Statements {
    /// The statements of RAPID, from which others differ.
    pub(crate) const RAPID: Self = Self {
        dwell: |seconds| format!("WaitTime {};", decimal(seconds)),
        stops_with_message: |text| vec![format!("UIMsgBox \"{text}\";")],
        write: None,
        held: None,
        most_points: None,
        unsplit: None,
        without_axes: None,
        stands_still: false,
        check: None,
    };
}
