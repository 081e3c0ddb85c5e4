//! Frames that a program declares, and the cell declares otherwise.

use super::frames::{object_frame, tool_frame};
use crate::cell::Cell;
use crate::program::Program;
use crate::robot::Pose;
use crate::text::{Diagnostic, Severity};

/// Digits and calibrations leave less, m: a frame that is further off is another one.
const NOISE_M: f64 = 1e-5;
/// The same of a turn, rad: what moves a point 1 m away by it.
const NOISE_RAD: f64 = 1e-5;

/// A warning for each tool and work object that program and cell declare differently: the program's is the one that the
/// controller takes, and so does deflex.
pub(super) fn contradictions(program: &Program, cell: &Cell) -> Vec<Diagnostic> {
    let tools = program.tools.iter().filter_map(|tool| {
        let own = tool_frame(tool.data.as_ref()?).flange_from_tcp;
        let of_cell = cell.tools.get(&tool.name.to_ascii_uppercase())?.flange_from_tcp;
        Some((format!("tools.{}", tool.name), own, of_cell))
    });
    let wobjs = program.wobjs.iter().filter_map(|wobj| {
        let own = object_frame(wobj.data.as_ref()?);
        Some((format!("wobjs.{}", wobj.name), own, *cell.wobjs.get(&wobj.name.to_ascii_uppercase())?))
    });
    tools.chain(wobjs).filter_map(|(key, own, of_cell)| told(program, &key, &own, &of_cell)).collect()
}

fn told(program: &Program, key: &str, own: &Pose, of_cell: &Pose) -> Option<Diagnostic> {
    let apart = (own.translation.vector - of_cell.translation.vector).norm();
    let turned = own.rotation.rotation_to(&of_cell.rotation).angle();
    if apart <= NOISE_M && turned <= NOISE_RAD {
        return None;
    }
    let file = program.sources.first().map_or("", |source| &source.name);
    let message = format!(
        "[{key}] of the cell is {:.3} mm and {:.4}° from what the program declares, which is taken",
        1e3 * apart,
        turned.to_degrees()
    );
    Some(
        Diagnostic::error("cell.contradiction", file, message).severity(Severity::Warning).help(
            "the controller runs the program's own declaration: mend whichever is wrong, or remove it from the cell",
        ),
    )
}
