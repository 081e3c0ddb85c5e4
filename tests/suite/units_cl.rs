//! CL data on mechanical units: the cell says where they stand, the posted program sends them there.

use crate::units::{TABLE, TRACK, cell as cell_with, same, without_lost_motion};
use deflex::cell::Cell;
use deflex::correct::{Corrected, Options, PostOptions, compensate, post, predict};
use deflex::program::{Language, Program, cl, rapid};
use deflex::robot::Carries;
use deflex::text::Source;

const SECTIONS: &str = "
[tools.tA]
tcp_mm = [20.0, 0.0, 210.0]
tcp_quat = [1.0, 0.0, 0.0, 0.0]
mass_kg = 18.0
cog_mm = [0.0, 0.0, 120.0]
[cl]
tool = \"tA\"
wobj = \"wA\"
units = \"mm\"
spin = \"fixed\"
";
const FIXED: &str = "[wobjs.wA]\nuframe_mm = [1300.0, 0.0, 900.0]\nuframe_quat = [1.0, 0.0, 0.0, 0.0]\n";
const ON_TABLE: &str = "[wobjs.wA]\nunit = \"stn1\"\noframe_mm = [-50.0, 0.0, 200.0]\n";

fn cell(base_mm: [f64; 3], external: &str, more: &str) -> Cell {
    cell_with(base_mm, &format!("{SECTIONS}{external}\n{more}"))
}

fn program(cell: &Cell) -> Program {
    let line = |i: usize| {
        let share = i as f64 / 8.0;
        let (lean, up) = (0.2 * share, (1.0 - 0.04 * share * share).sqrt());
        format!("GOTO/{},{},{},{lean},0,{up}\n", 100.0 * share, 60.0 * (4.0 * share).sin(), 10.0 * share)
    };
    let text = format!("UNITS/MM\nMULTAX/ON\nFEDRAT/3000,MMPM\n{}END\n", (0..9).map(line).collect::<String>());
    cl::read(Source::new("m.apt", text.into_bytes()), &cell.cl.as_ref().unwrap().options).unwrap()
}

fn corrected(cell: &Cell) -> Corrected {
    let corrected = compensate(&program(cell), cell, &posted()).unwrap();
    assert!(corrected.failures.is_empty(), "{:?}", corrected.failures);
    corrected
}

fn posted() -> Options {
    Options { post: Some(Language::Rapid), ..Options::default() }
}

#[test]
fn a_track_that_stands_is_a_moved_base() {
    let on_track = cell([0.0; 3], "external = { eax_a = 250.0 }", &format!("{FIXED}{TRACK}"));
    let [on_track, moved] = [on_track, cell([0.0, 240.0, 70.0], "", FIXED)].map(without_lost_motion);
    same(&corrected(&on_track), &corrected(&moved));
}

/// What is posted has the axes and the unit of the work object, and lands where the CL data meant to.
#[test]
fn what_is_posted_stands_where_the_cell_says() {
    let cell = cell([0.0; 3], "external = { eax_a = 250.0, eax_b = 25.0 }", &format!("{ON_TABLE}{TRACK}{TABLE}"));
    let corrected = corrected(&cell);
    let options = |language| PostOptions {
        name: "m".into(),
        title: Vec::new(),
        max_targets: None,
        rapid_mm_s: 200.0,
        feed_mm_s: None,
        language,
    };
    let program = program(&cell);
    let file = post(&program, &cell, &corrected, &options(Language::Rapid)).unwrap().files.remove(0).1;
    let text = String::from_utf8(file.clone()).unwrap();
    assert!(text.contains("[FALSE,FALSE,\"STN1\",") && text.contains(",[250.0000,25.0000,9E9,9E9,9E9,9E9]]"), "{text}");
    let written = rapid::read(vec![Source::new("m.mod", file)], Vec::new()).unwrap();
    let landed = predict(&written, &cell, &Options::default(), None).unwrap();
    for (row, meant) in landed.rows.iter().zip(&corrected.rows) {
        // Error and correction are each against the numbers of their own program.
        for k in 0..3 {
            let off = row.error_mm[k] + meant.correction_mm[k] - meant.remaining_mm[k];
            assert!(off.abs() < 1e-4, "{} {off}", row.target);
        }
    }
    assert!(post(&program, &cell, &corrected, &options(Language::Krl)).is_err());
    assert!(post(&program, &cell, &corrected, &options(Language::Ls)).is_err());
}

#[test]
fn a_unit_without_a_place_is_refused() {
    for more in [format!("{FIXED}{TRACK}"), format!("{ON_TABLE}{TABLE}")] {
        let cell = cell([0.0; 3], "", &more);
        let errors = compensate(&program(&cell), &cell, &posted()).unwrap_err();
        assert_eq!(errors[0].code, "cell.unit", "{errors:?}");
    }
    let carries = cell([0.0; 3], "", &format!("{ON_TABLE}{TABLE}")).units.all()[0].carries;
    assert_eq!(carries, Carries::Part);
}
