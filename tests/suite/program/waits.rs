//! What a program waits for, something else changes. Motions that nothing reaches are said.

use deflex::program::{Program, Reason, jbi, krl, tp, ur};
use deflex::text::Source;

/// The lines that are kept, with their reasons.
fn kept(program: &Program) -> Vec<(usize, Reason)> {
    program.kept.iter().map(|kept| (kept.line, kept.reason)).collect()
}

/// The lines of the targets.
fn lines(program: &Program) -> Vec<u32> {
    program.targets.iter().map(|target| target.line).collect()
}

#[test]
fn krl_does_not_know_what_it_waited_for() {
    let point = "{X 1500,Y 0,Z 1000,A 0,B 90,C 0}";
    let read = |wait: &str| {
        let text = format!(
            "DEF a()\nDECL INT n\n$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\nn=1\n{wait}\n$BASE=BASE_DATA[n]\nLIN {point}\n\
             $BASE=$NULLFRAME\nIF n==2 THEN\nLIN {point}\nENDIF\nEND\n"
        );
        krl::read(vec![Source::new("a.src", text)], Vec::new()).unwrap()
    };
    // The condition holds already: nothing is waited for.
    assert_eq!(kept(&read("WAIT FOR n==1")), [(11, Reason::NotReached)]);
    for wait in ["WAIT FOR n==2", "WAIT FOR (n==2) AND $IN[1]", "WHILE n==1\nWAIT SEC 0.1\nENDWHILE"] {
        let program = read(wait);
        let more = wait.lines().count() - 1;
        assert!(kept(&program).iter().any(|(line, _)| *line == 8 + more), "{wait}: {:?}", kept(&program));
        assert!(lines(&program).contains(&(11 + more as u32)), "{wait}: {:?}", lines(&program));
    }
}

#[test]
fn tp_does_not_know_what_it_waited_for() {
    let read = |wait: &str| {
        let pose = |n: u32, frame: &str| {
            format!(
                "P[{n}]{{\nGP1:\nUF : {frame}, UT : 1, CONFIG : 'N U T, 0, 0, 0',\nX = {n}.0 mm, Y = 0.0 mm, Z = 0.0 mm,\n\
                 W = 180.0 deg, P = 0.0 deg, R = 0.0 deg\n}};\n"
            )
        };
        let text = format!(
            "/PROG P\n/ATTR\n/MN\n1:UTOOL_NUM=1 ;\n2:R[1]=1 ;\n3:{wait} ;\n4:UFRAME_NUM=R[1] ;\n5:L P[1] 50mm/sec FINE ;\n\
             6:UFRAME_NUM=1 ;\n7:IF R[1]<>2,JMP LBL[1] ;\n8:L P[2] 50mm/sec FINE ;\n9:LBL[1] ;\n/POS\n{}{}/END\n",
            pose(1, "F"),
            pose(2, "1")
        );
        tp::read(vec![Source::new("p.ls", text)], Vec::new()).unwrap()
    };
    let [first, second] = [8, 11];
    assert_eq!(kept(&read("WAIT R[1]=1")), [(second, Reason::NotReached)]);
    assert_eq!(kept(&read("WAIT .50(sec)")), [(second, Reason::NotReached)]);
    for wait in ["WAIT R[1]=2", "WAIT R[1]=2 OR DI[1]=ON", "WAIT R[1]=2 TIMEOUT,LBL[1]"] {
        let program = read(wait);
        assert!(kept(&program).iter().any(|(line, _)| *line == first), "{wait}: {:?}", kept(&program));
        assert!(lines(&program).contains(&(second as u32)), "{wait}: {:?}", lines(&program));
    }
}

#[test]
fn inform_does_not_know_what_it_waited_for() {
    let read = |wait: &str| {
        let position = |x: u32| format!("{x}.000,0.000,500.000,180.0000,0.0000,0.0000");
        let text = format!(
            "/JOB\n//NAME P\n//POS\n///NPOS 2,0,0,0,0,0\n///TOOL 1\n///POSTYPE BASE\n///RECTAN\n///RCONF 1,0,0,0,0,0,0,0\n\
             C00000={}\nC00001={}\n//INST\n///DATE 2026/01/02 03:04\n///ATTR SC,RW\n///GROUP1 RB1\nNOP\nSET B000 1\n{wait}\n\
             JUMP *END IF B000=1\nMOVL C00000 V=50.0\n*END\nMOVL C00001 V=50.0\nEND\n",
            position(900),
            position(950)
        );
        jbi::read(vec![Source::new("p.jbi", text)], Vec::new()).unwrap()
    };
    let waits = read("WAIT B000=2");
    assert_eq!((lines(&waits), kept(&waits)), (vec![19, 21], vec![]));
    let waits = read("WAIT IN#(1)=ON T=1.00");
    assert_eq!((lines(&waits), kept(&waits)), (vec![21], vec![(19, Reason::NotReached)]));
}

#[test]
fn urscript_says_which_motions_nothing_reaches() {
    let text = "def part():\n  movel(p[0.5, 0.1, 0.2, 0, 3.14, 0], v=0.025)\n  if False:\n    movel(p[0.5, 0.2, 0.2, 0, 3.14, 0], v=0.025)\n  end\nend\n";
    let program = ur::read(vec![Source::new("a.script", text)], Vec::new()).unwrap();
    assert_eq!((lines(&program), kept(&program)), (vec![2], vec![(4, Reason::NotReached)]));
}
