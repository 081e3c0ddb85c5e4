//! The arm against independent numbers (`vectors.json`, made by another program) and against itself.

use deflex::robot::{Axes, BUILTIN, DhRow, Joints, Limits, Links, Pose, Robot, polish};
use nalgebra::{Matrix6, Rotation3, Translation3, Vector3, Vector6};
use proptest::prelude::*;
use serde_json::Value;

/// The vectors carry 16 digits of lengths up to 2 m, in mm.
const DIGITS_MM: f64 = 1e-9;
/// Inverse of forward, m: 1e-9 mm.
const ROUND_TRIP: f64 = 1e-12;

fn vectors() -> Value {
    serde_json::from_str(include_str!("../vectors/vectors.json")).unwrap()
}

/// The paper's arm, axis 6 as the vectors have it.
fn paper() -> Robot {
    let mut rows = *BUILTIN[0].robot().links.rows();
    rows[5].theta = 90f64.to_radians();
    Robot::new("paper", rows, Axes::PARALLELOGRAM, BUILTIN[0].robot().limits)
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
    let vectors = vectors();
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
    let robot = Robot::new("UR10", rows, Axes::SERIAL, limits);
    assert!(!robot.has_closed_form());
    let motor = joints([20.0, -70.0, 80.0, -50.0, 60.0, 15.0]);
    let seed = motor.map(|v| v + 0.15);
    let found = polish(&Links::new(rows), &robot.forward(&motor), &seed).unwrap();
    assert!((found - motor).amax() < 1e-9);
}

/// Every robot whose maker or ROS-Industrial publishes a description, at three sets of axis angles: the flange as the chain of
/// that description's joints (origins, axes) puts it, worked out by another program (`tests/fixtures/robots/README.md`).
#[test]
fn forward_kinematics_is_that_of_independent_descriptions() {
    // Lengths and angles of the descriptions are printed to a micrometre and a microradian.
    const SAME_MM: f64 = 2e-3;
    const SAME_TURN: f64 = 2e-6;
    let mut robots = std::collections::BTreeSet::new();
    for line in include_str!("../fixtures/robots/forward.csv").lines().skip(1) {
        let (model, figures) = line.split_once(',').unwrap();
        let figures: Vec<f64> = figures.split(',').map(|figure| figure.parse().unwrap()).collect();
        let builtin = BUILTIN.iter().find(|robot| robot.model == model).unwrap_or_else(|| panic!("no {model}"));
        let robot = builtin.robot();
        let motor = robot.motor_from_axes_deg(&figures[..6].try_into().unwrap());
        let pose = robot.forward(&motor);
        let off = pose.translation.vector * 1e3 - nalgebra::Vector3::from_column_slice(&figures[6..9]);
        let turned = pose.rotation.matrix() - nalgebra::Matrix3::from_row_slice(&figures[9..18]);
        assert!(off.amax() < SAME_MM && turned.amax() < SAME_TURN, "{model}: {off} {turned}");
        robots.insert(model);
    }
    assert!(robots.len() > 100, "{} robots", robots.len());
}

#[test]
fn axis_3_counted_against_the_ground_keeps_the_forearm_level() {
    let robot = BUILTIN.iter().find(|robot| robot.model == "m-20ia").unwrap().robot();
    let forearm = |axes: [f64; 6]| robot.frames(&robot.motor_from_axes_deg(&axes)).axis(3);
    assert!((forearm([0.0, 0.0, 10.0, 0.0, 0.0, 0.0]) - forearm([0.0, 35.0, 10.0, 0.0, 0.0, 0.0])).norm() < 1e-12);
    let motor = robot.motor_from_axes_deg(&[5.0, 30.0, -20.0, 4.0, 50.0, 6.0]);
    let again = robot.axes_deg_from_motor(&motor);
    assert!((again[2] + 20.0).abs() < 1e-12 && (again[1] - 30.0).abs() < 1e-12, "{again:?}");
}

/// Motor angles at these shares of the axes' ranges, rad.
fn inside(robot: &Robot, shares: [f64; 6]) -> Joints {
    let (min, max) = (robot.limits.min, robot.limits.max);
    robot.motor_from_axes_deg(&std::array::from_fn(|i| (min[i] + shares[i] * (max[i] - min[i])).to_degrees()))
}

/// A Jacobian determinant (m³) below which branches meet within what the tests ask of the joints.
const SINGULAR: f64 = 1e-4;

proptest! {
    #[test]
    fn inverse_of_forward_over_all_robots(which in 0..BUILTIN.len(), shares in prop::array::uniform6(0.05f64..0.95)) {
        let robot = BUILTIN[which].robot();
        let motor = inside(&robot, shares);
        // Axes 2 and 3, each within its range, can ask more of the elbow than it gives.
        prop_assume!(robot.limit_violation(&motor).is_none());
        let pose = robot.forward(&motor);
        // Where branches meet (stretched elbow, straight wrist, wrist over axis 1) rounding decides.
        let flat = robot.jacobian(&robot.frames(&motor), &pose.translation.vector).determinant();
        prop_assume!(flat.abs() > SINGULAR);
        for found in robot.inverse(&pose, &motor).unwrap().iter().flatten() {
            let again = robot.forward(found);
            prop_assert!((again.translation.vector - pose.translation.vector).norm() < 1e-11);
            prop_assert!((again.rotation.matrix() - pose.rotation.matrix()).amax() < 1e-10);
        }
        let near = robot.inverse_near_unlimited(&pose, &motor).unwrap();
        prop_assert!((near - motor).amax() < 1e-7, "{near} {motor}");
    }

    #[test]
    fn the_jacobian_is_the_derivative(which in 0..BUILTIN.len(), shares in prop::array::uniform6(0.1f64..0.9)) {
        /// Central differences of 1e-6 rad are good to 1e-9 of an arm of 3 m.
        const STEP: f64 = 1e-6;
        let robot = BUILTIN[which].robot();
        let motor = inside(&robot, shares);
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
