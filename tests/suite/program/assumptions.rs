//! deflex reports what it assumes of a program that contradicts the assumption or says nothing about it.

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
    compensate(&program, &cell, &Options::default()).unwrap().notes.iter().map(|note| note.code).collect()
}

#[test]
fn a_load_that_gravity_does_not_act_on_is_reported_where_there_is_any() {
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
fn a_plunge_is_reported_where_the_force_follows_the_feed() {
    let feed = CELL.replace("frame = \"wobj\"", "frame = \"feed\"");
    let plunges = "MoveL [[0,0,50] @MoveL [[0,0,0] @MoveL [[50,0,0] @";
    assert_eq!(said(plunges, &feed).iter().filter(|code| **code == "cut.plunge").count(), 1);
    assert!(!said(plunges, CELL).contains(&"cut.plunge"), "the force is that of the cell, whatever the feed");
    let marked = plunges.replacen("MoveL [[0,0,0]", "! deflex air\nMoveL [[0,0,0]", 1);
    assert!(!said(&marked, &feed).contains(&"cut.plunge"));
    let level = "MoveL [[0,0,0] @MoveL [[50,0,0] @";
    assert!(!said(level, &feed).contains(&"cut.plunge"));
}

#[test]
fn what_the_next_cycle_finds_otherwise_is_reported() {
    let frame = "PERS wobjdata wOwn:=[FALSE,TRUE,\"\",[[900,0,500],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\n";
    let said = |body: &str| {
        let text = format!("MODULE M\n{frame}PROC main()\n{body}ENDPROC\nENDMODULE\n").replace(" @", AT);
        let program = rapid::read(vec![Source::new("m.mod", text.replace("=wCell", "=wOwn"))], Vec::new()).unwrap();
        program.diagnostics.iter().filter(|note| note.code == "rapid.next-cycle").count()
    };
    let (moves, shifts, on, off) =
        ("MoveL [[0,0,0] @", "wOwn.oframe.trans.z:=2;\n", "PDispSet [[0,0,5],[1,0,0,0]];\n", "PDispOff;\n");
    assert_eq!(said(&[moves, moves].concat()), 0);
    assert_eq!(said(&[moves, shifts, moves].concat()), 1, "the first motion is elsewhere in the next cycle");
    assert_eq!(said(&[shifts, moves].concat()), 0, "what every cycle sets first");
    assert_eq!(said(&["wOwn.oframe.trans.z:=0;\n", moves, shifts, moves].concat()), 0);
    let back = "wOwn.oframe.trans.z:=0;\n";
    assert_eq!(said(&[moves, shifts, moves, back].concat()), 0, "what is set back");
    assert_eq!(said(&[moves, "IF TestDI(di1) THEN\n", shifts, "ENDIF\n"].concat()), 1, "in some runs");
    assert_eq!(said(&[moves, on, moves].concat()), 1);
    assert_eq!(said(&[on, moves].concat()), 0);
    assert_eq!(said(&[moves, on, moves, off].concat()), 0);
    for lasting in [
        "EOffsSet [10,0,0,0,0,0];\n",
        "SoftAct 1,50;\n",
        "VelSet 40,5000;\n",
        "CirPathMode\\ObjectFrame;\n",
        "ConfJ\\Off;\n",
        "DeactUnit STN1;\n",
    ] {
        assert_eq!(said(&[moves, lasting].concat()), 1, "{lasting}");
        assert_eq!(said(&[lasting, moves].concat()), 0, "{lasting}");
    }
}

#[test]
fn a_trap_that_moves_is_reported() {
    let said = |trap: &str| {
        let text = format!(
            "MODULE M\nVAR intnum alarm;\nPROC main()\nCONNECT alarm WITH tStop;\nMoveL [[0,0,0] @MoveL [[50,0,0] @ENDPROC\n\
             TRAP tStop\n{trap}ENDTRAP\nPROC away()\nMoveL [[0,0,90] @ENDPROC\nENDMODULE\n"
        );
        let program = rapid::read(vec![Source::new("m.mod", text.replace(" @", AT))], Vec::new()).unwrap();
        program.diagnostics.iter().filter(|note| note.code == "rapid.trap-moves").count()
    };
    assert_eq!(said("StopMove;\nTPWrite \"stop\";\nStartMove;\n"), 0);
    assert_eq!(said("StopMove;\nStorePath;\nMoveL [[0,0,90] @RestoPath;\nStartMove;\n"), 1);
    assert_eq!(said("IF TestDI(di1) THEN\naway;\nENDIF\n"), 1, "what it calls moves");
}
