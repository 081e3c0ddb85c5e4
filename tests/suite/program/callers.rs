//! Callers in files that are only read, and data that change under another name.

use deflex::program::{Editable, Program, krl, rapid};
use deflex::text::Source;

fn rapid_program(part: &str, context: &str) -> Program {
    let data = "PERS wobjdata wPart:=[FALSE,TRUE,\"\",[[1000,0,500],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\n";
    let sources = vec![Source::new("part.mod", format!("MODULE Part\n{data}{part}ENDMODULE\n"))];
    let context = vec![Source::new("main.mod", format!("MODULE Main\n{context}ENDMODULE\n"))];
    rapid::read(sources, context).unwrap()
}

fn is_edited(program: &Program) -> Vec<bool> {
    program.targets.iter().map(|target| !matches!(target.editable, Editable::No(_))).collect()
}

const MOVE: &str = "MoveL [[0,0,0],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v50,fine,tCell\\WObj:=wPart;\n";

#[test]
fn a_rapid_program_starts_where_a_given_file_calls_it() {
    let part = format!("PROC part()\n{MOVE}ENDPROC\n");
    for (main, edited) in [
        ("PROC main()\npart;\nENDPROC\n", true),
        ("PROC main()\nwPart.oframe.trans.x:=GInput(gi1);\npart;\nENDPROC\n", false),
        ("PROC main()\nwPart.oframe.trans.x:=GInput(gi1);\n%\"part\"%;\nENDPROC\n", false),
        (
            "PROC start()\nPDispSet [[0,0,9],[1,0,0,0],[0,0,0,0,0,0]];\nstep;\nENDPROC\nPROC step()\npart;\nENDPROC\n",
            false,
        ),
        // It has nothing to do with the part.
        ("PROC other()\nwPart.oframe.trans.x:=GInput(gi1);\nENDPROC\n", true),
    ] {
        let program = rapid_program(&part, main);
        assert_eq!(is_edited(&program).contains(&true), edited, "{main}");
    }
}

#[test]
fn a_cleared_path_and_a_handler_that_does_not_end() {
    use deflex::program::Predecessor::{Previous, Start, Unknown};
    let starts = |body: &str, end: &str| {
        let step = format!("PROC step()\n{MOVE}WaitDI di1,1\\MaxTime:=1;\n{MOVE}{end}ENDPROC\n");
        let program = rapid_program(&format!("PROC main()\n{body}ENDPROC\n{step}"), "");
        program.targets.iter().map(|target| target.predecessor).collect::<Vec<_>>()
    };
    let clear = format!("{MOVE}IF di1=1 THEN\nStopMove;\nClearPath;\nStartMove;\nENDIF\n{MOVE}");
    assert_eq!(starts(&clear, "")[..2], [Start, Unknown]);
    // The handler goes on after the wait that failed, and never returns from the routine before its end.
    let call = format!("step;\n{MOVE}");
    assert_eq!(starts(&call, "ERROR\nTRYNEXT;\n"), [Start, Previous, Previous]);
    assert_eq!(starts(&call, "ERROR\nRETURN;\n"), [Start, Previous, Unknown]);
}

fn krl_program(source: &str, data: &str, context: Vec<Source>) -> Program {
    let head = "DEF a()\nINT i\nFRAME F\nBAS(#TOOL,1)\nBAS(#BASE,1)\n$VEL.CP=0.05\n";
    let sources = vec![
        Source::new("a.src", format!("{head}{source}END\n")),
        Source::new("a.dat", format!("DEFDAT a\n{data}ENDDAT\n")),
    ];
    krl::read(sources, context).unwrap()
}

const LIN: &str = "LIN {X 10.0,Y 20.0,Z 30.0,A 0.0,B 0.0,C 180.0}\n";

#[test]
fn a_krl_program_starts_where_a_given_file_calls_it() {
    let part = || vec![Source::new("part.src", format!("DEF part()\n{LIN}END\n"))];
    let name = |program: &Program| program.wobjs[usize::from(program.targets[0].wobj)].name.to_string();
    let alone = krl::read(part(), Vec::new()).unwrap();
    assert_eq!(name(&alone), "$BASE");
    let main = |text: &'static str| vec![Source::new("main.src", text)];
    let called = krl::read(part(), main("DEF main()\n$TOOL=TOOL_DATA[2]\n$BASE=BASE_DATA[2]\npart()\nEND\n")).unwrap();
    assert_eq!(name(&called), "BASE_DATA[2]");
    let unrelated = krl::read(part(), main("DEF main()\n$BASE=BASE_DATA[2]\nEND\n")).unwrap();
    assert_eq!(name(&unrelated), "$BASE");
}

#[test]
fn krl_data_that_change_under_another_name_are_unknown() {
    let is_known = |source: &str, data: &str, context| is_edited(&krl_program(source, data, context)).contains(&true);
    let signal = "SIGNAL ROUGH $OUT[7]\n";
    let turns = format!("ROUGH=FALSE\n$OUT[7]=TRUE\nIF ROUGH THEN\nBAS(#BASE,2)\nENDIF\n{LIN}");
    assert!(!is_known(&turns, signal, Vec::new()));
    // The point of another module has a name of this one's own.
    let point = || {
        vec![Source::new("b.dat", "DEFDAT b PUBLIC\nGLOBAL FRAME Q={X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 180.0}\nENDDAT\n")]
    };
    let import = "IMPORT FRAME P IS /R1/b..Q\n";
    assert!(!is_known("P.Z=77.0\nLIN Q\n", import, point()));
    assert!(!is_known(
        "INTERRUPT WITH BRAKE DECL 21 WHEN $IN[1] DO $BASE=BASE_DATA[2]\nINTERRUPT ON 21\nLIN {X 1.0}\n",
        "",
        Vec::new()
    ));
}

#[test]
fn a_whole_component_of_a_structure_keeps_its_number() {
    let data = |kind: &str| format!("STRUC PT {kind} X,Y,Z\nDECL PT G[1]\nG[1]={{X 10,Y 20,Z 30}}\n");
    let body = "F={X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 180.0}\nF.X=G[1].X\nF.Y=G[1].Y\nF.Z=G[1].Z\nLIN F\n";
    let position = |program: &Program| program.targets[0].editable;
    assert_ne!(
        position(&krl_program(body, &data("INT"), Vec::new())),
        position(&krl_program(body, &data("REAL"), Vec::new()))
    );
}

#[test]
fn the_override_of_a_krl_program_slows_its_motions() {
    let feeds = |source: &str| {
        let program = krl_program(source, "", Vec::new());
        program.targets.iter().map(|target| target.feed_mm_s).collect::<Vec<_>>()
    };
    // The next cycle begins with what this one left.
    assert_eq!(feeds(&format!("{LIN}$OV_PRO=20\n{LIN}$VEL.CP=0.1\n{LIN}")), [None, Some(10.0), Some(20.0)]);
    assert_eq!(feeds(&format!("BAS(#OV_PRO,50)\n{LIN}IF $IN[1] THEN\n$OV_PRO=100\nENDIF\n{LIN}")), [Some(25.0), None]);
}
