//! Deviations of one surface from another: walls, pocket corners and floors, whatever the lattice.

use super::{MM, block, cutter};
use deflex::report::{DeviationMap, map_cell};
use deflex::stock::{Front, Mesh, Stock, ToolPose};
use nalgebra::{Unit, Vector3};

/// Resolutions, mm.
const SPACINGS: [f64; 4] = [1.5, 1.0, 0.5, 0.25];
/// Where a finer one shows nothing more.
const COARSE: [f64; 2] = [1.0, 0.5];
const DEPTH: f64 = 6.0;
/// Path of the cutter's centre about a pocket, mm; all of its inside is cleared too.
const POCKET: [[f64; 2]; 2] = [[14.0, 14.0], [34.0, 30.0]];
const RADIUS: f64 = 5.0;

fn tilted(x: f64, y: f64, z: f64, turn: f64) -> ToolPose {
    let axis = Vector3::new(turn.sin(), 0.0, turn.cos());
    ToolPose { tip: Vector3::new(x, y, z) * MM, axis: Unit::new_normalize(axis) }
}

fn stock(spacing: f64, moves: &[[ToolPose; 2]]) -> Stock {
    let mut stock = Stock::new(block(48.0, 44.0, 8.0), spacing * MM);
    let coefficients = super::coefficients();
    let front = Front::new(&cutter(2.0 * RADIUS, 0.0), &coefficients);
    for [from, to] in moves {
        stock.remove(front.solid(), from, to);
    }
    stock
}

/// Passes along y at places over x.
fn passes(places: &[f64], turn: f64) -> Vec<[ToolPose; 2]> {
    places.iter().map(|x| [tilted(*x, -10.0, -DEPTH, turn), tilted(*x, 54.0, -DEPTH, turn)]).collect()
}

fn pocket([dx, dy]: [f64; 2]) -> Vec<[ToolPose; 2]> {
    let [[left, near], [right, far]] = POCKET;
    let at = |x: f64, y: f64| tilted(x + dx, y + dy, -DEPTH, 0.0);
    let mut corners = vec![[left, near], [right, near], [right, far], [left, far], [left, near]];
    corners.extend([[left, 19.0], [right, 19.0], [right, 25.0], [left, 25.0]]);
    corners.windows(2).map(|pair| [at(pair[0][0], pair[0][1]), at(pair[1][0], pair[1][1])]).collect()
}

/// Points of the programmed surface (mm), and how far the actual one is, above zero left over.
fn map(programmed: &Stock, actual: &Stock) -> Vec<(Vector3<f64>, f64)> {
    let mesh: Mesh = programmed.surface(map_cell(programmed));
    let map = DeviationMap::new(mesh, programmed, programmed.blank(), actual);
    map.points().into_iter().map(|point| (point.position_mm.into(), point.deviation_mm)).collect()
}

/// The largest distance of found deviations from wanted ones, and how many there are of each sign.
fn off(map: &[(Vector3<f64>, f64)], wanted: impl Fn(&Vector3<f64>) -> Option<f64>) -> (f64, usize) {
    let both = map.iter().filter_map(|(at, found)| Some((found - wanted(at)?).abs()));
    both.fold((0.0, 0), |(most, count), off| (f64::max(most, off), count + 1))
}

#[test]
fn upright_walls_are_measured_across() {
    for spacing in SPACINGS {
        for shift in [0.96, -0.96] {
            let programmed = stock(spacing, &passes(&[18.0, 24.0], 0.0));
            // The wall on the right stands further to the left, or to the right.
            let actual = stock(spacing, &passes(&[18.0, 24.0 - shift], 0.0));
            let wall = |at: &Vector3<f64>| {
                let on_wall = (at.x - 24.0 - RADIUS).abs() < 1e-3 && (2.0..42.0).contains(&at.y);
                // The floor and the rim are near too.
                let way = f64::min(
                    shift.abs(),
                    f64::min(
                        if shift > 0.0 { -at.z } else { f64::INFINITY },
                        at.z + DEPTH + if shift > 0.0 { 1e3 } else { 0.0 },
                    ),
                );
                on_wall.then_some(way.copysign(shift))
            };
            let (most, count) = off(&map(&programmed, &actual), wall);
            assert!(count > 60 && most < 0.01, "{spacing} {shift}: {most} of {count}");
        }
    }
}

#[test]
fn leaning_walls_are_measured_across() {
    let turn = 5.0_f64.to_radians();
    for spacing in COARSE {
        for shift in [0.96, -0.96, 0.2, -0.2] {
            let programmed = stock(spacing, &passes(&[18.0, 24.0], turn));
            let actual = stock(spacing, &passes(&[18.0, 24.0 - shift / turn.cos()], turn));
            // The wall on the right leans outwards by 5°: its foot is the rim of the cutter's flat.
            let wall = |at: &Vector3<f64>| {
                let across = (at.x - 24.0) * turn.cos() - (at.z + DEPTH) * turn.sin();
                let on_wall = (across - RADIUS).abs() < 1e-3 && (2.0..42.0).contains(&at.y);
                (on_wall && (-4.5..-1.5).contains(&at.z)).then_some(shift)
            };
            let (most, count) = off(&map(&programmed, &actual), wall);
            assert!(count > 20 && most < 0.01, "{spacing} {shift}: {most} of {count}");
        }
    }
}

#[test]
fn pocket_corners_are_measured_to_the_nearest_wall() {
    let [[left, near], [right, far]] = POCKET;
    for shift in [[0.3, 0.4], [-0.7, 0.25]] {
        let mut largest = Vec::new();
        for spacing in COARSE {
            let (programmed, actual) = (stock(spacing, &pocket([0.0; 2])), stock(spacing, &pocket(shift)));
            // At half the height walls alone are near: a rectangle grown by the radius, about which distances are known.
            let walls = |at: &Vector3<f64>| {
                let [x, y] = [at.x - shift[0], at.y - shift[1]];
                let outside = (x - x.clamp(left, right)).hypot(y - y.clamp(near, far));
                let grown = |gap: f64| ((x - left + gap).min(right + gap - x)).min((y - near + gap).min(far + gap - y));
                let wanted = if outside > 0.0 { outside - RADIUS } else { -grown(RADIUS) };
                (-4.0..-2.0).contains(&at.z).then_some(wanted)
            };
            let map = map(&programmed, &actual);
            let (most, count) = off(&map, walls);
            // Between the lines that stand for a curved wall, the wall itself is looked for.
            assert!(count > 30 && most < 0.01, "{spacing} {shift:?}: {most} of {count}");
            let at_walls = map.iter().filter(|(at, _)| (-4.0..-2.0).contains(&at.z)).map(|(_, d)| d.abs());
            largest.push(at_walls.fold(0.0, f64::max));
        }
        // The largest is that of a wall square to the shift: the size of the shift where a corner's arc faces it.
        let size = shift[0].hypot(shift[1]);
        assert!(largest.iter().all(|found| (found - size).abs() < 0.03 * size), "{largest:?} for {size}");
    }
}

#[test]
fn a_floor_left_over_is_measured_down_to_the_floor() {
    for spacing in COARSE {
        let programmed = stock(spacing, &passes(&[18.0, 24.0], 0.0));
        let lift = |pose: ToolPose| ToolPose { tip: pose.tip + Vector3::new(0.0, 0.0, 0.3 * MM), ..pose };
        let lifted: Vec<_> = passes(&[18.0, 24.0], 0.0).into_iter().map(|pair| pair.map(lift)).collect();
        let actual = stock(spacing, &lifted);
        let floor = |wanted: f64| {
            move |at: &Vector3<f64>| {
                (at.z + DEPTH < 1e-3 && (15.0..27.0).contains(&at.x) && (2.0..42.0).contains(&at.y)).then_some(wanted)
            }
        };
        let (most, count) = off(&map(&programmed, &actual), floor(0.3));
        assert!(count > 60 && most < 0.001, "{spacing}: {most} of {count}");
        let raised = |at: &Vector3<f64>| floor(-0.3)(&(at - Vector3::new(0.0, 0.0, 0.3)));
        let (most, count) = off(&map(&actual, &programmed), raised);
        assert!(count > 60 && most < 0.001, "{spacing}: {most} of {count}");
    }
}
