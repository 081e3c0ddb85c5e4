//! Rows with their own motor angles: what is found in positions and orientations, and which rows are refused.

use crate::identify::{no_data, rough};
use deflex::cell::Cell;
use deflex::correct::{Standing, predict_poses, tool_of};
use deflex::identify::{Identification, Input, identify};
use deflex::measured::Table;
use deflex::robot::{Joints, Pose};
use deflex::text::{Diagnostic, Source};
use nalgebra::{Rotation3, Translation3, UnitQuaternion, Vector3};

const CELL: &str = include_str!("../fixtures/parallel_axes.toml");

/// One measured row: motor angles (degrees), position (mm), orientation and whether it is held out.
#[derive(Clone)]
struct Row {
    deg: [f64; 6],
    position_mm: Vector3<f64>,
    turned: UnitQuaternion<f64>,
    held_out: bool,
}

/// Standard deviations of the instrument: mm, and degrees.
const NOISE: (f64, f64) = (0.02, 0.01);

/// What an instrument in a frame of its own sees of an arm whose links, tool and joints are not as the cell says.
fn seen(count: usize) -> Vec<Row> {
    let text = CELL.replace("a_mm = -425", "a_mm = -428").replace("d_mm = 109.15", "d_mm = 111.0");
    let real = Cell::read(&Source::new("real", text.into_bytes())).unwrap();
    let tool = Pose::from_parts(Translation3::new(0.004, -0.006, 0.038), Rotation3::identity());
    let device = Pose::from_parts(Translation3::new(9.0, -4.0, 1.0), Rotation3::from_euler_angles(2.0, 0.4, -1.0));
    let probe = UnitQuaternion::from_euler_angles(0.3, -1.1, 2.0);
    let row = |i: usize| {
        let deg: [f64; 6] = std::array::from_fn(|j| 52.0 * rough(1000 * j + i));
        let motor = Joints::from(deg.map(f64::to_radians)) + Joints::new(0.0, 0.0, 0.0, 1e-3, -2e-3, 0.0);
        let there = device * real.arm.robot.forward(&motor) * tool;
        let noise = |from: usize, size: f64| Vector3::from_fn(|k, _| size * rough(from + 3 * i + k));
        let turned = UnitQuaternion::from_rotation_matrix(&there.rotation) * probe;
        Row {
            deg,
            position_mm: 1e3 * there.translation.vector + noise(77_000, NOISE.0),
            turned: UnitQuaternion::from_scaled_axis(noise(99_000, NOISE.1.to_radians())) * turned,
            held_out: i % 4 == 2,
        }
    };
    (0..count).map(row).collect()
}

/// Four numbers as some instrument writes an orientation.
type Four = fn(&UnitQuaternion<f64>) -> [f64; 4];

/// What is done to a row.
type Change = fn(&mut Row);

/// The rows as a file; orientations as `four` writes them, where there are any.
fn file(rows: &[Row], four: Option<Four>) -> String {
    let mut csv = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm,holdout".to_owned();
    csv += if four.is_some() { ",qw,qx,qy,qz\n" } else { "\n" };
    for row in rows {
        let numbers = row.deg.iter().chain(row.position_mm.iter()).map(f64::to_string);
        let four = four.iter().flat_map(|four| four(&row.turned)).map(|v| format!("{v:.7}"));
        let held_out = u8::from(row.held_out).to_string();
        csv += &numbers.chain([held_out]).chain(four).collect::<Vec<_>>().join(",");
        csv.push('\n');
    }
    csv
}

fn scalar_first(q: &UnitQuaternion<f64>) -> [f64; 4] {
    [q.w, q.i, q.j, q.k]
}

fn found(csv: String) -> Result<Identification, Vec<Diagnostic>> {
    let cell = Cell::read(&Source::new("cell.toml", CELL.as_bytes().to_vec())).unwrap();
    let poses = vec![Table::read(&Source::new("poses.csv", csv.into_bytes()))?];
    identify(Input { poses, ..no_data(&cell) })
}

#[test]
fn forces_are_those_of_the_base_however_the_instrument_stands() {
    let text = std::fs::read_to_string("samples/slot/cell.toml").unwrap();
    let text = text + "\n[tools.reflector]\ntcp_mm = [30, 0, 250]\ntcp_quat = [1, 0, 0, 0]\n";
    let cell = Cell::read(&Source::new("cell.toml", text.into_bytes())).unwrap();
    let tool = tool_of(&cell, Some("reflector")).unwrap();
    let device = Pose::from_parts(Translation3::new(4.0, -2.0, 1.0), Rotation3::from_euler_angles(2.0, 0.4, -1.6));
    let deg = |i: usize| -> [f64; 6] {
        let middle = [0.0, 25.0, 15.0, 0.0, 40.0, 0.0];
        std::array::from_fn(|j| middle[j] + 25.0 * rough(1000 * j + i))
    };
    let force = |i: usize| -> [f64; 3] { std::array::from_fn(|k| 250.0 * rough(50_000 + 1000 * k + i)) };
    let (degs, forces): (Vec<_>, Vec<_>) = (0..80).map(|i| (deg(i), force(i))).unzip();
    let loaded = predict_poses(&cell, &tool, &degs, &forces, Standing::default()).unwrap();
    let mut csv = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm,fx_n,fy_n,fz_n\n".to_owned();
    for (i, there) in loaded.iter().enumerate() {
        let seen = 1e3 * (device * there.as_ref().unwrap()).translation.vector;
        let noise = Vector3::from_fn(|k, _| NOISE.0 * rough(77_000 + 3 * i + k));
        let numbers =
            degs[i].iter().copied().chain((seen + noise).iter().copied().collect::<Vec<_>>()).chain(forces[i]);
        csv += &numbers.map(|number| number.to_string()).collect::<Vec<_>>().join(",");
        csv.push('\n');
    }
    let poses = vec![Table::read(&Source::new("poses.csv", csv.into_bytes())).unwrap()];
    let found = identify(Input { poses, tool: Some("reflector"), ..no_data(&cell) }).unwrap();
    assert!(found.added.is_empty(), "{:?}", found.added);
    // The declared cell is right: what stays is the noise, of three axes and with the pose of the instrument fitted.
    for errors in [&found.before, &found.after] {
        assert!((0.7..1.3).contains(&(errors.rms_mm / (NOISE.0 * 3.0_f64.sqrt()))), "{errors:?}");
    }
}

/// Width of a parameter's interval.
fn width(found: &Identification, kind: &str, name: &str) -> f64 {
    let effect = found.added.iter().find(|added| added.kind == kind).unwrap();
    let parameter = effect.parameters.iter().find(|p| p.name == name).unwrap();
    parameter.ci95[1] - parameter.ci95[0]
}

#[test]
fn orientations_narrow_what_is_known_of_the_wrist() {
    let rows = seen(160);
    let positions = found(file(&rows, None)).unwrap();
    let both = found(file(&rows, Some(scalar_first))).unwrap();
    assert!(positions.orientation_noise_deg.is_none());
    let noise = both.orientation_noise_deg.unwrap() / NOISE.1;
    assert!((0.85..1.15).contains(&noise), "noise off by {noise}");
    assert!(both.after.rms_mm < 1.05 * positions.after.rms_mm, "{:?} {:?}", both.after, positions.after);
    for name in ["d_alpha_rad[4]", "d_alpha_rad[5]", "d_theta_rad[4]"] {
        let [with, without] = [&both, &positions].map(|found| width(found, "link_geometry", name));
        assert!(with < 0.7 * without, "{name}: {with} with orientations, {without} without");
    }
}

#[test]
fn orientations_of_another_convention_are_refused() {
    let cases: [(&str, Four); 4] = [
        ("they have the scalar last", |q| [q.i, q.j, q.k, q.w]),
        ("they are inverse: give", |q| [q.w, -q.i, -q.j, -q.k]),
        ("they are inverse and have the scalar last", |q| [-q.i, -q.j, -q.k, q.w]),
        ("is the probe's orientation in the device's frame", |q| [q.i, -q.k, q.w, q.j]),
    ];
    let rows = seen(60);
    for (reason, four) in cases {
        let error = &found(file(&rows, Some(four))).unwrap_err()[0];
        assert!(error.help.as_ref().unwrap().contains(reason), "{reason}: {error:?}");
    }
}

#[test]
fn rows_that_cannot_be_true_are_refused_with_their_line() {
    let rows = seen(60);
    let with = |change: Change| {
        let mut rows = rows.clone();
        change(&mut rows[20]);
        found(file(&rows, Some(scalar_first))).unwrap_err()
    };
    let cases: [(&str, Change); 6] = [
        ("q2_deg is 9000, and the axis goes from -360° to 360°", |row| row.deg[1] = 9000.0),
        ("q5_deg, q6_deg are given in part", |row| row.deg[2] = f64::NAN),
        ("z_mm is `inf`", |row| row.position_mm.z = f64::INFINITY),
        ("mm from where these motor angles put the reflector", |row| row.position_mm.x += 5e4),
        ("far beyond any robot", |row| row.position_mm.x += 5e6),
        ("qw, qx, qy, qz have norm 0.0000", |row| row.turned.as_mut_unchecked().coords.fill(0.0)),
    ];
    for (message, change) in cases {
        let errors = with(change);
        assert_eq!((errors.len(), errors[0].line), (1, 22), "{errors:?}");
        assert!(errors[0].message.contains(message), "{errors:?}");
        assert!(errors[0].help.is_some(), "{errors:?}");
    }
}

#[test]
fn files_in_other_units_or_axes_are_refused_with_the_reason() {
    let cases: [(&str, Change); 6] = [
        ("the angles are radians", |row| row.deg = row.deg.map(f64::to_radians)),
        ("the positions are metres", |row| row.position_mm *= 1e-3),
        ("the positions are inches", |row| row.position_mm /= 25.4),
        ("x and y are swapped", |row| row.position_mm.swap_rows(0, 1)),
        ("q3_deg has the wrong sign", |row| row.deg[2] = -row.deg[2]),
        ("belong to another robot", |row| row.deg.reverse()),
    ];
    for (reason, change) in cases {
        let mut rows = seen(60);
        rows.iter_mut().for_each(change);
        let error = &found(file(&rows, None)).unwrap_err()[0];
        assert!(error.help.as_ref().unwrap().contains(reason), "{reason}: {error:?}");
    }
}

/// Half a metre off is no other file: the row is left out.
#[test]
fn blunders_are_outliers() {
    let mut rows = seen(160);
    rows[20].position_mm.x += 500.0;
    rows[41].position_mm.z -= 3.0;
    let found = found(file(&rows, None)).unwrap();
    assert_eq!(found.outliers, [22, 43]);
    assert!(found.after.rms_mm < 0.045, "{:?}", found.after);
}

/// A reflector that is off by as much the other way on the held-out rows: they decide nothing, but the answer says that it is worse on them.
#[test]
fn an_answer_that_is_worse_on_held_out_rows_says_so() {
    let cell = Cell::read(&Source::new("cell.toml", CELL.as_bytes().to_vec())).unwrap();
    let mut rows = seen(160);
    for row in &mut rows {
        let side = if row.held_out { -0.002 } else { 0.002 };
        let motor = Joints::from(row.deg.map(f64::to_radians));
        let there = cell.arm.robot.forward(&motor) * Translation3::new(side, 0.0, 0.030);
        row.position_mm = 1e3 * there.translation.vector;
    }
    let found = found(file(&rows, None)).unwrap();
    assert_eq!(found.added.iter().map(|added| &*added.kind).collect::<Vec<_>>(), ["tool_frame"]);
    assert!(found.after.rms_mm > 1.5 * found.before.rms_mm, "{:?}", found.after);
    assert!(found.advice[0].contains("worse than the declared one on the held-out rows"), "{:?}", found.advice);
}
