//! RAPID in and out: targets by hand, edits on number tokens only, nothing lost and nothing panics.

use super::writing::to;
use deflex::program::{Change, Conf, Editable, Goal, Insert, Program, Reason, RewriteOptions, Role, rapid, round_trip};
use deflex::text::{Diagnostic, Source, applied};
use proptest::prelude::*;
use std::fmt::Write;

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
    let out = applied(&program.sources[0].bytes, &rewritten.edits[0]);
    (String::from_utf8(out).unwrap(), rewritten.kept.iter().map(|k| k.0).collect())
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
    assert_eq!(program.targets[5].editable, Editable::No(Reason::Joints));
    assert_eq!(program.targets[0].name.as_deref(), Some("p1"));
}

#[test]
fn loops_calls_arcs_and_run_time_targets() {
    let data = format!(
        "  CONST robtarget p1:=[[0,0,0],[1,0,0,0],[0,0,0,0],{EXT}];\r\n  VAR robtarget moving:=[[9,9,9],[1,0,0,0],[0,0,0,0],{EXT}];"
    );
    let body = "    FOR i FROM 1 TO 3 DO\r\n      MoveL Offs(p1,i*10,0,0),v20,z1,t1;\r\n    ENDFOR\r\n    part;\r\n    moving.trans.z:=ReadNum(device);\r\n    MoveL moving,v20,z1,t1;\r\n    MoveC Offs(p1,1,1,0),p1,v20,z1,t1;\r\n  ENDPROC\r\n  PROC part()\r\n    ! deflex air\r\n    MoveL p1,v20,z1,t1;\r\n    ! deflex cut";
    let program = read(&module(&data, body));
    let expected = [[10., 0., 0.], [20., 0., 0.], [30., 0., 0.], [0., 0., 0.], [1., 1., 0.], [0., 0., 0.]];
    assert_eq!(positions(&program), expected);
    let ordinals: Vec<u32> = program.targets.iter().map(|t| t.ordinal).collect();
    assert_eq!(ordinals, [1, 2, 3, 4, 6, 6], "the run-time target is the fifth motion, the arc the sixth");
    assert_eq!(program.targets[4].role, Role::Via);
    assert_eq!(program.arcs, 1);
    assert!(program.kept.iter().any(|k| k.reason == Reason::TargetChanged && k.line == 11), "{:?}", program.kept);
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
    let insert = Insert::line(1, ([5.0, 0.0, 0.25], [1.0, 0.0, 0.0, 0.0]), 5.0);
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

fn chunks() -> impl Strategy<Value = String> {
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

/// One line a target, one a kept statement.
fn render(program: &Program) -> String {
    let mut out = String::new();
    let mut line = |text: String| writeln!(out, "{text}").unwrap();
    line(format!(
        "{}: {} motions, {} literal, {} arcs",
        program.dialect,
        program.motion_targets(),
        program.literal_targets,
        program.arcs
    ));
    for t in &program.targets {
        let (numbers, conf) = match t.goal {
            Goal::Pose { position_mm: p, quat: q, conf } => ([&p[..], &q].concat(), conf),
            Goal::Axis { position_mm: p, axis, .. } => ([p, axis].concat(), None),
            Goal::Joints { deg } => (deg.to_vec(), None),
        };
        let numbers: Vec<String> = numbers.iter().map(|v| format!("{:.4}", v + 0.0)).collect();
        let conf = match conf {
            Some(Conf::Quarters(c)) => format!(" conf {} {} {} {}", c.cf1, c.cf4, c.cf6, c.cfx),
            _ => String::new(),
        };
        let feed = t.feed_mm_s.map_or(String::new(), |f| format!(" {f:.3} mm/s"));
        let role = if t.role == Role::End { "" } else { " via" };
        let (tool, wobj) = (&program.tools[t.tool as usize], &program.wobjs[t.wobj as usize]);
        let name = t.name.as_deref().unwrap_or("-");
        line(format!(
            "{}{role} line {} {:?} {name}: {}{conf}{feed} {} {} {:?}",
            t.ordinal,
            t.line,
            t.motion,
            numbers.join(" "),
            tool.name,
            wobj.name,
            t.editable
        ));
    }
    for tool in &program.tools {
        line(format!("tool {} {:?}", tool.name, tool.data.map(|d| (d.robhold, d.tcp_mm, d.mass_kg))));
    }
    for wobj in &program.wobjs {
        line(format!("wobj {} {:?}", wobj.name, wobj.data.map(|d| (d.robhold, d.fixed, d.uframe_mm))));
    }
    for kept in &program.kept {
        line(format!("kept line {}: {}", kept.line, kept.reason));
    }
    for diagnostic in &program.diagnostics {
        line(diagnostic.to_string());
    }
    out
}

#[test]
fn valid_fixtures_read_as_they_should_and_survive_a_write() {
    insta::glob!("../..", "fixtures/rapid/valid/*", |path| {
        let name = path.file_name().unwrap().to_string_lossy();
        let program = rapid::read(vec![Source::new(name, std::fs::read(path).unwrap())], Vec::new()).unwrap();
        let trip = round_trip(&program, rapid::read);
        assert!(trip.holds(), "{trip:?}");
        insta::assert_snapshot!(render(&program));
    });
}

#[test]
fn invalid_fixtures_are_refused_with_a_reason() {
    insta::glob!("../..", "fixtures/rapid/invalid/*", |path| {
        let name = path.file_name().unwrap().to_string_lossy();
        let errors = rapid::read(vec![Source::new(name, std::fs::read(path).unwrap())], Vec::new()).unwrap_err();
        let text = |e: &Diagnostic| format!("{e}\n  help: {}", e.help.as_deref().unwrap_or("none"));
        insta::assert_snapshot!(errors.iter().map(text).collect::<Vec<_>>().join("\n"));
    });
}

#[test]
fn several_modules_are_one_program() {
    let main = "MODULE A\nPROC main()\nPath tB;\n%\"B:Late\"%;\nENDPROC\nENDMODULE\n";
    let part = format!(
        "MODULE B\nPERS tooldata tB:=[TRUE,[[0,0,9],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\nPROC Path(PERS tooldata t)\n\
         MoveL [[1,2,3],[1,0,0,0],[0,0,0,0],{EXT}],v10,z1,t\\WObj:=wC;\nENDPROC\nPROC Late()\nMoveL pC,v10,z1,tB;\nENDPROC\nENDMODULE\n"
    );
    let context = format!(
        "MODULE C\nPERS wobjdata wC:=[FALSE,TRUE,\"\",[[7,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\nCONST robtarget pC:=[[4,5,6],[1,0,0,0],[0,0,0,0],{EXT}];\nENDMODULE\n"
    );
    let source = |name: &str, text: &str| Source::new(name, text.as_bytes());
    let program =
        rapid::read(vec![source("a.mod", main), source("b.mod", &part)], vec![source("c.mod", &context)]).unwrap();
    assert_eq!(positions(&program), [[1., 2., 3.], [4., 5., 6.]]);
    assert_eq!(program.targets[0].source, 1);
    assert_eq!(program.wobjs[0].data.unwrap().uframe_mm[0].to_bits(), 7.0_f64.to_bits());
    assert_eq!(program.targets[1].editable, Editable::No(Reason::InContextFile));
    let trip = round_trip(&program, rapid::read);
    assert!(trip.holds(), "{trip:?}");
}

#[test]
fn orientation_is_renormalised_and_keeps_its_hemisphere() {
    let body = format!("    MoveL [[0,0,0],[-0.7071,0,-0.7071,0],[0,0,0,0],{EXT}],v20,z1,t1;");
    let text = module("", &body);
    let program = read(&text);
    let Goal::Pose { quat, .. } = program.targets[0].goal else { panic!("pose") };
    // The orientation that was read, in either hemisphere, is no change.
    for quat in [quat, quat.map(|c| -c)] {
        let change = Change { position_mm: [0.0; 3], quat: Some(quat), conf: None, external: None };
        assert_eq!(written(&program, &[Some(change)], &[], false).0, text);
    }
    let half = 1e-3_f64;
    let turned = [half.cos() * 0.5_f64.sqrt(), half.sin(), 0.5_f64.sqrt() * half.cos(), 0.0];
    let change = Change { position_mm: [0.0; 3], quat: Some(turned), conf: None, external: None };
    let (out, _) = written(&program, &[Some(change)], &[], false);
    assert!(out.contains("[-0.70710643,-0.00100000,-0.70710643,0]"), "{out}");
}

/// A pose's numbers as programs print them.
fn number() -> impl Strategy<Value = String> {
    (-3000.0_f64..3000.0, 0_usize..7).prop_map(|(v, d)| format!("{v:.d$}"))
}

proptest! {
    #[test]
    fn a_written_number_is_read_back_within_half_a_printed_unit(
        numbers in prop::collection::vec(number(), 3..30),
        by in prop::array::uniform3(-2.0_f64..2.0),
    ) {
        let lines: Vec<String> = numbers
            .chunks_exact(3)
            .map(|p| format!("    MoveL [[{}],[1,0,0,0],[0,0,0,0],{EXT}],v20,z1,t1;", p.join(",")))
            .collect();
        let text = module("", &lines.join("\r\n"));
        let program = read(&text);
        let wanted: Vec<[f64; 3]> =
            positions(&program).iter().map(|p| std::array::from_fn(|i| p[i] + by[i])).collect();
        let changes: Vec<_> = wanted.iter().map(|p| to(*p)).collect();
        let rewritten = program.rewrite(&changes, &[], &RewriteOptions::default());
        for pair in rewritten.edits[0].windows(2) {
            prop_assert!(pair[0].span.end <= pair[1].span.start, "edits overlap");
        }
        let (out, _) = written(&program, &changes, &[], false);
        let again = read(&out);
        for ((wanted, got), written) in wanted.iter().zip(positions(&again)).zip(&rewritten.written) {
            for i in 0..3 {
                prop_assert!((wanted[i] - got[i]).abs() <= 0.5e-4 + 1e-9);
                #[allow(clippy::cast_possible_truncation)]
                let held = f64::from(got[i] as f32);
                prop_assert!((held - written.0[i]).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn random_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        let _ = rapid::read(vec![Source::new("x", bytes)], Vec::new());
    }

    #[test]
    fn whatever_is_read_comes_out_as_it_went_in(text in chunks()) {
        let text = format!("MODULE M\n{text}\nENDMODULE\nENDMODULE\n");
        if let Ok(program) = rapid::read(vec![Source::new("x", text.as_bytes())], Vec::new()) {
            let trip = round_trip(&program, rapid::read);
            prop_assert!(trip.identical);
        }
    }
}

/// A generator that forgets the last lines: there is something to look at, and nothing to write.
#[test]
fn a_file_that_is_cut_off_may_be_looked_at() {
    let text = "MODULE M\nPROC main()\nMoveL [[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v50,fine,tool0;\n";
    let source = || vec![Source::new("cut.mod", text.as_bytes())];
    assert_eq!(rapid::read(source(), Vec::new()).unwrap_err()[0].code, "rapid.truncated");
    let program = rapid::look(source(), Vec::new()).unwrap();
    assert_eq!((program.targets.len(), program.literal_targets), (1, 1));
    assert!(program.kept.iter().any(|kept| kept.reason == Reason::FileEndsInModule && kept.line == 3));
}

/// The main loop of a production program: it counts parts, and retries what fails.
#[test]
fn an_endless_loop_with_a_counter_is_taken_once() {
    let move_to = |x: u32| format!("MoveL [[{x},0,0],[1,0,0,0],[0,0,0,0],{EXT}],v20,z1,t1;\n");
    for (before, after, handler) in
        [("nParts:=nParts+1;\n", "", "ERROR\nRETRY;\n"), ("", "nParts:=nParts+1;\nIF nParts>100 nParts:=0;\n", "")]
    {
        let body = format!("WHILE TRUE DO\n{before}{}{}{after}ENDWHILE\n{handler}", move_to(0), move_to(10));
        let program = read(&module("VAR num nParts:=0;", &body));
        assert_eq!(positions(&program), [[0., 0., 0.], [10., 0., 0.]]);
        assert!(program.diagnostics.iter().all(|d| d.code != "rapid.endless"), "{:?}", program.diagnostics);
    }
}

/// A program is not judged without the motions that could not be read.
#[test]
fn a_motion_that_is_not_read_counts_as_one_of_unknown_target() {
    let whole = format!("MoveL [[0,0,0],[1,0,0,0],[0,0,0,0],{EXT}],v20,z1,t1;\n");
    for broken in [whole.replace(",z1,t1", ",z1"), whole.replace("]],", "],"), "MoveL;\n".to_owned()] {
        let program = read(&module("", &format!("{whole}{broken}{whole}")));
        assert_eq!((program.targets.len(), program.unknown.len()), (2, 1), "{broken}");
    }
}

#[test]
fn routines_without_a_caller_that_change_what_others_use_are_named() {
    let cut = format!("PROC cut()\nMoveL [[0,0,0],[1,0,0,0],[0,0,0,0],{EXT}],v20,z1,t1\\WObj:=w;\nENDPROC\n");
    let wobj = "PERS wobjdata w:=[FALSE,TRUE,\"\",[[7,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\n";
    let warned = |other: &str| {
        let text = format!("MODULE M\n{wobj}VAR num n:=1;\n{cut}{other}ENDMODULE\n");
        let program = read(&text);
        program
            .diagnostics
            .iter()
            .filter(|d| d.code == "rapid.no-caller")
            .map(|d| d.message.clone())
            .collect::<Vec<_>>()
    };
    assert_eq!(
        warned("PROC two()\nw.oframe.trans.z:=2;\nENDPROC\n"),
        ["`cut` is corrected for the value of `w` in the text, and `two` changes it"]
    );
    // What is unknown where a procedure begins needs no order.
    assert_eq!(warned("PROC two()\nn:=2;\nENDPROC\nPROC three()\nIF n=1 cut;\nENDPROC\n"), Vec::<String>::new());
    assert_eq!(
        warned("PROC shift()\nPDispSet [[0,0,5],[1,0,0,0]];\nENDPROC\n"),
        ["`cut` is corrected for program displacement as at the start, and `shift` changes it"]
    );
    // A caller says in which order they run.
    assert_eq!(
        warned("PROC two()\nw.oframe.trans.z:=2;\nENDPROC\nPROC main()\ntwo;\ncut;\nENDPROC\n"),
        Vec::<String>::new()
    );
}
