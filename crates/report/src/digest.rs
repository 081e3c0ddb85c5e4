//! The largest errors of a program, collected from its rows.

use super::summary::{FileSummary, PathKind, counted, summary_line};
use deflex_correct::Row;
use serde::Serialize;
use std::fmt::Write;

/// How many targets are listed.
const WORST: usize = 10;

/// The largest errors of a program as text: their sizes, their places, and the targets with the largest errors.
#[must_use]
#[doc(hidden)]
pub fn digest_text(summary: &FileSummary, digest: &Digest) -> String {
    let mut out = format!("{}: {}\n", summary.path, summary_line(summary, PathKind::Predict));
    let at = |spot: &Spot| {
        let file = if spot.file.is_empty() || spot.file == summary.path { "" } else { &spot.file };
        let of_file = if file.is_empty() { String::new() } else { format!(" of {file}") };
        format!("{:.4} mm at target {}, line {}{of_file}", spot.mm, spot.target, spot.line)
    };
    // Writing to a String cannot fail.
    if let Some(largest) = digest.worst.first() {
        let _ = writeln!(out, "error: rms {:.4} mm, largest {}", summary.counts.rms_error_mm, at(largest));
    }
    if let Some(way) = &digest.way {
        let rms = summary.counts.remaining_path_rms_mm;
        let _ =
            writeln!(out, "between targets: rms {rms:.4} mm, largest distance from the programmed path {}", at(way));
    }
    if let Some(jump) = &digest.jump {
        let _ = writeln!(out, "where the force sets in, ends or turns at once: largest jump {}", at(jump));
    }
    let shown = digest.worst.iter().filter(|spot| spot.mm > 0.0).count();
    if shown > 0 {
        let _ = writeln!(
            out,
            "{} with the largest errors:\n{:>8} {:>8} {:>10}  name",
            counted(shown, "target"),
            "target",
            "line",
            "error_mm"
        );
    }
    for spot in &digest.worst[..shown] {
        let name = spot.name.as_deref().unwrap_or("");
        let row = format!("{:>8} {:>8} {:>10.4}  {name}", spot.target, spot.line, spot.mm);
        let _ = writeln!(out, "{}", row.trim_end());
    }
    out
}

/// A place in a program, and the error of the tip there.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
#[doc(hidden)]
pub struct Spot {
    /// The error, mm.
    pub mm: f64,
    /// Ordinal of the motion. For the path between targets and for jumps, it is the motion that leads to the next target.
    pub target: u32,
    /// Line of the instruction.
    pub line: u32,
    /// Name of the declared target.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// File of the motion; empty if it is not known.
    pub file: String,
}

/// Collects the largest errors from rows in running order. Of equal errors the first one counts.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
#[doc(hidden)]
pub struct Digest {
    /// Targets with the largest errors, the largest first.
    pub worst: Vec<Spot>,
    /// Where the tip is farthest from the path, not counting jumps of the force.
    pub way: Option<Spot>,
    /// The largest jump of the tip where the force sets in, ends or turns at once.
    pub jump: Option<Spot>,
}

impl Digest {
    /// Adds rows, in running order.
    pub fn take(&mut self, rows: &[Row]) {
        for row in rows.iter().filter(|row| row.is_solved()) {
            let error = row.error_norm_mm();
            if let Some(path) = row.path {
                larger(&mut self.jump, row, path.jump_mm);
            }
            if row.is_through_air {
                continue;
            }
            if self.worst.len() < WORST || self.worst.last().is_some_and(|least| error > least.mm) {
                let at = self.worst.partition_point(|spot| spot.mm >= error);
                self.worst.insert(at, spot(row, error));
                self.worst.truncate(WORST);
            }
            if let Some(path) = row.path {
                larger(&mut self.way, row, path.way_mm);
            }
        }
    }
}

fn larger(most: &mut Option<Spot>, row: &Row, mm: f64) {
    if mm > most.as_ref().map_or(0.0, |most| most.mm) {
        *most = Some(spot(row, mm));
    }
}

fn spot(row: &Row, mm: f64) -> Spot {
    let file = row.names.as_deref().map_or_else(String::new, |names| names.file.to_string());
    Spot { mm, target: row.target, line: row.line, name: row.name.as_deref().map(str::to_owned), file }
}
