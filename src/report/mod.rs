//! Results for people and for scripts: CSV rows, summary lines, JSON, CI formats, differences of two programs.

mod ci;
mod csv;
mod diff;
mod findings;
pub mod html;
mod identification;
mod inspect;
mod summary;

pub use ci::{CheckFile, check_json, junit, sarif};
pub use csv::{CSV_HEADER, csv_rows, write_csv};
pub use diff::{Difference, MovedTarget, OtherDifference, diff_csv, diff_text, difference, shift_mm};
pub use findings::Findings;
pub use identification::{identify_text, residual_csv};
pub use inspect::{InspectFile, InspectFiles, KeptLine, inspect_table};
pub use summary::{FileSummary, summary_line};
