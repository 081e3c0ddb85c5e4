//! Report rows of several programs in one file.

use super::output::Outputs;
use deflex::correct::Row;
use deflex::program::{Program, Role};
use deflex::report::{FileSummary, write_csv};
use deflex::text::Diagnostic;
use serde::Serialize;
use std::path::Path;

/// The report of one program.
#[derive(Default)]
pub(super) struct Rows {
    /// As INTERFACE.md has it.
    pub(super) csv: Vec<u8>,
    /// File of each row.
    files: Vec<String>,
}

impl Rows {
    pub(super) fn new(program: &Program, rows: &[Row]) -> Self {
        let mut csv = Vec::with_capacity(64 + 256 * rows.len());
        // Writing to a Vec cannot fail.
        let _ = write_csv(rows, &mut csv);
        let mut ends = program.targets.iter().filter(|target| target.role == Role::End);
        let mut file = |row: &Row| {
            let target = ends.find(|target| target.ordinal == row.target);
            target.map_or_else(String::new, |target| program.sources[usize::from(target.source)].name.clone())
        };
        let files = rows.iter().map(&mut file).collect();
        Self { csv, files }
    }
}

/// One report: as it is for one file, with a last column `file` for several.
pub(super) fn joined(programs: &[Rows]) -> Vec<u8> {
    let mut names = programs.iter().flat_map(|rows| &rows.files);
    let first = names.next();
    let one = programs.len() == 1 && names.all(|name| Some(name) == first);
    if let ([rows], true) = (programs, one) {
        return rows.csv.clone();
    }
    let mut out = Vec::new();
    for (i, rows) in programs.iter().enumerate() {
        let mut lines = rows.csv.split(|&b| b == b'\n').filter(|line| !line.is_empty());
        if let Some(header) = lines.next().filter(|_| i == 0) {
            out.extend_from_slice(header);
            out.extend_from_slice(b",file\n");
        }
        for (line, file) in lines.zip(&rows.files) {
            out.extend_from_slice(line);
            out.push(b',');
            out.extend_from_slice(cell(file).as_bytes());
            out.push(b'\n');
        }
    }
    out
}

/// Text as a CSV cell.
fn cell(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.to_owned() }
}

/// Adds the JSON summary of a run.
pub(super) fn json(outputs: &mut Outputs, path: &Path, files: &[FileSummary]) -> Result<(), Vec<Diagnostic>> {
    #[derive(Serialize)]
    struct Files<'a> {
        files: &'a [FileSummary],
    }
    outputs.add_report(path, pretty(&Files { files })?.as_bytes())
}

/// JSON for people and scripts, keys in their own order, with a final line end.
pub(super) fn pretty(value: &impl Serialize) -> Result<String, Vec<Diagnostic>> {
    match serde_json::to_string_pretty(value) {
        Ok(text) => Ok(text + "\n"),
        Err(error) => Err(Diagnostic::error("io.json", "", format!("cannot be written as JSON: {error}")).into()),
    }
}

/// The sentence about one program, for stderr.
pub(super) fn line(summary: &FileSummary, written: bool) -> String {
    let mut line = format!("{}: {}", summary.path, deflex::report::summary_line(summary));
    if summary.max_error_mm > 0.0 {
        line += &format!("; error rms {:.4} mm, max {:.4} mm", summary.rms_error_mm, summary.max_error_mm);
    }
    if written {
        line += &match summary.max_kept_mm {
            kept if kept > 0.0 => {
                format!("; remaining max {:.6} mm, and {kept:.4} mm on kept targets", summary.max_remaining_mm)
            }
            _ => format!("; remaining max {:.6} mm", summary.max_remaining_mm),
        };
    }
    line
}
