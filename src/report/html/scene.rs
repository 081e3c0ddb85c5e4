//! The surroundings of a path on its page: the arm, its tracks, the blank and the nominal part.

use crate::cell::Cell;
use crate::robot::{Carries, EXTERNAL_AXES, UnitKind};
use crate::stock::{Blank, ClosedMesh};
use nalgebra::Vector3;
use serde_json::{Value, json};

/// A surface that turns by more at an edge, rad, shows it: chords of round faces turn by less.
const EDGE: f64 = 0.35;
/// How many edges of a body are drawn, the sharpest first; more would hide the form.
const MOST_EDGES: usize = 4_000;

/// A line on the page, mm.
type Line = [[f64; 3]; 2];

/// The arm as modified Denavit-Hartenberg rows (rad, mm) with how its axes are counted, linear units under it with their direction
/// in its base, and the edges of blank and nominal part (mm, work object axes).
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

/// The edges of a body that show its form; of one without any, those of a box about it.
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
    /// A micrometre is less than a pixel, whatever the part.
    const PER_MM: f64 = 1e3;
    ends.map(|end| [0, 1, 2].map(|k| (1e3 * end[k] * PER_MM).round() / PER_MM))
}
