//! FANUC TP by hand: which positions its motions go to, and what is in force there.

use deflex_lang::dialect::Dialect;
use deflex_lang::run::{Outcome, Predecessor, run};
use deflex_lang::tp::{Calls, Code, Defined, Frame, Held, lines, lower};
use deflex_lang::{Reason, Span};

/// Runs statements, a line each, of a program with positions 1 to 4; programs that are given are called by their names.
fn outcome(statements: &str, given: &[&str]) -> Outcome {
    let text: String = statements.lines().map(|line| format!("1:{line} ;\n")).collect();
    let lines = lines::statements(text.as_bytes(), 0..text.len());
    let calls = Calls::new(given.iter().map(|text| text.as_bytes()));
    let positions: Vec<_> = (1..=4).map(|number| (number, Span::default())).collect();
    let (program, tp) = lower(&Code::new(&lines), &positions, &calls, None);
    run(&program, &tp).unwrap_or_else(|why| panic!("{why:?}"))
}

/// The numbers of the positions that its motions go to.
fn ends(statements: &str) -> Vec<Option<u32>> {
    outcome(statements, &[]).motions.iter().map(|moved| Held(moved).end()).collect()
}

#[test]
fn whole_numbers_are_known_and_nothing_else() {
    let known = |index: &str| ends(&format!("R[1]=3\nR[2:x]=10\nPR[5,3]=R[1]+4\nL P[{index}] 5mm/sec FINE"))[0];
    for (index, number) in [
        ("R[1:row]*4+R[2]-(-1)", 23),
        ("R[R[1]-2]", 3),
        ("(R[2] DIV 4)*(R[2] MOD 4)", 4),
        ("-(R[1]-R[2])", 7),
        ("R[2]/5", 2),
        ("3+(R[1]-9) DIV 3", 1),
        ("PR[5,3:z]", 7),
        ("PR[R[1]+2,R[1]]+1", 8),
    ] {
        assert_eq!(known(index), Some(number), "{index}");
    }
    // Halves may be rounded; what is not set, or set by others, may be anything.
    for unknown in [
        "PR[5,2]", "PR[5]", "PR[5,4]", "PR[6,3]", "PR[5,9]", "PR[GP2:5,3]", "PR[5,R[3]]", "R[2]/4", "R[3]", "2.5",
        "2.5*2", "R[1]/0", "R[1] DIV 0", "R[1]+DI[1]", "AR[1]", "R[1] R[2]", "", "(((",
    ] {
        assert_eq!(known(unknown), None, "{unknown}");
    }
    // FANUC's manuals do not say which way the quotient of a negative number is rounded.
    for unknown in ["3+(R[1]-R[2]) MOD 4", "3+R[2] MOD (0-4)", "3+(R[1]-R[2]) DIV 4", "3+R[1] DIV (0-2)"] {
        assert_eq!(known(unknown), None, "{unknown}");
    }
    assert_eq!(known(&format!("{}1{}", "(".repeat(500), ")".repeat(500))), None);
    assert_eq!(known(&vec!["1"; 5_000].join("+")), None);
}

#[test]
fn conditions_are_known_where_all_that_decides_them_is() {
    let holds = |condition: &str| {
        let way = ends(&format!("R[1]=3\nR[2]=10\nR[9]=1\nIF {condition},R[9]=2\nL P[R[9]] 5mm/sec FINE"));
        way[0].map(|way| way == 2)
    };
    assert_eq!(holds("R[1]=3 AND R[2]>9"), Some(true));
    assert_eq!(holds("(R[1]<>3 OR !(R[2]<=10))"), Some(false));
    assert_eq!(holds("R[1]=4 AND DI[1]=ON"), Some(false));
    assert_eq!(holds("R[1]=3 OR DI[1]=ON"), Some(true));
    assert_eq!(holds("R[1]=3 AND DI[1]=ON"), None);
    assert_eq!(holds("R[1]=3.5"), None);
    assert_eq!(holds("$DCSS[1].$STOP<>1 OR SR[1]='A,b'"), None);
}

/// A loop with a branch in it, left by a condition that is not known: each motion counts once.
#[test]
fn a_loop_that_may_go_on_is_one_round() {
    let statements = "LBL[1]\nL P[1] 5mm/sec FINE\nIF DI[1]=ON,DO[1]=ON\nL P[2] 5mm/sec FINE\nIF DI[2]=ON,JMP LBL[1]\nL P[3] 5mm/sec FINE";
    let outcome = outcome(statements, &[]);
    let found: Vec<_> = outcome.motions.iter().map(|moved| (Held(moved).end(), moved.from)).collect();
    assert_eq!(
        found,
        [(Some(1), Predecessor::Unknown), (Some(2), Predecessor::Previous), (Some(3), Predecessor::Previous)]
    );
}

/// On ways of which it is not known which one runs, motions count in the order of the text, wherever jumps lead.
#[test]
fn ways_that_may_run_count_in_the_order_of_the_text() {
    let statements = "IF DI[1]=ON,JMP LBL[2]\nL P[1] 5mm/sec FINE\nJMP LBL[3]\nLBL[2]\nL P[2] 5mm/sec FINE\nLBL[3]\nL P[3] 5mm/sec FINE";
    assert_eq!(ends(statements), [Some(1), Some(2), Some(3)]);
}

#[test]
fn loops_and_jumps_that_are_known_are_followed() {
    let numbers = |statements: &str| ends(statements).into_iter().map(Option::unwrap).collect::<Vec<_>>();
    assert_eq!(numbers("FOR R[1]=3 DOWNTO 1\nL P[R[1]] 5mm/sec FINE\nENDFOR\nL P[4] 5mm/sec FINE"), [3, 2, 1, 4]);
    assert_eq!(numbers("R[1]=2\nJMP LBL[R[1]]\nLBL[1]\nL P[1] 5mm/sec FINE\nLBL[2]\nL P[2] 5mm/sec FINE"), [2]);
    let select = "R[1]=2\nSELECT R[1]=1,JMP LBL[1]\n=2,JMP LBL[2]\nELSE,JMP LBL[1]\nLBL[1]\nL P[1] 5mm/sec FINE\nLBL[2]\nL P[2] 5mm/sec FINE";
    assert_eq!(numbers(select), [2]);
    // A label that is not there stops the controller.
    assert_eq!(numbers("L P[1] 5mm/sec FINE\nJMP LBL[7]\nL P[2] 5mm/sec FINE"), [1]);
    // Something else changes the element; the bound of a loop may be read again.
    assert_eq!(ends("PR[1,1]=1\nWAIT (PR[1,1]=2)\nL P[PR[1,1]] 5mm/sec FINE"), [None]);
    assert_eq!(numbers("PR[1,1]=1\nWAIT (PR[1,1]=1)\nL P[PR[1,1]] 5mm/sec FINE"), [1]);
    let changed = "PR[1,1]=3\nFOR R[1]=1 TO PR[1,1]\nPR[1,1]=2\nL P[R[1]] 5mm/sec FINE\nENDFOR";
    assert_eq!(ends(changed), [None]);
    // After the loop its counter is the controller's affair.
    assert_eq!(ends("FOR R[1]=1 TO 2\nENDFOR\nL P[R[1]] 5mm/sec FINE"), [None]);
}

#[test]
fn selections_and_frames_hold_until_something_may_change_them() {
    let held = |between: &str, given: &[&str]| {
        let outcome = outcome(&format!("UFRAME_NUM=2\nUTOOL_NUM=R[1]\n{between}\nL P[1] 5mm/sec FINE"), given);
        let held = Held(&outcome.motions[0]);
        let is_set = |frame, number| held.defined(frame, number) != Defined::InCell;
        (held.selected(Frame::User), is_set(Frame::User, 2), is_set(Frame::Tool, 1))
    };
    assert_eq!(held("DO[1]=ON", &[]), (Some(2), false, false));
    assert_eq!(held("UFRAME[3]=PR[1]", &[]), (Some(2), false, false));
    assert_eq!(held("IF DI[1]=ON,UFRAME[2]=PR[1]", &[]), (Some(2), true, false));
    assert_eq!(held("UTOOL[R[1]]=PR[1]", &[]), (Some(2), false, true));
    assert_eq!(held("CALL SUB", &[]), (None, false, false));
    let sub = "/PROG SUB\n/MN\n1:R[5]=1 ;\n2:UTOOL[1]=PR[2] ;\n/POS\n/END\n";
    assert_eq!(held("CALL SUB", &[sub]), (Some(2), false, true));
    assert_eq!(held("RUN SUB\nUFRAME_NUM=2", &[sub]), (None, false, true));
}

#[test]
fn positions_that_are_counted_from_are_used() {
    let used = |statements: &str, given: &[&str]| -> Vec<u32> {
        outcome(statements, given).used.keys().map(|token| token.0 + 1).collect()
    };
    let both = "L P[1] 5mm/sec FINE\nIF DI[1]=ON,JMP LBL[1]\nL P[2] 5mm/sec FINE\nLBL[1]\nL P[3] 5mm/sec FINE INC\nL P[4] 5mm/sec FINE";
    assert_eq!(used(both, &[]), [1, 2]);
    assert_eq!(used("C P[1] P[2] 5mm/sec FINE\nL P[3] 5mm/sec FINE INC", &[]), [1, 2]);
    assert_eq!(used("R[1]=2\nL P[R[1]] 5mm/sec FINE\nL P[3] 5mm/sec FINE INC", &[]), [2]);
    let sub = "/PROG SUB\n/MN\n1:L P[1] 5mm/sec FINE INC ;\n/POS\n/END\n";
    assert_eq!(used("L P[4] 5mm/sec FINE\nCALL SUB", &[sub]), [4]);
    let later = sub.replace("1:L", "1:L P[2] 5mm/sec FINE ;\n2:L");
    assert_eq!(used("L P[4] 5mm/sec FINE\nCALL SUB", &[&later]), []);
}

#[test]
fn a_pose_turns_about_the_fixed_axes() {
    let (_, tp) = lower(&Code::new(&[]), &[], &Calls::default(), Some(Reason::LineTracking));
    let numbers = [1.0, 2.0, 3.0, 90.0, 0.0, 90.0];
    let pose = tp.pose(&numbers).unwrap();
    // First a quarter turn about x, then one about z: x goes to y, y to z, z to x.
    let turned = pose.rotation * nalgebra::Vector3::new(1.0, 2.0, 3.0);
    assert!((turned - nalgebra::Vector3::new(3.0, 1.0, 2.0)).norm() < 1e-12, "{turned}");
    assert!(tp.numbers(&pose, &numbers).iter().zip(numbers).all(|(a, b)| (a - b).abs() < 1e-9));
}

/// A called program that waits for a register goes on when something else has set it.
#[test]
fn registers_for_which_a_called_program_waits_are_unknown() {
    let end = |wait: &str| {
        let called = format!("/PROG W\n/MN\n1:{wait} ;\n/POS\n/END\n");
        let given = ["/PROG MAIN\n/MN\n/POS\n/END\n", &called];
        Held(&outcome("R[1]=2\nR[2]=3\nCALL W\nL P[R[1]] 5mm/sec FINE", &given).motions[0]).end()
    };
    assert_eq!(end("WAIT R[1]=3"), None);
    assert_eq!(end("WAIT R[R[2]]=3 TIMEOUT,LBL[1]"), None);
    assert_eq!(end("WAIT R[2:go]=3 AND DI[1]=ON"), Some(2));
    assert_eq!(end("WAIT 1.00(sec)"), Some(2));
}

/// A loop in which nothing changes its conditions ends when something else changes them.
#[test]
fn a_loop_that_changes_nothing_waits() {
    let then = "L P[R[1]] 5mm/sec FINE\nL P[3] 5mm/sec FINE";
    for poll in [
        "LBL[1]\nWAIT .10(sec)\nIF R[1]<>3,JMP LBL[1]",
        "LBL[1]\nIF R[1]=3,JMP LBL[2]\nIF (R[1]=4) THEN\nJMP LBL[2]\nENDIF\nJMP LBL[1]\nLBL[2]",
        "LBL[1]\nSELECT R[1]=3,JMP LBL[2]\n=4,JMP LBL[2]\nJMP LBL[1]\nLBL[2]",
    ] {
        assert_eq!(ends(&format!("R[1]=2\n{poll}\n{then}")), [None, Some(3)], "{poll}");
        assert_eq!(ends(&format!("R[1]=3\n{poll}\n{then}")), [Some(3), Some(3)], "{poll}");
    }
    // What the program changes itself is followed.
    let counts = "R[1]=1\nLBL[1]\nR[1]=R[1]+1\nIF R[1]<3,JMP LBL[1]";
    assert_eq!(ends(&format!("{counts}\n{then}")), [Some(3), Some(3)]);
    assert_eq!(ends(&format!("LBL[1]\nWAIT 1.00(sec)\nJMP LBL[1]\n{then}")), []);
}
