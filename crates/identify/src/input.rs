//! The input of an identification.

use deflex_cell::Cell;
use deflex_measured::Table;
use deflex_program::Program;

/// The input of an identification. Programs and tables are dropped as soon as their rows are read, because with
/// hundreds of thousands of rows they are most of the memory.
///
/// # Examples
/// ```
/// # let (cell, program, table) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/closed_loop.rs"));
/// use deflex_identify::{Input, Written};
///
/// let input = Input {
///     cell: &cell,
///     runs: vec![(program, table).into()],
///     poses: vec![],
///     tool: None,
///     data_hash: "hash of the data",
///     written: Written::WholeModel,
///     progress: &|share| share < 1.0,
/// };
/// ```
pub struct Input<'a> {
    /// The declared cell.
    pub cell: &'a Cell,
    /// Programs with what was measured on them.
    pub runs: Vec<MeasuredRun>,
    /// Measured rows with their own motor angles.
    pub poses: Vec<Table>,
    /// The tool of `poses`; needed if the cell has several.
    pub tool: Option<&'a str>,
    /// Hash of the data, for the provenance of the effects that are added.
    pub data_hash: &'a str,
    /// Which effects of the model go into the cell.
    pub written: Written,
    /// Receives the share of the work that is done, estimated from the rounds; returning `false` cancels the run.
    pub progress: &'a Progress<'a>,
}

/// A program with what was measured on it.
///
/// # Examples
/// ```
/// # let (cell, program, table) = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/doc/closed_loop.rs"));
/// use deflex_identify::MeasuredRun;
///
/// let run = MeasuredRun { program, original: None, table };
/// println!("{} measured rows", run.table.rows.len());
/// ```
#[derive(Debug)]
pub struct MeasuredRun {
    /// The program that ran.
    pub program: Program,
    /// The original of a corrected program, if there is one: `normal_mm`, and places without a target, are counted from
    /// its path.
    pub original: Option<Program>,
    /// What was measured.
    pub table: Table,
}

impl From<(Program, Table)> for MeasuredRun {
    fn from((program, table): (Program, Table)) -> Self {
        Self { program, original: None, table }
    }
}

/// Which effects of a model go into the cell.
///
/// # Examples
/// ```
/// use deflex_identify::Written;
///
/// assert_eq!(Written::default(), Written::WholeModel);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Written {
    /// All of them, named or not: the errors after are smallest with all.
    #[default]
    WholeModel,
    /// Only those that are named, fitted without the others (`--sparse`).
    NamedAlone,
}

/// Receives the share of the work that is done, from 0 to 1; returning `false` cancels it.
pub type Progress<'a> = dyn Fn(f64) -> bool + Sync + 'a;
