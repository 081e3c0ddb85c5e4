//! The clamped part yields where it is cut: shares, signs and messages.

use crate::identify::{no_data, rough};
use deflex::cell::{Cell, extended};
use deflex::correct::{Corrected, Options, Row, Status, compensate, predict};
use deflex::identify::{Added, Identification, Input, identify};
use deflex::measured::Table;
use deflex::program::{Goal, Program, rapid};
use deflex::text::{Source, applied};
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
        ("[part.material]", "[part]\nstages = 1\n[part.material]", "part.stages is 1, expected 2 to 60"),
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

/// Two passes down the side of a plate that stands on its edge, towards low x, through places along x, mm.
fn down_the_side(places: &[f64]) -> Program {
    let external = "[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]";
    let mut text = program();
    text.truncate(text.find("    MoveJ ").unwrap());
    let mut line = |word: &str, x: f64, z: f64, speed: &str| {
        text += &format!("    {word} [[{x},-4,{z}],[0,0,1,0],[0,0,0,0],{external}],{speed},z0,tEnd\\WObj:=wPost;\n");
    };
    for z in [-18.0, -20.0] {
        line("MoveJ", 48.0, 20.0, "v200");
        line("MoveL", 48.0, z, "v200");
        places.iter().for_each(|x| line("MoveL", *x, z, "v20"));
        line("MoveL", -8.0, 20.0, "v200");
    }
    text += "  ENDPROC\nENDMODULE\n";
    rapid::read(vec![Source::new("side.mod", text.into_bytes())], Vec::new()).unwrap()
}

/// Where a cutter leaves the part, its flank touches all that it has left. It is held where it cuts, far below.
#[test]
fn a_part_is_as_stiff_as_where_it_is_cut_to_the_end_of_a_way_out_of_it() {
    let text = format!("{CELL}[part]\ncell_mm = 1.5\n{PART}")
        .replace("[[0.0, 0.0, -80.0], [12.0, 12.0, 0.0]]", "[[0.0, 0.0, -26.0], [40.0, 3.0, 0.0]]")
        .replace("[[0.0, 0.0, -80.0], [12.0, 12.0, -80.0]]", "[[0.0, 0.0, -26.0], [40.0, 3.0, -26.0]]")
        .replace("corner_radius_mm = 1.0", "corner_radius_mm = 0.0");
    let cell = cell(&text);
    // The command along y on the second pass at x = 2 mm: of a target, and of the path between 4 and 0 mm.
    let command = |places: &[f64], subdivide: Option<f64>| {
        let program = down_the_side(places);
        let done = compensate(&program, &cell, &Options { subdivide, ..Options::default() }).unwrap();
        let bytes = applied(&program.sources[0].bytes, &done.rewritten.unwrap().edits[0]);
        let corrected = rapid::read(vec![Source::new("side.mod", bytes)], Vec::new()).unwrap();
        let there = corrected.targets.iter().filter_map(|target| match target.goal {
            Goal::Pose { position_mm: [x, y, z], .. } if z < -19.0 => Some([x, y]),
            _ => None,
        });
        let there: Vec<[f64; 2]> = there.collect();
        let [before, after] = [|x: f64| x >= 2.0, |x: f64| x < 2.0].map(|side| {
            let near = |at: &&[f64; 2]| side(at[0]);
            *there.iter().filter(near).min_by(|a, b| (a[0] - 2.0).abs().total_cmp(&(b[0] - 2.0).abs())).unwrap()
        });
        after[1] + (before[1] - after[1]) * (2.0 - after[0]) / (before[0] - after[0])
    };
    let target = command(&[40.0, 20.0, 8.0, 4.0, 2.0, 0.0, -4.0], None);
    let between = command(&[40.0, 20.0, 8.0, 4.0, 0.0, -4.0], Some(1e-5));
    assert!(target > -3.98 && (target - between).abs() < 0.01, "{target} {between}");
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

fn plate_text(effect: &str) -> String {
    let text = CELL.replace("[[0.0, 0.0, -80.0], [12.0, 12.0, 0.0]]", "[[0.0, 0.0, -6.0], [100.0, 60.0, 0.0]]");
    // A ball end: it pushes the plate down.
    let text = text.replace("corner_radius_mm = 1.0", "corner_radius_mm = 5.0");
    format!("{text}{PLATE}{effect}")
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

/// What a cell makes of the targets on the plate that cut.
fn rows_of_plate(text: &str) -> Vec<Row> {
    let rows = predict(&slots(), &cell(text), &Options::default(), None).unwrap().rows;
    rows.into_iter().filter(|row| row.status == Status::Ok && Vector3::from(row.force_n).norm() > 1.0).collect()
}

/// Where the tip is seen at a row, mm: exact but for a micrometre of noise.
fn seen_mm(row: &Row) -> Vector3<f64> {
    let noise = [0, 1, 2].map(|k| 1e-3 * rough(3 * row.target as usize + k));
    Vector3::from(row.position_mm) + Vector3::from(row.error_mm) + Vector3::from(noise)
}

/// What is found from a table of rows of the plate.
fn found_from(csv: String) -> Identification {
    let table = Table::read(&Source::new("rows.csv", csv.into_bytes())).unwrap();
    identify(Input { runs: vec![(slots(), table).into()], ..no_data(&cell(&plate_text(""))) }).unwrap()
}

/// What is found with the force that acted.
fn found_on_plate(effect: &str) -> Vec<Added> {
    let mut csv = "target,x_mm,y_mm,z_mm,fx_n,fy_n,fz_n\n".to_owned();
    for row in rows_of_plate(&plate_text(effect)) {
        let ([x, y, z], [fx, fy, fz]) = (seen_mm(&row).into(), row.force_n);
        csv += &format!("{},{x},{y},{z},{fx},{fy},{fz}\n", row.target);
    }
    found_from(csv).added
}

/// Where no force was measured, it is that of the stock as the loaded arm and the part leave it, with all that is found.
#[test]
fn a_soft_part_is_found_from_positions_alone() {
    for scale in [0.5, 0.75] {
        let rows = rows_of_plate(&plate_text(&format!("[[effect]]\nkind = \"part_stiffness\"\nscale = {scale}\n")));
        let mut csv = "target,x_mm,y_mm,z_mm\n".to_owned();
        for row in &rows {
            let [x, y, z] = seen_mm(row).into();
            csv += &format!("{},{x},{y},{z}\n", row.target);
        }
        let found = found_from(csv);
        let [material] = &found.added[..] else { panic!("{:?}", found.added) };
        assert_eq!(material.kind, "part_stiffness");
        let [low, high] = material.parameters[0].ci95;
        assert!(low <= scale && scale <= high && high - low < 0.1 * scale, "{scale}: {material:?}");
        // A prediction by the cell that is found leaves what the identification says that it leaves.
        let text = extended(&plate_text(""), &found.extended).unwrap();
        for (row, left) in rows_of_plate(&text).iter().zip(&found.residuals) {
            let there = Vector3::from(row.position_mm) + Vector3::from(row.error_mm);
            let seen = seen_mm(rows.iter().find(|own| own.target == row.target).unwrap());
            let off = (seen - there - Vector3::from(left.postfit_mm)).norm();
            assert!(Some(row.target) == left.target && off < 1e-3, "target {}: {off} mm", row.target);
        }
    }
}

#[test]
fn a_soft_clamp_is_found_with_its_interval_and_distinguished_from_a_soft_material() {
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

/// A clamp that slips strains the part from then on, with and without the force. Between clamps that do not turn a beam takes the
/// form s² (3 − 2 s) of the slip.
#[test]
fn a_clamp_that_slipped_is_found_with_its_interval_and_is_no_soft_one() {
    let rows = rows_of_plate(&plate_text(""));
    let slipped = rows.len() / 2;
    let mut csv = "target,x_mm,y_mm,z_mm,fx_n,fy_n,fz_n\n".to_owned();
    for (i, row) in rows.iter().enumerate() {
        let ([x, y, z], [fx, fy, fz]) = (seen_mm(row).into(), row.force_n);
        let s = ((row.position_mm[0] - 8.0) / 84.0).clamp(0.0, 1.0);
        // The second clamp is lower by 20 µm, and the tip as much higher over the part.
        let z: f64 = z + if i < slipped { 0.0 } else { 0.02 * s * s * (3.0 - 2.0 * s) };
        csv += &format!("{},{x},{y},{z},{fx},{fy},{fz}\n", row.target);
    }
    let found = found_from(csv);
    assert!(found.added.is_empty(), "{:?}", found.added);
    let slips: Vec<_> = found.unexplained.correlates.iter().filter(|follows| follows.fault.is_some()).collect();
    let [slip] = slips[..] else { panic!("{:?}", found.unexplained) };
    assert_eq!(slip.fault, Some("clamp_slip"));
    let line: usize = slip.with.split_whitespace().filter_map(|word| word.parse().ok()).next().unwrap();
    assert!(slip.with.contains("clamp 2 slipped") && line.abs_diff(slipped + 2) <= 6, "{}", slip.with);
    let [low, high] = slip.parameters[2].ci95;
    assert!(low <= -0.02 && -0.02 <= high && high - low < 0.004, "{slip:?}");
    // A plate with slots is no beam to the last micrometre.
    assert!(slip.parameters[..2].iter().all(|along| along.value.abs() < 0.001), "{slip:?}");
}

/// A wall that deflex did not compute: a plate of finite elements under a cut of its own, after corrections with and without the part.
#[test]
#[ignore = "needs python3 with NumPy and takes some minutes: cargo test --test suite -- --ignored a_plant_with_a_wall"]
fn a_plant_with_a_wall_of_its_own_loses_most_of_its_deviation() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let run = std::process::Command::new("python3")
        .arg(root.join("samples/plant/thin_wall.py"))
        .args(["--deflex", env!("CARGO_BIN_EXE_deflex")])
        .output()
        .unwrap();
    let printed = String::from_utf8_lossy(&run.stdout);
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let last = printed.lines().last().unwrap();
    let gone: f64 = last.split_whitespace().find_map(|word| word.parse().ok()).unwrap();
    assert!(gone > GONE_ON_THE_PLANT, "{printed}");
}

/// Least share of the wall's deviation that is gone on the plant, in percent.
const GONE_ON_THE_PLANT: f64 = 70.0;
