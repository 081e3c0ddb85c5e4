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
