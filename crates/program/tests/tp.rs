//! Reads small TP programs and checks which positions are edited, in which cells.

#![allow(clippy::unwrap_used)] // in helpers too, a failure is a failed test

use deflex_program::tp::read;
use deflex_program::{Change, Goal, Program, Reason, RewriteOptions};
use deflex_text::{Source, applied};

/// A program with statements, a line each, and positions 1 to 4, whose X is 100 times the number.
fn text(name: &str, statements: &str) -> String {
    let mut text =
        format!("/PROG  {name}\n/ATTR\nDEFAULT_GROUP\t= 1,*,*,*,*;\n/MN\n   1:UFRAME_NUM=1 ;\n   2:UTOOL_NUM=1 ;\n");
    statements.lines().enumerate().for_each(|(at, line)| text += &format!("{:4}:{line} ;\n", at + 3));
    text += "/POS\n";
    for number in 1..=4 {
        text += &format!(
            "P[{number}]{{\n   GP1:\n\tUF : 1, UT : 1,\tCONFIG : 'N U T, 0, 0, 0',\n\tX = {number}00.000 mm,\tY = 20.000 mm,\tZ = 0.000 mm,\n\tW = 180.000 deg,\tP = 0.000 deg,\tR = 0.000 deg\n}};\n"
        );
    }
    text + "/END\n"
}

fn program_of(statements: &str, given: &[(&str, &str)]) -> Program {
    let given = given.iter().map(|(name, statements)| Source::new(*name, text(name, statements))).collect();
    read(vec![Source::new("MAIN", text("MAIN", statements))], given).unwrap()
}

/// Whether a motion is marked, is a joint motion, or is faster than cuts are.
fn is_air(program: &Program, at: usize) -> bool {
    let target = &program.targets[at];
    target.motion == deflex_program::Motion::Joint || target.feed_mm_s.is_some_and(|feed| feed > 100.0)
}

/// The numbers of the positions that change if each motion that cuts needs to be 0.5 mm higher.
fn edited(program: &Program) -> Vec<u32> {
    let air: Vec<bool> = (0..program.targets.len()).map(|at| is_air(program, at)).collect();
    let change = |at: usize| match program.targets[at].goal {
        Goal::Pose { position_mm: [x, y, z], .. } if !air[at] && program.targets[at].located => {
            Some(Change { position_mm: [x, y, z + 0.5], quat: None, conf: None, external: None })
        }
        _ => None,
    };
    let changes: Vec<_> = (0..program.targets.len()).map(change).collect();
    let rewritten = program.rewrite(&changes, &[], &RewriteOptions { air: &air, ..RewriteOptions::default() });
    let text = String::from_utf8(applied(&program.sources[0].bytes, &rewritten.edits[0])).unwrap();
    let positions = text.split("\nP[").skip(1);
    positions.filter(|position| position.contains("Z = 0.500")).map(|p| p[..1].parse().unwrap()).collect()
}

fn edits(statements: &str) -> Vec<u32> {
    edited(&program_of(statements, &[]))
}

const CUT: &str = "L P[2] 30mm/sec FINE\nL P[3] 30mm/sec FINE";

#[test]
fn an_approach_by_a_register_goes_along() {
    for approach in [
        "L P[2] 400mm/sec FINE Tool_Offset,PR[1]",
        "L P[2] 400mm/sec FINE Offset,PR[1]",
        "J P[2] 20% FINE Tool_Offset,PR[1]",
        "J P[2] 20% CNT50 Offset,PR[R[1]]",
        "L P[2] 400mm/sec FINE Tool_Offset,PR[2] Offset,PR[1]",
        "FOR R[1]=1 TO 2\nL P[2] 400mm/sec FINE Offset,PR[1]\nENDFOR",
    ] {
        assert_eq!(edits(&format!("{approach}\n{CUT}")), [2, 3], "{approach}");
        assert_eq!(edits(&format!("{CUT}\n{approach}")), [2, 3], "{approach}");
    }
}

#[test]
fn a_motion_that_is_moved_and_cuts_holds_its_position() {
    for other in [
        "L P[2] 30mm/sec FINE Offset,PR[1]",
        // Where it stops depends on the condition.
        "L P[2] 400mm/sec FINE Offset,PR[1] Skip,LBL[1]",
        "L P[2] 400mm/sec FINE INC Offset,PR[1]",
        "L P[2] 400mm/sec FINE Offset,PR[1] INC",
        "L P[2] 400mm/sec FINE Offset,PR[1] Frobnicate",
        "L P[2] 400mm/sec FINE VOFFSET,VR[1]",
        "C P[1] P[2] 400mm/sec FINE Offset,PR[1]",
        // An incremental motion counts from the end of the one before.
        "L P[2] 400mm/sec FINE Offset,PR[1]\nL P[4] 400mm/sec FINE INC",
        "A P[1] 400mm/sec FINE\nA P[2] 400mm/sec FINE Offset,PR[1]\nA P[4] 400mm/sec FINE",
    ] {
        let statements = format!("{CUT}\nLBL[1]\n{other}");
        let program = program_of(&statements, &[]);
        assert!(!edited(&program).contains(&2), "{other}");
        assert!(!program.kept.is_empty(), "{other}");
    }
    // A mark that is not known may be that of a cut.
    let marks = "IF (DI[1]=ON) THEN\n! deflex air\nELSE\n! deflex cut\nENDIF\nL P[2] 400mm/sec FINE Offset,PR[1]";
    assert_eq!(edits(&format!("{CUT}\n{marks}")), [3]);
}

#[test]
fn a_motion_that_cuts_and_one_that_is_moved_and_cuts_say_why_they_stay() {
    let program = program_of("L P[2] 30mm/sec FINE\nL P[2] 30mm/sec FINE Offset,PR[1]", &[]);
    let changed = |position_mm| Some(Change { position_mm, quat: None, conf: None, external: None });
    let rewritten = program.rewrite(&[changed([200.0, 20.0, 0.5]), None], &[], &RewriteOptions::default());
    assert!(rewritten.edits[0].is_empty());
    assert_eq!(rewritten.kept, [(0, Reason::MovedToo)]);
}

/// At the end of a motion that is moved, an axis may be on the other side of half a turn.
#[test]
fn turn_numbers_of_a_motion_that_is_moved_stay() {
    use deflex_program::{Conf, Config};
    let changes = |statements: &str| {
        let program = program_of(statements, &[]);
        let air: Vec<bool> = (0..program.targets.len()).map(|at| is_air(&program, at)).collect();
        let conf = Some(Conf::Turns(Config { posture: 0, turns: [0, 0, 1] }));
        let change = Change { position_mm: [200.0, 20.0, 0.5], quat: None, conf, external: None };
        let changes: Vec<_> = air.iter().map(|air| (!air).then(|| change.clone())).collect();
        let rewritten = program.rewrite(&changes, &[], &RewriteOptions { air: &air, ..RewriteOptions::default() });
        (!rewritten.edits[0].is_empty(), rewritten.kept)
    };
    assert_eq!(changes("L P[2] 30mm/sec FINE"), (true, vec![]));
    let moved = "J P[2] 20% FINE Offset,PR[1]\nL P[2] 30mm/sec FINE";
    assert_eq!(changes(moved), (false, vec![(1, Reason::TurnsChange)]));
}
