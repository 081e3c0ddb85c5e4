//! The setup of a run from its arguments.

use super::args::{Corrected as What, Model, Reports};
use crate::session::context::Context;
use crate::session::forces::ForceFile;
use crate::session::input::CellFile;
use crate::session::read::both;
use crate::session::setup::Setup;
use deflex::correct::{Correct, Options};
use deflex::text::Diagnostic;
use std::sync::Arc;

/// Reads the cell and the forces of a run, and sets its options.
pub(super) fn setup(model: &Model, context: Context, what: What, reports: &Reports) -> Result<Setup, Vec<Diagnostic>> {
    let cell = CellFile::read(&model.cell);
    let names = cell.as_ref().ok().and_then(|cell| cell.cell.columns.as_ref());
    let forces = model.forces.as_deref().map(|path| ForceFile::read(path, names)).transpose();
    let (cell, forces) = both(cell, forces)?;
    let (rows, forces) = forces.unzip();
    let options = Options {
        correct: match what {
            What::Pose => Correct::Pose,
            What::Position => Correct::Position,
        },
        forces,
        tool: model.tool.clone(),
        free_spin: model.free_spin,
        stiffness: reports.html.is_some(),
        stance: reports.html.is_some(),
        ..Options::default()
    };
    Ok(Setup { cell: Arc::new(cell), forces: rows, context, options })
}
