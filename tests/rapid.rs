//! RAPID in and out: targets by hand, edits on number tokens only, nothing lost and nothing panics.

#![allow(clippy::unwrap_used)] // helpers of tests

use deflex::program::{Change, Editable, Goal, Insert, Program, RewriteOptions, Role, rapid, round_trip};
use deflex::text::{Source, apply};
use proptest::prelude::*;

const HEAD: &str = "MODULE M\r\n  PERS tooldata t1:=[TRUE,[[0,0,200],[1,0,0,0]],[5,[0,0,80],[1,0,0,0],0,0,0]];\r\n";
const EXT: &str = "[9E9,9E9,9E9,9E9,9E9,9E9]";

fn read(text: &str) -> Program {
    rapid::read(vec![Source::new("m.mod", text.as_bytes())], Vec::new()).unwrap_or_else(|errors| panic!("{errors:?}"))
}

fn module(data: &str, body: &str) -> String {
    format!("{HEAD}{data}\r\n  PROC main()\r\n{body}\r\n  ENDPROC\r\nENDMODULE\r\n")
}

fn positions(program: &Program) -> Vec<[f64; 3]> {
    let of = |goal: &Goal| match goal {
        Goal::Pose { position_mm, .. } | Goal::Axis { position_mm, .. } => *position_mm,
        Goal::Joints { deg } => [deg[0], deg[1], deg[2]],
    };
    program.targets.iter().map(|t| of(&t.goal)).collect()
}

fn written(program: &Program, changes: &[Option<Change>], inserts: &[Insert], clones: bool) -> (String, Vec<usize>) {
    let options = RewriteOptions { allow_clones: clones, ..RewriteOptions::default() };
    let rewritten = program.rewrite(changes, inserts, &options);
    let mut out = Vec::new();
    apply(&program.sources[0].bytes, &rewritten.edits[0], &mut out).unwrap();
    (String::from_utf8(out).unwrap(), rewritten.kept.iter().map(|k| k.0).collect())
}

fn to(position_mm: [f64; 3]) -> Option<Change> {
    Some(Change { position_mm, quat: None, conf: None })
}

#[test]
fn declared_inline_array_offs_and_reltool_targets() {
    let data = format!(
        "  CONST robtarget p1:=[[1,2,3],[0,1,0,0],[0,0,0,0],{EXT}];\r\n  CONST robtarget a{{2}}:=[[[4,5,6],[1,0,0,0],[0,0,0,0],{EXT}],[[7,8,9],[1,0,0,0],[0,0,0,0],{EXT}]];"
    );
    let body = format!(
        "    MoveL p1,v20,z1,t1;\r\n    MoveL a{{2}},v20,z1,t1;\r\n    MoveL Offs(p1,10,0,-1),v20,fine,t1;\r\n    MoveL RelTool(p1,0,0,5),v20,z1,t1;\r\n    MOVEL [[-1.5,.5,- 2],[1,0,0,0],[0,0,0,0],{EXT}],vmax,z1,t1;\r\n    MoveAbsJ [[10,20,30,0,0,0],{EXT}],v100,fine,t1;"
    );
    let program = read(&module(&data, &body));
    // The tool of p1 looks down (half a turn about x), so that 5 mm along its z is 5 mm down.
    let expected = [[1., 2., 3.], [7., 8., 9.], [11., 2., 2.], [1., 2., -2.], [-1.5, 0.5, -2.], [10., 20., 30.]];
    assert_eq!(positions(&program), expected);
    assert_eq!(program.literal_targets, 4);
    assert_eq!(program.targets[0].feed_mm_s, Some(20.0));
    assert_eq!(program.targets[4].feed_mm_s, None);
    assert_eq!(program.targets[2].editable, Editable::Position);
    assert_eq!(program.targets[5].editable, Editable::No("joint target"));
    assert_eq!(program.targets[0].name.as_deref(), Some("p1"));
}

#[test]
fn loops_calls_arcs_and_run_time_targets() {
    let data = format!(
        "  CONST robtarget p1:=[[0,0,0],[1,0,0,0],[0,0,0,0],{EXT}];\r\n  VAR robtarget moving:=[[9,9,9],[1,0,0,0],[0,0,0,0],{EXT}];"
    );
    let body = "    FOR i FROM 1 TO 3 DO\r\n      MoveL Offs(p1,i*10,0,0),v20,z1,t1;\r\n    ENDFOR\r\n    part;\r\n    moving.trans.z:=measured();\r\n    MoveL moving,v20,z1,t1;\r\n    MoveC Offs(p1,1,1,0),p1,v20,z1,t1;\r\n  ENDPROC\r\n  PROC part()\r\n    ! deflex air\r\n    MoveL p1,v20,z1,t1;\r\n    ! deflex cut";
    let program = read(&module(&data, body));
    let expected = [[10., 0., 0.], [20., 0., 0.], [30., 0., 0.], [0., 0., 0.], [1., 1., 0.], [0., 0., 0.]];
    assert_eq!(positions(&program), expected);
    let ordinals: Vec<u32> = program.targets.iter().map(|t| t.ordinal).collect();
    assert_eq!(ordinals, [1, 2, 3, 4, 6, 6], "the run-time target is the fifth motion, the arc the sixth");
    assert_eq!(program.targets[4].role, Role::Via);
    assert_eq!(program.arcs, 1);
    assert!(
        program.kept.iter().any(|k| k.reason == "target computed at run time" && k.line == 11),
        "{:?}",
        program.kept
    );
    assert_eq!(program.targets[3].mark, Some(deflex::program::Mark::Air));
}

#[test]
fn only_number_tokens_change() {
    let body = format!("    MoveL [[1.00, -2.5 ,3],[0.0,1.0,0.0,0.0],[0,0,0,0],{EXT}],v20,z1,t1; ! keep me");
    let text = module("", &body);
    let program = read(&text);
    let (out, kept) = written(&program, &[to([1.00004, -2.5, 3.12345])], &[], false);
    assert!(kept.is_empty());
    // 1.00004 prints as 1.0000, which is the same number: no edit.
    assert_eq!(out, text.replace("3],[0.0", "3.1234],[0.0").replace("3.1234],[0.0", &format!("{:.4}],[0.0", 3.12345)));
    let (same, _) = written(&program, &[None], &[], false);
    assert_eq!(same, text);
}

#[test]
fn shared_targets_are_kept_or_cloned() {
    let data = format!("  CONST robtarget p1:=[[1,2,3],[1,0,0,0],[0,0,0,0],{EXT}];");
    let program = read(&module(&data, "    MoveL p1,v20,z1,t1;\r\n    MoveL p1,v50,z1,t1;"));
    let changes = [to([1.1, 2.0, 3.0]), to([1.2, 2.0, 3.0])];
    let (_, kept) = written(&program, &changes, &[], false);
    assert_eq!(kept, [0, 1]);
    let (text, kept) = written(&program, &changes, &[], true);
    assert!(kept.is_empty());
    assert_eq!(positions(&read(&text)), [[1.1, 2.0, 3.0], [1.2, 2.0, 3.0]]);
    let (text, kept) = written(&program, &[to([1.1, 2.0, 3.0]), to([1.1, 2.0, 3.0])], &[], false);
    assert!(kept.is_empty());
    assert_eq!(positions(&read(&text)), [[1.1, 2.0, 3.0], [1.1, 2.0, 3.0]]);
}

#[test]
fn inserted_points_fly_by_and_the_stop_stays_last() {
    let body = format!(
        "    MoveL [[0,0,0],[1,0,0,0],[0,0,0,0],{EXT}],v20,z1,t1;\r\n    MoveL [[10,0,0],[1,0,0,0],[0,0,0,0],{EXT}],v20,fine,t1;"
    );
    let program = read(&module("", &body));
    let insert = Insert { before: 1, position_mm: [5.0, 0.0, 0.25], quat: [1.0, 0.0, 0.0, 0.0] };
    let (text, _) = written(&program, &[None, None], &[insert], false);
    assert_eq!(positions(&read(&text)), [[0., 0., 0.], [5., 0., 0.25], [10., 0., 0.]]);
    assert_eq!(text.matches("fine").count(), 1);
}

#[test]
fn refusals_say_why() {
    let refused = |bytes: &[u8]| rapid::read(vec![Source::new("m.mod", bytes)], Vec::new()).unwrap_err()[0].code;
    assert_eq!(refused(&[0xFC, 1, 2, 3, 0x80, 0x90, 7, 8]), "rapid.encrypted");
    assert_eq!(refused(b"hello world"), "rapid.no-module");
    assert_eq!(refused(b"MODULE M\nPROC main()\nMoveL [[1,2,"), "rapid.truncated");
}

fn pieces() -> impl Strategy<Value = String> {
    let words = [
        "MODULE M ",
        "ENDMODULE ",
        "PROC main() ",
        "ENDPROC ",
        "MoveL ",
        "MoveC ",
        "p1",
        ",",
        ";",
        "[",
        "]",
        "(",
        ")",
        "{",
        "}",
        "\\WObj:=w ",
        ":=",
        "[[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]",
        "v20,z1,tool0;",
        "FOR i FROM 1 TO 3 DO ",
        "ENDFOR ",
        "IF a THEN ",
        "ENDIF ",
        "CONST robtarget p1:=",
        "PERS tooldata t:=",
        "Offs(p1,1,2,3)",
        "! note\n",
        "\"text\" ",
        "%\"p\"% ",
        "-",
        "1.5",
        "9E+09",
        "\r\n",
        "\u{e9}",
        ".",
        "TEST x ",
        "CASE 1: ",
    ];
    prop::collection::vec(prop::sample::select(words.to_vec()), 0..60).prop_map(|parts| parts.concat())
}

proptest! {
    #[test]
    fn random_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        let _ = rapid::read(vec![Source::new("x", bytes)], Vec::new());
    }

    #[test]
    fn whatever_is_read_comes_out_as_it_went_in(text in pieces()) {
        let text = format!("MODULE M\n{text}\nENDMODULE\nENDMODULE\n");
        if let Ok(program) = rapid::read(vec![Source::new("x", text.as_bytes())], Vec::new()) {
            let trip = round_trip(&program, rapid::read);
            prop_assert!(trip.identical);
        }
    }
}
