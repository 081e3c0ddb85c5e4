//! Measured rows: what a tracker, a gauge or a dynamometer said, aligned to targets.

mod columns;
mod layout;
mod table;

pub use layout::ColumnNames;
pub use table::{MATCH_MM, MeasuredRow, Rows, Table, TargetRef};
