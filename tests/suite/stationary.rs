//! A stationary tool and a part that the robot holds: the mirror of a tool that the robot leads over a part.

use approx::assert_abs_diff_eq;
use deflex::cell::Cell;
use deflex::correct::{Options, Prepared, Row, Status, compensate, predict};
use deflex::program::{Program, rapid};
use deflex::robot::Pose;
use deflex::text::{Source, apply};
use nalgebra::{Rotation3, Translation3, UnitQuaternion, Vector3};

fn cell(force: Vector3<f64>, effects: &str) -> Cell {
    let text = format!(
        "[robot]\nmodel = \"irb6660-205-1.9\"\nstart_deg = [0, 0, 0, 0, 40, 0]\n[robot.stiffness]\n\
         joint_nm_per_rad = [8.86e5, 5.5e5, 1.85e6, 3.3e5, 2.1e5, 8.81e4]\n[limits]\nmax_correction_mm = 5.0\nmax_step_mm = 5.0\n\
         [controller]\ncompensates = []\n[cut]\nforce = \"constant\"\nforce_n = [{:?}, {:?}, {:?}]\nframe = \"wobj\"\n{effects}",
        force.x, force.y, force.z
    );
    Cell::read(&Source::new("cell.toml", text.into_bytes())).unwrap()
}

const WEIGHT: &str = "[[effect]]\nkind = \"gravity\"\ntool = true\nmass_kg = [0, 120, 90, 60, 20, 10]\n\
                      [[effect]]\nkind = \"base_compliance\"\nmm_per_n = [1e-5, 2e-5, 1e-5]\nrad_per_nm = [2e-8, 1e-8, 1e-8]\n";

/// The spindle in the world, pointing up; the part in the flange.
fn frames() -> (Pose, Pose) {
    let spindle =
        Pose::from_parts(Translation3::new(1.25, 0.1, 0.7), Rotation3::from_axis_angle(&Vector3::y_axis(), 0.2));
    let part = Pose::from_parts(
        Translation3::new(0.03, -0.05, 0.25),
        Rotation3::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI),
    );
    (spindle, part)
}

/// Places on the part.
fn places() -> Vec<Pose> {
    let at = |i: usize| {
        let share = i as f64 / 7.0;
        let turn = Rotation3::from_euler_angles(0.1 * share, -0.15 * share, 0.3);
        Pose::from_parts(Translation3::new(0.08 * share, 0.05 * (3.0 * share).sin(), 0.01 * share), turn)
    };
    (0..8).map(at).collect()
}

/// As RAPID writes a pose.
fn text(pose: &Pose) -> String {
    let (p, q) = (pose.translation.vector * 1e3, UnitQuaternion::from_rotation_matrix(&pose.rotation));
    format!("[{},{},{}],[{},{},{},{}]", p.x, p.y, p.z, q.w, q.i, q.j, q.k)
}

fn program(tool: &str, wobj: &str, targets: &[Pose]) -> Program {
    let lines = targets.iter().map(|target| {
        format!("    MoveL [{},[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v50,fine,tA\\WObj:=wA;\n", text(target))
    });
    let text = format!(
        "MODULE M\n  PERS tooldata tA:=[{tool},[18,[0,0,120],[1,0,0,0],0,0,0]];\n  \
         PERS wobjdata wA:=[{wobj},[[0,0,0],[1,0,0,0]]];\n  PROC main()\n{}  ENDPROC\nENDMODULE\n",
        lines.collect::<String>()
    );
    rapid::read(vec![Source::new("m.mod", text.into_bytes())], Vec::new()).unwrap()
}

/// The part led against the spindle.
fn held() -> Program {
    let (spindle, part) = frames();
    let (tool, wobj) = (format!("FALSE,[{}]", text(&spindle)), format!("TRUE,TRUE,\"\",[{}]", text(&part)));
    program(&tool, &wobj, &places())
}

fn rows(program: &Program, cell: &Cell) -> Vec<Row> {
    let predicted = predict(program, cell, &Options::default(), None).unwrap();
    assert!(predicted.failures.is_empty(), "{:?}", predicted.failures);
    predicted.rows
}

#[test]
fn the_part_is_where_the_spindle_is() {
    let (spindle, part) = frames();
    let cell = cell(Vector3::zeros(), "");
    let prepared = Prepared::new(&held(), &cell, &Options::default()).unwrap();
    for (point, place) in prepared.points.iter().zip(places()) {
        let seen = cell.arm.robot.forward(&point.motor) * part * place;
        assert_abs_diff_eq!(seen, spindle, epsilon = 1e-9);
    }
}

#[test]
fn it_is_the_mirror_of_a_tool_that_moves() {
    let (spindle, part) = frames();
    for force in [Vector3::new(90.0, -60.0, 250.0), -Vector3::new(90.0, -60.0, 250.0)] {
        for (row, place) in rows(&held(), &cell(force, WEIGHT)).iter().zip(places()) {
            // The place on the part is the tool, and the spindle the work object.
            let tool = format!("TRUE,[{}]", text(&(part * place)));
            let wobj = format!("FALSE,TRUE,\"\",[{}]", text(&spindle));
            let mirror = cell(-(place.rotation.inverse() * force), WEIGHT);
            let moving = &rows(&program(&tool, &wobj, &[Pose::identity()]), &mirror)[0];
            let turn = Rotation3::from_scaled_axis(Vector3::from(moving.error_deg).map(f64::to_radians));
            let shift = -(place.rotation * (turn.inverse() * Vector3::from(moving.error_mm)));
            assert!(shift.norm() > 0.05);
            assert_abs_diff_eq!(Vector3::from(row.error_mm), shift, epsilon = 1e-9);
            let turned = -(place.rotation * Vector3::from(moving.error_deg));
            assert_abs_diff_eq!(Vector3::from(row.error_deg), turned, epsilon = 1e-9);
            assert_abs_diff_eq!(Vector3::from(row.force_n), force, epsilon = 1e-9);
        }
    }
}

#[test]
fn the_tool_is_pushed_over_the_part_the_way_the_force_goes() {
    for force in [Vector3::new(0.0, 0.0, 300.0), Vector3::new(0.0, 0.0, -300.0), Vector3::new(200.0, 50.0, 0.0)] {
        for row in rows(&held(), &cell(force, "")) {
            assert!(Vector3::from(row.error_mm).dot(&force) > 1.0, "{row:?}");
        }
    }
}

#[test]
fn a_corrected_part_meets_the_spindle() {
    let (program, cell) = (held(), cell(Vector3::new(90.0, -60.0, 250.0), WEIGHT));
    for correct in [deflex::correct::Correct::Pose, deflex::correct::Correct::Position] {
        let options = Options { correct, ..Options::default() };
        let corrected = compensate(&program, &cell, &options).unwrap();
        assert!(corrected.failures.is_empty(), "{:?}", corrected.failures);
        let mut bytes = Vec::new();
        let edits = &corrected.rewritten.as_ref().unwrap().edits[0];
        apply(&program.sources[0].bytes, edits, &mut bytes).unwrap();
        let written = rapid::read(vec![Source::new("m.mod", bytes)], Vec::new()).unwrap();
        let there = predict(&written, &cell, &Options::default(), Some(&program)).unwrap();
        for (row, there) in corrected.rows.iter().zip(&there.rows) {
            assert!(row.error_norm_mm() > 0.05 && row.status == Status::Ok, "{row:?}");
            assert!(row.remaining_norm_mm() < 1e-3 && there.error_norm_mm() < 1e-3, "{row:?} {there:?}");
        }
    }
}

#[test]
fn a_tool_and_a_part_that_do_not_fit_are_kept() {
    let (spindle, part) = frames();
    let both = program(&format!("TRUE,[{}]", text(&part)), &format!("TRUE,TRUE,\"\",[{}]", text(&part)), &places());
    let neither =
        program(&format!("FALSE,[{}]", text(&spindle)), &format!("FALSE,TRUE,\"\",[{}]", text(&part)), &places());
    for program in [both, neither] {
        let corrected = compensate(&program, &cell(Vector3::zeros(), ""), &Options::default()).unwrap();
        assert!(corrected.failures.is_empty() && corrected.rewritten.unwrap().edits[0].is_empty());
        assert!(corrected.rows.iter().all(|row| matches!(row.status, Status::Kept(_)) && !row.is_solved()));
    }
}

#[test]
fn an_effect_of_a_tool_on_the_arm_is_refused() {
    let effect = "[[effect]]\nkind = \"tool_frame\"\nd_mm = [0.1, 0, 0]\n";
    let refused = compensate(&held(), &cell(Vector3::zeros(), effect), &Options::default()).unwrap_err();
    assert!(refused[0].message.contains("tool_frame"), "{refused:?}");
}
