use super::frames::named_tool;
use super::parallelism::Parallelism;
use super::solve::Solver;
use super::{Point, Prepared};
use crate::cell::Cell;
use crate::effects::ToolFrame;
use crate::equilibrium::{EquilibriumError, WarmStart};
use crate::robot::{Joints, Pose};
use crate::text::Diagnostic;
use nalgebra::{Rotation3, Translation3, Vector3};

/// A tool of the cell by its name; without one the cell's only one, or the bare flange where it declares none.
///
/// # Errors
/// No tool has the name; the cell has several and none is named.
pub fn tool_of(cell: &Cell, name: Option<&str>) -> Result<ToolFrame, Vec<Diagnostic>> {
    let bare = ToolFrame { flange_from_tcp: Pose::identity(), mass: 0.0, cog: Vector3::zeros() };
    match (name, cell.tools.len()) {
        (Some(name), _) => named_tool(cell, name),
        (None, 0 | 1) => Ok(cell.tools.values().next().copied().unwrap_or(bare)),
        (None, _) => {
            let known = cell.tools.keys().cloned().collect::<Vec<_>>().join(", ");
            Err(Diagnostic::error("cell.unknown-tool", "", "the cell declares several tools, and none is named")
                .help(format!("name one of {known}"))
                .into())
        }
    }
}

/// Where the TCP of the loaded arm is, in the base (m): at commanded axis angles as the controller counts them (degrees),
/// each under its own force on the tool at the TCP (N, base axes). The arm stands: nothing has a direction of travel.
#[must_use]
pub fn predict_poses(
    cell: &Cell,
    tool: &ToolFrame,
    axes_deg: &[[f64; 6]],
    forces_n: &[[f64; 3]],
) -> Vec<Result<Pose, EquilibriumError>> {
    let robot = &cell.arm.robot;
    let point = |(deg, force): (&[f64; 6], &[f64; 3])| {
        let motor = robot.motor_from_axes_deg(deg);
        let mut point = Point::measured(robot.forward(&motor) * tool.flange_from_tcp, motor, Joints::zeros());
        if force.iter().any(|component| component.abs() > 0.0) {
            point.set_force(Vector3::from(*force));
        }
        point
    };
    let prepared = Prepared::of_points(axes_deg.iter().zip(forces_n).map(point).collect(), robot, *tool);
    let solver = Solver::new(&cell.arm, &prepared, Parallelism::Threads);
    let there = solver.forward(|i| prepared.points[i].as_programmed(), |_| WarmStart::default());
    let actual = |(there, point): (Result<_, EquilibriumError>, &Point)| {
        let there: crate::equilibrium::PredictedPose = there?;
        let nominal = &point.wobj_from_tcp;
        let position = Translation3::from(nominal.translation.vector + there.shift);
        Ok(Pose::from_parts(position, Rotation3::new(there.turn) * nominal.rotation))
    };
    there.into_iter().zip(&prepared.points).map(actual).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::{Cutting, Situation};
    use crate::text::Source;

    #[test]
    fn poses_are_those_of_the_equilibrium_one_by_one() {
        let text = std::fs::read("samples/slot/cell.toml").unwrap();
        let cell = Cell::read(&Source::new("cell.toml", text)).unwrap();
        let tool = tool_of(&cell, None).unwrap();
        let axes_deg: Vec<[f64; 6]> = (0..20).map(|i| [f64::from(i), 20.0, 10.0, 15.0, 40.0, -30.0]).collect();
        let forces: Vec<[f64; 3]> = (0..20).map(|i| [100.0, -50.0 * f64::from(i), 300.0]).collect();
        let found = predict_poses(&cell, &tool, &axes_deg, &forces);
        for ((found, deg), force) in found.iter().zip(&axes_deg).zip(&forces) {
            let motor = cell.arm.robot.motor_from_axes_deg(deg);
            let nominal = cell.arm.robot.forward(&motor) * tool.flange_from_tcp;
            let situation = Situation {
                base_from_wobj: Pose::identity(),
                gravity: cell.arm.robot.gravity(),
                wobj_from_tcp: nominal,
                tool,
                cutting: Cutting::Constant(Vector3::from(*force)),
                normal: Vector3::z(),
                velocity: Vector3::zeros(),
                cut_length: 0.0,
                time: 0.0,
                temperature: None,
                payload: 0.0,
                units: &[],
            };
            let one = cell.arm.predict(&situation, &motor, &Joints::zeros()).unwrap().wobj_from_tcp;
            let off = found.as_ref().unwrap().translation.vector - one.translation.vector;
            assert!(off.norm() < 1e-11, "{off}");
            assert!((one.translation.vector - nominal.translation.vector).norm() > 1e-5);
            assert!((found.as_ref().unwrap().rotation.matrix() - one.rotation.matrix()).amax() < 1e-9);
        }
    }
}
