//! Results for people and for scripts: CSV rows, summary lines, JSON, CI formats, differences of two programs.

mod ci;
mod columns;
mod csv;
mod diff;
mod findings;
pub mod html;
mod identification;
mod inspect;
mod origin;
mod pairs;
mod plan;
mod simulation;
mod summary;

pub use ci::{CheckFile, check_json, junit, sarif};
pub use columns::{Column, ColumnValues, columns};
pub use csv::{CSV_HEADER, csv_field, csv_rows, write_csv};
pub use diff::{Difference, MovedTarget, OtherDifference, diff_csv, diff_text, difference, shift_mm};
pub use findings::Findings;
pub use identification::{identify_answer, identify_text, residual_csv};
pub use inspect::{InspectFile, InspectFiles, KeptLine, inspect_table};
pub use origin::{Origin, VERSION};
pub use pairs::InsertedTarget;
pub use plan::plan_text;
pub use simulation::{DeviationMap, MapFigures, OneSide, SurfacePoint, map_cell, map_csv, probe, stl};
pub use summary::{FileSummary, summary_line};
