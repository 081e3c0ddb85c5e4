//! The stock that a program leaves.

use super::context::Context;
use super::removal::{self, Cuts, Removal};
use super::{Options, Prepared, against};
use crate::cell::Cell;
use crate::program::Program;
use crate::text::Diagnostic;

/// Cuts the cell's stock with a program; errors and depth are counted from the original of a corrected one.
///
/// # Errors
/// What [`Prepared::new`] refuses, a cell without `[stock]`, and `run.called-off`.
pub fn cut_stock(
    program: &Program,
    cell: &Cell,
    options: &Options,
    original: Option<&Program>,
    cuts: Cuts,
) -> Result<Removal, Vec<Diagnostic>> {
    let context = Context::whole(program, cell, options);
    let mut prepared = match original {
        Some(original) => against::judged(context, original)?.0,
        None => Prepared::new(program, cell, options)?,
    };
    removal::run(context, &mut prepared, (cuts, &cell.arm))?.ok_or_else(|| {
        let message = match &cell.stock {
            None => "the cell has no [stock] to cut",
            Some(_) => "nothing in the program cuts the stock",
        };
        vec![
            Diagnostic::error("cell.no-stock", "", message)
                .help("add [stock] with box_mm or stl to the cell, and a cutter for the tools that cut it"),
        ]
    })
}
