//! A program through a cell with `[stock]`: the same cut as declared, volumes, collisions, feedback, and the part that comes out.

use super::within;
use deflex::cell::Cell;
use deflex::correct::{
    Corrected, CutProgress, Cuts, LoadedSample, Options, compensate, cut_stock, loaded_path, predict,
};
use deflex::measured::{ForceRow, TargetRef};
use deflex::program::{Program, rapid};
use deflex::report::{DeviationMap, probe, stl};
use deflex::text::{Diagnostic, Source};
use nalgebra::Vector3;
use std::sync::{Arc, Mutex};

/// A cell with an engagement, and more sections after it.
fn cell(engagement: &str, more: &str) -> Cell {
    let text = format!(
        r#"
[robot]
model = "irb6660-205-1.9"
start_deg = [-5, 20, 20, 0, 60, 0]
[robot.stiffness]
joint_nm_per_rad = [8.86e5, 5.5e5, 1.85e6, 3.3e5, 2.1e5, 8.81e4]
[controller]
compensates = []
[cut]
force = "mechanistic"
max_cutting_feed_mm_s = 100.0
[cut.cutter]
diameter_mm = 16.0
corner_radius_mm = 2.0
teeth = 3
[cut.engagement]
feed_per_tooth_mm = 0.06
{engagement}
[cut.coefficients]
material = "al7075"
{more}
"#
    );
    Cell::read(&Source::new("cell.toml", text.into_bytes())).unwrap()
}

const STOCK: &str = "[stock]\nbox_mm = [[0, 0, -20], [48, 40, 0]]\nresolution_mm = 0.4\n";

const MODULE: &str = "MODULE M\n\
    PERS tooldata tMill:=[TRUE,[[0,0,300],[1,0,0,0]],[18,[0,0,120],[1,0,0,0],0,0,0]];\n\
    PERS wobjdata wBlock:=[FALSE,TRUE,\"\",[[1250,-120,620],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\n\
    PROC main()\n";

/// A line to a place, mm.
fn move_to([x, y, z]: [f64; 3], speed: &str, zone: &str) -> String {
    format!("MoveL [[{x},{y},{z}],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],{speed},{zone},tMill\\WObj:=wBlock;\n")
}

/// Moves: x, y, z in mm, and a speed.
fn program(moves: &[([f64; 3], &str)]) -> Program {
    let mut text = MODULE.to_owned();
    for (place, speed) in moves {
        text += &move_to(*place, speed, "z0");
    }
    text += "ENDPROC\nENDMODULE\n";
    rapid::read(vec![Source::new("part.mod", text.into_bytes())], Vec::new()).unwrap()
}

fn slot() -> Program {
    let mut moves = vec![([-12.0, 20.0, 10.0], "v200"), ([-12.0, 20.0, -1.5], "v200")];
    moves.extend((-2..=14).map(|i| ([4.0 * f64::from(i), 20.0, -1.5], "v20")));
    moves.push(([56.0, 20.0, 10.0], "v200"));
    program(&moves)
}

/// A table of forces in which none acts.
fn no_force() -> Options {
    let row = (TargetRef::Ordinal(1), ForceRow { force: Some(Vector3::zeros()), ..ForceRow::default() });
    Options { forces: Some([row].into_iter().collect()), ..Options::default() }
}

fn force(corrected: &Corrected, row: usize) -> Vector3<f64> {
    corrected.rows[row].force_n.into()
}

#[test]
fn a_slot_from_the_stock_is_the_declared_one_in_the_report() {
    let options = Options::default();
    let declared = cell("mode = \"slot\"\ndepth_mm = 1.5\nlead_deg = 0\ntilt_deg = 0", "");
    let stock = cell("mode = \"stock\"", STOCK);
    // Correcting leaves the force at rest; the declared cell's row has it at the uncorrected pose.
    let wanted = predict(&slot(), &declared, &options, None).unwrap();
    let found = predict(&slot(), &stock, &options, None).unwrap();
    within(force(&found, 10), force(&wanted, 10), 0.01);
    let corrected = compensate(&slot(), &stock, &options).unwrap();
    assert!(corrected.failures.is_empty());
    let row = &corrected.rows[10];
    assert!((row.depth_mm.unwrap() - 1.5).abs() < 0.01 && (row.engaged_deg.unwrap() - 180.0).abs() < 0.5, "{row:?}");
    assert!(row.remaining_norm_mm() < 1e-3);
    // Pushed off, the tool cuts less.
    assert!(force(&found, 10).norm() < 0.995 * force(&corrected, 10).norm());
    assert!(found.rows[10].depth_mm.unwrap() < 1.5 - 0.5 * found.rows[10].error_mm[2]);
    // Before the block, and over it: air.
    assert!(force(&corrected, 0).norm() < 1e-12);
    // 48 × 16 × 1.5 less what the rounded corners leave.
    let removed: f64 = corrected.rows.iter().filter_map(|row| row.removed_mm3).sum();
    let full = 48.0 * (16.0 * 1.5 - 2.0 * section_left());
    assert!((removed / full - 1.0).abs() < 5e-3, "{removed} {full}");
}

/// A table of measured rows may have times and no forces: then the cut says the force.
#[test]
fn a_table_without_forces_leaves_the_force_to_the_cut() {
    for engagement in ["mode = \"stock\"", "mode = \"slot\"\ndepth_mm = 1.5\nlead_deg = 0\ntilt_deg = 0"] {
        let cell = cell(engagement, if engagement.contains("stock") { STOCK } else { "" });
        let row = |i: u32| (TargetRef::Ordinal(i), ForceRow { time: Some(f64::from(i)), ..ForceRow::default() });
        let timed = Options { forces: Some((1..=20).map(row).collect()), ..Options::default() };
        let wanted = predict(&slot(), &cell, &Options::default(), None).unwrap();
        let found = predict(&slot(), &cell, &timed, None).unwrap();
        assert!(force(&wanted, 10).norm() > 10.0);
        for row in 0..wanted.rows.len() {
            assert!((force(&found, row) - force(&wanted, row)).norm() < 1e-9, "{row}");
        }
    }
}

/// Of a slot 1.5 deep, a corner of radius 2 leaves below its arc, mm².
fn section_left() -> f64 {
    let n = 10_000;
    let z = |i: usize| 1.5 * (i as f64 + 0.5) / f64::from(n);
    (0..n as usize).map(|i| 2.0 - (4.0 - (2.0 - z(i)).powi(2)).sqrt()).sum::<f64>() * 1.5 / f64::from(n)
}

#[test]
fn a_rapid_move_through_material_names_its_line() {
    let through = program(&[([-12.0, 20.0, -1.5], "v200"), ([0.0, 20.0, -1.5], "v20"), ([30.0, 20.0, -1.5], "v500")]);
    let refused: Vec<Diagnostic> =
        compensate(&through, &cell("mode = \"stock\"", STOCK), &Options::default()).unwrap_err();
    assert_eq!(refused.len(), 1, "{refused:?}");
    assert_eq!((refused[0].code, refused[0].line), ("stock.rapid", 7));
}

#[test]
fn a_known_shift_is_the_deviation() {
    // The work object stands 0.1 mm lower than declared: the tool cuts as much too high in it, whatever the force.
    let shifted = cell(
        "mode = \"stock\"",
        &format!("{STOCK}[[effect]]\nkind = \"work_object_frame\"\nd_mm = [0.0, 0.0, -0.1]\nd_rad = [0.0, 0.0, 0.0]\n"),
    );
    let options = no_force();
    let programmed = cut_stock(&slot(), &shifted, &options, None, Cuts::Programmed).unwrap();
    let actual = cut_stock(&slot(), &shifted, &options, None, Cuts::Deflected).unwrap();
    let mesh = programmed.stock.surface(0.8e-3);
    let volume = mesh.volume();
    assert!((volume / programmed.stock.volume() - 1.0).abs() < 5e-3, "{volume}");
    assert_eq!(stl(&mesh).len(), 84 + 50 * mesh.triangles.len());
    let map = DeviationMap::new(mesh, &programmed.stock, programmed.stock.blank(), &actual.stock);
    let floor: Vec<f64> =
        map.points().iter().filter(|p| (p.position_mm[2] + 1.5).abs() < 1e-3).map(|p| p.deviation_mm).collect();
    assert!(floor.len() > 100 && floor.iter().all(|d| (d - 0.1).abs() < 2e-3), "{:?}", &floor[..10]);
    let at = |z: f64| Vector3::new(24.0, 20.0, z) * 1e-3;
    let up = Vector3::z();
    assert!((probe(&actual.stock, &at(-1.5), Some(&up)).unwrap() - 0.1).abs() < 1e-3);
    assert!(probe(&actual.stock, &at(-1.4), Some(&up)).unwrap().abs() < 1e-3);
    let figures = map.figures();
    assert!(figures.leftover.max_mm >= 0.1 && figures.max_mm < 0.11, "{figures:?}");
}

/// A law of a controller that does nothing but round corners within the whole zone.
const ROUNDS_ONLY: &str = "[controller.path]\nzone_share = 1.0\nsmoothing_s = [1e-5, 1e-5]\nacceleration_mm_s2 = 1e9\n\
                           corner_acceleration_mm_s2 = 1e9\n";

/// A law as that of a real controller.
const TYPICAL: &str = "[controller.path]\nzone_share = 0.87\nsmoothing_s = [0.058, 0.058]\nacceleration_mm_s2 = 8000.0\n\
                       corner_acceleration_mm_s2 = 4000.0\n";

/// Radius of the cutter 1.3 over its tip, where its edge is rounded with 2: 6 + √(2² − 0.7²), mm.
const EDGE: f64 = 7.873_499;

/// A pocket's corner, 1.5 deep: along x to (24, 20), and along y out of the block.
fn corner(zone: &str) -> Program {
    let text = MODULE.to_owned()
        + &[[-12.0, 20.0, 10.0], [-12.0, 20.0, -1.5], [24.0, 20.0, -1.5], [24.0, 60.0, -1.5]]
            .map(|[x, y, z]| move_to([x, y, z], "v20", if (x, y) == (24.0, 20.0) { zone } else { "fine" }))
            .concat()
        + "ENDPROC\nENDMODULE\n";
    rapid::read(vec![Source::new("corner.mod", text.into_bytes())], Vec::new()).unwrap()
}

/// The way of the cutter's axis round a right angle in a zone of radius r is a parabola that passes the corner r √2 / 4 away. So much
/// is left on the wall there. Of the pocket, a strip as wide as the cutter's radius is left for each millimetre that the parabola is
/// shorter than the two ways, and a third of the triangle that it cuts off.
#[test]
fn a_corner_that_the_controller_rounds_is_left_in_the_part() {
    let cell = cell("mode = \"stock\"", &format!("{STOCK}{ROUNDS_ONLY}"));
    let options = no_force();
    let cut = |zone: &str, cuts: Cuts| cut_stock(&corner(zone), &cell, &options, None, cuts).unwrap();
    let (sharp, rounded) = (cut("z5", Cuts::Programmed), cut("z5", Cuts::Driven));
    let radius = 5.0_f64;
    let outwards = Vector3::new(1.0, -1.0, 0.0).normalize();
    let wall = (Vector3::new(24.0, 20.0, -0.2) + outwards * EDGE) * 1e-3;
    let left = |cut: &deflex::correct::Removal| probe(&cut.stock, &wall, Some(&-outwards)).unwrap();
    assert!(left(&sharp).abs() < 6e-3, "{}", left(&sharp));
    let away = radius * std::f64::consts::SQRT_2 / 4.0;
    assert!((left(&rounded) - away).abs() < 6e-3, "{} for {away}", left(&rounded));
    // Length of the parabola: r (1 + asinh(1) / √2).
    let shorter = radius * (1.0 - 1.0_f64.asinh() / std::f64::consts::SQRT_2);
    let expected = (1.5 * 8.0 - section_left()) * shorter + 1.5 * radius * radius / 6.0;
    let volume = 1e9 * (sharp.stock.removed() - rounded.stock.removed());
    // Two lines of the stock are 0.48 mm³.
    assert!((volume - expected).abs() < 0.5, "{volume} for {expected} mm³");
    // Where it stops at the corner, nothing is left but what the 0.08 mm between two samples cut off.
    let stopped = cut("fine", Cuts::Driven);
    assert!((left(&stopped) - left(&sharp)).abs() < 0.08 / 8.0_f64.sqrt(), "{}", left(&stopped));
    let less = 1e9 * (sharp.stock.removed() - stopped.stock.removed());
    // One line of the stock is 0.24 mm³.
    assert!(less.abs() < 0.3, "{less} mm³");
    assert!(rounded.notes.is_empty(), "{:?}", rounded.notes);
}

/// A controller that drives corners as they are written leaves what the deflected tool leaves on the written way, away from the corner
/// where it stops and the arm springs back.
#[test]
fn a_driven_way_that_is_the_written_one_leaves_the_same_part() {
    let as_written = ROUNDS_ONLY.replace("zone_share = 1.0", "zone_share = 1e-9");
    let cell = cell("mode = \"stock\"", &format!("{STOCK}{as_written}"));
    let cut = |cuts: Cuts| cut_stock(&corner("fine"), &cell, &Options::default(), None, cuts).unwrap();
    let [deflected, driven] = [Cuts::Deflected, Cuts::Driven].map(cut);
    for k in 2..9 {
        let (x, y) = (2.0 * f64::from(k), 20.0 + 1.5 * f64::from(k));
        let floors = [[x, 20.0, -1.5], [24.0, y, -1.5]].map(|place| (place, Vector3::z()));
        let walls = [([x, 20.0 - EDGE, -0.2], Vector3::y()), ([24.0 + EDGE, y, -0.2], -Vector3::x())];
        for (place, normal) in floors.into_iter().chain(walls) {
            let left = |cut: &deflex::correct::Removal| {
                probe(&cut.stock, &(Vector3::from(place) * 1e-3), Some(&normal)).unwrap()
            };
            let (wanted, found) = (left(&deflected), left(&driven));
            // The walls are 0.28 mm off. While the cutter of 4 mm radius leaves the slot before the corner, and where the block ends, the
            // force changes within a fraction of a place.
            let most = if (24.0..30.0).contains(&y) { 2e-3 } else { 0.02 };
            assert!((found - wanted).abs() < most, "{place:?}: {found} for {wanted} mm");
        }
    }
}

/// The chip, and with it the force, is that of the speed that is driven, where what is cut follows from the stock too: between the
/// force of the edges at a stop and the whole one at the programmed speed, evenly.
#[test]
fn the_force_of_a_cut_from_stock_follows_the_speed_that_is_driven() {
    let cell = cell("mode = \"stock\"", &format!("{STOCK}{TYPICAL}"));
    let path = loaded_path(&corner("fine"), &cell, &Options::default()).unwrap();
    // From the block's edge to the corner, where the arm stops: the cutter is wholly in the slot from 0 on.
    let side: Vec<_> = path.samples.iter().filter(|sample| sample.target == 3).collect();
    let on_slot = |sample: &&&LoadedSample| sample.wobj_from_tcp.translation.x > 8e-3;
    let at = |feed: f64| side.iter().filter(on_slot).find(|sample| (sample.feed - feed).abs() < 0.6e-3).unwrap().force;
    let [slow, half, full] = [0.5e-3, 10e-3, 20e-3].map(at);
    assert!(slow.norm() < 0.85 * full.norm() && slow.norm() > 0.0, "{slow} of {full} N");
    assert!((half - (slow + full) * 0.5).norm() < 0.06 * full.norm(), "{slow} {half} {full} N");
    // The arm springs back where it stops, and leaves less on the wall that the force pushes it away from.
    let cut = cut_stock(&corner("fine"), &cell, &Options::default(), None, Cuts::Driven).unwrap();
    let wall = |x: f64| {
        let wall = Vector3::new(x, 20.0 - EDGE, -0.2) * 1e-3;
        probe(&cut.stock, &wall, Some(&Vector3::y())).unwrap()
    };
    assert!(wall(10.0) > 0.01 && wall(24.0) < 0.75 * wall(10.0), "{} and {} mm", wall(10.0), wall(24.0));
}

/// Forces, deflected cuts and the surface that comes out, whatever the number of threads.
#[test]
fn threads_change_no_bit() {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let (written, options) = (cell("mode = \"stock\"", STOCK), Options::default());
            let corrected = compensate(&slot(), &written, &options).unwrap();
            let predicted = predict(&slot(), &written, &options, None).unwrap();
            let rows = format!("{:?}{:?}", corrected.rows, predicted.rows);
            let driven = cell("mode = \"stock\"", &format!("{STOCK}{TYPICAL}"));
            let cuts = [(slot(), &written, Cuts::Deflected), (corner("z5"), &driven, Cuts::Driven)];
            let left = cuts.map(|(program, cell, cuts)| {
                let cut = cut_stock(&program, cell, &options, None, cuts).unwrap();
                (cut.stock.removed().to_bits(), stl(&cut.stock.surface(1e-3)))
            });
            (rows, left)
        })
    };
    let one = run(1);
    [2, 5].into_iter().for_each(|threads| assert!(run(threads) == one, "{threads} threads"));
}

/// A cut reports its progress in rising order up to its end, and stops when its receiver cancels it.
#[test]
fn a_cut_is_followed_and_called_off() {
    let cell = cell("mode = \"stock\"", STOCK);
    // More than one batch of positions at which the force is computed at once.
    let long: Vec<_> = (0..1500).map(|i| ([0.04 * f64::from(i) - 6.0, 20.0, -1.5], "v20")).collect();
    let long = program(&long);
    let followed = |goes_on: bool| {
        let shares = Arc::new(Mutex::new(Vec::new()));
        let notebook = Arc::clone(&shares);
        let follow = move |share| {
            notebook.lock().unwrap().push(share);
            goes_on
        };
        (Options { cut_progress: CutProgress::new(follow), ..Options::default() }, shares)
    };
    for cuts in [Cuts::Programmed, Cuts::Deflected, Cuts::Driven] {
        let (options, shares) = followed(false);
        let Err(refused) = cut_stock(&long, &cell, &options, None, cuts) else { panic!("{cuts:?} is not called off") };
        assert_eq!(refused.iter().map(|d| d.code).collect::<Vec<_>>(), ["run.called-off"], "{cuts:?}");
        assert!(shares.lock().unwrap()[0] < 0.9, "{cuts:?}");
    }
    let (options, shares) = followed(true);
    compensate(&long, &cell, &options).unwrap();
    let shares = shares.lock().unwrap();
    assert!(shares.len() > 2 && shares.is_sorted() && shares.last() == Some(&1.0), "{shares:?}");
}

/// On a plunge the arm yields sideways by hundredths: that is no cut with the side of the cutter.
#[test]
fn a_plunge_is_cut_along_the_axis() {
    let down = |x: f64| {
        program(&[([24.0, 20.0, 1.0], "v200"), ([24.0 + x, 20.0, -3.0], "v20"), ([24.0 + x, 20.0, -5.0], "v20")])
    };
    let stock = cell("mode = \"stock\"", STOCK);
    for x in [0.0, 0.01, -0.01, 0.1] {
        for predicted in
            [predict(&down(x), &stock, &Options::default(), None), compensate(&down(x), &stock, &Options::default())]
        {
            for row in &predicted.unwrap().rows[1..] {
                let force = Vector3::from(row.force_n);
                assert!(force.z > 100.0 && force.x.hypot(force.y) < 0.05 * force.z, "{x}: {force:?}");
            }
        }
    }
}
