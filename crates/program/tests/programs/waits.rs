//! The waits between the motions of programs in each language.

use deflex_program::{ReadOptions, Wait, cl, detect, read};
use deflex_text::Source;

/// A program of two motions in each language, with `?` between them.
const PROGRAMS: [(&str, &str); 5] = [
    (
        "a.mod",
        "MODULE a\nPROC main()\nMoveL [[1,0,0],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v50,z1,tool0;\n?\nMoveL \
         [[2,0,0],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v50,z1,tool0;\nENDPROC\nENDMODULE\n",
    ),
    (
        "a.src",
        "DEF a ( )\n$BASE=BASE_DATA[1]\n$TOOL=TOOL_DATA[1]\n$VEL.CP=0.05\nLIN {X 1,Y 0,Z 0,A 0,B 0,C 0} C_DIS\n?\n\
         LIN {X 2,Y 0,Z 0,A 0,B 0,C 0}\nEND\n",
    ),
    (
        "a.ls",
        "/PROG A\n/ATTR\n/MN\n   1:L P[1] 50mm/sec CNT100 ;\n   2:  ? ;\n   3:L P[2] 50mm/sec FINE ;\n/POS\n\
         P[1]{ GP1: UF : 1, UT : 1, X = 1 mm, Y = 0 mm, Z = 0 mm, W = 0 deg, P = 0 deg, R = 0 deg };\n\
         P[2]{ GP1: UF : 1, UT : 1, X = 2 mm, Y = 0 mm, Z = 0 mm, W = 0 deg, P = 0 deg, R = 0 deg };\n/END\n",
    ),
    ("a.script", "def a():\n  movel(p[0.1,0,0,0,0,0],v=0.05,r=0.001)\n  ?\n  movel(p[0.2,0,0,0,0,0],v=0.05)\nend\n"),
    ("a.cls", "UNITS/MM\nFEDRAT/100,MMPM\nGOTO/1,0,0,0,0,1\n?\nGOTO/2,0,0,0,0,1\nFINI\n"),
];

/// The wait that a statement is between the motions of the program with this name.
fn wait(name: &str, statement: &str) -> Option<Wait> {
    let (_, text) = PROGRAMS.iter().find(|(known, _)| *known == name).expect("a program");
    let text = text.replace('?', statement);
    let language = detect(name, text.as_bytes()).expect("a language");
    let options = ReadOptions { cl: &cl::ClOptions::default(), look: false };
    let program = read(language, vec![Source::new(name, text)], vec![], &options);
    let program = program.unwrap_or_else(|errors| panic!("{name}: {errors:?}"));
    assert_eq!(program.targets.len(), 2, "{name}");
    program.waits_between(0, 1)
}

#[test]
fn the_time_of_a_wait_is_read() {
    for (name, statement, word, seconds) in [
        ("a.mod", "WaitTime 1.5;", "WAITTIME", 1.5),
        ("a.mod", "WaitTime\\InPos,0.5;", "WAITTIME", 0.5),
        ("a.mod", "WaitTime 0.5; WaitTime 5E-1; ! WaitTime 3;", "WAITTIME", 1.0),
        ("a.mod", "WaitTime 0.5+0.1*0;", "WAITTIME", 0.0),
        ("a.mod", "WaitDI di1,1;", "WAITDI", 0.0),
        ("a.src", "WAIT SEC 0.25", "WAIT", 0.25),
        ("a.src", "WAIT FOR $IN[1]", "WAIT", 0.0),
        ("a.ls", "WAIT   1.50(sec)", "WAIT", 1.5),
        ("a.script", "sleep(0.4)", "sleep", 0.4),
        ("a.cls", "DELAY/2", "DELAY", 2.0),
    ] {
        assert_eq!(wait(name, statement), Some(Wait { word, seconds }), "{statement}");
    }
}

#[test]
fn a_wait_of_unknown_time_stops_only_controllers_whose_manuals_say_so() {
    assert_eq!(wait("a.ls", "WAIT DI[1]=ON"), None);
    assert_eq!(wait("a.mod", "IF di1=1 WaitTime 1;"), None);
}
