//! FANUC TP in a cell: which cuts are corrected although a motion through air shares their positions.

use deflex_cell::Cell;
use deflex_correct::{Options, Status, compensate};
use deflex_program::tp;
use deflex_text::Source;

const CELL: &str = r#"
[robot]
model = "m-710ic-50"
[robot.stiffness]
joint_nm_per_rad = [1.0e6, 1.2e6, 9.0e5, 2.0e5, 2.2e5, 1.0e5]
[limits]
max_correction_mm = 5.0
max_step_mm = 10.0
[controller]
compensates = []
[cut]
force = "constant"
force_n = [-300.0, 120.0, 250.0]
frame = "wobj"
max_cutting_feed_mm_s = 100.0
[tools."UT 1"]
tcp_mm = [0.0, 0.0, 220.0]
tcp_wpr_deg = [0.0, 0.0, 0.0]
mass_kg = 5.0
cog_mm = [0.0, 0.0, 50.0]
[wobjs."UF 1"]
uframe_mm = [1150.0, -100.0, -250.0]
uframe_wpr_deg = [0.0, 0.0, 0.0]
"#;

/// Each motion from the second line on: whether it is corrected, or why it is kept.
fn rows(statements: &str, cell: &str) -> Vec<String> {
    let mut text =
        "/PROG  MAIN\n/ATTR\nDEFAULT_GROUP\t= 1,*,*,*,*;\n/MN\n1:UFRAME_NUM=1 ;\n2:UTOOL_NUM=1 ;\n".to_owned();
    statements.lines().enumerate().for_each(|(at, line)| text += &format!("{}:{line} ;\n", at + 3));
    text += "/POS\n";
    for (number, [x, y, z]) in (1..).zip([[10, 90, 30], [10, 20, 0], [80, 20, 0]]) {
        text += &format!(
            "P[{number}]{{ GP1: UF : 1, UT : 1, CONFIG : 'N U T, 0, 0, 0', X = {x}.000 mm, Y = {y}.000 mm, Z = {z}.000 mm, W = 180.000 deg, P = 0.000 deg, R = 0.000 deg }};\n"
        );
    }
    text += "/END\n";
    let program = tp::read(vec![Source::new("MAIN.ls", text)], Vec::new()).unwrap();
    let cell = Cell::read(&Source::new("cell.toml", cell)).unwrap();
    let rows = compensate(&program, &cell, &Options::default()).unwrap().rows;
    let is_moved = |correction: [f64; 3]| correction.iter().any(|part| part.abs() > 0.01);
    let said = |row: &deflex_correct::Row| match row.status {
        Status::Kept(why) => why.text().to_owned(),
        _ if is_moved(row.correction_mm) => "corrected".to_owned(),
        _ => "as it was".to_owned(),
    };
    rows.iter().skip(1).map(said).collect()
}

const CUT: &str = "L P[2] 30mm/sec FINE\nL P[3] 30mm/sec FINE";

#[test]
fn a_cut_below_an_approach_is_corrected() {
    let [shifted, register] = ["moved by a position register (Tool_Offset)", "motion to a position register (PR)"];
    for (approach, why) in [
        ("L P[2] 400mm/sec FINE Tool_Offset,PR[1]", shifted),
        ("J P[2] 20% FINE Tool_Offset,PR[1]", shifted),
        ("! deflex air\nL P[2] 30mm/sec FINE Tool_Offset,PR[1]\n! deflex cut", shifted),
        ("PR[1]=P[2]\nPR[1,3]=PR[1,3]+50\nL PR[1] 400mm/sec FINE", register),
    ] {
        let statements = format!("J P[1] 20% FINE\n{approach}\n{CUT}");
        assert_eq!(rows(&statements, CELL), [why, "corrected", "corrected"], "{approach}");
    }
}

#[test]
fn a_cut_stays_below_a_motion_that_cuts_or_may_cut() {
    let approach = "J P[1] 20% FINE\nL P[2] 400mm/sec FINE Tool_Offset,PR[1]";
    let stays = |statements: &str, cell: &str| {
        rows(statements, cell)[1] == "also the position of a motion that is moved at run time"
    };
    assert!(stays(&format!("{}\n{CUT}", approach.replace("400mm", "40mm")), CELL));
    assert!(stays(&format!("{approach}\n{CUT}"), &CELL.replace("max_cutting_feed_mm_s = 100.0\n", "")));
    // Whether it cuts is not known without its speed.
    assert!(stays(&format!("{}\n{CUT}", approach.replace("400mm/sec", "2.0sec")), CELL));
}

#[test]
fn passes_in_several_depths_are_corrected_where_they_agree() {
    let set: String = (1..=6).map(|element| format!("PR[1,{element}]=0\n")).collect();
    let passes = |step: &str| {
        let motions = "J P[1] 20% FINE\nL P[2] 30mm/sec FINE Offset,PR[1]\nL P[3] 30mm/sec FINE Offset,PR[1]";
        rows(&format!("{set}FOR R[1]=1 TO 2\nPR[1,3]=PR[1,3]-{step}\n{motions}\nENDFOR"), CELL)
    };
    assert_eq!(passes(".001"), ["corrected", "corrected", "as it was", "corrected", "corrected"]);
    let differ = "numbers used by motions whose corrections differ";
    assert_eq!(passes("50"), [differ, differ, "as it was", differ, differ]);
}
