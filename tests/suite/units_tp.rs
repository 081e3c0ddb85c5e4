//! Motion groups of FANUC TP: what a positioner means, against the same path in a frame that stands, and in RAPID.

use crate::units::{TABLE, cell, same, without_lost_motion};
use deflex::cell::Cell;
use deflex::correct::{Corrected, Options, Status, compensate};
use deflex::program::orientation::{from_zyx_deg, quaternion};
use deflex::program::{Program, rapid, tp};
use deflex::text::Source;
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use std::fmt::Write;

const TOOL: &str = "[tools.\"UT 1\"]\ntcp_mm = [20.0, 0.0, 210.0]\ntcp_quat = [1.0, 0.0, 0.0, 0.0]\nmass_kg = 18.0\ncog_mm = [0.0, 0.0, 120.0]\n";
const ON_TABLE: &str = "[wobjs.\"UF 1\"]\nunit = \"STN1\"\noframe_mm = [-50.0, 0.0, 200.0]\n";
const GUN: &str = "[[unit]]\nname = \"GUN\"\naxis = \"gp3_j1\"\ncarries = \"nothing\"\n";

/// Poses of a walk, mm and degrees.
fn walk() -> Vec<[f64; 6]> {
    let at = |i: u32| {
        let share = f64::from(i) / 8.0;
        [100.0 * share, 60.0 * (4.0 * share).sin(), 10.0 * share, 180.0 - 6.0 * share, 5.0 * share, 17.0]
    };
    (0..9).map(at).map(|pose| pose.map(|value| (1000.0 * value).round() / 1000.0)).collect()
}

/// A TP program along the walk: `option` of its motions, `groups` of its positions.
fn ls(option: &str, groups: impl Fn(usize) -> String) -> Program {
    let (mut statements, mut positions) = (String::new(), String::new());
    for (i, [x, y, z, w, p, r]) in walk().into_iter().enumerate() {
        let n = i + 1;
        let _ = writeln!(statements, "{n:4}:L P[{n}] 50mm/sec FINE {option} ;");
        let _ = writeln!(
            positions,
            "P[{n}]{{ GP1: UF : 1, UT : 1, CONFIG : 'N U T, 0, 0, 0', X = {x:.3} mm, Y = {y:.3} mm, Z = {z:.3} mm, W = {w:.3} deg, \
             P = {p:.3} deg, R = {r:.3} deg {} }};",
            groups(i)
        );
    }
    let text = format!("/PROG  M\n/ATTR\n/MN\n{statements}/POS\n{positions}/END\n");
    tp::read(vec![Source::new("m.ls", text)], Vec::new()).unwrap()
}

/// The same in RAPID.
fn module(wobj: &str, external: impl Fn(usize) -> String) -> Program {
    let mut moves = String::new();
    for (i, [x, y, z, w, p, r]) in walk().into_iter().enumerate() {
        let q = quaternion(&from_zyx_deg([r, p, w]));
        let _ = writeln!(moves, "MoveL [[{x},{y},{z}],{q:?},[0,0,0,0],[{}]],v50,fine,tA\\WObj:=wA;", external(i));
    }
    let text = format!(
        "MODULE M\nPERS tooldata tA:=[TRUE,[[20,0,210],[1,0,0,0]],[18,[0,0,120],[1,0,0,0],0,0,0]];\nPERS wobjdata wA:={wobj};\n\
         PROC main()\n{moves}ENDPROC\nENDMODULE\n"
    );
    rapid::read(vec![Source::new("m.mod", text)], Vec::new()).unwrap()
}

fn of(program: &Program, cell: &Cell) -> Corrected {
    let corrected = compensate(program, cell, &Options::default()).unwrap();
    assert!(corrected.failures.is_empty(), "{:?}", corrected.failures);
    corrected
}

fn group_table() -> String {
    TABLE.replace("eax_b", "gp2_j1")
}

/// Why its targets are not solved, each once.
fn reasons(corrected: &Corrected) -> Vec<&str> {
    let reason = |status: &Status| match status {
        Status::Kept(reason) => Some(reason.text()),
        _ => None,
    };
    let mut all: Vec<&str> = corrected.rows.iter().filter_map(|row| reason(&row.status)).collect();
    all.dedup();
    all
}

#[test]
fn a_positioner_that_stands_is_a_turned_user_frame() {
    let tilt = Isometry3::new(Vector3::new(1300.0, 0.0, 700.0), Vector3::x() * 10_f64.to_radians());
    let on = Isometry3::translation(-50.0, 0.0, 200.0);
    let frame = tilt * UnitQuaternion::from_euler_angles(0.0, 0.0, 25_f64.to_radians()) * on;
    let (p, q) = (frame.translation.vector, frame.rotation);
    let turned = format!(
        "[wobjs.\"UF 1\"]\nuframe_mm = [{}, {}, {}]\nuframe_quat = [{}, {}, {}, {}]\n",
        p.x, p.y, p.z, q.w, q.i, q.j, q.k
    );
    let rigid = |more: &str| without_lost_motion(cell([0.0; 3], more));
    let plain = of(&ls("", |_| String::new()), &rigid(&format!("{TOOL}{turned}")));
    let standing = |_| "GP2: UF : 1, UT : 1, J1 = 25.000 deg".to_owned();
    for option in ["", "COORD"] {
        same(&of(&ls(option, standing), &rigid(&format!("{}{TOOL}{ON_TABLE}", group_table()))), &plain);
    }
    // A user frame that the controller does not let move along: whatever stands on the unit.
    same(&of(&ls("", standing), &rigid(&format!("{}{TOOL}{turned}", group_table()))), &plain);
}

#[test]
fn a_positioner_that_moves_is_one_of_rapid() {
    let turn = |i: usize| 3.75 * i as f64;
    let wobj = "[FALSE,FALSE,\"stn1\",[[0,0,0],[1,0,0,0]],[[-50,0,200],[1,0,0,0]]]";
    let in_rapid = of(&module(wobj, |i| format!("9E9,{},9E9,9E9,9E9,9E9", turn(i))), &cell([0.0; 3], TABLE));
    let units = format!("{}{GUN}{TOOL}{ON_TABLE}", group_table());
    let moving = |i| format!("GP2: UF : 1, UT : 1, J1 = {:.3} deg GP3: UF : 1, UT : 1, J1 = {i}.000 mm", turn(i));
    let in_tp = of(&ls("COORD", moving), &cell([0.0; 3], &units));
    assert_eq!((in_tp.rows.len(), in_rapid.rows.len()), (9, 9));
    for (a, b) in in_tp.rows.iter().zip(&in_rapid.rows) {
        assert!(a.is_solved() && a.error_norm_mm() > 1e-3);
        for k in 0..3 {
            // Three decimals in TP against four.
            assert!((a.error_mm[k] - b.error_mm[k]).abs() < 1e-6, "{:?} {:?}", a.error_mm, b.error_mm);
            assert!((a.correction_mm[k] - b.correction_mm[k]).abs() < 6e-4, "{:?}", a.correction_mm);
        }
    }
    // Straight in the world, and not on the table.
    let straight = compensate(&ls("", moving), &cell([0.0; 3], &units), &Options::default()).unwrap();
    assert_eq!(straight.rows.iter().filter(|row| row.is_solved()).count(), 1);
    assert_eq!(
        reasons(&straight),
        ["the motion group that carries its user frame moves, and the motion is not coordinated (COORD)"]
    );
    // On the table, and not in a frame that stands.
    let fixed =
        units.replace("unit = \"STN1\"", "uframe_mm = [1300.0, 0.0, 900.0]\nuframe_quat = [1.0, 0.0, 0.0, 0.0]");
    let led = compensate(&ls("COORD", moving), &cell([0.0; 3], &fixed), &Options::default()).unwrap();
    assert_eq!(
        reasons(&led),
        ["coordinated (COORD) with a motion group that moves, and does not carry its user frame"]
    );
}

#[test]
fn a_group_without_a_unit_says_what_to_declare() {
    let fixed =
        format!("{TOOL}[wobjs.\"UF 1\"]\nuframe_mm = [1300.0, 0.0, 900.0]\nuframe_quat = [1.0, 0.0, 0.0, 0.0]\n");
    let solved = |groups: &str, units: &str| {
        let cell = cell([0.0; 3], &format!("{units}{fixed}"));
        let program = ls("", |_| groups.to_owned());
        let done = compensate(&program, &cell, &Options::default()).unwrap();
        let reasons = reasons(&done).join("; ");
        (done.rows.iter().filter(|row| row.is_solved()).count(), reasons)
    };
    let gun = "GP3: UF : 0, UT : 1, J1 = 12.000 mm";
    assert_eq!(
        solved(gun, ""),
        (0, "motion group 3 in use without a [[unit]] in the cell (axis = \"gp3_j1\", …)".to_owned())
    );
    assert_eq!(solved(gun, GUN), (9, String::new()));
    // On a unit that stands at zero.
    let table = cell([0.0; 3], &format!("{}{TOOL}{ON_TABLE}", group_table()));
    let at_zero = |option: &str| of(&ls(option, |_| "GP2: UF : 1, UT : 1, J1 = 0.000 deg".to_owned()), &table);
    same(&at_zero("COORD"), &at_zero(""));
    // At zero in all of the program it needs none.
    assert_eq!(solved("GP3: UF : 0, UT : 1, J1 = 0.000 mm", ""), (9, String::new()));
    // Another arm.
    let arm = "GP2: UF : 0, UT : 1, X = 1.0 mm, Y = 2.0 mm, Z = 3.0 mm";
    assert_eq!(solved(arm, &GUN.replace("gp3_j1", "gp2")), (9, String::new()));
    assert_eq!(solved(arm, GUN).0, 0);
}

#[test]
fn units_of_groups_are_checked() {
    let read = |unit: &str| {
        let text = format!("[robot]\nmodel = \"irb6660-205-1.9\"\n{unit}");
        Cell::read(&Source::new("cell.toml", text.into_bytes())).map(|cell| cell.units.all().len())
    };
    let unit = |axis: &str, rest: &str| format!("[[unit]]\nname = \"{axis}\"\naxis = \"{axis}\"\n{rest}");
    let rotary = "kind = \"rotary\"\ncarries = \"part\"\n";
    assert_eq!(
        read(&format!("{}{}", unit("gp2_j1", rotary), unit("gp2_j2", &format!("{rotary}on = \"gp2_j1\"\n")))).unwrap(),
        2
    );
    assert_eq!(read(&unit("E1", rotary)).unwrap(), 1);
    assert_eq!(read(&unit("gp2", "carries = \"nothing\"\n")).unwrap(), 0);
    for (unit, message) in [
        (unit("gp2", rotary), "whole motion group"),
        (unit("gp1_j1", rotary), "unit.0.axis"),
        (unit("gp2_j1", "kind = \"rotary\"\ncarries = \"robot\"\n"), "carries the robot"),
        (unit("gp2_j1", &format!("{rotary}free = true\nmin = 0.0\nmax = 1.0\n")), "positions are not chosen"),
        (unit("gp2_j1", "carries = \"part\"\n"), "kind is missing"),
        (format!("{}{}", unit("gp2_j1", rotary), unit("gp2", "carries = \"nothing\"\n")), "both moved by"),
    ] {
        let errors = format!("{:?}", read(&unit).unwrap_err());
        assert!(errors.contains(message), "{unit}: {errors}");
    }
}
