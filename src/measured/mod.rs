//! Measured rows: what a tracker, a gauge or a dynamometer said, aligned to targets.

mod table;

pub use table::{MeasuredRow, Rows, Table, TargetRef};
