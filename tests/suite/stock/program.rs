//! A program through a cell with `[stock]`: the same cut as declared, volumes, collisions, feedback, and the part that comes out.

use super::within;
use deflex::cell::Cell;
use deflex::correct::{Corrected, CutProgress, Cuts, Options, compensate, cut_stock, predict};
use deflex::program::{Program, rapid};
use deflex::report::{DeviationMap, probe, stl};
use deflex::text::{Diagnostic, Source};
use nalgebra::Vector3;
use std::sync::{Arc, Mutex};

/// A cell with an engagement, and more sections behind it.
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

/// Moves: x, y, z in mm, and a speed.
fn program(moves: &[([f64; 3], &str)]) -> Program {
    let mut text = "MODULE M\n\
        PERS tooldata tMill:=[TRUE,[[0,0,300],[1,0,0,0]],[18,[0,0,120],[1,0,0,0],0,0,0]];\n\
        PERS wobjdata wBlock:=[FALSE,TRUE,\"\",[[1250,-120,620],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\n\
        PROC main()\n"
        .to_owned();
    for ([x, y, z], speed) in moves {
        text += &format!(
            "MoveL [[{x},{y},{z}],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],{speed},z0,tMill\\WObj:=wBlock;\n"
        );
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
    let options = Options { forces: Some(deflex::measured::Forces::default()), ..Options::default() };
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

/// Forces, deflected cuts and the surface that comes out, whatever the number of threads.
#[test]
fn threads_change_no_bit() {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let (cell, options) = (cell("mode = \"stock\"", STOCK), Options::default());
            let corrected = compensate(&slot(), &cell, &options).unwrap();
            let predicted = predict(&slot(), &cell, &options, None).unwrap();
            let cut = cut_stock(&slot(), &cell, &options, None, Cuts::Deflected).unwrap();
            let rows = format!("{:?}{:?}", corrected.rows, predicted.rows);
            (rows, cut.stock.removed().to_bits(), stl(&cut.stock.surface(1e-3)))
        })
    };
    let one = run(1);
    [2, 5].into_iter().for_each(|threads| assert!(run(threads) == one, "{threads} threads"));
}

/// A cut tells how far it is, from less to more and to its end, and goes no further than whoever follows it wants.
#[test]
fn a_cut_is_followed_and_called_off() {
    let cell = cell("mode = \"stock\"", STOCK);
    // More than one batch of what is asked of the stock at once.
    let long: Vec<_> = (0..1500).map(|i| ([0.04 * f64::from(i) - 6.0, 20.0, -1.5], "v20")).collect();
    let long = program(&long);
    let followed = |goes_on: bool| {
        let told = Arc::new(Mutex::new(Vec::new()));
        let notebook = Arc::clone(&told);
        let follow = move |share| {
            notebook.lock().unwrap().push(share);
            goes_on
        };
        (Options { cut_progress: CutProgress::new(follow), ..Options::default() }, told)
    };
    for cuts in [Cuts::Programmed, Cuts::Deflected] {
        let (options, told) = followed(false);
        let Err(refused) = cut_stock(&long, &cell, &options, None, cuts) else { panic!("{cuts:?} is not called off") };
        assert_eq!(refused.iter().map(|d| d.code).collect::<Vec<_>>(), ["run.called-off"], "{cuts:?}");
        assert!(told.lock().unwrap()[0] < 0.9, "{cuts:?}");
    }
    let (options, told) = followed(true);
    compensate(&long, &cell, &options).unwrap();
    let told = told.lock().unwrap();
    assert!(told.len() > 2 && told.is_sorted() && told.last() == Some(&1.0), "{told:?}");
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
