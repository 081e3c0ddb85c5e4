//! Where the way into a target begins, in every run: forces that follow it are known there, or the target stays.

use deflex::cell::Cell;
use deflex::correct::{Options, Status, compensate};
use deflex::program::Predecessor::{self, Previous, Start, Unknown};
use deflex::program::{Insert, Program, RewriteOptions, krl, rapid, tp};
use deflex::text::Source;

fn rapid_program(body: &str, more: &str) -> Program {
    let head = "MODULE M\nLOCAL PERS tooldata tCell:=[TRUE,[[0,0,180],[1,0,0,0]],[5,[0,0,60],[1,0,0,0],0,0,0]];\n\
                LOCAL CONST robtarget a:=[[0,0,0],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\n\
                LOCAL CONST robtarget b:=[[50,0,0],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\n\
                LOCAL CONST robtarget c:=[[50,50,0],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\n\
                LOCAL CONST robtarget d{1}:=[[[50,0,0],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]];\n\
                LOCAL VAR robtarget q;\nLOCAL VAR num n;\n";
    let body = body.replace('@', ",v50,fine,tCell\\WObj:=wCell;\n");
    let more = more.replace('@', ",v50,fine,tCell\\WObj:=wCell;\n");
    let text = format!("{head}PROC main()\n{body}ENDPROC\n{more}ENDMODULE\n");
    rapid::read(vec![Source::new("m.mod", text)], Vec::new()).unwrap()
}

fn predecessors(program: &Program) -> Vec<Predecessor> {
    program.targets.iter().map(|target| target.predecessor).collect()
}

#[test]
fn rapid_knows_where_each_way_begins() {
    let cases: [(&str, &str, &[Predecessor]); 16] = [
        ("MoveL a@MoveL b@MoveC c,a@", "", &[Start, Previous, Previous, Previous]),
        // A motion that is not known comes before.
        ("MoveL a@MoveL q@MoveL b@MoveL c@", "", &[Start, Unknown, Previous]),
        ("MoveL q@MoveL b@MoveL c@", "", &[Unknown, Previous]),
        // The second round begins where the first one ended.
        ("WHILE di1=1 DO\nMoveL b@MoveL c@ENDWHILE\n", "", &[Unknown, Previous]),
        ("MoveL a@IF di1=1 THEN\nMoveL b@ENDIF\nMoveL c@MoveL a@", "", &[Start, Previous, Unknown, Previous]),
        ("MoveL a@IF di1=1 THEN\nMoveL b@ELSE\nMoveL c@ENDIF\n", "", &[Start, Previous, Unknown]),
        ("MoveL a@IF di1=1 THEN\nn:=1;\nENDIF\nMoveL c@", "", &[Start, Previous]),
        ("MoveL a@WHILE di1=1 DO\nMoveL b@MoveL c@ENDWHILE\nMoveL a@", "", &[Start, Unknown, Previous, Unknown]),
        ("FOR i FROM 1 TO 2 DO\nMoveL b@MoveL c@ENDFOR\n", "", &[Start, Previous, Previous, Previous]),
        ("side;\nMoveL b@", "PROC side()\nMoveL a@ENDPROC\n", &[Start, Previous]),
        ("side;\nMoveL b@", "PROC side()\nMoveL a@IF di1=1 RETURN;\nMoveL c@ENDPROC\n", &[Start, Previous, Unknown]),
        ("MoveL a@n:=f();\nMoveL b@", "FUNC num f()\nMoveL c@RETURN 1;\nENDFUNC\n", &[Start, Unknown]),
        ("MoveL a@n:=f();\nMoveL b@", "FUNC num f()\nRETURN 1;\nENDFUNC\n", &[Start, Previous]),
        ("MoveL a@elsewhere;\nMoveL b@", "", &[Start, Unknown]),
        ("MoveL a@SearchL di1,q,b,v50,tCell;\nMoveL c@", "", &[Start, Previous, Unknown]),
        ("MoveL a@l:\nMoveL b@IF di1=1 GOTO l;\nMoveL c@", "", &[Start, Unknown, Previous]),
    ];
    for (body, more, expected) in cases {
        let program = rapid_program(body, more);
        assert_eq!(predecessors(&program), expected, "{body}{more}");
    }
}

#[test]
fn krl_and_tp_know_it_too() {
    let lin = |x: u32| format!("LIN {{X {x},Y 0,Z 0,A 0,B 90,C 0}}\n");
    let head = "DEF p()\nDECL INT n\n$BASE=$NULLFRAME\n$TOOL=$NULLFRAME\n$VEL.CP=0.05\n";
    let body = format!("{}IF $IN[1] THEN\n{}ELSE\n{}ENDIF\n{}{}", lin(1), lin(2), lin(3), lin(4), lin(5));
    let program = krl::read(vec![Source::new("p.src", format!("{head}{body}END\n"))], Vec::new()).unwrap();
    assert_eq!(predecessors(&program), [Start, Previous, Unknown, Unknown, Previous]);
    let body = format!("LOOP\n{}{}ENDLOOP\n", lin(1), lin(2));
    let program = krl::read(vec![Source::new("p.src", format!("{head}{body}END\n"))], Vec::new()).unwrap();
    assert_eq!(predecessors(&program), [Unknown, Previous]);

    let text = "/PROG P\n/ATTR\n/MN\n1:L P[1] 50mm/sec FINE ;\n2:IF DI[1]=ON,JMP LBL[1] ;\n3:L P[2] 50mm/sec FINE ;\n4:LBL[1] ;\n\
                5:L P[3] 50mm/sec FINE ;\n6:CALL X ;\n7:L P[1] 50mm/sec FINE ;\n/POS\n";
    let pose = |n: u32| {
        format!(
            "P[{n}]{{\nGP1:\nUF : 0, UT : 1, CONFIG : 'N U T, 0, 0, 0',\nX = {n}.0 mm, Y = 0.0 mm, Z = 0.0 mm,\n\
             W = 180.0 deg, P = 0.0 deg, R = 0.0 deg\n}};\n"
        )
    };
    let poses = format!("{}{}{}/END\n", pose(1), pose(2), pose(3));
    let read = |text: &str| tp::read(vec![Source::new("p.ls", format!("{text}{poses}"))], Vec::new()).unwrap();
    assert_eq!(predecessors(&read(text)), [Start, Previous, Unknown, Unknown]);
    let text =
        "/PROG P\n/ATTR\n/MN\n1:L PR[1] 50mm/sec FINE ;\n2:L P[1] 50mm/sec FINE ;\n3:L P[2] 50mm/sec FINE ;\n/POS\n";
    assert_eq!(predecessors(&read(text)), [Unknown, Previous]);
    // The program gives a position another value: nothing is known of where the motion goes.
    let text = "/PROG P\n/ATTR\n/MN\n1:L P[1] 50mm/sec FINE ;\n2:L P[2] 50mm/sec FINE ;\n3:L P[3] 50mm/sec FINE ;\n4:P[2]=LPOS ;\n/POS\n";
    let program = read(text);
    assert_eq!((predecessors(&program), program.unknown.len()), (vec![Start, Unknown], 1));
    // The points of `A` motions follow one another.
    let text =
        "/PROG P\n/ATTR\n/MN\n1:A P[1] 50mm/sec FINE ;\n2:A P[2] 50mm/sec FINE ;\n3:A P[3] 50mm/sec FINE ;\n/POS\n";
    assert_eq!(predecessors(&read(text)), [Start, Previous, Previous, Previous, Previous]);
}

/// A force that follows the feed is not known where the way in is not; one in axes of the work object is.
#[test]
fn a_target_of_unknown_way_stays_where_the_force_follows_it() {
    use crate::second_reading::compare::CELL;
    let program = rapid_program("MoveL a@IF di1=1 THEN\nMoveL b@ENDIF\nMoveL c@MoveL a@", "");
    let kept = |frame: &str| {
        let text = CELL.replace("frame = \"wobj\"", frame).replace("[tools.tCell]", "[tools.tUnused]");
        let cell = Cell::read(&Source::new("cell.toml", text)).unwrap();
        let rows = compensate(&program, &cell, &Options::default()).unwrap().rows;
        rows.iter().map(|row| matches!(row.status, Status::Kept(_))).collect::<Vec<_>>()
    };
    assert_eq!(kept("frame = \"wobj\""), [true, true, true, true].map(|_| false));
    let with_feed = kept("frame = \"feed\"");
    assert!(with_feed[2], "{with_feed:?}");
}

/// Why a point can be inserted before no motion, or only before some: between the motions of the text lies the path of only one run.
#[test]
fn nothing_is_inserted_on_a_path_that_some_runs_do_not_take() {
    const START: Option<&str> = Some("the path to it begins at a point that is known only at run time");
    const AGAIN: Option<&str> = Some("the motion runs more than once, and so would an inserted point");
    const COMPACT: Option<&str> = Some("the condition before it is for one instruction");
    const PROCESS: Option<&str> = Some("motion during which the controller does more than move");
    let cases: [(&str, &[Option<&str>]); 9] = [
        ("MoveL a@MoveL b@MoveC c,a@", &[START, None, None]),
        ("MoveL a@WHILE di1=0 DO\nMoveL b@MoveL c@ENDWHILE\nMoveL a@", &[START, START, None, START]),
        ("MoveL a@IF di1=1 THEN\nMoveL b@ENDIF\nMoveL c@MoveL a@", &[START, None, START, None]),
        ("MoveL a@IF di1=1\nMoveL b@MoveL c@", &[START, COMPACT, START]),
        ("MoveL a@FOR i FROM 1 TO 2 DO\nMoveL b@MoveL c@ENDFOR\n", &[START, AGAIN, AGAIN, AGAIN, AGAIN]),
        // The second round ends with an error: there is no second element.
        ("MoveL a@FOR i FROM 1 TO 2 DO\nMoveL d{i}@ENDFOR\n", &[START, AGAIN]),
        ("MoveL a@TriggL b,v50,t1,fine,tCell\\WObj:=wCell;\nMoveL c@", &[START, PROCESS, None]),
        ("MoveL a@ArcL b,v50,s1,w1,fine,tCell\\WObj:=wCell;\nMoveL c@", &[START, PROCESS, None]),
        ("MoveL a@MoveLDO b,v50,fine,tCell\\WObj:=wCell,do1,1;\nMoveL c@", &[START, None, None]),
    ];
    for (body, expected) in cases {
        let program = rapid_program(body, "");
        let ends: Vec<usize> = (0..program.targets.len()).filter(|i| program.targets[*i].is_end()).collect();
        let refused = program.insertions_refused(&ends);
        assert_eq!(refused.iter().map(|why| why.map(|why| why.text())).collect::<Vec<_>>(), expected, "{body}");
    }
}

#[test]
fn an_inserted_motion_passes_on_whether_there_is_an_argument() {
    let text = "MODULE M\nPROC main()\ncut;\nENDPROC\nPROC cut(\\PERS wobjdata w \\num s)\n\
                MoveL [[0,0,0],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v50,fine,tCell\\WObj?w;\n\
                MoveL [[99,0,0],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v50 \\V?s,fine,tCell \\WObj ? w;\nENDPROC\nENDMODULE\n";
    let program = rapid::read(vec![Source::new("m.mod", text)], Vec::new()).unwrap();
    let insert = Insert::line(1, ([50.0, 0.0, 0.5], [0.0, 1.0, 0.0, 0.0]), 9.0);
    let rewritten = program.rewrite(&[None, None], &[insert], &RewriteOptions::default());
    assert_eq!(rewritten.not_inserted, []);
    let inserted = String::from_utf8(rewritten.edits[0][0].content.to_vec()).unwrap();
    assert!(inserted.contains("],v50\\V?s,z1,tCell\\WObj?w;"), "{inserted}");
}

/// The circle point of an arc moves to the middle of its last part only if the arc is divided.
#[test]
fn the_circle_point_stays_where_the_arc_is_not_divided() {
    use crate::second_reading::compare::CELL;
    let cell = Cell::read(&Source::new("cell.toml", CELL)).unwrap();
    let options = Options { subdivide: Some(1e-5), ..Options::default() };
    let arc = "MoveC [[150,150,0],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],[[300,0,0],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],";
    let moved = |body: &str| {
        let program = rapid_program(body, "");
        let corrected = compensate(&program, &cell, &options).unwrap();
        assert!(corrected.failures.is_empty(), "{:?}", corrected.failures);
        let rewritten = corrected.rewritten.unwrap();
        (rewritten.inserted.iter().flatten().count(), rewritten.written[1].0[0] - 150.0)
    };
    let (count, by) = moved(&format!("MoveL a@{arc}v50,fine,tCell\\WObj:=wCell;\n"));
    assert!(count > 0 && by.abs() > 50.0, "{count} {by}");
    // The arc has a time of its own.
    let (count, by) = moved(&format!("MoveL a@{arc}v50\\T:=4,fine,tCell\\WObj:=wCell;\n"));
    assert!(count == 0 && by.abs() < 5.0, "{count} {by}");
}
