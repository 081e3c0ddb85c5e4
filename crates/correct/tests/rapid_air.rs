//! RAPID in a cell: which cuts are corrected although a joint motion through air goes to the same numbers.

#![allow(clippy::unwrap_used)] // in helpers too, a failure is a failed test

use deflex_cell::Cell;
use deflex_correct::{Options, Status, compensate};
use deflex_program::rapid;
use deflex_text::Source;

const CELL: &str = r#"
[robot]
model = "irb6700-150-3.20"
[robot.stiffness]
joint_nm_per_rad = [1e6, 1e6, 1e6, 4e5, 3e5, 1e5]
[controller]
compensates = []
[cut]
force = "constant"
force_n = [100.0, 150.0, -200.0]
frame = "wobj"
[tools.tMill]
tcp_mm = [0.0, 0.0, 200.0]
tcp_quat = [1.0, 0.0, 0.0, 0.0]
mass_kg = 5.0
cog_mm = [0.0, 0.0, 100.0]
"#;
/// Axis 4 is at 0 where the tool is square to the base.
const VERTICAL: &str = "[0,0.0998334,0.9950042,0],[0,0,0,0]";
const TILTED: &str = "[0.0236762,0.4068988,0.8757795,0.2586174],[0,0,0,0]";

/// Whether each motion of a program with two targets of this orientation is corrected, goes along or is kept, and its text.
fn rows(orientation: &str, main: &str, more: &str) -> (Vec<String>, String) {
    let target =
        |name: &str, at: &str| format!("CONST robtarget {name}:=[[{at}],{orientation},[9E9,9E9,9E9,9E9,9E9,9E9]];\n");
    let [p1, p2] = if orientation.starts_with("[0,0.0998334") {
        ["1500,300,800", "1600,300,800"]
    } else {
        ["2202.801,938.562,1013.716", "2112.617,1126.977,1013.716"]
    };
    let text = format!(
        "MODULE m\nCONST confdata cHome:=[0,0,0,0];\n{}{}PROC main()\n{main}ENDPROC\n{more}ENDMODULE\n",
        target("p1", p1),
        target("p2", p2)
    );
    let program = rapid::read(vec![Source::new("m.mod", text)], Vec::new()).unwrap();
    let cell = Cell::read(&Source::new("cell.toml", CELL)).unwrap();
    let done = compensate(&program, &cell, &Options::default()).unwrap();
    let said = |row: &deflex_correct::Row| match row.status {
        Status::Kept(why) => why.text().to_owned(),
        _ if row.goes_along => "along".to_owned(),
        _ => "corrected".to_owned(),
    };
    let text = program.edited(&done.rewritten.unwrap().edits).remove(0);
    (done.rows.iter().map(said).collect(), String::from_utf8(text.bytes.to_vec()).unwrap())
}

/// The correction turns axis 4 through zero: the arm does not change its posture, and the text gets the configuration that the arm has.
#[test]
fn a_joint_motion_goes_along_into_the_configuration_that_the_cut_needs() {
    let cut = "MoveL p2,v10,fine,tMill;\nMoveL p1,v10,fine,tMill;\n";
    for first in ["MoveJ p1,v500,fine,tMill;\n", "MoveJ Offs(p1,0,0,100),v500,fine,tMill;\n"] {
        let (rows, text) = rows(VERTICAL, &format!("{first}{cut}"), "");
        assert_eq!(rows, ["along", "corrected", "corrected"], "{text}");
        assert!(text.contains("],[0,-1,0,0],["), "{text}");
    }
    // There, axis 4 is on the other side of zero: by the new configuration, the arm would turn it by a whole turn.
    let turned = |rx: &str| {
        let first = format!("MoveJ RelTool(p1,0,0,-50\\Rx:={rx}),v500,fine,tMill;\n");
        rows(VERTICAL, &format!("{first}{cut}"), "").0
    };
    assert!(turned("5")[2] != "corrected" || turned("-5")[2] != "corrected");
}

#[test]
fn a_joint_motion_that_nothing_runs_goes_along() {
    let main = "MoveJ Offs(p1,0,0,100),v500,fine,tMill;\nMoveL p1,v100,fine,tMill;\nMoveL p2,v10,fine,tMill;\n";
    let path = "PROC Path_10()\nMoveJ p1,v100,fine,tMill;\nMoveJ p2,v100,fine,tMill;\nENDPROC\n";
    let said = rows(TILTED, main, path).0;
    assert_eq!(said[1..], ["corrected", "corrected"], "{said:?}");
    let (said, text) = rows(VERTICAL, main, path);
    assert_eq!(said[1..], ["corrected", "corrected"], "{said:?}");
    assert!(text.contains("],[0,-1,0,0],["), "{text}");
}

/// It goes to the text wherever the arm comes from, so that the text keeps the configuration that it needs.
#[test]
fn a_joint_motion_that_nothing_runs_holds_what_it_cannot_reach() {
    let main = "MoveL p1,v100,fine,tMill;\nMoveL p2,v10,fine,tMill;\n";
    let path = "PROC Path_10()\nMoveJ p1,v100,fine,tMill;\nENDPROC\n";
    let said = rows(VERTICAL, main, path).0;
    assert_eq!(said, ["corrected", "corrected"]);
    // The configuration has a name, which other data may use: its numbers stay.
    let orientation = VERTICAL.replace(",[0,0,0,0]", ",cHome");
    let said = rows(&orientation, main, path).0;
    assert_ne!(said[0], "corrected", "{said:?}");
}
