//! `plan`: rows that the arm reaches, within what the shop allows, the same for any number of threads.

use deflex::cell::Cell;
use deflex::identify::{Ask, Plan, PlanInput, PlanProgram, plan};
use deflex::measured::{Table, TargetRef};
use deflex::program::{Goal, Language, rapid};
use deflex::text::Source;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

const CELL: &str = r#"
[robot]
model = "irb6660-205-1.9"
[robot.stiffness]
joint_nm_per_rad = [8.86e5, 5.5e5, 1.85e6, 3.3e5, 2.1e5, 8.81e4]
[cut]
force = "table"
[tools.tMill]
tcp_mm = [40.0, 0.0, 310.0]
tcp_quat = [1.0, 0.0, 0.0, 0.0]
mass_kg = 18.0
[wobjs.wPart]
uframe_mm = [1000.0, -300.0, 700.0]
uframe_quat = [1.0, 0.0, 0.0, 0.0]
[plan]
wobj = "wPart"
tool = "tMill"
box_mm = [[0.0, 0.0, 0.0], [400.0, 600.0, 200.0]]
tilt_deg = 25.0
loads_n = [[0.0, 0.0, 0.0], [0.0, 0.0, 300.0]]
load_changes = 2
instrument = "position"
noise_mm = 0.015
effect_mm = 0.05
effects = ["backlash", "joint_stiffness"]
"#;

const PROGRAM: PlanProgram = PlanProgram { name: "measure", language: Language::Rapid, ask: Ask::Never };

fn cell(text: &str) -> Cell {
    Cell::read(&Source::new("cell.toml", text.as_bytes())).unwrap()
}

fn planned(text: &str, threads: usize) -> Plan {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let cell = cell(text);
    let input = PlanInput { cell: &cell, rows: 8, pool: &[], undecided: &[], program: PROGRAM, progress: &|_| {} };
    pool.install(|| plan(&input)).unwrap()
}

#[test]
fn rows_are_reached_within_what_the_shop_allows_whatever_the_threads() {
    let found = planned(CELL, 1);
    let again = planned(CELL, 3);
    assert_eq!((&found.program, &found.table), (&again.program, &again.table));
    let program = rapid::read(vec![Source::new("plan.mod", found.program.as_bytes())], Vec::new()).unwrap();
    assert_eq!(program.targets.len(), 8);
    for target in &program.targets {
        let Goal::Pose { position_mm: [x, y, z], quat: [w, i, j, k], .. } = target.goal else { panic!("no pose") };
        assert!((0.0..=400.0).contains(&x) && (0.0..=600.0).contains(&y) && (0.0..=200.0).contains(&z));
        // The tool axis is −z of the TCP frame.
        let axis = UnitQuaternion::new_normalize(Quaternion::new(w, i, j, k)) * -Vector3::z();
        assert!(axis.angle(&Vector3::z()) <= 25.01_f64.to_radians());
    }
    let table = Table::read(&Source::new("plan.csv", found.table.as_bytes())).unwrap();
    let loads: Vec<u32> = table.rows.iter().map(|row| row.force_n.unwrap()[2] as u32).collect();
    assert!(loads.iter().all(|load| [0, 300].contains(load)));
    let changes = loads.windows(2).filter(|pair| pair[0] != pair[1]).count();
    assert!((1..=2).contains(&changes) && changes == found.load_changes, "{changes}");
    assert!(table.rows.windows(2).all(|rows| rows[0].time_s < rows[1].time_s));
    assert!(table.rows.iter().enumerate().all(|(i, row)| row.target == Some(TargetRef::Ordinal(i as u32 + 1))));
    assert!(table.rows.iter().all(|row| row.position_mm.is_none()));
    // One pair, and its figure is what noise makes of it.
    assert_eq!(found.pairs.len(), 1);
    let half = planned(&CELL.replace("noise_mm = 0.015", "noise_mm = 0.06"), 2);
    assert!(half.pairs[0].d_prime < found.pairs[0].d_prime && half.chance_right <= found.chance_right);
}

#[test]
fn what_cannot_be_planned_is_said() {
    let without = CELL.split("[plan]").next().unwrap();
    let refused = |text: &str| {
        let cell = cell(text);
        let input = PlanInput { cell: &cell, rows: 8, pool: &[], undecided: &[], program: PROGRAM, progress: &|_| {} };
        plan(&input).unwrap_err()[0].message.clone()
    };
    assert!(refused(without).contains("no [plan] section"));
    assert!(
        refused(&CELL.replace("[1000.0, -300.0, 700.0]", "[5000.0, 0.0, 0.0]")).contains("only 0 places are reached")
    );
    let harmonics = CELL.replace(r#"["backlash", "joint_stiffness"]"#, r#"["gear_harmonic"]"#);
    assert!(refused(&harmonics).contains("no rows of this plan show gear_harmonic"));
    let bad = |from: &str, to: &str| {
        Cell::read(&Source::new("cell.toml", CELL.replace(from, to).as_bytes())).unwrap_err()[0].message.clone()
    };
    assert!(bad(r#"tool = "tMill""#, r#"tool = "tMil""#).contains("the cell declares no such tool"));
    assert!(bad(r#""backlash", "#, r#""backlsh", "#).contains("is not known"));
    assert!(bad(r#""position""#, r#""distance""#).contains("plan.from_mm is missing"));
    assert!(bad("load_changes = 2\n", "").contains("plan.load_changes is missing"));
}
