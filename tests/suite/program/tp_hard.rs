//! TP programs that are easily got wrong, each by the meaning that FANUC's R-30iB Operator's Manual (Basic Operation) gives its
//! statements: which positions may be edited, and why the others are kept.

use deflex::program::{Editable, Goal, Motion, Predecessor, Program, Role, Target, tp};
use deflex::text::Source;

/// A program and what is right.
struct Hard {
    what: &'static str,
    head: &'static str,
    statements: &'static str,
    /// Instead of those in user frame 1 with tool 1.
    positions: &'static [(u32, &'static str)],
    /// Numbers of the positions that may be edited, if every motion cuts: one that is moved at run time then holds its position.
    edited: &'static [u32],
    /// Statements, from 1, with the reason.
    kept: &'static [(usize, &'static str)],
}

const PLAIN: Hard = Hard { what: "", head: "", statements: "", positions: &[], edited: &[], kept: &[] };
const NAMED: &str = "position that another instruction reads or changes";
const MAY_BE_ANY: &str = "a motion whose target is known only at run time may go there";
const ANY: &str = "position known only at run time";
const FEW: &str = "fewer than three circle arc motions (A) in a row";
const HALF_ARC: &str = "arc with a point that is not edited";
const REDEFINED: &str = "user frame whose values a program sets";
const OPTION: &str = "motion option that is not known";

fn body(frames: &str, x: u32) -> String {
    format!(
        "GP1: {frames}, CONFIG : 'N U T, 0, 0, 0', X = {x}.000 mm, Y = {y}.000 mm, Z = 0.000 mm, W = 180.000 deg, P = 0.000 deg, R = 0.000 deg",
        y = x * x
    )
}

fn read(hard: &Hard, context: &[&str]) -> Program {
    let mut text = format!("/PROG  M\n/ATTR\n{}/MN\n", hard.head);
    for (i, line) in hard.statements.lines().enumerate() {
        // A line that begins with a colon continues the one before.
        let line = line.trim_start();
        if let Some(continued) = line.strip_prefix(':') {
            text.truncate(text.len() - " ;\n".len());
            text += &format!("\n    :{continued} ;\n");
        } else {
            text += &format!("{:4}:{line} ;\n", i + 1);
        }
    }
    text += "/POS\n";
    for number in 1..=6 {
        let own = hard.positions.iter().find(|(own, _)| *own == number);
        let body = own.map_or_else(|| body("UF : 1, UT : 1", number), |(_, body)| (*body).to_owned());
        text += &format!("P[{number}]{{ {body} }};\n");
    }
    text += "/END\n";
    let context = context.iter().map(|text| Source::new("other.ls", text.as_bytes())).collect();
    tp::read(vec![Source::new("m.ls", text)], context).unwrap_or_else(|errors| panic!("{}: {errors:?}", hard.what))
}

fn judge(hard: &Hard) -> Program {
    let program = read(hard, &[]);
    let name = |target: &Target| target.name.clone();
    let held: Vec<_> = program.targets.iter().filter(|target| !target.located).map(name).collect();
    let mut edited: Vec<u32> = program
        .targets
        .iter()
        .filter(|target| target.editable == Editable::Pose && !held.contains(&target.name))
        .filter_map(|target| target.name.as_deref()?.trim_start_matches("P[").trim_end_matches(']').parse().ok())
        .collect();
    edited.sort_unstable();
    edited.dedup();
    assert_eq!(edited, hard.edited, "{}: {:?}", hard.what, program.kept);
    let before = 3 + hard.head.lines().count();
    let kept: Vec<(usize, &str)> = program.kept.iter().map(|kept| (kept.line - before, kept.reason.text())).collect();
    assert_eq!(kept, hard.kept, "{}", hard.what);
    program
}

const HARD: &[Hard] = &[
    Hard {
        what: "both ways of an IF with an input are possible, and both agree",
        statements: "IF DI[1]=ON,JMP LBL[1]\nL P[1] 10mm/sec FINE\nLBL[1]\nL P[2] 10mm/sec FINE",
        edited: &[1, 2],
        ..PLAIN
    },
    Hard {
        what: "a frame selected on one branch only is not known after it",
        statements: "UFRAME_NUM=1\nIF DI[1]=ON,UFRAME_NUM=2\nL P[1] 10mm/sec FINE\nL P[2] 10mm/sec FINE",
        positions: &[(1, "GP1: UF : F, UT : 1, X = 1 mm, Y = 1 mm, Z = 0 mm, W = 0 deg, P = 0 deg, R = 0 deg")],
        edited: &[2],
        kept: &[(3, "user frame selected at run time")],
        ..PLAIN
    },
    Hard {
        what: "a position of the selected frame under two frames: one text, two meanings, both known",
        statements: "UFRAME_NUM=1\nL P[1] 10mm/sec FINE\nUFRAME_NUM=2\nL P[1] 10mm/sec FINE",
        positions: &[(1, "GP1: UF : F, UT : 1, X = 1 mm, Y = 1 mm, Z = 0 mm, W = 0 deg, P = 0 deg, R = 0 deg")],
        edited: &[1],
        ..PLAIN
    },
    Hard {
        what: "a recorded frame that is not selected stops the controller",
        statements: "UFRAME_NUM=2\nL P[1] 10mm/sec FINE\nUFRAME_NUM=1\nUTOOL_NUM=3\nL P[2] 10mm/sec FINE",
        kept: &[
            (2, "recorded in another user frame than is selected"),
            (5, "recorded with another tool than is selected"),
        ],
        ..PLAIN
    },
    Hard {
        what: "a frame by a register that the program has set",
        statements: "R[5:frame]=2\nUFRAME_NUM=R[5:frame]\nL P[1] 10mm/sec FINE\nL P[2] 10mm/sec FINE",
        positions: &[(2, "GP1: UF : 2, UT : 1, X = 1 mm, Y = 1 mm, Z = 0 mm, W = 0 deg, P = 0 deg, R = 0 deg")],
        edited: &[2],
        kept: &[(3, "recorded in another user frame than is selected")],
        ..PLAIN
    },
    Hard {
        // The first motion has these values in the next cycle.
        what: "values of a frame set by a position register",
        statements: "L P[1] 10mm/sec FINE\nUFRAME[1]=PR[3]\nL P[2] 10mm/sec FINE\nUFRAME[2]=PR[3]",
        kept: &[(1, REDEFINED), (3, REDEFINED)],
        ..PLAIN
    },
    Hard {
        what: "the same by a register with an element that the program does not set",
        statements: "PR[9,1]=1\nPR[9,2]=2\nPR[9,3]=3\nPR[9,4]=0\nPR[9,5]=0\nUFRAME[1]=PR[9]\nL P[1] 10mm/sec FINE",
        kept: &[(7, REDEFINED)],
        ..PLAIN
    },
    Hard {
        what: "the same where an input decides about an element",
        statements: "PR[9]=LPOS-LPOS\nIF DI[1]=ON,PR[9,3]=5\nUFRAME[1]=PR[9]\nL P[1] 10mm/sec FINE",
        kept: &[(4, REDEFINED)],
        ..PLAIN
    },
    Hard {
        what: "the same from a register that may have axis angles",
        statements: "PR[9]=JPOS\nPR[9]=PR[9]-PR[9]\nPR[9,3]=5\nUFRAME[1]=PR[9]\nL P[1] 10mm/sec FINE",
        kept: &[(5, REDEFINED)],
        ..PLAIN
    },
    Hard {
        what: "a program that is not given may change a position register, but not a frame",
        statements: "PR[9]=LPOS-LPOS\nCALL OTHER\nUFRAME[1]=PR[9]\nL P[1] 10mm/sec FINE\nPR[9]=LPOS-LPOS\nUFRAME[1]=PR[9]\nCALL OTHER\nL P[2] 10mm/sec FINE",
        edited: &[2],
        kept: &[(4, REDEFINED)],
        ..PLAIN
    },
    Hard {
        what: "a search stores a position on the way",
        statements: "PR[9]=LPOS-LPOS\nL P[2] 10mm/sec FINE Skip,LBL[1],PR[9]=LPOS\nLBL[1]\nUFRAME[1]=PR[9]\nL P[1] 10mm/sec FINE",
        kept: &[(2, "ends where a condition is met (Skip)"), (5, REDEFINED)],
        ..PLAIN
    },
    Hard {
        what: "a program in parallel may change a position register",
        statements: "RUN WATCH\nPR[9]=LPOS-LPOS\nUFRAME[1]=PR[9]\nL P[1] 10mm/sec FINE",
        kept: &[(4, REDEFINED)],
        ..PLAIN
    },
    Hard {
        what: "a frame set after any frame may have been set, and another one",
        statements: "UFRAME[R[5]]=PR[3]\nPR[9]=LPOS-LPOS\nUFRAME[1]=PR[9]\nL P[1] 10mm/sec FINE\nL P[2] 10mm/sec FINE",
        positions: &[(2, "GP1: UF : 2, UT : 1, X = 1 mm, Y = 1 mm, Z = 0 mm, W = 0 deg, P = 0 deg, R = 0 deg")],
        edited: &[1],
        kept: &[(5, REDEFINED)],
        ..PLAIN
    },
    Hard {
        what: "numbers of registers, elements and frames that registers hold; a comment with a comma",
        statements: "R[1]=9\nPR[R[1]]=LPOS-LPOS\nR[2]=3\nPR[R[1],R[2]]=50\nPR[8:a,1]=LPOS\nR[3]=1\nUFRAME[R[3]]=PR[R[1]:x]\nL P[1] 10mm/sec FINE",
        edited: &[1],
        ..PLAIN
    },
    Hard {
        what: "elements of another group and of external axes",
        statements: "PR[9]=LPOS-LPOS\nPR[GP2:9,1]=5\nPR[9,7]=5\nUFRAME[GP1:1]=PR[GP1:9]\nL P[1] 10mm/sec FINE",
        edited: &[1],
        ..PLAIN
    },
    Hard {
        what: "a motion to any position goes to one that was recorded in the selected frame",
        statements: "UFRAME_NUM=2\nL P[R[1]] 10mm/sec FINE\nUFRAME_NUM=1\nL P[1] 10mm/sec FINE\nUFRAME_NUM=2\nL P[2] 10mm/sec FINE",
        positions: &[(2, "GP1: UF : 2, UT : 1, X = 1 mm, Y = 1 mm, Z = 0 mm, W = 0 deg, P = 0 deg, R = 0 deg")],
        edited: &[1],
        kept: &[(2, ANY), (6, MAY_BE_ANY)],
        ..PLAIN
    },
    Hard {
        what: "the same by a system variable, of whichever frame",
        statements: "L P[1] 10mm/sec FINE\n$MNUFRAME[1,1]=PR[3]\nL P[2] 10mm/sec FINE",
        kept: &[(1, REDEFINED), (3, REDEFINED)],
        ..PLAIN
    },
    Hard {
        what: "a field of a variable that names a tool",
        statements: "$GROUP[1].$UTOOL=PR[3]\nL P[1] 10mm/sec FINE",
        kept: &[(2, REDEFINED)],
        ..PLAIN
    },
    Hard {
        what: "the check of frame numbers switched off",
        statements: "$FRM_CHKTYP=(-2)\nL P[1] 10mm/sec FINE",
        kept: &[(2, "the check of frame numbers is set at run time ($FRM_CHKTYP)")],
        ..PLAIN
    },
    Hard {
        what: "system variables that do nothing to places",
        statements: "$MCR.$GENOVERRIDE=50\n$WAITTMOUT=R[3]\nL P[1] 10mm/sec FINE",
        edited: &[1],
        ..PLAIN
    },
    Hard {
        what: "a frame of another group",
        statements: "UFRAME_NUM[GP2]=4\nUTOOL_NUM[GP1]=1\nL P[1] 10mm/sec FINE",
        edited: &[1],
        ..PLAIN
    },
    Hard {
        what: "SELECT with a jump after it",
        statements: "SELECT R[1]=1,JMP LBL[1]\n       =2,CALL OTHER\n       ELSE,JMP LBL[2]\nL P[1] 10mm/sec FINE\nLBL[1]\nL P[2] 10mm/sec FINE\nLBL[2]\nL P[3] 10mm/sec FINE",
        edited: &[1, 2, 3],
        ..PLAIN
    },
    Hard {
        what: "a loop over positions by a register",
        statements: "FOR R[1]=2 TO 4\nL P[R[1]] 10mm/sec CNT100\nENDFOR\nL P[1] 10mm/sec FINE",
        edited: &[1, 2, 3, 4],
        ..PLAIN
    },
    Hard {
        what: "a loop whose end is in a register: any position may be gone to",
        statements: "FOR R[1]=2 TO R[2]\nL P[R[1]] 10mm/sec CNT100\nENDFOR\nL P[1] 10mm/sec FINE",
        kept: &[(2, ANY), (4, MAY_BE_ANY)],
        ..PLAIN
    },
    Hard {
        what: "counting down, and a sum as an index",
        statements: "FOR R[1]=3 DOWNTO 2\nL P[R[1]+1] 10mm/sec CNT100\nENDFOR",
        kept: &[],
        edited: &[3, 4],
        ..PLAIN
    },
    Hard {
        what: "an index below zero is no position",
        statements: "R[1]=(-1)\nL P[R[1]] 10mm/sec FINE\nL P[2] 10mm/sec FINE",
        kept: &[(2, ANY), (3, MAY_BE_ANY)],
        ..PLAIN
    },
    Hard {
        what: "an index that is no whole number",
        statements: "R[1]=5/2\nL P[R[1]] 10mm/sec FINE\nL P[2] 10mm/sec FINE",
        kept: &[(2, ANY), (3, MAY_BE_ANY)],
        ..PLAIN
    },
    Hard {
        what: "a register of a register",
        statements: "R[2]=3\nR[R[2]]=4\nL P[R[3]] 10mm/sec FINE",
        edited: &[4],
        ..PLAIN
    },
    Hard {
        what: "an argument of the program decides",
        statements: "R[1]=AR[1]\nL P[R[1]] 10mm/sec FINE\nL P[1] 10mm/sec FINE",
        kept: &[(2, ANY), (3, MAY_BE_ANY)],
        ..PLAIN
    },
    Hard {
        what: "a position in a register that nothing uses, one that is changed, and one by its coordinate",
        statements: "PR[1]=P[1]\nP[2]=PR[4]\nPR[3,1]=P[3,1]\nL P[1] 10mm/sec FINE\nL P[2] 10mm/sec FINE\nL P[3] 10mm/sec FINE\nL P[4] 10mm/sec FINE",
        edited: &[1, 4],
        kept: &[(5, NAMED), (6, NAMED)],
        ..PLAIN
    },
    Hard {
        what: "arithmetic of position registers moves nothing of ours",
        statements: "PR[1]=PR[2]+PR[3]\nPR[1,3]=PR[1,3]+R[7]\nL P[1] 10mm/sec FINE",
        edited: &[1],
        ..PLAIN
    },
    Hard {
        what: "Offset with and without its register, and the condition before",
        statements: "OFFSET CONDITION PR[1],UFRAME[2]\nL P[1] 10mm/sec FINE Offset\nL P[2] 10mm/sec FINE Offset,PR[2]\nL P[3] 10mm/sec FINE Tool_Offset,PR[2]\nL P[4] 10mm/sec FINE",
        edited: &[4],
        kept: &[
            (2, "moved by a position register (Offset)"),
            (3, "moved by a position register (Offset)"),
            (4, "moved by a position register (Tool_Offset)"),
        ],
        ..PLAIN
    },
    Hard {
        what: "a position moved in one place stays in the other",
        statements: "L P[1] 10mm/sec FINE\nL P[1] 10mm/sec FINE Offset,PR[2]\nL P[2] 10mm/sec FINE",
        edited: &[2],
        kept: &[(2, "moved by a position register (Offset)")],
        ..PLAIN
    },
    Hard {
        what: "an increment counts from what was before, on both ways there",
        statements: "L P[1] 10mm/sec FINE\nIF DI[1]=ON,JMP LBL[1]\nL P[2] 10mm/sec FINE\nLBL[1]\nL P[3] 10mm/sec FINE INC\nL P[4] 10mm/sec FINE",
        edited: &[4],
        kept: &[
            (1, "an incremental motion is counted from it"),
            (3, "an incremental motion is counted from it"),
            (5, "incremental motion (INC)"),
        ],
        ..PLAIN
    },
    Hard {
        what: "options that leave the end where it is",
        statements: "L P[1] 10mm/sec CNT50 ACC80 Wjnt\nL P[2] 10mm/sec CR20 PSPD120 MROT\nJ P[3] 50% FINE ACC R[4]\nL P[4] 2.5sec CNT R[5] PTH BREAK",
        edited: &[1, 2, 3, 4],
        ..PLAIN
    },
    Hard {
        what: "options that do not",
        statements: "L P[1] 10mm/sec FINE RTCP\nL P[2] 10mm/sec FINE COORD[LDR]\nL P[3] 10mm/sec FINE Ev50%\nL P[4] 10mm/sec FINE TA_REF PR[2]\nL P[5] 10mm/sec FINE VOFFSET,VR[1]",
        kept: &[
            (1, "stationary tool (RTCP)"),
            (2, "coordinated (COORD) with a motion group that its position does not have"),
            (3, "external axis with a speed of its own (EV)"),
            (4, OPTION),
            (5, "moved by a vision register (VOFFSET)"),
        ],
        ..PLAIN
    },
    Hard {
        what: "a skip ends where the condition is met, and goes on at the label where it is not",
        statements: "SKIP CONDITION DI[1]=ON\nL P[1] 10mm/sec FINE Skip,LBL[1]\nUFRAME_NUM=2\nLBL[1]\nL P[2] 10mm/sec FINE",
        edited: &[2],
        kept: &[(2, "ends where a condition is met (Skip)")],
        ..PLAIN
    },
    Hard {
        what: "a program called at a point may set registers at any moment from there on",
        statements: "R[1]=1\nL P[1] 10mm/sec CNT100 TB .50sec,CALL GUN(1)\nL P[R[1]] 10mm/sec FINE",
        kept: &[(2, MAY_BE_ANY), (3, ANY)],
        ..PLAIN
    },
    Hard {
        what: "the same after a word that is not known",
        statements: "R[1]=2\nL P[1] 10mm/sec CNT100 TIME BEFORE .50sec CALL GUN\nL P[R[1]] 10mm/sec FINE",
        kept: &[(2, OPTION), (3, ANY)],
        ..PLAIN
    },
    Hard {
        what: "an output at a point",
        statements: "R[1]=1\nL P[1] 10mm/sec CNT100 DB 30.0mm,DO[3]=ON\nL P[R[1]+1] 10mm/sec FINE",
        edited: &[1, 2],
        ..PLAIN
    },
    Hard {
        what: "a monitor runs in parallel from where it is started",
        statements: "R[1]=1\nL P[R[1]] 10mm/sec FINE\nMONITOR WATCH\nL P[2] 10mm/sec FINE\nMONITOR END WATCH",
        edited: &[1, 2],
        ..PLAIN
    },
    Hard {
        what: "a register after the start of a monitor can have any value",
        statements: "MONITOR WATCH\nR[1]=1\nL P[R[1]] 10mm/sec FINE",
        kept: &[(3, ANY)],
        ..PLAIN
    },
    Hard {
        what: "a macro may select another frame, and the position brings its own",
        statements: "UFRAME_NUM=1\nOPEN GRIPPER\nL P[1] 10mm/sec FINE\nL P[2] 10mm/sec FINE",
        positions: &[(2, "GP1: UF : F, UT : 1, X = 1 mm, Y = 1 mm, Z = 0 mm, W = 0 deg, P = 0 deg, R = 0 deg")],
        edited: &[1],
        kept: &[(4, "user frame selected at run time")],
        ..PLAIN
    },
    Hard {
        what: "payload, override, waits and messages do nothing",
        statements: "PAYLOAD[2]\nOVERRIDE=50%\nWAIT   .50(sec)\nWAIT DI[1]=ON\nMESSAGE[go on P[1]]\nUALM[3]\nLOCK PREG\nUNLOCK PREG\nCOL DETECT OFF\nL P[2] 10mm/sec FINE",
        edited: &[2],
        ..PLAIN
    },
    Hard {
        what: "WAIT with a way out",
        statements: "UFRAME_NUM=1\nWAIT DI[1]=ON TIMEOUT,LBL[9]\nUFRAME_NUM=2\nLBL[9]\nL P[1] 10mm/sec FINE",
        edited: &[1],
        ..PLAIN
    },
    Hard {
        what: "a jump to a label by a register goes to any label",
        statements: "R[1]=GI[1]\nUFRAME_NUM=1\nL P[1] 10mm/sec FINE\nUFRAME_NUM=2\nJMP LBL[R[1]]\nLBL[1]\nL P[2] 10mm/sec FINE\nLBL[2]",
        positions: &[
            (1, "GP1: UF : F, UT : 1, X = 1 mm, Y = 1 mm, Z = 0 mm, W = 0 deg, P = 0 deg, R = 0 deg"),
            (2, "GP1: UF : F, UT : 1, X = 2 mm, Y = 1 mm, Z = 0 mm, W = 0 deg, P = 0 deg, R = 0 deg"),
        ],
        edited: &[1, 2],
        ..PLAIN
    },
    Hard {
        what: "positions that are not taught, that are twice there, and that are not there",
        statements: "L P[1] 10mm/sec FINE\nL P[2] 10mm/sec FINE\nL P[7] 10mm/sec FINE\nL P[3] 10mm/sec FINE",
        positions: &[
            (
                1,
                "GP1: UF : 1, UT : 1, CONFIG : 'N U T, 0, 0, 0', X = ******** mm, Y = 1 mm, Z = 1 mm, W = 0 deg, P = 0 deg, R = 0 deg",
            ),
            (
                2,
                "GP1: UF : 1, UT : 1, X = 1 mm, Y = 1 mm, Z = 1 mm, W = 0 deg, P = 0 deg, R = 0 deg };\nP[2]{ GP1: UF : 1, UT : 1, X = 9 mm, Y = 1 mm, Z = 1 mm, W = 0 deg, P = 0 deg, R = 0 deg",
            ),
        ],
        edited: &[3],
        kept: &[
            (1, "position that is not taught (********)"),
            (2, "position that stands twice in /POS"),
            (3, "position that is not in /POS"),
        ],
        ..PLAIN
    },
    Hard {
        what: "inches, and an axis in millimetres, are no millimetres and degrees",
        statements: "L P[1] 10mm/sec FINE\nJ P[2] 10% FINE\nL P[3] 10mm/sec FINE",
        positions: &[
            (1, "GP1: UF : 1, UT : 1, X = 1 inch, Y = 1 inch, Z = 1 inch, W = 0 deg, P = 0 deg, R = 0 deg"),
            (2, "GP1: UF : 1, UT : 1, J1 = 100 mm, J2 = 0 deg, J3 = 0 deg, J4 = 0 deg, J5 = 0 deg, J6 = 0 deg"),
        ],
        edited: &[3],
        kept: &[
            (1, "position whose units are not millimetres and degrees"),
            (2, "position whose units are not millimetres and degrees"),
        ],
        ..PLAIN
    },
    Hard {
        what: "another group that stands elsewhere than at zero",
        statements: "L P[1] 10mm/sec FINE\nL P[2] 10mm/sec FINE",
        positions: &[
            (
                1,
                "GP1: UF : 1, UT : 1, X = 1 mm, Y = 1 mm, Z = 1 mm, W = 0 deg, P = 0 deg, R = 0 deg GP2: UF : 1, UT : 1, J1 = 90.000 deg",
            ),
            (
                2,
                "GP1: UF : 1, UT : 1, X = 1 mm, Y = 1 mm, Z = 1 mm, W = 0 deg, P = 0 deg, R = 0 deg GP2: UF : 1, UT : 1, J1 = .000 deg",
            ),
        ],
        edited: &[1, 2],
        ..PLAIN
    },
    Hard {
        what: "a program of the other group alone",
        statements: "J P[1] 10% FINE",
        positions: &[(1, "GP2: UF : 1, UT : 1, J1 = 90.000 deg")],
        kept: &[(1, "position of other motion groups alone")],
        ..PLAIN
    },
    Hard {
        what: "groups that move each in its own way",
        statements: "Independent GP\n:  GP1 L P[1] 10mm/sec FINE\n:  GP2 J P[1] 10% FINE\nL P[2] 10mm/sec FINE",
        edited: &[2],
        kept: &[(1, "several motion groups, each with a motion of its own")],
        ..PLAIN
    },
    Hard {
        what: "a program that follows a conveyor",
        head: "/APPL\nLINE_TRACK;\n  LINE_TRACK_SCHEDULE_NUMBER      : 1;\n  LINE_TRACK_BOUNDARY_NUMBER      : 0;\n",
        statements: "L P[1] 10mm/sec FINE",
        kept: &[(1, "follows a conveyor (LINE_TRACK)")],
        ..PLAIN
    },
    Hard {
        what: "the same head without a schedule",
        head: "/APPL\nLINE_TRACK;\n  LINE_TRACK_SCHEDULE_NUMBER      : 0;\n  LINE_TRACK_BOUNDARY_NUMBER      : 0;\n",
        statements: "L P[1] 10mm/sec FINE",
        edited: &[1],
        ..PLAIN
    },
    Hard {
        what: "axes that yield, and weaving",
        statements: "L P[1] 10mm/sec FINE\nSOFTFLOAT[1]\nL P[2] 10mm/sec FINE\nSOFTFLOAT END\nWeave Sine[1]\nL P[3] 10mm/sec FINE",
        edited: &[1],
        kept: &[(3, "axes yield at run time (SOFTFLOAT)"), (6, "path is moved at run time (tracking)")],
        ..PLAIN
    },
    Hard {
        what: "palletizing, position registers and remarks with positions in them",
        statements: "!L P[1] 10mm/sec FINE\n//L P[2] 10mm/sec FINE\n--eg:P[3]\nL PAL_1[BTM] 10mm/sec FINE\nJ PR[9] 10% FINE\nL P[1:a ; P of 2] 10mm/sec FINE\nL P[2] 10mm/sec FINE",
        edited: &[1, 2],
        kept: &[(4, "palletizing motion (PAL)"), (5, "motion to a position register (PR)")],
        ..PLAIN
    },
    Hard {
        what: "what follows END is not run",
        statements: "L P[1] 10mm/sec FINE\nEND\nL P[2] 10mm/sec FINE",
        edited: &[1],
        kept: &[(3, "motion that nothing reaches")],
        ..PLAIN
    },
    Hard {
        what: "a circle with a point that only a run knows",
        statements: "C P[1] PR[2] 10mm/sec FINE\nC P[2]\n:  P[3] 10mm/sec FINE\nC P[3] P[1] 10mm/sec FINE",
        kept: &[
            (1, "motion to a position register (PR)"),
            (2, HALF_ARC),
            (4, HALF_ARC),
            (4, "also the position of a motion that is moved at run time"),
        ],
        ..PLAIN
    },
    Hard {
        what: "a circle recorded in two frames",
        statements: "C P[1] P[2] 10mm/sec FINE\nL P[3] 10mm/sec FINE",
        positions: &[(2, "GP1: UF : 2, UT : 1, X = 1 mm, Y = 1 mm, Z = 0 mm, W = 0 deg, P = 0 deg, R = 0 deg")],
        edited: &[3],
        kept: &[(1, "arc whose points are recorded in different frames")],
        ..PLAIN
    },
    Hard {
        what: "three A in a row, with a remark and a mark between",
        statements: "A P[1] 10mm/sec FINE\n!up\nA P[2] 10mm/sec CNT100\n! deflex air\nA P[3] 10mm/sec FINE\nL P[4] 10mm/sec FINE",
        edited: &[1, 2, 3, 4],
        ..PLAIN
    },
    Hard {
        what: "two A in a row are no arc; nor are those with something else between, or a label",
        statements: "A P[1] 10mm/sec FINE\nA P[2] 10mm/sec FINE\nDO[1]=ON\nA P[3] 10mm/sec FINE\nLBL[1]\nA P[4] 10mm/sec FINE\nL P[5] 10mm/sec FINE",
        edited: &[5],
        kept: &[(1, FEW), (2, FEW), (4, FEW), (6, FEW)],
        ..PLAIN
    },
    Hard {
        what: "A with one point that stays holds its arc, and an arc that shares a point",
        statements: "A P[1] 10mm/sec FINE\nA P[2] 10mm/sec FINE\nA P[3] 10mm/sec FINE\nPR[1,1]=P[2,1]\nC P[4] P[3] 10mm/sec FINE\nL P[5] 10mm/sec FINE",
        edited: &[5],
        kept: &[(1, HALF_ARC), (2, NAMED), (3, HALF_ARC), (5, HALF_ARC)],
        ..PLAIN
    },
    Hard {
        what: "A with an offset, and A left on the way",
        statements: "A P[1] 10mm/sec FINE\nA P[2] 10mm/sec FINE Offset,PR[1]\nA P[3] 10mm/sec FINE\nL P[5] 10mm/sec FINE",
        edited: &[5],
        kept: &[(1, HALF_ARC), (2, "moved by a position register (Offset)"), (3, HALF_ARC)],
        ..PLAIN
    },
];

#[test]
fn hard_programs_are_right_or_kept_with_a_reason() {
    assert!(HARD.len() >= 40);
    HARD.iter().for_each(|hard| drop(judge(hard)));
}

/// The turn of a user frame is that about the fixed axes x, y, z by W, P, R; each motion has the values that were set last.
#[test]
#[allow(clippy::float_cmp)] // numbers that the program states, to the bit
fn frames_have_the_values_of_the_position_register() {
    let set = |numbers: [f64; 6], wanted: &str| {
        let elements = (1..).zip(numbers).map(|(element, number)| format!("PR[9,{element}]={number:.3}\n"));
        elements.collect::<String>() + wanted + "=PR[9]\n"
    };
    let statements = [
        set([1150.0, -100.0, -250.5, 0.0, 0.0, 90.0], "UFRAME[1]"),
        set([0.0, 0.0, 220.0, 180.0, 0.0, 0.0], "UTOOL[1]"),
        "L P[1] 10mm/sec FINE\n".to_owned(),
        set([1.0, 2.0, 3.0, 0.0, 0.0, 0.0], "UFRAME[1]"),
        "L P[2] 10mm/sec FINE".to_owned(),
    ]
    .concat();
    let kept: &[(usize, &str)] = &[];
    let hard = Hard { what: "RoboDK", statements: statements.leak(), edited: &[1, 2], kept, ..PLAIN };
    let program = judge(&hard);
    let user = |target: usize| program.wobjs[usize::from(program.targets[target].wobj)].data.unwrap();
    let is_near = |a: [f64; 4], b: [f64; 4]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12);
    let half = std::f64::consts::FRAC_1_SQRT_2;
    assert_eq!((user(0).uframe_mm, user(1).uframe_mm), ([1150.0, -100.0, -250.5], [1.0, 2.0, 3.0]));
    assert!(is_near(user(0).uframe_quat, [half, 0.0, 0.0, half]) && is_near(user(1).uframe_quat, [1.0, 0.0, 0.0, 0.0]));
    let tool = program.tools[usize::from(program.targets[1].tool)].data.unwrap();
    assert_eq!(tool.tcp_mm, [0.0, 0.0, 220.0]);
    assert!(is_near(tool.tcp_quat.map(f64::abs), [0.0, 1.0, 0.0, 0.0]));
    assert_eq!(&*program.wobjs[0].name, "UF 1");
}

/// A program that is given with `--context` changes what it assigns and nothing else.
#[test]
fn a_program_that_is_given_changes_what_it_says() {
    let hard = Hard {
        what: "called",
        statements: "R[1]=1\nR[2]=2\nCALL OTHER\nL P[R[1]] 10mm/sec FINE\nL P[R[2]] 10mm/sec FINE",
        ..PLAIN
    };
    let other = "/PROG  OTHER\n/ATTR\n/MN\n   1:  R[1]=3 ;\n/POS\n/END\n";
    let edited = |context: &[&str]| {
        let program = read(&hard, context);
        program.targets.iter().filter(|target| target.editable == Editable::Pose).count()
    };
    // Not given: any register; given: it is as if its statement stood in place of the call.
    assert_eq!((edited(&[]), edited(&[other])), (0, 2));
    let unknown = other.replace("R[1]=3", "R[1]=DI[1]");
    assert_eq!(edited(&[&unknown]), 0);
    let quiet = other.replace("R[1]=3", "R[9]=3");
    assert_eq!(edited(&[&quiet]), 2);
    let soft = other.replace("R[1]=3", "SOFTFLOAT[1]");
    assert_eq!(edited(&[&soft]), 0);
}

const SUB1: &str = "/PROG  SUB1\n/ATTR\n/MN\n   1:  UFRAME[1]=PR[3] ;\n/POS\n/END\n";
const SUB2: &str = "/PROG  SUB2\n/ATTR\n/MN\n   1:  R[9]=1 ;\n/POS\n/END\n";

/// What programs that are given do to frames is seen, however they come to run.
#[test]
fn frames_that_called_programs_set_hold_no_longer() {
    // Statements of `OTHER`, which the program calls between two motions.
    for called in [
        "IF DI[1]=ON,CALL SUB1(1,2)",
        "IF SR[1]='a,b',CALL SUB1",
        "IF (DI[1]=ON AND R[1]=2),UFRAME[1]=PR[3]",
        "IF (DI[1]=ON),$MNUFRAME[1,1]=PR[3]",
        "SELECT R[1]=1,CALL SUB2(1,2)\n:  =2,CALL SUB1(1,2)",
        "SELECT R[1]=1,CALL SUB2\n-  =2,CALL SUB1\n-  ELSE,CALL SUB2",
        "SELECT R[1]=1,CALL SUB2\n:  ELSE,CALL SUB1(1,2)",
        "L P[1] 5mm/sec FINE TB .10sec,CALL SUB1",
        "L P[1] 5mm/sec FINE DB 5.0mm,CALL SUB1(1)",
        "RUN SUB1",
        "MONITOR SUB1",
        "ERROR_PROG=SUB1",
        "RESUME_PROG[1]=SUB1",
        "WHEN DI[1]=ON,CALL SUB1",
        "CALL SR[1]",
        "CALL SUB2(1,2)\nCALL SUB1",
    ] {
        let mut other = "/PROG  OTHER\n/ATTR\n/MN\n".to_owned();
        for line in called.lines() {
            // Rows that a colon begins end with a semicolon before, those with a dash do not.
            match (line.strip_prefix(':'), line.strip_prefix('-')) {
                (Some(row), _) => other += &format!(" ;\n    :{row}"),
                (_, Some(row)) => other += &format!("\n    :{row}"),
                _ if other.ends_with("/MN\n") => other += &format!("   1:{line}"),
                _ => other += &format!(" ;\n   2:{line}"),
            }
        }
        other += " ;\n/POS\n/END\n";
        let hard = Hard { what: called, statements: "L P[1] 10mm/sec FINE\nCALL OTHER\nL P[2] 10mm/sec FINE", ..PLAIN };
        let program = read(&hard, &[&other, SUB1, SUB2]);
        let kept: Vec<_> = program.kept.iter().map(|kept| (kept.line, kept.reason.text())).collect();
        assert_eq!(kept, [(4, REDEFINED), (6, REDEFINED)], "{called}");
        // The same in the program itself.
        let own = format!("L P[3] 10mm/sec FINE\n{}\nL P[2] 10mm/sec FINE", called.replace("\n-", "\n "));
        let hard = Hard { what: called, statements: "", ..PLAIN };
        let mut text = String::from("/PROG  M\n/ATTR\n/MN\n");
        for line in own.lines() {
            text += &format!("    :{} ;\n", line.trim_start_matches(':'));
        }
        text += &format!("/POS\nP[1]{{ {0} }};\nP[2]{{ {0} }};\nP[3]{{ {0} }};\n/END\n", body("UF : 1, UT : 1", 1));
        let context = [SUB1, SUB2].map(|text| Source::new("other.ls", text.as_bytes())).to_vec();
        let program = tp::read(vec![Source::new("m.ls", text)], context).unwrap();
        let last = program.kept.last().map(|kept| kept.reason.text());
        assert_eq!(last, Some(REDEFINED), "{}: {:?}", hard.what, program.kept);
    }
    // Statements of point logic, and a program that calls itself.
    let logic = "L P[1] 10mm/sec FINE TB .10sec,P-SPS\nUFRAME[1]=PR[3]\n------\nL P[2] 10mm/sec FINE";
    let program = read(&Hard { what: "point logic", statements: logic, ..PLAIN }, &[]);
    assert!(program.kept.iter().any(|kept| kept.reason.text() == REDEFINED), "{:?}", program.kept);
}

/// A called program whose first motion is an increment counts from where the program that calls it stands.
#[test]
fn a_called_program_may_count_from_where_the_robot_stands() {
    let sub = |statements: &str| format!("/PROG  OTHER\n/ATTR\n/MN\n{statements}/POS\n/END\n");
    let first = sub("   1:L P[1] 10mm/sec FINE INC ;\n");
    let later = sub("   1:L P[2] 10mm/sec FINE ;\n   2:L P[1] 10mm/sec FINE INC ;\n");
    let maybe = sub(
        "   1:IF DI[1]=ON,JMP LBL[1] ;\n   2:L P[2] 10mm/sec FINE ;\n   3:LBL[1] ;\n   4:L P[1] 10mm/sec FINE INC ;\n",
    );
    let nested = "/PROG  OUTER\n/ATTR\n/MN\n   1:  CALL OTHER ;\n/POS\n/END\n";
    for (call, context, edited) in [
        ("CALL OTHER", vec![&*first], &[1_u32, 3][..]),
        ("CALL OTHER", vec![&*later], &[1, 2, 3]),
        ("CALL OTHER", vec![&*maybe], &[1, 3]),
        ("CALL OUTER", vec![&*first, nested], &[1, 3]),
        ("IF DI[1]=ON,CALL OTHER(1,2)", vec![&*first], &[1, 3]),
        ("SELECT R[1]=1,CALL OTHER", vec![&*first], &[1, 3]),
    ] {
        let statements = format!("L P[1] 10mm/sec FINE\nL P[2] 10mm/sec FINE\n{call}\nL P[3] 10mm/sec FINE");
        let statements: &'static str = statements.leak();
        let program = read(&Hard { what: call, statements, ..PLAIN }, &context);
        let free: Vec<u32> =
            program.targets.iter().filter(|t| t.editable == Editable::Pose).map(|t| t.ordinal).collect();
        assert_eq!(free, edited, "{call}: {:?}", program.kept);
    }
}

/// An increment after a call counts from where the called program ends, and the first motion of a called program comes from where its
/// caller stands.
#[test]
fn a_caller_counts_from_where_the_called_program_ends() {
    let caller = |statements: &str| format!("/PROG  OUTER\n/ATTR\n/MN\n{statements}/POS\n/END\n");
    let nested = "/PROG  OTHER\n/ATTR\n/MN\n   1:  CALL M ;\n/POS\n/END\n";
    let inc = "L P[9] 10mm/sec FINE INC";
    for (calls, edited) in [
        (format!("   1:CALL M ;\n   2:R[1]=2 ;\n   3:{inc} ;\n"), &[1_u32][..]),
        (format!("   1:IF DI[1]=ON,CALL M ;\n   2:{inc} ;\n"), &[1]),
        (format!("   1:CALL OTHER ;\n   2:{inc} ;\n"), &[1]),
        (format!("   1:LBL[1] ;\n   2:{inc} ;\n   3:CALL M ;\n   4:JMP LBL[1] ;\n"), &[1]),
        (format!("   1:CALL M ;\n   2:L P[8] 10mm/sec FINE ;\n   3:{inc} ;\n"), &[1, 2]),
        (format!("   1:{inc} ;\n   2:CALL M ;\n"), &[1, 2]),
    ] {
        let program = read(
            &Hard { what: "called", statements: "L P[1] 10mm/sec FINE\nL P[2] 10mm/sec FINE", ..PLAIN },
            &[&caller(&calls), nested],
        );
        let free: Vec<u32> =
            program.targets.iter().filter(|t| t.editable == Editable::Pose).map(|t| t.ordinal).collect();
        assert_eq!(free, edited, "{calls}: {:?}", program.kept);
        assert_eq!(program.targets[0].predecessor, Predecessor::Unknown);
    }
    // The next cycle counts from where this one ends.
    let statements = "L P[9] 10mm/sec FINE INC\nL P[1] 10mm/sec FINE\nL P[2] 10mm/sec FINE";
    let program = read(&Hard { what: "two cycles", statements, ..PLAIN }, &[]);
    let free: Vec<u32> = program.targets.iter().filter(|t| t.editable == Editable::Pose).map(|t| t.ordinal).collect();
    assert_eq!(free, [2]);
}

/// A call that runs some time before or after a point does not change the options that follow it.
#[test]
fn options_after_a_timed_call_count() {
    let statements = "L P[1] 10mm/sec FINE TB .10sec,CALL SUB2 Offset,PR[1]\nL P[2] 10mm/sec FINE TB .10sec,DO[1]=ON";
    let program = read(&Hard { what: "timed", statements, ..PLAIN }, &[SUB2]);
    let kept: Vec<_> = program.kept.iter().map(|kept| (kept.line - 3, kept.reason.text())).collect();
    assert_eq!(kept, [(1, "moved by a position register (Offset)")]);
}

/// A circle through the points of `A` motions: each is an end of its own, with a circle point on the way.
#[test]
fn circle_arc_motions_by_hand() {
    // Radius 10 about (0, 0) in a plane of the user frame: at 0°, 90°, 180°, and 270° on another circle of radius 10.
    let at = |x: f64, y: f64| {
        format!(
            "GP1: UF : 1, UT : 1, CONFIG : 'N U T, 0, 0, 0', X = {x:.3} mm, Y = {y:.3} mm, Z = 5.000 mm, W = 180.000 deg, P = 0.000 deg, R = 0.000 deg"
        )
    };
    let positions: Vec<String> = [(10.0, 0.0), (0.0, 10.0), (-10.0, 0.0), (0.0, -10.0)].map(|(x, y)| at(x, y)).to_vec();
    let mut text = "/PROG  M\n/ATTR\n/MN\n".to_owned();
    for i in 1..=4 {
        text += &format!("{i:4}:A P[{i}] 10mm/sec CNT100 ;\n");
    }
    text += "/POS\n";
    for (i, body) in positions.iter().enumerate() {
        text += &format!("P[{}]{{ {body} }};\n", i + 1);
    }
    text += "/END\n";
    let program = tp::read(vec![Source::new("m.ls", text.as_bytes())], Vec::new()).unwrap();
    let seen: Vec<_> = program.targets.iter().map(|t| (t.ordinal, t.role, t.motion, t.line)).collect();
    assert_eq!(
        seen,
        [
            (1, Role::End, Motion::Linear, 4),
            (2, Role::Via, Motion::Circular, 5),
            (2, Role::End, Motion::Circular, 5),
            (3, Role::Via, Motion::Circular, 6),
            (3, Role::End, Motion::Circular, 6),
            (4, Role::Via, Motion::Circular, 7),
            (4, Role::End, Motion::Circular, 7),
        ]
    );
    assert_eq!((program.motion_targets(), program.arcs, program.literal_targets), (4, 3, 4));
    let diagonal = 10.0 * std::f64::consts::FRAC_1_SQRT_2;
    let vias = [[diagonal, diagonal, 5.0], [-diagonal, diagonal, 5.0], [-diagonal, -diagonal, 5.0]];
    for (target, wanted) in program.targets.iter().filter(|t| t.role == Role::Via).zip(vias) {
        let Goal::Pose { position_mm, .. } = target.goal else { panic!() };
        assert!(position_mm.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-9), "{position_mm:?} {wanted:?}");
    }
    // Corrected, the circle points are where the ends lead the controller: all moved by one shift.
    let change = |i: usize| {
        let Goal::Pose { position_mm: [x, y, z], .. } = program.targets[i].goal else { panic!() };
        Some(deflex::program::Change { position_mm: [x + 0.25, y - 0.5, z], quat: None, conf: None, external: None })
    };
    let changes: Vec<_> = (0..7).map(change).collect();
    let rewritten = program.rewrite(&changes, &[], &deflex::program::RewriteOptions::default());
    assert_eq!((rewritten.kept.len(), rewritten.edits[0].len()), (0, 8));
    for (i, [x, y, z]) in [(1, vias[0]), (3, vias[1]), (5, vias[2])] {
        let held = rewritten.written[i].0;
        let wanted = [x + 0.25, y - 0.5, z];
        assert!(held.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-5), "{held:?} {wanted:?}");
    }
    // One that is not written holds the others.
    let disputed = text.replace("/POS", "   5:L P[4] 5mm/sec FINE ;\n/POS");
    let program = tp::read(vec![Source::new("m.ls", disputed)], Vec::new()).unwrap();
    let mut changes = changes;
    changes.push(None);
    let rewritten = program.rewrite(&changes, &[], &deflex::program::RewriteOptions::default());
    assert_eq!(rewritten.edits[0].len(), 0);
    assert_eq!(rewritten.kept.iter().map(|kept| kept.0).collect::<Vec<_>>(), [0, 2, 4, 6]);
}
