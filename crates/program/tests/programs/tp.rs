//! Reads small TP programs and checks which positions are edited, in which cells.

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

const COPY: &str = "PR[1]=P[2]\nPR[1,3]=PR[1,3]+50";

#[test]
fn an_approach_to_a_register_above_the_position_goes_along() {
    for approach in [
        &format!("{COPY}\nL PR[1] 400mm/sec FINE")[..],
        "PR[1:above]=P[2:start]\nPR[1,3:above]=PR[1,3]+R[5]\nJ PR[1:above] 20% FINE",
        "PR[1]=P[2]\nPR[1,3]=50\nL PR[1] 400mm/sec FINE Offset,PR[4]",
        "IF (DI[1]=ON) THEN\nPR[1]=P[2]\nPR[1,3]=PR[1,3]-5\nL PR[1] 400mm/sec FINE\nENDIF",
        "IF (DI[1]=ON) THEN\nPR[1]=P[2]\nENDIF\nL PR[1] 400mm/sec FINE",
        // The register has another value when it is used.
        "PR[1]=P[2]\nPR[1]=LPOS\nR[1]=PR[1,3]\nUFRAME[5]=PR[1]\nL PR[1] 30mm/sec FINE",
        "PR[1]=P[2]\nUFRAME[5]=PR[3]\nR[1]=PR[2,3]\nPR[2]=PR[3]",
    ] {
        assert_eq!(edits(&format!("{approach}\n{CUT}")), [2, 3], "{approach}");
        assert_eq!(edits(&format!("{CUT}\n{approach}")), [2, 3], "{approach}");
    }
    // One register above two positions.
    let two = "PR[1]=P[2]\nL PR[1] 400mm/sec FINE\nL P[2] 30mm/sec FINE\nPR[1]=P[3]\nL PR[1] 400mm/sec FINE\nL P[3] 30mm/sec FINE";
    assert_eq!(edits(two), [2, 3]);
}

#[test]
fn a_position_on_which_anything_else_depends_by_a_register_stays() {
    for other in [
        "L PR[1] 30mm/sec FINE",
        "R[1]=PR[1,3]",
        "IF (PR[1,3]>5) THEN\nENDIF",
        "PR[1,2]=PR[1,3]+1",
        "PR[1,3]=PR[1,3]*2",
        "PR[2]=PR[1]",
        "PR[2,3]=PR[1,3]\nL PR[2] 400mm/sec FINE",
        "P[4]=PR[1]",
        "UFRAME[5]=PR[1]",
        "L P[3] 400mm/sec FINE Offset,PR[1]",
        "L P[4] 400mm/sec FINE Tool_Offset,PR[R[1]]",
        "L PR[1] 400mm/sec FINE Skip,LBL[1]",
        "L PR[1] 400mm/sec FINE INC",
        "L PR[1] 400mm/sec FINE\nL P[4] 400mm/sec FINE INC",
        "C P[4] PR[1] 400mm/sec FINE",
        // A program that is not given may cut there, and so may one that runs at the same time.
        "CALL OTHER",
        "CALL OTHER(1,PR[1])",
        "RUN OTHER",
        "L P[4] 400mm/sec FINE TB .10sec,CALL OTHER",
        "MAKRO",
        "IF DI[1]=ON,PR[5]=P[2]",
        "PR[R[1]]=P[2]",
        "PR[5]=P[2]+P[3]",
        "PR[5,3]=P[2,3]",
        // The registers of two positions: neither may change the end.
        "IF (DI[1]=ON) THEN\nPR[1]=P[3]\nENDIF\nL PR[1] 400mm/sec FINE",
    ] {
        let statements = format!("{COPY}\n{CUT}\nLBL[1]\n{other}");
        assert!(!edits(&statements).contains(&2), "{other}: {:?}", program_of(&statements, &[]).kept);
    }
    // The next cycle begins with the register that this one leaves.
    assert_eq!(edits(&format!("L PR[1] 30mm/sec FINE\n{COPY}\n{CUT}")), [3]);
    assert_eq!(edits(&format!("L PR[1] 400mm/sec FINE\n{COPY}\n{CUT}")), [2, 3]);
    assert_eq!(edits(&format!("R[1]=PR[1,1]\n{COPY}\n{CUT}")), [3]);
}

#[test]
fn other_programs_that_are_given_may_use_the_register() {
    let main = format!("{COPY}\nL PR[1] 400mm/sec FINE\n{CUT}\nCALL SUB");
    let with = |sub: &str| edited(&program_of(&main, &[("SUB", sub)]));
    for harmless in ["DO[1]=ON", "L P[1] 400mm/sec FINE", "PR[1,3]=5", "PR[1]=LPOS", "L PR[2] 30mm/sec FINE"] {
        assert_eq!(with(harmless), [2, 3], "{harmless}");
    }
    for uses in ["L PR[1] 400mm/sec FINE", "PR[2]=PR[1]", "R[1]=PR[R[2],3]", "CALL OTHER", "RUN WATCH"] {
        assert_eq!(with(uses), [3], "{uses}");
    }
    // One that calls this program, or that runs after it.
    let alone = format!("{COPY}\nL PR[1] 400mm/sec FINE\n{CUT}");
    let after = |other: &str| edited(&program_of(&alone, &[("OTHER", other)]));
    assert_eq!(after("CALL MAIN\nL PR[2] 30mm/sec FINE"), [2, 3]);
    assert_eq!(after("CALL MAIN\nL PR[1] 30mm/sec FINE"), [3]);
    assert_eq!(after("L PR[1] 30mm/sec FINE"), [3]);
}

#[test]
fn a_motion_that_may_go_anywhere_is_named() {
    let program = program_of("L P[1] 30mm/sec FINE\nL P[R[3]] 400mm/sec FINE\nL P[R[4]] 400mm/sec FINE", &[]);
    let notes: Vec<_> = program.diagnostics.iter().map(|note| (note.code, note.line)).collect();
    assert_eq!((notes, edited(&program)), (vec![("ls.any-position", 8)], vec![]));
    assert!(program_of("R[3]=1\nL P[R[3]] 400mm/sec FINE", &[]).diagnostics.is_empty());
}

/// Statements that set the six elements of a register.
fn sets(register: u32) -> String {
    (1..=6).map(|element| format!("PR[{register},{element}]={element}\n")).collect()
}

#[test]
fn a_called_program_that_sets_a_frame_is_followed() {
    let frame = |main: &str, setuf: &str| {
        let program = program_of(main, &[("SETUF", setuf)]);
        let known = edited(&program);
        let frames = program.targets.iter().map(|target| program.wobjs[usize::from(target.wobj)].data);
        (known, frames.map(|data| data.map(|data| data.uframe_mm)).collect::<Vec<_>>())
    };
    let set = Some([1.0, 2.0, 3.0]);
    let main = format!("CALL SETUF\n{CUT}");
    for setuf in [
        format!("{}UFRAME[1]=PR[9]", sets(9)),
        format!("! sets the frame\n! deflex air\n{}MESSAGE[SET]\nUFRAME[1]=PR[9]\nUFRAME_NUM=1\nEND", sets(9)),
        format!("R[1]=9\n{}UFRAME[1]=PR[R[1]]", sets(9)),
    ] {
        assert_eq!(frame(&main, &setuf), (vec![2, 3], vec![set, set]), "{setuf}");
    }
    // The register comes from the program that calls.
    let by_main = format!("{}CALL SETUF\n{CUT}", sets(9));
    assert_eq!(frame(&by_main, "UFRAME[1]=PR[9]"), (vec![2, 3], vec![set, set]));
    for other in [
        "UFRAME[1]=PR[9]",
        &format!("{}PR[9,1]=R[5]\nUFRAME[1]=PR[9]", sets(9)),
        &format!("{}IF DI[1]=ON,PR[9,1]=7\nUFRAME[1]=PR[9]", sets(9)),
        &format!("{}CALL OTHER\nUFRAME[1]=PR[9]", sets(9)),
        &format!("{}JMP LBL[1]\nUFRAME[1]=PR[9]\nLBL[1]", sets(9)),
        &format!("{}UFRAME[1]=PR[9]\nPR[9]=P[1]", sets(9)),
        &format!("{}L P[1] 400mm/sec FINE\nUFRAME[1]=PR[9]", sets(9)),
        &format!("{}UFRAME_NUM=2\nUFRAME[1]=PR[9]", sets(9)),
    ] {
        assert_eq!(frame(&main, other).0, [], "{other}");
    }
    let setuf = format!("{}UFRAME[1]=PR[9]", sets(9));
    // The first cycle begins with another frame than the next one.
    assert_eq!(frame(&format!("L P[4] 30mm/sec FINE\n{main}"), &setuf).0, [2, 3]);
    assert_eq!(frame(&format!("IF DI[1]=ON,CALL SETUF\n{CUT}"), &setuf).0, []);
    // The positions of the called program are others than those of this one.
    assert_eq!(frame(&format!("CALL SETUF\nL PR[1] 400mm/sec FINE\n{CUT}"), "PR[1]=P[2]").0, [2, 3]);
}

/// A register with these distances, and no turn.
fn offset_by(z: &str) -> String {
    let mut text: String = (1..=6).map(|element| format!("PR[9,{element}]=0\n")).collect();
    text += &format!("PR[9,3]={z}\n");
    text
}

#[test]
fn a_cut_at_a_known_offset_is_edited() {
    let at = offset_by("(-2)");
    for (body, zs) in [
        (format!("{at}L P[2] 30mm/sec FINE Offset,PR[9]\nL P[3] 30mm/sec FINE Offset,PR[9]"), &[-2.0, -2.0][..]),
        (
            format!("{at}L P[2] 30mm/sec FINE\nL P[2] 30mm/sec FINE Offset,PR[9:depth]\nL P[3] 30mm/sec FINE"),
            &[0.0, -2.0, 0.0],
        ),
        (
            format!(
                "{}FOR R[1]=1 TO 3\nPR[9,3]=PR[9,3]-2\nL P[2] 30mm/sec FINE Offset,PR[9]\nL P[3] 30mm/sec FINE Offset,PR[GP1:9]\nENDFOR",
                offset_by("0")
            ),
            &[-2.0, -2.0, -4.0, -4.0, -6.0, -6.0],
        ),
        (format!("{at}L P[2] 400mm/sec FINE Offset,PR[9]\n{CUT}"), &[-2.0, 0.0, 0.0]),
        // The tool points down.
        (format!("{at}L P[2] 30mm/sec FINE Tool_Offset,PR[9]\nL P[3] 30mm/sec FINE"), &[2.0, 0.0]),
        (format!("{at}L P[2] 400mm/sec FINE Tool_Offset,PR[9]\n{CUT}"), &[2.0, 0.0, 0.0]),
    ] {
        let program = program_of(&body, &[]);
        let z = |target: &deflex_program::Target| match target.goal {
            Goal::Pose { position_mm, .. } => position_mm[2],
            _ => f64::NAN,
        };
        assert_eq!(program.targets.iter().map(z).collect::<Vec<_>>(), zs, "{body}");
        assert!(program.kept.is_empty() && program.targets.iter().all(|target| target.located), "{body}");
        assert_eq!(edited(&program), [2, 3], "{body}");
    }
}

#[test]
fn passes_whose_corrections_differ_keep_their_position() {
    let body = format!("{}L P[2] 30mm/sec FINE\nL P[2] 30mm/sec FINE Offset,PR[9]", offset_by("(-2)"));
    let program = program_of(&body, &[]);
    let to = |z: f64| Some(Change { position_mm: [200.0, 20.0, z], quat: None, conf: None, external: None });
    let kept = |below: f64| program.rewrite(&[to(0.5), to(below)], &[], &RewriteOptions::default());
    // Less than a micrometre is no difference, also where the third decimal would be another one.
    let (same, other) = (kept(-1.500_4 - 0.000_3), kept(-1.49));
    assert!(same.kept.is_empty() && same.edits[0].len() == 1);
    assert!((same.written[0].0[2] - 0.5).abs() < 1e-6 && (same.written[1].0[2] + 1.5).abs() < 1e-6);
    assert!(other.edits[0].is_empty());
    assert_eq!(other.kept, [(0, Reason::SharedNumbers), (1, Reason::SharedNumbers)]);
}

#[test]
fn an_offset_along_the_tool_turns_with_it() {
    let program = program_of(&format!("{}L P[2] 30mm/sec FINE Tool_Offset,PR[9]", offset_by("(-2)")), &[]);
    // From W = 180 to W = 90, about the tip: the axis of the tool then is -y.
    let half = 0.5_f64.sqrt();
    let to = Change { position_mm: [200.0, 20.0, 2.0], quat: Some([half, half, 0.0, 0.0]), conf: None, external: None };
    let rewritten = program.rewrite(&[Some(to)], &[], &RewriteOptions::default());
    let text = String::from_utf8(applied(&program.sources[0].bytes, &rewritten.edits[0])).unwrap();
    for number in ["Y = 18.000 mm", "Z = 2.000 mm", "W = 90.000 deg"] {
        assert!(text.contains(number), "{text}");
    }
    let off = (0..3).map(|k| (rewritten.written[0].0[k] - [200.0, 20.0, 2.0][k]).abs()).fold(0.0, f64::max);
    assert!(off < 1e-4, "{:?}", rewritten.written);
    // A plain offset does not.
    let program = program_of(&format!("{}L P[2] 30mm/sec FINE Offset,PR[9]", offset_by("(-2)")), &[]);
    let to =
        Change { position_mm: [200.0, 20.0, -2.0], quat: Some([half, half, 0.0, 0.0]), conf: None, external: None };
    let rewritten = program.rewrite(&[Some(to)], &[], &RewriteOptions::default());
    let text = String::from_utf8(applied(&program.sources[0].bytes, &rewritten.edits[0])).unwrap();
    assert!(
        text.contains("Y = 20.000 mm") && text.contains("Z = 0.000 mm") && text.contains("W = 90.000 deg"),
        "{text}"
    );
}

#[test]
fn an_offset_that_is_not_known_keeps_the_cut() {
    let at = offset_by("(-2)");
    for other in [
        "PR[9,3]=R[5]", "IF DI[1]=ON,PR[9,3]=7", "PR[9,6]=90", "PR[9]=LPOS", "PR[9]=P[4]", "CALL OTHER", "RUN OTHER",
        "R[5]=1\nPR[R[6],3]=1",
    ] {
        let body = format!("{at}{other}\nL P[2] 30mm/sec FINE Offset,PR[9]\nL P[3] 30mm/sec FINE");
        assert!(!edits(&body).contains(&2), "{other}");
    }
    for motion in ["Offset", "Offset,PR[GP2:9]", "Tool_Offset", "Offset,PR[9] Tool_Offset,PR[9]", "Offset,PR[9] INC"] {
        let body = format!("{at}L P[2] 30mm/sec FINE {motion}\nL P[3] 30mm/sec FINE");
        assert!(!edits(&body).contains(&2), "{motion}");
    }
    // The next cycle begins with the register that this one leaves.
    assert!(!edits(&format!("L P[2] 30mm/sec FINE Offset,PR[9]\n{at}")).contains(&2));
}

/// An operator may start a program after another one.
#[test]
fn what_a_program_that_is_not_called_leaves_is_not_known() {
    let sets = "PR[3]=LPOS-LPOS\nUFRAME[1]=PR[3]";
    let with = |own: &str, other: &str| edited(&program_of(own, &[("OTHER", other)]));
    assert_eq!(with(CUT, ""), [2, 3]);
    for other in [sets, "UTOOL[1]=PR[1]", "UFRAME[R[1]]=PR[1]", "$MNUFRAME[1,1]=PR[1]"] {
        assert_eq!(with(CUT, other), [], "{other}");
    }
    assert_eq!(with(CUT, "UFRAME[2]=PR[1]"), [2, 3]);
    assert_eq!(with(&format!("{sets}\n{CUT}"), sets), [2, 3]);
    // The cell has the frames of a program that another one calls, and a warning says so.
    assert_eq!(edited(&program_of(CUT, &[("SETS", sets), ("CALLER", "CALL SETS\nCALL MAIN")])), [2, 3]);
    // The override of another program.
    let feeds = |own: &str, other: &str| {
        program_of(own, &[("OTHER", other)]).targets.iter().map(|target| target.feed_mm_s).collect::<Vec<_>>()
    };
    assert_eq!(feeds(CUT, "OVERRIDE=50%"), [None, None]);
    assert_eq!(feeds(CUT, "OVERRIDE=50%\nOVERRIDE=100%"), [Some(30.0), Some(30.0)]);
    assert_eq!(feeds(&format!("OVERRIDE=100%\n{CUT}"), "OVERRIDE=50%"), [Some(30.0), Some(30.0)]);
}

#[test]
fn approaches_by_other_sums_go_along() {
    let above = |sum: &str| edits(&format!("J P[1] 20% FINE\n{sum}\nL PR[1] 400mm/sec FINE\n{CUT}"));
    for sum in
        ["PR[1]=P[2]\nPR[1,3]=(PR[1,3]+50)", "PR[1]=P[2]\nPR[1,3]=50+PR[1,3]", "PR[1]=P[2]+PR[2]", "PR[1]=P[2]-PR[2]"]
    {
        assert_eq!(above(sum), [2, 3], "{sum}");
    }
    for sum in ["PR[1]=P[2]\nPR[1,3]=50-PR[1,3]", "PR[2]=P[2]\nPR[1]=P[3]+PR[2]", "PR[1]=P[2]+P[3]"] {
        assert!(!above(sum).contains(&2), "{sum}");
    }
}

#[test]
fn a_register_with_the_same_number_on_all_paths_is_known() {
    let feed = |other: u32| {
        let program = program_of(&format!("R[1]=30\nIF DI[1]=ON,R[1]={other}\nL P[2] R[1]mm/sec FINE"), &[]);
        program.targets[0].feed_mm_s
    };
    assert_eq!([feed(30), feed(20)], [Some(30.0), None]);
}

#[test]
fn a_counted_loop_within_an_endless_one_is_followed() {
    assert_eq!(edits("LBL[1]\nFOR R[1]=2 TO 3\nL P[R[1]] 30mm/sec FINE\nENDFOR\nJMP LBL[1]"), [2, 3]);
    let counted = "LBL[1]\nR[1]=2\nLBL[2]\nL P[R[1]] 30mm/sec FINE\nR[1]=R[1]+1\nIF R[1]<=3,JMP LBL[2]\nJMP LBL[1]";
    assert_eq!(edits(counted), [2, 3]);
}

/// Both branches begin where the motion before them ends, and the motion after them where either of them ends.
#[test]
fn the_beginning_of_each_branch_is_known() {
    let begins = |first: &str, second: &str| -> Vec<Option<f64>> {
        let to = |number: u32| format!("L P[{number}] 30mm/sec FINE\n");
        let [a, b, c, d] = [1, 2, 3, 4].map(to);
        let statements = format!("{a}{first}IF DI[1]=ON,JMP LBL[1]\n{b}JMP LBL[2]\nLBL[1]\n{second}{c}LBL[2]\n{d}");
        program_of(&statements, &[]).targets.iter().map(|target| target.begins_mm.map(|at| at[0])).collect()
    };
    assert_eq!(begins("", ""), [None, None, Some(100.0), None]);
    // The arm may have moved in the meantime, or does not go to the numbers of the position.
    assert_eq!(begins("", "CALL OTHER\n"), [None; 4]);
    assert_eq!(begins("L P[4] 30mm/sec FINE Offset,PR[1]\n", ""), [None; 5]);
}
