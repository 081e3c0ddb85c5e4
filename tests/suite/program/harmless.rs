//! `[controller] harmless`: routines that the user vouches for, in every language that calls any.

use deflex::cell::Cell;
use deflex::program::{Editable, Language, Program, ReadOptions, cl::ClOptions, read};
use deflex::text::{Diagnostic, Source};

fn cell(controller: &str) -> Result<Cell, Vec<Diagnostic>> {
    Cell::read(&Source::new("cell.toml", format!("[robot]\nmodel = \"irb6660-205-1.9\"\n{controller}")))
}

fn program(language: Language, file: (&str, &str), controller: &str) -> Program {
    let context = cell(controller).unwrap().controller.declarations(language);
    let options = ReadOptions { cl: &ClOptions::default(), look: false };
    read(language, vec![Source::new(file.0, file.1)], context, &options).unwrap_or_else(|why| panic!("{why:?}"))
}

/// How many targets may be edited, and whether something is said to be in none of the files.
fn outcome(program: &Program) -> (usize, bool) {
    let editable = program.targets.iter().filter(|target| !matches!(target.editable, Editable::No(_))).count();
    (
        editable,
        program
            .diagnostics
            .iter()
            .any(|note| note.message.contains("not in the files") || note.message.contains("not given")),
    )
}

const VOUCHED: &str = "[controller]\nharmless = [\"movesettings\", \"Unused\"]\n";

const RAPID: &str = "MODULE a
CONST robtarget p1:=[[1000,20,900],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
CONST robtarget p2:=[[1000,80,900],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
PROC main()
MoveSettings p2\\Quick,5;
MoveL p1,v20,fine,tool0;
MoveL p2,v20,fine,tool0;
ENDPROC
";

#[test]
fn rapid_goes_on_as_before_a_routine_that_is_vouched_for() {
    let text = format!("{RAPID}ENDMODULE\n");
    assert_eq!(outcome(&program(Language::Rapid, ("a.mod", &text), "")), (0, true));
    // What it is given it may read.
    assert_eq!(outcome(&program(Language::Rapid, ("a.mod", &text), VOUCHED)), (1, false));
    let own = format!(
        "{RAPID}PROC MoveSettings(robtarget p\\switch Quick, num n)\nPDispSet [[0,0,5],[1,0,0,0]];\nENDPROC\nENDMODULE\n"
    );
    assert_eq!(outcome(&program(Language::Rapid, ("a.mod", &own), VOUCHED)).0, 0, "the file says what it does");
}

const KRL: &str = "DEF a()
$TOOL=TOOL_DATA[1]
$BASE=BASE_DATA[2]
XP1={X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}
MoveSettings(XP1, 5)
LIN {X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}
BAS(#BASE,3)
LIN {X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}
LIN XP1
END
";

#[test]
fn krl_goes_on_as_before_a_routine_that_is_vouched_for() {
    assert_eq!(outcome(&program(Language::Krl, ("a.src", KRL), "")), (0, true));
    assert_eq!(outcome(&program(Language::Krl, ("a.src", KRL), VOUCHED)), (2, false));
    let interrupt =
        KRL.replace("MoveSettings(XP1, 5)", "INTERRUPT DECL 4 WHEN $IN[1] DO MoveSettings()\nn=MOVESETTINGS(1)");
    assert_eq!(outcome(&program(Language::Krl, ("a.src", &interrupt), "")).0, 0);
    assert_eq!(outcome(&program(Language::Krl, ("a.src", &interrupt), VOUCHED)), (3, false));
    let own = format!("{KRL}DEF MoveSettings(p:IN, n:IN)\n$IPO_MODE=#TCP\nEND\n");
    assert_eq!(outcome(&program(Language::Krl, ("a.src", &own), VOUCHED)).0, 0, "the file says what it does");
}

const LS: &str = "/PROG  A
/ATTR
/MN
   1:  UFRAME_NUM=1 ;
   2:  UTOOL_NUM=1 ;
   3:  CALL MOVESETTINGS(1,2)    ;
   4:L P[1] 100mm/sec FINE    ;
/POS
P[1]{
   GP1:
\tUF : F, UT : F,\tCONFIG : 'N U T, 0, 0, 0',
\tX =   100.000  mm,\tY =     0.000  mm,\tZ =    50.000  mm,
\tW =   180.000 deg,\tP =     0.000 deg,\tR =     0.000 deg
};
/END
";

#[test]
fn tp_goes_on_as_before_a_program_that_is_vouched_for() {
    assert_eq!(outcome(&program(Language::Ls, ("a.ls", LS), "")).0, 0);
    assert_eq!(outcome(&program(Language::Ls, ("a.ls", LS), VOUCHED)), (1, false));
}

#[test]
fn names_that_are_none_are_refused_with_their_place() {
    for name in ["", "Move Settings", "MoveSettings()", "1st", "a-b"] {
        let errors = cell(&format!("[controller]\nharmless = [\"Good\", \"{name}\"]\n")).unwrap_err();
        assert!(
            errors[0].line == 4 && errors[0].help.is_some() && errors[0].message.contains("harmless"),
            "{errors:?}"
        );
    }
    // What the controller compensates is another question, which stays open.
    assert!(!cell(VOUCHED).unwrap().controller.declared);
    assert!(cell("[controller]\ncompensates = []\n").unwrap().controller.declared);
}
