//! `init --urdf`: a cell from a robot description, held against the description's own chain of joints.

use super::bench::Bench;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use proptest::prelude::*;
use serde_json::Value;
use std::fmt::Write;

/// A joint: origin (m), roll-pitch-yaw (rad), axis.
type Joint = ([f64; 3], [f64; 3], [f64; 3]);

/// A KUKA-like arm: signs of its own, zero pose stretched forward.
const ARM: [Joint; 6] = [
    ([0.0, 0.0, 0.645], [0.0; 3], [0.0, 0.0, -1.0]),
    ([0.33, 0.0, 0.0], [0.0; 3], [0.0, 1.0, 0.0]),
    ([1.15, 0.0, 0.0], [0.0; 3], [0.0, 1.0, 0.0]),
    ([1.22, 0.0, -0.115], [0.0; 3], [-1.0, 0.0, 0.0]),
    ([0.0; 3], [0.0; 3], [0.0, 1.0, 0.0]),
    ([0.24, 0.0, 0.0], [0.0; 3], [-1.0, 0.0, 0.0]),
];
const TOOL0: Joint = ([0.0; 3], [0.0, std::f64::consts::FRAC_PI_2, 0.0], [1.0, 0.0, 0.0]);

fn urdf(joints: &[Joint], tool0: Joint) -> String {
    let mut text = "<?xml version=\"1.0\"?>\n<robot name=\"made up\">\n<link name=\"base_link\"/>\n".to_owned();
    let three = |v: [f64; 3]| format!("{:?} {:?} {:?}", v[0], v[1], v[2]);
    for (i, (xyz, rpy, axis)) in joints.iter().chain([&tool0]).enumerate() {
        let parent = if i == 0 { "base_link".to_owned() } else { format!("link_{i}") };
        let (child, kind) =
            if i == 6 { ("tool0".to_owned(), "fixed") } else { (format!("link_{}", i + 1), "revolute") };
        let _ = write!(
            text,
            "<link name=\"{child}\"/>\n<joint name=\"joint_{}\" type=\"{kind}\"><origin xyz=\"{}\" rpy=\"{}\"/><parent link=\"{parent}\"/>\
             <child link=\"{child}\"/><axis xyz=\"{}\"/><limit lower=\"-6.2\" upper=\"6.2\" effort=\"0\" velocity=\"1\"/></joint>\n",
            i + 1,
            three(*xyz),
            three(*rpy),
            three(*axis),
        );
    }
    text + "</robot>\n"
}

/// The chain multiplied out, joint by joint.
fn forward(joints: &[Joint], tool0: Joint, deg: &[f64; 6]) -> Isometry3<f64> {
    let mut at = Isometry3::identity();
    for (i, (xyz, rpy, axis)) in joints.iter().chain([&tool0]).enumerate() {
        let origin = UnitQuaternion::from_euler_angles(rpy[0], rpy[1], rpy[2]);
        at *= Isometry3::from_parts(Translation3::from(Vector3::from(*xyz)), origin);
        if let Some(deg) = deg.get(i) {
            at *= UnitQuaternion::new(Vector3::from(*axis).normalize() * deg.to_radians());
        }
    }
    at
}

#[track_caller]
fn agrees(bench: &Bench, joints: &[Joint], tool0: Joint, tool: &str) {
    for deg in [[0.0; 6], [10.0, -20.0, 30.0, 40.0, -50.0, 60.0], [-100.0, 70.0, -15.0, 5.0, 90.0, -170.0]] {
        let typed: Vec<String> = deg.iter().map(f64::to_string).collect();
        let ran = bench.run(&format!("pose --cell arm.toml {tool} --joints {} --json", typed.join(","))).exits(0);
        let found: Value = serde_json::from_str(&ran.stdout).unwrap();
        let there = forward(joints, tool0, &deg);
        let number = |key: &str, i: usize| found[key][i].as_f64().unwrap();
        for i in 0..3 {
            let off = number("position_mm", i) - 1e3 * there.translation.vector[i];
            assert!(off.abs() < 1e-9, "{deg:?}: {off} mm\n{found:#}");
        }
        let quat = there.rotation.quaternion();
        let dot = [quat.w, quat.i, quat.j, quat.k].iter().enumerate().map(|(i, q)| q * number("quat", i)).sum::<f64>();
        assert!(dot.abs() > 1.0 - 1e-12, "{deg:?}\n{found:#}");
    }
}

#[test]
fn a_described_arm_becomes_a_cell_with_an_explicit_inverse() {
    let bench = Bench::new();
    bench.write("arm.urdf", urdf(&ARM, TOOL0));
    bench.run("init --urdf arm.urdf -o arm.toml").exits(0);
    agrees(&bench, &ARM, TOOL0, "");
    let cell = deflex::cell::Cell::read(&deflex::text::Source::new("arm.toml", bench.read("arm.toml"))).unwrap();
    assert!(cell.arm.robot.has_closed_form(), "{}", bench.read("arm.toml"));
    assert_eq!(cell.arm.robot.axes.sign.map(|sign| sign as i32), [-1, 1, 1, -1, 1, -1]);
}

#[test]
fn a_tip_aside_of_axis_6_becomes_a_tool_and_a_base_aside_stands_in_the_world() {
    let bench = Bench::new();
    let mut arm = ARM;
    arm[0].0 = [0.4, -0.3, 0.9];
    arm[0].1 = [0.3, 0.2, -0.4];
    let aside = ([0.1, 0.02, -0.03], [0.2, 0.3, 0.4], [1.0, 0.0, 0.0]);
    bench.write("arm.urdf", urdf(&arm, aside));
    bench.run("init --urdf arm.urdf --tip tool0 -o arm.toml").exits(0);
    agrees(&bench, &arm, aside, "--tool tip");
}

#[test]
fn what_is_no_chain_of_six_is_refused() {
    let bench = Bench::new();
    bench.write("five.urdf", urdf(&ARM, TOOL0).replacen("revolute", "fixed", 1));
    let ran = bench.run("init --urdf five.urdf --tip tool0").exits(2);
    assert!(ran.stderr.contains("5 joints that move, expected six"), "{}", ran.stderr);
    bench.write("arm.urdf", urdf(&ARM, TOOL0));
    let ran = bench.run("init --urdf arm.urdf --tip tool").exits(2);
    assert!(ran.stderr.contains("did you mean `tool0`"), "{}", ran.stderr);
    bench.write("xacro.urdf", "<robot xmlns:xacro=\"http://ros.org/wiki/xacro\"><xacro:macro/></robot>");
    assert!(bench.run("init --urdf xacro.urdf").exits(2).stderr.contains("expand it first"));
    bench.write("no.urdf", "MODULE a\nENDMODULE");
    bench.run("init --urdf no.urdf").exits(2);
    bench.write(
        "same.urdf",
        urdf(&[ARM[0], ARM[1], ARM[2], ARM[3], ([0.1, 0.0, 0.0], [0.0; 3], [1.0, 0.0, 0.0]), ARM[5]], TOOL0),
    );
    let ran = bench.run("init --urdf same.urdf").exits(2);
    assert!(ran.stderr.contains("turns about the same axis"), "{}", ran.stderr);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    /// Any six axes: the conversion holds its rows against the description itself and would refuse.
    #[test]
    fn any_chain_is_described(numbers in prop::collection::vec(-1.0f64..1.0, 54)) {
        let joints: Vec<Joint> = numbers.chunks(9).map(|n| ([n[0], n[1], n[2]], [n[3], n[4], n[5]], [n[6], n[7], n[8] + 1.5])).collect();
        let text = urdf(&joints, TOOL0);
        let source = deflex::text::Source::new("any.urdf", text.into_bytes());
        let found = deflex::cell::described(&source, Some("tool0"));
        prop_assert!(found.is_ok(), "{found:?}");
    }
}
