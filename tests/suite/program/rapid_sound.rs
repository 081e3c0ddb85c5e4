//! Never a wrong program without a word: what is edited is right for every run, what stays is said.
//!
//! Each case marks its motions: `! edit` must be corrected, `! stay` must come out as it went in, and be said.

use deflex::cell::Cell;
use deflex::correct::{Options, Status};
use deflex::program::{ArcTurn, Change, Editable, Goal, Motion, Program, Reason, RewriteOptions, rapid};
use deflex::text::{Source, applied};
use std::collections::BTreeMap;

const DATA: &str = "  PERS tooldata t1:=[TRUE,[[0,0,200],[1,0,0,0]],[5,[0,0,80],[1,0,0,0],0,0,0]];
  PERS tooldata t2:=[TRUE,[[0,30,250],[1,0,0,0]],[5,[0,0,80],[1,0,0,0],0,0,0]];
  PERS tooldata tFix{2}:=[[TRUE,[[0,0,200],[1,0,0,0]],[5,[0,0,80],[1,0,0,0],0,0,0]],[TRUE,[[9,0,200],[1,0,0,0]],[5,[0,0,80],[1,0,0,0],0,0,0]]];
  PERS wobjdata w1:=[FALSE,TRUE,\"\",[[800,0,400],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  PERS wobjdata w2:=[FALSE,TRUE,\"\",[[900,0,400],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  PERS wobjdata wFix{2}:=[[FALSE,TRUE,\"\",[[800,0,400],[1,0,0,0]],[[0,0,0],[1,0,0,0]]],[FALSE,TRUE,\"\",[[900,0,400],[1,0,0,0]],[[0,0,0],[1,0,0,0]]]];
  VAR wobjdata wSet:=[FALSE,TRUE,\"\",[[700,0,400],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  VAR wobjdata wArr{2}:=[[FALSE,TRUE,\"\",[[800,0,400],[1,0,0,0]],[[0,0,0],[1,0,0,0]]],[FALSE,TRUE,\"\",[[900,0,400],[1,0,0,0]],[[0,0,0],[1,0,0,0]]]];
  CONST robtarget p1:=[[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget p2:=[[10,20,30],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget p3:=[[50,60,70],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget pa{2}:=[[[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],[[4,5,6],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]];
  VAR intnum i1;
  VAR num n:=0;
  VAR num nIn;
  VAR string s:=\"\";
";
/// A constant force on an arm that turns under it.
const TURNING: &str = r#"
[robot]
model = "irb6700-150-3.20"
[robot.stiffness]
joint_nm_per_rad = [6e5, 5e5, 4e5, 9e4, 8e4, 5e4]
[limits]
max_correction_mm = 100.0
max_step_mm = 500.0
[cut]
force = "constant"
force_n = [310.0, -190.0, 240.0]
frame = "wobj"
"#;
const INLINE: &str = "[[7,8,9],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]";

fn read(text: &str) -> Program {
    rapid::read(vec![Source::new("m.mod", text)], Vec::new()).unwrap_or_else(|errors| panic!("{text}\n{errors:?}"))
}

fn position(goal: &Goal) -> [f64; 3] {
    match goal {
        Goal::Pose { position_mm, .. } => *position_mm,
        _ => [f64::NAN; 3],
    }
}

/// A correction that differs from frame to frame, as one does that is worked out.
fn wanted(program: &Program, i: usize) -> Option<Change> {
    let target = &program.targets[i];
    if !matches!(target.editable, Editable::Pose | Editable::Position) {
        return None;
    }
    let frames = [&program.tools[usize::from(target.tool)].name, &program.wobjs[usize::from(target.wobj)].name];
    let [tool, wobj] = frames.map(|name| name.bytes().map(f64::from).sum::<f64>() / 1000.0);
    let index = f64::from(target.wobj) / 16.0 + f64::from(target.tool) / 32.0;
    let [x, y, z] = position(&target.goal);
    Some(Change { position_mm: [x + tool + index, y - wobj, z + 0.5], quat: None, conf: None, external: None })
}

/// What becomes of each motion statement, by its line: corrected, or the reason that is said.
fn fates(text: &str, clones: bool) -> BTreeMap<u32, Result<(), &'static str>> {
    let program = read(text);
    let changes: Vec<Option<Change>> = (0..program.targets.len()).map(|i| wanted(&program, i)).collect();
    let options = RewriteOptions { allow_clones: clones, ..RewriteOptions::default() };
    let rewritten = program.rewrite(&changes, &[], &options);
    let out = applied(&program.sources[0].bytes, &rewritten.edits[0]);
    let again = read(std::str::from_utf8(&out).unwrap());
    let mut fates: BTreeMap<u32, Result<(), &'static str>> = BTreeMap::new();
    for kept in &program.kept {
        fates.insert(u32::try_from(kept.line).unwrap(), Err(kept.reason.text()));
    }
    assert_eq!(program.targets.len(), again.targets.len(), "{text}");
    for (i, (was, is)) in program.targets.iter().zip(&again.targets).enumerate() {
        let said = rewritten.kept.iter().find(|kept| kept.0 == i).map(|kept| kept.1);
        let said = said.or(if let Editable::No(reason) = was.editable { Some(reason) } else { None }).map(Reason::text);
        let (before, after) = (position(&was.goal), position(&is.goal));
        match said {
            Some(reason) => {
                assert!(
                    before[0].is_nan() || before.map(f64::to_bits) == after.map(f64::to_bits),
                    "line {} is said to stay ({reason}), and moves",
                    was.line
                );
                fates.insert(was.line, Err(reason));
            }
            None => {
                let wanted = changes[i].as_ref().unwrap().position_mm;
                let near = (0..3).all(|k| (wanted[k] - after[k]).abs() < 2e-4);
                assert!(near, "line {}: wanted {wanted:?}, written {after:?}\n{text}", was.line);
                fates.entry(was.line).or_insert(Ok(()));
            }
        }
    }
    fates
}

fn module(main: &str, routines: &str) -> String {
    format!("MODULE M\n{DATA}  PROC main()\n{main}\n  ENDPROC\n{routines}\nENDMODULE\n").replace("@", INLINE)
}

fn check(main: &str, routines: &str) {
    let text = module(main, routines);
    check_text(&text);
}

fn check_text(text: &str) {
    let fates = fates(text, false);
    for (line, at) in text.lines().zip(1_u32..) {
        let moves = line.trim_start().to_ascii_uppercase();
        let moves = ["MOVE", "SEARCH", "IF", "ERROR"].iter().any(|word| moves.starts_with(word)) && line.contains("! ");
        if !moves {
            continue;
        }
        match (line.contains("! edit"), fates.get(&at)) {
            (true, Some(Ok(()))) | (false, Some(Err(_))) => {}
            (true, fate) => panic!("line {at} is not corrected: {fate:?}\n{line}\n{text}"),
            (false, Some(Ok(()))) => panic!("line {at} is corrected\n{line}\n{text}"),
            (false, None) => panic!("line {at} stays and is not said\n{line}\n{text}"),
        }
    }
}

const DISPLACE: &str = "PDispSet [[40,0,0],[1,0,0,0]];";

#[test]
fn a_counter_selects_a_frame_in_each_round() {
    check(
        "FOR i FROM 1 TO 2 DO
MoveL pa{i},v50,fine,t1\\WObj:=wFix{i}; ! edit
MoveL p1,v50,fine,t1\\WObj:=wFix{i}; ! stay
MoveL @,v50,fine,tFix{i}\\WObj:=w1; ! stay
ENDFOR
MoveL p2,v50,fine,t1\\WObj:=w1; ! edit",
        "",
    );
}

#[test]
fn a_name_that_the_program_declares_is_never_the_cells() {
    // Set at run time, by one branch, by a function, by a probe, in a local of the same name, in a parameter.
    check(
        "wSet.oframe.trans.z:=ReadNum(dev);
MoveL p1,v50,fine,t1\\WObj:=wSet; ! stay
wSet:=w2;
MoveL p2,v50,fine,t1\\WObj:=wSet; ! edit
IF di1=1 wSet:=w1;
MoveL p3,v50,fine,t1\\WObj:=wSet; ! stay
rOwn;",
        "PROC rOwn()
VAR wobjdata w1;
MoveL pa{1},v50,fine,t1\\WObj:=w1; ! stay
ENDPROC",
    );
    let program = read(&module(
        "rPart w2;",
        "PROC rPart(wobjdata wCell)\nwCell.oframe.trans.x:=ReadNum(dev);\nMoveL p1,v50,fine,t1\\WObj:=wCell;\nENDPROC",
    ));
    assert!(program.targets.is_empty() && program.wobjs.is_empty(), "{:?}", program.wobjs);
    // A name that it assigns and does not declare is not the cell's either; one that it only uses is.
    check("wCell:=w2;\nMoveL p1,v50,fine,t1\\WObj:=wCell; ! stay\nMoveL p2,v50,fine,tCell\\WObj:=w1; ! edit", "");
}

#[test]
fn what_functions_and_procedures_change_is_seen() {
    check(
        "MoveL p1,v50,fine,t1\\WObj:=w1; ! edit
n:=fDisp();
MoveL p2,v50,fine,t1\\WObj:=w1; ! stay
PDispOff;
MoveL p3,v50,fine,t1\\WObj:=w1; ! edit
n:=fFrame();
MoveL @,v50,fine,t1\\WObj:=wSet; ! stay",
        &format!(
            "FUNC num fDisp()\n{DISPLACE}\nRETURN 1;\nENDFUNC\nFUNC num fFrame()\nrFrame;\nRETURN 1;\nENDFUNC\nPROC rFrame()\nwSet:=w2;\nENDPROC"
        ),
    );
}

#[test]
fn routines_that_are_not_known_make_unknown_what_they_could_see() {
    for call in
        ["rElsewhere;", "rElsewhere 1,2;", "CallByVar \"r\",nIn;", "n:=fElsewhere();", "IF fElsewhere() THEN\nENDIF"]
    {
        check(
            &format!(
                "MoveL p1,v50,fine,t1\\WObj:=w1; ! edit\nnIn:=ReadNum(dev);\ns:=ReadStr(dev);\n{call}\nMoveL p2,v50,fine,t1\\WObj:=w1; ! stay\nPDispOff;\nMoveL p3,v50,fine,t1\\WObj:=w1; ! stay\nw1:=w1Const;\nMoveL pa{{1}},v50,fine,tool0\\WObj:=wobj0; ! edit"
            ),
            "CONST wobjdata w1Const:=[FALSE,TRUE,\"\",[[800,0,400],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];",
        );
    }
    let program = read(&module("rElsewhere;", ""));
    let said = program.diagnostics.iter().any(|d| d.code == "rapid.undeclared" && d.message.contains("`rElsewhere`"));
    assert!(said, "{:?}", program.diagnostics);
    // Handed to it: an inline target is not one of wobj0.
    let text = module("rElsewhere @,t1;", "");
    let program = read(&text);
    assert!(program.targets.is_empty());
    assert_eq!(program.unknown_targets(), [(Reason::GivenAway, 1)]);
}

#[test]
fn synchronised_procedures_run_some_time_later() {
    check(
        "MoveL p1,v50,fine,t1\\WObj:=w1; ! edit\nMoveLSync p2,v50,z1,t1\\WObj:=w1,\"rDisp\"; ! stay\nPDispOff;\nMoveL p3,v50,fine,t1\\WObj:=w1; ! stay",
        &format!("PROC rDisp()\n{DISPLACE}\nENDPROC"),
    );
}

#[test]
fn data_may_be_set_by_their_names() {
    check(
        "SetDataVal \"wSet\",w2;\nMoveL p1,v50,fine,t1\\WObj:=wSet; ! stay\nMoveL p2,v50,fine,t1\\WObj:=w1; ! edit",
        "",
    );
    check("SetAllDataVal \"wobjdata\",w2;\nMoveL p1,v50,fine,t1\\WObj:=w1; ! stay", "");
    check(
        "GetDataVal \"p1\",pGot;\nMoveL p1,v50,fine,t1\\WObj:=w1; ! stay\nMoveL p2,v50,fine,t1\\WObj:=w1; ! edit",
        "VAR robtarget pGot;",
    );
    check(
        "ReadCfgData \"/MOC/ROBOT/rob1\",\"base\",nIn;\nWriteCfgData \"/MOC/ROBOT/rob1\",\"base\",nIn;\nMoveL p1,v50,fine,t1\\WObj:=w1; ! stay",
        "",
    );
}

#[test]
fn traps_and_handlers_change_at_any_moment_what_they_change() {
    check(
        "CONNECT i1 WITH tr;\nISignalDI di1,1,i1;\nMoveL p1,v50,fine,t1\\WObj:=w1; ! stay",
        &format!("TRAP tr\n{DISPLACE}\nENDTRAP"),
    );
    check(
        "CONNECT i1 WITH tr;\nMoveL p1,v50,fine,t1\\WObj:=wSet; ! stay\nMoveL p2,v50,fine,t1\\WObj:=w1; ! edit",
        "TRAP tr\nrFrame;\nENDTRAP\nPROC rFrame()\nwSet:=w2;\nENDPROC",
    );
    check(
        &format!("WaitDI di1,1\\MaxTime:=1;\nMoveL p1,v50,fine,t1\\WObj:=w1; ! stay\nERROR\n{DISPLACE}\nTRYNEXT;"),
        "",
    );
    check("WaitDI di1,1\\MaxTime:=1;\nMoveL p1,v50,fine,t1\\WObj:=wSet; ! stay\nERROR\nwSet:=w2;\nRETRY;", "");
    // What an error skips is not done.
    check(
        "rTry;\nMoveL p1,v50,fine,t1\\WObj:=w1; ! stay",
        &format!("PROC rTry()\n{DISPLACE}\nWaitDI di1,1\\MaxTime:=1;\nPDispOff;\nERROR\nRETURN;\nENDPROC"),
    );
}

#[test]
fn optional_arguments_may_hand_something_back() {
    for instruction in [
        "WaitUntil di1=1\\MaxTime:=5\\TimeFlag:=b;",
        "WaitDI di1,1\\MaxTime:=5\\TimeFlag:=b;",
        "WaitAI ai1\\GT,5\\MaxTime:=3\\ValueAtTimeout:=n;",
        "UIMsgBox s\\Result:=n;",
        "nIn:=UINumEntry(\\Header:=s\\BreakFlag:=n);",
    ] {
        check(
            &format!(
                "VAR bool b:=FALSE;\n{instruction}\nIF b OR n>0 THEN\n{DISPLACE}\nENDIF\nMoveL p1,v50,fine,t1\\WObj:=w1; ! stay"
            ),
            "",
        );
    }
    check(
        "VAR bool b:=FALSE;\nWaitUntil di1=1;\nIF b THEN\nPDispOff;\nENDIF\nMoveL p1,v50,fine,t1\\WObj:=w1; ! edit",
        "",
    );
}

#[test]
fn axes_that_yield_are_not_corrected() {
    check(
        "MoveL p1,v50,fine,t1\\WObj:=w1; ! edit\nSoftAct 3,50;\nMoveL p2,v50,fine,t1\\WObj:=w1; ! stay\nSoftDeact;\nMoveL p3,v50,fine,t1\\WObj:=w1; ! edit",
        "",
    );
    check("IF di1=1 SoftAct 3,50;\nMoveL p1,v50,fine,t1\\WObj:=w1; ! stay", "");
    check("MoveL p1,v50,fine,t1\\WObj:=w1\\Corr; ! stay\nMoveL p2,v50,fine,t1\\WObj:=w1; ! edit", "");
}

#[test]
fn arcs_turn_the_tool_as_cir_path_mode_says() {
    let turns = |main: &str| -> Vec<Option<ArcTurn>> {
        let ends = read(&module(main, "")).targets.into_iter().filter(|target| target.motion == Motion::Circular);
        ends.filter(|target| target.is_end()).map(|target| target.arc_turn).collect()
    };
    let arc = "MoveC p1,p2,v50,fine,t1\\WObj:=w1;\n";
    let stated =
        format!("{arc}CirPathMode\\ObjectFrame;\n{arc}CirPathMode\\CirPointOri;\n{arc}CirPathMode\\PathFrame;\n{arc}");
    let words = [None, Some(ArcTurn::Even), Some(ArcTurn::ThroughCirclePoint), Some(ArcTurn::WithPath)];
    assert_eq!(turns(&stated), words);
    // What only the controller knows, or only the run, stays. Lines do not depend on it.
    let line = "MoveL p3,v50,fine,t1\\WObj:=w1;";
    check(&format!("CirPathMode\\Wrist45;\n{} ! stay\n{line} ! edit", arc.trim()), "");
    check(&format!("IF di1=1 CirPathMode\\ObjectFrame;\n{} ! stay\n{line} ! edit", arc.trim()), "");
    check(&format!("IF di1=1 rSet;\n{} ! stay", arc.trim()), "PROC rSet()\nCirPathMode\\ObjectFrame;\nENDPROC");
}

#[test]
fn speeds_are_those_that_are_driven() {
    let speeds = |main: &str| -> Vec<Option<f64>> {
        read(&module(main, "")).targets.iter().map(|target| target.feed_mm_s).collect()
    };
    let to = "MoveL p1,v50,fine,t1\\WObj:=w1;\nMoveL p2,v100\\V:=30,fine,t1\\WObj:=w1;";
    assert_eq!(speeds(to), [Some(50.0), Some(30.0)]);
    assert_eq!(speeds(&format!("VelSet 50,20;\n{to}")), [Some(20.0), Some(15.0)]);
    assert_eq!(speeds(&format!("IF di1=1 VelSet 50,800;\n{to}")), [None, None]);
    assert_eq!(speeds(&format!("VelSet nIn,800;\nSpeedRefresh 50;\n{to}")), [None, None]);
}

#[test]
fn parameters_are_copies_or_places() {
    for given in ["wSet.oframe", "wArr{1}.oframe"] {
        let of = given.split('.').next().unwrap();
        check(
            &format!(
                "rSet {given};\nMoveL p1,v50,fine,t1\\WObj:={of}; ! stay\nMoveL p2,v50,fine,t1\\WObj:=wArr{{2}}; ! edit"
            ),
            "PROC rSet(INOUT pose f)\nf.trans.x:=ReadNum(dev);\nENDPROC",
        );
    }
    check(
        "rSet wArr{1},w2;\nMoveL p1,v50,fine,t1\\WObj:=wArr{1}; ! edit",
        "PROC rSet(INOUT wobjdata w,wobjdata by)\nw:=by;\nENDPROC",
    );
    check(
        "nIn:=ReadNum(dev);\nrSet wArr{nIn},w2;\nMoveL p1,v50,fine,t1\\WObj:=wArr{1}; ! stay",
        "PROC rSet(INOUT wobjdata w,wobjdata by)\nw:=by;\nENDPROC",
    );
    // A copy keeps what it was given.
    let program =
        read(&module("rUse wSet;", "PROC rUse(wobjdata w)\nwSet:=w2;\nMoveL p1,v50,fine,t1\\WObj:=w;\nENDPROC"));
    assert!((program.wobjs[0].data.unwrap().uframe_mm[0] - 700.0).abs() < 1e-9);
}

#[test]
fn displacement_of_the_round_before_is_seen() {
    check(
        &format!(
            "FOR i FROM 1 TO ReadNum(dev) DO\nMoveL p1,v50,fine,t1\\WObj:=w1; ! stay\n{DISPLACE}\nENDFOR\nMoveL p2,v50,fine,t1\\WObj:=w1; ! stay\nPDispOff;\nMoveL p3,v50,fine,t1\\WObj:=w1; ! edit"
        ),
        "",
    );
    // On and off in each round.
    check(
        &format!(
            "WHILE di1=1 DO\nMoveL p1,v50,fine,t1\\WObj:=w1; ! edit\n{DISPLACE}\nMoveL p2,v50,fine,t1\\WObj:=w1; ! stay\nPDispOff;\nENDWHILE\nMoveL p3,v50,fine,t1\\WObj:=w1; ! edit"
        ),
        "",
    );
    // What it is counted from does not move.
    check(
        "MoveL p2,v50,fine,t1\\WObj:=w1; ! stay\nPDispOn p3,t1\\WObj:=w1;\nPDispOff;\nMoveL p3,v50,fine,t1\\WObj:=w1; ! stay",
        "",
    );
}

#[test]
fn branches_join_component_by_component() {
    check(
        "IF di1=1 THEN\nwSet.oframe.trans.z:=5;\nn:=1;\nELSE\nn:=1;\nENDIF
MoveL p1,v50,fine,t1\\WObj:=wSet; ! stay
MoveL pa{n},v50,fine,t1\\WObj:=w1; ! edit
wSet.oframe.trans.z:=5;
MoveL p2,v50,fine,t1\\WObj:=wSet; ! edit
TEST nIn
CASE 1: wSet:=w1;
DEFAULT: wSet:=w1;
ENDTEST
MoveL p3,v50,fine,t1\\WObj:=wSet; ! edit",
        "",
    );
    check(
        "rPart;\nMoveL p1,v50,fine,t1\\WObj:=w1; ! stay",
        &format!("PROC rPart()\n{DISPLACE}\nIF di1=1 RETURN;\nPDispOff;\nENDPROC"),
    );
}

#[test]
fn jumps_leave_what_the_routine_changes_unknown() {
    check(&format!("{DISPLACE}\nIF di1=1 GOTO on;\nPDispOff;\non:\nMoveL p1,v50,fine,t1\\WObj:=w1; ! stay"), "");
    check(
        "again:\nMoveL p1,v50,fine,t1\\WObj:=wSet; ! stay\nwSet:=w2;\nMoveL p2,v50,fine,t1\\WObj:=w1; ! edit\nIF di1=1 GOTO again;",
        "",
    );
    check(
        "rJump;\nMoveL p1,v50,fine,t1\\WObj:=w1; ! edit",
        "PROC rJump()\nn:=0;\nagain:\nn:=n+1;\nIF n<3 GOTO again;\nENDPROC",
    );
}

#[test]
fn numbers_that_others_use_under_other_frames_stay() {
    let main = "MoveL p1,v50,fine,t1\\WObj:=w1; ! stay\nMoveL p2,v50,fine,t1\\WObj:=w1; ! edit";
    check(main, "TRAP tr\nMoveL p1,v50,fine,t2\\WObj:=w2; ! stay\nENDTRAP");
    check(main, "PROC rSpare()\nMoveL p1,v50,fine,t2\\WObj:=w2; ! stay\nENDPROC");
    check(main, "FUNC num f()\nMoveL p1,v50,fine,t2\\WObj:=w2; ! stay\nRETURN 1;\nENDFUNC");
    check(&format!("{main}\nERROR\nMoveL p1,v50,fine,t2\\WObj:=w2; ! stay\nTRYNEXT;"), "");
    // Under the same frames the motion of an operator's own routine moves with the target.
    check("MoveL p1,v50,fine,t1\\WObj:=w1; ! edit", "PROC rSpare()\nMoveL p1,v50,fine,t1\\WObj:=w1;\nENDPROC");
    check(
        "nIn:=ReadNum(dev);\nMoveL pa{nIn},v50,fine,t2\\WObj:=w2; ! stay\nMoveL pa{2},v50,fine,t1\\WObj:=w1; ! stay",
        "",
    );
    // A routine that a trap calls as well.
    check(
        "rAway;\nMoveL p1,v50,fine,t1\\WObj:=w1; ! edit",
        "TRAP tr\nrAway;\nENDTRAP\nPROC rAway()\nMoveL p3,v50,fine,t1\\WObj:=w1; ! stay\nENDPROC",
    );
}

#[test]
fn offsets_that_disagree_leave_their_base_alone() {
    check(
        "rTo w1;\nrTo w2;\nMoveL p1,v50,fine,t1\\WObj:=w1; ! stay\nMoveL p2,v50,fine,t1\\WObj:=w1; ! edit",
        "PROC rTo(PERS wobjdata w)\nMoveL Offs(p1,0,0,50),v50,fine,t1\\WObj:=w; ! stay\nENDPROC",
    );
    check(
        "rTo p1;\nrTo p2;",
        "PROC rTo(robtarget p)\nMoveL Offs(p,0,0,50),v50,fine,t1\\WObj:=w1; ! edit\nMoveL p,v50,fine,t1\\WObj:=w1; ! edit\nENDPROC",
    );
    // A round whose frame is not known holds the offset too.
    check(
        "FOR i FROM 1 TO 2 DO\nMoveL Offs(@,0,5,0),v50,fine,t1\\WObj:=wArr{1}; ! stay\nIF di1=1 wArr{1}.oframe.trans.z:=12;\nENDFOR",
        "",
    );
    // A round whose base or turn is not known holds it as well.
    check(
        "n:=1;\nrTo;\nrElsewhere;\nrTo;",
        "PROC rTo()\nMoveL Offs(pa{n},0,5,0),v50,fine,t1\\WObj:=w1; ! stay\nENDPROC",
    );
    check(
        "n:=1;\nrTo;\nrElsewhere;\nrTo;",
        "PROC rTo()\nMoveL RelTool(p1,0,5,0\\Rz:=n),v50,fine,t1\\WObj:=w1; ! stay\nENDPROC",
    );
    // An arc moves as a whole.
    check(
        "MoveL p1,v50,fine,t1\\WObj:=w1; ! edit\nMoveC p2,p3,v50,fine,t1\\WObj:=w1; ! stay\nMoveL p2,v50,fine,t2\\WObj:=w2; ! stay",
        "",
    );
}

#[test]
fn offsets_of_offsets_follow_what_they_are_made_from() {
    check(
        "rTo Offs(p1,10,0,0);",
        "PROC rTo(robtarget p)\nMoveL p,v50,fine,t1\\WObj:=w1; ! edit\nMoveL Offs(p,0,5,0),v50,fine,t2\\WObj:=w2; ! edit\nENDPROC",
    );
    // The same numbers, of which two motions want different values.
    check(
        "rTo Offs(p1,10,0,0);",
        "PROC rTo(robtarget p)\nMoveL p,v50,fine,t1\\WObj:=w1; ! stay\nMoveL Offs(p,0,5,0),v50,fine,t2\\WObj:=w2; ! edit\nMoveL p,v50,fine,t2\\WObj:=w2; ! stay\nENDPROC",
    );
}

#[test]
fn an_air_move_that_goes_along_with_its_base_says_so() {
    let cell = Cell::read(&Source::new("cell.toml", TURNING.as_bytes())).unwrap();
    let target = |name: &str, x: f64| {
        format!("CONST robtarget {name}:=[[{x},70,100],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\n")
    };
    // 50 mm above its base in the work object, and in the axes of the tool, which turn with the base.
    for (above, turns) in [("Offs(p1,0,0,50)", false), ("RelTool(p1,0,0,-50)", true)] {
        let program = read(&format!(
            "MODULE M\n{}PERS tooldata t1:=[TRUE,[[0,0,200],[1,0,0,0]],[5,[0,0,80],[1,0,0,0],0,0,0]];
            PERS wobjdata w1:=[FALSE,TRUE,\"\",[[1200,100,600],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
            PROC main()\nMoveL p1,v50,fine,t1\\WObj:=w1;\nMoveJ {above},v50,fine,t1\\WObj:=w1;
            MoveJ p3,v50,fine,t1\\WObj:=w1;\nENDPROC\nENDMODULE\n",
            target("p1", 120.0) + &target("p3", 160.0)
        ));
        let rows = deflex::correct::compensate(&program, &cell, &Options::default()).unwrap().rows;
        let norm = |v: [f64; 3]| v.iter().map(|c| c * c).sum::<f64>().sqrt();
        let [cut, above, far] = &rows[..] else { panic!("three rows") };
        assert!(norm(cut.correction_mm) > 0.1 && norm(cut.correction_deg) > 0.01);
        assert_eq!((above.status, far.status), (Status::Air, Status::Air));
        assert!(above.goes_along && !far.goes_along, "{rows:?}");
        assert!((norm(above.correction_deg) - norm(cut.correction_deg)).abs() < 1e-4, "{above:?}");
        let apart = norm(std::array::from_fn(|i| above.correction_mm[i] - cut.correction_mm[i]));
        let lever = 50.0 * norm(cut.correction_deg).to_radians();
        assert_eq!(apart > 1e-3, turns, "{above:?} {cut:?}");
        assert!(apart < lever + 1e-3, "{apart} {lever}");
        assert!(norm(far.correction_mm) < 1e-9 && norm(far.correction_deg) < 1e-9);
    }
}

#[test]
fn what_a_raise_leads_to_is_read_on() {
    check("RAISE 5;\nMoveL p1,v50,fine,t1\\WObj:=w1; ! edit\nERROR\nTRYNEXT;", "");
    check(
        "rTry;\nMoveL p1,v50,fine,t1\\WObj:=w1; ! edit",
        "PROC rTry()\nRAISE 5;\nMoveL p2,v50,fine,t1\\WObj:=w1; ! stay\nERROR\nRETURN;\nENDPROC",
    );
    check(
        "rTry;\nMoveL p1,v50,fine,t1\\WObj:=w1; ! edit\nERROR\nTRYNEXT;",
        "PROC rTry()\nIF di1=1 RAISE 5;\nMoveL p2,v50,fine,t1\\WObj:=w1; ! edit\nENDPROC",
    );
    check("RAISE 5;\nMoveL p1,v50,fine,t1\\WObj:=w1; ! stay", "");
}

/// An element by a counter is no name to give a clone: it means other elements too.
#[test]
fn clones_take_no_others_place() {
    let text = module(
        "FOR i FROM 1 TO 2 DO\nMoveL pa{i},v50,fine,t1\\WObj:=w1;\nENDFOR\nMoveL pa{1},v50,fine,t1\\WObj:=w2;\nMoveL pa{2},v50,fine,t1\\WObj:=w2;",
        "",
    );
    fates(&text, true);
}

#[test]
fn many_frames_are_distinguished() {
    // More than a saturated index would tell apart.
    let text = "MODULE M\nVAR wobjdata w:=[FALSE,TRUE,\"\",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\nPROC main()\nFOR i FROM 1 TO 3000 DO\nw.uframe.trans.x:=i;\nMoveL [[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v50,fine,tool0\\WObj:=w;\nENDFOR\nENDPROC\nENDMODULE\n";
    assert_eq!(read(text).wobjs.len(), 3000);
    let more = text.replace("3000", "66000");
    let errors = rapid::read(vec![Source::new("m.mod", more)], Vec::new()).unwrap_err();
    assert_eq!((errors[0].code, errors[0].line), ("rapid.frames", 6));
}

#[test]
fn a_routine_that_always_calls_itself_takes_no_more_memory_than_it_has_targets() {
    check(
        "MoveL p1,v50,fine,t1\\WObj:=w1; ! edit",
        "PROC rAgain()\nWHILE di1=1 DO\nMoveL p3,v50,fine,t1\\WObj:=w1; ! stay\nENDWHILE\nIF n<5 THEN\nrAgain;\nENDIF\nENDPROC",
    );
}

#[test]
fn what_no_controller_runs_is_refused_with_its_line() {
    let refused = |body: &str, data: &str| {
        let text = format!("MODULE M\n{data}\nPROC main()\n{body}\nENDPROC\nENDMODULE\n");
        let errors = rapid::read(vec![Source::new("m.mod", text)], Vec::new()).unwrap_err();
        (errors[0].code, errors[0].line)
    };
    assert_eq!(
        refused("WHILE TRUE DO\ns:=\"x\";\nFOR i FROM 1 TO 30 DO\ns:=s+s;\nENDFOR\nENDWHILE", "VAR string s:=\"ab\";"),
        ("rapid.text-length", 7)
    );
    assert_eq!(refused("FOR i FROM 1 TO 40 DO\nq:=[q,q];\nENDFOR", "VAR num q:=1;"), ("rapid.size", 5));
}

#[test]
fn orientations_that_are_none_are_faults() {
    for (data, target) in [
        ("", "[[1,2,3],[1,0.1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"),
        ("PERS wobjdata w1:=[FALSE,TRUE,\"\",[[0,0,0],[1,0,0.1,0]],[[0,0,0],[1,0,0,0]]];", INLINE),
    ] {
        let text =
            format!("MODULE M\n{data}\nPROC main()\nMoveL {target},v50,fine,tool0\\WObj:=w1;\nENDPROC\nENDMODULE\n");
        let faults = read(&text).faults();
        assert_eq!((faults.len(), faults[0].line), (1, 4), "{faults:?}");
    }
    // Three decimals are a matter of printing.
    let text = "MODULE M\nPROC main()\nMoveL [[1,2,3],[0.707,0,0.707,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v50,fine,tool0;\nENDPROC\nENDMODULE\n";
    assert!(read(text).faults().is_empty());
}

#[test]
fn what_is_said_agrees_with_what_is_counted() {
    let program = read(&module(
        "wSet.oframe.trans.z:=ReadNum(dev);\nMoveL p1,v50,fine,t1\\WObj:=wSet;\nMoveL p2,v50,fine,t1\\WObj:=w1;",
        "PROC rSpare()\nMoveL p3,v50,fine,t1;\nENDPROC",
    ));
    assert_eq!(program.motion_targets(), 2);
    assert_eq!(program.unknown_targets(), [(Reason::WorkObject, 1)]);
    let kept: Vec<Reason> = program.kept.iter().map(|kept| kept.reason).collect();
    assert_eq!(kept, [Reason::WorkObject, Reason::NotRun]);
    assert!(program.diagnostics.iter().any(|d| d.code == "rapid.not-run"), "{:?}", program.diagnostics);
    assert!(program.diagnostics.iter().any(|d| d.code == "rapid.frame" && d.message.contains("`wSet`")));
}

/// Offsets and declarations that motions use which are not edited, by another name or in another call of the routine.
#[test]
fn what_is_used_by_another_name_stays() {
    let data = "CONST robtarget p0:=[[40,70,130],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\nCONST robtarget pc:=p0;\n\
                VAR robtarget q1:=[[160,0,130],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\n\
                VAR robtarget q2:=[[80,0,115],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\nVAR num n:=2;\nVAR num r;\n";
    let text =
        |main: &str, routines: &str| format!("MODULE M\n{data}PROC main()\n{main}\nENDPROC\n{routines}\nENDMODULE\n");
    let in_function = text(
        "MoveL p0,v50,fine,tool0;\nr:=f();",
        "FUNC num f()\nMoveL pc,v50,fine,tool0\\WObj:=wobj1;\nRETURN 1;\nENDFUNC",
    );
    let again = text(
        "r1 q2;\nq1:=p0;",
        "PROC r1(INOUT robtarget q)\nMoveL Offs(q,10,0,0),v50,fine,tool0;\nIncr n;\nIF n<5 THEN\nr1 q1;\nENDIF\nENDPROC",
    );
    for text in [in_function, again] {
        let all = fates(&text, false);
        assert!(!all.is_empty() && all.values().all(Result::is_err), "{all:?}");
    }
}

/// Numbers of every base are what they are: none counts as 0 because it is not decimal.
#[test]
#[allow(clippy::float_cmp)] // numbers that are printed or given, to the bit
fn numbers_that_are_not_decimal_are_written_as_they_are() {
    let text = format!(
        "MODULE M\n{DATA}CONST robtarget pH:=[[0x0A,-0b11,0o5],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\n\
         PROC main()\nMoveL Offs(pH,0x01,0,5),v50,fine,t1;\nENDPROC\nENDMODULE\n"
    );
    let program = read(&text);
    assert_eq!(position(&program.targets[0].goal), [11.0, -3.0, 10.0]);
    let change = Change { position_mm: [11.25, -3.0, 10.5], quat: None, conf: None, external: None };
    let rewritten = program.rewrite(&[Some(change)], &[], &RewriteOptions::default());
    assert_eq!(rewritten.written[0].0, [11.25, -3.0, 10.5]);
    let out = applied(text.as_bytes(), &rewritten.edits[0]);
    let back = read(&String::from_utf8(out).unwrap());
    assert_eq!(position(&back.targets[0].goal), [11.25, -3.0, 10.5]);
}

/// Whoever starts a procedure finds frames as the text has them, and not as another procedure left them. All other data may have any value.
#[test]
#[allow(clippy::float_cmp)] // numbers that are printed or given, to the bit
fn procedures_that_nothing_calls_begin_with_the_text() {
    for main in ["", "PROC main()\nnI:=7;\nENDPROC\n"] {
        let text = format!(
            "MODULE M\n{DATA}VAR num nI:=0;\n{main}PROC a()\nnI:=nI+5;\nw1.oframe.trans.x:=5;\nPDispSet [[100,0,0],[1,0,0,0]];\n\
             MoveL p1,v50,fine,t1\\WObj:=w1;\nENDPROC\n\
             PROC b()\nMoveL p2,v50,fine,t1\\WObj:=w1;\nMoveL Offs(p2,nI,0,0),v50,fine,t1;\nENDPROC\nENDMODULE\n"
        );
        let program = read(&text);
        let last = program.targets.last().unwrap();
        assert_eq!(position(&last.goal), [10.0, 20.0, 30.0], "{:?}", program.kept);
        assert_eq!(program.wobjs[usize::from(last.wobj)].data.unwrap().oframe_mm, [0.0; 3]);
        assert!(last.located);
        assert_eq!(program.unknown.len(), 1);
    }
}

/// Errors of the additional actions of a motion go to the handler, and so does a stop that a program waits for.
#[test]
fn motions_that_do_more_than_move_may_fail() {
    let reads = |motion: &str, handler: &str| {
        let text = format!(
            "MODULE M\n{DATA}VAR triggdata tr1;\nPROC main()\n{motion}\nMoveL [[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v50,fine,t1;\n\
             ERROR\n{handler}\nENDPROC\nPROC pX()\nENDPROC\nENDMODULE\n"
        );
        let program = read(&text);
        program.targets.last().unwrap().editable
    };
    let moved = "PDispSet [[100,0,0],[1,0,0,0]];\nTRYNEXT;";
    let to = "[[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]";
    for motion in [
        format!("TriggL {to},v50,tr1,fine,t1;"),
        format!("MoveLDO {to},v50,fine,t1,do1,1;"),
        format!("MoveLSync {to},v50,fine,t1,\"pX\";"),
    ] {
        assert!(matches!(reads(&motion, moved), Editable::No(_)), "{motion}");
    }
    let plain = format!("MoveL {to},v50,fine,t1;");
    assert!(!matches!(reads(&plain, moved), Editable::No(_)));
    let waits = format!("IF ERRNO=ERR_COLL_STOP THEN\n{moved}\nENDIF");
    assert!(matches!(reads(&plain, &waits), Editable::No(_)));
}

/// A routine that nothing runs stays in place, what it makes from a target of the program too.
#[test]
fn offsets_in_procedures_that_nothing_runs_stay_in_place() {
    let corrected = |to: &str| {
        let text = format!(
            "MODULE M\n{DATA}PROC main()\nMoveL p1,v50,fine,t1;\nENDPROC\nPROC b()\nMoveL {to},v50,fine,t1;\nENDPROC\nENDMODULE\n"
        );
        let program = read(&text);
        let change = Change { position_mm: [1.25, 2.0, 3.0], quat: None, conf: None, external: None };
        let edits = &program.rewrite(&[Some(change)], &[], &RewriteOptions::default()).edits[0];
        String::from_utf8(applied(&program.sources[0].bytes, edits)).unwrap()
    };
    for (to, new) in [
        ("p1", "MoveL p1,"),
        ("Offs(p1,0,0,50)", "MoveL Offs(p1,-0.2500,0,50),"),
        ("RelTool(p1,0,0,-50)", "MoveL RelTool(p1,-0.2500,0,-50),"),
    ] {
        let text = corrected(to);
        assert!(text.contains("p1:=[[1.2500,2,3]") && text.contains(new), "{text}");
    }
    assert!(corrected("Offs(p1,0,0,n)").contains("p1:=[[1,2,3]"));
}

/// A speed that the counter of a loop selects is that of its round.
#[test]
fn each_round_has_its_own_speed() {
    let text = module("FOR i FROM 1 TO 3 DO\nMoveL p1,vArr{i},fine,t1\\WObj:=w1;\nENDFOR", "");
    let speeds = "VAR speeddata vArr{3}:=[[10,500,5000,1000],[20,500,5000,1000],[30,500,5000,1000]];";
    let program = read(&text.replacen("VAR num nIn;", speeds, 1));
    let feeds: Vec<_> = program.targets.iter().map(|target| target.feed_mm_s).collect();
    assert_eq!(feeds, [Some(10.0), Some(20.0), Some(30.0)]);
}

/// Jumps are followed, and a loop keeps what all of its rounds agree on.
#[test]
fn jumps_and_unknown_loops_keep_what_all_paths_agree_on() {
    check("GOTO over;\nPDispSet [[1,0,0],[1,0,0,0]];\nover:\nMoveL p1,v50,fine,t1\\WObj:=w1; ! edit", "");
    check("n:=1;\nWHILE di1=1 DO\nn:=1;\nMoveL p1,v50,fine,t1\\WObj:=wFix{n}; ! edit\nENDWHILE", "");
    check("n:=1;\nWHILE di1=1 DO\nMoveL p1,v50,fine,t1\\WObj:=wFix{n}; ! stay\nn:=2;\nENDWHILE", "");
}

/// What a program waits for, something else changes: the statements after it are reached.
#[test]
fn data_that_a_program_waits_for_are_unknown_after_it() {
    let cases = "TEST n\nCASE 1:\nMoveL p1,v50,fine,t1\\WObj:=w1; ! edit\nDEFAULT:\nMoveL p2,v50,fine,t1\\WObj:=w1; ! edit\nENDTEST";
    check(&format!("n:=0;\nWHILE n=0 DO\nWaitTime 0.1;\nENDWHILE\n{cases}"), "");
    check(&format!("n:=0;\nWaitUntil n<>0;\n{cases}"), "");
    check(
        &format!("n:=0;\n{}", cases.replace("p1,v50,fine,t1\\WObj:=w1; ! edit", "p1,v50,fine,t1\\WObj:=w1; ! stay")),
        "",
    );
}

/// The value of a PERS that the text does not give may be anything.
#[test]
fn a_pers_without_a_value_is_unknown() {
    let text = module("MoveL p1,v50,fine,t1\\WObj:=wFix{nElse+1}; ! stay", "");
    check_text(&text.replacen("VAR num nIn;", "PERS num nElse;", 1));
}

/// A program without an end is refused without running through all that is allowed.
#[test]
fn a_program_without_an_end_is_refused_soon() {
    let text = format!(
        "MODULE M\n{DATA}PROC main()\n\
         FOR i FROM 1 TO 100000 DO\nFOR j FROM 1 TO 100000 DO\nMoveL p1,v50,fine,t1;\nENDFOR\nENDFOR\nENDPROC\nENDMODULE\n"
    );
    let began = std::time::Instant::now();
    let source = Source::new("m.mod", text.into_bytes());
    assert!(rapid::Executed::read(vec![source], Vec::new()).is_err());
    // Twenty million motions take half a minute.
    assert!(began.elapsed().as_secs() < 10);
}

/// A statement may have any number of arguments, and may change all of them; after one that is not understood, anything may have changed.
#[test]
fn statements_that_are_long_or_not_understood_change_what_they_may() {
    let many = "0,".repeat(24);
    check(
        &format!(
            "MoveL p1,v50,fine,t1; ! edit
Give {many}n;
MoveL Offs(p2,0,0,n),v50,fine,t1; ! stay"
        ),
        &format!(
            "PROC Give({}INOUT num last)\nlast:=DInput(di1);\nENDPROC",
            (0..24).map(|i| format!("num a{i},")).collect::<String>()
        ),
    );
    check(
        "MoveL p1,v50,fine,t1\\WObj:=w1; ! edit
Give \\:=1;
MoveL p2,v50,fine,t1\\WObj:=w1; ! stay",
        "",
    );
}

/// Brackets around an argument, or around a condition, make no call of a function.
#[test]
fn brackets_call_nothing() {
    check(
        "WHILE n<3 DO
WaitTime(1);
IF (nIn=1) SetDO do1,(1);
MoveL p1,v50,fine,t1\\WObj:=w1; ! edit
n:=n+(1);
ENDWHILE
MoveL p2,v50,fine,t1\\WObj:=w1; ! edit",
        "",
    );
    check(
        "WHILE DInput(di1)=1 DO
WaitTime(1);
MoveL p1,v50,fine,t1\\WObj:=w1; ! edit
ENDWHILE",
        "TRAP tr
WaitTime(1);
ENDTRAP",
    );
}

#[test]
fn motions_in_step_with_another_robot_keep_their_frames() {
    check(
        "VAR syncident on;
SyncMoveOn on,tasks;
MoveL p1\\ID:=10,v50,fine,t1\\WObj:=w1; ! edit
SyncMoveOff on;
MoveL p2,v50,fine,t1\\WObj:=w1; ! edit",
        "",
    );
}
