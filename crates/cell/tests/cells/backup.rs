//! Cells made from the backup of an ABB controller, and read.

use approx::assert_abs_diff_eq;
use deflex_cell::{Cell, backup_template, examples_left};
use deflex_text::Source;
use nalgebra::Vector3;

const MOC: &str = "MOC:CFG_1.0:6:0::\n#\nMECHANICAL_UNIT:\n\n      -name \"TRACK1\" -use_activation_relay \"\"\\\n      -use_single_0 \"TRACK1\" -activate_at_start_up \n\n      -name \"STN1\" -use_single_0 \"TILT\" -use_single_1 \"TURN\"\n\n      -name \"IRBP\" -use_robot \"IRBP\"\n#\nROBOT:\n\n      -name \"ROB_1\" -use_robot_type \"ROB1_6700_200_2.60\"\\\n      -use_joint_0 \"rob1_1\" -use_joint_1 \"rob1_2\" -use_joint_2 \"rob1_3\"\\\n      -use_joint_3 \"rob1_4\" -use_joint_4 \"rob1_5\" -use_joint_5 \"rob1_6\"\\\n      -base_frame_pos_z 0.5 -base_frame_coordinated \"TRACK1\" -gravity_beta -0.1\n#\nSINGLE:\n\n      -name \"TRACK1\" -use_single_type \"T\" -use_joint \"M7\" -base_frame_pos_x 0.1\\\n      -base_frame_orient_u0 0.707107 -base_frame_orient_u3 0.707107\n\n      -name \"TILT\" -use_single_type \"R\" -use_joint \"M8\" -base_frame_pos_x 2\n\n      -name \"TURN\" -use_single_type \"R\" -use_joint \"M9\" -base_frame_coordinated \"TILT\"\n#\nSINGLE_TYPE:\n\n      -name \"T\" -mechanics \"TRACK\"\n\n      -name \"R\" -mechanics \"FREE_ROT\"\n#\nJOINT:\n\n      -name \"M7\" -logical_axis 7 -use_arm \"A7\"\n\n      -name \"M8\" -logical_axis 8 -use_arm \"A8\"\n\n      -name \"M9\" -logical_axis 9 -use_arm \"A9\"\n#\nARM:\n\n      -name \"rob1_1\" -upper_joint_bound 2.96706 -lower_joint_bound -2.96706\n\n      -name \"rob1_2\" -upper_joint_bound 1.48353 -lower_joint_bound -1.13446\n\n      -name \"rob1_3\" -upper_joint_bound 1.0472 -lower_joint_bound -3.14159\n\n      -name \"rob1_4\" -upper_joint_bound 5.23599 -lower_joint_bound -5.23599\n\n      -name \"rob1_5\" -upper_joint_bound 2.26893 -lower_joint_bound -2.26893\n\n      -name \"rob1_6\" -upper_joint_bound 6.28319 -lower_joint_bound -6.28319\n\n      -name \"A7\" -upper_joint_bound 3.5 -lower_joint_bound -0.05\n\n      -name \"A8\" -upper_joint_bound 1.5708 -lower_joint_bound -1.5708\n";

const TOOLS: &str = "MODULE M(SYSMODULE)\n  PERS tooldata tMill:=[TRUE,[[1,2,310],[1,0,0,0]],[18,[0,0,120],[1,0,0,0],0,0,0]];\n  PERS tooldata tSpindle:=[FALSE,[[1,2,310],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\n  TASK PERS wobjdata wPart:=[FALSE,TRUE,\"\",[[1000,0,700],[1,0,0,0]],[[0,0,5],[1,0,0,0]]];\n  TASK PERS wobjdata wTurn:=[FALSE,FALSE,\"STN1\",[[0,0,0],[1,0,0,0]],[[0,0,5],[1,0,0,0]]];\nENDMODULE\n";

fn source(name: &str, text: &str) -> Source {
    Source::new(name, text.as_bytes().to_vec())
}

#[test]
fn a_backup_becomes_a_cell() {
    let text = backup_template(&source("MOC.cfg", MOC), &[source("user.sys", TOOLS)], None).unwrap();
    let file = source("cell.toml", &text);
    let cell = Cell::read(&file).unwrap_or_else(|errors| panic!("{errors:?}\n{text}"));
    assert!(text.contains("model = \"irb6700-200-2.60\"     # the backup says"), "{text}");
    let base = cell.arm.robot.world_from_base;
    assert_abs_diff_eq!(base.translation.vector, Vector3::new(0.1, 0.0, 0.5), epsilon = 1e-9);
    assert_abs_diff_eq!(cell.arm.robot.limits.max[1].to_degrees(), 85.0, epsilon = 1e-3);
    let seen: Vec<_> = cell.units.all().iter().map(|u| (u.name.as_str(), u.axis, u.min, u.max, u.on)).collect();
    assert_eq!(seen[0], ("TRACK1", 0, -50.0, 3500.0, None));
    assert_eq!((seen[1].0, seen[1].1, seen[1].4), ("STN1_1", 1, None));
    assert_eq!((seen[2].0, seen[2].1, seen[2].4), ("STN1", 2, Some(1)));
    assert_eq!(cell.units.under_robot(), Some(0));
    let along = cell.units.world_from_base(&base, &[100.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    assert_abs_diff_eq!(along.translation.vector, Vector3::new(0.1, 0.1, 0.5), epsilon = 1e-6);
    assert!(cell.tools.contains_key("TMILL") && cell.tools.len() == 1);
    assert!(cell.wobjs.contains_key("WPART") && cell.wobjs.len() == 1);
    assert!(text.contains("not taken: IRBP"), "{text}");
    // The user has to check the direction of the track.
    assert!(examples_left(&file).is_some());
}

/// The robot stands on a gantry that is modelled as a robot; the file also has an endless conveyor.
#[test]
fn what_is_not_taken_is_marked() {
    let moc = MOC
        .replace("-base_frame_coordinated \"TRACK1\" -gravity", "-base_frame_coordinated \"IRBP\" -gravity")
        .replace("-name \"A7\" -upper_joint_bound 3.5", "-name \"A7\" -upper_joint_bound 1256640");
    let text = backup_template(&source("MOC.cfg", &moc), &[], None).unwrap();
    let cell = Cell::read(&source("cell.toml", &text)).unwrap_or_else(|errors| panic!("{errors:?}\n{text}"));
    assert_eq!((cell.units.under_robot(), cell.units.all()[0].max), (None, f64::INFINITY));
    assert!(
        text.contains("# << the robot stands on IRBP") && text.contains("base_mm = [0.0, 0.0, 500.0]   # <<"),
        "{text}"
    );
}

/// Gravity pulls a hanging robot towards its flange, even if its base frame was left equal to the world frame.
#[test]
fn a_hanging_robot_with_an_upright_base_frame_is_marked() {
    let of = |robot: &str| {
        let moc = MOC.replace("-base_frame_pos_z 0.5 -base_frame_coordinated \"TRACK1\" -gravity_beta -0.1", robot);
        let text = backup_template(&source("MOC.cfg", &moc), &[], None).unwrap();
        (text.contains("from upright"), text.contains("base_quat = [1.0, 0.0, 0.0, 0.0]   # <<"), text)
    };
    let hung = of("-gravity_beta 3.14159");
    assert!(hung.0 && hung.1 && hung.2.contains("z axis is 180.0\u{b0} from upright"), "{}", hung.2);
    // Three robots without a difference: hanging with the right base frame, on the floor, and on the wall in both.
    for robot in [
        "-base_frame_orient_u0 0 -base_frame_orient_u2 1 -gravity_beta 3.14159",
        "-base_frame_pos_z 0.5",
        "-base_frame_orient_u0 0.707107 -base_frame_orient_u1 0.707107 -gravity_alpha 1.5708",
    ] {
        assert!(!of(robot).0, "{robot}");
    }
}

#[test]
fn a_file_without_a_robot_is_refused() {
    assert!(backup_template(&source("MOC.cfg", "SINGLE:\n -name \"A\"\n"), &[], None).is_err());
}
