//! What is assumed of a program where it says otherwise, or nothing, is told.

use crate::second_reading::compare::CELL;
use deflex::cell::Cell;
use deflex::correct::{Options, compensate};
use deflex::program::rapid;
use deflex::text::Source;

const WEIGHT: &str = "[[effect]]\nkind = \"gravity\"\ntool = true\n";
const AT: &str = ",[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v50,fine,tCell\\WObj:=wCell;\n";

/// Codes of what is said of a procedure of these lines.
fn said(body: &str, cell: &str) -> Vec<&'static str> {
    let text = format!(
        "MODULE M\nPERS loaddata spindle:=[9,[0,0,90],[1,0,0,0],0,0,0];\nPROC main()\n{body}ENDPROC\nENDMODULE\n"
    );
    let program = rapid::read(vec![Source::new("m.mod", text.replace(" @", AT))], Vec::new()).unwrap();
    let cell = Cell::read(&Source::new("cell.toml", cell)).unwrap();
    compensate(&program, &cell, &Options::default()).unwrap().notes.iter().map(|told| told.code).collect()
}

#[test]
fn a_load_that_gravity_does_not_act_on_is_told_where_there_is_any() {
    let heavy = CELL.replace("[cut]", &format!("{WEIGHT}[cut]"));
    let grips = "GripLoad spindle;\nMoveL [[0,0,0] @MoveL [[50,0,0] @";
    assert!(said(grips, &heavy).contains(&"rapid.load"));
    assert!(!said(grips, CELL).contains(&"rapid.load"), "nothing weighs");
    assert!(!said(&grips.replace("spindle", "load0"), &heavy).contains(&"rapid.load"));
    let own =
        grips.replace("GripLoad spindle;\n", "").replace(" @", AT).replacen("=wCell;", "=wCell\\TLoad:=spindle;", 1);
    assert!(said(&own, &heavy).contains(&"rapid.load"));
    let in_a_branch = grips.replace("GripLoad spindle;", "IF TestDI(di1) THEN\nGripLoad spindle;\nENDIF");
    assert!(said(&in_a_branch, &heavy).contains(&"rapid.load"), "in some runs");
    let ended = grips.replace("GripLoad spindle;", "GripLoad spindle;\nGripLoad load0;");
    assert!(!said(&ended, &heavy).contains(&"rapid.load"));
}

#[test]
fn a_plunge_is_told_where_the_force_follows_the_feed() {
    let feed = CELL.replace("frame = \"wobj\"", "frame = \"feed\"");
    let plunges = "MoveL [[0,0,50] @MoveL [[0,0,0] @MoveL [[50,0,0] @";
    assert_eq!(said(plunges, &feed).iter().filter(|code| **code == "cut.plunge").count(), 1);
    assert!(!said(plunges, CELL).contains(&"cut.plunge"), "the force is that of the cell, whatever the feed");
    let marked = plunges.replacen("MoveL [[0,0,0]", "! deflex air\nMoveL [[0,0,0]", 1);
    assert!(!said(&marked, &feed).contains(&"cut.plunge"));
    let level = "MoveL [[0,0,0] @MoveL [[50,0,0] @";
    assert!(!said(level, &feed).contains(&"cut.plunge"));
}
