//! Results for people and for scripts: CSV rows, summary lines, JSON, CI formats, differences of two programs.

mod ci;
mod csv;
mod diff;
mod summary;

pub use ci::{CheckFile, junit, sarif};
pub use csv::write_csv;
pub use diff::{Difference, MovedTarget, difference};
pub use summary::{FileSummary, summary_line};
