//! Whole programs through the way that solves eight targets at once, against the plain way: the same program, the same digits.

use deflex::cell::Cell;
use deflex::correct::{Options, compensate};
use deflex::program::rapid;
use deflex::report::csv_rows;
use deflex::text::{Source, applied};
use proptest::prelude::*;
use std::fmt::Write;

const CELL: &str = include_str!("../../benches/cell.toml");

const WEIGHTS_AND_GAPS: &str = "
[[effect]]
kind = \"gravity\"
mass_kg = [0, 200, 150, 60, 30, 10]
first_moment_kg_m = [[0, 0, 0], [100, 0, 0], [30, 60, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0]]
tool = true
[[effect]]
kind = \"backlash\"
half_gap_rad = [1e-5, 2e-5, 2e-5, 3e-5, 3e-5, 5e-5]
";

const ZEROS_AND_FORCE: &str = "
[[effect]]
kind = \"zero_offset\"
offset_rad = [2e-4, -1e-3, 5e-4, 0.0, 1e-3, -3e-3]
[[effect]]
kind = \"force_scale\"
factor = 1.3
";

const WEAR_AND_FRAMES: &str = "
[[effect]]
kind = \"tool_wear\"
per_m = 0.4
[[effect]]
kind = \"tool_frame\"
d_mm = [0.05, -0.03, 0.1]
d_rad = [0.0, 5e-4, -1e-3]
[[effect]]
kind = \"work_object_frame\"
d_mm = [-0.2, 0.3, 0.05]
d_rad = [2e-4, 0.0, 1e-3]
";

/// An effect that does nothing, but is not simple: every target is solved by itself.
const ONE_BY_ONE: &str = "
[[effect]]
kind = \"hysteresis\"
fraction = [0, 0, 0, 0, 0, 0]
";

/// Numbers of a thousand that may be rounded to the other neighbour: both ways end a hundredth of a digit from the truth.
const OTHERWISE: usize = 10;

/// A wavy surface, cut back and forth.
fn program(targets: usize, slope: f64) -> String {
    let mut text = String::from(
        "MODULE Mill
  PERS tooldata tMill:=[TRUE,[[321.5,0,148.25],[0.70710678,0,0.70710678,0]],[38,[90,0,60],[1,0,0,0],0,0,0]];
  PERS wobjdata wPart:=[FALSE,TRUE,\"\",[[1600,-200,600],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  PROC main()
",
    );
    for i in 0..targets {
        let (row, along) = (i / 25, i % 25);
        let x = 3.0 * if row % 2 == 0 { along } else { 24 - along } as f64;
        let half: f64 = 0.0436 + 0.5 * (slope * (0.1 * x).cos()).atan();
        let (y, z) = (2.0 * row as f64, 40.0 + 10.0 * slope * (0.1 * x).sin());
        let axes = "[0,-1,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]";
        writeln!(
            text,
            "    MoveL [[{x:.3},{y:.3},{z:.3}],[0,{:.8},0,{:.8}],{axes}],v50,z1,tMill\\WObj:=wPart;",
            half.cos(),
            half.sin()
        )
        .unwrap();
    }
    text + "  ENDPROC\nENDMODULE\n"
}

/// The corrected program and its report.
fn run(text: &str, cell: &str) -> (String, String) {
    let program = rapid::read(vec![Source::new("part.mod", text)], Vec::new()).unwrap();
    let cell = Cell::read(&Source::new("cell.toml", cell)).unwrap();
    let corrected = compensate(&program, &cell, &Options::default()).unwrap();
    assert!(corrected.failures.is_empty(), "{:?}", corrected.failures.first());
    let out = applied(&program.sources[0].bytes, &corrected.rewritten.unwrap().edits[0]);
    (String::from_utf8(out).unwrap(), String::from_utf8(csv_rows(&corrected.rows)).unwrap())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]
    #[test]
    fn a_program_comes_out_as_if_each_target_were_solved_by_itself(
        targets in 1..120_usize,
        slope in 0.0..0.4_f64,
        (mode, width) in prop::sample::select(vec![("slot", "20.0"), ("down", "8.0"), ("up", "5.0")]),
        lead in prop::sample::select(vec!["5.0", "0.3", "15.0"]),
        soft in 1.0..8.0_f64,
        effects in prop::sample::select(vec!["", WEIGHTS_AND_GAPS, ZEROS_AND_FORCE, WEAR_AND_FRAMES]),
    ) {
        let springs = [3.8e6, 6.6e6, 3.9e6, 5.6e5, 6.6e5, 4.7e5].map(|stiffness| stiffness / soft);
        let cell = CELL
            .replace("[3.8e6, 6.6e6, 3.9e6, 5.6e5, 6.6e5, 4.7e5]", &format!("{springs:?}"))
            .replace("mode = \"slot\"", &format!("mode = \"{mode}\""))
            .replace("width_mm = 20.0", &format!("width_mm = {width}"))
            .replace("lead_deg = 5.0", &format!("lead_deg = {lead}"))
            .replace("max_correction_mm = 5.0", "max_correction_mm = 100.0")
            .replace("max_step_mm = 1.0", "max_step_mm = 100.0")
            + effects;
        let text = program(targets, slope);
        let (written, report) = run(&text, &cell);
        let (plain_written, plain_report) = run(&text, &(cell + ONE_BY_ONE));
        prop_assert_eq!(written, plain_written);

        let fields = |report: &str| -> Vec<String> { report.split([',', '\n']).map(str::to_owned).collect() };
        let (fields, plain) = (fields(&report), fields(&plain_report));
        prop_assert_eq!(fields.len(), plain.len());
        let differ: Vec<(&String, &String)> = fields.iter().zip(&plain).filter(|(a, b)| a != b).collect();
        prop_assert!(differ.len() <= fields.len() * OTHERWISE / 1000, "{} of {}", differ.len(), fields.len());
        for (a, b) in differ {
            // By the last digit alone.
            let digits = |number: &str| number.replace('.', "").parse::<i64>().unwrap();
            prop_assert!(a.find('.').map(|at| a.len() - at) == b.find('.').map(|at| b.len() - at), "{a} {b}");
            prop_assert!((digits(a) - digits(b)).abs() <= 1, "{a} {b}");
        }
    }
}
