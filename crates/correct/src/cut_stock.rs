//! The stock after a program.

use super::context::Context;
use super::removal::{self, Cuts, Removal};
use super::{Options, Prepared, against};
use deflex_cell::Cell;
use deflex_program::Program;
use deflex_text::Diagnostic;

/// Cuts the cell's stock with a program. For a corrected program, errors and depth count from its original.
///
/// # Errors
/// As [`Prepared::new`]; a cell without `[stock]`; `run.called-off`.
///
/// # Examples
/// ```no_run
/// use deflex_correct::{Cuts, Options, cut_stock};
/// use deflex_cell::Cell;
/// use deflex_program::rapid;
/// use deflex_text::Source;
///
/// let cell = Cell::read(&Source::new("cell.toml", std::fs::read("../../samples/stock/cell.toml")?))?;
/// let program = rapid::read(vec![Source::new("part.mod", std::fs::read("../../samples/stock/part.mod")?)], vec![])?;
/// let removal = cut_stock(&program, &cell, &Options::default(), None, Cuts::Deflected)?;
/// println!("{:.1} cm³ removed", 1e6 * removal.stock.removed());
/// # Ok::<(), deflex_text::Diagnostics>(())
/// ```
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
    removal::run(context, &mut prepared, cuts, &cell.arm)?.ok_or_else(|| {
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
