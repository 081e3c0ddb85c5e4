//! The two questions put to a cell, against each other and against hand-made figures.

use approx::assert_abs_diff_eq;
use deflex::effects::{Cutting, Situation, ToolFrame, declared_springs, kind};
use deflex::equilibrium::Arm;
use deflex::robot::{BUILTIN, Joints, Pose, Robot};
use nalgebra::{Rotation3, Translation3, Vector3};
use proptest::prelude::*;

/// Independent forward and inverse meet to the rounding of f64 over an arm of 2 m.
const SAME_POSE: f64 = 1e-11;

/// The same where the inverse is a search: what it takes for found where rounding keeps it from more, 1e-7 mm.
const FOUND_POSE: f64 = 1e-10;

fn deg(values: [f64; 6]) -> Joints {
    Joints::from(values.map(f64::to_radians))
}

fn tool() -> ToolFrame {
    ToolFrame {
        flange_from_tcp: Pose::from_parts(
            Translation3::new(0.06, -0.02, 0.31),
            Rotation3::from_euler_angles(0.1, 0.4, -0.2),
        ),
        mass: 18.0,
        cog: Vector3::new(0.0, 0.0, 0.12),
    }
}

fn arm(effects: &[&str]) -> Arm {
    arm_of(BUILTIN[0].robot(), effects)
}

fn arm_of(robot: Robot, effects: &[&str]) -> Arm {
    let mut all = vec![declared_springs(&robot.axes)];
    for text in effects {
        let mut table: toml::Table = text.parse().unwrap();
        let name = table.remove("kind").unwrap();
        all.push((kind(name.as_str().unwrap()).unwrap().read)(table).unwrap());
    }
    Arm { robot, stiffness: Some(Joints::from([8.86e5, 5.5e5, 1.85e6, 3.3e5, 2.1e5, 8.81e4])), effects: all }
}

fn situation(arm: &Arm, motor: &Joints, force: Vector3<f64>) -> Situation<'static> {
    let base_from_wobj =
        Pose::from_parts(Translation3::new(1.0, -0.4, 0.7), Rotation3::from_euler_angles(0.0, 0.02, 0.3));
    let wobj_from_tcp = base_from_wobj.inv_mul(&(arm.robot.forward(motor) * tool().flange_from_tcp));
    Situation {
        base_from_wobj,
        gravity: arm.robot.gravity(),
        cutting: Cutting::Constant(force),
        ..Situation::in_air(tool(), wobj_from_tcp)
    }
}

const GRAVITY: &str = r#"
kind = "gravity"
mass_kg = [120, 60, 70, 15, 8, 12]
first_moment_kg_m = [[6, 0, -24], [20, 0, 1.2], [3.5, 2.1, 0], [0.1, 0, -5.9], [0, 0.16, 0], [0, 0, 0.42]]
tool = true
"#;

fn round_trip(arm: &Arm, motor: &Joints, force: Vector3<f64>) {
    let situation = situation(arm, motor, force);
    let none = Joints::zeros();
    let command = arm.command(&situation, &situation.wobj_from_tcp, motor, &none).unwrap();
    let there = arm.predict(&situation, &command.commanded(&none), &none).unwrap();
    let gap = there.wobj_from_tcp.inv_mul(&situation.wobj_from_tcp);
    let searched =
        !arm.robot.has_closed_form() || arm.effects.iter().any(|effect| effect.kind() == "bearing_compliance");
    let same = if searched { FOUND_POSE } else { SAME_POSE };
    assert!(gap.translation.vector.norm() < same, "{gap:?}");
    assert!((gap.rotation.matrix() - nalgebra::Matrix3::identity()).amax() < same);
    // The energy check: K (q_actual − q_commanded) = Jᵀ F + weights.
    let stiffness = arm.stiffness.unwrap();
    let spring = stiffness.component_mul(&(there.motor - command.commanded(&none)));
    assert_abs_diff_eq!(spring, there.load.torque, epsilon = 1e-6 * there.load.torque.norm().max(1.0));
}

#[test]
fn the_linear_form_of_the_paper_is_the_small_force_limit() {
    // Tang et al., Eq. 5: D = J K⁻¹ Jᵀ F.
    let arm = arm(&[]);
    let motor = deg([10.0, 20.0, 15.0, 30.0, 40.0, -60.0]);
    let force = Vector3::new(-0.3, 1.3, 1.8);
    let situation = situation(&arm, &motor, force);
    let none = Joints::zeros();
    let there = arm.predict(&situation, &motor, &none).unwrap();
    let shift = situation.base_from_wobj.rotation
        * (there.wobj_from_tcp.translation.vector - situation.wobj_from_tcp.translation.vector);
    let frames = arm.robot.frames(&motor);
    let tcp = (arm.robot.forward(&motor) * situation.tool.flange_from_tcp).translation.vector;
    let jacobian = arm.robot.jacobian(&frames, &tcp);
    let load = situation.base_from_wobj.rotation * force;
    let wrench = nalgebra::Vector6::new(load.x, load.y, load.z, 0.0, 0.0, 0.0);
    let linear = jacobian * (jacobian.transpose() * wrench).component_div(&arm.stiffness.unwrap());
    // Second order: the deflection squared over a lever of a metre.
    assert_abs_diff_eq!(shift, linear.fixed_rows::<3>(0).into_owned(), epsilon = 2.0 * shift.norm_squared());
    assert!(shift.norm() > 1e-6);
}

#[test]
fn a_runaway_load_is_refused() {
    struct Pull;
    impl deflex::effects::ForceLaw for Pull {
        fn force(&self, shift: &Vector3<f64>, _: &Vector3<f64>) -> Vector3<f64> {
            // Stiffer than the arm, and it pulls the tool in.
            Vector3::new(0.0, 0.0, -100.0 + 5e6 * shift.z)
        }
    }
    let arm = arm(&[]);
    let motor = deg([0.0, 20.0, 15.0, 10.0, 40.0, 0.0]);
    let mut situation = situation(&arm, &motor, Vector3::zeros());
    situation.cutting = Cutting::Law { law: &Pull, wobj_from_feed: Rotation3::identity() };
    let error = arm.predict(&situation, &motor, &Joints::zeros()).unwrap_err().to_string();
    assert!(error.contains("no equilibrium"), "{error}");
}

#[test]
fn strong_negative_feedback_settles() {
    struct Wall;
    impl deflex::effects::ForceLaw for Wall {
        fn force(&self, shift: &Vector3<f64>, _: &Vector3<f64>) -> Vector3<f64> {
            Vector3::new(0.0, 0.0, 100.0 - 5e6 * shift.z)
        }
    }
    let arm = arm(&[]);
    let motor = deg([0.0, 20.0, 15.0, 10.0, 40.0, 0.0]);
    let mut situation = situation(&arm, &motor, Vector3::zeros());
    situation.cutting = Cutting::Law { law: &Wall, wobj_from_feed: Rotation3::identity() };
    let there = arm.predict(&situation, &motor, &Joints::zeros()).unwrap();
    // It rests where the wall's force is small: within 100 N / 5e6 N/m of the surface.
    let lift = there.wobj_from_tcp.translation.z - situation.wobj_from_tcp.translation.z;
    assert!((0.0..2e-5).contains(&lift), "{lift}");
}

const BEARINGS: &str = r#"
kind = "bearing_compliance"
rad_per_nm = [[2e-8, 3e-8], [3e-8, 2e-8], [3e-8, 5e-8], [6e-8, 6e-8], [8e-8, 4e-8], [1e-7, 1e-7]]
"#;

const BACKLASH: &str = r#"
kind = "backlash"
half_gap_rad = [2e-5, 3e-5, 2e-5, 5e-5, 4e-5, 6e-5]
"#;

#[test]
fn a_step_of_the_force_is_no_running_away() {
    /// A millionth less below where the tip would come to rest.
    struct Stepped {
        at: f64,
    }
    impl deflex::effects::ForceLaw for Stepped {
        fn force(&self, shift: &Vector3<f64>, _: &Vector3<f64>) -> Vector3<f64> {
            Vector3::new(0.0, 0.0, if shift.z < self.at { -300.0 * 0.999_999 } else { -300.0 })
        }
    }
    let arm = arm(&[]);
    let motor = deg([0.0, 20.0, 15.0, 10.0, 40.0, 0.0]);
    let sag = |cutting: Cutting<'_>| {
        let situation = Situation { cutting, ..situation(&arm, &motor, Vector3::zeros()) };
        let there = arm.predict(&situation, &motor, &Joints::zeros()).unwrap();
        there.wobj_from_tcp.translation.z - situation.wobj_from_tcp.translation.z
    };
    let [deeper, less] = [1.0, 0.999_999].map(|share| sag(Cutting::Constant(Vector3::new(0.0, 0.0, -300.0 * share))));
    assert!(deeper < less);
    let law = Stepped { at: 0.5 * (deeper + less) };
    let shift = sag(Cutting::Law { law: &law, wobj_from_feed: Rotation3::identity() });
    assert!((deeper - SAME_POSE..=less + SAME_POSE).contains(&shift), "{deeper} {shift} {less}");
}

/// Any built-in robot; at times with a wrist that is off, so that its inverse is a search.
fn any_robot() -> impl Strategy<Value = Robot> {
    (0..BUILTIN.len(), prop::bool::weighted(0.3)).prop_map(|(which, off)| {
        let robot = BUILTIN[which].robot();
        let mut rows = *robot.links.rows();
        if off {
            rows[4].a += 0.012;
        }
        Robot::new("any", rows, robot.axes, robot.limits)
    })
}

proptest! {
    #[test]
    fn forward_of_inverse_is_identity(
        robot in any_robot(),
        share in prop::array::uniform6(0.05f64..0.95),
        f in prop::array::uniform3(-2000.0f64..2000.0),
        effects in prop::sample::subsequence(vec![GRAVITY, BEARINGS, BACKLASH], 0..=3),
    ) {
        // Anywhere between the limits, but where the wrist or the elbow is stretched and a pose has no one answer.
        let limits = &robot.limits;
        let motor = Joints::from_fn(|i, _| (limits.min[i] + share[i] * (limits.max[i] - limits.min[i])).clamp(-3.1, 3.1));
        let jacobian = robot.jacobian(&robot.frames(&motor), &robot.forward(&motor).translation.vector);
        let reach: f64 = robot.links.rows().iter().map(|row| row.a.abs() + row.d.abs()).sum();
        prop_assume!(jacobian.determinant().abs() > 1e-3 * reach.powi(3) && robot.limit_violation(&motor).is_none());
        round_trip(&arm_of(robot, &effects), &motor, Vector3::from(f));
    }
}
