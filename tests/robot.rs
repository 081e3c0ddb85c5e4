//! The arm against independent numbers (`vectors.json`, made by another program) and against itself.

#![allow(clippy::unwrap_used, clippy::print_stderr)] // helpers of tests; a skipped test says so

use deflex::robot::{BUILTIN, DhRow, Joints, Limits, Links, Pose, Robot, polish};
use nalgebra::{Matrix6, Rotation3, Translation3, Vector3, Vector6};
use proptest::prelude::*;
use serde_json::Value;

/// The vectors carry 16 digits of lengths up to 2 m, in mm.
const DIGITS_MM: f64 = 1e-9;
/// Inverse of forward, m: 1e-9 mm.
const ROUND_TRIP: f64 = 1e-12;

fn vectors() -> Option<Value> {
    let shared = std::env::var("DEFLEX_SHARED").unwrap_or_else(|_| "../shared".into());
    let path = std::path::Path::new(&shared).join("vectors/vectors.json");
    match std::fs::read(&path) {
        Ok(bytes) => Some(serde_json::from_slice(&bytes).unwrap()),
        Err(_) => {
            eprintln!("skipped: {} is not here", path.display());
            None
        }
    }
}

/// The paper's arm, axis 6 as the vectors have it.
fn paper() -> Robot {
    let mut rows = *BUILTIN[0].robot().links.rows();
    rows[5].theta = 90f64.to_radians();
    Robot::new("paper", rows, true, BUILTIN[0].robot().limits)
}

const POSES: [(&str, [f64; 6]); 3] = [
    ("P1", [0.0; 6]),
    ("P2", [10.0, 20.0, 15.0, 30.0, 40.0, -60.0]),
    ("P3", [-35.0, -20.0, 35.0, -110.0, 75.0, 120.0]),
];

fn joints(deg: [f64; 6]) -> Joints {
    Joints::from(deg.map(f64::to_radians))
}

fn number(value: &Value, i: usize, j: usize) -> f64 {
    value[i][j].as_f64().unwrap()
}

fn pose_of(value: &Value) -> Pose {
    let rotation = nalgebra::Matrix3::from_fn(|i, j| number(value, i, j));
    let shift = Vector3::from_fn(|i, _| 1e-3 * number(value, i, 3));
    Pose::from_parts(Translation3::from(shift), Rotation3::from_matrix_unchecked(rotation))
}

#[test]
fn forward_jacobian_and_compliance_are_those_of_the_vectors() {
    let Some(vectors) = vectors() else { return };
    let robot = paper();
    for (name, deg) in POSES {
        let motor = joints(deg);
        let frames = robot.frames(&motor);
        let flange = robot.forward(&motor);
        let wanted = pose_of(&vectors[format!("fk_{name}_I")]);
        assert!((flange.translation.vector - wanted.translation.vector).norm() < 1e-3 * DIGITS_MM);
        assert!((flange.rotation.matrix() - wanted.rotation.matrix()).amax() < 1e-12);
        for tool in ["I", "A", "B"] {
            let point = pose_of(&vectors[format!("fk_{name}_{tool}")]).translation.vector;
            let jacobian = robot.jacobian(&frames, &point);
            let wanted = &vectors[format!("jac_motor_{name}_{tool}")];
            for i in 0..6 {
                for j in 0..6 {
                    let scale = if i < 3 { 1e3 } else { 1.0 };
                    assert!(
                        (scale * jacobian[(i, j)] - number(wanted, i, j)).abs() < DIGITS_MM,
                        "{name} {tool} {i} {j}"
                    );
                }
            }
            let compliance = &vectors[format!("C_motor_1e4_{name}_{tool}")];
            if compliance.is_null() {
                continue;
            }
            let stiffness = Vector6::new(8.86e5, 5.5e5, 1.85e6, 3.3e5, 2.1e5, 8.81e4);
            let own = jacobian * Matrix6::from_diagonal(&stiffness.map(|k| 1.0 / k)) * jacobian.transpose();
            for i in 0..3 {
                for j in 0..3 {
                    // m/N against mm/N.
                    assert!((1e3 * own[(i, j)] - number(compliance, i, j)).abs() < 1e-14);
                }
            }
        }
    }
}

#[test]
fn parallel_axes_give_the_lower_arm_no_angular_part() {
    let robot = paper();
    let jacobian = robot.jacobian(&robot.frames(&joints(POSES[1].1)), &Vector3::new(1.8, 0.4, 1.2));
    assert!(jacobian.fixed_view::<3, 1>(3, 1).norm() < 1e-15);
    assert!((jacobian.fixed_view::<3, 1>(0, 1).norm() - 0.7).abs() < 1e-12);
}

#[test]
fn a_singular_wrist_holds_axis_4_and_still_reaches() {
    let robot = BUILTIN[3].robot();
    let motor = joints([10.0, 20.0, 15.0, 33.0, 0.0, -60.0]);
    let pose = robot.forward(&motor);
    let found = robot.inverse_near(&pose, &motor).unwrap();
    assert!((found - motor).amax() < 1e-7, "{found}");
    assert!((robot.forward(&found).translation.vector - pose.translation.vector).norm() < ROUND_TRIP);
}

#[test]
fn out_of_reach_says_by_how_much() {
    let robot = BUILTIN[0].robot();
    let far = Pose::from_parts(Translation3::new(3.0, 0.0, 0.8145), Rotation3::identity());
    let error = robot.inverse_near(&far, &Joints::zeros()).unwrap_err().to_string();
    // Wrist at (3.0, 0, 0.6145): 2.7074 m from axis 2, reach 0.7 + hypot(0.28, 0.893) = 1.6359 m.
    assert!(error.contains("out of the arm's reach"), "{error}");
}

#[test]
fn a_chain_without_an_explicit_inverse_is_polished() {
    // A UR10's rows (no spherical wrist).
    let rows = [
        [0.0, 0.0, 127.3],
        [90.0, 0.0, 0.0],
        [0.0, -612.0, 0.0],
        [0.0, -572.3, 163.941],
        [90.0, 0.0, 115.7],
        [-90.0, 0.0, 92.2],
    ];
    let rows =
        rows.map(|[alpha, a, d]: [f64; 3]| DhRow { alpha: alpha.to_radians(), a: 1e-3 * a, d: 1e-3 * d, theta: 0.0 });
    let limits = Limits { min: Joints::repeat(-6.3), max: Joints::repeat(6.3), elbow: None };
    let robot = Robot::new("UR10", rows, false, limits);
    assert!(!robot.has_closed_form());
    let motor = joints([20.0, -70.0, 80.0, -50.0, 60.0, 15.0]);
    let at = |serial: &Joints| Links::new(rows).chain(serial, None);
    let seed = motor.map(|v| v + 0.15);
    let found = polish(&at, &robot.forward(&motor), &seed).unwrap();
    assert!((found - motor).amax() < 1e-9);
}

proptest! {
    #[test]
    fn inverse_of_forward_over_all_robots(which in 0usize..7, shares in prop::array::uniform6(0.05f64..0.95)) {
        let robot = BUILTIN[which].robot();
        let motor = Joints::from_fn(|i, _| robot.limits.min[i] + shares[i] * (robot.limits.max[i] - robot.limits.min[i]));
        prop_assume!(motor[4].abs() > 1e-3);
        let pose = robot.forward(&motor);
        for found in robot.inverse(&pose, &motor).unwrap().iter().flatten() {
            let again = robot.forward(found);
            prop_assert!((again.translation.vector - pose.translation.vector).norm() < 1e-11);
            prop_assert!((again.rotation.matrix() - pose.rotation.matrix()).amax() < 1e-10);
        }
        let near = robot.inverse_near_unlimited(&pose, &motor).unwrap();
        prop_assert!((near - motor).amax() < 1e-7, "{near} {motor}");
    }

    #[test]
    fn the_jacobian_is_the_derivative(which in 0usize..7, shares in prop::array::uniform6(0.1f64..0.9)) {
        /// Central differences of 1e-6 rad are good to 1e-9 of an arm of 3 m.
        const STEP: f64 = 1e-6;
        let robot = BUILTIN[which].robot();
        let motor = Joints::from_fn(|i, _| robot.limits.min[i] + shares[i] * (robot.limits.max[i] - robot.limits.min[i]));
        let point = robot.forward(&motor).translation.vector;
        let jacobian = robot.jacobian(&robot.frames(&motor), &point);
        for i in 0..6 {
            let at = |step: f64| {
                let mut moved = motor;
                moved[i] += step;
                robot.forward(&moved).translation.vector
            };
            let slope = (at(STEP) - at(-STEP)) / (2.0 * STEP);
            prop_assert!((slope - jacobian.fixed_view::<3, 1>(0, i)).norm() < 1e-8);
        }
    }
}
