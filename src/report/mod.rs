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

pub use ci::{CheckFile, Judgement, junit, sarif};
pub(crate) use ci::{Verdict, Verdicts, check_json, check_text};
pub use columns::{Column, ColumnValues, columns};
pub(crate) use csv::csv_field;
pub use csv::{CSV_HEADER, REPORT_COLUMNS, ReportColumn, Unrounded, csv_rows, write_csv};
pub use diff::{Difference, MovedTarget, OtherDifference, difference};
pub(crate) use diff::{diff_csv, diff_summary, diff_text};
pub(crate) use digest::{Digest, Spot, digest_text};
pub(crate) use driven::{path_csv, path_law_text};
pub(crate) use findings::Findings;
pub use identification::{identify_answer, identify_text, residual_csv};
pub(crate) use inspect::inspect_table;
pub use inspect::{Extent, InspectFile, InspectFiles, KeptLine, Reached};
pub use origin::{Origin, VERSION};
pub use pairs::InsertedTarget;
pub use plan::plan_text;
pub(crate) use simulation::{CutterAt, map_csv};
pub use simulation::{DeviationMap, MapFigures, OneSide, SurfacePoint, map_cell, probe, stl};
pub use summary::{FailureLine, FileSummary, summary_line};
