//! Mechanical units: what a program means on a track, on a positioner, on both, against the same program without them.

use crate::identify::no_data;
use approx::assert_abs_diff_eq;
use deflex::cell::Cell;
use deflex::correct::{Correct, Corrected, Options, Prepared, Status, compensate, predict};
use deflex::identify::{Input, identify};
use deflex::program::{Program, rapid};
use deflex::robot::{AxisName, Carries, Pose, Unit, UnitKind, Units};
use deflex::text::{Source, applied};
use nalgebra::{Isometry3, Matrix4, Rotation3, Translation3, UnitQuaternion, Vector3};
use proptest::prelude::*;

const CELL: &str = r#"
[robot]
model = "irb6660-205-1.9"
base_mm = BASE
[robot.stiffness]
joint_nm_per_rad = [8.86e5, 5.5e5, 1.85e6, 3.3e5, 2.1e5, 8.81e4]
[limits]
max_correction_mm = 5.0
max_step_mm = 5.0
[controller]
compensates = []
[cut]
force = "constant"
force_n = [80.0, -120.0, 250.0]
frame = "wobj"
[[effect]]
kind = "gravity"
tool = true
mass_kg = [0, 120, 90, 60, 20, 10]
first_moment_kg_m = [[0, 0, 0], [40, 0, 0], [20, 5, 0], [0, 0, -15], [0, 2, 0], [0, 0, 1]]
[[effect]]
kind = "base_compliance"
mm_per_n = [1e-5, 2e-5, 1e-5]
rad_per_nm = [2e-8, 1e-8, 1e-8]
[[effect]]
kind = "backlash"
half_gap_rad = [2e-5, 3e-5, 2e-5, 1e-5, 1e-5, 4e-5]
"#;

pub(crate) const TRACK: &str = r#"
[[unit]]
name = "TRACK1"
axis = "eax_a"
kind = "linear"
carries = "robot"
direction = [0.0, 0.96, 0.28]
min = -2000.0
max = 2000.0
"#;

pub(crate) const TABLE: &str = r#"
[[unit]]
name = "STN1"
axis = "eax_b"
kind = "rotary"
carries = "part"
base_mm = [1300.0, 0.0, 700.0]
base_quat = [0.9961946980917455, 0.08715574274765817, 0.0, 0.0]
min = -360.0
max = 360.0
"#;

pub(crate) fn cell(base_mm: [f64; 3], units: &str) -> Cell {
    let text = CELL.replace("BASE", &format!("{base_mm:?}")) + units;
    Cell::read(&Source::new("cell.toml", text.into_bytes())).unwrap()
}

fn quat(roll: f64, pitch: f64) -> [f64; 4] {
    let q = UnitQuaternion::from_euler_angles(std::f64::consts::PI + roll, pitch, 0.3);
    [q.w, q.i, q.j, q.k]
}

/// Lines of `MoveL`, or of any other text.
fn program(wobj: &str, lines: &[String]) -> Program {
    let text = format!(
        "MODULE M\n  PERS tooldata tA:=[TRUE,[[20,0,210],[1,0,0,0]],[18,[0,0,120],[1,0,0,0],0,0,0]];\n  \
         PERS wobjdata wA:={wobj};\n  PROC main()\n{}\n  ENDPROC\nENDMODULE\n",
        lines.join("\n")
    );
    rapid::read(vec![Source::new("m.mod", text.into_bytes())], Vec::new()).unwrap()
}

fn line([x, y, z]: [f64; 3], quat: [f64; 4], external: &str) -> String {
    format!("    MoveL [[{x},{y},{z}],{quat:?},[0,0,0,0],[{external}]],v50,fine,tA\\WObj:=wA;")
}

/// A path around the middle of the work object; `external` receives the share of the path.
fn walk(count: usize, external: impl Fn(f64) -> String) -> Vec<String> {
    let at = |i: usize| {
        let share = i as f64 / (count - 1) as f64;
        let place = [100.0 * share, 60.0 * (4.0 * share).sin(), 10.0 * share];
        line(place, quat(0.1 * share, -0.2 * share), &external(share))
    };
    (0..count).map(at).collect()
}

const NONE: &str = "9E9,9E9,9E9,9E9,9E9,9E9";
const FIXED: &str = "[FALSE,TRUE,\"\",[[1300,0,900],[1,0,0,0]],[[0,0,0],[1,0,0,0]]]";
const ON_TABLE: &str = "[FALSE,FALSE,\"stn1\",[[9,9,9],[1,0,0,0]],[[-50,0,200],[1,0,0,0]]]";

fn options() -> Options {
    Options { correct: Correct::Pose, ..Options::default() }
}

fn corrected(program: &Program, cell: &Cell) -> Corrected {
    let corrected = compensate(program, cell, &options()).unwrap();
    assert!(corrected.failures.is_empty(), "{:?}", corrected.failures);
    corrected
}

/// The cell without lost motion, which has the sign of the net motion of a joint where the cell has units, and of its arrival elsewhere.
pub(crate) fn without_lost_motion(mut cell: Cell) -> Cell {
    cell.arm.effects.retain(|effect| effect.kind() != "backlash");
    cell
}

/// Both come to the same, to 1e-9 mm.
pub(crate) fn same(a: &Corrected, b: &Corrected) {
    assert_eq!(a.rows.len(), b.rows.len());
    for (a, b) in a.rows.iter().zip(&b.rows) {
        assert!(a.is_solved() && a.error_norm_mm() > 1e-3);
        for k in 0..3 {
            assert_abs_diff_eq!(a.error_mm[k], b.error_mm[k], epsilon = 1e-9);
            assert_abs_diff_eq!(a.error_deg[k], b.error_deg[k], epsilon = 1e-9);
            assert_abs_diff_eq!(a.force_n[k], b.force_n[k], epsilon = 1e-7);
            // Printed numbers: one that is close to a tie may be a digit apart.
            assert_abs_diff_eq!(a.correction_mm[k], b.correction_mm[k], epsilon = 2.5e-4);
        }
        let path = |row: &deflex::correct::Row| row.path.unwrap().max_mm;
        assert_abs_diff_eq!(path(a), path(b), epsilon = 3e-4);
    }
}

#[test]
fn a_track_that_stands_is_a_moved_base() {
    let on_track = program(FIXED, &walk(9, |_| "250,9E9,9E9,9E9,9E9,9E9".into()));
    let plain = program(FIXED, &walk(9, |_| NONE.into()));
    let (tracked, moved) = (cell([0.0; 3], TRACK), cell([0.0, 240.0, 70.0], ""));
    same(&corrected(&on_track, &tracked), &corrected(&plain, &moved));
    let of = |program, cell| predict(program, cell, &options(), None).unwrap();
    for (a, b) in of(&on_track, &tracked).rows.iter().zip(&of(&plain, &moved).rows) {
        assert_abs_diff_eq!(a.path.unwrap().max_mm, b.path.unwrap().max_mm, epsilon = 1e-9);
    }
}

#[test]
fn a_table_that_stands_is_a_turned_work_object() {
    let tilt = Isometry3::new(Vector3::new(1300.0, 0.0, 700.0), Vector3::x() * 10_f64.to_radians());
    let frame = tilt * UnitQuaternion::from_euler_angles(0.0, 0.0, 25_f64.to_radians());
    let (p, q) = (frame.translation.vector, frame.rotation);
    let turned = format!(
        "[FALSE,TRUE,\"\",[[{},{},{}],[{},{},{},{}]],[[-50,0,200],[1,0,0,0]]]",
        p.x, p.y, p.z, q.w, q.i, q.j, q.k
    );
    let on_table = program(ON_TABLE, &walk(9, |_| "9E9,25,9E9,9E9,9E9,9E9".into()));
    let plain = program(&turned, &walk(9, |_| NONE.into()));
    let base = [0.0; 3];
    same(&corrected(&on_table, &cell(base, TABLE)), &corrected(&plain, &cell(base, "")));
}

#[test]
fn a_robot_on_a_turning_column_feels_its_weight_where_it_leans() {
    let column = "[[unit]]\nname = \"COL\"\naxis = \"eax_a\"\nkind = \"rotary\"\ncarries = \"robot\"\n\
                  base_quat = [0.7071067811865476, 0.7071067811865476, 0.0, 0.0]\n";
    // The column turns about −y of the world: 10° of it lean the base.
    let leaned = cell([0.0; 3], "");
    let lean = Rotation3::from_axis_angle(&Vector3::x_axis(), std::f64::consts::FRAC_PI_2)
        * Rotation3::from_axis_angle(&Vector3::z_axis(), 10_f64.to_radians())
        * Rotation3::from_axis_angle(&Vector3::x_axis(), -std::f64::consts::FRAC_PI_2);
    let robot = leaned.arm.robot.clone().standing_at(Pose::from_parts(Translation3::identity(), lean));
    let mut leaned = leaned;
    leaned.arm.robot = robot;
    let on_column = program(FIXED, &walk(5, |_| "10,9E9,9E9,9E9,9E9,9E9".into()));
    let plain = program(FIXED, &walk(5, |_| NONE.into()));
    same(&corrected(&on_column, &cell([0.0; 3], column)), &corrected(&plain, &leaned));
}

fn moving() -> (Program, Cell) {
    let external = |share: f64| format!("{},{},9E9,9E9,9E9,9E9", 200.0 * share - 50.0, 30.0 * share);
    (program(ON_TABLE, &walk(21, external)), cell([0.0; 3], &format!("{TRACK}{TABLE}")))
}

#[test]
fn the_arm_goes_where_the_units_have_taken_base_and_part() {
    let (program, cell) = moving();
    let prepared = Prepared::new(&program, &cell, &options()).unwrap();
    let matrix = |q: [f64; 4], p: [f64; 3]| {
        let [w, x, y, z] = q;
        Matrix4::new(
            1.0 - 2.0 * (y * y + z * z),
            2.0 * (x * y - w * z),
            2.0 * (x * z + w * y),
            p[0],
            2.0 * (x * y + w * z),
            1.0 - 2.0 * (x * x + z * z),
            2.0 * (y * z - w * x),
            p[1],
            2.0 * (x * z - w * y),
            2.0 * (y * z + w * x),
            1.0 - 2.0 * (x * x + y * y),
            p[2],
            0.0,
            0.0,
            0.0,
            1.0,
        )
    };
    let one = [1.0, 0.0, 0.0, 0.0];
    for (i, point) in prepared.points.iter().enumerate() {
        let share = i as f64 / 20.0;
        let (along, turn) = (200.0 * share - 50.0, (30.0 * share).to_radians());
        let world_from_base = matrix(one, [0.0, 0.96e-3 * along, 0.28e-3 * along]);
        let table = matrix([0.9961946980917455, 0.08715574274765817, 0.0, 0.0], [1.3, 0.0, 0.7])
            * matrix([(0.5 * turn).cos(), 0.0, 0.0, (0.5 * turn).sin()], [0.0; 3]);
        let place = [0.1 * share, 0.06 * (4.0 * share).sin(), 0.01 * share];
        let target = matrix(quat(0.1 * share, -0.2 * share), place);
        let world_from_tcp = table * matrix(one, [-0.05, 0.0, 0.2]) * target;
        let flange = cell.arm.robot.forward(&point.motor).to_homogeneous();
        let reached = world_from_base * flange * matrix(one, [0.02, 0.0, 0.21]);
        assert_abs_diff_eq!(reached, world_from_tcp, epsilon = 1e-9);
    }
}

/// A program as it is written.
fn rewritten(program: &Program, corrected: &Corrected) -> Program {
    let rewritten = corrected.rewritten.as_ref().unwrap();
    let bytes = applied(&program.sources[0].bytes, &rewritten.edits[0]);
    rapid::read(vec![Source::new("m.mod", bytes)], Vec::new()).unwrap()
}

#[test]
fn a_program_on_moving_units_lands_where_it_was_meant_to() {
    let (program, cell) = moving();
    let corrected = corrected(&program, &cell);
    let written = rewritten(&program, &corrected);
    let there = predict(&written, &cell, &options(), Some(&program)).unwrap();
    for (row, there) in corrected.rows.iter().zip(&there.rows) {
        assert!(row.error_norm_mm() > 0.05, "{row:?}");
        assert!(row.remaining_norm_mm() < 1e-3, "{row:?}");
        assert!(there.error_norm_mm() < 1e-3, "{there:?}");
    }
    assert!(corrected.rows.iter().all(|row| row.status == Status::Ok));
}

#[test]
fn a_way_cut_in_two_is_the_same_way() {
    let cell = cell([0.0; 3], &format!("{TRACK}{TABLE}"));
    let at = |share: f64| {
        let external = format!("{},{},9E9,9E9,9E9,9E9", 300.0 * share, 40.0 * share);
        line([150.0 * share, 40.0, 0.0], quat(0.0, 0.0), &external)
    };
    let path = |shares: &[f64]| {
        let lines: Vec<String> = shares.iter().map(|share| at(*share)).collect();
        let rows = predict(&program(ON_TABLE, &lines), &cell, &options(), None).unwrap().rows;
        rows.iter().skip(1).map(|row| row.path.unwrap().max_mm).fold(0.0, f64::max)
    };
    let (whole, parts) = (path(&[0.0, 1.0]), path(&[0.0, 0.25, 0.5, 0.75, 1.0]));
    assert!(whole > 0.05);
    assert_abs_diff_eq!(whole, parts, epsilon = 2e-3);
}

#[test]
fn what_is_inserted_has_the_axes_of_its_place() {
    let cell = cell([0.0; 3], &format!("{TRACK}{TABLE}"));
    let lines = [
        line([0.0, 40.0, 0.0], quat(0.0, 0.0), "0,0,9E9,9E9,9E9,9E9"),
        line([150.0, 40.0, 0.0], quat(0.0, 0.0), "300,40,9E9,9E9,9E9,9E9"),
    ];
    let program = program(ON_TABLE, &lines);
    let options = Options { subdivide: Some(2e-6), ..options() };
    let corrected = compensate(&program, &cell, &options).unwrap();
    assert!(corrected.failures.is_empty(), "{:?}", corrected.failures);
    let written = rewritten(&program, &corrected);
    assert!(written.targets.len() > 3, "{}", written.targets.len());
    let last = corrected.rows.last().unwrap();
    // But for the first half millimetre, where the force begins.
    assert!(last.path.unwrap().mean_square_mm2.sqrt() < 2e-3, "{:?}", last.path);
    for target in &written.targets {
        let external = target.external.as_ref().unwrap();
        let [along, turn] = [0, 1].map(|axis| external.position(AxisName::External(axis)).unwrap());
        assert_abs_diff_eq!(turn, along * 40.0 / 300.0, epsilon = 2e-3);
        assert_eq!(external.written[2], None);
    }
}

fn kept(program: &Program, cell: &Cell) -> Vec<&'static str> {
    let corrected = compensate(program, cell, &options()).unwrap();
    assert!(corrected.failures.is_empty(), "{:?}", corrected.failures);
    let edits = &corrected.rewritten.as_ref().unwrap().edits[0];
    let reason = |row: &deflex::correct::Row| match row.status {
        Status::Kept(reason) => {
            assert!(!row.is_solved() && row.correction_norm_mm() <= 0.0);
            Some(reason.text())
        }
        _ => None,
    };
    let kept: Vec<&'static str> = corrected.rows.iter().filter_map(reason).collect();
    assert!(kept.len() < corrected.rows.len() || edits.is_empty(), "{edits:?}");
    kept
}

#[test]
fn axes_without_a_unit_are_kept_and_not_called_unreachable() {
    let away = |share: f64| format!("9E9,9E9,{},9E9,9E9,9E9", 9000.0 * share);
    let program = program(FIXED, &walk(4, away));
    for cell in [cell([0.0; 3], ""), cell([5000.0, 0.0, 0.0], "")] {
        assert_eq!(kept(&program, &cell), ["external axis in use without a [[unit]] in the cell"; 4]);
    }
}

#[test]
fn a_work_object_on_an_unknown_unit_is_kept() {
    let program = program(ON_TABLE, &walk(3, |_| NONE.into()));
    assert_eq!(kept(&program, &cell([0.0; 3], "")).len(), 3);
    // Declared, but its position is stated nowhere.
    assert_eq!(kept(&program, &cell([0.0; 3], TABLE)), ["position of a mechanical unit is not programmed here"; 3]);
}

#[test]
fn a_unit_is_not_sent_beyond_its_limits() {
    let program = program(FIXED, &walk(3, |share| format!("{},9E9,9E9,9E9,9E9,9E9", 100.0 + 1e5 * share.floor())));
    let refused = compensate(&program, &cell([0.0; 3], TRACK), &options()).unwrap_err();
    assert_eq!(refused.len(), 1);
    assert!(refused[0].message.contains("TRACK1") && refused[0].line == 7, "{refused:?}");
}

#[test]
fn what_rapid_says_of_axes_is_followed() {
    let at = |external: &str| line([0.0; 3], quat(0.0, 0.0), external);
    let lines = [
        "    ActUnit TRACK1;".into(),
        at("100,10,9E9,9E9,9E9,9E9"),
        "    EOffsSet [5,0,0,0,0,0];".into(),
        at("100,10,9E9,9E9,9E9,9E9"),
        "    EOffsOff;".into(),
        "    EOffsOn\\ExeP:=[[0,0,0],[1,0,0,0],[0,0,0,0],[120,15,9E9,9E9,9E9,9E9]],[[0,0,0],[1,0,0,0],[0,0,0,0],[100,10,9E9,9E9,9E9,9E9]];".into(),
        at("100,10,9E9,9E9,9E9,9E9"),
        "    MoveAbsJ [[0,0,0,0,30,0],[40,50,9E9,9E9,9E9,9E9]]\\NoEOffs,v50,fine,tA;".into(),
        "    EOffsOff;".into(),
        at("100,10,9E9,9E9,9E9,9E9"),
        "    MoveExtJ [[9E9,9E9,9E9,9E9,9E9,9E9],[300,20,9E9,9E9,9E9,9E9]],vrot10,fine;".into(),
        "    DeactUnit STN1;".into(),
        at("300,9E9,9E9,9E9,9E9,9E9"),
    ];
    let program = program(FIXED, &lines);
    let seen: Vec<[Option<f64>; 2]> = program
        .targets
        .iter()
        .map(|target| target.external.as_ref().unwrap())
        .map(|external| [0, 1].map(|axis| external.position(AxisName::External(axis))))
        .collect();
    let both = |a, b| [Some(a), Some(b)];
    let wanted = [
        both(100.0, 10.0),
        both(105.0, 10.0),
        both(120.0, 15.0),
        both(40.0, 50.0),
        both(100.0, 10.0),
        [Some(300.0), None],
    ];
    assert_eq!(seen, wanted);
    let last = program.targets.last().unwrap().external.as_ref().unwrap();
    assert!(last.moved_alone);
    assert_eq!((&*last.inactive[0].name, last.inactive[0].stands[1]), ("STN1", Some(20.0)));
    assert!(program.targets.iter().all(|target| target.located));
}

#[test]
fn a_deactivated_unit_stands_where_it_was() {
    let table = |unit: &str, external: &str| {
        let lines = [
            line([0.0; 3], quat(0.0, 0.0), "9E9,25,9E9,9E9,9E9,9E9"),
            unit.to_owned(),
            line([50.0, 0.0, 0.0], quat(0.0, 0.0), external),
        ];
        corrected(&program(ON_TABLE, &lines), &cell([0.0; 3], TABLE))
    };
    let stands = table("    DeactUnit STN1;", "9E9,70,9E9,9E9,9E9,9E9");
    same(&stands, &table("", "9E9,25,9E9,9E9,9E9,9E9"));
}

#[test]
fn axes_that_are_known_only_at_run_time_are_kept() {
    let lines = [
        "    EOffsOn [[0,0,0],[1,0,0,0],[0,0,0,0],[100,10,9E9,9E9,9E9,9E9]];".into(),
        line([0.0; 3], quat(0.0, 0.0), "100,9E9,9E9,9E9,9E9,9E9"),
    ];
    let reasons = kept(&program(FIXED, &lines), &cell([0.0; 3], TRACK));
    assert_eq!(reasons, ["offset of external axes is known only at run time"]);
}

/// Where the tool is in the work object, by hand, when table and track stand off by a motion in their own frames.
fn seen_by_hand(i: usize, table_off: &Pose, track_off: &Pose) -> Vector3<f64> {
    let share = i as f64 / 20.0;
    let turn = (30.0 * share).to_radians();
    let pose = |x: f64, y: f64, z: f64, q: UnitQuaternion<f64>| {
        Pose::from_parts(Translation3::new(x, y, z), q.to_rotation_matrix())
    };
    let one = UnitQuaternion::identity();
    let table = pose(1.3, 0.0, 0.7, UnitQuaternion::from_euler_angles(10_f64.to_radians(), 0.0, 0.0));
    let turned = pose(0.0, 0.0, 0.0, UnitQuaternion::from_euler_angles(0.0, 0.0, turn));
    let object = pose(-0.05, 0.0, 0.2, one);
    let [w, x, y, z] = quat(0.1 * share, -0.2 * share);
    let target = pose(
        0.1 * share,
        0.06 * (4.0 * share).sin(),
        0.01 * share,
        UnitQuaternion::new_normalize(nalgebra::Quaternion::new(w, x, y, z)),
    );
    // The track's own frame is the world's: the base is carried along by what it is off.
    let world_from_tcp = track_off * table * turned * object * target;
    let seen = (table * table_off * turned * object).inverse() * world_from_tcp;
    1e3 * (seen.translation.vector - target.translation.vector)
}

const NO_FORCE: &str = "[cut]\nforce = \"none\"\n";

fn rigid(effects: &str) -> Cell {
    let text = format!(
        "[robot]\nmodel = \"irb6660-205-1.9\"\n[controller]\ncompensates = []\n{NO_FORCE}{TRACK}{TABLE}{effects}"
    );
    Cell::read(&Source::new("cell.toml", text.into_bytes())).unwrap()
}

fn off(d_mm: [f64; 3], d_rad: [f64; 3]) -> Pose {
    Pose::from_parts((Vector3::from(d_mm) * 1e-3).into(), Rotation3::from_scaled_axis(d_rad.into()))
}

#[test]
fn a_unit_that_stands_elsewhere_takes_along_what_is_on_it() {
    let program = moving().0;
    let (d_mm, d_rad) = ([0.4, -0.3, 0.2], [1e-3, -2e-3, 3e-3]);
    let effect = |unit: &str| {
        format!("[[effect]]\nkind = \"unit_frame\"\nunit = \"{unit}\"\nd_mm = {d_mm:?}\nd_rad = {d_rad:?}\n")
    };
    let (moved, still) = (off(d_mm, d_rad), Pose::identity());
    for (unit, table, track) in [("stn1", &moved, &still), ("TRACK1", &still, &moved)] {
        let rows = predict(&program, &rigid(&effect(unit)), &options(), None).unwrap().rows;
        for (i, row) in rows.iter().enumerate() {
            let wanted = seen_by_hand(i, table, track);
            assert!(wanted.norm() > 0.2);
            assert_abs_diff_eq!(Vector3::from(row.error_mm), wanted, epsilon = 1e-9);
        }
    }
    // Corrected, it is where it was meant to.
    let cell = rigid(&effect("STN1"));
    assert!(corrected(&program, &cell).rows.iter().all(|row| row.remaining_norm_mm() < 1e-3));
}

#[test]
fn an_effect_of_a_unit_that_is_not_declared_is_refused() {
    let text = CELL.replace("BASE", "[0.0, 0.0, 0.0]") + "[[effect]]\nkind = \"unit_frame\"\nunit = \"STN2\"\n" + TABLE;
    let refused = Cell::read(&Source::new("cell.toml", text.into_bytes())).unwrap_err();
    assert!(refused[0].help.as_deref().is_some_and(|help| help.contains("STN1")), "{refused:?}");
}

#[test]
fn a_misplaced_table_is_found() {
    let lines: Vec<String> = (0..96)
        .map(|i| {
            let (x, y) = (60.0 * (0.7 * f64::from(i)).sin(), 60.0 * (1.1 * f64::from(i)).cos());
            let turn = 60.0 * (f64::from(i) / 95.0 - 0.5);
            line([x, y, 5.0 * (0.3 * f64::from(i)).sin()], quat(0.0, 0.0), &format!("0,{turn},9E9,9E9,9E9,9E9"))
        })
        .collect();
    let program = program(ON_TABLE, &lines);
    let truth =
        rigid("[[effect]]\nkind = \"unit_frame\"\nunit = \"STN1\"\nd_mm = [0.4, -0.3, 0.0]\nd_rad = [8e-4, 0, 0]\n");
    let rows = predict(&program, &truth, &options(), None).unwrap().rows;
    let mut table = "target,x_mm,y_mm,z_mm\n".to_owned();
    let mut state = 7_u64;
    for row in &rows {
        // Uniform noise of 2 µm rms.
        let noise: [f64; 3] = std::array::from_fn(|_| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            0.0035 * ((state >> 33) as f64 / f64::from(1_u32 << 30) - 1.0)
        });
        let at: Vec<f64> = (0..3).map(|k| row.position_mm[k] + row.error_mm[k] + noise[k]).collect();
        table += &format!("{},{},{},{}\n", row.target, at[0], at[1], at[2]);
    }
    let measured = deflex::measured::Table::read(&Source::new("m.csv", table.into_bytes())).unwrap();
    let cell = rigid("");
    let runs = vec![(program, measured).into()];
    let found = identify(Input { runs, ..no_data(&cell) }).unwrap();
    let kinds: Vec<&str> = found.added.iter().map(|added| added.kind.as_str()).collect();
    assert_eq!(kinds, ["unit_frame"], "{:?}", found.ranking);
    assert!(found.after.rms_mm < 0.008, "{:?}", found.after);
    let value = |name: &str| found.added[0].parameters.iter().find(|p| p.name == name).unwrap().value;
    assert_abs_diff_eq!(value("d_mm[0]"), 0.4, epsilon = 0.01);
    assert_abs_diff_eq!(value("d_mm[1]"), -0.3, epsilon = 0.01);
}

fn random_unit() -> impl Strategy<Value = (bool, [f64; 3], [f64; 3], [f64; 3], f64)> {
    let three = prop::array::uniform3(-2.0..2.0_f64);
    (any::<bool>(), three.clone(), three.clone(), three, -500.0..500.0_f64)
}

proptest! {
    #[test]
    fn chains_of_units_are_products_of_matrices(all in prop::collection::vec(random_unit(), 1..6), base in prop::array::uniform3(-1.0..1.0_f64)) {
        let units = all.iter().enumerate().map(|(i, (linear, direction, at, turn, _))| Unit {
            name: format!("U{i}"),
            named: AxisName::External(i),
            axis: i,
            kind: if *linear {
                UnitKind::Linear(Vector3::from(*direction).normalize())
            } else {
                UnitKind::Rotary
            },
            carries: Carries::Robot,
            frame: Pose::from_parts(Vector3::from(*at).into(), Rotation3::from_scaled_axis(Vector3::from(*turn))),
            on: i.checked_sub(1),
            min: -1e3,
            max: 1e3,
            max_speed: None,
            free: false,
        });
        let units = Units::new(units.collect()).unwrap();
        let mut external = [f64::NAN; 6];
        all.iter().enumerate().for_each(|(i, unit)| external[i] = unit.4);
        let chain = |at: &dyn Fn(f64) -> f64| all.iter().fold(Matrix4::identity(), |below, (linear, direction, place, turn, e)| {
            let frame = Matrix4::new_translation(&Vector3::from(*place)) * Matrix4::new_rotation(Vector3::from(*turn));
            let moved = if *linear {
                Matrix4::new_translation(&(Vector3::from(*direction).normalize() * at(*e) / 1000.0)) * frame
            } else {
                frame * Matrix4::from_euler_angles(0.0, 0.0, at(*e).to_radians())
            };
            below * moved
        });
        let last = units.world_from_unit(all.len() - 1, &external).to_homogeneous();
        assert_abs_diff_eq!(last, chain(&|e| e), epsilon = 1e-12);
        let base = Matrix4::new_translation(&Vector3::from(base));
        let moved = units.world_from_base(&Pose::from_parts(base.fixed_view::<3, 1>(0, 3).into_owned().into(), Rotation3::identity()), &external);
        let wanted = chain(&|e| e) * chain(&|_| 0.0).try_inverse().unwrap() * base;
        assert_abs_diff_eq!(moved.to_homogeneous(), wanted, epsilon = 1e-10);
    }
}
