//! Results for people and for scripts: CSV rows, summary lines, JSON, CI formats, differences of two programs.

mod ci;
mod columns;
mod csv;
mod diff;
mod digest;
mod driven;
mod findings;
pub mod html;
mod identification;
mod inspect;
mod origin;
mod pairs;
mod plan;
mod simulation;
mod summary;

pub use ci::{CheckFile, Judgement, Verdict, Verdicts, check_json, check_text, junit, sarif};
pub use columns::{Column, ColumnValues, columns};
pub use csv::{CSV_HEADER, REPORT_COLUMNS, ReportColumn, Unrounded, csv_field, csv_rows, write_csv};
pub use diff::{Difference, MovedTarget, OtherDifference, diff_csv, diff_summary, diff_text, difference};
pub(crate) use digest::Spot;
pub use digest::{Digest, digest_text};
pub use driven::{path_csv, path_law_text};
pub use findings::Findings;
pub use identification::{identify_answer, identify_text, residual_csv};
pub use inspect::{Extent, InspectFile, InspectFiles, KeptLine, Reached, inspect_table};
pub use origin::{Origin, VERSION};
pub use pairs::InsertedTarget;
pub use plan::plan_text;
pub use simulation::{CutterAt, DeviationMap, MapFigures, OneSide, SurfacePoint, map_cell, map_csv, probe, stl};
pub use summary::{FailureLine, FileSummary, kept_text, summary_line};
