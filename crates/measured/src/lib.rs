//! Measured rows from a tracker, a gauge or a dynamometer, assigned to targets.

mod clock;
mod columns;
mod forces;
mod layout;
mod log;
mod table;
mod target;
mod text;

pub use columns::names as column_names;
pub use forces::{ForceRow, Forces};
pub use layout::ColumnNames;
pub use table::{MATCH_MM, MeasuredRow, Rows, Table};
pub use target::TargetRef;
