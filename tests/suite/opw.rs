//! The built-in arms against another program's: rs-opw-kinematics, by the dimensions that its own formulas take.

use deflex::robot::{BUILTIN, Builtin, Joints, Pose, Robot};
use nalgebra::{Quaternion, Rotation3, Translation3, UnitQuaternion};
use proptest::prelude::*;
use rs_opw_kinematics::kinematic_traits::Kinematics;
use rs_opw_kinematics::kinematics_impl::OPWKinematics;
use rs_opw_kinematics::parameters::opw_kinematics::Parameters;
use std::f64::consts::{FRAC_PI_2, TAU};

/// Both programs round: m and rad over arms of three metres.
const SAME: f64 = 1e-12;
/// Their inverse and ours agree to what a wrist near its singularity lets through, rad.
const SAME_JOINTS: f64 = 1e-7;

/// Dimensions as that program's formulas name them, from the lengths of our rows (alpha °, a mm, d mm, theta °), m.
fn dimensions(builtin: &Builtin) -> [f64; 6] {
    let rows = &builtin.rows;
    [rows[1][1], -rows[3][1], rows[0][2], rows[2][1], rows[3][2], rows[5][2]].map(|mm| 1e-3 * mm)
}

fn witness(builtin: &Builtin) -> OPWKinematics {
    let [a1, a2, c1, c2, c3, c4] = dimensions(builtin);
    OPWKinematics::new(Parameters {
        a1,
        a2,
        b: 0.0,
        c1,
        c2,
        c3,
        c4,
        offsets: [0.0, 0.0, -FRAC_PI_2, 0.0, 0.0, 0.0],
        sign_corrections: [1; 6],
        dof: 6,
    })
}

fn ours(pose: &rs_opw_kinematics::pose::Pose) -> Pose {
    let (t, q) = (pose.translation, pose.rotation);
    let turn = UnitQuaternion::from_quaternion(Quaternion::new(q.w, q.x, q.y, q.z));
    Pose::from_parts(Translation3::new(t.x, t.y, t.z), Rotation3::from(turn))
}

fn motor(robot: &Robot, shares: [f64; 6]) -> Joints {
    let (min, max) = (robot.limits.min, robot.limits.max);
    Joints::from_fn(|i, _| min[i] + shares[i] * (max[i] - min[i]))
}

#[test]
fn published_dimensions_are_the_same() {
    for (model, theirs) in
        [("irb4600-60-2.05", Parameters::irb4600_60_205()), ("irb120-3-0.58", Parameters::irb120_3_58())]
    {
        let builtin = BUILTIN.iter().find(|builtin| builtin.model == model).unwrap();
        let theirs = [theirs.a1, theirs.a2, theirs.c1, theirs.c2, theirs.c3, theirs.c4];
        let same = dimensions(builtin).iter().zip(theirs).all(|(own, other)| (own - other).abs() < SAME);
        assert!(same, "{model}: {:?} {theirs:?}", dimensions(builtin));
    }
}

proptest! {
    /// Forward and inverse; a parallelogram's third motor is that program's third joint and the second together.
    #[test]
    fn poses_and_joints_agree(which in 0usize..7, shares in prop::array::uniform6(0.05f64..0.95)) {
        let robot = BUILTIN[which].robot();
        let opw = witness(&BUILTIN[which]);
        let motor = motor(&robot, shares);
        prop_assume!(motor[4].abs() > 1e-2);
        let serial = robot.serial_from_motor(&motor);
        let theirs = ours(&opw.forward(&serial.into()));
        let pose = robot.forward(&motor);
        prop_assert!((pose.translation.vector - theirs.translation.vector).norm() < SAME);
        prop_assert!((pose.rotation.matrix() - theirs.rotation.matrix()).amax() < SAME);

        let found = opw.inverse_continuing(&opw.forward(&serial.into()), &serial.into());
        let near = robot.serial_from_motor(&robot.inverse_near_unlimited(&pose, &motor).unwrap());
        let turned = |a: f64, b: f64| ((a - b + 0.5 * TAU).rem_euclid(TAU) - 0.5 * TAU).abs();
        let agrees = |joints: &[f64; 6]| (0..6).all(|i| turned(joints[i], near[i]) < SAME_JOINTS);
        prop_assert!(found.iter().any(agrees), "{near} is not among theirs: {found:?}");
    }
}
