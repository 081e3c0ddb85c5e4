//! The result of a program: corrected poses, report rows and notes.

use super::along::WayFinding;
use super::messages::Repeated;
use super::row::Row;
use deflex_program::{Confdata, Rewritten};
use deflex_robot::EXTERNAL_AXES;
use deflex_text::Diagnostic;
use serde::Serialize;

/// A corrected program.
///
/// # Examples
/// ```
/// # let (program, cell) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/slot.rs"));
/// # let corrected = deflex_correct::compensate(&program, &cell, &Default::default())?;
/// assert!(corrected.failures.is_empty() && corrected.rewritten.is_some());
/// println!("{} rows", corrected.rows.len());
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Debug, Default)]
#[non_exhaustive]
pub struct Corrected {
    /// One row for each executed motion, in running order. Targets that failed have none.
    pub rows: Vec<Row>,
    /// Targets that have no solution or exceed a limit: a program with any of these is not written.
    pub failures: Vec<Diagnostic>,
    /// Notes and warnings of the run.
    pub notes: Vec<Diagnostic>,
    /// Programs that are edited: the edits, and the poses that were written.
    pub rewritten: Option<Rewritten>,
    /// CL input: the poses to post, one for each point of the program.
    pub posted: Vec<Posted>,
    /// Motions that were inserted.
    pub inserted: usize,
    /// For a program that is judged by its original: distance of each target from that of the original, mm.
    pub moved_mm: Vec<f64>,
    /// Findings on the segments to targets, as commanded.
    pub on_the_way: Vec<WayFinding>,
    /// Figures of the driven path, if it was computed.
    pub driven: Option<DrivenSummary>,
    /// Warnings that many targets share; they go to `notes` at the end of the program.
    pub(super) repeated: Repeated,
}

impl Corrected {
    /// Ends the program: adds the shared warnings to the notes.
    pub(super) fn with_repeated(mut self) -> Self {
        self.notes.extend(std::mem::take(&mut self.repeated).once());
        self
    }
}

/// A corrected point for a program that is written anew (CL to RAPID).
///
/// # Examples
/// ```
/// use deflex_cell::Cell;
/// use deflex_program::cl;
/// use deflex_text::Source;
///
/// let cell = Cell::read(&Source::new("cell.toml", std::fs::read("../../samples/blade/cell.toml")?))?;
/// let file = Source::new("blade.aptsource", std::fs::read("../../samples/blade/blade.aptsource")?);
/// let program = cl::read(file, &cell.cl.as_ref().expect("[cl]").options)?;
/// let corrected = deflex_correct::compensate(&program, &cell, &Default::default())?;
/// println!("{:?} mm", corrected.posted[0].position_mm);
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Posted {
    /// Index into [`targets`](deflex_program::Program::targets) of its target, or of the target that it is inserted before.
    pub target: usize,
    /// Corrected position, work object axes, mm.
    pub position_mm: [f64; 3],
    /// Corrected orientation, scalar first.
    pub quat: [f64; 4],
    /// Configuration of the commanded joints.
    pub conf: Confdata,
    /// Commanded angles as the controller counts them, degrees.
    pub motor_deg: [f64; 6],
    /// Positions of the external axes, mm or degrees, if they were chosen; `None` if the cell states them.
    pub external: Option<Box<[Option<f64>; EXTERNAL_AXES]>>,
}

/// Figures of the driven path of a program.
///
/// # Examples
/// ```
/// use deflex_correct::DrivenFigures;
///
/// let figures = DrivenFigures { max_mm: 0.12, run_time_s: 310.0 };
/// println!("{} mm, {} s", figures.max_mm, figures.run_time_s);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct DrivenFigures {
    /// Largest distance between the driven, loaded path and the programmed one, mm: on the segments to targets that cut, or to all targets
    /// if none cuts.
    pub max_mm: f64,
    /// Run time of the program, s.
    pub run_time_s: f64,
}

/// The driven path of a program before and after its correction.
///
/// # Examples
/// ```
/// use deflex_correct::DrivenSummary;
///
/// /// Whether the driven path is within its tolerance after the correction.
/// fn is_good(driven: &DrivenSummary) -> Option<bool> {
///     Some(driven.corrected?.max_mm <= driven.tolerance_mm?)
/// }
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DrivenSummary {
    /// Figures of the program as it is.
    pub programmed: DrivenFigures,
    /// Figures of the corrected program.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub corrected: Option<DrivenFigures>,
    /// Largest allowed distance, mm (`--max-path-error`).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tolerance_mm: Option<f64>,
}
