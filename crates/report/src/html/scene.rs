//! The surroundings of a path on its page: the arm, its tracks, the blank and the nominal part.

use deflex_cell::Cell;
use deflex_robot::{Carries, EXTERNAL_AXES, UnitKind};
use deflex_stock::{Blank, ClosedMesh};
use nalgebra::Vector3;
use serde_json::{Value, json};

/// An edge is drawn if the surfaces at it meet at more than this angle, rad. The facets of round faces meet at less.
const EDGE: f64 = 0.35;
/// Largest number of edges of a body, the sharpest first: more would hide its form.
const MOST_EDGES: usize = 4_000;

/// A line on the page, mm.
type Line = [[f64; 3]; 2];

/// The arm as modified Denavit-Hartenberg rows (rad, mm) with the counting direction of each axis, the linear units
/// below it with their direction in the frame of the arm's base, and the edges of the blank and the nominal part (mm,
/// work object frame).
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
                "axis": unit.named.to_string(), "direction": [in_base.x, in_base.y, in_base.z],
                "min": end(unit.min), "max": end(unit.max),
            }))
        })
        .collect();
    let stock = cell.stock.as_ref().and_then(|stock| stock.blank.as_ref()).map(|blank| match blank {
        Blank::Box(bounds) => edges_of_box(bounds),
        Blank::Mesh(mesh) => edges(mesh),
    });
    let part = cell.part.as_ref().and_then(|part| part.mesh.as_ref()).map(|mesh| edges(mesh));
    json!({
        "links": links, "sign": axes.sign, "parallelogram": axes.parallelogram, "counted_23": counted,
        "tracks": tracks, "stock": stock, "part": part,
    })
}

/// The edges that show the form of a body; for a body without sharp edges, those of its bounding box.
fn edges(mesh: &ClosedMesh) -> Vec<Line> {
    let mut sharp = mesh.sharp_edges(EDGE);
    sharp.truncate(MOST_EDGES);
    if sharp.is_empty() { edges_of_box(&mesh.bounds()) } else { sharp.into_iter().map(line).collect() }
}

fn edges_of_box([low, high]: &[Vector3<f64>; 2]) -> Vec<Line> {
    let corner = |n: usize| Vector3::from_fn(|k, _| if n >> k & 1 == 1 { high[k] } else { low[k] });
    let from = |n: usize| [1, 2, 4].into_iter().filter(move |bit| n & bit == 0).map(move |bit| [n, n | bit]);
    (0..8).flat_map(from).map(|ends| line(ends.map(corner))).collect()
}

fn line(ends: [Vector3<f64>; 2]) -> Line {
    /// Coordinates are rounded to a micrometre, which is less than a pixel for a part of any size.
    const PER_MM: f64 = 1e3;
    ends.map(|end| [0, 1, 2].map(|k| (1e3 * end[k] * PER_MM).round() / PER_MM))
}
