//! RAPID text in, targets and edits out.

#![allow(clippy::float_cmp)] // the very numbers that were written

use deflex_program::rapid::read;
use deflex_program::{Change, Editable, Goal, Insert, Mark, Program, Reason, RewriteOptions, round_trip};
use deflex_text::{Source, applied};

fn program(text: &str) -> Program {
    read(vec![Source::new("t.mod", text)], Vec::new()).unwrap_or_else(|e| panic!("{e:?}"))
}

fn positions(program: &Program) -> Vec<[f64; 3]> {
    program
        .targets
        .iter()
        .filter_map(|t| if let Goal::Pose { position_mm, .. } = t.goal { Some(position_mm) } else { None })
        .collect()
}

fn rewritten(program: &Program, changes: &[Option<Change>], inserts: &[Insert], options: &RewriteOptions) -> String {
    let rewritten = program.rewrite(changes, inserts, options);
    let out = applied(&program.sources[0].bytes, &rewritten.edits[0]);
    String::from_utf8_lossy(&out).into_owned()
}

/// A module around `body`, with three declared targets.
fn module(body: &str) -> String {
    format!(
        "MODULE M\n  CONST robtarget p1:=[[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\n  \
         CONST robtarget p2:=[[10.5,20,30],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\n  \
         PROC main()\n{body}\n  ENDPROC\nENDMODULE\n"
    )
}

fn holds(program: &Program) {
    let trip = round_trip(program, read);
    assert!(trip.holds(), "{:?}", trip.why);
}

#[test]
fn offsets_follow_their_base() {
    let p = program(&module("MoveL Offs(p1,0,0,50),v100,fine,tool0;\nMoveL p1,v100,fine,tool0;"));
    assert_eq!(positions(&p), [[1.0, 2.0, 53.0], [1.0, 2.0, 3.0]]);
    assert_eq!(p.targets[0].editable, Editable::Position);
    holds(&p);
    let change = |x| Some(Change { position_mm: x, quat: None, conf: None, external: None });
    let text = rewritten(&p, &[change([1.1, 2.0, 53.0]), change([1.0, 2.25, 3.0])], &[], &RewriteOptions::default());
    assert!(text.contains("Offs(p1,0.1000,-0.2500,50)"), "{text}");
    assert!(text.contains("p1:=[[1,2.2500,3]"), "{text}");
}

/// What a motion of an unknown force shares with one that is corrected.
#[test]
fn offsets_without_a_correction_are_held_in_place() {
    for offset in ["Offs(p1,0,50,-30)", "RelTool(p1,0,50,-30)"] {
        let p = program(&module(&format!("MoveL {offset},v20,fine,tool0;\nMoveL p1,v20,fine,tool0;")));
        let changes = [None, Some(Change { position_mm: [1.5, 2.0, 3.0], quat: None, conf: None, external: None })];
        let written = p.rewrite(&changes, &[], &RewriteOptions::default()).written;
        let off = (0..3).map(|k| (written[0].0[k] - positions(&p)[0][k]).abs()).fold(0.0, f64::max);
        assert!(off < 1e-4, "{offset}: {off}");
        let text = rewritten(&p, &changes, &[], &RewriteOptions::default());
        assert!(text.contains("(p1,-0.5000,50,-30)") && text.contains("p1:=[[1.5000,2,3]"), "{text}");
    }
}

/// The base of `Offs` is shifted, if all its motions need the same.
#[test]
fn cuts_at_a_computed_offset_are_corrected_by_their_base() {
    let above = "n:=5;\nMoveL Offs(p1,0,n,0),v20,fine,tool0;\n";
    let two = format!("{above}MoveL p1,v20,fine,tool0;\n");
    for main in [above, &two, "FOR i FROM 1 TO 3 DO\nMoveL Offs(p1,i*10,0,0),v20,fine,tool0;\nENDFOR\n"] {
        assert!(moved(&with_copies(main, "")).contains(P1_MOVED), "{main}");
    }
    let p = program(&with_copies(&two, ""));
    let shift = |i: usize, by: f64| {
        let [x, y, z] = positions(&p)[i];
        Some(Change { position_mm: [x + by, y, z], quat: None, conf: None, external: None })
    };
    let same = p.rewrite(&[shift(0, 0.25), shift(1, 0.2509)], &[], &RewriteOptions::default());
    assert!((same.kept.is_empty(), rewritten_text(&p, &same.edits[0]).contains(P1_MOVED)) == (true, true));
    let other = p.rewrite(&[shift(0, 0.25), shift(1, 0.2511)], &[], &RewriteOptions::default());
    assert_eq!(other.kept, [(0, Reason::SharedTarget), (1, Reason::SharedTarget)]);
    assert!(other.edits[0].is_empty());
    // An arc, tool axes, and another place in a routine that nothing calls.
    for main in [above.replace("MoveL Offs", "MoveC p2,Offs"), above.replace("Offs", "RelTool")] {
        assert!(!moved(&with_copies(&main, "")).contains(P1_MOVED), "{main}");
    }
    assert!(!moved(&with_copies(above, "PROC service()\nMoveL p1,v20,fine,tool0;\nENDPROC\n")).contains(P1_MOVED));
}

#[test]
fn loops_with_known_bounds_run() {
    let p = program(&module("FOR i FROM 1 TO 3 DO\nMoveL Offs(p1,i*10,0,0),v100,fine,tool0;\nENDFOR"));
    assert_eq!(positions(&p), [[11.0, 2.0, 3.0], [21.0, 2.0, 3.0], [31.0, 2.0, 3.0]]);
    holds(&p);
}

#[test]
fn a_missing_semicolon_takes_no_neighbour() {
    let p = program(&module("MoveL p1,v100,fine,tool0\nMoveL p2,v100,fine,tool0;\nMoveL p1,v100,fine,tool0;"));
    assert_eq!(p.targets.len(), 2);
    assert_eq!((p.kept.len(), p.kept[0].reason, p.kept[0].line), (1, Reason::NoSemicolon, 5));
    holds(&p);
}

#[test]
fn shared_targets_are_cloned_where_allowed() {
    let p = program(&module("MoveL p1,v100,fine,tool0;\nMoveL p1,v50,fine,tool0;"));
    let change = |x| Some(Change { position_mm: [x, 2.0, 3.0], quat: None, conf: None, external: None });
    let changes = [change(1.25), change(1.5)];
    let refused = p.rewrite(&changes, &[], &RewriteOptions::default());
    assert!(refused.edits[0].is_empty());
    assert_eq!(refused.kept.len(), 2);
    let options = RewriteOptions { allow_clones: true, ..RewriteOptions::default() };
    let again = program(&rewritten(&p, &changes, &[], &options));
    assert_eq!(positions(&again), [[1.25, 2.0, 3.0], [1.5, 2.0, 3.0]]);
    assert!((p.rewrite(&changes, &[], &options).written[1].0[0] - 1.5).abs() < 1e-9);
}

#[test]
fn inserted_points_keep_layout_and_the_last_zone() {
    let p = program(&module("    MoveL p1,v100,fine,tool0;\r\n    MoveL p2,v100\\V:=33,fine,tool0\\WObj:=wobj0;\r"));
    let insert = Insert::line(1, ([5.0, 6.0, 7.0], [1.0, 0.0, 0.0, 0.0]), 3.0);
    let text = rewritten(&p, &[None, None], &[insert], &RewriteOptions::default());
    let line = "\r\n    MoveL [[5.0000,6.0000,7.0000],[1.00000000,0.00000000,0.00000000,0.00000000],[0,0,0,0],\
                [9E9,9E9,9E9,9E9,9E9,9E9]],v100\\V:=33,z1,tool0\\WObj:=wobj0;\r\n    MoveL p2,v100\\V:=33,fine";
    assert!(text.contains(line), "{text}");
    assert_eq!(program(&text).targets.len(), 3);
}

#[test]
fn marks_hold_in_running_order() {
    let p = program(&module("! deflex air\nMoveL p1,v100,fine,tool0;\n! deflex cut\nMoveL p2,v100,fine,tool0;"));
    assert_eq!([p.targets[0].mark, p.targets[1].mark], [Some(Mark::Air), Some(Mark::Cut)]);
}

#[test]
fn targets_changed_by_known_numbers_depend_on_their_base() {
    let p = program(
        "MODULE M\nVAR robtarget p;\nCONST robtarget q:=[[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\nPROC main()\np:=q;\n\
         MoveL p,v100,fine,tool0;\np.trans.z:=p.trans.z+5;\nMoveL p,v100,fine,tool0;\nENDPROC\nENDMODULE",
    );
    assert_eq!(positions(&p), [[1.0, 2.0, 3.0], [1.0, 2.0, 8.0]]);
    let editable: Vec<Editable> = p.targets.iter().map(|target| target.editable).collect();
    assert_eq!(editable, [Editable::Pose; 2]);
    holds(&p);
}

#[test]
fn one_procedure_runs_under_several_tools() {
    let p = program(
        "MODULE M\nPERS tooldata tA:=[TRUE,[[0,0,100],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\n\
         PROC main()\nPath tA,wobj0;\nPath tB,wobj0;\nENDPROC\n\
         PROC Path(PERS tooldata t,PERS wobjdata w)\n\
         MoveL [[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,t\\WObj:=w;\nENDPROC\nENDMODULE",
    );
    let tools: Vec<_> = p.tools.iter().map(|t| (&*t.name, t.data.map(|d| d.tcp_mm[2]))).collect();
    assert_eq!(tools, [("tA", Some(100.0)), ("tB", None)]);
    assert_eq!(p.wobjs.len(), 1);
    holds(&p);
}

#[test]
fn zones_are_those_of_their_declarations() {
    use deflex_program::Passing;
    let motion = |zone: &str| format!("MoveL p1,v100,{zone},tool0;");
    let passing = |body: &str, zone: &str| program(&module(&format!("{body}\n{}", motion(zone)))).passing(0);
    assert_eq!(passing("", "z10"), Passing::Zone(10.0));
    assert_eq!(passing("", "[FALSE,25,40,40,4,40,4]"), Passing::Zone(25.0));
    assert_eq!(passing("", "fine"), Passing::Stop);
    // The optional argument replaces the zone.
    assert_eq!(passing("", "z10\\Z:=2"), Passing::Zone(2.0));
    assert_eq!(passing("", "z10\\Z:=nZone"), Passing::Unstated);
    assert_eq!(passing("", "z10\\Inpos:=inpos50"), Passing::Stop);
    // A name is that of its declaration, also if it looks like a predefined one.
    assert_eq!(passing("CONST zonedata z3:=[FALSE,30,40,40,4,40,4];", "z3"), Passing::Zone(30.0));
    assert_eq!(passing("! CONST zonedata z3:=[FALSE,30,40,40,4,40,4];", "z3"), Passing::Unstated);
    assert_eq!(passing("VAR zonedata zM:=[FALSE,30,40,40,4,40,4];", "zM"), Passing::Unstated);
    let parameter = module("mv z50;\n  ENDPROC\n  PROC mv(zonedata z1)\nMoveL p1,v100,z1,tool0;");
    assert_eq!(program(&parameter).passing(0), Passing::Unstated);
}

#[test]
fn motions_that_a_sensor_shifts_are_kept() {
    for motion in [
        "MoveL p1\\ID:=5,v100,z1,tool0\\Corr;",
        "EGMMoveL eg,p1,v100,z1,tool0;",
        "ArcL p1,v100,sm1,wd1,wv1,z1,tool0\\Track:=tr1;",
        "FCPressL p1,v100,50,z1,tool0;",
    ] {
        let p = program(&module(&format!("{motion}\nMoveL p2,v100,fine,tool0;")));
        let reasons: Vec<Reason> = p.kept.iter().map(|kept| kept.reason).collect();
        assert!(reasons.contains(&Reason::PathShifted), "{motion}: {reasons:?}");
        assert_eq!(p.targets.last().unwrap().editable, Editable::Pose, "{motion}");
    }
}

/// ABB's table of priorities has `NOT` below `AND`; a program may have been written with the other order in mind.
#[test]
fn not_before_and_has_no_known_value() {
    let flags = "CONST bool bA:=TRUE;\nCONST bool bB:=FALSE;\n";
    let moves = |condition: &str| {
        let body =
            format!("{flags}IF {condition} THEN\nMoveL p1,v100,fine,tool0;\nELSE\nMoveL p2,v100,fine,tool0;\nENDIF");
        positions(&program(&module(&body)))
    };
    let [one, two] = [[1.0, 2.0, 3.0], [10.5, 20.0, 30.0]];
    assert_eq!(moves("NOT bA AND bB"), [one, two]);
    assert_eq!(moves("(NOT bA) AND bB"), [two]);
    assert_eq!(moves("NOT (bA AND bB)"), [one]);
    assert_eq!(moves("NOT bA OR bB"), [two]);
    assert_eq!(moves("bA AND NOT bB"), [one]);
}

/// The codes of the messages about a program of two procedures.
fn next_cycle_notes(main: &str, more: &str) -> usize {
    let text = format!("{}\n", module(main)).replace("ENDMODULE", &format!("{more}\nENDMODULE"));
    program(&text).diagnostics.iter().filter(|note| note.code == "rapid.next-cycle").count()
}

#[test]
fn the_next_cycle_begins_with_what_any_end_of_the_cycle_left() {
    let moves = "MoveL p1,v100,fine,tool0;\nMoveL p2,v100,fine,tool0;\n";
    let set = "PDispSet [[0,0,50],[1,0,0,0]];\n";
    let notes = |main: String| next_cycle_notes(&main, "");
    assert_eq!(notes(format!("{moves}{set}IF DInput(di)=1 ExitCycle;\nPDispOff;")), 1);
    assert_eq!(notes(format!("{moves}{set}IF DInput(di)=1 THEN PDispOff; ExitCycle; ENDIF\nPDispOff;")), 0);
    // Only one of the paths to the first motion switches the displacement off.
    assert_eq!(notes(format!("IF DInput(di)=1 PDispOff;\n{moves}{set}")), 1);
    assert_eq!(notes(format!("PDispOff;\n{moves}{set}")), 0);
    // A trap may end the cycle at any moment.
    let trap = "TRAP t\nExitCycle;\nENDTRAP";
    assert_eq!(next_cycle_notes(&format!("{moves}{set}{moves}PDispOff;"), trap), 1);
    assert_eq!(next_cycle_notes(&format!("{moves}{set}{moves}PDispOff;"), ""), 0);
}

/// The cycle may end in a called routine, a function or a handler, and a trap may end it at any moment.
#[test]
fn every_end_of_the_cycle_may_leave_another_frame() {
    let wobj = "PERS wobjdata w:=[FALSE,TRUE,\"\",[[1,2,3],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];";
    let tool = "PERS tooldata w:=[TRUE,[[0,0,3],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];";
    for (declared, motion, part) in [
        (wobj, "MoveL p1,v9,fine,tool0\\WObj:=w;\n", "w.oframe.trans.z"),
        (tool, "MoveL p1,v9,fine,w;\n", "w.tframe.trans.z"),
    ] {
        let (shift, back) = (format!("{part}:=9;\n"), [("w.oframe.trans.z", "0"), ("w.tframe.trans.z", "3")]);
        let back = back.iter().find(|(name, _)| *name == part).map(|(name, z)| format!("{name}:={z};\n")).unwrap();
        let notes = |between: &str, more: &str| {
            let main = format!("{motion}{shift}{between}{back}{motion}");
            next_cycle_notes(&main, &format!("{declared}\n{more}"))
        };
        assert_eq!(notes("", ""), 0);
        for end in ["ExitCycle;", "EXIT;"] {
            assert_eq!(notes(&format!("IF DInput(di)=1 {end}\n"), ""), 1, "{end}");
            assert_eq!(notes(&format!("IF DInput(di)=1 THEN\n{back}{end}\nENDIF\n"), ""), 0, "{end}");
            assert_eq!(notes("stop;\n", &format!("PROC stop()\nIF DInput(di)=1 {end}\nENDPROC")), 1, "{end}");
            assert_eq!(notes("", &format!("TRAP t\n{end}\nENDTRAP")), 1, "{end}");
            assert_eq!(notes("", &format!("TRAP t\nstop;\nENDTRAP\nPROC stop()\n{end}\nENDPROC")), 1, "{end}");
            let function = format!("FUNC num f()\n{end}\nRETURN 1;\nENDFUNC");
            assert_eq!(notes("Set f();\n", &function), 1, "{end}");
            let routine = |on_error: &str| format!("PROC wait()\nWaitDI di,1\\MaxTime:=2;\nERROR\n{on_error}\nENDPROC");
            assert_eq!(notes("wait;\n", &routine(&format!("IF ERRNO=1 {end}\nTRYNEXT;"))), 1, "{end}");
            assert_eq!(notes("wait;\n", &routine("TRYNEXT;")), 0);
        }
    }
}

/// What a handler sets is in force in the next cycle.
#[test]
fn the_next_cycle_begins_with_what_a_handler_left() {
    let body = "MoveL p1,v9,fine,tool0;\nWaitDI di1,1\\MaxTime:=2;\nMoveL p2,v9,fine,tool0;\n";
    let sets = [
        "PDispSet [[0,0,1],[1,0,0,0]];",
        "VelSet 10,800;",
        "SoftAct 1,20;",
        "ConfJ\\Off;",
        "CirPathMode\\ObjectFrame;",
        "EOffsSet [10,0,0,0,0,0];",
        "DeactUnit STN1;",
    ];
    for set in sets {
        for end in ["RETURN;", "ExitCycle;", "EXIT;", "", "TRYNEXT;", "IF ERRNO=1 ExitCycle;\nTRYNEXT;"] {
            assert_eq!(next_cycle_notes(&format!("{body}ERROR\n{set}\n{end}"), ""), 1, "{set} {end}");
        }
        let wait = format!("PROC wait()\nWaitDI di1,1\\MaxTime:=2;\nERROR\n{set}\nRETURN;\nENDPROC");
        assert_eq!(next_cycle_notes(&format!("{body}wait;"), &wait), 1, "{set}");
        let function = format!("FUNC num f()\n{set}\nRETURN 1;\nENDFUNC");
        assert_eq!(next_cycle_notes(&format!("{body}n:=f();"), &function), 1, "{set}");
    }
    assert_eq!(next_cycle_notes(&format!("{body}ERROR\nSetDO d1,1;\nRETURN;"), ""), 0);
    assert_eq!(next_cycle_notes(&format!("{body}ERROR\nrLog;\nRETURN;"), ""), 0);
    assert_eq!(next_cycle_notes(&format!("VelSet 100,5000;\n{body}ERROR\nVelSet 10,800;\nRETURN;"), ""), 0);
}

#[test]
fn the_next_cycle_finds_frames_in_arrays_records_and_copies_otherwise() {
    let wobj = "[FALSE,TRUE,\"\",[[1,2,3],[1,0,0,0]],[[0,0,0],[1,0,0,0]]]";
    let notes = |declared: &str, main: &str| {
        let text = module(main).replace("PROC main", &format!("{declared}\n  PROC main"));
        program(&text.replace("$W", wobj)).diagnostics.iter().filter(|note| note.code == "rapid.next-cycle").count()
    };
    let array = "PERS wobjdata w{2}:=[$W,$W];";
    assert_eq!(notes(array, "MoveL p1,v9,fine,tool0\\WObj:=w{1};\nw{1}.oframe.trans.z:=-2;"), 1);
    let record = "RECORD fix wobjdata w; num n; ENDRECORD\n VAR fix f:=[$W,1];";
    assert_eq!(notes(record, "MoveL p1,v9,fine,tool0\\WObj:=f.w;\nf.w.oframe.trans.z:=-2;"), 1);
    assert_eq!(notes(record, "MoveL p1,v9,fine,tool0\\WObj:=f.w;\nf.n:=f.n+1;"), 0);
    let copied = "VAR wobjdata w:=$W;\n VAR wobjdata c;";
    assert_eq!(notes(copied, "c:=w;\nMoveL p1,v9,fine,tool0\\WObj:=c;\nw.oframe.trans.z:=-2;"), 1);
    assert_eq!(
        notes(copied, "w.oframe.trans.z:=0;\nc:=w;\nMoveL p1,v9,fine,tool0\\WObj:=c;\nw.oframe.trans.z:=-2;"),
        0
    );
}

#[test]
fn a_routine_without_a_caller_depends_on_the_states_that_another_one_sets() {
    let text = |set: &str| {
        module("").replace(
            "PROC main()\n\n  ENDPROC",
            &format!("PROC on()\n{set}\nENDPROC\nPROC part()\nMoveL p1,v9,fine,tool0;\nENDPROC"),
        )
    };
    let warned = |set: &str| program(&text(set)).diagnostics.iter().filter(|one| one.code == "rapid.no-caller").count();
    let sets = [
        "VelSet 10,800;",
        "SoftAct 1,20;",
        "ConfJ\\Off;",
        "PDispSet [[0,0,1],[1,0,0,0]];",
        "CirPathMode\\ObjectFrame;",
    ];
    assert_eq!(sets.map(warned), [1; 5]);
    assert_eq!(warned("SetDO d1,1;"), 0);
}

/// The positions to which a program of this declaration and body goes, and the number of motions that go to an unknown one.
fn goes(declared: &str, main: &str) -> (Vec<[f64; 3]>, usize) {
    let p = program(&module(main).replace("PROC main", &format!("{declared}\n  PROC main")));
    holds(&p);
    (positions(&p), p.unknown.len())
}

/// Data of modules keep their values from one cycle to the next, whatever their type and with or without a value in the text.
#[test]
fn data_that_a_cycle_reads_first_have_any_value() {
    let [one, two] = [[1.0, 2.0, 3.0], [10.5, 20.0, 30.0]];
    let [first, second] = ["MoveL p1,v9,fine,tool0;\n", "MoveL p2,v9,fine,tool0;\n"];
    let either = |condition: &str| format!("IF {condition} THEN\n{first}ELSE\n{second}ENDIF\n");
    let target = format!("robtarget p:={};", robtarget(0.0));
    for (declared, condition, changes) in [
        ("VAR bool b:=TRUE;", "b", "b:=FALSE;"),
        ("PERS bool b:=TRUE;", "b", "b:=FALSE;"),
        ("VAR bool b;", "NOT b", "b:=TRUE;"),
        ("VAR num n;", "n=0", "Incr n;"),
        ("VAR num n{2}:=[0,0];", "n{1}=0", "n{2}:=4;"),
        ("VAR pos o:=[0,0,0];", "o.x=0", "o.x:=9;"),
        ("VAR jointtarget j:=[[0,0,0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];", "j.robax.rax_1=0", "j.robax.rax_1:=9;"),
        (&format!("PERS {target}"), "p.trans.x<50", "p.trans.x:=90;"),
        (&format!("VAR {target}"), "p.trans.x<50", "p.trans.x:=90;"),
    ] {
        let either = either(condition);
        assert_eq!(goes(declared, &format!("{either}{changes}")), (vec![one, two], 0), "{declared}");
        // Without an assignment, the value of the text stays.
        assert_eq!(goes(declared, &either), (vec![one], 0), "{declared}");
    }
    // What every cycle sets first is known, also in a routine that it calls, and of each component or element.
    assert_eq!(goes("VAR bool b;", &format!("b:=TRUE;\n{}b:=FALSE;", either("b"))), (vec![one], 0));
    let routine = "ENDPROC\nPROC reset()\nn:=0;\nENDPROC\nPROC unused()\n";
    assert_eq!(goes("VAR num n;", &format!("reset;\n{}n:=1;{routine}", either("n=0"))), (vec![one], 0));
    let each = "FOR i FROM 1 TO 2 DO\nn{i}:=i;\nENDFOR\n";
    assert_eq!(goes("VAR num n{2}:=[0,0];", &format!("{each}{}", either("n{2}=1"))), (vec![two], 0));
    let parts = format!("p.trans:=[0,0,9];\np.rot:=[1,0,0,0];\np.robconf:=[0,0,0,0];\nMoveL p,v9,fine,tool0;\n{first}");
    assert_eq!(goes(&format!("PERS {target}"), &parts), (vec![[0.0, 0.0, 9.0], one], 0));
    // A routine's own data begin anew.
    assert_eq!(goes("", &format!("VAR num n:=0;\n{}n:=1;", either("n=0"))), (vec![one], 0));
}

/// A part counter of a shop: which part comes next is known only at run time.
#[test]
fn data_that_count_over_cycles_are_unknown() {
    let parts = format!("VAR num n:=0;\nCONST robtarget p{{2}}:=[{},{}];", robtarget(0.0), robtarget(9.0));
    let step = "ENDPROC\nPROC step()\nn:=n+1;\nMoveL p{n},v9,fine,tool0;";
    assert_eq!(goes(&parts, &format!("step;\nstep;\n{step}")), (Vec::new(), 2));
    assert_eq!(goes(&parts, &format!("n:=0;\nstep;\nstep;\n{step}")).0, [[0.0; 3], [9.0, 0.0, 0.0]]);
}

/// Everything that depends on a PERS robtarget which the program assigns is known only at run time.
#[test]
fn assigned_robtargets_are_unknown_wherever_they_are_read() {
    use deflex_program::Predecessor;
    let at = |text: &str| format!("PERS robtarget p:={};\n{text}", robtarget(1.0));
    let indexed = at(&format!("CONST robtarget q{{2}}:=[{},{}];", robtarget(0.0), robtarget(9.0)));
    assert_eq!(goes(&indexed, "MoveL q{p.trans.x},v9,fine,tool0;\np.trans.x:=2;"), (Vec::new(), 1));
    let wobj = at("PERS wobjdata w:=[FALSE,TRUE,\"\",[[1,2,3],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];");
    let frame = "w.oframe.trans:=p.trans;\nMoveL p1,v9,fine,tool0\\WObj:=w;\n";
    assert_eq!(goes(&wobj, &format!("{frame}p.trans.x:=90;")), (Vec::new(), 1));
    assert_eq!(goes(&wobj, frame).1, 0);
    let text = module("MoveJ p,v1000,fine,tool0;\nMoveL p1,v20,fine,tool0;\np:=p2;")
        .replace("PROC main", &format!("{}  PROC main", at("")));
    let p = program(&text);
    assert_eq!((p.targets[0].predecessor, p.unknown[0].reason), (Predecessor::Unknown, Reason::TargetChanged));
}

const TOOLS: &str = "PERS tooldata tA:=[TRUE,[[0,0,100],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\n\
     PERS tooldata tB:=[TRUE,[[0,0,200],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\n";

fn robtarget(x: f64) -> String {
    format!("[[{x},0,0],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]")
}

/// The text after each target was moved by its tool's number, so that motions with other tools need other numbers.
fn cloned(texts: &[String]) -> Vec<String> {
    let sources = texts.iter().enumerate().map(|(i, text)| Source::new(format!("{i}.mod"), text.clone()));
    let p = read(sources.collect(), Vec::new()).unwrap();
    let change = |target: &deflex_program::Target| match target.goal {
        Goal::Pose { position_mm: [x, y, z], .. } => {
            let by = 0.25 * f64::from(1 + u8::from(&*p.tools[usize::from(target.tool)].name == "tB"));
            Some(Change { position_mm: [x, y, z + by], quat: None, conf: None, external: None })
        }
        _ => None,
    };
    let changes: Vec<_> = p.targets.iter().map(change).collect();
    let options = RewriteOptions { allow_clones: true, ..RewriteOptions::default() };
    let edits = p.rewrite(&changes, &[], &options).edits;
    let write = |(source, edits): (&Source, &Vec<_>)| String::from_utf8(applied(&source.bytes, edits)).unwrap();
    p.sources.iter().zip(&edits).map(write).collect()
}

/// A parameter has the name of the declaration, and the literal in one call of several; or it is seen where the declaration is not.
#[test]
fn no_clone_replaces_a_parameter() {
    let one = robtarget(1.0);
    let first = "MoveL p1,v50,fine,tA;\nrSub p1;\n";
    for parameter in ["robtarget p1", "PERS robtarget p1", "INOUT robtarget p1"] {
        let sub = format!("PROC rSub({parameter})\nMoveL p1,v50,fine,tB;\nENDPROC\n");
        let global = format!(
            "MODULE M\n{TOOLS}CONST robtarget p1:={one};\nPROC main()\n{first}rSub Offs(p1,0,0,60);\nENDPROC\n{sub}ENDMODULE\n"
        );
        let local =
            format!("MODULE M\n{TOOLS}PROC main()\nCONST robtarget p1:={one};\n{first}ENDPROC\n{sub}ENDMODULE\n");
        let elsewhere = [
            format!("MODULE M\n{TOOLS}LOCAL CONST robtarget p1:={one};\nPROC main()\n{first}ENDPROC\nENDMODULE\n"),
            format!("MODULE N\n{sub}ENDMODULE\n"),
        ];
        for texts in [&[global][..], &[local], &elsewhere] {
            assert!(!cloned(texts).concat().contains("p1_"), "{parameter}");
        }
    }
    let part = format!(
        "MODULE M\n{TOOLS}RECORD op\nrobtarget a;\nENDRECORD\nCONST op o1:=[{one}];\nPROC main()\nMoveL o1.a,v50,fine,tA;\n\
         rSub o1;\nENDPROC\nPROC rSub(op o1)\nMoveL o1.a,v50,fine,tB;\nENDPROC\nENDMODULE\n"
    );
    assert_eq!(cloned(std::slice::from_ref(&part)), [part]);
}

#[test]
fn clones_follow_their_declaration() {
    let text = format!(
        "MODULE M\n{TOOLS}PROC main()\nCONST robtarget p1:={};\nMoveL p1,v50,fine,tA;\nMoveL p1,v50,fine,tB;\nENDPROC\nENDMODULE\n",
        robtarget(1.0)
    );
    let out = &cloned(&[text])[0];
    let declared = "CONST robtarget p1:=[[1,0,0.2500]";
    assert!(out.contains(declared) && out.contains("CONST robtarget p1_2:=[[1,0,0.5000]"), "{out}");
    assert!(out.contains("MoveL p1,v50,fine,tA;\nMoveL p1_2,v50,fine,tB;"), "{out}");
}

/// Programs in which `rCut`, with this body, also runs where the program does not follow it.
fn run_elsewhere(body: &str) -> Vec<(&'static str, String)> {
    let (one, two) = (robtarget(0.0), robtarget(300.0));
    let program = |main: &str, others: &str| {
        format!(
            "MODULE M\n{TOOLS}VAR intnum i1;\nCONST robtarget p1:={one};\nCONST robtarget p2:={two};\nCONST robtarget p3:={one};\n\
             PROC main()\nMoveL p1,v50,fine,tA;\nrCut p2,tA;\n{main}ENDPROC\n\
             PROC rCut(robtarget p,PERS tooldata t)\n{body}\nENDPROC\n{others}ENDMODULE\n"
        )
    };
    let again = "rCut p3,tB;\n";
    let called = |part: &str| format!("PROC rU()\nWaitTime 1;\n{part}\n{again}ENDPROC\n");
    vec![
        ("trap", program("CONNECT i1 WITH tT;\n", &format!("TRAP tT\n{again}ENDTRAP\n"))),
        ("handler", program(&format!("WaitDI di1,1\\MaxTime:=3;\nERROR\n{again}TRYNEXT;\n"), "")),
        ("function", program("b:=fM();\n", &format!("FUNC bool fM()\n{again}RETURN TRUE;\nENDFUNC\n"))),
        ("undo", program("rU;\n", &called("UNDO"))),
        ("backward", program("rU;\n", &called("BACKWARD"))),
        ("synchronised", program("MoveLSync p1,v500,z10,tA,\"rS\";\n", &format!("PROC rS()\n{again}ENDPROC\n"))),
        ("endless", program("rR 3;\n", &format!("PROC rR(num n)\nIF GInput(gi1)>n rR n-1;\n{again}ENDPROC\n"))),
        ("operator", program("", &format!("PROC rS()\n{again}ENDPROC\n"))),
        ("operator, same tool", program("", "PROC rS()\nrCut p3,tA;\nENDPROC\n")),
    ]
}

/// The same text moves the robot to another place, or in another frame, in the run that is not followed.
#[test]
fn numbers_of_routines_that_also_run_elsewhere_stay() {
    for body in [
        "MoveL Offs(p,0,0,-4),v50,fine,t;",
        "MoveL RelTool(p,0,0,4),v50,fine,t;",
        "MoveC Offs(p,-20,20,0),Offs(p,0,40,0),v50,fine,t;",
    ] {
        for (why, text) in run_elsewhere(body) {
            let p = program(&text);
            let cut = p.targets.iter().filter(|target| target.name.is_none());
            let editable: Vec<Editable> = cut.map(|target| target.editable).collect();
            assert!(!editable.is_empty(), "{why}");
            assert!(editable.iter().all(|e| matches!(e, Editable::No(_))), "{why} {body}: {editable:?}");
        }
    }
}

/// An inserted point would be driven to in the run that is not followed, too.
#[test]
fn nothing_is_inserted_in_routines_that_also_run_elsewhere() {
    for (why, text) in run_elsewhere("MoveL p,v50,fine,t;") {
        assert_eq!(program(&text).insertions_refused(&[1]), [Some(Reason::RunsElsewhere)], "{why}");
    }
    // Without the other run, a point may be inserted.
    let (_, text) = run_elsewhere("MoveL p,v50,fine,t;").swap_remove(0);
    let text = text.replace("TRAP tT\nrCut p3,tB;", "TRAP tT\nStopMove;");
    assert_eq!(program(&text).insertions_refused(&[1]), [None]);
}

#[test]
fn a_handler_reads_the_target_from_which_its_own_data_begin() {
    let p = program(&module(
        "MoveL p1,v50,fine,tool0;\nrS;\n  ENDPROC\n  PROC rS()\nVAR robtarget pX:=p1;\nWaitTime 1;\n  UNDO\nMoveL pX,v50,fine,tool0;",
    ));
    assert_eq!(p.targets[0].editable, Editable::No(Reason::DeclarationUsedElsewhere));
}

fn insertion_before(motion: &str) -> Option<Reason> {
    program(&module(&format!("MoveL p1,v100,fine,tool0;\n{motion};"))).insertions_refused(&[1])[0]
}

/// A function may count its calls.
#[test]
fn no_inserted_point_calls_a_function_again() {
    assert_eq!(insertion_before("MoveL Offs(p2,0,0,5),v100,fine,tool0"), None);
    for motion in [
        "MoveL p2,fSpeed(),fine,tool0",
        "MoveL p2,vF{nNext()},fine,tool0",
        "MoveL p2,v100\\V:=nNext(),fine,tool0",
        "MoveL p2,v100,zF{nNext()},tool0",
    ] {
        assert_eq!(insertion_before(motion), Some(Reason::CallsFunction), "{motion}");
    }
}

/// Between SyncMoveOn and SyncMoveOff, each motion has an identity that a motion of the other task has too.
#[test]
fn no_point_is_inserted_in_synchronised_motions() {
    for motion in ["MoveL p2\\ID:=10,v100,z1,tool0", "MoveC p1,p2\\ID:=10,v100,z1,tool0"] {
        let via = usize::from(motion.starts_with("MoveC"));
        let p = program(&module(&format!("MoveL p1,v100,fine,tool0;\n{motion};")));
        assert_eq!(p.insertions_refused(&[1 + via]), [Some(Reason::Synchronised)], "{motion}");
    }
}

#[test]
fn each_module_means_its_own_names() {
    const FRAMES: &str = "PERS tooldata tM:=[TRUE,[[0,0,310],[1,0,0,0]],[18,[0,0,120],[1,0,0,0],0,0,0]];\n";
    let at = "[[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]";
    let text = |name: &str, frames: &str, body: &str| {
        format!(
            "MODULE {name}\n{frames}CONST robtarget p1:={at};\nPROC main()\n{body}\nENDPROC\nPROC rOwn()\nMoveL p1,v50,fine,tool0;\nENDPROC\nENDMODULE\n"
        )
    };
    let read = |written: &[&str], context: &[&str]| {
        let sources = |texts: &[&str]| texts.iter().map(|text| Source::new("t.mod", *text)).collect::<Vec<_>>();
        read(sources(written), sources(context)).unwrap()
    };
    let editable = |program: &Program| program.targets[0].editable;
    let one = text("One", FRAMES, "MoveL p1,v50,fine,tM;\nrOwn;");
    let library = "MODULE Lib\nPROC rCut()\nMoveL [[0,0,0],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v50,fine,tM;\nENDPROC\nENDMODULE\n";
    // The other program goes to its own p1, in its own routine.
    let other = text("Other", "", "MoveJ p1,v50,fine,tool0;\nrOwn;");
    assert_eq!(
        editable(&read(&[&one.replace("rOwn;", "")], &[])),
        editable(&read(&[&one.replace("rOwn;", "")], &[&other]))
    );
    // A module that declares neither may mean either, unless they are the same.
    let calls = text("One", FRAMES, "rCut;");
    let two = |frames: &str| text("Two", frames, "rCut;");
    let lower = FRAMES.replace("310", "200");
    assert_eq!(editable(&read(&[&calls, library], &[&two(FRAMES)])), Editable::Pose);
    let differing = read(&[&calls, library], &[&two(&lower)]);
    assert!(differing.kept.iter().any(|kept| kept.reason == Reason::Tool), "{:?}", differing.kept);
    // Another version of the same module is none of the other programs.
    let version = two(&lower).replace("MODULE Two", "MODULE One");
    assert_eq!(editable(&read(&[&calls, library], &[&version])), Editable::Pose);
    // A context file that calls nothing of the program, and names its point.
    let names = "MODULE Names\nPROC rNames()\nMoveJ p9,v50,fine,tool0;\nENDPROC\nENDMODULE\n";
    let point = one.replace("p1", "p9").replace("rOwn;", "");
    assert!(matches!(editable(&read(&[&point], &[names])), Editable::No(_)));
}

/// A module around the body of `main`, with three declared targets and a variable, and more declarations and routines.
fn with_copies(body: &str, more: &str) -> String {
    module(body).replace("  PROC main", &format!("  VAR robtarget pT;\n  VAR num n;\n{more}\n  PROC main"))
}

/// The text with 0.25 mm added to x of each target that can be edited, if the joint motions go through air. Checks that every motion comes
/// out where the rewriting says, also if the text is read again.
fn moved(text: &str) -> String {
    let p = program(text);
    let air: Vec<bool> = p.targets.iter().map(|target| target.motion == deflex_program::Motion::Joint).collect();
    let options = RewriteOptions { air: &air, ..RewriteOptions::default() };
    let change = |[x, y, z]: [f64; 3]| Change { position_mm: [x + 0.25, y, z], quat: None, conf: None, external: None };
    let is_open = |target: &deflex_program::Target| matches!(target.editable, Editable::Pose | Editable::Position);
    let changes: Vec<Option<Change>> = p
        .targets
        .iter()
        .zip(&air)
        .map(|(target, air)| match target.goal {
            Goal::Pose { position_mm, .. } if !air && is_open(target) => Some(change(position_mm)),
            _ => None,
        })
        .collect();
    let rewritten = p.rewrite(&changes, &[], &options);
    let new = rewritten_text(&p, &rewritten.edits[0]);
    let again = program(&new);
    for (i, at) in positions(&again).into_iter().enumerate() {
        let differs = (0..3).any(|k| (at[k] - rewritten.written[i].0[k]).abs() > 1e-4);
        assert!(!differs, "motion {i} of\n{new}\nis at {at:?}, not {:?}", rewritten.written[i]);
        let is_corrected = changes[i].is_some() && !rewritten.kept.iter().any(|kept| kept.0 == i);
        let goes = is_corrected || rewritten.along.contains(&i);
        assert!(goes || positions(&p)[i] == at, "motion {i} of\n{new}\nmoves without a word");
    }
    new
}

fn rewritten_text(program: &Program, edits: &[deflex_text::Edit]) -> String {
    String::from_utf8_lossy(&applied(&program.sources[0].bytes, edits)).into_owned()
}

const P1_MOVED: &str = "p1:=[[1.2500,2,3]";
const ONE: &str = "[[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]";
const OTHER: &str = "[[7,8,9],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]";

#[test]
fn copies_above_a_target_go_along_with_it() {
    let cut = "MoveL p1,v20,fine,tool0;\n";
    for (copy, at) in [
        ("pT:=p1;\npT.trans.z:=pT.trans.z+50;\n", [1.0, 2.0, 53.0]),
        ("pT:=p1;\npT.trans.z:=p1.trans.z+2*nSafe-10;\n", [1.0, 2.0, 93.0]),
        ("pT:=p1;\npT.trans.x:=pT.trans.x-5;\npT.trans.z:=p1.trans.z+50;\n", [-4.0, 2.0, 53.0]),
        ("pT:=p1;\npT.trans:=pT.trans+[0,0,50];\n", [1.0, 2.0, 53.0]),
        ("pT:=p1;\npT.trans.z:=200;\n", [1.0, 2.0, 200.0]),
        ("pT:=p1;\npT.trans.z:=nSafe;\npT.trans.z:=pT.trans.z+5;\n", [1.0, 2.0, 55.0]),
        ("pT:=Offs(p1,0,0,nSafe);\n", [1.0, 2.0, 53.0]),
        ("pT:=p1;\nFOR i FROM 1 TO 5 DO\npT.trans.z:=pT.trans.z+10;\nENDFOR\n", [1.0, 2.0, 53.0]),
    ] {
        for around in [["", ""], ["WHILE DInput(di)=0 DO\n", "ENDWHILE\n"], ["IF DInput(di)=0 THEN\n", "ENDIF\n"]] {
            let [before, after] = around;
            let body = format!("{before}{copy}MoveJ pT,v1000,fine,tool0;\n{cut}{after}");
            let text = with_copies(&body, "CONST num nSafe:=50;");
            assert_eq!(positions(&program(&text)), [at, [1.0, 2.0, 3.0]], "{copy}");
            let new = moved(&text);
            assert!(new.contains(P1_MOVED), "{new}");
            assert!((positions(&program(&new))[0][0] - at[0] - 0.25).abs() < 1e-4, "{new}");
            holds(&program(&text));
        }
    }
    // A handler, a trap and a routine without a caller that read other data.
    let body = format!("pT:=p1;\npT.trans.z:=pT.trans.z+50;\nMoveJ pT,v1000,fine,tool0;\n{cut}");
    for (end, more) in [
        ("WaitDI di,1\\MaxTime:=2;\nERROR\nn:=1;\nTRYNEXT;\n", ""),
        ("WaitDI di,1\\MaxTime:=2;\nERROR\nMoveJ p2,v1000,fine,tool0;\nRETRY;\n", ""),
        ("", "TRAP t\nMoveJ p2,v1000,fine,tool0;\nENDTRAP"),
        ("", "PROC back()\nMoveJ p2,v1000,fine,tool0;\nENDPROC"),
        ("above p1;\n", "PROC above(robtarget q)\nq.trans.z:=q.trans.z+9;\nMoveJ q,v9,fine,tool0;\nENDPROC"),
        (
            "above pT;\n",
            "PROC above(VAR robtarget q)\nq:=p1;\nq.trans.z:=q.trans.z+9;\nMoveJ q,v9,fine,tool0;\nENDPROC",
        ),
    ] {
        let new = moved(&with_copies(&format!("{body}{end}"), more));
        assert!(new.contains(P1_MOVED), "{new}");
    }
    // Back at the target, it is the target.
    let body = format!(
        "pT:=p1;\npT.trans.z:=pT.trans.z+5;\nMoveJ pT,v9,fine,tool0;\npT.trans.z:=pT.trans.z-5;\n{}",
        "MoveL pT,v9,fine,tool0;"
    );
    let new = moved(&with_copies(&body, ""));
    assert!(new.contains(P1_MOVED), "{new}");
}

/// Each of these could use the numbers of `p1` elsewhere.
#[test]
fn copies_that_anything_else_reads_hold_the_target() {
    let main = "pT:=p1;\npT.trans.z:=pT.trans.z+50;\nMoveJ pT,v1000,fine,tool0;\nMoveL p1,v20,fine,tool0;\n";
    let stays = |body: &str, more: &str| {
        let new = moved(&with_copies(body, more));
        assert!(!new.contains(P1_MOVED), "{new}");
    };
    assert!(moved(&with_copies(main, "")).contains(P1_MOVED));
    // A cut at the copy that needs the same.
    assert!(moved(&with_copies(&main.replace("MoveJ pT", "MoveL pT"), "")).contains(P1_MOVED));
    // The copy is read.
    for read in ["n:=pT.trans.z;", "IF pT.trans.x>5 Stop;", "Set fAt(pT);", "IF pT=p2 Stop;", "WaitTime pT.trans.x;"] {
        stays(
            &main.replace("MoveL", &format!("{read}\nMoveL")),
            "FUNC num fAt(robtarget q)\nRETURN q.trans.x;\nENDFUNC",
        );
    }
    stays(&format!("{main}rLog pT;\n"), "");
    // It is another target on one path.
    stays(&main.replace("MoveJ", "IF DInput(di)=1 pT:=p2;\nMoveJ"), "");
    stays(&main.replace("MoveJ", "IF DInput(di)=1 pT.trans.x:=n;\nMoveJ"), "");
    stays(&main.replace("pT.trans.z+50", "pT.trans.z+AInput(ai)"), "");
    // The next cycle, or another entry, still has the copy.
    stays(&format!("MoveJ pT,v1000,fine,tool0;\n{main}"), "");
    stays(&format!("IF DInput(di)=1 pT:=p2;\nMoveJ pT,v1000,fine,tool0;\n{main}"), "");
    stays(&format!("pT.rot:=[1,0,0,0];\nMoveJ pT,v1000,fine,tool0;\n{main}"), "");
    stays(main, "PROC back()\nMoveL pT,v1000,fine,tool0;\nENDPROC");
    // A routine outside the files, a trap, a function, a handler.
    stays(&format!("rLog;\n{main}"), "");
    stays(main, "TRAP t\nMoveJ pT,v1000,fine,tool0;\nENDTRAP");
    stays(&format!("n:=f();\n{main}"), "FUNC num f()\nMoveJ pT,v1000,fine,tool0;\nRETURN 1;\nENDFUNC");
    stays(&format!("{main}ERROR\nMoveJ pT,v1000,fine,tool0;\nRETURN;\n"), "");
    let by_reference = "PROC to(VAR robtarget q)\nq:=p1;\nWaitDI di,1\\MaxTime:=2;\nMoveL q,v20,fine,tool0;\nERROR\nMoveL q,v20,fine,tool0;\nRETURN;\nENDPROC";
    stays("to pT;\n", by_reference);
    stays("VAR robtarget pL;\npL:=p1;\nMoveL p1,v20,fine,tool0;\nERROR\nMoveJ pL,v9,fine,tool0;\nRETURN;\n", "");
    stays(
        "above p1;\n",
        &format!(
            "PROC above(robtarget q)\nWaitDI di,1\\MaxTime:=2;\n{}ERROR\nMoveJ q,v9,fine,tool0;\nRETURN;\nENDPROC",
            main.replace("p1", "q")
        ),
    );
    stays(
        "above p1;\n",
        "PROC above(robtarget q)\nIF DInput(di)=1 q:=p2;\nMoveL q,v9,fine,tool0;\nMoveL p1,v20,fine,tool0;\nENDPROC",
    );
    // Another task may read it.
    stays(&main.replace("pT", "pShared"), &format!("PERS robtarget pShared:={OTHER};"));
    // The displacement counts from it.
    stays(&main.replace("MoveL", "PDispOn p2,tool0;\nPDispOff;\nMoveL"), "");
}

#[test]
fn copies_keep_the_target_that_they_had() {
    let body = "pT:=pV;\npV:=p2;\npT.trans.z:=pT.trans.z+50;\nMoveJ pT,v1000,fine,tool0;\nMoveL p1,v20,fine,tool0;\nMoveL pV,v20,fine,tool0;";
    let text = with_copies(&format!("pV:=p1;\n{body}"), "VAR robtarget pV;");
    assert_eq!(positions(&program(&text))[0], [1.0, 2.0, 53.0]);
    let new = moved(&text);
    assert!(new.contains(P1_MOVED) && new.contains("p2:=[[10.7500,20,30]"), "{new}");
}

#[test]
fn assigned_robtargets_are_edited_where_their_numbers_are() {
    let body = format!("pT:={ONE};\nMoveL pT,v20,fine,tool0;\npT:={OTHER};\nMoveL pT,v20,fine,tool0;\n");
    let both = |new: &str| new.contains("pT:=[[1.2500,2,3]") && new.contains("pT:=[[7.2500,8,9]");
    let new = moved(&with_copies(&body, ""));
    assert!(both(&new), "{new}");
    holds(&program(&with_copies(&body, "")));
    // Data of the routine, and a loop.
    let new = moved(&module(&format!("VAR robtarget pT;\nWHILE DInput(di)=0 DO\n{body}ENDWHILE\n")));
    assert!(both(&new), "{new}");
    let new = moved(&module(&format!(
        "VAR robtarget q:={OTHER};\nMoveL q,v20,fine,tool0;\nq:={ONE};\nMoveL q,v20,fine,tool0;\n"
    )));
    assert!(new.contains("q:=[[7.2500,8,9]") && new.contains("q:=[[1.2500,2,3]"), "{new}");
    // The numbers of an offset.
    let new = moved(&with_copies("pT:=Offs(p1,5,0,0);\nMoveL pT,v20,fine,tool0;\n", ""));
    assert!(new.contains("pT:=Offs(p1,5.2500,0,0)"), "{new}");
}

/// Motions before the assignment, and others that any run could make, may go to these numbers too.
#[test]
fn assigned_robtargets_stay_if_other_motions_may_have_them() {
    let body = format!("pT:={ONE};\nMoveL pT,v20,fine,tool0;\n");
    let stays = |body: &str, more: &str| {
        let new = moved(&with_copies(body, more));
        assert!(new.contains(&format!(":={ONE}")) && !new.contains("[[1.2500"), "{new}");
    };
    assert!(moved(&with_copies(&body, "")).contains("pT:=[[1.2500,2,3]"));
    stays(&format!("MoveL pT,v20,fine,tool0;\n{body}"), "");
    stays(&format!("{body}IF DInput(di)=1 pT:={OTHER};\nMoveL pT,v20,fine,tool0;\n"), "");
    stays(&format!("IF DInput(di)=1 THEN\n{body}ENDIF\nMoveL pT,v20,fine,tool0;\n"), "");
    stays(&format!("WHILE DInput(di)=0 DO\nMoveL pT,v20,fine,tool0;\n{body}ENDWHILE\n"), "");
    stays(&body, "TRAP t\nMoveL pT,v20,fine,tool0;\nENDTRAP");
    stays(&body, &format!("TRAP t\npT:={OTHER};\nENDTRAP"));
    stays(&body, "PROC back()\nMoveL pT,v20,fine,tool0;\nENDPROC");
    stays(&format!("{body}to pT;\n"), "PROC to(robtarget q)\nMoveL Offs(q,AInput(ai),0,0),v20,fine,tool0;\nENDPROC");
    stays(&format!("{body}n:=pT.trans.x;\n"), "");
    stays(&format!("{body}rUnknown;\n"), "");
    stays("to;\n", &format!("PROC to()\n{body}ENDPROC\nTRAP t\nto;\nENDTRAP"));
    // In an array, the element may be another one.
    stays(&format!("pA{{1}}:={ONE};\nMoveL pA{{1}},v20,fine,tool0;\n"), "VAR robtarget pA{2};");
}

/// Data that begin with the numbers of another declaration move with it.
#[test]
fn initial_values_that_are_copies_hold_the_target() {
    for declared in ["VAR robtarget q:=p1;\n", ""] {
        let global = if declared.is_empty() { "VAR robtarget q:=p1;" } else { "" };
        let body =
            format!("{declared}MoveL q,v20,fine,tool0;\nMoveL p1,v9,fine,tool0;\nq:=p2;\nMoveL q,v20,fine,tool0;\n");
        let new = moved(&with_copies(&body, global));
        assert_eq!(new.contains(P1_MOVED), global.is_empty(), "{new}");
    }
}

/// A number that people read drives nothing, unlike one that a program or a machine gets.
#[test]
fn instructions_that_only_show_a_target_do_not_hold_it() {
    let is_moved = |show: &str, more: &str| {
        let body = format!("pT:=p1;\n{show}\nMoveL p1,v20,fine,tool0;\nMoveJ pT,v9,fine,tool0;");
        moved(&with_copies(&body, more)).contains(P1_MOVED)
    };
    let function = "FUNC num f(num x)\nPDispSet [[x,0,0],[1,0,0,0]];\nRETURN x;\nENDFUNC";
    for show in [
        "TPWrite \"x=\"\\Num:=p1.trans.x;",
        "TPWrite \"p=\"\\Pos:=pT.trans;",
        "ErrWrite \"x\",\"at \"+NumToStr(p1.trans.x,1)\\RL2:=NumToStr(Distance(p1.trans,p2.trans),1);",
        "UIMsgBox NumToStr(pT.trans.x+1,1);",
    ] {
        assert!(is_moved(show, function), "{show}");
        assert!(
            is_moved(
                &format!("WaitDI di,1\\MaxTime:=2;\n{show}"),
                &format!("TRAP t\n{}\nENDTRAP", show.replace("pT", "p1"))
            ),
            "{show}"
        );
    }
    for read in [
        "Write io,\"x=\"\\Num:=p1.trans.x;",
        "SetAO ao,p1.trans.x;",
        "SocketSend s\\Str:=NumToStr(p1.trans.x,1);",
        "TPWrite \"x=\"\\Num:=f(p1.trans.x);",
        "TPWrite \"x=\"\\Num:=g(p1.trans.x);",
        "n:=p1.trans.x;\nTPWrite \"x=\"\\Num:=n;",
    ] {
        assert!(!is_moved(read, function), "{read}");
    }
    let own = "PROC TPWrite(string s\\num Num)\nPDispSet [[Num,0,0],[1,0,0,0]];\nENDPROC";
    assert!(!is_moved("TPWrite \"x=\"\\Num:=p1.trans.x;", own));
}

/// Handlers, traps and routines without a caller may retract above a target: they do so from where they did before.
#[test]
fn motions_elsewhere_above_a_target_stay_in_place() {
    let main = "MoveL p1,v20,fine,tool0;\nWaitDI di,1\\MaxTime:=2;\n";
    let places = |motion: &str| {
        [
            (format!("{main}ERROR\n{motion}\nTRYNEXT;"), String::new()),
            (main.to_owned(), format!("TRAP t\n{motion}\nENDTRAP")),
            (main.to_owned(), format!("FUNC num f()\n{motion}\nRETURN 1;\nENDFUNC")),
            (main.to_owned(), format!("PROC back()\n{motion}\nENDPROC")),
            (main.to_owned(), format!("TRAP t\nback;\nENDTRAP\nPROC back()\n{motion}\nENDPROC")),
        ]
    };
    for (motion, new) in [
        ("MoveL Offs(p1,0,0,50),v500,fine,tool0;", "Offs(p1,-0.2500,0,50)"),
        ("MoveJ RelTool(p1,5,0,-50),v500,fine,tool0;", "RelTool(p1,4.7500,0,-50)"),
        ("IF DInput(di)=1 MoveL Offs(p1,0.25,0,50),v500,fine,tool0;", "Offs(p1,0.0000,0,50)"),
    ] {
        for (body, more) in places(motion) {
            let text = moved(&with_copies(&body, &more));
            assert!(text.contains(P1_MOVED) && text.contains(new), "{text}");
        }
    }
    for motion in [
        "MoveL p1,v500,fine,tool0;",
        "MoveL Offs(p1,0,0,n),v500,fine,tool0;",
        "MoveL Offs(Offs(p1,0,0,1),0,0,50),v500,fine,tool0;",
        "MoveL RelTool(p1,0,0,50\\Rz:=90),v500,fine,tool0;",
        "MoveC Offs(p1,9,0,50),Offs(p1,0,9,50),v500,fine,tool0;",
        "MoveL Offs(p1,0,0,50),v500\\V:=p1.trans.x,fine,tool0;",
        "pT:=Offs(p1,0,0,50);\nMoveL pT,v500,fine,tool0;",
        "MoveL Offs(p1,0,0,50),v500,fine,tool0;\nMoveL p1,v500,fine,tool0;",
        "rGo Offs(p1,0,0,50);",
    ] {
        // A routine without a caller is run by itself.
        for (body, more) in places(motion).into_iter().filter(|(_, more)| !more.starts_with("PROC")) {
            let text = moved(&with_copies(&body, &more));
            assert!(!text.contains(P1_MOVED) && text.contains(motion), "{text}");
        }
    }
    // The name is another one there.
    let body = format!(
        "VAR robtarget p1:={OTHER};\nMoveL p1,v20,fine,tool0;\nWaitDI di,1\\MaxTime:=2;\nERROR\nMoveL Offs(p1,0,0,50),v9,fine,tool0;\nTRYNEXT;"
    );
    let text = moved(&with_copies(&body, ""));
    assert!(!text.contains("7.25") && text.contains("Offs(p1,0,0,50)"), "{text}");
    // Where the program itself runs the statement, it cuts.
    let text = moved(&with_copies(
        "back;\nMoveL p1,v20,fine,tool0;",
        "TRAP t\nback;\nENDTRAP\nPROC back()\nMoveL Offs(p1,0,0,50),v20,fine,tool0;\nENDPROC",
    ));
    assert!(!text.contains(P1_MOVED) && text.contains("Offs(p1,0,0,50)"), "{text}");
}

#[test]
fn functions_that_only_return_an_expression_are_followed() {
    let is_moved = |motion: &str, function: &str| {
        let text = with_copies(&format!("{motion}\nMoveL p1,v20,fine,tool0;"), function);
        holds(&program(&text));
        moved(&text).contains(P1_MOVED)
    };
    let above = "MoveJ fAbove(p1),v1000,fine,tool0;";
    for (returned, more) in [
        ("Offs(q,0,0,50)", ""),
        ("Offs(q,0,0,nSafe+2*5)", "CONST num nSafe:=50;\n"),
        ("RelTool(q,0,0,-50\\Rz:=90)", ""),
        ("q", ""),
    ] {
        let function = format!("{more}FUNC robtarget fAbove(robtarget q)\nRETURN {returned};\nENDFUNC");
        assert!(is_moved(above, &function), "{returned}");
        assert!(is_moved(&format!("pT:=fAbove(p1);\n{}", above.replace("fAbove(p1)", "pT")), &function), "{returned}");
        // Its numbers belong to all calls: a cut there is corrected by the base, if that has the axes of the work object.
        let by_base = !returned.starts_with("RelTool");
        assert_eq!(is_moved("MoveL fAbove(p1),v9,fine,tool0;", &function), by_base, "{returned}");
        // A trap calls it too.
        let trap = format!("{function}\nTRAP t\nMoveJ fAbove(p1),v1000,fine,tool0;\nENDTRAP");
        assert!(!is_moved(above, &trap), "{returned}");
    }
    let of = |head: &str, body: &str| format!("FUNC robtarget fAbove({head} q)\n{body}\nENDFUNC");
    for function in [
        of("VAR robtarget", "RETURN Offs(q,0,0,50);"),
        of("robtarget", "Incr n;\nRETURN Offs(q,0,0,50);"),
        of("robtarget", "RETURN Offs(q,0,0,AInput(ai));"),
        of("robtarget", "RETURN Offs(q,0,0,100/n);"),
        of("robtarget", "RETURN Offs(q,0,0,q.trans.x);"),
        of("robtarget", "RETURN rElse(q);"),
        of("robtarget", "RETURN fAbove(q);"),
        of("robtarget", "RETURN Offs(q,0,0,50);\nERROR\nRETURN q;"),
    ] {
        assert!(!is_moved(above, &function), "{function}");
    }
}

#[test]
fn an_offset_of_a_kept_base_is_written_and_read_back() {
    let kept = "VAR num y;\nTPReadNum y,\"size\";\nMoveL Offs(p1,0,y,0),v50,fine,tool0;";
    let p = program(&module(&format!("MoveJ p1,v50,fine,tool0;\nMoveL Offs(p1,0,0,20),v50,fine,tool0;\n{kept}")));
    assert_eq!(p.targets[1].editable, Editable::Position);
    holds(&p);
    // Numbers that several motions share, and one motion that goes along.
    holds(&program(&module(
        "MoveJ Offs(p1,0,0,20),v50,fine,tool0;\nMoveL p1,v50,fine,tool0;\nMoveJ p1,v50,fine,tool0;",
    )));
}

/// An operator starts each routine without a caller with the values of the text, as `main`: what another one would have changed before is not
/// known of either.
#[test]
fn routines_without_a_caller_begin_as_main_does() {
    let of = |more: &str, main: &str| {
        let text = with_copies(main, &format!("{TOOLS}{more}"));
        moved(&text).contains(P1_MOVED)
    };
    let cut = "MoveL p1,v20,fine,tA;\n";
    let menu = format!("PROC menu()\n{cut}ENDPROC\n");
    for change in ["BERefPointer tA;", "tA.tframe.trans.z:=201;", "PDispSet [[0,0,1],[1,0,0,0]];", "SoftAct 1,20;"] {
        let calibrate = format!("PROC calibrate()\n{change}\nENDPROC\n");
        assert!(of(&format!("{menu}{calibrate}"), cut), "{change}");
        assert!(of(&format!("{calibrate}{menu}"), cut), "{change}");
        // It cuts after its own changes, or after those of the program.
        assert!(!of(&menu.replace("Move", &format!("{change}\nMove")), cut), "{change}");
        assert!(!of(&format!("{calibrate}{}", menu.replace("Move", "calibrate;\nMove")), cut), "{change}");
        for (body, more) in [
            (format!("{cut}{change}\n"), ""),
            (format!("{cut}calibrate;\n"), ""),
            (format!("{cut}%\"calibrate\"%;\n"), ""),
            (format!("{cut}%\"cali\"+ReadStr(dev)%;\n"), ""),
            (format!("{cut}CallByVar ReadStr(dev),1;\n"), ""),
            (format!("{cut}MoveLSync p2,v20,fine,tA,\"calibrate\";\n"), ""),
            (format!("{cut}WaitDI di,1\\MaxTime:=2;\nERROR\ncalibrate;\nTRYNEXT;\n"), ""),
            (cut.to_owned(), "TRAP t\ncalibrate;\nENDTRAP\n"),
            (cut.to_owned(), "FUNC num f()\ncalibrate;\nRETURN 1;\nENDFUNC\n"),
        ] {
            assert!(!of(&format!("{menu}{calibrate}{more}"), &body), "{change} {body} {more}");
        }
    }
    // A file of the context runs it.
    let calibrate = "PROC calibrate()\ntA.tframe.trans.z:=201;\nENDPROC\n";
    let text = with_copies(cut, &format!("{TOOLS}{menu}{calibrate}"));
    let other = "MODULE N\nPROC other()\ncalibrate;\nENDPROC\nENDMODULE\n";
    let read_with = |context: Vec<Source>| {
        let p = read(vec![Source::new("a.mod", text.clone())], context).unwrap();
        p.targets[0].editable
    };
    assert_eq!(read_with(Vec::new()), Editable::Pose);
    assert!(matches!(read_with(vec![Source::new("n.mod", other.to_owned())]), Editable::No(_)));
}

/// A part of its points would move.
#[test]
fn no_point_of_a_kept_arc_moves() {
    let with = |arc: &str| {
        let more = "CONST num nX:=2;\n";
        moved(&with_copies(&format!("MoveL p1,v20,fine,tool0;\nMoveL {ONE},v20,fine,tool0;\n{arc}"), more))
    };
    for arc in
        ["MoveC p1,Offs(p2,nX,0,0)", "MoveC Offs(p2,nX,0,0),p1", "MoveC Offs(p1,nX,0,0),p2", "MoveC p2,Offs(p1,nX,0,0)"]
    {
        assert!(!with(&format!("{arc},v20,z1,tool0;")).contains(P1_MOVED), "{arc}");
    }
    assert!(with("MoveC p1,p2,v20,z1,tool0;").contains(P1_MOVED));
}

/// The correction of a circle point is not that of a cut that ends there, and an arc moves with all its points or with none.
#[test]
fn a_routine_without_a_caller_holds_circle_points_and_arcs_that_are_not_those_of_the_program() {
    let with = |main: &str, motion: &str| {
        let service = format!("PROC service()\nMoveL {ONE},v20,fine,tool0;\n{motion},v20,fine,tool0;\nENDPROC\n");
        moved(&with_copies(&format!("MoveL {ONE},v20,fine,tool0;\n{main},v20,fine,tool0;\n"), &service))
    };
    let is_moved = |main: &str, motion: &str| with(main, motion).contains(P1_MOVED);
    assert!(is_moved("MoveC p1,p2", "MoveC p1,p2"));
    for motion in ["MoveL p1", "MoveJ p1", "MoveC p2,p1", &format!("MoveC p1,{OTHER}"), "MoveC p1,Offs(p2,0,0,5)"] {
        assert!(!is_moved("MoveC p1,p2", motion), "{motion}");
    }
    for motion in [format!("MoveC p1,{OTHER}"), format!("MoveC {OTHER},p1"), "MoveC Offs(p2,0,0,5),p1".to_owned()] {
        assert!(!is_moved("MoveL p1", &motion), "{motion}");
    }
}

/// A displacement because of the motions before and after it, or along its arc, is right on that path alone.
#[test]
fn targets_that_others_use_or_see_are_bound_to_their_point() {
    let bound = |main: &str, more: &str| program(&with_copies(main, more)).bound_to_point();
    let path = "MoveL p1,v10,z1,tool0;\nMoveL p2,v10,z1,tool0;\n";
    assert!(bound(path, "").is_empty());
    assert_eq!(bound(path, "PROC service()\nMoveL p2,v9,fine,tool0;\nENDPROC\n"), [1]);
    assert_eq!(bound(&format!("{path}TPWrite \"x\"\\Num:=p2.trans.x;\n"), ""), [1]);
    assert_eq!(bound(path, "TRAP t\nTPWrite \"x\"\\Num:=p1.trans.x;\nENDTRAP\n"), [0]);
    // The same path with another beginning and end.
    let three = format!("{path}MoveL {ONE},v10,fine,tool0;\n");
    let all = format!("cut;\nMoveJ {OTHER},v99,fine,tool0;\nENDPROC\nPROC cut()\n{three}");
    assert_eq!(bound(&all, "PROC service()\ncut;\nENDPROC\n"), [0, 2]);
    let one = "one p1;\none p2;\nENDPROC\nPROC one(robtarget q)\nMoveL q,v10,z1,tool0;\n";
    assert_eq!(bound(one, "PROC service()\none p2;\nENDPROC\n"), [1]);
}

/// A force that depends on the feed has another direction in a routine that comes to the same target from elsewhere.
#[test]
fn routines_without_a_caller_that_feed_from_elsewhere_make_the_start_unknown() {
    use deflex_program::Predecessor::{Previous, Start, Unknown};
    let starts = |service: &str| {
        let main = "MoveL p1,v10,z1,tool0;\nMoveL p2,v10,z1,tool0;\n";
        let p = program(&with_copies(main, &format!("PROC service()\n{service}ENDPROC\n")));
        p.targets.iter().map(|target| target.predecessor).collect::<Vec<_>>()
    };
    let other = format!("MoveL {OTHER},v10,fine,tool0;\n");
    let [p1, p2] = ["MoveL p1,v9,fine,tool0;\n", "MoveL p2,v9,fine,tool0;\n"];
    assert_eq!(starts(&format!("{other}{p2}")), [Start, Unknown]);
    assert_eq!(starts(&format!("IF di1=1 THEN\n{other}ELSE\n{p1}ENDIF\n{p2}")), [Start, Unknown]);
    // The same feed in another statement, the first motion of a routine, and a joint motion.
    for service in [format!("{p1}{p2}"), p2.to_owned(), format!("{other}{}", p2.replace("MoveL", "MoveJ"))] {
        assert_eq!(starts(&service), [Start, Previous], "{service}");
    }
}

/// A motion that goes along with the program is not kept, and one that a routine of the program makes elsewhere is.
#[test]
fn motions_without_a_caller_that_stay_are_counted() {
    let said = |main: &str, more: &str| {
        let p = program(&with_copies(main, more));
        let said = p.diagnostics.iter().filter(|said| said.code == "rapid.not-run");
        (said.map(|said| said.message.clone()).collect::<Vec<_>>(), p.kept.len())
    };
    let service = |body: &str| format!("PROC service()\n{body}\nENDPROC\n");
    let none = (Vec::new(), 0);
    let main = "MoveL p1,v10,fine,tool0;\n";
    assert_eq!(said(main, &service("MoveL p1,v10,fine,tool0;\nMoveJ p1,v10,fine,tool0;")), none);
    let one = "1 motion of `service` not corrected: routine that nothing in the files runs".to_owned();
    assert_eq!(said(main, &service("MoveL p1,v10,fine,tool0;\nMoveL p2,v10,fine,tool0;")), (vec![one], 1));
    let cut = "cut p1;\nENDPROC\nPROC cut(robtarget q)\nMoveL q,v10,fine,tool0;\n";
    assert_eq!(said(cut, &service("cut p1;")), none);
    let called =
        "1 motion of `service`, in what it calls, not corrected: routine that nothing in the files runs".to_owned();
    assert_eq!(said(cut, &service("cut p1;\ncut p2;")), (vec![called], 0));
}

/// The user finds out which routine keeps the targets, and which call in it.
#[test]
fn the_routine_that_keeps_targets_is_named() {
    let said = |more: &str, main: &str| {
        let p = program(&with_copies(main, more));
        let codes = ["rapid.uncalled", "rapid.undeclared"];
        let said = p.diagnostics.iter().filter(|said| codes.contains(&said.code));
        said.map(|said| format!("{} {}", said.code, said.message.split(',').next().unwrap())).collect::<Vec<_>>()
    };
    let main = "MoveL p1,v10,z0,tool0;\nMoveL p2,v10,z0,tool0;\n";
    let test = "PROC Fc_Test()\nFCSpdChgAct 55;\nMoveL p1,v20,fine,tool0;\nMoveL p2,v20,fine,tool0;\nENDPROC\n";
    let undeclared = "rapid.undeclared `FCSpdChgAct` is not in the files: what it could change (frames";
    assert_eq!(said(test, main), ["rapid.uncalled `Fc_Test`", undeclared]);
    // A call that keeps nothing is not worth a word.
    assert!(said(&test.replace("MoveL p1", "MoveL p3").replace("MoveL p2", "MoveL p3"), main).is_empty());
    assert!(said(&test.replace("FCSpdChgAct 55;", ""), main).is_empty());
    // A trap keeps them as well.
    assert!(
        said(&format!("{test}TRAP t\nMoveL p1,v9,fine,tool0;\nMoveL p2,v9,fine,tool0;\nENDTRAP\n"), main).is_empty()
    );
    let offset = "PROC one(robtarget q)\nMoveL Offs(q,0,0,5),v9,fine,tool0;\nENDPROC\nPROC two()\none p2;\nENDPROC\n";
    assert_eq!(said(offset, "one p1;\n"), ["rapid.uncalled `two`"]);
}

/// `Path_10` of RobotStudio, which nothing calls, goes to the targets of the program by joint motions.
#[test]
fn joint_motions_in_routines_without_a_caller_go_along() {
    let is_moved = |main: &str, path: &str| {
        let path = format!("{TOOLS}PROC Path_10()\n{path}\nENDPROC");
        moved(&with_copies(main, &path)).contains(P1_MOVED)
    };
    let cut = "MoveJ Offs(p1,0,0,100),v500,fine,tA;\nMoveL p1,v100,fine,tA;\n";
    let both = "MoveJ p1,v500,fine,tA;\nMoveL p1,v100,fine,tA;\n";
    for main in [cut, both] {
        for path in [
            "MoveJ p1,v100,fine,tA;",
            "MoveJ p1,v100,z10,tA;\nMoveL p1,v20,fine,tA;",
            "MoveL p1,v20,fine,tA;",
            "! deflex air\nMoveJ p1,v100,fine,tA;",
        ] {
            assert!(is_moved(main, path), "{main} {path}");
        }
        for path in [
            "MoveJ p1,v100,fine,tB;",
            "MoveL p1,v100,fine,tB;",
            "! deflex cut\nMoveJ p1,v100,fine,tA;",
            "ConfJ\\Off;\nMoveJ p1,v100,fine,tA;",
            "IF DInput(di)=1 ConfJ\\Off;\nMoveJ p1,v100,fine,tA;",
            "PDispSet [[0,0,1],[1,0,0,0]];\nMoveJ p1,v100,fine,tA;",
            "MoveJ p1,v100,fine,tA\\WObj:=wElse;",
            "MoveC p1,p2,v100,fine,tB;",
        ] {
            assert!(!is_moved(main, path), "{main} {path}");
        }
    }
    // What an old menu starts is what `main` starts.
    let run = format!("ENDPROC\nPROC rRun()\n{cut}");
    assert!(is_moved(&format!("rRun;\n{run}"), "rRun;"));
    assert!(!is_moved(&format!("rRun;\nConfJ\\Off;\n{run}"), "rRun;\nConfJ\\Off;\nrRun;"));
    // The program cuts nothing at this target.
    assert!(!is_moved("MoveJ p1,v500,fine,tA;\n", "MoveL p1,v100,fine,tA;"));
    // The caller of the rewriting says which targets stay.
    let p = program(&with_copies(cut, &format!("{TOOLS}PROC Path_10()\nMoveJ p1,v100,fine,tA;\nENDPROC")));
    assert_eq!(p.joints_elsewhere(), [1]);
    let change = |z: f64, conf| Some(Change { position_mm: [1.0, 2.0, z], quat: None, conf, external: None });
    let options = RewriteOptions { stays: &[false, true], ..RewriteOptions::default() };
    let stays = p.rewrite(&[None, change(3.5, None)], &[], &options);
    assert_eq!((&stays.edits[0][..], &stays.kept[..]), (&[][..], &[(1, Reason::MovesKept)][..]));
}

/// A target that is known and stays, and a work object of which only another module can say more.
#[test]
fn reasons_distinguish_known_values_from_unknown_ones() {
    let kept = |body: &str| {
        program(&with_copies(body, "PERS robtarget pKept:=[[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];"))
    };
    let reasons = |body: &str| kept(body).kept.iter().map(|kept| kept.reason).collect::<Vec<_>>();
    assert_eq!(reasons("pKept:=p1;\nMoveL pKept,v9,fine,tool0;"), [Reason::NumbersOfProgram]);
    assert_eq!(reasons("pKept:=CRobT();\nMoveL pKept,v9,fine,tool0;"), [Reason::Computed]);
    let p = kept("wElse.uframe.trans.z:=5;\nMoveL p1,v9,fine,tool0\\WObj:=wElse;");
    let note = p.diagnostics.iter().find(|note| note.code == "rapid.frame").unwrap();
    assert!(note.help.as_ref().is_some_and(|help| help.contains("--context")), "{note:?}");
}

/// Both branches begin where the motion before them ends, and the motion after them where both of them end.
#[test]
fn the_beginning_of_each_branch_is_known() {
    let to = |x: u32| format!("MoveL [[{x},0,0],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v20,fine,tool0;\n");
    let begins = |body: &str| -> Vec<Option<f64>> {
        program(&module(body)).targets.iter().map(|target| target.begins_mm.map(|at| at[0])).collect()
    };
    let branches =
        |then: &str, otherwise: &str| format!("{}IF di1=1 THEN\n{then}ELSE\n{otherwise}ENDIF\n{}", to(1), to(9));
    let [a, b] = [to(2), to(3)];
    assert_eq!(begins(&branches(&a, &b)), [None, None, Some(1.0), None]);
    assert_eq!(begins(&branches(&a, &format!("{b}{a}"))), [None, None, Some(1.0), None, Some(2.0)]);
    // The arm may have moved in the meantime.
    assert_eq!(begins(&branches(&a, &format!("rUnknown;\n{b}"))), [None; 4]);
    assert_eq!(begins(&branches(&a, &format!("SearchL di2,pFound,p1,v20,tool0;\n{b}")))[3], None);
    // The position is counted in other frames, or the controller does not go there.
    assert_eq!(begins(&branches(&a, &b.replace("tool0", "tOther"))), [None; 4]);
    assert_eq!(begins(&format!("PDispOn p1,tool0;\n{}PDispOff;\nIF di1=1 THEN\n{a}ELSE\n{b}ENDIF", to(1))), [None; 3]);
    // A round of a loop begins where the loop does, or where the round before ends.
    assert_eq!(begins(&format!("{}WHILE di1=1 DO\n{a}{b}ENDWHILE\n{}", to(1), to(4))), [None; 4]);
}
