//! What stands about a path on its page: the arm, its tracks, the blank.

use crate::cell::{Cell, EXTERNAL_AXIS_NAMES};
use crate::robot::{Carries, EXTERNAL_AXES, UnitKind};
use serde_json::{Value, json};

/// The arm as modified Denavit-Hartenberg rows (rad, mm) with how its axes are counted, linear units under it with their direction
/// in its base, and the box of the blank (mm, work object axes).
pub(super) fn scene(cell: &Cell) -> Value {
    let robot = &cell.arm.robot;
    let links: Vec<[f64; 4]> =
        robot.links.rows().iter().map(|row| [row.alpha, 1e3 * row.a, 1e3 * row.d, row.theta]).collect();
    let axes = &robot.axes;
    let counted = if axes.coupled_23 { axes.sign[1] * axes.sign[2] } else { 0.0 };
    let units = &cell.units;
    let zero = [0.0; EXTERNAL_AXES];
    let tracks: Vec<Value> = units
        .chain(units.under_robot())
        .filter_map(|at| {
            let unit = &units.all()[at];
            let UnitKind::Linear(direction) = unit.kind else { return None };
            let below = unit.on.map(|on| units.world_from_unit(on, &zero).rotation);
            let in_world = below.map_or(direction, |below| below * direction);
            let in_base = units.world_from_base(&robot.world_from_base, &zero).rotation.inverse() * in_world;
            let end = |limit: f64| limit.is_finite().then_some(limit);
            debug_assert!(unit.carries == Carries::Robot);
            Some(json!({
                "axis": EXTERNAL_AXIS_NAMES[unit.axis], "direction": [in_base.x, in_base.y, in_base.z],
                "min": end(unit.min), "max": end(unit.max),
            }))
        })
        .collect();
    let stock = cell.stock.as_ref().and_then(|stock| stock.blank.as_ref()).map(|blank| {
        let [low, high] = blank.bounds();
        [[low.x, low.y, low.z], [high.x, high.y, high.z]].map(|corner| corner.map(|m| 1e3 * m))
    });
    json!({
        "links": links, "sign": axes.sign, "parallelogram": axes.parallelogram, "counted_23": counted,
        "tracks": tracks, "stock": stock,
    })
}
