//! Frames that program and cell declare differently.

use super::frames::{object_frame, tool_frame};
use deflex_cell::Cell;
use deflex_program::Program;
use deflex_robot::{Pose, turn_between};
use deflex_text::{Diagnostic, Severity};

/// Frames that differ by more than this are different frames, m. Printed digits and calibrations differ by less.
const NOISE_M: f64 = 1e-5;
/// The same for a turn, rad: it moves a point at a distance of 1 m by as much.
const NOISE_RAD: f64 = 1e-5;

/// A warning for each tool and work object that program and cell declare differently. The controller uses the program's, and so does
/// deflex.
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
    tools.chain(wobjs).filter_map(|(key, own, of_cell)| contradiction(program, &key, &own, &of_cell)).collect()
}

fn contradiction(program: &Program, key: &str, own: &Pose, of_cell: &Pose) -> Option<Diagnostic> {
    let apart = (own.translation.vector - of_cell.translation.vector).norm();
    let turned = turn_between(&own.rotation, &of_cell.rotation).norm();
    if apart <= NOISE_M && turned <= NOISE_RAD {
        return None;
    }
    let file = program.sources.first().map_or("", |source| &source.name);
    let message = format!(
        "[{key}] of the cell is {:.3} mm and {:.4}° from what the program declares: the program's values are used",
        1e3 * apart,
        turned.to_degrees()
    );
    Some(
        Diagnostic::error("cell.contradiction", file, message).severity(Severity::Warning).help(
            "the controller runs the program's own declaration: correct the wrong one, or remove it from the cell",
        ),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames;
    use deflex_text::Source;

    /// The cosine of the turn between them is rounded to more than 1.
    #[test]
    fn frames_that_are_the_same_do_not_contradict() {
        let source = Source::new("m.mod", &b"MODULE M\nENDMODULE\n"[..]);
        let program = deflex_program::rapid::read(vec![source], Vec::new()).unwrap();
        let turned = |q: [f64; 4]| frames::pose([321.5, 0.0, 148.25], q);
        #[allow(clippy::approx_constant)] // as programs print it
        let half = 0.707_106_78;
        for same in [[half, 0.0, half, 0.0], [half, half, 0.0, 0.0], [half, 0.0, 0.0, half], [0.5; 4]] {
            assert_eq!(contradiction(&program, "tools.tA", &turned(same), &turned(same)), None, "{same:?}");
        }
        let other =
            contradiction(&program, "tools.tA", &turned([1.0, 0.0, 0.0, 0.0]), &turned([0.0, 1.0, 0.0, 0.0])).unwrap();
        assert!(other.message.contains("180.0000°"), "{}", other.message);
    }
}
