//! Text in, targets and edits out.

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

#[test]
fn loops_with_known_bounds_run() {
    let p = program(&module("FOR i FROM 1 TO 3 DO\nMoveL Offs(p1,i*10,0,0),v100,fine,tool0;\nENDFOR"));
    assert_eq!(positions(&p), [[11.0, 2.0, 3.0], [21.0, 2.0, 3.0], [31.0, 2.0, 3.0]]);
    assert_eq!(p.targets[0].editable, Editable::No(Reason::OffsetWithExpression));
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
fn targets_changed_at_run_time_are_kept() {
    let p = program(
        "MODULE M\nVAR robtarget p:=[[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\nPROC main()\n\
         MoveL p,v100,fine,tool0;\np.trans.z:=p.trans.z+5;\nMoveL p,v100,fine,tool0;\nENDPROC\nENDMODULE",
    );
    assert_eq!(positions(&p), [[1.0, 2.0, 3.0], [1.0, 2.0, 8.0]]);
    assert!(p.targets.iter().all(|t| matches!(t.editable, Editable::No(_))));
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
