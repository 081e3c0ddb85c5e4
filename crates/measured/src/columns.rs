//! The columns of a measured table, and the message for an error in one.

use deflex_text::{Diagnostic, Source, Span};

/// Columns of `docs/formats.md`.
pub(super) const COLUMNS: [&str; 30] = [
    "target", "x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz", "normal_mm", "q1_deg", "q2_deg", "q3_deg", "q4_deg",
    "q5_deg", "q6_deg", "distance_mm", "fx_n", "fy_n", "fz_n", "time_s", "temperature_c", "payload_kg", "sigma_mm",
    "run", "holdout", "nominal_x_mm", "nominal_y_mm", "nominal_z_mm", "probe_tool", "",
];

/// Names of the columns that a measured table may have.
///
/// # Examples
/// ```
/// assert!(deflex_measured::column_names().any(|name| name == "x_mm"));
/// ```
pub fn names() -> impl Iterator<Item = &'static str> {
    COLUMNS.into_iter().filter(|name| !name.is_empty())
}

/// Indices of the columns that `--forces` reads: target, forces and covariates.
pub(super) const FORCE_COLUMNS: [usize; 7] = [0, 16, 17, 18, 19, 20, 21];
/// Index of the column that names a probing tool. In a row with such a tool, time and temperature are not those of the
/// cut.
pub(super) const PROBE_TOOL: usize = 28;

/// Position in the file of each of [`COLUMNS`].
pub(super) type Places = [Option<usize>; COLUMNS.len()];

/// A row as it is in the file, to mark the cell that a message is about. A cell that does not need quotation marks is
/// written without them.
pub(super) struct RowText {
    row: Source,
    cells: Vec<Span>,
}

impl RowText {
    pub(super) fn new<'a>(file: &str, separator: u8, cells: impl IntoIterator<Item = &'a [u8]>) -> Self {
        let (mut text, mut spans): (Vec<u8>, Vec<Span>) = (Vec::new(), Vec::new());
        for cell in cells {
            if !spans.is_empty() {
                text.push(separator);
            }
            let start = text.len();
            if cell.iter().any(|byte| *byte == separator || matches!(byte, b'"' | b'\n')) {
                let quoted = String::from_utf8_lossy(cell).replace('"', "\"\"").replace('\n', " ");
                text.extend_from_slice(format!("\"{quoted}\"").as_bytes());
            } else {
                text.extend_from_slice(cell);
            }
            spans.push(Span::new(start, text.len()));
        }
        Self { row: Source::new(file, text), cells: spans }
    }

    /// An error of a cell, counted from 0, or of the last cell if there are fewer.
    pub(super) fn wrong(&self, line: u64, cell: usize, message: String, help: String) -> Diagnostic {
        let span = self.cells.get(cell).or(self.cells.last()).copied().unwrap_or(Span::new(0, 0));
        wrong(&self.row.name, line, message, help).on_line(&self.row, span, u32::try_from(line).unwrap_or(0))
    }
}

/// An error of a line of the table.
pub(super) fn wrong(file: &str, line: u64, message: String, help: String) -> Diagnostic {
    let mut diagnostic = Diagnostic::error("measured.csv", file, message).help(help);
    (diagnostic.line, diagnostic.column) = (usize::try_from(line).unwrap_or(0), 1);
    diagnostic
}
