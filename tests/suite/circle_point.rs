//! Circle points are corrected for the orientation with which the tool passes them. The orientations are turned by hand, and compared with
//! programs that make the controller turn the tool to the orientation in the text.

use crate::dense_walk::{CELL, corrected, module, read};
use deflex::cell::Cell;
use deflex::correct::{KeptReason, Options, Prepared, Status, compensate, predict};
use deflex::program::{Program, Reason, ur};
use deflex::text::Source;
use nalgebra::{UnitQuaternion, Vector3};
use std::f64::consts::{FRAC_PI_6, PI};

type Turn = UnitQuaternion<f64>;

fn about(axis: Vector3<f64>, angle: f64) -> Turn {
    Turn::new(axis.normalize() * angle)
}

/// The tool points straight down.
fn down() -> Turn {
    about(Vector3::x(), PI)
}

fn robtarget(place: [f64; 2], turn: &Turn) -> String {
    let [x, y] = place;
    let (w, v) = (turn.w, turn.imag());
    format!("[[{x:.6},{y:.6},0],[{w:.9},{:.9},{:.9},{:.9}],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]", v.x, v.y, v.z)
}

/// A quarter of a circle of 100 mm, with the circle point after a third of it.
fn quarter(mode: &str, via: &Turn, end: &Turn) -> String {
    let (sin, cos) = FRAC_PI_6.sin_cos();
    let [from, via, to] =
        [([100.0, 0.0], &down()), ([100.0 * cos, 100.0 * sin], via), ([0.0, 100.0], end)].map(|(p, q)| robtarget(p, q));
    let go = "v20,fine,tMill\\WObj:=wPart;\n";
    module(&format!("    CirPathMode\\{mode};\n    MoveL {from},{go}    MoveC {via},{to},{go}"))
}

/// Position (mm) and text of the orientation of the circle point of a program.
fn circle_point(text: &str) -> (Vector3<f64>, &str) {
    let mut groups = text.split("MoveC [[").nth(1).unwrap().split(']');
    let numbers: Vec<f64> = groups.next().unwrap().split(',').map(|number| number.parse().unwrap()).collect();
    (Vector3::from_column_slice(&numbers), groups.next().unwrap())
}

#[test]
fn a_circle_point_is_corrected_for_the_orientation_on_the_arc() {
    let cell = Cell::read(&Source::new("cell.toml", CELL.as_bytes())).unwrap();
    let odd = about(Vector3::y(), 0.5) * down();
    let skew = Vector3::new(1.0, 2.0, 0.0);
    // With the path, a third of its quarter turn and of a tilt in the axes of the path; evenly, a third of the turn.
    let z = Vector3::z();
    let with_path = [about(z, PI / 2.0) * about(skew, 0.3) * down(), about(z, FRAC_PI_6) * about(skew, 0.1) * down()];
    let evenly = [about(skew, 0.6) * down(), about(skew, 0.2) * down()];
    for (mode, [end, there]) in [("PathFrame", with_path), ("ObjectFrame", evenly)] {
        let text = quarter(mode, &odd, &end);
        let program = read(&text);
        let prepared = Prepared::new(&program, &cell, &Options::default()).unwrap();
        let passed = UnitQuaternion::from_rotation_matrix(&prepared.points[1].wobj_from_tcp.rotation);
        assert!(passed.angle_to(&there) < 1e-7, "{mode}: {passed} and not {there}");

        let (_, written) = corrected(&program, &cell, None);
        let own = circle_point(&written);
        assert_eq!(own.1, circle_point(&text).1, "{mode}: the controller does not use these numbers");
        // Programs whose circle points are passed with the orientation in the text.
        let corrected_for = |via: &Turn| corrected(&read(&quarter("CirPointOri", via, &end)), &cell, None).1;
        let (same, other) = (corrected_for(&there), corrected_for(&odd));
        let apart = |text: &str| (own.0 - circle_point(text).0).norm();
        assert!(apart(&same) < 1.5e-4 && apart(&other) > 5e-3, "{mode}: {} {}", apart(&same), apart(&other));
        assert_ne!(circle_point(&other).1, own.1, "{mode}: these are used");

        // Judged by the original, nothing remains.
        let judged = predict(&read(&written), &cell, &Options::default(), Some(&program)).unwrap();
        assert!(judged.rows.iter().all(|row| row.error_norm_mm() < 1e-3));
    }
}

/// A quarter of a circle of 100 mm for a small arm, after a line that ends with the tool straight down. The circle point is after a third.
fn small_quarter(before: &str, [via, end]: [&str; 2], mode: &str) -> Program {
    let text = format!(
        "set_tcp(p[0, 0, 0.165, 0, 0, 0])\nset_payload(1.8, [0, 0, 0.07])\n\
         movej(get_inverse_kin(p[0.48, -0.06, 0.14, {PI}, 0, 0], qnear=[0.25, -3.7, 2.0, 0.1, -1.57, 1.8]))\n# deflex cut\n\
         movel(p[0.58, 0, 0.09, {PI}, 0, 0], v=0.02)\n{before}\
         movec(p[0.566602540378, 0.05, 0.09, {via}], p[0.48, 0.1, 0.09, {end}], v=0.02{mode})\n"
    );
    ur::read(vec![Source::new("part.script", text)], Vec::new()).unwrap()
}

fn small_cell() -> Cell {
    Cell::read(&Source::new("cell.toml", std::fs::read("samples/ur/cell.toml").unwrap())).unwrap()
}

fn passed(program: &Program, cell: &Cell) -> Vec<Turn> {
    let prepared = Prepared::new(program, cell, &Options::default()).unwrap();
    prepared.points.iter().map(|point| UnitQuaternion::from_rotation_matrix(&point.wobj_from_tcp.rotation)).collect()
}

#[test]
fn an_orientation_that_says_nothing_chooses_no_way_round() {
    // Universal Robots' manual leaves the orientation of the circle point zero. The tool tilts by 0.3 rad, a third of that up to the circle
    // point, and not the other way round.
    let program = small_quarter("", ["0, 0, 0", &format!("{}, 0, 0", PI - 0.3)], "");
    let passed = passed(&program, &small_cell())[2];
    assert!(passed.angle_to(&about(Vector3::x(), PI - 0.1)) < 1e-7, "{passed}");
}

#[test]
fn a_tool_that_is_fixed_to_the_arc_ends_turned_by_its_angle() {
    let cell = small_cell();
    let fixed = small_quarter("", ["0, 0, 0", "0, 0, 0"], ", mode=1");
    let end = about(Vector3::z(), PI / 2.0) * down();
    let turns = passed(&fixed, &cell);
    assert!(turns[2].angle_to(&(about(Vector3::z(), FRAC_PI_6) * down())) < 1e-7 && turns[3].angle_to(&end) < 1e-7);

    // The same as an even turn by a quarter, except that the orientation at the end is not a number of the text.
    let [x, y, z] = end.scaled_axis().into();
    let even = small_quarter("", ["0, 0, 0", &format!("{x}, {y}, {z}")], "");
    let [(rows, points), (even_rows, even_points)] = [&fixed, &even].map(|program| {
        let corrected = compensate(program, &cell, &Options::default()).unwrap();
        assert!(corrected.failures.is_empty(), "{:?}", corrected.failures);
        let text = program.edited(&corrected.rewritten.unwrap().edits).remove(0).bytes;
        let text = String::from_utf8(text.to_vec()).unwrap();
        let arc = text.split("movec(p[").nth(1).unwrap().to_owned();
        let points: Vec<Vec<f64>> = arc
            .split("p[")
            .map(|point| point.split(']').next().unwrap().split(", ").map(|number| number.parse().unwrap()).collect())
            .collect();
        (corrected.rows, points)
    });
    for (own, other) in points.iter().zip(&even_points) {
        assert_eq!(own[3..], [0.0; 3], "the robot does not use these numbers");
        assert!((0..3).all(|at| (own[at] - other[at]).abs() < 2e-6), "{own:?} {other:?}");
    }
    assert!((points[1][0] - 0.48).abs() > 1e-6 && rows[2].error_norm_mm() > 0.02, "{points:?} {:?}", rows[2]);
    assert!((rows[2].error_norm_mm() - even_rows[2].error_norm_mm()).abs() < 1e-6);
    assert!(rows[2].remaining_norm_mm() < 1e-3, "{:?}", rows[2]);

    // Where it begins at one of two points, its end is unknown.
    let branch = "if get_digital_in(1):\n movel(p[0.5, 0, 0.09, 3.1, 0, 0], v=0.02)\nend\n";
    let unknown = compensate(&small_quarter(branch, ["0, 0, 0", "0, 0, 0"], ", mode=1"), &cell, &Options::default());
    let last = unknown.unwrap().rows.pop().unwrap();
    assert_eq!(last.status, Status::Kept(KeptReason::Program(Reason::Tangent)));
}
