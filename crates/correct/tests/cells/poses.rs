//! Poses under forces, in a cell of the samples.

use deflex_cell::Cell;
use deflex_correct::{ArmState, Standing, external_of, predict_poses, tool_of};
use deflex_effects::{Cutting, Situation};
use deflex_robot::Joints;
use deflex_text::{Diagnostic, Source};
use nalgebra::Vector3;

#[test]
fn poses_are_those_of_the_equilibrium_one_by_one() {
    let text = std::fs::read("../../samples/slot/cell.toml").unwrap();
    let cell = Cell::read(&Source::new("cell.toml", text)).unwrap();
    let tool = tool_of(&cell, None).unwrap();
    let axes_deg: Vec<[f64; 6]> = (0..20).map(|i| [f64::from(i), 20.0, 10.0, 15.0, 40.0, -30.0]).collect();
    let forces: Vec<[f64; 3]> = (0..20).map(|i| [100.0, -50.0 * f64::from(i), 300.0]).collect();
    let found = predict_poses(&cell, &tool, &axes_deg, &forces, Standing::default()).unwrap();
    for ((found, deg), force) in found.iter().zip(&axes_deg).zip(&forces) {
        let motor = cell.arm.robot.motor_from_axes_deg(deg);
        let nominal = cell.arm.robot.forward(&motor) * tool.flange_from_tcp;
        let situation = Situation {
            gravity: cell.arm.robot.gravity(),
            cutting: Cutting::Constant(Vector3::from(*force)),
            ..Situation::in_air(tool, nominal)
        };
        let one = cell.arm.predict(&situation, &motor, &Joints::zeros()).unwrap().wobj_from_tcp;
        let off = found.as_ref().unwrap().translation.vector - one.translation.vector;
        assert!(off.norm() < 1e-11, "{off}");
        assert!((one.translation.vector - nominal.translation.vector).norm() > 1e-5);
        assert!((found.as_ref().unwrap().rotation.matrix() - one.rotation.matrix()).amax() < 1e-9);
    }
}

#[test]
fn effects_get_what_they_ask_for_or_are_refused() {
    let text = std::fs::read_to_string("../../samples/slot/cell.toml").unwrap();
    let tool_of = |cell: &Cell| tool_of(cell, None).unwrap();
    let axes = [[0.0, 20.0, 10.0, 15.0, 40.0, -30.0]; 2];
    let forces = [[0.0, 0.0, 400.0]; 2];
    let at = |effect: &str, state: ArmState| {
        let cell = format!("{text}\n[[effect]]\n{effect}\n");
        let cell = Cell::read(&Source::new("cell.toml", cell.into_bytes())).unwrap();
        let standing = Standing { state, ..Standing::default() };
        let found = predict_poses(&cell, &tool_of(&cell), &axes, &forces, standing)?;
        let [a, b] = [0, 1].map(|i: usize| found[i].as_ref().unwrap().translation.vector);
        Ok::<f64, Vec<Diagnostic>>((a - b).norm())
    };
    let none = ArmState::default();
    let both = [[0.0, 1.0, 0.0, 0.0, 0.0, 0.0], [0.0, -0.5, 0.0, 0.0, 0.0, 0.0]];
    let (speeds, values) = ([[0.0; 3], [50.0, 0.0, 0.0]], [0.0, 30.0]);
    for (effect, state, what) in [
        (
            "kind = \"backlash\"\nhalf_gap_rad = [0, 1e-4, 0, 0, 0, 0]",
            ArmState { travel: Some(&both), ..none },
            "travel",
        ),
        (
            "kind = \"hysteresis\"\nfraction = [0.0, 0.1, 0, 0, 0, 0]",
            ArmState { travel: Some(&both), ..none },
            "travel",
        ),
        ("kind = \"tracking_lag\"\ntime_s = 0.004", ArmState { velocity_mm_s: Some(&speeds), ..none }, "velocity_mm_s"),
        ("kind = \"tool_wear\"\nper_m = 0.1", ArmState { cut_m: Some(&values), ..none }, "cut_m"),
        (
            "kind = \"stiffness_temperature\"\nper_k = [0.002, 0.002, 0.002, 0.002, 0.002, 0.002]\nreference_c = 20.0",
            ArmState { temperature_c: Some(&values), ..none },
            "temperature_c",
        ),
    ] {
        let refused = at(effect, none).unwrap_err();
        assert!(refused[0].message.contains(&format!("needs `{what}`")), "{refused:?}");
        assert!(at(effect, state).unwrap() > 1e-6, "{effect}");
    }
    let short = ArmState { travel: Some(&both[..1]), ..none };
    assert!(at("kind = \"backlash\"\nhalf_gap_rad = [0, 1e-4, 0, 0, 0, 0]", short).is_err());
}

#[test]
fn a_turned_table_and_a_track_that_hangs() {
    let text = std::fs::read_to_string("../../samples/slot/cell.toml").unwrap();
    let units = "\n[[unit]]\nname = \"TABLE\"\naxis = \"eax_b\"\nkind = \"rotary\"\ncarries = \"part\"\n\
                 base_mm = [1500.0, 0.0, 600.0]\nbase_quat = [1.0, 0.0, 0.0, 0.0]\nmin = -180.0\nmax = 180.0\n\
                 [wobjs.wTurned]\nunit = \"TABLE\"\n";
    let cell = Cell::read(&Source::new("cell.toml", (text + units).into_bytes())).unwrap();
    let tool = tool_of(&cell, None).unwrap();
    let (axes, force) = ([[0.0, 20.0, 10.0, 15.0, 40.0, -30.0]; 2], [0.0, 0.0, 400.0]);
    let external = external_of(&cell, &[("table", &[0.0, 90.0])], 2).unwrap();
    let standing = Standing { wobj: Some("wTurned"), external: &external, ..Standing::default() };
    let found = predict_poses(&cell, &tool, &axes, &[force; 2], standing).unwrap();
    let base = predict_poses(&cell, &tool, &axes, &[force; 2], Standing::default()).unwrap();
    // The table's frame at zero, turned by hand: x of the table is y of the base at 90 degrees.
    let there = base[0].as_ref().unwrap().translation.vector - Vector3::new(1.5, 0.0, 0.6);
    let [zero, quarter] = [0, 1].map(|i| found[i].as_ref().unwrap().translation.vector);
    assert!((zero - there).norm() < 1e-12 && (quarter - Vector3::new(there.y, -there.x, there.z)).norm() < 1e-12);
    assert!(
        predict_poses(&cell, &tool, &axes, &[force; 2], Standing { wobj: Some("wTurned"), ..Standing::default() })
            .is_err()
    );
    assert!(external_of(&cell, &[("TABLE", &[200.0, 0.0])], 2).is_err());
    assert!(external_of(&cell, &[("TRACK", &[0.0, 0.0])], 2).is_err());
}
