//! The clamped part yields where it is cut: shares, signs and messages.

use deflex::cell::Cell;
use deflex::correct::{Corrected, Options, Status, compensate, predict};
use deflex::identify::{Added, Input, identify};
use deflex::measured::Table;
use deflex::program::Program;
use deflex::program::rapid;
use deflex::text::Source;
use nalgebra::Vector3;

/// A post of 12 × 12 × 80 mm on the arm of the paper.
const CELL: &str = r#"
[robot]
model = "irb6660-205-1.9"
[robot.stiffness]
joint_nm_per_rad = [8.86e5, 5.5e5, 1.85e6, 3.3e5, 2.1e5, 8.81e4]
[controller]
compensates = []
[tools.tEnd.cutter]
diameter_mm = 10.0
corner_radius_mm = 1.0
teeth = 3
[cut]
force = "mechanistic"
max_cutting_feed_mm_s = 100.0
[cut.engagement]
mode = "stock"
feed_per_tooth_mm = 0.06
[cut.coefficients]
material = "al7075"
[stock]
box_mm = [[0.0, 0.0, -80.0], [12.0, 12.0, 0.0]]
resolution_mm = 0.5
"#;

const PART: &str = r#"
[part.material]
e_n_mm2 = 71000.0
nu = 0.33
[[part.clamp]]
box_mm = [[0.0, 0.0, -80.0], [12.0, 12.0, -80.0]]
stiffness_n_per_mm = [inf, inf, inf]
"#;

/// Two millimetres off the top.
fn program() -> String {
    let external = "[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]";
    let mut text = format!(
        "MODULE Post
  PERS tooldata tEnd:=[TRUE,[[0,0,300],[1,0,0,0]],[18,[0,0,120],[1,0,0,0],0,0,0]];
  PERS wobjdata wPost:=[FALSE,TRUE,\"\",[[1250,-120,620],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  PROC main()
    ConfL\\Off;
    MoveAbsJ [[-5,20,20,0,60,0],{external}]\\NoEOffs,v500,z0,tEnd;\n"
    );
    let moves = [("MoveJ", -8.0, 20.0, "v200"), ("MoveL", -8.0, -2.0, "v200")];
    let cuts = (0..5).map(|n| ("MoveL", -4.0 + 4.0 * f64::from(n), -2.0, "v20"));
    for (word, x, z, speed) in moves.into_iter().chain(cuts) {
        text += &format!("    {word} [[{x},6,{z}],[0,0,1,0],[0,0,0,0],{external}],{speed},z0,tEnd\\WObj:=wPost;\n");
    }
    text + "  ENDPROC\nENDMODULE\n"
}

fn cell(text: &str) -> Cell {
    Cell::read(&Source::new("cell.toml", text.as_bytes().to_vec())).unwrap_or_else(|errors| panic!("{errors:?}"))
}

fn corrected(cell: &Cell) -> Corrected {
    let program = rapid::read(vec![Source::new("post.mod", program().into_bytes())], Vec::new()).unwrap();
    compensate(&program, cell, &Options::default()).unwrap_or_else(|errors| panic!("{errors:?}"))
}

#[test]
fn a_post_adds_what_a_cantilever_yields_to_the_error_of_the_arm() {
    let (rigid, yielding) = (corrected(&cell(CELL)), corrected(&cell(&format!("{CELL}{PART}"))));
    // It is cut 79 mm over the clamp: l³/(3 E I) and shear across, l/(E A) along. The force is spread over two cells.
    let (length, inertia, area, e) = (79.0_f64, 12.0_f64.powi(4) / 12.0, 144.0, 71_000.0);
    let shear = e / (2.0 * 1.33);
    let across = length.powi(3) / (3.0 * e * inertia) + 1.2 * length / (shear * area);
    let compliance = Vector3::new(across, across, length / (e * area));
    let mut cut = 0;
    for (before, after) in rigid.rows.iter().zip(&yielding.rows) {
        if after.status != Status::Ok {
            continue;
        }
        let force = Vector3::from(after.force_n);
        // Where it comes out, nothing is left to cut.
        if force.norm() < 1.0 {
            continue;
        }
        assert!((force - Vector3::from(before.force_n)).norm() < 1e-6 * force.norm(), "the path is the programmed one");
        // What acts on the tool acts on the part the other way: the tool is further along the force.
        let more = Vector3::from(after.error_mm) - Vector3::from(before.error_mm);
        let wanted = compliance.component_mul(&force);
        assert!((more - wanted).norm() < 0.08 * wanted.norm(), "target {}: {more} for {wanted}", after.target);
        let share = after.error_part_mm.unwrap();
        assert!((share - more.norm()).abs() < 0.01 * share, "{share} of {}", more.norm());
        assert_eq!(before.error_part_mm, None);
        // And it is corrected.
        assert!(after.remaining_norm_mm() < 1e-3, "target {}: {:?}", after.target, after.remaining_mm);
        let moved = Vector3::from(after.correction_mm) - Vector3::from(before.correction_mm);
        assert!((moved + more).norm() < 0.03 * more.norm(), "target {}: {moved}", after.target);
        cut += 1;
    }
    assert!(cut >= 3, "{cut}");
}

#[test]
fn a_soft_clamp_and_a_factor_on_the_stiffness_count() {
    let shares = |text: &str| -> Vec<f64> {
        let rows = corrected(&cell(text)).rows;
        rows.iter().filter(|row| row.status == Status::Ok).map(|row| row.error_part_mm.unwrap()).collect()
    };
    let stiff = shares(&format!("{CELL}{PART}"));
    let halved = shares(&format!("{CELL}{PART}\n[[effect]]\nkind = \"part_stiffness\"\nscale = 0.5\n"));
    let soft = shares(&format!("{CELL}{}", PART.replace("[inf, inf, inf]", "[1000.0, 1000.0, 1000.0]")));
    for ((stiff, halved), soft) in stiff.iter().zip(halved).zip(soft) {
        assert!((halved / stiff - 2.0).abs() < 0.02, "{halved} {stiff}");
        assert!(soft > 3.0 * stiff, "{soft} {stiff}");
    }
}

#[test]
fn what_the_cell_says_wrongly_of_a_part_is_said() {
    let cases = [
        ("nu = 0.33", "nu = 0.5", "Poisson"),
        ("e_n_mm2 = 71000.0", "e_n_mm2 = 0.0", "part.material.e_n_mm2"),
        ("[12.0, 12.0, -80.0]]", "[12.0, 12.0, -90.0]]", "the second corner of box_mm is below the first"),
        ("[[0.0, 0.0, -80.0], [12.0, 12.0, -80.0]]", "[[0, 0, 5], [12, 12, 9]]", "is outside of the blank"),
        ("[inf, inf, inf]", "[inf, -1.0, inf]", "a stiffness is below zero"),
        ("[inf, inf, inf]", "[0.0, 0.0, 0.0]", "holds nothing"),
    ];
    for (from, to, expected) in cases {
        let text = format!("{CELL}{}", PART.replace(from, to));
        let errors = Cell::read(&Source::new("cell.toml", text.into_bytes())).unwrap_err();
        assert!(errors.iter().any(|error| error.message.contains(expected)), "{expected}: {errors:?}");
    }
    let clamp = PART.find("[[part.clamp]]").unwrap();
    for (text, expected) in [
        (format!("{CELL}{}", &PART[..clamp]), "nothing holds the part"),
        (format!("{CELL}{}", &PART[clamp..]), "does not say what it is made of"),
        (format!("{CELL}[part]\ncell_mm = 1.0\n"), "says neither"),
    ] {
        let errors = Cell::read(&Source::new("cell.toml", text.into_bytes())).unwrap_err();
        assert!(errors.iter().any(|error| error.message.contains(expected)), "{expected}: {errors:?}");
    }
}

#[test]
fn a_part_that_floats_is_refused() {
    let program = rapid::read(vec![Source::new("post.mod", program().into_bytes())], Vec::new()).unwrap();
    for (from, to, expected) in [
        ("[inf, inf, inf]", "[inf, inf, 0.0]", "free to move"),
        ("[12.0, 12.0, -80.0]]", "[12.0, 0.0, -80.0]]", "free to turn"),
        // Between the blank's top and what is cut: nothing is left of it in the end.
        ("[[0.0, 0.0, -80.0], [12.0, 12.0, -80.0]]", "[[4.0, 4.0, -0.5], [8.0, 8.0, 0.0]]", "touches no material"),
    ] {
        let cell = cell(&format!("{CELL}{}", PART.replace(from, to)));
        let errors = compensate(&program, &cell, &Options::default()).unwrap_err();
        assert!(errors.iter().any(|error| error.message.contains(expected)), "{expected}: {errors:?}");
    }
}

#[test]
fn a_clamp_that_gives_way_takes_the_part_with_it() {
    // The only clamp: the place that is cut moves as the clamp does, by its compliance times the force along each axis.
    let c = [1e-4, 2e-4, 5e-5];
    let soft = format!(
        "{CELL}{PART}\n[[effect]]\nkind = \"clamp_compliance\"\nclamps = [{{ clamp = 1, mm_per_n = {c:?} }}]\n"
    );
    let (held, soft) = (corrected(&cell(&format!("{CELL}{PART}"))), corrected(&cell(&soft)));
    let mut cut = 0;
    for (before, after) in held.rows.iter().zip(&soft.rows).filter(|(_, after)| after.status == Status::Ok) {
        let force = Vector3::from(after.force_n);
        let more = Vector3::from(after.error_mm) - Vector3::from(before.error_mm);
        if force.norm() < 1.0 {
            continue;
        }
        let wanted = Vector3::from(c).component_mul(&force);
        assert!((more - wanted).norm() < 5e-3 * wanted.norm(), "target {}: {more} for {wanted}", after.target);
        assert!(after.remaining_norm_mm() < 1e-3, "target {}: {:?}", after.target, after.remaining_mm);
        cut += 1;
    }
    assert!(cut >= 3, "{cut}");
}

#[test]
fn a_clamp_that_is_not_declared_is_said() {
    let effect = "[[effect]]\nkind = \"clamp_compliance\"\nclamps = [{ clamp = 2, mm_per_n = [0, 0, 1e-4] }]\n";
    for part in [PART, ""] {
        let text = format!("{CELL}{part}{effect}");
        let errors = Cell::read(&Source::new("cell.toml", text.into_bytes())).unwrap_err();
        assert!(errors.iter().any(|error| error.message.contains("clamp 2 is not declared")), "{errors:?}");
    }
}

/// A plate of 100 × 60 × 6 mm that lies with its ends on two clamps, and is milled from above.
const PLATE: &str = r#"
[part]
cell_mm = 2.0
[part.material]
e_n_mm2 = 71000.0
nu = 0.33
[[part.clamp]]
box_mm = [[0.0, 0.0, -6.0], [8.0, 60.0, -6.0]]
stiffness_n_per_mm = [inf, inf, inf]
[[part.clamp]]
box_mm = [[92.0, 0.0, -6.0], [100.0, 60.0, -6.0]]
stiffness_n_per_mm = [inf, inf, inf]
"#;

fn plate(effect: &str) -> Cell {
    let text = CELL.replace("[[0.0, 0.0, -80.0], [12.0, 12.0, 0.0]]", "[[0.0, 0.0, -6.0], [100.0, 60.0, 0.0]]");
    // A ball end: it pushes the plate down.
    let text = text.replace("corner_radius_mm = 1.0", "corner_radius_mm = 5.0");
    cell(&format!("{text}{PLATE}{effect}"))
}

/// Slots a millimetre deep along the plate and across it, and the targets on them.
fn slots() -> Program {
    let external = "[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]";
    let mut text = program();
    let from = text.find("    MoveJ ").unwrap();
    text.truncate(from);
    let mut line = |word: &str, x: f64, y: f64, z: f64, speed: &str| {
        text += &format!("    {word} [[{x},{y},{z}],[0,0,1,0],[0,0,0,0],{external}],{speed},z0,tEnd\\WObj:=wPost;\n");
    };
    line("MoveJ", -10.0, 10.0, 20.0, "v200");
    for y in [10.0, 30.0, 50.0] {
        line("MoveL", -10.0, y, 20.0, "v200");
        line("MoveL", -10.0, y, -1.0, "v200");
        (0..24).for_each(|n| line("MoveL", -5.0 + 4.5 * f64::from(n), y, -1.0, "v20"));
        line("MoveL", 110.0, y, 20.0, "v200");
    }
    for x in [16.0, 33.0, 50.0, 67.0, 84.0] {
        line("MoveL", x, -10.0, 20.0, "v200");
        line("MoveL", x, -10.0, -1.0, "v200");
        (0..14).for_each(|n| line("MoveL", x, -5.0 + 5.0 * f64::from(n), -1.0, "v20"));
        line("MoveL", x, 70.0, 20.0, "v200");
    }
    text += "  ENDPROC\nENDMODULE\n";
    rapid::read(vec![Source::new("plate.mod", text.into_bytes())], Vec::new()).unwrap()
}

/// A stand-in for noise: uniform, of unit variance, the same on every run.
fn rough(i: usize) -> f64 {
    let x = (i as f64 * 12.9898).sin() * 43_758.545;
    3.464 * (x - x.floor() - 0.5)
}

/// What is found from rows of a plate on which an effect acts, measured to a micrometre, with the force that acted.
fn found_on_plate(effect: &str) -> Vec<Added> {
    let rows = predict(&slots(), &plate(effect), &Options::default(), None).unwrap().rows;
    let mut csv = "target,x_mm,y_mm,z_mm,fx_n,fy_n,fz_n\n".to_owned();
    for row in rows.iter().filter(|row| row.status == Status::Ok && Vector3::from(row.force_n).norm() > 1.0) {
        let seen: Vec<String> = (0..3)
            .map(|k| (row.position_mm[k] + row.error_mm[k] + 1e-3 * rough(3 * row.target as usize + k)).to_string())
            .collect();
        let [fx, fy, fz] = row.force_n;
        csv += &format!("{},{},{fx},{fy},{fz}\n", row.target, seen.join(","));
    }
    let table = Table::read(&Source::new("rows.csv", csv.into_bytes())).unwrap();
    let found = identify(Input {
        cell: &plate(""),
        runs: vec![(slots(), table).into()],
        poses: vec![],
        tool: None,
        data_hash: "test",
        written: Default::default(),
        progress: &|_| true,
    });
    found.unwrap().added
}

#[test]
fn a_soft_clamp_is_found_with_its_interval_and_told_from_a_soft_material() {
    let soft = "[[effect]]\nkind = \"clamp_compliance\"\nclamps = [{ clamp = 2, mm_per_n = [3e-6, 4e-6, 2e-4] }]\n";
    let added = found_on_plate(soft);
    let [clamp] = &added[..] else { panic!("{added:?}") };
    assert_eq!(clamp.kind, "clamp_compliance");
    // The numbers of the second clamp come last. Along the plate they are less than what can be seen.
    let of = |k: usize| &clamp.parameters[clamp.parameters.len() - 3 + k];
    for (k, truth) in [3e-6, 4e-6, 2e-4].into_iter().enumerate() {
        let [low, high] = of(k).ci95;
        assert!(low <= truth && truth <= high, "{k}: {clamp:?}");
    }
    let [low, high] = of(2).ci95;
    assert!(high - low < 0.5 * 2e-4, "{low} {high}");

    let added = found_on_plate("[[effect]]\nkind = \"part_stiffness\"\nscale = 0.5\n");
    let [material] = &added[..] else { panic!("{added:?}") };
    assert_eq!(material.kind, "part_stiffness");
    assert!((material.parameters[0].value - 0.5).abs() < 0.05, "{material:?}");
}
