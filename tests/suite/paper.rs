//! Tang et al., "Deformation Error Prediction and Compensation for Robot Multi-axis Milling": the slot of its Section 3.
//!
//! The paper does not print the pose, the tool, the number of teeth or the force coefficients. These are one set that
//! reproduces its Tables 3 and 5 (canonical case CASE-R), found by an independent program.

use approx::assert_abs_diff_eq;
use deflex::cutting::{Coefficients, Cutter, Engagement, Milling, Mode};
use deflex::effects::{Cutting, ForceLaw, Situation, ToolFrame, declared_springs};
use deflex::equilibrium::Arm;
use deflex::robot::{Axes, DhRow, Joints, Limits, Pose, Robot};
use nalgebra::{Rotation3, Translation3, Unit, Vector3};

/// The paper prints three decimals of a millimetre.
const PRINTED_MM: f64 = 0.0005;
/// The independent program is linear in the deflection; finite deflections differ in the fourth decimal.
const LINEAR_MM: f64 = 2e-4;

struct Slot(Milling);

impl ForceLaw for Slot {
    fn force(&self, shift: &Vector3<f64>, axis: &Vector3<f64>) -> Vector3<f64> {
        self.0.mean_force(shift, &Unit::new_normalize(*axis))
    }
}

fn robot() -> Robot {
    let rows = [
        [0.0, 0.0, 814.5, 0.0],
        [-90.0, 300.0, 0.0, -90.0],
        [0.0, 700.0, 0.0, 0.0],
        [-90.0, 280.0, 893.0, 0.0],
        [90.0, 0.0, 0.0, 0.0],
        // As in the paper's Table 1; ABB's own tool0 is turned by another 90°.
        [-90.0, 0.0, 200.0, 90.0],
    ];
    let rows = rows.map(|[alpha, a, d, theta]: [f64; 4]| DhRow {
        alpha: alpha.to_radians(),
        a: 1e-3 * a,
        d: 1e-3 * d,
        theta: theta.to_radians(),
    });
    let limits = Limits { min: Joints::repeat(-6.3), max: Joints::repeat(6.3), elbow: None };
    Robot::new("IRB 6660-205/1.9", rows, Axes::PARALLELOGRAM, limits)
}

fn slot() -> Slot {
    let cutter = Cutter { diameter: 0.025, corner_radius: 0.005, teeth: 3, helix: 0.0 };
    let engagement = Engagement {
        mode: Mode::Slot,
        depth: 0.0015,
        width: 0.025,
        feed_per_tooth: 7e-5,
        lead: 5f64.to_radians(),
        tilt: 10f64.to_radians(),
    };
    let (kt, edge) = (2250e6, 1e3);
    let coefficients = Coefficients {
        ktc: kt,
        krc: 0.3992 * kt,
        kac: 0.35 * kt,
        kte: 4.634 * edge,
        kre: 64.235 * edge,
        kae: 6.031 * edge,
    };
    Slot(Milling::new(cutter, engagement, coefficients).unwrap())
}

/// Turn of the paper's workpiece frame from the feed frame, rad.
const CHI: f64 = 0.914;

struct Case {
    arm: Arm,
    motor: Joints,
    base_from_feed: Pose,
    tool: ToolFrame,
    feed_from_tcp: Pose,
}

fn case() -> Case {
    let robot = robot();
    let base_from_feed = Pose::from_parts(
        Translation3::new(1.203, -0.0066, 1.0793),
        Rotation3::from_axis_angle(&Vector3::z_axis(), 1.6898),
    );
    let lean = Rotation3::from_axis_angle(&Vector3::x_axis(), 10f64.to_radians())
        * Rotation3::from_axis_angle(&Vector3::y_axis(), 5f64.to_radians());
    let spun = lean * Rotation3::from_axis_angle(&Vector3::z_axis(), 1.6941);
    // The cutter frame's z is the tool axis, tip to spindle; the TCP's z points the other way.
    let tcp_from_ccs = Rotation3::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    let feed_from_tcp =
        Pose::from_parts(Translation3::new(0.0, 0.0, 0.047_469_441_691_881e-3), spun * tcp_from_ccs.inverse());
    let motor = Joints::from(
        [
            -4.865_041_939_722, -28.968_433_398_828, 25.272_419_853_519, 126.136_057_269_071, 23.151_140_052_459,
            134.252_558_097_527,
        ]
        .map(f64::to_radians),
    );
    // The tool is what lies between the flange at the printed joints and the wanted cutter pose.
    let flange_from_tcp = robot.forward(&motor).inv_mul(&(base_from_feed * feed_from_tcp));
    let stiffness = Joints::from([8.86e5, 5.5e5, 1.85e6, 3.3e5, 2.1e5, 8.81e4]);
    let effects = vec![declared_springs(&robot.axes)];
    Case {
        arm: Arm { robot, stiffness: Some(stiffness), effects },
        motor,
        base_from_feed,
        tool: ToolFrame { flange_from_tcp, mass: 0.0, cog: Vector3::zeros() },
        feed_from_tcp,
    }
}

fn situation<'a>(case: &Case, law: &'a Slot) -> Situation<'a> {
    Situation {
        base_from_wobj: case.base_from_feed,
        cutting: Cutting::Law { law, wobj_from_feed: Rotation3::identity() },
        ..Situation::in_air(case.tool, case.feed_from_tcp)
    }
}

fn in_workpiece(v: Vector3<f64>) -> Vector3<f64> {
    Rotation3::from_axis_angle(&Vector3::z_axis(), CHI) * v * 1e3
}

#[test]
fn table_3_deflection_of_the_tool_point() {
    let (case, law) = (case(), slot());
    let there = case.arm.predict(&situation(&case, &law), &case.motor, &Joints::zeros()).unwrap();
    let shift = there.wobj_from_tcp.translation.vector - case.feed_from_tcp.translation.vector;
    let independent = Vector3::new(-5.936_593_625_546e-2, -1.802_129_229_238e-2, 1.269_921_085_104e-1);
    assert_abs_diff_eq!(shift * 1e3, independent, epsilon = LINEAR_MM);
    let paper = Vector3::new(-0.022, -0.058, 0.127);
    assert_abs_diff_eq!(in_workpiece(shift), paper, epsilon = PRINTED_MM + LINEAR_MM);
    // Table 4: the depth that this predicts, 1.5 mm less the lift.
    assert_abs_diff_eq!(1.5 - 1e3 * shift.z, 1.373, epsilon = PRINTED_MM + LINEAR_MM);
}

#[test]
fn table_5_shift_of_the_cutter_location() {
    let (case, law) = (case(), slot());
    let none = Joints::zeros();
    let command = case.arm.command(&situation(&case, &law), &case.feed_from_tcp, &case.motor, &none).unwrap();
    let commanded = case.arm.robot.forward(&command.commanded(&none)) * case.tool.flange_from_tcp;
    let commanded = case.base_from_feed.inv_mul(&commanded);
    let shift = commanded.translation.vector - case.feed_from_tcp.translation.vector;
    let paper = Vector3::new(0.035, 0.069, -0.133);
    assert_abs_diff_eq!(in_workpiece(shift), paper, epsilon = PRINTED_MM + LINEAR_MM);
}
